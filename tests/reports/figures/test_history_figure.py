"""The picture of a load history: its loop, what nodes do in every step, its cycles."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("matplotlib")

from tcstudy.data.store import load_root
from tcstudy.errors import DrawError
from tcstudy.read.study import read_study_text
from tcstudy.reports.figures import style
from tcstudy.reports.figures.draw import Wanted, picture
from tcstudy.reports.figures.history_figure import history_figure
from tcstudy.study.history_run import execute_history
from tests.reports.figures.draw_cases import LOOKS, RAIL, off_the_page


@pytest.fixture(scope="module")
def file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("rail") / "rail.nc"
    execute_history(read_study_text(RAIL), path)
    return path


def test_the_loop_is_the_slip_of_the_end_over_the_load(file: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    drawn = []
    monkeypatch.setattr(style, "save", lambda figure, *_: drawn.append(figure))
    said = picture(file, file.with_suffix(".png"))
    assert "slip over theta, 16 steps" in said
    loop, motion, cycles = (
        next(a for a in drawn[0].axes if a.get_xlabel().startswith(word)) for word in (r"$\theta$", "step", "cycle")
    )
    data = load_root(file, "history")
    end = data["u_T"].values[:, np.abs(data["u_T"].values).max(axis=0).argmax()]
    whole = next(line for line in loop.lines if len(np.asarray(line.get_xdata())) == 17)
    assert np.array_equal(np.asarray(whole.get_xdata()), data["theta"].values)
    assert np.asarray(whole.get_ydata()) / np.asarray(whole.get_ydata())[2] == pytest.approx(end / end[2])
    names = {text.get_text() for text in loop.texts}
    assert {"warm", "cold", "start", "back"} == {one for name in names for one in name.split(", ")}
    what = np.asarray(motion.collections[0].get_array()).reshape(data.sizes["node"], 16)
    assert np.all(what[-1] == [1, 1, 2, 2, 2, 2, 1, 1] * 2)  # the end always slides, with the load
    assert np.all(what[0] == 0)  # what is next to the middle never does
    assert [bar.get_height() for bar in cycles.patches] == pytest.approx(
        [data["dissipated"].values[1:9].sum(), data["dissipated"].values[9:].sum()]
    )


@pytest.mark.parametrize("look", LOOKS)
def test_every_text_stays_on_a_page_of_any_size(file: Path, look: style.Look) -> None:
    data = load_root(file, "history")
    with style.styled(look):
        assert off_the_page(history_figure(data, "theta", "dissipated", "", look)) == []


def test_what_cannot_be_drawn_is_refused(file: Path, tmp_path: Path) -> None:
    with pytest.raises(DrawError, match="the history has no number"):
        picture(file, tmp_path / "a.png", Wanted(y="u_X"))
    with pytest.raises(DrawError, match="no swept parameter 'alpha'"):
        picture(file, tmp_path / "a.png", Wanted(at={"alpha": 1}))
    assert not list(tmp_path.iterdir())


def test_least_energies_have_a_picture_too(tmp_path: Path) -> None:
    execute_history(read_study_text(RAIL, "rail.yaml", ["history.branch=lowest", "mesh.maxh=2"]), tmp_path / "a.nc")
    assert "slip over theta" in picture(tmp_path / "a.nc", tmp_path / "a.png", Wanted())
