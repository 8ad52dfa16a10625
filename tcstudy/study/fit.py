"""Fit parameters of a study to measurements: from several starts, with intervals and
identifiability.

The models are those of `study.fit_models`, the statistics those of `accuracy.fitted`; this module
runs a fit and collects what its file keeps. A unique solution for every load is no unique minimum
of the squares: all starts are tried, or until one is consistent with the noise and identifies every
parameter.

A fit takes the mesh for the body. The effect on the parameters is measured at the end: on a mesh of
half the size the residuals change by Δr, and the estimates by −(JᵀJ)⁻¹Jᵀ Δr, one step of Gauss and
Newton. As much again may be left where the error falls with the size of the elements, a third of it
where it falls with its square.

Laws by points may be smooth: of the laws that explain the data as well, the straighter one is
found. Added to Σr² is w Σ_i D_i², D_i the jump of slope at point i over the root of its share of
the line, so that Σ D_i² is ∫ b″² (in units of the law's length and size); jumps of b stay free. The
weight w has the least generalised cross-validation n Σr²/(n − tr A)², A = J(JᵀJ + wDᵀD)⁻¹Jᵀ, over
decades: it needs no knowledge of the noise. tr A are the effective degrees of freedom. Where
outliers count less, ρ(r²) stands for r², and w Σ D_i² is added as it is. Literature: Craven &
Wahba, Numer. Math. 31 (1978) 377–403; Golub, Heath & Wahba, Technometrics 21 (1979) 215–223.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tcstudy.accuracy.fitted import (
    Box,
    Minimum,
    different,
    minimise,
    misfit,
    product,
    settled,
    uncertainty,
)
from tcstudy.condense import NotPositiveDefinite
from tcstudy.data.records import Record
from tcstudy.data.tables import FIT
from tcstudy.errors import FitError, GeometryFailed
from tcstudy.fem.meshes import refine
from tcstudy.laws.composed import POINTS, EdgeLaws, law_slopes, number_of
from tcstudy.laws.pieces import GrowthError
from tcstudy.laws.shapes import LawError
from tcstudy.offline.level import Level
from tcstudy.read.scenes import SceneReader
from tcstudy.scene.fit_plan import FitColumn, FitPlan
from tcstudy.scene.study import Study
from tcstudy.study.fit_models import Comparison, FitModel
from tcstudy.study.run import level_of

Array = NDArray[np.float64]
Model = Callable[[Array], tuple[Array, Array]]
"""Parameters (k,) → residuals (n,) and their derivatives (n, k)."""
Progress = Callable[[str], None]

ASSUMED_NOISE = 0.01
"""Noise of a column where it is not given, relative to its range; of several the ratio matters."""
MIN_SENSITIVITY = 1e-10
"""Column of the Jacobian by ln p, relative to the largest, at which the data depend on p."""
N_LAW_SLIPS = 400
"""Slips at which the fitted law is kept."""
DRAWN_LAW_ERROR = 1e-4
"""Error of straight pieces for exponential ones, too small to be seen in a picture of the curve."""
SMOOTHING_WEIGHTS = np.logspace(3.0, -4.0, 8)
"""Weights that are tried, times tr JᵀJ/tr DᵀD."""


@dataclass(frozen=True)
class Tests:
    """All tests of a fit as one model of the parameters: their residuals one after the other."""

    models: list[FitModel]

    @classmethod
    def of(cls, study: Study) -> Tests:
        """Return the models of all tests; the first is the study itself. Raises GeometryFailed."""
        tests = (study, *study.tests)
        return cls([model_of(test, test.fit) for test in tests if test.fit is not None])

    def __call__(self, p: Array) -> tuple[Array, Array]:
        """Return residuals and Jacobian, for the minimiser."""
        comparisons = self.compare(p)
        residual = np.concatenate([comparison.residual for comparison in comparisons])
        jacobian = np.concatenate([comparison.jacobian for comparison in comparisons])
        return residual, jacobian

    def compare(self, p: Array) -> list[Comparison]:
        """Compare every test with its data. Raises FitError."""
        return [model.compare(p) for model in self.models]

    @property
    def known_noise(self) -> bool:
        """Whether the noise of all tests is known."""
        return all(model.plan.known_noise for model in self.models)

    @property
    def columns(self) -> list[tuple[FitModel, FitColumn]]:
        """The measured columns of all tests, in the order of their residuals."""
        return [(model, column) for model in self.models for column in model.plan.measured]

    @property
    def groups(self) -> list[NDArray[np.intp]]:
        """Positions of the residuals of each measured column."""
        ends = np.cumsum([len(column.values) for _, column in self.columns])
        return np.split(np.arange(ends[-1]), ends[:-1])


def fit(study: Study, progress: Progress = lambda text: None) -> Record:
    """Return the results of the section `fit` of a study.

    progress: called with what is done
    Raises FitError where there is nothing to fit or no solution, GeometryFailed if the body has no
    mesh.
    """
    plan = study.fit
    if plan is None:
        raise FitError(
            "the study has no section fit; "
            "add fit: {data: {file: ..., columns: ...}, parameters: ...}"
        )
    tests = Tests.of(study)
    box = box_of(plan)
    try:
        fits, failures = _fits(plan, tests, box, progress)
    except (NotPositiveDefinite, LawError, GrowthError) as error:
        raise FitError(str(error)) from error
    best = min(fits, key=lambda minimum: minimum.cost)
    comparisons = _drawn_comparisons(tests, best)
    statistics = uncertainty(best, box, tests.groups, tests.known_noise)
    minima = different(fits, box, tests.known_noise)
    values = {
        **_parameter_values(plan, minima),
        **_data_values(tests, comparisons, best, box),
        **_curve_values(comparisons),
        **{column.name: statistics[column.name] for column in FIT if column.name in statistics},
        **_law_values(plan, tests.models[0], best, statistics["covariance"]),
    }
    attributes = _attributes(plan, tests, statistics)
    for name, value in statistics.items():
        if name not in values and name != "weak":
            attributes[name] = value
    attributes |= {
        "starts_tried": np.int32(len(fits) + len(failures)),
        "starts_failed": np.int32(len(failures)),
        "start_failure": failures[0] if failures else "",
        "evaluations": np.int32(best.evaluations),
        "solves": np.int32(sum(model.solves for model in tests.models)),
    }
    if plan.smooth:
        attributes |= {"smooth_weight": best.weight, "numbers_decided": best.numbers}
    progress("the same on a mesh of half the size")
    values["mesh_shift"] = mesh_shift(tests, best, box, statistics)
    return Record("fit", FIT, values, attributes)


def _drawn_comparisons(tests: Tests, best: Minimum) -> list[Comparison]:
    """Return the tests at the best fit, with curves as fine as pictures need them.

    Raises FitError if a path ends early.
    """
    comparisons = [
        replace(model, law_error=DRAWN_LAW_ERROR).compare(best.p) for model in tests.models
    ]
    for comparison in comparisons:
        if comparison.early:
            raise FitError(f"the path that fits best ends early: {comparison.early}")
    return comparisons


def mesh_shift(tests: Tests, best: Minimum, box: Box, statistics: Mapping[str, Any]) -> Array:
    """Return (k,) how far meshes of half the size would move the estimates, in standard errors.

    NaN on bounds, and everywhere if such a mesh gives no result.
    """
    shift = np.full(len(best.p), np.nan)
    comparisons = list[Comparison]()
    try:
        for model in tests.models:
            mesh = refine(model.level.mesh)
            level = Level(mesh, model.plan.scene)
            comparisons.append(replace(model, level=level).compare(best.p))
    except (FitError, GeometryFailed, NotPositiveDefinite, MemoryError):
        return shift
    free = np.flatnonzero(~statistics["at_bound"])
    standard_error = statistics["standard_error"][free]
    ends_early = any(comparison.early for comparison in comparisons)
    if ends_early or not np.all(np.isfinite(standard_error)):
        return shift
    rate = box.rate(best.p)
    J = np.concatenate([best.jacobian * rate, best.prior])[:, free]
    fine_residual = np.concatenate([comparison.residual for comparison in comparisons])
    change = np.append(best.residual - fine_residual, np.zeros(len(best.prior)))
    step = np.linalg.lstsq(J, change)[0]
    shift[free] = step * rate[free] / standard_error
    return shift


def model_of(study: Study, plan: FitPlan) -> FitModel:
    """Return the study as a function of the parameters, on one mesh. Raises GeometryFailed."""
    sigma = [_noise_of(column) for column in (*plan.measured, *plan.given)]
    n_data = len(plan.measured[0].values)
    return FitModel(
        plan,
        SceneReader.of(study),
        level_of(study, plan.scene, plan.level),
        noise=np.repeat(sigma[: len(plan.measured)], n_data),
        given_noise=sigma[-1] if plan.given else 1.0,
        tolerance=study.solver.tolerance,
    )


def _noise_of(column: FitColumn) -> float:
    """Return the standard deviation of a column, assumed where it is not given."""
    if column.noise is not None:
        return column.noise
    size = float(np.ptp(column.values)) or float(np.max(np.abs(column.values)))
    return ASSUMED_NOISE * (size or 1.0)


def box_of(plan: FitPlan) -> Box:
    """Return the bounds of the parameters."""
    low = np.array([parameter.low for parameter in plan.parameters])
    high = np.array([parameter.high for parameter in plan.parameters])
    log = np.array([parameter.log for parameter in plan.parameters])
    return Box(low, high, log)


def _fits(
    plan: FitPlan, tests: Tests, box: Box, progress: Progress
) -> tuple[list[Minimum], list[str]]:
    """Return the minima that the starts lead to, and the reasons why other starts lead nowhere."""
    minima = list[Minimum]()
    failures = list[str]()
    first = np.array([parameter.start for parameter in plan.parameters])
    for number, start in enumerate(box.starts(first, plan.starts, plan.seed), start=1):
        try:
            if plan.smooth:
                minimum = smoothed(tests, start, box, plan)
            else:
                minimum = minimise(tests, start, box, plan.loss)
            _check_sensitivity(plan, minimum, box)
        except FitError as error:
            failures.append(str(error))
            continue
        minima.append(minimum)
        progress(f"start {number} of {plan.starts}: {minimum.evaluations} evaluations")
        if settled(uncertainty(minimum, box, tests.groups, tests.known_noise)):
            break
    if not minima and plan.starts == 1:
        raise FitError(failures[0])
    if not minima:
        raise FitError(f"no starting point gave a result: {failures[0]}")
    return minima, failures


def _check_sensitivity(plan: FitPlan, minimum: Minimum, box: Box) -> None:
    """Raise FitError if the data do not depend on a parameter at a minimum."""
    p = minimum.p
    linear_scale = np.maximum(np.abs(p), box.high - box.low)
    scale = np.where(box.log, p, linear_scale)
    size = np.linalg.norm(minimum.jacobian * scale, axis=0)
    is_idle = size <= MIN_SENSITIVITY * size.max()
    idle = [plan.parameters[i].number.name for i in np.flatnonzero(is_idle)]
    if idle:
        raise FitError(
            f"the data do not depend on {', '.join(idle)} there; "
            "begin elsewhere, or leave it out of the fit"
        )


def _parameter_values(plan: FitPlan, minima: list[list[Minimum]]) -> dict[str, Any]:
    """Return what the file has by parameter and by start."""
    best = minima[0][0]
    names = [parameter.number.name for parameter in plan.parameters]
    units = [parameter.number.units for parameter in plan.parameters]
    return {
        "parameter": np.array(names, dtype=object),
        "parameter_units": np.array(units, dtype=object),
        "estimate": best.p,
        "logarithmic": box_of(plan).log,
        "cost": np.array(best.costs),
        "start_cost": np.array([group[0].cost for group in minima]),
        "start_estimate": np.array([group[0].p for group in minima]),
        "start_count": np.array([len(group) for group in minima], dtype=np.int32),
    }


def _data_values(
    tests: Tests, comparisons: list[Comparison], best: Minimum, box: Box
) -> dict[str, Any]:
    """Return what the file has by datum, the measured columns one after the other."""
    given = list[Array]()
    for model, column in tests.columns:
        rows = range(len(column.values))
        given.append(np.array(model.plan.given[0].values if model.plan.given else rows))
    datum_given = np.concatenate(given).astype(float)
    datum = np.concatenate([column.values for _, column in tests.columns])
    predicted = np.concatenate([comparison.predicted for comparison in comparisons])
    feet = [comparison.foot[:, 0] for comparison in comparisons if len(comparison.foot)]
    numbers = np.arange(len(tests.columns), dtype=np.int32)
    return {
        "measured_column": np.repeat(numbers, [len(group) for group in tests.groups]),
        "datum": datum,
        "datum_given": datum_given,
        "predicted": predicted,
        "predicted_given": np.concatenate(feet) if feet else datum_given,
        # stored is observed − fitted; minimised is a residual whose sign suits its derivatives
        "residual": np.copysign(best.residual, datum - predicted),
        "jacobian": best.jacobian * box.rate(best.p),
        "noise": np.concatenate([model.noise for model in tests.models]),
    }


def _curve_values(comparisons: list[Comparison]) -> dict[str, Any]:
    """Return the curves of the tests one after the other, with a gap of NaN between two of them."""
    paths = [comparison.path for comparison in comparisons if comparison.path is not None]
    if not paths:
        return {}
    gap = np.full((1, 2), np.nan)
    curves = list[Array]()
    folds = list[NDArray[np.intp]]()
    first = 0
    for path in paths:
        curves += [path.curve, gap]
        folds.append(first + path.folds)
        first += len(path.curve) + 1
    given, measured = np.concatenate(curves[:-1]).T
    return {
        "curve_given": given,
        "curve_measured": measured,
        "fold_vertex": np.concatenate(folds).astype(np.int32),
    }


def _attributes(plan: FitPlan, tests: Tests, statistics: Mapping[str, Any]) -> dict[str, Any]:
    """Return the global attributes of the file."""
    names = [parameter.number.name for parameter in plan.parameters]
    combinations = [product(row, names) for row in statistics["singular_vector"]]
    n_identified = len(names) - statistics["weak"]
    files = [Path(model.plan.file).name for model in tests.models]
    assumptions = [model.plan.assumed_noise for model in tests.models]
    given = [f"{column.name} [{column.units}]" for column in plan.given]
    measured = list[str]()
    for model, column in tests.columns:
        place = f" in {Path(model.plan.file).name}" if len(tests.models) > 1 else ""
        measured.append(f"{column.name}{place} [{column.units}]")
    return {
        "compare": plan.compare,
        "loss": plan.loss,
        "data_file": ", ".join(dict.fromkeys(files)),
        "data_sha256": plan.sha256,
        "given": "; ".join(given),
        "measured": "; ".join(measured),
        "known_noise": np.int32(tests.known_noise),
        "noise_assumed": "; ".join(dict.fromkeys(filter(None, assumptions))),
        "given_noise": tests.models[0].given_noise,
        "not_determined": "; ".join(combinations[n_identified:]),
        "determined": ", ".join(combinations[: max(1, n_identified)]),
        "starts": np.int32(plan.starts),
    }


def _law_values(
    plan: FitPlan, model: FitModel, best: Minimum, covariance: Array
) -> dict[str, Array]:
    """Return the fitted law over the slips of the data, with its standard error.

    Empty where laws differ along the contact line, or an edge may open by another law.
    """
    scene = model.scene(best.p)
    if scene.opens or len(scene.laws) != 1 or scene.laws[0].made is None:
        return {}
    law = scene.laws[0]
    max_slip = 1.25 * float(np.max(np.abs(law.kinks), initial=0.0)) or 5.0 * law.s_scale
    slips = np.linspace(0.0, max_slip or 1.0, N_LAW_SLIPS)
    piece = law.piece(slips)
    numbers, chain = model.chain(best.p)
    slopes = np.zeros((N_LAW_SLIPS, len(numbers)))
    for j, number in enumerate(numbers):
        if number.path[0] == "friction":
            slopes[:, j] = law_slopes(law, number_of(number.path)).value(slips, piece)
    rates = slopes @ chain * box_of(plan).rate(best.p)
    variance = np.einsum("sk,kl,sl->s", rates, np.nan_to_num(covariance), rates)
    return {
        "law_slip": slips,
        "law_traction": law.value(slips, piece),
        "law_error": np.sqrt(np.maximum(variance, 0.0)),
    }


def roughness(plan: FitPlan) -> tuple[Array, Array]:
    """Return D (d, k) and a constant (d,) with the roughness D p + constant of all fitted laws."""
    friction = plan.scene.friction
    laws = friction.laws if isinstance(friction, EdgeLaws) else (("", friction, 1.0),)
    k = len(plan.parameters)
    rows = [np.zeros((0, k))]
    constants = [np.zeros(0)]
    for edge, law, _ in laws:
        prefix = ("friction", edge, POINTS) if edge else ("friction", POINTS)
        parameters = dict[int, int]()  # number of a fitted point → its parameter
        for j, parameter in enumerate(plan.parameters):
            path = parameter.number.path
            if path[:-1] == prefix:
                parameters[int(path[-1])] = j
        if law.made is None or not parameters:
            continue
        points = [(point[0], point[1]) for point in law.made.values[POINTS]]
        s, b = np.array(points, dtype=float).T
        bend = _bend(s, b)
        fitted = list(parameters)
        law_rows = np.zeros((len(bend), k))
        law_rows[:, list(parameters.values())] = bend[:, fitted]
        rows.append(law_rows)
        constants.append(np.delete(bend, fitted, axis=1) @ np.delete(b, fitted))
    return np.concatenate(rows), np.concatenate(constants)


def _bend(s: Array, b: Array) -> Array:
    """Return (d, n) the scaled jumps of slope at inner points of a law, as a function of b (n,)."""
    width = np.diff(s)
    is_inner = (width[:-1] > 0.0) & (width[1:] > 0.0)  # no jump beside the point
    slopes = np.diff(np.eye(len(s)), axis=0) / np.where(width > 0.0, width, 1.0)[:, None]
    share = np.sqrt(0.5 * (width[:-1] + width[1:])[is_inner])
    scale = np.ptp(s) ** 1.5 / (np.max(np.abs(b)) or 1.0) / share
    return np.asarray(scale[:, None] * np.diff(slopes, axis=0)[is_inner])


def smoothed(model: Model, start: Array, box: Box, plan: FitPlan) -> Minimum:
    """Return the minimum from a start, with the weight of least cross-validation.

    Weights fall, so that the search goes from straight laws to free ones.
    """
    rows, constant = roughness(plan)
    residual, J = model(start)
    n = len(residual)
    rate = box.rate(start)
    size = float(np.sum((J * rate) ** 2) / np.sum((rows * rate) ** 2))
    minima = list[Minimum]()
    scores = list[float]()
    p = start
    for weight in size * SMOOTHING_WEIGHTS:
        root = np.sqrt(weight)
        penalised = _penalised(model, rows, constant, root)
        minimum = minimise(penalised, p, box, plan.loss, len(rows))
        p = minimum.p
        data_residual = minimum.residual[:n]
        J = minimum.jacobian[:n]
        prior = root * rows * box.rate(p)
        n_effective = _effective_degrees(J * box.rate(p), prior)
        freedom = max(n - n_effective, 1e-300)
        scores.append(n * misfit(data_residual, plan.loss) / freedom**2)
        minima.append(
            replace(
                minimum,
                residual=data_residual,
                jacobian=J,
                prior=prior,
                weight=weight,
                numbers=n_effective,
            )
        )
    best = minima[scores.index(min(scores))]
    return replace(best, evaluations=sum(minimum.evaluations for minimum in minima))


def _effective_degrees(J: Array, prior: Array) -> float:
    """Return tr A, A = J(JᵀJ + PᵀP)⁻¹Jᵀ."""
    inverse_times_J = np.linalg.lstsq(J.T @ J + prior.T @ prior, J.T)[0]
    return float(np.trace(J @ inverse_times_J))


def _penalised(model: Model, rows: Array, constant: Array, root: float) -> Model:
    """Return a model with the roughness, times the root of its weight, as further residuals."""

    def penalised(p: Array) -> tuple[Array, Array]:
        residual, J = model(p)
        residual = np.concatenate([residual, root * (rows @ p + constant)])
        return residual, np.concatenate([J, root * rows])

    return penalised
