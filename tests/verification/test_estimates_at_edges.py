"""Errors estimated in energy at edges that rest on springs, are rigid, have laws of their own, and across materials."""

from __future__ import annotations

import pytest

from tcstudy.contact.solve import solve_contact
from tcstudy.read.study import read_study_text
from tcstudy.refine.family import ErrorEstimator
from tcstudy.study.reference import FineReference, solve_levels
from tests.verification.scenes import levels_of

SPRINGS = """
units: none
body: {rectangle: {width: 2, height: 1}}
boundary: {bottom: contact, left: {role: clamped, u_x: 0}, top: free, right: RIGHT}
material: {E: 4, nu: 0, plane: stress}
friction: {law: linear, k: 0}
mesh: {maxh: 0.5, levels: LEVELS, estimate: true}
"""


@pytest.mark.parametrize(
    "right",
    ["{role: traction, g: [0.1, 0], spring: {normal: 3}}", "{role: rigid, u_y: 0, force: [0.1, 0]}"],
)
def test_no_error_is_estimated_of_a_bar_that_is_exact_on_its_spring(right: str) -> None:
    """σ = g − k u at the end, constant: P1 is exact, and so is the estimate; springs left out would leave k u."""
    study = read_study_text(SPRINGS.replace("RIGHT", right).replace("LEVELS", "1"))
    level, scene = levels_of(study)[0], study.scenes[0]
    condensed = level.condensed(scene)
    estimator = ErrorEstimator(level, study.mesh)
    assert estimator.look((), scene, solve_contact(condensed.problem).v)["error_estimate"] < 1e-10


LAYERS = """
units: none
body: {rectangle: {width: 2, height: 1}, regions: {lower: {rectangle: {corner: [0, 0], width: 2, height: 0.4}}}}
boundary: {bottom: contact, left: {role: clamped, u_x: 0}, top: {role: traction, g: [0.02, -0.03]}, right: free}
material: {E: 4, nu: 0.3, alpha_T: 0.01}
materials: {lower: {E: 0.1, nu: 0.3, alpha_T: 0.02}}
heat: {theta: "0.5 + 0.2*x"}
friction: {law: linear, k: 0.5}
mesh: {maxh: 0.25, levels: 4, estimate: true}
"""
"""A recovery across the interface would take the jump of the stress for an error of order h^1/2."""


def on(right: str, friction: str) -> str:
    """The bar with another end and film."""
    text = SPRINGS.replace("RIGHT", right).replace("LEVELS", "4").replace("{law: linear, k: 0}", friction)
    return text.replace("top: free", "top: contact") if "strength" in text else text


@pytest.mark.parametrize(
    "text",
    [
        LAYERS,
        on('{role: traction, g: ["0.3*y", 0.1], spring: {normal: 0.5, tangential: 2}}', "{law: linear, k: 0.5}"),
        on(
            "{role: traction, g: [0.05, 0]}",
            "{bottom: {law: linear, k: 1, strength: 1 + x}, top: {law: linear, k: 3}}",
        ),
        on("{role: rigid, u_y: 0, force: [0.1, 0]}", "{law: linear, k: 0.5}"),
    ],
    ids=["layers", "springs", "laws by edge", "rigid"],
)
def test_estimates_against_the_finest_of_nested_levels(text: str) -> None:
    study = read_study_text(text)
    levels, scene = solve_levels(study, lambda line: None), study.scenes[0]
    reference = FineReference(levels[-1])
    for number, level in enumerate(levels_of(study)[:2]):
        v = solve_contact(level.condensed(scene).problem).v
        found = ErrorEstimator(level, study.mesh).look((), scene, v)["error_estimate"]
        error, size = reference.errors(levels[number], (), scene)["u_energy"]
        assert 0.9 < found * size / error < 1.35
