"""Paths with a law at every node: one law to the bit, a change of variables, films side by side, enumeration."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tcstudy.contact.certificates import certify
from tcstudy.contact.path.chords import piecewise_linear
from tcstudy.contact.path.follow import Follower, ParametricProblem, PathStatus
from tcstudy.contact.path.proofs import proved_minima
from tcstudy.contact.path.query import lowest, solutions_at, solutions_of
from tcstudy.laws.composed import nodal
from tcstudy.laws.laws import NONE, Laws
from tcstudy.laws.shapes import tresca
from tcstudy.scene.study import Acceptance
from tests.contact import contact_cases as cases
from tests.contact.path.cases import a_solution, all_solutions, follow, random_path_problem, softening_line

SHARED = (cases.slip_weakening(1.0, 0.3, 0.4), tresca(0.7), cases.sawtooth(1.0, 0.3, 1.0, 0.5), cases.spring(0.5), NONE)


@pytest.mark.parametrize("law", [cases.slip_weakening(1.0, 0.2, 0.02), cases.sawtooth(1.0, 0.03, 5.0, 0.5)])
def test_slips_measured_by_a_scale_and_an_origin_of_every_node_change_nothing(law: Laws) -> None:
    """w solves Aw + c b(w) = t l; u = σw + a then solves (A/σσ)(u − a) + c β b((u − a)/σ) = t l/σ with β = 1/σ."""
    m, rng = 30, np.random.default_rng(7)
    plain = replace(softening_line(m), law=law)
    sigma, a = np.exp(rng.normal(size=m)), 0.1 * rng.normal(size=m)
    A = plain.A_tilde / sigma[:, None] / sigma
    laws = nodal([law], np.zeros(m, dtype=int), 1.0 / sigma, sigma, a)
    moved = ParametricProblem(0.5 * (A + A.T), A @ a, plain.l_1 / sigma, plain.c, laws)
    path, other = follow(plain, np.zeros(m), 0.0, 0.0, 2.0), follow(moved, a, 0.0, 0.0, 2.0)
    assert other.end == path.end == PathStatus.RANGE_END
    assert other.pieces == path.pieces > 2 * m
    assert np.array_equal(other.stable, path.stable)
    np.testing.assert_allclose(other.t, path.t, atol=1e-10)
    np.testing.assert_allclose(other.u, path.u * sigma + a, atol=1e-10)


def random_nodal(seed: int, m: int) -> ParametricProblem:
    rng = np.random.default_rng([seed, 29])
    shared = [random_path_problem(rng, m, 4).law, *SHARED]
    beta = np.where(rng.random(m) < 0.2, 0.0, rng.uniform(0.3, 2.0, m))
    law = nodal(shared, rng.integers(0, len(shared), m), beta, rng.uniform(0.5, 2.0, m), 0.1 * rng.normal(size=m))  # type: ignore[arg-type]
    return random_path_problem(rng, m).with_law(law)


def test_every_point_is_a_solution_and_the_stable_ones_are_those_of_enumeration() -> None:
    proved = asked = 0
    for seed in range(12):
        problem = random_nodal(seed, 3)
        start = a_solution(problem, 0.0)
        path = Follower(t_min=-3.0, t_max=3.0, max_pieces=2000).follow(problem, start, 0.0)
        assert path.residual.max() <= 1e-12
        assert path.t[path.start] == 0.0
        assert np.max(np.abs(path.u[path.start] - start)) <= 1e-9 * (1.0 + np.max(np.abs(start)))
        for t, u in zip(path.t, path.u, strict=True):
            assert problem.at(t).inclusion_residual(u, 1e-13) <= 1e-11
        low = lowest(path)
        flags = proved_minima(path, low, problem.at(0.0).lambda_1, Acceptance(None))
        for t in (-1.7, 0.41, 1.3):
            known = all_solutions(problem, t)
            for found in solutions_at(path, t):
                near = [stable for v, stable in known if np.max(np.abs(v - found.v)) <= 1e-8]
                assert found.stable in near
            at = np.flatnonzero((low.begin <= t) & (low.end >= t))
            least = min((problem.at(t).energy(v) for v, _ in known), default=np.nan)
            asked += len(at)
            if len(at) and flags[at[0]]:
                proved += 1
                lowest_found = min(s.energy for s in solutions_at(path, t))
                assert lowest_found == pytest.approx(least, abs=1e-9)
    assert proved > asked / 3


def test_straight_stand_ins_and_newton_steps_take_every_node_to_its_own_law() -> None:
    m = 20
    laws = nodal([cases.exponential_decay(1.0, 0.4, 0.1), tresca(0.6)], np.arange(m) // 12, np.linspace(0.5, 1.5, m))
    assert isinstance(laws, Laws)
    true = softening_line(m).with_law(laws)
    straight = true.with_law(laws.mapped(lambda law: piecewise_linear(law, 1e-2, 2.0)))
    path = follow(straight, np.zeros(m), 0.0, 0.0, 1.4)
    found = solutions_of(laws, path, 1.1)
    assert found
    for solution in found:
        assert solution.residual <= 1e-12
        assert certify(true.at(1.1), solution.v).strict_minimum == solution.stable
