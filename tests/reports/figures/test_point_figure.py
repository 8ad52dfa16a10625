"""Pictures as files, and the one clear error of every fault."""

from __future__ import annotations

import errno
import os
import sys
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("matplotlib")

from matplotlib.image import imread

from tcstudy.data.files import StoreError
from tcstudy.errors import DrawError
from tcstudy.reports.figures import style
from tcstudy.reports.figures.draw import Wanted, picture
from tcstudy.reports.figures.point_figure import point_figure
from tcstudy.reports.picture import read_picture
from tests.reports.figures.draw_cases import LOOKS, off_the_page, png_size, result


@pytest.mark.parametrize("fields", [True, False])
def test_a_png_of_the_right_size_that_is_not_blank(tmp_path: Path, fields: bool) -> None:
    path = result(tmp_path / "r.nc", fields=fields)
    target = tmp_path / "new" / "p.png"
    said = picture(path, target, Wanted({"alpha": 100}))
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
        picture(grid, tmp_path / name)
    assert (tmp_path / "a.svg").read_bytes() == (tmp_path / "b.svg").read_bytes()
    assert "<svg" in (tmp_path / "a.svg").read_text()


def test_global_state_of_matplotlib_is_left_alone(grid: Path, tmp_path: Path) -> None:
    import matplotlib

    with matplotlib.rc_context({"font.size": 7.0, "axes.spines.top": True}):
        before = dict(matplotlib.rcParams)
        picture(grid, tmp_path / "p.png")
        assert dict(matplotlib.rcParams) == before


def test_no_file(tmp_path: Path) -> None:
    with pytest.raises(StoreError, match="Run the study first"):
        picture(tmp_path / "none.nc", tmp_path / "p.png")


def test_an_unknown_format(grid: Path, tmp_path: Path) -> None:
    with pytest.raises(DrawError, match=r"ends in \.png, \.svg, \.pdf"):
        picture(grid, tmp_path / "p.jpeg")


def test_a_place_that_cannot_be_written(grid: Path, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("x")
    with pytest.raises(DrawError, match=r"file is a file, so .* cannot be made; choose another output"):
        picture(grid, tmp_path / "file" / "p.png")
    (tmp_path / "folder.png").mkdir()
    with pytest.raises(DrawError, match=r"folder.png is a directory"):
        picture(grid, tmp_path / "folder.png")


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="pipes of POSIX")
def test_a_pipe_is_refused_and_not_waited_on(grid: Path, tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "p.png")
    with pytest.raises(DrawError, match=r"is a pipe, no file; choose another output"):
        picture(grid, tmp_path / "p.png")


def test_an_old_picture_stays_whole_until_the_new_one_is_on_the_disk(
    grid: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    target = tmp_path / "p.png"
    picture(grid, target)
    before = target.read_bytes()
    (tmp_path / "link.png").symlink_to(target)

    def full(*_: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    with monkeypatch.context() as patch:
        patch.setattr(os, "replace", full)
        with pytest.raises(DrawError, match=r"No space left on device\. Free some space"):
            picture(grid, target, Wanted({"alpha": 100}))
    assert target.read_bytes() == before
    picture(grid, tmp_path / "link.png", Wanted({"alpha": 100}))
    assert (tmp_path / "link.png").is_symlink()
    assert target.read_bytes() != before
    assert sorted(file.name for file in tmp_path.iterdir() if file.suffix == ".tmp") == []


def test_without_matplotlib(grid: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    with pytest.raises(DrawError, match=r'pip install "tcstudy\[plot\]"') as caught:
        picture(grid, tmp_path / "p.png")
    assert "\n" not in str(caught.value)
    assert not (tmp_path / "p.png").exists()


def test_text_stays_text_and_fonts_are_truetype(grid: Path, tmp_path: Path) -> None:
    """Journals refuse fonts of Type 3; letters as outlines can be neither edited nor found."""
    picture(grid, tmp_path / "p.svg")
    assert "Contact line: " in (tmp_path / "p.svg").read_text(encoding="utf-8")
    picture(grid, tmp_path / "p.pdf")
    written = (tmp_path / "p.pdf").read_bytes()
    assert b"/Subtype /Type3" not in written
    assert b"/FontFile2" in written


@pytest.mark.parametrize("look", LOOKS)
def test_every_text_stays_on_a_page_of_any_size(tmp_path: Path, look: style.Look) -> None:
    with style.styled(look):
        picture = read_picture(result(tmp_path / "a.nc"))
        assert off_the_page(point_figure(picture, look)) == []
