"""Where the contact solvers work and where they fail: `python -m tests.benchmarks.stability`, about eight minutes.

Writes stability.csv (a line for every solve), stability.png (heat maps) and stability.md (every failing region in a
sentence) into results/. `--draw` makes the picture and the text again from the stored lines.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

from threadpoolctl import threadpool_limits

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
    report(stored, options.output)


def run(stored: Path, grid: Grid, chain_grid: ChainGrid, limit: float) -> None:
    """Measure all methods on the synthetic maps and the default on real bodies."""

    def say(line: str) -> None:
        print(line, flush=True)

    rows = [*measure(chain(chain_grid), CONTENDERS[:1], limit, say), *measure(synthetic(grid), CONTENDERS, limit, say)]
    stored.parent.mkdir(parents=True, exist_ok=True)
    write(rows, stored)


def report(stored: Path, output: Path) -> None:
    """Picture and text from the stored lines."""
    from tests.benchmarks.stability_draw import draw
    from tests.benchmarks.stability_text import markdown

    rows = read(stored)
    draw(rows, output / "stability.png")
    (output / "stability.md").write_text(markdown(rows), encoding="utf-8")
    print(f"stability.csv, stability.png, stability.md in {output.name}/")


if __name__ == "__main__":
    main()
