"""A study file to a Study: every number of every sweep point checked, all faults reported at once."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from itertools import product
from pathlib import Path
from typing import Any

from tcstudy.errors import StudyError
from tcstudy.read.document import apply_overrides, compose, load_text, with_sweep
from tcstudy.read.exact import derived_scenes, read_exact, without_loads
from tcstudy.read.fields import Context, Fields
from tcstudy.read.node import Collector, Node
from tcstudy.read.parameters import read_parameters
from tcstudy.read.plans import read_mesh, read_output, read_path, read_solver
from tcstudy.read.scenes import SceneReader
from tcstudy.read.sweep import Sweep, read_sweep, records, with_swept_keys
from tcstudy.scene.keys import row, rows
from tcstudy.scene.parameters import SHORT
from tcstudy.scene.records import Scene
from tcstudy.scene.study import Exact, Study

REQUIRED = tuple(row.name for row in rows("").values() if row.required)


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
    if units := root.child("units"):  # on which every number depends
        ctx.units = "none" if ctx.choice(units, row("", "units").words) == "none" else "SI"
    words = {key: ctx.text(node) for key in ("title", "institution") if (node := root.child(key))}
    header = {"title": source.stem if source else name} | words | {"text": text, "source": source}
    before = len(ctx.errors)
    if root.child("parameters"):
        ctx.named = read_parameters(ctx, root.child("parameters"))
    if len(ctx.errors) > before:  # every use of a name without a value would be one fault more
        raise StudyError(ctx.errors.problems)
    if swept is None:
        swept = not root.child("path") or bool(root.child("history") or root.child("fit"))
    sweep = read_sweep(ctx, root, overrides if swept else ())
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
    base = with_swept_keys(given, sweep)
    required = [key for key in REQUIRED if key != "mesh" or sweep.h is None or isinstance(sweep.h.value, Mapping)]
    Fields(ctx, base, "", required)
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


def _read_run(ctx: Context, root: Node, sweep: Sweep, reader: SceneReader, scenes: Sequence[Scene]) -> dict[str, Any]:
    """The plans of a study by field, None after faults: meshes, solver, output, exact solution, path, history, fit."""
    body = reader.body
    mesh = read_mesh(ctx, root, sweep.h, body, scenes)
    solver, output = read_solver(ctx, root.child("solver")), read_output(ctx, root.child("output"))
    if output and (places := root.nearest("output", "probes")).path == "output.probes":
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
    alone = {("mesh", "guarantee"): mesh and mesh.guarantee, ("solver", "branch"): solver and solver.every}
    for keys, key in product((keys for keys, asked in alone.items() if asked), ("path", "history", "fit")):
        if root.child(key):
            remedy = "write path.complete: true" if (keys[0], key) == ("solver", "path") else "remove it"
            ctx.errors.at(root.nearest(*keys), f"is of single points, not of a {key}", remedy)
    found = {"mesh": mesh, "solver": solver, "output": output, "exact": exact}
    return found | {"path": path, "history": history, "fit": fit}
