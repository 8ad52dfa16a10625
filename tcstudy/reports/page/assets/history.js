// The page of a load history: loops of its numbers, one step with what every node does, energies, cycles, all steps.
TC.MOVES = ["--body", "--c6", "--c5", "--c2"];
TC.history = {
  PROOFS: { unique: "every step proved to be the only solution", global: "every step proved to have the least energy", local: "every step proved to be a local minimum", nothing: "steps of which nothing is proved", failed: "ended before its last step" },
  setup(given) {
    const h = TC.data.history, s = TC.state, names = TC.history.names(), loads = h.loads.map((o) => o.name);
    s.lx = names.includes(given.lx) ? given.lx : loads[0];
    s.ly = names.includes(given.ly) ? given.ly : loads.some((n) => /^u_/.test(n)) || !h.line ? "friction_resultant" : "slip";
    s.step = TC.run.whole(given.step, h.steps, TC.history.done(TC.run.flat(s.at)) - 1);
    const ref = String(given.ref || "").split(",").map(Number);
    s.ref = ref.length === 2 && TC.run.whole(ref[0], TC.data.run.points, -1) >= 0 && TC.run.whole(ref[1], h.steps, -1) >= 0 ? ref : null;
  },
  // Number of solved steps of a point, step 0 included.
  done(p) { const h = TC.data.history; let n = 0; while (n < h.steps && h.flags.status[p * h.steps + n] === 1) n++; return n; },
  names: () => [...TC.data.history.loads.map((o) => o.name), "step", ...(TC.data.history.line ? ["slip"] : []), ...TC.data.history.numbers.map((o) => o.name)],
  // Title and units of a number, and its value at a step of a point.
  about(name) {
    const h = TC.data.history, load = h.loads.find((o) => o.name === name), own = h.numbers.find((o) => o.name === name);
    if (name === "step") return { title: "step", units: "1", at: (p, i) => i };
    if (load) return { title: load.symbol, units: load.units, at: (p, i) => load.v[i] };
    if (own) return { title: TC.WORDS[own.name] || own.long_name, units: own.units, at: (p, i) => own.v[p * h.steps + i] };
    return { title: "u_T where it is largest", units: h.line.u_T_units, at: (p, i) => TC.row(h.line.u_T, p * h.steps + i)[TC.history.widest(p)] };
  },
  // The same with its values at all steps of a point.
  number(name, p) { const about = TC.history.about(name); return { ...about, v: [...Array(TC.history.done(p)).keys()].map((i) => about.at(p, i)) }; },
  words: (name) => TC.history.about(name).title,
  // The node with the largest slip of all steps.
  widest(p) {
    const h = TC.data.history, known = (h.widest = h.widest || {});
    if (known[p] === undefined) {
      let most = -1;
      for (let i = 0; i < TC.history.done(p); i++) TC.row(h.line.u_T, p * h.steps + i).forEach((u, k) => { if (Math.abs(u) > most) { most = Math.abs(u); known[p] = k; } });
    }
    return known[p] || 0;
  },
  value(name, p, i) { const h = TC.data.history, own = h.numbers.find((o) => o.name === name); return own ? own.v[p * h.steps + i] : NaN; },
  // What is seen beside the step: the kept one, the same step of the compared point, the step before.
  reference(p) {
    const s = TC.state;
    if (s.ref) return { p: s.ref[0], step: s.ref[1], words: "the kept step" };
    if (s.vs && TC.run.flat(s.vs) !== p) return { p: TC.run.flat(s.vs), step: s.step, words: TC.run.words(s.vs) };
    return s.step > 0 ? { p, step: s.step - 1, words: "the step before" } : null;
  },
  compare() { const s = TC.state; TC.set({ ref: s.ref ? null : [TC.run.flat(s.at), s.step] }); },
  stepWords(i) { const h = TC.data.history; return `${i}${h.names[i] ? `, ${h.names[i]}` : ""}`; },
  draw(host) {
    const s = TC.state, h = TC.data.history, p = TC.run.flat(s.at), n = TC.history.done(p);
    const reason = TC.data.run.reasons[TC.data.run.reason[p]], failed = reason ? TC.el("span", { class: "bad" }, ` Ended at step ${n}: ${reason}`) : null;
    if (!n) { TC.fill(host, TC.el("p", {}, TC.el("b", {}, TC.run.words(s.at)), failed)); return; }
    s.step = Math.min(s.step, n - 1);
    const head = TC.data.run.points > 1 || failed ? TC.el("p", {}, TC.data.run.points > 1 ? TC.el("b", {}, `${TC.run.words(s.at)}. `) : null, h.changes[p] || "", failed) : null;
    const options = TC.history.names().map((name) => [name, TC.history.words(name)]);
    const controls = TC.el("div", { class: "controls noprint" }, TC.choice("loop of", options, s.ly, (ly) => TC.set({ ly })), TC.choice("over", options, s.lx, (lx) => TC.set({ lx })),
      TC.slider("step", [...Array(n)].map((_, i) => TC.history.stepWords(i)), s.step, (step) => TC.set({ step })),
      TC.el("button", { "aria-pressed": s.ref ? "true" : "false", "aria-label": "compare", title: "keep this step and see others beside it (c)", onclick: TC.history.compare }, s.ref ? "stop comparing" : "compare with …"));
    const left = TC.panel(), right = TC.panel();
    TC.fill(host, head, controls, TC.el("div", { class: "columns wide" }, left, right));
    TC.history.loop(left, p);
    TC.history.step(right, p);
    if (!h.line) { left.append(TC.note("The page was made without contact lines; the file has them.")); return; }
    h.line.moves = h.moves;
    TC.history.profiles(left, p);
    TC.history.motion(right, p);
  },
  loop(host, p) {
    const s = TC.state, h = TC.data.history, width = TC.width(host), other = TC.history.reference(p);
    const of = (q) => ({ q, x: TC.history.number(s.lx, q), y: TC.history.number(s.ly, q) }), own = of(p), more = other && other.p !== p ? [of(other.p)] : [];
    const xs = TC.scale([own, ...more].flatMap((o) => o.x.v), own.x.units), ys = TC.scale([own, ...more].flatMap((o) => o.y.v), own.y.units), label = (o, scale) => TC.titled(o.title, scale);
    const plot = new TC.Plot({ width, height: Math.min(380, Math.max(260, 0.62 * width)), x: TC.pad(TC.range([own, ...more].flatMap((o) => o.x.v.map((v) => v / xs.by))), 0.05), y: TC.pad(TC.range([own, ...more].flatMap((o) => o.y.v.map((v) => v / ys.by))), 0.08), xlabel: label(own.x, xs), ylabel: label(own.y, ys), label: `${TC.history.words(s.ly)} over ${TC.history.words(s.lx)}` });
    for (const o of more) plot.line(o.x.v.map((v) => v / xs.by), o.y.v.map((v) => v / ys.by), { stroke: "var(--soft)", "stroke-width": 1.4, "stroke-dasharray": "6 4" });
    const x = own.x.v.map((v) => v / xs.by), y = own.y.v.map((v) => v / ys.by), n = x.length, last = h.cycle.slice(0, n).indexOf(h.cycle[n - 1]), from = Math.max(0, last - 1);
    plot.line(x, y, { stroke: "var(--c1)", "stroke-width": 1.2, opacity: 0.6 });
    plot.line(x.slice(from), y.slice(from), { stroke: "var(--c1)", "stroke-width": 2.4 });
    const taken = [], put = (i) => {
      const px = plot.px(x[i]), py = plot.py(y[i]), name = h.names[i], wide = 7 * name.length, end = px + 8 + wide > plot.right, a = end ? px - 8 - wide : px + 8, over = (t) => a < t.b && a + wide > t.a && Math.abs(py - t.y) < 15;
      if (taken.some((t) => t.name === name) || taken.some(over)) return;
      taken.push({ name, a, b: a + wide, y: py });
      plot.text(px + (end ? -8 : 8), py - 6, name, { "text-anchor": end ? "end" : "start" });
    };
    for (let i = 0; i < n; i++) {
      const here = h.names[i] || n <= 60;
      if (TC.history.value("jumps", p, i) > 0) plot.dot(x[i], y[i], { r: 7, fill: "none", stroke: "var(--c2)", "stroke-width": 2 }, "jumps in this step");
      if (!here) continue;
      const mark = plot.dot(x[i], y[i], { r: h.names[i] ? 3.6 : 2.2, fill: "var(--ink)", class: "mark" }, `step ${TC.history.stepWords(i)}`);
      mark.addEventListener("click", () => TC.set({ step: i }));
    }
    for (let i = 0; i < n; i++) if (h.names[i]) put(i);
    plot.dot(x[s.step], y[s.step], { r: 9, fill: "none", stroke: "var(--ink)", "stroke-width": 2.2 });
    const key = `${h.cycle[n - 1] > 1 ? "heavy: last cycle; " : ""}large ring: the step beside${h.numbers.some((o) => o.name === "jumps" && o.v.some((v) => v > 0)) ? "; orange rings: jumps" : ""}${more.length ? `; dashed: ${other.words}` : ""}`;
    host.append(TC.h3(`${TC.history.words(s.ly)} over ${TC.history.words(s.lx)}`), plot.svg, TC.legend(key));
  },
  step(host, p) {
    const s = TC.state, h = TC.data.history, i = s.step, one = (name) => { const own = TC.history.number(name, p), scale = TC.scale(own.v, own.units); return [own.title, `${TC.number(own.v[i] / scale.by)} ${scale.unit}`.trim()]; };
    const proof = TC.history.proof(p, i), words = { unique: "only solution", global: "least energy", local: "local minimum", nothing: "nothing" };
    const facts = [["cycle", h.cycle[i]], ...h.loads.map((o) => [o.symbol, TC.quantity(o.v[i], o.units)]), ...["u_T_max", "friction_resultant", "slip_length", "dissipated", "released", "stored", "work", "jumps", "inclusion_residual"].map(one), ["proved", words[proof]]];
    host.append(TC.h3(`Step ${TC.history.stepWords(i)}`), TC.facts(facts));
  },
  proof(p, i) {
    const h = TC.data.history, f = (name) => h.flags[name] && h.flags[name][p * h.steps + i] === 1;
    return f("unique") ? "unique" : f("global_minimum") ? "global" : f("strict_minimum") ? "local" : "nothing";
  },
  profiles(host, p) {
    const s = TC.state, h = TC.data.history, line = h.line, m = line.x.length, other = TC.history.reference(p);
    const one = (q, i) => { const k = q * h.steps + i; return { line, u: TC.row(line.u_T, k), xi: TC.row(line.xi, k), state: line.state.subarray(k * m, (k + 1) * m), k }; };
    const cases = [one(p, s.step), ...(other && other.step < TC.history.done(other.p) ? [one(other.p, other.step)] : [])], frame = { ...TC.point.frame(line, TC.width(host)), shape: false };
    TC.point.profiles(host, line, cases, frame, cases.length > 1 ? `dashed: ${other.words}` : "");
    for (const own of line.memory) {
      const rows = cases.map((c) => TC.row(own.v, c.k)), scale = TC.scale(rows.flatMap((r) => TC.range(r)), own.units), by = TC.scale(TC.range(line.arclength), line.u_T_units), ys = rows.map((r) => Array.from(r, (v) => v / scale.by));
      if (!rows.some((r) => r.some((v) => v !== 0))) continue;
      const plot = new TC.Plot({ width: TC.width(host), height: 160, x: TC.pad(TC.range(line.arclength).map((v) => v / by.by), 0.02), y: TC.pad(TC.range([0, ...ys.flat()])), xlabel: TC.titled("arc length", by), ylabel: TC.titled(`${own.name === "kappa" ? "κ" : "u_p"}`, scale), label: own.long_name });
      ys.forEach((y, k) => { for (const part of line.parts) plot.line(Array.from(line.arclength.slice(part.a, part.b), (v) => v / by.by), y.slice(part.a, part.b), { stroke: "var(--c3)", ...(k ? { "stroke-dasharray": "6 4", opacity: 0.85 } : {}) }); });
      host.append(TC.h3(`What the nodes remember: ${own.long_name}`), plot.svg);
    }
  },
  // What every node does in every step: arc length over steps, a path for each state.
  motion(host, p) {
    const s = TC.state, h = TC.data.history, line = h.line, m = line.x.length, n = TC.history.done(p), ends = new Float64Array(m + 1), order = [...Array(m).keys()].sort((a, b) => line.arclength[a] - line.arclength[b]);
    order.forEach((i, k) => { ends[k + 1] = ends[k] + line.c[i]; });
    const by = TC.scale([ends[m]], line.u_T_units), plot = new TC.Plot({ width: TC.width(host), height: 250, x: [-0.5, n - 0.5], y: [0, ends[m] / by.by], xlabel: "step", ylabel: TC.titled("arc length", by), label: "what every node does in every step; a click chooses a step" });
    const paths = h.moves.map(() => "");
    for (let i = 0; i < n; i++) for (let k = 0; k < m; ) {
      const what = line.state[(p * h.steps + i) * m + order[k]];
      let j = k;
      while (j < m && line.state[(p * h.steps + i) * m + order[j]] === what) j++;
      paths[what] += `M${plot.px(i - 0.5).toFixed(1)},${plot.py(ends[k] / by.by).toFixed(1)}H${(plot.px(i + 0.5) + 0.3).toFixed(1)}V${(plot.py(ends[j] / by.by) - 0.3).toFixed(1)}H${plot.px(i - 0.5).toFixed(1)}Z`;
      k = j;
    }
    paths.forEach((d, k) => { if (d) plot.inner.append(TC.svgNode("path", { d, fill: `var(${TC.MOVES[k]})`, stroke: "none" })); });
    for (let i = 2; i < n; i++) if (h.cycle[i] !== h.cycle[i - 1]) plot.vertical(i - 0.5, { stroke: "var(--ink)", "stroke-dasharray": "4 2" });
    plot.over.append(TC.svgNode("rect", { x: plot.px(s.step - 0.5), y: plot.top, width: Math.max(2, plot.px(0.5) - plot.px(-0.5)), height: plot.bottom - plot.top, fill: "none", stroke: "var(--ink)", "stroke-width": 2, "pointer-events": "none" }));
    plot.svg.addEventListener("click", (e) => { const i = Math.round(plot.ix(e.clientX - plot.svg.getBoundingClientRect().left)); if (i >= 0 && i < n) TC.set({ step: i }); });
    plot.svg.style.cursor = "pointer";
    const key = TC.el("div", { class: "legend" }, h.moves.map((word, k) => (paths[k] ? TC.swatch(`var(${TC.MOVES[k]})`, word) : null)).filter(Boolean), h.cycle[n - 1] > 1 ? "dashed: cycles; " : "", "frame: the step");
    host.append(TC.h3("What every node does in every step"), plot.svg, key);
  },
  accuracy(host) {
    const h = TC.data.history, p = TC.run.flat(TC.state.at), n = TC.history.done(p);
    if (!n) { TC.fill(host); return; }
    const left = TC.panel(), right = TC.panel();
    TC.fill(host, TC.el("div", { class: "columns" }, left, right), TC.facts(Object.entries(h.about)));
    TC.history.energies(left, p, n);
    TC.history.cycles(right, p, n);
  },
  // Sums over the steps, and what body and bond have.
  energies(host, p, n) {
    const xs = [...Array(n).keys()], h = TC.data.history, sum = (name) => { let total = 0; return xs.map((i) => (total += TC.history.value(name, p, i) || 0)); }, as = (name) => xs.map((i) => TC.history.value(name, p, i));
    const panels = [["Energies of the bond since the beginning", [["dissipated", sum("dissipated")], ["released by jumps", sum("released")], ["stored", as("stored")]]], ["Body and loads", [["work of the loads' change, since the beginning", sum("work")], ["energy of body and loads", as("energy")]]]];
    const units = h.numbers.find((o) => o.name === "dissipated").units;
    for (const [title, all] of panels) {
      const found = all.filter(([, v]) => v.some((x) => x !== 0 && Number.isFinite(x))), scale = TC.scale(found.flatMap(([, v]) => v), units);
      if (!found.length) continue;
      const plot = new TC.Plot({ width: TC.width(host), height: 210, x: TC.pad([0, Math.max(1, n - 1)], 0.02), y: TC.pad(TC.range([0, ...found.flatMap(([, v]) => v.map((x) => x / scale.by))])), xlabel: "step", ylabel: TC.titled("energy", scale), label: title });
      found.forEach(([, v], k) => plot.line(xs, v.map((x) => x / scale.by), TC.series(k)));
      plot.vertical(TC.state.step, { stroke: "var(--ink)" });
      host.append(TC.h3(title), plot.svg, TC.el("div", { class: "legend" }, found.map(([words], k) => TC.stroke(k, words)), "vertical: the step"));
    }
  },
  cycles(host, p, n) {
    const h = TC.data.history, last = h.cycle[n - 1], rows = [];
    for (let c = 1; c <= last; c++) {
      const own = [...Array(n).keys()].filter((i) => h.cycle[i] === c), end = own[own.length - 1], sum = (name) => own.reduce((t, i) => t + (TC.history.value(name, p, i) || 0), 0);
      const u = (i) => TC.row(h.line.u_T, p * h.steps + i), before = h.line ? u(own[0] - 1) : null, change = h.line ? u(end).reduce((most, v, k) => Math.max(most, Math.abs(v - before[k])), 0) : NaN;
      rows.push({ c, dissipated: sum("dissipated"), released: sum("released"), closure: sum("closure"), change, jumps: sum("jumps") });
    }
    const units = h.numbers.find((o) => o.name === "dissipated").units, scaled = (name, u) => TC.scale(rows.map((r) => r[u === units ? "dissipated" : name]), u), column = (title, name, u) => { const s = scaled(name, u); return { title: TC.titled(title, s), get: (r) => r[name], text: (r) => TC.number(r[name] / s.by, name === "closure" ? 2 : 5) }; };
    const columns = [{ title: "cycle", get: (r) => r.c, text: (r) => String(r.c) }, column("dissipated", "dissipated", units), column("missed by steps", "closure", units), ...(h.line ? [column("change of u_T", "change", h.line.u_T_units)] : []), ...(rows.some((r) => r.jumps) ? [column("jumps", "jumps", "1"), column("released", "released", units)] : [])];
    const t = TC.table({ columns, rows, sort: -1, onsort: () => {} });
    host.append(TC.h3("What each cycle does"), TC.el("p", {}, h.changes[p] || (last < 2 ? "One cycle: nothing to compare with." : "")), TC.el("div", { class: "scroll" }, t.node), TC.note("change of u_T: the largest of what the cycle leaves behind; missed by steps: energy that finite steps do not account for"));
  },
  rows(host) {
    const s = TC.state, h = TC.data.history, p = TC.run.flat(s.at), n = TC.history.done(p), steps = [...Array(n).keys()];
    const columns = [{ title: "step", get: (i) => i, text: (i) => String(i) }, { title: "name", left: true, get: (i) => h.names[i], text: (i) => h.names[i] }, { title: "cycle", get: (i) => h.cycle[i], text: (i) => String(h.cycle[i]) }];
    const minor = ["work", "closure", "energy", "inclusion_residual", "identity", "parts", "iterations"];
    const add = (title, name, units, get) => { const scale = TC.scale(steps.map(get), units); columns.push({ minor: minor.includes(name), title: TC.titled(title, scale), csv: name + (units !== "1" ? ` [${units}]` : ""), get, text: (i) => TC.number(get(i) / scale.by, minor.includes(name) && name !== "energy" ? 3 : 5) }); };
    for (const o of h.loads) add(o.symbol, o.name, o.units, (i) => o.v[i]);
    for (const o of h.numbers) add(TC.symbol(o.name), o.name, o.units, (i) => o.v[p * h.steps + i]);
    columns.push({ title: "proved", left: true, get: (i) => TC.history.proof(p, i), text: (i) => TC.history.proof(p, i) });
    const t = TC.table({ columns, rows: steps, ...TC.sorting("ssort", "sdown"), chosen: (i) => i === s.step, pick: (step) => TC.set({ step }) });
    const csv = () => TC.saveTable(`${TC.fileName()}-steps${TC.data.run.points > 1 ? `-${p}` : ""}.csv`, columns, t.order);
    const top = host.querySelector(".scroll")?.scrollTop || 0, box = TC.el("div", { class: "scroll" }, t.node);
    TC.fill(host, TC.el("div", { class: "controls noprint" }, TC.el("button", { onclick: csv, "aria-label": "steps csv" }, "Download as CSV"), TC.el("span", { class: "note" }, "all steps of this history; a click on a row shows the step")), box);
    box.scrollTop = top;
  },
};
