"""Derivatives at solutions: closed forms, differences, adjoint against forward, events and folds."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tcstudy.contact.contact import solve_contact
from tcstudy.contact.linearised import Linearised
from tcstudy.contact.problem import ContactProblem
from tcstudy.laws.derivatives import law_slopes
from tcstudy.laws.laws import Laws
from tcstudy.laws.shapes import SHAPES
from tests.contact import contact_cases as cases

Array = np.ndarray


def softening(tau_s: float = 1.0, tau_k: float = 0.4, delta: float = 0.5) -> Laws:
    return SHAPES["slip-weakening"].build(tau_s=tau_s, tau_k=tau_k, delta=delta)


def sliding(seed: int = 1, m: int = 40) -> tuple[ContactProblem, Array]:
    """A problem of which some nodes rest, some fall and some slide at tau_k, with its solution."""
    rng = np.random.default_rng(seed)
    A_tilde, c = cases.random_stiffness(rng, m)
    problem = ContactProblem(A_tilde, c * rng.normal(0.0, 2.0, m), c, softening())
    answer = solve_contact(problem)
    assert answer.inclusion_residual < 1e-12
    return problem, answer.v


def test_one_spring_in_closed_form() -> None:
    """v + (1 − v/4) = l: v = (4/3)(l − 1), and with b = tau_s(1 − v/δ) v = (l − tau_s)/(1 − tau_s/δ)."""
    problem = ContactProblem(np.eye(1), np.array([1.2]), np.ones(1), softening(1.0, 0.0, 4.0))
    v = solve_contact(problem).v
    at = Linearised.at(problem, v)
    assert at.step(np.ones(1)) == pytest.approx([4.0 / 3.0], rel=1e-14)
    for name, exact in (("tau_s", (-0.75 + 0.2 / 4.0) / 0.75**2), ("delta", -0.2 / (0.75 * 4.0) ** 2)):
        b = law_slopes(softening(1.0, 0.0, 4.0), name).value(v, at.piece)
        assert at.step(-b) == pytest.approx([exact], rel=1e-12)
    stiffer = at.step(-v)  # (E v)' at E = 1
    assert stiffer == pytest.approx([-v[0] / 0.75], rel=1e-13)


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_against_differences_with_pieces_that_stay(seed: int) -> None:
    problem, v = sliding(seed)
    at = Linearised.at(problem, v)
    assert 0 < len(at.rest) < problem.m
    assert at.events == 0
    load = np.sin(np.arange(problem.m)) * problem.c

    def solved(l_tilde: Array, law: Laws, A_tilde: Array) -> Array:
        other = Linearised.at(replace(problem, l_tilde=l_tilde, law=law, A_tilde=A_tilde), v)
        for _ in range(3):  # Newton on the same pieces, which is exact
            p = other.problem
            r = p.l_tilde - p.A_tilde @ other.v - p.c * np.asarray(p.law.value(other.v, at.piece))
            moved = other.v + np.where(np.isin(np.arange(p.m), at.free), other.step(r), 0.0)
            other = Linearised.at(p, moved)
        assert np.array_equal(other.free, at.free)
        assert np.array_equal(other.piece, at.piece)
        return other.v

    A, l_tilde = problem.A_tilde, problem.l_tilde
    ways = {
        "load": (lambda h: (l_tilde + h * load, problem.law, A), load),
        "tau_s": (lambda h: (l_tilde, softening(tau_s=1.0 + h), A), _by_law(at, "tau_s")),
        "delta": (lambda h: (l_tilde, softening(delta=0.5 + h), A), _by_law(at, "delta")),
        "E": (lambda h: (l_tilde, problem.law, (1.0 + h) * A), -A @ v),
    }
    for name, (moved, r) in ways.items():
        forward = at.step(r)
        rough, fine = ((solved(*moved(h)) - solved(*moved(-h))) / (2.0 * h) for h in (2e-4, 1e-4))
        scale = np.max(np.abs(forward))
        np.testing.assert_allclose(forward, (4.0 * fine - rough) / 3.0, rtol=0.0, atol=1e-7 * scale, err_msg=name)
        y = np.cos(np.arange(problem.m))
        assert _adjoint(at, y) @ r == pytest.approx(y @ forward, rel=1e-12)


def _adjoint(at: Linearised, y: Array) -> Array:
    """(m,) λ with yᵀ dv = λᵀ r for every r, by the transposed matrix and NumPy's solver."""
    H = at.problem.A_tilde + np.diag(at.problem.c * np.asarray(at.problem.law.slope(at.v, at.piece)))
    found = np.zeros(len(y))
    found[at.free] = np.linalg.solve(H[np.ix_(at.free, at.free)].T, y[at.free])
    return found


def _by_law(at: Linearised, name: str) -> Array:
    return -at.problem.c * law_slopes(at.problem.law, name).value(at.v, at.piece)  # type: ignore[arg-type]


def test_a_resting_node_moves_with_its_kink() -> None:
    """b jumps up at s = δ: the node rests there, and its neighbour feels it through A."""
    law = SHAPES["piecewise-linear"].build(points=[(0.0, 0.0), (1.0, 0.2), (1.0, 2.0), (3.0, 2.0)])
    A_tilde = np.array([[2.0, -1.0], [-1.0, 2.0]])
    problem = ContactProblem(A_tilde, np.array([2.6, 0.0]), np.ones(2), law)
    v = solve_contact(problem).v
    at = Linearised.at(problem, v)
    assert at.rest.tolist() == [0]
    dv = at.step(np.zeros(2), np.array([1.0, 0.0]))
    assert dv == pytest.approx([1.0, 1.0 / 2.2])


def test_events_are_counted_and_folds_are_said() -> None:
    law = softening(1.0, 0.4, 0.5)
    at_kink = ContactProblem(np.eye(1) * 3.0, np.array([1.9]), np.ones(1), law)
    assert Linearised.at(at_kink, np.array([0.5])).events == 1
    about_to_slide = ContactProblem(np.eye(1) * 3.0, np.array([1.0]), np.ones(1), law)
    assert Linearised.at(about_to_slide, np.zeros(1)).events == 1
    assert Linearised.at(replace(about_to_slide, l_tilde=np.array([0.9])), np.zeros(1)).events == 0
    fold = ContactProblem(np.eye(1) * 1.2, np.array([1.0]), np.ones(1), law)  # b falls by 1.2 a length
    assert Linearised.at(fold, np.array([0.2])).singular
