"""What a fit's file says, as text and as one object: estimates, what is not determined, how good it
is."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tcstudy.reports.text import Heading, Part, Table, Verdict, counted, number, prefix, pretty

DOUBT = 0.05
"""Probability below which a fit is doubted."""
RIVAL = 3.84
"""Σr² above the least, in variances of the noise, up to which another minimum agrees with the data
as well: 95 % of χ² of one number."""
COARSE = 0.15
"""Change on a mesh of half the size, in standard errors, above which the mesh is too coarse: as
much again may be left, and intervals of 95 % that lie 0.3 standard errors off hold the truth in 94
%, beyond it in fewer and fewer."""
BAND = 1.96
"""Half width of a band of 95 % in standard errors."""


def parts(data: Any, *_: Any) -> Iterator[Part]:
    """What a fit found: its numbers, what speaks for and against them."""
    yield Heading(str(data.attrs["title"]), 1)
    yield _estimates(data)
    about, what = data.attrs, "contact problems solved"
    what = "paths followed" if about["compare"] == "orthogonal" else what
    work = (
        f"{data.sizes['row']} data ({about['data_file']}), {about['compare']}, "
        f"{counted(int(about['evaluations']), 'evaluation')}, {int(about['solves'])} {what} in all; "
        f"AICc {number(float(about['information_criterion']), 5)}"
    )
    yield f"  {work}"


def verdict(data: Any) -> Verdict:
    """Return the fitted numbers with their standard errors, and what speaks for and against
    them."""
    answer = list[str]()
    columns = (
        data[key].values for key in ("parameter", "parameter_units", "estimate", "standard_error")
    )
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
    """A row for each number, with its correlations, which one on its bound or not determined has
    not."""
    names, covariance = [str(name) for name in data["parameter"].values], data["covariance"].values
    error = np.sqrt(np.diagonal(covariance))
    with np.errstate(invalid="ignore", divide="ignore"):
        correlations = covariance / np.outer(error, error)
    rows = []
    for i, name in enumerate(names):
        low, high = data["interval"].values[i]
        estimate = float(data["estimate"].values[i])
        divisor, unit = prefix([estimate], str(data["parameter_units"].values[i]))
        between = f"{number(low / divisor)} … {number(high / divisor)}"
        if not np.isfinite(low):
            between = "on its bound" if int(data["at_bound"].values[i]) else "not determined"
        own = [
            number(estimate / divisor, 5),
            number(float(data["standard_error"].values[i]) / divisor, 2),
            between,
            unit,
        ]
        below = [number(x, 2) for x in correlations[i, :i]]  # nothing stands above the diagonal
        rows.append([name, *own, *below, *(len(names) - 1 - i) * [""]])
    header = ["number", "estimate", "standard error", "95 % interval", "unit"]
    return Table.of_rows("", header + [f"corr. {k}" for k in range(1, len(names))], rows)


def columns(data: Any) -> tuple[list[tuple[str, str]], list[tuple[str, str]]]:
    """(name, units) of the given and of the measured columns."""
    found = []
    for key in ("given", "measured"):
        words = [word.rpartition(" [") for word in str(data.attrs[key]).split("; ") if word]
        found.append([(name, units.removesuffix("]")) for name, _, units in words])
    return found[0], found[1]


def prediction_error(data: Any) -> NDArray[np.float64]:
    """(n,) standard errors of the values of the study at the data, in the units of the data."""
    J, covariance = data["jacobian"].values, np.nan_to_num(data["covariance"].values)
    return np.asarray(
        np.sqrt(np.maximum(np.einsum("nk,kl,nl->n", J, covariance, J), 0.0)) * data["noise"].values
    )


def fit_doubts(data: Any) -> list[tuple[str, bool]]:
    """Return what there is to say of a fit beside its numbers; True where it is a doubt."""
    return [*_agreement(data), *_tried(data), *_mesh(data)]


def _agreement(data: Any) -> list[tuple[str, bool]]:
    """Return what the data do not determine and whether the study has their shape."""
    about = data.attrs
    freedom, square = int(about["degrees_of_freedom"]), float(about["chi_square"])
    found = []
    if about.get("noise_assumed"):
        told = f"the 95 % intervals assume that {about['noise_assumed']}; if not, they may be too narrow: give noise"
        found.append((told, True))
    if about["not_determined"]:
        told = f"not determined: {about['not_determined']}; the data determine {about['determined']} only"
        found.append((told, True))
    if int(about["known_noise"]):
        p = float(about["fit_probability"])
        verdict = (
            "the data do not agree with the study and this noise"
            if p < DOUBT
            else "consistent with the stated noise"
        )
        shown = number(square / max(freedom, 1), 3)
        told = (
            f"χ² per degree of freedom {shown} ({freedom}), probability {number(p, 2)}: {verdict}"
        )
        found.append((told, p < DOUBT))
    else:
        shown = number(np.sqrt(square / max(freedom, 1)), 3)
        told = f"noise estimated from the residuals: {shown} of what was assumed (1 % of a column's range)"
        found.append((told, False))
    if "numbers_decided" in about:
        decided = (
            f"{number(float(about['numbers_decided']), 3)} of {data.sizes['parameter']} numbers"
        )
        found.append(
            (
                f"smooth law, weight by generalised cross-validation: the data decide {decided}",
                False,
            )
        )
    p = float(about["runs_probability"])
    verdict = "the curve may be of the wrong shape" if p < DOUBT else "no trend"
    told = (
        f"signs of the residuals: {int(about['runs'])} runs, probability {number(p, 2)}: {verdict}"
    )
    return [*found, (told, p < DOUBT)]


def _mesh(data: Any) -> list[tuple[str, bool]]:
    """What the mesh does to the numbers."""
    shift, names = data["mesh_shift"].values, data["parameter"].values
    if not np.any(np.isfinite(shift)):
        return [("mesh: what it does to the numbers is not known", True)]
    told = ", ".join(
        f"{name} by {x:+.2f}" for name, x in zip(names, shift, strict=True) if np.isfinite(x)
    )
    coarse = bool(np.nanmax(np.abs(shift)) > COARSE)
    verdict = "too coarse for these data; refine" if coarse else "fine enough"
    return [(f"mesh: half its size would move {told} standard errors: {verdict}", coarse)]


def _tried(data: Any) -> list[tuple[str, bool]]:
    """How many starts were tried, where they end, and whether another minimum is as good."""
    about = data.attrs
    asked, tried, failed = (int(about[key]) for key in ("starts", "starts_tried", "starts_failed"))
    same, *others = data["start_count"].values.tolist()
    told = f"starts: {tried} of {asked} tried"
    told += ", the last has a probable χ² and every number determined" if tried < asked else ""
    told += (
        f"; {same} of {tried} {'ends' if same == 1 else 'end'} in this minimum" if tried > 1 else ""
    )
    told += f", {sum(others)} in {counted(len(others), 'other')}" if others else ""
    told += f", {failed} in no result: {about['start_failure']}" if failed else ""
    freedom = max(int(about["degrees_of_freedom"]), 1)
    variance = 1.0 if int(about["known_noise"]) else float(about["chi_square"]) / freedom
    least, *more = 2.0 * data["start_cost"].values
    rivals = sum(square - least <= RIVAL * variance for square in more)
    if not rivals:
        return [(told, False)]
    names = "another minimum agrees" if rivals == 1 else f"{rivals} other minima agree"
    return [(told, False), (f"{names} with the data about as well as the lowest", True)]
