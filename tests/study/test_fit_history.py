"""Numbers of laws and memories from cyclic tests: closed forms as data, intervals, what is refused."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

from tcstudy.errors import StudyError
from tcstudy.read.study import read_study_text
from tcstudy.scene.study import Study
from tcstudy.study.fit import fit

Array = np.ndarray


def study_of(folder: Path, text: str, head: str, rows: Sequence[Sequence[float]]) -> Study:
    lines = (",".join(f"{x:.17g}" for x in row) for row in rows)
    (folder / "data.csv").write_text("\n".join([head, *lines]) + "\n", encoding="utf-8")
    return read_study_text(text, "fit.yaml", source=folder / "fit.yaml")


W, K, TAU, RISE = 0.1, 50e9, 2e6, 4e9
"""Width of a block as good as rigid, spring k, τ(κ) = TAU + RISE κ."""
RIGID = """
title: block on an elastic-plastic film
body: {rectangle: {width: 0.1 m, height: 0.1 m}}
boundary: {bottom: contact, left: free, top: free, right: {role: clamped, u_x: 0 mm, u_y: free}}
material: {E: 1e6 GPa, nu: 0, plane: stress}
friction: {law: piecewise-linear, points: [[0 mm, 1 MPa], [1 mm, 5 MPa]]}
mesh: {maxh: 50 mm}
history:
  memory: elastic-plastic
  stiffness: 100 GPa/m
  steps:
    - {boundary.right.u_x: 0.2 mm, in: 8}
    - {boundary.right.u_x: -0.15 mm, in: 12}
    - {boundary.right.u_x: 0.25 mm, in: 10}
fit:
  data: {file: data.csv, columns: {step: step, friction_resultant: "P [N/m]"}}
  noise: {friction_resultant: 2 kN/m}
  starts: 1
  parameters:
    friction.points.0: {start: 1 MPa, within: [0.2 MPa, 10 MPa]}
    friction.points.1: {start: 5 MPa, within: [0.2 MPa, 30 MPa]}
    history.stiffness: {start: 100 GPa/m, within: [10 GPa/m, 1000 GPa/m]}
"""


PULLED = np.concatenate(
    [np.linspace(0, 2e-4, 9), np.linspace(2e-4, -1.5e-4, 13)[1:], np.linspace(-1.5e-4, 2.5e-4, 11)[1:]]
)
"""(31,) where the steps have pulled it [m]."""
FOUND = (TAU, TAU + 1e-3 * RISE, K)
"""What is sought."""


def returned(U: Array) -> Array:
    """(n,) resultants of the rigid block pulled to U, by the return map written down for one point."""
    p = kappa = 0.0
    found = []
    for u in U:
        trial = K * (u - p)
        flow = max(0.0, (abs(trial) - TAU - RISE * kappa) / (K + RISE))
        p, kappa = p + np.sign(trial) * flow, kappa + flow
        found.append(W * K * (u - p))
    return np.array(found)


def test_strength_rise_and_spring_of_a_cyclic_test(tmp_path: Path) -> None:
    """The closed form of a rigid block as data: found as far as it is rigid."""
    rows, truth = [(float(n), P) for n, P in enumerate(returned(PULLED))], np.array(FOUND)
    record = fit(study_of(tmp_path, RIGID, "step,P [N/m]", rows))
    assert record.values["estimate"] == pytest.approx(truth, rel=1e-5)
    assert np.all(record.values["standard_error"] < 0.02 * truth)
    assert int(record.attributes["evaluations"]) <= 12


REFUSED = (
    ({"step: step, ": ""}, "fit.data: a fit of a history needs a column step; add {step:"),
    ({"step: step": "boundary.right.u_x: step"}, "'boundary.right.u_x' is neither a result nor the step of the"),
    ({"starts: 1": "compare: orthogonal"}, "distances to a path are of one monotone load, but the study has a history"),
    ({"in: 8": "in: 7"}, "the history has no step 30; steps are 0 for the study as it is written, then 1 to 29"),
    ({"friction.points.1: {start: 5 MPa": "boundary.right.u_x: {start: 5 mm", "[0.2 MPa, 30 MPa]": "[1 mm, 9 mm]"},
     "boundary.right.u_x is what the history changes, so it is known"),
    ({"[10 GPa/m, 1000": "[-1 GPa/m, 1000"}, "history.stiffness = -1e+09: must be greater than 0"),
)  # fmt: skip


@pytest.mark.parametrize(("change", "told"), REFUSED)
def test_what_a_fit_of_a_history_does_not_take(tmp_path: Path, change: dict[str, str], told: str) -> None:
    text = RIGID
    for old, new in change.items():
        assert old in text
        text = text.replace(old, new)
    with pytest.raises(StudyError) as fault:
        study_of(tmp_path, text, "step,P [N/m]", [(n, 0.0) for n in range(31)])
    assert [told in str(one) for one in fault.value.problems].count(True) == 1, fault.value.problems
