"""hysteresis: loops in closed form, energy lost against area, jumps that lower the energy."""

from __future__ import annotations

import numpy as np
import pytest

from tcstudy.contact.history.hysteresis import hysteresis
from tcstudy.contact.path.follow import ParametricProblem
from tcstudy.laws import shapes as laws
from tcstudy.laws.composed import nodal
from tests.contact import contact_cases as cases
from tests.contact.path.cases import a_solution, one_node, random_path_problem, softening_line


def test_loop_of_one_softening_node_in_closed_form() -> None:
    """Falls from s = 0 to 0.8 at t = 1 (0.16 lost) and from 0.4 to 0 at t = 0.6 (0.08 lost)."""
    loop = hysteresis(one_node(cases.slip_weakening(1.0, 0.2, 0.4)), np.zeros(1), 0.3, 1.5)
    assert loop.closed
    assert loop.complete
    assert [jump.t for jump in loop.jumps] == pytest.approx([1.0, 0.6], abs=1e-13)
    assert [jump.released for jump in loop.jumps] == pytest.approx([0.16, 0.08], abs=1e-13)
    assert [float(jump.v_to[0]) for jump in loop.jumps] == pytest.approx([0.8, 0.0], abs=1e-13)
    assert loop.lost == pytest.approx(0.24, abs=1e-13)
    assert loop.area == pytest.approx(0.24, abs=1e-13)


@pytest.mark.parametrize("seed", range(8))
def test_energy_lost_is_the_area_of_the_loop(seed: int) -> None:
    """Two independent sums, for random laws with both kinds of jumps; every fall goes down and ends on a solution."""
    problem = random_path_problem(np.random.default_rng([seed, 71]), 12)
    loop = hysteresis(problem, a_solution(problem, -2.0), -2.0, 2.0)
    assert loop.complete, loop.reason
    assert loop.closed
    size = max(abs(problem.at(t).energy(v)) for way in loop.ways for t, v in zip(way.t, way.v, strict=True))
    assert loop.lost == pytest.approx(loop.area, abs=1e-11 * size)
    for jump in loop.jumps:
        assert jump.released > 0.0
        assert problem.at(jump.t).inclusion_residual(jump.v_to, 1e-13) <= 1e-11


@pytest.mark.parametrize("seed", [15, 16, 19])
def test_every_fall_leads_elsewhere_beside_nodes_whose_bond_is_all_but_gone(seed: int) -> None:
    """A node of strength 1e-9, ever near its kink, must not blur on which kink another one stands that sticks again."""
    rng, m = np.random.default_rng(seed), 20
    plain = softening_line(m, float(rng.choice([0.02, 0.05, 0.2, 0.5])), seed=seed)
    strength = np.ones(m)
    strength[rng.integers(m, size=3)] = 10.0 ** rng.uniform(-13.0, -6.0, 3)
    law = cases.slip_weakening(1.0, 0.0, float(rng.choice([0.02, 0.1, 0.5])))
    loop = hysteresis(plain.with_law(nodal([law], np.zeros(m, dtype=int), strength)), np.zeros(m), 0.0, 3.0)
    assert loop.complete
    size = max(float(np.max(np.abs(way.v))) for way in loop.ways)
    assert all(np.max(np.abs(jump.v_to - jump.v_from)) > 1e-6 * size for jump in loop.jumps)


@pytest.mark.parametrize("unit", [1e-9, 1.0, 1e6])
@pytest.mark.parametrize("law", ["none", "weak", "spring", "patch"])
def test_loops_close_where_friction_is_nothing_against_the_load(law: str, unit: float) -> None:
    """Loads of 1e6 beside friction of 1, 0 or none but that of a spring; t in any unit; slips by one linear solve."""
    for seed in range(6):
        rng = np.random.default_rng([seed, 5])
        A, c = cases.random_stiffness(rng, 12)
        l_1 = 1e6 * c * rng.normal(size=12)
        shape = {"none": laws.linear(0.0), "spring": cases.spring(3.0)}.get(law, laws.tresca(1.0))
        nodes = nodal([shape], np.zeros(12, dtype=int), (rng.random(12) < 0.4).astype(float))
        problem = ParametricProblem(A, np.zeros(12), l_1 / unit, c, nodes if law == "patch" else shape, (0.0, unit))
        loop = hysteresis(problem, np.zeros(12), 0.0, unit)
        assert loop.complete, loop.reason
        assert loop.closed
        assert not loop.jumps
        assert loop.lost == 0.0
        slope = 3.0 if law == "spring" else 0.0
        v = np.linalg.solve(A + np.diag(c * slope), l_1)
        assert np.max(np.abs(loop.ways[0].v[-1] - v)) <= 1e-4 * np.max(np.abs(v))
        if law in ("none", "spring"):
            assert np.max(np.abs(loop.ways[0].v[-1] - v)) <= 1e-11 * np.max(np.abs(v))
