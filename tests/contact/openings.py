"""Contact problems with openings, and all their solutions by trying every piece of every law."""

from itertools import product
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tcstudy.laws.laws import Laws
from tcstudy.laws.shapes import SHAPES, one_sided, unilateral

Array = NDArray[np.float64]
FAR = 1e6
"""Slips beyond which a singular combination has left its solution."""


class Place(NamedTuple):
    """A piece (slope q, b_0 at s = 0) between slips, or a vertical side between tractions."""

    sticks: bool
    low: float
    high: float
    q: float
    b_0: float


def places(law: Laws) -> list[Place]:
    """Return the pieces and vertical sides of one law; of a ray the side below b(0+)."""
    sides = []
    for k, s in enumerate(law.kinks.tolist()):
        low, high = sorted((float(law.b_left[k]), float(law.b_right[k])))
        if high > low + 1e-12:
            sides.append(Place(True, low, high, 0.0, s))
    pieces = []
    for k in range(int(law.closed), len(law.q)):
        b_0 = float(law.b_0[k] - law.q[k] * law.s_0[k])
        ends = float(law.lower[k]), float(law.upper[k])
        pieces.append(Place(False, *ends, float(law.q[k]), b_0))
    return [*sides, *pieces]


def every_solution(A: Array, load: Array, c: Array, laws: list[Laws]) -> list[Array]:
    """Return the different solutions of all combinations of places."""
    solutions: list[Array] = []
    for combination in product(*map(places, laws)):
        sticks = np.array([place.sticks for place in combination])
        b_0 = np.array([place.b_0 for place in combination])
        q = np.array([place.q for place in combination])
        v = np.where(sticks, b_0, 0.0)
        free = np.flatnonzero(~sticks)
        H = A[np.ix_(free, free)] + np.diag(c[free] * q[free])
        try:
            v[free] = np.linalg.solve(H, (load - A @ v - c * b_0)[free])
        except np.linalg.LinAlgError:
            continue
        place_of = np.where(sticks, (load - A @ v) / c, v)
        low = np.array([place.low for place in combination]) - 1e-9
        high = np.array([place.high for place in combination]) + 1e-9
        is_new = all(np.max(np.abs(v - known)) > 1e-7 for known in solutions)
        if np.all((low <= place_of) & (place_of <= high)) and np.max(np.abs(v)) < FAR and is_new:
            solutions.append(v)
    return solutions


class OpeningCase(NamedTuple):
    """Ã, l̃, c, and the law of every row."""

    A: Array
    load: Array
    c: Array
    laws: list[Laws]


def random_case(seed: int, motions: int = 0) -> OpeningCase:
    """Return a random problem of up to five rows, openings and slips, with entries of either sign.

    motions: number of motions that Ã does not resist; the first opens all rows
    """
    rng = np.random.default_rng([seed, motions])
    m = int(rng.integers(motions + 1, 5 if seed % 4 else 6))
    basis = rng.normal(size=(m, m))
    if motions:
        basis[:, 0] = rng.uniform(0.5, 1.5, m)
    basis = np.linalg.qr(basis)[0]
    stiffness = 10.0 ** rng.uniform(-1.5, 1.0, m)
    stiffness[:motions] = 0.0
    A = basis * stiffness @ basis.T
    s_0, s_f, peak = rng.uniform(0.05, 0.4), rng.uniform(0.5, 2.0), rng.uniform(0.3, 2.0)
    bilinear = SHAPES["bilinear"].build(tau=peak, s0=s_0, sf=s_f)
    teeth = [(0.0, 0.0), (s_0, peak), (s_0, 0.3 * peak), (s_f, 0.8 * peak), (s_f, 0.0)]
    pool = [
        unilateral(),
        one_sided(bilinear),
        one_sided(SHAPES["piecewise-linear"].build(points=[(0.0, peak), (s_f, 0.0)])),
        one_sided(SHAPES["piecewise-linear"].build(points=teeth)),
        one_sided(bilinear, 3.0),
        SHAPES["slip-weakening"].build(tau_s=peak, tau_k=0.2 * peak, delta=s_0),
    ]
    kinds = rng.integers(0, len(pool), m) if seed % 3 else np.full(m, seed % 2)
    load = rng.normal(size=m) * rng.choice([1.0, 4.0])
    c = rng.uniform(0.3, 1.5, m)
    return OpeningCase(0.5 * (A + A.T), load, c, [pool[k] for k in kinds])
