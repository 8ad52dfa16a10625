"""Which solution a study stores where there are several, and several solvers side by side."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import tcstudy
from tcstudy.data.records import BlockRecord, PointStatus
from tcstudy.scene.study import Study
from tcstudy.study.level_solver import Solutions, blocks_of
from tests.verification.patch import CASES, LENGTH, SOFTENING, patch_study
from tests.verification.scenes import RECTANGLE, study_of

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


def slips(tmp_path: Path, branch: str) -> np.ndarray:
    tree = tcstudy.run(study_of(UP_AND_DOWN, f"solver={{branch: {branch}}}"), tmp_path / f"{branch}.nc")
    assert np.all(tree["status"] == 1)
    u_T = tree["level_0"]["u_T"].values
    assert np.max(np.ptp(u_T, axis=1)) < 1e-11
    return u_T[:, 0]


def test_branches_in_a_loop_of_loading_and_unloading(tmp_path: Path) -> None:
    """U = 0.8 has s = 0 (energy 0.32), 0.2 (unstable) and 0.6 (0.30): continuation keeps the branch it is on."""
    assert slips(tmp_path, "continued") == pytest.approx([0, 0, 1.0, 0.61, 0], abs=1e-11)
    assert slips(tmp_path, "lowest") == pytest.approx([0, 0.6, 1.0, 0.61, 0], abs=1e-11)


def test_energies_of_all_starts_are_kept(tmp_path: Path) -> None:
    tree = tcstudy.run(patch_study(CASES[2], 0.4), tmp_path / "patch.nc")
    energies = tree["start_energy"].values[0]
    assert CASES[2].law == SOFTENING
    found = np.unique(np.round(energies[np.isfinite(energies)] / LENGTH, 10))
    assert set(found) <= {0.32, 0.30}
    assert np.nanmin(energies) == pytest.approx(float(tree["energy"][0]))
    assert np.isnan(energies[2])  # a single point has no neighbour
    assert tree["start"].values.tolist() == ["zero", "frictionless", "neighbour", "escape", "exact"]
    assert int(tree["global_minimum"][0]) in (0, 1)


def test_neighbour_is_one_step_back_along_the_last_dimension() -> None:
    study = study_of(RECTANGLE, "sweep={friction.tau: [1, 2, 3], E: [1, 2, 3]}", "solver={branch: continued}")
    solutions = Solutions(study, 2, np.arange(9))
    a, b = np.ones(2), np.zeros(2)
    solutions.take(solved(study, {1: a, 3: b}, PointStatus.OK))
    solutions.take(solved(study, {8: a}, PointStatus.NOT_CONVERGED))  # a failed point starts nobody
    near = solutions.beside(np.array([np.ravel_multi_index(i, (3, 3)) for i in ((1, 1), (0, 2), (2, 0), (0, 0))]))
    np.testing.assert_array_equal(near, [b, a, b, [np.nan, np.nan]])


def solved(study: Study, slips: dict[int, np.ndarray], status: PointStatus) -> BlockRecord:
    values = np.array(list(slips.values()))
    places, statuses = np.array(list(slips), dtype=np.intp), np.full(len(slips), status, dtype=np.int8)
    return BlockRecord(0, study.shape, places, statuses, {}, {}, values, values)


def test_blocks_depend_on_the_study_alone_and_hold_every_point_once() -> None:
    study = study_of(RECTANGLE, "sweep={E: [1, 2], nu: [0.2, 0.3], friction.tau: {linspace: [1, 2, 700]}}")
    blocks = blocks_of(study, 11, 100)
    assert np.array_equal(np.sort(np.concatenate([b.points for b in blocks])), np.arange(2800))
    assert [len(b.points) for b in blocks] == [700] * 4
    for block in blocks:  # of one factor each
        assert len({study.scenes[int(i)].material.nu for i in block.points}) == 1
    again = blocks_of(study, 11, 100)
    assert all(np.array_equal(a.points, b.points) for a, b in zip(blocks, again, strict=True))


def test_continued_points_wait_for_their_neighbours() -> None:
    study = study_of(RECTANGLE, "sweep={friction.tau: [1, 2, 3], E: [1, 2]}", "solver={branch: continued}")
    solved_before: set[int] = set()
    for block in blocks_of(study, 11, 100):
        for place in block.points:
            i, j = np.unravel_index(place, study.shape)
            assert i == 0 or (i - 1) * 2 + j in solved_before
            assert j == 0 or place - 1 in solved_before
        solved_before |= {int(p) for p in block.points}


def test_several_solvers_are_compared(tmp_path: Path) -> None:
    text = RECTANGLE.replace("left: clamped, top: free", 'left: clamped, top: {role: traction, g: ["0.03*x", -0.01]}')
    study = study_of(text, "solver=[separable-newton, bundle-newton]", "mesh.levels=2")
    tree = tcstudy.run(study, tmp_path / "both.nc")
    assert tree["solver"].values.tolist() == ["separable-newton", "bundle-newton"]
    assert float(tree["solver_difference"].max()) < 1e-9
    assert np.all(tree["solver_difference"].sel(solver="separable-newton") == 0)
    assert float(tree["solver_residual"].max()) <= 1e-10
    energies = tree["solver_energy"].values
    assert energies[:, 0] == pytest.approx(energies[:, 1], rel=1e-10)
    assert energies[:, 0] == pytest.approx(tree["energy"].values, rel=1e-14)
