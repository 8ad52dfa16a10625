"""Steps that fail say why; iterations of both runs and jumps of a loop are counted."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from tcstudy.contact.history import steps
from tcstudy.contact.history.memory import HistoryStep
from tcstudy.contact.history.steps import ContinuedStep, history, hysteresis, lowest
from tcstudy.contact.problem import ContactProblem, Status
from tcstudy.contact.solve import Answer, solve_contact
from tcstudy.scene.histories import Memory
from tests.contact.history.cases import coupled_line, remembering, softening
from tests.contact.path.cases import a_solution, random_path_problem

FRICTION = Memory("friction")


def test_a_step_that_no_path_and_no_descent_leads_on_fails(monkeypatch: pytest.MonkeyPatch) -> None:
    A, c, load = coupled_line(10)
    body = remembering(A, c, softening(), FRICTION)

    def stuck(step: ContinuedStep) -> bool:
        step.reason = "no way"
        return False

    monkeypatch.setattr(ContinuedStep, "_path_on", lambda step: None)
    monkeypatch.setattr(ContinuedStep, "_go_elsewhere", stuck)
    ended = list(history(body, [3.0 * load, 4.0 * load]))
    assert [step.status for step in ended] == [Status.STALLED]
    assert ended[0].reason == "the path inside the step ends at 0 of it: no way; make more steps"


def test_a_step_of_too_many_parts_fails(monkeypatch: pytest.MonkeyPatch) -> None:
    """Two loads, one taken off as the other grows: nodes turn back one after the other."""
    A, c, load = coupled_line(20)
    place = np.linspace(0.0, 1.0, 20)
    first, second = load * (place < 0.6), -load * (place > 0.3)
    body = remembering(A, c, softening(), FRICTION)
    monkeypatch.setattr(steps, "MAX_PARTS", 1)
    ended = list(history(body, [4.0 * first, first + 4.0 * second, -1.5 * first]))
    assert [step.status for step in ended[1:]] == [Status.CONVERGED, Status.STALLED]
    assert "reverses its slip or jumps more than 1 times" in ended[2].reason


def test_a_step_from_the_convex_model_counts_the_iterations_of_both_runs(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    A, c, load = coupled_line(10)
    body = remembering(A, c, softening(), FRICTION, "lowest")
    expected = lowest(body, HistoryStep.virgin(10), 3.0 * load)
    runs = list[int]()

    def loose_at_first(problem: ContactProblem, **options: Any) -> Answer:
        answer = solve_contact(problem, **options)
        if not runs:
            answer = replace(answer, status=Status.NOT_POSITIVE_DEFINITE, iterations=100)
        runs.append(int(answer.iterations))
        return answer

    monkeypatch.setattr(steps, "solve_contact", loose_at_first)
    step = lowest(body, HistoryStep.virgin(10), 3.0 * load)
    assert len(runs) == 2
    assert step.iterations == sum(runs)
    assert step.v == pytest.approx(expected.v, rel=1e-9)


def test_jumps_of_a_loop_are_counted_up_to_the_turning_point() -> None:
    counted = 0
    for seed in range(3):
        problem = random_path_problem(np.random.default_rng([seed, 71]), 12)
        loop = hysteresis(problem, a_solution(problem, -2.0), -2.0, 2.0)
        rises = [loop.ways[jump.ways].t[-1] > loop.ways[jump.ways].t[0] for jump in loop.jumps]
        assert sorted(rises, reverse=True) == rises
        assert loop.there == sum(rises)
        counted += 0 < loop.there < len(rises)
    assert counted > 0
