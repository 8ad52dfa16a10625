// The live mode: a point of the sweep, with sliders for its loads, the strength of its friction and
// the slip over which friction changes. It is solved here at every move of a slider, as long as
// ω < λ₁ proves that there is one solution: no other state than that of the file can appear.
TC.live = {
  SLIDERS: {
    load: ["loads ×", -2, 3, false],
    strength: ["friction ×", 0.125, 8, true],
    slip: ["slip of the law ×", 0.125, 8, true],
  },
  setup() {
    const live = TC.data.live;
    if (!live || live.m) return;
    const nodeCount = (live.m = live.c.length);
    const matrix = new Float64Array(nodeCount * nodeCount);
    for (let row = 0, entry = 0; row < nodeCount; row++)
      for (let column = 0; column <= row; column++, entry++)
        matrix[row * nodeCount + column] = matrix[column * nodeCount + row] = live.A[entry];
    Object.assign(live, { A: matrix, line: TC.data.lines[String(live.level)] });
  },
  law: (point) => TC.data.laws.laws[TC.data.laws.index[point]],
  // Why a point cannot be solved here; empty if it can.
  whyNotSolved(point) {
    const law = TC.live.law(point);
    const live = TC.data.live;
    if (live.valid[point] !== 1 || !law)
      return (
        "Its elastic ratio is not that of the matrix in the page, " +
        "or friction differs along the line."
      );
    if (TC.run.proof(point, live.level) !== "unique")
      return (
        `What is known of it: ${TC.data.proofs[TC.run.proof(point, live.level)]}. ` +
        "Only problems with one solution are solved here; the stored results show its state."
      );
    return "";
  },
  stiffness(point) {
    const live = TC.data.live;
    const ratio = live.stiffness[point];
    return ratio === 1 ? live.A : live.A.map((entry) => entry * ratio);
  },
  unchanged: () => ({ load: 1, strength: 1, slip: 1 }),
  // The problem of a point with its mechanical load and its law scaled.
  problem(point, settings) {
    const live = TC.data.live;
    const [totalLoad, mechanicalLoad] = [live.load, live.mechanical_load].map((loads) =>
      loads.subarray(point * live.m, (point + 1) * live.m),
    );
    return new TC.Problem(
      TC.live.stiffness(point),
      Float64Array.from(
        totalLoad,
        (value, node) => value + (settings.load - 1) * mechanicalLoad[node],
      ),
      live.c,
      new TC.Law(TC.live.law(point).pieces, settings.strength, settings.slip),
    );
  },
  omega: (point, settings) =>
    Number.isFinite(TC.live.law(point).omega)
      ? (TC.live.law(point).omega * settings.strength) / settings.slip
      : Infinity,
  unique: (point, settings) => TC.live.omega(point, settings) < TC.data.live.proved[point],
  draw() {
    TC.live.setup();
    const state = TC.state;
    const main = document.getElementById("main");
    const point = TC.run.pointAt(state.at);
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
          `, not stored results: mesh level ${TC.data.live.level} with ${TC.data.live.m} contact ` +
            "nodes, where the law softens less than the body is stiff (ω < λ₁), so that " +
            "there is one solution, and nowhere else. It is accepted by its inclusion residual, " +
            "which stands beside it.",
        ),
      );
      TC.live.host = { controls, left, right };
      TC.live.point = null;
    }
    if (TC.live.point !== point) {
      TC.live.point = point;
      TC.live.set = TC.live.whyNotSolved(point) ? null : TC.live.restore();
      TC.live.controls(point);
    }
    TC.live.show(point);
  },
  // Settings from the address.
  restore() {
    const settings = String(TC.state.set || TC.readState().set || "")
      .split(",")
      .map(Number);
    return settings.length === 3 &&
      settings.every((value, k) => Number.isFinite(value) && (k === 0 || value > 0))
      ? { load: settings[0], strength: settings[1], slip: settings[2] }
      : TC.live.unchanged();
  },
  controls(point) {
    const run = TC.data.run;
    const state = TC.state;
    const live = TC.data.live;
    const choices = TC.el("div", { class: "controls" });
    const sliders = TC.el("div", { class: "sliders" });
    if (run.grid)
      for (const axis of run.varied) {
        const dimension = TC.run.dimensionOf(axis.name);
        choices.append(
          TC.choice(
            `start from ${TC.symbol(axis.name)}`,
            axis.values.map((_, index) => [index, TC.axisText(axis, index)]),
            state.at[dimension],
            (value) => {
              const at = state.at.slice();
              at[dimension] = Number(value);
              TC.set({ at, set: null });
            },
          ),
        );
      }
    else if (run.points > 1)
      choices.append(
        TC.slider(
          "start from point",
          { length: run.points, at: (index) => `${index + 1}` },
          state.at[0],
          (index) => TC.set({ at: [index], set: null }),
        ),
      );
    choices.append(
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
    TC.fill(TC.live.host.controls, choices, sliders);
    if (!TC.live.set) {
      sliders.append(
        TC.el(
          "p",
          { class: "bad" },
          `This point is not solved here. ${TC.live.whyNotSolved(point)}`,
        ),
      );
      return;
    }
    const loaded = live.mechanical_load
      .subarray(point * live.m, (point + 1) * live.m)
      .some((value) => value !== 0);
    for (const [key, slider] of Object.entries(TC.live.SLIDERS))
      if (key !== "load" || loaded) sliders.append(TC.live.slider(key, ...slider));
  },
  slider(key, label, low, high, isLogarithmic) {
    const settings = TC.live.set;
    const steps = 400;
    const position = (value) =>
      (isLogarithmic
        ? Math.log(value / low) / Math.log(high / low)
        : (value - low) / (high - low)) * steps;
    const valueAt = (position) =>
      isLogarithmic
        ? low * (high / low) ** (position / steps)
        : low + ((high - low) * position) / steps;
    const output = TC.el("output", {}, TC.number(settings[key], 3));
    const range = TC.el("input", {
      type: "range",
      min: 0,
      max: steps,
      step: "any",
      "aria-label": label,
    });
    range.value = position(settings[key]);
    range.addEventListener("input", () => {
      settings[key] = valueAt(Number(range.value));
      output.textContent = TC.number(settings[key], 3);
      TC.live.scheduleShow();
    });
    return TC.el("label", { class: "slider" }, TC.el("span", {}, `${label} `, output), range);
  },
  scheduleShow() {
    if (TC.live.waiting) return;
    TC.live.waiting = true;
    requestAnimationFrame(() => {
      TC.live.waiting = false;
      TC.state.set = Object.values(TC.live.set).join(",");
      TC.writeState();
      TC.live.show(TC.live.point);
    });
  },
  show(point) {
    const { left, right } = TC.live.host;
    const settings = TC.live.set;
    const live = TC.data.live;
    TC.live.answer = null;
    TC.fill(left);
    TC.fill(right);
    if (!settings) return;
    const units = TC.data.unit_system === "none" ? "1" : "Pa m-1";
    const omega = TC.live.omega(point, settings);
    const line = live.line;
    const lambdaText = TC.quantity(live.lambda_1[point], units);
    const omegaText = omega === Infinity ? "∞" : TC.quantity(omega, units);
    const numberText = `λ₁ = ${lambdaText}, ω = ${omegaText}`;
    const lawPlot = (solutions) =>
      TC.point.lawPlot(
        TC.width(right),
        "The law, and where every node stands",
        TC.live.law(point),
        solutions,
        line,
        settings.strength,
        settings.slip,
      );
    if (!TC.live.unique(point, settings)) {
      TC.fill(
        right,
        TC.el("p", {}, TC.el("span", { class: "badge" }, "not solved here: ω is not below λ₁")),
        TC.note(`${numberText}; use a law that softens less, or look at the stored results`),
        lawPlot([]),
      );
      return;
    }
    const problem = TC.live.problem(point, settings);
    const startTime = performance.now();
    const answer = TC.solve(problem);
    const duration = performance.now() - startTime;
    if (!answer.converged) {
      TC.fill(
        right,
        TC.el(
          "p",
          {},
          TC.el("span", { class: "badge bad" }, "no solution found"),
          ` residual ${TC.number(answer.residual, 2)}`,
        ),
        TC.note(numberText),
      );
      return;
    }
    TC.live.answer = answer;
    const largestSlip = Math.max(...answer.v.map(Math.abs));
    const stored = Object.values(settings).every((value) => value === 1)
      ? TC.point.contact(line, point)
      : null;
    const solution = {
      line,
      u: answer.v,
      xi: answer.xi.map((value, node) => value / live.c[node]),
      state: answer.rests.map((rests) => (rests ? 0 : 1)),
      held: TC.point.contact(line, point).held,
    };
    TC.point.profiles(
      left,
      line,
      stored ? [solution, stored] : [solution],
      { ...TC.point.frame(line, TC.width(left)), shape: false },
      stored ? "dashed: the stored solution of this point" : "",
    );
    TC.fill(
      right,
      TC.el(
        "p",
        {},
        TC.el("span", { class: "badge good" }, "only solution (ω < λ₁)"),
        ` residual ${TC.number(answer.residual, 2)}, ${TC.number(duration, 2)} ms`,
      ),
      TC.note(`${numberText}; largest |u_T| = ${TC.quantity(largestSlip, line.u_T_units)}`),
      lawPlot([solution]),
    );
  },
};
