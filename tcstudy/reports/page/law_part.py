"""What the page has of friction laws: curves to draw, and the pieces by which it solves; it knows no law by name."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tcstudy.laws.composed import EdgeLaws
from tcstudy.laws.laws import Laws
from tcstudy.laws.pieces import DOWN, UP
from tcstudy.reports.figures.law import curves, slip_range
from tcstudy.reports.page.container import Container, Json
from tcstudy.reports.page.stored import Stored
from tcstudy.reports.picture import LineFields
from tcstudy.scene.points import combinations

SAMPLES, DECAYS = 60, 6.0
"""Points on a curved piece, and how many decay lengths of a law are drawn."""


def law_part(stored: Stored) -> Json | None:
    """The different laws of a study and which one every point has; None if the study does not say.

    Where friction differs along the contact line a point has a law of every edge, in the order of `edges`.
    """
    if stored.study is None or not stored.swept:
        return None
    numbers: dict[Laws, int] = {}
    index: list[Json] = []
    edges: Json = {}
    frictions, of = frictions_of(stored)
    for friction in frictions:
        if isinstance(friction, EdgeLaws):
            index.append([numbers.setdefault(law, len(numbers)) for _, law, _ in friction.laws])
            edges = {"edges": [edge for edge, _, _ in friction.laws]}
        else:
            index.append(numbers.setdefault(friction, len(numbers)))
    return {"laws": [drawn(law) for law in numbers], "index": [index[k] for k in of], **edges}


def frictions_of(stored: Stored) -> tuple[list[Laws | EdgeLaws], NDArray[np.intp]]:
    """The different frictions of a study, and which of them every point of its file has that is kept."""
    if stored.study is None or not stored.swept:
        return [], np.empty(0, dtype=np.intp)
    some, of = combinations(stored.study.scenes, "friction")
    of = of if stored.kept is None else of[stored.kept]
    _, first = np.unique(of, return_index=True)
    order = of[np.sort(first)]  # as the file has them
    return [some[k].friction for k in order], np.argsort(order)[of]


def node_part(stored: Stored, line: LineFields, box: Container) -> Json:
    """By edge: which of the edges' laws a node has, the different strengths along the line and which a point has.

    A joint has none of them (-1), but a mixture, which is not drawn.
    """
    frictions, of = frictions_of(stored)
    xy, distinct = np.stack([line.x, line.y], axis=1), [one for one in frictions if isinstance(one, EdgeLaws)]
    if not distinct:
        return {}
    factors = np.stack([one.factors(line.edge_names, line.edge, xy, line.joints) for one in distinct])
    has = ~np.isnan(factors[0])
    mixed = has.sum(axis=0) > 1
    rows, which = np.unique(np.where(mixed, 1.0, np.nanmax(factors, axis=1)), axis=0, return_inverse=True)
    of_law = np.where(mixed, -1, np.argmax(has, axis=0))
    return {"of_law": box.array(of_law, "i1"), "strengths": box.rows(rows), "strength_of": which.ravel()[of].tolist()}


def drawn(law: Laws) -> Json:
    """A law as polylines and jumps, and as the pieces that it is made of, by which the page solves."""
    reach = slip_range(law, DECAYS)
    # a law without a length of its own is straight as far as one looks
    drawn = [[s.tolist(), b.tolist()] for s, b in curves(law, reach or 1.0, SAMPLES)]
    jumps = [
        [float(law.kinks[k]), float(law.b_left[k]), float(law.b_right[k]), int(law.kinds[k])]
        for k in range(len(law.kinks))
        if law.kinds[k] in (UP, DOWN)
    ]
    numbers = (law.kinks, law.kinds, law.s_0, law.b_0, law.q, law.a, law.r)
    pieces = dict(zip(("kinks", "kinds", "s0", "b0", "q", "a", "r"), (one.tolist() for one in numbers), strict=True))
    return {"name": law.name, "omega": law.omega, "reach": reach, "curves": drawn, "jumps": jumps,
            "pieces": pieces if law.a_2 is None else None}  # fmt: skip
