"""What a study that names several solvers says of them: one row per solver over all points and levels."""

from __future__ import annotations

from typing import Any

import numpy as np

from tcstudy.report.text import number, table

SAME = 1e-9
"""Difference of energies, relative to the largest of a point, that is rounding."""


def solver_table(data: Any) -> str:
    """Solvers compared where a run kept them side by side; empty where it used one."""
    if "solver" not in data.dims:
        return ""
    energy = _by_solver(data, "solver_energy")
    known = np.isfinite(energy).any(axis=0)
    lowest = np.min(np.where(np.isfinite(energy), energy, np.inf), axis=0)
    slack = SAME * np.max(np.abs(np.nan_to_num(energy)), axis=0)
    names = [str(name) for name in data["solver"].values]
    columns = [_by_solver(data, f"solver_{what}") for what in ("residual", "iterations", "time", "difference")]
    rows = []
    for i, name in enumerate(names):
        residual, steps, time, apart = (column[i][known] for column in columns)
        least = int(np.count_nonzero((energy[i] <= lowest + slack)[known]))
        largest = number(_largest(apart), 2) if i else "–"
        rows.append([name, number(_largest(residual), 2), f"{steps[steps > 0].sum():.0f}", number(np.nansum(time), 2),
                     f"{least}/{int(known.sum())}", largest])  # fmt: skip
    header = ["solver", "worst residual", "steps", "solve [s]", "least energy", "largest difference of u_T"]
    legend = f"  Solvers compared on all points and levels; the solutions stored are those of {names[0]}:"
    return legend + "\n\n" + table(header, rows)


def _by_solver(data: Any, name: str) -> Any:
    """(solver, point and level) values of a variable."""
    values = data[name].transpose("solver", ...).values.astype(float)
    return values.reshape(values.shape[0], -1)


def _largest(values: Any) -> float:
    return float(np.nanmax(values)) if np.isfinite(values).any() else float("nan")
