"""Results of many solutions along a parameter t in which the load of a scene is affine.

The displacement is affine in the contact unknowns v and in t, u = u₀ + t u₁ + E v, and so are the
forces of edges. Works are quadratic. All are computed for some solutions at a time.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from tcstudy.laws.laws import Laws
from tcstudy.offline.level import Level, mechanical_terms
from tcstudy.offline.openings import numbers_of_openings
from tcstudy.offline.requested_outputs import supported_nodes
from tcstudy.scene.records import Free, Role, Scene

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
Numbers = dict[str, Array]
AT_ONCE = 64
"""Solutions whose displacements are computed together; it limits memory."""


@dataclass(frozen=True)
class AffineScene:
    """A scene on a level whose loads are affine in t.

    scene_of:   gives the scene of t
    begin, end: two values of t that define it
    quantities: requested of `output`; of them forces and reactions are known along a path
    """

    level: Level
    scene_of: Callable[[float], Scene]
    begin: float
    end: float
    quantities: Collection[str] = ()

    def numbers(self, t: Array, v: Array, traction: Array, law: Laws) -> Numbers:
        """Return results (k,) of one solution or more: along openings, and forces on request.

        v: (k, m) contact unknowns at t (k,) [m];  traction: (k, m) ξ/c [Pa];  law: by unknown
        """
        parts = list[Numbers]()
        for first in range(0, len(t), AT_ONCE):
            rows = slice(first, first + AT_ONCE)
            part = self._openings(t[rows], v[rows], traction[rows], law)
            if {"forces", "reactions"} & {*self.quantities}:
                part |= self._forces(t[rows], v[rows])
            parts.append(part)
        return {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}

    def _affine(self, value: Callable[[Scene], Array]) -> Callable[[Array], Array]:
        """Return the function of t (k,) that gives values (…, k) affine in it."""
        at_begin = value(self._first)
        rate = (value(self._last) - at_begin) / (self.end - self.begin)
        return lambda t: at_begin[..., None] + rate[..., None] * (t - self.begin)

    @cached_property
    def _first(self) -> Scene:
        return self.scene_of(self.begin)

    @cached_property
    def _last(self) -> Scene:
        return self.scene_of(self.end)

    # -- along openings

    def _openings(self, t: Array, v: Array, traction: Array, law: Laws) -> Numbers:
        if self.level.opening is None:
            return {}
        index = np.broadcast_to(np.atleast_2d(law.index), v.shape)
        held = self._held_slips(t).T, self._held_openings(t).T
        return numbers_of_openings(self.level, held, law.tables.at(index), v, traction)

    @cached_property
    def _held_slips(self) -> Callable[[Array], Array]:
        return self._affine(self.level.held_slips)

    @cached_property
    def _held_openings(self) -> Callable[[Array], Array]:
        return self._affine(self.level.held_openings)

    # -- forces of edges

    @cached_property
    def _unmoved(self) -> Callable[[Array], Array]:
        """Displacements (2n, k) of the body with v = 0."""
        nothing = np.zeros(self.level.m)
        return self._affine(lambda scene: self.level.displacement(scene, nothing))

    @cached_property
    def _load(self) -> Callable[[Array], Array]:
        return self._affine(self.level.load)

    def _forces(self, t: Array, v: Array) -> Numbers:
        """Return reactions, forces and works of edges by name, those that are requested."""
        level = self.level
        u = self._unmoved(t) + level.extensions(self._first, v.T)
        reactions = level.stiffness_times(self._first, u) - self._load(t)
        supported = supported_nodes(level, self._first)
        numbers: Numbers = {}
        for name, nodes in supported.items():
            if "reactions" in self.quantities:
                held = np.where(_both(nodes), reactions, 0.0)
                numbers |= _resultants(f"reaction_{name}", held)
        if "forces" in self.quantities:
            for name, role in self._loaded_edges():
                nodes = supported.get(name, np.zeros(level.mesh.n_points, dtype=bool))
                force = np.where(_both(nodes), reactions, 0.0)
                if name in self._edge_loads:
                    force += self._edge_loads[name](t)
                if any(role.spring):
                    force -= level.forces(u, (), ((name, *role.spring),))
                numbers |= _resultants(f"force_{name}", force)
                numbers[f"work_{name}"] = np.einsum("ik,ik->k", force, u)
        return numbers

    def _loaded_edges(self) -> Iterator[tuple[str, Role]]:
        return ((name, role) for name, role in self._first.boundary if not isinstance(role, Free))

    @cached_property
    def _edge_loads(self) -> dict[str, Callable[[Array], Array]]:
        """Nodal loads (2n, k) by name of the edges that have any at some t."""
        loads = {name: self._load_of(name) for name, _ in self._loaded_edges()}
        ends = (self._first, self._last)
        acting = [name for name, load in loads.items() if any(load(scene).any() for scene in ends)]
        return {name: self._affine(loads[name]) for name in acting}

    def _load_of(self, name: str) -> Callable[[Scene], Array]:
        level = self.level

        def load(scene: Scene) -> Array:
            edge = ((name, dict(scene.boundary)[name]),)
            terms = mechanical_terms((0.0, 0.0), edge)
            parts = (factor * level.vector(basis) for basis, factor in terms)
            return np.asarray(sum(parts, np.zeros(2 * level.mesh.n_points)))

        return load


def _both(nodes: Mask) -> Mask:
    """Return the rows (2n, 1) of both components of nodes (n,)."""
    return np.tile(nodes, 2)[:, None]


def _resultants(name: str, force: Array) -> Numbers:
    """Return the sums (k,) of nodal forces (2n, k) by component."""
    x, y = force.reshape(2, -1, force.shape[1]).sum(axis=1)
    return {f"{name}_x": x, f"{name}_y": y}
