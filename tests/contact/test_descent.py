"""Descent: known solutions, random problems judged from outside, pieces a few roundings wide,
honest failures."""

import numpy as np
import pytest
import scipy.linalg

from tcstudy.contact.certificates import certify
from tcstudy.contact.descent import descend, descend_nested
from tcstudy.contact.newton import convex_step
from tcstudy.contact.problem import CondensedBody, ContactProblem, Status
from tcstudy.contact.solution import polished
from tcstudy.contact.solve import nearest_minimum, solve_contact
from tcstudy.laws.pieces import DOWN, UP
from tcstudy.laws.shapes import piecewise_linear, tresca
from tests.contact import contact_cases as cases

Array = np.ndarray


def solve(problem: ContactProblem, x0: Array | None = None) -> Array:
    """The minimum to which descent leads, whose residual is at rounding."""
    v, _ = nearest_minimum(problem, np.zeros(problem.m) if x0 is None else x0, 1e-12)
    assert cases.independent_residual(problem, v) <= 1e-11
    return v


def test_leaves_a_down_jump() -> None:
    """At a down-jump the inclusion may hold, but one side always descends."""
    law = cases.sawtooth()
    problem = ContactProblem(np.eye(1), np.array([1.1]), np.ones(1), law)
    start = np.array([law.kinks[4]])
    assert problem.inclusion_residual(start) == 0.0
    assert problem.energy(solve(problem, start)) < problem.energy(start)


def test_leaves_a_saddle_of_several_nodes() -> None:
    """All nodes on the falling piece: stationary, indefinite; the way out must lower the energy."""
    A_tilde, c = cases.half_laplacian(5)
    law = cases.slip_weakening(1.0, 0.2, 0.2)
    slip = np.full(5, 0.1)
    problem = ContactProblem(A_tilde, A_tilde @ slip + c * law.b(slip), c, law)
    assert problem.inclusion_residual(slip) <= 1e-14
    assert problem.energy(solve(problem, slip)) < problem.energy(slip) - 1e-4


@pytest.mark.parametrize("smooth", [False, True])
@pytest.mark.parametrize("m", [20, 120])
def test_random_problems_are_solved(m: int, smooth: bool) -> None:
    """Up to 41 kinks, jumps both ways, falls up to 100 λ₁; the judge shares no code with the
    package."""
    for seed in range(12):
        rng = np.random.default_rng([seed, m, int(smooth)])
        problem = cases.random_problem(rng, m, smooth=smooth)
        solve(problem, [np.zeros(m), problem.frictionless()][seed % 2])


def test_laws_without_kinks_zero_load_and_no_nodes() -> None:
    A_tilde, c = cases.half_laplacian(50)
    load = c * np.linspace(-1.0, 2.0, 50)
    v = solve(ContactProblem(A_tilde, load, c, cases.spring(3.0)))
    assert np.allclose(v, np.linalg.solve(A_tilde + np.diag(3.0 * c), load), rtol=1e-10)
    assert not np.any(solve_contact(ContactProblem(A_tilde, 0.0 * c, c, cases.spring(3.0))).v)
    empty = solve_contact(
        ContactProblem(np.zeros((0, 0)), np.zeros(0), np.zeros(0), cases.slip_weakening())
    )
    assert (empty.status, len(empty.v)) == (Status.CONVERGED, 0)


def test_coarse_start_saves_steps_on_the_body_itself() -> None:
    A_tilde, c = cases.half_laplacian(400)
    x = np.linspace(0.0, 1.0, 400)
    load = (
        1.05
        * c
        * (0.7 + 0.6 * np.sin(np.pi * x) * np.cos(5 * np.pi * x) + 0.25 * np.cos(2 * np.pi * x))
    )
    rows, zero = (
        ContactProblem(A_tilde, load, c, cases.slip_weakening(1.0, 0.5, 0.05)).rows,
        np.zeros((1, 400)),
    )
    found, flat = descend_nested(rows, zero), descend(rows, zero)
    assert max(found.residual[0], flat.residual[0]) <= 1e-12
    assert found.steps[0] <= 4
    assert found.steps[0] < flat.steps[0]


def test_coarse_copies_do_not_cross_blocks() -> None:
    """Slips and openings of 61 and 44 nodes: rows of P lie in one block, and so do coarse nodes."""
    A_slip, c_slip = cases.half_laplacian(61)
    A_opening, c_opening = cases.half_laplacian(44)
    A_tilde = scipy.linalg.block_diag(A_slip, A_opening)
    body = CondensedBody.of(A_tilde, np.append(c_slip, c_opening), blocks=(61, 44))
    assert body.coarse is not None
    assert body.coarse.blocks == (31, 22)
    P = body.P.toarray()
    assert not P[:61, 31:].any()
    assert not P[61:, :31].any()
    np.testing.assert_array_equal(P.sum(axis=1), 1.0)
    np.testing.assert_array_equal(P[body.coarse_nodes], np.eye(53))
    of_slip = CondensedBody.of(A_slip, c_slip).coarse
    assert of_slip is not None
    np.testing.assert_allclose(body.coarse.A_tilde[:31, :31], of_slip.A_tilde, rtol=1e-15)


def test_failures_are_statuses_with_a_reason() -> None:
    law = cases.slip_weakening()
    indefinite = solve_contact(
        ContactProblem(np.diag([1.0, -1.0]), np.array([2.0, 2.0]), np.ones(2), law)
    )
    assert indefinite.status == Status.NOT_POSITIVE_DEFINITE
    assert "clamp" in indefinite.reason
    infinite = ContactProblem(np.eye(2), np.array([np.nan, 1.0]), np.ones(2), law)
    assert solve_contact(infinite).status == Status.NOT_FINITE
    A_tilde, c = cases.half_laplacian(30)
    hard = ContactProblem(A_tilde, 1.2 * c, c, cases.slip_weakening(1.0, 0.5, 0.02))
    unreachable = solve_contact(hard, tolerance=1e-50)
    assert unreachable.status == Status.INCLUSION_VIOLATED
    assert "tolerance" in unreachable.reason
    with pytest.raises(ValueError, match="clamp it"):
        CondensedBody.of(np.array([[1.0, -1.0], [-1.0, 1.0]]), np.ones(2))


def test_only_friction_holds_the_body() -> None:
    """Two nodes on a spring that nothing else holds: pulled below the limits of both both rest,
    above it they part."""
    A = np.array([[1.0, -1.0], [-1.0, 1.0]])
    held = solve_contact(ContactProblem(A, np.array([0.7, 0.7]), np.ones(2), tresca(1.0)))
    assert held.status == Status.CONVERGED
    assert not np.any(held.v)
    parted = solve_contact(ContactProblem(A, np.array([2.5, -2.5]), np.ones(2), tresca(1.0)))
    assert parted.status == Status.CONVERGED
    assert parted.v[0] - parted.v[1] == pytest.approx(1.5, rel=1e-9)


def test_energy_change_is_exact_where_two_energies_cancel() -> None:
    """A step of 1e-9 around a stationary point: the change is ½ dᵀ(Ã + C b′)d, far below the
    rounding of L̃."""
    A_tilde, c = cases.half_laplacian(20)
    problem = ContactProblem(A_tilde, 3.0 * c, c, cases.exponential_decay())
    v = solve(problem)
    assert np.all(v > 0.0)
    step = 1e-9 * np.random.default_rng(0).normal(size=20)
    curvature = A_tilde @ step + c * problem.law.slope(v, problem.law.piece(v)) * step
    xi = c * problem.law.b(v)  # the exact stationary forces, so that the first-order part is zero
    change = problem.energy_change(v, v + step, xi)[0]
    assert change == pytest.approx(0.5 * step @ curvature, rel=1e-5)


def test_descents_end_where_rounding_is_all_that_is_left() -> None:
    """Friction is small against the load: ξ = l̃ − Ãv loses the digits that the tolerance asks
    for."""
    for seed in range(20):
        rng = np.random.default_rng(seed)
        q, _ = np.linalg.qr(rng.standard_normal((10, 10)))
        problem = ContactProblem(
            (q * np.geomspace(1.0, 1e5, 10)) @ q.T,
            1e4 * rng.standard_normal(10),
            np.ones(10),
            tresca(1.0),
        )
        ended = descend(problem.rows, np.zeros((1, 10)))
        assert ended.residual[0] < 1e-6
        assert ended.steps[0] < 100


@pytest.mark.parametrize("mean", [0.96, 1.2])
def test_stiffly_coupled_neighbours_do_not_make_it_crawl(mean: float) -> None:
    """As under a thin layer, bending stiffness 1e4 times that of a node: node by node this took
    over 300 steps."""
    m = 40
    A_tilde, c = cases.half_laplacian(m)
    bend = np.diff(np.eye(m), n=2, axis=0)
    A_tilde = A_tilde + 1e4 * np.pi / 16.0 * A_tilde[0, 0] * (bend.T @ bend)
    x = np.linspace(0.0, 1.0, m)
    law = cases.slip_weakening(1.0, 0.5, 0.25 / cases.least_eigenvalue(A_tilde, c))
    problem = ContactProblem(
        A_tilde, c * (mean + 0.6 * np.cos(np.pi * x) + 0.3 * np.sin(5 * x)), c, law
    )
    ended = descend(problem.rows, np.zeros((1, m)), 1e-10)
    assert ended.residual[0] <= 1e-10
    assert ended.steps[0] <= 40


@pytest.mark.parametrize("driven", [False, True])
def test_random_laws_on_badly_conditioned_bodies(driven: bool) -> None:
    """Laws odd or not, segments over two decades; loads about friction, or far beyond it."""
    for m, seeds in ((20, 10), (60, 2)):
        for seed in range(seeds):
            rng = np.random.default_rng([seed, m])
            A, law = (
                cases.ill_conditioned(rng, m, 10.0 ** rng.uniform(2.0, 8.0)),
                cases.random_law(rng, 1.0, 8),
            )
            c = 10.0 ** rng.uniform(-1.0, 1.0, m) if seed % 2 else np.ones(m)
            noise = law.b_scale * (
                rng.normal(size=m) if driven else rng.choice([-1.0, 1.0, 0.0], m)
            )
            load = A @ rng.normal(size=m) * (0.5 if driven else 0.05) + c * noise
            answer = solve_contact(ContactProblem(A, load, c, law))
            assert answer.status == Status.CONVERGED, (m, seed, answer.reason)
            assert not answer.limited


@pytest.mark.parametrize("smooth", [False, True])
def test_the_convex_model_lowers_the_energy_and_finds_first_order_points(smooth: bool) -> None:
    """The fallback alone: every minimum of the model lowers L̃, and repeated ones end where no node
    descends."""
    for seed in range(8):
        rng = np.random.default_rng([seed, int(smooth), 11])
        problem = cases.random_problem(rng, 6, max_kinks=9, smooth=smooth)
        v = rng.normal(size=6)
        for _ in range(400):
            target = convex_step(problem, v)
            assert target is not None
            change = problem.energy_change(v, target)[0]
            slack = 1e-13 * float(
                problem.c @ np.abs(problem.law.j(v)) + np.abs(problem.l_tilde) @ np.abs(v)
            )
            assert change <= slack
            if abs(change) <= slack:
                break
            v = target
        assert polished(problem, v, exact=False).residual <= 1e-9


@pytest.mark.parametrize("width", [6e-17, 1e-13, 1e-8])
def test_nodes_rest_on_a_narrow_rise(width: float) -> None:
    """From one rounding of 0.3 on."""
    law = piecewise_linear(
        [(0.0, 0.5), (0.3, 0.5), (0.3 + width, 0.8), (1.0, 1.0)], True, None, None
    )
    A_tilde, c = cases.half_laplacian(20)
    problem = ContactProblem(A_tilde, c * np.linspace(0.4, 3.0, 20), c, law)
    answer = solve_contact(problem)
    assert answer.status == Status.CONVERGED
    assert answer.inclusion_residual <= 1e-10
    within = (answer.v >= 0.3) & (answer.v <= 0.3 + width)
    assert np.any(within)
    traction = answer.xi[within] / c[within]
    assert np.all((traction > 0.5) & (traction < 0.8))
    assert certify(problem, answer.v, tolerance=1.0).unique


def test_narrow_pieces_become_jumps_and_odd_laws_stay_odd() -> None:
    rise, fall = float(np.nextafter(0.3, 1.0)), float(np.nextafter(0.7, 1.0))
    points = [(0.0, 0.5), (0.3, 0.5), (rise, 0.8), (0.7, 0.8), (fall, 0.2), (1.0, 0.2)]
    law = piecewise_linear(points, True, None, None)
    other = law.without_narrow_pieces
    assert other.kinks.tolist() == [-0.7, -0.3, 0.0, 0.3, 0.7]
    assert other.kinds.tolist() == [DOWN, UP, UP, UP, DOWN]
    s = np.random.default_rng(3).uniform(0.0, 1.5, 300)
    assert np.array_equal(other.b(s), -other.b(-s))
    assert np.array_equal(other.b(s), law.b(s))
