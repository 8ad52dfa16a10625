"""Condensation against dense elimination and SuperLU, on meshes of every kind of boundary; what is
refused; plans."""

from pathlib import Path

import numpy as np
import pytest
import scipy.sparse as sp
from scipy.sparse.csgraph import maximum_bipartite_matching
from scipy.sparse.linalg import splu
from scipy.spatial import Delaunay

from tcstudy.condense import NotPositiveDefinite, condense, elimination_plan
from tcstudy.condense.dissection import halved, minimum_cover


def plate(n, grading=1.0, seed=None, length=2):
    """Points and triangles of (0, length) x (0, 1), optionally graded to x = 0, or with inner nodes
    moved."""
    x, y = np.meshgrid(
        np.linspace(0, 1, length * n + 1) ** grading * length,
        np.linspace(0, 1, n + 1),
        indexing="ij",
    )
    points = np.column_stack([x.ravel(), y.ravel()])
    if seed is not None:
        inner = (
            (points[:, 0] > 0) & (points[:, 0] < length) & (points[:, 1] > 0) & (points[:, 1] < 1)
        )
        points = points + inner[:, None] * np.random.default_rng(seed).uniform(
            -0.3 / n, 0.3 / n, points.shape
        )
    triangles = Delaunay(points).simplices.astype(np.int64)
    corner = points[triangles]
    a, b = corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]
    triangles = triangles[
        np.abs(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]) > 1e-3 / n**2 * (2 / n) ** (grading - 1)
    ]
    return points, triangles


def products(points, triangles):
    """∫∂_c φ_i ∂_d φ_j on each triangle (nt, 3, 2, 3, 2), P1."""
    corner = points[triangles]
    edge = np.roll(corner, 1, axis=1) - np.roll(corner, -1, axis=1)
    twice = edge[:, 0, 0] * edge[:, 1, 1] - edge[:, 0, 1] * edge[:, 1, 0]
    g = np.stack([-edge[..., 1], edge[..., 0]], axis=-1) / twice[:, None, None]
    return np.einsum("tic,tjd,t->ticjd", g, g, np.abs(twice) / 2)


def assembled(mesh, local):
    """Symmetric matrix of local ones (nt, 3, C, 3, C); unknown c·nv + node."""
    (points, triangles), (count, _, components) = mesh, local.shape[:3]
    at = (triangles[:, :, None] + len(points) * np.arange(components)).reshape(count, -1)
    size, n = (components * len(points),) * 2, at.shape[1]
    rows, columns = np.repeat(at, n, axis=1).ravel(), np.tile(at, n).ravel()
    A = sp.csr_matrix((local.ravel(), (rows, columns)), shape=size)
    return sp.csr_matrix((A + A.T) * 0.5)


def heat(mesh):
    """∫∇θ·∇φ."""
    return assembled(mesh, np.einsum("ticjc->tij", products(*mesh))[:, :, None, :, None])


def elasticity(mesh, poisson=0.3):
    """∫cε(u):ε(v), plane strain, Young's modulus 1."""
    lame, shear, p = (
        poisson / (1 + poisson) / (1 - 2 * poisson),
        0.5 / (1 + poisson),
        products(*mesh),
    )
    same = np.einsum("tij,cd->ticjd", np.einsum("ticjc->tij", p), np.eye(2))
    return assembled(mesh, lame * p + shear * p.swapaxes(2, 4) + shear * same)


def nodes(points, where):
    """Nodes in the mask, by x then y."""
    found = np.flatnonzero(where)
    return found[np.lexsort((points[found, 1], points[found, 0]))]


def rolled_plate(mesh):
    """Clamped at x = 0, rollers at x = 2 (u_x = 0), contact at y = 0 (u_y = 0, u_x kept)."""
    x, y = mesh[0].T
    clamp, roller, contact = x == 0, x == 2, y == 0
    keep = nodes(mesh[0], contact & ~clamp & ~roller)
    free = np.concatenate([~clamp & ~roller, ~clamp & ~contact])
    free[keep] = False
    return elasticity(mesh), mesh[0], keep, free, 2


def two_contacts(mesh):
    """Clamped at x = 0, bottom kept in x with u_y = 0, right side kept in y with u_x = 0: two
    separate parts."""
    x, y = mesh[0].T
    clamp, bottom, right = x == 0, (y == 0) & (x > 0) & (x < 1.5), (x == 2) & (y > 0.4)
    keep = np.concatenate([nodes(mesh[0], bottom), len(x) + nodes(mesh[0], right)])
    free = np.concatenate([~clamp & ~right, ~clamp & ~bottom])
    free[keep] = False
    return elasticity(mesh), mesh[0], keep, free, 2


def neumann_heat(mesh):
    """Pure Neumann heat conduction, kept on the whole outer boundary (method §4): Ã is singular and
    must be found."""
    x, y = mesh[0].T
    outer = (x == 0) | (x == 2) | (y == 0) | (y == 1)
    return heat(mesh), mesh[0], nodes(mesh[0], outer), ~outer, 1


MESHES = {"irregular": plate(14, seed=1), "graded": plate(12, grading=3.0)}


def relative(found, expected):
    return float(np.max(np.abs(found - expected)) / np.max(np.abs(expected)))


@pytest.mark.parametrize("mesh", MESHES)
@pytest.mark.parametrize("body", [rolled_plate, two_contacts, neumann_heat])
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
    root = np.sqrt(
        A_tilde.diagonal()
    )  # row by row: on a graded mesh a few large entries would hide the others
    assert np.max(np.abs(c.A_tilde - A_tilde) / np.outer(root, root)) < 1e-12
    assert np.array_equal(c.A_tilde, c.A_tilde.T)
    assert relative(c.condensed(load), F[keep] - A_ik.T @ X[:, len(keep) :]) < 1e-12
    if body is neumann_heat:  # Ã is singular
        return
    u_k = np.linalg.solve(c.A_tilde, c.condensed(load))
    expected = np.zeros_like(F)
    expected[every] = splu(A[every][:, every].tocsc()).solve(F[every])
    assert relative(c.expand(u_k, load), expected) < 1e-11
    assert relative(c.expand(u_k[:, 0], load[:, 0]), expected[:, 0]) < 1e-11
    extended = c.expand(u_k)  # harmonically
    assert np.max(np.abs((A @ extended)[free])) < 1e-13 * np.max(np.abs(A.data)) * np.max(
        np.abs(extended)
    )


def test_nothing_kept_is_a_sparse_solver_and_duplicate_entries_are_summed():
    A, points, keep, free, components = rolled_plate(MESHES["irregular"])
    free = free.copy()
    free[keep] = True
    F = np.random.default_rng(14).standard_normal((A.shape[0], 2))
    rows = np.repeat(np.arange(A.shape[0]), np.diff(A.indptr))
    order = np.argsort(np.tile(rows, 2), kind="stable")
    doubled = np.tile(0.5 * A.data, 2)[order], np.tile(A.indices, 2)[order], 2 * A.indptr
    c = condense(sp.csr_matrix(doubled, shape=A.shape), points, [], free, components)
    load = c.forward(F)
    assert c.condensed(load).shape == (0, 2)
    inner = np.flatnonzero(free)
    expected = np.zeros_like(F)
    expected[inner] = splu(A[inner][:, inner].tocsc()).solve(F[inner])
    assert relative(c.expand(np.zeros((0, 2)), load), expected) < 1e-11


@pytest.mark.parametrize("scale", [1e-30, 1.0])
@pytest.mark.parametrize(("n", "seed"), [(2, None), (13, 2)])
def test_a_floating_body_is_refused(n, seed, scale):
    """In floating point the zero eigenvalues of the rigid motions come out as tiny numbers of
    either sign."""
    points, _ = mesh = plate(n, seed=seed)
    rolls = np.concatenate([np.ones(len(points), dtype=bool), points[:, 1] > 0])
    with pytest.raises(NotPositiveDefinite):  # it still slides in x
        condense(scale * elasticity(mesh), scale * points, [], rolls, 2)
    everything = np.ones(2 * len(points), dtype=bool)
    for A, components in ((scale * elasticity(mesh), 2), (heat(mesh), 1)):
        with pytest.raises(NotPositiveDefinite, match="not restrained"):
            condense(A, points, [], everything[: A.shape[0]], components)


@pytest.mark.parametrize("n", [5, 12])
def test_rotation_about_a_held_node_is_refused(n):
    """The last pivots may all be large then: the last unknown hardly moves in a rotation about a
    node near it."""
    points, _ = mesh = plate(n, seed=1)
    A, nv = elasticity(mesh), len(points)
    centre = np.argsort(np.hypot(*(points - [1.0, 0.5]).T))[:8]
    for pin in [*centre, *np.random.default_rng(n).integers(0, nv, 8)]:
        free = np.ones(2 * nv, dtype=bool)
        free[[pin, nv + pin]] = False
        with pytest.raises(NotPositiveDefinite):
            condense(A, points, [], free, 2)


def test_a_slender_but_held_body_is_accepted():
    """The smallest eigenvalue falls as (height/length)⁴: badly conditioned, but not singular."""
    points, _ = mesh = plate(4, length=300)
    free, A = np.tile(points[:, 0] > 0, 2), elasticity(mesh)
    F = np.zeros(A.shape[0])
    F[-1] = 1.0
    c = condense(A, points, [], free, 2)
    u = c.expand(np.zeros(0), c.forward(F))
    assert np.max(np.abs((A @ u - F)[free])) < 1e-13 * np.max(np.abs(A.data)) * np.max(np.abs(u))


def test_body_that_slides_along_its_contact_condenses_but_is_not_definite():
    """u_y = 0 at y = 0 and nothing else: Ã exists and has the rigid slide in its kernel."""
    points, _ = mesh = plate(12, seed=3)
    free = np.tile(points[:, 1] > 0, 2)
    c = condense(elasticity(mesh), points, nodes(points, points[:, 1] == 0), free, 2)
    assert np.max(np.abs(c.A_tilde.sum(axis=1))) < 1e-12 * np.max(np.abs(c.A_tilde))
    with pytest.raises(NotPositiveDefinite):
        c.require_definite()


@pytest.mark.parametrize("value", [np.nan, -np.inf])
def test_entries_that_are_not_finite_are_refused(value):
    A, *rest = rolled_plate(plate(6))
    A.data[len(A.data) // 2] = value
    with pytest.raises(ValueError, match="not finite"):
        condense(A, *rest)


def test_a_plan_serves_other_matrices_of_the_same_pattern_alone():
    """Bit for bit the same as with a plan of their own, which others get."""
    A, points, keep, free, components = rolled_plate(MESHES["irregular"])
    first, other = (
        condense(A, points, keep, free, components),
        elasticity(MESHES["irregular"], poisson=0.1),
    )
    i, j = np.flatnonzero(free)[[0, -1]]
    coupled = sp.csr_matrix(A + sp.csr_matrix(([1e-3, 1e-3], ([i, j], [j, i])), shape=A.shape))
    for matrix in (other, coupled):
        own = condense(matrix, points, keep, free, components, plan=first.plan)
        assert (own.plan is first.plan) == (matrix is other)
        assert np.array_equal(own.A_tilde, condense(matrix, points, keep, free, components).A_tilde)


def test_fronts_times_unknowns_may_pass_32_bits(monkeypatch):
    """A chain cut into pieces of two: every front of the plan touches a later unknown."""
    monkeypatch.setattr(elimination_plan, "LEAF_UNKNOWNS", 2)
    n = 50_000
    chain = sp.diags_array([-1.0, 2.0, -1.0], offsets=[-1, 0, 1], shape=(n, n)).tocsr()
    points = np.column_stack([np.arange(n), np.zeros(n)])
    plan = elimination_plan.plan_elimination(
        chain, points, 1, np.array([n - 1]), np.arange(n) < n - 1
    )
    assert len(plan.stops) * n > 2**31
    own = np.diff(plan.stops, prepend=0) > 0
    assert all(plan.stops[f] <= plan.boundaries[f][0] < n for f in np.flatnonzero(own)[:-1])


@pytest.mark.parametrize("seed", range(10))
def test_a_separator_has_the_fewest_nodes_that_meet_all_edges(seed):
    """As many as the largest matching has edges (König)."""
    rng, n = np.random.default_rng(seed), 40
    pairs = rng.random((n, n)) < 0.06
    lower, upper = np.nonzero(pairs)
    cover = minimum_cover(lower, n + upper)
    assert np.all(np.isin(lower, cover) | np.isin(n + upper, cover))
    matching = maximum_bipartite_matching(sp.csr_matrix(pairs))
    assert len(cover) == np.count_nonzero(matching >= 0)


def test_a_separator_of_a_graph_with_a_slow_matching_is_found_at_once():
    """A mesh of 40,000 triangles cut in eight, on which SciPy's matching ran for minutes."""
    edges = np.load(Path(__file__).parent / "slow_matching.npz")
    lower, upper = (edges[name].astype(np.intp) for name in ("lower", "upper"))
    assert len(minimum_cover(lower, 5000 + upper)) == 1008


@pytest.mark.parametrize("columns", [1, 3, 50])
def test_nodes_of_equal_coordinates_are_halved_by_rank(columns):
    """Parts differ by one node, also where a cut runs through nodes that are level or coincide."""
    x = np.repeat(np.arange(columns), 300)
    points = np.column_stack([x, np.tile([0.0, 1.0, 1.0], len(x) // 3)])
    halving = halved(points, leaf=7)
    sizes = np.bincount(halving.part)
    assert len(sizes) == 2**halving.depth
    assert sizes.max() <= 7
    assert np.ptp(sizes) <= 1


def test_the_order_does_not_depend_on_how_many_components_share_a_pattern():
    """Where blocks differ in pattern, unknowns are ordered one by one, with the same result."""
    A, points, keep, free, components = rolled_plate(MESHES["irregular"])
    dropped = A.tolil()
    i, j = A[:, : len(points)].nonzero()
    k = np.flatnonzero((i >= len(points)) & free[i] & free[j])[0]
    dropped[i[k], j[k]] = dropped[j[k], i[k]] = 0.0
    stored = A.copy()
    stored[i[k], j[k]] = stored[j[k], i[k]] = 0.0
    reference = condense(stored, points, keep, free, components).A_tilde
    single = condense(sp.csr_matrix(dropped), points, keep, free, components).A_tilde
    assert relative(single, reference) < 1e-12
