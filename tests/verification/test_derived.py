"""Derived loads: those of known solutions to rounding, and rates of new ones, heated, curved, turned, softening."""

from __future__ import annotations

import re

import numpy as np
import pytest

from tcstudy.data.tables import Measured
from tcstudy.fem.geometry import build
from tcstudy.offline.level import Level
from tcstudy.read.study import read_study_text
from tcstudy.scene.study import Study
from tcstudy.study.convergence import converge
from tests.verification import closed_forms, derived
from tests.verification.scenes import mesh_family
from tests.verification.series import errors, series
from tests.verification.test_convergence import smooth_study


def with_derived_loads(study: Study) -> Study:
    """The same study, its loads and prescribed displacements left out."""
    text = re.sub(r'\{role: clamped, u: \[".*?"\]\}', "clamped", study.text)
    text = re.sub(r"\{role: convection, g: .*\}", "convection", text)
    text = re.sub(r"loads: \{f:.*\n", "", text)
    text = re.sub(r', theta_bar: ".*?"', "", text)
    text = text.replace("exact: {", "exact: {loads: derived, ")
    assert " u: " in text
    assert "role" not in text
    return read_study_text(text)


HAND = {
    "smooth": smooth_study(2),
    "stick-slip": closed_forms.stick_slip(2),
    "stick-slip turned": closed_forms.stick_slip(2, 45.0),
    "ring": closed_forms.ring(2),
    "incompressible": closed_forms.incompressible(2, (0.3, 0.49)),
}


@pytest.mark.parametrize("name", HAND)
def test_the_loads_given_by_hand_come_out(name: str) -> None:
    """As what the contact problem is made of: condensed load l̃, and l_θ and the prescribed displacements."""
    hand, own = HAND[name], with_derived_loads(HAND[name])
    assert len(hand.scenes) == len(own.scenes)
    for given, found in zip(hand.scenes, own.scenes, strict=True):
        assert dict(given.boundary).keys() == dict(found.boundary).keys()
        mesh = list(mesh_family(build(given.body), hand.mesh))[-1]
        one, other = Level(mesh, given), Level(mesh, found)
        a, b = one.condensed(given), other.condensed(found)
        size = np.max(np.abs(a.problem.l_tilde))
        np.testing.assert_allclose(b.problem.l_tilde, a.problem.l_tilde, rtol=0, atol=1e-12 * size)
        assert b.constant == pytest.approx(a.constant, rel=1e-12)
        load = one.load(given)
        np.testing.assert_allclose(other.load(found), load, rtol=0, atol=1e-12 * max(1.0, np.max(np.abs(load))))
        np.testing.assert_allclose(other.frames.values, one.frames.values, rtol=0, atol=1e-13)


@pytest.fixture(scope="module")
def ring() -> Measured:
    return converge(derived.ring(5))


def test_ring(ring: Measured) -> None:
    """On a curved contact line, with a weakening film: b falls by w = 0.6 < λ₁."""
    for norm, order, bound in (
        *(("theta_L2", 2, 8.5e-5), ("theta_H1", 1, 2.3e-2), ("u_energy", 1, 1.8e-2), ("u_H1", 1, 1.9e-2)),
        *(("u_L2", 2, 2.7e-4), ("u_T_L2", 1.5, 1.3e-3), ("u_T_max", 1, 6e-3), ("xi_nodes", 1.5, 4e-4)),
    ):
        own = errors(ring.points[0])[norm]
        assert own.expected == order
        assert own.rate[-1] == pytest.approx(order, abs=0.1)
        assert own.error[-1] < bound


def test_numbers_tend_to_the_exact_ones(ring: Measured) -> None:
    for name in ("energy", "friction_resultant", "slip_length"):
        own = series(ring.points[0], name)
        assert np.isfinite(own.exact)
        assert abs(own.limit - own.exact) <= max(own.uncertainty, 1e-12)
        assert own.uncertainty < 3e-4 * abs(own.exact)
    assert ring.notes == []
