"""The named shapes of friction laws: their parameters, the checks of their values, and the pieces
of the law.

Every shape but a non-odd piecewise-linear one is odd, b(−s) = −b(s), and is written down for s > 0
only; the mirror image changes signs and nothing else, so the symmetry holds to the bit. b(0+) > 0
is the sticking up-jump: the filled interval at 0 is [−b(0+), b(0+)], eq. (4) of Šestak & Jovanović
(2010).
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

from tcstudy.laws.laws import Laws, Made

MAX_TEETH = 10_000
ROUNDING = 2 * float(np.finfo(float).eps)
"""Corners nearer than this to the straight line between their neighbours, relative to b there, are
none."""

Builder = TypeVar("Builder", bound=Callable[..., Laws])


class LawError(ValueError):
    """A parameter of a friction law is missing, unknown or has no meaning; the text gives the
    remedy.

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
        """The piece −b(−s)."""
        return _Piece(-self.s_0, -self.b_0, self.q, -self.a, -self.r)

    def goes_on_as(self, other: _Piece) -> bool:
        """True if both are the same function; a constant has no anchor."""
        return self[1:] == other[1:] and (
            self.s_0 == other.s_0 or (self.q == 0.0 and self.a == 0.0)
        )


def _law(name: str, kinks: Sequence[float], pieces: Sequence[_Piece]) -> Laws:
    """A law from its kinks and pieces; a kink between two equal pieces is none and is left out."""
    keep = [i for i in range(len(kinks)) if not pieces[i].goes_on_as(pieces[i + 1])]
    kept = [pieces[0], *(pieces[i + 1] for i in keep)]
    columns = (np.array(column) + 0.0 for column in zip(*kept, strict=True))
    return Laws(
        name,
        np.array([kinks[i] for i in keep], dtype=complex if _varied(*kinks) else float),
        *columns,
    )


def _varied(*numbers: float | None) -> bool:
    """Whether some are complex: those of a law that is to be differentiated."""
    return any(isinstance(x, complex) for x in numbers)


def _odd(name: str, kinks: Sequence[float], pieces: Sequence[_Piece]) -> Laws:
    """The odd law whose kinks and pieces for s > 0 are given."""
    left = [piece.mirrored() for piece in reversed(pieces)]
    return _law(name, [*(-s for s in reversed(kinks)), 0.0, *kinks], [*left, *pieces])


@dataclass(frozen=True)
class LawParameter:
    """A parameter of a shape.

    dimension: SI unit of its numbers;  meaning: in a line;  example: a value as it is suggested, "" that of the unit
    kind:      "number", "integer", "flag", "numbers" or "law points"
    default:   what stands for it if it is not given and not required;  least: of a number
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


LENGTH, TRACTION, STIFFNESS, ENERGY = "m", "Pa", "Pa/m", "J/m^2"
_traction = partial(LawParameter, dimension=TRACTION, bound="not negative")
_slip = partial(LawParameter, dimension=LENGTH, bound="positive")
_TAU = _traction("tau", "traction, of a saw-tooth its first peak")
_DELTA = _slip(
    "delta", "slip over which b falls, of a saw-tooth the width of a tooth", example="40 um"
)
_PEAK = _traction("tau", "traction at its peak", example="4 MPa")
_S0 = _slip("s0", "slip at the end of the elastic branch", example="20 um")
_optional = partial(LawParameter, required=False)
_SF = _optional("sf", "slip at which nothing is left; or give G_f", LENGTH, "200 um")
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
        """The law with these parameters (consistent units).

        Raises LawError for a missing, unknown or meaningless parameter, GrowthError unless (15) and
        (16) hold.
        """
        names = [parameter.name for parameter in self.parameters]
        if name := next((name for name in values if name not in names), ""):
            near = difflib.get_close_matches(name, names, n=1)
            hint = f"did you mean {near[0]!r}? " if near else ""
            raise LawError(
                name, f"{self.name} has no such parameter; {hint}it takes {', '.join(names)}"
            )
        given = {p.name: _checked(self.name, p, values.get(p.name)) for p in self.parameters}
        law = replace(self.builder(**given), made=Made(self.name, given))
        law.check_growth()
        return law


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
        "must be at least 0, not {:g}: friction opposes the slip; for other laws use piecewise-linear",
    ),
}


def _checked(shape: str, parameter: LawParameter, value: object) -> Any:
    """The value of a parameter as its kind asks for, or its default."""
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
            pairs = [
                _items(name, item, "pairs [s, b]") for item in _items(name, value, "pairs [s, b]")
            ]
            if not pairs or any(len(pair) != 2 for pair in pairs):
                raise LawError(
                    name, "must be a list of at least one pair [s, b] of slip and traction"
                )
            return [(_number(name, s), _number(name, b)) for s, b in pairs]
    number = _number(name, value)
    holds, message = _BOUNDS.get(parameter.bound, (np.isfinite, ""))
    if not holds(number):
        raise LawError(name, message.format(number))
    return number


def _items(name: str, value: object, what: str) -> list[object]:
    if isinstance(value, (str, bytes)) or not isinstance(value, (Sequence, np.ndarray)):
        raise LawError(name, f"must be a list of {what}, not {value!r}")
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
    """Puts a builder of laws among the shapes, under its name; its docstring is the summary."""

    def register(builder: Builder) -> Builder:
        name = builder.__name__.replace("_", "-")
        SHAPES[name] = Shape(name, parameters, " ".join((builder.__doc__ or "").split()), builder)
        return builder

    return register


@_shape(_TAU)
def tresca(tau: float) -> Laws:
    """b = tau"""
    return _odd("tresca", [], [_Piece(0.0, tau)])


@_shape(_traction("tau_s", "traction of rest"), _traction("tau_k", "of slip"), _DELTA)
def slip_weakening(tau_s: float, tau_k: float, delta: float) -> Laws:
    """b falls linearly from tau_s to tau_k over the slip delta (rises if tau_k > tau_s), then b =
    tau_k"""
    return _odd(
        "slip-weakening",
        [delta],
        [_Piece(0.0, tau_s, (tau_k - tau_s) / delta), _Piece(delta, tau_k)],
    )


@_shape(_traction("a", "traction of rest"), _traction("b", "of much slip"), _DELTA)
def exponential(a: float, b: float, delta: float) -> Laws:
    """b = (a - b) exp(-s/delta) + b"""
    piece = _Piece(0.0, b) if a == b else _Piece(0.0, b, 0.0, a - b, 1.0 / delta)
    return _odd("exponential", [], [piece])


@_shape(
    _TAU,
    _DELTA,
    LawParameter("teeth", "their number", example="3", kind="integer", least=1),
    LawParameter(
        "drop", "share of its peak that b falls by after a tooth", example="0.5", bound="share"
    ),
    _optional("decay", "each peak over the one before", example="0.5", default=1.0, bound="share"),
)
def saw_tooth(tau: float, delta: float, teeth: int, drop: float, decay: float) -> Laws:
    """teeth i = 0, 1, ... of width delta: b rises linearly from (1 - drop) tau decay^i to tau
    decay^i and falls down at the end; after the last tooth b = (1 - drop) tau decay^teeth
    """
    if not 1 <= teeth <= MAX_TEETH:
        raise LawError("teeth", f"must be from 1 to {MAX_TEETH}, not {teeth}")
    peaks = [tau * decay**i for i in range(teeth + 1)]
    pieces = [
        _Piece(i * delta, (1.0 - drop) * peak, drop * peak / delta)
        for i, peak in enumerate(peaks[:-1])
    ]
    pieces.append(_Piece(teeth * delta, (1.0 - drop) * peaks[-1]))
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
    """b rises linearly from 0 to tau over s0, falls linearly to 0 at sf (so that G_f = tau sf/2),
    then b = 0"""
    return _interface("bilinear", tau, (s0, tau), (_debonded(tau, s0, s0, sf, G_f), 0.0))


@_shape(
    _PEAK, _S0, LawParameter("s1", "slip at the end of the plateau", LENGTH, "100 um"), _SF, _GF
)
def trapezoidal(tau: float, s0: float, s1: float, sf: float | None, G_f: float | None) -> Laws:
    """b rises linearly from 0 to tau over s0, stays to s1, falls linearly to 0 at sf (G_f = tau (sf
    + s1 - s0)/2)"""
    return _interface(
        "trapezoidal", tau, (s0, tau), (s1, tau), (_debonded(tau, s0, s1, sf, G_f), 0.0)
    )


@_shape(
    _PEAK, _S0, replace(_SF, meaning="slip at which b has fallen to tau_r", required=True),
    _traction("tau_r", "traction that is left", example="1 MPa"),
)  # fmt: skip
def trilinear(tau: float, s0: float, sf: float, tau_r: float) -> Laws:
    """b rises linearly from 0 to tau over s0, falls linearly to tau_r at sf, then b = tau_r"""
    return _interface("trilinear", tau, (s0, tau), (sf, tau_r))


def _debonded(tau: float, s0: float, s1: float, sf: float | None, energy: float | None) -> float:
    """The slip at which a law that falls from tau at s1 has reached 0: sf, or as the energy below
    it says."""
    if sf is not None and energy is not None:
        raise LawError("G_f", "follows from sf; give one of the two")
    if sf is not None:
        return sf
    if energy is None:
        raise LawError(
            "sf",
            "is missing; give the slip sf at which nothing is left, or the fracture energy G_f",
        )
    if not tau > 0.0:
        raise LawError("tau", _BOUNDS["positive"][1].format(tau))
    end = 2.0 * energy / tau - (s1 - s0)
    if not end > s1:
        least = tau * (s1 - 0.5 * s0)
        raise LawError(
            "G_f",
            f"must be above {least:g} J/m^2, what is below b up to s = {s1:g} m, not {energy:g}",
        )
    return end


def _interface(name: str, tau: float, *corners: tuple[float, float]) -> Laws:
    """The odd law through 0 and these corners (s, b), constant after the last."""
    names = ("s0", "s1", "sf") if len(corners) == 3 else ("s0", "sf")
    for (before, (least, _)), (after, (s, _)) in pairwise(zip(names, corners, strict=False)):
        if not s > least:
            raise LawError(after, f"must be above {before} = {least:g}, not {s:g}")
    pieces = [_Piece(0.0, 0.0, tau / corners[0][0])]
    pieces += [_Piece(s, b, (after - b) / (end - s)) for (s, b), (end, after) in pairwise(corners)]
    return _odd(name, [s for s, _ in corners], [*pieces, _Piece(*corners[-1])])


class _Vertex(NamedTuple):
    """A corner of a polygonal law: b on both sides of s; equal where b only bends."""

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
        raise LawError("points", f"an odd law is given from s = 0 on, but the first point has s = {first.s:g}; "
                       "start with [0, b], or write odd: false and give b for all s")  # fmt: skip
    if first.left not in (0.0, first.right, -first.right):
        raise LawError("points", f"an odd law jumps at s = 0 between -b and b, but the points say from "
                       f"{first.left:g} to {first.right:g}; give one point [0, b]")  # fmt: skip
    kinks, pieces = _polygon([first._replace(left=first.right), *vertices[1:]], None, slope or 0.0)
    return _odd("piecewise-linear", kinks, pieces)


def _vertices(points: list[tuple[float, float]]) -> list[_Vertex]:
    """The points in one vertex per slip; raises LawError if they are out of order."""
    vertices: list[_Vertex] = []
    for number, (s, b) in enumerate(points, start=1):
        if vertices and s.real < vertices[-1].s.real:
            raise LawError("points", f"s must not decrease, but point {number} has s = {s:g} after "
                           f"{vertices[-1].s:g}; put the points in order of s")  # fmt: skip
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
    vertices: list[_Vertex], left: float | None, right: float
) -> tuple[list[float], list[_Piece]]:
    """Kinks and pieces of a polygonal law, without corners that are straight to rounding.

    left, right: slopes beyond the ends; without a left one the law begins at the first vertex,
    which is no kink
    """
    corners = _corners(vertices)
    lines = [_line(a, b) for a, b in pairwise(corners)]
    first, last = corners[0], corners[-1]
    outer = [] if left is None else [(first, _Piece(first.s, first.left, left))]
    pieces = [line for _, line in outer] + lines + [_Piece(last.s, last.right, right)]
    kinks = [corner.s for corner in (corners if outer else corners[1:])]
    # a slope goes on beyond its end
    fixed = not _varied(first.right, right)
    if fixed and len(pieces) > 1 and last.left == last.right and pieces[-2].q == right:
        del pieces[-1], kinks[-1]
    if fixed and outer and len(pieces) > 1 and first.left == first.right and pieces[1].q == left:
        del pieces[0], kinks[0]
    return kinks, pieces


def _corners(vertices: list[_Vertex]) -> list[_Vertex]:
    """The vertices without those that lie on the straight line between the corners beside them, to
    ROUNDING.

    From every corner the slopes that pass all later vertices closely enough form an interval that
    shrinks; the next corner is the last vertex that is seen within it. The line drawn is the one
    through both corners, so that what is left out costs no other vertex anything.
    """
    corners, at = [vertices[0]], 0
    if _varied(vertices[0].right):  # of one that moves alone nothing is straight
        return vertices
    while at + 1 < len(vertices):
        begin, low, high, end = vertices[at], -math.inf, math.inf, at + 1
        for i in range(at + 1, len(vertices)):
            vertex = vertices[i]
            apart, rise = vertex.s - begin.s, vertex.left - begin.right
            if low <= rise / apart <= high:
                end = i
            slack = ROUNDING * max(abs(vertex.left), abs(begin.right))
            low, high = max(low, (rise - slack) / apart), min(high, (rise + slack) / apart)
            if low > high or vertex.left != vertex.right:
                break
        at = end
        corners.append(vertices[at])
    return corners


def _line(a: _Vertex, b: _Vertex) -> _Piece:
    """The line between two vertices, anchored at the one nearer to s = 0, so that mirror images
    stay mirror images."""
    slope = (b.left - a.right) / (b.s - a.s)
    if a.s == -b.s and a.right == -b.left and not _varied(a.right):
        return _Piece(0.0, 0.0, slope)
    return _Piece(a.s, a.right, slope) if abs(a.s) <= abs(b.s) else _Piece(b.s, b.left, slope)


@_shape(LawParameter("k", "stiffness", STIFFNESS, bound="not negative"))
def linear(k: float) -> Laws:
    """b = k s, a spring"""
    return _law("linear", [], [_Piece(0.0, 0.0, k)])
