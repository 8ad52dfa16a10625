"""The default over the whole stability map on small budget: it never fails silently; map, picture and text are made."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tcstudy.contact.contact import solve_contact
from tcstudy.contact.status import Status
from tests.benchmarks import stability
from tests.benchmarks.methods import TOLERANCE
from tests.benchmarks.stability_chain import CHAIN, SHAPE, WEAK, ChainGrid, chain
from tests.benchmarks.stability_maps import MAPS, Grid, down_jumps, synthetic, up_jumps
from tests.benchmarks.stability_measure import FLAGGED, SILENT, SLOW, SOLVED, judged, measure, read
from tests.benchmarks.stability_trial import CONTENDERS, Contender, Trial
from tests.contact.contact_cases import independent_residual

EDGES = (0.1, 1.33, 7.5, 100.0)
SYNTHETIC = Grid(EDGES, (10, 100, 300), (0.01, 0.3, 0.9), (1, 10, 100), (-9, 0, 9), loads=2)
REAL = ChainGrid(
    EDGES, (0.3, 0.4999, 0.4999999), (1e-12, 1.0, 1e12), (1.0, 30.0, 1000.0), (1.0, 1e3, 1e6), (1.0, 1e6, 1e12), 2
)


def test_the_default_never_fails_silently() -> None:
    """Every answer is a solution in extended precision, or is a failure with a status and a reason."""
    seen, flagged = set(), set()
    for cases in (synthetic(SYNTHETIC), chain(REAL)):
        for case in cases:
            answer = solve_contact(case.problem)
            where = f"{case.map}, x = {case.x:g}, y = {case.y:g}, load {case.load}"
            seen.add(case.map)
            if answer.status == Status.CONVERGED:
                allowed = max(TOLERANCE, answer.rounding) if answer.limited else TOLERANCE
                assert independent_residual(case.problem, answer.v, answer.v_low) <= allowed, where
            else:
                assert answer.reason, where
                assert answer.inclusion_residual > TOLERANCE, where
                flagged.add(case.map)
            assert not case.heat_balance > 1e-12 or case.map == SHAPE, where
    assert seen == {*MAPS, *CHAIN}
    assert flagged <= {SHAPE, WEAK}  # cancellation: thin layers, slender bodies, friction lost in the load


def test_at_the_edge_of_cancellation_no_claim_is_wrong() -> None:
    """Where rounding of ξ = l̃ − Ãv is of the size of the tolerance, the package judges in extended precision, too."""
    largest = 0.0
    for case in chain(ChainGrid((*EDGES, 0.562), (), (), (), (), (1e4, 1e5), loads=3)):
        answer = solve_contact(case.problem)
        residual = independent_residual(case.problem, answer.v, answer.v_low)
        largest = max(largest, residual)
        allowed = max(TOLERANCE, answer.rounding) if answer.limited else TOLERANCE
        assert answer.status != Status.CONVERGED or residual <= allowed
        assert answer.status == Status.CONVERGED or answer.reason
    assert largest > 0.1 * TOLERANCE


def test_a_silent_failure_would_be_seen() -> None:
    """The judge takes nobody's word."""
    case = next(synthetic(replace(SYNTHETIC, loads=1)))
    liar = Contender("liar", lambda problem, deadline: Trial(np.zeros(problem.m), True, 1))
    honest = Contender("honest", lambda problem, deadline: Trial(np.zeros(problem.m), False, 1, "gave up"))
    late = Contender("late", lambda problem, deadline: Trial(None, False, 1, "time limit", slow=True))
    rows = list(measure([case], (liar, honest, late, CONTENDERS[0])))
    assert [row.outcome for row in rows] == [SILENT, FLAGGED, SLOW, SOLVED]
    assert judged(float("nan"), Trial(None, True, 1)) == SILENT


@pytest.mark.parametrize(("shape", "kind"), [(down_jumps, -1), (up_jumps, 1)])
def test_the_laws_have_the_jumps_they_are_named_for(shape: type, kind: int) -> None:
    law = shape(0.3, 5)
    law.check_growth()
    assert np.all(np.sort(law.kinds * kind)[:-1] == kind) or kind < 0
    jumps = (law.b_right - law.b_left)[law.kinks > 0.0]
    assert jumps == pytest.approx(kind * 0.3)
    assert law.b(np.array([1e-9])) == pytest.approx(1.0, rel=1e-6)
    assert law.omega == (np.inf if kind < 0 else pytest.approx(0.3 * 5 / 0.3))
    assert law.b(np.array([-0.11])) == -law.b(np.array([0.11]), -1)


def test_the_command_on_a_small_grid(tmp_path: Path) -> None:
    """Lines, and the picture from the stored lines alone."""
    stored = tmp_path / "stability.csv"
    grid = Grid((0.1, 10.0), (10,), (0.6,), (3,), (-9, 9), loads=1)
    real = ChainGrid((0.1, 10.0), (0.3,), (1e-12,), (1.0, 1000.0), (1.0, 1e6), (1.0, 1e12), 1)
    stability.run(stored, grid, real, 0.2)
    stability.main(["--draw", "--output", str(tmp_path)])
    rows = read(stored)
    assert {row.map for row in rows} == {*MAPS, *CHAIN}
    assert 10_000 < (tmp_path / "stability-small.png").stat().st_size < 300_000
