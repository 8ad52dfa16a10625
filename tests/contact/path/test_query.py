"""query: sizes of turns by hand, turns within rounding that are no folds; least energy from the definition."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tcstudy.contact.path.follow import Path
from tcstudy.contact.path.query import folds, lowest, solutions_at, turn_sizes
from tests.contact.path.cases import a_solution, follow, random_path_problem, softening_line


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
    share = np.array([0.0, 0.5 + size, 0.5])

    def between(x: np.ndarray) -> np.ndarray:
        rows = [x[k] + s * (x[k + 1] - x[k]) for s in share]
        return np.concatenate([np.stack(rows, axis=1).reshape((-1, *x.shape[1:])), x[-1:]])

    columns = {name: between(getattr(path, name)) for name in ("t", "u", "traction", "residual")}
    stable, codes = np.repeat(path.stable, 3), np.repeat(path.codes, 3, axis=0)
    return replace(path, **columns, stable=stable, codes=codes, start=3 * path.start)


@pytest.mark.parametrize("unit", [1.0, 1e-7, 1e9])
def test_turns_within_rounding_are_no_folds(unit: float) -> None:
    problem = softening_line(40, 0.02)
    problem = replace(problem, l_1=problem.l_1 / unit)
    path = follow(problem, np.zeros(40), 0.0, 0.0, 3.0 * unit)
    plain = path.t[folds(path).vertex].tolist()
    assert len(plain) == len(path.folds) > 10
    blurred = wiggled(path, 1e-14)
    assert len(blurred.folds) > 2 * path.pieces
    assert blurred.t[folds(blurred).vertex].tolist() == pytest.approx(plain, rel=1e-13)
    assert len(folds(wiggled(path, 1e-9)).vertex) > path.pieces


@pytest.mark.parametrize("seed", range(6))
def test_least_energy_of_random_paths(seed: int) -> None:
    rng = np.random.default_rng([seed, 97])
    problem = random_path_problem(rng, int(rng.integers(1, 10)))
    path = follow(problem, a_solution(problem, 0.0), 0.0, -2.0, 2.0)
    low = lowest(path)
    assert np.all(low.begin < low.end)
    assert low.begin[1:] == pytest.approx(low.end[:-1], abs=1e-12)
    assert (low.begin[0], low.end[-1]) == (path.t.min(), path.t.max())
    assert np.all(low.piece[1:] != low.piece[:-1])
    for t in rng.uniform(path.t.min(), path.t.max(), 60).tolist():
        found = solutions_at(path, t)
        piece = low.piece[np.searchsorted(low.begin, t, side="right") - 1]
        energy = next(s.energy for s in found if s.piece == piece)
        assert energy <= min(s.energy for s in found) + 1e-11 * float(np.max(np.abs(path.energy)))
