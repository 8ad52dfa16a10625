"""Data of the page of a run: numbers of all points, totals of histories, bodies, lines, laws.

The states of the nodes and the pieces of the laws are part of the data: the scripts have no rules
of their own and know no law by name. With the live data, of one level and of every point, the page
solves contact problems itself.

A function that returns a part of the page fills the container `box` with the arrays of the part.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tcstudy.data.reading import asked, axis_names, by_point, sweep_dims
from tcstudy.data.schema import MISSING_COUNT, STICKS, PointStatus
from tcstudy.laws.composed import EdgeLaws
from tcstudy.laws.laws import Laws
from tcstudy.laws.shapes import knows_pressure
from tcstudy.reports.figures.body import boundary_edges, exaggeration
from tcstudy.reports.figures.point import CURVE, JUMPS, slip_range
from tcstudy.reports.figures.sweep import has_equal_ratios
from tcstudy.reports.json_values import Json
from tcstudy.reports.page.parts import Container, page_look
from tcstudy.reports.page.stored import LEVEL_VARIABLES, Stored
from tcstudy.reports.picture import (
    LineFields,
    NamedEdge,
    at_rest,
    contact_line,
    edge_laws,
    ends_held,
    named_edges,
    nearest,
    opening_line,
    opening_states,
    sources,
    states_of,
)
from tcstudy.reports.select_point import numbers_of
from tcstudy.reports.sentences import several
from tcstudy.reports.text import LAMBDA_1_TOLERANCE, named, study_unit
from tcstudy.scene.points import combinations
from tcstudy.scene.records import Scene

MAX_DOUBLE_BYTES = 300_000
"""Size of all numbers up to which the page has all digits; beyond, seven (the energy has all)."""
DIAGNOSTIC = ("inclusion_", "iterations", "evaluations", "heat_balance", "time_", "lambda_1_error")
"""First letters of the numbers that stand after the others."""
SUMS = ("dissipated", "released", "work", "jumps")
"""Numbers of a history that are summed over its steps."""
FLAGS = (
    *("status", "unique", "strict_minimum", "global_minimum"),
    *("heat_status", "start_used", "complete"),
)
MAX_NODES = 8_000
"""Mesh nodes up to which a level is drawn; finer ones would cost room that no screen shows."""
DECAYS = 6.0
"""Decay lengths of a law that are drawn."""
ALONG = {"u_T": "u_T", "xi": "xi", "N": "section_force"}
"""Variables along the contact line, by their names on the page."""
NO_SOLUTION = -1
"""Stands for the ContactState of every node of a point without solution."""
MIXED_LAW = -1
"""Stands for the law of a node shared by two edges, which has a mixture that is not drawn."""

# -- points ----------------------------------------------------------------------------------------


def run_part(stored: Stored, box: Container) -> Json:
    """Return axes, numbers and flags of all points in C order; of a history its totals."""
    data = totals(stored.data) if stored.kind == "history" else stored.data
    dims = sweep_dims(stored.data)
    numbers = _numbers(stored, data)
    with_units = [name for name in LEVEL_VARIABLES if name in data]
    part: Json = {
        "mode": str(data.attrs["sweep_mode"]),
        "dims": dims,
        "shape": [int(data.sizes[dim]) for dim in dims],
        "axes": axes(data),
        "units": {name: str(data[name].attrs["units"]) for name in with_units},
        "levels": level_numbers(data),
        "numbers": _number_parts(data, numbers, box),
        "asked": [name for name in asked(data) if name in numbers],
        "flags": _flag_parts(data, box),
        "statuses": [named(status) for status in PointStatus],
    }
    part |= _reasons(data, box)
    part |= _starts(data, box)
    return part


def _flag_parts(data: Any, box: Container) -> Json:
    """Return the flags of all points; `several`: whether starts led to different energies."""
    flags = {name: by_point(data[name], data) for name in FLAGS if name in data}
    if "start_energy" in data:
        energies = by_point(data["start_energy"], data)
        flags["several"] = several(energies, flags["unique"] == 1)
    return {name: box.array(values, "i1") for name, values in flags.items()}


def _reasons(data: Any, box: Container) -> Json:
    """Return the reasons of failures, each once, and the index of the reason of every point."""
    reasons = by_point(data["reason"], data)
    texts, index = np.unique(reasons.astype(str), return_inverse=True)
    return {"reasons": texts.tolist(), "reason": box.array(index.reshape(reasons.shape), "u2")}


def _starts(data: Any, box: Container) -> Json:
    """Return the names of the starts and the energy that each led to."""
    if "start_energy" not in data:
        return {"starts": [], "start_energy": None}
    names = [str(start) for start in data["start"].values]
    energies = by_point(data["start_energy"], data)
    return {"starts": names, "start_energy": box.array(energies)}


def _numbers(stored: Stored, data: Any) -> dict[str, Any]:
    """Return the (P, L) numbers of a run less rounding: requested first, diagnostics last."""
    numbers = {}
    for name in numbers_of(data):
        if name == "inclusion_rounding":
            continue
        values = _without_missing(by_point(data[name], data))
        levels = [stored.floors.cleared(name, row, n) for n, row in enumerate(values.T)]
        cleared = np.stack(levels, axis=1)
        if not np.isnan(cleared).all():
            numbers[name] = cleared
    requested = [name for name in ("u_T_max", *asked(data)) if name in numbers]
    remaining = [name for name in numbers if name not in requested]
    remaining.sort(key=lambda name: name.startswith(DIAGNOSTIC))
    return {name: numbers[name] for name in (*requested, *remaining)}


def _number_parts(data: Any, numbers: dict[str, Any], box: Container) -> Json:
    """Return numbers with their titles and units."""
    n_bytes = data["status"].size * len(numbers) * 8
    usual_type = "f8" if n_bytes <= MAX_DOUBLE_BYTES else "f4"
    parts = {}
    for name, values in numbers.items():
        attrs = data[name].attrs
        title = f"{attrs.get('long_name', '')}: {attrs.get('comment', '')}"
        number_type = "f8" if name == "energy" else usual_type
        parts[name] = {
            "long_name": title.rstrip(": "),
            "units": str(attrs["units"]),
            "v": box.array(values, number_type),
        }
    return parts


def _without_missing(values: Any) -> Any:
    """Return numbers with NaN in place of missing counts."""
    if values.dtype.kind != "i":
        return values
    return np.where(values == MISSING_COUNT, np.nan, values)


def totals(data: Any) -> Any:
    """Return a history as a run of one level: sums over its solved steps, flags of all steps."""
    is_solved = data["status"] == int(PointStatus.OK)
    run = data[list(SUMS)].where(is_solved).sum("step", min_count=1, keep_attrs=True)
    run["u_T_max"] = data["u_T_max"].where(is_solved).max("step", keep_attrs=True)
    # step 0 is the unloaded state, which is given and not solved
    step_count = is_solved.sum("step") - 1.0
    run["steps"] = step_count.assign_attrs(long_name="steps solved", units="1")
    run = run.assign(_weakest_flags(data, is_solved).data_vars)
    run = run.assign(reason=data["reason"])
    is_whole = is_solved.all("step")
    run["status"] = is_whole.astype("i1") + int(PointStatus.NOT_CONVERGED) * ~is_whole
    run = run.expand_dims(level=1, axis=-1)
    of_level = [name for name in LEVEL_VARIABLES if name in data]
    run = run.assign({name: data[name].expand_dims("level") for name in of_level})
    return run.assign_attrs(data.attrs)


def _weakest_flags(data: Any, is_solved: Any) -> Any:
    """Return of every flag of a history its least value in the solved steps."""
    flags = data[[name for name in FLAGS if name in data and name != "status"]]
    # nothing is proved of step 0, the unloaded state
    judged = flags.where(is_solved, 1).isel(step=slice(1, None))
    return judged.min("step", keep_attrs=True).astype("i1")


def level_numbers(data: Any) -> Json:
    """Return sizes and times of the levels."""
    return {name: data[name].values.tolist() for name in LEVEL_VARIABLES if name in data}


def time_of_levels(geometries: Sequence[Any]) -> Json:
    """Return the times of the levels, summed over all geometries."""
    times = {}
    for name in LEVEL_VARIABLES:
        if name.startswith("time") and all(name in data for data in geometries):
            values = [data[name].values for data in geometries]
            times[name] = np.nansum(values, axis=0).tolist()
    return times


def axes(data: Any) -> list[Json]:
    """Return the swept parameters: name, units, values, and the dimension of each."""
    return [_axis(data[name], name) for name in axis_names(data)]


def _axis(coordinate: Any, name: str) -> Json:
    """Return a swept parameter; `drawn`: its values were sampled from a distribution."""
    values, attrs = coordinate.values, coordinate.attrs
    is_numeric = values.dtype.kind not in "OUS"
    is_sampled = "distribution" in attrs
    return {
        "name": name,
        "units": str(attrs.get("units", "1")),
        "numeric": is_numeric,
        "values": values.tolist(),
        "dim": str(coordinate.dims[0]),
        "written": study_unit(attrs),
        "drawn": is_sampled,
        "log": is_numeric and not is_sampled and has_equal_ratios(values),
    }


# -- bodies and contact lines ----------------------------------------------------------------------


def shape(stored: Stored) -> Json:
    """Return the edges of the body with their roles, and its heated regions."""
    outline = [{**vars(edge), "line": edge.line.tolist()} for edge in _edges(stored)]
    return {"outline": outline, "sources": [line.tolist() for line in sources(stored.study)]}


def _edges(stored: Stored) -> list[NamedEdge]:
    """Return the named edges of the body; those of a CAD file are taken from the drawn level."""
    level = drawn_level(stored)
    if level is None:
        level = min(stored.groups, default=None)
    return named_edges(stored.study, {} if level is None else stored.groups[level])


def drawn_level(stored: Stored) -> int | None:
    """Return the finest level with fields of at most MAX_NODES nodes, else the coarsest."""
    with_fields = [
        level for level, group in stored.groups.items() if "u_x" in group and "node_x" in group
    ]
    small = [level for level in with_fields if stored.groups[level].sizes["mesh_node"] <= MAX_NODES]
    return max(small) if small else min(with_fields, default=None)


def body_part(stored: Stored, level: int, box: Container) -> Json:
    """Return mesh, boundary with roles, and fields of all points, within 0.1 % of their range."""
    group = stored.groups[level]
    xy = np.column_stack([group["node_x"].values, group["node_y"].values])
    triangles = group["triangle"].values
    boundary = boundary_edges(xy, triangles.astype(np.intp))
    fields = _body_fields(stored, level)
    u = np.stack([fields["u_x"], fields["u_y"]], axis=-1)
    theta_units = str(group["theta"].attrs["units"]) if "theta" in group else "1"
    part: Json = {
        "level": level,
        "x": box.array(xy[:, 0], "f4"),
        "y": box.array(xy[:, 1], "f4"),
        "triangle": box.array(triangles, "u2" if len(xy) < 65536 else "i4"),
        "boundary": box.array(boundary, "i4"),
        "edge": box.array(nearest(xy[boundary], _edges(stored)), "i1"),
        "factor": exaggeration(xy, u),
        "theta": None,
        "theta_units": theta_units,
    }
    return part | {name: box.fields(values) for name, values in fields.items()}


def _body_fields(stored: Stored, level: int) -> dict[str, Any]:
    """Return the (P, n) fields of a level that the file has, 0 without a value."""
    group = stored.groups[level]
    fields = {}
    for name in ("u_x", "u_y", "theta"):
        if name in group:
            values = by_point(group[name], stored.data)
            fields[name] = np.where(np.isfinite(values), values, 0.0)
    if "theta" in fields:
        fields["theta"] = stored.floors.cleared("theta", fields["theta"], level)
    return fields


def line_part(stored: Stored, level: int, box: Container) -> Json:
    """Return the contact line of a level with u_T, ξ and states of all points, in C order."""
    group = stored.groups[level]

    def rows(variable: Any) -> Any:
        values = by_point(variable, stored.data)
        return stored.floors.cleared(str(variable.name), values, level)

    line = line_along(group, rows, box)
    line |= _laws_of_nodes(stored, contact_line(group), box)
    line["rest"] = at_rest(stored.study)
    u_T = by_point(group["u_T"], stored.data)
    is_sticking = by_point(group["sticks"], stored.data) == STICKS
    states = _states(stored, group, u_T, slice(None), is_sticking)
    line["state"] = box.array(states, "i1")
    if "opening" in group:
        line["openings"] = _openings_part(stored, group, rows, box)
    if "held_u_T" in group:
        line["held_u_T"] = box.rows(by_point(group["held_u_T"], stored.data))
    if "solution_u_T" in group and stored.selection is None:
        line["every"] = _equilibria(stored, level, box)
    return line


def _openings_part(stored: Stored, group: Any, rows: Callable[[Any], Any], box: Container) -> Json:
    """Return the nodes that may open as a line, with openings as u_T, S_N as ξ and their states.

    `rows` returns the (P, k) values of a variable.
    """
    opening, rests = rows(group["opening"]), by_point(group["rests_N"], stored.data) == STICKS
    states = _normal_states(stored, group, opening, slice(None), rests)
    return openings_along(group, opening, rows(group["S_N"]), states, box)


def openings_along(data: Any, opening: Any, S_N: Any, states: Any, box: Container) -> Json:
    """Return the nodes that may open as a line: opening, S_N and states (P, k) of all points."""
    line = opening_line(data)
    page_line: Json = {
        name: box.array(getattr(line, name)) for name in ("arclength", "x", "y", "c")
    }
    page_line["edges"] = list(line.edge_names)
    page_line["edge"] = box.array(line.edge, "i1")
    page_line["opens"] = [line.edge_names[index] for index in np.unique(line.edge)]
    page_line["parts"] = [_line_piece(line, part, (-1, -1), box) for part in line.parts]
    page_line["u_T"], page_line["u_T_units"] = box.rows(opening), line.length_units
    page_line["xi"], page_line["xi_units"] = box.rows(S_N), line.traction_units
    page_line["state"] = box.array(states, "i1")
    return page_line


def _normal_states(stored: Stored, group: Any, s_N: Any, points: Any, rests: Any) -> Any:
    """Return (R, k) the NormalState of every node of solutions of points, or NO_SOLUTION."""
    is_solved = np.isfinite(s_N).all(axis=1)
    states = opening_states(None, group, s_N, rests)
    scenes, scene_of_point = _adhesions_of(stored)
    for number, scene in enumerate(scenes):
        chosen = np.flatnonzero(is_solved & (scene_of_point[points] == number))
        states[chosen] = opening_states(scene, group, s_N[chosen], rests[chosen])
    states[~is_solved] = NO_SOLUTION
    return states


def _adhesions_of(stored: Stored) -> tuple[list[Scene], NDArray[np.intp]]:
    """Return scenes with the different adhesions of a study, and the index of every point's."""
    if stored.study is None or not stored.has_scenes:
        return [], np.empty(0, dtype=np.intp)
    scenes, scene_of_point = combinations(stored.study.scenes, "adhesion")
    if stored.selection is not None:
        scene_of_point = scene_of_point[stored.selection]
    return list(scenes), scene_of_point


def _opening_law_part(stored: Stored) -> Json | None:
    """Return the laws of bonds that may open, their edges, and their indices for every point."""
    scenes, scene_of_point = _adhesions_of(stored)
    if not scenes or not scenes[0].adhesive_edges:
        return None
    edges = scenes[0].adhesive_edges
    numbers = dict[Laws, int]()
    indices = []
    for scene in scenes:
        of_edge = {edge: law for edge, law, _ in scene.opening_laws.laws}
        indices.append([numbers.setdefault(of_edge[edge], len(numbers)) for edge in edges])
    laws = [drawn_law(law) | {"closed": bool(np.all(law.is_closed))} for law in numbers]
    return {
        "laws": laws,
        "index": [indices[number] for number in scene_of_point],
        "edges": list(edges),
    }


def _equilibria(stored: Stored, level: int, box: Container) -> Json:
    """Return all stored equilibria, point by point, by energy."""
    group = stored.groups[level]
    point, u_T, xi = (group[f"solution_{name}"].values for name in ("point", "u_T", "xi"))
    point_count = stored.data["status"][..., -1].size
    first_of_point = np.searchsorted(point, np.arange(point_count + 1))
    states = _states(stored, group, u_T, point, np.zeros(u_T.shape, dtype=bool))
    openings: Json = {}
    if "solution_opening" in group:
        opening = group["solution_opening"].values
        S_N = group["solution_S_N"].values
        rests = np.zeros(opening.shape, dtype=bool)
        openings = {
            "openings_u_T": box.rows(stored.floors.cleared("opening", opening, level, point)),
            "openings_xi": box.rows(stored.floors.cleared("S_N", S_N, level, point)),
            "openings_state": box.array(_normal_states(stored, group, opening, point, rests), "i1"),
        }
    return openings | {
        "first": box.array(first_of_point, "i4"),
        "energy": box.array(group["solution_energy"].values),
        "stable": box.array(group["solution_stable"].values, "i1"),
        "u_T": box.rows(stored.floors.cleared("u_T", u_T, level, point)),
        "xi": box.rows(stored.floors.cleared("xi", xi, level, point)),
        "state": box.array(states, "i1"),
    }


def line_along(data: Any, rows: Callable[[Any], Any], box: Container) -> Json:
    """Return a contact line with the variables along it and their units.

    `rows` returns the (P, m) values of a variable.
    """
    line = contact_line(data)
    page_line: Json = {
        name: box.array(getattr(line, name)) for name in ("arclength", "x", "y", "c")
    }
    page_line["edges"] = list(line.edge_names)
    parts_with_ends = zip(line.parts, ends_held(line, data), strict=True)
    page_line["parts"] = [_line_piece(line, part, ends, box) for part, ends in parts_with_ends]
    for name, key in ALONG.items():
        if key in data:
            page_line[name] = box.rows(rows(data[key]))
            page_line[f"{name}_units"] = str(data[key].attrs["units"])
    return page_line


def _line_piece(line: LineFields, part: slice, ends: Any, box: Container) -> Json:
    """Return one of the separate parts of a contact line.

    `held` tells of both ends whether a constrained node is there, and `ends` its index in
    `held_u_T` (-1 for none).
    """
    return {
        "a": part.start,
        "b": part.stop,
        "cells": box.array(line.cells(part)),
        "closed": line.closed(part),
        "held": list(line.held(part)),
        "ends": ends,
    }


def _states(stored: Stored, group: Any, u_T: Any, points: Any, is_sticking: Any) -> Any:
    """Return (R, m) the ContactState of every node of solutions of points, or NO_SOLUTION."""
    is_solved = np.isfinite(u_T).all(axis=1)
    states = states_of(None, group, u_T, is_sticking)
    frictions, friction_of_point = frictions_of(stored)
    for number, friction in enumerate(frictions):
        rows = np.flatnonzero(is_solved & (friction_of_point[points] == number))
        states[rows] = states_of(friction, group, u_T[rows], is_sticking[rows])
    states[~is_solved] = NO_SOLUTION
    return states


def live_part(stored: Stored, box: Container) -> Json | None:
    """Return the finest level with live data, or None without a valid point.

    A: the lower triangle of the symmetric A_tilde by rows;  proved: λ₁ less its error, which ω must
    not reach.
    """
    level = _live_level(stored)
    if level is None or stored.study is None:
        return None
    run, data = stored.data, stored.live[level]
    lambda_1 = by_point(run["lambda_1"], run)[:, level]
    error = by_point(run["lambda_1_error"], run)[:, level]
    A_tilde = data["A_tilde"].values
    part: Json = {
        "level": level,
        "A": box.array(A_tilde[np.tril_indices(len(A_tilde))]),
        "c": box.array(stored.groups[level]["c"].values),
        "lambda_1": box.array(lambda_1),
        "proved": box.array(lambda_1 * (1.0 - np.maximum(error, LAMBDA_1_TOLERANCE))),
    }
    for name in ("stiffness", "valid", "load", "mechanical_load"):
        part[name] = box.array(by_point(data[name], run))
    return part


def _live_level(stored: Stored) -> int | None:
    """Return the finest level with loads and a valid point."""
    levels = []
    for level, data in stored.live.items():
        if "load" in data and np.any(data["valid"].values == 1.0):
            levels.append(level)
    return max(levels, default=None)


# -- laws ------------------------------------------------------------------------------------------


def frictions_of(stored: Stored) -> tuple[list[Laws | EdgeLaws], NDArray[np.intp]]:
    """Return the different frictions of a study, and the index among them of every point.

    If one friction has a law for every edge, all are given so, with the edges in one order.
    """
    if stored.study is None or not stored.has_scenes:
        return [], np.empty(0, dtype=np.intp)
    scenes, scene_of_point = combinations(stored.study.scenes, "friction")
    if stored.selection is not None:
        scene_of_point = scene_of_point[stored.selection]
    _, first_points = np.unique(scene_of_point, return_index=True)
    order = scene_of_point[np.sort(first_points)]  # as the file has them
    frictions = [scenes[number].friction for number in order]
    by_edge = next((laws for laws in frictions if isinstance(laws, EdgeLaws)), None)
    if by_edge is not None:
        edges = [edge for edge, *_ in by_edge.laws]
        frictions = [_by_edge(friction, edges) for friction in frictions]
    return frictions, np.argsort(order)[scene_of_point]


def _by_edge(friction: Laws | EdgeLaws, edges: Sequence[str]) -> EdgeLaws:
    """Return a friction with a law and a strength for every edge; "" names those of all edges."""
    laws = {edge: (law, strength) for edge, law, strength in edge_laws(friction)}
    return EdgeLaws(tuple((edge, *(laws.get(edge) or laws[""])) for edge in edges))


def law_part(stored: Stored) -> Json | None:
    """Return the different laws of a study and their indices for every point, or None without any.

    A point has one law for every edge of `edges`; the edge "" stands for the whole contact line.
    """
    frictions, friction_of_point = frictions_of(stored)
    if not frictions:
        return None
    numbers = dict[Laws, int]()
    indices = []
    for friction in frictions:
        laws = [law for _, law, _ in edge_laws(friction)]
        indices.append([numbers.setdefault(law, len(numbers)) for law in laws])
    part: Json = {
        "laws": [drawn_law(law) for law in numbers],
        "index": [indices[number] for number in friction_of_point],
        "edges": [edge for edge, _, _ in edge_laws(frictions[0])],
    }
    assert stored.study is not None
    if stored.study.opens:
        for law, drawn in zip(numbers, part["laws"], strict=True):
            drawn |= {"vanishes": law.vanishes, "coefficient": knows_pressure(law)}
        part |= {"pressed": stored.study.knows_pressure, "openings": _opening_law_part(stored)}
    return part


@dataclass(frozen=True)
class NodeLaws:
    """Laws by edge at the m contact nodes: the index of each node's law, its strength (F, m)."""

    law: NDArray[np.intp]
    strength: NDArray[np.float64]

    @classmethod
    def along(cls, frictions: Sequence[EdgeLaws], line: LineFields) -> NodeLaws:
        """Return the laws of F frictions along a line; a mixture has MIXED_LAW and strength 1."""
        xy = np.stack([line.x, line.y], axis=1)
        by_friction = [
            laws.factors(line.edge_names, line.edge, xy, line.joints) for laws in frictions
        ]
        factors = np.stack(by_friction)  # NaN where a node has no part in the law of an edge
        has_law = ~np.isnan(factors[0])
        is_mixed = has_law.sum(axis=0) > 1
        law = np.where(is_mixed, MIXED_LAW, np.argmax(has_law, axis=0))
        return cls(law, np.where(is_mixed, 1.0, np.nanmax(factors, axis=1)))


def _laws_of_nodes(stored: Stored, line: LineFields, box: Container) -> Json:
    """Return with laws by edge: the law of every node, the different strengths along the line."""
    frictions, friction_of_point = frictions_of(stored)
    by_edge = [friction for friction in frictions if isinstance(friction, EdgeLaws)]
    if not by_edge:
        return {}
    nodes = NodeLaws.along(by_edge, line)
    rows, row_of_friction = np.unique(nodes.strength, axis=0, return_inverse=True)
    row_of_point = row_of_friction.ravel()[friction_of_point]
    return {
        "of_law": box.array(nodes.law, "i1"),
        "strengths": box.rows(rows),
        "strength_of": row_of_point.tolist(),
    }


def law_looks() -> Json:
    """Return the looks of laws in the pictures of `draw`: of curves, of jumps by their kind."""
    looks: Json = {"curve": page_look(CURVE)}
    for kind, label, look in JUMPS:
        looks[str(kind)] = page_look(look | {"label": label})
    return looks


def drawn_law(law: Laws) -> Json:
    """Return a law as its pieces, by which the page draws and solves."""
    pieces: dict[str, NDArray[Any]] = {"kinks": law.kinks, "kinds": law.kinds}
    pieces |= {"s0": law.s_0, "b0": law.b_0, "q": law.q, "a": law.a, "r": law.r}
    lists = {name: values.tolist() for name, values in pieces.items()}
    return {
        "name": law.name,
        "omega": law.omega,
        "reach": slip_range(law, DECAYS),
        "pieces": lists,
    }
