"""Every failing region of the stability map in a sentence: where, how often, by what mechanism, what the tool does."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

import numpy as np

from tests.benchmarks.stability_chain import CHAIN
from tests.benchmarks.stability_maps import MAPS
from tests.benchmarks.stability_measure import FLAGGED, SILENT, SLOW, SOLVED, Row
from tests.benchmarks.stability_trial import (
    AT_KINK,
    BRANCHES,
    CANCELLATION,
    CONTENDERS,
    CRAWL,
    CYCLING,
    FOLDS,
    INDEFINITE,
    NULL_STEPS,
    OTHER,
    SHORT_STEPS,
    TIME,
    WANDERING,
)

DEFAULT = CONTENDERS[0].name

SCIPY = ("BFGS", "L-BFGS-B", "trust-exact")
UNBALANCED = "slip left unbalanced"

EXPLAINED = {
    (DEFAULT, CANCELLATION): "ξ = l̃ − Ãv is the difference of terms that are larger than friction by five powers of "
    "ten and more, so rounding alone exceeds the tolerance; the point is flagged as limited by rounding or, "
    "with a tolerance of its own, reported as failed (`inclusion_violated`) with its residual and advice.",
    (DEFAULT, CRAWL): "Newton steps are cut by kinks until only steps node by node lower the energy, and those crawl "
    "because a thin layer couples neighbours stiffly; the limit of 300 iterations is reported (its "
    "advice to allow more of them is wrong here: rounding keeps the residual above the tolerance as well).",
    (DEFAULT, OTHER): "the iteration limit was reached; the point is reported as failed.",
    ("bundle-newton", NULL_STEPS): "every sticking node is a direction in which L̃ is nonsmooth and asks for a "
    "subgradient of its own, so most steps are null steps; the tool reports the limit it ran into, and its default "
    "keeps one bundle a node instead.",
    ("bundle-newton", SHORT_STEPS): "steps shrink between null steps where softening makes the pieces nonconvex; the "
    "tool reports the limit or the stall, and its default uses the exact pieces instead.",
    (
        "bundle-newton",
        TIME,
    ): "most steps are still serious ones, but each costs a dense factorisation and a QP over the "
    "bundle; the tool's default needs neither.",
    ("semismooth Newton", CYCLING): "branch sets return although every matrix on the way is positive definite: no line "
    "search rejects the step; the default accepts only steps that lower L̃, so it cannot cycle.",
    ("semismooth Newton", INDEFINITE): "branch sets return and on the way A_FF + C q_F has lost positive definiteness "
    "(possible only for ω > λ₁): Newton steps climb; the default lifts the falls of b until Cholesky succeeds.",
    ("semismooth Newton", WANDERING): "branches neither settle nor return within 200 steps; as above, every step of "
    "the default lowers L̃.",
    ("semismooth Newton", CANCELLATION): "branches settle, but rounding leaves a residual above the tolerance.",
    (
        "path",
        FOLDS,
    ): "the path turns back and forth: with steep softening every node that lets go is a fold of its own, "
    "and all solutions on the way are visited; the run ends with a reason, and the default solves one load directly.",
    ("path", BRANCHES): "the path ends where branches meet (a bifurcation, or pieces that it has been on); the end is "
    "recorded with its reason and no solution is invented.",
    ("path", CANCELLATION): "rounding left a residual above the tolerance on a path of many pieces.",
    **{
        (
            name,
            AT_KINK,
        ): "one subgradient says nothing about the other side of a sticking kink, so that the line search "
        "or trust region collapses beside it with nodes that should rest on it; the default knows the interval b̂ "
        "and rests the node."
        for name in SCIPY
    },
    **{
        (name, OTHER): "the nodes that should rest are on their kinks, but the jump of the gradient there ends the "
        "line search or shrinks the trust region before the slipping nodes are balanced (probe at m = 30, ω/λ₁ = 1.33, "
        "L-BFGS-B: 13 nodes miss the inclusion, 11 of them slip; trust-exact: 19 and 11); "
        "the default takes resting nodes out of the system."
        for name in SCIPY
    },
}

SILENT_NOTE = """They sit on the edge of the region of cancellation: the package computes the residual in double
precision and finds it just below the tolerance, extended precision just above. The residual there is itself rounding.
"""

HEAD = """# Where the contact solvers work and where they fail

Made by `python -m tests.benchmarks.stability`; every solve is a line of `stability.csv`, the maps are `stability.png`.
A solution has an inclusion residual of at most 1e-10, computed in extended precision by code that the package does not
share. *Silent* is what reports success and is none. `separable-newton` is bundle-Newton with a bundle per node, the
default; `bundle-newton` keeps one for L̃.
"""


def markdown(rows: Sequence[Row]) -> str:
    """The whole text."""
    parts = [HEAD, _table(rows, MAPS), "## The default on real bodies\n", _chain(rows), "## Failing regions\n"]
    for contender in CONTENDERS:
        parts += _regions([row for row in rows if row.method == contender.name], contender.name)
    parts += _default(rows)
    silent = [row for row in rows if row.method == DEFAULT and row.outcome == SILENT]
    parts.append(f"Silent failures of the default: {len(silent)} of {_count(rows, DEFAULT)}.\n")
    if silent:
        parts.append(SILENT_NOTE)
    parts += [f"- {row.map}, x = {row.x:g}, y = {row.y:g}, load {row.load}: {row.residual:.2e}\n" for row in silent]
    return "\n".join(parts)


def _default(rows: Sequence[Row]) -> list[str]:
    """What else is to be known of the default: its longest runs, solutions that are not the lowest."""
    own = [row for row in rows if row.method == DEFAULT]
    limit = [row for row in own if row.iterations >= 300]
    higher = [row for row in own if row.outcome == SOLVED and row.gap > 1e-9]
    solved = sum(row.outcome == SOLVED for row in own)
    where = Counter(row.map for row in higher)
    return [
        "### The default in detail\n",
        f"- All starts and the search for less energy together took 300 steps or more in {len(limit)} of "
        f"{len(own)} runs ({', '.join(sorted({row.map for row in limit})) or 'no map'}; most: "
        f"{max((row.iterations for row in own), default=0)}).",
        f"- In {len(higher)} of {solved} solved runs another method found a solution of lower energy "
        f"({', '.join(f'{name} {count}' for name, count in where.items()) or 'none'}; largest gap "
        f"{max((row.gap for row in higher), default=0.0):.1e}): with jumps or ω > λ₁ L̃ has many local minima; "
        "convexified problems and moves of single nodes find most of the lowest, not what only several nodes together "
        "reach. A study stores whether the minimum is proved to be global, and path following gives others.\n",
    ]


def _count(rows: Sequence[Row], method: str) -> int:
    return sum(row.method == method for row in rows)


def _table(rows: Sequence[Row], maps: Sequence[str]) -> str:
    """Counts and medians by method on the synthetic maps."""
    lines = [
        "| method | solved | flagged | silent | too slow | worst residual solved | iterations median / most | "
        "energy gap > 1e-9 / largest |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for contender in CONTENDERS:
        own = [row for row in rows if row.method == contender.name and row.map in maps]
        good = [row for row in own if row.outcome == SOLVED]
        counts = Counter(row.outcome for row in own)
        steps = [row.iterations for row in good] or [0]
        gaps = [row.gap for row in good] or [0.0]
        lines.append(
            f"| {contender.name} | {len(good)}/{len(own)} | {counts[FLAGGED]} | {counts[SILENT]} | {counts[SLOW]} | "
            f"{max((row.residual for row in good), default=float('nan')):.0e} | "
            f"{np.median(steps):.0f} / {max(steps)} | "
            f"{sum(gap > 1e-9 for gap in gaps)} / {max(gaps):.1e} |"
        )
    return "\n".join(lines) + "\n"


def _chain(rows: Sequence[Row]) -> str:
    lines = ["| map | solved | flagged | silent | worst residual solved | worst heat balance | most iterations |",
             "|---|---|---|---|---|---|---|"]  # fmt: skip
    for name in CHAIN:
        own = [row for row in rows if row.map == name]
        good = [row for row in own if row.outcome == SOLVED]
        counts = Counter(row.outcome for row in own)
        lines.append(
            f"| {name} | {len(good)}/{len(own)} | {counts[FLAGGED]} | {counts[SILENT]} | "
            f"{max((row.residual for row in good), default=float('nan')):.0e} | "
            f"{max((row.heat_balance for row in own), default=float('nan')):.0e} | "
            f"{max((row.iterations for row in own), default=0)} |"
        )
    return "\n".join(lines) + "\n"


def _regions(rows: Sequence[Row], method: str) -> list[str]:
    """One item for each map and mechanism."""
    failed: dict[tuple[str, str], list[Row]] = {}
    for row in rows:
        if row.outcome != SOLVED and row.mechanism:
            failed.setdefault((row.mechanism, row.map), []).append(row)
    said = [f"### {method}\n"]
    for mechanism in dict.fromkeys(key[0] for key in failed):
        where = "; ".join(
            f"{name} {_extent(own)} ({len(own)} of {sum(r.map == name for r in rows)}{_ends(own)})"
            for (kind, name), own in failed.items()
            if kind == mechanism
        )
        name = UNBALANCED if mechanism == OTHER and method in SCIPY else mechanism
        said.append(f"- **{name}**, {where}: {EXPLAINED[method, mechanism]}")
    if len(said) == 1:
        said.append("- no failing region.")
    return [*said, ""]


def _extent(rows: Sequence[Row]) -> str:
    x, y = [row.x for row in rows], [row.y for row in rows]
    return f"x {_range(x)}, y {_range(y)}"


def _range(values: Sequence[float]) -> str:
    low, high = min(values), max(values)
    return f"{low:g}" if low == high else f"{low:g} … {high:g}"


def _ends(rows: Sequence[Row]) -> str:
    silent, slow = (sum(row.outcome == kind for row in rows) for kind in (SILENT, SLOW))
    return "".join(f", {n} {word}" for n, word in ((silent, "silent"), (slow, "too slow")) if n)
