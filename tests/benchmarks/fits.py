"""Do 95 % intervals of fits hold the truth as often as they say? `python -m tests.benchmarks.fits
--draws 200`

Four tests with data from closed forms and noise drawn anew, fitted by two-dimensional models: a
pull test through its snap-back (distances to the path), the same on its stable branch alone
(results at each datum), a heated strip of which expansion and film are sought, and a block pulled
to and fro on elastic-plastic bonds (steps of a history). Told are the share of intervals that hold
the truth, the bias in standard errors, evaluations, and contact problems for a datum and
evaluation.
"""

import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from tcstudy.accuracy.fitted import minimise, uncertainty
from tcstudy.read.study import read_study_text
from tcstudy.scene.fit_plan import FitPlan
from tcstudy.study.fit import Tests, box_of
from tests.benchmarks.cases import options
from tests.study.test_fit import DELTA, TAU, D, pulled
from tests.study.test_fit_cases import FOUND, PULLED, RIGID, returned

Array = NDArray[np.float64]

PEAK = np.sqrt(TAU * DELTA * D)
"""Of the strip of configs/pull_test.yaml [N/m]. Here it is a quarter as high and four times as
stiff: the first points, of a short slip zone, told 1 mm from the thin strip of the closed form, and
biased fits of the stable branch by 0.15 standard errors whatever the mesh (0.4 with its elements of
2 mm)."""
STRIP = """
title: pull
body:
  outline: [{from: [0, 0], edge: bond}, {from: [190 mm, 0], edge: grip},
            {from: [190 mm, 0.25 mm], edge: top}, {from: [0, 0.25 mm], edge: tail}]
boundary: {bond: contact, grip: {role: clamped, u_x: 0, u_y: free}, top: free, tail: free}
material: {E: 168.96 GPa, nu: 0, plane: stress}
friction: {law: slip-weakening, tau_s: 4 MPa, tau_k: 0, delta: 0.3 mm}
mesh: {maxh: MAXH}
fit:
  data: {file: data.csv, columns: {boundary.grip.u_x: "x [m]", friction_resultant: "P [N/m]"}}
  noise: {boundary.grip.u_x: 5 um, friction_resultant: 2.2 N/mm}
  compare: COMPARE
  starts: 1
  parameters:
    friction.tau_s: {start: 4 MPa, within: [1 MPa, 50 MPa]}
    friction.delta: {start: 0.3 mm, within: [0.01 mm, 1 mm]}
"""
HEATED = """
title: heated
body: {rectangle: {width: 1 m, height: 1 mm}}
boundary: {bottom: contact, left: {role: clamped, u_x: 0, u_y: free}, right: free, top: free}
material: {E: 1000 GPa, nu: 0, plane: stress, alpha_T: 10e-6 1/K}
heat: {theta: 0 K}
friction: {law: tresca, tau: 2 MPa}
mesh: {maxh: MAXH}
fit:
  data: {file: data.csv, columns: {theta: "T [K]", u_T_max: "u [m]", friction_resultant: "R [N/m]"}}
  noise: {u_T_max: 2 um, friction_resultant: 8 kN/m}
  starts: 1
  parameters:
    friction.tau: {start: 2 MPa, within: [0.2 MPa, 20 MPa]}
    alpha_T: {start: 8e-6 1/K, within: [1e-6 1/K, 1e-4 1/K]}
"""


@dataclass(frozen=True)
class Case:
    """text: of the study;  data: (n, columns) without noise, columns in the study's order;  noise: of each [SI]."""

    name: str
    text: str
    data: Array
    noise: tuple[float, ...]
    truth: tuple[float, ...]


def stable(n: int) -> Array:
    """(n, 2) Δ and P of the closed form at given Δ on the branch that a machine reaches, two thirds
    on the rise."""
    delta = np.concatenate(
        [np.linspace(0.08, 1.0, 2 * n // 3) ** 1.5 * DELTA, np.linspace(1.1, 5.0, n // 3) * DELTA]
    )
    rise = PEAK * np.sqrt(np.maximum(0.0, 1.0 - (1.0 - np.minimum(delta / DELTA, 1.0)) ** 2))
    return np.stack([delta, rise], axis=1)


def heated(n: int) -> Array:
    """(n, 3) T, u = EH (αT)²/2τ and R = EH αT, α = 12e-6/K, τ = 3 MPa."""
    T, stiffness = np.linspace(20.0, 60.0, n), 200e9 * 5e-3
    return np.stack([T, stiffness * (12e-6 * T) ** 2 / 6e6, stiffness * 12e-6 * T], axis=1)


def cases(size: float) -> list[Case]:
    """The four tests; size: of elements, over the usual one."""
    strip = STRIP.replace("MAXH", f"{1.0 * size:g} mm")
    truth = (TAU, DELTA)
    return [
        Case(
            "through the fold",
            strip.replace("COMPARE", "orthogonal"),
            pulled(60),
            (5e-6, 2.2e3),
            truth,
        ),
        Case(
            "stable branch", strip.replace("COMPARE", "vertical"), stable(45), (0.0, 2.2e3), truth
        ),
        Case(
            "heated strip",
            HEATED.replace("MAXH", f"{10.0 * size:g} mm"),
            heated(30),
            (0.0, 2e-6, 8e3),
            (3e6, 12e-6),
        ),
        Case(
            "cyclic pull",
            RIGID,
            np.stack([np.arange(31.0), returned(PULLED)], axis=1),
            (0.0, 2e3),
            FOUND,
        ),
    ]


def plan_of(case: Case, folder: Path) -> tuple[FitPlan, Callable[[Array], FitPlan]]:
    """The fit of a case, and that of other data."""
    head = case.text.split("columns: {")[1].split("}}")[0].replace('"', "")
    names = ",".join(part.split(": ")[1] for part in head.split(", "))
    rows = "\n".join(",".join(f"{x:.17g}" for x in row) for row in case.data)
    (folder / "data.csv").write_text(f"{names}\n{rows}\n", encoding="utf-8")
    plan = read_study_text(case.text, source=folder / "fit.yaml").fit
    assert plan is not None

    def with_data(data: Array) -> FitPlan:
        columns = [
            replace(c, values=tuple(x))
            for c, x in zip((*plan.given, *plan.measured), data.T, strict=True)
        ]
        n = len(plan.given)
        return replace(plan, given=tuple(columns[:n]), measured=tuple(columns[n:]))

    return plan, with_data


def run(case: Case, draws: int, seed: int) -> None:
    with tempfile.TemporaryDirectory() as name:
        plan, with_data = plan_of(case, Path(name))
        study = read_study_text(case.text, source=Path(name) / "fit.yaml")
    rng, start = np.random.default_rng(seed), np.array([one.start for one in plan.parameters])
    tests, box = Tests.of(study), box_of(plan)
    (model,) = tests.models
    held, apart, evaluations, worst = np.zeros(len(start)), [], [], 0.0
    clock = time.perf_counter()
    for _ in range(draws):
        model.plan, model.solves = (
            with_data(case.data + rng.normal(size=case.data.shape) * case.noise),
            0,
        )
        best = minimise(tests, start, box)
        said = uncertainty(best, box, tests.groups, plan.known_noise)
        held += (said["interval"][:, 0] <= case.truth) & (case.truth <= said["interval"][:, 1])
        apart.append((best.p - case.truth) / said["standard_error"])
        evaluations.append(best.evaluations)
        worst = max(worst, model.solves / best.evaluations)
    each = worst / (1.0 if plan.compare == "orthogonal" else len(case.data))
    told = (
        ("{:.1%}", held / draws),
        ("{:+.2f}", np.mean(apart, axis=0)),
        ("{:.2f}", np.std(apart, axis=0)),
    )
    held_by, bias, spread = (", ".join(form.format(x) for x in values) for form, values in told)
    what = (
        "paths an evaluation" if plan.compare == "orthogonal" else "solves a datum and evaluation"
    )
    print(
        f"{case.name}: {draws} draws, intervals hold {held_by}, bias {bias} standard errors, spread {spread}, "
        f"evaluations median {np.median(evaluations):g}, most {max(evaluations)}, {what} {each:.2f}, "
        f"{(time.perf_counter() - clock) / draws:.2f} s a fit",
        flush=True,
    )


def main() -> None:
    asked = options(
        __doc__, draws=200, seed=1, size=1.0, case=-1
    )  # size: of elements, over the usual one
    with threadpool_limits(1, user_api="blas"):
        for number, case in enumerate(cases(asked.size)):
            if asked.case in (-1, number):
                run(case, asked.draws, asked.seed)


if __name__ == "__main__":
    main()
