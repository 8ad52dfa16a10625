"""Laws made of other laws: by node and by row, at joints of edges, of straight pieces alone; and
their derivatives.

At a joint node i has the friction c' b'(s) + c'' b''(s), c' and c'' the parts of c_i on the two
edges; so its law is b = (c' b' + c'' b'')/c_i: the trapezoidal rule on either side of the step in
∫_{Γ_C} j(x, u_T), of second order. With all of c_i given to one of the laws it is of first order.

Derivatives by a law's parameters are complex steps through the builders and the laws' own
functions: f′(p) = Im f(p + ih)/h to the last digits, since nothing is subtracted (Squire & Trapp,
SIAM Rev. 40 (1998) 110–112); h is so small that h² is lost beside every number. What is compared is
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
from tcstudy.laws.laws import NONE, Laws
from tcstudy.laws.pieces import Array
from tcstudy.laws.shapes import SHAPES


def nodal(
    laws: Sequence[Laws],
    index: ArrayLike,
    stronger: ArrayLike = 1.0,
    stretched: ArrayLike = 1.0,
    moved: ArrayLike = 0.0,
) -> Laws:
    """The laws b_i(s) = β_i b((s − a_i)/σ_i) of nodes; the law itself where all nodes have the
    same.

    laws:      the shared laws b, each one for all
    index:     (m,) which of them a node has
    stronger:  strength β_i ≥ 0, 0 for a gap in the bond
    stretched: σ_i > 0;  moved: a_i [m];  all (m,) or one number

    Raises ValueError for a strength below 0, a stretch that is not above 0, or numbers that are not
    finite.
    """
    index = np.asarray(index, dtype=np.intp)
    beta, sigma, a = (
        np.broadcast_to(np.asarray(x, dtype=float), index.shape)
        for x in (stronger, stretched, moved)
    )
    if not (np.all(np.isfinite([beta, sigma, a])) and np.all(beta >= 0.0) and np.all(sigma > 0.0)):
        raise ValueError(
            "a node's law needs finite numbers, a strength of at least 0 and a stretch above 0"
        )
    same: dict[Laws, int] = {}
    first = np.array([same.setdefault(law, k) for k, law in enumerate(laws)], dtype=np.intp)
    gap = (beta == 0.0) | np.array([law.vanishes for law in laws])[index]
    rows = np.stack(
        [np.where(gap, -1, first[index]), *(np.where(gap, 1.0, x) for x in (beta, sigma, a))],
        axis=1,
    )
    used, at = np.unique(rows, axis=0, return_inverse=True)
    distinct = [
        NONE if k < 0 else laws[int(k)].placed(b, s, shift) for k, b, s, shift in used.tolist()
    ]
    return distinct[0] if len(distinct) == 1 else Laws.of(distinct, at.reshape(-1))


def total(one: Laws, two: Laws) -> Laws:
    """The law b' + b'', of two that have at most one exponential a piece; an odd one of odd ones,
    to the bit.

    It has the kinks of both, and one where b″ of two exponentials changes its sign.
    """
    ends = np.concatenate([[-np.inf], np.union1d(one.kinks, two.kinks), [np.inf]])
    kinks: list[float] = []
    rows: list[tuple[float, ...]] = []
    for left, right in zip(ends[:-1].tolist(), ends[1:].tolist(), strict=True):
        s_0 = min(max(0.0, left), right)
        inside = left if np.isfinite(left) else right if np.isfinite(right) else 0.0
        side = 1 if np.isfinite(left) else -1
        pieces = [(law, int(law.piece(inside, side))) for law in (one, two)]
        b_0 = sum(float(law.b_0[k] + law.q[k] * (s_0 - law.s_0[k])) for law, k in pieces)
        decays: dict[float, float] = {}
        for law, k in pieces:
            if law.a[k]:
                a = float(law.a[k] * np.exp(-law.r[k] * (s_0 - law.s_0[k])))
                decays[float(law.r[k])] = decays.get(float(law.r[k]), 0.0) + a
        (r, a), (r_2, a_2) = (
            *sorted(decays.items(), key=lambda x: abs(x[0])),
            (0.0, 0.0),
            (0.0, 0.0),
        )[:2]
        row = (s_0, b_0, sum(float(law.q[k]) for law, k in pieces), a, r, a_2, r_2)
        ratio = -(a_2 * r_2**2) / (a * r**2) if a and a_2 else 0.0
        turn = s_0 + float(np.log(ratio)) / (r_2 - r) if ratio > 0.0 else np.nan
        kinks += [left, *([turn] if left < turn < right else [])]
        rows += [row] * (2 if left < turn < right else 1)
    name = " and ".join(dict.fromkeys(law.name for law in (one, two) if not law.vanishes))
    columns = [np.array(column) for column in zip(*rows, strict=True)]
    return Laws(name, np.array(kinks[1:]), *(columns if np.any(columns[5]) else columns[:5]))


def row_laws(laws: Sequence[Laws], factor: Array) -> Laws:
    """The laws of a block, each scaled by the row's stiffness over that of the body; by node where
    one has them so."""
    known: dict[
        tuple[int, float], int
    ] = {}  # by identity: a sweep shares its laws, and equal ones only cost time
    rows = [
        known.setdefault((id(law), f), len(known))
        for law, f in zip(laws, factor.tolist(), strict=True)
    ]
    own = [(laws[row], float(factor[row])) for row in np.unique(rows, return_index=True)[1]]
    scaled = [law if f == 1.0 else law.placed(1.0 / f) for law, f in own]
    m = max((len(law.index) for law in scaled if not law.one), default=1)
    tables: list[Laws] = []
    index = np.empty((len(scaled), m), dtype=np.intp)
    for row, law in zip(index, scaled, strict=True):
        row[:] = len(tables) + law.index
        tables += law.laws
    return Laws.of(tables, index[np.array(rows, dtype=np.intp)])


class Joints(NamedTuple):
    """The nodes whose cells lie on two edges of Γ_C: where one ends and the next begins.

    node: (j,) which of the nodes, whose own edge is the one after it (along t);  edge: (j,) number of the edge before
    share: (j,) part of c_i on that edge
    """

    node: NDArray[np.intp] = np.zeros(0, dtype=np.intp)
    edge: NDArray[np.integer] = np.zeros(0, dtype=np.intp)
    share: Array = np.zeros(0)


NO_JOINTS = Joints()


@dataclass(frozen=True)
class EdgeLaws:
    """Friction that differs along Γ_C: b(s) of an edge's law times its strength in x and y, 0 where
    the bond has a gap.

    laws: (edge, law, strength); the edge "" is all of Γ_C
    """

    laws: tuple[tuple[str, Laws, float | Expression], ...]

    def along(
        self, names: Sequence[str], edge: NDArray[np.integer], xy: Array
    ) -> tuple[NDArray[np.intp], Array]:
        """(m,) which of the laws a point has, and its strength there; of points at xy (m, 2) on
        edges by number.

        Raises ValueError for a strength below 0 or one that is no number.
        """
        own = [name for name, _, _ in self.laws]
        index = np.array([own.index(name) if name in own else 0 for name in names], dtype=np.intp)[
            edge
        ]
        strength = np.empty(len(index))
        for k, (_, _, factor) in enumerate(self.laws):
            x, y = xy[index == k].T
            strength[index == k] = value_of(factor, x, y)
        if np.any(wrong := ~((strength >= 0.0) & np.isfinite(strength))):
            k = int(np.argmax(wrong))
            x, y = xy[k]
            raise ValueError(
                f"the strength of friction is {strength[k]:g} at ({x:g}, {y:g}); it must be 0 or more"
            )
        return index, strength

    def factors(
        self, names: Sequence[str], edge: NDArray[np.integer], xy: Array, joints: Joints
    ) -> Array:
        """(L, m) the factor of every law in that of a node: its strength, at a joint times its part
        of c_i.

        NaN where a node has nothing of a law. Arguments and Raises as `along`.
        """
        index, strength = self.along(names, edge, xy)
        found = np.full((len(self.laws), len(index)), np.nan)
        found[index, np.arange(len(index))] = strength
        before, weaker = self.along(names, joints.edge, xy[joints.node])
        for node, k, beta, share in zip(joints.node, before, weaker, joints.share, strict=True):
            own = strength[node]
            if k == index[node]:
                found[k, node] = own + share * (beta - own)
            else:
                found[index[node], node], found[k, node] = (1.0 - share) * own, share * beta
        return found

    @property
    def vanishes(self) -> bool:
        """True if b ≡ 0 everywhere."""
        return all(law.vanishes for _, law, _ in self.laws)


def law_along(
    friction: Laws | EdgeLaws,
    names: Sequence[str],
    edge: NDArray[np.integer],
    xy: Array,
    joints: Joints = NO_JOINTS,
) -> Laws:
    """The law of the contact line, or of points xy (m, 2) on it, which lie on the edges `names` by
    number (m,).

    Raises ValueError for a strength below 0.
    """
    if isinstance(friction, Laws):
        return friction
    laws, index, strength = laws_along(friction, names, edge, xy, joints)
    return nodal([law for _, law in laws], index, strength)


def laws_along(
    friction: EdgeLaws, names: Sequence[str], edge: NDArray[np.integer], xy: Array, joints: Joints
) -> tuple[list[tuple[str, Laws]], NDArray[np.intp], Array]:
    """(edge, law) of the edges and after them of joints, (m,) which of them a node has, and its
    strength.

    A joint has (c' b' + c'' b'')/c_i of the edges that meet there, whose names its law has both.
    Raises ValueError for a strength below 0.
    """
    factors = friction.factors(names, edge, xy, joints)
    has = ~np.isnan(factors)
    laws, index = [(name, law) for name, law, _ in friction.laws], np.argmax(has, axis=0)
    strength = factors[index, np.arange(len(index))]
    for node in np.flatnonzero(has.sum(axis=0) > 1).tolist():
        meet = np.flatnonzero(has[:, node])
        one, two = (laws[k][1].times(float(factors[k, node])) for k in meet)
        index[node], strength[node] = len(laws), 1.0
        laws.append((" and ".join(laws[k][0] for k in meet), total(one, two)))
    return laws, index, strength


POINTS = "points"
_AGREE = 1e-9
"""Falls and derivatives nearer than this to each other, relative, are one."""


_STEP = 2.0**-400


def stepped(number: float) -> Any:
    """p + ih."""
    return np.complex128(complex(number, _STEP))


def derivative(numbers: Any) -> Any:
    """Of what was computed from p + ih (their shape)."""
    return np.imag(numbers) / _STEP


@dataclass(frozen=True, eq=False)
class LawSlopes:
    """Derivatives by one parameter of a law, one for all; varied: the law of p + ih.

    Where the law goes straight through a point that moves alone, the varied one has a bend that the
    law has not.
    """

    law: Laws
    varied: Laws

    @property
    def kinks(self) -> Array:
        """(K,) of the law's kinks [m per unit of p]."""
        return derivative(
            self.varied.kinks[np.searchsorted(self.varied.kinks.real, self.law.kinks)]
        )

    def value(self, s: Array, piece: NDArray[np.intp]) -> Array:
        """∂b_k/∂p at s of the law's named pieces (shape of s) [Pa per unit of p]."""
        if len(self.varied.q) != len(self.law.q):
            low, high = self.law.ends(piece)
            s = np.clip(s, low, high)
            at = self.varied.locate(s)
            piece = at.toward(s < high)
        return derivative(self.varied.value(s, piece))

    def potential(self, s: Array) -> Array:
        """∂j/∂p at s, which is no kink that moves, or the inner side of one (shape of s) [Pa m per
        unit of p].

        ∫₀ˢ ∂b/∂p, and of every kink on the way, which moves by κ′, κ′(b⁻ − b⁺).
        """
        return derivative(self.varied.j(s))

    def omega(self) -> float:
        """∂ω/∂p: that of the slope at the end of a piece where b falls most; NaN where two do not
        agree."""
        omega, slopes = self.law.omega, self.varied.end_slopes.ravel()
        if not np.isfinite(omega) or omega == 0.0:
            return 0.0 if omega == 0.0 else float("nan")
        return agreed(-derivative(slopes[slopes.real <= -omega * (1.0 - _AGREE)]))


def agreed(changes: Array) -> float:
    """The one value that all have, to rounding; NaN where they differ."""
    size = float(np.max(np.abs(changes), initial=0.0))
    return float(changes[0]) if len(changes) and np.ptp(changes) <= _AGREE * size else float("nan")


def number_of(path: tuple[str, ...]) -> str:
    """What a key path calls a number of a law: "delta", "points.2" for the b of the third point,
    "points.2.s"."""
    n = next((n for n in (2, 3) if path[-n:][0] == POINTS), 1)
    return ".".join(path[-n:])


def point_of(law: Laws, parameter: str) -> int:
    """Which point of a law "points.2" or "points.2.s" means. Raises KeyError if it has none of this
    number."""
    made, (name, _, number) = law.made, parameter.removesuffix(".s").partition(".")
    points = made.values.get(POINTS, ()) if made and name == POINTS else ()
    if not number.isascii() or not number.isdigit() or int(number) >= len(points):
        raise KeyError(parameter)
    return int(number)


def law_slopes(law: Laws, parameter: str) -> LawSlopes:
    """Derivatives of a law by one of its parameters, by its `strength`, a factor of b, or by the b
    or s of a point.

    parameter: as `number_of` has it
    Raises KeyError if it has no such parameter, or if it is not known what it was made of.
    """
    made = law.made
    if made is None:
        raise KeyError(parameter)
    values, factor = (
        dict(made.values),
        stepped(made.strength) if parameter == "strength" else made.strength,
    )
    if parameter.startswith(f"{POINTS}."):
        at, of_s = point_of(law, parameter), parameter.endswith(".s")
        points = [(s, np.complex128(b)) for s, b in values[POINTS]]
        s, b = points[at]
        points[at] = (stepped(s), b) if of_s else (s, stepped(b.real))
        values[POINTS] = points
    elif parameter != "strength":
        if not isinstance(values[parameter], float):
            raise KeyError(parameter)
        values[parameter] = stepped(values[parameter])
    varied = SHAPES[made.shape].builder(**values)
    return LawSlopes(
        law, replace(varied, b_0=varied.b_0 * factor, q=varied.q * factor, a=varied.a * factor)
    )


# -- straight pieces in the place of exponential ones
# -----------------------------------------------------------------

MAX_CELLS = 100_000
"""Cells of one piece; a finer approximation than this is a mistake in the tolerance."""


def piecewise_linear(law: Laws, tolerance: float, s_max: float) -> Laws:
    """The law with every exponential piece replaced by chords, |b − b_h| ≤ tolerance · b_scale on
    [−s_max, s_max].

    tolerance: relative to law.b_scale
    s_max:     largest slip of interest [m]; beyond it the exponential part stays at its last value, and it is
               frozen earlier where what is left of it is below the tolerance

    The exponential part is convex or concave, so the polygon of fewest sides has its inner corners
    at the distance of
    the error on the side away from the curve's chords, and in the middle of every side the same
    distance on the other
    (Chebyshev): √2 times fewer sides than chords. Kinks of the law are kept bitwise with the values
    there, and so is
    an odd law's symmetry.
    Laws without exponential pieces are returned as they are, whatever the tolerance and s_max; a
    body that cannot slip has s_max = 0. Raises ValueError for a tolerance that is not positive or
    an s_max that is negative, and GrowthError if the part that is cut off is what satisfied (15).
    """
    if law.piecewise_linear:
        return law
    if not tolerance > 0.0:
        raise ValueError(f"tolerance must be positive, not {tolerance:g}")
    if not 0.0 <= s_max < np.inf:
        raise ValueError(f"s_max must be finite and not negative, not {s_max:g}")
    result = _polygon(law, tolerance * law.b_scale, s_max)
    result.check_growth()
    return result


def _polygon(law: Laws, allowed: float, s_max: float) -> Laws:
    """The same with an error in Pa; of two exponentials a piece the sum of those of each, with half
    the error."""
    if law.a_2 is not None and law.r_2 is not None:
        zero = np.zeros(len(law.q))
        one = Laws(law.name, law.kinks, law.s_0, law.b_0, law.q, law.a, law.r)
        two = Laws(law.name, law.kinks, law.s_0, zero, zero, law.a_2, law.r_2)
        return total(_polygon(one, 0.5 * allowed, s_max), _polygon(two, 0.5 * allowed, s_max))
    ends, kinks, sides = (
        np.concatenate([[-np.inf], law.kinks, [np.inf]]),
        list[float](),
        list[tuple[float, ...]](),
    )
    for k, (q, a, r, anchor) in enumerate(zip(law.q, law.a, law.r, law.s_0, strict=True)):
        left, right = ends[k : k + 2].tolist()
        corners, below = [left, right], [0.0, 0.0]
        if not (straight := a == 0.0 or r == 0.0):
            corners, below = _corners(abs(a), r, anchor, left, right, s_max, allowed)
        kinks += corners[1:] if k + 1 < len(law.q) else corners[1:-1]
        both = zip(corners, below, strict=True)
        b = [
            float(law.value(s, k)) - math.copysign(z, a) if math.isfinite(s) else 0.0
            for s, z in both
        ]
        for (x, b_x), (y, b_y) in pairwise(zip(corners, b, strict=True)):
            if straight or corners == [-np.inf, np.inf]:
                sides.append((anchor, law.b_0[k] + a, q))
            elif math.isfinite(x) and math.isfinite(y):  # hung on its end nearer to s = 0
                sides.append((*((x, b_x) if abs(x) <= abs(y) else (y, b_y)), (b_y - b_x) / (y - x)))
            else:  # the linear part goes on
                sides.append((*((x, b_x) if math.isfinite(x) else (y, b_y)), q))
    s_0, b_0, slope = (np.array(column) for column in zip(*sides, strict=True))
    zero = np.zeros(len(slope))
    return Laws(f"{law.name}, piecewise linear", np.array(kinks), s_0, b_0, slope, zero, zero)


def _corners(
    a: float, r: float, anchor: float, left: float, right: float, s_max: float, allowed: float
) -> tuple[list[float], list[float]]:
    """Ends of the sides of a piece with a exp(−r (s − anchor)), a > 0, and how far they are below
    it; left and right are the first and the last."""
    if r < 0.0:  # the mirror image, so that an odd law stays odd to the bit
        corners, below = _corners(a, -r, -anchor, -right, -left, s_max, allowed)
        return [-s for s in corners[::-1]], below[::-1]
    faded = (
        anchor + math.log(a / (2.0 * allowed)) / r
    )  # a constant serves for all that is left beyond
    first, last = max(left, -s_max), min(right, s_max)
    fades = not math.isfinite(right) and faded < last
    last = max(faded, first) if fades else last
    if last <= first:
        return [left, right], [0.0, 0.0]
    height, tail = a * math.exp(-r * (first - anchor)), allowed if fades else 0.0
    cuts, error = _equal(allowed / height, r * (last - first), tail / height)
    corners = [first, *(first + x / r for x in cuts[1:-1]), last]
    below = [0.0, *[error * height] * (len(cuts) - 2), tail]
    before, after = ([left] if left < first else []), ([right] if right > last else [])
    return [*before, *corners, *after], [*[0.0] * len(before), *below, *[0.0] * len(after)]


def _equal(allowed: float, length: float, tail: float) -> tuple[list[float], float]:
    """(corners of the polygon for exp(−x) on [0, length], its error ≤ allowed): the fewest sides,
    the least error.

    tail: how far the last corner lies below the curve
    """
    cuts = _march(allowed, length, tail)
    low, high = 0.0, allowed
    for _ in range(20 if len(cuts) < 300 else 0):
        middle = 0.5 * (low + high)
        tried = _march(middle, length, tail)
        if len(tried) == len(cuts):
            high, cuts = middle, tried
        else:
            low = middle
    return cuts, high


def _march(error: float, length: float, tail: float) -> list[float]:
    """Corners one after the other, every side as long as the error allows."""
    cuts, begin = [0.0], 0.0
    while True:
        height, rest = math.exp(-cuts[-1]), length - cuts[-1]
        if _excess(rest, begin / height, tail / height) <= error / height:
            return [*cuts, length]
        if len(cuts) > MAX_CELLS:
            raise ValueError(f"more than {MAX_CELLS} chords are needed; the tolerance is too small")
        low, high = 0.0, rest
        for _ in range(45):
            middle = 0.5 * (low + high)
            within = _excess(middle, begin / height, error / height) <= error / height
            low, high = (middle, high) if within else (low, middle)
        cuts.append(cuts[-1] + low)
        begin = error


def _excess(h: float, z_0: float, z_1: float) -> float:
    """How far the line from (0, 1 − z₀) to (h, e^(−h) − z₁) rises above exp(−x) between them."""
    if h == 0.0:
        return 0.0
    fall = (float(-np.expm1(-h)) + z_1 - z_0) / h
    where = min(max(-math.log(fall), 0.0), h) if fall > 0.0 else h
    return -z_0 - fall * where - math.expm1(-where)
