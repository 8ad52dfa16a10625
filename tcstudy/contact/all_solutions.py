"""All solutions of a contact problem with piecewise-linear laws, and the proof that they are all.

Statement: for the given doubles Ã, l̃, c and the polygons through the laws' values at their kinks
           the search finds all cells (one side of its polygon for every node) that may hold a
           solution. In a cell the problem is linear. It has one solution if its matrix is proved
           regular and the solution inside, none if that is proved outside. Otherwise it is
           undecided (a solution on a kink within rounding, as exact symmetry makes them, or a
           singular cell).
Count:     with growth (15), (16) and Ã positive definite the degree is 1, so that the number of
           regular solutions is odd: a check of every list
Stable:    a strict local minimum of L̃: no node inside a down-jump, and Ã + C diag b′ positive
           definite on the nodes off the jumps

Left out: laws with exponential pieces. The caller names the polygon that replaces them
(`laws.composed.piecewise_linear`), which is another problem.

The search is in contact/boxes.py.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from tcstudy.contact.boxes import Limits, PolygonProblems, reach_of
from tcstudy.contact.certificates import strict_minimum
from tcstudy.contact.problem import CondensedBody, ContactProblem
from tcstudy.laws.composed import piecewise_linear
from tcstudy.laws.laws import Laws
from tcstudy.laws.pieces import BEND

Array = NDArray[np.float64]
Index = NDArray[np.intp]
Flags = NDArray[np.bool_]

SAME = 1e-7
"""Solutions that differ by less than this part of the largest slip are the same."""
LAW_ERROR = 1e-3
"""Error of the polygon of a law with exponential pieces, relative to its scale."""


@dataclass(frozen=True, eq=False)
class Equilibria:
    """The solutions of one problem, lowest energy first.

    v:         (S, m) slips [m], each proved to be within rounding of one solution, or found by the
               solver where these are not all;  xi: (S, m) l̃ − Ãv [N/m]
    energy:    (S,) L̃ [J/m];  stable: (S,) strict local minimum
    sides:     (S, m) side of its polygon that every node is on, which identifies a solution
    complete:  True if these are proved to be all;  reason: why they are not, "" if they are
    undecided: (U, m) sides of the cells that may hold one more solution each
    boxes:     number of boxes of the search
    law_error: error of the polygon that replaces an exponential law, relative to its scale; 0
               without one
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


def all_solutions(
    problem: ContactProblem, limits: Limits | None = None, law_error: float = LAW_ERROR
) -> Equilibria:
    """Return every solution of one problem, with the polygons of laws with exponential pieces."""
    return of_rows(problem.rows, limits, law_error, problem.lambda_1)[0]


def of_rows(
    rows: ContactProblem,
    limits: Limits | None = None,
    law_error: float = LAW_ERROR,
    lambda_1: float | None = None,
) -> list[Equilibria]:
    """Return every solution of each row of problems on one body.

    lambda_1: λ₁ of the body if known [Pa/m]
    """
    A_tilde, c, loads = rows.A_tilde, rows.c, rows.l_tilde
    limits = limits or Limits()
    lambda_1 = lambda_1 or rows.body.lambda_1
    laws = polygon_laws(rows, law_error, lambda_1)
    problems = PolygonProblems(A_tilde, c, laws, loads, lambda_1)
    cells = problems.search(limits)
    load_of_cell = loads[cells.problem]
    segments = problems.segments(cells.problem, cells.sides, load_of_cell, problems.change)
    is_undecided = ~segments.has_segment & ~segments.is_empty
    is_exponential = np.any(rows.law.bent, axis=-1)
    has_exponential = is_exponential[rows.law.index].any(-1)
    errors = np.broadcast_to(np.where(has_exponential, law_error, 0.0), len(loads))
    body = CondensedBody.known(A_tilde, c, lambda_1=lambda_1)
    equilibria = []
    for row in range(len(loads)):
        is_in_row = cells.problem == row
        is_solution = is_in_row & segments.has_segment
        undecided = cells.sides[is_in_row & is_undecided]
        v = segments.u[is_solution, 0]
        row_of_v = np.full(len(v), row)
        solved = ContactProblem.on(body, loads[row_of_v], laws.at(rows.law.index[row_of_v]))
        energy = solved.energy(v)
        stable = strict_minimum(solved, v)
        boxes = int(cells.boxes[row])
        limit = limits.met(boxes) if cells.stopped[row] else ""
        reason = unproved(limit, len(undecided), len(v))
        order = np.argsort(energy, kind="stable")
        equilibria.append(
            Equilibria(
                v=v[order],
                xi=solved.xi(v[order]),
                energy=energy[order],
                stable=stable[order],
                sides=cells.sides[is_solution][order],
                complete=not reason,
                reason=reason,
                undecided=undecided,
                boxes=boxes,
                law_error=float(errors[row]),
            )
        )
    return equilibria


def polygon_laws(rows: ContactProblem, law_error: float, lambda_1: float) -> Laws:
    """Return the laws of rows of problems with straight pieces in the place of exponential ones."""
    laws = rows.law
    if laws.piecewise_linear:
        return laws
    reach = reach_of(rows.c, laws, rows.l_tilde, lambda_1)
    largest_slip = float(np.max(reach, initial=0.0))
    return laws.mapped(lambda law: piecewise_linear(law, law_error, largest_slip))


def with_solution(equilibria: Equilibria, problem: ContactProblem, v: Array) -> Equilibria:
    """Return the solutions of one problem and v (m,), another one, unless it is among them.

    The laws of the problem must be piecewise linear.
    """
    largest = float(np.max(np.abs(v), initial=0.0))
    distance = np.max(np.abs(equilibria.v - v), axis=1, initial=0.0)
    if np.any(distance <= SAME * largest):
        return equilibria
    energy = np.append(equilibria.energy, problem.energy(v))
    order = np.argsort(energy, kind="stable")
    stable = np.append(equilibria.stable, strict_minimum(problem.rows, v[None]))
    xi = problem.xi(v)
    sides = sides_at(problem.law, v)
    return replace(
        equilibria,
        v=np.concatenate([equilibria.v, v[None]])[order],
        xi=np.concatenate([equilibria.xi, xi[None]])[order],
        energy=energy[order],
        stable=stable[order],
        sides=np.concatenate([equilibria.sides, sides[None]])[order],
    )


def sides_at(laws: Laws, v: Array) -> Index:
    """Return the side of its polygon that every slip v (m,) is on, at a bend the left one."""
    place = laws.locate(v)
    is_upright = place.on & (laws.kind(place) != BEND)
    # a law of K kinks has K + 1 pieces, but 2 K + 1 codes of pieces and upright sides
    codes = 2 * place.piece + is_upright - laws.node_index(len(v))
    return sides_of_codes(laws)[codes]


def sides_of_codes(laws: Laws) -> Index:
    """Return the side of its polygon that every code of the laws' graph is.

    The polygons leave out the upright sides where a law only bends.
    """
    kinds = laws.tables.kinds
    is_side = np.ones((len(kinds), 2 * kinds.shape[1] + 1), dtype=bool)
    is_side[:, 1::2] = kinds != BEND
    sides = np.cumsum(is_side, axis=-1) - 1
    return np.asarray(sides.ravel(), dtype=np.intp)


def unproved(limit: str, undecided: int, count: int) -> str:
    """Return why solutions of a load, or of a range, are not proved to be all, "" if they are.

    limit:     that was met, in words
    undecided: number of undecided cells
    count:     of the solutions, where a range begins
    """
    if limit:
        return f"the limit of {limit}"
    if undecided:
        plural = "s" if undecided > 1 else ""
        return (
            f"{undecided} combination{plural} of pieces of the law cannot be decided within "
            "rounding (a solution on a kink, as exact symmetry makes them, or a singular piece)"
        )
    if count % 2 == 0:
        return f"the number of solutions, {count}, is even, which no regular problem has"
    return ""
