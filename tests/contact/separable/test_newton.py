"""SeparableNewton: known solutions, random problems judged from outside, units, and honest failures."""

import numpy as np
import pytest

from tcstudy.contact.loop import Outcome, Status, iterate
from tcstudy.contact.problem import ContactProblem
from tcstudy.contact.separable.descent import descend_nodes
from tcstudy.contact.separable.newton import SeparableNewton, interpolation
from tcstudy.contact.separable.pieces import energy_change, slopes
from tcstudy.laws.laws import Laws
from tests.contact import contact_cases as cases


def solve(problem: ContactProblem, x0: np.ndarray | None = None, **options: float) -> Outcome:
    return iterate(SeparableNewton(**options), problem, np.zeros(problem.m) if x0 is None else x0)


def one_node(law: Laws, load: float) -> ContactProblem:
    return ContactProblem(np.eye(1), np.array([load]), np.ones(1), law)


def test_published_style_one_node_problem() -> None:
    """b = 1 − 2s up to 0.4, then 0.2, Ã = 1, l̃ = 0.8: slips 0 (L = 0), 0.6 (L = 0.30 − 0.32) and the maximum 0.2."""
    problem = one_node(cases.slip_weakening(1.0, 0.2, 0.4), 0.8)
    stick, slip = solve(problem), solve(problem, np.array([1.0]))
    assert (stick.x[0], stick.f) == (0.0, 0.0)
    assert slip.x[0] == pytest.approx(0.6, abs=1e-15)
    assert slip.f == pytest.approx(-0.02, abs=1e-15)


def test_leaves_the_maximum_between_two_minima() -> None:
    """The start 0.2 satisfies the inclusion exactly but is a maximum of L̃."""
    problem = one_node(cases.slip_weakening(1.0, 0.2, 0.4), 0.8)
    assert problem.inclusion_residual(np.array([0.2])) <= 1e-15
    assert min(abs(solve(problem, np.array([0.2])).x[0] - s) for s in (0.0, 0.6)) <= 1e-15


def test_leaves_a_down_jump() -> None:
    """At a down-jump the inclusion may hold, but one side always descends."""
    law = cases.sawtooth()
    problem = one_node(law, 1.1)
    start = np.array([law.kinks[4]])
    assert problem.inclusion_residual(start) == 0.0
    outcome = solve(problem, start)
    assert outcome.converged
    assert outcome.x[0] != start[0]
    assert outcome.f < problem.energy(start)


@pytest.mark.parametrize("smooth", [False, True])
@pytest.mark.parametrize("m", [20, 60, 120])
def test_random_problems_are_solved_or_flagged(m: int, smooth: bool) -> None:
    """Up to 41 kinks, jumps both ways, falls up to 100 λ₁; the judge shares no code with the package."""
    flagged = 0
    for seed in range(60):
        rng = np.random.default_rng([seed, m, int(smooth)])
        problem = cases.random_problem(rng, m, smooth=smooth)
        x0 = [np.zeros(m), problem.frictionless()][seed % 2]
        outcome = solve(problem, x0)
        flagged += not outcome.converged
        assert not outcome.converged or cases.independent_residual(problem, outcome.x) <= 1e-12
        s = slopes(problem, outcome.x, problem.xi(outcome.x))
        noise = 1e-11 * problem.traction_scale * problem.c
        assert not outcome.converged or (np.all(s.left <= noise) and np.all(s.right >= -noise))
    assert flagged == 0


@pytest.mark.parametrize("m", [8, 50])
def test_energy_never_rises_and_start_is_never_undercut(m: int) -> None:
    for seed in range(30):
        rng = np.random.default_rng([seed, m, 3])
        problem = cases.random_problem(rng, m, max_kinks=15, smooth=seed % 2 == 1)
        method, x0 = SeparableNewton(), rng.normal(size=m)
        state = method.start(problem, x0)
        noise = 1e-12 * (abs(problem.energy(x0)) + problem.c @ np.abs(problem.law.j(x0)))
        assert state.f <= problem.energy(x0) + noise
        while method.verdict(problem, state) is None:
            new = method.step(problem, state)
            assert new.f <= state.f + noise
            state = new


def test_convex_problems_have_one_answer_from_every_start() -> None:
    A_tilde, c = cases.half_laplacian(60)
    law = cases.slip_weakening(1.0, 0.5, 0.5 / (0.9 * np.pi))
    x = np.linspace(0.0, 1.0, 60)
    problem = ContactProblem(A_tilde, c * (1.1 + 0.6 * np.sin(7 * x)), c, law)
    assert law.omega < problem.lambda_1
    rng = np.random.default_rng(1)
    answers = [solve(problem, x0) for x0 in (np.zeros(60), problem.frictionless(), rng.normal(size=60))]
    assert all(a.converged for a in answers)
    for a in answers[1:]:
        assert np.max(np.abs(a.x - answers[0].x)) <= 1e-12
        assert a.f == pytest.approx(answers[0].f, rel=1e-13)


@pytest.mark.parametrize("smooth", [False, True])
def test_same_answer_in_other_units(smooth: bool) -> None:
    for seed in range(8):
        rng = np.random.default_rng([seed, int(smooth), 9])
        problem = cases.random_problem(rng, 50, max_kinks=11, smooth=smooth)
        reference = solve(problem)
        for units in ((1e9, 1, 1), (1e-9, 1, 1), (1, 1e9, 1), (1, 1e-9, 1), (1e-9, 1e9, 1e9)):
            other = solve(cases.rescaled(problem, *units))
            assert other.converged
            assert np.max(np.abs(other.x * units[0] - reference.x)) <= 1e-9 * np.max(np.abs(reference.x))


@pytest.mark.parametrize("load", [0.5, 0.99, 1.0, 1.01, 2.0])
def test_load_through_first_slip(load: float) -> None:
    """Uniform traction below, at and above the static limit 1 of every node."""
    A_tilde, c = cases.half_laplacian(50)
    for law in (cases.slip_weakening(), cases.exponential_decay(), cases.sawtooth()):
        problem = ContactProblem(A_tilde, load * c, c, law)
        outcome = solve(problem)
        assert outcome.converged
        assert cases.independent_residual(problem, outcome.x) <= 1e-12
        assert np.all(outcome.x == 0.0) == (load <= 1.0)


def test_laws_without_kinks_zero_load_and_no_nodes() -> None:
    A_tilde, c = cases.half_laplacian(50)
    load = c * np.linspace(-1.0, 2.0, 50)
    outcome = solve(ContactProblem(A_tilde, load, c, cases.spring(3.0)))
    assert outcome.converged
    assert np.allclose(outcome.x, np.linalg.solve(A_tilde + np.diag(3.0 * c), load), rtol=1e-10)
    unloaded = solve(ContactProblem(A_tilde, 0.0 * c, c, cases.spring(3.0)))
    assert unloaded.converged
    assert not np.any(unloaded.x)
    empty = solve(ContactProblem(np.zeros((0, 0)), np.zeros(0), np.zeros(0), cases.slip_weakening()))
    assert empty.converged
    assert len(empty.x) == 0


def test_coarse_start_saves_factorisations() -> None:
    A_tilde, c = cases.half_laplacian(400)
    x = np.linspace(0.0, 1.0, 400)
    load = 1.05 * c * (0.7 + 0.6 * np.sin(np.pi * x) * np.cos(5 * np.pi * x) + 0.25 * np.cos(2 * np.pi * x))
    problem = ContactProblem(A_tilde, load, c, cases.slip_weakening(1.0, 0.5, 0.05))
    nested, flat = solve(problem), solve(problem, coarsest=0)
    assert nested.converged
    assert flat.converged
    assert nested.factorisations <= 4
    assert nested.factorisations < flat.factorisations
    again = solve(problem, nested.x)
    assert again.iterations <= 1
    assert np.array_equal(again.x, nested.x)


def test_coarse_start_never_replaces_a_better_start() -> None:
    """From close to a solution that is not the one the coarse copies find, the start must not rise."""
    A_tilde, c = cases.half_laplacian(60)
    problem = ContactProblem(A_tilde, 1.05 * c, c, cases.slip_weakening(1.0, 0.5, 0.02))
    starts = (np.zeros(60), problem.frictionless(), np.full(60, 0.1))
    least = min((solve(problem, x0, coarsest=0) for x0 in starts), key=lambda outcome: outcome.f)
    x0 = least.x + 1e-9 * np.random.default_rng(0).normal(size=60)
    assert SeparableNewton().start(problem, x0).f <= problem.energy(x0) + 1e-15


def test_interpolation_is_linear() -> None:
    for m in (7, 8):
        line = np.arange(float(m))
        assert np.allclose((interpolation(m) @ line[::2])[: m - 1], line[: m - 1])
        assert np.allclose(interpolation(m) @ np.ones((m + 1) // 2), 1.0)


def test_nodes_come_to_rest_together() -> None:
    """Below the kinetic limit, from the frictionless slips: all nodes stop on the up-jump they would cross, at once."""
    A_tilde, c = cases.half_laplacian(30)
    problem = ContactProblem(A_tilde, 0.4 * c, c, cases.slip_weakening())
    outcome = solve(problem, problem.frictionless(), coarsest=0)
    assert outcome.converged
    assert not np.any(outcome.x)
    assert outcome.iterations <= 4


def test_failures_are_statuses_with_a_reason() -> None:
    law = cases.slip_weakening()
    indefinite = ContactProblem(np.diag([1.0, -1.0]), np.array([2.0, 2.0]), np.ones(2), law)
    outcome = solve(indefinite)
    assert outcome.status == Status.NOT_POSITIVE_DEFINITE
    assert "clamp" in outcome.reason
    infinite = ContactProblem(np.eye(2), np.array([np.nan, 1.0]), np.ones(2), law)
    assert solve(infinite).status == Status.NOT_FINITE
    A_tilde, c = cases.half_laplacian(30)
    hard = ContactProblem(A_tilde, 1.2 * c, c, cases.slip_weakening(1.0, 0.5, 0.02))
    limited = solve(hard, max_iterations=1)
    assert limited.status == Status.ITERATION_LIMIT
    assert "max_iterations" in limited.reason
    unreachable = solve(hard, tolerance=1e-30)
    assert unreachable.status == Status.INCLUSION_VIOLATED
    assert "tolerance" in unreachable.reason


def test_log_lines_are_aligned() -> None:
    lines: list[str] = []
    A_tilde, c = cases.half_laplacian(30)
    problem = ContactProblem(A_tilde, 1.2 * c, c, cases.slip_weakening())
    iterate(SeparableNewton(), problem, np.zeros(30), lines.append)
    assert len({line.index("residual") for line in lines}) == 1


@pytest.mark.parametrize("smooth", [False, True])
def test_node_by_node_lowers_the_energy_and_finds_first_order_points(smooth: bool) -> None:
    """The fallback alone: every pass lowers L̃, and repeated passes end where no node descends."""
    for seed in range(20):
        rng = np.random.default_rng([seed, int(smooth), 11])
        problem = cases.random_problem(rng, 6, max_kinks=9, smooth=smooth)
        v = rng.normal(size=6)
        for _ in range(400):
            xi = problem.xi(v)
            s = slopes(problem, v, xi)
            target = descend_nodes(problem, v, xi, s.descent)
            step = target - v
            change = energy_change(problem, v, xi, step, problem.A_tilde @ step)
            size = np.max(np.abs(s.descent) / problem.c) / problem.traction_scale
            assert change < 0.0 or size <= 1e-12
            v = target
            if size <= 1e-12:
                break
        assert problem.inclusion_residual(v) <= 1e-9


def test_leaves_a_saddle_of_several_nodes() -> None:
    """All nodes on the falling piece: stationary, indefinite; the way out must lower the energy."""
    A_tilde, c = cases.half_laplacian(5)
    law = cases.slip_weakening(1.0, 0.2, 0.2)
    slip = np.full(5, 0.1)
    load = A_tilde @ slip + c * law.b(slip)
    problem = ContactProblem(A_tilde, load, c, law)
    assert problem.inclusion_residual(slip) <= 1e-14
    outcome = solve(problem, slip)
    assert outcome.converged
    assert outcome.f < problem.energy(slip) - 1e-4
    assert cases.independent_residual(problem, outcome.x) <= 1e-12


def test_energy_change_is_exact_where_two_energies_cancel() -> None:
    """A step of 1e-9 around a stationary point: the change is ½ dᵀ(Ã + C b′)d, far below the rounding of L̃."""
    A_tilde, c = cases.half_laplacian(20)
    problem = ContactProblem(A_tilde, 3.0 * c, c, cases.exponential_decay())
    v = solve(problem).x
    assert np.all(v > 0.0)
    step = 1e-9 * np.random.default_rng(0).normal(size=20)
    curvature = A_tilde @ step + c * problem.law.slope(v, problem.law.piece(v)) * step
    xi = c * problem.law.b(v)  # the exact stationary forces, so that the first-order part is zero
    change = energy_change(problem, v, xi, step, A_tilde @ step)
    assert change == pytest.approx(0.5 * step @ curvature, rel=1e-5)


@pytest.mark.parametrize("mean", [0.96, 1.05, 1.2])
def test_stiffly_coupled_neighbours_do_not_make_it_crawl(mean: float) -> None:
    """As under a thin layer: bending stiffness 1e4 times that of a node, hardly any against all nodes together.

    Node by node this took more than 300 steps.
    """
    m = 40
    A_tilde, c = cases.half_laplacian(m)
    bend = np.diff(np.eye(m), n=2, axis=0)
    A_tilde = A_tilde + 1e4 * np.pi / 16.0 * A_tilde[0, 0] * (bend.T @ bend)
    x = np.linspace(0.0, 1.0, m)
    law = cases.slip_weakening(1.0, 0.5, 0.25 / cases.least_eigenvalue(A_tilde, c))
    problem = ContactProblem(A_tilde, c * (mean + 0.6 * np.cos(np.pi * x) + 0.3 * np.sin(5 * x)), c, law)
    outcome = solve(problem, tolerance=1e-10)
    assert outcome.converged
    assert outcome.iterations <= 40
