// Parts of a page, as the data have them: panels, tables, sheets of columns, states of the contact
// line.

// Puts parts into a host; lists that scroll stay where they are.
TC.show = function (host, parts, ...before) {
  const width = TC.width(host);
  const scrollPositions = [...host.querySelectorAll(".scroll")].map((box) => box.scrollTop);
  TC.fill(
    host,
    ...before,
    parts.map((part) => TC.part[part.part](part, width)),
  );
  host.querySelectorAll(".scroll").forEach((box, index) => {
    box.scrollTop = scrollPositions[index] || 0;
  });
};
TC.stateCount = 0; // states of the slider; 0 where the page has no slider of states

TC.part = {
  text(part) {
    const notes = part.lines.map((line) => TC.note(line));
    const hiddenNotes =
      notes.length > 12
        ? TC.el("details", {}, TC.el("summary", {}, `${notes.length - 8} more`), notes.splice(8))
        : null;
    return TC.el("div", {}, notes, hiddenNotes);
  },
  table(part) {
    const isText = part.head.map(
      (_, column) => !part.rows.every((row) => /^$|^[-+–∞−(\d]/.test(row[column])),
    );
    return TC.el(
      "div",
      {},
      part.caption ? TC.h3(part.caption) : null,
      TC.wideTable(part.head, part.rows, (column) => isText[column] && "text"),
      part.notes.map((note) => TC.note(note)),
    );
  },
  beside(part, width) {
    const hasTwoColumns = width > 760 && part.parts.length > 1;
    return TC.el(
      "div",
      { class: hasTwoColumns ? "columns" : "" },
      part.parts.map((child) =>
        TC.panel(TC.part[child.part](child, hasTwoColumns ? Math.floor(width / 2 - 14) : width)),
      ),
    );
  },
  // One of several lists of parts.
  choice(part, width) {
    const chosen = Math.max(0, part.options.indexOf(TC.state[part.key]));
    return TC.el(
      "div",
      {},
      part.options.length > 1
        ? TC.el(
            "div",
            { class: "controls noprint" },
            TC.choice(
              part.label,
              part.options.map((option) => [option, option]),
              part.options[chosen],
              (option) => TC.set({ [part.key]: option }),
            ),
          )
        : null,
      part.parts[chosen].map((option) => TC.part[option.part](option, width)),
    );
  },
  states(part) {
    TC.stateCount = part.texts.length;
    TC.state.step = TC.indexBelow(TC.state.step, TC.stateCount, part.first);
    return TC.el(
      "div",
      { class: "controls noprint" },
      TC.slider(part.label, part.texts, TC.state.step, (step) => TC.set({ step })),
    );
  },
  facts: (part) =>
    TC.facts(
      part.columns.map((column) => [
        column.title,
        typeof column.v[TC.state.step] === "number"
          ? TC.quantity(column.v[TC.state.step], column.units)
          : column.v[TC.state.step],
      ]),
    ),

  panel(given, width) {
    const panel = { ...given, items: given.items.map(TC.svgLook) };
    const range = (axisIndex) => {
      const axis = "xy"[axisIndex];
      const kindsInRange = ["line", "marks", "fill", "cells", "arrow"];
      const values = panel.items
        .filter((item) => kindsInRange.includes(item.kind) || (axisIndex && item.kind === "across"))
        .flatMap((item) =>
          TC.range(
            Array.from(item[axis]).filter((value) => !panel.log[axisIndex] || value > 0),
            [],
          ),
        );
      const padded = TC.pad(
        TC.range(values, panel.log[axisIndex] ? [1, 10] : [0, 1]),
        panel.items.some((item) => item.kind === "cells") ? 0 : 0.06,
        panel.log[axisIndex],
      );
      const limits = panel.limits[axisIndex] || [null, null];
      return padded.map((value, end) => limits[end] ?? value);
    };
    const ticks = panel.ticks
      ? panel.ticks[0]
          .map((position, index) => [position, panel.ticks[1][index]])
          .sort((first, second) => first[0] - second[0])
      : null;
    const plot = new TC.Plot({
      width,
      height: panel.high,
      x: range(0),
      y: range(1),
      xlog: panel.log[0],
      ylog: panel.log[1],
      xlabel: panel.labels[0],
      ylabel: panel.labels[1],
      label: panel.title || panel.labels[1],
      margin: { left: 70, right: 16, top: 12, bottom: 46 },
      xticks: ticks && ticks.map((tick) => tick[0]),
      xtext: ticks && ((value) => ticks.find((tick) => tick[0] === value)[1]),
    });
    const legend = new Map();
    for (const item of panel.items) TC.drawItem[item.kind](plot, item, legend, panel.items);
    if (panel.at) {
      const [xs, ys] = panel.at;
      const step = TC.state.step;
      const states = [...xs.keys()].filter(
        (item) => Number.isFinite(xs[item]) && Number.isFinite(ys[item]),
      );
      if (states.includes(step))
        plot.dot(
          xs[step],
          ys[step],
          { r: 9, fill: "none", stroke: "var(--ink)", "stroke-width": 2.2 },
          "the state that is chosen",
        );
      plot.svg.style.cursor = "pointer";
      plot.svg.addEventListener("click", (event) => {
        const bounds = plot.svg.getBoundingClientRect();
        const distance = (item) =>
          Math.hypot(
            plot.px(xs[item]) - event.clientX + bounds.left,
            plot.py(ys[item]) - event.clientY + bounds.top,
          );
        TC.set({
          step: states.reduce(
            (nearest, item) => (distance(item) < distance(nearest) ? item : nearest),
            states[0],
          ),
        });
      });
    }
    return TC.el(
      "div",
      {},
      panel.title ? TC.h3(panel.title) : null,
      plot.svg,
      legend.size
        ? TC.el(
            "div",
            { class: "legend" },
            [...legend.values()],
            panel.at ? "ring: the state that is chosen" : "",
          )
        : null,
    );
  },

  sheet(part, width) {
    const state = TC.state;
    const short = TC.shortName;
    const rows = [...part.columns[0].v.keys()];
    const numeric = part.columns.filter((column) => typeof column.v[0] === "number");
    const columns = part.columns.map((column, index) => {
      // more than seven do not fit on paper
      const isNumber = numeric.includes(column);
      const scale = isNumber ? TC.scale(column.v, column.units) : { by: 1, unit: "" };
      return {
        minor: index > 6,
        title: TC.withUnit(short(column), scale),
        long: column.title,
        csv: column.name + (column.units !== "1" ? ` [${column.units}]` : ""),
        left: !isNumber,
        get: (row) => column.v[row],
        text: (row) => (isNumber ? TC.number(column.v[row] / scale.by, 5) : column.v[row]),
        name: column.name,
        scale,
      };
    });
    const stateOptions = part.states
      ? { chosen: (row) => row === state.step, pick: (step) => TC.set({ step }) }
      : {};
    const table = TC.table({
      columns,
      rows,
      ...TC.sorting(`${part.file}_by`, `${part.file}_down`),
      ...stateOptions,
    });
    const button = TC.el(
      "button",
      {
        "aria-label": "csv",
        onclick: () => TC.saveTable(`${TC.fileName()}-${part.file}.csv`, columns, table.order),
      },
      "Download as CSV",
    );
    return TC.el(
      "div",
      {},
      part.chart ? TC.part.chart(part, numeric, columns, width) : null,
      TC.el(
        "div",
        { class: "controls noprint" },
        button,
        part.states ? TC.el("span", { class: "note" }, "a click on a row chooses it") : null,
      ),
      TC.el("div", { class: "scroll" }, table.node),
    );
  },
  // Any column of a sheet over any other.
  chart(part, numeric, columns, width) {
    const short = TC.shortName;
    const [xColumn, yColumn] = [0, 1].map(
      (index) =>
        numeric.find((column) => column.name === TC.state["xy"[index] + "of"]) ||
        numeric.find((column) => column.name === part.chart[index]),
    );
    const scales = [xColumn, yColumn].map(
      (column) => columns.find((shown) => shown.name === column.name).scale,
    );
    const scaledValues = [xColumn, yColumn].map((column, index) =>
      Array.from(column.v, (value) => value / scales[index].by),
    );
    const options = numeric.map((column) => [column.name, column.title]);
    const items = [
      { kind: "line", x: scaledValues[0], y: scaledValues[1], colour: "var(--c1)", width: 1.8 },
    ];
    const labels = [xColumn, yColumn].map((column, index) =>
      TC.withUnit(short(column), scales[index]),
    );
    return TC.el(
      "div",
      {},
      TC.el(
        "div",
        { class: "controls noprint" },
        TC.choice("draw", options, yColumn.name, (yof) => TC.set({ yof })),
        TC.choice("over", options, xColumn.name, (xof) => TC.set({ xof })),
      ),
      TC.part.panel(
        {
          title: `${short(yColumn)} over ${short(xColumn)}`,
          labels,
          log: [false, false],
          limits: [null, null],
          items,
          high: 260,
          at: part.states ? scaledValues : null,
        },
        Math.min(width, 760),
      ),
    );
  },

  line(part, width) {
    const line = { ...part.line, moves: part.moves };
    const nodeCount = line.x.length;
    const index = TC.state.step;
    const host = TC.el("div");
    const solution = {
      line,
      u: TC.row(line.u_T, index),
      xi: TC.row(line.xi, index),
      N: line.N && TC.row(line.N, index),
      state: part.state.subarray(index * nodeCount, (index + 1) * nodeCount),
    };
    TC.point.profiles(host, line, [solution], { ...TC.point.frame(line, width), shape: false }, "");
    if (part.law)
      host.append(
        TC.point.lawPlot(
          Math.min(width, 560),
          `Friction law (${part.law.name})`,
          part.law,
          [solution],
          line,
        ),
      );
    return host;
  },
};

// The look of an item: matplotlib's names become attributes of SVG, which stay as they are.
TC.svgLook = function (item) {
  const dash = item.linestyle ?? "-";
  const isOpen = item.fillstyle === "none" || ["white", "none"].includes(item.markerfacecolor);
  return {
    colour: item.color,
    width: item.linewidth && 1.5 * item.linewidth,
    dash:
      typeof dash === "string"
        ? { "--": "7 4", ":": "1 3", "-.": "7 3 1 3", none: "none" }[dash]
        : dash[1].map((length) => 2 * length).join(" "),
    mark: item.marker,
    size: 0.7 * (item.markersize ?? 4),
    open: isOpen,
    anchor: { right: "end", center: "middle" }[item.ha],
    ...item,
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
TC.strokeLook = (item) => ({
  stroke: item.colour,
  "stroke-width": item.width || 1.5,
  "stroke-dasharray": item.dash,
  opacity: item.alpha,
});
// Draws an item of a panel, by its kind, and adds its entry to the legend, by its label.
TC.drawItem = {
  line(plot, item, legend) {
    const isJoined = item.dash !== "none";
    const drawMark =
      item.mark &&
      ((x, y) =>
        TC.marker(TC.MARKS[item.mark], x, y, item.size, {
          fill: item.open ? "var(--bg)" : item.colour,
          stroke: item.colour,
          "stroke-width": 1.4,
          opacity: item.alpha,
          class: "mark",
        }));
    if (isJoined) plot.line(item.x, item.y, TC.strokeLook(item));
    const stride = Math.ceil(item.x.length / 2000);
    if (drawMark)
      for (let index = 0; index < item.x.length; index += stride)
        if (Number.isFinite(item.x[index]) && Number.isFinite(item.y[index]))
          plot.inner.append(drawMark(plot.px(item.x[index]), plot.py(item.y[index])));
    if (item.label)
      legend.set(
        item.label,
        TC.entry(
          28,
          12,
          [isJoined ? TC.dash(28, 6, TC.strokeLook(item)) : "", drawMark ? drawMark(14, 6) : ""],
          item.label,
        ),
      );
  },
  // Marks with a look, a tip and an action each: shape, r, stroke, fill(k), tip(k), pick(k).
  marks(plot, item) {
    for (let index = 0; index < item.x.length; index++)
      if (Number.isFinite(item.x[index]) && Number.isFinite(item.y[index])) {
        const mark = TC.marker(item.shape, plot.px(item.x[index]), plot.py(item.y[index]), item.r, {
          fill: item.fill(index),
          stroke: item.stroke || item.fill(index),
          "stroke-width": 1.5,
          "fill-opacity": item.alpha,
          class: item.pick && "mark",
          onclick: item.pick && (() => item.pick(index)),
        });
        if (item.tip) mark.append(TC.svgNode("title", {}, item.tip(index)));
        plot.over.append(mark);
      }
  },
  fill(plot, item, legend) {
    const path = Array.from(
      item.x,
      (x, index) =>
        `${index ? "L" : "M"}${plot.px(x).toFixed(1)},${plot.py(item.y[index]).toFixed(1)}`,
    ).join("");
    if (item.x.length)
      plot.inner.append(
        TC.svgNode("path", {
          d: `${path}Z`,
          fill: item.colour,
          opacity: item.alpha,
          stroke: "none",
        }),
      );
    if (item.label)
      legend.set(
        item.label,
        TC.swatch(
          `color-mix(in srgb, ${item.colour} ${100 * item.alpha}%, transparent)`,
          item.label,
        ),
      );
  },
  up: (plot, item) => plot.vertical(item.x[0], TC.strokeLook(item)),
  across: (plot, item) =>
    plot.inner.append(
      TC.svgNode("line", {
        x1: plot.left,
        x2: plot.right,
        y1: plot.py(item.y[0]),
        y2: plot.py(item.y[0]),
        ...TC.strokeLook(item),
      }),
    ),
  rows: (plot, item) =>
    plot.back.prepend(
      TC.svgNode("rect", {
        x: plot.left,
        width: plot.right - plot.left,
        y: plot.py(item.y[1]),
        height: Math.max(0, plot.py(item.y[0]) - plot.py(item.y[1])),
        fill: "var(--shade)",
      }),
    ),
  note: (plot, item) =>
    plot.text(
      plot.px(item.x[0]) + item.shift[0],
      plot.py(item.y[0]) - item.shift[1] + 4,
      item.text,
      {
        "text-anchor": item.anchor,
        style: item.colour ? `fill:${item.colour}` : "",
      },
    ),
  arrow(plot, item) {
    const [tail, head] = [0, 1].map((end) => [plot.px(item.x[end]), plot.py(item.y[end])]);
    const length = Math.hypot(head[0] - tail[0], head[1] - tail[1]) || 1;
    const [cosine, sine] = [(head[0] - tail[0]) / length, (head[1] - tail[1]) / length];
    const corner = (back, side) =>
      `${head[0] - back * cosine - side * sine},${head[1] - back * sine + side * cosine}`;
    plot.inner.append(
      TC.svgNode("line", {
        x1: tail[0],
        y1: tail[1],
        x2: head[0],
        y2: head[1],
        stroke: item.colour,
        "stroke-width": item.width || 0,
      }),
      TC.svgNode("path", {
        d: `M${corner(9, 4)}L${corner(0, 0)}L${corner(9, -4)}Z`,
        fill: item.colour,
      }),
    );
  },
  // Each name once, inside the panel and clear of other names, over as few lines and dots as
  // possible.
  names(plot, item, legend, items) {
    const placed = [];
    const pixelOf = (item, index) => [plot.px(item.x[index]), plot.py(item.y[index])];
    const curvePoints = [];
    for (const item of items)
      if (item.kind === "line" && item.dash !== "none")
        for (let index = 1; index < item.x.length; index++) {
          const [start, end] = [pixelOf(item, index - 1), pixelOf(item, index)];
          for (let sample = 0; sample < 40; sample++)
            curvePoints.push([
              start[0] + (sample / 40) * (end[0] - start[0]),
              start[1] + (sample / 40) * (end[1] - start[1]),
            ]);
        }
    const dots = item.texts.map((_, index) => pixelOf(item, index));
    const countWithin = (list, x, y, w, h) =>
      list.filter((item) => Math.abs(item[0] - x) < w && Math.abs(item[1] - y) < h).length;
    item.texts.slice(0, 60).forEach((name, index) => {
      if (placed.some((sample) => sample.name === name)) return;
      const [x, y] = dots[index];
      const halfWidth = 3.3 * name.length;
      const otherDots = dots.filter((item) => Math.hypot(item[0] - x, item[1] - y) > 8);
      const freePlaces = [
        [1, -10],
        [-1, -10],
        [1, 12],
        [-1, 12],
        [0, -24],
        [0, 26],
      ]
        .map(([side, up]) => ({ name, x: x + side * (8 + halfWidth), y: y + up, half: halfWidth }))
        .filter(
          (item) =>
            item.y < plot.bottom - 4 &&
            item.x - halfWidth > plot.left &&
            item.x + halfWidth <= plot.right &&
            !placed.some(
              (sample) =>
                Math.abs(item.x - sample.x) < halfWidth + sample.half &&
                Math.abs(item.y - sample.y) < 13,
            ),
        )
        .map((item) => ({
          ...item,
          hits:
            countWithin(curvePoints, item.x, item.y, halfWidth, 6) +
            20 * countWithin(otherDots, item.x, item.y, halfWidth + 8, 12),
        }))
        .sort((first, second) => first.hits - second.hits);
      if (!freePlaces.length) return;
      placed.push(freePlaces[0]);
      plot.text(freePlaces[0].x, freePlaces[0].y + 4, name, { "text-anchor": "middle" });
    });
  },
  // Neighbours of one kind in a column form one rectangle, and all rectangles of a kind one path.
  cells(plot, item, legend) {
    const [columnCount, rowCount] = item.kinds.shape;
    const paths = item.colours.map(() => "");
    for (let column = 0; column < columnCount; column++)
      for (let row = 0; row < rowCount;) {
        const kind = item.kinds[column * rowCount + row];
        const firstRow = row;
        while (row < rowCount && item.kinds[column * rowCount + row] === kind) row++;
        // cells overlap by 0.3 pixels, so that no gap shows between them
        const left = plot.px(item.x[column]).toFixed(1);
        const right = (plot.px(item.x[column + 1]) + 0.3).toFixed(1);
        const bottom = plot.py(item.y[firstRow]).toFixed(1);
        const top = (plot.py(item.y[row]) - 0.3).toFixed(1);
        if (kind >= 0) paths[kind] += `M${left},${bottom}H${right}V${top}H${left}Z`;
      }
    paths.forEach((path, kind) => {
      if (path) {
        plot.inner.append(
          TC.svgNode("path", { d: path, fill: item.colours[kind], stroke: "none" }),
        );
        legend.set(item.names[kind], TC.swatch(item.colours[kind], item.names[kind]));
      }
    });
  },
};
