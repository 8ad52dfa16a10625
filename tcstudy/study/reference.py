"""Levels with their solutions in memory, and errors of these against an exact solution or that on a
finer mesh.

A measure whose reference vanishes is left out, as are those of ξ where the law is b ≡ 0: rounding
there, which is no reference for anything.

Solutions count on every fine triangle as the linear function that they are at its centre. Where the
fine mesh refines theirs that is exact; elsewhere it is wrong beyond the coarse edge that cuts a
triangle, by as much as the gradient jumps there, to either side alike. (Interpolation at the fine
nodes would smooth these jumps, which are the error: with h_fine = h/4 it lost 27 % of it in the
energy norm.) The displacement of the line is that at its fine nodes, the traction the step function
of the coarse line, looked up in the middle of every half of the fine segments. Of nested meshes the
contact nodes are compared, too.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array
from scipy.spatial import cKDTree

from tcstudy.accuracy.norms import (
    LineFunction,
    affine,
    given,
    interpolation,
    less,
    line_norms,
    linear,
    located,
    nodal,
    norms,
    steps,
)
from tcstudy.contact.solution import polished
from tcstudy.contact.solve import TIE
from tcstudy.data.records import BlockRecord
from tcstudy.data.schema import PointStatus
from tcstudy.errors import GeometryFailed
from tcstudy.exact.solution import exact_friction_resultant, exact_u_T, exact_xi
from tcstudy.expressions.expression import value_and_gradient
from tcstudy.fem.forms import ContactLine
from tcstudy.fem.meshes import PlaneMesh
from tcstudy.laws.composed import law_along
from tcstudy.offline.level import Level
from tcstudy.scene.records import Scene
from tcstudy.scene.study import Exact, Study
from tcstudy.study.level_solver import at_contact_nodes, solve_point
from tcstudy.study.run import stages

Array = NDArray[np.float64]
Say = Callable[[str], None]
Key = Any
"""Which solution of a level: of a sweep by its index, of several solvers by the name."""
Errors = dict[str, tuple[float, float]]
"""Error and norm of the reference, by name."""
CONSTANT = 1e-9
"""Change of a temperature across the body, over the temperature, that is rounding and no reference
for gradients."""


@dataclass(frozen=True)
class Solution:
    """One scene on one level.

    status, reason: what came of it
    parts:   (n,) each: u_x, u_y [m] and, if the scene has one, θ [K]; none without a solution
    v, xi:   (m,) u_T [m] and −S_T [Pa] at the contact nodes
    sticks:  (m,) nodes that rest on an up-jump of the law
    numbers: results by name, as in the result file
    """

    status: PointStatus
    reason: str
    parts: tuple[Array, ...]
    v: Array
    xi: Array
    sticks: NDArray[np.bool_]
    numbers: dict[str, float]
    lower: float = float("nan")
    """Energy of the least state found, where it lies below this one on the branch of the exact
    solution [J/m]."""

    @property
    def ok(self) -> bool:
        """True if it passed its acceptance test."""
        return self.status == PointStatus.OK and bool(self.parts)


@dataclass(frozen=True)
class SolvedLevel:
    """One level: its mesh, its contact line, and its solutions."""

    n_dof: int
    mesh: PlaneMesh
    line: ContactLine
    solutions: Mapping[Key, Solution]

    @classmethod
    def of(cls, level: Level, solutions: Mapping[Key, Solution]) -> SolvedLevel:
        """What is kept of a level."""
        return cls(level.frames.n_dof, level.mesh, level.line, solutions)

    @cached_property
    def normals(self) -> Array:
        """(s, 2, 2) of the exact curve at both ends of the segments of Γ_C."""
        return np.asarray(self.mesh.end_normals[self.line.which])

    @cached_property
    def curves(self) -> NDArray[np.intp]:
        """(s,) boundary curve that every contact segment lies on, numbered alike on all meshes of
        the body."""
        return np.asarray(self.mesh.segment_curve[self.line.which])

    @property
    def next_to_held(self) -> NDArray[np.bool_]:
        """(m,) contact nodes with a neighbour on the line that carries no unknown."""
        return np.isin(self.line.nodes, self.line.segments[(self.line.unknowns < 0).any(axis=1)])

    def tangential(self, x: Array, y: Array, *_: Array) -> Array:
        """(s, 2) u·t at both ends of every segment, t = (−n₂, n₁), of u_x and u_y there."""
        return np.asarray(self.normals[..., 0] * y - self.normals[..., 1] * x)

    def halves(self, xi: Array) -> Array:
        """(s, 2) ξ on both halves of every segment from its values at the contact nodes (m,)."""
        own = self.line.unknowns
        return np.asarray(xi[np.where(own < 0, own[:, ::-1], own)])

    def distance(
        self, parts: list[Array], function: LineFunction | None = None
    ) -> tuple[float, float]:
        """‖v − f‖ and ‖f‖ in L²(Γ_C), f = 0 without one, of v at the Gauss points of equal parts of
        every segment."""
        return line_norms(self.line.ends, self.normals, parts, function)


def solve_levels(study: Study, say: Say = lambda text: None) -> list[SolvedLevel]:
    """Every sweep point on every level, as a run solves it, with its fields. Raises
    GeometryFailed."""
    # errors are measured on all levels; estimates are kept beside bounds that are asked for
    mesh = replace(study.mesh, tolerance=None, estimate=study.mesh.guarantee)
    study = replace(study, output=replace(study.output, fields=True), mesh=mesh)
    levels: list[SolvedLevel] = []
    for i, stage in enumerate(stages(study)):
        if stage.level is None:
            raise GeometryFailed(next(stage.blocks).reasons[0])
        level, found = stage.level, dict[Key, Solution]()
        say(f"level {i}: {level.frames.n_dof} dofs, {level.line.m} contact unknowns")
        for block, row in ((one, row) for one in stage.blocks for row in range(len(one))):
            index = block.index(row)
            found[index] = solution = solution_of(study, level, block, row)
            if not solution.ok:
                place = f"point {index} on level {i}" if index else f"level {i}"
                say(f"{place}: {solution.status.name.lower()}: {solution.reason}")
        levels.append(SolvedLevel.of(level, found))
    return levels


def solution_of(study: Study, level: Level, block: BlockRecord, row: int = 0) -> Solution:
    """What a run recorded of a point (with its fields), for comparison; or the solution that the
    exact one leads to as a start, where that is nearer to it.

    Where friction falls, the exact solution may be one of several, and not the lowest: errors
    belong to its own branch. It may even be no minimum, so that Newton's method on its pieces finds
    it where a descent would leave it.
    """
    place, least = int(block.points[row]), _recorded(study, level, block, row)
    if (
        study.exact is None
        or study.solver.branch != "lowest"
        or not least.ok
        or least.numbers.get("unique") == 1
    ):
        return least
    start = at_contact_nodes(exact_u_T(study.exact), level.mesh, level.line)
    close = polished(level.condensed(study.scenes[place]).problem, start, exact=False).v
    near = replace(study, solver=replace(study.solver, branch="continued"))
    found = _recorded(study, level, solve_point(near, level, place, close), 0)
    if not found.ok or np.linalg.norm(found.v - start) >= np.linalg.norm(least.v - start):
        return least
    energies = found.numbers["energy"], least.numbers["energy"]
    below = energies[1] < energies[0] - TIE * max(map(abs, energies))
    numbers = found.numbers | {"time_solve": least.numbers["time_solve"]}
    return replace(found, numbers=numbers, lower=energies[1] if below else math.nan)


def _recorded(study: Study, level: Level, block: BlockRecord, row: int) -> Solution:
    scene, v, xi = study.scenes[int(block.points[row])], np.empty(0), np.empty(0)
    if block.u_T is not None and block.xi is not None and not np.isnan(block.u_T[row]).any():
        v, xi = block.u_T[row], block.xi[row]
    fields = {
        name: values[row]
        for name, values in block.fields.items()
        if not np.isnan(values[row]).all()
    }
    if (
        fields and study.exact is not None and study.exact.theta is not None
    ):  # also where it does not load the body
        fields["theta"] = level.temperature(scene).theta
    parts = tuple(fields[name] for name in ("u_x", "u_y", "theta") if name in fields)
    numbers = {
        name: float(values[row]) for name, values in block.numbers.items() if values.ndim == 1
    }
    status, reason = PointStatus(int(block.status[row])), block.reasons.get(row, "")
    return Solution(status, reason, parts, v, xi, level.law(scene).sticking(v), numbers)


class ExactReference:
    """The exact solution that the study gives."""

    def __init__(self, exact: Exact) -> None:
        self._exact = exact
        self._parts = [
            partial(value_and_gradient, of) for of in (*exact.u, exact.theta) if of is not None
        ]

    def errors(self, one: SolvedLevel, key: Key, scene: Scene) -> Errors:
        """Absolute errors of a solution and norms of the reference; empty if there is none."""
        own, exact, mesh = one.solutions[key], self._exact, one.mesh
        if not own.parts:
            return {}
        there = [given(mesh, of) for of in self._parts]
        off = [less(nodal(mesh, v, 7), f) for v, f in zip(own.parts, there, strict=False)]
        moduli, u_T, xi = (
            (scene.material.lam, scene.material.mu),
            exact_u_T(exact),
            exact_xi(exact, scene),
        )
        sizes = norms(mesh, there, *moduli)
        found = {name: (error, sizes[name]) for name, error in norms(mesh, off, *moduli).items()}
        found |= {
            "u_T_L2": one.distance(
                linear(one.tangential(*(w[one.line.segments] for w in own.parts))), u_T
            ),
            "xi_L2": one.distance(steps(one.halves(own.xi)), xi),
        }
        v, at = (at_contact_nodes(of, one.mesh, one.line) for of in (u_T, xi))
        found |= _at_nodes(one, own, (v, at), (v, at))
        return _with_numbers(
            found, own, {"friction_resultant": exact_friction_resultant(scene, xi)}, scene
        )

    def inclusion(self, one: SolvedLevel, scene: Scene) -> float:
        """max dist(ξ, b̂(u_T)) over the contact nodes of a level, over the scale of b: whether the
        solution is one."""
        line, of = one.line, (exact_u_T(self._exact), exact_xi(self._exact, scene))
        slip, xi = (at_contact_nodes(function, one.mesh, line) for function in of)
        law = law_along(scene.friction, line.edge_names, line.edge.astype(np.intp), line.xy)
        low, high = law.interval(slip, 1e-9 * np.max(np.abs(slip), initial=0.0))
        worst = float(np.max(np.maximum(low - xi, xi - high), initial=0.0))
        scale = max(law.b_scale, float(np.max(np.abs(xi), initial=0.0)))
        return worst / scale if scale > 0.0 else worst


@dataclass(frozen=True)
class _Places:
    """Where a fine mesh lies in a coarse one: triangle and weights of every centre; P1 functions at
    both ends of the fine segments; the contact node of every half of them (s, 2), and that at each
    coarse one, None where there may be none.
    """

    triangle: NDArray[np.intp]
    weights: Array
    ends: csr_array
    halves: NDArray[np.intp]
    same: NDArray[np.intp] | None


class FineReference:
    """The solutions on a fine mesh, with which all others are compared."""

    def __init__(self, fine: SolvedLevel, nested: bool = False) -> None:
        """nested: whether the mesh has the nodes of all that are compared, which then are compared
        at them, too"""
        self._fine, self._nested = fine, nested
        self._sizes: dict[Key, dict[str, float]] = {}
        self._places: dict[int, tuple[PlaneMesh, _Places]] = {}

    def errors(self, one: SolvedLevel, key: Key, scene: Scene) -> Errors:
        """Absolute errors of a solution and norms of the reference; empty if there is none."""
        fine, own, best = self._fine, one.solutions[key], self._fine.solutions[key]
        if not own.parts or not best.ok:
            return {}
        mesh, at, exact = fine.mesh, self._located(one), [nodal(fine.mesh, w) for w in best.parts]
        moduli = [fine.mesh.of_material(scene, name) for name in ("lam", "mu")]
        if key not in self._sizes:
            self._sizes[key] = norms(mesh, exact, *moduli)
        centres = (
            np.einsum("qk,qk->q", at.weights, v[one.mesh.triangles[at.triangle]]) for v in own.parts
        )
        coarse = [
            affine(mesh, c, one.mesh.gradient(v)[at.triangle])
            for c, v in zip(centres, own.parts, strict=True)
        ]
        off = norms(mesh, [less(a, b) for a, b in zip(coarse, exact, strict=True)], *moduli)
        found = {name: (error, self._sizes[key][name]) for name, error in off.items()}
        ends = fine.tangential(*((at.ends @ component).reshape(-1, 2) for component in own.parts))
        best_ends = fine.tangential(*(component[fine.line.segments] for component in best.parts))
        best_halves = fine.halves(best.xi)
        found |= {
            "u_T_L2": (
                fine.distance(linear(ends - best_ends))[0],
                fine.distance(linear(best_ends))[0],
            ),
            "xi_L2": (
                fine.distance(steps(own.xi[at.halves] - best_halves))[0],
                fine.distance(steps(best_halves))[0],
            ),
            "u_T_max": (_largest(ends - best_ends), _largest(best_ends)),
        }
        if (
            "theta_H1" in found
            and found["theta_H1"][1] * np.ptp(fine.mesh.points) <= CONSTANT * found["theta_L2"][1]
        ):
            del found["theta_H1"]
        if at.same is not None:
            found |= _at_nodes(one, own, (best.v[at.same], best.xi[at.same]), (best.v, best.xi))
        return _with_numbers(
            found,
            own,
            {name: best.numbers[name] for name in ("energy", "friction_resultant")},
            scene,
        )

    def _located(self, one: SolvedLevel) -> _Places:
        """Segments are looked up by curve and not by edge, which may be both sides of a slot
        thinner than a cell."""
        if (key := id(one.mesh)) not in self._places:
            fine, line = self._fine, self._fine.line
            a, b = np.moveaxis(line.ends, 1, 0)
            middles = np.stack([0.75 * a + 0.25 * b, 0.25 * a + 0.75 * b], axis=1)
            halves, curves, coarse = (
                np.empty(middles.shape[:2], dtype=np.intp),
                *(x.curves for x in (fine, one)),
            )
            for curve in np.unique(curves):
                own = np.flatnonzero(np.isin(one.line.nodes, one.line.segments[coarse == curve]))
                rows = curves == curve
                halves[rows] = own[cKDTree(one.line.xy[own]).query(middles[rows])[1]]
            same = cKDTree(line.xy).query(one.line.xy)[1] if self._nested else None
            ends, centres = (
                interpolation(one.mesh, line.ends.reshape(-1, 2)),
                located(one.mesh, fine.mesh.centres),
            )
            self._places[key] = (
                one.mesh,
                _Places(*centres, ends, halves, same),
            )  # so the mesh keeps its id
        return self._places[key][1]


Reference = ExactReference | FineReference


def _with_numbers(found: Errors, own: Solution, known: Mapping[str, float], scene: Scene) -> Errors:
    """With the errors of numbers that are known of the reference, and without those of a friction
    that vanishes."""
    found |= {name: (abs(own.numbers.get(name, math.nan) - value), abs(value))
              for name, value in known.items() if math.isfinite(value)}  # fmt: skip
    vanishing = ("xi_", "friction_resultant") if scene.friction.vanishes else ()
    return {name: pair for name, pair in found.items() if not name.startswith(vanishing)}


def _at_nodes(
    one: SolvedLevel, own: Solution, best: tuple[Array, Array], sizes: tuple[Array, Array]
) -> Errors:
    """Errors at the contact nodes against (u_T, ξ) there; sizes: what maxima are relative to"""
    (v, xi), (all_v, all_xi) = best, sizes
    return {
        "u_T_max": (_largest(own.v - v), _largest(all_v)),
        "xi_nodes": (
            float(np.sqrt(one.line.c @ (own.xi - xi) ** 2)),
            float(np.sqrt(one.line.c @ xi**2)),
        ),
        "xi_max": (_largest(own.xi - xi), _largest(all_xi)),
    }


def _largest(values: Array) -> float:
    return float(np.max(np.abs(values), initial=0.0))
