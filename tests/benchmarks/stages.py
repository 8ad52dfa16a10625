"""Time of every stage of a cold point against N, and of our condensation against other factorisations.

Times are process CPU times (the machine is shared), one thread, no TaskManager. What is compared runs in turn on the
same matrix: ours gives factor, Ã and condition estimate, the others a factor alone.
"""

from __future__ import annotations

import gc
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import ngsolve as ngs
import numpy as np
import scipy.sparse.linalg as spla
import xarray as xr

import tcstudy
from tcstudy.condense import condense
from tcstudy.contact.certificates import certify
from tcstudy.contact.contact import solve_contact
from tcstudy.contact.problem import least_eigenvalue
from tcstudy.fem.forms import ElasticForms
from tcstudy.fem.geometry import build
from tcstudy.fem.meshes import PlaneMesh
from tcstudy.offline.level import Level
from tcstudy.scene.records import Scene
from tcstudy.scene.study import Study
from tests.verification.scenes import mesh_family

QUICKSTART = Path(__file__).resolve().parents[2] / "configs" / "quickstart.yaml"
MAXH = "13.6 mm"
LEVELS = (3, 4, 5, 6, 7)
"""3.8e3 to 9.9e5 displacement unknowns."""
STAGES = ("mesh", "assembly", "elastic factor, Ã", "heat factor, S_K", "loads, l̃", "λ₁", "contact solve", "certificate")
FACTORS = ("tcstudy, with Ã", "NGSolve sparsecholesky", "NGSolve umfpack", "scipy splu")
LARGEST = {"NGSolve umfpack": 3e5, "scipy splu": 1e5}
"""Unknowns beyond which a factorisation is not run: minutes, and gigabytes."""


def study_of(levels: int, *overrides: str) -> Study:
    """The quickstart body with so many levels."""
    return tcstudy.load(QUICKSTART, [f"mesh.maxh={MAXH}", f"mesh.levels={levels}", "sweep={}", *overrides])


def finest(study: Study) -> PlaneMesh:
    """The last mesh of a study."""
    for mesh in mesh_family(build(study.scenes[0].body), study.mesh):
        last = mesh
    return last


class Clock:
    """CPU seconds since the last reading."""

    def __init__(self) -> None:
        self.last = time.process_time()

    def __call__(self) -> float:
        now = time.process_time()
        passed, self.last = now - self.last, now
        return passed


def repeats(levels: int) -> int:
    """Runs of one size."""
    return 9 if levels < 5 else 5 if levels < 6 else 3


def measure(progress: Callable[[str], None]) -> xr.Dataset:
    """(size, stage, run) and (size, factor, run) CPU times, with n_dof and m of the sizes."""
    most = max(map(repeats, LEVELS))
    stages = np.full((len(LEVELS), len(STAGES), most), np.nan)
    factors = np.full((len(LEVELS), len(FACTORS), most), np.nan)
    n_dof, m = np.zeros(len(LEVELS), dtype=np.int32), np.zeros(len(LEVELS), dtype=np.int32)
    for i, levels in enumerate(LEVELS):
        study = study_of(levels)
        if i == 0:  # what is loaded and planned once is no part of any stage
            list(_stages(Level(finest(study), study.scenes[0]), study.scenes[0], Clock()))
        for run in range(repeats(levels)):
            clock = Clock()
            mesh = finest(study)
            time_mesh = clock()
            level = Level(mesh, study.scenes[0])
            n_dof[i], m[i] = level.frames.n_dof, level.line.m
            stages[i, :, run] = [time_mesh, clock(), *_stages(level, study.scenes[0], clock)]
            del level
            factors[i, :, run] = list(_factors(mesh, study.scenes[0], n_dof[i]))
            gc.collect()
        known = stages[i, :, : repeats(levels)]
        progress(f"{n_dof[i]} unknowns: {np.median(known, axis=1).sum():.2f} s a cold point")
    return xr.Dataset(
        {
            "stage_time": (("size", "stage", "run"), stages, {"units": "s", "long_name": "CPU time of a stage"}),
            "factor_time": (("size", "factor", "run"), factors, {"units": "s", "long_name": "CPU time of a factor"}),
            "n_dof": ("size", n_dof, {"units": "1", "long_name": "displacement unknowns"}),
            "m": ("size", m, {"units": "1", "long_name": "contact unknowns"}),
        },
        {"stage": list(STAGES), "factor": list(FACTORS)},
    )


def _stages(level: Level, scene: Scene, clock: Clock) -> Iterator[float]:
    """CPU times from the elastic factor on, in the order of STAGES."""
    clock()
    body, mu = level._body(scene), scene.material.mu
    elastic = clock()
    least_eigenvalue(body.A_tilde(mu), level.line.c)
    lowest = clock()
    yield elastic - lowest
    level.temperatures._whole(scene)  # the heat factor, its spectrum and the condensed source
    yield clock()
    condensed = level.condensed(scene)
    yield clock()
    yield lowest
    answer = solve_contact(condensed.problem)
    yield clock()
    certify(condensed.problem, answer.v, level.lambda_1(scene))
    yield clock()


def _factors(mesh: PlaneMesh, scene: Scene, n_dof: int) -> Iterator[float]:
    """CPU times of the factorisations of one stiffness matrix, Γ_D and u_N on Γ_C held."""
    level = Level(mesh, scene)
    frames, line = level.frames, level.line
    matrix = ElasticForms(mesh).stiffness_of((((), scene.material.lam, scene.material.mu),), frames)
    eliminate = ~frames.fixed
    eliminate[line.nodes] = False
    clock = Clock()
    condense(matrix, mesh.points, line.nodes, eliminate, components=2)
    yield clock()
    form, free = _ngsolve_matrix(mesh, scene, frames.fixed)
    for name in FACTORS[1:]:
        clock()
        if n_dof > LARGEST.get(name, np.inf):
            yield float("nan")
        elif name == "scipy splu":
            rows = np.flatnonzero(~frames.fixed)
            part = matrix[rows][:, rows].tocsc()
            clock()
            spla.splu(part)
            yield clock()
        else:
            form.mat.Inverse(free, inverse=name.split()[1])
            yield clock()


def _ngsolve_matrix(mesh: PlaneMesh, scene: Scene, fixed: np.ndarray) -> tuple[Any, Any]:
    """The same matrix as NGSolve would hold it: its own form, with the film along x held in y (no turned nodes)."""
    space = ngs.VectorH1(mesh.mesh, order=1)
    u, v = space.TnT()
    strain = ngs.InnerProduct(ngs.Sym(ngs.Grad(u)), ngs.Sym(ngs.Grad(v)))
    energy = scene.material.lam * ngs.div(u) * ngs.div(v) + 2 * scene.material.mu * strain
    free = ngs.BitArray(space.ndof)
    free.Clear()
    for row in np.flatnonzero(~fixed):
        free.Set(int(row))
    form = ngs.BilinearForm(energy * ngs.dx, symmetric=True).Assemble()
    return form, free
