"""ξ = l̃ − Ãv and c b(v) − ξ in about twice double precision, with v kept as a sum of two doubles.

Where friction is small against the forces in the body, ξ is a small difference of large numbers:
double precision leaves fewer digits than a solution is asked for, and so does v rounded to one
double. Extended types are no wider than double on some platforms, so everything here is built of
operations on IEEE doubles that are free of error:
    sums       a + b = s + e,  s = fl(a + b)  (Knuth's TwoSum)
    products   ab = p + e,  p = fl(ab)  (Dekker's TwoProduct); matrix and vector are cut into slices of so few bits
               (Veltkamp's splitting, a row at a time) that every product of two slices is exact in
               double precision,
               in whatever order the BLAS adds it up
Literature: Ogita, Rump & Oishi, SIAM J. Sci. Comput. 26 (2005) 1955–1988; Ozaki, Ogita, Oishi &
Rump, Numer. Algorithms 59 (2012) 95–118. Left out: numbers beyond 1e290 or below 1e-290, whose
parts are no longer doubles.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_SLICES = 3
"""Slices of about 21 bits each; what a fourth would hold is small enough to be multiplied in double
precision."""
_BLOCK = 16_384
"""Entries of a matrix that are worked on at a time; the temporaries of as many fit a cache."""


def two_sum(a: Array, b: Array) -> tuple[Array, Array]:
    """(s, e) with s = fl(a + b) and s + e = a + b exactly."""
    s = a + b
    t = s - a
    return s, (a - (s - t)) + (b - t)


def two_product(a: Array, b: Array) -> tuple[Array, Array]:
    """(p, e) with p = fl(ab) and p + e = ab exactly."""
    p, halves = a * b, []
    for x in (a, b):
        t = 134_217_729.0 * x  # 2²⁷ + 1
        halves.append((t - (t - x), x - (t - (t - x))))
    (a_1, a_2), (b_1, b_2) = halves
    return p, a_2 * b_2 - (((p - a_1 * b_1) - a_2 * b_1) - a_1 * b_2)


def extended_residual(
    rhs: Array, matrix: Array, v: Array, v_low: Array | None = None
) -> tuple[Array, Array]:
    """rhs − matrix (v + v_low) as a sum of two doubles, of which the first is the sum rounded once
    (n,) each.

    matrix: (n, m);  v: (m,);  v_low: (m,) low part of v, at most half a unit in the last place of v; None for 0

    Its error is about m 2⁻¹⁰⁰ of the largest terms. It costs about a hundred
    products with the matrix in double precision.
    """
    n, m = matrix.shape
    if m == 0:
        return np.array(rhs, dtype=float), np.zeros(n)
    bits = (53 - int(m).bit_length()) // 2
    *parts, rest = _slices(v[None, :], bits)
    v_slices = np.concatenate([*parts, rest if v_low is None else rest + v_low]).T
    terms = np.empty((n, (_SLICES + 1) ** 2))
    rows = max(1, _BLOCK // m)
    for first in range(0, n, rows):
        pieces = _slices(matrix[first : first + rows], bits)
        np.concatenate(
            [piece @ v_slices for piece in pieces], axis=1, out=terms[first : first + rows]
        )
    high, low = np.asarray(rhs, dtype=float), np.zeros(n)
    for term in np.ascontiguousarray(terms.T):
        high, error = two_sum(high, -term)
        low += error
    return two_sum(high, low)


def friction_defect(
    parts: tuple[Array, ...], c: Array, v: tuple[Array, Array], xi: tuple[Array, Array]
) -> tuple[Array, Array]:
    """(c b(v) − ξ, rounded once, and what the rounding of exponentials leaves open in it), (m,)
    each [N/m].

    parts: (s_0, b_0, q, a, r, …) of every node's piece;  v, xi: sums of two doubles
    """
    s_0, b_0, q, *exponentials = parts
    apart, low = two_sum(v[0], -s_0)
    apart, low = two_sum(apart, low + v[1])
    linear, rest = two_product(q, apart)
    total, error = two_sum(b_0, linear)
    rest = rest + error + q * low
    decays = np.zeros_like(total)
    for a, r in zip(exponentials[::2], exponentials[1::2], strict=True):
        exponent, more = two_product(r, apart)
        with np.errstate(over="ignore", invalid="ignore"):
            decay = np.where(a == 0.0, 0.0, a * np.exp(-exponent))
            decay_rest = np.where(a == 0.0, 0.0, -decay * (more + r * low))
        total, error = two_sum(total, decay)
        rest = rest + error + decay_rest
        decays += np.abs(decay)
    force, error = two_product(c, total)
    high, other = two_sum(force, -xi[0])
    return high + (other + (error + c * rest - xi[1])), 4.0 * np.finfo(float).eps * c * decays


def _slices(rows: Array, bits: int) -> list[Array]:
    """The rows as a sum of _SLICES matrices of at most `bits` bits below each row's largest number,
    and the rest."""
    _, exponent = np.frexp(np.max(np.abs(rows), axis=1, keepdims=True))
    found, rest = [], rows
    for _ in range(_SLICES):
        rounder = np.ldexp(
            1.5, exponent - bits + 52
        )  # adding it rounds to multiples of 2^(exponent − bits)
        found.append((rest + rounder) - rounder)
        rest = rest - found[-1]
        exponent = exponent - bits - 1
    return [*found, rest]
