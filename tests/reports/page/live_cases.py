"""Three scenes for the live mode, and random settings of each with the problem that tcstudy itself makes of them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from tcstudy.contact.problem import ContactProblem
from tcstudy.laws.shapes import SHAPES
from tcstudy.offline.level import Level
from tcstudy.read.study import read_study_text
from tcstudy.refine.family import Family
from tcstudy.reports.page.law_part import INTERFACES
from tcstudy.scene.records import Convection, Scene, Traction
from tcstudy.scene.study import Study

PAD = """
title: A pad pushed sideways
body: {outline: [{from: [0, 0], edge: film}, {from: [120 mm, 0], edge: bevel}, {from: [100 mm, 20 mm], edge: plate},
                 {from: [0, 20 mm], edge: back}]}
boundary: {film: contact, plate: {role: clamped, u_x: 0.8 mm, u_y: 0 mm}, bevel: free,
           back: {role: traction, g: [1 kPa, 0]}}
material: {E: 5 MPa, nu: 0.4}
friction: {law: slip-weakening, tau_s: 100 kPa, tau_k: 20 kPa, delta: 0.4 mm}
mesh: {maxh: 6 mm, levels: 2}
sweep: {mode: zip, boundary.plate.u_x: [0.8 mm, 1.5 mm], E: [5 MPa, 8 MPa],
        friction: {weak: {law: slip-weakening, tau_s: 100 kPa, tau_k: 20 kPa, delta: 0.4 mm},
                   decay: {law: exponential, a: 90 kPa, b: 30 kPa, delta: 0.3 mm}}}
output: {live: true}
"""

PLATE = """
title: A plate in sloping surroundings
units: none
body: {rectangle: {width: 2, height: 1}}
boundary: {bottom: contact, left: clamped, top: convection, right: {role: traction, pressure: -0.05}}
material: {E: 1, nu: 0.3, k: 1, alpha_T: 0.05}
heat: {alpha: 2, theta_bar: "1 + x", q: 0.5}
friction: {law: saw-tooth, tau: 0.03, delta: 0.02, teeth: 3, drop: 0.6, decay: 0.8}
mesh: {maxh: 0.2, levels: 3}
sweep: {alpha: [4, 0.5], friction: {teeth: {law: saw-tooth, tau: 0.03, delta: 0.02, teeth: 3, drop: 0.6, decay: 0.8},
        spring: {law: linear, k: 0.3}, bond: {law: bilinear, tau: 0.03, s0: 0.02, sf: 0.3},
        shelf: {law: piecewise-linear, points: [[0, 0.02], [0.05, 0.04], [0.05, 0.01], [0.2, 0.02]], slope: 0.01}}}
output: {live: true}
"""


BRACKET = (
    "output.live=true",
    "output.fields=true",
    "sweep.alpha=[100 W/(m^2*K), 400 W/(m^2*K)]",
    "sweep.theta_bar=[0 K, 20 K]",
)
"""What is changed of the quickstart: its page is tested, not its sweep."""


def studies() -> dict[str, Study]:
    """The bracket of the quickstart with 104 contact nodes, a pad that lets go, a plate with teeth."""
    text = (Path(__file__).parents[3] / "configs" / "quickstart.yaml").read_text(encoding="utf-8")
    bracket = read_study_text(text, "quickstart", BRACKET)
    return {"bracket": bracket, "pad": read_study_text(PAD), "plate": read_study_text(PLATE)}


def finest(study: Study) -> Level:
    """The finest level of a study."""
    family = Family(study)
    meshes = [family.next(i) for i in range(study.mesh.levels)]
    return Level(meshes[-1], study.scenes[0], study.scenes)


@dataclass(frozen=True)
class Setting:
    """Sliders somewhere: the point started from (in the study's order), what the page is told, the same scene here."""

    point: int
    sliders: dict[str, Any]
    problem: ContactProblem


def settings(study: Study, level: Level, count: int, seed: int) -> Iterator[Setting]:
    """Random places of all sliders; the problem is made by the study's own code, not from what the page holds."""
    random = np.random.default_rng(seed)
    for _ in range(count):
        point = int(random.integers(len(study.scenes)))
        scene = study.scenes[point]
        factor = float(random.uniform(-1.0, 2.0))
        name = "piecewise-linear" if scene.friction.name in INTERFACES else scene.friction.name
        spec = {k: _moved(k, v, random) for k, v in PARAMETERS[scene.friction.name](scene).items()}
        law = SHAPES[name].build(**spec)
        changed = replace(_loaded(scene, factor), friction=law)
        told = {"factor": factor, "law": {"law": name, **spec}}
        yield Setting(point, told, level.condensed(changed).problem)


def _loaded(scene: Scene, factor: float) -> Scene:
    """The scene with all mechanical loads times a factor."""

    def scaled(role: Any) -> Any:
        if not isinstance(role, Traction | Convection):
            return role
        return replace(role, g=(factor * role.g[0], factor * role.g[1]), pressure=factor * role.pressure)

    return replace(scene, boundary=tuple((name, scaled(role)) for name, role in scene.boundary))


def _moved(name: str, value: Any, random: np.random.Generator) -> Any:
    """A parameter of a law somewhere else."""
    if name == "teeth":
        return int(random.integers(1, 6))
    if name in ("drop", "decay"):
        return float(random.uniform(0.2, 1.0))
    if name == "points":
        stretch = np.exp(random.uniform(-0.5, 0.5, 2))
        return [[s * stretch[0], b * stretch[1]] for s, b in value]
    return float(value * np.exp(random.uniform(-0.7, 0.7)))


def _weakening(scene: Scene) -> dict[str, Any]:
    law = scene.friction
    return {"tau_s": float(law.b(0.0)), "tau_k": float(law.b(law.kinks[-1])), "delta": float(law.kinks[-1])}


PARAMETERS = {
    "tresca": lambda scene: {"tau": float(scene.friction.b(0.0))},
    "slip-weakening": _weakening,
    "exponential": lambda scene: {
        "a": float(scene.friction.b(0.0)), "b": float(scene.friction.b(1e9 * scene.friction.s_scale)),
        "delta": scene.friction.s_scale,
    },
    "saw-tooth": lambda scene: {"tau": 0.03, "delta": 0.02, "teeth": 3, "drop": 0.6, "decay": 0.8},
    "linear": lambda scene: {"k": 0.3},
    "bilinear": lambda scene: {"points": [[0.0, 0.0], [0.02, 0.03], [0.3, 0.0]], "slope": 0.0},
    "piecewise-linear": lambda scene: {"points": _points(scene), "slope": float(scene.friction.slope(1e9, -1))},
}  # fmt: skip


def _points(scene: Scene) -> list[list[float]]:
    law, points = scene.friction, [[0.0, float(scene.friction.b(0.0))]]
    for k in np.flatnonzero(law.kinks > 0.0):
        points.append([float(law.kinks[k]), float(law.b_left[k])])
        if law.b_left[k] != law.b_right[k]:
            points.append([float(law.kinks[k]), float(law.b_right[k])])
    return points
