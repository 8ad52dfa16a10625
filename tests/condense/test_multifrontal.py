"""The dense work: one BLAS thread, a factor that is kept or not, and a plan that another matrix takes over."""

from __future__ import annotations

import numpy as np
import pytest
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


def test_without_the_factor_only_A_tilde_is_there():
    case = rolled_plate(MESHES["structured"])
    c = on(case, keep_factor=False)
    assert np.array_equal(c.A_tilde, on(case).A_tilde)
    for use in (c.condense, c.forward):
        with pytest.raises(RuntimeError, match="keep_factor"):
            use(np.zeros(case[0].shape[0]))
    with pytest.raises(RuntimeError, match="keep_factor"):
        c.expand(np.zeros(c.m))


def test_another_matrix_takes_over_the_order_of_elimination():
    """The plan of one material serves another: the same numbers, bit for bit; other unknowns are refused."""
    mesh = MESHES["irregular"]
    A, points, keep, free, components = rolled_plate(mesh)
    first = condense(A, points, keep, free, components)
    other = elasticity(mesh, poisson=0.1)
    again = condense(other, points, keep, free, components, plan=first.plan)
    assert np.array_equal(again.A_tilde, condense(other, points, keep, free, components).A_tilde)
    assert not np.allclose(again.A_tilde, first.A_tilde)
    with pytest.raises(ValueError, match="other kept or eliminated"):
        condense(other, points, keep[:-1], free, components, plan=first.plan)
    fewer = np.array(free) if free.dtype == bool else free[:-1]
    if free.dtype == bool:
        fewer[np.flatnonzero(free)[0]] = False
    with pytest.raises(ValueError, match="other kept or eliminated"):
        condense(other, points, keep, fewer, components, plan=first.plan)


def test_a_plan_is_refused_for_a_matrix_of_another_pattern():
    """Same unknowns, one more pair of entries: the layout would put numbers in the wrong places."""
    A, points, keep, free, components = rolled_plate(MESHES["structured"])
    plan = on((A, points, keep, free, components)).plan
    i, j = np.flatnonzero(free)[[0, -1]]
    more = sp.csr_matrix(A + sp.csr_matrix(([1e-3, 1e-3], ([i, j], [j, i])), shape=A.shape))
    with pytest.raises(ValueError, match="another pattern"):
        condense(more, points, keep, free, components, plan=plan)
