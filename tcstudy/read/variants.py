"""Reads a study whose sweep varies numbers of the body or of the meshes: one study for each geometry.

A geometry is the study with the swept numbers put into `body`, `mesh` or `parameters`, read by the same code as any
other. What is wrong with its shape, or with its element size for it, refuses its points with the reason, since the
other geometries are sound; every other fault is one of the study.
"""

from __future__ import annotations

import itertools
import json
import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np

from tcstudy.errors import Problem, StudyError
from tcstudy.read.document import with_sweep
from tcstudy.read.fields import Context
from tcstudy.read.node import Collector, Node, put, split_path
from tcstudy.read.parameters import read_parameters, users, words_in
from tcstudy.read.sweep import Sweep, SweptAxis, records
from tcstudy.scene.points import GEOMETRIC, Scenes
from tcstudy.scene.study import Study, Variant


def geometric(root: Node, sweep: Sweep) -> list[int]:
    """The axes that change the body or its meshes: numbers of these sections, and names that they use."""
    sections = [node for name in GEOMETRIC if (node := root.child(name)) is not None]
    found = []
    for i, axis in enumerate(sweep.axes):
        path = axis.parameter.path
        names = users(root, path[-1]) if path[0] == "parameters" else ()
        if path[0] in GEOMETRIC or any(words_in(node, names) for node in sections if names):
            found.append(i)
    return found


def read_variants(
    ctx: Context,
    root: Node,
    sweep: Sweep,
    overrides: tuple[str, ...],
    said: tuple[str, ...],
    read: Callable[..., Study],
) -> Study:
    """The study of all geometries; a refused one has the scenes of the first that is not.

    said: options that make the text this study;  read: (ctx, root, sweep, said) → Study, for one geometry
    Raises StudyError with the faults of the first geometry that has some, or if all are refused.
    """
    outer = geometric(root, sweep)
    variants: list[Variant] = []
    geometries = list(_geometries(root, sweep, outer, overrides))
    for one in geometries:
        try:
            found = _read_one(ctx, one, read, one.words)
        except StudyError:
            raise StudyError([*ctx.errors.problems, *_said_where(ctx, one, geometries, read)]) from None
        study, reason = (None, found) if isinstance(found, str) else (found, "")
        variants.append(Variant(one.words, one.index, one.places, study, reason))
    first = next((one.study for one in variants if one.study is not None), None)
    if first is None:
        what = f"no geometry of the sweep can be made ({variants[0].words}: {variants[0].reason})"
        ctx.errors.at(sweep.axes[outer[0]].node, what, "sweep over others", on_key=True)
        raise StudyError(ctx.errors.problems)
    if first.mesh.open_ended:
        what = "changes the body or its meshes, and with a tolerance or adaptive meshes each would end on another level"
        remedy = "use a uniform or graded family, or write one study for each geometry"
        ctx.errors.at(sweep.axes[outer[0]].node, what, remedy, on_key=True)
    if ctx.errors.problems:
        raise StudyError(ctx.errors.problems)
    return replace(
        first,
        scenes=Scenes.joined([((one.study or first).scenes, one.places) for one in variants]),
        variants=tuple(variants),
        axes=records(sweep, ctx.units),
        mode=sweep.mode,
        design=sweep.design,
        overrides=said,
    )


@dataclass(frozen=True, eq=False)
class _Geometry:
    """The study with the swept numbers of one geometry put in.

    index: places of the values of the outer axes;  places: of the points;  rest: what of the sweep is left
    said:  options with which the text of the whole study is that of this geometry
    """

    words: str
    index: tuple[int, ...]
    places: np.ndarray
    root: Node
    rest: Sweep
    said: tuple[str, ...]


def _geometries(root: Node, sweep: Sweep, outer: list[int], overrides: tuple[str, ...]) -> Iterator[_Geometry]:
    """The geometries of a sweep in order."""
    for index, places, rest in _combinations(sweep, outer):
        axes = [sweep.axes[i] for i in outer]
        values = [axis.values[k] for axis, k in zip(axes, index, strict=True)]
        words = ", ".join(f"{axis.key} = {value.brief()}" for axis, value in zip(axes, values, strict=True))
        own = root
        for axis, value in zip(axes, values, strict=True):
            with suppress(KeyError):  # something else stands there, which the section's reader records
                own = put(own, split_path(".".join(axis.parameter.path)) or (), value)
        yield _Geometry(words, index, places, own, rest, _said(overrides, sweep, outer, values, rest))


def _read_one(ctx: Context, one: _Geometry, read: Callable[..., Study], words: str) -> Study | str:
    """The study of a geometry, or why it is refused. words: for the geometry in faults. Raises StudyError."""
    inner = Context(Collector(), ctx.units, ctx.folder, ctx.named)
    inner.errors.geometry = words
    if names := one.root.child("parameters"):
        inner.named = read_parameters(inner, names)
    refused: list[str] = []
    inner.errors.refused = refused
    try:
        study = read(inner, one.root, one.rest, one.said)
    except StudyError:
        if not refused:
            raise
    return refused[0] if refused else study


def _said_where(
    ctx: Context, one: _Geometry, geometries: Sequence[_Geometry], read: Callable[..., Study]
) -> Sequence[Problem]:
    """The faults of a geometry, in its words unless another geometry has the same."""

    def faults(of: _Geometry, words: str) -> Sequence[Problem]:
        try:
            _read_one(ctx, of, read, words)
        except StudyError as error:
            return error.problems
        return ()

    elsewhere = [fault for other in (geometries[0], geometries[-1]) if other is not one for fault in faults(other, "")]
    return [
        plain if plain in elsewhere else fault
        for plain, fault in zip(faults(one, ""), faults(one, one.words), strict=True)
    ]


def _combinations(sweep: Sweep, outer: list[int]) -> list[tuple[tuple[int, ...], np.ndarray, Sweep]]:
    """(places of the values of the outer axes, places of the points, what of the sweep is left) of every geometry."""
    inner = [i for i in range(len(sweep.axes)) if i not in outer]
    if sweep.mode == "grid":
        sizes = [len(axis.values) for axis in sweep.axes]
        points = np.arange(math.prod(sizes), dtype=np.intp).reshape(sizes)
        rest = replace(sweep, axes=tuple(sweep.axes[i] for i in inner))
        return [
            (index, np.moveaxis(points, outer, range(len(outer)))[index].ravel(), rest)
            for index in itertools.product(*(range(sizes[i]) for i in outer))
        ]
    found: dict[tuple[float | str, ...], list[int]] = {}
    for k in range(len(sweep.axes[0].values)):
        found.setdefault(tuple(sweep.axes[i].labels[k] for i in outer), []).append(k)
    made = []
    for places in found.values():
        axes = tuple(_at_places(sweep.axes[i], places) for i in inner)
        rest = replace(sweep, axes=axes, mode="list" if axes else "grid", design=None, tabled=False)
        made.append(((places[0],) * len(outer), np.array(places, dtype=np.intp), rest))
    return made


def _at_places(axis: SweptAxis, places: list[int]) -> SweptAxis:
    return replace(axis, values=tuple(axis.values[k] for k in places), labels=tuple(axis.labels[k] for k in places))


def _said(
    overrides: tuple[str, ...], sweep: Sweep, outer: list[int], values: list[Node], rest: Sweep
) -> tuple[str, ...]:
    """The options with which the text of the whole study is that of one geometry."""
    fixed = [
        f"{'.'.join(sweep.axes[i].parameter.path)}={json.dumps(value.plain(), ensure_ascii=False)}"
        for i, value in zip(outer, values, strict=True)
    ]
    size: dict[str, object] = {"h": rest.h.plain()} if rest.h else {}
    swept: dict[str, object]
    if rest.mode == "grid":
        swept = {axis.key: _plain(axis) for axis in rest.axes}
    else:
        points = range(len(rest.axes[0].values))
        rows = [{axis.key: _plain(_at_places(axis, [k]), single=True) for axis in rest.axes} for k in points]
        swept = {"mode": "list", "points": rows}
    return (*with_sweep(overrides, swept | size), *fixed)


def _plain(axis: SweptAxis, single: bool = False) -> object:
    """The values of an axis, or its single one, as a sweep has them."""
    plain = [value.plain() for value in axis.values]
    if axis.parameter.is_whole:
        return dict(zip(map(str, axis.labels), plain, strict=True))
    return plain[0] if single else plain
