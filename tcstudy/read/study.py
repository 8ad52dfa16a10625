"""A study file to a Study: every number of every sweep point checked, all faults reported at once."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import partial
from itertools import combinations
from pathlib import Path
from typing import Any

from tcstudy.errors import StudyError
from tcstudy.read.checks import check_goal, check_guarantee, check_mesh
from tcstudy.read.document import apply_overrides, compose, load_text, whole_key, with_sweep
from tcstudy.read.exact import derived_scenes, read_exact, without_loads
from tcstudy.read.fields import Context, Fields
from tcstudy.read.heat import needed_of_heat
from tcstudy.read.node import Collector, Mark, Node, deepest, holds, put, split_path
from tcstudy.read.parameters import check_swept_names, read_parameters, swept_names
from tcstudy.read.physics import ALL_KEYS, keys_of, laws_by_edge
from tcstudy.read.plans import read_mesh, read_output, read_path, read_solver
from tcstudy.read.scenes import SECTIONS, SceneReader
from tcstudy.read.sweep import Sweep, read_sweep, records
from tcstudy.scene.histories import short_names
from tcstudy.scene.keys import row, rows
from tcstudy.scene.parameters import SHORT, sweepable
from tcstudy.scene.records import Scene
from tcstudy.scene.study import Exact, Study

REQUIRED = tuple(row.name for row in rows("").values() if row.required)
OPTIONAL = tuple(name for name in rows("") if name not in REQUIRED)


def read_study(path: str | Path, overrides: Sequence[str] = (), *, swept: bool | None = True) -> Study:
    """The study in a file, with `--set` options key=value put in; raises StudyError with all its problems.

    swept: whether the sweep is used, so that an option for a swept key would be lost; None: unless the study is run as
    a path, which is of the scene outside it
    """
    path = Path(path)
    return read_study_text(load_text(path), str(path), overrides, path, swept=swept)


def read_study_text(
    text: str,
    name: str = "<text>",
    overrides: Sequence[str] = (),
    source: Path | None = None,
    *,
    swept: bool | None = True,
) -> Study:
    """The study in a text, called `name` in messages; raises StudyError with all its problems.

    source: the file that the text was read from, if any: other files are sought beside it;  swept: as of `read_study`
    """
    overrides = tuple(overrides)
    ctx = Context(Collector(), folder=source.parent if source else Path())
    root = apply_overrides(compose(text, name, ctx.errors), overrides, SHORT, ctx.errors)
    if not isinstance(root.value, Mapping):
        ctx.errors.at(root, f"a study is a mapping, but this is {root.kind()}", "see configs/quickstart.yaml")
        raise StudyError(ctx.errors.problems)
    header = _read_header(ctx, root, source.stem if source else name) | {"text": text, "source": source}
    before = len(ctx.errors)
    if root.child("parameters"):
        ctx.named = read_parameters(ctx, root.child("parameters"))
    if len(ctx.errors) > before:  # every use of a name without a value would be one fault more
        raise StudyError(ctx.errors.problems)
    if swept is None:
        swept = not root.child("path") or bool(root.child("history") or root.child("fit"))
    sweep = _read_sweep(ctx, root, overrides if swept else ())
    said = with_sweep(overrides, sweep.written()) if sweep.tabled else overrides

    one = partial(_one_body, header)
    if any(axis.parameter.path[0] in ("body", "mesh", "parameters") for axis in sweep.axes):
        from tcstudy.read.variants import geometric, read_variants

        if geometric(root, sweep):
            return read_variants(ctx, root, sweep, overrides, said, one)
    return one(ctx, root, sweep, said)


def _one_body(header: dict[str, Any], ctx: Context, root: Node, sweep: Sweep, said: tuple[str, ...]) -> Study:
    """The study of one body and its meshes. said: options that make the text this study."""
    given = without_loads(ctx, root, sweep) if root.child("exact") else root
    base = _with_swept_keys(given, sweep)
    required = [key for key in REQUIRED if key != "mesh" or sweep.h is None or isinstance(sweep.h.value, Mapping)]
    Fields(ctx, base, "", required, (*OPTIONAL, "mesh"))
    memory = history.child("memory") if (history := base.child("history")) else None
    reader = SceneReader(ctx, base, sweep, loose=memory is not None and memory.value == "friction")
    scenes = reader.read()
    ctx.errors.point = ""
    plans = _read_run(ctx, base, sweep, reader, scenes)
    exact: Exact | None = plans["exact"]
    if exact and exact.derived and reader.body and not ctx.errors.problems:
        scenes = derived_scenes(ctx, base, sweep, exact, reader.body, scenes)
    if ctx.errors.problems:
        raise StudyError(ctx.errors.problems)
    return Study(
        **header,
        **plans,
        units=ctx.units,
        mode=sweep.mode,
        axes=records(sweep, ctx.units) if sweep.axes else (),
        scenes=scenes,
        overrides=said,
        design=sweep.design,
    )


def _read_header(ctx: Context, root: Node, default: str) -> dict[str, Any]:
    """Title and institution; sets the system of units, on which every number depends."""
    if units := root.child("units"):
        ctx.units = "none" if ctx.choice(units, row("", "units").words) == "none" else "SI"
    title = ctx.text(node) if (node := root.child("title")) else default
    return {"title": title, "institution": ctx.text(node) if (node := root.child("institution")) else ""}


def _read_sweep(ctx: Context, root: Node, overrides: tuple[str, ...]) -> Sweep:
    """The sweep; none after a fault in its form, so that the base study is still checked."""
    node = root.child("sweep")
    if node is None or node.value == {}:
        return Sweep()
    boundary, friction = root.child("boundary"), root.child("friction")
    roles = boundary.value if boundary and isinstance(boundary.value, Mapping) else {}
    law = word.value if friction and (word := friction.child("law")) else None
    by_edge = {edge: str(word.value) for edge, one in laws_by_edge(friction).items() if (word := one.child("law"))}
    edges = {edge: keys_of(node) for edge, node in roles.items()}
    if boundary is None:  # then those that the sweep names, with all keys
        edges = {words[1]: ALL_KEYS for words in _paths(node) if len(words) == 3 and words[0] == "boundary"}
    known = sweepable(edges, by_edge or (law if isinstance(law, str) else None), _regions(root, node))
    if ctx.named:
        known = known | swept_names(ctx.named)
    if geometric := [words for words in _paths(node) if words[0] in ("body", "mesh")]:
        from tcstudy.read.variants import geometric_parameters

        known = known | geometric_parameters(root, geometric)
    sweep = _of_sections(ctx, root, read_sweep(ctx, node, known, friction) or Sweep())
    if ctx.named:
        check_swept_names(ctx, root, sweep, (*SECTIONS, "materials", "body", "mesh"))
    _check_options(ctx, root, sweep, overrides)
    return sweep


def _check_options(ctx: Context, root: Node, sweep: Sweep, overrides: Sequence[str]) -> None:
    """A value of an option that the sweep replaces would be lost without a word."""
    named = zip(sweep.axes, short_names([axis.parameter.path for axis in sweep.axes]), strict=True)
    swept = [(axis.key, name, axis.parameter.path, axis.parameter.is_whole) for axis, name in named]
    if sweep.h is not None and isinstance(sweep.h.value, tuple):
        swept.append(("h", "maxh", ("mesh", "maxh"), False))
    for option in (text for text in overrides if "=" in text):
        key, _, value = (part.strip() for part in option.partition("="))
        keys, place = split_path(whole_key(root, key)) or (), f"--set {option}"
        for name, short, words, whole in swept:
            path = split_path(".".join(words)) or ()
            same = keys == path or (key == short and key not in rows(""))
            # its value comes of the option
            above = path[: len(keys)] == keys and holds(root, path) and deepest(root, path).mark.file == place
            if same or above or keys[: len(path)] == path:
                what = (
                    f"{name} is swept, so {'this value' if same or not above else 'its value here'} would not be used"
                )
                listed = f', --set "sweep.{name}=[{value}]"' if same and sweep.mode == "grid" and not whole else ""
                others = "" if same or not above else "set the others here by keys of their own, "
                remedy = f"{others}give the sweep other values{listed}, or remove it by --set sweep=null"
                where = ".".join(map(str, path if same or above else keys))
                ctx.errors.at_mark(Mark(place, 0, 0), where, what, remedy)


def _regions(root: Node, sweep: Node) -> tuple[str, ...]:
    """The regions with a material of their own, by the study or by its sweep."""
    given = own.value if (own := root.child("materials")) and isinstance(own.value, Mapping) else ()
    named = (words[1] for words in _paths(sweep) if words[0] == "materials" and len(words) > 1)
    return tuple(dict.fromkeys((*given, *named)))


def _paths(sweep: Node | None) -> list[list[str]]:
    """The paths that a sweep names."""
    points = sweep.child("points") if sweep else None
    rows = points.value if points and isinstance(points.value, tuple) else ()
    maps = [node.value for node in (sweep, *rows) if node and isinstance(node.value, Mapping)]
    return [key.split(".") for keys in maps for key in keys]


def _of_sections(ctx: Context, root: Node, sweep: Sweep) -> Sweep:
    """The sweep without parameters of a section that is not there and that they do not make by themselves.

    What is missing then is the section, not one of its keys in the sweep. The optional section `heat` is recorded here.
    """
    lost = {
        section
        for section in SECTIONS
        if root.child(section) is None and not _made_by(section, sweep, root.child("boundary"))
    }
    for section in sorted(lost & set(OPTIONAL)):
        swept = next(axis.key for axis in sweep.axes if axis.parameter.path[0] == section)
        remedy = "add heat: {alpha: ..., theta_bar: ...}, or remove it from the sweep"
        ctx.errors.at(root, f"is missing, but {swept} is swept", remedy, key=section)
    return replace(sweep, axes=tuple(axis for axis in sweep.axes if axis.parameter.path[0] not in lost))


def _made_by(section: str, sweep: Sweep, boundary: Node | None) -> bool:
    """Whether the swept keys of a section are all that it needs; true if none is swept."""
    paths = [axis.parameter.path for axis in sweep.axes if axis.parameter.path[0] == section and axis.values]
    enough = {
        "material": combinations(("E", "nu", "lambda", "mu"), 2),  # two that do not go together are told as such
        "heat": (("theta",), needed_of_heat(boundary)),
        "loads": (("f",),),
    }
    given = {path[-1] for path in paths}
    return not paths or (section,) in paths or any({*keys} <= given for keys in enough.get(section, ()))


def _with_swept_keys(root: Node, sweep: Sweep) -> Node:
    """The base study: swept keys that it does not give have the first of their values."""
    whole = {axis.parameter.path for axis in sweep.axes if holds(root, axis.parameter.path)}
    for axis in sorted(sweep.axes, key=lambda axis: len(axis.parameter.path)):
        # A parameter of a law that is itself swept may be foreign to the base law.
        if not holds(root, axis.parameter.path) and axis.parameter.path[:1] not in whole:
            with suppress(KeyError):  # something else stands there, which the section's reader records
                root = put(root, axis.parameter.path, axis.values[0])
    return root


def _read_run(ctx: Context, root: Node, sweep: Sweep, reader: SceneReader, scenes: Sequence[Scene]) -> dict[str, Any]:
    """The plans of a study by field, None after faults: meshes, solver, output, exact solution, path, history, fit."""
    before, body = len(ctx.errors), reader.body
    if sweep.h and not isinstance(sweep.h.value, tuple | Mapping):
        remedy = "write [20 mm, 10 mm] or {tolerance: 1e-3, of: friction_resultant}"
        ctx.errors.at(sweep.h, f"must be a list of sizes or a tolerance, but is {sweep.h.kind()}", remedy)
    mesh = read_mesh(ctx, root.child("mesh"), sweep.h) if len(ctx.errors) == before else None
    if mesh and body:
        listed = sweep.h if sweep.h and isinstance(sweep.h.value, tuple) else None
        check_mesh(ctx, listed or deepest(root, ("mesh", "maxh")), mesh, body)
        check_guarantee(ctx, root, mesh, body)
        given = sweep.h.child("of") if sweep.h and not listed else None
        words = (node for key in ("of", "goal") if (section := root.child("mesh")) and (node := section.child(key)))
        if scenes and (goal := given or next(words, None)):
            check_goal(ctx, goal, mesh.goal, body, scenes[0].boundary)
    solver, output = read_solver(ctx, root.child("solver")), read_output(ctx, root.child("output"))
    if output and (places := deepest(root, ("output", "probes"))).path == "output.probes":
        from tcstudy.read.asked import read_probes  # only for a study that has them

        output = replace(output, probes=read_probes(ctx, places, body, scenes))
    path = read_path(ctx, node, reader.base, mesh) if (node := root.child("path")) else None
    exact = read_exact(ctx, node, root, body) if (node := root.child("exact")) else None
    history = None
    if root.child("history") and scenes:
        from tcstudy.read.history import check_numbers, read_history  # few studies have one

        history = read_history(ctx, root, reader.base, scenes, mesh, [axis.parameter.path for axis in sweep.axes])
    asked = root.child("output") if output and not ctx.errors.problems else None
    if output and asked and (names := asked.child("sensitivity")):
        from tcstudy.read.asked import read_sensitivity  # only for a study that asks for derivatives

        output = replace(output, sensitivity=read_sensitivity(ctx, names, root, reader.base, scenes, exact))
        if history is not None:
            check_numbers(ctx, names, output.sensitivity, history)
    fit = None
    if (section := root.child("fit")) and not ctx.errors.problems:
        from tcstudy.read.fit import read_fit  # only for a study that has one

        fit = read_fit(ctx, section, root, reader.base, mesh, history)
    if exact or fit or (mesh and mesh.estimates) or (output and (output.live or output.sensitivity)):
        from tcstudy.read.asked import check_together

        check_together(ctx, root, scenes, output, exact)
    if solver and solver.every:
        for key, remedy in (("path", "write path.complete: true"), ("history", "remove it"), ("fit", "remove it")):
            if root.child(key):
                ctx.errors.at(deepest(root, ("solver", "branch")), f"is of single points, not of a {key}", remedy)
    found = {"mesh": mesh, "solver": solver, "output": output, "exact": exact}
    return found | {"path": path, "history": history, "fit": fit}
