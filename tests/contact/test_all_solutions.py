"""All solutions of a problem against brute force over all pieces; limits, ties, laws of rows and
exponential laws."""

import numpy as np
import pytest

import tcstudy
from tcstudy.contact.all_solutions import Limits, PolygonProblems, all_solutions
from tcstudy.contact.certificates import certify
from tcstudy.contact.problem import ContactProblem
from tests.contact.contact_cases import half_laplacian
from tests.contact.random_polygons import NEAR, by_brute_force, random_problem

SAW = tcstudy.law(points=[(0, 4), (1, 1), (1, 4), (2, 1), (2, 4), (3, 1)])


def saw_tooth(load: float, m: int = 8) -> ContactProblem:
    """A bar-like body on a saw-tooth film with many equilibria."""
    A, c = half_laplacian(m, 0.25)
    ramp = load * c * np.linspace(0.4, 1.0, m)
    return ContactProblem(A, ramp, c, SAW)


def sorted_rows(v: np.ndarray) -> np.ndarray:
    return v[np.lexsort(v.round(9).T)]


@pytest.mark.parametrize("m", [1, 2, 3])
def test_random_problems_have_the_solutions_that_brute_force_finds(m: int) -> None:
    """M-matrices and others, laws by node, jumps both ways."""
    counts = []
    for seed in range(25):
        problem, _ = random_problem(seed, m)
        v, _, nearest = by_brute_force(problem)
        found = all_solutions(problem)
        assert nearest > NEAR
        assert found.complete, found.reason
        np.testing.assert_allclose(sorted_rows(found.v), sorted_rows(v), atol=1e-8)
        counts.append(len(found))
        assert np.all(np.diff(found.energy) >= 0.0)
        for v, energy, stable in zip(found.v, found.energy, found.stable, strict=True):
            assert problem.inclusion_residual(v) < 1e-10
            assert energy == pytest.approx(problem.energy(v), abs=1e-12)
            assert stable == certify(problem, v).strict_minimum
    assert max(counts) >= 3
    assert all(count % 2 for count in counts)


@pytest.mark.parametrize(
    ("limits", "reason"), [(Limits(boxes=2), "2 boxes"), (Limits(seconds=0.0), "0 seconds")]
)
def test_a_limit_ends_in_a_list_that_claims_nothing(limits: Limits, reason: str) -> None:
    problem = saw_tooth(6.0)
    assert len(all_solutions(problem)) > 3
    found = all_solutions(problem, limits)
    assert not found.complete
    assert reason in found.reason


def test_a_solution_on_a_kink_is_undecided_and_never_counted() -> None:
    """A load that puts a node on a bend of its law: said, and decided by a load a little
    smaller."""
    kink = tcstudy.law(points=[(0, 1), (1, 2), (2, 1.5)])
    A, c = np.diag([1.0, 1.0]), np.ones(2)
    on = all_solutions(
        ContactProblem(A, np.array([3.0, 0.2]), c, kink)
    )  # v₁ + b(v₁) = 3 at the kink v₁ = 1
    assert not on.complete
    assert len(on.undecided) == 2
    assert "within rounding" in on.reason
    beside = all_solutions(ContactProblem(A, np.array([3.0 * (1 - 1e-9), 0.2]), c, kink))
    assert beside.complete
    falls = tcstudy.law(
        points=[(0, 2), (1, 1), (2, 1)]
    )  # by as much as the body is stiff: a continuum of solutions
    assert not all_solutions(ContactProblem(A[:1, :1], np.array([2.0]), c[:1], falls)).complete


def test_solutions_put_on_corners_of_their_cells_are_never_lost() -> None:
    """Loads made for v with nodes at the ends of jumps: without room for rounding the boxes there
    would be empty."""
    for seed in range(12):
        problem, _ = random_problem(seed, 3)
        rng, laws = np.random.default_rng(seed), [problem.law.single(i) for i in range(3)]
        k = [int(rng.integers(len(law.kinks))) for law in laws]
        v = np.array([law.kinks[i] for law, i in zip(laws, k, strict=True)])
        zeta = np.array(
            [
                (law.b_left if rng.random() < 0.5 else law.b_right)[i]
                for law, i in zip(laws, k, strict=True)
            ]
        )
        corner = ContactProblem(
            problem.A_tilde, problem.A_tilde @ v + problem.c * zeta, problem.c, problem.law
        )
        found = all_solutions(corner)
        assert not found.complete
        graph = PolygonProblems(
            corner.A_tilde, corner.c, corner.law, corner.l_tilde[None], corner.lambda_1
        )
        ends = graph.points[0, np.arange(3)[:, None], found.undecided[..., None] + np.arange(2)]
        at = np.array([v, zeta]).T[:, None]
        assert np.any((np.abs(ends - at) < 1e-12).all(-1).any(-1).all(-1)), seed


def test_the_door_refuses_limits_that_leave_nothing_to_do() -> None:
    problem = tcstudy.ContactProblem([[2.0]], [1.0], [1.0], SAW)
    assert tcstudy.all_solutions(problem).complete
    with pytest.raises(tcstudy.ProblemError, match="max_boxes = 0"):
        tcstudy.all_solutions(problem, max_boxes=0)
    with pytest.raises(tcstudy.ProblemError, match="law_error = 0"):
        tcstudy.all_solutions(problem, law_error=0.0)


def test_without_a_load_an_exponential_law_has_the_solution_at_rest() -> None:
    A, c = half_laplacian(4, 0.25)
    problem = ContactProblem(A, np.zeros(4), c, tcstudy.law("exponential", a=1.0, b=0.5, delta=9.0))
    equilibria = all_solutions(problem)
    assert equilibria.complete, equilibria.reason
    np.testing.assert_array_equal(equilibria.v, np.zeros((1, 4)))
