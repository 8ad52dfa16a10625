"""The convergence of a study over its levels: errors, rates beside the orders to expect,
extrapolated numbers.

Reference: the exact solution if the study gives one; else the finest solved of at least MIN_LEVELS
levels, compared with levels at least 2^GAP times coarser (what its own error adds is then below
4^-GAP of a smooth error's square), itself not part of any fit; else none, and only numbers are
extrapolated.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from tcstudy.accuracy.corners import sticking_near, vertices
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
)
from tcstudy.data.records import Journal, Record
from tcstudy.data.schema import PointStatus
from tcstudy.data.tables import BY_ITSELF, NUMBERS, VERDICTS, convergence_record
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
NEAR = 0.2
"""A slope within this of the expected order (or two standard errors) is as expected."""
NOTABLE = 0.1
"""Share of the largest ξ from which on ξ beside a held end decides about orders."""


def orders_to_expect(
    study: Study, finest: SolvedLevel, solution: Solution, scene: Scene
) -> dict[str, Expected]:
    """Expected orders from corners, stick and slip on the finest level, or as the study gives them;
    where a node beside a held one carries next to no ξ, that it is makes no difference.
    """
    sticks, line = solution.sticks, finest.line
    mixed = solution.ok and 0 < int(np.count_nonzero(sticks)) < len(sticks)
    if study.exact is not None:
        held = finest.next_to_held & solution.ok
        if solution.ok:
            held &= np.abs(solution.xi) > NOTABLE * np.max(np.abs(solution.xi), initial=0.0)
        slip, stick = (bool(held.any() and (held & own).any()) for own in (~sticks, sticks))
        return expected_orders(smooth_up_to(study.exact.exponent, slip, stick, mixed))
    edges = [line.edge_names[e] for e in line.edge] if solution.ok else ()
    corners = vertices(finest.mesh.geometry.corners, scene, sticking_near(edges, line.xy, sticks))
    graded = graded_points(study)
    found = smoothness(
        corners, mixed, [graded.get(one.at, 1.0) for one in corners], scene.material.expands
    )
    return expected_orders(found, analysed=not any(math.isnan(one.exponent) for one in corners))


def own_error(order: float) -> float:
    """How much larger than `order` the finest rate may look because the reference has an error of
    its own.

    Errors e_i ~ h_i^p seen as e_i − e_ref have the rate p + log₂((1 − 2^{−p(GAP+1)})/(1 − 2^{−p
    GAP})).
    """
    if order <= 0.0:
        return math.inf
    return math.log2((1 - 2 ** (-order * (GAP + 1))) / (1 - 2 ** (-order * GAP)))


def verdict(
    fitted: Fit, expected: float, nested: bool, log: float = 0.0, analysed: bool = True
) -> str:
    """What the rates say, of data.tables.VERDICTS. log: how far below `expected` a factor |log h|
    puts them"""
    if fitted.exact:
        return "exact"
    if np.count_nonzero(np.isfinite(fitted.rate)) < 2:
        return "too_few_levels"
    if not fitted.settled:
        return "pre_asymptotic"
    margin = max(NEAR, 2 * fitted.slope_error if math.isfinite(fitted.slope_error) else 0.0)
    if (
        -margin - log
        <= fitted.slope - expected
        <= margin + (own_error(expected) if nested else 0.0)
    ):
        return "as_expected"
    return "faster" if fitted.slope > expected else "slower" if analysed else "unknown"


MIN_LEVELS = GAP + 2
COARSER = 0.9
"""Share of 2^GAP by which a compared level is coarser than the reference at least: longest edges
scatter."""
STUCK = 0.95
"""Ratio of the finest level's error to the coarsest's above which nothing converges: the poorest
corner gives less."""


def converge_to_file(
    study: Study,
    path: Path,
    say: Say,
    command: Sequence[str] = ("tcstudy",),
    lock: Journal | None = None,
) -> None:
    """Measure the convergence of a study into a file.

    lock: that of the file, if it was taken before
    Raises ConvergenceError, StoreError, GeometryFailed.
    """
    if study.mesh.levels < 2:
        raise ConvergenceError(
            "one level has no convergence; give mesh.levels: 4 or more, or --set mesh.levels=4"
        )
    if study.mesh.strategy.adapts:
        what = "adaptive meshes have no common h to show rates over, and they come with their own error estimates"
        raise ConvergenceError(
            f"{what}; use tcstudy run or tcstudy cost, or --set mesh.family=uniform"
        )
    to_file(path, study, command, lambda: converge(study, say), lock=lock)


def converge(study: Study, say: Say = lambda text: None) -> Record:
    """The convergence of a study; of several geometries each is measured on its own levels.

    Raises GeometryFailed if the body cannot be meshed, of several geometries if none can.
    """
    points: list[Mapping[str, Any]] = [
        {"status": np.full(study.mesh.levels, PointStatus.MESH_FAILED, dtype=np.int8)}
    ]
    points *= len(study.scenes)
    references, notes, lost = list[str](), list[tuple[str, list[str]]](), list[str]()
    for body in study.bodies:
        try:
            if body.study is None:
                raise GeometryFailed(body.reason)
            if body.words:
                say(f"{body.words}:")
            own, reference, told = _of_body(body.study, say)
        except GeometryFailed as error:
            if not study.variants:
                raise
            lost.append(f"{body.words}: {error}")
            reason = np.full(study.mesh.levels, str(error), dtype=object)
            for place in body.places:
                points[place] = {**points[place], "reason": reason}
            continue
        references.append(reference)
        notes.append((body.words, told))
        for place, point in zip(body.places, own, strict=True):
            points[place] = point
    if not notes:
        raise GeometryFailed(f"no geometry of the sweep has a mesh ({lost[0]})", ("sweep",))
    said = [f"refused, {one}" for one in lost]
    for note in once(notes) if study.variants else ():
        each = not note.where and " points" in note.text  # counted of one
        said.append(f"each geometry: {note.text}" if each else str(note))
    said = said if study.variants else notes[0][1]
    return convergence_record(study, points, "; or ".join(dict.fromkeys(references)), said)


def _of_body(study: Study, say: Say) -> tuple[list[dict[str, Any]], str, list[str]]:
    """Points, the reference in words and notes of a study with one body, as of
    `convergence_record`."""
    with threadpool_limits(1, user_api="blas"):
        levels = solve_levels(study, say)
        reference, words, compared, notes = _reference(study, levels)
        points = [
            _point(study, levels, reference, compared, index, scene)
            for index, scene in zip(np.ndindex(study.shape), study.scenes, strict=True)
        ]
    return points, words, [*notes, *_notes(study, levels, reference, points)]


def _reference(
    study: Study, levels: list[SolvedLevel]
) -> tuple[Reference | None, str, Mask, list[str]]:
    """What errors are measured against, in words, the levels compared with it, and remarks."""
    if study.exact is not None:
        every = np.ones(len(levels), dtype=bool)
        return ExactReference(study.exact), "the exact solution", every, []
    h = np.array([level.mesh.h_max for level in levels])
    some_solved = [any(one.ok for one in level.solutions.values()) for level in levels]
    finest = int(np.flatnonzero(some_solved)[-1]) if any(some_solved) else 0
    compared = h >= COARSER * 2**GAP * h[finest]
    if finest + 1 < MIN_LEVELS or np.count_nonzero(compared) < 2:
        return None, "none", np.zeros(len(levels), dtype=bool), [_no_errors(some_solved)]
    last = int(np.flatnonzero(compared)[-1])
    between = ", ".join(str(i) for i in range(last + 1, finest))
    skipped = f"levels {between} are not used" if "," in between else f"level {between} is not used"
    rank = "finest" if finest + 1 == len(levels) else "finest that is solved"
    gap = f"levels compared are at least {2**GAP} times coarser"
    words = f"level {finest}, the {rank} ({gap}; {skipped})"
    areas = [float(level.mesh.area.sum()) for level in levels]
    apart = (
        "Levels are no uniform refinements of one another, or the boundary is curved: a coarse "
        "solution counts on each triangle of the reference as what it is at its centre, which is "
        "exact where the reference refines its mesh."
    )
    notes = [apart] if not study.mesh.nested or np.ptp(areas) > 1e-9 * areas[-1] else []
    return FineReference(levels[finest], study.mesh.nested), words, compared, notes


def _no_errors(some_solved: Sequence[bool]) -> str:
    """Return the reason why there is no reference, and what to do about it."""
    solved_count = sum(some_solved)
    if solved_count == len(some_solved):
        solved_words = f"there are {solved_count} levels"
    else:
        solved_words = f"{solved_count} of {len(some_solved)} levels are solved"
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
    reference: Reference | None,
    compared: Mask,
    index: tuple[int, ...],
    scene: Scene,
) -> dict[str, Any]:
    """What the file has of a point, by name: meshes, status, errors with their rates, numbers with
    their limits."""
    solutions = [level.solutions[index] for level in levels]
    h, ok = np.array([level.mesh.h_max for level in levels]), np.array([s.ok for s in solutions])
    point: dict[str, Any] = {"status": np.array([s.status for s in solutions], dtype=np.int8)}
    point["reason"] = np.array([s.reason for s in solutions], dtype=object)
    point |= {
        "h_max": h,
        "n_dof": [level.n_dof for level in levels],
        "n_contact": [level.line.m for level in levels],
    }
    point["compared"] = compared
    found = [reference.errors(one, index, scene) if reference is not None and used else Errors()
             for one, used in zip(levels, compared, strict=True)]  # fmt: skip
    size = float(np.linalg.norm(np.ptp(levels[-1].mesh.points, axis=0)))
    rounding = rounding_level(h / size, study.solver.aim)
    for name, expected in orders_to_expect(study, levels[-1], solutions[-1], scene).items():
        error, norms = np.array([one.get(name, (np.nan, 0.0)) for one in found]).T
        norm = norms[norms > 0.0][-1:]
        if not len(norm):  # nowhere measured, or its reference vanishes
            continue
        fitted = fit(h / size, error / norm, ok & compared, rounding)
        log = (
            log_share((h / size)[ok & compared & (np.arange(len(h)) >= fitted.first_level)])
            if expected.log
            else 0.0
        )
        parts: dict[str, Any] = {
            part: getattr(fitted, part) for part in ("rate", "slope", "slope_error", "first_level")
        }
        parts |= {"error": error / norm, "size_squared": norm[0] ** 2}
        parts |= {"expected": expected.order, "reason": expected.reason}
        said = verdict(fitted, expected.order, study.exact is None, log, expected.analysed)
        point |= {
            f"{part}_{name}": value
            for part, value in (parts | {"verdict": VERDICTS.index(said)}).items()
        }
    for name, stored in BY_ITSELF.items():
        point[name] = np.array([s.numbers.get(stored, np.nan) for s in solutions])
    exact = dict[str, float]()
    if study.exact is not None:
        exact = {
            "friction_resultant": exact_friction_resultant(scene, exact_xi(study.exact, scene)),
            "energy": exact_energy(study.exact, scene, levels[-1].mesh),
            "slip_length": exact_slip_length(study.exact, scene),
        }
    states = _contact_states(levels, solutions)
    for name in (measure.name for measure in NUMBERS):
        values = np.array([s.numbers.get(name, np.nan) for s in solutions])
        if not np.isfinite(values).any():
            continue
        unresolved = states[-1].unresolved(name) if states else 0.0
        limit = limit_of(name, h, np.where(ok, values, np.nan), unresolved)
        point[f"value_{name}"] = values
        point[f"exact_{name}"] = exact.get(name, np.nan)
        point[f"limit_{name}"] = limit.value
        point[f"uncertainty_{name}"] = limit.uncertainty
        point[f"limit_order_{name}"] = limit.order
    return point


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
            level.line.c, solution.v, solution.xi, solution.sticks, inner_segments, can_stick
        )
        states.append(state)
    return states


def _new_order_note(study: Study, levels: Sequence[SolvedLevel]) -> str:
    """Return the advice to add a level where stick and slip change their order on the finest one
    only; empty where they do not."""
    changes = list[str]()
    for index in np.ndindex(study.shape):
        states = _contact_states(levels, [level.solutions[index] for level in levels])
        orders = [state.order for state in states]
        if len(orders) >= LIMIT_LEVELS and orders[-1] != orders[-2]:
            changes.append(f"{orders[-2]} → {orders[-1]}")
    if not changes:
        return ""
    where = f"At {len(changes)} of {len(study.scenes)} points: " if len(study.scenes) > 1 else ""
    kinds = list(dict.fromkeys(changes))
    examples = f"{', '.join(kinds[:3])}{', …' if len(kinds) > 3 else ''}"
    more = f"mesh.levels={study.mesh.levels + 1}"
    if study.mesh.listed:
        more = "a smaller size in mesh.maxh"
    return (
        f"{where}stick (0) and slip (+, −) first change their order on the finest level "
        f"({examples.replace('-', '−')}): give one more level ({more})."
    )


def _notes(
    study: Study,
    levels: list[SolvedLevel],
    reference: Reference | None,
    points: list[dict[str, Any]],
) -> Iterator[str]:
    if isinstance(reference, ExactReference):
        worst = max(reference.inclusion(levels[-1], scene) for scene in study.scenes)
        if worst > 1e-8:
            yield (
                f"The exact solution misses the friction law by {worst:.2g} of its scale: it does not solve this "
                "problem, so errors will level off; check exact, friction and the loads."
            )
    if any(NOT_ANALYSED in point.get("reason_u_energy", "") for point in points):
        yield (
            "Corners where edges meet without an angle are not analysed: expected orders are those of a solution that "
            "is smooth there, and lower ones are not called slow."
        )
    if isinstance(reference, FineReference):
        seen = ", ".join(f"{p:g} as {p + own_error(p):.2f}" for p in (0.5, 1.0, 2.0))
        yield f"The reference has an error of its own, so rates look larger: an order of {seen} at most."
    if order_note := _new_order_note(study, levels):
        yield order_note[0].upper() + order_note[1:]
    solutions = levels[-1].solutions.values()
    # the exact solution may be an equilibrium, but not the one of least energy
    if pairs := [(s.numbers["energy"], s.lower) for s in solutions if np.isfinite(s.lower)]:
        energy, lower = max(pairs, key=lambda pair: pair[0] - pair[1])
        unit = "" if study.units == "none" else " J/m"
        yield (
            f"At {len(pairs)} of {len(study.scenes)} points a state of lower energy than the exact solution's was "
            f"found: by {energy - lower:.3g}{unit} at most ({lower:.6g} against {energy:.6g} on the finest level). "
            "Errors are those of the branch that starts at the exact solution; tcstudy run stores the lower state."
        )
    if several := sum(s.numbers.get("unique") == 0 for s in solutions):
        yield (
            f"{several} of {len(study.scenes)} points are not certified to have one solution only: levels may follow "
            "different ones; rates that jump are a sign of it."
        )
    if study.exact is not None and not study.exact.derived:
        series = [point["error_u_energy"] for point in points if "error_u_energy" in point]
        if stuck := sum(bool(len(e) > 1 and e[-1] > max(STUCK * e[0], ROUNDING)) for e in series):
            yield (
                f"The error of u does not fall at {stuck} of {len(points)} points, as where the exact solution does "
                "not belong to the loads, supports and material of the study. Check them, or let the loads follow "
                "from it with loads: derived."
            )
