"""The bundle-Newton method for locally Lipschitz functions with an oracle x → (f, g, G).

Problem:    min f(x), x ∈ Rⁿ;  f(x), one subgradient g ∈ ∂f(x), a symmetric G of second derivatives
            of the active piece
Model:      f(x) + max_j { −α_j + g_jᵀd + ½ρ_j dᵀG_j d },   x the centre, d the step
Pieces:     f_j = f(y_j) + g(y_j)ᵀδ + ½ρ_j δᵀG_jδ,  g_j = g(y_j) + ρ_j G_j δ,  δ = x − y_j
            with 0 ≤ ρ_j ≤ 1
Locality:   α_j = max{ |f(x) − f_j|, γ‖W‖ s_j² },  s_j the distance of y_j from x
Subproblem: simplex_qp.py (dual active set on orthogonal factors)
Literature: Lukšan & Vlček, A bundle-Newton method for nonsmooth unconstrained minimization,
            Math. Programming 83 (1998) 373–391 (quadratic model, damping, subgradient locality
            measures)

Steps, after evaluating y = x + d with predicted decrease w:
  serious   f(y) ≤ f(x) − m_L w: y becomes the centre
  null      x stays and the piece of y joins the bundle; where its model value at d is below −m_R w
            the next step is shorter, too
  short     f is not finite at y: x and the bundle stay, the next step is shorter
  reset     the model is stationary, but by pieces from too far away: they are dropped and looked
            for again nearby

Left out: the publication's line search over t with m_L, m_R, t_0 (every iteration tries t = 1
within a radius that follows the success, one evaluation an iteration), bounds and linear
constraints, and its absolute constants: all tests here are relative, so that f → af and x → ax give
the same iterates to rounding.

Differences from the publication, each because it saves evaluations:
  * ‖W‖ in the locality measure makes γ a pure number; s_j is the distance, not the length of the
    path.
  * ρ_j is not 0 or 1: it is lowered in proportion to the amount by which the piece lies above f(x).
  * The published step solves one quadratic programme with W = Σλ_jρ_jG_j of the previous
    multipliers. Here the programme is repeated about its last solution until the quadratic model
    itself is minimised: W is then the Hessian of the present Lagrangian and the curvature of the
    kinks (the second-order correction) is in the step. This costs quadratic programmes but no
    evaluation.

Where all pieces share the curvature of a smooth part, G_j = B + diag(h_j), products with N pieces
cost O(n² + Nn) instead of O(Nn²) and the bundle stores N vectors instead of N matrices: the oracle
then returns h (n,) in place of G.

The condensed contact problem is such a function,

f(v) = L̃(v) = ½vᵀÃv − l̃ᵀv + Σc_i j(v_i),   g(v) = Ãv − l̃ + c b(v),   G(v) = Ã + diag(c b′(v))

with the right limits of b and b′ at a kink: one selection of ∂L̃(v) (Šestak & Jovanović, Appl.
Math. Mech. 31 (2010), §3, eqs. 20, 21). A node that slips is smooth and costs nothing. Every
sticking node is a direction in which L̃ is nonsmooth and needs a subgradient, so iterations grow
with the number of sticking nodes. The iteration deliberately makes no use of the separable
structure of Ψ. Only the end does: once the predicted decrease is small, the pieces that the nodes
seem to be on are tried (solution.py). Where they satisfy the inclusion (21) at no higher energy the
remaining iterations, which would only add digits, are left out.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tcstudy.contact.boxes import reach_of_openings
from tcstudy.contact.problem import ContactProblem, Outcome, Status
from tcstudy.contact.simplex_qp import ACTIVE, direction, dual_decrease, positive_definite
from tcstudy.contact.solution import polished

Array = NDArray[np.float64]
Oracle = Callable[[Array], tuple[float, Array, Array]]
ExactEnd = Callable[[Array, float], Array | None]
Kind = Literal["start", "serious", "null", "short", "reset"]

M_L, M_R = 0.01, 0.5
"""Shares of the predicted decrease for a serious step and for a useful null step."""
DAMPING = 5.0
"""Decrease of ρ_j per relative overestimate of f(x) by the piece's curvature."""
MAX_PROGRAMMES = 40
"""Quadratic programmes per minimisation of the model; per iteration on average."""
MODEL_TOLERANCE = 1e-3
"""Relative change at which the model counts as minimised."""
MIN_EIGENVALUE = 1e-8
"""Smallest eigenvalue of W relative to its largest."""
MIN_CURVATURE = 1e-2
"""Smallest eigenvalue of W relative to (largest slope)/(first length), where no piece is curved."""
LOOSENING = 0.25
"""Factor of MIN_CURVATURE after each full step, as W must not hold back steps along flat pieces."""
MIN_FRACTION = 1e-15
"""Part of a step below which it is not shortened further."""
MAX_RADII = 4.0
"""Multiple of the radius beyond which a step is not worth completing."""
MAX_SHIFTS = 25
"""Shifts that are tried for a step within the radius."""
MAX_RESETS = 10
"""Resets in a row, beside one for each dimension."""
REMOTE = 1e4
"""Multiple of the tolerance that the curvature over a piece's distance adds where it is remote."""
EXACT_DECREASE = 1e-4
"""Predicted decrease, relative to |f|, below which an exact end is tried."""
EXACT_INTERVAL = 10
"""Evaluations between two such trials."""


@dataclass(frozen=True, eq=False)
class Bundle:
    """Answers of the oracle at N points.

    y, f, g: (N, n) points, (N,) values, (N, n) subgradients
    G:       (N, n, n) second derivatives of the active pieces; with a base (N, n) the diagonals
             beside it
    base:    (n, n) symmetric B that all share, or None
    """

    y: Array
    f: Array
    g: Array
    G: Array
    base: Array | None = None

    @classmethod
    def at(cls, y: Array, oracle: Oracle, base: Array | None) -> Bundle:
        """Return the piece of one point y (n,)."""
        f, g, G = oracle(y)
        g, G = np.asarray(g, dtype=float), np.asarray(G, dtype=float)
        return cls(y[None], np.array([f], dtype=float), g[None], G[None], base)

    def __len__(self) -> int:
        return len(self.f)

    @property
    def finite(self) -> bool:
        """True if f, g and G are all finite."""
        return all(np.all(np.isfinite(numbers)) for numbers in (self.f, self.g, self.G))

    def take(self, index: NDArray[np.intp]) -> Bundle:
        """Return the numbered pieces."""
        return Bundle(self.y[index], self.f[index], self.g[index], self.G[index], self.base)

    def appended(self, new: Bundle) -> Bundle:
        """Return these pieces and new ones behind them."""
        return Bundle(
            np.append(self.y, new.y, axis=0),
            np.append(self.f, new.f, axis=0),
            np.append(self.g, new.g, axis=0),
            np.append(self.G, new.G, axis=0),
            self.base,
        )

    def times(self, d: Array) -> Array:
        """Return (N, n) G_j d_j, of rows d (N, n) or one d (n,) for all."""
        if self.base is None:
            return np.asarray((self.G @ d[..., None])[..., 0])
        return np.asarray(d @ self.base + self.G * d)

    def combined(self, weights: Array) -> Array:
        """Return (n, n) Σ w_j G_j as a new matrix."""
        if self.base is None:
            return np.asarray(np.tensordot(weights, self.G, 1))
        return weights.sum() * self.base + np.diag(weights @ self.G)


@dataclass(frozen=True, eq=False)
class Model:
    """The pieces about a centre.

    c:         (N,) −α_j
    A:         (N, n) g_j in rows
    rho:       (N,) ρ_j
    s:         (N,) localities
    curvature: ‖Σλ_jG_j‖₂ of the present multipliers
    """

    pieces: Bundle
    c: Array
    A: Array
    rho: Array
    s: Array
    curvature: float

    @classmethod
    def about(cls, x: Array, f: float, pieces: Bundle, gamma: float, curvature: float) -> Model:
        """Return the model about the centre x with value f.

        Every ρ_j is the largest that keeps a piece at or below f.

        gamma: weight γ of distances
        """
        delta = x - pieces.y
        turn = pieces.times(delta)
        bend = 0.5 * _rowwise(delta, turn)
        linear = pieces.f + _rowwise(pieces.g, delta)
        over = linear + bend - f
        damped = (over > 0.0) & (bend > 0.0)
        rho = np.ones(len(pieces))
        rho[damped] = np.maximum(0.0, 1.0 - DAMPING * over[damped] / bend[damped])
        s = np.linalg.norm(delta, axis=1)
        alpha = np.maximum(np.abs(linear + rho * bend - f), gamma * curvature * s * s)
        return cls(pieces, -alpha, pieces.g + rho[:, None] * turn, rho, s, curvature)

    def bend(self, d: Array) -> Array:
        """Return (N, n) ρ_jG_jd."""
        return self.rho[:, None] * self.pieces.times(d)

    def value(self, d: Array) -> float:
        """Return max_j −α_j + g_jᵀd + ½ρ_j dᵀG_jd, the predicted change of f."""
        return float(np.max(self.c + self.A @ d + 0.5 * (self.bend(d) @ d)))


def _rowwise(a: Array, b: Array) -> Array:
    """Return (N,) a_jᵀb_j of the rows."""
    return np.asarray(np.sum(a * b, axis=1))


@dataclass(frozen=True)
class Step:
    """A minimiser of the model.

    d:          (n,) step
    lam:        (N,) multipliers
    decrease:   predicted decrease of f, −model(d) ≥ 0
    promise:    w = ½‖Σλ_jg_j‖²_{W⁻¹} + Σλ_jα_j of the first quadratic programme without shift: the
                published stopping quantity
    shift:      multiple μ of the identity that kept d within the radius, 0 if that did not bind
    programmes: quadratic programmes solved, each with a factorisation of W
    """

    d: Array
    lam: Array
    decrease: float
    promise: float
    shift: float
    programmes: int

    @property
    def length(self) -> float:
        """‖d‖."""
        return float(np.linalg.norm(self.d))


def minimise(model: Model, lam: Array, shift: float, unit: float, limit: float) -> Step:
    """Return a local minimiser of model + ½·shift·‖d‖².

    Method: repeated quadratic programmes with halving, from d = 0.

    limit: length beyond which the step will be rejected, so that the search ends
    """

    def merit(d: Array) -> float:
        return model.value(d) + 0.5 * shift * float(d @ d)

    d = np.zeros(model.A.shape[1])
    lowest = merit(d)
    least = MIN_CURVATURE * float(np.max(np.abs(model.A))) / unit
    promise = 0.0
    programmes = 0
    for programmes in range(1, MAX_PROGRAMMES + 1):
        bend = model.bend(d)
        weights = lam * model.rho
        metric = positive_definite(model.pieces.combined(weights), shift, MIN_EIGENVALUE, least)
        values = model.c + model.A @ d + 0.5 * (bend @ d)
        lam, q = direction(values, model.A + bend, shift * d, metric, lam)
        if programmes == 1:
            promise = dual_decrease(model.c, model.A, lam, metric)
        fraction, value = _lower(merit, d, q, lowest)
        if fraction == 0.0:
            if programmes > 1:
                break
            continue  # with the W of the new multipliers
        d = d + fraction * q
        if fraction == 1.0:
            least *= LOOSENING
        is_small = fraction * np.linalg.norm(q) <= MODEL_TOLERANCE * np.linalg.norm(d)
        is_flat = lowest - value <= MODEL_TOLERANCE * abs(value)
        lowest = value
        if (programmes > 1 and (is_small or is_flat)) or np.linalg.norm(d) > limit:
            break
    return Step(d, lam, -model.value(d), promise, shift, programmes)


def _lower(
    merit: Callable[[Array], float], d: Array, q: Array, value: float
) -> tuple[float, float]:
    """Return the first of 1, ½, ¼ … whose part of q lowers the merit, and its merit; 0 if none."""
    fraction = 1.0
    while fraction > MIN_FRACTION:
        lower = merit(d + fraction * q)
        if lower < value:
            return fraction, lower
        fraction *= 0.5
    return 0.0, value


def bounded_step(
    model: Model, lam: Array, radius: float, unit: float, likely_shift: float = 0.0
) -> Step:
    """Return the model's minimiser, shifted by μI so that ‖d‖ ≤ 1.2·radius.

    μ is the smallest that bisection finds. A nonconvex model may jump past the radius as μ falls;
    then the longest step found below it counts.

    likely_shift: μ of the step before, tried second
    """
    limit = MAX_RADII * radius
    step = minimise(model, lam, 0.0, unit, limit)
    promise = step.promise
    programmes = step.programmes
    inside = None
    shift, low, high = 0.0, 0.0, np.inf
    for _ in range(MAX_SHIFTS):
        has_failed = step.length == 0.0 < promise
        if step.length > 1.2 * radius or has_failed:
            low = shift
        else:
            inside, high = step, shift
            if shift == 0.0 or step.length >= 0.6 * radius or high <= 1e-6 * model.curvature:
                break
        if high < 1.3 * low:
            break
        if np.isfinite(high):
            shift = float(np.sqrt(high * max(low, 1e-3 * high)))
        elif shift == 0.0 < likely_shift and not has_failed:
            shift = likely_shift
        else:
            slope = float(np.linalg.norm(step.lam @ model.A))
            if has_failed:
                slope = float(np.max(np.abs(model.A)))
            shift = max(slope / radius, 10.0 * shift)
        step = minimise(model, lam, shift, unit, limit)
        programmes += step.programmes
    if inside is None:
        inside = _shortened(model, step, radius)
    return replace(inside, promise=promise, programmes=programmes)


def _shortened(model: Model, step: Step, radius: float) -> Step:
    """Return a step that is too long, shortened to the radius and on until the model falls."""
    fraction = min(1.0, radius / step.length) if step.length > 0.0 else 0.0
    while fraction > MIN_FRACTION and model.value(fraction * step.d) >= 0.0:
        fraction *= 0.5
    d = fraction * step.d
    return replace(step, d=d, decrease=-model.value(d))


class State(NamedTuple):
    """A run as seen from outside: the centre, its value and the kind of step that led there."""

    kind: Kind
    x: Array
    f: float


@dataclass(frozen=True, eq=False)
class BundleNewton:
    """The method with its options.

    tolerance:      predicted decrease relative to |f| (+ 10⁻³ of the decrease so far) at which to
                    stop
    max_iterations: limit of steps, each with at most one evaluation and MAX_PROGRAMMES quadratic
                    programmes on average
    x_unit:         length by which to bound the first step (None: ‖x0‖; from f, g and G if x0 = 0)
    gamma:          weight γ of the distance in the locality measure
    base:           (n, n) B where the oracle returns the diagonals h of G = B + diag(h)
    """

    tolerance: float = 1e-11
    max_iterations: int = 500
    x_unit: float | None = None
    gamma: float = 1e-3
    base: Array | None = None

    def run(
        self,
        oracle: Oracle,
        x0: Array,
        exact: ExactEnd | None = None,
        watch: Callable[[State], None] | None = None,
    ) -> Outcome:
        """Go from x0 until the model promises no more decrease or the limit of steps is met.

        exact: (x, decrease left) → the exact minimum beside x, or None
        watch: called with every state
        """
        first = Bundle.at(x0, oracle, self.base)
        if not first.finite:
            reason = "f, g or G is not finite at the start; start from another point"
            return Outcome(x0, float(first.f[0]), Status.NOT_FINITE, reason, 0, 1)
        run = BundleRun(self, oracle, first)
        iteration = 0
        while True:
            if watch is not None:
                watch(State(run.kind, run.x, run.f))
            ended = run.verdict()
            if exact is not None and run.is_exact_end_due(ended):
                x = exact(run.x, EXACT_DECREASE * run.scale)
                if x is not None:
                    ended = ended or (Status.CONVERGED, "on the exact active pieces")
                    return Outcome(x, oracle(x)[0], *ended, iteration, run.evaluations)
            if ended is None and iteration == self.max_iterations:
                reason = (
                    f"no solution within {iteration} iterations; start from a neighbouring "
                    "solution, use another solver, or allow bundle-newton more (max_iterations)"
                )
                ended = Status.ITERATION_LIMIT, reason
            if ended is not None:
                return Outcome(run.x, run.f, *ended, iteration, run.evaluations)
            run.advance()
            iteration += 1


@dataclass(eq=False)
class BundleRun:
    """The state of a run.

    method:     its options
    first:      the piece of the start
    kind:       of the last step
    x, f:       the centre and f there
    radius:     bound of the next step
    model:      the bundle about x; one of its pieces lies at x
    step:       the model's minimiser within the radius
    resets:     since the last serious step
    programmes: quadratic programmes so far
    unit:       a length of the problem
    f_first:    f at the start
    """

    method: BundleNewton
    oracle: Oracle
    first: Bundle
    kind: Kind = field(init=False)
    x: Array = field(init=False)
    f: float = field(init=False)
    radius: float = field(init=False)
    model: Model = field(init=False)
    step: Step = field(init=False)
    resets: int = 0
    evaluations: int = 1
    programmes: int = 0
    unit: float = field(init=False)
    f_first: float = field(init=False)
    first_promise: float = field(init=False)

    def __post_init__(self) -> None:
        self.x = self.first.y[0]
        self.f = float(self.first.f[0])
        self.f_first = self.f
        self.unit = self.method.x_unit or first_unit(self.first)
        self.aim("start", self.first, np.ones(1), self.unit)
        self.first_promise = max(self.step.promise, self.step.decrease)

    @property
    def scale(self) -> float:
        """Number that the predicted decrease is compared with.

        |f| and a share of the decrease so far; if both are 0, the first promise.
        """
        return float(abs(self.f) + 1e-3 * (self.f_first - self.f)) or self.first_promise

    @property
    def accuracy(self) -> float:
        """Predicted decrease relative to `scale`."""
        predicted = max(self.step.decrease, self.step.promise)
        if self.scale > 0.0:
            return predicted / self.scale
        return np.inf if predicted else 0.0

    def aim(
        self, kind: Kind, pieces: Bundle, lam: Array, radius: float, likely_shift: float = 0.0
    ) -> None:
        """Set the model of these pieces and the step that follows within a radius."""
        curvature = float(np.max(np.abs(np.linalg.eigvalsh(pieces.combined(lam)))))  # ‖Σλ_jG_j‖₂
        self.kind = kind
        self.radius = radius
        self.model = Model.about(self.x, self.f, pieces, self.method.gamma, curvature)
        unit = max(radius, self.unit)
        self.step = bounded_step(self.model, lam, radius, unit, likely_shift)
        self.programmes += self.step.programmes

    def advance(self) -> None:
        """Take one serious, null, short or reset step (see the head of this file)."""
        if self.accuracy <= self.method.tolerance:
            self.reset()
            return
        step, radius = self.step, self.radius
        new = Bundle.at(self.x + step.d, self.oracle, self.method.base)
        self.evaluations += 1
        if not new.finite:
            self.aim("short", self.model.pieces, step.lam, 0.25 * step.length, step.shift)
            return
        pieces, lam = self.selected(new)
        f = float(new.f[0])
        ratio = (self.f - f) / step.decrease
        if ratio < M_L:
            # shorter if the new piece hardly changes the model at d
            alone = Model.about(self.x, self.f, new, self.method.gamma, self.model.curvature)
            if alone.value(step.d) < -M_R * step.decrease:
                radius = 0.5 * min(radius, step.length)
            self.aim("null", pieces, lam, radius, step.shift)
            return
        if ratio > 0.9:
            radius = max(radius, 4.0 * step.length)
        elif ratio > 0.5:
            radius = max(radius, 2.0 * step.length)
        elif ratio < 0.1:
            radius = 0.5 * min(radius, step.length)
        self.x = new.y[0]
        self.f = f
        self.resets = 0
        self.aim("serious", pieces, lam, radius, step.shift)

    def selected(self, new: Bundle) -> tuple[Bundle, Array]:
        """Return the next bundle with `new` last, and multipliers for it to start from.

        Beyond 2n + 5 pieces the oldest inactive ones leave.
        """
        pieces, lam = self.model.pieces, self.step.lam
        idle = np.flatnonzero((lam <= ACTIVE) & (self.model.s > 0.0))
        n_leaving = max(0, len(pieces) - 2 * len(self.x) - 4)
        staying = np.setdiff1d(np.arange(len(pieces)), idle[:n_leaving])
        lam = np.append(lam[staying], 0.0)
        return pieces.take(staying).appended(new), lam / lam.sum()

    def remote(self) -> NDArray[np.bool_]:
        """Return (N,) active pieces whose origin is too far away to prove stationarity."""
        allowed = REMOTE * self.method.tolerance * self.scale
        return (self.step.lam > ACTIVE) & (self.model.curvature * self.model.s**2 > allowed)

    def reset(self) -> None:
        """Drop the remote active pieces and look for them again nearby.

        Nearby is the distance that proves stationarity.
        """
        near = np.flatnonzero(~self.remote())
        allowed = REMOTE * self.method.tolerance * self.scale
        distance = float(np.sqrt(allowed / self.model.curvature))
        self.resets += 1
        lam = np.full(len(near), 1.0 / len(near))
        # steps may exceed the radius a little; the pieces that they find must not be remote again
        self.aim("reset", self.model.pieces.take(near), lam, 0.5 * distance, self.step.shift)

    def is_exact_end_due(self, ended: tuple[Status, str] | None) -> bool:
        """Return whether an exact end is to be tried."""
        if not self.step.decrease <= EXACT_DECREASE * self.scale:
            return False
        if ended is None:
            return self.evaluations % EXACT_INTERVAL == 0
        return ended[0] == Status.CONVERGED

    def verdict(self) -> tuple[Status, str] | None:
        """Return None to go on, else why to stop.

        Converged: the predicted decrease is within the tolerance by pieces from nearby.
        """
        method, step = self.method, self.step
        predicted = f"predicted decrease {self.accuracy:.1e} of |f|"
        if self.accuracy <= method.tolerance:
            if not np.any(self.remote()):
                return Status.CONVERGED, f"{predicted}, by pieces from nearby"
            if self.resets <= MAX_RESETS + len(self.x):
                return None
            return Status.STALLED, (
                f"{predicted}, but only by pieces from too far away, and {self.resets} searches "
                "nearby found no others; allow a larger tolerance"
            )
        if self.programmes > MAX_PROGRAMMES * method.max_iterations:
            return Status.ITERATION_LIMIT, (
                f"{self.programmes} quadratic programmes, more than {MAX_PROGRAMMES} for each of "
                f"{method.max_iterations} iterations, at a {predicted}; allow more "
                "(max_iterations) or a larger tolerance"
            )
        if self.radius > 1e12 * self.unit:
            return Status.UNBOUNDED, (
                f"f still decreases at a distance of {self.radius:.1e}: it may be unbounded below; "
                "check its growth"
            )
        rounding = 4 * np.finfo(float).eps * float(np.linalg.norm(self.x))
        if step.decrease <= 0.0 or step.length <= rounding:
            return Status.STALLED, (
                f"steps have shrunk to rounding level at a {predicted}; "
                "check g and G against differences of f, or allow a larger tolerance"
            )
        return None


def first_unit(piece: Bundle) -> float:
    """Return a length to begin with: ‖x0‖, else ‖g‖/‖G‖, else |f|/‖g‖.

    It is 1 where the data hold no scale at all.
    """
    size = float(np.linalg.norm(piece.y))
    value = abs(float(piece.f[0]))
    slope = float(np.linalg.norm(piece.g))
    bend = float(np.linalg.norm(piece.combined(np.ones(1))))
    if size > 0.0:
        return size
    if slope > 0.0 and bend > 0.0:
        return slope / bend
    if value > 0.0 and slope > 0.0:
        return value / slope
    return 1.0


def contact_oracle(problem: ContactProblem) -> Oracle:
    """Return the oracle of a contact problem, from v (m,) [m].

    Its answer is L̃(v) [J/m], one g ∈ ∂L̃(v) (m,) [N/m], and the diagonal that Ã lacks of G (m,)
    [Pa].
    """
    law, c, A_tilde = problem.law, problem.c, problem.A_tilde

    def oracle(v: Array) -> tuple[float, Array, Array]:
        piece = law.piece(v)
        g = A_tilde @ v - problem.l_tilde + c * law.value(v, piece)
        return problem.energy(v), g, c * law.slope(v, piece)

    return oracle


def solve_with_bundle(
    problem: ContactProblem,
    x0: Array,
    max_iterations: int | None = None,
    inclusion: float = 1e-12,
    tolerance: float = 1e-13,
) -> Outcome:
    """Run the method on the contact problem from x0 (m,) [m].

    The first length is the norm of the frictionless solution, or the law's slip scale. A ray is a
    jump as large as the pressure may be, an exact penalty; what is found is tested with the ray.

    inclusion: inclusion residual to work for on the active pieces, as far as rounding allows it
    tolerance: of the energy; the error of v and of ξ is of the order of its root
    """

    x0 = problem.law.admissible(x0)
    penalised = problem
    if problem.law.has_rays:
        _, pressure = reach_of_openings(problem.rows, np.zeros((1, problem.m)))
        largest = 2.0 * float(np.max(pressure))
        if not np.isfinite(largest):  # nothing presses a loose body on
            largest = 4.0 * float(np.max(np.abs(problem.l_tilde) / problem.c))
        laws = problem.law.walled(largest)
        penalised = ContactProblem.on(problem.body, problem.l_tilde, laws)

    def exact(x: Array, left: float) -> Array | None:
        """Return the point on the active pieces, if it satisfies the inclusion and adds digits.

        Its energy must not be higher, nor lower by more than `left`: the descent is the bundle's.
        """
        end = polished(problem, x, exact=False)
        change = penalised.energy_change(x, end.v)[0]
        is_solution = end.residual <= max(inclusion, problem.xi_rounding(end.v))
        return end.v if is_solution and -left <= change <= 0.0 else None

    length = float(np.linalg.norm(problem.frictionless())) or problem.law.s_scale
    method = BundleNewton(tolerance, max_iterations or 2000, length or None, base=problem.A_tilde)
    return method.run(contact_oracle(penalised), x0, exact)
