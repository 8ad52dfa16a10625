"""What the commands do: read a study or a file, call what works, print what it says, and return the exit code.

Everything heavy is imported when a command needs it, so that help and errors come at once.
"""

from __future__ import annotations

import argparse
import shlex
import sys
from pathlib import Path
from typing import TYPE_CHECKING, NoReturn

if TYPE_CHECKING:
    from tcstudy.data.identity import Kind
    from tcstudy.scene.study import Study

OK, SOME_FAILED, BAD_INPUT = 0, 1, 2
MEAN_SLIP = "mean-slip"
DRAWN_BY = {"run": ("at", "level"), "path": ("response",), "convergence": ("at",), "cost": ("error",)}
"""Options of `draw` that a picture of each kind of file depends on."""


def run(options: argparse.Namespace) -> int:
    study, output = _checked(options)
    if _is_there(options, "run", study, output):
        points, failed = _stored(output)
        return _say_run(options, output, points, failed, "found before")
    from tcstudy.data.store import sweep_points
    from tcstudy.fem.geometry import GeometryFailed
    from tcstudy.report.progress import progress
    from tcstudy.report.select_point import naming
    from tcstudy.study.execute import StoreError, execute

    watcher = progress(naming=naming(sweep_points(study)), length=_length(study))
    try:
        result = execute(study, output, watcher, options.words)
    except (StoreError, GeometryFailed) as error:
        watcher.close()
        fail(_said(options, study, error))
    finally:
        watcher.close()
    return _say_run(options, result.output, result.points, result.failed, "found")


def _say_run(options: argparse.Namespace, output: Path, points: int, failed: int, found: str) -> int:
    """The summary of a run, where its data are and what could be asked next."""
    from tcstudy.report.summary import summary

    print(summary(output))
    print(f"\n  {points - failed} of {points} solutions {found}; data in {output}")
    again = shlex.join(["tcstudy", "cost", str(options.study), *(f"--set={text}" for text in options.overrides)])
    print(f"  what accuracy costs here: {again} --plot cost.png")
    return SOME_FAILED if failed else OK


def plan(options: argparse.Namespace) -> int:
    study, output = _checked(options)
    from tcstudy.fem.geometry import GeometryFailed
    from tcstudy.report.forecast import forecast_text
    from tcstudy.study.plan import plan as forecast_of

    try:
        forecast = forecast_of(study)
    except GeometryFailed as error:
        fail(_said(options, study, error))
    axes = [(axis.name, axis.labels, axis.units) for axis in study.axes]
    print(
        forecast_text(
            study.title,
            axes,
            forecast.points,
            forecast.factorisations,
            forecast.heat_solves,
            forecast.levels,
            study.mesh.levels,
            forecast.left_out,
            forecast.notes,
            str(output),
            forecast.bytes,
            study.mesh.open_ended,
            _length(study),
        )
    )
    return OK


def path(options: argparse.Namespace) -> int:
    from tcstudy.study.plan import path_output

    study, output = _checked(options, path_output, swept=False)
    if study.path is None:
        remedy = "add path: {parameter: theta_bar, from: 0 K, to: 40 K}"
        fail(f"{options.study}: path: the study has no section path; {remedy}")
    from tcstudy.data.files import StoreError
    from tcstudy.data.path_store import stored_shortfalls
    from tcstudy.fem.geometry import GeometryFailed
    from tcstudy.report.path_figure import draw_path
    from tcstudy.report.path_summary import path_summary
    from tcstudy.report.progress import PathProgress
    from tcstudy.report.style import DrawError, check_target
    from tcstudy.study.path_affine import PathError
    from tcstudy.study.path_execute import execute_path

    there = _is_there(options, "path", study, output)
    progress = PathProgress()
    try:
        if options.plot is not None:
            check_target(options.plot)
        if study.axes:
            names = ", ".join(axis.name for axis in study.axes)
            note = f"note: a path is of one scene, that outside the sweep; the values of {names} are not used"
            print(note, file=sys.stderr)
        problems = stored_shortfalls(output) if there else execute_path(study, output, progress, options.words)
        progress.close()
        print(path_summary(output))
        if options.plot is not None:
            print(f"\n  {draw_path(output, options.plot, options.response or MEAN_SLIP)}")
    except (PathError, StoreError, GeometryFailed, DrawError) as error:
        progress.close()
        fail(_said(options, study, error))
    print("".join(f"\n  {problem}" for problem in problems) + f"\n  data in {output}")
    return SOME_FAILED if problems else OK


def show(options: argparse.Namespace) -> int:
    from tcstudy.data.files import StoreError
    from tcstudy.data.identity import kind_of
    from tcstudy.data.reading import reading
    from tcstudy.report.convergence import convergence_report
    from tcstudy.report.cost import cost_report
    from tcstudy.report.path_summary import path_summary
    from tcstudy.report.style import DrawError
    from tcstudy.report.summary import summary

    reports = {"run": summary, "path": path_summary, "convergence": convergence_report, "cost": cost_report}
    try:
        with reading(options.file):
            text = reports[kind_of(options.file)](options.file).rstrip("\n")
        print(text)
    except (StoreError, DrawError) as error:
        fail(str(error))
    return OK


def converge(options: argparse.Namespace) -> int:
    from tcstudy.report.style import DrawError, check_target

    point = _point_of(options)
    if point and options.plot is None:
        fail("--at: names the point of the picture, but there is none; add --plot PICTURE")
    from tcstudy.data.convergence import default_path
    from tcstudy.study.plan import output_of

    study, path = _checked(options, lambda study: default_path(output_of(study)))
    from tcstudy.data.files import StoreError
    from tcstudy.data.store import sweep_points
    from tcstudy.fem.geometry import GeometryFailed
    from tcstudy.report.convergence import convergence_report
    from tcstudy.report.convergence_plot import plot_convergence
    from tcstudy.report.select_point import locate
    from tcstudy.study.convergence import ConvergenceError, converge_to_file, without_errors

    say = lambda text: print(text, file=sys.stderr, flush=True)  # noqa: E731
    try:
        if options.plot is not None:
            check_target(options.plot)
            locate(sweep_points(study), point, "study")
            if lack := without_errors(study):
                fail(f"--plot: there would be no errors to draw: {lack}")
        there = _is_there(options, "convergence", study, path)
        failed = _stored(path)[1] if there else converge_to_file(study, path, say, options.words)
        print(convergence_report(path, options.format), end="")
        if options.plot is not None:
            print(plot_convergence(path, options.plot, point), file=sys.stderr)
    except (StoreError, GeometryFailed, ConvergenceError, DrawError) as error:
        fail(_said(options, study, error))
    print(f"data in {path}", file=sys.stderr)
    return SOME_FAILED if failed else OK


def cost(options: argparse.Namespace) -> int:
    from tcstudy.data.cost import MEASURES
    from tcstudy.report.style import DrawError, check_target

    names = [measure.name for measure in MEASURES]
    if options.error is not None and options.error not in names:
        fail(f"--error: there is no error {options.error!r}; choose one of {', '.join(names)}")
    if options.runs < 1:
        fail(f"--runs: {options.runs} runs measure nothing; give 1 or more")
    point = _point_of(options)
    from tcstudy.data.cost import default_path
    from tcstudy.study.plan import output_of

    study, path = _checked(options, lambda study: default_path(output_of(study)))
    from tcstudy.data.files import StoreError
    from tcstudy.data.store import sweep_points
    from tcstudy.fem.geometry import GeometryFailed
    from tcstudy.report.cost import cost_report
    from tcstudy.report.cost_plot import plot_cost
    from tcstudy.report.progress import CostProgress
    from tcstudy.report.select_point import describe, locate
    from tcstudy.study.cost import CostError, cost_to_file, unmeasured

    progress = CostProgress()
    try:
        if options.plot is not None:
            check_target(options.plot)
        points = sweep_points(study)
        where = locate(points, point, "study")
        words = describe(points, where)
        if options.error is not None and (lack := unmeasured(study, options.error)):
            fail(f"--error: {options.error} {lack}")
        if _is_there(options, "cost", study, path, point=words, runs=options.runs):
            failed = _stored(path)[1]
        else:
            failed = cost_to_file(study, tuple(where.values()), words, options.runs, path, progress, options.words)
        progress.close()
        print(cost_report(path, options.format, options.error), end="")
        if options.plot is not None:
            print(plot_cost(path, options.plot, options.error), file=sys.stderr)
    except (StoreError, GeometryFailed, CostError, DrawError) as error:
        progress.close()
        fail(_said(options, study, error))
    finally:
        progress.close()
    print(f"data in {path}", file=sys.stderr)
    return SOME_FAILED if failed else OK


def draw(options: argparse.Namespace) -> int:
    from tcstudy.data.files import StoreError
    from tcstudy.data.identity import kind_of
    from tcstudy.data.reading import reading
    from tcstudy.report.convergence_plot import plot_convergence
    from tcstudy.report.cost_plot import plot_cost
    from tcstudy.report.draw import DrawError
    from tcstudy.report.draw import draw as draw_point
    from tcstudy.report.path_figure import draw_path

    point = _point_of(options)
    try:
        kind = kind_of(options.file)
        if point and kind in ("path", "cost"):
            fail(f"--at: the file of tcstudy {kind} has one scene and no sweep points; leave it out")
        for name in ("level", "response", "error"):
            if getattr(options, name) is not None and name not in DRAWN_BY[kind]:
                fail(f"--{name}: the picture of a {kind} file does not depend on it; leave it out")
        with reading(options.file):
            if kind == "path":
                text = draw_path(options.file, options.picture, options.response or MEAN_SLIP)
            elif kind == "cost":
                text = plot_cost(options.file, options.picture, options.error)
            elif kind == "convergence":
                text = plot_convergence(options.file, options.picture, point)
            else:
                text = draw_point(options.file, options.picture, point, -1 if options.level is None else options.level)
        print(text)
    except (StoreError, DrawError) as error:
        fail(str(error))
    return OK


def report(options: argparse.Namespace) -> int:
    from tcstudy.data.files import StoreError
    from tcstudy.report.page import LEAVE_OUT, PageError, write_page

    unknown = [part for part in options.without if part not in LEAVE_OUT]
    if unknown:
        fail(f"--without: there is no part {unknown[0]!r}; choose of {', '.join(LEAVE_OUT)}")
    target = options.output or options.file.with_suffix(".html")
    try:
        print(write_page(options.file, target, tuple(options.without)).words)
    except (StoreError, PageError) as error:
        fail(str(error))
    return OK


def _point_of(options: argparse.Namespace) -> dict[str, str]:
    """The sweep point that --at names; exits with 2 if it cannot be read."""
    words = [text.partition("=") for text in options.at]
    if not all(mark for _, mark, _ in words):
        fail("--at: write NAME=VALUE, for example --at alpha=100")
    names = [name for name, _, _ in words]
    if twice := [name for name in names if names.count(name) > 1]:
        fail(f"--at: {twice[0]} is given twice; keep one, as a picture or a chart is of one point")
    return {name: value for name, _, value in words}


def _checked(options: argparse.Namespace, default=None, swept: bool = True):  # type: ignore[no-untyped-def]  # Study, imported lazily
    """The study and its output (`default` of the study if none is given), both found usable; else exits with 2.

    swept: whether the command uses the sweep
    """
    from tcstudy.errors import StudyError
    from tcstudy.read.study import read_study
    from tcstudy.study.plan import faults, output_of

    try:
        study = read_study(options.study, options.overrides, swept=swept)
    except StudyError as error:
        fail(str(error))
    output = options.output or (default or output_of)(study)
    problems = faults(study, output)
    if problems:
        fail("\n".join(problems))
    return study, output


def _said(options: argparse.Namespace, study, error: Exception) -> str:  # type: ignore[no-untyped-def]  # Study, lazily
    """What stopped a command, with its place in the study where it has one."""
    from tcstudy.fem.geometry import GeometryFailed
    from tcstudy.study.plan import geometry_fault

    return geometry_fault(study, error) if isinstance(error, GeometryFailed) else f"{options.study}: {error}"


def _is_there(options: argparse.Namespace, kind: Kind, study: Study, output: Path, **asked: object) -> bool:
    """Whether the output holds what the command would compute, which is then said; else exits with 2 if it holds
    something else. With --force neither is asked."""
    if options.force:
        return False
    from tcstudy.data.identity import holds, identity
    from tcstudy.errors import StoreError

    try:
        there = holds(output, identity(kind, study, **asked))
    except StoreError as error:
        fail(f"{options.study}: {error}")
    if there:
        print(f"{output} holds these results already; --force computes them again", file=sys.stderr)
    return there


def _stored(output: Path) -> tuple[int, int]:
    """How many solutions a file has, and how many of them failed."""
    import netCDF4

    from tcstudy.data.records import PointStatus

    with netCDF4.Dataset(output) as nc:
        status = nc["status"][...]
        charted = nc["status"].dimensions == ("family", "solver", "level")
    asked = status[status != PointStatus.NOT_RUN] if charted else status  # a chart has no mesh everywhere
    return int(asked.size), int((asked != PointStatus.OK).sum())


def _length(study) -> str:  # type: ignore[no-untyped-def]  # Study, imported lazily
    """The unit of lengths."""
    return "1" if study.units == "none" else "m"


def fail(text: str) -> NoReturn:
    print(text, file=sys.stderr)
    raise SystemExit(BAD_INPUT)
