"""Results, as `tcstudy` offers them: a file as a record for notebooks, and what to do with it.

Every function takes a Result or the name of a file that run, converge or cost wrote: open, draw,
report, export. Faults of the user are raised as a kind of tcstudy.UserFault. Left out: making
result files (`tcstudy.api`).
"""

from __future__ import annotations

import base64
import glob
import html
import os
import re
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import suppress
from functools import cache, cached_property
from hashlib import sha256
from pathlib import Path as FilePath
from typing import TYPE_CHECKING, Any

from tcstudy.errors import (
    DrawError,
    GeometryFailed,
    StoreError,
    UsageError,
    hint,
    python_door,
    tell,
)

if TYPE_CHECKING:
    import pandas
    import xarray
    from matplotlib.figure import Figure

    from tcstudy.data.files import Kind
    from tcstudy.scene.study import Study

MOST_CACHED = 2**31
"""Bytes of results without a name that are kept; beyond it the oldest are removed."""


class Result:
    """The results of `run`, `converge` or `cost`: a file, and its data once they are asked for.

        result["slip_length"].sel(alpha=100)     # a variable is an xarray.DataArray
        result["level_1"]["u_T"]                 # a group is an xarray.DataTree, as result.tree is
        result.summary, result.to_dataframe(), result.draw(), result.save("results/mine.nc")

    file:   the netCDF file
    note:   what was computed now, and why; empty if the file held everything
    warned: whether the warnings of the file were issued already
    """

    def __init__(self, file: FilePath, note: str = "", *, warned: bool = False) -> None:
        self.file = file
        self.note = note
        self.warned = warned
        self._items: dict[str, Any] = {}

    @cached_property
    def tree(self) -> xarray.DataTree:
        """All data, in memory: of a run the results at the root, and a group per level."""
        with _open_tree(self.file) as tree:
            return tree.load()

    def __enter__(self) -> Result:
        return self

    def __exit__(self, *_: object) -> None:
        """No file stays open."""

    def __iter__(self) -> Iterator[str]:
        return iter(self.tree)

    def __len__(self) -> int:
        return len(self.tree)

    def __getitem__(self, name: str) -> Any:
        """Return a variable or a group, which alone is loaded into memory.

        Raises KeyError where there is none.
        """
        if name not in self._items:
            with _open_tree(self.file) as tree:
                try:
                    self._items[name] = tree[name].load()
                except KeyError:
                    names = [str(key) for key in (*tree.variables, *tree.children)]
                    remedy = hint(str(name), names, f"it has {', '.join(names)}")
                    raise KeyError(f"the result has no {name!r}; {remedy}") from None
        return self._items[name]

    def __contains__(self, name: str) -> bool:
        return name in self.tree

    def __getattr__(self, name: str) -> Any:
        if name.startswith("_"):  # libraries ask any object for such names: no file is read
            raise AttributeError(name)
        return getattr(self.tree, name)

    @property
    def summary(self) -> str:
        """The labelled lines of terminal and page: answer, trust, accuracy, how much is solved."""
        from tcstudy.data.files import reading
        from tcstudy.reports.terminal.summary import verdict_of
        from tcstudy.reports.text import labelled

        with reading(self.file):
            return labelled(verdict_of(self.file).lines)

    def to_dataframe(self) -> pandas.DataFrame:
        """Return one row per point and level, as `export` writes it to CSV, in SI units.

        Of a path there is one row per vertex, of a fit one per datum.
        """
        from tcstudy.data.files import kind_from
        from tcstudy.reports.export import ROWS

        data = self.tree.to_dataset()
        if "status" in data:
            row_dims = list(data["status"].dims)
        else:
            row_dims = [ROWS[kind_from(data.attrs)]]
        names = list[Any]()
        for name, variable in data.data_vars.items():
            if variable.dims and set(variable.dims) <= set(row_dims):
                names.append(name)
        return data[names].to_dataframe(dim_order=row_dims).reset_index()

    @python_door
    def save(self, target: str | FilePath, force: bool = False) -> Result:
        """Copy the file under a name of your choice, and return the result of that name.

        Raises StoreError where another file has the name, unless `force`.
        """
        import shutil

        from tcstudy.data.files import check_writable, replace_file
        from tcstudy.data.records import Journal

        target = FilePath(target)
        if faults := check_writable(target):
            raise StoreError("; ".join(faults))

        def copy(aside: FilePath) -> None:
            shutil.copyfile(self.file, aside)

        with Journal.open(target) as lock:
            is_other = target.exists() and target.read_bytes() != self.file.read_bytes()
            if is_other and not force:
                remedy = "give another name, or force=True to replace it"
                raise StoreError(f"{target} is there already; {remedy}")
            replace_file(target, copy, sealed=False, seen=None if force else lock.seen)
        return Result(target, self.note, warned=self.warned)

    def draw(self, target: str | FilePath | None = None, **options: Any) -> FilePath | Figure:
        """Draw this file as `tcstudy.draw` does."""
        return draw(self, target, **options)

    def report(self, target: str | FilePath | None = None) -> FilePath:
        """Make the page of this file as `tcstudy.report` does."""
        return report(self, target)

    def __repr__(self) -> str:
        return f"{self.summary}\n{self._place}"

    @property
    def _place(self) -> str:
        return f"{self.file} ({self.note})" if self.note else str(self.file)

    def _repr_html_(self) -> str:
        """Return the answer, a picture, and the tables of the terminal behind a click."""
        from tcstudy.reports.terminal.summary import text_of

        answer = html.escape(self.summary)
        place = html.escape(self._place)
        tables = html.escape(text_of(self.file))
        details = f"<details><summary>{place}</summary><pre>{tables}</pre></details>"
        return f"<pre><b>{answer}</b></pre>{picture_html(self)}{details}"


def picture_html(subject: Result | Study) -> str:
    """Return the usual picture of results or of a study within a page; empty if it has none."""
    try:
        figure: Any = draw(subject)
    except (DrawError, GeometryFailed):
        return ""
    png = base64.b64encode(figure._repr_png_()).decode()
    return f'<img style="max-width: 100%" src="data:image/png;base64,{png}">'


def cached(kind: Kind, study: Study, **attributes: object) -> FilePath:
    """Return the file that keeps results without a name.

    It is in $TCSTUDY_CACHE, or in tcstudy in the user's cache folder. Its name has all that decides
    the results: study, options, and versions of the program and its libraries. A file of that name
    with other contents, for example a damaged one, is removed.
    attributes: those of the file that decide its results beside the study
    """
    from tcstudy.data.files import program, study_sha256

    decisive = (kind, study_sha256(study), sorted(attributes.items()), program())
    key = sha256(repr(decisive).encode()).hexdigest()
    stem = study.source.stem if study.source is not None else "study"
    name = f"{stem}-{kind}-{key[:16]}.nc"
    target = cache_folder() / name
    try:
        _remove_damaged(target, kind, study, attributes)
    except (OSError, StoreError) as error:
        tell([_KEPT_NOWHERE.format(reason=getattr(error, "strerror", None) or error)])
        target = FilePath(_temporary_folder().name) / name
    return target


def _remove_damaged(
    target: FilePath, kind: Kind, study: Study, attributes: Mapping[str, object]
) -> None:
    """Remove a file of the cache whose contents do not fit its name. Raises OSError."""
    from tcstudy.data.files import holds

    def is_damaged() -> bool:
        try:
            return target.exists() and not holds(target, kind, study, **attributes)
        except StoreError:
            return True

    if not is_damaged():
        return
    from tcstudy.data.records import Journal

    with Journal.open(target, wait=True):
        if is_damaged():  # still, now that no other process writes it
            target.unlink(missing_ok=True)


_KEPT_NOWHERE = (
    "the result is kept until Python ends only: its cache folder cannot be written ({reason}); "
    "name a file, or set TCSTUDY_CACHE to a folder that can be written"
)


def cache_folder() -> FilePath:
    """Return the folder of results without a name, pruned.

    Where none can be written (a node without a home, a read-only one) it is a temporary one, which
    goes when Python ends; a StudyWarning says so.
    """
    try:
        folder = _usual_cache_folder()
        folder.mkdir(parents=True, exist_ok=True)
        tempfile.TemporaryFile(dir=folder).close()
    except (OSError, RuntimeError) as error:  # RuntimeError: the user has no home
        reason = getattr(error, "strerror", None) or str(error)
        tell([_KEPT_NOWHERE.format(reason=reason)])
        return FilePath(_temporary_folder().name)
    prune(folder)
    return folder


def _usual_cache_folder() -> FilePath:
    if chosen := os.environ.get("TCSTUDY_CACHE"):
        return FilePath(chosen)
    caches = os.environ.get("XDG_CACHE_HOME") or FilePath.home() / ".cache"
    return FilePath(caches) / "tcstudy"


@cache
def _temporary_folder() -> tempfile.TemporaryDirectory[str]:
    """Return the one temporary folder of this process, which is removed when Python ends."""
    try:
        return tempfile.TemporaryDirectory(prefix="tcstudy-")
    except OSError as error:
        remedy = "name a file, or set TCSTUDY_CACHE to a folder that can be written"
        raise StoreError(f"there is no folder to keep the result in: {error}; {remedy}") from error


def why_again(target: FilePath, study: Study) -> str:
    """Return why a file of the cache is computed: its changes since the last of the same study."""
    from tcstudy.data.files import attributes
    from tcstudy.read.document import changes

    pattern = f"{glob.escape(target.name.removesuffix('.nc')[:-16])}{'?' * 16}.nc"
    earlier = [file for file in _own_files(target.parent, pattern) if file != target]
    for file in earlier:
        with suppress(StoreError, OSError, LookupError):
            stored = attributes(file)
            overrides = str(stored["overrides"]).splitlines()
            different = changes(str(stored["study_yaml"]), overrides, study)
            return f"computed now: {', '.join(different) or 'the program or an option is another'}"
    return "computed now"


def prune(folder: FilePath) -> None:
    """Remove the oldest results of the cache, down to MOST_CACHED bytes; files of others stay."""
    total = 0
    for place, file in enumerate(_own_files(folder, "*")):
        with suppress(OSError):  # another process may have removed it
            total += file.stat().st_size
            if total > MOST_CACHED and place > 0:
                file.unlink(missing_ok=True)


_OWN_NAME = re.compile(
    r".+-(run|path|history|fit|convergence|cost)-[0-9a-f]{16}\.nc(\.partial\.old\d*)?"
)
"""Names of the files that `cached` makes, and of journals that a run has set aside beside them."""


def _own_files(folder: FilePath, pattern: str) -> list[FilePath]:
    """Return the files of the cache, the latest first."""
    times = dict[FilePath, float]()
    for file in folder.glob(pattern):
        with suppress(OSError):
            if _OWN_NAME.fullmatch(file.name) and file.is_file() and not file.is_symlink():
                times[file] = file.stat().st_mtime
    return sorted(times, key=lambda file: -times[file])


def _path_of(result: Result | str | FilePath) -> FilePath:
    return result.file if isinstance(result, Result) else FilePath(result)


@python_door
def open_results(path: str | FilePath) -> Result:
    """Return the result of a file of any kind, whose data are read when they are asked for.

    Raises StoreError if there is none or its run has not finished.
    """
    with _open_tree(FilePath(path)):
        return Result(FilePath(path))


def _open_tree(path: FilePath) -> xarray.DataTree:
    """Open the data lazily; kept open beside other readers of the file, netCDF would crash."""
    from tcstudy.data.reading import open_results as open_tree

    return open_tree(path)


def _warn_of(result: Result | str | FilePath) -> None:
    """Issue the warnings of a file, of a result once; `run` has issued those of its own."""
    if isinstance(result, Result):
        if result.warned:
            return
        result.warned = True
    from tcstudy.data.files import tell_stored

    tell_stored(_path_of(result))


@python_door
def open_geometry(
    file: Result | str | FilePath, /, level: int = -1, **labels: Any
) -> xarray.Dataset:
    """Return one mesh level of one geometry of a run's file.

        body = tcstudy.open_geometry("results/plate.nc", radius="5 mm")
        body["u_T"], body["triangle"]            # at its own points and nodes, numbered from 0

    level:  −1 is the finest
    labels: of swept parameters, which points of one geometry have

    The data have all points of the geometry, with their labels as coordinates. Attributes are those
    of the file, with the options that make its study. Nothing stays open.
    Raises StoreError, DrawError where no point has these labels, UsageError where points of several
    geometries do.
    """
    from tcstudy.reports.select_point import load_geometry

    _warn_of(file)
    return load_geometry(_path_of(file), labels, level)


@python_door
def draw(
    file: Result | Study | str | FilePath, target: str | FilePath | None = None, **options: Any
) -> FilePath | Figure:
    """Draw a result file of any kind, or the scene of a study before any work.

    target: a .png, .svg or .pdf file, whose name is returned; without one the figure is returned,
            which a notebook shows

    Of any file:
    at:     of a run or its convergence: the point by its labels, {"alpha": 100}; unless named, of a
            run that of the largest slip, else the first
    level:  of a run: mesh level, −1 or nothing for the finest
    y:      of a path "mean-slip", "max-slip" or "friction", where edges open "peel" or "opening";
            of a cost chart the error, e.g. "u_L2"
    size:   "8x10cm" or (width, height) [inch]
    ax:     draw one panel into axes of a figure of your own, and return that figure;
            `ax.legend()` names its lines
    panel:  the panel that `ax` gets, the first unless named

    Of the body of a point:
    of:     in place of θ: u_x, u_y, sigma_x, sigma_y, tau_xy, von_mises, sigma_1 or sigma_2
    deform: magnification of its displacements; a round number that suits unless given
    along:  a line, ((0, 0.005), (0.2, 0.005)) or "0 mm, 5 mm: 200 mm, 5 mm": profiles along it of
            displacement, temperature and stresses, or of the field `of`, in place of the body

    Of a run, in place of a point:
    x, y, by: curves of the variable y ("slip_length") over the parameter x, one for each value of
              the parameter `by`
    map, of:  a map of the variable `of` over two parameters, map=("alpha", "theta_bar")
    law:      the friction law of a point with all its nodes on it

    Parameters that are not drawn have the value that `at` gives them, the first unless named.
    Needs matplotlib. Raises StoreError, DrawError, UsageError.
    """
    from tcstudy.pictures import draw_picture, is_study_file

    if options.get("ax") is not None and target is not None:
        raise UsageError("ax: your own figure saves itself; leave the file name out")
    subject = _path_of(file) if isinstance(file, Result | str | FilePath) else file
    figure: Figure = draw_picture(subject, None if target is None else FilePath(target), **options)
    if isinstance(file, Result | str | FilePath) and not is_study_file(_path_of(file)):
        _warn_of(file)
    return figure if target is None else FilePath(target)


@python_door
def report(file: Result | str | FilePath, target: str | FilePath | None = None) -> FilePath:
    """Make one HTML page of a result file of any kind, and return its name.

    target: the page, FILE.html unless named

    Raises StoreError, PageError.
    """
    from tcstudy.reports.page.write import write_page

    page = FilePath(target) if target is not None else _path_of(file).with_suffix(".html")
    written = write_page(_path_of(file), page)
    _warn_of(file)
    return written.path


@python_door
def export(
    file: Result | str | FilePath,
    form: str,
    target: str | FilePath | None = None,
    *,
    at: Mapping[str, Any] | None = None,
    level: int | None = None,
) -> FilePath:
    """Write a result file for other programs, and return the PVD or the table.

    form:   "vtu" (fields of a run, for ParaView), "csv" or "json" (one row per point and level)
    target: the folder of the fields, or the table; beside the file unless named
    at:     only points with these labels, {"alpha": 100}
    level:  of the fields, the finest unless named

    Raises StoreError, DrawError (no such point), UsageError.
    """
    from tcstudy.reports.export import FORMS, write_form

    if form not in FORMS:
        raise UsageError(f"there is no form {form!r}; choose of {', '.join(FORMS)}")
    _warn_of(file)
    name = None if target is None else FilePath(target)
    path, _ = write_form(_path_of(file), form, name, at, level)
    return path
