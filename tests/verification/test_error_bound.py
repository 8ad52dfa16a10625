"""The bound of the error: an exact solution, and random scenes against meshes refined thrice."""

import json
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
import yaml
from numpy.typing import NDArray

import tcstudy
from tcstudy.accuracy.norms import prolongation
from tcstudy.contact.solve import solve_contact
from tcstudy.errors import StudyError
from tcstudy.fem.energy_error import own_strain, stress_of
from tcstudy.offline.error_bound import ErrorBounds
from tcstudy.offline.level import Level
from tcstudy.reports.terminal.summary import text_of, verdict_of
from tcstudy.scene.guarantee import why_no_bound
from tcstudy.scene.records import Scene
from tests.verification.scenes import levels_of, study_of
from tests.verification.test_guaranteed import scene_of

Array = NDArray[np.float64]


def loaded_scene_of(seed: int) -> tuple[str, float]:
    """A body of `scene_of` with loads of every kind and a friction law, and ω/λ₁ of that."""
    rng, scene = np.random.default_rng(10**6 + seed), yaml.safe_load(scene_of(seed))
    E, size = scene["material"]["E"], scene["body"]["outline"][1]["from"][0]

    def draw(scale: float) -> float:
        return float(rng.normal() * scale)

    def linear(scale: float) -> str:
        terms = draw(scale), draw(scale / size), draw(scale / size)
        return "{!r} + ({!r})*x + ({!r})*y".format(*terms)

    stress, slip = 1e-3 * E, 1e-3 * size
    moved = rng.random() < 0.5
    given = [f"{draw(slip / size)!r}*x", f"{draw(slip / size)!r}*y"]
    for edge, role in scene["boundary"].items():
        role = {"role": role} if isinstance(role, str) else role
        if role["role"] == "clamped" and "u_x" not in role and moved:
            role = {"role": "clamped", "u": given}
        elif role["role"] == "rigid":
            role |= {
                "force": [0.0 if key in role else draw(stress * size) for key in ("u_x", "u_y")]
            }
            role |= {"moment": draw(stress * size**2)} if "moment" in role else {}
        elif role["role"] in ("free", "traction"):
            role = {**role, "role": "traction", "g": [linear(stress), linear(stress)]}
            role |= {"pressure": linear(stress)} if rng.random() < 0.5 else {}
        scene["boundary"][edge] = role
    scene["material"] |= {"alpha_T": 1e-5}
    scene["loads"] = {"f": [draw(stress / size), draw(stress / size)]}
    scene["heat"] = {"theta": linear(100.0)}
    study = study_of(json.dumps(scene))
    low, share = levels_of(study)[0].band(study.scenes[0]).low, float(rng.uniform(0.0, 0.9))
    points = [(0.0, float(rng.uniform(0.02, 1.0)) * stress)]
    for _ in range(rng.integers(1, 5)):
        step = float(rng.uniform(0.01, 2.0)) * stress / low
        slope = low * (-share if rng.random() < 0.5 else float(rng.uniform(-share, 1.0)))
        to = points[-1][1] + slope * step
        points.append((points[-1][0] + step, max(to, 0.1 * points[-1][1])))
    scene["friction"] = {"law": "piecewise-linear", "points": points}
    law = study_of(json.dumps(scene)).scenes[0].one_law
    return json.dumps(scene), law.omega / low


def energy_norm(level: Level, scene: Scene, u: Array) -> float:
    """√a(u, u) of a displacement u (2n,), with springs."""
    triangles = level.mesh
    lam, mu = (triangles.of_material(scene, name) for name in ("lam", "mu"))
    strain = own_strain(triangles, u)
    energy = triangles.area @ (stress_of(strain, lam, mu) * strain * [1.0, 1.0, 2.0]).sum(axis=1)
    return float(
        np.sqrt(energy + (u @ level.forces(u, (), scene.springs) if scene.springs else 0.0))
    )


def bounded(text: str, halvings: int = 0, finer: int = 3) -> tuple[float, float, float]:
    """Error of a mesh against a finer one, its bound, and the relative bound.

    halvings: how often the triangles of the scene are halved;  finer: and those of that mesh
    """
    study = study_of(text, f"mesh.levels={halvings + finer + 1}")
    scene, levels = study.scenes[0], levels_of(study)[halvings:]
    v = [solve_contact(level.condensed(scene).problem).v for level in (levels[0], levels[-1])]
    found = ErrorBounds(levels[0]).look(scene, v[0])
    u = levels[0].displacement(scene, v[0]).reshape(2, -1)
    for coarse, fine in pairwise(levels):
        u = (prolongation(coarse.mesh.n_points, fine.mesh.points, fine.mesh.triangles) @ u.T).T
    error = energy_norm(levels[-1], scene, levels[-1].displacement(scene, v[1]) - u.ravel())
    return error, found["error_bound"], found["error_bound_relative"]


@pytest.mark.parametrize("seed", range(3))
def test_no_error_is_above_its_bound(seed: int) -> None:
    text, _ = loaded_scene_of(seed)
    error, bound, _ = bounded(text)
    assert error <= bound <= 5.0 * error
    if seed == 1:  # an exponential law, by its polygon
        scene = json.loads(text)
        peak = scene["friction"]["points"][0][1]
        fall = 0.4 * levels_of(study_of(text))[0].band(study_of(text).scenes[0]).low
        law = {"law": "exponential", "a": peak, "b": 0.4 * peak, "delta": 0.6 * peak / fall}
        error, bound, _ = bounded(json.dumps(scene | {"friction": law}))
        assert error <= bound <= 2.0 * error


KINDS = ("jump", "linear strength", "strength", "scatter", "linear f", "f", "g", "theta")


def varied_scene_of(seed: int, kind: str) -> str:
    """Return a scene of `loaded_scene_of` with data of one kind that the elements do not have."""
    rng = np.random.default_rng([3, seed, KINDS.index(kind)])
    scene = json.loads(loaded_scene_of(seed)[0])
    size, E = scene["body"]["outline"][1]["from"][0], scene["material"]["E"]
    stress = 1e-3 * E

    def draw(scale: float) -> float:
        return float(rng.normal() * scale)

    def wave(scale: float) -> str:
        place = f"{draw(3.0)!r}*x/{size!r} + {draw(3.0)!r}*y/{size!r}"
        return f"{draw(scale)!r}*sin({place}) + {draw(scale)!r}*exp({place})"

    match kind:
        case "jump":
            points = scene["friction"]["points"]
            last_slip, last = points[-1]
            points += [[last_slip, float(rng.uniform(0.1, 0.8)) * last]]
        case "linear strength":
            scene["friction"]["strength"] = f"1 + {float(rng.uniform(-0.9, 0.9))!r}*x/{size!r}"
        case "strength":
            scene["friction"]["strength"] = f"1.1 + sin({draw(6.0)!r}*x/{size!r})"
        case "scatter":
            scene["friction"] |= {"scatter": 0.4, "scatter_length": 0.3 * size}
        case "linear f":
            linear = "{!r} + ({!r})*x + ({!r})*y"
            scales = stress / size, stress / size**2, stress / size**2
            scene["loads"]["f"] = [linear.format(*map(draw, scales)) for _ in range(2)]
        case "f":
            scene["loads"]["f"] = [wave(stress / size), wave(stress / size)]
        case "g":
            for role in scene["boundary"].values():
                if isinstance(role, dict) and role["role"] == "traction":
                    role |= {"g": [wave(stress), wave(stress)], "pressure": wave(stress)}
        case "theta":
            scene["heat"]["theta"] = wave(100.0)
    return json.dumps(scene)


@pytest.mark.parametrize(("seed", "kind"), [(seed, kind) for seed, kind in enumerate(KINDS)])
def test_no_error_of_varied_data_is_above_its_bound(seed: int, kind: str) -> None:
    error, bound, _ = bounded(varied_scene_of(seed, kind))
    assert error <= bound <= 12.0 * error


def test_a_linear_body_force_is_in_equilibrium() -> None:
    """The loads of its elements do the work of the force on every rigid motion."""
    study = study_of(REFUSED, "loads={f: ['1 + 3*x - 2*y', '2 - x + 4*y']}")
    (level,) = levels_of(study)
    bounds, scene = ErrorBounds(level), study.scenes[0]
    f, slope, oscillation = bounds._body_force(scene)
    assert not oscillation.any()
    mesh, dual = level.mesh, level.dual(scene)[0]
    load, _ = dual.volume_load(f, np.zeros((len(mesh.triangles), 3)), slope)
    x, y = mesh.points.T
    one, zero = np.ones(len(x)), np.zeros(len(x))
    # ∫f, ∫(x f_y − y f_x) over 2 × 1
    for motion, work in (((one, zero), 6.0), ((zero, one), 6.0), ((-y, x), 8.0 / 3.0)):
        assert load @ dual.rows(np.column_stack(motion)) == pytest.approx(work, rel=1e-12)


@pytest.mark.parametrize(("share", "most"), [(-0.5, 1.003), (0.6, 3.1)])
def test_the_bound_of_an_exact_solution(share: float, most: float) -> None:
    """u = (x(a + by), cxy): σ is linear and −S_T = μbx = (μb/a)u_T, so that η is the error
    itself."""
    (lam, mu), a, c = (0.3 / 0.52, 1.0 / 2.6), 0.1, 0.03
    fall = share * 0.41
    b = -fall * a / mu
    sum_ = f"{lam!r}*({a} + {b!r}*y + {c}*x)"
    xx, yy, xy = (
        f"{sum_} + {2 * mu!r}*({a} + {b!r}*y)",
        f"{sum_} + {2 * mu * c!r}*x",
        f"{mu!r}*({b!r}*x + {c}*y)",
    )
    text = f"""
units: none
body: {{rectangle: {{width: 2, height: 1}}}}
boundary: {{bottom: contact, left: clamped, right: {{role: traction, g: ["{xx}", "{xy}"]}},
           top: {{role: traction, g: ["{xy}", "{yy}"]}}}}
material: {{E: 1, nu: 0.3}}
loads: {{f: [{-(lam + mu) * c!r}, {-(lam + mu) * b!r}]}}
friction: {{law: piecewise-linear, odd: false,
            points: [[-1, -1], [-0.1, {0.1 * fall!r}], [0.5, {-0.5 * fall!r}], [1, 1]]}}
mesh: {{maxh: 0.4, levels: 3}}
"""
    study = study_of(text)
    for level in levels_of(study):
        scene, triangles = study.scenes[0], level.mesh
        v = solve_contact(level.condensed(scene).problem).v
        x, y = np.moveaxis(triangles.inner_points, 2, 0)
        strain = np.stack([a + b * y, c * x, 0.5 * (b * x + c * y)], axis=-1)
        strain -= own_strain(triangles, level.displacement(scene, v))[:, None]
        energy = (
            (stress_of(strain, np.array(lam), np.array(mu)) * strain * [1.0, 1.0, 2.0])
            .sum(axis=2)
            .mean(axis=1)
        )
        error, bounds = float(np.sqrt(triangles.area @ energy)), ErrorBounds(level)
        eta = bounds.equilibrated(
            scene, bounds.law(scene), level.displacement(scene, v).reshape(2, -1).T
        )[0]
        assert eta == pytest.approx(error, rel=1e-9)
        assert error <= bounds.look(scene, v)["error_bound"] <= most * error


REFUSED = """
units: none
body: {rectangle: {width: 2, height: 1}}
boundary: {bottom: contact, left: clamped, right: convection, top: {role: traction, g: [0.1, "x"]}}
material: {E: 1, nu: 0.3, k: 1, alpha_T: 1e-4}
heat: {alpha: 1, theta_bar: 0.3}
friction: {law: slip-weakening, tau_s: 0.1, tau_k: 0.05, delta: 0.12}
mesh: {maxh: 0.5}
"""


@pytest.mark.parametrize(
    ("change", "why"),
    [
        ("mesh.maxh=0.4", ""),
        ("loads={f: [sin(x), 0]}", ""),
        ("boundary.top.g=[x*y, 0]", ""),
        ("heat.q=exp(x)", ""),
        ("heat={theta: x*y}; boundary.right=free", ""),
        ("friction={law: piecewise-linear, points: [[0, 0.1], [0.1, 0.1], [0.1, 0.05]]}", ""),
        ("friction={law: tresca, tau: 0.1, strength: 1 + x^2}", ""),
        ("boundary.left={role: clamped, u: [y^2, 0]}", "u of left is not linear"),
        (
            "boundary.right={role: free, heat: {theta: x*y}}; heat={}",
            "theta of right is not linear",
        ),
    ],
)
def test_what_cannot_be_bounded_says_why(change: str, why: str) -> None:
    found = why_no_bound(study_of(REFUSED, *change.split("; ")).scenes[0])
    assert why in found if why else not found


def test_a_tolerance_may_be_of_the_bound(tmp_path: Path) -> None:
    """It is met at all points with a proof; what has none is refused with its place and a
    remedy."""
    text = REFUSED.replace("{maxh: 0.5}", "{maxh: 0.3, tolerance: 0.15, of: error_bound}").replace(
        '"x"', "0"
    )
    (tmp_path / "s.yaml").write_text(text + "sweep: {friction.delta: [0.2, 0.6]}\n")
    data = tcstudy.run(tmp_path / "s.yaml", tmp_path / "s.nc").to_dataset()
    bound = data["error_bound_relative"].values
    assert (bound[:, -1] <= 0.15).all()
    assert not (bound[:, :-1] <= 0.15).all(axis=0).any()
    assert "tolerance 0.15 met: bound of the relative error" in str(data["stop"].values[-1])
    accuracy = " ".join(verdict_of(tmp_path / "s.nc").accuracy)
    assert "error of u proved to be at most 1" in accuracy
    (tmp_path / "s.yaml").write_text(text.replace("delta: 0.12", "delta: 0.05"))
    data = tcstudy.run(tmp_path / "s.yaml", tmp_path / "steep.nc").to_dataset()
    assert "no bound converges where ω ≥ λ₁ of the body" in str(data["stop"].values[-1])
    with pytest.raises(
        StudyError,
        match=r"mesh.of: no bound is proved of this study: u of left is not linear in x and y",
    ):
        study_of(text, "boundary.left={role: clamped, u: [y^2, 0]}")


def test_convergence_has_the_bound_beside_the_error(tmp_path: Path) -> None:
    text = REFUSED.replace("{maxh: 0.5}", "{maxh: 0.5, levels: 4, guarantee: true}").replace(
        '"x"', "0"
    )
    (tmp_path / "s.yaml").write_text(text)
    data = tcstudy.converge(tmp_path / "s.yaml", tmp_path / "s.nc").to_dataset()
    known = data["compared"].values == 1
    assert (data["bound_u_energy"] > data["error_u_energy"])[known].all()
    assert np.isfinite(data["estimate_u_energy"]).all()
    assert "proved bound: of the relative error of u for the body itself" in text_of(
        tmp_path / "s.nc"
    )


TWO_LAWS = """
units: none
body: {rectangle: {width: 2, height: 1}}
boundary:
  bottom: contact
  top: contact
  left: {role: traction, g: [0.2, 0], spring: {normal: 1}}
  right: free
material: {E: 1, nu: 0.25}
friction:
  bottom: {law: exponential, a: 0.2, b: 0.1, delta: 0.5}
  top: {law: tresca, tau: 0.05}
mesh: {maxh: 0.5, guarantee: true}
"""


def test_a_law_with_one_kink_beside_an_exponential_one_has_a_bound(tmp_path: Path) -> None:
    (tmp_path / "s.yaml").write_text(TWO_LAWS)
    data = tcstudy.run(tmp_path / "s.yaml", tmp_path / "s.nc").to_dataset()
    assert np.isfinite(data["error_bound"].values).all()


@pytest.mark.parametrize("seed", [2, 7])
def test_slips_and_the_friction_resultant_lie_within_their_bounds(seed: int) -> None:
    """Mean slips of the segments and ∫ξ, against the mesh refined thrice."""
    study = study_of(loaded_scene_of(seed)[0], "mesh.levels=4")
    scene, levels = study.scenes[0], levels_of(study)
    coarse, fine = levels[0], levels[-1]
    problems = [level.condensed(scene).problem for level in (coarse, fine)]
    slips = [solve_contact(problem).v for problem in problems]
    bounds = ErrorBounds(coarse).look(scene, slips[0], with_slips=True)
    force, fine_force = (
        float(problem.xi(v).sum()) for problem, v in zip(problems, slips, strict=True)
    )
    assert 0.0 < abs(force - fine_force) <= bounds["friction_bound"]

    def slip_integral(level: Level, v: Array) -> tuple[Array, Array]:
        """The ends of the segments along the bottom, and ∫u_T up to them."""
        line = level.line
        u = level.displacement(scene, v).reshape(2, -1).T
        x = line.ends[:, :, 0]
        order = np.argsort(x.min(axis=1))
        steps = (line.lengths * ErrorBounds(level).slip(u).mean(axis=1))[order]
        ends = np.concatenate([x.min(axis=1)[order], [x.max()]])
        return ends, np.concatenate([[0.0], np.cumsum(steps)])

    ends, integral = slip_integral(coarse, slips[0])
    fine_integral = np.interp(ends, *slip_integral(fine, slips[1]))
    errors = np.abs(np.diff(integral - fine_integral) / np.diff(ends))
    assert 0.0 < errors.max() <= bounds["slip_bound"]


BLOCK = """
units: none
body: {rectangle: {width: 2, height: 1}}
boundary: {bottom: contact, left: clamped, right: free, top: free}
material: {E: 100, nu: 0.3}
friction: {law: tresca, tau: 1}
mesh: {maxh: 0.4, levels: 4}
"""


def slip_of_unit_energy(level: Level, scene: Scene, start: float, end: float) -> float:
    """√(φᵀÃ⁻¹φ) of P1 for the mean slip φ between two places x of the bottom."""
    line = level.line
    unknown = {int(node): i for i, node in enumerate(line.nodes)}
    mean = np.zeros(line.m)
    for nodes, ends, length in zip(line.segments, line.ends, line.lengths, strict=True):
        if start < ends[:, 0].mean() < end:
            for node in set(nodes.tolist()) & unknown.keys():
                mean[unknown[node]] += 0.5 * length / (end - start)
    compliance = mean @ np.linalg.solve(level.condensed(scene).problem.A_tilde, mean)
    return float(np.sqrt(compliance))


def test_the_slip_that_an_error_of_unit_energy_has_lies_above_that_of_p1() -> None:
    """P1 underestimates compliance, equilibrium elements overestimate it: κ_e lies above P1's value
    on finer meshes, which tends to it."""
    study = study_of(BLOCK)
    scene, levels = study.scenes[0], levels_of(study)
    factor = ErrorBounds(levels[0])._slip_factor(scene)
    places = [sorted(ends[:, 0]) for ends in levels[0].line.ends]
    below = [
        max(slip_of_unit_energy(level, scene, *ends) for ends in places) for level in levels[1:]
    ]
    assert below == sorted(below)
    assert below[-1] <= factor <= 1.1 * below[-1]
