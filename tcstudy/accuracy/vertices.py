"""Corners of a body with the conditions that meet there, and how singular the elastic solution is in each.

A contact edge holds u_N; where its last nodes stick it holds u_T as well. Stick and slip are told apart by the
solution on the finest mesh, because the bound of the friction law, not the corner, decides between them.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from tcstudy.accuracy.corner_exponents import CLAMPED, FREE, SLIDING, Direction, corner_exponent
from tcstudy.scene.records import Body, Clamped, Contact, Edge, Loop, Material, Point, Role
from tcstudy.scene.shapes import edge_normal

Sticks = Callable[[str, Point], bool]
"""Whether the contact edge sticks near a point."""


@dataclass(frozen=True)
class Vertex:
    """A corner of the body.

    at:        its place;  angle: opening angle inside the body [rad]
    edges:     names of the edges that meet;  words: their conditions in words
    exponent:  u ~ r^exponent, SMOOTH if the corner leaves u smooth
    contact:   one of the edges is in contact
    """

    at: Point
    angle: float
    edges: tuple[str, str]
    words: tuple[str, str]
    exponent: float
    contact: bool

    @property
    def half_turns(self) -> float:
        """The opening angle over π."""
        return self.angle / math.pi


def vertices(body: Body, boundary: tuple[tuple[str, Role], ...], material: Material, sticks: Sticks) -> list[Vertex]:
    """All corners of a body given by edges; none for a body from a file, whose corners are not looked at."""
    if body.outline is None:
        return []
    roles, kappa = dict(boundary), (material.lam + 3 * material.mu) / (material.lam + material.mu)
    found = []
    for loop, hole in [(body.outline, False), *((hole, True) for hole in body.holes)]:
        for before, after in zip(_previous(loop), loop.edges, strict=True):
            # The body lies counter-clockwise of the edge at φ = 0: the one that leaves an outline's corner.
            zero, far = (before, after) if hole else (after, before)
            found.append(_vertex(after.start, zero, far, roles, kappa, sticks))
    return found


def _previous(loop: Loop) -> tuple[Edge, ...]:
    return (loop.edges[-1], *loop.edges[:-1])


def _vertex(at: Point, zero: Edge, far: Edge, roles: dict[str, Role], kappa: float, sticks: Sticks) -> Vertex:
    start, end = _away(zero, at), _away(far, at)
    angle = (math.atan2(end[1], end[0]) - math.atan2(start[1], start[0])) % (2 * math.pi)
    angle = 2 * math.pi if angle < 1e-9 else angle
    held, words = [], []
    for edge, direction in ((zero, start), (far, end)):
        one, word = _condition(roles[edge.name], edge, at, direction, sticks)
        held.append(one)
        words.append(word)
    exponent = corner_exponent(round(angle, 12), held[0], held[1], kappa)
    contact = any(isinstance(roles[edge.name], Contact) for edge in (zero, far))
    return Vertex(at, angle, (zero.name, far.name), (words[0], words[1]), exponent, contact)


def _away(edge: Edge, at: Point) -> tuple[float, float]:
    """Unit tangent of an edge at one of its ends, pointing away from the corner into the edge."""
    n = edge_normal(edge, np.array([at]))[0]
    forward = (-float(n[1]), float(n[0]))  # the normal lies to the right of the edge
    return forward if edge.start == at else (-forward[0], -forward[1])


def _condition(
    role: Role, edge: Edge, at: Point, e_r: tuple[float, float], sticks: Sticks
) -> tuple[tuple[Direction, ...], str]:
    """Held directions in the polar frame of a side, and the condition in words."""
    if isinstance(role, Contact):
        return (CLAMPED, "sticking contact") if sticks(edge.name, at) else (SLIDING, "slipping contact")
    if not isinstance(role, Clamped):
        return FREE, "traction"
    if None not in role.u:
        return CLAMPED, "clamped"
    if role.frame == "nt":
        return (SLIDING, "roller") if role.u[0] is not None else (((1.0, 0.0),), "guided")
    d = (1.0, 0.0) if role.u[0] is not None else (0.0, 1.0)
    e_phi = (-e_r[1], e_r[0])
    local = (round(d[0] * e_r[0] + d[1] * e_r[1], 12), round(d[0] * e_phi[0] + d[1] * e_phi[1], 12))
    return (local,), "roller"


def corner_words(vertex: Vertex) -> str:
    """Which corner, in words."""
    x, y = vertex.at
    first, second = vertex.words
    return f"{first}–{second} corner of {180 * vertex.half_turns:.4g}° at ({x:.4g}, {y:.4g})"


def describe(vertex: Vertex) -> str:
    """A corner with its exponent, for the reason of an expected order."""
    return f"{corner_words(vertex)}: u ~ r^{vertex.exponent:.3f}"
