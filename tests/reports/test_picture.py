"""The contact line of a picture: what sticks, parts, rings, edges."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("matplotlib")


import tcstudy
from tcstudy.read.study import read_study_text
from tcstudy.reports.figures import style
from tcstudy.reports.figures.body_panel import boundary_edges, contact_chains, drawn, loops
from tcstudy.reports.figures.point_figure import stick_ranges, stick_text, window_below
from tcstudy.reports.picture import read_picture
from tcstudy.reports.stored_study import NamedEdge
from tests.reports.figures.draw_cases import (
    HEIGHT,
    WIDTH,
    contact_panels,
    crowded,
    figure_of,
    line,
    shown_line,
)


def test_the_sticking_half_is_shaded_in_both_panels(grid: Path) -> None:
    picture = read_picture(grid, level=0)
    np.testing.assert_array_equal(picture.line.sticks, [True, True, False, False])
    assert stick_ranges(picture.line) == [pytest.approx((0.0, 0.125))]
    assert "the shaded part sticks (62.5 %)" in stick_text(picture.line)
    for axes in contact_panels(figure_of(picture)):
        (shade,) = [patch for patch in axes.patches if not hasattr(patch, "get_data")]
        left, right = shade.get_x(), shade.get_x() + shade.get_width()
        assert (left, right) == pytest.approx((0.0, 125.0))


def test_no_slip_at_all_has_no_scale(grid: Path) -> None:
    """A range of ±0.05 m around zero would look like a measured one."""
    picture = read_picture(grid, level=0)
    still = replace(picture, line=replace(picture.line, u_T=0.0 * picture.line.u_T))
    upper, lower = contact_panels(figure_of(still))
    assert upper.get_yticks().tolist() == [0.0]
    assert len(lower.get_yticks()) > 1


def test_parts_end_at_gaps_and_held_corners() -> None:
    two = line([1, 2, 4, 4], [0, 0, 1, 2], [1, 2, 4, 5], [1.5, 1.5, 1.5, 0.5], [0, 0, 1, 1])
    assert two.parts == [slice(0, 2), slice(2, 4)]
    np.testing.assert_allclose(two.cells(slice(0, 2)), [0.0, 1.5, 3.0])
    np.testing.assert_allclose(two.cells(slice(2, 4)), [3.0, 4.5, 5.0])
    straight = line([1, 2, 3, 4], [0] * 4, [1, 2, 3, 4], [1.5, 1, 1, 0.5], [0, 0, 1, 1])
    assert straight.parts == [slice(0, 4)]


def test_a_ring_closes_on_itself() -> None:
    ring = line([0, 1, 1, 0], [0, 0, 1, 1], [0, 1, 2, 3], [1, 1, 1, 1], [0, 0, 0, 0])
    (part,) = ring.parts
    assert ring.closed(part)
    ends, nodes = ring.steps(part)
    np.testing.assert_allclose(ends, [0.0, 0.5, 1.5, 2.5, 3.5, 4.0])
    assert nodes.tolist() == [0, 1, 2, 3, 0]
    assert stick_ranges(ring) == [pytest.approx((0.5, 3.5))]
    assert not line([0, 1, 1, 0], [0, 0, 1, 1], [0, 1, 2, 3], [0.5, 1, 1, 0.5], [0] * 4).closed(part)
    assert not line([1, 2, 3], [0, 0, 0], [1, 2, 3], [1.5, 1, 1.5], [0] * 3).closed(slice(0, 3))  # both ends held


def test_the_panels_show_every_part_and_name_every_edge(grid: Path) -> None:
    two = line([1, 2, 4, 4], [0, 0, 1, 2], [1, 2, 4, 5], [1.5, 1.5, 1.5, 0.5], [0, 0, 1, 1])
    figure = figure_of(replace(read_picture(grid), line=two, body=None))
    _, lower = contact_panels(figure)
    steps = [patch.get_data().values.tolist() for patch in lower.patches if hasattr(patch, "get_data")]
    assert steps == [[10.0, 20.0], [30.0, 40.0]]
    assert [text.get_text() for text in lower.texts] == ["pad", "rim"]
    assert "along the contact line" in lower.get_xlabel()


def test_the_drawn_contact_edge_reaches_the_held_corner(grid: Path) -> None:
    picture = read_picture(grid, level=0)
    assert picture.body
    ((chain, index),) = contact_chains(picture.body, picture.line)
    assert chain.tolist() == [0, 1, 2, 3, 4]
    assert index.tolist() == [0, 0, 1, 2, 3]
    h = WIDTH / 4
    both = line([h, 2 * h, 3 * h], [0, 0, 0], [h, 2 * h, 3 * h], [1.5 * h, h, 1.5 * h], [0, 0, 0])
    ((chain, index),) = contact_chains(picture.body, both)
    assert chain.tolist() == [0, 1, 2, 3, 4]
    assert index.tolist() == [0, 0, 1, 2, 2]


def test_a_ring_of_contact_is_drawn_closed_and_named(grid: Path) -> None:
    picture = read_picture(grid, level=0)
    assert picture.body
    (loop,) = loops(boundary_edges(picture.body))
    x, y = picture.body.x[loop[:-1]], picture.body.y[loop[:-1]]
    step, m = WIDTH / 4, len(loop) - 1
    ring = line(x.tolist(), y.tolist(), [step * i for i in range(m)], [step] * m, [1] * m)
    ((chain, index),) = contact_chains(picture.body, ring)
    assert chain.tolist() == loop.tolist()
    assert index.tolist() == [*range(m), 0]
    figure = figure_of(replace(picture, line=ring))
    assert [text.get_text() for text in figure.axes[0].texts] == ["rim"]


def test_the_boundary_is_found_whatever_the_orientation(grid: Path) -> None:
    body = read_picture(grid, level=0).body
    assert body
    expected = {tuple(edge) for edge in boundary_edges(body).tolist()}
    assert len(expected) == 12
    mixed = body.triangles.copy()
    mixed[::2] = mixed[::2, ::-1]
    assert {tuple(edge) for edge in boundary_edges(replace(body, triangles=mixed)).tolist()} == expected


def test_a_tall_and_a_wide_body_fit_on_the_picture(grid: Path) -> None:
    body = read_picture(grid).body
    assert body
    for y in (40.0, 0.01):
        width, height = drawn(replace(body, y=y * body.y), "m").size
        assert width < style.WIDTH - 1.8
        assert height < 5.0


def test_the_arclength_stands_below_x(grid: Path) -> None:
    picture = read_picture(grid, level=0)
    assert picture.body
    shape = drawn(picture.body, "m")
    window = window_below(picture.line, picture.body, shape)
    assert window is not None
    unit = WIDTH / float(np.ptp(shape.x0))
    np.testing.assert_allclose(window, (shape.left * unit, shape.right * unit))
    back = replace(picture.line, x=WIDTH - picture.line.x)
    other = window_below(back, picture.body, shape)
    assert other is not None
    np.testing.assert_allclose(other, (WIDTH - shape.left * unit, WIDTH - shape.right * unit))
    assert window_below(replace(picture.line, y=picture.line.x), picture.body, shape) is None
    upper, lower = contact_panels(figure_of(picture))
    (body,) = [axes for axes in upper.figure.axes if axes.get_xlabel().startswith("x")]
    at = [axes.transData.transform((0.0, 0.0))[0] for axes in (body, upper, lower)]
    np.testing.assert_allclose(at, at[0], atol=1e-6)


def test_a_held_end_is_drawn_where_it_rests(grid: Path) -> None:
    picture = read_picture(grid, level=0)
    assert picture.line.held(slice(0, 4)) == (True, False)
    assert not picture.held  # the file does not say it
    upper, _ = contact_panels(figure_of(replace(picture, held=((0.0, None),))))
    s, u_T = shown_line(upper)
    assert (s[0], u_T[0]) == (0.0, 0.0)
    assert len(s) == len(picture.line.u_T) + 1
    assert "held" in [text.get_text() for text in upper.texts]


def test_a_held_end_that_moves_is_drawn_where_it_is(tmp_path: Path) -> None:
    """Of every point its own: u_x of the end, which the sweep moves, and an expression at its corner."""
    study = read_study_text("""
units: none
body: {rectangle: {width: 2, height: 1}}
boundary: {bottom: contact, left: {role: clamped, u_x: 0.1}, top: free,
  right: {role: clamped, u: ["0.05 + y + x/10", 0]}}
material: {E: 1, nu: 0.3}
friction: {law: tresca, tau: 0.01}
mesh: {maxh: 0.4}
sweep: {boundary.left.u_x: [0.2, 0.1, 0.3]}
""")
    tcstudy.run(study, tmp_path / "out.nc")
    for u_x in (0.1, 0.3):
        picture = read_picture(tmp_path / "out.nc", {"boundary_left_u_x": u_x})
        assert np.allclose(np.array(picture.held, dtype=float), [[u_x, 0.25]], rtol=1e-12)
    upper, _ = contact_panels(figure_of(picture))
    assert len(shown_line(upper)[0]) == len(picture.line.u_T) + 2


def test_roles_and_the_heater_are_drawn_and_named(grid: Path) -> None:
    clamp = NamedEdge("wall", "clamped", 0, np.array([[0.0, HEIGHT], [0.0, 0.0]]))
    rest = NamedEdge("film", "contact", 0, np.array([[0.0, 0.0], [WIDTH, 0.0], [WIDTH, HEIGHT], [0.0, HEIGHT]]))
    heater = np.array([[0.05, 0.03], [0.1, 0.03], [0.1, 0.06], [0.05, 0.06]])
    figure = figure_of(replace(read_picture(grid), edges=(clamp, rest), sources=(heater,)))
    assert crowded(figure) == []
    assert {"wall: clamped", "heated"} <= {text.get_text() for axes in figure.axes for text in axes.texts}
