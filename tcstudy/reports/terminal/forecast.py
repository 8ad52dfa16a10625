"""The text of `tcstudy run --dry-run`."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from tcstudy.data.store import axis_attributes, axis_name
from tcstudy.reports.terminal.tables import plain_table, wrapped
from tcstudy.reports.text import counted, headed, number, prefix, scaled_labels, span
from tcstudy.scene.study import Study


def forecast_text(study: Study, plan: Any, more: Sequence[str], output: Path, work: str, time: str) -> str:
    """Counts, sizes, what is left out and why.

    plan: the `tcstudy.study.plan.Plan` of the study;  more: lines after its notes
    work: who solves the contact problems, in words;  time: what a run would take, in words
    """
    steps, levels = study.history.steps if study.history is not None else 0, plan.levels
    most, up_to = ("at most ", "up to ") if study.mesh.open_ended else ("", "")
    lines = [study.title, ""]
    for axis in study.axes if plan.bytes else ():
        words, units = scaled_labels(axis.labels, axis_attributes(axis))
        shown = ", ".join(words[:6])
        rest = f", … ({len(words)} values)" if len(words) > 6 else ""
        lines.append(f"  {axis_name(axis)}: {shown}{rest}" + (f" [{units}]" if units != "1" else ""))
    times = counted(steps, "step") if steps else f"{most}{counted(study.mesh.levels, 'level')}"
    solutions = counted(plan.points * (steps or study.mesh.levels), "solution")
    if plan.bytes:
        lines.append(f"  {counted(plan.points, 'point')} × {times} = {most}{solutions}")
    else:
        lines.append(f"  {plan.asked}")
    fields = counted(plan.heat_solves, "temperature field") if plan.heat_solves else "no temperature field"
    lines.append(f"  per level: {counted(plan.factorisations, 'stiffness factorisation')}, {fields}")
    lines += [f"  {work}"] * bool(work)
    lines.append("")
    divisor, unit = prefix([v.h for v in levels], "1" if study.units == "none" else "m")
    rows = [[str(i), number(v.h / divisor), _count(v.n_dof, v), _count(v.n_contact, v)] for i, v in enumerate(levels)]
    lines += [plain_table(["level", headed("maxh", unit), "dofs", "contact unknowns"], rows), ""]
    lines += [f"  left out: {text}" for text in plan.left_out]
    lines += [f"  note: {text}" for text in plan.notes]
    lines += [f"  {text}" for text in more]
    lines.append(f"  output: {output}" + (f" ({up_to}about {plan.bytes / 1e6:.2g} MB)" if plan.bytes else ""))
    lines += [f"  {time}"] * bool(time)
    return wrapped("\n".join(lines))


def expected_words(expected: Any, at_most: bool = False) -> str:
    """CPU time, cores and memory to expect, in words: rough figures. expected: a `tcstudy.study.sizes.Resources`"""
    up_to, workers = "up to " if at_most else "", expected.workers
    room = f"{up_to}about {(expected.memory + workers * expected.worker_memory) / 1e9:.1g} GB"
    if expected.unknown:
        return f"time unknown: {expected.unknown}; {room}"
    wall = f", {span(expected.wall)} on {workers + 1} cores" if workers > 1 else ""
    return f"about {span(expected.seconds)} of CPU time{wall}, {room}"


def _count(value: int, level: Any) -> str:
    """A number that is counted, or predicted."""
    if level.exact:
        return str(value)
    return f"about {float(f'{value:.2g}'):.0f}"
