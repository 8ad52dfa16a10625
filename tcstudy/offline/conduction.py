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
from dataclasses import dataclass, field
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
    """Modal data of a family: its right-hand side r₀ + a r₁, its columns, and where variations stand among them.

    load:   the source or flux, None without;  held: (r,) θ_D, None without
    heat:   heat that is put in [W/m];  moved: Σ_i |∫ q φ_i| [W/m]
    right:  (2, r) r₀ and r₁: l̃ and 0 of a load, 0 and g̃ of surroundings, −S_K θ_D and −M θ_D of what is held
    moments: (2, f) of both in the w_k
    modal:  values of the columns on Γ_θ in the w_k, (f,) each;  loaded: whether a column carries the load or θ_D
    basis:  (f, s) orthonormal, the last s of the columns made at the start; empty if every a has a column of its own
    listed: number of columns made at the start, which are computed together;  at: a → number of its own column
    """

    load: HeatLoad | None
    held: Array | None
    heat: float
    moved: float
    right: Array
    moments: Array
    basis: Array
    modal: list[Array] = field(default_factory=list)
    loaded: list[bool] = field(default_factory=list)
    listed: int = 0
    at: dict[float, int] = field(default_factory=dict)

    @property
    def carries(self) -> bool:
        """Whether its fields have a part that does not depend on a: that of the load, or of θ_D."""
        return self.load is not None or self.held is not None


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
        """θ of one family, all other data being 0: α is that of the edges with ratio 1.

        α = 0 gives the limit of surroundings, the mean of θ̄. Where edges hold temperatures, the heat that leaves is
        counted on Γ_θ and at the nodes that are held.
        """
        family, a, (mu, W) = self._family(key), alpha / k, self._spectrum
        r_0, r_1 = family.right
        theta, heat = (1.0 / k, 1.0) if key.heats else (1.0, k)
        columns = self._columns(key, family, a) if a > 0.0 or not self._free.all() else []
        shares = tuple((column, theta * factor) for column, factor in columns)
        if not self._free.all():
            x = np.zeros(len(r_0))
            x[self._free] = W @ sum((f * family.modal[c.number] for c, f in columns), np.zeros(len(mu)))
            flows = heat * np.where(self._free, a * (self._M @ x - r_1), r_0 - self._S @ x)
            return Part(0.0, shares, float(flows.sum()), float(np.abs(flows).sum()))
        m_0, m_1 = family.moments
        constant = theta * float(m_0[0] / a if key.heats else m_1[0]) * float(W[0, 0])
        # a(θ − θ̄) mode by mode, so that a large α does not multiply the rounding of a difference
        flows = np.append(m_0[0], a * (m_0 - mu * m_1)[1:] / (mu[1:] + a))
        through = family.moved if key.heats else heat * float(np.linalg.norm(flows) / W[0, 0])  # ∫|·| ≤ |Γ_θ|^½ ‖·‖
        return Part(constant, shares, heat * float(self._integrals @ flows), through)

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
        family = self._families[key] = self._new_family(key)
        ratios = [a for a in sorted(self.wanted.get(key, ())) if a > 0.0]
        rows = np.array([self._variation(family, a) for a in ratios]).reshape(len(ratios), len(family.moments[0]))
        basis = basis_of(rows)
        if basis.shape[1] + family.carries < len(ratios):
            family.basis = basis
            # the field of the load with θ = 0 on Γ_θ belongs to every a
            family.modal = [np.zeros(len(basis))] * family.carries + list(basis.T)
            family.loaded = [True] * family.carries + [False] * basis.shape[1]
        else:
            for a in ratios:
                self._own_column(family, a)
        family.listed = len(family.modal)
        return family

    def _new_family(self, key: FamilyKey) -> _Family:
        forms, W, zero = self._forms, self._spectrum[1], np.zeros(len(self._free))
        load, held, heat, moved = None, None, 0.0, 0.0
        if key.heats:
            source = forms.source(key.data, key.omega) if key.kind == "source" else forms.flux(key.data, key.edges)
            heat, moved = float(source.sum()), float(np.abs(source).sum())
            load = self._new_factor().load(source)
            right = load.l_tilde, zero
        elif key.kind == "surroundings":
            ratio = self._ratios[key.edges[0]] if self._ratios else 1.0
            right = zero, ratio * forms.surroundings(key.data, key.edges)
        else:
            held = self._held(key)
            right = -(self._S @ held), -(self._M @ held)
        moments = np.array([W.T @ part[self._free] for part in right])
        return _Family(load, held, heat, moved, np.array(right), moments, np.zeros((moments.shape[1], 0)))

    def _held(self, key: FamilyKey) -> Array:
        """(r,) the temperatures that an edge holds; a corner of two such edges belongs to the first."""
        forms, values = self._forms, np.zeros(len(self._free))
        before = forms.held[: forms.held.index(key.edges[0])]
        own = np.setdiff1d(forms.mesh.nodes_on(*key.edges), forms.mesh.nodes_on(*before))
        values[np.searchsorted(forms.kept_nodes, own)] = values_at(key.data, forms.mesh.points[own])
        return values

    def _variation(self, family: _Family, a: float) -> Array:
        """(f,) the variation on Γ_θ in the w_k, for k = 1; the constant part, where there is one, is zero.

        After a step of refinement where modes lack digits: of edges whose α differ by decades, or that hold θ_D.
        """
        (mu, W), free = self._spectrum, self._free
        (m_0, m_1), (r_0, r_1), first = family.moments, family.right, int(free.all())
        values = np.zeros(len(mu))
        values[first:] = (m_0 + a * m_1)[first:] / (mu[first:] + a)
        if self._ratios or not first:
            x = np.zeros(len(free))
            x[free] = W @ values
            step = W.T @ (r_0 + a * r_1 - self._S @ x - a * (self._M @ x))[free] / (mu + a)
            values[first:] += step[first:]
        return values

    def _own_column(self, family: _Family, a: float) -> int:
        """The number of the column that is the variation for a."""
        if a not in family.at:
            family.at[a] = len(family.modal)
            family.modal.append(self._variation(family, a))
            family.loaded.append(family.carries)
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
        carries = np.array([float(family.loaded[c.number]) for c in batch])
        on_line = np.zeros((len(self._free), len(batch)))
        on_line[self._free] = self._spectrum[1] @ np.column_stack([family.modal[c.number] for c in batch])
        if family.held is not None:
            on_line += np.outer(family.held, carries)
        values = self._new_factor().expand(on_line, family.load, carries)
        for c, one in zip(batch, values.T, strict=True):
            if self._fields.find(c) is None:
                self._fields.put(c, one.copy())
        return values[:, batch.index(column)].copy()
