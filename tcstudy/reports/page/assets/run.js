// The page of a run: the sweep as a map and curves, accuracy and cost, the data.
TC.run = {
  setup(given) {
    const r = TC.data.run;
    const s = TC.state;
    r.points = r.shape.reduce((a, b) => a * b, 1);
    r.nlevels = r.levels.h_max.length;
    r.grid = r.mode === "grid";
    r.varied = r.grid ? r.axes.filter((a) => a.values.length > 1) : r.axes;
    const byName = (n) => r.varied.find((a) => a.name === n);
    const numeric = r.varied.filter((a) => a.numeric);
    const texts = r.varied.filter((a) => !a.numeric);
    const ranked = [...numeric].sort((a, b) => new Set(b.values).size - new Set(a.values).size);
    s.x = (byName(given.x) || ranked[0] || texts[0] || {}).name;
    const rest = [...ranked, ...texts].filter((a) => a.name !== s.x);
    s.y = (byName(given.y) && given.y !== s.x ? byName(given.y) : rest[0] || {}).name;
    const by = [...texts, ...ranked].filter((a) => a.name !== s.x && !a.drawn);
    s.by = (by.find((a) => a.name === given.by) || by[0] || {}).name;
    const names = Object.keys(r.numbers);
    s.q = names.includes(given.q) ? given.q : names[0];
    s.level = TC.whole(given.level, r.nlevels, r.nlevels - 1);
    s.at = TC.run.place(given.at) || TC.run.worst();
    s.vs = TC.run.place(given.vs) || null;
    s.eq = TC.whole(given.eq, 1e6, 0);
    s.deform =
      given.deform !== undefined && Number.isFinite(Number(given.deform))
        ? Number(given.deform)
        : 1;
    s.sort = given.sort !== undefined ? Number(given.sort) : -1;
    s.down = given.down === "1" ? 1 : 0;
    s.step = given.step;
    for (const key of ["xof", "yof"]) if (given[key]) s[key] = given[key];
    s.mode = given.mode === "live" && TC.data.live ? "live" : "";
  },
  place(text) {
    if (text === undefined) return null;
    const at = String(text).split(",").map(Number);
    const shape = TC.data.run.shape;
    if (!shape.length) return [];
    return at.length === shape.length &&
      at.every((v, i) => Number.isInteger(v) && v >= 0 && v < shape[i])
      ? at
      : null;
  },
  // The solved point with the largest slip: what one looks for first.
  worst() {
    const r = TC.data.run;
    const u = r.numbers.u_T_max;
    const level = r.nlevels - 1;
    let best = 0;
    let most = -1;
    for (let p = 0; p < r.points; p++)
      if (TC.run.flag("status", p, level) === 1 && u && u.v[p * r.nlevels + level] > most) {
        most = u.v[p * r.nlevels + level];
        best = p;
      }
    return TC.run.index(best);
  },
  index(p, shape = TC.data.run.shape) {
    const at = [];
    for (let i = shape.length - 1; i >= 0; i--) {
      at[i] = p % shape[i];
      p = Math.floor(p / shape[i]);
    }
    return at;
  },
  flat: (at) => at.reduce((p, i, k) => p * TC.data.run.shape[k] + i, 0),
  axis: (name) => TC.data.run.axes.find((a) => a.name === name),
  dim: (name) => TC.data.run.dims.indexOf(TC.run.axis(name).dim),
  flag(name, p, level) {
    const f = TC.data.run.flags[name];
    return f ? f[p * TC.data.run.nlevels + level] : 0;
  },
  value(name, p, level) {
    const n = TC.data.run.numbers[name];
    return n ? n.v[p * TC.data.run.nlevels + level] : NaN;
  },
  energies(p, level) {
    const r = TC.data.run;
    const k = r.starts.length;
    return r.start_energy
      ? Array.from(
          r.start_energy.slice((p * r.nlevels + level) * k, (p * r.nlevels + level + 1) * k),
        )
      : [];
  },
  // Sizes of the levels, of the geometry of point p where there are several.
  levels: (p) => TC.point.home(p).levels || TC.data.run.levels,
  several: (p, level) => TC.run.flag("several", p, level) === 1, // starts led to different energies
  words(at) {
    const r = TC.data.run;
    if (!r.axes.length) return "the one point of the study";
    return r.axes
      .map((a) =>
        `${TC.symbol(a.name)} = ${TC.axisText(a, at[TC.run.dim(a.name)])}`.replace(
          a.numeric ? /$^/ : " = ",
          ": ",
        ),
      )
      .join(", ");
  },
  // What is known of a point: failed, unique, global, local, nothing.
  proof(p, level) {
    if (TC.run.flag("status", p, level) !== 1) return "failed";
    for (const [flag, word] of [
      ["unique", "unique"],
      ["global_minimum", "global"],
      ["strict_minimum", "local"],
    ])
      if (TC.run.flag(flag, p, level) === 1) return word;
    return "nothing";
  },
  draw() {
    const host = TC.run.host || (TC.run.host = TC.run.layout());
    TC.run.controls(host.controls);
    TC.run.map(host.map);
    TC.run.curves(host.curves);
    if (TC.data.steps) {
      const p = TC.run.flat(TC.state.at);
      const own = TC.data.steps[p];
      TC.show(
        host.point,
        own.point,
        TC.data.run.points > 1 ? TC.el("p", {}, TC.el("b", {}, TC.run.words(TC.state.at))) : null,
      );
      TC.show(host.accuracy, own.accuracy);
      TC.show(host.steps, own.table);
    } else {
      TC.point.draw(host.point);
      TC.run.accuracy(host.accuracy);
    }
    if (host.rows) TC.run.rows(host.rows);
  },
  layout() {
    document.getElementById("main").replaceChildren();
    const sweep = TC.data.run.varied.length ? TC.section("1  The sweep", "sweep") : TC.el("div");
    const controls = TC.el("div", { class: "controls noprint" });
    const map = TC.panel();
    const curves = TC.panel();
    const two = TC.data.run.varied.length > 1;
    sweep.append(controls, two ? TC.el("div", { class: "columns" }, map, curves) : curves);
    const swept = TC.data.run.varied.length > 0;
    const steps = Boolean(TC.data.steps);
    const n = (k) => `${swept ? k : k - 1}  `;
    const point = TC.section(
      steps ? n(2) + "Loop and steps" : swept ? "2  The point" : "The solution",
      "point",
    );
    const accuracy = TC.section(
      steps ? n(3) + "Energies and cycles" : "3  How accurate, at what cost",
      "accuracy",
    );
    const data = TC.section((steps ? n(4) : "4  ") + "The data", "table");
    const rows = steps && !swept ? null : TC.el("div");
    const stepRows = steps ? TC.el("div", { id: "steps" }) : null;
    data.append(...[stepRows, rows].filter(Boolean));
    TC.provenance(data);
    return { controls, map: two ? map : null, curves, point, accuracy, rows, steps: stepRows };
  },
  controls(host) {
    const r = TC.data.run;
    const s = TC.state;
    const out = [];
    out.push(
      TC.choice(
        "quantity",
        Object.keys(r.numbers).map((n) => [n, TC.symbol(n)]),
        s.q,
        (q) => TC.set({ q }),
      ),
    );
    if (r.varied.length > 1) {
      const names = r.varied.map((a) => [a.name, TC.symbol(a.name)]);
      const by = names.filter(([n]) => n !== s.x && !TC.run.axis(n).drawn);
      out.push(
        TC.choice("across", names, s.x, (x) =>
          TC.set({
            x,
            y: x === s.y ? s.x : s.y,
            by: x !== s.by ? s.by : TC.run.axis(s.x).drawn ? undefined : s.x,
          }),
        ),
      );
      out.push(
        TC.choice(
          "map: up",
          names.filter(([n]) => n !== s.x),
          s.y,
          (y) => TC.set({ y }),
        ),
      );
      if (by.length) out.push(TC.choice("curves: one for each", by, s.by, (by) => TC.set({ by })));
    }
    if (r.nlevels > 1)
      out.push(
        TC.slider(
          "level",
          TC.run
            .levels(TC.run.flat(s.at))
            .h_max.map((h, i) => `${i} (h = ${TC.quantity(h, r.units.h_max, 3)})`),
          s.level,
          (level) => TC.set({ level }),
        ),
      );
    if (r.grid)
      for (const a of r.varied) {
        const d = TC.run.dim(a.name);
        const texts = { length: a.values.length, at: (i) => TC.axisText(a, i) };
        const move = (i) => {
          const at = s.at.slice();
          at[d] = i;
          TC.set({ at });
        };
        out.push(
          a.numeric
            ? TC.slider(TC.symbol(a.name), texts, s.at[d], move)
            : TC.choice(
                TC.symbol(a.name),
                a.values.map((t, i) => [i, t]),
                s.at[d],
                (v) => move(Number(v)),
              ),
        );
      }
    else
      out.push(
        TC.slider(
          "point",
          { length: r.points, at: (p) => `${p + 1} of ${r.points}` },
          s.at[0],
          (i) => TC.set({ at: [i] }),
        ),
      );
    TC.fill(host, out);
  },
  // Colour of a value, and the bar that explains it.
  shade(values) {
    const [lo, hi] = TC.range(values);
    return {
      lo,
      hi,
      of: (v) => TC.colour(hi > lo && Number.isFinite(v) ? (v - lo) / (hi - lo) : 0.5),
    };
  },
  map(host) {
    if (!host) return;
    const r = TC.data.run;
    const s = TC.state;
    const q = r.numbers[s.q];
    const all = [];
    const ax = TC.run.axis(s.x);
    const ay = TC.run.axis(s.y);
    for (let p = 0; p < r.points; p++)
      if (TC.run.flag("status", p, s.level) === 1) all.push(q.v[p * r.nlevels + s.level]);
    const shade = TC.run.shade(all);
    const scale = TC.scale(all, q.units);
    const width = TC.width(host);
    const title = TC.h3(
      TC.titled(TC.symbol(s.q), scale) + (r.nlevels > 1 ? `, level ${s.level}` : ""),
    );
    const svg = r.grid
      ? TC.run.cells(width, ax, ay, shade, scale)
      : TC.run.scatter(width, ax, ay, shade, scale);
    const fixed = r.grid ? r.varied.filter((a) => a.name !== s.x && a.name !== s.y) : [];
    const note = fixed.length
      ? "at " +
        fixed
          .map((a) => `${TC.symbol(a.name)} = ${TC.axisText(a, s.at[TC.run.dim(a.name)])}`)
          .join(", ")
      : "";
    TC.fill(
      host,
      title,
      note ? TC.note(note) : null,
      svg,
      TC.run.bar(Math.min(width, 420), shade, scale),
      TC.run.key(width),
    );
  },
  patterns(svg) {
    const defs = svg.appendChild(TC.svgNode("defs"));
    const turned = { patternTransform: "rotate(45)" };
    for (const [tone, c] of [
      ["l", "rgba(255,255,255,.85)"],
      ["d", "rgba(0,0,0,.75)"],
    ]) {
      const add = (name, size, look, mark) =>
        defs.append(
          TC.svgNode(
            "pattern",
            {
              id: `${name}-${tone}`,
              width: size,
              height: size,
              patternUnits: "userSpaceOnUse",
              ...look,
            },
            mark,
          ),
        );
      add(
        "local",
        8,
        turned,
        TC.svgNode("line", { x1: 0, y1: 0, x2: 0, y2: 8, stroke: c, "stroke-width": 1.6 }),
      );
      add("global", 9, {}, TC.svgNode("circle", { cx: 3, cy: 3, r: 1.3, fill: c }));
      add(
        "nothing",
        8,
        turned,
        TC.svgNode("path", { d: "M0,0V8M0,0H8", stroke: c, "stroke-width": 1.4 }),
      );
    }
  },
  // One piece of a pattern, for the middle of a round point, where patterns would bite into its edge.
  dot(proof, x, y, r, tone) {
    const c = tone === "l" ? "rgba(255,255,255,.85)" : "rgba(0,0,0,.75)";
    const slash = `M${x - r},${y + r}L${x + r},${y - r}`;
    if (proof === "global") return TC.svgNode("circle", { cx: x, cy: y, r: 1.3, fill: c });
    return TC.svgNode("path", {
      d: proof === "local" ? slash : `${slash}M${x - r},${y - r}L${x + r},${y + r}`,
      stroke: c,
      "stroke-width": 1.5,
    });
  },
  PROOFS: ["failed", "nothing", "local", "global", "unique"],
  // Points in one cell: the median of their values, what is proved of all of them; a click takes the middle one. A single point is round.
  cell(svg, x, y, w, h, points, shade, scale, numbers, round = false) {
    const area = (inset, look) =>
      round
        ? TC.svgNode("circle", {
            cx: x + w / 2,
            cy: y + h / 2,
            r: Math.max(0, w / 2 - inset),
            ...look,
          })
        : TC.svgNode("rect", {
            x: x + inset,
            y: y + inset,
            width: Math.max(0, w - 2 * inset),
            height: Math.max(0, h - 2 * inset),
            ...look,
          });
    const s = TC.state;
    const p = points[points.length >> 1];
    const known = points.map((k) => TC.run.PROOFS.indexOf(TC.run.proof(k, s.level)));
    const proof = TC.run.PROOFS[Math.min(...known)];
    const all = points
      .filter((_, i) => known[i] > 0)
      .map((k) => TC.run.value(s.q, k, s.level))
      .sort((a, b) => a - b);
    const v = all.length ? all[all.length >> 1] : NaN;
    const rgb = shade.of(v);
    const tone = TC.dark(rgb) ? "l" : "d";
    const several = points.some((k) => TC.run.several(k, s.level));
    const units = TC.data.run.numbers[s.q].units;
    const g = TC.svgNode("g", { class: "cell", "data-point": p });
    const tip = `${points.length > 1 ? `${points.length} points about ` : ""}${TC.run.words(TC.run.index(p))}\n${TC.symbol(s.q)} = ${TC.quantity(v, units)}${points.length > 1 ? ` (median; ${TC.quantity(all[0], units)} to ${TC.quantity(all[all.length - 1], units)})` : ""}\n${TC.data.proofs[proof]}`;
    g.append(TC.svgNode("title", {}, tip + (several ? "\nstarts led to different solutions" : "")));
    if (proof === "failed") {
      g.append(
        area(0, { fill: "var(--shade)", stroke: "var(--bad)" }),
        TC.svgNode("path", {
          d: `M${x + 4},${y + 4}L${x + w - 4},${y + h - 4}M${x + w - 4},${y + 4}L${x + 4},${y + h - 4}`,
          stroke: "var(--bad)",
          "stroke-width": 2,
        }),
      );
    } else {
      g.append(area(0, { fill: TC.css(rgb) }));
      if (proof !== "unique")
        g.append(
          round
            ? TC.run.dot(proof, x + w / 2, y + h / 2, w / 3, tone)
            : area(0, { fill: `url(#${proof}-${tone})` }),
        );
      if (several)
        g.append(
          area(round ? 1 : 2.5, { fill: "none", stroke: "#d55e00", "stroke-width": round ? 2 : 3 }),
        );
      if (numbers) {
        const text = TC.number(v / scale.by, 3);
        const wide = 7.2 * text.length + 6;
        g.append(
          TC.svgNode("rect", {
            x: x + w / 2 - wide / 2,
            y: y + h / 2 - 8,
            width: wide,
            height: 16,
            fill: TC.css(rgb),
          }),
          TC.svgNode(
            "text",
            {
              x: x + w / 2,
              y: y + h / 2 + 4.5,
              "text-anchor": "middle",
              style: `fill:${TC.dark(rgb) ? "#fff" : "#111"}`,
            },
            text,
          ),
        );
      }
    }
    g.addEventListener("click", (e) =>
      TC.set(e.shiftKey ? { vs: TC.run.index(p) } : { at: TC.run.index(p) }),
    );
    svg.append(g);
  },
  // n places in groups of neighbours, `most` or fewer: [first, behind] of each.
  groups(n, most) {
    const k = Math.ceil(n / most);
    return [...Array(Math.ceil(n / k))].map((_, i) => [i * k, Math.min(n, (i + 1) * k)]);
  },
  cells(width, ax, ay, shade, scale) {
    const s = TC.state;
    const gx = TC.run.groups(ax.values.length, 60);
    const gy = TC.run.groups(ay.values.length, 40);
    const nx = gx.length;
    const ny = gy.length;
    const kx = gx[0][1];
    const ky = gy[0][1];
    const dx = TC.run.dim(ax.name);
    const dy = TC.run.dim(ay.name);
    const wide = ay.numeric ? 7 : Math.max(...ay.values.map((v) => String(v).length)) * 1;
    const left = ay.numeric ? 66 : Math.min(150, 34 + 7 * wide);
    const w = (width - left - 8) / nx;
    const h = Math.max(
      14,
      (6.4 * TC.axisTitle(ay).length) / ny,
      Math.min(62, 330 / ny, Math.max(26, w)),
    );
    const height = ny * h + 58; // room for the title of y
    const svg = TC.svgNode("svg", {
      width,
      height,
      tabindex: 0,
      role: "application",
      "aria-label": `map of ${TC.symbol(s.q)}; arrow keys move the point`,
    });
    TC.run.patterns(svg);
    const at = (i, j) => {
      const k = s.at.slice();
      const out = [];
      for (k[dx] = gx[i][0]; k[dx] < gx[i][1]; k[dx]++)
        for (k[dy] = gy[j][0]; k[dy] < gy[j][1]; k[dy]++) out.push(TC.run.flat(k));
      return out;
    };
    for (let i = 0; i < nx; i++)
      for (let j = 0; j < ny; j++)
        TC.run.cell(
          svg,
          left + i * w + 0.5,
          (ny - 1 - j) * h + 0.5,
          w - 1,
          h - 1,
          at(i, j),
          shade,
          scale,
          w > 46 && h > 22,
        );
    const frame = (k, attrs) =>
      svg.append(
        TC.svgNode("rect", {
          x: left + Math.floor(k[dx] / kx) * w + 1,
          y: (ny - 1 - Math.floor(k[dy] / ky)) * h + 1,
          width: w - 2,
          height: h - 2,
          fill: "none",
          "pointer-events": "none",
          ...attrs,
        }),
      );
    frame(s.at, { stroke: "var(--halo)", "stroke-width": 6 });
    frame(s.at, { stroke: "var(--ink)", "stroke-width": 2.5 });
    if (s.vs && s.vs.every((v, k) => k === dx || k === dy || v === s.at[k]))
      frame(s.vs, { stroke: "var(--ink)", "stroke-width": 2.5, "stroke-dasharray": "5 4" });
    const every = Math.max(
      1,
      Math.ceil((Math.max(...gx.map(([i]) => TC.axisLabel(ax, i).length)) * 8) / w),
    );
    for (let i = 0; i < nx; i += every)
      svg.append(
        TC.svgNode(
          "text",
          { x: left + (i + 0.5) * w, y: ny * h + 17, "text-anchor": "middle" },
          TC.axisLabel(ax, gx[i][0]),
        ),
      );
    const rows = Math.max(1, Math.ceil(15 / h));
    for (let j = 0; j < ny; j += rows)
      svg.append(
        TC.svgNode(
          "text",
          { x: left - 7, y: (ny - j - 0.5) * h + 4, "text-anchor": "end" },
          TC.axisLabel(ay, gy[j][0]),
        ),
      );
    svg.append(
      TC.svgNode(
        "text",
        { x: left + (nx * w) / 2, y: ny * h + 40, "text-anchor": "middle" },
        TC.axisTitle(ax),
      ),
      TC.svgNode(
        "text",
        {
          x: 12,
          y: (ny * h) / 2,
          "text-anchor": "middle",
          transform: `rotate(-90 12 ${(ny * h) / 2})`,
        },
        TC.axisTitle(ay),
      ),
    );
    svg.addEventListener("keydown", (e) => {
      const step = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] }[
        e.key
      ];
      if (!step) return;
      e.preventDefault();
      const k = s.at.slice();
      k[dx] = Math.min(ax.values.length - 1, Math.max(0, k[dx] + kx * step[0]));
      k[dy] = Math.min(ay.values.length - 1, Math.max(0, k[dy] + ky * step[1]));
      TC.set({ at: k });
      document.querySelector("#sweep svg[tabindex]")?.focus();
    });
    return svg;
  },
  scatter(width, ax, ay, shade, scale) {
    const r = TC.data.run;
    const s = TC.state;
    const place = (a, p) => (a.numeric ? a.values[p] : a.values.indexOf(a.values[p]));
    const fx = TC.axisScale(ax).by;
    const fy = TC.axisScale(ay).by;
    const xs = Float64Array.from({ length: r.points }, (_, p) => place(ax, p) / fx);
    const ys = Float64Array.from({ length: r.points }, (_, p) => place(ay, p) / fy);
    const plot = new TC.Plot({
      width,
      height: 320,
      x: TC.pad(TC.range(xs), 0.06, ax.log),
      y: TC.pad(TC.range(ys), 0.06, ay.log),
      xlog: ax.log,
      ylog: ay.log,
      xlabel: TC.axisTitle(ax),
      ylabel: TC.axisTitle(ay),
    });
    TC.run.patterns(plot.svg);
    if (r.points > TC.run.MOST_MARKS) {
      // squares of 12 pixels instead of single points
      const bins = new Map();
      const size = 12;
      for (let p = 0; p < r.points; p++) {
        const key = `${Math.floor(plot.px(xs[p]) / size)} ${Math.floor(plot.py(ys[p]) / size)}`;
        bins.has(key) ? bins.get(key).push(p) : bins.set(key, [p]);
      }
      for (const [key, points] of bins) {
        const [i, j] = key.split(" ").map(Number);
        TC.run.cell(plot.over, i * size, j * size, size - 1, size - 1, points, shade, scale, false);
      }
    } else {
      const half = r.points > 150 ? 5 : 8; // many points must not hide one another
      for (let p = 0; p < r.points; p++)
        TC.run.cell(
          plot.over,
          plot.px(xs[p]) - half,
          plot.py(ys[p]) - half,
          2 * half,
          2 * half,
          [p],
          shade,
          scale,
          false,
          true,
        );
    }
    plot.over.append(
      TC.svgNode("circle", {
        cx: plot.px(xs[s.at[0]]),
        cy: plot.py(ys[s.at[0]]),
        r: 10,
        fill: "none",
        stroke: "var(--ink)",
        "stroke-width": 2.5,
        "pointer-events": "none",
      }),
    );
    return plot.svg;
  },
  bar(width, shade, scale) {
    const svg = TC.svgNode("svg", { width, height: 34, role: "img", "aria-label": "colours" });
    const n = 60;
    const left = 66;
    if (!(shade.hi > shade.lo)) return svg;
    for (let i = 0; i < n; i++)
      svg.append(
        TC.svgNode("rect", {
          x: left + (i * (width - left - 30)) / n,
          y: 2,
          width: (width - left - 30) / n + 0.6,
          height: 11,
          fill: TC.css(TC.colour((i + 0.5) / n)),
        }),
      );
    for (const t of [0, 0.5, 1])
      svg.append(
        TC.svgNode(
          "text",
          { x: left + t * (width - left - 30), y: 28, "text-anchor": "middle" },
          TC.number((shade.lo + t * (shade.hi - shade.lo)) / scale.by, 3),
        ),
      );
    svg.append(TC.svgNode("text", { x: width - 24, y: 12, class: "soft" }, scale.unit));
    return svg;
  },
  key() {
    const r = TC.data.run;
    const s = TC.state;
    const present = new Set();
    let several = false;
    for (let p = 0; p < r.points; p++) {
      present.add(TC.run.proof(p, s.level));
      several = several || TC.run.several(p, s.level);
    }
    const box = (fill, look = {}) =>
      TC.svgNode("rect", {
        x: 1,
        y: 1,
        width: 24,
        height: 14,
        fill,
        stroke: "var(--soft)",
        ...look,
      });
    const entry = (shapes, text) =>
      TC.entry(26, 16, shapes, text, "vertical-align:-3px;margin-right:5px");
    const shapes = (proof) =>
      proof === "failed"
        ? [
            box("var(--shade)"),
            TC.svgNode("path", {
              d: "M3,3L23,13M23,3L3,13",
              stroke: "var(--bad)",
              "stroke-width": 2,
            }),
          ]
        : [box("#9aa"), proof === "unique" ? "" : box(`url(#${proof}-d)`)];
    const out = TC.legend(
      ...TC.run.PROOFS.filter((k) => present.has(k))
        .reverse()
        .map((proof) => entry(shapes(proof), TC.data.proofs[proof])),
    );
    if (several)
      out.append(
        entry(
          [box("#9aa", { stroke: "#d55e00", "stroke-width": 3 })],
          "starts led to different solutions",
        ),
      );
    return out;
  },
  MOST_MARKS: 1500, // on the map and beside it; of more points a picture shows how their values are spread
  MOST_CURVES: 14,
  // Least, median and greatest value at every x, or in 120 parts of its range.
  spread(pts, get) {
    const xs = new Set(pts.map((o) => o.x));
    const [lo, hi] = TC.range(xs);
    const n = 120;
    const bins = new Map();
    const place =
      xs.size <= n
        ? (x) => x
        : (x) =>
            lo + ((Math.min(n - 1, Math.floor(((x - lo) / (hi - lo)) * n)) + 0.5) / n) * (hi - lo);
    for (const o of pts) {
      const v = get(o);
      const x = place(o.x);
      if (Number.isFinite(v)) bins.has(x) ? bins.get(x).push(v) : bins.set(x, [v]);
    }
    return [...bins]
      .sort((a, b) => a[0] - b[0])
      .map(([x, v]) => {
        v.sort((a, b) => a - b);
        return { x, low: v[0], middle: v[v.length >> 1], high: v[v.length - 1] };
      });
  },
  curves(host) {
    const r = TC.data.run;
    const s = TC.state;
    const q = r.numbers[s.q];
    const width = TC.width(host);
    if (!s.x) return;
    const ax = TC.run.axis(s.x);
    const by = s.by && s.by !== s.x ? TC.run.axis(s.by) : null;
    const dx = TC.run.dim(s.x);
    const db = by ? TC.run.dim(by.name) : -1;
    const series = [];
    const place = (i) => (ax.numeric ? ax.values[i] / TC.axisScale(ax).by : i);
    if (r.grid)
      for (let b = 0; b < (by ? by.values.length : 1); b++) {
        const pts = [];
        for (let i = 0; i < ax.values.length; i++) {
          const at = s.at.slice();
          at[dx] = i;
          if (by) at[db] = b;
          pts.push({ p: TC.run.flat(at), x: place(i) });
        }
        series.push({ name: by ? TC.axisWords(by, b) : "", pts, on: !by || b === s.at[db] });
      }
    else {
      const groups = new Map();
      for (let p = 0; p < r.points; p++) {
        const key = by ? TC.axisWords(by, p) : "";
        if (!groups.has(key)) groups.set(key, []);
        groups.get(key).push({ p, x: ax.numeric ? place(p) : ax.values.indexOf(ax.values[p]) });
      }
      for (const [name, pts] of groups)
        series.push({
          name,
          pts: pts.sort((a, b) => a.x - b.x),
          on: pts.some((o) => o.p === s.at[0]),
        });
    }
    const every = series.flatMap((g) => g.pts);
    const get = (o) =>
      TC.run.flag("status", o.p, s.level) === 1 ? TC.run.value(s.q, o.p, s.level) : NaN;
    const scale = TC.scale(every.map(get), q.units);
    const items = [];
    const many = series.length > TC.run.MOST_CURVES || every.length > TC.run.MOST_MARKS;
    const single =
      every.length > TC.run.MOST_MARKS * TC.run.MOST_CURVES
        ? []
        : series.filter((g) => g.on && g.pts.length <= TC.run.MOST_MARKS);
    if (many) {
      const parts = TC.run.spread(every, (o) => get(o) / scale.by);
      const x = parts.map((o) => o.x);
      items.push(
        {
          kind: "fill",
          x: [...x, ...x.slice().reverse()],
          y: [...parts.map((o) => o.low), ...parts.map((o) => o.high).reverse()],
          colour: "var(--soft)",
          alpha: 0.22,
        },
        { kind: "line", x, y: parts.map((o) => o.middle), colour: "var(--soft)", width: 2 },
      );
    }
    (many ? single : series).forEach((g, k) => {
      const look = TC.series(k);
      const at = { x: g.pts.map((o) => o.x), y: g.pts.map((o) => get(o) / scale.by) };
      if (!ax.drawn)
        items.push({
          kind: "line",
          ...at,
          colour: look.stroke,
          dash: look["stroke-dasharray"],
          width: g.on ? 2.8 : 1.5,
          alpha: g.on ? 1 : 0.75,
          label: g.name,
        });
      items.push({
        kind: "marks",
        ...at,
        shape: TC.SHAPES[k % 4],
        r: g.pts.length > 40 ? 2 : 3.6,
        stroke: look.stroke,
        fill: (i) => (TC.run.proof(g.pts[i].p, s.level) === "unique" ? look.stroke : "var(--bg)"),
        tip: (i) =>
          `${TC.run.words(TC.run.index(g.pts[i].p))}\n${TC.quantity(get(g.pts[i]), q.units)}`,
        pick: (i) => TC.set({ at: TC.run.index(g.pts[i].p) }),
      });
    });
    const marked = (many ? single : series).flatMap((g) => g.pts);
    const ambiguous = marked.filter((o) => TC.run.several(o.p, s.level) && Number.isFinite(get(o)));
    if (ambiguous.length) {
      items.push({
        kind: "line",
        x: ambiguous.map((o) => o.x),
        y: ambiguous.map((o) => get(o) / scale.by),
        dash: "none",
        mark: "o",
        open: true,
        size: 6,
        colour: "#d55e00",
        label: "starts led to different solutions",
      });
    }
    const mine = every.find((o) => o.p === TC.run.flat(s.at));
    if (mine)
      items.push({
        kind: "marks",
        x: [mine.x],
        y: [get(mine) / scale.by],
        shape: "circle",
        r: 8,
        stroke: "var(--ink)",
        fill: () => "none",
      });
    const kept = by
      ? `${TC.symbol(by.name)} of the point below`
      : "the other numbers as at the point below";
    const note = many
      ? `grey: from the least to the greatest value, and the median${by ? ` over ${TC.symbol(by.name)}` : ""}; ${single.length ? `curve: ${kept}; ` : ""}ring: the point below`
      : `${by ? `one curve for each ${TC.symbol(by.name)}; ` : ""}filled marks: proved unique; ring: the point below`;
    TC.fill(
      host,
      TC.h3(`${TC.symbol(s.q)} over ${TC.symbol(ax.name)}`),
      TC.note(note),
      TC.part.panel(
        {
          labels: [TC.axisTitle(ax), TC.titled(TC.symbol(s.q), scale)],
          log: [ax.log, false],
          limits: [null, null],
          ticks: TC.run.ticks(ax),
          items,
          high: 330,
        },
        width,
      ),
    );
  },
  MOST_TICKS: 9,
  // Ticks of a swept parameter: its texts, or some of its values where their ratios are equal.
  ticks(axis) {
    const values = [...new Set(axis.values)];
    if (!axis.numeric) return [values.map((_, i) => i), values];
    if (!axis.log) return null;
    const every = Math.ceil(values.length / TC.run.MOST_TICKS);
    const few = values.filter((_, i) => i % every === 0).map((value) => axis.values.indexOf(value));
    const { by } = TC.axisScale(axis);
    return [few.map((i) => axis.values[i] / by), few.map((i) => TC.axisLabel(axis, i))];
  },
  accuracy(host) {
    const r = TC.data.run;
    const s = TC.state;
    const p = TC.run.flat(s.at);
    const out = [];
    const width = TC.width(host);
    if (r.nlevels > 1) {
      // the table of the levels has eight columns, for which half of the width is too little
      out.push(TC.panel(TC.run.changes(Math.min(width, 760), p)), TC.panel(TC.run.costs(p)));
    } else {
      out.push(TC.note("The study has one mesh; add levels to see how the numbers converge."));
    }
    for (const one of TC.data.solvers || []) out.push(TC.part[one.part](one, width));
    TC.fill(host, out);
  },
  ROUNDING: 1e-12, // relative changes below it are none
  CONVERGED: [
    "u_T_max",
    "slip_length",
    "friction_resultant",
    "energy",
    "error_estimate",
    "error_bound_relative",
  ],
  changes(width, p) {
    // The longest edge tells a mesh only where every edge is halved.
    const r = TC.data.run;
    const own = TC.run.levels(p);
    const halved = own.h_max.every((x, l) => l === 0 || x < 0.9 * own.h_max[l - 1]);
    const h = halved ? own.h_max : Array.from(own.n_dof, (n) => 1 / Math.sqrt(n));
    const scale = TC.scale(h, halved ? r.units.h_max : "1");
    const series = [];
    for (const name of TC.run.CONVERGED.filter((n) => r.numbers[n])) {
      const v = h.map((_, l) =>
        TC.run.flag("status", p, l) === 1 ? TC.run.value(name, p, l) : NaN,
      );
      const last = Math.abs(v[v.length - 1]) || 1;
      const e = name.startsWith("error_")
        ? v
        : v.map((x, l) => (l === 0 ? NaN : Math.abs(x - v[l - 1]) / last));
      series.push({
        name,
        xs: h.map((x) => x / scale.by),
        ys: e.map((x) => (x > TC.run.ROUNDING ? x : NaN)),
        what: TC.symbol(name),
      });
    }
    const known = series.filter((g) => g.ys.some((v) => v > 0));
    const still = series.filter((g) => !known.includes(g)).map((g) => g.what);
    if (!known.length)
      return [
        TC.h3("Convergence over the levels"),
        TC.note("The numbers do not change from level to level."),
      ];
    const xs = series[0].xs.slice(1);
    const hi = Math.max(...xs);
    const lo = Math.min(...xs);
    const top = Math.max(...known.flatMap((g) => g.ys.filter((v) => v > 0)));
    const items = [];
    for (const order of [1, 2])
      items.push(
        {
          kind: "line",
          x: [lo, hi],
          y: [top * (lo / hi) ** order, top],
          colour: "var(--soft)",
          width: 1,
          dash: "3 3",
        },
        {
          kind: "note",
          x: [lo],
          y: [top * (lo / hi) ** order],
          shift: [4, 9],
          text: `order ${order}`,
        },
      );
    known.forEach((g, k) => {
      const n = g.ys.length;
      const look = TC.series(k);
      const rate =
        n > 2 && (halved || g.name.startsWith("error_"))
          ? Math.log(g.ys[n - 2] / g.ys[n - 1]) / Math.log(g.xs[n - 2] / g.xs[n - 1])
          : NaN;
      items.push({
        kind: "line",
        x: g.xs,
        y: g.ys,
        colour: look.stroke,
        dash: look["stroke-dasharray"],
        width: 2,
        mark: "os^D"[k % 4],
        size: 4,
        label: `${g.what}${Number.isFinite(rate) ? `: last order ${rate.toFixed(1).replace("-", "−")}?` : ""}`,
      });
    });
    const panel = TC.part.panel(
      {
        title: "Convergence over the levels, of this point",
        labels: [
          halved ? TC.titled("longest edge h", scale) : "1/√unknowns",
          "relative change from the level before",
        ],
        log: [true, true],
        limits: [null, null],
        items,
        high: 300,
      },
      width,
    );
    return [
      panel,
      still.length ? TC.note(`${still.join(", ")}: does not change`) : null,
      TC.note(
        "Where slip meets stick or an end is held expect order 1 for ∫ξ and slip length, up to 2 for energy and slip without singular corners. ?: a guess from two steps. The orders to expect at every corner: tcstudy converge.",
      ),
    ];
  },
  STAGES: [
    ["time_mesh", "mesh"],
    ["time_assemble", "matrices"],
    ["time_condense", "condensing, all points"],
    ["time_solve", "contact, all points"],
  ],
  // Sizes of the levels, of the geometry of the point, and their wall times of the whole sweep.
  costs(p) {
    const r = TC.data.run;
    const own = TC.run.levels(p);
    const all = [...Array(r.points).keys()];
    const sum = (name, l) =>
      r.levels[name]
        ? r.levels[name][l]
        : all.reduce((t, k) => t + (TC.run.value(name, k, l) || 0), 0);
    const rows = own.h_max.map((h, l) => [
      l,
      TC.quantity(h, r.units.h_max, 3),
      own.n_dof[l],
      own.n_contact[l],
      ...TC.run.STAGES.map(([name]) => TC.quantity(sum(name, l), "s", 2)),
    ]);
    return [
      TC.h3("Levels, and their wall time in the whole sweep"),
      TC.wide(
        [
          "level",
          "longest edge",
          "unknowns",
          "on the contact line",
          ...TC.run.STAGES.map(([, words]) => words),
        ],
        rows,
      ),
    ];
  },
  rows(host) {
    // a long table is made again only where its numbers or its order change
    const key = `${TC.state.level} ${TC.state.sort} ${TC.state.down}`;
    const here = TC.run.flat(TC.state.at);
    if (host.dataset.key === key && host.firstChild) {
      host.querySelector("tr.chosen")?.classList.remove("chosen");
      host.querySelector(`tr[data-row="${here}"]`)?.classList.add("chosen");
      return;
    }
    host.dataset.key = key;
    const r = TC.data.run;
    const s = TC.state;
    const level = s.level;
    const points = [...Array(r.points).keys()];
    const columns = [];
    for (const a of r.axes) {
      const d = TC.run.dim(a.name);
      columns.push({
        title: TC.axisTitle(a),
        csv: a.name + (a.units !== "1" ? ` [${a.units}]` : ""),
        left: !a.numeric,
        get: (p) => a.values[TC.run.index(p)[d]],
        text: (p) => TC.axisLabel(a, TC.run.index(p)[d]),
      });
    }
    for (const name of Object.keys(r.numbers).filter(
      (n) =>
        !/^(time_condense|lambda_1|omega|evaluations|heat_balance|inclusion_rounding|.*_error)/.test(
          n,
        ),
    )) {
      const n = r.numbers[name];
      const scale = TC.scale(
        points.map((p) => n.v[p * r.nlevels + level]),
        n.units,
      );
      columns.push({
        title: TC.titled(TC.symbol(name), scale),
        csv: name + (n.units !== "1" ? ` [${n.units}]` : ""),
        get: (p) => n.v[p * r.nlevels + level],
        text: (p) => TC.number(n.v[p * r.nlevels + level] / scale.by),
      });
    }
    const words = (title, get) => columns.push({ title, left: true, get, text: get });
    const reason = (p) => r.reasons[r.reason[p * r.nlevels + level]];
    words("certified", (p) => TC.run.proof(p, level));
    words("status", (p) => r.statuses[TC.run.flag("status", p, level)]);
    if (points.some(reason)) words("reason", reason);
    columns.forEach((c, k) => {
      c.minor = k > 6;
    }); // more do not fit on paper
    const t = TC.table({
      columns,
      rows: points,
      ...TC.sorting(),
      chosen: (p) => p === TC.run.flat(s.at),
      pick: (p) => TC.set({ at: TC.run.index(p) }),
    });
    const csv = () => TC.saveTable(`${TC.fileName()}-level${level}.csv`, columns, t.order);
    const scroll = host.querySelector(".scroll")?.scrollTop || 0;
    const box = TC.el("div", { class: "scroll" }, t.node);
    TC.fill(
      host,
      TC.el(
        "div",
        { class: "controls noprint" },
        TC.el("button", { onclick: csv, "aria-label": "csv" }, "Download as CSV"),
        TC.el(
          "span",
          { class: "note" },
          `${r.points > TC.MOST_ROWS ? `the first ${TC.MOST_ROWS} in this order of ` : ""}${r.points} points${r.nlevels > 1 ? ` on level ${level}` : ""}; a click on a row shows the point`,
        ),
      ),
      box,
    );
    box.scrollTop = scroll;
  },
};
