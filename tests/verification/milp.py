"""All solutions of a contact problem as those of mixed-integer programs (HiGHS): an oracle that shares no method.

(v_i, ζ_i) = start + t chord on one side of the polygon of node i, chosen by binary variables x with 0 ≤ t ≤ x; every
solution found is cut off by its choice of sides. With tolerances of 1e−6, so no proof, and a thousand times slower.
"""

from __future__ import annotations

import numpy as np
from scipy import optimize

from tcstudy.contact.all_solutions import PolygonProblems


def sides_of_all_solutions(problems: PolygonProblems, most: int = 40) -> list[tuple[int, ...]]:
    """The sides of the nodes in every solution of the first problem. Raises RuntimeError if HiGHS does not end."""
    m, points = problems.m, problems.points[0]
    sides = [(i, k) for i in range(m) for k in range(problems.last[0, i])]
    count, scale = len(sides), float(np.abs(problems.load[0]).max())
    balance, one = np.zeros((m, 2 * count)), np.zeros((m, 2 * count))
    for j, (i, k) in enumerate(sides):
        for column, (v, zeta) in ((j, points[i, k]), (count + j, points[i, k + 1] - points[i, k])):
            balance[:, column] = problems.A[:, i] * v
            balance[i, column] += problems.c[i] * zeta
        one[i, j] = 1.0
    link = np.hstack([-np.eye(count), np.eye(count)])
    rules = [
        optimize.LinearConstraint(balance / scale, problems.load[0] / scale, problems.load[0] / scale),
        optimize.LinearConstraint(one, 1, 1),
        optimize.LinearConstraint(link, -np.inf, 0),
    ]
    found: list[tuple[int, ...]] = []
    integer = np.repeat([1, 0], count)
    while len(found) < most:
        answer = optimize.milp(
            np.zeros(2 * count), constraints=rules, integrality=integer, bounds=optimize.Bounds(0, 1)
        )
        if answer.status == 2:
            return sorted(found)
        if answer.x is None:
            break
        chosen = np.round(answer.x[:count])
        found.append(tuple(sides[j][1] for j in np.flatnonzero(chosen)))
        rules.append(optimize.LinearConstraint(np.append(chosen, np.zeros(count))[None], -np.inf, m - 1))
    raise RuntimeError(f"HiGHS ended without an answer after {len(found)} solutions")
