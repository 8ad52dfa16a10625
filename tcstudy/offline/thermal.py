"""Temperature for every α, θ̄ and q of a sweep from one condensed heat matrix (method §4, exact).

With S_K the Neumann heat matrix for k = 1 condensed onto Γ_θ, M the mass matrix of Γ_θ and S_K w_k = μ_k M w_k,

    θ|_Γθ = Σ_k w_k (w_kᵀq̃ / k + a w_kᵀg̃) / (μ_k + a),    a = α/k,    g̃_i = ∫_{Γ_θ} θ̄ φ_i,

where μ₀ = 0 with constant w₀. The constant part is split off: a constant temperature loads the body through one
fixed vector, and the heat balance keeps its digits however small or large α is.

The variations that one q or one θ̄ gives for all α are a *family*, rational functions of a with poles at −μ_k: to
rounding they span few dimensions (15 to 30), however many values of α there are. So a family is stored as a few
*columns*, fields on the body, and α enters through their factors only.
Where conductivities differ by region K is that of k over the body's own: a `Conduction` for each set of ratios.
Left out: any solve for what is constant or loads nothing.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from tcstudy.expressions.expression import Expression
from tcstudy.fem.boundary import values_at
from tcstudy.fem.forms import Conductivity, HeatForms
from tcstudy.offline.heat_factor import ROUNDING, HeatFactor, HeatLoad, basis_of, modes
from tcstudy.offline.loads import (
    Column,
    FamilyKey,
    Field,
    LoadTerm,
    Part,
    Recent,
    TemperatureField,
    UniformTemperature,
    families_of,
    relative_k,
    split,
)
from tcstudy.scene.points import FELT, distinct
from tcstudy.scene.records import Convection, Heat, Scalar, Scene

Array = NDArray[np.float64]

BATCH = 16
"""Columns that are carried through a factor together: more cost memory and gain nothing."""


@dataclass
class _Family:
    """Modal data of a family: its right-hand side, its columns, and where variations stand among them.

    moments: (r,) w_kᵀq̃ or w_kᵀg̃
    heat:    ∫_ω q [W/m];  moved: Σ_i |∫_ω q φ_i| [W/m];  load: the source, None for surroundings
    modal:   values of the columns on Γ_θ in the w_k, (r,) each;  loaded: whether a column carries the load
    basis:   (r, s) orthonormal, the last s of the columns made at the start; empty if every a has a column of its own
    listed:  number of columns made at the start, which are computed together;  at: a → number of its own column
    """

    moments: Array
    heat: float
    moved: float
    load: HeatLoad | None
    modal: list[Array]
    loaded: list[bool]
    basis: Array
    listed: int
    at: dict[float, int]
    slopes: dict[float, int]


class Conduction:
    """The heat problem of one mesh, factorised once; parts of θ for given α, k and data."""

    def __init__(
        self, forms: HeatForms, heats: Iterable[tuple[Heat, float | None]] = (), memory: float = 512e6
    ) -> None:
        """heats: (heat record, k) of all scenes to come, if known: from them a family knows what columns it needs.

        memory: bytes of fields that are kept
        """
        self._forms = forms
        self._ratios: dict[FamilyKey, dict[float, None]] = {}
        for heat, k in heats:
            if heat.theta is None and k:
                for key in families_of(heat, forms.k):
                    self._ratios.setdefault(key, {})[heat.alpha / k] = None
        self._families: dict[FamilyKey, _Family] = {}
        self._fields: Recent[Array] = Recent(memory, lambda field: field.nbytes)
        self._memory, self._prepared = memory, False

    @cached_property
    def _factor(self) -> HeatFactor:
        return HeatFactor(self._forms)

    @cached_property
    def _spectrum(self) -> tuple[Array, Array]:
        """(μ, W): generalised eigenpairs, WᵀMW = I; the first exactly 0 and constant."""
        return modes(self._factor.A_tilde, self._forms.robin_mass)

    @cached_property
    def _integrals(self) -> Array:
        """(r,) ∫_{Γ_θ} w_k: zero but for the first, up to the rounding that the heat balance shows."""
        return np.asarray((self._forms.robin_mass @ self._spectrum[1]).sum(axis=0))

    # -- parts -------------------------------------------------------------------------------------

    def source(self, q: Scalar, omega: tuple[str, ...], alpha: float, k: float) -> Part:
        """θ for θ̄ = 0: heated by q in ω [W/m³], cooled to 0 through Γ_θ."""
        key, a = FamilyKey("source", q, omega, self._forms.k), alpha / k
        family = self._family(key)
        constant = float(family.moments[0] * self._spectrum[1][0, 0]) / alpha
        columns = tuple((column, factor / k) for column, factor in self._columns(key, family, a))
        modes = sum((factor * family.modal[column.number] for column, factor in columns), np.zeros(len(family.moments)))
        modes[0] = constant / self._spectrum[1][0, 0]
        return Part(constant, columns, alpha * float(self._integrals @ modes), family.moved)

    def surroundings(self, theta_bar: Scalar, alpha: float, k: float) -> Part:
        """θ for q = 0: surroundings at θ̄. A constant θ̄ gives θ = θ̄ exactly; α = 0 gives the limit, the mean of θ̄."""
        if not isinstance(theta_bar, Expression):
            return Part(float(theta_bar))
        key, a = FamilyKey("surroundings", theta_bar, (), self._forms.k), alpha / k
        family = self._family(key)
        mu, W = self._spectrum
        constant = float(family.moments[0] * W[0, 0])
        # θ − θ̄ mode by mode, so that a large α does not multiply the rounding of a difference
        excess = -mu[1:] * family.moments[1:] / (mu[1:] + a)
        out = alpha * float(self._integrals[1:] @ excess)
        through = alpha * float(np.linalg.norm(excess)) / float(W[0, 0])  # ∫|θ − θ̄| ≤ |Γ_θ|^½ ‖θ − θ̄‖
        return Part(constant, tuple(self._columns(key, family, a)) if a > 0.0 else (), out, through)

    def heat_in(self, q: Scalar, omega: tuple[str, ...]) -> float:
        """∫_ω q [W/m]."""
        return self._family(FamilyKey("source", q, omega, self._forms.k)).heat

    def slope(self, key: FamilyKey, a: float) -> Part:
        """∂θ/∂a of a family for k = 1: 1/(μ_k + a) becomes −1/(μ_k + a)², a/(μ_k + a) becomes μ_k/(μ_k + a)²."""
        family, mu = self._family(key), self._spectrum[0]
        if a not in family.slopes:
            family.slopes[a], family.loaded = len(family.modal), [*family.loaded, False]
            change = family.moments / np.where(mu > 0.0, mu + a, 1.0) ** 2
            family.modal.append(np.where(mu > 0.0, -change if family.load is not None else mu * change, 0.0))
        constant = -float(family.moments[0] * self._spectrum[1][0, 0]) / a**2 if family.load is not None else 0.0
        return Part(constant, ((Column(key, family.slopes[a]), 1.0),))

    # -- families ----------------------------------------------------------------------------------

    def _family(self, key: FamilyKey) -> _Family:
        """The family with its first columns: one for each a of the sweep, or a basis if that has fewer."""
        if key in self._families:
            return self._families[key]
        W, load, heat, moved = self._spectrum[1], None, 0.0, 0.0
        if key.kind == "source":
            source = self._forms.source(key.data, key.omega)
            heat, moved = float(source.sum()), float(np.abs(source).sum())
            load = self._factor.load(source)
        moments = W.T @ (self._forms.surroundings(key.data) if load is None else load.l_tilde)
        family = _Family(moments, heat, moved, load, [], [], np.zeros((len(moments), 0)), 0, {}, {})
        ratios = [a for a in sorted(self._ratios.get(key, ())) if a > 0.0]
        rows = np.array([self._variation(family, a) for a in ratios]).reshape(len(ratios), len(moments))
        basis = basis_of(rows)
        if basis.shape[1] + (load is not None) < len(ratios):
            family.basis = basis
            if load is not None:  # the field of the source with θ = 0 on Γ_θ belongs to every a
                family.modal, family.loaded = [np.zeros(len(moments))], [True]
            family.modal += list(basis.T)
            family.loaded += [False] * basis.shape[1]
        else:
            for a in ratios:
                self._own_column(family, a)
        family.listed = len(family.modal)
        self._families[key] = family
        return family

    def _variation(self, family: _Family, a: float) -> Array:
        """(r,) the variation on Γ_θ in the w_k, for k = 1; its constant part is zero."""
        values = np.zeros(len(family.moments))
        values[1:] = family.moments[1:] / (self._spectrum[0][1:] + a)
        return values if family.load is not None else a * values

    def _own_column(self, family: _Family, a: float) -> int:
        """The number of the column that is the variation for a."""
        if a not in family.at:
            family.at[a] = len(family.modal)
            family.modal.append(self._variation(family, a))
            family.loaded.append(family.load is not None)
        return family.at[a]

    def _columns(self, key: FamilyKey, family: _Family, a: float) -> list[tuple[Column, float]]:
        """The variation for a as a combination of columns, exact to rounding."""
        if family.basis.shape[1] and a not in family.at:
            wanted = self._variation(family, a)
            factors = family.basis.T @ wanted
            missed = np.linalg.norm(wanted - family.basis @ factors)
            if missed <= 2.0 * ROUNDING * np.linalg.norm(wanted):
                first = family.listed - len(factors)
                own = [(Column(key, first + i), float(factor)) for i, factor in enumerate(factors)]
                return own if first == 0 else [(Column(key, 0), 1.0), *own]
        return [(Column(key, self._own_column(family, a)), 1.0)]

    def prepare(self) -> None:
        """Compute what all scenes to come need, if it fits into the memory, and let go of the factor."""
        if self._prepared or not self._ratios:
            return
        self._prepared = True
        columns = [Column(key, i) for key in self._ratios for i in range(self._family(key).listed)]
        if len(columns) * 8 * self._forms.mesh.n_points <= self._memory:
            for column in columns:
                self.field(column)
            self.__dict__.pop("_factor", None)

    # -- columns on the body -----------------------------------------------------------------------

    def together(self, column: Column) -> tuple[Column, ...]:
        """The columns that are computed with this one."""
        listed = self._family(column.family).listed
        if column.number >= listed:
            return (column,)
        first = column.number - column.number % BATCH
        return tuple(Column(column.family, i) for i in range(first, min(first + BATCH, listed)))

    def field(self, column: Column) -> Array:
        """Nodal values of a column (n,)."""
        if (found := self._fields.find(column)) is not None:
            return found
        batch = self.together(column)
        family = self._family(column.family)
        on_line = self._spectrum[1] @ np.column_stack([family.modal[c.number] for c in batch])
        carries = np.array([float(family.loaded[c.number]) for c in batch])
        values = self._factor.expand(on_line, family.load, carries)
        for c, one in zip(batch, values.T, strict=True):
            if self._fields.find(c) is None:
                self._fields.put(c, one.copy())
        return values[:, batch.index(column)].copy()


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
        """points: (n, 2) nodes;  scenes: all to come, if known;  memory: bytes of fields kept, of either kind."""
        heated: dict[Conductivity, list[tuple[Heat, float | None]]] = {}
        for s in (s for s in distinct(scenes, *FELT) if s.material.expands and s.edges(Convection)):
            heated.setdefault(relative_k(s), []).append((s.heat, s.material.k))
        self._forms, self._points, self._memory = forms, points, memory / max(1, len(heated))
        self._heated, self._conductions = heated, dict[Conductivity, Conduction]()
        self._means: dict[Field, float] = {}
        self._known: Recent[Array] = Recent(memory, lambda theta: theta.nbytes)
        self._last: tuple[Scene, list[Part]] | None = None

    def conduction(self, k: Conductivity = ()) -> Conduction:
        """The heat problem with these relative conductivities of the regions."""
        if k not in self._conductions:
            own = replace(self._forms, k=k) if k else self._forms
            self._conductions[k] = Conduction(own, self._heated.get(k, ()), self._memory)
        return self._conductions[k]

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

        mean = constant + sum(factor * self.mean(name) for name, factor in fields)
        balance = float("nan")
        shape, factor = split(scene.heat.q)
        if scene.heat.theta is None and scene.edges(Convection) and factor != 0.0:
            # relative to all heat that moves, because sources and sinks may cancel, and little q pass much heat by
            heat_in = factor * self.conduction(relative_k(scene)).heat_in(shape, scene.heat.omega)
            defect = sum(part.heat_out for part in parts) - heat_in
            through = sum(part.through for part in parts)
            balance = abs(defect) / through if through else 0.0
        return Temperature(mean, balance, nodal)

    def terms(self, scene: Scene) -> list[LoadTerm]:
        """β∫θ tr ε(v): the uniform part through one vector, the rest through one for each temperature field."""
        if not scene.material.expands:
            return []
        self.conduction(relative_k(scene)).prepare()
        parts = self._parts(scene)
        uniform = sum(part.constant for part in parts)
        terms = []
        for at, beta in ((where, own.beta) for where, own in scene.pieces if own.beta != 0.0):
            terms += [LoadTerm(TemperatureField(name, at), beta * f) for part in parts for name, f in part.fields]
            if uniform != 0.0:
                terms.append(LoadTerm(UniformTemperature(at), beta * uniform))
        return terms

    def field(self, name: Field) -> Array:
        """Nodal values (n,) of a field."""
        if isinstance(name, Column):
            return self.conduction(name.family.k).field(name)
        return self._known.get(name, lambda: values_at(name, self._points))

    def mean(self, name: Field) -> float:
        """Mean of a field over the body."""
        if name not in self._means:
            area = self._forms.nodal_area
            self._means[name] = float(area @ self.field(name)) / float(area.sum())
        return self._means[name]

    def _parts(self, scene: Scene) -> list[Part]:
        """All parts of θ, once where the same scene is asked for again."""
        if self._last is None or self._last[0] is not scene:
            self._last = scene, list(self._new_parts(scene))
        return self._last[1]

    def _new_parts(self, scene: Scene) -> Iterator[Part]:
        """Nothing is solved for what is constant or unused."""
        heat, k, conduction = scene.heat, scene.material.k, self.conduction(relative_k(scene))
        if heat.theta is not None:
            given = heat.theta
            yield Part(0.0, ((given, 1.0),)) if isinstance(given, Expression) else Part(float(given))
        elif scene.edges(Convection):
            if isinstance(heat.theta_bar, Expression) or heat.theta_bar != 0.0:
                yield conduction.surroundings(heat.theta_bar, heat.alpha, k or 1.0)
            shape, factor = split(heat.q)
            if factor != 0.0:
                assert k is not None
                yield conduction.source(shape, heat.omega, heat.alpha, k).times(factor)
