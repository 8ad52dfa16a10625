"""Friction that knows the pressure, from a study to its results: a benchmark, closed
forms, and an iteration of projections on matrices that NGSolve assembles by itself."""

from pathlib import Path

import ngsolve as ngs
import numpy as np
import pytest
import scipy.sparse
import xarray as xr

import tcstudy
from tcstudy.study.run import level_of
from tests.commands import CONFIGS
from tests.contact.test_pressure_friction import by_projections

BLOCK = """
title: Block
body: {rectangle: {width: 100 mm, height: 50 mm}}
boundary:
  bottom: {role: contact, normal: unilateral}
  top: {role: clamped, u_x: 0.02 mm, u_y: -0.01 mm}
  left: free
  right: free
material: {E: 1 GPa, nu: 0.3, plane: strain}
friction: {law: coulomb, mu: 0.3}
mesh: {maxh: 12.5 mm, levels: 2}
"""
SLAB = """
title: Half of a slab on its base
body: {rectangle: {width: 60 m, height: 200 mm}}
boundary:
  bottom: {role: contact, normal: unilateral}
  left: symmetry
  top: free
  right: free
material: {E: 30 GPa, nu: 0, plane: stress, alpha_T: 1e-5 1/K}
loads: {f: [0, -23.6 kN/m^3]}
heat: {theta: 30 K}
friction: {law: coulomb, mu: 1.5}
mesh: {maxh: 200 mm}
"""
PROBED = "output.probes={A: [0 mm, 0 mm], C: [5 mm, 0 mm], D: [7.5 mm, 0 mm], E: [11.25 mm, 0 mm]}"


def solved(study: str, folder: Path, *changes: str) -> xr.DataTree:
    path = folder / "study.yaml"
    path.write_text(study, encoding="utf-8")
    tree = tcstudy.run(tcstudy.load(str(path), list(changes)), folder / "results.nc")
    assert np.all(tree["status"] == 1)
    return tree


def test_a_pressed_plate_has_the_slips_quoted_for_it(tmp_path: Path) -> None:
    """Benchmark SSNV128 of Code_Aster, with the slips that the head of the study quotes."""
    study = tcstudy.load(
        str(CONFIGS / "pressed_plate.yaml"), ["mesh.levels=2", "sweep.friction.mu=[1]", PROBED]
    )
    tree = tcstudy.run(study, tmp_path / "plate.nc")
    published = {"A": 28.6e-6, "C": 22.8e-6, "D": 19.8e-6, "E": 15.4e-6}
    for name, slip in published.items():
        found = tree[f"probe_{name}_u_T"].values.ravel()
        assert found[-1] == pytest.approx(slip, rel=5e-3)
        assert abs(found[1] - found[0]) < 0.02 * slip


def test_a_block_that_slips_drags_with_mu_times_its_push(tmp_path: Path) -> None:
    tree = solved(BLOCK, tmp_path)
    drag, push = tree["friction_resultant"].values, tree["adhesion_resultant"].values
    assert np.all(np.abs(drag / push + 0.3) < 1e-12)
    assert np.all(np.isnan(tree["energy"].values))
    assert not np.any(tree["global_minimum"].values == 1)


def test_a_small_coefficient_is_proved_to_have_one_solution(tmp_path: Path) -> None:
    tree = solved(BLOCK, tmp_path, "friction.mu=0.01")
    assert np.all(tree["contraction"].values < 1.0)
    assert np.all(tree["unique"].values == 1)


def test_a_warm_slab_slides_out_under_the_drag_of_its_weight(tmp_path: Path) -> None:
    """It ends at α ΔT L − μ γ L²/(2 E) = 15.876 mm, and its pressure is γ H = 4.72 kPa."""
    tree = solved(SLAB, tmp_path)
    length, weight = 60.0, 23.6e3
    end = 1e-5 * 30.0 * length - 1.5 * weight * length**2 / (2.0 * 30e9)
    assert float(tree["u_T_max"].values[-1]) == pytest.approx(end, rel=2e-3)
    push = float(tree["adhesion_resultant"].values[-1])
    assert push == pytest.approx(-weight * 0.2 * length, rel=1e-9)


def test_friction_acts_only_where_a_slab_is_pressed(tmp_path: Path) -> None:
    """A slab that is colder on top lifts its ends, and no drag is left there."""
    changes = ["heat.theta=-50*(y - 0.1)", "friction={law: tresca, tau: 7 kPa}"]
    tree = solved(SLAB, tmp_path, "body.rectangle.width=8 m", "mesh.maxh=100 mm", *changes)
    level = tree["level_0"]
    opening = level["opening"].values.ravel()
    xi = level["xi"].values.ravel()
    common = np.isin(level["opening_x"].values, level["x"].values)
    is_open = opening[common] > 0.0
    assert np.count_nonzero(is_open) > 5
    assert np.max(np.abs(xi[is_open])) < 1e-6 * 7e3


def test_matrices_of_another_assembly_and_another_iteration_agree(tmp_path: Path) -> None:
    """NGSolve's own elasticity on the mesh of the study, condensed by a dense inverse."""
    tree = solved(BLOCK, tmp_path, "mesh.levels=1")
    study = tcstudy.load(str(tmp_path / "study.yaml"), ["mesh.levels=1"])
    mesh = level_of(study, study.scenes[0], None).mesh.mesh
    space = ngs.VectorH1(mesh, order=1)
    u, v = space.TnT()
    lam, mu = 0.3e9 / (1.3 * 0.4), 1e9 / 2.6
    strain = ngs.Sym(ngs.Grad(u))
    stress = lam * ngs.Trace(strain) * ngs.Id(2) + 2.0 * mu * strain
    form = ngs.BilinearForm(ngs.InnerProduct(stress, ngs.Grad(v)) * ngs.dx).Assemble()
    rows, columns, entries = form.mat.COO()
    A = scipy.sparse.csr_array((entries, (rows, columns)), shape=(space.ndof,) * 2).toarray()
    points = np.array([vertex.point for vertex in mesh.vertices])
    n = len(points)
    base = np.flatnonzero(points[:, 1] < 1e-12)
    base = base[np.argsort(points[base, 0])]
    top = np.flatnonzero(points[:, 1] > 0.05 - 1e-12)
    given = np.concatenate([top, top + n])
    moved = np.concatenate([np.full(len(top), 2e-5), np.full(len(top), -1e-5)])
    free = np.setdiff1d(np.arange(2 * n), given)
    compliance = np.linalg.inv(A[np.ix_(free, free)])
    unrestrained = -compliance @ A[np.ix_(free, given)] @ moved
    place = np.searchsorted(free, np.concatenate([base, base + n]))
    A_tilde = np.linalg.inv(compliance[np.ix_(place, place)])
    found = by_projections(A_tilde, A_tilde @ unrestrained[place], 0.3)
    level = tree["level_0"]
    order = np.argsort(level["x"].values)
    u_T = level["u_T"].values.ravel()[order]
    assert u_T == pytest.approx(found[: len(base)], rel=1e-7)


CYCLE = """
history:
  memory: friction
  steps:
    - {boundary.top.u_x: 0.02 mm, in: 6}
    - {boundary.top.u_x: -0.02 mm, in: 12}
    - {boundary.top.u_x: 0.02 mm, in: 12}
    - {boundary.top.u_x: -0.02 mm, in: 12}
    - {boundary.top.u_x: 0.02 mm, in: 12}
"""


def test_a_block_that_is_pushed_to_and_fro_runs_through_a_loop(tmp_path: Path) -> None:
    """The second cycle is the first one again, and its work is what friction dissipates."""
    text = BLOCK.replace("u_x: 0.02 mm", "u_x: 0 mm").replace("levels: 2", "levels: 1")
    tree = solved(text + CYCLE, tmp_path)
    drag = tree["friction_resultant"].values.ravel()
    push = tree["adhesion_resultant"].values.ravel()
    assert np.all(np.abs(drag) <= (0.3 + 1e-9) * np.abs(push))
    np.testing.assert_allclose(drag[-12:], drag[-36:-24], rtol=1e-6)
    work, loss = (tree[name].values.ravel()[-24:].sum() for name in ("work", "dissipated"))
    assert work == pytest.approx(loss, rel=0.05)
    assert loss > 0.0


def test_what_a_pressed_history_cannot_have_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "study.yaml"
    path.write_text(BLOCK.replace("u_x: 0.02 mm", "u_x: 0 mm") + CYCLE, encoding="utf-8")
    for change, reason in (
        ("friction={law: coulomb, mu_s: 0.5, mu_k: 0.2, delta: 1 um}", "begin again"),
        ("history.branch=lowest", "no state is the lowest"),
    ):
        with pytest.raises(tcstudy.StudyError, match=reason):
            tcstudy.load(str(path), [change])
