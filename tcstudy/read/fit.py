"""Reads the section `fit`: a table of measurements, its noise, and the numbers of the study that
are to be found.

The table is a CSV file with a heading and its unit over each column, `Delta [mm],P [N/mm]`; the
study says what it calls the columns: parameters in which the load is affine are given to the scene,
results are compared. What the data could never decide is refused here; what they do not decide in
the end is said with the result.
"""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np

from tcstudy.errors import StudyError, UserFault
from tcstudy.laws.composed import POINTS
from tcstudy.laws.laws import Laws
from tcstudy.read.document import Node, whole_key
from tcstudy.read.fields import Context, Fields, none_after_fault, out_of_bounds, users, words_in
from tcstudy.read.loads import (
    NO_DERIVATIVE,
    NOT_AFFINE,
    NOT_ALONE,
    check_fit,
    differentiable,
    level_of,
    named_number,
)
from tcstudy.read.points import table_lines, table_value
from tcstudy.read.scenes import SceneReader
from tcstudy.scene.fit_plan import (
    PLACE,
    RESULTS,
    STEP,
    FitColumn,
    FitParameter,
    FitPlan,
    Sensitivity,
)
from tcstudy.scene.histories import HistoryPlan, Memory, UnfitLaw
from tcstudy.scene.keys import Key
from tcstudy.scene.mesh_plan import MeshPlan
from tcstudy.scene.parameters import Number, affine_numbers
from tcstudy.scene.points import GEOMETRIC
from tcstudy.scene.records import Scene
from tcstudy.scene.study import Study
from tcstudy.scene.units import LENGTH, NONE

Cells = list[tuple[Node, ...]]
SHUFFLED = 4.0
"""Way through the data over the shortest tree of lines that joins them, above which they are in no
order."""
MAX_JOINED = 3000
"""Data of which that is judged: it takes the square of their number."""


@none_after_fault
def read_fit(
    ctx: Context, reader: SceneReader, mesh: MeshPlan | None, history: HistoryPlan | None
) -> FitPlan | None:
    """The fit; None after a fault.

    reader: of the scene without a sweep, mesh: the meshes; None if they have faults of their own
    history: that of the study, at whose steps was measured
    """
    root, scene, node = reader.root, reader.base, reader.root.nearest("fit")
    fields = Fields(ctx, node, "fit")
    if scene is None:
        return None
    if root.at("sweep"):
        ctx.errors.at(node, "a fit is of one scene, but the study has a sweep", "remove the sweep")
    columns, file, sha256 = (
        _columns(ctx, fields, scene, history) if fields["data"] else ([], "", "")
    )
    memory = history.memory if history else None
    known = differentiable(root, scene, (scene,)) | {
        ("parameters", name): Number(
            Key(name, "quantity", "", one.dimension), one.value, _moves(root, name)
        )
        for name, one in ctx.named.items()
    }
    parameters, remedy = [], "write {friction.tau_s: {start: 4 MPa, within: [1 MPa, 50 MPa]}}"
    for name, item in ctx.mapping(fields["parameters"], "numbers", remedy).items():
        if path := named_number(ctx, item, name, known, NO_DERIVATIVE, NOT_ALONE, on_key=True):
            number, row = (
                Sensitivity(name, path, ctx.cf(known[path].row.dimension)),
                known[path].row,
            )
            parameters.append(_parameter(ctx, item, number, row, reader, memory))
    ctx.sound()
    loads, measured = (
        tuple(c for c in columns if bool(c.path) is is_given) for is_given in (True, False)
    )
    options = fields.given(("compare", "starts", "seed", "loss", "smooth")) | level_of(
        ctx, fields, mesh, "a fit"
    )
    if history is not None:
        options = {"level": history.level, "history": history} | options
    found = tuple(one for one in parameters if one)
    plan = FitPlan(loads, measured, found, scene, file, sha256, **options)
    _check(fields, plan)
    if history is not None:
        check_fit(ctx, fields, plan, history)
    return plan


def read_tests(
    ctx: Context, root: Node, study: Study, read: Callable[[tuple[str, ...]], Study]
) -> Study:
    """The study with those of the further tests of its fit: each is the study with other data and
    values.

    read: the study with options like those of `--set`. Raises StudyError with the faults of all
    tests.
    """
    found, items, first = list[Study](), root.at("fit", "tests"), study.fit
    assert items is not None
    assert first is not None
    for item in items.value if isinstance(items.value, tuple) else ():
        fields = Fields(ctx, item, "fit_test")
        values = ctx.mapping(fields["with"], "values by key path", "write {loads.f_x: 2 MPa}")
        own: dict[str, object] = {key: node.plain() for key, node in values.items()}
        own |= {
            f"fit.{name}": node.plain() for name in ("data", "noise") if (node := fields[name])
        } | {"fit.tests": []}
        replaced = tuple(f"{whole_key(root, key)}." for key in own)
        keys = {
            text: f"{whole_key(root, text.partition('=')[0].strip())}." for text in study.overrides
        }
        options = [text for text, key in keys.items() if not key.startswith(replaced)]
        options += [f"{key}={json.dumps(value, ensure_ascii=False)}" for key, value in own.items()]
        try:
            found.append(read(tuple(options)))
        except StudyError as error:
            for problem in error.problems:
                ctx.errors.at(
                    item,
                    f"{problem.key}: {problem.what}" if problem.key else problem.what,
                    problem.remedy,
                )
    plans = [first, *(one.fit for one in found if one.fit)]
    if found and sum(plan.count for plan in plans) <= len(first.parameters):
        ctx.errors.at(items, "all data together are fewer than the numbers to find", "measure more")
    if ctx.errors.problems:
        raise StudyError(ctx.errors.problems)
    together = hashlib.sha256("".join(plan.sha256 for plan in plans).encode()).hexdigest()
    return replace(
        study, tests=tuple(found), fit=replace(first, sha256=together if found else first.sha256)
    )


def _check(fields: Fields, plan: FitPlan) -> None:
    """What goes together: columns with the comparison, data with the numbers to find."""
    names, n, k = [one.name for one in plan.measured], plan.count, len(plan.parameters)
    if not plan.measured:
        results = ", ".join(RESULTS)
        fields.fault(
            "data", f"no column is a result, so there is nothing to compare; add one of {results}"
        )
        return
    if (plan.place is None) != ("u_T" not in names):
        fields.fault(
            "data",
            'a profile of u_T needs the columns x and u_T; write {x: "x [mm]", u_T: "u [um]"}',
        )
    if n <= k and "tests" not in fields.values:  # which are counted together
        fields.fault(
            "data", f"{n} data cannot decide {k} numbers; measure more, or fit fewer numbers"
        )
    if plan.smooth and sum(one.number.path[-2:-1] == (POINTS,) for one in plan.parameters) < 3:
        remedy = "fit friction.points.0, friction.points.1 and so on, or remove smooth"
        fields.fault("smooth", "a smooth law has at least three of its points fitted", remedy)
    for one in plan.parameters:
        if one.number.path in [column.path for column in plan.given]:
            said = f"{one.number.name} is a column of the data, so it is known; remove it from the parameters"
            fields.fault("parameters", said)
    if plan.compare != "orthogonal":
        return
    if len(plan.given) != 1 or plan.place is not None or names != ["friction_resultant"]:
        need = "distances to a path need two columns; give one parameter of the load and friction_resultant"
        fields.fault("compare", f"{need}, or use compare: vertical")
    elif not isinstance(plan.scene.friction, Laws):
        fields.fault(
            "compare",
            "a path takes one law, the same all along the contact line; use compare: vertical",
        )
    elif _to_and_fro(plan) > SHUFFLED:
        said = "the data jump to and fro, but feet on a path need them in the order of the test; "
        file = fields.values["data"].at("file") or fields.node
        fields.ctx.errors.at(file, said + "sort the lines by time, or compare: vertical")


def _to_and_fro(plan: FitPlan) -> float:
    """How much longer the way through the data is than the shortest lines that join them all."""
    from scipy.sparse.csgraph import minimum_spanning_tree
    from scipy.spatial.distance import pdist, squareform

    if plan.count > MAX_JOINED:
        return 1.0
    points = np.array([plan.given[0].values, plan.measured[0].values])
    reach = np.ptp(points, axis=1, keepdims=True)
    apart = squareform(pdist((points / np.where(reach > 0.0, reach, 1.0)).T))
    shortest = float(minimum_spanning_tree(apart).sum())
    return float(apart.diagonal(1).sum()) / shortest if shortest > 0.0 else 1.0


def _columns(
    ctx: Context, fields: Fields, scene: Scene, history: HistoryPlan | None
) -> tuple[list[FitColumn], str, str]:
    """The columns of the table, its name and its checksum; none after a fault."""
    data, lines, text = Fields(ctx, fields.values["data"], "fit_data"), list[tuple[Node, ...]](), ""
    wanted, file, noise = data["columns"], data["file"], dict[str, Node]()
    remedy = 'write {boundary.grip.u_x: "Delta [mm]", friction_resultant: "P [N/mm]"}'
    headings = ctx.mapping(wanted, "names to headings", remedy) if file else {}
    if headings and file:
        text, lines = table_lines(ctx, file)
    if file is None or not lines:
        return [], "", ""
    if (given := fields["noise"]) and given.value != "estimate":
        remedy = "write {friction_resultant: 2 N/mm}, or leave it out"
        noise = ctx.mapping(given, "columns to numbers", remedy, least=0)
    for name in noise.keys() - headings.keys():
        ctx.errors.at(
            noise[name], f"there is no column {name!r}; use {', '.join(headings)}", on_key=True
        )
    found = [
        _column(ctx, name, item, lines, scene, noise, history is not None)
        for name, item in headings.items()
    ]
    return [one for one in found if one], file.text(), hashlib.sha256(text.encode()).hexdigest()


@none_after_fault
def _column(
    ctx: Context,
    name: str,
    node: Node,
    lines: Cells,
    scene: Scene,
    noise: Mapping[str, Node],
    stepwise: bool,
) -> FitColumn | None:
    """One column in SI; None after a fault. stepwise: of a history, whose lines have steps in the
    place of loads"""
    known = {} if stepwise else {keys: one for keys, one in affine_numbers(scene) if not one.idle}
    others = {STEP: NONE} if stepwise else {PLACE: LENGTH}
    for other, of in (others | {(result,): of for result, of in RESULTS.items()}).items():
        known[other] = Number(Key(other[0], "number", "", of), 0.0)
    heading, heads = (
        ctx.text(node, "the heading of a column"),
        [str(cell.value) for cell in lines[0]],
    )
    path = named_number(ctx, node, name, known, "no column can be", NOT_AFFINE, on_key=True) or ()
    if path and heading not in heads:
        ctx.errors.at(
            node, f"the table has no column {heading!r}; it has {', '.join(map(repr, heads))}"
        )
    ctx.sound()
    at, dimension = heads.index(heading), known[path].row.dimension
    cell, match = lines[0][at], re.fullmatch(r".*?\[([^\]]*)\]\s*", heading)
    unit, plain = match[1].strip() if match else "", ctx.units == "none" or dimension.si == ""
    if match is None and not plain:
        ctx.errors.at(
            cell,
            f"the heading {cell.brief()!r} has no unit",
            f"write {cell.brief()} [{dimension.si}]",
        )
    elif match is not None:
        ctx.unit(cell, unit, dimension)
    ctx.sound()
    values = [ctx.quantity(table_value(ctx, row[at], unit), dimension) for row in lines[1:]]
    sigma = ctx.quantity(noise[name], dimension) if name in noise else None
    if sigma is not None and sigma <= 0.0:
        ctx.errors.at(noise[name], "must be above 0", "give the standard deviation of the noise")
    return FitColumn(
        name, () if name in RESULTS else path, ctx.cf(dimension), tuple(values), sigma, dimension
    )


def _moves(root: Node, name: str) -> str:
    """Why an own number of the study cannot be fitted; empty if it can."""
    used = [
        key for key in GEOMETRIC if (node := root.at(key)) and words_in(node, users(root, name))
    ]
    return f"{' and '.join(used)} {'is' if len(used) == 1 else 'are'} made of it" if used else ""


@none_after_fault
def _parameter(
    ctx: Context,
    node: Node,
    number: Sensitivity,
    row: Key,
    reader: SceneReader,
    memory: Memory | None,
) -> FitParameter:
    """A number to find, which the scene can have at both ends of its bounds."""
    fields = Fields(ctx, node, "fit_parameter")
    ctx.sound()
    start, (low, high) = fields.value("start", row.dimension), fields.value("within", row.dimension)
    ctx.sound()
    if not low < high:
        fields.fault("within", "does not grow; give the lower end first")
    elif not low <= start <= high:
        fields.fault("start", "lies outside within; begin between the two ends")
    scale = fields.value("scale") or ("log" if low > 0.0 else "linear")
    if scale == "log" and low <= 0.0:
        fields.fault("within", "begins at 0 or below, which has no logarithm; write scale: linear")
    ctx.sound()
    scene = reader.base
    assert scene is not None
    for end in (low, high):
        why = f"must {must}" if (must := out_of_bounds(row, end)) else ""
        if not why and number.path[-1] == "alpha" and end <= 0.0:
            why = "must be greater than 0, or the heat of the body cannot be told"
        try:
            moved = (
                scene
                if why or number.path[0] == "history"
                else reader.at(scene, {number.path: end})
            )
            if memory and not why:
                stiffness = end if number.path[0] == "history" else memory.stiffness
                replace(memory, stiffness=stiffness).fits(moved.friction)
        except StudyError as error:
            why = error.problems[0].what
        except UnfitLaw as error:
            why = str(error).partition("; ")[0]
        if why:
            fields.fault("within", f"{number.name} = {end:g}: {why}; narrow the bounds")
    ctx.sound()
    if number.path[0] == "parameters":
        try:
            if not reader.rates(scene, number.path[1], {number.path: start}):
                fields.fault("start", f"no section uses {number.name}; remove it")
        except UserFault as error:
            fields.fault(
                "start", f"{error}; fit a number that is the same everywhere, or give it a value"
            )
    return FitParameter(number, start, low, high, scale == "log")
