"""Measure the convergence of a study over its levels: errors, orders, extrapolated numbers.

Errors are measured against the exact solution if the study gives one. Else the finest solved level
is the reference, of at least MIN_LEVELS levels. Levels at least 2^GAP times coarser are compared
with it: its own error then adds less than 4^-GAP of a smooth error's square. The reference itself
is part of no fit. Without a reference numbers are extrapolated only.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from tcstudy.accuracy.corners import NOWHERE, Sticks, sticking_near, vertices
from tcstudy.accuracy.limits import MIN_LEVELS as LIMIT_LEVELS
from tcstudy.accuracy.limits import StickSlip, limit_of
from tcstudy.accuracy.orders import (
    NOT_ANALYSED,
    ROUNDING,
    Expected,
    Fit,
    expected_orders,
    fit,
    log_share,
    rounding_level,
    smooth_up_to,
    smoothness,
    with_openings,
)
from tcstudy.data.records import Journal, Record
from tcstudy.data.schema import PointStatus
from tcstudy.data.tables import (
    BY_ITSELF,
    NUMBERS,
    OPENING_NUMBERS,
    VERDICTS,
    convergence_record,
)
from tcstudy.errors import ConvergenceError, GeometryFailed
from tcstudy.exact.solution import (
    exact_energy,
    exact_friction_resultant,
    exact_slip_length,
    exact_xi,
)
from tcstudy.fem.meshes import graded_points
from tcstudy.scene.records import Scene
from tcstudy.scene.study import Study
from tcstudy.study.lint import once
from tcstudy.study.reference import (
    Errors,
    ExactReference,
    FineReference,
    Reference,
    Say,
    Solution,
    SolvedLevel,
    solve_levels,
)
from tcstudy.study.run import to_file

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

GAP = 2
"""Uniform refinements between a reference and the finest level that is compared with it."""
MIN_LEVELS = GAP + 2
"""Levels from which on the finest can be a reference."""
COARSER = 0.9
"""Least ratio of the mesh sizes of a compared level and the reference, as a share of 2^GAP.

Longest edges scatter, so that it is below 1.
"""
SLOPE_MARGIN = 0.2
"""Largest deviation of a slope from the expected order that is as expected.

Two standard errors of the slope count as well.
"""
NOTABLE_XI = 0.1
"""Share of the largest |ξ| from which on ξ beside a constrained end decides about orders."""
STUCK = 0.95
"""Ratio of the errors of the finest and the coarsest level above which nothing converges.

The poorest corner gives less.
"""
MAX_INCLUSION = 1e-8
"""Inclusion residual, relative to the scale of the law, of an exact solution that solves the
problem."""
EQUAL_AREAS = 1e-9
"""Relative difference of the areas of meshes that is rounding: their boundary is straight."""


def orders_to_expect(
    study: Study, finest: SolvedLevel, solution: Solution, scene: Scene
) -> dict[str, Expected]:
    """Return the expected order of every error by its name.

    They follow from corners, stick and slip on the finest level, or from the exact solution.
    """
    sticks = solution.sticks
    has_front = solution.ok and 0 < int(np.count_nonzero(sticks)) < len(sticks)
    if study.exact is not None:
        slips_there, sticks_there = _states_beside_held(finest, solution)
        limits = smooth_up_to(study.exact.exponent, slips_there, sticks_there, has_front)
        return expected_orders(limits)
    line = finest.line
    edges = [line.edge_names[e] for e in line.edge] if solution.ok else ()
    sticks_near = sticking_near(edges, line.xy, sticks)
    closed_near = _closed_near(finest, solution)
    corners = vertices(finest.mesh.geometry.corners, scene, sticks_near, closed_near)
    grading = graded_points(study)
    gradings = [grading.get(corner.at, 1.0) for corner in corners]
    limits = smoothness(corners, has_front, gradings, scene.material.expands)
    if scene.opens:
        closed_count = int(np.count_nonzero(solution.closed))
        lifts_off = solution.ok and 0 < closed_count < len(solution.closed)
        limits = with_openings(limits, corners, has_front, lifts_off)
    is_analysed = not any(math.isnan(corner.exponent) for corner in corners)
    return expected_orders(limits, analysed=is_analysed)


def _closed_near(level: SolvedLevel, solution: Solution) -> Sticks:
    """Return the function that says whether an edge's opening nearest to a point is closed."""
    opening = level.opening
    if opening is None or not solution.ok:
        return NOWHERE
    edges = [opening.edge_names[e] for e in opening.edge]
    return sticking_near(edges, opening.xy, solution.closed)


def _states_beside_held(level: SolvedLevel, solution: Solution) -> tuple[bool, bool]:
    """Return whether nodes beside a constrained one slip, and whether some stick.

    Where ξ is next to nothing, the constrained neighbour makes no difference.
    """
    if not solution.ok:
        return False, False
    xi = np.abs(solution.xi)
    is_notable = level.next_to_held & (xi > NOTABLE_XI * np.max(xi, initial=0.0))
    slips_there = bool(is_notable[~solution.sticks].any())
    sticks_there = bool(is_notable[solution.sticks].any())
    return slips_there, sticks_there


def own_error(order: float) -> float:
    """Return by how much the finest rate may exceed `order` since the reference has an error.

    Errors e_i ~ h_i^p seen as e_i − e_ref have the rate
    p + log₂((1 − 2^{−p(GAP+1)})/(1 − 2^{−p GAP})).
    """
    if order <= 0.0:
        return math.inf
    return math.log2((1 - 2 ** (-order * (GAP + 1))) / (1 - 2 ** (-order * GAP)))


def verdict(
    fitted: Fit, expected: float, nested: bool, log: float = 0.0, analysed: bool = True
) -> str:
    """Return what the rates of an error say, one of data.tables.VERDICTS.

    nested:   whether errors are measured against a finer level, which has an error of its own
    log:      how far below `expected` a factor |log h| puts the rates
    analysed: whether all places that could lower the order were looked at
    """
    if fitted.exact:
        return "exact"
    if np.count_nonzero(np.isfinite(fitted.rate)) < 2:
        return "too_few_levels"
    if not fitted.settled:
        return "pre_asymptotic"
    scatter = 2 * fitted.slope_error if math.isfinite(fitted.slope_error) else 0.0
    margin = max(SLOPE_MARGIN, scatter)
    excess = fitted.slope - expected
    if -margin - log <= excess <= margin + (own_error(expected) if nested else 0.0):
        return "as_expected"
    if fitted.slope > expected:
        return "faster"
    return "slower" if analysed else "unknown"


def converge_to_file(
    study: Study,
    path: Path,
    say: Say,
    command: Sequence[str] = ("tcstudy",),
    lock: Journal | None = None,
) -> None:
    """Measure the convergence of a study into a file.

    lock: that of the file, if it is taken already
    Raises ConvergenceError, StoreError, GeometryFailed.
    """
    if study.mesh.levels < 2:
        remedy = "give mesh.levels: 4 or more, or --set mesh.levels=4"
        raise ConvergenceError(f"one level has no convergence; {remedy}")
    if study.mesh.strategy.adapts:
        problem = "adaptive meshes have no common h to show rates over"
        estimates = "they come with their own error estimates"
        remedy = "use tcstudy run or tcstudy cost, or --set mesh.family=uniform"
        raise ConvergenceError(f"{problem}, and {estimates}; {remedy}")
    to_file(path, study, command, lambda: converge(study, say), lock=lock)


@dataclass(frozen=True)
class _BodyConvergence:
    """The convergence of the points on one body.

    points:    what the file has of every point, by name
    reference: what errors are measured against, in words
    notes:     remarks on how it was measured
    """

    points: list[dict[str, Any]]
    reference: str
    notes: list[str]


def converge(study: Study, say: Say = lambda text: None) -> Record:
    """Return the convergence of a study, whose geometries are measured on their own levels.

    Raises GeometryFailed if the body cannot be meshed, of several geometries if none can.
    """
    failed: dict[str, Any] = {
        "status": np.full(study.mesh.levels, PointStatus.MESH_FAILED, dtype=np.int8)
    }
    points = [failed] * len(study.scenes)
    measured = list[tuple[str, _BodyConvergence]]()
    refused = list[str]()
    for body in study.bodies:
        try:
            if body.study is None:
                raise GeometryFailed(body.reason)
            if body.words:
                say(f"{body.words}:")
            convergence = _measure_body(body.study, say)
        except GeometryFailed as error:
            if not study.variants:
                raise
            refused.append(f"{body.words}: {error}")
            reason = np.full(study.mesh.levels, str(error), dtype=object)
            for place in body.places:
                points[place] = {**failed, "reason": reason}
            continue
        measured.append((body.words, convergence))
        for place, point in zip(body.places, convergence.points, strict=True):
            points[place] = point
    if not measured:
        raise GeometryFailed(f"no geometry of the sweep has a mesh ({refused[0]})", ("sweep",))
    references = dict.fromkeys(convergence.reference for _, convergence in measured)
    notes = [(words, convergence.notes) for words, convergence in measured]
    if study.variants:
        remarks = [f"refused, {reason}" for reason in refused] + _notes_of_geometries(notes)
    else:
        remarks = notes[0][1]
    return convergence_record(study, points, "; or ".join(references), remarks)


def _notes_of_geometries(notes: Sequence[tuple[str, list[str]]]) -> list[str]:
    """Return every note once, with the geometries that it is of.

    notes: (words of a geometry, its notes)
    """
    sentences = list[str]()
    for note in once(notes):
        counts_points = not note.where and " points" in note.text  # counted in one geometry
        sentences.append(f"each geometry: {note.text}" if counts_points else str(note))
    return sentences


def _measure_body(study: Study, say: Say) -> _BodyConvergence:
    """Return the convergence of a study with one body."""
    with threadpool_limits(1, user_api="blas"):
        levels = solve_levels(study, say)
        comparison = _comparison(study, levels)
        points = [
            _point(study, levels, comparison, index, scene)
            for index, scene in zip(np.ndindex(study.shape), study.scenes, strict=True)
        ]
    notes = [*comparison.notes, *_notes(study, levels, comparison.reference, points)]
    return _BodyConvergence(points, comparison.words, notes)


@dataclass(frozen=True)
class _Comparison:
    """What errors are measured against, in words too.

    compared: (levels,) levels that are compared with the reference
    notes:    remarks on it
    """

    reference: Reference | None
    words: str
    compared: Mask
    notes: list[str]


def _comparison(study: Study, levels: list[SolvedLevel]) -> _Comparison:
    """Return the reference of a study and the levels compared with it."""
    if study.exact is not None:
        every_level = np.ones(len(levels), dtype=bool)
        return _Comparison(ExactReference(study.exact), "the exact solution", every_level, [])
    h = np.array([level.mesh.h_max for level in levels])
    is_solved = [any(solution.ok for solution in level.solutions.values()) for level in levels]
    finest = int(np.flatnonzero(is_solved)[-1]) if any(is_solved) else 0
    compared = h >= COARSER * 2**GAP * h[finest]
    if finest + 1 < MIN_LEVELS or np.count_nonzero(compared) < 2:
        no_level = np.zeros(len(levels), dtype=bool)
        return _Comparison(None, "none", no_level, [_no_errors(is_solved)])
    words = _reference_words(finest, len(levels), compared)
    reference = FineReference(levels[finest], study.mesh.nested)
    return _Comparison(reference, words, compared, _nesting_notes(study, levels))


def _reference_words(finest: int, level_count: int, compared: Mask) -> str:
    """Return in words which level is the reference, and which levels are compared with it."""
    last_compared = int(np.flatnonzero(compared)[-1])
    skipped = [str(level) for level in range(last_compared + 1, finest)]
    rank = "finest" if finest + 1 == level_count else "finest that is solved"
    remarks = f"levels compared are at least {2**GAP} times coarser"
    if len(skipped) == 1:
        remarks += f"; level {skipped[0]} is not used"
    elif skipped:
        remarks += f"; levels {', '.join(skipped)} are not used"
    return f"level {finest}, the {rank} ({remarks})"


def _nesting_notes(study: Study, levels: Sequence[SolvedLevel]) -> list[str]:
    """Return the note on meshes that do not refine one another, if these do not."""
    areas = [float(level.mesh.area.sum()) for level in levels]
    if study.mesh.nested and not np.ptp(areas) > EQUAL_AREAS * areas[-1]:
        return []
    return [
        "Levels are not uniform refinements of each other, or the boundary is curved: a coarse "
        "solution counts on each triangle of the reference as what it is at its centre, which is "
        "exact where the reference refines its mesh."
    ]


def _no_errors(is_solved: Sequence[bool]) -> str:
    """Return the reason why there is no reference, and what to do about it."""
    solved_count = sum(is_solved)
    if solved_count == len(is_solved):
        solved_words = f"there are {solved_count} levels"
    else:
        solved_words = f"{solved_count} of {len(is_solved)} levels are solved"
    need = (
        f"the reference needs two levels that are {2**GAP} times coarser, "
        f"as they are with mesh.levels of {MIN_LEVELS}"
    )
    limits = "Limits are extrapolated. " if solved_count >= LIMIT_LEVELS else ""
    remedy = "Give more levels, or the exact solution"
    return f"No errors are measured: {solved_words}, and {need}. {limits}{remedy}."


def _point(
    study: Study,
    levels: list[SolvedLevel],
    comparison: _Comparison,
    index: tuple[int, ...],
    scene: Scene,
) -> dict[str, Any]:
    """Return what the file has of a point, by name.

    These are meshes and status, errors with their rates, and numbers with their limits.
    """
    solutions = [level.solutions[index] for level in levels]
    point: dict[str, Any] = {
        "status": np.array([solution.status for solution in solutions], dtype=np.int8),
        "reason": np.array([solution.reason for solution in solutions], dtype=object),
        "h_max": np.array([level.mesh.h_max for level in levels]),
        "n_dof": [level.n_dof for level in levels],
        "n_contact": [level.m for level in levels],
        "compared": comparison.compared,
    }
    point |= _error_values(study, levels, comparison, index, scene)
    for name, stored_name in BY_ITSELF.items():
        point[name] = _values_by_level(solutions, stored_name)
    return point | _number_values(study, levels, solutions, scene)


def _values_by_level(solutions: Sequence[Solution], name: str) -> Array:
    """Return (levels,) a number of the solutions, NaN where it is missing."""
    return np.array([solution.numbers.get(name, np.nan) for solution in solutions])


def _error_values(
    study: Study,
    levels: list[SolvedLevel],
    comparison: _Comparison,
    index: tuple[int, ...],
    scene: Scene,
) -> dict[str, Any]:
    """Return the variables of the errors of a point, without those whose reference vanishes."""
    errors = _errors_by_level(levels, comparison, index, scene)
    solutions = [level.solutions[index] for level in levels]
    is_used = np.array([solution.ok for solution in solutions]) & comparison.compared
    size = float(np.linalg.norm(np.ptp(levels[-1].mesh.points, axis=0)))
    h = np.array([level.mesh.h_max for level in levels]) / size
    rounding = rounding_level(h, study.solver.aim)
    expected_by_name = orders_to_expect(study, levels[-1], solutions[-1], scene)
    values = dict[str, Any]()
    for name, expected in expected_by_name.items():
        pairs = [level_errors.get(name, (np.nan, 0.0)) for level_errors in errors]
        error, norms = np.array(pairs).T
        positive_norms = norms[norms > 0.0]
        if not len(positive_norms):  # measured on no level, or the reference vanishes
            continue
        norm = positive_norms[-1]
        fitted = fit(h, error / norm, is_used, rounding)
        log = 0.0
        if expected.log:
            is_asymptotic = np.arange(len(h)) >= fitted.first_level
            log = log_share(h[is_used & is_asymptotic])
        nested = study.exact is None
        judgement = verdict(fitted, expected.order, nested, log, expected.analysed)
        values |= {
            f"error_{name}": error / norm,
            f"size_squared_{name}": norm**2,
            f"rate_{name}": fitted.rate,
            f"slope_{name}": fitted.slope,
            f"slope_error_{name}": fitted.slope_error,
            f"first_level_{name}": fitted.first_level,
            f"expected_{name}": expected.order,
            f"reason_{name}": expected.reason,
            f"verdict_{name}": VERDICTS.index(judgement),
        }
    return values


def _errors_by_level(
    levels: Sequence[SolvedLevel], comparison: _Comparison, index: tuple[int, ...], scene: Scene
) -> list[Errors]:
    """Return the errors of a point on every level, none on those that are not compared."""
    reference = comparison.reference
    errors = list[Errors]()
    for level, is_compared in zip(levels, comparison.compared, strict=True):
        if reference is not None and is_compared:
            errors.append(reference.errors(level, index, scene))
        else:
            errors.append(Errors())
    return errors


def _number_values(
    study: Study, levels: list[SolvedLevel], solutions: Sequence[Solution], scene: Scene
) -> dict[str, Any]:
    """Return the variables of the numbers of a point: values, exact values, limits."""
    exact = _exact_numbers(study, levels[-1], scene)
    h = np.array([level.mesh.h_max for level in levels])
    is_solved = np.array([solution.ok for solution in solutions])
    states = _contact_states(levels, solutions)
    opening_states = _opening_states(levels, solutions)
    values = dict[str, Any]()
    for measure in NUMBERS:
        name = measure.name
        is_of_openings = measure in OPENING_NUMBERS
        if is_of_openings and not scene.opens:
            continue
        numbers = _values_by_level(solutions, name)
        if not np.isfinite(numbers).any():
            continue
        states_of_number = opening_states if is_of_openings else states
        unresolved = states_of_number[-1].unresolved(name) if states_of_number else 0.0
        limit = limit_of(name, h, np.where(is_solved, numbers, np.nan), unresolved)
        values |= {
            f"value_{name}": numbers,
            f"exact_{name}": exact.get(name, np.nan),
            f"limit_{name}": limit.value,
            f"uncertainty_{name}": limit.uncertainty,
            f"limit_order_{name}": limit.order,
        }
    return values


def _exact_numbers(study: Study, finest: SolvedLevel, scene: Scene) -> dict[str, float]:
    """Return the numbers of the exact solution by name; none without one."""
    if study.exact is None:
        return {}
    return {
        "friction_resultant": exact_friction_resultant(scene, exact_xi(study.exact, scene)),
        "energy": exact_energy(study.exact, scene, finest.mesh),
        "slip_length": exact_slip_length(study.exact, scene),
    }


def _contact_states(
    levels: Sequence[SolvedLevel], solutions: Sequence[Solution]
) -> list[StickSlip]:
    """Return the state of the contact line on the solved levels of a point, coarse to fine."""
    states = list[StickSlip]()
    for level, solution in zip(levels, solutions, strict=True):
        if not solution.ok:
            continue
        unknowns = level.line.unknowns
        inner_segments = unknowns[(unknowns >= 0).all(axis=1)]
        can_stick = math.isfinite(solution.numbers.get("slip_length", math.nan))
        state = StickSlip(
            level.line.c, solution.slips, solution.xi, solution.sticks, inner_segments, can_stick
        )
        states.append(state)
    return states


def _opening_states(
    levels: Sequence[SolvedLevel], solutions: Sequence[Solution]
) -> list[StickSlip]:
    """Return the state of the openings on the solved levels of a point, coarse to fine."""
    states = list[StickSlip]()
    for level, solution in zip(levels, solutions, strict=True):
        opening = level.opening
        if not solution.ok or opening is None:
            continue
        unknowns = opening.unknowns
        inner_segments = unknowns[(unknowns >= 0).all(axis=1)]
        state = StickSlip(
            opening.c, solution.opening, solution.S_N, solution.closed, inner_segments, False
        )
        states.append(state)
    return states


def _notes(
    study: Study,
    levels: list[SolvedLevel],
    reference: Reference | None,
    points: list[dict[str, Any]],
) -> Iterator[str]:
    """Yield what a reader must know of the errors and orders of a study with one body."""
    if isinstance(reference, ExactReference):
        yield from _inclusion_note(study, levels[-1], reference)
    if any(NOT_ANALYSED in point.get("reason_u_energy", "") for point in points):
        where = "where edges meet without an angle"
        if study.knows_pressure:
            where = "with slip under a friction that follows the pressure"
        yield (
            f"Corners {where} are not analysed: expected orders are those "
            "of a solution that is smooth there, and lower ones are not called slow."
        )
    if isinstance(reference, FineReference):
        largest = ", ".join(f"{p:g} as {p + own_error(p):.2f}" for p in (0.5, 1.0, 2.0))
        yield (
            "The reference has an error of its own, so rates look larger: "
            f"an order of {largest} at most."
        )
    yield from _new_order_note(study, levels)
    yield from _lower_energy_note(study, levels[-1])
    yield from _uniqueness_note(study, levels[-1])
    if study.exact is not None and not study.exact.derived:
        yield from _stuck_note(points)


def _inclusion_note(study: Study, finest: SolvedLevel, exact: ExactReference) -> Iterator[str]:
    """Yield a note where the exact solution does not satisfy the friction law."""
    residual = max(exact.inclusion(finest, scene) for scene in study.scenes)
    if residual > MAX_INCLUSION:
        yield (
            f"The exact solution misses the friction law by {residual:.2g} of its scale: "
            "it does not solve this problem, so errors will level off; "
            "check exact, friction and the loads."
        )


def _new_order_note(study: Study, levels: Sequence[SolvedLevel]) -> Iterator[str]:
    """Yield the advice to add a level where stick and slip change their order on the finest."""
    changes = list[str]()
    for index, scene in zip(np.ndindex(study.shape), study.scenes, strict=True):
        if scene.opens and scene.friction.vanishes:  # slips are nothing but those of openings
            continue
        states = _contact_states(levels, [level.solutions[index] for level in levels])
        orders = [state.order for state in states]
        if len(orders) >= LIMIT_LEVELS and orders[-1] != orders[-2]:
            changes.append(f"{orders[-2]} → {orders[-1]}".replace("-", "−"))
    if not changes:
        return
    stick = "Stick"
    if len(study.scenes) > 1:
        stick = f"At {len(changes)} of {len(study.scenes)} points: stick"
    distinct_changes = list(dict.fromkeys(changes))
    examples = ", ".join(distinct_changes[:3])
    if len(distinct_changes) > 3:
        examples += ", …"
    remedy = f"mesh.levels={study.mesh.levels + 1}"
    if study.mesh.listed:
        remedy = "a smaller size in mesh.maxh"
    yield (
        f"{stick} (0) and slip (+, −) first change their order on the finest level ({examples}): "
        f"give one more level ({remedy})."
    )


def _lower_energy_note(study: Study, finest: SolvedLevel) -> Iterator[str]:
    """Yield a note where the exact solution is an equilibrium, but not the one of least energy."""
    pairs = [
        (solution.numbers["energy"], solution.lower)
        for solution in finest.solutions.values()
        if np.isfinite(solution.lower)
    ]
    if not pairs:
        return
    energy, lower = max(pairs, key=lambda pair: pair[0] - pair[1])
    unit = "" if study.units == "none" else " J/m"
    yield (
        f"At {len(pairs)} of {len(study.scenes)} points a state of lower energy than the exact "
        f"solution's was found: by {energy - lower:.3g}{unit} at most "
        f"({lower:.6g} against {energy:.6g} on the finest level). Errors are those of the branch "
        "that starts at the exact solution; tcstudy run stores the lower state."
    )


def _uniqueness_note(study: Study, finest: SolvedLevel) -> Iterator[str]:
    """Yield a note where the solution on the finest level is not certified to be the only one."""
    uncertified = [solution.numbers.get("unique") == 0 for solution in finest.solutions.values()]
    if any(uncertified):
        yield (
            f"{sum(uncertified)} of {len(study.scenes)} points are not certified to have one "
            "solution only: levels may follow different ones; rates that jump are a sign of it."
        )


def _stuck_note(points: Sequence[Mapping[str, Any]]) -> Iterator[str]:
    """Yield a note where the error of u does not fall from the coarsest to the finest level."""
    stuck_count = 0
    for point in points:
        error = point.get("error_u_energy", ())
        if len(error) > 1 and error[-1] > max(STUCK * error[0], ROUNDING):
            stuck_count += 1
    if stuck_count:
        yield (
            f"The error of u does not decrease at {stuck_count} of {len(points)} points, as "
            "where the "
            "exact solution does not belong to the loads, supports and material of the study. "
            "Check them, or let the loads follow from it with loads: derived."
        )
