"""Sizes below which a shown number is rounding: it is no data, and tables, pictures and the page
show 0.

Only what is shown is changed. Files, CSV and exports keep the numbers as they were computed.

The scale of a quantity at a point follows from its law, its loads and the size of its body:

    traction       law: largest |b|;  load: largest (|l̃| + |Ã||v|)/c, which the file has as
                   inclusion_rounding × |b| / (√m ε)
    force          traction × contact length, or the largest force at the point
    displacement   traction / λ₁, or the largest displacement at the point
    energy         force × largest slip
    stress         traction, or the largest stress at the point
    temperature    largest ambient, edge or body temperature, and those that heat input makes

A number is rounding below SHARE of its scale, and below the rounding that the file states. Scales
need the study, which every file has as text.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tcstudy.data.reading import by_point, of_largest
from tcstudy.data.schema import GEOMETRIES, PointStatus
from tcstudy.errors import StudyError
from tcstudy.read.study import read_study_text
from tcstudy.scene.points import combinations
from tcstudy.scene.records import Contact, Scene
from tcstudy.scene.study import Study
from tcstudy.shapes.edges import edge_points

Array = NDArray[np.float64]

SHARE = 1e-9
"""Part of the scale of a quantity below which its values are rounding."""
ARC_POINTS = 24
"""Points of an arc whose length is measured."""

KINDS = {
    "traction": re.compile(r"xi|shear_max"),
    "resultant": re.compile(r"friction_resultant"),
    "force": re.compile(r"(reaction|force)_.+_[xy]|section_force(_max)?|layer_force_.+"),
    "displacement": re.compile(r"u_T|u_T_max|u_[xy]|probe_.+_u_[xyT]"),
    "energy": re.compile(r"energy|work_.+"),
    "stress": re.compile(r"von_mises_max|probe_.+_sigma_(xx|yy|xy)"),
    "temperature": re.compile(r"theta|theta_mean(_.+)?|probe_.+_theta"),
}
"""Names in the file of the quantities of each kind."""
SAME_KIND = {"resultant": "force"}
"""Kinds whose values are compared with those of another kind."""


def kind_of_quantity(name: str) -> str:
    """Return the kind of a variable by its name in the file, "" for one that is shown as it is."""
    kinds = (kind for kind, names in KINDS.items() if names.fullmatch(name))
    return next(kinds, "")


def cleared(values: ArrayLike, floor: ArrayLike) -> Array:
    """Return the values with 0 in place of those that are no larger than their floor."""
    values = np.asarray(values, dtype=float)
    return np.where(np.abs(values) <= floor, 0.0, values)


@dataclass(frozen=True)
class SceneScale:
    """What the study says of the scales of one point [units of the file].

    law:         largest |b| of its friction laws, 0 where they have no scale of their own
    frictionless: every law is b = 0, so that a traction is nothing but rounding
    length:      of the contact line, NaN where the study does not know it (bodies from files)
    temperature: largest that an edge, the ambient or heat input can make, NaN for expressions
    """

    law: float
    frictionless: bool
    length: float
    temperature: float

    @classmethod
    def of(cls, scene: Scene) -> SceneScale:
        """Return the scales of a scene."""
        return cls(
            law=max(law.b_scale for law in scene.laws),
            frictionless=all(law.vanishes for law in scene.laws),
            length=_contact_length(scene),
            temperature=_temperature(scene),
        )


UNKNOWN = SceneScale(law=0.0, frictionless=False, length=np.nan, temperature=np.nan)


def _contact_length(scene: Scene) -> float:
    contact = set(scene.edges(Contact))
    edges = [edge for edge in scene.body.edges if edge.name in contact]
    if not edges:
        return float("nan")
    lines = [edge_points(edge, 1 if edge.through is None else ARC_POINTS) for edge in edges]
    return sum(float(np.hypot(*np.diff(line, axis=0).T).sum()) for line in lines)


def _temperature(scene: Scene) -> float:
    heat = scene.heat
    if heat.theta is not None:
        return _largest([heat.theta])
    given = [heat.theta_bar]
    given += [theta_bar for _, _, theta_bar in scene.exchange]
    given += [theta for _, theta in scene.held_theta]
    ends = np.array([edge.end for edge in scene.body.edges])
    if scene.material.k and len(ends):
        extent = float(np.hypot(*np.ptp(ends, axis=0)))
        per_flux = extent / scene.material.k
        inputs = [*(flux for _, flux in scene.flux)]
        return _largest(given) + per_flux * (_largest(inputs) + extent * _largest([heat.q]))
    return _largest(given)


def _largest(scalars: Iterable[Any]) -> float:
    """Return the largest magnitude, NaN where one of them is an expression in x and y."""
    numbers = [abs(one) if isinstance(one, int | float) else np.nan for one in scalars]
    return float(np.max(numbers, initial=0.0))


@dataclass(frozen=True)
class Floors:
    """Sizes up to which the numbers of a sweep are rounding: (P, levels) by kind."""

    by_kind: Mapping[str, Array]

    def of_points(self, places: NDArray[np.intp]) -> Floors:
        """Return the sizes of some points."""
        return Floors({kind: sizes[places] for kind, sizes in self.by_kind.items()})

    def cleared(self, name: str, values: ArrayLike, level: int, place: Any = slice(None)) -> Array:
        """Return values (p, …) of a variable on one level without rounding.

        place: the points that they belong to, by default all
        """
        values = np.asarray(values)
        floor = self.by_kind.get(kind_of_quantity(name))
        if floor is None:
            return values
        own = np.asarray(floor[place, level])
        return cleared(values, own.reshape(own.shape + (1,) * (values.ndim - own.ndim)))


def stored_study(about: Mapping[str, Any], swept: bool = True) -> Study | None:
    """Return the study of a result file, or of one of its geometries, by its global attributes;
    None if its text cannot be read, as one of another version may be. The file of a body is not
    needed.

    swept: with its points, of which each costs half a millisecond; else the one scene outside the
    sweep
    """
    text, overrides = str(about.get("study_yaml", "")), str(about.get("overrides", ""))
    told = [one for one in overrides.split("\n") if one] + ([] if swept else ["sweep=null"])
    try:
        return read_study_text(text, "study", told, with_files=False)
    except (StudyError, OSError):
        return None


MOST_SCENES = 2_000
"""Points whose own scenes a summary reads, 0.1 ms each; of more, the scene outside the sweep gives
the scales."""


def floors_of(data: Any) -> Floors:
    """Return the sizes below which the numbers of a run's root dataset are rounding.

    Of several geometries each takes 4 ms to read; their laws and loads have the scales of the scene
    outside the sweep, their contact lines those of their meshes.
    """
    several = GEOMETRIES in data.attrs
    swept = not several and data["status"].isel(level=0).size <= MOST_SCENES
    study = stored_study(data.attrs, swept)
    return floors(data, study, usual_lengths=several)


def floors(data: Any, study: Study | None, usual_lengths: bool = False) -> Floors:
    """Return the floors of a run's root dataset, whose study this is, None if it cannot be read.

    usual_lengths: whether contact lines have the lengths that their meshes tell, not the study
    """
    data = of_largest(data)
    solved = by_point(data["status"], data) == int(PointStatus.OK)

    def flat(name: str, unknown: float = np.nan) -> Array:
        if name not in data:
            return np.full(solved.shape, unknown)
        own = np.asarray(by_point(data[name], data), dtype=float)
        return np.broadcast_to(own if own.ndim > 1 else own[:, None], solved.shape)

    scales = _scales(study, len(solved))
    largest = {kind: np.zeros(solved.shape) for kind in KINDS}
    for name, kind in _quantities(data):
        sizes = np.abs(np.nan_to_num(flat(name)))
        kind = SAME_KIND.get(kind, kind)
        largest[kind] = np.maximum(largest[kind], sizes)
    law = np.where(scales["law"] > 0.0, scales["law"], largest["traction"])
    rounding = np.nan_to_num(flat("inclusion_rounding"))
    nodes = np.maximum(data["n_contact"].values, 1)
    load = rounding / (np.sqrt(nodes) * np.finfo(float).eps)
    traction = law * np.maximum(rounding, SHARE * np.minimum(load, 1.0))
    usual_length = data["h_max"].values * nodes
    known = np.isfinite(scales["length"]) & (not usual_lengths)
    length = np.where(known, scales["length"], usual_length)
    lambda_1 = flat("lambda_1")
    softest = np.where(lambda_1 > 0.0, lambda_1, np.inf)
    force = traction * length
    frictionless = scales["frictionless"] > 0.0
    by_kind = {
        "traction": np.where(frictionless, np.inf, traction),
        "resultant": np.where(frictionless, np.inf, force),
        "force": np.maximum(force, SHARE * largest["force"]),
        "displacement": np.maximum(traction / softest, SHARE * largest["displacement"]),
        "energy": force * largest["displacement"],
        "stress": np.maximum(traction, SHARE * largest["stress"]),
        "temperature": SHARE * np.nan_to_num(scales["temperature"] + 0.0 * traction),
    }
    return Floors({kind: np.where(solved, size, 0.0) for kind, size in by_kind.items()})


def _quantities(data: Any) -> Iterator[tuple[str, str]]:
    """Yield the numbers by point and level that have a kind, with it."""
    dims = set(data["status"].dims)
    for name in data.data_vars:
        kind = kind_of_quantity(str(name))
        if kind and set(data[name].dims) == dims:
            yield str(name), kind


def _scales(study: Study | None, points: int) -> dict[str, Array]:
    """Return the fields of `SceneScale` of every point as (P, 1) arrays, or those of one scene."""
    scales, which = [UNKNOWN], np.zeros(1, dtype=np.intp)
    if study is not None:
        scenes, of_point = combinations(
            study.scenes, "body", "boundary", "material", "heat", "friction"
        )
        scales = [SceneScale.of(scene) for scene in scenes]
        which = of_point if len(of_point) == points else which
    names = ("law", "frictionless", "length", "temperature")
    return {name: _column(scales, name)[which] for name in names}


def _column(scales: Sequence[SceneScale], name: str) -> Array:
    return np.array([[float(getattr(scale, name))] for scale in scales])


def line_floor(xi: ArrayLike, c: ArrayLike) -> float:
    """Return the size below which ∫ξ of the states (…, m) of one path or history is rounding."""
    largest = np.max(np.abs(np.nan_to_num(np.asarray(xi, dtype=float))), initial=0.0)
    return SHARE * float(largest) * float(np.sum(c))
