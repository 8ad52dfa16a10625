"""Data of a study as NGSolve coefficients: what vanishes as a formula counts as nothing."""

from __future__ import annotations

import numpy as np
import pytest

from tests.verification.scenes import RECTANGLE, levels_of, study_of

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
