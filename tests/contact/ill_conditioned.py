"""Random contact problems on dense, badly conditioned bodies, with random laws, odd or not."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tcstudy.contact.problem import ContactProblem
from tcstudy.laws.laws import Laws
from tcstudy.laws.shapes import piecewise_linear

Array = NDArray[np.float64]


def body(rng: np.random.Generator, m: int, condition: float) -> Array:
    """Q D Qᵀ with eigenvalues spread evenly in the logarithm over `condition`."""
    Q = np.linalg.qr(rng.normal(size=(m, m)))[0]
    A = (Q * condition ** (rng.uniform(0.0, 1.0, m) - 0.5)) @ Q.T
    return np.asarray(0.5 * (A + A.T))


def random_law(rng: np.random.Generator, odd: bool, monotone: bool = False) -> Laws:
    """Two to eight points, some with one slip (jumps up and down), outer slopes that oppose the slip or vanish."""
    count = int(rng.integers(2, 9))
    gap = np.where(rng.random(count) < 0.3, 0.0, rng.uniform(0.05, 1.0, count))
    gap[1:][gap[:-1] == 0.0] = 0.1  # no three points with one slip
    s = np.cumsum(gap)
    s -= s[0] if odd else rng.uniform(0.0, float(s[-1]))
    b = rng.uniform(0.1, 1.0, count) * (1.0 if odd else np.where(rng.random(count) < 0.7, np.sign(s), 1.0))
    b = np.sort(b) if monotone else b
    b[-1] = abs(b[-1])
    slopes = np.where(rng.random(2) < 0.5, 0.0, rng.uniform(0.0, 2.0, 2))
    if not odd:
        b[0] = -abs(b[0])
    points = list(zip(s.tolist(), b.tolist(), strict=True))
    if odd:
        if s[1] == 0.0:
            points = points[1:]
        return piecewise_linear(points, True, float(slopes[0]), None)
    return piecewise_linear(points, False, None, slopes.tolist())


@dataclass(frozen=True)
class Family:
    """A kind of problems; `spread`: segments over two decades, `driven`: load far beyond friction."""

    name: str
    odd: bool
    monotone: bool
    spread: bool
    driven: bool

    def problem(self, rng: np.random.Generator, m: int, condition: float) -> ContactProblem:
        A = body(rng, m, condition)
        c = 10.0 ** rng.uniform(-1.0, 1.0, m) if self.spread else np.ones(m)
        law = random_law(rng, self.odd, self.monotone)
        v = rng.normal(size=m) * 0.5
        noise = law.b_scale * (rng.normal(size=m) if self.driven else rng.choice([-1.0, 1.0, 0.0], m))
        return ContactProblem(A, A @ v * (1.0 if self.driven else 0.1) + c * noise, c, law)


FAMILIES = [
    Family(f"{'odd' if odd else 'one-sided'}-{'convex' if monotone else 'any'}-{'driven' if driven else 'resting'}",
           odd, monotone, odd != driven, driven)
    for odd in (True, False) for monotone in (True, False) for driven in (True, False)
]  # fmt: skip
