"""Curves and maps of a whole sweep: the numbers drawn, what is left out, what is refused."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("matplotlib")

from tcstudy.errors import DrawError, UsageError
from tcstudy.reports.figures import style
from tcstudy.reports.figures.draw import Wanted, picture
from tcstudy.reports.figures.sweep_figure import axis_title, curves_figure, map_figure
from tcstudy.reports.sentences import different_energies
from tcstudy.reports.sweep import SweepPicture, read_sweep
from tests.reports.figures.draw_cases import crowded, png_size

SMALL = style.Look(style.size_in_inches("8x6cm"))


def swept(grid: Path, *along: str, level: int = -1) -> SweepPicture:
    return read_sweep(grid, along, "slip_length", None, level)


def test_curves_show_the_stored_numbers_and_say_what_is_missing(grid: Path) -> None:
    shown = swept(grid, "heat.alpha", "friction")
    with style.styled():
        figure = curves_figure(shown, style.Look())
    curves = [line for line in figure.axes[0].lines if not str(line.get_label()).startswith("_")]
    assert [line.get_label() for line in curves] == ["tresca", "softening"]
    np.testing.assert_allclose(np.array(curves[0].get_data(), dtype=float), [[25.0, 100.0], [87.5, 87.5]])  # [mm]
    assert np.isnan(np.asarray(curves[1].get_ydata(), dtype=float)).tolist() == [False, True]
    assert figure.axes[0].get_xlabel() == r"$\alpha$ [W m⁻² K⁻¹]"
    assert figure.axes[0].get_ylabel().endswith("[mm]")
    said = [text.get_text() for text in figure.texts]
    assert said[0] == "Plate for $5 and $6"
    assert said[-1] == "1 of 4 points left out: 1 singular (×)"
    assert shown.words == "level 1, 1 of 4 points left out: 1 singular"


def test_what_is_not_drawn_has_its_first_value_and_it_is_said(grid: Path) -> None:
    shown = swept(grid, "alpha")
    assert shown.words == "friction = tresca (its first value), level 1"
    chosen = read_sweep(grid, ("alpha",), "slip_length", {"friction": "softening"}, 0)
    assert chosen.words == "friction = softening, level 0"
    assert len(chosen.values) == 2


def test_a_map_tells_solved_cells_from_others(grid: Path) -> None:
    with style.styled():
        figure = map_figure(swept(grid, "alpha", "friction"), style.Look())
    (mesh,) = figure.axes[0].collections
    np.testing.assert_allclose(np.ma.getmaskarray(mesh.get_array()), [[False, False], [False, True]])
    hatches = [patch.get_hatch() for patch in figure.axes[0].patches]
    assert sorted(str(hatch) for hatch in hatches) == ["//", "//", "//", "xxx"]
    assert [text.get_text() for text in figure.legends[0].get_texts()] == ["not proved unique", "no solution"]
    assert figure.axes[1].get_ylabel().endswith("[mm]")


def test_points_of_a_list_are_joined_only_where_they_follow_one_another(listed: Path) -> None:
    by = swept(listed, "alpha", "tau")
    assert [len(one.labels) for one in by.parameters] == [2, 2]
    assert axis_title(by.parameters[1]) == r"$\tau$ [MPa]"
    with style.styled():
        alone = curves_figure(swept(listed, "alpha"), style.Look()).axes[0].lines[0]
        assert curves_figure(by, style.Look()).axes[0].lines[0].get_linestyle() == "-"
    assert alone.get_linestyle() == "None"  # two points share one α


def test_drawn_points_are_not_joined(grid: Path) -> None:
    picture = swept(grid, "alpha")
    drawn = replace(picture, parameters=tuple(replace(one, drawn=True) for one in picture.parameters))
    for one, style_of_line in ((picture, "-"), (drawn, "None")):
        with style.styled():
            assert curves_figure(one, style.Look()).axes[0].lines[0].get_linestyle() == style_of_line


@pytest.mark.parametrize("look", [style.Look(), SMALL])
def test_no_text_overlaps_another(grid: Path, look: style.Look) -> None:
    with style.styled(look):
        for figure in (curves_figure(swept(grid, "alpha", "friction"), look),
                       map_figure(swept(grid, "friction", "alpha"), look)):  # fmt: skip
            assert crowded(figure) == []


def test_size_and_letters(grid: Path, tmp_path: Path) -> None:
    said = picture(grid, tmp_path / "a.png", Wanted(x="alpha", y="slip_length", size=(6.0, 4.0)))
    assert said == f"{tmp_path / 'a.png'}: slip_length over alpha, friction = tresca (its first value), level 1"
    assert png_size(tmp_path / "a.png") == (1800, 1200)
    assert style.size_in_inches("80 x 100 mm") == pytest.approx(style.size_in_inches("8x10cm")) == (8 / 2.54, 10 / 2.54)
    for text in ("8x5", "x5cm", "0x5cm", "9000x5cm", "-8x5cm"):
        with pytest.raises(UsageError, match="size: "):
            style.size_in_inches(text)
    sizes = (2.0, 6.0, 20.0)
    assert [style.Look((width, 4.0)).letters for width in sizes] == [7.0, 7.125, style.USUAL]  # the least in print


@pytest.mark.parametrize(
    ("wanted", "message"),
    [
        (Wanted(x="alhpa", y="slip_length"), "no swept parameter 'alhpa'; did you mean 'alpha'"),
        (Wanted(x="alpha", y="slip_lenght"), "no number 'slip_lenght' .* did you mean 'slip_length'"),
        (Wanted(x="alpha", y="status"), "no number 'status'"),
        (Wanted(map=("alpha", "alpha"), of="energy"), "alpha is named twice"),
        (Wanted(x="alpha", y="energy", at={"alpha": 25}), "alpha is drawn with all its values"),
        (Wanted(x="alpha", y="energy", level=7), "no level 7"),
        (Wanted(x="alpha"), "x: give y, too"),
        (Wanted(of="energy"), "of: give map, too"),
        (Wanted(by="alpha"), "by: give x, too"),
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


def test_energies_that_differ_by_rounding_are_one() -> None:
    energy = np.array([[-1.0, -1.0 - 1e-12, np.nan], [-1.0, -0.9, -1.0]])
    assert different_energies(energy).tolist() == [1, 2]
