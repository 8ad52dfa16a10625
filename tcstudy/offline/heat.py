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
*columns*, fields on the body, and α enters through their factors only: the field of the load, or of θ_D, that vanishes
elsewhere on Γ_θ, which belongs to every a, and fields of orthonormal variations.

A uniform temperature makes no heat flow: K·1 = 0. Entries of K grow with the flatness of the triangles, and their
rounding is heat that comes from nowhere: the factor's harmonic extension of 1 is not 1. Where it is off by more than
UNSOUND, loads and fields are refined iteratively. The residual comes from the coordinates of the corners, triangle by
triangle, in the form ∫∇θ·∇φ_i of three flows that sum to zero: no entry k_ij, rounded, is in it, and heat is conserved
whatever is rounded.
Literature: N. J. Higham, Accuracy and Stability of Numerical Algorithms, 2002, ch. 12.

Edges whose α keep their ratios share one set of modes, all of them one factor. Where conductivities differ by region K
is that of k over the body's own: a factor for each set of ratios. Left out: any solve for what is constant or loads
nothing.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import NamedTuple

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from tcstudy.condense import Condensation, condense
from tcstudy.expressions.expression import Expression
from tcstudy.fem.boundary import values_at
from tcstudy.fem.forms import Conductivity, HeatForms, edge_load, source_load
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

UNSOUND = 1e-11
"""Error of the harmonic extension of 1 from which fields are refined; 1e6 good triangles stay below it."""
MOST_STEPS = 5
"""Steps of refinement; one gains as many digits as the factor has right."""


class HeatLoad(NamedTuple):
    """A source on the nodes: as given (n,), condensed onto Γ_θ (r,), and after forward elimination (N,)."""

    nodal: Array
    l_tilde: Array
    rows: Array


class HeatFactor:
    """K for k = 1 factorised with the nodes of Γ_θ kept; solves that keep their digits on slivers."""

    def __init__(self, forms: HeatForms, k: Conductivity = ()) -> None:
        n = forms.mesh.n_points
        self._mesh, self._kept, self._k = forms.mesh, forms.kept_nodes, k
        inner = np.ones(n, dtype=bool)
        inner[self._kept] = False
        K = forms.gradients.conduction(k)
        self._factor: Condensation = condense(K, forms.mesh.points, self._kept, inner, components=1)

    @property
    def A_tilde(self) -> Array:
        """(r, r) the heat matrix condensed onto Γ_θ."""
        return self._factor.A_tilde

    @cached_property
    def sound(self) -> bool:
        """Whether the factor alone is accurate enough: the harmonic extension of θ = 1 is 1 but for UNSOUND."""
        return float(np.max(np.abs(self._factor.expand(np.ones(len(self._kept))) - 1.0))) <= UNSOUND

    def load(self, source: Array) -> HeatLoad:
        """The source condensed onto Γ_θ, (r,) [W/m]; Σ l̃ is the whole heat of the source."""
        rows = self._factor.forward(source)
        if self.sound:
            return HeatLoad(source, self._factor.condensed(rows), rows)
        theta = self._factor.expand(np.zeros(len(self._kept)), rows)
        rest = self._rest(source, theta, self._correction(theta, source))
        return HeatLoad(source, self._factor.condensed(self._factor.forward(rest)), rows)

    def expand(self, on_line: Array, load: HeatLoad | None, carries: Array) -> Array:
        """Fields (n, s) with the values on_line (r, s) on Γ_θ; carries: (s,) how much of the load is in each."""
        rows, nodal = (None, 0.0) if load is None else (np.outer(load.rows, carries), load.nodal)
        fields = self._factor.expand(on_line, rows)
        if self.sound:
            return fields
        pairs = zip(fields.T, carries, strict=True)
        return np.column_stack([theta + self._correction(theta, share * nodal) for theta, share in pairs])

    # -- refinement --------------------------------------------------------------------------------

    @cached_property
    def _sides(self) -> tuple[Array, Array, Array]:
        """(e, f, 2d) of every triangle: its sides from corner 0 to 1 and 2 (t, 2), and 2 e × f (t,)."""
        corners = self._mesh.points[self._mesh.triangles]
        e, f = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
        return e, f, 2 * (e[:, 0] * f[:, 1] - e[:, 1] * f[:, 0])

    def _rest(self, source: Array | float, theta: Array, correction: Array) -> Array:
        """source − K(θ + δ), all (n,): its sum is that of the source but for rounding of the heat itself."""
        e, f, twice = self._sides
        triangles, rest = self._mesh.triangles, source + np.zeros(len(theta))
        at, more = theta[triangles], correction[triangles]
        to_1, to_2 = ((at[:, i] - at[:, 0]) + (more[:, i] - more[:, 0]) for i in (1, 2))
        # ∇θ d, turned: large numbers cancel here, once, and what comes of it is the same heat for all three corners
        turned = (to_1[:, None] * f - to_2[:, None] * e) / twice[:, None]
        for where, k in self._k:
            turned[self._mesh.inside(where)] *= k
        for i, side in enumerate((e - f, f, -e)):
            np.subtract.at(rest, triangles[:, i], np.einsum("td,td->t", side, turned))
        return rest

    def _correction(self, theta: Array, source: Array | float) -> Array:
        """What θ (n,) lacks, zero on Γ_θ; kept apart because θ + δ, rounded, would make flows of its own."""
        total, before = np.zeros(len(theta)), np.inf
        for _ in range(MOST_STEPS):
            rest = self._factor.forward(self._rest(source, theta, total))
            step = self._factor.expand(np.zeros(len(self._kept)), rest)
            size = float(np.max(np.abs(step), initial=0.0))
            if not size < 0.5 * before:
                break
            total += step
            before = size
        return total


# -- modes -----------------------------------------------------------------------------------------


def modes(A_tilde: Array, M: Array, held: bool = False) -> tuple[Array, Array]:
    """(μ, W): eigenpairs Ã w_k = μ_k M w_k with WᵀMW = I; the first made exactly 0 and constant, or none so if other
    nodes of the line are held."""
    if not len(M):
        return np.zeros(0), np.zeros((0, 0))
    mu, W = scipy.linalg.eigh(A_tilde, M)
    if not held:
        constant = np.full(len(M), 1.0 / np.sqrt(M.sum()))
        W[:, 1:] -= np.outer(constant, constant @ M @ W[:, 1:])
        W[:, 0], mu[0] = constant, 0.0
    return np.maximum(mu, 0.0), W


ROUNDING = 1e-14
"""Part of a variation that the columns of its family may miss, relative to the variation (norm of L²(Γ_θ))."""


# -- parts and families ----------------------------------------------------------------------------


@dataclass(frozen=True)
class Part:
    """One linear contribution to the temperature: θ = constant + Σ factor × field, and its heat through Γ_θ.

    constant: a uniform temperature [K];  fields: (field, factor) of the variation on top of it [K]
    heat_out: α∫_{Γ_θ}(θ − θ̄) of this part [W/m];  heat_in: ∫_ω q, or the integral of the flux [W/m]
    through:  a bound of the heat that it moves, either way [W/m]
    """

    constant: float
    fields: tuple[tuple[Field, float], ...] = ()
    heat_out: float = 0.0
    heat_in: float = 0.0
    through: float = 0.0


@dataclass
class _Family:
    """Modal data of a family: its right-hand side r₀ + a r₁, and its columns.

    load:    the source or flux, None without;  held: (r,) θ_D, None without; one of them is the first column, if any
    right:   (2, r) r₀ and r₁: l̃ and 0 of a load, 0 and g̃ of surroundings, −S_K θ_D and −M θ_D of what is held
    moments: (2, f) of both in the w_k
    heat:    that is put in [W/m];  moved: Σ_i |∫ q φ_i| [W/m]
    basis:   (f, s) the variations of the other columns in the w_k, orthonormal
    listed:  number of columns made at the start, which are computed together
    """

    load: HeatLoad | None
    held: Array | None
    right: Array
    moments: Array
    heat: float
    moved: float
    basis: Array
    listed: int = 0

    @property
    def carries(self) -> int:
        """1 if its fields have a part that does not depend on a: that of the load, or of θ_D."""
        return int(self.load is not None or self.held is not None)


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
        self._forms, self._factor, self._fields = forms, factor, fields
        self._ratios, self._wanted = dict(ratios), wanted or {}
        self._families: dict[FamilyKey, _Family] = {}
        self._free = ~np.isin(forms.kept_nodes, forms.mesh.nodes_on(*forms.held))  # (r,) temperature is not given

    @cached_property
    def _modes(self) -> tuple[Array, Array, Array, Array]:
        """S_K and M (r, r), M weighted by the ratios; μ (f,) and W, WᵀMW = I, the first mode exactly 0 and constant
        where no temperature is given."""
        S, free = self._factor().A_tilde, np.ix_(self._free, self._free)
        M = self._forms.exchange(self._ratios)
        return S, M, *modes(S[free], M[free], not self._free.all())

    # -- parts -------------------------------------------------------------------------------------

    def part(self, key: FamilyKey, alpha: float, k: float, strength: float) -> Part:
        """θ of one family so many times as strong, all other data being 0: α is that of the edges with ratio 1.

        α = 0 gives the limit of surroundings, the mean of θ̄. Where edges hold temperatures, the heat that leaves is
        counted on Γ_θ and at the nodes that are held.
        """
        family, a, (S, M, mu, W), free = self._family(key), alpha / k, self._modes, self._free
        theta, heat = (1.0 / k, 1.0) if key.heats else (1.0, k)
        shares = self._shares(key, family, a) if a > 0.0 or not free.all() else []
        if free.all():
            m_0, m_1 = family.moments
            constant = theta * float(m_0[0] / a if key.heats else m_1[0]) * float(W[0, 0])
            # a(θ − θ̄) mode by mode, so that a large α does not multiply the rounding of a difference
            flows = np.append(m_0[0], a * (m_0 - mu * m_1)[1:] / (mu[1:] + a))
            heat_out = heat * float(M.sum(axis=0) @ W @ flows)  # zero but for the first, up to the rounding it shows
            most = heat * float(np.linalg.norm(flows) / W[0, 0])  # ∫|·| ≤ |Γ_θ|^½ ‖·‖
            through = family.moved if key.heats else most
        else:
            (r_0, r_1), x, constant = family.right, np.zeros(len(free)), 0.0
            x[free] = W @ (family.basis @ [f for _, f in shares[family.carries :]])
            flows = heat * np.where(free, a * (M @ x - r_1), r_0 - S @ x)
            heat_out, through = float(flows.sum()), float(np.abs(flows).sum())
        fields = tuple((column, strength * (theta * share)) for column, share in shares)
        heats = (strength * heat_out, strength * family.heat, abs(strength) * through)
        return Part(strength * constant, fields, *heats)

    def response(self, source: Array, a: float) -> Array:
        """(n,) θ for k = 1 that a source at the nodes (n,) makes, surroundings and held edges being at 0."""
        factor, (S, M, _, _), free = self._factor(), self._modes, self._free
        load, on_line, own = factor.load(source), np.zeros((len(free), 1)), np.ix_(free, free)
        on_line[free, 0] = np.linalg.solve((S + a * M)[own], load.l_tilde[free])
        return factor.expand(on_line, load, np.ones(1))[:, 0]

    # -- families ----------------------------------------------------------------------------------

    def _family(self, key: FamilyKey) -> _Family:
        """The family with its first columns: one for each a of the sweep, or a basis if that has fewer."""
        if key in self._families:
            return self._families[key]
        forms, (S, M, _, W), zero = self._forms, self._modes, np.zeros(len(self._free))
        load, held, source = None, None, np.zeros(1)
        if key.heats:
            source = (source_load if key.kind == "source" else edge_load)(forms.mesh, key.data, key.where)
            load = self._factor().load(source)
            right = load.l_tilde, zero
        elif key.kind == "surroundings":
            ratio = self._ratios[key.where[0]] if self._ratios else 1.0
            right = zero, ratio * forms.surroundings(key.data, key.where)
        else:  # a corner of two edges that hold temperatures belongs to the first
            before, held = forms.held[: forms.held.index(key.where[0])], zero.copy()
            own = np.setdiff1d(forms.mesh.nodes_on(*key.where), forms.mesh.nodes_on(*before))
            held[np.searchsorted(forms.kept_nodes, own)] = values_at(key.data, forms.mesh.points[own])
            right = -(S @ held), -(M @ held)
        moments = np.array([W.T @ part[self._free] for part in right])
        heats = float(source.sum()), float(np.abs(source).sum())
        family = _Family(load, held, np.array(right), moments, *heats, np.zeros((W.shape[1], 0)))
        rows = [self._variation(family, a) for a in sorted(self._wanted.get(key, ())) if a > 0.0]
        if rows and W.size:  # the variation that is worst represented comes next
            norms = np.linalg.norm(rows, axis=1)
            apart = np.transpose(rows) / np.where(norms > 0.0, norms, 1.0)
            Q, R, _ = scipy.linalg.qr(apart, mode="economic", pivoting=True)
            family.basis = np.asarray(Q[:, np.abs(R.diagonal()) > ROUNDING])
        family.listed = family.carries + family.basis.shape[1]
        self._families[key] = family
        return family

    def _variation(self, family: _Family, a: float) -> Array:
        """(f,) the variation on Γ_θ in the w_k, for k = 1; the constant part, where there is one, is zero.

        After a step of refinement where modes lack digits: of edges whose α differ by decades, or that hold θ_D.
        """
        (S, M, mu, W), free, (r_0, r_1), (m_0, m_1) = self._modes, self._free, family.right, family.moments
        first, values = int(free.all()), np.zeros(len(mu))
        values[first:] = (m_0 + a * m_1)[first:] / (mu[first:] + a)
        if self._ratios or not first:
            x = np.zeros(len(free))
            x[free] = W @ values
            step = W.T @ (r_0 + a * r_1 - S @ x - a * (M @ x))[free] / (mu + a)
            values[first:] += step[first:]
        return values

    def _shares(self, key: FamilyKey, family: _Family, a: float) -> list[tuple[Column, float]]:
        """The variation for a as a combination of columns, exact to rounding; one that they miss adds a column."""
        wanted = self._variation(family, a)
        missed = wanted - family.basis @ (family.basis.T @ wanted)
        if np.linalg.norm(missed) > 2.0 * ROUNDING * np.linalg.norm(wanted):
            missed -= family.basis @ (family.basis.T @ missed)
            family.basis = np.column_stack([family.basis, missed / np.linalg.norm(missed)])
        factors = [*family.carries * [1.0], *(family.basis.T @ wanted).tolist()]
        return [(Column(key, i, family.listed), factor) for i, factor in enumerate(factors)]

    # -- columns on the body -----------------------------------------------------------------------

    def listed(self) -> list[Column]:
        """The columns that the scenes to come need."""
        sizes = ((key, self._family(key).listed) for key in self._wanted)
        return [Column(key, i, listed) for key, listed in sizes for i in range(listed)]

    def field(self, column: Column) -> Array:
        """Nodal values of a column (n,)."""
        if (found := self._fields.find(column)) is not None:
            return found
        batch, family = column.together, self._family(column.family)
        numbers = np.array([c.number for c in batch])
        carries = np.where(numbers < family.carries, 1.0, 0.0)
        on_line = np.zeros((len(self._free), len(batch)))
        every = np.hstack([np.zeros((len(family.basis), family.carries)), family.basis])
        on_line[self._free] = self._modes[3] @ every[:, numbers]
        if family.held is not None:
            on_line += np.outer(family.held, carries)
        values = self._factor().expand(on_line, family.load, carries)
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
        """points: (n, 2) nodes;  scenes: all to come, if known;  memory: bytes of fields kept."""
        self._forms, self._points, self._wanted = forms, points, _wanted(scenes)
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
            own = ratios, self._wanted.get((k, ratios))
            self._conductions[k, ratios] = Conduction(self._forms, lambda: self._factor(k), self._fields, *own)
        return self._conductions[k, ratios]

    def _factor(self, k: Conductivity) -> HeatFactor:
        """K factorised, until what it serves is computed."""
        if k not in self._factors:
            self._factors[k] = HeatFactor(self._forms, k)
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
        mesh = self._forms.mesh
        return float(mesh.area @ theta[mesh.triangles].mean(axis=1)) / float(mesh.area.sum())

    def response(self, scene: Scene, source: Array) -> Array:
        """(n,) θ [K] that heat put in at the nodes (n,) [W/m] makes, surroundings and held edges being at 0."""
        alpha, ratios = exchange_level(scene)
        k = scene.material.k or 1.0
        return self.conduction(relative_k(scene), ratios).response(source / k, alpha / k)

    def exchanged(self, scene: Scene, edges: tuple[str, ...]) -> Array:
        """(n,) −∫(θ − θ̄)φ_i over edges: what one more of their α puts in [K m]."""
        forms, theta = self._forms, self.of(scene).theta
        found, kept = np.zeros(len(theta)), forms.kept_nodes
        for edge, _, theta_bar in scene.exchange:
            if edge in edges:
                found[kept] += forms.surroundings(theta_bar, (edge,)) - forms.exchange({edge: 1.0}) @ theta[kept]
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
