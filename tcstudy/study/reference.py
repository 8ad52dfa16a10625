"""Levels with their solutions in memory, and errors of these against an exact solution or that on a finer mesh.

A measure whose reference vanishes is left out, as are those of ξ where the law is b ≡ 0: rounding there, which is no
reference for anything.

Solutions count on every fine triangle as the linear function that they are at its centre. Where the fine mesh refines
theirs that is exact; elsewhere it is wrong beyond the coarse edge that cuts a triangle, by as much as the gradient
jumps there, to either side alike. (Interpolation at the fine nodes would smooth these jumps, which are the error: with
h_fine = h/4 it lost 27 % of it in the energy norm.) The displacement of the line is that at its fine nodes, the
traction the step function of the coarse line, looked up in the middle of every half of the fine segments. Of nested
meshes the contact nodes are compared, too.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array
from scipy.spatial import cKDTree

from tcstudy.accuracy.norms import Line, LineFunction, Modulus, Triangles, interpolation, less, located
from tcstudy.contact.solution import polished
from tcstudy.contact.solve import TIE
from tcstudy.data.records import BlockRecord
from tcstudy.data.schema import PointStatus
from tcstudy.errors import GeometryFailed
from tcstudy.exact.numbers import exact_friction_resultant, exact_u_T, exact_xi
from tcstudy.expressions.derivative import value_and_gradient
from tcstudy.laws.composed import law_along
from tcstudy.offline.level import Level
from tcstudy.scene.records import Scene
from tcstudy.scene.study import Exact, Study
from tcstudy.study.level_solver import contact_line, exact_at
from tcstudy.study.point import solve_point
from tcstudy.study.run import stages

Array = NDArray[np.float64]
Say = Callable[[str], None]
Key = Any
"""Which solution of a level: of a sweep by its index, of several solvers by the name."""
Errors = dict[str, tuple[float, float]]
"""Error and norm of the reference, by name."""
CONSTANT = 1e-9
"""Change of a temperature across the body, over the temperature, that is rounding and no reference for gradients."""


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
    """One level: its mesh, its contact line, and its solutions.

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
    solutions: dict[Key, Solution]
    region: NDArray[np.intp] | None = None

    def moduli(self, scene: Scene) -> tuple[Modulus, Modulus]:
        """λ and μ, of every triangle where they differ by region."""
        material = scene.material
        if self.region is None:
            return material.lam, material.mu
        lam, mu = np.array([(own.lam, own.mu) for own in material.all])[self.region].T
        return lam, mu


def solve_levels(study: Study, say: Say = lambda text: None) -> list[SolvedLevel]:
    """Solve every sweep point on every level, as a run does, and keep the fields.

    say: called with a line of text when a level is ready and when a point fails
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
        say(f"level {i}: {level.frames.n_dof} dofs, {level.line.m} contact unknowns")
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


class ExactReference:
    """The exact solution that the study gives."""

    def __init__(self, exact: Exact) -> None:
        self._exact = exact

    def xi(self, scene: Scene) -> LineFunction:
        """−S_T on Γ_C."""
        return exact_xi(self._exact, scene)

    def errors(self, one: SolvedLevel, key: Key, scene: Scene) -> Errors:
        """Absolute errors of a solution and norms of the reference; empty if there is none."""
        solution, exact, line = one.solutions[key], self._exact, one.line
        if solution.u is None:
            return {}
        pairs = list(zip(solution.u, exact.u, strict=True))
        if exact.theta is not None and solution.theta is not None:
            pairs.append((solution.theta, exact.theta))
        given = [one.mesh.given(partial(value_and_gradient, of)) for _, of in pairs]
        off = [less(one.mesh.p1(v, 7), f) for (v, _), f in zip(pairs, given, strict=True)]
        moduli = scene.material.lam, scene.material.mu
        u_T, xi = exact_u_T(exact), self.xi(scene)
        found = _over(one.mesh.norms(off, *moduli), one.mesh.norms(given, *moduli)) | {
            "u_T_L2": line.linear_from(line.tangential(*solution.u), u_T),
            "xi_L2": line.step_from(line.halves(solution.xi), xi),
        }
        return _meant(found | _at_nodes(one, solution, (line.at_nodes(u_T), line.at_nodes(xi))), scene)

    def numbers(self, scene: Scene) -> dict[str, float]:
        """Numbers of the reference by name, as far as they are known."""
        return (
            {} if scene.friction.vanishes else {"friction_resultant": exact_friction_resultant(scene, self.xi(scene))}
        )

    def inclusion(self, one: SolvedLevel, scene: Scene) -> float:
        """max dist(ξ, b̂(u_T)) over the contact nodes of a level, over the scale of b: whether the solution is one."""
        line = one.line
        own, edge = np.unique(one.edges, return_inverse=True)
        law = law_along(scene.friction, own.tolist(), edge, line.points[line.nodes])
        slip, xi = line.at_nodes(exact_u_T(self._exact)), line.at_nodes(self.xi(scene))
        low, high = law.interval(slip, 1e-9 * _largest(slip))
        worst = float(np.max(np.maximum(low - xi, xi - high), initial=0.0))
        scale = max(law.b_scale, _largest(xi))
        return worst / scale if scale > 0.0 else worst


@dataclass(frozen=True)
class _Places:
    """Where a fine mesh lies in a coarse one: of every fine triangle's centre the triangle and the weights of its
    nodes; fine line nodes, and P1 functions at them; the contact node of every half of the fine segments (s, 2); the
    fine contact node at each contact node, None where there may be none."""

    triangle: NDArray[np.intp]
    weights: Array
    nodes: NDArray[np.intp]
    at_nodes: csr_array
    halves: NDArray[np.intp]
    same: NDArray[np.intp] | None


class FineReference:
    """The solutions on a fine mesh, with which all others are compared."""

    def __init__(self, fine: SolvedLevel, nested: bool = False) -> None:
        """nested: whether the mesh has the nodes of all that are compared, which then are compared at them, too"""
        self._fine, self._nested = fine, nested
        self._sizes: dict[Key, dict[str, float]] = {}
        self._places: dict[int, tuple[Triangles, _Places]] = {}

    def errors(self, one: SolvedLevel, key: Key, scene: Scene) -> Errors:
        """Absolute errors of a solution and norms of the reference; empty if there is none."""
        own, best, mesh, line = one.solutions[key], self._fine.solutions[key], self._fine.mesh, self._fine.line
        if own.u is None or best.u is None or not best.ok:
            return {}
        at, moduli, pairs = self._located(one), self._fine.moduli(scene), list(zip(own.u, best.u, strict=True))
        if own.theta is not None and best.theta is not None:
            pairs.append((own.theta, best.theta))
        if key not in self._sizes:
            self._sizes[key] = mesh.norms([mesh.p1(w) for _, w in pairs], *moduli)
        centres = (np.einsum("qk,qk->q", at.weights, v[one.mesh.triangles[at.triangle]]) for v, _ in pairs)
        coarse = [mesh.linear(c, one.mesh.gradient(v)[at.triangle]) for c, (v, _) in zip(centres, pairs, strict=True)]
        found = mesh.norms([less(a, mesh.p1(w)) for a, (_, w) in zip(coarse, pairs, strict=True)], *moduli)
        u = np.zeros((2, len(line.points)))
        u[:, at.nodes] = [at.at_nodes @ component for component in own.u]
        ends, best_ends, best_halves = line.tangential(*u), line.tangential(*best.u), line.halves(best.xi)
        errors = _over(found, self._sizes[key]) | {
            "u_T_L2": (line.linear_from(ends - best_ends)[0], line.linear_from(best_ends)[0]),
            "xi_L2": (line.step_from(own.xi[at.halves] - best_halves)[0], line.step_from(best_halves)[0]),
            "u_T_max": (_largest(ends - best_ends), _largest(best_ends)),
        }
        if "theta_H1" in errors and errors["theta_H1"][1] * np.ptp(line.points) <= CONSTANT * errors["theta_L2"][1]:
            del errors["theta_H1"]
        if at.same is not None:
            errors |= _at_nodes(one, own, (best.v[at.same], best.xi[at.same]), (best.v, best.xi))
        return _meant(errors, scene)

    def numbers(self, scene: Scene) -> dict[str, float]:
        """Numbers of the reference by name."""
        best = next(iter(self._fine.solutions.values()))
        return {n: best.numbers[n] for n in ("energy", *(() if scene.friction.vanishes else ("friction_resultant",)))}

    def _located(self, one: SolvedLevel) -> _Places:
        """Segments are looked up by curve and not by edge, which may be both sides of a slot thinner than a cell."""
        if (key := id(one.mesh)) not in self._places:
            fine, line, nodes = self._fine, self._fine.line, np.unique(self._fine.line.segments)
            a, b = np.moveaxis(line.points[line.segments], 1, 0)
            middles = np.stack([0.75 * a + 0.25 * b, 0.25 * a + 0.75 * b], axis=1)
            halves, contact = np.empty(middles.shape[:2], dtype=np.intp), one.line.points[one.line.nodes]
            for curve in np.unique(fine.segment_curve):
                own = np.flatnonzero(np.isin(one.line.nodes, one.line.segments[one.segment_curve == curve]))
                rows = fine.segment_curve == curve
                halves[rows] = own[cKDTree(contact[own]).query(middles[rows])[1]]
            same = cKDTree(line.points[line.nodes]).query(contact)[1] if self._nested else None
            found = _Places(
                *located(one.mesh, fine.mesh.centres),
                nodes,
                interpolation(one.mesh, line.points[nodes]),
                halves,
                same,
            )
            self._places[key] = one.mesh, found  # the mesh, so that nothing else gets its number
        return self._places[key][1]


Reference = ExactReference | FineReference


def _over(errors: dict[str, float], sizes: dict[str, float]) -> Errors:
    return {name: (error, sizes[name]) for name, error in errors.items()}


def _meant(found: Errors, scene: Scene) -> Errors:
    return {name: pair for name, pair in found.items() if not (scene.friction.vanishes and name.startswith("xi_"))}


def _at_nodes(
    one: SolvedLevel, own: Solution, best: tuple[Array, Array], sizes: tuple[Array, Array] | None = None
) -> Errors:
    """Errors at the contact nodes against (u_T, ξ) there; sizes: what maxima are relative to, `best` unless given"""
    (v, xi), (all_v, all_xi) = best, sizes or best
    return {
        "u_T_max": (_largest(own.v - v), _largest(all_v)),
        "xi_nodes": (one.line.nodal_norm(own.xi - xi), one.line.nodal_norm(xi)),
        "xi_max": (_largest(own.xi - xi), _largest(all_xi)),
    }


def _largest(values: Array) -> float:
    return float(np.max(np.abs(values), initial=0.0))
