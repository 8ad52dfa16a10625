"""ξ = l̃ − Ãv and c b(v) − ξ in about twice double precision, with v as a sum of two doubles.

Where friction is small against the forces in the body, ξ is a small difference of large numbers.
Double precision then leaves fewer digits than a solution needs, and so does v rounded to one
double. Extended types are no wider than double on some platforms, so everything here is built of
operations on IEEE doubles that are free of error:
    sums       a + b = s + e,  s = fl(a + b)  (Knuth's TwoSum)
    products   ab = p + e,  p = fl(ab)  (Dekker's TwoProduct); matrix and vector are cut into slices
               of so few bits (Veltkamp's splitting, a row at a time) that every product of two
               slices is exact in double precision, in whatever order the BLAS adds it up
Literature: Ogita, Rump & Oishi, SIAM J. Sci. Comput. 26 (2005) 1955–1988; Ozaki, Ogita, Oishi &
Rump, Numer. Algorithms 59 (2012) 95–118. Left out: numbers beyond 1e290 or below 1e-290, whose low
parts are not doubles.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_SLICES = 3
"""Slices of about 21 bits each; double precision is enough for products with the remainder."""
_BLOCK_ENTRIES = 16_384
"""Entries of a matrix that are worked on at a time; the temporaries of as many fit a cache."""


def two_sum(a: Array, b: Array) -> tuple[Array, Array]:
    """Return (s, e) with s = fl(a + b) and s + e = a + b exactly."""
    s = a + b
    b_part = s - a
    return s, (a - (s - b_part)) + (b - b_part)


def two_product(a: Array, b: Array) -> tuple[Array, Array]:
    """Return (p, e) with p = fl(ab) and p + e = ab exactly."""
    p = a * b
    a_1, a_2 = _halves(a)
    b_1, b_2 = _halves(b)
    return p, a_2 * b_2 - (((p - a_1 * b_1) - a_2 * b_1) - a_1 * b_2)


def _halves(x: Array) -> tuple[Array, Array]:
    """Return (high, low) of 26 bits each with high + low = x."""
    scaled = 134_217_729.0 * x  # 2²⁷ + 1
    high = scaled - (scaled - x)
    return high, x - high


def extended_residual(
    rhs: Array, matrix: Array, v: Array, v_low: Array | None = None
) -> tuple[Array, Array]:
    """Return rhs − matrix (v + v_low) as two doubles, the first being their sum, rounded once.

    Its error is about m 2⁻¹⁰⁰ of the largest terms. It costs about a hundred products with the
    matrix in double precision.

    matrix: (n, m);  v: (m,)
    v_low:  (m,) low part of v, at most half a unit in the last place of v; None for 0
    """
    n, m = matrix.shape
    if m == 0:
        return np.array(rhs, dtype=float), np.zeros(n)
    bits = (53 - int(m).bit_length()) // 2
    *v_parts, v_remainder = _slices(v[None, :], bits)
    if v_low is not None:
        v_remainder = v_remainder + v_low
    v_slices = np.concatenate([*v_parts, v_remainder]).T
    terms = np.empty((n, (_SLICES + 1) ** 2))
    block_rows = max(1, _BLOCK_ENTRIES // m)
    for first in range(0, n, block_rows):
        block = slice(first, first + block_rows)
        products = [part @ v_slices for part in _slices(matrix[block], bits)]
        np.concatenate(products, axis=1, out=terms[block])
    high = np.asarray(rhs, dtype=float)
    low = np.zeros(n)
    for term in np.ascontiguousarray(terms.T):
        high, error = two_sum(high, -term)
        low += error
    return two_sum(high, low)


def friction_defect(
    numbers: tuple[Array, ...], c: Array, v: tuple[Array, Array], xi: tuple[Array, Array]
) -> tuple[Array, Array]:
    """Return (c b(v) − ξ, rounded once, and what rounding of exponentials hides), (m,) [N/m].

    numbers: (s_0, b_0, q, a, r, …) of the piece of every node
    v, xi:   sums of two doubles
    """
    s_0, b_0, q, *exponentials = numbers
    v_high, v_low = v
    xi_high, xi_low = xi
    distance, distance_low = two_sum(v_high, -s_0)
    distance, distance_low = two_sum(distance, distance_low + v_low)
    linear, linear_low = two_product(q, distance)
    b, error = two_sum(b_0, linear)
    b_low = linear_low + error + q * distance_low
    decay_size = np.zeros_like(b)
    for a, r in zip(exponentials[::2], exponentials[1::2], strict=True):
        exponent, exponent_low = two_product(r, distance)
        with np.errstate(over="ignore", invalid="ignore"):
            decay = np.where(a == 0.0, 0.0, a * np.exp(-exponent))
            correction = -decay * (exponent_low + r * distance_low)
            decay_low = np.where(a == 0.0, 0.0, correction)
        b, error = two_sum(b, decay)
        b_low = b_low + error + decay_low
        decay_size += np.abs(decay)
    force, force_error = two_product(c, b)
    defect, defect_error = two_sum(force, -xi_high)
    low = defect_error + (force_error + c * b_low - xi_low)
    return defect + low, 4.0 * np.finfo(float).eps * c * decay_size


def _slices(rows: Array, bits: int) -> list[Array]:
    """Return _SLICES matrices of `bits` bits and a remainder whose sum is the rows.

    Bits count from the largest number of each row.
    """
    _, exponent = np.frexp(np.max(np.abs(rows), axis=1, keepdims=True))
    slices = []
    remainder = rows
    for _ in range(_SLICES):
        # adding this rounds to multiples of 2^(exponent − bits)
        rounder = np.ldexp(1.5, exponent - bits + 52)
        slices.append((remainder + rounder) - rounder)
        remainder = remainder - slices[-1]
        exponent = exponent - bits - 1
    return [*slices, remainder]
