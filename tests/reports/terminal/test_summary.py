"""The summary's lines on failures and on heat, from a written file."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from tcstudy.data.reading import load_root
from tcstudy.data.records import LevelRecord
from tcstudy.data.schema import BALANCED, LIMITED, UNBALANCED, PointStatus
from tcstudy.reports.terminal.summary import text_of
from tcstudy.scene.mesh_plan import MeshPlan
from tcstudy.scene.solver_plan import SolverPlan
from tcstudy.scene.study import Axis, OutputPlan, Study
from tests.data.by_points import PointRecord, write
from tests.reports.conftest import Stored

ALPHA = Axis("alpha", ("heat", "alpha"), (1, 2, 3), (1.0, 2.0, 3.0), "W m-2 K-1")
S = np.linspace(0.0, 1.0, 3)
LEVELS = [
    LevelRecord(
        i,
        0.5 / 2**i,
        20,
        3,
        S,
        S,
        0.0 * S,
        0.0 * S + 0.25,
        np.zeros(3, np.int8),
        ("film",),
        0.1,
        0.1,
    )
    for i in range(2)
]
STUDY = Study(
    "Plate",
    "title: plate\n",
    None,
    "SI",
    "grid",
    (ALPHA,),
    (),
    MeshPlan((0.5,), 2),
    SolverPlan(),
    OutputPlan(),
)


def point(index: int, number: int, balance: float = 1e-15) -> PointRecord:
    judged = UNBALANCED if balance > 1e-10 else BALANCED
    numbers: dict[str, float | tuple[float, ...]] = {"heat_balance": balance, "heat_status": judged}
    return PointRecord((index,), number, PointStatus.OK, "", numbers, np.zeros(3), np.zeros(3))


def missed(index: int, number: int, residual: str) -> PointRecord:
    reason = f"residual {residual} above the tolerance 1e-10; raise solver.tolerance"
    return PointRecord(
        (index,), number, PointStatus.INCLUSION_VIOLATED, reason, {}, np.empty(0), np.empty(0)
    )


def said(folder: Path, *points: PointRecord, study: Study = STUDY) -> str:
    write(folder / "plate.nc", study, LEVELS, points)
    return text_of(folder / "plate.nc")


def test_failures_are_one_line_a_kind(tmp_path: Path) -> None:
    good = [point(i, n) for i in range(3) for n in range(2)]
    text = said(tmp_path, *good, missed(0, 1, "3e-09"), missed(2, 0, "2e-07"), missed(2, 1, "1e-8"))
    lines = [line.strip() for line in text.splitlines() if "points failed" in line]
    assert lines == [
        "2 points failed: inclusion violated: residual 3e-09 to 2e-07 above the tolerance 1e-10 "
        "(for example alpha = 1 W m-2 K-1 on level 1); raise solver.tolerance"
    ]


def test_what_failed_is_marked_in_its_row(tmp_path: Path) -> None:
    """A number that solves nothing must not look like the others."""
    good = [replace(point(i, n), numbers={"energy": 2.0}) for i in range(3) for n in range(2)]
    bad = replace(missed(1, 1, "3e-09"), numbers={"energy": 7.0})
    rows = [line.split() for line in said(tmp_path, *good, bad).splitlines()]
    assert ["2", "(7)", "failed", "–", "–"] in rows
    assert ["1", "2", "nothing", "–", "–"] in rows


def test_solvers_side_by_side(tmp_path: Path) -> None:
    """Only what every solver stored; where the second found more energy, it is not the least."""
    study = replace(
        STUDY, solver=replace(SolverPlan(), names=("separable-newton", "bundle-newton"))
    )
    points = []
    for i in range(3):
        energies = (-1.0, -1.0 if i else -0.5)
        numbers = {
            "solver_energy": energies,
            "solver_residual": (1e-14, 3e-12),
            "solver_iterations": (4, 40 + i),
            "solver_time": (0.25, 1.0),
            "solver_difference": (0.0, 0.0 if i else 0.125),
        }
        points += [replace(point(i, n), numbers=numbers) for n in range(2)]
    points[-1] = missed(2, 1, "3e-09")
    rows = [
        line.split()
        for line in said(tmp_path, *points, study=study).splitlines()
        if "-newton " in line
    ]
    assert rows[-2:] == [
        ["separable-newton", "1e-14", "20", "1.2", "5/5", "0"],
        ["bundle-newton", "3e-12", "204", "5", "3/5", "0.12"],
    ]


def test_heat_that_does_not_balance_is_said_and_the_points_stay_solved(tmp_path: Path) -> None:
    balances = {
        (0, 0): 1e-15,
        (0, 1): 5e-5,
        (1, 0): 1e-15,
        (1, 1): 2e-9,
        (2, 0): 1e-12,
        (2, 1): 1e-12,
    }
    text = said(tmp_path, *(point(i, n, balance) for (i, n), balance in balances.items()))
    line = next(line for line in text.splitlines() if "heat balance up" in line)
    assert "heat balance up to 5e-05 at 2 points" in line
    assert "worst at alpha = 1 W m-2 K-1 on level 1" in line
    assert "failed" not in text


def test_what_rounding_limits_is_one_line(tmp_path: Path) -> None:
    numbers = {
        "inclusion_residual": 7e-5,
        "inclusion_rounding": 1.1e-4,
        "inclusion_status": LIMITED,
    }
    text = said(tmp_path, point(0, 0), replace(point(2, 1), numbers=numbers))
    [line] = [line.strip() for line in text.splitlines() if "limited by rounding" in line]
    assert line.startswith(
        "limited by rounding: 1 of 6 solutions hold to 7e-05 of the scale of b or better, where "
    )
    assert all(words in line for words in ("rounding alone allows 0.00011", "alpha = 3"))


def test_the_softening_of_a_point_stands_beside_its_proof(stored: Stored) -> None:
    """ω/λ₁ of every point, as the file has both; below 1 the solution is unique."""
    data = load_root(stored("block"))
    omega, lambda_1 = (data[name].values[..., -1].ravel() for name in ("omega", "lambda_1"))
    table = text_of(stored("block"))
    rows = [line.split() for line in table.partition("the finest:")[2].splitlines()]
    heading = next(row for row in rows if "ω/λ₁" in row)
    numbers = rows[rows.index(heading) + 2 :][: len(omega)]
    for row, ratio in zip(numbers, omega / lambda_1, strict=True):
        assert f"{ratio:.3g}" in row
        assert "unique" in row or ratio >= 1.0
