"""Temperature of every scene of a sweep on one mesh, as parts of conduction problems and as loads of the body.

Edges whose α keep their ratios share one set of modes, all of them one factor (`tcstudy.offline.conduction`). Where
conductivities differ by region K is that of k over the body's own: a factor for each set of ratios.

Left out: any solve for what is constant or loads nothing.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from tcstudy.expressions.expression import Expression
from tcstudy.fem.boundary import values_at
from tcstudy.fem.forms import Conductivity
from tcstudy.fem.heat_forms import HeatForms
from tcstudy.offline.conduction import Conduction, HeatFactor, Part
from tcstudy.offline.loads import (
    BasisLoad,
    Column,
    FamilyKey,
    Field,
    LoadTerm,
    Ratios,
    Recent,
    exchange_level,
    heat_shares,
    relative_k,
)
from tcstudy.scene.points import FELT, distinct
from tcstudy.scene.records import Scene

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


class Temperatures:
    """θ of every scene of a study on one mesh, and the load β∫θ tr ε(v) that it makes, as basis terms."""

    def __init__(self, forms: HeatForms, points: Array, scenes: Sequence[Scene], memory: float) -> None:
        """points: (n, 2) nodes;  scenes: all to come, if known;  memory: bytes of fields kept."""
        self._forms: dict[Conductivity, HeatForms] = {(): forms}
        self._points, self._wanted = points, _wanted(scenes)
        self._memory = memory / max(1, len({k for k, _ in self._wanted}))
        self._conductions: dict[tuple[Conductivity, Ratios], Conduction] = {}
        self._factors: dict[Conductivity, HeatFactor] = {}
        self._fields: Recent[Array] = Recent(memory, lambda field: field.nbytes)
        self._means: dict[Field, float] = {}
        self._last: tuple[Scene, Part, bool] | None = None
        self._prepared: set[Conductivity] = set()

    def conduction(self, k: Conductivity = (), ratios: Ratios = ()) -> Conduction:
        """The heat problem with these relative conductivities of the regions and ratios between the α of the edges."""
        if (k, ratios) not in self._conductions:
            forms = self._forms.setdefault(k, replace(self._forms[()], k=k))
            wanted = self._wanted.get((k, ratios))
            self._conductions[k, ratios] = Conduction(forms, lambda: self._factor(k), self._fields, ratios, wanted)
        return self._conductions[k, ratios]

    def _factor(self, k: Conductivity) -> HeatFactor:
        """K factorised, until what it serves is computed."""
        if k not in self._factors:
            self._factors[k] = HeatFactor(self._forms[k])
        return self._factors[k]

    def of(self, scene: Scene) -> Temperature:
        """θ of a scene with its mean and heat balance; zero where the scene has no heat."""
        whole, judged = self._whole(scene)

        def nodal() -> Array:
            theta = np.full(len(self._points), whole.constant)
            for name, factor in whole.fields:
                theta += factor * self.field(name)
            return theta

        mean = whole.constant + sum(factor * self.mean(name) for name, factor in whole.fields)
        # relative to all heat that moves, because sources and sinks may cancel, and little q pass much heat by
        balance = abs(whole.heat_out - whole.heat_in) / whole.through if whole.through else 0.0
        return Temperature(mean, balance if judged else float("nan"), nodal)

    def terms(self, scene: Scene) -> list[LoadTerm]:
        """β∫θ tr ε(v): the uniform part through one vector, the rest through one for each temperature field."""
        if not scene.material.expands:
            return []
        self._prepare(relative_k(scene))
        whole = self._whole(scene)[0]
        fields = [*whole.fields, *([(None, whole.constant)] if whole.constant != 0.0 else [])]
        materials = ((where, own.beta) for where, own in scene.pieces if own.beta != 0.0)
        return [(BasisLoad("temperature", name, at), beta * f) for at, beta in materials for name, f in fields]

    def _prepare(self, k: Conductivity) -> None:
        """Compute what all scenes to come need, if it fits into the memory, and let go of the factor."""
        sets = [ratios for own, ratios in self._wanted if own == k]
        if k in self._prepared or not sets:
            return
        self._prepared.add(k)
        columns = [column for ratios in sets for column in self.conduction(k, ratios).listed()]
        if len(columns) * 8 * len(self._points) <= self._memory:
            for column in columns:
                self.field(column)
            self._factors.pop(k, None)

    def field(self, name: Field) -> Array:
        """Nodal values (n,) of a field."""
        if isinstance(name, Column):
            return self.conduction(name.family.k, name.family.ratios).field(name)
        return self._fields.get(name, lambda: values_at(name, self._points))

    def mean(self, name: Field) -> float:
        """Mean of a field over the body."""
        if name not in self._means:
            self._means[name] = self.mean_of(self.field(name))
        return self._means[name]

    def mean_of(self, theta: Array) -> float:
        """Mean over the body of a temperature at the nodes (n,)."""
        area = self._forms[()].nodal_area
        return float(area @ theta) / float(area.sum())

    def response(self, scene: Scene, source: Array) -> Array:
        """(n,) θ [K] that heat put in at the nodes (n,) [W/m] makes, surroundings and held edges being at 0."""
        alpha, ratios = exchange_level(scene)
        k = scene.material.k or 1.0
        return self.conduction(relative_k(scene), ratios).response(source / k, alpha / k)

    def exchanged(self, scene: Scene, edges: tuple[str, ...]) -> Array:
        """(n,) −∫(θ − θ̄)φ_i over edges: what one more of their α puts in [K m]."""
        forms, theta = self._forms[()], self.of(scene).theta
        found, kept = np.zeros(len(theta)), forms.kept_nodes
        for edge, _, theta_bar in scene.exchange:
            if edge in edges:
                found[kept] += forms.surroundings(theta_bar, (edge,)) - forms.edge_mass((edge,)) @ theta[kept]
        return found

    def _whole(self, scene: Scene) -> tuple[Part, bool]:
        """All parts of θ together, and whether heat judges them; once where the same scene is asked for again.

        Nothing is solved for what is constant or unused.
        """
        if self._last is not None and self._last[0] is scene:
            return self._last[1:]
        parts, judged, given = list[Part](), False, scene.heat.theta
        if given is not None:
            parts = [Part(0.0, ((given, 1.0),)) if isinstance(given, Expression) else Part(float(given))]
        elif scene.conducts:
            (uniform, shares), (alpha, ratios) = heat_shares(scene), exchange_level(scene)
            k, conduction = scene.material.k or 1.0, self.conduction(relative_k(scene), ratios)
            parts = [Part(uniform), *(conduction.part(key, alpha, k, factor) for key, factor in shares)]
            judged = bool(shares) and (scene.heat_by_edge or any(key.heats for key, _ in shares))
        fields = tuple(field for part in parts for field in part.fields)
        sums = (sum(getattr(part, name) for part in parts) for name in ("heat_out", "heat_in", "through"))
        self._last = scene, Part(sum(part.constant for part in parts), fields, *sums), judged
        return self._last[1:]


def _wanted(scenes: Sequence[Scene]) -> dict[tuple[Conductivity, Ratios], dict[FamilyKey, dict[float, None]]]:
    """Values of α/k by family of the scenes to come, by conductivities and ratios."""
    found: dict[tuple[Conductivity, Ratios], dict[FamilyKey, dict[float, None]]] = {}
    for scene in distinct(scenes, *FELT):
        k = scene.material.k
        if scene.material.expands and scene.conducts and scene.heat.theta is None and k:
            alpha, ratios = exchange_level(scene)
            for key, _ in heat_shares(scene)[1]:
                found.setdefault((relative_k(scene), ratios), {}).setdefault(key, {})[alpha / k] = None
    return found
