"""Estimated against true errors: smooth and singular solutions, heat; and the rates that refinement
regains.

The distance is ‖u_ref − u_h‖_a itself, by quadrature on the reference mesh, not by a difference of
energies. With friction the energy of a discrete solution is Σ c_i j(v_i) and not ∫j, and L(u_h) −
L(u) = ½‖u_h − u‖²_a + ∫(j(u_h,T) − j(u_T) − ξ(u_h,T − u_T)), so that √(2(L_h − L_ref)) measures the
square of the error together with terms of its size.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest
from matplotlib.tri import Triangulation
from numpy.typing import NDArray

import tcstudy
from tcstudy.contact.problem import Status
from tcstudy.contact.solve import solve_contact
from tcstudy.fem.energy_error import coupling, heat_estimate, own_strain
from tcstudy.fem.meshes import PlaneMesh
from tcstudy.offline.level import Level
from tcstudy.refine.family import ErrorEstimator, Family
from tcstudy.scene.mesh_plan import MeshPlan
from tcstudy.scene.study import Study
from tcstudy.study.reference import FineReference, solve_levels
from tests.verification import manufactured as exact
from tests.verification.patch import CASES, patch_study
from tests.verification.scenes import levels_of, study_of

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Solved:
    """One level of a family: its unknowns, estimated relative error, mesh and strain on the
    triangles (t, 3)."""

    n_dof: int
    estimate: float
    triangles: PlaneMesh
    strain: Array


def solved_levels(study: Study, plan: MeshPlan, most: float = np.inf) -> Iterator[Solved]:
    """Solve the first scene level by level, as a run does; ends with the first level of more than
    `most` unknowns."""
    study = replace(study, mesh=replace(plan, estimate=True))
    scene, family = study.scenes[0], Family(study)
    for i in range(plan.levels):
        level = Level(family.next(i), scene)
        estimator = family.estimator(level)
        answer = solve_contact(level.condensed(scene).problem)
        assert answer.status == Status.CONVERGED, answer.reason
        estimator.look((), scene, answer.v)
        own = own_strain(level.mesh, level.displacement(scene, answer.v))
        yield Solved(level.frames.n_dof, estimator.estimates[()].energy, level.mesh, own)
        if level.frames.n_dof > most:
            return


def energy(e: Array, lam: float, mu: float) -> Array:
    """σ : ε of strains (…, 3)."""
    return lam * (e[..., 0] + e[..., 1]) ** 2 + 2.0 * mu * (e**2 @ [1.0, 1.0, 2.0])


def distance(solved: Solved, reference: Solved, study: Study) -> float:
    """‖u_ref − u_h‖_a/‖u_ref‖_a by one point for each triangle of the reference mesh."""
    lam, mu = study.scenes[0].material.lam, study.scenes[0].material.mu
    own, fine = solved.triangles, reference.triangles
    found = Triangulation(*own.points.T, own.triangles).get_trifinder()(
        *fine.corners.mean(axis=1).T
    )
    assert np.all(found >= 0)
    apart, whole = (
        energy(e, lam, mu) for e in (reference.strain - solved.strain[found], reference.strain)
    )
    return float(np.sqrt((fine.area @ apart) / (fine.area @ whole)))


LOW, HIGH = 0.5, 3.0
"""Bounds of estimated over true error."""


# -- a smooth thermoelastic solution in closed form
# -------------------------------------------------


def energy_error(solved: Solved) -> float:
    """‖u − u_h‖_a by the midpoints' rule of degree 2 on every triangle."""
    points = solved.triangles.inner_points
    x, y = points[..., 0], points[..., 1]
    (xx, xy), (yx, yy) = (
        np.broadcast_arrays(*f(x, y), x)[:2] for f in (exact.grad_u_x, exact.grad_u_y)
    )
    d = np.stack([xx, yy, 0.5 * (xy + yx)], axis=-1) - solved.strain[:, None]
    return float(np.sqrt(solved.triangles.area @ energy(d, exact.LAM, exact.MU).mean(axis=1)))


@pytest.mark.parametrize("family", ["adaptive", "graded"])
def test_effectivity_on_the_manufactured_solution(family: str) -> None:
    study = exact.manufactured_study(1, 0.25)
    plan = MeshPlan((0.25,), {"adaptive": 7, "graded": 3}[family], family)  # type: ignore[arg-type]
    solved = list(solved_levels(study, plan))
    norm = np.sqrt(solved[-1].triangles.area @ energy(solved[-1].strain, exact.LAM, exact.MU))
    ratios = [s.estimate * norm / energy_error(s) for s in solved]
    assert all(0.9 < ratio < 1.15 for ratio in ratios[1:]), ratios
    assert LOW < ratios[0] < HIGH


def test_nothing_is_estimated_where_p1_is_exact() -> None:
    """Multivalued patch test, all kinds of solutions: no residual in the body, on edges, in
    friction."""
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
    """θ = cos(πx), insulated on the left and right, in balance with its surroundings above and
    below."""
    study = study_of(WARM)
    scene = study.scenes[0]
    energy, loads = [], []
    for level in levels_of(study):
        triangles, theta = level.mesh, level.temperature(scene).theta
        ones, x, y = (
            np.ones((len(triangles.triangles), 3)),
            *np.moveaxis(triangles.inner_points, 2, 0),
        )
        plane = np.linalg.solve(
            np.dstack([ones, triangles.corners]), theta[triangles.triangles, None]
        )  # (t, 3, 1)
        off = [np.cos(np.pi * x) - plane[:, 0] - plane[:, 1] * x - plane[:, 2] * y]
        slopes = [-np.pi * np.sin(np.pi * x) - plane[:, 1], 0.0 * x - plane[:, 2]]
        l2, h1 = (
            np.sqrt(triangles.area @ sum(d**2 for d in one).mean(axis=1)) for one in (off, slopes)
        )
        energy.append(np.sqrt(heat_estimate(triangles, theta, scene).sum() / 2.0) / h1)
        loads.append(np.sqrt(coupling(triangles, theta, scene).sum() * 2.5) / 0.8 / l2)
    assert all(0.95 < ratio < 1.05 for ratio in energy[1:]), energy
    assert LOW < energy[0] < HIGH
    assert all(LOW < ratio < HIGH for ratio in loads), loads


def test_oscillating_data_are_seen() -> None:
    """A force that the mesh cannot resolve: its average vanishes, the solution with it, the
    estimate does not."""
    text = WARM.replace('heat: {alpha: 3, theta_bar: "cos(pi*x)", q: "2*pi^2*cos(pi*x)"}\n', "")
    text = text.replace("convection", "free").replace(
        "friction", 'loads: {f: ["sin(200*x)*sin(177*y)", 0]}\nfriction'
    )
    solved = next(iter(solved_levels(study_of(text), MeshPlan((0.25,), 1))))
    assert solved.estimate > 1.0


# -- springs, rigid edges, laws by edge, layers
# ------------------------------------------------------

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
    [
        "{role: traction, g: [0.1, 0], spring: {normal: 3}}",
        "{role: rigid, u_y: 0, force: [0.1, 0]}",
    ],
)
def test_no_error_is_estimated_of_a_bar_that_is_exact_on_its_spring(right: str) -> None:
    """σ = g − k u at the end, constant: P1 is exact, and so is the estimate; springs left out would
    leave k u."""
    study = study_of(SPRINGS.replace("RIGHT", right).replace("LEVELS", "1"))
    level, scene = levels_of(study)[0], study.scenes[0]
    v = solve_contact(level.condensed(scene).problem).v
    assert ErrorEstimator(level, study.mesh).look((), scene, v)["error_estimate"] < 1e-10


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
    text = (
        SPRINGS.replace("RIGHT", right)
        .replace("LEVELS", "4")
        .replace("{law: linear, k: 0}", friction)
    )
    return text.replace("top: free", "top: contact") if "strength" in text else text


@pytest.mark.parametrize(
    "text",
    [
        LAYERS,
        on(
            '{role: traction, g: ["0.3*y", 0.1], spring: {normal: 0.5, tangential: 2}}',
            "{law: linear, k: 0.5}",
        ),
        on(
            "{role: traction, g: [0.05, 0]}",
            "{bottom: {law: linear, k: 1, strength: 1 + x}, top: {law: linear, k: 3}}",
        ),
        on("{role: rigid, u_y: 0, force: [0.1, 0]}", "{law: linear, k: 0.5}"),
    ],
    ids=["layers", "springs", "laws by edge", "rigid"],
)
def test_estimates_against_the_finest_of_nested_levels(text: str) -> None:
    study = study_of(text)
    levels, scene = solve_levels(study, lambda line: None), study.scenes[0]
    reference = FineReference(levels[-1])
    for number, level in enumerate(levels_of(study)[:2]):
        v = solve_contact(level.condensed(scene).problem).v
        found = ErrorEstimator(level, study.mesh).look((), scene, v)["error_estimate"]
        error, size = reference.errors(levels[number], (), scene)["u_energy"]
        assert 0.9 < found * size / error < 1.35


# -- singular corners
# --------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def errors() -> dict[str, np.ndarray]:
    """(unknowns, true error, estimate) by family; the reference has some 20,000 unknowns."""
    singular = tcstudy.load(Path(__file__).parents[2] / "configs" / "singular.yaml")
    maxh, most = singular.mesh.maxh, 5000
    adaptive = list(solved_levels(singular, MeshPlan(maxh, 60, "adaptive"), 20_000))
    families = {
        "adaptive": [s for s in adaptive if s.n_dof <= most],
        "graded": list(solved_levels(singular, MeshPlan(maxh, 3, "graded"))),
        "uniform": list(solved_levels(singular, MeshPlan(maxh, 5))),
    }
    reference = adaptive[-1]
    return {
        name: np.array(
            [
                (
                    s.n_dof,
                    np.hypot(distance(s, reference, singular), reference.estimate),
                    s.estimate,
                )
                for s in solved
            ]
        )
        for name, solved in families.items()
    }


def rate(rows: np.ndarray, least: float = 150.0) -> float:
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
