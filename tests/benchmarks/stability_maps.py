"""What is mapped on synthetic contact lines: softening against size, jumps against kinks, and units.

softening   ω/λ₁ from 0.1 to 100 against m from 10 to 1000: slip weakening to half its peak, half-Laplacian stiffness
down-jumps  height of the down-jumps of b against their number on each side (ω is infinite)
up-jumps    height of the up-jumps of b against their number on each side; b falls back between them
units       slips and tractions measured in units of 1e-9 to 1e9 of their own, ω/λ₁ = 2

Loads: random sums of five waves whose largest traction is 1.2 to 2.5 times the peak of b.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from tcstudy.contact.problem import ContactProblem, least_eigenvalue
from tcstudy.laws.laws import Laws
from tests.benchmarks.problems import weakening
from tests.contact.contact_cases import half_laplacian, linear_law, rescaled

Array = NDArray[np.float64]

SOFTENING, DOWN_JUMPS, UP_JUMPS, UNITS = "softening", "down-jumps", "up-jumps", "units"
MAPS = (SOFTENING, DOWN_JUMPS, UP_JUMPS, UNITS)

RATIOS = tuple(float(f"{r:.3g}") for r in np.geomspace(0.1, 100.0, 9))
"""ω/λ₁."""
SIZES = (10, 30, 100, 300, 1000)
HEIGHTS = (0.01, 0.03, 0.1, 0.3, 0.6, 0.9)
"""Jump heights over the peak of b."""
TEETH = (1, 3, 10, 30, 100)
"""Kinks on each side of 0."""
POWERS = (-9, -4, 0, 4, 9)
"""Units as powers of ten."""

REACH = 0.3
"""Slip over which the teeth are spread, what the loads cause [arbitrary units of length]."""
NODES = 30
"""m of the maps of jumps and units."""


@dataclass(frozen=True)
class Grid:
    """Extent of the maps; the full one by default.

    loads: random loads for every cell
    """

    ratios: tuple[float, ...] = RATIOS
    sizes: tuple[int, ...] = SIZES
    heights: tuple[float, ...] = HEIGHTS
    teeth: tuple[int, ...] = TEETH
    powers: tuple[int, ...] = POWERS
    loads: int = 3


@dataclass(frozen=True)
class Case:
    """One contact problem of a map.

    x, y:         its cell: ω/λ₁ and m; height and number of jumps; powers of ten of the units of slip and traction;
                  see stability_chain for the maps of real bodies
    heat_balance: relative defect of α∫(θ − θ̄) = ∫q, NaN without a heat problem
    """

    map: str
    x: float
    y: float
    load: int
    problem: ContactProblem
    heat_balance: float = field(default=np.nan)


def synthetic(grid: Grid) -> Iterator[Case]:
    """All cases on synthetic lines, small problems before large ones."""
    for m in grid.sizes:
        A_tilde, c = half_laplacian(m)
        lambda_1 = least_eigenvalue(A_tilde, c)
        for ratio in grid.ratios:
            law = weakening(ratio, lambda_1)
            for load in range(grid.loads):
                yield Case(SOFTENING, ratio, m, load, _loaded(A_tilde, c, law, load))
    A_tilde, c = half_laplacian(NODES)
    for name, shape in ((DOWN_JUMPS, down_jumps), (UP_JUMPS, up_jumps)):
        for teeth in grid.teeth:
            for height in grid.heights:
                for load in range(grid.loads):
                    yield Case(name, height, teeth, load, _loaded(A_tilde, c, shape(height, teeth), load))
    law = weakening(2.0, least_eigenvalue(A_tilde, c))
    for slip in grid.powers:
        for traction in grid.powers:
            for load in range(grid.loads):
                own = _loaded(A_tilde, c, law, load)
                yield Case(UNITS, slip, traction, load, rescaled(own, 10.0**slip, 10.0**traction, 1.0))


def down_jumps(height: float, teeth: int, reach: float = REACH) -> Laws:
    """Odd: 1 on the first tooth, then b rises from 1 − height to 1 and falls down again at the end of every tooth."""
    inner = np.arange(1, teeth + 1) * reach / teeth
    high, low = np.ones(teeth), np.full(teeth, 1.0 - height)
    return _odd("down-jumps", inner, high, low)


def up_jumps(height: float, teeth: int, reach: float = REACH) -> Laws:
    """Odd: on every tooth b falls from 1 to 1 − height, ω = height·teeth/reach, and jumps up to 1 at its end."""
    inner = np.arange(1, teeth + 1) * reach / teeth
    high, low = np.ones(teeth), np.full(teeth, 1.0 - height)
    return _odd("up-jumps", inner, low, high)


def _odd(name: str, kinks: Array, left: Array, right: Array) -> Laws:
    """The odd law with the stick interval [−1, 1] at 0 and these limits at the kinks s > 0, constant at the end."""
    return linear_law(
        name,
        [*-kinks[::-1], 0.0, *kinks],
        [*-right[::-1], -1.0, *left],
        [*-left[::-1], 1.0, *right],
        (0.0, 0.0),
    )


def waves(rng: np.random.Generator) -> tuple[float, list[tuple[int, float, float]]]:
    """Mean and (wave number, amplitude, phase) of a random load."""
    return rng.normal(), [(k, rng.normal() / k, rng.uniform(0, 2 * np.pi)) for k in range(1, 6)]


def _loaded(A_tilde: Array, c: Array, law: Laws, load: int) -> ContactProblem:
    """The problem under the random load of this number."""
    m = len(c)
    rng = np.random.default_rng([load, m])
    x = (np.arange(m) + 0.5) / m
    mean, parts = waves(rng)
    shape = mean + sum(a * np.sin(k * np.pi * x + phase) for k, a, phase in parts)
    traction = shape * rng.uniform(1.2, 2.5) / np.max(np.abs(shape))
    return ContactProblem(A_tilde, c * traction, c, law)
