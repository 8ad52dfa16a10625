"""Data of the page of a run: numbers of all points, totals of histories, bodies, lines, laws.

The states of the nodes and the pieces of the laws are part of the data: the scripts have no rules
of their own and know no law by name. With the live data, of one level and of every point, the page
solves contact problems itself.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tcstudy.data.bodies import StoredBody
from tcstudy.data.files import kind_of
from tcstudy.data.reading import (
    GEOMETRIES,
    asked,
    axis_names,
    by_point,
    of_largest,
    open_results,
    sweep_dims,
    unmasked,
)
from tcstudy.data.schema import MISSING_COUNT, OVERRIDES, STICKS, PointStatus
from tcstudy.errors import StoreError
from tcstudy.laws.composed import EdgeLaws
from tcstudy.laws.laws import Laws
from tcstudy.reports.figures.body import boundary_edges, exaggeration
from tcstudy.reports.figures.point import slip_range
from tcstudy.reports.figures.sweep import has_equal_ratios
from tcstudy.reports.json_values import Json
from tcstudy.reports.page.parts import Container
from tcstudy.reports.picture import (
    LineFields,
    NamedEdge,
    at_rest,
    contact_line,
    edge_laws,
    ends_held,
    named_edges,
    nearest,
    sources,
    states_of,
)
from tcstudy.reports.rounding import Floors, floors, stored_study
from tcstudy.reports.select_point import numbers_of
from tcstudy.reports.sentences import several
from tcstudy.reports.text import LAMBDA_1_TOLERANCE, named, study_unit
from tcstudy.scene.points import combinations
from tcstudy.scene.study import Study

MAX_SOLUTIONS = 100_000
"""Points times levels on a page: no screen shows more, and no browser unpacks more at once."""
MAX_SCENES = 20_000
"""Points up to which their scenes are read, with their laws; of more the body alone is known."""


@dataclass(frozen=True)
class Stored:
    """One result file in memory.

    kind:   "run", "convergence", "cost", "path", "history" or "fit"
    data:   the root dataset
    groups: datasets of the level groups, by level;  live: datasets of the live data, by level
    study:  the study in the file, None if its text can no longer be read (a CAD file may be gone)
    swept:  whether the study has the scenes of all points
    homes:  the part of each geometry, None without a mesh; empty where all points share one
    kept:   indices of these points in the file, None for all;  points: number of points in the file
    own_floors: floors of one geometry, cut from those of the whole file
    """

    path: Path
    kind: str
    data: Any
    groups: dict[int, Any]
    live: dict[int, Any]
    study: Study | None
    homes: tuple[Stored | None, ...] = ()
    swept: bool = True
    kept: NDArray[np.intp] | None = None
    points: int = 0
    own_floors: Floors | None = None

    @cached_property
    def floors(self) -> Floors:
        """Sizes below which the numbers of a run's points are rounding; empty for other files."""
        if self.own_floors is not None:
            return self.own_floors
        return floors(self.data, self.study) if self.kind == "run" else Floors({})

    @property
    def words(self) -> str:
        """Sentence on the points that a page shows; empty where it shows all."""
        if self.kept is None:
            return ""
        return (
            f"shown are {len(self.kept)} of the {self.points} points, evenly taken from the sweep; "
            "the file has all"
        )


def read(path: Path, whole: bool = False) -> Stored:
    """Read a result file; of a long sweep at most MAX_SOLUTIONS, evenly taken, unless `whole`.

    Raises StoreError if it is no result file or not complete.
    """
    kind = kind_of(path)
    with open_results(path) as tree:
        root = tree.to_dataset().drop_vars(OVERRIDES.name, errors="ignore")
        is_cut = kind == "run" and "status" in root and not whole
        slices = _slices(root) if is_cut else {}
        data = of_largest(root.isel(slices).load())
        has_geometries = GEOMETRIES in data.attrs
        if kind == "run" and not {"status", "level"} <= set(data.variables):
            raise StoreError(
                f"{path} is no file of a command of tcstudy, so there is no page of it"
            )
        has_few_scenes = kind != "run" or root["status"].isel(level=0).size <= MAX_SCENES
        swept = has_geometries or has_few_scenes
        study = stored_study(data.attrs, swept)
        groups, live = _levels(tree, slices)
        stored = Stored(path, kind, data, groups, live, study, swept=swept)
        if slices:
            shape = [int(root.sizes[dim]) for dim in sweep_dims(root)]
            indices = np.arange(np.prod(shape)).reshape(shape)
            kept = indices[tuple(slices.values())].ravel()
            stored = replace(stored, kept=kept, points=indices.size)
    if has_geometries:
        stored = replace(stored, homes=_geometries(stored))
    return stored


def _slices(root: Any) -> dict[str, slice]:
    """Return slices of the sweep dimensions that keep at most MAX_SOLUTIONS; empty for all.

    Of several geometries all points are kept.
    """
    sizes = {dim: int(root.sizes[dim]) for dim in sweep_dims(root)}
    max_points = max(1, MAX_SOLUTIONS // int(root.sizes.get("level", 1)))
    if GEOMETRIES in root.attrs or np.prod(list(sizes.values())) <= max_points:
        return {}
    strides = dict.fromkeys(sizes, 1)
    while np.prod([-(-size // strides[dim]) for dim, size in sizes.items()]) > max_points:
        longest = max(sizes, key=lambda dim: sizes[dim] / strides[dim])
        strides[longest] += 1
    return {dim: slice(None, None, stride) for dim, stride in strides.items()}


def _levels(
    tree: Any, slices: dict[str, slice] | None = None
) -> tuple[dict[int, Any], dict[int, Any]]:
    """Return the groups of the levels of a run and of their live data, by level.

    Both are empty for a file of several geometries: each of them has its own levels.
    """

    def loaded(data: Any) -> Any:
        return data.isel(slices or {}, missing_dims="ignore").load()

    groups, live = dict[int, Any](), dict[int, Any]()
    level_count = 0 if GEOMETRIES in tree.attrs else tree.sizes.get("level", 0)
    for level in range(level_count):
        if f"level_{level}" not in tree.children:
            continue
        group = tree[f"level_{level}"]
        groups[level] = loaded(group.to_dataset(inherit=False))
        if "live" in group.children:
            live[level] = loaded(group["live"].to_dataset())
    return groups, live


def _geometries(whole: Stored) -> tuple[Stored | None, ...]:
    """Return the part of each geometry of a file, with its study and floors."""
    parts = list[Stored | None]()
    with unmasked(whole.path) as nc:
        for number, body in enumerate(StoredBody.every(nc)):
            if body is None:
                parts.append(None)
                continue
            groups = {level: body.dataset(level) for level in body.levels}
            study = None if whole.study is None else whole.study.variants[number].study
            sizes = body.level_table(LEVEL_NUMBERS)
            own_floors = whole.floors.of_points(body.places)
            parts.append(Stored(whole.path, "run", sizes, groups, {}, study, own_floors=own_floors))
    return tuple(parts)


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
LEVEL_NUMBERS = ("h_max", "n_dof", "n_contact", "time_mesh", "time_assemble")
MAX_NODES = 8_000
"""Mesh nodes up to which a level is drawn; finer ones would cost room that no screen shows."""
DECAYS = 6.0
"""Decay lengths of a law that are drawn."""
ALONG = {"u_T": "u_T", "xi": "xi", "N": "section_force"}
"""Variables along the contact line, by their names on the page."""

# -- points ----------------------------------------------------------------------------------------


def run_part(stored: Stored, box: Container) -> Json:
    """Return axes, numbers and flags of all points in C order; of a history its totals."""
    data = totals(stored.data) if stored.kind == "history" else stored.data
    dims = sweep_dims(stored.data)

    def flat(name: str) -> Any:
        return by_point(data[name], data)

    has_starts = "start_energy" in data
    flags = {name: flat(name) for name in FLAGS if name in data}
    if has_starts:
        flags["several"] = several(flat("start_energy"), flags["unique"] == 1)
    reason_texts, reason = np.unique(flat("reason").astype(str), return_inverse=True)
    numbers = _numbers(stored, data)
    return {
        "mode": str(data.attrs["sweep_mode"]),
        "dims": dims,
        "shape": [int(data.sizes[dim]) for dim in dims],
        "axes": axes(data),
        "units": {name: str(data[name].attrs["units"]) for name in LEVEL_NUMBERS if name in data},
        "levels": level_numbers(data),
        "numbers": _number_parts(data, numbers, box),
        "asked": [name for name in asked(data) if name in numbers],
        "flags": {name: box.array(values, "i1") for name, values in flags.items()},
        "statuses": [named(status) for status in PointStatus],
        "reasons": reason_texts.tolist(),
        "reason": box.array(reason.reshape(flat("reason").shape), "u2"),
        "starts": [str(start) for start in data["start"].values] if has_starts else [],
        "start_energy": box.array(flat("start_energy")) if has_starts else None,
    }


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
    first = [name for name in ("u_T_max", *asked(data)) if name in numbers]
    others = [name for name in numbers if name not in first]
    others.sort(key=lambda name: name.startswith(DIAGNOSTIC))
    return {name: numbers[name] for name in (*first, *others)}


def _number_parts(data: Any, numbers: dict[str, Any], box: Container) -> Json:
    size = data["status"].size * len(numbers) * 8
    kind = "f8" if size <= MAX_DOUBLE_BYTES else "f4"
    parts = {}
    for name, values in numbers.items():
        attrs = data[name].attrs
        words = f"{attrs.get('long_name', '')}: {attrs.get('comment', '')}"
        parts[name] = {
            "long_name": words.rstrip(": "),
            "units": str(attrs["units"]),
            "v": box.array(values, "f8" if name == "energy" else kind),
        }
    return parts


def _without_missing(values: Any) -> Any:
    """Return numbers with NaN in place of missing counts."""
    if values.dtype.kind != "i":
        return values
    return np.where(values == MISSING_COUNT, np.nan, values)


def totals(data: Any) -> Any:
    """Return a history as a run of one level: sums over its solved steps, flags of all steps."""
    solved = data["status"] == int(PointStatus.OK)
    run = data[list(SUMS)].where(solved).sum("step", min_count=1, keep_attrs=True)
    run["u_T_max"] = data["u_T_max"].where(solved).max("step", keep_attrs=True)
    run["steps"] = (solved.sum("step") - 1.0).assign_attrs(long_name="steps solved", units="1")
    flags = data[[name for name in FLAGS if name in data and name != "status"]]
    # nothing is proved of step 0, the unloaded state
    judged = flags.where(solved, 1).isel(step=slice(1, None))
    weakest = judged.min("step", keep_attrs=True).astype("i1")
    run = run.assign(weakest.data_vars).assign(reason=data["reason"])
    is_whole = solved.all("step")
    run["status"] = is_whole.astype("i1") + int(PointStatus.NOT_CONVERGED) * ~is_whole
    sizes = {name: data[name].expand_dims("level") for name in LEVEL_NUMBERS if name in data}
    return run.expand_dims(level=1, axis=-1).assign(sizes).assign_attrs(data.attrs)


def level_numbers(data: Any) -> Json:
    """Return sizes and times of the levels."""
    return {name: data[name].values.tolist() for name in LEVEL_NUMBERS if name in data}


def time_of_levels(geometries: Sequence[Any]) -> Json:
    """Return the times of the levels, summed over all geometries."""
    times = {}
    for name in LEVEL_NUMBERS:
        if name.startswith("time") and all(name in data for data in geometries):
            values = [data[name].values for data in geometries]
            times[name] = np.nansum(values, axis=0).tolist()
    return times


def axes(data: Any) -> list[Json]:
    """Return the swept parameters: name, units, values, and the dimension of each."""
    swept = []
    for name in axis_names(data):
        values, attrs = data[name].values, data[name].attrs
        is_numeric = values.dtype.kind not in "OUS"
        is_drawn = "distribution" in attrs
        axis: Json = {
            "name": name,
            "units": str(attrs.get("units", "1")),
            "numeric": is_numeric,
            "values": values.tolist(),
            "dim": str(data[name].dims[0]),
            "written": study_unit(attrs),
            "drawn": is_drawn,
            "log": is_numeric and not is_drawn and has_equal_ratios(values),
        }
        swept.append(axis)
    return swept


# -- bodies and contact lines ----------------------------------------------------------------------


def shape(stored: Stored) -> Json:
    """Return the edges of the body with their roles, and its heated regions."""
    return {
        "outline": [{**vars(edge), "line": edge.line.tolist()} for edge in _edges(stored)],
        "sources": [line.tolist() for line in sources(stored.study)],
    }


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
    x, y, triangles = (group[name].values for name in ("node_x", "node_y", "triangle"))
    xy = np.column_stack([x, y])
    fields = {}
    for name in ("u_x", "u_y", "theta"):
        if name in group:
            values = by_point(group[name], stored.data)
            fields[name] = np.where(np.isfinite(values), values, 0.0)
    if "theta" in fields:
        fields["theta"] = stored.floors.cleared("theta", fields["theta"], level)
    edges = boundary_edges(xy, triangles.astype(np.intp))
    return {
        "level": level,
        "x": box.array(x, "f4"),
        "y": box.array(y, "f4"),
        "triangle": box.array(triangles, "u2" if len(x) < 65536 else "i4"),
        "boundary": box.array(edges, "i4"),
        "edge": box.array(nearest(xy[edges], _edges(stored)), "i1"),
        "factor": exaggeration(xy, np.stack([fields["u_x"], fields["u_y"]], axis=-1)),
        "theta": None,
        "theta_units": str(group["theta"].attrs["units"]) if "theta" in group else "1",
        **{name: box.fields(values) for name, values in fields.items()},
    }


def line_part(stored: Stored, level: int, box: Container) -> Json:
    """Return the contact line of a level with u_T, ξ and states of all points, in C order."""
    group = stored.groups[level]
    u_T, sticks = (by_point(group[name], stored.data) for name in ("u_T", "sticks"))

    def rows(variable: Any) -> Any:
        values = by_point(variable, stored.data)
        return stored.floors.cleared(str(variable.name), values, level)

    line = line_along(group, rows, box)
    line |= _laws_of_nodes(stored, contact_line(group), box)
    line["rest"] = at_rest(stored.study)
    states = _states(stored, group, u_T, slice(None), sticks == STICKS)
    line["state"] = box.array(states, "i1")
    if "held_u_T" in group:
        line["held_u_T"] = box.rows(by_point(group["held_u_T"], stored.data))
    if "solution_u_T" in group and stored.kept is None:
        line["every"] = _equilibria(stored, level, box)
    return line


def _equilibria(stored: Stored, level: int, box: Container) -> Json:
    """Return all stored equilibria, point by point, by energy."""
    group = stored.groups[level]
    point, u_T, xi = (group[f"solution_{name}"].values for name in ("point", "u_T", "xi"))
    point_count = stored.data["status"][..., -1].size
    states = _states(stored, group, u_T, point, np.zeros(u_T.shape, dtype=bool))
    return {
        "first": box.array(np.searchsorted(point, np.arange(point_count + 1)), "i4"),
        "energy": box.array(group["solution_energy"].values),
        "stable": box.array(group["solution_stable"].values, "i1"),
        "u_T": box.rows(stored.floors.cleared("u_T", u_T, level, point)),
        "xi": box.rows(stored.floors.cleared("xi", xi, level, point)),
        "state": box.array(states, "i1"),
    }


def line_along(data: Any, rows: Callable[[Any], Any], box: Container) -> Json:
    """Return a contact line with the variables along it and their units.

    `rows` returns the (P, m) values of a variable. In a part, `held` tells for both ends whether a
    constrained node is there, and `ends` its index in `held_u_T` (-1 for none).
    """
    line = contact_line(data)
    page_line: Json = {
        name: box.array(getattr(line, name)) for name in ("arclength", "x", "y", "c")
    }
    page_line["edges"] = list(line.edge_names)
    page_line["parts"] = []
    for part, ends in zip(line.parts, ends_held(line, data), strict=True):
        page_part = {
            "a": part.start,
            "b": part.stop,
            "cells": box.array(line.cells(part)),
            "closed": line.closed(part),
            "held": list(line.held(part)),
            "ends": ends,
        }
        page_line["parts"].append(page_part)
    for name, key in ALONG.items():
        if key in data:
            page_line[name] = box.rows(rows(data[key]))
            page_line[f"{name}_units"] = str(data[key].attrs["units"])
    return page_line


def _states(stored: Stored, group: Any, u_T: Any, points: Any, sticks: Any) -> Any:
    """Return (R, m) the ContactState of every node of solutions of points, −1 without solution."""
    solved = np.isfinite(u_T).all(axis=1)
    states = states_of(None, group, u_T, sticks)
    frictions, friction_of_point = frictions_of(stored)
    for number, friction in enumerate(frictions):
        rows = np.flatnonzero(solved & (friction_of_point[points] == number))
        states[rows] = states_of(friction, group, u_T[rows], sticks[rows])
    states[~solved] = -1
    return states


def live_part(stored: Stored, box: Container) -> Json | None:
    """Return the finest level with live data, or None without a valid point.

    A: the lower triangle of the symmetric A_tilde by rows;  proved: λ₁ less its error, which ω must
    not reach.
    """
    levels = []
    for level, data in stored.live.items():
        if "load" in data and np.any(data["valid"].values == 1.0):
            levels.append(level)
    if not levels or stored.study is None:
        return None
    level, run = max(levels), stored.data
    lambda_1 = by_point(run["lambda_1"], run)[:, level]
    error = by_point(run["lambda_1_error"], run)[:, level]
    data = stored.live[level]
    A_tilde = data["A_tilde"].values
    names = ("stiffness", "valid", "load", "mechanical_load")
    return {
        "level": level,
        "A": box.array(A_tilde[np.tril_indices(len(A_tilde))]),
        "c": box.array(stored.groups[level]["c"].values),
        "lambda_1": box.array(lambda_1),
        "proved": box.array(lambda_1 * (1.0 - np.maximum(error, LAMBDA_1_TOLERANCE))),
        **{name: box.array(by_point(data[name], run)) for name in names},
    }


# -- laws ------------------------------------------------------------------------------------------


def frictions_of(stored: Stored) -> tuple[list[Laws | EdgeLaws], NDArray[np.intp]]:
    """Return the different frictions of a study, and the index among them of every kept point.

    If one friction has a law for every edge, all are given so, with the edges in one order.
    """
    if stored.study is None or not stored.swept:
        return [], np.empty(0, dtype=np.intp)
    scenes, scene_of_point = combinations(stored.study.scenes, "friction")
    if stored.kept is not None:
        scene_of_point = scene_of_point[stored.kept]
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
    return {
        "laws": [drawn_law(law) for law in numbers],
        "index": [indices[number] for number in friction_of_point],
        "edges": [edge for edge, _, _ in edge_laws(frictions[0])],
    }


def _laws_of_nodes(stored: Stored, line: LineFields, box: Container) -> Json:
    """Return with laws by edge: the law of every node, the different strengths along the line.

    A node shared by two edges has a mixture of laws, which is not drawn: its law is -1.
    """
    frictions, friction_of_point = frictions_of(stored)
    by_edge = [friction for friction in frictions if isinstance(friction, EdgeLaws)]
    if not by_edge:
        return {}
    xy = np.stack([line.x, line.y], axis=1)
    factors = np.stack(
        [laws.factors(line.edge_names, line.edge, xy, line.joints) for laws in by_edge]
    )
    has_law = ~np.isnan(factors[0])
    is_mixed = has_law.sum(axis=0) > 1
    strengths = np.where(is_mixed, 1.0, np.nanmax(factors, axis=1))
    rows, row_of_friction = np.unique(strengths, axis=0, return_inverse=True)
    law_of_node = np.where(is_mixed, -1, np.argmax(has_law, axis=0))
    return {
        "of_law": box.array(law_of_node, "i1"),
        "strengths": box.rows(rows),
        "strength_of": row_of_friction.ravel()[friction_of_point].tolist(),
    }


def drawn_law(law: Laws) -> Json:
    """Return a law as its pieces, by which the page draws and solves."""
    pieces: dict[str, NDArray[Any]] = {
        "kinks": law.kinks,
        "kinds": law.kinds,
        "s0": law.s_0,
        "b0": law.b_0,
        "q": law.q,
        "a": law.a,
        "r": law.r,
    }
    return {
        "name": law.name,
        "omega": law.omega,
        "reach": slip_range(law, DECAYS),
        "pieces": {name: values.tolist() for name, values in pieces.items()},
    }
