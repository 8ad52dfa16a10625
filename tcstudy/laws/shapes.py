"""The named shapes of friction laws: their parameters, the checks of values, and the pieces.

Every shape but a piecewise-linear one with odd: false is odd, b(−s) = −b(s), and is written down
for s > 0 only. The mirror image changes signs and nothing else, so that the symmetry holds to the
bit. b(0+) > 0 is the sticking up-jump: the filled interval at 0 is [−b(0+), b(0+)], eq. (4) of
Šestak & Jovanović (2010).
"""

from __future__ import annotations

import difflib
import math
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise
from typing import Any, NamedTuple, TypeVar

import numpy as np

from tcstudy.laws.laws import NONE, Laws, Made

MAX_TEETH = 10_000
ROUNDING = 2 * float(np.finfo(float).eps)
"""Corners this close to the line between their neighbours, relative to b, count as straight."""

Builder = TypeVar("Builder", bound=Callable[..., Laws])


class LawError(ValueError):
    """A parameter of a friction law is missing, unknown or has no meaning.

    The text gives the remedy.

    parameter: its name
    """

    def __init__(self, parameter: str, message: str) -> None:
        super().__init__(f"{parameter}: {message}")
        self.parameter = parameter
        self.message = message

    def __reduce__(self) -> tuple[type[LawError], tuple[str, str]]:
        return type(self), (self.parameter, self.message)


class _Piece(NamedTuple):
    """b(s) = b_0 + q (s − s_0) + a exp(−r (s − s_0))."""

    s_0: float
    b_0: float
    q: float = 0.0
    a: float = 0.0
    r: float = 0.0

    def mirrored(self) -> _Piece:
        """Return the piece −b(−s)."""
        return _Piece(-self.s_0, -self.b_0, self.q, -self.a, -self.r)

    def goes_on_as(self, following: _Piece) -> bool:
        """Return whether both are the same function; a constant has no anchor."""
        is_constant = self.q == 0.0 and self.a == 0.0
        return self[1:] == following[1:] and (self.s_0 == following.s_0 or is_constant)


def _law(name: str, kinks: Sequence[float], pieces: Sequence[_Piece]) -> Laws:
    """Return a law from its kinks and pieces, without kinks between two equal pieces."""
    kept_kinks = []
    kept_pieces = [pieces[0]]
    for kink, (before, after) in zip(kinks, pairwise(pieces), strict=True):
        if not before.goes_on_as(after):
            kept_kinks.append(kink)
            kept_pieces.append(after)
    columns = [np.array(column) + 0.0 for column in zip(*kept_pieces, strict=True)]
    number_type = complex if _varied(*kinks) else float
    return Laws(name, np.array(kept_kinks, dtype=number_type), *columns)


def _varied(*numbers: float | None) -> bool:
    """Return whether some are complex: those of a law that is to be differentiated."""
    return any(isinstance(number, complex) for number in numbers)


def _odd(name: str, kinks: Sequence[float], pieces: Sequence[_Piece]) -> Laws:
    """Return the odd law whose kinks and pieces for s > 0 are given."""
    mirrored_kinks = [-s for s in reversed(kinks)]
    mirrored_pieces = [piece.mirrored() for piece in reversed(pieces)]
    return _law(name, [*mirrored_kinks, 0.0, *kinks], [*mirrored_pieces, *pieces])


@dataclass(frozen=True)
class LawParameter:
    """A parameter of a shape.

    dimension: SI unit of its numbers
    meaning:   one line
    example:   a value as it is suggested; "" for that of the unit
    kind:      "number", "integer", "flag", "numbers" or "law points"
    default:   value of an optional parameter that is not given
    least:     smallest value of a number
    bound:     "positive", "not negative", "share" (above 0 and at most 1) or none
    """

    name: str
    meaning: str
    dimension: str = ""
    example: str = ""
    kind: str = "number"
    required: bool = True
    default: object = None
    least: float | None = None
    bound: str = ""


LENGTH = "m"
TRACTION = "Pa"
STIFFNESS = "Pa/m"
ENERGY = "J/m^2"
_traction = partial(LawParameter, dimension=TRACTION, bound="not negative")
_slip = partial(LawParameter, dimension=LENGTH, bound="positive")
_TAU = _traction("tau", "traction, of a saw-tooth its first peak")
_DELTA = _slip(
    "delta", "slip over which b softens; for saw-tooth the width of a tooth", example="40 um"
)
_PEAK = _traction("tau", "traction at its peak", example="4 MPa")
_S0 = _slip("s0", "slip at the end of the elastic branch", example="20 um")
_optional = partial(LawParameter, required=False)
_SF = _optional("sf", "slip of full debonding (b = 0); or give G_f", LENGTH, "200 um")
_GF = _optional("G_f", "fracture energy, the area below b, in place of sf", ENERGY, "400 J/m^2")


@dataclass(frozen=True)
class Shape:
    """A family of laws under one name.

    parameters: in the order of the documentation
    summary:    the formula for s > 0
    """

    name: str
    parameters: tuple[LawParameter, ...]
    summary: str
    builder: Callable[..., Laws]

    def build(self, **values: object) -> Laws:
        """Return the law with these parameters (consistent units).

        Raises LawError for a missing, unknown or meaningless parameter, GrowthError unless (15) and
        (16) hold.
        """
        names = [parameter.name for parameter in self.parameters]
        for name in values:
            if name not in names:
                raise self._unknown(name, names)
        checked_values = {}
        for parameter in self.parameters:
            value = values.get(parameter.name)
            checked_values[parameter.name] = _checked(self.name, parameter, value)
        law = self.builder(**checked_values)
        law = replace(law, made=Made(self.name, checked_values))
        law.check_growth()
        return law

    def _unknown(self, name: str, names: list[str]) -> LawError:
        similar = difflib.get_close_matches(name, names, n=1)
        hint = f"did you mean {similar[0]!r}? " if similar else ""
        return LawError(
            name, f"{self.name} has no such parameter; {hint}it takes {', '.join(names)}"
        )


_BOUNDS: dict[str, tuple[Callable[[float], bool], str]] = {
    "positive": (
        lambda x: x > 0.0,
        "must be above 0, not {:g}; it is the slip over which the law changes",
    ),
    "share": (
        lambda x: 0.0 < x <= 1.0,
        "must be above 0 and at most 1, not {:g}; it is a fraction of the peak",
    ),
    "not negative": (
        lambda x: x >= 0.0,
        "must be at least 0, not {:g}: friction opposes the slip; "
        "for other laws use piecewise-linear",
    ),
}


def _checked(shape: str, parameter: LawParameter, value: object) -> Any:
    """Return the value of a parameter in the form of its kind, or its default.

    Raises LawError for a missing value, one of another kind, or one outside its bound.
    """
    name = parameter.name
    if value is None:
        if parameter.required:
            raise LawError(name, f"is missing; the law {shape} needs it")
        return parameter.default
    match parameter.kind:
        case "integer":
            number = _number(name, value)
            if not number.is_integer():
                raise LawError(name, f"must be a whole number, not {number:g}")
            return int(number)
        case "flag":
            if not isinstance(value, bool):
                raise LawError(name, f"must be true or false, not {value!r}")
            return value
        case "numbers":
            return [_number(name, item) for item in _items(name, value, "numbers, [left, right]")]
        case "law points":
            return _law_points(name, value)
    number = _number(name, value)
    holds, message = _BOUNDS.get(parameter.bound, (np.isfinite, ""))
    if not holds(number):
        raise LawError(name, message.format(number))
    return number


def _law_points(name: str, value: object) -> list[tuple[float, float]]:
    """Return pairs (s, b) of a list of pairs; raise LawError for anything else."""
    items = _items(name, value, "pairs [s, b]")
    pairs = [_items(name, item, "pairs [s, b]") for item in items]
    if not pairs or any(len(pair) != 2 for pair in pairs):
        raise LawError(name, "must be a list of at least one pair [s, b] of slip and traction")
    return [(_number(name, s), _number(name, b)) for s, b in pairs]


def _items(name: str, value: object, content: str) -> list[object]:
    if isinstance(value, (str, bytes)) or not isinstance(value, (Sequence, np.ndarray)):
        raise LawError(name, f"must be a list of {content}, not {value!r}")
    return list(value)


def _number(name: str, value: object) -> float:
    if isinstance(value, bool) or not isinstance(value, (int, float, np.integer, np.floating)):
        raise LawError(name, f"must be a number, not {value!r}")
    if not -sys.float_info.max <= value <= sys.float_info.max:
        raise LawError(name, "must be a finite number")
    return float(value)


SHAPES: dict[str, Shape] = {}
"""The shapes by name, as a study writes them."""


def _shape(*parameters: LawParameter) -> Callable[[Builder], Builder]:
    """Return a decorator that adds a builder to the shapes; its docstring is the summary."""

    def register(builder: Builder) -> Builder:
        name = builder.__name__.replace("_", "-")
        summary = " ".join((builder.__doc__ or "").split())
        SHAPES[name] = Shape(name, parameters, summary, builder)
        return builder

    return register


@_shape(_TAU)
def tresca(tau: float) -> Laws:
    """b = tau"""
    return _odd("tresca", [], [_Piece(0.0, tau)])


@_shape(
    _traction("tau_s", "largest traction of sticking"),
    _traction("tau_k", "traction of slip"),
    _DELTA,
)
def slip_weakening(tau_s: float, tau_k: float, delta: float) -> Laws:
    """b softens linearly from tau_s to tau_k over the slip delta (rises if tau_k > tau_s), then b =
    tau_k"""
    initial = _Piece(0.0, tau_s, (tau_k - tau_s) / delta)
    return _odd("slip-weakening", [delta], [initial, _Piece(delta, tau_k)])


@_shape(
    _traction("a", "largest traction of sticking"), _traction("b", "traction of large slip"), _DELTA
)
def exponential(a: float, b: float, delta: float) -> Laws:
    """b = (a - b) exp(-s/delta) + b"""
    piece = _Piece(0.0, b) if a == b else _Piece(0.0, b, 0.0, a - b, 1.0 / delta)
    return _odd("exponential", [], [piece])


@_shape(
    _TAU,
    _DELTA,
    LawParameter("teeth", "their number", example="3", kind="integer", least=1),
    LawParameter(
        "drop", "drop of b after a tooth, as a share of its peak", example="0.5", bound="share"
    ),
    _optional("decay", "each peak over the one before", example="0.5", default=1.0, bound="share"),
)
def saw_tooth(tau: float, delta: float, teeth: int, drop: float, decay: float) -> Laws:
    """teeth i = 0, 1, ... of width delta: b rises linearly from (1 - drop) tau decay^i to tau
    decay^i and drops at the end; after the last tooth b = (1 - drop) tau decay^teeth
    """
    if not 1 <= teeth <= MAX_TEETH:
        raise LawError("teeth", f"must be from 1 to {MAX_TEETH}, not {teeth}")
    pieces = []
    for i in range(teeth):
        peak = tau * decay**i
        pieces.append(_Piece(i * delta, (1.0 - drop) * peak, drop * peak / delta))
    residual = (1.0 - drop) * (tau * decay**teeth)
    pieces.append(_Piece(teeth * delta, residual))
    return _odd("saw-tooth", [i * delta for i in range(1, teeth + 1)], pieces)


# Laws of interfaces with an elastic branch: bilinear as of fibre-reinforced plates on concrete
# (Yuan, Teng, Seracino, Wu & Yao, Eng. Struct. 26, 2004), trapezoidal as of ductile adhesives
# (Campilho et al., Int. J. Adhes. Adhes. 46, 2013), trilinear as of grouted bolts (Ren, Yang &
# Chen, Constr. Build. Mater. 24, 2010).


@_shape(_PEAK, _S0)
def elastic_plastic(tau: float, s0: float) -> Laws:
    """b rises linearly from 0 to tau over s0, then b = tau"""
    return _interface("elastic-plastic", tau, (s0, tau))


@_shape(_PEAK, _S0, _SF, _GF)
def bilinear(tau: float, s0: float, sf: float | None, G_f: float | None) -> Laws:
    """b rises linearly from 0 to tau over s0, softens linearly to 0 at sf (so that G_f = tau sf/2),
    then b = 0"""
    return _interface("bilinear", tau, (s0, tau), (_debonded(tau, s0, s0, sf, G_f), 0.0))


@_shape(
    _PEAK, _S0, LawParameter("s1", "slip at the end of the plateau", LENGTH, "100 um"), _SF, _GF
)
def trapezoidal(tau: float, s0: float, s1: float, sf: float | None, G_f: float | None) -> Laws:
    """b rises linearly from 0 to tau over s0, stays to s1, softens linearly to 0 at sf (G_f =
    tau (sf + s1 - s0)/2)"""
    return _interface(
        "trapezoidal", tau, (s0, tau), (s1, tau), (_debonded(tau, s0, s1, sf, G_f), 0.0)
    )


@_shape(
    _PEAK, _S0, replace(_SF, meaning="slip at which b reaches tau_r", required=True),
    _traction("tau_r", "residual traction", example="1 MPa"),
)  # fmt: skip
def trilinear(tau: float, s0: float, sf: float, tau_r: float) -> Laws:
    """b rises linearly from 0 to tau over s0, softens linearly to tau_r at sf, then b = tau_r"""
    return _interface("trilinear", tau, (s0, tau), (sf, tau_r))


def _debonded(tau: float, s0: float, s1: float, sf: float | None, energy: float | None) -> float:
    """Return the slip at which a law that falls from tau at s1 has reached 0.

    It is sf, or follows from the fracture energy.
    """
    if sf is not None and energy is not None:
        raise LawError("G_f", "follows from sf; give one of the two")
    if sf is not None:
        return sf
    if energy is None:
        raise LawError(
            "sf",
            "is missing; give the slip sf of full debonding, or the fracture energy G_f",
        )
    if not tau > 0.0:
        raise LawError("tau", _BOUNDS["positive"][1].format(tau))
    end = 2.0 * energy / tau - (s1 - s0)
    if not end > s1:
        smallest = tau * (s1 - 0.5 * s0)
        raise LawError(
            "G_f",
            f"must be above {smallest:g} J/m^2, the area below b up to s = {s1:g} m, not "
            f"{energy:g}",
        )
    return end


def _interface(name: str, tau: float, *corners: tuple[float, float]) -> Laws:
    """Return the odd law through 0 and these corners (s, b), constant after the last."""
    names = ("s0", "s1", "sf") if len(corners) == 3 else ("s0", "sf")
    slips = [s for s, _ in corners]
    for (name_before, before), (name_after, after) in pairwise(zip(names, slips, strict=False)):
        if not after > before:
            raise LawError(name_after, f"must be above {name_before} = {before:g}, not {after:g}")
    pieces = [_Piece(0.0, 0.0, tau / slips[0])]
    for (s, b), (next_s, next_b) in pairwise(corners):
        pieces.append(_Piece(s, b, (next_b - b) / (next_s - s)))
    pieces.append(_Piece(*corners[-1]))
    return _odd(name, slips, pieces)


class _Vertex(NamedTuple):
    """A corner of a polygonal law: b on both sides of s; both are equal where b only bends."""

    s: float
    left: float
    right: float


@_shape(
    LawParameter("points", "[s, b]", "", "[[0 um, 20 MPa], [40 um, 5 MPa]]", "law points"),
    _optional("odd", "given for s >= 0 and mirrored", example="true", kind="flag", default=True),
    _optional("slope", "beyond the last point", STIFFNESS),
    _optional("slopes", "beyond both ends where odd is false", STIFFNESS, "[0, 0]", "numbers"),
)
def piecewise_linear(
    points: list[tuple[float, float]], odd: bool, slope: float | None, slopes: list[float] | None
) -> Laws:
    """b straight between the points [s, b], a jump where two have the same s, then on with the
    slope(s), by default 0; odd: given for s >= 0 and mirrored
    """
    vertices = _vertices(points)
    if not odd:
        if slope is not None:
            raise LawError(
                "slope", "belongs to odd laws; with odd: false give slopes: [left, right]"
            )
        if slopes is not None and len(slopes) != 2:
            raise LawError("slopes", f"must be two numbers, [left, right], not {len(slopes)}")
        kinks, pieces = _polygon(vertices, *(slopes or (0.0, 0.0)))
        return _law("piecewise-linear", kinks, pieces)
    if slopes is not None:
        raise LawError("slopes", "belongs to laws with odd: false; an odd law takes one slope")
    first = vertices[0]
    if first.s.real != 0.0:
        raise LawError(
            "points",
            f"an odd law is given from s = 0 on, but the first point has s = {first.s:g}; "
            "start with [0, b], or write odd: false and give b for all s",
        )
    if first.left not in (0.0, first.right, -first.right):
        raise LawError(
            "points",
            "an odd law jumps at s = 0 between -b and b, but the points say from "
            f"{first.left:g} to {first.right:g}; give one point [0, b]",
        )
    vertices[0] = first._replace(left=first.right)
    kinks, pieces = _polygon(vertices, None, slope or 0.0)
    return _odd("piecewise-linear", kinks, pieces)


def _vertices(points: list[tuple[float, float]]) -> list[_Vertex]:
    """Return one vertex per slip; raise LawError if the points are out of order."""
    vertices: list[_Vertex] = []
    for number, (s, b) in enumerate(points, start=1):
        if vertices and s.real < vertices[-1].s.real:
            raise LawError(
                "points",
                f"s must not decrease, but point {number} has s = {s:g} after "
                f"{vertices[-1].s:g}; put the points in order of s",
            )
        if not vertices or s.real > vertices[-1].s.real:
            vertices.append(_Vertex(s, b, b))
        elif number > 2 and points[number - 3][0].real == s.real:
            raise LawError(
                "points", f"three points have the same s = {s:g}; a jump has two, before and after"
            )
        else:
            vertices[-1] = vertices[-1]._replace(right=b)
    return vertices


def _polygon(
    vertices: list[_Vertex], left_slope: float | None, right_slope: float
) -> tuple[list[float], list[_Piece]]:
    """Return kinks and pieces of a polygonal law, without corners that are straight to rounding.

    The slopes are those beyond the ends. Without a left one the law begins at the first vertex,
    which is not a kink.
    """
    corners = _corners(vertices)
    first, last_corner = corners[0], corners[-1]
    kinks = [corner.s for corner in corners[1:]]
    pieces = [_line(start, end) for start, end in pairwise(corners)]
    pieces.append(_Piece(last_corner.s, last_corner.right, right_slope))
    if left_slope is not None:
        kinks.insert(0, first.s)
        pieces.insert(0, _Piece(first.s, first.left, left_slope))
    if _varied(first.right, right_slope):
        return kinks, pieces
    # a slope goes on beyond its end
    if len(pieces) > 1 and last_corner.left == last_corner.right and pieces[-2].q == right_slope:
        del pieces[-1], kinks[-1]
    if left_slope is None:
        return kinks, pieces
    if len(pieces) > 1 and first.left == first.right and pieces[1].q == left_slope:
        del pieces[0], kinks[0]
    return kinks, pieces


def _corners(vertices: list[_Vertex]) -> list[_Vertex]:
    """Return the vertices without those on the straight line between their corners, to ROUNDING.

    From every corner the slopes that pass all later vertices closely enough form an interval that
    shrinks. The next corner is the last vertex whose slope is in it. The line drawn is the one
    through both corners, so that what is left out costs no other vertex anything.
    """
    if _varied(vertices[0].right):  # nothing is straight beside a vertex that moves alone
        return vertices
    corners = [vertices[0]]
    start = 0
    while start + 1 < len(vertices):
        corner = vertices[start]
        low = -math.inf
        high = math.inf
        end = start + 1
        for i in range(start + 1, len(vertices)):
            vertex = vertices[i]
            distance = vertex.s - corner.s
            rise = vertex.left - corner.right
            if low <= rise / distance <= high:
                end = i
            slack = ROUNDING * max(abs(vertex.left), abs(corner.right))
            low = max(low, (rise - slack) / distance)
            high = min(high, (rise + slack) / distance)
            if low > high or vertex.left != vertex.right:
                break
        start = end
        corners.append(vertices[start])
    return corners


def _line(start: _Vertex, end: _Vertex) -> _Piece:
    """Return the line between two vertices, anchored at the one nearer to s = 0.

    So mirror images stay mirror images.
    """
    slope = (end.left - start.right) / (end.s - start.s)
    if start.s == -end.s and start.right == -end.left and not _varied(start.right):
        return _Piece(0.0, 0.0, slope)
    if abs(start.s) <= abs(end.s):
        return _Piece(start.s, start.right, slope)
    return _Piece(end.s, end.left, slope)


_coefficient = partial(_optional, bound="not negative")


@_shape(
    _coefficient("mu", "coefficient of friction", example="0.3"),
    _coefficient("mu_s", "largest coefficient of sticking, in place of mu", example="0.5"),
    _coefficient("mu_k", "coefficient of large slip", example="0.3"),
    replace(_DELTA, required=False),
)
def coulomb(mu: float | None, mu_s: float | None, mu_k: float | None, delta: float | None) -> Laws:
    """b = mu times the pressure, where the body is pressed; or a coefficient that falls linearly
    from mu_s to mu_k over the slip delta"""
    weakening = (mu_s, mu_k, delta)
    if mu is not None and weakening == (None, None, None):
        return _odd("coulomb", [], [_Piece(0.0, mu)])
    if mu is not None or mu_s is None or mu_k is None or delta is None:
        fault = "the coefficient is either mu, or mu_s, mu_k and delta; give one or the other"
        raise LawError("mu", fault)
    initial = _Piece(0.0, mu_s, (mu_k - mu_s) / delta)
    return _odd("coulomb", [delta], [initial, _Piece(delta, mu_k)])


@_shape(LawParameter("k", "stiffness", STIFFNESS, bound="not negative"))
def linear(k: float) -> Laws:
    """b = k s, a spring"""
    return _law("linear", [], [_Piece(0.0, 0.0, k)])


# -- one-sided laws, of an opening
#
# Kinks and pieces are made of those for s > 0 of a law of slip, with the closing before them.

RIGID = math.inf
"""The closing of surfaces that cannot penetrate each other."""


def one_sided(law: Laws, closing: float = RIGID) -> Laws:
    """Return the law of an opening s: b(s) for s > 0, and what closes the surfaces for s < 0.

    law:     a law of slip, one for all, of which nothing but its values for s > 0 is taken
    closing: RIGID for non-penetration, a ray b̂(0) = (−∞, b(0+)]; or the stiffness of a layer that
             gives way, b = closing × s for s < 0 [Pa/m]

    A strength factor (`Laws.times`, `composed.nodal`) is of b for s > 0 alone. Raises LawError for
    a closing that is not positive.
    """
    if not law.one:
        return law.mapped(lambda single: one_sided(single, closing))
    if not np.real(closing) > 0.0:
        message = f"must be rigid or a stiffness above 0, not {closing:g}"
        raise LawError("closing", message)
    is_rigid = bool(np.isposinf(np.real(closing)))
    opens = np.real(law.upper) > 0.0
    before = _Piece(0.0, -math.inf) if is_rigid else _Piece(0.0, 0.0, closing)
    numbers = [*before, 0.0, 0.0]
    columns = []
    for number, column in zip(numbers, law.pieces, strict=False):
        columns.append(np.append(number, column[opens]))
    kinks = np.append(0.0, law.kinks[np.real(law.kinks) > 0.0])
    definition = law.made
    if definition is not None:
        definition = replace(definition, closing=closing)
    name = f"{law.name}, one-sided"
    return Laws(name, kinks, *columns, made=definition, closing=closing)


def unilateral() -> Laws:
    """Return the law of contact without adhesion: b̂(0) = (−∞, 0], b = 0 for s > 0."""
    return replace(one_sided(NONE), name="unilateral", made=Made("", {}, closing=RIGID))


def knows_pressure(law: Laws) -> bool:
    """Return whether b of a law is a coefficient of friction, which the pressure multiplies."""
    return law.made is not None and law.made.shape == "coulomb"
