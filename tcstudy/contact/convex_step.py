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
    """The minimum of the model at v (m,), None if b nowhere rises or the iteration fails.

    Nodes on an up-jump at the minimum are put on it bitwise.
    """
    law, c, index = problem.law, problem.c, problem.law.node_index(problem.m)
    if not any(np.any(law.laws[k].kinds == UP) or np.ptp(np.maximum(law.laws[k].q, 0.0)) for k in np.unique(index)):
        return None
    (s, h, gamma, sign, kink), slope = _by_node(law, index)
    descent = slopes(problem, v, problem.xi(v)).descent
    piece = np.where(descent <= 0.0, law.piece(v, +1), law.piece(v, -1))
    own = piece if law.one else piece - law.tables.first[index]
    with np.errstate(divide="ignore", invalid="ignore"):
        force = np.where(gamma > 0.0, np.clip(sign * (v - s) / gamma, 0.0, h), np.where(kink < own, h, 0.0))
    rest = law.value(v, piece) - (slope * v + np.sum(sign * force, axis=0))
    matrix, load = problem.A_tilde.copy(), problem.l_tilde - c * rest
    diagonal = matrix.reshape(-1)[:: len(v) + 1]
    diagonal += c * slope
    capped = np.isfinite(h)
    both = np.stack([np.ones(h.shape), capped])  # of e with x⁻ and, where there is a cap, of h − e with x⁺
    size = float(np.max(np.abs(h[capped]), initial=0.0)) or problem.traction_scale
    reach = float(np.max(np.abs(problem.l_tilde) + c * size) / np.min(diagonal))
    reach = max(float(np.max(np.abs(v - s))), reach if np.isfinite(reach) else 0.0)
    w, e = v.copy(), np.where(capped, 0.5 * h, size)
    x = np.stack([e, np.where(capped, h - e, 1.0)])  # h − e is a variable of its own, as it would lose its digits
    gap = sign * (v - s) - gamma * e
    y = np.stack([np.maximum(-gap, 0.0) + reach, np.where(capped, np.maximum(gap, 0.0) + reach, 0.0)])
    kinds = 1.0 + float(np.mean(capped))
    first = mu = float(np.sum(x[0] * y[0]) + np.sum(x[1] * y[1])) / (e.size * kinds)  # x⁺ = 0 without a cap
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
            after = float(
                np.sum((x[0] + length * dx[0]) * (y[0] + length * dy[0]))
                + np.sum((x[1] + length * dx[1]) * (y[1] + length * dy[1]))
            )
            target = both * (mu * min(1.0, after / (mu * e.size * kinds)) ** 3 - x * y - dx * dy)  # of the corrector
        if not (length > 1e-6 and np.all(np.isfinite(dw))):
            break
        w, x, y = w + length * dw, x + length * dx, y + length * dy
        mu = float(np.sum(x[0] * y[0]) + np.sum(x[1] * y[1])) / (e.size * kinds)
    if not mu <= 1e-3 * first:
        return None
    reach = max(float(np.max(np.abs(w - s))), float(np.finfo(float).tiny))
    row, node = np.nonzero((kink >= 0) & np.all(y < x / h * reach, axis=0))
    w[node] = np.broadcast_to(s, h.shape)[row, node]
    return w


def _by_node(law: Laws, index: NDArray[np.intp]) -> tuple[Array, Array]:
    """(s, h, γ, sign, kink) of the elements of b_↑ at every node (5, n, m), and the least slopes (m,).

    sign: −1 for the outer piece on the left, whose slip counts to the left;  kink: index of the kink of an up-jump, −1
    A node with fewer elements than others has some of sign 0 and of the scale of b, which act on nothing.
    """
    own = [_elements(one) for one in law.laws]
    most = max(len(rows) for rows, _ in own)
    padded = np.tile([[0.0], [law.b_scale or 1.0], [0.0], [0.0], [-1.0]], (most, 1, len(index)))
    for k, (rows, _) in enumerate(own):
        padded[: len(rows), :, index == k] = np.array(rows).reshape(len(rows), 5, 1)
    return padded.transpose(1, 0, 2), np.array([least for _, least in own])[index]


def _elements(law: Laws) -> tuple[list[tuple[float, float, float, float, int]], float]:
    """(s, h, γ, sign and kink of every element, least slope) of a law; exponential pieces rise from end to end."""
    kinks, last = law.kinks, len(law.kinks)
    rise = np.maximum(law.q, 0.0)
    for piece in np.flatnonzero(law.bent):
        if 0 < piece < last:
            ends = law.value(kinks[piece - 1 : piece + 1], np.full(2, piece))
            rise[piece] = max(0.0, float(ends[1] - ends[0]) / float(kinks[piece] - kinks[piece - 1]))
    least = float(rise.min())
    rows = []
    for k in np.flatnonzero(law.kinds == UP):
        rows.append((float(kinks[k]), float(law.b_right[k] - law.b_left[k]), 0.0, 1.0, int(k)))
    for piece in np.flatnonzero(rise > least):
        steeper = float(rise[piece]) - least
        outer = piece in (0, last)
        height = np.inf if outer else steeper * float(kinks[piece] - kinks[piece - 1])
        left = piece == 0
        rows.append((float(kinks[0 if left else piece - 1]), height, 1.0 / steeper, -1.0 if left else 1.0, -1))
    return rows, least
