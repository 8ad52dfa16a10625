"""Levels with their solutions in memory, and the errors of these against a reference.

The reference is an exact solution, or the solution on a finer mesh. A measure whose reference
vanishes is left out, as are those of ξ where the law is b ≡ 0: ξ is rounding there.

On every fine triangle a coarse solution counts as the linear function that it is at the centre.
Where the fine mesh refines the coarse one that is exact. Elsewhere it is wrong beyond the coarse
edge that cuts a triangle, by as much as the gradient jumps there, to either side alike.
(Interpolation at the fine nodes would smooth these jumps, which are the error: with h_fine = h/4 it
lost 27 % of it in the energy norm.) The displacement of the contact line is that at its fine nodes.
The traction is the step function of the coarse line, looked up in the middle of every half of the
fine segments. Nested meshes are compared at their contact nodes, too. Openings and normal tractions
of edges that may lift off are compared as slips and friction are.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
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
from tcstudy.fem.openings import OpeningLine
from tcstudy.laws.composed import law_along
from tcstudy.offline.level import Level
from tcstudy.scene.records import Scene
from tcstudy.scene.study import Exact, Study
from tcstudy.study.level_solver import at_contact_nodes, solve_point
from tcstudy.study.run import stages

Array = NDArray[np.float64]
Say = Callable[[str], None]
Key = Any
"""Names a solution of a level: the index of a sweep point, or the name of a solver."""
Errors = dict[str, tuple[float, float]]
"""Error and norm of the reference, by the name of the measure."""
MAX_CONSTANT = 1e-9
"""Relative change of a temperature across the body that is rounding, and no reference for
gradients."""
SLIP_ROUNDING = 1e-9
"""Relative to the largest slip: a slip this small counts as none in the inclusion."""


@dataclass(frozen=True)
class Solution:
    """One scene on one level.

    status, reason: whether it is solved, and why not
    parts:   (n,) each: u_x, u_y [m] and, if the scene has one, θ [K]; none without a solution
    v, xi:   (m,) u_T [m] and −S_T [Pa] at the contact nodes
    sticks:  (m,) nodes that stick
    numbers: results by name, as in the result file
    lower:   energy of the least state found, where it is below this one, which is on the branch of
             the exact solution [J/m]
    opening, S_N: (k,) openings [m] and normal tractions [Pa] of the nodes that may lift off; empty
             where no edge does
    closed:  (k,) whether these rest at a jump of their law
    """

    status: PointStatus
    reason: str
    parts: tuple[Array, ...]
    v: Array
    xi: Array
    sticks: NDArray[np.bool_]
    numbers: dict[str, float]
    lower: float = math.nan
    opening: Array = field(default_factory=lambda: np.empty(0))
    S_N: Array = field(default_factory=lambda: np.empty(0))
    closed: NDArray[np.bool_] = field(default_factory=lambda: np.empty(0, dtype=bool))

    @property
    def ok(self) -> bool:
        """Whether it passed its acceptance test."""
        return self.status == PointStatus.OK and bool(self.parts)

    @property
    def slips(self) -> Array:
        """u_T (m,) [m], 0 where it is rounding beside the openings."""
        largest = _largest(self.opening)
        return np.where(np.abs(self.v) <= SLIP_ROUNDING * largest, 0.0, self.v)


@dataclass(frozen=True)
class SolvedLevel:
    """One level: its mesh, its contact line, its openings if it has some, and its solutions."""

    n_dof: int
    mesh: PlaneMesh
    line: ContactLine
    solutions: Mapping[Key, Solution]
    opening: OpeningLine | None = None

    @property
    def m(self) -> int:
        """Number of contact unknowns: slips and openings."""
        return self.line.m if self.opening is None else self.line.m + self.opening.m

    @classmethod
    def of(cls, level: Level, solutions: Mapping[Key, Solution]) -> SolvedLevel:
        """Keep what errors need of a level."""
        return cls(level.frames.n_dof, level.mesh, level.line, solutions, level.opening)

    @cached_property
    def normals(self) -> Array:
        """Normals (s, 2, 2) of the exact curve at both ends of the segments of Γ_C."""
        return np.asarray(self.mesh.end_normals[self.line.which])

    @cached_property
    def curves(self) -> NDArray[np.intp]:
        """Boundary curve (s,) of every contact segment, numbered alike on all meshes of a body."""
        return np.asarray(self.mesh.segment_curve[self.line.which])

    @property
    def next_to_held(self) -> NDArray[np.bool_]:
        """Contact nodes (m,) with a neighbour on the line that carries no unknown."""
        has_held_end = (self.line.unknowns < 0).any(axis=1)
        return np.isin(self.line.nodes, self.line.segments[has_held_end])

    def tangential(self, x: Array, y: Array, *_: Array) -> Array:
        """Return (s, 2) u·t at both ends of every segment, t = (−n₂, n₁).

        x, y: (s, 2) u_x and u_y there
        """
        return np.asarray(self.normals[..., 0] * y - self.normals[..., 1] * x)

    def openings(self, x: Array, y: Array, *_: Array) -> Array:
        """Return −u·n at both ends of the segments that may lift off, as `tangential`."""
        assert self.opening is not None
        s_N = -(self.normals[..., 0] * x + self.normals[..., 1] * y)
        return np.asarray(s_N[self.opening.which])

    def halves(self, xi: Array) -> Array:
        """Return (s, 2) ξ on both halves of every segment from its values (m,) at the nodes."""
        return _halves(self.line.unknowns, xi)

    def norm_along_openings(self, parts: list[Array]) -> float:
        """Return the L² norm along the segments that may lift off, as `distance`."""
        assert self.opening is not None
        which = self.opening.which
        return line_norms(self.line.ends[which], self.normals[which], parts)[0]

    def distance(
        self, parts: list[Array], function: LineFunction | None = None
    ) -> tuple[float, float]:
        """Return ‖v − f‖ and ‖f‖ in L²(Γ_C); f = 0 without a function.

        parts: v at the Gauss points of equal parts of every segment
        """
        return line_norms(self.line.ends, self.normals, parts, function)


def _halves(unknowns: NDArray[np.intp], xi: Array) -> Array:
    """Return (s, 2) tractions on both halves of segments from those (m,) of unknowns (s, 2)."""
    nearest_unknown = np.where(unknowns < 0, unknowns[:, ::-1], unknowns)
    return np.asarray(xi[nearest_unknown])


def solve_levels(study: Study, say: Say = lambda text: None) -> list[SolvedLevel]:
    """Solve every sweep point on every level, as a run does, with its fields.

    Raises GeometryFailed.
    """
    # errors are measured on all levels; estimates are kept beside bounds that are asked for
    mesh = replace(study.mesh, tolerance=None, estimate=study.mesh.bounds_errors)
    study = replace(study, output=replace(study.output, fields=True), mesh=mesh)
    levels: list[SolvedLevel] = []
    for number, stage in enumerate(stages(study)):
        if stage.level is None:
            raise GeometryFailed(next(stage.blocks).reasons[0])
        level = stage.level
        say(f"level {number}: {level.frames.n_dof} DOFs, {level.m} contact DOFs")
        solutions = dict[Key, Solution]()
        for block in stage.blocks:
            for row in range(len(block)):
                index = block.index(row)
                solution = solution_of(study, level, block, row)
                solutions[index] = solution
                if not solution.ok:
                    place = f"point {index} on level {number}" if index else f"level {number}"
                    say(f"{place}: {solution.status.name.lower()}: {solution.reason}")
        levels.append(SolvedLevel.of(level, solutions))
    return levels


def solution_of(study: Study, level: Level, block: BlockRecord, row: int = 0) -> Solution:
    """Return the solution that a run recorded of a point, or one nearer to the exact solution.

    Of a softening law the exact solution may be one of several, and not the lowest: errors belong
    to its own branch. It may even be no minimum, so that Newton's method on its pieces finds it
    where a descent would leave it.
    """
    least = _recorded(study, level, block, row)
    is_lowest = study.solver.branch == "lowest"
    if study.exact is None or not is_lowest or not least.ok or least.numbers.get("unique") == 1:
        return least
    place = int(block.points[row])
    exact_slip = at_contact_nodes(exact_u_T(study.exact), level.mesh, level.line)
    problem = level.condensed(study.scenes[place]).problem
    start = polished(problem, exact_slip, exact=False).v
    continued = replace(study, solver=replace(study.solver, branch="continued"))
    near = _recorded(study, level, solve_point(continued, level, place, start), 0)
    if not near.ok:
        return least
    if np.linalg.norm(near.v - exact_slip) >= np.linalg.norm(least.v - exact_slip):
        return least
    energy = near.numbers["energy"]
    least_energy = least.numbers["energy"]
    is_lower = least_energy < energy - TIE * max(abs(energy), abs(least_energy))
    numbers = near.numbers | {"time_solve": least.numbers["time_solve"]}
    return replace(near, numbers=numbers, lower=least_energy if is_lower else math.nan)


def _recorded(study: Study, level: Level, block: BlockRecord, row: int) -> Solution:
    """Return the solution of a row of a block."""
    scene = study.scenes[int(block.points[row])]
    v = np.empty(0)
    xi = np.empty(0)
    if block.u_T is not None and block.xi is not None and not np.isnan(block.u_T[row]).any():
        v = block.u_T[row]
        xi = block.xi[row]
    fields = dict[str, Array]()
    for name, values in block.fields.items():
        if not np.isnan(values[row]).all():
            fields[name] = values[row]
    if fields and study.exact is not None and study.exact.theta is not None:
        # errors of θ are measured also where it does not load the body
        fields["theta"] = level.temperature(scene).theta
    numbers = dict[str, float]()
    for name, values in block.numbers.items():
        if values.ndim == 1:
            numbers[name] = float(values[row])
    solution = Solution(
        status=PointStatus(int(block.status[row])),
        reason=block.reasons.get(row, ""),
        parts=tuple(fields[name] for name in ("u_x", "u_y", "theta") if name in fields),
        v=v,
        xi=xi,
        sticks=np.empty(0, dtype=bool),
        numbers=numbers,
    )
    if level.opening is None:
        return replace(solution, sticks=level.law(scene).sticking(v))
    return _with_openings(solution, block, row)


def _with_openings(solution: Solution, block: BlockRecord, row: int) -> Solution:
    """Return the solution with its openings and its states, which the block has."""
    if not len(solution.v):
        return solution
    assert block.opening is not None
    assert block.S_N is not None
    assert block.sticks is not None
    assert block.rests_N is not None
    return replace(
        solution,
        sticks=block.sticks[row] == 1,
        opening=block.opening[row],
        S_N=block.S_N[row],
        closed=block.rests_N[row] == 1,
    )


class ExactReference:
    """The exact solution that the study gives."""

    def __init__(self, exact: Exact) -> None:
        self._exact = exact
        functions = (*exact.u, exact.theta)
        self._parts = [
            partial(value_and_gradient, function) for function in functions if function is not None
        ]

    def errors(self, level: SolvedLevel, key: Key, scene: Scene) -> Errors:
        """Return absolute errors of a solution, and norms of the reference.

        Empty if there is no solution.
        """
        solution = level.solutions[key]
        if not solution.parts:
            return {}
        u_T = exact_u_T(self._exact)
        xi = exact_xi(self._exact, scene)
        errors = self._body_errors(level, solution, scene)
        ends = (part[level.line.segments] for part in solution.parts)
        errors["u_T_L2"] = level.distance(linear(level.tangential(*ends)), u_T)
        errors["xi_L2"] = level.distance(steps(level.halves(solution.xi)), xi)
        nodal_u_T = at_contact_nodes(u_T, level.mesh, level.line)
        nodal_xi = at_contact_nodes(xi, level.mesh, level.line)
        here = _NodalReference(nodal_u_T, nodal_xi, _largest(nodal_u_T), _largest(nodal_xi))
        errors |= _nodal_errors(level, solution, here)
        numbers = {"friction_resultant": exact_friction_resultant(scene, xi)}
        errors |= _number_errors(solution, numbers)
        return _without_vanishing_friction(errors, scene)

    def _body_errors(self, level: SolvedLevel, solution: Solution, scene: Scene) -> Errors:
        """Return errors and norms in the body."""
        mesh = level.mesh
        exact_samples = [given(mesh, part) for part in self._parts]
        differences = [
            less(nodal(mesh, part, 7), sample)
            for part, sample in zip(solution.parts, exact_samples, strict=False)
        ]
        moduli = scene.material.lam, scene.material.mu
        sizes = norms(mesh, exact_samples, *moduli)
        errors = norms(mesh, differences, *moduli)
        return {name: (error, sizes[name]) for name, error in errors.items()}

    def inclusion(self, level: SolvedLevel, scene: Scene) -> float:
        """Return max dist(ξ, b̂(u_T)) over the contact nodes of a level, over the scale of b.

        It tells whether the exact solution is one.
        """
        line = level.line
        slip = at_contact_nodes(exact_u_T(self._exact), level.mesh, line)
        xi = at_contact_nodes(exact_xi(self._exact, scene), level.mesh, line)
        law = law_along(scene.friction, line.edge_names, line.edge.astype(np.intp), line.xy)
        low, high = law.interval(slip, SLIP_ROUNDING * np.max(np.abs(slip), initial=0.0))
        distance = float(np.max(np.maximum(low - xi, xi - high), initial=0.0))
        scale = max(law.b_scale, float(np.max(np.abs(xi), initial=0.0)))
        return distance / scale if scale > 0.0 else distance


@dataclass(frozen=True)
class _Places:
    """Where a fine mesh lies in a coarse one.

    triangle, weights: coarse triangle of every fine centre, and the weights of its nodes there
    ends:       values of the P1 functions at both ends of the fine segments
    halves:     (s, 2) contact node of both halves of the fine segments
    same_nodes: (m,) fine contact node at each coarse one; None where meshes are not nested
    halves_N:   (s_N, 2) opening of both halves of the fine segments that may lift off, if any do
    same_nodes_N: (k,) fine opening at each coarse one, likewise
    """

    triangle: NDArray[np.intp]
    weights: Array
    ends: csr_array
    halves: NDArray[np.intp]
    same_nodes: NDArray[np.intp] | None
    halves_N: NDArray[np.intp] | None = None
    same_nodes_N: NDArray[np.intp] | None = None


class FineReference:
    """The solutions on a fine mesh, with which all others are compared."""

    def __init__(self, fine: SolvedLevel, nested: bool = False) -> None:
        """Keep the fine level.

        nested: whether its mesh has the nodes of all meshes that are compared, which then are
                compared at them, too
        """
        self._fine = fine
        self._nested = nested
        self._body_norms: dict[Key, dict[str, float]] = {}
        self._places: dict[int, tuple[PlaneMesh, _Places]] = {}

    def errors(self, level: SolvedLevel, key: Key, scene: Scene) -> Errors:
        """Return absolute errors of a solution, and norms of the reference.

        Empty if one of the two is missing.
        """
        solution = level.solutions[key]
        fine_solution = self._fine.solutions[key]
        if not solution.parts or not fine_solution.ok:
            return {}
        places = self._located(level)
        errors = self._body_errors(level, key, scene, places)
        errors |= self._line_errors(solution, fine_solution, places)
        if places.same_nodes is not None:
            here = _NodalReference(
                fine_solution.v[places.same_nodes],
                fine_solution.xi[places.same_nodes],
                _largest(fine_solution.v),
                _largest(fine_solution.xi),
            )
            errors |= _nodal_errors(level, solution, here)
        if places.halves_N is not None:
            errors |= self._opening_errors(level, solution, fine_solution, places)
            errors = _without_rounding(errors)
        numbers = {name: fine_solution.numbers[name] for name in ("energy", "friction_resultant")}
        errors |= _number_errors(solution, numbers)
        return _without_vanishing_friction(errors, scene)

    def _body_errors(self, level: SolvedLevel, key: Key, scene: Scene, places: _Places) -> Errors:
        """Return errors and norms in the body, without the gradient of a constant temperature."""
        mesh = self._fine.mesh
        fine_samples = [nodal(mesh, part) for part in self._fine.solutions[key].parts]
        moduli = [mesh.of_material(scene, name) for name in ("lam", "mu")]
        if key not in self._body_norms:
            self._body_norms[key] = norms(mesh, fine_samples, *moduli)
        differences = []
        for part, fine_sample in zip(level.solutions[key].parts, fine_samples, strict=True):
            nodal_values = part[level.mesh.triangles[places.triangle]]
            centre = np.einsum("qk,qk->q", places.weights, nodal_values)
            gradient = level.mesh.gradient(part)[places.triangle]
            differences.append(less(affine(mesh, centre, gradient), fine_sample))
        sizes = self._body_norms[key]
        errors = {
            name: (error, sizes[name]) for name, error in norms(mesh, differences, *moduli).items()
        }
        if "theta_H1" in errors:
            change = sizes["theta_H1"] * np.ptp(mesh.points)
            if change <= MAX_CONSTANT * sizes["theta_L2"]:
                del errors["theta_H1"]
        return errors

    def _line_errors(self, solution: Solution, fine_solution: Solution, places: _Places) -> Errors:
        """Return errors and norms on the contact line."""
        fine = self._fine
        ends = ((places.ends @ part).reshape(-1, 2) for part in solution.parts)
        fine_ends = (part[fine.line.segments] for part in fine_solution.parts)
        u_T = fine.tangential(*ends)
        fine_u_T = fine.tangential(*fine_ends)
        xi = solution.xi[places.halves]
        fine_xi = fine.halves(fine_solution.xi)
        u_T_error, _ = fine.distance(linear(u_T - fine_u_T))
        u_T_norm, _ = fine.distance(linear(fine_u_T))
        xi_error, _ = fine.distance(steps(xi - fine_xi))
        xi_norm, _ = fine.distance(steps(fine_xi))
        return {
            "u_T_L2": (u_T_error, u_T_norm),
            "xi_L2": (xi_error, xi_norm),
            "u_T_max": (_largest(u_T - fine_u_T), _largest(fine_u_T)),
        }

    def _opening_errors(
        self, level: SolvedLevel, solution: Solution, fine_solution: Solution, places: _Places
    ) -> Errors:
        """Return errors and norms of openings and their tractions."""
        fine = self._fine
        assert level.opening is not None
        assert fine.opening is not None
        ends = ((places.ends @ part).reshape(-1, 2) for part in solution.parts)
        fine_ends = (part[fine.line.segments] for part in fine_solution.parts)
        fine_s_N = fine.openings(*fine_ends)
        s_N_error = fine.openings(*ends) - fine_s_N
        fine_S_N = _halves(fine.opening.unknowns, fine_solution.S_N)
        S_N_error = solution.S_N[places.halves_N] - fine_S_N
        norm = fine.norm_along_openings
        errors: Errors = {
            "opening_L2": (norm(linear(s_N_error)), norm(linear(fine_s_N))),
            "S_N_L2": (norm(steps(S_N_error)), norm(steps(fine_S_N))),
            "opening_max": (_largest(s_N_error), _largest(fine_s_N)),
        }
        if places.same_nodes_N is not None:
            here = _NodalReference(
                fine_solution.opening[places.same_nodes_N],
                fine_solution.S_N[places.same_nodes_N],
                _largest(fine_solution.opening),
                _largest(fine_solution.S_N),
            )
            at_nodes = _errors_at_nodes(level.opening.c, solution.opening, solution.S_N, here)
            names = ("opening_max", "S_N_nodes", "S_N_max")
            errors |= dict(zip(names, at_nodes, strict=True))
        return errors

    def _located(self, level: SolvedLevel) -> _Places:
        """Return where the fine mesh lies in that of a level, found once."""
        key = id(level.mesh)
        if key not in self._places:
            self._places[key] = (level.mesh, self._locate(level))  # so the mesh keeps its id
        return self._places[key][1]

    def _locate(self, level: SolvedLevel) -> _Places:
        fine_line = self._fine.line
        fine_opening = self._fine.opening
        triangle, weights = located(level.mesh, self._fine.mesh.centres)
        same_nodes = None
        if self._nested:
            _, same_nodes = cKDTree(fine_line.xy).query(level.line.xy)
        halves_N = None
        same_nodes_N = None
        if fine_opening is not None and level.opening is not None:
            halves_N = self._openings_of_halves(level)
            if self._nested:
                same_nodes_N = _same_openings(fine_opening, level.opening)
        return _Places(
            triangle=triangle,
            weights=weights,
            ends=interpolation(level.mesh, fine_line.ends.reshape(-1, 2)),
            halves=self._nodes_of_halves(level),
            same_nodes=same_nodes,
            halves_N=halves_N,
            same_nodes_N=same_nodes_N,
        )

    def _nodes_of_halves(self, level: SolvedLevel) -> NDArray[np.intp]:
        """Return (s, 2) the contact node of a level nearest to each half of the fine segments."""
        fine = self._fine
        return _nearest_by_curve(
            (fine.line.ends, fine.curves), level.line.unknowns, level.curves, level.line.xy
        )

    def _openings_of_halves(self, level: SolvedLevel) -> NDArray[np.intp]:
        """Return (s, 2) the opening of a level nearest to each half of the fine segments."""
        fine = self._fine
        assert level.opening is not None
        assert fine.opening is not None
        which = fine.opening.which
        curves = level.curves[level.opening.which]
        return _nearest_by_curve(
            (fine.line.ends[which], fine.curves[which]),
            level.opening.unknowns,
            curves,
            level.opening.xy,
        )


def _nearest_by_curve(
    fine: tuple[Array, NDArray[np.intp]],
    unknowns: NDArray[np.intp],
    curves: NDArray[np.intp],
    xy: Array,
) -> NDArray[np.intp]:
    """Return (s, 2) the unknown of a level nearest to each half of fine segments.

    It is looked up by curve, not by edge: one edge may be both sides of a slot thinner than a cell.

    fine:     ends (s, 2, 2) and curves (s,) of the fine segments
    unknowns: (t, 2) of the level at the ends of its segments, −1 where held;  curves: (t,)
    xy:       (m, 2) places of the unknowns
    """
    fine_ends, fine_curves = fine
    a, b = np.moveaxis(fine_ends, 1, 0)
    middles = np.stack([0.75 * a + 0.25 * b, 0.25 * a + 0.75 * b], axis=1)
    nodes = np.empty(middles.shape[:2], dtype=np.intp)
    for curve in np.unique(fine_curves):
        on_curve = np.unique(unknowns[curves == curve])
        candidates = on_curve[on_curve >= 0]
        is_here = fine_curves == curve
        _, nearest = cKDTree(xy[candidates]).query(middles[is_here])
        nodes[is_here] = candidates[nearest]
    return nodes


def _same_openings(fine: OpeningLine, coarse: OpeningLine) -> NDArray[np.intp]:
    """Return (k,) the fine opening at each coarse one; both edges of a corner have their own."""
    same = np.empty(coarse.m, dtype=np.intp)
    for edge in np.unique(coarse.edge):
        candidates = np.flatnonzero(fine.edge == edge)
        is_here = coarse.edge == edge
        _, nearest = cKDTree(fine.xy[candidates]).query(coarse.xy[is_here])
        same[is_here] = candidates[nearest]
    return same


Reference = ExactReference | FineReference


def _number_errors(solution: Solution, numbers: Mapping[str, float]) -> Errors:
    """Return errors of the numbers that are known of the reference."""
    errors = Errors()
    for name, value in numbers.items():
        if math.isfinite(value):
            errors[name] = abs(solution.numbers.get(name, math.nan) - value), abs(value)
    return errors


def _without_rounding(errors: Errors) -> Errors:
    """Leave out slips that are rounding beside openings, and the other way round."""
    _, u_T = errors["u_T_max"]
    _, s_N = errors["opening_max"]
    noise = SLIP_ROUNDING * max(u_T, s_N)
    rounding = tuple(
        name for name, largest in (("u_T_", u_T), ("opening_", s_N)) if largest <= noise
    )
    return {name: pair for name, pair in errors.items() if not name.startswith(rounding)}


def _without_vanishing_friction(errors: Errors, scene: Scene) -> Errors:
    """Leave out the errors of a friction that vanishes."""
    if not scene.friction.vanishes:
        return errors
    rounding = ("xi_", "friction_resultant")
    return {name: pair for name, pair in errors.items() if not name.startswith(rounding)}


@dataclass(frozen=True)
class _NodalReference:
    """The reference at the contact nodes of a level: u_T and ξ (m,), and their largest values."""

    u_T: Array
    xi: Array
    max_u_T: float
    max_xi: float


def _nodal_errors(level: SolvedLevel, solution: Solution, reference: _NodalReference) -> Errors:
    """Return errors and norms at the contact nodes of a level."""
    at_nodes = _errors_at_nodes(level.line.c, solution.v, solution.xi, reference)
    return dict(zip(("u_T_max", "xi_nodes", "xi_max"), at_nodes, strict=True))


def _errors_at_nodes(
    c: Array, v: Array, xi: Array, reference: _NodalReference
) -> tuple[tuple[float, float], ...]:
    """Return errors and norms: of displacements the largest, of tractions by c and the largest."""
    xi_difference = xi - reference.xi
    xi_error = float(np.sqrt(c @ xi_difference**2))
    xi_norm = float(np.sqrt(c @ reference.xi**2))
    return (
        (_largest(v - reference.u_T), reference.max_u_T),
        (xi_error, xi_norm),
        (_largest(xi_difference), reference.max_xi),
    )


def _largest(values: Array) -> float:
    return float(np.max(np.abs(values), initial=0.0))
