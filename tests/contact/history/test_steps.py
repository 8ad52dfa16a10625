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
from tests.contact.history.cases import coupled_line, remembering, softening, strip

Array = NDArray[np.float64]
TRESCA = law("tresca", tau=2e7)
FALLING = law(points=[(0.0, 1.0), (0.4, 0.2)])


def followed(body: HistoryProblem, loads: list[Array]) -> list[HistoryStep]:
    """All steps, every one solved, its energies in order."""
    steps = list(history(body, loads))
    assert [step.reason for step in steps] == [""] * len(loads)
    before = HistoryStep.virgin(body.body.m)
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
    body = remembering(A, c, TRESCA, memory)
    for e_2 in (1.0, -1.0, -3.0):
        first, back = followed(body, [3.0 * load, e_2 * load])
        (half,) = followed(body, [0.5 * (3.0 - e_2) * load])
        assert 0 < np.count_nonzero(half.kappa) <= body.body.m
        for name in ("v", "plastic"):
            whole = getattr(first, name)
            expected = whole - 2.0 * getattr(half, name)
            assert getattr(back, name) == pytest.approx(expected, abs=1e-11 * (np.max(np.abs(whole)) or 1.0))
        assert back.xi == pytest.approx(first.xi - 2.0 * half.xi, abs=1e-11 * np.max(np.abs(first.xi)))
        assert back.unique


def test_secants_scale_and_dissipate_nothing() -> None:
    """Damage to e₁, then e in [−e₁, e₁]: v = (e/e₁) v(e₁), ξ likewise, D = 0; beyond e₁ the film goes on to break."""
    A, c, load = coupled_line(80)
    body = remembering(A, c, softening(), Memory("damage"))
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


BRANCHES = pytest.mark.parametrize("branch", ["continued", "lowest"])


def walking(cells: int, hot: float, cycles: int, branch: HistoryBranch) -> list[HistoryStep]:
    """H4: pipeline of 2000 m pulled by 0.3 MN at its right end, r = 1 kN/m, warmed by `hot` and cooled again."""
    D = 3.2913e9
    A, c, heat = strip(cells, 2000.0, D, held=False)
    pull = np.zeros(cells + 1)
    pull[-1] = 0.3e6
    body = remembering(A, c, law("tresca", tau=1e3), Memory("friction"), branch, loose=True)
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


def test_one_cell_lowest() -> None:
    """H8 by least energy: s = 0.6 already at U = 0.8, energy 0.30 against 0.32 of rest."""
    body = remembering(np.eye(1), np.ones(1), law(points=[(0.0, 1.0), (0.4, 0.2)]), Memory("friction"), branch="lowest")
    assert body.margin == -1.0
    steps = followed(body, [np.array([U]) for U in (0.8, 1.2, 0.8, 0.4, -0.2, 1.4)])
    assert [step.v[0] for step in steps] == pytest.approx([0.6, 1.0, 1.0, 0.6, 0.0, 1.2], abs=1e-14)
    assert [step.xi[0] for step in steps] == pytest.approx([0.2, 0.2, -0.2, -0.2, -0.2, 0.2], abs=1e-14)
    first = steps[0]
    assert first.energy + first.dissipated + 0.5 * 0.8**2 == pytest.approx(0.30, abs=1e-15)
    assert all(step.global_minimum for step in steps)
