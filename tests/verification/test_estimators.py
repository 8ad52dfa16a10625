"""Estimated against true errors: smooth and singular solutions, heat; and the rates that refinement regains."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import tcstudy
from tcstudy.fem.energy_error import coupling, heat_estimate
from tcstudy.scene.study import MeshPlan, Study
from tests.verification import manufactured as exact
from tests.verification.norms import l2_and_h1_errors
from tests.verification.patch import CASES, patch_study
from tests.verification.reference import Solved, distance, solved_levels
from tests.verification.scenes import levels_of, study_of

LOW, HIGH = 0.5, 3.0
"""Bounds of estimated over true error."""


# -- a smooth thermoelastic solution in closed form -------------------------------------------------


def energy_error(solved: Solved) -> float:
    """‖u − u_h‖_a by the midpoints' rule of degree 2 on every triangle."""
    points = solved.triangles.inner_points
    x, y = points[..., 0], points[..., 1]
    (xx, xy), (yx, yy) = (np.broadcast_arrays(*f(x, y), x)[:2] for f in (exact.grad_u_x, exact.grad_u_y))
    d = np.stack([xx, yy, 0.5 * (xy + yx)], axis=-1) - solved.strain[:, None]
    square = exact.LAM * (d[..., 0] + d[..., 1]) ** 2 + 2 * exact.MU * (d**2 @ [1, 1, 2])
    return float(np.sqrt(np.sum(solved.triangles.area * square.mean(axis=1))))


@pytest.mark.parametrize("family", ["adaptive", "graded"])
def test_effectivity_on_the_manufactured_solution(family: str) -> None:
    study = exact.manufactured_study(1, 0.25)
    levels = {"adaptive": 7, "graded": 3}[family]
    plan = MeshPlan((0.25,), levels, family)  # type: ignore[arg-type]
    solved = list(solved_levels(study, plan))
    norm = float(np.sqrt(2 * 0.5 * energy_norm_squared(solved[-1])))
    ratios = [s.estimate * norm / energy_error(s) for s in solved]
    assert all(0.9 < ratio < 1.15 for ratio in ratios[1:]), ratios
    assert LOW < ratios[0] < HIGH


def energy_norm_squared(solved: Solved) -> float:
    """a(u_h, u_h)."""
    own = solved.strain
    square = exact.LAM * (own[:, 0] + own[:, 1]) ** 2 + 2 * exact.MU * (own**2 @ [1, 1, 2])
    return float(solved.triangles.area @ square)


def test_nothing_is_estimated_where_p1_is_exact() -> None:
    """Multivalued patch test, all kinds of solutions: no residual in the body, on edges, in friction."""
    for case in CASES:
        study = patch_study(case, 0.4, 37.0)
        assert next(iter(solved_levels(study, study.mesh))).estimate < 1e-10


WARM = """
units: none
body: {rectangle: {width: 1, height: 1}}
boundary: {left: contact, right: clamped, top: convection, bottom: convection}
material: {lambda: 1.5, mu: 1, beta: 0.8, k: 2}
heat: {alpha: 3, theta_bar: "cos(pi*x)", q: "2*pi^2*cos(pi*x)"}
friction: {law: tresca, tau: 0.1}
mesh: {maxh: 0.25, levels: 4}
"""


def test_heat_estimate_and_coupling() -> None:
    """θ = cos(πx), insulated on the left and right, in balance with its surroundings above and below."""
    study = study_of(WARM)
    scene = study.scenes[0]
    energy, loads = [], []
    for level in levels_of(study):
        triangles, theta = level.mesh, level.temperature(scene).theta
        l2, h1 = l2_and_h1_errors(
            level.mesh,
            theta,
            lambda x, y: np.cos(np.pi * x),
            lambda x, y: np.array([-np.pi * np.sin(np.pi * x), 0 * y]),
        )
        energy.append(np.sqrt(heat_estimate(triangles, theta, scene).sum() / 2.0) / h1)
        loads.append(np.sqrt(coupling(triangles, theta, scene).sum() * 2.5) / 0.8 / l2)
    assert all(0.95 < ratio < 1.05 for ratio in energy[1:]), energy
    assert LOW < energy[0] < HIGH
    assert all(LOW < ratio < HIGH for ratio in loads), loads


def test_what_heat_does_to_a_goal() -> None:
    """β∫θ div z = ∫qζ + α∫θ̄ζ with the dual temperature ζ, for z = (x²y, xy): what c(ζ, θ) = l(ζ) says."""
    study = study_of(WARM)
    scene, level = study.scenes[0], levels_of(study)[1]
    mesh, heat, (x, y) = level.mesh, level.heat, level.mesh.points.T
    slope = mesh.gradient(np.stack([x**2 * y, x * y], axis=1))
    dilation = scene.material.beta * mesh.area * (slope[:, 0, 0] + slope[:, 1, 1])
    zeta = level.temperatures.response(scene, mesh.incidence @ dilation / 3.0)
    put_in = zeta @ heat.source(scene.heat.q, ()) + scene.heat.alpha * float(
        zeta[heat.kept_nodes] @ heat.surroundings(scene.heat.theta_bar)
    )
    assert put_in == pytest.approx(float(dilation @ level.temperature(scene).theta[mesh.triangles].mean(axis=1)))


def test_oscillating_data_are_seen() -> None:
    """A force that the mesh cannot resolve: its average vanishes, the solution with it, the estimate does not."""
    text = WARM.replace('heat: {alpha: 3, theta_bar: "cos(pi*x)", q: "2*pi^2*cos(pi*x)"}\n', "")
    text = text.replace("convection", "free").replace("friction", 'loads: {f: ["sin(200*x)*sin(177*y)", 0]}\nfriction')
    solved = next(iter(solved_levels(study_of(text), MeshPlan((0.25,), 1))))
    assert solved.estimate > 1.0


# -- singular corners --------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def singular() -> Study:
    return tcstudy.load(Path(__file__).parents[2] / "configs" / "singular.yaml")


@pytest.fixture(scope="module")
def errors(singular: Study) -> dict[str, np.ndarray]:
    """(unknowns, true error, estimate) by family; the reference has some 60,000 unknowns."""
    maxh, most = singular.mesh.maxh, 5000
    adaptive = list(solved_levels(singular, MeshPlan(maxh, 60, "adaptive"), 60_000))
    families = {
        "adaptive": [s for s in adaptive if s.n_dof <= most],
        "graded": list(solved_levels(singular, MeshPlan(maxh, 3, "graded"))),
        "uniform": list(solved_levels(singular, MeshPlan(maxh, 5))),
    }
    reference = adaptive[-1]
    return {
        name: np.array(
            [(s.n_dof, np.hypot(distance(s, reference, singular), reference.estimate), s.estimate) for s in solved]
        )
        for name, solved in families.items()
    }


def rate(rows: np.ndarray, least: float = 150.0) -> float:
    """Slope of log error over log unknowns."""
    n, e = rows[rows[:, 0] > least, :2].T
    return float(np.polyfit(np.log(n), np.log(e), 1)[0])


def test_effectivity_at_singular_corners(errors: dict[str, np.ndarray]) -> None:
    for rows in errors.values():
        ratios = rows[:, 2] / rows[:, 1]
        assert np.all((ratios > LOW) & (ratios < 1.5)), ratios


def test_the_lost_order_is_regained(errors: dict[str, np.ndarray]) -> None:
    """N^(−½) on adaptive and graded meshes; uniform ones stay near N^(−λ/2) with λ = ½."""
    assert rate(errors["uniform"]) > -0.33
    assert -0.6 < rate(errors["adaptive"]) < -0.45
    assert -0.6 < rate(errors["graded"]) < -0.43
    finest = {name: rows[-1] for name, rows in errors.items()}
    assert 0.7 * finest["uniform"][0] < finest["adaptive"][0] < 1.05 * finest["uniform"][0]
    assert finest["adaptive"][1] < 0.6 * finest["uniform"][1]
    assert finest["graded"][1] < 0.65 * finest["uniform"][1]
