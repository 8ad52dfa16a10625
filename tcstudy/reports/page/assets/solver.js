// Contact problems with one solution (ω < λ₁), solved in the page. Their L̃ is strictly convex:
// a descent that ends where the inclusion holds has found the solution.
TC.Problem = class {
  // A: Float64Array of m×m by rows; load, c: Float64Array of m; law: TC.Law.
  constructor(A, load, c, law) {
    Object.assign(this, { A, load, c, law, m: c.length });
    let largestLoad = 0;
    for (let i = 0; i < this.m; i++) largestLoad = Math.max(largestLoad, Math.abs(load[i] / c[i]));
    this.scale = law.scale > 0 ? law.scale : Math.max(largestLoad, Math.abs(law.b(0, 1)));
  }
  times(v) {
    const { A, m } = this;
    const product = new Float64Array(m);
    for (let i = 0; i < m; i++) {
      let sum = 0;
      const row = i * m;
      for (let j = 0; j < m; j++) sum += A[row + j] * v[j];
      product[i] = sum;
    }
    return product;
  }
  xi(v) {
    const traction = this.times(v);
    for (let i = 0; i < this.m; i++) traction[i] = this.load[i] - traction[i];
    return traction;
  }
};

// Solution of a positive definite system, given by the lower rows of M, which are overwritten.
// It is null if M is not positive definite.
TC.solvePositiveDefinite = function (M, size, rhs) {
  const x = Float64Array.from(rhs);
  for (let k = 0; k < size; k++) {
    const pivot = M[k * size + k];
    if (!(pivot > 0)) return null;
    for (let i = k + 1; i < size; i++) {
      const factor = M[i * size + k] / pivot;
      x[i] -= factor * x[k];
      for (let j = k + 1; j <= i; j++) M[i * size + j] -= factor * M[j * size + k];
    }
  }
  for (let i = size - 1; i >= 0; i--) {
    for (let j = i + 1; j < size; j++) x[i] -= M[j * size + i] * x[j];
    x[i] /= M[i * size + i];
  }
  return x;
};

// {v, xi, residual, converged, iterations, rests} of a problem. A step is one of Newton's method on
// the pieces where the nodes are; nodes that stick on an up-jump stay, and a node moves as far as
// its next up-jump. Where that does not reduce the residual, the nodes move one by one, which
// always descends.
TC.solve = function (problem, { tolerance = 1e-12, most: maxIterations = 200 } = {}) {
  const { m, A, c, law } = problem;
  // One-sided derivatives of L̃ by every node, the descending one of them (0: the node sticks), and
  // the residual: the largest distance of ξ from b̂ over the scale of b.
  const evaluate = (v) => {
    const xi = problem.xi(v);
    const leftDerivative = new Float64Array(m);
    const rightDerivative = new Float64Array(m);
    const descent = new Float64Array(m);
    let largestDescent = 0;
    for (let i = 0; i < m; i++) {
      leftDerivative[i] = c[i] * law.b(v[i], -1) - xi[i];
      rightDerivative[i] = c[i] * law.b(v[i], 1) - xi[i];
      descent[i] =
        rightDerivative[i] < 0 ? rightDerivative[i] : leftDerivative[i] > 0 ? leftDerivative[i] : 0;
      largestDescent = Math.max(largestDescent, Math.abs(descent[i]) / c[i]);
    }
    return {
      v,
      xi,
      left: leftDerivative,
      right: rightDerivative,
      down: descent,
      residual: largestDescent === 0 ? 0 : largestDescent / problem.scale,
    };
  };
  const newtonStep = (current) => {
    const free = [...Array(m).keys()].filter(
      (i) => current.down[i] !== 0 || !law.onJump(current.v[i]),
    );
    const size = free.length;
    const matrix = new Float64Array(size * size);
    const direction = new Float64Array(m);
    free.forEach((i, row) => {
      for (let j = 0; j < row; j++) matrix[row * size + j] = A[i * m + free[j]];
      matrix[row * size + row] =
        A[i * m + i] +
        c[i] * law.slope(current.v[i], law.piece(current.v[i], current.down[i] <= 0 ? 1 : -1));
    });
    const step = TC.solvePositiveDefinite(
      matrix,
      size,
      free.map((i) => -current.down[i]),
    );
    if (!step) return null;
    step.forEach((change, row) => {
      direction[free[row]] = change;
    });
    for (let i = 0; i < m; i++)
      if (law.onJump(current.v[i]) && (direction[i] > 0 ? current.right[i] : -current.left[i]) > 0)
        direction[i] = 0;
    const target = (length) =>
      current.v.map((change, i) =>
        direction[i] > 0
          ? Math.min(change + length * direction[i], law.nextUp(change, 1))
          : direction[i] < 0
            ? Math.max(change + length * direction[i], law.nextUp(change, -1))
            : change,
      );
    for (let halving = 0; halving <= 6; halving++) {
      const next = evaluate(target(0.5 ** halving));
      if (next.residual < 0.9 * current.residual) return next;
    }
    return null;
  };
  // Moves every node in turn to the minimum of L̃ over it, the others held.
  const relaxNodes = (current) => {
    const v = Float64Array.from(current.v);
    const xi = Float64Array.from(current.xi);
    for (let i = 0; i < m; i++) {
      const slip = TC.minimiseAtNode(law, v[i], xi[i] / c[i], A[i * m + i] / c[i]);
      const move = slip - v[i];
      if (move !== 0) for (let j = 0; j < m; j++) xi[j] -= A[i * m + j] * move;
      v[i] = slip;
    }
    return evaluate(v);
  };
  let current = evaluate(new Float64Array(m));
  let iterations = 0;
  for (; iterations < maxIterations && current.residual > tolerance; iterations++)
    current = newtonStep(current) || relaxNodes(current);
  return {
    v: current.v,
    xi: current.xi,
    residual: current.residual,
    converged: current.residual <= 1e-10,
    iterations,
    rests: [...Array(m).keys()].map((i) => law.onJump(current.v[i]) && current.down[i] === 0),
  };
};
// The slip where b(s) + stiffness (s − start) − traction passes 0, downhill from start.
TC.minimiseAtNode = function (law, start, traction, stiffness) {
  const slope = (slip, piece) => law.value(slip, piece) + stiffness * (slip - start) - traction;
  const leftSlope = slope(start, law.piece(start, -1));
  const rightSlope = slope(start, law.piece(start, 1));
  if (Math.max(-rightSlope, leftSlope) <= 0) return start;
  const direction = -rightSlope >= leftSlope ? 1 : -1;
  for (let k = law.piece(start, direction), slip = start; ; k += direction) {
    const pieceEnd = direction > 0 ? (law.kinks[k] ?? Infinity) : (law.kinks[k - 1] ?? -Infinity);
    const endSlope = Number.isFinite(pieceEnd) ? law.slope(pieceEnd, k) : law.q[k];
    for (let iteration = 0; iteration < (law.a[k] === 0 ? 1 : 8); iteration++) {
      const bound = stiffness + Math.max(law.slope(slip, k), endSlope);
      const downhill = -direction * slope(slip, k);
      if (downhill <= 0) break;
      if (bound <= 0 || Math.abs(pieceEnd - slip) * bound <= downhill) {
        slip = pieceEnd;
        break;
      }
      slip += (direction * downhill) / bound;
    }
    if (slip !== pieceEnd || direction * slope(slip, k + direction) >= 0) return slip;
  }
};
