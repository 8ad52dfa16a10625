"""Every solution of a contact problem with piecewise-linear laws, stable or not, proved to be all or said why not.

Statement:  of the given doubles Ã, l̃, c and the polygons through the laws' values at their kinks `boxes` finds all
            cells (one side of its polygon for every node) that may hold a solution. In a cell the problem is linear:
            one solution if its matrix is proved regular and the solution inside, none if that is proved outside, else
            undecided (a solution on a kink within rounding, as exact symmetry makes them, or a singular cell)
Count:      with growth (15), (16) and Ã positive definite the degree is 1, so that the number of regular solutions is
            odd: a check of every list
Stable:     a strict local minimum of L̃: no node inside a jump down, and Ã + C diag b′ positive definite on the nodes
            off the jumps

Left out: laws with exponential pieces; their polygon is another problem
(`path.piecewise_linear_approximation`), which the caller names.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tcstudy.contact.boxes import EPS, Limits, PolygonProblems, inverse_of, reach_of
from tcstudy.contact.certificates import strict_minimum
from tcstudy.contact.path.piecewise_linear_approximation import piecewise_linear
from tcstudy.contact.problem import CondensedBody, ContactProblem
from tcstudy.laws.laws import Laws

Array = NDArray[np.float64]
Index = NDArray[np.intp]
Flags = NDArray[np.bool_]

LAW_ERROR = 1e-3
"""Of the polygon of a law with exponential pieces, relative to its scale."""


@dataclass(frozen=True, eq=False)
class Equilibria:
    """The solutions of one problem, lowest energy first.

    v:         (S, m) slips [m], each proved to be within rounding of one solution;  xi: (S, m) l̃ − Ãv [N/m]
    energy:    (S,) L̃ [J/m];  stable: (S,) strict local minimum
    sides:     (S, m) side of its polygon that every node is on, which tells solutions apart
    complete:  True if these are proved to be all;  reason: why they are not, "" if they are
    undecided: (U, m) sides of the cells that may hold one more solution each
    boxes:     number that was looked at
    law_error: 0, or of the polygon that stands for an exponential law and that all this is of, relative to its scale
    """

    v: Array
    xi: Array
    energy: Array
    stable: Flags
    sides: Index
    complete: bool
    reason: str
    undecided: Index
    boxes: int
    law_error: float = 0.0

    def __len__(self) -> int:
        return len(self.v)


def all_solutions(problem: ContactProblem, limits: Limits | None = None, law_error: float = LAW_ERROR) -> Equilibria:
    """Every solution of one problem; of laws with exponential pieces every one of their polygon."""
    load = problem.l_tilde[None]
    return of_rows(problem.A_tilde, problem.c, problem.law, load, problem.lambda_1, limits, law_error)[0]


def of_rows(
    A_tilde: Array,
    c: Array,
    laws: Laws,
    loads: Array,
    lambda_1: float,
    limits: Limits | None = None,
    law_error: float = LAW_ERROR,
) -> list[Equilibria]:
    """The same of P problems on one body.

    laws: of one problem or of all (index of the shape (), (m,), (R, 1) or (R, m), R = 1 or P)
    loads: (P, m) [N/m];  lambda_1: of the body [Pa/m]
    """
    errors = np.zeros(len(loads))
    if not laws.piecewise_linear:
        errors[:] = np.where(np.any(laws.tables.bent, axis=-1)[np.atleast_2d(laws.index)].any(-1), law_error, 0.0)
        far = float(np.max(reach_of(c, laws, loads, lambda_1), initial=0.0))
        laws = laws.mapped(lambda law: piecewise_linear(law, law_error, far))
    limits, count = limits or Limits(), len(loads)
    problems = PolygonProblems(A_tilde, c, laws, loads, reach_of(c, laws, loads, lambda_1))
    cells = problems.search(problems.whole(np.arange(count)), limits)
    v, inside, outside = solved(problems, cells.problem, cells.sides)
    body, index = CondensedBody.known(A_tilde, c, lambda_1=lambda_1), np.atleast_2d(laws.index)
    found = []
    for i in range(count):
        own = cells.problem == i
        sure, undecided = own & inside, cells.sides[own & ~inside & ~outside]
        own_v, sides = v[sure], cells.sides[sure]
        own_laws = laws.tables.at(np.repeat(index[[min(i, len(index) - 1)]], len(sides), axis=0))
        rows = ContactProblem.on(body, np.repeat(loads[[i]], len(sides), axis=0), own_laws)
        energy, stable = rows.energy(own_v), strict_minimum(rows, own_v)
        reason = _reason(int(cells.boxes[i]), bool(cells.stopped[i]), len(undecided), len(sides), limits)
        k, told = np.argsort(energy, kind="stable"), (not reason, reason, undecided, int(cells.boxes[i]))
        found.append(Equilibria(own_v[k], rows.xi(own_v)[k], energy[k], stable[k], sides[k], *told, float(errors[i])))
    return found


def _reason(boxes: int, stopped: bool, undecided: int, count: int, limits: Limits) -> str:
    """Why a list is not proved complete; empty if it is."""
    if stopped:
        what = "boxes" if boxes > limits.boxes else "seconds"
        return f"the limit of {getattr(limits, what):g} {what} was met"
    if undecided:
        return (
            f"{undecided} combination{'s' if undecided > 1 else ''} of pieces of the law cannot be decided within "
            "rounding (a solution on a kink, as exact symmetry makes them, or a singular piece)"
        )
    return "" if count % 2 else f"the number of solutions, {count}, is even, which no regular problem has"


def solved(problems: PolygonProblems, problem: Index, sides: Index) -> tuple[Array, Flags, Flags]:
    """(v (n, m), whether it is proved inside its cell, whether the cell is proved to have none) of cells (n, m)."""
    m, step = problems.m, max(1, 2_000_000 // problems.m**2)
    parts = [(np.empty((0, m)), np.empty(0, dtype=bool), np.empty(0, dtype=bool))]
    for first in range(0, len(problem), step):
        own, k = problem[first : first + step], sides[first : first + step]
        p, D = problems.ends(own, k)
        M, size, scale = problems.matrix(D)
        Y, rho = inverse_of(M, size, scale)
        load, largest = problems.load[own], np.abs(p) + np.abs(D)
        noise = np.abs(load) + largest[..., 0] @ problems.size_of_A + problems.c * largest[..., 1]
        tau = (Y @ (load - p[..., 0] @ problems.A - problems.c * p[..., 1])[..., None])[..., 0]
        error = 4.0 * (m + 8) * EPS * (np.abs(Y) @ noise[..., None])[..., 0]
        share = np.where(np.isfinite(rho), rho / (1.0 - np.minimum(rho, 0.5)), 0.0)[:, None]
        error += share * (np.abs(tau) + error).max(-1, keepdims=True)
        tau, error = tau / scale, error / scale
        good = np.isfinite(rho) & np.isfinite(tau).all(-1)
        outside = good & ((tau < -error) | (tau > 1.0 + error)).any(-1)
        inside = good & ((tau > error) & (tau < 1.0 - error)).all(-1)
        parts.append((p[..., 0] + tau * D[..., 0], inside, outside))
    v, inside, outside = (np.concatenate(x) for x in zip(*parts, strict=True))
    return v, inside, outside
