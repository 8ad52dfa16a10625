"""Sums of friction laws: what acts at a node whose cell lies on two edges with laws of their own.

Node i has the friction c' b'(s) + c'' b''(s), c' and c'' the parts of c_i on the two edges, so that its law is
b = (c' b' + c'' b'')/c_i: the trapezoidal rule on either side of the step in ∫_{Γ_C} j(x, u_T), of second order.
With all of c_i given to one of the laws it is of first order.

A sum has the kinks of both. Straight pieces, one exponential, and two that decay alike add up to a piece of a law.
Two exponentials that decay differently do not: theirs is an exponential spline, b_0 + q s + a exp(−r s) between points
where it has the sum's value and slope, which misses it by SPLINE_ERROR of the two amplitudes at most.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from tcstudy.scene.friction import FrictionLaw

Array = NDArray[np.float64]
Piece = tuple[float, float, float, float, float]
"""s_0, b_0, q, a, r."""

SPLINE_ERROR = 1e-6
"""Of an exponential spline, relative to the amplitudes of the exponentials at the end of the piece nearest to 0."""
LEAST_TURN, STEEPEST = 1e-3, 60.0
"""|r| times the length of a spline's piece: with less it is a parabola without digits, with more it has decayed."""
STEPS = 4
"""Of Newton from 5 %, after which rounding is left."""


def total(one: FrictionLaw, two: FrictionLaw) -> FrictionLaw:
    """The law b' + b''; an odd one of odd ones, to the bit."""
    kinks = np.union1d(one.kinks, two.kinks)
    ends = np.concatenate([[-np.inf], kinks, [np.inf]])
    ends_of: list[float] = kinks.tolist()
    pieces: list[Piece] = []
    for k, (i, j) in enumerate(zip(_within(one, kinks), _within(two, kinks), strict=True)):
        left, right = float(ends[k]), float(ends[k + 1])
        s_0 = min(max(0.0, left), right)
        a, b = _moved(one, i, s_0), _moved(two, j, s_0)
        if a[3] and b[3] and a[4] != b[4]:
            cuts, parts = _mirrored(a, b, left, right) if right <= 0.0 else _spline(a, b, left, right)
            ends_of, pieces = [*ends_of, *cuts], [*pieces, *parts]
        else:
            rate = (a[4] if a[3] else b[4]) if a[3] + b[3] else 0.0
            pieces.append((s_0, a[1] + b[1], a[2] + b[2], a[3] + b[3], rate))
    name = " and ".join(dict.fromkeys(law.name for law in (one, two) if not law.vanishes))
    return FrictionLaw(name, np.sort(ends_of), *(np.array(column) for column in zip(*pieces, strict=True)))


def _within(law: FrictionLaw, kinks: Array) -> list[int]:
    """Which piece of a law each of the K + 1 pieces of one with more kinks lies in."""
    return [0, *law.piece(kinks, +1).tolist()]


def _moved(law: FrictionLaw, k: int, s_0: float) -> Piece:
    """A piece of a law with another anchor."""
    apart, r = s_0 - float(law.s_0[k]), float(law.r[k])
    a = float(law.a[k] * np.exp(-r * apart)) if law.a[k] else 0.0
    return s_0, float(law.b_0[k] + law.q[k] * apart), float(law.q[k]), a, r


def _mirrored(one: Piece, two: Piece, left: float, right: float) -> tuple[list[float], list[Piece]]:
    """As `_spline` on the side of s < 0, by −b(−s)."""
    one, two = ((-s, -b, q, -a, -r) for s, b, q, a, r in (one, two))
    cuts, pieces = _spline(one, two, -right, -left)
    return [-s for s in cuts[::-1]], [(-s, -b, q, -a, -r) for s, b, q, a, r in pieces[::-1]]


class _Sum:
    """b_0 + q x + a₁ exp(−r₁ x) + a₂ exp(−r₂ x), x = s − s_0 ≥ 0, |r₁| < |r₂|."""

    def __init__(self, one: Piece, two: Piece) -> None:
        slow, fast = sorted((one, two), key=lambda piece: abs(piece[4]))
        self.s_0, self.b_0, self.q = one[0], one[1] + two[1], one[2] + two[2]
        self.a, self.r = np.array([slow[3], fast[3]]), np.array([slow[4], fast[4]])

    def terms(self, x: Array) -> Array:
        """(2, n) the exponentials."""
        return np.asarray(self.a[:, None] * np.exp(-self.r[:, None] * x))

    def value(self, x: Array) -> Array:
        """(n,) b."""
        return np.asarray(self.b_0 + self.q * x + self.terms(x).sum(axis=0))

    def slope(self, x: Array) -> Array:
        """(n,) b′."""
        return np.asarray(self.q - self.r @ self.terms(x))

    @property
    def turn(self) -> float:
        """Where b″ = 0, NaN if nowhere."""
        bend = -self.a * self.r**2
        ratio = -float(bend[1] / bend[0])
        return float(np.log(ratio) / (self.r[1] - self.r[0])) if ratio > 0.0 else float("nan")


@lru_cache(maxsize=16)  # a mirror image follows its image
def _spline(one: Piece, two: Piece, left: float, right: float) -> tuple[list[float], list[Piece]]:
    """(slips between its pieces, pieces) of a sum of two exponentials between left ≥ 0 and right."""
    sum_of = _Sum(one, two)
    allowed = SPLINE_ERROR * float(np.abs(sum_of.a).sum())
    first = left - sum_of.s_0
    last = right - sum_of.s_0
    if not np.isfinite(right):  # from here on only the slower one is left
        last = max(float(np.log(abs(sum_of.a[1]) / allowed) / sum_of.r[1]), first)
    turn = [sum_of.turn] if first < sum_of.turn < last else []
    ends = [last] if last > first else []  # of a fast one that is too small to be seen nothing is left at once
    found = _fitted(sum_of, np.array([first, *turn, *ends]), allowed)
    pieces = [(sum_of.s_0 + x, b_0, q, a, r) for x, b_0, q, a, r in found]
    if not np.isfinite(right):
        straight = sum_of.b_0 + sum_of.q * last
        tail = float(sum_of.value(np.array([last]))[0]) - straight
        pieces.append((sum_of.s_0 + last, straight, sum_of.q, tail, float(sum_of.r[0])))
    return [piece[0] for piece in pieces[1:]], pieces


def _fitted(sum_of: _Sum, marks: Array, allowed: float) -> list[Piece]:
    """(x, b_0, q, a, r) of the pieces between marks, where b″ does not change its sign: halves until they fit."""
    x, y = marks[:-1], marks[1:]
    found = [np.zeros((5, 0))]
    while len(x):
        pieces, fits = _through_ends(sum_of, x, y, allowed)
        found.append(pieces[:, fits])
        x, y = x[~fits], y[~fits]
        middle = x + 0.5 * (y - x)
        x, y = np.concatenate([x, middle]), np.concatenate([middle, y])
    rows = np.concatenate(found, axis=1)
    return [(x, b_0, q, a, r) for x, b_0, q, a, r in rows[:, np.argsort(rows[0])].T.tolist()]


def _through_ends(sum_of: _Sum, x: Array, y: Array, allowed: float) -> tuple[Array, NDArray[np.bool_]]:
    """(5, n) the pieces from x to y (n,) with the sum's values and slopes there, and whether they fit it between.

    With h = y − x, m the mean slope, g and g + t those at the ends, and z = r h: (m − g)/t = 1/(1 − e^{−z}) − 1/z.
    """
    h, g, at_x, at_y = y - x, sum_of.slope(x), sum_of.value(x), sum_of.value(y)
    m, t = (at_y - at_x) / h, sum_of.slope(y) - g
    straight = np.abs(t) * h <= allowed
    share = np.divide(m - g, t, out=np.full(len(x), 0.5), where=~straight)
    least, most = _share(np.array([-STEEPEST, STEEPEST]))
    z = _of_share(np.clip(share, least, most))
    z = np.copysign(np.maximum(np.abs(z), LEAST_TURN), z)
    r, a, q = z / h, t * h / (z * -np.expm1(-z)), m + t / z
    # from the end where the exponential is smaller, so that the piece meets its neighbours to rounding
    b_0 = np.where(z < 0.0, at_x - a, at_y - q * h - a * np.exp(-z))
    apart = np.array([[0.25], [0.5], [0.75]]) * h
    missed = np.abs([b_0 + q * d + a * np.exp(-r * d) - sum_of.value(x + d) for d in apart])
    fits = straight | ((least < share) & (share < most) & np.all(missed <= allowed, axis=0))
    none = np.zeros(len(x))
    return np.where(straight, [x, at_x, m, none, none], [x, b_0, q, a, r]), fits


def _share(z: Array) -> Array:
    """1/(1 − e^{−z}) − 1/z, from 0 to 1 as z goes from −∞ to ∞, ½ at 0."""
    small = np.abs(z) < 1e-2
    far = np.where(small, 1.0, z)
    return np.where(small, 0.5 + z / 12.0 - z**3 / 720.0, -1.0 / np.expm1(-far) - 1.0 / far)


def _of_share(share: Array) -> Array:
    """The z of a share, |z| ≤ STEEPEST: 2 share − 1 is Langevin's function of z/2, whose inverse is begun with
    (Cohen, Rheol. Acta 30 (1991) 270–273: within 5 %) and mended by Newton, whose error is squared each time."""
    y = 2.0 * share - 1.0
    z = 2.0 * y * (3.0 - y**2) / (1.0 - y**2)
    for _ in range(STEPS):
        small = np.abs(z) < 1e-2
        far = np.where(small, 1.0, z)
        slope = np.where(small, 1.0 / 12.0 - z**2 / 240.0, 1.0 / far**2 - 0.25 / np.sinh(0.5 * far) ** 2)
        z = z - (_share(z) - share) / slope
    return np.asarray(z)
