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

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tcstudy.contact.problem import ContactProblem
from tcstudy.fem.boundary import ContactLine
from tcstudy.laws.pieces import UP

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

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
    law, ends = problem.law, line.unknowns
    if not len(law.kinks):
        return []
    stick, held, found = law.sticking(v), ends == HELD, list[SlipFront]()
    sticks = stick[ends] & ~held
    seen = ~held.any(axis=1) & (sticks[:, 0] != sticks[:, 1])
    hidden = (held[:, 0] != held[:, 1]) & ~sticks.any(axis=1)
    for i in (*np.flatnonzero(seen).tolist(), *np.flatnonzero(hidden).tolist()):
        towards = 1 if (held if hidden[i] else sticks)[i, 0] else -1
        rests, slides = ends[i, ::towards].tolist()
        node = slides if hidden[i] else rests
        own = law.single(node)
        if not len(own.kinks):
            continue
        kink = own.nearest_kink(v[node])
        if hidden[i] and own.kinds[kink] != UP:
            continue
        slip = v - own.kinks[kink]
        nodes, at = _beyond(line, i, towards, stick, slip)
        width = at[0]
        # beside a held node the nearest two: slip like r^λ, λ < 3/2, gives a zero outside the body, and no front
        some = 2 if hidden[i] else len(nodes)
        zero = _zero(at[:some], nodes[:some], slip)
        if hidden[i]:
            if zero is not None and zero[0] > 0.0:
                found.append(SlipFront(i, width, -min(zero[0], width), 0.0, *zero[1:], hidden=True))
        elif zero is not None:
            more = 0.5 * width - float(np.clip(zero[0], -REACH * width, (1.0 + REACH) * width))
            found.append(SlipFront(i, width, more, 0.0, *zero[1:]))
        else:  # u_T = C r^{3/2} with C held, half a cell from the front
            slope = 0.5 * width / (EXPONENT * float(slip[nodes[0]]))
            found.append(SlipFront(i, width, 0.0, 0.5 * width, (nodes[0],), (slope,)))
    return found


def _beyond(line: ContactLine, i: int, towards: int, stick: Flags, slip: Array) -> tuple[list[int], list[float]]:
    """Up to three nodes that slip one way from segment i on, and how far they are from the node before them all.

    towards: 1 along the line, −1 against it
    """
    nodes, at, ends, inner = list[int](), list[float](), line.unknowns, 1 if towards > 0 else 0
    while True:
        node = int(ends[i, inner])
        if node == HELD or stick[node] or (nodes and slip[node] * slip[nodes[0]] <= 0.0) or len(nodes) == 3:
            return nodes, at
        nodes.append(node)
        at.append((at[-1] if at else 0.0) + float(line.lengths[i]))
        i += towards
        if not (0 <= i < len(ends) and line.segments[i - towards, inner] == line.segments[i, 1 - inner]):
            return nodes, at


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
