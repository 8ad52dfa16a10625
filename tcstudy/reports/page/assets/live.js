// The live mode: one point of the sweep to start from, sliders for its load and its law, solved here at every move as long as
// ω < λ₁ proves that there is one solution, so that no other state than the file's can appear.
TC.live = {
  setup() {
    const L = TC.data.live;
    if (!L || L.m) return;
    const m = (L.m = L.c.length), full = new Float64Array(m * m);
    for (let i = 0, k = 0; i < m; i++) for (let j = 0; j <= i; j++, k++) full[i * m + j] = full[j * m + i] = L.A[k];
    L.A = full;
    L.line = TC.data.lines[String(L.level)];
    L.lambda = {};
  },
  // Why a point cannot be solved here; empty if it can.
  refused(p) {
    const law = TC.data.laws.laws[TC.data.laws.index[p]], L = TC.data.live;
    if (L.valid[p] !== 1 || !law || !law.spec) return "Its elastic ratio or its law are not of the kind that travels in the page.";
    if (TC.run.proof(p, L.level) !== "unique") return `What is known of it: ${TC.data.proofs[TC.run.proof(p, L.level)]}. Only problems with one solution are solved here; the stored results show its state.`;
    return "";
  },
  // λ₁ of the body of point p: its value and a proved lower bound.
  lambda(p) {
    const L = TC.data.live, by = L.stiffness[p];
    return L.lambda[by] || (L.lambda[by] = TC.lambda1(TC.live.stiffness(p), L.c));
  },
  stiffness(p) { const L = TC.data.live, by = L.stiffness[p]; return by === 1 ? L.A : L.A.map((x) => x * by); },
  // What the sliders move: {factor, law}.
  base(p) {
    return { factor: 1, law: JSON.parse(JSON.stringify(TC.data.laws.laws[TC.data.laws.index[p]].spec)) };
  },
  // The problem of a point with its mechanical load times a factor and a law of its own.
  problem(p, set) {
    const L = TC.data.live, [whole, own] = [L.load, L.mechanical_load].map((all) => all.subarray(p * L.m, (p + 1) * L.m));
    return new TC.Problem(TC.live.stiffness(p), Float64Array.from(whole, (x, i) => x + (set.factor - 1) * own[i]), L.c, TC.lawOf(set.law));
  },
  unique: (p, law) => law.omega < TC.live.lambda(p).proved,
  draw() {
    TC.live.setup();
    const s = TC.state, main = document.getElementById("main");
    if (!TC.live.host) {
      const head = TC.el("div", { class: "live" }), controls = TC.el("div"), left = TC.panel(), right = TC.panel();
      main.replaceChildren(TC.el("h2", {}, "Explore live"), head, controls, TC.el("div", { class: "columns wide" }, left, right));
      head.append(TC.el("p", {}, TC.el("b", {}, "Solved now, in this browser"), `, not stored results: mesh level ${TC.data.live.level} with ${TC.data.live.m} contact nodes, where the law falls less steeply than the body is stiff (ω < λ₁), so that there is one solution, and nowhere else. It is accepted by its inclusion residual, which stands beside it.`));
      TC.live.host = { controls, left, right };
      TC.live.point = null;
    }
    const p = TC.run.flat(s.at);
    if (TC.live.point !== p) { TC.live.point = p; TC.live.set = TC.live.refused(p) ? null : TC.live.restore(p); TC.live.controls(p); }
    TC.live.show(p);
  },
  // Settings from the address, if they are of this point.
  restore(p) {
    const set = TC.live.base(p), s = TC.state, given = s.set || TC.readState().set;
    if (!given || TC.live.restored) return set;
    TC.live.restored = true;
    try { const back = JSON.parse(given); if (back.law && TC.lawOf(back.law)) return { ...set, ...back }; } catch { /* an address written by hand */ }
    return set;
  },
  controls(p) {
    const r = TC.data.run, s = TC.state, L = TC.data.live, host = TC.live.host.controls, picks = TC.el("div", { class: "controls" });
    if (r.grid) for (const a of r.varied) { const d = TC.run.dim(a.name); picks.append(TC.choice(`start from ${TC.symbol(a.name)}`, a.values.map((_, i) => [i, TC.axisText(a, i)]), s.at[d], (v) => { const at = s.at.slice(); at[d] = Number(v); TC.set({ at, set: null }); })); }
    else if (r.points > 1) picks.append(TC.slider("start from point", [...Array(r.points)].map((_, k) => `${k + 1}`), s.at[0], (i) => TC.set({ at: [i], set: null })));
    picks.append(TC.el("button", { "aria-label": "reset", onclick: () => { TC.live.point = null; TC.set({ set: null }); } }, "reset sliders"));
    const sliders = TC.el("div", { class: "sliders" });
    TC.fill(host, picks, sliders);
    if (!TC.live.set) { sliders.append(TC.el("p", { class: "bad" }, `This point is not solved here. ${TC.live.refused(p)}`)); return; }
    const set = TC.live.set, units = TC.data.unit_system === "none" ? () => "1" : (u) => u;
    if (L.mechanical_load.subarray(p * L.m, (p + 1) * L.m).some((x) => x !== 0)) sliders.append(TC.live.slider("load factor", "1", -2, 3, false, () => set.factor, (v) => { set.factor = v; }));
    TC.live.lawSliders(p, sliders, units);
  },
  lawSliders(p, host, units) {
    const set = TC.live.set, base = TC.live.base(p).law.law === set.law.law ? TC.live.base(p).law : set.law, kind = { delta: "m", k: "Pa m-1", slope: "Pa m-1" };
    for (const key of Object.keys(set.law).filter((k) => k !== "law" && k !== "points")) {
      if (key === "teeth") { host.append(TC.live.slider("teeth", "1", 1, 8, false, () => set.law.teeth, (v) => { set.law.teeth = v; }, 1)); continue; }
      if (key === "drop" || key === "decay") { host.append(TC.live.slider(key, "1", 0.05, 1, false, () => set.law[key], (v) => { set.law[key] = v; })); continue; }
      const unit = units(kind[key] || "Pa"), v = base[key];
      if (v > 0) host.append(TC.live.slider(TC.symbol(key), unit, v / 8, v * 8, true, () => set.law[key], (x) => { set.law[key] = x; }));
      else if (key !== "slope") host.append(TC.live.slider(TC.symbol(key), unit, 0, Math.max(...Object.values(base).filter((x) => typeof x === "number")) || 1, false, () => set.law[key], (x) => { set.law[key] = x; }));
    }
  },
  slider(label, units, lo, hi, log, get, put, step) {
    const n = 400, to = (v) => (log ? (Math.log(v / lo) / Math.log(hi / lo)) * n : ((v - lo) / (hi - lo)) * n), from = (x) => { const v = log ? lo * (hi / lo) ** (x / n) : lo + ((hi - lo) * x) / n; return step ? Math.round(v) : v; };
    const out = TC.el("output", {}, TC.quantity(get(), units)), range = TC.el("input", { type: "range", min: 0, max: n, step: "any", "aria-label": label });
    range.value = to(get());
    range.addEventListener("input", () => { put(from(Number(range.value))); out.textContent = TC.quantity(get(), units); TC.live.moved(); });
    return TC.el("label", { class: "slider" }, TC.el("span", {}, `${label}: `, out), range);
  },
  moved() {
    if (TC.live.waiting) return;
    TC.live.waiting = true;
    requestAnimationFrame(() => { TC.live.waiting = false; TC.state.set = JSON.stringify(TC.live.set); TC.writeState(); TC.live.show(TC.live.point); });
  },
  show(p) {
    const { left, right } = TC.live.host, set = TC.live.set, L = TC.data.live;
    TC.live.answer = null;
    TC.fill(left);
    TC.fill(right);
    if (!set) return;
    let problem, drawn;
    try { problem = TC.live.problem(p, set); drawn = problem.law.drawn(); } catch (error) { TC.fill(right, TC.el("p", { class: "bad" }, String(error.message || error))); return; }
    const units = TC.data.unit_system === "none" ? "1" : "Pa m-1", omega = problem.law.omega, line = L.line, lambda = TC.live.lambda(p), stored = TC.live.same(p) ? TC.point.contact(line, p) : null;
    const numbers = `λ₁ = ${TC.quantity(lambda.value, units)}, ω = ${omega === Infinity ? "∞" : TC.quantity(omega, units)}`;
    if (!TC.live.unique(p, problem.law)) {
      TC.fill(right, TC.el("p", {}, TC.el("span", { class: "badge" }, "not solved here: ω is not below λ₁")), TC.note(`${numbers}; soften the fall of the law, or look at the stored results`), TC.live.lawPanel(TC.width(right), drawn, [], line));
      return;
    }
    const begun = performance.now(), answer = TC.solve(problem), time = performance.now() - begun;
    if (!answer.converged) { TC.fill(right, TC.el("p", {}, TC.el("span", { class: "badge bad" }, "no solution found"), ` residual ${TC.number(answer.residual, 2)}`), TC.note(numbers)); return; }
    TC.live.answer = answer;
    const one = { line, u: answer.v, xi: answer.xi.map((x, i) => x / L.c[i]), state: answer.rests.map((rests) => (rests ? 0 : 1)), held: TC.point.contact(line, p).held }, cases = stored ? [one, stored] : [one];
    TC.point.profiles(left, line, cases, { ...TC.point.frame(line, TC.width(left)), shape: false }, stored ? "dashed: the stored solution of this point" : "");
    TC.fill(right, TC.el("p", {}, TC.el("span", { class: "badge good" }, "only solution (ω < λ₁)"), ` residual ${TC.number(answer.residual, 2)}, ${TC.number(time, 2)} ms`),
      TC.note(`${numbers}; largest |u_T| = ${TC.quantity(Math.max(...answer.v.map(Math.abs)), line.u_T_units)}, energy ${TC.quantity(answer.energy, TC.data.run.numbers.energy ? TC.data.run.numbers.energy.units : "1", 6)}`), TC.live.lawPanel(TC.width(right), drawn, cases, line));
  },
  // Whether the sliders stand where the stored point was solved.
  same: (p) => JSON.stringify(TC.live.base(p)) === JSON.stringify(TC.live.set),
  lawPanel(width, drawn, cases, line) {
    const set = TC.live.set, host = TC.el("div"), { plot, us, ys } = TC.point.lawPlot(width, drawn, cases.slice(0, 1), line, TC.live.frozen || {});
    host.append(TC.h3("The law, and where every node stands"), plot.svg);
    if (set.law.points) {
      host.append(TC.legend("drag the squares to change the law"));
      set.law.points.forEach((point, k) => {
        const x = plot.px(point[0] / us.by), y = plot.py(point[1] / ys.by), handle = TC.svgNode("rect", { x: x - 7, y: y - 7, width: 14, height: 14, fill: "var(--bg)", stroke: "var(--accent)", "stroke-width": 2.5, style: "cursor:grab;touch-action:none", "data-handle": k });
        handle.addEventListener("pointerdown", (e) => { e.preventDefault(); TC.live.drag(k, plot, us, ys); });
        plot.over.append(handle);
      });
    } else host.append(TC.el("button", { "aria-label": "points", onclick: () => TC.live.toPoints(drawn) }, "turn into points that can be dragged"));
    return host;
  },
  // Dragging: the axes stay as they are until the pointer is let go.
  drag(k, plot, us, ys) {
    const points = TC.live.set.law.points, n = points.length, svgOf = () => TC.live.host.right.querySelector("svg[aria-label^='friction law']");
    TC.live.frozen = { xrange: plot.x, yrange: plot.y };
    const move = (e) => {
      const box = svgOf().getBoundingClientRect(), lo = k > 0 ? points[k - 1][0] : 0, hi = k < n - 1 ? points[k + 1][0] : Infinity;
      points[k][1] = Math.max(0, plot.iy(e.clientY - box.top) * ys.by);
      if (k > 0) points[k][0] = Math.min(hi, Math.max(lo, plot.ix(e.clientX - box.left) * us.by));
      if (points.some((q, i) => i > 1 && q[0] === points[i - 2][0])) points[k][0] = k < n - 1 ? 0.5 * (lo + hi) : lo + 1e-3 * plot.x[1] * us.by;
      TC.live.moved();
    };
    const end = () => { window.removeEventListener("pointermove", move); TC.live.frozen = null; TC.live.moved(); };
    window.addEventListener("pointermove", move);
    window.addEventListener("pointerup", end, { once: true });
  },
  // Any odd law as points: exact for straight pieces, 12 points for a curved one.
  toPoints(drawn) {
    const points = [];
    for (const [s, b] of drawn.curves) {
      if (s[s.length - 1] <= 0 || s[0] < 0) continue;
      const every = s.length > 2 ? Math.ceil(s.length / 12) : 1;
      s.forEach((x, i) => { if (i % every === 0 || i === s.length - 1) { const last = points[points.length - 1]; if (!last || last[0] !== x || last[1] !== b[i]) points.push([x, b[i]]); } });
    }
    const reach = (TC.live.answer && Math.max(...TC.live.answer.v.map(Math.abs))) || 1e-3;
    if (drawn.name === "linear") { const k = TC.live.set.law.k; points.splice(0, points.length, [0, 0], [2 * reach, 2 * reach * k]); }
    if (!points.length) return;
    if (!(drawn.reach > 0) && drawn.name !== "linear") points.forEach((q, i) => { q[0] = i ? 2 * reach : 0; });
    const n = points.length, slope = n > 1 && points[n - 1][0] > points[n - 2][0] ? Math.max(0, (points[n - 1][1] - points[n - 2][1]) / (points[n - 1][0] - points[n - 2][0])) : 0;
    if (n > 2 && slope === 0 && points[n - 1][1] === points[n - 2][1]) points.pop();
    TC.live.set.law = { law: "piecewise-linear", points, slope: drawn.name === "linear" ? slope : 0 };
    TC.live.controls(TC.live.point);
    TC.live.moved();
  },
};
