"""The sheet of every picture: keys apart from panels, in few rows; words with symbols."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from tcstudy.reports.figures import style
from tcstudy.reports.figures.sheet import APART, SMALL, Sheet
from tests.reports.figures.draw_cases import LOOKS, off_the_page

if TYPE_CHECKING:
    from matplotlib.figure import Figure

LABELS = ["a", "bb", "of least energy on the path", "asked for (open: unstable)", "fold", "slow loading, unloading"]


def keyed(look: style.Look, labels: list[str], place: str, shape: str) -> Figure:
    """A panel with labels, of which y is longer than it, and a key."""
    from matplotlib.lines import Line2D

    with style.styled(look):
        sheet = Sheet(look, "A heading", ["a fact"], feet=["a foot"])
        (axes,) = sheet.panels.values()
        axes.plot([0.0, 2.0], [0.0, 1.0])
        axes.set_aspect(shape)
        axes.set(xlabel="x [mm]", ylabel="y [mm]", title="panel")
        sheet.key([Line2D([], [], label=label) for label in labels], place)
        return sheet.finish()


@pytest.mark.parametrize("look", LOOKS)
@pytest.mark.parametrize("shape", ["auto", "equal"])
@pytest.mark.parametrize("place", ["lower center", "upper left", "right upper"])
def test_a_key_keeps_its_distance_from_the_labels_of_a_panel(look: style.Look, shape: str, place: str) -> None:
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    figure = keyed(look, ["one", "two"], place, shape)
    assert off_the_page(figure) == []
    renderer = FigureCanvasAgg(figure).get_renderer()
    panel, key = figure.axes[0].get_tightbbox(renderer), figure.legends[0].get_window_extent(renderer)
    assert panel is not None
    between = {"lower": panel.y0 - key.y1, "upper": key.y0 - panel.y1, "right": key.x0 - panel.x1}[place.split()[0]]
    margin = 0.5 * APART * SMALL * look.letters * figure.dpi / 72.0  # what the key counts to itself
    assert between + margin > 0.9 * 2.0 * margin


@pytest.mark.parametrize("look", LOOKS)
def test_a_key_has_as_few_rows_as_the_picture_has_room_for(look: style.Look) -> None:
    figure = keyed(look, LABELS, "upper left", "auto")
    assert off_the_page(figure) == []
    texts = [text.get_window_extent() for text in figure.legends[0].get_texts()]
    rows = len({round(box.y0) for box in texts if box.x0 == texts[0].x0})
    assert rows == len(LABELS) if look.size and look.size[0] < 5.0 else rows == 2


def test_a_label_is_not_broken_within_its_unit() -> None:
    with style.styled():
        sheet = Sheet(style.Look(), "A heading", [], heights=(1.0,))
        (axes,) = sheet.panels.values()
        axes.set_ylabel("energy dissipated [kJ m⁻¹]")
        sheet.finish()
    assert axes.get_ylabel() == "energy dissipated\n[kJ m⁻¹]"


def test_words_have_the_symbols_of_formulas() -> None:
    assert style.with_symbols("largest |u_T|") == "largest |$u_T$|"
    assert style.with_symbols("tangential stiffness lambda_1") == r"tangential stiffness $\lambda_1$"
    assert style.with_symbols("slip_length for $5") == r"slip_length for \$5"
