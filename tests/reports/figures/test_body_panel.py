"""What is drawn is what is stored: curves, body, colours, caption."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("matplotlib")


from tcstudy.reports.figures.body_panel import boundary_edges, exaggeration, loops
from tcstudy.reports.picture import read_picture
from tests.reports.figures.draw_cases import (
    ALPHA,
    HEIGHT,
    WIDTH,
    cells,
    contact_panels,
    crowded,
    figure_of,
    level_record,
    line,
    point_record,
    result,
    shown_line,
    shown_steps,
    texts,
)


@pytest.mark.parametrize("level", [0, 1])
def test_the_curves_are_the_stored_numbers_in_readable_units(grid: Path, level: int) -> None:
    figure = figure_of(read_picture(grid, {"alpha": 25, "friction": "softening"}, level))
    upper, lower = contact_panels(figure)
    record = point_record((0, 1), level_record(level, False))
    s = 1e3 * level_record(level, False).arclength
    np.testing.assert_allclose(shown_line(upper), [s, 1e6 * record.u_T], rtol=1e-12)
    values, edges = shown_steps(lower)
    n, h = cells(level), 1e3 * WIDTH / cells(level)
    np.testing.assert_allclose(values, 1e-6 * record.xi, rtol=1e-12)
    # Segments: the first one reaches to the held node at s = 0, the last one is half an element.
    np.testing.assert_allclose(edges, [0.0, *(h * (np.arange(1, n) + 0.5)), 1e3 * WIDTH], rtol=1e-12)
    assert upper.get_ylabel() == "$u_T$ [µm]"
    assert lower.get_ylabel() == r"$\xi = -S_T$ [MPa]"
    assert lower.get_xlabel() == "arclength s along film [mm]"


def test_the_deformed_body_is_the_mesh_moved_by_the_stated_factor(grid: Path) -> None:
    picture = read_picture(grid, {"alpha": 100}, 0)
    assert picture.body
    figure = figure_of(picture)
    body = figure.axes[0]
    factor = exaggeration(picture.body)
    assert f"deformation × {factor:g};" in body.get_title(loc="left")
    mesh = level_record(0, True).fields
    record = point_record((1, 0), level_record(0, True))
    (loop,) = loops(boundary_edges(picture.body))
    still = 1e3 * np.stack([mesh["node_x"], mesh["node_y"]]).astype(float)[:, loop]
    moved = still + 1e3 * factor * np.stack([record.fields["u_x"], record.fields["u_y"]])[:, loop]
    drawn_loops = [np.array(line.get_data(), dtype=float) for line in body.lines if len(line.get_xdata()) == len(loop)]
    assert len(drawn_loops) == 2
    np.testing.assert_allclose(drawn_loops, [still, moved], rtol=1e-12, atol=1e-12)


def test_the_body_keeps_its_proportions(grid: Path) -> None:
    figure = figure_of(read_picture(grid))
    axes = figure.axes[0]
    box = axes.get_window_extent()
    (left, right), (bottom, top) = axes.get_xlim(), axes.get_ylim()
    assert (right - left) / box.width == pytest.approx((top - bottom) / box.height, rel=1e-9)


def test_the_colours_span_the_stored_temperature(grid: Path) -> None:
    picture = read_picture(grid, {"alpha": 25}, 0)
    assert picture.body
    assert picture.body.theta is not None
    np.testing.assert_array_equal(picture.body.theta, point_record((0, 0), level_record(0, True)).fields["theta"])
    figure = figure_of(picture)
    (bar,) = [axes for axes in figure.axes if "temperature" in axes.get_ylabel()]
    low, high = bar.get_ylim()
    assert low <= 20.0 < 40.0 <= high
    assert high - low < 30.0
    assert "[K]" in bar.get_ylabel()


@pytest.mark.parametrize("theta", [None, 293.0])
def test_a_body_without_or_with_one_temperature(grid: Path, theta: float | None) -> None:
    picture = read_picture(grid)
    assert picture.body
    body = replace(picture.body, theta=None if theta is None else np.full(len(picture.body.x), theta))
    figure = figure_of(replace(picture, body=body))
    assert len(figure.axes) == 3
    assert ("293 K everywhere" in figure.axes[0].get_title(loc="left")) == (theta is not None)


def test_a_body_at_rest_is_drawn_undistorted(grid: Path) -> None:
    picture = read_picture(grid)
    assert picture.body
    rest = replace(picture.body, u_x=0.0 * picture.body.u_x, u_y=0.0 * picture.body.u_y)
    assert exaggeration(rest) == 1.0
    figure_of(replace(picture, body=rest))


@pytest.mark.parametrize("largest", [1e-9, 3e-7, 4.2e-5, 1e-3, 2.0])
def test_the_exaggeration_is_round_and_visible(grid: Path, largest: float) -> None:
    body = read_picture(grid).body
    assert body
    body = replace(body, u_x=largest * body.x / WIDTH, u_y=0.0 * body.y)
    factor = exaggeration(body)
    assert f"{factor:.0e}"[0] in "125"
    assert factor == float(f"{factor:.0e}")
    assert 0.02 < factor * largest / np.hypot(WIDTH, HEIGHT) <= 0.0601


def test_the_caption_names_the_point_and_the_mesh(grid: Path) -> None:
    shown = texts(figure_of(read_picture(grid, {"alpha": 100})))
    assert r"$\alpha$ = 100 W m⁻² K⁻¹,  friction: tresca" in shown
    assert "Plate for $5 and $6" in shown
    assert "level 1,  longest element edge 25 mm,  80 displacement unknowns,  inclusion residual 1e-12" in shown
    assert "film" in shown


def test_swept_parameters_have_readable_units(listed: Path) -> None:
    assert r"$\alpha$ = 25 W m⁻² K⁻¹,  $\tau$ = 20 MPa" in texts(figure_of(read_picture(listed, {"tau": 2e7})))
    expansion = (("alpha_T", 1.2e-5, "K-1"),)  # not 12 µK⁻¹, which is 12 (µK)⁻¹
    shown = texts(figure_of(replace(read_picture(listed), parameters=expansion)))
    assert r"$\alpha_T$ = 1.2e-05 K⁻¹" in shown


def test_a_dimensionless_file_has_no_units(tmp_path: Path) -> None:
    path = result(tmp_path / "r.nc", axes=(replace(ALPHA, units="1"),), units="none")
    shown = texts(figure_of(read_picture(path)))
    assert "$u_T$ [10⁻⁵]" in shown
    assert r"$\xi = -S_T$ [10⁸]" in shown
    assert "mm" not in shown
    assert r"$\alpha$ = 25" in shown


def test_without_fields_only_the_contact_line_is_drawn(tmp_path: Path) -> None:
    picture = read_picture(result(tmp_path / "r.nc", fields=False))
    assert picture.body is None
    assert len(figure_of(picture).axes) == 2


def test_no_text_overlaps_another(grid: Path) -> None:
    picture = read_picture(grid)
    body, two = picture.body, line([1, 2, 4, 4], [0, 0, 1, 2], [1, 2, 4, 5], [1.5, 1.5, 1.5, 0.5], [0, 0, 1, 1])
    assert body
    figures = [
        picture,
        replace(picture, body=None),
        replace(picture, line=two, body=None),
        replace(picture, body=replace(body, y=0.1 * body.y)),
        replace(picture, body=replace(body, y=4.0 * body.y)),
        replace(picture, parameters=picture.parameters * 4),
    ]
    for shown in figures:
        assert crowded(figure_of(shown)) == []
