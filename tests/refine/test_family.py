"""Meshes of adaptive families: what one level is refined to."""

from __future__ import annotations

import numpy as np

from tcstudy.refine.ends import Hidden
from tcstudy.refine.family import Family, bisected
from tcstudy.shapes.triangles import doubled_areas
from tests.verification.goal_scenes import front_study


def test_parts_with_much_of_the_error_are_cut_several_times_on_the_way_to_one_level() -> None:
    mesh = Family(front_study(0.4, 0.1)).next(0)
    shares = np.full(len(mesh.triangles), 1e-6)
    shares[7] = 1.0
    at, own = mesh.points[mesh.triangles[7]].mean(axis=0), doubled_areas(mesh.points[mesh.triangles])[7]
    finer = bisected(mesh, shares, 0.1, 0.5)
    parts = finer.points[finer.triangles]
    inside = np.linalg.norm(parts.mean(axis=1) - at, axis=1) < 0.2 * np.sqrt(own)
    assert finer.level == 1
    assert np.all(doubled_areas(parts)[inside] < own / 6.0)  # four halvings of its share, so of the area at least three
    assert len(finer.triangles) < 1.5 * len(mesh.triangles)


def test_what_an_end_cell_hides_is_halved_with_the_cell_and_nothing_else_is_cut() -> None:
    mesh = Family(front_study(0.4, 0.1)).next(0)
    node = int(np.argmin(np.linalg.norm(mesh.points, axis=1)))
    at = int(
        np.flatnonzero(
            np.isclose(mesh.points[mesh.segments], 0.0)[:, :, 1].all(axis=1) & (mesh.segments == node).any(axis=1)
        )[0]
    )
    curve, ends = mesh.segment_curve[at], mesh.points[mesh.segments[at]]
    length = np.linalg.norm(ends[1] - ends[0])
    hidden = Hidden(np.array([node]), np.array([curve]), np.array([1.0]), np.array([length]))
    finer = bisected(mesh, np.full(len(mesh.triangles), 1e-6), 0.2, 0.5, hidden)
    assert 0.1 < hidden.on(finer).sum() <= 0.25
    assert np.count_nonzero(hidden.on(finer)) == 1
    assert len(finer.triangles) < len(mesh.triangles) + 40
