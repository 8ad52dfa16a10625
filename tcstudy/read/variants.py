"""Reads a study whose sweep varies numbers of the body or of the meshes: one study for each geometry.

A geometry is the study with the swept numbers put into `body`, `mesh` or `parameters`, read by the same code as any
other. What is wrong with its shape, or with its element size for it, refuses its points with the reason, since the
other geometries are sound; every other fault is one of the study.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np

from tcstudy.errors import Problem, StudyError
from tcstudy.read.document import with_sweep
from tcstudy.read.fields import Context
from tcstudy.read.node import Collector, Node, put, split_path
from tcstudy.read.parameters import read_parameters, users, words_in
from tcstudy.read.sweep import Sweep, records
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
        study, reason, problems = _read_one(ctx, one, read)
        if problems:
            others = {p for at in {geometries[0], geometries[-1]} - {one} for p in _read_one(ctx, at, read)[2]}
            said_where = (p if p in others else _of(p, one.words) for p in problems)
            raise StudyError([*ctx.errors.problems, *said_where])
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
    axes, inner = [sweep.axes[i] for i in outer], tuple(axis for i, axis in enumerate(sweep.axes) if i not in outer)
    if sweep.mode == "grid":
        sizes = [len(axis.values) for axis in sweep.axes]
        points = np.arange(math.prod(sizes), dtype=np.intp).reshape(sizes)
        points = np.moveaxis(points, outer, range(len(outer)))
        groups = {index: points[index].ravel() for index in np.ndindex(points.shape[: len(outer)])}
    else:
        found: dict[tuple[float | str, ...], list[int]] = {}
        for k in range(len(sweep.axes[0].values)):
            found.setdefault(tuple(axis.labels[k] for axis in axes), []).append(k)
        groups = {(at[0],) * len(axes): np.array(at, dtype=np.intp) for at in found.values()}
    said = with_sweep(overrides, replace(sweep, axes=inner).written()) if sweep.mode == "grid" else ()
    for index, places in groups.items():
        rest, own = replace(sweep, axes=inner), said
        if sweep.mode == "list":
            left = tuple(axis.at(places) for axis in inner)
            rest = replace(sweep, axes=left, mode="list" if left else "grid", design=None, tabled=False)
            own = with_sweep(overrides, rest.written())
        words, fixed, made = [], [], root
        for axis, k in zip(axes, index, strict=True):
            path, value = ".".join(axis.parameter.path), axis.values[k]
            words.append(f"{axis.key} = {value.brief()}")
            fixed.append(f"{path}={json.dumps(value.plain(), ensure_ascii=False)}")
            with suppress(KeyError):  # something else stands there, which the section's reader records
                made = put(made, split_path(path) or (), value)
        yield _Geometry(", ".join(words), index, places, made, rest, (*own, *fixed))


def _read_one(
    ctx: Context, one: _Geometry, read: Callable[..., Study]
) -> tuple[Study | None, str, tuple[Problem, ...]]:
    """The study of a geometry, why it is refused, and what else is wrong with it."""
    inner = Context(Collector(), ctx.units, ctx.folder, ctx.named, known=ctx.known)
    if names := one.root.child("parameters"):
        inner.named = read_parameters(inner, names)
    refused = inner.errors.refused = []
    try:
        study = read(inner, one.root, one.rest, one.said)
        return (None, refused[0], ()) if refused else (study, "", ())
    except StudyError as error:
        return None, refused[0] if refused else "", () if refused else error.problems


def _of(problem: Problem, words: str) -> Problem:
    """A fault that other geometries do not have."""
    return problem if problem.key.startswith("sweep") else replace(problem, what=f"{problem.what} (with {words})")
