"""The contact problem for people with their own matrices: check, solve, certify, follow.

Problem:    find v with ξ = l̃ − Ãv and ξ_i ∈ c_i b̂(v_i), i = 1..m;
            0 ∈ ∂L̃(v), L̃(v) = ½vᵀÃv − l̃ᵀv + Σ c_i j(v_i)
Units:      any consistent ones; those named here are of a plane body of unit thickness in SI
Literature: Šestak & Jovanović, Appl. Math. Mech. 31 (2010), eqs. (20), (21); tcstudy/METHOD.md §3

Faults of the data are raised as a `ProblemError` of one line. Left out: sparse Ã (condense it onto
the contact nodes).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import scipy.linalg
from numpy.typing import ArrayLike, NDArray

from tcstudy.contact import certificates
from tcstudy.contact.all_solutions import LAW_ERROR, Equilibria
from tcstudy.contact.boxes import Limits
from tcstudy.contact.certificates import Certificate
from tcstudy.contact.path.follow import Follower, ParametricProblem, Path
from tcstudy.contact.path.walk import NoSolutionError
from tcstudy.contact.problem import CondensedBody, is_singular
from tcstudy.contact.problem import ContactProblem as PlainProblem
from tcstudy.contact.solve import SEMIDEFINITE, Answer, known_solutions, solve_contact
from tcstudy.errors import ProblemError
from tcstudy.laws.composed import nodal
from tcstudy.laws.laws import NONE, Laws
from tcstudy.laws.pieces import GrowthError
from tcstudy.laws.shapes import RIGID, SHAPES, LawError, knows_pressure, one_sided, unilateral
from tcstudy.scene.path_plan import Direction
from tcstudy.scene.solver_plan import BRANCHES, BUNDLE, SEPARABLE, SOLVERS, Branch

__all__ = ["ContactProblem", "all_solutions", "certify", "follow", "law", "opening", "solve"]

Array = NDArray[np.float64]
MAX_ASYMMETRY = 1e-10
"""Largest |Ã_ij − Ã_ji|/√(Ã_ii Ã_jj) that counts as rounding, and is averaged away."""
MIN_LAW_ERROR = 1e-8
_NO_PRESSURE = (
    "law coulomb: its friction is mu times the pressure of another row, and has no energy; "
    "run a study with a unilateral edge, or give tresca the friction at a known pressure"
)


def law(name: str = "piecewise-linear", **parameters: Any) -> Laws:
    """Return a friction law b by its name and parameters, or by its points.

        law("slip-weakening", tau_s=2e7, tau_k=5e6, delta=4e-5)
        law(points=[(0, 2e7), (4e-5, 5e6)])  # linear between them, odd in s (odd=False: not)

    Names and parameters are those of a study's section `friction` (configs/howto/laws.md). Numbers
    are in consistent units: tractions [Pa], slips [m], stiffness k and slope [Pa/m].

    Raises ProblemError for an unknown name, a missing or meaningless parameter, or a law that
    violates growth condition (15) or (16) of the paper. So does coulomb: the pressure it multiplies
    is no number of one row.
    """
    if name not in SHAPES:
        raise ProblemError(f"there is no law {name!r}; use one of {', '.join(SHAPES)}")
    try:
        built = SHAPES[name].build(**parameters)
        if knows_pressure(built):
            raise ProblemError(_NO_PRESSURE)
        return built
    except (GrowthError, ValueError) as error:
        raise ProblemError(f"law {name}: {error}") from error


def opening(law: Laws | None = None, closing: float = RIGID) -> Laws:
    """Return the law of a row whose unknown is an opening s ≥ 0, in place of a slip.

        opening()                                             # contact without adhesion
        opening(law("bilinear", tau=2e7, s0=4e-6, sf=1.4e-5)) # an adhesive; tau is its strength
        opening(law(…), closing=5e13)                         # a layer that gives way for s < 0

    law:     b for s > 0, of `tcstudy.law`; None for contact without adhesion
    closing: RIGID (∞) for non-penetration, b̂(0) = (−∞, b(0+)]; a stiffness for b = closing × s at
             s < 0 [Pa/m]

    Raises ProblemError for a closing that is not above 0.
    """
    if law is None and closing == RIGID:
        return unilateral()
    if law is not None and law.closing is not None:
        remedy = "give it the law for s > 0, and closing beside it"
        raise ProblemError(f"law {law.name} is an opening already; {remedy}")
    try:
        return one_sided(NONE if law is None else law, closing)
    except LawError as error:
        raise ProblemError(str(error)) from error


@dataclass(frozen=True, eq=False, repr=False)
class ContactProblem(PlainProblem):
    """The problem 0 ∈ Ãv − l̃ + ∂Ψ(v), Ψ(v) = Σ c_i j(v_i), for tangential displacements v (m,).

    A_tilde: (m, m) symmetric positive definite, stiffness condensed onto the contact nodes [Pa];
             semidefinite where contact alone holds the body
    l_tilde: (m,) condensed load [N/m]
    c:       (m,) length of Γ_C that belongs to each node, > 0 [m]
    law:     friction law b [Pa] of the slip [m], of `tcstudy.law`, or a list of m laws, one per
             node

    The arrays are copied. Ã is symmetrised where it is asymmetric by rounding only. The problem has
    `energy(v)`, `xi(v)`, `inclusion_residual(v)` and `lambda_1` (method §5).

    A row may be an opening: its law then is one of `tcstudy.opening`. Where Ã is semidefinite, the
    load must be against every motion r with Ãr = 0, or less than what the laws carry. Else the
    answer's status is UNBOUNDED, and its reason says what moves. Then λ₁ = 0, and nothing that
    rests on λ₁ is proved.

    Raises ProblemError for shapes that do not fit, numbers that are not finite, c ≤ 0, and an
    asymmetric or indefinite Ã.
    """

    def __post_init__(self) -> None:
        c = _vector("c", self.c, None)
        if not np.all(c > 0.0):
            i = int(np.argmin(c))
            remedy = "every node needs a part of the contact line, c > 0"
            raise ProblemError(f"c[{i}] = {c[i]:g} is no length; {remedy}")
        m = len(c)
        object.__setattr__(self, "law", _checked_law(self.law, m))
        arrays = {
            "A_tilde": _stiffness(self.A_tilde, m),
            "l_tilde": _vector("l_tilde", self.l_tilde, m),
            "c": c,
        }
        for name, array in arrays.items():
            array.flags.writeable = False
            object.__setattr__(self, name, array)

    @cached_property
    def body(self) -> CondensedBody:
        """The body's record; where Ã is singular to rounding, contact alone holds it."""
        loose = True if is_singular(self.A_tilde) else None
        body = CondensedBody.known(self.A_tilde, self.c, self.A_error, self.blocks, loose=loose)
        if loose:
            _ = body.motions  # answers are held against them
        return body

    def __repr__(self) -> str:
        return f"ContactProblem({self.m} contact nodes, law {self.law.name})"


def solve(
    problem: ContactProblem,
    solver: str = "separable-newton",
    *,
    tolerance: float | None = None,
    max_iterations: int | None = None,
    branch: Branch = "lowest",
    neighbour: ArrayLike | None = None,
) -> Answer:
    """Return a solution v of the problem, judged by its inclusion residual.

    The residual is max_i dist(ξ_i/c_i, b̂(v_i))/(scale of b), eq. (21).

    solver:         "separable-newton" or "bundle-newton"
    tolerance:      largest inclusion residual, strict; None for 1e-10 or what rounding to doubles
                    allows
    max_iterations: of bundle-newton alone, None for its own limit
    branch:         "lowest" (the lowest found from all starts and by a search for less),
                    "continued" (from the neighbour) or "from-zero"
    neighbour:      (m,) solution of a neighbouring problem [m], if there is one

    Where Ã is semidefinite and no row is an opening, "lowest" is the solution reached from zero:
    beyond the strength of the bond there is no least energy.

    The answer has v [m], xi [N/m], energy [J/m], inclusion_residual and status. Its status is
    Status.CONVERGED, or else it has a reason: a failure is no exception. Raises ProblemError for
    unknown names and a neighbour that does not fit.
    """
    _check_name("solver", solver, SOLVERS)
    _check_name("branch", branch, BRANCHES)
    start = None if neighbour is None else _vector("neighbour", neighbour, problem.m)
    if tolerance is not None and not 0.0 < tolerance < 1.0:
        remedy = "leave it out for 1e-10"
        raise ProblemError(f"tolerance = {tolerance!r} must lie between 0 and 1; {remedy}")
    if max_iterations is not None and max_iterations < 1:
        problem_words = f"max_iterations = {max_iterations} leaves nothing to do"
        raise ProblemError(f"{problem_words}; give 1 or more")
    if max_iterations is not None and solver == SEPARABLE:
        remedy = f"leave it out, or give solver={BUNDLE!r}"
        raise ProblemError(f"max_iterations is of {BUNDLE} alone; {remedy}")
    return solve_contact(problem, solver, tolerance, max_iterations, branch, start)


def all_solutions(
    problem: ContactProblem,
    *,
    max_boxes: int = 20_000,
    max_seconds: float = 60.0,
    law_error: float = LAW_ERROR,
) -> Equilibria:
    """Return every solution of the problem, stable or not, and whether the list is complete.

    max_boxes, max_seconds: where the search ends, with the solutions found so far
    law_error: error of the polygon that stands for a law with exponential pieces, relative to the
               scale of the law; the list is then of the polygon's solutions

    The answer has, lowest energy first, v (S, m) [m], energy (S,) [J/m] and stable (S,), strict
    local minima. It is complete, which is proved (contact/all_solutions.py), or has a reason and
    the undecided pieces. The first solution of a complete list is the global minimum.
    Raises ProblemError for limits that leave nothing to do and a law_error out of range.
    """
    if not (max_boxes >= 1 and max_seconds > 0.0):
        limits = f"max_boxes = {max_boxes!r}, max_seconds = {max_seconds!r}"
        raise ProblemError(f"{limits} leave nothing to do; give more")
    if not MIN_LAW_ERROR <= law_error < 1.0:
        raise ProblemError(f"law_error = {law_error!r} must lie between 1e-8 and 1")
    try:
        return known_solutions(problem, Limits(max_boxes, max_seconds), law_error)
    except (GrowthError, ValueError) as error:
        raise ProblemError(f"no list of solutions: {error}") from error


def certify(
    problem: ContactProblem, v: ArrayLike | Answer, tolerance: float | None = None
) -> Certificate:
    """Return what is proved of a solution v (m,), with λ₁ and ω (method §5).

    Its flags are `unique`, `strict_minimum` and `global_minimum`. A flag that is False means "not
    certified", not the opposite. Raises ProblemError if v does not fit.
    """
    if isinstance(v, Answer):
        solution = v.v
        residual: float | None = v.inclusion_residual
    else:
        solution = _vector("v", v, problem.m)
        residual = None
    return certificates.certify(problem, solution, tolerance=tolerance, residual=residual)


def follow(
    problem: ContactProblem,
    l_1: ArrayLike,
    v: ArrayLike | Answer,
    *,
    t: float = 0.0,
    t_min: float = -np.inf,
    t_max: float = np.inf,
    direction: Direction = "both",
    max_pieces: int = 20_000,
) -> Path:
    """Return the solutions connected to v when the load is l̃ + t l_1, an exact polygon in (v, t).

    The path goes through folds (method §7).

    l_1:          (m,) load per unit of t [N/m]
    v:            (m,) solution at the parameter t (or the answer of `solve`) [m]
    t_min, t_max: the path ends where t leaves this range
    direction:    "both", "forward" (t grows at the start) or "backward"
    max_pieces:   the path ends after so many pieces

    The path has `t` (k,), `u` (k, m), `traction` (k, m) and `stable` (k−1,) of its vertices and
    pieces, and at both ends the reason why it stops. Raises ProblemError if the laws are not
    piecewise linear, if v is no solution or t lies outside the range.
    """
    start = v.v if isinstance(v, Answer) else _vector("v", v, problem.m)
    load_per_t = _vector("l_1", l_1, problem.m)
    first_t = t_min if np.isfinite(t_min) else t
    last_t = t_max if np.isfinite(t_max) else t + 1.0
    parametric = ParametricProblem(
        problem.A_tilde,
        problem.l_tilde,
        load_per_t,
        problem.c,
        problem.law,
        (first_t, last_t),
        loose=problem.body.loose,
    )
    _check_name("direction", direction, ("both", "forward", "backward"))
    follower = Follower(t_min=t_min, t_max=t_max, max_pieces=max_pieces)
    try:
        return follower.follow(parametric, start, t, direction)
    except (NoSolutionError, ValueError) as error:
        raise ProblemError(f"no path: {error}") from error


def _checked_law(law: object, m: int) -> Laws:
    """Return the law, or the laws of the nodes, as one record. Raises ProblemError."""
    if isinstance(law, Laws) and (law.one or np.shape(law.index) == (m,)):
        return law
    laws: list[Any] = []
    if isinstance(law, Sequence) and not isinstance(law, str):
        laws = list(law)
    unfit = [item for item in laws if not (isinstance(item, Laws) and item.one)]
    if unfit or not laws:
        kind = type(unfit[0] if unfit else law).__name__
        remedy = "make it by tcstudy.law(name, …), or give a list of such, one a node"
        raise ProblemError(f"law is a {kind}; {remedy}")
    if len(laws) != m:
        problem = f"law has {len(laws)} laws, but c has {m} nodes"
        raise ProblemError(f"{problem}; give one law, or one a node")
    return nodal(laws, np.arange(m))


def _check_name(kind: str, name: object, names: Sequence[str]) -> None:
    if name not in names:
        raise ProblemError(f"there is no {kind} {name!r}; use one of {', '.join(names)}")


def _finite_array(name: str, value: object, shape: str) -> Array:
    """Return a copy as doubles. Raises ProblemError unless all are finite numbers."""
    try:
        plain = np.asarray(value)
    except ValueError:  # rows of several lengths
        plain = np.asarray(None)
    if plain.dtype.kind not in "biuf":
        kind = type(value).__name__
        raise ProblemError(f"{name} must be an array {shape} of real numbers, not {kind}")
    array = plain.astype(float)
    is_finite = np.isfinite(array)
    if not np.all(is_finite):
        place = ", ".join(map(str, np.argwhere(~is_finite)[0]))
        raise ProblemError(f"{name}[{place}] is not a finite number; look where it is computed")
    return array


def _vector(name: str, value: object, m: int | None) -> Array:
    """Return a copy of a vector (m,); any length but 0 without m. Raises ProblemError."""
    array = _finite_array(name, value, "(m,)")
    if array.ndim != 1 or not len(array) or m not in (None, len(array)):
        shape = f"({m},), one number a contact node" if m else "(m,) with m > 0"
        raise ProblemError(f"{name} has the shape {array.shape}; it must be {shape}")
    return array


def _stiffness(value: object, m: int) -> Array:
    """Return Ã, symmetric and positive definite or semidefinite. Raises ProblemError.

    Both are judged after its diagonal is scaled to 1, so that units do not matter. A semidefinite
    one is of a body that contact alone holds.
    """
    A = _finite_array("A_tilde", value, "(m, m)")
    if A.shape != (m, m):
        shape = f"A_tilde has the shape {A.shape}, but c has {m} nodes"
        raise ProblemError(f"{shape}; it must be ({m}, {m})")
    diagonal = np.diagonal(A)
    if not np.all(diagonal > 0.0):
        i = int(np.argmin(diagonal))
        problem = f"A_tilde[{i}, {i}] = {diagonal[i]:g}: A_tilde is not positive definite"
        raise ProblemError(f"{problem}; check its sign")
    scale = np.sqrt(diagonal)
    scaled = A / scale[:, None] / scale
    asymmetry = np.abs(scaled - scaled.T)
    if np.max(asymmetry) > MAX_ASYMMETRY:
        i, j = divmod(int(np.argmax(asymmetry)), m)
        entries = f"[{i}, {j}] = {A[i, j]:g}, [{j}, {i}] = {A[j, i]:g}"
        raise ProblemError(f"A_tilde is not symmetric: {entries}; check the condensation")
    symmetric = 0.5 * (scaled + scaled.T)
    try:
        scipy.linalg.cholesky(symmetric, lower=True)
    except scipy.linalg.LinAlgError:
        least = float(scipy.linalg.eigvalsh(symmetric, subset_by_index=[0, 0])[0])
        if least >= -SEMIDEFINITE:
            return 0.5 * (A + A.T)
        eigenvalue = f"smallest eigenvalue {least:.1e} with its diagonal scaled to 1"
        remedy = "it must have the sign of a stiffness"
        raise ProblemError(f"A_tilde is not positive definite ({eigenvalue}); {remedy}") from None
    return 0.5 * (A + A.T)
