"""All solutions of a problem against brute force over all pieces; limits, ties, laws of rows and
exponential laws."""

import numpy as np
import pytest

import tcstudy
from tcstudy.contact.all_solutions import all_solutions
from tcstudy.contact.boxes import Limits, PolygonProblems
from tcstudy.contact.certificates import certify
from tcstudy.contact.problem import ContactProblem
from tcstudy.contact.soft_modes import ModeSearch
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


def test_a_solution_on_a_kink_is_decided_where_the_inertia_is_the_same_beside_it() -> None:
    """v₁ + b(v₁) = 3 at the kink v₁ = 1: 1 + b′ is 2 and ½ beside it."""
    kink = tcstudy.law(points=[(0, 1), (1, 2), (2, 1.5)])
    A, c = np.diag([1.0, 1.0]), np.ones(2)
    on = all_solutions(ContactProblem(A, np.array([3.0, 0.2]), c, kink))
    assert on.complete, on.reason
    np.testing.assert_allclose(on.v, [[1.0, 0.0]], atol=1e-15)
    assert on.stable.all()
    beside = all_solutions(ContactProblem(A, np.array([3.0 * (1 - 1e-9), 0.2]), c, kink))
    assert (len(beside), beside.complete) == (1, True)


def test_a_fold_on_a_kink_and_a_singular_piece_are_undecided_and_never_counted() -> None:
    """For loads as near as one likes the fold is no solution or two."""
    peak = tcstudy.law(points=[(0, 0), (1, 3), (2, 1), (3, 4)])
    A, c = np.eye(1), np.ones(1)
    counts = [len(all_solutions(ContactProblem(A, np.array([x]), c, peak))) for x in (3.9, 4.1)]
    assert counts == [3, 1]
    at_fold = all_solutions(ContactProblem(A, np.array([4.0]), c, peak))
    assert not at_fold.complete
    assert len(at_fold) == 1
    assert len(at_fold.undecided) == 1
    assert "1 point of the law's graphs is undecided" in at_fold.reason
    assert "within rounding" in at_fold.reason
    # falls by as much as the body is stiff: a continuum of solutions
    falls = tcstudy.law(points=[(0, 2), (1, 1), (2, 1)])
    assert not all_solutions(ContactProblem(A, np.array([2.0]), c, falls)).complete


def test_a_law_that_softens_by_as_much_as_the_body_is_stiff_has_a_list_without_a_claim() -> None:
    """Its Newton's equations are singular: v₁ ∈ [0, 1] is not determined, v₂ = 1.5 is."""
    falls = tcstudy.law(points=[(0, 2), (1, 1), (2, 1)])
    problem = tcstudy.ContactProblem(np.eye(2), np.array([2.0, 2.5]), np.ones(2), falls)
    found = tcstudy.all_solutions(problem)
    assert not found.complete
    assert len(found)
    for v in found.v:
        assert v[1] == pytest.approx(1.5)
        assert problem.inclusion_residual(v) < 1e-10


def test_solutions_put_on_corners_of_their_cells_are_never_lost() -> None:
    """Loads made for v with nodes at the ends of jumps: without room for rounding the boxes there
    would be empty. Where the corner is decided the solution is listed."""
    decided = 0
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
        at = np.concatenate([v, problem.c * zeta])
        listed = np.abs(np.hstack([found.v, found.xi]) - at).max(axis=1) < 1e-9
        assert np.count_nonzero(listed) <= 1
        if found.complete:
            assert listed.any(), seed
            decided += 1
            continue
        graph = PolygonProblems(
            corner.A_tilde, corner.c, corner.law, corner.l_tilde[None], corner.lambda_1
        )
        ends = graph.points[0, np.arange(3)[:, None], found.undecided[..., None] + np.arange(2)]
        point = np.array([v, zeta]).T[:, None]
        is_end = np.any((np.abs(ends - point) < 1e-12).all(-1).any(-1).all(-1))
        assert listed.any() or is_end, seed
    assert 0 < decided < 12


@pytest.mark.parametrize("has_jumps", [False, True])
def test_the_search_by_modes_has_the_solutions_that_brute_force_finds(has_jumps: bool) -> None:
    counts = []
    for seed in range(15):
        problem, _ = random_problem(seed, 3, has_jumps)
        v, _, nearest = by_brute_force(problem)
        assert nearest > NEAR
        polygons = PolygonProblems(
            problem.A_tilde, problem.c, problem.law, problem.l_tilde[None], problem.lambda_1
        )
        found = ModeSearch(polygons.single(0)).search(Limits())
        assert (found.stopped, found.undecided) == (False, [])
        found_v = np.array([one.v for one in found.solutions])
        np.testing.assert_allclose(sorted_rows(found_v), sorted_rows(v), atol=1e-8)
        for one in found.solutions:
            assert one.stable == certify(problem, one.v).strict_minimum
        counts.append(len(found_v))
    assert max(counts) >= 3


def test_a_problem_of_many_boxes_is_searched_by_modes_or_as_it_began(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Both ways end in the same list; a search by modes that a limit stops costs no solution."""
    law = tcstudy.law(points=[(0, 4), (1, 1)])
    A, c = half_laplacian(8, 0.25)
    problem = ContactProblem(A, 4.0 * c * np.linspace(0.2, 1.0, 8), c, law)
    plain = all_solutions(problem)
    assert plain.complete
    assert plain.boxes > 3
    monkeypatch.setattr("tcstudy.contact.all_solutions.FIRST_WORK", 1.0)
    monkeypatch.setattr("tcstudy.contact.all_solutions.MIN_FIRST_BOXES", 1)
    by_modes = all_solutions(problem)
    monkeypatch.setattr("tcstudy.contact.all_solutions.MODE_SHARE", 0.0)
    as_it_began = all_solutions(problem)
    for other in (by_modes, as_it_began):
        assert other.complete, other.reason
        np.testing.assert_allclose(other.v, plain.v, atol=1e-12)
        np.testing.assert_array_equal(other.stable, plain.stable)
        np.testing.assert_array_equal(other.sides, plain.sides)
    assert as_it_began.boxes >= plain.boxes


@pytest.mark.parametrize("m", [40, 160])
def test_boxes_do_not_grow_with_the_mesh(m: int) -> None:
    """A bar on a softening film, held at one end and pulled at the other, with two soft modes."""
    A = (2.0 * np.eye(m) - np.eye(m, k=1) - np.eye(m, k=-1)) * m
    A[-1, -1] = m
    c = np.full(m, 1.0 / m)
    c[-1] = 0.5 / m
    load = np.zeros(m)
    load[-1] = 0.3
    law = tcstudy.law("slip-weakening", tau_s=1.0, tau_k=0.1, delta=0.018)
    problem = ContactProblem(A, load, c, law)
    polygons = PolygonProblems(A, c, problem.law, load[None], problem.lambda_1)
    search = ModeSearch(polygons.single(0))
    answer = search.search(Limits(boxes=20))
    assert search.N.shape == (m, 2)
    assert (answer.stopped, answer.undecided) == (False, [])
    (solution,) = answer.solutions
    assert solution.stable
    assert problem.inclusion_residual(solution.v) < 1e-10


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


@pytest.mark.parametrize("kind", ["saw-tooth", "exponential"])
def test_what_a_limit_cuts_off_has_the_solution_of_the_solver(kind: str) -> None:
    problem = saw_tooth(5.0 if kind == "saw-tooth" else 4.0)
    if kind == "exponential":
        law = tcstudy.law("exponential", a=4.0, b=1.0, delta=1.0)
        problem = ContactProblem(problem.A_tilde, problem.l_tilde, problem.c, law)
    few = tcstudy.all_solutions(problem, max_boxes=1)
    assert not few.complete
    assert few.reason == "the limit of 1 boxes was met"
    whole = tcstudy.all_solutions(problem)
    v = few.v[0]
    listed = np.flatnonzero(np.max(np.abs(whole.v - v), axis=1) < 1e-7)
    assert len(listed) == 1
    np.testing.assert_array_equal(few.sides[0], whole.sides[listed[0]])
    assert few.stable[0]
    assert few.energy[0] == pytest.approx(whole.energy[listed[0]], rel=1e-9)


@pytest.mark.parametrize("roundings", [1, 2, 8])
def test_a_node_inside_a_piece_a_few_roundings_wide_is_stable_if_that_rises(roundings: int) -> None:
    end = 1.0
    for _ in range(roundings):
        end = np.nextafter(end, 2.0)
    for top, is_stable in ((3.0, True), (-1.0, False)):
        points = [(0.0, 2.0), (1.0, 0.0), (end, top), (2.0, 1.0)]
        law = tcstudy.law(points=points)
        traction = 0.4 * top
        for A in ([[1.0]], [[1.0, -0.3], [-0.3, 1.0]]):
            m = len(A)
            load = np.sum(A, axis=1) + traction
            problem = ContactProblem(np.array(A), load, np.ones(m), law)
            equilibria = all_solutions(problem)
            inside = np.all(np.abs(equilibria.xi - traction) < 1e-6, axis=1)
            assert np.count_nonzero(inside) == 1
            assert equilibria.stable[inside][0] == is_stable
