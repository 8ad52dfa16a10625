"""Condensation against dense elimination and SuperLU, on meshes with every kind of boundary."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.sparse as sp
from numpy.typing import NDArray
from scipy.sparse.linalg import splu

from tcstudy.condense import condense
from tests.condense.meshes import Mesh, elasticity, heat, plate

Array = NDArray[np.float64]
Case = tuple[sp.csr_matrix, Array, NDArray[np.int64], NDArray[np.bool_], int]


def rolled_plate(mesh: Mesh) -> Case:
    """Clamped at x = 0, rollers at x = 2 (u_x = 0), contact at y = 0 (u_y = 0, u_x kept)."""
    x, y = mesh.points.T
    clamp, roller, contact = x == 0, x == 2, y == 0
    keep = mesh.nodes(contact & ~clamp & ~roller)
    free = np.concatenate([~clamp & ~roller, ~clamp & ~contact])
    free[keep] = False
    return elasticity(mesh), mesh.points, keep, free, 2


def two_contacts(mesh: Mesh) -> Case:
    """Clamped at x = 0, bottom kept in x with u_y = 0, right side kept in y with u_x = 0: two separate parts."""
    x, y = mesh.points.T
    nv = len(x)
    clamp, bottom, right = x == 0, (y == 0) & (x > 0) & (x < 1.5), (x == 2) & (y > 0.4)
    keep = np.concatenate([mesh.nodes(bottom), nv + mesh.nodes(right)])
    free = np.concatenate([~clamp & ~right, ~clamp & ~bottom])
    free[keep] = False
    return elasticity(mesh), mesh.points, keep, free, 2


def whole_nodes(mesh: Mesh) -> Case:
    """Both components of the contact nodes are kept."""
    x, y = mesh.points.T
    bottom = mesh.nodes((y == 0) & (x > 0))
    keep = np.concatenate([bottom, len(x) + bottom])
    free = np.tile(x > 0, 2)
    free[keep] = False
    return elasticity(mesh), mesh.points, keep, free, 2


def neumann_heat(mesh: Mesh) -> Case:
    """Pure Neumann heat conduction, kept on the whole outer boundary (method §4): Ã is singular and must be found."""
    x, y = mesh.points.T
    outer = (x == 0) | (x == 2) | (y == 0) | (y == 1)
    return heat(mesh), mesh.points, mesh.nodes(outer), ~outer, 1


MESHES = {
    "structured": plate(14),
    "irregular": plate(14, seed=1),
    "hole": plate(16, hole=True, seed=2),
    "graded": plate(12, grading=3.0),
}


def relative(found: Array, expected: Array) -> float:
    return float(np.max(np.abs(found - expected)) / np.max(np.abs(expected)))


@pytest.mark.parametrize("mesh", MESHES)
@pytest.mark.parametrize("body", [rolled_plate, two_contacts, whole_nodes, neumann_heat])
def test_condensed_problem_and_its_expansion_agree_with_superlu(body, mesh):
    case = body(MESHES[mesh])
    A, _, keep, free, _ = case
    F = np.random.default_rng(3).standard_normal((A.shape[0], 4))
    inner, every = np.flatnonzero(free), np.sort(np.concatenate([np.flatnonzero(free), keep]))
    A_ik = A[inner][:, keep].toarray()
    X = splu(A[inner][:, inner].tocsc()).solve(np.column_stack([A_ik, F[inner]]))
    A_tilde = A[keep][:, keep].toarray() - A_ik.T @ X[:, : len(keep)]
    c = condense(*case)
    load = c.forward(F)
    root = np.sqrt(A_tilde.diagonal())  # row by row: on a graded mesh a few large entries would hide the others
    assert np.max(np.abs(c.A_tilde - A_tilde) / np.outer(root, root)) < 1e-12
    assert np.array_equal(c.A_tilde, c.A_tilde.T)
    assert relative(load.l_tilde, F[keep] - A_ik.T @ X[:, len(keep) :]) < 1e-12
    if body is neumann_heat:  # Ã is singular
        return
    u_k = np.linalg.solve(c.A_tilde, load.l_tilde)
    expected = np.zeros_like(F)
    expected[every] = splu(A[every][:, every].tocsc()).solve(F[every])
    assert relative(c.expand(u_k, load), expected) < 1e-11
    assert relative(c.expand(u_k[:, 0], F[:, 0]), expected[:, 0]) < 1e-11
    extended = c.expand(u_k)  # harmonically
    assert np.max(np.abs((A @ extended)[free])) < 1e-13 * np.max(np.abs(A.data)) * np.max(np.abs(extended))


def test_nothing_kept_is_a_sparse_solver_and_duplicate_entries_are_summed():
    A, points, keep, free, components = rolled_plate(MESHES["irregular"])
    free = free.copy()
    free[keep] = True
    F = np.random.default_rng(14).standard_normal((A.shape[0], 2))
    rows = np.repeat(np.arange(A.shape[0]), np.diff(A.indptr))
    order = np.argsort(np.tile(rows, 2), kind="stable")
    doubled = np.tile(0.5 * A.data, 2)[order], np.tile(A.indices, 2)[order], 2 * A.indptr
    c = condense(sp.csr_matrix(doubled, shape=A.shape), points, [], free, components)
    assert c.condense(F).shape == (0, 2)
    inner = np.flatnonzero(free)
    expected = np.zeros_like(F)
    expected[inner] = splu(A[inner][:, inner].tocsc()).solve(F[inner])
    assert relative(c.expand(np.zeros(0), F), expected) < 1e-11


def test_permuting_keep_permutes_A_tilde_exactly():
    A, points, keep, free, components = two_contacts(MESHES["hole"])
    shuffle = np.random.default_rng(10).permutation(len(keep))
    c = condense(A, points, keep, free, components)
    shuffled = condense(A, points, keep[shuffle], free, components)
    assert np.array_equal(shuffled.A_tilde, c.A_tilde[np.ix_(shuffle, shuffle)])
    F = np.random.default_rng(11).standard_normal(A.shape[0])
    assert np.array_equal(shuffled.condense(F), c.condense(F)[shuffle])
    u_k = np.random.default_rng(12).standard_normal(len(keep))
    assert np.array_equal(shuffled.expand(u_k[shuffle], F), c.expand(u_k, F))


@pytest.mark.parametrize("components", [1, 2, 3])
def test_random_positive_definite_matrices_on_a_mesh_graph(components):
    mesh = plate(9, seed=components)
    rng = np.random.default_rng(components)
    graph = heat(mesh)
    blocks = sp.kron(np.ones((components, components)), abs(graph) > 0).tocoo()
    values = rng.uniform(-1, 1, blocks.nnz) * (rng.random(blocks.nnz) < 0.7)  # component blocks differ in pattern
    B = sp.coo_matrix((values, (blocks.row, blocks.col)), shape=blocks.shape).tocsr()
    B.eliminate_zeros()
    A = (B + B.T).tocsr()
    A = (A + sp.diags(np.asarray(abs(A).sum(axis=1)).ravel() * rng.uniform(1.0, 3.0, A.shape[0]) + 0.1)).tocsr()
    role = rng.integers(0, 6, A.shape[0])
    keep, free = rng.permutation(np.flatnonzero(role == 0)), role > 1
    dense = A.toarray()
    expected = dense[np.ix_(keep, keep)] - dense[np.ix_(keep, free)] @ np.linalg.solve(
        dense[np.ix_(free, free)], dense[np.ix_(free, keep)]
    )
    assert relative(condense(A, mesh.points, keep, free, components).A_tilde, expected) < 1e-13
