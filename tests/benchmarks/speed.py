"""Speed of a point and of a sweep: `python -m tests.benchmarks.speed` writes results/speed.md in
ten minutes; with `--against CHECKOUT` its factor is measured beside ours.

MUMPS takes part where its Python package (python-mumps) is installed.

Times are process CPU times (the machine is shared), one thread, no TaskManager. What is compared
runs in turn on the same matrix: ours gives factor, Ã and condition estimate, MUMPS factor and Ã, the
others a factor alone.
"""

import argparse
import gc
import importlib
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import ngsolve as ngs
import numpy as np
import scipy.sparse.linalg as spla
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

import tcstudy
from tcstudy.condense import condense
from tcstudy.contact.certificates import certify
from tcstudy.contact.problem import least_eigenvalue
from tcstudy.contact.solve import solve_contact
from tcstudy.fem.forms import ElasticForms
from tcstudy.fem.geometry import build
from tcstudy.fem.meshes import PlaneMesh
from tcstudy.offline.level import Level
from tcstudy.scene.records import Scene
from tcstudy.scene.study import Study
from tcstudy.study.level_solver import solve_point
from tests.benchmarks.cases import publish
from tests.benchmarks.peers import machine
from tests.verification.scenes import mesh_family

Array = NDArray[np.float64]

QUICKSTART = Path(__file__).resolve().parents[2] / "configs" / "quickstart.yaml"
LEVELS = {3: 9, 4: 9, 5: 5, 6: 3, 7: 3}
"""Levels, from 3.8e3 to 9.9e5 displacement DOFs, and runs of each."""
ASYMPTOTIC = 1e4
"""Unknowns from which exponents are fitted."""
STAGES = (
    "mesh",
    "assembly",
    "elastic factor, Ã",
    "heat factor, S_K",
    "loads, l̃",
    "λ₁",
    "contact solve",
    "certificate",
)
LARGEST = {"NGSolve umfpack": 3e5, "scipy splu": 1e5}
"""Unknowns beyond which a factorisation is not run: minutes, and gigabytes."""
SWEEPS = {"10 α × 10 θ̄ × 10 laws": (10, 10, 10), "α alone": (1000, 1, 1)}
SWEPT, RUNS, SOLVED = (5, "10.5 mm"), 5, 40
"""Levels and mesh of the sweeps, runs of each, contact solves that are timed."""


def study_of(levels: int, maxh: str = "13.6 mm", sweep: str = "{}") -> Study:
    """The quickstart body with so many levels."""
    return tcstudy.load(
        QUICKSTART, [f"mesh.maxh={maxh}", f"mesh.levels={levels}", f"sweep={sweep}"]
    )


def finest(study: Study) -> PlaneMesh:
    *_, last = mesh_family(build(study.scenes[0].body), study.mesh)
    return last


Condense = Callable[..., Any]
"""`tcstudy.condense.condense` of some checkout."""


def condense_of(checkout: str) -> Condense:
    """Return `condense` of another checkout, beside that of this one."""
    ours = {name: sys.modules.pop(name) for name in [*sys.modules] if is_condense(name)}
    package = importlib.import_module("tcstudy")
    path = list(package.__path__)
    package.__path__ = [str(Path(checkout) / "tcstudy")]
    try:
        theirs: Condense = importlib.import_module("tcstudy.condense").condense
    finally:
        package.__path__ = path
    for name in [name for name in sys.modules if is_condense(name)]:
        del sys.modules[name]
    sys.modules.update(ours)
    return theirs


def is_condense(module: str) -> bool:
    return module == "tcstudy.condense" or module.startswith("tcstudy.condense.")


class Clock:
    """CPU seconds since the last reading."""

    def __init__(self) -> None:
        self.last = time.process_time()

    def __call__(self) -> float:
        now = time.process_time()
        passed, self.last = now - self.last, now
        return passed


def stages_and_factors(earlier: Condense | None) -> Iterator[str]:
    """Two tables: CPU times of the stages of a cold point, and of factorisations of its stiffness
    matrix, against N.

    earlier: `condense` of another checkout, to be measured beside ours
    """
    sizes, stages, factors = [], [], []
    for levels, runs in LEVELS.items():
        study = study_of(levels)
        scene, found = study.scenes[0], []
        if not sizes:  # what is loaded and planned once is no part of any stage
            list(_stages(Level(finest(study), scene), scene))
        for _ in range(runs):
            clock = Clock()
            mesh = finest(study)
            time_mesh = clock()
            level = Level(mesh, scene)
            size, built = (level.frames.n_dof, level.line.m), clock()
            own = [time_mesh, built, *_stages(level, scene)]
            del level
            found.append((own, _factors(mesh, scene, earlier)))
            gc.collect()
        sizes.append(size)
        stages.append(np.array([one for one, _ in found]))
        factors.append(np.array([[*one.values()] for _, one in found]))
        names = tuple(found[-1][1])
        print(
            f"{size[0]} unknowns: {np.median(stages[-1], axis=0).sum():.2f} s a cold point",
            flush=True,
        )
    yield from (*_table("stage", STAGES, stages, sizes), "")
    yield from (*_table("factor of the stiffness matrix", names, factors, sizes), "")
    yield "p: time ~ Nᵖ, fitted from N = 10⁴ on; m ~ √N on these meshes, so that in m the exponent is 2p."


def _stages(level: Level, scene: Scene) -> Iterator[float]:
    """CPU times from the elastic factor on, in the order of STAGES."""
    clock = Clock()
    body, mu = level._body(scene), scene.material.mu
    elastic = clock()
    least_eigenvalue(mu * body.condensation.A_tilde, level.line.c)
    lowest = clock()
    yield elastic - lowest
    level.temperatures.of(scene)  # the heat factor, its spectrum and the condensed source
    yield clock()
    condensed = level.condensed(scene)
    yield clock()
    yield lowest
    answer = solve_contact(condensed.problem)
    yield clock()
    certify(condensed.problem, answer.v, level.lambda_1(scene))
    yield clock()


def _factors(mesh: PlaneMesh, scene: Scene, earlier: Condense | None) -> dict[str, float]:
    """Return CPU times of the factorisations of one stiffness matrix, Γ_D and u_N on Γ_C held."""
    level = Level(mesh, scene)
    frames, line = level.frames, level.line
    matrix = ElasticForms(mesh).stiffness_of((((), scene.material.lam, scene.material.mu),), frames)
    eliminate = ~frames.fixed
    eliminate[line.nodes] = False
    case = matrix, mesh.points, line.nodes, eliminate
    free_rows = np.flatnonzero(~frames.fixed)
    part = matrix[free_rows][:, free_rows].tocsc()
    kept_in_part = np.searchsorted(free_rows, line.nodes)
    form, free = _ngsolve_matrix(mesh, scene, frames.fixed)
    plan = condense(*case, components=2).plan
    ways: dict[str, Callable[[], object]] = {
        "tcstudy, with Ã": lambda: condense(*case, components=2),
        "tcstudy, with Ã, order known": lambda: condense(*case, components=2, plan=plan),
        "NGSolve sparsecholesky": lambda: form.mat.Inverse(free, inverse="sparsecholesky"),
        "MUMPS, with Ã": lambda: _mumps_schur(part, kept_in_part),
        "NGSolve umfpack": lambda: form.mat.Inverse(free, inverse="umfpack"),
        "scipy splu": lambda: spla.splu(part),
    }
    if earlier is not None:
        ways["tcstudy of the other checkout, with Ã"] = lambda: earlier(*case, components=2)
    times = dict.fromkeys(ways, float("nan"))
    clock = Clock()
    for name, factorise in ways.items():
        if frames.n_dof <= LARGEST.get(name, np.inf):
            clock()
            factor = factorise()
            times[name] = clock() if factor is not None else float("nan")
            del factor
    return times


def _mumps_schur(A: Any, kept: NDArray[np.intp]) -> object:
    """Return MUMPS' Schur complement of a symmetric matrix, None where it is not installed."""
    try:
        mumps = importlib.import_module("mumps")
    except ImportError:
        return None
    context = mumps.Context()
    context.set_matrix(A, symmetric=True)
    return context.schur(kept, ordering="metis")


def _ngsolve_matrix(mesh: PlaneMesh, scene: Scene, fixed: np.ndarray) -> tuple[Any, Any]:
    """The same matrix as NGSolve would hold it: its own form, with the film along x held in y (no
    turned nodes)."""
    space = ngs.VectorH1(mesh.mesh, order=1)
    (u, v), free = space.TnT(), ngs.BitArray(space.ndof)
    strain = ngs.InnerProduct(ngs.Sym(ngs.Grad(u)), ngs.Sym(ngs.Grad(v)))
    energy = scene.material.lam * ngs.div(u) * ngs.div(v) + 2 * scene.material.mu * strain
    free.Clear()
    for row in np.flatnonzero(~fixed):
        free.Set(int(row))
    return ngs.BilinearForm(energy * ngs.dx, symmetric=True).Assemble(), free


def _table(
    name: str, rows: tuple[str, ...], times: list[Array], sizes: list[tuple[int, int]]
) -> Iterator[str]:
    """Times (runs, rows) of each size as Markdown, with the exponents of the medians."""
    yield f"| {name} | " + " | ".join(f"N = {n:,}, m = {m}" for n, m in sizes) + " | p |"
    yield "|---" * (len(sizes) + 2) + "|"
    for i, label in enumerate(rows):
        low, middle, high = np.transpose(
            [np.quantile(own[:, i], (0.25, 0.5, 0.75)) for own in times]
        )
        n = np.array([size[0] for size in sizes])
        use = (n >= ASYMPTOTIC) & np.isfinite(middle) & (middle > 0.0)
        p = (
            f"{np.polyfit(np.log(n[use]), np.log(middle[use]), 1)[0]:.2f}"
            if np.count_nonzero(use) > 1
            else "–"
        )
        yield f"| {label} | " + " | ".join(map(_cell, low, middle, high)) + f" | {p} |"


def _cell(low: float, middle: float, high: float) -> str:
    return "–" if np.isnan(middle) else f"{middle:.3g} [{low:.3g}, {high:.3g}]"


def sweep_text(alphas: int, surroundings: int, laws: int) -> str:
    law = "{{law: slip-weakening, tau_s: {} MPa, tau_k: 10 MPa, delta: 40 um}}"
    named = ", ".join(f"l{i}: {law.format(30 + 2 * i)}" for i in range(laws))
    alpha, theta_bar = (
        np.geomspace(1.0, 1e4, alphas).tolist(),
        np.linspace(20.0, -20.0, surroundings).tolist(),
    )
    return f"{{alpha: {alpha}, theta_bar: {theta_bar}, friction: {{{named}}}}}"


def sweeps() -> Iterator[str]:
    """What it costs to condense a whole sweep, mesh excluded, and to solve a point on average, in
    cold points."""
    levels, maxh = SWEPT
    mesh, clock = finest(study_of(levels, maxh)), Clock()

    def condensed(study: Study) -> tuple[Level, float]:
        clock()
        level = Level(mesh, study.scenes[0], study.scenes)
        for scene in study.scenes:
            level.condensed(scene)
            level.temperature(scene)
        return level, clock()

    cold_study = study_of(levels, maxh, sweep_text(1, 1, 1))
    condensed(cold_study)  # what is loaded once, is loaded
    ratios, solves = [], []
    for _ in range(RUNS):
        cold, own = condensed(cold_study)[1], []
        for shape in SWEEPS.values():
            study = study_of(levels, maxh, sweep_text(*shape))
            level, whole = condensed(study)
            own.append(whole / cold)
        places = range(0, len(study.scenes), len(study.scenes) // SOLVED)
        clock()
        for place in places:
            solve_point(study, level, place)
        ratios.append(own)
        solves.append(clock() / len(places) / cold)
    for kind, one in zip(SWEEPS, np.quantile(ratios, (0.25, 0.5, 0.75), axis=0).T, strict=True):
        yield (
            f"- 1000 points, {kind}, N = {level.frames.n_dof:,}: {_cell(*one)} × one cold "
            "point, both without mesh, contact solves and certificates;"
        )
    yield f"- a contact solve with its certificates there: {np.median(solves):.3f} × one cold point."


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--against", help="another checkout, whose condensation is measured too")
    options = parser.parse_args()
    earlier = None if options.against is None else condense_of(options.against)
    with threadpool_limits(1, user_api="blas"):
        swept, tables = list(sweeps()), list(stages_and_factors(earlier))
    head = (
        "CPU times [s] of one thread, median [quartiles]; the machine was shared with other work."
    )
    publish("speed", [head, f"Measured with {machine()}.", "", *tables, "", *swept])


if __name__ == "__main__":
    main()
