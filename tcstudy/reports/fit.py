"""What a fit's file says, as text and as one object: estimates, what is not determined, how good it is."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from tcstudy.data.fit_store import open_fit
from tcstudy.reports.tables import plain_table
from tcstudy.reports.text import counted, number, prefix

WIDE = 1.0
"""Half width of an interval, of the estimate, above which the data hardly say anything of a number."""
DOUBT = 0.05
"""Probability below which a fit is doubted."""
COARSE = 0.15
"""Change on a mesh of half the size, in standard errors, above which the mesh is too coarse: as much again may be left,
and intervals of 95 % that lie 0.3 standard errors off hold the truth in 94 %, beyond it in fewer and fewer."""
ABOUT = (
    *("compare", "loss", "data_file", "data_sha256", "known_noise", "chi_square", "degrees_of_freedom"),
    *("fit_probability", "runs", "runs_probability", "information_criterion", "not_determined", "determined"),
    *("solves", "evaluations", "message"),
)
"""Attributes of a file that are told of it as they are."""
DOUBTS = ("determined:", "do not agree", "wrong shape", "too coarse", "not known")
"""Words of what speaks against a fit."""


def fit_summary(path: Path) -> str:
    """What a fit found; raises StoreError."""
    with open_fit(path) as opened:
        data = opened.load()
    parts = [data.attrs["title"], _estimates(data), *_said(data), _starts(data)]
    return "\n\n".join(part for part in parts if part)


def fit_brief(path: Path) -> dict[str, Any]:
    """The object of --json, in SI units, with the sentence of --quiet as its `verdict`. Raises StoreError."""
    with open_fit(path) as opened:
        data = opened.load()
    names, units = ([str(x) for x in data[key].values] for key in ("parameter", "parameter_units"))
    told, words = {}, []
    for i, name in enumerate(names):
        told[name] = {"units": units[i]} | {
            key: data[key].values[i].tolist()
            for key in ("estimate", "standard_error", "interval", "mesh_shift", "at_bound", "parameter_within")
            if key in data
        }
        estimate, error = float(data["estimate"][i]), float(data["standard_error"][i])
        divisor, unit = prefix([estimate], units[i])
        value = f"{number(estimate / divisor)} ± {number(error / divisor, 2)}"
        words.append(f"{name} = {value} {unit}".removesuffix(" 1"))
    doubts = [line.strip() for line in _said(data)[0].split("\n") if any(doubt in line for doubt in DOUBTS)]
    about = {key: data.attrs[key] for key in ABOUT if key in data.attrs}
    found = {"title": str(data.attrs["title"]), "verdict": "; ".join([", ".join(words), *doubts]), "parameters": told}
    lists = {key: data[key].values.tolist() for key in ("covariance", "singular_value", "singular_vector")}
    starts = {key: data[key].values.tolist() for key in ("start_cost", "start_estimate", "start_evaluations")}
    return found | lists | starts | about


def _estimates(data: Any) -> str:
    """A row for each number, with its correlations."""
    names = [str(name) for name in data["parameter"].values]
    covariance = data["covariance"].values
    error = np.sqrt(np.diagonal(covariance))
    rows = []
    for i, name in enumerate(names):
        low, high = data["interval"].values[i]
        estimate, units = float(data["estimate"][i]), str(data["parameter_units"].values[i])
        divisor, unit = prefix([estimate], units)
        between = f"{number(low / divisor)} … {number(high / divisor)}" if np.isfinite(low) else "on its bound"
        own = [number(estimate / divisor, 5), number(float(data["standard_error"][i]) / divisor, 2), between]
        with np.errstate(invalid="ignore"):
            correlated = covariance[i] / (error[i] * error)
        rows.append([name, *own, unit, *(number(x, 2) for x in correlated[:i]), *("" for _ in names[i:])])
    header = ["number", "estimate", "standard error", "95 % interval", "unit"]
    header += [f"corr. {k + 1}" for k in range(len(names))]
    last = len(header) - 1  # nothing stands above the diagonal
    return plain_table(header[:last], [row[:last] for row in rows])


def _said(data: Any) -> list[str]:
    """What the data do not determine, and whether the model has their shape."""
    about, n = data.attrs, data.sizes["datum"]
    freedom, square = int(about["degrees_of_freedom"]), float(about["chi_square"])
    lines = []
    if about["not_determined"]:
        lines.append(f"  not determined: {about['not_determined']}; the data determine {about['determined']} only")
    wide = [
        str(data["parameter"].values[i])
        for i in range(data.sizes["parameter"])
        if np.ptp(data["interval"].values[i]) > 2.0 * WIDE * abs(float(data["estimate"][i]))
    ]
    if wide:
        lines.append(f"  hardly determined: {', '.join(wide)}: the interval is wider than the number")
    if int(about["known_noise"]):
        p = float(about["fit_probability"])
        verdict = "the data do not agree with the study and this noise" if p < DOUBT else "as the noise lets expect"
        shown = number(square / max(freedom, 1), 3)
        lines.append(f"  χ² per degree of freedom {shown} ({freedom}), probability {number(p, 2)}: {verdict}")
    else:
        shown = number(np.sqrt(square / max(freedom, 1)), 3)
        lines.append(f"  noise estimated from the residuals: {shown} of what was assumed (1 % of a column's range)")
    lines += _mesh(data)
    p = float(about["runs_probability"])
    verdict = "the curve may be of the wrong shape" if p < DOUBT else "no trend"
    lines.append(f"  signs of the residuals: {int(about['runs'])} runs, probability {number(p, 2)}: {verdict}")
    evaluations, solves = int(about["evaluations"]), int(about["solves"])
    what = "paths followed" if about["compare"] == "orthogonal" else "contact problems solved"
    lines.append(
        f"  {n} data ({about['data_file']}), {about['compare']}, {counted(evaluations, 'evaluation')}, {solves} {what} "
        f"in all; AICc {number(float(about['information_criterion']), 5)}"
    )
    return ["\n".join(lines)]


def _mesh(data: Any) -> list[str]:
    """What the mesh does to the numbers."""
    if "mesh_shift" not in data:  # an older file
        return []
    shift, names = data["mesh_shift"].values, data["parameter"].values
    if not np.any(np.isfinite(shift)):
        return ["  mesh: what it does to the numbers is not known"]
    told = ", ".join(f"{name} by {x:+.2f}" for name, x in zip(names, shift, strict=True) if np.isfinite(x))
    verdict = "too coarse for these data; refine" if np.nanmax(np.abs(shift)) > COARSE else "fine enough"
    return [f"  mesh: half its size would move {told} standard errors: {verdict}"]


def _starts(data: Any) -> str:
    """Other minima, if several starts found any."""
    if data.sizes.get("start", 1) < 2:
        return ""
    rows = []
    for k in range(data.sizes["start"]):
        found = zip(data["start_estimate"].values[k], data["parameter_units"].values, strict=True)
        cells = []
        for value, units in found:
            divisor, unit = prefix([float(value)], str(units))
            cells.append(f"{number(value / divisor)} {unit}".removesuffix(" 1"))
        rows.append([number(2.0 * float(data["start_cost"][k]), 4), *cells])
    title = "  Other starts end in other minima; the first is the lowest:"
    return f"{title}\n\n" + plain_table(["Σ r²", *map(str, data["parameter"].values)], rows)
