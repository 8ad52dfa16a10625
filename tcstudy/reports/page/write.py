"""The whole page: its sections, its size, and the parts that a page too large leaves out."""

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
    OPENING_MOVES,
    bond_states,
    fit_panels,
    history_panels,
    loop_names,
    path_panels,
    response_of,
    responses_of,
    solved_steps,
)
from tcstudy.reports.json_values import Json
from tcstudy.reports.page.parts import (
    Container,
    beside_part,
    choice_part,
    column,
    columns_of,
    panel_part,
    section,
    sheet_part,
    states_part,
    text_part,
    text_parts,
)
from tcstudy.reports.page.run import (
    body_part,
    drawn_level,
    law_looks,
    law_part,
    level_numbers,
    line_along,
    line_part,
    live_part,
    openings_along,
    run_part,
    shape,
    time_of_levels,
)
from tcstudy.reports.page.stored import Stored, read
from tcstudy.reports.picture import at_rest
from tcstudy.reports.rounding import SHARE, cleared
from tcstudy.reports.select_point import axis_symbol, describe
from tcstudy.reports.symbols import GREEK, symbol
from tcstudy.reports.terminal import accuracy, fit, paths
from tcstudy.reports.terminal.paths import STATES
from tcstudy.reports.terminal.summary import solvers_compared, verdict_of
from tcstudy.reports.text import Verdict, in_sentences, spelled
from tcstudy.scene.keys import ROWS

MAX_STATE_BYTES = 4_000_000
"""Room for slip and traction along a path; of a longer path, some vertices are shown."""
MAX_POINTS = 200
"""Points whose errors a page shows; the file has all."""


def convergence_sections(stored: Stored, box: Container) -> list[Json]:
    """Return errors over h and the tables of every sweep point."""
    data = stored.data
    points = each_point(data)
    options = {}
    for where in points[:MAX_POINTS]:
        point = data.isel(where)
        panels = convergence_panels(point).values()
        panel_parts = [panel_part(panel, box, height=300) for panel in panels]
        tables = text_parts(accuracy.tables(point))
        options[describe(data, where) or "the point"] = [beside_part(*panel_parts), *tables]
    lines = [f"Reference: {data.attrs['reference']}.", accuracy.LEGEND, *accuracy.notes(data)]
    if len(points) > MAX_POINTS:
        lines.append(f"The first {MAX_POINTS} of {len(points)} points; the file has all.")
    points_part = choice_part("point", "p", options)
    return [section("Convergence over the levels", "main-part", points_part, text_part(lines))]


def cost_sections(stored: Stored, box: Container) -> list[Json]:
    """Return every measured setting, by error, and the advice of the file."""
    data = stored.data
    measures = [measure for measure in MEASURES if f"error_{measure.name}" in data]
    measures.sort(key=lambda measure: measure.name != accuracy.DEFAULT)
    options = dict[str, list[Json]]()
    for measure in measures:
        panels = cost_panels(data, measure.name).values()
        panel_parts = [panel_part(panel, box, height=330) for panel in panels]
        answer = accuracy.advice(accuracy.settings(data, measure.name))
        texts = text_parts(accuracy.measured_parts(data, measure.name))
        options[measure.symbol] = [beside_part(*panel_parts), text_part(answer), *texts]
    part = text_part(["Nothing was measured."])
    if options:
        part = choice_part("error of", "error", options)
    return [section("Accuracy against cost", "errors", part)]


def path_sections(stored: Stored, box: Container) -> list[Json]:
    """Return the response curve with its text, one state, and all vertices."""
    data = stored.data
    vertex_count, shown_vertices = int(data.sizes["vertex"]), _shown_vertices(data)
    parameter = data["parameter"].values
    options = {}
    for key, (title, *_) in responses_of(data).items():
        curve, *strips = path_panels(data, key).values()
        places = parameter[shown_vertices], response_of(data, key)[shown_vertices]
        options[title] = [panel_part(curve, box, places, 400)]
        options[title] += [panel_part(strip, box, height=190) for strip in strips]
    title = "1  Equilibria on this path"
    if int(data.get("complete", 0)):
        title = "1  All equilibria of the range"
    slider = _path_slider(data, shown_vertices)
    responses = choice_part("response", "response", options)
    texts = text_parts(paths.path_parts(data))
    sections = [
        section(title, "path", slider, responses, *texts),
        section("2  One state on the path", "point", _path_line(stored, shown_vertices, box)),
    ]
    if len(shown_vertices) == vertex_count:
        columns = columns_of(data, "vertex", box)
        sheet = sheet_part(columns, "path", states=True, chart=("parameter", "energy"))
        sections.append(section("3  All vertices", "table", sheet))
    return sections


def _shown_vertices(data: Any) -> Any:
    """Return the vertices of a path whose states the page has: all, or a part with the last."""
    vertex_count = int(data.sizes["vertex"])
    state_bytes = 4 * int(data.sizes["node"]) * vertex_count
    stride = max(1, -(-state_bytes // MAX_STATE_BYTES))
    return np.unique(np.append(np.arange(0, vertex_count, stride), vertex_count - 1))


def _path_slider(data: Any, shown_vertices: Any) -> Json:
    """Return the slider of the states of a path, at the first fold or in the middle."""
    parameter = data["parameter"].values
    low, high = sorted(float(end) for end in data.attrs["parameter_range"])
    folds = [int(vertex) for vertex in paths.folds_of(data)]
    folds_in_range = [vertex for vertex in folds if low <= parameter[vertex] <= high]
    first = folds_in_range[0] if folds_in_range else int(data.sizes["vertex"]) // 2
    axis = scale("", parameter, str(data["parameter"].attrs["units"]))
    name, unit = symbol(str(data.attrs["parameter"])), axis.label.strip(" []")
    values = axis(parameter[shown_vertices])
    texts = [f"{name} = {value:.4g} {unit}".rstrip() for value in values]
    return states_part("along the path", texts, int(np.argmin(np.abs(shown_vertices - first))))


def _path_line(stored: Stored, shown_vertices: Any, box: Container) -> Json:
    """Return the contact line along a path, with the law where all nodes have one."""
    data = stored.data
    pieces = np.minimum(shown_vertices, int(data.sizes["piece"]) - 1)
    line = _line(data, shown_vertices, data["state"].values[pieces], False, box)
    if "opening" in data:
        states = bond_states(data, pieces)
        line["line"]["openings"] = _openings(data, shown_vertices, states, box)
    laws = law_part(stored)
    line["law"] = None
    if laws is not None and len(laws["edges"]) == 1 and not laws["laws"][0].get("vanishes"):
        line["law"] = laws["laws"][0]
    return line


FACTS = (
    *("cycle", "friction_resultant", "u_T_max", "slip_length"),
    *("opening_max", "adhesion_resultant"),
    *("dissipated", "jumps", "inclusion_residual", "unique"),
)
"""Values of the chosen step that stand beside the loop, after its loads."""
ENERGIES = {
    "Body and loads": ("work", "energy"),
    "Bond": ("dissipated", "released", "stored"),
}
"""Variables of the panels of energies, by title."""
SUMMED = ("work", "dissipated", "released")
"""Energies of a single step, of which the page shows sums."""


def history_parts(stored: Stored, part: Any, without: tuple[str, ...], box: Container) -> Json:
    """Return one point of a history: loop, states, energies, cycles and the table of steps."""
    data = solved_steps(part)
    sentences_part = text_part(paths.sentences_of(part))
    if not data.sizes["step"]:
        return {"point": [sentences_part], "accuracy": [], "table": []}
    x_name, y_name = loop_names(data)
    panels = history_panels(data, x_name, y_name)
    loop_panel, motion_panel = panels.pop("loop"), panels.pop("motion")
    columns = columns_of(data.drop_vars("slip"), "step", box)
    fact_names = (*str(data.attrs["loads"]).split(), *FACTS)
    facts = {
        "part": "facts",
        "columns": [column for column in columns if column["name"] in fact_names],
    }
    loop = panel_part(loop_panel, box, (data[x_name].values, data[y_name].values), 380)
    point = [sentences_part, _step_slider(data), beside_part(loop, facts)]
    if "lines" in without:
        point.append(text_part(["The page was made without contact lines; the file has them."]))
    else:
        point.append(_motion_part(stored, data, motion_panel, box))
    energy_panels = [*_energy_panels(data), *panels.values()]
    energies = [panel_part(panel, box, height=220) for panel in energy_panels]
    charted = y_name if "opening_max" in data else "friction_resultant"
    sheet = sheet_part(columns, "steps", states=True, chart=(x_name, charted))
    return {"point": point, "accuracy": [beside_part(*energies)], "table": [sheet]}


def _step_slider(data: Any) -> Json:
    texts = []
    for step, name in enumerate(data["step_name"].values):
        texts.append(f"{step}, {name}" if str(name) else str(step))
    return states_part("step", texts, len(texts) - 1)


def _motion_part(stored: Stored, data: Any, panel: Panel, box: Container) -> Json:
    """Return the contact line in every step, beside the panel of the motion of its nodes."""
    has_prescribed_slip = any(name.startswith("u_") for name in str(data.attrs["loads"]).split())
    jumped = data["jumped"].values if "jumped" in data else None
    moves = paths.motion(data["u_T"].values, jumped)
    is_at_rest = at_rest(stored.study) and not has_prescribed_slip
    line = _line(data, slice(None), moves, is_at_rest, box)
    line["moves"] = list(paths.MOVES)
    if "opening" in data:
        jumped = data["jumped_N"].values if "jumped_N" in data else None
        moves = paths.motion(data["opening"].values, jumped)
        openings = _openings(data, slice(None), moves, box)
        line["line"]["openings"] = openings | {"moves": list(OPENING_MOVES)}
    steps = np.arange(data.sizes["step"])
    middle = np.full(len(steps), 0.5 * float(data["c"].sum()))
    return beside_part(line, panel_part(panel, box, (steps, middle), 250))


def _energy_panels(data: Any) -> list[Panel]:
    """Return the energies of a history over its steps, those of the bond first."""
    steps = np.arange(data.sizes["step"])
    units = str(data["dissipated"].attrs["units"])
    panels = list[Panel]()
    for title, names in ENERGIES.items():
        curves = {}
        for name in names:
            values = data[name].values
            if name in SUMMED:
                curves[f"{name}, sum"] = np.cumsum(values)
            else:
                curves[name] = values
        panel = Panel(Scale("step"), scale("energy", list(curves.values()), units), title)
        for (label, values), colour in zip(curves.items(), style.SERIES, strict=False):
            panel.line(steps, values, color=colour, linewidth=1.3, label=label)
        panels.insert(0, panel)
    return panels


def _line(data: Any, selection: Any, state: Any, is_at_rest: bool, box: Container) -> Json:
    """Return the contact line in the selected states.

    Values that are rounding beside the largest value of all states are 0.
    """

    def rows(variable: Any) -> Any:
        return cleared(variable, SHARE * float(np.nanmax(np.abs(variable))))[selection]

    line = line_along(data, rows, box) | {"rest": is_at_rest}
    return {"part": "line", "line": line, "state": box.array(state, "i1")}


def _openings(data: Any, selection: Any, state: Any, box: Container) -> Json:
    """Return the nodes that may open in the selected states."""

    def rows(name: str) -> Any:
        values = data[name].values
        return cleared(values, SHARE * float(np.nanmax(np.abs(values))))[selection]

    return openings_along(data, rows("opening"), rows("S_N"), state, box)


def fit_sections(stored: Stored, box: Container) -> list[Json]:
    """Return data and curve, the fitted parameters, and all data; a state is a datum."""
    data = stored.data
    given, _ = fit.columns(data)
    panels = fit_panels(data)
    column_of_datum = data["measured_column"].values
    row_count = data.sizes["row"]
    places = data["datum_given"].values if given else np.arange(row_count) + 1.0

    # the curve shows the data of the first measured column alone
    is_first = column_of_datum == 0
    curve_places = (
        np.where(is_first, places, np.nan),
        np.where(is_first, data["datum"].values, np.nan),
    )
    curve = panel_part(panels.pop("curve"), box, curve_places, 400)
    counts = [np.count_nonzero(column_of_datum == i) for i in np.unique(column_of_datum)]
    number_in_column = np.concatenate([1 + np.arange(count) for count in counts])
    residual_places = number_in_column, data["residual"].values
    residuals = panel_part(panels.pop("residuals"), box, residual_places, 240)
    other_panels = [panel_part(panel, box, height=260) for panel in panels.values()]

    columns = _datum_columns(data, places, box)
    facts = {"part": "facts", "columns": columns}
    worst = int(np.nanargmax(np.abs(data["residual"].values)))
    texts = [f"{row + 1} of {row_count}" for row in range(row_count)]
    slider = states_part("datum", texts, worst)
    report = text_parts(fit.parts(data))
    sheet = sheet_part(columns, "fit", states=True)
    return [
        section("1  Data and fit", "fit", slider, beside_part(curve, facts), residuals),
        section("2  Fitted parameters", "found", *report, beside_part(*other_panels)),
        section("3  The data", "table", sheet),
    ]


def _datum_columns(data: Any, places: Any, box: Container) -> list[Json]:
    """Return the columns of the data of a fit; several measured columns have no common unit."""
    given, measured = fit.columns(data)
    column_of_datum = data["measured_column"].values
    has_one_column = len(np.unique(column_of_datum)) == 1
    units = measured[0][1] if has_one_column else "1"
    columns = [column("datum", "datum", "1", np.arange(data.sizes["row"]) + 1, box)]
    if not has_one_column:
        names = [measured[number][0] for number in column_of_datum]
        columns.append(column("measured", "measured", "1", names, box))
    if given:
        name, given_units = given[0]
        columns.append(column(name, symbol(name), given_units, places, box))
    for name, title, variable in (
        ("value", "value", "datum"),
        ("predicted", "of the study", "predicted"),
        ("noise", "noise", "noise"),
    ):
        columns.append(column(name, title, units, data[variable].values, box))
    residual_title = "(observed − fitted) / noise"
    columns.append(column("residual", residual_title, "1", data["residual"].values, box))
    return columns


SECTIONS = {
    "convergence": convergence_sections,
    "cost": cost_sections,
    "path": path_sections,
    "fit": fit_sections,
}
"""Makers of the sections of a page, by the kind of its file; runs and histories have none."""


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
OPENINGS_SCRIPT = "openings"
"""Beside SCRIPTS, before the last one, on pages of contact that may open."""

AIM = 1_900_000
"""Bytes that a page should not exceed: it still travels by mail and opens at once on a phone."""
MOST = 10_000_000
"""Bytes that no page exceeds."""
LEAVE_OUT = ("levels", "live", "body", "lines")
"""Parts that a page too large leaves out, in this order: contact lines of the coarser levels, live
data, the fields of the body, all contact lines."""


@dataclass(frozen=True)
class Written:
    """A page that was written: its size [byte] and the parts of LEAVE_OUT that it left out."""

    path: Path
    size: int
    left_out: tuple[str, ...]

    @property
    def words(self) -> str:
        """One line on the page that was written."""
        size = f"{self.size / 1e6:.1f} MB" if self.size >= 1e5 else f"{self.size / 1e3:.0f} kB"
        line = f"{self.path}: {size}"
        if self.left_out:
            line += f"; left out because of the size: {', '.join(self.left_out)}"
        return line


def write_page(path: Path, target: Path) -> Written:
    """Write the page of a result file, replacing an old page in one step.

    Raises StoreError if `path` is no complete result file or `target` cannot be written.
    Raises PageError if the page would be larger than MOST, or would replace a file that is no page.
    """
    if faults := check_writable(target):
        raise PageError("; ".join(faults))
    if target.is_file() and not _is_page(target):
        raise PageError(
            f"{target} exists and is no page; it would be lost: choose another name with -o"
        )
    without: list[str] = []
    with reading(path):
        stored = read(path)
        text = _fitting(stored, without)
    if len(text) > MOST:
        left_out = ", ".join(without) or "its optional parts"
        raise PageError(
            f"the page would have {len(text) / 1e6:.0f} MB, more than {MOST / 1e6:.0f} MB, "
            f"even without {left_out}; split the sweep into several studies"
        )
    replace_file(target, lambda aside: aside.write_bytes(text), sealed=False)
    return Written(target, len(text), tuple(without))


def _is_page(path: Path) -> bool:
    return path.read_bytes()[:200].lstrip().lower().startswith(b"<!doctype html")


def _fitting(stored: Stored, without: list[str]) -> bytes:
    """Return the page without optional parts, in their order, until it is no larger than AIM.

    The parts that it leaves out are added to `without`.
    """
    if _line_bytes(stored) > 2 * AIM:  # no compression brings so many below AIM
        if len(stored.groups) > 1:
            without.append("levels")
        without.append("lines")
    text = page(stored, tuple(without)).encode()
    for part in _optional(stored):
        if part in without:
            continue
        if len(text) <= AIM:
            break
        shorter = page(stored, (*without, part)).encode()
        if len(shorter) < len(text):
            without.append(part)
            text = shorter
    return text


def _optional(stored: Stored) -> list[str]:
    """Return the parts of LEAVE_OUT that a page has: to try one more page may take long."""
    if stored.kind != "run":
        return [*LEAVE_OUT]
    bodies = [body for body in stored.geometries if body is not None] or [stored]
    has = {
        "levels": any(len(body.groups) > 1 for body in bodies),
        "live": bool(stored.live),
        "body": any(drawn_level(body) is not None for body in bodies),
        "lines": any(body.groups for body in bodies),
    }
    return [part for part in LEAVE_OUT if has[part]]


def _line_bytes(stored: Stored) -> int:
    """Return the bytes of the finest contact lines of a run: u_T and ξ of 16 bits, states of 8."""
    if stored.kind != "run" or not stored.groups:
        return 0
    finest = stored.groups[max(stored.groups)]
    return 5 * int(finest.sizes.get("node", 0)) * int(stored.data["status"][..., -1].size)


def page(stored: Stored, without: tuple[str, ...] = ()) -> str:
    """Return the whole page as text."""
    box = Container()
    verdict = verdict_of(stored.path)
    header = {**_about(stored), **_content(stored, without, box), "without": list(without)}
    header["verdict"] = {
        "lines": verdict.lines,
        "how": stored.selection_note,
        "ok": verdict.complete,
    }
    remarks = map(str, remarks_of(stored.data.attrs))
    return _filled(
        {
            "<!--title-->": html.escape(str(header["title"])),
            "<!--verdict-->": _verdict_rows(verdict),
            "<!--warnings-->": "".join(map(_warning, remarks)),
            "<!--data-->": box.packed(header),
        },
        opens="opening_max" in stored.data,
    )


def _warning(text: str) -> str:
    return f'<p class="warning">Warning: {html.escape(in_sentences(text))}</p>\n'


def _filled(texts: Mapping[str, str], opens: bool) -> str:
    """Return the shell of the page with texts, style and scripts in place of their marks.

    opens: whether contact may open, which needs a script of its own

    All marks are replaced in one pass, so that a mark within a text stays what it is. The policy of
    the page allows the one script that has its hash.
    """
    assets = resources.files("tcstudy.reports.page") / "assets"

    def asset(name: str) -> str:
        return (assets / name).read_text(encoding="utf-8")

    names = (*SCRIPTS[:-1], OPENINGS_SCRIPT, SCRIPTS[-1]) if opens else SCRIPTS
    scripts = "\n".join(asset(f"{name}.js") for name in names)
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


ATTRIBUTES = (
    *("history", "source", "git_commit", "study_sha256"),
    *("references", "institution", "Conventions"),
)
"""Attributes of a file that the page shows."""


def _about(stored: Stored) -> Json:
    """Return title, symbols, words and origin of a file."""
    attrs = stored.data.attrs
    return {
        "kind": stored.kind,
        "title": str(attrs["title"]),
        "file": stored.path.name,
        "unit_system": str(attrs["unit_system"]),
        "solver": str(attrs["solver"]),
        "states": STATES,
        "law_looks": law_looks(),
        "proofs": sentences.PROVED_STEPS if stored.kind == "history" else sentences.PROVED,
        "symbols": _symbols(stored.data),
        "tolerance": float(attrs["solver_tolerance"]),
        "provenance": {name: str(attrs[name]) for name in ATTRIBUTES},
        "versions": json.loads(attrs["versions"]),
        "overrides": str(attrs["overrides"]).splitlines(),
        "yaml": str(attrs["study_yaml"]),
    }


def _symbols(data: Any) -> dict[str, str]:
    """Return the symbols of parameters and variables; requested variables keep their names."""
    names = [*(row.name for row in ROWS), *map(str, data.coords)]
    symbols = {name: symbol(name) for name in names if name.partition("_")[0] in GREEK}
    if "status" in data:
        symbols |= {name: axis_symbol(data, name) for name in axis_names(data)}
    for name, variable in data.data_vars.items():
        if "long_name" in variable.attrs:
            symbols[str(name)] = spelled(str(variable.attrs["long_name"]))
    return symbols | {name: name for name in asked(data)}


def _content(stored: Stored, without: tuple[str, ...], box: Container) -> Json:
    if stored.kind in SECTIONS:
        return {"sections": SECTIONS[stored.kind](stored, box)}
    if stored.kind == "history":
        points = [stored.data.isel(where) for where in each_point(stored.data)]
        steps = [history_parts(stored, point, without, box) for point in points]
        return {"run": run_part(stored, box), "steps": steps, **shape(stored)}
    content = {"run": run_part(stored, box), "laws": law_part(stored)}
    content["solvers"] = text_parts(solvers_compared(stored.data))
    if stored.geometries:
        level_tables = [body.data for body in stored.geometries if body is not None]
        content["run"]["home"] = stored.data["geometry"].values.ravel().tolist()
        content["run"]["levels"] |= time_of_levels(level_tables)
        content["homes"] = [body and _geometry(body, without, box) for body in stored.geometries]
    else:
        content |= _geometry(stored, without, box)
    has_lines = "lines" not in without and bool(stored.groups)
    if stored.live and has_lines and "live" not in without:
        live = live_part(stored, box)
        if live is not None:
            content["live"] = live
            level = live["level"]
            if str(level) not in content["lines"]:
                content["lines"][str(level)] = line_part(stored, level, box)
    return content


def _geometry(stored: Stored, without: tuple[str, ...], box: Container) -> Json:
    """Return the parts that the points of a geometry share, with their fields and contact lines."""
    levels = [] if "lines" in without else sorted(stored.groups)
    if "levels" in without:
        levels = levels[-1:]
    body_level = None if "body" in without else drawn_level(stored)
    return {
        "levels": level_numbers(stored.data),
        "lines": {str(level): line_part(stored, level, box) for level in levels},
        **shape(stored),
        "body": None if body_level is None else body_part(stored, body_level, box),
    }
