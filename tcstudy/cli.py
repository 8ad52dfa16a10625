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
    show = commands.add_parser("show", help="print the summary of a result file", epilog=_EPILOG)
    show.add_argument("file", type=Path, metavar="FILE.nc")
    show.set_defaults(command=_show)
    draw = commands.add_parser("draw", help="draw one point of a result file", epilog=_EPILOG)
    draw.add_argument("file", type=Path, metavar="FILE.nc")
    draw.add_argument("picture", type=Path, metavar="PICTURE", help="a .png, .svg or .pdf file")
    draw.add_argument("--at", action="append", default=[], metavar="NAME=VALUE", help="which point (may be repeated)")
    draw.add_argument("--level", type=int, default=-1, metavar="N", help="mesh level (default: the finest)")
    draw.set_defaults(command=_draw)
    parser.add_argument("--version", action="version", version=f"tcstudy {_version()}")
    return parser


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
        )
    )
    return OK


def _show(options: argparse.Namespace) -> int:
    from tcstudy.data.store import StoreError
    from tcstudy.report.summary import summary

    try:
        print(summary(options.file))
    except StoreError as error:
        _fail(str(error))
    return OK


def _draw(options: argparse.Namespace) -> int:
    from tcstudy.data.store import StoreError
    from tcstudy.report.draw import DrawError, draw

    words = [text.partition("=") for text in options.at]
    if not all(mark for _, mark, _ in words):
        _fail("--at: write NAME=VALUE, for example --at alpha=100")
    try:
        print(draw(options.file, options.picture, {name: value for name, _, value in words}, options.level))
    except (StoreError, DrawError) as error:
        _fail(str(error))
    return OK


def _checked(options: argparse.Namespace):  # type: ignore[no-untyped-def]  # Study and Path, imported lazily
    """The study and its output, both found usable; exits with 2 otherwise."""
    from tcstudy.errors import StudyError
    from tcstudy.scene.reader import read_study
    from tcstudy.study.plan import output_of
    from tcstudy.study.preflight import faults

    try:
        study = read_study(options.study, options.overrides)
    except StudyError as error:
        _fail(str(error))
    output = options.output or output_of(study)
    problems = faults(study, output)
    if problems:
        _fail("\n".join(f"{options.study}: {problem}" for problem in problems))
    return study, output


def _fail(text: str) -> NoReturn:
    print(text, file=sys.stderr)
    raise SystemExit(BAD_INPUT)


if __name__ == "__main__":
    raise SystemExit(main())
