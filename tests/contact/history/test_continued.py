"""continued: exact parts of a step, jumps with their energy, nodes that turn back inside a step."""

from __future__ import annotations

from dataclasses import replace
from functools import reduce
from itertools import pairwise

import numpy as np
import pytest
from numpy.typing import NDArray

from tcstudy.contact.history.problem import HistoryProblem, HistoryStep
from tcstudy.contact.history.steps import history
from tcstudy.laws.laws import Laws
from tcstudy.matrices import law
from tcstudy.scene.histories import Memory
from tests.contact.history.cases import coupled_line, remembering, softening
from tests.contact.history.test_steps import check_energies

Array = NDArray[np.float64]


def followed(body: HistoryProblem, loads: list[Array]) -> list[HistoryStep]:
    """All steps along their paths: solved, energies in order, closure to rounding, no jump without energy."""
    steps = list(history(body, loads))
    assert [step.reason for step in steps] == [""] * len(loads)
    before = HistoryStep.virgin(body.body.m)
    for step in steps:
        check_energies(body, before, step)
        assert abs(step.closure) <= 1e-8 * (step.dissipated + step.stored + abs(step.energy) + abs(before.energy))
        assert (step.released > 0.0) == (step.jumps > 0)
        before = step
    return steps


def in_parts(body: HistoryProblem, loads: list[Array], count: int) -> list[HistoryStep]:
    """Every load in so many equal parts, each solved by descent from the one before: the last of each."""
    ends = [np.zeros(body.body.m), *loads]
    parts = [a + k / count * (b - a) for a, b in pairwise(ends) for k in range(1, count + 1)]
    steps = list(history(replace(body, branch="lowest"), parts))
    return [reduce(HistoryStep.then, steps[n : n + count]) for n in range(0, len(steps), count)]


CASES: list[tuple[Memory, Laws]] = [
    (Memory("friction"), law("tresca", tau=2e7)),
    (Memory("friction"), softening()),
    (Memory("elastic-plastic", 3e10), softening()),
    (Memory("damage"), softening()),
]


@pytest.mark.parametrize(("memory", "film"), CASES, ids=lambda x: getattr(x, "name", None))
def test_a_step_in_which_nodes_turn_back_is_the_limit_of_many_small_ones(memory: Memory, film: Laws) -> None:
    """Two loads at different places, one taken off as the other grows: some nodes turn round, others start to slip."""
    A, c, load = coupled_line(30)
    place = np.linspace(0.0, 1.0, 30)
    one, two = load * (place < 0.6), -load * (place > 0.3)
    loads = [4.0 * one, 1.0 * one + 4.0 * two, -1.5 * one]
    body = remembering(A, c, film, memory)
    exact, coarse, fine = followed(body, loads), in_parts(body, loads, 4), in_parts(body, loads, 64)
    size = np.max(np.abs(exact[1].v))
    apart = [max(float(np.max(np.abs(a.v - b.v))) for a, b in zip(exact, some, strict=True))
             for some in (coarse, fine)]  # fmt: skip
    assert apart[1] <= 3e-3 * size
    assert apart[1] <= 0.5 * apart[0] or apart[0] <= 1e-9 * size
    lost = [sum(step.closure for step in some) for some in (coarse, fine)]
    assert abs(lost[1]) <= 0.05 * abs(lost[0])
    total = sum(step.dissipated for step in exact)
    assert sum(step.dissipated for step in fine) == pytest.approx(total, rel=5e-3)


def small_steps(A: Array, g: float, loads: list[Array], count: int) -> Array:
    """Slips after `count` equal parts of every step with Tresca friction, each relaxed node by node to rounding."""
    v, last = np.zeros(len(A)), np.zeros(len(A))
    for load in loads:
        for part in range(1, count + 1):
            rest, now = v.copy(), last + (part / count) * (load - last)
            for _ in range(20_000):
                before = v.copy()
                for i in range(len(v)):
                    pull = now[i] - A[i] @ v + A[i, i] * (v[i] - rest[i])
                    v[i] = rest[i] + np.sign(pull) * max(abs(pull) - g, 0.0) / A[i, i]
                if np.max(np.abs(v - before)) <= 1e-13 * np.max(np.abs(v)):
                    break
        last = load
    return v


def long_cells(m: int) -> HistoryProblem:
    """Ã of elements longer than the strip is high has positive entries beside its diagonal."""
    B = np.eye(m) - np.eye(m, k=-1)
    A = B.T @ (np.eye(m) - 0.2 * (np.eye(m, k=1) + np.eye(m, k=-1))) @ B
    return remembering(A, np.ones(m), law("tresca", tau=1.0), Memory("friction"))


def test_nodes_that_are_pushed_back_before_a_front_are_not_seen_by_one_descent() -> None:
    """The path is the limit of small steps."""
    body = long_cells(10)
    A, loads = body.body.A_tilde, [np.append(np.zeros(9), pull) for pull in (7.0, 0.0)]
    exact = followed(body, loads)[-1].v
    one, some = (in_parts(body, loads, k)[-1].v for k in (1, 16))
    assert np.max(np.abs(some - small_steps(A, 1.0, loads, 16))) <= 1e-7 * np.max(exact)
    apart = [np.max(np.abs(v - exact)) / np.max(exact) for v in (one, some, small_steps(A, 1.0, loads, 128))]
    assert apart[0] > 0.02
    assert apart[2] < 0.2 * apart[1] < 0.1 * apart[0]


@pytest.mark.parametrize("memory", [Memory("friction"), Memory("damage")], ids=lambda memory: memory.name)
@pytest.mark.parametrize(("falls_to", "delta"), [(1.4e7, 2e-3), (4e6, 3e-4)], ids=["one solution", "jumps"])
def test_an_exponential_film_is_followed_too(memory: Memory, falls_to: float, delta: float) -> None:
    """States and work are those of many small steps; energies close as exactly as along straight pieces."""
    A, c, load = coupled_line(30)
    place = np.linspace(0.0, 1.0, 30)
    one, two = load * (place < 0.6), -load * (place > 0.3)
    loads = [4.0 * one, 1.0 * one + 4.0 * two, -1.5 * one]
    film = law("exponential", a=2e7, b=falls_to, delta=delta)
    body = remembering(A, c, film, memory)
    steps = followed(body, loads)
    assert max(step.inclusion_residual for step in steps) <= 1e-10
    if falls_to == 1.4e7:
        for step, other in zip(steps, in_parts(body, loads, 16), strict=True):
            assert step.v == pytest.approx(other.v, abs=1e-3 * np.max(np.abs(steps[0].v)))
            assert step.work == pytest.approx(other.work, rel=1e-2)
    assert (sum(step.jumps for step in steps) > 0) == (falls_to == 4e6)


def test_a_jump_ends_in_the_next_well_downhill() -> None:
    """Stick and slip over teeth of a film, one at a time: a block on a spring of 0.06, by hand.

    It lets go of the crest (0.1, 1) with l = 1.006 and is caught by the rise to (1, 2) where 0.06 s + b(s) = 1.006; of
    that it lets go with 2.06, and ends where 0.06 s + 0.1 = 2.06. Released is ∫ (l − 0.06 s − b) ds.
    """
    film = law(points=[(0.0, 0.5), (0.1, 1.0), (0.6, 0.1), (1.0, 2.0), (1.8, 0.1)])
    caught = 0.6 + (1.006 - 0.036 - 0.1) / (0.06 + 1.9 / 0.4)
    loads = [np.array([load]) for load in (1.5, 3.0)]
    one, two = followed(remembering(np.array([[0.06]]), np.ones(1), film, Memory("friction")), loads)
    dip = 1.006 - 0.036 - 0.1
    assert one.released == pytest.approx(0.5 * dip * (caught - 0.1), rel=1e-12)
    assert one.v == pytest.approx(0.6 + (1.5 - 0.136) / (0.06 + 1.9 / 0.4), rel=1e-12)
    end = (2.06 - 0.1) / 0.06
    out = (2.06 - 0.06 * 1.8 - 0.1) * 0.5 * (0.8 + end - 1.8)
    assert two.released == pytest.approx(out, rel=1e-12)
    assert (one.jumps, two.jumps) == (1, 1)
