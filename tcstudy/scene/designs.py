"""Designs of experiments: points of the unit cube, and the distributions that turn them into values
of parameters.

The same seed gives the same points to the bit, and the first points of a longer design are those of
a shorter one: a design can grow. A Latin hypercube grows by doubling only; one of n points is a
hypercube of the odd part of n, doubled (every old point lies in a cell of the finer one, the new
points fill the other cells; Sallaberry, Helton & Hora, Reliab. Eng. Syst. Saf. 93 (2008) 1047, doi
10.1016/j.ress.2007.04.005).

Not here: which parameter has which distribution, and in which unit (`read.sweep`).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Cube = NDArray[np.float64]

SOBOL = "sobol"
SALTELLI = "saltelli"
DESIGNS = ("random", "latin-hypercube", SOBOL, SALTELLI)
"""Modes of a sweep whose points are drawn."""
LEAST = 2.0**-54
"""In place of 0, where a distribution may have no finite value; no generator tells the two
apart."""


@dataclass(frozen=True)
class Design:
    """How the points of a study were drawn.

    mode:   one of DESIGNS;  seed: of its random numbers
    points: n of the study; saltelli has n (d + 2) points for d parameters
    """

    mode: str
    points: int
    seed: int

    @property
    def note(self) -> str:
        """One sentence for those who plan a study."""
        drawn = "base points" if self.mode == SALTELLI else "points"
        said = f"{self.points} {drawn} drawn by {self.mode}, seed {self.seed}: a longer design begins with them"
        power = 2 ** math.ceil(math.log2(self.points))
        if self.mode in (SOBOL, SALTELLI) and power != self.points:
            return f"{said}; a Sobol sequence is balanced at powers of two only: {power} points cover evenly"
        return (
            f"{said} if it has 2, 4, 8 … times as many" if self.mode == "latin-hypercube" else said
        )


def count(mode: str, points: int, d: int) -> int:
    """Points of a design of d parameters."""
    return points * (d + 2) if mode == SALTELLI else points


def cube(design: Design, d: int) -> Cube:
    """(P, d) points in (0, 1), P = `count`.

    saltelli: d + 2 rows for each base point, A, B, and A with column i from B for i = 0 … d − 1,
    where [A B] is a Sobol sequence in 2 d dimensions (Saltelli et al., Comput. Phys. Commun. 181
    (2010) 259, doi 10.1016/j.cpc.2009.09.018).
    """
    rng, n = np.random.default_rng(design.seed), design.points
    if design.mode == "random":
        u = rng.random((n, d))
    elif design.mode == "latin-hypercube":
        u = _latin_hypercube(n, d, design.seed)
    elif design.mode == SOBOL:
        u = _sobol(n, d, rng)
    else:
        both = _sobol(n, 2 * d, rng)
        rows = np.repeat(both[:, None, :d], d + 2, axis=1)
        rows[:, 1] = both[:, d:]
        for i in range(d):
            rows[:, 2 + i, i] = both[:, d + i]
        u = rows.reshape(n * (d + 2), d)
    return np.maximum(u, LEAST)


def correlated(u: Cube, R: Cube) -> Cube:
    """Points (P, d) whose columns keep their uniform distributions and depend on each other by a
    Gaussian copula.

    R: (d, d) correlation of the normal scores z = Φ⁻¹(u): z' = z Lᵀ with R = L Lᵀ, u' = Φ(z').
    Ranks have the correlation 6/π asin(ρ/2) (Kruskal, J. Amer. Stat. Assoc. 53 (1958) 814). A point
    depends on itself alone, so that a design still grows; the cells of a Latin hypercube are kept
    in the first column only.
    """
    from scipy.special import ndtr, ndtri

    return np.clip(ndtr(ndtri(u) @ np.linalg.cholesky(R).T), LEAST, 1.0 - LEAST)


def _sobol(n: int, d: int, rng: np.random.Generator) -> Cube:
    """The first n points of a scrambled sequence; drawn up to a power of two, which the library has
    no doubts about."""
    from scipy.stats import qmc

    return np.asarray(
        qmc.Sobol(d, scramble=True, seed=rng).random_base2(math.ceil(math.log2(n)))[:n]
    )


def _latin_hypercube(n: int, d: int, seed: int) -> Cube:
    from scipy.stats import qmc

    doublings = (n & -n).bit_length() - 1
    u: Cube = qmc.LatinHypercube(d, seed=np.random.default_rng(seed)).random(n >> doublings)
    for step in range(doublings):
        rng, cells = np.random.default_rng((seed, step)), 2 * len(u)
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
"""Names of the numbers of each distribution; all have the parameter's dimension but the sigma of a
logarithm."""
ENDS = ("from", "to")


@dataclass(frozen=True)
class Distribution:
    """A distribution of one number.

    kind: one of PARAMETERS;  numbers: its parameters by name, in SI
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
        """Values at which the distribution function is u; to 15 digits, which all machines agree
        about."""
        from scipy import stats

        has = {
            name: np.float64(number) for name, number in self.numbers
        }  # of which none divides by zero
        low, high, sigma = has.get("from", 0.0), has.get("to", 0.0), has.get("sigma", 1.0)
        mean = has.get("mean", 0.0)
        laws: dict[str, Callable[[], Any]] = {
            "uniform": lambda: stats.uniform(low, high - low),
            "log-uniform": lambda: stats.loguniform(low, high),
            "normal": lambda: stats.norm(mean, sigma),
            "truncated-normal": lambda: stats.truncnorm(
                (low - mean) / sigma, (high - mean) / sigma, mean, sigma
            ),
            "lognormal": lambda: stats.lognorm(sigma, scale=has["median"]),
            "triangular": lambda: stats.triang((has["mode"] - low) / (high - low), low, high - low),
        }
        law = laws[self.kind]()
        with np.errstate(
            over="ignore"
        ):  # a value that no number can hold is inf, which is refused where it is read
            return np.array([float(f"{value:.15g}") for value in law.ppf(u)])
