"""Find numbers of a study from measurements: from several starts, with intervals and what is not
determined.

The models are those of `study.fit_models`, the statistics those of `accuracy.fitted`; here is what
a fit does with them and what it keeps. One solution for every load is not one minimum of the
squares: all starts are tried, or until one has a probable χ² with every number determined.

A fit takes the mesh for the body. What that does to the numbers is measured at the end: on a mesh
of half the size the residuals change by Δr, and the estimates by −(JᵀJ)⁻¹Jᵀ Δr, one step of Gauss
and Newton. As much again may be left where the error falls with the size of the elements, a third
of it where it falls with its square.

Of laws by points that are to be smooth, among those that explain the data as well the straighter
one is found. Added to Σr² is w Σ_i D_i², D_i the jump of slope at point i over the root of its
share of the line, so that Σ D_i² is ∫ b″² (in units of the law's length and size); jumps of b stay
free. The weight w is that of least generalised cross-validation n Σr²/(n − tr A)², A = J(JᵀJ +
wDᵀD)⁻¹Jᵀ, over decades: it needs no knowledge of the noise. tr A is how many numbers the data
decide. Where outliers count less, ρ(r²) stands for r², and w Σ D_i² is added as it is. Literature:
Craven & Wahba, Numer. Math. 31 (1978) 377–403; Golub, Heath & Wahba, Technometrics 21 (1979)
215–223.
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
from tcstudy.study.fit_models import Compared, FitModel
from tcstudy.study.run import level_of

Array = NDArray[np.float64]
Progress = Callable[[str], None]

ESTIMATED = 0.01
"""Noise of a column, of its range, that is assumed where it is not given: of several the ratio
matters."""
BLIND = 1e-10
"""Column of the Jacobian by ln p, of the largest, below which the data do not depend on a
number."""
LAW_PLACES = 400
DRAWN = 1e-4
"""Error of straight pieces in the place of exponential ones that nobody sees in a picture of the
curve."""

DECADES = np.logspace(3.0, -4.0, 8)
"""Weights that are tried, times tr JᵀJ/tr DᵀD."""


@dataclass(frozen=True)
class Tests:
    """All tests of a fit as one model of the numbers to find: their residuals one after the
    other."""

    models: list[FitModel]

    @classmethod
    def of(cls, study: Study) -> Tests:
        """The first test is the study itself. Raises GeometryFailed."""
        return cls([model_of(one, one.fit) for one in (study, *study.tests) if one.fit is not None])

    def __call__(self, p: Array) -> tuple[Array, Array]:
        """Residuals and Jacobian, for the minimiser."""
        parts = [model.compared(p) for model in self.models]
        return np.concatenate([one.residual for one in parts]), np.concatenate(
            [one.jacobian for one in parts]
        )

    @property
    def known_noise(self) -> bool:
        return all(model.plan.known_noise for model in self.models)

    @property
    def columns(self) -> list[tuple[FitModel, FitColumn]]:
        """The measured columns of all tests, in the order of their residuals."""
        return [(model, column) for model in self.models for column in model.plan.measured]

    @property
    def groups(self) -> list[NDArray[np.intp]]:
        """Residuals of each measured column."""
        ends = np.cumsum([len(column.values) for _, column in self.columns])
        return np.split(np.arange(ends[-1]), ends[:-1])


def fit(study: Study, progress: Progress = lambda text: None) -> Record:
    """The numbers that the section `fit` asks for.

    progress: told what is done
    Raises FitError where there is nothing to fit or no solution, GeometryFailed if the body has no
    mesh.
    """
    plan = study.fit
    if plan is None:
        raise FitError(
            "the study has no section fit; add fit: {data: {file: ..., columns: ...}, parameters: ...}"
        )
    tests, box = Tests.of(study), box_of(plan)
    try:
        fits, failures = _fits(plan, tests, box, progress)
    except (NotPositiveDefinite, LawError, GrowthError) as error:
        raise FitError(str(error)) from error
    best = min(fits, key=lambda one: one.cost)
    found = [replace(model, law_error=DRAWN).compared(best.p) for model in tests.models]
    if early := next((one.early for one in found if one.early), ""):
        raise FitError(f"the path that fits best ends early: {early}")
    said = uncertainty(best, box, tests.groups, tests.known_noise)
    minima = different(fits, box, tests.known_noise)
    values, told = _found(plan, tests, minima, found), _told(plan, tests, said)
    values |= {variable.name: said[variable.name] for variable in FIT if variable.name in said}
    values |= _law(plan, tests.models[0], best, said["covariance"])
    told |= {name: value for name, value in said.items() if name not in values and name != "weak"}
    told |= {
        "starts_tried": np.int32(len(fits) + len(failures)),
        "starts_failed": np.int32(len(failures)),
    }
    told |= {"start_failure": failures[0] if failures else ""}
    told |= {
        "evaluations": np.int32(best.evaluations),
        "solves": np.int32(sum(one.solves for one in tests.models)),
    }
    told |= {"smooth_weight": best.weight, "numbers_decided": best.numbers} if plan.smooth else {}
    progress("the same on a mesh of half the size")
    return Record("fit", FIT, values | {"mesh_shift": mesh_shift(tests, best, box, said)}, told)


def mesh_shift(tests: Tests, best: Minimum, box: Box, said: Mapping[str, Any]) -> Array:
    """(k,) how far meshes of half the size would move the estimates, in standard errors; NaN on
    bounds, and all of it where such a mesh gives no result."""
    free, shift, finer = (
        np.flatnonzero(~said["at_bound"]),
        np.full(len(best.p), np.nan),
        list[Compared](),
    )
    try:
        for model in tests.models:
            level = Level(refine(model.level.mesh), model.plan.scene, held=model.level.held)
            finer.append(replace(model, level=level).compared(best.p))
    except (FitError, GeometryFailed, NotPositiveDefinite, MemoryError):
        return shift
    own = np.concatenate([best.jacobian * box.rate(best.p), best.prior])[:, free]
    if not any(one.early for one in finer) and np.all(np.isfinite(said["standard_error"][free])):
        change = best.residual - np.concatenate([one.residual for one in finer])
        step = np.linalg.lstsq(own, np.append(change, np.zeros(len(best.prior))))[0]
        shift[free] = step * box.rate(best.p)[free] / said["standard_error"][free]
    return shift


def model_of(study: Study, plan: FitPlan) -> FitModel:
    """The study as a function of the numbers to find, on one mesh. Raises GeometryFailed."""
    sigma = [
        ESTIMATED * (float(np.ptp(c.values)) or float(np.max(np.abs(c.values))) or 1.0)
        if c.noise is None
        else c.noise
        for c in (*plan.measured, *plan.given)
    ]
    noise = np.repeat(sigma[: len(plan.measured)], len(plan.measured[0].values))
    held = plan.history is None or not plan.history.loose
    level = level_of(study, plan.scene, plan.level, held)
    return FitModel(
        plan,
        SceneReader.of(study),
        level,
        noise,
        sigma[-1] if plan.given else 1.0,
        study.solver.tolerance,
    )


def box_of(plan: FitPlan) -> Box:
    """Where the numbers may lie."""
    low, high, log = (
        np.array([getattr(one, name) for one in plan.parameters]) for name in ("low", "high", "log")
    )
    return Box(low, high, log)


def _fits(
    plan: FitPlan, tests: Tests, box: Box, progress: Progress
) -> tuple[list[Minimum], list[str]]:
    """What the starts lead to, and why some lead nowhere."""
    found, failures = list[Minimum](), list[str]()
    first = np.array([one.start for one in plan.parameters])
    for number, start in enumerate(box.starts(first, plan.starts, plan.seed)):
        try:
            one = (
                smoothed(tests, start, box, plan)
                if plan.smooth
                else minimise(tests, start, box, plan.loss)
            )
            scale = np.where(box.log, one.p, np.maximum(np.abs(one.p), box.high - box.low))
            size = np.linalg.norm(one.jacobian * scale, axis=0)
            blind = [
                a.number.name
                for a, s in zip(plan.parameters, size, strict=True)
                if s <= BLIND * size.max()
            ]
            if blind:
                what = f"the data do not depend on {', '.join(blind)} there"
                raise FitError(f"{what}; begin elsewhere, or leave it out of the fit")
        except FitError as error:
            failures.append(str(error))
            continue
        found.append(one)
        progress(f"start {number + 1} of {plan.starts}: {one.evaluations} evaluations")
        if settled(uncertainty(one, box, tests.groups, tests.known_noise)):
            break
    if not found:
        raise FitError(
            failures[0] if plan.starts == 1 else f"no start led to a result: {failures[0]}"
        )
    return found, failures


def _found(
    plan: FitPlan, tests: Tests, minima: list[list[Minimum]], found: list[Compared]
) -> dict[str, Any]:
    """What the file has by parameter, datum and start."""
    best, box, columns = minima[0][0], box_of(plan), tests.columns
    given = [
        model.plan.given[0].values if model.plan.given else range(len(c.values))
        for model, c in columns
    ]
    datum_given = np.concatenate(given).astype(float)
    feet = [one.foot[:, 0] for one in found if len(one.foot)]
    datum = np.concatenate([column.values for _, column in columns])
    # shown is observed − fitted; what is minimised has the sign that its derivatives suit
    predicted = np.concatenate([one.predicted for one in found])
    values: dict[str, Any] = {
        "parameter": np.array([one.number.name for one in plan.parameters], dtype=object),
        "parameter_units": np.array([one.number.units for one in plan.parameters], dtype=object),
        "estimate": best.p,
        "logarithmic": box.log,
        "measured_column": np.concatenate(
            [np.full(len(own), i, np.int32) for i, own in enumerate(tests.groups)]
        ),
        "datum": datum,
        "datum_given": datum_given,
        "predicted": predicted,
        "predicted_given": np.concatenate(feet) if feet else datum_given,
        "residual": np.copysign(best.residual, datum - predicted),
        "jacobian": best.jacobian * box.rate(best.p),
        "noise": np.concatenate([model.noise for model in tests.models]),
        "cost": np.array(best.costs),
        "start_cost": np.array([same[0].cost for same in minima]),
        "start_estimate": np.array([same[0].p for same in minima]),
        "start_count": np.array([len(same) for same in minima], dtype=np.int32),
    }
    if paths := [one.path for one in found if one.path is not None]:
        gap = np.full((1, 2), np.nan)  # between the curves of two tests
        curves = [part for path in paths for part in (path.curve, gap)][:-1]
        firsts = np.cumsum([0, *(len(path.curve) + 1 for path in paths)])
        folds = [first + path.folds for first, path in zip(firsts, paths, strict=False)]
        values["curve_given"], values["curve_measured"] = np.concatenate(curves).T
        values["fold_vertex"] = np.concatenate(folds).astype(np.int32)
    return values


def _told(plan: FitPlan, tests: Tests, said: Mapping[str, Any]) -> dict[str, Any]:
    """What the file says of the fit as a whole."""
    names, determined = (
        [one.number.name for one in plan.parameters],
        len(plan.parameters) - said["weak"],
    )
    words = [product(row, names) for row in said["singular_vector"]]
    several = len(tests.models) > 1
    measured = [
        f"{c.name}{f' in {Path(model.plan.file).name}' if several else ''} [{c.units}]"
        for model, c in tests.columns
    ]
    return {
        "compare": plan.compare,
        "loss": plan.loss,
        "data_file": ", ".join(dict.fromkeys(Path(model.plan.file).name for model in tests.models)),
        "data_sha256": plan.sha256,
        "given": "; ".join(f"{column.name} [{column.units}]" for column in plan.given),
        "measured": "; ".join(measured),
        "known_noise": np.int32(tests.known_noise),
        "noise_assumed": "; ".join(
            dict.fromkeys(filter(None, (model.plan.assumed_noise for model in tests.models)))
        ),
        "given_noise": tests.models[0].given_noise,
        "not_determined": "; ".join(words[determined:]),
        "determined": ", ".join(words[: max(1, determined)]),
        "starts": np.int32(plan.starts),
    }


def _law(plan: FitPlan, model: FitModel, best: Minimum, covariance: Array) -> dict[str, Array]:
    """The fitted law over the slips of the data, with its standard error; empty where laws differ
    along the line."""
    scene = model.scene(best.p)
    if len(scene.laws) != 1 or scene.laws[0].made is None:
        return {}
    law = scene.laws[0]
    reach = 1.25 * float(np.max(np.abs(law.kinks), initial=0.0)) or 5.0 * law.s_scale
    slips = np.linspace(0.0, reach or 1.0, LAW_PLACES)
    piece = law.piece(slips)
    numbers, chain = model.chain(best.p)
    columns = [
        law_slopes(law, number_of(one.path)).value(slips, piece)
        if one.path[0] == "friction"
        else np.zeros(LAW_PLACES)
        for one in numbers
    ]
    rates = np.stack(columns, axis=1) @ chain * box_of(plan).rate(best.p)
    error = np.sqrt(
        np.maximum(np.einsum("sk,kl,sl->s", rates, np.nan_to_num(covariance), rates), 0.0)
    )
    return {"law_slip": slips, "law_traction": law.value(slips, piece), "law_error": error}


def roughness(plan: FitPlan) -> tuple[Array, Array]:
    """(d, k) and (d,): D = rows p + constant, of all laws of which points are fitted."""
    friction = plan.scene.friction
    rows, constant = [np.zeros((0, len(plan.parameters)))], [np.zeros(0)]
    for edge, law, _ in friction.laws if isinstance(friction, EdgeLaws) else (("", friction, 1.0),):
        place = ("friction", edge, POINTS) if edge else ("friction", POINTS)
        own = {
            int(one.number.path[-1]): j
            for j, one in enumerate(plan.parameters)
            if one.number.path[:-1] == place
        }
        if law.made is None or not own:
            continue
        s, b = (
            np.array([point[i] for point in law.made.values[POINTS]], dtype=float) for i in (0, 1)
        )
        width = np.diff(s)
        inner = (width[:-1] > 0.0) & (width[1:] > 0.0)  # no jump beside the point
        slopes = np.diff(np.eye(len(s)), axis=0) / np.where(width > 0.0, width, 1.0)[:, None]
        share = (
            np.ptp(s) ** 1.5
            / (np.max(np.abs(b)) or 1.0)
            / np.sqrt(0.5 * (width[:-1] + width[1:])[inner])
        )
        bend = share[:, None] * np.diff(slopes, axis=0)[inner]
        rows.append(np.zeros((len(bend), len(plan.parameters))))
        rows[-1][:, list(own.values())] = bend[:, list(own)]
        constant.append(np.delete(bend, list(own), axis=1) @ np.delete(b, list(own)))
    return np.concatenate(rows), np.concatenate(constant)


def smoothed(
    model: Callable[[Array], tuple[Array, Array]], start: Array, box: Box, plan: FitPlan
) -> Minimum:
    """The minimum from a start, with the weight of least cross-validation, from straight laws to
    free ones."""
    rows, constant = roughness(plan)
    first, J = model(start)
    size = float(np.sum((J * box.rate(start)) ** 2) / np.sum((rows * box.rate(start)) ** 2))
    found: list[tuple[float, Minimum]] = []
    p = start
    for weight in size * DECADES:
        root = np.sqrt(weight)

        def penalised(p: Array, root: float = root) -> tuple[Array, Array]:
            r, J = model(p)
            return np.concatenate([r, root * (rows @ p + constant)]), np.concatenate(
                [J, root * rows]
            )

        best = minimise(penalised, p, box, plan.loss, len(rows))
        n, p = len(first), best.p
        r, J, prior = best.residual[:n], best.jacobian[:n], root * rows * box.rate(p)
        by_q = J * box.rate(p)
        numbers = float(
            np.trace(by_q @ np.linalg.lstsq(by_q.T @ by_q + prior.T @ prior, by_q.T)[0])
        )
        score = n * misfit(r, plan.loss) / max(n - numbers, 1e-300) ** 2
        found.append(
            (
                score,
                replace(best, residual=r, jacobian=J, prior=prior, weight=weight, numbers=numbers),
            )
        )
    chosen = min(found, key=lambda item: item[0])[1]
    return replace(chosen, evaluations=sum(one.evaluations for _, one in found))
