"""A study file to a Study: every number of every sweep point checked, all faults reported at once."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

from tcstudy.errors import StudyError
from tcstudy.read.asked import check_together, read_sensitivity
from tcstudy.read.body import read_body, with_named_region
from tcstudy.read.document import apply_overrides, compose, load_text, with_sweep
from tcstudy.read.exact import derived_scenes, read_exact, without_loads
from tcstudy.read.fields import Context, Fields
from tcstudy.read.fit import read_fit, read_tests
from tcstudy.read.history import read_history
from tcstudy.read.node import Collector, Node
from tcstudy.read.parameters import read_parameters
from tcstudy.read.plans import read_mesh, read_output, read_path, read_solver, with_sizes
from tcstudy.read.scenes import SceneReader
from tcstudy.read.sweep import Sweep, read_sweep, records, with_swept_keys
from tcstudy.read.variants import geometric, read_variants
from tcstudy.scene.keys import row, rows
from tcstudy.scene.parameters import SHORT
from tcstudy.scene.records import Body
from tcstudy.scene.study import Study

REQUIRED = tuple(row.name for row in rows("").values() if row.required)


def read_study(path: str | Path, overrides: Sequence[str] = (), *, swept: bool | None = True) -> Study:
    """The study in a file, with `--set` options key=value put in; raises StudyError with all its problems.

    swept: whether the sweep is used, so that an option for a swept key would be lost; None: unless the study is run as
    a path, which is of the scene outside it
    """
    path = Path(path)
    return read_study_text(load_text(path), str(path), overrides, path, swept=swept)


def body_as_given(path: Path, overrides: Sequence[str] = ()) -> Body | None:
    """The body of a study that has faults, unjudged; None where it cannot be read either."""
    ctx = Context(Collector(), folder=path.parent)
    root = apply_overrides(compose(load_text(path), str(path), ctx.errors), tuple(overrides), SHORT, ctx.errors)
    if not isinstance(root.value, Mapping) or (node := root.child("body")) is None:
        return None
    if (units := root.child("units")) and units.value == "none":
        ctx.units = "none"
    ctx.named = read_parameters(ctx, names) if (names := root.child("parameters")) else {}
    return read_body(ctx, node)[0]


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
    ctx.named = read_parameters(ctx, names) if (names := root.child("parameters")) else {}
    if len(ctx.errors) > before:  # every use of a name without a value would be one fault more
        raise StudyError(ctx.errors.problems)
    root = with_sizes(ctx, with_named_region(root))
    if swept is None:
        swept = not root.child("path") or bool(root.child("history") or root.child("fit"))
    sweep = read_sweep(ctx, root, overrides if swept else ())
    said = with_sweep(overrides, sweep.written()) if sweep.tabled else overrides
    if sweep.axes and geometric(root, sweep):
        return read_variants(ctx, root, sweep, overrides, said, partial(_one_body, header))
    study = _one_body(header, ctx, root, sweep, said)
    if root.at("fit", "tests") is None:
        return study
    return read_tests(ctx, root, study, lambda options: read_study_text(text, name, options, source))


def _one_body(header: dict[str, Any], ctx: Context, root: Node, sweep: Sweep, said: tuple[str, ...]) -> Study:
    """The study of one body and its meshes. said: options that make the text this study."""
    root = with_swept_keys(without_loads(ctx, root, sweep) if root.child("exact") else root, sweep)
    Fields(ctx, root, "", REQUIRED)
    memory = root.at("history", "memory")
    loose = memory is not None and all(one.value == "friction" for one in memory.children.values() or (memory,))
    reader = SceneReader(ctx, root, sweep, loose=loose)
    scenes = reader.read()
    ctx.errors.point = ""
    body, base = reader.body, reader.base
    mesh, solver = read_mesh(ctx, root, body, scenes), read_solver(ctx, root.child("solver"))
    output = read_output(ctx, root, body, scenes)
    path = read_path(ctx, node, base, mesh) if (node := root.child("path")) else None
    exact = read_exact(ctx, node, root, body) if (node := root.child("exact")) else None
    node = root.child("history") if scenes else None
    history = read_history(ctx, node, root, base, scenes, mesh, sweep) if node else None
    if output and not ctx.errors.problems and (node := root.at("output", "sensitivity")):
        output = replace(output, sensitivity=read_sensitivity(ctx, node, root, base, scenes, exact, history))
    node = None if ctx.errors.problems else root.child("fit")
    fit = read_fit(ctx, node, reader, mesh, history) if node else None
    if any(map(root.child, ("path", "exact", "history", "fit"))) or (output and output.live):
        check_together(ctx, root, scenes, mesh, solver, output, exact)
    if exact and exact.derived and body and not ctx.errors.problems:
        scenes = derived_scenes(ctx, root, sweep, exact, body, scenes)
    if ctx.errors.problems or mesh is None or solver is None or output is None:
        raise StudyError(ctx.errors.problems)
    axes = records(sweep, ctx.units) if sweep.axes else ()
    sweep_said = {"mode": sweep.mode, "axes": axes, "design": sweep.design, "overrides": said}
    plans = {"mesh": mesh, "solver": solver, "output": output, "exact": exact, "path": path, "history": history}
    return Study(**header | sweep_said | plans, fit=fit, scenes=scenes, units=ctx.units)
