"""What a run takes, measured: some points of the study on meshes small enough to wait for, scaled to all of its own.

The CPU time of FEW points of a level with N displacement and m contact unknowns is t = a + b m + c N^p, p = 1.08
(results/speed.md), a, b, c ≥ 0 by least squares of relative errors: contact problems grow with m, matrices and factors
with N, the latter with each ratio of moduli. A point more is measured by MANY points on the coarsest mesh and grows
with m as in results/online.md. Not known before a run: how many meshes an estimate asks for, what steps of a history
and of the bundle method take, and points that are slow on meshes much coarser than theirs.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy import optimize
from threadpoolctl import threadpool_limits

from tcstudy.errors import GeometryFailed
from tcstudy.offline.level import Level
from tcstudy.scene.study import MeshPlan, Study
from tcstudy.study.expected import MEMORY, START, UNKNOWN, meshing_seconds
from tcstudy.study.jobs import NODE, POINT, LevelForecast, Resources, refined
from tcstudy.study.plan import Plan, of_geometries, plan
from tcstudy.study.run import stages

Plans = Callable[[Sequence[Study]], Iterable[Plan]]
"""The forecasts of studies of one geometry each."""
SMALL, LARGE = 1_000, 16_000
"""Displacement unknowns of the first mesh of a trial, unless the study's own are fewer, and of its last about."""
FEW, MANY = 8, 128
ENOUGH = 0.5
"""Seconds of a level after which a trial makes no finer one."""
FAR = 4.0
"""Unknowns over those of the finest mesh of such a trial up to which it tells what a run takes."""
POWER = 1.08
FACTOR = 0.5
"""Of what grows with N, what every ratio of moduli takes again: factor and loads (results/speed.md)."""
WRITTEN = 6e-5
"""Seconds that a point takes to the file (tcstudy/README.md, Many machines)."""


def plan_and_resources(study: Study, plans: Plans = lambda studies: map(plan, studies)) -> tuple[Plan, Resources]:
    """The forecast of a study, and what a run takes; plans: who makes the forecasts of several geometries.

    Raises GeometryFailed where a run would before it solves anything.
    """
    geometries = [one.study for one in study.variants if one.study is not None] or [study]
    found = list(zip(geometries, plans(geometries), strict=True))
    whole = of_geometries(study, found) if study.variants else found[0][1]
    sizes = [refined(own.levels, study.mesh) for _, own in found]
    most = max((level.n_dof for levels in sizes for level in levels), default=0)
    memory, why = MEMORY + UNKNOWN * most, unknown(study)
    if why:
        return whole, Resources(math.nan, memory, why)
    largest = max(range(len(found)), key=lambda i: max(level.n_dof for level in sizes[i]))
    try:
        rates = Rates.of(geometries[largest], sizes[largest])
    except GeometryFailed:
        return whole, Resources(math.nan, memory, "the coarser meshes of a trial cannot be made")
    if rates.slow and most > FAR * rates.n_dof:
        why = f"{rates.slow:.1g} s on a mesh of {rates.n_dof} unknowns do not tell what its points take on {most}"
        return whole, Resources(math.nan, memory, why)
    meshing = sum(meshing_seconds(own.mesh, levels) for (own, _), levels in zip(found, sizes, strict=True))
    solving = sum(rates.seconds(own, levels, p.factorisations) for (own, p), levels in zip(found, sizes, strict=True))
    return whole, Resources(START + solving + (meshing if study.mesh.nested else 0.0), memory)


def unknown(study: Study) -> str:
    """Why nobody can tell how long a run takes; empty if a trial tells."""
    if study.history is not None:
        return "a step of a history takes as long as what slips and jumps in it asks for"
    if study.kind in ("path", "fit"):
        return f"a {study.kind} takes as many steps as what slips and jumps on it asks for"
    if study.mesh.open_ended:
        return "the estimated error decides about the meshes"
    if not study.solver.in_blocks:
        return "the points are solved one by one, and the steps of their solvers are not known"
    return ""


@dataclass(frozen=True)
class Rates:
    """What a trial measured.

    terms: (3,) a, b, c of FEW points, of so many ratios of moduli;  more: of a point more, over POINT + NODE m [s]
    n_dof: of the finest mesh;  slow: seconds that its points took, if these were too many for a finer one
    """

    terms: NDArray[np.float64]
    ratios: int
    more: float
    n_dof: int
    slow: float

    @classmethod
    def of(cls, study: Study, levels: Sequence[LevelForecast]) -> Rates:
        """Measured on meshes of a family with those of `levels`. Raises GeometryFailed."""
        few, many = _sample(study, FEW), _sample(study, MANY)
        meshes, found = coarser(study.mesh, levels), list[tuple[int, int, float]]()
        with threadpool_limits(1, user_api="blas"):
            for n_dof, m, seconds in _timed(replace(few, mesh=meshes)):
                found.append((n_dof, m, seconds))
                if seconds > ENOUGH:
                    break
            more = 0.0
            if len(few.scenes) < len(study.scenes) and found[0][2] < ENOUGH:
                _, m, seconds = next(_timed(replace(many, mesh=meshes)))
                more = max(0.0, seconds - found[0][2]) / (len(many.scenes) - len(few.scenes)) / (POINT + NODE * m)
        slow = found[-1][2] if found[-1][2] > ENOUGH and len(found) < meshes.levels else 0.0
        measured = np.array(found)
        terms = np.array([0.0, measured[0, 2] / measured[0, 1], 0.0])
        if len(found) > 1:
            time = np.maximum(measured[:, 2], 1e-3)
            terms = optimize.nnls(_terms(measured[:, :2]) / time[:, None], np.ones(len(time)))[0]
        return cls(terms, len({Level.ratio(scene) for scene in few.scenes}), more, found[-1][0], slow)

    def seconds(self, study: Study, levels: Sequence[LevelForecast], factorisations: int) -> float:
        """Of all points of a study on these meshes."""
        size = np.array([(level.n_dof, level.n_contact) for level in levels], dtype=float)
        factors = (1.0 + FACTOR * (factorisations - 1)) / (1.0 + FACTOR * (self.ratios - 1))
        each = (self.terms * [1.0, 1.0, factors] * _terms(size)).sum()
        rest = max(0, len(study.scenes) - FEW) * float(np.sum(self.more * (POINT + NODE * size[:, 1])))
        return float(each) + rest + WRITTEN * len(study.scenes) * len(levels)


def _sample(study: Study, count: int) -> Study:
    """The study with so many of its points, spread over all."""
    places = np.unique(np.linspace(0, len(study.scenes) - 1, count).astype(int))
    scenes = tuple(study.scenes[int(i)] for i in places)
    return replace(study, scenes=scenes, axes=(), design=None, output=replace(study.output, live=False))


def coarser(mesh: MeshPlan, levels: Sequence[LevelForecast]) -> MeshPlan:
    """The same meshes, coarser if they are large: from SMALL unknowns on, to those of the study or to LARGE."""
    factor = max(1.0, math.sqrt(levels[0].n_dof / SMALL))
    maxh = tuple(factor * h for h in mesh.maxh)
    if mesh.listed:
        return replace(mesh, maxh=maxh)
    ratio = min(LARGE, max(level.n_dof for level in levels)) * factor**2 / levels[0].n_dof
    return replace(mesh, maxh=maxh, levels=1 + max(0, math.floor(math.log(max(ratio, 1.0), 4) + 0.5)))


def _timed(study: Study) -> Iterator[tuple[int, int, float]]:
    """N, m and CPU seconds of the levels of a run."""
    begin = time.process_time()
    for stage in stages(study):
        points = sum(map(len, stage.blocks))
        assert stage.level is not None
        assert points
        yield stage.level.frames.n_dof, stage.level.line.m, time.process_time() - begin
        begin = time.process_time()


def _terms(size: NDArray[np.float64]) -> NDArray[np.float64]:
    """(levels, 3) 1, m and N^p of (levels, 2) N and m."""
    return np.stack([np.ones(len(size)), size[:, 1], size[:, 0] ** POWER], axis=1)
