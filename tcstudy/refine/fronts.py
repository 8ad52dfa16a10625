"""Where stick meets slip, to a part of a cell.

A node sticks or slips, so that the slip length Σ c_i over slipping nodes is known to half a cell at every front. The
solution says more: at a front where the traction reaches the bound of b̂ continuously, |u_T − s_k| ~ r^{3/2} at the
distance r from it, s_k the kink that the sticking nodes rest on (Williams' exponents of a half-plane with u_N = 0 that
sticks on one side and carries a given shear on the other are ½, 3/2, …, and r^{1/2} would break the bound). So
|u_T − s_k|^{2/3} is linear in the position, and the front lies where the line through two slipping nodes is zero. The
node next to the front carries the front's own discretisation error and is left out where there are two more.

Accuracy: on uniform meshes the front found lies (0.10 ± 0.03) h inside the sticking side of the true one, wherever
          it lies within its cell (25 positions of the closed form of stick and slip); the nodal one is off by up to h/2
Hidden:   beside a held node of given u_T = s_k no node may stick although a zone does that is shorter than the cell.
          If the same line is zero inside the cell, there is a front; its place is a guess, and what hides in the cell
          is in doubt whether one is found or not (ends.py)
Left out: fronts that a jump of the data or a corner holds in place have other exponents. Where the slip does not grow
          away from a front, or only one node slips, the middle of the cell stands
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tcstudy.contact.problem import ContactProblem
from tcstudy.fem.boundary import ContactLine
from tcstudy.laws.pieces import UP

Array = NDArray[np.float64]

EXPONENT = 1.5
"""u_T ~ r^EXPONENT at a front."""
HELD = -1
"""Stands for the contact unknown of a node that has none."""
REACH = 0.5
"""How many cells a front may lie outside the cell between its sticking and its slipping node."""


@dataclass(frozen=True)
class SlipFront:
    """One place where stick meets slip.

    segment: index of its cell in line.segments;  width: length of the cell [m]
    more:    by how much the slip zone is longer than the nodes say, ½ width − (distance from the sticking node) [m]
    doubt:   how far it may lie off for lack of slipping nodes: ½ width where the middle of the cell stands, else 0 [m]
    hidden:  it lies beside a held node, and no node sticks
    nodes:   contact unknowns that `more` depends on;  slopes: its derivatives with respect to their u_T [1]
    """

    segment: int
    width: float
    more: float
    doubt: float
    nodes: tuple[int, ...]
    slopes: tuple[float, ...]
    hidden: bool = False


def fronts(line: ContactLine, problem: ContactProblem, v: Array) -> list[SlipFront]:
    """All fronts of a contact solution v (m,), hidden ones last; an end of Γ_C is none."""
    if not len(problem.law.kinks):
        return []
    stick = problem.law.sticking(v)
    ends = line.unknowns
    held = ends == HELD
    sticks = stick[ends] & ~held
    seen = np.flatnonzero(~held.any(axis=1) & (sticks[:, 0] != sticks[:, 1]))
    found = [_front(line, problem, v, stick, ends, int(i), 1 if sticks[i, 0] else -1) for i in seen]
    at_held = np.flatnonzero((held[:, 0] != held[:, 1]) & ~sticks.any(axis=1))
    hidden = [_front(line, problem, v, stick, ends, int(i), 1 if held[i, 0] else -1) for i in at_held]
    return [front for front in (*found, *hidden) if front is not None]


def slip_length(line: ContactLine, problem: ContactProblem, v: Array) -> tuple[float, float]:
    """Length of Γ_C that does not stick, fronts taken where they are found within their cells, and their doubt [m]."""
    found = fronts(line, problem, v)
    nodal = float(problem.c[~problem.law.sticking(v)].sum())
    return nodal + sum(front.more for front in found), sum(front.doubt for front in found)


def slopes(line: ContactLine, problem: ContactProblem, v: Array) -> Array:
    """w (m,), the derivative of `slip_length` with respect to u_T [1]."""
    w = np.zeros(line.m)
    for front in fronts(line, problem, v):
        np.add.at(w, list(front.nodes), front.slopes)
    return w


def _front(
    line: ContactLine,
    problem: ContactProblem,
    v: Array,
    stick: NDArray[np.bool_],
    ends: NDArray[np.intp],
    segment: int,
    towards: int,
) -> SlipFront | None:
    """The front in a segment whose slipping side is its end (towards = 1) or its start (−1)."""
    lengths = np.linalg.norm(line.ends[:, 1] - line.ends[:, 0], axis=1)
    rests, slides = ends[segment, ::towards]
    node = int(slides if rests == HELD else rests)
    law = problem.law.single(node)
    if not len(law.kinks):
        return None
    kink = law.nearest_kink(v[node])
    slip = v - law.kinks[kink]
    nodes: list[int] = []
    at = [0.0]
    for i in _outwards(line, segment, towards):
        node = int(ends[i, 1 if towards > 0 else 0])
        if node == HELD or stick[node] or (nodes and slip[node] * slip[nodes[0]] <= 0.0) or len(nodes) == 3:
            break
        nodes.append(node)
        at.append(at[-1] + float(lengths[i]))
    if rests == HELD:
        return _hidden(segment, at[1:], nodes, slip) if law.kinds[kink] == UP else None
    return _through(segment, at[1:], nodes, slip)


def _hidden(segment: int, at: list[float], nodes: list[int], slip: Array) -> SlipFront | None:
    """A front beside a held node, from slipping nodes at distances `at` from it."""
    # The nearest two: slip like r^λ, λ < 3/2, gives a zero outside the body, so that nothing is found by mistake.
    if (found := _zero(at[:2], nodes[:2], slip)) is None or found[0] <= 0.0:
        return None
    x, pair, slopes = found
    length = min(x, at[0])
    return SlipFront(segment, at[0], -length, 0.0, pair, slopes, hidden=True)


def _through(segment: int, at: list[float], nodes: list[int], slip: Array) -> SlipFront:
    """The front from slipping nodes at distances `at` from the sticking one, the nearest first."""
    width = at[0]
    if (found := _zero(at, nodes, slip)) is not None:
        x, pair, slopes = found
        more = 0.5 * width - float(np.clip(x, -REACH * width, (1.0 + REACH) * width))
        return SlipFront(segment, width, more, 0.0, pair, slopes)
    # u_T = C r^{3/2} with C held, half a cell from the front
    return SlipFront(segment, width, 0.0, 0.5 * width, (nodes[0],), (0.5 * width / (EXPONENT * float(slip[nodes[0]])),))


def _zero(at: list[float], nodes: list[int], slip: Array) -> tuple[float, tuple[int, int], tuple[float, float]] | None:
    """Where |slip|^{2/3} through the two farthest nodes is zero, the nodes, minus its derivatives; None if it falls."""
    if len(nodes) < 2:
        return None
    (p, q), (r_p, r_q) = nodes[-2:], at[-2:]
    y_p, y_q = np.abs(slip[[p, q]]) ** (1 / EXPONENT)
    if y_q <= y_p:
        return None
    rise = (r_q - r_p) * y_p * y_q / ((y_q - y_p) ** 2 * EXPONENT)
    return float(r_p - y_p * (r_q - r_p) / (y_q - y_p)), (p, q), (float(rise / slip[p]), float(-rise / slip[q]))


def _outwards(line: ContactLine, segment: int, towards: int) -> Iterator[int]:
    """Segments from a front's own on, away from its sticking side, as long as they hang together."""
    yield segment
    inner, outer = (1, 0) if towards > 0 else (0, 1)
    i = segment + towards
    while 0 <= i < len(line.segments) and line.segments[i - towards, inner] == line.segments[i, outer]:
        yield i
        i += towards
