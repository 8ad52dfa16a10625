"""All solutions of a contact problem with piecewise-linear laws, and the proof that they are all.

Statement: for the given doubles Ã, l̃, c and the polygons through the laws' values at their kinks
           the search finds all cells (one side of its polygon for every node) that may hold a
           solution. In a cell the problem is linear. It has one solution if its matrix is proved
           regular and the solution inside, none if that is proved outside. Otherwise the sides
           that the solution touches within rounding are decided together (contact/curves.py).
           What is then undecided is a point where branches meet on kinks, or a singular cell.
Fine mesh: a problem of many boxes is searched by amplitudes of its soft modes
           (contact/soft_modes.py), then, if limits stop that, as it began.
Count:     with growth (15), (16) and Ã positive definite the degree is 1, so that the number of
           regular solutions is odd: a check of every list
Stable:    a strict local minimum of L̃: no node inside a down-jump, and Ã + C diag b′ positive
           definite on the nodes off the jumps

Left out: laws with exponential pieces. The caller names the polygon that replaces them
(`laws.composed.piecewise_linear`), which is another problem.

The search of boxes is in contact/boxes.py.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from tcstudy.contact.boxes import Cells, Limits, PolygonProblems, reach_of, reach_of_openings
from tcstudy.contact.certificates import strict_minimum
from tcstudy.contact.curves import Found, GraphPart, Parts, ties
from tcstudy.contact.descent import descend
from tcstudy.contact.problem import CondensedBody, ContactProblem
from tcstudy.contact.soft_modes import ModeAnswer, ModeSearch
from tcstudy.laws.composed import piecewise_linear
from tcstudy.laws.laws import Laws
from tcstudy.laws.pieces import BEND, DEBONDED, SOFTENING

Array = NDArray[np.float64]
Index = NDArray[np.intp]
Flags = NDArray[np.bool_]

SAME = 1e-7
"""Solutions that differ by less than this part of the largest slip are the same."""
LAW_ERROR = 1e-3
"""Error of the polygon of a law with exponential pieces, relative to its scale."""
FIRST_WORK = 6e10
"""Boxes times m⁵ of a problem after which it is searched by its soft modes, if it has some.

On coarse meshes more of the first search's cheap boxes are as fast.
"""
MIN_FIRST_BOXES = 8
"""Boxes before that on any mesh."""
FADING = 0.3
"""Logarithm by which the weight of a bend fades from one opening to the next, away from a front."""
_FRONT_TOLERANCE = 1e-6
"""Residual of the solution whose front it is."""
MODE_SHARE = 0.5
"""Share of the limits that this search has; the first one goes on with the rest of the time."""
_CELLS = (
    "of pieces of the law cannot be decided within rounding (a solution on a kink, as exact "
    "symmetry makes them, or a singular piece)"
)
OF_CELLS = (f"combination {_CELLS}", f"combinations {_CELLS}")
"""What is said of one undecided cell, and of many."""
_KINKS = (
    "where branches meet on kinks of the law, or a piece is singular: there the number of "
    "solutions within rounding is not defined"
)
ON_KINKS = (
    f"point of the law's graphs is undecided, {_KINKS}",
    f"points of the law's graphs are undecided, {_KINKS}",
)
"""What is said of one undecided part, and of many."""


@dataclass(frozen=True, eq=False)
class Equilibria:
    """The solutions of one problem, lowest energy first.

    v:         (S, m) slips [m], each proved to be within rounding of one solution, or found by the
               solver where these are not all;  xi: (S, m) l̃ − Ãv [N/m]
    energy:    (S,) L̃ [J/m];  stable: (S,) strict local minimum
    sides:     (S, m) side of its polygon that every node is on, which identifies a solution
    complete:  True if these are proved to be all;  reason: why they are not, "" if they are
    undecided: (U, m) first sides of parts of the graphs that may hold more solutions, each of them
               a piece or two beside each other for every node
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
    if rows.body.loose:
        return _of_loose_rows(rows, limits, law_error)
    return _of_rows(rows, limits, law_error, lambda_1 or rows.body.lambda_1)


def _of_loose_rows(
    rows: ContactProblem, limits: Limits | None, law_error: float
) -> list[Equilibria]:
    """Return the solutions of rows of a body that contact alone holds, where that bounds them."""
    from tcstudy.contact.loose_body import why_unbounded  # few bodies are loose

    equilibria = []
    for row in range(len(rows.l_tilde)):
        reason = why_unbounded(rows.single(row))
        if reason:
            equilibria.append(_none_known(rows.m, reason))
        else:
            equilibria += _of_rows(rows.take(np.array([row])), limits, law_error, 0.0)
    return equilibria


def _none_known(m: int, reason: str) -> Equilibria:
    """Return that no solution of m nodes is known, and why."""
    v, sides = np.zeros((0, m)), np.zeros((0, m), dtype=np.intp)
    energy, stable = np.zeros(0), np.zeros(0, dtype=bool)
    return Equilibria(v, v, energy, stable, sides, False, reason, sides, 0)


def _of_rows(
    rows: ContactProblem, limits: Limits | None, law_error: float, lambda_1: float
) -> list[Equilibria]:
    """Return every solution of each row; λ₁ is 0 for a body that contact alone holds."""
    A_tilde, c, loads = rows.A_tilde, rows.c, rows.l_tilde
    limits = limits or Limits()
    laws = polygon_laws(rows, law_error, lambda_1)
    problems = PolygonProblems(A_tilde, c, laws, loads, lambda_1)
    if np.all(laws.is_closed):
        problems.urgency = _near_front(ContactProblem.on(rows.body, loads, laws))
    cells, by_modes = searched(problems, limits, _by_modes)
    load_of_cell = loads[cells.problem]
    segments = problems.segments(cells.problem, cells.sides, load_of_cell, np.zeros(problems.m))
    is_undecided = ~segments.has_segment & ~segments.is_empty
    if rows.body.loose:  # where all nodes are free a cell is singular, and mostly not in balance
        cell = np.flatnonzero(is_undecided)
        loads_there = load_of_cell[cell]
        is_unbalanced = problems.unbalanced(cells.problem[cell], cells.sides[cell], loads_there)
        is_undecided[cell[is_unbalanced]] = False
    is_exponential = np.any(rows.law.bent, axis=-1)
    has_exponential = is_exponential[rows.law.index].any(-1)
    errors = np.broadcast_to(np.where(has_exponential, law_error, 0.0), len(loads))
    body = CondensedBody.known(A_tilde, c, lambda_1=lambda_1, loose=rows.body.loose or None)
    equilibria = []
    for row in range(len(loads)):
        is_in_row = cells.problem == row
        is_solution = is_in_row & segments.has_segment
        sides = cells.sides[is_solution]
        undecided_cells = cells.sides[is_in_row & is_undecided]
        found, undecided = _settled(problems, row, sides, undecided_cells, by_modes.get(row))
        v = np.concatenate([segments.u[is_solution, 0], *(one.v[None] for one in found)])
        sides = np.concatenate([sides, *(one.sides[None] for one in found)])
        row_of_v = np.full(len(v), row)
        solved = ContactProblem.on(body, loads[row_of_v], laws.at(rows.law.index[row_of_v]))
        energy = solved.energy(v)
        stable = strict_minimum(solved, v)
        stable[len(v) - len(found) :] = [one.stable for one in found]
        boxes = int(cells.boxes[row])
        limit = limits.met(boxes) if cells.stopped[row] else ""
        reason = unproved(limit, len(undecided), len(v), ON_KINKS)
        if row in by_modes:
            boxes += by_modes[row].boxes
        order = np.argsort(energy, kind="stable")
        equilibria.append(
            Equilibria(
                v=v[order],
                xi=solved.xi(v[order]),
                energy=energy[order],
                stable=stable[order],
                sides=sides[order],
                complete=not reason,
                reason=reason,
                undecided=np.array([part.first for part in undecided], dtype=np.intp).reshape(
                    -1, len(c)
                ),
                boxes=boxes,
                law_error=float(errors[row]),
            )
        )
    return equilibria


class Answered(Protocol):
    """What a search by modes says of itself."""

    @property
    def boxes(self) -> int:
        """Number of its boxes."""

    @property
    def stopped(self) -> bool:
        """Whether a limit ended it."""


AnswerT = TypeVar("AnswerT", bound=Answered)


def searched(
    problems: PolygonProblems,
    limits: Limits,
    by_modes_of: Callable[[PolygonProblems, list[int], Limits], dict[int, AnswerT]],
) -> tuple[Cells, dict[int, AnswerT]]:
    """Return the cells of all problems, and what the search by modes found of some.

    A problem of many boxes is searched by its soft modes. If limits stop that, the first search
    goes on. Where it does not, its cells are left out.

    by_modes_of: searches the named problems that have soft modes by these
    """
    first_boxes = max(MIN_FIRST_BOXES, int(FIRST_WORK / problems.m**5))
    if limits.boxes <= first_boxes:
        return problems.search(limits), {}
    cells = problems.search(replace(limits, boxes=first_boxes))
    has_too_many = cells.stopped & (cells.boxes > first_boxes)
    if not np.any(has_too_many):
        return cells, {}
    share = Limits(int(MODE_SHARE * limits.boxes), MODE_SHARE * limits.seconds)
    by_modes = by_modes_of(problems, np.flatnonzero(has_too_many).tolist(), share)
    is_answered = np.zeros(len(cells.boxes), dtype=bool)
    is_answered[[row for row, answer in by_modes.items() if not answer.stopped]] = True
    is_open = ~is_answered[cells.problem]
    cells = cells._replace(problem=cells.problem[is_open], sides=cells.sides[is_open])
    assert cells.waiting is not None
    is_left = ~is_answered[cells.waiting.problem]
    dropped = np.bincount(cells.waiting.problem[~is_left], minlength=len(cells.boxes))
    left = cells.waiting.take(is_left)
    stopped = cells.stopped & ~is_answered
    cells = cells._replace(boxes=cells.boxes - dropped, stopped=stopped, waiting=left)
    if len(left.low):
        seconds = (1.0 - MODE_SHARE) * limits.seconds if by_modes else limits.seconds
        cells = problems.search(replace(limits, seconds=seconds), cells)
    return cells, by_modes


def _by_modes(problems: PolygonProblems, rows: list[int], limits: Limits) -> dict[int, ModeAnswer]:
    searches = {row: ModeSearch(problems.single(row)) for row in rows}
    return {row: search.search(limits) for row, search in searches.items() if search.has_modes}


def _settled(
    problems: PolygonProblems,
    row: int,
    sides: Index,
    undecided_cells: Index,
    by_modes: ModeAnswer | None,
) -> tuple[list[Found], list[GraphPart]]:
    """Return the solutions of a problem beside those of cells, and the parts left undecided.

    sides:           (n, m) cells of known solutions
    undecided_cells: (n, m) cells that may hold others, on kinks of several cells
    """
    if by_modes is not None and not by_modes.stopped:
        return by_modes.solutions, by_modes.undecided
    known = [] if by_modes is None else by_modes.solutions
    undecided = list[GraphPart]()
    if len(undecided_cells):
        parts = Parts(problems.single(row))
        known, undecided = ties(parts, undecided_cells, known)
    return [one for one in known if not any(one.part.has(cell) for cell in sides)], undecided


def _near_front(rows: ContactProblem) -> Array:
    """Return (R, m) factors by which nodes next to the front of a solution are split first.

    The front is where openings have begun to soften, or else where the largest one is. An opening
    far from it hardly knows on which piece another one is.
    """
    m = rows.m
    v = descend(rows, np.zeros(rows.l_tilde.shape), _FRONT_TOLERANCE).v
    regions = rows.law.tables.regions.take(rows.law.locate(v).piece)
    has_fallen = (regions == SOFTENING) | (regions == DEBONDED)
    factors = np.empty(v.shape)
    node = np.arange(m)
    for row in range(len(v)):
        front = np.flatnonzero(has_fallen[row])
        if not len(front):
            front = np.array([np.argmax(v[row])])
        distance = np.abs(node[:, None] - front).min(axis=1)
        rank = np.empty(m)
        rank[np.argsort(distance, kind="stable")] = node
        factors[row] = np.exp(-FADING * rank)
    return factors


def polygon_laws(rows: ContactProblem, law_error: float, lambda_1: float) -> Laws:
    """Return the laws of rows of problems with straight pieces in the place of exponential ones."""
    laws = rows.law
    if laws.piecewise_linear:
        return laws
    if rows.body.loose:
        reach, _ = reach_of_openings(rows, np.zeros(rows.l_tilde.shape))
    else:
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
    is_side[:, 0] = ~laws.tables.closed  # their first side is the ray
    sides = np.cumsum(is_side, axis=-1) - 1
    return np.asarray(sides.ravel(), dtype=np.intp)


def unproved(limit: str, undecided: int, count: int, words: tuple[str, str] = OF_CELLS) -> str:
    """Return why solutions of a load, or of a range, are not proved to be all, "" if they are.

    limit:     that was met, in words
    undecided: number of undecided cells, or parts
    count:     of the solutions, where a range begins
    words:     what is said of one that is undecided, and of many
    """
    if limit:
        return f"the limit of {limit}"
    if undecided:
        return f"{undecided} {words[undecided > 1]}"
    if count % 2 == 0:
        return f"the number of solutions, {count}, is even, which no regular problem has"
    return ""
