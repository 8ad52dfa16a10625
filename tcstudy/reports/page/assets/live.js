// The live mode: one point of the sweep to start from, sliders for its loads, the strength of its friction and the slip over
// which friction changes, solved here at every move as long as ω < λ₁ proves that there is one solution, so that no other
// state than the file's can appear.
TC.live = {
  SLIDERS: {
    load: ["loads ×", -2, 3, false],
    strength: ["friction ×", 0.125, 8, true],
    slip: ["slip of the law ×", 0.125, 8, true],
  },
  setup() {
    const L = TC.data.live;
    if (!L || L.m) return;
    const m = (L.m = L.c.length);
    const full = new Float64Array(m * m);
    for (let i = 0, k = 0; i < m; i++)
      for (let j = 0; j <= i; j++, k++) full[i * m + j] = full[j * m + i] = L.A[k];
    Object.assign(L, { A: full, line: TC.data.lines[String(L.level)] });
  },
  law: (p) => TC.data.laws.laws[TC.data.laws.index[p]],
  // Why a point cannot be solved here; empty if it can.
  refused(p) {
    const law = TC.live.law(p);
    const L = TC.data.live;
    if (L.valid[p] !== 1 || !law)
      return "Its elastic ratio is not that of the matrix in the page, or friction differs along the line.";
    if (TC.run.proof(p, L.level) !== "unique")
      return `What is known of it: ${TC.data.proofs[TC.run.proof(p, L.level)]}. Only problems with one solution are solved here; the stored results show its state.`;
    return "";
  },
  stiffness(p) {
    const L = TC.data.live;
    const by = L.stiffness[p];
    return by === 1 ? L.A : L.A.map((x) => x * by);
  },
  base: () => ({ load: 1, strength: 1, slip: 1 }),
  // The problem of a point with its mechanical load and its law scaled.
  problem(p, set) {
    const L = TC.data.live;
    const [whole, own] = [L.load, L.mechanical_load].map((all) =>
      all.subarray(p * L.m, (p + 1) * L.m),
    );
    return new TC.Problem(
      TC.live.stiffness(p),
      Float64Array.from(whole, (x, i) => x + (set.load - 1) * own[i]),
      L.c,
      new TC.Law(TC.live.law(p).pieces, set.strength, set.slip),
    );
  },
  omega: (p, set) =>
    Number.isFinite(TC.live.law(p).omega)
      ? (TC.live.law(p).omega * set.strength) / set.slip
      : Infinity,
  unique: (p, set) => TC.live.omega(p, set) < TC.data.live.proved[p],
  draw() {
    TC.live.setup();
    const s = TC.state;
    const main = document.getElementById("main");
    const p = TC.run.flat(s.at);
    if (!TC.live.host) {
      const head = TC.el("div", { class: "live" });
      const controls = TC.el("div");
      const left = TC.panel();
      const right = TC.panel();
      main.replaceChildren(
        TC.el("h2", {}, "Explore live"),
        head,
        controls,
        TC.el("div", { class: "columns wide" }, left, right),
      );
      head.append(
        TC.el(
          "p",
          {},
          TC.el("b", {}, "Solved now, in this browser"),
          `, not stored results: mesh level ${TC.data.live.level} with ${TC.data.live.m} contact nodes, where the law falls less steeply than the body is stiff (ω < λ₁), so that there is one solution, and nowhere else. It is accepted by its inclusion residual, which stands beside it.`,
        ),
      );
      TC.live.host = { controls, left, right };
      TC.live.point = null;
    }
    if (TC.live.point !== p) {
      TC.live.point = p;
      TC.live.set = TC.live.refused(p) ? null : TC.live.restore();
      TC.live.controls(p);
    }
    TC.live.show(p);
  },
  // Settings from the address.
  restore() {
    const given = String(TC.state.set || TC.readState().set || "")
      .split(",")
      .map(Number);
    return given.length === 3 && given.every((v, k) => Number.isFinite(v) && (k === 0 || v > 0))
      ? { load: given[0], strength: given[1], slip: given[2] }
      : TC.live.base();
  },
  controls(p) {
    const r = TC.data.run;
    const s = TC.state;
    const L = TC.data.live;
    const picks = TC.el("div", { class: "controls" });
    const sliders = TC.el("div", { class: "sliders" });
    if (r.grid)
      for (const a of r.varied) {
        const d = TC.run.dim(a.name);
        picks.append(
          TC.choice(
            `start from ${TC.symbol(a.name)}`,
            a.values.map((_, i) => [i, TC.axisText(a, i)]),
            s.at[d],
            (v) => {
              const at = s.at.slice();
              at[d] = Number(v);
              TC.set({ at, set: null });
            },
          ),
        );
      }
    else if (r.points > 1)
      picks.append(
        TC.slider("start from point", { length: r.points, at: (k) => `${k + 1}` }, s.at[0], (i) =>
          TC.set({ at: [i], set: null }),
        ),
      );
    picks.append(
      TC.el(
        "button",
        {
          "aria-label": "reset",
          onclick: () => {
            TC.live.point = null;
            TC.set({ set: null });
          },
        },
        "reset sliders",
      ),
    );
    TC.fill(TC.live.host.controls, picks, sliders);
    if (!TC.live.set) {
      sliders.append(
        TC.el("p", { class: "bad" }, `This point is not solved here. ${TC.live.refused(p)}`),
      );
      return;
    }
    const loaded = L.mechanical_load.subarray(p * L.m, (p + 1) * L.m).some((x) => x !== 0);
    for (const [key, about] of Object.entries(TC.live.SLIDERS))
      if (key !== "load" || loaded) sliders.append(TC.live.slider(key, ...about));
  },
  slider(key, label, lo, hi, log) {
    const set = TC.live.set;
    const n = 400;
    const to = (v) => (log ? Math.log(v / lo) / Math.log(hi / lo) : (v - lo) / (hi - lo)) * n;
    const from = (x) => (log ? lo * (hi / lo) ** (x / n) : lo + ((hi - lo) * x) / n);
    const out = TC.el("output", {}, TC.number(set[key], 3));
    const range = TC.el("input", {
      type: "range",
      min: 0,
      max: n,
      step: "any",
      "aria-label": label,
    });
    range.value = to(set[key]);
    range.addEventListener("input", () => {
      set[key] = from(Number(range.value));
      out.textContent = TC.number(set[key], 3);
      TC.live.moved();
    });
    return TC.el("label", { class: "slider" }, TC.el("span", {}, `${label} `, out), range);
  },
  moved() {
    if (TC.live.waiting) return;
    TC.live.waiting = true;
    requestAnimationFrame(() => {
      TC.live.waiting = false;
      TC.state.set = Object.values(TC.live.set).join(",");
      TC.writeState();
      TC.live.show(TC.live.point);
    });
  },
  show(p) {
    const { left, right } = TC.live.host;
    const set = TC.live.set;
    const L = TC.data.live;
    TC.live.answer = null;
    TC.fill(left);
    TC.fill(right);
    if (!set) return;
    const units = TC.data.unit_system === "none" ? "1" : "Pa m-1";
    const omega = TC.live.omega(p, set);
    const line = L.line;
    const numbers = `λ₁ = ${TC.quantity(L.lambda_1[p], units)}, ω = ${omega === Infinity ? "∞" : TC.quantity(omega, units)}`;
    const law = (cases) =>
      TC.point.lawPlot(
        TC.width(right),
        "The law, and where every node stands",
        TC.live.law(p),
        cases,
        line,
        set.strength,
        set.slip,
      );
    if (!TC.live.unique(p, set)) {
      TC.fill(
        right,
        TC.el("p", {}, TC.el("span", { class: "badge" }, "not solved here: ω is not below λ₁")),
        TC.note(`${numbers}; soften the fall of the law, or look at the stored results`),
        law([]),
      );
      return;
    }
    const problem = TC.live.problem(p, set);
    const begun = performance.now();
    const answer = TC.solve(problem);
    const time = performance.now() - begun;
    if (!answer.converged) {
      TC.fill(
        right,
        TC.el(
          "p",
          {},
          TC.el("span", { class: "badge bad" }, "no solution found"),
          ` residual ${TC.number(answer.residual, 2)}`,
        ),
        TC.note(numbers),
      );
      return;
    }
    TC.live.answer = answer;
    const stored = Object.values(set).every((v) => v === 1) ? TC.point.contact(line, p) : null;
    const one = {
      line,
      u: answer.v,
      xi: answer.xi.map((x, i) => x / L.c[i]),
      state: answer.rests.map((rests) => (rests ? 0 : 1)),
      held: TC.point.contact(line, p).held,
    };
    TC.point.profiles(
      left,
      line,
      stored ? [one, stored] : [one],
      { ...TC.point.frame(line, TC.width(left)), shape: false },
      stored ? "dashed: the stored solution of this point" : "",
    );
    TC.fill(
      right,
      TC.el(
        "p",
        {},
        TC.el("span", { class: "badge good" }, "only solution (ω < λ₁)"),
        ` residual ${TC.number(answer.residual, 2)}, ${TC.number(time, 2)} ms`,
      ),
      TC.note(
        `${numbers}; largest |u_T| = ${TC.quantity(Math.max(...answer.v.map(Math.abs)), line.u_T_units)}`,
      ),
      law([one]),
    );
  },
};
