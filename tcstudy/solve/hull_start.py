"""A start from the convexified problem, by graduated nonconvexity along the proximal hulls of the law.

With b_κ (proximal_hull) and κ below λ₁ the problem is convex: one solution, whatever the start, which sees all wells of
j at once where descent from a point sees its own. Then κ grows by a fixed factor, each problem starting from the
solution of the one before, until b_κ is b at all nodes, or until κ is the stiffness of a single node, from where on
wells can no longer merge but node by node. (Blake & Zisserman, Visual Reconstruction, MIT Press 1987, for a
piecewise quadratic energy; the hulls are those of the law itself.)

What comes out is a start: it need not have the least energy, and the original problem is solved from it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from tcstudy.solve.outcome import Outcome
from tcstudy.solve.problem import ContactProblem
from tcstudy.solve.proximal_hull import proximal_hull

Array = NDArray[np.float64]

GROWTH = 4.0
"""Factor from one κ to the next. Of 486 problems 2, 4, 8 left 9, 11, 22 above the lowest energy known, before moves
of single nodes; 92 were above it before."""
_BELOW, _ITERATIONS, _TURNS = 0.9, 4, np.array([0.0, 2.0, 0.7])
"""First κ over the estimate of λ₁; steps of that estimate, and angles that draw the vectors it begins with."""


@dataclass(frozen=True)
class HullStart:
    """v: (m,) displacements to start from.

    lowest: the first, convex problem had b_κ = b at its solution, which then has the least energy of the original one,
            too (as far as the estimate of λ₁ and the hull are exact)
    """

    v: Array
    lowest: bool


def hull_start(
    problem: ContactProblem, x0: Array, lambda_1: float, solve: Callable[[ContactProblem, Array], Outcome]
) -> HullStart:
    """Solve the convexified problems one after the other.

    x0:       (m,) where the first one begins; its solution does not depend on it, the work does
    lambda_1: about λ₁; only the first problem's convexity hangs on it
    solve:    solves one convexified problem from a start; no accuracy is needed
    """
    v, kappa, first = x0, _BELOW * lambda_1, True
    stiffest = min(problem.law.omega, float(np.max(np.diagonal(problem.A_tilde) / problem.c)))
    while True:
        law, bridges = proximal_hull(problem.law, kappa)
        outcome = solve(replace(problem, law=law), v)
        v, kappa = outcome.x, GROWTH * kappa
        settled = not np.any(_on_bridge(bridges, v))
        if settled or kappa >= stiffest:
            return HullStart(v, first and settled and outcome.converged)
        first = False


def estimate_lambda_1(problem: ContactProblem) -> float:
    """λ₁ from above, to a few per cent, by inverse iteration of a small subspace [Pa/m].

    It begins with a rigid slip, which nearly is the softest mode of most bodies, and with vectors that look random,
    because where neighbours push each other apart the softest mode may be perpendicular to it. A factorisation and a
    few solves, where the exact value takes an eigenvalue solver.
    """
    factor = scipy.linalg.cho_factor(problem.A_tilde, lower=True, check_finite=False)
    root = np.sqrt(problem.c)[:, None]
    x, softness = root * np.cos(np.outer(np.arange(problem.m) ** 2, _TURNS)), np.eye(1)
    for _ in range(_ITERATIONS):
        x = np.linalg.qr(x)[0]
        y = root * scipy.linalg.cho_solve(factor, root * x, check_finite=False)
        softness = x.T @ y
        x = y
    return 1.0 / float(np.linalg.eigvalsh(softness)[-1])


def _on_bridge(bridges: Array, v: Array) -> NDArray[np.bool_]:
    """Nodes strictly inside a bridge, where b_κ is not b (m,)."""
    if not len(bridges):
        return np.zeros(len(v), dtype=bool)
    i = np.maximum(np.searchsorted(bridges[:, 0], v, side="left") - 1, 0)
    return (bridges[i, 0] < v) & (v < bridges[i, 1])
