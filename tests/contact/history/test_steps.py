"""steps: exact rules on any body (Masing, secants), closed forms of rails, pipelines and single cells, energies."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from numpy.typing import NDArray

from tcstudy.contact.history.problem import HistoryProblem, HistoryStep
from tcstudy.contact.history.steps import history
from tcstudy.contact.status import Status
from tcstudy.matrices import law
from tcstudy.scene.histories import HistoryBranch, Memory
from tests.contact.history.cases import coupled_line, softening, strip

Array = NDArray[np.float64]
TRESCA = law("tresca", tau=2e7)
FALLING = law(points=[(0.0, 1.0), (0.4, 0.2)])


def followed(body: HistoryProblem, loads: list[Array]) -> list[HistoryStep]:
    """All steps, every one solved, its energies in order."""
    steps = list(history(body, loads))
    assert [step.reason for step in steps] == [""] * len(loads)
    before = HistoryStep.virgin(body.m)
    for step in steps:
        check_energies(body, before, step)
        before = step
    return steps


def check_energies(body: HistoryProblem, before: HistoryStep, step: HistoryStep) -> None:
    """The identity to rounding, what is dissipated, and the two-sided estimate where each state is the lowest."""
    assert step.identity <= 1e-14
    assert np.all(step.kappa >= before.kappa)
    assert step.dissipated >= 0.0
    change = step.load - before.load
    gained = step.energy - before.energy + step.stored - before.stored + step.dissipated
    size = abs(step.energy) + abs(before.energy) + step.stored + before.stored + abs(step.work) + step.dissipated
    assert gained + step.closure + step.released == pytest.approx(step.work, abs=1e-12 * size)
    if body.branch == "lowest":
        assert gained <= -change @ before.v + 1e-12 * size
        if step.unique:
            assert gained >= -change @ step.v - 1e-12 * size


@pytest.mark.parametrize("memory", [Memory("friction"), Memory("elastic-plastic", 3e10)], ids=lambda m: m.name)
def test_masing(memory: Memory) -> None:
    """v(e₁ → e₂) = v(e₁) − 2 v((e₁ − e₂)/2), for slips, forces and plastic slips alike."""
    A, c, load = coupled_line(80)
    body = HistoryProblem(A, c, TRESCA, memory)
    for e_2 in (1.0, -1.0, -3.0):
        first, back = followed(body, [3.0 * load, e_2 * load])
        (half,) = followed(body, [0.5 * (3.0 - e_2) * load])
        assert 0 < np.count_nonzero(half.kappa) <= body.m
        for name in ("v", "plastic"):
            whole = getattr(first, name)
            expected = whole - 2.0 * getattr(half, name)
            assert getattr(back, name) == pytest.approx(expected, abs=1e-11 * (np.max(np.abs(whole)) or 1.0))
        assert back.xi == pytest.approx(first.xi - 2.0 * half.xi, abs=1e-11 * np.max(np.abs(first.xi)))
        assert back.unique


def test_secants_scale_and_dissipate_nothing() -> None:
    """Damage to e₁, then e in [−e₁, e₁]: v = (e/e₁) v(e₁), ξ likewise, D = 0; beyond e₁ the film goes on to break."""
    A, c, load = coupled_line(80)
    body = HistoryProblem(A, c, softening(), Memory("damage"))
    factors = [3.0, 1.0, 0.0, -2.0, -3.0, -4.0]
    steps = followed(body, [e * load for e in factors])
    first = steps[0]
    for e, step in list(zip(factors, steps, strict=True))[1:5]:
        size = np.max(np.abs(first.v)), np.max(np.abs(first.xi))
        assert step.v == pytest.approx(e / 3.0 * first.v, abs=1e-11 * size[0])
        assert step.xi == pytest.approx(e / 3.0 * first.xi, abs=1e-11 * size[1])
        assert step.dissipated <= 1e-12 * first.dissipated
        assert abs(step.closure) <= 1e-12 * abs(first.energy)
    assert steps[-1].dissipated > 0.05 * first.dissipated
    assert all(step.unique and step.global_minimum for step in steps)


def test_a_full_reversal_returns_to_the_virgin_curve_and_cycles_close() -> None:
    """Beyond ±e₁ the virgin curve goes on; the second of two equal cycles dissipates what the first did and closes."""
    A, c, load = coupled_line(60)
    body = HistoryProblem(A, c, TRESCA, Memory("friction"))
    steps = followed(body, [e * load for e in (2.0, -2.0, 2.0, -2.0, 2.0, 3.0)])
    (virgin,) = followed(body, [3.0 * load])
    v = [step.v for step in steps]
    size = np.max(np.abs(v[0]))
    assert v[1] == pytest.approx(-v[0], abs=1e-12 * size)
    assert v[4] == pytest.approx(v[2], abs=1e-12 * size)
    assert steps[3].dissipated + steps[4].dissipated == pytest.approx(
        steps[1].dissipated + steps[2].dissipated, rel=1e-12
    )
    assert v[5] == pytest.approx(virgin.v, abs=1e-12 * size)


@pytest.mark.parametrize(
    ("memory", "law"),
    [
        (Memory("friction"), TRESCA),
        (Memory("friction"), softening()),
        (Memory("elastic-plastic", 3e10), softening()),
        (Memory("damage"), softening()),
    ],
    ids=["tresca", "friction", "elastic-plastic", "damage"],
)
def test_the_same_load_again_changes_nothing(memory: Memory, law: object) -> None:
    """To the bit; and the last state is a solution of the next step's own problem: b̂ⁿ(vⁿ⁻¹) ∋ ξⁿ⁻¹/c."""
    A, c, load = coupled_line(40)
    body = HistoryProblem(A, c, law, memory)  # type: ignore[arg-type]
    first, again, back, there = followed(body, [2.0 * load, 2.0 * load, -1.0 * load, -1.0 * load])
    for one, two in ((first, again), (back, there)):
        for name in ("v", "kappa", "plastic"):
            assert np.array_equal(getattr(one, name), getattr(two, name))
        assert np.array_equal(one.xi, two.xi)
        assert (two.dissipated, two.work) == (0.0, 0.0)
        problem = body.problem(one, one.load)
        assert problem.inclusion_residual(one.v - body.model.origin(one)) <= 1e-12


def test_softening_by_accumulated_slip_is_forgotten_by_nobody() -> None:
    """κ = Σ|Δv|: what has slid to and fro is weaker than what has slid there at once."""
    A, c, load = coupled_line(40)
    there = [e * load for e in (2.5, -2.5, 2.5, -2.5, 2.5)]
    body = HistoryProblem(A, c, softening(), Memory("friction"))
    steps = followed(body, there)
    assert np.sum(steps[2].v) > 1.0001 * np.sum(steps[0].v)
    assert steps[-1].kappa == pytest.approx(
        np.sum(np.abs(np.diff([np.zeros(40), *(step.v for step in steps)], axis=0)), axis=0), rel=1e-12
    )


# H1: D u″ = r, E 210 GPa, 76.70 cm², r = 10 kN/m a rail, α 1.2e-5, 140 m, its middle held
RAIL = {40: 18.555264, 20: 16.235856, 0: 9.277632, -40: -18.555264, 1: -9.277632, 60: 41.749344}
"""End displacement [mm] at 40, 20, 0, −40, 0 again and 60 K."""


BRANCHES = pytest.mark.parametrize("branch", ["continued", "lowest"])


@BRANCHES
def test_rail_end_through_a_cycle(branch: HistoryBranch) -> None:
    """v = D ε²/2r, after a reversal by δ D δ²/4r less: half of it stays at 0 K; dissipated D² ε³/6r, D² δ³/24r."""
    D, r, cells = 210e9 * 76.70e-4, 10e3, 140
    A, c, heat = strip(cells, 140.0, D)
    body = HistoryProblem(A, c, law("tresca", tau=r), Memory("friction"), branch)
    steps = followed(body, [1.2e-5 * theta * heat for theta in (40, 20, 0, -40, 0, 60)])
    assert [1e3 * step.v[-1] for step in steps] == pytest.approx(list(RAIL.values()), rel=3e-4)
    spent = [step.dissipated for step in steps]
    assert spent[0] == pytest.approx(4781.914, rel=2e-4)
    assert sum(spent[1:4]) == pytest.approx(9563.828, rel=2e-4)
    tension = np.cumsum((c * steps[2].xi)[::-1])[::-1]  # between the end and each node
    assert np.max(np.abs(tension)) == pytest.approx(386.568e3, rel=0.5 * 140.0 / cells / 38.6568 * 2)
    missed = {"continued": 0.0, "lowest": -0.5}[branch]
    assert steps[0].closure / spent[0] == pytest.approx(missed, rel=5e-3, abs=1e-12)


def walking(cells: int, hot: float, cycles: int, branch: HistoryBranch) -> list[HistoryStep]:
    """H4: pipeline of 2000 m pulled by 0.3 MN at its right end, r = 1 kN/m, warmed by `hot` and cooled again."""
    D = 3.2913e9
    A, c, heat = strip(cells, 2000.0, D, held=False)
    pull = np.zeros(cells + 1)
    pull[-1] = 0.3e6
    body = HistoryProblem(A, c, law("tresca", tau=1e3), Memory("friction"), branch, held=False)
    loads = [pull, *(1.17e-5 * theta * heat + pull for theta in (hot, 0.0) * cycles)]
    steps = list(history(body, loads))
    for before, step in pairwise(steps):
        if step.solved:
            check_energies(body, before, step)
    return steps


@BRANCHES
def test_a_pipeline_that_only_friction_holds_walks(branch: HistoryBranch) -> None:
    """(ε − (rL − S)/D) S/r a cycle, every point alike, to rounding where both anchors are nodes; 0 below 44.1 K."""
    steps = walking(40, 60.0, 4, branch)
    assert all(step.solved and step.unique for step in steps)
    walked = np.diff([step.v for step in steps[2::2]], axis=0)
    assert walked == pytest.approx(55.64603e-3, abs=5e-9)
    assert np.ptp(walked) <= 1e-12
    if branch == "continued":
        assert all(abs(step.closure) <= 1e-12 * step.dissipated for step in steps)
    still = walking(40, 40.0, 3, branch)
    assert np.max(np.abs(still[-1].v - still[-3].v)) <= 1e-12


@BRANCHES
def test_a_walk_that_is_not_determined_says_so(branch: HistoryBranch) -> None:
    """Where an anchor is the middle of a cell, all nodes slide at their limit and the body may lie anywhere."""
    steps = walking(100, 60.0, 1, branch)
    assert not steps[-1].solved
    assert steps[-1].status == Status.NOT_POSITIVE_DEFINITE
    assert "not determined" in steps[-1].reason


@BRANCHES
def test_a_pipeline_that_is_pulled_away_fails(branch: HistoryBranch) -> None:
    """More pull than all friction: no equilibrium, and the history ends there with its reason."""
    A, c, _ = strip(20, 20.0, 1e9, held=False)
    body = HistoryProblem(A, c, law("tresca", tau=1e3), Memory("friction"), branch, held=False)
    pull = np.zeros(21)
    pull[-1] = 1.0
    steps = list(history(body, [f * 20e3 * pull for f in (0.9, 1.1, 0.5)]))
    assert [step.solved for step in steps] == [True, False]
    assert steps[-1].reason


def test_one_cell_lowest() -> None:
    """H8 by least energy: s = 0.6 already at U = 0.8, energy 0.30 against 0.32 of rest."""
    body = HistoryProblem(
        np.eye(1), np.ones(1), law(points=[(0.0, 1.0), (0.4, 0.2)]), Memory("friction"), branch="lowest"
    )
    assert body.margin == -1.0
    steps = followed(body, [np.array([U]) for U in (0.8, 1.2, 0.8, 0.4, -0.2, 1.4)])
    assert [step.v[0] for step in steps] == pytest.approx([0.6, 1.0, 1.0, 0.6, 0.0, 1.2], abs=1e-14)
    assert [step.xi[0] for step in steps] == pytest.approx([0.2, 0.2, -0.2, -0.2, -0.2, 0.2], abs=1e-14)
    first = steps[0]
    assert first.energy + first.dissipated + 0.5 * 0.8**2 == pytest.approx(0.30, abs=1e-15)
    assert all(step.global_minimum for step in steps)
