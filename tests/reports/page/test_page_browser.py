"""Pages in a real browser: they draw without complaint, obey mouse and keys, keep their state in the address."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tcstudy.cli import main
from tcstudy.data.provenance import collect
from tcstudy.data.store import write_record
from tcstudy.read.study import read_study, read_study_text
from tcstudy.reports.page.write import write_page
from tcstudy.study.run import execute
from tests.reports.figures import draw_cases
from tests.reports.page.browser import Browser, fragment, missing, text_of
from tests.reports.page.conftest import STUDY
from tests.reports.terminal.test_cost import made

pytestmark = [pytest.mark.browser, pytest.mark.skipif(bool(missing()), reason=missing())]


def shown(browser: Browser, file: Path, place: str = "") -> Browser:
    browser.size(1280, 1000)
    browser.open(write_page(file, file.with_suffix(".html")).path, place)
    return browser


def click(browser: Browser, selector: str, **more: bool) -> None:
    browser.run("document.querySelector(arguments[0]).dispatchEvent(new MouseEvent('click', arguments[1]))", selector,
                {"bubbles": True} | more)  # fmt: skip


def saved(browser: Browser, button: str) -> list[str]:
    """The lines of what a button downloads, after the name."""
    browser.run("TC.save = (name, text) => { window.saved = name + '\\r\\n' + text; };")
    click(browser, button)
    return str(browser.run("return window.saved")).strip().split("\r\n")


def test_a_run_obeys_clicks_keys_and_its_address(browser: Browser, result: Path) -> None:
    page = shown(browser, result, "#x=theta_bar&y=friction")
    assert "6 of 6 solved" in text_of(page, "#verdict")
    click(page, '[data-point="1"]')
    assert fragment(page)["at"] == "0,1"
    assert "θ̄ = 0 K, friction: weak" in text_of(page, "#point")
    page.run("document.querySelector('#sweep svg[tabindex]').focus()")
    for key in ("ArrowRight", "ArrowRight", "[", "c"):
        page.press(key)
    assert {key: fragment(page)[key] for key in ("at", "level", "vs")} == {"at": "2,1", "level": "0", "vs": "2,1"}
    page.open(result.with_suffix(".html"), "#q=slip_length&at=2,1&vs=0,0&level=0&theme=dark")
    assert "slip length" in text_of(page, "#sweep h3")
    assert "dashed: θ̄ = 0 K, friction: plain" in text_of(page, "#point")
    page.open(result.with_suffix(".html"), "#q=none&at=9,9&level=-3&x=nothing&vs=1&mode=live&sort=x")
    first = "return document.querySelector('#table tbody tr').innerText"
    click(page, "#table th:nth-child(3) button")
    least = page.run(first)
    click(page, "#table th:nth-child(3) button")
    assert page.run(first) != least
    name, head, *rows = saved(page, "#table [aria-label=csv]")
    assert (name, len(rows)) == ("block-level1.csv", 6)
    assert head.startswith("theta_bar [K],friction,u_T_max [m]")
    assert page.complaints() == []


def test_every_equilibrium_of_a_point_can_be_looked_at(browser: Browser, tmp_path: Path) -> None:
    changes = [
        "friction={law: piecewise-linear, points: [[0, 25 MPa], [15 um, 25 MPa], [15 um, 5 MPa]]}",
        "sweep={boundary.end.g: [[12 MPa, 0], [16 MPa, 0]], theta_bar: [0 K, 10 K]}",
        *("mesh.levels=1", "output.fields=false", "solver.branch=all"),
    ]
    config = Path(__file__).parents[3] / "configs" / "quickstart.yaml"
    execute(read_study_text(config.read_text(), "all", changes), tmp_path / "all.nc")
    page = shown(browser, tmp_path / "all.nc", "#at=0,1&q=solutions")
    assert "3 of 3 equilibria, proved" in text_of(page, "#point")
    slip = (
        "return document.querySelector('[aria-label=\"slip along the contact line\"] path[stroke]').getAttribute('d')"
    )
    stored = page.run(slip)
    click(page, '[aria-label="equilibrium 2"]')
    assert fragment(page)["eq"] == "2"
    assert page.run(slip) != stored
    click(page, '[data-point="0"]')
    assert "9 of 9 equilibria, proved" in text_of(page, "#point")
    assert fragment(page)["eq"] == "0"
    assert page.complaints() == []


def test_listed_points_failed_points_and_no_sweep_at_all(browser: Browser, tmp_path: Path) -> None:
    cases = {
        "listed": draw_cases.result(tmp_path / "listed.nc", "list", (draw_cases.ALPHA, draw_cases.TAU)),
        "single": draw_cases.result(tmp_path / "single.nc", "grid", ()),
        "failed": draw_cases.result(tmp_path / "failed.nc"),
    }
    for file in cases.values():
        page = shown(browser, file, "#at=1,1&level=1")
        assert page.run("return document.querySelectorAll('#point svg').length") > 0
    assert "the stiffness matrix is singular" in text_of(page, "#point")
    assert page.complaints() == []


SMALL = """
title: A strip
units: none
body: {rectangle: {width: 2, height: 1}}
boundary: {bottom: contact, left: free, top: {role: clamped, u_x: 0.1, u_y: 0}, right: free}
material: {E: 1, nu: 0.3}
friction: {law: slip-weakening, tau_s: 0.05, tau_k: 0.01, delta: 0.02}
mesh: {maxh: 2, levels: 4}
"""


def test_files_of_converge_and_cost_and_those_beside_a_run(browser: Browser, tmp_path: Path) -> None:
    study = tmp_path / "strip.yaml"
    study.write_text(SMALL, encoding="utf-8")
    files = {word: tmp_path / f"strip{end}.nc" for word, end in (("run", ""), ("converge", ".convergence"))}
    for command, file in files.items():
        assert main([command, str(study), "--output", str(file)]) == 0
    files["cost"] = tmp_path / "strip.cost.nc"
    write_record(files["cost"], read_study(study), made(), collect(read_study(study), ["tcstudy"]))
    for command, file in files.items():
        page = shown(browser, file)
        assert page.run("return document.querySelectorAll('main svg').length") > 1, command
    told = text_of(shown(browser, files["run"]), "#accuracy")
    assert "Measured convergence" in told
    assert "Accuracy against cost" in told
    assert browser.complaints() == []


def test_sliders_solve_again(browser: Browser, tmp_path: Path) -> None:
    execute(read_study_text(STUDY, "block", ["output.live=true"]), tmp_path / "live.nc")
    page = shown(browser, tmp_path / "live.nc", "#mode=live&at=0,0")
    move = (
        "const slider = document.querySelector(`input[aria-label='${arguments[0]}']`); slider.value = arguments[1];"
        "slider.dispatchEvent(new Event('input')); TC.live.show(TC.live.point);"
        "return TC.live.answer && Math.max(...TC.live.answer.v);"
    )
    assert "only solution" in text_of(page, "main")
    before = page.run("return Math.max(...TC.live.answer.v)")
    pulled = page.run(move, "loads ×", 400)
    assert pulled > before
    page.run("return new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))")  # the address
    assert fragment(page)["set"] == "3,1,1"
    assert page.run(move, "friction ×", 400) < pulled
    page.open(tmp_path / "live.html", "#mode=live&at=0,1&set=1,1,0.125")
    assert "not solved here" in text_of(page, "main")
    assert page.run("return TC.live.answer") is None
    assert page.complaints() == []


FILMS = """
title: Two films
body: {outline: [{from: [0, 0], edge: film}, {from: [1, 0], edge: shoe}, {from: [2, 0], edge: grip},
                 {from: [2, 0.2], edge: top}, {from: [0, 0.2], edge: tail}]}
boundary: {film: contact, shoe: contact, grip: {role: clamped, u_x: 1 mm, u_y: free}, top: free, tail: free}
material: {E: 10 GPa, nu: 0}
friction: {film: {law: tresca, tau: 2 MPa, strength: "min(1, max(0, 2*x - 0.5))"}, shoe: {law: tresca, tau: 1 MPa}}
mesh: {maxh: 0.2}
output: {quantities: [section_force]}
"""


def test_every_edge_has_its_law_with_its_own_nodes(browser: Browser, tmp_path: Path) -> None:
    execute(read_study_text(FILMS), tmp_path / "films.nc")
    page = shown(browser, tmp_path / "films.nc")
    assert "Slip, friction and section force along film, shoe" in text_of(page, "#point")
    count = """return [...document.querySelectorAll('#point h3')].filter((h) => h.textContent.startsWith('Friction'))
        .map((h) => [h.textContent, h.parentElement.querySelectorAll('[fill-opacity]').length,
                     h.parentElement.nextSibling.textContent])"""
    film, shoe = page.run(count)
    assert film[0].startswith("Friction law of film (tresca)")
    assert shoe[0].startswith("Friction law of shoe (tresca)")
    assert "divided by the strength" in film[2]
    x = np.array(page.run("return Array.from(Object.values(TC.data.lines)[0].x)"))
    # the node where they meet has parts of both laws, and is not drawn
    own = (x < 1 - 1e-9) & (x > 0.25 + 1e-9), x > 1 + 1e-9
    assert (film[1], shoe[1]) == tuple(np.count_nonzero(nodes) for nodes in own)
    assert page.complaints() == []


def test_a_history_shows_sweep_loop_steps_and_energies(browser: Browser, history: Path) -> None:
    page = shown(browser, history)
    for part in ("#sweep", "#point", "#accuracy", "#table"):
        assert page.run("return document.querySelector(arguments[0]).querySelectorAll('svg, table').length", part) > 0
    assert "step: 16, back" in text_of(page, "#point")
    page.press("[")
    assert fragment(page)["step"] == "15"
    click(page, '[data-point="2"]')
    assert fragment(page)["at"] == "1,0"
    _, head, *rows = saved(page, "#steps [aria-label='csv']")
    assert (head[:21], len(rows)) == ("step,name,cycle,theta", 17)
    page.open(history.with_suffix(".html"), "#yof=dissipated&xof=step&step=3&at=2,1&theme=dark")
    assert "energy dissipated in the step over step" in text_of(page, "#steps")
    assert "step: 3" in text_of(page, "#point")
    assert page.complaints() == []


def test_a_geometry_is_chosen_and_its_body_and_line_are_drawn(browser: Browser, pads: Path) -> None:
    page = shown(browser, pads, "#at=0,0&x=height&y=u_x")
    level, high = "return document.querySelector('#accuracy table tbody').innerText", "return TC.point.panel.frame.high"
    sizes, before = page.run(level), page.run(high)
    page.run("document.querySelector('#sweep svg[tabindex]').focus()")
    page.press("ArrowRight")
    page.press("ArrowRight")
    assert page.run(high) == pytest.approx(4.0 * before)
    assert page.run(level) != sizes
    click(page, "[data-point]", shiftKey=True)
    assert "dashed: " in text_of(page, "#point")
    assert page.complaints() == []


def test_a_fit_shows_its_data_numbers_and_law(browser: Browser, fitted: Path) -> None:
    page = shown(browser, fitted, "#step=4")
    assert "datum: 5 of 60" in text_of(page, "#fit")
    page.press("]")
    assert fragment(page)["step"] == "5"
    assert page.run("return document.querySelectorAll('#fit svg .mark').length") >= 120
    assert "friction.delta" in text_of(page, "#found")
    _, head, *rows = saved(page, "#table [aria-label=csv]")
    assert head == "datum,boundary.grip.u_x [m],value [N m-1],predicted [N m-1],noise [N m-1],residual"
    assert len(rows) == 60
    assert page.complaints() == []


@pytest.mark.parametrize(("width", "media"), [(390, ""), (1280, ""), (720, "print")])
def test_nothing_sticks_out_of_screen_or_paper(
    browser: Browser, result: Path, history: Path, pads: Path, fitted: Path, width: int, media: str
) -> None:
    browser.command("Emulation.setEmulatedMedia", media=media)
    try:
        for file in (result, history, pads, fitted):
            written = write_page(file, file.with_suffix(".html")).path
            browser.size(width, 900, phone=width < 500)
            browser.open(written, "#theme=dark" if media else "")
            assert browser.run("return document.documentElement.scrollWidth") <= width, file.name
        if media:
            assert browser.run("return getComputedStyle(document.body).backgroundColor") == "rgb(255, 255, 255)"
    finally:
        browser.command("Emulation.setEmulatedMedia", media="")
    assert browser.complaints() == []
