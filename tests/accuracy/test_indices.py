"""First-order indices of drawn points: right values, intervals that hold, and reasons for none."""

import numpy as np
import pytest

from tcstudy.accuracy.indices.first_order import SobolIndex, first_order, first_order_of
from tests.accuracy.responses import CASES, Case, g_function


def estimates(case: Case, count: int, seed: int = 0, design: str = "random") -> list[SobolIndex]:
    x, y = case.sample(design, count, [count, seed])
    return first_order(x, y, case.named, balanced=design == "sobol")


def as_array(indices: list[SobolIndex]) -> np.ndarray:
    return np.array([(index.value, index.low, index.high) for index in indices])


@pytest.mark.parametrize(
    ("name", "design", "repeats"),
    [
        ("linear .98", "random", 40),
        ("linear .54", "random", 40),
        ("interactions", "random", 40),
        ("jump .9", "random", 40),
        ("10 steps .98", "random", 40),
        ("8 teeth .9", "random", 30),
        ("choice 5 .05 uneven", "random", 40),
        ("correlated", "random", 40),
        ("linear .9", "latin-hypercube", 30),
        ("linear .54", "sobol", 20),
    ],
)
def test_intervals_hold_the_truth(name: str, design: str, repeats: int) -> None:
    case, count = CASES[name], 256 if design == "sobol" else 200
    held = np.zeros(len(case.indices))
    for seed in range(repeats):
        ends = as_array(estimates(case, count, seed, design))
        held += (ends[:, 1] <= case.indices) & (case.indices <= ends[:, 2])
    assert np.all(held >= 0.85 * repeats)


@pytest.mark.parametrize("name", ["ishigami", "g", "side", "choice 10 .9", "wave .9", "4 teeth .9"])
def test_values_are_the_closed_form(name: str) -> None:
    case = CASES[name]
    indices = as_array(estimates(case, 2000))
    np.testing.assert_allclose(indices[:, 0], case.indices, atol=0.04)
    assert np.all(indices[:, 2] - indices[:, 1] < 0.1)


def test_values_of_the_g_function_are_those_published() -> None:
    case = g_function(0.0, 1.0, 4.5, 9.0, 99.0, 99.0)
    np.testing.assert_allclose(case.indices, [0.716, 0.179, 0.024, 0.0072, 1e-4, 1e-4], atol=6e-4)


def test_scale_shift_and_order_change_nothing() -> None:
    x, y = CASES["jump .9"].sample("random", 500, [1])
    x[:, 0] = np.round(x[:, 0], 2)  # points with equal inputs have no order
    indices = as_array(first_order(x, y))
    for changed in (first_order(1e6 * x + 3.0, 1e-9 * y + 5e-9), first_order(-x, -y)):
        np.testing.assert_allclose(as_array(changed), indices, atol=1e-6)
    shuffled = np.random.default_rng(2).permutation(500)
    again = as_array(first_order(x[shuffled], y[shuffled]))
    np.testing.assert_allclose(again, indices, atol=1e-9)


def test_names_of_a_choice_have_no_order() -> None:
    x, y = CASES["choice 10 .9"].sample("random", 300, [3])
    renamed = np.random.default_rng(4).permutation(10)[x[:, 0].astype(int)].astype(float)
    assert first_order_of(renamed, y, True).value == pytest.approx(
        first_order_of(x[:, 0], y, True).value, abs=1e-12
    )


def test_a_function_of_one_input_has_the_index_one_with_hardly_any_width() -> None:
    x = np.random.default_rng(5).random(500)
    for y in (np.sin(7.0 * x), 3.0 * x, np.where(x > 0.6, 1.0, 0.0), np.floor(3.0 * x)):
        index = first_order_of(x, y)
        assert index.value == pytest.approx(1.0, abs=1e-8)
        assert index.low == pytest.approx(1.0, abs=1e-8)
        assert index.high == pytest.approx(1.0, abs=1e-8)


def test_where_no_interval_would_hold_there_is_a_reason() -> None:
    random = np.random.default_rng(6)
    x, noise = random.random(500), random.normal(size=500)
    rare = np.where(np.arange(500) < 4, 1.0, 0.0)
    cases = {
        "fewer than 50 points": first_order_of(x[:49], noise[:49]),
        "a value has fewer than 5 points": first_order_of(rare, noise, True),
        "a few points carry the variance": first_order_of(x, np.exp(6.0 * noise)),
        "the parameter is the same at all points": first_order_of(np.ones(500), noise),
        "the result is the same at all points": first_order_of(x, 1.0 + 1e-14 * noise),
    }
    for reason, index in cases.items():
        assert index.reason == reason
        assert np.isnan(index.low)
        assert np.isnan(index.high)
        assert np.isnan(index.value) == reason.startswith("the result")
    assert first_order_of(x[:50], noise[:50]).reason == ""
    assert first_order_of(np.where(np.arange(500) < 5, 1.0, 0.0), noise, True).reason == ""
