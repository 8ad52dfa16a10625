"""Exact measures and normals of edges and loops."""

import math
from pathlib import Path

import numpy as np
import pytest

from tcstudy.scene.records import Body, BrepFace, Edge, Loop, Point
from tcstudy.shapes import edges as shape
from tcstudy.shapes.faults import check_body

SQUARE = shape.rectangle_loop((0.0, 0.0), 1.0, 1.0)


@pytest.mark.parametrize("sweep", [0.05, -2.0, 6.2])
@pytest.mark.parametrize(("center", "radius"), [((0.0, 0.0), 1.0), ((-7.0, 9.0), 0.1)])
def test_arc_through_three_points(center: Point, radius: float, sweep: float) -> None:
    first, third, last = (
        (center[0] + radius * math.cos(a), center[1] + radius * math.sin(a))
        for a in (0.4, 0.4 + 0.3 * sweep, 0.4 + sweep)
    )
    edge = Edge(first, last, "arc", through=third)
    arc = shape.edge_arc(edge)
    assert arc is not None
    tight = 1e-9 * (1 + math.hypot(*center) / radius)
    assert arc.center == pytest.approx(center, abs=tight * 1e3 * radius)
    assert arc.sweep == pytest.approx(sweep, abs=1e3 * tight)
    assert shape.edge_length(edge) == pytest.approx(radius * abs(sweep), rel=1e3 * tight)
    points = shape.edge_points(edge, 7)
    assert (points[0].tolist(), points[-1].tolist()) == (list(first), list(last))
    np.testing.assert_allclose(np.hypot(*(points - arc.center).T), arc.radius, rtol=1e-9)
    chords = np.linalg.norm(np.diff(points, axis=0), axis=1)
    np.testing.assert_allclose(chords, 2 * radius * math.sin(abs(sweep) / 14), rtol=1e3 * tight)


def test_area_and_length_of_mixed_loops() -> None:
    half_disc = Loop(
        (Edge((-1, 0), (1, 0), "flat"), Edge((1, 0), (-1, 0), "round", through=(0, 1)))
    )
    assert shape.loop_area(half_disc) == pytest.approx(math.pi / 2, rel=1e-15)
    bitten = Loop(
        (*SQUARE.edges[:2], Edge((1, 1), (0, 1), "bite", through=(0.5, 0.5)), SQUARE.edges[3])
    )
    assert shape.loop_area(bitten) == pytest.approx(1 - math.pi / 8, rel=1e-15)
    backwards = shape.polygon_loop([(0, 0), (0, 1), (1, 0)], "edge")
    assert shape.loop_area(backwards) == -0.5
    far = shape.polygon_loop([(1e8, 1e8), (1e8 + 1, 1e8), (1e8 + 1, 1e8 + 1)], "edge")
    assert shape.loop_area(far) == 0.5


def test_body_measures() -> None:
    hole = shape.circle_loop((0.5, 0.5), 0.25, "top")
    body = Body(SQUARE, (hole,))
    assert shape.body_area(body) == pytest.approx(1 - math.pi / 16, rel=1e-15)
    assert shape.body_size(body) == math.sqrt(2)
    lengths = shape.boundary_lengths(body)
    assert list(lengths) == ["bottom", "right", "top", "left"]
    assert lengths["top"] == pytest.approx(1 + math.pi / 2, rel=1e-15)
    file = Body(None, brep=BrepFace(Path("part.step"), 0, 1e-3, (), None))
    assert check_body(file) == []
    with pytest.raises(ValueError, match="file"):
        shape.body_area(file)


@pytest.mark.parametrize("through", [None, (1.6, 1.4), (0.9, 0.2), (-3.0, 2.0)])
def test_normals_and_distances_are_those_of_many_points(through: Point | None) -> None:
    edge = Edge((0, 0), (2, 1), "edge", through=through)
    fine = shape.edge_points(edge, 20_000)
    tangents = fine[2:] - fine[:-2]
    tangents /= np.linalg.norm(tangents, axis=1, keepdims=True)
    np.testing.assert_allclose(
        shape.edge_normal(edge, fine[1:-1]), tangents[:, ::-1] * [1.0, -1.0], atol=1e-6
    )
    points = np.random.default_rng(5).uniform(-4, 4, (50, 2))
    sampled = np.linalg.norm(points[:, None] - fine[None], axis=2).min(axis=1)
    np.testing.assert_allclose(shape.edge_distance(edge, points), sampled, atol=1e-3)
    np.testing.assert_allclose(shape.edge_distance(edge, fine[::400]), 0.0, atol=1e-13)
