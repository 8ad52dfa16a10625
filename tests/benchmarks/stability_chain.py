"""What is mapped on real bodies, from the study text to the condensed problem: ν, α, aspect ratio, mesh and load.

poisson  ω/λ₁ against 1 − 2ν from 1 to 2e-7 (ν = 0.4999999), λ₁ being that of the mesh at this ν
heat     ω/λ₁ against α from 1e-12 to 1e12
shape    aspect ratio of the body from 1 to 1000 against the flatness of the flattest triangles
weak     ω/λ₁ against the load over the peak of b, up to 1e12: friction that is lost in the load

Body: a block clamped at its left end, heated inside, cooled at its right end, on a softening film, under random shear.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from tcstudy.contact.problem import ContactProblem
from tcstudy.scene.records import Scene
from tcstudy.scene.study import MeshPlan
from tests.benchmarks.problems import weakening
from tests.benchmarks.stability_maps import RATIOS, Case, waves

if TYPE_CHECKING:
    from tcstudy.fem.geometry import Geometry
    from tcstudy.fem.meshes import PlaneMesh

POISSON, HEAT, SHAPE, WEAK = "poisson", "heat", "shape", "weak"
CHAIN = (POISSON, HEAT, SHAPE, WEAK)

NU = (0.0, 0.3, 0.45, 0.49, 0.499, 0.4999, 0.49999, 0.499999, 0.4999999)
ALPHA = tuple(10.0**power for power in range(-12, 13, 3))
ASPECTS = (1.0, 3.0, 10.0, 30.0, 100.0, 300.0, 1000.0)
THINNER = (1.0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6)
"""Thickness of an even mesh layer over that of the thinnest layer, the one on the contact line."""
EXCESS = tuple(10.0**power for power in range(0, 13, 2))
"""Load over the peak of b."""

STUDY = """
units: none
body: {rectangle: {width: WIDTH, height: 1}}
boundary: {bottom: contact, left: clamped, right: convection, top: {role: traction, g: ["SHEAR", 0]}}
material: {E: 1, nu: NU, k: 1, alpha_T: 0.05}
heat: {alpha: ALPHA, theta_bar: 0.3, q: "1 + x/WIDTH"}
friction: {law: tresca, tau: 1}
mesh: {maxh: 0.15, levels: 2}
"""

COLUMNS, LAYERS = 40, 4
"""Rectangles along and across the structured mesh of the shape map."""


@dataclass(frozen=True)
class ChainGrid:
    """Extent of the maps of real bodies."""

    ratios: tuple[float, ...] = RATIOS
    nu: tuple[float, ...] = NU
    alpha: tuple[float, ...] = ALPHA
    aspects: tuple[float, ...] = ASPECTS
    thinner: tuple[float, ...] = THINNER
    excess: tuple[float, ...] = EXCESS
    loads: int = 3


def chain(grid: ChainGrid) -> Iterator[Case]:
    """All cases on real bodies."""
    for nu in grid.nu:
        for load, body in enumerate(_bodies(grid.loads, nu=nu)):
            for ratio in grid.ratios:
                yield Case(POISSON, ratio, 1.0 - 2.0 * nu, load, *body.softened(ratio))
    for alpha in grid.alpha:
        for load, body in enumerate(_bodies(grid.loads, alpha=alpha)):
            for ratio in grid.ratios:
                yield Case(HEAT, ratio, alpha, load, *body.softened(ratio))
    for aspect in grid.aspects:
        for thinner in grid.thinner:
            for load, body in enumerate(_bodies(grid.loads, aspect=aspect, thinner=thinner)):
                yield Case(SHAPE, aspect, thinner, load, *body.softened(2.0))
    for load, body in enumerate(_bodies(grid.loads)):
        for excess in grid.excess:
            for ratio in grid.ratios:
                yield Case(WEAK, ratio, excess, load, *body.softened(ratio, excess))


@dataclass(frozen=True)
class Body:
    """A condensed body under one load: the problem without its law, λ₁, the heat balance."""

    problem: ContactProblem
    lambda_1: float
    heat_balance: float

    def softened(self, ratio: float, excess: float = 1.5) -> tuple[ContactProblem, float]:
        """The problem with slip weakening at ω = ratio·λ₁ and a peak of the 90 % load over `excess`; heat balance."""
        p = self.problem
        peak = float(np.quantile(np.abs(p.l_tilde / p.c), 0.9)) / excess
        law = weakening(ratio, self.lambda_1, peak)
        return ContactProblem(p.A_tilde, p.l_tilde, p.c, law), self.heat_balance


def _bodies(
    loads: int, nu: float = 0.3, alpha: float = 1.0, aspect: float = 2.0, thinner: float | None = None
) -> Iterator[Body]:
    """The body under its random loads: one mesh and one factorisation. thinner: None for a mesh of the mesher."""
    # NGSolve is loaded only if real bodies take part
    from tcstudy.fem.geometry import build
    from tcstudy.offline.level import Level
    from tests.verification.scenes import mesh_family

    level = None
    for load in range(loads):
        scene, plan = _scene(load, nu, alpha, aspect)
        if level is None:
            geometry = build(scene.body)
            mesh = list(mesh_family(geometry, plan))[-1] if thinner is None else layered(geometry, aspect, thinner)
            level = Level(mesh, scene)
        problem = level.condensed(scene).problem
        yield Body(problem, level.lambda_1(scene), level.temperature(scene).heat_balance)


def _scene(load: int, nu: float, alpha: float, aspect: float) -> tuple[Scene, MeshPlan]:
    """The scene under one random load, and its mesh plan."""
    from tcstudy.read.study import read_study_text

    mean, parts = waves(np.random.default_rng([load, 0]))
    terms = (f" + ({a:.6f})*sin({k}*pi*x/{aspect!r} + {phase:.6f})" for k, a, phase in parts)
    text = STUDY.replace("WIDTH", repr(aspect)).replace("SHEAR", f"{mean:.6f}" + "".join(terms))
    study = read_study_text(text.replace("NU", repr(nu)).replace("ALPHA", repr(alpha)), "block", ())
    return study.scenes[0], study.mesh


def layered(geometry: Geometry, width: float, thinner: float) -> PlaneMesh:
    """A structured mesh of the block with a thin layer of obtuse triangles on the contact line.

    Every second row is shifted by half a column, so that the layer's triangles have angles near 180°, the shape that
    spoils constants of finite elements (flat right-angled triangles would not).
    """
    import ngsolve.meshes

    from tcstudy.fem.meshes import _extract

    levels = np.arange(LAYERS + 1) / LAYERS
    levels[1] /= thinner

    def place(x: float, y: float) -> tuple[float, float]:
        row = round(y * LAYERS)
        column = round(x * COLUMNS)
        shift = 0.5 if row % 2 and 0 < column < COLUMNS else 0.0
        return width * (column + shift) / COLUMNS, float(levels[row])

    mesh = ngsolve.meshes.MakeStructured2DMesh(quads=False, nx=COLUMNS, ny=LAYERS, mapping=place)
    names = {curve.name: curve.tag for curve in geometry.curves}
    for number, name in enumerate(mesh.GetBoundaries()):
        mesh.ngmesh.SetBCName(number, names[name])
    return _extract(ngsolve.Mesh(mesh.ngmesh), geometry, 0, time.perf_counter(), 1.0)
