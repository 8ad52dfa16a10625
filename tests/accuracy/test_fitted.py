"""Least squares with intervals against linear regression in closed form; what is not determined;
runs of signs."""

import numpy as np
import pytest
from scipy import optimize, stats

from tcstudy.accuracy.fitted import Box, different, feet, minimise, product, uncertainty

Array = np.ndarray
X = np.linspace(0.1, 2.0, 30)


def box(k: int = 2, log: bool = False) -> Box:
    return Box(np.full(k, 0.01), np.full(k, 50.0), np.full(k, log))


def decay(p: Array) -> tuple[Array, Array]:
    """y = a exp(−b x) with a = 3, b = 0.8 and scatter 0.02."""
    e, data = (
        np.exp(-p[1] * X),
        3.0 * np.exp(-0.8 * X) + 0.02 * np.random.default_rng(3).normal(size=len(X)),
    )
    return (p[0] * e - data) / 0.02, np.stack([e, -p[0] * X * e], axis=1) / 0.02


def test_outliers_count_less_but_what_is_no_measurement_counts_as_it_is() -> None:
    """Σρ(r²) of data with an outlier, and a prior of its own that pulls far: the least value by
    another method."""
    data = np.array([0.9, 1.0, 1.1, 9.0])

    def model(p: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return np.append(p - data, 0.5 * (p - 20.0)), np.append(np.ones(4), 0.5)[:, None]

    def cost(p: float) -> float:
        return float(np.sum(2.0 * (np.sqrt(1.0 + (p - data) ** 2) - 1.0)) + 0.25 * (p - 20.0) ** 2)

    wide = Box(np.array([0.0]), np.array([40.0]), np.array([False]))
    found = minimise(model, np.array([2.0]), wide, "soft_l1", prior=1)
    expected = optimize.minimize_scalar(
        cost, bounds=(0.0, 40.0), method="bounded", options={"xatol": 1e-10}
    )
    assert found.p == pytest.approx([expected.x], rel=1e-4)
    assert found.cost == pytest.approx(0.5 * expected.fun, rel=1e-8)


def test_a_straight_line_has_the_intervals_of_regression() -> None:
    """y = a + b x: errors and Student intervals of the text book, with the noise estimated."""
    y = 1.0 + 2.0 * X + 0.3 * np.random.default_rng(1).normal(size=len(X))

    def model(p: Array) -> tuple[Array, Array]:
        return p[0] + p[1] * X - y, np.stack([np.ones_like(X), X], axis=1)

    found = minimise(model, np.array([5.0, 5.0]), box())
    said = uncertainty(found, box(), [np.arange(len(X))], known_noise=False)
    line = stats.linregress(X, y)
    assert found.p == pytest.approx([line.intercept, line.slope], rel=1e-7)
    assert said["standard_error"] == pytest.approx([line.intercept_stderr, line.stderr], rel=1e-6)
    reach = stats.t.ppf(0.975, len(X) - 2) * line.stderr
    assert said["interval"][1] == pytest.approx([line.slope - reach, line.slope + reach], rel=1e-6)
    assert (said["degrees_of_freedom"], said["weak"]) == (28, 0)
    assert np.isnan(said["fit_probability"])


def test_known_noise_gives_chi_square_and_a_wrong_shape_few_runs() -> None:
    found = minimise(decay, np.array([1.0, 1.0]), box(log=True))
    said = uncertainty(found, box(log=True), [np.arange(len(X))], known_noise=True)
    assert np.all((said["interval"][:, 0] < [3.0, 0.8]) & (said["interval"][:, 1] > [3.0, 0.8]))
    assert min(said["fit_probability"], said["runs_probability"]) > 0.01

    def straight(p: Array) -> tuple[Array, Array]:
        data = 3.0 * np.exp(-0.8 * X)
        return (p[0] - p[1] * X - data) / 0.02, np.stack([np.ones_like(X), -X], axis=1) / 0.02

    wrong = uncertainty(
        minimise(straight, np.array([2.0, 1.0]), box()),
        box(),
        [np.arange(len(X))],
        known_noise=True,
    )
    assert (wrong["fit_probability"] < 1e-6, wrong["runs"], wrong["runs_probability"] < 1e-4) == (
        True,
        3,
        True,
    )
    assert wrong["information_criterion"] > said["information_criterion"]


def test_what_only_a_product_decides_is_named() -> None:
    def model(p: Array) -> tuple[Array, Array]:
        e = np.exp(-X) * np.sqrt(p[0] * p[1])
        return (e - 2.0 * np.exp(-X)) / 0.01, 0.5 * np.stack([e / p[0], e / p[1]], axis=1) / 0.01

    found = minimise(model, np.array([1.0, 2.0]), box(log=True))
    said = uncertainty(found, box(log=True), [np.arange(len(X))], known_noise=True)
    assert found.p.prod() == pytest.approx(4.0, rel=1e-6)
    assert said["weak"] == 1
    assert product(said["singular_vector"][0], ("tau_s", "delta")) == "tau_s·delta"
    other = minimise(model, np.array([10.0, 0.5]), box(log=True))
    assert not np.allclose(other.p, found.p, rtol=0.1)
    assert [len(same) for same in different([found, other], box(log=True), True)] == [
        2
    ]  # ends of one valley
    assert product(said["singular_vector"][1], ("tau_s", "delta")) in (
        "tau_s·delta^-1",
        "tau_s^-1·delta",
    )


def test_a_parameter_on_its_bound_has_no_interval_and_several_starts_find_several_minima() -> None:
    tight = Box(np.full(2, 0.01), np.array([2.0, 50.0]), np.full(2, False))
    found = minimise(decay, np.array([1.0, 1.0]), tight)
    said = uncertainty(found, tight, [np.arange(len(X))], known_noise=True)
    assert said["at_bound"].tolist() == [True, False]
    assert np.isnan(said["interval"][0]).all()
    assert np.isfinite(said["interval"][1]).all()

    def waves(p: Array) -> tuple[Array, Array]:
        return np.array([np.sin(p[0]), 0.1 * (p[0] - 6.0)]), np.array([[np.cos(p[0])], [0.1]])

    wide = Box(np.array([0.5]), np.array([12.0]), np.array([False]))
    minima = different(
        [minimise(waves, start, wide) for start in wide.starts(np.array([2.0]), 8, 0)], wide, False
    )
    assert len(minima) >= 3
    assert sum(map(len, minima)) == 8
    assert minima[0][0].p[0] == pytest.approx(2.0 * np.pi, abs=0.05)


def test_feet_follow_a_curve_that_turns_back() -> None:
    """A hairpin: points near both arms, of which the order decides the arm."""
    corners = np.array([[0.0, 0.0], [4.0, 0.0], [4.0, 0.2], [0.0, 0.2]])
    points = np.array([[1.0, 0.12], [3.0, 0.05], [4.5, 0.1], [3.0, 0.11], [1.0, 0.3]])
    found = feet(points, corners)
    assert found.side.tolist() == [0, 0, 1, 2, 2]
    assert found.distance == pytest.approx([0.12, 0.05, -0.5, 0.09, -0.1])
    assert points - found.point == pytest.approx(found.distance[:, None] * found.normal)


def test_rounding_does_not_choose_the_sign_at_a_corner() -> None:
    """A snap-back of 170°, whose sides see a point beyond their corner on different hands."""
    corners = np.array([[0.0, 0.0], [1.0, 0.0], [1.0 - np.cos(np.pi / 18), np.sin(np.pi / 18)]])
    for point, sign in (
        ([1.5, 0.01], -1.0),
        ([1.5, 0.2], -1.0),
        ([0.5, 0.01], 1.0),
        ([1.0, -0.3], -1.0),
    ):
        for off in np.linspace(-3e-16, 3e-16, 7):
            found = feet(
                np.array([point]), corners + off * np.array([[0.0, 0.0], [1.0, 1.0], [0.0, 0.0]])
            )
            assert np.sign(found.distance[0]) == sign
            np.testing.assert_allclose(
                found.point[0] + found.distance[0] * found.normal[0], point, rtol=1e-14
            )
