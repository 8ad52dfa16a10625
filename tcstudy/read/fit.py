"""Reading the section `fit`: a table of measurements, its noise, and the parameters to identify.

The table is a CSV file with a heading and its unit over each column, `Delta [mm],P [N/mm]`. The
study names the columns: parameters in which the load is affine are given to the scene, results are
compared. Parameters that no data could determine are refused here. Those that the data do not
determine in the end are reported with the result.
"""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

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
    RESULTS_OF_OPENINGS,
    STEP,
    FitColumn,
    FitParameter,
    FitPlan,
    Sensitivity,
)
from tcstudy.scene.histories import HistoryPlan, Memory, UnfitLaw
from tcstudy.scene.keys import Key
from tcstudy.scene.mesh_plan import MeshPlan
from tcstudy.scene.parameters import Keys, Number, affine_numbers
from tcstudy.scene.points import GEOMETRIC
from tcstudy.scene.records import Scene
from tcstudy.scene.study import Study
from tcstudy.scene.units import LENGTH, NONE, Dimension

Cells = list[tuple[Node, ...]]
MAX_DETOUR = 4.0
"""Way through the data over their shortest spanning tree, above which they are in no order."""
MAX_JOINED = 3000
"""Data for which that is computed: it takes the square of their number."""


@none_after_fault
def read_fit(
    ctx: Context, reader: SceneReader, mesh: MeshPlan | None, history: HistoryPlan | None
) -> FitPlan | None:
    """Return the fit; None after a fault.

    reader:  of the scene without a sweep
    mesh:    None if the section has faults
    history: that of the study, at whose steps was measured
    """
    root, scene = reader.root, reader.base
    node = root.nearest("fit")
    fields = Fields(ctx, node, "fit")
    if scene is None:
        return None
    if root.at("sweep"):
        ctx.errors.at(node, "a fit is of one scene, but the study has a sweep", "remove the sweep")
    columns, file, sha256 = list[FitColumn](), "", ""
    if fields["data"]:
        columns, file, sha256 = _columns(ctx, fields, scene, history)
    memory = history.memory if history else None
    candidates = differentiable(root, scene, (scene,))
    for name, named in ctx.named.items():
        row = Key(name, "quantity", "", named.dimension)
        candidates["parameters", name] = Number(row, named.value, _geometric_use(root, name))
    parameters = list[FitParameter]()
    remedy = "write {friction.tau_s: {start: 4 MPa, within: [1 MPa, 50 MPa]}}"
    for name, item in ctx.mapping(fields["parameters"], "numbers", remedy).items():
        path = named_number(ctx, item, name, candidates, NO_DERIVATIVE, NOT_ALONE, on_key=True)
        if path:
            row = candidates[path].row
            number = Sensitivity(name, path, ctx.cf(row.dimension))
            parameter = _parameter(ctx, item, number, row, reader, memory)
            parameters += [parameter] if parameter else []
    ctx.sound()
    loads = tuple(column for column in columns if column.path)
    measured = tuple(column for column in columns if not column.path)
    options = dict[str, Any]()
    if history is not None:
        options = {"level": history.level, "history": history}
    options |= fields.given(("compare", "starts", "seed", "loss", "smooth"))
    options |= level_of(ctx, fields, mesh, "a fit")
    plan = FitPlan(loads, measured, tuple(parameters), scene, file, sha256, **options)
    _check(fields, plan)
    if history is not None:
        check_fit(ctx, fields, plan, history)
    return plan


def read_tests(
    ctx: Context, root: Node, study: Study, read: Callable[[tuple[str, ...]], Study]
) -> Study:
    """Return the study with the studies of the further tests of its fit.

    Each of them is the study with other data and values.
    read: returns the study with options like those of `--set`
    Raises StudyError with the faults of all tests.
    """
    items, fit = root.at("fit", "tests"), study.fit
    assert items is not None
    assert fit is not None
    tests = list[Study]()
    for item in items.value if isinstance(items.value, tuple) else ():
        try:
            tests.append(read(_test_options(ctx, root, study, item)))
        except StudyError as error:
            for problem in error.problems:
                fault = f"{problem.key}: {problem.what}" if problem.key else problem.what
                ctx.errors.at(item, fault, problem.remedy)
    plans = [fit, *(test.fit for test in tests if test.fit)]
    if tests and sum(plan.count for plan in plans) <= len(fit.parameters):
        ctx.errors.at(
            items, "all data together are fewer than the fitted parameters", "measure more"
        )
    if ctx.errors.problems:
        raise StudyError(ctx.errors.problems)
    sha256 = fit.sha256
    if tests:
        sha256 = hashlib.sha256("".join(plan.sha256 for plan in plans).encode()).hexdigest()
    return replace(study, tests=tuple(tests), fit=replace(fit, sha256=sha256))


def _test_options(ctx: Context, root: Node, study: Study, item: Node) -> tuple[str, ...]:
    """Return the options that make the study of a further test."""
    fields = Fields(ctx, item, "fit_test")
    nodes = ctx.mapping(fields["with"], "values by key path", "write {loads.f_x: 2 MPa}")
    values: dict[str, object] = {key: node.plain() for key, node in nodes.items()}
    for name in ("data", "noise"):
        if node := fields[name]:
            values[f"fit.{name}"] = node.plain()
    values["fit.tests"] = []
    replaced = tuple(f"{whole_key(root, key)}." for key in values)
    options = dict[str, None]()
    for option in study.overrides:
        key = whole_key(root, option.partition("=")[0].strip())
        if not f"{key}.".startswith(replaced):
            options[option] = None
    new = [f"{key}={json.dumps(value, ensure_ascii=False)}" for key, value in values.items()]
    return (*options, *new)


def _check(fields: Fields, plan: FitPlan) -> None:
    """Record columns that do not fit the comparison, and data too few for the parameters."""
    names = [column.name for column in plan.measured]
    if not plan.measured:
        fault = "no column is a result, so there is nothing to compare"
        fields.fault("data", fault, f"add one of {', '.join(RESULTS)}")
        return
    if (plan.place is None) != ("u_T" not in names):
        fault = "a profile of u_T needs the columns x and u_T"
        fields.fault("data", fault, 'write {x: "x [mm]", u_T: "u [um]"}')
    count = len(plan.parameters)
    # the data of several tests are counted together
    if plan.count <= count and "tests" not in fields.values:
        fault = f"{plan.count} data cannot decide {count} numbers"
        fields.fault("data", fault, "measure more, or fit fewer numbers")
    paths = [parameter.number.path for parameter in plan.parameters]
    paths_of_friction = [path for path in paths if path[0] == "friction"]
    if plan.smooth and sum(path[-2:-1] == (POINTS,) for path in paths_of_friction) < 3:
        remedy = "fit friction.points.0, friction.points.1 and so on, or remove smooth"
        fields.fault("smooth", "a smooth law has at least three of its points fitted", remedy)
    for parameter in plan.parameters:
        if parameter.number.path in [column.path for column in plan.given]:
            fault = f"{parameter.number.name} is a column of the data, so it is known"
            fields.fault("parameters", fault, "remove it from the parameters")
    if plan.compare == "orthogonal":
        _check_orthogonal(fields, plan, names)


def _check_orthogonal(fields: Fields, plan: FitPlan, names: Sequence[str]) -> None:
    """Record what excludes distances to a path. names: of the measured columns"""
    if len(plan.given) != 1 or plan.place is not None or names != ["friction_resultant"]:
        columns = "give one parameter of the load and friction_resultant"
        fault = "distances to a path need two columns"
        fields.fault("compare", fault, f"{columns}, or use compare: vertical")
    elif plan.scene.opens:
        fault = "a path is of slips alone, and an edge may open"
        fields.fault("compare", fault, "use compare: vertical")
    elif not isinstance(plan.scene.friction, Laws):
        fault = "a path takes one law, the same all along the contact line"
        fields.fault("compare", fault, "use compare: vertical")
    elif _detour(plan) > MAX_DETOUR:
        file = fields.values["data"].at("file") or fields.node
        fault = "the data are not in the order of the test, which distances to a path need"
        fields.ctx.errors.at(file, fault, "sort the lines by time, or compare: vertical")


def _detour(plan: FitPlan) -> float:
    """Return the length of the way through the data over that of their shortest spanning tree."""
    from scipy.sparse.csgraph import minimum_spanning_tree
    from scipy.spatial.distance import pdist, squareform

    if plan.count > MAX_JOINED:
        return 1.0
    points = np.array([plan.given[0].values, plan.measured[0].values])
    extent = np.ptp(points, axis=1, keepdims=True)
    distances = squareform(pdist((points / np.where(extent > 0.0, extent, 1.0)).T))
    shortest = float(minimum_spanning_tree(distances).sum())
    return float(distances.diagonal(1).sum()) / shortest if shortest > 0.0 else 1.0


def _columns(
    ctx: Context, fields: Fields, scene: Scene, history: HistoryPlan | None
) -> tuple[list[FitColumn], str, str]:
    """Return the columns of the table, its name and its checksum; none after a fault."""
    data = Fields(ctx, fields.values["data"], "fit_data")
    file = data["file"]
    if file is None:
        return [], "", ""
    remedy = 'write {boundary.grip.u_x: "Delta [mm]", friction_resultant: "P [N/mm]"}'
    headings = ctx.mapping(data["columns"], "names to headings", remedy)
    text, lines = table_lines(ctx, file) if headings else ("", [])
    if not lines:
        return [], "", ""
    noise = dict[str, Node]()
    noise_node = fields["noise"]
    if noise_node and noise_node.value != "estimate":
        remedy = "write {friction_resultant: 2 N/mm}, or leave it out"
        noise = ctx.mapping(noise_node, "columns to numbers", remedy, least=0)
    for name in noise.keys() - headings.keys():
        remedy = f"use {', '.join(headings)}"
        ctx.errors.at(noise[name], f"there is no column {name!r}", remedy, on_key=True)
    columns = list[FitColumn]()
    candidates = _column_candidates(scene, history is not None)
    for name, item in headings.items():
        column = _column(ctx, name, item, lines, candidates, noise)
        columns += [column] if column else []
    return columns, file.text(), hashlib.sha256(text.encode()).hexdigest()


def _column_candidates(scene: Scene, has_history: bool) -> dict[Keys, Number]:
    """Return the numbers that a column may hold: loads, or steps of a history, and results."""
    candidates = dict[Keys, Number]()
    if not has_history:
        candidates |= {keys: load for keys, load in affine_numbers(scene) if not load.idle}
    dimensions: dict[Keys, Dimension] = {STEP: NONE} if has_history else {PLACE: LENGTH}
    results = RESULTS | (RESULTS_OF_OPENINGS if scene.opens else {})
    dimensions |= {(name,): dimension for name, dimension in results.items()}
    for keys, dimension in dimensions.items():
        candidates[keys] = Number(Key(keys[0], "number", "", dimension), 0.0)
    return candidates


@none_after_fault
def _column(
    ctx: Context,
    name: str,
    node: Node,
    lines: Cells,
    candidates: Mapping[Keys, Number],
    noise: Mapping[str, Node],
) -> FitColumn | None:
    """Return a column in SI; None after a fault."""
    heading = ctx.text(node, "the heading of a column")
    headings = [str(cell.value) for cell in lines[0]]
    refusal = "no column can be"
    path = named_number(ctx, node, name, candidates, refusal, NOT_AFFINE, on_key=True) or ()
    if path and heading not in headings:
        remedy = f"it has {', '.join(map(repr, headings))}"
        ctx.errors.at(node, f"the table has no column {heading!r}", remedy)
    ctx.sound()
    position = headings.index(heading)
    dimension = candidates[path].row.dimension
    cell = lines[0][position]
    match = re.fullmatch(r".*?\[([^\]]*)\]\s*", heading)
    unit = match[1].strip() if match else ""
    if match is not None:
        ctx.unit(cell, unit, dimension)
    elif ctx.units != "none" and dimension.si != "":
        remedy = f"write {cell.brief()} [{dimension.si}]"
        ctx.errors.at(cell, f"the heading {cell.brief()!r} has no unit", remedy)
    ctx.sound()
    cells = (table_value(ctx, line[position], unit) for line in lines[1:])
    values = tuple(ctx.quantity(cell, dimension) for cell in cells)
    sigma = ctx.quantity(noise[name], dimension) if name in noise else None
    if sigma is not None and sigma <= 0.0:
        ctx.errors.at(noise[name], "must be above 0", "give the standard deviation of the noise")
    path = () if name in (*RESULTS, *RESULTS_OF_OPENINGS) else path
    return FitColumn(name, path, ctx.cf(dimension), values, sigma, dimension)


def _geometric_use(root: Node, name: str) -> str:
    """Return why a name of `parameters` cannot be fitted: it changes the geometry; empty if not."""
    names = users(root, name)
    used = [key for key in GEOMETRIC if (node := root.at(key)) and words_in(node, names)]
    if not used:
        return ""
    return f"{' and '.join(used)} {'is' if len(used) == 1 else 'are'} made of it"


@none_after_fault
def _parameter(
    ctx: Context,
    node: Node,
    number: Sensitivity,
    row: Key,
    reader: SceneReader,
    memory: Memory | None,
) -> FitParameter:
    """Return a parameter to identify; it is a fault if the scene cannot have it at both bounds."""
    fields = Fields(ctx, node, "fit_parameter")
    ctx.sound()
    start = fields.value("start", row.dimension)
    low, high = fields.value("within", row.dimension)
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
    for bound in (low, high):
        if fault := _fault_at(bound, number, row, reader, memory):
            fields.fault("within", f"{number.name} = {bound:g}: {fault}; narrow the bounds")
    ctx.sound()
    if number.path[0] == "parameters":
        try:
            if not reader.rates(scene, number.path[1], {number.path: start}):
                fields.fault("start", f"no section uses {number.name}; remove it")
        except UserFault as error:
            remedy = "fit a number that is the same everywhere, or give it a value"
            fields.fault("start", f"{error}; {remedy}")
    return FitParameter(number, start, low, high, scale == "log")


def _fault_at(
    bound: float, number: Sensitivity, row: Key, reader: SceneReader, memory: Memory | None
) -> str:
    """Return why the scene cannot have a number at this bound; empty if it can."""
    scene = reader.base
    assert scene is not None
    if limits := out_of_bounds(row, bound):
        return f"must {limits}"
    if number.path[-1] == "alpha" and bound <= 0.0:
        return "must be greater than 0, or the heat of the body cannot be told"
    is_stiffness = number.path[0] == "history"
    try:
        if not is_stiffness:
            scene = reader.at(scene, {number.path: bound})
        if memory:
            stiffness = bound if is_stiffness else memory.stiffness
            replace(memory, stiffness=stiffness).fits(scene.friction)
    except StudyError as error:
        return error.problems[0].what
    except UnfitLaw as error:
        return str(error).partition("; ")[0]
    return ""
