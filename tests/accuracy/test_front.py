"""What is worth its cost."""

from __future__ import annotations

import numpy as np

from tcstudy.accuracy.front import dominated


def test_only_points_that_nothing_beats_are_left() -> None:
    cost = np.array([1.0, 2.0, 3.0, 2.5, 4.0, np.nan, 1.0])
    error = np.array([9.0, 4.0, 4.0, 5.0, 1.0, 0.1, 9.5])
    assert dominated(cost, error).tolist() == [False, False, True, True, False, True, True]


def test_equal_points_do_not_dominate_each_other() -> None:
    assert dominated(np.array([1.0, 1.0]), np.array([2.0, 2.0])).tolist() == [False, False]


def test_against_the_definition_on_random_points() -> None:
    rng = np.random.default_rng(0)
    cost, error = rng.integers(0, 8, (2, 60)).astype(float)
    found = dominated(cost, error)
    for i in range(60):
        beaten = any(
            cost[k] <= cost[i] and error[k] <= error[i] and (cost[k], error[k]) != (cost[i], error[i])
            for k in range(60)
        )
        assert found[i] == beaten
