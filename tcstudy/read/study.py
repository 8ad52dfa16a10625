"""A study file to a Study: every number of every sweep point checked, all faults reported at once.

Where a sweep varies numbers of the body or of the meshes there is one study for each geometry: the
study with the swept numbers put into `body`, `mesh` or `parameters`, read by the same code as any
other. What is wrong with its shape, or with its element size for it, refuses its points with the
reason, since the other geometries are sound; every other fault is one of the study.

`exact.loads: derived`: loads that follow from the exact solution are left out of the study, which
is read with 0 in their places, and put into its scenes. What is given although it would be derived,
in the study or in its sweep, is a fault. The word `derived` may stand in the place of a load; where
an edge is held in one component only it must: {role: clamped, u_x: derived}.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from tcstudy.errors import Problem, StudyError
from tcstudy.exact.solution import Checks, Derivation, SolutionFault
from tcstudy.read.body import check_finite, read_body
from tcstudy.read.document import (
    COMPONENTS,
    Collector,
    Node,
    apply_overrides,
    compose,
    load_text,
    put,
    split_path,
    with_sweep,
)
from tcstudy.read.fields import Context, Fields, none_after_fault, read_parameters, users, words_in
from tcstudy.read.fit import read_fit, read_tests
from tcstudy.read.loads import check_together, read_history, read_path, read_sensitivity
from tcstudy.read.plans import read_mesh, read_output, read_solver
from tcstudy.read.scenes import SceneReader
from tcstudy.read.sweep import Sweep, read_sweep, with_swept_keys
from tcstudy.scene.keys import of_role, row, rows
from tcstudy.scene.parameters import SHORT
from tcstudy.scene.parameters import Keys as Place
from tcstudy.scene.points import GEOMETRIC, Scenes
from tcstudy.scene.records import Body, Convection, Scene
from tcstudy.scene.study import Exact, Study, Variant

REQUIRED = tuple(row.name for row in rows("").values() if row.required)


def read_study(
    path: str | Path, overrides: Sequence[str] = (), *, swept: bool | None = True
) -> Study:
    """The study in a file, with `--set` options key=value put in; raises StudyError with all its
    problems.

    swept: whether the sweep is used, so that an option for a swept key would be lost; None: unless
    the study is run as a path, which is of the scene outside it
    """
    path = Path(path)
    return read_study_text(load_text(path), str(path), overrides, path, swept=swept)


def body_as_given(path: Path, overrides: Sequence[str] = ()) -> Body | None:
    """The body of a study that has faults, unjudged; None where it cannot be read either."""
    ctx, root = _begun(load_text(path), str(path), overrides, path)
    if not isinstance(root.value, Mapping) or (node := root.at("body")) is None:
        return None
    ctx.named = read_parameters(ctx, root.at("parameters"))
    return read_body(ctx, node)[0]


def _begun(
    text: str, name: str, overrides: Sequence[str], source: Path | None
) -> tuple[Context, Node]:
    ctx = Context(Collector(), folder=source.parent if source else Path())
    root = apply_overrides(compose(text, name, ctx.errors), tuple(overrides), SHORT, ctx.errors)
    if units := root.at("units"):
        ctx.units = "none" if ctx.choice(units, row("", "units").words) == "none" else "SI"
    return ctx, root


def read_study_text(
    text: str,
    name: str = "<text>",
    overrides: Sequence[str] = (),
    source: Path | None = None,
    *,
    swept: bool | None = True,
    with_files: bool = True,
) -> Study:
    """The study in a text, called `name` in messages; raises StudyError with all its problems.

    source: the file that the text was read from, if any: other files are sought beside it;  swept: as of `read_study`
    with_files: whether the file of a body must be there; a study in a result file is read without it
    """
    overrides = tuple(overrides)
    ctx, root = _begun(text, name, overrides, source)
    ctx.with_files = with_files
    if not isinstance(root.value, Mapping):
        ctx.at(
            root, f"a study is a mapping, but this is {root.kind()}", "see configs/quickstart.yaml"
        )
        raise StudyError(ctx.errors.problems)
    words = {key: ctx.text(node) for key in ("title", "institution") if (node := root.at(key))}
    header = {"title": source.stem if source else name} | words | {"text": text, "source": source}
    before = len(ctx.errors)
    ctx.named = read_parameters(ctx, root.at("parameters"))
    if len(ctx.errors) > before and not ctx.named:  # every use of a name would be one fault more
        raise StudyError(ctx.errors.problems)
    if swept is None:
        swept = not root.at("path") or bool(root.at("history") or root.at("fit"))
    sweep = read_sweep(ctx, root, swept)
    said = (
        with_sweep(overrides, sweep.mode, sweep.records(ctx.units)) if sweep.tabled else overrides
    )
    if sweep.axes and geometric(root, sweep):
        return read_variants(ctx, root, sweep, overrides, said, partial(_one_body, header))
    study = _one_body(header, ctx, root, sweep, said)
    if root.at("fit", "tests") is None:
        return study
    return read_tests(
        ctx,
        root,
        study,
        lambda options: read_study_text(text, name, options, source, with_files=with_files),
    )


def _one_body(
    header: dict[str, Any], ctx: Context, root: Node, sweep: Sweep, said: tuple[str, ...]
) -> Study:
    """The study of one body and its meshes. said: options that make the text this study."""
    root = with_swept_keys(without_loads(ctx, root, sweep) if root.at("exact") else root, sweep)
    Fields(ctx, root, "", REQUIRED)
    memory = root.at("history", "memory")
    loose = memory is not None and all(
        one.value == "friction" for one in memory.children.values() or (memory,)
    )
    reader = SceneReader(ctx, root, sweep, loose=loose)
    reader.read()
    ctx.errors.point = ""
    mesh, solver, output = (
        read_mesh(ctx, reader),
        read_solver(ctx, root.at("solver")),
        read_output(ctx, reader),
    )
    path = read_path(ctx, reader, mesh) if root.at("path") else None
    exact = read_exact(ctx, reader) if root.at("exact") else None
    history = read_history(ctx, reader, mesh) if reader.scenes and root.at("history") else None
    if output and not ctx.errors.problems and (node := root.at("output", "sensitivity")):
        output = replace(output, sensitivity=read_sensitivity(ctx, node, reader, exact, history))
    fit = (
        read_fit(ctx, reader, mesh, history) if not ctx.errors.problems and root.at("fit") else None
    )
    if ctx.errors.problems:
        _check_keys(ctx, root, ("history", "fit"))
    if any(map(root.at, ("path", "exact", "history", "fit"))) or (output and output.live):
        check_together(ctx, reader, mesh, solver, output, exact)
    scenes = reader.scenes
    if exact and exact.derived and reader.body and not ctx.errors.problems:
        scenes = derived_scenes(ctx, reader, exact, reader.body)
    if ctx.errors.problems or mesh is None or solver is None or output is None:
        raise StudyError(ctx.errors.problems)
    axes = sweep.records(ctx.units) if sweep.axes else ()
    sweep_said = {"mode": sweep.mode, "axes": axes, "design": sweep.design, "overrides": said}
    plans = {
        "mesh": mesh,
        "solver": solver,
        "output": output,
        "exact": exact,
        "path": path,
        "history": history,
    }
    return Study(**header | sweep_said | plans, fit=fit, scenes=scenes, units=ctx.units)


def _check_keys(ctx: Context, root: Node, names: Iterable[str]) -> None:
    """Record what is wrong with sections that need a scene by their keys alone, and by values that
    need none; what their readers recorded is not repeated."""
    for name in names:
        if (node := root.at(name)) is not None:
            plain = [key for key, one in rows(name).items() if one.kind in PLAIN_KINDS]
            Fields(ctx, node, name).given(plain)


PLAIN_KINDS = ("integer", "choice", "flag")
"""Kinds of keys whose values are judged by themselves."""


def geometric(root: Node, sweep: Sweep) -> list[int]:
    """The axes that change the body or its meshes: numbers of these sections, and names that they
    use."""
    sections = [node for name in GEOMETRIC if (node := root.at(name)) is not None]

    def moves(path: tuple[str, ...]) -> bool:
        names = users(root, path[-1]) if path[0] == "parameters" else ()
        return path[0] in GEOMETRIC or any(words_in(node, names) for node in sections)

    return [i for i, axis in enumerate(sweep.axes) if moves(axis.path)]


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
    Raises StudyError with the faults of the first geometry that has some, or if all are refused."""
    outer, variants = geometric(root, sweep), list[Variant]()

    def of(
        one: Variant, root: Node, rest: Sweep, said: tuple[str, ...]
    ) -> tuple[Variant, tuple[Problem, ...]]:
        """A geometry with its study, or with why it is refused; and what else is wrong with it."""
        inner = Context(Collector(), ctx.units, ctx.folder, ctx.named)
        inner.named = read_parameters(inner, root.at("parameters"))
        refused = inner.errors.refused = []
        try:
            study = read(inner, root, rest, said)
            return replace(one, study=None if refused else study, reason=(refused or [""])[0]), ()
        except StudyError as error:
            return replace(one, reason=(refused or [""])[0]), () if refused else error.problems

    geometries = list(_geometries(ctx, root, sweep, outer, overrides))
    for number, one in enumerate(geometries):
        made, problems = of(*one)
        if problems:  # those that the first or the last has as well are of the study
            others = {
                p for at in {0, len(geometries) - 1} - {number} for p in of(*geometries[at])[1]
            }
            own = [p if p in others or p.key.startswith("sweep") else replace(p, what=f"{p.what} (with {made.words})")
                   for p in problems]  # fmt: skip
            raise StudyError([*ctx.errors.problems, *own])
        variants.append(made)
    first = next((one.study for one in variants if one.study is not None), None)
    if first is None:
        what = f"no geometry of the sweep can be made ({variants[0].words}: {variants[0].reason})"
        ctx.at(sweep.axes[outer[0]].node, what, "sweep over others", on_key=True)
    elif first.mesh.open_ended:
        what = "changes the body or its meshes, and with a tolerance or adaptive meshes each would end on another level"
        remedy = "use a uniform or graded family, or write one study for each geometry"
        ctx.at(sweep.axes[outer[0]].node, what, remedy, on_key=True)
    if first is None or ctx.errors.problems:
        raise StudyError(ctx.errors.problems)
    scenes = Scenes.joined([((one.study or first).scenes, one.places) for one in variants])
    said_of_sweep = {
        "axes": sweep.records(ctx.units),
        "mode": sweep.mode,
        "design": sweep.design,
        "overrides": said,
        "geometric": tuple(outer),
    }
    return replace(first, scenes=scenes, variants=tuple(variants), **said_of_sweep)  # type: ignore[arg-type]


def _geometries(
    ctx: Context, root: Node, sweep: Sweep, outer: list[int], overrides: tuple[str, ...]
) -> Iterator[tuple[Variant, Node, Sweep, tuple[str, ...]]]:
    """The geometries of a sweep in order: each without its study, the text with its numbers put in,
    what of the sweep is left, and the options with which the text of the whole study is that of
    this geometry."""
    axes, inner = (
        [sweep.axes[i] for i in outer],
        tuple(axis for i, axis in enumerate(sweep.axes) if i not in outer),
    )
    found: dict[tuple[float | str, ...], list[int]] = {}
    for k, at in enumerate(sweep.places[outer].T.tolist()):
        found.setdefault(
            tuple(axis.labels[j] for axis, j in zip(axes, at, strict=True)), []
        ).append(k)
    rest = replace(sweep, axes=inner)
    said = with_sweep(overrides, sweep.mode, rest.records(ctx.units))
    for places in found.values():
        index = tuple(sweep.places[outer, places[0]].tolist())
        if sweep.mode == "list":
            left = tuple(axis.at(places) for axis in inner)
            rest = replace(
                sweep, axes=left, mode="list" if left else "grid", design=None, tabled=False
            )
            said = with_sweep(overrides, rest.mode, rest.records(ctx.units))
        words, own, made = [], list(said), root
        for axis, k in zip(axes, index, strict=True):
            path, value = ".".join(axis.path), axis.values[k]
            words.append(f"{axis.key} = {value.brief()}")
            own.append(f"{path}={json.dumps(value.plain(), ensure_ascii=False)}")
            with suppress(
                KeyError
            ):  # something else stands there, which the section's reader records
                made = put(made, split_path(path) or (), value)
        yield (
            Variant(", ".join(words), np.array(places, dtype=np.intp), None),
            made,
            rest,
            tuple(own),
        )


DERIVED = "derived"
TRACTIONS = tuple(name for name in of_role("traction") if name != "heat")
OF_HEAT = (*(row.name for row in rows("heat").values() if row.affine), "omega")
"""Keys of `heat` that are derived."""
FOLLOWS = "exact.loads: derived makes it follow from the exact solution"
REMEDY = "leave it out, or remove exact.loads to give all loads yourself"


def without_loads(ctx: Context, root: Node, sweep: Sweep) -> Node:
    """The study with 0 for all loads that will be derived; those that are given are recorded as
    faults. A misspelt word asks for derived loads as well, so that it is the only fault."""
    word = root.at("exact", "loads")
    if word is None or word.value == "given" or not isinstance(root.value, Mapping):
        return root
    if root.at("body", "file"):
        what = "the body comes from a file, whose normals are no expressions, so loads cannot be derived"
        ctx.at(word, what, "give the loads, or describe the body by its outline")
    if path := root.at("path"):
        what = "a path changes a load, but loads: derived leaves none to change"
        ctx.at(path, what, "remove path, or give the loads", on_key=True)
    for axis in sweep.axes:
        section, last = axis.path[0], axis.path[-1]
        if section in ("boundary", "loads") or (section == "heat" and last in OF_HEAT):
            remedy = "remove it from the sweep, or give the loads"
            ctx.at(axis.node, f"{axis.key} is swept, but {FOLLOWS}", remedy, on_key=True)

    boundary, zero = root.at("boundary"), replace(word, value=0)
    roles = (
        {name: edge.nearest("role").value for name, edge in boundary.children.items()}
        if boundary
        else {}
    )
    zeros: dict[tuple[str, ...], Node] = {("heat", "theta_bar"): zero}
    zeros["loads", "f"] = replace(word, value=(zero, zero))
    zeros |= {
        ("boundary", name, "pressure"): zero for name, role in roles.items() if role == "traction"
    }
    if root.at("heat", "theta"):  # that it is given is the fault, not that alpha is not
        zeros["heat", "alpha"] = replace(word, value=1)
    derived: dict[Place, Place] = {("loads",): ("f",), ("heat",): OF_HEAT}
    derived |= {
        ("boundary", name): COMPONENTS if role == "clamped" else TRACTIONS
        for name, role in roles.items()
    }
    for place, key in ((place, key) for place, keys in derived.items() for key in keys):
        if (given := root.at(*place, key)) is None:
            continue
        held, parts = key in COMPONENTS, given.entries if key == "u" else (given,)
        for part in parts:
            if part.value != DERIVED and not (held and part.value == "free"):
                ctx.at(part, f"is given, but {FOLLOWS}", REMEDY, on_key=part is given)
        none = tuple(part if part.value == "free" else replace(part, value=0) for part in parts)
        new = replace(given, value=(none * 2)[:2]) if key == "u" else none[0]
        root = put(root, (*place, key), new if held else None)
    for place, number in zeros.items():
        with suppress(KeyError):  # something else stands there, which the section's reader records
            root = put(root, place, number) if root.at(place[0]) and not root.at(*place) else root
    return put(root, ("path",), None)


def derived_scenes(ctx: Context, reader: SceneReader, exact: Exact, body: Body) -> Sequence[Scene]:
    """The scenes with their loads; what forbids it is recorded, once for each place."""
    checks, derivation, before = Checks(exact, body), Derivation(exact, body), len(ctx.errors)
    root, sweep, scenes = reader.root, reader.sweep, reader.scenes

    def sound(faults: Iterable[SolutionFault]) -> bool:
        for keys, what, remedy in faults:
            ctx.at(root.nearest("exact", *keys), what, remedy)
        return len(ctx.errors) == before

    if not sound((*_missing(exact, scenes), *checks.kinks())):
        return scenes
    made = list[Scene]()
    for scene, point in zip(scenes, sweep.places.T.tolist(), strict=True):
        ctx.errors.point = reader.words(tuple(point), range(len(point)))
        made.append(derivation.scene(scene))
        if not sound(checks.scene(made[-1])):
            break
    ctx.errors.point = ""
    return Scenes.of(made) if len(made) == len(scenes) else scenes


def _missing(exact: Exact, scenes: Sequence[Scene]) -> Iterator[SolutionFault]:
    if exact.theta is None:
        beta = any(scene.material.expands for scene in scenes)
        if beta or scenes[0].edges(Convection):
            why = "beta makes it load the body" if beta else "there are convection edges"
            yield (), f"theta is missing: {why}", 'add theta: "...", or theta: 0'
    elif scenes[0].edges(Convection) and any(scene.heat.alpha == 0.0 for scene in scenes):
        what = "with alpha = 0 no theta_bar can be derived: no heat passes convection edges"
        yield ("theta",), what, "give alpha > 0, or make the edges free or traction"


@none_after_fault
def read_exact(ctx: Context, reader: SceneReader) -> Exact:
    """The exact solution; None after a fault."""
    fields = Fields(ctx, reader.root.nearest("exact"), "exact")
    u, theta, xi, exponent, loads = (
        fields.value(key) for key in ("u", "theta", "xi", "exponent", "loads")
    )
    exact = Exact(u, theta, xi, exponent, loads == DERIVED)
    ctx.sound()
    if reader.body is not None:
        check_finite(ctx, reader.root, "exact", exact, reader.body)
    return exact
