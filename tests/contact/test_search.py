"""The search for less energy: against enumeration, never up, the same every time, and only where it has business."""

import numpy as np
import pytest

from tcstudy.contact import search
from tcstudy.contact.block import Answer
from tcstudy.contact.contact import solve_contact
from tcstudy.contact.problem import ContactProblem
from tcstudy.contact.status import Status
from tcstudy.laws.laws import Laws
from tcstudy.laws.shapes import SHAPES
from tcstudy.scene.study import ESCAPE, Branch
from tests.benchmarks.stability_maps import down_jumps
from tests.contact import contact_cases as cases
from tests.contact import exhaustive


def without(answer: Answer) -> float:
    """The energy that the other starts had led to."""
    return float(np.nanmin(answer.energies[:ESCAPE]))


@pytest.mark.parametrize(("m", "count"), [(2, 80), (3, 80), (4, 60)])
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
    results = [exhaustive.search(seed, 1 + seed % 8) for seed in range(160)]
    assert all(r.solved and not r.contradicted for r in results)
    assert all(r.found for r in results)
    assert sum(r.plain for r in results) < len(results)


def test_a_well_between_two_samples_of_the_law_is_found() -> None:
    """One node on a soft body; the well at 0.377 lies between the last kink and the next sample, at 0.74."""
    points = [(0.25, 0.0), (0.25, 0.7), (0.29, -0.5)]
    law = SHAPES["piecewise-linear"].build(points=points, odd=False, slopes=[0.0, 5.7])
    problem = ContactProblem(np.array([[0.0017]]), np.array([-0.0033]), np.ones(1), law)
    answer = solve_contact(problem)
    assert answer.start == ESCAPE
    assert answer.energy == pytest.approx(exhaustive.least_energy(problem), rel=1e-12)


def test_nodes_that_push_each_other_apart() -> None:
    """The softest mode is perpendicular to the rigid slip."""
    points = [(-0.2, 0.4), (-0.1, -0.5), (0.3, -0.9), (0.4, -1.4), (0.5, 1.0)]
    law = SHAPES["piecewise-linear"].build(points=points, odd=False, slopes=[2.0, 0.3])
    problem = ContactProblem(np.array([[5.0, 4.0], [4.0, 5.0]]), np.full(2, -0.98), np.full(2, 0.675), law)
    assert solve_contact(problem).energy == pytest.approx(exhaustive.least_energy(problem), rel=1e-12)


@pytest.mark.parametrize("smooth", [False, True])
def test_never_higher_and_the_same_every_time(smooth: bool) -> None:
    gains = 0
    for seed in range(24):
        problem = cases.random_problem(np.random.default_rng([seed, 61]), (20, 40)[seed % 2], smooth=smooth)
        answer, again = solve_contact(problem), solve_contact(problem)
        assert answer.status == Status.CONVERGED
        assert cases.independent_residual(problem, answer.v) <= 1e-10
        assert np.array_equal(answer.v, again.v)
        assert np.array_equal(answer.energies, again.energies, equal_nan=True)
        assert answer.energy <= without(answer) + 1e-12 * abs(answer.energy)
        assert answer.start != ESCAPE or answer.energies[ESCAPE] == answer.energy
        gains += answer.start == ESCAPE
    assert gains >= 1


def test_same_answer_in_other_units() -> None:
    for seed in range(8):
        problem = cases.random_problem(np.random.default_rng([seed, 61]), 20, smooth=seed % 2 == 1)
        reference = solve_contact(problem)
        for units in ((1e9, 1, 1), (1, 1e-9, 1), (1e-9, 1e9, 1e9)):
            other = solve_contact(cases.rescaled(problem, *units))
            assert np.max(np.abs(other.v * units[0] - reference.v)) <= 1e-9 * np.max(np.abs(reference.v))


def test_no_business() -> None:
    """Without a fall of b, with ω < λ₁, on another branch, with bundle-newton, without nodes: no search."""
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
    empty = solve_contact(ContactProblem(np.zeros((0, 0)), np.zeros(0), np.zeros(0), cases.sawtooth()))
    assert empty.status == Status.CONVERGED


def test_convexified_start_knows_when_it_is_the_lowest() -> None:
    """Where no node is on a common tangent of the first envelope its solution is the lowest; with teeth some are."""
    A_tilde, c = cases.half_laplacian(30)
    x = np.linspace(0.0, 1.0, 30)

    def lowest(law: Laws) -> bool:
        problem = ContactProblem(A_tilde, c * (1.4 + 0.6 * np.sin(7 * x)), c, law)
        return bool(search.envelope_starts(problem.rows, np.zeros((1, 30)))[1][0])

    assert lowest(cases.slip_weakening(1.0, 0.1, 0.01))
    assert not lowest(down_jumps(0.6, 10))
