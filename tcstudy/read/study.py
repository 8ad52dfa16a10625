"""Reading a study file: every number of every sweep point checked, all faults reported at once.

Where a sweep varies numbers of the body or of the meshes there is one study for each geometry. It
is the study with the swept numbers put into `body`, `mesh` or `parameters`, read by the same code
as any other. A fault of its shape, or of its element size, refuses its points with the reason,
since the other geometries are sound. Every other fault is a fault of the study.

`exact.loads: derived`: loads that follow from the exact solution are left out of the study, which
is read with 0 in their places, and put into its scenes. A load that is given or swept although it
would be derived is a fault. The word `derived` may stand in the place of a load. It must where an
edge is held in one component only: {role: clamped, u_x: derived}.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any, Literal

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
from tcstudy.read.opening import check_opening
from tcstudy.read.physics import contact_edges, has_no_friction, laws_by_edge
from tcstudy.read.plans import read_mesh, read_output, read_solver
from tcstudy.read.scenes import SceneReader
from tcstudy.read.sweep import Sweep, read_sweep, with_swept_keys
from tcstudy.scene.keys import of_role, row, rows
from tcstudy.scene.parameters import SHORT
from tcstudy.scene.parameters import Keys as Place
from tcstudy.scene.points import GEOMETRIC, Scenes
from tcstudy.scene.records import Body, Convection, Scene
from tcstudy.scene.study import Exact, Study, Variant


def read_study(
    path: str | Path, overrides: Sequence[str] = (), *, swept: bool | None = True
) -> Study:
    """Return the study in a file, with `--set` options key=value put in.

    swept: whether the sweep is used, so that an option for a swept key would be lost; None: unless
           the study is run as a path, which is of the scene outside the sweep
    Raises StudyError with all faults.
    """
    path = Path(path)
    return read_study_text(load_text(path), str(path), overrides, path, swept=swept)


def body_as_given(path: Path, overrides: Sequence[str] = ()) -> Body | None:
    """Return the body of a study that has faults, unchecked; None if it cannot be read either."""
    ctx, root = _root(load_text(path), str(path), overrides, path)
    node = root.at("body") if isinstance(root.value, Mapping) else None
    if node is None:
        return None
    ctx.named = read_parameters(ctx, root.at("parameters"))
    return read_body(ctx, node)[0]


def _root(
    text: str, name: str, overrides: Sequence[str], source: Path | None
) -> tuple[Context, Node]:
    """Return the context and the root of a study, with its options put in."""
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
    """Return the study in a text, called `name` in messages.

    source:     file of the text, if any: other files are sought beside it
    swept:      as of `read_study`
    with_files: whether the file of a body must be there; a study in a result file is read without
    Raises StudyError with all faults.
    """
    overrides = tuple(overrides)
    ctx, root = _root(text, name, overrides, source)
    ctx.with_files = with_files
    if not isinstance(root.value, Mapping):
        fault = f"a study is a mapping, but this is {root.kind()}"
        ctx.at(root, fault, "see configs/quickstart.yaml")
        raise StudyError(ctx.errors.problems)
    header: dict[str, Any] = {"title": source.stem if source else name}
    for key in ("title", "institution"):
        if node := root.at(key):
            header[key] = ctx.text(node)
    header |= {"text": text, "source": source}
    fault_count = len(ctx.errors)
    ctx.named = read_parameters(ctx, root.at("parameters"))
    # without names every use of one would be a further fault
    if len(ctx.errors) > fault_count and not ctx.named:
        raise StudyError(ctx.errors.problems)
    if swept is None:
        swept = not root.at("path") or bool(root.at("history") or root.at("fit"))
    sweep = read_sweep(ctx, root, swept)
    options = overrides
    if sweep.tabled:
        options = with_sweep(overrides, sweep.mode, sweep.records(ctx.units))
    if sweep.axes and geometric(root, sweep):
        return read_variants(ctx, root, sweep, overrides, options, partial(_one_body, header))
    study = _one_body(header, ctx, root, sweep, options)
    if root.at("fit", "tests") is None:
        return study

    def read_test(test_options: Sequence[str]) -> Study:
        return read_study_text(text, name, test_options, source, with_files=with_files)

    return read_tests(ctx, root, study, read_test)


def _one_body(
    header: dict[str, Any], ctx: Context, root: Node, sweep: Sweep, options: tuple[str, ...]
) -> Study:
    """Return the study of one body and its meshes. options: that make the text this study"""
    if root.at("exact"):
        root = without_loads(ctx, root, sweep)
    root = with_swept_keys(root, sweep)
    Fields(ctx, root, "", _required(root))
    reader = SceneReader(ctx, root, sweep)
    reader.read()
    ctx.errors.point = ""
    mesh = read_mesh(ctx, reader)
    solver = read_solver(ctx, root.at("solver"))
    output = read_output(ctx, reader)
    path = read_path(ctx, reader, mesh) if root.at("path") else None
    exact = read_exact(ctx, reader) if root.at("exact") else None
    history = read_history(ctx, reader, mesh) if reader.scenes and root.at("history") else None
    if output and not ctx.errors.problems and (node := root.at("output", "sensitivity")):
        output = replace(output, sensitivity=read_sensitivity(ctx, node, reader, exact, history))
    if mesh is not None and not ctx.errors.problems:
        is_live = output is not None and output.live
        for keys, fault, remedy in reader.loose_faults(mesh, path, is_live):
            ctx.at(root.nearest(*map(str, keys)), fault, remedy)
    fit = None
    if root.at("fit") and not ctx.errors.problems:
        fit = read_fit(ctx, reader, mesh, history)
    if reader.not_held:
        check_opening(ctx, root, reader.scenes, mesh, output, history)
    if not ctx.errors.problems and (reader.not_held or _mentions_coulomb(root)):
        # imported only for such studies
        from tcstudy.read.pressed import check_pressed

        check_pressed(ctx, root, reader.scenes, solver, history)
    if ctx.errors.problems:
        _check_keys(ctx, root, ("history", "fit"))
    if any(map(root.at, ("path", "exact", "history", "fit"))) or (
        output and (output.live or output.quantities)
    ):
        check_together(ctx, reader, mesh, solver, output, exact)
    scenes = reader.scenes
    if exact and exact.derived and reader.body and not ctx.errors.problems:
        scenes = derived_scenes(ctx, reader, exact, reader.body)
    if ctx.errors.problems or mesh is None or solver is None or output is None:
        raise StudyError(ctx.errors.problems)
    return Study(
        **header,
        mode=sweep.mode,
        axes=sweep.records(ctx.units) if sweep.axes else (),
        design=sweep.design,
        overrides=options,
        mesh=mesh,
        solver=solver,
        output=output,
        exact=exact,
        path=path,
        history=history,
        fit=fit,
        scenes=scenes,
        units=ctx.units,
    )


def _mentions_coulomb(root: Node) -> bool:
    """Return whether the text of a study has Coulomb's friction, in its section or in a sweep."""
    sections = (root.at(name) for name in ("friction", "sweep"))
    return any(node is not None and "coulomb" in node.text() for node in sections)


def _required(root: Node) -> tuple[str, ...]:
    """Return the sections that a study cannot be without: friction, unless all of Γ_C opens.

    Where adhesion names an edge that is none, it is not known which edges open.
    """
    is_known = set(laws_by_edge(root.at("adhesion"))) <= set(contact_edges(root))
    needs_friction = is_known and not has_no_friction(root)
    names = (name for name, row in rows("").items() if row.required or name == "friction")
    return tuple(name for name in names if name != "friction" or needs_friction)


def _check_keys(ctx: Context, root: Node, names: Iterable[str]) -> None:
    """Record faults of sections that can be found without a scene: of keys and plain values.

    Faults that their readers recorded are not repeated.
    """
    for name in names:
        node = root.at(name)
        if node is not None:
            plain = [key for key, row in rows(name).items() if row.kind in PLAIN_KINDS]
            Fields(ctx, node, name).given(plain)


PLAIN_KINDS = ("integer", "choice", "flag")
"""Kinds of keys whose values are checked without other values."""


def geometric(root: Node, sweep: Sweep) -> list[int]:
    """Return the axes that change the body or its meshes.

    They are numbers of these sections, and names that the sections use.
    """
    sections = [node for name in GEOMETRIC if (node := root.at(name)) is not None]

    def changes_geometry(path: tuple[str, ...]) -> bool:
        names = users(root, path[-1]) if path[0] == "parameters" else ()
        return path[0] in GEOMETRIC or any(words_in(node, names) for node in sections)

    return [i for i, axis in enumerate(sweep.axes) if changes_geometry(axis.path)]


@dataclass(frozen=True)
class _Geometry:
    """A geometry of a sweep before it is read.

    variant: without its study
    root:    the study with the numbers of the geometry put in
    sweep:   the axes that do not change the geometry
    options: with which the text of the whole study is that of this geometry
    """

    variant: Variant
    root: Node
    sweep: Sweep
    options: tuple[str, ...]


def read_variants(
    ctx: Context,
    root: Node,
    sweep: Sweep,
    overrides: tuple[str, ...],
    options: tuple[str, ...],
    read: Callable[..., Study],
) -> Study:
    """Return the study of all geometries; a refused one has the scenes of the first sound one.

    options: that make the text this study
    read:    (ctx, root, sweep, options) → Study, for one geometry
    Raises StudyError with the faults of the first faulty geometry, or if all are refused.
    """
    outer = geometric(root, sweep)
    geometries = list(_geometries(ctx, root, sweep, outer, overrides))
    variants = list[Variant]()
    for number, geometry in enumerate(geometries):
        variant, problems = _read_geometry(ctx, geometry, read)
        if problems:
            # problems that the first or the last geometry has as well are of the study
            shared = set[Problem]()
            for end in {0, len(geometries) - 1} - {number}:
                shared |= {*_read_geometry(ctx, geometries[end], read)[1]}
            problems = tuple(_with_words(p, variant.words, shared) for p in problems)
            raise StudyError([*ctx.errors.problems, *problems])
        variants.append(variant)
    sound = next((variant.study for variant in variants if variant.study is not None), None)
    axis_node = sweep.axes[outer[0]].node
    if sound is None:
        reason = f"{variants[0].words}: {variants[0].reason}"
        fault = f"no geometry of the sweep can be made ({reason})"
        ctx.at(axis_node, fault, "sweep over others", on_key=True)
    elif sound.mesh.open_ended:
        condition = "with a tolerance or adaptive meshes each would end on another level"
        fault = f"changes the body or its meshes, and {condition}"
        remedy = "use a uniform or graded family, or write one study for each geometry"
        ctx.at(axis_node, fault, remedy, on_key=True)
    if sound is None or ctx.errors.problems:
        raise StudyError(ctx.errors.problems)
    return replace(
        sound,
        scenes=Scenes.joined([((v.study or sound).scenes, v.places) for v in variants]),
        variants=tuple(variants),
        axes=sweep.records(ctx.units),
        mode=sweep.mode,
        design=sweep.design,
        overrides=options,
        geometric=tuple(outer),
    )


def _read_geometry(
    ctx: Context, geometry: _Geometry, read: Callable[..., Study]
) -> tuple[Variant, tuple[Problem, ...]]:
    """Return a geometry with its study, or with why it is refused; and its other problems."""
    inner = Context(Collector(), ctx.units, ctx.folder, ctx.named)
    inner.named = read_parameters(inner, geometry.root.at("parameters"))
    refusals = inner.errors.refused = []
    study: Study | None = None
    problems: tuple[Problem, ...] = ()
    try:
        study = read(inner, geometry.root, geometry.sweep, geometry.options)
    except StudyError as error:
        problems = error.problems
    if refusals:
        return replace(geometry.variant, reason=refusals[0]), ()
    return replace(geometry.variant, study=study, reason=""), problems


def _with_words(problem: Problem, words: str, shared: set[Problem]) -> Problem:
    """Return a problem with the words of its geometry, unless it is of the whole study."""
    if problem in shared or problem.key.startswith("sweep"):
        return problem
    return replace(problem, what=f"{problem.what} (with {words})")


def _geometries(
    ctx: Context, root: Node, sweep: Sweep, outer: list[int], overrides: tuple[str, ...]
) -> Iterator[_Geometry]:
    """Yield the geometries of a sweep in order. outer: the axes that change the geometry"""
    outer_axes = [sweep.axes[i] for i in outer]
    inner_axes = tuple(axis for i, axis in enumerate(sweep.axes) if i not in outer)
    places_by_labels: dict[tuple[float | str, ...], list[int]] = {}
    for place, indices in enumerate(sweep.places[outer].T.tolist()):
        pairs = zip(outer_axes, indices, strict=True)
        labels = tuple(axis.labels[index] for axis, index in pairs)
        places_by_labels.setdefault(labels, []).append(place)
    inner_sweep = replace(sweep, axes=inner_axes)
    sweep_options = with_sweep(overrides, sweep.mode, inner_sweep.records(ctx.units))
    for places in places_by_labels.values():
        if sweep.mode == "list":
            axes = tuple(axis.at(places) for axis in inner_axes)
            mode: Literal["list", "grid"] = "list" if axes else "grid"
            inner_sweep = replace(sweep, axes=axes, mode=mode, design=None, tabled=False)
            sweep_options = with_sweep(overrides, mode, inner_sweep.records(ctx.units))
        words = list[str]()
        options = list(sweep_options)
        geometry_root = root
        for axis, index in zip(outer_axes, sweep.places[outer, places[0]].tolist(), strict=True):
            value = axis.values[index]
            path = ".".join(axis.path)
            words.append(f"{axis.key} = {value.brief()}")
            options.append(f"{path}={json.dumps(value.plain(), ensure_ascii=False)}")
            # something else may stand there, which the section's reader records
            with suppress(KeyError):
                geometry_root = put(geometry_root, split_path(path) or (), value)
        variant = Variant(", ".join(words), np.array(places, dtype=np.intp), None)
        yield _Geometry(variant, geometry_root, inner_sweep, tuple(options))


DERIVED = "derived"
TRACTION_KEYS = tuple(name for name in of_role("traction") if name != "heat")
HEAT_KEYS = (*(row.name for row in rows("heat").values() if row.affine), "omega")
"""Keys of `heat` that are derived."""
FOLLOWS = "exact.loads: derived makes it follow from the exact solution"
REMEDY = "leave it out, or remove exact.loads to give all loads yourself"


def without_loads(ctx: Context, root: Node, sweep: Sweep) -> Node:
    """Return the study with 0 for all loads that will be derived; loads that it gives are faults.

    A misspelt word asks for derived loads as well, so that it is the only fault.
    """
    word = root.at("exact", "loads")
    if word is None or word.value == "given" or not isinstance(root.value, Mapping):
        return root
    _check_derivable(ctx, root, sweep, word)
    boundary = root.at("boundary")
    edges = boundary.children if boundary else {}
    roles = {name: edge.nearest("role").value for name, edge in edges.items()}
    zero = replace(word, value=0)
    zeros: dict[Place, Node] = {("heat", "theta_bar"): zero}
    zeros["loads", "f"] = replace(word, value=(zero, zero))
    derived: dict[Place, Place] = {("loads",): ("f",), ("heat",): HEAT_KEYS}
    for name, role in roles.items():
        derived["boundary", name] = COMPONENTS if role == "clamped" else TRACTION_KEYS
        if role == "traction":
            zeros["boundary", name, "pressure"] = zero
    # with theta the fault is that it is given, not that alpha is missing
    if root.at("heat", "theta"):
        zeros["heat", "alpha"] = replace(word, value=1)
    for place, keys in derived.items():
        for key in keys:
            root = _without_load(ctx, root, place, key)
    for place, number in zeros.items():
        # something else may stand there, which the section's reader records
        with suppress(KeyError):
            if root.at(place[0]) and not root.at(*place):
                root = put(root, place, number)
    return put(root, ("path",), None)


def _check_derivable(ctx: Context, root: Node, sweep: Sweep, word: Node) -> None:
    """Record a body, a path or axes that exclude derived loads. word: that asks for them"""
    if root.at("body", "file"):
        reason = "the body comes from a file, whose normals are no expressions"
        remedy = "give the loads, or describe the body by its outline"
        ctx.at(word, f"{reason}, so loads cannot be derived", remedy)
    if path := root.at("path"):
        fault = "a path changes a load, but loads: derived leaves none to change"
        ctx.at(path, fault, "remove path, or give the loads", on_key=True)
    for axis in sweep.axes:
        section, key = axis.path[0], axis.path[-1]
        if section in ("boundary", "loads") or (section == "heat" and key in HEAT_KEYS):
            remedy = "remove it from the sweep, or give the loads"
            ctx.at(axis.node, f"{axis.key} is swept, but {FOLLOWS}", remedy, on_key=True)


def _without_load(ctx: Context, root: Node, place: Place, key: str) -> Node:
    """Return the study without a load that will be derived, which is a fault if it is given.

    Components that an edge holds become 0 in place of the word `derived`.
    """
    load = root.at(*place, key)
    if load is None:
        return root
    is_held = key in COMPONENTS
    parts = load.entries if key == "u" else (load,)
    zeros = list[Node]()
    for part in parts:
        is_free = part.value == "free"
        if part.value != DERIVED and not (is_held and is_free):
            ctx.at(part, f"is given, but {FOLLOWS}", REMEDY, on_key=part is load)
        zeros.append(part if is_free else replace(part, value=0))
    if not is_held:
        return put(root, (*place, key), None)
    new = replace(load, value=tuple(zeros * 2)[:2]) if key == "u" else zeros[0]
    return put(root, (*place, key), new)


def derived_scenes(ctx: Context, reader: SceneReader, exact: Exact, body: Body) -> Sequence[Scene]:
    """Return the scenes with their derived loads; obstacles are recorded, once for each place."""
    checks = Checks(exact, body)
    derivation = Derivation(exact, body)
    fault_count = len(ctx.errors)
    sweep, scenes = reader.sweep, reader.scenes

    def is_sound(faults: Iterable[SolutionFault]) -> bool:
        for keys, fault, remedy in faults:
            ctx.at(reader.root.nearest("exact", *keys), fault, remedy)
        return len(ctx.errors) == fault_count

    if not is_sound((*_missing(exact, scenes), *checks.kinks())):
        return scenes
    derived = list[Scene]()
    for scene, point in zip(scenes, sweep.places.T.tolist(), strict=True):
        ctx.errors.point = reader.words(tuple(point), range(len(point)))
        derived.append(derivation.scene(scene))
        if not is_sound(checks.scene(derived[-1])):
            break
    ctx.errors.point = ""
    return Scenes.of(derived) if len(derived) == len(scenes) else scenes


def _missing(exact: Exact, scenes: Sequence[Scene]) -> Iterator[SolutionFault]:
    """Yield what an exact solution lacks for the derivation of loads."""
    if exact.theta is None:
        expands = any(scene.material.expands for scene in scenes)
        if expands or scenes[0].edges(Convection):
            reason = "beta makes it load the body" if expands else "there are convection edges"
            yield (), f"theta is missing: {reason}", 'add theta: "...", or theta: 0'
    elif scenes[0].edges(Convection) and any(scene.heat.alpha == 0.0 for scene in scenes):
        fault = "with alpha = 0 no theta_bar can be derived: no heat passes convection edges"
        yield ("theta",), fault, "give alpha > 0, or make the edges free or traction"


@none_after_fault
def read_exact(ctx: Context, reader: SceneReader) -> Exact:
    """Return the exact solution; None after a fault."""
    fields = Fields(ctx, reader.root.nearest("exact"), "exact")
    keys = ("u", "theta", "xi", "exponent", "loads")
    u, theta, xi, exponent, loads = map(fields.value, keys)
    exact = Exact(u, theta, xi, exponent, loads == DERIVED)
    ctx.sound()
    if reader.body is not None:
        check_finite(ctx, reader.root, "exact", exact, reader.body)
    return exact
