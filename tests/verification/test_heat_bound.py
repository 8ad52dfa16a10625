"""The bound of what a computed temperature adds to the error: exact solutions, dense eigenvalues,
and random heated scenes against meshes refined thrice."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from numpy.typing import NDArray

import tcstudy
from tcstudy.fem import meshes
from tcstudy.fem.meshes import PlaneMesh
from tcstudy.offline.error_bound import ErrorBounds
from tcstudy.offline.heat_bound import SMALL, CompliancePair, HeatBounds
from tcstudy.offline.heat_quadratic import QuadraticTemperature
from tcstudy.offline.oscillation import TRIANGLE_POINTS, TRIANGLE_WEIGHTS
from tcstudy.scene.records import Scene
from tests.verification.scenes import levels_of, study_of
from tests.verification.test_error_bound import bounded, loaded_scene_of

Array = NDArray[np.float64]


def linear(mesh: PlaneMesh, theta: Array) -> QuadraticTemperature:
    """Return the P1 temperature itself."""
    return QuadraticTemperature(theta, np.zeros(len(mesh.edges[0])))


PARABOLA = """
units: none
body: {rectangle: {width: 2, height: 1}}
boundary: {bottom: contact, left: clamped, right: free, top: {role: convection, alpha: ALPHA, theta_bar: 0}}
material: {E: 1, nu: 0.3, k: 1, alpha_T: 1e-2}
heat: {q: 2}
friction: {law: tresca, tau: 1e-4}
mesh: {maxh: 0.4, levels: 3}
"""


@pytest.mark.parametrize("alpha", [1e-3, 1.0, 1e3])
def test_the_energy_of_an_exact_temperature_is_its_error(alpha: float) -> None:
    """θ = 1 − y² + 2/α: its flux is linear, so that η_θ is the error itself; M_h halves with h."""
    study = study_of(PARABOLA.replace("ALPHA", repr(alpha)))
    scene, constants = study.scenes[0], []
    for level in levels_of(study):
        mesh, theta = level.mesh, level.temperature(scene).theta
        bounds = HeatBounds(mesh)
        points = np.einsum("qc,tcd->tqd", TRIANGLE_POINTS, mesh.corners)
        y = points[..., 1]
        error = 1.0 - y**2 + 2.0 / alpha - theta[mesh.triangles] @ TRIANGLE_POINTS.T
        slope = np.stack([np.zeros(y.shape), -2.0 * y], axis=-1) - mesh.gradient(theta)[:, None]
        energy = float(mesh.area @ ((slope**2).sum(axis=2) @ TRIANGLE_WEIGHTS))
        at_top = mesh.on("top")
        first, second = (theta[mesh.segments[at_top]] - 2.0 / alpha).T
        square = (first**2 + first * second + second**2) / 3.0
        energy += alpha * float(mesh.boundary.length[at_top] @ square)
        rho = bounds.data(scene).rho
        norm = float(np.sqrt(rho * mesh.area @ (error**2 @ TRIANGLE_WEIGHTS)))
        eta = bounds.energy(scene, linear(mesh, theta))
        assert eta == pytest.approx(np.sqrt(energy), rel=1e-9)
        constants.append(bounds.constant(scene))
        assert norm <= constants[-1] * eta <= 1.7 * norm
        # t is θ but for the residual at which conjugate gradients end
        assert bounds.bound(scene, theta) < 0.1 * norm
    assert constants[1] < 0.55 * constants[0]
    assert constants[2] < 0.55 * constants[1]


def test_a_linear_temperature_has_no_error() -> None:
    text = """
units: none
body: {rectangle: {width: 2, height: 1}}
boundary:
  bottom: contact
  left: {role: clamped, heat: {theta: "3 + y"}}
  right: {role: free, heat: {alpha: 0.5, theta_bar: "7 + y"}}
  top: {role: free, heat: {flux: 4}}
material: {E: 1, nu: 0.3, k: 4, alpha_T: 1e-2}
friction: {law: tresca, tau: 1e-4}
mesh: {maxh: 0.3}
"""
    # k∂θ/∂n = 4s on the right is −α(θ − θ̄) for θ = 3 + y + sx, so 4s = −0.5(2s − 4)
    # on the bottom θ has the flux −4 of k∂θ/∂y, which leaves the body there
    study = study_of(text.replace("bottom: contact", "bottom: {role: contact, heat: {flux: -4}}"))
    scene, level = study.scenes[0], levels_of(study)[0]
    theta = level.temperature(scene).theta
    x, y = level.mesh.points.T
    assert theta == pytest.approx(3.0 + y + 0.4 * x, abs=1e-12)
    bounds = HeatBounds(level.mesh)
    assert bounds.energy(scene, linear(level.mesh, theta)) < 1e-10
    assert bounds.energy(scene, bounds.improved(scene, theta)) < 1e-10


def test_the_constant_is_proved_from_above() -> None:
    """κ² against dense eigenvalues; a bound below the largest one is not accepted."""
    scene, mesh = _heated(4)
    bounds = HeatBounds(mesh)
    data = bounds.data(scene)
    rho = data.rho / data.rho.max()
    pair = CompliancePair(bounds, scene, data, rho)
    size = len(pair._weight)
    root = np.sqrt(pair._weight)
    dual, p1 = pair._source_columns
    compliance = np.diag(1.0 / pair.elements.s[pair._heated])
    for heat, column in zip(np.eye(size), range(size), strict=True):
        compliance[:, column] += dual.T @ pair._dual.solve(dual @ heat)
        compliance[:, column] -= p1.T @ pair._p1.solve(p1 @ heat)
    largest = float(np.linalg.eigvalsh(root[:, None] * compliance * root)[-1])
    assert pair.largest() == pytest.approx(largest, rel=0.04)
    assert pair.is_below(1.001 * largest)
    assert not pair.is_below(0.999 * largest)
    assert bounds.constant(scene) > np.sqrt(largest * data.rho.max() / (scene.material.k or 1.0))


def _heated(seed: int) -> tuple[Scene, PlaneMesh]:
    study = study_of(heated_scene_of(seed)[0])
    return study.scenes[0], levels_of(study)[0].mesh


def heated_scene_of(seed: int) -> tuple[str, float]:
    """Return a scene of `loaded_scene_of` with a computed temperature, and its ω/λ₁.

    Edges exchange heat, take a flux or are held; a region has its own k, α_T and source.
    """
    text, share = loaded_scene_of(seed)
    rng, scene = np.random.default_rng(2 * 10**6 + seed), yaml.safe_load(text)
    size = scene["body"]["outline"][1]["from"][0]
    k = float(10 ** rng.uniform(-3, 3))

    def coefficient() -> float:
        return float(k / size * 10 ** rng.uniform(-3, 3))

    def linear() -> str:
        a, b, c = (float(value) for value in rng.normal(size=3) * 100.0)
        return f"{a!r} + ({b / size!r})*x + ({c / size!r})*y"

    def role_of_heat(kind: int) -> dict[str, object]:
        if kind == 0:
            return {"alpha": coefficient(), "theta_bar": float(rng.normal() * 100.0)}
        if kind == 1:
            return {"alpha": coefficient(), "theta_bar": linear()}
        if kind == 2:
            return {"flux": float(rng.normal() * 100.0 * k / size)}
        return {"theta": linear() if kind == 3 else 70.0}

    kinds = [int(kind) for kind in rng.integers(0, 6, size=len(scene["boundary"]))]
    if all(kind in (2, 5) for kind in kinds):
        kinds[0] = 0
    # a corner of two held edges has one temperature
    kinds = [4 if kind == 3 and kinds.count(3) + kinds.count(4) > 1 else kind for kind in kinds]
    for (edge, role), kind in zip(scene["boundary"].items(), kinds, strict=True):
        if kind < 5:
            record = {"role": role} if isinstance(role, str) else role
            scene["boundary"][edge] = record | {"heat": role_of_heat(kind)}
    scene["material"] |= {"k": k}
    part = scene["materials"]["part"]
    part |= {"k": float(k * 10 ** rng.uniform(-2, 2)), "alpha_T": float(rng.uniform(0.2, 3)) * 1e-5}
    scene["heat"] = {"q": float(rng.normal() * 300.0 * k / size**2), "omega": "part"}
    return json.dumps(scene), share


@pytest.mark.parametrize("seed", [0, 5, 22])
def test_no_error_of_a_heated_body_is_above_its_bound(seed: int) -> None:
    text, _ = heated_scene_of(seed)
    error, bound, _ = bounded(text)
    assert error <= bound <= 5.0 * error


def temperature_errors(text: str, quadratic: bool) -> tuple[float, float, float, float]:
    """Return ‖θ − t‖_c and ‖θ − t‖_ρ against the mesh refined thrice, and their bounds.

    quadratic: whether t is the improved temperature, not that of P1
    """
    study = study_of(text, "mesh.levels=4")
    scene, levels = study.scenes[0], levels_of(study)
    coarse, mesh = levels[0].mesh, levels[-1].mesh
    theta, bounds = levels[0].temperature(scene).theta, HeatBounds(coarse)
    t = bounds.improved(scene, theta) if quadratic else linear(coarse, theta)
    values = t.at(coarse, mesh.points)
    error = levels[-1].temperature(scene).theta - values
    data = HeatBounds(mesh).data(scene)
    energy = float(mesh.area @ (data.k * (mesh.gradient(error) ** 2).sum(axis=1)))
    first, second = error[mesh.segments].T
    square = (first**2 + first * second + second**2) / 3.0
    energy += float((data.alpha * mesh.boundary.length) @ square)
    corners = error[mesh.triangles]
    square = ((corners**2).sum(axis=1) + corners.sum(axis=1) ** 2) / 12.0
    norm = float(np.sqrt(mesh.area @ (data.rho * square)))
    eta = bounds.energy(scene, t)
    T = bounds.bound(scene, theta) if quadratic else bounds.constant(scene) * eta
    return float(np.sqrt(energy)), norm, eta, T


@pytest.mark.parametrize("quadratic", [False, True])
@pytest.mark.parametrize("seed", range(3, 6))
def test_no_error_of_a_temperature_is_above_its_bound(seed: int, quadratic: bool) -> None:
    text, _ = heated_scene_of(seed)
    if seed == 5:  # data that are not as the elements have them
        scene = yaml.safe_load(text)
        scene["heat"]["q"] = f"({scene['heat']['q']!r})*exp(3*x/{_width(scene)!r})"
        text = json.dumps(scene)
    energy, norm, eta, bound = temperature_errors(text, quadratic)
    assert energy <= eta * (1 + 1e-9) <= 2.5 * energy
    assert norm <= bound <= 20.0 * norm


def test_a_temperature_of_a_coarse_mesh_is_the_same_on_a_finer_one() -> None:
    study = study_of(PARABOLA.replace("ALPHA", "1"))
    coarse, finer = (level.mesh for level in levels_of(study)[::2])
    rng, rho = np.random.default_rng(5), np.ones(len(coarse.triangles))
    t = QuadraticTemperature(
        rng.normal(size=coarse.n_points), rng.normal(size=len(coarse.edges[0]))
    )
    on_finer = t.refined(coarse, finer)
    norm = on_finer.norm(finer, np.ones(len(finer.triangles)))
    assert norm == pytest.approx(t.norm(coarse, rho), rel=1e-10)
    by_quadrature = np.einsum("qc,tcd->tqd", TRIANGLE_POINTS, coarse.corners)
    values = t.at(coarse, by_quadrature.reshape(-1, 2)).reshape(len(rho), -1)
    assert norm == pytest.approx(np.sqrt(coarse.area @ (values**2 @ TRIANGLE_WEIGHTS)), rel=1e-10)
    linear_norm, beside = QuadraticTemperature(0.0 * t.nodal, t.bubbles), t.rest(coarse, rho)
    mean_square = linear_norm.norm(coarse, rho) ** 2
    assert 0.0 < beside[0] ** 2 + beside[1] ** 2 < 0.3 * mean_square


@pytest.mark.parametrize("alpha", [1e-9, 1.0, 1e9])
def test_the_improved_temperature_has_that_of_p1(alpha: float) -> None:
    """c(t − θ_h, 1) = 0: its part on the edge that exchanges heat is 0 in the mean."""
    study = study_of(PARABOLA.replace("ALPHA", repr(alpha)))
    scene, level = study.scenes[0], levels_of(study)[1]
    mesh, theta = level.mesh, level.temperature(scene).theta
    t = HeatBounds(mesh).improved(scene, theta)
    change = t.less(linear(mesh, theta))
    at_top = mesh.on("top")
    number = mesh.edges[1].ravel()[mesh.sides_at(mesh.segments[at_top])]
    ends = change.nodal[mesh.segments[at_top]].mean(axis=1)
    means = ends + 2.0 / 3.0 * change.bubbles[number]
    largest = np.abs(change.bubbles).max()
    assert abs(mesh.boundary.length[at_top] @ means) < 1e-12 * max(largest, np.abs(theta).max())
    exact = 1.0 - mesh.points[:, 1] ** 2 + 2.0 / alpha
    assert np.abs(t.nodal - exact).max() < 0.05 * largest  # as conjugate gradients end


def _width(scene: dict[str, Any]) -> float:
    return float(scene["body"]["outline"][1]["from"][0])


def test_without_the_bound_of_the_temperature_some_errors_are_above(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """So that the tests above can fail."""
    monkeypatch.setattr(ErrorBounds, "thermal_part", lambda *_: 0.0)
    monkeypatch.setattr(HeatBounds, "improved", lambda bounds, _, theta: linear(bounds.mesh, theta))
    error, bound, _ = bounded(heated_scene_of(22)[0])
    assert bound < 0.95 * error


@pytest.mark.parametrize("seed", [4, 22])
def test_the_constant_of_a_coarser_mesh_is_greater_and_serves_where_t_is_small(
    seed: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(meshes, "MAX_ANCESTOR", 200)
    study = study_of(heated_scene_of(seed)[0], "mesh.levels=4")
    scene, levels = study.scenes[0], levels_of(study)
    last = levels[-1]
    coarse = last.mesh.ancestor
    assert coarse is not None
    assert coarse in [level.mesh for level in levels[:-1]]
    assert len(coarse.triangles) <= 200 < len(last.mesh.triangles)
    theta, bounds = last.temperature(scene).theta, HeatBounds(last.mesh)
    of_coarse, own = HeatBounds(coarse).constant(scene), bounds.constant(scene)
    assert own <= of_coarse
    energy = bounds.energy(scene, bounds.improved(scene, theta))
    least = of_coarse * energy / SMALL
    assert bounds.bound(scene, theta) == own * energy
    assert bounds.bound(scene, theta, residual=1.01 * least) == of_coarse * energy
    assert bounds.bound(scene, theta, residual=0.99 * least) == own * energy


def test_a_mesh_with_arcs_goes_by_its_own_constant(monkeypatch: pytest.MonkeyPatch) -> None:
    """Its refinement has another polygon."""
    monkeypatch.setattr(meshes, "MAX_ANCESTOR", 100)
    hole = ", holes: [{circle: {center: [1, 0.5], radius: 0.2, edge: bore}}]"
    text = PARABOLA.replace("ALPHA", "1").replace("height: 1}", "height: 1}" + hole)
    study = study_of(text.replace("bottom: contact", "bottom: contact, bore: free"))
    scene, levels = study.scenes[0], levels_of(study)
    mesh, theta = levels[-1].mesh, levels[-1].temperature(scene).theta
    bounds = HeatBounds(mesh)
    assert mesh.ancestor is not None
    T = bounds.constant(scene) * bounds.energy(scene, bounds.improved(scene, theta))
    assert bounds.bound(scene, theta, residual=1e6 * T) == T


def test_meshes_are_adapted_to_a_tolerance_of_the_bound_with_a_source(tmp_path: Path) -> None:
    """Its temperature is computed and adds to every bound."""
    plan = "mesh={maxh: 0.4, tolerance: 0.08, of: error_bound}"
    study = study_of(PARABOLA.replace("ALPHA", "1"), plan)
    tree = tcstudy.run(study, tmp_path / "heated.nc")
    bounds = tree["error_bound_relative"].values.ravel()
    assert bounds[-1] <= 0.08 < bounds[-2]
    assert len(bounds) > 2
    assert str(tree["stop"].values[-1]).startswith("tolerance 0.08 met: bound")
