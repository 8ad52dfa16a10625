"""Bonds that open, from the study to the file: closed forms, symmetries, what comes back."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from numpy.typing import NDArray
from scipy.optimize import brentq

import tcstudy
from tcstudy.data.records import BlockRecord, encode, record_of
from tcstudy.read.study import read_study_text
from tcstudy.study.run import as_start, run

Array = NDArray[np.float64]

COLUMN = """
units: none
body: {rectangle: {width: 1, height: 1}}
boundary: {bottom: contact, top: {role: clamped, u_x: 0, u_y: D}, left: free, right: free}
material: {E: 1, nu: 0, plane: stress}
adhesion: {law: bilinear, sigma: 1, s0: 0.1, sf: 0.3}
mesh: {maxh: MAXH, levels: 1}
"""


def results(text: str, path: Path, *overrides: str) -> xr.Dataset:
    """The root of the file of a study, with the arrays of level 0."""
    tcstudy.run(read_study_text(text, "study", list(overrides)), path)
    with xr.open_datatree(path) as tree:
        root = tree.dataset.isel(level=0).load()
        line = tree["level_0"].dataset.load()
    assert (root["status"] == 1).all(), root["reason"].values
    return root.merge(line)


# -- a column: E/H (d − s) = b(s), exact on every mesh


@pytest.mark.parametrize("maxh", [1.0, 0.3])
@pytest.mark.parametrize("d", [-0.2, 0.5, 0.7])
def test_a_column_has_its_closed_form_on_every_mesh(d: float, maxh: float, tmp_path: Path) -> None:
    """Below Maxwell's d = √0.33 the bond holds, s = d/11; above it has failed, s = d."""
    text = COLUMN.replace("MAXH", str(maxh)).replace("D", str(d))
    data = results(text, tmp_path / "column.nc")
    s = max(d / 11.0 if d < np.sqrt(0.33) else d, 0.0)
    np.testing.assert_allclose(data["opening"], s, rtol=1e-12, atol=1e-15)
    np.testing.assert_allclose(data["S_N"], d - s, rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(data["u_T"], 0.0, atol=1e-12)
    np.testing.assert_array_equal(data["rests_N"] == 1, s == 0.0)
    assert float(data["opening_max"]) == pytest.approx(s, rel=1e-12)
    assert float(data["peel_stress_max"]) == pytest.approx(max(d - s, 0.0), rel=1e-9, abs=1e-12)
    assert float(data["pressure_max"]) == pytest.approx(max(s - d, 0.0), rel=1e-9, abs=1e-12)
    assert float(data["adhesion_resultant"]) == pytest.approx(d - s, rel=1e-9, abs=1e-12)
    assert float(data["opened_length"]) == pytest.approx(1.0 if s else 0.0)
    assert float(data["debonded_length"]) == pytest.approx(1.0 if s == d else 0.0)
    assert float(data["c_N"].sum()) == pytest.approx(1.0)
    bond = 0.15 if s == d else 5.0 * s**2
    assert float(data["energy"]) == pytest.approx(0.5 * (d - s) ** 2 + bond, rel=1e-12)
    mixity = float(data["mode_mixity"])
    works = 0.0 < s < d
    assert mixity == pytest.approx(0.0, abs=1e-6) if works else np.isnan(mixity)


def test_one_cell_has_nine_equilibria_four_of_them_stable(tmp_path: Path) -> None:
    """Each node holds, softens or has failed by itself where a column has one cell."""
    text = COLUMN.replace("MAXH", "1").replace("D", "0.7")
    data = results(text, tmp_path / "column.nc", "solver.branch=all")
    assert int(data["solutions"]) == len(data["solution_opening"]) == 9
    assert int(data["stable_solutions"]) == 4
    assert int(data["complete"]) == 1
    uniform = [s for s in data["solution_opening"].values if np.ptp(s) < 1e-12]
    np.testing.assert_allclose(sorted(s[0] for s in uniform), [7 / 110, 0.2, 0.7], rtol=1e-9)
    for s, S_N in zip(data["solution_opening"].values, data["solution_S_N"].values, strict=True):
        on_law = np.interp(s, [0.0, 0.1, 0.3, 1.0], [0.0, 1.0, 0.0, 0.0])
        np.testing.assert_allclose(S_N, on_law, atol=1e-9)
    np.testing.assert_allclose(data["solution_opening"][0], data["opening"], rtol=1e-14)


def test_branches_solvers_and_workers_agree_on_a_column(tmp_path: Path) -> None:
    """Below and above Maxwell's d: lowest, continued, the bundle method, two workers."""
    sweep = "sweep={boundary.top.u_y: [0.3, 0.5, 0.7, 1.0]}"
    text = COLUMN.replace("MAXH", "0.4").replace("D", "0")
    lowest = results(text, tmp_path / "lowest.nc", sweep)
    d = np.array([0.3, 0.5, 0.7, 1.0])
    expected = np.where(d < np.sqrt(0.33), d / 11.0, d)
    np.testing.assert_allclose(lowest["opening_max"], expected, rtol=1e-12)
    continued = results(text, tmp_path / "continued.nc", sweep, "solver.branch=continued")
    np.testing.assert_allclose(continued["opening_max"], d / 11.0, rtol=1e-12)
    names = continued["start"].values[continued["start_used"].values[1:]]
    assert set(names) == {"neighbour"}
    two = "solver=[separable-newton, bundle-newton]"
    compared = results(text, tmp_path / "compared.nc", sweep, two)
    np.testing.assert_allclose(compared["opening"], lowest["opening"], rtol=1e-14)
    assert float(compared["solver_residual"].max()) < 1e-9
    path = tmp_path / "workers.nc"
    tcstudy.run(read_study_text(text, "study", [sweep]), path, jobs=2)
    with xr.open_datatree(path) as tree:
        np.testing.assert_array_equal(tree["level_0/opening"], lowest["opening"])


ALONG = ("opening", "S_N", "rests_N", "u_T", "c_N", "opening_x", "opening_edge")
"""Variables along the contact line that must come back."""


def test_points_are_appended_and_read_back_to_the_bit(tmp_path: Path) -> None:
    text = COLUMN.replace("MAXH", "0.4").replace("D", "0")
    both = "sweep={boundary.top.u_y: [0.3, 0.7]}"
    for branch in ("lowest", "all"):
        options = [f"solver.branch={branch}", "mesh.maxh=1"]
        at_once = results(text, tmp_path / f"{branch}.nc", both, *options)
        path = tmp_path / f"{branch}_appended.nc"
        first = "sweep={boundary.top.u_y: [0.3]}"
        alone = results(text, path, first, *options).isel(boundary_top_u_y=0)
        tcstudy.run(read_study_text(text, "study", [both, *options]), path, append=True)
        with xr.open_datatree(path) as tree:
            appended = tree.dataset.isel(level=0).load().merge(tree["level_0"].dataset.load())
        names = [*ALONG, "opening_max", "debonded_length", "energy"]
        solutions = [name for name in at_once if str(name).startswith("solution_")]
        assert ("solution_opening" in solutions) == (branch == "all")
        for name in (*names, *solutions):
            own, other = appended[name].values, at_once[name].values
            np.testing.assert_allclose(own, other, rtol=1e-12, atol=1e-14, err_msg=str(name))
        for name in names:
            if "boundary_top_u_y" in appended[name].dims:
                own = appended[name].isel(boundary_top_u_y=0)
                np.testing.assert_array_equal(own, alone[name], err_msg=name)


def test_geometries_have_openings_of_their_own(tmp_path: Path) -> None:
    """Columns of two widths in one file, each as in a file of its own."""
    text = COLUMN.replace("MAXH", "0.4").replace("D", "0.5")
    swept = results(text, tmp_path / "swept.nc", "sweep={body.rectangle.width: [1, 2.3]}")
    assert np.isnan(swept["opening"][0]).any()
    for i, width in enumerate((1.0, 2.3)):
        own = results(text, tmp_path / f"{i}.nc", f"body.rectangle.width={width}")
        stored = swept["opening"][i].values
        np.testing.assert_array_equal(stored[~np.isnan(stored)], own["opening"])
        assert float(swept["adhesion_resultant"][i]) == float(own["adhesion_resultant"])


def test_a_study_whose_edges_are_held_has_nothing_of_openings(tmp_path: Path) -> None:
    text = COLUMN.replace("MAXH", "0.4").replace("D", "0.5")
    text = text.replace("adhesion: {law: bilinear, sigma: 1", "friction: {law: bilinear, tau: 1")
    data = results(text, tmp_path / "held.nc")
    assert not [name for name in (*data.variables, *data.dims) if "opening" in str(name)]
    assert not {"S_N", "c_N", "mode_mixity"} & {*data.variables}


# -- a slab on a rigid base, a beam lifted at its end: beams on a rigid foundation

SLAB = """
body: {rectangle: {width: LENGTH, height: 200 mm}}
boundary: {bottom: {role: contact, normal: unilateral}, left: symmetry, top: free, right: RIGHT}
material: {E: YOUNG, nu: 0, plane: stress, alpha_T: 1e-5 1/K}
loads: {f: [0, WEIGHT]}
heat: {theta: "THETA*(y - 0.1)/0.1"}
mesh: {maxh: 50 mm, levels: 1}
"""


def slab(**words: str) -> str:
    defaults = {"LENGTH": "4 m", "RIGHT": "free", "YOUNG": "30 GPa", "WEIGHT": "-24000"}
    text = SLAB
    for name, word in {**defaults, "THETA": "0", **words}.items():
        text = text.replace(name, word)
    return text


@pytest.mark.parametrize(
    ("theta", "height", "length"), [("-5", 0.5208333e-3, 2.041241), ("5", 0.0732422e-3, 2.886751)]
)
def test_a_slab_lifts_off_as_a_beam_does(
    theta: str, height: float, length: float, tmp_path: Path
) -> None:
    """Top 10 K colder: the end lifts by κℓ²/4; warmer: a hump of 27κℓ²/1536. Errors fall with h²."""
    errors = []
    for maxh in ("50 mm", "25 mm"):
        data = results(slab(THETA=theta), tmp_path / f"{maxh}.nc", f"mesh.maxh={maxh}")
        errors.append(abs(float(data["opening_max"]) / height - 1.0))
        assert float(data["opened_length"]) == pytest.approx(length, rel=0.15)
        assert "debonded_length" not in data
        weight = 24000 * 0.2 * 4.0
        assert float(data["adhesion_resultant"]) == pytest.approx(-weight, rel=1e-9)
    coarse, fine = errors
    assert fine < 0.06
    assert coarse / fine == pytest.approx(4.0, rel=0.3)


def test_a_heavy_beam_is_lifted_at_its_end(tmp_path: Path) -> None:
    """A force F lifts a length 2F/q, the end rises by 2F⁴/(3EIq³)."""
    force = "{role: traction, force: [0 N/m, 30 kN/m]}"
    text = slab(LENGTH="6 m", RIGHT=force, YOUNG="210 GPa", WEIGHT="-75000")
    rises = []
    for maxh in ("50 mm", "25 mm"):
        data = results(text, tmp_path / f"{maxh}.nc", f"mesh.maxh={maxh}")
        rises.append(float(data["opening_max"]) / 1.142857e-3 - 1.0)
    assert float(data["opened_length"]) == pytest.approx(4.0, abs=0.15)
    assert abs(rises[1]) < 0.06
    assert rises[0] / rises[1] == pytest.approx(4.0, rel=0.3)


# -- arms of a double cantilever, mode I, and of an end-loaded split, mode II

ARM = """
body:
  outline: [{from: [0 mm, 0 mm], edge: crack}, {from: [TIP mm, 0 mm], edge: bond}, {from: [END mm, 0 mm], edge: right},
    {from: [END mm, 1.5 mm], edge: top}, {from: [0 mm, 1.5 mm], edge: left}]
boundary: {bond: BOND, crack: free, top: free, right: clamped, left: {role: clamped, u_x: free, u_y: 0 mm}}
material: {E: 70 GPa, nu: 0, plane: stress}
LAW
mesh: {maxh: 0.125 mm, levels: 1}
output: {quantities: [forces]}
"""
DCB = (
    ARM.replace("TIP", "30").replace("END", "62").replace("BOND", "contact")
    .replace("LAW", "adhesion: {law: bilinear, sigma: 20 MPa, s0: 4 um, sf: 14 um, closing: 5e12 Pa/m}")
)  # fmt: skip
ELS = (
    ARM.replace("TIP", "57").replace("END", "100").replace("BOND", "{role: contact, normal: free}")
    .replace("LAW", "friction: {law: bilinear, tau: 20 MPa, s0: 8 um, sf: 30 um}")
)  # fmt: skip


def test_a_double_cantilever_has_the_force_of_a_beam_on_its_bond(tmp_path: Path) -> None:
    """P = 2.138410, 1.917608, 1.660407 N/mm at ends of 1.515817, 1.884875, 2.513894 mm, where the
    crack is 32, 36 and 42 mm long: a beam on a bilinear foundation that pulls and pushes."""
    sweep = "sweep={boundary.left.u_y: [1.515817 mm, 1.884875 mm, 2.513894 mm]}"
    errors = []
    for maxh in ("0.25 mm", "0.125 mm"):
        data = results(DCB, tmp_path / f"{maxh}.nc", sweep, f"mesh.maxh={maxh}")
        force = data["force_left_y"].values / 1e3
        errors.append(force / [2.138410, 1.917608, 1.660407] - 1.0)
    coarse, fine = np.abs(errors)
    assert fine.max() < 0.004
    assert (coarse / fine).min() > 3.5
    crack = 30.0 + 1e3 * data["debonded_length"].values
    np.testing.assert_allclose(crack, [32.0, 36.0, 42.0], atol=0.15)
    np.testing.assert_allclose(data["mode_mixity"], 0.0, atol=1e-9)
    np.testing.assert_allclose(data["peel_stress_max"], 20e6, rtol=0.15)
    others = data["force_bond_y"] + data["force_right_y"] + data["force_left_y"]
    np.testing.assert_allclose(others / data["force_left_y"], 0.0, atol=1e-9)
    np.testing.assert_allclose(-data["force_bond_y"], data["adhesion_resultant"], rtol=1e-9)


def force_of_split(a: float, E: float = 70e3, h: float = 1.5, tau: float = 20.0) -> float:
    """P of both arms [N/mm] at a crack of a [mm]: the first integral of u″ − 4b/(Eh) = −3P/(Eh²)."""
    s0, sf = 0.008, 0.030

    def defect(P: float) -> float:
        s = 3.0 * P / (4.0 * h) / (tau / s0)
        work = 0.5 * tau * sf - 0.5 * tau / s0 * s**2
        push = 3.0 * P / (E * h**2)
        return 0.5 * (push * a) ** 2 - 4.0 / (E * h) * work + push * (sf - s)

    return float(brentq(defect, 1e-6, 1e3))


def test_the_force_of_a_split_is_that_of_its_closed_form() -> None:
    forces = [force_of_split(a) for a in (34.0, 42.0, 50.0, 60.0)]
    np.testing.assert_allclose(forces, [6.16749, 5.16273, 4.4375, 3.77355], rtol=1e-5)


def test_an_end_loaded_split_slides_without_normal_traction(tmp_path: Path) -> None:
    """Edges with normal: free have no traction and no opening in the file; P at the crack found."""
    sweep = "sweep={boundary.left.u_y: [-15 mm, -15.6 mm]}"
    errors = []
    for maxh in ("0.25 mm", "0.125 mm"):
        data = results(ELS, tmp_path / f"{maxh}.nc", sweep, f"mesh.maxh={maxh}")
        crack = 57.0 + 1e3 * data["debonded_length"].values
        force = -2.0 * data["force_left_y"].values / 1e3
        errors.append(force / [force_of_split(a) for a in crack] - 1.0)
        assert crack.min() > 58.0
    coarse, fine = np.abs(errors)
    assert fine.max() < 0.01
    assert (coarse / fine).min() > 3.5
    np.testing.assert_allclose(data["force_bond_y"] / data["force_left_y"], 0.0, atol=1e-8)
    assert not {"opening", "S_N"} & {*data.variables}


# -- symmetries

BLOCK = """
units: none
body: {outline: [OUTLINE]}
boundary: {film: {role: contact, normal: unilateral}, bond: contact, right: clamped, top: {role: traction, g: G},
  left: free}
material: {E: 2, nu: 0.3, alpha_T: 0.05}
heat: {theta: 1}
friction: {bond: {law: tresca, tau: 0.02}}
adhesion: {bond: {law: bilinear, sigma: 0.05, s0: 0.02, sf: 0.6}}
mesh: {maxh: 0.2, levels: 1}
"""
CORNERS = {
    "film": (0.0, 0.0),
    "bond": (0.7, 0.0),
    "right": (1.6, 0.0),
    "top": (1.5, 0.9),
    "left": (0.0, 0.8),
}
PULL = (0.15, 0.1)


def block(map_of: Array) -> str:
    """The block with all places and loads mapped by a matrix."""
    names, points = [*CORNERS], np.array([*CORNERS.values()])
    edges = list(zip(names, points @ map_of.T, strict=True))
    if np.linalg.det(map_of) < 0.0:  # the outline turns the other way
        starts = [point for _, point in edges]
        edges = [(name, starts[(i + 1) % len(edges)]) for i, (name, _) in enumerate(edges)][::-1]
    outline = ", ".join(
        f"{{from: [{float(x)!r}, {float(y)!r}], edge: {name}}}" for name, (x, y) in edges
    )
    g = (map_of @ PULL).tolist()
    return BLOCK.replace("OUTLINE", outline).replace("G}", f"{g}}}")


def test_a_block_that_is_turned_or_mirrored_opens_as_before(tmp_path: Path) -> None:
    """To rounding where the mesher sees the same triangles, else to the error of the mesh."""
    upright = results(block(np.eye(2)), tmp_path / "upright.nc", "mesh.maxh=0.05")
    assert float(upright["opened_length"]) > 0.1
    assert float(upright["pressure_max"]) > 0.0
    turn = 0.7
    turned = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    for name, map_of in {"turned": turned, "mirrored": np.diag([-1.0, 1.0])}.items():
        other = results(block(map_of), tmp_path / f"{name}.nc", "mesh.maxh=0.05")
        for quantity in ("energy", "opening_max", "adhesion_resultant"):
            value = float(upright[quantity])
            assert float(other[quantity]) == pytest.approx(value, rel=0.01), quantity
        sense = np.sign(np.linalg.det(map_of))
        resultant = float(upright["friction_resultant"])
        assert float(other["friction_resultant"]) == pytest.approx(sense * resultant, rel=0.01)


def test_a_study_in_other_units_has_the_same_results(tmp_path: Path) -> None:
    """The double cantilever in millimetres and megapascals, without units."""
    sweep = "boundary.left.u_y=1.5 mm"
    si = results(DCB, tmp_path / "si.nc", sweep, "mesh.maxh=0.5 mm")
    text = DCB.replace(" mm", "").replace("70 GPa", "70e3").replace("20 MPa", "20")
    text = text.replace("14 um", "0.014").replace("4 um", "0.004").replace("5e12 Pa/m", "5e3")
    plain = results(
        f"units: none{text}", tmp_path / "plain.nc", "boundary.left.u_y=1.5", "mesh.maxh=0.5"
    )
    np.testing.assert_allclose(plain["opening"], 1e3 * si["opening"], rtol=1e-6, atol=1e-9)
    np.testing.assert_allclose(plain["S_N"], 1e-6 * si["S_N"], rtol=1e-6, atol=1e-6)
    force = float(si["force_left_y"]) / 1e3
    assert float(plain["force_left_y"]) == pytest.approx(force, rel=1e-8)


def test_sections_and_supports_of_a_slab_that_lifts_off_are_in_balance(tmp_path: Path) -> None:
    """N at a node is the friction between it and the free end; the base carries the weight."""
    text = slab(THETA="-5").replace('"-5*', '"30 - 5*')
    quantities = "output.quantities=[section_force, reactions, forces]"
    drag = "friction={law: tresca, tau: 7 kPa}"
    probe = "output.probes={tip: [4 m, 0 m]}"
    data = results(text, tmp_path / "slab.nc", quantities, drag, probe, "output.fields=true")
    assert float(data["opened_length"]) > 1.0
    friction = (data["xi"] * data["c"]).values
    held = float(data["friction_resultant"])
    behind = held - np.cumsum(friction) + 0.5 * friction
    np.testing.assert_allclose(data["section_force"][2:-2], -behind[2:-2], atol=2e-3 * abs(held))
    weight = 24000 * 0.2 * 4.0
    # a corner counts to the plane of symmetry
    support = {
        axis: data[f"reaction_bottom_{axis}"] + data[f"reaction_left_{axis}"] for axis in "xy"
    }
    assert float(support["y"]) == pytest.approx(weight, rel=1e-9)
    assert float(support["x"]) == pytest.approx(0.0, abs=1e-6 * weight)
    tip = float(data["opening"][-1])
    assert float(data["probe_tip_u_y"]) == pytest.approx(tip, rel=1e-12)
    assert float(data["probe_tip_u_T"]) == pytest.approx(float(data["u_T"][-1]), rel=1e-12)
    corner = np.argmax(data["node_x"].values - data["node_y"].values)
    assert float(data["u_y"][corner]) == pytest.approx(tip, rel=1e-12)


def test_a_run_that_was_stopped_goes_on_from_openings_to_the_bit() -> None:
    """Records come back from rows of a journal, and start the points that were left."""
    text = COLUMN.replace("MAXH", "0.4").replace("D", "0")
    sweep = "sweep={boundary.top.u_y: [0.3, 0.5, 0.7, 0.9]}"
    study = read_study_text(text, "study", [sweep, "solver.branch=continued"])
    blocks = [record for record in run(study) if isinstance(record, BlockRecord)]
    assert len(blocks) == 4
    stored = [record_of(encode(block)) for block in blocks[:2]]
    for block, other in zip(blocks, stored, strict=False):
        for name in ("u_T", "opening", "S_N", "rests_N", "v"):
            np.testing.assert_array_equal(getattr(other, name), getattr(block, name))
        assert block.v is not None
        np.testing.assert_array_equal(block.v[:, -block.opening.shape[1] :], block.opening)
    finished = [as_start(study, block) for block in stored]
    rest = [record for record in run(study, finished) if isinstance(record, BlockRecord)]
    for block, other in zip(blocks[2:], rest, strict=True):
        np.testing.assert_array_equal(other.points, block.points)
        np.testing.assert_array_equal(other.opening, block.opening)
        np.testing.assert_array_equal(other.numbers["start_used"], block.numbers["start_used"])
