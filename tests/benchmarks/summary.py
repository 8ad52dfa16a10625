"""Counts and medians of the stored measurements, for the chart's table and for the Markdown one."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from tests.benchmarks.measure import NOT_RUN, OUT_OF_MEMORY, TIME_LIMIT
from tests.benchmarks.problems import BODY, BODY_RATIO, SAWTOOTH, WEAKENING

Mask = NDArray[np.bool_]


@dataclass(frozen=True)
class Column:
    """A column of the success table: cases that are counted together, (case,) mask."""

    group: str
    title: str
    cases: Mask


def columns(data: xr.Dataset) -> list[Column]:
    """Size by softening, then the saw-tooth by size, then the body by softening."""
    family, m, ratio = (data[name].values for name in ("family", "m", "ratio"))
    found = []
    for name in (WEAKENING, SAWTOOTH, BODY):
        for size in np.unique(m[family == name]):
            for softening in np.unique(ratio[(family == name) & (m == size)]):
                cases = (family == name) & (m == size) & (ratio == softening)
                group = f"m = {size}" if name == WEAKENING else name
                found.append(Column(group, f"{softening:g}" if name == WEAKENING else f"{size}", cases))
    return found


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


def cell(data: xr.Dataset, method: str, cases: Mask) -> tuple[str, float]:
    """("solved/run", share) for some cases; ("–", NaN) where the method was not run."""
    good, run = solved(data.isel(case=cases), method)
    return (f"{good}/{run}", good / run) if run else ("–", float("nan"))


def markdown(data: xr.Dataset) -> str:
    """The measurements as a short Markdown table with what they were measured on."""
    groups = list(dict.fromkeys(column.group for column in columns(data)))
    head = ["method", *groups, "of lowest energy", "false success", "solved when finished"]
    lines = ["| " + " | ".join(head) + " |", "|---" * len(head) + "|"]
    lines += ["| " + " | ".join(_row(data, str(method), groups)) + " |" for method in data["solver"].values]
    return "\n".join([*_introduction(data), "", *lines, "", *_notes(data), ""])


def _row(data: xr.Dataset, method: str, groups: list[str]) -> Iterator[str]:
    yield method
    for group in groups:
        cases = np.any([c.cases for c in columns(data) if c.group == group], axis=0)
        text, _ = cell(data, method, cases)
        times = data["time"].sel(solver=method).values[cases]
        yield text if text == "–" else f"{text}, {_seconds(float(np.nanmedian(times)))}"
    for good, total in (lowest(data, method), wrong_claims(data, method), solved(data, method, finished=True)):
        yield f"{good}/{total}"


def _seconds(value: float) -> str:
    return f"{1e3 * value:.2g} ms" if value < 0.0995 else f"{value:.2g} s"


def _versions(data: xr.Dataset) -> str:
    return ", ".join(f"{name} {version}" for name, version in json.loads(data.attrs.get("versions", "{}")).items())


def _introduction(data: xr.Dataset) -> list[str]:
    return [
        "Made by `python -m tests.benchmarks.peers`, with `peers.png` and `peers.nc`.",
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
