"""The summary of a load history's file as text: a line a named step, and what changes from cycle to cycle in words."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tcstudy.data.reading import asked, by_point, each_point
from tcstudy.data.schema import PointStatus
from tcstudy.reports import sentences
from tcstudy.reports.select_point import describe
from tcstudy.reports.sentences import KINDS, CycleChange, cycle_change
from tcstudy.reports.terminal.tables import Heading, Part, plain_table
from tcstudy.reports.text import counted, digits_lost, headed, number, prefix, proved, with_unit
from tcstudy.reports.verdict import LENGTHS
from tcstudy.scene.histories import AT_REST

Array = NDArray[np.float64]

MOST_CYCLES, MOST_POINTS = 3, 20
"""Cycles of one point whose steps are listed, and points that have a line; the file has them all."""


MOVES = ("rests", "slides along t", "slides back", "jumps")
"""What a node may do in a step."""


def motion(u_T: Array, jumped: NDArray[np.int8] | None) -> NDArray[np.int8]:
    """(N, m) place in MOVES of every node in every step; in step 0 against zero.

    u_T: (N, m) of the steps that were solved;  jumped: (N, m) 1 where a node moved by a jump, None where none can
    """
    moved = np.diff(u_T, axis=0, prepend=0.0)
    still = AT_REST * (float(np.abs(u_T).max()) or 1.0)
    what = np.where(np.abs(moved) <= still, 0, np.where(moved > 0.0, 1, 2)).astype(np.int8)
    return what if jumped is None else np.where(jumped == 1, np.int8(3), what)


ROUNDING = 1e-10
"""What is smaller than this part of what the history reaches is rounding, and reads 0."""


def parts(data: Any, every_row: bool = False, *_: Any) -> Iterator[Part]:
    """What a history's file holds; every_row: all steps of all cycles and points."""
    points = each_point(data)
    shown = points if every_row else points[:MOST_POINTS]
    yield Heading(str(data.attrs["title"]), 1)
    yield _head(data)
    for where in shown:
        name, part = describe(data, where), data.isel(where)
        table = [_table(part, every_row)] if every_row or len(points) == 1 else []
        yield "\n".join([*([f"  {name}"] if name else []), *table, *(f"  {one}" for one in sentences_of(part))])
    if ended := int(np.count_nonzero(data["reason"].values != "")):
        yield f"  {ended} of {len(points)} histories ended early"
    if len(shown) < len(points):
        yield f"  … {len(points) - len(shown)} more points; --verbose shows all"


def verdict(data: Any) -> tuple[str, str, bool]:
    """How far the histories were followed, what jumps, what a cycle changes, how exact it is."""
    solved = by_point(data["status"], data) == int(PointStatus.OK)
    points, steps = solved.shape
    whole, changes = int(np.count_nonzero(solved.all(axis=1))), [last_change(data.isel(w)) for w in each_point(data)]
    what = f"{counted(steps - 1, 'step')} in {counted(int(data['cycle'].max()), 'cycle')}"
    slip, units = np.where(solved, by_point(data["u_T_max"], data), -1.0), str(data["u_T_max"].attrs["units"])
    p, n = np.unravel_index(int(np.argmax(slip)), slip.shape)
    at = f" at step {str(data['step_name'].values[n]) or n}"
    at += f" of cycle {cycle}" if (cycle := int(data["cycle"].values[n])) > 1 else ""
    at += f" ({words})" if (words := describe(data, each_point(data)[p])) else ""
    own = {told: data.get(f"{key}_length") for key, told in LENGTHS.items() if key != "slip"}
    longest = {
        told: np.nanmax(by_point(one, data)[solved], initial=0.0) for told, one in own.items() if one is not None
    }
    lengths = {told: ("", with_unit(float(most), units, 3)) for told, most in longest.items() if most > 0.0}
    moves = slip[p, n] > 0.0
    answer = [sentences.slipped(with_unit(float(slip[p, n]), units), at, lengths) if moves else "nothing slips"]
    if points == 1:
        done, reason = int(np.count_nonzero(solved)) - 1, data["reason"].values.item()
        count = f"all {what} solved" if whole else f"{max(done, 0)} of {what} solved, then: {reason}"
        answer += [changes[0].words]
    else:
        count = f"{whole} of {points} histories of {what} followed to their end"
        kinds = [change.kind for change in changes if change.kind]
        answer += [", ".join(f"{kinds.count(kind)} {KINDS[kind]}" for kind in dict.fromkeys(kinds))]
    jumped = int(np.where(solved, by_point(data["jumps"], data), 0).sum())
    answer += [counted(jumped, "jump") if jumped else "no jumps"]
    worst = by_point(data["inclusion_residual"], data)[solved]
    trust = [f"worst residual {number(float(worst.max()), 2)}"] if len(worst) else []
    return sentences.answered(answer, trust, [count]), "", whole == points


def _head(data: Any) -> str:
    attrs, loads = data.attrs, ", ".join(_loads(data))
    how = "the state of least energy found" if attrs["branch"] == "lowest" else "along its exact path"
    cycles = int(data["cycle"].max())
    lost = digits_lost(float(data["lambda_1_error"].max())) if "lambda_1_error" in data else ""
    return (
        f"  History of {loads}: {counted(data.sizes['step'] - 1, 'step')} in {counted(cycles, 'cycle')}; memory "
        f"{attrs['memory']}; each step {how}\n"
        f"  level {int(data['level'])}: {int(data['n_dof'])} dofs, {int(data['n_contact'])} contact unknowns"
        + (f"\n  {lost}" if lost else "")
    )


def _loads(data: Any) -> list[str]:
    """Names of the loads that change."""
    return str(data.attrs["loads"]).split()


def _table(part: Any, all_cycles: bool) -> str:
    """A line for every named step."""
    names, cycle = part["step_name"].values, part["cycle"].values
    rows = np.flatnonzero((part["status"].values == PointStatus.OK) & (names != "")).tolist()
    listed = [i for i in rows if all_cycles or cycle[i] < MOST_CYCLES or cycle[i] == cycle[rows[-1]]]
    begins = dict(zip(rows, [0, *(i + 1 for i in rows[:-1])], strict=True))

    def since(name: str) -> Array:
        """Sums of energies since the named step before."""
        values = _read(part[name].values, spent)
        return np.array([values[begins[i] : i + 1].sum() for i in listed])

    spent = part["dissipated"].values + part["released"].values + part["stored"].values
    pull, slip = part["friction_resultant"].values, part["u_T_max"].values
    columns: list[tuple[str, str, Array]] = [(name, name, part[name].values[listed]) for name in _loads(part)]
    columns.append(("max |u_T|", "u_T_max", _read(slip, slip)[listed]))
    columns.append(("∫ξ", "friction_resultant", _read(pull, np.abs(part["xi"].values) @ part["c"].values)[listed]))
    columns += [(name, name, since(name)) for name in ("dissipated", "released")]
    columns += [(name, name, part[name].values[listed]) for name in asked(part)]
    header, cells = ["step", "cycle"], [[str(names[i]) for i in listed], [str(cycle[i]) for i in listed]]
    for title, name, values in columns:
        divisor, unit = prefix(list(values), str(part[name].attrs.get("units", "1")))
        header.append(headed(title, unit))
        cells.append([number(value / divisor, 6) for value in values])
    with np.errstate(divide="ignore", invalid="ignore"):
        cells.append([number(x, 2) for x in since("closure") / since("dissipated")])
    cells.append([proved(part.isel(step=i), none="–") for i in listed])
    table = plain_table([*header, "closure/dissipated", "proved"], list(zip(*cells, strict=True)))
    return table + ("\n  …" if len(listed) < len(rows) else "")


def _read(values: Array, reached: Array) -> Array:
    """The values, 0 where they are rounding of the largest that the history reaches."""
    largest = float(np.nanmax(np.abs(reached), initial=0.0))
    return np.where(np.abs(values) <= ROUNDING * largest, 0.0, values)


def last_change(part: Any) -> CycleChange:
    """What the last whole cycle of a point's history has changed."""
    status, cycle, spent = part["status"].values, part["cycle"].values, part["dissipated"].values
    whole = [c for c in range(1, int(cycle.max()) + 1) if np.all(status[cycle == c] == PointStatus.OK)]
    ends = [0, *(int(np.flatnonzero(cycle == c)[-1]) for c in whole)]
    each = np.array([spent[cycle == c].sum() for c in whole])
    units = str(part["u_T"].attrs["units"]), str(part["dissipated"].attrs["units"])
    return cycle_change(part["u_T"].values[ends], each, units, _slip_rounding(part))


def _slip_rounding(part: Any) -> float:
    """What rounding of the forces may do to slips: that to tractions over the margin; 0 where nothing bounds it [m]."""
    margin = float(part["margin"])
    if not margin > 0.0:
        return 0.0
    traction = float(np.nanmax(np.abs(part["xi"].values) / part["c"].values))
    return float(np.nanmax(part["inclusion_rounding"].values)) * traction / margin


def sentences_of(part: Any) -> list[str]:
    """Change from cycle to cycle, energies, and why the history ended early."""
    done = np.flatnonzero(part["status"].values == PointStatus.OK)
    reason = str(part["reason"].values.item())
    if not len(done):
        return [f"no step was solved: {reason}"]
    worst, defect = (float(np.nanmax(part[name].values[done])) for name in ("inclusion_residual", "identity"))
    jumps = int(part["jumps"].values[done].sum())
    told = f"{counted(len(done) - 1, 'step')} solved, worst residual {number(worst, 2)}, energy identity to "
    told += number(defect, 2) + (f", {counted(jumps, 'jump')}" if jumps else "")
    ended = f"ended at step {len(done)}: {reason}" if reason else ""
    return list(filter(None, [last_change(part).words, told, ended]))
