"""Are derivatives of histories right, or said to be none? `python -m tests.benchmarks.history_slopes [N]`

N random histories (100 unless given) of `random_histories` with up to 12 nodes and falls above λ₁, each by four or five
numbers: the body's stiffness, a load that has come with all others, height and length of the law, k of elastic-plastic
bonds. Derivatives of max |v| and Σξ at all six steps are compared with differences of fourth order at other steps.
Told are those off by more than 1e-5, relative to them or to a hundredth of the largest quantity over the number.
"""

from __future__ import annotations

import argparse
from collections import Counter
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from tcstudy.contact.history.differences import STEPS, two_sided
from tcstudy.contact.history.problem import HistoryProblem
from tcstudy.contact.history.steps import history
from tcstudy.matrices import law
from tests.benchmarks.random_histories import random_history

Array = NDArray[np.float64]

MOST, OTHER, OFF = 12, 3e-6, 1e-5
"""Nodes; step of the other differences; and how far a derivative may be from them."""
NUMBERS = ("body", "load", "height", "length", "k")


def varied(body: HistoryProblem, loads: list[Array], number: str, h: float) -> Array:
    """(12,) max |v| and Σξ of all steps with a number larger by the share h; NaN behind a step that fails."""
    if number == "body":
        body = replace(body, A_tilde=(1.0 + h) * body.A_tilde)
    elif number == "load":
        loads = [load + h * loads[0] for load in loads]
    elif number == "k":
        assert body.memory.stiffness
        body = replace(body, memory=replace(body.memory, stiffness=(1.0 + h) * body.memory.stiffness))
    else:
        s, b = (1.0 + h, 1.0) if number == "length" else (1.0, 1.0 + h)
        points = body.law.made.values["points"]  # type: ignore[union-attr]
        body = replace(body, law=law(points=[(s * x, b * y) for x, y in points]))
    found = np.full((len(loads), 2), np.nan)
    for n, step in enumerate(history(body, loads)):
        if step.solved:
            found[n] = np.max(np.abs(step.v)), body.c @ step.xi
    return found.ravel()


def compared(seed: int) -> Iterator[tuple[str, Array, Array, Array]]:
    """(number, derivatives, the same by other differences, what they are relative to), (12,) each."""
    body, loads = random_history(seed)
    if len(loads[0]) > MOST or not body.law.omega > body.stiffness:
        return
    middle = varied(body, loads, "body", 0.0)
    for number in NUMBERS if body.memory.stiffness else NUMBERS[:-1]:
        up, down = (np.array([varied(body, loads, number, way * h) for h in STEPS]) for way in (1.0, -1.0))
        own = two_sided(middle, up, down, 1.0)
        far, near, back, last = (varied(body, loads, number, k * OTHER) for k in (2.0, 1.0, -1.0, -2.0))
        other = (8.0 * (near - back) - (far - last)) / (12.0 * OTHER)
        largest = np.tile(np.nanmax(np.abs(middle.reshape(-1, 2)), axis=0), len(loads))
        yield number, own, other, np.maximum(np.abs(own), 1e-2 * largest)


def main(arguments: list[str] | None = None) -> None:
    """A line for every derivative that is off, and the counts."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("count", nargs="?", type=int, default=100)
    parser.add_argument("--first", type=int, default=0)
    options = parser.parse_args(arguments)
    counts: Counter[str] = Counter()
    seed = options.first
    with threadpool_limits(1, user_api="blas"):
        while counts["histories"] < options.count:
            found = list(compared(seed))
            counts["histories"] += bool(found)
            for number, own, other, size in found:
                told = np.isfinite(own)
                off = told & ~(np.abs(own - other) <= OFF * size)
                counts.update({"told": int(told.sum()), "none": int((~told).sum()), "off": int(off.sum())})
                for at in np.flatnonzero(off):
                    print(f"{seed}: {number}, step {at // 2 + 1}: {own[at]:.10g} and {other[at]:.10g}", flush=True)
            seed += 1
    print(dict(counts))


if __name__ == "__main__":
    main()
