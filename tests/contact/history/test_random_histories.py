"""Random histories with folds along their paths, in any units: every step ends, in order, where its
law allows."""

from itertools import pairwise

import numpy as np
import pytest
from numpy.typing import NDArray

from tcstudy.contact.history.memory import HistoryProblem
from tcstudy.contact.history.steps import next_step
from tcstudy.matrices import law
from tcstudy.scene.histories import Memory
from tests.contact.history.cases import followed, remembering

Array = NDArray[np.float64]


def random_history(
    seed: int, curved: bool = False, peak: bool = False
) -> tuple[HistoryProblem, list[Array]]:
    """A body of 3 or 20 nodes, a film that falls steeply, five loads; lengths and tractions in
    units of their own.

    curved: the film is exponential
    peak:   it rises to its second point
    """
    rng = np.random.default_rng([seed, 15])
    m = int(rng.choice([3, 20]))
    metre, pascal = 10.0 ** rng.choice([-6, 0, 6], 2)
    G = rng.standard_normal((m, m + 2))
    A = (G @ G.T / m + 0.2 * np.eye(m)) * rng.uniform(0.3, 3.0) * pascal
    c = metre * rng.uniform(0.2, 1.0, m)
    s = metre * np.concatenate([[0.0], np.cumsum(rng.uniform(0.1, 1.0, 3))])
    tau = pascal * np.sort(rng.uniform(0.0, 2.0, 4))[::-1]
    tau[0] = 0.7 * tau[1] if peak else tau[0]
    film = law(points=[(float(x), float(y)) for x, y in zip(s, tau, strict=True)])
    plastic = Memory("elastic-plastic", float(film.omega * rng.uniform(1.2, 4.0)))
    memory = [Memory("friction"), Memory("damage"), plastic][int(rng.integers(3))]
    ways = rng.standard_normal((2, m)) * metre * pascal * rng.uniform(1.0, 8.0)
    loads = [rng.uniform(-1.0, 1.0, 2) @ ways for _ in range(4)]
    if curved:
        film = law(
            "exponential",
            a=tau[0],
            b=rng.uniform(0.0, 0.9) * tau[0],
            delta=metre * rng.uniform(0.1, 2.0),
        )
        memory = Memory("damage" if rng.uniform() < 0.5 else "friction")
    return remembering(A, c, film, memory), [*loads, 0.0 * loads[0]]


STRAIGHT = [2, 13, 15, 64]  # from 13 on descents beside folds had crept
CURVED = [1, 3, 5, 183]  # a far vertex; folds of the curve before those of its chords


@pytest.mark.parametrize(
    ("seed", "curved"), [*((s, False) for s in STRAIGHT), *((s, True) for s in CURVED)]
)
def test_every_step_reaches_its_load_with_its_energies_in_order(seed: int, curved: bool) -> None:
    """The same load again changes no bit."""
    body, loads = random_history(seed, curved)
    steps, scale = followed(body, loads, 1e-10), body.model.law.b_scale * body.body.c.max()
    for load, step in zip(loads, steps, strict=True):
        assert body.body.c * step.xi == pytest.approx(
            load - body.body.A_tilde @ step.v, abs=1e-10 * scale
        )
        again = next_step(body, step, load)
        assert np.array_equal(again.v, step.v)
        assert again.work == 0.0
    if seed == 183:  # a state is no place to jump to from itself; as forty steps release it
        assert steps[0].released / steps[0].dissipated == pytest.approx(0.0862088, rel=1e-5)


@pytest.mark.parametrize("seed", [2, 15])
def test_steps_do_not_matter(seed: int) -> None:
    """Each in halves, with a peak: jumps had led uphill where a node passes it as another turns
    back."""
    body, loads = random_history(seed, peak=True)
    halves = [
        load for one, two in pairwise([0.0 * loads[0], *loads]) for load in (0.5 * (one + two), two)
    ]
    whole, split = (followed(body, some, 1e-10)[-1].v for some in (loads, halves))
    assert split == pytest.approx(whole, abs=1e-8 * np.max(np.abs(whole)))
