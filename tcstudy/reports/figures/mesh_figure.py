"""The mesh of a level: its elements, their number, and what the edges of the body do."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from tcstudy.data.reading import refuse_geometries
from tcstudy.data.store import open_results
from tcstudy.reports.figures import style
from tcstudy.reports.figures.boundary_roles import ROLES, EdgeRun, draw_roles, runs
from tcstudy.reports.figures.sheet import Sheet
from tcstudy.reports.picture import BodyFields
from tcstudy.reports.select_point import Value, level_number, locate
from tcstudy.reports.stored_study import outline, sources, stored_study
from tcstudy.reports.text import axis_unit

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Array = NDArray[np.float64]

SIDE = 0.5
"""Widest line between two elements [pt]."""
SOURCE: dict[str, Any] = {"color": style.VERMILLION, "linewidth": 1.3, "linestyle": (0, (4, 2))}


@dataclass(frozen=True)
class MeshPicture:
    """The mesh of one level; runs: its boundary by edges;  sources: outlines (n, 2) of heated regions [units]."""

    title: str
    level: int
    h_max: float
    units: str
    body: BodyFields
    runs: tuple[EdgeRun, ...]
    sources: tuple[Array, ...]


def read_mesh(path: Path, point: Mapping[str, Value] | None, level: int) -> MeshPicture:
    """Read the mesh of a level.

    Raises StoreError if `path` is no complete result file, DrawError if it holds no mesh or no such point or level.
    """
    with open_results(path) as tree:
        data = tree.to_dataset()
        refuse_geometries(data.attrs, "a mesh")
        locate(data, point)  # a mesh is the same at all points, but what is named must be there
        at = level_number(data, level)
        group = tree[f"level_{at}"].to_dataset()
        if "triangle" not in group:
            raise style.DrawError("the run kept no mesh; run it again with --set output.fields=true")
        x, y, triangles = (group[name].values for name in ("node_x", "node_y", "triangle"))
        zero, study = np.zeros(len(x)), stored_study(data)
        body = BodyFields(x, y, triangles.astype(np.intp), zero, zero, None, "1")
        return MeshPicture(
            title=str(data.attrs["title"]),
            level=at,
            h_max=float(data["h_max"][at]),
            units=str(data["h_max"].attrs["units"]),
            body=body,
            runs=tuple(runs(body, outline(study))),
            sources=tuple(sources(study)),
        )


def mesh_figure(picture: MeshPicture, look: style.Look) -> Figure:
    """The figure of one mesh."""
    body = picture.body
    size = style.with_unit(picture.h_max, picture.units, 3)
    facts = [
        f"level {picture.level}:  {len(body.triangles)} elements,  {len(body.x)} nodes,  longest edge {size}".rstrip(),
        "" if picture.runs else "the roles of the edges are not known: the body comes from a file of its own",
    ]
    sheet = Sheet(look, picture.title, facts)
    (axes,), (divisor, unit) = sheet.panels.values(), axis_unit([np.ptp(body.x), np.ptp(body.y)], picture.units)
    x, y = body.x / divisor, body.y / divisor
    across = float(np.ptp(x)) / (0.75 * sheet.width * 72.0)
    side = float(np.sqrt(np.ptp(x) * np.ptp(y) / len(body.triangles))) / across  # of an element [pt]
    axes.triplot(x, y, body.triangles, color=style.PALE, linewidth=min(SIDE, 0.06 * side), zorder=1)
    for line in picture.sources:
        axes.plot(*np.append(line, line[:1], axis=0).T / divisor, zorder=2, **SOURCE)
    axes.set_aspect("equal")
    draw_roles(axes, x, y, picture.runs, 72.0 * across)
    axes.set(xlabel=style.labelled("x", unit), ylabel=style.labelled("y", unit))
    handles = _handles(picture)
    if handles:
        sheet.key(handles)
    return sheet.finish()


def _handles(picture: MeshPicture) -> list[Any]:
    """The edges by name and role, and the heated region."""
    from matplotlib.lines import Line2D

    edges: dict[str, dict[str, None]] = {}
    for run in picture.runs:
        name = run.edge.name + (" (traction)" if run.edge.loaded and run.edge.role != "traction" else "")
        edges.setdefault(run.edge.role, {})[name] = None
    entries = [(f"{role}: {', '.join(edges[role])}", ROLES[role]) for role in ROLES if role in edges]
    entries += [("heated", SOURCE)] if picture.sources else []
    return [Line2D([], [], **how, label=style.plain(text)) for text, how in entries]
