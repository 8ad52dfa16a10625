"""Pictures of stored results: what is drawn is what is stored, and every fault has its one clear error."""

from __future__ import annotations

import struct
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pytest

pytest.importorskip("matplotlib")

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.image import imread
from matplotlib.text import Text

from tcstudy.data.provenance import Provenance
from tcstudy.data.records import LevelRecord, PointRecord, PointStatus
from tcstudy.data.store import StoreError, write
from tcstudy.report import style
from tcstudy.report.body_panel import drawn, exaggeration
from tcstudy.report.draw import DrawError, draw, draw_laws, point_figure
from tcstudy.report.law_figure import UP_STYLE, example_laws, law_figure
from tcstudy.report.line_panel import stick_ranges, stick_text
from tcstudy.report.outline import boundary_edges, contact_chains, loops
from tcstudy.report.picture import Line, Picture, read_picture, sticking
from tcstudy.scene.laws import SHAPES
from tcstudy.scene.records import Axis, MeshPlan, OutputPlan, SolverPlan, Study

WIDTH, HEIGHT = 0.2, 0.1
ALPHA = Axis("alpha", ("heat", "alpha"), (25, 100), (25.0, 100.0), "W m-2 K-1")
FRICTION = Axis("friction", ("friction",), ({}, {}), ("tresca", "softening"), "1")
TAU = Axis("tau", ("friction", "tau"), (1e6, 2e7), (1e6, 2e7), "Pa")
FAILED = (1, 1)


def study(mode: Literal["grid", "list"], axes: tuple[Axis, ...], units: Literal["SI", "none"] = "SI") -> Study:
    return Study(
        title="Plate for $5 and $6",
        text="title: plate\n",
        source=None,
        units=units,
        mode=mode,
        axes=axes,
        scenes=(),
        mesh=MeshPlan((0.05,), 2),
        solver=SolverPlan(),
        output=OutputPlan(),
    )


def cells(level: int) -> int:
    """Elements along the contact line."""
    return 4 * 2**level


def level_record(level: int, fields: bool) -> LevelRecord:
    """A plate 0.2 × 0.1; its bottom, held at the left end, is the contact line."""
    n = cells(level)
    x, y = np.meshgrid(np.linspace(0.0, WIDTH, n + 1), np.linspace(0.0, HEIGHT, n // 2 + 1))
    corner = np.arange((n + 1) * (n // 2)).reshape(n // 2, n + 1)[:, :-1].ravel()
    lower = np.stack([corner, corner + 1, corner + n + 2], axis=1)
    upper = np.stack([corner, corner + n + 2, corner + n + 1], axis=1)
    h = WIDTH / n
    s = h * np.arange(1, n + 1)
    c = np.full(n, h)
    c[0], c[-1] = (1.5 * h, 0.5 * h) if n > 1 else (h, h)
    mesh = {"node_x": x.ravel(), "node_y": y.ravel(), "triangle": np.concatenate([lower, upper]).astype(np.int32)}
    edge = np.zeros(n, dtype=np.int8)
    return LevelRecord(level, h, 10 * n, n, s, s, 0.0 * s, c, edge, ("film",), 0.1, 0.1, mesh if fields else {})


def point_record(index: tuple[int, ...], level: LevelRecord, theta: bool = True) -> PointRecord:
    """The first half of the line sticks; the numbers differ from point to point."""
    scale = 1.0 + sum((k + 1) * i for k, i in enumerate(index)) + 10.0 * level.level
    slips = level.x > 0.5 * WIDTH + 1e-9
    u_T = np.where(slips, 1e-5 * scale * (level.x - 0.5 * WIDTH) / WIDTH, 0.0)
    xi = 2e7 * scale * np.cos(level.x / WIDTH)
    numbers = {"slip_length": float(level.c[slips].sum()), "inclusion_residual": 1e-12}
    fields = {}
    if level.fields:
        x, y = level.fields["node_x"].astype(float), level.fields["node_y"].astype(float)
        fields = {"u_x": 1e-4 * scale * x / WIDTH, "u_y": 5e-5 * y / HEIGHT}
        if theta:
            fields["theta"] = 20.0 * scale + 100.0 * x
    return PointRecord(index, level.level, PointStatus.OK, "", numbers, u_T, xi, fields)


def failed_record(index: tuple[int, ...], level: int) -> PointRecord:
    reason = "the stiffness matrix is singular"
    return PointRecord(index, level, PointStatus.SINGULAR, reason, {}, np.empty(0), np.empty(0))


def result(
    path: Path,
    mode: Literal["grid", "list"] = "grid",
    axes: tuple[Axis, ...] = (ALPHA, FRICTION),
    fields: bool = True,
    theta: bool = True,
    units: Literal["SI", "none"] = "SI",
) -> Path:
    """A result file; its point FAILED has no solution on level 1."""
    plan = study(mode, axes, units)
    levels = [level_record(n, fields) for n in range(2)]
    points = [
        failed_record(index, 1) if index == FAILED and level.level == 1 else point_record(index, level, theta)
        for level in levels
        for index in np.ndindex(plan.shape)
    ]
    write(path, plan, levels, points, Provenance("now", (("python", "3.11"),), "abc"))
    return path


@pytest.fixture(scope="module")
def grid(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return result(tmp_path_factory.mktemp("grid") / "plate.nc")


@pytest.fixture(scope="module")
def listed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    alpha = replace(ALPHA, values=(25, 100, 25), labels=(25.0, 100.0, 25.0))
    tau = replace(TAU, values=(1, 2, 3), labels=(1e6, 1e6, 2e7))
    return result(tmp_path_factory.mktemp("list") / "plate.nc", "list", (alpha, tau))


def figure_of(picture: Picture) -> Figure:
    with style.styled():
        return point_figure(picture)


def shown_line(axes: Any) -> np.ndarray[Any, Any]:
    """(2, m) data of the curve among the lines of a panel (the others are reference lines of two points)."""
    (curve,) = [line for line in axes.lines if len(line.get_xdata()) > 2]
    return np.array(curve.get_data(), dtype=float)


def shown_steps(axes: Any) -> tuple[np.ndarray[Any, Any], np.ndarray[Any, Any]]:
    (steps,) = [patch for patch in axes.patches if hasattr(patch, "get_data")]
    values, edges, _ = steps.get_data()
    return values, edges


def texts(figure: Figure) -> str:
    found = [text.get_text() for text in figure.texts]
    for axes in figure.axes:
        found += [axes.get_title(loc="left"), axes.get_xlabel(), axes.get_ylabel()]
        found += [text.get_text() for text in axes.texts]
    return "\n".join(found)


# Files


def png_size(path: Path) -> tuple[int, int]:
    data = path.read_bytes()
    assert data[:8] == b"\x89PNG\r\n\x1a\n"
    width, height = struct.unpack(">II", data[16:24])
    return width, height


@pytest.mark.parametrize("fields", [True, False])
def test_a_png_of_the_right_size_that_is_not_blank(tmp_path: Path, fields: bool) -> None:
    path = result(tmp_path / "r.nc", fields=fields)
    target = tmp_path / "new" / "p.png"
    said = draw(path, target, {"alpha": 100})
    width, height = png_size(target)
    assert width == style.WIDTH * style.DPI
    assert (height > 0.9 * width) == fields
    pixels = imread(target)[..., :3]
    assert pixels.std() > 0.05
    assert len(np.unique((pixels * 255).astype(int).reshape(-1, 3), axis=0)) > 20
    assert "alpha = 100 W m-2 K-1, friction = tresca, level 1" in said
    assert ("output.fields" in said) == (not fields)


def test_an_svg_is_the_same_every_time(grid: Path, tmp_path: Path) -> None:
    for name in ("a.svg", "b.svg"):
        draw(grid, tmp_path / name)
    assert (tmp_path / "a.svg").read_bytes() == (tmp_path / "b.svg").read_bytes()
    assert "<svg" in (tmp_path / "a.svg").read_text()


def test_global_state_of_matplotlib_is_left_alone(grid: Path, tmp_path: Path) -> None:
    import matplotlib

    with matplotlib.rc_context({"font.size": 7.0, "axes.spines.top": True}):
        before = dict(matplotlib.rcParams)
        draw(grid, tmp_path / "p.png")
        assert dict(matplotlib.rcParams) == before


# Numbers shown


@pytest.mark.parametrize("level", [0, 1])
def test_the_curves_are_the_stored_numbers_in_readable_units(grid: Path, level: int) -> None:
    figure = figure_of(read_picture(grid, {"alpha": 25, "friction": "softening"}, level))
    upper, lower = figure.axes[-1], figure.axes[-2]
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


def crowded(figure: Figure) -> list[str]:
    """Texts that overlap another one or leave the picture."""
    renderer = FigureCanvasAgg(figure).get_renderer()
    figure.draw(renderer)
    hidden = set()
    for axes in figure.axes:
        for axis in (axes.xaxis, axes.yaxis):
            low, high = sorted(axis.get_view_interval())
            slack = 1e-9 * (high - low)
            hidden |= {id(t.label1) for t in axis.get_major_ticks() if not low - slack <= t.get_loc() <= high + slack}
    shown = [text for text in figure.findobj(Text) if isinstance(text, Text) and text.get_visible()]
    shown = [text for text in shown if id(text) not in hidden]
    boxes = [(text.get_text(), text.get_window_extent(renderer)) for text in shown if text.get_text().strip()]
    page = figure.bbox
    found = [
        f"{text} leaves the picture"
        for text, box in boxes
        if box.x0 < page.x0 or box.x1 > page.x1 or box.y0 < page.y0 or box.y1 > page.y1
    ]
    for i, (text, box) in enumerate(boxes):
        found += [f"{text} overlaps {other}" for other, rival in boxes[:i] if box.overlaps(rival)]
    return found


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


def test_no_text_of_the_laws_overlaps_another() -> None:
    steep = SHAPES["slip-weakening"].build(tau_s=2e7, tau_k=5e6, delta=4e-5)
    with style.styled():
        for laws in (example_laws(), [steep] * 4, [steep]):
            assert crowded(law_figure(laws)) == []


# Sticking and slipping


def test_the_sticking_half_is_shaded_in_both_panels(grid: Path) -> None:
    picture = read_picture(grid, level=0)
    np.testing.assert_array_equal(picture.line.sticks, [True, True, False, False])
    assert stick_ranges(picture.line) == [pytest.approx((0.0, 0.125))]
    assert "the shaded part sticks (62.5 %)" in stick_text(picture.line)
    for axes in figure_of(picture).axes[-2:]:
        (shade,) = [patch for patch in axes.patches if not hasattr(patch, "get_data")]
        left, right = shade.get_x(), shade.get_x() + shade.get_width()
        assert (left, right) == pytest.approx((0.0, 125.0))


@pytest.mark.parametrize(
    ("u_T", "slip_length", "expected"),
    [
        ([0.0, 0.0, 1.0, 2.0], 2.0, [True, True, False, False]),
        ([0.0, 0.0, 0.0, 0.0], 4.0, [False] * 4),  # no up-jump at 0: a spring under no load
        ([0.0, 0.0, 0.0, 0.0], 0.0, [True] * 4),
        ([1.0, 2.0, 3.0, 4.0], 4.0, [False] * 4),
        ([0.0, 0.5, 0.5, 2.0], 1.0, [True, True, True, False]),  # sticks at an up-jump away from 0, too
        ([0.0, 0.5, 0.5, 2.0], 2.0, [False, True, True, False]),
        ([0.0, 0.5, 0.6, 2.0], 2.0, None),
    ],
)
def test_sticking_agrees_with_the_stored_slip_length(
    u_T: list[float], slip_length: float, expected: list[bool] | None
) -> None:
    found = sticking(np.array(u_T), np.ones(4), slip_length)
    assert expected == (None if found is None else found.tolist())


# Contact lines of several parts


def line(x: list[float], y: list[float], s: list[float], c: list[float], edge: list[int]) -> Line:
    m = len(x)
    arrays = [np.array(values) for values in (s, x, y, c)]
    u_T = np.arange(1.0, m + 1)
    return Line(*arrays, np.array(edge), ("pad", "rim"), u_T, 10.0 * u_T, u_T > 1.0, "m", "Pa")


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
    lower = figure.axes[0]
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


# Choice of the point


@pytest.mark.parametrize(
    ("point", "label"),
    [
        (None, "alpha = 25 W m-2 K-1, friction = tresca"),
        ({"alpha": 100}, "alpha = 100 W m-2 K-1, friction = tresca"),
        ({"alpha": 100.0001, "friction": "tresca"}, "alpha = 100 W m-2 K-1, friction = tresca"),
        ({"alpha": "100"}, "alpha = 100 W m-2 K-1, friction = tresca"),
        ({"alpha": "0.01 W/(cm^2*K)"}, "alpha = 100 W m-2 K-1, friction = tresca"),
        ({"friction": "softening"}, "alpha = 25 W m-2 K-1, friction = softening"),
    ],
)
def test_a_point_by_its_labels(grid: Path, point: dict[str, float | str] | None, label: str) -> None:
    assert read_picture(grid, point).point == label


@pytest.mark.parametrize(
    ("point", "index"),
    [
        (None, 0),
        ({"alpha": 100}, 1),
        ({"tau": "20 MPa"}, 2),
        ({"alpha": 25, "tau": 2e7}, 2),
    ],
)
def test_a_point_of_a_list(listed: Path, point: dict[str, float | str] | None, index: int) -> None:
    picture = read_picture(listed, point)
    np.testing.assert_array_equal(picture.line.u_T, point_record((index,), level_record(1, False)).u_T)
    assert picture.parameters[1][0] == "tau"


def test_a_study_without_a_sweep(tmp_path: Path) -> None:
    path = result(tmp_path / "r.nc", axes=())
    assert read_picture(path).parameters == ()
    assert draw(path, tmp_path / "p.png") == f"{tmp_path / 'p.png'}: Plate for $5 and $6, level 1"
    with pytest.raises(DrawError, match=r"no swept parameter 'alpha'; leave the point out"):
        read_picture(path, {"alpha": 1})


@pytest.mark.parametrize(
    ("point", "message"),
    [
        ({"alhpa": 1}, r"no swept parameter 'alhpa'; did you mean 'alpha'\? it has alpha, friction"),
        ({"friction": "softning"}, r"friction = softning; did you mean 'softening'\? it has tresca, softening"),
        ({"alpha": 90}, r"no point of the file has alpha = 90; the nearest values are 25, 100"),
        ({"alpha": "warm"}, r"alpha = 'warm' is not a number; give one in W m-2 K-1"),
        ({"alpha": "20 MPa"}, r"alpha = '20 MPa': 'MPa' is not a unit of a heat transfer coefficient"),
        ({"alpha": float("nan")}, r"no point of the file has alpha = nan"),
    ],
)
def test_a_point_that_the_file_does_not_hold(grid: Path, point: dict[str, float | str], message: str) -> None:
    with pytest.raises(DrawError, match=message):
        read_picture(grid, point)


def test_labels_of_a_list_that_never_meet(listed: Path) -> None:
    with pytest.raises(DrawError, match=r"alpha = 100 and tau = 20 MPa together; .* alpha = 100 .* tau = 1e\+06 Pa"):
        read_picture(listed, {"alpha": 100, "tau": "20 MPa"})


def test_a_failed_point_says_why_and_names_a_solved_one(grid: Path) -> None:
    point = {"alpha": 100, "friction": "softening"}
    message = r"no solution on level 1 \(singular: the stiffness matrix is singular\); draw another .* alpha = 25"
    with pytest.raises(DrawError, match=message):
        read_picture(grid, point)
    assert read_picture(grid, point, 0).level == 0


def test_a_file_without_any_solution(tmp_path: Path) -> None:
    plan = study("grid", (ALPHA,))
    write(tmp_path / "r.nc", plan, [level_record(0, False)], [], Provenance("now", (), "abc"))
    with pytest.raises(DrawError, match=r"alpha = 25 .* \(not run: .*\); no other point .* tcstudy show"):
        read_picture(tmp_path / "r.nc")


@pytest.mark.parametrize("level", [2, -3])
def test_a_level_that_the_file_does_not_have(grid: Path, level: int) -> None:
    with pytest.raises(DrawError, match=rf"no level {level}; it has levels 0 to 1"):
        read_picture(grid, level=level)


# Other faults


def test_no_file(tmp_path: Path) -> None:
    with pytest.raises(StoreError, match="Run the study first"):
        draw(tmp_path / "none.nc", tmp_path / "p.png")


def test_an_unknown_format(grid: Path, tmp_path: Path) -> None:
    with pytest.raises(DrawError, match=r"ends in \.png, \.svg, \.pdf"):
        draw(grid, tmp_path / "p.jpeg")
    with pytest.raises(DrawError, match=r"ends in \.png, \.svg, \.pdf"):
        draw_laws(example_laws(), tmp_path / "laws")


def test_a_place_that_cannot_be_written(grid: Path, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("x")
    with pytest.raises(DrawError, match=r"cannot write .*; choose another place"):
        draw(grid, tmp_path / "file" / "p.png")


def test_without_matplotlib(grid: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    for call in (lambda: draw(grid, tmp_path / "p.png"), lambda: draw_laws(example_laws(), tmp_path / "p.png")):
        with pytest.raises(DrawError, match=r'pip install "tcstudy\[plot\]"') as caught:
            call()
        assert "\n" not in str(caught.value)
    assert not (tmp_path / "p.png").exists()


# Friction laws


def test_every_shape_is_drawn(tmp_path: Path) -> None:
    laws = example_laws()
    assert [law.name for law in laws] == list(SHAPES)
    draw_laws(laws, tmp_path / "laws.png")
    width, _ = png_size(tmp_path / "laws.png")
    assert width == style.WIDTH * style.DPI
    assert imread(tmp_path / "laws.png")[..., :3].std() > 0.05


def test_jumps_are_filled_and_told_apart() -> None:
    law = SHAPES["piecewise-linear"].build(points=[(0.0, 1.0), (2.0, 1.0), (2.0, 0.25)])
    with style.styled():
        (axes,) = law_figure([law]).axes
    vertical = {
        (float(line.get_xdata()[0]), line.get_color()): sorted(float(b) for b in line.get_ydata())
        for line in axes.lines
        if len(line.get_xdata()) == 2 and line.get_xdata()[0] == line.get_xdata()[1] and line.get_linewidth() > 2
    }
    up, down = UP_STYLE["color"], style.VERMILLION
    assert vertical == {(0.0, up): [-1.0, 1.0], (2.0, down): [0.25, 1.0], (-2.0, down): [-1.0, -0.25]}
    assert axes.get_title(loc="right") == r"$\omega$ = ∞"


def test_the_curve_of_a_law_is_the_law() -> None:
    law = SHAPES["exponential"].build(a=1.0, b=0.25, delta=0.5)
    with style.styled():
        (axes,) = law_figure([law]).axes
    for curve in axes.lines:
        s, b = np.asarray(curve.get_xdata(), dtype=float), np.asarray(curve.get_ydata(), dtype=float)
        if len(s) > 2:
            np.testing.assert_allclose(np.abs(b), 0.25 + 0.75 * np.exp(-np.abs(s) / 0.5), rtol=1e-12)
            assert np.all(b[1:-1] * s[1:-1] > 0.0)
    assert axes.get_title(loc="right") == r"$\omega$ = 1.5"


def test_no_law() -> None:
    with pytest.raises(DrawError, match="give at least one"):
        draw_laws([], Path("laws.png"))
