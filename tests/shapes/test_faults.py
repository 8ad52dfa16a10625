"""Every kind of faulty body, named with place and remedy, in any unit of length."""

from __future__ import annotations

import math
import time

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tcstudy.scene.records import Body, Edge, Loop, Point, Region
from tcstudy.shapes.edges import (
    circle_loop,
    loop_area,
    polygon_loop,
    rectangle_loop,
)
from tcstudy.shapes.faults import Fault, check_body

SQUARE = rectangle_loop((0.0, 0.0), 1.0, 1.0)


HOLE = circle_loop((0.5, 0.5), 0.2, "bore")
SOUND = {
    "square": Body(SQUARE),
    "disc": Body(circle_loop((3, 4), 2.0, "rim")),
    "bitten": Body(Loop((*SQUARE.edges[:2], Edge((1, 1), (0, 1), "bite", through=(0.5, 0.7)), SQUARE.edges[3]))),
    "straight corner": Body(polygon_loop([(0, 0), (1, 0), (2, 0), (2, 1), (0, 1)], "edge")),
    "holes": Body(SQUARE, (HOLE, rectangle_loop((0.1, 0.1), 0.1, 0.1, ("a",) * 4))),
    "region at the edge": Body(SQUARE, (), (Region("heater", rectangle_loop((0.0, 0.0), 0.5, 0.5)),)),
    "region to rounding": Body(SQUARE, (), (Region("heater", rectangle_loop((0.7, 0.1), 0.3 + 1e-16, 0.5)),)),
    "disc in disc": Body(circle_loop((0, 0), 1, "rim"), (), (Region("all", circle_loop((0, 0), 1, "")),)),
    "region at the hole": Body(
        SQUARE,
        (rectangle_loop((0.4, 0.4), 0.2, 0.2),),
        (Region("heater", rectangle_loop((0.2, 0.4), 0.2, 0.2)),),
    ),
    "regions side by side": Body(
        SQUARE,
        (),
        (Region("a", rectangle_loop((0, 0), 0.5, 1)), Region("b", rectangle_loop((0.5, 0), 0.5, 1))),
    ),
}


def scaled(body: Body, factor: float, shift: float) -> Body:
    def move(p: Point) -> Point:
        return (p[0] + shift) * factor, (p[1] - 2 * shift) * factor

    def loop(one: Loop) -> Loop:
        return Loop(
            tuple(Edge(move(e.start), move(e.end), e.name, move(e.through) if e.through else None) for e in one.edges)
        )

    assert body.outline is not None
    regions = tuple(Region(r.name, loop(r.loop)) for r in body.regions)
    return Body(loop(body.outline), tuple(map(loop, body.holes)), regions)


@pytest.mark.parametrize("factor", [1.0, 1e-6, 1e6])
@pytest.mark.parametrize("body", SOUND.values(), ids=SOUND.keys())
def test_sound_bodies_have_no_faults(body: Body, factor: float) -> None:
    assert check_body(scaled(body, factor, 0.0)) == []
    assert check_body(scaled(body, factor, 3.3)) == []


def with_hole(*holes: Loop) -> Body:
    return Body(SQUARE, holes)


def with_region(loop: Loop, *holes: Loop) -> Body:
    return Body(SQUARE, holes, (Region("heater", loop),))


def outline(*points: Point) -> Body:
    return Body(polygon_loop(points, [f"e{i}" for i in range(len(points))]))


FAULTY: dict[str, tuple[Body, str, list[str]]] = {
    "no edge": (Body(Loop(())), "body.outline", ["no edge"]),
    "not finite": (outline((0, 0), (1, math.nan), (1, 1)), "body.outline[0]", ["not finite"]),
    "two lines": (outline((0, 0), (1, 0)), "body.outline", ["2 edges", "at least 3"]),
    "open": (
        Body(Loop((*SQUARE.edges[:3], Edge((0, 1), (0, 0.1), "left")))),
        "body.outline[3]",
        ["edge 4 (left) ends at (0, 0.1)", "begins at (0, 0)"],
    ),
    "closed twice": (outline((0, 0), (1, 0), (1, 1), (0, 0)), "body.outline[3]", ["edge 4 (e3) has no length"]),
    "sliver": (outline((0, 0), (1, 0), (1, 1), (1 - 1e-7, 1), (0, 1)), "body.outline[2]", ["has length 1e-07"]),
    "collinear": (
        Body(Loop((Edge((0, 0), (1, 0), "a", (0.5, 0)), Edge((1, 0), (1, 1), "b"), Edge((1, 1), (0, 0), "c")))),
        "body.outline[0]",
        ["through-point (0.5, 0)", "leave out through"],
    ),
    "repeated vertex": (
        outline((0, 0), (1, 0), (0.5, 0.5), (1, 1), (0, 1), (0.5, 0.5)),
        "body.outline[5]",
        ["(0.5, 0.5)", "edge 3 (e2)", "edge 6 (e5)"],
    ),
    "clockwise": (outline((0, 0), (0, 1), (1, 1), (1, 0)), "body.outline", ["clockwise", "reverse the order"]),
    "bow-tie": (
        outline((0, 0), (1, 1), (1, 0), (0, 1)),
        "body.outline[0]",
        ["edge 1 (e0) and edge 3 (e2)", "(0.5, 0.5)"],
    ),
    "almost touching": (
        outline((0, 0), (2, 0), (2, 1), (1, 1e-7), (0, 1)),
        "body.outline[0]",
        ["edge 1 (e0) and edge 3 (e2)"],
    ),
    "spike": (
        outline((0, 0), (2, 0), (0.5, 1e-5), (0, 1)),
        "body.outline[1]",
        ["edge 2 (e1) runs back along edge 1 (e0) from (2, 0)"],
    ),
    "arc across a line": (
        Body(Loop((*SQUARE.edges[:2], Edge((1, 1), (0, 1), "bite", through=(0.5, -0.2)), SQUARE.edges[3]))),
        "body.outline[0]",
        ["edge 1 (bottom) and edge 3 (bite)"],
    ),
    "cusp": (
        Body(Loop((*SQUARE.edges[:2], Edge((1, 1), (0, 1), "bite", through=(0.5, 0.5)), SQUARE.edges[3]))),
        "body.outline[2]",
        ["edge 3 (bite) runs back along edge 2 (right) from (1, 1)", "angle"],
    ),
    "arc of another edge": (
        Body(
            Loop(
                (
                    Edge((0, 0), (8, 0), "a"),
                    Edge((8, 0), (7, 5), "b"),
                    Edge((7, 5), (4, 6), "c"),
                    Edge((4, 6), (1, 5), "d", (5.6, 6.1)),
                    Edge((1, 5), (0, 0), "e"),
                )
            )
        ),
        "body.outline",
        ["an arc goes around", "between its from and"],
    ),
    "hole of no size": (with_hole(circle_loop((0.5, 0.5), 1e-8, "c")), "body.holes[0]", ["has length"]),
    "hole outside": (with_hole(circle_loop((3, 3), 0.2, "c")), "body.holes[0]", ["outside"]),
    "hole around": (with_hole(circle_loop((0.5, 0.5), 3, "c")), "body.holes[0]", ["surrounds"]),
    "hole touches": (with_hole(circle_loop((0.8, 0.5), 0.2, "c")), "body.holes[0]", ["outline at (1, 0.5)"]),
    "holes overlap": (
        with_hole(HOLE, circle_loop((0.65, 0.5), 0.1, "d")),
        "body.holes[1]",
        ["overlaps or touches body.holes[0]"],
    ),
    "region outside": (with_region(circle_loop((3, 3), 0.2, "")), "body.regions.heater", ["lies outside"]),
    "region leaves": (
        with_region(rectangle_loop((0.5, 0.5), 1, 0.2)),
        "body.regions.heater",
        ["leaves the body near (1"],
    ),
    "region around": (with_region(circle_loop((0.5, 0.5), 2, "")), "body.regions.heater", ["leaves the body"]),
    "region across hole": (
        with_region(rectangle_loop((0.5, 0.5), 0.4, 0.1), HOLE),
        "body.regions.heater",
        ["body.holes[0]"],
    ),
    "region over hole": (with_region(rectangle_loop((0.1, 0.1), 0.8, 0.8), HOLE), "body.regions.heater", ["overlaps"]),
    "regions overlap": (
        Body(SQUARE, (), (Region("a", HOLE), Region("b", circle_loop((0.6, 0.5), 0.2, "")))),
        "body.regions.b",
        ["overlaps body.regions.a"],
    ),
}


@pytest.mark.parametrize(("body", "where", "words"), FAULTY.values(), ids=FAULTY.keys())
def test_faults_are_named_with_place_and_remedy(body: Body, where: str, words: list[str]) -> None:
    start = time.monotonic()
    faults = check_body(body)
    assert time.monotonic() - start < 5.0
    found = [fault for fault in faults if fault.where == where]
    assert found, faults
    text = " ".join(f"{fault.what}; {fault.remedy}" for fault in found)
    for word in words:
        assert word in text, text
    assert all(fault.what and fault.remedy for fault in faults)


@pytest.mark.parametrize("factor", [1e-6, 1e6])
@pytest.mark.parametrize("name", [name for name in FAULTY if name not in ("no edge", "not finite", "infinite")])
def test_faults_do_not_depend_on_the_unit_of_length(name: str, factor: float) -> None:
    body, where, _ = FAULTY[name]
    assert where in [fault.where for fault in check_body(scaled(body, factor, 0.0))]


def test_long_outlines_are_checked_soon_and_wholly() -> None:
    angles = np.linspace(0, 2 * math.pi, 3000, endpoint=False)
    radii = 1 + 0.05 * np.cos(40 * angles)
    points = [(float(r * math.cos(a)), float(r * math.sin(a))) for r, a in zip(radii, angles, strict=True)]
    start = time.process_time()
    assert check_body(Body(polygon_loop(points, "edge"))) == []
    points[2500], points[2505] = points[2505], points[2500]
    faults = check_body(Body(polygon_loop(points, "edge")))
    assert time.process_time() - start < 20.0, "a check of all pairs takes minutes"
    assert faults
    assert isinstance(faults[0], Fault)


@settings(max_examples=60, deadline=None)
@given(st.lists(st.tuples(st.integers(0, 6), st.integers(0, 6)), min_size=3, max_size=7))
def test_random_polygons_are_judged_like_brute_force(points: list[tuple[int, int]]) -> None:
    loop = polygon_loop([(float(x), float(y)) for x, y in points], "edge")
    faulty = bool(check_body(Body(loop)))
    assert faulty == (not simple(points) or loop_area(loop) <= 0)


def simple(points: list[tuple[int, int]]) -> bool:
    """Whether a lattice polygon does not touch itself, in integer arithmetic."""

    def side(a: tuple[int, int], b: tuple[int, int], c: tuple[int, int]) -> int:
        cross = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
        return (cross > 0) - (cross < 0)

    def on(a: tuple[int, int], b: tuple[int, int], c: tuple[int, int]) -> bool:
        box = all(min(a[k], b[k]) <= c[k] <= max(a[k], b[k]) for k in (0, 1))
        return side(a, b, c) == 0 and box

    n = len(points)
    if len(set(points)) < n:
        return False
    segments = [(points[i], points[(i + 1) % n]) for i in range(n)]
    for i in range(n):
        a, b = segments[i]
        c = segments[(i + 1) % n][1]
        if on(a, b, c) or on(b, c, a):
            return False
        for j in range(i + 2, n):
            if (j + 1) % n == i:
                continue
            c, d = segments[j]
            proper = side(a, b, c) * side(a, b, d) < 0 and side(c, d, a) * side(c, d, b) < 0
            if proper or on(a, b, c) or on(a, b, d) or on(c, d, a) or on(c, d, b):
                return False
    return True
