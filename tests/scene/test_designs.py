"""Points of the unit cube cover it as their design says and grow; distributions have their
quantiles."""

import numpy as np
import pytest
from scipy import special

from tcstudy.scene.designs import DESIGNS, Design, Distribution, correlated, count, cube


@pytest.mark.parametrize("mode", DESIGNS)
def test_a_longer_design_begins_with_the_shorter_one(mode: str) -> None:
    for few, many in ((12, 24), (8, 64), (1, 4)):
        one, two = (cube(Design(mode, n, 7), 3) for n in (few, many))
        assert len(two) == count(mode, many, 3)
        assert np.array_equal(two[: len(one)], one)
        assert np.all((two > 0.0) & (two < 1.0))
        assert not np.array_equal(cube(Design(mode, few, 8), 3), one)


def test_a_copula_gives_its_correlation_and_keeps_the_distributions() -> None:
    R = np.array([[1.0, 0.6, -0.3], [0.6, 1.0, 0.0], [-0.3, 0.0, 1.0]])
    u = correlated(cube(Design("random", 4096, 5), 3), R)
    np.testing.assert_allclose(np.corrcoef(special.ndtri(u).T), R, atol=0.03)
    np.testing.assert_allclose(
        np.corrcoef(u.T), 6 / np.pi * np.arcsin(R / 2), atol=0.03
    )  # of ranks
    assert np.max(np.abs(np.sort(u, axis=0) - (np.arange(4096) + 0.5)[:, None] / 4096)) < 0.03
    assert np.array_equal(correlated(cube(Design("random", 2048, 5), 3), R), u[:2048])


def test_designs_cover_the_cube() -> None:
    for n in (1, 5, 20, 96):  # a Latin hypercube has one point in each row
        u = cube(Design("latin-hypercube", n, 3), 4)
        assert np.array_equal(
            np.sort((u * n).astype(int), axis=0), np.tile(np.arange(n)[:, None], 4)
        )
    boxes = (cube(Design("sobol", 64, 1), 2) * 8).astype(int)
    assert np.array_equal(np.unique(boxes @ [8, 1], return_counts=True)[1], np.ones(64))
    assert "64 points cover" in Design("sobol", 50, 1).note
    assert "balanced" not in Design("sobol", 64, 1).note
    rows = cube(Design("saltelli", 8, 1), 3).reshape(
        8, 5, 3
    )  # one column at a time from the other matrix
    for i in range(3):
        others = [j for j in range(3) if j != i]
        assert np.array_equal(rows[:, 2 + i, i], rows[:, 1, i])
        assert np.array_equal(rows[:, 2 + i][:, others], rows[:, 0][:, others])


U = np.array([0.1, 0.25, 0.5, 0.9])
Z = special.ndtri(U)


@pytest.mark.parametrize(
    ("kind", "numbers", "expected"),
    [
        ("uniform", {"from": 100.0, "to": 400.0}, 100.0 + 300.0 * U),
        ("log-uniform", {"from": 1.0, "to": 1e4}, 10.0 ** (4.0 * U)),
        ("normal", {"mean": 5.0, "sigma": 2.0}, 5.0 + 2.0 * Z),
        ("lognormal", {"median": 2e6, "sigma": 0.3}, 2e6 * np.exp(0.3 * Z)),
        ("truncated-normal", {"mean": 5.0, "sigma": 2.0, "from": 5.0, "to": 1e3},
         5.0 + 2.0 * special.ndtri(0.5 + 0.5 * U)),
        ("triangular", {"from": 0.0, "mode": 1.0, "to": 1.0}, np.sqrt(U)),
    ],
)  # fmt: skip
def test_values_are_quantiles(kind: str, numbers: dict[str, float], expected: np.ndarray) -> None:
    one = Distribution(kind, tuple(numbers.items()))
    assert one.is_sound
    np.testing.assert_allclose(one.at(U), expected, rtol=1e-13)
