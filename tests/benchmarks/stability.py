"""Where the contact solvers work and where they fail: `python -m tests.benchmarks.stability`, about eight minutes.

Writes stability.csv (a line for every solve) and stability-small.png into results/; `--draw` makes the picture again
from the stored lines.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

from threadpoolctl import threadpool_limits

from tests.benchmarks import charts
from tests.benchmarks.stability_chain import ChainGrid, chain
from tests.benchmarks.stability_maps import Grid, synthetic
from tests.benchmarks.stability_measure import measure, read, write
from tests.benchmarks.stability_trial import CONTENDERS

RESULTS = Path(__file__).resolve().parents[2] / "results"
LIMIT = 1.0
"""Seconds of CPU time for one solve."""


def main(arguments: Sequence[str] | None = None) -> None:
    """Measure, store, draw."""
    parser = argparse.ArgumentParser(prog="python -m tests.benchmarks.stability", description=__doc__.splitlines()[0])
    parser.add_argument("--draw", action="store_true", help="only draw again what results/stability.csv holds")
    parser.add_argument("--output", type=Path, default=RESULTS, help="folder to write to (default: results/)")
    options = parser.parse_args(arguments)
    stored = options.output / "stability.csv"
    if not options.draw:
        with threadpool_limits(1, user_api="blas"):
            run(stored, Grid(), ChainGrid(), LIMIT)
    charts.stability(read(stored), options.output / "stability-small.png")
    print(f"stability.csv, stability-small.png in {options.output.name}/")


def run(stored: Path, grid: Grid, chain_grid: ChainGrid, limit: float) -> None:
    """Measure all methods on the synthetic maps and the default on real bodies."""

    def say(line: str) -> None:
        print(line, flush=True)

    rows = [*measure(chain(chain_grid), CONTENDERS[:1], limit, say), *measure(synthetic(grid), CONTENDERS, limit, say)]
    stored.parent.mkdir(parents=True, exist_ok=True)
    write(rows, stored)


if __name__ == "__main__":
    main()
