"""The report of a file of accuracy against cost: a table for each mesh family, the front, and what follows."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from tcstudy.data.cost import OWN, STAGES, open_cost
from tcstudy.reports.cost_reading import SYMBOLS, Setting, advice, front, measure_of, settings
from tcstudy.reports.tables import Heading, Part, Table, render
from tcstudy.scene.families import FAMILIES

TITLES = {name: family.title for name, family in FAMILIES.items()} | {OWN: "The study's own meshes"}


def cost_report(path: Path, form: str = "text", measure: str | None = None) -> str:
    """The report in one of tables.FORMATS, from the file alone.

    measure: name of the error, by default that of u in energy. Raises StoreError if `path` is no such file, DrawError
    if it has no such error.
    """
    data = open_cost(path)
    return render(list(parts(data, measure_of(data, measure))), form)


def parts(data: Any, measure: str) -> Iterator[Part]:
    """Everything the report says, in order."""
    found = settings(data, measure)
    yield Heading(f"Accuracy against cost: {data.attrs['title']}", 1)
    where = f"Scene: {data.attrs['point']}. " if data.attrs["point"] else ""
    runs = data.sizes["run"]
    yield (
        f"{where}Errors of {SYMBOLS[measure]} against the {_plain(data.attrs['reference'])}. Wall time from the body "
        f"to the displacements, each run from nothing: least of {runs} run{'s' if runs > 1 else ''}, upper quartile."
    )
    for family in data["family"].values.tolist():
        yield _family(data, family, [s for s in found if s.family == family], measure)
    yield _front(data, found)
    yield from advice(found)
    for note in filter(None, str(data.attrs["notes"]).split("\n")):
        yield f"Note: {note}"


def _plain(reference: str) -> str:
    return reference.removeprefix("the ")


def _family(data: Any, family: str, found: list[Setting], measure: str) -> Table:
    """Size, error and the time of every solver by level."""
    solvers = data["solver"].values.tolist()
    header = ["level", "dofs", "contact unknowns", f"error of {SYMBOLS[measure]}"]
    for solver in solvers:
        header += [f"{solver} [s]", "quartile"]
    rows = []
    for level in sorted({s.level for s in found}):
        by_solver = {s.solver: s for s in found if s.level == level}
        one = by_solver[solvers[0]]
        row = [str(level), str(one.n_dof), str(one.n_contact), _error(one)]
        for solver in solvers:
            s = by_solver.get(solver)
            row += [f"{s.time:.3g}{_mark(s)}", f"{s.upper:.3g}"] if s is not None else ["–", "–"]
        rows.append(tuple(row))
    notes = ("* on the front   † the study's own settings   (error) not solved",)
    return Table(TITLES[family], tuple(header), tuple(rows), notes=notes, label=f"cost-{family}")


def _mark(setting: Setting) -> str:
    return ("†" if setting.own else "") + ("" if setting.dominated else "*")


def _error(setting: Setting) -> str:
    text = f"{setting.error:.3e}" if np.isfinite(setting.error) else "–"
    return text if setting.solved else f"({text})"


def _front(data: Any, found: list[Setting]) -> Table:
    """Settings worth their cost with the stages of their fastest run."""
    header = ("meshes", "level", "solver", "error", "time [s]", *(f"{stage} [s]" for stage in STAGES))
    families, solvers = data["family"].values.tolist(), data["solver"].values.tolist()
    rows = []
    for s in front(found):
        at = (families.index(s.family), solvers.index(s.solver), s.level)
        spent = [f"{float(data[f'time_{stage}'].values[at]):.2g}" for stage in STAGES]
        rows.append((s.family, str(s.level), s.solver, _error(s), f"{s.time:.3g}", *spent))
    return Table(
        "Worth their cost: nothing measured is both faster and more accurate", header, tuple(rows), label="front"
    )
