"""What jumps of exponential films release: from the fold of the law itself, not of straight pieces in its place."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from tcstudy.laws.laws import Laws
from tcstudy.matrices import law
from tcstudy.scene.histories import Memory
from tests.contact.contact_cases import half_laplacian
from tests.contact.history.cases import remembering
from tests.contact.history.test_continued import followed

Array = NDArray[np.float64]

MEMORIES = pytest.mark.parametrize("memory", [Memory("friction"), Memory("damage")], ids=lambda memory: memory.name)


def concave(d: float) -> Laws:
    """τ(s) = 3 − exp(s/d) to s = d, then 3 − e: it falls more and more steeply, by 1/d at first and e/d in the end."""
    end, none = 3.0 - np.e, np.zeros(4)
    kinks, s_0 = np.array([-d, 0.0, d]), np.array([-d, 0.0, 0.0, d])
    a, r = np.array([0.0, 1.0, -1.0, 0.0]), np.array([0.0, 1.0, -1.0, 0.0]) / d
    return Laws("concave", kinks, s_0, np.array([-end, -3.0, 3.0, end]), none, a, r)


@MEMORIES
@pytest.mark.parametrize("k", [1.1, 1.3, 1.6, 2.0])
@pytest.mark.parametrize("before", [(), (0.9,), (0.5, 0.99), (1.0 - 1e-5,), (1.0 - 1e-9,)])
def test_a_block_on_a_spring_lets_go_where_the_film_falls_as_the_spring_rises(
    memory: Memory, k: float, before: tuple[float, ...]
) -> None:
    """τ′(s) = −k at s = ln k; the load stays while the block slides to k s + 3 − e: released is ∫ (l − k s − τ) ds."""
    fold, way = np.log(k), (-1.0) ** len(before)
    load = k * fold + 3.0 - k
    landing = (load - (3.0 - np.e)) / k
    lost = 3.0 - np.e + (3.0 - np.e) * (landing - 1.0) - (3.0 * fold - k + 1.0) + 1.0  # ∫ τ from the fold on
    released = load * (landing - fold) - 0.5 * k * (landing**2 - fold**2) - lost
    body = remembering(np.array([[k]]), np.ones(1), concave(1.0), memory)
    steps = followed(body, [np.array([way * share * load]) for share in (*before, 1.2)])
    assert [step.jumps for step in steps] == [*(0 for _ in before), 1]
    assert steps[-1].released == pytest.approx(released, rel=1e-11)
    assert steps[-1].v[0] == pytest.approx(way * (1.2 * load - 3.0 + np.e) / k, rel=1e-14)
    assert max(step.identity for step in steps) <= 3e-16
    assert max(abs(step.closure) for step in steps) <= 1e-15 * load


def settled(A: Array, c: Array, film: Laws, load: Array, v: Array) -> Array:
    """v ≥ 0 downhill from v: Newton's steps where the energy is convex, else those of its majorant linear in τ."""
    for _ in range(10_000):
        force = load - A @ v - c * film.b(v, 1)
        free = np.flatnonzero((v > 0.0) | (force > 0.0))
        own, fall = A[np.ix_(free, free)], c[free] * film.slope(v[free], film.piece(v[free], 1))
        H = own + np.diag(fall)
        H = H if np.all(np.linalg.eigvalsh(H) > 0.0) else own
        new = v.copy()
        new[free] = np.maximum(0.0, v[free] + np.linalg.solve(H, force[free]))
        if np.max(np.abs(new - v)) <= 1e-11 * np.max(new):
            return new
        v = new
    raise AssertionError("it creeps")


def first_jump(A: Array, c: Array, film: Laws, load: Array, begin: float, step: float) -> tuple[float, float]:
    """(factor of the load, energy released) at the first jump by more than 0.02, by small steps, the last halved."""

    def energy(v: Array) -> float:
        return float(0.5 * v @ A @ v - at * load @ v + c @ film.j(v))

    at = begin
    v = settled(A, c, film, at * load, np.zeros(len(c)))
    while step > 1e-9:
        new = settled(A, c, film, (at + step) * load, v)
        beyond = np.max(np.abs(new - v)) > 0.02
        at, v = (at, v) if beyond else (at + step, new)
        step *= 0.5 if beyond or step < 1e-3 else 1.0
    landed = settled(A, c, film, (at + 2e-9) * load, v)
    return at, energy(v) - energy(landed)


FILMS = [(concave(0.3), 2.4), (law("exponential", a=3.0, b=0.3, delta=0.1), 2.9)]


@pytest.mark.parametrize(("film", "begin"), FILMS, ids=["softest way", "next node"])
def test_a_line_lets_go_as_by_small_steps(film: Laws, begin: float) -> None:
    """20 nodes: where sliding nodes lose their hold together, and where the next one begins to slide."""
    A, c = half_laplacian(20)
    load = c * np.linspace(0.2, 1.0, 20)
    at, released = first_jump(A, c, film, load, begin, 2e-3)
    for memory in (Memory("friction"), Memory("damage")):
        body = remembering(A, c, film, memory)
        steps = followed(body, [share * load for share in (begin, at - 1e-7, at + 1e-7)])
        assert [step.jumps for step in steps] == [0, 0, 1]
        assert steps[-1].released == pytest.approx(released, rel=1e-7)
        assert max(step.identity for step in steps) <= 3e-16
