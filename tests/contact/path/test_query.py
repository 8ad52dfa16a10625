"""Straight pieces in the place of a law's curves, and questions to a path: solutions, folds, least
energy, proofs."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import brentq

from tcstudy.contact.certificates import certify
from tcstudy.contact.path.query import folds, lowest, proved_minima, solutions_at, solutions_of
from tcstudy.contact.solution import Acceptance
from tcstudy.laws.composed import piecewise_linear
from tcstudy.laws.shapes import SHAPES
from tests.contact import contact_cases as cases
from tests.contact.path.cases import (
    a_solution,
    follow,
    one_node,
    random_path_problem,
    softening_line,
)


@pytest.mark.parametrize("tolerance", [1e-1, 1e-2, 1e-4, 1e-6])
def test_error_bound_with_no_more_sides_than_it_needs(tolerance: float) -> None:
    """∫√(|b″|/(16 E)) sides in the limit of many, with E the error; two more for the ends that stay
    on the curve."""
    law = SHAPES["exponential"].build(a=2.0, b=0.5, delta=0.3)
    found = piecewise_linear(law, tolerance, 40.0)
    s, error = np.linspace(-4.0, 4.0, 100_001), tolerance * law.b_scale
    assert 0.4 * error <= np.max(np.abs(found.b(s) - law.b(s))) <= error * (1 + 1e-9)
    assert np.array_equal(found.kinks, -found.kinks[::-1])
    assert found.b_right == pytest.approx(-found.b_left[::-1], abs=1e-15)
    assert np.count_nonzero(found.kinds) == 1
    least = 2.0 * (np.sqrt(1.5 / (16.0 * error)) - np.sqrt(2.0 / 16.0))
    assert least - 1 <= np.count_nonzero(found.kinks > 0.0) <= least + 3


def test_bad_tolerance_is_named_and_linear_laws_pass_through() -> None:
    law = cases.slip_weakening()
    assert piecewise_linear(law, 1e-3, 1.0) is law
    with pytest.raises(ValueError, match="must be positive"):
        piecewise_linear(cases.exponential_decay(), 0.0, 1.0)


def test_all_three_solutions_of_an_exponential_law() -> None:
    """s + 0.2 + 0.8 exp(−5 s) = t has two roots with s > 0 beside sticking between the fold and t =
    1."""
    law, t = cases.exponential_decay(1.0, 0.2, 0.2), 0.8
    path = follow(one_node(piecewise_linear(law, 1e-3, 3.0)), np.zeros(1), 0.0, 0.0, 2.0)
    found = solutions_of(law, path, t)
    assert [s.stable for s in found] == [True, False, True]
    assert max(one_node(law).at(t).inclusion_residual(s.v) for s in found) <= 1e-14
    g = lambda s: s + 0.2 + 0.8 * np.exp(-5 * s) - t  # noqa: E731
    roots = [
        brentq(g, *ends, xtol=1e-15) for ends in ((0.0, np.log(4.0) / 5), (np.log(4.0) / 5, 1.0))
    ]
    assert [float(s.v[0]) for s in found] == pytest.approx([0.0, *roots], abs=1e-13)


def test_folds_step_back_by_what_is_asked() -> None:
    """0 ↑ 5 ↓ 4.9 ↑ 6 ↓ 1 ↑ 1.5 ↓ 1.2 ↑ 9: wiggles of 0.1 and 0.3 at a step back of 5."""
    plain = follow(one_node(cases.slip_weakening()), np.zeros(1), 0.0, 0.0, 1.0)
    path = replace(
        plain, t=np.array([0.0, 5.0, 4.9, 6.0, 1.0, 1.5, 1.2, 9.0]), stable=np.ones(7, dtype=bool)
    )
    assert [folds(path, least).tolist() for least in (0.05, 0.2, 1.0, 6.0)] == [
        [1, 2, 3, 4, 5, 6],
        [3, 4, 5, 6],
        [3, 4],
        [],
    ]
    alone = replace(plain, t=np.array([0.0, 2.0, 1.5]), stable=np.ones(2, dtype=bool))
    assert [folds(alone, least).tolist() for least in (0.5, 0.6)] == [[1], []]
    assert (
        folds(replace(plain, t=np.array([0.0, 1.0]), stable=np.ones(1, dtype=bool)), 0.0).tolist()
        == []
    )


LONG = piecewise_linear(cases.exponential_decay(1.0, 0.3, 0.3), 2e-4, 4.0)
"""A polygon with hundreds of states."""


@pytest.mark.parametrize("seed", range(6))
def test_least_energy_of_random_paths_and_its_proofs(seed: int) -> None:
    """Lowest of all solutions at random t; groups prove what single certificates prove. Seed 0:
    hundreds of states."""
    rng = np.random.default_rng([seed, 131])
    problem = (
        random_path_problem(rng, int(rng.integers(1, 12)))
        if seed
        else softening_line(12).with_law(LONG)
    )
    path = follow(
        problem, a_solution(problem, 0.0), 0.0, -2.0 if seed else 0.0, 2.0 if seed else 3.0
    )
    low = lowest(path)
    assert np.all(low.begin < low.end)
    assert low.begin[1:] == pytest.approx(low.end[:-1], abs=1e-12)
    assert (low.begin[0], low.end[-1]) == (path.t.min(), path.t.max())
    assert np.all(low.piece[1:] != low.piece[:-1])
    for t in rng.uniform(path.t.min(), path.t.max(), 60).tolist():
        found, energy_at = solutions_at(path, t), problem.at(t).energy
        piece = low.piece[np.searchsorted(low.begin, t, side="right") - 1]
        energy = next(energy_at(s.v) for s in found if s.piece == piece)
        assert energy <= min(energy_at(s.v) for s in found) + 1e-11 * float(
            np.max(np.abs(path.energy))
        )
    proved = proved_minima(path, low, problem.at(0.0).lambda_1, Acceptance())
    for begin, end, k, known in zip(low.begin, low.end, low.piece, proved, strict=True):
        t = 0.5 * (begin + end)
        v = path.u[k] + (t - path.t[k]) / (path.t[k + 1] - path.t[k]) * (path.u[k + 1] - path.u[k])
        assert certify(problem.at(t), v).global_minimum == known
    assert seed or (len(proved) > 200 and np.count_nonzero(proved) > 0)
