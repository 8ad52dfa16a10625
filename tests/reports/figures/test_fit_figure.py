"""The picture of a fit: all sizes that are asked for."""

from __future__ import annotations

from pathlib import Path

import pytest

pytest.importorskip("matplotlib")

from tcstudy.data.store import load_root
from tcstudy.reports.figures import style
from tcstudy.reports.figures.draw import Wanted, picture
from tcstudy.reports.figures.fit_figure import fit_figure
from tests.reports.figures.draw_cases import LOOKS, off_the_page


@pytest.mark.parametrize("look", LOOKS)
def test_nothing_leaves_the_page_and_the_law_stands_below_where_it_is_narrow(fitted: Path, look: style.Look) -> None:
    with style.styled(look):
        figure = fit_figure(load_root(fitted, "fit"), look)
        assert off_the_page(figure) == []
    narrow = look.size is not None and look.size[0] < 4.0
    _, residuals, law = (axes.get_position() for axes in figure.axes)
    assert (law.y1 <= residuals.y0 or residuals.y1 <= law.y0) == narrow


def test_a_size_can_be_asked_for(fitted: Path, tmp_path: Path) -> None:
    assert "fitted to pull_fit.csv" in picture(fitted, tmp_path / "p.svg", Wanted(size=(3.15, 6.0)))
