"""Pictures of laws, sweeps, paths, histories and fits: the numbers drawn, what is said and refused, any size."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

pytest.importorskip("matplotlib")

from tcstudy.data.store import load_root
from tcstudy.errors import DrawError, UsageError
from tcstudy.laws.shapes import SHAPES
from tcstudy.read.study import read_study, read_study_text
from tcstudy.reports.figures import style
from tcstudy.reports.figures.draw import Wanted, picture
from tcstudy.reports.figures.fit import fit_figure
from tcstudy.reports.figures.history import history_figure
from tcstudy.reports.figures.law import law_figure, laws_of
from tcstudy.reports.figures.path import path_figure
from tcstudy.reports.figures.sweep import SweepPicture, curves_figure, map_figure, read_sweep
from tcstudy.reports.picture import read_picture
from tcstudy.reports.stored_study import law_of_nodes
from tcstudy.reports.terminal.path_summary import seen_folds
from tcstudy.scene.histories import ContactState, node_states
from tcstudy.study.history_run import execute_history
from tcstudy.study.path_run import execute_path
from tcstudy.study.run import execute
from tests.reports.figures.draw_cases import LOOKS, RAIL, crowded, off_the_page, png_size

SMALL_LOOK = style.Look(style.size_in_inches("8x7cm"))


def labels(figure: object, k: int = 0) -> list[str]:
    return [text.get_text() for text in figure.legends[k].get_texts()]  # type: ignore[attr-defined]


# -- laws --------------------------------------------------------------------------------------------------------------

BRITTLE = SHAPES["piecewise-linear"].build(points=[(0.0, 2e7), (1e-5, 2e7), (1e-5, 5e6)])
FILMS = """
units: none
title: Two films, one of them rougher to the right, with a gap
body: {outline: [{from: [0, 0], edge: film}, {from: [1, 0], edge: shoe}, {from: [2, 0], edge: grip},
                 {from: [2, 0.2], edge: top}, {from: [0, 0.2], edge: tail}]}
boundary: {film: contact, shoe: contact, grip: {role: clamped, u_x: 0.4, u_y: free}, top: free, tail: free}
material: {E: 10, nu: 0, plane: stress}
friction: {film: {law: tresca, tau: 2, strength: "min(1, max(0, 2*x - 0.5))"},
           shoe: {law: slip-weakening, tau_s: 1, tau_k: 0.5, delta: 0.1}}
mesh: {maxh: 0.1}
"""


def test_where_friction_differs_every_node_stands_on_the_law_of_its_edge(tmp_path: Path) -> None:
    execute(read_study_text(FILMS), tmp_path / "films.nc")
    point = read_picture(tmp_path / "films.nc")
    laws, index, strength = laws_of(point)
    line, bonded = point.line, strength > 0
    assert [edge for edge, _ in laws] == ["film", "shoe", "film and shoe"]
    assert list(np.flatnonzero(index == 2)) == list(np.flatnonzero(np.isclose(line.x, 1.0)))
    assert strength == pytest.approx(np.where(line.x < 1, np.clip(2 * line.x - 0.5, 0, 1), 1.0))
    for k, (_, law) in enumerate(laws):
        here = bonded & (index == k)
        low, high = law.interval(line.u_T[here])
        xi = line.xi[here] / strength[here]
        assert np.all((low - 1e-6 <= xi) & (xi <= high + 1e-6))
    with style.styled():
        figure = law_figure(point, (laws, index, strength), style.Look())
    marked = [line for line in figure.axes[0].lines if line.get_linestyle() == "None"]
    assert sum(len(np.asarray(line.get_xdata())) for line in marked) == np.count_nonzero(bonded) < len(bonded)
    assert labels(figure)[:2] == ["film: tresca", "shoe: slip-weakening"]
    assert "strength" in figure.axes[0].get_ylabel()
    # states go out by the law of each node: softening only on the shoe, between nothing and 0.1 of slip
    with xr.open_datatree(tmp_path / "films.nc") as tree:
        group = tree["level_0"].to_dataset().load()
    states = node_states(law_of_nodes(read_study_text(FILMS).scenes[0].friction, group), line.u_T, line.sticks)
    softens = (line.x >= 1) & (line.u_T > 0) & (line.u_T < 0.1) & ~line.sticks
    assert softens.any()
    assert np.array_equal(states == ContactState.SOFTEN, softens)
    assert np.all(states[(line.x >= 1) & (line.u_T > 0.1)] == ContactState.WEAKENED)


def test_every_node_stands_at_its_slip_and_traction(grid: Path) -> None:
    point = read_picture(grid)
    m = len(point.line.u_T)
    of = [("", BRITTLE)], np.zeros(m, dtype=np.intp), np.ones(m)
    with style.styled():
        figure = law_figure(point, of, style.Look())
    marked = [line for line in figure.axes[0].lines if line.get_linestyle() == "None"]
    s, xi = (np.concatenate([np.asarray(get(line), dtype=float) for line in marked])
             for get in (lambda line: line.get_xdata(), lambda line: line.get_ydata()))  # fmt: skip
    np.testing.assert_allclose(np.sort(s), np.sort(point.line.u_T) * 1e6)
    np.testing.assert_allclose(np.sort(xi), np.sort(point.line.xi) / 1e6)
    assert labels(figure)[-2:] == ["sticks (4 nodes)", "slips (4 nodes)"]
    assert "down-jump: sudden loss" in labels(figure)
    assert figure.axes[0].get_xlabel() == "slip $u_T$ [µm]"
    for look in (style.Look(), SMALL_LOOK):
        with style.styled(look):
            assert crowded(law_figure(point, of, look)) == []
    with pytest.raises(DrawError, match="cannot be read any more"):
        laws_of(point)


# -- sweeps ------------------------------------------------------------------------------------------------------------


def swept(grid: Path, *along: str, level: int = -1) -> SweepPicture:
    return read_sweep(grid, along, "slip_length", None, level)


def test_curves_show_the_stored_numbers_and_say_what_is_missing(grid: Path) -> None:
    shown = swept(grid, "heat.alpha", "friction")
    with style.styled():
        figure = curves_figure(shown, style.Look())
    lines = [line for line in figure.axes[0].lines if not str(line.get_label()).startswith("_")]
    assert [line.get_label() for line in lines] == ["tresca", "softening"]
    np.testing.assert_allclose(np.array(lines[0].get_data(), dtype=float), [[25.0, 100.0], [87.5, 87.5]])  # [mm]
    assert np.isnan(np.asarray(lines[1].get_ydata(), dtype=float)).tolist() == [False, True]
    assert figure.axes[0].get_xlabel() == r"$\alpha$ [W m⁻² K⁻¹]"
    assert figure.axes[0].get_ylabel().endswith("[mm]")
    said = [text.get_text() for text in figure.texts]
    assert (said[0], said[-1]) == ("Plate for $5 and $6", "1 of 4 points left out: 1 singular (×)")
    assert shown.words == "level 1, 1 of 4 points left out: 1 singular"
    assert swept(grid, "alpha").words == "friction = tresca (its first value), level 1"
    chosen = read_sweep(grid, ("alpha",), "slip_length", {"friction": "softening"}, 0)
    assert (chosen.words, len(chosen.values)) == ("friction = softening, level 0", 2)


def test_a_map_tells_solved_cells_from_others_and_where_omega_is_lambda_1(grid: Path) -> None:
    shown = swept(grid, "alpha", "friction")
    with style.styled():
        figure = map_figure(shown, style.Look())
        full = replace(shown, values=np.arange(4.0), excess=np.array([-1.0, -2.0, 1.0, 2.0]))
        bounded = map_figure(full, style.Look())
    (mesh,) = figure.axes[0].collections
    np.testing.assert_allclose(np.ma.getmaskarray(mesh.get_array()), [[False, False], [False, True]])
    hatches = [patch.get_hatch() for patch in figure.axes[0].patches if np.size(patch.get_path().vertices) > 2]
    assert [sum(str(hatch) == one for hatch in hatches) for one in ("//", "xxx")] == [3, 1]
    assert labels(figure) == ["no solution", "not proved unique"]
    assert figure.axes[1].get_ylabel().endswith("[mm]")
    assert labels(bounded) == ["not proved unique", r"$\omega = \lambda_1$"]


def test_points_of_a_list_and_random_ones_are_not_joined(grid: Path, listed: Path) -> None:
    by, shown = swept(listed, "alpha", "tau"), swept(grid, "alpha")
    assert [len(one.labels) for one in by.parameters] == [2, 2]
    assert by.parameters[1].title == r"$\tau$ [MPa]"
    random = replace(shown, parameters=tuple(replace(one, random=True) for one in shown.parameters))
    for one, expected in ((by, "-"), (swept(listed, "alpha"), "None"), (shown, "-"), (random, "None")):
        with style.styled():  # two points of the list share one α
            assert curves_figure(one, style.Look()).axes[0].lines[0].get_linestyle() == expected
    dots = replace(by, parameters=tuple(replace(one, random=True) for one in by.parameters))
    with style.styled():
        drawn = map_figure(dots, style.Look()).axes[0].collections[0]
    assert np.asarray(drawn.get_offsets()).tolist() == [[25.0, 1.0], [100.0, 1.0], [25.0, 20.0]]


def test_sizes(grid: Path, tmp_path: Path) -> None:
    said = picture(grid, tmp_path / "a.png", Wanted(x="alpha", y="slip_length", size=(6.0, 4.0)))
    assert said == f"{tmp_path / 'a.png'}: slip_length over alpha, friction = tresca (its first value), level 1"
    assert png_size(tmp_path / "a.png") == (1800, 1200)
    assert style.size_in_inches("80 x 100 mm") == pytest.approx(style.size_in_inches("8x10cm")) == (8 / 2.54, 10 / 2.54)
    for text in ("8x5", "x5cm", "0x5cm", "9000x5cm", "-8x5cm"):
        with pytest.raises(UsageError, match="size: "):
            style.size_in_inches(text)
    assert [style.Look((width, 4.0)).letters for width in (2.0, 6.0, 20.0)] == [7.0, 7.125, style.USUAL]


@pytest.mark.parametrize(
    ("wanted", "message"),
    [
        (Wanted(x="alpha", y="slip_lenght"), "no number 'slip_lenght' .* did you mean 'slip_length'"),
        (Wanted(map=("alpha", "alpha"), of="energy"), "alpha is named twice"),
        (Wanted(x="alpha", y="energy", at={"alpha": 25}), "alpha is drawn with all its values"),
        (Wanted(x="alpha"), "x: give y, too"),
        (Wanted(law=True, map=("alpha", "friction"), of="u_T_max"), "map: law is another picture"),
        (Wanted(size=(3.0, 1.0)), "size: .* cm is the least height"),
    ],
)
def test_bad_names_are_refused_before_anything_is_written(
    grid: Path, tmp_path: Path, wanted: Wanted, message: str
) -> None:
    with pytest.raises((DrawError, UsageError), match=message) as caught:
        picture(grid, tmp_path / "a.png", wanted)
    assert "\n" not in str(caught.value)
    assert not (tmp_path / "a.png").exists()


# -- paths -------------------------------------------------------------------------------------------------------------

PAD = Path(__file__).parents[3] / "configs" / "path.yaml"
PLAIN = """
units: none
title: One law without folds
body: {rectangle: {width: 2, height: 1}}
boundary: {bottom: contact, left: clamped, top: {role: traction, g: [0.02, 0]}, right: free}
material: {E: 1, nu: 0.3}
friction: {law: tresca, tau: 0.01}
mesh: {maxh: 0.3}
path: {parameter: load, from: 0, to: 2, hysteresis: false}
"""


@pytest.fixture(scope="module")
def pad(tmp_path_factory: pytest.TempPathFactory) -> Path:
    file = tmp_path_factory.mktemp("pad") / "pad.nc"
    execute_path(read_study(PAD, ["mesh.levels=1"]), file)
    return file


def test_stable_unstable_and_lowest_parts_are_told_apart(pad: Path) -> None:
    data = load_root(pad, "path")
    with style.styled():
        figure = path_figure(data, "mean-slip", style.Look())
    curve = next(axes for axes in figure.axes if axes.get_ylabel().startswith("mean"))
    solid = [line for line in curve.lines if line.get_color() == style.INK]
    dashed = [line for line in curve.lines if line.get_color() == style.VERMILLION and line.get_linestyle() != "None"]
    assert len(solid) == len(dashed) == 1
    pieces = [
        int(np.isfinite(np.add(x[1:], x[:-1])).sum())
        for x in (np.asarray(one[0].get_xdata(), dtype=float) for one in (solid, dashed))
    ]
    assert pieces == [int(data["stable"].sum()), data.sizes["piece"] - int(data["stable"].sum())]
    vertices, small = seen_folds(data)
    assert (len(vertices), small) == (8, data.sizes["fold"] - 8)
    (folds,) = [line for line in curve.lines if line.get_marker() == "o"]
    assert folds.get_xdata() == pytest.approx(1e3 * data["parameter"].values[vertices], rel=1e-12)
    assert labels(figure)[:3] == ["stable", "unstable", "global minimum (proved)"]
    assert labels(figure, 1) == ["sticks", "slips and softens", "slips, weakened"]
    assert curve.get_xlim() == pytest.approx((0.0, 2.0))
    assert "$u_x$ of plate [mm]" in [axes.get_xlabel() for axes in figure.axes]
    assert len(figure.axes) == 3  # one y-axis a panel
    for look in LOOKS:
        with style.styled(look):
            assert off_the_page(path_figure(data, "friction", look)) == []
    with pytest.raises(DrawError, match="use one of mean-slip"):
        picture(pad, pad.with_suffix(".png"), Wanted(y="slip"))


def test_a_path_without_folds_loop_and_requests(tmp_path: Path) -> None:
    execute_path(read_study_text(PLAIN), tmp_path / "plain.nc")
    picture(tmp_path / "plain.nc", tmp_path / "plain.png")
    assert (tmp_path / "plain.png").stat().st_size > 5_000


# -- histories and fits ------------------------------------------------------------------------------------------------


def test_the_loop_is_the_slip_of_the_end_over_the_load(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file = tmp_path / "rail.nc"
    execute_history(read_study_text(RAIL), file)
    shown = []
    with monkeypatch.context() as patch:
        patch.setattr(style, "save", lambda figure, *_: shown.append(figure))
        assert "slip over theta, 16 steps" in picture(file, file.with_suffix(".png"))
    loop, motion, spent, left = shown[0].axes
    data = load_root(file, "history")
    end = data["u_T"].values[:, np.abs(data["u_T"].values).max(axis=0).argmax()]
    whole = next(line for line in loop.lines if len(np.asarray(line.get_xdata())) == 17)
    assert np.array_equal(np.asarray(whole.get_xdata()), data["theta"].values)
    assert np.asarray(whole.get_ydata()) / np.asarray(whole.get_ydata())[2] == pytest.approx(end / end[2])
    assert {text.get_text() for text in loop.texts} - {""} == {"warm", "cold", "start", "back"}
    what = np.asarray(motion.collections[0].get_array()).reshape(data.sizes["node"], 16)
    assert np.all(what[-1] == [1, 1, 2, 2, 2, 2, 1, 1] * 2)  # the end always slides, with the load
    assert np.all(what[0] == 0)  # what is next to the middle never does
    sums = [data["dissipated"].values[1:9].sum(), data["dissipated"].values[9:].sum()]
    assert np.asarray(spent.lines[0].get_ydata()) == pytest.approx(sums)
    slips = data["u_T"].values[[0, 8, 16]]
    assert np.asarray(left.lines[0].get_ydata()) == pytest.approx(np.abs(np.diff(slips, axis=0)).max(axis=1))
    for look in LOOKS:
        with style.styled(look):
            assert off_the_page(history_figure(data, "theta", "dissipated", "", look)) == []
    for wanted, message in (
        (Wanted(y="u_X"), "has no number"),
        (Wanted(at={"alpha": 1}), "no swept parameter 'alpha'"),
    ):
        with pytest.raises(DrawError, match=message):
            picture(file, tmp_path / "a.png", wanted)


@pytest.mark.parametrize("look", LOOKS)
def test_a_fit_stays_on_its_page_and_the_law_stands_below_where_it_is_narrow(fitted: Path, look: style.Look) -> None:
    with style.styled(look):
        figure = fit_figure(load_root(fitted, "fit"), look)
        assert off_the_page(figure) == []
    narrow = look.size is not None and look.size[0] < 4.0
    _, residuals, law = (axes.get_position() for axes in figure.axes)
    assert (law.y1 <= residuals.y0 or residuals.y1 <= law.y0) == narrow
