"""The temperatures of all scenes on one mesh: known ones, and those that heat conduction gives.

Left out: any solve for what is constant or loads nothing.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tcstudy.expressions.expression import Expression
from tcstudy.fem.boundary import values_at
from tcstudy.fem.forms import HeatForms
from tcstudy.offline.cache import Recent
from tcstudy.offline.loads import Field, LoadTerm, TemperatureField, UniformTemperature, split
from tcstudy.offline.thermal import Column, Conduction, Part
from tcstudy.scene.needs import FELT
from tcstudy.scene.points import distinct
from tcstudy.scene.records import Convection, Scene

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Temperature:
    """θ of one scene: its mean [K], and the defect of α∫(θ−θ̄) = ∫q relative to the heat that moves (NaN if unused)."""

    mean: float
    heat_balance: float
    _nodal: Callable[[], Array] = field(repr=False)

    @cached_property
    def theta(self) -> Array:
        """Nodal values (n,) [K], computed when asked for."""
        return self._nodal()


class _ThetaPart(NamedTuple):
    """One part of θ: a uniform temperature, (field, factor) on top; heat out through Γ_θ, heat moved [W/m]."""

    constant: float
    fields: list[tuple[Field, float]]
    heat_out: float = 0.0
    through: float = 0.0


class Temperatures:
    """θ of every scene of a study on one mesh, and the load β∫θ tr ε(v) that it makes, as basis terms."""

    def __init__(self, forms: HeatForms, points: Array, scenes: Sequence[Scene], memory: float) -> None:
        """points: (n, 2) nodes;  scenes: all to come, if known;  memory: bytes of fields kept, of either kind."""
        heated = [s for s in distinct(scenes, *FELT) if s.material.beta != 0.0 and s.edges(Convection)]
        self.conduction = Conduction(forms, ((s.heat, s.material.k) for s in heated), memory)
        self._points, self._area = points, lambda: forms.nodal_area
        self._known: Recent[Array] = Recent(memory, lambda theta: theta.nbytes)
        self._last: tuple[Scene, list[_ThetaPart]] | None = None

    def of(self, scene: Scene) -> Temperature:
        """θ of a scene with its mean and heat balance; zero where the scene has no heat."""
        parts = self._parts(scene)
        constant = sum(part.constant for part in parts)
        fields = [item for part in parts for item in part.fields]

        def nodal() -> Array:
            theta = np.full(len(self._points), constant)
            for name, factor in fields:
                theta += factor * self.field(name)
            return theta

        mean = constant + sum(factor * self._mean(name) for name, factor in fields)
        balance = float("nan")
        shape, factor = split(scene.heat.q)
        if scene.heat.theta is None and scene.edges(Convection) and factor != 0.0:
            # relative to all heat that moves, because sources and sinks may cancel, and little q pass much heat by
            defect = sum(part.heat_out for part in parts) - factor * self.conduction.heat_in(shape, scene.heat.omega)
            through = sum(part.through for part in parts)
            balance = abs(defect) / through if through else 0.0
        return Temperature(mean, balance, nodal)

    def terms(self, scene: Scene) -> list[LoadTerm]:
        """β∫θ tr ε(v): the uniform part through one vector, the rest through one for each temperature field."""
        beta = scene.material.beta
        if beta == 0.0:
            return []
        self.conduction.prepare()
        parts = self._parts(scene)
        terms = [LoadTerm(TemperatureField(name), beta * factor) for part in parts for name, factor in part.fields]
        uniform = sum(part.constant for part in parts)
        if uniform != 0.0:
            terms.append(LoadTerm(UniformTemperature(), beta * uniform))
        return terms

    def field(self, name: Field) -> Array:
        """Nodal values (n,) of a field."""
        if isinstance(name, Column):
            return self.conduction.field(name)
        return self._known.get(name, lambda: values_at(name, self._points))

    def _mean(self, name: Field) -> float:
        """Mean of a field over the body."""
        if isinstance(name, Column):
            return self.conduction.mean(name)
        area = self._area()
        return float(area @ self.field(name)) / float(area.sum())

    def _parts(self, scene: Scene) -> list[_ThetaPart]:
        """All parts of θ, once where the same scene is asked for again."""
        if self._last is None or self._last[0] is not scene:
            self._last = scene, self._new_parts(scene)
        return self._last[1]

    def _new_parts(self, scene: Scene) -> list[_ThetaPart]:
        """Nothing is solved for what is constant or unused."""
        heat = scene.heat
        if heat.theta is not None:
            given = heat.theta
            return [_ThetaPart(0.0, [(given, 1.0)]) if isinstance(given, Expression) else _ThetaPart(float(given), [])]
        if not scene.edges(Convection):
            return []
        k = scene.material.k
        parts: list[tuple[Part, float]] = []
        if isinstance(heat.theta_bar, Expression) or heat.theta_bar != 0.0:
            parts.append((self.conduction.surroundings(heat.theta_bar, heat.alpha, k or 1.0), 1.0))
        shape, factor = split(heat.q)
        if factor != 0.0:
            assert k is not None
            parts.append((self.conduction.source(shape, heat.omega, heat.alpha, k), factor))
        return [
            _ThetaPart(f * p.constant, [(c, f * w) for c, w in p.columns], f * p.heat_out, abs(f) * p.through)
            for p, f in parts
        ]
