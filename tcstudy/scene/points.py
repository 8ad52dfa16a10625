"""The scenes of a sweep without a list of them: each section's few records, and which one every
point has.

Swept parameters that change nothing, which the user should know before he reads equal rows as a
finding.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from itertools import chain
from typing import Any, overload

import numpy as np
from numpy.typing import NDArray

from tcstudy.expressions.expression import Expression
from tcstudy.laws.composed import EdgeLaws
from tcstudy.laws.laws import Laws
from tcstudy.laws.pieces import REGIONS, UP
from tcstudy.scene.records import Body, Boundary, EdgeHeat, Scene, exchanges
from tcstudy.scene.study import Study

Array = NDArray[np.float64]

SECTIONS = ("body", "boundary", "material", "f", "heat", "friction")
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
        """records: that points have, of each section;  which: (P,) index of that of each point, by section."""
        self.records = {section: tuple(records[section]) for section in SECTIONS}
        self.which = {section: np.asarray(which[section], dtype=np.int32) for section in SECTIONS}
        self._combinations: dict[tuple[str, ...], tuple[NDArray[np.intp], NDArray[np.intp]]] = {}

    @classmethod
    def of(cls, scenes: Sequence[Scene]) -> Scenes:
        """Scenes that are there already; equal records are kept once."""
        if isinstance(scenes, Scenes):
            return scenes
        every = np.arange(len(scenes), dtype=np.int32)
        one_each = cls(
            {s: [getattr(x, s) for x in scenes] for s in SECTIONS}, dict.fromkeys(SECTIONS, every)
        )
        return cls.joined([(one_each, every)])

    @classmethod
    def joined(cls, parts: Sequence[tuple[Sequence[Scene], NDArray[np.integer]]]) -> Scenes:
        """Return the scenes of several sweeps, each repeated at its places in the joined one.

        Equal records are kept once.
        """
        known: dict[str, dict[Any, int]] = {section: {} for section in SECTIONS}
        total = sum(len(places) for _, places in parts)
        which = {section: np.empty(total, dtype=np.int32) for section in SECTIONS}
        for scenes, places in parts:
            part = cls.of(scenes)
            for section, records in known.items():
                numbers = [records.setdefault(x, len(records)) for x in part.records[section]]
                of_points = np.array(numbers, dtype=np.int32)[part.which[section]]
                which[section][places] = np.resize(of_points, len(places))
        return cls({section: tuple(records) for section, records in known.items()}, which)

    def on(self, body: Body) -> Scenes:
        """The same on another body."""
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
        return Scene(
            **{section: self.records[section][self.which[section][index]] for section in SECTIONS}
        )

    def __repr__(self) -> str:
        return f"<{len(self)} scenes>"

    def combined(self, *sections: str) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        """(first, of): a point with each distinct combination of the sections, and (P,) the
        combination of a point."""
        if sections not in self._combinations:
            code = np.zeros(len(self), dtype=np.int64)
            for section in sections:
                code = code * len(self.records[section]) + self.which[section]
            _, first, of = np.unique(code, return_index=True, return_inverse=True)
            order = np.argsort(first)
            rank = np.empty_like(order)
            rank[order] = np.arange(len(order))
            self._combinations[sections] = first[order], rank[of]
        return self._combinations[sections]


def distinct(scenes: Sequence[Scene], *sections: str) -> tuple[Scene, ...]:
    """One scene for each distinct combination of the sections, in the order of the points."""
    return combinations(scenes, *sections)[0]


def combinations(
    scenes: Sequence[Scene], *sections: str
) -> tuple[tuple[Scene, ...], NDArray[np.intp]]:
    """`distinct` scenes, and (P,) which of them each point is like."""
    if len(scenes) == 1:  # as in each of many geometries
        return (scenes[0],), np.zeros(1, dtype=np.intp)
    scenes = Scenes.of(scenes)
    first, of = scenes.combined(*sections)
    return tuple(scenes[int(i)] for i in first), of


def law_regions(scenes: Sequence[Scene]) -> set[str]:
    """What the laws of all scenes do on some piece (laws.pieces.REGIONS), and "breathing" where one
    sticks."""
    records: Sequence[Laws | EdgeLaws] = Scenes.of(scenes).records["friction"]
    own = (
        [law for _, law, _ in one.laws] if isinstance(one, EdgeLaws) else [one] for one in records
    )
    laws = Laws.of(list(chain.from_iterable(own)))
    return {REGIONS[k] for k in np.unique(laws.regions)} | (
        {"breathing"} if np.any(laws.kinds == UP) else set()
    )


def count_points(
    scenes: Sequence[Scene], sections: Sequence[str], is_so: Callable[[Scene], bool]
) -> int:
    """Return the number of points that satisfy a condition on the sections named."""
    some, of = combinations(scenes, *sections)
    satisfied = np.array([is_so(scene) for scene in some], dtype=np.intp)
    return int(np.bincount(of, minlength=len(some)) @ satisfied)


def of_stiffness(scenes: Sequence[Scene]) -> tuple[str, ...]:
    """Sections that decide about the stiffness of the body: the material, and springs if an edge
    has any."""
    springs = any(scene.springs for scene in distinct(scenes, "boundary"))
    return ("material", "boundary") if springs else ("material",)


LOADS = ("boundary", "f", "heat")
"""Sections that hold the loads of a scene, the first also its supports."""


def load_axes(study: Study) -> tuple[int, ...]:
    """Return the numbers of the numeric axes of a grid along which nothing but loads changes:
    forces, prescribed displacements, temperatures."""
    if study.mode != "grid" or not study.scenes:
        return ()
    scenes = Scenes.of(study.scenes)
    fixed = [scenes.which[section] for section in SECTIONS if section not in LOADS]
    supports = dict[object, int]()
    of_boundary = np.array(
        [supports.setdefault(_support(one), len(supports)) for one in scenes.records["boundary"]]
    )
    fixed.append(of_boundary[scenes.which["boundary"]])
    alpha = np.array([heat.alpha for heat in scenes.records["heat"]])
    fixed.append(alpha[scenes.which["heat"]])
    return tuple(
        d
        for d, axis in enumerate(study.axes)
        if len(axis.labels) > 1
        and not any(isinstance(label, str) for label in axis.labels)
        and all(_constant(which.reshape(study.shape), d) for which in fixed)
    )


def _support(boundary: Boundary) -> tuple[object, ...]:
    """Return what of a boundary is no load: roles, held components, springs, heat transfer."""
    edges = (
        (name, role.word, role.frame, role.spring, role.heat and role.heat.alpha, role.u)
        for name, role in boundary
    )
    return tuple((*about, tuple(x is None for x in u)) for *about, u in edges)


def _constant(values: NDArray[Any], axis: int) -> bool:
    """Return whether values do not change along an axis."""
    return bool(np.all(values == values.take([0], axis=axis)))


THERMAL = ("heat", "material")
"""Sections of which a scene may need only a part."""
FELT = ("boundary", *THERMAL)
"""Sections that decide what a scene needs of heat."""


UNIFORM = "q is 0 and all given temperatures are equal, so theta is that temperature everywhere"


def no_heat(scene: Scene) -> str:
    """Why the temperature need not be computed; empty if it must."""
    if not scene.material.expands:
        return "beta is 0, so temperature does not load the body"
    if scene.heat.theta is not None:
        return "theta is known"
    if not scene.conducts:
        return "the study has no heat"
    given = {theta_bar for _, _, theta_bar in scene.exchange} | {
        theta for _, theta in scene.held_theta
    }
    varies = len(given) > 1 or any(isinstance(theta, Expression) for theta in given)
    heated = isinstance(scene.heat.q, Expression) or scene.heat.q != 0.0 or scene.flux
    return "" if varies or heated else UNIFORM


def needs_heat_solve(scene: Scene) -> bool:
    """True if the temperature must be computed and is not simply known."""
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
    """Return whether a number can act on the solution only through the temperature, or is a modulus
    of the material, which `_felt` compares."""
    of_edge = keys[0] == "boundary" and ("heat" in keys or keys[-1] in (*OWN_HEAT, "flux"))
    return of_edge or keys[0] in ("heat", "material", "materials")


def idle_notes(study: Study) -> list[str]:
    """Return one sentence for every axis of a grid whose values all give the same solutions,
    because heat is left out."""
    thermal = [
        (d, axis)
        for d, axis in enumerate(study.axes)
        if len(axis.labels) > 1 and _is_thermal(axis.path)
    ]
    if study.mode != "grid" or not thermal:
        return []
    scenes, of = combinations(study.scenes, *FELT)
    numbers = dict[tuple[object, ...], int]()
    alike = [numbers.setdefault(tuple(_felt(scene)), len(numbers)) for scene in scenes]
    points = np.array(alike)[of].reshape(study.shape)
    notes = list[str]()
    for d, axis in thermal:
        if _constant(points, d):
            why = why_idle(axis.path, study.scenes)
            equal = f"its {len(axis.labels)} values give equal solutions"
            notes.append(f"{axis.name} changes nothing ({why}): {equal}")
    return notes


def _felt(scene: Scene) -> Iterator[object]:
    heat, all_of = scene.heat, scene.material.all
    yield from ((one.lam, one.mu) for one in all_of)
    if needs_heat_solve(scene):
        yield from ((one.beta, one.k) for one in all_of)
        yield heat.q, heat.omega, scene.exchange, scene.held_theta, scene.flux
    elif scene.material.expands:
        given = (
            *(theta_bar for _, _, theta_bar in scene.exchange),
            *(theta for _, theta in scene.held_theta),
        )
        yield from (one.beta for one in all_of)
        yield heat.theta if heat.theta is not None else given[:1]
