"""Results, as `tcstudy` offers them: a file as a record that a notebook shows; open, draw, report,
export.

Every function takes a Result or the name of a file that run, converge or cost wrote. What the user
can mend is a kind of tcstudy.UserFault. Left out: making result files (`tcstudy.api`).
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
    nearest,
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
"""Bytes of the results that a notebook keeps without a name; beyond it the oldest go."""


class Result:
    """What `run`, `converge` or `cost` found: a result file, and its data at the first look.

        result["slip_length"].sel(alpha=100)     # a variable is an xarray.DataArray
        result["level_1"]["u_T"]                 # a group is an xarray.DataTree, as result.tree is
        result.summary, result.to_dataframe(), result.draw(), result.save("results/mine.nc")

    file:   the netCDF file;  note: what was computed now, and why; empty if the file held everything
    warned: whether the warnings that the file keeps were given already
    """

    def __init__(self, file: FilePath, note: str = "", *, warned: bool = False) -> None:
        self.file = file
        self.note = note
        self.warned = warned
        self._items: dict[str, Any] = {}

    @cached_property
    def tree(self) -> xarray.DataTree:
        """All data, loaded into memory: a run has its results at the root and a group a level."""
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
        """A variable or a group, which alone is loaded into memory."""
        if name in self._items:
            return self._items[name]
        with _open_tree(self.file) as tree:
            try:
                item = tree[name].load()
            except KeyError:
                names = [str(name) for name in (*tree.variables, *tree.children)]
                near = nearest(str(name), names)
                meant = f"; did you mean {near!r}?" if near else f"; it has {', '.join(names)}"
                raise KeyError(f"the result has no {name!r}{meant}") from None
        self._items[name] = item
        return item

    def __contains__(self, name: str) -> bool:
        return name in self.tree

    def __getattr__(self, name: str) -> Any:
        if name.startswith("_"):  # what libraries ask of anything, for which no file is read
            raise AttributeError(name)
        return getattr(self.tree, name)

    @property
    def summary(self) -> str:
        """The labelled lines that the terminal and the page begin with: answer, trust, accuracy,
        and how much is solved."""
        from tcstudy.data.files import reading
        from tcstudy.reports.terminal.summary import verdict_of
        from tcstudy.reports.text import labelled

        with reading(self.file):
            return labelled(verdict_of(self.file).lines)

    def to_dataframe(self) -> pandas.DataFrame:
        """A row a point and level (of a path a vertex, of a fit a datum), as `export` writes it to
        CSV; SI units."""
        from tcstudy.data.files import kind_from
        from tcstudy.reports.export import ROWS

        data = self.tree.to_dataset()
        dims = data["status"].dims if "status" in data else (ROWS[kind_from(data.attrs)],)
        names = [
            name for name, one in data.data_vars.items() if one.dims and set(one.dims) <= set(dims)
        ]
        return data[names].to_dataframe(dim_order=list(dims)).reset_index()

    @python_door
    def save(self, target: str | FilePath, force: bool = False) -> Result:
        """Copy the file under a name of your choice. Raises StoreError where there is another,
        unless force."""
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
                raise StoreError(
                    f"{target} is there already; give another name, or force=True to replace it"
                )
            replace_file(target, copy, sealed=False, seen=None if force else lock.seen)
        return Result(target, self.note, warned=self.warned)

    def draw(self, target: str | FilePath | None = None, **wanted: Any) -> FilePath | Figure:
        """`tcstudy.draw` of this file."""
        return draw(self, target, **wanted)

    def report(self, target: str | FilePath | None = None) -> FilePath:
        """`tcstudy.report` of this file."""
        return report(self, target)

    def __repr__(self) -> str:
        return f"{self.summary}\n{self.file}" + (f" ({self.note})" if self.note else "")

    def _repr_html_(self) -> str:
        """The answer, a picture, and the tables of the terminal behind a click."""
        from tcstudy.reports.terminal.summary import text_of

        picture = picture_html(self)
        first = html.escape(self.summary)
        below = html.escape(f"{self.file}" + (f" ({self.note})" if self.note else ""))
        tables = html.escape(text_of(self.file))
        details = f"<details><summary>{below}</summary><pre>{tables}</pre></details>"
        return f"<pre><b>{first}</b></pre>{picture}{details}"


def picture_html(of: Result | Study) -> str:
    """Its usual picture within a page; nothing where there is none to draw."""
    try:
        figure: Any = draw(of)
    except (DrawError, GeometryFailed):
        return ""
    png = base64.b64encode(figure._repr_png_()).decode()
    return f'<img style="max-width: 100%" src="data:image/png;base64,{png}">'


def cached(kind: Kind, study: Study, **asked: object) -> FilePath:
    """The file in which results without a name are kept: $TCSTUDY_CACHE, or tcstudy in the user's
    cache folder.

    Its name has all that decides them: study, options, and versions of the program and its
    libraries. A file of that name that does not hold them, for example a damaged one, is removed.
    """
    from tcstudy.data.files import program, study_sha256

    key = sha256(
        repr((kind, study_sha256(study), sorted(asked.items()), program())).encode()
    ).hexdigest()
    stem = study.source.stem if study.source is not None else "study"
    name = f"{stem}-{kind}-{key[:16]}.nc"
    target = cache_folder() / name
    try:
        _remove_damaged(target, kind, study, asked)
    except (OSError, StoreError) as error:
        tell([_KEPT_NOWHERE.format(reason=getattr(error, "strerror", None) or error)])
        target = FilePath(_temporary_folder().name) / name
    return target


def _remove_damaged(
    target: FilePath, kind: Kind, study: Study, asked: Mapping[str, object]
) -> None:
    """Remove a file of the cache that does not hold what its name says. Raises OSError."""
    from tcstudy.data.files import holds

    def is_damaged() -> bool:
        try:
            return target.exists() and not holds(target, kind, study, **asked)
        except StoreError:
            return True

    if is_damaged():
        from tcstudy.data.records import Journal

        with Journal.open(target, wait=True):
            if is_damaged():
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
    """Why a file in the cache is computed: what differs from the study whose results came last
    under its name."""
    from tcstudy.data.files import attributes
    from tcstudy.read.document import changes

    pattern = f"{glob.escape(target.name.removesuffix('.nc')[:-16])}{'?' * 16}.nc"
    earlier = [file for file in _own_files(target.parent, pattern) if file != target]
    for file in earlier:
        with suppress(StoreError, OSError, LookupError):
            last = attributes(file)
            overrides = str(last["overrides"]).splitlines()
            different = changes(str(last["study_yaml"]), overrides, study)
            return f"computed now: {', '.join(different) or 'the program or an option is another'}"
    return "computed now"


def prune(folder: FilePath) -> None:
    """Remove the oldest results of the cache, down to MOST_CACHED bytes; files of others stay."""
    total = 0
    for number, file in enumerate(_own_files(folder, "*")):
        with suppress(OSError):  # another process may have removed it
            total += file.stat().st_size
            if total > MOST_CACHED and number > 0:
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


def _file(of: Result | str | FilePath) -> FilePath:
    return of.file if isinstance(of, Result) else FilePath(of)


@python_door
def open_results(path: str | FilePath) -> Result:
    """Return what `run` returns of a result file of any kind; its data are read when they are asked
    for.

    Raises StoreError if there is none or its run has not finished.
    """
    with _open_tree(FilePath(path)):
        return Result(FilePath(path))


def _open_tree(path: FilePath) -> xarray.DataTree:
    """Open the data lazily; kept open beside other readers of the file, netCDF would crash."""
    from tcstudy.data.reading import open_results as open_tree

    return open_tree(path)


def _warn_of(of: Result | str | FilePath) -> None:
    """Warn of what a file keeps, of a result once: `run` has done it for what it returns."""
    if isinstance(of, Result):
        if of.warned:
            return
        of.warned = True
    from tcstudy.data.files import tell_stored

    tell_stored(_file(of))


@python_door
def open_geometry(
    file: Result | str | FilePath, /, level: int = -1, **labels: Any
) -> xarray.Dataset:
    """Return one mesh level of one geometry of a run's file, or of the one body that it has.

        body = tcstudy.open_geometry("results/plate.nc", radius="5 mm")
        body["u_T"], body["triangle"]            # at its own points and nodes, numbered from 0

    level: −1 is the finest;  labels: of swept parameters, which points of one geometry have
    The data have all points of the geometry, their labels as coordinates, and as attributes those
    of the file, with the options that make its study. Nothing stays open.
    Raises StoreError, DrawError where no point has these labels, UsageError where points of several
    geometries do.
    """
    from tcstudy.reports.select_point import load_geometry

    _warn_of(file)
    return load_geometry(_file(file), labels, level)


@python_door
def draw(
    file: Result | Study | str | FilePath, target: str | FilePath | None = None, **wanted: Any
) -> FilePath | Figure:
    """Draw a result file of any kind, or the scene of a study before any work, into a .png, .svg or
    .pdf file and return its name, or without a name return the figure, which a notebook shows.
    Needs matplotlib.

    at:       of a run or its convergence: the point by its labels, {"alpha": 100}; of a run that of
              the largest slip unless named, else the first
    level:    of a run: mesh level, −1 or nothing for the finest
    y:        of a path "mean-slip", "max-slip" or "friction"; of a cost chart the error, e.g. "u_L2"
    size:     "8x10cm" or (width, height) [inch]
    ax, panel: draw one panel into axes of a figure of your own, the first or that of the name; returns that figure.
              `ax.legend()` says what its lines are

    of:       of the body of a point, in place of θ: u_x, u_y, sigma_x, sigma_y, tau_xy, von_mises, sigma_1 or sigma_2
    deform:   how many times as large as they are its displacements are drawn; a round number that suits unless given
    along:    a line, ((0, 0.005), (0.2, 0.005)) or "0 mm, 5 mm: 200 mm, 5 mm": profiles of displacement, temperature
              and stresses along it, or of the field `of`, in place of the body

    Of a run, in place of a point:
    x, y, by:  curves of the number y ("slip_length") over the parameter x, one for each value of the parameter `by`
    map, of:   a map of the number `of` over two parameters, map=("alpha", "theta_bar")
    law:       the friction law of a point with all its nodes on it

    Parameters that are not drawn have the value that `at` gives them, the first unless named.
    Raises StoreError, DrawError, UsageError.
    """
    from tcstudy.pictures import draw_picture, is_study_file

    if wanted.get("ax") is not None and target is not None:
        raise UsageError("ax: your own figure saves itself; leave the file name out")
    subject = _file(file) if isinstance(file, Result | str | FilePath) else file
    figure: Figure = draw_picture(subject, None if target is None else FilePath(target), **wanted)
    if isinstance(file, Result | str | FilePath) and not is_study_file(_file(file)):
        _warn_of(file)
    return figure if target is None else FilePath(target)


@python_door
def report(file: Result | str | FilePath, target: str | FilePath | None = None) -> FilePath:
    """Make one HTML page of a result file of any kind (FILE.html unless named); returns its name.

    Raises StoreError, PageError.
    """
    from tcstudy.reports.page.write import write_page

    page = FilePath(target) if target is not None else _file(file).with_suffix(".html")
    written = write_page(_file(file), page)
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
    """Write a result file for other programs; returns the PVD or the table.

    form:   "vtu" (fields of a run, for ParaView), "csv" or "json" (a row a point and level)
    target: the folder of the fields, or the table; beside the file unless named
    at:     only points with these labels, {"alpha": 100};  level: of the fields, the finest unless named

    Raises StoreError, DrawError (no such point), UsageError.
    """
    from tcstudy.reports.export import FORMS, write_form

    if form not in FORMS:
        raise UsageError(f"there is no form {form!r}; choose of {', '.join(FORMS)}")
    _warn_of(file)
    name = None if target is None else FilePath(target)
    path, _ = write_form(_file(file), form, name, at, level)
    return path
