"""What matrices share: the order of elimination, and fronts of what does not differ."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from tcstudy.condense import condense, multifrontal
from tests.condense.meshes import elasticity, plate
from tests.condense.test_condensation import MESHES, rolled_plate


def test_a_plan_serves_other_matrices_of_the_same_pattern_and_unknowns_alone():
    """Bit for bit the same as with a plan of their own, which others get."""
    mesh = MESHES["irregular"]
    A, points, keep, free, components = rolled_plate(mesh)
    first = condense(A, points, keep, free, components)
    other = elasticity(mesh, poisson=0.1)
    again = condense(other, points, keep, free, components, plan=first.plan)
    assert again.plan is first.plan
    assert np.array_equal(again.A_tilde, condense(other, points, keep, free, components).A_tilde)
    fewer, (i, j) = free.copy(), np.flatnonzero(free)[[0, -1]]
    fewer[i] = False
    coupled = sp.csr_matrix(A + sp.csr_matrix(([1e-3, 1e-3], ([i, j], [j, i])), shape=A.shape))
    for matrix, *rows in (
        (other, keep[:-1], free), (other, keep[::-1], free), (other, keep, fewer), (coupled, keep, free)
    ):  # fmt: skip
        own = condense(matrix, points, *rows, components, plan=first.plan)
        assert own.plan is not first.plan
        assert np.array_equal(own.A_tilde, condense(matrix, points, *rows, components).A_tilde)


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
