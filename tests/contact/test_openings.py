"""Problems with openings: rays, bodies that contact alone holds, and what is proved of them."""

import numpy as np
import pytest
from numpy.typing import NDArray

import tcstudy
from tcstudy.contact.certificates import solution_boxes
from tcstudy.contact.loose_body import LooseBody
from tcstudy.contact.path.problem import PathStatus
from tcstudy.contact.path.query import folds, lowest
from tcstudy.contact.problem import Status
from tcstudy.contact.solution import Linearised
from tcstudy.contact.solve import Answer
from tcstudy.errors import ProblemError
from tests.contact.openings import every_solution, random_case

Array = NDArray[np.float64]
SOFTENING = tcstudy.law(points=[(0.0, 1.0), (1.0, 0.0)])
OPENING = tcstudy.opening(SOFTENING)


@pytest.mark.parametrize("seed", range(60))
def test_solutions_of_definite_problems_are_those_of_all_pieces(seed: int) -> None:
    case = random_case(seed)
    problem = tcstudy.ContactProblem(case.A, case.load, case.c, case.laws)
    solutions = every_solution(*case)
    energies = [float(problem.energy(v)) for v in solutions]
    equilibria = tcstudy.all_solutions(problem)
    assert equilibria.complete
    assert len(equilibria) == len(solutions)
    np.testing.assert_allclose(equilibria.energy, np.sort(energies), atol=1e-9)
    low, high = solution_boxes(problem.rows)
    for v in solutions:
        assert np.all((low[0] - 1e-12 <= v) & (v <= high[0] + 1e-12))
    answer = tcstudy.solve(problem)
    assert answer.status == Status.CONVERGED
    certificate = tcstudy.certify(problem, answer)
    assert len(solutions) == 1 or not certificate.unique
    is_least = bool(answer.energy <= min(energies) + 1e-9)
    assert is_least or not certificate.global_minimum


@pytest.mark.parametrize("seed", range(40))
def test_solutions_of_loose_bodies_are_those_of_all_pieces(seed: int) -> None:
    case = random_case(seed, motions=1 + seed % 2)
    problem = tcstudy.ContactProblem(case.A, case.load, case.c, case.laws)
    solutions = every_solution(*case)
    motions = LooseBody(problem)
    motion = motions.unresisted()
    answer = tcstudy.solve(problem)
    assert problem.lambda_1 == 0.0
    certificate = tcstudy.certify(problem, answer)
    assert not certificate.convex
    assert len(solutions) == 1 or not certificate.unique
    reach = motions.reach(np.zeros(problem.m))
    equilibria = tcstudy.all_solutions(problem)
    if motion is not None:
        assert not equilibria.complete
        assert np.max(np.abs(case.A @ motion.r)) < 1e-12
        assert solutions or answer.status == Status.UNBOUNDED
        return
    assert all(np.all(np.abs(v) <= reach) for v in solutions)
    assert answer.status == Status.CONVERGED
    assert equilibria.complete
    assert len(equilibria) == len(solutions)


def test_the_size_of_a_pressure_is_not_the_scale_of_the_law() -> None:
    """3 v + 1 − v = 1.6 has v = 0.3; a jump of 10¹² in place of the ray takes v = 0 for it."""
    unit = np.ones(1)
    problem = tcstudy.ContactProblem(3.0 * unit[None], 1.6 * unit, unit, OPENING)
    answer = tcstudy.solve(problem)
    assert answer.v[0] == pytest.approx(0.3, abs=1e-14)
    assert problem.inclusion_residual(np.zeros(1)) == pytest.approx(0.6)
    assert problem.inclusion_residual(np.array([-0.5])) == np.inf
    assert len(tcstudy.all_solutions(problem)) == 1
    pressed = tcstudy.ContactProblem(3.0 * unit[None], -2e6 * unit, unit, OPENING)
    answer = tcstudy.solve(pressed)
    assert answer.v[0] == 0.0
    assert answer.xi[0] == -2e6
    assert pressed.energy(np.array([-1e-9])) == np.inf


def test_contact_without_adhesion_has_the_scale_of_its_loads() -> None:
    A = np.array([[2.0, -1.0], [-1.0, 2.0]])
    load = np.array([3.0, -9.0])
    problem = tcstudy.ContactProblem(A, load, np.full(2, 0.5), tcstudy.opening())
    answer = tcstudy.solve(problem)
    np.testing.assert_allclose(answer.v, [1.5, 0.0])
    assert problem.scale(answer.xi) == 18.0
    assert tcstudy.certify(problem, answer).unique


COLUMN = np.array([[0.48101478, 0.01898522], [0.01898522, 0.48101478]])
"""Ã of a column of one cell, ν = 0, E/H = 1: 1 for both nodes together."""
COHESIVE = tcstudy.opening(tcstudy.law("bilinear", tau=1.0, s0=0.1, sf=0.3))


def column(d: float) -> tcstudy.ContactProblem:
    """Return the column lifted by d on its cohesive base."""
    return tcstudy.ContactProblem(COLUMN, np.full(2, 0.5 * d), np.full(2, 0.5), COHESIVE)


def test_a_column_on_a_cohesive_base() -> None:
    """d − s = b(s): s = 7/110, 0.2 and 0.7 at d = 0.7, folds at 1.1 and 0.3, Maxwell √0.33."""
    equilibria = tcstudy.all_solutions(column(0.7))
    assert equilibria.complete
    assert len(equilibria) == 9
    assert np.sum(equilibria.stable) == 4
    uniform = [v[0] for v in equilibria.v if np.ptp(v) < 1e-12]
    np.testing.assert_allclose(np.sort(uniform), [7.0 / 110.0, 0.2, 0.7], rtol=1e-12)
    path = tcstudy.follow(column(0.0), [0.5, 0.5], np.zeros(2), t_min=-2.0, t_max=2.0)
    np.testing.assert_allclose(path.t[folds(path, 0.01)], [1.1, 0.3])
    assert path.traction[0, 0] == pytest.approx(-2.0)
    assert lowest(path).end[-2] == pytest.approx(np.sqrt(0.33), rel=1e-12)


def test_a_beam_on_two_supports_that_cannot_pull() -> None:
    """A rigid body of weight 2 with a load beside its middle: resting, lifting off, flying off."""
    A = np.array([[1.0, -2.0, 1.0], [-2.0, 4.0, -2.0], [1.0, -2.0, 1.0]])

    def answer(*load: float) -> Answer:
        problem = tcstudy.ContactProblem(A, np.array(load), np.ones(3), tcstudy.opening())
        return tcstudy.solve(problem)

    resting = answer(-0.5, -1.0, -0.5)
    assert resting.status == Status.CONVERGED
    np.testing.assert_allclose(resting.v, 0.0, atol=1e-12)
    assert resting.xi.sum() == pytest.approx(-2.0)
    lifted = answer(-0.5, -1.0, 0.5)
    assert lifted.status == Status.CONVERGED
    assert lifted.v[2] == pytest.approx(0.5)
    away = answer(0.5, -1.0, 1.0)
    assert away.status == Status.UNBOUNDED
    assert "flies off" in away.reason
    tilted = answer(-0.5, -1.0, 1.2)
    assert tilted.status == Status.UNBOUNDED


def test_a_bond_holds_a_loose_body_up_to_its_strength() -> None:
    """k = 20 Pa/m up to 2 Pa; a load of 1.9 N/m is carried, 2.1 N/m is not, which its status says."""
    bond = tcstudy.law("bilinear", tau=2.0, s0=0.1, sf=0.5)
    A = np.array([[1.0, -1.0], [-1.0, 1.0]])
    half = np.full(2, 0.5)
    for law in (bond, tcstudy.opening(bond)):
        carried = tcstudy.solve(tcstudy.ContactProblem(A, 1.9 * half, half, law))
        assert carried.status == Status.CONVERGED
        np.testing.assert_allclose(carried.v, 0.095, rtol=1e-9)
        broken = tcstudy.solve(tcstudy.ContactProblem(A, 2.1 * half, half, law))
        assert broken.status == Status.UNBOUNDED
    assert "flies off" in broken.reason


def test_derivatives_with_rays_are_those_of_differences() -> None:
    A = np.array([[3.0, -1.0, 0.4], [-1.0, 2.0, -0.5], [0.4, -0.5, 2.5]])
    load = np.array([1.2, -0.8, 0.9])

    def solution(factor: float) -> Array:
        problem = tcstudy.ContactProblem(A, factor * load, np.ones(3), COHESIVE)
        return tcstudy.solve(problem, branch="from-zero").v

    problem = tcstudy.ContactProblem(A, load, np.ones(3), COHESIVE)
    v = solution(1.0)
    assert v[1] == 0.0
    derivative = Linearised.at(problem, v).step(load)
    h = 1e-5
    np.testing.assert_allclose(
        derivative, (solution(1.0 + h) - solution(1.0 - h)) / (2.0 * h), atol=1e-8
    )


def test_the_door_refuses_friction_whose_pressure_it_does_not_know() -> None:
    with pytest.raises(ProblemError, match="times the pressure of another row"):
        tcstudy.law("coulomb", mu=0.3)


def test_an_opening_is_not_opened_twice() -> None:
    with pytest.raises(ProblemError, match="is an opening already; give it the law for s > 0"):
        tcstudy.opening(OPENING, closing=8.0)


def test_a_body_whose_bond_carries_it_flies_off_only_once_that_has_failed() -> None:
    """Two nodes that move as one, pulled by 2 of a strength of 2 × 3; then free of any bond."""
    A = np.array([[1.0, -1.0], [-1.0, 1.0]])
    bond = tcstudy.opening(tcstudy.law("bilinear", tau=3.0, s0=0.1, sf=1.0))
    pull, unit = np.array([1.0, 1.5]), np.ones(2)
    held = tcstudy.ContactProblem(A, pull, unit, bond)
    assert tcstudy.solve(held).status == Status.CONVERGED
    when = "onto its foundation once its bond has failed: it flies off (rows 0, 1"
    assert when in tcstudy.all_solutions(held).reason
    bare = tcstudy.ContactProblem(A, pull, unit, tcstudy.opening())
    assert "onto its foundation: it flies off (rows 0, 1" in tcstudy.solve(bare).reason


def test_what_closes_an_opening_must_be_a_stiffness() -> None:
    with pytest.raises(ProblemError, match="closing"):
        tcstudy.opening(SOFTENING, closing=-1.0)


def lifted_strip(m: int) -> tuple[Array, Array, Array]:
    """(Ã, load per N/m, c) of a beam on m supports, clamped at its left end, pulled up at its right.

    Bending alone, in units of its support distance and EI.
    """
    second = np.zeros((m, m + 1))
    for i in range(m):
        for j, weight in zip((i - 1, i, i + 1), (1.0, -2.0, 1.0), strict=True):
            if 0 <= j <= m:
                second[i, j] += weight
    second = np.vstack([np.eye(1, m + 1) * 2.0, second])
    second = second[:, :m]
    A = 20.0 * second.T @ second
    return A, np.eye(m)[-1], np.full(m, 1.0)


def test_a_peeled_strip_has_a_path_through_its_folds_and_all_its_equilibria() -> None:
    A, pull, c = lifted_strip(8)
    bond = tcstudy.opening(tcstudy.law("bilinear", tau=1.0, s0=0.02, sf=0.1))
    unloaded = tcstudy.ContactProblem(A, 0.0 * pull, c, bond)
    path = tcstudy.follow(unloaded, pull, np.zeros(8), t_min=-1e-9, t_max=1.5, direction="forward")
    assert path.residual.max() < 1e-10
    assert path.u.min() >= 0.0
    problem = tcstudy.ContactProblem(A, 0.7 * pull, c, bond)
    equilibria = tcstudy.all_solutions(problem)
    assert equilibria.complete
    crossings = np.count_nonzero(np.diff(np.sign(path.t - 0.7)))
    assert len(equilibria) >= crossings >= 1
    answer = tcstudy.solve(problem)
    assert answer.energy == pytest.approx(equilibria.energy[0], abs=1e-12)


@pytest.mark.parametrize("seed", range(12))
def test_the_bundle_method_finds_solutions_with_rays(seed: int) -> None:
    case = random_case(seed)
    problem = tcstudy.ContactProblem(case.A, case.load, case.c, case.laws)
    answer = tcstudy.solve(problem, "bundle-newton")
    assert answer.status == Status.CONVERGED
    distances = [np.max(np.abs(answer.v - v)) for v in every_solution(*case)]
    assert min(distances) < 1e-7


def test_a_path_of_a_loose_body_ends_where_it_flies_off() -> None:
    """A rigid beam on three supports: its right end lifts at 0.5, the load carries it off at 1."""
    A = np.array([[1.0, -2.0, 1.0], [-2.0, 4.0, -2.0], [1.0, -2.0, 1.0]])
    weight = np.array([-0.5, -1.0, -0.5])
    problem = tcstudy.ContactProblem(A, weight, np.ones(3), tcstudy.opening())
    pull = np.array([0.0, 0.0, 1.0])
    path = tcstudy.follow(problem, pull, tcstudy.solve(problem), t_min=-3.0, t_max=3.0)
    assert path.end == PathStatus.UNBOUNDED
    np.testing.assert_allclose(path.t[[0, -2, -1]], [-3.0, 0.5, 1.0])
    np.testing.assert_allclose(path.u[-1], [0.0, 0.0, 0.5], atol=1e-14)


def test_a_rigid_motion_that_rounding_alone_resists_is_no_solution() -> None:
    """λ of the motion is 1e-15 of the largest: ξ = 0 in balance where v is a million times larger."""
    A, _, c = lifted_strip(8)
    modes = np.linalg.qr(np.column_stack([np.ones(8), np.eye(8)[:, 1:]]))[0]
    stiffness = modes[:, 1:] @ modes[:, 1:].T @ A @ modes[:, 1:] @ modes[:, 1:].T
    A = stiffness + 1e-15 * np.max(A) * np.ones((8, 8))
    for push, status in ((-1e-3, Status.CONVERGED), (1e-3, Status.UNBOUNDED)):
        load = np.linspace(-1.0, 1.0, 8) + push
        problem = tcstudy.ContactProblem(0.5 * (A + A.T), load, c, tcstudy.opening())
        assert tcstudy.solve(problem).status == status
