"""Do limits h → 0 lie within their uncertainty? `python -m tests.benchmarks.limits [COUNT] [--seed
SEED] [--seconds SECONDS]`.

Scenes:    tests.benchmarks.tolerance_scenes on uniform meshes of up to MOST unknowns
Windows:   three to five consecutive levels, at least two levels coarser than the finest
Truth:     the finest three levels extrapolated with an order of 0.4 to 2.5; its doubt is the change
           from the three levels before, at least a tenth of the extrapolated step; of slip lengths
           the fronts are taken where they lie within their cells
Judged:    windows whose truth is known to SHARP of the error of their finest level, or better; a
           limit counts as missed if the truth may lie outside
"""

import itertools
import time
import warnings
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from tcstudy.accuracy.limits import FACTORS, StickSlip, limit_of
from tcstudy.data.schema import PointStatus
from tcstudy.read.study import read_study_text
from tcstudy.refine.goals import slip_length
from tcstudy.scene.study import Study
from tcstudy.study.run import stages
from tests.benchmarks.cases import options
from tests.benchmarks.tolerance_scenes import draw_scene

Array = NDArray[np.float64]

LEVELS, MOST = 8, 200_000
"""Levels of a scene and unknowns of its finest mesh, at most."""
COARSER = 2.0
"""Coarsest mesh size over that of the scenes as they are drawn."""
WINDOWS = (3, 4, 5)
"""Levels of a window."""
BEYOND = 2
"""Levels between a window and the finest mesh, at least."""
SHARP = 0.1
"""Doubt of the truth over the error of a window's finest level, at most."""
SAME = 1e-9
"""Relative difference of two results that is rounding of the solver."""
RATIO = 2.0
"""Of the mesh sizes of two levels."""


@dataclass(frozen=True, eq=False)
class LevelResults:
    """What one level says: its mesh size, results, what it cannot resolve, and its state.

    front_length, front_doubt: slip length with fronts where they lie within their cells [m]
    """

    h: float
    results: dict[str, float]
    unresolved: dict[str, float]
    state_order: str
    front_length: float
    front_doubt: float


def scene_study(seed: int, index: int) -> Study:
    """Return a random scene on uniform meshes."""
    drawn = draw_scene(seed, index)
    maxh = COARSER * drawn.study.mesh.maxh[0]
    changes = [f"mesh.maxh={maxh!r}", f"mesh.levels={LEVELS}"]
    return read_study_text(drawn.text, f"scene {index} of seed {seed}", changes)


def level_results(study: Study) -> list[LevelResults]:
    """Return the results of all levels up to the first that is not solved or has MOST unknowns."""
    levels = list[LevelResults]()
    for stage in stages(study):
        level = stage.level
        if level is None:
            break
        [block] = stage.blocks
        if block.status[0] != PointStatus.OK or block.u_T is None or block.xi is None:
            break
        numbers = {name: float(x[0]) for name, x in block.numbers.items() if np.ndim(x) == 1}
        problem = level.condensed(study.scenes[0]).problem
        line, v = level.line, block.u_T[0]
        front_length, front_doubt = slip_length(line, problem, v)
        inner = (line.unknowns >= 0).all(axis=1)
        state = StickSlip(
            line.c,
            v,
            block.xi[0],
            problem.law.sticking(v),
            line.unknowns[inner],
            np.isfinite(numbers.get("slip_length", np.nan)),
        )
        levels.append(
            LevelResults(
                level.mesh.h_max,
                {name: numbers.get(name, np.nan) for name in FACTORS},
                {name: state.unresolved(name) for name in FACTORS},
                state.order,
                front_length,
                front_doubt,
            )
        )
        if RATIO**2 * level.frames.n_dof > MOST:
            break
    return levels


def truth_of(name: str, levels: list[LevelResults]) -> tuple[float, float]:
    """Return the limit that all levels lead to, and its doubt."""
    values = np.array([level.results[name] for level in levels])
    if name == "slip_length":
        values = np.array([level.front_length for level in levels])
    limit, step = _extrapolated(values[-3:])
    before, _ = _extrapolated(values[-4:-1])
    doubt = max(abs(limit - before), step)
    if name == "slip_length":
        doubt = max(doubt, levels[-1].front_doubt)
    return limit, doubt


def _extrapolated(q: Array) -> tuple[float, float]:
    """Return the limit of three levels, and a part of the extrapolated step that grows as its order
    falls; the finest value and the last differences where they do not fall one way."""
    first, last = np.diff(q)
    if first * last <= 0.0 or abs(last) >= abs(first):
        return float(q[-1]), float(abs(first) + abs(last))
    order = float(np.clip(np.log(first / last) / np.log(RATIO), 0.4, 2.5))
    step = float(last / (RATIO**order - 1.0))
    share = 0.1 if order >= 0.8 else 0.3 if order >= 0.5 else 0.5
    return float(q[-1]) + step, share * abs(step)


@dataclass(frozen=True)
class Judged:
    """A window of levels of a scene.

    held:  the truth lies within the uncertainty, its own doubt included
    share: uncertainty over the error of the finest level of the window
    sharp: the truth is known well enough to judge by
    """

    scene: int
    name: str
    count: int
    held: bool
    share: float
    sharp: bool


def windows(scene: int, levels: list[LevelResults]) -> Iterator[Judged]:
    """Judge all windows of three to five levels of a scene."""
    for name, count in itertools.product(FACTORS, WINDOWS):
        if not np.isfinite(levels[-1].results[name]):
            continue
        truth, doubt = truth_of(name, levels)
        for end in range(count, len(levels) - BEYOND + 1):
            window = levels[end - count : end]
            h = np.array([level.h for level in window])
            q = np.array([level.results[name] for level in window])
            limit = limit_of(name, h, q, window[-1].unresolved[name])
            rounding = SAME * max(abs(truth), float(np.abs(q).max()))
            error = abs(float(q[-1]) - truth)
            distance = abs(limit.value - truth) + doubt
            share = limit.uncertainty / error if error > rounding else np.nan
            sharp = doubt <= max(SHARP * error, rounding)
            held = distance <= limit.uncertainty + rounding
            yield Judged(scene, name, count, bool(held), share, bool(sharp))


def main() -> None:
    """Print a row for each result and number of levels."""
    asked = options(__doc__, "count=65", seed=12, seconds=600.0)
    begun, judged = time.perf_counter(), list[Judged]()
    warnings.simplefilter("ignore")
    with threadpool_limits(1, user_api="blas"):
        for index in range(asked.count):
            if time.perf_counter() - begun > asked.seconds:
                break
            levels = level_results(scene_study(asked.seed, index))
            if len(levels) >= min(WINDOWS) + BEYOND:
                judged += windows(index, levels)
    print(f"{len({one.scene for one in judged})} scenes")
    print("| result | levels | judged | held | all | held of all | uncertainty/error | missed |")
    print("|---|--:|--:|--:|--:|--:|--:|---|")
    for name, count in itertools.product(FACTORS, WINDOWS):
        every = [one for one in judged if (one.name, one.count) == (name, count)]
        sharp = [one for one in every if one.sharp]
        if not sharp:
            continue
        held, held_of_all = (100 * np.mean([one.held for one in some]) for some in (sharp, every))
        width = np.nanmedian([one.share for one in sharp])
        missed = sorted({one.scene for one in sharp if not one.held})
        print(
            f"| {name} | {count} | {len(sharp)} | {held:.1f} % | {len(every)} | "
            f"{held_of_all:.1f} % | {width:.2f} | {missed or ''} |"
        )


if __name__ == "__main__":
    main()
