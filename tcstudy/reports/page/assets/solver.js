// The globalised separable Newton method of tcstudy/contact/separable_newton.py in plain JavaScript, from one start:
// rest on up-jumps, Newton on the pieces of all other nodes along a path that stops at up-jumps, Armijo's rule, node by
// node where that fails, a last refinement, escape along negative curvature. Left out: coarse copies of large problems.
TC.Problem = class {
  // A: Float64Array of m×m by rows; load, c: Float64Array of m; law: TC.Law.
  constructor(A, load, c, law) {
    Object.assign(this, { A, load, c, law, m: c.length });
    let most = 0;
    for (let i = 0; i < this.m; i++) most = Math.max(most, Math.abs(load[i] / c[i]));
    this.scale = law.scale > 0 ? law.scale : Math.max(most, Math.abs(law.b(0, 1)));
  }
  times(v) {
    const { A, m } = this, out = new Float64Array(m);
    for (let i = 0; i < m; i++) { let t = 0; const row = i * m; for (let j = 0; j < m; j++) t += A[row + j] * v[j]; out[i] = t; }
    return out;
  }
  xi(v) { const out = this.times(v); for (let i = 0; i < this.m; i++) out[i] = this.load[i] - out[i]; return out; }
  relative(force) { let w = 0; for (let i = 0; i < this.m; i++) w = Math.max(w, Math.abs(force[i]) / this.c[i]); return w === 0 ? 0 : this.scale > 0 ? w / this.scale : Infinity; }
  // max dist(ξ_i/c_i, b̂(v_i)) over the scale of b: what makes a solution.
  residual(v) {
    const xi = this.xi(v);
    let worst = 0;
    for (let i = 0; i < this.m; i++) {
      const t = xi[i] / this.c[i], l = this.law.b(v[i], -1), r = this.law.b(v[i], 1);
      worst = Math.max(worst, Math.min(l, r) - t, t - Math.max(l, r));
    }
    return worst === 0 ? 0 : this.scale > 0 ? worst / this.scale : Infinity;
  }
  change(state, step, As) {
    let t = 0;
    for (let i = 0; i < this.m; i++) t += this.c[i] * this.law.integral(state.v[i], state.v[i] + step[i]) - state.xi[i] * step[i] + 0.5 * step[i] * As[i];
    return t;
  }
};

// Lower Cholesky factor of the n×n matrix M by rows, in place; returns 0 or the number of the pivot that failed.
TC.cholesky = function (M, n) {
  for (let j = 0; j < n; j++) {
    const rj = j * n;
    for (let k = 0; k < j; k++) {
      const rk = k * n;
      let t = M[rj + k];
      for (let p = 0; p < k; p++) t -= M[rj + p] * M[rk + p];
      M[rj + k] = t / M[rk + k];
    }
    let d = M[rj + j];
    for (let p = 0; p < j; p++) d -= M[rj + p] * M[rj + p];
    if (!(d > 0)) return j + 1;
    M[rj + j] = Math.sqrt(d);
  }
  return 0;
};
TC.backsolve = function (L, n, rhs, size = n) {
  const x = Float64Array.from(rhs);
  for (let i = 0; i < size; i++) { let t = x[i]; for (let p = 0; p < i; p++) t -= L[i * n + p] * x[p]; x[i] = t / L[i * n + i]; }
  for (let i = size - 1; i >= 0; i--) { let t = x[i]; for (let p = i + 1; p < size; p++) t -= L[p * n + i] * x[p]; x[i] = t / L[i * n + i]; }
  return x;
};

TC.newton = (function () {
  const EPS = 2 ** -52;

  function state(problem, v, how = "start") {
    const { m, c, law, A, load } = problem, xi = problem.xi(v), left = new Float64Array(m), right = new Float64Array(m), descent = new Float64Array(m), jump = new Uint8Array(m), piece = new Int32Array(m), rounding = new Float64Array(m);
    let f = 0, rest = 0;
    for (let i = 0; i < m; i++) {
      left[i] = c[i] * law.b(v[i], -1) - xi[i];
      right[i] = c[i] * law.b(v[i], 1) - xi[i];
      jump[i] = law.onJump(v[i]) ? 1 : 0;
      const up = Math.max(-right[i], 0), down = Math.max(left[i], 0);
      descent[i] = jump[i] ? (up >= down ? (up === 0 ? 0 : -up) : down) : right[i];
      piece[i] = law.piece(v[i], descent[i] <= 0 ? 1 : -1);
      rounding[i] = EPS * (A[i * m + i] * Math.abs(v[i]) + Math.abs(load[i]) + Math.abs(xi[i]));
      f += -0.5 * v[i] * (xi[i] + load[i]) + c[i] * law.integral(0, v[i]);
      if (jump[i] && descent[i] === 0) rest++;
    }
    const s = { v, xi, left, right, descent, jump, piece, f, how, residual: problem.relative(descent), noise: problem.relative(rounding), second: rest === m ? "every node rests" : null, stopped: null };
    s.atRounding = s.residual <= 64 * s.noise;
    s.resting = (i) => jump[i] === 1 && descent[i] === 0;
    return s;
  }

  // Factor of A_FF + C q_F, falls of b lifted where that is indefinite.
  function factorise(problem, free, slope) {
    const { A, m, c } = problem, n = free.length;
    let curvature = null;
    for (const lifted of [false, true]) {
      const q = slope.map((x) => (lifted ? Math.max(x, 0) : x)), shifted = free.map((i, k) => A[i * m + i] + c[i] * q[k]);
      if (shifted.every((d) => d > 0)) {
        const M = new Float64Array(n * n);
        for (let i = 0; i < n; i++) { for (let j = 0; j < i; j++) M[i * n + j] = A[free[i] * m + free[j]]; M[i * n + i] = shifted[i]; }
        const failed = TC.cholesky(M, n);
        if (failed === 0) return { free, n, L: M, curvature };
        if (!curvature) {
          curvature = new Float64Array(n);
          const k = failed - 1;
          curvature[k] = 1;
          if (k) { const row = free.slice(0, k).map((j) => A[free[k] * m + j]), x = TC.backsolve(M, n, row, k); for (let p = 0; p < k; p++) curvature[p] = -x[p]; }
        }
      } else if (!curvature) {
        let worst = 0;
        for (let k = 1; k < n; k++) if (shifted[k] / A[free[k] * m + free[k]] < shifted[worst] / A[free[worst] * m + free[worst]]) worst = k;
        curvature = new Float64Array(n);
        curvature[worst] = 1;
      }
    }
    return null;
  }
  const spread = (problem, free, values) => { const d = new Float64Array(problem.m); free.forEach((i, k) => { d[i] = values[k]; }); return d; };
  const newtonStep = (problem, s, system) => { const x = TC.backsolve(system.L, system.n, system.free.map((i) => s.descent[i])); return spread(problem, system.free, x.map((t) => -t)); };

  function alongPath(problem, s, system, armijo, halvings) {
    const { m, law } = problem, d = newtonStep(problem, s, system), stop = new Float64Array(m), slope = new Float64Array(m);
    for (let i = 0; i < m; i++) {
      const uphill = (d[i] > 0 ? s.right[i] : -s.left[i]) > 0;
      if (s.jump[i] && uphill) d[i] = 0;
      stop[i] = law.nextUp(s.v[i], d[i]);
      slope[i] = d[i] > 0 ? s.right[i] : s.left[i];
    }
    for (let h = 0; h <= halvings; h++) {
      const target = new Float64Array(m), step = new Float64Array(m);
      let first = 0;
      for (let i = 0; i < m; i++) {
        target[i] = s.v[i] + 0.5 ** h * d[i];
        if (d[i] !== 0 && (d[i] > 0 ? target[i] >= stop[i] : target[i] <= stop[i])) target[i] = stop[i];
        step[i] = target[i] - s.v[i];
        first += slope[i] * step[i];
      }
      const change = problem.change(s, step, problem.times(step));
      if (change < 0 && change <= -armijo * Math.abs(first)) {
        const next = state(problem, target, "newton");
        let same = system.curvature === null;
        for (let i = 0; same && i < m; i++) same = next.resting(i) === s.resting(i) && next.piece[i] === s.piece[i];
        if (same) next.second = "a local minimum";
        return next;
      }
    }
    return null;
  }

  function straight(problem, s, halvings) {
    const { m, law } = problem;
    let free = [...Array(m).keys()].filter((i) => !s.resting(i)), d = new Float64Array(m);
    while (free.length) {
      const system = factorise(problem, free, free.map((i) => law.slope(s.v[i], s.piece[i])));
      if (!system) return null;
      d = newtonStep(problem, s, system);
      const held = free.filter((i) => s.jump[i] && d[i] !== 0 && (d[i] > 0 ? s.right[i] : -s.left[i]) > 0);
      if (!held.length) break;
      free = free.filter((i) => !held.includes(i));
      if (!free.length) d = new Float64Array(m);
    }
    const stop = d.map((x, i) => law.nextUp(s.v[i], x)), reach = d.map((x, i) => (x !== 0 ? (stop[i] - s.v[i]) / x : Infinity));
    const lengths = [...new Set([...reach.filter((x) => x < 1), ...[...Array(halvings + 1)].map((_, h) => 0.5 ** h)])];
    let best = null, least = 0;
    for (const length of lengths) {
      const target = s.v.map((x, i) => (reach[i] === length ? stop[i] : x + length * d[i])), step = target.map((x, i) => x - s.v[i]), change = problem.change(s, step, problem.times(step));
      if (change < least) { least = change; best = target; }
    }
    return best ? state(problem, best, "straight") : null;
  }

  // First resting place of one node downhill from where it is, the others held.
  function descendNode(law, s0, traction, stiffness) {
    const slope = (s, k) => law.value(s, k) + stiffness * (s - s0) - traction;
    const left = slope(s0, law.piece(s0, -1)), right = slope(s0, law.piece(s0, 1));
    if (Math.max(-right, left) <= 0) return s0;
    const sign = -right >= left ? 1 : -1;
    let k = law.piece(s0, sign), s = s0;
    for (;;) {
      const end = sign > 0 ? (k < law.kinks.length ? law.kinks[k] : Infinity) : k > 0 ? law.kinks[k - 1] : -Infinity, far = Number.isFinite(end) ? law.slope(end, k) : law.q[k];
      for (let i = 0; i < (law.a[k] === 0 ? 1 : 8); i++) {
        const bound = stiffness + Math.max(law.slope(s, k), far), downhill = -sign * slope(s, k);
        if (downhill <= 0) break;
        if (bound <= 0 || Math.abs(end - s) * bound <= downhill) { s = end; break; }
        s += (sign * downhill) / bound;
      }
      if (s !== end || sign * slope(s, k + sign) >= 0) return s;
      k += sign;
    }
  }
  function nodeByNode(problem, s) {
    const { m, A, c, law } = problem, v = Float64Array.from(s.v), xi = Float64Array.from(s.xi), gain = [...Array(m).keys()].filter((i) => s.descent[i] !== 0).sort((i, j) => s.descent[j] ** 2 / A[j * m + j] - s.descent[i] ** 2 / A[i * m + i] || i - j);
    for (const i of gain) {
      const target = descendNode(law, v[i], xi[i] / c[i], A[i * m + i] / c[i]), move = target - v[i];
      if (move !== 0) for (let j = 0; j < m; j++) xi[j] -= A[i * m + j] * move;
      v[i] = target;
    }
    const step = v.map((x, i) => x - s.v[i]);
    if (!(problem.change(s, step, problem.times(step)) < 0)) return { ...s, stopped: "no node can lower the energy although the inclusion does not hold" };
    return state(problem, v, "nodes");
  }
  function refine(problem, s, system, tolerance) {
    let best = s;
    for (let k = 0; k < 8; k++) {
      const d = newtonStep(problem, best, system), next = state(problem, best.v.map((x, i) => x + d[i]), "refined");
      if (!(next.residual < best.residual)) break;
      const slow = next.residual > 0.5 * best.residual;
      best = next;
      if (best.residual <= tolerance || slow) break;
    }
    if (best.residual > tolerance) return { ...best, stopped: "the residual stays at rounding level above the tolerance" };
    return { ...best, second: system.curvature === null ? "a local minimum" : best.second };
  }
  function escape(problem, s, system) {
    if (system.curvature === null) return { ...s, second: "a local minimum" };
    const { m, law } = problem, d = spread(problem, system.free, system.curvature);
    let first = 0, length = Infinity;
    for (let i = 0; i < m; i++) first += (d[i] > 0 ? s.right[i] : s.left[i]) * d[i];
    if (first > 0) for (let i = 0; i < m; i++) d[i] = -d[i];
    const ends = [-Infinity, ...law.kinks, Infinity];
    for (let i = 0; i < m; i++) if (d[i] !== 0) { const reach = ((d[i] > 0 ? ends[s.piece[i] + 1] : ends[s.piece[i]]) - s.v[i]) / d[i]; if (reach > 0) length = Math.min(length, reach); }
    if (Number.isFinite(length)) for (const shorter of [1, 0.25, 0.05]) {
      const step = d.map((x) => shorter * length * x), change = problem.change(s, step, problem.times(step));
      let size = 0;
      for (let i = 0; i < m; i++) size += Math.abs(s.xi[i] * step[i]);
      if (change < -64 * EPS * size) return state(problem, s.v.map((x, i) => x + step[i]), "escape");
    }
    return { ...s, second: "undecided" };
  }

  // {v, residual, energy, converged, minimum, reason, iterations}; minimum: the second-order test was passed.
  return function (problem, start, { tolerance = 1e-12, most = 300, armijo = 1e-4, halvings = 4 } = {}) {
    const { m, law } = problem;
    let s = state(problem, Float64Array.from(start)), iteration = 0, reason = "no solution within the iterations";
    for (; iteration <= most; iteration++) {
      if (!Number.isFinite(s.f)) { reason = "the energy is not a finite number"; break; }
      if (s.residual <= tolerance && s.second !== null) { reason = s.second; break; }
      if (s.stopped) { reason = s.stopped; break; }
      const free = [...Array(m).keys()].filter((i) => !s.resting(i)), system = factorise(problem, free, free.map((i) => law.slope(s.v[i], s.piece[i])));
      if (!system) { reason = "the condensed stiffness is not positive definite"; break; }
      if (s.residual <= tolerance) { s = escape(problem, s, system); continue; }
      let moved = alongPath(problem, s, system, armijo, halvings);
      if (moved && !(moved.atRounding && moved.residual > tolerance)) { s = moved; continue; }
      if (moved && moved.second !== null) { s = refine(problem, moved, system, tolerance); continue; }
      if (s.atRounding) { s = refine(problem, s, system, tolerance); continue; }
      if (!moved && (s.how === "nodes" || s.how === "straight")) moved = straight(problem, s, halvings);
      s = moved || nodeByNode(problem, s);
    }
    const residual = problem.residual(s.v);
    return { v: s.v, xi: s.xi, residual, energy: s.f, converged: residual <= 1e-10 && s.second !== null, minimum: s.second !== null && s.second !== "undecided", reason, iterations: iteration, rests: [...Array(m).keys()].map((i) => s.resting(i)) };
  };
})();

// Smallest eigenvalue of C^-½ A C^-½ by inverse iteration; `proved` is a lower bound that a factorisation confirms.
TC.lambda1 = function (A, c) {
  const m = c.length, S = new Float64Array(m * m), root = c.map((x) => 1 / Math.sqrt(x));
  for (let i = 0; i < m; i++) for (let j = 0; j < m; j++) S[i * m + j] = A[i * m + j] * root[i] * root[j];
  const L = Float64Array.from(S);
  if (TC.cholesky(L, m)) return { value: NaN, proved: 0 };
  let v = new Float64Array(m).fill(1 / Math.sqrt(m)), value = 0;
  for (let k = 0; k < 300; k++) {
    const w = TC.backsolve(L, m, v), size = Math.hypot(...w), before = value;
    v = w.map((x) => x / size);
    value = 1 / size;
    if (Math.abs(value - before) <= 1e-12 * value) break;
  }
  // S − (bound + rounding of a factorisation) I has a factor, so that no eigenvalue lies below the bound
  let trace = 0;
  for (let i = 0; i < m; i++) trace += S[i * m + i];
  const rounding = 4 * m * 2 ** -52 * trace;
  for (const margin of [1e-6, 1e-3, 0.1]) {
    const bound = value * (1 - margin) - rounding, M = Float64Array.from(S);
    for (let i = 0; i < m; i++) M[i * m + i] -= bound + rounding;
    if (bound > 0 && !TC.cholesky(M, m)) return { value, proved: bound };
  }
  return { value, proved: 0 };
};

// The load of a point, its mechanical part times a factor.
TC.liveLoad = function (live, p, { factor = 1 }) {
  const m = live.c.length, [whole, own] = [live.load, live.mechanical_load].map((all) => all.subarray(p * m, (p + 1) * m));
  return Float64Array.from(whole, (x, i) => (factor === 1 ? x : x + (factor - 1) * own[i]));
};
TC.liveStiffness = function (live, p) { const by = live.stiffness[p]; return by === 1 ? live.A : live.A.map((x) => x * by); };

// All local minima that the starts lead to, lowest first.
TC.solveAll = function (problem, starts) {
  const found = [];
  for (const [name, v0] of starts) {
    const answer = TC.newton(problem, v0);
    const size = Math.max(...answer.v.map(Math.abs)) || 1;
    const known = found.find((o) => o.answer.converged === answer.converged && Math.max(...o.answer.v.map((x, i) => Math.abs(x - answer.v[i]))) <= 1e-8 * size);
    if (known) known.names.push(name);
    else found.push({ names: [name], answer });
  }
  return found.sort((a, b) => (b.answer.converged - a.answer.converged) || a.answer.energy - b.answer.energy);
};
TC.frictionless = function (problem) { const L = Float64Array.from(problem.A); return TC.cholesky(L, problem.m) ? new Float64Array(problem.m) : TC.backsolve(L, problem.m, problem.load); };
