"""Matrices put together from the products of gradients against the forms that NGSolve assembles directly."""

from __future__ import annotations

import ngsolve as ngs
import numpy as np
import pytest

from tcstudy.fem.boundary import Frames, constrain
from tcstudy.fem.forms import GradientProducts, csr
from tcstudy.fem.geometry import build
from tcstudy.fem.meshes import PlaneMesh
from tests.verification.scenes import HEATED_BRACKET, mesh_family, study_of


@pytest.fixture(scope="module")
def bracket() -> tuple[PlaneMesh, Frames, GradientProducts]:
    scene = (study := study_of(HEATED_BRACKET)).scenes[0]
    mesh = list(mesh_family(build(scene.body), study.mesh))[-1]
    return mesh, constrain(mesh, scene.boundary), GradientProducts(mesh)


def test_stiffness_is_that_of_the_weak_form(bracket: tuple[PlaneMesh, Frames, GradientProducts]) -> None:
    mesh, frames, gradients = bracket
    u, v = ngs.VectorH1(mesh.mesh, order=1).TnT()
    strain = ngs.InnerProduct(ngs.Sym(ngs.Grad(u)), ngs.Sym(ngs.Grad(v)))
    direct = csr(ngs.BilinearForm((1.3 * ngs.div(u) * ngs.div(v) + 1.4 * strain) * ngs.dx).Assemble())
    scale = abs(direct).max()
    assert abs(gradients.stiffness(1.3, 0.7) - direct).max() < 1e-14 * scale
    turned = frames.rotation.T @ direct @ frames.rotation
    local = gradients.stiffness(1.3, 0.7, frames)
    assert local.has_canonical_format
    assert abs(local - turned).max() < 1e-14 * scale
    assert abs(local - direct).max() > 0.1 * scale


def test_conduction_is_that_of_the_weak_form(bracket: tuple[PlaneMesh, Frames, GradientProducts]) -> None:
    mesh, _, gradients = bracket
    theta, phi = ngs.H1(mesh.mesh, order=1).TnT()
    direct = csr(ngs.BilinearForm(ngs.grad(theta) * ngs.grad(phi) * ngs.dx).Assemble())
    assert abs(gradients.conduction() - direct).max() < 1e-14 * abs(direct).max()


def test_thermal_load_is_that_of_the_weak_form(bracket: tuple[PlaneMesh, Frames, GradientProducts]) -> None:
    mesh, _, gradients = bracket
    theta = ngs.H1(mesh.mesh, order=1).TrialFunction()
    v = ngs.VectorH1(mesh.mesh, order=1).TestFunction()
    form = ngs.BilinearForm(trialspace=theta.space, testspace=v.space)
    form += theta * ngs.div(v) * ngs.dx
    B = csr(form.Assemble())
    values = np.random.default_rng(1).standard_normal((mesh.n_points, 3))
    loads = gradients.expansion(values)
    assert np.max(np.abs(loads - B @ values)) < 1e-14 * np.max(np.abs(loads))
    assert np.max(np.abs(gradients.expansion(values[:, 1]) - loads[:, 1])) < 1e-15 * np.max(np.abs(loads))
