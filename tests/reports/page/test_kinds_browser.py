"""Pages of histories, fits and sweeps over geometries in a real browser, as those of runs in test_page_browser."""

from __future__ import annotations

from pathlib import Path

import pytest

from tcstudy.reports.page.write import write_page
from tests.reports.page.browser import Browser, fragment, missing, text_of

pytestmark = [pytest.mark.browser, pytest.mark.skipif(bool(missing()), reason=missing())]


def shown(browser: Browser, file: Path, place: str = "") -> Browser:
    browser.size(1280, 1000)
    browser.open(write_page(file, file.with_suffix(".html")).path, place)
    return browser


def click(browser: Browser, selector: str) -> None:
    browser.run(
        "document.querySelector(arguments[0]).dispatchEvent(new MouseEvent('click', {bubbles: true}))", selector
    )


def saved(browser: Browser, button: str) -> list[str]:
    """The lines of what a button downloads."""
    browser.run("TC.save = (name, text) => { window.saved = text; };")
    click(browser, button)
    return str(browser.run("return window.saved")).strip().split("\r\n")


def test_a_history_shows_sweep_loop_steps_and_energies(browser: Browser, history: Path) -> None:
    page = shown(browser, history)
    for part in ("#sweep", "#point", "#accuracy", "#table"):
        assert page.run("return document.querySelector(arguments[0]).querySelectorAll('svg, table').length", part) > 0
    assert "step: 16, back" in text_of(page, "#point")
    assert "6 of 6 histories" in text_of(page, "#verdict")
    page.press("[")
    assert fragment(page)["step"] == "15"
    click(page, '[data-point="2"]')
    assert fragment(page)["at"] == "1,0"
    lines = saved(page, "#steps [aria-label='csv']")
    assert lines[0].startswith("step,name,cycle,theta")
    assert len(lines) == 18
    assert page.complaints() == []


def test_the_address_of_a_history_brings_its_view_back(browser: Browser, history: Path) -> None:
    page = shown(browser, history, "#yof=dissipated&xof=step&step=3&at=2,1&theme=dark")
    assert "energy dissipated in the step over step" in text_of(page, "#steps")
    assert "step: 3" in text_of(page, "#point")


def test_a_geometry_is_chosen_and_its_body_and_line_are_drawn(browser: Browser, pads: Path) -> None:
    page = shown(browser, pads, "#at=0,0&x=height&y=u_x")
    level, high = "return document.querySelector('#accuracy table tbody').innerText", "return TC.point.panel.frame.high"
    sizes, before = page.run(level), page.run(high)
    page.run("document.querySelector('#sweep svg[tabindex]').focus()")
    page.press("ArrowRight")
    page.press("ArrowRight")
    assert page.run(high) == pytest.approx(4.0 * before)
    assert page.run(level) != sizes
    page.run("const cells = document.querySelectorAll('[data-point]'); "
             "cells[0].dispatchEvent(new MouseEvent('click', {bubbles: true, shiftKey: true}))")  # fmt: skip
    assert "dashed: " in text_of(page, "#point")
    assert page.complaints() == []


def test_a_fit_shows_its_data_numbers_and_law(browser: Browser, fitted: Path) -> None:
    page = shown(browser, fitted, "#step=4")
    assert "datum: 5 of 60" in text_of(page, "#fit")
    page.press("]")
    assert fragment(page)["step"] == "5"
    assert page.run("return document.querySelectorAll('#fit svg .mark').length") >= 120
    assert "friction.delta" in text_of(page, "#found")
    page.run("document.querySelectorAll('#table th button')[4].click()")
    lines = saved(page, "#table [aria-label=csv]")
    assert lines[0] == "datum,boundary.grip.u_x [m],value [N m-1],predicted [N m-1],noise [N m-1],residual"
    assert len(lines) == 61
    page.open(fitted.with_suffix(".html"), "#step=-3&response=9&fit_by=x")
    assert page.complaints() == []


@pytest.mark.parametrize("width", [390, 1280])
def test_nothing_sticks_out(
    browser: Browser, result: Path, history: Path, pads: Path, fitted: Path, width: int
) -> None:
    for file in (result, history, pads, fitted):
        written = write_page(file, file.with_suffix(".html")).path
        browser.size(width, 900, phone=width < 500)
        browser.open(written)
        assert browser.run("return document.documentElement.scrollWidth") <= width, file.name
    assert browser.complaints() == []


def test_print_holds_what_fits_on_paper(browser: Browser, history: Path, fitted: Path) -> None:
    for file in (history, fitted):
        written = write_page(file, file.with_suffix(".html")).path
        browser.size(720, 1000)
        browser.command("Emulation.setEmulatedMedia", media="print")
        try:
            browser.open(written, "#theme=dark")
            assert browser.run("return document.documentElement.scrollWidth") <= 720, file.name
            assert browser.run("return getComputedStyle(document.body).backgroundColor") == "rgb(255, 255, 255)"
        finally:
            browser.command("Emulation.setEmulatedMedia", media="")
