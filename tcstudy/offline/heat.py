"""The heat problem of one mesh for every α, θ̄, q, flux and given temperature of a sweep (method
§4, exact).

With S_K the Neumann heat matrix for k = 1 condensed onto Γ_θ, M its mass matrix and S_K w_k = μ_k M
w_k,

    θ|_Γθ = Σ_k w_k (w_kᵀq̃ / k + a w_kᵀg̃) / (μ_k + a),    a = α/k,    g̃_i = ∫_{Γ_θ} θ̄ φ_i,

where μ₀ = 0 with constant w₀. The constant part is split off: a constant temperature loads the body
through one fixed vector, and the heat balance keeps its digits however small or large α is. Edges
that differ in α by fixed ratios ρ have M = Σ ρ M_e and g̃ = Σ ρ g̃_e, and one set of modes for all
their levels α. A heat flux is a source on an edge. Where edges hold temperatures θ_D, S_K and M are
those of the other nodes of Γ_θ, θ_D acts by −(S_K + aM)θ_D, and no mode is constant. Where
conductivities differ by region K is that of k over the body's own: a factor for each set of ratios.
Left out: any solve for what is constant or loads nothing.

What all data give for all α are rational functions of a with poles at −μ_k: to rounding they span
few dimensions (15 to 30). So they are stored as a few *columns*, fields on the body, and α enters
through their factors only: the field of each load, or of each θ_D, that vanishes elsewhere on Γ_θ,
and fields of orthonormal variations, which all data share.

A uniform temperature makes no heat flow: K·1 = 0. Entries of K grow with the flatness of the
triangles, and their rounding is heat that comes from nowhere: the factor's harmonic extension of 1
is not 1. Where it is off by more than UNSOUND, loads and fields are refined iteratively. The
residual comes from the coordinates of the corners, triangle by triangle, in the form ∫∇θ·∇φ_i of
three flows that sum to zero: no entry k_ij, rounded, is in it, and heat is conserved whatever is
rounded. Literature: N. J. Higham, Accuracy and Stability of Numerical Algorithms, 2002, ch. 12.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Literal, NamedTuple, TypeVar

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from tcstudy.condense import Condensation, condense
from tcstudy.expressions.expression import Expression
from tcstudy.fem.forms import Conductivity, ElasticForms, edge_load, source_load, values_at
from tcstudy.scene.points import FELT, distinct
from tcstudy.scene.records import Scalar, Scene, Where
from tcstudy.shapes.edges import segment_mass

Array = NDArray[np.float64]

Ratios = tuple[tuple[str, float], ...]
"""(edge, its α over the level α), none if they have one α."""


@dataclass(frozen=True)
class Datum:
    """What of a heat problem is given.

    kind:  "source", density of shape `data` in regions; "flux", the same into edges; "surroundings" at `data`, of
           edges or of all of Γ_θ; "held", `data` being the temperature of an edge
    where: names of the regions or edges
    """

    kind: Literal["source", "flux", "surroundings", "held"]
    data: Scalar
    where: tuple[str, ...] = ()

    @property
    def heats(self) -> bool:
        return self.kind in ("source", "flux")


BATCH = 16
"""Columns that are carried through a factor together: more cost memory and gain nothing."""


@dataclass(frozen=True)
class Column:
    """Names a field of the heat problem with these relative k and ratios, of which so many are
    listed at the start."""

    k: Conductivity
    ratios: Ratios
    number: int
    listed: int

    @property
    def together(self) -> tuple[Column, ...]:
        """Those that are computed with this one."""
        if self.number >= self.listed:
            return (self,)
        first = self.number - self.number % BATCH
        return tuple(replace(self, number=i) for i in range(first, min(first + BATCH, self.listed)))


Field = Expression | Column | None
"""A temperature field on the body: given, a column of a heat problem, or θ = 1."""


def split(scalar: Scalar) -> tuple[Scalar, float]:
    """A scalar as (shape, factor): numbers become factors of the unit shape 1."""
    return (scalar, 1.0) if isinstance(scalar, Expression) else (1.0, float(scalar))


def to_digits(ratio: float) -> float:
    """A ratio to 15 digits, so that numbers that vary together keep it whatever the rounding."""
    return float(f"{ratio:.14e}")


def exchange_level(scene: Scene) -> tuple[float, Ratios]:
    """α of the edge that exchanges most, and the α of all edges over it, to 15 digits; none where
    they are equal."""
    if not scene.heat_by_edge:
        return scene.heat.alpha, ()
    alpha = max((own for _, own, _ in scene.exchange), default=0.0)
    if alpha == 0.0:
        return alpha, ()
    ratios = tuple((edge, to_digits(own / alpha)) for edge, own, _ in scene.exchange)
    return alpha, ratios if any(ratio != 1.0 for _, ratio in ratios) else ()


def heat_shares(scene: Scene) -> tuple[float, list[tuple[Datum, float]]]:
    """θ of a scene without known temperature: a uniform part [K], and (datum, factor) of what is
    added to it.

    What is constant on all edges is the uniform part: then nothing is solved for it.
    """
    heat = scene.heat
    given: list[tuple[Datum, Scalar]] = [(Datum("surroundings", 1.0), heat.theta_bar)]
    if scene.heat_by_edge:
        given = [(Datum("surroundings", 1.0, (edge,)), bar) for edge, _, bar in scene.exchange]
        given += [(Datum("held", 1.0, (edge,)), theta) for edge, theta in scene.held_theta]
    numbers = [value for _, value in given if not isinstance(value, Expression)]
    uniform = float(numbers[0]) if len(numbers) == len(given) else 0.0
    given += [(Datum("source", 1.0, heat.omega), heat.q)]
    given += [(Datum("flux", 1.0, (edge,)), flux) for edge, flux in scene.flux]
    found = []
    for datum, value in given:
        shape, factor = split(value)
        if not datum.heats and shape == 1.0:
            factor -= uniform
        if factor != 0.0:
            found.append((replace(datum, data=shape), factor))
    return uniform, found


def relative_k(scene: Scene) -> Conductivity:
    """k over that of the material of the body, to 15 digits; () where it is the same everywhere."""
    k = scene.material.k
    if not k or not scene.material.regions:
        return ()
    return tuple((where, to_digits((own.k or 0.0) / k)) for where, own in scene.pieces)


T = TypeVar("T")


class Recent(dict[Hashable, T]):
    """Values by key, made on demand; all are let go of where the total size would pass `budget`
    bytes.

    Values that are still referenced elsewhere stay alive there: forgetting costs time later, never
    correctness.
    """

    def __init__(self, budget: float = np.inf, size: Callable[[T], int] = lambda _: 1) -> None:
        super().__init__()
        self._budget, self._size, self._total = budget, size, 0

    def __setitem__(self, key: Hashable, value: T) -> None:
        self._total += self._size(value)
        if self._total > self._budget:
            self.clear()
            self._total = self._size(value)
        super().__setitem__(key, value)

    def of(self, key: Hashable, make: Callable[[], T]) -> T:
        if key not in self:
            self[key] = make()
        return self[key]


UNSOUND = 1e-11
"""Error of the harmonic extension of 1 from which fields are refined; 1e6 good triangles stay below
it."""
MOST_STEPS = 5
"""Steps of refinement; one gains as many digits as the factor has right."""


class HeatFactor:
    """K for k = 1 factorised with the nodes of Γ_θ kept; solves that keep their digits on
    slivers."""

    def __init__(self, forms: ElasticForms, kept: NDArray[np.intp], k: Conductivity) -> None:
        self._mesh, self._kept, self._k = forms.mesh, kept, k
        inner = np.ones(forms.mesh.n_points, dtype=bool)
        inner[kept] = False
        self._factor: Condensation = condense(
            forms.conduction(k), forms.mesh.points, kept, inner, components=1
        )

    @property
    def A_tilde(self) -> Array:
        return self._factor.A_tilde

    @cached_property
    def sound(self) -> bool:
        """Whether the factor alone is accurate enough: the harmonic extension of θ = 1 is 1 but for
        UNSOUND."""
        return float(np.max(np.abs(self._factor.expand(np.ones(len(self._kept))) - 1.0))) <= UNSOUND

    def load(self, source: Array) -> tuple[Array, Array]:
        """A source (n,) condensed onto Γ_θ (r,) [W/m], whose sum is its whole heat, and its field
        (n,), 0 on Γ_θ."""
        rows = self._factor.forward(source)
        theta = self._factor.expand(np.zeros(len(self._kept)), rows)
        if not self.sound:
            correction = self._correction(theta, source)
            rows, theta = (
                self._factor.forward(self._rest(source, theta, correction)),
                theta + correction,
            )
        return self._factor.condensed(rows), theta

    def extended(self, on_line: Array) -> Array:
        """Fields (n, s) without a source that have the values on_line (r, s) on Γ_θ."""
        fields = self._factor.expand(on_line)
        return (
            fields
            if self.sound
            else np.column_stack([theta + self._correction(theta, 0.0) for theta in fields.T])
        )

    def _rest(self, source: Array | float, *fields: Array) -> Array:
        """source − K Σ fields, all (n,): its sum is that of the source but for rounding of the heat
        itself."""
        triangles, corners, rest = (
            self._mesh.triangles,
            self._mesh.corners,
            source + np.zeros(self._mesh.n_points),
        )
        e, f = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
        jumps: Array = np.sum(
            [field[triangles[:, 1:]] - field[triangles[:, :1]] for field in fields], axis=0
        )
        # ∇θ d, turned: large numbers cancel here, once, and what comes of it is the same heat for
        # all three corners
        turned = (jumps[:, :1] * f - jumps[:, 1:] * e) / (4.0 * self._mesh.area)[:, None]
        for where, k in self._k:
            turned[self._mesh.inside(where)] *= k
        for i, side in enumerate((e - f, f, -e)):
            np.subtract.at(rest, triangles[:, i], np.einsum("td,td->t", side, turned))
        return rest

    def _correction(self, theta: Array, source: Array | float) -> Array:
        """What θ (n,) lacks, zero on Γ_θ; kept apart because θ + δ, rounded, would make flows of
        its own."""
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


def modes(A_tilde: Array, M: Array, held: bool = False) -> tuple[Array, Array]:
    """(μ, W): eigenpairs Ã w_k = μ_k M w_k with WᵀMW = I; the first made exactly 0 and constant, or
    none so if other nodes of the line are held."""
    if not len(M):
        return np.zeros(0), np.zeros((0, 0))
    mu, W = scipy.linalg.eigh(A_tilde, M)
    if not held:
        constant = np.full(len(M), 1.0 / np.sqrt(M.sum()))
        W[:, 1:] -= np.outer(constant, constant @ M @ W[:, 1:])
        W[:, 0], mu[0] = constant, 0.0
    return np.maximum(mu, 0.0), W


ROUNDING = 1e-14
"""Part of a variation that the columns may miss, relative to the variation (norm of L²(Γ_θ))."""


class Part(NamedTuple):
    """One linear contribution to the temperature.

    fields: factors by field [K];  heat: [W/m] α∫_{Γ_θ}(θ − θ̄) of this part; ∫_ω q, or the integral of the flux; and a
    bound of the heat that it moves, either way
    """

    fields: Mapping[Field, float]
    heat: tuple[float, float, float] = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class _Heated:
    """What a datum puts in: its right-hand side r₀ + a r₁, and its column.

    right:   (2, r) r₀ and r₁: l̃ and 0 of a load, 0 and g̃ of surroundings, −S_K θ_D and −M θ_D of what is held
    moments: (2, f) of both in the w_k
    heat:    that is put in [W/m];  moved: Σ_i |∫ q φ_i| [W/m]
    own:     the number of the column of the load, or of θ_D; () of surroundings, which have none
    """

    right: Array
    moments: Array
    heat: float
    moved: float
    own: tuple[int, ...]


class Conduction:
    """Parts of θ for given α, k and data, with one set of ratios between the α of the edges."""

    def __init__(
        self,
        body: Temperatures,
        k: Conductivity,
        ratios: Ratios,
        wanted: Mapping[Datum, Mapping[float, None]],
    ) -> None:
        """wanted: values of α/k that are to come, if known: they say what columns are needed."""
        self._body, self._key, self._ratios = body, (k, ratios), dict(ratios)
        self._free = ~np.isin(
            body.nodes, body.mesh.nodes_on(*body.held)
        )  # (r,) temperature is not given
        S, M, free = (
            body.factor(k).A_tilde,
            body.exchange(self._ratios),
            np.ix_(self._free, self._free),
        )
        self._modes = S, M, *modes(S[free], M[free], not self._free.all())
        """S_K and M (r, r), M weighted by the ratios; μ (f,) and W, WᵀMW = I."""
        self._data: dict[Datum, _Heated] = {}
        self._columns: list[
            tuple[Array, Array | float]
        ] = []  # values on Γ_θ (r,), and the field of a load (n,)
        self._basis: Array = np.zeros(
            (len(self._modes[2]), 0)
        )  # (f, s) variations in the w_k, orthonormal
        self._numbers: list[int] = []  # (s,) of their columns
        pairs = [
            (self._heated(datum), a)
            for datum, values in wanted.items()
            for a in sorted(values)
            if a > 0.0
        ]
        if pairs and len(self._basis):  # the variation that is worst represented comes next
            rows = [self._variation(heated, a) for heated, a in pairs]
            norms = np.linalg.norm(rows, axis=1)
            apart = np.transpose(rows) / np.where(norms > 0.0, norms, 1.0)
            Q, R, _ = scipy.linalg.qr(apart, mode="economic", pivoting=True)
            for variation in Q.T[np.abs(R.diagonal()) > ROUNDING]:
                self._add(variation)
        self._listed = len(self._columns)

    @property
    def listed(self) -> list[Column]:
        return [Column(*self._key, i, self._listed) for i in range(self._listed)]

    def part(self, datum: Datum, alpha: float, k: float, strength: float) -> Part:
        """θ of one datum so many times as strong, all others being 0: α is that of the edges with
        ratio 1.

        α = 0 gives the limit of surroundings, the mean of θ̄. Where edges hold temperatures, the
        heat that leaves is counted on Γ_θ and at the nodes that are held.
        """
        heated, a, (S, M, mu, W), free = self._heated(datum), alpha / k, self._modes, self._free
        theta, heat = (1.0 / k, 1.0) if datum.heats else (1.0, k)
        solved = a > 0.0 or not free.all()
        values = self._variation(heated, a) if solved else np.zeros(len(mu))
        shares = self._shares(heated, values) if solved else []
        if free.all():
            m_0, m_1 = heated.moments
            constant = theta * float(m_0[0] / a if datum.heats else m_1[0]) * float(W[0, 0])
            # a(θ − θ̄) mode by mode, so that a large α does not multiply the rounding of a
            # difference
            flows = np.append(m_0[0], a * (m_0 - mu * m_1)[1:] / (mu[1:] + a))
            heat_out = heat * float(
                M.sum(axis=0) @ W @ flows
            )  # zero but for the first, up to the rounding it shows
            most = heat * float(np.linalg.norm(flows) / W[0, 0])  # ∫|·| ≤ |Γ_θ|^½ ‖·‖
            through = heated.moved if datum.heats else most
        else:
            (r_0, r_1), x, constant = heated.right, np.zeros(len(free)), 0.0
            x[free] = W @ values
            flows = heat * np.where(free, a * (M @ x - r_1), r_0 - S @ x)
            heat_out, through = float(flows.sum()), float(np.abs(flows).sum())
        fields: dict[Field, float] = {
            column: strength * (theta * share) for column, share in shares
        }
        heat_moved = strength * heat_out, strength * heated.heat, abs(strength) * through
        return Part(fields | {None: strength * constant}, heat_moved)

    def response(self, source: Array, a: float) -> Array:
        """(n,) θ for k = 1 that a source at the nodes (n,) makes, surroundings and held edges being
        at 0."""
        factor, (S, M, _, _), free = self._body.factor(self._key[0]), self._modes, self._free
        (l_tilde, theta), on_line, own = (
            factor.load(source),
            np.zeros((len(free), 1)),
            np.ix_(free, free),
        )
        on_line[free, 0] = np.linalg.solve((S + a * M)[own], l_tilde[free])
        return theta + factor.extended(on_line)[:, 0]

    def _heated(self, datum: Datum) -> _Heated:
        if datum in self._data:
            return self._data[datum]
        body, (S, M, _, W), zero = self._body, self._modes, np.zeros(len(self._free))
        column: tuple[Array, Array | float] | None = None
        source = np.zeros(1)
        if datum.heats:
            source = (source_load if datum.kind == "source" else edge_load)(
                body.mesh, datum.data, datum.where
            )
            l_tilde, field = body.factor(self._key[0]).load(source)
            right, column = (l_tilde, zero), (zero, field)
        elif datum.kind == "surroundings":
            ratio = self._ratios[datum.where[0]] if self._ratios else 1.0
            right = zero, ratio * body.surroundings(datum.data, datum.where)
        else:  # a corner of two edges that hold temperatures belongs to the first
            before, held = body.held[: body.held.index(datum.where[0])], zero.copy()
            own = np.setdiff1d(body.mesh.nodes_on(*datum.where), body.mesh.nodes_on(*before))
            held[np.searchsorted(body.nodes, own)] = values_at(datum.data, body.mesh.points[own])
            right, column = (-(S @ held), -(M @ held)), (held, 0.0)
        moments = np.array([W.T @ part[self._free] for part in right])
        numbers = () if column is None else (len(self._columns),)
        self._columns += [] if column is None else [column]
        heated = _Heated(
            np.array(right), moments, float(source.sum()), float(np.abs(source).sum()), numbers
        )
        return self._data.setdefault(datum, heated)

    def _variation(self, heated: _Heated, a: float) -> Array:
        """(f,) the variation on Γ_θ in the w_k, for k = 1; the constant part, where there is one,
        is zero.

        After a step of refinement where modes lack digits: of edges whose α differ by decades, or
        that hold θ_D.
        """
        (S, M, mu, W), free, (r_0, r_1), (m_0, m_1) = (
            self._modes,
            self._free,
            heated.right,
            heated.moments,
        )
        first, values = int(free.all()), np.zeros(len(mu))
        values[first:] = (m_0 + a * m_1)[first:] / (mu[first:] + a)
        if self._ratios or not first:
            x = np.zeros(len(free))
            x[free] = W @ values
            step = W.T @ (r_0 + a * r_1 - S @ x - a * (M @ x))[free] / (mu + a)
            values[first:] += step[first:]
        return values

    def _shares(self, heated: _Heated, wanted: Array) -> list[tuple[Column, float]]:
        """A variation as a combination of columns, exact to rounding; one that they miss adds a
        column."""
        missed = wanted - self._basis @ (self._basis.T @ wanted)
        if np.linalg.norm(missed) > 2.0 * ROUNDING * np.linalg.norm(wanted):
            missed -= self._basis @ (self._basis.T @ missed)
            self._add(missed / np.linalg.norm(missed))
        numbers, factors = (
            (*heated.own, *self._numbers),
            (*(1.0 for _ in heated.own), *self._basis.T @ wanted),
        )
        return [
            (Column(*self._key, i, self._listed), float(f))
            for i, f in zip(numbers, factors, strict=True)
        ]

    def _add(self, variation: Array) -> None:
        """A column more, of a unit variation (f,) orthogonal to all."""
        on_line = np.zeros(len(self._free))
        on_line[self._free] = self._modes[3] @ variation
        self._basis = np.column_stack([self._basis, variation])
        self._numbers.append(len(self._columns))
        self._columns.append((on_line, 0.0))

    def fields(self, columns: Sequence[Column]) -> list[Array]:
        """Nodal values (n,) of some columns."""
        on_line, loads = zip(*(self._columns[column.number] for column in columns), strict=True)
        extended = self._body.factor(self._key[0]).extended(np.column_stack(on_line))
        return [values + load for values, load in zip(extended.T, loads, strict=True)]


@dataclass(frozen=True)
class Temperature:
    """θ of one scene, Σ factor × field [K], and the defect of α∫(θ−θ̄) = ∫q relative to the heat
    that moves (NaN if unused)."""

    fields: Mapping[Field, float]
    heat_balance: float
    _of: Temperatures = field(repr=False)

    @cached_property
    def theta(self) -> Array:
        """Nodal values (n,) [K], computed when asked for."""
        parts = (factor * self._of.field(name) for name, factor in self.fields.items())
        return np.asarray(sum(parts, np.zeros(self._of.mesh.n_points)))

    @cached_property
    def mean(self) -> float:
        """Over the body [K]."""
        return float(sum(factor * self._of.mean(name) for name, factor in self.fields.items()))


class Temperatures:
    """θ of every scene of a study on one mesh, and the load β∫θ tr ε(v) that it makes, as basis
    terms.

    nodes: (r,) those on the closure of Γ_θ and of the edges `held` whose temperature is given,
    ascending
    """

    def __init__(
        self, forms: ElasticForms, scene: Scene, scenes: Sequence[Scene], memory: float
    ) -> None:
        """scene: any scene of the study;  scenes: all to come, if known;  memory: bytes of fields kept."""
        self.mesh, self._forms, self._wanted = forms.mesh, forms, _wanted(scenes)
        self.held = tuple(edge for edge, _ in scene.held_theta)
        self._convection = tuple(edge for edge, _, _ in scene.exchange)
        self.nodes = self.mesh.nodes_on(*self._convection, *self.held)
        self._memory = memory / max(1, len({k for k, _ in self._wanted}))
        self._conductions, self._factors = Recent[Conduction](), Recent[HeatFactor]()
        self._fields: Recent[Array] = Recent(memory, lambda field: field.nbytes)
        self._means = Recent[float]()
        self._last: tuple[Scene, Temperature] | None = None
        self._prepared: set[Conductivity] = set()

    def exchange(self, weights: Mapping[str, float]) -> Array:
        """Σ w ∫φ_iφ_j over edges by name, over Γ_θ if none are, on `nodes`, dense (r, r) [m]."""
        weight = np.zeros(len(self.mesh.segments))
        for name, own in (weights or dict.fromkeys(self._convection, 1.0)).items():
            weight[self.mesh.on(name)] = own
        on = np.flatnonzero(weight)
        ends = np.searchsorted(self.nodes, self.mesh.segments[on])
        return segment_mass(ends, weight[on] * self.mesh.boundary.length[on], len(self.nodes))

    def surroundings(self, theta_bar: Scalar, names: tuple[str, ...] = ()) -> Array:
        """∫ θ̄ φ_i over edges, over Γ_θ if none are named, on `nodes` (r,) [K m]."""
        return edge_load(self.mesh, theta_bar, names or self._convection)[self.nodes]

    def conduction(self, k: Conductivity, ratios: Ratios) -> Conduction:
        wanted = self._wanted.get((k, ratios), {})
        return self._conductions.of((k, ratios), lambda: Conduction(self, k, ratios, wanted))

    def factor(self, k: Conductivity) -> HeatFactor:
        """K factorised, until what it serves is computed."""
        return self._factors.of(k, lambda: HeatFactor(self._forms, self.nodes, k))

    def of(self, scene: Scene) -> Temperature:
        """θ of a scene; zero where the scene has no heat. Nothing is solved for what is constant or
        unused."""
        if self._last is not None and self._last[0] is scene:
            return self._last[1]
        parts, judged, given = list[Part](), False, scene.heat.theta
        if given is not None:
            parts = [Part({given: 1.0} if isinstance(given, Expression) else {None: float(given)})]
        elif scene.conducts:
            (uniform, shares), (alpha, ratios) = heat_shares(scene), exchange_level(scene)
            k = scene.material.k or 1.0
            own = (
                (self.conduction(relative_k(scene), ratios), datum, factor)
                for datum, factor in shares
            )
            parts = [
                Part({None: uniform}),
                *(c.part(datum, alpha, k, factor) for c, datum, factor in own),
            ]
            judged = bool(shares) and (
                scene.heat_by_edge or any(datum.heats for datum, _ in shares)
            )
        fields = dict[Field, float]()
        for name, factor in (pair for part in parts for pair in part.fields.items()):
            fields[name] = fields.get(name, 0.0) + factor
        # relative to all heat that moves, because sources and sinks may cancel, and little q pass
        # much heat by
        out, given_heat, through = np.sum([(0.0, 0.0, 0.0), *(part.heat for part in parts)], axis=0)
        balance = float(abs(out - given_heat) / through) if through else 0.0
        self._last = scene, Temperature(fields, balance if judged else float("nan"), self)
        return self._last[1]

    def terms(self, scene: Scene) -> list[tuple[Where, Field, float]]:
        """β∫θ tr ε(v) as a sum over regions and fields, with their factors."""
        if not scene.material.expands:
            return []
        self._prepare(relative_k(scene))
        fields = [(name, factor) for name, factor in self.of(scene).fields.items() if factor != 0.0]
        materials = ((where, own.beta) for where, own in scene.pieces if own.beta != 0.0)
        return [
            (where, name, beta * factor) for where, beta in materials for name, factor in fields
        ]

    def _prepare(self, k: Conductivity) -> None:
        """Compute what all scenes to come need, if it fits into the memory, and let go of the
        factor."""
        sets = [ratios for own, ratios in self._wanted if own == k]
        if k in self._prepared or not sets:
            return
        self._prepared.add(k)
        columns = [column for ratios in sets for column in self.conduction(k, ratios).listed]
        if len(columns) * 8 * self.mesh.n_points <= self._memory:
            for column in columns:
                self.field(column)
            self._factors.pop(k, None)

    def field(self, name: Field) -> Array:
        """Nodal values (n,) of a field."""
        if name is None:
            return np.ones(self.mesh.n_points)
        if not isinstance(name, Column):
            return self._fields.of(name, lambda: values_at(name, self.mesh.points))
        if name in self._fields:
            return self._fields[name]
        columns, found = name.together, dict[Field, Array]()
        for column, values in zip(
            columns, self.conduction(name.k, name.ratios).fields(columns), strict=True
        ):
            found[column] = self._fields[column] = values
        return found[name]

    def mean(self, name: Field) -> float:
        """Mean of a field over the body."""
        return self._means.of(name, lambda: 1.0 if name is None else self.mean_of(self.field(name)))

    def mean_of(self, theta: Array) -> float:
        """Mean over the body of a temperature at the nodes (n,)."""
        area = self.mesh.area
        return float(area @ theta[self.mesh.triangles].mean(axis=1)) / float(area.sum())

    def response(self, scene: Scene, source: Array) -> Array:
        """(n,) θ [K] that heat put in at the nodes (n,) [W/m] makes, surroundings and held edges
        being at 0."""
        alpha, ratios = exchange_level(scene)
        k = scene.material.k or 1.0
        return self.conduction(relative_k(scene), ratios).response(source / k, alpha / k)

    def exchanged(self, scene: Scene, edges: tuple[str, ...]) -> Array:
        """(n,) −∫(θ − θ̄)φ_i over edges: what one more of their α puts in [K m]."""
        theta, found = self.of(scene).theta, np.zeros(self.mesh.n_points)
        for edge, _, bar in scene.exchange:
            if edge in edges:
                found[self.nodes] += (
                    self.surroundings(bar, (edge,)) - self.exchange({edge: 1.0}) @ theta[self.nodes]
                )
        return found


def _wanted(
    scenes: Sequence[Scene],
) -> dict[tuple[Conductivity, Ratios], dict[Datum, dict[float, None]]]:
    """Values of α/k by datum of the scenes to come, by conductivities and ratios."""
    found: dict[tuple[Conductivity, Ratios], dict[Datum, dict[float, None]]] = {}
    for scene in distinct(scenes, *FELT):
        k = scene.material.k
        if scene.material.expands and scene.conducts and scene.heat.theta is None and k:
            alpha, ratios = exchange_level(scene)
            for key, _ in heat_shares(scene)[1]:
                found.setdefault((relative_k(scene), ratios), {}).setdefault(key, {})[alpha / k] = (
                    None
                )
    return found
