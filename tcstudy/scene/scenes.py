"""The scenes of a study: the base study and every sweep point, read by the same code.

A sweep point is the study with swept values put at their paths. A section is read once for each combination of the
values that touch it, so 10^4 points cost little more than their distinct values.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from typing import Any

from tcstudy.scene.checks import check_heat, check_support, supports
from tcstudy.scene.corners import check_corners
from tcstudy.scene.finite import check_finite
from tcstudy.scene.node import Node, put
from tcstudy.scene.read_body import BodyReading, check_shape, read_body
from tcstudy.scene.read_boundary import read_boundary
from tcstudy.scene.read_friction import read_friction
from tcstudy.scene.read_heat import read_heat, read_inline_region
from tcstudy.scene.read_material import read_loads, read_material
from tcstudy.scene.read_sweep import Sweep, SweptAxis
from tcstudy.scene.records import Body, Scene
from tcstudy.scene.walker import Context

SECTIONS = ("boundary", "material", "loads", "heat", "friction")
"""What makes up a scene beside the body, which cannot be swept."""
THERMAL = ("boundary", "material", "heat")
"""Sections that check_heat compares."""

Indices = tuple[int, ...]


class SceneReader:
    """Reads the base study and the sweep points of one study."""

    def __init__(self, ctx: Context, root: Node, sweep: Sweep) -> None:
        self.ctx, self.root, self.sweep = ctx, root, sweep
        self.body = self._body(read_body(ctx, node) if (node := root.child("body")) else BodyReading(None, None))
        self.order = sorted(range(len(sweep.axes)), key=lambda i: len(sweep.axes[i].parameter.path))
        self.touching = {s: [i for i in self.order if sweep.axes[i].parameter.path[0] == s] for s in SECTIONS}
        self.nodes: dict[tuple[str, Indices], Node | None] = {}
        self.values: dict[tuple[str, Indices], Any] = {}
        self.supports: set[tuple[object, ...]] = set()
        self.compared: set[tuple[Indices, ...]] = set()
        self.base: Scene | None = None

    def _body(self, reading: BodyReading) -> Body | None:
        """The body with all its regions; None after a fault."""
        self.names, body = reading.names, reading.body
        self.regions: tuple[str, ...] | None = None
        if body is None:
            return None
        before = len(self.ctx.errors)
        body = read_inline_region(self.ctx, self.root.child("heat"), body)
        self.regions = tuple(region.name for region in body.regions)
        if len(self.ctx.errors) > before or not check_shape(self.ctx, body, self.root):
            return None
        return body

    def read(self) -> tuple[Scene, ...]:
        """One scene for each point, in C order of the axes; incomplete after a fault."""
        base = {s: self._read(s, self.root.child(s)) for s in SECTIONS}
        self._compare(self.root, base)
        for section in SECTIONS:
            if not self.touching[section]:
                self.nodes[section, ()], self.values[section, ()] = self.root.child(section), base[section]
        self.base = self._made(base)
        scenes = [self._scene(point) for point in self._points()] if self.sweep.axes else [self.base]
        return tuple(scene for scene in scenes if scene)

    def _points(self) -> Iterator[Indices]:
        """Index of the value on every axis, point by point."""
        ranges = [range(len(axis.values)) for axis in self.sweep.axes]
        return itertools.product(*ranges) if self.sweep.mode == "grid" else zip(*ranges, strict=True)

    def _scene(self, point: Indices) -> Scene | None:
        keys = {s: tuple(point[i] for i in self.touching[s]) for s in SECTIONS}
        for section, key in keys.items():
            if (section, key) not in self.values:
                self.ctx.errors.point = self._text(point, self.touching[section])
                node = self.nodes[section, key] = self._put(section, point)
                self.values[section, key] = self._read(section, node)
        values = {s: self.values[s, key] for s, key in keys.items()}
        triple = tuple(keys[s] for s in THERMAL)
        if triple not in self.compared:
            self.compared.add(triple)
            if any(triple):
                self.ctx.errors.point = self._text(point, sorted(i for s in THERMAL for i in self.touching[s]))
                self._compare(self._point_root(keys), values)
        return self._made(values)

    def _made(self, values: Mapping[str, Any]) -> Scene | None:
        if self.body is None or any(value is None for value in values.values()):
            return None
        return Scene(self.body, **{{"loads": "f"}.get(s, s): value for s, value in values.items()})

    def _text(self, point: Indices, axes: list[int]) -> str:
        """The swept values of a point in words."""
        return ", ".join(f"{self.sweep.axes[i].key} = {_shown(self.sweep.axes[i], point[i])}" for i in axes)

    def _put(self, section: str, point: Indices) -> Node | None:
        """The section with the swept values of a point."""
        root = Node({s: n for s in (section,) if (n := self.root.child(s))}, "", self.root.mark, self.root.mark)
        try:
            for i in self.touching[section]:
                root = put(root, self.sweep.axes[i].parameter.path, self.sweep.axes[i].values[point[i]])
        except KeyError:  # the base study has something else there, which is recorded already
            return None
        return root.child(section)

    def _point_root(self, keys: Mapping[str, Indices]) -> Node:
        """The study with the sections of a point."""
        sections = {s: node for s, key in keys.items() if (node := self.nodes[s, key])}
        assert isinstance(self.root.value, Mapping)
        return replace(self.root, value={**self.root.value, **sections})

    def _read(self, section: str, node: Node | None) -> Any:
        """The record of a section; None after a fault."""
        optional: dict[str, Callable[[], Any]] = {
            "loads": lambda: read_loads(self.ctx, node),
            "heat": lambda: read_heat(self.ctx, node, self.regions),
        }
        if section in optional:
            return optional[section]()
        if node is None:
            return None
        if section == "material":
            return read_material(self.ctx, node)
        if section == "friction":
            return read_friction(self.ctx, node)
        boundary = read_boundary(self.ctx, node, self.names)
        if boundary and self.body:
            held = supports(boundary)
            if held not in self.supports:
                self.supports.add(held)
                check_support(self.ctx, node, self.body, boundary)
            check_corners(self.ctx, node, self.body, boundary)
        return boundary

    def _compare(self, root: Node, values: Mapping[str, Any]) -> None:
        """Checks across the sections of one scene."""
        if self.body:
            for section in ("boundary", "loads", "heat"):
                if values[section] is not None:
                    check_finite(self.ctx, root, section, values[section], self.body)
        if all(values[s] is not None for s in THERMAL):
            check_heat(self.ctx, root, values["heat"], values["boundary"], values["material"])


def _shown(axis: SweptAxis, index: int) -> str:
    """A value of an axis: its text, or its label where that is a name."""
    return str(axis.labels[index]) if axis.parameter.kind == "law" else axis.values[index].brief()
