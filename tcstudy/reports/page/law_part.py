"""What the page has of friction laws: curves to draw, and the shape with its parameters where that can be told.

A `FrictionLaw` keeps its pieces, not what the study wrote. For sliders the parameters are read off the law by its
values alone and put to the test: the shape built from them must be the same law to rounding.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise
from typing import Any

import numpy as np

from tcstudy.reports.page.container import Container, Json
from tcstudy.reports.page.stored import (
    DOWN,
    SHAPES,
    UP,
    EdgeLaws,
    FrictionLaw,
    LineFields,
    Study,
    file_order,
)

SAMPLES = 60
ROUNDING = 1e-12


def law_part(study: Study | None) -> Json | None:
    """The different laws of a study and which one every point has; None if the study does not say.

    Where friction differs along the contact line a point has a law of every edge, in the order of `edges`.
    """
    if study is None:
        return None
    numbers: dict[FrictionLaw, int] = {}
    frictions = [study.scenes[i].friction for i in file_order(study)]
    index: list[Json] = []
    for friction in frictions:
        own = [law for _, law, _ in friction.laws] if isinstance(friction, EdgeLaws) else [friction]
        found = [numbers.setdefault(law, len(numbers)) for law in own]
        index.append(found if isinstance(friction, EdgeLaws) else found[0])
    told: Json = {"laws": [drawn(law) for law in numbers], "index": index}
    return (
        told | {"edges": [edge for edge, _, _ in first.laws]} if isinstance(first := frictions[0], EdgeLaws) else told
    )


def node_part(study: Study | None, line: LineFields, box: Container) -> Json:
    """By edge: which of the edges' laws a node has, the different strengths along the line and which a point has."""
    frictions = [] if study is None else [study.scenes[i].friction for i in file_order(study)]
    found = [
        friction.along(line.edge_names, line.edge, np.stack([line.x, line.y], axis=1))
        for friction in frictions
        if isinstance(friction, EdgeLaws)
    ]
    if not found:
        return {}
    rows, which = np.unique([strength for _, strength in found], axis=0, return_inverse=True)
    return {"of_law": box.array(found[0][0], "i1"), "strengths": box.rows(rows), "strength_of": which.ravel().tolist()}


def drawn(law: FrictionLaw) -> Json:
    """A law as polylines and jumps; `spec` has its parameters, None if they cannot be told."""
    reach = _reach(law)
    drawn_to = reach or 1.0  # a law without a length of its own is straight as far as one looks
    ends = np.concatenate([[-drawn_to], law.kinks, [drawn_to]])
    curves = []
    for a, b in pairwise(ends):
        s = np.linspace(a, b, SAMPLES if not law.piecewise_linear else 2)
        middle = np.full(len(s), law.piece(0.5 * (a + b)))
        curves.append([s.tolist(), law.value(s, middle).tolist()])
    jumps = [
        [float(law.kinks[k]), float(law.b_left[k]), float(law.b_right[k]), int(law.kinds[k])]
        for k in range(len(law.kinks))
        if law.kinds[k] in (UP, DOWN)
    ]
    return {"name": law.name, "omega": law.omega, "reach": reach, "curves": curves, "jumps": jumps, "spec": spec(law)}


def _reach(law: FrictionLaw) -> float:
    """Largest |s| drawn: past the outermost kink and some decay lengths; 0 for a law without either."""
    outermost = float(np.abs(law.kinks).max(initial=0.0))
    decay = law.s_scale if not law.piecewise_linear else 0.0
    return max(1.4 * outermost, 6.0 * decay)


def spec(law: FrictionLaw) -> Json | None:
    """{"law": shape, parameters}, tested against the law itself; None if no shape gives it."""
    reader = _READERS.get(law.name)
    for read in (reader, _points):
        if read is None:
            continue
        try:
            parameters = read(law)
            shape = law.name if read is reader else "piecewise-linear"
            if parameters is not None and _same(SHAPES[shape].build(**parameters), law):
                return {"law": shape, **parameters}
        except (ValueError, IndexError, ZeroDivisionError, FloatingPointError):
            continue
    return None


def _same(one: FrictionLaw, other: FrictionLaw) -> bool:
    """Whether two laws have the same kinks and values to rounding."""
    if len(one.kinks) != len(other.kinks):
        return False
    size = float(np.max(np.abs(other.kinks), initial=0.0))
    reach = _reach(other) or 1.0
    if np.any(np.abs(one.kinks - other.kinks) > ROUNDING * size):
        return False
    ends = np.concatenate([[-reach], other.kinks, [reach]])
    middles = 0.5 * (ends[1:] + ends[:-1])
    places = np.concatenate([middles, middles + 0.3 * (ends[1:] - middles), [-7.0 * reach, 7.0 * reach]])
    scale = float(np.max(np.abs(other.b(places)), initial=0.0)) + other.b_scale
    return bool(np.all(np.abs(one.b(places) - other.b(places)) <= ROUNDING * 100 * scale))


def _right(law: FrictionLaw) -> tuple[list[float], list[float], list[float]]:
    """Kinks at s > 0 with b before and behind them."""
    ks = [k for k in range(len(law.kinks)) if law.kinks[k] > 0.0]
    return ([float(law.kinks[k]) for k in ks], [float(law.b_left[k]) for k in ks], [float(law.b_right[k]) for k in ks])


def _at_zero(law: FrictionLaw) -> float:
    return float(law.b(0.0, +1))


def _tresca(law: FrictionLaw) -> dict[str, Any]:
    return {"tau": _at_zero(law)}


def _slip_weakening(law: FrictionLaw) -> dict[str, Any]:
    s, left, _ = _right(law)
    return {"tau_s": _at_zero(law), "tau_k": left[0], "delta": s[0]}


def _exponential(law: FrictionLaw) -> dict[str, Any] | None:
    rest = float(law.b(1e6 * law.s_scale))
    return {"a": _at_zero(law), "b": rest, "delta": law.s_scale} if law.s_scale > 0.0 else None


def _saw_tooth(law: FrictionLaw) -> dict[str, Any] | None:
    s, left, right = _right(law)
    if not s:
        return None
    drop = 1.0 - _at_zero(law) / left[0]
    decay = right[0] / _at_zero(law)
    return {"tau": left[0], "delta": s[0], "teeth": len(s), "drop": drop, "decay": decay}


def _linear(law: FrictionLaw) -> dict[str, Any]:
    return {"k": float(law.slope(0.0, law.piece(0.0)))}


def _points(law: FrictionLaw) -> dict[str, Any] | None:
    """The corner points of an odd law with straight pieces."""
    if not law.piecewise_linear:
        return None
    s, left, right = _right(law)
    points = [[0.0, _at_zero(law)]]
    for place, before, behind in zip(s, left, right, strict=True):
        points.append([place, before])
        if behind != before:
            points.append([place, behind])
    last = (s[-1] if s else 0.0) + 1.0
    return {"points": points, "slope": float(law.slope(last, law.piece(last)))}


_READERS: dict[str, Callable[[FrictionLaw], dict[str, Any] | None]] = {
    "tresca": _tresca,
    "slip-weakening": _slip_weakening,
    "exponential": _exponential,
    "saw-tooth": _saw_tooth,
    "linear": _linear,
    "piecewise-linear": _points,
}
