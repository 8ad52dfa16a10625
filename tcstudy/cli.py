"""Command line: arguments and exit codes only.

Exit codes: 0 all points solved, 1 some points failed, 2 bad study or usage, 130 interrupted.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NoReturn

OK, SOME_FAILED, BAD_INPUT, INTERRUPTED = 0, 1, 2, 130

_EPILOG = """exit codes: 0 all points solved, 1 some points failed, 2 bad study or usage, 130 interrupted"""


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command line and return its exit code."""
    arguments = list(sys.argv[1:] if argv is None else argv)
    options = _parser().parse_args(arguments)
    command: Callable[[argparse.Namespace], int] = options.command
    options.words = ["tcstudy", *arguments]
    try:
        return command(options)
    except KeyboardInterrupt:
        print("interrupted; finished points are kept, the same command goes on from there", file=sys.stderr)
        return INTERRUPTED
    except BrokenPipeError:  # the reader of our output went away, as `head` does
        sys.stderr.close()
        return OK


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="tcstudy",
        description="Parametric studies of thermoelastic contact with nonmonotone, multivalued friction.",
        epilog=_EPILOG,
    )
    commands = parser.add_subparsers(title="commands", required=True, metavar="COMMAND")
    run = commands.add_parser("run", help="run a study and write its netCDF file", epilog=_EPILOG)
    _study_arguments(run)
    run.add_argument("--output", type=Path, metavar="FILE", help="result file (default: results/<study>.nc)")
    run.set_defaults(command=_run)
    plan = commands.add_parser("plan", help="check a study and say what a run would do", epilog=_EPILOG)
    _study_arguments(plan)
    plan.add_argument("--output", type=Path, metavar="FILE", help="result file that a run would write")
    plan.set_defaults(command=_plan)
    path = commands.add_parser("path", help="follow all solutions along one parameter", epilog=_EPILOG)
    _study_arguments(path)
    path.add_argument("--output", type=Path, metavar="FILE", help="result file (default: results/<study>-path.nc)")
    path.add_argument("--plot", type=Path, metavar="PICTURE", help="also draw it: a .png, .svg or .pdf file")
    _response_argument(path)
    path.set_defaults(command=_path)
    show = commands.add_parser("show", help="print the summary of a result file", epilog=_EPILOG)
    show.add_argument("file", type=Path, metavar="FILE.nc")
    show.set_defaults(command=_show)
    converge = commands.add_parser("converge", help="measure errors, rates and limits over the levels", epilog=_EPILOG)
    _study_arguments(converge)
    converge.add_argument(
        "--output", type=Path, metavar="FILE", help="convergence file (default: results/<study>.convergence.nc)"
    )
    converge.add_argument("--format", choices=("text", "markdown", "latex"), default="text", help="form of the tables")
    converge.add_argument("--plot", type=Path, metavar="PICTURE", help="draw the errors: a .png, .svg or .pdf file")
    converge.add_argument("--at", action="append", default=[], metavar="NAME=VALUE", help="point of the plot")
    converge.set_defaults(command=_converge)
    draw = commands.add_parser("draw", help="draw one point of a result file", epilog=_EPILOG)
    draw.add_argument("file", type=Path, metavar="FILE.nc")
    draw.add_argument("picture", type=Path, metavar="PICTURE", help="a .png, .svg or .pdf file")
    draw.add_argument("--at", action="append", default=[], metavar="NAME=VALUE", help="which point (may be repeated)")
    draw.add_argument("--level", type=int, default=-1, metavar="N", help="mesh level (default: the finest)")
    _response_argument(draw)
    draw.set_defaults(command=_draw)
    parser.add_argument("--version", action="version", version=f"tcstudy {_version()}")
    return parser


def _response_argument(parser: argparse.ArgumentParser) -> None:
    what = "what a path is drawn over: the mean or largest slip, or the friction resultant"
    parser.add_argument("--response", choices=("mean-slip", "max-slip", "friction"), default="mean-slip", help=what)


def _study_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("study", type=Path, metavar="STUDY.yaml")
    parser.add_argument(
        "--set",
        action="append",
        default=[],
        metavar="KEY=VALUE",
        dest="overrides",
        help="replace a value of the study, e.g. --set heat.alpha=50 (may be repeated)",
    )


def _version() -> str:
    from importlib import metadata

    return metadata.version("tcstudy")


def _run(options: argparse.Namespace) -> int:
    study, output = _checked(options)
    from tcstudy.fem.geometry import GeometryFailed
    from tcstudy.report.progress import progress
    from tcstudy.report.summary import summary
    from tcstudy.study.execute import StoreError, execute

    watcher = progress()
    try:
        result = execute(study, output, watcher, options.words)
    except (StoreError, GeometryFailed) as error:
        watcher.close()
        _fail(f"{options.study}: {error}")
    finally:
        watcher.close()
    print(summary(result.output))
    print(f"\n  {result.points - result.failed} of {result.points} points solved; data in {result.output}")
    return SOME_FAILED if result.failed else OK


def _plan(options: argparse.Namespace) -> int:
    study, output = _checked(options)
    from tcstudy.report.forecast import forecast_text
    from tcstudy.study.plan import plan

    forecast = plan(study)
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
            study.mesh.family == "adaptive" or study.mesh.tolerance is not None,
        )
    )
    return OK


def _path(options: argparse.Namespace) -> int:
    from tcstudy.study.plan import path_output

    study, output = _checked(options, path_output)
    if study.path is None:
        remedy = "add path: {parameter: theta_bar, from: 0 K, to: 40 K}"
        _fail(f"{options.study}: path: the study has no section path; {remedy}")
    from tcstudy.data.store import StoreError
    from tcstudy.fem.geometry import GeometryFailed
    from tcstudy.report.path_figure import draw_path
    from tcstudy.report.path_progress import PathProgress
    from tcstudy.report.path_summary import path_summary
    from tcstudy.report.style import DrawError, check_target
    from tcstudy.study.path_affine import PathError
    from tcstudy.study.path_execute import execute_path

    progress = PathProgress()
    try:
        if options.plot is not None:
            check_target(options.plot)
        problems = execute_path(study, output, progress, options.words)
        progress.close()
        print(path_summary(output))
        if options.plot is not None:
            print(f"\n  {draw_path(output, options.plot, options.response)}")
    except (PathError, StoreError, GeometryFailed, DrawError) as error:
        progress.close()
        _fail(f"{options.study}: {error}")
    print("".join(f"\n  {problem}" for problem in problems) + f"\n  data in {output}")
    return SOME_FAILED if problems else OK


def _show(options: argparse.Namespace) -> int:
    from tcstudy.data.path_store import is_path
    from tcstudy.data.store import StoreError
    from tcstudy.report.path_summary import path_summary
    from tcstudy.report.summary import summary

    try:
        print(path_summary(options.file) if is_path(options.file) else summary(options.file))
    except StoreError as error:
        _fail(str(error))
    return OK


def _converge(options: argparse.Namespace) -> int:
    from tcstudy.report.style import DrawError, check_target

    point = _point_of(options)
    if options.plot is not None:
        try:
            check_target(options.plot)
        except DrawError as error:
            _fail(str(error))
    study, output = _checked(options)
    from tcstudy.data.convergence import default_path
    from tcstudy.data.store import StoreError
    from tcstudy.fem.geometry import GeometryFailed
    from tcstudy.report.convergence import convergence_report
    from tcstudy.report.convergence_plot import plot_convergence
    from tcstudy.study.convergence import ConvergenceError, converge_to_file

    path = options.output or default_path(output)
    try:
        failed = converge_to_file(study, path, lambda text: print(text, file=sys.stderr, flush=True), options.words)
        print(convergence_report(path, options.format), end="")
        if options.plot is not None:
            print(plot_convergence(path, options.plot, point), file=sys.stderr)
    except (StoreError, GeometryFailed, ConvergenceError, DrawError) as error:
        _fail(f"{options.study}: {error}")
    print(f"data in {path}", file=sys.stderr)
    return SOME_FAILED if failed else OK


def _draw(options: argparse.Namespace) -> int:
    from tcstudy.data.path_store import is_path
    from tcstudy.data.store import StoreError
    from tcstudy.report.draw import DrawError, draw
    from tcstudy.report.path_figure import draw_path

    point = _point_of(options)
    try:
        if is_path(options.file):
            if point:
                _fail("--at: the file of a path has no sweep points; leave it out")
            print(draw_path(options.file, options.picture, options.response))
        else:
            print(draw(options.file, options.picture, point, options.level))
    except (StoreError, DrawError) as error:
        _fail(str(error))
    return OK


def _point_of(options: argparse.Namespace) -> dict[str, str]:
    """The sweep point that --at names; exits with 2 if it cannot be read."""
    words = [text.partition("=") for text in options.at]
    if not all(mark for _, mark, _ in words):
        _fail("--at: write NAME=VALUE, for example --at alpha=100")
    return {name: value for name, _, value in words}


def _checked(options: argparse.Namespace, default=None):  # type: ignore[no-untyped-def]  # Study, imported lazily
    """The study and its output (`default` of the study if none is given), both found usable; else exits with 2."""
    from tcstudy.errors import StudyError
    from tcstudy.scene.reader import read_study
    from tcstudy.study.plan import output_of
    from tcstudy.study.preflight import faults

    try:
        study = read_study(options.study, options.overrides)
    except StudyError as error:
        _fail(str(error))
    output = options.output or (default or output_of)(study)
    problems = faults(study, output)
    if problems:
        _fail("\n".join(f"{options.study}: {problem}" for problem in problems))
    return study, output


def _fail(text: str) -> NoReturn:
    print(text, file=sys.stderr)
    raise SystemExit(BAD_INPUT)


if __name__ == "__main__":
    raise SystemExit(main())
