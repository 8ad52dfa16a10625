"""Balls that hold solutions of the body, for ω > λ₁: exact solutions, finer meshes, dense samples."""

import json
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from numpy.typing import NDArray

import tcstudy
from tcstudy.accuracy.norms import prolongation
from tcstudy.contact.all_solutions import all_solutions
from tcstudy.contact.solve import solve_contact
from tcstudy.fem.energy_error import own_strain, stress_of
from tcstudy.laws.laws import Laws
from tcstudy.laws.shapes import piecewise_linear
from tcstudy.offline import existence
from tcstudy.offline.error_bound import PARTS
from tcstudy.offline.existence import Existence, count_of_body, distances_of
from tcstudy.offline.level import Level
from tcstudy.reports.figures import style
from tcstudy.reports.figures.sweep import curves_figure, read_sweep
from tcstudy.reports.terminal.summary import verdict_of
from tests.verification.scenes import levels_of, study_of
from tests.verification.test_error_bound import energy_norm, loaded_scene_of, varied_scene_of

Array = NDArray[np.float64]

BLOCK = """
units: none
body: {rectangle: {width: 1, height: 0.5}}
boundary: {bottom: contact, left: {role: traction, spring: {normal: 0.05}}, top: free, right: free}
material: {E: 1, nu: 0.3}
loads: {f: [0.007, 0]}
friction: {law: slip-weakening, tau_s: 0.01, tau_k: 0.002, delta: 0.02}
mesh: {maxh: 0.25, levels: 3}
"""


def test_a_block_on_a_spring_has_three_equilibria() -> None:
    """ω is 16 λ₁: it sticks or slides; both are proved on the third mesh, not on the second."""
    study = study_of(BLOCK)
    scene = study.scenes[0]
    counts, needs = [], []
    for size, level in zip((0.125, 0.0625), levels_of(study)[1:], strict=True):
        assert scene.one_law.omega > 16.0 * level.band(scene).high
        problem = level.condensed(scene).problem
        solutions = all_solutions(problem)
        assert solutions.complete
        assert solutions.stable.tolist() == [True, True, False]
        distances = distances_of(problem.A_tilde, solutions.v)
        limits = 0.5 * np.where(np.eye(3) > 0.0, np.inf, distances).min(axis=1)
        proof = Existence(level)
        balls = [proof.ball(scene, v, limit) for v, limit in zip(solutions.v, limits, strict=True)]
        radii = [ball.radius for ball in balls]
        assert np.isnan(radii[2])
        assert balls[2].need < 0.0
        assert np.isnan(balls[2].size_needed(0.1))
        assert all(2.0 * ball.eta < ball.radius for ball in balls[:2] if ball.radius > 0.0)
        counts.append(count_of_body(radii, distances))
        needs.append(min(ball.size_needed(size) / size for ball in balls[:2]))
    assert counts == [1, 3]
    assert 0.4 < needs[0] < 1.0
    assert needs[1] == 1.0


@pytest.mark.parametrize(("margin", "most"), [(0.3, (2.1, 2.1, 2.1)), (0.03, (7.0, 3.2, 2.2))])
def test_an_exact_solution_is_in_its_ball(margin: float, most: tuple[float, ...]) -> None:
    """u = (x(a + by), cxy) of test_error_bound.py, and a steep fall not far beyond its slips.

    η is the error, and the ball has twice that radius: L is no larger than L(u_h) there.
    """
    (lam, mu), a, c = (0.3 / 0.52, 1.0 / 2.6), 0.1, 0.03
    rise = 0.2
    b = rise * a / mu
    sum_ = f"{lam!r}*({a} + {b!r}*y + {c}*x)"
    xx = f"{sum_} + {2 * mu!r}*({a} + {b!r}*y)"
    yy = f"{sum_} + {2 * mu * c!r}*x"
    xy = f"{mu!r}*({b!r}*x + {c}*y)"
    far = 0.2 + margin
    text = f"""
units: none
body: {{rectangle: {{width: 2, height: 1}}}}
boundary: {{bottom: contact, left: clamped, right: {{role: traction, g: ["{xx}", "{xy}"]}},
           top: {{role: traction, g: ["{xy}", "{yy}"]}}}}
material: {{E: 1, nu: 0.3}}
loads: {{f: [{-(lam + mu) * c!r}, {-(lam + mu) * b!r}]}}
friction: {{law: piecewise-linear, odd: false, points: [[-1, {-rise}], [0, 0],
           [{far!r}, {rise * far!r}], [{far + 0.01!r}, 0]]}}
mesh: {{maxh: 0.2, levels: 3}}
"""
    study = study_of(text)
    scene = study.scenes[0]
    for level, factor in zip(levels_of(study), most, strict=True):
        assert scene.one_law.omega > 3.0 * level.band(scene).high
        v = solve_contact(level.condensed(scene).problem, branch="from-zero").v
        x, y = np.moveaxis(level.mesh.inner_points, 2, 0)
        strain = np.stack([a + b * y, c * x, 0.5 * (b * x + c * y)], axis=-1)
        strain -= own_strain(level.mesh, level.displacement(scene, v))[:, None]
        stress = stress_of(strain, np.array(lam), np.array(mu))
        energy = (stress * strain * [1.0, 1.0, 2.0]).sum(axis=2).mean(axis=1)
        error = float(np.sqrt(level.mesh.area @ energy))
        ball = Existence(level).ball(scene, v)
        assert ball.eta == pytest.approx(error, rel=1e-9)
        assert 2.0 * error < ball.radius < factor * error


def softer_than_unique(text: str, seed: int) -> str:
    """Return the scene with a law that falls 1.2 to 4 times as steeply as λ₁ of the body."""
    scene, study = json.loads(text), study_of(text)
    low = levels_of(study)[0].band(study.scenes[0]).low
    rng = np.random.default_rng([7, seed])
    peak = scene["friction"]["points"][0][1]
    steepness = float(rng.uniform(1.2, 4.0))
    end = float(rng.uniform(0.1, 0.8)) * peak
    begin = float(rng.uniform(0.0, 0.2)) * peak / low
    scene["friction"]["points"] = [[0.0, peak], [begin, peak]]
    scene["friction"]["points"] += [[begin + (peak - end) / (steepness * low), end]]
    return json.dumps(scene)


def radius_and_distance(text: str) -> tuple[float, float]:
    """Return the radius on the coarse mesh, and how far the solution of the fine one is."""
    study = study_of(text, "mesh.levels=3")
    scene, levels = study.scenes[0], levels_of(study)
    v = solve_contact(levels[0].condensed(scene).problem).v
    radius = Existence(levels[0]).radius(scene, v)
    u = prolonged(levels, levels[0].displacement(scene, v))
    problem = levels[-1].condensed(scene).problem
    fine = solve_contact(problem, branch="continued", neighbour=slips_of(levels[-1], u)).v
    return radius, energy_norm(levels[-1], scene, levels[-1].displacement(scene, fine) - u)


def prolonged(levels: list[Level], u: Array) -> Array:
    """Return a displacement (2n,) of the first mesh on the last one."""
    components = u.reshape(2, -1)
    for coarse, fine in pairwise(level.mesh for level in levels):
        onto_fine = prolongation(coarse.n_points, fine.points, fine.triangles)
        components = (onto_fine @ components.T).T
    return np.asarray(components.ravel())


@pytest.mark.parametrize("seed", range(5))
def test_a_finer_solution_is_in_every_ball(seed: int) -> None:
    radius, distance = radius_and_distance(softer_than_unique(loaded_scene_of(seed)[0], seed))
    assert distance < radius < 8.0 * distance


@pytest.mark.parametrize(("seed", "kind"), [(1, "linear strength"), (2, "strength"), (5, "f")])
def test_a_finer_solution_of_varied_data_is_in_its_ball(seed: int, kind: str) -> None:
    radius, distance = radius_and_distance(softer_than_unique(varied_scene_of(seed, kind), seed))
    assert distance < radius < 12.0 * distance


def test_an_exponential_law_has_its_ball() -> None:
    law = {"law": "exponential", "a": 0.008, "b": 0.006, "delta": 0.01}
    study = study_of(BLOCK, "mesh.levels=2", f"friction={json.dumps(law)}", "loads.f=[0.03, 0]")
    scene, level = study.scenes[0], levels_of(study)[1]
    assert scene.one_law.omega > 8.0 * level.band(scene).high
    v = solve_contact(level.condensed(scene).problem).v
    ball = Existence(level).ball(scene, v)
    assert 2.0 * ball.eta < ball.radius < 3.0 * ball.eta


def slips_of(level: Level, u: Array) -> Array:
    """Return the slips (m,) of a displacement u (2n,) at the contact nodes of a straight Γ_C."""
    line = level.line
    along = (line.ends[:, 1] - line.ends[:, 0]) / line.lengths[:, None]
    slip = np.einsum("sed,sd->se", u.reshape(2, -1).T[line.segments], along)
    v = np.zeros(line.m)
    is_free = line.unknowns >= 0
    v[line.unknowns[is_free]] = slip[is_free]
    return v


def random_law(rng: np.random.Generator) -> Laws:
    """Return a law on [-1, 1] with steps, falls and rises."""
    slips = np.sort(rng.uniform(-1.0, 1.0, 5))
    points = [(float(s), float(rng.normal())) for s in slips]
    points.insert(2, (points[1][0], float(rng.normal())))
    return piecewise_linear(points, odd=False, slope=None, slopes=[0.3, 0.1])


@pytest.mark.parametrize("seed", range(6))
def test_no_sample_is_above_the_closed_form_of_m(seed: int) -> None:
    """D ≥ −½ws² − m inside the window, D ≥ −½(w + Ω)s² − m beyond it, m nearly the least."""
    rng = np.random.default_rng(seed)
    law, segments = random_law(rng), 4
    xi, slip = rng.normal(size=(2, segments, 2))
    slip[0] = slip[0, 0]  # at rest
    strengths = None
    if seed % 2:
        ends = np.sort(rng.uniform(0.2, 2.0, (2, segments, 1)), axis=0)
        strengths = np.repeat(ends, PARTS, axis=2)
    (parts,) = existence._parts_of(law, xi, slip, strengths)
    window = existence._window(parts, rng.uniform(0.1, 1.0, segments), 1e-3)
    w = rng.uniform(-2.0, 2.0, segments)  # any will do
    Omega = np.maximum(window.beyond - w, 0.0) * existence.NEARER**2
    m = existence._mean_m(parts, window.delta, w, Omega)
    x = (np.arange(100) + 0.5) / 100
    s = np.concatenate([np.linspace(-6.0, 6.0, 4001), [-100.0, 100.0]])
    for i in range(segments):
        v = slip[i, 0] + (slip[i, 1] - slip[i, 0]) * x[:, None]
        traction = xi[i, 0] + (xi[i, 1] - xi[i, 0]) * x[:, None]
        weight = w[i] + np.where(np.abs(s) > window.delta[i], Omega[i], 0.0)
        samples = np.full(len(x), -np.inf)
        for strength in (1.0,) if strengths is None else strengths[:, i, 0]:
            D = strength * law.integral(v, v + s) - traction * s
            samples = np.maximum(samples, (-D - 0.5 * weight * s**2).max(axis=1))
        least = max(float(samples.mean()), 0.0)
        assert least - 1e-5 <= m[i] <= 1.15 * least + 2e-2


def test_no_mean_slip_is_beyond_its_window() -> None:
    """|πe_T(x)| ≤ κ‖e‖ of any e on a finer mesh, and nearly so for the worst of them."""
    study = study_of(BLOCK, "mesh.levels=4")
    scene, levels = study.scenes[0], levels_of(study)
    coarse, fine = levels[1].line, levels[3].line
    kappa = Existence(levels[1])._line(scene).kappa
    A_tilde = levels[3].condensed(scene).problem.A_tilde
    # values of πe_T at the ends of coarse segments, of four fine segments each
    ends = np.zeros((len(coarse.lengths), 2, fine.m))
    for i, (segment, numbers) in enumerate(zip(fine.ends, fine.unknowns, strict=True)):
        middle = segment.mean(axis=0)
        own = int(np.argmin(np.hypot(*(coarse.ends.mean(axis=1) - middle).T)))
        first, last = coarse.ends[own]
        places = (segment - first) @ (last - first) / coarse.lengths[own] ** 2
        share = fine.lengths[i] / coarse.lengths[own]
        for place in places[0] + (places[1] - places[0]) * existence.GAUSS:
            shape = (places[1] - place, place - places[0])
            # the dual basis of 1 − x and x
            duals = (4.0 - 6.0 * place, 6.0 * place - 2.0)
            for end, dual in enumerate(duals):
                for number, value in zip(numbers, shape, strict=True):
                    ends[own, end, number] += 0.5 * share * dual * value / (places[1] - places[0])
    compliance = np.einsum("sem,mn,sen->se", ends, np.linalg.inv(A_tilde), ends)
    largest = np.sqrt(compliance.max(axis=1))
    assert np.all(largest < kappa)
    assert np.all(largest > 0.9 * kappa)


def drawn_in_bold_rings(file: Path, v: Array, radii: Array) -> None:
    """Check that a picture over the load has all equilibria, and rings where the body has one."""
    pytest.importorskip("matplotlib")
    sweep = read_sweep(file, ("f",), "u_T_max", None, 0)
    with style.styled():
        figure = curves_figure(sweep, style.Look())
    lines = {str(line.get_label()): line for line in figure.axes[0].lines}
    (words,) = (label for label in lines if "proved for the body itself" in label)
    heights = {label: np.asarray(line.get_ydata()) for label, line in lines.items()}
    largest = np.abs(v).max(axis=1)
    drawn = np.concatenate([heights["stable equilibria"], heights["unstable equilibria"]])
    np.testing.assert_allclose(np.sort(drawn), np.sort(largest))
    np.testing.assert_allclose(np.sort(heights[words]), np.sort(largest[np.isfinite(radii)]))
    assert f"{np.nanmax(radii):.2g}" in words


def test_a_study_says_how_many_solutions_the_body_has(tmp_path: Path) -> None:
    """Two loads on one mesh: one has three, one does not slide."""
    path = tmp_path / "block.yaml"
    path.write_text(BLOCK)
    loads = "sweep={loads.f: [[0.007, 0], [0.001, 0]]}"
    fine = "mesh={maxh: 0.0625, guarantee: true}"
    proving = tcstudy.load(path, [fine, loads, "solver.branch=all"])
    tcstudy.run(proving, tmp_path / "s.nc").close()
    with xr.open_datatree(tmp_path / "s.nc") as tree:
        root, line = tree.to_dataset().isel(level=0), tree["level_0"]
        assert root["solutions"].values.tolist() == [3, 1]
        assert root["solutions_of_body"].values.tolist() == [3, 1]
        assert np.all(np.isnan(root["existence_size"]))
        radii = np.asarray(line["existence_radius"])
        is_stable = np.asarray(line["solution_stable"]) == 1
        np.testing.assert_array_equal(np.isfinite(radii), is_stable)
        scene, (level,) = proving.scenes[0], levels_of(proving)
        v = np.asarray(line["solution_u_T"])[0]
        assert radii[0] == pytest.approx(Existence(level).radius(scene, v), rel=1e-6)
    drawn_in_bold_rings(tmp_path / "s.nc", np.asarray(line["solution_u_T"]), radii)
    words = "the body itself has at least three equilibria at 1 of 2"
    assert words in verdict_of(tmp_path / "s.nc").trust
    coarse = tcstudy.load(path, ["mesh={maxh: 0.125, guarantee: true}", "solver.branch=all"])
    tcstudy.run(coarse, tmp_path / "c.nc").close()
    (fact,) = (fact for fact in verdict_of(tmp_path / "c.nc").trust if "not proved" in fact)
    words, _, size = fact.rpartition(" = ")
    assert words == "several equilibria of the body itself not proved: needs about h_max"
    assert 0.0625 < float(size) < 0.19


def test_only_disjoint_balls_are_counted() -> None:
    distances = np.array([[0.0, 3.0, 9.0], [3.0, 0.0, 6.0], [9.0, 6.0, 0.0]])
    nan = float("nan")
    assert count_of_body([nan, nan, nan], distances) == 0
    assert count_of_body([1.0, nan, nan], distances) == 1
    assert count_of_body([1.0, 2.0, nan], distances) == 1  # they touch
    assert count_of_body([1.0, 1.9, nan], distances) == 3
    assert count_of_body([1.0, 1.9, 4.0], distances) == 4
    assert count_of_body([1.0, 2.5, 4.0], distances) == 3
