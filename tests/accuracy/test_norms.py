"""Norms of P1 functions and their distances from polynomials, in closed form; functions carried to
other meshes."""

import numpy as np
import pytest

from tcstudy.accuracy import norms
from tcstudy.accuracy.norms import (
    given,
    interpolation,
    less,
    line_norms,
    linear,
    located,
    nodal,
    prolongation,
    steps,
)
from tcstudy.shapes.edges import TriangleGeometry

POINTS = np.array([[0.0, 0.0], [2.0, 0.0], [2.0, 1.0], [0.0, 1.0], [0.7, 0.4]])
TRIANGLES = np.array([[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]])
MESH = TriangleGeometry(POINTS, TRIANGLES)
X, Y = POINTS.T


def refined(points, triangles):
    """Uniform refinement of a mesh, written independently: one node per edge, four triangles
    each."""
    sides = np.sort(
        np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]]), axis=1
    )
    edges, of = np.unique(sides, axis=0, return_inverse=True)
    middle = len(points) + of.reshape(3, -1)
    a, b, c = triangles.T
    ab, bc, ca = middle
    children = [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]
    return np.concatenate([points, points[edges].mean(axis=1)]), np.concatenate(
        [np.array(t).T for t in children]
    )


def sizes(*parts, lam=0.0, mu=0.0, mesh=MESH):
    return norms.norms(mesh, [nodal(mesh, one) for one in parts], lam, mu)


def test_norms_of_linear_functions():
    one, zero = 1 + 0 * X, 0 * X
    assert sizes(one, zero)["u_L2"] == pytest.approx(np.sqrt(2), rel=1e-14)
    assert sizes(X, Y)["u_L2"] == pytest.approx(np.sqrt(8 / 3 + 2 / 3), rel=1e-14)
    assert sizes(3 * X - 2 * Y, zero)["u_H1"] == pytest.approx(np.sqrt(2 * 13), rel=1e-14)
    warm = sizes(zero, zero, X, lam=1.0, mu=1.0)
    assert (warm["theta_L2"], warm["theta_H1"]) == pytest.approx(
        (np.sqrt(8 / 3), np.sqrt(2)), rel=1e-14
    )
    np.testing.assert_allclose(
        MESH.gradient(3 * X - 2 * Y + 1), np.tile([3, -2], (4, 1)), atol=1e-13
    )


def test_distances_from_polynomials():
    """0 against f: the norm of f itself; the rule is exact up to degree five."""
    square = given(MESH, lambda x, y: (x**2, np.array([2 * x, 0 * x])))
    found = norms.norms(MESH, [square, less(square, square)], 1.0, 0.0)
    assert found["u_L2"] == pytest.approx(np.sqrt(32 / 5), rel=1e-13)
    assert found["u_H1"] == found["u_energy"] == pytest.approx(np.sqrt(4 * 8 / 3), rel=1e-13)
    plane = given(MESH, lambda x, y: (x - y, np.array([1 + 0 * x, -1 + 0 * x])))
    off = less(nodal(MESH, X - Y, 7), plane)
    assert max(norms.norms(MESH, [off, off], 1.0, 1.0).values()) < 1e-14


def test_prolongation_changes_no_norm():
    fine_points, fine_triangles = refined(POINTS, TRIANGLES)
    step = prolongation(len(POINTS), fine_points, fine_triangles)
    v = np.random.default_rng(1).normal(size=(2, len(POINTS)))
    fine, w = TriangleGeometry(fine_points, fine_triangles), (step @ v.T).T
    np.testing.assert_array_equal(w[:, : len(POINTS)], v)
    assert sizes(*w, lam=1.2, mu=0.8, mesh=fine) == pytest.approx(
        sizes(*v, lam=1.2, mu=0.8), rel=1e-13
    )
    np.testing.assert_allclose(interpolation(MESH, fine_points) @ v[0], w[0], atol=1e-14)


def test_line_norms():
    """On the unit segment on the x-axis."""
    x = np.linspace(0, 1, 5)
    s = np.column_stack([x[:-1], x[1:]])
    line = np.stack([s, 0 * s], axis=2), np.tile([0.0, -1.0], (4, 2, 1))
    assert line_norms(*line, linear(s))[0] == pytest.approx(np.sqrt(1 / 3), rel=1e-14)
    square = lambda x, y, n: x**2  # noqa: E731
    assert line_norms(*line, linear(0 * s), square) == pytest.approx(
        [np.sqrt(1 / 5)] * 2, rel=1e-14
    )
    halves = np.array([[1.0, 1], [1, 2], [2, 3], [3, 4]])
    assert line_norms(*line, steps(halves))[0] ** 2 == pytest.approx(np.mean(halves**2), rel=1e-14)
    exact = sum(
        1 / 8 * (h - (k + 0.5) / 8) ** 2 + (1 / 8) ** 3 / 12 for k, h in enumerate(halves.ravel())
    )
    assert line_norms(*line, steps(halves), lambda x, y, n: x)[0] ** 2 == pytest.approx(
        exact, rel=1e-13
    )


def test_points_beside_a_slot_are_found_on_their_own_side() -> None:
    """Centres of the fine side are nearer, and no way leads across."""
    fine_points, fine = POINTS, TRIANGLES
    for _ in range(4):
        fine_points, fine = refined(fine_points, fine)
    points = np.concatenate([POINTS - [2.0, 0.0], fine_points + np.array([0.001, 0.0])])
    mesh = TriangleGeometry(points, np.concatenate([TRIANGLES, fine + len(POINTS)]))
    found, weights = located(
        mesh, np.column_stack([np.full(50, -0.005), np.linspace(0.01, 0.99, 50)])
    )
    assert np.all(found < len(TRIANGLES))
    assert weights.min() > -1e-12
