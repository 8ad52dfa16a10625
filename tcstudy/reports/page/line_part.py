"""What the page has of the contact line: nodes, segments, held ends, and slip and traction of every point."""

from __future__ import annotations

from typing import Any

import numpy as np

from tcstudy.reports.page.container import Container, Json
from tcstudy.reports.page.stored import Clamped, LineFields, Stored, Study

NEAR = 1e-6
"""Relative difference of two lengths that are one."""


def line_part(stored: Stored, level: int, box: Container) -> Json:
    """One level's contact line with u_T, ξ and states of all points, flattened in C order of the sweep."""
    group = stored.groups[level]
    dims = [str(d) for d in stored.data["status"].dims if d != "level"]
    m = int(group.sizes["node"])

    def flat(name: str) -> Any:
        return group[name].transpose(*dims, "node").values.reshape(-1, m)

    return {
        **geometry(group, box),
        "u_T": box.rows(flat("u_T")),
        "xi": box.rows(flat("xi")),
        "sticks": box.array(flat("sticks"), "i1") if "sticks" in group else None,
        "u_T_units": str(group["u_T"].attrs["units"]),
        "xi_units": str(group["xi"].attrs["units"]),
        "rest": at_rest(stored.study),
    }


def geometry(group: Any, box: Container) -> Json:
    """Where the nodes are and what each stands for; `held` says whether a part ends at a node without unknown."""
    line = _line(group)
    parts = []
    for part in line.parts:
        cells = line.cells(part)
        closed = line.closed(part)
        s = line.arclength[part]
        span = float(line.c[part].sum())
        held = [not closed and abs(cells[0] - s[0]) > NEAR * span, not closed and abs(cells[-1] - s[-1]) > NEAR * span]
        parts.append({"a": part.start, "b": part.stop, "cells": box.array(cells), "closed": closed, "held": held})
    return {
        "arclength": box.array(line.arclength),
        "x": box.array(line.x),
        "y": box.array(line.y),
        "c": box.array(line.c),
        "edges": list(line.edge_names),
        "parts": parts,
    }


def _line(group: Any) -> LineFields:
    zero = np.zeros(group.sizes["node"])
    values = {name: group[name].values for name in ("arclength", "x", "y", "c")}
    edges = tuple(str(group["edge"].attrs.get("flag_meanings", "")).split())
    return LineFields(**values, edge=group["edge"].values, edge_names=edges, u_T=zero, xi=zero, sticks=None,
                length_units="m", traction_units="Pa")  # fmt: skip


def at_rest(study: Study | None) -> bool:
    """True if every held edge is held where it is, so that the slip is zero at a held end."""
    if study is None:
        return False
    roles = {role for scene in study.scenes for _, role in scene.boundary if isinstance(role, Clamped)}
    return all(component == 0.0 for role in roles for component in role.u)
