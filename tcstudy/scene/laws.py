"""The named shapes of friction laws: from the parameters of a study to a FrictionLaw.

`tcstudy.scene.law_pieces` says what the shapes are; here stand their parameters and the checks of their values.
Left out on purpose: laws that depend on the place on Γ_C or on the normal stress.
"""

from __future__ import annotations

import difflib
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from tcstudy.scene import law_pieces as pieces
from tcstudy.scene.friction import FrictionLaw
from tcstudy.scene.law_pieces import LawError

LawDimension = Literal["traction", "length", "stiffness", "none"]

Kind = Literal["number", "integer", "points", "flag", "numbers"]


@dataclass(frozen=True)
class LawParameter:
    """One parameter of a shape.

    name:      key in the study
    dimension: traction [Pa], length [m], stiffness [Pa/m] or none; points are (length, traction) pairs
    required:  whether the study must give it
    default:   value if it does not
    kind:      number, integer, points, flag or numbers
    """

    name: str
    dimension: LawDimension
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
    parameters: tuple[LawParameter, ...]
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


def _checked(shape: str, parameter: LawParameter, values: Mapping[str, object]) -> Any:
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
        Shape("tresca", (LawParameter("tau", "traction"),), "b = tau", pieces.tresca),
        Shape(
            "slip-weakening",
            (LawParameter("tau_s", "traction"), LawParameter("tau_k", "traction"), LawParameter("delta", "length")),
            "b falls linearly from tau_s to tau_k over the slip delta (rises if tau_k > tau_s), then b = tau_k",
            pieces.slip_weakening,
        ),
        Shape(
            "exponential",
            (LawParameter("a", "traction"), LawParameter("b", "traction"), LawParameter("delta", "length")),
            "b = (a - b) exp(-s/delta) + b",
            pieces.exponential,
        ),
        Shape(
            "saw-tooth",
            (
                LawParameter("tau", "traction"),
                LawParameter("delta", "length"),
                LawParameter("teeth", "none", kind="integer"),
                LawParameter("drop", "none"),
                LawParameter("decay", "none", required=False, default=1.0),
            ),
            "teeth i = 0, 1, ... of width delta: b rises linearly from (1 - drop) tau decay^i to tau decay^i and falls "
            "down at the end; after the last tooth b = (1 - drop) tau decay^teeth",
            pieces.saw_tooth,
        ),
        Shape(
            "piecewise-linear",
            (
                LawParameter("points", "none", kind="points"),
                LawParameter("odd", "none", required=False, default=True, kind="flag"),
                LawParameter("slope", "stiffness", required=False),
                LawParameter("slopes", "stiffness", required=False, kind="numbers"),
            ),
            "b straight between the points [s, b], a jump where two have the same s, then on with the slope(s), "
            "by default 0; odd: given for s >= 0 and mirrored",
            pieces.piecewise_linear,
        ),
        Shape("linear", (LawParameter("k", "stiffness"),), "b = k s, a spring", pieces.linear),
    )
}
"""The shapes by name, as a study writes them."""
