"""The page put together: what it holds, how large it may be, and what is left out where that is too
much."""

from __future__ import annotations

import base64
import hashlib
import html
import json
import re
from collections.abc import Mapping
from dataclasses import dataclass
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np

from tcstudy.data.files import check_writable, reading, remarks_of, replace_file
from tcstudy.data.reading import asked, axis_names, each_point
from tcstudy.data.tables import MEASURES
from tcstudy.errors import PageError
from tcstudy.reports import sentences
from tcstudy.reports.figures import style
from tcstudy.reports.figures.accuracy import convergence_panels, cost_panels
from tcstudy.reports.figures.panels import Panel, Scale, scale
from tcstudy.reports.figures.path import (
    RESPONSES,
    fit_panels,
    history_panels,
    loop_names,
    path_panels,
    response_of,
    solved_steps,
)
from tcstudy.reports.json_values import Json
from tcstudy.reports.page.parts import (
    Container,
    beside,
    choice,
    column,
    columns_of,
    panel_part,
    section,
    sheet_part,
    states,
    text_parts,
)
from tcstudy.reports.page.run import (
    Stored,
    body_part,
    drawn_level,
    law_part,
    level_numbers,
    line_along,
    line_part,
    live_part,
    read,
    run_part,
    shape,
    time_of_levels,
)
from tcstudy.reports.picture import at_rest
from tcstudy.reports.rounding import SHARE, cleared
from tcstudy.reports.select_point import axis_symbol, describe
from tcstudy.reports.symbols import GREEK, symbol
from tcstudy.reports.terminal import accuracy, fit, paths
from tcstudy.reports.terminal.paths import STATES
from tcstudy.reports.terminal.summary import solvers_compared, verdict_of
from tcstudy.reports.text import Verdict, spelled
from tcstudy.scene.keys import ROWS

STATES_BYTES = 4_000_000
"""Room for slip and traction along a path; of a longer one some vertices are shown."""
MOST_POINTS = 200
"""Points whose errors a page shows; the file has all."""


def convergence_sections(stored: Stored, box: Container) -> list[Json]:
    """Errors over h and the tables of every sweep point."""
    data, points = stored.data, each_point(stored.data)
    shown = {}
    for where in points[:MOST_POINTS]:
        at = data.isel(where)
        panels = [panel_part(one, box, high=300) for one in convergence_panels(at).values()]
        shown[describe(data, where) or "the point"] = [
            beside(*panels),
            *text_parts(accuracy.tables(at)),
        ]
    told = [f"Reference: {data.attrs['reference']}.", accuracy.LEGEND, *accuracy.notes(data)]
    told += (
        [f"The first {MOST_POINTS} of {len(points)} points; the file has all."]
        if len(points) > MOST_POINTS
        else []
    )
    parts = choice("point", "p", shown), {"part": "text", "lines": told}
    return [section("Convergence over the levels", "main-part", *parts)]


def cost_sections(stored: Stored, box: Container) -> list[Json]:
    """Every measured setting by error, and what the file advises."""
    data, shown = stored.data, dict[str, list[Json]]()
    held = [m for m in MEASURES if f"error_{m.name}" in data]
    for m in sorted(held, key=lambda m: m.name != accuracy.DEFAULT):
        panels = [panel_part(one, box, high=330) for one in cost_panels(data, m.name).values()]
        shown[m.symbol] = [beside(*panels), *text_parts(accuracy.cost_of(data, m.name))]
    part = (
        choice("error of", "error", shown)
        if shown
        else {"part": "text", "lines": ["Nothing was measured."]}
    )
    return [section("Accuracy against cost", "errors", part)]


def path_sections(stored: Stored, box: Container) -> list[Json]:
    """The response curve and what is said of it, one state, and all vertices."""
    data = stored.data
    m, vertices, pieces = (int(data.sizes[name]) for name in ("node", "vertex", "piece"))
    keep = np.unique(
        np.append(
            np.arange(0, vertices, max(1, -(-4 * m * vertices // STATES_BYTES))), vertices - 1
        )
    )
    name, t, units = (
        str(data.attrs["parameter"]),
        data["parameter"].values,
        str(data["parameter"].attrs["units"]),
    )

    shown = {}
    for key, (title, *_) in RESPONSES.items():
        curve, strip = path_panels(data, key).values()
        shown[title] = [
            panel_part(curve, box, (t[keep], response_of(data, key)[keep]), 400),
            panel_part(strip, box, high=190),
        ]
    low, high = sorted(float(x) for x in data.attrs["parameter_range"])
    inside = [int(v) for v in paths.folds_of(data) if low <= t[v] <= high]
    first, scaled = inside[0] if inside else vertices // 2, scale("", t, units)
    texts = [
        f"{symbol(name)} = {value:.4g} {scaled.label.strip(' []')}".rstrip()
        for value in scaled(t[keep])
    ]
    laws, state = law_part(stored), data["state"].values[np.minimum(keep, pieces - 1)]
    line = _line(data, keep, state, False, box)
    line["law"] = (
        laws["laws"][0] if laws is not None and len(laws["edges"]) == 1 else None
    )  # that all nodes have
    title = (
        "1  All equilibria of the range"
        if int(data.get("complete", 0))
        else "1  Equilibria on this path"
    )
    slider = states("along the path", texts, int(np.argmin(np.abs(keep - first))))
    told = text_parts(paths.path_parts(data))
    found = [section(title, "path", slider, choice("response", "response", shown), *told)]
    found.append(section("2  One state on the path", "point", line))
    if len(keep) == vertices:
        sheet = sheet_part(
            columns_of(data, "vertex", box), "path", states=True, chart=("parameter", "energy")
        )
        found.append(section("3  All vertices", "table", sheet))
    return found


FACTS = (
    "cycle",
    "friction_resultant",
    "u_T_max",
    "slip_length",
    "dissipated",
    "jumps",
    "inclusion_residual",
    "unique",
)
"""Those of the step that is looked at."""


def history_parts(stored: Stored, part: Any, without: tuple[str, ...], box: Container) -> Json:
    """One point of a history: loop, steps, what nodes do, energies, cycles and the table of all
    steps."""
    data, told = solved_steps(part), [{"part": "text", "lines": paths.sentences_of(part)}]
    if not data.sizes["step"]:
        return {"point": told, "accuracy": [], "table": []}
    names, loads, steps = (
        loop_names(data),
        str(data.attrs["loads"]).split(),
        np.arange(data.sizes["step"]),
    )
    panels, step_names = (
        history_panels(data, *names),
        [str(one) for one in data["step_name"].values],
    )
    columns = columns_of(data.drop_vars("slip"), "step", box)
    facts = {
        "part": "facts",
        "columns": [one for one in columns if one["name"] in (*loads, *FACTS)],
    }
    loop = panel_part(panels.pop("loop"), box, (data[names[0]].values, data[names[1]].values), 380)
    texts = [f"{i}, {name}" if name else str(i) for i, name in enumerate(step_names)]
    point = [*told, states("step", texts, len(texts) - 1), beside(loop, facts)]
    middle = np.full(len(steps), 0.5 * float(data["c"].sum()))
    motion = panels.pop("motion")
    if "lines" not in without:
        held = any(name.startswith("u_") for name in loads)
        moved = paths.motion(
            data["u_T"].values, data["jumped"].values if "jumped" in data else None
        )
        line = _line(data, slice(None), moved, at_rest(stored.study) and not held, box)
        line["moves"] = list(paths.MOVES)
        point.append(beside(line, panel_part(motion, box, (steps, middle), 250)))
    else:
        point.append(
            {
                "part": "text",
                "lines": ["The page was made without contact lines; the file has them."],
            }
        )
    sums = {name: np.cumsum(data[name].values) for name in ("work", "dissipated", "released")}
    units = str(data["dissipated"].attrs["units"])
    for title, of in {
        "Body and loads": ("work", "energy"),
        "Bond": ("dissipated", "released", "stored"),
    }.items():
        curves = {name: sums.get(name, data[name].values) for name in of}
        panel = Panel(Scale("step"), scale("energy", list(curves.values()), units), title)
        for (name, values), colour in zip(curves.items(), style.SERIES, strict=False):
            panel.line(
                steps, values, color=colour, linewidth=1.3, label=name + ", sum" * (name in sums)
            )
        panels = {title: panel} | panels
    energies = [panel_part(one, box, high=220) for one in panels.values()]
    sheet = sheet_part(columns, "steps", states=True, chart=(names[0], "friction_resultant"))
    return {"point": point, "accuracy": [beside(*energies)], "table": [sheet]}


def _line(data: Any, kept: Any, state: Any, rest: bool, box: Container) -> Json:
    """The contact line in the states that are kept, 0 in place of what is rounding beside the
    largest value of all states."""

    def shown(values: Any) -> Any:
        return cleared(values, SHARE * float(np.nanmax(np.abs(values))))[kept]

    line = line_along(data, shown, box) | {"rest": rest}
    return {"part": "line", "line": line, "state": box.array(state, "i1")}


def fit_sections(stored: Stored, box: Container) -> list[Json]:
    """Data and curve, what was found, and all data; a state is a datum."""
    data, (given, measured) = stored.data, fit.columns(stored.data)
    of, panels, rows = (
        data["measured_column"].values,
        fit_panels(data),
        np.arange(data.sizes["row"]),
    )
    first = of == 0
    places = data["datum_given"].values if given else rows + 1.0
    at = np.where(first, places, np.nan), np.where(first, data["datum"].values, np.nan)
    number = np.concatenate([1 + np.arange(np.count_nonzero(of == i)) for i in np.unique(of)])
    curve = panel_part(panels.pop("curve"), box, at, 400)
    residuals = panel_part(panels.pop("residuals"), box, (number, data["residual"].values), 240)
    one = {str(i): measured[i] for i in np.unique(of)}
    units = measured[0][1] if len(one) == 1 else "1"
    told: list[Any] = [("datum", "datum", "1", rows + 1)]
    told += [("measured", "measured", "1", [measured[i][0] for i in of])] if len(one) > 1 else []
    told += [(given[0][0], symbol(given[0][0]), given[0][1], places)] if given else []
    kinds = (
        ("value", "value", "datum"),
        ("predicted", "of the study", "predicted"),
        ("noise", "noise", "noise"),
    )
    told += [(key, title, units, data[variable].values) for key, title, variable in kinds]
    told.append(("residual", "(observed − fitted) / noise", "1", data["residual"].values))
    columns = [column(name, title, unit, values, box) for name, title, unit, values in told]
    rest = [panel_part(panel, box, high=260) for panel in panels.values()]
    facts = {"part": "facts", "columns": columns}
    worst = int(np.nanargmax(np.abs(data["residual"].values)))
    slider = states("datum", [f"{i + 1} of {len(rows)}" for i in rows], worst)
    return [
        section("1  Data and fit", "fit", slider, beside(curve, facts), residuals),
        section("2  What was found", "found", *text_parts(fit.parts(data)), beside(*rest)),
        section("3  The data", "table", sheet_part(columns, "fit", states=True)),
    ]


SECTIONS = {
    "convergence": convergence_sections,
    "cost": cost_sections,
    "path": path_sections,
    "fit": fit_sections,
}
"""What makes the page of a file of each kind that has no points to choose from."""


SCRIPTS = (
    "format",
    "charts",
    "controls",
    "parts",
    "run",
    "point",
    "laws",
    "solver",
    "live",
    "main",
)

AIM = 1_900_000
"""Bytes that a page should not exceed: it still travels by mail and opens at once on a phone."""
MOST = 10_000_000
"""Bytes that no page exceeds."""
LEAVE_OUT = ("levels", "live", "body", "lines")
"""What may be left out, in the order in which it goes where a page is too large: contact lines of
the coarser levels, the data of the live mode, the body's fields, all contact lines."""


@dataclass(frozen=True)
class Written:
    """What was written: its size [byte] and what was left out because of it, one of LEAVE_OUT
    each."""

    path: Path
    size: int
    left_out: tuple[str, ...]

    @property
    def words(self) -> str:
        """One line that says what was written."""
        size = f"{self.size / 1e6:.1f} MB" if self.size >= 1e5 else f"{self.size / 1e3:.0f} kB"
        left_out = (
            f"; left out because of the size: {', '.join(self.left_out)}" if self.left_out else ""
        )
        return f"{self.path}: {size}{left_out}"


def write_page(path: Path, target: Path) -> Written:
    """Write the page of a result file, replacing an old page in one step.

    Raises StoreError if `path` is no complete result file or `target` cannot be written, PageError
    if the page would be larger than MOST or something else than a page would be lost.
    """
    if faults := check_writable(target):
        raise PageError("; ".join(faults))
    if target.is_file() and not target.read_bytes()[:200].lstrip().lower().startswith(
        b"<!doctype html"
    ):
        raise PageError(
            f"{target} exists and is no page; it would be lost: choose another name with -o"
        )
    without: list[str] = []
    with reading(path):
        stored = read(path)
        text = _fitting(stored, without)
    if len(text) > MOST:
        raise PageError(
            f"the page would have {len(text) / 1e6:.0f} MB, more than {MOST / 1e6:.0f} MB, even without "
            f"{', '.join(without) or 'its optional parts'}; split the sweep into several studies"
        )
    replace_file(target, lambda aside: aside.write_bytes(text), sealed=False)
    return Written(target, len(text), tuple(without))


def _fitting(stored: Stored, without: list[str]) -> bytes:
    """The page, less parts in their order until it is no larger than AIM; these are added to those
    left out."""
    if _lines(stored) > 2 * AIM:  # however they are packed
        without += [*["levels"] * (len(stored.groups) > 1), "lines"]
    text = page(stored, tuple(without)).encode()
    for part in (part for part in _optional(stored) if part not in without):
        if len(text) <= AIM:
            break
        if len(less := page(stored, (*without, part)).encode()) < len(text):
            without.append(part)
            text = less
    return text


def _optional(stored: Stored) -> list[str]:
    """Return those of LEAVE_OUT that a page has: to make one of many geometries takes long."""
    if stored.kind != "run":
        return [*LEAVE_OUT]
    bodies = [home for home in stored.homes if home is not None] or [stored]
    has = {
        "levels": any(len(body.groups) > 1 for body in bodies),
        "live": bool(stored.live),
        "body": any(drawn_level(body) is not None for body in bodies),
        "lines": any(body.groups for body in bodies),
    }
    return [part for part in LEAVE_OUT if has[part]]


def _lines(stored: Stored) -> int:
    """Bytes of the finest contact lines of a run before they are packed, slip and traction in 16
    bits, states in 8."""
    if stored.kind != "run" or not stored.groups:
        return 0
    return (
        5
        * int(stored.groups[max(stored.groups)].sizes.get("node", 0))
        * int(stored.data["status"][..., -1].size)
    )


def page(stored: Stored, without: tuple[str, ...] = ()) -> str:
    """The whole page as text."""
    box = Container()
    verdict = verdict_of(stored.path)
    header = {**_about(stored), **_content(stored, without, box), "without": list(without)}
    header["verdict"] = {"lines": verdict.lines, "how": stored.words, "ok": verdict.complete}
    remarks = map(str, remarks_of(stored.data.attrs))
    return _filled(
        {
            "<!--title-->": html.escape(str(header["title"])),
            "<!--verdict-->": _verdict_rows(verdict),
            "<!--warnings-->": "".join(map(_warning, remarks)),
            "<!--data-->": box.packed(header),
        }
    )


def _warning(text: str) -> str:
    return f'<p class="warning">Warning: {html.escape(text)}</p>\n'


def _filled(texts: Mapping[str, str]) -> str:
    """Return the shell of the page with texts, style and scripts in place of their marks.

    All marks are replaced in one pass, so that a mark within a text stays what it is. The policy of
    the page allows the one script that has its hash.
    """
    assets = resources.files("tcstudy.reports.page") / "assets"

    def asset(name: str) -> str:
        return (assets / name).read_text(encoding="utf-8")

    scripts = "\n".join(asset(f"{name}.js") for name in SCRIPTS)
    script = '\n"use strict";\n' + scripts.replace("</script", "<\\/script") + "\n"
    digest = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()
    marks = {
        **texts,
        "/*style*/": asset("style.css"),
        "/*scripts*/": script,
        "/*hash*/": f"sha256-{digest}",
    }
    pattern = "|".join(map(re.escape, marks))
    return re.sub(pattern, lambda mark: marks[mark[0]], asset("shell.html"))


def _verdict_rows(verdict: Verdict) -> str:
    """Return the labelled lines of a verdict as a list of terms and facts."""
    rows = list[str]()
    for label, facts in verdict.fields.items():
        lines = "".join(f"<dd>{html.escape(fact)}</dd>" for fact in facts)
        rows.append(f"<dt>{label.capitalize()}</dt>{lines}")
    return "".join(rows)


def _about(stored: Stored) -> Json:
    attrs, names = stored.data.attrs, [*(row.name for row in ROWS), *map(str, stored.data.coords)]
    swept = axis_names(stored.data) if "status" in stored.data else []
    told = (
        "history",
        "source",
        "git_commit",
        "study_sha256",
        "references",
        "institution",
        "Conventions",
    )
    return {
        "kind": stored.kind,
        "title": str(attrs["title"]),
        "file": stored.path.name,
        "unit_system": str(attrs["unit_system"]),
        "solver": str(attrs["solver"]),
        "states": STATES,
        "proofs": sentences.PROVED_STEPS if stored.kind == "history" else sentences.PROVED,
        "symbols": {name: symbol(name) for name in names if name.partition("_")[0] in GREEK}
        | {name: axis_symbol(stored.data, name) for name in swept}
        | {
            str(name): spelled(str(one.attrs["long_name"]))
            for name, one in stored.data.data_vars.items()
            if "long_name" in one.attrs
        }
        | {name: name for name in asked(stored.data)},
        "tolerance": float(attrs["solver_tolerance"]),
        "provenance": {name: str(attrs[name]) for name in told},
        "versions": json.loads(attrs["versions"]),
        "overrides": str(attrs["overrides"]).splitlines(),
        "yaml": str(attrs["study_yaml"]),
    }


def _content(stored: Stored, without: tuple[str, ...], box: Container) -> Json:
    if stored.kind in SECTIONS:
        return {"sections": SECTIONS[stored.kind](stored, box)}
    if stored.kind == "history":
        steps = [
            history_parts(stored, stored.data.isel(where), without, box)
            for where in each_point(stored.data)
        ]
        return {"run": run_part(stored, box), "steps": steps, **shape(stored)}
    content = {"run": run_part(stored, box), "laws": law_part(stored)}
    content["solvers"] = text_parts(solvers_compared(stored.data))
    if stored.homes:
        content["run"]["home"] = stored.data["geometry"].values.ravel().tolist()
        content["run"]["levels"] |= time_of_levels(
            [home.data for home in stored.homes if home is not None]
        )
        content["homes"] = [home and _home(home, without, box) for home in stored.homes]
    else:
        content |= _home(stored, without, box)
    usable = "live" not in without and "lines" not in without
    if stored.live and usable and stored.groups and (live := live_part(stored, box)) is not None:
        content["live"] = live
        level = str(live["level"])
        if level not in content["lines"]:
            content["lines"][level] = line_part(stored, live["level"], box)
    return content


def _home(stored: Stored, without: tuple[str, ...], box: Container) -> Json:
    """What the points of one geometry share, and their fields and contact lines."""
    levels = [] if "lines" in without else sorted(stored.groups)
    body = drawn_level(stored) if "body" not in without else None
    return {
        "levels": level_numbers(stored.data),
        "lines": {
            str(n): line_part(stored, n, box)
            for n in (levels[-1:] if "levels" in without else levels)
        },
        **shape(stored),
        "body": None if body is None else body_part(stored, body, box),
    }
