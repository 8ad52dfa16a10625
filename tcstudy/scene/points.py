"""The scenes of a sweep by each section's few records, and the number of the record of each point.

Also here: swept parameters that change nothing. A user should know them before he takes equal rows
for a result.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any, Literal, overload

import numpy as np
from numpy.typing import NDArray

from tcstudy.expressions.expression import Expression
from tcstudy.laws.composed import EdgeLaws
from tcstudy.laws.laws import Laws
from tcstudy.laws.pieces import REGIONS, UP
from tcstudy.scene.records import Body, Boundary, EdgeHeat, Scalar, Scene, exchanges
from tcstudy.scene.study import Study

Array = NDArray[np.float64]

SECTIONS = ("body", "boundary", "material", "f", "heat", "friction", "adhesion")
"""Fields of a scene."""
GEOMETRIC = ("body", "mesh")
"""Sections that make a geometry: what is swept of them is the outer loop of a run."""
Which = NDArray[np.int32]


class Scenes(Sequence[Scene]):
    """One scene for each point of a sweep, in C order of its axes, made when it is asked for.

    A sweep of 10⁶ points has a few records in each section: what is asked of all scenes is asked of
    `distinct` ones.
    """

    def __init__(self, records: Mapping[str, Sequence[Any]], which: Mapping[str, Which]) -> None:
        """Keep the records of each section, and the index of the record of each point (P,)."""
        self.records = {section: tuple(records[section]) for section in SECTIONS}
        self.which = {section: np.asarray(which[section], dtype=np.int32) for section in SECTIONS}
        self._combinations: dict[tuple[str, ...], tuple[NDArray[np.intp], NDArray[np.intp]]] = {}

    @classmethod
    def of(cls, scenes: Sequence[Scene]) -> Scenes:
        """Return scenes that exist already; equal records are kept once."""
        if isinstance(scenes, Scenes):
            return scenes
        points = np.arange(len(scenes), dtype=np.int32)
        records = {}
        for section in SECTIONS:
            records[section] = [getattr(scene, section) for scene in scenes]
        return cls.joined([(cls(records, dict.fromkeys(SECTIONS, points)), points)])

    @classmethod
    def joined(cls, parts: Sequence[tuple[Sequence[Scene], NDArray[np.integer]]]) -> Scenes:
        """Return the scenes of several sweeps, each repeated at its places in the joined one.

        Equal records are kept once.
        """
        numbers: dict[str, dict[Any, int]] = {section: {} for section in SECTIONS}
        total = sum(len(places) for _, places in parts)
        which = {section: np.empty(total, dtype=np.int32) for section in SECTIONS}
        for scenes, places in parts:
            part = cls.of(scenes)
            for section, number_of in numbers.items():
                new_numbers = [
                    number_of.setdefault(record, len(number_of)) for record in part.records[section]
                ]
                by_point = np.array(new_numbers, dtype=np.int32)[part.which[section]]
                which[section][places] = np.resize(by_point, len(places))
        return cls({section: tuple(number_of) for section, number_of in numbers.items()}, which)

    def on(self, body: Body) -> Scenes:
        """Return the same scenes on another body."""
        return Scenes(self.records | {"body": (body,)}, self.which)

    def __len__(self) -> int:
        return len(self.which["friction"])

    @overload
    def __getitem__(self, index: int) -> Scene: ...
    @overload
    def __getitem__(self, index: slice) -> tuple[Scene, ...]: ...
    def __getitem__(self, index: int | slice) -> Scene | tuple[Scene, ...]:
        if isinstance(index, slice):
            return tuple(self[i] for i in range(*index.indices(len(self))))
        records = {}
        for section in SECTIONS:
            records[section] = self.records[section][self.which[section][index]]
        return Scene(**records)

    def __repr__(self) -> str:
        return f"<{len(self)} scenes>"

    def combined(self, *sections: str) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        """Return the first point with each distinct combination of the sections.

        The second array (P,) has the number of the combination of each point.
        """
        if sections not in self._combinations:
            code = np.zeros(len(self), dtype=np.int64)
            for section in sections:
                code = code * len(self.records[section]) + self.which[section]
            _, first, combination = np.unique(code, return_index=True, return_inverse=True)
            order = np.argsort(first)
            rank = np.empty_like(order)
            rank[order] = np.arange(len(order))
            self._combinations[sections] = first[order], rank[combination]
        return self._combinations[sections]


def distinct(scenes: Sequence[Scene], *sections: str) -> tuple[Scene, ...]:
    """Return one scene for each distinct combination of the sections, in the order of points."""
    return combinations(scenes, *sections)[0]


def combinations(
    scenes: Sequence[Scene], *sections: str
) -> tuple[tuple[Scene, ...], NDArray[np.intp]]:
    """Return the `distinct` scenes, and (P,) the number of the one that each point is like."""
    if len(scenes) == 1:  # as in each of many geometries
        return (scenes[0],), np.zeros(1, dtype=np.intp)
    scenes = Scenes.of(scenes)
    first, combination = scenes.combined(*sections)
    return tuple(scenes[int(i)] for i in first), combination


def law_regions(
    scenes: Sequence[Scene], section: Literal["friction", "adhesion"] = "friction"
) -> set[str]:
    """Return the regions of the laws of all scenes (laws.pieces.REGIONS).

    "breathing" is among them if a law sticks.
    """
    records: Sequence[Laws | EdgeLaws | None] = Scenes.of(scenes).records[section]
    single_laws = list[Laws]()
    for record in records:
        if isinstance(record, EdgeLaws):
            single_laws += [law for _, law, _ in record.laws]
        elif record is not None:
            single_laws.append(record)
    if not single_laws:
        return set()
    laws = Laws.of(single_laws)
    regions = {REGIONS[number] for number in np.unique(laws.regions)}
    if np.any(laws.kinds == UP):
        regions.add("breathing")
    return regions


def count_points(
    scenes: Sequence[Scene], sections: Sequence[str], is_so: Callable[[Scene], bool]
) -> int:
    """Return the number of points that satisfy a condition on the sections named."""
    distinct_scenes, combination = combinations(scenes, *sections)
    satisfied = np.array([is_so(scene) for scene in distinct_scenes], dtype=np.intp)
    points = np.bincount(combination, minlength=len(distinct_scenes))
    return int(points @ satisfied)


def of_stiffness(scenes: Sequence[Scene]) -> tuple[str, ...]:
    """Return the sections that decide about the stiffness of the body.

    They are the material, and the boundary if an edge has springs.
    """
    springs = any(scene.springs for scene in distinct(scenes, "boundary"))
    return ("material", "boundary") if springs else ("material",)


LOADS = ("boundary", "f", "heat")
"""Sections that hold the loads of a scene, the first also its supports."""


def load_axes(study: Study) -> tuple[int, ...]:
    """Return the numbers of the numeric axes of a grid along which only loads change.

    Loads are forces, prescribed displacements and temperatures.
    """
    if study.mode != "grid" or not study.scenes:
        return ()
    scenes = Scenes.of(study.scenes)
    fixed = [scenes.which[section] for section in SECTIONS if section not in LOADS]
    support_numbers = dict[object, int]()
    support_of_boundary = np.array(
        [
            support_numbers.setdefault(_support(boundary), len(support_numbers))
            for boundary in scenes.records["boundary"]
        ]
    )
    fixed.append(support_of_boundary[scenes.which["boundary"]])
    alpha = np.array([heat.alpha for heat in scenes.records["heat"]])
    fixed.append(alpha[scenes.which["heat"]])
    axes = list[int]()
    for d, axis in enumerate(study.axes):
        has_texts = any(isinstance(label, str) for label in axis.labels)
        if len(axis.labels) < 2 or has_texts:
            continue
        if all(_constant(which.reshape(study.shape), d) for which in fixed):
            axes.append(d)
    return tuple(axes)


def _support(boundary: Boundary) -> tuple[object, ...]:
    """Return what of a boundary is no load: roles, held components, springs, heat transfer."""
    edges = list[object]()
    for name, role in boundary:
        alpha = role.heat and role.heat.alpha
        is_free = tuple(component is None for component in role.u)
        edges.append((name, role.word, role.frame, role.spring, alpha, is_free))
    return tuple(edges)


def _constant(values: NDArray[Any], axis: int) -> bool:
    """Return whether values do not change along an axis."""
    return bool(np.all(values == values.take([0], axis=axis)))


THERMAL = ("heat", "material")
"""Sections of which a scene may need only a part."""
FELT = ("boundary", *THERMAL)
"""Sections that decide what a scene needs of heat."""


UNIFORM = "q is 0 and all given temperatures are equal, so theta is that temperature everywhere"


def no_heat(scene: Scene) -> str:
    """Return why the temperature need not be computed; empty if it must."""
    if not scene.material.expands:
        return "alpha_T (or beta) is 0, so temperature does not load the body"
    if scene.heat.theta is not None:
        return "theta is known"
    if not scene.conducts:
        return "the study has no heat"
    temperatures = set(_edge_temperatures(scene))
    varies = any(isinstance(theta, Expression) for theta in temperatures)
    is_heated = isinstance(scene.heat.q, Expression) or scene.heat.q != 0.0 or scene.flux
    return "" if len(temperatures) > 1 or varies or is_heated else UNIFORM


def _edge_temperatures(scene: Scene) -> list[Scalar]:
    """Return the ambient and prescribed temperatures of edges."""
    ambient = [theta_bar for _, _, theta_bar in scene.exchange]
    return ambient + [theta for _, theta in scene.held_theta]


def needs_heat_solve(scene: Scene) -> bool:
    """Return whether the temperature must be computed and is not simply known."""
    return not no_heat(scene)


def why_no_heat(scenes: Sequence[Scene]) -> str:
    """Return why scenes without a heat problem have none."""
    reasons = filter(None, map(no_heat, distinct(scenes, *FELT)))
    return "; or ".join(dict.fromkeys(reasons))


OWN_HEAT = ("alpha", "theta_bar")
"""Numbers of the section `heat` that an edge may have of its own."""


def why_idle(keys: Sequence[str], scenes: Sequence[Scene]) -> str:
    """Return why a thermal number of scenes changes none of their solutions.

    keys: its path, ("heat", "alpha")
    """
    reasons = [no_heat(scene) for scene in distinct(scenes, *FELT)]
    if keys[0] == "heat" and keys[-1] in OWN_HEAT and not {"", UNIFORM}.isdisjoint(reasons):
        edges = list[EdgeHeat]()
        for scene in distinct(scenes, "boundary"):
            edges += [role.heat or EdgeHeat() for _, role in scene.boundary if exchanges(role)]
        if not edges:
            return "no edge exchanges heat"
        if all(getattr(edge, keys[-1]) is not None for edge in edges):
            return f"every edge that exchanges heat has its own {keys[-1]}"
    return why_no_heat(scenes)


def _is_thermal(keys: Sequence[str]) -> bool:
    """Return whether a number acts on the solution only through the temperature.

    Moduli of the material count as well; `_felt` compares them.
    """
    of_edge = keys[0] == "boundary" and ("heat" in keys or keys[-1] in (*OWN_HEAT, "flux"))
    return of_edge or keys[0] in ("heat", "material", "materials")


def idle_notes(study: Study) -> list[str]:
    """Return one sentence for every axis of a grid whose values all give the same solutions.

    They do because heat is left out.
    """
    thermal = [
        (d, axis)
        for d, axis in enumerate(study.axes)
        if len(axis.labels) > 1 and _is_thermal(axis.path)
    ]
    if study.mode != "grid" or not thermal:
        return []
    scenes, combination = combinations(study.scenes, *FELT)
    numbers = dict[tuple[object, ...], int]()
    alike = [numbers.setdefault(tuple(_felt(scene)), len(numbers)) for scene in scenes]
    points = np.array(alike)[combination].reshape(study.shape)
    notes = list[str]()
    for d, axis in thermal:
        if _constant(points, d):
            why = why_idle(axis.path, study.scenes)
            equal = f"its {len(axis.labels)} values give equal solutions"
            notes.append(f"{axis.name} changes nothing ({why}): {equal}")
    return notes


def _felt(scene: Scene) -> Iterator[object]:
    """Yield all thermal data and moduli that act on the solution of a scene."""
    heat = scene.heat
    materials = scene.material.all
    yield from ((material.lam, material.mu) for material in materials)
    if needs_heat_solve(scene):
        yield from ((material.beta, material.k) for material in materials)
        yield heat.q, heat.omega, scene.exchange, scene.held_theta, scene.flux
    elif scene.material.expands:
        yield from (material.beta for material in materials)
        yield heat.theta if heat.theta is not None else tuple(_edge_temperatures(scene)[:1])
