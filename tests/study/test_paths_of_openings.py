"""Paths of bonds that open: closed forms of peel tests along all folds, forces of edges, branches."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr
from numpy.typing import NDArray

import tcstudy
from tcstudy.fem.geometry import build
from tcstudy.offline.level import Level
from tcstudy.offline.requested_outputs import RequestedOutputs
from tcstudy.read.study import read_study_text
from tcstudy.scene.parameters import path_scene
from tcstudy.study.path_run import follow_path
from tests.study.test_openings import COLUMN, DCB, ELS, force_of_split, results
from tests.verification.scenes import HEATED_BRACKET, mesh_family

Array = NDArray[np.float64]
Values = dict[str, Any]
RIGID = "adhesion={law: bilinear, sigma: 20 MPa, s0: 4 um, sf: 14 um}"


def path_of(text: str, *options: str) -> Values:
    record = follow_path(read_study_text(text, "study", list(options)))
    assert record.attributes["end_status"] == "range_end"
    return record.values


def crossing(crack: Array, at: float, *columns: Array) -> list[float]:
    """Values of columns by vertex where the crack first is as long as this."""
    i = np.flatnonzero((crack[:-1] <= at) & (crack[1:] > at))[0]
    share = (at - crack[i]) / (crack[i + 1] - crack[i])
    return [float(column[i] + share * (column[i + 1] - column[i])) for column in columns]


def test_a_double_cantilever_is_peeled_along_the_path_of_a_beam_on_its_bond() -> None:
    """P and the displacement of the end [N/mm, mm] at cracks of 32 and 36 mm."""
    section = "path={parameter: boundary.left.u_y, from: 0 mm, to: 2 mm, within: [0 mm, 2 mm]}"
    values = path_of(DCB, RIGID, section, "path.hysteresis=false", "path.at=[1.884875 mm]")
    crack = 30.0 + 1e3 * values["debonded_length"]
    force = values["force_left_y"]
    closed_form = {32: (2.138410, 1.515817), 36: (1.917608, 1.884875)}
    for at, (P, end) in closed_form.items():
        found = crossing(crack, at, force / 1e3, 1e3 * values["parameter"])
        assert found[0] == pytest.approx(P, rel=0.006)
        assert found[1] == pytest.approx(end, rel=0.008)
    assert np.all(values["opening"] >= 0.0)
    assert values["residual"].max() < 1e-8
    # the force is the derivative of the energy by the displacement, at all vertices
    size = np.abs(force).max()
    np.testing.assert_allclose(force, values["energy_rate"], atol=1e-7 * size)
    np.testing.assert_allclose(values["work_left"], force * values["parameter"], atol=1e-12 * size)
    np.testing.assert_allclose(
        values["force_bond_y"], -values["adhesion_resultant"], atol=1e-8 * size
    )
    # every bond node was closed or elastic, softened and failed, from the crack on
    state = values["state_N"]
    assert [*np.unique(state)] == [0, 1, 2, 4]
    first = int(np.argmin(values["opening_arclength"]))
    seen = state[:, first]
    assert [*seen[np.flatnonzero(np.diff(seen, prepend=-1))]] == [1, 2, 4]
    assert values["solution_force_left_y"] == pytest.approx([1917.608], rel=0.01)
    assert values["solution_opening"].shape == (1, len(values["opening_x"]))


def test_the_hysteresis_of_a_column_loses_what_its_folds_release() -> None:
    """Between d = 1.1 and d = 0.3: ½E(d − s)² + j at both ends of either jump."""
    text = COLUMN.replace("MAXH", "1").replace("D", "0")
    section = "path={parameter: boundary.top.u_y, from: 0, to: 1.5, within: [0, 1.5]}"
    values = path_of(text, section)
    out = 0.5 * 1.0**2 + 0.05 - 0.15
    back = 0.15 - (0.5 * (0.3 - 0.3 / 11) ** 2 + 5.0 * (0.3 / 11) ** 2)
    assert values["loop_closed"] == 1
    assert values["energy_lost"] == pytest.approx(out + back, rel=1e-6)
    assert values["loop_area"] == pytest.approx(out + back, rel=1e-6)
    np.testing.assert_allclose(np.ptp(values["loop_opening"], axis=1), 0.0, atol=1e-9)


def test_a_split_snaps_back_where_its_end_turns() -> None:
    """Mode II, 6 cells: the force of its closed form, and a turn of the end at about 48.8 mm."""
    section = "path={parameter: boundary.left.u_y, from: 0 mm, to: -24 mm, within: [-24 mm, 0 mm]}"
    long_bond = ELS.replace("[57 mm", "[30 mm")
    values = path_of(long_bond, section, "path.hysteresis=false", "mesh.maxh=0.25 mm")
    u = np.abs(values["u_T"][::-1])  # from t = 0 on, which is the last vertex
    slipped = 1e3 * np.max(np.where(u >= 30e-6, values["arclength"], 0.0), axis=1)
    force = -2.0 * values["force_left_y"][::-1] / 1e3
    end = -1e3 * values["parameter"][::-1]
    for at in (34.0, 42.0, 60.0):
        (found,) = crossing(30.0 + slipped, at, force)
        assert found == pytest.approx(force_of_split(at), rel=0.06)
    cracked = slipped > 0.0
    first = int(np.argmax(cracked))
    back = first + int(np.argmin(end[first:]))
    assert end[: first + 1].max() == pytest.approx(16.87, rel=0.05)
    assert end[back] == pytest.approx(14.58, rel=0.05)
    assert 30.0 + slipped[back] == pytest.approx(48.8, abs=2.0)
    assert not {"opening", "S_N", "state_N", "opening_max"} & {*values}


def test_a_column_turns_where_its_bond_does() -> None:
    """Folds at d = 1.1 and 0.3, and Maxwell's d = √0.33 between, of a column that stays straight."""
    text = COLUMN.replace("MAXH", "1").replace("D", "0")
    section = "path={parameter: boundary.top.u_y, from: 0, to: 1.5, at: [0.7]}"
    values = path_of(text, section, "output.quantities=[forces]")
    s = values["opening"]
    np.testing.assert_allclose(np.ptp(s, axis=1), 0.0, atol=1e-9)
    t = values["parameter"]
    folds = t[values["fold_vertex"]]
    np.testing.assert_allclose(folds[(folds > 0.0)], [1.1, 0.3], rtol=1e-9)
    np.testing.assert_allclose(values["force_top_y"], t - s[:, 0], atol=1e-9)
    changes = values["lowest_end"]
    assert np.min(np.abs(changes - np.sqrt(0.33))) < 1e-9


def test_all_branches_of_a_bond_hold_all_equilibria_of_a_run(tmp_path: Path) -> None:
    """A column of one cell that is pushed sideways, too, so that no two nodes are alike."""
    text = COLUMN.replace("MAXH", "1").replace("D", "0")
    options = ["friction={law: tresca, tau: 0.05}", "boundary.top.u_x=0.01"]
    section = "path={parameter: boundary.top.u_y, from: 0, to: 1.5, at: [0.4, 0.7], complete: true}"
    values = path_of(text, section, "path.hysteresis=false", *options)
    assert values["complete"] == 1
    sweep = "sweep={boundary.top.u_y: [0.4, 0.7]}"
    data = results(text, tmp_path / "all.nc", sweep, "solver.branch=all", *options)
    assert [*data["complete"].values] == [1, 1]
    assert values["solution_count"] == [*data["solutions"].values]
    for i in (0, 1):
        of_path = values["solution_opening"][values["solution_at"] == i]
        of_run = data["solution_opening"].values[data["solution_point"].values == i]
        distances = np.abs(of_path[:, None] - of_run[None]).max(axis=2)
        assert distances.min(axis=0).max() < 1e-9
        assert distances.min(axis=1).max() < 1e-9


def test_forces_of_edges_along_a_path_are_those_of_a_run() -> None:
    """Convection, springs, gravity and loads that all follow the parameter; nothing opens."""
    section = "path: {parameter: load, from: 0, to: -4, at: [-2]}"
    friction = "friction: {law: slip-weakening, tau_s: 0.004, tau_k: 0.001, delta: 0.002}"
    text = "\n".join(
        friction if line.startswith("friction:") else line for line in HEATED_BRACKET.splitlines()
    )
    study = read_study_text(
        f"{text}\n{section}\n", "study", ["output.quantities=[forces, reactions]"]
    )
    plan = study.path
    assert plan
    values = follow_path(study).values
    level = Level(
        list(mesh_family(build(plan.scene.body), study.mesh))[values["level"]], plan.scene
    )
    outputs = RequestedOutputs(level, study.output)
    for i in (0, len(values["parameter"]) // 2, -1):
        scene = path_scene(plan.scene, plan.parameter, float(values["parameter"][i]))
        expected = outputs.of(scene, values["u_T"][i])
        assert len(expected) > 10
        size = max(map(abs, expected.values()))
        for name, value in expected.items():
            assert values[name][i] == pytest.approx(value, rel=1e-9, abs=1e-11 * size)


def test_a_fit_of_a_peel_test_finds_strength_and_toughness(tmp_path: Path) -> None:
    """P against the displacement of the end, elastic and with a growing crack, without noise."""
    arm = DCB.replace("[62 mm", "[44 mm").replace(", closing: 5e12 Pa/m", "")
    arm = arm.replace("maxh: 0.125 mm", "maxh: 0.5 mm")
    ends = (0.4, 0.8, 1.0, 1.2, 1.4, 1.6)
    swept = ", ".join(f"{end} mm" for end in ends)
    sweep = f"sweep={{boundary.left.u_y: [{swept}]}}"
    data = results(arm, tmp_path / "run.nc", sweep, "solver.branch=continued")
    force = data["adhesion_resultant"].values / 1e3
    lines = ["d [mm],P [N/mm]", *(f"{d},{P:.12g}" for d, P in zip(ends, force, strict=True))]
    (tmp_path / "peel.csv").write_text("\n".join(lines) + "\n")
    columns = "{boundary.left.u_y: 'd [mm]', adhesion_resultant: 'P [N/mm]'}"
    parameters = (
        "{adhesion.sigma: {start: 16 MPa, within: [8 MPa, 40 MPa]}, "
        "adhesion.sf: {start: 17 um, within: [8 um, 30 um]}}"
    )
    fit = (
        f"fit={{data: {{file: {tmp_path}/peel.csv, columns: {columns}}}, "
        f"noise: {{adhesion_resultant: 0.001 N/mm}}, parameters: {parameters}}}"
    )
    tcstudy.run(read_study_text(arm, "study", [fit]), tmp_path / "fit.nc")
    with xr.open_dataset(tmp_path / "fit.nc") as found:
        np.testing.assert_allclose(found["estimate"], [20e6, 14e-6], rtol=1e-5)
