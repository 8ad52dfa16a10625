"""tcstudy show: what run, converge, cost or path said, from the file it wrote."""

from __future__ import annotations

import argparse
from pathlib import Path

from tcstudy.commands.shared import OK

HELP = "print the summary of a result file"


def arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("file", type=Path, metavar="FILE.nc")


def command(options: argparse.Namespace) -> int:
    from tcstudy.data.provenance import kind_of
    from tcstudy.data.reading import reading
    from tcstudy.reports.convergence import convergence_report
    from tcstudy.reports.cost import cost_report
    from tcstudy.reports.path_summary import path_summary
    from tcstudy.reports.summary import summary

    reports = {"run": summary, "path": path_summary, "convergence": convergence_report, "cost": cost_report}
    with reading(options.file):
        text = reports[kind_of(options.file)](options.file).rstrip("\n")
    print(text)
    return OK
