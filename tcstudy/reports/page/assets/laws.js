// Friction laws as records of kinks and pieces, as in tcstudy/laws: piece k is b0 + q (s − s0) + a exp(−r (s − s0)).
TC.Law = class {
  constructor(name, kinks, pieces) {
    // a kink between two pieces that are one and the same is none
    const keep = kinks.map((s, i) => TC.Law.differ(pieces[i], pieces[i + 1])), kept = [pieces[0], ...pieces.slice(1).filter((_, i) => keep[i])];
    this.name = name;
    this.kinks = Float64Array.from(kinks.filter((_, i) => keep[i]));
    for (const key of ["s0", "b0", "q", "a", "r"]) this[key] = Float64Array.from(kept, (p) => p[key]);
    this.linear = this.a.every((v) => v === 0);
    const K = this.kinks.length;
    this.left = new Float64Array(K); this.right = new Float64Array(K); this.kind = new Int8Array(K);
    for (let k = 0; k < K; k++) {
      this.left[k] = this.value(this.kinks[k], k); this.right[k] = this.value(this.kinks[k], k + 1);
      const jump = this.right[k] - this.left[k], size = this.terms(this.kinks[k], k) + this.terms(this.kinks[k], k + 1); // whose rounding is no jump
      this.kind[k] = Math.abs(jump) <= 1e-14 * size ? 0 : jump > 0 ? 1 : -1;
    }
    this.ups = this.kinks.filter((_, k) => this.kind[k] > 0);
    this.at = new Float64Array(K); // ∫ of b from the first kink to each kink
    for (let k = 1; k < K; k++) this.at[k] = this.at[k - 1] + this.pieceIntegral(k, this.kinks[k - 1], this.kinks[k]);
    const ends = [0, K].filter((k) => this.q[k] === 0).map((k) => Math.abs(this.b0[k]));
    this.scale = Math.max(0, ...Array.from(this.left, Math.abs), ...Array.from(this.right, Math.abs), ...ends);
    this.omega = this.fall();
  }
  static differ(x, y) { return ["q", "a", "r"].some((k) => x[k] !== y[k]) || x.b0 - x.q * x.s0 !== y.b0 - y.q * y.s0 || (x.a !== 0 && x.s0 !== y.s0); }
  // Index of the piece that holds s; at a kink the one to its right (side > 0) or left.
  piece(s, side) {
    let lo = 0, hi = this.kinks.length;
    while (lo < hi) { const mid = (lo + hi) >> 1; if (side > 0 ? this.kinks[mid] <= s : this.kinks[mid] < s) lo = mid + 1; else hi = mid; }
    return lo;
  }
  value(s, k) { const d = s - this.s0[k]; return this.b0[k] + this.q[k] * d + (this.a[k] === 0 ? 0 : this.a[k] * Math.exp(-this.r[k] * d)); }
  terms(s, k) { const d = s - this.s0[k]; return Math.abs(this.b0[k]) + Math.abs(this.q[k] * d) + (this.a[k] === 0 ? 0 : Math.abs(this.a[k]) * Math.exp(-this.r[k] * d)); }
  slope(s, k) { return this.q[k] - (this.a[k] === 0 ? 0 : this.a[k] * this.r[k] * Math.exp(-this.r[k] * (s - this.s0[k]))); }
  b(s, side) { return this.value(s, this.piece(s, side)); }
  pieceIntegral(k, x, y) {
    const step = y - x;
    let total = step * (this.b0[k] + this.q[k] * (x - this.s0[k] + 0.5 * step));
    if (this.a[k] !== 0) {
      const rate = this.r[k], larger = rate * step >= 0 ? x : y, decay = Math.abs(rate * step);
      total += this.a[k] * Math.exp(-rate * (larger - this.s0[k])) * (decay === 0 ? step : (step * -Math.expm1(-decay)) / decay);
    }
    return total;
  }
  // ∫ b from x to y without cancellation.
  integral(x, y) {
    if (x === y) return 0;
    const rising = y > x, first = this.piece(x, rising ? 1 : -1), last = this.piece(y, rising ? -1 : 1);
    if (first === last) return this.pieceIntegral(first, x, y);
    const leave = rising ? first : first - 1, enter = rising ? last - 1 : last;
    return this.pieceIntegral(first, x, this.kinks[leave]) + (this.at[enter] - this.at[leave]) + this.pieceIntegral(last, this.kinks[enter], y);
  }
  onJump(s) { const k = this.piece(s, -1); return k < this.kinks.length && this.kinks[k] === s && this.kind[k] !== 0; }
  nextUp(s, direction) {
    if (direction > 0) { for (const u of this.ups) if (u > s) return u; return Infinity; }
    for (let i = this.ups.length - 1; i >= 0; i--) if (this.ups[i] < s) return this.ups[i];
    return -Infinity;
  }
  // Steepest fall of b; infinite with a down-jump.
  fall() {
    if (this.kind.some((k) => k < 0)) return Infinity;
    const ends = [-Infinity, ...this.kinks, Infinity];
    let least = 0;
    for (let k = 0; k < this.q.length; k++) for (const s of [ends[k], ends[k + 1]]) least = Math.min(least, Number.isFinite(s) ? this.slope(s, k) : this.q[k]);
    return -least;
  }
  // Curves to draw, in the form of the page's stored laws.
  drawn() {
    const K = this.kinks.length, outer = K ? Math.max(...Array.from(this.kinks, Math.abs)) : 0, decay = Math.max(0, ...Array.from(this.r, (r) => (r !== 0 ? 1 / Math.abs(r) : 0))), reach = Math.max(1.4 * outer, 6 * decay);
    const far = reach || 1, ends = [-far, ...this.kinks, far], curves = [], jumps = [];
    for (let k = 0; k <= K; k++) { const n = this.a[k] ? 60 : 2, s = [...Array(n)].map((_, i) => ends[k] + ((ends[k + 1] - ends[k]) * i) / (n - 1)); curves.push([s, s.map((x) => this.value(x, k))]); }
    for (let k = 0; k < K; k++) if (this.kind[k]) jumps.push([this.kinks[k], this.left[k], this.right[k], this.kind[k]]);
    return { name: this.name, omega: this.omega, reach, curves, jumps };
  }
};

TC.lawOf = (function () {
  const piece = (s0, b0, q = 0, a = 0, r = 0) => ({ s0, b0, q, a, r });
  const mirrored = (p) => piece(-p.s0, -p.b0, p.q, -p.a, -p.r);
  const odd = (name, kinks, pieces) => new TC.Law(name, [...kinks.map((s) => -s).reverse(), 0, ...kinks], [...pieces.map(mirrored).reverse(), ...pieces]);
  const need = (ok, text) => { if (!ok) throw new Error(text); };
  const shapes = {
    tresca({ tau }) { need(tau >= 0, "τ must be at least 0"); return odd("tresca", [], [piece(0, tau)]); },
    "slip-weakening"({ tau_s, tau_k, delta }) { need(tau_s >= 0 && tau_k >= 0 && delta > 0, "τ_s, τ_k ≥ 0 and δ > 0 are needed"); return odd("slip-weakening", [delta], [piece(0, tau_s, (tau_k - tau_s) / delta), piece(delta, tau_k)]); },
    exponential({ a, b, delta }) { need(a >= 0 && b >= 0 && delta > 0, "a, b ≥ 0 and δ > 0 are needed"); return odd("exponential", [], [a === b ? piece(0, b) : piece(0, b, 0, a - b, 1 / delta)]); },
    "saw-tooth"({ tau, delta, teeth, drop, decay }) {
      need(tau >= 0 && delta > 0 && teeth >= 1 && drop > 0 && drop <= 1 && decay > 0 && decay <= 1, "drop and decay are between 0 and 1");
      const peaks = [...Array(teeth + 1)].map((_, i) => tau * decay ** i), kinks = [...Array(teeth)].map((_, i) => (i + 1) * delta);
      return odd("saw-tooth", kinks, [...peaks.slice(0, -1).map((p, i) => piece(i * delta, p * (1 - drop), (drop * p) / delta)), piece(teeth * delta, (1 - drop) * peaks[teeth])]);
    },
    linear({ k }) { need(k >= 0, "k must be at least 0"); return new TC.Law("linear", [], [piece(0, 0, k)]); },
    "piecewise-linear"({ points, slope = 0 }) {
      const vertices = [];
      for (const [s, b] of points) { const last = vertices[vertices.length - 1]; if (last && s < last.s) throw new Error("the points must be in order of s"); if (last && s === last.s) last.right = b; else vertices.push({ s, left: b, right: b }); }
      need(vertices[0].s === 0, "the first point has s = 0");
      const pieces = [], kinks = vertices.slice(1).map((v) => v.s);
      for (let i = 1; i < vertices.length; i++) pieces.push(piece(vertices[i - 1].s, vertices[i - 1].right, (vertices[i].left - vertices[i - 1].right) / (vertices[i].s - vertices[i - 1].s)));
      const end = vertices[vertices.length - 1];
      pieces.push(piece(end.s, end.right, slope));
      need(slope > 0 || (slope === 0 && end.right >= 0), "friction must not push the slip on for large slips");
      return odd("piecewise-linear", kinks, pieces);
    },
  };
  return (spec) => { if (!shapes[spec.law]) throw new Error(`unknown law ${spec.law}`); return shapes[spec.law](spec); };
})();
