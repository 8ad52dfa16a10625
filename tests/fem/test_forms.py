"""Data of a study as NGSolve coefficients; matrices from products of gradients against forms assembled directly."""

from __future__ import annotations

import ngsolve as ngs
import numpy as np
import pytest

from tcstudy.expressions.expression import parse
from tcstudy.fem.boundary import constrain
from tcstudy.fem.forms import ElasticForms, csr
from tcstudy.fem.geometry import build
from tcstudy.fem.meshes import Frames, PlaneMesh
from tcstudy.scene.records import Scalar, Traction
from tcstudy.shapes.triangles import doubled_areas
from tests.verification.scenes import HEATED_BRACKET, RECTANGLE, levels_of, mesh_family, study_of

HEATED = RECTANGLE.replace("nu: 0.3}", "nu: 0.3, k: 1, alpha_T: 0.1}").replace("top: free", "top: convection")


@pytest.mark.parametrize("nothing", ["0*x", "0*sin(x*y)", "0"])
def test_data_that_vanish_as_a_formula_count_as_nothing(nothing: str) -> None:
    load = f"loads={{f: ['{nothing}', '{nothing}']}}"
    heat = f"heat={{alpha: 1, theta_bar: '{nothing}', q: '{nothing}'}}"
    push = f"boundary.right={{role: traction, g: ['{nothing}', 0.01], pressure: '{nothing}'}}"
    held = f"boundary.left={{role: clamped, u: ['{nothing}', 0]}}"
    study = study_of(HEATED, "mesh.maxh=0.5", "mesh.levels=1", load, heat, push, held)
    pull = "boundary.right={role: traction, g: [0, 0.01]}"
    plain = study_of(HEATED, "mesh.maxh=0.5", "mesh.levels=1", "heat={alpha: 1, theta_bar: 0}", pull)
    (level,), (other,) = levels_of(study), levels_of(plain)
    own, wanted = level.condensed(study.scenes[0]).problem, other.condensed(plain.scenes[0]).problem
    assert np.array_equal(own.A_tilde, wanted.A_tilde)
    assert own.l_tilde == pytest.approx(wanted.l_tilde, abs=1e-15 * float(np.max(np.abs(wanted.l_tilde))))


@pytest.fixture(scope="module")
def bracket() -> tuple[PlaneMesh, Frames, ElasticForms]:
    scene = (study := study_of(HEATED_BRACKET)).scenes[0]
    mesh = list(mesh_family(build(scene.body), study.mesh))[-1]
    return mesh, constrain(mesh, scene.boundary), ElasticForms(mesh)


def test_stiffness_is_that_of_the_weak_form(bracket: tuple[PlaneMesh, Frames, ElasticForms]) -> None:
    mesh, frames, gradients = bracket
    u, v = ngs.VectorH1(mesh.mesh, order=1).TnT()
    strain = ngs.InnerProduct(ngs.Sym(ngs.Grad(u)), ngs.Sym(ngs.Grad(v)))
    direct = csr(ngs.BilinearForm((1.3 * ngs.div(u) * ngs.div(v) + 1.4 * strain) * ngs.dx).Assemble())
    scale = abs(direct).max()
    assert abs(gradients.stiffness_of((((), 1.3, 0.7),)) - direct).max() < 1e-14 * scale
    turned = frames.rotation.T @ direct @ frames.rotation
    local = gradients.stiffness_of((((), 1.3, 0.7),), frames)
    assert local.has_canonical_format
    assert abs(local - turned).max() < 1e-14 * scale
    assert abs(local - direct).max() > 0.1 * scale


PRESSED = """
units: none
body:
  rectangle: {width: 2, height: 1}
  holes:
    - circle: {center: [0.5, 0.5], radius: 0.2, edge: bore}
    - rectangle: {corner: [1.2, 0.3], width: 0.4, height: 0.3, edge: slot}
  regions: {insert: {rectangle: {corner: [1.6, 0.7], width: 0.4, height: 0.3}}}
boundary: {bottom: contact, left: clamped, top: free, right: free, bore: free, slot: free}
material: {E: 1, nu: 0.3}
friction: {law: tresca, tau: 0.01}
mesh: {maxh: 0.3, levels: 2}
"""


@pytest.mark.parametrize("pressure", [0.3, parse("0.3 + 0*x")])
def test_pressure_pushes_on_outlines_and_in_holes(pressure: Scalar) -> None:
    """Pressure all around: −p∮n·x = −2p|Ω|, and 0 over a straight motion; in a hole alone +2p times its area."""
    for mesh in mesh_family(build((study := study_of(PRESSED)).scenes[0].body), study.mesh):
        forms, area = ElasticForms(mesh), 0.5 * doubled_areas(mesh.points[mesh.triangles]).sum()
        pushes = [forms.traction(name, Traction(pressure=pressure)) for name, _ in study.scenes[0].boundary]
        along = np.concatenate(mesh.points.T)
        assert sum(pushes) @ along == pytest.approx(-2 * 0.3 * area, rel=1e-12)
        assert np.max(np.abs(sum(pushes).reshape(2, -1).sum(axis=1))) < 1e-13
        assert pushes[-1] @ along == pytest.approx(2 * 0.3 * 0.12, rel=1e-12)
