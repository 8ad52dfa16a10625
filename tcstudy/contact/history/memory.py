"""Memories of a contact line: the law of the next step from the state of every node, and energies.

Each law is the derivative of min over the new internal variable of stored + dissipated energy. One
step of backward Euler is one contact problem (`Memory` in scene/histories.py has the laws). With
w = v − a, a the last or the plastic slip, and the load l̃ − Ãa, friction without softening is one
law at all steps, and w has more digits than v.

friction:        j = T(κ + |w|) − T(κ), T = ∫τ; nothing is stored
elastic-plastic: j = ½ k (|w| − Δp)² + T(κ + Δp) − T(κ) with k (|w| − Δp) = τ(κ + Δp) or Δp = 0;
                 where τ has the slope q the law has the slope k q/(k + q)
damage:          j = ½ τ(κ) s²/κ, beyond κ ½ τ(κ) κ + T(|s|) − T(κ); dissipated
                 R = T(κ) − ½ τ(κ) κ. An initial elastic branch damages nothing: κ counts from its
                 end on. Of an opening κ is the largest one, and what closes it stays as it is:
                 a ray, or j = ½ k_c s² for s < 0
Literature: scene/histories.py; energies: Freddi & Riva, Math. Eng. 7 (2025) 406.

Step n:     0 ∈ Ãvⁿ − l̃ⁿ + ∂Σ c_i j_iⁿ(v_i), ξⁿ = l̃ⁿ − Ãvⁿ, ξ_iⁿ/c_i ∈ b̂_iⁿ(v_iⁿ), the laws as
            above
Energies:   E = ½ vᵀÃv − l̃ᵀv of the body, B = Σ c stored in bonds, D = Σ c dissipated in the step
Identity:   ΔE + ½ (vⁿ + vⁿ⁻¹)ᵀΔl̃ = −½ (ξⁿ + ξⁿ⁻¹)ᵀΔv, to rounding, whatever the law
Closure:    ½ (ξⁿ + ξⁿ⁻¹)ᵀΔv − ΔB − D, the time-discretisation energy defect; it falls like the
            square of the step
So ΔE + ΔB + D + closure + released = work, work = −½ (vⁿ + vⁿ⁻¹)ᵀΔl̃, sums over the parts of a
step where it has any.
Two-sided estimate: −Δl̃ᵀvⁿ ≤ ΔE + ΔB + D ≤ −Δl̃ᵀvⁿ⁻¹. The upper bound holds for every descent from
vⁿ⁻¹, the lower one where vⁿ⁻¹ was a global minimum. Literature: Mielke, Evolution of
rate-independent systems (2005), §5.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import NamedTuple

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
from tcstudy.contact.problem import (
    CondensedBody,
    ContactProblem,
    Status,
    least_lowered,
    trusted_share,
)
from tcstudy.contact.solve import Answer
from tcstudy.laws.composed import piecewise_linear
from tcstudy.laws.laws import Laws
from tcstudy.scene.histories import MEMORIES, HistoryBranch, Memory

Array = NDArray[np.float64]
Index = NDArray[np.intp]
Flags = NDArray[np.bool_]

NARROW = 64 * float(np.finfo(float).eps)
"""A node nearer than this to the next kink of its law, relative to its κ, has reached it."""
LAW_ERROR = 1e-4
"""Largest error of straight pieces in place of exponential ones, relative to the law's scale."""
DECAY_LENGTHS = 1e3
"""Decay lengths after which an exponential has vanished."""
MIN_DAMAGING_SLIP = 1e-12
"""Slips below this part of the law's scale damage nothing."""
MIRROR = np.array([-1.0, -1.0, 1.0, -1.0, -1.0, -1.0, -1.0])[:, None, None]
"""Signs of s_0, b_0, q, a, r, a_2, r_2 in the mirrored piece −b(−s)."""


class Tail(NamedTuple):
    """τ beyond a slip of every node.

    counts: (n,) pieces of each node
    starts: (n, P) slips at which they begin [m]
    pieces: (5 or 7, n, P) their s_0, b_0, q, a, r, a_2, r_2; rows are padded with their last piece
    """

    counts: Index
    starts: Array
    pieces: Array


@dataclass(frozen=True)
class NodeState:
    """Internal variables of the m nodes.

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

    memory: the memory of all nodes
    law:    of the scene, whose s > 0 is the virgin curve
    m:      number of nodes
    names:  (m,) memory of every node, if they differ
    is_friction, is_plastic, is_damage: (m,) nodes with the memory `friction`, `elastic-plastic`,
                                        `damage`
    is_opening: (m,) nodes with a one-sided law

    Raises UnfitLaw if the memory cannot be made of the law.
    """

    memory: Memory
    law: Laws
    m: int
    names: NDArray[np.str_] | None = None
    is_friction: Flags = field(init=False)
    is_plastic: Flags = field(init=False)
    is_damage: Flags = field(init=False)
    is_opening: Flags = field(init=False)

    def __post_init__(self) -> None:
        names = np.full(self.m, self.memory.name) if self.names is None else self.names
        for law, nodes in self.law.groups(self.m):
            for name in np.unique(names[nodes]).tolist():
                replace(self.memory, name=name).check(law)
        attributes = ("is_friction", "is_plastic", "is_damage")
        for attribute, memory in zip(attributes, MEMORIES, strict=True):
            object.__setattr__(self, attribute, names == memory)
        is_one_sided = np.array([law.closing is not None for law in self.law.laws])
        object.__setattr__(self, "is_opening", is_one_sided[self.law.node_index(self.m)])

    @property
    def remembers(self) -> bool:
        """Whether unloading leaves the virgin curve."""
        return self.memory.name != "none"

    @property
    def _k(self) -> float:
        """Stiffness of elastic-plastic bonds [Pa/m]."""
        return self.memory.stiffness or np.inf

    @cached_property
    def omega(self) -> Array:
        """(m,) maximum softening slope of the laws of all steps [Pa/m]."""
        omega = self._law_by_node.falls[self._law_by_node.index]
        softening = omega[self.is_plastic]
        omega[self.is_plastic] = self._k * softening / (self._k - softening)
        return omega

    @cached_property
    def elastic(self) -> Array:
        """(m,) end of the initial elastic branch of damage, 0 without one [m]."""
        law = self._law_by_node
        first = law.piece(np.zeros(self.m))
        s_0, b_0, q, *exponentials = law.numbers(first)
        amplitudes = exponentials[::2]
        end = law.upper.take(first)
        is_straight = (b_0 == q * s_0) & ~np.any(amplitudes, axis=0)
        is_elastic = self.is_damage & is_straight & (q > 0.0) & np.isfinite(end)
        return np.where(is_elastic, end, 0.0)

    @cached_property
    def unchanged(self) -> bool:
        """True if the law of w = v − a is the law of the scene at every step.

        It is if nothing softens, or nothing is remembered.
        """
        tail = _tail(self._law_by_node, np.zeros(self.m))
        is_constant = bool(np.all(self.is_friction & (tail.counts == 1)))
        has_slope_or_exponential = np.any(tail.pieces[2:4])
        return not self.remembers or (is_constant and not has_slope_or_exponential)

    @cached_property
    def _law_by_node(self) -> Laws:
        return self.law.tables.at(self.law.node_index(self.m))

    @cached_property
    def _straight_law(self) -> Laws:
        """τ for s > 0 in straight pieces."""
        return self.law.mapped(_chords).tables.at(self._law_by_node.index)

    def origin(self, state: NodeState) -> Array:
        """Return (m,) a, the slips from which w is counted [m]."""
        return np.where(self.is_friction, state.v, np.where(self.is_plastic, state.plastic, 0.0))

    def next_law(self, state: NodeState, straight: bool = False) -> Laws:
        """Return the law of w = v − a in the step from this state.

        The law of every node is odd. Friction is ±τ(κ + |w|) with an up-jump at the last slip. An
        elastic-plastic bond is elastic to τ(κ)/k and then follows the virgin curve. Damage is the
        secant to (κ, τ(κ)) and then the virgin curve, or the virgin law where nothing has slipped.

        straight: whether straight pieces replace exponential ones
        """
        straight = straight and not self.law.piecewise_linear
        if self.unchanged and not straight:
            return self.law
        kappa = np.maximum(state.kappa, self.elastic)
        tail = self._straight_tail(kappa) if straight else _tail(self._law_by_node, kappa)
        # damage counts slips from 0, the other memories count them from κ
        shift = np.where(self.is_damage, 0.0, kappa)[:, None]
        starts, pieces = tail.starts - shift, tail.pieces
        pieces[0] = pieces[0] - shift
        centre_slope = np.full(self.m, np.nan)
        if np.any(self.is_plastic):
            starts, pieces = self._in_series(starts, pieces)
            has_strength = pieces[1][:, 0] > 0.0
            centre_slope[self.is_plastic & has_strength] = self._k
        is_torn = self.is_damage & (kappa > 0.0)
        centre_slope[is_torn] = self.law.b(kappa, -1)[is_torn] / kappa[is_torn]
        tail = Tail(tail.counts, starts, pieces)
        laws = self._odd_law(tail, centre_slope)
        return self._with_openings(laws, tail, centre_slope) if np.any(self.is_opening) else laws

    def _with_openings(self, laws: Laws, tail: Tail, centre_slope: Array) -> Laws:
        """Return the laws with those of openings in place of the odd ones of their nodes.

        An opening has its closing, a piece through 0 as far as it has been open, and the virgin
        curve.
        """
        kinks, pieces = laws.kinks.copy(), np.stack(laws.pieces)
        width = kinks.shape[1]
        virgin = self._law_by_node
        closings = np.stack(virgin.numbers(virgin.first[virgin.index]))
        for node in np.flatnonzero(self.is_opening).tolist():
            count = int(tail.counts[node])
            starts = tail.starts[node, :count]
            columns = [closings[:, node, None][: len(pieces)]]
            if np.isfinite(centre_slope[node]):
                through_zero = np.zeros((len(pieces), 1))
                through_zero[2] = centre_slope[node]
                columns.append(through_zero)
                starts = np.append(0.0, starts)
            columns.append(tail.pieces[:, node, :count])
            row = np.concatenate(columns, axis=1)
            kinks[node] = np.inf
            kinks[node, : len(starts)] = starts
            pieces[:, node] = row[:, np.minimum(np.arange(width + 1), row.shape[1] - 1)]
        openings = Laws("row", kinks, *pieces, index=laws.index)
        return openings.known(scales=laws.scales, falls=laws.falls)

    def _in_series(self, starts: Array, pieces: Array) -> tuple[Array, Array]:
        """Return (starts, pieces) of τ(κ + x) behind the springs of elastic-plastic nodes.

        Slopes q become k q/(k + q).
        """
        k = self._k
        is_plastic = self.is_plastic[:, None]
        s_0, b_0, q = pieces[:3]
        tau = b_0 + q * (starts - s_0)
        starts = np.where(is_plastic, starts + tau / k, starts)
        in_series = 0.0 * pieces
        in_series[:3] = starts, tau, k * q / np.where(is_plastic, k + q, 1.0)
        return starts, np.where(is_plastic, in_series, pieces)

    def _straight_tail(self, kappa: Array) -> Tail:
        """Return the tail in straight pieces, which begins on the curve that they replace."""
        curve, chords = self._law_by_node, self._straight_law
        tail = _tail(chords, kappa)
        first = tail.pieces[:3, :, 0]
        s_0, b_0, q = first
        reached = _reached(kappa)
        end = chords.upper.take(chords.piece(reached))
        is_curved = np.any(curve.bent, axis=1)[curve.index]
        is_inner = is_curved & np.isfinite(end)
        tau = curve.value(kappa, curve.piece(reached))
        tau_at_end = b_0 + q * (np.where(is_inner, end, kappa) - s_0)
        slope = np.divide(tau_at_end - tau, end - kappa, out=q.copy(), where=is_inner)
        tail.pieces[:3, :, 0] = np.where(is_curved, (kappa, tau, slope), first)
        return tail

    def _odd_law(self, tail: Tail, centre_slope: Array) -> Laws:
        """Return the laws of all nodes from their pieces for w > 0.

        What a film has lost does not make its residuals larger: its scale is that of the virgin
        film.

        centre_slope: (m,) slope of a piece through 0, NaN where the law has a jump or a bend at 0
        """
        n, width = tail.starts.shape
        row = np.arange(n)[:, None]
        count = tail.counts[:, None]
        centre_pieces = np.isfinite(centre_slope)[:, None].astype(np.intp)
        column = np.arange(2 * width + int(np.max(centre_pieces, initial=0)))[None, :]
        is_mirrored = column < count
        is_centre = (column == count) & (centre_pieces == 1)
        rank_right = np.clip(column - count - centre_pieces, 0, count - 1)
        rank = np.where(is_mirrored, count - 1 - column, rank_right)
        signs = np.where(is_mirrored, MIRROR[: len(tail.pieces)], 1.0)
        pieces = np.where(is_centre, 0.0, tail.pieces[:, row, rank] * signs)
        pieces[2] = np.where(is_centre, centre_slope[:, None], pieces[2])

        kink = column[:, :-1]
        is_mirrored = kink < count - 1 + centre_pieces
        rank_right = np.clip(kink - count + 1 - centre_pieces, 0, count - 1)
        rank = np.where(is_mirrored, count - 1 - kink, rank_right)
        slips = tail.starts[row, rank] * np.where(is_mirrored, -1.0, 1.0)
        kinks = np.where(kink < 2 * count - 1 + centre_pieces, slips, np.inf)
        laws = Laws("row", kinks, *(pieces + 0.0), index=np.arange(n, dtype=np.intp))
        return laws.known(scales=np.full(n, self.law.b_scale), falls=self.omega)

    def after(self, state: NodeState, w: Array) -> tuple[NodeState, Array, Array]:
        """Return the state after the step to v = a + w, and its energies.

        The energies are stored and dissipated ones per length, (m,) each [J/m²].
        """
        v = self.origin(state) + w
        if not self.remembers:
            return NodeState(v, state.kappa, state.plastic), self.law.j(v), np.zeros(self.m)
        flow, force = self._flow(state, w)
        largest_slip = self._largest_slip(state.kappa, v)
        kappa = np.where(self.is_damage, largest_slip, state.kappa + flow)
        plastic = state.plastic + np.where(self.is_plastic, np.sign(w) * flow, 0.0)

        before, after = np.maximum(state.kappa, self.elastic), np.maximum(kappa, self.elastic)
        tau_before, tau = self._tau_of_damage(before), self._tau_of_damage(after)
        change_stored = 0.5 * (tau * after - tau_before * before)
        dissipated = self.law.integral(before, after) - change_stored
        by_damage = np.where(after > before, np.maximum(dissipated, 0.0), 0.0)
        dissipated = np.where(self.is_damage, by_damage, dissipated)
        secant = 0.5 * tau / np.where(after > 0.0, after, 1.0)
        stored = secant * v**2 + 0.5 * force**2 / self._k
        is_pressed = self.is_opening & (v < 0.0)
        stored = np.where(is_pressed, self.law.j(np.minimum(v, 0.0)), stored)
        return NodeState(v, kappa, plastic), stored, dissipated

    def _largest_slip(self, kappa: Array, v: Array) -> Array:
        """Return (m,) the largest slip with v, but for slips too small to damage [m]."""
        slip = np.where(self.is_opening, np.maximum(v, 0.0), np.abs(v))
        scale = self.law.s_scale or float(np.max(slip, initial=0.0))
        least = np.maximum(kappa, MIN_DAMAGING_SLIP * scale)
        return np.where(np.maximum(kappa, slip) > least, slip, kappa)

    def _tau_of_damage(self, kappa: Array) -> Array:
        """Return (m,) τ(κ) of nodes with damage, 0 of the others [Pa]."""
        return np.where(self.is_damage & (kappa > 0.0), self.law.b(kappa, -1), 0.0)

    def _flow(self, state: NodeState, w: Array) -> tuple[Array, Array]:
        """Return (m,) the slip that flows in the step [m] and the force of springs [Pa].

        Friction flows by |w|. Elastic-plastic bonds have the force b(w) and flow by |w| − force/k.
        Damage does not flow.
        """
        flow = np.where(self.is_friction, np.abs(w), 0.0)
        if not np.any(self.is_plastic):
            return flow, 0.0 * flow
        force = np.where(self.is_plastic, np.abs(self.next_law(state).b(w)), 0.0)
        plastic_flow = np.abs(w) - force / self._k
        yields = self.is_plastic & (plastic_flow > NARROW * np.abs(w))
        return np.where(yields, plastic_flow, flow), force


def _reached(kappa: Array) -> Array:
    return kappa * (1.0 + NARROW)


def _tail(law: Laws, kappa: Array) -> Tail:
    """Return τ beyond κ (n,) of laws by node."""
    first = law.piece(_reached(kappa))
    kinks = np.count_nonzero(np.isfinite(law.kinks), axis=1)[law.index]
    count = kinks + 1 - (first - law.first[law.index])
    rank = np.arange(np.max(count, initial=1))
    piece = first[:, None] + np.minimum(rank, count[:, None] - 1)
    starts = np.maximum(law.lower.take(piece), kappa[:, None])
    starts[:, 0] = kappa
    return Tail(count, starts, np.stack(law.numbers(piece)))


def _chords(law: Laws) -> Laws:
    """Return τ for s > 0 in straight pieces between points of the law.

    They miss it by LAW_ERROR of its scale at most.
    """
    if law.piecewise_linear:
        return law
    decayed = DECAY_LENGTHS / float(np.min(law.rate[law.bent]))
    reach = float(np.max(law.kinks, initial=0.0)) + decayed
    kinks = piecewise_linear(law, 0.5 * LAW_ERROR, reach).kinks
    s = np.concatenate([[0.0], kinks[kinks > 0.0]])
    piece = law.piece(s)
    b, q = law.value(s, piece), law.q[piece]
    q[:-1] = (law.value(s[1:], piece[:-1]) - b[:-1]) / np.diff(s)
    zero = np.zeros(len(s))
    return Laws(law.name, s[1:], s, b, q, zero, zero)


SUMS = ("work", "dissipated", "dissipation", "closure", "released", "parts", "iterations", "jumps")
"""Numbers of a step that are sums over its parts."""
NO_NODE = np.False_
UNDETERMINED = (
    "all nodes slip at their limit, so that the rigid-body motion is not "
    "unique: put a contact node where the slip changes its direction (another number of "
    "elements)"
)


@dataclass(frozen=True)
class HistoryStep(NodeState):
    """A step: what a file stores of it and what the next step needs.

    load:        (m,) l̃ [N/m];  xi: (m,) ξ/c [Pa]
    dissipation: (m,) what the bond has dissipated in the step [J/m²]
    stored:      B;  energy: E [J/m]
    work:        −½ (vⁿ + vⁿ⁻¹)ᵀΔl̃, the work of the loads;  dissipated: D ≥ 0 [J/m]
    closure:     time-discretisation energy defect;  released: energy released at jumps, ≥ 0 [J/m]
    identity:    largest defect of the identity of all parts, relative to its terms: rounding
    parts:       contact problems solved or pieces of a path followed;  iterations: of the solvers
    jumps:       their number;  jumped: (m,) nodes that a jump has moved
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
    jumped: NDArray[np.bool_] | np.bool_ = NO_NODE
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
        """Return the unloaded initial state."""
        return cls(*np.zeros((6, m)))

    def unchanged(self) -> HistoryStep:
        """Return the step after this one to the same load, in which nothing happens."""
        zeros = {name: 0 * getattr(self, name) for name in SUMS}
        return replace(self, **zeros, identity=0.0, jumped=NO_NODE)

    def then(self, part: HistoryStep) -> HistoryStep:
        """Return this step with a further part."""
        sums = {name: getattr(self, name) + getattr(part, name) for name in SUMS}
        identity = max(self.identity, part.identity)
        return replace(part, identity=identity, jumped=self.jumped | part.jumped, **sums)


@dataclass(frozen=True)
class HistoryProblem:
    """What all steps of a history share.

    body:       Ã and c; a body that only friction holds is a loose one, with Ã only semidefinite
    model:      the law of the scene and its memory
    branch:     "lowest": lowest found of the step from all starts; "continued": along its path
                (steps.py)
    tolerance:  of the inclusion residual, as in `solve_contact`
    max_pieces: most pieces of a path that is followed at once
    """

    body: CondensedBody
    model: MemoryModel
    branch: HistoryBranch = "continued"
    tolerance: float | None = None
    max_pieces: int = 20_000

    @cached_property
    def margin(self) -> float:
        """λ_min(C^{−½}ÃC^{−½} − diag ω_i) [Pa/m], λ₁ − ω where all nodes have one law."""
        omega, share = self.model.omega, trusted_share(self.body.A_error)
        if np.any(omega != omega[:1]):
            return least_lowered(share * self.body.A_tilde, self.body.c, omega)
        return share * self.body.lambda_1 - float(np.max(omega, initial=0.0))

    @cached_property
    def convex(self) -> bool:
        """True if every step has one solution, whatever its load."""
        return not self.body.loose and self.margin > self.body.shift

    @cached_property
    def monotone(self) -> bool:
        """True if no law softens, so that every solution has the least energy."""
        return not np.any(self.model.omega)

    def one_solution(self, law: Laws) -> bool:
        """Return whether a step has one solution or a connected set of them.

        law: of the step, as the memory has moved it
        """
        if self.convex or self.monotone:
            return True
        reach = far(law)[law.node_index(self.body.m)]
        slope = least_slopes(law, -reach, reach)
        problem = ContactProblem.on(self.body, np.zeros(self.body.m), law)
        rises = bool(np.all(slope >= 0.0))
        return rises or positive_definite(problem, slope, self.body.lambda_1)

    @cached_property
    def scaled(self) -> ScaledBody:
        """Ã as paths need it."""
        return ScaledBody.of(self.body.A_tilde, not self.body.loose)

    def energy(self, v: Array, load: Array) -> float:
        """Return E = ½ vᵀÃv − l̃ᵀv [J/m]."""
        return float(0.5 * v @ (self.body.A_tilde @ v) - load @ v)

    def energy_size(self, v: Array, load: Array) -> float:
        """Return the size of the terms of E, |v|ᵀ|Ã||v| + |l̃|ᵀ|v| [J/m]."""
        slip = np.abs(v)
        return float(slip @ (np.abs(self.body.A_tilde) @ slip) + np.abs(load) @ slip)


def with_energies(
    history: HistoryProblem,
    last_step: HistoryStep,
    load: Array,
    answer: Answer,
    work: float | None = None,
    friction: float | None = None,
) -> HistoryStep:
    """Return the step, or part of a step, to a solution w (m,) with its energies.

    work, friction: work of the loads and ∫ξᵀdv of a path from the last state that is known between
                    its ends; by default those of a straight path [J/m]
    """
    c = history.body.c
    state, stored_by_node, dissipation = history.model.after(last_step, answer.v)
    v, xi = state.v, answer.xi / c
    stored, dissipated = float(c @ stored_by_node), float(c @ dissipation)
    energy = history.energy(v, load)
    if work is None:
        work = -0.5 * float((v + last_step.v) @ (load - last_step.load))
    if friction is None:
        friction = 0.5 * float((c * (xi + last_step.xi)) @ (v - last_step.v))
    defect = abs(energy - last_step.energy - work + friction)
    size = history.energy_size(v, load) + history.energy_size(last_step.v, last_step.load)
    return HistoryStep(
        v=v,
        kappa=state.kappa,
        plastic=state.plastic,
        load=load,
        xi=xi,
        dissipation=dissipation,
        stored=stored,
        energy=energy,
        work=work,
        dissipated=dissipated,
        closure=friction - (stored - last_step.stored) - dissipated,
        identity=defect / (size or 1.0),
        parts=1,
        iterations=answer.iterations,
        inclusion_residual=answer.inclusion_residual,
        inclusion_rounding=answer.rounding,
        status=answer.status,
        reason=answer.reason,
    )


def with_proofs(
    history: HistoryProblem, problem: ContactProblem, answer: Answer, step: HistoryStep
) -> HistoryStep:
    """Return the step with its certificates.

    The step of a loose body fails if the motion as a whole is not determined.
    """
    body = history.body
    if history.convex:
        return replace(step, unique=True, strict_minimum=True, global_minimum=True)
    if history.monotone or body.loose:
        strict = bool(strict_minimum(problem.rows, answer.v[None])[0])
        if body.loose and not strict:
            return replace(step, status=Status.NOT_POSITIVE_DEFINITE, reason=UNDETERMINED)
        unique = strict and history.monotone
        return replace(step, unique=unique, strict_minimum=strict, global_minimum=history.monotone)
    proof = certify(
        problem,
        answer.v,
        body.lambda_1,
        history.tolerance,
        inverse=body.inverse,
        residual=answer.inclusion_residual,
    )
    return replace(
        step,
        unique=proof.unique,
        strict_minimum=proof.strict_minimum,
        global_minimum=proof.global_minimum,
    )
