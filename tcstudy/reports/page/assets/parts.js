// Parts of a page as the data have them: panels, tables, sheets of columns, states of the contact line.
// Puts parts into a host; lists that scroll stay where they are.
TC.show = function (host, parts, ...before) {
  const width = TC.width(host);
  const tops = [...host.querySelectorAll(".scroll")].map((box) => box.scrollTop);
  TC.fill(
    host,
    ...before,
    parts.map((one) => TC.part[one.part](one, width)),
  );
  host.querySelectorAll(".scroll").forEach((box, k) => {
    box.scrollTop = tops[k] || 0;
  });
};
TC.count = 0; // of the states that a slider counts

TC.part = {
  text(p) {
    const notes = p.lines.map((line) => TC.note(line));
    const rest =
      notes.length > 12
        ? TC.el("details", {}, TC.el("summary", {}, `${notes.length - 8} more`), notes.splice(8))
        : null;
    return TC.el("div", {}, notes, rest);
  },
  table(p) {
    const left = p.head.map((_, k) => !p.rows.every((row) => /^$|^[-+–∞−(\d]/.test(row[k])));
    return TC.el(
      "div",
      {},
      p.caption ? TC.h3(p.caption) : null,
      TC.wide(p.head, p.rows, (k) => left[k] && "text"),
      p.notes.map((note) => TC.note(note)),
    );
  },
  beside(p, width) {
    const two = width > 760 && p.parts.length > 1;
    return TC.el(
      "div",
      { class: two ? "columns" : "" },
      p.parts.map((one) =>
        TC.panel(TC.part[one.part](one, two ? Math.floor(width / 2 - 14) : width)),
      ),
    );
  },
  // One of several lists of parts.
  choice(p, width) {
    const k = Math.max(0, p.options.indexOf(TC.state[p.key]));
    return TC.el(
      "div",
      {},
      p.options.length > 1
        ? TC.el(
            "div",
            { class: "controls noprint" },
            TC.choice(
              p.label,
              p.options.map((one) => [one, one]),
              p.options[k],
              (one) => TC.set({ [p.key]: one }),
            ),
          )
        : null,
      p.parts[k].map((one) => TC.part[one.part](one, width)),
    );
  },
  states(p) {
    TC.count = p.texts.length;
    TC.state.step = TC.whole(TC.state.step, TC.count, p.first);
    return TC.el(
      "div",
      { class: "controls noprint" },
      TC.slider(p.label, p.texts, TC.state.step, (step) => TC.set({ step })),
    );
  },
  facts: (p) =>
    TC.facts(
      p.columns.map((c) => [
        c.title,
        typeof c.v[TC.state.step] === "number"
          ? TC.quantity(c.v[TC.state.step], c.units)
          : c.v[TC.state.step],
      ]),
    ),

  panel(given, width) {
    const p = { ...given, items: given.items.map(TC.looks) };
    const range = (k) => {
      const axis = "xy"[k];
      const plain = ["line", "marks", "fill", "cells", "arrow"];
      const values = p.items
        .filter((i) => plain.includes(i.kind) || (k && i.kind === "across"))
        .flatMap((i) =>
          TC.range(
            Array.from(i[axis]).filter((v) => !p.log[k] || v > 0),
            [],
          ),
        );
      const found = TC.pad(
        TC.range(values, p.log[k] ? [1, 10] : [0, 1]),
        p.items.some((i) => i.kind === "cells") ? 0 : 0.06,
        p.log[k],
      );
      const given = p.limits[k] || [null, null];
      return found.map((v, e) => given[e] ?? v);
    };
    const ticks = p.ticks
      ? p.ticks[0].map((at, i) => [at, p.ticks[1][i]]).sort((a, b) => a[0] - b[0])
      : null;
    const plot = new TC.Plot({
      width,
      height: p.high,
      x: range(0),
      y: range(1),
      xlog: p.log[0],
      ylog: p.log[1],
      xlabel: p.labels[0],
      ylabel: p.labels[1],
      label: p.title || p.labels[1],
      margin: { left: 70, right: 16, top: 12, bottom: 46 },
      xticks: ticks && ticks.map((t) => t[0]),
      xtext: ticks && ((v) => ticks.find((t) => t[0] === v)[1]),
    });
    const key = new Map();
    for (const item of p.items) TC.draw_item[item.kind](plot, item, key, p.items);
    if (p.at) {
      const [x, y] = p.at;
      const s = TC.state.step;
      const places = [...x.keys()].filter((i) => Number.isFinite(x[i]) && Number.isFinite(y[i]));
      if (places.includes(s))
        plot.dot(
          x[s],
          y[s],
          { r: 9, fill: "none", stroke: "var(--ink)", "stroke-width": 2.2 },
          "the state that is chosen",
        );
      plot.svg.style.cursor = "pointer";
      plot.svg.addEventListener("click", (e) => {
        const box = plot.svg.getBoundingClientRect();
        const far = (i) =>
          Math.hypot(plot.px(x[i]) - e.clientX + box.left, plot.py(y[i]) - e.clientY + box.top);
        TC.set({ step: places.reduce((best, i) => (far(i) < far(best) ? i : best), places[0]) });
      });
    }
    return TC.el(
      "div",
      {},
      p.title ? TC.h3(p.title) : null,
      plot.svg,
      key.size
        ? TC.el(
            "div",
            { class: "legend" },
            [...key.values()],
            p.at ? "ring: the state that is chosen" : "",
          )
        : null,
    );
  },

  sheet(p, width) {
    const s = TC.state;
    const short = TC.short;
    const rows = [...p.columns[0].v.keys()];
    const numeric = p.columns.filter((c) => typeof c.v[0] === "number");
    const columns = p.columns.map((c, k) => {
      // more than seven do not fit on paper
      const number = numeric.includes(c);
      const scale = number ? TC.scale(c.v, c.units) : { by: 1, unit: "" };
      return {
        minor: k > 6,
        title: TC.titled(short(c), scale),
        long: c.title,
        csv: c.name + (c.units !== "1" ? ` [${c.units}]` : ""),
        left: !number,
        get: (i) => c.v[i],
        text: (i) => (number ? TC.number(c.v[i] / scale.by, 5) : c.v[i]),
        name: c.name,
        scale,
      };
    });
    const states = p.states
      ? { chosen: (i) => i === s.step, pick: (step) => TC.set({ step }) }
      : {};
    const t = TC.table({
      columns,
      rows,
      ...TC.sorting(`${p.file}_by`, `${p.file}_down`),
      ...states,
    });
    const button = TC.el(
      "button",
      {
        "aria-label": "csv",
        onclick: () => TC.saveTable(`${TC.fileName()}-${p.file}.csv`, columns, t.order),
      },
      "Download as CSV",
    );
    return TC.el(
      "div",
      {},
      p.chart ? TC.part.chart(p, numeric, columns, width) : null,
      TC.el(
        "div",
        { class: "controls noprint" },
        button,
        p.states ? TC.el("span", { class: "note" }, "a click on a row chooses it") : null,
      ),
      TC.el("div", { class: "scroll" }, t.node),
    );
  },
  // Any column of a sheet over any other.
  chart(p, numeric, columns, width) {
    const short = TC.short;
    const [x, y] = [0, 1].map(
      (k) =>
        numeric.find((c) => c.name === TC.state["xy"[k] + "of"]) ||
        numeric.find((c) => c.name === p.chart[k]),
    );
    const scales = [x, y].map((c) => columns.find((o) => o.name === c.name).scale);
    const drawn = [x, y].map((c, k) => Array.from(c.v, (v) => v / scales[k].by));
    const options = numeric.map((c) => [c.name, c.title]);
    const items = [{ kind: "line", x: drawn[0], y: drawn[1], colour: "var(--c1)", width: 1.8 }];
    const labels = [x, y].map((c, k) => TC.titled(short(c), scales[k]));
    return TC.el(
      "div",
      {},
      TC.el(
        "div",
        { class: "controls noprint" },
        TC.choice("draw", options, y.name, (yof) => TC.set({ yof })),
        TC.choice("over", options, x.name, (xof) => TC.set({ xof })),
      ),
      TC.part.panel(
        {
          title: `${short(y)} over ${short(x)}`,
          labels,
          log: [false, false],
          limits: [null, null],
          items,
          high: 260,
          at: p.states ? drawn : null,
        },
        Math.min(width, 760),
      ),
    );
  },

  line(p, width) {
    const line = { ...p.line, moves: p.moves };
    const m = line.x.length;
    const k = TC.state.step;
    const host = TC.el("div");
    const one = {
      line,
      u: TC.row(line.u_T, k),
      xi: TC.row(line.xi, k),
      N: line.N && TC.row(line.N, k),
      state: p.state.subarray(k * m, (k + 1) * m),
    };
    TC.point.profiles(host, line, [one], { ...TC.point.frame(line, width), shape: false }, "");
    if (p.law)
      host.append(
        TC.point.lawPlot(Math.min(width, 560), `Friction law (${p.law.name})`, p.law, [one], line),
      );
    return host;
  },
};

// The look of an item, by matplotlib's names, as attributes of SVG; what is one already stays.
TC.looks = function (i) {
  const dash = i.linestyle ?? "-";
  const open = i.fillstyle === "none" || ["white", "none"].includes(i.markerfacecolor);
  return {
    colour: i.color,
    width: i.linewidth && 1.5 * i.linewidth,
    dash:
      typeof dash === "string"
        ? { "--": "7 4", ":": "1 3", none: "none" }[dash]
        : dash[1].map((part) => 2 * part).join(" "),
    mark: i.marker,
    size: 0.7 * (i.markersize ?? 4),
    open,
    anchor: { right: "end", center: "middle" }[i.ha],
    ...i,
  };
};
TC.MARKS = {
  o: "circle",
  s: "square",
  "^": "triangle",
  D: "diamond",
  x: "cross",
  X: "cross",
  P: "cross",
  "*": "diamond",
  ">": "triangle",
  v: "triangle",
};
TC.look = (i) => ({
  stroke: i.colour,
  "stroke-width": i.width || 1.5,
  "stroke-dasharray": i.dash,
  opacity: i.alpha,
});
// What a panel has, each kind in its own way; key: entries by label.
TC.draw_item = {
  line(plot, i, key) {
    const joined = i.dash !== "none";
    const mark =
      i.mark &&
      ((x, y) =>
        TC.marker(TC.MARKS[i.mark], x, y, i.size, {
          fill: i.open ? "var(--bg)" : i.colour,
          stroke: i.colour,
          "stroke-width": 1.4,
          opacity: i.alpha,
          class: "mark",
        }));
    if (joined) plot.line(i.x, i.y, TC.look(i));
    const every = Math.ceil(i.x.length / 2000);
    if (mark)
      for (let k = 0; k < i.x.length; k += every)
        if (Number.isFinite(i.x[k]) && Number.isFinite(i.y[k]))
          plot.inner.append(mark(plot.px(i.x[k]), plot.py(i.y[k])));
    if (i.label)
      key.set(
        i.label,
        TC.entry(
          28,
          12,
          [joined ? TC.dash(28, 6, TC.look(i)) : "", mark ? mark(14, 6) : ""],
          i.label,
        ),
      );
  },
  // Marks of their own looks, each with its tip and what a click does: shape, r, stroke, fill(k), tip(k), pick(k).
  marks(plot, i) {
    for (let k = 0; k < i.x.length; k++)
      if (Number.isFinite(i.x[k]) && Number.isFinite(i.y[k])) {
        const mark = TC.marker(i.shape, plot.px(i.x[k]), plot.py(i.y[k]), i.r, {
          fill: i.fill(k),
          stroke: i.stroke || i.fill(k),
          "stroke-width": 1.5,
          "fill-opacity": i.alpha,
          class: i.pick && "mark",
          onclick: i.pick && (() => i.pick(k)),
        });
        if (i.tip) mark.append(TC.svgNode("title", {}, i.tip(k)));
        plot.over.append(mark);
      }
  },
  fill(plot, i, key) {
    const d = Array.from(
      i.x,
      (x, k) => `${k ? "L" : "M"}${plot.px(x).toFixed(1)},${plot.py(i.y[k]).toFixed(1)}`,
    ).join("");
    if (i.x.length)
      plot.inner.append(
        TC.svgNode("path", { d: `${d}Z`, fill: i.colour, opacity: i.alpha, stroke: "none" }),
      );
    if (i.label)
      key.set(
        i.label,
        TC.swatch(`color-mix(in srgb, ${i.colour} ${100 * i.alpha}%, transparent)`, i.label),
      );
  },
  up: (plot, i) => plot.vertical(i.x[0], TC.look(i)),
  across: (plot, i) =>
    plot.inner.append(
      TC.svgNode("line", {
        x1: plot.left,
        x2: plot.right,
        y1: plot.py(i.y[0]),
        y2: plot.py(i.y[0]),
        ...TC.look(i),
      }),
    ),
  rows: (plot, i) =>
    plot.back.prepend(
      TC.svgNode("rect", {
        x: plot.left,
        width: plot.right - plot.left,
        y: plot.py(i.y[1]),
        height: Math.max(0, plot.py(i.y[0]) - plot.py(i.y[1])),
        fill: "var(--shade)",
      }),
    ),
  note: (plot, i) =>
    plot.text(plot.px(i.x[0]) + i.shift[0], plot.py(i.y[0]) - i.shift[1] + 4, i.text, {
      "text-anchor": i.anchor,
      style: i.colour ? `fill:${i.colour}` : "",
    }),
  arrow(plot, i) {
    const [a, b] = [0, 1].map((k) => [plot.px(i.x[k]), plot.py(i.y[k])]);
    const far = Math.hypot(b[0] - a[0], b[1] - a[1]) || 1;
    const [c, s] = [(b[0] - a[0]) / far, (b[1] - a[1]) / far];
    const at = (back, side) => `${b[0] - back * c - side * s},${b[1] - back * s + side * c}`;
    plot.inner.append(
      TC.svgNode("line", {
        x1: a[0],
        y1: a[1],
        x2: b[0],
        y2: b[1],
        stroke: i.colour,
        "stroke-width": i.width || 0,
      }),
      TC.svgNode("path", { d: `M${at(9, 4)}L${at(0, 0)}L${at(9, -4)}Z`, fill: i.colour }),
    );
  },
  // Each name once, where no other name nor the edge is in the way and as few lines and other dots as can be.
  names(plot, i, key, items) {
    const taken = [];
    const at = (o, k) => [plot.px(o.x[k]), plot.py(o.y[k])];
    const curve = [];
    for (const o of items)
      if (o.kind === "line" && o.dash !== "none")
        for (let k = 1; k < o.x.length; k++) {
          const [a, b] = [at(o, k - 1), at(o, k)];
          for (let t = 0; t < 40; t++)
            curve.push([a[0] + (t / 40) * (b[0] - a[0]), a[1] + (t / 40) * (b[1] - a[1])]);
        }
    const dots = i.texts.map((_, k) => at(i, k));
    const within = (list, x, y, w, h) =>
      list.filter((o) => Math.abs(o[0] - x) < w && Math.abs(o[1] - y) < h).length;
    i.texts.slice(0, 60).forEach((name, k) => {
      if (taken.some((t) => t.name === name)) return;
      const [px, py] = dots[k];
      const half = 3.3 * name.length;
      const others = dots.filter((o) => Math.hypot(o[0] - px, o[1] - py) > 8);
      const free = [
        [1, -10],
        [-1, -10],
        [1, 12],
        [-1, 12],
        [0, -24],
        [0, 26],
      ]
        .map(([side, up]) => ({ name, x: px + side * (8 + half), y: py + up, half }))
        .filter(
          (o) =>
            o.y < plot.bottom - 4 &&
            o.x - half > plot.left &&
            o.x + half <= plot.right &&
            !taken.some((t) => Math.abs(o.x - t.x) < half + t.half && Math.abs(o.y - t.y) < 13),
        )
        .map((o) => ({
          ...o,
          hits: within(curve, o.x, o.y, half, 6) + 20 * within(others, o.x, o.y, half + 8, 12),
        }))
        .sort((a, b) => a.hits - b.hits);
      if (!free.length) return;
      taken.push(free[0]);
      plot.text(free[0].x, free[0].y + 4, name, { "text-anchor": "middle" });
    });
  },
  // Neighbours of one kind in a column are one shape, and all of a kind one path.
  cells(plot, i, key) {
    const [n, m] = i.kinds.shape;
    const paths = i.colours.map(() => "");
    for (let c = 0; c < n; c++)
      for (let r = 0; r < m;) {
        const kind = i.kinds[c * m + r];
        const from = r;
        while (r < m && i.kinds[c * m + r] === kind) r++;
        if (kind >= 0)
          paths[kind] +=
            `M${plot.px(i.x[c]).toFixed(1)},${plot.py(i.y[from]).toFixed(1)}H${(plot.px(i.x[c + 1]) + 0.3).toFixed(1)}V${(plot.py(i.y[r]) - 0.3).toFixed(1)}H${plot.px(i.x[c]).toFixed(1)}Z`;
      }
    paths.forEach((d, k) => {
      if (d) {
        plot.inner.append(TC.svgNode("path", { d, fill: i.colours[k], stroke: "none" }));
        key.set(i.names[k], TC.swatch(i.colours[k], i.names[k]));
      }
    });
  },
};
