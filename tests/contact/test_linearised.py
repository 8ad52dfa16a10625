"""Derivatives at solutions: closed forms, events and folds."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tcstudy.contact.problem import ContactProblem
from tcstudy.contact.solution import Linearised
from tcstudy.contact.solve import solve_contact
from tcstudy.laws.composed import law_slopes
from tcstudy.laws.laws import Laws
from tcstudy.laws.shapes import SHAPES


def softening(tau_s: float = 1.0, tau_k: float = 0.4, delta: float = 0.5) -> Laws:
    return SHAPES["slip-weakening"].build(tau_s=tau_s, tau_k=tau_k, delta=delta)


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
