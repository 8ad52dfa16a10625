"""The figure of the friction laws."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("matplotlib")

from matplotlib.image import imread

from tcstudy.errors import DrawError
from tcstudy.reports import style
from tcstudy.reports.law_figure import UP_STYLE, draw_laws, law_figure
from tcstudy.scene.laws import SHAPES
from tests.reports.draw_cases import crowded, example_laws, png_size


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


def test_no_text_of_the_laws_overlaps_another() -> None:
    steep = SHAPES["slip-weakening"].build(tau_s=2e7, tau_k=5e6, delta=4e-5)
    with style.styled():
        for laws in (example_laws(), [steep] * 4, [steep]):
            assert crowded(law_figure(laws)) == []
