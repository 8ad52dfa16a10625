"""The picture of a point shows what is stored: body, edges, contact line, whatever its shape."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

pytest.importorskip("matplotlib")

from matplotlib.collections import PolyCollection

import tcstudy
from tcstudy.read.study import read_study_text
from tcstudy.reports.figures.body import boundary_edges, exaggeration, polylines
from tcstudy.reports.figures.point import stick_ranges, stick_text
from tcstudy.reports.picture import NamedEdge, contact_edges, read_picture
from tcstudy.scene.contact_states import NormalState
from tests.reports.conftest import Stored
from tests.reports.figures.shown import contact_panels, crowded, drawn, figure_of, line, shown_line

TWO = line([1, 2, 4, 4], [0, 0, 1, 2], [1, 2, 4, 5], [1.5, 1.5, 1.5, 0.5], [0, 0, 1, 1])
"""Two edges with a gap between them."""
WIDTH, HEIGHT = 0.2, 0.1


def test_the_curves_are_the_stored_numbers_in_readable_units(stored: Stored) -> None:
    upper, lower = contact_panels(
        drawn(stored("block"), at={"theta_bar": 20, "friction": "weak"})[0]
    )
    with xr.open_datatree(stored("block")) as tree:
        level = tree["level_1"].dataset.isel(theta_bar=2, friction=1).load()
    n, s = level.sizes["node"], 1e3 * level["arclength"].values
    np.testing.assert_allclose(
        shown_line(upper), [[0.0, *s], [0.0, *(1e6 * level["u_T"].values)]], rtol=1e-12
    )
    edges, values = shown_line(lower)
    np.testing.assert_allclose(values[::2], 1e-6 * level["xi"].values, rtol=1e-12)
    # Segments: the first one reaches to the held node at s = 0, the last one is half an element.
    expected = [0.0, *(1e3 * WIDTH / n * (np.arange(1, n) + 0.5)), 1e3 * WIDTH]
    np.testing.assert_allclose(np.append(edges[::2], edges[-1]), expected, rtol=1e-9)
    assert [upper.get_ylabel(), lower.get_ylabel()] == ["$u_{T}$ [µm]", "ξ = −$S_{T}$ [MPa]"]


def test_the_deformed_body_is_the_mesh_moved_by_the_stated_factor(stored: Stored) -> None:
    shown = read_picture(stored("block"), {"theta_bar": 10}, 0)
    body = figure_of(shown).axes[0]
    factor, largest = exaggeration(shown.body.xy, shown.body.u), np.hypot(*shown.body.u.T).max()
    assert 0.02 < factor * largest / np.hypot(WIDTH, HEIGHT) <= 0.0601
    assert f"deformation × {factor:g};" in body.get_title(loc="left").replace("\n", " ")
    rim = boundary_edges(shown.body.xy, shown.body.triangles)
    still = 1e3 * shown.body.xy
    moved = 1e3 * (shown.body.xy + factor * shown.body.u)
    found = [
        np.array(line.get_data(), dtype=float)[:, :-1]
        for line in body.lines
        if len(line.get_xdata()) == len(rim) + 2
    ]
    expected = [np.transpose(*polylines(one[rim])) for one in (still, moved)]
    np.testing.assert_allclose(found, expected, rtol=1e-12, atol=1e-12)
    box, (left, right), (bottom, top) = body.get_window_extent(), body.get_xlim(), body.get_ylim()
    assert (right - left) / box.width == pytest.approx((top - bottom) / box.height, rel=1e-9)
    high, *below = figure_of(
        replace(shown, body=replace(shown.body, xy=shown.body.xy * [1.0, 4.0]))
    ).axes[:3]
    assert high.get_ylim()[0] < 0.0 < 4e3 * HEIGHT < high.get_ylim()[1]
    assert {one.get_xlim() for one in below} == {high.get_xlim()}


def test_no_text_overlaps_another_and_roles_and_the_heater_are_named(stored: Stored) -> None:
    shown = read_picture(stored("block"))
    clamp = NamedEdge("wall", "clamped", 0, np.array([[0.0, HEIGHT], [0.0, 0.0]]))
    rest = NamedEdge("film", "contact", 0, np.array([[0.0, 0.0], [WIDTH, 0.0]]))
    end = NamedEdge(
        "end", "convection", 0, np.array([[WIDTH, 0.0], [WIDTH, HEIGHT], [0.0, HEIGHT]]), True
    )
    heater = np.array([[0.05, 0.03], [0.1, 0.03], [0.1, 0.06], [0.05, 0.06]])
    for one in (
        shown,
        replace(shown, line=TWO, body=None, held=()),
        replace(shown, body=replace(shown.body, xy=shown.body.xy * [1.0, 0.1])),
        replace(shown, point=", ".join([shown.point] * 4)),
        replace(shown, edges=(clamp, rest, end), sources=(heater,)),
    ):
        figure = figure_of(one)
        assert crowded(figure) == []
    found = {text.get_text() for axes in figure.axes for text in axes.texts}
    assert {"wall: clamped", "heated", "end: convection, traction"} <= found
    figure = figure_of(shown, "von_mises", 50.0)
    assert "deformation × 50;" in figure.axes[0].get_title(loc="left").replace("\n", " ")
    assert figure.axes[-1].get_ylabel().startswith("von Mises")


def test_what_sticks_is_shaded_in_both_panels(stored: Stored) -> None:
    shown = read_picture(stored("block"), level=0)
    half = replace(shown.line, sticks=np.array([True, True, False, False, False]))
    assert stick_ranges(half) == [pytest.approx((0.0, 0.1))]
    assert "the shaded part sticks (50.0 %)" in stick_text(half)
    for axes in contact_panels(figure_of(replace(shown, line=half))):
        (shade,) = [patch for patch in axes.patches if not hasattr(patch, "get_data")]
        assert (shade.get_x(), shade.get_x() + shade.get_width()) == pytest.approx((0.0, 100.0))
    still = replace(shown, line=replace(half, u_T=0.0 * half.u_T), body=None)
    assert contact_panels(figure_of(still))[0].get_yticks().tolist() == [
        0.0
    ]  # ±0.05 m would look like measured


def test_parts_end_at_gaps_and_held_corners(stored: Stored) -> None:
    assert TWO.parts == [slice(0, 2), slice(2, 4)]
    np.testing.assert_allclose(TWO.cells(slice(0, 2)), [0.0, 1.5, 3.0])
    np.testing.assert_allclose(TWO.cells(slice(2, 4)), [3.0, 4.5, 5.0])
    assert line([1, 2, 3, 4], [0] * 4, [1, 2, 3, 4], [1.5, 1, 1, 0.5], [0, 0, 1, 1]).parts == [
        slice(0, 4)
    ]
    _, lower = contact_panels(
        figure_of(replace(read_picture(stored("block")), line=TWO, body=None, held=()))
    )
    steps = [line.get_ydata()[::2].tolist() for line in lower.lines if len(line.get_xdata()) > 2]
    assert (steps, [text.get_text() for text in lower.texts]) == (
        [[10.0, 20.0], [30.0, 40.0]],
        ["pad", "rim"],
    )


def test_a_ring_closes_on_itself(stored: Stored) -> None:
    ring = line([0, 1, 1, 0], [0, 0, 1, 1], [0, 1, 2, 3], [1, 1, 1, 1], [0, 0, 0, 0])
    (part,) = ring.parts
    assert ring.closed(part)
    ends, nodes = ring.steps(part)
    np.testing.assert_allclose(ends, [0.0, 0.5, 1.5, 2.5, 3.5, 4.0])
    assert (nodes.tolist(), stick_ranges(ring)) == ([0, 1, 2, 3, 0], [pytest.approx((0.5, 3.5))])
    assert not line([0, 1, 1, 0], [0, 0, 1, 1], [0, 1, 2, 3], [0.5, 1, 1, 0.5], [0] * 4).closed(
        part
    )
    assert not line([1, 2, 3], [0, 0, 0], [1, 2, 3], [1.5, 1, 1.5], [0] * 3).closed(
        slice(0, 3)
    )  # both ends held
    shown = read_picture(stored("block"), level=0)
    rim = boundary_edges(shown.body.xy, shown.body.triangles)
    (walk,) = polylines(shown.body.xy[rim])
    step, m = np.hypot(*np.diff(walk, axis=0).T), len(rim)
    x, y, s, c = (
        one.tolist()
        for one in (*walk[:-1].T, np.cumsum(step) - step, 0.5 * (step + np.roll(step, 1)))
    )
    around = line(x, y, s, c, [1] * m)
    (edge,) = contact_edges(around, {})  # as of a body whose edges the study does not say
    assert np.array_equal(edge.line, walk)
    named = figure_of(replace(shown, line=around, edges=(edge,), scene=None, sources=())).axes[0]
    assert [text.get_text() for text in named.texts if text.get_text()] == ["rim"]
    with xr.open_datatree(stored("block")) as tree:
        (edge,) = contact_edges(shown.line, tree["level_0"].to_dataset().load())
    assert (edge.name, edge.line[:, 0]) == (
        "film",
        pytest.approx(WIDTH / 5 * np.arange(6)),
    )  # from the held corner on


def test_each_geometry_has_its_own_mesh(stored: Stored) -> None:
    high, less = (
        read_picture(stored("pads"), {"height": 0.02, "u_x": u_x}) for u_x in (0.002, 0.001)
    )
    assert np.ptp(high.body.xy[:, 1]) == pytest.approx(0.02)
    assert np.abs(high.line.u_T).max() == pytest.approx(float(high.values["u_T_max"]))
    assert np.abs(less.line.u_T).max() < np.abs(high.line.u_T).max()


def test_a_profile_goes_along_a_line_in_pieces_by_material(tmp_path: Path) -> None:
    """Two layers of one ν that are stretched alike: u_x = ε x, σ_x = E ε in each, σ_y = τ = 0, all
    of which P1 has."""
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
    displacement, stress = drawn(tmp_path / "out.nc", along="100 mm, 0 mm: 100 mm, 60 mm")[0].axes
    _, u_x, _ = (line.get_ydata() for line in displacement.lines)
    assert u_x == pytest.approx(100.0, rel=1e-9)
    _, body, coat, *others = (line.get_ydata() for line in stress.lines)
    for sigma, E in ((body, 200.0), (coat, 50.0)):
        assert sigma[np.isfinite(sigma)] == pytest.approx(E, rel=1e-9)
    assert np.all(np.isfinite(body) | np.isfinite(coat))
    assert np.nanmax(np.abs(others)) < 1e-6


# -- edges that open


def test_openings_have_two_rows_and_their_gap_in_the_body(stored: Stored) -> None:
    shown = read_picture(stored("curl"), {"theta": "-50*(y - 0.1)"}, 0)
    body, gap, stress, slip = figure_of(shown).axes[:4]
    with xr.open_datatree(stored("curl")) as tree:
        level = tree["level_0"].dataset.isel({"heat_theta": 0}, missing_dims="ignore").load()
    s, opening = level["opening_arclength"].values, level["opening"].values
    np.testing.assert_allclose(shown_line(gap), [s, 1e6 * opening], rtol=1e-9, atol=1e-9)
    _, values = shown_line(stress)
    np.testing.assert_allclose(values[::2], 1e-3 * level["S_N"].values, rtol=1e-9, atol=1e-6)
    labels = [axes.get_ylabel() for axes in (gap, stress, slip)]
    assert labels == ["opening $s_{N}$ [µm]", "$S_{N}$ [kPa]", "$u_{T}$ [µm]"]
    is_open = opening > 1e-9 * opening.max()
    share = level["c_N"].values[is_open].sum() / level["c_N"].values.sum()
    assert f"{100 * share:.1f} % is open (blue)" in gap.get_title(loc="left")
    (gaps,) = (item for item in body.collections if isinstance(item, PolyCollection))
    assert len(gaps.get_paths()) == len(s) - 1


def test_nodes_of_a_bond_that_opens_have_the_states_of_its_law(stored: Stored) -> None:
    openings = read_picture(stored("arm"), None, 0).openings
    assert openings is not None
    s_N, states = openings.s_N, openings.states
    expected = np.select(
        [s_N <= 0.0, s_N < 4e-6, s_N < 14e-6],
        [NormalState.CLOSED, NormalState.ELASTIC, NormalState.SOFTENING],
        NormalState.OPEN,
    )
    np.testing.assert_array_equal(states, expected)
    assert set(expected) == set(NormalState)
    assert read_picture(stored("block"), {"theta_bar": 10}, 0).openings is None
