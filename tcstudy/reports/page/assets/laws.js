// Friction laws as records of kinks and pieces, as in tcstudy/laws: piece k is b0 + q (s − s0) + a exp(−r (s − s0)).
TC.Law = class {
  // pieces: those of the data; the law f b(s / g) of them.
  constructor(pieces, f = 1, g = 1) {
    const of = (values, by) => Float64Array.from(values, (v) => v * by);
    const K = pieces.kinks.length;
    Object.assign(this, {
      kind: pieces.kinds,
      kinks: of(pieces.kinks, g),
      s0: of(pieces.s0, g),
      b0: of(pieces.b0, f),
      q: of(pieces.q, f / g),
      a: of(pieces.a, f),
      r: of(pieces.r, 1 / g),
    });
    this.left = this.kinks.map((s, k) => this.value(s, k));
    this.right = this.kinks.map((s, k) => this.value(s, k + 1));
    this.ups = this.kinks.filter((_, k) => this.kind[k] > 0);
    const ends = [0, K].filter((k) => this.q[k] === 0).map((k) => Math.abs(this.b0[k]));
    this.scale = Math.max(
      0,
      ...Array.from(this.left, Math.abs),
      ...Array.from(this.right, Math.abs),
      ...ends,
    );
  }
  // Index of the piece that holds s; at a kink the one to its right (side > 0) or left.
  piece(s, side) {
    let lo = 0;
    let hi = this.kinks.length;
    while (lo < hi) {
      const mid = (lo + hi) >> 1;
      if (side > 0 ? this.kinks[mid] <= s : this.kinks[mid] < s) lo = mid + 1;
      else hi = mid;
    }
    return lo;
  }
  value(s, k) {
    const d = s - this.s0[k];
    return (
      this.b0[k] + this.q[k] * d + (this.a[k] === 0 ? 0 : this.a[k] * Math.exp(-this.r[k] * d))
    );
  }
  slope(s, k) {
    return (
      this.q[k] -
      (this.a[k] === 0 ? 0 : this.a[k] * this.r[k] * Math.exp(-this.r[k] * (s - this.s0[k])))
    );
  }
  b(s, side) {
    return this.value(s, this.piece(s, side));
  }
  onJump(s) {
    const k = this.piece(s, -1);
    return k < this.kinks.length && this.kinks[k] === s && this.kind[k] !== 0;
  }
  nextUp(s, direction) {
    return direction > 0
      ? (this.ups.find((u) => u > s) ?? Infinity)
      : (this.ups.findLast((u) => u < s) ?? -Infinity);
  }
};
