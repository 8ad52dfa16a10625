"""Pages in a real browser: they draw without complaint, obey mouse and keys, keep their state in
the address; and where ω < λ₁ the live mode gives the answers of tcstudy."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import tcstudy
from tcstudy.cli import main
from tcstudy.contact.problem import ContactProblem
from tcstudy.data.files import collect
from tcstudy.data.store import write_record
from tcstudy.laws.laws import Laws
from tcstudy.laws.shapes import LENGTH, SHAPES, STIFFNESS, TRACTION
from tcstudy.offline.level import Level
from tcstudy.read.study import read_study, read_study_text
from tcstudy.refine.family import Family
from tcstudy.reports.figures.point import CURVE, JUMPS
from tcstudy.reports.page.write import write_page
from tcstudy.scene.records import Convection, Traction
from tcstudy.scene.study import Study
from tests.reports.conftest import CONFIGS, REASON, Stored
from tests.reports.page.browser import Browser, fragment, missing, text_of
from tests.reports.terminal.test_cost import made

pytestmark = [pytest.mark.browser, pytest.mark.skipif(bool(missing()), reason=missing())]


def shown(browser: Browser, file: Path, place: str = "") -> Browser:
    browser.size(1280, 1000)
    browser.open(write_page(file, file.with_suffix(".html")).path, place)
    return browser


def click(browser: Browser, selector: str) -> None:
    event = "new MouseEvent('click', {bubbles: true})"
    browser.run(f"document.querySelector(arguments[0]).dispatchEvent({event})", selector)


def saved(browser: Browser, button: str) -> list[str]:
    """The lines of what a button downloads, after the name."""
    browser.run("TC.save = (name, text) => { window.saved = name + '\\r\\n' + text; };")
    click(browser, button)
    return str(browser.run("return window.saved")).strip().split("\r\n")


@pytest.mark.parametrize(
    # of studies that have parts of their own, and what is changed so that they take a second or two
    "words",
    ["coated_block mesh.levels=1", "cyclic_pull", "isola", "ring mesh.levels=1", "spring_rail", "two_films",
     "welded_rail mesh.maxh=344mm"],
)  # fmt: skip
def test_the_page_of_a_shipped_study_is_drawn(words: str, browser: Browser, tmp_path: Path) -> None:
    name, *changes = words.split()
    file, changes = tmp_path / f"{name}.nc", [f"--set={one}" for one in changes]
    assert main(["run", str(CONFIGS / f"{name}.yaml"), *changes, "-q", f"--output={file}"]) == 0
    page = shown(browser, file)
    assert page.run("return document.querySelectorAll('#main svg path').length") > 4
    assert page.run(
        "return [...document.querySelectorAll('#main > div')].every((part) => part.innerText.length)"
    )
    assert page.complaints() == []


OBJECTS = """
title: /*scripts*/
units: none
body: {rectangle: {width: 2, height: 1, edges: {bottom: constructor, left: toString,
                                                top: __proto__, right: hasOwnProperty}}}
boundary: {constructor: contact, toString: clamped, __proto__: {role: traction, g: [0.02, 0]},
           hasOwnProperty: free}
material: {E: 1, nu: 0.3}
friction: {law: tresca, tau: valueOf}
parameters: {valueOf: 0.01}
mesh: {maxh: 0.5, levels: 2}
sweep: {parameters.valueOf: [0.005, 0.01]}
output: {probes: {isPrototypeOf: [1, 0.5]}, fields: true}
"""


def test_names_of_objects_of_the_scripts_are_names(browser: Browser, tmp_path: Path) -> None:
    tcstudy.run(read_study_text(OBJECTS), tmp_path / "run.nc", jobs=1)
    page = shown(browser, tmp_path / "run.nc")
    assert text_of(page, "h1") == "/*scripts*/"
    edges = (
        "return [...document.querySelectorAll('#point svg text.soft')].map((t) => t.textContent)"
    )
    assert {"constructor", "toString", "__proto__", "hasOwnProperty"} <= set(page.run(edges))
    assert "valueOf = 0.005" in text_of(page, "#point")
    click(page, "#help")
    click(page, "#keys button")
    assert page.run("return document.getElementById('keys').open") is False
    assert page.complaints() == []


def test_curves_name_their_parameter_and_mark_several_solutions(
    browser: Browser, tmp_path: Path
) -> None:
    file = tmp_path / "run.nc"
    sweep = "sweep: {friction.tau_s: {geomspace: [0.05, 0.2, 3]}, E: [1, 2]}\n"
    tcstudy.run(read_study_text(SMALL.replace("levels: 4", "levels: 1") + sweep), file, jobs=1)
    page = shown(browser, file, "#x=tau_s&by=E")
    several = page.run("""return [...TC.data.run.flags.several]""")
    assert "E = 1" in text_of(page, "#sweep")
    marks = "return document.querySelectorAll('#sweep .panel:last-child path[stroke=\"#d55e00\"]')"
    assert page.run(f"{marks}.length") >= sum(several)
    page.run("TC.data.run.flags.several.fill(1); TC.draw()")
    assert "starting points gave different solutions" in text_of(page, "#sweep .legend:last-child")
    assert page.complaints() == []


def test_a_run_obeys_clicks_keys_and_its_address(browser: Browser, stored: Stored) -> None:
    page = shown(browser, stored("block"), "#x=theta_bar&y=friction")
    assert "6 of 6 points" in text_of(page, "#verdict")
    click(page, '[data-point="1"]')
    assert fragment(page)["at"] == "0,1"
    assert "θ̄ = 0 K, friction: weak" in text_of(page, "#point")
    page.run("document.querySelector('#sweep svg[tabindex]').focus()")
    for key in ("ArrowRight", "ArrowRight", "[", "c"):
        page.press(key)
    assert {key: fragment(page)[key] for key in ("at", "level", "vs")} == {
        "at": "2,1",
        "level": "0",
        "vs": "2,1",
    }
    html = stored("block").with_suffix(".html")
    page.open(html, "#q=slip_length&at=2,1&vs=0,0&level=0&theme=dark")
    assert "slip length" in text_of(page, "#sweep h3")
    assert "dashed: θ̄ = 0 K, friction: plain" in text_of(page, "#point")
    page.open(html, "#q=none&at=9,9&level=-3&x=nothing&vs=1&sort=x")
    first = "return document.querySelector('#table tbody tr').innerText"
    click(page, "#table th:nth-child(3) button")
    least = page.run(first)
    click(page, "#table th:nth-child(3) button")
    assert page.run(first) != least
    name, head, *rows = saved(page, "#table [aria-label=csv]")
    assert (name, len(rows)) == ("block-level1.csv", 6)
    assert head.startswith("theta_bar [K],friction,u_T_max [m]")
    for other in ("failed", "listed", "single"):
        page = shown(browser, stored(other), "#at=2,1&level=1")
        assert page.run("return document.querySelectorAll('#point svg').length") > 0
        assert (REASON in text_of(page, "#point")) == (other == "failed")
    assert page.complaints() == []


def test_sliders_solve_again(browser: Browser, stored: Stored) -> None:
    page = shown(browser, stored("block"), "#mode=live&at=0,0")
    move = (
        "const slider = document.querySelector(`input[aria-label='${arguments[0]}']`); slider.value = arguments[1];"
        "slider.dispatchEvent(new Event('input')); TC.live.show(TC.live.point);"
        "return TC.live.answer && Math.max(...TC.live.answer.v);"
    )
    assert "only solution" in text_of(page, "main")
    before = page.run("return Math.max(...TC.live.answer.v)")
    pulled = page.run(move, "loads ×", 400)
    assert pulled > before
    page.run(
        "return new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))"
    )  # the address
    assert fragment(page)["set"] == "3,1,1"
    assert page.run(move, "friction ×", 400) < pulled
    page.open(stored("block").with_suffix(".html"), "#mode=live&at=0,1&set=1,1,0.125")
    assert "not solved here" in text_of(page, "main")
    assert page.run("return TC.live.answer") is None
    assert page.complaints() == []


def test_every_equilibrium_of_a_point_can_be_looked_at(browser: Browser, tmp_path: Path) -> None:
    changes = [
        "friction={law: piecewise-linear, points: [[0, 25 MPa], [15 um, 25 MPa], [15 um, 5 MPa]]}",
        "sweep={boundary.end.g: [[12 MPa, 0], [16 MPa, 0]], theta_bar: [0 K, 10 K]}",
        *("mesh.levels=1", "output.fields=false", "solver.branch=all"),
    ]
    tcstudy.run(read_study(CONFIGS / "quickstart.yaml", changes), tmp_path / "all.nc")
    page = shown(browser, tmp_path / "all.nc", "#at=0,1&q=solutions")
    assert "3 of 3 equilibria, proved" in text_of(page, "#point")
    curve = '[aria-label="slip along the contact line"] path[stroke]'
    slip = f"return document.querySelector('{curve}').getAttribute('d')"
    lowest = page.run(slip)
    click(page, '[aria-label="equilibrium 2"]')
    assert fragment(page)["eq"] == "2"
    assert page.run(slip) != lowest
    click(page, '[data-point="0"]')
    assert "9 of 9 equilibria, proved" in text_of(page, "#point")
    assert (fragment(page)["eq"], page.complaints()) == ("0", [])


SMALL = """
title: A strip
units: none
body: {rectangle: {width: 2, height: 1}}
boundary: {bottom: contact, left: free, top: {role: clamped, u_x: 0.1, u_y: 0}, right: free}
material: {E: 1, nu: 0.3}
friction: {law: slip-weakening, tau_s: 0.05, tau_k: 0.01, delta: 0.02}
mesh: {maxh: 2, levels: 4}
"""


def test_files_of_converge_and_cost(browser: Browser, tmp_path: Path) -> None:
    study = tmp_path / "strip.yaml"
    study.write_text(SMALL, encoding="utf-8")
    files = {
        word: tmp_path / f"strip{end}.nc"
        for word, end in (("run", ""), ("converge", ".convergence"))
    }
    for command, file in files.items():
        assert main([command, str(study), "--output", str(file)]) == 0
    files["cost"] = tmp_path / "strip.cost.nc"
    write_record(files["cost"], read_study(study), made(), collect(read_study(study), ["tcstudy"]))
    for command, file in files.items():
        page = shown(browser, file)
        assert page.run("return document.querySelectorAll('main svg').length") > 1, command
    assert browser.complaints() == []


def test_every_edge_has_its_law_with_its_own_nodes(browser: Browser, stored: Stored) -> None:
    """The node where they meet has parts of both laws, and is not drawn."""
    page = shown(browser, stored("films"))
    drawn = page.run("""return [...document.querySelectorAll('#point h3')]
        .filter((h) => h.textContent.startsWith('Friction law of'))
        .map((h) => [h.textContent.split(' ')[3], h.parentElement.querySelectorAll('[fill-opacity]').length])""")
    x = np.array(page.run("return Array.from(Object.values(TC.data.lines)[0].x)"))
    own = {"film": (x < 1 - 1e-9) & (x > 0.25 + 1e-9), "shoe": x > 1 + 1e-9}
    assert (dict(drawn), page.complaints()) == (
        {edge: np.count_nonzero(nodes) for edge, nodes in own.items()},
        [],
    )


def test_laws_have_the_looks_of_the_pictures(browser: Browser, stored: Stored) -> None:
    page = shown(browser, stored("films"))
    legends, widths = page.run("""
        const plots = [...document.querySelectorAll('#point h3')]
            .filter((h) => h.textContent.startsWith('Friction law of')).map((h) => h.parentElement);
        return [plots.map((plot) => plot.querySelector('.legend')?.textContent ?? ''),
                plots.map((plot) => [...plot.querySelectorAll('[stroke-width]')]
                    .map((node) => Number(node.getAttribute('stroke-width'))))]""")
    up_jump, down_jump = JUMPS
    assert all(up_jump[1] in legend for legend in legends)
    assert not any(down_jump[1] in legend for legend in legends)
    assert all(pytest.approx(1.5 * up_jump[2]["linewidth"]) in of_plot for of_plot in widths)
    assert all(pytest.approx(1.5 * CURVE["linewidth"]) in of_plot for of_plot in widths)
    assert page.complaints() == []


def test_a_history_shows_sweep_loop_steps_and_energies(browser: Browser, stored: Stored) -> None:
    page = shown(browser, stored("history"))
    assert "step: 16, back" in text_of(page, "#point")
    page.press("[")
    assert fragment(page)["step"] == "15"
    click(page, '[data-point="2"]')
    assert fragment(page)["at"] == "1,0"
    _, head, *rows = saved(page, "#steps [aria-label='csv']")
    assert (head[:27], len(rows)) == ("step,cycle,step_name,theta,", 17)
    page.open(
        stored("history").with_suffix(".html"), "#yof=dissipated&xof=step&step=3&at=2,1&theme=dark"
    )
    assert "\ndissipated over step\n" in text_of(page, "#steps")
    assert page.complaints() == []


def test_a_geometry_is_chosen_and_its_body_and_line_are_drawn(
    browser: Browser, stored: Stored
) -> None:
    page = shown(browser, stored("pads"), "#at=0,0&x=height&y=u_x")
    high = "return TC.point.panel.frame.high"
    before = page.run(high)
    page.run("document.querySelector('#sweep svg[tabindex]').focus()")
    page.press("ArrowRight")
    page.press("ArrowRight")
    assert (page.run(high), page.complaints()) == (pytest.approx(4.0 * before), [])


def test_a_fit_shows_its_data_numbers_and_law(browser: Browser, stored: Stored) -> None:
    page = shown(browser, stored("fit"), "#step=4")
    page.press("]")
    assert fragment(page)["step"] == "5"
    assert page.run("return document.querySelectorAll('#fit svg .mark').length") >= 120
    _, head, *rows = saved(page, "#table [aria-label=csv]")
    assert (
        head == "datum,boundary.grip.u_x [m],value [N m-1],predicted [N m-1],noise [N m-1],residual"
    )
    assert (len(rows), page.complaints()) == (60, [])


@pytest.mark.parametrize(("width", "media"), [(390, ""), (1280, ""), (720, "print")])
def test_nothing_sticks_out_of_screen_or_paper(
    browser: Browser, stored: Stored, width: int, media: str
) -> None:
    browser.command("Emulation.setEmulatedMedia", media=media)
    try:
        for name in ("block", "history", "pads", "fit"):
            page = stored(name).with_suffix(".html")
            browser.size(width, 900, phone=width < 500)
            browser.open(
                page if page.exists() else write_page(stored(name), page).path,
                "#theme=dark" if media else "",
            )
            assert browser.run("return document.documentElement.scrollWidth") <= width, name
        if media:
            assert (
                browser.run("return getComputedStyle(document.body).backgroundColor")
                == "rgb(255, 255, 255)"
            )
    finally:
        browser.command("Emulation.setEmulatedMedia", media="")
    assert browser.complaints() == []


# -- the live mode
# -----------------------------------------------------------------------------------------------------

PLATE = """
title: A plate in sloping surroundings
units: none
body: {rectangle: {width: 2, height: 1}}
boundary: {bottom: contact, left: {role: clamped, u_x: 0.02, u_y: 0}, top: convection,
           right: {role: traction, pressure: -0.05}}
material: {E: 1, nu: 0.3, k: 1, alpha_T: 0.05}
heat: {alpha: 2, theta_bar: "1 + x", q: 0.5}
friction: {law: tresca, tau: 0.03}
mesh: {maxh: 0.3, levels: 2}
sweep: {alpha: [4, 0.5], friction: {teeth: {law: saw-tooth, tau: 0.03, delta: 0.02, teeth: 3, drop: 0.6, decay: 0.8},
        spring: {law: linear, k: 0.3}, bond: {law: bilinear, tau: 0.03, s0: 0.02, sf: 0.3},
        decay: {law: exponential, a: 0.03, b: 0.01, delta: 0.2},
        shelf: {law: piecewise-linear, points: [[0, 0.02], [0.05, 0.04], [0.05, 0.01], [0.2, 0.02]], slope: 0.01}}}
output: {live: true}
"""
SETTINGS, AGREEMENT = 100, 1e-10

SOLVE = """
TC.live.setup();
return arguments[0].map(({point, set}) => {
  if (!TC.live.unique(point, set)) return null;
  const answer = TC.solve(TC.live.problem(point, set));
  return {...answer, v: Array.from(answer.v), xi: null};
});
"""


def scaled(law: Laws, f: float, g: float) -> Laws:
    """The law f b(s / g), made anew from its parameters."""
    shape, by = SHAPES[law.made.shape], {TRACTION: f, STIFFNESS: f / g, LENGTH: g}
    factors = {one.name: by.get(one.dimension, 1.0) for one in shape.parameters}
    values = {
        name: v * factors[name] if isinstance(v, float) else v
        for name, v in law.made.values.items()
    }
    if "points" in values:
        values["points"] = [(s * g, b * f) for s, b in values["points"]]
    return shape.build(**values)


def settings(study: Study, level: Level) -> Iterator[tuple[int, dict[str, float], ContactProblem]]:
    """Random places of all sliders; the problem is made by the study's own code, not from what the
    page holds."""
    random = np.random.default_rng(11)
    for _ in range(SETTINGS):
        point, load = int(random.integers(len(study.scenes))), float(random.uniform(-1.0, 2.0))
        f, g = float(np.exp(random.uniform(-0.7, 0.7))), float(np.exp(random.uniform(-0.4, 1.0)))
        scene = study.scenes[point]
        boundary = tuple(
            (name, replace(role, g=(load * role.g[0], load * role.g[1]), pressure=load * role.pressure)
             if isinstance(role, Traction | Convection) else role) for name, role in scene.boundary
        )  # fmt: skip
        changed: Any = replace(scene, boundary=boundary, friction=scaled(scene.friction, f, g))
        yield point, {"load": load, "strength": f, "slip": g}, level.condensed(changed).problem


def test_answers_agree_with_tcstudy(browser: Browser, tmp_path: Path) -> None:
    study = read_study_text(PLATE)
    tcstudy.run(study, tmp_path / "study.nc")
    shown(browser, tmp_path / "study.nc", "#mode=live")
    family = Family(study)
    mesh = [family.next(i) for i in range(study.mesh.levels)][-1]
    cases = list(settings(study, Level(mesh, study.scenes[0], study.scenes)))
    answers = browser.run(SOLVE, [{"point": point, "set": told} for point, told, _ in cases])
    solved = 0
    for (_, _, p), answer in zip(cases, answers, strict=True):
        own = tcstudy.solve(tcstudy.ContactProblem(p.A_tilde, p.l_tilde, p.c, p.law))
        steep = p.law.omega / p.lambda_1
        assert (answer is not None) == (steep < 1.0) or abs(steep - 1.0) < 1e-5
        if answer is None:
            continue
        solved += 1
        assert answer["converged"]
        assert np.max(np.abs(np.array(answer["v"]) - own.v)) <= AGREEMENT * np.max(np.abs(own.v))
        assert answer["residual"] <= AGREEMENT
    assert solved >= SETTINGS // 5
    assert browser.complaints() == []


# -- contact that may open


@pytest.mark.parametrize(
    ("name", "headings"),
    [
        ("curl", ["Gap to the foundation", "Slip and friction along base"]),
        ("arm", ["Gap to the foundation", "Law of the opening of bond"]),
        ("pressed", ["Gap to the foundation", "Friction law (coulomb)"]),
    ],
)
def test_pages_of_openings_show_gaps_normal_stresses_and_laws(
    browser: Browser, stored: Stored, name: str, headings: list[str]
) -> None:
    page = shown(browser, stored(name))
    point = text_of(page, "#point")
    assert all(heading in point for heading in headings)
    gap = '#point svg[aria-label="opening along the contact line"] path'
    assert page.run(f"return document.querySelectorAll('{gap}').length") > 0
    assert page.complaints() == []


@pytest.mark.parametrize("name", ["lifted", "raised"])
def test_states_of_paths_and_histories_show_openings(
    browser: Browser, stored: Stored, name: str
) -> None:
    page = shown(browser, stored(name))
    assert "Gap to the foundation" in text_of(page, "#main")
    assert page.complaints() == []
