"""All branches over an interval against brute force over all cells; loops, ties, limits."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

import tcstudy
from tcstudy.contact.all_solutions import all_solutions
from tcstudy.contact.boxes import Cells, Limits, PolygonProblems
from tcstudy.contact.branch_search import BranchSearch
from tcstudy.contact.curves import SlopeRange, SoftDirection
from tcstudy.contact.path.follow import Follower
from tcstudy.contact.path.problem import ParametricProblem, PathStatus
from tcstudy.contact.path.query import all_branches
from tests.contact.contact_cases import spring
from tests.contact.random_polygons import by_brute_force, random_problem


def parametric(seed: int, m: int) -> tuple[ParametricProblem, float, np.ndarray]:
    """(problem, λ₁, ends of all segments (S, 2) for t from 0 to 1)."""
    problem, per_t = random_problem(seed, m)
    _, rows, _ = by_brute_force(problem, per_t)
    along = ParametricProblem(problem.A_tilde, problem.l_tilde, per_t, problem.c, problem.law)
    return along, problem.lambda_1, rows


@pytest.mark.parametrize(("m", "seeds"), [(1, 10), (2, 25), (3, 10)])
def test_random_problems_have_the_segments_that_brute_force_finds(m: int, seeds: int) -> None:
    loops = 0
    for seed in range(seeds):
        problem, lambda_1, rows = parametric(seed, m)
        found = all_branches(problem, 0.0, 1.0, lambda_1)
        assert found.complete, found.reason
        ends = np.array([sorted(pair) for branch in found.branches for pair in pairwise(branch.t)])
        np.testing.assert_allclose(np.sort(ends, axis=0), np.sort(rows, axis=0), atol=1e-8)
        for branch in found.branches:
            loop = branch.end == PathStatus.CLOSED_LOOP
            assert loop or {0.0, 1.0} >= {branch.t[0], branch.t[-1]}
            assert branch.residual.max() <= 1e-11
            loops += loop
        for t in np.random.default_rng(seed).uniform(0.0, 1.0, 2):
            at = all_solutions(problem.at(t))
            v, stable = zip(*found.solutions(t), strict=True)
            assert (len(v), sum(stable)) == (len(at), np.count_nonzero(at.stable))
            np.testing.assert_allclose(np.sort(v, axis=0), np.sort(at.v, axis=0), atol=1e-9)
    assert m != 2 or loops


@pytest.mark.parametrize(("m", "seeds"), [(2, 20), (3, 10)])
def test_intervals_searched_by_soft_modes_have_the_segments_of_brute_force(
    m: int, seeds: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Both kinds of curve end boxes: over s, and past folds over an amplitude."""
    monkeypatch.setattr("tcstudy.contact.all_solutions.FIRST_WORK", 1.0)
    monkeypatch.setattr("tcstudy.contact.all_solutions.MIN_FIRST_BOXES", 1)
    curves = {"_over_load": 0, "_past_folds": 0}
    for name in curves:
        method = getattr(BranchSearch, name)

        def counted(self, *arguments, name=name, method=method):  # type: ignore[no-untyped-def]
            curves[name] += 1
            return method(self, *arguments)

        monkeypatch.setattr(BranchSearch, name, counted)
    for seed in range(seeds):
        problem, per_t = random_problem(seed, m, has_jumps=False)
        _, rows, _ = by_brute_force(problem, per_t)
        along = ParametricProblem(problem.A_tilde, problem.l_tilde, per_t, problem.c, problem.law)
        found = all_branches(along, 0.0, 1.0, problem.lambda_1)
        assert found.complete, found.reason
        ends = np.array([sorted(pair) for branch in found.branches for pair in pairwise(branch.t)])
        np.testing.assert_allclose(np.sort(ends, axis=0), np.sort(rows, axis=0), atol=1e-8)
    assert min(curves.values()) >= seeds // 2


def test_kappa_bounds_the_rate_of_s_for_all_slopes_of_a_part() -> None:
    """κ ≤ |NᵀĤ(q)⁻¹l̃₁| at random slopes, and is nearly it where there is one slope."""
    tight = 0
    for seed in range(20):
        problem, per_s = random_problem(seed, 3, has_jumps=False)
        polygons = PolygonProblems(
            problem.A_tilde, problem.c, problem.law, problem.l_tilde[None], 1.0, per_s
        )
        search = BranchSearch(polygons.single(0))
        root_c = np.sqrt(problem.c)
        rng = np.random.default_rng(seed)
        N, low = rng.normal(size=3), rng.uniform(-0.2, 0.5, 3)
        for width in (0.0, 0.1, 1.0):
            slopes = SlopeRange(low[None], low[None] + width, np.zeros((1, 3), dtype=bool))
            gap = float(search.parts.inertia(slopes, SoftDirection(N, 0.7, 0.0)).gap[0])
            if not gap > 0.0:
                continue
            kappa = search.kappa(slopes, SoftDirection(N, 0.7, gap))
            stiff = problem.A_tilde + 0.7 * np.outer(N, N)
            for q in low + width * np.append(rng.random((50, 3)), [np.zeros(3), np.ones(3)], 0):
                Y = np.linalg.inv(stiff / np.outer(root_c, root_c) + np.diag(q))
                rate = abs(float((N / root_c) @ Y @ (per_s / root_c)))
                assert rate >= kappa * (1.0 - 1e-12)
            if width == 0.0:
                assert kappa == pytest.approx(rate, rel=1e-5)
            tight += kappa > 0.5 * rate
    assert tight > 10


def test_equal_nodes_are_undecided_and_a_small_change_decides_them() -> None:
    problem, _, _ = parametric(1, 3)
    A, law = np.array([[2.0, -0.5], [-0.5, 2.0]]), problem.law.single(0)
    equal = replace(
        problem, A_tilde=A, c=np.ones(2), l_0=np.zeros(2), l_1=np.ones(2) * 3.0, law=law
    )
    said = all_branches(equal, 0.1, 1.0, 1.5)
    assert not said.complete
    assert "within rounding" in said.reason
    assert all_branches(replace(equal, l_1=np.array([3.0, 3.0 + 1e-6])), 0.1, 1.0, 1.5).complete


def test_what_a_limit_leaves_is_named_and_followed_from_the_values_asked_for() -> None:
    """Branches that are known in part become whole; of each value it is known whether its list is
    all."""
    at, more = (0.3, 0.61, 0.7), 0
    for seed in range(12):
        problem, lambda_1, _ = parametric(seed, 3)
        part = all_branches(problem, 0.0, 1.0, lambda_1, Limits(boxes=2), at)
        for branch in part.branches:
            assert branch.end == PathStatus.CLOSED_LOOP or {0.0, 1.0} >= {branch.t[0], branch.t[-1]}
        for t, listed in part.listed.items():
            every, count = len(all_solutions(problem.at(t))), len(part.solutions(t)) - len(listed)
            assert 1 <= len(listed) <= count <= every
            assert not listed.complete or len(listed) == every
            more += count > len(listed)
    assert more
    problem, lambda_1, _ = parametric(2, 3)
    found = all_branches(problem, 0.0, 1.0, lambda_1, Limits(boxes=1))
    assert (
        found.reason
        == "the limit of boxes or time was met where the parameter is 0.25 to 0.3125, 0.6875 to 0.75"
    )
    beside = all_branches(problem, 0.2, 0.9, lambda_1, at=(0.5, 1.4))
    assert (beside.complete, beside.complete_at(0.5), beside.complete_at(1.4)) == (True, True, True)
    np.testing.assert_array_equal(beside.listed[1.4].v, all_solutions(problem.at(1.4)).v)


def test_a_branch_that_is_lost_is_missed(monkeypatch: pytest.MonkeyPatch) -> None:
    """Growth makes the number of solutions odd."""
    problem = ParametricProblem(np.eye(1), np.zeros(1), np.ones(1), np.ones(1), spring())
    assert all_branches(problem, 0.0, 1.0, 1.0).complete
    search = PolygonProblems.search

    def forgetful(self: PolygonProblems, limits: Limits) -> Cells:
        cells = search(self, limits)
        return cells._replace(sides=cells.sides[:0])

    monkeypatch.setattr(PolygonProblems, "search", forgetful)
    assert all_branches(problem, 0.0, 1.0, 1.0).reason.startswith(
        "the number of solutions, 0, is even"
    )


@pytest.mark.parametrize("roundings", [1, 3, 8])
def test_pieces_a_few_roundings_wide_are_followed_like_jumps(roundings: int) -> None:
    for seed in range(6):
        random = np.random.default_rng([seed, roundings])
        m = 1 + seed % 3
        root = random.normal(size=(m, m))
        A = root @ root.T + np.eye(m)
        points, jumps = [(0.0, 1.5)], [(0.0, 1.5)]
        for s in (0.3, 1.1):
            below, above, end = random.uniform(0.0, 1.0), random.uniform(1.0, 3.0), s
            for _ in range(roundings):
                end = np.nextafter(end, 9.0)
            points += [(s, below), (end, above)]
            jumps += [(s, below), (s, above)]
        per_t = A @ np.full(m, 1.1) + random.uniform(1.0, 2.0, m)
        narrow, upright = (
            ParametricProblem(A, np.zeros(m), per_t, np.ones(m), tcstudy.law(points=corners))
            for corners in (points, jumps)
        )
        lambda_1 = narrow.at(1.0).lambda_1
        path = Follower(0.0, 2.0).follow(narrow, np.zeros(m), 0.0)
        assert path.end == PathStatus.RANGE_END
        branches = all_branches(narrow, 0.0, 2.0, lambda_1)
        expected = all_branches(upright, 0.0, 2.0, lambda_1)
        assert branches.complete, branches.reason
        assert len(branches.branches) == len(expected.branches)
        for branch, other in zip(branches.branches, expected.branches, strict=True):
            np.testing.assert_allclose(branch.t, other.t, atol=1e-9)
            np.testing.assert_array_equal(branch.stable, other.stable)
