"""Speed of a point, a sweep and a large scene: `python -m tests.benchmarks.speed`.

Writes speed.nc (measurements), speed.png (charts) and speed.md (tables) into results/; about ten minutes.
`--draw` makes charts and tables again from the stored measurements.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
import xarray as xr
from threadpoolctl import threadpool_limits

from tests.benchmarks import stages, sweep
from tests.benchmarks.peers import RESULTS, provenance
from tests.benchmarks.speed_chart import draw, spread

ASYMPTOTIC = 1e4
"""Unknowns from which exponents are fitted."""


def main(arguments: Sequence[str] | None = None) -> None:
    """Measure, store, draw."""
    parser = argparse.ArgumentParser(prog="python -m tests.benchmarks.speed", description=__doc__.splitlines()[0])
    parser.add_argument("--draw", action="store_true", help="only draw again what results/speed.nc holds")
    parser.add_argument("--output", type=Path, default=RESULTS, help="folder to write to (default: results/)")
    options = parser.parse_args(arguments)
    stored = options.output / "speed.nc"
    if not options.draw:
        with threadpool_limits(1, user_api="blas"):
            parts = [part(_say) for part in (sweep.measure, stages.measure, sweep.measure_large)]
            data = xr.merge(parts, combine_attrs="no_conflicts")
            data.attrs |= provenance() | {
                "title": "Speed of a point, a sweep and a large scene",
                "source": "python -m tests.benchmarks.speed",
            }
        options.output.mkdir(parents=True, exist_ok=True)
        data.to_netcdf(stored)
    with xr.open_dataset(stored) as data:
        draw(data.load(), options.output / "speed.png")
        (options.output / "speed.md").write_text("\n".join([*_text(data), ""]), encoding="utf-8")
    _say(f"speed.nc, speed.png, speed.md in {options.output.name}/")


def _say(line: str) -> None:
    print(line, flush=True)


def _text(data: xr.Dataset) -> Iterator[str]:
    """The measurements as Markdown."""
    yield f"Made by `{data.attrs['source']}`, with `speed.png` and `speed.nc`."
    yield "CPU times [s] of one thread, median [quartiles]; the machine was shared with other work."
    yield f"Measured with {data.attrs['machine']}; {data.attrs['versions']}."
    yield ""
    n, m = data["n_dof"].values, data["m"].values
    yield from _table("stage", data["stage_time"], n, m)
    yield ""
    yield from _table("factor of the stiffness matrix", data["factor_time"], n, m)
    yield ""
    yield "p: time ~ Nᵖ, fitted from N = 10⁴ on; m ~ √N on these meshes, so that in m the exponent is 2p."
    yield ""
    yield from _sweeps(data)


def _table(name: str, times: xr.DataArray, n: np.ndarray, m: np.ndarray) -> Iterator[str]:
    yield f"| {name} | " + " | ".join(f"N = {a:,}, m = {b}" for a, b in zip(n, m, strict=True)) + " | p |"
    yield "|---" * (len(n) + 2) + "|"
    low, middle, high = spread(times, "run")
    for i, label in enumerate(times[times.dims[1]].values):
        cells = [_cell(*v) for v in zip(low[:, i], middle[:, i], high[:, i], strict=True)]
        yield f"| {label} | " + " | ".join(cells) + f" | {_exponent(n, middle[:, i])} |"


def _cell(low: float, middle: float, high: float) -> str:
    return "–" if np.isnan(middle) else f"{middle:.3g} [{low:.3g}, {high:.3g}]"


def _exponent(n: np.ndarray, times: np.ndarray) -> str:
    use = (n >= ASYMPTOTIC) & np.isfinite(times) & (times > 0.0)
    if np.count_nonzero(use) < 2:
        return "–"
    return f"{np.polyfit(np.log(n[use]), np.log(times[use]), 1)[0]:.2f}"


def _sweeps(data: xr.Dataset) -> Iterator[str]:
    """Ratios of the sweep and of the large scene."""
    cold = data["sweep_time"].sel(kind=data["kind"][0], count=1)
    low, middle, high = spread(data["sweep_time"].isel(count=-1) / cold, "sweep_run")
    for i, kind in enumerate(data["kind"].values):
        yield (
            f"- 1000 points, {kind}, N = {data.attrs['sweep_n_dof']:,}: {_cell(low[i], middle[i], high[i])} × one cold "
            "point, both without mesh, contact solves and certificates;"
        )
    solve = float(data["solve_time"].median()) / float(cold.median())
    yield f"- a contact solve with its certificates there: {solve:.3f} × one cold point;"
    ratio = float((data["large_time"] / data["large_factor_time"]).median())
    memory = float(data["large_memory"].max())
    yield (
        f"- 20 points on N = {data.attrs['large_n_dof']:,}, mesh, solves and certificates included: {ratio:.2f} × "
        f"NGSolve's sparsecholesky factorisation of the stiffness matrix, peak memory {memory:.2f} GB."
    )


if __name__ == "__main__":
    main()
