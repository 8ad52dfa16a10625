"""proofs: the same answers as one certificate after the other."""

from __future__ import annotations

import numpy as np
import pytest

from tcstudy.contact.certificates import certify
from tcstudy.contact.path.chords import piecewise_linear
from tcstudy.contact.path.follow import Path
from tcstudy.contact.path.proofs import proved_minima
from tcstudy.contact.path.query import Lowest, lowest
from tcstudy.scene.study import Acceptance
from tests.contact import contact_cases as cases
from tests.contact.path.cases import a_solution, follow, random_path_problem, softening_line


def one_by_one(path: Path, low: Lowest) -> list[bool]:
    found = []
    for begin, end, k in zip(low.begin, low.end, low.piece, strict=True):
        t = 0.5 * (begin + end)
        v = path.u[k] + (t - path.t[k]) / (path.t[k + 1] - path.t[k]) * (path.u[k + 1] - path.u[k])
        found.append(certify(path.problem.at(t), v).global_minimum)
    return found


@pytest.mark.parametrize("seed", range(12))
def test_groups_prove_what_single_certificates_prove(seed: int) -> None:
    """Random laws, convex or not, with up- and down-jumps."""
    rng = np.random.default_rng([seed, 131])
    problem = random_path_problem(rng, int(rng.integers(1, 12)))
    path = follow(problem, a_solution(problem, 0.0), 0.0, -2.0, 2.0)
    low = lowest(path)
    proved = proved_minima(path, low, problem.at(0.0).lambda_1, Acceptance())
    assert list(proved) == one_by_one(path, low)


def test_a_long_path_is_proved_as_its_states_are() -> None:
    """An exponential law as a polygon: hundreds of states."""
    law = piecewise_linear(cases.exponential_decay(1.0, 0.3, 0.3), 2e-4, 4.0)
    problem = softening_line(16).with_law(law)
    path = follow(problem, np.zeros(16), 0.0, 0.0, 3.0)
    low = lowest(path)
    proved = proved_minima(path, low, problem.at(0.0).lambda_1, Acceptance())
    assert len(proved) > 200
    assert np.count_nonzero(proved) > 0
    assert list(proved) == one_by_one(path, low)
