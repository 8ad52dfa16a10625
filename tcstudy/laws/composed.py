"""Laws made of other laws, and their derivatives.

Laws by node and by row, at joints of edges, and with straight pieces in place of exponential ones.

At a joint node i has the friction c' b'(s) + c'' b''(s), c' and c'' the parts of c_i on the two
edges, so that its law is b = (c' b' + c'' b'')/c_i. This is the trapezoidal rule on either side of
the step in ∫_{Γ_C} j(x, u_T), of second order. With all of c_i given to one of the laws it is of
first order.

Derivatives by a law's parameters are complex steps through the builders and the laws' own
functions: f′(p) = Im f(p + ih)/h to the last digits, since nothing is subtracted (Squire & Trapp,
SIAM Rev. 40 (1998) 110–112). h is so small that h² is lost beside every number. Comparisons use
the real part.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tcstudy.expressions.expression import Expression, value_of
from tcstudy.laws.laws import NONE, Laws, Made
from tcstudy.laws.pieces import Array
from tcstudy.laws.shapes import SHAPES, one_sided


def nodal(
    laws: Sequence[Laws],
    index: ArrayLike,
    strength: ArrayLike = 1.0,
    stretch: ArrayLike = 1.0,
    shift: ArrayLike = 0.0,
) -> Laws:
    """Return the laws b_i(s) = β_i b((s − a_i)/σ_i) of nodes.

    It is one law for all where all nodes have the same. The strength factor of a one-sided law is
    of s ≥ 0 alone, so that an unbonded node stays closed.

    laws:     the shared laws b, each one for all
    index:    (m,) which of them a node has
    strength: strength factor β_i ≥ 0, 0 for an unbonded node
    stretch:  σ_i > 0;  shift: a_i [m];  all (m,) or one number

    Raises ValueError for a strength below 0, a stretch that is not above 0, or numbers that are not
    finite.
    """
    law_of_node = np.asarray(index, dtype=np.intp)
    is_one_sided = np.array([law.closing is not None for law in laws])
    m = law_of_node.shape
    beta = np.broadcast_to(np.asarray(strength, dtype=float), m)
    sigma = np.broadcast_to(np.asarray(stretch, dtype=float), m)
    a = np.broadcast_to(np.asarray(shift, dtype=float), m)
    if not (np.all(np.isfinite([beta, sigma, a])) and np.all(beta >= 0.0) and np.all(sigma > 0.0)):
        raise ValueError(
            "a node's law needs finite numbers, a strength of at least 0 and a stretch above 0"
        )
    # nodes with the same law, strength, stretch and shift share a table row; all gaps share one
    first_equal_law: dict[Laws, int] = {}
    first_equal = [first_equal_law.setdefault(law, k) for k, law in enumerate(laws)]
    vanishes = np.array([law.vanishes for law in laws])
    key = np.stack([np.array(first_equal, dtype=np.intp)[law_of_node], beta, sigma, a], axis=1)
    is_gap = (beta == 0.0) & ~is_one_sided[law_of_node]
    key[is_gap | vanishes[law_of_node]] = (-1.0, 1.0, 1.0, 1.0)
    distinct_keys, row_of_node = np.unique(key, axis=0, return_inverse=True)

    distinct_laws = []
    for k, beta_k, sigma_k, a_k in distinct_keys.tolist():
        if k < 0:
            distinct_laws.append(NONE)
        elif laws[int(k)].closing is None:
            distinct_laws.append(laws[int(k)].placed(beta_k, sigma_k, a_k))
        else:
            strengthened = laws[int(k)].strengthened(beta_k)
            distinct_laws.append(strengthened.placed(1.0, sigma_k, a_k))
    if len(distinct_laws) == 1:
        return distinct_laws[0]
    return Laws.of(distinct_laws, row_of_node.reshape(-1))


def total(first: Laws, second: Laws) -> Laws:
    """Return the law b' + b'' of two that have at most one exponential per piece.

    It has the kinks of both, and one where b″ of two exponentials changes its sign. The sum of odd
    laws is odd to the bit. That of a ray and a law is a ray.
    """
    laws = (first, second)
    inner_ends = np.union1d(first.kinks, second.kinks)
    ends = np.concatenate([[-np.inf], inner_ends, [np.inf]]).tolist()
    left_ends: list[float] = []
    pieces: list[tuple[float, ...]] = []
    for lower, upper in pairwise(ends):
        piece = _sum_of_pieces(laws, lower, upper)
        inflection = _inflection(piece)
        left_ends.append(lower)
        pieces.append(piece)
        if lower < inflection < upper:
            left_ends.append(inflection)
            pieces.append(piece)
    name = " and ".join(dict.fromkeys(law.name for law in laws if not law.vanishes))
    columns = [np.array(column) for column in zip(*pieces, strict=True)]
    if not np.any(columns[5]):
        columns = columns[:5]
    # the pieces to the left of a ray are one
    n_merged = max(0, int(np.count_nonzero(np.isneginf(columns[1]))) - 1)
    columns = [column[n_merged:] for column in columns]
    kinks = np.array(left_ends[1 + n_merged :])
    return Laws(name, kinks, *columns, closing=_sum_of_closings(laws))


def _sum_of_closings(laws: Sequence[Laws]) -> float | None:
    """Return the closing of the sum of laws, None if it can be negative without a ray."""
    closings = [law.closing for law in laws if law.closing is not None]
    if math.inf in closings or len(closings) == len(laws):
        return sum(closings)
    return None


def _sum_of_pieces(laws: Sequence[Laws], lower: float, upper: float) -> tuple[float, ...]:
    """Return s_0, b_0, q, a, r, a_2, r_2 of the sum of laws between two neighbouring kinks."""
    s_0 = min(max(0.0, lower), upper)
    side = 1
    end = lower
    if not np.isfinite(lower):
        side = -1
        end = upper if np.isfinite(upper) else 0.0
    b_0 = 0.0
    q = 0.0
    amplitudes: dict[float, float] = {}  # by rate
    for law in laws:
        k = int(law.piece(end, side))
        distance = s_0 - law.s_0[k]
        b_0 += float(law.b_0[k] + law.q[k] * distance)
        q += float(law.q[k])
        if law.a[k]:
            r = float(law.r[k])
            a = float(law.a[k] * np.exp(-law.r[k] * distance))
            amplitudes[r] = amplitudes.get(r, 0.0) + a
    decays = sorted(amplitudes.items(), key=lambda decay: abs(decay[0]))
    decays += [(0.0, 0.0)] * (2 - len(decays))
    (r, a), (r_2, a_2) = decays
    return (s_0, b_0, q, a, r, a_2, r_2)


def _inflection(piece: tuple[float, ...]) -> float:
    """Return the slip where b″ of a piece with two exponentials is 0, NaN if there is none."""
    s_0, _, _, a, r, a_2, r_2 = piece
    if not (a and a_2):
        return math.nan
    ratio = -(a_2 * r_2**2) / (a * r**2)
    if not ratio > 0.0:
        return math.nan
    return s_0 + float(np.log(ratio)) / (r_2 - r)


def row_laws(laws: Sequence[Laws], factor: Array) -> Laws:
    """Return the laws of the rows of a block, by node where one of them has a law per node.

    factor: (R,) stiffness of every row relative to that of the body, by which its law is divided
    """
    # by identity: a sweep shares its laws, and equal ones only cost time
    key_number: dict[tuple[int, float], int] = {}
    keys = [(id(law), f) for law, f in zip(laws, factor.tolist(), strict=True)]
    scaled_of_row = [key_number.setdefault(key, len(key_number)) for key in keys]
    scaled_laws = []
    for row in np.unique(scaled_of_row, return_index=True)[1]:
        f = float(factor[row])
        scaled_laws.append(laws[row] if f == 1.0 else laws[row].placed(1.0 / f))
    m = max((len(law.index) for law in scaled_laws if not law.one), default=1)
    tables: list[Laws] = []
    index = np.empty((len(scaled_laws), m), dtype=np.intp)
    for scaled_index, law in zip(index, scaled_laws, strict=True):
        scaled_index[:] = len(tables) + law.index
        tables += law.laws
    return Laws.of(tables, index[np.array(scaled_of_row, dtype=np.intp)])


class Joints(NamedTuple):
    """The nodes shared by two edges of Γ_C: where one edge ends and the next begins.

    node:  (j,) number of the node; its edge is the one after it (along t)
    edge:  (j,) number of the edge before it
    share: (j,) part of c_i on that edge
    """

    node: NDArray[np.intp] = np.zeros(0, dtype=np.intp)
    edge: NDArray[np.integer] = np.zeros(0, dtype=np.intp)
    share: Array = np.zeros(0)


NO_JOINTS = Joints()


@dataclass(frozen=True)
class EdgeLaws:
    """Friction that differs along Γ_C: every edge's law times its strength factor in x and y.

    The strength factor is 0 where the edge is unbonded.

    laws: (edge, law, strength); the edge "" is all of Γ_C
    """

    laws: tuple[tuple[str, Laws, float | Expression], ...]

    def number_of(self, edge: str) -> int:
        """Return which of the laws an edge has."""
        edges_with_law = [name for name, _, _ in self.laws]
        return edges_with_law.index(edge) if edge in edges_with_law else 0

    def along(
        self, names: Sequence[str], edge: NDArray[np.integer], xy: Array
    ) -> tuple[NDArray[np.intp], Array]:
        """Return (m,) which of the laws a point has, and (m,) its strength there.

        names: of the edges by number;  edge: (m,) number of a point's edge;  xy: (m, 2) points

        Raises ValueError for a strength below 0 or one that is not finite.
        """
        law_of_edge = [self.number_of(name) for name in names]
        index = np.array(law_of_edge, dtype=np.intp)[edge]
        strength = np.empty(len(index))
        for k, (_, _, factor) in enumerate(self.laws):
            x, y = xy[index == k].T
            strength[index == k] = value_of(factor, x, y)
        is_invalid = ~((strength >= 0.0) & np.isfinite(strength))
        if np.any(is_invalid):
            k = int(np.argmax(is_invalid))
            x, y = xy[k]
            raise ValueError(
                f"the strength of friction is {strength[k]:g} at ({x:g}, {y:g}); "
                "it must be 0 or more"
            )
        return index, strength

    def factors(
        self, names: Sequence[str], edge: NDArray[np.integer], xy: Array, joints: Joints
    ) -> Array:
        """Return (L, m) the factor of every law in that of a node.

        It is the strength, at a joint times the law's part of c_i, and NaN where a node has nothing
        of a law. Arguments and Raises as `along`.
        """
        index, strength = self.along(names, edge, xy)
        factors = np.full((len(self.laws), len(index)), np.nan)
        factors[index, np.arange(len(index))] = strength
        index_before, strength_before = self.along(names, joints.edge, xy[joints.node])
        for joint, node in enumerate(joints.node):
            share = joints.share[joint]
            k_before = index_before[joint]
            k_after = index[node]
            beta_before = strength_before[joint]
            beta_after = strength[node]
            if k_before == k_after:
                factors[k_before, node] = beta_after + share * (beta_before - beta_after)
            else:
                factors[k_after, node] = (1.0 - share) * beta_after
                factors[k_before, node] = share * beta_before
        return factors

    @property
    def vanishes(self) -> bool:
        """True if b ≡ 0 everywhere."""
        return all(law.vanishes for _, law, _ in self.laws)


def bonded_edges(friction: Laws | EdgeLaws) -> frozenset[str]:
    """Return the edges on which friction is not 0 everywhere; "" stands for all of Γ_C."""
    by_edge = friction.laws if isinstance(friction, EdgeLaws) else (("", friction, 1.0),)
    return frozenset(
        edge for edge, law, strength in by_edge if strength != 0.0 and not law.vanishes
    )


def law_along(
    friction: Laws | EdgeLaws,
    names: Sequence[str],
    edge: NDArray[np.integer],
    xy: Array,
    joints: Joints = NO_JOINTS,
) -> Laws:
    """Return the law of the contact line, or of points on it.

    names: of the edges by number;  edge: (m,) number of a point's edge;  xy: (m, 2) points

    Raises ValueError for a strength below 0.
    """
    if isinstance(friction, Laws):
        return friction
    laws, index, strength = laws_along(friction, names, edge, xy, joints)
    return nodal([law for _, law in laws], index, strength)


def laws_along(
    friction: EdgeLaws, names: Sequence[str], edge: NDArray[np.integer], xy: Array, joints: Joints
) -> tuple[list[tuple[str, Laws]], NDArray[np.intp], Array]:
    """Return (edge, law) of the edges and joints, (m,) which of them a node has, and its strength.

    A joint has (c' b' + c'' b'')/c_i of the edges that meet there, and the names of both.
    Raises ValueError for a strength below 0.
    """
    factors = friction.factors(names, edge, xy, joints)
    has_law = ~np.isnan(factors)
    laws = [(name, law) for name, law, _ in friction.laws]
    index = np.argmax(has_law, axis=0)
    strength = factors[index, np.arange(len(index))]
    for node in np.flatnonzero(has_law.sum(axis=0) > 1).tolist():
        first, second = np.flatnonzero(has_law[:, node])
        share = float(joints.share[joints.node == node][0])
        if friction.number_of(names[edge[node]]) == first:
            share = 1.0 - share
        first_law = _part(laws[first][1], float(factors[first, node]), share)
        second_law = _part(laws[second][1], float(factors[second, node]), 1.0 - share)
        index[node] = len(laws)
        strength[node] = 1.0
        name = f"{laws[first][0]} and {laws[second][0]}"
        laws.append((name, total(first_law, second_law)))
    return laws, index, strength


def _part(law: Laws, factor: float, share: float) -> Laws:
    """Return the part of a law at a joint, of one that closes share by share there, too.

    factor: strength times share, the part of c_i on the edge of the law
    """
    if law.closing is None:
        return law.times(factor)
    return law.times(factor / share).placed(share)


POINTS = "points"
CLOSING = "closing"
_AGREE = 1e-9
"""Slopes and derivatives that differ by less than this, relative, count as one."""
_STEP = 2.0**-400
"""The step h of a complex number p + ih."""


def stepped(number: float) -> Any:
    """Return p + ih."""
    return np.complex128(complex(number, _STEP))


def derivative(computed: Any) -> Any:
    """Return the derivative of what was computed from p + ih (its shape)."""
    return np.imag(computed) / _STEP


@dataclass(frozen=True, eq=False)
class LawSlopes:
    """Derivatives by one parameter p of a law, which is one for all.

    Where the law goes straight through a point that moves alone, the varied law has a bend that the
    law has not.

    varied: the law of p + ih
    """

    law: Laws
    varied: Laws

    @property
    def kinks(self) -> Array:
        """(K,) derivatives of the law's kinks [m per unit of p]."""
        position = np.searchsorted(self.varied.kinks.real, self.law.kinks)
        return derivative(self.varied.kinks[position])

    def value(self, s: Array, piece: NDArray[np.intp]) -> Array:
        """Return ∂b_k/∂p at s of the law's addressed pieces (shape of s) [Pa per unit of p]."""
        if len(self.varied.q) != len(self.law.q):
            lower, upper = self.law.ends(piece)
            s = np.clip(s, lower, upper)
            piece = self.varied.locate(s).toward(s < upper)
        return derivative(self.varied.value(s, piece))

    def potential(self, s: Array) -> Array:
        """Return ∂j/∂p at s (shape of s) [Pa m per unit of p].

        s is not a kink that moves, or the inner side of one. It is ∫₀ˢ ∂b/∂p, and κ′(b⁻ − b⁺) of
        every kink in between, which moves by κ′.
        """
        return derivative(self.varied.j(s))

    def omega(self) -> float:
        """Return ∂ω/∂p: that of the steepest softening slope at the end of a piece.

        It is NaN where two of them have different derivatives.
        """
        omega = self.law.omega
        if omega == 0.0:
            return 0.0
        if not np.isfinite(omega):
            return math.nan
        slopes = self.varied.end_slopes.ravel()
        steepest = slopes[slopes.real <= -omega * (1.0 - _AGREE)]
        return agreed(-derivative(steepest))


def agreed(changes: Array) -> float:
    """Return the one value that all have, to rounding; NaN where they differ."""
    size = float(np.max(np.abs(changes), initial=0.0))
    if len(changes) and np.ptp(changes) <= _AGREE * size:
        return float(changes[0])
    return math.nan


def number_of(path: tuple[str, ...]) -> str:
    """Return the name of a law's number from its key path.

    It is "delta", "points.2" for the b of the third point, or "points.2.s" for its slip.
    """
    for length in (2, 3):
        if path[-length:][0] == POINTS:
            return ".".join(path[-length:])
    return path[-1]


def point_of(law: Laws, parameter: str) -> int:
    """Return the number of the point that "points.2" or "points.2.s" means.

    Raises KeyError if the law has none of this number.
    """
    name, _, number = parameter.removesuffix(".s").partition(".")
    points = law.made.values.get(POINTS, ()) if law.made and name == POINTS else ()
    if not number.isascii() or not number.isdigit() or int(number) >= len(points):
        raise KeyError(parameter)
    return int(number)


def law_slopes(law: Laws, parameter: str) -> LawSlopes:
    """Return the derivatives of a law by one of its numbers.

    parameter: a parameter of its shape, a point as `number_of` names it, or "strength", a factor of
               b, or "closing", the finite one of a one-sided law

    Raises KeyError if it has no such parameter, or if its definition is not known.
    """
    made = law.made
    if made is None:
        raise KeyError(parameter)
    values = dict(made.values)
    strength: Any = made.strength
    if parameter == "strength":
        strength = stepped(made.strength)
    elif parameter == CLOSING and made.closing is not None and np.isfinite(made.closing):
        pass  # varied with the law itself
    elif parameter.startswith(f"{POINTS}."):
        number = point_of(law, parameter)
        points = [(s, np.complex128(b)) for s, b in values[POINTS]]
        s, b = points[number]
        if parameter.endswith(".s"):
            points[number] = (stepped(s), b)
        else:
            points[number] = (s, stepped(b.real))
        values[POINTS] = points
    else:
        if not isinstance(values[parameter], float):
            raise KeyError(parameter)
        values[parameter] = stepped(values[parameter])
    if made.closing is not None:
        return LawSlopes(law, _varied_one_sided(made, values, strength, parameter))
    varied = SHAPES[made.shape].builder(**values)
    b_0 = varied.b_0 * strength
    q = varied.q * strength
    a = varied.a * strength
    return LawSlopes(law, replace(varied, b_0=b_0, q=q, a=a))


def _varied_one_sided(
    definition: Made, values: dict[str, Any], strength: Any, parameter: str
) -> Laws:
    """Return the one-sided law of p + ih.

    parameter: p, which may be the closing itself where it is finite
    """
    closing: Any = definition.closing
    if parameter == CLOSING:
        closing = stepped(closing)
    virgin = SHAPES[definition.shape].builder(**values) if definition.shape else NONE
    return one_sided(virgin, closing).strengthened(strength)


# -- straight pieces in place of exponential ones

MAX_CELLS = 100_000
"""Sides that may replace one piece; more of them are a mistake in the tolerance."""


def piecewise_linear(law: Laws, tolerance: float, s_max: float) -> Laws:
    """Return the law with every exponential piece replaced by straight ones.

    |b − b_h| ≤ tolerance · b_scale on [−s_max, s_max].

    tolerance: relative to law.b_scale
    s_max:     largest slip of interest [m]; beyond it the exponential part stays at its last value,
               and it is frozen earlier where the rest of it is below the tolerance

    The exponential part is convex or concave. The polygon of fewest sides has its inner corners at
    the distance of the error on the side away from the curve's chords, and in the middle of every
    side the same distance on the other (Chebyshev): √2 times fewer sides than chords. Kinks of the
    law are kept bitwise with the values there, and so is an odd law's symmetry.

    Laws without exponential pieces are returned as they are, whatever the tolerance and s_max. A
    body that cannot slip has s_max = 0. Raises ValueError for a tolerance that is not positive or
    an s_max that is negative, and GrowthError if the part that is cut off is what satisfied (15).
    """
    if law.piecewise_linear:
        return law
    if not tolerance > 0.0:
        raise ValueError(f"tolerance must be positive, not {tolerance:g}")
    if not 0.0 <= s_max < np.inf:
        raise ValueError(f"s_max must be finite and not negative, not {s_max:g}")
    polygon = _polygon(law, tolerance * law.b_scale, s_max)
    polygon.check_growth()
    return polygon


def _polygon(law: Laws, allowed: float, s_max: float) -> Laws:
    """Return the same with an error in Pa.

    Of two exponentials per piece it is the sum of those of each, with half the error.
    """
    zero = np.zeros(len(law.q))
    if law.a_2 is not None and law.r_2 is not None:
        first = Laws(law.name, law.kinks, law.s_0, law.b_0, law.q, law.a, law.r)
        second = Laws(law.name, law.kinks, law.s_0, zero, zero, law.a_2, law.r_2)
        first_polygon = _polygon(first, 0.5 * allowed, s_max)
        return total(first_polygon, _polygon(second, 0.5 * allowed, s_max))
    kinks: list[float] = []
    sides: list[tuple[float, float, float]] = []
    for k in range(len(law.q)):
        corners, piece_sides = _sides(law, k, s_max, allowed)
        kinks += corners[1:]
        sides += piece_sides
    s_0, b_0, slope = (np.array(column) for column in zip(*sides, strict=True))
    zero = np.zeros(len(slope))
    name = f"{law.name}, piecewise linear"
    inner = np.array(kinks[:-1])
    return Laws(name, inner, s_0, b_0, slope, zero, zero, closing=law.closing)


def _sides(
    law: Laws, piece: int, s_max: float, allowed: float
) -> tuple[list[float], list[tuple[float, float, float]]]:
    """Return the corners of the polygon for a piece, and s_0, b_0 and q of every side."""
    lower = float(law.lower[piece])
    upper = float(law.upper[piece])
    a, r, s_0, q = law.a[piece], law.r[piece], law.s_0[piece], law.q[piece]
    corners = [lower, upper]
    depths = [0.0, 0.0]
    is_straight = a == 0.0 or r == 0.0
    if not is_straight:
        corners, depths = _corners(abs(a), r, s_0, lower, upper, s_max, allowed)
    if is_straight or corners == [-np.inf, np.inf]:
        return corners, [(s_0, law.b_0[piece] + a, q)]

    points = []
    for s, depth in zip(corners, depths, strict=True):
        b = float(law.value(s, piece)) - math.copysign(depth, a) if math.isfinite(s) else 0.0
        points.append((s, b))
    sides = []
    for (x, b_x), (y, b_y) in pairwise(points):
        if math.isfinite(x) and math.isfinite(y):  # anchored at its end nearer to s = 0
            anchor = (x, b_x) if abs(x) <= abs(y) else (y, b_y)
            sides.append((*anchor, (b_y - b_x) / (y - x)))
        else:  # the linear part goes on
            anchor = (x, b_x) if math.isfinite(x) else (y, b_y)
            sides.append((*anchor, q))
    return corners, sides


def _corners(
    a: float, r: float, anchor: float, lower: float, upper: float, s_max: float, allowed: float
) -> tuple[list[float], list[float]]:
    """Return the ends of the sides for a exp(−r (s − anchor)), a > 0, and how far they are below.

    The first and the last end are `lower` and `upper`.
    """
    if r < 0.0:  # the mirror image, so that an odd law stays odd to the bit
        corners, depths = _corners(a, -r, -anchor, -upper, -lower, s_max, allowed)
        return [-s for s in corners[::-1]], depths[::-1]
    # from here on a constant is as exact as the error allows
    faded = anchor + math.log(a / (2.0 * allowed)) / r
    first = max(lower, -s_max)
    last_corner = min(upper, s_max)
    fades = not math.isfinite(upper) and faded < last_corner
    if fades:
        last_corner = max(faded, first)
    if last_corner <= first:
        return [lower, upper], [0.0, 0.0]
    height = a * math.exp(-r * (first - anchor))
    tail = allowed if fades else 0.0
    cuts, error = _equal(allowed / height, r * (last_corner - first), tail / height)
    inner_corners = [first + x / r for x in cuts[1:-1]]
    corners = [first, *inner_corners, last_corner]
    depths = [0.0, *[error * height] * len(inner_corners), tail]
    if lower < first:
        corners = [lower, *corners]
        depths = [0.0, *depths]
    if upper > last_corner:
        corners = [*corners, upper]
        depths = [*depths, 0.0]
    return corners, depths


def _equal(allowed: float, length: float, tail: float) -> tuple[list[float], float]:
    """Return the corners of the polygon for exp(−x) on [0, length], and its error ≤ allowed.

    It has the fewest sides, and with them the smallest error.

    tail: how far the last corner lies below the curve
    """
    cuts = _march(allowed, length, tail)
    low = 0.0
    high = allowed
    n_bisections = 20 if len(cuts) < 300 else 0
    for _ in range(n_bisections):
        middle = 0.5 * (low + high)
        trial_cuts = _march(middle, length, tail)
        if len(trial_cuts) == len(cuts):
            high = middle
            cuts = trial_cuts
        else:
            low = middle
    return cuts, high


def _march(error: float, length: float, tail: float) -> list[float]:
    """Return corners one after the other, every side as long as the error allows."""
    cuts = [0.0]
    depth = 0.0  # of the corner from which a side begins
    while True:
        height = math.exp(-cuts[-1])
        remaining = length - cuts[-1]
        if _excess(remaining, depth / height, tail / height) <= error / height:
            return [*cuts, length]
        if len(cuts) > MAX_CELLS:
            raise ValueError(f"more than {MAX_CELLS} chords are needed; the tolerance is too small")
        low = 0.0
        high = remaining
        for _ in range(45):
            middle = 0.5 * (low + high)
            if _excess(middle, depth / height, error / height) <= error / height:
                low = middle
            else:
                high = middle
        cuts.append(cuts[-1] + low)
        depth = error


def _excess(h: float, z_0: float, z_1: float) -> float:
    """Return how far the line from (0, 1 − z₀) to (h, e^(−h) − z₁) rises above exp(−x) there."""
    if h == 0.0:
        return 0.0
    fall = (float(-np.expm1(-h)) + z_1 - z_0) / h
    x = min(max(-math.log(fall), 0.0), h) if fall > 0.0 else h
    return -z_0 - fall * x - math.expm1(-x)
