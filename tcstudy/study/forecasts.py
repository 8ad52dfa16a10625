"""Sizes of meshes that are not made: predicted from areas and lengths, so that nothing waits for a mesher."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping
from dataclasses import dataclass

from tcstudy.scene.records import Clamped, Contact, Scene
from tcstudy.scene.study import MeshPlan, Study
from tcstudy.shapes.edges import body_area, boundary_lengths


@dataclass(frozen=True)
class LevelForecast:
    """One mesh level: element size asked for [m], mesh nodes, displacement unknowns and contact unknowns.

    exact: whether they are counted, else predicted
    """

    h: float
    nodes: int
    n_dof: int
    n_contact: int
    exact: bool = False


def known_levels(mesh: MeshPlan) -> list[float]:
    """Element sizes of the levels whose number is known beforehand."""
    known = 1 if mesh.open_ended else mesh.levels
    return [mesh.maxh[i] if mesh.listed else mesh.maxh[0] / 2**i for i in range(known)]


def forecast(study: Study) -> tuple[LevelForecast, ...]:
    """Predicted sizes of these levels; empty for a body from a file, which is not measured here.

    Too low where small features, arcs or grading refine the mesh: `sizes` counts.
    """
    scene = study.scenes[0]
    if scene.body.brep is not None:
        return ()
    area, lengths = body_area(scene.body), boundary_lengths(scene.body)
    return tuple(predicted(scene, area, lengths, h) for h in known_levels(study.mesh))


def predicted(scene: Scene, area: float, lengths: Mapping[str, float], h: float) -> LevelForecast:
    """Euler's formula with equilateral triangles of edge h (Netgen's for maxh = h have 0.9 to 1.04 h on average).

    area: of the body [m²];  lengths: of its edges by name [m]
    """
    triangles = area / (math.sqrt(3) / 4 * h**2)
    nodes = triangles / 2 + sum(lengths.values()) / h / 2 + 1
    held = sum(lengths.get(name, 0.0) / h for name, role in scene.boundary if isinstance(role, Clamped))
    contact = sum(lengths.get(name, 0.0) / h for name in scene.edges(Contact))
    n_dof = 2 * nodes - 2 * held - contact
    return LevelForecast(h, round(nodes), max(1, round(n_dof)), max(1, round(contact)))


def refined(levels: tuple[LevelForecast, ...], mesh: MeshPlan) -> tuple[LevelForecast, ...]:
    """Levels up to the bound of the unknowns, where an estimate decides about meshes after those that are known.

    Adaptive meshes grow about twofold from level to level, others fourfold. The contact line grows like N^(3/4),
    between the N^(1/2) of the body's other boundary and the N of meshes that are refined at the contact line only.
    """
    if not levels or not mesh.open_ended:
        return levels
    growth, last = mesh.strategy.growth, levels[-1]
    most = max(1.0, mesh.max_dofs / last.n_dof)
    ratios = [1.0, *itertools.takewhile(lambda ratio: ratio < most, (growth**i for i in range(1, mesh.levels)))]
    if len(ratios) < mesh.levels:
        ratios.append(most)
    n_dofs = [round(last.n_dof * ratio) for ratio in ratios]
    return tuple(
        LevelForecast(last.h, last.nodes + (n_dof - last.n_dof) // 2, n_dof, round(last.n_contact * ratio**0.75))
        for n_dof, ratio in zip(n_dofs, ratios, strict=True)
    )
