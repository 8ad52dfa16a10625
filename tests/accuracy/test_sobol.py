"""Sobol indices against closed forms and against scipy; jumps are found where there are some, and nowhere else."""

import numpy as np
import pytest

from tcstudy.accuracy.sobol import correlation_ratios, jump, sobol
from tcstudy.scene.designs import Design, cube

N = 1024


def ishigami(u: np.ndarray) -> np.ndarray:
    """sin x₁ + 7 sin² x₂ + 0.1 x₃⁴ sin x₁, x_i uniform in (−π, π) (Ishigami & Homma, ISUMA 1990)."""
    x = np.pi * (2.0 * u - 1.0)
    return np.sin(x[..., 0]) + 7.0 * np.sin(x[..., 1]) ** 2 + 0.1 * x[..., 2] ** 4 * np.sin(x[..., 0])


V1, V2, V13 = 0.5 * (1 + 0.1 * np.pi**4 / 5) ** 2, 49 / 8, 0.01 * np.pi**8 * (1 / 18 - 1 / 50)
FIRST = np.array([V1, V2, 0.0]) / (V1 + V2 + V13)
TOTAL = np.array([V1 + V13, V2, V13]) / (V1 + V2 + V13)


def test_indices_of_ishigami_are_the_closed_form_within_their_intervals() -> None:
    f = ishigami(cube(Design("saltelli", N, 1), 3)).reshape(N, 5)
    for estimate, exact in zip(sobol(f), (FIRST, TOTAL), strict=True):
        np.testing.assert_allclose(estimate.value, exact, atol=0.015)
        assert np.all((estimate.low <= exact) & (exact <= estimate.high))
    moved = sobol(1e-6 * f + 3.0)
    np.testing.assert_allclose(moved[0].value, sobol(f)[0].value, rtol=1e-7)


def test_a_choice_has_the_share_of_the_means_of_its_values() -> None:
    """y = (0, 3, 1)_c + x: Var E[y|c] = 14/9, Var x = 1/12."""
    rng = np.random.default_rng(2)
    c, x = rng.integers(0, 3, 5000), rng.random(5000)
    exact = np.array([14 / 9, 1 / 12]) / (14 / 9 + 1 / 12)
    found = correlation_ratios(np.stack([c, x], axis=1), np.array([0.0, 3.0, 1.0])[c] + x, (True, False))
    np.testing.assert_allclose(found.value, exact, atol=0.01)


def test_what_does_not_vary_has_no_indices_but_zero() -> None:
    assert not any(np.any(one.value) for one in sobol(1.0 + 1e-14 * np.random.default_rng(0).random((64, 5))))
    with pytest.raises(ValueError, match="two rows"):
        sobol(np.ones((1, 5)))


@pytest.mark.parametrize("scale", [1e-9, 1e6])
def test_a_jump_is_found_at_every_scale_and_in_no_smooth_distribution(scale: float) -> None:
    rng = np.random.default_rng(3)
    for smooth in (rng.normal(size=500), rng.lognormal(sigma=1.5, size=500), rng.random(200) ** 4):
        assert jump(scale * smooth) is None
        low, high = np.quantile(smooth, 0.3), np.ptp(smooth)
        ends = jump(scale * np.where(smooth > low, smooth + high, smooth))
        assert ends is not None
        assert ends[0] <= scale * low < ends[1]


def test_steps_of_a_mesh_are_no_jumps_and_dependent_values_narrow_a_jump_or_close_it() -> None:
    steps = np.round(np.random.default_rng(3).random(500), 1)
    assert jump(steps, 0.1) is None
    assert jump(np.where(steps > 0.5, steps + 1.0, steps), 0.1) == (0.5, 1.6)
    assert jump(np.repeat([0.0, 1.0], 40)) == (0.0, 1.0)
    assert jump(np.ones(100)) is None
    values = np.concatenate([np.linspace(0.0, 0.1, 40), np.linspace(1.0, 1.1, 40)])
    assert jump(values, 0.0, np.array([0.12, 1.05])) == (0.12, 1.0)
    assert jump(values, 0.0, np.linspace(0.1, 1.0, 30)) is None
