"""Every shipped study has its page: drawn with pictures, without a complaint of the browser."""

from __future__ import annotations

from pathlib import Path

import pytest

from tcstudy.cli import main
from tests.reports.page.browser import Browser, missing

pytestmark = [pytest.mark.browser, pytest.mark.skipif(bool(missing()), reason=missing())]

SHIPPED = sorted((Path(__file__).parents[3] / "configs").glob("*.yaml"))
COARSE = {
    "coated_block": ("mesh.levels=1",),
    "convergence": ("mesh.levels=2",),
    "manufactured": ("mesh.levels=1",),
    "quickstart": ("mesh.levels=1",),
    "rail_year": ("mesh.maxh=344 mm",),
    "singular": ("mesh.levels=6",),
    "stability": ("mesh.levels=1",),
    "thickness_map": ("mesh.levels=1",),
    "welded_rail": ("mesh.maxh=344 mm",),
}
"""What is changed of a study so that it takes a second or two; its page has the same parts."""


@pytest.mark.parametrize("config", SHIPPED, ids=lambda path: path.stem)
def test_its_page_is_drawn(config: Path, browser: Browser, tmp_path: Path) -> None:
    changes = [f"--set={one}" for one in COARSE.get(config.stem, ())]
    file = tmp_path / f"{config.stem}.nc"
    assert main(["run", str(config), *changes, "-q", f"--output={file}"]) == 0
    assert main(["report", str(file)]) == 0
    browser.open(file.with_suffix(".html"))
    assert browser.run("return document.querySelectorAll('#main svg path').length") > 4
    assert browser.run("return [...document.querySelectorAll('#main > div')].every((part) => part.innerText.length)")
    assert browser.complaints() == []
