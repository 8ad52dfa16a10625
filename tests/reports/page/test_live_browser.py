"""The live mode in a real browser gives the answers of tcstudy where ω < λ₁, at random places of all sliders."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import tcstudy
from tcstudy.contact.problem import ContactProblem
from tcstudy.laws.laws import Laws
from tcstudy.laws.shapes import LENGTH, SHAPES, STIFFNESS, TRACTION
from tcstudy.offline.level import Level
from tcstudy.read.study import read_study_text
from tcstudy.refine.family import Family
from tcstudy.reports.page.write import write_page
from tcstudy.scene.records import Convection, Traction
from tcstudy.scene.study import Study
from tcstudy.study.run import execute
from tests.reports.page.browser import Browser, missing

pytestmark = [pytest.mark.browser, pytest.mark.skipif(bool(missing()), reason=missing())]

PAD = """
title: A pad pushed sideways
body: {outline: [{from: [0, 0], edge: film}, {from: [120 mm, 0], edge: bevel}, {from: [100 mm, 20 mm], edge: plate},
                 {from: [0, 20 mm], edge: back}]}
boundary: {film: contact, plate: {role: clamped, u_x: 0.8 mm, u_y: 0 mm}, bevel: free,
           back: {role: traction, g: [1 kPa, 0]}}
material: {E: 5 MPa, nu: 0.4}
friction: {law: slip-weakening, tau_s: 100 kPa, tau_k: 20 kPa, delta: 0.4 mm}
mesh: {maxh: 6 mm, levels: 2}
sweep: {mode: zip, boundary.plate.u_x: [0.8 mm, 1.5 mm], E: [5 MPa, 8 MPa],
        friction: {weak: {law: slip-weakening, tau_s: 100 kPa, tau_k: 20 kPa, delta: 0.4 mm},
                   decay: {law: exponential, a: 90 kPa, b: 30 kPa, delta: 0.3 mm}}}
output: {live: true}
"""
PLATE = """
title: A plate in sloping surroundings
units: none
body: {rectangle: {width: 2, height: 1}}
boundary: {bottom: contact, left: clamped, top: convection, right: {role: traction, pressure: -0.05}}
material: {E: 1, nu: 0.3, k: 1, alpha_T: 0.05}
heat: {alpha: 2, theta_bar: "1 + x", q: 0.5}
friction: {law: saw-tooth, tau: 0.03, delta: 0.02, teeth: 3, drop: 0.6, decay: 0.8}
mesh: {maxh: 0.2, levels: 3}
sweep: {alpha: [4, 0.5], friction: {teeth: {law: saw-tooth, tau: 0.03, delta: 0.02, teeth: 3, drop: 0.6, decay: 0.8},
        spring: {law: linear, k: 0.3}, bond: {law: bilinear, tau: 0.03, s0: 0.02, sf: 0.3},
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
    assert law.made is not None
    by = {TRACTION: f, STIFFNESS: f / g, LENGTH: g}
    values = dict(law.made.values)
    for key in SHAPES[law.made.shape].parameters:
        if values.get(key.name) is not None and key.dimension in by:
            values[key.name] *= by[key.dimension]
    if "points" in values:
        values["points"] = [(s * g, b * f) for s, b in values["points"]]
    return SHAPES[law.made.shape].build(**values)


def settings(study: Study, level: Level, seed: int) -> Iterator[tuple[int, dict[str, float], ContactProblem]]:
    """Random places of all sliders; the problem is made by the study's own code, not from what the page holds."""
    random = np.random.default_rng(seed)
    for _ in range(SETTINGS):
        point, load = int(random.integers(len(study.scenes))), float(random.uniform(-1.0, 2.0))
        f, g = float(np.exp(random.uniform(-0.7, 0.7))), float(np.exp(random.uniform(-0.4, 1.0)))
        scene = study.scenes[point]

        def pulled(role: Any, load: float = load) -> Any:
            if not isinstance(role, Traction | Convection):
                return role
            return replace(role, g=(load * role.g[0], load * role.g[1]), pressure=load * role.pressure)

        boundary = tuple((name, pulled(role)) for name, role in scene.boundary)
        changed = replace(scene, boundary=boundary, friction=scaled(scene.friction, f, g))
        yield point, {"load": load, "strength": f, "slip": g}, level.condensed(changed).problem


@pytest.mark.parametrize("text", [PAD, PLATE], ids=["pad", "plate"])
def test_answers_agree_with_tcstudy(text: str, browser: Browser, tmp_path: Path) -> None:
    """On a pad that lets go and a plate with teeth."""
    study = read_study_text(text)
    execute(study, tmp_path / "study.nc")
    written = write_page(tmp_path / "study.nc", tmp_path / "study.html")
    assert written.size <= 2_000_000
    browser.open(written.path, "#mode=live")
    family = Family(study)
    meshes = [family.next(i) for i in range(study.mesh.levels)]
    cases = list(settings(study, Level(meshes[-1], study.scenes[0], study.scenes), seed=11))
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
