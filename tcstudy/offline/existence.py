"""Solutions of the body near stable solutions of its mesh, for any ω.

L is the energy of the body, u_h a solution on the mesh, e = u − u_h, ‖e‖² = a(e, e). τ, ξ* = −τ_T
and η are those of error_bound.py, with all that temperature and data add to η. Since τ is in
equilibrium with the loads,
    L(u_h + e) − L(u_h) ≥ ½‖e‖² − η‖e‖ + ∫_{Γ_C} D(x, e_T),
    D(x, s) = j(u_hT + s) − j(u_hT) − ξ*s.
If this is positive wherever ‖e‖ = r, the least L on the ball is inside it: L is weakly lower
semicontinuous, as H → L²(Γ_C) is compact. That least place is a solution u of the body, a local
minimum of its energy, with ‖u − u_h‖ < r (J.-P. Aubin and F. H. Clarke, SIAM J. Control Optim. 17
(1979) 567-586, for ∂∫j ⊂ ∫b̂).

Window:   π is the projection onto linear functions on the segments, v̂ the Gauss values of πe_T, Â
          of the equilibrium elements (guaranteed.py). Gauss values of e at all edges are among
          those over which wᵀK̂w is least, hence v̂ᵀÂv̂ ≤ ‖e‖² and
              |πe_T(x)| ≤ κ(x)r,   κ² = φᵀÂ⁻¹φ,   πe_T(x) = φᵀv̂.
          κ² is convex on a segment, so its larger end serves. With δ ≥ tκr, t > 1, the rest ϱ = e_T
          − πe_T has |e_T| ≤ t/(t − 1)·|ϱ| wherever |e_T| > δ. ‖ϱ‖² of a segment is at most C_e²
          times the energy of its triangle.
Weights:  on every segment w of either sign and Ω ≥ 0, m(x) ≥ 0 with
              D ≥ −½ws² − m for |s| ≤ δ,   D ≥ −½(w + Ω)s² − m for |s| > δ.
          Any will do. w < 0 where the film rests firmly; it is ω only where b falls within δ.
Sum:      with W⁺ = diag(c w⁺), W⁻ = diag(c w⁻) at the Gauss points and Â₋ = Â + W⁻, as springs at
          the Gauss points of πe_T are weaker than those of e_T,
              ∫w⁺(πe_T)² ≤ λ_max(Â₋⁻¹W⁺)(‖e‖² + ∫w⁻e_T²),
              k = 1 − λ_max(Â₋⁻¹W⁺) − max_K Σ_e C_e²(w⁺ + (t/(t − 1))²Ω),
          the energy rises by at least p(r) = ½kr² − ηr − ∫m, and p(r) > 0 proves the solution. The
          windows of r hold for smaller balls, too: the solution is within the root of p below r.
m:        on a part of a segment b is S b₀ with S in [S₁, S₂]; ξ* and v = u_hT are linear. For a
          slip y = v + s
              −D − ½ws² − ½Ωd² = S j₀(v) − ξ*v − ½wv² + (−S j₀(y) + ξ*y + wvy − ½wy² − ½Ωd²),
          d ≤ |s| the distance of y from all v of the part. The second term is affine in x, so that
          its supremum over fixed y is convex, and so is that over S. j₀(v) is at most its chord and
          its largest excess over that. Hence the trapezoidal rule, less the integral of ξ*v + ½wv²,
          bounds ∫m. The windows are widened so that they hold for all v of the part. All suprema
          are those of quadratic pieces: at ends or vertices.
Polygon:  |b − b₀| ≤ ε of exponential laws: ∫ε|e_T| ≤ ε√(|Γ_C|/λ_low)‖e‖ is added to η.
Counting: balls of N solutions that are disjoint hold N solutions of the body. For N ≥ 2 there is
          one more: take the minimum of the highest energy; on the sphere about it L is larger than
          at all N of them. L is coercive and satisfies the condition of Palais and Smale, so that
          the mountain pass theorem for locally Lipschitz functions (K.-C. Chang, J. Math. Anal.
          Appl. 80 (1981) 102-129) gives a solution of higher energy.
Need:     p(r) > 0 for some r if η < max_r (½kr² − ∫m)/r. k and m are those of this mesh, so that
          the η that a finer mesh needs is estimated.
All up to rounding.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from tcstudy.laws.laws import Laws
from tcstudy.offline.error_bound import PARTS, ErrorBounds
from tcstudy.offline.guaranteed import EquilibriumBody, neglected_by_segment
from tcstudy.offline.level import Level
from tcstudy.scene.guarantee import why_no_bound
from tcstudy.scene.records import Scene
from tcstudy.shapes.edges import GAUSS

Array = NDArray[np.float64]

RADII = np.geomspace(0.3, 40.0, 22)
"""Radii that are tried, relative to η: no ball is proved for r < 2η, but smaller ones tell the
need."""
WIDENINGS = (1.5, 2.0)
"""t: the windows relative to the largest |πe_T|."""
SHARES = (1e-3, 1e-2, 5e-2)
"""Shares of ½r² up to which m is let grow for the sake of smaller weights w."""
REST = (0.0, 0.1)
"""Shares of the energy that C_e²Ω may take for the sake of large −w where the film rests."""
LARGEST = 0.5
"""Largest C_e²w⁺."""
NEARER = PARTS / (PARTS - 1.0)
"""Largest |s|/d beyond a window, as that is PARTS times as wide as u_hT changes on a part."""
NEAREST = 1e-6
"""Slips that are nearer to u_hT, relative to the window, do not count in the choice of w."""


@dataclass(frozen=True)
class Ball:
    """What is proved near one solution.

    radius: r of the smallest ball that is proved to hold a solution of the body, NaN without one
            [√(J/m)]
    eta:    η [√(J/m)]
    need:   the η that is estimated to prove one; 0 or less if no η does at these k and m
    """

    radius: float
    eta: float
    need: float

    def size_needed(self, size: float) -> float:
        """Return the mesh size that is needed, estimated, of a mesh of this size; NaN if unknown.

        η of meshes that are graded towards the singular places is proportional to the mesh size.
        """
        return size * min(self.need / self.eta, 1.0) if self.need > 0.0 else float("nan")


NOTHING = Ball(float("nan"), float("nan"), float("nan"))


def count_of_body(radii: Sequence[float] | Array, distances: Array) -> int:
    """Return how many solutions the body has at least; 0 if nothing is proved.

    radii:     (N,) of proved balls, NaN without one [√(J/m)]
    distances: (N, N) ‖u_i − u_j‖ in the energy norm [√(J/m)]
    """
    chosen = list[int]()
    radius = np.asarray(radii, dtype=float)
    for i in np.argsort(radius):
        if np.isnan(radius[i]):
            continue
        if all(distances[i, j] > radius[i] + radius[j] for j in chosen):
            chosen.append(int(i))
    return len(chosen) + (len(chosen) >= 2)


def distances_of(A_tilde: Array, v: Array) -> Array:
    """Return ‖u_i − u_j‖ (N, N) of solutions v (N, m) of one scene [√(J/m)].

    Their difference is in equilibrium without loads, so that Ã has all of its energy.
    """
    change = v[:, None] - v[None]
    energy = np.einsum("ijm,mn,ijn->ij", change, A_tilde, change, optimize=True)
    return np.sqrt(np.maximum(energy, 0.0))


@dataclass(frozen=True)
class _Line:
    """What the contact line of one body has.

    A:     (2s, 2s) Â;  c: (2s,) weights of the Gauss points
    kappa: (s,) κ, the larger end of every segment [m/√(J/m)]
    C2:    (s,) C_e² [m/Pa];  owner: (s,) triangles
    low:   λ_low [Pa/m]
    """

    A: Array
    c: Array
    kappa: Array
    C2: Array
    owner: NDArray[np.intp]
    low: float


@dataclass(frozen=True)
class _Parts:
    """Parts of the segments that have one law, and their two ends.

    law:      that law, piecewise linear
    segments: (s,) their numbers
    xi, v:    (s, PARTS, 2) ξ* and u_hT at the ends of the parts
    strength: (2, s, PARTS, 1) least and largest factors of b on a part
    """

    law: Laws
    segments: NDArray[np.intp]
    xi: Array
    v: Array
    strength: Array

    @property
    def least(self) -> Array:
        """Return the least u_hT (s, PARTS, 1) of every part."""
        return np.asarray(self.v.min(axis=2, keepdims=True))

    @property
    def largest(self) -> Array:
        """Return the largest u_hT (s, PARTS, 1) of every part."""
        return np.asarray(self.v.max(axis=2, keepdims=True))

    @property
    def change(self) -> Array:
        """Return the change of u_hT (s,) along a segment."""
        return np.asarray(np.abs(self.v[:, -1, 1] - self.v[:, 0, 0]))

    def pieces(self, start: Array, end: Array) -> Iterator[_Piece]:
        """Yield the pieces of D over slips from `start` to `end`, with either strength."""
        law = self.law
        columns = zip(law.lower, law.upper, law.s_0, law.b_0, law.q, strict=True)
        for lower, upper, s_0, b_0, q in columns:
            first, last = np.maximum(lower, start), np.minimum(upper, end)
            if not np.any(first <= last):
                continue
            near = np.clip(self.v, np.minimum(first, last), last)
            energy = law.integral(self.v, near)
            for strength in self.strength:
                D = strength * energy - self.xi * (near - self.v)
                slope = strength * (b_0 + q * (near - s_0)) - self.xi
                yield _Piece(first, last, near, D, slope, strength * q)


def _parts_of(law: Laws, xi: Array, slip: Array, strengths: Array | None) -> list[_Parts]:
    """Return the parts of the segments by law.

    xi, slip: (s, 2) ξ* and u_hT at the ends of segments;  strengths: (2, s, PARTS) or None
    """
    places = np.linspace(0.0, 1.0, PARTS + 1)

    def at_ends(ends: Array) -> Array:
        values = np.multiply.outer(ends[:, 0], 1.0 - places)
        values = values + np.multiply.outer(ends[:, 1], places)
        return np.stack([values[:, :-1], values[:, 1:]], axis=2)

    traction, v = at_ends(xi), at_ends(slip)
    found = []
    for own_law, segments in law.groups(len(slip)):
        if strengths is None:
            strength = np.ones((1, len(segments), PARTS, 1))
        else:
            strength = strengths[:, segments][..., None]
        found.append(_Parts(own_law, segments, traction[segments], v[segments], strength))
    return found


@dataclass(frozen=True)
class _Piece:
    """D = D₀ + g(y − y₀) + ½q(y − y₀)² for slips y from `first` to `last`; empty if first > last.

    near: y₀, the nearest to u_hT;  D: D₀;  slope: g;  q: q
    """

    first: Array
    last: Array
    near: Array
    D: Array
    slope: Array
    q: Array


@dataclass(frozen=True)
class _Parabola:
    """value + slope·z − ½ curvature·z² for z from `first` to `last`; empty if first > last."""

    value: Array
    slope: Array
    curvature: Array
    first: Array
    last: Array

    def supremum(self) -> Array:
        """Return the supremum: at an end or at the vertex; −∞ where the range is empty."""
        with np.errstate(divide="ignore", invalid="ignore"):
            vertex = np.where(self.curvature > 0.0, self.slope / self.curvature, 0.0)
        inside = np.clip(vertex, np.minimum(self.first, self.last), self.last)
        ends = np.maximum(self._at(self.first), self._at(self.last))
        return np.where(self.first > self.last, -np.inf, np.maximum(ends, self._at(inside)))

    def _at(self, z: Array) -> Array:
        """Return the value at z, which may be infinite."""
        with np.errstate(invalid="ignore"):
            value = self.value + (self.slope - 0.5 * self.curvature * z) * z
            rises = (self.curvature < 0.0) | ((self.curvature == 0.0) & (self.slope * z > 0.0))
        return np.where(np.isfinite(z), value, np.where(rises, np.inf, -np.inf))


def _supremum(parts: _Parts, start: Array, end: Array, w: Array, Omega: Array, a: Array) -> Array:
    """Return sup of −D − ½w(y − v)² − ½Ω(y − a)² over slips y from `start` to `end`.

    start, end, w, Omega, a: broadcast with (s, PARTS, 2); −inf where start > end
    """
    suprema = np.full(parts.v.shape, -np.inf)
    for piece in parts.pieces(start, end):
        from_v, from_a = piece.near - parts.v, piece.near - a
        parabola = _Parabola(
            value=-piece.D - 0.5 * w * from_v**2 - 0.5 * Omega * from_a**2,
            slope=-piece.slope - w * from_v - Omega * from_a,
            curvature=piece.q + w + Omega,
            first=piece.first - piece.near,
            last=piece.last - piece.near,
        )
        np.maximum(suprema, parabola.supremum(), out=suprema)
    return suprema


def _least_weight(parts: _Parts, near: Array, far: Array, allowed: float) -> Array:
    """Return the least w (s,) with D ≥ −½ws² − allowed for near ≤ |s| ≤ far at the ends of parts.

    near, far: (s, 1, 1), near > 0
    """
    weights = np.full(parts.v.shape, -np.inf)
    for start, end in ((near, far), (-far, -near)):
        for piece in parts.pieces(parts.v + start, parts.v + end):
            np.maximum(weights, _least_weight_on(piece, parts.v, allowed), out=weights)
    return np.asarray(weights.max(axis=(1, 2)))


def _least_weight_on(piece: _Piece, v: Array, allowed: float) -> Array:
    """Return sup of −2(D + allowed)/s² over the slips v + s of a piece, which does not contain v.

    With D = C + Gs + ½qs² and t = 1/s that is −q − 2Gt − 2(C + allowed)t².
    """
    apart = piece.near - v
    G = piece.slope - piece.q * apart
    C = piece.D - piece.slope * apart + 0.5 * piece.q * apart**2
    with np.errstate(divide="ignore", invalid="ignore"):
        t = 1.0 / (piece.first - v), 1.0 / (piece.last - v)
    low, high = np.minimum(*t), np.maximum(*t)
    parabola = _Parabola(-piece.q, -2.0 * G, 4.0 * (C + allowed), low, high)
    return np.where(piece.first > piece.last, -np.inf, parabola.supremum())


def _chord_excess(parts: _Parts) -> Array:
    """Return the largest excess (s, PARTS) of S j₀(v) over its chord on every part.

    For a chord of slope ξ the excess is D of one that has ξ* = ξ and starts from the first end.
    """
    first, last = np.moveaxis(parts.v, 2, 0)
    change = last - first
    chord = parts.law.integral(first, last) / np.where(change != 0.0, change, 1.0)
    unit_strength = np.ones((1, *chord.shape, 1))
    above = _Parts(parts.law, parts.segments, chord[..., None], first[..., None], unit_strength)
    excess = np.zeros(chord.shape)
    for piece in above.pieces(parts.least, parts.largest):
        bounds = piece.first - piece.near, piece.last - piece.near
        parabola = _Parabola(piece.D, piece.slope, -piece.q, *bounds)
        np.maximum(excess, parabola.supremum()[..., 0], out=excess)
    return np.asarray(excess * parts.strength.max(axis=0)[..., 0])


@dataclass(frozen=True)
class _Window:
    """Windows of segments, and weights at the ends of their parts.

    delta: (s,) δ;  within: (s,) the least w;  beyond: (s,) the least w + Ω
    """

    delta: Array
    within: Array
    beyond: Array


def _window(part: _Parts, reach: Array, allowed: float) -> _Window:
    """Return windows of at least `reach` (s,), where m may be `allowed`."""
    # no narrower than a segment's change of u_hT, PARTS times that of a part: see NEARER
    delta = np.maximum(reach, part.change)
    wide = delta[:, None, None]
    widened = wide * (1.0 + 1.0 / PARTS)
    within = _least_weight(part, NEAREST * wide, widened, allowed)
    beyond = _least_weight(part, wide, np.full_like(wide, np.inf), 0.0)
    return _Window(delta, within, beyond)


def _mean_m(part: _Parts, delta: Array, w: Array, Omega: Array) -> Array:
    """Return an upper bound of the mean of m (s,) on every segment."""
    delta, w, Omega = (by_segment[:, None, None] for by_segment in (delta, w, Omega))
    least, largest = part.least, part.largest
    nothing = np.zeros_like(Omega)
    suprema = _supremum(part, least - delta, largest + delta, w, nothing, part.v)
    above = _supremum(part, least + delta, np.full_like(least, np.inf), w, Omega, largest)
    below = _supremum(part, np.full_like(least, -np.inf), largest - delta, w, Omega, least)
    suprema = np.maximum(np.maximum(suprema, above), below)
    traction_change = part.xi[..., 1] - part.xi[..., 0]
    slip_change = part.v[..., 1] - part.v[..., 0]
    # the trapezoidal rule less the integral of ξ*v + ½wv²
    excess = (traction_change + 0.5 * w[..., 0] * slip_change) * slip_change / 6.0
    m = suprema.mean(axis=2) + _chord_excess(part) + excess
    return np.asarray(np.maximum(m, 0.0).mean(axis=1))


class Existence:
    """Balls about solutions of one level that hold solutions of the body."""

    def __init__(self, level: Level, bounds: ErrorBounds | None = None) -> None:
        """Prepare proofs. bounds: the error bounds of the level, where there are some already"""
        self.level = level
        self.bounds = ErrorBounds(level) if bounds is None else bounds
        self._line_of: tuple[EquilibriumBody, float, _Line] | None = None

    def radius(self, scene: Scene, v: Array, limit: float = np.inf) -> float:
        """Return the radius of a ball about a solution v (m,) that holds a solution of the body.

        It is NaN where none is proved [√(J/m)].
        """
        return self.ball(scene, v, limit).radius

    def ball(self, scene: Scene, v: Array, limit: float = np.inf) -> Ball:
        """Return what is proved near a solution v (m,).

        limit: radius beyond which a ball is of no interest, as half the distance of the nearest
               other solution: large balls hold a solution of any coercive energy
        """
        if not self.level.is_held(scene) or why_no_bound(scene):
            return NOTHING
        u = self.level.displacement(scene, v).reshape(2, -1).T
        eta, xi = self.bounds.whole_residual(scene, u, near=True)
        line = self._line(scene)
        law, polygon_error = self.bounds.polygon(self.bounds.unscaled_law(scene))
        strengths = self.bounds.strengths(scene)
        if polygon_error > 0.0:
            largest = 1.0 if strengths is None else float(strengths.max())
            length = float(self.level.line.lengths.sum())
            eta += polygon_error * largest * float(np.sqrt(length / line.low))
        parts = _parts_of(law, xi, self.bounds.slip(u), strengths)
        need = -np.inf
        radii = eta * RADII
        for r in radii[radii < limit]:
            found = list[float]()
            for k, m in self._tries(line, parts, float(r)):
                need = max(need, 0.5 * k * r - m / r)
                # windows for r are wide enough for all smaller balls
                least = (eta + np.sqrt(eta**2 + 2.0 * k * m)) / k if k > 0.0 else np.inf
                if least < r:
                    found.append(float(least))
            if found:
                return Ball(min(found), eta, float(need))
        return Ball(float("nan"), eta, float(need))

    def _line(self, scene: Scene) -> _Line:
        """Return what the contact line has; that of the last body is kept."""
        level = self.level
        dual, factor = level.dual(scene)
        if self._line_of is not None:
            body, stiffness, line = self._line_of
            if body is dual and stiffness == factor:
                return line
        A = factor * dual.condensation.A_tilde
        # a linear function at the ends of a segment from its values at the Gauss points
        at_ends = np.linalg.inv(np.column_stack([1.0 - GAUSS, GAUSS]))
        s = len(dual.c) // 2
        inverse = np.linalg.inv(A).reshape(s, 2, s, 2)
        own = np.einsum("sisj->sij", inverse)
        kappa2 = np.einsum("ei,sij,ej->se", at_ends, own, at_ends).max(axis=1)
        lam, mu = factor * dual.elements.lam, factor * dual.elements.mu
        C2 = neglected_by_segment(level.mesh, level.line, np.minimum(mu, lam + mu))
        owner = level.mesh.owner[level.line.which]
        made = _Line(A, dual.c, np.sqrt(kappa2), C2, owner, level.band(scene).low)
        self._line_of = dual, factor, made
        return made

    def _tries(self, line: _Line, parts: list[_Parts], r: float) -> Iterator[tuple[float, float]]:
        """Yield k and ∫m for several windows and weights."""
        lengths = self.level.line.lengths
        for t, share in itertools.product(WIDENINGS, SHARES):
            ratio2 = (t / (t - 1.0)) ** 2
            allowed = share * 0.5 * r**2 / float(lengths.sum())
            windows = [_window(part, t * line.kappa[part.segments] * r, allowed) for part in parts]
            for rest in REST:
                w, Omega, m = np.zeros((3, len(lengths)))
                for part, window in zip(parts, windows, strict=True):
                    on = part.segments
                    w[on] = np.clip(
                        window.within, -rest / (ratio2 * line.C2[on]), LARGEST / line.C2[on]
                    )
                    Omega[on] = np.maximum(window.beyond - w[on], 0.0) * NEARER**2
                    m[on] = _mean_m(part, window.delta, w[on], Omega[on])
                neglected = line.C2 * (np.maximum(w, 0.0) + ratio2 * Omega)
                k = 1.0 - self._softening(line, w) - float(np.bincount(line.owner, neglected).max())
                yield k, float(lengths @ m)

    def _softening(self, line: _Line, w: Array) -> float:
        """Return λ_max(Â₋⁻¹W⁺)."""
        weights = line.c * np.repeat(w, 2)
        softens = np.flatnonzero(weights > 0.0)
        if not len(softens):
            return 0.0
        A = line.A + np.diag(np.maximum(-weights, 0.0))
        roots = np.sqrt(weights[softens])
        inverse = scipy.linalg.cho_solve(scipy.linalg.cho_factor(A), np.eye(len(A))[:, softens])
        soft = roots[:, None] * inverse[softens] * roots
        top = len(softens) - 1
        return float(scipy.linalg.eigvalsh(0.5 * (soft + soft.T), subset_by_index=[top, top])[0])
