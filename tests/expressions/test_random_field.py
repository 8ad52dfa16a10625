"""Random strengths: mean, scatter and correlation as they are asked for, the same on every mesh."""

import numpy as np
import pytest

from tcstudy.errors import StudyError
from tcstudy.expressions.expression import random_field
from tcstudy.read.study import read_study_text
from tcstudy.scene.study import Study

L, ELL, SCATTER = 0.2, 0.1, 0.2
BLOCK = """
units: none
body: {rectangle: {width: 1, height: 0.5}}
boundary: {bottom: contact, top: {role: clamped, u_x: 0.05, u_y: 0}, left: free, right: free}
material: {lambda: 1.5, mu: 1}
friction: {law: linear, k: 1, scatter: 0.3, scatter_length: 0.4, scatter_seed: 2}
mesh: {maxh: 0.25}
"""


def test_the_fields_of_many_seeds_have_their_mean_scatter_and_correlation() -> None:
    """Between the points of the expansion, too: ln β is Gaussian, of covariance ζ² exp(−(d/ℓ)²)."""
    along = np.linspace(0.0, L, 5)
    points = np.stack([along, 0.0 * along], axis=1)
    x = np.array([0.0, 0.03, 0.03 + ELL, 0.19])
    found = np.array(
        [random_field(points, SCATTER, ELL, seed).evaluate(x, 0.0 * x) for seed in range(1000)]
    )
    zeta = np.log1p(SCATTER**2)
    assert found.min() > 0.0
    assert found.mean(axis=0) == pytest.approx(np.ones(4), abs=0.015)
    assert found.std(axis=0) == pytest.approx(np.full(4, SCATTER), abs=0.015)
    exact = zeta * np.exp(-(((x[:, None] - x) / ELL) ** 2))
    np.testing.assert_allclose(np.cov(np.log(found).T), exact, atol=0.08 * zeta)


def strengths(study: Study, x: np.ndarray) -> np.ndarray:
    ((_, _, strength),) = study.scenes[0].friction.laws  # type: ignore[union-attr]
    return np.asarray(strength.evaluate(x, 0.0 * x))  # type: ignore[union-attr]


def test_a_joint_with_a_random_strength_keeps_its_field_on_every_mesh() -> None:
    study, x = read_study_text(BLOCK), np.linspace(0.0, 1.0, 50)
    assert np.ptp(strengths(study, x)) > 0.1
    for change, same in (("mesh.maxh=0.1", True), ("friction.scatter_seed=3", False)):
        assert (
            np.array_equal(strengths(read_study_text(BLOCK, "s", [change]), x), strengths(study, x))
            == same
        )
    study = read_study_text(BLOCK + "sweep: {friction.scatter_seed: [1, 2, 3]}\n")
    assert len({scene.friction for scene in study.scenes}) == 3
    for change, said in (
        ("friction={law: linear, k: 1, scatter: 0.3}", "friction.scatter_length: is missing"),
        ("friction.scatter_length=0.001", "is too short for the joint; write 0.005 m or more"),
    ):
        with pytest.raises(StudyError, match=said):
            read_study_text(BLOCK, "s", [change])
