// Contact problems with one solution (ω < λ₁), solved in the page: their L̃ is strictly convex, so that whatever descends
// to a point which meets the inclusion has found it.
TC.Problem = class {
  // A: Float64Array of m×m by rows; load, c: Float64Array of m; law: TC.Law.
  constructor(A, load, c, law) {
    Object.assign(this, { A, load, c, law, m: c.length });
    let most = 0;
    for (let i = 0; i < this.m; i++) most = Math.max(most, Math.abs(load[i] / c[i]));
    this.scale = law.scale > 0 ? law.scale : Math.max(most, Math.abs(law.b(0, 1)));
  }
  times(v) {
    const { A, m } = this;
    const out = new Float64Array(m);
    for (let i = 0; i < m; i++) {
      let t = 0;
      const row = i * m;
      for (let j = 0; j < m; j++) t += A[row + j] * v[j];
      out[i] = t;
    }
    return out;
  }
  xi(v) {
    const out = this.times(v);
    for (let i = 0; i < this.m; i++) out[i] = this.load[i] - out[i];
    return out;
  }
};

// Solution of a positive definite system, given by the lower rows of M, which are used up; null if it is none.
TC.positive = function (M, n, rhs) {
  const x = Float64Array.from(rhs);
  for (let k = 0; k < n; k++) {
    const d = M[k * n + k];
    if (!(d > 0)) return null;
    for (let i = k + 1; i < n; i++) {
      const f = M[i * n + k] / d;
      x[i] -= f * x[k];
      for (let j = k + 1; j <= i; j++) M[i * n + j] -= f * M[j * n + k];
    }
  }
  for (let i = n - 1; i >= 0; i--) {
    for (let j = i + 1; j < n; j++) x[i] -= M[j * n + i] * x[j];
    x[i] /= M[i * n + i];
  }
  return x;
};

// {v, xi, residual, converged, iterations, rests}: Newton's method on the pieces that nodes are on, those at rest on an up-jump
// held, along a path that ends for a node at the first up-jump; node by node, which always descends, where that does not help.
TC.solve = function (problem, { tolerance = 1e-12, most = 200 } = {}) {
  const { m, A, c, law } = problem;
  // One-sided derivatives of L̃ by every node, that of them which descends (0: it rests), and the largest distance of ξ from b̂
  // over the scale of b, which makes a solution.
  const state = (v) => {
    const xi = problem.xi(v);
    const left = new Float64Array(m);
    const right = new Float64Array(m);
    const down = new Float64Array(m);
    let worst = 0;
    for (let i = 0; i < m; i++) {
      left[i] = c[i] * law.b(v[i], -1) - xi[i];
      right[i] = c[i] * law.b(v[i], 1) - xi[i];
      down[i] = right[i] < 0 ? right[i] : left[i] > 0 ? left[i] : 0;
      worst = Math.max(worst, Math.abs(down[i]) / c[i]);
    }
    return { v, xi, left, right, down, residual: worst === 0 ? 0 : worst / problem.scale };
  };
  const newton = (s) => {
    const free = [...Array(m).keys()].filter((i) => s.down[i] !== 0 || !law.onJump(s.v[i]));
    const n = free.length;
    const M = new Float64Array(n * n);
    const d = new Float64Array(m);
    free.forEach((i, k) => {
      for (let j = 0; j < k; j++) M[k * n + j] = A[i * m + free[j]];
      M[k * n + k] =
        A[i * m + i] + c[i] * law.slope(s.v[i], law.piece(s.v[i], s.down[i] <= 0 ? 1 : -1));
    });
    const step = TC.positive(
      M,
      n,
      free.map((i) => -s.down[i]),
    );
    if (!step) return null;
    step.forEach((x, k) => {
      d[free[k]] = x;
    });
    for (let i = 0; i < m; i++)
      if (law.onJump(s.v[i]) && (d[i] > 0 ? s.right[i] : -s.left[i]) > 0) d[i] = 0;
    const target = (length) =>
      s.v.map((x, i) =>
        d[i] > 0
          ? Math.min(x + length * d[i], law.nextUp(x, 1))
          : d[i] < 0
            ? Math.max(x + length * d[i], law.nextUp(x, -1))
            : x,
      );
    for (let h = 0; h <= 6; h++) {
      const next = state(target(0.5 ** h));
      if (next.residual < 0.9 * s.residual) return next;
    }
    return null;
  };
  // Every node in turn to where its own energy is least, the others held.
  const nodes = (s) => {
    const v = Float64Array.from(s.v);
    const xi = Float64Array.from(s.xi);
    for (let i = 0; i < m; i++) {
      const to = TC.leastOfNode(law, v[i], xi[i] / c[i], A[i * m + i] / c[i]);
      const move = to - v[i];
      if (move !== 0) for (let j = 0; j < m; j++) xi[j] -= A[i * m + j] * move;
      v[i] = to;
    }
    return state(v);
  };
  let s = state(new Float64Array(m));
  let iterations = 0;
  for (; iterations < most && s.residual > tolerance; iterations++) s = newton(s) || nodes(s);
  return {
    v: s.v,
    xi: s.xi,
    residual: s.residual,
    converged: s.residual <= 1e-10,
    iterations,
    rests: [...Array(m).keys()].map((i) => law.onJump(s.v[i]) && s.down[i] === 0),
  };
};
// Where b(s) + stiffness (s − s0) − traction passes 0, seen downhill from s0.
TC.leastOfNode = function (law, s0, traction, stiffness) {
  const slope = (s, k) => law.value(s, k) + stiffness * (s - s0) - traction;
  const left = slope(s0, law.piece(s0, -1));
  const right = slope(s0, law.piece(s0, 1));
  if (Math.max(-right, left) <= 0) return s0;
  const sign = -right >= left ? 1 : -1;
  for (let k = law.piece(s0, sign), s = s0; ; k += sign) {
    const end =
      sign > 0
        ? k < law.kinks.length
          ? law.kinks[k]
          : Infinity
        : k > 0
          ? law.kinks[k - 1]
          : -Infinity;
    const far = Number.isFinite(end) ? law.slope(end, k) : law.q[k];
    for (let i = 0; i < (law.a[k] === 0 ? 1 : 8); i++) {
      const bound = stiffness + Math.max(law.slope(s, k), far);
      const downhill = -sign * slope(s, k);
      if (downhill <= 0) break;
      if (bound <= 0 || Math.abs(end - s) * bound <= downhill) {
        s = end;
        break;
      }
      s += (sign * downhill) / bound;
    }
    if (s !== end || sign * slope(s, k + sign) >= 0) return s;
  }
};
