"""Condensation against dense elimination and SuperLU, on meshes with every kind of boundary."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.sparse as sp
from numpy.typing import NDArray
from scipy.sparse.linalg import splu

from tcstudy.condense import Condensation, condense
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


def held_heat(mesh: Mesh) -> Case:
    """Temperature fixed at x = 0, kept at y = 1."""
    x, y = mesh.points.T
    top = mesh.nodes((y == 1) & (x > 0))
    free = x > 0
    free[top] = False
    return heat(mesh), mesh.points, top, free, 1


MESHES = {
    "structured": plate(14),
    "irregular": plate(14, seed=1),
    "hole": plate(16, hole=True, seed=2),
    "graded": plate(12, grading=3.0),
}
BODIES = [rolled_plate, two_contacts, whole_nodes, neumann_heat, held_heat]


def by_superlu(case: Case, F: Array | None = None) -> tuple[Array, Array]:
    """Ã and the condensed load by SuperLU and many right-hand sides."""
    A, _, keep, free, _ = case
    inner = np.flatnonzero(free)
    F = np.zeros((A.shape[0], 1)) if F is None else F
    A_ik = A[inner][:, keep].toarray()
    X = splu(A[inner][:, inner].tocsc()).solve(np.column_stack([A_ik, F[inner]]))
    X_A, X_F = X[:, : len(keep)], X[:, len(keep) :]
    return A[keep][:, keep].toarray() - A_ik.T @ X_A, F[keep] - A_ik.T @ X_F


def relative(found: Array, expected: Array) -> float:
    return float(np.max(np.abs(found - expected)) / np.max(np.abs(expected)))


def on(case: Case, **options: bool) -> Condensation:
    A, points, keep, free, components = case
    return condense(A, points, keep, free, components, **options)


@pytest.mark.parametrize("mesh", MESHES)
@pytest.mark.parametrize("body", BODIES)
def test_agrees_with_superlu(body, mesh):
    case = body(MESHES[mesh])
    F = np.random.default_rng(3).standard_normal((case[0].shape[0], 4))
    A_tilde, l_tilde = by_superlu(case, F)
    found = on(case)
    root = np.sqrt(A_tilde.diagonal())  # row by row: on a graded mesh a few large entries would hide the others
    assert np.max(np.abs(found.A_tilde - A_tilde) / np.outer(root, root)) < 1e-12
    assert relative(found.condense(F), l_tilde) < 1e-12
    assert np.array_equal(found.A_tilde, found.A_tilde.T)


@pytest.mark.parametrize("body", BODIES[:3])
@pytest.mark.parametrize("columns", [None, 1, 7])
def test_condensed_solution_expands_to_the_full_solution(body, columns):
    case = body(MESHES["hole"])
    A, _, keep, free, _ = case
    F = np.random.default_rng(4).standard_normal((A.shape[0],) if columns is None else (A.shape[0], columns))
    every = np.sort(np.concatenate([np.flatnonzero(free), keep]))
    expected = np.zeros_like(F)
    expected[every] = splu(A[every][:, every].tocsc()).solve(F[every])

    c = on(case)
    load = c.forward(F)
    u_k = np.linalg.solve(c.A_tilde, load.l_tilde)
    assert u_k.shape == F[keep].shape
    assert relative(c.expand(u_k, load), expected) < 1e-11
    assert np.array_equal(c.expand(u_k, load), c.expand(u_k, F))
    fixed = np.setdiff1d(np.arange(A.shape[0]), every)
    assert len(fixed) > 0
    assert not c.expand(u_k, F)[fixed].any()


def test_harmonic_extension_has_no_inner_residual_and_the_energy_of_A_tilde():
    case = two_contacts(MESHES["irregular"])
    A, _, keep, free, _ = case
    c = on(case)
    u_k = np.random.default_rng(5).standard_normal((len(keep), 3))
    u = c.expand(u_k)
    assert np.array_equal(u[keep], u_k)
    assert np.max(np.abs((A @ u)[free])) < 1e-13 * np.max(np.abs(A.data)) * np.max(np.abs(u))
    assert relative(u.T @ (A @ u), u_k.T @ c.A_tilde @ u_k) < 1e-13


def test_rows_that_take_no_part_are_ignored():
    case = rolled_plate(MESHES["structured"])
    A, points, keep, free, components = case
    fixed = ~free
    fixed[keep] = False
    c = on(case)
    F = np.random.default_rng(9).standard_normal(A.shape[0])
    changed = F.copy()
    changed[fixed] = 1e6
    assert np.array_equal(c.condense(changed), c.condense(F))
    other = A.tolil()
    other[np.flatnonzero(fixed)] = 0.0  # the way some assemblers impose u = 0; also breaks the blocked pattern
    other[:, np.flatnonzero(fixed)] = 0.0
    other = other.tocsr()
    other.eliminate_zeros()
    assert relative(condense(other, points, keep, free, components).A_tilde, c.A_tilde) < 1e-13


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


def test_nothing_kept_is_a_sparse_solver():
    A, points, keep, free, components = rolled_plate(MESHES["irregular"])
    free = free.copy()
    free[keep] = True
    F = np.random.default_rng(14).standard_normal((A.shape[0], 2))
    c = condense(A, points, [], free, components)
    assert c.A_tilde.shape == (0, 0)
    assert c.condense(F).shape == (0, 2)
    inner = np.flatnonzero(free)
    expected = np.zeros_like(F)
    expected[inner] = splu(A[inner][:, inner].tocsc()).solve(F[inner])
    assert relative(c.expand(np.zeros((0, 2)), F), expected) < 1e-11
    assert relative(c.expand(np.zeros(0), F), expected) < 1e-11


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


def test_separate_bodies_and_isolated_unknowns():
    """Two plates that touch nothing of each other and a node with a diagonal entry only."""
    A, points, keep, free, _ = rolled_plate(MESHES["structured"])
    nv = len(points)
    blocks = [[A[r * nv : (r + 1) * nv, s * nv : (s + 1) * nv] for s in range(2)] for r in range(2)]
    one = sp.identity(1)
    joined = sp.block_array(
        [
            [sp.block_diag([blocks[r][s], blocks[r][s]] + [one] * (r == s) + [one * 0] * (r != s)) for s in range(2)]
            for r in range(2)
        ]
    ).tocsr()
    both = np.concatenate([points, points + np.array([5.0, 0.0]), [[9.0, 9.0]]])
    mask = np.concatenate([free[:nv], free[:nv], [True], free[nv:], free[nv:], [True]])
    c = condense(joined, both, np.concatenate([keep, nv + keep]), mask, 2)
    expected = condense(A, points, keep, free, 2).A_tilde
    m = len(keep)
    assert relative(c.A_tilde[:m, :m], expected) < 1e-12
    assert relative(c.A_tilde[m:, m:], expected) < 1e-12
    assert not c.A_tilde[:m, m:].any()


def test_unsorted_and_duplicate_entries_are_summed():
    A, points, keep, free, components = rolled_plate(plate(6))
    half = sp.csr_matrix(
        (
            np.concatenate([A.data, A.data]) * 0.5,
            np.concatenate([A.indices, A.indices])[order := np.argsort(np.tile(_rows(A), 2), kind="stable")],
            2 * A.indptr,
        ),
        shape=A.shape,
    )
    half.data = half.data[order]
    before = half.data.copy(), half.indices.copy()
    found = condense(half, points, keep, free, components)
    assert relative(found.A_tilde, condense(A, points, keep, free, components).A_tilde) < 1e-14
    assert np.array_equal(half.data, before[0])
    assert np.array_equal(half.indices, before[1])


def _rows(A: sp.csr_matrix) -> NDArray[np.int64]:
    return np.repeat(np.arange(A.shape[0]), np.diff(A.indptr))
