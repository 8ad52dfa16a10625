"""The contact line of a level with the normals of the exact curve, and the exact solution at its nodes.

The mesh cuts arcs into chords; errors, and the exact solution as a start, belong to the curve.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tcstudy.accuracy.norms import Line
from tcstudy.exact.numbers import exact_u_T
from tcstudy.fem.boundary import curve_normals
from tcstudy.offline.level import Level
from tcstudy.scene.records import Contact, Exact
from tcstudy.scene.study import Study

Array = NDArray[np.float64]


def exact_start(study: Study, level: Level) -> Array | None:
    """(m,) u_T of the exact solution at the contact nodes [m]; None where the study gives none."""
    return None if study.exact is None else exact_at(study.exact, contact_line(study, level))


def exact_at(exact: Exact, line: Line) -> Array:
    """(m,) u_T of the exact solution at the nodes of the line [m]."""
    return line.at_nodes(exact_u_T(exact))


def contact_line(study: Study, level: Level) -> Line:
    """The contact line with the exact curve's normals at both ends of every segment."""
    names, curve = study.scenes[0].edges(Contact), segment_curves(level)
    mesh, segments = level.mesh, level.line.segments
    normals = np.empty((len(segments), 2, 2))
    for i, one in enumerate(mesh.geometry.curves):
        if one.name in names:
            nodes, at = curve_normals(mesh, i)
            own = curve == i
            normals[own] = at[np.searchsorted(nodes, segments[own])]
    return Line(mesh.points, segments, normals, level.line.nodes, level.line.c)


def segment_curves(level: Level) -> NDArray[np.intp]:
    """(s,) index of the curve that every contact segment lies on."""
    mesh, segments = level.mesh, level.line.segments
    key = mesh.segments[:, 0] * mesh.n_points + mesh.segments[:, 1]
    order = np.argsort(key)
    wanted = segments[:, 0] * mesh.n_points + segments[:, 1]
    return mesh.segment_curve[order[np.searchsorted(key[order], wanted)]]
