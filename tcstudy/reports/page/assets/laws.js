// Friction laws as records of kinks and pieces, as in tcstudy/laws:
// piece k is b0 + q (s − s0) + a exp(−r (s − s0)).
TC.Law = class {
  // The law strength · b(s / stretch) of the pieces of a law of the data.
  constructor(pieces, strength = 1, stretch = 1) {
    const scaled = (values, factor) => Float64Array.from(values, (value) => value * factor);
    const kinkCount = pieces.kinks.length;
    Object.assign(this, {
      kind: pieces.kinds,
      kinks: scaled(pieces.kinks, stretch),
      s0: scaled(pieces.s0, stretch),
      b0: scaled(pieces.b0, strength),
      q: scaled(pieces.q, strength / stretch),
      a: scaled(pieces.a, strength),
      r: scaled(pieces.r, 1 / stretch),
    });
    this.left = this.kinks.map((slip, i) => this.value(slip, i));
    this.right = this.kinks.map((slip, i) => this.value(slip, i + 1));
    this.ups = this.kinks.filter((_, i) => this.kind[i] > 0);
    const ends = [0, kinkCount].filter((i) => this.q[i] === 0).map((i) => Math.abs(this.b0[i]));
    this.scale = Math.max(
      0,
      ...Array.from(this.left, Math.abs),
      ...Array.from(this.right, Math.abs),
      ...ends,
    );
  }
  // Index of the piece that holds s; at a kink the one to its right (side > 0) or left.
  piece(slip, side) {
    let low = 0;
    let high = this.kinks.length;
    while (low < high) {
      const middle = (low + high) >> 1;
      if (side > 0 ? this.kinks[middle] <= slip : this.kinks[middle] < slip) low = middle + 1;
      else high = middle;
    }
    return low;
  }
  value(slip, piece) {
    const distance = slip - this.s0[piece];
    return (
      this.b0[piece] +
      this.q[piece] * distance +
      (this.a[piece] === 0 ? 0 : this.a[piece] * Math.exp(-this.r[piece] * distance))
    );
  }
  slope(slip, piece) {
    return (
      this.q[piece] -
      (this.a[piece] === 0
        ? 0
        : this.a[piece] * this.r[piece] * Math.exp(-this.r[piece] * (slip - this.s0[piece])))
    );
  }
  b(slip, side) {
    return this.value(slip, this.piece(slip, side));
  }
  onJump(slip) {
    const kink = this.piece(slip, -1);
    return kink < this.kinks.length && this.kinks[kink] === slip && this.kind[kink] !== 0;
  }
  nextUp(slip, direction) {
    return direction > 0
      ? (this.ups.find((kink) => kink > slip) ?? Infinity)
      : (this.ups.findLast((kink) => kink < slip) ?? -Infinity);
  }
};
