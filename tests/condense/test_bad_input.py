"""What condense refuses, and that it says why."""

from __future__ import annotations

import numpy as np
import pytest

from tcstudy.condense import NotPositiveDefinite, condense
from tests.condense.meshes import elasticity, heat, plate
from tests.condense.test_condensation import rolled_plate


@pytest.mark.parametrize("scale", [1e-30, 1.0])
@pytest.mark.parametrize(("n", "seed"), [(2, None), (5, 1), (13, 2), (40, 3)])
def test_a_floating_body_is_refused(n, seed, scale):
    """In floating point the zero eigenvalues of the rigid motions come out as tiny numbers of either sign."""
    mesh = plate(n, seed=seed)
    rolls = np.concatenate([np.ones(len(mesh.points), dtype=bool), mesh.points[:, 1] > 0])
    with pytest.raises(NotPositiveDefinite):  # it still slides in x
        condense(scale * elasticity(mesh), scale * mesh.points, [], rolls, 2)
    everything = np.ones(2 * len(mesh.points), dtype=bool)
    with pytest.raises(NotPositiveDefinite, match="not held"):
        condense(scale * elasticity(mesh), mesh.points, [], everything, 2)
    with pytest.raises(NotPositiveDefinite, match="not held"):
        condense(heat(mesh), mesh.points, [], everything[: len(mesh.points)], 1)


@pytest.mark.parametrize("n", [5, 20])
def test_rotation_about_a_held_node_is_refused(n):
    """The last pivots may all be large then: the last unknown hardly moves in a rotation about a node near it."""
    mesh = plate(n, seed=1)
    A, nv = elasticity(mesh), len(mesh.points)
    centre = np.argsort(np.hypot(mesh.points[:, 0] - 1.0, mesh.points[:, 1] - 0.5))[:8]
    for pin in [*centre, *np.random.default_rng(n).integers(0, nv, 8)]:
        free = np.ones(2 * nv, dtype=bool)
        free[[pin, nv + pin]] = False
        with pytest.raises(NotPositiveDefinite):
            condense(A, mesh.points, [], free, 2)


@pytest.mark.parametrize("slender", [30, 300])
def test_a_slender_but_held_body_is_accepted(slender):
    """The smallest eigenvalue falls as (height/length)⁴: badly conditioned, but not singular."""
    mesh = plate(4)
    columns = np.linspace(0, slender, 4 * slender + 1)
    x, y = np.meshgrid(columns, np.linspace(0, 1, 5), indexing="ij")
    points = np.column_stack([x.ravel(), y.ravel()])
    a = (np.arange(4 * slender)[:, None] * 5 + np.arange(4)).ravel()
    triangles = np.concatenate([np.column_stack([a, a + 5, a + 6]), np.column_stack([a, a + 6, a + 1])])
    mesh = type(mesh)(points, triangles)
    free = np.tile(points[:, 0] > 0, 2)
    A = elasticity(mesh)
    F = np.zeros(A.shape[0])
    F[-1] = 1.0
    u = condense(A, points, [], free, 2).expand(np.zeros(0), F)
    residual = (A @ u - F)[free]
    assert np.max(np.abs(residual)) < 1e-13 * np.max(np.abs(A.data)) * np.max(np.abs(u))


def test_body_that_slides_along_its_contact_condenses_but_is_not_definite():
    """u_y = 0 at y = 0 and nothing else: Ã exists and has the rigid slide in its kernel."""
    mesh = plate(12, seed=3)
    bottom = mesh.nodes(mesh.points[:, 1] == 0)
    free = np.concatenate([mesh.points[:, 1] > 0, mesh.points[:, 1] > 0])
    c = condense(elasticity(mesh), mesh.points, bottom, free, 2)
    assert np.max(np.abs(c.A_tilde.sum(axis=1))) < 1e-12 * np.max(np.abs(c.A_tilde))
    with pytest.raises(NotPositiveDefinite):
        c.require_definite()


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_entries_that_are_not_finite_are_refused(value):
    A, points, keep, free, components = rolled_plate(plate(6))
    A.data[len(A.data) // 2] = value
    with pytest.raises(ValueError, match="not finite"):
        condense(A, points, keep, free, components)
