"""What the terminal says of a result file of any kind."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from tcstudy.data.provenance import kind_of
from tcstudy.reports.select_point import Value
from tcstudy.reports.terminal.tables import wrapped


def text_of(
    file: Path,
    full: bool = False,
    form: str = "text",
    point: Mapping[str, Value] | None = None,
    of: str | None = None,
) -> str:
    """Its sentences and tables, from the file alone. Raises StoreError.

    full:  all rows, steps and tables;  form: one of tables.FORMATS, of a convergence or cost file
    point: of a convergence file, whose tables to show;  of: of a design, the number whose indices to show
    """
    match kind_of(file):
        case "convergence":
            from tcstudy.reports.terminal.convergence import convergence_report

            return convergence_report(file, form, point, full)
        case "cost":
            from tcstudy.reports.terminal.cost import cost_report

            return cost_report(file, form)
        case "path":
            from tcstudy.reports.terminal.path_summary import path_summary

            return wrapped(path_summary(file))
        case "history":
            from tcstudy.reports.terminal.history_summary import history_summary

            return wrapped(history_summary(file, full))
        case "fit":
            from tcstudy.reports.terminal.fit import fit_summary

            return wrapped(fit_summary(file))
    from tcstudy.reports.terminal.indices import indices_text
    from tcstudy.reports.terminal.summary import MOST_ROWS, summary

    return summary(file, None if full else MOST_ROWS) + (f"\n\n{indices_text(file, of)}" if of else "")
