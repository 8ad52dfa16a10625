"""Temperature for every α, θ̄ and q of a sweep from one condensed heat matrix (method §4, exact).

With S_K the Neumann heat matrix for k = 1 condensed onto Γ_θ, M the mass matrix of Γ_θ and S_K w_k = μ_k M w_k,

    θ|_Γθ = Σ_k w_k (w_kᵀq̃ / k + a w_kᵀg̃) / (μ_k + a),    a = α/k,    g̃_i = ∫_{Γ_θ} θ̄ φ_i,

where μ₀ = 0 with constant w₀. The constant part is split off: a constant temperature loads the body through one
fixed vector, and the heat balance keeps its digits however small or large α is.

The variations that one q or one θ̄ gives for all α are a *family*, rational functions of a with poles at −μ_k: to
rounding they span few dimensions (15 to 30), however many values of α there are. So a family is stored as a few
*columns*, fields on the body, and α enters through their factors only.

Families of temperatures: what one q or one θ̄ gives for all α, and the few columns that span them to rounding.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from tcstudy.expressions.expression import Expression
from tcstudy.fem.forms import HeatForms
from tcstudy.offline.cache import Recent
from tcstudy.offline.heat_factor import HeatFactor, HeatLoad
from tcstudy.scene.records import Heat, Scalar

Array = NDArray[np.float64]

BATCH = 16
"""Columns that are carried through a factor together: more cost memory and gain nothing."""


@dataclass(frozen=True)
class Part:
    """One linear contribution to the temperature: θ = constant + Σ factor × column, and its heat through Γ_θ.

    constant: a uniform temperature [K];  columns: (column, factor) of the variation on top of it [K]
    heat_out: α∫_{Γ_θ}(θ − θ̄) of this part [W/m];  through: a bound of the heat that it moves, either way [W/m]
    """

    constant: float
    columns: tuple[tuple[Column, float], ...]
    heat_out: float
    through: float


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
                for key in families_of(heat):
                    self._ratios.setdefault(key, {})[heat.alpha / k] = None
        self._families: dict[FamilyKey, _Family] = {}
        self._fields: Recent[Array] = Recent(memory, lambda field: field.nbytes)
        self._means: dict[Column, float] = {}
        self._kept: HeatFactor | None = None
        self._memory, self._prepared = memory, False

    @property
    def _factor(self) -> HeatFactor:
        if self._kept is None:
            self._kept = HeatFactor(self._forms)
        return self._kept

    @cached_property
    def _spectrum(self) -> tuple[Array, Array]:
        """(μ, W): generalised eigenpairs, WᵀMW = I; the first made exactly 0 and constant."""
        M = self._forms.robin_mass
        mu, W = scipy.linalg.eigh(self._factor.A_tilde, M)
        constant = np.full(len(M), 1.0 / np.sqrt(M.sum()))
        W[:, 1:] -= np.outer(constant, constant @ M @ W[:, 1:])
        W[:, 0] = constant
        mu[0] = 0.0
        return np.maximum(mu, 0.0), W

    @cached_property
    def _integrals(self) -> Array:
        """(r,) ∫_{Γ_θ} w_k: zero but for the first, up to the rounding that the heat balance shows."""
        return np.asarray((self._forms.robin_mass @ self._spectrum[1]).sum(axis=0))

    # -- parts -------------------------------------------------------------------------------------

    def source(self, q: Scalar, omega: tuple[str, ...], alpha: float, k: float) -> Part:
        """θ for θ̄ = 0: heated by q in ω [W/m³], cooled to 0 through Γ_θ."""
        key, a = FamilyKey("source", q, omega), alpha / k
        family = self._family(key)
        constant = float(family.moments[0] * self._spectrum[1][0, 0]) / alpha
        columns = tuple((column, factor / k) for column, factor in self._columns(key, family, a))
        modes = sum((factor * family.modal[column.number] for column, factor in columns), np.zeros(len(family.moments)))
        modes[0] = constant / self._spectrum[1][0, 0]
        return Part(constant, columns, alpha * float(self._integrals @ modes), family.moved)

    def surroundings(self, theta_bar: Scalar, alpha: float, k: float) -> Part:
        """θ for q = 0: surroundings at θ̄. A constant θ̄ gives θ = θ̄ exactly; α = 0 gives the limit, the mean of θ̄."""
        if not isinstance(theta_bar, Expression):
            return Part(float(theta_bar), (), 0.0, 0.0)
        key, a = FamilyKey("surroundings", theta_bar), alpha / k
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
        return self._family(FamilyKey("source", q, omega)).heat

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
        family = _Family(moments, heat, moved, load, [], [], np.zeros((len(moments), 0)), 0, {})
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
            self._kept = None

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
        values = self._factor.expand(on_line, family.load, carries)
        for c, one in zip(batch, values.T, strict=True):
            if self._fields.find(c) is None:
                self._fields.put(c, one.copy())
            self._means[c] = float(self._forms.nodal_area @ one) / float(self._forms.nodal_area.sum())
        return values[:, batch.index(column)].copy()

    def mean(self, column: Column) -> float:
        """Mean of a column over the body."""
        if column not in self._means:
            self.field(column)
        return self._means[column]


ROUNDING = 1e-14
"""Part of a variation that the columns of its family may miss, relative to the variation (norm of L²(Γ_θ))."""


@dataclass(frozen=True)
class FamilyKey:
    """What a family belongs to: a source density of shape `data` in ω, or surroundings at `data` with no source."""

    kind: str
    data: Scalar
    omega: tuple[str, ...] = ()


@dataclass(frozen=True)
class Column:
    """Names one column of a family."""

    family: FamilyKey
    number: int


def families_of(heat: Heat) -> list[FamilyKey]:
    """The families that a heat record has part in."""
    found = []
    if isinstance(heat.theta_bar, Expression):
        found.append(FamilyKey("surroundings", heat.theta_bar))
    if isinstance(heat.q, Expression):
        found.append(FamilyKey("source", heat.q, heat.omega))
    elif heat.q != 0.0:
        found.append(FamilyKey("source", 1.0, heat.omega))
    return found


def basis_of(rows: Array) -> Array:
    """(r, s) orthonormal columns from which every row (t, r) can be combined up to ROUNDING of its norm.

    Gram-Schmidt, the row that is worst represented next; as many columns as rows say that nothing was saved.
    """
    norms = np.linalg.norm(rows, axis=1)
    rest = (rows[norms > 0.0] / norms[norms > 0.0, None]).T
    basis = np.zeros((rows.shape[1], 0))
    while basis.shape[1] < rest.shape[1]:
        missed = np.linalg.norm(rest, axis=0)
        if missed.max() <= ROUNDING:
            break
        new = rest[:, missed.argmax()].copy()
        new -= basis @ (basis.T @ new)
        new /= np.linalg.norm(new)
        new -= basis @ (basis.T @ new)
        new /= np.linalg.norm(new)
        basis = np.column_stack([basis, new])
        rest -= np.outer(new, new @ rest)
    return basis
