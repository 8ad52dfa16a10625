"""Designs of experiments: points of the unit cube, and distributions of parameters.

The same seed gives the same points to the bit, and the first points of a longer design are those of
a shorter one: a design can grow. A Latin hypercube grows by doubling only; one of n points is a
hypercube of the odd part of n, doubled (every old point lies in a cell of the finer one, the new
points fill the other cells; Sallaberry, Helton & Hora, Reliab. Eng. Syst. Saf. 93 (2008) 1047, doi
10.1016/j.ress.2007.04.005).

Not here: which parameter has which distribution, and in which unit (`read.sweep`).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Cube = NDArray[np.float64]

SOBOL = "sobol"
SALTELLI = "saltelli"
DESIGNS = ("random", "latin-hypercube", SOBOL, SALTELLI)
"""Modes of a sweep whose points are sampled."""
MIN_QUANTILE = 2.0**-54
"""In place of 0, where a distribution may have no finite value; no generator tells them apart."""


@dataclass(frozen=True)
class Design:
    """How the points of a study were drawn.

    mode:   one of DESIGNS
    seed:   of its random numbers
    points: n of the study; saltelli has n (d + 2) points for d parameters
    """

    mode: str
    points: int
    seed: int

    @property
    def note(self) -> str:
        """One sentence for those who plan a study."""
        points = "base points" if self.mode == SALTELLI else "points"
        note = (
            f"{self.points} {points} drawn by {self.mode}, seed {self.seed}: "
            "a longer design begins with them"
        )
        power = 2 ** math.ceil(math.log2(self.points))
        if self.mode in (SOBOL, SALTELLI) and power != self.points:
            balance = f"balanced at powers of two only: {power} points cover evenly"
            return f"{note}; a Sobol sequence is {balance}"
        if self.mode == "latin-hypercube":
            return f"{note} if it has 2, 4, 8 … times as many"
        return note


def count(mode: str, points: int, d: int) -> int:
    """Return the number of points of a design of d parameters."""
    return points * (d + 2) if mode == SALTELLI else points


def cube(design: Design, d: int) -> Cube:
    """Return (P, d) points in (0, 1), P = `count`.

    saltelli: d + 2 rows for each base point, A, B, and A with column i from B for i = 0 … d − 1,
    where [A B] is a Sobol sequence in 2 d dimensions (Saltelli et al., Comput. Phys. Commun. 181
    (2010) 259, doi 10.1016/j.cpc.2009.09.018).
    """
    rng = np.random.default_rng(design.seed)
    n = design.points
    if design.mode == "random":
        u = rng.random((n, d))
    elif design.mode == "latin-hypercube":
        u = _latin_hypercube(n, d, design.seed)
    elif design.mode == SOBOL:
        u = _sobol(n, d, rng)
    else:
        base = _sobol(n, 2 * d, rng)
        A = base[:, :d]
        B = base[:, d:]
        rows = np.repeat(A[:, None], d + 2, axis=1)
        rows[:, 1] = B
        for i in range(d):
            rows[:, 2 + i, i] = B[:, i]
        u = rows.reshape(n * (d + 2), d)
    return np.maximum(u, MIN_QUANTILE)


def correlated(u: Cube, R: Cube) -> Cube:
    """Return points (P, d) whose columns depend on each other by a Gaussian copula.

    They keep their uniform distributions.

    R: (d, d) correlation of the normal scores z = Φ⁻¹(u): z' = z Lᵀ with R = L Lᵀ, u' = Φ(z').
    Ranks have the correlation 6/π asin(ρ/2) (Kruskal, J. Amer. Stat. Assoc. 53 (1958) 814). A point
    depends on itself alone, so that a design still grows; the cells of a Latin hypercube are kept
    in the first column only.
    """
    from scipy.special import ndtr, ndtri

    return np.clip(ndtr(ndtri(u) @ np.linalg.cholesky(R).T), MIN_QUANTILE, 1.0 - MIN_QUANTILE)


def _sobol(n: int, d: int, rng: np.random.Generator) -> Cube:
    """Return the first n points of a scrambled sequence.

    It is drawn up to a power of two, because the library warns of other numbers.
    """
    from scipy.stats import qmc

    sequence = qmc.Sobol(d, scramble=True, seed=rng)
    points = sequence.random_base2(math.ceil(math.log2(n)))
    return np.asarray(points[:n])


def _latin_hypercube(n: int, d: int, seed: int) -> Cube:
    from scipy.stats import qmc

    doublings = (n & -n).bit_length() - 1
    u: Cube = qmc.LatinHypercube(d, seed=np.random.default_rng(seed)).random(n >> doublings)
    for step in range(doublings):
        rng = np.random.default_rng((seed, step))
        cells = 2 * len(u)
        taken = np.minimum((u * cells).astype(np.intp), cells - 1)
        new = np.empty_like(u)
        for j in range(d):
            free = np.setdiff1d(np.arange(cells), taken[:, j], assume_unique=True)
            new[:, j] = (rng.permutation(free) + rng.random(len(free))) / cells
        u = np.concatenate([u, new])
    return u


PARAMETERS: dict[str, tuple[str, ...]] = {
    "uniform": ("from", "to"),
    "log-uniform": ("from", "to"),
    "normal": ("mean", "sigma"),
    "truncated-normal": ("mean", "sigma", "from", "to"),
    "lognormal": ("median", "sigma"),
    "triangular": ("from", "mode", "to"),
}
"""Names of the numbers of each distribution.

All have the dimension of the parameter but the sigma of a logarithm.
"""
ENDS = ("from", "to")


@dataclass(frozen=True)
class Distribution:
    """A distribution of one number.

    kind:    one of PARAMETERS
    numbers: its parameters by name, in SI
    """

    kind: str
    numbers: tuple[tuple[str, float], ...]

    def __str__(self) -> str:
        return f"{self.kind}({', '.join(f'{name}={value:.15g}' for name, value in self.numbers)})"

    @property
    def is_sound(self) -> bool:
        """Whether the numbers make a distribution."""
        with np.errstate(all="ignore"):
            return bool(np.isfinite(self.at(np.array([0.5]))[0]))

    def at(self, u: Cube) -> Cube:
        """Return the values at which the distribution function is u.

        They have the 15 digits on which all machines agree.
        """
        from scipy import stats

        # as numpy's numbers: none raises an error when it is divided by zero
        numbers = {name: np.float64(number) for name, number in self.numbers}
        low = numbers.get("from", 0.0)
        high = numbers.get("to", 0.0)
        sigma = numbers.get("sigma", 1.0)
        mean = numbers.get("mean", 0.0)
        match self.kind:
            case "uniform":
                law = stats.uniform(low, high - low)
            case "log-uniform":
                law = stats.loguniform(low, high)
            case "normal":
                law = stats.norm(mean, sigma)
            case "truncated-normal":
                law = stats.truncnorm((low - mean) / sigma, (high - mean) / sigma, mean, sigma)
            case "lognormal":
                law = stats.lognorm(sigma, scale=numbers["median"])
            case _:
                law = stats.triang((numbers["mode"] - low) / (high - low), low, high - low)
        # a value that no number can hold is inf, which is refused where it is read
        with np.errstate(over="ignore"):
            return np.array([float(f"{value:.15g}") for value in law.ppf(u)])
