"""Reading the scenes of a study: the base study and every sweep point, by the same code.

A sweep point is the study with swept values put at their paths. A section is read once for each
combination of the values that touch it, so 10^4 points cost little more than their distinct values.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tcstudy.errors import StudyError, UserFault
from tcstudy.laws.composed import EdgeLaws, bonded_edges
from tcstudy.read.body import (
    check_boundary,
    check_finite,
    check_laws,
    check_shape,
    loose_faults,
    read_body,
    supports_fault,
)
from tcstudy.read.document import Collector, LocatedFault, Node, put, put_number, tree_of
from tcstudy.read.fields import Context, read_parameters, users, words_in
from tcstudy.read.opening import corner_faults
from tcstudy.read.physics import (
    adhesive_edges,
    check_heat,
    contact_edges,
    has_no_friction,
    not_held,
    opening_edges,
    read_boundary,
    read_heat,
    read_laws,
    read_loads,
    read_materials,
    with_no_shear,
)
from tcstudy.read.sweep import SECTIONS, Sweep
from tcstudy.scene.keys import LAWS
from tcstudy.scene.mesh_plan import MeshPlan
from tcstudy.scene.parameters import Keys, Number, numbers, path_scene
from tcstudy.scene.path_plan import PathPlan
from tcstudy.scene.points import Scenes
from tcstudy.scene.records import Body, Boundary, Edge, Scene, is_clamped, resisting_edges, supports
from tcstudy.scene.study import Study
from tcstudy.shapes.faults import snapped
from tcstudy.shapes.rigid_motions import motions_of_body

KEYS = {"material": ("material", "materials")}
"""Keys of the study that a section consists of, unless it is the key of the same name."""
THERMAL = ("boundary", "material", "heat")
"""Sections that check_heat compares."""

Indices = tuple[int, ...]
_FIELD_NAMES = {"loads": "f"}
"""Field of a scene for a section with another name."""


def _as_fields(by_section: Mapping[str, Any]) -> dict[str, Any]:
    """Return values by field of a scene in place of section."""
    return {_FIELD_NAMES.get(section, section): value for section, value in by_section.items()}


@dataclass(frozen=True, eq=False)
class _Readings:
    """The readings of a section, one for each combination of the values that touch it.

    combinations: indices of the values, by axis that touches the section
    which:        (P,) combination of every point
    roots:        study with nothing but the section; None if the values cannot be put in
    records:      of the section; None after a fault
    """

    combinations: list[Indices]
    which: NDArray[np.int32]
    roots: list[Node | None]
    records: list[Any]


class SceneReader:
    """Reads the base study and the sweep points of a study, and scenes with other numbers.

    The sections that a number touches are read again.
    """

    def __init__(
        self,
        ctx: Context,
        root: Node,
        sweep: Sweep,
        study: Study | None = None,
    ) -> None:
        """Read the body.

        study: whose sweep points `at` knows by their numbers
        """
        self.ctx = ctx
        self.root = root
        self.sweep = sweep
        self.named = ctx.named
        self.study = study
        self.body: Body | None = None
        self.names: tuple[str, ...] | None = None
        self.regions: tuple[str, ...] | None = None
        if node := root.at("body"):
            self.body, self.names = read_body(ctx, node)
        if self.body is not None:
            self.regions = tuple(region.name for region in self.body.regions)
            body = snapped(self.body) if self.regions else self.body
            self.body = body if check_shape(ctx, body, root) else None
        self.adhesive = adhesive_edges(root)
        self.opening = opening_edges(root)
        self.not_held = not_held(root)
        self.sections = tuple(s for s in SECTIONS if s != "adhesion" or root.at(s))
        """Sections that have a record: every study has all, but for adhesion."""
        self.order = sorted(range(len(sweep.axes)), key=lambda i: len(sweep.axes[i].path))
        self.touching = dict[str, list[int]]()
        for section in SECTIONS:
            axes = [i for i in self.order if self.touches(sweep.axes[i].path, section)]
            self.touching[section] = axes
        self.supported: dict[object, tuple[Node, Boundary, str]] = {}
        self.bonded: frozenset[str] | None = None
        self.finite: set[int] = set()
        self.base: Scene | None = None
        self.scenes: Sequence[Scene] = ()
        ctx.errors.drawn = sweep.design is not None

    def touches(self, path: tuple[str, ...], section: str) -> bool:
        """Return whether a section depends on the value at a path: of a key or a name in it."""
        keys = KEYS.get(section, (section,))
        if path[0] != "parameters":
            return path[0] in keys
        nodes = [node for key in keys if (node := self.root.at(key))]
        for axis in self.sweep.axes:
            if axis.path[0] in keys:
                nodes += axis.values
        names = users(self.root, path[-1])
        return any(words_in(node, names) for node in nodes)

    def read(self) -> None:
        """Make a scene for each point, in C order of the axes.

        After a fault there is only the scene of the base study, if that has no fault.
        """
        self._read_scenes()
        self._check_supports()

    def _read_scenes(self) -> None:
        base = {section: self.section(section, self.root) for section in self.sections}
        self._compare(self.root, base)
        if self.body is not None and None not in base.values():
            self.base = Scene(self.body, **_as_fields(base))
            self.scenes = (self.base,)
        if not self.sweep.axes:
            return
        readings = {s: self._readings(s, base[s]) for s in self.sections}
        records = {section: reading.records for section, reading in readings.items()}
        which = {section: reading.which for section, reading in readings.items()}
        records["body"] = [self.body]
        which["body"] = np.zeros_like(which["heat"])
        if "adhesion" not in records:
            records["adhesion"], which["adhesion"] = [None], which["body"]
        scenes = Scenes(_as_fields(records), _as_fields(which))
        self._compare_points(scenes, readings)
        columns = [readings[section].records for section in self.sections]
        if not any(record is None for column in columns for record in column):
            self.scenes = scenes

    def _readings(self, section: str, base: Any) -> _Readings:
        """Return the readings of a section. base: its record in the base study"""
        axes = self.touching[section]
        places = self.sweep.places[axes]
        extents = [len(self.sweep.axes[i].values) for i in axes]
        if not axes:
            combinations: list[Indices] = [()]
            which = np.zeros(self.sweep.places.shape[1], dtype=np.int32)
        elif self.sweep.mode == "list":
            combinations = [(i,) * len(extents) for i in range(extents[0])]
            which = places[0].astype(np.int32)
        else:
            combinations = list(np.ndindex(*extents))
            which = np.ravel_multi_index(tuple(places), extents).astype(np.int32)
        readings = _Readings(combinations, which, [], [])
        for indices in combinations:
            root, record = self._reading(section, indices, base)
            readings.roots.append(root)
            readings.records.append(record)
        return readings

    def _reading(self, section: str, indices: Indices, base: Any) -> tuple[Node | None, Any]:
        """Return the study with nothing but a section that has some swept values, and its record.

        indices: of the values, by axis that touches the section
        base:    the record of the base study, which an untouched section keeps
        """
        axes = self.touching[section]
        sections = {s: n for s in KEYS.get(section, (section,)) if (n := self.root.at(s))}
        root: Node | None = Node(sections, "", self.root.mark, self.root.mark)
        if not axes:
            return root, base
        self.ctx.errors.point = self.words(indices, axes)
        names = self.root
        moved = set[str]()
        for axis_number, index in zip(axes, indices, strict=True):
            axis = self.sweep.axes[axis_number]
            value = axis.values[index]
            if axis.path[0] == "parameters":
                names = put(names, axis.path, value)
                moved |= users(self.root, axis.path[-1])
            elif root is not None:
                try:
                    root = put_number(root, axis.path, value)
                except KeyError:  # of a fault in the base study, which is recorded already
                    root = None
        if names is not self.root:
            unmoved = {name: value for name, value in self.named.items() if name not in moved}
            self.ctx.named = read_parameters(self.ctx, names.at("parameters"), unmoved)
        record = self.section(section, root)
        self.ctx.named = self.named
        self.ctx.unread -= moved
        return root, record

    def _compare_points(self, scenes: Scenes, readings: Mapping[str, _Readings]) -> None:
        """Compare the sections of all points, once for each combination of thermal sections."""
        first_points = scenes.combined(*THERMAL)[0]
        for point in first_points if len(first_points) > 1 else ():
            swept = dict[int, int]()
            for section in THERMAL:
                indices = readings[section].combinations[readings[section].which[point]]
                swept |= zip(self.touching[section], indices, strict=True)
            swept = dict(sorted(swept.items()))
            self.ctx.errors.point = self.words(tuple(swept.values()), list(swept))
            sections = dict(self.root.value) if isinstance(self.root.value, Mapping) else {}
            records = dict[str, Any]()
            for section, reading in readings.items():
                node = reading.roots[reading.which[point]]
                sections |= node.value if node and isinstance(node.value, Mapping) else {}
                records[section] = reading.records[reading.which[point]]
            self._compare(replace(self.root, value=sections), records)

    def words(self, indices: Indices, axes: Sequence[int]) -> str:
        """Return the values of some axes in words; of a drawn point all axes, after its number."""
        is_drawn = self.sweep.design is not None and bool(indices)
        if is_drawn:
            axes = self.order
            indices = (indices[0],) * len(axes)
        words = []
        for axis_number, index in zip(axes, indices, strict=True):
            axis = self.sweep.axes[axis_number]
            value = str(axis.labels[index]) if axis.is_whole else axis.values[index].brief()
            words.append(f"{axis.key} = {value}")
        text = ", ".join(words)
        return f"sampled point {indices[0]}: {text}" if is_drawn else text

    def section(self, section: str, root: Node | None) -> Any:
        """Return the record of a section of a study; None after a fault."""
        node = root.at(section) if root else None
        if section == "loads":
            return read_loads(self.ctx, node)
        if section == "heat":
            return read_heat(self.ctx, node, self.regions)
        if section == "friction" and node is None and has_no_friction(self.root):
            self.bonded = self.bonded or frozenset()
            return with_no_shear(None, self.opening)
        if root is None or node is None:
            return None
        if section == "material":
            return read_materials(self.ctx, node, root.at("materials"), self.regions)
        if section in LAWS:
            laws = read_laws(self.ctx, node, self._contact_lines(), section)
            if section == "friction" and laws:
                laws = with_no_shear(laws, self.opening)
                self.bonded = (self.bonded or frozenset()) | bonded_edges(laws)
            return laws
        boundary = read_boundary(self.ctx, node, self.names, self.adhesive)
        if boundary and self.body:
            self.supported.setdefault(supports(boundary), (node, boundary, self.ctx.errors.point))
            check_boundary(self.ctx, node, self.body, boundary)
            if self.not_held:
                for edge, *sentences in corner_faults(self.body, boundary):
                    self.ctx.at(node.nearest(edge), *sentences)
        return boundary

    def _check_supports(self) -> None:
        """Record every kind of supports that leaves a motion which no friction resists."""
        if self.body is None or self.bonded is None:
            return
        for node, boundary, point in self.supported.values():
            if is_clamped(boundary):
                continue
            resisting = resisting_edges(boundary, self.bonded)
            motions = motions_of_body(self.body, boundary, resisting)
            fault = supports_fault(motions, boundary, has_friction=bool(resisting))
            if fault is not None:
                self.ctx.errors.point = point
                self.ctx.at(node, *fault)

    def loose_faults(
        self, mesh: MeshPlan, path: PathPlan | None, is_live: bool
    ) -> Iterator[LocatedFault]:
        """Yield what a study asks for and a body that friction alone restrains does not have."""
        for _, boundary, _ in self.supported.values():
            if self.body is not None and not is_clamped(boundary):
                yield from loose_faults(motions_of_body(self.body, boundary), mesh, path, is_live)

    def _contact_lines(self) -> dict[str, list[Edge]]:
        """Return the edges of an outline in contact, by name, and all by the name ""."""
        edges = self.body.edges if self.body and self.body.outline else ()
        contact = contact_edges(self.root)
        lines = {name: [edge for edge in edges if edge.name == name] for name in contact}
        return lines | {"": [edge for edge in edges if edge.name in contact]}

    def _compare(self, root: Node, records: Mapping[str, Any]) -> None:
        """Record faults of sections that need the body, or each other."""
        boundary = records["boundary"]
        if self.body:
            for section in ("boundary", "loads", "heat"):
                record = records[section]
                # points share the records of their sections
                if record is not None and id(record) not in self.finite:
                    self.finite.add(id(record))
                    check_finite(self.ctx, root, section, record, self.body)
            for section in LAWS:
                laws = records.get(section)
                if isinstance(laws, EdgeLaws) and boundary is not None:
                    check_laws(self.ctx, root, section, laws, boundary, self.body)
        if all(records[section] is not None for section in THERMAL):
            check_heat(self.ctx, root, records["heat"], boundary, records["material"])

    @classmethod
    def of(cls, study: Study) -> SceneReader:
        """Return the reader of a study that was read, for its scenes with other numbers."""
        ctx = Context(Collector(), study.units, study.source.parent if study.source else Path())
        root = tree_of(study, ctx.errors)
        ctx.named = read_parameters(ctx, root.at("parameters"))
        return cls(ctx, root, Sweep(), study=study)

    def at(self, scene: Scene, values: Mapping[Keys, float], point: int | None = None) -> Scene:
        """Return a scene with other numbers [SI] at key paths.

        They may be numbers of a section, components (`loads.f_x`), points of a law
        (`friction.points.1` for b, `friction.points.1.s`), names of `parameters`, and the factor
        `load`.

        scene: that outside the sweep, or of the point of this number
        Raises StudyError with the faults of the numbers.
        """
        ctx = self.ctx
        root = self.root if point is None else self._root_of(point)
        for path, value in values.items():
            if path != ("load",):
                root = put_number(root, path, Node.of(value, ".".join(path)))
        outer_errors, outer_named = ctx.errors, ctx.named
        ctx.errors = errors = Collector()
        ctx.named = read_parameters(ctx, root.at("parameters"))
        touched = [s for s in self.sections if any(self.touches(path, s) for path in values)]
        records = {section: self.section(section, root) for section in touched}
        ctx.errors, ctx.named = outer_errors, outer_named
        if len(errors):
            raise StudyError(errors.problems)
        scene = replace(scene, **_as_fields(records))
        return path_scene(scene, ("load",), values["load",]) if ("load",) in values else scene

    def _root_of(self, point: int) -> Node:
        """Return the study with the swept values of a point put in."""
        root, study = self.root, self.study
        if study is None:
            return root
        indices = [point] * len(study.axes)
        if study.mode == "grid":
            indices = [int(i) for i in np.unravel_index(point, study.shape)]
        # whole laws before their numbers
        for i in sorted(range(len(study.axes)), key=lambda i: len(study.axes[i].path)):
            axis = study.axes[i]
            root = put_number(root, axis.path, Node.of(axis.values[indices[i]], axis.name))
        return root

    def rates(self, scene: Scene, name: str, values: Mapping[Keys, float]) -> dict[Keys, float]:
        """Return ∂p/∂(name) of all numbers p of the scene that depend on the name.

        The name is one of `parameters`. The derivatives are differences of order 4.
        values: as of `at`, with that of the name
        Raises StudyError; UserFault if the solution has no derivative by one of these numbers.
        """
        path = ("parameters", name)
        h = 1e-3 * (abs(values[path]) or 1.0)
        steps = list[dict[Keys, Number]]()
        for k in (-2, -1, 1, 2):
            moved_scene = self.at(scene, {**values, path: values[path] + k * h})
            steps.append(dict(numbers(moved_scene)))
        moved = dict[Keys, list[Any]]()
        for keys in steps[0]:
            step_values = [step[keys].value for step in steps]
            if len({*step_values}) > 1:
                moved[keys] = step_values
        for keys in moved:
            if reason := steps[0][keys].no_number:
                raise UserFault(f"{'.'.join(keys)} is made of {name}, and {reason}")
        derivatives = dict[Keys, float]()
        for keys, (mm, m, p, pp) in moved.items():
            derivatives[keys] = (8.0 * (p - m) - (pp - mm)) / (12.0 * h)
        return derivatives
