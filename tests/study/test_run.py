"""A study through to its file: values in their places, reuse, failures, branches, solvers, numbers
on request."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr

import tcstudy
from tcstudy.contact.solve import solve_contact
from tcstudy.data.reading import asked
from tcstudy.data.schema import PointStatus
from tcstudy.errors import StudyError
from tcstudy.offline import heat
from tcstudy.offline import level as level_module
from tcstudy.offline.level import Level
from tcstudy.read.study import read_study_text
from tcstudy.reports.picture import read_picture
from tcstudy.reports.terminal.summary import text_of
from tcstudy.reports.text import fitting
from tcstudy.scene.records import Scene
from tcstudy.study import sensitivities
from tcstudy.study.level_solver import blocks_of
from tests.verification.scenes import HEATED_BRACKET, RECTANGLE, levels_of, study_of

LOADED = RECTANGLE.replace(
    "left: clamped, top: free", 'left: clamped, top: {role: traction, g: ["0.03*x", -0.01]}'
)
SWEPT = LOADED + "\nsweep: {friction.tau: [0.005, 0.01, 0.02], E: [1, 2]}\n"
COARSE = "mesh={maxh: 0.25, levels: 2}"


def run(tmp_path: Path, text: str, *overrides: str) -> xr.DataTree:
    return tcstudy.run(study_of(text, *overrides), tmp_path / "out.nc", force=True)


def test_values_stand_at_their_points(tmp_path: Path) -> None:
    """Points are solved in an order of their own; each must come back under its labels."""
    tree = run(tmp_path, SWEPT, COARSE)
    data = tree.to_dataset()
    assert data["status"].dims == ("tau", "E", "level")
    assert np.all(data["status"] == int(PointStatus.OK))
    assert data["tau"].values.tolist() == [0.005, 0.01, 0.02]
    study = study_of(SWEPT, COARSE, "sweep={}", "friction.tau=0.02", "material.E=2")
    level = levels_of(study)[1]
    alone = solve_contact(level.condensed(study.scenes[0]).problem)
    stored, point = (
        tree["level_1"].to_dataset().sel(tau=0.02, E=2),
        data.sel(tau=0.02, E=2, level=1),
    )
    assert np.max(np.abs(stored["u_T"].values - alone.v)) < 1e-14
    assert 0 < float(point["slip_length"]) < 2
    assert float(point["friction_resultant"]) == pytest.approx(
        float(stored["xi"] @ tree["level_1"]["c"]), rel=1e-12
    )
    assert np.all(
        data["lambda_1"].sel(E=2) == pytest.approx(2 * data["lambda_1"].sel(E=1).values, rel=1e-10)
    )


@pytest.mark.parametrize(("material", "ratios"), [("E: [1, 0.3, 7.7]", 1), ("nu: [0.2, 0.3]", 2)])
def test_one_factorisation_a_mesh_and_ratio(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, material: str, ratios: int
) -> None:
    """λ/μ makes the factor, E only scales it; a new ratio takes over the order of elimination."""
    plans, original = [], level_module.condense
    monkeypatch.setattr(
        level_module, "condense", lambda *a, **k: plans.append(k["plan"]) or original(*a, **k)
    )
    text = SWEPT.replace("E: [1, 2]", material)
    tree = run(tmp_path, text, COARSE, "mesh.guarantee=false")
    assert np.all(tree["status"] == int(PointStatus.OK))
    assert len(plans) == 2 * ratios
    assert sum(plan is None for plan in plans) == 2


KNOWN = ("boundary.right={role: traction, g: [0.01, 0.02*y], pressure: 0.03}", "boundary.bore=free")


@pytest.mark.parametrize(
    "changes",
    [("material.alpha_T=0",), ("heat={theta: 3}", *KNOWN), ("heat={alpha: 1, theta_bar: 5}",)],
)
def test_no_heat_problem_where_none_is_needed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, changes: tuple[str, ...]
) -> None:
    monkeypatch.setattr(heat, "HeatFactor", None)  # which nothing can call
    tree = run(tmp_path, HEATED_BRACKET, *changes)
    assert np.all(tree["status"] == int(PointStatus.OK)), tree["reason"].values


def test_sticking_nodes_are_stored_wherever_the_law_jumps_up(tmp_path: Path) -> None:
    """At u_T = 0 and at the second jump; c of the others is the slip length, and draw takes what is
    stored."""
    jumps = "friction={law: piecewise-linear, points: [[0, 0.004], [0.01, 0.004], [0.01, 0.012]]}"
    found = run(
        tmp_path,
        RECTANGLE,
        jumps,
        "mesh.levels=2",
        'boundary.top={role: traction, g: ["0.01 + 0.01*x", 0]}',
    )
    fine = found["level_1"].to_dataset()
    sticks, u_T = fine["sticks"].values == 1, np.abs(fine["u_T"].values)
    assert set(np.unique(fine["sticks"])) == {0, 1}
    assert (u_T[sticks] == 0.01).any()
    assert np.array_equal(np.isin(u_T, (0.0, 0.01)), sticks)
    assert fine["c"].values[~sticks].sum() == pytest.approx(
        float(found["slip_length"].isel(level=1)), rel=1e-14
    )
    np.testing.assert_array_equal(read_picture(tmp_path / "out.nc").line.sticks, sticks)  # type: ignore[arg-type]


@pytest.mark.parametrize("size", [1e-9, 1e9])
def test_a_film_without_friction_has_none(tmp_path: Path, size: float) -> None:
    """Else the rounding of l̃ − Ãv would look like a traction that changes by half from level to
    level."""
    load = f'boundary.top={{role: traction, g: ["{size!r}*(1 + x)", 0]}}'
    found = run(tmp_path, RECTANGLE, load, "friction.tau=0", COARSE)
    assert found["status"].values.tolist() == [1, 1]
    assert found["friction_resultant"].values.tolist() == [0.0, 0.0]
    assert not found["level_1"]["xi"].values.any()
    assert (found["inclusion_residual"].values > 0.0).all()
    *_, row = (
        line.split()
        for line in text_of(tmp_path / "out.nc").splitlines()
        if "unique" in line.split() and ":" not in line
    )
    assert (row[2], row[-1]) == ("0", "0")  # ∫ξ and its change


UP_AND_DOWN = """
units: none
body: {rectangle: {width: 1.3, height: 1}}
boundary:
  bottom: contact
  top: {role: clamped, u_x: 0.5, u_y: 0}
  left: {role: clamped, u_y: 0}
  right: {role: clamped, u_y: 0}
material: {lambda: 1.7, mu: 1}
friction: {law: slip-weakening, tau_s: 1, tau_k: 0.2, delta: 0.4}
mesh: {maxh: 0.3}
sweep: {mode: list, points: [{boundary.top.u_x: 0.5}, {boundary.top.u_x: 0.8}, {boundary.top.u_x: 1.2},
                             {boundary.top.u_x: 0.81}, {boundary.top.u_x: 0.55}]}
"""


@pytest.mark.parametrize(
    ("branch", "slips"), [("continued", [0, 0, 1.0, 0.61, 0]), ("lowest", [0, 0.6, 1, 0.61, 0])]
)
def test_branches_in_a_loop_of_loading_and_unloading(
    tmp_path: Path, branch: str, slips: list[float]
) -> None:
    """U = 0.8 has s = 0 (energy 0.32), 0.2 (unstable) and 0.6 (0.30): continuation keeps the branch
    it is on."""
    tree = run(tmp_path, UP_AND_DOWN, f"solver={{branch: {branch}}}")
    assert np.all(tree["status"] == 1)
    u_T = tree["level_0"]["u_T"].values
    assert np.max(np.ptp(u_T, axis=1)) < 1e-11
    assert u_T[:, 0] == pytest.approx(slips, abs=1e-11)


def test_blocks_hold_every_point_once_and_have_one_factor() -> None:
    study = study_of(
        RECTANGLE, "sweep={E: [1, 2], nu: [0.2, 0.3], friction.tau: {linspace: [1, 2, 700]}}"
    )
    blocks = blocks_of(study, 11, 100)
    assert np.array_equal(np.sort(np.concatenate([b.points for b in blocks])), np.arange(2800))
    assert [len(b.points) for b in blocks] == [700] * 4
    assert all(
        len({study.scenes[int(i)].material.nu for i in block.points}) == 1 for block in blocks
    )


def test_several_solvers_are_compared(tmp_path: Path) -> None:
    tree = run(tmp_path, LOADED, "solver=[separable-newton, bundle-newton]", COARSE)
    assert tree["solver"].values.tolist() == ["separable-newton", "bundle-newton"]
    assert float(tree["solver_difference"].max()) < 1e-9
    assert np.all(tree["solver_difference"].sel(solver="separable-newton") == 0)
    assert float(tree["solver_residual"].max()) <= 1e-10
    energies = tree["solver_energy"].values
    assert energies[:, 0] == pytest.approx(energies[:, 1], rel=1e-10)
    assert energies[:, 0] == pytest.approx(tree["energy"].values, rel=1e-14)


BAR = """
body: {rectangle: {width: 200 mm, height: 50 mm}}
boundary:
  bottom: contact
  left: {role: symmetry, heat: {theta: 40 K}}
  right: {role: convection, g: [3 MPa, 0], alpha: 450 W/(m^2*K), theta_bar: 10 K}
  top: free
material: {E: 200 GPa, nu: 0.25, plane: stress, k: 45 W/(m*K), alpha_T: 0}
friction: {law: linear, k: 0}
mesh: {maxh: 40 mm}
sweep: {alpha_T: [0, 1e-5 1/K]}
output: {probes: {tip: [200 mm, 0 mm], core: [70 mm, 20 mm]}, quantities: [reactions, theta_edges, von_mises]}
"""


@pytest.mark.parametrize("plane", ["stress", "strain"])
def test_linear_fields_are_exact(tmp_path: Path, plane: str) -> None:
    """Without expansion σ_xx = 3 MPa alone; θ falls from 40 K by q (L/k + 1/α) to 10 K, q = 4500
    W/m²."""
    tree = run(tmp_path, BAR.replace("stress", plane)).to_dataset().isel(level=0)
    data, warm = tree.isel(alpha_T=0), tree.isel(alpha_T=1)
    sigma, E, nu = 3e6, 200e9, 0.25
    if plane == "strain":
        E, nu = E / (1 - nu**2), nu / (1 - nu)
    for name, (x, y) in {"tip": (0.2, 0.0), "core": (0.07, 0.02)}.items():
        assert float(data[f"probe_{name}_u_x"]) == pytest.approx(sigma * x / E, rel=1e-11)
        assert float(data[f"probe_{name}_u_y"]) == pytest.approx(-nu * sigma * y / E, abs=1e-17)
        assert float(data[f"probe_{name}_sigma_xx"]) == pytest.approx(sigma, rel=1e-11)
        assert abs(float(data[f"probe_{name}_sigma_yy"])) < 1e-10 * sigma
    assert float(data["probe_tip_u_T"]) == pytest.approx(float(data["probe_tip_u_x"]), rel=1e-13)
    assert "probe_core_u_T" not in data
    assert float(data["reaction_left_x"]) == pytest.approx(-sigma * 0.05, rel=1e-11)
    assert abs(float(data["reaction_bottom_y"])) < 1e-10 * sigma
    exact = sigma if plane == "stress" else sigma * np.sqrt(1 - 0.25 + 0.25**2)
    assert float(data["von_mises_max"]) == pytest.approx(exact, rel=1e-11)
    assert data["von_mises_max"].attrs["units"] == "Pa"
    for edge, mean in {"left": 40.0, "right": 20.0, "top": 30.0, "bottom": 30.0}.items():
        assert float(warm[f"theta_mean_{edge}"]) == pytest.approx(mean, rel=1e-12)
    assert float(warm["probe_core_theta"]) == pytest.approx(33.0, rel=1e-12)
    with fitting(80):  # what was asked for pushes no proof out of the table
        text = text_of(tmp_path / "out.nc")
    assert all(title in text for title in ("∫ξ", "certified  ", *asked(tree)))


def test_a_number_that_breaks_down_ends_its_point_and_no_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The solution stays in the file with the reason beside it, and nothing of what was asked
    for."""
    original = sensitivities.derivatives_of

    def broken(level: Level, scene: Scene, *more: Any) -> dict[str, float]:
        if not scene.material.expands:
            raise RuntimeError("no such element")
        return original(level, scene, *more)

    monkeypatch.setattr(sensitivities, "derivatives_of", broken)
    data = run(tmp_path, BAR.replace("output: {", "output: {sensitivity: [E], ")).isel(level=0)
    assert data["status"].values.tolist() == [PointStatus.ERROR, PointStatus.OK]
    assert str(data["reason"][0].values) == "numbers on request: RuntimeError: no such element"
    asked = ("probe_tip_u_x", "sensitivity_u_T_max_E", "u_T_max")
    assert [np.isnan(data[name].values).tolist() for name in asked] == [
        [True, False],
        [True, False],
        [False, False],
    ]


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("[70 mm, 20 mm]", "[70 mm, 80 mm]", "output.probes.core: the point (0.07, 0.08) is 0.03 outside the body"),
        ("{tip: [200 mm, 0 mm], core: [70 mm, 20 mm]}", "[1, 2]",
         "output.probes: must be a mapping of names to points, but is a list"),
        ("core: [70 mm", "a b: [70 mm", "is not a name; use at most 100 letters, digits and _"),
        ("von_mises]", "von_mieses]", "did you mean 'von_mises'?"),
    ],
)  # fmt: skip
def test_faults_of_requests_are_one_line(old: str, new: str, said: str) -> None:
    assert old in BAR
    with pytest.raises(StudyError) as caught:
        read_study_text(BAR.replace(old, new))
    assert said in str(caught.value)
    assert len(caught.value.problems) == 1
