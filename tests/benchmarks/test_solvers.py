"""The default never fails silently, solvers are judged rightly, kills lose nothing, spoilt studies
get clear lines."""

from importlib import import_module
from pathlib import Path

import numpy as np
import pytest

from tcstudy.contact.problem import Status
from tcstudy.contact.solve import solve_contact
from tests.benchmarks import gallery
from tests.benchmarks.cases import (
    SHAPE,
    WEAK,
    Case,
    Grid,
    down_jumps,
    families,
    real,
    synthetic,
    up_jumps,
)
from tests.benchmarks.kills import survive
from tests.benchmarks.mutated import sources, survey
from tests.benchmarks.peers import PEERS, TOLERANCE, Solve, markdown, measure
from tests.benchmarks.semismooth import semismooth_newton
from tests.contact.contact_cases import independent_residual

EDGES = (0.1, 1.33, 7.5, 100.0)
SMALL = Grid(
    EDGES, (10, 100, 200), (0.01, 0.3, 0.9), (1, 10, 100), (-9, 0, 9), (0.3, 0.4999, 0.4999999), (1e-12, 1.0, 1e12),
    (1.0, 30.0, 1000.0), (1.0, 1e3, 1e6), (1.0, 1e6, 1e12), 1,
)  # fmt: skip
EDGE = Grid((*EDGES, 0.562), nu=(), alpha=(), aspects=(), thinner=(), excess=(1e4, 1e5), loads=1)
"""Where rounding of ξ = l̃ − Ãv is of the size of the tolerance, the package judges in extended
precision, too."""


def test_the_default_never_fails_silently() -> None:
    """Every answer is a solution in extended precision, or is a failure with a status and a
    reason."""
    seen, flagged, largest = set(), set(), 0.0
    for case in (*synthetic(SMALL), *real(SMALL), *real(EDGE)):
        answer = solve_contact(case.problem)
        where = f"{case.map}, x = {case.x:g}, y = {case.y:g}, load {case.load}"
        seen.add(case.map)
        residual = independent_residual(case.problem, answer.v, answer.v_low)
        if case.map == WEAK and case.y in EDGE.excess:
            largest = max(largest, residual)
        if answer.status == Status.CONVERGED:
            assert residual <= (max(TOLERANCE, answer.rounding) if answer.limited else TOLERANCE), (
                where
            )
        else:
            assert answer.reason, where
            assert answer.inclusion_residual > TOLERANCE, where
            flagged.add(case.map)
        assert not case.heat_balance > 1e-12 or case.map == SHAPE, where
    assert len(seen) == 8
    assert flagged <= {
        SHAPE,
        WEAK,
    }  # cancellation: thin layers, slender bodies, friction lost in the load
    assert largest > 0.1 * TOLERANCE


@pytest.mark.parametrize(("shape", "kind"), [(down_jumps, -1), (up_jumps, 1)])
def test_the_laws_have_the_jumps_they_are_named_for(shape: type, kind: int) -> None:
    law = shape(0.3, 5)
    law.check_growth()
    assert np.all(np.sort(law.kinds * kind)[:-1] == kind) or kind < 0
    assert (law.b_right - law.b_left)[law.kinks > 0.0] == pytest.approx(kind * 0.3)
    assert law.b(np.array([1e-9])) == pytest.approx(1.0, rel=1e-6)
    assert law.omega == (np.inf if kind < 0 else pytest.approx(0.3 * 5 / 0.3))


@pytest.fixture(scope="module")
def found() -> list[Solve]:
    """All methods on one load a family of 8 nodes."""
    return list(measure(families((8,), 1, body=False), repeats=1))


def test_every_method_is_run_and_judged(found: list[Solve]) -> None:
    """Powell stops with success=True on every problem; none is a solution, and the table says
    so."""
    ours = [one for one in found if one.method in ("separable-newton", "bundle-newton", "default")]
    assert len(found) == 4 * len(PEERS)
    assert all(one.solved and one.claims for one in ours)
    powell = [one for one in found if one.method == "Powell"]
    assert not any(one.solved for one in powell)
    assert any(one.claims for one in powell)
    text = "\n".join(markdown(found, 4))
    assert all(f"| {name} | " in text for name in PEERS)


def test_semismooth_newton_ends_exactly_or_says_that_it_cycles() -> None:
    """Judged by a residual that shares no code with the package; some of these cycle, most do
    not."""
    cases: list[Case] = [case for group in families((20,), 5, body=False) for case in group]
    converged = 0
    for case in cases:
        v, stop = semismooth_newton(case.problem, np.zeros(20))
        assert (independent_residual(case.problem, v) <= TOLERANCE) == (stop == ""), stop
        converged += stop == ""
    assert 10 <= converged < 20


MODULES = [path.stem for path in sorted(Path(__file__).parent.glob("[a-z]*.py"))]


@pytest.mark.parametrize("name", MODULES)
def test_every_module_loads(name: str) -> None:
    import_module(f"tests.benchmarks.{name}")


def test_the_gallery_is_what_it_makes() -> None:
    """A picture that nothing draws any more would show what the program no longer does."""
    stored = {
        path.stem.removeprefix("gallery-")
        for path in (gallery.ROOT / "results").glob("gallery-*.png")
    }
    assert stored == set(gallery.DRAWN)


def test_random_kills_lose_nothing(tmp_path: Path) -> None:
    done = survive(tmp_path, kills=3, seed=3, points=80)
    assert done.workers + done.runs == 3
    assert min(done.workers, done.runs) > 0


def test_no_spoilt_study_ends_in_a_traceback() -> None:
    assert len(sources()) > 5
    said: list[str] = []
    counts = survey(range(10_000, 10_050), said.append)
    assert counts["badly ended"] == 0, "\n".join(said)
    assert counts["planned"] > 2  # the generator spoils neither all nor nothing
    assert counts["refused"] > 25
