"""The heat problem of one mesh for every α, θ̄, q, flux and prescribed temperature of a sweep.

It is exact (method §4). With S_K the Neumann heat matrix for k = 1 condensed onto Γ_θ, M its mass
matrix and S_K w_k = μ_k M w_k,

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
    """A datum of the heat problem.

    kind:  "source": density of shape `data` in regions;  "flux": the same into edges
           "surroundings": ambient temperature `data` of edges, or of all of Γ_θ
           "held": temperature `data` of an edge
    where: names of the regions or edges
    """

    kind: Literal["source", "flux", "surroundings", "held"]
    data: Scalar
    where: tuple[str, ...] = ()

    @property
    def heats(self) -> bool:
        return self.kind in ("source", "flux")


BATCH = 16
"""Columns that go through a factor together; more would take memory and save no time."""


@dataclass(frozen=True)
class Column:
    """The name of a field of the heat problem with these relative k and ratios.

    listed: number of columns that were planned at the start
    """

    k: Conductivity
    ratios: Ratios
    number: int
    listed: int

    @property
    def together(self) -> tuple[Column, ...]:
        """Return the columns that are computed with this one."""
        if self.number >= self.listed:
            return (self,)
        first = self.number - self.number % BATCH
        stop = min(first + BATCH, self.listed)
        return tuple(replace(self, number=number) for number in range(first, stop))


Field = Expression | Column | None
"""A temperature field on the body: given, a column of a heat problem, or θ = 1."""


def split(scalar: Scalar) -> tuple[Scalar, float]:
    """Return a scalar as (shape, factor); a number is a factor of the shape 1."""
    if isinstance(scalar, Expression):
        return scalar, 1.0
    return 1.0, float(scalar)


def to_digits(ratio: float) -> float:
    """Return a ratio to 15 digits, which it keeps when both numbers are scaled and rounded."""
    return float(f"{ratio:.14e}")


def exchange_level(scene: Scene) -> tuple[float, Ratios]:
    """Return the largest α of the edges, and the ratios of all to it, to 15 digits.

    The ratios are empty where all edges have one α.
    """
    if not scene.heat_by_edge:
        return scene.heat.alpha, ()
    largest = max((alpha for _, alpha, _ in scene.exchange), default=0.0)
    if largest == 0.0:
        return largest, ()
    ratios = tuple((edge, to_digits(alpha / largest)) for edge, alpha, _ in scene.exchange)
    if all(ratio == 1.0 for _, ratio in ratios):
        return largest, ()
    return largest, ratios


def heat_shares(scene: Scene) -> tuple[float, list[tuple[Datum, float]]]:
    """Return a uniform part of θ [K] and the data, with factors, that change it.

    A temperature that is the same on all edges is the uniform part, for which nothing is solved.
    """
    heat = scene.heat
    edge_data: list[tuple[Datum, Scalar]] = [(Datum("surroundings", 1.0), heat.theta_bar)]
    if scene.heat_by_edge:
        edge_data = [(Datum("surroundings", 1.0, (edge,)), bar) for edge, _, bar in scene.exchange]
        edge_data += [(Datum("held", 1.0, (edge,)), theta) for edge, theta in scene.held_theta]
    numbers = [value for _, value in edge_data if not isinstance(value, Expression)]
    uniform = float(numbers[0]) if len(numbers) == len(edge_data) else 0.0
    heat_data: list[tuple[Datum, Scalar]] = [(Datum("source", 1.0, heat.omega), heat.q)]
    heat_data += [(Datum("flux", 1.0, (edge,)), flux) for edge, flux in scene.flux]
    shares = []
    for datum, value in edge_data + heat_data:
        shape, factor = split(value)
        if not datum.heats and shape == 1.0:
            factor -= uniform
        if factor != 0.0:
            shares.append((replace(datum, data=shape), factor))
    return uniform, shares


def relative_k(scene: Scene) -> Conductivity:
    """Return k over that of the body's material, to 15 digits; () where it is uniform."""
    k = scene.material.k
    if not k or not scene.material.regions:
        return ()
    return tuple((where, to_digits((material.k or 0.0) / k)) for where, material in scene.pieces)


T = TypeVar("T")


class Recent(dict[Hashable, T]):
    """A cache of values by key; it is cleared when its size would exceed `budget` bytes.

    A value that was dropped is made again when it is needed.
    """

    def __init__(self, budget: float = np.inf, size: Callable[[T], int] = lambda _: 1) -> None:
        super().__init__()
        self._budget = budget
        self._size = size
        self._total = 0

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
"""Error of the harmonic extension of 1 from which fields are refined.

Meshes of 1e6 good triangles have less.
"""
MAX_REFINEMENTS = 5
"""Steps of iterative refinement; each gains as many digits as the factor has right."""


class HeatFactor:
    """K for k = 1, factorised with the nodes of Γ_θ kept.

    Solutions keep their digits on slivers.
    """

    def __init__(self, forms: ElasticForms, line_nodes: NDArray[np.intp], k: Conductivity) -> None:
        self._mesh = forms.mesh
        self._line_nodes = line_nodes
        self._k = k
        inner = np.ones(forms.mesh.n_points, dtype=bool)
        inner[line_nodes] = False
        self._factor: Condensation = condense(
            forms.conduction(k), forms.mesh.points, line_nodes, inner, components=1
        )

    @property
    def A_tilde(self) -> Array:
        return self._factor.A_tilde

    @cached_property
    def sound(self) -> bool:
        """Return whether the harmonic extension of θ = 1 is 1 but for UNSOUND."""
        ones = self._factor.expand(np.ones(len(self._line_nodes)))
        return float(np.max(np.abs(ones - 1.0))) <= UNSOUND

    def load(self, source: Array) -> tuple[Array, Array]:
        """Return a source (n,) condensed onto Γ_θ (r,) [W/m], and its field (n,), 0 on Γ_θ.

        The condensed source has the same total heat.
        """
        rows = self._factor.forward(source)
        theta = self._factor.expand(np.zeros(len(self._line_nodes)), rows)
        if not self.sound:
            correction = self._correction(theta, source)
            rows = self._factor.forward(self._residual(source, theta, correction))
            theta = theta + correction
        return self._factor.condensed(rows), theta

    def extended(self, on_line: Array) -> Array:
        """Return fields (n, s) without a source that have the values on_line (r, s) on Γ_θ."""
        fields = self._factor.expand(on_line)
        if self.sound:
            return fields
        return np.column_stack([theta + self._correction(theta, 0.0) for theta in fields.T])

    def _residual(self, source: Array | float, *fields: Array) -> Array:
        """Return source − K Σ fields, all (n,); it has the total of the source but for rounding."""
        triangles = self._mesh.triangles
        corners = self._mesh.corners
        residual = source + np.zeros(self._mesh.n_points)
        e = corners[:, 1] - corners[:, 0]
        f = corners[:, 2] - corners[:, 0]
        differences = [field[triangles[:, 1:]] - field[triangles[:, :1]] for field in fields]
        jumps: Array = np.sum(differences, axis=0)
        # ∇θ d, turned: large numbers cancel here, once, and all three corners get the same heat
        turned = (jumps[:, :1] * f - jumps[:, 1:] * e) / (4.0 * self._mesh.area)[:, None]
        for where, k in self._k:
            turned[self._mesh.inside(where)] *= k
        for corner, side in enumerate((e - f, f, -e)):
            flow = np.einsum("td,td->t", side, turned)
            np.subtract.at(residual, triangles[:, corner], flow)
        return residual

    def _correction(self, theta: Array, source: Array | float) -> Array:
        """Return the error of θ (n,), zero on Γ_θ.

        It is kept apart from θ, because θ + δ, rounded, would have flows of its own.
        """
        correction = np.zeros(len(theta))
        last_size = np.inf
        for _ in range(MAX_REFINEMENTS):
            residual = self._factor.forward(self._residual(source, theta, correction))
            step = self._factor.expand(np.zeros(len(self._line_nodes)), residual)
            size = float(np.max(np.abs(step), initial=0.0))
            if not size < 0.5 * last_size:
                break
            correction += step
            last_size = size
        return correction


def modes(A_tilde: Array, M: Array, held: bool = False) -> tuple[Array, Array]:
    """Return the eigenpairs (μ, W) of Ã w_k = μ_k M w_k with WᵀMW = I.

    held: whether other nodes of the line are held; if not, μ₀ is made exactly 0 and w₀ constant
    """
    if not len(M):
        return np.zeros(0), np.zeros((0, 0))
    mu, W = scipy.linalg.eigh(A_tilde, M)
    if not held:
        constant = np.full(len(M), 1.0 / np.sqrt(M.sum()))
        W[:, 1:] -= np.outer(constant, constant @ M @ W[:, 1:])
        W[:, 0] = constant
        mu[0] = 0.0
    return np.maximum(mu, 0.0), W


ROUNDING = 1e-14
"""Largest part of a variation that columns do not span, relative to it in the norm of L²(Γ_θ)."""


class Part(NamedTuple):
    """One linear contribution to the temperature.

    fields: factors by field [K]
    heat: α∫_{Γ_θ}(θ − θ̄) of this part; ∫_ω q, or the integral of the flux; and a bound of the heat
          that flows either way [W/m]
    """

    fields: Mapping[Field, float]
    heat: tuple[float, float, float] = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class _Heated:
    """The right-hand side r₀ + a r₁ of a datum, and its column.

    right:   (2, r) r₀ and r₁: l̃ and 0 of a load, 0 and g̃ of surroundings, −S_K θ_D and −M θ_D of
             what is held
    moments: (2, f) of both in the w_k
    heat:    total heat input [W/m]
    moved:   Σ_i |∫ q φ_i| [W/m]
    columns: the number of the column of the load, or of θ_D; () of surroundings, which have none
    """

    right: Array
    moments: Array
    heat: float
    moved: float
    columns: tuple[int, ...]


class Conduction:
    """Parts of θ for given α, k and data, with one set of ratios between the α of the edges."""

    def __init__(
        self,
        body: Temperatures,
        k: Conductivity,
        ratios: Ratios,
        planned: Mapping[Datum, Mapping[float, None]],
    ) -> None:
        """Make the columns of the values of α/k to come by datum, as far as they are known."""
        self._body = body
        self._key = (k, ratios)
        self._ratios = dict(ratios)
        # (r,) nodes whose temperature is not given
        self._free = ~np.isin(body.nodes, body.mesh.nodes_on(*body.held))
        free = np.ix_(self._free, self._free)
        S = body.factor(k).A_tilde
        M = body.exchange(self._ratios)
        self._modes = S, M, *modes(S[free], M[free], not self._free.all())
        """S_K and M (r, r), M weighted by the ratios; μ (f,) and W, WᵀMW = I."""
        self._data: dict[Datum, _Heated] = {}
        # values on Γ_θ (r,), and the field of a load (n,)
        self._columns: list[tuple[Array, Array | float]] = []
        # (f, s) variations in the w_k, orthonormal, and the (s,) numbers of their columns
        self._basis: Array = np.zeros((len(self._modes[2]), 0))
        self._numbers: list[int] = []
        variations = [
            self._variation(self._heated(datum), a)
            for datum, values in planned.items()
            for a in sorted(values)
            if a > 0.0
        ]
        if variations and len(self._basis):
            self._add_spanning(variations)
        self._listed = len(self._columns)

    def _add_spanning(self, variations: list[Array]) -> None:
        """Add columns that span variations, the one represented worst first."""
        norms = np.linalg.norm(variations, axis=1)
        units = np.transpose(variations) / np.where(norms > 0.0, norms, 1.0)
        Q, R, _ = scipy.linalg.qr(units, mode="economic", pivoting=True)
        for variation in Q.T[np.abs(R.diagonal()) > ROUNDING]:
            self._add(variation)

    @property
    def listed(self) -> list[Column]:
        return [Column(*self._key, i, self._listed) for i in range(self._listed)]

    def part(self, datum: Datum, alpha: float, k: float, strength: float) -> Part:
        """Return the part of θ of one datum times `strength`, all other data being 0.

        alpha: of the edges with ratio 1; 0 gives the limit of surroundings, the mean of θ̄
        Where edges hold temperatures, the heat that leaves is counted on Γ_θ and at held nodes.
        """
        heated = self._heated(datum)
        a = alpha / k
        free = self._free
        S, M, mu, W = self._modes
        theta, heat = (1.0 / k, 1.0) if datum.heats else (1.0, k)
        is_solved = a > 0.0 or not free.all()
        variation = self._variation(heated, a) if is_solved else np.zeros(len(mu))
        shares = self._shares(heated, variation) if is_solved else []
        if free.all():
            m_0, m_1 = heated.moments
            constant = theta * float(m_0[0] / a if datum.heats else m_1[0]) * float(W[0, 0])
            # a(θ − θ̄) mode by mode: a large α does not multiply the rounding of a difference
            flows = np.append(m_0[0], a * (m_0 - mu * m_1)[1:] / (mu[1:] + a))
            # all modes but the first have no net flow, which the balance then shows
            heat_out = heat * float(M.sum(axis=0) @ W @ flows)
            bound = heat * float(np.linalg.norm(flows) / W[0, 0])  # ∫|·| ≤ |Γ_θ|^½ ‖·‖
            through = heated.moved if datum.heats else bound
        else:
            r_0, r_1 = heated.right
            constant = 0.0
            x = np.zeros(len(free))
            x[free] = W @ variation
            flows = heat * np.where(free, a * (M @ x - r_1), r_0 - S @ x)
            heat_out = float(flows.sum())
            through = float(np.abs(flows).sum())
        fields: dict[Field, float] = {}
        for column, share in shares:
            fields[column] = strength * (theta * share)
        fields[None] = strength * constant
        return Part(fields, (strength * heat_out, strength * heated.heat, abs(strength) * through))

    def response(self, source: Array, a: float) -> Array:
        """Return θ (n,) of a source at the nodes (n,) for k = 1.

        Surroundings and held edges are at 0.
        """
        factor = self._body.factor(self._key[0])
        free = self._free
        S, M, _, _ = self._modes
        l_tilde, theta = factor.load(source)
        on_line = np.zeros((len(free), 1))
        on_line[free, 0] = np.linalg.solve((S + a * M)[np.ix_(free, free)], l_tilde[free])
        return theta + factor.extended(on_line)[:, 0]

    def _heated(self, datum: Datum) -> _Heated:
        """Return the right-hand side of a datum, computed once, and add its column."""
        if datum in self._data:
            return self._data[datum]
        body = self._body
        zero = np.zeros(len(self._free))
        S, M, _, W = self._modes
        column: tuple[Array, Array | float] | None = None
        source = np.zeros(1)
        if datum.heats:
            assemble = source_load if datum.kind == "source" else edge_load
            source = assemble(body.mesh, datum.data, datum.where)
            l_tilde, field = body.factor(self._key[0]).load(source)
            right = (l_tilde, zero)
            column = (zero, field)
        elif datum.kind == "surroundings":
            ratio = self._ratios[datum.where[0]] if self._ratios else 1.0
            right = zero, ratio * body.surroundings(datum.data, datum.where)
        else:
            held = self._held_values(datum)
            right = (-(S @ held), -(M @ held))
            column = (held, 0.0)
        moments = np.array([W.T @ part[self._free] for part in right])
        columns: tuple[int, ...] = ()
        if column is not None:
            columns = (len(self._columns),)
            self._columns.append(column)
        heat = float(source.sum())
        moved = float(np.abs(source).sum())
        heated = _Heated(np.array(right), moments, heat, moved, columns)
        return self._data.setdefault(datum, heated)

    def _held_values(self, datum: Datum) -> Array:
        """Return θ_D (r,) of an edge; a corner of two such edges belongs to the first."""
        body = self._body
        earlier = body.held[: body.held.index(datum.where[0])]
        nodes = np.setdiff1d(body.mesh.nodes_on(*datum.where), body.mesh.nodes_on(*earlier))
        held = np.zeros(len(self._free))
        held[np.searchsorted(body.nodes, nodes)] = values_at(datum.data, body.mesh.points[nodes])
        return held

    def _variation(self, heated: _Heated, a: float) -> Array:
        """Return the variation (f,) on Γ_θ in the w_k, for k = 1, with no constant part.

        Modes lack digits where edges have α that differ by decades, or hold θ_D: a step of
        refinement follows.
        """
        free = self._free
        S, M, mu, W = self._modes
        r_0, r_1 = heated.right
        m_0, m_1 = heated.moments
        first = int(free.all())
        variation = np.zeros(len(mu))
        variation[first:] = (m_0 + a * m_1)[first:] / (mu[first:] + a)
        if self._ratios or not first:
            x = np.zeros(len(free))
            x[free] = W @ variation
            residual = r_0 + a * r_1 - S @ x - a * (M @ x)
            step = W.T @ residual[free] / (mu + a)
            variation[first:] += step[first:]
        return variation

    def _shares(self, heated: _Heated, variation: Array) -> list[tuple[Column, float]]:
        """Return a variation as a combination of columns; add a column if they do not span it."""
        missed = variation - self._basis @ (self._basis.T @ variation)
        if np.linalg.norm(missed) > 2.0 * ROUNDING * np.linalg.norm(variation):
            missed -= self._basis @ (self._basis.T @ missed)
            self._add(missed / np.linalg.norm(missed))
        factors = [(number, 1.0) for number in heated.columns]
        factors += zip(self._numbers, self._basis.T @ variation, strict=True)
        return [
            (Column(*self._key, number, self._listed), float(factor)) for number, factor in factors
        ]

    def _add(self, variation: Array) -> None:
        """Add the column of a unit variation (f,) that is orthogonal to all."""
        on_line = np.zeros(len(self._free))
        on_line[self._free] = self._modes[3] @ variation
        self._basis = np.column_stack([self._basis, variation])
        self._numbers.append(len(self._columns))
        self._columns.append((on_line, 0.0))

    def fields(self, columns: Sequence[Column]) -> list[Array]:
        """Return the nodal values (n,) of columns."""
        on_line, loads = zip(*(self._columns[column.number] for column in columns), strict=True)
        extended = self._body.factor(self._key[0]).extended(np.column_stack(on_line))
        return [values + load for values, load in zip(extended.T, loads, strict=True)]


@dataclass(frozen=True)
class Temperature:
    """θ of one scene, Σ factor × field [K].

    heat_balance: defect of α∫(θ−θ̄) = ∫q relative to the heat that flows; NaN if unused
    """

    fields: Mapping[Field, float]
    heat_balance: float
    _of: Temperatures = field(repr=False)

    @cached_property
    def theta(self) -> Array:
        """Return the nodal values (n,) [K]."""
        parts = (factor * self._of.field(name) for name, factor in self.fields.items())
        return np.asarray(sum(parts, np.zeros(self._of.mesh.n_points)))

    @cached_property
    def mean(self) -> float:
        """Return the mean over the body [K]."""
        return float(sum(factor * self._of.mean(name) for name, factor in self.fields.items()))


class Temperatures:
    """θ of every scene of a study on one mesh, and its load β∫θ tr ε(v) as basis terms.

    nodes: (r,) on the closure of Γ_θ and of the edges `held` whose temperature is given, ascending
    """

    def __init__(
        self, forms: ElasticForms, scene: Scene, scenes: Sequence[Scene], memory: float
    ) -> None:
        """Plan the temperatures of a study.

        scene:  any scene of the study
        scenes: all scenes to come, if known
        memory: bytes of fields that are kept
        """
        self.mesh = forms.mesh
        self._forms = forms
        self._planned = _planned(scenes)
        self.held = tuple(edge for edge, _ in scene.held_theta)
        self._convection = tuple(edge for edge, _, _ in scene.exchange)
        self.nodes = self.mesh.nodes_on(*self._convection, *self.held)
        self._memory = memory / max(1, len({k for k, _ in self._planned}))
        self._conductions = Recent[Conduction]()
        self._factors = Recent[HeatFactor]()
        self._fields: Recent[Array] = Recent(memory, lambda field: field.nbytes)
        self._means = Recent[float]()
        self._last: tuple[Scene, Temperature] | None = None
        self._prepared: set[Conductivity] = set()

    def exchange(self, weights: Mapping[str, float]) -> Array:
        """Return Σ w ∫φ_iφ_j over edges by name, dense on `nodes` (r, r) [m].

        Without weights it is over all of Γ_θ.
        """
        segment_weights = np.zeros(len(self.mesh.segments))
        edge_weights = weights or dict.fromkeys(self._convection, 1.0)
        for name, weight in edge_weights.items():
            segment_weights[self.mesh.on(name)] = weight
        weighted = np.flatnonzero(segment_weights)
        ends = np.searchsorted(self.nodes, self.mesh.segments[weighted])
        lengths = segment_weights[weighted] * self.mesh.boundary.length[weighted]
        return segment_mass(ends, lengths, len(self.nodes))

    def surroundings(self, theta_bar: Scalar, names: tuple[str, ...] = ()) -> Array:
        """Return ∫ θ̄ φ_i over edges, by default over Γ_θ, on `nodes` (r,) [K m]."""
        return edge_load(self.mesh, theta_bar, names or self._convection)[self.nodes]

    def conduction(self, k: Conductivity, ratios: Ratios) -> Conduction:
        planned = self._planned.get((k, ratios), {})
        return self._conductions.of((k, ratios), lambda: Conduction(self, k, ratios, planned))

    def factor(self, k: Conductivity) -> HeatFactor:
        """Return K factorised; it is dropped once its columns are computed."""
        return self._factors.of(k, lambda: HeatFactor(self._forms, self.nodes, k))

    def of(self, scene: Scene) -> Temperature:
        """Return θ of a scene, zero for a scene without heat; uniform parts need no solution."""
        if self._last is not None and self._last[0] is scene:
            return self._last[1]
        parts = list[Part]()
        is_balanced = False
        prescribed = scene.heat.theta
        if isinstance(prescribed, Expression):
            parts = [Part({prescribed: 1.0})]
        elif prescribed is not None:
            parts = [Part({None: float(prescribed)})]
        elif scene.conducts:
            uniform, shares = heat_shares(scene)
            alpha, ratios = exchange_level(scene)
            k = scene.material.k or 1.0
            parts = [Part({None: uniform})]
            for datum, factor in shares:
                conduction = self.conduction(relative_k(scene), ratios)
                parts.append(conduction.part(datum, alpha, k, factor))
            has_heat = scene.heat_by_edge or any(datum.heats for datum, _ in shares)
            is_balanced = bool(shares) and has_heat
        fields = dict[Field, float]()
        for part in parts:
            for name, factor in part.fields.items():
                fields[name] = fields.get(name, 0.0) + factor
        # relative to all heat that flows: sources and sinks may cancel, and a small q may pass a
        # large flow
        heats = [(0.0, 0.0, 0.0), *(part.heat for part in parts)]
        heat_out, heat_in, through = np.sum(heats, axis=0)
        balance = float("nan")
        if is_balanced:
            balance = float(abs(heat_out - heat_in) / through) if through else 0.0
        temperature = Temperature(fields, balance, self)
        self._last = scene, temperature
        return temperature

    def terms(self, scene: Scene) -> list[tuple[Where, Field, float]]:
        """Return β∫θ tr ε(v) as regions and fields with their factors."""
        if not scene.material.expands:
            return []
        self._prepare(relative_k(scene))
        fields = [(name, factor) for name, factor in self.of(scene).fields.items() if factor != 0.0]
        terms = []
        for where, material in scene.pieces:
            if material.beta != 0.0:
                terms += [(where, name, material.beta * factor) for name, factor in fields]
        return terms

    def _prepare(self, k: Conductivity) -> None:
        """Compute the columns of all scenes to come, if they fit into the memory.

        The factor is dropped then.
        """
        all_ratios = [ratios for conductivity, ratios in self._planned if conductivity == k]
        if k in self._prepared or not all_ratios:
            return
        self._prepared.add(k)
        columns = [column for ratios in all_ratios for column in self.conduction(k, ratios).listed]
        if len(columns) * 8 * self.mesh.n_points <= self._memory:
            for column in columns:
                self.field(column)
            self._factors.pop(k, None)

    def field(self, name: Field) -> Array:
        """Return the nodal values (n,) of a field."""
        if name is None:
            return np.ones(self.mesh.n_points)
        if not isinstance(name, Column):
            return self._fields.of(name, lambda: values_at(name, self.mesh.points))
        if name in self._fields:
            return self._fields[name]
        columns = name.together
        values_of = dict[Field, Array]()
        fields = self.conduction(name.k, name.ratios).fields(columns)
        for column, values in zip(columns, fields, strict=True):
            values_of[column] = self._fields[column] = values
        return values_of[name]

    def mean(self, name: Field) -> float:
        """Return the mean of a field over the body."""
        if name is None:
            return 1.0
        return self._means.of(name, lambda: self.mean_of(self.field(name)))

    def mean_of(self, theta: Array) -> float:
        """Return the mean over the body of a temperature at the nodes (n,)."""
        area = self.mesh.area
        return float(area @ theta[self.mesh.triangles].mean(axis=1)) / float(area.sum())

    def response(self, scene: Scene, source: Array) -> Array:
        """Return θ (n,) [K] of heat input at the nodes (n,) [W/m].

        Surroundings and held edges are at 0.
        """
        alpha, ratios = exchange_level(scene)
        k = scene.material.k or 1.0
        return self.conduction(relative_k(scene), ratios).response(source / k, alpha / k)

    def exchanged(self, scene: Scene, edges: tuple[str, ...]) -> Array:
        """Return −∫(θ − θ̄)φ_i (n,) over edges, the heat input per unit of their α [K m]."""
        theta = self.of(scene).theta
        heat = np.zeros(self.mesh.n_points)
        for edge, _, theta_bar in scene.exchange:
            if edge in edges:
                ambient = self.surroundings(theta_bar, (edge,))
                heat[self.nodes] += ambient - self.exchange({edge: 1.0}) @ theta[self.nodes]
        return heat


Planned = dict[tuple[Conductivity, Ratios], dict[Datum, dict[float, None]]]
"""Values of α/k by datum, for each set of conductivities and ratios."""


def _planned(scenes: Sequence[Scene]) -> Planned:
    """Return the values of α/k of the scenes to come."""
    planned: Planned = {}
    for scene in distinct(scenes, *FELT):
        k = scene.material.k
        if scene.material.expands and scene.conducts and scene.heat.theta is None and k:
            alpha, ratios = exchange_level(scene)
            _, shares = heat_shares(scene)
            for datum, _ in shares:
                data = planned.setdefault((relative_k(scene), ratios), {})
                data.setdefault(datum, {})[alpha / k] = None
    return planned
