"""A step to the minimum of a convex model of L̃ that knows all rising pieces and up-jumps of b, by interior points.

Newton's steps and the moves of single nodes settle few nodes at a time where the body couples all of them strongly (Ã
dense and badly conditioned); an interior point method settles all together, in some twenty factorisations whatever
their number. The model at v: b = b_↑ + rest, where b_↑ has the up-jumps of b and its slopes where they are positive,
and the rest, which only falls, stays what it is at v:

    min over w  ½wᵀÃw − (l̃ − c·rest)ᵀw + Σ c_i j_↑(w_i)

For a law that nowhere falls this is the problem itself; else −j of the rest bends up, so that the model lies above L̃
and its minimum is no higher than v. The law b_↑ is a sum of elements: a line of the least slope, and for each up-jump
or steeper piece a force e in [0, h] that grows as the slip passes s:

    w_i − s = γ e + x⁺ − x⁻,   0 ≤ e ⟂ x⁻ ≥ 0,   0 ≤ h − e ⟂ x⁺ ≥ 0      (γ = 0 for a jump, 1/slope for a piece)

Method: Mehrotra's predictor and corrector, SIAM J. Optim. 2 (1992) 575–601; e and x are eliminated, so that each step
costs one Cholesky factor of Ã plus a diagonal.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from tcstudy.contact.factors import cholesky
from tcstudy.contact.newton import slopes
from tcstudy.contact.problem import ContactProblem
from tcstudy.laws.laws import Laws
from tcstudy.laws.pieces import UP

Array = NDArray[np.float64]

_STEPS = 80
_TO_BOUNDARY = 0.995
_SMALL = 1e-14
"""Most steps, how far each goes towards the boundary, and the complementarity, relative to its first, that ends it."""


def convex_step(problem: ContactProblem, v: Array) -> Array | None:
    """The minimum of the model at v (m,), None if the iteration fails.

    Nodes on an up-jump at the minimum are put on it bitwise.
    """
    law, c, index = problem.law, problem.c, problem.law.node_index(problem.m)
    (s, h, gamma, sign, kink), slope = _elements(law.tables, index)
    descent = slopes(problem, v, problem.xi(v)).descent
    piece = np.where(descent <= 0.0, law.piece(v, +1), law.piece(v, -1))
    own = piece if law.one else piece - law.tables.first[index]
    with np.errstate(divide="ignore", invalid="ignore"):
        force = np.where(gamma > 0.0, np.clip(sign * (v - s) / gamma, 0.0, h), np.where(kink < own, h, 0.0))
    rest = law.value(v, piece) - (slope * v + np.sum(sign * force, axis=0))
    matrix, load = problem.A_tilde.copy(), problem.l_tilde - c * rest
    diagonal = matrix.reshape(-1)[:: len(v) + 1]
    diagonal += c * slope
    if not len(s):
        _, w, info = scipy.linalg.lapack.dposv(matrix, load, lower=1)
        return w if info == 0 else None
    capped = np.isfinite(h)
    both = np.stack([np.ones(h.shape), capped])  # of e with x⁻ and, where there is a cap, of h − e with x⁺
    size = float(np.max(np.abs(h[capped]), initial=0.0)) or problem.traction_scale
    reach = float(np.max(np.abs(problem.l_tilde) + c * size) / np.min(diagonal))
    reach = max(float(np.max(np.abs(v - s))), reach if np.isfinite(reach) else 0.0)
    w, e = v.copy(), np.where(capped, 0.5 * h, size)
    # h − e is a variable of its own, as it would lose its digits; without a cap x⁺ = 0, here y = 0 beside an x of 1
    x = np.stack([e, np.where(capped, h - e, 1.0)])
    gap = sign * (v - s) - gamma * e
    y = np.stack([np.maximum(-gap, 0.0) + reach, np.where(capped, np.maximum(gap, 0.0) + reach, 0.0)])
    kinds = 1.0 + float(np.mean(capped))
    first = mu = float(np.sum(x * y)) / (e.size * kinds)
    for _ in range(_STEPS):
        if mu <= _SMALL * first:
            break
        theta = gamma + y[1] / x[1] + y[0] / x[0]
        balance, gap = load - matrix @ w - c * np.sum(sign * x[0], axis=0), sign * (w - s) - gamma * x[0] - y[1] + y[0]
        lifted = matrix.copy()
        lifted.reshape(-1)[:: len(v) + 1] += c * np.sum(sign**2 / theta, axis=0)
        factor, info = cholesky(lifted)
        if info != 0:
            break
        target = -both * x * y  # of the predictor: x y → x y + target
        for share in (1.0, _TO_BOUNDARY):
            known = gap - target[1] / x[1] + target[0] / x[0]
            rhs = balance - c * np.sum(sign * known / theta, axis=0)
            dw = scipy.linalg.lapack.dpotrs(factor, rhs, lower=1)[0]
            de = (sign * dw + known) / theta
            dx, dy = np.stack([de, np.where(capped, -de, 0.0)]), (target - y * np.stack([de, -de])) / x
            with np.errstate(divide="ignore", invalid="ignore"):
                ends = [np.where(d < 0.0, -share * z / d, 1.0) for z, d in ((x, dx), (y, dy))]
            length = min(1.0, float(np.min(ends)))
            after = float(np.sum((x + length * dx) * (y + length * dy)))
            target = both * (mu * min(1.0, after / (mu * e.size * kinds)) ** 3 - x * y - dx * dy)  # of the corrector
        if not (length > 1e-6 and np.all(np.isfinite(dw))):
            break
        w, x, y = w + length * dw, x + length * dx, y + length * dy
        mu = float(np.sum(x * y)) / (e.size * kinds)
    if not mu <= 1e-3 * first:
        return None
    reach = max(float(np.max(np.abs(w - s))), float(np.finfo(float).tiny))
    row, node = np.nonzero((kink >= 0) & np.all(y < x / h * reach, axis=0))
    w[node] = np.broadcast_to(s, h.shape)[row, node]
    return w


def _elements(laws: Laws, index: NDArray[np.intp]) -> tuple[list[Array], Array]:
    """(s, h, γ, sign, kink) of the elements of b_↑ at every node (n, m) each, and the least slopes (m,).

    laws: tables;  sign: −1 for the outer piece on the left, whose slip counts to the left;  kink: of an up-jump its
    index, −1 for a piece. Exponential pieces rise from end to end. A node with fewer elements than others has some of
    sign 0 and of the scale of b, which act on nothing.
    """
    low, high, up = laws.lower, laws.upper, laws.kinds == UP
    outer = ~(np.isfinite(low) & np.isfinite(high))
    ends = [np.where(outer, laws.s_0, s) for s in (low, high)]
    width, start, end = np.where(outer, 1.0, ends[1] - ends[0]), *(laws.value(s, laws.addresses) for s in ends)
    rise = np.maximum(np.where(laws.bent & ~outer, (end - start) / width, laws.q), 0.0)
    least = np.min(rise, axis=1, keepdims=True)
    rises, steeper = (rise > least) & (low < high), np.where(rise > least, rise - least, 1.0)
    sign = np.where(np.isfinite(low), 1.0, -1.0)
    jumps: tuple[Any, ...] = laws.kinks, laws.b_right - laws.b_left, np.zeros(up.shape), 1.0, np.arange(up.shape[1])
    pieces: tuple[Any, ...] = (
        np.where(np.isfinite(low), low, high),
        np.where(outer, np.inf, steeper * width),
        1.0 / steeper,
        sign,
        -1.0,
    )
    found, none = [], (0.0, laws.at(index).b_scale or 1.0, 0.0, 0.0, -1.0)
    used = np.any(np.append(up, rises, axis=1)[np.unique(index)], axis=0)
    for of_jump, of_piece, nothing in zip(jumps, pieces, none, strict=True):
        column = np.append(np.where(up, of_jump, nothing), np.where(rises, of_piece, nothing), axis=1)
        found.append(column[:, used][index].T)
    return found, least[index, 0]
