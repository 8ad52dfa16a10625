"""Where the default solver works and where it fails: `python -m tests.benchmarks.stability`, about
two minutes.

Every solve over the maps of tests.benchmarks.cases becomes a line of results/stability.csv: solved
if the inclusion residual, in extended precision by code that the package does not share, is ≤
1e-10; flagged if the solver says that it is not; else silent.
"""

import csv
import time
from collections import Counter
from itertools import chain

from threadpoolctl import threadpool_limits

from tcstudy.contact.problem import Status
from tcstudy.contact.solve import solve_contact
from tests.benchmarks.cases import RESULTS, Grid, real, synthetic
from tests.contact.contact_cases import independent_residual

TOLERANCE = 1e-10
COLUMNS = (
    "map",
    "x",
    "y",
    "load",
    "outcome",
    "residual",
    "iterations",
    "seconds",
    "heat_balance",
    "reason",
)


def main() -> None:
    counts: Counter[tuple[str, str]] = Counter()
    with (
        (RESULTS / "stability.csv").open("w", encoding="utf-8", newline="") as file,
        threadpool_limits(1),
    ):
        out = csv.writer(file, lineterminator="\n")
        out.writerow(COLUMNS)
        for case in chain(real(Grid()), synthetic(Grid())):
            begin, answer = time.process_time(), solve_contact(case.problem)
            seconds, residual = (
                time.process_time() - begin,
                independent_residual(case.problem, answer.v, answer.v_low),
            )
            claims = (
                answer.status == Status.CONVERGED and not answer.limited
            )  # what rounding limits is said to be
            outcome = "solved" if residual <= TOLERANCE else "silent" if claims else "flagged"
            counts[case.map, outcome] += 1
            row = (
                case.map,
                case.x,
                case.y,
                case.load,
                outcome,
                residual,
                answer.iterations,
                seconds,
            )
            said = (case.heat_balance, "" if outcome == "solved" else answer.reason[:48])
            out.writerow([f"{v:.3g}" if isinstance(v, float) else v for v in (*row, *said)])
    for (name, outcome), count in counts.items():
        print(f"{name}: {count} {outcome}")


if __name__ == "__main__":
    main()
