"""Temperatures against closed forms, by edge and as one section, for many α at once, and on thin
triangles."""

import numpy as np
import pytest

from tcstudy.condense import Condensation
from tcstudy.contact.solve import solve_contact
from tcstudy.data.schema import HEAT_BOUND
from tcstudy.fem.geometry import build
from tcstudy.offline import heat as heat_factor
from tcstudy.offline.level import Level
from tcstudy.refine.family import ErrorEstimator
from tcstudy.scene.records import Scene
from tests.benchmarks.cases import layered
from tests.verification.scenes import HEATED_BRACKET, levels_of, study_of

SLAB = """
units: none
body: {rectangle: {width: 2, height: 0.5}}
boundary: {bottom: contact, left: LEFT, right: RIGHT, top: free}
material: {E: 1, nu: 0.3, k: 4, alpha_T: 1e-3}
friction: {law: tresca, tau: 1e-4}
mesh: {maxh: 0.25}
"""
HELD, FLUX = "{role: clamped, heat: {theta: 80}}", "{role: clamped, heat: {flux: 30}}"
HOT, COLD = (
    "{role: clamped, heat: {alpha: 5, theta_bar: 90}}",
    "{role: convection, alpha: 2, theta_bar: 20}",
)
HELD_TOO = "{role: traction, pressure: 0.1, heat: {theta: 20}}"
R = 2.0 / 4.0
"""Resistance of the slab, L/k."""


@pytest.mark.parametrize(
    ("left", "right", "flow", "at_left"),
    [
        (HELD, HELD_TOO, 60 / R, 80.0),
        (FLUX, HELD_TOO, 30.0, 20 + 30 * R),
        (HOT, COLD, 70 / (R + 1 / 2 + 1 / 5), 90 - 70 / (R + 1 / 2 + 1 / 5) / 5),
        (
            "{role: clamped, heat: {theta: 90}}",
            "{role: convection, alpha: 2, theta_bar: 90}",
            0.0,
            90.0,
        ),
        ("clamped", "{role: convection, alpha: 2, theta_bar: 20, flux: 40}", 0.0, 40.0),
    ],
)
def test_slab_in_series(left: str, right: str, flow: float, at_left: float) -> None:
    """The field is linear, so that P1 has it exactly; heat in is heat out."""
    study = study_of(SLAB.replace("LEFT", left).replace("RIGHT", right))
    level = levels_of(study)[0]
    found = level.temperature(study.scenes[0])
    assert found.theta == pytest.approx(
        at_left - flow / 4 * level.mesh.points[:, 0], abs=1e-12 * 90
    )
    assert found.mean == pytest.approx(at_left - flow / 4, rel=1e-13)
    assert not found.heat_balance > 1e-14  # NaN where nothing flows


def test_what_edges_say_like_the_section_is_the_same_study() -> None:
    """Also for estimated errors, of a goal too; a held temperature is the limit of a large α."""
    own = "{role: convection, alpha: 0.8, theta_bar: 0.2, g: [0.01, 0]}"
    plain = '{role: convection, g: [0.01, "0.02*y"], pressure: 0.03}'
    changed = HEATED_BRACKET.replace('"0.2 + 0.1*x"', "0.2").replace(
        plain, "{role: convection, g: [0.01, 0]}"
    )
    same = changed.replace("{role: convection, g: [0.01, 0]}", own)
    assert study_of(same).scenes[0].heat_by_edge
    assert not study_of(changed).scenes[0].heat_by_edge
    assert looked(same) == pytest.approx(looked(changed), rel=1e-11)
    ways = ("theta: 1", "alpha: 1e9, theta_bar: 1")
    held, large = (
        looked(changed.replace("-0.01]}", "-0.01], heat: {" + one + "}}")) for one in ways
    )
    assert large == pytest.approx(held, rel=2e-4)  # of α, the boundary has a residual, too


def looked(text: str) -> list[float]:
    """Load, energy, and estimated errors of a study on its coarse mesh."""
    study = study_of(text, "mesh={maxh: 0.5, levels: 1, estimate: true, goal: friction_resultant}")
    scene, level = study.scenes[0], levels_of(study)[0]
    condensed = level.condensed(scene)
    answer = solve_contact(condensed.problem)
    found = ErrorEstimator(level, study.mesh).look((), scene, answer.v)
    return [
        float(np.abs(condensed.problem.l_tilde).sum()),
        condensed.constant,
        *map(float, found.values()),
    ]


def test_many_alpha_cost_a_handful_of_columns(monkeypatch: pytest.MonkeyPatch) -> None:
    """100 α over sixteen decades: q and θ̄ vary in space, fewer than 40 columns for each; α beyond
    them is as exact."""
    columns, original = [], Condensation.expand

    def counting(condensation: Condensation, u_k: np.ndarray, F: object = None) -> np.ndarray:
        full = original(condensation, u_k, F)  # type: ignore[arg-type]
        columns.append(full.shape[1] if full.ndim == 2 else 1)
        return full

    monkeypatch.setattr(Condensation, "expand", counting)
    heat = ("material.k=50", "heat.q=0.6 + x*y", "mesh.levels=1")
    study = study_of(HEATED_BRACKET, *heat, "sweep={alpha: {geomspace: [1e-8, 1e8, 100]}}")
    mesh = levels_of(study)[0].mesh
    level = Level(mesh, study.scenes[0], study.scenes)
    condensed = [level.condensed(scene) for scene in study.scenes]
    temperatures = [level.temperature(scene) for scene in study.scenes]
    assert sum(columns) < 80
    for i in range(0, 100, 20):
        alone = Level(mesh, study.scenes[i])
        direct, one = alone.temperature(study.scenes[i]), alone.condensed(study.scenes[i])
        assert temperatures[i].theta == pytest.approx(
            direct.theta, abs=1e-12 * np.max(np.abs(direct.theta))
        )
        assert temperatures[i].mean == pytest.approx(direct.mean, rel=1e-12)
        assert temperatures[i].heat_balance < 1e-12
        l_tilde = one.problem.l_tilde
        assert condensed[i].problem.l_tilde == pytest.approx(
            l_tilde, abs=1e-12 * np.max(np.abs(l_tilde))
        )
        assert condensed[i].constant == pytest.approx(one.constant, rel=1e-11)
    (scene,) = study_of(HEATED_BRACKET, *heat, "heat.alpha=1e12").scenes
    outside = Level(mesh, scene).temperature(scene).theta
    assert level.temperature(scene).theta == pytest.approx(
        outside, abs=1e-12 * np.max(np.abs(outside))
    )


SLIVERS = """
units: none
body: {rectangle: {width: WIDTH, height: 1}}
boundary: {bottom: contact, left: LEFT, right: convection, top: free}
material: {E: 1, nu: 0.3, k: 1, alpha_T: 0.05}
heat: {alpha: 1, theta_bar: 0.3, q: 0}
friction: {law: tresca, tau: 1}
mesh: {maxh: 0.15, levels: 1}
"""


def sliver_level(width: float, thinner: float, left: str, *overrides: str) -> tuple[Scene, Level]:
    """A block of this width; its lowest layer of obtuse triangles is `thinner` times as thin as the
    others."""
    scene = study_of(
        SLIVERS.replace("WIDTH", repr(width)).replace("LEFT", left), *overrides
    ).scenes[0]
    return scene, Level(layered(build(scene.body), width, thinner), scene)


@pytest.mark.parametrize("thinner", [5e4, 1e6])
def test_refinement_gives_slivers_their_digits_back(
    monkeypatch: pytest.MonkeyPatch, thinner: float
) -> None:
    """Heat through a slab, which P1 has exactly: the error drops by two orders at least and heat
    balances to rounding; unrefined, both are rounding × condition."""

    def found() -> tuple[float, float]:
        scene, level = sliver_level(30.0, thinner, "{role: clamped, heat: {flux: 1}}")
        theta, exact = level.temperature(scene), 1.3 + (30.0 - level.mesh.points[:, 0])
        return theta.heat_balance, float(np.max(np.abs(theta.theta - exact)) / 31.3)

    balance, error = found()
    assert error < 1e-10
    assert balance < 1e-13
    monkeypatch.setattr(heat_factor, "UNSOUND", np.inf)
    lost, off = found()
    assert lost > 1e2 * max(balance, 1e-14)
    assert off > 1e2 * error
    assert lost > HEAT_BOUND > balance


@pytest.mark.parametrize(
    "changes",
    [['heat.q="1e-9*(x - 1)"'], ["heat.q=1e-3", 'heat.theta_bar="1e9*y"', "heat.alpha=1e6"]],
    ids=["cancelling sources", "little heat beside much that passes"],
)
def test_the_balance_is_relative_to_the_heat_that_moves(changes: list[str]) -> None:
    scene, level = sliver_level(2.0, 1.0, "clamped", *changes)
    assert level.temperature(scene).heat_balance < 1e-13
