"""Sizes below which a number is rounding, so that tables, pictures and the page show 0.

Only what is shown is changed. Files, CSV and exports keep the numbers as they were computed.

The scale of a quantity at a point follows from its law, its loads and the size of its body:

    traction       law: largest |b|;  load: largest (|l̃| + |Ã||v|)/c, which the file has as
                   inclusion_rounding × |b| / (√m ε)
    force          traction × contact length, or the largest force at the point
    displacement   traction / λ₁, or the largest displacement at the point
    energy         force × largest slip
    normal         the largest normal stress of contact at the point
    opening        the largest opening at the point
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
SEGMENTS_OF_ARC = 24
"""Straight segments by which the length of an arc is measured."""

KINDS = {
    "traction": re.compile(r"xi|shear_max"),
    "resultant": re.compile(r"friction_resultant"),
    "force": re.compile(
        r"(reaction|force)_.+_[xy]|section_force(_max)?|layer_force_.+|adhesion_resultant"
    ),
    "displacement": re.compile(r"u_T|u_T_max|u_[xy]|probe_.+_u_[xyT]"),
    "energy": re.compile(r"energy|work_.+"),
    "normal": re.compile(r"S_N|peel_stress_max|pressure_max"),
    "opening": re.compile(r"opening(_max)?"),
    "stress": re.compile(r"von_mises_max|probe_.+_sigma_(xx|yy|xy)"),
    "temperature": re.compile(r"theta|theta_mean(_.+)?|probe_.+_theta"),
}
"""Names in the file of the quantities of each kind."""
SAME_KIND = {"resultant": "force"}
"""Kinds whose values are compared with those of another kind."""


def kind_of_quantity(name: str) -> str:
    """Return the kind of a variable by its name in the file; "" for one without a kind."""
    for kind, names in KINDS.items():
        if names.fullmatch(name):
            return kind
    return ""


def cleared(values: ArrayLike, floor: ArrayLike) -> Array:
    """Return the values with 0 in place of those that are no larger than their floor."""
    values = np.asarray(values, dtype=float)
    return np.where(np.abs(values) <= floor, 0.0, values)


@dataclass(frozen=True)
class SceneScale:
    """Scales of one point that follow from the study [units of the file].

    law:         largest |b| of its friction laws, 0 where they have no scale of their own
    frictionless: every law is b = 0, so that a traction is nothing but rounding
    length:      of the contact line, NaN where the study does not have it (bodies from files)
    temperature: largest that an edge, the ambient or heat input can cause, NaN for expressions
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
    length = 0.0
    for edge in edges:
        is_straight = edge.through is None
        points = edge_points(edge, 1 if is_straight else SEGMENTS_OF_ARC)
        length += float(np.hypot(*np.diff(points, axis=0).T).sum())
    return length


def _temperature(scene: Scene) -> float:
    heat = scene.heat
    if heat.theta is not None:
        return _largest([heat.theta])
    temperatures = [heat.theta_bar]
    temperatures += [theta_bar for _, _, theta_bar in scene.exchange]
    temperatures += [theta for _, theta in scene.held_theta]
    ends = np.array([edge.end for edge in scene.body.edges])
    if scene.material.k and len(ends):
        extent = float(np.hypot(*np.ptp(ends, axis=0)))
        per_flux = extent / scene.material.k
        fluxes = [flux for _, flux in scene.flux]
        flux_scale = _largest(fluxes) + extent * _largest([heat.q])
        return _largest(temperatures) + per_flux * flux_scale
    return _largest(temperatures)


def _largest(scalars: Iterable[Any]) -> float:
    """Return the largest magnitude, NaN where one of them is an expression in x and y."""
    magnitudes = [abs(scalar) if isinstance(scalar, int | float) else np.nan for scalar in scalars]
    return float(np.max(magnitudes, initial=0.0))


@dataclass(frozen=True)
class Floors:
    """Sizes up to which the numbers of a sweep are rounding: (P, levels) by kind."""

    by_kind: Mapping[str, Array]

    def of_points(self, places: NDArray[np.intp]) -> Floors:
        """Return the floors of some points, by their indices."""
        return Floors({kind: sizes[places] for kind, sizes in self.by_kind.items()})

    def cleared(self, name: str, values: ArrayLike, level: int, place: Any = slice(None)) -> Array:
        """Return values (p, …) of a variable on one level, with 0 in place of rounding.

        place: indices of the p points, by default all
        """
        values = np.asarray(values)
        floor = self.by_kind.get(kind_of_quantity(name))
        if floor is None:
            return values
        floor = np.asarray(floor[place, level])
        trailing = (1,) * (values.ndim - floor.ndim)
        return cleared(values, floor.reshape(floor.shape + trailing))


def stored_study(about: Mapping[str, Any], swept: bool = True) -> Study | None:
    """Return the study of a result file, or of one of its geometries, by its global attributes.

    None if its text cannot be read, as that of another version may be. The file of a body is not
    needed.

    swept: with its points, each of which takes half a millisecond; else the scene outside the sweep
    """
    text = str(about.get("study_yaml", ""))
    overrides = [line for line in str(about.get("overrides", "")).split("\n") if line]
    if not swept:
        overrides.append("sweep=null")
    try:
        return read_study_text(text, "study", overrides, with_files=False)
    except (StudyError, OSError):
        return None


MAX_SCENES = 2_000
"""Points whose scenes are read, 0.1 ms each; of more, only the scene outside the sweep is read."""


def floors_of(data: Any) -> Floors:
    """Return the sizes below which the numbers of a run's root dataset are rounding.

    Each of several geometries would take 4 ms to read. Their laws and loads have the scales of the
    scene outside the sweep, their contact lines the lengths of their meshes.
    """
    several = GEOMETRIES in data.attrs
    swept = not several and data["status"].isel(level=0).size <= MAX_SCENES
    study = stored_study(data.attrs, swept)
    return floors(data, study, usual_lengths=several)


def floors(data: Any, study: Study | None, usual_lengths: bool = False) -> Floors:
    """Return the floors of the root dataset of a run; study: None if it cannot be read.

    usual_lengths: take the lengths of contact lines from their meshes, not from the study
    """
    data = of_largest(data)
    solved = by_point(data["status"], data) == int(PointStatus.OK)

    def by_level(name: str) -> Array:
        """Return (P, levels) values of a variable, NaN if the file does not have it."""
        if name not in data:
            return np.full(solved.shape, np.nan)
        values = np.asarray(by_point(data[name], data), dtype=float)
        if values.ndim == 1:
            values = values[:, None]
        return np.broadcast_to(values, solved.shape)

    scales = _scales(study, len(solved))
    largest = {kind: np.zeros(solved.shape) for kind in KINDS}
    for name, kind in _quantities(data):
        sizes = np.abs(np.nan_to_num(by_level(name)))
        kind = SAME_KIND.get(kind, kind)
        largest[kind] = np.maximum(largest[kind], sizes)

    law = np.where(scales["law"] > 0.0, scales["law"], largest["traction"])
    rounding = np.nan_to_num(by_level("inclusion_rounding"))
    nodes = np.maximum(data["n_contact"].values, 1)
    load = rounding / (np.sqrt(nodes) * np.finfo(float).eps)
    traction = law * np.maximum(rounding, SHARE * np.minimum(load, 1.0))
    usual_length = data["h_max"].values * nodes
    has_length = np.isfinite(scales["length"]) & (not usual_lengths)
    length = np.where(has_length, scales["length"], usual_length)
    lambda_1 = by_level("lambda_1")
    softest = np.where(lambda_1 > 0.0, lambda_1, np.inf)
    force = traction * length
    frictionless = scales["frictionless"] > 0.0
    by_kind = {
        "traction": np.where(frictionless, np.inf, traction),
        "resultant": np.where(frictionless, np.inf, force),
        "force": np.maximum(force, SHARE * largest["force"]),
        "displacement": np.maximum(traction / softest, SHARE * largest["displacement"]),
        "energy": force * largest["displacement"],
        "normal": SHARE * largest["normal"],
        "opening": SHARE * largest["opening"],
        "stress": np.maximum(traction, SHARE * largest["stress"]),
        "temperature": SHARE * np.nan_to_num(scales["temperature"] + 0.0 * traction),
    }
    return Floors({kind: np.where(solved, size, 0.0) for kind, size in by_kind.items()})


def _quantities(data: Any) -> Iterator[tuple[str, str]]:
    """Yield (name, kind) of the numbers by point and level that have a kind."""
    dims = set(data["status"].dims)
    for name in data.data_vars:
        kind = kind_of_quantity(str(name))
        if kind and set(data[name].dims) == dims:
            yield str(name), kind


def _scales(study: Study | None, points: int) -> dict[str, Array]:
    """Return the fields of `SceneScale` of every point as (P, 1) arrays, or those of one scene."""
    scales, scale_of_point = [UNKNOWN], np.zeros(1, dtype=np.intp)
    if study is not None:
        scenes, scene_of_point = combinations(
            study.scenes, "body", "boundary", "material", "heat", "friction"
        )
        scales = [SceneScale.of(scene) for scene in scenes]
        if len(scene_of_point) == points:
            scale_of_point = scene_of_point
    names = ("law", "frictionless", "length", "temperature")
    return {name: _column(scales, name)[scale_of_point] for name in names}


def _column(scales: Sequence[SceneScale], name: str) -> Array:
    return np.array([[float(getattr(scale, name))] for scale in scales])


def line_floor(xi: ArrayLike, c: ArrayLike) -> float:
    """Return the size below which ∫ξ of the states (…, m) of one path or history is rounding."""
    largest = np.max(np.abs(np.nan_to_num(np.asarray(xi, dtype=float))), initial=0.0)
    return SHARE * float(largest) * float(np.sum(c))


def resultant_floor(data: Any) -> float:
    """Return the size below which ∫ξ of the states of one path or history is rounding.

    Where edges may open, their normal stresses count as well.
    """
    floor = line_floor(data["xi"], data["c"])
    if "S_N" in data:
        floor = max(floor, line_floor(data["S_N"], data["c_N"]))
    return floor
