"""Numbers of laws and memories from cyclic tests: derivatives, closed forms as data, intervals, what is refused."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

from tcstudy.errors import StudyError
from tcstudy.read.study import read_study_text
from tcstudy.scene.study import Study
from tcstudy.study.fit import fit, model_of

Array = np.ndarray

BLOCK = """
title: cyclic pull
body: {rectangle: {width: 0.4 m, height: 0.1 m}}
boundary: {bottom: contact, left: free, top: free, right: {role: clamped, u_x: 0 mm, u_y: free}}
material: {E: 210 GPa, nu: 0.3, alpha_T: 1.2e-5 1/K}
heat: {theta: 0 K}
friction: {law: slip-weakening, tau_s: 20 MPa, tau_k: 15 MPa, delta: 1 mm}
mesh: {maxh: 40 mm}
history:
  memory: MEMORY
  steps:
    - {boundary.right.u_x: 0.05 mm, theta: 30 K, in: 3}
    - {boundary.right.u_x: -0.08 mm, in: 3}
    - {boundary.right.u_x: 0.06 mm, theta: -10 K, in: 2}
fit:
  data: {file: data.csv, columns: {step: step, u_T_max: "u [mm]", friction_resultant: "R [kN/m]", theta_mean: "T [K]"}}
  starts: 1
  parameters:
    friction.tau_s: {start: 20 MPa, within: [10 MPa, 30 MPa]}
    friction.delta: {start: 1 mm, within: [0.6 mm, 3 mm]}
    E: {start: 210 GPa, within: [100 GPa, 300 GPa]}
    nu: {start: 0.3, within: [0.1, 0.4]}
    alpha_T: {start: 1.2e-5 1/K, within: [1e-6 1/K, 1e-4 1/K]}
"""
STIFFNESS = "    history.stiffness: {start: 500 GPa/m, within: [100 GPa/m, 2000 GPa/m]}\n"


def study_of(folder: Path, text: str, head: str, rows: Sequence[Sequence[float]]) -> Study:
    lines = (",".join(f"{x:.17g}" for x in row) for row in rows)
    (folder / "data.csv").write_text("\n".join([head, *lines]) + "\n", encoding="utf-8")
    return read_study_text(text, "fit.yaml", source=folder / "fit.yaml")


@pytest.mark.parametrize(
    ("text", "memory"),
    [
        ("BLOCK", "damage"),
        ("LAYERS", "friction, branch: lowest"),
        ("LAYERS", "elastic-plastic, stiffness: 800 GPa/m"),
    ],
)
def test_jacobian_of_a_plane_body_against_differences(tmp_path: Path, text: str, memory: str) -> None:
    """Resultants, largest slips and temperatures at every step by numbers of law, body and memory: Richardson.

    The Jacobian's own differences are of first order: a fit needs no more digits.
    """
    name, _, more = memory.partition(", ")
    count = 9 if text == "BLOCK" else 7
    text = {"BLOCK": BLOCK, "LAYERS": LAYERS}[text].replace(
        "memory: MEMORY", "\n  ".join([f"memory: {name}", *([more] if more else [])])
    )
    text += STIFFNESS if "stiffness" in memory else ""
    study = study_of(tmp_path, text, "step,u [mm],R [kN/m],T [K]", [(n, 0.0, 0.0, 0.0) for n in range(count)])
    model = model_of(study, study.fit)
    p = np.array([one.start for one in study.fit.parameters])
    exact = model.compared(p)
    assert len(np.unique(np.abs(exact.predicted))) > 12
    for j, size in enumerate(p):

        def at(h: float, j: int = j) -> Array:
            return model.compared(p * (1.0 + h * np.eye(len(p))[j])).residual

        coarse, fine = ((at(h) - at(-h)) / (2.0 * h * size) for h in (1e-4, 5e-5))
        apart, scale = (4.0 * fine - coarse) / 3.0, np.max(np.abs(exact.jacobian[:, j]))
        np.testing.assert_allclose(exact.jacobian[:, j], apart, rtol=0.0, atol=1e-5 * scale + 1e-9 / size)


LAYERS = """
title: two films
body:
  outline: [{from: [0, 0], edge: film}, {from: [0.2 m, 0], edge: shoe}, {from: [0.4 m, 0], edge: right},
            {from: [0.4 m, 0.1 m], edge: top}, {from: [0, 0.1 m], edge: left}]
  regions: {coat: {rectangle: {corner: [0 mm, 75 mm], width: 0.4 m, height: 25 mm}}}
boundary:
  film: contact
  shoe: contact
  left: {role: clamped, u_x: 0, u_y: free}
  top: free
  right: {role: traction, g: [3 MPa, 0], spring: {normal: 5 GPa/m}}
material: {E: 200 GPa, nu: 0.3, plane: strain, alpha_T: 10e-6 1/K}
materials: {coat: {E: 100 GPa, nu: 0.3, alpha_T: 20e-6 1/K}}
heat: {theta: 5 K}
friction:
  film: {law: piecewise-linear, points: [[0 mm, 10 MPa], [0.05 mm, 12 MPa], [0.2 mm, 3 MPa]]}
  shoe: {law: slip-weakening, tau_s: 20 MPa, tau_k: 8 MPa, delta: 0.2 mm, strength: 1.3}
mesh: {maxh: 50 mm}
history:
  memory: MEMORY
  steps: [{theta: 80 K, in: 2}, {theta: -60 K, in: 2}, {theta: 90 K, in: 2}]
fit:
  data: {file: data.csv, columns: {step: step, u_T_max: "u [mm]", friction_resultant: "R [kN/m]", theta_mean: "T [K]"}}
  starts: 1
  parameters:
    friction.shoe.delta: {start: 0.2 mm, within: [0.15 mm, 3 mm]}
    friction.shoe.strength: {start: 1.3, within: [1.1, 1.5]}
    friction.film.points.1: {start: 12 MPa, within: [8 MPa, 20 MPa]}
    materials.coat.E: {start: 100 GPa, within: [50 GPa, 300 GPa]}
    boundary.right.spring.normal: {start: 5 GPa/m, within: [1 GPa/m, 10 GPa/m]}
    boundary.right.g_x: {start: 3 MPa, within: [1 MPa, 10 MPa]}
"""


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
    """The closed form of a rigid block as data: found as far as it is rigid, and with noise."""
    clean, truth = returned(PULLED), np.array(FOUND)
    for noise, rel in ((0.0, 1e-5), (2e3, 0.05)):
        measured = clean + noise * np.random.default_rng(3).normal(size=len(clean))
        record = fit(study_of(tmp_path, RIGID, "step,P [N/m]", list(enumerate(measured))))  # type: ignore[arg-type]
        found, error = record.values["estimate"], record.values["standard_error"]
        assert found == pytest.approx(truth, rel=rel)
        assert np.all(np.abs(found - truth) < 3.0 * error)
        assert np.all(error < 0.02 * truth)
        assert int(record.attributes["evaluations"]) <= 12


STRIP = """
title: bonded strip pulled, let go, pushed and pulled
body: {rectangle: {width: 190 mm, height: 1 mm}}
boundary: {bottom: contact, right: {role: clamped, u_x: 0 mm, u_y: free}, top: free, left: free}
material: {E: 42.24 GPa, nu: 0, plane: stress}
friction: {law: slip-weakening, tau_s: 5 MPa, tau_k: 0 MPa, delta: 0.25 mm}
mesh: {maxh: 4 mm}
history:
  memory: damage
  steps:
    - {boundary.right.u_x: 0.15 mm, in: 6}
    - {boundary.right.u_x: -0.1 mm, in: 2}
    - {boundary.right.u_x: 0.25 mm, in: 3}
fit:
  data: {file: data.csv, columns: {step: step, friction_resultant: "P [N/m]"}}
  noise: {friction_resultant: 2.2 kN/m}
  starts: 1
  parameters:
    friction.tau_s: {start: 5 MPa, within: [1 MPa, 50 MPa]}
    friction.delta: {start: 0.25 mm, within: [0.01 mm, 1 mm]}
"""


def test_softening_film_from_a_strip_that_unloads_along_its_secants(tmp_path: Path) -> None:
    """P = √(τ_s δ D (1 − (1 − Δ/δ)²)) up to δ, then constant; before the largest Δ straight through the origin."""
    D, tau, delta = 42.24e6, 7.2e6, 0.16e-3
    pulled = 1e-5 * np.array([0.0, *np.linspace(2.5, 15.0, 6), 2.5, -10.0, 5.0 / 3.0, 40.0 / 3.0, 25.0])
    largest = np.maximum.accumulate(np.abs(pulled))
    virgin = np.sqrt(tau * delta * D * (1.0 - (1.0 - np.minimum(largest / delta, 1.0)) ** 2))
    clean = virgin * pulled / np.where(largest > 0.0, largest, 1.0)
    record = fit(study_of(tmp_path, STRIP, "step,P [N/m]", list(enumerate(clean))))  # type: ignore[arg-type]
    found, error = record.values["estimate"], record.values["standard_error"]
    assert found == pytest.approx([tau, delta], rel=0.02)  # elements of 4 mm
    assert np.all(np.abs(found - [tau, delta]) < 0.5 * error)


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
