"""The page in a real browser: it draws without complaint, obeys mouse and keys, keeps its state in the address."""

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

CONFIGS = Path(__file__).parents[3] / "configs"
LEVEL = ("mesh.levels=1", "output.fields=false")

pytestmark = [pytest.mark.browser, pytest.mark.skipif(bool(missing()), reason=missing())]


@pytest.fixture(scope="module")
def page(result: Path) -> Path:
    return write_page(result, result.with_suffix(".html")).path


@pytest.fixture
def shown(browser: Browser, page: Path) -> Browser:
    browser.size(1280, 1000)
    browser.open(page)
    return browser


def test_every_equilibrium_of_a_point_can_be_looked_at(browser: Browser, tmp_path: Path) -> None:
    film = "friction={law: piecewise-linear, points: [[0, 25 MPa], [15 um, 25 MPa], [15 um, 5 MPa]]}"
    sweep = "sweep={boundary.end.g: [[12 MPa, 0], [16 MPa, 0]], theta_bar: [0 K, 10 K]}"
    study = read_study_text(
        (CONFIGS / "quickstart.yaml").read_text(), "all", [film, sweep, *LEVEL, "solver.branch=all"]
    )
    execute(study, tmp_path / "all.nc")
    browser.open(write_page(tmp_path / "all.nc", tmp_path / "all.html").path, "#at=0,1&q=solutions")
    assert "3 of 3 equilibria, proved" in text_of(browser, "#point")
    slips = (
        "return document.querySelector('[aria-label=\"slip along the contact line\"] path[stroke]').getAttribute('d')"
    )
    stored = browser.run(slips)
    browser.run("document.querySelector('[aria-label=\"equilibrium 2\"]').click()")
    assert fragment(browser)["eq"] == "2"
    assert browser.run(slips) != stored
    browser.run("document.querySelector('[data-point=\"0\"]').dispatchEvent(new MouseEvent('click', {bubbles: true}))")
    assert "9 of 9 equilibria, proved" in text_of(browser, "#point")
    assert fragment(browser)["eq"] == "0"
    assert browser.complaints() == []


def test_clicks_arrow_keys_and_letters(shown: Browser, page: Path) -> None:
    shown.run("document.querySelector('[data-point=\"1\"]').dispatchEvent(new MouseEvent('click', {bubbles: true}))")
    assert fragment(shown)["at"] == "0,1"
    assert "θ̄ = 0 K, friction: weak" in text_of(shown, "#point")
    shown.open(page, "#at=1,0&x=theta_bar&y=friction")
    shown.run("document.querySelector('#sweep svg[tabindex]').focus()")
    for key in ("ArrowRight", "ArrowUp", "[", "c"):
        shown.press(key)
    assert {key: fragment(shown)[key] for key in ("at", "level", "vs")} == {"at": "2,1", "level": "0", "vs": "2,1"}


def test_the_address_brings_the_view_back_and_nonsense_in_it_is_passed_over(shown: Browser, page: Path) -> None:
    shown.open(page, "#q=slip_length&at=2,1&vs=0,0&level=0&theme=dark")
    assert "slip length" in text_of(shown, "#sweep h3")
    assert "dashed: θ̄ = 0 K, friction: plain" in text_of(shown, "#point")
    assert shown.run("return document.documentElement.dataset.theme") == "dark"
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


def test_listed_points_failed_points_and_no_sweep_at_all(shown: Browser, tmp_path: Path) -> None:
    cases = {
        "listed": draw_cases.result(tmp_path / "listed.nc", "list", (draw_cases.ALPHA, draw_cases.TAU)),
        "failed": draw_cases.result(tmp_path / "failed.nc"),
        "single": draw_cases.result(tmp_path / "single.nc", "grid", ()),
    }
    for name, file in cases.items():
        written = write_page(file, tmp_path / f"{name}.html")
        for place in ("", "#at=1,1&level=1"):
            shown.open(written.path, place)
            assert shown.run("return document.querySelectorAll('#point svg').length") > 0
    shown.open(tmp_path / "failed.html", "#at=1,1&level=1")
    assert "the stiffness matrix is singular" in text_of(shown, "#point")
    assert shown.complaints() == []


SMALL = """
title: A strip
units: none
body: {rectangle: {width: 2, height: 1}}
boundary: {bottom: contact, left: free, top: {role: clamped, u_x: 0.1, u_y: 0}, right: free}
material: {E: 1, nu: 0.3}
friction: {law: slip-weakening, tau_s: 0.05, tau_k: 0.01, delta: 0.02}
mesh: {maxh: 2, levels: 4}
path: {parameter: boundary.top.u_x, from: 0, to: 0.2, at: [0.1]}
"""


def test_files_of_converge_cost_and_path_and_those_beside_a_run(shown: Browser, tmp_path: Path) -> None:
    study = tmp_path / "strip.yaml"
    study.write_text(SMALL, encoding="utf-8")
    write_record(tmp_path / "strip.cost.nc", read_study(study), made(), collect(read_study(study), ["tcstudy"]))
    names = {"run": "strip.nc", "converge": "strip.convergence.nc", "path": "strip-path.nc", "cost": "strip.cost.nc"}
    for command, name in list(names.items())[:3]:
        word, more = ("run", []) if command == "path" else (command, ["--set=path=null"])
        assert main([word, str(study), "--output", str(tmp_path / name), *more]) == 0
    for command, name in names.items():
        shown.open(write_page(tmp_path / name, tmp_path / f"{name}.html").path)
        assert shown.run("return document.querySelectorAll('main svg').length") > 1
        if command == "run":
            assert "Measured convergence" in text_of(shown, "#accuracy")
            assert "Accuracy against cost" in text_of(shown, "#accuracy")
    assert shown.complaints() == []


def test_sliders_solve_again(shown: Browser, live_page: Path) -> None:
    move = (
        "const slider = document.querySelector(`input[aria-label='${arguments[0]}']`); slider.value = arguments[1];"
        "slider.dispatchEvent(new Event('input')); TC.live.show(TC.live.point);"
        "return TC.live.answer && Math.max(...TC.live.answer.v);"
    )
    shown.open(live_page, "#mode=live&at=0,0")
    assert "only solution" in text_of(shown, "main")
    before = shown.run("return Math.max(...TC.live.answer.v)")
    pulled = shown.run(move, "loads ×", 400)
    assert pulled > before
    shown.run("return new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))")  # the address
    assert fragment(shown)["set"] == "3,1,1"
    assert shown.run(move, "friction ×", 400) < pulled
    assert shown.run("return TC.live.answer.residual") < 1e-10
    shown.open(live_page, "#mode=live&at=0,1&set=1,1,0.125")
    assert "not solved here" in text_of(shown, "main")
    assert shown.run("return TC.live.answer") is None
    assert shown.complaints() == []


@pytest.fixture(scope="module")
def live_page(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("live") / "block.nc"
    execute(read_study_text(STUDY, "block", ["output.live=true"]), path)
    return write_page(path, path.with_suffix(".html")).path


FILMS = """
title: Two films
body: {outline: [{from: [0, 0], edge: film}, {from: [1, 0], edge: shoe}, {from: [2, 0], edge: grip},
                 {from: [2, 0.2], edge: top}, {from: [0, 0.2], edge: tail}]}
boundary: {film: contact, shoe: contact, grip: {role: clamped, u_x: 1 mm, u_y: free}, top: free, tail: free}
material: {E: 10 GPa, nu: 0}
friction: {film: {law: tresca, tau: 2 MPa, strength: "min(1, max(0, 2*x - 0.5))"}, shoe: {law: tresca, tau: 1 MPa}}
mesh: {maxh: 0.2}
"""


def test_every_edge_has_its_law_with_its_own_nodes(browser: Browser, tmp_path: Path) -> None:
    file = tmp_path / "films.nc"
    execute(read_study_text(FILMS), file)
    browser.open(write_page(file, file.with_suffix(".html")).path)
    count = """return [...document.querySelectorAll('#point h3')].filter((h) => h.textContent.startsWith('Friction'))
        .map((h) => [h.textContent, h.parentElement.querySelectorAll('[fill-opacity]').length,
                     h.parentElement.nextSibling.textContent])"""
    film, shoe = browser.run(count)
    assert film[0].startswith("Friction law of film (tresca)")
    assert shoe[0].startswith("Friction law of shoe (tresca)")
    assert "divided by the strength" in film[2]
    x = np.array(browser.run("return Array.from(Object.values(TC.data.lines)[0].x)"))
    # the node where they meet has parts of both laws, and is not drawn
    own = (x < 1 - 1e-9) & (x > 0.25 + 1e-9), x > 1 + 1e-9
    assert (film[1], shoe[1]) == tuple(np.count_nonzero(nodes) for nodes in own)
    assert browser.complaints() == []
