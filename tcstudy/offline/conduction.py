"""The heat problem of one mesh for every α, θ̄, q, flux and given temperature of a sweep (method §4, exact).

With S_K the Neumann heat matrix for k = 1 condensed onto Γ_θ, M its mass matrix and S_K w_k = μ_k M w_k,

    θ|_Γθ = Σ_k w_k (w_kᵀq̃ / k + a w_kᵀg̃) / (μ_k + a),    a = α/k,    g̃_i = ∫_{Γ_θ} θ̄ φ_i,

where μ₀ = 0 with constant w₀. The constant part is split off: a constant temperature loads the body through one
fixed vector, and the heat balance keeps its digits however small or large α is.

Edges that differ in α by fixed ratios ρ have M = Σ ρ M_e and g̃ = Σ ρ g̃_e, and one set of modes for all their levels
α. A heat flux is a source on an edge. Where edges hold temperatures θ_D, S_K and M are those of the other nodes of
Γ_θ, θ_D acts by −(S_K + aM)θ_D, and no mode is constant.

The variations that one q, θ̄, flux or θ_D gives for all α are a *family*, rational functions of a with poles at −μ_k: to
rounding they span few dimensions (15 to 30), however many values of α there are. So a family is stored as a few
*columns*, fields on the body, and α enters through their factors only.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from tcstudy.fem.boundary import values_at
from tcstudy.fem.heat_forms import HeatForms
from tcstudy.offline.heat_factor import ROUNDING, HeatFactor, HeatLoad, basis_of, modes
from tcstudy.offline.loads import Column, FamilyKey, Part, Ratios, Recent

Array = NDArray[np.float64]

BATCH = 16
"""Columns that are carried through a factor together: more cost memory and gain nothing."""


@dataclass
class _Family:
    """Modal data of a family: its right-hand side, its columns, and where variations stand among them.

    moments: (f,) w_kᵀq̃, w_kᵀg̃ or −w_kᵀS_Kθ_D
    heat:    heat that is put in [W/m];  moved: Σ_i |∫ q φ_i| [W/m];  load: the source or flux, None without
    given:   (r,) g̃ or θ_D, or 0;  coupling: (f,) −w_kᵀMθ_D, None without θ_D
    modal:   values of the columns on Γ_θ in the w_k, (f,) each;  loaded: whether a column carries the load or θ_D
    basis:   (f, s) orthonormal, the last s of the columns made at the start; empty if every a has a column of its own
    listed:  number of columns made at the start, which are computed together;  at: a → number of its own column
    """

    moments: Array
    heat: float
    moved: float
    load: HeatLoad | None
    given: Array
    coupling: Array | None
    modal: list[Array]
    loaded: list[bool]
    basis: Array
    listed: int
    at: dict[float, int]


class Conduction:
    """Parts of θ for given α, k and data, with one set of ratios between the α of the edges."""

    def __init__(
        self,
        forms: HeatForms,
        factor: Callable[[], HeatFactor],
        fields: Recent[Array],
        ratios: Ratios = (),
        wanted: Mapping[FamilyKey, Mapping[float, None]] | None = None,
    ) -> None:
        """factor: the heat matrix factorised, of all ratios;  fields: those that are kept, likewise.

        ratios: (edge, α of the edge over the level α); none if they have one α
        wanted: values of α/k that are to come, if known: from them a family knows what columns it needs
        """
        self._forms, self._new_factor, self._fields = forms, factor, fields
        self._ratios, self.wanted = dict(ratios), wanted or {}
        self._families: dict[FamilyKey, _Family] = {}

    @cached_property
    def _S(self) -> Array:
        """(r, r) the heat matrix condensed onto the kept nodes."""
        return self._new_factor().A_tilde

    @cached_property
    def _M(self) -> Array:
        """(r, r) the mass matrix of Γ_θ, weighted by the ratios."""
        return self._forms.exchange(self._ratios) if self._ratios else self._forms.robin_mass

    @cached_property
    def _free(self) -> NDArray[np.bool_]:
        """(r,) kept nodes whose temperature is not given."""
        return ~np.isin(self._forms.kept_nodes, self._forms.mesh.nodes_on(*self._forms.held))

    @cached_property
    def _spectrum(self) -> tuple[Array, Array]:
        """(μ, W): generalised eigenpairs, WᵀMW = I; the first exactly 0 and constant where no temperature is given."""
        if self._free.all():
            return modes(self._S, self._M)
        free = np.ix_(self._free, self._free)
        return modes(self._S[free], self._M[free], held=True)

    @cached_property
    def _integrals(self) -> Array:
        """(r,) ∫_{Γ_θ} w_k: zero but for the first, up to the rounding that the heat balance shows."""
        return np.asarray((self._M @ self._spectrum[1]).sum(axis=0))

    # -- parts -------------------------------------------------------------------------------------

    def part(self, key: FamilyKey, alpha: float, k: float) -> Part:
        """θ of one family, all other data being 0: α is that of the edges with ratio 1."""
        if not self._free.all():
            return self._beside_held(key, alpha, k)
        return self._heated(key, alpha, k) if key.heats else self._surroundings(key, alpha, k)

    def _heated(self, key: FamilyKey, alpha: float, k: float) -> Part:
        """θ for θ̄ = 0: heated by q or a flux, cooled to 0 through Γ_θ."""
        family, a = self._family(key), alpha / k
        constant = float(family.moments[0] * self._spectrum[1][0, 0]) / alpha
        columns = tuple((column, factor / k) for column, factor in self._columns(key, family, a))
        modes = sum((factor * family.modal[column.number] for column, factor in columns), np.zeros(len(family.moments)))
        modes[0] = constant / self._spectrum[1][0, 0]
        return Part(constant, columns, alpha * float(self._integrals @ modes), family.moved)

    def _surroundings(self, key: FamilyKey, alpha: float, k: float) -> Part:
        """θ without heat: surroundings at θ̄; α = 0 gives the limit, the mean of θ̄."""
        family, a = self._family(key), alpha / k
        mu, W = self._spectrum
        constant = float(family.moments[0] * W[0, 0])
        # θ − θ̄ mode by mode, so that a large α does not multiply the rounding of a difference
        excess = -mu[1:] * family.moments[1:] / (mu[1:] + a)
        out = alpha * float(self._integrals[1:] @ excess)
        through = alpha * float(np.linalg.norm(excess)) / float(W[0, 0])  # ∫|θ − θ̄| ≤ |Γ_θ|^½ ‖θ − θ̄‖
        return Part(constant, tuple(self._columns(key, family, a)) if a > 0.0 else (), out, through)

    def _beside_held(self, key: FamilyKey, alpha: float, k: float) -> Part:
        """θ where other edges hold 0; the heat that leaves is counted on Γ_θ and at the nodes that are held."""
        family, a, free = self._family(key), alpha / k, self._free
        columns = self._columns(key, family, a)
        x = np.zeros(len(free))
        x[free] = self._spectrum[1] @ sum((f * family.modal[c.number] for c, f in columns), np.zeros(int(free.sum())))
        x += family.given if family.coupling is not None else 0.0
        inside, away = self._S @ x, a * (self._M @ x)
        if family.load is not None:
            inside -= family.load.l_tilde
        elif family.coupling is None:
            away -= a * family.given
        flows, unit = np.where(free, away, -inside), 1.0 if key.heats else k
        shares = tuple((column, factor / k if key.heats else factor) for column, factor in columns)
        return Part(0.0, shares, unit * float(flows.sum()), unit * float(np.abs(flows).sum()))

    def heat_in(self, key: FamilyKey) -> float:
        """∫_ω q, or the integral of the flux [W/m]."""
        return self._family(key).heat

    def response(self, source: Array, a: float) -> Array:
        """(n,) θ for k = 1 that a source at the nodes (n,) makes, surroundings and held edges being at 0."""
        factor = self._new_factor()
        load, free = factor.load(source), self._free
        on_line, own = np.zeros((len(free), 1)), np.ix_(free, free)
        on_line[free, 0] = np.linalg.solve((self._S + a * self._M)[own], load.l_tilde[free])
        return factor.expand(on_line, load, np.ones(1))[:, 0]

    # -- families ----------------------------------------------------------------------------------

    def _family(self, key: FamilyKey) -> _Family:
        """The family with its first columns: one for each a of the sweep, or a basis if that has fewer."""
        if key in self._families:
            return self._families[key]
        family = self._new_family(key)
        ratios = [a for a in sorted(self.wanted.get(key, ())) if a > 0.0]
        rows = np.array([self._variation(family, a) for a in ratios]).reshape(len(ratios), len(family.moments))
        basis, carries = basis_of(rows), _carries(family)
        if basis.shape[1] + carries < len(ratios):
            family.basis = basis
            if carries:  # the field of the source with θ = 0 on Γ_θ belongs to every a
                family.modal, family.loaded = [np.zeros(len(family.moments))], [True]
            family.modal += list(basis.T)
            family.loaded += [False] * basis.shape[1]
        else:
            for a in ratios:
                self._own_column(family, a)
        family.listed = len(family.modal)
        self._families[key] = family
        return family

    def _new_family(self, key: FamilyKey) -> _Family:
        """The right-hand side of a family, without columns."""
        W, free = self._spectrum[1], self._free
        given, load, coupling, heat, moved = np.zeros(len(free)), None, None, 0.0, 0.0
        if key.heats:
            source = (
                self._forms.source(key.data, key.omega)
                if key.kind == "source"
                else self._forms.flux(key.data, key.edges)
            )
            heat, moved = float(source.sum()), float(np.abs(source).sum())
            load = self._new_factor().load(source)
            right = load.l_tilde
        elif key.kind == "surroundings":
            ratio = self._ratios[key.edges[0]] if self._ratios else 1.0
            right = given = ratio * self._forms.surroundings(key.data, key.edges)
        else:
            given = self._held(key)
            right, coupling = -(self._S @ given), -(W.T @ (self._M @ given)[free])
        moments = W.T @ (right if free.all() else right[free])
        return _Family(moments, heat, moved, load, given, coupling, [], [], np.zeros((len(moments), 0)), 0, {})

    def _held(self, key: FamilyKey) -> Array:
        """(r,) the temperatures that an edge holds; a corner of two such edges belongs to the first."""
        forms, values = self._forms, np.zeros(len(self._free))
        before = forms.held[: forms.held.index(key.edges[0])]
        own = np.setdiff1d(forms.mesh.nodes_on(*key.edges), forms.mesh.nodes_on(*before))
        values[np.searchsorted(forms.kept_nodes, own)] = values_at(key.data, forms.mesh.points[own])
        return values

    def _variation(self, family: _Family, a: float) -> Array:
        """(f,) the variation on Γ_θ in the w_k, for k = 1; the constant part, where there is one, is zero."""
        values, first = np.zeros(len(family.moments)), int(self._free.all())
        values[first:] = family.moments[first:] / (self._spectrum[0][first:] + a)
        if family.coupling is not None:
            values = values + a * family.coupling / (self._spectrum[0] + a)
        elif family.load is None:
            values = a * values
        return values if first and not self._ratios else self._corrected(family, a, values)

    def _corrected(self, family: _Family, a: float, values: Array) -> Array:
        """A variation after a step of refinement: modes of edges whose α differ by decades lack digits."""
        (mu, W), free = self._spectrum, self._free
        right = np.zeros(len(free)) if family.load is None else family.load.l_tilde
        if family.coupling is not None:
            right = -(self._S @ family.given) - a * (self._M @ family.given)
        elif family.load is None:
            right = a * family.given
        x = np.zeros(len(free))
        x[free] = W @ values
        step = W.T @ (right - self._S @ x - a * (self._M @ x))[free] / (mu + a)
        if free.all():
            step[0] = 0.0
        return values + step

    def _own_column(self, family: _Family, a: float) -> int:
        """The number of the column that is the variation for a."""
        if a not in family.at:
            family.at[a] = len(family.modal)
            family.modal.append(self._variation(family, a))
            family.loaded.append(_carries(family))
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

    def listed(self) -> list[Column]:
        """The columns that the scenes to come need."""
        return [Column(key, i) for key in self.wanted for i in range(self._family(key).listed)]

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
        found = self._fields.find(column)
        if found is not None:
            return found
        batch = self.together(column)
        family = self._family(column.family)
        on_line = self._spectrum[1] @ np.column_stack([family.modal[c.number] for c in batch])
        carries = np.array([float(family.loaded[c.number]) for c in batch])
        if not self._free.all():
            on_free, on_line = on_line, np.zeros((len(self._free), len(batch)))
            on_line[self._free] = on_free
            if family.coupling is not None:
                on_line += np.outer(family.given, carries)
        values = self._new_factor().expand(on_line, family.load, carries)
        for c, one in zip(batch, values.T, strict=True):
            if self._fields.find(c) is None:
                self._fields.put(c, one.copy())
        return values[:, batch.index(column)].copy()


def _carries(family: _Family) -> bool:
    """Whether a field of the family has a part that does not depend on a: that of the load, or of θ_D."""
    return family.load is not None or family.coupling is not None
