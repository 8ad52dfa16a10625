"""Checks across sections: heat against boundary and material, free rigid motions, predicted mesh size."""

from __future__ import annotations

import cmath
import math
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from tcstudy.scene.node import Node, deepest
from tcstudy.scene.read_boundary import Boundary
from tcstudy.scene.records import Body, Clamped, Contact, Convection, Edge, Heat, Loop, Material, MeshPlan, Point
from tcstudy.scene.walker import Context

MAX_TRIANGLES = 2e7
"""More triangles than this are taken for a typing error of maxh or levels."""
ARC_POINTS = 33


def check_heat(ctx: Context, root: Node, heat: Heat, boundary: Boundary, material: Material) -> None:
    """Heat needs a conductivity, and exchange with the surroundings an edge on which it happens."""
    convection = [edge for edge, role in boundary if isinstance(role, Convection)]
    section = root.child("heat")
    if section is None or heat.theta is not None:
        for edge in convection:
            node = deepest(root, ("boundary", edge))
            why = "the study has no section heat" if section is None else "the temperature theta is given"
            remedy = "add heat: {alpha: ..., theta_bar: ...}, or make the edge free or traction"
            ctx.errors.at(node, f"a convection edge has no meaning, because {why}", remedy)
        return
    if material.k is None:
        node = deepest(root, ("material",))
        ctx.errors.at(node, "is missing, but heat needs it", "add k: 45 W/(m*K)", key=f"{node.path}.k")
    if heat.alpha > 0.0 and not convection:
        node = deepest(root, ("heat", "alpha"))
        remedy = "give the role convection to the edges that exchange heat, or give a known temperature theta"
        ctx.errors.at(node, "no edge has the role convection, so alpha acts nowhere", remedy)


def check_support(ctx: Context, node: Node, body: Body, boundary: Boundary) -> None:
    """The clamped displacements and u_N = 0 on contact edges must exclude the three plane rigid motions."""
    if not any(isinstance(role, Clamped | Contact) for _, role in boundary) or body.outline is None:
        return
    centre, size = _extent(body)
    rows = [row for edge in edges(body) for row in _constraints(edge, dict(boundary).get(edge.name), centre, size)]
    matrix = np.array(rows).reshape(-1, 3)
    _, singular, motions = np.linalg.svd(matrix, full_matrices=True)
    rank = int(np.sum(singular > 1e-9 * singular[0])) if len(singular) else 0
    if rank == 3:
        return
    clamped = any(isinstance(role, Clamped) for _, role in boundary)
    what = "the supports do not hold the body" if clamped else "no edge is clamped and contact does not hold the body"
    remedy = "give an edge the role clamped, or prescribe the missing component"
    ctx.errors.at(node, f"{what}: it can still {_motion(motions[rank:], centre, size)}", remedy)


def _constraints(edge: Edge, role: object, centre: Point, size: float) -> Iterator[list[float]]:
    """Rows d·r(p) = 0 of an edge for the rigid motions r = (a − cη, b + cξ), (ξ, η) = (p − centre)/size."""
    if isinstance(role, Contact):
        fixed, frame = (True, False), "nt"
    elif isinstance(role, Clamped):
        fixed, frame = (role.u[0] is not None, role.u[1] is not None), role.frame
    else:
        return
    points = curve(edge)
    for (x, y), t in zip(points, _tangents(edge, points), strict=True):
        xi, eta = (x - centre[0]) / size, (y - centre[1]) / size
        directions = ((1.0, 0.0), (0.0, 1.0)) if frame == "xy" else ((t[1], -t[0]), (t[0], t[1]))
        for held, d in zip(fixed, directions, strict=True):
            if held:
                yield [d[0], d[1], d[1] * xi - d[0] * eta]


def _motion(motions: NDArray[np.float64], centre: Point, size: float) -> str:
    """One or more free rigid motions in words."""
    if len(motions) > 1:
        return f"move in {len(motions)} ways"
    a, b, c = motions[0]
    if abs(c) < 1e-6:
        return "slide along x" if abs(b) < 1e-6 else "slide along y" if abs(a) < 1e-6 else f"slide along ({a:.3g}, {b:.3g})"
    return f"turn about ({centre[0] - size * b / c:.3g}, {centre[1] + size * a / c:.3g})"


def check_mesh(ctx: Context, maxh: Node, plan: MeshPlan, body: Body) -> None:
    """Refuse element sizes that give no sensible number of triangles, about area/(√3/4 h²)·4^(levels−1)."""
    if body.outline is None:
        return
    area = abs(_area(body.outline)) - sum(abs(_area(hole)) for hole in body.holes)
    _, size = _extent(body)
    refinements = plan.levels - 1 if plan.nested else 0
    for i, h in enumerate(plan.maxh):
        node = maxh.value[i] if isinstance(maxh.value, tuple) else maxh
        if h > size:
            remedy = f"choose maxh well below it, for example {size / 10:.2g}"
            ctx.errors.at(node, f"an element of {h:g} is larger than the body ({size:g})", remedy)
        exponent = math.log10(max(area, 1e-300) / (math.sqrt(3.0) / 4.0)) - 2.0 * math.log10(h)
        exponent += refinements * math.log10(4.0)
        if exponent > math.log10(MAX_TRIANGLES):
            least = 10.0 ** ((exponent - math.log10(MAX_TRIANGLES)) / 2.0) * h
            remedy = f"choose maxh above {least:.2g}" + (" or fewer levels" if refinements else "")
            ctx.errors.at(node, f"about 10^{exponent:.1f} triangles are more than a study can use", remedy)


def edges(body: Body) -> Iterator[Edge]:
    """All edges of the outline and the holes."""
    for loop in (body.outline, *body.holes):
        yield from loop.edges if loop else ()


def _arc(edge: Edge) -> tuple[complex, float, float] | None:
    """Centre, angle of the start and signed angle swept of an arc; None for a straight edge."""
    if edge.through is None:
        return None
    p, q, r = complex(*edge.start), complex(*edge.through), complex(*edge.end)
    if r == p or q in (p, r) or abs(((q - p) / (r - p)).imag) < 1e-12:
        return None
    w = (r - p) / (q - p)
    centre = p + (q - p) * (w - abs(w) ** 2) / (w - w.conjugate())
    middle, last = (cmath.phase((z - centre) / (p - centre)) % (2 * math.pi) for z in (q, r))
    return centre, cmath.phase(p - centre), last if middle < last else last - 2 * math.pi


def curve(edge: Edge) -> NDArray[np.float64]:
    """(n, 2) points along an edge: its ends, or many on an arc."""
    arc = _arc(edge)
    if arc is None:
        return np.array([edge.start, edge.end])
    centre, first, turn = arc
    angle, radius = first + np.linspace(0.0, turn, ARC_POINTS), abs(complex(*edge.start) - centre)
    return np.column_stack([centre.real + radius * np.cos(angle), centre.imag + radius * np.sin(angle)])


def _tangents(edge: Edge, points: NDArray[np.float64]) -> NDArray[np.float64]:
    """(n, 2) unit tangents at the points of an edge; exact on arcs, whose rigid rotation must be seen."""
    arc = _arc(edge)
    along = np.repeat(points[1:] - points[:1], 2, axis=0) if arc is None else points - (arc[0].real, arc[0].imag)
    if arc is not None:
        along = np.column_stack([-along[:, 1], along[:, 0]])
    return along / np.hypot(*along.T)[:, None]


def _area(loop: Loop) -> float:
    """Signed area of a loop, arcs as polygons."""
    points = np.concatenate([curve(edge)[:-1] for edge in loop.edges])
    x, y = points[:, 0] - points[0, 0], points[:, 1] - points[0, 1]
    return 0.5 * float(np.sum(x * np.roll(y, -1) - y * np.roll(x, -1)))


def _extent(body: Body) -> tuple[Point, float]:
    """Centre and longer side of the box around the outline."""
    assert body.outline is not None
    points = np.concatenate([curve(edge) for edge in body.outline.edges])
    low, high = points.min(axis=0), points.max(axis=0)
    middle = 0.5 * (low + high)
    return (float(middle[0]), float(middle[1])), float((high - low).max())
