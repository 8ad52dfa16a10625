"""The search for less energy: against enumeration, the same every time, and only where it has business."""

import numpy as np
import pytest

from tcstudy.contact import search
from tcstudy.contact.problem import ContactProblem, Status
from tcstudy.contact.solve import Answer, solve_contact
from tcstudy.laws.laws import Laws
from tcstudy.scene.study import ESCAPE, Branch
from tests.benchmarks.cases import down_jumps
from tests.contact import contact_cases as cases
from tests.contact import exhaustive


def without(answer: Answer) -> float:
    """The energy that the other starts had led to."""
    return float(np.nanmin(answer.energies[:ESCAPE]))


@pytest.mark.parametrize(("m", "count"), [(2, 60), (4, 50)])
def test_the_least_energy_of_all_is_found(m: int, count: int) -> None:
    """Against every choice of pieces; nothing is passed over as global that is not."""
    before = after = ran = 0
    for seed in range(count):
        problem = exhaustive.small_problem(seed, m)
        least = exhaustive.least_energy(problem)
        answer = solve_contact(problem)
        slack = 1e-10 * (abs(least) + float(problem.c @ problem.law.j(answer.v)))
        assert answer.energy >= least - slack
        before += without(answer) <= least + slack
        after += answer.energy <= least + slack
        ran += np.isfinite(answer.energies[ESCAPE])
    assert after == count
    assert before < count
    assert ran < 0.3 * count


def test_laws_that_push_hide_no_well() -> None:
    """Any law, odd or not, opposing the slip or pushing it on: the share of `tests.benchmarks.reliability` for CI."""
    results = [exhaustive.search(seed, 1 + seed % 8) for seed in range(72)]
    assert all(r.solved and r.found and not r.contradicted for r in results)
    assert sum(r.plain for r in results) < len(results)


def test_no_node_moves_from_a_point_that_is_no_minimum() -> None:
    A_tilde, c = cases.half_laplacian(5)
    law, slip = cases.slip_weakening(1.0, 0.2, 0.2), np.full(5, 0.1)
    problem = ContactProblem(A_tilde, A_tilde @ slip + c * law.b(slip), c, law)
    assert len(search.move_starts(problem.rows, slip[None])[0]) == 0


def test_one_node_leaves_a_well_along_an_exponential() -> None:
    """b = 0.5 + 0.5 e^(−10 s) falls fastest where the node sticks; b + s = 0.95 again at 0.4441."""
    law = cases.exponential_decay(1.0, 0.5, 0.1)
    for sign in (1.0, -1.0):
        rows = ContactProblem(np.eye(1), np.array([sign * 0.95]), np.ones(1), law).rows
        [[s]] = search.move_starts(rows, np.zeros((1, 1)))[0]
        assert 0.4 < sign * s < 0.5
        assert 0.5 + 0.5 * np.exp(-10.0 * abs(s)) + abs(s) == pytest.approx(0.95, abs=1e-14)


@pytest.mark.parametrize("smooth", [False, True])
def test_the_same_every_time_and_in_other_units(smooth: bool) -> None:
    gains = 0
    for seed in range(12):
        problem = cases.random_problem(np.random.default_rng([seed, 61]), (20, 40)[seed % 2], smooth=smooth)
        answer, again = solve_contact(problem), solve_contact(problem)
        assert answer.status == Status.CONVERGED
        assert cases.independent_residual(problem, answer.v) <= 1e-10
        assert np.array_equal(answer.v, again.v)
        assert np.array_equal(answer.energies, again.energies, equal_nan=True)
        assert answer.start != ESCAPE or answer.energies[ESCAPE] == answer.energy
        gains += answer.start == ESCAPE
        if seed % 2 == 0:
            units = ((1e9, 1, 1), (1, 1e-9, 1), (1e-9, 1e9, 1e9))[seed // 2 % 3]
            other = solve_contact(cases.rescaled(problem, *units))
            assert np.max(np.abs(other.v * units[0] - answer.v)) <= 1e-9 * np.max(np.abs(answer.v))
    assert gains >= 1


def test_no_business() -> None:
    """Without a fall of b, with ω < λ₁, on another branch, with bundle-newton: no search."""
    A_tilde, c = cases.half_laplacian(20)
    load = c * np.linspace(0.4, 1.8, 20)
    for law in (cases.spring(), cases.slip_weakening(1.0, 1.0, 0.1), cases.slip_weakening(1.0, 0.5, 0.2)):
        answer = solve_contact(ContactProblem(A_tilde, load, c, law))
        assert answer.status == Status.CONVERGED
        assert np.isnan(answer.energies[ESCAPE])
    many_wells = ContactProblem(A_tilde, load, c, down_jumps(0.6, 10))
    assert solve_contact(many_wells).start == ESCAPE
    branches: tuple[Branch, ...] = ("from-zero", "continued")
    assert all(np.isnan(solve_contact(many_wells, branch=branch).energies[ESCAPE]) for branch in branches)
    assert np.isnan(solve_contact(many_wells, "bundle-newton").energies[ESCAPE])


def test_convexified_start_knows_when_it_is_the_lowest() -> None:
    """Where no node is on a common tangent of the first envelope its solution is the lowest; with teeth some are."""
    A_tilde, c = cases.half_laplacian(30)
    x = np.linspace(0.0, 1.0, 30)

    def lowest(law: Laws) -> bool:
        problem = ContactProblem(A_tilde, c * (1.4 + 0.6 * np.sin(7 * x)), c, law)
        return bool(search.envelope_starts(problem.rows, np.zeros((1, 30)))[1][0])

    assert lowest(cases.slip_weakening(1.0, 0.1, 0.01))
    assert not lowest(down_jumps(0.6, 10))
