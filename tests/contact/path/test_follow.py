"""path: closed forms, exhaustive enumeration, stability, ends, accuracy along whole paths, other units."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tcstudy.contact.path.basis_inverse import CAPACITY, BasisInverse
from tcstudy.contact.path.follow import Follower, ParametricProblem, PathStatus
from tcstudy.contact.path.start import NoSolutionError
from tests.contact import contact_cases as cases
from tests.contact.path.cases import a_solution, follow, softening_line


def test_residual_at_every_vertex_of_a_path_with_many_folds() -> None:
    m = 400
    problem = softening_line(m, 0.02)
    path = Follower(t_min=0.0, t_max=3.0).follow(problem, np.zeros(m), 0.0, "forward")
    assert path.pieces > 2 * m
    assert len(path.folds) > 100
    assert path.residual.max() <= 1e-11
    worst = max(problem.at(t).inclusion_residual(u, 1e-13) for t, u in zip(path.t, path.u, strict=True))
    assert worst <= 1e-11
    assert path.end == PathStatus.RANGE_END


@pytest.mark.parametrize("error", [1e-10, 1e-6])
def test_lost_accuracy_is_noticed_and_repaired(error: float, monkeypatch: pytest.MonkeyPatch) -> None:
    """Every matrix product is spoilt by a relative error; the residuals stay where they were and so does the path."""
    problem = softening_line(100, 0.01)
    exact = Follower(t_min=0.0, t_max=3.0).follow(problem, np.zeros(100), 0.0, "forward")
    room, rng = BasisInverse._room, np.random.default_rng(0)

    def spoilt(self: BasisInverse) -> int:
        full, at = self.size == CAPACITY, room(self)
        if full:
            self.T *= 1.0 + error * rng.normal(size=self.T.shape)
        return at

    monkeypatch.setattr(BasisInverse, "_room", spoilt)
    path = Follower(t_min=0.0, t_max=3.0).follow(problem, np.zeros(100), 0.0, "forward")
    assert path.end == PathStatus.RANGE_END
    assert path.residual.max() <= 1e-11
    assert path.pieces == exact.pieces
    assert np.max(np.abs(path.u - exact.u)) <= 1e-9


@pytest.mark.parametrize("units", [(1e9, 1e-9, 1.0), (1e-9, 1e9, 1e3), (1.0, 1e9, 1e-9)])
def test_other_units_give_the_same_path(units: tuple[float, float, float]) -> None:
    s_unit, b_unit, x_unit = units
    problem = softening_line(40, 0.02)
    path = follow(problem, np.zeros(40), 0.0, -3.0, 3.0)
    scaled = cases.rescaled(problem.at(1.0), s_unit, b_unit, x_unit)
    t_unit = 1e7
    other = ParametricProblem(scaled.A_tilde, np.zeros(40), scaled.l_tilde * t_unit, scaled.c, scaled.law)
    again = follow(other, np.zeros(40), 0.0, -3.0 / t_unit, 3.0 / t_unit)
    assert again.pieces == path.pieces
    assert again.t * t_unit == pytest.approx(path.t, rel=1e-9, abs=1e-9)
    assert np.max(np.abs(again.u * s_unit - path.u)) <= 1e-9
    assert np.array_equal(again.stable, path.stable)
    assert again.residual.max() <= 1e-11


def test_reasons_for_the_end() -> None:
    problem = softening_line(20, 0.02)
    zero = np.zeros(20)
    assert Follower(max_pieces=5).follow(problem, zero, 0.0).end == PathStatus.PIECE_LIMIT
    assert Follower(max_pieces=5).follow(problem, zero, 0.0).pieces == 10
    free = follow(problem, zero, 0.0)
    assert free.begin == free.end == PathStatus.UNBOUNDED
    branch = Follower(stable_only=True).follow(problem, zero, 0.0, "forward")
    assert branch.end == PathStatus.UNSTABLE
    assert branch.stable.all()
    assert branch.begin == PathStatus.START
    hopeless = Follower(tolerance=1e-20).follow(problem, zero, 0.0, "forward")
    assert hopeless.end == PathStatus.LOST_ACCURACY
    assert "tolerance" in hopeless.end.reason
    assert len(hopeless.t) == len(hopeless.residual) == hopeless.pieces + 1


def test_a_closed_loop_is_recognised() -> None:
    """Seeds whose start lies on an isolated loop: the path returns to its start exactly, from either side."""
    loops = 0
    for seed in (249, 386):
        rng = np.random.default_rng(seed)
        p = cases.random_problem(rng, int(rng.integers(1, 4)), max_kinks=6)
        l_0 = rng.normal(size=p.m) * p.l_tilde * 0.3
        problem = ParametricProblem(p.A_tilde, l_0, p.l_tilde, p.c, p.law)
        v = a_solution(problem, 0.0)
        path = follow(problem, v, 0.0, -3.0, 3.0)
        if path.end == PathStatus.CLOSED_LOOP:
            loops += 1
            assert path.begin == PathStatus.CLOSED_LOOP
            assert path.t[0] == path.t[-1]
            assert np.max(np.abs(path.u[0] - path.u[-1])) <= 1e-12
            assert len(path.folds) >= 2
            backward = Follower(t_min=-3.0, t_max=3.0).follow(problem, v, 0.0, "backward")
            assert backward.pieces == path.pieces
    assert loops == 2


def test_bad_input_is_named() -> None:
    problem = softening_line(5)
    with pytest.raises(NoSolutionError, match="no solution at t = 3"):
        follow(problem, np.zeros(5), 3.0)
    with pytest.raises(ValueError, match="outside the range"):
        follow(problem, np.zeros(5), 3.0, 0.0, 1.0)
    with pytest.raises(ValueError, match="piecewise linear"):
        follow(problem.with_law(cases.exponential_decay()), np.zeros(5), 0.0)
    with pytest.raises(ValueError, match="not positive definite"):
        follow(replace(problem, A_tilde=-problem.A_tilde), np.zeros(5), 0.0)
    with pytest.raises(ValueError, match="l_1 is zero"):
        follow(replace(problem, l_1=0 * problem.l_1), np.zeros(5), 0.0)


def test_a_law_without_kinks_and_progress() -> None:
    calls: list[tuple[int, float]] = []
    problem = softening_line(6).with_law(cases.spring(2.0))
    path = Follower(t_min=-1.0, t_max=1.0).follow(problem, np.zeros(6), 0.0, progress=lambda n, t: calls.append((n, t)))
    assert path.pieces == len(calls) == 2
    exact = np.linalg.solve(problem.A_tilde + 2.0 * np.diag(problem.c), problem.l_1)
    assert path.u[-1] == pytest.approx(exact, rel=1e-12)
