"""The picture of a point shows what is stored: body, edges, contact line, whatever its shape; and its file."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("matplotlib")


import tcstudy
from tcstudy.errors import DrawError, UsageError
from tcstudy.read.study import read_study_text
from tcstudy.reports.figures import draw, style
from tcstudy.reports.figures.body import boundary_edges, contact_chains, exaggeration
from tcstudy.reports.figures.draw import Wanted, picture
from tcstudy.reports.figures.edges import chained, joined
from tcstudy.reports.figures.point import point_figure, stick_ranges, stick_text
from tcstudy.reports.picture import read_picture
from tcstudy.reports.stored_study import NamedEdge, nearest
from tests.reports.figures.draw_cases import (
    HEIGHT,
    LOOKS,
    WIDTH,
    cells,
    contact_panels,
    crowded,
    figure_of,
    level_record,
    line,
    off_the_page,
    point_record,
    shown_line,
    shown_steps,
)

TWO = line([1, 2, 4, 4], [0, 0, 1, 2], [1, 2, 4, 5], [1.5, 1.5, 1.5, 0.5], [0, 0, 1, 1])
"""Two edges with a gap between them."""


def test_the_curves_are_the_stored_numbers_in_readable_units(grid: Path) -> None:
    upper, lower = contact_panels(figure_of(read_picture(grid, {"alpha": 25, "friction": "softening"}, 1)))
    record = point_record((0, 1), level_record(1, False))
    s = 1e3 * level_record(1, False).arclength
    np.testing.assert_allclose(shown_line(upper), [s, 1e6 * record.u_T], rtol=1e-12)
    values, edges = shown_steps(lower)
    n, h = cells(1), 1e3 * WIDTH / cells(1)
    np.testing.assert_allclose(values, 1e-6 * record.xi, rtol=1e-12)
    # Segments: the first one reaches to the held node at s = 0, the last one is half an element.
    np.testing.assert_allclose(edges, [0.0, *(h * (np.arange(1, n) + 0.5)), 1e3 * WIDTH], rtol=1e-12)
    assert [upper.get_ylabel(), lower.get_ylabel()] == ["$u_T$ [µm]", r"$\xi = -S_T$ [MPa]"]
    assert lower.get_xlabel() == "arclength s along film [mm]"


def test_the_deformed_body_is_the_mesh_moved_by_the_stated_factor(grid: Path) -> None:
    shown = read_picture(grid, {"alpha": 100}, 0)
    assert shown.body
    body = figure_of(shown).axes[0]
    factor, largest = exaggeration(shown.body.xy, shown.body.u), np.hypot(*shown.body.u.T).max()
    assert f"{factor:.0e}"[0] in "125"
    assert 0.02 < factor * largest / np.hypot(WIDTH, HEIGHT) <= 0.0601
    assert f"deformation × {factor:g};" in body.get_title(loc="left")
    mesh, record = level_record(0, True).fields, point_record((1, 0), level_record(0, True))
    rim = boundary_edges(shown.body.xy, shown.body.triangles)
    still = 1e3 * np.column_stack([mesh["node_x"], mesh["node_y"]]).astype(float)
    moved = still + 1e3 * factor * np.column_stack([record.fields["u_x"], record.fields["u_y"]])
    found = [np.array(line.get_data(), dtype=float) for line in body.lines if len(line.get_xdata()) == 2 * len(rim)]
    np.testing.assert_allclose(found, [joined(chained(one[rim])) for one in (still, moved)], rtol=1e-12, atol=1e-12)
    box, (left, right), (bottom, top) = body.get_window_extent(), body.get_xlim(), body.get_ylim()
    assert (right - left) / box.width == pytest.approx((top - bottom) / box.height, rel=1e-9)


def test_no_text_overlaps_another_or_leaves_the_page(grid: Path) -> None:
    shown = read_picture(grid)
    body = shown.body
    assert body
    for one in (
        shown,
        replace(shown, line=TWO, body=None),
        replace(shown, body=replace(body, xy=body.xy * [1.0, 0.1])),
        replace(shown, point=", ".join([shown.point] * 4)),
    ):
        assert crowded(figure_of(one)) == []
    for look in LOOKS:
        with style.styled(look):
            assert off_the_page(point_figure(shown, look)) == []


def test_roles_and_the_heater_are_drawn_and_named(grid: Path) -> None:
    clamp = NamedEdge("wall", "clamped", 0, np.array([[0.0, HEIGHT], [0.0, 0.0]]))
    rest = NamedEdge("film", "contact", 0, np.array([[0.0, 0.0], [WIDTH, 0.0]]))
    end = NamedEdge("end", "convection", 0, np.array([[WIDTH, 0.0], [WIDTH, HEIGHT], [0.0, HEIGHT]]), True)
    heater = np.array([[0.05, 0.03], [0.1, 0.03], [0.1, 0.06], [0.05, 0.06]])
    figure = figure_of(replace(read_picture(grid), edges=(clamp, rest, end), sources=(heater,)))
    assert crowded(figure) == []
    found = {text.get_text() for axes in figure.axes for text in axes.texts}
    assert {"wall: clamped", "heated", "end: convection, traction"} <= found


def test_the_boundary_is_found_whatever_the_orientation_of_triangles(grid: Path) -> None:
    body = read_picture(grid).body
    assert body
    mixed = body.triangles.copy()
    mixed[::2] = mixed[::2, ::-1]
    rim = boundary_edges(body.xy, mixed)
    np.testing.assert_array_equal(rim, boundary_edges(body.xy, body.triangles))
    walk = joined(chained(body.xy[rim]))
    assert not np.isnan(walk).any()
    assert np.sum(walk[0, :-1] * walk[1, 1:] - walk[0, 1:] * walk[1, :-1]) == pytest.approx(2 * WIDTH * HEIGHT)
    bottom = NamedEdge("bottom", "free", 0, np.array([[0.0, 0.0], [WIDTH, 0.0]]))
    rest = NamedEdge("rest", "free", 0, np.array([[WIDTH, 0.0], [WIDTH, HEIGHT], [0.0, HEIGHT], [0.0, 0.0]]))
    assert np.count_nonzero(nearest(body.xy[rim].mean(axis=1), [bottom, rest]) == 0) == cells(1)


# -- the contact line --------------------------------------------------------------------------------------------------


def test_the_sticking_half_is_shaded_in_both_panels(grid: Path) -> None:
    shown = read_picture(grid, level=0)
    np.testing.assert_array_equal(shown.line.sticks, [True, True, False, False])
    assert stick_ranges(shown.line) == [pytest.approx((0.0, 0.125))]
    assert "the shaded part sticks (62.5 %)" in stick_text(shown.line)
    for axes in contact_panels(figure_of(shown)):
        (shade,) = [patch for patch in axes.patches if not hasattr(patch, "get_data")]
        assert (shade.get_x(), shade.get_x() + shade.get_width()) == pytest.approx((0.0, 125.0))
    still = replace(shown, line=replace(shown.line, u_T=0.0 * shown.line.u_T))
    assert contact_panels(figure_of(still))[0].get_yticks().tolist() == [0.0]  # ±0.05 m would look like measured


def test_parts_end_at_gaps_and_held_corners(grid: Path) -> None:
    assert TWO.parts == [slice(0, 2), slice(2, 4)]
    np.testing.assert_allclose(TWO.cells(slice(0, 2)), [0.0, 1.5, 3.0])
    np.testing.assert_allclose(TWO.cells(slice(2, 4)), [3.0, 4.5, 5.0])
    straight = line([1, 2, 3, 4], [0] * 4, [1, 2, 3, 4], [1.5, 1, 1, 0.5], [0, 0, 1, 1])
    assert straight.parts == [slice(0, 4)]
    _, lower = contact_panels(figure_of(replace(read_picture(grid), line=TWO, body=None)))
    steps = [line.get_ydata()[::2].tolist() for line in lower.lines if len(line.get_xdata()) > 2]
    assert steps == [[10.0, 20.0], [30.0, 40.0]]
    assert [text.get_text() for text in lower.texts] == ["pad", "rim"]


def test_a_ring_closes_on_itself(grid: Path) -> None:
    ring = line([0, 1, 1, 0], [0, 0, 1, 1], [0, 1, 2, 3], [1, 1, 1, 1], [0, 0, 0, 0])
    (part,) = ring.parts
    assert ring.closed(part)
    ends, nodes = ring.steps(part)
    np.testing.assert_allclose(ends, [0.0, 0.5, 1.5, 2.5, 3.5, 4.0])
    assert nodes.tolist() == [0, 1, 2, 3, 0]
    assert stick_ranges(ring) == [pytest.approx((0.5, 3.5))]
    assert not line([0, 1, 1, 0], [0, 0, 1, 1], [0, 1, 2, 3], [0.5, 1, 1, 0.5], [0] * 4).closed(part)
    assert not line([1, 2, 3], [0, 0, 0], [1, 2, 3], [1.5, 1, 1.5], [0] * 3).closed(slice(0, 3))  # both ends held
    shown = read_picture(grid, level=0)
    assert shown.body
    rim = boundary_edges(shown.body.xy, shown.body.triangles)
    x, y = chained(shown.body.xy[rim])[:, 0].T
    step, m = WIDTH / 4, len(rim)
    around = line(x.tolist(), y.tolist(), [step * i for i in range(m)], [step] * m, [1] * m)
    ((chain, index),) = contact_chains(shown.body.xy, rim, around)
    assert sorted(chain[:-1].tolist()) == np.unique(rim).tolist()
    assert chain[0] == chain[-1]
    assert index.tolist() == [*range(m), 0]
    assert [text.get_text() for text in figure_of(replace(shown, line=around)).axes[0].texts] == ["rim"]
    both = line(
        [step, 2 * step, 3 * step], [0, 0, 0], [step, 2 * step, 3 * step], [1.5 * step, step, 1.5 * step], [0] * 3
    )
    for one, expected in ((shown.line, [0, 0, 1, 2, 3]), (both, [0, 0, 1, 2, 2])):  # to the held corners
        ((chain, index),) = contact_chains(shown.body.xy, rim, one)
        assert (chain.tolist(), index.tolist()) == ([0, 1, 2, 3, 4], expected)


def test_a_held_end_is_drawn_where_it_rests_or_moves(grid: Path, tmp_path: Path) -> None:
    """Of every point its own: u_x of the end, which the sweep moves, and an expression at its corner."""
    shown = read_picture(grid, level=0)
    assert shown.line.held(slice(0, 4)) == (True, False)
    assert not shown.held  # the file does not say it
    upper, _ = contact_panels(figure_of(replace(shown, held=((0.0, None),))))
    assert shown_line(upper)[:, 0].tolist() == [0.0, 0.0]
    assert "held" in [text.get_text() for text in upper.texts]
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
        moved = read_picture(tmp_path / "out.nc", {"boundary_left_u_x": u_x})
        assert np.allclose(np.array(moved.held, dtype=float), [[u_x, 0.25]], rtol=1e-12)
    upper, _ = contact_panels(figure_of(moved))
    assert len(shown_line(upper)[0]) == len(moved.line.u_T) + 2


def test_stresses_are_drawn_with_their_error_and_a_factor_that_is_chosen(
    block: Path, pads: Path, tmp_path: Path
) -> None:
    point = read_picture(block)
    with style.styled():
        figure = point_figure(point, style.Look(), "von_mises", 50.0)
    title = figure.axes[0].get_title(loc="left").replace("\n", " ")
    assert "deformation × 50;" in title
    assert "estimated error" in title
    assert figure.axes[-1].get_ylabel().startswith("von Mises")
    for wanted, message in (
        (Wanted(of="sigma"), "has no field 'sigma'"),
        (Wanted(of="tau_xy", law=True), "another picture"),
    ):
        with pytest.raises((DrawError, UsageError), match=message):
            picture(block, tmp_path / "a.png", wanted)
    high = read_picture(pads, {"height": 0.02, "u_x": 0.002})  # each geometry has its own mesh
    assert high.body is not None
    assert np.ptp(high.body.xy[:, 1]) == pytest.approx(0.02)
    assert np.abs(high.line.u_T).max() == pytest.approx(float(high.at["u_T_max"]))
    assert np.abs(read_picture(pads, {"height": 0.02, "u_x": 0.001}).line.u_T).max() < np.abs(high.line.u_T).max()


def test_a_profile_goes_along_a_line_in_pieces_by_material(tmp_path: Path) -> None:
    """Two layers of one ν that are stretched alike: u_x = ε x, σ_x = E ε in each, σ_y = τ = 0, all of which P1 has."""
    study = read_study_text("""
body: {rectangle: {width: 200 mm, height: 60 mm},
       regions: {coat: {rectangle: {corner: [0 mm, 0 mm], width: 200 mm, height: 20 mm}}}}
boundary: {bottom: contact, left: {role: clamped, u_x: 0 m}, top: free, right: {role: clamped, u_x: 0.2 mm}}
material: {E: 200 GPa, nu: 0.3, plane: stress}
materials: {coat: {E: 50 GPa, nu: 0.3}}
friction: {law: tresca, tau: 1 MPa, strength: 0}
mesh: {maxh: 30 mm, levels: 1}
output: {fields: true}
""")
    tcstudy.run(study, tmp_path / "out.nc")
    displacement, stress = draw.figure_of(tmp_path / "out.nc", Wanted(along="100 mm, 0 mm: 100 mm, 60 mm")).axes
    assert [axes.get_ylabel() for axes in (displacement, stress)] == [
        "$u_x$, $u_y$ [µm]",
        "$\\sigma_x$, $\\sigma_y$, $\\tau_{xy}$ [MPa]",
    ]
    _, u_x, _ = (line.get_ydata() for line in displacement.lines)
    assert u_x == pytest.approx(100.0, rel=1e-9)
    _, body, coat, *others = (line.get_ydata() for line in stress.lines)
    assert body[np.isfinite(body)] == pytest.approx(200.0, rel=1e-9)
    assert coat[np.isfinite(coat)] == pytest.approx(50.0, rel=1e-9)
    assert np.all(np.isfinite(body) | np.isfinite(coat))
    assert np.nanmax(np.abs(others)) < 1e-6
    for along, message in (
        ("1, 1", "is no line"),
        ("1, 1: 2, 2", "no point of this line"),
        ("0, a: 1, 1", "is no line"),
    ):
        with pytest.raises((DrawError, UsageError), match=message):
            picture(tmp_path / "out.nc", tmp_path / "a.png", Wanted(along=along))


# -- the file ----------------------------------------------------------------------------------------------------------


def test_the_same_file_every_time_with_text_as_text_and_matplotlib_left_alone(grid: Path, tmp_path: Path) -> None:
    """Journals refuse fonts of Type 3; letters as outlines can be neither edited nor found."""
    import matplotlib

    with matplotlib.rc_context({"font.size": 7.0, "axes.spines.top": True}):
        before = dict(matplotlib.rcParams)
        for name in ("a.svg", "b.svg", "p.pdf"):
            picture(grid, tmp_path / name)
        assert dict(matplotlib.rcParams) == before
    assert (tmp_path / "a.svg").read_bytes() == (tmp_path / "b.svg").read_bytes()
    assert "Contact line: " in (tmp_path / "a.svg").read_text(encoding="utf-8")
    written = (tmp_path / "p.pdf").read_bytes()
    assert b"/Subtype /Type3" not in written
    assert b"/FontFile2" in written
