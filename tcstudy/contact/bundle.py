"""The bundle-Newton method for locally Lipschitz functions with an oracle x → (f, g, G).

Problem:    min f(x), x ∈ Rⁿ;  f(x), one subgradient g ∈ ∂f(x), a symmetric G of second derivatives of the active piece
Model:      f(x) + max_j { −α_j + g_jᵀd + ½ρ_j dᵀG_j d },   x the centre, d the step
Pieces:     f_j = f(y_j) + g(y_j)ᵀδ + ½ρ_j δᵀG_jδ,  g_j = g(y_j) + ρ_j G_j δ,  δ = x − y_j,  0 ≤ ρ_j ≤ 1
Locality:   α_j = max{ |f(x) − f_j|, γ‖W‖ s_j² },  s_j the distance of y_j from x
Subproblem: simplex_qp.py (dual active set on orthogonal factors)
Literature: Lukšan & Vlček, A bundle-Newton method for nonsmooth unconstrained minimization,
            Math. Programming 83 (1998) 373–391 (quadratic model, damping, subgradient locality
            measures)

Steps, after evaluating y = x + d with predicted decrease w:
  serious   f(y) ≤ f(x) − m_L w: y becomes the centre
  null      x stays and the piece of y joins the bundle; where its model value at d is below −m_R w the next step is
            shorter, too
  short     f is not finite at y: x and the bundle stay, the next step is shorter
  reset     the model is stationary, but by pieces from too far away: they are dropped and looked for again nearby

Left out: the publication's line search over t with m_L, m_R, t_0 (every iteration tries t = 1
within a radius that follows the success, one evaluation an iteration), bounds and linear
constraints, and its absolute constants: all tests here are relative, so that f → af and x → ax give
the same iterates to rounding.

Differences from the publication, each because it saves evaluations:
  * ‖W‖ in the locality measure makes γ a pure number; s_j is the distance, not the length of the
    path.
  * ρ_j is not 0 or 1: it is lowered in proportion to the amount by which the piece lies above f(x).
  * The published step solves one quadratic programme with W = Σλ_jρ_jG_j of the previous
    multipliers. Here the
    programme is repeated about its own solution until the quadratic model itself is minimised: W is
    then the
    Hessian of the present Lagrangian and the curvature of the kinks (the second-order correction)
    is in the step.
    This costs quadratic programmes but no evaluation.

Where all pieces share the curvature of a smooth part, G_j = B + diag(h_j), products with N pieces
cost O(n² + Nn) instead of O(Nn²) and the bundle stores N vectors instead of N matrices: the oracle
then returns h (n,) in place of G.

The condensed contact problem is such a function,

f(v) = L̃(v) = ½vᵀÃv − l̃ᵀv + Σc_i j(v_i),   g(v) = Ãv − l̃ + c b(v),   G(v) = Ã + diag(c b′(v))
with the right limits of b and b′ at a kink: one selection of ∂L̃(v) (Šestak & Jovanović, Appl. Math. Mech. 31 (2010),
§3, eqs. 20, 21). A node that slips is smooth and costs nothing; every sticking node is a direction in which L̃ is
nonsmooth and needs a subgradient of its own, so iterations grow with the number of sticking nodes. The separable
structure of Ψ is deliberately not used by the iteration. It is used to stop: once the predicted decrease is small, the
pieces that the nodes seem to rest on are tried (solution.py), and where they satisfy the inclusion (21) at no higher
energy the remaining iterations, which would only add digits, are left out.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tcstudy.contact.problem import ContactProblem, Outcome, Status
from tcstudy.contact.simplex_qp import ACTIVE, direction, dual_decrease, positive_definite
from tcstudy.contact.solution import polished

Array = NDArray[np.float64]

FAR = 4.0
"""Multiple of the radius beyond which a step is not worth completing."""
DAMPING = 5.0
"""Decrease of ρ_j per relative overestimate of f(x) by the piece's curvature."""
INNER, INNER_TOLERANCE = 40, 1e-3
"""Quadratic programmes per minimisation of the model at most; the relative change at which that
counts as minimised."""
PIVOT, LEAST_CURVATURE, LOOSER = 1e-8, 1e-2, 0.25
"""Smallest eigenvalue of W relative to its largest and, where no piece is curved, to (largest
slope)/(first length); factor of the latter after each full step, as W must not hold back steps
along pieces much flatter than the steepest."""


@dataclass(frozen=True, eq=False)
class Bundle:
    """What the oracle said at N points.

    y, f, g: (N, n) points, (N,) values, (N, n) subgradients
    G:       (N, n, n) second derivatives of the active pieces; with a base (N, n) the diagonals beside it
    base:    (n, n) symmetric B that all share, or None
    """

    y: Array
    f: Array
    g: Array
    G: Array
    base: Array | None = None

    def __len__(self) -> int:
        return len(self.f)

    @property
    def finite(self) -> bool:
        """True if f, g and G are all finite."""
        return all(bool(np.all(np.isfinite(x))) for x in (self.f, self.g, self.G))

    def take(self, which: NDArray[np.intp] | slice) -> Bundle:
        """The named ones."""
        return Bundle(self.y[which], self.f[which], self.g[which], self.G[which], self.base)

    def with_one(self, new: Bundle) -> Bundle:
        """These and others behind them."""
        y, f, g, G = (
            np.append(getattr(self, x), getattr(new, x), axis=0) for x in ("y", "f", "g", "G")
        )
        return Bundle(y, f, g, G, self.base)

    def times(self, d: Array) -> Array:
        """(N, n) G_j d_j, of rows d (N, n) or one d (n,) for all."""
        return np.asarray(
            (self.G @ d[..., None])[..., 0] if self.base is None else d @ self.base + self.G * d
        )

    def combined(self, weights: Array) -> Array:
        """(n, n) Σ w_j G_j as a new matrix."""
        if self.base is None:
            return np.asarray(np.tensordot(weights, self.G, 1))
        return weights.sum() * self.base + np.diag(weights @ self.G)


@dataclass(frozen=True, eq=False)
class Model:
    """The pieces about a centre.

    c:     (N,) −α_j
    A:     (N, n) g_j in rows
    rho:   (N,) ρ_j
    s:     (N,) localities
    curvature: ‖Σλ_jG_j‖₂ of the multipliers at hand
    """

    pieces: Bundle
    c: Array
    A: Array
    rho: Array
    s: Array
    curvature: float

    @classmethod
    def about(cls, x: Array, f: float, pieces: Bundle, gamma: float, curvature: float) -> Model:
        """About the centre x with value f: f_j, g_j, the largest ρ_j that keeps a piece at or below
        f, and −α_j.

        gamma: weight γ of distances
        """
        delta = x - pieces.y
        turn = pieces.times(delta)
        bend, linear = 0.5 * _rowwise(delta, turn), pieces.f + _rowwise(pieces.g, delta)
        over = linear + bend - f
        damped = (over > 0.0) & (bend > 0.0)
        rho = np.ones(len(pieces))
        rho[damped] = np.maximum(0.0, 1.0 - DAMPING * over[damped] / bend[damped])
        s = np.linalg.norm(delta, axis=1)
        alpha = np.maximum(np.abs(linear + rho * bend - f), gamma * curvature * s * s)
        return cls(pieces, -alpha, pieces.g + rho[:, None] * turn, rho, s, curvature)

    def bend(self, d: Array) -> Array:
        """(N, n) ρ_jG_jd."""
        return self.rho[:, None] * self.pieces.times(d)

    def value(self, d: Array) -> float:
        """max_j −α_j + g_jᵀd + ½ρ_j dᵀG_jd, the predicted change of f."""
        return float(np.max(self.c + self.A @ d + 0.5 * (self.bend(d) @ d)))


@dataclass(frozen=True)
class Step:
    """A minimiser of the model.

    d:         (n,) step
    lam:       (N,) multipliers
    decrease:  predicted decrease of f, −model(d) ≥ 0
    promise:   w = ½‖Σλ_jg_j‖²_{W⁻¹} + Σλ_jα_j of the first quadratic programme without shift: the published
               stopping quantity
    shift:     multiple μ of the identity that kept d within the radius, 0 if the radius did not bind
    factorisations: quadratic programmes solved, each with a factorisation of W
    """

    d: Array
    lam: Array
    decrease: float
    promise: float
    shift: float
    factorisations: int

    @property
    def length(self) -> float:
        """‖d‖."""
        return float(np.linalg.norm(self.d))


def _rowwise(a: Array, b: Array) -> Array:
    """(N,) a_jᵀb_j of the rows."""
    return np.asarray(np.sum(a * b, axis=1))


def minimise(model: Model, lam: Array, shift: float, unit: float, limit: float) -> Step:
    """A local minimiser of model + ½·shift·‖d‖² by repeated quadratic programmes with halving, from
    d = 0.

    limit: ends as soon as ‖d‖ exceeds this, because such a step will be rejected
    """

    def merit(d: Array) -> float:
        return model.value(d) + 0.5 * shift * float(d @ d)

    d = np.zeros(model.A.shape[1])
    best, used = merit(d), 0
    least = LEAST_CURVATURE * float(np.max(np.abs(model.A))) / unit
    promise = 0.0
    for used in range(1, INNER + 1):
        Gd = model.bend(d)
        metric = positive_definite(model.pieces.combined(lam * model.rho), shift, PIVOT, least)
        lam, q = direction(
            model.c + model.A @ d + 0.5 * (Gd @ d), model.A + Gd, shift * d, metric, lam
        )
        if used == 1:
            promise = dual_decrease(model.c, model.A, lam, metric)
        t = 1.0
        while t > 1e-15 and not (trial := merit(d + t * q)) < best:
            t *= 0.5
        if t <= 1e-15:
            if used > 1:
                break
            continue
        d = d + t * q
        least *= LOOSER if t == 1.0 else 1.0
        small = t * np.linalg.norm(q) <= INNER_TOLERANCE * np.linalg.norm(d)
        flat = best - trial <= INNER_TOLERANCE * abs(trial)
        best = trial
        if (used > 1 and (small or flat)) or np.linalg.norm(d) > limit:
            break
    return Step(d, lam, -model.value(d), promise, shift, used)


def bounded_step(
    model: Model, lam: Array, radius: float, unit: float, likely_shift: float = 0.0
) -> Step:
    """The model's minimiser, shifted by the smallest μI found that keeps ‖d‖ ≤ 1.2·radius (μ by
    bisection).

    likely_shift: μ of the step before, tried second
    A nonconvex model may jump past the radius as μ falls; then the longest step found below it
    counts.
    """
    far = FAR * radius
    step = minimise(model, lam, 0.0, unit, far)
    used, promise, inside = step.factorisations, step.promise, None
    shift, low, high = 0.0, 0.0, np.inf
    for _ in range(25):
        failed = step.length == 0.0 < promise
        if step.length > 1.2 * radius or failed:
            low = shift
        else:
            inside, high = step, shift
            if shift == 0.0 or step.length >= 0.6 * radius or high <= 1e-6 * model.curvature:
                break
        if high < 1.3 * low:
            break
        if np.isfinite(high):
            shift = float(np.sqrt(high * max(low, 1e-3 * high)))
        elif shift == 0.0 < likely_shift and not failed:
            shift = likely_shift
        else:
            slope = float(np.max(np.abs(model.A)) if failed else np.linalg.norm(step.lam @ model.A))
            shift = max(slope / radius, 10.0 * shift)
        step = minimise(model, lam, shift, unit, far)
        used += step.factorisations
    if inside is None:  # too long: shortened to the radius and on until the model falls
        t = min(1.0, radius / step.length) if step.length > 0.0 else 0.0
        while t > 1e-15 and model.value(t * step.d) >= 0.0:
            t *= 0.5
        inside = replace(step, d=t * step.d, decrease=-model.value(t * step.d))
    return replace(inside, promise=promise, factorisations=used)


Oracle = Callable[[Array], tuple[float, Array, Array]]
Kind = Literal["start", "serious", "null", "short", "reset"]

M_L, M_R = 0.01, 0.5
"""Shares of the predicted decrease for a serious step and for a useful null step."""
IDENTIFY, EVERY = 1e-4, 10
"""Decrease predicted within the radius, relative to |f|, below which an exact end is tried;
evaluations between two trials."""


class State(NamedTuple):
    """What a run is watched by: the centre, its value and what led there."""

    kind: Kind
    x: Array
    f: float


@dataclass(eq=False)
class BundleNewton:
    """The method with its options, and where its run is.

    tolerance:      predicted decrease relative to |f| (+ 10⁻³ of the decrease so far) at which to stop
    max_iterations: limit of steps, each with at most one evaluation and INNER quadratic programmes on average
    x_unit:         length by which to bound the first step (None: ‖x0‖; from f, g and G if x0 = 0)
    gamma:          weight γ of the distance in the locality measure
    base:           (n, n) B where the oracle returns the diagonals h of G = B + diag(h)

    A run has its centre x with f there, the bundle `pieces`, of which one lies at x, with
    multipliers lam (N,), the radius that bounds the next step, the model about x and its minimiser
    `step`; resets since the last serious step; evaluations and quadratic programmes so far.
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
        exact: Callable[[Array, float], Array | None] | None = None,
        watch: Callable[[State], None] | None = None,
    ) -> Outcome:
        """Steps from x0 until the model promises no more decrease or their limit is met.

        exact: (x, decrease left) → the exact minimum beside x, if it is found;  watch: called with every state
        """
        self.oracle, self.evaluations, self.programmes = oracle, 0, 0
        first = self.evaluated(x0)
        if not first.finite:
            reason = "f, g or G is not finite at the start; start from another point"
            return Outcome(x0, float(first.f[0]), Status.NOT_FINITE, reason, 0, 1)
        self.x, self.f, self.f0, self.resets, self.shift = (
            first.y[0],
            float(first.f[0]),
            float(first.f[0]),
            0,
            0.0,
        )
        self.unit = self.x_unit or first_unit(first)
        self.redirect("start", first, np.ones(1), self.unit)
        self.promised = max(self.step.promise, self.step.decrease)
        for iteration in range(self.max_iterations + 1):
            if watch is not None:
                watch(State(self.kind, self.x, self.f))
            ended = self.verdict()
            x, f, left = self.x, self.f, IDENTIFY * self.scale
            due = self.evaluations % EVERY == 0 if ended is None else ended[0] == Status.CONVERGED
            if (
                exact is not None
                and due
                and self.step.decrease <= left
                and (found := exact(x, left)) is not None
            ):
                x, f, ended = (
                    found,
                    oracle(found)[0],
                    ended or (Status.CONVERGED, "on the exact active pieces"),
                )
            if ended is None and iteration == self.max_iterations:
                reason = (
                    f"no solution within {iteration} iterations; start from a neighbouring solution, "
                    "use another solver, or allow bundle-newton more (max_iterations)"
                )
                ended = Status.ITERATION_LIMIT, reason
            if ended is not None:
                return Outcome(x, f, *ended, iteration, self.evaluations)
            self.advance()
        raise AssertionError

    @property
    def scale(self) -> float:
        """What the predicted decrease is compared with: |f| and a share of the decrease so far, if
        not both are 0."""
        return float(abs(self.f) + 1e-3 * (self.f0 - self.f)) or self.promised

    @property
    def accuracy(self) -> float:
        """Predicted decrease relative to `scale`."""
        predicted = max(self.step.decrease, self.step.promise)
        return predicted / self.scale if self.scale > 0.0 else np.inf if predicted else 0.0

    def evaluated(self, y: Array) -> Bundle:
        """The piece of y."""
        f, g, G = self.oracle(y)
        self.evaluations += 1
        g, G = np.asarray(g, dtype=float), np.asarray(G, dtype=float)
        return Bundle(y[None], np.array([f], dtype=float), g[None], G[None], self.base)

    def redirect(self, kind: Kind, pieces: Bundle, lam: Array, radius: float) -> None:
        """The direction that follows from a bundle and a radius."""
        curvature = float(np.max(np.abs(np.linalg.eigvalsh(pieces.combined(lam)))))  # ‖Σλ_jG_j‖₂
        self.model = Model.about(self.x, self.f, pieces, self.gamma, curvature)
        self.step = bounded_step(self.model, lam, radius, max(radius, self.unit), self.shift)
        self.kind, self.pieces, self.lam, self.radius, self.shift = (
            kind,
            pieces,
            self.step.lam,
            radius,
            self.step.shift,
        )
        self.programmes += self.step.factorisations

    def advance(self) -> None:
        """One serious, null, short or reset step (see the head of this file)."""
        if self.accuracy <= self.tolerance:
            return self.reset()
        pieces, lam, radius, step, length = (
            self.pieces,
            self.lam,
            self.radius,
            self.step,
            self.step.length,
        )
        new = self.evaluated(self.x + step.d)
        if not new.finite:
            return self.redirect("short", pieces, lam, 0.25 * length)
        f = float(new.f[0])
        ratio = (self.f - f) / step.decrease
        if ratio < M_L:
            # shorter if the new piece hardly changes the model at d
            alone = Model.about(self.x, self.f, new, self.gamma, self.model.curvature)
            if alone.value(step.d) < -M_R * step.decrease:
                radius = 0.5 * min(radius, length)
            return self.redirect("null", *self.selected(new), radius)
        radius = 0.5 * min(radius, length) if ratio < 0.1 else radius
        radius = max(radius, 4.0 * length if ratio > 0.9 else 2.0 * length if ratio > 0.5 else 0.0)
        chosen = self.selected(new)
        self.x, self.f, self.resets = new.y[0], f, 0
        return self.redirect("serious", *chosen, radius)

    def selected(self, new: Bundle) -> tuple[Bundle, Array]:
        """The next bundle with `new` last, and multipliers for it to start from.

        Beyond 2n + 5 pieces the oldest inactive ones leave.
        """
        pieces, lam = self.pieces, self.lam
        idle = np.flatnonzero((lam <= ACTIVE) & (self.model.s > 0.0))
        leaving = idle[: max(0, len(pieces) - 2 * len(self.x) - 4)]
        kept = np.setdiff1d(np.arange(len(pieces)), leaving)
        lam = np.append(lam[kept], 0.0)
        return pieces.take(kept).with_one(new), lam / lam.sum()

    def remote(self) -> NDArray[np.bool_]:
        """(N,) active pieces whose origin is too far away to prove stationarity."""
        return (self.lam > ACTIVE) & (
            self.model.curvature * self.model.s**2 > 1e4 * self.tolerance * self.scale
        )

    def reset(self) -> None:
        """Drop the remote active pieces and look for them again within the distance that proves
        stationarity."""
        keep = np.flatnonzero(~self.remote())
        nearby = float(np.sqrt(1e4 * self.tolerance * self.scale / self.model.curvature))
        self.resets += 1
        # steps may exceed the radius a little; what they find must not be remote again
        self.redirect(
            "reset", self.pieces.take(keep), np.full(len(keep), 1.0 / len(keep)), 0.5 * nearby
        )

    def verdict(self) -> tuple[Status, str] | None:
        """None to go on, else why to stop; converged: predicted decrease ≤ tolerance by pieces from
        nearby."""
        predicted = f"predicted decrease {self.accuracy:.1e} of |f|"
        if self.accuracy <= self.tolerance:
            if not np.any(self.remote()):
                return Status.CONVERGED, f"{predicted}, by pieces from nearby"
            if self.resets <= 10 + len(self.x):
                return None
            searches = f"only by pieces from too far away, and {self.resets} searches nearby found no others"
            return Status.STALLED, f"{predicted}, but {searches}; allow a larger tolerance"
        if self.programmes > INNER * self.max_iterations:
            return Status.ITERATION_LIMIT, (
                f"{self.programmes} quadratic programmes, more than {INNER} for each of {self.max_iterations} "
                f"iterations, at a {predicted}; allow more (max_iterations) or a larger tolerance"
            )
        if self.radius > 1e12 * self.unit:
            reason = f"f still falls at a distance of {self.radius:.1e}: it may be unbounded below; check its growth"
            return Status.UNBOUNDED, reason
        if self.step.decrease <= 0.0 or self.step.length <= 4 * np.finfo(float).eps * float(
            np.linalg.norm(self.x)
        ):
            return Status.STALLED, (
                f"steps have shrunk to rounding level at a {predicted}; "
                "check g and G against differences of f, or allow a larger tolerance"
            )
        return None


def first_unit(piece: Bundle) -> float:
    """A length to begin with: ‖x0‖, else ‖g‖/‖G‖, else |f|/‖g‖; 1 where the data hold no scale at
    all."""
    slope, bend = float(np.linalg.norm(piece.g)), float(np.linalg.norm(piece.combined(np.ones(1))))
    for length, per in (
        (float(np.linalg.norm(piece.y)), 1.0),
        (slope, bend),
        (abs(float(piece.f[0])), slope),
    ):
        if length > 0.0 and per > 0.0:
            return length / per
    return 1.0


def contact_oracle(problem: ContactProblem) -> Oracle:
    """v (m,) [m] → L̃(v) [J/m], one g ∈ ∂L̃(v) (m,) [N/m], the diagonal that Ã lacks of G (m,)
    [Pa]."""
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
    inclusion: float | None = 1e-12,
    tolerance: float = 1e-13,
) -> Outcome:
    """Run the method on the contact problem from x0 (m,) [m].

    inclusion: inclusion residual to work for on the active pieces, as far as rounding allows it;
    None: without these tolerance: of the energy; the error of v and of ξ is of the order of its
    root The first length is the norm of the frictionless solution, or the law's slip scale.
    """

    def exact(x: Array, left: float) -> Array | None:
        """The point on the active pieces, if it satisfies the inclusion and only adds digits.

        Its energy must not be higher, nor lower by more than `left`: the descent is the bundle's.
        """
        end = polished(problem, x, exact=False)
        change = problem.energy_change(x, end.v)[0]
        good = end.residual <= max(inclusion or 0.0, problem.xi_rounding(end.v))
        return end.v if good and -left <= change <= 0.0 else None

    length = float(np.linalg.norm(problem.frictionless())) or problem.law.s_scale
    method = BundleNewton(tolerance, max_iterations or 2000, length or None, base=problem.A_tilde)
    return method.run(contact_oracle(problem), x0, None if inclusion is None else exact)
