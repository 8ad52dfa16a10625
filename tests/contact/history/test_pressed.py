"""Histories with Coulomb's friction: a block on springs in closed form, balance of energies."""

import numpy as np
import pytest

import tcstudy
from tcstudy.contact.history.memory import HistoryProblem, HistoryStep, MemoryModel
from tcstudy.contact.history.pressed import pressed_history
from tcstudy.contact.pressure_friction import PressureFriction
from tcstudy.contact.problem import CondensedBody
from tcstudy.laws.laws import NONE, Laws
from tcstudy.laws.shapes import unilateral
from tcstudy.scene.histories import Memory

MU, ALONG, ACROSS = 0.3, 2.0, 5.0


def block_history(loads: np.ndarray) -> list[HistoryStep]:
    """Steps of a block of 0.5 m on springs, loads (n, 2) along and away from its base [N/m]."""
    body = CondensedBody.of(np.diag([ALONG, ACROSS]), np.full(2, 0.5))
    laws = Laws.of([NONE, unilateral()], [0, 1])
    names = np.array(["friction", "damage"])
    model = MemoryModel(Memory("friction"), laws, 2, names)
    row = np.arange(1)
    coefficient = tcstudy.law("tresca", tau=MU)
    friction = PressureFriction(row, row + 1, coefficient, np.array([True]), np.zeros(1))
    return list(pressed_history(HistoryProblem(body, model), friction, list(loads)))


def cycle(steps: int) -> np.ndarray:
    """Pulls 0, 6, −6, 6 under a push of 10 N/m."""
    pulls = np.concatenate(
        [np.linspace(a, b, steps + 1)[1:] for a, b in [(0, 6), (6, -6), (-6, 6)]]
    )
    return np.column_stack([pulls, np.full(len(pulls), -10.0)])


def test_a_cycle_is_that_of_a_slider_with_a_spring() -> None:
    """It sticks while |F − 2 u| < 3 and follows F = 2 u ± 3 else; the loop has 2·3·2·1.5 J/m."""
    steps = block_history(cycle(24))
    assert all(step.solved for step in steps)
    slip = 0.0
    for (pull, _), step in zip(cycle(24), steps, strict=True):
        slip = float(np.clip(slip, (pull - 3.0) / 2.0, (pull + 3.0) / 2.0))
        assert step.v == pytest.approx([slip, 0.0], abs=1e-12)
    assert sum(step.dissipated for step in steps[24:]) == pytest.approx(2 * 3.0 * 3.0, rel=1e-12)


def test_energies_balance_and_the_closure_falls_with_the_steps() -> None:
    """The push changes while the block slips and lifts it off in the middle."""
    closures = []
    for count in (20, 40, 80):
        t = np.linspace(0.0, 1.0, count + 1)[1:]
        loads = np.column_stack([6.0 * np.sin(2 * np.pi * t), 4.0 - 14.0 * np.abs(np.cos(3 * t))])
        steps = block_history(loads)
        assert all(step.identity < 1e-14 for step in steps)
        assert all(step.dissipated >= 0.0 for step in steps)
        assert any(step.v[1] > 0.0 for step in steps)
        total = sum(step.dissipated + step.closure - step.work for step in steps)
        assert steps[-1].energy + total == pytest.approx(0.0, abs=1e-12)
        closures.append(sum(abs(step.closure) for step in steps))
    assert closures[0] > 1.8 * closures[1] > 1.8**2 * closures[2]
    assert closures[2] < 0.2
