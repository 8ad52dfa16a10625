"""Nonsmooth problems of any size with known minima: the scalable ones of the literature, and random convex ones.

Literature: Lukšan & Vlček, TR-798, Institute of Computer Science, Prague (2000), problems 22 to 24 (Goffin, MXHILB,
L1HILB); Haarala, Miettinen & Mäkelä, New limited memory bundle method for large-scale nonsmooth optimization,
Optim. Methods Softw. 19 (2004) 673–692, problems 1 to 10. In the random ones a point is chosen first and then the
pieces, such that it satisfies the optimality condition 0 ∈ ∂f exactly.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .tr798 import Oracle, Piece, crescent, largest, lq, maxl, maxq, quadratic

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Problem:
    """An oracle with its start and its least value."""

    name: str
    oracle: Oracle
    x0: Array
    f_star: float


def hilbert(rows: int, columns: int) -> Array:
    """1/(i + j − 1): numerically of rank 20 at most."""
    return 1.0 / (np.arange(rows)[:, None] + np.arange(columns) + 1.0)


def affine_maximum(A: Array, b: Array, x: Array) -> Piece:
    """max_j a_jᵀx + b_j."""
    values = A @ x + b
    j = int(np.argmax(values))
    return float(values[j]), A[j], np.zeros((len(x), len(x)))


def sum_of_moduli(A: Array, b: Array, x: Array) -> Piece:
    """Σ_i |a_iᵀx − b_i|."""
    r = A @ x - b
    return float(np.sum(np.abs(r))), np.sign(r) @ A, np.zeros((len(x), len(x)))


def chain(x: Array, link: Callable[[Array], Piece]) -> Piece:
    """Σ_i link(x_i, x_{i+1})."""
    f, g, G = 0.0, np.zeros(len(x)), np.zeros((len(x), len(x)))
    for i in range(len(x) - 1):
        value, slope, bend = link(x[i : i + 2])
        f, two = f + value, slice(i, i + 2)
        g[two] += slope
        G[two, two] += bend
    return f, g, G


def quartic(x: Array) -> Piece:
    return x[0] ** 4 + x[1] ** 2, np.array([4 * x[0] ** 3, 2 * x[1]]), np.diag([12 * x[0] ** 2, 2.0])


def bowl(x: Array) -> Piece:
    return quadratic(x, 2 * np.eye(2), np.array([-4.0, -4.0]), 8.0)


def exponential(x: Array) -> Piece:
    e = 2 * np.exp(x[1] - x[0])
    return float(e), e * np.array([-1.0, 1.0]), e * np.array([[1.0, -1.0], [-1.0, 1.0]])


CB3 = (quartic, bowl, exponential)


def published(n: int = 50) -> list[Problem]:
    """The scalable problems, n even."""
    H, one, i = hilbert(n, n), np.ones(n), np.arange(1.0, n + 1.0)
    climb, crescent0 = np.where(i <= n / 2, i, -i), np.tile([-1.5, 2.0], n // 2)
    return [
        Problem("Goffin", lambda x: affine_maximum(n * np.eye(n) - 1.0, np.zeros(n), x), i - (n + 1) / 2, 0.0),
        Problem("MXHILB", lambda x: affine_maximum(np.vstack([H, -H]), np.zeros(2 * n), x), one, 0.0),
        Problem("L1HILB", lambda x: sum_of_moduli(H, np.zeros(n), x), one, 0.0),
        Problem("Maxq", maxq, climb, 0.0),
        Problem("Maxl", maxl, climb, 0.0),
        Problem("chained LQ", lambda x: chain(x, lq), -0.5 * one, -(n - 1) * np.sqrt(2.0)),
        Problem("chained CB3 I", lambda x: chain(x, lambda y: largest([p(y) for p in CB3])), 2 * one, 2.0 * (n - 1)),
        Problem("chained CB3 II", lambda x: largest([chain(x, p) for p in CB3]), 2 * one, 2.0 * (n - 1)),
        Problem("chained Crescent II", lambda x: chain(x, crescent), crescent0, 0.0),
    ]


def slopes(rng: np.random.Generator, N: int, n: int) -> Array:
    """(N, n) slopes: of full rank, of low rank, Hilbert-like with either sign, or these with rows of other sizes."""
    kind = int(rng.integers(4))
    if kind == 0:
        A = rng.standard_normal((N, n))
    elif kind == 1:
        rank = int(rng.integers(1, max(2, n // 3) + 1))
        A = rng.standard_normal((N, rank)) @ rng.standard_normal((rank, n))
    else:
        A = hilbert(N, n) * rng.choice([-1.0, 1.0], (N, 1))
    return A * 10.0 ** rng.uniform(-1.5, 1.5, (N, 1)) if kind == 3 else A


def random_maximum(rng: np.random.Generator, n: int, curved: bool) -> Problem:
    """max_j ½(x−z)ᵀG_j(x−z) + a_jᵀ(x−z) + b_j, least at z: b_j = f* and Σλ_ja_j = 0 there for some of the pieces."""
    N = int(rng.integers(2, 2 * n + 3))
    A, z = slopes(rng, N, n), rng.standard_normal(n)
    active = int(rng.integers(1, N))
    lam = rng.random(active) + 0.1
    A[active - 1] = -(lam[:-1] @ A[: active - 1]) / lam[-1]
    size, f_star = float(np.max(np.abs(A))) or 1.0, float(rng.standard_normal())
    b = f_star - size * np.concatenate([np.zeros(active), rng.random(N - active) + 1e-3])
    roots = rng.standard_normal((N, n, int(rng.integers(1, n + 1)))) if curved else np.zeros((N, n, 1))
    roots *= np.sqrt(size) * 10.0 ** rng.uniform(-1.5, 0.5, (N, 1, 1)) / n

    def oracle(x: Array) -> Piece:
        d = x - z
        bent = np.einsum("jik,i->jk", roots, d)
        values = 0.5 * np.sum(bent**2, axis=1) + A @ d + b
        j = int(np.argmax(values))
        return float(values[j]), A[j] + roots[j] @ bent[j], roots[j] @ roots[j].T

    return Problem(f"max of {N} pieces", oracle, z + rng.standard_normal(n), f_star)


def random_moduli(rng: np.random.Generator, n: int) -> Problem:
    """Σ_i |a_iᵀ(x−z) − e_i|, least at z: e_i ≠ 0 in the last row only, which balances Σμ_ia_i, |μ_i| < 1."""
    N = int(rng.integers(2, 2 * n + 3))
    A, z, e = slopes(rng, N, n), rng.standard_normal(n), np.zeros(N)
    A[-1] = rng.uniform(-0.9, 0.9, N - 1) @ A[:-1]
    e[-1] = float(np.max(np.abs(A))) or 1.0
    x0 = z + rng.standard_normal(n)
    return Problem(f"sum of {N} moduli", lambda x: sum_of_moduli(A, e, x - z), x0, float(e[-1]))


def random_problem(seed: int) -> Problem:
    """A maximum of affine or quadratic pieces or a sum of moduli, n = 2 … 100."""
    rng = np.random.default_rng([seed, 798])
    n = int(np.exp(rng.uniform(np.log(2), np.log(100.99))))
    return random_moduli(rng, n) if seed % 3 == 2 else random_maximum(rng, n, curved=seed % 3 == 1)
