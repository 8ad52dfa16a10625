"""Orders and limits of scenes whose edges may lift off."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr
from numpy.typing import NDArray

import tcstudy
from tcstudy.accuracy.corners import Vertex, vertices
from tcstudy.accuracy.orders import Expected, expected_orders, smoothness, with_openings
from tcstudy.data.tables import VERDICTS
from tcstudy.fem.geometry import build
from tcstudy.read.study import read_study, read_study_text
from tcstudy.reports.terminal.accuracy import convergence_lines
from tcstudy.study.convergence import converge, converge_to_file
from tests.commands import CONFIGS
from tests.verification.series import notes, points

Array = NDArray[np.float64]

COLUMN = """
units: none
body: {rectangle: {width: 1, height: 1}}
boundary: {bottom: contact, top: {role: clamped, u_x: 0, u_y: 0.5}, left: free, right: free}
material: {E: 1, nu: 0, plane: stress}
adhesion: {law: bilinear, sigma: 1, s0: 0.1, sf: 0.3}
mesh: {maxh: 0.8, levels: 4}
"""
SLAB = """
body: {rectangle: {width: 4 m, height: 200 mm}}
boundary: {bottom: {role: contact, normal: unilateral}, left: symmetry, top: free, right: free}
material: {E: 30 GPa, nu: 0, plane: stress, alpha_T: 1e-5 1/K}
loads: {f: [0, -24000]}
heat: {theta: "-5*(y - 0.1)/0.1"}
mesh: {maxh: 100 mm, levels: 4}
"""
BLOCK = """
units: none
body:
  outline: [{from: [0, 0], edge: base}, {from: [1, 0], edge: side}, {from: [1.1, 0.6], edge: top},
    {from: [0.5, 0.7], edge: roof}, {from: [0, 0.6], edge: wall}]
boundary:
  base: contact
  wall: {role: contact, normal: unilateral}
  top: {role: traction, g: [0.1, 0.3]}
  side: {role: traction, pressure: 0.05}
  roof: {role: clamped, u_x: 0.002, u_y: 0.01}
material: {E: 10, nu: 0.3, plane: strain}
loads: {f: [0.3, 0.4]}
friction: {base: {law: slip-weakening, tau_s: 0.02, tau_k: 0.01, delta: 0.1}}
adhesion: {base: {law: bilinear, sigma: 0.5, s0: 0.01, sf: 0.1}}
mesh: {maxh: 0.3, levels: 5}
"""


def judgements(point: dict[str, Any]) -> dict[str, str]:
    """The verdict on every measured error of a point."""
    prefix = "verdict_"
    names = [name.removeprefix(prefix) for name in point if name.startswith(prefix)]
    return {name: VERDICTS[int(point[prefix + name])] for name in names}


def test_a_column_is_exact_on_every_level() -> None:
    """s = d/11, S_N = 10 s of every node; it has no slip but for rounding, and no friction."""
    result = converge(read_study_text(COLUMN))
    [point] = points(result)
    verdicts = judgements(point)
    assert {"opening_L2", "opening_max", "S_N_L2", "S_N_nodes", "S_N_max"} < {*verdicts}
    assert not {"u_T_L2", "u_T_max", "xi_L2"} & {*verdicts}
    assert set(verdicts.values()) == {"exact"}
    assert point["limit_opening_max"] == pytest.approx(0.5 / 11.0, rel=1e-12)
    assert point["limit_adhesion_resultant"] == pytest.approx(5.0 / 11.0, rel=1e-9)
    assert point["limit_opened_length"] == pytest.approx(1.0)
    assert not any("change their order" in note for note in notes(result))


def test_the_rise_of_a_slab_that_curls_is_of_order_two() -> None:
    """Its end rises by κℓ²/4 = 0.5208333 mm, which the limit holds; errors fall with h²."""
    [point] = points(converge(read_study_text(SLAB)))
    rise = np.asarray(point["value_opening_max"])
    errors = 1.0 - rise[1:] / 0.5208333e-3
    ratios = errors[:-1] / errors[1:]
    np.testing.assert_allclose(ratios, 4.0, rtol=0.15)
    assert point["limit_opening_max"] == pytest.approx(0.5208333e-3, rel=5e-3)
    difference = abs(float(point["limit_opening_max"]) - 0.5208333e-3)
    assert difference < float(point["uncertainty_opening_max"])
    assert point["reason_S_N_max"] == "Γ_C lifts off: u ~ r^1.5"
    assert point["expected_S_N_max"] == 0.5
    assert point["expected_S_N_L2"] == point["expected_S_N_nodes"] == 1.0
    assert point["expected_opening_max"] == 1.5
    assert "slower" not in judgements(point).values()


def test_errors_of_openings_are_those_of_two_runs(tmp_path: Path) -> None:
    """A block between two walls, one with a bond: errors at nodes from the files of its levels."""
    study = read_study_text(BLOCK)
    [point] = points(converge(study))
    tcstudy.run(study, tmp_path / "block.nc")
    with xr.open_datatree(tmp_path / "block.nc") as tree:
        levels = [tree[f"level_{level}"].dataset.load() for level in range(5)]
    fine = levels[4]
    for number, coarse in enumerate(levels[:3]):
        same = [_same_node(fine, coarse.isel(opening_node=i)) for i in range(len(coarse["S_N"]))]
        opening = np.abs(coarse["opening"].values - fine["opening"].values[same])
        traction = coarse["S_N"].values - fine["S_N"].values[same]
        largest = np.abs(fine["S_N"].values).max()
        expected = np.max(opening) / np.max(fine["opening"].values)
        assert point["error_opening_max"][number] == pytest.approx(expected, rel=1e-12)
        expected = np.max(np.abs(traction)) / largest
        assert point["error_S_N_max"][number] == pytest.approx(expected, rel=1e-12)
        absolute = float(point["error_S_N_nodes"][number])
        norm_squared = coarse["c_N"].values @ traction**2
        if number == 2:  # relative to the norm at the nodes of the finest level compared
            reference = coarse["c_N"].values @ fine["S_N"].values[same] ** 2
            assert absolute**2 == pytest.approx(norm_squared / reference, rel=1e-9)
    assert len(levels[0]["opening_node"]) < len(fine["opening_node"])
    assert np.all(np.diff(point["error_opening_L2"][:3]) < 0.0)
    assert "slower" not in judgements(point).values()


def _same_node(fine: xr.Dataset, node: xr.Dataset) -> int:
    """The opening of the same edge at the same place."""
    distance = np.hypot(
        fine["opening_x"] - node["opening_x"], fine["opening_y"] - node["opening_y"]
    )
    distance = np.where(fine["opening_edge"] == node["opening_edge"], distance, np.inf)
    assert distance.min() < 1e-12
    return int(np.argmin(distance))


def test_corners_tell_closed_from_open() -> None:
    """A bond ends in a straight boundary: pressed down it has the punch's r^½, open none."""
    text = COLUMN.replace("bottom: contact", "bond: contact, bottom: free").replace(
        "body: {rectangle: {width: 1, height: 1}}",
        "body: {outline: [{from: [0, 0], edge: bottom}, {from: [0.5, 0], edge: bond}, "
        "{from: [1, 0], edge: right}, {from: [1, 1], edge: top}, {from: [0, 1], edge: left}]}",
    )
    scene = read_study_text(text).scenes[0]
    corners = build(scene.body).corners

    def at_tip(closed: bool) -> tuple[Vertex, dict[str, Expected]]:
        found = vertices(corners, scene, lambda edge, at: False, lambda edge, at: closed)
        [tip] = [vertex for vertex in found if vertex.at == (0.5, 0.0)]
        limits = with_openings(smoothness([tip], False), [tip], False, False)
        return tip, expected_orders(limits)

    tip, orders = at_tip(closed=False)
    assert set(tip.words) == {"open contact", "traction"}
    assert orders["u_energy"].order == 1.0
    assert orders["opening_max"].order == 1.0
    assert "normal stress may jump" in orders["opening_max"].reason
    tip, orders = at_tip(closed=True)
    assert tip.exponent == pytest.approx(0.5)
    assert orders["u_energy"].order == pytest.approx(0.5)
    assert orders["S_N_L2"].order == pytest.approx(0.0)
    assert orders["opening_L2"].order == pytest.approx(1.0)


def test_friction_that_follows_the_pressure_has_errors_and_no_energy(tmp_path: Path) -> None:
    study = read_study(CONFIGS / "pressed_plate.yaml", ["mesh={maxh: 10 mm, levels: 4}"])
    result = converge(study)
    for point in points(result):
        assert np.isfinite(point["error_S_N_L2"][:2]).all()
        assert np.isfinite(point["error_xi_L2"][:2]).all()
        assert not np.isfinite(point.get("limit_energy", np.nan))
        assert point["limit_adhesion_resultant"] == pytest.approx(-2e6, rel=1e-3)
    converge_to_file(study, tmp_path / "plate.nc", lambda text: None)
    with xr.open_dataset(tmp_path / "plate.nc") as data:
        lines = convergence_lines(data)
    assert any("max s_N" in text and "∫S_N" in text for _, text in lines)
