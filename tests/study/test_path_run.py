"""A study's path: the stable solutions of runs lie on it, thermal and mechanical parameters,
refusals, all branches."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from tcstudy.cli import main
from tcstudy.contact.boxes import Limits
from tcstudy.data.records import BlockRecord, Record
from tcstudy.data.schema import PointStatus
from tcstudy.fem.geometry import build
from tcstudy.offline.level import Level
from tcstudy.read.study import read_study, read_study_text
from tcstudy.scene.parameters import path_scene
from tcstudy.study import path_run
from tcstudy.study.path_run import PathError, affine_load, follow_path, shortfalls
from tcstudy.study.run import run
from tests.commands import CONFIGS
from tests.data.by_points import one_by_one
from tests.verification.scenes import HEATED_BRACKET, mesh_family

PAD = CONFIGS / "path.yaml"
VALUES = (0.2e-3, 0.75e-3, 0.85e-3, 0.9e-3, 1.0e-3, 1.1e-3, 1.6e-3)


def distance(record: Record, t: float, v: np.ndarray) -> float:
    """How far v is from the nearest solution of t on the path, relative to the largest slip on
    it."""
    T, u = record.values["parameter"], record.values["u_T"]
    pieces = np.flatnonzero((np.minimum(T[:-1], T[1:]) <= t) & (np.maximum(T[:-1], T[1:]) >= t))
    s = (t - T[pieces]) / (T[pieces + 1] - T[pieces])
    points = u[pieces] + s[:, None] * (u[pieces + 1] - u[pieces])
    return float(np.min(np.max(np.abs(points - v), axis=1)) / np.max(np.abs(u)))


def test_stable_solutions_of_a_run_lie_on_a_path_whose_energy_follows_its_rate() -> None:
    study = read_study(PAD, ["mesh.levels=2"])
    record = follow_path(study)
    curve = record.values
    assert shortfalls(study, record) == []
    assert len(curve["fold_vertex"]) >= 8
    assert curve["residual"].max() <= 1e-11
    mean, size = (
        0.5 * (curve["energy_rate"][1:] + curve["energy_rate"][:-1]),
        np.ptp(curve["energy"]),
    )
    assert np.diff(curve["energy"]) == pytest.approx(
        np.diff(curve["parameter"]) * mean, abs=1e-9 * size
    )
    sweep = f"sweep={{boundary.plate.u_x: [{', '.join(map(repr, VALUES))}]}}"
    asked = read_study(
        PAD, ["solver=separable-newton", "mesh.levels=2", "solver.branch=lowest", sweep]
    )
    blocks = (one for one in run(asked) if isinstance(one, BlockRecord) and one.level == 1)
    points = [point for block in blocks for point in one_by_one(block)]
    assert len(points) == len(VALUES)
    for point in points:
        assert point.status == PointStatus.OK
        assert distance(record, VALUES[point.index[0]], point.u_T) <= 1e-10


@pytest.mark.parametrize(
    "section",
    [
        "{parameter: q, from: 0, to: 3, at: [1]}",
        "{parameter: load, from: 0, to: -4, at: [-2], level: 0}",
        "{parameter: boundary.left.g_x, from: 0.1, to: -0.3, at: [0], direction: forward}",
    ],
)
def test_all_kinds_of_parameters_on_the_heated_bracket(section: str) -> None:
    """Solutions and vertices are those of the assembled scene, whatever carries the parameter."""
    # falls faster than it is stiff
    soft = "friction: {law: slip-weakening, tau_s: 0.004, tau_k: 0.001, delta: 0.002}"
    study = read_study_text(f"{re.sub(r'friction: .*', soft, HEATED_BRACKET)}path: {section}\n")
    plan, record = study.path, follow_path(study)
    assert plan
    values = record.values
    assert values["solution_count"] != [0]
    level = Level(
        list(mesh_family(build(plan.scene.body), study.mesh))[values["level"]], plan.scene
    )
    found = [
        (plan.at[0], v, e)
        for v, e in zip(values["solution_u_T"], values["solution_energy"], strict=True)
    ]
    vertices = zip(values["parameter"], values["u_T"], values["energy"], strict=True)
    for t, v, energy in [*found, *list(vertices)[::9]]:
        condensed = level.condensed(path_scene(plan.scene, plan.parameter, float(t)))
        assert condensed.problem.inclusion_residual(v, 1e-9 * np.ptp(values["u_T"])) <= 1e-10
        assert energy == pytest.approx(condensed.problem.energy(v) + condensed.constant, rel=1e-10)
    if "direction: forward" in section:
        assert values["start"] == 0
        assert values["parameter"][0] == plan.begin


def test_a_parameter_that_is_not_affine_is_refused() -> None:
    study = read_study_text(HEATED_BRACKET)
    scene = study.scenes[0]
    level = Level(next(iter(mesh_family(build(scene.body), study.mesh))), scene)
    with pytest.raises(PathError, match=r"not affine in alpha \(relative deviation"):
        affine_load(
            level, lambda t: replace(scene, heat=replace(scene.heat, alpha=t)), 0.5, 2.0, "alpha"
        )
    with pytest.raises(PathError, match="stiffness changes with mu"):
        affine_load(
            level, lambda t: replace(scene, material=replace(scene.material, mu=t)), 0.5, 2.0, "mu"
        )
    with pytest.raises(PathError, match="does not depend on nothing"):
        affine_load(level, lambda t: scene, 0.5, 2.0, "nothing")


def test_the_pad_has_a_loop_that_the_path_does_not_meet(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """m = 21: a loop from 0.718462 to 0.9406 mm, and 5, 7 and 3 equilibria."""
    file = tmp_path / "pad.nc"
    asked = ["run", str(PAD), "--set", "mesh.levels=1", "--set"]
    assert main([*asked, "path.complete=true", f"--output={file}"]) == 0
    said = capsys.readouterr().out
    assert "1 open branch and 1 closed branch; complete (proved)" in said
    assert "an isola from 0.7185 to 0.9406 mm, which the path does not meet" in said
    assert "7 equilibria at 0.9 mm, 2 of them not on the path from the start" in said
    with xr.open_dataset(file) as data:
        [k] = np.flatnonzero(data["branch_loop"].values)
        t = data["branch_parameter"].values[data["branch_of"].values == k]
        np.testing.assert_allclose([t.min(), t.max()], [0.718462e-3, 0.9406e-3], rtol=1e-5)
        assert t[0] == t[-1]
        assert data["solution_count"].values.tolist() == [5, 7, 3]
        least = data["solution_lowest"].values.astype(bool)
        assert data["solution_global_minimum"].values[least].all()
        assert data["solution_residual"].values.max() < 1e-10
    assert main(["draw", str(file), str(tmp_path / "pad.svg")]) == 0
    assert "not met by the path" in (tmp_path / "pad.svg").read_text(encoding="utf-8")


def test_the_joint_has_thirteen_loops() -> None:
    values = follow_path(read_study(CONFIGS / "isola.yaml", ["path.hysteresis=false"])).values
    assert values["complete"]
    assert (sum(values["branch_loop"]), values["solution_count"]) == (13, [69])
    assert np.count_nonzero(np.array(values["solution_piece"]) < 0) == 26


def test_without_load_a_law_without_jumps_has_one_solution() -> None:
    """Its slips are rounding, other on the path than on its branch."""
    law = "friction={law: piecewise-linear, points: [[0, 0 kPa], [0.1 mm, 100 kPa], [0.5 mm, 20 kPa]]}"
    ends = [
        "path.from=2 mm",
        "path.to=0 mm",
        "path.within=[-1 mm, 3 mm]",
        "path.at=[0 mm, 1e-10 mm]",
    ]
    study = read_study(
        PAD, ["mesh.levels=1", "path.complete=true", "path.hysteresis=false", law, *ends]
    )
    values = follow_path(study).values
    assert values["complete"]
    assert values["solution_count"] == [1, 1]
    assert values["solution_unique"].all()


def test_where_the_range_is_not_proved_values_are(monkeypatch: pytest.MonkeyPatch) -> None:
    """The loop is followed from what is listed at 0.9 mm, and what is known of each value is
    said."""
    monkeypatch.setattr(path_run, "LIMITS", replace(Limits(), boxes=40))
    study = read_study(PAD, ["mesh.levels=1", "path.complete=true", "path.hysteresis=false"])
    record = follow_path(study)
    values = record.values
    assert not values["complete"]
    assert any(
        "not proved to be all: the limit of boxes" in one for one in shortfalls(study, record)
    )
    assert sum(values["branch_loop"]) == 1
    assert values["solution_count"] == [5, 7, 3]
    assert values["at_complete"].tolist() == [True, False, False]
    least, of = (np.array(values[name]) for name in ("solution_lowest", "solution_at"))
    assert values["solution_global_minimum"][least & (of == 0)].all()
