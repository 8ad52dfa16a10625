"""Command line: arguments and exit codes only.

Exit codes: 0 all points solved, 1 some points failed, 2 bad study or usage, 3 no memory or no room for what is
printed, 130 interrupted.
"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Callable, Sequence
from pathlib import Path

from tcstudy import commands as do
from tcstudy.commands import OK
from tcstudy.report.outlet import guarded_streams, is_lost

NO_ROOM, INTERRUPTED = 3, 130

_EPILOG = (
    "exit codes: 0 all points solved, 1 some points failed, 2 bad study or usage, 3 no memory or no room for what is "
    "printed, 130 interrupted"
)
_KEPT = "finished points are kept, the same command goes on from there"
_NEEDED = 1 << 28
"""Bytes that the mesher and the solvers ask for at once; where these are not to be had, memory is what is short."""


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command line and return its exit code; raises SystemExit for bad usage and bad studies."""
    arguments = list(sys.argv[1:] if argv is None else argv)
    with guarded_streams() as out:
        try:
            code = _command(arguments)
        except SystemExit as stop:
            if stop.code:
                raise
            code = OK
        out.flush()
        if is_lost(out):
            print(f"standard output: {out.lost}; what was to be printed is lost", file=sys.stderr)
            code = code or NO_ROOM
    return code


def _command(arguments: list[str]) -> int:
    """What the words ask for."""
    options = _parser().parse_args(arguments)
    command: Callable[[argparse.Namespace], int] = options.command
    options.words = ["tcstudy", *arguments]
    kept = _KEPT if command is do.run else "nothing was written"
    try:
        return command(options)
    except KeyboardInterrupt:
        print(f"interrupted; {kept}", file=sys.stderr)
        return INTERRUPTED
    except Exception as error:
        if not _memory_is_short(error):
            raise
        print(f"there is not enough memory; {kept}. Free some, or ask for less (coarser meshes)", file=sys.stderr)
        return NO_ROOM


def _memory_is_short(error: Exception) -> bool:
    """Whether an error comes of missing memory; a library may call it by any name, so it is tried."""
    if isinstance(error, MemoryError):
        return True
    try:
        bytearray(_NEEDED)
    except MemoryError:
        return True
    return False


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="tcstudy",
        description="Parametric studies of thermoelastic contact with nonmonotone, multivalued friction.",
        epilog=_EPILOG,
    )
    commands = parser.add_subparsers(title="commands", required=True, metavar="COMMAND")
    run = commands.add_parser("run", help="run a study and write its netCDF file", epilog=_EPILOG)
    _study_arguments(run)
    run.add_argument("--output", type=_file, metavar="FILE", help="result file (default: results/<study>.nc)")
    _force_argument(run)
    run.set_defaults(command=do.run)
    plan = commands.add_parser("plan", help="check a study and say what a run would do", epilog=_EPILOG)
    _study_arguments(plan)
    plan.add_argument("--output", type=_file, metavar="FILE", help="result file that a run would write")
    plan.set_defaults(command=do.plan)
    path = commands.add_parser("path", help="follow all solutions along one parameter", epilog=_EPILOG)
    _study_arguments(path)
    path.add_argument("--output", type=_file, metavar="FILE", help="result file (default: results/<study>-path.nc)")
    path.add_argument("--plot", type=_file, metavar="PICTURE", help="also draw it: a .png, .svg or .pdf file")
    _response_argument(path)
    _force_argument(path)
    path.set_defaults(command=do.path)
    show = commands.add_parser("show", help="print the summary of a result file", epilog=_EPILOG)
    show.add_argument("file", type=Path, metavar="FILE.nc")
    show.set_defaults(command=do.show)
    converge = commands.add_parser("converge", help="measure errors, rates and limits over the levels", epilog=_EPILOG)
    _study_arguments(converge)
    converge.add_argument(
        "--output", type=_file, metavar="FILE", help="convergence file (default: results/<study>.convergence.nc)"
    )
    converge.add_argument("--format", choices=("text", "markdown", "latex"), default="text", help="form of the tables")
    converge.add_argument("--plot", type=_file, metavar="PICTURE", help="draw the errors: a .png, .svg or .pdf file")
    converge.add_argument(
        "--at", action="append", default=[], metavar="NAME=VALUE", help="point of the plot (default: first)"
    )
    _force_argument(converge)
    converge.set_defaults(command=do.converge)
    cost = commands.add_parser("cost", help="chart accuracy against cost: meshes and solvers compared", epilog=_EPILOG)
    _study_arguments(cost)
    cost.add_argument("--output", type=_file, metavar="FILE", help="cost file (default: results/<study>.cost.nc)")
    cost.add_argument("--runs", type=int, default=5, metavar="N", help="how often everything is timed (default: 5)")
    cost.add_argument("--format", choices=("text", "markdown", "latex"), default="text", help="form of the tables")
    cost.add_argument("--plot", type=_file, metavar="PICTURE", help="draw the chart: a .png, .svg or .pdf file")
    cost.add_argument("--at", action="append", default=[], metavar="NAME=VALUE", help="sweep point (default: first)")
    _error_argument(cost)
    _force_argument(cost)
    cost.set_defaults(command=do.cost)
    draw = commands.add_parser("draw", help="draw a result file: a point, a path, errors, costs", epilog=_EPILOG)
    draw.add_argument("file", type=Path, metavar="FILE.nc")
    draw.add_argument("picture", type=Path, metavar="PICTURE", help="a .png, .svg or .pdf file")
    draw.add_argument("--at", action="append", default=[], metavar="NAME=VALUE", help="which point (may be repeated)")
    draw.add_argument("--level", type=int, metavar="N", help="mesh level (default: the finest)")
    _response_argument(draw)
    _error_argument(draw)
    draw.set_defaults(command=do.draw)
    report = commands.add_parser("report", help="make one HTML page of a result file, for any browser, offline")
    report.add_argument("file", type=Path, metavar="FILE.nc")
    report.add_argument("-o", "--output", type=_file, metavar="PAGE", help="the page (default: FILE.html)")
    what = "leave out what makes a page large: levels, live, body or lines (may be repeated)"
    report.add_argument("--without", action="append", default=[], metavar="PART", help=what)
    report.set_defaults(command=do.report)
    parser.add_argument("--version", action="version", version=f"tcstudy {_version()}")
    return parser


def _response_argument(parser: argparse.ArgumentParser) -> None:
    what = "what a path is drawn over: the mean (default) or largest slip, or the friction resultant"
    parser.add_argument("--response", choices=("mean-slip", "max-slip", "friction"), help=what)


def _force_argument(parser: argparse.ArgumentParser) -> None:
    what = "compute again what the result file holds already, and replace results of another study"
    parser.add_argument("--force", action="store_true", help=what)


def _error_argument(parser: argparse.ArgumentParser) -> None:
    what = "error that accuracy against cost is of, e.g. u_L2, xi_L2, friction_resultant (default: u_energy)"
    parser.add_argument("--error", metavar="NAME", help=what)


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


def _file(text: str) -> Path:
    """The name of a file to write; a Path would forget that the text named a folder."""
    if text.endswith(("/", os.sep)):
        raise argparse.ArgumentTypeError(f"{text} is a folder; give the name of a file in it")
    return Path(text)


def _version() -> str:
    from importlib import metadata

    return metadata.version("tcstudy")


if __name__ == "__main__":
    raise SystemExit(main())
