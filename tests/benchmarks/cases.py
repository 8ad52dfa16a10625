"""Contact problems of the comparisons, on synthetic lines and on real bodies from the study text
on.

softening   ω/λ₁ from 0.1 to 100 against m from 10 to 1000: slip weakening to half its peak, half-Laplacian stiffness
down-jumps  height of the down-jumps of b against their number on each side (ω is infinite)
up-jumps    height of the up-jumps of b against their number on each side; b falls back between them
units       slips and tractions measured in units of 1e-9 to 1e9 of their own, ω/λ₁ = 2
poisson     ω/λ₁ against 1 − 2ν from 1 to 2e-7 (ν = 0.4999999), λ₁ being that of the mesh at this ν
heat        ω/λ₁ against α from 1e-12 to 1e12
shape       aspect ratio of the body from 1 to 1000 against the flatness of the flattest triangles
weak        ω/λ₁ against the load over the peak of b, up to 1e12: friction that is lost in the load

Synthetic lines carry random sums of five waves whose largest traction is 1.2 to 2.5 times the peak
of b. The body is a block clamped at its left end, heated inside, cooled at its right end, on a
softening film, under random shear.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from tcstudy.contact.problem import ContactProblem, least_eigenvalue
from tcstudy.laws.laws import Laws
from tests.contact.contact_cases import (
    half_laplacian,
    linear_law,
    rescaled,
    sawtooth,
    slip_weakening,
)

if TYPE_CHECKING:
    from tcstudy.fem.geometry import Geometry
    from tcstudy.fem.meshes import PlaneMesh

Array = NDArray[np.float64]

RESULTS = Path(__file__).resolve().parents[2] / "results"
SHAPE, WEAK = "shape", "weak"
REACH, NODES = 0.3, 30
"""Slip over which the teeth are spread, what the loads cause; m of the maps of jumps and units."""
BLOCK = """
units: none
body: {rectangle: {width: WIDTH, height: 1}}
boundary: {bottom: contact, left: clamped, right: convection, top: {role: traction, g: ["SHEAR", 0]}}
material: {E: 1, nu: NU, k: 1, alpha_T: 0.05}
heat: {alpha: ALPHA, theta_bar: 0.3, q: "1 + x/WIDTH"}
friction: {law: tresca, tau: 1}
mesh: {maxh: 0.15, levels: 2}
"""
RECTANGLE = """
units: none
body: {rectangle: {width: WIDTH, height: 1}}
boundary: {bottom: contact, left: clamped, right: free, top: {role: traction, g: ["SHEAR", 0]}}
material: {E: 1, nu: 0.3}
friction: {law: tresca, tau: 1}
mesh: {maxh: 0.08, levels: 4}
"""
COLUMNS, LAYERS = 40, 4
"""Rectangles along and across the structured mesh of the shape map."""


@dataclass(frozen=True)
class Grid:
    """Extent of the maps; the full one by default.

    powers: units as powers of ten;  loads: random ones for every cell
    thinner: thickness of an even mesh layer over that of the thinnest layer, the one on the contact line
    excess: load over the peak of b
    """

    ratios: tuple[float, ...] = tuple(float(f"{r:.3g}") for r in np.geomspace(0.1, 100.0, 9))
    sizes: tuple[int, ...] = (10, 30, 100, 300, 1000)
    heights: tuple[float, ...] = (0.01, 0.03, 0.1, 0.3, 0.6, 0.9)
    teeth: tuple[int, ...] = (1, 3, 10, 30, 100)
    powers: tuple[int, ...] = (-9, -4, 0, 4, 9)
    nu: tuple[float, ...] = (0.0, 0.3, 0.45, 0.49, 0.499, 0.4999, 0.49999, 0.499999, 0.4999999)
    alpha: tuple[float, ...] = tuple(10.0**power for power in range(-12, 13, 3))
    aspects: tuple[float, ...] = (1.0, 3.0, 10.0, 30.0, 100.0, 300.0, 1000.0)
    thinner: tuple[float, ...] = (1.0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6)
    excess: tuple[float, ...] = tuple(10.0**power for power in range(0, 13, 2))
    loads: int = 3


@dataclass(frozen=True)
class Case:
    """One contact problem of a map, and its cell there.

    heat_balance: relative defect of α∫(θ − θ̄) = ∫q, NaN without a heat problem
    """

    map: str
    x: float
    y: float
    load: int
    problem: ContactProblem
    heat_balance: float = np.nan


def options(words: str | None, *numbers: str, **defaults: float) -> argparse.Namespace:
    """What the command line asks for: options NAME with these defaults, and numbers NAME=DEFAULT in
    their order."""
    parser = argparse.ArgumentParser(
        description=words, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    for name, default in (number.split("=") for number in numbers):
        parser.add_argument(name, nargs="?", type=int, default=int(default))
    for name, value in defaults.items():
        parser.add_argument(f"--{name}", type=type(value), default=value)
    return parser.parse_args()


def publish(name: str, lines: Iterable[str], words: str = "") -> None:
    """Print a page and write it to results/NAME.md, by which command it was made first; chapters
    that other commands add to the page stay."""
    text = "\n".join([f"Made by `python -m tests.benchmarks.{name}{words}`.", *lines, ""])
    page = RESULTS / f"{name}.md"
    chapters = page.read_text(encoding="utf-8").split(CHAPTER)[1:] if page.is_file() else []
    kept = (one for one in chapters if MADE in one and f"{MADE}{name}" not in one)
    page.write_text(text + "".join(CHAPTER + one for one in kept), encoding="utf-8")
    print(text, end="")


CHAPTER, MADE = "\n## ", "Made by `python -m tests.benchmarks."
"""How a chapter of a page begins, and how it says by which command it was made."""


def publish_chapter(page: str, title: str, command: str, lines: Iterable[str]) -> None:
    """Print a chapter of a page, and put it into results/PAGE.md in place of the one of this title.

    command: the module that makes it, with its words
    """
    file = RESULTS / f"{page}.md"
    first, *chapters = file.read_text(encoding="utf-8").split(CHAPTER)
    text = "\n".join([f"{title}", "", f"{MADE}{command}`.", *lines, ""])
    others = [one for one in chapters if one.partition("\n")[0] != title]
    file.write_text(CHAPTER.join([first, *others, text]), encoding="utf-8")
    print(text, end="")


def synthetic(grid: Grid) -> Iterator[Case]:
    """All cases on synthetic lines, small problems before large ones."""
    for m in grid.sizes:
        A_tilde, c = half_laplacian(m)
        lambda_1 = least_eigenvalue(A_tilde, c)
        for ratio in grid.ratios:
            yield from _line(
                "softening", ratio, m, A_tilde, c, weakening(ratio, lambda_1), grid.loads
            )
    A_tilde, c = half_laplacian(NODES)
    for name, shape in (("down-jumps", down_jumps), ("up-jumps", up_jumps)):
        for teeth in grid.teeth:
            for height in grid.heights:
                yield from _line(name, height, teeth, A_tilde, c, shape(height, teeth), grid.loads)
    law = weakening(2.0, least_eigenvalue(A_tilde, c))
    for slip in grid.powers:
        for traction in grid.powers:
            for case in _line("units", slip, traction, A_tilde, c, law, grid.loads):
                own = rescaled(case.problem, 10.0**slip, 10.0**traction, 1.0)
                yield Case(case.map, slip, traction, case.load, own)


def real(grid: Grid) -> Iterator[Case]:
    for nu in grid.nu:
        for load, body in enumerate(_bodies(BLOCK, grid.loads, nu=nu)):
            for ratio in grid.ratios:
                yield Case(
                    "poisson", ratio, 1.0 - 2.0 * nu, load, body.softened(ratio), body.heat_balance
                )
    for alpha in grid.alpha:
        for load, body in enumerate(_bodies(BLOCK, grid.loads, alpha=alpha)):
            for ratio in grid.ratios:
                yield Case("heat", ratio, alpha, load, body.softened(ratio), body.heat_balance)
    for aspect in grid.aspects:
        for thinner in grid.thinner:
            for load, body in enumerate(_bodies(BLOCK, grid.loads, aspect=aspect, thinner=thinner)):
                yield Case(SHAPE, aspect, thinner, load, body.softened(2.0), body.heat_balance)
    for load, body in enumerate(_bodies(BLOCK, grid.loads)):
        for excess in grid.excess:
            for ratio in grid.ratios:
                yield Case(
                    WEAK, ratio, excess, load, body.softened(ratio, excess), body.heat_balance
                )


def families(
    sizes: tuple[int, ...] = (50, 200, 1000), loads: int = 6, body: bool = True
) -> Iterator[list[Case]]:
    """Problems of one law and size, small ones first: slip weakening (x = ω/λ₁, y = m), a
    saw-tooth, a rectangle."""
    for m in sizes:
        A_tilde, c = half_laplacian(m)
        for ratio in (0.5, 2.0, 8.0):
            law = weakening(ratio, least_eigenvalue(A_tilde, c))
            yield list(_line(f"m = {m}", ratio, m, A_tilde, c, law, loads))
        if m <= 200:
            yield list(_line("saw-tooth", np.inf, m, A_tilde, c, sawtooth(), loads))
    if body:
        bodies = list(_bodies(RECTANGLE, loads))
        yield [
            Case("body", 2.0, b.problem.m, load, b.softened(2.0, b.size))
            for load, b in enumerate(bodies)
        ]


def weakening(ratio: float, lambda_1: float, peak: float = 1.0) -> Laws:
    """Slip weakening from `peak` to half of it at the rate ω = ratio·λ₁."""
    return slip_weakening(peak, 0.5 * peak, 0.5 * peak / (ratio * lambda_1))


def down_jumps(height: float, teeth: int, reach: float = REACH) -> Laws:
    """Odd: 1 on the first tooth, then b rises from 1 − height to 1 and falls down again at the end
    of every tooth."""
    high, low = np.ones(teeth), np.full(teeth, 1.0 - height)
    return _odd("down-jumps", np.arange(1, teeth + 1) * reach / teeth, high, low)


def up_jumps(height: float, teeth: int, reach: float = REACH) -> Laws:
    """Odd: on every tooth b falls from 1 to 1 − height, ω = height·teeth/reach, and jumps up to 1
    at its end."""
    high, low = np.ones(teeth), np.full(teeth, 1.0 - height)
    return _odd("up-jumps", np.arange(1, teeth + 1) * reach / teeth, low, high)


def _odd(name: str, kinks: Array, left: Array, right: Array) -> Laws:
    """The odd law with the stick interval [−1, 1] at 0 and these limits at the kinks s > 0,
    constant at the end."""
    below, above = [*-right[::-1], -1.0, *left], [*-left[::-1], 1.0, *right]
    return linear_law(name, [*-kinks[::-1], 0.0, *kinks], below, above, (0.0, 0.0))


def _waves(rng: np.random.Generator) -> tuple[float, list[tuple[int, float, float]]]:
    """Mean and (wave number, amplitude, phase) of a random load."""
    return rng.normal(), [(k, rng.normal() / k, rng.uniform(0, 2 * np.pi)) for k in range(1, 6)]


def _line(
    name: str, x: float, y: float, A_tilde: Array, c: Array, law: Laws, loads: int
) -> Iterator[Case]:
    """A synthetic line under its random loads."""
    m = len(c)
    at = (np.arange(m) + 0.5) / m
    for load in range(loads):
        rng = np.random.default_rng([load, m])
        mean, waves = _waves(rng)
        shape = mean + sum(a * np.sin(k * np.pi * at + phase) for k, a, phase in waves)
        traction = shape * rng.uniform(1.2, 2.5) / np.max(np.abs(shape))
        yield Case(name, x, y, load, ContactProblem(A_tilde, c * traction, c, law))


@dataclass(frozen=True)
class Body:
    """A condensed body under one load; size: a random load over the peak of b."""

    problem: ContactProblem
    lambda_1: float
    heat_balance: float
    size: float

    def softened(self, ratio: float, excess: float = 1.5) -> ContactProblem:
        """The problem with slip weakening at ω = ratio·λ₁ and a peak of the 90 % load over
        `excess`."""
        p = self.problem
        peak = float(np.quantile(np.abs(p.l_tilde / p.c), 0.9)) / excess
        return ContactProblem(p.A_tilde, p.l_tilde, p.c, weakening(ratio, self.lambda_1, peak))


def _bodies(
    text: str,
    loads: int,
    nu: float = 0.3,
    alpha: float = 1.0,
    aspect: float = 2.0,
    thinner: float | None = None,
) -> Iterator[Body]:
    """A body under its random loads: one mesh and one factorisation. thinner: None for a mesh of
    the mesher."""
    # NGSolve is loaded only if real bodies take part
    from tcstudy.fem.geometry import build
    from tcstudy.offline.level import Level
    from tcstudy.read.study import read_study_text
    from tests.verification.scenes import mesh_family

    level = None
    for word, value in (("WIDTH", aspect), ("NU", nu), ("ALPHA", alpha)):
        text = text.replace(word, repr(value))
    for load in range(loads):
        rng = np.random.default_rng([load, 0])
        mean, waves = _waves(rng)
        terms = (f" + ({a:.6f})*sin({k}*pi*x/{aspect!r} + {phase:.6f})" for k, a, phase in waves)
        study = read_study_text(text.replace("SHEAR", f"{mean:.6f}" + "".join(terms)), "block", ())
        scene = study.scenes[0]
        if level is None:
            geometry = build(scene.body)
            *_, mesh = (
                mesh_family(geometry, study.mesh)
                if thinner is None
                else [layered(geometry, aspect, thinner)]
            )
            level = Level(mesh, scene)
        balance = level.temperature(scene).heat_balance
        yield Body(
            level.condensed(scene).problem, level.lambda_1(scene), balance, rng.uniform(1.2, 2.5)
        )


def layered(geometry: Geometry, width: float, thinner: float) -> PlaneMesh:
    """A structured mesh of the block with a thin layer of obtuse triangles on the contact line.

    Every second row is shifted by half a column, so that the layer's triangles have angles near
    180°, the shape that spoils constants of finite elements (flat right-angled triangles would
    not).
    """
    import ngsolve.meshes

    from tcstudy.fem.meshes import _extract

    levels = np.arange(LAYERS + 1) / LAYERS
    levels[1] /= thinner

    def place(x: float, y: float) -> tuple[float, float]:
        row, column = round(y * LAYERS), round(x * COLUMNS)
        shift = 0.5 if row % 2 and 0 < column < COLUMNS else 0.0
        return width * (column + shift) / COLUMNS, float(levels[row])

    mesh = ngsolve.meshes.MakeStructured2DMesh(quads=False, nx=COLUMNS, ny=LAYERS, mapping=place)
    names = {curve.name: f"c{i}" for i, curve in enumerate(geometry.curves)}
    for number, name in enumerate(mesh.GetBoundaries()):
        mesh.ngmesh.SetBCName(number, names[name])
    return _extract(ngsolve.Mesh(mesh.ngmesh), replace(geometry, unit=1.0), 0, time.perf_counter())
