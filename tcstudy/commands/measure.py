"""tcstudy converge, cost: errors over the levels, and accuracy against cost; both into a file and as tables."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tcstudy.commands import shared
from tcstudy.commands.shared import MANNER, OK, SOME_FAILED, STUDY, at, checked, command, fail, note, say

if TYPE_CHECKING:
    from tcstudy.data.provenance import Kind
    from tcstudy.scene.study import Study


@command(
    "measure errors, rates and limits over the levels",
    *STUDY,
    shared.output_option("convergence file (default: results/<study>.convergence.nc)"),
    *MANNER,
    shared.plot_option("draw the errors"),
    at("the point of tables and picture (default: orders of all, picture of the first)"),
    shared.FORCE,
)
def converge(options: argparse.Namespace) -> int:
    """Errors, rates and limits over the levels."""
    point = shared.point_of(options)
    study, path = checked(options, "convergence")
    from tcstudy.data.store import sweep_points
    from tcstudy.reports.select_point import locate
    from tcstudy.study.convergence import without_errors

    locate(sweep_points(study), point, "study")
    if options.plot is not None and (lack := without_errors(study)):
        fail(f"--plot: there would be no errors to draw: {lack}")
    return _measured(options, "convergence", study, path, at=point)


@command(
    "chart accuracy against cost: meshes and solvers compared",
    *STUDY,
    shared.output_option("cost file (default: results/<study>.cost.nc)"),
    *MANNER,
    shared.plot_option("draw the chart"),
    at("sweep point (default: first)"),
    shared.FORCE,
)
def cost(options: argparse.Namespace) -> int:
    """Accuracy against cost of mesh families and solvers, at one sweep point."""
    point = shared.point_of(options)
    return _measured(options, "cost", *checked(options, "cost"), point)


def _measured(
    options: argparse.Namespace, kind: Kind, study: Study, path: Path, point: dict[str, str] | None = None, **drawn: Any
) -> int:
    """Measure, say what the file says, what was drawn and where the data are."""
    _, there = shared.do(kind, study, path, options.words, None if options.quiet else "", options.force, at=point)
    if there:
        note(options, f"{path} {there}")
    lines = (*shared.plotted(options, path, **drawn), f"data in {path}")
    say(options, path)
    for line in lines:
        note(options, line)
    return SOME_FAILED if shared.failures(path)[1] else OK
