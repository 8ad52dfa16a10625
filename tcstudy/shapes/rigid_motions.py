"""Plane rigid motions that the supports of a body leave, from its geometry.

Motion:   r(p) = (a − cη, b + cξ) with (ξ, η) = (p − centre)/size, coefficients (a, b, c)
Supports: d·r(p) = 0 for every component d that an edge holds, by prescribed displacements, springs,
          symmetry or u_N = 0 on Γ_C; a rigid edge without a moment does not turn, either
Bonds:    an edge with a friction law resists its motion along the tangent, but does not exclude it

The motions that are left are the null space of these conditions.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tcstudy.scene.records import (
    Body,
    Boundary,
    Clamped,
    Contact,
    Given,
    Point,
    Rigid,
    Role,
    Scalar,
)
from tcstudy.shapes.edges import body_size, edge_normal, edge_points

Array = NDArray[np.float64]

ARC_PIECES = 32
"""Straight pieces that stand for an arc."""
NO_TURN = 1e-6
"""Part of rotation below which a motion is a translation, and of one axis below which it is along
the other."""


class BoundaryPiece(NamedTuple):
    """Points (n, 2) of an edge of the boundary with the unit normals (n, 2) there."""

    name: str
    points: Array
    normals: Array


@dataclass(frozen=True, eq=False)
class RigidMotions:
    """Rigid motions r(p) = (a − cη, b + cξ) with (ξ, η) = (p − centre)/size.

    coefficients: (k, 3) independent rows (a, b, c)
    """

    coefficients: Array
    centre: Point
    size: float

    def __len__(self) -> int:
        """Return how many independent motions there are."""
        return len(self.coefficients)

    def at(self, points: Array) -> Array:
        """Return (k, n, 2) the displacements of points (n, 2)."""
        xi, eta = (points - self.centre).T / self.size
        a, b, c = self.coefficients.T[:, :, None]
        return np.stack([a - c * eta, b + c * xi], axis=2)

    @property
    def names(self) -> tuple[str, ...]:
        """Every motion in words, such as "slide along x" or "turn about (0, 1)"."""
        return tuple(self._name(*motion) for motion in self.coefficients.tolist())

    @property
    def words(self) -> str:
        """All motions in words."""
        return " or ".join(self.names)

    def _name(self, a: float, b: float, c: float) -> str:
        if abs(c) < NO_TURN:
            if abs(b) < NO_TURN:
                return "slide along x"
            return "slide along y" if abs(a) < NO_TURN else f"slide along ({a:.3g}, {b:.3g})"
        pole = (self.centre[0] - self.size * b / c, self.centre[1] + self.size * a / c)
        # rounding is no coordinate
        x, y = (0.0 if abs(p) <= 1e-9 * self.size else p for p in pole)
        return f"turn about ({x:.3g}, {y:.3g})"


def boundary_pieces(body: Body) -> list[BoundaryPiece]:
    """Return the edges of the loops of a body; a straight one by its ends."""
    pieces = list[BoundaryPiece]()
    for edge in body.edges:
        points = edge_points(edge, 1 if edge.through is None else ARC_PIECES)
        pieces.append(BoundaryPiece(edge.name, points, edge_normal(edge, points)))
    return pieces


def motions_of_body(
    body: Body, boundary: Boundary, resisting: Collection[str] | None = None
) -> RigidMotions | None:
    """Return the motions that the supports of a body with an outline leave, None of other bodies.

    resisting: contact edges whose friction counts as a support, too, as do edges that may open;
               None for the supports alone
    """
    if body.outline is None:
        return None
    centre = body.outline.edges[0].start
    return rigid_motions(boundary_pieces(body), boundary, centre, body_size(body), resisting)


def rigid_motions(
    pieces: Iterable[BoundaryPiece],
    boundary: Boundary,
    centre: Point,
    size: float,
    resisting: Collection[str] | None = None,
    accuracy: float = 1e-9,
) -> RigidMotions:
    """Return the motions that prescribed displacements, springs and u_N = 0 leave.

    centre:    any point of the body;  size: its diagonal
    resisting: contact edges whose friction counts as a support, too, as do edges that may open;
               None for the supports alone
    accuracy:  of the normals
    """
    roles = dict(boundary)
    conditions = np.zeros((0, 3))
    for piece in pieces:
        role = roles.get(piece.name)
        if role is None:
            continue
        rows = [*_conditions(piece, role, centre, size)]
        if resisting is not None:
            rows += _resisted(piece, role, piece.name in resisting, centre, size)
        conditions = np.vstack([conditions, *map(np.atleast_2d, rows)])
    # three zero rows more make the null space of fewer conditions complete
    triangle = np.linalg.qr(np.vstack([conditions, np.zeros((3, 3))]), mode="r")
    _, singular, motions = np.linalg.svd(triangle)
    rank = int(np.sum(singular > accuracy * singular[0]))
    return RigidMotions(_echelon(motions[rank:]), centre, size)


def _echelon(motions: Array) -> Array:
    """Return a basis (k, 3) of the same motions, with translations along x and y where they are."""
    if len(motions) < 2:
        return motions
    rows = motions.copy()
    done = 0
    for column in range(3):
        pivot = done + int(np.argmax(np.abs(rows[done:, column]))) if done < len(rows) else done
        if done == len(rows) or abs(rows[pivot, column]) < NO_TURN:
            continue
        rows[[done, pivot]] = rows[[pivot, done]]
        rows[done] /= rows[done, column]
        others = np.arange(len(rows)) != done
        rows[others] -= rows[others, column][:, None] * rows[done]
        done += 1
    return rows


def has_supports(boundary: Boundary) -> bool:
    """Return whether an edge is meant to support the body: clamped, rigid, or in contact."""
    return any(isinstance(role, Clamped | Contact) for _, role in boundary)


def _conditions(
    piece: BoundaryPiece, role: Role, centre: Point, size: float
) -> Iterator[Sequence[float]]:
    """Yield the rows of d·r(p) = 0 of a piece, in the coefficients a, b, c of a rigid motion."""
    if isinstance(role, Rigid) and role.moment is None:  # a rigid edge without a moment cannot turn
        for x, y in piece.points[1:] - piece.points[0]:
            for shift, u in zip((-y, x), role.u, strict=True):
                if u is None:
                    yield [0.0, 0.0, shift / size]
    for (x, y), normal in zip(piece.points, piece.normals, strict=True):
        for d_x, d_y, _ in components(role.frame, role.held, normal):
            yield _row(x, y, d_x, d_y, centre, size)


def _resisted(
    piece: BoundaryPiece, role: Role, has_friction: bool, centre: Point, size: float
) -> Iterator[Sequence[float]]:
    """Yield the rows of t·r(p) = 0 under friction, and of n·r(p) = 0 where the edge may open."""
    for (x, y), (n_x, n_y) in zip(piece.points, piece.normals, strict=True):
        if has_friction:
            yield _row(x, y, -n_y, n_x, centre, size)
        if isinstance(role, Contact) and role.opens:
            yield _row(x, y, n_x, n_y, centre, size)


def _row(x: float, y: float, d_x: float, d_y: float, centre: Point, size: float) -> list[float]:
    xi, eta = (x - centre[0]) / size, (y - centre[1]) / size
    return [d_x, d_y, d_y * xi - d_x * eta]


def components(frame: str, u: Given, normal: Array) -> Iterator[tuple[float, float, Scalar]]:
    """Yield (d₁, d₂, value) of every component of u that is not None.

    Directions are x and y, or the normal and the tangent.
    """
    n_x, n_y = map(float, normal)
    directions = ((1.0, 0.0), (0.0, 1.0)) if frame == "xy" else ((n_x, n_y), (-n_y, n_x))
    for direction, value in zip(directions, u, strict=True):
        if value is not None:
            yield *direction, value
