"""Moves of one node with the others relaxed: the rank-one energies against dense algebra, and what they find."""

import numpy as np
import pytest

from tcstudy.contact.contact import nearest_minimum
from tcstudy.contact.newton import slopes
from tcstudy.contact.problem import ContactProblem
from tcstudy.contact.search import best_places, move_starts, responses
from tests.contact import contact_cases as cases

Array = np.ndarray


def descend(problem: ContactProblem, x0: Array | None = None) -> Array:
    return nearest_minimum(problem, np.zeros(problem.m) if x0 is None else x0, 1e-12)[0]


def node_moves(problem: ContactProblem, v: Array) -> Array:
    """The promises, the best first."""
    return move_starts(problem.rows, v[None])[0]


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


def test_responses_and_promises_are_exact() -> None:
    """The others relaxed by dense algebra; the change of energy where nobody else leaves his piece."""
    kept = 0
    for seed in range(40):
        problem = cases.random_problem(np.random.default_rng([seed, 52]), 10, max_kinks=9)
        v = descend(problem)
        xi, c, law = problem.xi(v), problem.c, problem.law
        rest = slopes(problem, v, xi).at_rest
        free, added = np.flatnonzero(~rest), np.where(rest, 0.0, c * law.slope(v, law.piece(v)))
        response = responses(problem.A_tilde, free, added[free])
        assert response is not None
        for i in range(10):
            others = free[free != i]
            H = problem.A_tilde[np.ix_(others, others)] + np.diag(added[others])
            relaxed = -np.linalg.solve(H, problem.A_tilde[others, i]) if len(others) else np.zeros(0)
            np.testing.assert_allclose(response[others, i], relaxed, atol=1e-9 * np.max(np.abs(relaxed), initial=1.0))
        stiffness = np.einsum("ij,ji->i", problem.A_tilde, response)
        gain, target = best_places(law, v, xi / c, stiffness / c)
        for node in np.flatnonzero(gain):
            step = response[:, node] * (target - v)[node]
            if np.all((law.piece(v + step) == law.piece(v)) | rest | (np.arange(10) == node)):
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
