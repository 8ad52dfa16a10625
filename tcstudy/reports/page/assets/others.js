// Pages of converge, cost and path files; the first two are also a part of a run's page.
TC.others = {
  h(c, p) { const h = c.levels.h_max; return Array.isArray(h[0]) ? h[p] : h; }, // of several geometries by point
  convergence(host, c, inside) {
    const s = TC.state, points = c.shape.reduce((a, b) => a * b, 1), p = inside && points === TC.data.run.points ? TC.run.flat(s.at) : Math.min(points - 1, Number(s.p) || 0), L = TC.others.h(c, p).length;
    const label = (k) => { const at = TC.run.index(k, c.shape); return c.axes.map((a) => `${TC.symbol(a.name)} = ${TC.axisText(a, at[c.dims.indexOf(a.dim)])}`).join(", "); };
    const controls = points > 1 && !inside ? TC.el("div", { class: "controls noprint" }, TC.choice("point", [...Array(points)].map((_, k) => [k, label(k)]), p, (v) => TC.set({ p: Number(v) }))) : null;
    const width = TC.width(host), two = width > 760, half = two ? Math.floor(width / 2 - 14) : width, groups = [["Temperature and displacement", /^(theta|u_(energy|H1|L2))/], ["Slip and friction on the contact line", /^(u_T|xi)/]];
    const plots = groups.map(([title, test]) => [title, c.errors.filter((e) => test.test(e.name))]).filter(([, es]) => es.length).map(([title, es]) => TC.panel(TC.h3(title), TC.others.loglog(half, c, es, p, L)));
    const head = ["error", "finest", "measured order", "expected", "verdict", "why that order is expected"], rows = c.errors.map((e) => {
      const errs = [...Array(L)].map((_, l) => e.error[p * L + l]), last = errs.filter(Number.isFinite).pop();
      return [e.symbol, TC.number(last, 3), e.order[p], e.expected[p] === null ? "–" : Number(e.expected[p]).toFixed(2), e.verdict[p], e.reason[p]];
    });
    const table = TC.el("div", { style: "overflow:auto" }, TC.plain(head, rows, (i, t) => (i === 0 || i > 3) && (i === 4 && /slower|pre/.test(t) ? "text bad" : "text")));
    const nums = TC.el("div", { style: "overflow:auto" }, TC.others.numbers(c, p, L));
    TC.fill(host, controls, TC.note(`Reference: ${c.reference}. Dashed: the expected order. Hollow: not converged. An order with ? is a guess from two levels.`), TC.el("div", { class: "columns" }, plots), TC.h3("Orders of convergence"), table, TC.h3("Numbers, extrapolated to h → 0"), nums, c.notes.map((n) => TC.note(n)));
  },
  numbers(c, p, L) {
    const scale = (n) => TC.scale(n.value.slice(p * L, p * L + L), n.units), by = (n) => scale(n).by;
    const head = ["level", ...c.numbers.map((n) => TC.titled(n.symbol, scale(n)))];
    const rows = [...Array(L)].map((_, l) => [l, ...c.numbers.map((n) => TC.number(n.value[p * L + l] / by(n), 7))]);
    rows.push(["h → 0", ...c.numbers.map((n) => (n.limit[p] === null ? "–" : `${TC.number(n.limit[p] / by(n), 7)} ± ${TC.number(n.uncertainty[p] / by(n), 2)}`))]);
    if (c.numbers.some((n) => n.exact[p] !== null)) rows.push(["exact", ...c.numbers.map((n) => TC.number(n.exact[p] === null ? NaN : n.exact[p] / by(n), 7))]);
    return TC.plain(head, rows);
  },
  loglog(width, c, errors, p, L) {
    const h = TC.others.h(c, p), scale = TC.scale(h, c.h_units), xs = h.map((v) => v / scale.by), all = errors.flatMap((e) => Array.from(e.error.slice(p * L, p * L + L))).filter((v) => v > 0);
    if (!all.length) return TC.note("no errors to draw");
    const room = 108, plot = new TC.Plot({ width, height: 320, x: TC.pad(TC.range(xs), 0.06, true), y: TC.pad(TC.range(all), 0.06, true), xlog: true, ylog: true, xlabel: TC.titled("longest edge h", scale), ylabel: "relative error", margin: { left: 74, right: room, top: 10, bottom: 46 } });
    const ends = [];
    errors.forEach((e, k) => {
      const look = TC.series(k), ys = xs.map((_, l) => e.error[p * L + l]), known = ys.map((v) => v > 0), last = known.lastIndexOf(true), first = known.indexOf(true);
      plot.line(xs, ys.map((v) => (v > 0 ? v : NaN)), look);
      xs.forEach((x, l) => { if (known[l]) plot.over.append(TC.marker(TC.SHAPES[k % 4], plot.px(x), plot.py(ys[l]), 4, { fill: c.status[p * L + l] === 1 ? look.stroke : "var(--bg)", stroke: look.stroke })); });
      if (last > first && e.expected[p] !== null) plot.line([xs[last], xs[first]], [ys[last], ys[last] * (xs[first] / xs[last]) ** e.expected[p]], { stroke: look.stroke, "stroke-width": 1, "stroke-dasharray": "3 4", opacity: 0.8 });
      if (first >= 0) ends.push({ y: plot.py(ys[first]), text: e.symbol, look });
    });
    plot.ends(ends, 15, 6);
    return plot.svg;
  },
  cost(host, c) {
    const s = TC.state, chart = c.charts.find((o) => o.name === s.error) || c.charts.find((o) => o.name === "u_energy") || c.charts[0];
    if (!chart) { TC.fill(host, TC.note("Nothing was measured.")); return; }
    const rows = chart.rows.filter((r) => r.error > 0 && r.time > 0), width = TC.width(host), keys = [...new Set(rows.map((r) => `${r.family}, ${r.solver}`))], families = [...new Set(rows.map((r) => r.family))], solvers = [...new Set(rows.map((r) => r.solver))];
    const draw = (x, label, w) => {
      const room = 16, plot = new TC.Plot({ width: w, height: 330, x: TC.pad(TC.range(rows.map(x)), 0.06, true), y: TC.pad(TC.range(rows.map((r) => r.error)), 0.08, true), xlog: true, ylog: true, xlabel: label, ylabel: "relative error", margin: { left: 74, right: room, top: 10, bottom: 46 } });
      for (const key of keys) {
        const own = rows.filter((r) => `${r.family}, ${r.solver}` === key).sort((a, b) => a.level - b.level), k = families.indexOf(own[0].family), look = { stroke: `var(--c${k + 1})`, "stroke-dasharray": solvers.indexOf(own[0].solver) ? "6 4" : "" };
        plot.line(own.map(x), own.map((r) => r.error), look);
        for (const r of own) {
          const node = TC.marker(TC.SHAPES[k % 4], plot.px(x(r)), plot.py(r.error), 4.5, { fill: r.dominated ? "var(--bg)" : look.stroke, stroke: look.stroke, "stroke-width": 1.6 });
          node.append(TC.svgNode("title", {}, `${r.family}, level ${r.level}, ${r.solver}: error ${TC.percent(r.error)} in ${TC.quantity(r.time, "s", 3)}, ${r.n_dof} unknowns`));
          plot.over.append(node);
          if (r.own) { plot.over.append(TC.svgNode("circle", { cx: plot.px(x(r)), cy: plot.py(r.error), r: 10, fill: "none", stroke: "var(--ink)", "stroke-width": 1.8 })); plot.text(plot.px(x(r)) + 13, plot.py(r.error) - 8, "the study"); }
        }
      }
      return plot.svg;
    };
    const half = width > 760 ? Math.floor(width / 2 - 14) : width, key = TC.el("div", { class: "legend" }, families.map((f, k) => TC.entry(26, 12, [TC.dash(26, 6, { stroke: `var(--c${k + 1})` }), TC.marker(TC.SHAPES[k % 4], 13, 6, 4, { fill: `var(--c${k + 1})` })], f === "study" ? "the study's meshes" : `${f} meshes`)));
    if (solvers.length > 1) key.append(TC.el("span", {}, `solid: ${solvers[0]}, dashed: ${solvers.slice(1).join(", ")}; `));
    key.append(TC.el("span", {}, "filled: no other setting is both faster and closer"));
    const cols = [["meshes", (r) => r.family, 1], ["solver", (r) => r.solver, 1], ["level", (r) => r.level], ["unknowns", (r) => r.n_dof], ["error", (r) => r.error], ["time [s]", (r) => r.time]].map(([title, get, left]) => ({ title, get, left, text: left ? get : (r) => TC.number(get(r), 3) }));
    const t = TC.table({ columns: cols, rows, ...TC.sorting("csort", "cdown", 5), chosen: (r) => r.own });
    TC.fill(host, TC.el("div", { class: "controls noprint" }, TC.choice("error", c.charts.map((o) => [o.name, TC.others.ERRORS[o.name] || o.name]), chart.name, (error) => TC.set({ error }))),
      TC.el("div", { class: "columns" }, TC.panel(TC.h3("Error against wall time"), draw((r) => r.time, "wall time [s]", half)), TC.panel(TC.h3("Error against unknowns"), draw((r) => r.n_dof, "displacement unknowns", half))), key,
      TC.el("ul", {}, chart.advice.map((a) => TC.el("li", {}, a))), TC.note(`Reference: ${c.reference}. ${c.point ? `Point: ${c.point}.` : ""}`), c.notes.map((n) => TC.note(n)),
      TC.el("button", { class: "noprint", onclick: () => TC.saveTable("cost.csv", cols, t.order) }, "Download as CSV"), TC.el("div", { class: "scroll" }, t.node));
  },
  ERRORS: { theta_L2: "θ in L²", theta_H1: "θ in H¹", u_energy: "u in energy", u_H1: "u in H¹", u_L2: "u in L²", u_T_L2: "u_T in L²", u_T_max: "u_T in maximum", xi_L2: "ξ in L²", xi_nodes: "ξ at nodes", xi_max: "ξ in maximum", energy: "energy", friction_resultant: "∫ξ" },
  RESPONSES: [["mean_slip", "mean slip", "slip"], ["max_slip", "largest |slip|", "slip"], ["friction", "friction resultant ∫ξ", "friction"], ["energy", "energy", "energy"]],
  path(main) {
    const d = TC.data, c = d.path, s = TC.state, n = c.curve.parameter.length, name = c.parameter.split(".").pop();
    const within = (f) => c.curve.parameter[f] >= Math.min(...c.range) && c.curve.parameter[f] <= Math.max(...c.range);
    const kept = Array.from(c.kept), wanted = s.v === undefined ? (c.folds.find(within) ?? Math.floor(n / 2)) : Number(s.v);
    const v = kept.reduce((best, k, i) => (Math.abs(k - wanted) < Math.abs(kept[best] - wanted) ? i : best), 0);
    main.replaceChildren();
    const over = TC.section(c.branches && c.branches.complete ? "1  All equilibria of the range" : "1  Equilibria on this path"), width = TC.width(main), response = TC.others.RESPONSES.find((r) => r[0] === s.response) || TC.others.RESPONSES[0];
    const ts = TC.scale(c.range, c.units.parameter), y = c.curve[response[0]], ys = TC.scale(Array.from(y), c.units[response[2]]);
    over.append(TC.el("div", { class: "controls noprint" }, TC.choice("response", TC.others.RESPONSES, response[0], (r) => TC.set({ response: r })), TC.slider("along the path", kept.map((k) => `${TC.symbol(name)} = ${TC.number(c.curve.parameter[k] / ts.by, 4)} ${ts.unit}`), v, (i) => TC.set({ v: kept[i] }))));
    const plot = new TC.Plot({ width: width > 760 ? Math.floor(width * 0.59) : width, height: 380, x: TC.pad(c.range.slice().sort((a, b) => a - b).map((t) => t / ts.by), 0.03), y: TC.pad(TC.others.inside(c, y).map((q) => q / ys.by)), xlabel: TC.titled(`${TC.symbol(name)}`, ts), ylabel: TC.titled(`${response[1]}`, ys) });
    const t = Array.from(c.curve.parameter, (q) => q / ts.by), w = Array.from(y, (q) => q / ys.by);
    for (let i = 0; i < n - 1; ) {
      let j = i;
      while (j < n - 1 && c.stable[j] === c.stable[i]) j++;
      plot.line(t.slice(i, j + 1), w.slice(i, j + 1), c.stable[i] ? { stroke: "var(--c1)", "stroke-width": 2.6 } : { stroke: "var(--c2)", "stroke-width": 1.4, "stroke-dasharray": "5 3" });
      i = j;
    }
    if (c.loop) plot.line(Array.from(c.loop.parameter, (q) => q / ts.by), Array.from(c.loop[response[0]], (q) => q / ys.by), { stroke: "var(--soft)", "stroke-width": 5, opacity: 0.35 });
    const b = c.branches;
    for (const [k, apart] of b ? b.apart.entries() : []) for (let i = b.begin[k]; apart && i < b.begin[k + 1] - 1; i++) plot.line([b.parameter[i] / ts.by, b.parameter[i + 1] / ts.by], [b[response[0]][i] / ys.by, b[response[0]][i + 1] / ys.by], { stroke: "var(--c3)", "stroke-width": b.stable[i] ? 2.6 : 1.4, "stroke-dasharray": b.stable[i] ? "" : "5 3" });
    if (c.solutions) c.solutions.parameter.forEach((q, k) => plot.dot(q / ts.by, c.solutions[response[0]][k] / ys.by, { r: 4, fill: c.solutions.stable[k] ? "var(--c1)" : "var(--bg)", stroke: c.solutions.stable[k] ? "var(--c1)" : "var(--c2)", "stroke-width": 1.6 }));
    const folds = c.folds.filter(within);
    for (const f of folds) plot.dot(t[f], w[f], { r: 3.5, fill: "var(--bg)", stroke: "var(--ink)", "stroke-width": 1.4 }, `fold at ${TC.number(t[f])} ${ts.unit}`);
    plot.dot(t[kept[v]], w[kept[v]], { r: 8, fill: "none", stroke: "var(--ink)", "stroke-width": 2 });
    const facts = [["loop", Number.isFinite(c.numbers.energy_lost) ? `${TC.quantity(c.numbers.energy_lost, c.units.energy)} lost` : "not computed"], ...c.falls.slice(0, 8).map(([q, rising, drop]) => [`falls ${rising ? "rising" : "falling"}`, `at ${TC.quantity(q, c.units.parameter)}, ${TC.quantity(drop, c.units.energy)} lost`]), ...(c.falls.length > 8 ? [["more falls", `${c.falls.length - 8}, in the file`]] : []), ...(b ? [["branches", b.words.join("; ")]] : []), ["folds in the range", folds.length], ...(c.turns ? [["smaller turns", c.turns]] : []), ["unknowns", `${c.numbers.n_dof}, on the contact line ${c.numbers.n_contact}`], ["ω / λ₁", TC.number(c.numbers.omega / c.numbers.lambda_1)], ["begins", c.ends[0]], ["ends", c.ends[1]]];
    over.append(TC.el("div", { class: "columns wide" }, TC.panel(plot.svg, TC.legend(`solid: stable; dashed: unstable; broad grey: the hysteresis loop; small rings: folds; large ring: the state below${b && b.apart.some(Boolean) ? "; green: branches that the path does not meet" : ""}`)), TC.panel(TC.facts(facts))));
    const point = TC.section("2  One state on the path"), left = TC.panel(), right = TC.panel();
    point.append(TC.el("p", {}, TC.el("b", {}, `${TC.symbol(name)} = ${TC.quantity(c.curve.parameter[kept[v]], c.units.parameter)}`), `, vertex ${kept[v]} of ${n}, energy ${TC.quantity(c.curve.energy[kept[v]], c.units.energy, 5)}, residual ${TC.number(c.curve.residual[kept[v]], 2)}`), TC.el("div", { class: "columns wide" }, left, right));
    const line = { ...c.line, u_T_units: c.units.slip, xi_units: c.units.xi, rest: false }, m = line.x.length, law = d.laws && !d.laws.edges ? d.laws.laws[0] : null, u = TC.row(c.u_T, v), xi = TC.row(c.xi, v), piece = Math.min(kept[v], n - 2);
    const one = { line, u, xi, state: c.state.subarray(piece * m, (piece + 1) * m) };
    TC.point.profiles(left, line, [one], TC.point.frame(line, TC.width(left)), "");
    if (law) { const { plot: lp } = TC.point.lawPlot(TC.width(right), law, [one], line); right.append(TC.h3(`Friction law (${law.name})`), lp.svg); }
    if (c.solutions) {
      const q = c.solutions, data = TC.section("3  Solutions at the values asked for"), proof = (k) => (q.unique[k] ? "unique" : q.global_minimum[k] ? "global" : q.strict_minimum[k] ? "local" : "nothing");
      const cols = [[TC.titled(name, ts), (k) => q.parameter[k] / ts.by], [`mean slip [${TC.scale(q.mean_slip, c.units.slip).unit}]`, (k) => q.mean_slip[k] / TC.scale(q.mean_slip, c.units.slip).by], [`energy [${TC.scale(q.energy, c.units.energy).unit}]`, (k) => q.energy[k] / TC.scale(q.energy, c.units.energy).by], ["stable", (k) => (q.stable[k] ? "yes" : "no")], [b ? "least" : "least on the path", (k) => (q.lowest[k] ? "yes" : "no")], ["certified", proof], ["residual", (k) => q.residual[k]]].map(([title, get]) => ({ title, get, text: (k) => (typeof get(k) === "number" ? TC.number(get(k), 5) : get(k)) }));
      const table = TC.table({ columns: cols, rows: [...q.parameter.keys()], ...TC.sorting("sort", "down", 0) });
      data.append(TC.el("button", { class: "noprint", onclick: () => TC.saveTable("solutions.csv", cols, table.order) }, "Download as CSV"), TC.el("div", { class: "scroll" }, table.node));
    }
    TC.provenance(TC.section(`${c.solutions ? 4 : 3}  The study`));
  },
  inside(c, y) {
    const lo = Math.min(...c.range), hi = Math.max(...c.range), out = [];
    const ts = c.curve.parameter;
    ts.forEach((t, i) => {
      if (t >= lo && t <= hi) out.push(y[i]);
      if (i) for (const end of [lo, hi]) if ((ts[i - 1] - end) * (t - end) < 0) out.push(y[i - 1] + ((end - ts[i - 1]) / (t - ts[i - 1])) * (y[i] - y[i - 1]));
    });
    return TC.range(out.length ? out : Array.from(y));
  },
  page(kind) {
    const main = document.getElementById("main");
    if (kind === "path") return TC.others.path(main);
    if (kind === "fit") return TC.fit.draw(main);
    if (!TC.others.host) {
      TC.others.host = TC.el("div");
      const data = TC.el("div");
      main.replaceChildren(TC.el("h2", {}, kind === "cost" ? "Accuracy against cost" : "Convergence over the levels"), TC.others.host, TC.el("h2", {}, "The data"), data);
      TC.provenance(data);
    }
    TC.others[kind](TC.others.host, TC.data[kind], false);
  },
};
