"""Errors of solutions against an exact one, or against the solution on a finer mesh.

A measure whose reference vanishes is left out.

Solutions count on every fine triangle as the linear function that they are at its centre. Where the fine mesh refines
theirs that is exact; elsewhere it is wrong beyond the coarse edge that cuts a triangle, by as much as the gradient
jumps there, to either side alike. (Interpolation at the fine nodes would smooth these jumps, which are the error: with
h_fine = h/4 it lost 27 % of it in the energy norm.) The displacement of the line is that at its fine nodes, the
traction the step function of the coarse line, looked up in the middle of every half of the fine segments. Of nested
meshes the contact nodes are compared, too.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array
from scipy.spatial import cKDTree

from tcstudy.accuracy.norms import Line, LineFunction, Triangles, interpolation, less, located
from tcstudy.exact.numbers import exact_friction_resultant, exact_u_T, exact_xi
from tcstudy.expressions.derivative import value_and_gradient
from tcstudy.laws.composed import law_along
from tcstudy.scene.records import Scene
from tcstudy.scene.study import Exact
from tcstudy.study.solved_levels import SolvedLevel

Array = NDArray[np.float64]
Errors = dict[str, tuple[float, float]]
"""Error and norm of the reference, by name."""
CONSTANT = 1e-9
"""Change of a temperature across the body, over the temperature, that is rounding and no reference for gradients."""


def with_meaning(found: Errors, scene: Scene) -> Errors:
    """The errors without those of ξ where the law is b ≡ 0: rounding there, which is no reference for anything."""
    if not scene.friction.vanishes:
        return found
    return {name: pair for name, pair in found.items() if not name.startswith("xi_") and name != "friction_resultant"}


class Reference(Protocol):
    """What errors are measured against."""

    def errors(self, one: SolvedLevel, index: tuple[int, ...], scene: Scene) -> Errors:
        """Absolute errors of a level's solution of a sweep point and norms of the reference; empty if there is none."""
        ...

    def numbers(self, scene: Scene) -> dict[str, float]:
        """Numbers of the reference by name, as far as they are known, of a scene without a sweep."""
        ...


class ExactReference:
    """The exact solution that the study gives."""

    def __init__(self, exact: Exact) -> None:
        self._exact = exact

    def xi(self, scene: Scene) -> LineFunction:
        """−S_T on Γ_C."""
        return exact_xi(self._exact, scene)

    def errors(self, one: SolvedLevel, index: tuple[int, ...], scene: Scene) -> Errors:
        solution, exact, line = one.solutions[index], self._exact, one.line
        if solution.u is None:
            return {}
        pairs = list(zip(solution.u, exact.u, strict=True))
        if exact.theta is not None and solution.theta is not None:
            pairs.append((solution.theta, exact.theta))
        given = [one.mesh.given(partial(value_and_gradient, of)) for _, of in pairs]
        off = [less(one.mesh.p1(v, 7), f) for (v, _), f in zip(pairs, given, strict=True)]
        moduli = scene.material.lam, scene.material.mu
        u_T, xi = exact_u_T(exact), self.xi(scene)
        return {
            **_over(one.mesh.norms(off, *moduli), one.mesh.norms(given, *moduli)),
            "u_T_L2": line.linear_from(line.tangential(*solution.u), u_T),
            "xi_L2": line.step_from(line.halves(solution.xi), xi),
            **_at_nodes(line, (solution.v, solution.xi), (line.at_nodes(u_T), line.at_nodes(xi))),
        }

    def numbers(self, scene: Scene) -> dict[str, float]:
        return {"friction_resultant": exact_friction_resultant(scene, self.xi(scene))}

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
        self._sizes: dict[tuple[int, ...], dict[str, float]] = {}
        self._places: dict[int, tuple[Triangles, _Places]] = {}

    def errors(self, one: SolvedLevel, index: tuple[int, ...], scene: Scene) -> Errors:
        own, best, mesh, line = one.solutions[index], self._fine.solutions[index], self._fine.mesh, self._fine.line
        if own.u is None or best.u is None or not best.ok:
            return {}
        at, moduli, pairs = self._located(one), self._fine.moduli(scene), list(zip(own.u, best.u, strict=True))
        if own.theta is not None and best.theta is not None:
            pairs.append((own.theta, best.theta))
        if index not in self._sizes:
            self._sizes[index] = mesh.norms([mesh.p1(w) for _, w in pairs], *moduli)
        centres = (np.einsum("qk,qk->q", at.weights, v[one.mesh.triangles[at.triangle]]) for v, _ in pairs)
        coarse = [mesh.linear(c, one.mesh.gradient(v)[at.triangle]) for c, (v, _) in zip(centres, pairs, strict=True)]
        found = mesh.norms([less(a, mesh.p1(w)) for a, (_, w) in zip(coarse, pairs, strict=True)], *moduli)
        u = np.zeros((2, len(line.points)))
        u[:, at.nodes] = [at.at_nodes @ component for component in own.u]
        ends, best_ends, best_halves = line.tangential(*u), line.tangential(*best.u), line.halves(best.xi)
        off, size = line.linear_norm(ends - best_ends), line.linear_norm(best_ends)
        errors = _over(found, self._sizes[index]) | {
            "u_T_L2": (off, size),
            "xi_L2": (line.step_norm(own.xi[at.halves] - best_halves), line.step_norm(best_halves)),
            "u_T_max": (_largest(ends - best_ends), _largest(best_ends)),
        }
        if "theta_H1" in errors and errors["theta_H1"][1] * np.ptp(line.points) <= CONSTANT * errors["theta_L2"][1]:
            del errors["theta_H1"]
        if at.same is not None:
            errors |= _at_nodes(one.line, (own.v, own.xi), (best.v[at.same], best.xi[at.same]), (best.v, best.xi))
        return errors

    def numbers(self, scene: Scene) -> dict[str, float]:
        return {name: self._fine.solutions[()].numbers[name] for name in ("energy", "friction_resultant")}

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


def _over(errors: dict[str, float], sizes: dict[str, float]) -> Errors:
    return {name: (error, sizes[name]) for name, error in errors.items()}


def _at_nodes(
    line: Line, own: tuple[Array, Array], best: tuple[Array, Array], sizes: tuple[Array, Array] | None = None
) -> Errors:
    """Errors of (u_T, ξ) at the contact nodes of a line; sizes: what maxima are relative to, `best` unless given"""
    (v, xi), (best_v, best_xi), (all_v, all_xi) = own, best, sizes or best
    return {
        "u_T_max": (_largest(v - best_v), _largest(all_v)),
        "xi_nodes": (line.nodal_norm(xi - best_xi), line.nodal_norm(best_xi)),
        "xi_max": (_largest(xi - best_xi), _largest(all_xi)),
    }


def _largest(values: Array) -> float:
    return float(np.max(np.abs(values), initial=0.0))
