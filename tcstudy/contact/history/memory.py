"""The memories of a contact line: from the state of every node to the law of its next step, and a
step's energies.

Each law is the derivative of min over the new internal variable of stored + dissipated energy: one
step of backward Euler is one contact problem (`Memory` in scene/histories.py has the laws). With w
= v − a, a the last or the plastic slip, and the load l̃ − Ãa, friction without softening is one law
at all steps, and w has more digits than v.

friction:        j = T(κ + |w|) − T(κ), T = ∫τ; nothing is stored
elastic-plastic: j = ½ k (|w| − Δp)² + T(κ + Δp) − T(κ) with k (|w| − Δp) = τ(κ + Δp) or Δp = 0; where τ has the slope
                 q the law rises or falls by k q/(k + q)
damage:          j = ½ τ(κ) s²/κ, beyond κ ½ τ(κ) κ + T(|s|) − T(κ); dissipated R = T(κ) − ½ τ(κ) κ. Where the law
                 rises straight from 0 nothing is damaged: κ counts from the end of that elastic
                 branch on
Literature: scene/histories.py; energies: Freddi & Riva, Math. Eng. 7 (2025) 406.

Step n:     0 ∈ Ãvⁿ − l̃ⁿ + ∂Σ c_i j_iⁿ(v_i), ξⁿ = l̃ⁿ − Ãvⁿ, ξ_iⁿ/c_i ∈ b̂_iⁿ(v_iⁿ), the laws as above
Energies:   E = ½ vᵀÃv − l̃ᵀv of the body, B = Σ c stored in bonds, D = Σ c dissipated in the step
Identity:   ΔE + ½ (vⁿ + vⁿ⁻¹)ᵀΔl̃ = −½ (ξⁿ + ξⁿ⁻¹)ᵀΔv, to rounding, whatever the law
Closure:    ½ (ξⁿ + ξⁿ⁻¹)ᵀΔv − ΔB − D, what a step misses by being finite; it falls like its square
So ΔE + ΔB + D + closure + released = work, work = −½ (vⁿ + vⁿ⁻¹)ᵀΔl̃, sums over the parts of a step where it has any.
Two-sided estimate: −Δl̃ᵀvⁿ ≤ ΔE + ΔB + D ≤ −Δl̃ᵀvⁿ⁻¹, the upper bound for every descent from vⁿ⁻¹, the lower one
where vⁿ⁻¹ was a global minimum. Literature: Mielke, Evolution of rate-independent systems (2005), §5.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from tcstudy.contact.certificates import (
    certify,
    far,
    least_slopes,
    positive_definite,
    strict_minimum,
)
from tcstudy.contact.path.problem import ScaledBody
from tcstudy.contact.problem import CondensedBody, ContactProblem, Status, kept, least_lowered
from tcstudy.contact.solve import Answer
from tcstudy.laws.composed import piecewise_linear
from tcstudy.laws.laws import Laws
from tcstudy.scene.histories import MEMORIES, HistoryBranch, Memory

Array = NDArray[np.float64]
Index = NDArray[np.intp]
Flags = NDArray[np.bool_]
Tail = tuple[Index, Array, Array]
"""(count, starts, pieces) of τ beyond a slip: (n,) pieces of each node, (n, P) slips at which they
begin [m], and (5 or 7, n, P) their s_0, b_0, q, a, r, a_2, r_2; rows are filled with their last
piece."""

NARROW = 64 * float(np.finfo(float).eps)
"""A node nearer than this to the next kink of its law, relative to its κ, has reached it."""
LAW_ERROR, FADED = 1e-4, 1e3
"""Of the straight pieces in the place of exponential ones; and decay lengths after which nothing is
left of one."""
UNTOUCHED = 1e-12
"""Slips below this part of the law's scale damage nothing."""
MIRROR = np.array([-1.0, -1.0, 1.0, -1.0, -1.0, -1.0, -1.0])[:, None, None]
"""Signs of s_0, b_0, q, a, r, a_2, r_2 in the mirrored piece −b(−s)."""


@dataclass(frozen=True)
class NodeState:
    """What the m nodes remember.

    v:       (m,) slip [m]
    kappa:   (m,) accumulated slip, accumulated plastic slip or largest slip [m]
    plastic: (m,) plastic slip p, 0 for the other memories [m]
    """

    v: Array
    kappa: Array
    plastic: Array


@dataclass(frozen=True)
class MemoryModel:
    """A memory of a body's contact line.

    memory: which one;  law: of the scene, whose s > 0 is the virgin curve;  m: nodes
    names:  (m,) which memory every node has, if they differ
    slides, yields, tears: (m,) nodes with the memory `friction`, `elastic-plastic`, `damage`
    Raises UnfitLaw if the memory cannot be made of the law.
    """

    memory: Memory
    law: Laws
    m: int
    names: NDArray[np.str_] | None = None
    slides: Flags = field(init=False)
    yields: Flags = field(init=False)
    tears: Flags = field(init=False)

    def __post_init__(self) -> None:
        names = np.full(self.m, self.memory.name) if self.names is None else self.names
        for own, nodes in self.law.groups(self.m):
            for name in np.unique(names[nodes]).tolist():
                replace(self.memory, name=name).check(own)
        for flags, memory in zip(("slides", "yields", "tears"), MEMORIES, strict=True):
            object.__setattr__(self, flags, names == memory)

    @property
    def remembers(self) -> bool:
        """False where every way leads back as well."""
        return self.memory.name != "none"

    @property
    def _k(self) -> float:
        """Stiffness of elastic-plastic bonds [Pa/m]."""
        return self.memory.stiffness or np.inf

    @cached_property
    def omega(self) -> Array:
        """(m,) steepest fall of any step's law [Pa/m]."""
        found, at = self._own.falls[self._own.index], self.yields
        found[at] = self._k * found[at] / (self._k - found[at])
        return found

    @cached_property
    def elastic(self) -> Array:
        """(m,) end of the branch on which the law rises straight from 0, which damages nothing; 0
        without one [m]."""
        first = self._own.piece(np.zeros(self.m))
        s_0, b_0, q, *decays = self._own.numbers(first)
        end = self._own.upper.take(first)
        rises = (b_0 == q * s_0) & (q > 0.0) & ~np.any(decays[::2], axis=0) & np.isfinite(end)
        return np.where(rises & self.tears, end, 0.0)

    @cached_property
    def unchanged(self) -> bool:
        """True if the law in w = v − a is the scene's own at every step: nothing softens, or
        nothing is remembered."""
        count, _, pieces = _tail(self._own, np.zeros(self.m))
        return not self.remembers or bool(
            np.all(self.slides & (count == 1)) and not np.any(pieces[2:4])
        )

    @cached_property
    def _own(self) -> Laws:
        return self.law.tables.at(self.law.node_index(self.m))

    @cached_property
    def _straight(self) -> Laws:
        """τ for s > 0 in straight pieces."""
        return self.law.mapped(_chords).tables.at(self._own.index)

    def origin(self, state: NodeState) -> Array:
        """(m,) a: slips from which w is counted [m]."""
        return np.where(self.slides, state.v, np.where(self.yields, state.plastic, 0.0))

    def next_law(self, state: NodeState, straight: bool = False) -> Laws:
        """The law of w = v − a in the step from this state, or straight pieces in its place.

        Every node's is odd: ±τ(κ + |w|) with an up-jump at the last slip; elastic to τ(κ)/k, then
        on along the virgin curve; or the secant to (κ, τ(κ)), then the virgin curve, the virgin law
        itself where nothing has slipped.
        """
        straight = straight and not self.law.piecewise_linear
        if self.unchanged and not straight:
            return self.law
        kappa = np.maximum(state.kappa, self.elastic)
        count, starts, pieces = self._chords_on(kappa) if straight else _tail(self._own, kappa)
        moved = np.where(self.tears, 0.0, kappa)[:, None]
        starts, pieces[0], centre = starts - moved, pieces[0] - moved, np.full(self.m, np.nan)
        if np.any(self.yields):
            starts, pieces = self._in_series(starts, pieces)
            centre[self.yields & (pieces[1][:, 0] > 0.0)] = self._k
        torn = self.tears & (kappa > 0.0)
        centre[torn] = self.law.b(kappa, -1)[torn] / kappa[torn]
        return self._odd(count, starts, pieces, centre)

    def _in_series(self, starts: Array, pieces: Array) -> tuple[Array, Array]:
        """The tail of τ(κ + x) behind the spring of elastic-plastic nodes: slopes q become k q/(k +
        q)."""
        k, yields = self._k, self.yields[:, None]
        tau = pieces[1] + pieces[2] * (starts - pieces[0])
        starts, turned = np.where(yields, starts + tau / k, starts), 0.0 * pieces
        turned[:3] = starts, tau, k * pieces[2] / np.where(yields, k + pieces[2], 1.0)
        return starts, np.where(yields, turned, pieces)

    def _chords_on(self, kappa: Array) -> Tail:
        """The tail in straight pieces; where they stand for a curve a node begins on the curve
        itself."""
        own, law = self._own, self._straight
        count, starts, pieces = _tail(law, kappa)
        end, curved = (
            law.upper.take(law.piece(_reached(kappa))),
            np.any(own.bent, axis=1)[own.index],
        )
        begin, (s_0, b_0, q) = own.value(kappa, own.piece(_reached(kappa))), pieces[:3, :, 0]
        inner = curved & np.isfinite(end)
        there = b_0 + q * (np.where(inner, end, kappa) - s_0)
        slope = np.divide(there - begin, end - kappa, out=q.copy(), where=inner)
        pieces[:3, :, 0] = np.where(curved, (kappa, begin, slope), pieces[:3, :, 0])
        return count, starts, pieces

    def _odd(self, count: Index, starts: Array, pieces: Array, centre: Array) -> Laws:
        """The laws of all nodes from their pieces for w > 0 and the slope of one through 0, NaN for
        a jump or a bend.

        What a film has lost does not make its residuals larger: its scale is that before anything
        was forgotten.
        """
        (n, P), N, middle = (
            starts.shape,
            count[:, None],
            np.isfinite(centre)[:, None].astype(np.intp),
        )
        column, row = (
            np.arange(2 * P + int(np.max(middle, initial=0)))[None, :],
            np.arange(n)[:, None],
        )
        left, inner = column < N, (column == N) & (middle == 1)
        at = np.where(left, N - 1 - column, np.clip(column - N - middle, 0, N - 1))
        pieces = pieces[:, row, at] * np.where(left, MIRROR[: len(pieces)], 1.0)
        pieces = np.where(inner, 0.0, pieces)
        pieces[2] = np.where(inner, centre[:, None], pieces[2])
        column = column[:, :-1]
        below = column < N - 1 + middle
        at = np.where(below, N - 1 - column, np.clip(column - N + 1 - middle, 0, N - 1))
        kinks = starts[row, at] * np.where(below, -1.0, 1.0)
        kinks = np.where(column < 2 * N - 1 + middle, kinks, np.inf)
        found = Laws("row", kinks, *(pieces + 0.0), index=np.arange(n, dtype=np.intp))
        return found.known(scales=np.full(n, self.law.b_scale), falls=self.omega)

    def after(self, state: NodeState, w: Array) -> tuple[NodeState, Array, Array]:
        """What the step to v = a + w leaves behind: the state, and per length stored and dissipated
        energies [J/m²]."""
        v, kappa, plastic = self.origin(state) + w, state.kappa, state.plastic
        if not self.remembers:
            return NodeState(v, kappa, plastic), self.law.j(v), np.zeros(self.m)
        flow, force = self._flow(state, w)
        least = UNTOUCHED * (self.law.s_scale or float(np.max(np.abs(v), initial=0.0)))
        largest = np.where(
            np.maximum(kappa, np.abs(v)) > np.maximum(kappa, least), np.abs(v), kappa
        )
        kappa = np.where(self.tears, largest, kappa + flow)
        before, now = np.maximum(state.kappa, self.elastic), np.maximum(kappa, self.elastic)
        old, tau = (
            np.where(self.tears & (at > 0.0), self.law.b(at, -1), 0.0) for at in (before, now)
        )
        lost = self.law.integral(before, now) - 0.5 * (tau * now - old * before)
        lost = np.where(self.tears, np.where(now > before, np.maximum(lost, 0.0), 0.0), lost)
        stored = 0.5 * tau / np.where(now > 0.0, now, 1.0) * v**2 + 0.5 * force**2 / self._k
        return (
            NodeState(v, kappa, plastic + np.where(self.yields, np.sign(w) * flow, 0.0)),
            stored,
            lost,
        )

    def _flow(self, state: NodeState, w: Array) -> tuple[Array, Array]:
        """(Δp, force) (m,): of friction |w|, 0; of elastic-plastic bonds force = b(w), Δp = |w| −
        force/k; else 0."""
        flow = np.where(self.slides, np.abs(w), 0.0)
        if not np.any(self.yields):
            return flow, 0.0 * flow
        force = np.where(self.yields, np.abs(self.next_law(state).b(w)), 0.0)
        beyond = np.abs(w) - force / self._k
        return np.where(self.yields & (beyond > NARROW * np.abs(w)), beyond, flow), force


def _reached(kappa: Array) -> Array:
    return kappa * (1.0 + NARROW)


def _tail(law: Laws, kappa: Array) -> Tail:
    """τ beyond κ (n,) of laws by node: the piece on which a node goes on from there, and all after
    it."""
    first = law.piece(_reached(kappa))
    count = (
        np.count_nonzero(np.isfinite(law.kinks), axis=1)[law.index]
        + 1
        - (first - law.first[law.index])
    )
    at = first[:, None] + np.minimum(np.arange(np.max(count, initial=1)), count[:, None] - 1)
    starts = np.maximum(law.lower.take(at), kappa[:, None])
    starts[:, 0] = kappa
    return count, starts, np.stack(law.numbers(at))


def _chords(law: Laws) -> Laws:
    """τ for s > 0 in straight pieces between points of the law, which miss it by LAW_ERROR of its
    scale at most."""
    if law.piecewise_linear:
        return law
    reach = float(np.max(law.kinks, initial=0.0)) + FADED / float(np.min(law.rate[law.bent]))
    kinks = piecewise_linear(law, 0.5 * LAW_ERROR, reach).kinks
    s = np.concatenate([[0.0], kinks[kinks > 0.0]])
    piece, none = law.piece(s), np.zeros(len(s))
    b, q = law.value(s, piece), law.q[piece]
    q[:-1] = (law.value(s[1:], piece[:-1]) - b[:-1]) / np.diff(s)
    return Laws(law.name, s[1:], s, b, q, none, none)


SUMS = ("work", "dissipated", "dissipation", "closure", "released", "parts", "iterations", "jumps")
"""Numbers of a step that are sums over its parts."""
NOBODY = np.False_
UNDETERMINED = (
    "all nodes slide at their limit, so that how far the body has moved as a whole is not determined: put a contact "
    "node where the slip changes its direction (another number of elements)"
)


@dataclass(frozen=True)
class HistoryStep(NodeState):
    """A step: all that a file has of it and all that the next one needs, beginning with what the
    nodes remember.

    load:       (m,) l̃ [N/m];  xi: (m,) ξ/c [Pa];  dissipation: (m,) what the bond has dissipated in the step [J/m²]
    stored:     B;  energy: E [J/m]
    work:       −½ (vⁿ + vⁿ⁻¹)ᵀΔl̃, what the change of the loads did;  dissipated: D ≥ 0
    closure:    what finite steps miss;  released: lost at jumps, ≥ 0 [J/m]
    identity:   largest defect of the identity of all parts, relative to the terms it is made of: rounding
    parts:      contact problems solved or pieces of a path followed;  iterations: of the solvers
    jumps:      their number;  jumped: (m,) nodes that a jump has moved
    inclusion_residual, inclusion_rounding: of the last part, and what rounding allows of it
    unique, strict_minimum, global_minimum: proved for the last part
    status, reason: CONVERGED, or why the history ends here
    """

    load: Array
    xi: Array
    dissipation: Array
    stored: float = 0.0
    energy: float = 0.0
    work: float = 0.0
    dissipated: float = 0.0
    closure: float = 0.0
    released: float = 0.0
    identity: float = 0.0
    parts: int = 0
    iterations: int = 0
    jumps: int = 0
    jumped: NDArray[np.bool_] | np.bool_ = NOBODY
    inclusion_residual: float = 0.0
    inclusion_rounding: float = 0.0
    unique: bool = False
    strict_minimum: bool = False
    global_minimum: bool = False
    status: Status = Status.CONVERGED
    reason: str = ""

    @property
    def solved(self) -> bool:
        """Whether the step has a solution."""
        return self.status == Status.CONVERGED

    @classmethod
    def virgin(cls, m: int) -> HistoryStep:
        """Before any load."""
        return cls(*np.zeros((6, m)))

    def unchanged(self) -> HistoryStep:
        """The step after this one to the same load: nothing happens in it."""
        none = {name: 0 * getattr(self, name) for name in SUMS}
        return replace(self, **none, identity=0.0, jumped=NOBODY)

    def then(self, part: HistoryStep) -> HistoryStep:
        """This and a further part of the same step."""
        sums = {name: getattr(self, name) + getattr(part, name) for name in SUMS}
        return replace(
            part,
            identity=max(self.identity, part.identity),
            jumped=self.jumped | part.jumped,
            **sums,
        )


@dataclass(frozen=True)
class HistoryProblem:
    """What all steps share.

    body:       Ã and c; a body that nothing but friction holds is a loose one, with Ã only semidefinite
    model:      the scene's law and what is remembered of it
    branch:     "lowest": lowest found of the step from all starts; "continued": along its path (steps.py)
    tolerance:  of the inclusion residual, as in `solve_contact`
    max_pieces: of a path that is followed at once
    """

    body: CondensedBody
    model: MemoryModel
    branch: HistoryBranch = "continued"
    tolerance: float | None = None
    max_pieces: int = 20_000

    @cached_property
    def margin(self) -> float:
        """λ_min(C^{−½}ÃC^{−½} − diag ω_i) [Pa/m], λ₁ − ω where all nodes have one law."""
        omega, share = self.model.omega, kept(self.body.A_error)
        if np.any(omega != omega[:1]):
            return least_lowered(share * self.body.A_tilde, self.body.c, omega)
        return share * self.body.lambda_1 - float(np.max(omega, initial=0.0))

    @cached_property
    def convex(self) -> bool:
        """True if every step has one solution, whatever its load."""
        return not self.body.loose and self.margin > self.body.shift

    @cached_property
    def monotone(self) -> bool:
        """True if no law falls, so that every solution has the least energy."""
        return not np.any(self.model.omega)

    def one_solution(self, law: Laws) -> bool:
        """Whether a step with these laws, as the memory has moved them, has one solution or a
        connected set of them."""
        if self.convex or self.monotone:
            return True
        reach = far(law)[law.node_index(self.body.m)]
        slope = least_slopes(law, -reach, reach)
        problem = ContactProblem.on(self.body, np.zeros(self.body.m), law)
        return bool(np.all(slope >= 0.0)) or positive_definite(problem, slope, self.body.lambda_1)

    @cached_property
    def scaled(self) -> ScaledBody:
        """Ã as paths have it."""
        return ScaledBody.of(self.body.A_tilde, not self.body.loose)

    def energy(self, v: Array, load: Array) -> float:
        """E = ½ vᵀÃv − l̃ᵀv [J/m]."""
        return float(0.5 * v @ (self.body.A_tilde @ v) - load @ v)


def booked(
    p: HistoryProblem,
    last: HistoryStep,
    load: Array,
    answer: Answer,
    way: tuple[float, float] | None = None,
) -> HistoryStep:
    """The step or part of one to a solution w (m,) of its problem, with its energies.

    way: work and ∫ξᵀdv of a path from the last state that is known between its ends; else it is
    taken as straight
    """
    c, (state, stored_by_node, dissipation) = p.body.c, p.model.after(last, answer.v)
    v, xi, stored, dissipated = (
        state.v,
        answer.xi / c,
        float(c @ stored_by_node),
        float(c @ dissipation),
    )
    energy, size = p.energy(v, load), _size(p.body, v, load) + _size(p.body, last.v, last.load)
    straight = (
        -0.5 * float((v + last.v) @ (load - last.load)),
        0.5 * float((c * (xi + last.xi)) @ (v - last.v)),
    )
    work, friction = straight if way is None else way
    defect = abs(energy - last.energy - work + friction)
    return HistoryStep(
        v,
        state.kappa,
        state.plastic,
        load,
        xi,
        dissipation,
        stored,
        energy,
        work,
        dissipated,
        closure=friction - (stored - last.stored) - dissipated,
        identity=defect / (size or 1.0),
        parts=1,
        iterations=answer.iterations,
        inclusion_residual=answer.inclusion_residual,
        inclusion_rounding=answer.rounding,
        status=answer.status,
        reason=answer.reason,
    )


def _size(body: CondensedBody, v: Array, load: Array) -> float:
    """Of the terms that E is made of: |v|ᵀ|Ã||v| + |l̃|ᵀ|v| [J/m]."""
    size = np.abs(v)
    return float(size @ (np.abs(body.A_tilde) @ size) + np.abs(load) @ size)


def proved(
    p: HistoryProblem, problem: ContactProblem, answer: Answer, step: HistoryStep
) -> HistoryStep:
    """The step with its certificates; a loose body whose motion as a whole is free has none, and
    fails."""
    if p.convex:
        return replace(step, unique=True, strict_minimum=True, global_minimum=True)
    if p.monotone or p.body.loose:
        strict = bool(strict_minimum(problem.rows, answer.v[None])[0])
        if p.body.loose and not strict:
            return replace(step, status=Status.NOT_POSITIVE_DEFINITE, reason=UNDETERMINED)
        return replace(
            step, unique=strict and p.monotone, strict_minimum=strict, global_minimum=p.monotone
        )
    body, residual = p.body, answer.inclusion_residual
    proof = certify(
        problem, answer.v, body.lambda_1, p.tolerance, inverse=body.inverse, residual=residual
    )
    return replace(
        step,
        unique=proof.unique,
        strict_minimum=proof.strict_minimum,
        global_minimum=proof.global_minimum,
    )
