"""One BLAS thread during the dense work, the caller's setting afterwards."""

from __future__ import annotations

from threadpoolctl import threadpool_info, threadpool_limits

from tcstudy.condense import condense, multifrontal
from tests.condense.meshes import plate
from tests.condense.test_condensation import rolled_plate


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
