"""The contact problem for people with their own matrices: checked when it is made, then solved,
certified, followed.

Problem:    find v with ξ = l̃ − Ãv and ξ_i ∈ c_i b̂(v_i), i = 1..m: 0 ∈ ∂L̃(v), L̃(v) = ½vᵀÃv − l̃ᵀv + Σ c_i j(v_i)
Units:      any consistent ones; those named here are of a plane body of unit thickness in SI
Literature: Šestak & Jovanović, Appl. Math. Mech. 31 (2010), eqs. (20), (21); tcstudy/METHOD.md §3

What is wrong with the data is a `ProblemError` of one line. Left out: sparse Ã (condense it onto
the contact nodes).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.linalg
from numpy.typing import ArrayLike, NDArray

from tcstudy.contact import certificates
from tcstudy.contact.all_solutions import LAW_ERROR, Equilibria, Limits
from tcstudy.contact.certificates import Certificate
from tcstudy.contact.path.follow import Follower, ParametricProblem, Path
from tcstudy.contact.path.walk import NoSolutionError
from tcstudy.contact.problem import ContactProblem as PlainProblem
from tcstudy.contact.solve import Answer, known_solutions, solve_contact
from tcstudy.errors import ProblemError
from tcstudy.laws.composed import nodal
from tcstudy.laws.laws import Laws
from tcstudy.laws.pieces import GrowthError
from tcstudy.laws.shapes import SHAPES
from tcstudy.scene.path_plan import Direction
from tcstudy.scene.solver_plan import BRANCHES, BUNDLE, SEPARABLE, SOLVERS, Branch

__all__ = ["ContactProblem", "all_solutions", "certify", "follow", "law", "solve"]

Array = NDArray[np.float64]
ASYMMETRY = 1e-10
"""Largest |Ã_ij − Ã_ji|/√(Ã_ii Ã_jj) that counts as rounding of a condensation; it is averaged
away."""


def law(name: str = "piecewise-linear", **parameters: Any) -> Laws:
    """A friction law b by its name and parameters, or by its points.

        law("slip-weakening", tau_s=2e7, tau_k=5e6, delta=4e-5)
        law(points=[(0, 2e7), (4e-5, 5e6)])  # straight between them, mirrored to s < 0 (odd=False: not)

    Names and parameters are those of a study's section `friction`
    (configs/howto/laws.md); numbers in consistent units: tractions [Pa], slips [m], stiffness k and slope [Pa/m].

    Raises ProblemError for an unknown name, a missing or meaningless parameter, or a law that
    violates growth condition (15) or (16) of the paper.
    """
    if name not in SHAPES:
        raise ProblemError(f"there is no law {name!r}; use one of {', '.join(SHAPES)}")
    try:
        return SHAPES[name].build(**parameters)
    except (GrowthError, ValueError) as error:
        raise ProblemError(f"law {name}: {error}") from error


@dataclass(frozen=True, eq=False, repr=False)
class ContactProblem(PlainProblem):
    """0 ∈ Ãv − l̃ + ∂Ψ(v), Ψ(v) = Σ c_i j(v_i), for the tangential displacements v of the m contact
    nodes.

    A_tilde: (m, m) symmetric positive definite, stiffness condensed onto the contact nodes [Pa]
    l_tilde: (m,) condensed load [N/m]
    c:       (m,) length of Γ_C that belongs to each node, > 0 [m]
    law:     friction law b [Pa] of the slip [m], of `tcstudy.law`, or a list of m laws, one a node

    The arrays are copied; Ã is symmetrised where it is asymmetric by rounding only. `energy(v)`,
    `xi(v)`, `inclusion_residual(v)` and `lambda_1` (method §5) are of the problem.

    Raises ProblemError for shapes that do not fit, numbers that are not finite, c ≤ 0, and an
    asymmetric, singular or indefinite Ã.
    """

    def __post_init__(self) -> None:
        c = _vector("c", self.c, None)
        if not np.all(c > 0.0):
            i = int(np.argmin(c))
            raise ProblemError(
                f"c[{i}] = {c[i]:g} is no length; every node needs a part of the contact line, c > 0"
            )
        object.__setattr__(self, "law", _law(self.law, len(c)))
        checked = {"A_tilde": _stiffness(self.A_tilde, len(c)), "l_tilde": _vector("l_tilde", self.l_tilde, len(c)),
                   "c": c}  # fmt: skip
        for name, array in checked.items():
            array.flags.writeable = False
            object.__setattr__(self, name, array)

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
    """A solution v of the problem, judged by its inclusion residual max_i dist(ξ_i/c_i,
    b̂(v_i))/(scale of b), eq. (21).

    solver:    "separable-newton" or "bundle-newton"
    tolerance: largest inclusion residual, strict; None for 1e-10 or what rounding to doubles allows
    max_iterations: of bundle-newton alone, None for its own limit
    branch:    "lowest" (the lowest found from all starts and by a search for less), "continued" (from the neighbour) or
               "from-zero"
    neighbour: (m,) solution of a neighbouring problem [m], if there is one

    The answer has v [m], xi [N/m], energy [J/m], inclusion_residual, and a status that is
    Status.CONVERGED or else has a reason: a failure is no exception. Raises ProblemError for
    unknown names and a neighbour that does not fit.
    """
    _one_of("solver", solver, SOLVERS)
    _one_of("branch", branch, BRANCHES)
    start = None if neighbour is None else _vector("neighbour", neighbour, problem.m)
    if tolerance is not None and not 0.0 < tolerance < 1.0:
        raise ProblemError(
            f"tolerance = {tolerance!r} must lie between 0 and 1; leave it out for 1e-10"
        )
    if max_iterations is not None and max_iterations < 1:
        raise ProblemError(
            f"max_iterations = {max_iterations} leaves nothing to do; give 1 or more"
        )
    if max_iterations is not None and solver == SEPARABLE:
        raise ProblemError(
            f"max_iterations is of {BUNDLE} alone; leave it out, or give solver={BUNDLE!r}"
        )
    return solve_contact(problem, solver, tolerance, max_iterations, branch, start)


def all_solutions(
    problem: ContactProblem,
    *,
    max_boxes: int = 20_000,
    max_seconds: float = 60.0,
    law_error: float = LAW_ERROR,
) -> Equilibria:
    """Every solution of the problem, stable or not, and whether these are proved to be all
    (contact/all_solutions.py).

    max_boxes, max_seconds: where the search for more ends, with what is found so far law_error: of
    the polygon that stands for a law with exponential pieces, relative to its scale; all is then
    said of
               the polygon

    The answer has, lowest energy first, v (S, m) [m], energy (S,) [J/m] and stable (S,), strict
    local minima; complete, or else a reason and the undecided pieces. Complete, its first is the
    global minimum. Raises ProblemError for limits that leave nothing to do and a law_error that is
    none.
    """
    if not (max_boxes >= 1 and max_seconds > 0.0):
        raise ProblemError(
            f"max_boxes = {max_boxes!r}, max_seconds = {max_seconds!r} leave nothing to do; give more"
        )
    if not 1e-8 <= law_error < 1.0:
        raise ProblemError(f"law_error = {law_error!r} must lie between 1e-8 and 1")
    try:
        return known_solutions(problem, Limits(max_boxes, max_seconds), law_error)
    except (GrowthError, ValueError) as error:
        raise ProblemError(f"no list of solutions: {error}") from error


def certify(
    problem: ContactProblem, v: ArrayLike | Answer, tolerance: float | None = None
) -> Certificate:
    """What is proved of a solution v (m,): `unique`, `strict_minimum`, `global_minimum`, with λ₁
    and ω (method §5).

    A flag that is False means "not certified", not the opposite. Raises ProblemError if v does not
    fit.
    """
    at, residual = (
        (v.v, v.inclusion_residual) if isinstance(v, Answer) else (_vector("v", v, problem.m), None)
    )
    return certificates.certify(problem, at, tolerance=tolerance, residual=residual)


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
    """The solutions that are connected to v when the load is l̃ + t l_1: a polygon in (v, t),
    exact, through folds (§7).

    l_1:          (m,) load per unit of t [N/m]
    v:            (m,) solution at the parameter t (or the answer of `solve`) [m]
    t_min, t_max: the path ends where t leaves this range
    direction:    "both", "forward" (t grows at the start) or "backward"

    The path has `t` (k,), `u` (k, m), `traction` (k, m) and `stable` (k−1,) of its vertices and
    pieces, and says at both ends why it stops. The laws must be piecewise linear. Raises
    ProblemError if it is not, if v is no solution or t lies outside the range.
    """
    start = v.v if isinstance(v, Answer) else _vector("v", v, problem.m)
    load, per_t = problem.l_tilde, _vector("l_1", l_1, problem.m)
    span = t_min if np.isfinite(t_min) else t, t_max if np.isfinite(t_max) else t + 1.0
    along = ParametricProblem(problem.A_tilde, load, per_t, problem.c, problem.law, span)
    _one_of("direction", direction, ("both", "forward", "backward"))
    try:
        return Follower(t_min=t_min, t_max=t_max, max_pieces=max_pieces).follow(
            along, start, t, direction
        )
    except (NoSolutionError, ValueError) as error:
        raise ProblemError(f"no path: {error}") from error


def _law(given: object, m: int) -> Laws:
    """The law, or the laws of the nodes."""
    if isinstance(given, Laws) and (given.one or np.shape(given.index) == (m,)):
        return given
    laws = list(given) if isinstance(given, Sequence) and not isinstance(given, str) else []
    wrong = next((law for law in laws if not (isinstance(law, Laws) and law.one)), None)
    if wrong is not None or not laws:
        kind = type(given if wrong is None else wrong).__name__
        raise ProblemError(
            f"law is a {kind}; make it by tcstudy.law(name, …), or give a list of such, one a node"
        )
    if len(laws) != m:
        raise ProblemError(
            f"law has {len(laws)} laws, but c has {m} nodes; give one law, or one a node"
        )
    return nodal(laws, np.arange(m))


def _one_of(what: str, name: object, names: Sequence[str]) -> None:
    if name not in names:
        raise ProblemError(f"there is no {what} {name!r}; use one of {', '.join(names)}")


def _numbers(name: str, given: object, shape: str) -> Array:
    """A copy as doubles, all finite."""
    try:
        plain = np.asarray(given)
    except ValueError:  # rows of several lengths
        plain = np.asarray(None)
    if plain.dtype.kind not in "biuf":
        raise ProblemError(
            f"{name} must be an array {shape} of real numbers, not {type(given).__name__}"
        )
    array = plain.astype(float)
    if not np.all(np.isfinite(array)):
        where = ", ".join(map(str, np.argwhere(~np.isfinite(array))[0]))
        raise ProblemError(f"{name}[{where}] is not a finite number; look where it is computed")
    return array


def _vector(name: str, given: object, m: int | None) -> Array:
    array = _numbers(name, given, "(m,)")
    if array.ndim != 1 or not len(array) or m not in (None, len(array)):
        wanted = f"({m},), one number a contact node" if m else "(m,) with m > 0"
        raise ProblemError(f"{name} has the shape {array.shape}; it must be {wanted}")
    return array


def _stiffness(given: object, m: int) -> Array:
    """Ã, symmetric and positive definite; both judged after scaling its diagonal to 1, so that
    units do not matter."""
    A = _numbers("A_tilde", given, "(m, m)")
    if A.shape != (m, m):
        raise ProblemError(
            f"A_tilde has the shape {A.shape}, but c has {m} nodes; it must be ({m}, {m})"
        )
    diagonal = np.diagonal(A)
    if not np.all(diagonal > 0.0):
        i = int(np.argmin(diagonal))
        raise ProblemError(
            f"A_tilde[{i}, {i}] = {diagonal[i]:g}: A_tilde is not positive definite; check its sign"
        )
    scale = np.sqrt(diagonal)
    unit = A / scale[:, None] / scale
    apart = np.abs(unit - unit.T)
    if np.max(apart) > ASYMMETRY:
        i, j = divmod(int(np.argmax(apart)), m)
        raise ProblemError(
            f"A_tilde is not symmetric: [{i}, {j}] = {A[i, j]:g}, [{j}, {i}] = {A[j, i]:g}; check the condensation"
        )
    try:
        scipy.linalg.cholesky(0.5 * (unit + unit.T), lower=True)
    except scipy.linalg.LinAlgError:
        least = float(scipy.linalg.eigvalsh(0.5 * (unit + unit.T), subset_by_index=[0, 0])[0])
        raise ProblemError(
            f"A_tilde is not positive definite (least eigenvalue {least:.1e} with its diagonal scaled to 1); the body "
            "must be held, and the sign be that of a stiffness"
        ) from None
    return 0.5 * (A + A.T)
