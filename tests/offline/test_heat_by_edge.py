"""Heat by edge: temperatures, fluxes and exchange of an edge by itself, against closed forms and a plain solve."""

from __future__ import annotations

import numpy as np
import pytest

from tcstudy.contact.contact import solve_contact
from tcstudy.fem.geometry import build
from tcstudy.offline import conduction
from tcstudy.offline.level import Level
from tcstudy.refine.error_estimator import ErrorEstimator
from tcstudy.scene.records import Scene
from tests.verification.scenes import HEATED_BRACKET, levels_of, mesh_family, study_of

SLAB = """
units: none
body: {rectangle: {width: 2, height: 0.5}}
boundary: {bottom: contact, left: LEFT, right: RIGHT, top: free}
material: {E: 1, nu: 0.3, k: 4, alpha_T: 1e-3}
friction: {law: tresca, tau: 1e-4}
mesh: {maxh: 0.25}
"""
HELD, FLUX = "{role: clamped, heat: {theta: 80}}", "{role: clamped, heat: {flux: 30}}"
HOT, COLD = "{role: clamped, heat: {alpha: 5, theta_bar: 90}}", "{role: convection, alpha: 2, theta_bar: 20}"
HELD_TOO = "{role: traction, pressure: 0.1, heat: {theta: 20}}"
R = 2.0 / 4.0
"""Resistance of the slab, L/k."""


def slab(left: str, right: str) -> tuple[Scene, Level]:
    study = study_of(SLAB.replace("LEFT", left).replace("RIGHT", right))
    return study.scenes[0], levels_of(study)[0]


@pytest.mark.parametrize(
    ("left", "right", "flow", "at_left"),
    [
        (HELD, COLD, 60 / (R + 1 / 2), 80.0),
        (HELD, HELD_TOO, 60 / R, 80.0),
        (FLUX, COLD, 30.0, 20 + 30 * (R + 1 / 2)),
        (FLUX, HELD_TOO, 30.0, 20 + 30 * R),
        (HOT, COLD, 70 / (R + 1 / 2 + 1 / 5), 90 - 70 / (R + 1 / 2 + 1 / 5) / 5),
        (HOT, HELD_TOO, 70 / (R + 1 / 5), 90 - 70 / (R + 1 / 5) / 5),
        (HOT, "{role: convection, alpha: 2, theta_bar: 90}", 0.0, 90.0),
        ("{role: clamped, heat: {theta: 90}}", "{role: convection, alpha: 2, theta_bar: 90}", 0.0, 90.0),
        ("clamped", "{role: convection, alpha: 2, theta_bar: 20, flux: 40}", 0.0, 40.0),
    ],
)
def test_slab_in_series(left: str, right: str, flow: float, at_left: float) -> None:
    """The field is linear, so that P1 has it exactly; heat in is heat out."""
    scene, level = slab(left, right)
    found = level.temperature(scene)
    assert found.theta == pytest.approx(at_left - flow / 4 * level.mesh.points[:, 0], abs=1e-12 * 90)
    assert found.mean == pytest.approx(at_left - flow / 4, rel=1e-13)
    assert not found.heat_balance > 1e-14  # NaN where nothing flows


ALL_KINDS = """
boundary:
  slope: {role: contact, heat: {flux: "0.3 + x"}}
  curve: {role: contact, heat: {alpha: 0.01, theta_bar: "1 + y"}}
  right: {role: convection, alpha: 40, theta_bar: 2, flux: 0.1}
  top: {role: clamped, u: [0.002, "-0.001*x"], heat: {theta: "1 - 0.2*x"}}
  left: {role: traction, g: [0.02, -0.01], heat: {theta: 1}}
  bore: convection
"""
NONE_HELD = ALL_KINDS.replace(', heat: {theta: "1 - 0.2*x"}', "").replace("{theta: 1}", "{theta_bar: 3}")
START = HEATED_BRACKET.index("boundary:")
END = HEATED_BRACKET.index("material:")


def bracket(kinds: str) -> str:
    return HEATED_BRACKET[:START] + kinds.strip() + "\n" + HEATED_BRACKET[END:]


def counted(monkeypatch: pytest.MonkeyPatch, *changes: str) -> tuple[int, Level]:
    """How many sets of modes a sweep of the bracket needs."""
    calls = []
    original = conduction.modes
    monkeypatch.setattr(conduction, "modes", lambda *args: calls.append(1) or original(*args))  # type: ignore[func-returns-value]
    text = bracket(NONE_HELD).replace("0.01,", '"h/80",').replace("40,", '"50*h",')
    study = study_of(text + "parameters: {h: 0.8}\n", *changes)
    mesh = next(mesh_family(build(study.scenes[0].body), study.mesh))
    level = Level(mesh, study.scenes[0], study.scenes)
    for scene in study.scenes:
        level.condensed(scene)
    return len(calls), level


def test_alpha_whose_ratios_are_kept_share_one_set_of_modes(monkeypatch: pytest.MonkeyPatch) -> None:
    """Named by one parameter, all α vary together; one that varies by itself asks for modes of its own."""
    together = ["heat.alpha=h", "sweep={parameters.h: {geomspace: [0.01, 100, 12]}}"]
    apart = ["heat.alpha=h", "sweep={boundary.curve.heat.alpha: [1, 2, 3]}"]
    assert counted(monkeypatch, *together)[0] == 1
    assert counted(monkeypatch, *apart)[0] == 3


def test_what_edges_say_like_the_section_is_the_same_study() -> None:
    """Also for estimated errors, of a goal too; a held temperature is the limit of a large α."""
    own = "{role: convection, alpha: 0.8, theta_bar: 0.2, g: [0.01, 0]}"
    plain = '{role: convection, g: [0.01, "0.02*y"], pressure: 0.03}'
    changed = HEATED_BRACKET.replace('"0.2 + 0.1*x"', "0.2").replace(plain, "{role: convection, g: [0.01, 0]}")
    same = changed.replace("{role: convection, g: [0.01, 0]}", own)
    assert study_of(same).scenes[0].heat_by_edge
    assert not study_of(changed).scenes[0].heat_by_edge
    first, second = (looked(text) for text in (changed, same))
    assert second == pytest.approx(first, rel=1e-11)
    held, large = ("{role: traction, g: [0.02, -0.01], heat: " + one + "}" for one in
                   ("{theta: 1}", "{alpha: 1e9, theta_bar: 1}"))  # fmt: skip
    first, second = (looked(changed.replace("{role: traction, g: [0.02, -0.01]}", one)) for one in (held, large))
    assert second == pytest.approx(first, rel=2e-4)  # of α, the boundary has a residual, too


def looked(text: str) -> list[float]:
    """Load, energy, and estimated errors of a study on its coarse mesh."""
    study = study_of(text, "mesh={maxh: 0.5, levels: 2, estimate: true, goal: friction_resultant}")
    scene, level = study.scenes[0], levels_of(study)[0]
    condensed = level.condensed(scene)
    answer = solve_contact(condensed.problem)
    found = ErrorEstimator(level, study.mesh).look((), scene, answer.v)
    return [float(np.abs(condensed.problem.l_tilde).sum()), condensed.constant, *map(float, found.values())]
