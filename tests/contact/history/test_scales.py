"""Jumps and slips of histories in any unit, at any scale, of blocks however stiff: rounding is no jump."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from tcstudy.contact.history.problem import HistoryProblem, HistoryStep
from tcstudy.contact.history.steps import history
from tcstudy.matrices import law
from tcstudy.scene.histories import Memory
from tests.contact.history.cases import coupled_line, remembering, strip
from tests.contact.history.test_continued import followed
from tests.contact.history.test_steps import FALLING

Array = NDArray[np.float64]

METRES, PASCALS = (1e-3, 1e3), (1e-9, 1.0, 1e15)


def steep(metre: float, pascal: float) -> tuple[HistoryProblem, list[Array]]:
    """A line of 12 nodes under a film that falls more steeply than they rise, both loaded and taken back."""
    A, c, load = coupled_line(12)
    film = law("slip-weakening", tau_s=2e7 * pascal, tau_k=4e6 * pascal, delta=3e-4 * metre)
    loads = [e * metre * pascal * load for e in (2.0, 4.0, 1.0, -4.0)]
    return remembering(pascal * A, metre * c, film, Memory("friction")), loads


@pytest.fixture(scope="module")
def in_si_units() -> list[HistoryStep]:
    return followed(*steep(1.0, 1.0))


@pytest.mark.parametrize("pascal", PASCALS)
@pytest.mark.parametrize("metre", METRES)
def test_a_steep_film_jumps_alike_in_all_units(metre: float, pascal: float, in_si_units: list[HistoryStep]) -> None:
    """H8 by hand, and a line of nodes against itself in metres and pascals: jumps, nodes, slips and energies."""
    film = law(points=[(s * metre, b * pascal) for s, b in ((0.0, 1.0), (0.4, 0.2))])
    assert film.omega * metre / pascal == pytest.approx(FALLING.omega)
    body = remembering(np.eye(1) * pascal, np.ones(1) * metre, film, Memory("friction"))
    block = list(history(body, [np.array([U]) * metre * pascal for U in (0.8, 1.2, 0.8, 0.4, -0.2, 1.4)]))
    assert [step.jumps for step in block] == [0, 1, 0, 0, 0, 0]
    assert [step.v[0] / metre for step in block] == pytest.approx([0, 1, 1, 0.6, 0, 1.2], abs=1e-13)
    steps = list(history(*steep(metre, pascal)))
    size = max(np.max(np.abs(step.v)) for step in in_si_units)
    assert sum(step.jumps for step in in_si_units) > 0
    for step, other in zip(steps, in_si_units, strict=True):
        assert (step.solved, step.jumps) == (True, other.jumps)
        assert np.array_equal(step.jumped, other.jumped)
        assert step.v / metre == pytest.approx(other.v, abs=1e-9 * size)
        released = step.released / metre**2 / pascal
        assert released == pytest.approx(other.released, rel=1e-8, abs=1e-12 * abs(other.energy))


@pytest.mark.parametrize("stiffness", [1e-9, 1.0, 1e15])
@pytest.mark.parametrize("ratio", [1.0, 1e8, 1e11])
@pytest.mark.parametrize("metre", METRES)
def test_a_stiff_block_on_a_spring_never_jumps(stiffness: float, ratio: float, metre: float) -> None:
    """Jenkins' element, spring K and Tresca resistance F: u = (P − F)/K, back to −u, and each loop the same.

    ratio: of the block's stiffness to the spring's, from which rounding of slips follows
    """
    K, F = stiffness, 0.04 * stiffness * metre
    A = ratio * K * strip(4, 1.0, 1.0, held=False)[0]
    A[-1, -1] += K
    c = metre * np.array([0.025, 0.05, 0.05, 0.05, 0.025])
    body = remembering(A, c, law("tresca", tau=F / c.sum()), Memory("friction"))
    share = np.array([0.05, 0.1, 0.2, 0.2, 0.45]) if ratio > 1e3 else c / c.sum()
    loads = [P * F * share for P in (2.5, 1.5, -2.5, 2.5, 2.5, 1.5, -2.5, 2.5)]
    steps = list(history(body, loads))
    assert [(step.reason, step.jumps, step.released) for step in steps] == [("", 0, 0.0)] * 8
    assert all(abs(step.closure) <= 1e-8 * abs(step.energy) for step in steps)
    if ratio > 1e3:
        u, exact = [step.v.mean() for step in steps], 1.5 * F / K
        error = max(2.0 / ratio, 8.0 * np.finfo(float).eps * ratio)
        assert u == pytest.approx([exact, exact, -exact, exact] * 2, abs=10.0 * error * exact)


@pytest.mark.parametrize("metre", METRES)
def test_a_film_that_breaks_at_once_lets_go_where_nothing_falls_behind_it(metre: float) -> None:
    """b = 1 to s = 0.4, then 0.2, on a spring of 1: let go at U = 1.4, it stops at 1.2; ½ 0.8² is released."""
    film = law(points=[(0.0, 1.0), (0.4 * metre, 1.0), (0.4 * metre, 0.2)])
    body = remembering(np.eye(1) / metre, np.ones(1), film, Memory("friction"))
    steps = followed(body, [np.array([U]) for U in (1.3, 1.6, 1.0)])
    assert [step.jumps for step in steps] == [0, 1, 0]
    assert steps[1].released == pytest.approx(0.32 * metre, rel=1e-12)
    assert [step.v[0] / metre for step in steps] == pytest.approx([0.3, 1.4, 1.2], rel=1e-12)


@pytest.mark.parametrize("seed", [203, 239, 1070])
def test_a_body_with_a_soft_way_never_jumps_under_a_constant_film(seed: int) -> None:
    """Stiffnesses over ten decades: what residuals move along the soft way gains energy, yet no node can let go."""
    rng = np.random.default_rng(seed)
    m = 2 + seed % 4
    modes = np.linalg.qr(rng.standard_normal((m, m)))[0]
    A = (modes * 10.0 ** rng.uniform(-8.0, 2.0, m)) @ modes.T
    body = remembering(0.5 * (A + A.T), np.full(m, 1e-3), law("tresca", tau=1.0), Memory("friction"))
    way = rng.standard_normal(m) * 10.0 ** (seed % 3 - 1)
    steps = list(history(body, [share * way for share in (1.0, -1.0, 0.5, -1.5, 1.5)]))
    assert body.monotone
    assert [(step.reason, step.jumps, step.released) for step in steps] == [("", 0, 0.0)] * 5
    assert not any(np.any(step.jumped) for step in steps)
    assert all(abs(step.closure) <= 1e-8 * abs(step.energy) for step in steps)
