"""Whole scenes at random, for tolerances: outline, clamp, law, load, heat, starting mesh, goal.

Outline:   rectangle, L, block between oblique sides, block with a hole, block under an arc; any size from mm to km
Held:      one or two of the sides beside or above Γ_C, with displacement 0 or given
Load:      tractions that vary along an edge, body force, heat from the sides and inside
Laws:       its height a random part of the traction that a body that sticks everywhere has, so that part of Γ_C slips;
           its softening 0.1 to 0.9 of λ₁, so that there is one solution to converge to
"""

import io
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from ruamel.yaml import YAML

from tcstudy.contact.problem import ContactProblem
from tcstudy.contact.solve import solve_contact
from tcstudy.offline.level import Level
from tcstudy.read.study import read_study_text
from tcstudy.refine.family import Family
from tcstudy.scene.mesh_plan import Goal
from tcstudy.scene.study import Study

Array = NDArray[np.float64]
Draw = np.random.Generator
Data = dict[str, Any]

CANCELS = 0.1
"""Least |∫ξ| over ∫|ξ|: below it a tolerance relative to the sum asks for that of a difference."""


@dataclass(frozen=True)
class Drawn:
    """A scene and what is asked of it; text: the study as YAML, for whoever looks at a miss."""

    text: str
    study: Study
    goals: tuple[Goal, ...]


def draw_scene(seed: int, index: int) -> Drawn:
    rng = np.random.default_rng([seed, index])
    size, stress = 10.0 ** rng.uniform(-2.5, 3.0), 10.0 ** rng.uniform(0.0, 9.0)
    while True:
        data = _body(rng, size)
        _boundary(rng, data, size, stress)
        data["mesh"] = {"maxh": _digits(size / rng.uniform(12.0, 20.0))}
        data["friction"] = {"law": "tresca", "tau": 1e3 * stress}
        if _law(rng, data):
            break
    goals = _goals(rng, data)
    data["mesh"] = {"maxh": _digits(size * rng.uniform(0.12, 0.5))}
    text = _text(data)
    return Drawn(text, read_study_text(text, f"scene {index} of seed {seed}"), goals)


def _text(data: Data) -> str:
    stream = io.StringIO()
    YAML().dump(data, stream)
    return stream.getvalue()


def _digits(x: float) -> float:
    return float(f"{x:.6g}")


def _body(rng: Draw, size: float) -> Data:
    """A body with Γ_C below; edges named base, right, top, left and what the outline has
    besides."""
    width, height = rng.uniform(1.0, 3.5), rng.uniform(0.6, 1.5)
    kind = str(rng.choice(["rectangle", "L", "oblique", "hole", "arc"]))
    names, holes = ["base", "right", "top", "left"], []
    points = [[0.0, 0.0], [width, 0.0], [width, height], [0.0, height]]
    through: dict[int, list[float]] = {}
    if kind == "L":
        x, y = width * rng.uniform(0.35, 0.65), height * rng.uniform(0.35, 0.65)
        points = [[0.0, 0.0], [width, 0.0], [width, y], [x, y], [x, height], [0.0, height]]
        names = ["base", "right", "shelf", "inner", "top", "left"]
    elif kind == "oblique":
        points[2][0] -= width * rng.uniform(-0.15, 0.3)
        points[3][0] += width * rng.uniform(-0.15, 0.3)
    elif kind == "hole":
        radius = min(width, height) * rng.uniform(0.12, 0.25)
        centre = [width * rng.uniform(0.35, 0.65), height * rng.uniform(0.45, 0.6)]
        circle = {
            "center": [_digits(size * x) for x in centre],
            "radius": _digits(size * radius),
            "edge": "bore",
        }
        holes = [{"circle": circle}]
    elif kind == "arc":
        through = {2: [0.5 * width, height * rng.uniform(1.1, 1.4)]}
    outline = []
    for i, (point, name) in enumerate(zip(points, names, strict=True)):
        edge: Data = {"from": [_digits(size * x) for x in point], "edge": name}
        if i in through:
            edge["through"] = [_digits(size * x) for x in through[i]]
        outline.append(edge)
    return {"units": "none", "body": {"outline": outline, **({"holes": holes} if holes else {})}}


def _boundary(rng: Draw, data: Data, size: float, stress: float) -> None:
    """Roles, material and loads; a body of modulus 1000 under tractions of 1, both times
    `stress`."""
    names = [edge["edge"] for edge in data["body"]["outline"]]
    bores = ["bore"] if "holes" in data["body"] else []
    held = [["left"], ["right"], ["top"], ["left", "right"], ["left", "top"]]
    held += [["inner"], ["shelf"]] if "inner" in names else []
    clamped = held[int(rng.integers(len(held)))]
    heated, plane = bool(rng.random() < 0.4), str(rng.choice(["strain", "stress"]))
    strain, boundary = 1e-3, Data(base="contact")
    if (
        rng.random() < 0.25 and len(clamped) == 1
    ):  # along Γ_C and, so that u_N = 0 there, growing away from it
        move = [
            _digits(strain * size * rng.uniform(-1.0, 1.0)),
            f"{_digits(0.3 * strain * rng.uniform(-1.0, 1.0))}*y",
        ]
        boundary[clamped[0]] = {"role": "clamped", "u": move}
    others = [name for name in (*names[1:], *bores) if name not in clamped]
    boundary |= {name: "clamped" for name in clamped if name not in boundary}
    loaded = set(
        rng.choice(
            others, size=int(rng.integers(1, min(3, len(others)) + 1)), replace=False
        ).tolist()
    )
    for name in others:
        role: Data = {
            "role": "convection"
            if heated and (name in loaded or rng.random() < 0.4)
            else "traction"
        }
        if name in loaded:
            gx, gy, slope = stress * rng.uniform(-1.0, 1.0, 3)
            role["g"] = [f"{_digits(gx)} + {_digits(slope / size)}*x", _digits(0.5 * gy)]
        elif role["role"] == "traction":
            role = {"role": "free"}
        boundary[name] = role
    heated = any(
        isinstance(role, dict) and role["role"] == "convection" for role in boundary.values()
    )
    data["boundary"] = boundary
    data["material"] = {
        "E": _digits(stress / strain),
        "nu": _digits(rng.uniform(0.0, 0.45)),
        "plane": plane,
    }
    if rng.random() < 0.25:
        data["loads"] = {"f": [_digits(x) for x in stress / size * rng.uniform(-1.0, 1.0, 2)]}
    if heated:
        rise, k = rng.uniform(10.0, 100.0), 10.0 ** rng.uniform(-1.0, 2.0)
        data["material"] |= {
            "k": _digits(k),
            "alpha_T": _digits(rng.uniform(0.3, 1.5) * strain / rise),
        }
        data["heat"] = {
            "alpha": _digits(k / size * 10.0 ** rng.uniform(-1.0, 1.0)),
            "theta_bar": _digits(rise * rng.uniform(-1.0, 1.0)),
            "q": _digits(k * rise / size**2 * rng.uniform(-1.0, 2.0)),
        }


def _solved(data: Data) -> tuple[Level, ContactProblem, Array, float]:
    study = read_study_text(_text(data), "drawn")
    scene = study.scenes[0]
    level = Level(Family(study).next(0), scene)
    problem = level.condensed(scene).problem
    return level, problem, solve_contact(problem).v, level.lambda_1(scene)


def _law(rng: Draw, data: Data) -> bool:
    """Give the scene its law; False if nothing slips or everything barely moves."""
    _, problem, v, lambda_1 = _solved(data)
    sticking_traction = float(
        np.sqrt(np.average((problem.xi(v) / problem.c) ** 2, weights=problem.c))
    )
    kind = str(
        rng.choice(
            ["tresca", "slip-weakening", "slip-weakening", "exponential", "linear", "hardening"]
        )
    )
    tau, least, omega = (
        sticking_traction * rng.uniform(0.3, 1.2),
        rng.uniform(0.3, 0.8),
        rng.uniform(0.1, 0.9),
    )
    delta = tau * (1.0 - least) / (omega * lambda_1)
    data["friction"] = {
        "tresca": {"law": "tresca", "tau": tau},
        "slip-weakening": {
            "law": "slip-weakening",
            "tau_s": tau,
            "tau_k": tau * least,
            "delta": delta,
        },
        "exponential": {"law": "exponential", "a": tau, "b": tau * least, "delta": delta},
        "linear": {"law": "linear", "k": lambda_1 * 10.0 ** rng.uniform(-1.0, 1.0)},
        "hardening": {"law": "piecewise-linear", "points": [[0.0, tau * least], [delta, tau]]},
    }[kind]
    for name, value in data["friction"].items():
        if name != "law":
            data["friction"][name] = (
                _digits(value) if name != "points" else [[*map(_digits, one)] for one in value]
            )
    _, problem, v, _ = _solved(data)
    return kind == "linear" or not bool(np.all(problem.law.sticking(v)))


def _goals(rng: Draw, data: Data) -> tuple[Goal, ...]:
    """What may be asked: ∫ξ unless it cancels, u_T where it slips, the slip length where there are
    fronts."""
    level, problem, v, _ = _solved(data)
    xi, stick, line = problem.xi(v), problem.law.sticking(v), level.line
    goals = [Goal("friction_resultant")] * (
        abs(float(xi.sum())) > CANCELS * float(np.abs(xi).sum())
    )
    x, y = line.xy[int(rng.choice(np.flatnonzero(np.abs(v) > 0.3 * np.abs(v).max())))]
    goals.append(Goal("u_T", (_digits(float(x)), _digits(float(y)))))
    if (
        stick.any()
        and not stick.all()
        and float(problem.c[~stick].sum()) > 0.1 * float(problem.c.sum())
    ):
        goals.append(Goal("slip_length"))
    return tuple(goals)
