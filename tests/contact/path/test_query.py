"""Straight pieces in the place of a law's curves, and questions to a path: solutions, folds, least energy, proofs."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import brentq

from tcstudy.contact.certificates import certify
from tcstudy.contact.path.follow import Path
from tcstudy.contact.path.piecewise_linear_approximation import piecewise_linear
from tcstudy.contact.path.query import folds, lowest, proved_minima, solutions_at, solutions_of, turn_sizes
from tcstudy.laws.shapes import SHAPES
from tcstudy.scene.study import Acceptance
from tests.contact import contact_cases as cases
from tests.contact.path.cases import a_solution, follow, one_node, random_path_problem, softening_line


@pytest.mark.parametrize("tolerance", [1e-1, 1e-2, 1e-4, 1e-6])
def test_error_bound_with_no_more_sides_than_it_needs(tolerance: float) -> None:
    """∫√(|b″|/(16 E)) sides in the limit of many, with E the error; two more for the ends that stay on the curve."""
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
    """s + 0.2 + 0.8 exp(−5 s) = t has two roots with s > 0 beside sticking between the fold and t = 1."""
    law, t = cases.exponential_decay(1.0, 0.2, 0.2), 0.8
    path = follow(one_node(piecewise_linear(law, 1e-3, 3.0)), np.zeros(1), 0.0, 0.0, 2.0)
    found = solutions_of(law, path, t)
    assert [s.stable for s in found] == [True, False, True]
    assert max(one_node(law).at(t).inclusion_residual(s.v) for s in found) <= 1e-14
    g = lambda s: s + 0.2 + 0.8 * np.exp(-5 * s) - t  # noqa: E731
    roots = [brentq(g, *ends, xtol=1e-15) for ends in ((0.0, np.log(4.0) / 5), (np.log(4.0) / 5, 1.0))]
    assert [float(s.v[0]) for s in found] == pytest.approx([0.0, *roots], abs=1e-13)


def test_sizes_by_hand() -> None:
    """0 ↑ 5 ↓ 4.9 ↑ 6 ↓ 1 ↑ 1.5 ↓ 1.2 ↑ 9: wiggles of 0.1 and 0.3 at a step back of 5."""
    t = np.array([0.0, 5.0, 4.9, 6.0, 1.0, 1.5, 1.2, 9.0])
    size, partner = turn_sizes(t, np.arange(1, 7))
    assert size == pytest.approx([0.1, 0.1, 5.0, 5.0, 0.3, 0.3])
    assert partner.tolist() == [1, 0, 3, 2, 5, 4]
    assert turn_sizes(np.array([0.0, 2.0, 1.5]), np.array([1]))[0] == pytest.approx([0.5])
    assert len(turn_sizes(np.array([0.0, 1.0]), np.array([], dtype=np.intp))[0]) == 0


def wiggled(path: Path, size: float) -> Path:
    """Every piece of the path goes back by this part of its length once."""
    k = np.arange(path.pieces)

    def between(x: np.ndarray) -> np.ndarray:
        rows = [x[k] + s * (x[k + 1] - x[k]) for s in (0.0, 0.5 + size, 0.5)]
        return np.concatenate([np.stack(rows, axis=1).reshape((-1, *x.shape[1:])), x[-1:]])

    columns = {name: between(getattr(path, name)) for name in ("t", "u", "traction", "residual")}
    stable, codes = np.repeat(path.stable, 3), np.repeat(path.codes, 3, axis=0)
    return replace(path, **columns, stable=stable, codes=codes, start=3 * path.start)


@pytest.mark.parametrize("unit", [1e-7, 1e9])
def test_turns_within_rounding_are_no_folds(unit: float) -> None:
    problem = softening_line(40, 0.02)
    path = follow(replace(problem, l_1=problem.l_1 / unit), np.zeros(40), 0.0, 0.0, 3.0 * unit)
    plain = path.t[folds(path).vertex].tolist()
    assert len(plain) == len(path.folds) > 10
    blurred = wiggled(path, 1e-14)
    assert len(blurred.folds) > 2 * path.pieces
    assert blurred.t[folds(blurred).vertex].tolist() == pytest.approx(plain, rel=1e-13)
    assert len(folds(wiggled(path, 1e-9)).vertex) > path.pieces


LONG = piecewise_linear(cases.exponential_decay(1.0, 0.3, 0.3), 2e-4, 4.0)
"""A polygon with hundreds of states."""


@pytest.mark.parametrize("seed", range(6))
def test_least_energy_of_random_paths_and_its_proofs(seed: int) -> None:
    """Lowest of all solutions at random t; groups prove what single certificates prove. Seed 0: hundreds of states."""
    rng = np.random.default_rng([seed, 131])
    problem = random_path_problem(rng, int(rng.integers(1, 12))) if seed else softening_line(12).with_law(LONG)
    path = follow(problem, a_solution(problem, 0.0), 0.0, -2.0 if seed else 0.0, 2.0 if seed else 3.0)
    low = lowest(path)
    assert np.all(low.begin < low.end)
    assert low.begin[1:] == pytest.approx(low.end[:-1], abs=1e-12)
    assert (low.begin[0], low.end[-1]) == (path.t.min(), path.t.max())
    assert np.all(low.piece[1:] != low.piece[:-1])
    for t in rng.uniform(path.t.min(), path.t.max(), 60).tolist():
        found, energy_at = solutions_at(path, t), problem.at(t).energy
        piece = low.piece[np.searchsorted(low.begin, t, side="right") - 1]
        energy = next(energy_at(s.v) for s in found if s.piece == piece)
        assert energy <= min(energy_at(s.v) for s in found) + 1e-11 * float(np.max(np.abs(path.energy)))
    proved = proved_minima(path, low, problem.at(0.0).lambda_1, Acceptance())
    for begin, end, k, known in zip(low.begin, low.end, low.piece, proved, strict=True):
        t = 0.5 * (begin + end)
        v = path.u[k] + (t - path.t[k]) / (path.t[k + 1] - path.t[k]) * (path.u[k + 1] - path.u[k])
        assert certify(problem.at(t), v).global_minimum == known
    assert seed or (len(proved) > 200 and np.count_nonzero(proved) > 0)
