"""The page put together: what it holds, how large it may be, and what is left out where that is too much."""

from __future__ import annotations

import html
import json
from dataclasses import dataclass
from importlib import resources
from pathlib import Path

from tcstudy.data.files import check_writable, reading, remarks_of, replace_file
from tcstudy.data.reading import asked, each_point
from tcstudy.errors import PageError, tell
from tcstudy.reports import sentences
from tcstudy.reports.page.kinds import SECTIONS, history_parts
from tcstudy.reports.page.parts import Container, Json
from tcstudy.reports.page.run import (
    body_part,
    drawn_level,
    law_part,
    level_numbers,
    line_part,
    live_part,
    run_part,
    shape,
    time_of_levels,
)
from tcstudy.reports.page.stored import Stored, read
from tcstudy.reports.terminal.paths import STATES
from tcstudy.reports.terminal.summary import verdict_of
from tcstudy.reports.text import spelled
from tcstudy.scene.keys import GREEK, ROWS, symbol

SCRIPTS = ("format", "charts", "controls", "parts", "run", "point", "laws", "solver", "live", "main")

AIM = 1_900_000
"""Bytes that a page should not exceed: it still travels by mail and opens at once on a phone."""
MOST = 10_000_000
"""Bytes that no page exceeds."""
LEAVE_OUT = ("levels", "live", "body", "lines")
"""What may be left out, in the order in which it goes where a page is too large: contact lines of the coarser levels,
the data of the live mode, the body's fields, all contact lines."""


@dataclass(frozen=True)
class Written:
    """What was written: its size [byte] and what was left out because of it, one of LEAVE_OUT each."""

    path: Path
    size: int
    left_out: tuple[str, ...]

    @property
    def words(self) -> str:
        """One line that says what was written."""
        size = f"{self.size / 1e6:.1f} MB" if self.size >= 1e5 else f"{self.size / 1e3:.0f} kB"
        left_out = f"; left out because of the size: {', '.join(self.left_out)}" if self.left_out else ""
        return f"{self.path}: {size}{left_out}"


def write_page(path: Path, target: Path) -> Written:
    """Write the page of a result file, replacing an old page in one step.

    Raises StoreError if `path` is no complete result file or `target` cannot be written, PageError if the page would
    be larger than MOST or something else than a page would be lost.
    """
    if faults := check_writable(target):
        raise PageError("; ".join(faults))
    if target.is_file() and not target.read_bytes()[:200].lstrip().lower().startswith(b"<!doctype html"):
        raise PageError(f"{target} exists and is no page; it would be lost: choose another name with -o")
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
    tell(remarks_of(stored.data.attrs))
    return Written(target, len(text), tuple(without))


def _fitting(stored: Stored, without: list[str]) -> bytes:
    """The page, less parts in their order until it is no larger than AIM; these are added to those left out."""
    if _lines(stored) > 2 * AIM:  # however they are packed
        without += [*["levels"] * (len(stored.groups) > 1), "lines"]
    text = page(stored, tuple(without)).encode()
    for part in (part for part in LEAVE_OUT if part not in without):
        if len(text) <= AIM:
            break
        if len(less := page(stored, (*without, part)).encode()) < len(text):
            without.append(part)
            text = less
    return text


def _lines(stored: Stored) -> int:
    """Bytes of the finest contact lines of a run before they are packed, slip and traction in 16 bits, states in 8."""
    if stored.kind != "run" or not stored.groups:
        return 0
    return 5 * int(stored.groups[max(stored.groups)].sizes.get("node", 0)) * int(stored.data["status"][..., -1].size)


def page(stored: Stored, without: tuple[str, ...] = ()) -> str:
    """The whole page as text."""
    box = Container()
    verdict, how, ok = verdict_of(stored.path)
    verdict = f"{len(stored.homes)} geometries: {verdict}" if stored.homes else verdict
    header = {**_about(stored), **_content(stored, without, box), "without": list(without)}
    header["verdict"] = {"text": verdict, "how": "; ".join(filter(None, [how, stored.words])), "ok": ok}
    assets = resources.files("tcstudy.reports.page") / "assets"
    shell = (assets / "shell.html").read_text(encoding="utf-8")
    scripts = "\n".join((assets / f"{name}.js").read_text(encoding="utf-8") for name in SCRIPTS)
    told = map(str, remarks_of(stored.data.attrs))
    for mark, text in (
        ("<!--title-->", html.escape(str(header["title"]))),
        ("<!--verdict-->", html.escape(verdict)),
        ("<!--warnings-->", "".join(f'<p class="warning">Warning: {html.escape(one)}</p>\n' for one in told)),
        ("/*style*/", (assets / "style.css").read_text(encoding="utf-8")),
        ("/*scripts*/", scripts.replace("</script", "<\\/script")),
        ("<!--data-->", box.packed(header)),
    ):
        shell = shell.replace(mark, text)
    return shell


def _about(stored: Stored) -> Json:
    attrs, names = stored.data.attrs, [*(row.name for row in ROWS), *map(str, stored.data.coords)]
    told = ("history", "source", "git_commit", "study_sha256", "references", "institution", "Conventions")
    return {
        "kind": stored.kind,
        "title": str(attrs["title"]),
        "file": stored.path.name,
        "unit_system": str(attrs["unit_system"]),
        "solver": str(attrs["solver"]),
        "states": STATES,
        "proofs": sentences.PROVED_STEPS if stored.kind == "history" else sentences.PROVED,
        "symbols": {name: symbol(name) for name in names if name.partition("_")[0] in GREEK}
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
        steps = [history_parts(stored, stored.data.isel(where), without, box) for where in each_point(stored.data)]
        return {"run": run_part(stored, box), "steps": steps, **shape(stored.study)}
    content = {"run": run_part(stored, box), "laws": law_part(stored)}
    if stored.homes:
        content["run"]["home"] = stored.data["geometry"].values.ravel().tolist()
        content["run"]["levels"] |= time_of_levels([home.data for home in stored.homes if home is not None])
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
        "lines": {str(n): line_part(stored, n, box) for n in (levels[-1:] if "levels" in without else levels)},
        **shape(stored.study),
        "body": None if body is None else body_part(stored, body, box),
    }
