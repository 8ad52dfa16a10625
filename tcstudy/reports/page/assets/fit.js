// The page of a fit: data with the curve, residuals, what was found and how well it is known, the fitted law, all data.
TC.fit = {
  NAMES: { u_T_max: "largest |u_T|", friction_resultant: "friction resultant ∫ξ", u_T: "u_T", theta_mean: "mean θ" },
  name(column) { const last = column.name.split(".").pop(); return TC.fit.NAMES[column.name] || (column.name === last ? TC.symbol(last) : `${last} of ${column.name.split(".").slice(-2)[0]}`); },
  draw(main) {
    const f = TC.data.fit, s = TC.state, rows = [...Array(f.data.value.length).keys()];
    const active = document.activeElement?.getAttribute("aria-label");
    main.replaceChildren();
    s.column = TC.run.whole(s.column, f.measured.length, 0);
    s.datum = TC.run.whole(s.datum, rows.length, Math.max(0, rows.reduce((most, i) => (Math.abs(f.data.residual[i]) > Math.abs(f.data.residual[most]) ? i : most), 0)));
    const over = TC.section("1  Data and fit", "fit"), left = TC.panel(), right = TC.panel();
    const controls = TC.el("div", { class: "controls noprint" }, f.measured.length > 1 ? TC.choice("measured", f.measured.map((c, k) => [k, TC.fit.name(c)]), s.column, (column) => TC.set({ column: Number(column) })) : null,
      TC.slider("datum", rows.map((i) => `${i + 1} of ${rows.length}`), s.datum, (datum) => TC.set({ datum, column: f.data.column[datum] })));
    over.append(controls, TC.el("div", { class: "columns wide" }, left, right));
    TC.fit.curve(left);
    TC.fit.one(right);
    TC.fit.residuals(right);
    const found = TC.section("2  What was found", "found"), a = TC.panel(), b = TC.panel();
    found.append(TC.fit.parameters(), TC.el("div", { class: "columns" }, a, b));
    TC.fit.determined(a);
    TC.fit.correlations(a);
    TC.fit.law(b);
    TC.fit.work(b);
    const data = TC.section("3  The data", "table");
    TC.fit.table(data, rows);
    TC.provenance(data);
    if (active) main.querySelector(`[aria-label="${CSS.escape(active)}"]`)?.focus();
  },
  scales() {
    const f = TC.data.fit, k = TC.state.column, own = [...f.data.column.keys()].filter((i) => f.data.column[i] === k), at = (v) => own.map((i) => v[i]);
    const placed = f.given.length > 0 && own.every((i) => Number.isFinite(f.data.given[i])); // a fold or a peak has no place
    return { own, placed, x: TC.scale(at(f.data.given), f.given.length ? f.given[0].units : "1"), y: TC.scale(at(f.data.value), f.measured[k].units), given: placed ? TC.fit.name(f.given[0]) : "datum" };
  },
  curve(host) {
    const f = TC.data.fit, s = TC.state, { own, placed, x: xs, y: ys, given } = TC.fit.scales(), d = f.data, shown = s.column === 0 && f.curve, width = TC.width(host);
    const X = (v) => v / xs.by, Y = (v) => v / ys.by, at = (i) => (placed ? X(d.given[i]) : i + 1), foot = (i) => (placed ? X(d.at[i]) : i + 1);
    const xr = TC.range([...own.map(at), ...own.map(foot)]), yr = TC.range([0, ...own.flatMap((i) => [Y(d.value[i]), Y(d.predicted[i])]), ...(shown ? Array.from(f.curve.y).filter((_, k) => f.curve.x[k] / xs.by >= xr[0] && f.curve.x[k] / xs.by <= xr[1]).map(Y) : [])]);
    const plot = new TC.Plot({ width, height: 400, x: TC.pad(xr, 0.05), y: TC.pad(yr, 0.06), xlabel: TC.titled(given, xs), ylabel: TC.titled(TC.fit.name(f.measured[s.column]), ys), label: "data and fitted curve" });
    if (shown) {
      plot.line(Array.from(f.curve.x, X), Array.from(f.curve.y, Y), { stroke: "var(--c1)", "stroke-width": 2 });
      for (const k of f.curve.folds) plot.dot(X(f.curve.x[k]), Y(f.curve.y[k]), { r: 5, fill: "var(--bg)", stroke: "var(--c2)", "stroke-width": 2 }, "fold");
    } else {
      const order = own.slice().sort((i, j) => foot(i) - foot(j)), up = order.map((i) => Y(d.predicted[i] + f.band * d.error[i])), low = order.map((i) => Y(d.predicted[i] - f.band * d.error[i]));
      TC.fit.ring(plot, order.map(foot), up, low);
      plot.line(order.map(foot), order.map((i) => Y(d.predicted[i])), { stroke: "var(--c1)", "stroke-width": 2 });
    }
    for (const i of own) {
      const px = plot.px(at(i)), py = plot.py(Y(d.value[i])), noise = Math.abs(plot.py(Y(d.value[i] + d.noise[i])) - py), across = shown ? Math.abs(plot.px(X(d.given[i] + f.numbers.given_noise)) - px) : 0;
      plot.inner.append(TC.svgNode("path", { d: `M${px},${py - noise}V${py + noise}M${px - across},${py}H${px + across}`, stroke: "var(--soft)", "stroke-width": 1 }));
      const mark = plot.dot(at(i), Y(d.value[i]), { r: 3, fill: Math.abs(d.residual[i]) > f.band ? "var(--c2)" : "var(--ink)", class: "mark" }, `datum ${i + 1}: residual ${TC.number(d.residual[i], 3)} of its noise`);
      mark.addEventListener("click", () => TC.set({ datum: i }));
    }
    const i = s.datum;
    if (d.column[i] === s.column) { plot.line([at(i), foot(i)], [Y(d.value[i]), Y(d.predicted[i])], { stroke: "var(--c2)", "stroke-width": 2 }); plot.dot(at(i), Y(d.value[i]), { r: 9, fill: "none", stroke: "var(--ink)", "stroke-width": 2 }); }
    const key = [shown ? "line: the study with the numbers found" : "line and band: the study, 95 %", shown && f.curve.folds.length ? "orange rings: folds" : "", "bars: noise", "orange dots: beyond 1.96 noises", "large ring: the datum beside"].filter(Boolean).join("; ");
    host.append(TC.h3(`${TC.fit.name(f.measured[s.column])} over ${given}`), plot.svg, TC.legend(key));
  },
  ring(plot, xs, up, low) {
    const points = [...xs.map((x, k) => [x, up[k]]), ...xs.map((x, k) => [x, low[k]]).reverse()].filter((q) => q.every(Number.isFinite));
    plot.inner.append(TC.svgNode("path", { d: points.map(([x, y], k) => `${k ? "L" : "M"}${plot.px(x).toFixed(1)},${plot.py(y).toFixed(1)}`).join("") + "Z", fill: "var(--c1)", opacity: 0.22 }));
  },
  one(host) {
    const f = TC.data.fit, i = TC.state.datum, d = f.data, column = f.measured[d.column[i]], facts = [["measured", TC.fit.name(column)]];
    if (TC.fit.scales().placed) facts.push([TC.fit.name(f.given[0]), TC.quantity(d.given[i], f.given[0].units)]);
    facts.push(["value", TC.quantity(d.value[i], column.units, 5)], ["of the study", TC.quantity(d.predicted[i], column.units, 5)], ["noise", TC.quantity(d.noise[i], column.units)], ["residual", `${TC.number(d.residual[i], 3)} noises`]);
    if (f.curve && TC.fit.scales().placed) facts.push(["nearest on the curve at", TC.quantity(d.at[i], f.given[0].units, 5)]);
    host.append(TC.h3(`Datum ${i + 1}`), TC.facts(facts));
  },
  residuals(host) {
    const f = TC.data.fit, s = TC.state, { own } = TC.fit.scales(), r = own.map((i) => f.data.residual[i]), most = Math.max(2.4, ...r.map(Math.abs));
    const plot = new TC.Plot({ width: TC.width(host), height: 220, x: [own[0] + 0.5, own[own.length - 1] + 1.5], y: TC.pad([-most, most], 0.06), xlabel: "number of the datum", ylabel: "residual / noise", label: "residuals" });
    plot.back.prepend(TC.svgNode("rect", { x: plot.left, width: plot.right - plot.left, y: plot.py(f.band), height: plot.py(-f.band) - plot.py(f.band), fill: "var(--shade)" }));
    own.forEach((i, k) => { const mark = plot.dot(i + 1, r[k], { r: 3, fill: Math.abs(r[k]) > f.band ? "var(--c2)" : "var(--ink)", class: "mark" }, `datum ${i + 1}`); mark.addEventListener("click", () => TC.set({ datum: i })); });
    if (own.includes(s.datum)) plot.dot(s.datum + 1, f.data.residual[s.datum], { r: 8, fill: "none", stroke: "var(--ink)", "stroke-width": 2 });
    host.append(TC.h3("Residuals"), plot.svg, TC.legend("shaded: where 95 % of them lie if the study is right"));
  },
  // Every number with its interval between its bounds.
  parameters() {
    const f = TC.data.fit, head = ["", "key", "estimate", "standard error", "95 % interval", "began at", "within", "interval in its bounds"];
    const rows = f.parameters.map((q) => {
      const s = TC.scale([q.estimate], q.units), n = (v, k = 4) => TC.number(v / s.by, k), known = Number.isFinite(q.low) && !q.at_bound;
      return [TC.el("b", {}, q.symbol), q.name, `${n(q.estimate, 5)} ${s.unit}`, known ? `${n(q.standard_error, 2)} ${s.unit}` : "–", known ? `${n(q.low)} … ${n(q.high)} ${s.unit}` : q.at_bound ? "on its bound" : "not determined", `${n(q.parameter_start)} ${s.unit}`, `${n(q.within[0])} … ${n(q.within[1])} ${s.unit}`, TC.fit.bar(q)];
    });
    const table = TC.wide(head, rows, (k) => k < 2 && "text"), assumed = f.words.noise_assumed;
    return assumed ? TC.el("div", {}, table, TC.note(`the intervals assume that ${assumed}`)) : table;
  },
  bar(q) {
    const log = q.logarithmic && q.within[0] > 0, x = (v) => 4 + 132 * Math.min(1, Math.max(0, TC.Plot.map(v, q.within, 0, 1, log))), svg = TC.svgNode("svg", { width: 140, height: 14, role: "img", "aria-label": "interval" });
    svg.append(TC.svgNode("line", { x1: 4, x2: 136, y1: 7, y2: 7, stroke: "var(--line)", "stroke-width": 2 }));
    if (Number.isFinite(q.low)) svg.append(TC.svgNode("line", { x1: x(q.low), x2: Math.max(x(q.high), x(q.low) + 2), y1: 7, y2: 7, stroke: "var(--c1)", "stroke-width": 6 }));
    svg.append(TC.svgNode("circle", { cx: x(q.estimate), cy: 7, r: 3, fill: "var(--ink)" }), TC.svgNode("path", { d: `M${x(q.parameter_start)},2V12`, stroke: "var(--c2)", "stroke-width": 1.5 }, TC.svgNode("title", {}, "where the search began")));
    return svg;
  },
  determined(host) {
    const f = TC.data.fit, product = (v) => f.parameters.map((q, k) => [q.symbol, v[k]]).filter(([, e]) => Math.abs(e) > 0.05).map(([t, e]) => `${t}^${TC.number(e, 2)}`).join(" · "), most = Math.max(...f.directions.map((o) => o.size));
    host.append(TC.h3("What the data say of the fit"), TC.el("ul", {}, f.doubts.map(([words, doubt]) => TC.el("li", { class: doubt ? "bad" : "" }, words))));
    const rows = f.directions.map((o) => [product(o.vector), TC.number(o.size, 3), TC.number(1 / o.size, 2)]), bad = (i) => i !== undefined && f.directions[i].size < 1e-3 * most;
    host.append(TC.h3("Products of powers, from the best determined to the worst"), TC.wide(["product", "singular value", "known to (relative)"], rows, (k, _, i) => `${k ? "" : "text"}${bad(i) ? " bad" : ""}`));
  },
  correlations(host) {
    const f = TC.data.fit, n = f.parameters.length;
    if (n < 2) return;
    const cell = (v) => { const size = Math.min(1, Math.abs(v ?? 0)); return { style: v === null ? "" : `background:color-mix(in srgb, var(${v > 0 ? "--c1" : "--c2"}) ${Math.round(45 * size)}%, transparent)` }; };
    host.append(TC.h3("Correlations"), TC.el("div", { class: "wide-table" }, TC.el("table", {}, TC.el("thead", {}, TC.el("tr", {}, TC.el("th", {}, ""), f.parameters.map((q) => TC.el("th", {}, q.symbol)))), TC.el("tbody", {}, f.parameters.map((q, i) => TC.el("tr", {}, TC.el("th", { class: "text" }, q.symbol), f.correlation[i].map((v, j) => TC.el("td", i === j ? {} : cell(v), v === null ? "–" : v.toFixed(3).replace("-", "−")))))))), TC.note("near ±1: the data tell the two apart only together"));
  },
  law(host) {
    const law = TC.data.fit.law;
    if (!law) return;
    const band = TC.data.fit.band, xs = TC.scale(law.slip, law.units.slip), ys = TC.scale(law.traction, law.units.traction), x = Array.from(law.slip, (v) => v / xs.by), at = (sign) => Array.from(law.traction, (v, k) => (v + sign * band * law.error[k]) / ys.by);
    const plot = new TC.Plot({ width: TC.width(host), height: 260, x: TC.range(x), y: TC.pad(TC.range([0, ...at(1), ...at(-1)])), xlabel: TC.titled("slip u_T", xs), ylabel: TC.titled("ξ", ys), label: "the fitted law" });
    TC.fit.ring(plot, x, at(1), at(-1));
    plot.line(x, at(0), { stroke: "var(--c1)", "stroke-width": 2 });
    host.append(TC.h3("The fitted law, with its 95 % band"), plot.svg);
  },
  work(host) {
    const f = TC.data.fit, w = f.words, facts = [["data", w.data_file], ["compared", w.compare], ["loss", w.loss], ["evaluations", f.numbers.evaluations], [w.compare === "orthogonal" ? "paths followed" : "contact problems", f.numbers.solves], ["AICc", TC.number(f.numbers.information_criterion, 5)], ["ended", w.message]];
    host.append(TC.h3("How it was found"), TC.facts(facts));
    if (f.starts.length < 2) return;
    const rows = f.starts.map((o) => [o.count, TC.number(2 * o.cost, 5), ...f.parameters.map((q, k) => TC.quantity(o.estimate[k], q.units)), o.evaluations]);
    host.append(TC.h3("Distinct minima that starts end in; the first is the lowest"), TC.wide(["starts", "Σ r²", ...f.parameters.map((q) => q.symbol), "evaluations"], rows));
  },
  table(host, rows) {
    const f = TC.data.fit, s = TC.state, d = f.data, one = f.measured.length === 1, units = one ? f.measured[0].units : "1", ys = one ? TC.scale(d.value, units) : { by: 1, unit: "" }, xs = f.given.length ? TC.scale(d.given, f.given[0].units) : null;
    const columns = [{ title: "datum", get: (i) => i + 1, text: (i) => String(i + 1) }];
    const add = (title, csv, unit, get, scale) => columns.push({ title: TC.titled(title, scale), csv: csv + (unit !== "1" ? ` [${unit}]` : ""), get, text: (i) => TC.number(get(i) / scale.by, 5) });
    if (!one) columns.push({ title: "measured", left: true, get: (i) => f.measured[d.column[i]].name, text: (i) => TC.fit.name(f.measured[d.column[i]]) + (TC.unit(f.measured[d.column[i]].units) ? ` [${TC.unit(f.measured[d.column[i]].units)}]` : "") });
    if (xs) add(TC.fit.name(f.given[0]), f.given[0].name, f.given[0].units, (i) => d.given[i], xs);
    add("value", "value", units, (i) => d.value[i], ys);
    add("of the study", "predicted", units, (i) => d.predicted[i], ys);
    add("noise", "noise", units, (i) => d.noise[i], ys);
    add("residual / noise", "residual", "1", (i) => d.residual[i], { by: 1, unit: "" });
    const t = TC.table({ columns, rows, ...TC.sorting(), chosen: (i) => i === s.datum, pick: (datum) => TC.set({ datum, column: d.column[datum] }) });
    host.append(TC.el("div", { class: "controls noprint" }, TC.el("button", { "aria-label": "csv", onclick: () => TC.saveTable(`${TC.fileName()}.csv`, columns, t.order) }, "Download as CSV"), TC.el("span", { class: "note" }, "a click on a row shows the datum")), TC.el("div", { class: "scroll" }, t.node));
  },
};
