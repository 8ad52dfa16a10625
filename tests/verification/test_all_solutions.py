"""All solutions of a shipped body against mixed-integer programs."""

from __future__ import annotations

from pathlib import Path

import numpy as np

import tcstudy
from tcstudy.contact.all_solutions import PolygonProblems, all_solutions, reach_of
from tcstudy.contact.problem import ContactProblem
from tcstudy.study.run import stages
from tests.verification.milp import sides_of_all_solutions

QUICKSTART = Path(__file__).parents[2] / "configs" / "quickstart.yaml"
FILMS = {
    "softening": "[[0 um, 40 MPa], [10 um, 10 MPa]]",
    "brittle": "[[0 um, 40 MPa], [10 um, 40 MPa], [10 um, 10 MPa]]",
    "saw-tooth": "[[0, 40 MPa], [10 um, 10 MPa], [10 um, 40 MPa], [20 um, 10 MPa], [20 um, 40 MPa], [30 um, 10 MPa]]",
}


def quickstart_problems(film: str, sweep: str, levels: int = 1) -> list[ContactProblem]:
    """The condensed problems of quickstart's body with another film, m = 13 on its first mesh."""
    law = f"friction={{law: piecewise-linear, points: {FILMS[film]}}}"
    study = tcstudy.load(QUICKSTART, [f"mesh.levels={levels}", f"sweep={sweep}", law])
    *_, last = stages(study, first=levels - 1)
    return [last.level.condensed(scene).problem for scene in study.scenes]


def equal_to_milp(problem: ContactProblem) -> int:
    """The number of solutions, if both find the same sides of all polygons, else 0."""
    found, load = all_solutions(problem), problem.l_tilde[None]
    reach = reach_of(problem.c, problem.law, load, problem.lambda_1)
    oracle = sides_of_all_solutions(PolygonProblems(problem.A_tilde, problem.c, problem.law, load, reach))
    return len(found) if found.complete and oracle == sorted(map(tuple, found.sides.tolist())) else 0


def test_quickstart_with_a_brittle_film_has_the_solutions_that_integer_programs_find() -> None:
    [problem] = quickstart_problems("brittle", "{boundary.end.g: [[20 MPa, 0]], theta_bar: [10 K]}")
    assert problem.m == 13
    assert equal_to_milp(problem) == 3
    assert np.count_nonzero(all_solutions(problem).stable) == 2
