"""Random histories with folds along their paths, in any units: every step ends, in order, where its law allows."""

from __future__ import annotations

from contextlib import suppress
from itertools import pairwise

import numpy as np
import pytest
from numpy.typing import NDArray

from tcstudy.contact.history.problem import HistoryProblem
from tcstudy.contact.history.steps import history, next_step
from tcstudy.contact.problem import least_eigenvalue
from tcstudy.laws.laws import Laws
from tcstudy.matrices import law
from tcstudy.scene.histories import Memory, UnfitLaw
from tests.contact.contact_cases import half_laplacian
from tests.contact.history.cases import followed, remembering

Array = NDArray[np.float64]


def random_history(seed: int, curved: bool = False) -> tuple[HistoryProblem, list[Array]]:
    """A body of 3 or 20 nodes, a film that falls steeply, five loads; lengths and tractions in units of their own.

    curved: the film is exponential
    """
    rng = np.random.default_rng([seed, 15])
    m = int(rng.choice([3, 20]))
    metre, pascal = 10.0 ** rng.choice([-6, 0, 6], 2)
    G = rng.standard_normal((m, m + 2))
    A = (G @ G.T / m + 0.2 * np.eye(m)) * rng.uniform(0.3, 3.0) * pascal
    c = metre * rng.uniform(0.2, 1.0, m)
    s = metre * np.concatenate([[0.0], np.cumsum(rng.uniform(0.1, 1.0, 3))])
    tau = pascal * np.sort(rng.uniform(0.0, 2.0, 4))[::-1]
    film = law(points=[(float(x), float(y)) for x, y in zip(s, tau, strict=True)])
    plastic = Memory("elastic-plastic", float(film.omega * rng.uniform(1.2, 4.0)))
    memory = [Memory("friction"), Memory("damage"), plastic][int(rng.integers(3))]
    ways = rng.standard_normal((2, m)) * metre * pascal * rng.uniform(1.0, 8.0)
    loads = [rng.uniform(-1.0, 1.0, 2) @ ways for _ in range(4)]
    if curved:
        film = law("exponential", a=tau[0], b=rng.uniform(0.0, 0.9) * tau[0], delta=metre * rng.uniform(0.1, 2.0))
        memory = Memory("damage" if rng.uniform() < 0.5 else "friction")
    return remembering(A, c, film, memory), [*loads, 0.0 * loads[0]]


STRAIGHT = [2, 13, 15, 64]  # from 13 on descents beside folds had crept
CURVED = [1, 3, 5, 183]  # a far vertex; folds of the curve before those of its chords


@pytest.mark.parametrize(("seed", "curved"), [*((s, False) for s in STRAIGHT), *((s, True) for s in CURVED)])
def test_every_step_reaches_its_load_with_its_energies_in_order(seed: int, curved: bool) -> None:
    """The same load again changes no bit."""
    body, loads = random_history(seed, curved)
    steps, scale = followed(body, loads, 1e-10), body.law.b_scale * body.body.c.max()
    for load, step in zip(loads, steps, strict=True):
        assert body.body.c * step.xi == pytest.approx(load - body.body.A_tilde @ step.v, abs=1e-10 * scale)
        again = next_step(body, step, load)
        assert np.array_equal(again.v, step.v)
        assert again.work == 0.0


def varied_history(seed: int) -> tuple[HistoryProblem, list[Array]]:
    """A body with three loads that come and go in 6 steps, and a film of one of the three memories that falls by up to
    six times λ₁.

    Bodies: the edge of a half-plane, a random matrix, whose nodes push each other any way, a chain on springs. Films:
    falling, with a peak, or of teeth with jumps. Loads: of every node its own, or smooth along the line.
    """
    rng = np.random.default_rng([seed, 24])
    m = int(rng.integers(3, 31))
    c, kind = rng.uniform(0.2, 1.0, m), int(rng.integers(3))
    if kind == 0:
        A, c = half_laplacian(m, rng.uniform(0.3, 3.0))
    elif kind == 1:
        G = rng.standard_normal((m, m + 2))
        A = (G @ G.T / m + 0.2 * np.eye(m)) * rng.uniform(0.3, 3.0)
    else:
        chain = np.diag(np.full(m, 2.0)) - np.eye(m, k=1) - np.eye(m, k=-1)
        A = chain * rng.uniform(0.5, 5.0) + np.diag(rng.uniform(0.05, 1.0, m))
    memory, lambda_1 = ("friction", "damage", "elastic-plastic")[int(rng.integers(3))], least_eigenvalue(A, c)
    while True:
        film = _film(rng, lambda_1, memory)
        stiffness = float(film.omega * rng.uniform(1.2, 4.0)) if memory == "elastic-plastic" else None
        with suppress(UnfitLaw):
            body = remembering(A, c, film, Memory(memory, stiffness))  # type: ignore[arg-type]
            _ = body.model
            break
    reach = float(film.kinks[-1]) * lambda_1 + film.b_scale
    if rng.uniform() < 0.4:
        ways = rng.standard_normal((3, m)) + rng.choice([-2.0, 0.0, 2.0], (3, 1))
    else:
        x = np.linspace(-1.0, 1.0, m)
        ways = np.stack([np.polynomial.Polynomial(rng.standard_normal(4) * [1.0, 2.0, 1.0, 1.0])(x) for _ in range(3)])
    ways = ways * c * reach * rng.uniform(0.2, 2.0)
    return body, [rng.uniform(-1.0, 1.0, 3) @ ways for _ in range(6)]


def _film(rng: np.random.Generator, lambda_1: float, memory: str) -> Laws:
    shape = ("falls", "peak", "teeth")[int(rng.integers(3))]
    if shape == "teeth" and memory != "elastic-plastic":
        s, tau = [0.0], [rng.uniform(0.3, 1.0)]
        for _ in range(int(rng.integers(1, 4))):
            s += [s[-1] + rng.uniform(0.1, 0.6)] * 2
            tau += [rng.uniform(0.1, 1.5), rng.uniform(0.1, 1.5)]
        tau = sorted(tau, reverse=True) if memory == "damage" else tau
    else:
        n = int(rng.integers(2, 5))
        s = np.concatenate([[0.0], np.cumsum(rng.uniform(0.1, 1.0, n))])
        tau = np.sort(rng.uniform(0.0, 2.0, n + 1))[::-1].copy()
        if shape == "peak":
            tau[0] = tau[1] * rng.uniform(0.5, 0.95)
    run = np.diff(s) > 0.0
    fall = np.max(-np.diff(tau)[run] / np.diff(s)[run], initial=0.0)
    stretch = fall / (rng.uniform(0.5, 6.0) * lambda_1) if fall else 1.0
    return law(points=[(float(x) * stretch, float(y)) for x, y in zip(s, tau, strict=True)])


def judged(seed: int, parts: int) -> list[str]:
    """What is wrong with a history, its loads as they are and each in so many equal steps."""
    body, loads = varied_history(seed)
    found, last = list[str](), list[Array]()
    for count in (1, parts):
        ends = [np.zeros(body.body.m), *loads]
        every = (one + k / count * (two - one) for one, two in pairwise(ends) for k in range(1, count + 1))
        steps = list(history(body, every))
        spent, closure = sum(step.dissipated for step in steps), min(step.closure for step in steps)
        if not steps[-1].solved:
            found.append(f"in {count} fails: {steps[-1].reason}")
        if closure < -1e-9 * spent - 1e-14 * max(step.stored for step in steps):
            found.append(f"in {count} uphill")
        last.append(steps[-1].v)
    apart = np.max(np.abs(last[0] - last[1])) > 1e-8 * np.max(np.abs(last[0]))
    return [*found, "apart"] if apart else found


@pytest.mark.parametrize("seed", [73, 191])
def test_no_jump_leads_uphill_and_steps_do_not_matter(seed: int) -> None:
    """They had jumped to more energy where a node passes its peak as another turns back."""
    assert judged(seed, parts=2) == []
