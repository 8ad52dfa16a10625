"""Errors of solutions against an exact one, against the finest of nested levels, or against a much finer mesh.

Errors are relative to the norm of the reference. A measure whose reference vanishes is left out.

Where the fine mesh is no refinement of theirs, solutions count on every fine triangle as the linear function that they
are at its centre. Where it is one that is exact; elsewhere it is wrong beyond the coarse edge that cuts a triangle, by
as much as the gradient jumps there, to either side alike. (Interpolation at the fine nodes would smooth these jumps,
which are the error: with h_fine = h/4 it lost 27 % of it in the energy norm.) The displacement of the line is that at
its fine nodes, the traction the step function of the coarse line, looked up in the middle of every half of the fine
segments.
"""

from __future__ import annotations

import itertools
from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from tcstudy.accuracy.norms import Function, Line, LineFunction, less
from tcstudy.accuracy.transfer import (
    Prolongation,
    check_halved,
    interpolation,
    located,
    prolongation,
    refined_ends,
    refined_halves,
)
from tcstudy.exact.numbers import exact_u_T, exact_xi
from tcstudy.expressions.derivative import value_and_gradient
from tcstudy.laws.composed import law_along
from tcstudy.scene.records import Scalar, Scene
from tcstudy.scene.study import Exact
from tcstudy.study.solved_levels import Solution, SolvedLevel

Array = NDArray[np.float64]
Errors = dict[str, tuple[float, float]]
"""Error and norm of the reference, by name."""


def with_meaning(found: Errors, scene: Scene) -> Errors:
    """The errors without those of ξ where the law is b ≡ 0: rounding there, which is no reference for anything."""
    if not scene.friction.vanishes:
        return found
    return {name: pair for name, pair in found.items() if not name.startswith("xi_") and name != "friction_resultant"}


class Reference(Protocol):
    """What errors are measured against."""

    def errors(self, level: int, index: tuple[int, ...], scene: Scene) -> Errors:
        """Absolute errors of a level's solution of a sweep point; empty if there is none to compare."""
        ...


class ExactReference:
    """The exact solution that the study gives."""

    def __init__(self, exact: Exact, levels: list[SolvedLevel]) -> None:
        self._exact, self._levels = exact, levels
        self._u = [_function(component) for component in exact.u]

    def xi(self, scene: Scene) -> LineFunction:
        """−S_T on Γ_C."""
        return exact_xi(self._exact, scene)

    def errors(self, level: int, index: tuple[int, ...], scene: Scene) -> Errors:
        one = self._levels[level]
        solution = one.solutions[index]
        if solution.u is None:
            return {}
        pairs, moduli = list(zip(solution.u, self._u, strict=True)), (scene.material.lam, scene.material.mu)
        if self._exact.theta is not None and solution.theta is not None:
            pairs.append((solution.theta, _function(self._exact.theta)))
        given = [one.mesh.given(function) for _, function in pairs]
        off = [less(one.mesh.p1(v, 7), f) for (v, _), f in zip(pairs, given, strict=True)]
        return _over(one.mesh.norms(off, *moduli), one.mesh.norms(given, *moduli)) | self._on_line(one, solution, scene)

    def _on_line(self, one: SolvedLevel, solution: Solution, scene: Scene) -> Errors:
        assert solution.u is not None
        line, xi = one.line, self.xi(scene)
        u_T_nodes, xi_nodes = line.at_nodes(exact_u_T(self._exact)), line.at_nodes(xi)
        return {
            "u_T_L2": line.linear_from(line.tangential(*solution.u), exact_u_T(self._exact)),
            "u_T_max": (_largest(solution.v - u_T_nodes), _largest(u_T_nodes)),
            "xi_L2": line.step_from(line.halves(solution.xi), xi),
            "xi_nodes": (line.nodal_norm(solution.xi - xi_nodes), line.nodal_norm(xi_nodes)),
            "xi_max": (_largest(solution.xi - xi_nodes), _largest(xi_nodes)),
        }

    def inclusion(self, scene: Scene) -> float:
        """max dist(ξ, b̂(u_T)) over the finest contact nodes, over the scale of b: whether the solution is one."""
        line, names = self._levels[-1].line, self._levels[-1].edges
        own, edge = np.unique(names, return_inverse=True)
        law = law_along(scene.friction, own.tolist(), edge, line.points[line.nodes])
        slip, xi = line.at_nodes(exact_u_T(self._exact)), line.at_nodes(self.xi(scene))
        low, high = law.interval(slip, 1e-9 * _largest(slip))
        worst = float(np.max(np.maximum(low - xi, xi - high), initial=0.0))
        scale = max(law.b_scale, _largest(xi))
        return worst / scale if scale > 0.0 else worst


class NestedReference:
    """The finest of nested levels; the others are prolonged to it."""

    def __init__(self, levels: list[SolvedLevel]) -> None:
        """Raises NotNested if the levels are no uniform refinements."""
        self._levels = levels
        self._steps: list[Prolongation] = []
        for coarse, fine in itertools.pairwise(levels):
            self._steps.append(prolongation(coarse.mesh.points, fine.mesh.points, fine.mesh.triangles))
            check_halved(coarse.line, fine.line)

    @property
    def off_midpoint(self) -> float:
        """How far refinement moved nodes off the midpoints of their edges, relative; 0 if the spaces are nested."""
        return max(step.off_midpoint for step in self._steps)

    def errors(self, level: int, index: tuple[int, ...], scene: Scene) -> Errors:
        finest = self._levels[-1]
        best, own = finest.solutions[index], self._levels[level].solutions[index]
        if best.u is None or own.u is None or not best.ok:
            return {}
        pairs, mesh, moduli = _pairs(own, best), finest.mesh, finest.moduli(scene)
        found = mesh.norms([mesh.p1(self._prolonged(v, level) - w) for v, w in pairs], *moduli)
        return _over(found, mesh.norms([mesh.p1(w) for _, w in pairs], *moduli)) | self._on_line(own, best, level)

    def _prolonged(self, values: Array, level: int) -> Array:
        for step in self._steps[level:]:
            values = step(values)
        return values

    def _on_line(self, own: Solution, best: Solution, level: int) -> Errors:
        assert own.u is not None
        assert best.u is not None
        coarse, fine = self._levels[level].line, self._levels[-1].line
        ends, halves = coarse.tangential(*own.u), coarse.halves(own.xi)
        for _ in self._steps[level:]:
            ends, halves = refined_ends(ends), refined_halves(halves)
        best_ends, best_halves = fine.tangential(*best.u), fine.halves(best.xi)
        at = np.zeros((2, len(fine.points)))
        at[:, fine.nodes] = best.v, best.xi
        v, xi = at[:, coarse.nodes]
        return _of_line(fine, (ends, halves), (best_ends, best_halves)) | {
            "u_T_max": (_largest(own.v - v), _largest(best.v)),
            "xi_nodes": (coarse.nodal_norm(own.xi - xi), coarse.nodal_norm(xi)),
            "xi_max": (_largest(own.xi - xi), _largest(best.xi)),
        }


def _pairs(own: Solution, best: Solution) -> list[tuple[Array, Array]]:
    """Components of the displacement of both, and their temperatures if both have one."""
    assert own.u is not None
    assert best.u is not None
    pairs = list(zip(own.u, best.u, strict=True))
    return pairs if own.theta is None or best.theta is None else [*pairs, (own.theta, best.theta)]


def _over(errors: dict[str, float], sizes: dict[str, float]) -> Errors:
    return {name: (error, sizes[name]) for name, error in errors.items()}


def _of_line(line: Line, own: tuple[Array, Array], best: tuple[Array, Array]) -> Errors:
    """Errors of u_T by its ends and of ξ by its halves, (s, 2) each."""
    return {
        "u_T_L2": (line.linear_norm(own[0] - best[0]), line.linear_norm(best[0])),
        "xi_L2": (line.step_norm(own[1] - best[1]), line.step_norm(best[1])),
    }


def _function(scalar: Scalar) -> Function:
    return lambda x, y: value_and_gradient(scalar, x, y)


def _largest(values: Array) -> float:
    return float(np.max(np.abs(values), initial=0.0))


class FineReference:
    """Solutions on a fine mesh that all others are compared with."""

    def __init__(self, fine: SolvedLevel, levels: list[SolvedLevel]) -> None:
        self._fine, self._levels = fine, levels
        self._sizes: dict[tuple[int, ...], dict[str, float]] = {}

    def errors(self, level: int, index: tuple[int, ...], scene: Scene) -> Errors:
        """Absolute errors of a level's solution and norms of the reference; empty if there is none to compare."""
        return self.errors_of(self._levels[level], index, scene)

    def errors_of(self, one: SolvedLevel, index: tuple[int, ...], scene: Scene) -> Errors:
        """The same for a level that is not in the list."""
        own, best = one.solutions[index], self._fine.solutions[index]
        if own.u is None or best.u is None or not best.ok:
            return {}
        mesh, pairs, moduli = self._fine.mesh, _pairs(own, best), self._fine.moduli(scene)
        if index not in self._sizes:
            self._sizes[index] = mesh.norms([mesh.p1(w) for _, w in pairs], *moduli)
        at, weights = located(one.mesh, mesh.centres)
        centres = (np.einsum("qk,qk->q", weights, v[one.mesh.triangles[at]]) for v, _ in pairs)
        coarse = [mesh.linear(c, one.mesh.gradient(v)[at]) for c, (v, _) in zip(centres, pairs, strict=True)]
        found = mesh.norms([less(a, mesh.p1(w)) for a, (_, w) in zip(coarse, pairs, strict=True)], *moduli)
        return _over(found, self._sizes[index]) | self._on_line(one, own, best)

    def number(self, name: str, index: tuple[int, ...] = ()) -> float:
        """A number of the reference, as in the result file."""
        return self._fine.solutions[index].numbers[name]

    def _on_line(self, one: SolvedLevel, own: Solution, best: Solution) -> Errors:
        assert own.u is not None
        assert best.u is not None
        line = self._fine.line
        nodes = np.unique(line.segments)
        carry, u = interpolation(one.mesh, line.points[nodes]), np.zeros((2, len(line.points)))
        u[:, nodes] = [carry @ component for component in own.u]
        ends, best_ends = line.tangential(*u), line.tangential(*best.u)
        found = _of_line(line, (ends, self._steps(one, own)), (best_ends, line.halves(best.xi)))
        return found | {"u_T_max": (_largest(ends - best_ends), _largest(best_ends))}

    def _steps(self, one: SolvedLevel, own: Solution) -> Array:
        """ξ of a level on both halves of the fine segments (s, 2): that of the nearest node of the same curve.

        Of the curve and not of the edge, which may be both sides of a slot thinner than a cell.
        """
        fine = self._fine
        a, b = np.moveaxis(fine.line.points[fine.line.segments], 1, 0)
        middles = np.stack([0.75 * a + 0.25 * b, 0.25 * a + 0.75 * b], axis=1)
        halves = np.empty(middles.shape[:2])
        at = one.line.points[one.line.nodes]
        for curve in np.unique(fine.segment_curve):
            nodes = np.flatnonzero(np.isin(one.line.nodes, one.line.segments[one.segment_curve == curve]))
            rows = fine.segment_curve == curve
            nearest = cKDTree(at[nodes]).query(middles[rows])[1]
            halves[rows] = own.xi[nodes[nearest]]
        return halves
