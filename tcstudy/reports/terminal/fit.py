"""Report on the file of a fit: estimates, what is not determined, how good the fit is."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tcstudy.reports.text import Heading, Part, Table, Verdict, counted, number, prefix, pretty

MIN_P = 0.05
"""p-value below which a fit is doubted."""
RIVAL = 3.84
"""Σr² above the least, in variances of the noise, up to which another minimum agrees with the data
as well: 95 % of χ² of one number."""
MAX_SHIFT = 0.15
"""Change on a mesh of half the size, in standard errors, above which the mesh is too coarse.

As much again may be left. Intervals of 95 % that lie 0.3 standard errors off contain the truth in
94 %, beyond it in fewer and fewer."""
BAND = 1.96
"""Half width of a band of 95 % in standard errors."""


def parts(data: Any, *_: Any) -> Iterator[Part]:
    """Yield the estimates of a fit and the work that they took."""
    yield Heading(str(data.attrs["title"]), 1)
    yield _estimates(data)
    about = data.attrs
    is_orthogonal = about["compare"] == "orthogonal"
    unit_of_work = "paths followed" if is_orthogonal else "contact problems solved"
    work = [
        f"{data.sizes['row']} data ({about['data_file']})",
        str(about["compare"]),
        counted(int(about["evaluations"]), "evaluation"),
        f"{int(about['solves'])} {unit_of_work} in all",
    ]
    criterion = number(float(about["information_criterion"]), 5)
    yield f"  {', '.join(work)}; AICc {criterion}"


def verdict(data: Any) -> Verdict:
    """Return the fitted parameters with their standard errors, and the doubts about them."""
    answer = list[str]()
    keys = ("parameter", "parameter_units", "estimate", "standard_error")
    columns = [data[key].values for key in keys]
    for name, units, estimate, error in zip(*columns, strict=True):
        divisor, unit = prefix([float(estimate)], str(units))
        value = f"{name} = {number(float(estimate) / divisor)} {pretty(unit)}".rstrip()
        if np.isfinite(error):
            value += f", standard error {number(float(error) / divisor, 3)}"
        answer.append(value)
    starts = tuple(text for text, _ in _tried(data))
    return Verdict(
        answer=tuple(answer),
        trust=tuple(text for text, _ in _agreement(data)),
        accuracy=tuple(text for text, _ in _mesh(data)),
        solved=(f"{data.sizes['row']} data", *starts),
        complete=not any(doubt for _, doubt in fit_doubts(data)),
    )


def _estimates(data: Any) -> Table:
    """Return a row for each parameter with its correlations.

    A parameter on its bound, or not determined, has none.
    """
    names, covariance = [str(name) for name in data["parameter"].values], data["covariance"].values
    error = np.sqrt(np.diagonal(covariance))
    with np.errstate(invalid="ignore", divide="ignore"):
        correlations = covariance / np.outer(error, error)
    rows = list[list[str]]()
    for i, name in enumerate(names):
        low, high = data["interval"].values[i]
        estimate = float(data["estimate"].values[i])
        divisor, unit = prefix([estimate], str(data["parameter_units"].values[i]))
        if np.isfinite(low):
            interval = f"{number(low / divisor)} … {number(high / divisor)}"
        else:
            interval = "on its bound" if int(data["at_bound"].values[i]) else "not identifiable"
        standard_error = float(data["standard_error"].values[i])
        cells = [number(estimate / divisor, 5), number(standard_error / divisor, 2), interval, unit]
        below_diagonal = [number(correlation, 2) for correlation in correlations[i, :i]]
        blanks = [""] * (len(names) - 1 - i)
        rows.append([name, *cells, *below_diagonal, *blanks])
    header = ["number", "estimate", "standard error", "95 % interval", "unit"]
    header += [f"corr. {k}" for k in range(1, len(names))]
    return Table.of_rows("", header, rows)


def columns(data: Any) -> tuple[list[tuple[str, str]], list[tuple[str, str]]]:
    """Return (name, units) of the given and of the measured columns."""
    return _columns(data.attrs["given"]), _columns(data.attrs["measured"])


def _columns(text: Any) -> list[tuple[str, str]]:
    """Return (name, units) of columns "name [units]; name [units]"."""
    pairs = list[tuple[str, str]]()
    for column in str(text).split("; "):
        if column:
            name, _, units = column.rpartition(" [")
            pairs.append((name, units.removesuffix("]")))
    return pairs


def prediction_error(data: Any) -> NDArray[np.float64]:
    """Return (n,) standard errors of the study's values at the data, in the units of the data."""
    J, covariance = data["jacobian"].values, np.nan_to_num(data["covariance"].values)
    variance = np.maximum(np.einsum("nk,kl,nl->n", J, covariance, J), 0.0)
    return np.asarray(np.sqrt(variance) * data["noise"].values)


def fit_doubts(data: Any) -> list[tuple[str, bool]]:
    """Return (sentence, is a doubt) of what there is to report beside the estimates."""
    return [*_agreement(data), *_tried(data), *_mesh(data)]


def _agreement(data: Any) -> list[tuple[str, bool]]:
    """Return what the data do not determine and whether the study agrees with them."""
    about = data.attrs
    facts = list[tuple[str, bool]]()
    if about.get("noise_assumed"):
        assumed = f"the 95 % intervals assume that {about['noise_assumed']}"
        facts.append((f"{assumed}; if not, they may be too narrow: give noise", True))
    if about["not_determined"]:
        determined = f"the data determine {about['determined']} only"
        facts.append((f"not identifiable: {about['not_determined']}; {determined}", True))
    facts.append(_noise(about))
    if "numbers_decided" in about:
        decided = number(float(about["numbers_decided"]), 3)
        smooth = "smooth law, weight by generalised cross-validation"
        count = f"{decided} of {data.sizes['parameter']} numbers"
        facts.append((f"{smooth}: the data decide {count}", False))
    p = float(about["runs_probability"])
    shape = "the curve may be of the wrong shape" if p < MIN_P else "no trend"
    runs = f"{int(about['runs'])} runs, probability {number(p, 2)}"
    return [*facts, (f"signs of the residuals: {runs}: {shape}", p < MIN_P)]


def _noise(about: Mapping[str, Any]) -> tuple[str, bool]:
    """Return whether the residuals agree with the noise, or how large the noise seems."""
    freedom, square = int(about["degrees_of_freedom"]), float(about["chi_square"])
    reduced = square / max(freedom, 1)
    if not int(about["known_noise"]):
        share = number(np.sqrt(reduced), 3)
        assumed = "of what was assumed (1 % of a column's range)"
        return f"noise estimated from the residuals: {share} {assumed}", False
    p = float(about["fit_probability"])
    agreement = "consistent with the stated noise"
    if p < MIN_P:
        agreement = "the data do not agree with the study and this noise"
    square_words = f"χ² per degree of freedom {number(reduced, 3)} ({freedom})"
    return f"{square_words}, probability {number(p, 2)}: {agreement}", p < MIN_P


def _mesh(data: Any) -> list[tuple[str, bool]]:
    """Return by how much a mesh of half the size would move the parameters."""
    shift, names = data["mesh_shift"].values, data["parameter"].values
    if not np.any(np.isfinite(shift)):
        return [("mesh: its effect on the parameters is not known", True)]
    shifts = list[str]()
    for name, x in zip(names, shift, strict=True):
        if np.isfinite(x):
            shifts.append(f"{name} by {x:+.2f}")
    is_coarse = bool(np.nanmax(np.abs(shift)) > MAX_SHIFT)
    remedy = "too coarse for these data; refine" if is_coarse else "fine enough"
    moved = ", ".join(shifts)
    return [(f"mesh: half its size would move {moved} standard errors: {remedy}", is_coarse)]


def _tried(data: Any) -> list[tuple[str, bool]]:
    """Return how many starts were tried, where they end, and whether another minimum is as good."""
    about = data.attrs
    starts, tried = int(about["starts"]), int(about["starts_tried"])
    failed = int(about["starts_failed"])
    same, *others = data["start_count"].values.tolist()
    words = f"starts: {tried} of {starts} tried"
    if tried < starts:
        words += ", the last has a probable χ² and every parameter is identifiable"
    if tried > 1:
        words += f"; {same} of {tried} {'ends' if same == 1 else 'end'} in this minimum"
    if others:
        words += f", {sum(others)} in {counted(len(others), 'other')}"
    if failed:
        words += f", {failed} in no result: {about['start_failure']}"
    freedom = max(int(about["degrees_of_freedom"]), 1)
    variance = 1.0 if int(about["known_noise"]) else float(about["chi_square"]) / freedom
    least, *other_squares = 2.0 * data["start_cost"].values
    rivals = sum(square - least <= RIVAL * variance for square in other_squares)
    if not rivals:
        return [(words, False)]
    minima = "another minimum agrees" if rivals == 1 else f"{rivals} other minima agree"
    return [(words, False), (f"{minima} with the data about as well as the lowest", True)]
