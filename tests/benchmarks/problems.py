"""The contact problems of the comparison: synthetic lines of 50, 200 and 1000 nodes, and a condensed elastic body.

Stiffness: half-Laplacian (clamped half-plane, λ₁ = π), or Ã of a 2×1 rectangle assembled by NGSolve (λ₁ = 0.413)
Laws:      slip weakening to half its peak with ω/λ₁ = 0.5 (one solution), 2 and 8; a saw-tooth with down-jumps
Loads:     random sums of five waves, scaled so that some nodes slip and some stick
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tcstudy.contact.problem import ContactProblem, least_eigenvalue
from tcstudy.laws.laws import Laws
from tests.contact.contact_cases import half_laplacian, sawtooth, slip_weakening

Array = NDArray[np.float64]

SIZES = (50, 200, 1000)
RATIOS = (0.5, 2.0, 8.0)
BODY_RATIO = 2.0
LOADS = 6

WEAKENING, SAWTOOTH, BODY = "slip-weakening", "saw-tooth", "body"
"""Names of the families; BODY is the rectangle with slip weakening."""

RECTANGLE = """
units: none
body: {rectangle: {width: 2, height: 1}}
boundary: {bottom: contact, left: clamped, right: free, top: {role: traction, g: ["SHEAR", 0]}}
material: {E: 1, nu: 0.3}
friction: {law: tresca, tau: 1}
mesh: {maxh: 0.08, levels: LEVELS}
"""


@dataclass(frozen=True)
class Family:
    """Problems of one law and size that differ in their load.

    name:  WEAKENING, SAWTOOTH or BODY
    ratio: ω/λ₁; infinite with down-jumps
    """

    name: str
    m: int
    ratio: float

    def __str__(self) -> str:
        softening = "" if np.isinf(self.ratio) else f", ω/λ₁ = {self.ratio:g}"
        return f"{self.name}, m = {self.m}{softening}"


@dataclass(frozen=True)
class Case:
    """One contact problem of a family."""

    family: Family
    load: int
    problem: ContactProblem


def cases(sizes: tuple[int, ...] = SIZES, loads: int = LOADS, body_levels: int = 4) -> Iterator[list[Case]]:
    """All cases, a family at a time, small problems before large ones.

    body_levels: meshes of the body, of which the finest counts (4: m = 200); 0 leaves the body out
    """
    for m in sizes:
        A_tilde, c = half_laplacian(m)
        for ratio in RATIOS:
            yield _synthetic(Family(WEAKENING, m, ratio), A_tilde, c, loads)
        if m <= 200:
            yield _synthetic(Family(SAWTOOTH, m, np.inf), A_tilde, c, loads)
    if body_levels:
        yield _body(loads, body_levels)


def weakening(ratio: float, lambda_1: float, peak: float = 1.0) -> Laws:
    """Slip weakening from `peak` to half of it at the rate ω = ratio·λ₁."""
    return slip_weakening(peak, 0.5 * peak, 0.5 * peak / (ratio * lambda_1))


def _synthetic(family: Family, A_tilde: Array, c: Array, loads: int) -> list[Case]:
    """The traction's largest value is 1.2 to 2.5 times the peak of b (1)."""
    law = sawtooth() if family.name == SAWTOOTH else weakening(family.ratio, least_eigenvalue(A_tilde, c))
    x = (np.arange(family.m) + 0.5) / family.m
    found = []
    for load in range(loads):
        rng = np.random.default_rng([load, family.m])
        mean, waves = _waves(rng)
        shape = mean + sum(a * np.sin(k * np.pi * x + phase) for k, a, phase in waves)
        traction = shape * rng.uniform(1.2, 2.5) / np.max(np.abs(shape))
        found.append(Case(family, load, ContactProblem(A_tilde, c * traction, c, law)))
    return found


def _waves(rng: np.random.Generator) -> tuple[float, list[tuple[int, float, float]]]:
    """Mean and (wave number, amplitude, phase) of a random load."""
    return rng.normal(), [(k, rng.normal() / k, rng.uniform(0, 2 * np.pi)) for k in range(1, 6)]


def _body(loads: int, levels: int) -> list[Case]:
    """The rectangle under random shear tractions on its top; the peak of b follows the condensed load."""
    # NGSolve is loaded only if the body takes part
    from tcstudy.fem.geometry import build
    from tcstudy.offline.level import Level
    from tcstudy.read.study import read_study_text
    from tests.verification.scenes import mesh_family

    level, condensed = None, []
    for load in range(loads):
        rng = np.random.default_rng([load, 0])
        mean, waves = _waves(rng)
        shear = f"{mean:.6f}" + "".join(f" + ({a:.6f})*sin({k}*pi*x/2 + {phase:.6f})" for k, a, phase in waves)
        study = read_study_text(RECTANGLE.replace("SHEAR", shear).replace("LEVELS", str(levels)), "body", ())
        scene = study.scenes[0]
        level = level or Level(list(mesh_family(build(scene.body), study.mesh))[-1], scene)
        condensed.append((level.condensed(scene).problem, rng.uniform(1.2, 2.5)))
    assert level is not None
    family, lambda_1 = Family(BODY, level.line.m, BODY_RATIO), level.lambda_1(scene)
    found = []
    for load, (problem, size) in enumerate(condensed):
        traction = np.abs(problem.l_tilde / problem.c)
        law = weakening(family.ratio, lambda_1, float(np.quantile(traction, 0.9)) / size)
        found.append(Case(family, load, ContactProblem(problem.A_tilde, problem.l_tilde, problem.c, law)))
    return found
