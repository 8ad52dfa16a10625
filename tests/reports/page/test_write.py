"""What stands in a page, how large it is, and what is refused."""

import re
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from tcstudy.cli import main
from tcstudy.errors import PageError
from tcstudy.reports.figures.edges import ROLES
from tcstudy.reports.page import write
from tcstudy.reports.page.write import write_page
from tests.reports.page.unpacked import data_of


@pytest.fixture(scope="module")
def page(result: Path) -> Path:
    return write_page(result, result.with_suffix(".html")).path


def test_the_page_lies_beside_its_file_and_has_a_name_of_its_own(
    result: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["report", str(result)]) == 0
    assert capsys.readouterr().out.startswith(f"{result.with_suffix('.html')}: ")
    with pytest.raises(SystemExit) as stop:
        main(["report", str(result), "-o", str(tmp_path)])
    assert stop.value.code == 2
    assert "a page's name ends in .html" in capsys.readouterr().err


def test_a_page_needs_nothing_from_outside(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    for word in ("src=", "href=", "@import", "http://", "https://"):
        assert word not in text.replace("http://www.w3.org/2000/svg", ""), word
    assert "A block &lt;on&gt; a film" in text
    assert "6 of 6 solved" in text
    assert text.rstrip().endswith("</html>")


def test_numbers_of_every_point_and_level_are_in_the_page(page: Path, result: Path) -> None:
    found, tree = data_of(page), xr.open_datatree(result)
    energy = tree["energy"].values
    np.testing.assert_array_equal(found["run"]["numbers"]["energy"]["v"], energy.reshape(6, 2))
    assert found["run"]["shape"] == [3, 2]
    assert [axis["name"] for axis in found["run"]["axes"]] == ["theta_bar", "friction"]
    line = found["lines"]["1"]
    slip = tree["level_1"]["u_T"].values.reshape(6, -1)
    assert np.max(np.abs(line["u_T"]["rows"] * line["u_T"]["scale"][:, None] - slip)) <= 1e-4 * np.max(np.abs(slip))
    tree.close()


def test_of_too_many_points_some_are_kept_and_it_is_said(
    result: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("tcstudy.reports.page.stored.MOST_SOLUTIONS", 9)  # of six points on two levels
    found, tree = data_of(write_page(result, tmp_path / "few.html").path), xr.open_datatree(result)
    assert found["run"]["shape"] == [2, 2]
    np.testing.assert_array_equal(found["run"]["numbers"]["energy"]["v"], tree["energy"].values[::2].reshape(4, 2))
    slip = tree["level_1"]["u_T"].values[::2].reshape(4, -1)
    line = found["lines"]["1"]
    assert np.max(np.abs(line["u_T"]["rows"] * line["u_T"]["scale"][:, None] - slip)) <= 1e-4 * np.max(np.abs(slip))
    assert [found["laws"]["laws"][i]["name"] for i in found["laws"]["index"]] == ["tresca", "slip-weakening"] * 2
    assert "shown are 4 of the 6 points" in found["verdict"]["how"]
    tree.close()
    monkeypatch.setattr("tcstudy.reports.page.stored.MOST_SCENES", 5)
    bare = data_of(write_page(result, tmp_path / "bare.html").path)
    assert bare["laws"] is None
    assert [edge["role"] for edge in bare["outline"]] == [edge["role"] for edge in found["outline"]]


def test_held_end_free_end_and_roles(page: Path) -> None:
    found = data_of(page)
    (part,) = found["lines"]["1"]["parts"]
    assert part["held"] == [True, False]
    roles = {edge["name"]: edge["role"] for edge in found["outline"]}
    assert roles == {"film": "contact", "back": "clamped", "top": "convection", "end": "traction"}
    mesh = found["body"]
    names = [found["outline"][i]["name"] for i in mesh["edge"]]
    middles = mesh["x"][mesh["boundary"]].mean(axis=1)
    assert all((name == "end") == (x > 0.2 - 1e-6) for name, x in zip(names, middles, strict=True))


def test_what_is_too_large_is_left_out_in_order_and_said(
    result: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    full = write_page(result, tmp_path / "full.html")
    monkeypatch.setattr(write, "AIM", full.size - 1)
    less = write_page(result, tmp_path / "less.html")
    assert less.left_out == ("levels",)
    assert less.size < full.size
    assert "levels" in less.words
    assert list(data_of(less.path)["lines"]) == ["1"]


def test_a_page_beyond_the_limit_is_refused(result: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(write, "AIM", 1)
    monkeypatch.setattr(write, "MOST", 10)
    with pytest.raises(PageError, match="split the sweep"):
        write_page(result, tmp_path / "page.html")
    assert not (tmp_path / "page.html").exists()


def test_nothing_but_a_page_is_overwritten(result: Path, tmp_path: Path) -> None:
    other = tmp_path / "study.yaml"
    other.write_text("title: mine\n")
    with pytest.raises(PageError, match="would be lost"):
        write_page(result, other)
    assert other.read_text() == "title: mine\n"


def test_a_page_knows_every_role() -> None:
    """An edge of a role that its script does not know would end it."""
    script = (Path(write.__file__).parent / "assets" / "point.js").read_text(encoding="utf-8")
    table = script.partition("TC.ROLES = {")[2].partition("};")[0]
    assert {*re.findall(r"(\w+): { words", table)} == {*ROLES}
