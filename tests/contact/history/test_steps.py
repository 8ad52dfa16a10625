"""steps: exact rules on any body (Masing, secants), closed forms of pipelines and single cells,
many small steps."""

from dataclasses import replace
from functools import reduce
from itertools import pairwise

import numpy as np
import pytest
from numpy.typing import NDArray

from tcstudy.contact.history.memory import HistoryProblem, HistoryStep
from tcstudy.contact.history.steps import history
from tcstudy.contact.problem import Status
from tcstudy.laws.laws import Laws
from tcstudy.matrices import law
from tcstudy.scene.histories import HistoryBranch, Memory
from tests.contact.history.cases import (
    check_energies,
    coupled_line,
    followed,
    remembering,
    softening,
    strip,
)

Array = NDArray[np.float64]
FRICTION, DAMAGE = Memory("friction"), Memory("damage")


@pytest.mark.parametrize(
    "memory", [FRICTION, Memory("elastic-plastic", 3e10)], ids=lambda m: m.name
)
def test_masing(memory: Memory) -> None:
    """v(e₁ → e₂) = v(e₁) − 2 v((e₁ − e₂)/2), for slips, forces and plastic slips alike."""
    A, c, load = coupled_line(40)
    body = remembering(A, c, law("tresca", tau=2e7), memory)
    for e_2 in (1.0, -3.0):
        first, back = followed(body, [3.0 * load, e_2 * load])
        (half,) = followed(body, [0.5 * (3.0 - e_2) * load])
        for name in ("v", "plastic", "xi"):
            whole = getattr(first, name)
            expected = whole - 2.0 * getattr(half, name)
            assert getattr(back, name) == pytest.approx(
                expected, abs=1e-11 * (np.max(np.abs(whole)) or 1.0)
            )
        assert back.unique


def test_secants_scale_and_dissipate_nothing() -> None:
    """Damage to e₁, then e in [−e₁, e₁]: v = (e/e₁) v(e₁), ξ likewise, D = 0; beyond e₁ the film
    goes on to break."""
    A, c, load = coupled_line(40)
    body = remembering(A, c, softening(), DAMAGE)
    factors = [3.0, 1.0, 0.0, -2.0, -3.0, -4.0]
    first, *inside, last = followed(body, [e * load for e in factors])
    for e, step in zip(factors[1:5], inside, strict=True):
        for one, whole in ((step.v, first.v), (step.xi, first.xi)):
            assert one == pytest.approx(e / 3.0 * whole, abs=1e-11 * np.max(np.abs(whole)))
        assert step.dissipated <= 1e-12 * first.dissipated
        assert abs(step.closure) <= 1e-12 * abs(first.energy)
    assert last.dissipated > 0.05 * first.dissipated
    assert all(step.unique and step.global_minimum for step in (first, *inside, last))


BRANCHES = pytest.mark.parametrize("branch", ["continued", "lowest"])


def walking(
    cells: int, hot: float, cycles: int, branch: HistoryBranch, slope: float = 0.0
) -> list[HistoryStep]:
    """H4: pipeline of 2000 m on r = 1 kN/m, warmed by `hot` and cooled again; pulled by 0.3 MN at
    its right end, or by its weight, so much a length, along a slope."""
    A, c, heat = strip(cells, 2000.0, 3.2913e9, held=False)
    pull = slope * c if slope else np.append(np.zeros(cells), 0.3e6)
    body = remembering(A, c, law("tresca", tau=1e3), FRICTION, branch, loose=True)
    loads = [pull, *(1.17e-5 * theta * heat + pull for theta in (hot, 0.0) * cycles)]
    steps = list(history(body, loads))
    for before, step in pairwise(steps):
        if step.solved:
            check_energies(body, before, step)
    return steps


@BRANCHES
def test_a_pipeline_that_only_friction_holds_walks(branch: HistoryBranch) -> None:
    """(ε − (rL − S)/D) S/r a cycle, every point alike, to rounding where both anchors are nodes; 0
    below 44.1 K.

    Down a slope hot N = −(r − w)(L − x), cold N = (r − w) x between anchors at L (1 ∓ w/r)/2: (ε −
    (r − w) L/D) L w/r.
    """
    sloping = (1.17e-5 * 80.0 - 700.0 * 2000.0 / 3.2913e9) * 2000.0 * 0.3
    for hot, slope, walk, off in ((60.0, 0.0, 55.64603e-3, 5e-9), (80.0, 300.0, sloping, 1e-12)):
        steps = walking(40, hot, 3, branch, slope)
        assert all(step.solved and step.unique for step in steps)
        walked = np.diff([step.v for step in steps[2::2]], axis=0)
        assert walked == pytest.approx(walk, abs=off)
        assert np.ptp(walked) <= 1e-12
        if branch == "continued":
            assert all(abs(step.closure) <= 1e-12 * step.dissipated for step in steps)
    still = walking(40, 40.0, 3, branch)
    assert np.max(np.abs(still[-1].v - still[-3].v)) <= 1e-12


@BRANCHES
def test_a_walk_that_is_not_determined_says_so(branch: HistoryBranch) -> None:
    """Where an anchor is the middle of a cell, all nodes slide at their limit and the body may lie
    anywhere."""
    steps = walking(100, 60.0, 1, branch)
    assert steps[-1].status == Status.NOT_POSITIVE_DEFINITE
    assert "not unique" in steps[-1].reason


def in_parts(body: HistoryProblem, loads: list[Array], count: int) -> list[HistoryStep]:
    """Every load in so many equal parts, each solved by descent from the one before: the last of
    each."""
    ends = [np.zeros(body.body.m), *loads]
    parts = [a + k / count * (b - a) for a, b in pairwise(ends) for k in range(1, count + 1)]
    steps = list(history(replace(body, branch="lowest"), parts))
    return [reduce(HistoryStep.then, steps[n : n + count]) for n in range(0, len(steps), count)]


def two_loads(m: int) -> tuple[Array, Array, list[Array]]:
    """(Ã, c, loads) of two places, one taken off as the other grows: some nodes turn round, others
    start to slip."""
    A, c, load = coupled_line(m)
    place = np.linspace(0.0, 1.0, m)
    one, two = load * (place < 0.6), -load * (place > 0.3)
    return A, c, [4.0 * one, 1.0 * one + 4.0 * two, -1.5 * one]


CASES = [
    (FRICTION, law("tresca", tau=2e7)),
    (FRICTION, softening()),
    (Memory("elastic-plastic", 3e10), softening()),
    (DAMAGE, softening()),
]


@pytest.mark.parametrize(("memory", "film"), CASES, ids=lambda x: getattr(x, "name", None))
def test_a_step_in_which_nodes_turn_back_is_the_limit_of_many_small_ones(
    memory: Memory, film: Laws
) -> None:
    A, c, loads = two_loads(20)
    body = remembering(A, c, film, memory)
    exact, coarse, fine = followed(body, loads), in_parts(body, loads, 4), in_parts(body, loads, 32)
    size = np.max(np.abs(exact[1].v))
    apart = [max(float(np.max(np.abs(a.v - b.v))) for a, b in zip(exact, some, strict=True))
             for some in (coarse, fine)]  # fmt: skip
    assert apart[1] <= 3e-3 * size
    assert apart[1] <= 0.5 * apart[0] or apart[0] <= 1e-9 * size
    lost = [sum(step.closure for step in some) for some in (coarse, fine)]
    assert abs(lost[1]) <= 0.05 * abs(lost[0])
    total = sum(step.dissipated for step in exact)
    assert sum(step.dissipated for step in fine) == pytest.approx(total, rel=5e-3)


@pytest.mark.parametrize(
    ("memory", "falls_to", "delta"),
    [(FRICTION, 1.4e7, 2e-3), (DAMAGE, 4e6, 3e-4)],
    ids=["one solution", "jumps"],
)
def test_an_exponential_film_is_followed_too(memory: Memory, falls_to: float, delta: float) -> None:
    """States and work are those of many small steps; energies close as exactly as along straight
    pieces."""
    A, c, loads = two_loads(30)
    body = remembering(A, c, law("exponential", a=2e7, b=falls_to, delta=delta), memory)
    steps = followed(body, loads)
    assert max(step.inclusion_residual for step in steps) <= 1e-10
    if falls_to == 1.4e7:
        for step, other in zip(steps, in_parts(body, loads, 16), strict=True):
            assert step.v == pytest.approx(other.v, abs=1e-3 * np.max(np.abs(steps[0].v)))
            assert step.work == pytest.approx(other.work, rel=1e-2)
    assert (sum(step.jumps for step in steps) > 0) == (falls_to == 4e6)


def test_nodes_that_are_pushed_back_before_a_front_are_not_seen_by_one_descent() -> None:
    """The path is the limit of small steps. Ã of cells longer than the strip is high is positive
    off its diagonal."""
    m = 10
    B = np.eye(m) - np.eye(m, k=-1)
    A = B.T @ (np.eye(m) - 0.2 * (np.eye(m, k=1) + np.eye(m, k=-1))) @ B
    body = remembering(A, np.ones(m), law("tresca", tau=1.0), FRICTION)
    loads = [np.append(np.zeros(m - 1), pull) for pull in (0.7 * m, 0.0)]
    exact = followed(body, loads)[-1].v
    apart = [
        np.max(np.abs(in_parts(body, loads, k)[-1].v - exact)) / np.max(exact) for k in (1, 16, 128)
    ]
    assert apart[0] > 0.02
    assert apart[2] < 0.2 * apart[1] < 0.1 * apart[0]
