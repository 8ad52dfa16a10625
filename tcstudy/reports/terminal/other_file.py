"""What a netCDF file is that holds no study, such as those of the benchmarks: its title, maker and variables."""

from __future__ import annotations

import textwrap
from pathlib import Path

from tcstudy.data.reading import Unreadable, probe
from tcstudy.reports.terminal.tables import plain_table, wrapped

SHOWN = 200
"""Characters of an attribute that are shown."""
WIDEST = 48
"""Characters of a meaning."""
BENCHMARKS = "tests.benchmarks"


def other_text(path: Path) -> str:
    """What the file is; empty where it holds a study, whole or not, and where nothing can be read."""
    import netCDF4

    try:
        told = {name: str(value) for name, value in probe(path).items()}
        with netCDF4.Dataset(path) as nc:  # all of it was read by the probe
            if "study_yaml" in told or not nc.variables:
                return ""
            rows = [_row(name, variable) for name, variable in nc.variables.items()]
    except (Unreadable, OSError):
        return ""
    maker = told.pop("source", "")
    benchmark = "data of a benchmark" if BENCHMARKS in maker else "a data file that tcstudy did not write as results"
    lines = [told.pop("title", path.name), "", f"  {benchmark}; no results of a study, so there is no summary of it"]
    lines += [f"  made by {maker}"] * bool(maker)
    lines += [f"  {name}: {value[:SHOWN]}{'…' * (len(value) > SHOWN)}" for name, value in told.items()]
    return wrapped(
        "\n".join([*lines, "", plain_table(("variable", "dimensions", "unit", "meaning"), rows, (0, 1, 3, 2))])
    )


def _row(name: str, variable: object) -> tuple[str, str, str, str]:
    sizes = zip(variable.dimensions, variable.shape, strict=True)  # type: ignore[attr-defined]
    told = [str(getattr(variable, key, "")) for key in ("units", "long_name")]
    return (
        name,
        ", ".join(f"{dim} {size}" for dim, size in sizes),
        told[0],
        textwrap.shorten(told[1], WIDEST, placeholder=" …"),
    )
