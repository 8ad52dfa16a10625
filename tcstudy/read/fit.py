"""Reads the section `fit`: a table of measurements, its noise, and the numbers of the study that are to be found.

The table is a CSV file with a heading and its unit over each column, `Delta [mm],P [N/mm]`; the study says what it
calls the columns: parameters in which the load is affine are given to the scene, results are compared. What the data
could never decide is refused here; what they do not decide in the end is said with the result.
"""

from __future__ import annotations

import hashlib
import math
import re
from collections.abc import Mapping
from dataclasses import replace
from itertools import pairwise

import numpy as np

from tcstudy.laws.derivatives import POINTS
from tcstudy.laws.pieces import GrowthError
from tcstudy.laws.shapes import LawError
from tcstudy.read.asked import differentiable, named_number
from tcstudy.read.fields import Context, Fields, none_after_fault, out_of_bounds
from tcstudy.read.history import check_fit
from tcstudy.read.node import Node
from tcstudy.read.plans import level_of, meant_number, path_of
from tcstudy.read.points import table_lines
from tcstudy.scene.fits import PLACE, RESULTS, STEP, FitColumn, FitMark, FitParameter, FitPlan, Sensitivity
from tcstudy.scene.histories import HistoryPlan, Memory, UnfitLaw
from tcstudy.scene.key import Key
from tcstudy.scene.parameters import affine_numbers, with_number
from tcstudy.scene.records import Scene
from tcstudy.scene.study import MeshPlan
from tcstudy.scene.units import LENGTH, NONE, NUMBER, Dimension

Cells = list[tuple[Node, ...]]


@none_after_fault
def read_fit(
    ctx: Context, node: Node, root: Node, scene: Scene | None, mesh: MeshPlan | None, history: HistoryPlan | None
) -> FitPlan | None:
    """The fit; None after a fault.

    scene: the scene without a sweep, mesh: the meshes; None if they have faults of their own
    history: that of the study, at whose steps was measured
    """
    before, fields = len(ctx.errors), Fields(ctx, node, "fit")
    if scene is None:
        return None
    if root.child("sweep"):
        ctx.errors.at(node, "a fit is of one scene, but the study has a sweep", "remove the sweep")
    columns, sha256 = _columns(ctx, fields, scene, history) if "data" in fields.values else ([], "")
    parameters = _parameters(ctx, fields, root, scene, history) if "parameters" in fields.values else ()
    if len(ctx.errors) > before:
        return None
    given, measured = (tuple(c for c in columns if bool(c.path) is is_given) for is_given in (True, False))
    options = fields.given(("compare", "starts", "seed", "loss", "smooth")) | level_of(ctx, fields, mesh, "a fit")
    file = str(fields.values["data"].child("file").text())  # type: ignore[union-attr]
    if history is not None:
        options = {"level": history.level, "history": history} | options
    plan = FitPlan(given, measured, parameters, scene, file, sha256, marks=_marks(ctx, fields, given), **options)
    _check(ctx, fields, plan)
    if history is not None:
        check_fit(ctx, fields, plan, history)
    return plan


def _check(ctx: Context, fields: Fields, plan: FitPlan) -> None:
    """What goes together: columns with the comparison, data with the numbers to find."""
    data, names = fields.values["data"], [one.name for one in plan.given]
    if not plan.measured:
        ctx.errors.at(data, "no column is a result, so there is nothing to compare", f"add one of {', '.join(RESULTS)}")
        return
    if (plan.place is None) != ("u_T" not in [one.name for one in plan.measured]):
        ctx.errors.at(data, "a profile of u_T needs the columns x and u_T", 'write {x: "x [mm]", u_T: "u [um]"}')
    n, k = plan.count, len(plan.parameters)
    if n <= k:
        ctx.errors.at(data, f"{n} data cannot decide {k} numbers", "measure more, or fit fewer numbers")
    ends = [one.number.path[-2:-1] == (POINTS,) for one in plan.parameters]
    if plan.smooth and sum(ends) < 3:
        remedy = "fit friction.points.0, friction.points.1 and so on, or remove smooth"
        ctx.errors.at(fields["smooth"] or data, "a smooth law has at least three of its points fitted", remedy)
    if plan.marks and not plan.known_noise:
        what = f"a {plan.marks[0].name} is weighed against the other data, whose noise must be known"
        ctx.errors.at(fields["noise"] or data, what, "give the noise of every column")
    for parameter in plan.parameters:
        if parameter.number.path in [one.path for one in plan.given]:
            what = f"{parameter.number.name} is a column of the data, so it is known"
            ctx.errors.at(fields.values["parameters"], what, "remove it from the parameters")
    orthogonal = plan.compare == "orthogonal"
    if not orthogonal and not plan.marks:
        return
    curve = len(names) == 1 and plan.place is None
    here = fields["compare"] if orthogonal else fields[plan.marks[0].name]
    assert here is not None
    instead = "use compare: vertical" if orthogonal else "leave it out"
    if not curve or (orthogonal and [one.name for one in plan.measured] != ["friction_resultant"]):
        need = "distances to a path need two columns" if orthogonal else "a path needs one parameter of the load"
        ctx.errors.at(here, need, f"give one parameter of the load and friction_resultant, or {instead}")
    elif len(plan.scene.laws) > 1:
        ctx.errors.at(here, "a path takes one law", instead)
    elif orthogonal and _to_and_fro(plan) > SHUFFLED:
        what = "the data jump to and fro, but feet on a path need them in the order of the test"
        ctx.errors.at(data.child("file") or data, what, "sort the lines by time, or compare: vertical")


def _marks(ctx: Context, fields: Fields, given: tuple[FitColumn, ...]) -> tuple[FitMark, ...]:
    """The fold and the peak, where they are given."""
    load = next((one for one in given if one.path != PLACE), None)
    found = []
    for name in ("fold", "peak"):
        node = fields[name]
        if node is None:
            continue
        before, inner = len(ctx.errors), Fields(ctx, node, "fit_mark")
        dimension = load.dimension if name == "fold" and load else RESULTS["friction_resultant"]
        if len(ctx.errors) > before:
            continue
        at, noise = inner.value("at", dimension), inner.value("noise", dimension)
        if len(ctx.errors) == before and not noise > 0.0:
            ctx.errors.at(inner.values["noise"], "must be above 0", "give the standard deviation of the noise")
        elif len(ctx.errors) == before:
            found.append(FitMark(name, ctx.cf(dimension), at, noise))
    return tuple(found)


SHUFFLED = 4.0
"""Way through the data over one from each to the nearest that is left, above which they are in no order."""


def _to_and_fro(plan: FitPlan) -> float:
    """How much longer the way through the data is than one that goes to the nearest next."""
    points = np.array([plan.given[0].values, plan.measured[0].values])
    left = list((points / np.maximum(np.ptp(points, axis=1, keepdims=True), np.finfo(float).tiny)).T)
    own = sum(float(np.linalg.norm(b - a)) for a, b in pairwise(left))
    way, here = 0.0, left.pop(0)
    while left:
        far = np.linalg.norm(np.array(left) - here, axis=1)
        here, way = left.pop(int(np.argmin(far))), way + float(far.min())
    return own / way if way > 0.0 else 1.0


def _columns(ctx: Context, fields: Fields, scene: Scene, history: HistoryPlan | None) -> tuple[list[FitColumn], str]:
    """The columns of the table, and its checksum; none after a fault."""
    data = Fields(ctx, fields.values["data"], "fit_data")
    wanted, file = data["columns"], data["file"]
    if wanted is None or file is None:
        return [], ""
    remedy = 'write {boundary.grip.u_x: "Delta [mm]", friction_resultant: "P [N/mm]"}'
    if not (headings := ctx.mapping(wanted, "names to headings", remedy)):
        return [], ""
    before = len(ctx.errors)
    path, text, lines = table_lines(ctx, file)
    if not text and len(ctx.errors) > before:
        return [], ""
    if len(lines) < 2:
        ctx.errors.at(file, f"{path} has no data", "write a heading for each column and a line for each datum")
    _check_lines(ctx, lines)
    if len(ctx.errors) > before:
        return [], ""
    noise = _noise(ctx, fields["noise"], tuple(headings))
    found = [_column(ctx, name, item, lines, scene, noise, history is not None) for name, item in headings.items()]
    return [one for one in found if one], hashlib.sha256(text.encode()).hexdigest()


def _check_lines(ctx: Context, lines: Cells) -> None:
    """One fault for what is wrong with all lines alike."""
    heads = [str(cell.value) for cell in lines[0]] if lines else []
    for mark, name in ((";", "semicolons"), ("\t", "tabs")):
        if len(heads) == 1 and mark in heads[0]:
            ctx.errors.at(lines[0][0], f"columns are separated by {name}", "write commas, and a point in decimals")
            return
    if heads and all(re.fullmatch(NUMBER, head) for head in heads):
        ctx.errors.at(lines[0][0], "the table has no headings", "write a name and a unit over each column: P [N/mm]")
        return
    for k, head in enumerate(heads):
        if head and head in heads[:k]:
            ctx.errors.at(lines[0][k], f"the heading {head!r} stands twice", "give every column its own heading")
    wrong = [row for row in lines[1:] if len(row) != len(heads)]
    if wrong:
        others = f", and {len(wrong) - 1} other lines likewise" if len(wrong) > 1 else ""
        what = f"has {len(wrong[0])} entries, but the header {len(heads)}{others}"
        ctx.errors.at(wrong[0][-1], what, "give every column a number; decimals have a point, columns a comma")


def _noise(ctx: Context, node: Node | None, names: tuple[str, ...]) -> Mapping[str, Node]:
    """The noise of the columns by name; empty where it is to be estimated."""
    if node is None or node.value == "estimate":
        return {}
    given = ctx.mapping(node, "columns to numbers", "write {friction_resultant: 2 N/mm}, or leave it out", least=0)
    for name, item in given.items():
        if name not in names:
            ctx.errors.at(item, f"there is no column {name!r}", f"use {', '.join(names)}", on_key=True)
    return given


def _column(
    ctx: Context, name: str, node: Node, lines: Cells, scene: Scene, noise: Mapping[str, Node], stepwise: bool
) -> FitColumn | None:
    """One column in SI; None after a fault. stepwise: of a history, whose lines have steps in the place of loads"""
    before, path = len(ctx.errors), path_of(name)
    affine = {} if stepwise else dict(affine_numbers(scene))
    if name in RESULTS:
        path, dimension = (), RESULTS[name]
    elif path == PLACE:
        dimension = LENGTH
    elif stepwise and path == STEP:
        dimension = NONE
    elif path in affine and not affine[path].idle:
        dimension = affine[path].row.dimension
    else:
        others = (*RESULTS, "step") if stepwise else tuple(RESULTS)
        remedy = meant_number(name, affine, f"use {', '.join(others)}" + ("," if affine else ""), others)
        what = "the step of the history" if stepwise else "a parameter of the load"
        ctx.errors.at(node, f"{name!r} is neither a result nor {what}", remedy, on_key=True)
        return None
    heading = ctx.text(node, "the heading of a column")
    heads = [str(cell.value) for cell in lines[0]]
    if heading not in heads:
        shown = ", ".join(map(repr, heads))
        ctx.errors.at(node, f"the table has no column {heading!r}", f"it has {shown}")
        return None
    at = heads.index(heading)
    unit = _unit(ctx, lines[0][at], dimension)
    values = tuple(_number(ctx, row[at], unit, dimension) for row in lines[1:]) if unit is not None else ()
    sigma = ctx.quantity(noise[name], dimension) if name in noise else None
    if sigma is not None and sigma <= 0.0:
        ctx.errors.at(noise[name], "must be above 0", "give the standard deviation of the noise")
    return FitColumn(name, path, ctx.cf(dimension), values, sigma, dimension) if len(ctx.errors) == before else None


def _unit(ctx: Context, cell: Node, dimension: Dimension) -> str | None:
    """The unit in a heading, empty for a plain number; None after a fault."""
    match = re.fullmatch(r".*?\[([^\]]*)\]\s*", str(cell.value))
    plain = ctx.units == "none" or dimension.si == ""
    if match is None:
        if plain:
            return ""
        what, remedy = f"the heading {cell.brief()!r} has no unit", f"write {cell.brief()} [{dimension.si}]"
        ctx.errors.at(cell, what, remedy)
        return None
    if plain:
        ctx.errors.at(cell, "has a unit, but the study says units: none", "drop the unit")
        return None
    return match[1].strip() if ctx.unit(cell, match[1].strip(), dimension) else None


def _number(ctx: Context, cell: Node, unit: str, dimension: Dimension) -> float:
    word = str(cell.value)
    if re.fullmatch(NUMBER, word) is None:
        what = f"{word!r} is no number" if word else "is empty"
        ctx.errors.at(cell, what, "give every column a number in every line, or take the line out")
        return math.nan
    return ctx.quantity(replace(cell, value=f"{word} {unit}" if unit else float(word)), dimension)


def _parameters(
    ctx: Context, fields: Fields, root: Node, scene: Scene, history: HistoryPlan | None
) -> tuple[FitParameter, ...]:
    """The numbers to find."""
    node, memory = fields.values["parameters"], history.memory if history else None
    known = differentiable(root, scene, (scene,))
    found, remedy = [], "write {friction.tau_s: {start: 4 MPa, within: [1 MPa, 50 MPa]}}"
    for name, item in ctx.mapping(node, "numbers", remedy).items():
        if number := named_number(ctx, item, name, root, known, on_key=True):
            found.append(_parameter(ctx, item, number, known[number.path].row, scene, memory))
    return tuple(one for one in found if one)


def _parameter(
    ctx: Context, node: Node, number: Sensitivity, row: Key, scene: Scene, memory: Memory | None
) -> FitParameter | None:
    before, fields = len(ctx.errors), Fields(ctx, node, "fit_parameter")
    if len(ctx.errors) > before:
        return None
    both = ctx.pair(fields.values["within"], "a pair [low, high]", fields.rows["within"].example)
    start = fields.value("start", row.dimension)
    low, high = (ctx.quantity(item, row.dimension) for item in both) if both else (math.nan, math.nan)
    if len(ctx.errors) > before:
        return None
    if not low < high:
        ctx.errors.at(fields.values["within"], "does not grow", "give the lower end first")
    elif not low <= start <= high:
        ctx.errors.at(fields.values["start"], "lies outside within", "begin between the two ends")
    scale = fields.value("scale") or ("log" if low > 0.0 else "linear")
    if scale == "log" and low <= 0.0:
        ctx.errors.at(fields.values["within"], "begins at 0 or below, which has no logarithm", "write scale: linear")
    for end in (low, high) if len(ctx.errors) == before else ():
        if why := _refused(scene, number, row, end, memory):
            ctx.errors.at(fields.values["within"], f"{number.name} = {end:g}: {why}", "narrow the bounds")
    return FitParameter(number, start, low, high, scale == "log") if len(ctx.errors) == before else None


def _refused(scene: Scene, number: Sensitivity, row: Key, value: float, memory: Memory | None) -> str:
    """Why a scene cannot have this value; empty if it can."""
    if must := out_of_bounds(row, value):
        return f"must {must}"
    if number.path[-1] == "alpha" and value <= 0.0:
        return "must be greater than 0, or the heat of the body cannot be told"
    try:
        if number.path[0] == "history" and memory:
            memory = replace(memory, stiffness=value)
        else:
            scene = with_number(scene, number, value)
        for law in scene.laws if memory else ():
            memory.check(law)  # type: ignore[union-attr]
    except (LawError, GrowthError, UnfitLaw) as error:
        return str(error).partition("; ")[0]
    return ""
