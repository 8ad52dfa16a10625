"""The dense work: one BLAS thread, a factor that is kept or not, and a plan that another matrix takes over."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
from threadpoolctl import threadpool_info, threadpool_limits

from tcstudy.condense import condense, multifrontal
from tests.condense.meshes import elasticity, plate
from tests.condense.test_condensation import MESHES, on, rolled_plate


def blas_threads() -> set[int]:
    return {pool["num_threads"] for pool in threadpool_info() if pool["user_api"] == "blas"}


def test_fronts_are_factorised_with_one_thread(monkeypatch):
    seen: list[set[int]] = []
    factorise = multifrontal._factorise

    def spy(blocks):
        seen.append(blas_threads())
        return factorise(blocks)

    monkeypatch.setattr(multifrontal, "_factorise", spy)
    with threadpool_limits(limits=2, user_api="blas"):
        before = blas_threads()
        condense(*rolled_plate(plate(6)))
        assert blas_threads() == before
    assert seen
    assert all(threads == {1} for threads in seen)
    assert before == {2}


def test_another_matrix_takes_over_the_order_of_elimination():
    """The plan of one material serves another, bit for bit the same; other unknowns get a plan of their own."""
    mesh = MESHES["irregular"]
    A, points, keep, free, components = rolled_plate(mesh)
    first = condense(A, points, keep, free, components)
    other = elasticity(mesh, poisson=0.1)
    again = condense(other, points, keep, free, components, plan=first.plan)
    assert np.array_equal(again.A_tilde, condense(other, points, keep, free, components).A_tilde)
    assert not np.allclose(again.A_tilde, first.A_tilde)
    assert again.plan is first.plan
    fewer = free.copy()
    fewer[np.flatnonzero(free)[0]] = False
    for rows in ((keep[:-1], free), (keep[::-1], free), (keep, fewer)):
        own = condense(other, points, *rows, components, plan=first.plan)
        assert np.array_equal(own.A_tilde, condense(other, points, *rows, components).A_tilde)


def test_a_plan_is_not_used_for_a_matrix_of_another_pattern():
    """Same unknowns, one more pair of entries: the layout would put numbers in the wrong places."""
    A, points, keep, free, components = rolled_plate(MESHES["structured"])
    plan = on((A, points, keep, free, components)).plan
    i, j = np.flatnonzero(free)[[0, -1]]
    more = sp.csr_matrix(A + sp.csr_matrix(([1e-3, 1e-3], ([i, j], [j, i])), shape=A.shape))
    own = condense(more, points, keep, free, components, plan=plan)
    assert own.plan is not plan
    assert np.array_equal(own.A_tilde, condense(more, points, keep, free, components).A_tilde)


def test_matrices_that_differ_in_some_rows_share_the_other_fronts(monkeypatch):
    """The right fifth of a plate changes: fewer fronts are factorised to the same bits; a wrong promise is noticed."""
    A, points, keep, free, components = rolled_plate(plate(16))
    changing = np.tile(points[:, 0] > 1.6, 2)
    scale = sp.diags_array(np.where(changing, 1.5, 1.0))
    other = sp.csr_matrix(scale @ A @ scale)
    calls: list[int] = []
    factorise = multifrontal._factorise
    monkeypatch.setattr(multifrontal, "_factorise", lambda blocks: calls.append(1) or factorise(blocks))
    first = condense(A, points, keep, free, components, changing=changing)
    whole, alone = len(calls), condense(other, points, keep, free, components)
    calls.clear()
    shared = condense(other, points, keep, free, components, plan=first.plan, changing=changing, known=first.known)
    assert 0 < len(calls) < whole / 2
    F = np.random.default_rng(3).standard_normal((A.shape[0], 2))
    assert np.array_equal(shared.A_tilde, alone.A_tilde)
    assert np.array_equal(shared.expand(F[keep], F), alone.expand(F[keep], F))
    calls.clear()
    moved = sp.csr_matrix(2.0 * other)  # also where nothing was to change
    again = condense(moved, points, keep, free, components, plan=first.plan, changing=changing, known=shared.known)
    assert len(calls) == whole
    assert np.array_equal(again.A_tilde, condense(moved, points, keep, free, components).A_tilde)
