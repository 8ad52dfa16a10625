"""Conservation and consistency of the whole chain on a slanted, curved, holed, heated body."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.sparse as sp
import scipy.sparse.linalg as spla

from tcstudy.contact.solve import solve_contact
from tcstudy.offline.level import Level
from tcstudy.scene.records import Scene
from tests.verification.scenes import HEATED_BRACKET, levels_of, study_of


@pytest.fixture(scope="module")
def bracket() -> tuple[Scene, Level]:
    study = study_of(HEATED_BRACKET)
    return study.scenes[0], levels_of(study)[1]


def test_total_energy_is_that_of_the_whole_system(bracket: tuple[Scene, Level]) -> None:
    """L̃(u₁) + constant = ½uᵀAu − Fᵀu + Σ c_i j(u_T)."""
    scene, level = bracket
    condensed = level.condensed(scene)
    answer = solve_contact(condensed.problem)
    u = level.displacement(scene, answer.v)
    A = level.elastic.stiffness_of((((), scene.material.lam, scene.material.mu),))
    direct = 0.5 * u @ (A @ u) - level.load(scene) @ u + level.line.c @ scene.friction.j(answer.v)
    assert answer.energy + condensed.constant == pytest.approx(direct, rel=1e-11)


@pytest.mark.parametrize("alpha", [1e-8, 0.8, 1e8])
def test_temperature_equals_an_assembled_solve(alpha: float) -> None:
    """The spectral form on Γ_θ against the assembled system kK + αM, each rounding error of which is removed.

    At small α that matrix is nearly singular, so its mean on Γ_θ is split off (its value follows from the balance
    α∫(θ−θ̄) = ∫q), and the residual of what is left is refined in extended precision.
    """
    study = study_of(HEATED_BRACKET, f"heat.alpha={alpha!r}")
    scene, level = study.scenes[0], levels_of(study)[1]
    forms, k = level.heat, 0.7
    robin, n = forms.kept_nodes, forms.mesh.n_points
    weight = np.zeros(n)
    weight[robin] = forms.robin_mass.sum(axis=0)
    moments = np.zeros(n)
    moments[robin] = forms.surroundings(scene.heat.theta_bar)
    source = forms.source(0.6, ("heater",))
    mean = (source.sum() / alpha + moments.sum()) / weight.sum()
    # the constant mean c solves (kK + αM)c = α c weight; the rest has the mean 0 on Γ_θ: a bordered system
    load = source + alpha * moments - (source.sum() + alpha * moments.sum()) / weight.sum() * weight
    mass = sp.lil_array((n, n))
    mass[np.ix_(robin, robin)] = forms.robin_mass
    matrix = (k * forms.conduction + alpha * mass.tocsr()).tocsr()
    rest = _bordered(matrix, (k + alpha) * weight, load)
    theta = level.temperature(scene).theta
    assert np.max(np.abs(theta - mean - rest)) < 1e-11 * np.max(np.abs(theta))
    # the same of what varies, which at small α is lost beside the mean
    varying = theta - weight @ theta / weight.sum()
    tolerance = 1e-11 * np.max(np.abs(rest)) + 8 * np.finfo(float).eps * np.max(np.abs(theta))
    assert np.max(np.abs(varying - rest)) < tolerance


def _bordered(matrix: sp.csr_array, border: np.ndarray, load: np.ndarray) -> np.ndarray:
    """x with Ax + border·p = load and border·x = 0, refined with residuals in extended precision."""
    n = len(load)
    column = sp.csr_array(border[:, None])
    whole = sp.block_array([[matrix, column], [column.T, None]], format="coo")
    factor = spla.splu(whole.tocsc())
    entries = whole.data.astype(np.longdouble)
    wanted = np.append(load, 0.0).astype(np.longdouble)
    x = np.zeros(n + 1, dtype=np.longdouble)
    for _ in range(6):
        product = np.zeros(n + 1, dtype=np.longdouble)
        np.add.at(product, whole.coords[0], entries * x[whole.coords[1]])
        x += factor.solve((wanted - product).astype(float))
    return x[:n].astype(float)
