"""Moves of one node with the others relaxed: the rank-one energies against dense algebra, and what they find."""

import numpy as np
import pytest

from tcstudy.contact.contact import nearest_minimum
from tcstudy.contact.factors import factor_free
from tcstudy.contact.newton import slopes
from tcstudy.contact.problem import ContactProblem
from tcstudy.contact.search import best_places, follow, move_starts, relaxed_stiffness
from tests.contact import contact_cases as cases

Array = np.ndarray


def descend(problem: ContactProblem, x0: Array | None = None) -> Array:
    return nearest_minimum(problem, np.zeros(problem.m) if x0 is None else x0, 1e-12)[0]


def node_moves(problem: ContactProblem, v: Array) -> Array:
    """The promises, the best first."""
    return move_starts(problem.rows, v[None])[0]


def relaxed(problem: ContactProblem, v: Array) -> tuple[Array, Array, Array]:
    """(free nodes, factor of H, k)."""
    rest = slopes(problem, v, problem.xi(v)).at_rest
    free, law = np.flatnonzero(~rest), problem.law
    added = problem.c[free] * law.of_nodes(free).slope(v[free], law.piece(v)[free])
    factor, info = factor_free(problem.A_tilde, free, added)
    assert info == 0
    return free, factor, relaxed_stiffness(problem.A_tilde, free, np.flatnonzero(rest), factor, added)


def test_one_node_leaves_its_well() -> None:
    """b = 1 − 2s up to 0.4, then 0.2; l̃ = 0.8: from s = 0 (L = 0) to 0.6 (L = −0.02), and from there nowhere."""
    law = cases.slip_weakening(1.0, 0.2, 0.4)
    problem = ContactProblem(np.eye(1), np.array([0.8]), np.ones(1), law)
    assert [float(w[0]) for w in node_moves(problem, np.zeros(1))] == pytest.approx([0.6], rel=1e-14)
    assert len(node_moves(problem, np.array([0.6]))) == 0


def test_one_node_leaves_a_well_along_an_exponential() -> None:
    """b = 0.5 + 0.5 e^(−10 s) falls fastest where the node sticks; b + s = 0.95 again at 0.4441."""
    problem = ContactProblem(np.eye(1), np.array([0.95]), np.ones(1), cases.exponential_decay(1.0, 0.5, 0.1))
    (found,) = node_moves(problem, np.zeros(1))
    assert 0.4 < found[0] < 0.5
    assert 0.5 + 0.5 * np.exp(-10.0 * found[0]) + found[0] == pytest.approx(0.95, abs=1e-14)
    mirrored = ContactProblem(np.eye(1), np.array([-0.95]), np.ones(1), problem.law)
    assert [float(w[0]) for w in node_moves(mirrored, np.zeros(1))] == [-found[0]]


def test_stiffnesses_are_schur_complements() -> None:
    """k_i by eliminating all other free nodes one problem at a time."""
    for seed in range(6):
        problem = cases.random_problem(np.random.default_rng([seed, 51]), 12, max_kinks=9)
        v = descend(problem)
        _, _, stiffness = relaxed(problem, v)
        rest = slopes(problem, v, problem.xi(v)).at_rest
        q = np.where(rest, 0.0, problem.law.slope(v, problem.law.piece(v)))
        for i in range(12):
            others = np.flatnonzero(~rest & (np.arange(12) != i))
            H = problem.A_tilde[np.ix_(others, others)] + np.diag(problem.c[others] * q[others])
            row = problem.A_tilde[others, i]
            k = problem.A_tilde[i, i] - (row @ np.linalg.solve(H, row) if len(others) else 0.0)
            assert stiffness[i] == pytest.approx(k, rel=1e-9)


def test_a_promise_is_the_exact_change_where_nobody_else_leaves_his_piece() -> None:
    kept = 0
    for seed in range(40):
        problem = cases.random_problem(np.random.default_rng([seed, 52]), 10, max_kinks=9)
        v = descend(problem)
        xi, c, laws = problem.xi(v), problem.c, (problem.law.tables, problem.law.node_index(problem.m))
        free, factor, stiffness = relaxed(problem, v)
        gain, target = best_places(*laws, v, xi / c, stiffness / c)
        for node in np.flatnonzero(gain):
            step = follow(problem.A_tilde, free, factor, int(node), float(target[node] - v[node]))
            same = problem.law.piece(v + step) == problem.law.piece(v)
            if np.all(same | slopes(problem, v, xi).at_rest | (np.arange(10) == node)):
                change = problem.energy_change(v, v + step)[0]
                assert change == pytest.approx(c[node] * gain[node], rel=1e-8)
                kept += 1
    assert kept >= 3


def test_no_move_from_a_point_that_is_no_minimum() -> None:
    A_tilde, c = cases.half_laplacian(5)
    law = cases.slip_weakening(1.0, 0.2, 0.2)
    slip = np.full(5, 0.1)
    problem = ContactProblem(A_tilde, A_tilde @ slip + c * law.b(slip), c, law)
    assert len(node_moves(problem, slip)) == 0
