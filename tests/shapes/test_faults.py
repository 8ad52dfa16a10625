"""Every kind of faulty body, named with place and remedy, in any unit of length."""

import math
import re
import time
from itertools import combinations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tcstudy.scene.records import Body, Edge, Loop, Point, Region
from tcstudy.shapes.edges import circle_loop, loop_area, polygon_loop, rectangle_loop
from tcstudy.shapes.faults import check_body

SQUARE = rectangle_loop((0.0, 0.0), 1.0, 1.0)


HOLE = circle_loop((0.5, 0.5), 0.2, "bore")
SOUND = {
    "square": Body(SQUARE),
    "arc": Body(
        Loop((*SQUARE.edges[:2], Edge((1, 1), (0, 1), "bite", through=(0.5, 0.7)), SQUARE.edges[3]))
    ),
    "straight corner": Body(polygon_loop([(0, 0), (1, 0), (2, 0), (2, 1), (0, 1)], "edge")),
    "holes": Body(SQUARE, (HOLE, rectangle_loop((0.1, 0.1), 0.1, 0.1, ("a",) * 4))),
    "region at the edge": Body(
        SQUARE, (), (Region("heater", rectangle_loop((0.0, 0.0), 0.5, 0.5)),)
    ),
    "region named like a hole": Body(
        SQUARE, (), (Region("pinholes", rectangle_loop((0.0, 0.0), 0.5, 0.5)),)
    ),
    "region to rounding": Body(
        SQUARE, (), (Region("heater", rectangle_loop((0.7, 0.1), 0.3 + 1e-16, 0.5)),)
    ),
    "disc in disc": Body(
        circle_loop((0, 0), 1, "rim"), (), (Region("all", circle_loop((0, 0), 1, "")),)
    ),
    "region at the hole": Body(
        SQUARE,
        (rectangle_loop((0.4, 0.4), 0.2, 0.2),),
        (Region("heater", rectangle_loop((0.2, 0.4), 0.2, 0.2)),),
    ),
    "regions side by side": Body(
        SQUARE,
        (),
        (
            Region("a", rectangle_loop((0, 0), 0.5, 1)),
            Region("b", rectangle_loop((0.5, 0), 0.5, 1)),
        ),
    ),
}


def scaled(body: Body, factor: float, shift: float) -> Body:
    def move(p: Point) -> Point:
        return (p[0] + shift) * factor, (p[1] - 2 * shift) * factor

    def loop(one: Loop) -> Loop:
        return Loop(
            tuple(
                Edge(move(e.start), move(e.end), e.name, move(e.through) if e.through else None)
                for e in one.edges
            )
        )

    assert body.outline is not None
    regions = tuple(Region(r.name, loop(r.loop)) for r in body.regions)
    return Body(loop(body.outline), tuple(map(loop, body.holes)), regions)


@pytest.mark.parametrize("factor", [1e-6, 1e6])
@pytest.mark.parametrize("body", SOUND.values(), ids=SOUND.keys())
def test_sound_bodies_have_no_faults(body: Body, factor: float) -> None:
    assert check_body(scaled(body, factor, 0.0)) == []
    assert check_body(scaled(body, factor, 3.3)) == []


def polygon(*points: Point) -> Loop:
    return polygon_loop(points, [f"e{i}" for i in range(len(points))])


def bitten(through: Point) -> Loop:
    return Loop((*SQUARE.edges[:2], Edge((1, 1), (0, 1), "bite", through=through), SQUARE.edges[3]))


def circle(x: float, y: float, radius: float) -> Loop:
    return circle_loop((x, y), radius, "c")


OPEN = Loop((*SQUARE.edges[:3], Edge((0, 1), (0, 0.1), "left")))
COLLINEAR = Loop(
    (Edge((0, 0), (1, 0), "a", (0.5, 0)), Edge((1, 0), (1, 1), "b"), Edge((1, 1), (0, 0), "c"))
)
ROUND = [Edge((0, 0), (8, 0), "a"), Edge((8, 0), (7, 5), "b"), Edge((7, 5), (4, 6), "c")]
ROUND = [*ROUND, Edge((4, 6), (1, 5), "d", (5.6, 6.1)), Edge((1, 5), (0, 0), "e")]
OUTLINES: list[tuple[Loop, str, str]] = [
    (Loop(()), "body.outline", "no edge"),
    (polygon((0, 0), (1, math.nan), (1, 1)), "body.outline[0]", "not finite"),
    (polygon((0, 0), (1, 0)), "body.outline", "2 edges do.*at least 3"),
    (OPEN, "body.outline[3]", r"edge 4 \(left\) ends at \(0, 0.1\).*begins at \(0, 0\)"),
    (polygon((0, 0), (1, 0), (1, 1), (0, 0)), "body.outline[3]", r"edge 4 \(e3\) has no length"),
    (polygon((0, 0), (1, 0), (1, 1), (1 - 1e-7, 1), (0, 1)), "body.outline[2]", "has length 1e-07"),
    (COLLINEAR, "body.outline[0]", r"through-point \(0.5, 0\).*leave out through"),
    (
        polygon((0, 0), (1, 0), (0.5, 0.5), (1, 1), (0, 1), (0.5, 0.5)),
        "body.outline[1]",
        r"edge 2 \(e1\) and edge 5 \(e4\).*at \(0.5, 0.5\)",
    ),
    (polygon((0, 0), (0, 1), (1, 1), (1, 0)), "body.outline", "clockwise.*reverse the order"),
    (
        polygon((0, 0), (1, 1), (1, 0), (0, 1)),
        "body.outline[0]",
        r"edge 1 \(e0\) and edge 3 \(e2\).*\(0.5, 0.5\)",
    ),
    (
        polygon((0, 0), (2, 0), (2, 1), (1, 1e-7), (0, 1)),
        "body.outline[0]",
        r"edge 1 \(e0\) and edge 3 \(e2\)",
    ),
    (
        polygon((0, 0), (2, 0), (0.5, 1e-5), (0, 1)),
        "body.outline[1]",
        r"edge 2 \(e1\) runs back along edge 1 \(e0\) from \(2, 0\)",
    ),
    (bitten((0.5, -0.2)), "body.outline[0]", r"edge 1 \(bottom\) and edge 3 \(bite\)"),
    (
        bitten((0.5, 0.5)),
        "body.outline[2]",
        r"edge 3 \(bite\) runs back along edge 2 \(right\) from \(1, 1\).*angle",
    ),
    (Loop(tuple(ROUND)), "body.outline", "an arc goes around.*between its from and"),
]
HOLES: list[tuple[tuple[Loop, ...], str, str]] = [
    ((circle(0.5, 0.5, 1e-8),), "body.holes[0]", "has length"),
    ((circle(3, 3, 0.2),), "body.holes[0]", "outside"),
    ((circle(0.5, 0.5, 3),), "body.holes[0]", "surrounds"),
    ((circle(0.8, 0.5, 0.2),), "body.holes[0]", r"outline at \(1, 0.5\)"),
    ((HOLE, circle(0.65, 0.5, 0.1)), "body.holes[1]", r"overlaps or touches body.holes\[0\]"),
]
REGIONS: list[tuple[tuple[Loop, ...], tuple[Loop, ...], str, str]] = [
    ((circle(3, 3, 0.2),), (), "body.regions.a", "lies outside"),
    ((rectangle_loop((0.5, 0.5), 1, 0.2),), (), "body.regions.a", r"leaves the body near \(1"),
    ((circle(0.5, 0.5, 2),), (), "body.regions.a", "leaves the body"),
    ((rectangle_loop((0.5, 0.5), 0.4, 0.1),), (HOLE,), "body.regions.a", r"body.holes\[0\]"),
    ((rectangle_loop((0.1, 0.1), 0.8, 0.8),), (HOLE,), "body.regions.a", "overlaps"),
    ((HOLE, circle(0.6, 0.5, 0.2)), (), "body.regions.b", "overlaps body.regions.a"),
]
FAULTY = [
    *((Body(loop), where, words) for loop, where, words in OUTLINES),
    *((Body(SQUARE, holes), where, words) for holes, where, words in HOLES),
    *(
        (Body(SQUARE, holes, tuple(map(Region, "ab", loops))), where, words)
        for loops, holes, where, words in REGIONS
    ),
]


@pytest.mark.parametrize(("body", "where", "words"), FAULTY)
def test_faults_are_named_with_place_and_remedy_in_any_unit_of_length(
    body: Body, where: str, words: str
) -> None:
    start = time.process_time()
    faults = check_body(body)
    assert time.process_time() - start < 5.0
    found = " ".join(f"{fault.what}; {fault.remedy}" for fault in faults if fault.where == where)
    assert re.search(words, found), faults
    assert all(fault.what and fault.remedy for fault in faults)
    if words not in ("no edge", "not finite"):
        for factor in (1e-6, 1e6):
            assert where in [fault.where for fault in check_body(scaled(body, factor, 0.0))]


def test_long_outlines_are_checked_soon_and_wholly() -> None:
    """A check of all pairs takes minutes."""
    angles = np.linspace(0, 2 * math.pi, 1500, endpoint=False)
    radii = 1 + 0.05 * np.cos(40 * angles)
    points = [
        (float(r * math.cos(a)), float(r * math.sin(a))) for r, a in zip(radii, angles, strict=True)
    ]
    start = time.process_time()
    assert check_body(Body(polygon_loop(points, "edge"))) == []
    points[1200], points[1205] = points[1205], points[1200]
    assert check_body(Body(polygon_loop(points, "edge")))
    assert time.process_time() - start < 20.0


@settings(max_examples=60, deadline=None)
@given(st.lists(st.tuples(st.integers(0, 6), st.integers(0, 6)), min_size=3, max_size=7))
def test_random_polygons_are_judged_like_brute_force(points: list[tuple[int, int]]) -> None:
    loop = polygon_loop([(float(x), float(y)) for x, y in points], "edge")
    assert bool(check_body(Body(loop))) == (not simple(points) or loop_area(loop) <= 0)


def simple(points: list[tuple[int, int]]) -> bool:
    """Whether a lattice polygon does not touch itself, in integer arithmetic."""

    def side(a: tuple[int, int], b: tuple[int, int], c: tuple[int, int]) -> int:
        cross = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
        return (cross > 0) - (cross < 0)

    def on(a: tuple[int, int], b: tuple[int, int], c: tuple[int, int]) -> bool:
        box = all(min(a[k], b[k]) <= c[k] <= max(a[k], b[k]) for k in (0, 1))
        return side(a, b, c) == 0 and box

    n = len(points)
    sides = [(points[i], points[(i + 1) % n]) for i in range(n)]
    for (a, b), (c, d) in combinations(sides, 2):
        crossing = side(a, b, c) * side(a, b, d) < 0 and side(c, d, a) * side(c, d, b) < 0
        own = [on(a, b, c), on(a, b, d), on(c, d, a), on(c, d, b)]
        if crossing or sum(own) > 2 * (
            (b == c) + (d == a)
        ):  # sides that follow share one end, which both sides see
            return False
    return len(set(points)) == n
