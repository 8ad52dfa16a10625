"""All levels of a study with their solutions kept in memory: what convergence is measured on."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from tcstudy.accuracy.norms import Line, Modulus, Triangles
from tcstudy.contact.solution import polished
from tcstudy.contact.solve import TIE
from tcstudy.data.records import BlockRecord, PointStatus
from tcstudy.errors import GeometryFailed
from tcstudy.offline.level import Level
from tcstudy.scene.records import Scene
from tcstudy.scene.study import Study
from tcstudy.study.point import solve_point
from tcstudy.study.run import stages
from tcstudy.study.starts import contact_line, exact_at

Array = NDArray[np.float64]
Say = Callable[[str], None]
Length = Callable[[float], str]
BARE: Length = "{:.3g}".format
"""A length without its unit."""


@dataclass(frozen=True)
class Solution:
    """One scene on one level.

    status, reason: what came of it
    u:       (2, n) displacement [m], None if there is none
    theta:   (n,) temperature [K], None if the scene has none
    v, xi:   (m,) u_T [m] and −S_T [Pa] at the contact nodes
    sticks:  (m,) nodes that rest on an up-jump of the law
    numbers: results by name, as in the result file
    """

    status: PointStatus
    reason: str
    u: Array | None
    theta: Array | None
    v: Array
    xi: Array
    sticks: NDArray[np.bool_]
    numbers: dict[str, float]
    lower: float = float("nan")
    """Energy of the least state found, where it lies below this one on the branch of the exact solution [J/m]."""

    @property
    def ok(self) -> bool:
        """True if it passed its acceptance test."""
        return self.status == PointStatus.OK and self.u is not None


@dataclass(frozen=True)
class SolvedLevel:
    """One level: its mesh, its contact line, and a solution by sweep index.

    edges: (m,) name of the contact edge of every contact node
    segment_curve: (s,) boundary curve that every contact segment lies on, numbered alike on all meshes of the body
    region: (t,) region of a triangle as `PlaneMesh.numbered`, None where materials do not differ by region
    """

    h_max: float
    n_dof: int
    mesh: Triangles
    line: Line
    edges: tuple[str, ...]
    segment_curve: NDArray[np.intp]
    solutions: dict[tuple[int, ...], Solution]
    region: NDArray[np.intp] | None = None

    def moduli(self, scene: Scene) -> tuple[Modulus, Modulus]:
        """λ and μ, of every triangle where they differ by region."""
        material = scene.material
        if self.region is None:
            return material.lam, material.mu
        lam, mu = np.array([(own.lam, own.mu) for own in material.all])[self.region].T
        return lam, mu


def solve_levels(study: Study, say: Say = lambda text: None, length: Length = BARE) -> list[SolvedLevel]:
    """Solve every sweep point on every level, as a run does, and keep the fields.

    say: called with a line of text when a level is ready and when a point fails;  length: how that has the size of h
    Raises GeometryFailed if the body cannot be meshed.
    """
    # errors are measured on all levels; estimates are kept beside bounds that are asked for
    mesh = replace(study.mesh, tolerance=None, estimate=study.mesh.guarantee)
    study = replace(study, output=replace(study.output, fields=True), mesh=mesh)
    levels: list[SolvedLevel] = []
    for i, stage in enumerate(stages(study)):
        if stage.level is None:
            raise GeometryFailed(next(stage.blocks).reasons[0])
        level = stage.level
        sizes = f"{level.frames.n_dof} dofs, {level.line.m} contact unknowns"
        say(f"level {i}: h_max = {length(level.mesh.h_max)}, {sizes}")
        levels.append(empty_level(study, level))
        for block, row in ((one, row) for one in stage.blocks for row in range(len(one))):
            index, least = block.index(row), solution_of(study, level, block, row)
            solution = _on_exact_branch(study, level, int(block.points[row]), levels[-1], least)
            levels[-1].solutions[index] = solution
            if not solution.ok:
                say(f"point {index} on level {i}: {solution.status.name.lower()}: {solution.reason}")
    return levels


def _on_exact_branch(study: Study, level: Level, place: int, one: SolvedLevel, least: Solution) -> Solution:
    """The solution that the exact one leads to as a start, where it is nearer than the least one; else the least one.

    Where friction falls, the exact solution may be one of several, and not the lowest: errors belong to its own branch.
    It may even be no minimum, so that Newton's method on its pieces finds it where a descent would leave it.
    """
    if study.exact is None or study.solver.branch != "lowest" or not least.ok or least.numbers.get("unique") == 1:
        return least
    start = exact_at(study.exact, one.line)
    close = polished(level.condensed(study.scenes[place]).problem, start, exact=False).v
    near = replace(study, solver=replace(study.solver, branch="continued"))
    found = solution_of(study, level, solve_point(near, level, place, close))
    if not found.ok or np.linalg.norm(found.v - start) >= np.linalg.norm(least.v - start):
        return least
    energies = found.numbers["energy"], least.numbers["energy"]
    below = energies[1] < energies[0] - TIE * max(map(abs, energies))
    return replace(found, lower=energies[1]) if below else found


def empty_level(study: Study, level: Level) -> SolvedLevel:
    """A level without solutions yet."""
    mesh = level.mesh
    return SolvedLevel(
        h_max=mesh.h_max,
        n_dof=level.frames.n_dof,
        mesh=Triangles(mesh.points, mesh.triangles),
        line=contact_line(level),
        edges=tuple(level.line.edge_names[e] for e in level.line.edge),
        segment_curve=mesh.segment_curve[level.line.which],
        solutions={},
        region=mesh.numbered(tuple(name for name, _ in own)) if (own := study.scenes[0].material.regions) else None,
    )


def solution_of(study: Study, level: Level, block: BlockRecord, row: int = 0) -> Solution:
    """What a run recorded of a point (with its fields), for comparison."""
    scene, v, xi = study.scenes[int(block.points[row])], np.empty(0), np.empty(0)
    if block.u_T is not None and block.xi is not None and not np.isnan(block.u_T[row]).any():
        v, xi = block.u_T[row], block.xi[row]
    fields = {name: values[row] for name, values in block.fields.items() if not np.isnan(values[row]).all()}
    u = np.array([fields["u_x"], fields["u_y"]]) if fields else None
    theta = fields.get("theta")
    if study.exact is not None and study.exact.theta is not None:  # also where it does not load the body
        theta = level.temperature(scene).theta
    numbers = {name: float(values[row]) for name, values in block.numbers.items() if values.ndim == 1}
    status, reason = PointStatus(int(block.status[row])), block.reasons.get(row, "")
    return Solution(status, reason, u, theta, v, xi, level.law(scene).sticking(v), numbers)
