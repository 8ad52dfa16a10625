"""What the page has of points: the body with its fields, the contact line with slip and traction, live data.

Live data are what the page needs to solve contact problems by itself: those of one level, and every point's numbers.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from tcstudy.data.reading import by_point
from tcstudy.data.schema import STICKS
from tcstudy.reports.figures.body import boundary_edges, exaggeration
from tcstudy.reports.page.container import Container, Json
from tcstudy.reports.page.law_part import frictions_of, node_part
from tcstudy.reports.page.stored import Stored
from tcstudy.reports.picture import contact_line, ends_held
from tcstudy.reports.stored_study import at_rest, law_of_nodes, nearest, outline, sources
from tcstudy.reports.text import DIGITS
from tcstudy.scene.histories import ContactState, node_states
from tcstudy.scene.study import Study

MOST_NODES = 8_000
"""Mesh nodes up to which a level is drawn; finer ones would cost room that no screen shows."""


def drawn_level(stored: Stored) -> int | None:
    """The finest level with stored fields that is not too fine to draw; else the coarsest with fields."""
    having = [n for n, group in stored.groups.items() if "u_x" in group and "node_x" in group]
    fitting = [n for n in having if stored.groups[n].sizes["mesh_node"] <= MOST_NODES]
    return max(fitting) if fitting else min(having, default=None)


def body_part(stored: Stored, level: int, box: Container) -> Json:
    """Mesh, boundary with roles, and fields of all points as few modes (drawn to 0.1 % of their range)."""
    group = stored.groups[level]
    x, y, triangles = (group[name].values for name in ("node_x", "node_y", "triangle"))

    xy, named = np.column_stack([x, y]), outline(stored.study)
    fields = {name: by_point(group[name], stored.data) for name in ("u_x", "u_y", "theta") if name in group}
    fields = {name: np.where(np.isfinite(values), values, 0.0) for name, values in fields.items()}
    edges = boundary_edges(xy, triangles.astype(np.intp))
    return {
        "level": level,
        "x": box.array(x, "f4"),
        "y": box.array(y, "f4"),
        "triangle": box.array(triangles, "u2" if len(x) < 65536 else "i4"),
        "boundary": box.array(edges, "i4"),
        "edge": box.array(nearest(xy[edges].mean(axis=1), named), "i1"),
        "factor": exaggeration(xy, np.stack([fields["u_x"], fields["u_y"]], axis=-1)),
        "theta": None,
        "theta_units": str(group["theta"].attrs["units"]) if "theta" in group else "1",
        **{name: box.fields(values) for name, values in fields.items()},
    }


def line_part(stored: Stored, level: int, box: Container) -> Json:
    """One level's contact line with u_T, ξ and states of all points, flattened in C order of the sweep."""
    group = stored.groups[level]
    u_T = by_point(group["u_T"], stored.data)
    held = {"held_u_T": box.rows(by_point(group["held_u_T"], stored.data))} if "held_u_T" in group else {}
    return {
        **geometry(group, box),
        **node_part(stored, contact_line(group), box),
        **along(group, lambda values: by_point(values, stored.data), box),
        **held,
        **_equilibria(stored, group, box),
        "state": box.array(_states(stored, group, u_T), "i1"),
        "rest": at_rest(stored.study),
    }


ALONG = {"u_T": "u_T", "xi": "xi", "N": "section_force"}


def along(data: Any, rows: Callable[[Any], Any], box: Container) -> Json:
    """What runs along the contact line, with its units; rows: makes (P, m) values of a variable."""
    held = {name: data[key] for name, key in ALONG.items() if key in data}
    units = {f"{name}_units": str(one.attrs["units"]) for name, one in held.items()}
    return {name: box.rows(rows(one)) for name, one in held.items()} | units


def _equilibria(stored: Stored, group: Any, box: Container) -> Json:
    """All solutions of all points where they are stored, those of a point one after the other, lowest first."""
    if "solution_u_T" not in group or stored.kept is not None:
        return {}
    point, (u_T, xi) = group["solution_point"].values, (group[f"solution_{name}"].values for name in ("u_T", "xi"))
    states, (frictions, of) = np.zeros(u_T.shape, dtype=np.int8), frictions_of(stored)
    for k, friction in enumerate(frictions):
        own = np.flatnonzero(of[point] == k)
        law = law_of_nodes(friction, group)
        states[own] = node_states(law, u_T[own], np.zeros(u_T[own].shape, dtype=bool))
    return {
        "every": {
            "first": box.array(np.searchsorted(point, np.arange(stored.data["status"][..., -1].size + 1)), "i4"),
            "energy": box.array(group["solution_energy"].values),
            "stable": box.array(group["solution_stable"].values, "i1"),
            "u_T": box.rows(u_T),
            "xi": box.rows(xi),
            "state": box.array(states, "i1"),
        }
    }


def _states(stored: Stored, group: Any, u_T: Any) -> Any:
    """(P, m) ContactState of every node, −1 where there is no solution; only stick and slip where no law is known."""
    sticks = by_point(group["sticks"], stored.data) == STICKS
    states = np.where(sticks, np.int8(ContactState.STICK), np.int8(ContactState.SLIP))
    solved = np.isfinite(u_T).all(axis=1)
    frictions, of = frictions_of(stored)
    for k, friction in enumerate(frictions):
        rows = np.flatnonzero(solved & (of == k))
        states[rows] = node_states(law_of_nodes(friction, group), u_T[rows], sticks[rows])
    states[~solved] = -1
    return states


def shape(study: Study | None) -> Json:
    """Edges of the body with their roles, and its heated regions."""
    return {
        "outline": [{**vars(edge), "line": edge.line.tolist()} for edge in outline(study)],
        "sources": [line.tolist() for line in sources(study)],
    }


def geometry(group: Any, box: Container) -> Json:
    """Where the nodes are and what each stands for; `held` says whether a part ends at a node without unknown, `ends`
    which of `held_u_T` is its slip (-1 for none)."""
    line = contact_line(group)
    parts = [
        {"a": part.start, "b": part.stop, "cells": box.array(line.cells(part)), "closed": line.closed(part),
         "held": list(line.held(part)), "ends": ends}
        for part, ends in zip(line.parts, ends_held(line, group), strict=True)
    ]  # fmt: skip
    nodes = {name: box.array(getattr(line, name)) for name in ("arclength", "x", "y", "c")}
    return nodes | {"edges": list(line.edge_names), "parts": parts}


def live_part(stored: Stored, box: Container) -> Json | None:
    """The finest level that has live data; None where no point is valid or the run kept none.

    A_tilde is symmetric: its lower triangle by rows. proved: λ₁ less its error, which ω is to be below.
    """
    usable = [n for n, data in stored.live.items() if "load" in data and np.any(data["valid"].values == 1.0)]
    if not usable or stored.study is None:
        return None
    level, run = max(usable), stored.data
    lambda_1, error = (by_point(run[name], run)[:, level] for name in ("lambda_1", "lambda_1_error"))
    data, A_tilde = stored.live[level], stored.live[level]["A_tilde"].values
    return {
        "level": level,
        "A": box.array(A_tilde[np.tril_indices(len(A_tilde))]),
        "c": box.array(stored.groups[level]["c"].values),
        "lambda_1": box.array(lambda_1),
        "proved": box.array(lambda_1 * (1.0 - np.maximum(error, DIGITS))),
        **{
            name: box.array(by_point(data[name], stored.data))
            for name in ("stiffness", "valid", "load", "mechanical_load")
        },
    }
