"""Does a history depend on its steps, does its energy ever rise? `python -m tests.benchmarks.random_histories [N [first
[parts]]]`

N random histories (2,000 unless given) of 3 to 30 nodes and 6 loads; three memories; laws that fall, jump down or up
and climb to a peak, by up to 6 λ₁ where they do not jump. Each is followed along its path with its loads as they are
and each in 100 equal steps. Told are steps that fail, closures below −1e-9 of what is dissipated, and end
states apart by more than 1e-8 of the largest slip.
"""

from __future__ import annotations

import sys
from collections import Counter
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from tcstudy.contact.history.problem import HistoryProblem, HistoryStep
from tcstudy.contact.history.steps import history
from tcstudy.contact.problem import least_eigenvalue
from tcstudy.laws.laws import Laws
from tcstudy.matrices import law
from tcstudy.scene.histories import Memory, UnfitLaw
from tests.contact.contact_cases import half_laplacian
from tests.contact.history.cases import remembering

Array = NDArray[np.float64]

STEEPEST = 6.0
"""Fall of a law, over λ₁."""
CLOSED, SAME = 1e-9, 1e-8
"""Of what is dissipated, and of the largest slip."""
ROUNDING = 1e-14
"""Of what bonds have stored, where nothing is dissipated."""


def random_history(seed: int) -> tuple[HistoryProblem, list[Array]]:
    """A body with three loads that come and go in 6 steps, and a film of one of the three memories."""
    rng = np.random.default_rng([seed, 24])
    m = int(rng.integers(3, 31))
    A, c = _body(rng, m)
    memory = ("friction", "damage", "elastic-plastic")[int(rng.integers(3))]
    lambda_1 = least_eigenvalue(A, c)
    while True:
        film = _film(rng, lambda_1, memory)
        stiffness = float(film.omega * rng.uniform(1.2, 4.0)) if memory == "elastic-plastic" else None
        try:
            body = remembering(A, c, film, Memory(memory, stiffness))  # type: ignore[arg-type]
            _ = body.model
        except UnfitLaw:
            continue
        break
    reach = float(film.kinks[-1]) * lambda_1 + film.b_scale
    ways = _shapes(rng, m) * c * reach * rng.uniform(0.2, 2.0)
    return body, [rng.uniform(-1.0, 1.0, 3) @ ways for _ in range(6)]


def _shapes(rng: np.random.Generator, m: int) -> Array:
    """Three loads per length: of every node its own, or smooth along the line."""
    if rng.uniform() < 0.4:
        return rng.standard_normal((3, m)) + rng.choice([-2.0, 0.0, 2.0], (3, 1))
    x = np.linspace(-1.0, 1.0, m)
    return np.stack([np.polynomial.Polynomial(rng.standard_normal(4) * [1.0, 2.0, 1.0, 1.0])(x) for _ in range(3)])


def _body(rng: np.random.Generator, m: int) -> tuple[Array, Array]:
    """A random matrix, whose nodes push each other any way, a chain on springs, or the edge of a half-plane."""
    c, kind = rng.uniform(0.2, 1.0, m), int(rng.integers(3))
    if kind == 0:
        A, c = half_laplacian(m, rng.uniform(0.3, 3.0))
        return A, c
    if kind == 1:
        G = rng.standard_normal((m, m + 2))
        return (G @ G.T / m + 0.2 * np.eye(m)) * rng.uniform(0.3, 3.0), c
    chain = np.diag(np.full(m, 2.0)) - np.eye(m, k=1) - np.eye(m, k=-1)
    return chain * rng.uniform(0.5, 5.0) + np.diag(rng.uniform(0.05, 1.0, m)), c


def _film(rng: np.random.Generator, lambda_1: float, memory: str) -> Laws:
    """Falling, with a peak, or of teeth with jumps; its steepest slope falls by up to STEEPEST λ₁."""
    shape = ("falls", "peak", "teeth")[int(rng.integers(3))]
    if shape == "teeth" and memory != "elastic-plastic":
        points = [(0.0, float(rng.uniform(0.3, 1.0)))]
        for _ in range(int(rng.integers(1, 4))):
            s = points[-1][0] + rng.uniform(0.1, 0.6)
            points.append((float(s), float(rng.uniform(0.1, 1.5))))
            points.append((float(s), float(rng.uniform(0.1, 1.5))))
        tau = np.array([b for _, b in points])
        s = np.array([s for s, _ in points])
        if memory == "damage":
            tau = np.sort(tau)[::-1]
    else:
        n = int(rng.integers(2, 5))
        s = np.concatenate([[0.0], np.cumsum(rng.uniform(0.1, 1.0, n))])
        tau = np.sort(rng.uniform(0.0, 2.0, n + 1))[::-1].copy()
        if shape == "peak":
            tau[0] = tau[1] * rng.uniform(0.5, 0.95)
    with np.errstate(divide="ignore"):
        fall = np.max(-np.diff(tau)[np.diff(s) > 0.0] / np.diff(s)[np.diff(s) > 0.0], initial=0.0)
    stretch = fall / (rng.uniform(0.5, STEEPEST) * lambda_1) if fall else 1.0
    return law(points=[(float(x), float(y)) for x, y in zip(s * stretch, tau, strict=True)])


def followed(body: HistoryProblem, loads: list[Array], parts: int) -> list[HistoryStep]:
    """The history with every load in so many equal steps, as far as steps are solved."""
    ends = [np.zeros(body.body.m), *loads]
    every = (one + k / parts * (two - one) for one, two in pairwise(ends) for k in range(1, parts + 1))
    return list(history(body, every))


def judged(seed: int, parts: int = 100) -> tuple[list[str], str]:
    """(what is wrong with a history, its numbers)."""
    body, loads = random_history(seed)
    found, said, ends = [], [body.memory.name, f"m {body.body.m}"], []
    for count in (1, parts):
        steps = followed(body, loads, count)
        spent, closure = sum(step.dissipated for step in steps), min(step.closure for step in steps)
        if not steps[-1].solved:
            found.append(f"in {count} fails")
        if closure < -CLOSED * spent - ROUNDING * max(step.stored for step in steps):
            found.append(f"in {count} uphill")
        jumps, released = sum(step.jumps for step in steps), sum(step.released for step in steps)
        said.append(f"in {count}: {jumps} jumps, released {released:.10g}, closure {closure:.1e} of {spent:.3g}")
        said.append(steps[-1].reason)
        ends.append(steps[-1])
    apart = float(np.max(np.abs(ends[0].v - ends[1].v))) / (float(np.max(np.abs(ends[0].v))) or 1.0)
    if ends[0].solved and ends[1].solved and apart > SAME:
        found.append("apart")
    return found, f"{', '.join(filter(None, said))}; apart {apart:.1e}"


def main(count: int = 2000, first: int = 0, parts: int = 100) -> None:
    """A line for every history with which something is wrong, and the counts."""
    counts: Counter[str] = Counter()
    with threadpool_limits(1, user_api="blas"):
        for seed in range(first, first + count):
            found, numbers = judged(seed, parts)
            counts.update(found or ["well"])
            if found:
                print(f"{seed}: {', '.join(found)}; {numbers}", flush=True)
    print(dict(counts))


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
