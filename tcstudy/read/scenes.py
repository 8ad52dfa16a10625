"""The scenes of a study: the base study and every sweep point, read by the same code.

A sweep point is the study with swept values put at their paths. A section is read once for each
combination of the values that touch it, so 10^4 points cost little more than their distinct values.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tcstudy.errors import StudyError, UserFault
from tcstudy.laws.composed import EdgeLaws
from tcstudy.read.body import (
    check_boundary,
    check_finite,
    check_laws,
    check_shape,
    read_body,
    supports,
    supports_fault,
)
from tcstudy.read.document import Collector, Node, put, put_number, tree_of
from tcstudy.read.fields import Context, read_parameters, users, words_in
from tcstudy.read.physics import (
    check_heat,
    read_boundary,
    read_friction,
    read_heat,
    read_loads,
    read_materials,
)
from tcstudy.read.sweep import SECTIONS, Sweep
from tcstudy.scene.parameters import Keys, numbers, path_scene
from tcstudy.scene.points import Scenes
from tcstudy.scene.records import Body, Edge, Scene
from tcstudy.scene.study import Study
from tcstudy.shapes.faults import snapped

KEYS = {"material": ("material", "materials")}
"""Keys of the study that a section stands for, where it is not one of its own name."""
THERMAL = ("boundary", "material", "heat")
"""Sections that check_heat compares."""

Indices = tuple[int, ...]
_FIELD = {"loads": "f"}
"""Field of a scene for a section, where it has another name."""


class SceneReader:
    """Reads the base study and the sweep points of one study, and scenes with other numbers: the
    sections that a number touches are read again."""

    def __init__(
        self,
        ctx: Context,
        root: Node,
        sweep: Sweep,
        loose: bool = False,
        study: Study | None = None,
    ) -> None:
        """loose: whether the supports may leave rigid motions, which friction alone resists.
        study: with whose sweep points scenes are asked for (`at`)"""
        self.ctx, self.root, self.sweep, self.loose, self.named, self.study = (
            ctx,
            root,
            sweep,
            loose,
            ctx.named,
            study,
        )
        self.body: Body | None
        self.body, self.names = read_body(ctx, node) if (node := root.at("body")) else (None, None)
        self.regions: tuple[str, ...] | None = None
        if self.body is not None:
            self.regions = tuple(region.name for region in self.body.regions)
            body = snapped(self.body) if self.regions else self.body
            self.body = body if check_shape(ctx, body, root) else None
        self.order = sorted(range(len(sweep.axes)), key=lambda i: len(sweep.axes[i].path))
        self.touching = {
            s: [i for i in self.order if self.touches(sweep.axes[i].path, s)] for s in SECTIONS
        }
        self.supports: set[tuple[object, ...]] = set()
        self.finite: set[int] = set()
        self.base: Scene | None = None
        self.scenes: Sequence[Scene] = ()
        ctx.errors.drawn = sweep.design is not None

    def touches(self, path: tuple[str, ...], section: str) -> bool:
        """Whether the record of a section depends on what is put at a path: a key in it, or a name
        that it uses."""
        keys = KEYS.get(section, (section,))
        if path[0] != "parameters":
            return path[0] in keys
        here = [node for key in keys if (node := self.root.at(key))]
        here += [value for axis in self.sweep.axes if axis.path[0] in keys for value in axis.values]
        names = users(self.root, path[-1])
        return any(words_in(node, names) for node in here)

    def read(self) -> None:
        """Find one scene for each point, in C order of the axes; after a fault the base study's, if
        it has none."""
        base = {s: self.section(s, self.root) for s in SECTIONS}
        self._compare(self.root, base)
        if self.body is not None and None not in base.values():
            self.base = Scene(self.body, **{_FIELD.get(s, s): value for s, value in base.items()})
            self.scenes = (self.base,)
        if not self.sweep.axes:
            return
        keys = {s: self._keys(s) for s in SECTIONS}
        read = {s: [self._at(s, key, base[s]) for key in keys[s][0]] for s in SECTIONS}
        records = {_FIELD.get(s, s): [record for _, record in read[s]] for s in SECTIONS} | {
            "body": [self.body]
        }
        which = {_FIELD.get(s, s): keys[s][1] for s in SECTIONS} | {
            "body": np.zeros_like(keys["heat"][1])
        }
        scenes = Scenes(records, which)
        self._compare_points(scenes, keys, read)
        if not any(record is None for known in records.values() for record in known):
            self.scenes = scenes

    def _keys(self, section: str) -> tuple[list[Indices], NDArray[np.int32]]:
        places = self.sweep.places
        own, at = (
            [len(self.sweep.axes[i].values) for i in self.touching[section]],
            places[self.touching[section]],
        )
        if not own:
            return [()], np.zeros(places.shape[1], dtype=np.int32)
        if self.sweep.mode == "list":
            return [(i,) * len(own) for i in range(own[0])], at[0].astype(np.int32)
        return list(np.ndindex(*own)), np.ravel_multi_index(tuple(at), own).astype(np.int32)

    def _at(self, section: str, key: Indices, base: Any) -> tuple[Node | None, Any]:
        """The study with nothing but a section, the values at `key` of the axes that touch it put
        in; and its record.

        base: the record of the base study, which an untouched section keeps
        """
        axes, names, moved = self.touching[section], self.root, set[str]()
        own = {s: n for s in KEYS.get(section, (section,)) if (n := self.root.at(s))}
        root: Node | None = Node(own, "", self.root.mark, self.root.mark)
        if not axes:
            return root, base
        self.ctx.errors.point = self.words(key, axes)
        for axis, at in ((self.sweep.axes[i], at) for i, at in zip(axes, key, strict=True)):
            path, value = axis.path, axis.values[at]
            if path[0] == "parameters":
                names = put(names, path, value)
                moved |= users(self.root, path[-1])
            elif root is not None:
                try:
                    root = put_number(root, path, value)
                except (
                    KeyError
                ):  # the base study has something else there, which is recorded already
                    root = None
        if names is not self.root:
            kept = {name: one for name, one in self.named.items() if name not in moved}
            self.ctx.named = read_parameters(self.ctx, names.at("parameters"), kept)
        record = self.section(section, root)
        self.ctx.named = self.named
        self.ctx.unread -= moved
        return root, record

    def _compare_points(
        self,
        scenes: Scenes,
        keys: Mapping[str, Any],
        read: Mapping[str, list[tuple[Node | None, Any]]],
    ) -> None:
        first = scenes.combined(*THERMAL)[0]
        for i in first if len(first) > 1 else ():
            swept = {
                a: at
                for s in THERMAL
                for a, at in zip(self.touching[s], keys[s][0][keys[s][1][i]], strict=True)
            }
            self.ctx.errors.point = self.words(
                tuple(swept[axis] for axis in sorted(swept)), sorted(swept)
            )
            point = {s: read[s][keys[s][1][i]] for s in SECTIONS}
            sections = dict(self.root.value) if isinstance(self.root.value, Mapping) else {}
            for node, _ in point.values():
                sections |= node.value if node and isinstance(node.value, Mapping) else {}
            self._compare(
                replace(self.root, value=sections), {s: record for s, (_, record) in point.items()}
            )

    def words(self, key: Indices, axes: Sequence[int]) -> str:
        """Values of some axes in words; of a drawn point all, after its number from 0."""
        drawn = self.sweep.design is not None and bool(key)
        words = []
        for i, at in ((i, key[0]) for i in self.order) if drawn else zip(axes, key, strict=True):
            axis = self.sweep.axes[i]
            shown = str(axis.labels[at]) if axis.is_whole else axis.values[at].brief()
            words.append(f"{axis.key} = {shown}")
        return f"drawn point {key[0]}: {', '.join(words)}" if drawn else ", ".join(words)

    def section(self, section: str, root: Node | None) -> Any:
        """The record of a section of a study; None after a fault."""
        node = root.at(section) if root else None
        if section == "loads":
            return read_loads(self.ctx, node)
        if section == "heat":
            return read_heat(self.ctx, node, self.regions)
        if root is None or node is None:
            return None
        if section == "material":
            return read_materials(self.ctx, node, root.at("materials"), self.regions)
        if section == "friction":
            return read_friction(self.ctx, node, self._contact_lines())
        boundary = read_boundary(self.ctx, node, self.names)
        if boundary and self.body:
            if not self.loose and (held := supports(boundary)) not in self.supports:
                self.supports.add(held)
                if fault := supports_fault(self.body, boundary):
                    self.ctx.at(node, *fault)
            check_boundary(self.ctx, node, self.body, boundary)
        return boundary

    def _contact_lines(self) -> dict[str, list[Edge]]:
        """The edges of an outline where its study has contact, by name, and all by the name ""."""
        roles, edges = (
            self.root.at("boundary"),
            self.body.edges if self.body and self.body.outline else (),
        )
        own = roles.children.items() if roles else ()
        contact = [
            name for name, role in own if "contact" in (role.value, (role.at("role") or role).value)
        ]
        lines = {name: [edge for edge in edges if edge.name == name] for name in contact}
        return lines | {"": [edge for edge in edges if edge.name in contact]}

    def _compare(self, root: Node, values: Mapping[str, Any]) -> None:
        for section in ("boundary", "loads", "heat") if self.body else ():
            value = values[section]
            if (
                value is not None and id(value) not in self.finite
            ):  # points share their sections' records
                self.finite.add(id(value))
                check_finite(self.ctx, root, section, value, self.body)  # type: ignore[arg-type]
        if (
            self.body
            and isinstance(values["friction"], EdgeLaws)
            and values["boundary"] is not None
        ):
            check_laws(self.ctx, root, values["friction"], values["boundary"], self.body)
        if all(values[s] is not None for s in THERMAL):
            check_heat(self.ctx, root, values["heat"], values["boundary"], values["material"])

    @classmethod
    def of(cls, study: Study) -> SceneReader:
        """That of a study that was read, for its scenes with other numbers."""
        ctx = Context(Collector(), study.units, study.source.parent if study.source else Path())
        root = tree_of(study, ctx.errors)
        ctx.named = read_parameters(ctx, root.at("parameters"))
        return cls(ctx, root, Sweep(), loose=True, study=study)

    def at(self, scene: Scene, values: Mapping[Keys, float], point: int | None = None) -> Scene:
        """A scene with numbers [SI] at key paths: those of a section, of components (`loads.f_x`),
        of the points of a law (`friction.points.1` for b, `friction.points.1.s`), of names of
        `parameters`, and the factor `load`.

        scene: that outside the sweep, or of the point of this number
        Raises StudyError with what is wrong with the numbers.
        """
        ctx, root, study = self.ctx, self.root, self.study
        if study is not None and point is not None:
            grid = study.mode == "grid"
            places = (
                [int(i) for i in np.unravel_index(point, study.shape)]
                if grid
                else [point] * len(study.axes)
            )
            swept = zip(study.axes, places, strict=True)
            for axis, at in sorted(
                swept, key=lambda one: len(one[0].path)
            ):  # whole laws before their numbers
                root = put_number(root, axis.path, Node.of(axis.values[at], axis.name))
        for path, value in values.items():
            root = (
                put_number(root, path, Node.of(value, ".".join(path)))
                if path != ("load",)
                else root
            )
        outer = ctx.errors, ctx.named
        ctx.errors = errors = Collector()
        ctx.named = read_parameters(ctx, root.at("parameters"))
        touched = [s for s in SECTIONS if any(self.touches(path, s) for path in values)]
        found = {_FIELD.get(s, s): self.section(s, root) for s in touched}
        ctx.errors, ctx.named = outer
        if len(errors):
            raise StudyError(errors.problems)
        scene = replace(scene, **found)
        return path_scene(scene, ("load",), values["load",]) if ("load",) in values else scene

    def rates(self, scene: Scene, name: str, values: Mapping[Keys, float]) -> dict[Keys, float]:
        """∂p/∂(name) of all numbers p of the scene that an own number of the study enters, by
        differences of order 4.

        values: as of `at`, with that of the name
        Raises StudyError; UserFault where the name is in one by which the solution has no
        derivative.
        """
        path = "parameters", name
        h = 1e-3 * (abs(values[path]) or 1.0)
        steps = [
            dict(numbers(self.at(scene, {**values, path: values[path] + k * h})))
            for k in (-2, -1, 1, 2)
        ]
        moved = {keys: [one[keys].value for one in steps] for keys in steps[0]}
        moved = {keys: found for keys, found in moved.items() if len({*found}) > 1}
        for keys in moved:
            if why := steps[0][keys].no_number:
                raise UserFault(f"{'.'.join(keys)} is made of {name}, and {why}")
        derivatives = {}
        for keys, found in moved.items():
            mm, m, p, pp = found
            derivatives[keys] = (8.0 * (p - m) - (pp - mm)) / (12.0 * h)  # type: ignore[operator]
        return derivatives
