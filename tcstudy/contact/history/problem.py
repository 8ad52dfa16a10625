"""What all steps of a load history share, a step and its energies, and what is proved of it.

Step n:     0 ∈ Ãvⁿ − l̃ⁿ + ∂Σ c_i j_iⁿ(v_i), ξⁿ = l̃ⁿ − Ãvⁿ, ξ_iⁿ/c_i ∈ b̂_iⁿ(v_iⁿ), the laws of the step by memory.py
Energies:   E = ½ vᵀÃv − l̃ᵀv of the body, B = Σ c stored in bonds, D = Σ c dissipated in the step
Identity:   ΔE + ½ (vⁿ + vⁿ⁻¹)ᵀΔl̃ = −½ (ξⁿ + ξⁿ⁻¹)ᵀΔv, to rounding, whatever the law
Closure:    ½ (ξⁿ + ξⁿ⁻¹)ᵀΔv − ΔB − D, what a step misses by being finite; it falls like its square
So ΔE + ΔB + D + closure + released = work, work = −½ (vⁿ + vⁿ⁻¹)ᵀΔl̃, sums over the parts of a step where it has any.
Two-sided estimate: −Δl̃ᵀvⁿ ≤ ΔE + ΔB + D ≤ −Δl̃ᵀvⁿ⁻¹, the upper bound for every descent from vⁿ⁻¹, the lower one
where vⁿ⁻¹ was a global minimum. Literature: Mielke, Evolution of rate-independent systems (2005), §5.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from tcstudy.contact.certificates import certify, far, least_slopes, positive_definite, strict_minimum
from tcstudy.contact.history.memory import MemoryModel, NodeState
from tcstudy.contact.path.problem import ScaledBody
from tcstudy.contact.problem import CondensedBody, ContactProblem, Status, kept, least_lowered
from tcstudy.contact.solve import Answer
from tcstudy.laws.laws import Laws
from tcstudy.scene.histories import HistoryBranch

Array = NDArray[np.float64]

SUMS = ("work", "dissipated", "dissipation", "closure", "released", "parts", "iterations", "jumps")
"""Numbers of a step that are sums over its parts."""
NOBODY = np.False_
UNDETERMINED = (
    "all nodes slide at their limit, so that how far the body has moved as a whole is not determined: put a contact "
    "node where the slip changes its direction (another number of elements)"
)


@dataclass(frozen=True)
class HistoryStep(NodeState):
    """A step: all that a file has of it and all that the next one needs, beginning with what the nodes remember.

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
        return replace(part, identity=max(self.identity, part.identity), jumped=self.jumped | part.jumped, **sums)


@dataclass(frozen=True)
class HistoryProblem:
    """What all steps share.

    body:       Ã and c; a body that nothing but friction holds is a loose one, with Ã only semidefinite
    model:      the scene's law and what is remembered of it
    branch:     "lowest": lowest found of the step from all starts; "continued": along its path (continued.py)
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
        """Whether a step with these laws, as the memory has moved them, has one solution or a connected set of them."""
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
    p: HistoryProblem, last: HistoryStep, load: Array, answer: Answer, way: tuple[float, float] | None = None
) -> HistoryStep:
    """The step or part of one to a solution w (m,) of its problem, with its energies.

    way: work and ∫ξᵀdv of a path from the last state that is known between its ends; else it is taken as straight
    """
    c, (state, stored_by_node, dissipation) = p.body.c, p.model.after(last, answer.v)
    v, xi, stored, dissipated = state.v, answer.xi / c, float(c @ stored_by_node), float(c @ dissipation)
    energy, size = p.energy(v, load), _size(p.body, v, load) + _size(p.body, last.v, last.load)
    straight = -0.5 * float((v + last.v) @ (load - last.load)), 0.5 * float((c * (xi + last.xi)) @ (v - last.v))
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


def proved(p: HistoryProblem, problem: ContactProblem, answer: Answer, step: HistoryStep) -> HistoryStep:
    """The step with its certificates; a loose body whose motion as a whole is free has none, and fails."""
    if p.convex:
        return replace(step, unique=True, strict_minimum=True, global_minimum=True)
    if p.monotone or p.body.loose:
        strict = bool(strict_minimum(problem.rows, answer.v[None])[0])
        if p.body.loose and not strict:
            return replace(step, status=Status.NOT_POSITIVE_DEFINITE, reason=UNDETERMINED)
        return replace(step, unique=strict and p.monotone, strict_minimum=strict, global_minimum=p.monotone)
    body, residual = p.body, answer.inclusion_residual
    proof = certify(problem, answer.v, body.lambda_1, p.tolerance, inverse=body.inverse, residual=residual)
    return replace(step, unique=proof.unique, strict_minimum=proof.strict_minimum, global_minimum=proof.global_minimum)
