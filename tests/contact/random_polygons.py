"""Random contact problems with piecewise-linear laws by node, and all their solutions by trying
every piece and kink.

Shares nothing with the solvers: one linear system for every choice of a piece or a kink a node.
"""

from itertools import product

import numpy as np
from numpy.typing import NDArray

from tcstudy.contact.problem import ContactProblem
from tcstudy.laws.composed import nodal
from tcstudy.laws.laws import Laws
from tcstudy.matrices import law

Array = NDArray[np.float64]
NEAR = 1e-9
"""Shares of a piece, or of a jump, within which a solution counts as on its end."""


def random_law(rng: np.random.Generator, has_jumps: bool = True) -> Laws:
    """An odd law of up to three pieces, falling and rising, with jumps both ways, or at 0 alone."""
    s, b = 0.0, float(rng.uniform(0.2, 1.0))
    points = [(s, b)]
    for _ in range(rng.integers(1, 4)):
        if has_jumps and rng.random() < 0.4 and s > 0.0:
            points.append((s, float(rng.uniform(0.05, 1.0))))
        s, b = s + float(rng.uniform(0.05, 0.6)), float(rng.uniform(0.05, 1.0))
        points.append((s, b))
    return law(points=points)


def random_problem(seed: int, m: int, has_jumps: bool = True) -> tuple[ContactProblem, Array]:
    """(problem, load per s): M-matrices for odd seeds, any positive definite matrix for even
    ones."""
    rng = np.random.default_rng([seed, m])
    B = rng.normal(size=(m, m))
    A = B @ B.T + rng.uniform(0.05, 1.0) * np.eye(m)
    if seed % 2:
        A = np.diag(np.abs(A).sum(1)) * rng.uniform(1.0, 1.3) - np.abs(A) + 0.1 * np.eye(m)
    laws = nodal([random_law(rng, has_jumps) for _ in range(m)], np.arange(m))
    c, load, per_s = rng.uniform(0.3, 2.0, m), rng.normal(0.0, 1.5, m), rng.normal(0.0, 2.5, m)
    return ContactProblem(A, load, c, laws), per_s


def by_brute_force(
    problem: ContactProblem, per_s: Array | None = None, minima: bool = False
) -> tuple[Array, Array, float]:
    """(v, rows, nearest): all solutions (S, m) at the load; or at the ends of all segments (S, 2,
    m) for s in [0, 1].

    per_s:   (m,) load per s; then `rows` are the (S, 2) parameters of the ends of every segment
    minima:  leave out down-jumps and bends, where no minimum is but as one of a piece, to rounding
    nearest: least distance of a solution from the end of a piece, below NEAR if one is degenerate
    """
    m, laws = problem.m, [problem.law.single(i) for i in range(problem.m)]
    places = [
        [
            *range(len(x.q)),
            *(
                len(x.q) + k
                for k in range(len(x.kinks))
                if not minima or x.b_right[k] > x.b_left[k]
            ),
        ]
        for x in laws
    ]
    ends: list[
        list[tuple[float, float]]
    ] = []  # of the unknown of every place: v on a piece, ζ on a kink
    for x in laws:
        edge = np.concatenate([[-1e9], x.kinks, [1e9]])
        jumps = np.sort(np.stack([x.b_left, x.b_right]), axis=0)
        ends.append([(edge[k], edge[k + 1]) for k in range(len(x.q))] + [tuple(j) for j in jumps.T])
    found, rows, nearest = [], [], np.inf
    choices = np.array(list(product(*places)))
    for some in np.array_split(choices, max(1, len(choices) // 50_000)):
        M, rhs = np.empty((len(some), m, m)), np.tile(problem.l_tilde, (len(some), 1))
        low, high = (
            np.array([[e[k][side] for k in range(len(e))] for e in _padded(ends)])
            for side in (0, 1)
        )
        for i, x in enumerate(laws):
            count, k = len(x.q), some[:, i]
            kink, piece = k >= count, np.minimum(k, count - 1)
            at = x.kinks[np.where(kink, k - count, 0)] if len(x.kinks) else np.zeros(len(k))
            unit = problem.c[i] * np.eye(m)[i]
            M[:, :, i] = np.where(
                kink[:, None], unit, problem.A_tilde[:, i] + x.q[piece, None] * unit
            )
            rhs -= np.where(
                kink[:, None],
                at[:, None] * problem.A_tilde[:, i],
                (x.b_0 - x.q * x.s_0)[piece, None] * unit,
            )
        low, high = (
            np.stack([side[i, some[:, i]] for i in range(m)], axis=-1) for side in (low, high)
        )
        regular = np.abs(np.linalg.det(M / np.max(np.abs(M), axis=1, keepdims=True))) > 1e-13
        M, rhs, low, high, some = (
            M[regular],
            rhs[regular],
            low[regular],
            high[regular],
            some[regular],
        )
        x_0 = np.linalg.solve(M, rhs[..., None])[..., 0]
        if per_s is None:
            room = np.minimum((x_0 - low), (high - x_0)).min(-1)
            nearest = min(nearest, float(np.abs(room).min(initial=np.inf)))
            inside = room > (-1e-11 if minima else 0.0)
            for x, k in zip(x_0[inside], some[inside], strict=True):
                found.append(
                    [
                        x[i] if k[i] < len(a.q) else a.kinks[k[i] - len(a.q)]
                        for i, a in enumerate(laws)
                    ]
                )
            continue
        way = np.linalg.solve(M, np.broadcast_to(per_s[:, None], (*rhs.shape, 1)))[..., 0]
        with np.errstate(divide="ignore", invalid="ignore"):
            a, b = (low - x_0) / way, (high - x_0) / way
        begin = np.maximum(np.minimum(a, b).max(-1), 0.0)
        end = np.minimum(np.maximum(a, b).min(-1), 1.0)
        nearest = min(nearest, float((end - begin)[end > begin + NEAR].min(initial=np.inf)))
        rows += [pair for pair in zip(begin, end, strict=True) if pair[1] > pair[0] + NEAR]
    return np.array(found).reshape(-1, m), np.array(rows).reshape(-1, 2), nearest


def _padded(ends: list[list[tuple[float, float]]]) -> list[list[tuple[float, float]]]:
    most = max(map(len, ends))
    return [[*e, *[e[-1]] * (most - len(e))] for e in ends]
