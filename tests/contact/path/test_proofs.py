"""proofs: the same answers as one certificate after the other."""

from __future__ import annotations

import numpy as np
import pytest

from tcstudy.contact.certificates import certify
from tcstudy.contact.path.piecewise_linear_approximation import piecewise_linear
from tcstudy.contact.path.proofs import proved_minima
from tcstudy.contact.path.query import lowest
from tcstudy.scene.study import Acceptance
from tests.contact import contact_cases as cases
from tests.contact.path.cases import a_solution, follow, random_path_problem, softening_line

LONG = piecewise_linear(cases.exponential_decay(1.0, 0.3, 0.3), 2e-4, 4.0)
"""A polygon with hundreds of states."""


@pytest.mark.parametrize("seed", range(7))
def test_groups_prove_what_single_certificates_prove(seed: int) -> None:
    """Random laws, convex or not, with up- and down-jumps; an exponential law's polygon."""
    rng = np.random.default_rng([seed, 131])
    problem = random_path_problem(rng, int(rng.integers(1, 12))) if seed else softening_line(16).with_law(LONG)
    path = follow(problem, a_solution(problem, 0.0), 0.0, -2.0 if seed else 0.0, 2.0 if seed else 3.0)
    low = lowest(path)
    proved = proved_minima(path, low, problem.at(0.0).lambda_1, Acceptance())
    for begin, end, k, found in zip(low.begin, low.end, low.piece, proved, strict=True):
        t = 0.5 * (begin + end)
        v = path.u[k] + (t - path.t[k]) / (path.t[k + 1] - path.t[k]) * (path.u[k + 1] - path.u[k])
        assert certify(problem.at(t), v).global_minimum == found
    assert seed or (len(proved) > 200 and np.count_nonzero(proved) > 0)
