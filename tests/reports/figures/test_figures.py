"""Pictures of laws, sweeps, paths, histories and fits: the numbers drawn, what is said and refused,
any size."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr

import tcstudy

pytest.importorskip("matplotlib")

from tcstudy.data.reading import load_root
from tcstudy.errors import DrawError, UsageError
from tcstudy.laws.shapes import SHAPES
from tcstudy.pictures import draw_picture
from tcstudy.read.study import read_study_text
from tcstudy.reports.figures import style
from tcstudy.reports.figures.path import bond_states, history_panels, loop_names, solved_steps
from tcstudy.reports.figures.point import OperatingLaws, law_figure, laws_of
from tcstudy.reports.figures.sweep import curves_figure, map_figure, read_sweep
from tcstudy.reports.picture import law_of_nodes, read_picture
from tcstudy.reports.terminal.paths import folds_of
from tcstudy.reports.terminal.summary import text_of
from tcstudy.scene.contact_states import ContactState, node_states
from tests.reports.conftest import FILMS, Stored
from tests.reports.figures.shown import SIZES, crowded, drawn, key_of

FIXED = {"tau": 0.5, "E": 100}


def test_where_friction_differs_every_node_stands_on_the_law_of_its_edge(stored: Stored) -> None:
    point = read_picture(stored("films"))
    operating = laws_of(point)
    laws, index, strength = operating.laws, operating.index, operating.strength
    line, bonded = point.line, strength > 0
    assert [edge for edge, _ in laws] == ["film", "shoe", "film and shoe"]
    assert list(np.flatnonzero(index == 2)) == list(np.flatnonzero(np.isclose(line.x, 1.0)))
    assert strength == pytest.approx(np.where(line.x < 1, np.clip(2 * line.x - 0.5, 0, 1), 1.0))
    for k, (_, law) in enumerate(laws):
        here = bonded & (index == k)
        low, high = law.interval(line.u_T[here])
        xi = line.xi[here] / strength[here]
        assert np.all((low - 1e-6 <= xi) & (xi <= high + 1e-6))
    figure, _ = drawn(stored("films"), law=True)
    marked = [line for line in figure.axes[0].lines if line.get_linestyle() == "None"]
    assert (
        sum(len(np.asarray(line.get_xdata())) for line in marked)
        == np.count_nonzero(bonded)
        < len(bonded)
    )
    # states go out by the law of each node: softening only on the shoe, between nothing and 0.1 of
    # slip
    with xr.open_datatree(stored("films")) as tree:
        group = tree["level_0"].to_dataset().load()
    states = node_states(
        law_of_nodes(read_study_text(FILMS).scenes[0].friction, group), line.u_T, line.sticks
    )
    softens = (line.x >= 1) & (line.u_T > 0) & (line.u_T < 0.1) & ~line.sticks
    assert np.array_equal(states == ContactState.SOFTEN, softens)
    assert np.all(states[(line.x >= 1) & (line.u_T > 0.1)] == ContactState.WEAKENED)


def test_a_law_shows_its_jumps_and_every_node_at_its_slip_and_traction(stored: Stored) -> None:
    point = read_picture(stored("block"))
    m = len(point.line.u_T)
    brittle = SHAPES["piecewise-linear"].build(points=[(0.0, 2e7), (1e-5, 2e7), (1e-5, 5e6)])
    with style.styled():
        laws = OperatingLaws([("", brittle)], np.zeros(m, dtype=np.intp), np.ones(m))
        figure = law_figure(point, laws, style.Look())
    marked = [
        np.array(line.get_data(), dtype=float)
        for line in figure.axes[0].lines
        if line.get_linestyle() == "None"
    ]
    drawn = np.sort(np.concatenate(marked, axis=1))
    np.testing.assert_allclose(drawn, np.sort([1e6 * point.line.u_T, point.line.xi / 1e6]))
    assert key_of(figure)[-1] == f"slips ({np.count_nonzero(~point.line.sticks)} nodes)"
    assert "down-jump: sudden loss" in key_of(figure)
    assert crowded(figure) == []


def test_curves_show_the_stored_numbers_and_say_what_is_missing(stored: Stored) -> None:
    figure, words = drawn(stored("failed"), x="heat.theta_bar", y="u_T_max", by="friction")
    lines = [line for line in figure.axes[0].lines if not str(line.get_label()).startswith("_")]
    assert [line.get_label() for line in lines] == ["plain", "weak"]
    kept = load_root(stored("failed"))["u_T_max"].values[:, :, 1]
    for line, values in zip(lines, kept.T, strict=True):
        np.testing.assert_allclose(
            np.array(line.get_data(), dtype=float), [[0.0, 10.0, 20.0], 1e6 * values]
        )
    assert np.isnan(kept).tolist() == [[False, False], [False, False], [False, True]]
    assert figure.axes[0].get_xlabel() == r"$\bar{θ}$ [K]"
    assert (
        words == "u_T_max over theta_bar and friction, level 1, 1 of 6 points left out: 1 singular"
    )
    chosen = read_sweep(stored("block"), ("theta_bar",), "u_T_max", {"friction": "weak"}, 0)
    assert (chosen.words, len(chosen.values)) == (
        "u_T_max over theta_bar, friction = weak, level 0",
        3,
    )


def test_a_map_tells_solved_cells_from_others_and_where_omega_is_lambda_1(stored: Stored) -> None:
    shown = read_sweep(stored("failed"), ("theta_bar", "friction"), "u_T_max", None, -1)
    with style.styled():
        figure = map_figure(shown, style.Look())
        above = np.array([-1.0, -2.0, 1.0, 2.0, 1.0, 1.0])
        bounded = map_figure(replace(shown, excess=(above,)), style.Look())
        band = above, above + 0.5, above - 0.5
        of_body = map_figure(replace(shown, excess=band, proved=above > 9.0), style.Look())
    (mesh,) = figure.axes[0].collections
    missing = [[False] * 3, [False, False, True]]
    np.testing.assert_array_equal(np.ma.getmaskarray(mesh.get_array()), missing)
    hatches = [
        patch.get_hatch()
        for patch in figure.axes[0].patches
        if np.size(patch.get_path().vertices) > 2
    ]
    open_ = np.count_nonzero(~shown.proved & np.isfinite(shown.values))
    assert [sum(str(hatch) == one for hatch in hatches) for one in ("//", "xxx")] == [open_, 1]
    assert key_of(bounded)[-1] == "ω = $λ_1$"
    assert key_of(of_body)[-2:] == ["ω = $λ_1$ of the mesh", "proved bounds of $λ_1$"]
    assert "not proved unique on the mesh" in key_of(of_body)


def test_an_infinite_number_is_a_value_and_no_missing_solution(tmp_path: Path) -> None:
    """ω of a law that jumps down, beside one that does not; both are solved."""
    saw = "{law: saw-tooth, tau: 0.3, delta: 0.2, teeth: 2, drop: 0.5, decay: 0.7}"
    laws = f"{{saw: {saw}, weak: {{law: slip-weakening, tau_s: 1, tau_k: 0.5, delta: 0.1}}}}"
    sweep = f"sweep={{friction: {laws}, tau_x: [1, 2]}}".replace("tau_x", "boundary.grip.u_x")
    text = FILMS.replace("shoe: contact,", "shoe: free,")
    text = text[: text.index("friction:")] + text[text.index("mesh:") :]
    tcstudy.run(read_study_text(text, "a", [sweep]), tmp_path / "a.nc", jobs=1)
    sweep = read_sweep(tmp_path / "a.nc", ("u_x", "friction"), "omega", None, -1)
    assert sweep.infinite.tolist() == [name == 0 for name in sweep.parameters[1].place]
    assert sweep.words.endswith("ω = ∞ at 2 points")
    assert sweep.left_out == ""
    with style.styled():
        map_key = key_of(map_figure(sweep, style.Look()))
        curve = curves_figure(sweep, style.Look())
    assert "ω = ∞" in map_key
    assert "no solution" not in map_key
    assert [line.get_marker() for line in curve.axes[0].lines].count(r"$\infty$") == 1
    margin = read_sweep(tmp_path / "a.nc", ("u_x", "friction"), "uniqueness_margin", None, -1)
    assert margin.infinite_words.endswith("= −∞ at 2 points")
    assert "ω = ∞ at 2 points: the friction law jumps down" in text_of(tmp_path / "a.nc")


def test_points_of_a_list_and_random_ones_are_not_joined(stored: Stored) -> None:
    by = read_sweep(stored("listed"), ("alpha", "tau_s"), "slip_length", None, -1)
    one = read_sweep(
        stored("listed"), ("alpha",), "slip_length", None, -1
    )  # two points of the list share one α
    random = replace(by, parameters=tuple(replace(one, is_random=True) for one in by.parameters))
    for sweep, expected in ((by, "-"), (one, "None"), (random, "None")):
        with style.styled():
            assert curves_figure(sweep, style.Look()).axes[0].lines[0].get_linestyle() == expected
    with style.styled():
        dots = map_figure(random, style.Look()).axes[0].collections[0]
    assert np.asarray(dots.get_offsets()).tolist() == [[25.0, 90.0], [100.0, 90.0], [25.0, 95.0]]


def test_stable_unstable_and_lowest_parts_are_told_apart(stored: Stored) -> None:
    data = load_root(stored("path"), "path")
    figure, _ = drawn(stored("path"))
    curve = next(axes for axes in figure.axes if axes.get_ylabel().startswith("mean"))
    (solid,) = [line for line in curve.lines if line.get_color() == style.INK]
    red = [line for line in curve.lines if line.get_color() == style.VERMILLION]
    (dashed,), (folds,) = (
        [one for one in red if (one.get_marker() == "o") is marks] for marks in (False, True)
    )
    pieces = [
        int(np.isfinite(np.diff(np.asarray(one.get_xdata(), dtype=float))).sum())
        for one in (solid, dashed)
    ]
    assert pieces == [int(data["stable"].sum()), data.sizes["piece"] - int(data["stable"].sum())]
    vertices = folds_of(data)
    assert len(vertices) == 8
    assert folds.get_xdata() == pytest.approx(1e3 * data["parameter"].values[vertices], rel=1e-12)
    assert key_of(figure)[:3] == ["stable", "unstable", "global minimum (proved)"]


def test_the_loop_is_the_slip_of_the_end_over_the_load(stored: Stored) -> None:
    figure, _ = drawn(stored("history"), at=FIXED)
    loop, motion, spent, left = figure.axes
    data = load_root(stored("history"), "history").sel(**FIXED)
    end = data["u_T"].values[:, np.abs(data["u_T"].values).max(axis=0).argmax()]
    whole = next(line for line in loop.lines if len(np.asarray(line.get_xdata())) == 17)
    assert np.array_equal(np.asarray(whole.get_xdata()), data["theta"].values)
    assert np.asarray(whole.get_ydata()) / np.asarray(whole.get_ydata())[2] == pytest.approx(
        end / end[2]
    )
    what = np.asarray(motion.collections[0].get_array()).reshape(data.sizes["node"], 16)
    assert np.all(what[-1] == [1, 1, 2, 2, 2, 2, 1, 1] * 2)  # the end always slides, with the load
    assert np.all(what[0] == 0)  # what is next to the middle never does
    sums = [data["dissipated"].values[1:9].sum(), data["dissipated"].values[9:].sum()]
    assert np.asarray(spent.lines[0].get_ydata()) == pytest.approx(sums)
    slips = data["u_T"].values[[0, 8, 16]]
    assert np.asarray(left.lines[0].get_ydata()) == pytest.approx(
        np.abs(np.diff(slips, axis=0)).max(axis=1)
    )


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize(
    ("name", "wanted"),
    [
        ("block", {}),
        ("path", {"y": "friction"}),
        ("history", {"at": FIXED, "y": "dissipated"}),
        ("fit", {}),
    ],
)
def test_no_text_leaves_the_page(
    stored: Stored, name: str, wanted: dict[str, str], size: tuple[float, float]
) -> None:
    figure, _ = drawn(stored(name), size=size, **wanted)
    assert crowded(figure, alone=True) == []


def test_sizes() -> None:
    assert (
        style.size_in_inches("80 x 100 mm")
        == pytest.approx(style.size_in_inches("8x10cm"))
        == (8 / 2.54, 10 / 2.54)
    )
    for text in ("8x5", "x5cm", "0x5cm", "9000x5cm", "-8x5cm"):
        with pytest.raises(UsageError, match="size: "):
            style.size_in_inches(text)
    assert [style.Look((width, 4.0)).letters for width in (2.0, 6.0, 20.0)] == [
        7.0,
        7.125,
        style.USUAL,
    ]


@pytest.mark.parametrize(
    ("name", "wanted", "message"),
    [
        (
            "block",
            {"x": "theta_bar", "y": "slip_lenght"},
            "no variable 'slip_lenght' .* did you mean 'slip_length'",
        ),
        ("block", {"x": "theta_bar", "y": "u_T"}, "'u_T' has a value at every node of a level"),
        ("block", {"x": "theta_bar", "y": "unique"}, "'unique' is a flag, not a quantity"),
        ("block", {"x": "theta_bar", "y": "h_max"}, "'h_max' has the dimensions level, and"),
        ("block", {"map": ("theta_bar", "theta_bar"), "of": "energy"}, "theta_bar is named twice"),
        (
            "block",
            {"x": "theta_bar", "y": "energy", "at": {"theta_bar": 10}},
            "theta_bar is drawn with all its values",
        ),
        ("block", {"x": "theta_bar"}, "x: give y, too"),
        (
            "block",
            {"law": True, "map": ("theta_bar", "friction"), "of": "u_T_max"},
            "law: the picture of a run file by map does not depend on it",
        ),
        ("block", {"size": (3.0, 1.0)}, "size: .* cm is the smallest height"),
        ("block", {"of": "sigma"}, "has no field 'sigma'"),
        ("block", {"along": "1, 1"}, "is no line"),
        ("block", {"along": "0, a: 1, 1"}, "is no line"),
        ("block", {"along": "1, 1: 2, 2"}, "no point of this line"),
        ("path", {"y": "slip"}, "use one of mean-slip"),
        ("history", {"y": "u_X"}, "history: there is no 'u_X'; choose of"),
        ("history", {"y": "u_T"}, "history: 'u_T' is not one number a step; choose of"),
        ("history", {"at": {"alpha": 1}}, "no swept parameter 'alpha'"),
    ],
)
def test_bad_names_are_refused_before_anything_is_written(
    stored: Stored, tmp_path: Path, name: str, wanted: dict[str, Any], message: str
) -> None:
    with pytest.raises((DrawError, UsageError), match=message) as caught:
        draw_picture(stored(name), tmp_path / "a.png", **wanted)
    assert "\n" not in str(caught.value)
    assert not (tmp_path / "a.png").exists()


def test_the_same_file_every_time_with_text_as_text_and_matplotlib_left_alone(
    stored: Stored, tmp_path: Path
) -> None:
    """Journals refuse fonts of Type 3; letters as outlines can be neither edited nor found."""
    import matplotlib

    with matplotlib.rc_context({"font.size": 7.0, "axes.spines.top": True}):
        before = dict(matplotlib.rcParams)
        for name in ("a.svg", "b.svg", "p.pdf", "a.png"):
            said = draw_picture(stored("single"), tmp_path / name, size=(6.0, 5.0))
        assert dict(matplotlib.rcParams) == before
    assert said.startswith(f"{tmp_path / 'a.png'}: A block <on> a film")
    assert (tmp_path / "a.svg").read_bytes() == (tmp_path / "b.svg").read_bytes()
    assert "Contact line: " in (tmp_path / "a.svg").read_text(encoding="utf-8")
    written = (tmp_path / "p.pdf").read_bytes()
    assert b"/Subtype /Type3" not in written
    assert b"/FontFile2" in written
    assert (tmp_path / "a.png").read_bytes()[16:24] == (1800).to_bytes(4) + (1500).to_bytes(4)


def test_an_index_stands_below_its_letter_and_nothing_else_is_a_formula() -> None:
    assert (
        style.math("mean |u_T|, τ_xy and −S_T for $5")
        == r"mean |$u_{T}$|, $τ_{xy}$ and −$S_{T}$ for \$5"
    )
    assert [style.math(text) for text in ("N^-0.35", "pull_fit.csv", "λ_1")] == [
        "$N^{-0.35}$",
        "pull_fit.csv",
        "$λ_{1}$",
    ]
    assert [style.symbol(name) for name in ("boundary.grip.u_x", "heat.theta_bar")] == [
        "u_x of grip",
        "θ̄",
    ]


@pytest.mark.parametrize("names", ["u_x,height", ("boundary.top.u_x", "height"), "top_u_x, height"])
def test_a_map_finds_its_parameters_by_text_path_and_end(stored: Stored, names: Any) -> None:
    figure, _ = drawn(stored("pads"), map=names, of="u_T_max")
    assert figure.axes[0].get_xlabel() == "$u_{x}$ of top [mm]"


def test_a_path_of_openings_shows_its_force_and_the_states_of_the_bond(stored: Stored) -> None:
    figure, _ = drawn(stored("lifted"))
    curve, bond = figure.axes
    assert curve.get_ylabel() == "∫$S_{N}$ ds"
    words = {"closed", "bond is elastic", "bond softens", "open"}
    assert set(key_of(figure, 1)) <= words
    with xr.open_dataset(stored("lifted")) as data:
        states = bond_states(data, np.arange(data.sizes["piece"]))
        middle = 0.5 * (data["opening"].values[1:] + data["opening"].values[:-1])
    expected = np.digitize(middle, [0.0, 0.1, 0.3], right=True)
    np.testing.assert_array_equal(states, expected)
    assert bond.get_title(loc="left") == "Opening: lowest energy on the path"


def test_a_history_of_openings_shows_what_opens_and_closes(stored: Stored) -> None:
    data = solved_steps(load_root(stored("raised")))
    panels = history_panels(data, *loop_names(data))
    assert list(panels) == ["loop", "motion", "front"]
    assert loop_names(data) == ("u_y", "adhesion_resultant")
    (cells,) = (item for item in panels["motion"].items if item.kind == "cells")
    assert cells.look["names"] == ["rests", "opens", "closes", "jumps"]
    change = np.diff(data["opening"].values[:, 0])
    expected = np.where(data["jumped_N"].values[1:, 0] == 1, 3, np.where(change > 0.0, 1, 2))
    np.testing.assert_array_equal(cells.look["kinds"][:, 0], expected)


def test_friction_of_the_pressure_is_drawn_over_the_pressure_of_its_node(stored: Stored) -> None:
    point = read_picture(stored("pressed"), {"mu": 0.1})
    figure, _ = drawn(stored("pressed"), law=True, at={"mu": 0.1})
    assert figure.axes[0].get_ylabel() == "friction ξ / pressure"
    shares = point.line.xi / laws_of(point).strength
    assert np.abs(shares).max() == pytest.approx(0.1, rel=1e-6)
    slips = np.concatenate(
        [line.get_ydata() for line in figure.axes[0].lines if line.get_marker() == "o"]
    )
    np.testing.assert_allclose(np.abs(slips), 0.1, rtol=1e-6)


def test_the_law_of_a_bond_that_opens_has_its_nodes_on_it(stored: Stored) -> None:
    figure, _ = drawn(stored("arm"), law=True)
    [axes] = figure.axes
    marks = {
        line.get_label().partition(" (")[0]: line
        for line in axes.lines
        if line.get_marker() in "so"
    }
    s_N, S_N = (np.asarray(values) for values in marks["softening"].get_data())
    np.testing.assert_allclose(S_N, 20.0 * (14.0 - s_N) / 10.0, rtol=1e-6)
    assert np.all(np.asarray(marks["closed"].get_ydata()) <= 1e-6)
    assert np.allclose(marks["open"].get_ydata(), 0.0, atol=1e-6)
