"""Write the reference of result files, results/reference.md, from the tables of variables.

`python -m tests.data.variables_in_words` prints it.
"""

from collections.abc import Iterable, Iterator
from dataclasses import replace

from tcstudy.data import schema, tables
from tcstudy.data.schema import FileVariable, PointStatus
from tcstudy.scene.fit_plan import Sensitivity
from tcstudy.scene.mesh_plan import Goal

HEAD = """# Reference of result files

One row per variable, one table per group. `tests/data/variables_in_words.py` makes this page from
[`tcstudy/data/schema.py`](../tcstudy/data/schema.py) and [`tables.py`](../tcstudy/data/tables.py).

- **unit**: in SI, in the form of the file. A study with `units: none` has `1` in place of all units but seconds.
- **along**: the dimensions. `point` stands for the swept parameters, each a dimension of its name.
- **flags**: the values of a variable that counts meanings. The file has them as `flag_meanings`.
- A missing value is NaN. A missing count is −1.
- b is the friction law, u_T the slip, ξ = −S_T the traction. [The method](../tcstudy/METHOD.md) defines them.

[The guide](README.md) shows how to read a file.
"""
STATUS_MEANINGS = {
    PointStatus.NOT_RUN: "the run was interrupted before it",
    PointStatus.OK: "solved",
    PointStatus.NOT_CONVERGED: "the solver ended without a solution",
    PointStatus.INCLUSION_VIOLATED: "the inclusion residual exceeds the tolerance",
    PointStatus.SINGULAR: "the supports do not restrain rigid-body motion, or rounding destroys its stiffness",
    PointStatus.MESH_FAILED: "the geometry is refused, or has no mesh",
    PointStatus.ERROR: "an unexpected error, or a worker process that ended twice",
}
ATTRIBUTES = {
    "Conventions": "CF-1.11",
    "title": "title of the study",
    "institution": "institution of the study, or `unspecified`",
    "source": "program and version",
    "history": "time and command of every write",
    "references": "the paper of the method",
    "solver": "names of the solvers; the solution of the first one is stored",
    "solver_tolerance": "largest accepted inclusion residual",
    "solver_branch": "`solver.branch` of a run",
    "unit_system": "`SI` or `none`",
    "sweep_mode": "`grid`, `zip` or `list`",
    "guarantee": "what is proved of the continuous problem: `band`, `bounds`, or `polygon`",
    "swept_loads": "swept parameters that change loads alone",
    "study_yaml": "exact text of the study",
    "study_sha256": "checksum of text, overrides and geometry files",
    "overrides": "options `--set`, one per line",
    "versions": "versions of Python and packages, as JSON",
    "program": "versions and checksum of all that can change a result, as JSON",
    "git_commit": "commit of the repository of the study",
    "content": "kind of the file; a run has none",
    "geometries": "number of geometries of a sweep over geometries",
    "layout": "2 for several geometries; files of version 0.8 have none",
    "warnings": "JSON list of `text` and `where`; absent without warnings",
    "finished": "1 when every point has been tried",
}
"""Global attributes of a run, in words."""
PATH_ATTRIBUTES = {
    "parameter": "name of the parameter of the path",
    "parameter_range": "both ends of the requested range",
    "begin_status, end_status": "status of both ends of the path",
    "begin_reason, end_reason": "reason of this status",
    "loop_reason": "reason why the hysteresis loop ended",
    "complete_reason": "proof that all branches are found, or the reason why there is none",
    "shortfalls": "requested results that the path does not have, one sentence per line",
}
HISTORY_ATTRIBUTES = {
    "memory": "internal variables of the law: accumulated slip, largest slip, plastic slip",
    "branch": "`continued` or `lowest`",
    "loads": "names of the loads that change",
}
PROBE = "probe_NAME"
REQUESTED: tuple[tuple[str, str, str], ...] = (
    (f"{PROBE}_u_x, {PROBE}_u_y", "m", "displacement at the probe"),
    (f"{PROBE}_theta", "K", "temperature at the probe, above the stress-free state"),
    (f"{PROBE}_sigma_xx, …_yy, …_xy", "Pa", "stresses of the triangle that contains the probe"),
    (f"{PROBE}_u_T", "m", "tangential displacement of a probe on the contact line"),
    ("reaction_EDGE_x, reaction_EDGE_y", "N m-1", "force of the support on the body"),
    ("force_EDGE_x, force_EDGE_y", "N m-1", "force of the edge on the body"),
    ("work_EDGE", "J m-1", "force of the edge times its displacement"),
    ("theta_mean_EDGE", "K", "mean temperature of the edge"),
    ("von_mises_max", "Pa", "largest von Mises stress of a triangle"),
    ("von_mises_x, von_mises_y", "m", "middle of this triangle"),
    ("section_force_max", "N m-1", "largest section force with its sign, positive in tension"),
    ("section_force_at", "m", "arc length of the largest section force"),
    ("layer_force_REGION", "N m-1", "section force of a region, at every contact node"),
)
"""Variables that `output` requests, with placeholders for names of the study."""


def markdown() -> str:
    """Return the whole page."""
    return HEAD + "".join(_chapters())


def _chapters() -> Iterator[str]:
    """Yield the lines of all chapters."""
    yield from _chapter("Status of a point", "`reason` has the reason of every status but `ok`.")
    yield from _plain(
        ("flag", "status", "meaning"),
        ((str(int(s)), f"`{s.name.lower()}`", STATUS_MEANINGS[s]) for s in PointStatus),
    )
    yield from _chapter("Attributes", "Global attributes of a file.")
    yield from _plain(("attribute", "meaning"), _attributes(ATTRIBUTES))
    yield from _runs()
    yield from _requested()
    yield from _other_kinds()


def _runs() -> Iterator[str]:
    """Yield the chapters of a run."""
    goal = schema.goal_variables(Goal("friction_resultant"), exact=True)
    sought = "With `solver.branch: all`, all equilibria of a point."
    grouped = "The group `level_0`, `level_1`, … of each mesh. `node` counts contact nodes."
    held = "Ends of the contact line with a prescribed u_T. They have no ξ."
    fields = "With `output.fields: true`, as a UGRID mesh."
    live = "The group `live` of a level, with `output.live: true`."
    geometries = "Beside the others in the file of a sweep over geometries."
    groups: tuple[tuple[str, str, Iterable[FileVariable]], ...] = (
        ("Runs: points and levels", "The root group of a file.", schema.ROOT),
        ("Runs: regions of the law", "Where some law of the study has them.", schema.REGIONS),
        ("Runs: estimated errors", "With estimated errors.", (*schema.ESTIMATES, *goal)),
        (
            "Runs: bounds of λ₁",
            "Of the body, without `mesh.guarantee: false`.",
            schema.band_variables(),
        ),
        ("Runs: bounds of errors", "With `mesh.guarantee: true`.", schema.bound_variables()),
        (
            "Runs: bounds of slips",
            "With `output.quantities: slip_bounds` beside it.",
            schema.slip_bound_variables(),
        ),
        ("Runs: several solvers", "Where a study names several solvers.", schema.SOLVERS),
        ("Runs: all equilibria", sought, (*schema.EVERY, *schema.SOLUTION)),
        (
            "Runs: solutions of the body",
            "With `mesh.guarantee: true` and `solver.branch: all`; radii are in the groups of levels.",
            (*schema.existence_variables(), schema.EXISTENCE_RADIUS),
        ),
        ("Runs: the contact line", grouped, (*schema.CONTACT, schema.SECTION)),
        ("Runs: constrained ends and junctions", held, (*schema.HELD, *schema.JOINTS)),
        ("Runs: fields", fields, (*schema.MESH, schema.REGION, *schema.FIELDS)),
        ("Runs: bodies of CAD files", "The boundary as segments.", schema.RIM),
        ("Runs: arrays of the live page", live, schema.LIVE),
        (
            "Runs: several geometries",
            geometries,
            (schema.NUMBER, schema.OVERRIDES, *schema.MESH_COUNTS, schema.MESH_GEOMETRY),
        ),
    )
    for title, sentence, variables in groups:
        yield from _chapter(title, sentence)
        yield from _table(variables)


def _requested() -> Iterator[str]:
    """Yield the chapters of results and derivatives on request."""
    yield from _chapter("Requested results", "[Requests](../configs/howto/outputs.md) add them.")
    yield from _plain(
        ("variable", "unit", "meaning"),
        ((_code(names), unit, meaning) for names, unit, meaning in REQUESTED),
    )
    sentence = "Their units are divided by the unit of the parameter."
    yield from _chapter("Derivatives", sentence)
    parameter = Sensitivity("PARAMETER", ("PARAMETER",), "1")
    yield from _table(schema.derivatives([parameter]))


def _other_kinds() -> Iterator[str]:
    """Yield the chapters of paths, histories, fits, convergence and cost."""
    yield from _chapter("Paths", "Vertices of a polygon of solutions. Segments join them.")
    yield from _table([*tables.LEVEL, *tables.CURVE])
    yield from _chapter("Paths: solutions at requested values", "At the values `path.at`.")
    yield from _table(tables.SOLUTIONS)
    yield from _chapter("Paths: hysteresis loop", "With `path.hysteresis: true`.")
    yield from _table(tables.LOOP)
    yield from _chapter("Paths: all branches", "With `path.complete: true`.")
    yield from _table(tables.BRANCHES)
    yield from _chapter("Paths: attributes", "Beside the attributes of all files.")
    yield from _plain(("attribute", "meaning"), _attributes(PATH_ATTRIBUTES))
    yield from _chapter("Histories: steps", "Step 0 applies the loads of the study.")
    yield from _table([*tables.STEPS, *tables.POINTS])
    yield from _chapter("Histories: nodes", "By step and contact node.")
    yield from _table(tables.NODES)
    yield from _chapter("Histories: attributes", "Beside the attributes of all files.")
    yield from _plain(("attribute", "meaning"), _attributes(HISTORY_ATTRIBUTES))
    yield from _chapter("Fits", "Residuals are in units of the measurement uncertainty.")
    yield from _table(tables.FIT)
    yield from _accuracy()


def _accuracy() -> Iterator[str]:
    """Yield the chapters of convergence and cost."""
    sentence = "An error `E` and a quantity `Q` of the tables below have these variables."
    yield from _chapter("Convergence", sentence)
    yield from _table([*tables.LEVELS])
    yield "\n"
    yield from _table(_measured("E", "error E", tables._ERROR_PARTS))
    yield "\n"
    yield from _table(_measured("Q", "Q", tables._NUMBER_PARTS))
    yield "\n"
    yield from _plain(
        ("E or Q", "symbol", "meaning"),
        (
            (f"`{m.name}`", _escaped(m.symbol), m.long_name)
            for m in (*tables.ERRORS, *tables.NUMBERS)
        ),
    )
    yield from _chapter("Cost", "Errors have the names of `converge`, `u_estimate` and `u_bound`.")
    errors = {f"{part}_{m.name}" for part in ("error", "dominated") for m in tables.MEASURES}
    yield from _table(v for v in tables.COST_TABLE if v.name not in errors)
    yield "\n"
    shown = next(m for m in tables.MEASURES if m.name == "u_energy")
    generic = replace(shown, name="E", long_name="measure E")
    yield from _table(tables._charted_error(generic))


def _measured(
    name: str, words: str, parts: Iterable[tuple[str, schema.Dtype, str, schema.Dims, str]]
) -> Iterator[FileVariable]:
    """Yield the variables of a measure with a placeholder for its name."""
    for prefix, dtype, units, dims, meaning in parts:
        unit = "1" if units == "1" else "of E, squared" if name == "E" else "of Q"
        extra = schema.flags(*tables.VERDICTS) if prefix == "verdict" else {}
        long_name = meaning.format(words)
        yield FileVariable(f"{prefix}_{name}", dtype, unit, long_name, dims, extra=extra)


def _chapter(title: str, sentence: str) -> Iterator[str]:
    """Yield a heading and a sentence below it."""
    yield f"\n## {title}\n\n{sentence}\n\n"


def _table(variables: Iterable[FileVariable]) -> Iterator[str]:
    """Yield a table with one row per variable; a column without an entry is left out."""
    rows = [_cells(variable) for variable in variables]
    titles = [title for title in rows[0] if any(row[title] for row in rows)]
    yield from _plain(titles, ([row[title] for title in titles] for row in rows))


def _plain(titles: Iterable[str], rows: Iterable[Iterable[str]]) -> Iterator[str]:
    """Yield the lines of a table."""
    titles = list(titles)
    yield f"| {' | '.join(titles)} |\n"
    yield "|---" * len(titles) + "|\n"
    for row in rows:
        yield f"| {' | '.join(row)} |\n"


def _cells(variable: FileVariable) -> dict[str, str]:
    """Return the cells of a variable by their titles."""
    meaning = variable.long_name
    if variable.comment and not variable.comment.startswith(str(schema.MISSING_COUNT)):
        meaning += f": {variable.comment}"
    return {
        "variable": f"`{variable.name}`",
        "unit": _unit(variable.units),
        "meaning": _escaped(meaning),
        "flags": _flags(variable),
        "along": ", ".join(_dimension(name) for name in variable.dims),
    }


def _unit(units: str) -> str:
    """Return a unit in words, where it depends on the study."""
    parameter = "that of the parameter"
    return {schema.T: parameter, schema.RATE: f"J m-1 over {parameter}", "": "text"}.get(
        units, units
    )


def _flags(variable: FileVariable) -> str:
    """Return the values and meanings of a flag."""
    if variable.extra.get("standard_name") == "status_flag":
        return "[status](#status-of-a-point)"
    values = variable.extra.get("flag_values", ())
    meanings = str(variable.extra.get("flag_meanings", "")).split()
    return ", ".join(
        f"{value} `{meaning}`" for value, meaning in zip(values, meanings, strict=True)
    )


def _dimension(name: str) -> str:
    """Return the name of a dimension, in words where it stands for several."""
    return {schema.SWEEP: "point"}.get(name, name)


def _attributes(meanings: dict[str, str]) -> Iterator[tuple[str, str]]:
    """Yield the rows of attributes."""
    return ((_code(names), meaning) for names, meaning in meanings.items())


def _code(names: str) -> str:
    """Return names that commas separate as code."""
    return ", ".join(f"`{name}`" for name in names.split(", "))


def _escaped(text: str) -> str:
    """Return a text for a cell of a table."""
    return text.replace("|", "\\|")


if __name__ == "__main__":
    print(markdown(), end="")
