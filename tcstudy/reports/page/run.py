"""What the page has of a run: numbers of every point, and of a history its totals; bodies, contact
lines and laws.

What a node does and the pieces of a law stand in the data: the scripts have no rules of their own
and know no law by name. Live data are what the page needs to solve contact problems by itself:
those of one level, and every point's.
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

MOST_SOLUTIONS = 100_000
"""Points times levels that a page holds: more marks no screen shows, and more numbers no browser
unpacks at once."""
MOST_SCENES = 20_000
"""Points up to which their scenes are read, with their laws; of more the body alone is known."""


@dataclass(frozen=True)
class Stored:
    """One result file in memory.

    kind:   "run", "convergence", "cost", "path", "history" or "fit"
    data:   the root dataset
    groups: datasets of the level groups by number; those of live data by number
    study:  the study in the file, None if its text can no longer be read (a body's own file may be gone)
    swept:  whether it has the scenes of all points
    homes:  what each geometry has of its own, None for one without a mesh; empty where all points share one
    kept:   which points of the file these are, in its order, None for all;  points: how many the file has
    own_floors: of a geometry its part of the floors of the whole file
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
        """Sizes below which the numbers of a run's points are rounding; none of other files."""
        if self.own_floors is not None:
            return self.own_floors
        return floors(self.data, self.study) if self.kind == "run" else Floors({})

    @property
    def words(self) -> str:
        """Which points a page of it shows; empty where it is all."""
        if self.kept is None:
            return ""
        return f"shown are {len(self.kept)} of the {self.points} points, evenly taken from the sweep; the file has all"


def read(path: Path, whole: bool = False) -> Stored:
    """What is in a result file; of a long sweep no more than MOST_SOLUTIONS, evenly taken, unless
    the whole is wanted.

    Raises StoreError if it is none or not complete.
    """
    kind = kind_of(path)
    with open_results(path) as tree:
        root = tree.to_dataset().drop_vars(OVERRIDES.name, errors="ignore")
        steps = _steps(root) if kind == "run" and "status" in root and not whole else {}
        data = of_largest(root.isel(steps).load())
        if kind == "run" and not {"status", "level"} <= set(data.variables):
            raise StoreError(
                f"{path} is no file of a command of tcstudy, so there is no page of it"
            )
        swept = (
            kind != "run"
            or GEOMETRIES in data.attrs
            or root["status"].isel(level=0).size <= MOST_SCENES
        )
        study = stored_study(data.attrs, swept)
        groups, live = _levels(tree, steps)
        found = Stored(path, kind, data, groups, live, study, swept=swept)
        if steps:
            shape = [int(root.sizes[dim]) for dim in sweep_dims(root)]
            numbers = np.arange(np.prod(shape)).reshape(shape)
            found = replace(found, kept=numbers[tuple(steps.values())].ravel(), points=numbers.size)
    if GEOMETRIES in data.attrs:
        found = replace(found, homes=_homes(found))
    return found


def _steps(root: Any) -> dict[str, slice]:
    """By sweep dimension every how many-th place is kept, so that no more than MOST_SOLUTIONS are;
    empty for all.

    Of several geometries all are.
    """
    sizes = {dim: int(root.sizes[dim]) for dim in sweep_dims(root)}
    most, every = max(1, MOST_SOLUTIONS // int(root.sizes.get("level", 1))), dict.fromkeys(sizes, 1)
    if GEOMETRIES in root.attrs or np.prod(list(sizes.values())) <= most:
        return {}
    while np.prod([-(-n // every[dim]) for dim, n in sizes.items()]) > most:
        every[max(sizes, key=lambda dim: sizes[dim] / every[dim])] += 1
    return {dim: slice(None, None, step) for dim, step in every.items()}


def _levels(
    tree: Any, steps: dict[str, slice] | None = None
) -> tuple[dict[int, Any], dict[int, Any]]:
    """The groups of the levels of a run, and of their live data; none of several geometries, of
    which each has its own."""
    numbers = range(0 if GEOMETRIES in tree.attrs else tree.sizes.get("level", 0))
    levels = {n: tree[f"level_{n}"] for n in numbers if f"level_{n}" in tree.children}

    def kept(data: Any) -> Any:
        return data.isel(steps or {}, missing_dims="ignore").load()

    groups = {n: kept(group.to_dataset(inherit=False)) for n, group in levels.items()}
    live = {
        n: kept(group["live"].to_dataset())
        for n, group in levels.items()
        if "live" in group.children
    }
    return groups, live


def _homes(whole: Stored) -> tuple[Stored | None, ...]:
    """Return what each geometry of a file has of its own, with its study of those of all."""
    homes, path, study = list[Stored | None](), whole.path, whole.study
    with unmasked(path) as nc:
        for number, body in enumerate(StoredBody.every(nc)):
            if body is None:
                homes.append(None)
                continue
            groups = {level: body.dataset(level) for level in body.levels}
            own = None if study is None else study.variants[number].study
            table, sizes = body.level_table(LEVEL_NUMBERS), whole.floors.of_points(body.places)
            homes.append(Stored(path, "run", table, groups, {}, own, own_floors=sizes))
    return tuple(homes)


ROOM_FOR_DOUBLES = 300_000
"""Bytes of numbers up to which the page has all digits; beyond it has seven (the energy always has
all)."""
DIAGNOSTIC = ("inclusion_", "iterations", "evaluations", "heat_balance", "time_", "lambda_1_error")
"""How numbers begin that stand after the others."""
SUMS = ("dissipated", "released", "work", "jumps")
"""Numbers of which a point of a history has the sum over its steps."""
FLAGS = (
    "status",
    "unique",
    "strict_minimum",
    "global_minimum",
    "heat_status",
    "start_used",
    "complete",
)
LEVEL_NUMBERS = ("h_max", "n_dof", "n_contact", "time_mesh", "time_assemble")
MOST_NODES = 8_000
"""Mesh nodes up to which a level is drawn; finer ones would cost room that no screen shows."""
DECAYS = 6.0
"""How many decay lengths of a law are drawn."""
ALONG = {"u_T": "u_T", "xi": "xi", "N": "section_force"}
"""What runs along the contact line: its names on the page and in the file."""

# -- points
# ------------------------------------------------------------------------------------------------------------


def run_part(stored: Stored, box: Container) -> Json:
    """Axes, numbers and flags, with points flattened in C order of the sweep; of a history its
    totals."""
    data, dims = (
        totals(stored.data) if stored.kind == "history" else stored.data,
        sweep_dims(stored.data),
    )

    def flat(name: str) -> Any:
        return by_point(data[name], data)

    shown = [name for name in numbers_of(data) if name != "inclusion_rounding"]
    held = {name: _without_missing(flat(name)) for name in shown}
    for name, values in held.items():
        by_level = [stored.floors.cleared(name, own, n) for n, own in enumerate(values.T)]
        held[name] = np.stack(by_level, axis=1)
    held = {name: values for name, values in held.items() if not np.isnan(values).all()}
    first = [name for name in ("u_T_max", *asked(data)) if name in held]
    rest = sorted(
        (name for name in held if name not in first), key=lambda name: name.startswith(DIAGNOSTIC)
    )
    kind = "f8" if data["status"].size * len(held) * 8 <= ROOM_FOR_DOUBLES else "f4"
    flags, starts = {name: flat(name) for name in FLAGS if name in data}, "start_energy" in data
    flags |= {"several": several(flat("start_energy"), flags["unique"] == 1)} if starts else {}
    texts, reason = np.unique(flat("reason").astype(str), return_inverse=True)
    return {
        "mode": str(data.attrs["sweep_mode"]),
        "dims": dims,
        "shape": [int(data.sizes[d]) for d in dims],
        "axes": axes(data),
        "units": {name: str(data[name].attrs["units"]) for name in LEVEL_NUMBERS if name in data},
        "levels": level_numbers(data),
        "numbers": {
            name: {
                "long_name": ": ".join(
                    data[name].attrs.get(key, "") for key in ("long_name", "comment")
                ).rstrip(": "),
                "units": str(data[name].attrs["units"]),
                "v": box.array(held[name], "f8" if name == "energy" else kind),
            }
            for name in (*first, *rest)
        },
        "asked": [name for name in asked(data) if name in first],
        "flags": {name: box.array(values, "i1") for name, values in flags.items()},
        "statuses": [named(status) for status in PointStatus],
        "reasons": texts.tolist(),
        "reason": box.array(reason.reshape(flat("reason").shape), "u2"),
        "starts": [str(one) for one in data["start"].values] if starts else [],
        "start_energy": box.array(flat("start_energy")) if starts else None,
    }


def _without_missing(values: Any) -> Any:
    """Return numbers with NaN in place of the count that stands for none."""
    if values.dtype.kind != "i":
        return values
    return np.where(values == MISSING_COUNT, np.nan, values)


def totals(data: Any) -> Any:
    """A history as a run of one level: sums over its solved steps, and what holds in all of
    them."""
    solved = data["status"] == int(PointStatus.OK)
    numbers = data[list(SUMS)].where(solved).sum("step", min_count=1, keep_attrs=True)
    numbers["u_T_max"] = data["u_T_max"].where(solved).max("step", keep_attrs=True)
    numbers["steps"] = (solved.sum("step") - 1.0).assign_attrs(long_name="steps solved", units="1")
    flags = data[[name for name in FLAGS if name in data and name != "status"]]
    judged = flags.where(solved, 1).isel(
        step=slice(1, None)
    )  # nothing is proved of step 0, from which all go on
    found = numbers.assign(judged.min("step", keep_attrs=True).astype("i1").data_vars).assign(
        reason=data["reason"]
    )
    found["status"] = solved.all("step").astype("i1") + int(
        PointStatus.NOT_CONVERGED
    ) * ~solved.all("step")
    sizes = {name: data[name].expand_dims("level") for name in LEVEL_NUMBERS if name in data}
    return found.expand_dims(level=1, axis=-1).assign(sizes).assign_attrs(data.attrs)


def level_numbers(data: Any) -> Json:
    """Sizes and times of the levels."""
    return {name: data[name].values.tolist() for name in LEVEL_NUMBERS if name in data}


def time_of_levels(geometries: Sequence[Any]) -> Json:
    """The times of the levels of all geometries together."""
    names = [
        name
        for name in LEVEL_NUMBERS
        if name.startswith("time") and all(name in data for data in geometries)
    ]
    return {
        name: np.nansum([data[name].values for data in geometries], axis=0).tolist()
        for name in names
    }


def axes(data: Any) -> list[Json]:
    """Swept parameters: name, units, labels, and the dimension each lies along."""
    found = []
    for name in axis_names(data):
        values, attrs = data[name].values, data[name].attrs
        about: Json = {"name": name, "units": str(attrs.get("units", "1"))}
        about |= {
            "numeric": values.dtype.kind not in "OUS",
            "values": values.tolist(),
            "dim": str(data[name].dims[0]),
        }
        about |= {"written": study_unit(attrs), "drawn": "distribution" in attrs}
        about["log"] = about["numeric"] and not about["drawn"] and has_equal_ratios(values)
        found.append(about)
    return found


# -- bodies and contact lines
# ------------------------------------------------------------------------------------------


def shape(stored: Stored) -> Json:
    """Edges of the body with their roles, and its heated regions."""
    return {
        "outline": [{**vars(edge), "line": edge.line.tolist()} for edge in _edges(stored)],
        "sources": [line.tolist() for line in sources(stored.study)],
    }


def _edges(stored: Stored) -> list[NamedEdge]:
    """Return the named edges of the body, of one from a CAD file as the drawn level has them."""
    level = drawn_level(stored)
    if level is None:
        level = min(stored.groups, default=None)
    return named_edges(stored.study, {} if level is None else stored.groups[level])


def drawn_level(stored: Stored) -> int | None:
    """The finest level with stored fields that is not too fine to draw; else the coarsest with
    fields."""
    having = [n for n, group in stored.groups.items() if "u_x" in group and "node_x" in group]
    fitting = [n for n in having if stored.groups[n].sizes["mesh_node"] <= MOST_NODES]
    return max(fitting) if fitting else min(having, default=None)


def body_part(stored: Stored, level: int, box: Container) -> Json:
    """Mesh, boundary with roles, and fields of all points as few modes (drawn to 0.1 % of their
    range)."""
    group = stored.groups[level]
    x, y, triangles = (group[name].values for name in ("node_x", "node_y", "triangle"))
    xy, named = np.column_stack([x, y]), _edges(stored)
    fields = {
        name: by_point(group[name], stored.data)
        for name in ("u_x", "u_y", "theta")
        if name in group
    }
    fields = {name: np.where(np.isfinite(values), values, 0.0) for name, values in fields.items()}
    if "theta" in fields:
        fields["theta"] = stored.floors.cleared("theta", fields["theta"], level)
    edges = boundary_edges(xy, triangles.astype(np.intp))
    return {
        "level": level,
        "x": box.array(x, "f4"),
        "y": box.array(y, "f4"),
        "triangle": box.array(triangles, "u2" if len(x) < 65536 else "i4"),
        "boundary": box.array(edges, "i4"),
        "edge": box.array(nearest(xy[edges], named), "i1"),
        "factor": exaggeration(xy, np.stack([fields["u_x"], fields["u_y"]], axis=-1)),
        "theta": None,
        "theta_units": str(group["theta"].attrs["units"]) if "theta" in group else "1",
        **{name: box.fields(values) for name, values in fields.items()},
    }


def line_part(stored: Stored, level: int, box: Container) -> Json:
    """One level's contact line with u_T, ξ and states of all points, flattened in C order of the
    sweep."""
    group = stored.groups[level]
    u_T, sticks = (by_point(group[name], stored.data) for name in ("u_T", "sticks"))

    def shown(values: Any) -> Any:
        return stored.floors.cleared(str(values.name), by_point(values, stored.data), level)

    found = line_along(group, shown, box)
    found |= _nodes(stored, contact_line(group), box) | {"rest": at_rest(stored.study)}
    found["state"] = box.array(_states(stored, group, u_T, slice(None), sticks == STICKS), "i1")
    if "held_u_T" in group:
        found["held_u_T"] = box.rows(by_point(group["held_u_T"], stored.data))
    if (
        "solution_u_T" in group and stored.kept is None
    ):  # of a point one after the other, lowest first
        point, u_T, xi = (group[f"solution_{name}"].values for name in ("point", "u_T", "xi"))
        first = np.searchsorted(point, np.arange(stored.data["status"][..., -1].size + 1))
        found["every"] = {
            "first": box.array(first, "i4"),
            "energy": box.array(group["solution_energy"].values),
            "stable": box.array(group["solution_stable"].values, "i1"),
            "u_T": box.rows(stored.floors.cleared("u_T", u_T, level, point)),
            "xi": box.rows(stored.floors.cleared("xi", xi, level, point)),
            "state": box.array(
                _states(stored, group, u_T, point, np.zeros(u_T.shape, dtype=bool)), "i1"
            ),
        }
    return found


def line_along(data: Any, rows: Callable[[Any], Any], box: Container) -> Json:
    """A contact line with what runs along it and its units; rows: makes (P, m) values of a
    variable.

    `held` says whether a part ends at a node without unknown, `ends` which of `held_u_T` is its
    slip (-1 for none).
    """
    line = contact_line(data)
    found: Json = {name: box.array(getattr(line, name)) for name in ("arclength", "x", "y", "c")}
    found["edges"] = list(line.edge_names)
    found["parts"] = [
        {"a": part.start, "b": part.stop, "cells": box.array(line.cells(part)), "closed": line.closed(part),
         "held": list(line.held(part)), "ends": ends}
        for part, ends in zip(line.parts, ends_held(line, data), strict=True)
    ]  # fmt: skip
    for name, key in ALONG.items():
        if key in data:
            found |= {
                name: box.rows(rows(data[key])),
                f"{name}_units": str(data[key].attrs["units"]),
            }
    return found


def _states(stored: Stored, group: Any, u_T: Any, points: Any, sticks: Any) -> Any:
    """(R, m) ContactState of every node of solutions of these points, −1 where there is none."""
    states, solved = states_of(None, group, u_T, sticks), np.isfinite(u_T).all(axis=1)
    frictions, of = frictions_of(stored)
    for k, friction in enumerate(frictions):
        rows = np.flatnonzero(solved & (of[points] == k))
        states[rows] = states_of(friction, group, u_T[rows], sticks[rows])
    states[~solved] = -1
    return states


def live_part(stored: Stored, box: Container) -> Json | None:
    """The finest level that has live data; None where no point is valid or the run kept none.

    A_tilde is symmetric: its lower triangle by rows. proved: λ₁ less its error, which ω is to be
    below.
    """
    usable = [
        n
        for n, data in stored.live.items()
        if "load" in data and np.any(data["valid"].values == 1.0)
    ]
    if not usable or stored.study is None:
        return None
    level, run = max(usable), stored.data
    lambda_1, error = (
        by_point(run[name], run)[:, level] for name in ("lambda_1", "lambda_1_error")
    )
    data, A_tilde = stored.live[level], stored.live[level]["A_tilde"].values
    names = ("stiffness", "valid", "load", "mechanical_load")
    return {
        "level": level,
        "A": box.array(A_tilde[np.tril_indices(len(A_tilde))]),
        "c": box.array(stored.groups[level]["c"].values),
        "lambda_1": box.array(lambda_1),
        "proved": box.array(lambda_1 * (1.0 - np.maximum(error, LAMBDA_1_TOLERANCE))),
        **{name: box.array(by_point(data[name], run)) for name in names},
    }


# -- laws
# --------------------------------------------------------------------------------------------------------------


def frictions_of(stored: Stored) -> tuple[list[Laws | EdgeLaws], NDArray[np.intp]]:
    """The different frictions of a study, and which of them every point of its file has that is
    kept.

    Where one has a law of every edge all have, in one order.
    """
    if stored.study is None or not stored.swept:
        return [], np.empty(0, dtype=np.intp)
    some, of = combinations(stored.study.scenes, "friction")
    of = of if stored.kept is None else of[stored.kept]
    _, first = np.unique(of, return_index=True)
    order = of[np.sort(first)]  # as the file has them
    found = [some[k].friction for k in order]
    if names := next(
        ([edge for edge, *_ in one.laws] for one in found if isinstance(one, EdgeLaws)), None
    ):
        each = [{edge: (law, strength) for edge, law, strength in edge_laws(one)} for one in found]
        found = [
            EdgeLaws(tuple((name, *(own.get(name) or own[""])) for name in names)) for own in each
        ]
    return found, np.argsort(order)[of]


def law_part(stored: Stored) -> Json | None:
    """The different laws of a study and which one every point has; None if the study does not say.

    A point has a law of every edge, in the order of `edges`, of "" where friction is the same along
    the line.
    """
    frictions, of = frictions_of(stored)
    if not frictions:
        return None
    numbers, laws_of = dict[Laws, int](), [edge_laws(friction) for friction in frictions]
    index = [[numbers.setdefault(law, len(numbers)) for _, law, _ in laws] for laws in laws_of]
    edges = [edge for edge, _, _ in laws_of[0]]
    return {
        "laws": [drawn_law(law) for law in numbers],
        "index": [index[k] for k in of],
        "edges": edges,
    }


def _nodes(stored: Stored, line: LineFields, box: Container) -> Json:
    """By edge: which of the edges' laws a node has, the different strengths along the line and
    which a point has.

    A joint has none of them (-1), but a mixture, which is not drawn.
    """
    frictions, of = frictions_of(stored)
    xy, by_edge = (
        np.stack([line.x, line.y], axis=1),
        [one for one in frictions if isinstance(one, EdgeLaws)],
    )
    if not by_edge:
        return {}
    factors = np.stack(
        [one.factors(line.edge_names, line.edge, xy, line.joints) for one in by_edge]
    )
    has = ~np.isnan(factors[0])
    mixed = has.sum(axis=0) > 1
    rows, which = np.unique(
        np.where(mixed, 1.0, np.nanmax(factors, axis=1)), axis=0, return_inverse=True
    )
    of_law = np.where(mixed, -1, np.argmax(has, axis=0))
    return {
        "of_law": box.array(of_law, "i1"),
        "strengths": box.rows(rows),
        "strength_of": which.ravel()[of].tolist(),
    }


def drawn_law(law: Laws) -> Json:
    """A law as the pieces that it is made of, which the page draws and by which it solves."""
    numbers = (law.kinks, law.kinds, law.s_0, law.b_0, law.q, law.a, law.r)
    pieces = dict(
        zip(
            ("kinks", "kinds", "s0", "b0", "q", "a", "r"),
            (one.tolist() for one in numbers),
            strict=True,
        )
    )
    return {
        "name": law.name,
        "omega": law.omega,
        "reach": slip_range(law, DECAYS),
        "pieces": pieces,
    }
