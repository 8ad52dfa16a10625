"""Bundle-Newton and its peers on the same contact problems: `python -m tests.benchmarks.peers`.

Writes peers.nc (measurements), peers-small.png (chart) and peers.md (table) into results/; about eight minutes.
`--draw` makes chart and table again from the stored measurements.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
from collections.abc import Sequence
from pathlib import Path

import xarray as xr
from threadpoolctl import threadpool_info, threadpool_limits

from tcstudy.data.provenance import git_commit, package_versions
from tests.benchmarks import charts
from tests.benchmarks.measure import measure
from tests.benchmarks.problems import cases
from tests.benchmarks.summary import markdown

RESULTS = Path(__file__).resolve().parents[2] / "results"
PACKAGES = ("numpy", "scipy", "ngsolve", "tcstudy")
MEMORY = 10 * 2**30
"""Bytes that the command may take; a method that wants more is recorded as out of memory."""


def main(arguments: Sequence[str] | None = None) -> None:
    """Measure, store, draw."""
    parser = argparse.ArgumentParser(prog="python -m tests.benchmarks.peers", description=__doc__.splitlines()[0])
    parser.add_argument("--draw", action="store_true", help="only draw again what results/peers.nc holds")
    parser.add_argument("--output", type=Path, default=RESULTS, help="folder to write to (default: results/)")
    options = parser.parse_args(arguments)
    stored = options.output / "peers.nc"
    if not options.draw:
        limit_memory()
        families = list(cases())  # loads every library before the limit on its threads
        with threadpool_limits(1, user_api="blas"):
            data = measure(families, progress=lambda line: print(line, flush=True))
            data.attrs |= provenance()
        options.output.mkdir(parents=True, exist_ok=True)
        data.to_netcdf(stored)
    report(stored, options.output)


def report(stored: Path, output: Path) -> None:
    """Chart and table from the stored measurements."""
    with xr.open_dataset(stored) as data:
        charts.peers(data.load(), output / "peers-small.png")
        (output / "peers.md").write_text(markdown(data), encoding="utf-8")
    print(f"peers.nc, peers-small.png, peers.md in {output.name}/")


def provenance() -> dict[str, str]:
    """Title, versions, commit and what of the machine decides the times; no names."""
    blas = [pool for pool in threadpool_info() if pool["user_api"] == "blas"]
    libraries = sorted({f"{pool['internal_api']} {pool['version']}" for pool in blas})
    threads = max((pool["num_threads"] for pool in blas), default=1)
    versions = {"python": platform.python_version(), **package_versions(PACKAGES)}
    return {
        "Conventions": "CF-1.11",
        "title": "Contact solvers compared on the same problems",
        "source": "python -m tests.benchmarks.peers",
        "machine": f"{platform.machine()}, {os.cpu_count()} CPUs, {', '.join(libraries)} with {threads} thread(s)",
        "versions": json.dumps(versions),
        "git_commit": git_commit(Path(__file__)),
    }


def limit_memory() -> None:
    """Turn a method's hunger for memory into a MemoryError, where the system can."""
    try:
        import resource
    except ImportError:  # Windows
        return
    _, hard = resource.getrlimit(resource.RLIMIT_AS)
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, hard))


if __name__ == "__main__":
    main()
