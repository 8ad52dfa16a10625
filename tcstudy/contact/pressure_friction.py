"""Friction that knows the pressure: Coulomb's law, and laws that act where the body is pressed.

Rows T are slips u_T, rows N openings s_N of the same nodes. With ξ = l̃ − Ãv, v = (u_T, s_N),

    ξ_N/c_N ∈ b̂_N(s_N),    ξ_T/c_T ∈ b̂_T(u_T) + σ φ̂(u_T − a),

where b_T is a bond that does not know the pressure, φ the pressure's friction, a its origin and

    σ = p = max(0, −ξ_N/c_N)     by Coulomb's law; φ is the coefficient of friction
    σ = 1 where s_N = 0, else 0  for a law φ [Pa] that acts only where the body is pressed

There is no energy: σ depends on the solution (a quasi-variational inequality). So no solution is
the lowest, and none is proved to be a global minimum. The inclusion of both rows is the test.

Method: with σ given the problem is separable, and the solver of this room solves it. Repeating
σ ← σ(v) is Panagiotopoulos' fixed point (Ing.-Arch. 44 (1975) 421–432), which contracts where the
coefficient is small. Between two such solutions Newton's method solves the equations of the pieces
that the last one is on, with p as an unknown. They are not symmetric (Alart & Curnier, Comput.
Methods Appl. Mech. Engrg. 92 (1991) 353–375). The strengths of its end are the next σ. Where the
same pieces come back, σ goes half the way of the fixed point.

Uniqueness, if φ does not fall and φ ≤ μ: two solutions of the separable problem differ by δv with
‖δv‖² ≤ μ ‖δp‖_C ‖δu_T‖_C in the norm of A_ω = Ã − ωC, and ‖δp‖_C ≤ ‖C^{-½}Ã_N δv‖. So σ → σ(v)
contracts by at most

    κ = μ √(λ_max(C_T^½ (A_ω⁻¹)_TT C_T^½) · λ_max(C_N^{-½} Ã_N A_ω⁻¹ Ã_Nᵀ C_N^{-½})),

and κ < 1 proves that there is one solution. ω is the largest softening slope of b_T and b_N. The
bound is one of the mesh: the second factor grows like h^{-½}.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from tcstudy.contact.certificates import Certificate
from tcstudy.contact.problem import ContactProblem, Status
from tcstudy.contact.solution import Acceptance, judge
from tcstudy.contact.solve import Answer, solve_contact
from tcstudy.laws.composed import total
from tcstudy.laws.laws import Laws
from tcstudy.scene.solver_plan import START_NAMES, ZERO, Branch

Array = NDArray[np.float64]
Index = NDArray[np.intp]
Flags = NDArray[np.bool_]

NAN = float("nan")
MAX_STEPS = 60
"""Separable problems that are solved before a run ends without a solution."""
NEAR = 1e-6
"""Change of strengths, relative to the largest, below which a state is refined to be judged."""
MAX_NEWTON_STEPS = 12
"""Steps on the pieces of one solution."""
NEWTON_ACCURACY = 1e-14
"""Defect of the equations, relative to their terms, at which these steps end."""
CYCLES = (
    "the pressures did not settle in {steps} steps (last change {change:.1e} of the largest): "
    "states of stick, slip and opening take turns, and there may be no solution near; try a "
    "smaller coefficient, the load in smaller steps, or another mesh"
)
UNSOLVED = "with the pressures of step {step} the problem has no solution: {reason}"


@dataclass(frozen=True, eq=False)
class PressureFriction:
    """The friction of k nodes whose strength the pressure decides.

    slip, opening: (k,) rows of v of the slips and of the openings of the same nodes; a node with
                   two laws is there twice
    laws:          φ of these nodes: coefficients of friction [1], or tractions [Pa] of laws that
                   act where the body is pressed; one for all or one for each node
    coulomb:       (k,) whether σ is the pressure, not 1
    origin:        (k,) slips a at which φ begins [m]; a history's last slips
    """

    slip: Index
    opening: Index
    laws: Laws
    coulomb: Flags
    origin: Array

    @property
    def largest_coefficient(self) -> float:
        """The largest coefficient of friction μ, 0 without Coulomb's law."""
        if not np.any(self.coulomb):
            return 0.0
        return max(law.b_scale for law, _ in self._groups(self.coulomb))

    @property
    def falls(self) -> bool:
        """Whether a coefficient of friction falls with the slip."""
        return any(law.omega > 0.0 for law, _ in self._groups(self.coulomb))

    @property
    def sizes(self) -> Array:
        """(k,) the scale of φ of every node."""
        laws = self.laws.tables
        return laws.scales[self.laws.node_index(len(self.slip))]

    def _groups(self, chosen: Flags) -> list[tuple[Laws, Index]]:
        groups = self.laws.groups(len(self.slip))
        return [(law, nodes) for law, nodes in groups if np.any(chosen[nodes])]

    def strengths(self, problem: ContactProblem, v: Array, xi: Array) -> Array:
        """Return (k,) σ of a state: pressures [Pa], or 1 where the body is pressed."""
        normal_traction = xi[self.opening] / problem.c[self.opening]
        pressure = np.maximum(0.0, -normal_traction)
        is_closed = v[self.opening] <= 0.0
        return np.where(self.coulomb, pressure * is_closed, is_closed.astype(float))

    def laws_with(self, law: Laws, m: int, strengths: Array) -> Laws:
        """Return the laws of all m rows with friction of the given strengths (k,)."""
        index = law.node_index(m)
        row_laws = [law.laws[k] for k in index]
        for node, row in enumerate(self.slip):
            strength = float(strengths[node])
            if strength == 0.0:
                continue
            friction = self.laws.single(node).placed(strength, 1.0, float(self.origin[node]))
            own_law = row_laws[row]
            row_laws[row] = friction if own_law.vanishes else total(own_law, friction)
        return Laws.of(row_laws, np.arange(m))


@dataclass(frozen=True)
class PressureAnswer:
    """A judged state of a body with friction that knows the pressure.

    v, v_low:  (m,) slips and openings v + v_low [m], as in `Answer`
    xi:        (m,) nodal forces [N/m]
    pressure:  (k,) pressures of the nodes with such friction [Pa]
    strengths: (k,) σ at v
    inclusion_residual, rounding: as in `Answer`, of both rows, with the strengths of v itself
    status, reason: CONVERGED, or why not
    steps:     separable problems that were solved
    contraction: κ, an upper bound; NaN where there is none
    unique:    whether κ < 1 proves that there is no other solution
    """

    v: Array
    v_low: Array
    xi: Array
    pressure: Array
    strengths: Array
    inclusion_residual: float
    rounding: float
    status: Status
    reason: str
    steps: int
    contraction: float
    unique: bool


def solve_with_pressure(
    problem: ContactProblem,
    friction: PressureFriction,
    tolerance: float | None = None,
    start: Array | None = None,
    prove: bool = True,
) -> PressureAnswer:
    """Solve a contact problem with friction that knows the pressure.

    problem: rows T and N with their bonds, without that friction
    start:   (m,) a state near the solution, such as the last of a history [m]
    prove:   whether the bound of the contraction is wanted

    Raises nothing: what does not converge has a status and a reason.
    """
    run = _Run(problem, friction, Acceptance(tolerance), start)
    answer = run.answer()
    if not (prove and answer.status == Status.CONVERGED):
        return answer
    contraction = contraction_bound(problem, friction)
    return replace(answer, contraction=contraction, unique=contraction < 1.0)


class _State(NamedTuple):
    """A solution of the separable problem of some strengths, and the strengths of it."""

    v: Array
    xi: Array
    law: Laws
    strengths: Array


class _Run:
    """One run: separable problems, with Newton's method on their pieces between them."""

    def __init__(
        self,
        problem: ContactProblem,
        friction: PressureFriction,
        acceptance: Acceptance,
        start: Array | None,
    ) -> None:
        self.problem = problem
        self.friction = friction
        self.acceptance = acceptance
        self.start = start
        self.seen = set[bytes]()

    def answer(self) -> PressureAnswer:
        """Return the first accepted state, or the last one with the reason why it is none."""
        v = self.start
        strengths = np.zeros(len(self.friction.slip))
        if v is None and self.problem.body.loose:  # without friction it may have no equilibrium
            strengths = self._sticking()
        if v is not None:
            strengths = self.friction.strengths(self.problem, v, self.problem.xi(v))
        last_change = np.inf
        for step in range(1, MAX_STEPS + 1):
            state, reason = self._separable(strengths, v)
            if reason:
                reason = UNSOLVED.format(step=step, reason=reason)
                return self._judged(state, step, Status.STALLED, reason)
            largest = float(np.max(state.strengths, initial=0.0)) or 1.0
            change = float(np.max(np.abs(state.strengths - strengths), initial=0.0)) / largest
            judged = self._judged(state, step, refine=change <= NEAR)
            if judged.status == Status.CONVERGED:
                return judged
            strengths, v = self._next(state, strengths, settles=change < 0.5 * last_change)
            last_change = change
        reason = CYCLES.format(steps=MAX_STEPS, change=last_change)
        return replace(judged, status=Status.ITERATION_LIMIT, reason=reason)

    def _sticking(self) -> Array:
        """Return strengths (k,) under which all pressed nodes stick."""
        friction = self.friction
        largest = np.sum(np.abs(self.problem.l_tilde)) / np.min(self.problem.c)
        coefficient = friction.largest_coefficient or 1.0
        return np.where(friction.coulomb, largest / coefficient, 1.0)

    def _separable(self, strengths: Array, near: Array | None) -> tuple[_State, str]:
        """Return the solution with given strengths near a state, and why there is none."""
        m = self.problem.m
        law = self.friction.laws_with(self.problem.law, m, strengths)
        separable = ContactProblem.on(self.problem.body, self.problem.l_tilde, law)
        branch: Branch = "lowest" if near is None else "continued"
        solved = solve_contact(separable, branch=branch, neighbour=near)
        of_state = self.friction.strengths(self.problem, solved.v, solved.xi)
        reason = "" if solved.status == Status.CONVERGED else solved.reason
        return _State(solved.v, solved.xi, law, of_state), reason

    def _judged(
        self,
        state: _State,
        steps: int,
        status: Status = Status.STALLED,
        reason: str = "",
        refine: bool = False,
    ) -> PressureAnswer:
        """Return a state as an answer, CONVERGED where both of its rows are included.

        The laws are those of its own strengths. What refining it changes of them counts as well.

        refine: whether it is polished where its digits do not suffice
        """
        problem, friction = self.problem, self.friction
        law = friction.laws_with(problem.law, problem.m, state.strengths)
        own = ContactProblem.on(problem.body, problem.l_tilde, law)
        judged = judge(own.rows, state.v[None], self.acceptance, refine)
        v, xi = judged.v[0], judged.xi[0]
        strengths = friction.strengths(problem, v, xi)
        changes = np.abs(strengths - state.strengths) * friction.sizes
        residual = float(judged.residual[0] + own.relative(changes, xi))
        rounding = float(judged.rounding[0])
        if not reason and self.acceptance.accepts(residual, rounding):
            status = Status.CONVERGED
        pressure = np.maximum(0.0, -xi[friction.opening] / problem.c[friction.opening])
        return PressureAnswer(
            v=v,
            v_low=judged.v_low[0],
            xi=xi,
            pressure=pressure,
            strengths=strengths,
            inclusion_residual=residual,
            rounding=rounding,
            status=status,
            reason=reason,
            steps=steps,
            contraction=NAN,
            unique=False,
        )

    def _next(self, state: _State, strengths: Array, settles: bool) -> tuple[Array, Array]:
        """Return the strengths (k,) of the next step and the state (m,) to start it from.

        settles: whether the fixed point alone comes nearer
        """
        pieces = state.law.piece(state.v)
        sticks = state.law.sticking(state.v)
        first = state.law.tables.first[state.law.node_index(self.problem.m)]
        key = np.append(pieces - first, sticks).tobytes()
        if key not in self.seen:
            self.seen.add(key)
            v = self._newton(state)
            if v is not None:
                return self.friction.strengths(self.problem, v, self.problem.xi(v)), v
        share = 1.0 if settles else 0.5
        return strengths + share * (state.strengths - strengths), state.v

    def _newton(self, state: _State) -> Array | None:
        """Return v (m,) that solves the equations of the pieces of a state, None if none does.

        Free rows have Ãv − l̃ + c (b(v) + σ φ(v)) = 0, rows on an up-jump stay where they are.
        """
        problem, friction = self.problem, self.friction
        own_law = problem.law.tables.at(problem.law.node_index(problem.m))
        free = np.flatnonzero(~state.law.sticking(state.v))
        is_free = np.isin(np.arange(problem.m), free)
        own_piece = own_law.piece(state.v)
        phi = friction.laws.tables.at(friction.laws.node_index(len(friction.slip)))
        phi_piece = phi.piece(state.v[friction.slip] - friction.origin)
        knows = friction.coulomb & is_free[friction.slip] & (state.strengths > 0.0)
        nodes = np.flatnonzero(knows)
        slip, opening = friction.slip[nodes], friction.opening[nodes]
        v = state.v.copy()
        for _ in range(MAX_NEWTON_STEPS):
            xi = problem.xi(v)
            pressure = -xi / problem.c
            sigma = state.strengths.copy()
            sigma[nodes] = pressure[opening]
            distance = v[friction.slip] - friction.origin
            traction = own_law.value(v, own_piece)
            slope = own_law.slope(v, own_piece)
            coefficient = phi.value(distance, phi_piece)
            np.add.at(traction, friction.slip, sigma * coefficient)
            np.add.at(slope, friction.slip, sigma * phi.slope(distance, phi_piece))
            defect = (problem.c * traction - xi)[free]
            terms = np.abs(xi) + np.abs(problem.l_tilde)
            if np.max(np.abs(defect), initial=0.0) <= NEWTON_ACCURACY * np.max(terms):
                break
            matrix = problem.A_tilde.copy()
            matrix[np.diag_indices(problem.m)] += problem.c * slope
            factor = problem.c[slip] * coefficient[nodes] / problem.c[opening]
            np.add.at(matrix, slip, factor[:, None] * problem.A_tilde[opening])
            try:
                v[free] -= np.linalg.solve(matrix[np.ix_(free, free)], defect)
            except np.linalg.LinAlgError:
                return None
            if not np.all(np.isfinite(v)):
                return None
        return v


def contraction_bound(problem: ContactProblem, friction: PressureFriction) -> float:
    """Return κ, by which σ → σ(v) contracts at most; NaN where the bound does not hold.

    It does not for coefficients that fall with the slip, for laws that only the contact switches,
    for down-jumps, and where ω ≥ λ₁.
    """
    omega = problem.law.omega
    has_bound = np.all(friction.coulomb) and not friction.falls and np.isfinite(omega)
    if not has_bound or problem.body.loose:
        return NAN
    mu = friction.largest_coefficient
    lowered = problem.A_tilde - np.diag(omega * problem.c)
    factor, info = scipy.linalg.lapack.dpotrf(lowered, lower=1)
    if info != 0:
        return NAN

    def largest(rows: Array) -> float:
        """Return λ_max(R A_ω⁻¹ Rᵀ) of rows R."""
        half = scipy.linalg.solve_triangular(factor, rows.T, lower=True)
        return float(np.linalg.norm(half, 2)) ** 2

    identity = np.eye(problem.m)[friction.slip]
    slips = np.sqrt(problem.c[friction.slip])[:, None] * identity
    forces = problem.A_tilde[friction.opening] / np.sqrt(problem.c[friction.opening])[:, None]
    ratio = np.sqrt(problem.c[friction.slip] / problem.c[friction.opening])
    share = float(np.max(ratio, initial=0.0))
    return mu * share * float(np.sqrt(largest(slips) * largest(forces)))


def as_answer(
    problem: ContactProblem,
    friction: PressureFriction,
    solved: PressureAnswer,
    tolerance: float | None = None,
) -> tuple[Answer, Laws]:
    """Return a state in the form of answers that have an energy, and the laws of its rows.

    Of minima it says nothing, and its energies are NaN. Arguments as of `solve_with_pressure`.
    """
    laws = friction.laws_with(problem.law, problem.m, solved.strengths)
    is_solved = solved.status == Status.CONVERGED
    certificate = Certificate(
        residual=solved.inclusion_residual,
        lambda_1=NAN,
        lambda_1_error=problem.A_error,
        omega=NAN,
        margin=NAN,
        convex=False,
        unique=solved.unique,
        strict_minimum=False,
        global_minimum=False,
        energy_gap=NAN,
    )
    answer = Answer(
        v=solved.v,
        v_low=solved.v_low,
        xi=solved.xi,
        inclusion_residual=solved.inclusion_residual,
        rounding=solved.rounding,
        limited=is_solved and solved.inclusion_residual > Acceptance(tolerance).aim,
        energy=NAN,
        status=solved.status,
        reason=solved.reason,
        start=ZERO,
        energies=np.full(len(START_NAMES), NAN),
        iterations=solved.steps,
        evaluations=solved.steps,
        certificate=certificate,
    )
    return answer, laws
