"""The picture and the table of a path, from stored data alone."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tcstudy.errors import DrawError
from tcstudy.read.study import read_study, read_study_text
from tcstudy.reports.figures import style
from tcstudy.reports.figures.draw import Wanted, picture
from tcstudy.reports.figures.path_figure import path_figure, symbol
from tcstudy.reports.figures.path_states import read_path_picture
from tcstudy.reports.terminal.path_summary import path_summary, seen_folds
from tcstudy.study.path_run import execute_path
from tests.reports.figures.draw_cases import LOOKS, off_the_page

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


@pytest.fixture(scope="module")
def plain(tmp_path_factory: pytest.TempPathFactory) -> Path:
    file = tmp_path_factory.mktemp("plain") / "plain.nc"
    execute_path(read_study_text(PLAIN), file)
    return file


def test_stable_unstable_and_lowest_parts_are_told_apart(pad: Path) -> None:
    with style.styled():
        picture = read_path_picture(pad)
        figure = path_figure(picture)
    curve = next(axes for axes in figure.axes if axes.get_ylabel().startswith("mean"))
    solid = [line for line in curve.lines if line.get_color() == style.INK]
    dashed = [line for line in curve.lines if line.get_color() == style.VERMILLION and line.get_linestyle() != "None"]
    assert len(solid) == len(dashed) == 1
    drawn = sum(np.isfinite(line.get_xdata()[1:] + line.get_xdata()[:-1]).sum() for line in (*solid, *dashed))  # type: ignore[operator,index]
    assert drawn == picture.data.sizes["piece"]
    stable = np.isfinite(solid[0].get_xdata()[1:] + solid[0].get_xdata()[:-1]).sum()  # type: ignore[operator,index]
    assert stable == int(picture.data["stable"].sum())
    folds = [line for line in curve.lines if line.get_marker() == "o"]
    vertices, small = seen_folds(picture.data)
    assert (len(vertices), small) == (8, picture.data.sizes["fold"] - 8)
    turns = f"{small} turn{'s' * (small > 1)}"
    assert f"8 folds and {turns} below 0.5 % of the range" in path_summary(pad)
    assert folds[0].get_xdata() == pytest.approx(1e3 * picture.t[vertices], rel=1e-12)
    texts = [text.get_text() for text in figure.legends[0].get_texts()]
    assert texts[:3] == ["stable", "unstable", "global minimum (proved)"]
    assert curve.get_xlim() == pytest.approx((0.0, 2.0))
    assert "$u_x$ of plate [mm]" in [axes.get_xlabel() for axes in figure.axes]


@pytest.mark.parametrize(("response", "name"), [("mean-slip", "a.svg"), ("max-slip", "a.png"), ("friction", "a.pdf")])
def test_files(pad: Path, tmp_path: Path, response: str, name: str) -> None:
    target = tmp_path / name
    assert str(target) in picture(pad, target, Wanted(y=response))
    first = target.read_bytes()
    assert 5_000 < len(first) < 400_000
    if name == "a.svg":
        picture(pad, target, Wanted(y=response))
        assert target.read_bytes() == first


def test_a_path_without_folds_loop_and_requests(plain: Path, tmp_path: Path) -> None:
    picture(plain, tmp_path / "plain.png")
    assert (tmp_path / "plain.png").stat().st_size > 5_000


def test_bad_wishes_are_named(pad: Path, tmp_path: Path) -> None:
    with pytest.raises(DrawError, match="use one of mean-slip"):
        picture(pad, tmp_path / "a.png", Wanted(y="slip"))
    with pytest.raises(DrawError, match="ends in"):
        picture(pad, tmp_path / "a.gif")


def test_symbols() -> None:
    assert symbol("heat.theta_bar") == r"$\bar\theta$"
    assert symbol("boundary.upper_plate.pressure") == "pressure of upper plate"
    assert symbol("load") == "load factor"


def test_the_table_lists_solutions_and_the_loop(pad: Path, plain: Path) -> None:
    text = path_summary(pad)
    lines = [line.split() for line in text.splitlines()]
    rows = [line for line in lines if line[3:4] in (["yes"], ["no"])]
    assert [row[0] for row in rows] == ["0.8"] * 3 + ["0.9"] * 5 + ["1"] * 3
    assert [row[4] for row in rows].count("yes") == 3
    assert "J m-1 lost" in text
    assert "(rising)" in text
    assert "(falling)" in text
    other = path_summary(plain)
    assert "0 folds" in other
    assert "hysteresis" not in other


@pytest.mark.parametrize("look", LOOKS)
def test_every_text_stays_on_a_page_of_any_size(pad: Path, look: style.Look) -> None:
    with style.styled(look):
        assert off_the_page(path_figure(read_path_picture(pad), look)) == []
