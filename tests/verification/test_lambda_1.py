"""λ₁, the uniqueness threshold of the body: published figures, refinement, and the uncondensed eigenproblem."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.sparse as sp
import scipy.sparse.linalg as spla

from tests.verification.scenes import RECTANGLE, levels_of, study_of


def test_converges_to_the_published_value() -> None:
    """0.4162, 0.4143, 0.4136, 0.4134 for h = 0.1 … 0.0125 on the 2×1 rectangle clamped at the left (E = 1, ν = 0.3)."""
    study = study_of(RECTANGLE, "mesh.levels=4")
    values = np.array([level.lambda_1(study.scenes[0]) for level in levels_of(study)])
    assert np.all(np.diff(values) < 0)
    assert values == pytest.approx([0.4162, 0.4143, 0.4136, 0.4134], abs=2.5e-4)


def test_equals_the_uncondensed_eigenvalue() -> None:
    """min a(v, v)/Σ c_i v_T² over all of H_h, without condensation."""
    study = study_of(RECTANGLE)
    level = levels_of(study)[1]
    material = study.scenes[0].material
    free = np.flatnonzero(~level.frames.fixed)
    R = level.frames.rotation
    A = (R.T @ level.elastic.stiffness_of((((), material.lam, material.mu),)) @ R).tocsr()[free][:, free]
    weight = np.zeros(2 * level.mesh.n_points)
    weight[level.line.nodes] = level.line.c
    # the largest eigenvalue of C w = κ A w is 1/λ₁
    kappa = spla.eigsh(sp.diags_array(weight[free]).tocsc(), k=1, M=A.tocsc(), which="LM", return_eigenvectors=False)
    assert level.lambda_1(study.scenes[0]) == pytest.approx(1 / kappa[0], rel=1e-9)
