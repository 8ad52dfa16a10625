"""The scenes of a study: the base study and every sweep point, read by the same code.

A sweep point is the study with swept values put at their paths. A section is read once for each combination of the
values that touch it, so 10^4 points cost little more than their distinct values.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tcstudy.laws.composed import EdgeLaws
from tcstudy.read.body import check_shape, read_body
from tcstudy.read.checks import check_boundary, check_finite, check_laws, supports, supports_fault
from tcstudy.read.fields import Context
from tcstudy.read.heat import check_heat, needed_of_heat, read_heat, with_inline_region
from tcstudy.read.node import Node, put
from tcstudy.read.parameters import read_parameters, users, words_in
from tcstudy.read.physics import read_boundary, read_friction, read_loads, read_materials
from tcstudy.read.sweep import Sweep, SweptAxis
from tcstudy.scene.named import Named
from tcstudy.scene.points import Scenes
from tcstudy.scene.records import Body, Scene

SECTIONS = ("boundary", "material", "loads", "heat", "friction")
"""What makes up a scene beside the body, which cannot be swept."""
KEYS = {"material": ("material", "materials")}
"""Keys of the study that a section stands for, where it is not one of its own name."""
THERMAL = ("boundary", "material", "heat")
"""Sections that check_heat compares."""

Indices = tuple[int, ...]
_FIELD = {"loads": "f"}
"""Field of a scene for a section, where it has another name."""


class _Keys(NamedTuple):
    """Combinations of values of some axes, and (P,) which of them each point has."""

    distinct: list[Indices]
    of: NDArray[np.int32]


class SceneReader:
    """Reads the base study and the sweep points of one study."""

    def __init__(self, ctx: Context, root: Node, sweep: Sweep, loose: bool = False) -> None:
        """loose: whether the supports may leave rigid motions, which friction alone resists."""
        self.ctx, self.root, self.sweep, self.loose = ctx, root, sweep, loose
        body, self.names = read_body(ctx, node) if (node := root.child("body")) else (None, None)
        self.body = self._with_regions(body)
        self.needed_of_heat = needed_of_heat(root.child("boundary"))
        self.order = sorted(range(len(sweep.axes)), key=lambda i: len(sweep.axes[i].parameter.path))
        self.named, self.touching = ctx.named, {s: [i for i in self.order if self._touches(i, s)] for s in SECTIONS}
        self.nodes: dict[tuple[str, Indices], Node | None] = {}
        self.values: dict[tuple[str, Indices], Any] = {}
        self.supports: set[tuple[object, ...]] = set()
        self.finite: set[int] = set()
        self.base: Scene | None = None
        ctx.errors.drawn = sweep.design is not None

    def _touches(self, i: int, section: str) -> bool:
        """Whether the record of a section depends on axis i: a key in it, or a name that it uses."""
        path = self.sweep.axes[i].parameter.path
        keys = KEYS.get(section, (section,))
        if path[0] != "parameters":
            return path[0] in keys
        put_in = [axis.values for axis in self.sweep.axes if axis.parameter.path[0] in keys]
        here = [self.root.child(key) for key in keys]
        texts = [node for node in (*here, *itertools.chain(*put_in)) if node is not None]
        names = users(self.root, path[-1])
        return any(words_in(node, names) for node in texts)

    def _named_at(self, section: str, key: Indices) -> dict[str, Named]:
        """The names that expressions use, with the values that they have at `key`."""
        swept = [(i, at) for i, at in zip(self.touching[section], key, strict=True) if self._is_name(i)]
        root = self.root
        for i, at in swept:
            root = put(root, self.sweep.axes[i].parameter.path, self.sweep.axes[i].values[at])
        return read_parameters(self.ctx, root.child("parameters")) if swept else self.named

    def _is_name(self, i: int) -> bool:
        return self.sweep.axes[i].parameter.path[0] == "parameters"

    def _with_regions(self, body: Body | None) -> Body | None:
        """The body with all its regions; None after a fault."""
        self.regions: tuple[str, ...] | None = None
        if body is None:
            return None
        before = len(self.ctx.errors)
        body = with_inline_region(self.ctx, self.root.child("heat"), body)
        self.regions = tuple(region.name for region in body.regions)
        if len(self.ctx.errors) > before or not check_shape(self.ctx, body, self.root):
            return None
        return body

    def read(self) -> Sequence[Scene]:
        """One scene for each point, in C order of the axes; after a fault the base study's, if it has none."""
        base = {s: self._read(s, self.root) for s in SECTIONS}
        self._compare(self.root, base)
        for section in SECTIONS:
            if not self.touching[section]:
                self.nodes[section, ()], self.values[section, ()] = self._put(section, ()), base[section]
        self.base = self._made(base)
        if not self.sweep.axes:
            return (self.base,) if self.base else ()
        keys = {s: self._keys(s) for s in SECTIONS}
        for section in SECTIONS:
            for key in keys[section].distinct:
                self._read_point(section, key)
        self._compare_points(keys)
        records = {s: [self.values[s, key] for key in keys[s].distinct] for s in SECTIONS}
        if self.body is None or any(record is None for known in records.values() for record in known):
            return (self.base,) if self.base else ()
        which = {_FIELD.get(s, s): keys[s].of for s in SECTIONS} | {"body": np.zeros_like(keys["heat"].of)}
        return Scenes({_FIELD.get(s, s): records[s] for s in SECTIONS} | {"body": [self.body]}, which)

    def _keys(self, section: str) -> _Keys:
        """The values of the axes that touch a section: all combinations, and which one each point has."""
        axes, sizes = self.touching[section], [len(axis.values) for axis in self.sweep.axes]
        if self.sweep.mode == "grid":
            distinct = list(itertools.product(*(range(sizes[i]) for i in axes)))
            one = np.zeros([1] * len(sizes), dtype=np.int32)
            for i in axes:
                steps = np.arange(sizes[i], dtype=np.int32).reshape([-1 if d == i else 1 for d in range(len(sizes))])
                one = one * np.int32(sizes[i]) + steps
            return _Keys(distinct, np.broadcast_to(one, sizes).ravel())
        found: dict[Indices, int] = {}
        of = [found.setdefault((i,) * len(axes), len(found)) for i in range(sizes[0])]
        return _Keys(list(found), np.array(of, dtype=np.int32))

    def _read_point(self, section: str, key: Indices) -> None:
        """The record of a section for the values at `key` of the axes that touch it."""
        if (section, key) not in self.values:
            axes = self.touching[section]
            self.ctx.errors.point = self._text(key, axes)
            node = self.nodes[section, key] = self._put(section, key)
            self.ctx.named = self._named_at(section, key)
            self.values[section, key] = self._read(section, node)
            self.ctx.named = self.named

    def _compare_points(self, keys: Mapping[str, _Keys]) -> None:
        """Checks across the sections, once for every combination of those that are compared."""
        count = 1
        code = np.zeros(len(keys["heat"].of), dtype=np.int64)
        for s in THERMAL:
            code, count = code * len(keys[s].distinct) + keys[s].of, count * len(keys[s].distinct)
        for i in np.sort(np.unique(code, return_index=True)[1]) if count > 1 else ():
            at = {s: keys[s].distinct[keys[s].of[i]] for s in SECTIONS}
            values = {s: self.values[s, at[s]] for s in SECTIONS}
            swept = {axis: index for s in THERMAL for axis, index in zip(self.touching[s], at[s], strict=True)}
            self.ctx.errors.point = self._text(tuple(swept[axis] for axis in sorted(swept)), sorted(swept))
            self._compare(self._point_root(at), values)

    def _made(self, values: Mapping[str, Any]) -> Scene | None:
        if self.body is None or any(value is None for value in values.values()):
            return None
        return Scene(self.body, **{_FIELD.get(s, s): value for s, value in values.items()})

    def _text(self, key: Indices, axes: list[int]) -> str:
        """Values of some axes in words; of a drawn point all, after its number from 0."""
        drawn = self.sweep.design is not None and bool(key)
        named = ((i, key[0]) for i in self.order) if drawn else zip(axes, key, strict=True)
        words = ", ".join(f"{self.sweep.axes[i].key} = {_shown(self.sweep.axes[i], at)}" for i, at in named)
        return f"drawn point {key[0]}: {words}" if drawn else words

    def _put(self, section: str, key: Indices) -> Node | None:
        """The study with nothing but the section, swept values put in."""
        keys = KEYS.get(section, (section,))
        root = Node({s: n for s in keys if (n := self.root.child(s))}, "", self.root.mark, self.root.mark)
        try:
            for i, at in zip(self.touching[section], key, strict=True):
                if not self._is_name(i):
                    root = put(root, self.sweep.axes[i].parameter.path, self.sweep.axes[i].values[at])
        except KeyError:  # the base study has something else there, which is recorded already
            return None
        return root

    def _point_root(self, keys: Mapping[str, Indices]) -> Node:
        """The study with the sections of a point."""
        assert isinstance(self.root.value, Mapping)
        sections = dict(self.root.value)
        for s, key in keys.items():
            if (node := self.nodes[s, key]) and isinstance(node.value, Mapping):
                sections |= node.value
        return replace(self.root, value=sections)

    def _read(self, section: str, root: Node | None) -> Any:
        """The record of a section of a study; None after a fault."""
        node = root.child(section) if root else None
        if section == "loads":
            return read_loads(self.ctx, node)
        if section == "heat":
            return read_heat(self.ctx, node, self.regions, self.needed_of_heat)
        if root is None or node is None:
            return None
        if section == "material":
            return read_materials(self.ctx, node, root.child("materials"), self.regions)
        if section == "friction":
            return read_friction(self.ctx, node)
        boundary = read_boundary(self.ctx, node, self.names)
        if boundary and self.body:
            if not self.loose and (held := supports(boundary)) not in self.supports:
                self.supports.add(held)
                if fault := supports_fault(self.body, boundary):
                    self.ctx.errors.at(node, *fault)
            check_boundary(self.ctx, node, self.body, boundary)
        return boundary

    def _compare(self, root: Node, values: Mapping[str, Any]) -> None:
        """Checks across the sections of one scene."""
        if self.body:
            for section in ("boundary", "loads", "heat"):
                value = values[section]
                if value is not None and id(value) not in self.finite:  # points share their sections' records
                    self.finite.add(id(value))
                    check_finite(self.ctx, root, section, value, self.body)
            if isinstance(values["friction"], EdgeLaws) and values["boundary"] is not None:
                check_laws(self.ctx, root, values["friction"], values["boundary"], self.body)
        if all(values[s] is not None for s in THERMAL):
            check_heat(self.ctx, root, values["heat"], values["boundary"], values["material"])


def _shown(axis: SweptAxis, index: int) -> str:
    """A value of an axis in words: its text, or its label where that is a name."""
    return str(axis.labels[index]) if axis.parameter.is_whole else axis.values[index].brief()
