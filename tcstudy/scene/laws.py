"""The named shapes of friction laws: from the parameters of a study to a FrictionLaw.

Every shape but a non-odd piecewise-linear one is odd, b(−s) = −b(s), and is written down for s > 0 only;
the mirror image changes signs and nothing else, so the symmetry holds to the bit. b(0+) > 0 is the sticking
up-jump: the filled interval at 0 is [−b(0+), b(0+)], eq. (4) of Šestak & Jovanović (2010).
Left out on purpose: laws that depend on the place on Γ_C or on the normal stress.
"""

from __future__ import annotations

import difflib
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, Literal, NamedTuple

import numpy as np

from tcstudy.scene.friction import FrictionLaw

MAX_TEETH = 10_000
ROUNDING = 8 * float(np.finfo(float).eps)

Dimension = Literal["traction", "length", "stiffness", "none"]
Kind = Literal["number", "integer", "points", "flag", "numbers"]


class LawError(ValueError):
    """A parameter of a friction law is missing, unknown or has no meaning; the text gives the remedy.

    parameter: its name
    """

    def __init__(self, parameter: str, message: str) -> None:
        super().__init__(f"{parameter}: {message}")
        self.parameter = parameter
        self.message = message

    def __reduce__(self) -> tuple[type[LawError], tuple[str, str]]:
        return type(self), (self.parameter, self.message)


@dataclass(frozen=True)
class Parameter:
    """One parameter of a shape.

    name:      key in the study
    dimension: traction [Pa], length [m], stiffness [Pa/m] or none; points are (length, traction) pairs
    required:  whether the study must give it
    default:   value if it does not
    kind:      number, integer, points, flag or numbers
    """

    name: str
    dimension: Dimension
    required: bool = True
    default: object = None
    kind: Kind = "number"


@dataclass(frozen=True)
class Shape:
    """A family of laws under one name.

    parameters: what it takes, in the order of the documentation
    summary:    one line with the formula for s > 0
    """

    name: str
    parameters: tuple[Parameter, ...]
    summary: str
    builder: Callable[..., FrictionLaw]

    def build(self, **values: object) -> FrictionLaw:
        """The law with these parameters (consistent units).

        Raises LawError for a missing, unknown or meaningless parameter, and GrowthError if the law violates
        growth condition (15) or (16).
        """
        names = [parameter.name for parameter in self.parameters]
        for name in values:
            if name not in names:
                near = difflib.get_close_matches(name, names, n=1)
                hint = f"did you mean {near[0]!r}? " if near else ""
                raise LawError(name, f"{self.name} has no such parameter; {hint}it takes {', '.join(names)}")
        law = self.builder(**{p.name: _checked(self.name, p, values) for p in self.parameters})
        law.check_growth()
        return law


class _Piece(NamedTuple):
    """b(s) = p + q s + a exp(−r s)."""

    p: float
    q: float = 0.0
    a: float = 0.0
    r: float = 0.0

    def mirrored(self) -> _Piece:
        """The piece −b(−s)."""
        return _Piece(-self.p, self.q, -self.a, -self.r)


def _law(name: str, kinks: Sequence[float], pieces: Sequence[_Piece]) -> FrictionLaw:
    """A law from its kinks and pieces; a kink between two equal pieces is none and is left out."""
    keep = [i for i in range(len(kinks)) if pieces[i] != pieces[i + 1]]
    kept = [pieces[0], *(pieces[i + 1] for i in keep)]
    p, q, a, r = (np.array(column, dtype=float) + 0.0 for column in zip(*kept, strict=True))
    return FrictionLaw(name, np.array([kinks[i] for i in keep], dtype=float), p, q, a, r)


def _odd(name: str, kinks: Sequence[float], pieces: Sequence[_Piece]) -> FrictionLaw:
    """The odd law whose kinks and pieces for s > 0 are given."""
    left = [piece.mirrored() for piece in reversed(pieces)]
    return _law(name, [*(-s for s in reversed(kinks)), 0.0, *kinks], [*left, *pieces])


def _tresca(tau: float) -> FrictionLaw:
    _not_negative(tau=tau)
    return _odd("tresca", [], [_Piece(tau)])


def _slip_weakening(tau_s: float, tau_k: float, delta: float) -> FrictionLaw:
    _not_negative(tau_s=tau_s, tau_k=tau_k)
    _positive(delta=delta)
    return _odd("slip-weakening", [delta], [_Piece(tau_s, (tau_k - tau_s) / delta), _Piece(tau_k)])


def _exponential(a: float, b: float, delta: float) -> FrictionLaw:
    _not_negative(a=a, b=b)
    _positive(delta=delta)
    piece = _Piece(b) if a == b else _Piece(b, 0.0, a - b, 1.0 / delta)
    return _odd("exponential", [], [piece])


def _saw_tooth(tau: float, delta: float, teeth: int, drop: float, decay: float) -> FrictionLaw:
    """Tooth i = 0 … teeth−1 on (iδ, (i+1)δ): b rises linearly from (1−drop)·peak_i to peak_i = tau·decay^i.

    It falls in a down-jump at its end, the last one to where one more tooth would start, (1−drop)·tau·decay^teeth,
    and stays there.
    """
    _not_negative(tau=tau)
    _positive(delta=delta)
    if not 1 <= teeth <= MAX_TEETH:
        raise LawError("teeth", f"must be from 1 to {MAX_TEETH}, not {teeth}")
    for name, value in (("drop", drop), ("decay", decay)):
        if not 0.0 < value <= 1.0:
            raise LawError(name, f"must be above 0 and at most 1, not {value:g}; it is a fraction of the peak")
    peaks = [tau * decay**i for i in range(teeth + 1)]
    pieces = [_Piece(peak * (1.0 - drop - drop * i), drop * peak / delta) for i, peak in enumerate(peaks[:-1])]
    return _odd("saw-tooth", [i * delta for i in range(1, teeth + 1)], [*pieces, _Piece((1.0 - drop) * peaks[-1])])


def _linear(k: float) -> FrictionLaw:
    _not_negative(k=k)
    return _law("linear", [], [_Piece(0.0, k)])


class _Vertex(NamedTuple):
    """A corner of a polygonal law: b from the left and from the right of s; equal where b only bends."""

    s: float
    left: float
    right: float


def _piecewise_linear(
    points: list[tuple[float, float]], odd: bool, slope: float | None, slopes: list[float] | None
) -> FrictionLaw:
    """Straight between the points, a jump where two have the same s, beyond the ends with the given slopes."""
    vertices = _vertices(points)
    if not odd:
        if slope is not None:
            raise LawError("slope", "belongs to odd laws; with odd: false give slopes: [left, right]")
        if slopes is not None and len(slopes) != 2:
            raise LawError("slopes", f"must be two numbers, [left, right], not {len(slopes)}")
        kinks, pieces = _polygon(vertices, *(slopes or (0.0, 0.0)))
        return _law("piecewise-linear", kinks, pieces)
    if slopes is not None:
        raise LawError("slopes", "belongs to laws with odd: false; an odd law takes one slope")
    first = vertices[0]
    if first.s != 0.0:
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
        if vertices and s < vertices[-1].s:
            raise LawError("points", f"s must not decrease, but point {number} has s = {s:g} after "
                           f"{vertices[-1].s:g}; put the points in order of s")  # fmt: skip
        if not vertices or s > vertices[-1].s:
            vertices.append(_Vertex(s, b, b))
        elif number > 2 and points[number - 3][0] == s:
            raise LawError("points", f"three points have the same s = {s:g}; a jump has two, before and after")
        else:
            vertices[-1] = vertices[-1]._replace(right=b)
    return vertices


def _polygon(vertices: list[_Vertex], left: float | None, right: float) -> tuple[list[float], list[_Piece]]:
    """Kinks and pieces of a polygonal law, without corners that are straight to rounding.

    left, right: slopes beyond the ends; without a left one the law begins at the first vertex, which is no kink
    """
    pairs = list(pairwise(vertices))
    lines = [*(_line(a.s, a.right, (b.left - a.right) / (b.s - a.s)) for a, b in pairs),
             _line(vertices[-1].s, vertices[-1].right, right)]  # fmt: skip
    first = 1 if left is None else 0
    pieces = [lines.pop(0) if left is None else _line(vertices[0].s, vertices[0].left, left)]
    kinks: list[float] = []
    for at, line in enumerate(lines, start=first):
        near = vertices[max(0, at - 1) : at + 2]
        if not _straight(pieces[-1], line, vertices[at], near):
            kinks.append(vertices[at].s)
            pieces.append(line)
    return kinks, pieces


def _line(s: float, b: float, slope: float) -> _Piece:
    """The line through (s, b)."""
    return _Piece(b - slope * s, slope)


def _straight(before: _Piece, after: _Piece, vertex: _Vertex, near: list[_Vertex]) -> bool:
    """True if the law goes straight on at a vertex: the slopes differ by no more than rounding of the points.

    near: the vertex with its neighbours; at an end there is one, and the slope beyond it is exact, as given
    """
    if vertex.left != vertex.right or len(near) < 3:
        return vertex.left == vertex.right and before.q == after.q
    gap = min(b.s - a.s for a, b in pairwise(near))
    size = abs(near[0].right) + abs(vertex.left) + abs(near[2].left) + abs(before.q * vertex.s)
    return abs(before.q - after.q) * gap <= ROUNDING * size


def _not_negative(**values: float) -> None:
    for name, value in values.items():
        if value < 0.0:
            raise LawError(name, f"must be at least 0, not {value:g}: friction opposes the slip; "
                           "for other laws use piecewise-linear")  # fmt: skip


def _positive(**values: float) -> None:
    for name, value in values.items():
        if value <= 0.0:
            raise LawError(name, f"must be above 0, not {value:g}; it is the slip over which the law changes")


def _checked(shape: str, parameter: Parameter, values: Mapping[str, object]) -> Any:
    """The value of a parameter as its kind asks for, or its default."""
    if parameter.name not in values or (values[parameter.name] is None and not parameter.required):
        if parameter.required:
            raise LawError(parameter.name, f"is missing; the law {shape} needs it")
        return parameter.default
    value, name = values[parameter.name], parameter.name
    match parameter.kind:
        case "number":
            return _number(name, value)
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
    pairs = [_items(name, item, "pairs [s, b]") for item in _items(name, value, "pairs [s, b]")]
    if not pairs or any(len(pair) != 2 for pair in pairs):
        raise LawError(name, "must be a list of at least one pair [s, b] of slip and traction")
    return [(_number(name, s), _number(name, b)) for s, b in pairs]


def _items(name: str, value: object, what: str) -> list[object]:
    if isinstance(value, (str, bytes)) or not isinstance(value, (Sequence, np.ndarray)):
        raise LawError(name, f"must be a list of {what}, not {value!r}")
    return list(value)


def _number(name: str, value: object) -> float:
    if isinstance(value, bool) or not isinstance(value, (int, float, np.integer, np.floating)):
        raise LawError(name, f"must be a number, not {value!r}")
    try:
        number = float(value)
    except OverflowError:
        number = math.inf
    if not math.isfinite(number):
        raise LawError(name, "must be a finite number")
    return number


SHAPES: dict[str, Shape] = {
    shape.name: shape
    for shape in (
        Shape("tresca", (Parameter("tau", "traction"),), "b = tau", _tresca),
        Shape(
            "slip-weakening",
            (Parameter("tau_s", "traction"), Parameter("tau_k", "traction"), Parameter("delta", "length")),
            "b falls linearly from tau_s to tau_k over the slip delta (rises if tau_k > tau_s), then b = tau_k",
            _slip_weakening,
        ),
        Shape(
            "exponential",
            (Parameter("a", "traction"), Parameter("b", "traction"), Parameter("delta", "length")),
            "b = (a - b) exp(-s/delta) + b",
            _exponential,
        ),
        Shape(
            "saw-tooth",
            (
                Parameter("tau", "traction"),
                Parameter("delta", "length"),
                Parameter("teeth", "none", kind="integer"),
                Parameter("drop", "none"),
                Parameter("decay", "none", required=False, default=1.0),
            ),
            "teeth i = 0, 1, ... of width delta: b rises linearly from (1 - drop) tau decay^i to tau decay^i and falls "
            "down at the end; after the last tooth b = (1 - drop) tau decay^teeth",
            _saw_tooth,
        ),
        Shape(
            "piecewise-linear",
            (
                Parameter("points", "none", kind="points"),
                Parameter("odd", "none", required=False, default=True, kind="flag"),
                Parameter("slope", "stiffness", required=False),
                Parameter("slopes", "stiffness", required=False, kind="numbers"),
            ),
            "b straight between the points [s, b], a jump where two have the same s, then on with the slope(s), "
            "by default 0; odd: given for s >= 0 and mirrored",
            _piecewise_linear,
        ),
        Shape("linear", (Parameter("k", "stiffness"),), "b = k s, a spring", _linear),
    )
}
"""The shapes by name, as a study writes them."""
