"""Energy lost against area, jumps that lower the energy, loops of all but no friction; known
derivatives."""

from collections.abc import Callable

import numpy as np
import pytest

from tcstudy.contact.history.steps import hysteresis
from tcstudy.contact.path.follow import ParametricProblem
from tcstudy.laws import shapes as laws
from tcstudy.laws.composed import nodal
from tcstudy.study.history_run import MIDDLE_STEP, STEPS, derivative
from tests.contact import contact_cases as cases
from tests.contact.path.cases import a_solution, random_path_problem


@pytest.mark.parametrize("seed", range(6))
def test_energy_lost_is_the_area_of_the_loop(seed: int) -> None:
    """Two independent sums, for random laws with both kinds of jumps; every fall goes down and ends
    on a solution."""
    problem = random_path_problem(np.random.default_rng([seed, 71]), 12)
    loop = hysteresis(problem, a_solution(problem, -2.0), -2.0, 2.0)
    assert not loop.reason
    assert loop.closed
    size = max(
        abs(problem.at(t).energy(v)) for way in loop.ways for t, v in zip(way.t, way.v, strict=True)
    )
    assert loop.lost == pytest.approx(loop.area, abs=1e-11 * size)
    for jump in loop.jumps:
        assert jump.released > 0.0
        assert problem.at(jump.t).inclusion_residual(jump.v_to, 1e-13) <= 1e-11


@pytest.mark.parametrize("unit", [1e-9, 1e6])
@pytest.mark.parametrize("law", ["none", "weak", "spring", "patch"])
def test_loops_close_where_friction_is_nothing_against_the_load(law: str, unit: float) -> None:
    """Loads of 1e6 beside friction of 1, 0 or none but that of a spring; t in any unit; slips by
    one linear solve."""
    shape = {"none": laws.linear(0.0), "spring": cases.spring(3.0)}.get(law, laws.tresca(1.0))
    for seed in range(4):
        rng = np.random.default_rng([seed, 5])
        A, c = cases.random_stiffness(rng, 12)
        l_1 = 1e6 * c * rng.normal(size=12)
        nodes = nodal([shape], np.zeros(12, dtype=int), (rng.random(12) < 0.4).astype(float))
        problem = ParametricProblem(
            A, np.zeros(12), l_1 / unit, c, nodes if law == "patch" else shape, (0.0, unit)
        )
        loop = hysteresis(problem, np.zeros(12), 0.0, unit)
        assert not loop.reason
        assert (loop.closed, loop.jumps, loop.lost) == (True, [], 0.0)
        v = np.linalg.solve(A + np.diag(c * (3.0 if law == "spring" else 0.0)), l_1)
        bound = 1e-11 if law in ("none", "spring") else 1e-4
        assert np.max(np.abs(loop.ways[0].v[-1] - v)) <= bound * np.max(np.abs(v))


Function = Callable[[float], float]


def both(f: Function, p: float) -> tuple[float, float]:
    """By both sides, and from above alone, at p in units of p."""
    middle = np.array([f(p)])
    above, below = (
        np.array([[f(p * (1.0 + way * h))] for h in (*STEPS, MIDDLE_STEP)]) for way in (1.0, -1.0)
    )
    beside = np.concatenate([above[:2], below[:2]])
    return float(derivative(middle, beside, p)[0]), float(derivative(middle, above, p)[0])


def test_known_functions_in_any_units_and_where_both_sides_differ() -> None:
    for f, slope in (
        (lambda x: x**3, 27.0),
        (lambda x: np.sqrt(x - 2.75), 1.0),
        (lambda x: 7.0, 0.0),
    ):
        for p in (3e-9, 3e9):
            assert both(lambda x, f=f, p=p: f(3.0 * x / p), p) == pytest.approx(
                (3.0 / p * slope,) * 2, rel=1e-5
            )
    assert np.isnan(both(lambda x: abs(x - 1.0) + x, 1.0)[0])
    assert np.isnan(both(lambda x: float(x > 1.0), 1.0)[0])
    beside, farther = 1.0 + 0.3 * STEPS[1], 1.0 + 2.0 * STEPS[1]
    assert np.all(np.isnan(both(lambda x: max(x - beside, 0.0) + x, 1.0)))
    assert both(lambda x: max(x - farther, 0.0) + x, 1.0)[0] == pytest.approx(1.0, rel=1e-9)
    assert both(lambda x: max(x - farther, 0.0) + x**2, 1.0)[0] == pytest.approx(
        2.0, rel=1e-9
    )  # bent as well
