"""The loads that a study gives, wherever they enter: one walk over edges, sections and sweeps, over
paths, histories, fits and their tables, and over an exact solution.

A load is known from the scene that it makes: a value of a path, a step or a row of a table is put
into its scene as the solver has it, and the numbers in which the load of that scene is affine are
its loads (scene/parameters.py). A new load of an edge is found as soon as it is among these.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tcstudy.expressions.expression import NEGATIVE, Expression, Scalar, Term
from tcstudy.expressions.expression import NUMBER as NUMBER_TERM
from tcstudy.fem.geometry import Geometry
from tcstudy.scene.fit_plan import FitPlan
from tcstudy.scene.histories import HistoryPlan
from tcstudy.scene.parameters import Keys, affine_numbers, loaded_scene, path_scene
from tcstudy.scene.points import distinct
from tcstudy.scene.records import Body, Contact, Scene
from tcstudy.scene.study import Study
from tcstudy.scene.units import TEMPERATURE, Dimension
from tcstudy.shapes.edges import body_area, body_size, boundary_lengths, edge_points

Array = NDArray[np.float64]
Range = tuple[float, float]

MAX_SCENES_WALKED = 500
"""Scenes of a sweep that are all walked over; of more, those with an extreme of a swept number."""
EDGE_PIECES = 16
"""Pieces of an edge at whose ends fields are looked at."""
SECTIONS = ("boundary", "heat", "f", "material")
"""Sections of a scene that loads enter."""
SHORT_SECTIONS = ("heat", "loads")
"""Sections whose keys a study may write without them."""


@dataclass(frozen=True)
class Measures:
    """Sizes of a body, of an outline or of a CAD file.

    size: diagonal of the box around it [m];  area: [m²];  lengths: of the edges by name [m]
    points: (n, 2) places on its boundary, at which fields are looked at [m]
    """

    size: float
    area: float
    lengths: Mapping[str, float]
    points: Array

    @classmethod
    def of(cls, body: Body, geometry: Geometry | None) -> Measures:
        """Return those of a body. geometry: of a body from a CAD file."""
        if geometry is None:
            points = np.concatenate([edge_points(edge, EDGE_PIECES) for edge in body.edges])
            return cls(body_size(body), body_area(body), boundary_lengths(body), points)
        points = np.concatenate([piece for _, piece, _ in geometry.samples(EDGE_PIECES + 1)])
        lengths = dict[str, float]()
        for curve in geometry.curves:
            lengths[curve.name] = lengths.get(curve.name, 0.0) + curve.length
        return cls(geometry.size, geometry.area, lengths, points)

    def contact(self, scene: Scene) -> float:
        """Return the length of the contact line [m]."""
        return sum(self.lengths.get(name, 0.0) for name in scene.edges(Contact))


@dataclass(frozen=True)
class Load:
    """A number or a field that loads a scene.

    key: its path in the study, as short as a study may write it;  value: in SI
    scene: that it loads; None of a measured or an exact value
    """

    key: str
    value: Scalar
    dimension: Dimension
    scene: Scene | None = None

    def values(self, points: Array) -> Array:
        """Return the value, or those of a field at points (n, 2), where they are finite."""
        if not isinstance(self.value, Expression):
            return np.array([self.value], dtype=float)
        field = self.value.evaluate(*points.T)
        return field[np.isfinite(field)]

    @property
    def constants(self) -> list[float]:
        """The value, or the numbers that a field adds to what varies in it."""
        if not isinstance(self.value, Expression):
            return [float(self.value)]
        return list(_added(self.value.root))


def _added(term: Term) -> Iterator[float]:
    """Yield the numbers among the terms of a sum."""
    terms = [(1.0, term)]
    while terms:
        sign, part = terms.pop()
        if part.name == NUMBER_TERM:
            yield sign * part.value
        elif part.name == NEGATIVE:
            terms.append((-sign, part.parts[0]))
        elif part.name in ("+", "-"):
            second = sign if part.name == "+" else -sign
            terms += [(sign, part.parts[0]), (second, part.parts[1])]


def loads(study: Study, of_interest: Range) -> Iterator[Load]:
    """Yield every load of a study, and every temperature that it measures or knows.

    of_interest: a range; of many values of a number the extremes are yielded, and one in this range
    """
    for scene in loaded_scenes(study, of_interest):
        yield from _of_scene(scene)
    for test in (study, *study.tests):
        if test.fit is not None:
            yield from _temperatures_of_fit(test.fit)
    if study.exact is not None and study.exact.theta is not None:
        yield Load("exact.theta", study.exact.theta, TEMPERATURE)


def _of_scene(scene: Scene) -> Iterator[Load]:
    for keys, number in affine_numbers(scene):
        if keys != ("load",):
            yield Load(written_key(keys), number.value, number.row.dimension, scene)


def written_key(keys: Keys) -> str:
    """Return the path of a key without a section that a study may leave out."""
    return ".".join(keys[1:] if keys[0] in SHORT_SECTIONS else keys)


def loaded_scenes(study: Study, of_interest: Range) -> Iterator[Scene]:
    """Yield the scenes that a run goes through.

    These are points of the sweep, a path with the ends of its parameter, or a load history or a fit
    with the extremes of their loads.
    """
    if study.kind == "path" and study.path is not None:
        for value in (study.path.begin, study.path.end, *study.path.at):
            yield path_scene(study.path.scene, study.path.parameter, value)
        return
    for test in (study, *study.tests):
        yield from walked_scenes(test, of_interest, *SECTIONS)
        if test.history is not None:
            yield from _scenes_of(test.scenes[0], _history_values(test.history), of_interest)
        if test.fit is not None:
            yield from _scenes_of(test.fit.scene, _table_values(test.fit), of_interest)


def _scenes_of(
    scene: Scene, values: Mapping[Keys, Sequence[float]], of_interest: Range
) -> Iterator[Scene]:
    """Yield the scene with each of the telling values of its loads alone."""
    for keys, column in values.items():
        for value in telling(column, of_interest):
            yield loaded_scene(scene, {keys: value})


def _history_values(history: HistoryPlan) -> dict[Keys, list[float]]:
    stations = history.stations()
    return {keys: [station[keys] for station in stations] for keys, *_ in history.parameters}


def _table_values(fit: FitPlan) -> dict[Keys, tuple[float, ...]]:
    return {column.path: column.values for column in fit.loads}


def _temperatures_of_fit(fit: FitPlan) -> Iterator[Load]:
    """Yield what a fit measures, and where it seeks a temperature."""
    for column in fit.measured:
        if column.dimension == TEMPERATURE:
            for value in column.values:
                yield Load(column.name, value, TEMPERATURE)
    for parameter in fit.parameters:
        if parameter.number.units == TEMPERATURE.cf:
            for value in (parameter.start, parameter.low, parameter.high):
                yield Load(parameter.number.name, value, TEMPERATURE)


def telling(values: Iterable[float], of_interest: Range) -> list[float]:
    """Return the extremes of values, and the first of them within a range."""
    column = list(values)
    if not column:
        return []
    within = [value for value in column if of_interest[0] <= value <= of_interest[1]]
    return list(dict.fromkeys([min(column), max(column), *within[:1]]))


def walked_scenes(study: Study, of_interest: Range, *sections: str) -> Sequence[Scene]:
    """Return a scene for each combination of sections of a sweep.

    Of many points these are the points with a telling value of a swept parameter.
    """
    if len(study.scenes) <= MAX_SCENES_WALKED:
        return distinct(study.scenes, *sections)
    rows = np.arange(len(study.scenes)).reshape(study.shape)
    chosen = {0: None}
    for number, axis in enumerate(study.axes):
        places: Iterable[int] = range(len(axis.labels))
        if not any(isinstance(label, str) for label in axis.labels):
            labels = [float(label) for label in axis.labels]
            places = [labels.index(value) for value in telling(labels, of_interest)]
        for place in places:
            row = rows.take(place, axis=number if study.mode == "grid" else 0)
            chosen[int(np.ravel(row)[0])] = None
    return [study.scenes[row] for row in chosen]
