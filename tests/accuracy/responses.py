"""Responses with exactly known first-order indices, for tests and the benchmark of intervals.

A response takes points u (N, d) of the unit cube and returns inputs (N, d) and results (N,).
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import norm, qmc

Array = NDArray[np.float64]
Response = Callable[[Array], tuple[Array, Array]]


@dataclass(frozen=True)
class Case:
    """A response and its indices (d,); is_choice: whether its first input is a choice."""

    indices: Array
    response: Response
    is_choice: bool = False

    def sample(self, design: str, count: int, seed: list[int]) -> tuple[Array, Array]:
        """Return inputs and results of drawn points."""
        return self.response(drawn(design, count, len(self.indices), seed))

    @property
    def named(self) -> tuple[bool, ...]:
        """Inputs that are a choice."""
        return (self.is_choice, *(False for _ in self.indices[1:]))


def drawn(design: str, count: int, d: int, seed: list[int]) -> Array:
    """Return points (N, d) of the unit cube."""
    generator = np.random.default_rng(seed)
    if design == "sobol":
        u = qmc.Sobol(d, seed=generator).random(count)
    elif design == "latin-hypercube":
        u = qmc.LatinHypercube(d, seed=generator).random(count)
    else:
        u = generator.random((count, d))
    return np.clip(u, 2.0**-54, 1.0 - 2.0**-53)


def linear(*shares: float) -> Case:
    """A sum of independent normal inputs with these shares of the variance."""
    indices = np.array(shares)

    def response(u: Array) -> tuple[Array, Array]:
        x = norm.ppf(u)
        return x, x @ np.sqrt(indices)

    return Case(indices, response)


def with_noise(share: float, mean: Callable[[Array], Array]) -> Case:
    """A function of the first input, which has this share, and normal noise of the second."""
    grid = (np.arange(200_000) + 0.5) / 200_000
    noise = np.sqrt(np.var(mean(grid)) * (1.0 - share) / share)

    def response(u: Array) -> tuple[Array, Array]:
        x = np.column_stack([u[:, 0], norm.ppf(u[:, 1])])
        return x, mean(u[:, 0]) + noise * x[:, 1]

    return Case(np.array([share, 1.0 - share]), response)


def staircase(share: float, steps: int) -> Case:
    """Equal steps in the first input."""
    return with_noise(share, lambda u: np.floor(steps * u))


def saw(share: float, teeth: int) -> Case:
    """Equal teeth in the first input."""
    return with_noise(share, lambda u: (teeth * u) % 1.0)


def choice(share: float, levels: int, ratio: float = 1.0) -> Case:
    """A choice of equally likely values; the noise of the last is `ratio` times that of the first."""
    effects = np.linspace(-1.0, 1.0, levels)
    effects *= np.sqrt(share) / np.std(effects)
    spreads = np.linspace(1.0, ratio, levels)
    spreads *= np.sqrt((1.0 - share) / np.mean(spreads**2))

    def response(u: Array) -> tuple[Array, Array]:
        value = np.minimum((u[:, 0] * levels).astype(int), levels - 1)
        z = norm.ppf(u[:, 1])
        return np.column_stack([value, z]), effects[value] + spreads[value] * z

    return Case(np.array([share, np.mean(spreads) ** 2]), response, is_choice=True)


def correlated(a: float, b: float, rho: float) -> Case:
    """a x₁ + b x₂ of normal inputs with the correlation ρ: S₁ = (a + ρ b)²/Var y."""
    variance = a * a + b * b + 2.0 * rho * a * b

    def response(u: Array) -> tuple[Array, Array]:
        z = norm.ppf(u)
        x = np.column_stack([z[:, 0], rho * z[:, 0] + np.sqrt(1.0 - rho**2) * z[:, 1]])
        return x, a * x[:, 0] + b * x[:, 1]

    return Case(np.array([a + rho * b, b + rho * a]) ** 2 / variance, response)


def ishigami() -> Case:
    """sin x₁ + 7 sin² x₂ + 0.1 x₃⁴ sin x₁, uniform in (−π, π) (Ishigami & Homma, ISUMA 1990)."""
    first = 0.5 * (1.0 + 0.1 * np.pi**4 / 5.0) ** 2
    second = 49.0 / 8.0
    both = 0.01 * np.pi**8 * (1.0 / 18.0 - 1.0 / 50.0)

    def response(u: Array) -> tuple[Array, Array]:
        x = (2.0 * u - 1.0) * np.pi
        return x, np.sin(x[:, 0]) * (1.0 + 0.1 * x[:, 2] ** 4) + 7.0 * np.sin(x[:, 1]) ** 2

    return Case(np.array([first, second, 0.0]) / (first + second + both), response)


def g_function(*a: float) -> Case:
    """∏ (|4 u_i − 2| + a_i)/(1 + a_i) of uniform inputs (Saltelli & Sobol, 1995)."""
    weights = np.array(a)
    parts = 1.0 / (3.0 * (1.0 + weights) ** 2)

    def response(u: Array) -> tuple[Array, Array]:
        return u, np.prod((np.abs(4.0 * u - 2.0) + weights) / (1.0 + weights), axis=1)

    return Case(parts / (np.prod(1.0 + parts) - 1.0), response)


def interactions() -> Case:
    """x₁x₂ + 0.3 x₃x₄ of normal inputs and one without effect: all indices are 0."""

    def response(u: Array) -> tuple[Array, Array]:
        x = norm.ppf(u)
        return x, x[:, 0] * x[:, 1] + 0.3 * x[:, 2] * x[:, 3]

    return Case(np.zeros(5), response)


def side() -> Case:
    """Whether x₁ + 0.3 x₂ > 0.6: 0 or 1, with 1 at a share of 0.55."""
    probability, grid = 0.55, (np.arange(200_000) + 0.5) / 200_000
    by_first = np.clip(1.0 - (0.6 - grid) / 0.3, 0.0, 1.0)
    by_second = 0.4 + 0.3 * grid
    variances = np.array([np.var(by_first), np.var(by_second)])

    def response(u: Array) -> tuple[Array, Array]:
        return u, (u[:, 0] + 0.3 * u[:, 1] > 0.6).astype(float)

    return Case(variances / (probability * (1.0 - probability)), response)


CASES = {
    "linear .98": linear(0.98, 0.02, 0.0),
    "linear .9": linear(0.9, 0.1, 0.0),
    "linear .54": linear(0.54, 0.3, 0.16),
    "interactions": interactions(),
    "ishigami": ishigami(),
    "g": g_function(0.0, 1.0, 4.5, 9.0),
    "side": side(),
    "jump .9": with_noise(0.9, lambda u: u > 0.7),
    "jump .98": with_noise(0.98, lambda u: u > 0.7),
    "wave .9": with_noise(0.9, lambda u: np.sin(6.0 * np.pi * u)),
    "6 steps .9": staircase(0.9, 6),
    "10 steps .98": staircase(0.98, 10),
    "4 teeth .54": saw(0.54, 4),
    "4 teeth .9": saw(0.9, 4),
    "8 teeth .9": saw(0.9, 8),
    "choice 2 .3": choice(0.3, 2),
    "choice 10 .9": choice(0.9, 10),
    "choice 10 0": choice(0.0, 10),
    "choice 5 .05 uneven": choice(0.05, 5, 4.0),
    "correlated": correlated(0.8, 0.6, 0.6),
}
