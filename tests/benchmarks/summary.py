"""Counts and medians of the stored measurements, for the chart and the Markdown table."""

from __future__ import annotations

import json
from collections.abc import Iterator

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from tests.benchmarks.measure import NOT_RUN, OUT_OF_MEMORY, TIME_LIMIT
from tests.benchmarks.problems import BODY, BODY_RATIO, SAWTOOTH, WEAKENING

Mask = NDArray[np.bool_]


def groups(data: xr.Dataset) -> dict[str, Mask]:
    """(case,) masks of what is counted together: slip weakening by size, the saw-tooth, the body."""
    family, m = data["family"].values, data["m"].values
    found = {f"m = {size}": (family == WEAKENING) & (m == size) for size in np.unique(m[family == WEAKENING])}
    return found | {name: family == name for name in (SAWTOOTH, BODY) if np.any(family == name)}


def residual(data: xr.Dataset) -> xr.DataArray:
    """(case, solver) inclusion residual under the mildest judgement: nodes within 1e-6 of the kink spacing snapped."""
    return data["residual"].isel(snap=-1)


def solved(data: xr.Dataset, method: str, finished: bool = False) -> tuple[int, int]:
    """(solved, run) of one method, as returned or after Newton on the identified pieces."""
    one = data.sel(solver=method)
    judged = one["residual_finished"] if finished else residual(one)
    run = one["end"].values != NOT_RUN
    return int(np.sum(judged.values[run] <= data.attrs["tolerance"])), int(np.sum(run))


def wrong_claims(data: xr.Dataset, method: str) -> tuple[int, int]:
    """(claims of success that the inclusion refutes, claims)."""
    one = data.sel(solver=method)
    claims = one["claims"].values == 1
    return int(np.sum(~(residual(one).values[claims] <= data.attrs["tolerance"]))), int(np.sum(claims))


def lowest(data: xr.Dataset, method: str) -> tuple[int, int]:
    """(solutions at the lowest energy that any method found, to 1e-9, solutions)."""
    one = data.sel(solver=method)
    good = residual(one).values <= data.attrs["tolerance"]
    return int(np.sum(one["energy_gap"].values[good] <= 1e-9)), int(np.sum(good))


def markdown(data: xr.Dataset) -> str:
    """The measurements as a short Markdown table with what they were measured on."""
    head = ["method", *groups(data), "of lowest energy", "false success", "solved when finished"]
    lines = ["| " + " | ".join(head) + " |", "|---" * len(head) + "|"]
    lines += ["| " + " | ".join(_row(data, str(method))) + " |" for method in data["solver"].values]
    return "\n".join([*_introduction(data), "", *lines, "", *_notes(data), ""])


def _row(data: xr.Dataset, method: str) -> Iterator[str]:
    yield method
    for cases in groups(data).values():
        good, run = solved(data.isel(case=cases), method)
        times = data["time"].sel(solver=method).values[cases]
        yield f"{good}/{run}, {_seconds(float(np.nanmedian(times)))}" if run else "–"
    for good, total in (lowest(data, method), wrong_claims(data, method), solved(data, method, finished=True)):
        yield f"{good}/{total}"


def _seconds(value: float) -> str:
    return f"{1e3 * value:.2g} ms" if value < 0.0995 else f"{value:.2g} s"


def _versions(data: xr.Dataset) -> str:
    return ", ".join(f"{name} {version}" for name, version in json.loads(data.attrs.get("versions", "{}")).items())


def _introduction(data: xr.Dataset) -> list[str]:
    return [
        "Made by `python -m tests.benchmarks.peers`, with `peers-small.png` and `peers.nc`.",
        f"Cells: solved/run (inclusion residual ≤ {data.attrs['tolerance']:.0e}), median time.",
    ]


def _notes(data: xr.Dataset) -> list[str]:
    count = {end: int(np.sum(data["end"].values == end)) for end in (NOT_RUN, TIME_LIMIT, OUT_OF_MEMORY)}
    return [
        f"{data.sizes['case']} problems; {count[TIME_LIMIT]} solves stopped at {data.attrs['time_limit']:g} s, "
        f"{count[OUT_OF_MEMORY]} for lack of memory, {count[NOT_RUN]} not run because the method had been too slow "
        "before (– where none was).",
        f"m = …: half-Laplacian with slip weakening, ω/λ₁ = 0.5, 2 and 8 together; body: condensed rectangle, "
        f"ω/λ₁ = {BODY_RATIO:g}. All start from zero and, if that fails, from the frictionless solution; *default* is "
        "separable-newton as a study calls it, from both and with the search for less energy.",
        "*Of lowest energy*: of the solutions, those at the lowest energy that any method found. *False success*: of "
        "the answers called a success by the method, those that are no solution. *Finished*: every answer handed to "
        "Newton on the identified pieces, which is the last step of the first three methods.",
        f"Measured on {data.attrs.get('machine', 'unknown')}; {_versions(data)}.",
    ]
