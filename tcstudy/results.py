"""The public functions on result files, as `tcstudy` offers them: open, draw, report, export.

Every function takes the name of a file that run, converge, cost or path wrote. What the user can mend is a kind of
tcstudy.UserFault. Left out: making result files (`tcstudy.api`).
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path as FilePath
from typing import TYPE_CHECKING, Any

from tcstudy.errors import UsageError

if TYPE_CHECKING:
    import xarray


def open_results(path: str | FilePath) -> xarray.DataTree:
    """Open a file of run, converge, cost or path lazily: a run has its results at the root and a group a level.

    Close it after use or open it in a `with`. Raises StoreError if there is none or its run has not finished.
    """
    from tcstudy.data.store import open_results as open_tree

    return open_tree(FilePath(path))


def draw(
    file: str | FilePath,
    target: str | FilePath,
    *,
    at: Mapping[str, Any] | None = None,
    level: int | None = None,
    x: str | None = None,
    y: str | None = None,
    by: str | None = None,
    map: tuple[str, str] | None = None,
    of: str | None = None,
    law: bool = False,
    size: str | tuple[float, float] | None = None,
) -> FilePath:
    """Draw a result file of any kind into a .png, .svg or .pdf file; returns its name. Needs matplotlib.

    at:       of a run or its convergence: the point by its labels, {"alpha": 100}; the first unless named
    level:    of a run: mesh level, −1 or nothing for the finest
    y:        of a path "mean-slip", "max-slip" or "friction"; of a cost chart the error, e.g. "u_L2"
    size:     "8x10cm" or (width, height) [inch]

    Of a run, in place of a point:
    x, y, by:  curves of the number y ("slip_length") over the parameter x, one for each value of the parameter `by`
    map, of:   a map of the number `of` over two parameters, map=("alpha", "theta_bar")
    law:       the friction law of a point with all its nodes on it

    Parameters that are not drawn have the value that `at` gives them, the first unless named. Raises StoreError,
    DrawError, UsageError.
    """
    from tcstudy.reports.figures.draw import Wanted, picture

    wanted = Wanted(at, level, x, y, by, map, of, law, size)
    picture(FilePath(file), FilePath(target), wanted)
    return FilePath(target)


def report(file: str | FilePath, target: str | FilePath | None = None) -> FilePath:
    """Make one HTML page of a result file of any kind (FILE.html unless named); returns its name.

    Raises StoreError, PageError.
    """
    from tcstudy.reports.page.write import write_page

    page = FilePath(target) if target is not None else FilePath(file).with_suffix(".html")
    return write_page(FilePath(file), page).path


def export(
    file: str | FilePath,
    form: str,
    target: str | FilePath | None = None,
    *,
    at: Mapping[str, Any] | None = None,
    level: int | None = None,
) -> FilePath:
    """Write a result file for other programs; returns the PVD or the table.

    form:   "vtu" (fields of a run, for ParaView), "csv" or "json" (a row a point and level)
    target: the folder of the fields, or the table; beside the file unless named
    at:     only points with these labels, {"alpha": 100};  level: of the fields, the finest unless named

    Raises StoreError, DrawError (no such point), UsageError.
    """
    from tcstudy.commands.results import FORMS, exported

    if form not in FORMS:
        raise UsageError(f"there is no form {form!r}; choose of {', '.join(FORMS)}")
    return exported(FilePath(file), form, None if target is None else FilePath(target), at, level)[0]
