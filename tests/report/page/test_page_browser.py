"""The page in a real browser: it draws without complaint, obeys mouse and keys, keeps its state in the address."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from tcstudy.report.page import write_page
from tests.report import draw_cases
from tests.report.page.browser import Browser, missing

pytestmark = [pytest.mark.browser, pytest.mark.skipif(bool(missing()), reason=missing())]


@pytest.fixture(scope="module")
def browser(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Browser]:
    window = Browser(tmp_path_factory.mktemp("profile"))
    yield window
    window.close()


@pytest.fixture(scope="module")
def page(result: Path) -> Path:
    return write_page(result, result.with_suffix(".html")).path


@pytest.fixture
def shown(browser: Browser, page: Path) -> Browser:
    browser.size(1280, 1000)
    browser.open(page)
    return browser


def text_of(browser: Browser, selector: str) -> str:
    return str(browser.run("return document.querySelector(arguments[0]).innerText", selector))


def fragment(browser: Browser) -> dict[str, str]:
    found = browser.run("return Object.fromEntries(new URLSearchParams(location.hash.slice(1)))")
    return {str(key): str(value) for key, value in found.items()}


def test_every_part_is_drawn(shown: Browser) -> None:
    for part in ("#sweep", "#point", "#accuracy", "#table"):
        assert shown.run("return document.querySelector(arguments[0]).querySelectorAll('svg, table').length", part) > 0
    assert "6 of 6 solved" in text_of(shown, "#verdict")
    assert shown.complaints() == []


def test_a_click_on_a_cell_shows_its_point(shown: Browser) -> None:
    shown.run("document.querySelector('[data-point=\"1\"]').dispatchEvent(new MouseEvent('click', {bubbles: true}))")
    assert fragment(shown)["at"] == "0,1"
    assert "θ̄ = 0 K, friction: weak" in text_of(shown, "#point")


def test_arrow_keys_and_letters(shown: Browser, page: Path) -> None:
    shown.open(page, "#at=1,0&x=theta_bar&y=friction")
    shown.run("document.querySelector('#sweep svg[tabindex]').focus()")
    shown.press("ArrowRight")
    assert fragment(shown)["at"] == "2,0"
    shown.press("ArrowUp")
    assert fragment(shown)["at"] == "2,1"
    shown.press("[")
    assert fragment(shown)["level"] == "0"
    shown.press("c")
    assert fragment(shown)["vs"] == "2,1"


def test_the_address_brings_the_view_back(shown: Browser, page: Path) -> None:
    shown.open(page, "#q=slip_length&at=2,1&vs=0,0&level=0&theme=dark")
    assert "slip length" in text_of(shown, "#sweep h3")
    assert "dashed: θ̄ = 0 K, friction: plain" in text_of(shown, "#point")
    assert shown.run("return document.documentElement.dataset.theme") == "dark"
    assert shown.complaints() == []


def test_nonsense_in_the_address_is_passed_over(shown: Browser, page: Path) -> None:
    shown.open(page, "#q=none&at=9,9&level=-3&x=nothing&vs=1&mode=live&sort=x")
    assert "6 of 6 solved" in text_of(shown, "#verdict")
    assert shown.complaints() == []


def test_the_table_sorts_and_downloads_what_is_shown(shown: Browser) -> None:
    first = "return document.querySelector('#table tbody tr').innerText"
    shown.run("document.querySelectorAll('#table th button')[2].click()")
    least = shown.run(first)
    shown.run("document.querySelectorAll('#table th button')[2].click()")
    assert shown.run(first) != least
    shown.run("TC.save = (name, text) => { window.saved = [name, text]; };")
    shown.run("document.querySelector('#table [aria-label=csv]').click()")
    name, text = shown.run("return window.saved")
    assert name == "block-level1.csv"
    lines = text.strip().split("\r\n")
    assert lines[0].startswith("theta_bar [K],friction,u_T_max [m]")
    assert len(lines) == 7


@pytest.mark.parametrize("width", [390, 1280])
def test_nothing_sticks_out(shown: Browser, page: Path, width: int) -> None:
    shown.size(width, 900, phone=width < 500)
    shown.open(page)
    assert shown.run("return document.documentElement.scrollWidth") <= width


def test_listed_points_failed_points_and_no_sweep_at_all(shown: Browser, tmp_path: Path) -> None:
    cases = {
        "listed": draw_cases.result(tmp_path / "listed.nc", "list", (draw_cases.ALPHA, draw_cases.TAU)),
        "failed": draw_cases.result(tmp_path / "failed.nc"),
        "single": draw_cases.result(tmp_path / "single.nc", "grid", ()),
    }
    for name, file in cases.items():
        written = write_page(file, tmp_path / f"{name}.html")
        shown.open(written.path)
        assert shown.run("return document.querySelectorAll('#point svg').length") > 0
    assert shown.complaints() == []
