"""The study that stands in a result file: edges of the body with their roles, heated regions, the order of its points.

Every result file has the text of its study. Where it can be read again, pictures and pages can say what an edge does.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

from tcstudy.data.schema import JOINTS
from tcstudy.errors import StudyError
from tcstudy.laws.composed import NO_JOINTS, EdgeLaws, Joints, law_along
from tcstudy.laws.laws import Laws
from tcstudy.read.study import read_study_text
from tcstudy.scene.records import Clamped, Convection, Edge, Role, Scene, Traction
from tcstudy.scene.study import Study
from tcstudy.shapes.edges import edge_points

Array = NDArray[np.float64]

ARC_POINTS = 24


@dataclass(frozen=True)
class NamedEdge:
    """An edge of the body: its role in a word, the loop that it belongs to (0 is the outline), its points (n, 2).

    loaded: whether a traction acts on it
    """

    name: str
    role: str
    loop: int
    line: Array
    loaded: bool = False


def stored_study(data: Any, swept: bool = True) -> Study | None:
    """The study of a result file (its root dataset); None if its text cannot be read (a body's file may be gone).

    swept: with its points, of which each costs half a millisecond; else the one scene outside the sweep
    """
    text, overrides = str(data.attrs.get("study_yaml", "")), str(data.attrs.get("overrides", ""))
    told = [one for one in overrides.split("\n") if one] + ([] if swept else ["sweep=null"])
    try:
        return read_study_text(text, "study", told)
    except (StudyError, OSError):
        return None


def scene_at(study: Study, index: Sequence[int]) -> Scene:
    """The scene of the point at a place of the file, which is its index along each dimension of the sweep."""
    number = int(np.ravel_multi_index(tuple(index), study.shape)) if study.shape else 0
    return study.scenes[number]


def law_of_nodes(friction: Laws | EdgeLaws, group: Any) -> Laws:
    """The law of the contact line of a stored level, or of its nodes."""
    names = str(group["edge"].attrs.get("flag_meanings", "")).split()
    xy = np.stack([group["x"].values, group["y"].values], axis=1)
    return law_along(friction, names, group["edge"].values, xy, joints_of(group))


def joints_of(group: Any) -> Joints:
    """The nodes of a stored level where contact edges meet."""
    return Joints(*(group[v.name].values for v in JOINTS)) if "joint_node" in group else NO_JOINTS


def at_rest(study: Study | None) -> bool:
    """True if every held edge is held where it is, so that the slip is zero at a held end."""
    if study is None:
        return False
    roles = {role for scene in study.scenes for _, role in scene.boundary if isinstance(role, Clamped)}
    return all(component in (None, 0.0) for role in roles for component in role.u)


def outline(study: Study | None) -> list[NamedEdge]:
    """Edges with their roles; empty if the study does not say (a body from a file)."""
    if study is None or study.scenes[0].body.outline is None:
        return []
    body, roles = study.scenes[0].body, dict(study.scenes[0].boundary)
    found = []
    for number, loop in enumerate((body.outline, *body.holes)):
        assert loop is not None
        for edge in loop.edges:
            line, role = _polyline(edge), roles.get(edge.name)
            word = type(role).__name__.lower() if role is not None else "free"
            found.append(NamedEdge(edge.name, word, number, line, _loaded(role)))
    return found


def _loaded(role: Role | None) -> bool:
    if role is not None and any(role.force):
        return True
    return isinstance(role, Traction | Convection) and (role.g != (0.0, 0.0) or role.pressure != 0.0)


def sources(study: Study | None) -> list[Array]:
    """Outlines (n, 2) of the regions that are heated."""
    if study is None or not any(scene.heat.q != 0.0 for scene in study.scenes):
        return []
    heat, regions = study.scenes[0].heat, study.scenes[0].body.regions
    loops = [region.loop for region in regions if region.name in heat.omega]
    return [np.concatenate([_polyline(edge) for edge in loop.edges]) for loop in loops]


def _polyline(edge: Edge) -> Array:
    """A straight edge as its two ends, an arc as a chain of points (n, 2)."""
    return edge_points(edge, 1 if edge.through is None else ARC_POINTS - 1)


def nearest(places: Array, named: Sequence[NamedEdge]) -> NDArray[np.int8]:
    """(k,) index of the named edge that each place lies on; −1 where no edges are known."""
    if not named:
        return np.full(len(places), -1, dtype=np.int8)
    points, lines = shapely.points(places), [shapely.LineString(edge.line) for edge in named]
    return np.argmin([shapely.distance(points, line) for line in lines], axis=0).astype(np.int8)
