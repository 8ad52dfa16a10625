"""Whole scenes drawn at random, all features at once, against the monolithic scipy solution of
every point of a sweep.

Slanted and turned polygons from millimetres to a kilometre with a hole and a region of another
material; tractions, pressures, also in the hole, resultants, springs, rigid and symmetry edges,
given displacements; heat by edge and in the region; laws by edge with strengths; numbers by name. A
sweep changes several of them at once, so that factors, modes and basis loads are shared or made
anew.
"""

import json
from copy import deepcopy
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr

import tcstudy
from tcstudy.read.study import read_study_text
from tests.verification.monolithic import Data, Whole


class Draw:
    def __init__(self, seed: int) -> None:
        self.r = np.random.default_rng(seed)

    def near(self, size: float) -> float:
        """A number of either sign of about that size."""
        return float(f"{size * self.r.uniform(0.3, 1.0) * self.r.choice([-1, 1]):.6g}")

    def about(self, size: float, by: float = 3.0) -> float:
        """A positive number within that factor."""
        return float(f"{size * by ** self.r.uniform(-1, 1):.6g}")

    def field(self, size: float, L: float) -> Any:
        a, b, c = (float(f"{v:.3g}") for v in self.r.uniform(-0.6, 0.6, 3))
        text = f"{self.near(size)!r}*(1 + {a}*x/{L!r} + {b}*y/{L!r} + {c}*x*y/{L!r}**2)"
        return text if self.r.random() < 0.5 else self.near(size)

    def one_of(self, *choices: Any) -> Any:
        return choices[int(self.r.integers(len(choices)))]


def drawn(seed: int) -> tuple[Data, list[Data]]:
    """A scene in SI numbers and texts, and what its points change: values by key path."""
    d = Draw(seed)
    L = d.about(1.0, 1000.0)
    E, strain, kelvin, k = d.about(1e10, 100.0), d.about(1e-3), d.about(30.0), d.about(20.0)
    angle = np.linspace(0, 2 * np.pi, 5, endpoint=False) + d.r.uniform(-0.2, 0.2, 5)
    radius = L * d.r.uniform(0.8, 1.0, 5)
    corners = [
        [float(f"{c:.6g}") for c in (r * np.cos(a), r * np.sin(a))]
        for r, a in zip(radius, angle, strict=True)
    ]
    stress, u = E * strain, L * strain

    def material() -> Data:
        return {
            "E": d.about(E),
            "nu": d.about(0.2, 2.0),
            "alpha_T": d.near(strain / kelvin),
            "k": d.about(k),
        }

    def law() -> Data:
        tau, delta = d.about(0.3 * stress), d.about(0.3 * u)
        strength = {"strength": f"max(0, 1 + 0.8*x/{L!r})"} if d.r.random() < 0.5 else {}
        smooth = {"law": "exponential", "a": tau, "b": 0.4 * tau, "delta": delta}
        weak = {"law": "slip-weakening", "tau_s": tau, "tau_k": 0.5 * tau, "delta": delta}
        return {**d.one_of({"law": "tresca", "tau": tau}, smooth, weak), **strength}

    def load() -> Data:
        own = {"g": [d.field(stress, L), d.near(stress)], "pressure": d.field(stress, L)}
        return own | {"force": [d.near(stress * L), d.near(stress * L)]}

    spring = {"normal": d.about(0.2 * E / L), "tangential": d.about(0.2 * E / L)}
    source = {"q": d.field(k * kelvin / L**2, L), "omega": "core"}
    robin = {"alpha": d.about(k / L), "theta_bar": d.field(kelvin, L)}
    held = d.one_of(
        {"role": "clamped", "u_x": d.field(u, L), "u_y": d.near(u)}, {"role": "clamped", "u_y": d.near(u)},
        {"role": "rigid", "force": [d.near(stress * L), d.near(stress * L)]},
        {"role": "rigid", "u_x": d.near(u), "force": [0.0, d.near(stress * L)]}, {"role": "symmetry"},
    )  # fmt: skip
    scene: Data = {
        "corners": corners, "stress": bool(d.r.random() < 0.5), "material": material(), "core": material(),
        "boundary": {
            "e0": {"role": "contact", "heat": d.one_of({"flux": d.field(k * kelvin / L, L)}, robin)},
            "e1": {"role": "traction", **load(), "spring": spring},
            "e2": {**held, "heat": d.one_of({"theta": d.field(kelvin, L)}, {"flux": d.near(k * kelvin / L)})},
            "e3": {"role": "convection", **load(), "flux": d.near(k * kelvin / L)},
            "e4": {"role": "contact"},
            "hole": d.one_of({"role": "traction", **load()}, {"role": "convection", "pressure": stress, **robin}),
        },
        "f": [d.field(stress / L, L), d.near(stress / L)],
        "heat": {"alpha": d.about(k / L), "theta_bar": d.field(kelvin, L), **source},
        "friction": {"e0": law(), "e4": law()},
    }  # fmt: skip
    numbers = {
        "core.E": d.about(E),
        "material.E": d.about(E),
        "core.k": d.about(k),
        "heat.alpha": d.about(k / L, 30.0),
        "material.alpha_T": d.near(strain / kelvin),
        "boundary.e3.flux": d.near(k * kelvin / L),
        "boundary.e1.spring.normal": d.about(E / L),
        "boundary.hole.pressure": d.near(stress),
        "friction.e0.strength": d.about(1.0),
        "boundary.e3.force": [d.near(stress * L), 0.0],
    }
    some = d.r.permutation(list(numbers))[:4].tolist()
    return scene, [{}, {key: numbers[key] for key in some[:2]}, {key: numbers[key] for key in some}]


def put(scene: Data, values: Data) -> Data:
    scene = deepcopy(scene)
    for key, value in values.items():
        *path, last = key.split(".")
        section = scene
        for word in path:
            section = section[word]
        section[last] = value
    return scene


def written(scene: Data, points: list[Data]) -> str:
    """The study of a scene: SI numbers, the modulus of the body by a name, a sweep over points."""
    L = float(np.hypot(*scene["corners"][0]))
    hole = {"circle": {"center": [0.35 * L, 0.0], "radius": 0.15 * L, "edge": "hole"}}
    core = {"polygon": [[-0.4 * L, -0.2 * L], [-0.05 * L, -0.25 * L], [-0.1 * L, 0.3 * L]]}
    outline = [{"from": at, "edge": f"e{i}"} for i, at in enumerate(scene["corners"])]
    keys = sorted({key for point in points for key in point})

    def value(key: str, point: Data) -> Any:
        section = scene
        for word in key.split("."):
            section = section.get(word, 1.0)
        return point.get(key, section)

    where = {key: f"materials.{key}" if key.startswith("core") else key for key in keys}
    study = {
        "parameters": {"modulus": scene["material"]["E"]},
        "body": {"outline": outline, "holes": [hole], "regions": {"core": core}},
        "boundary": scene["boundary"], "loads": {"f": scene["f"]}, "heat": scene["heat"], "friction": scene["friction"],
        "material": {**scene["material"], "E": "1*modulus", "plane": "stress" if scene["stress"] else "strain"},
        "materials": {"core": scene["core"]}, "mesh": {"maxh": 0.3 * L},
        "sweep": {"mode": "list", "points": [{where[key]: value(key, point) for key in keys} for point in points]},
        "output": {"fields": True, "quantities": ["reactions", "theta_edges"]},
    }  # fmt: skip
    return json.dumps(study)


@pytest.mark.parametrize("seed", range(3))
def test_every_point_is_that_of_the_monolithic_system(tmp_path: Path, seed: int) -> None:
    scene, points = drawn(seed)
    tcstudy.run(read_study_text(written(scene, points)), tmp_path / "a.nc")
    with (
        xr.open_dataset(tmp_path / "a.nc") as root,
        xr.open_dataset(tmp_path / "a.nc", group="level_0") as mesh,
    ):
        assert np.all(root["status"].values == 1), root["reason"].values
        xy, at = (
            np.column_stack([mesh[name] for name in names])
            for names in (("node_x", "node_y"), ("x", "y"))
        )
        numbers = [int(np.argmin(np.hypot(*(xy - p).T))) for p in at]
        for i, values in enumerate(points):
            whole = Whole(
                put(scene, values), xy, mesh["triangle"].values, mesh["region"].values == 1
            )
            u_T = mesh["u_T"].values[i]
            u, force, xi, defect = whole.solve(dict(zip(numbers, u_T, strict=True)))
            size = np.max(np.abs(u))
            order = [whole.contact()[0].tolist().index(n) for n in numbers]
            assert np.max(np.abs(mesh["theta"].values[i] - whole.theta)) < 1e-11 * np.max(
                np.abs(whole.theta)
            )
            found = np.column_stack([mesh["u_x"].values[i], mesh["u_y"].values[i]])
            assert np.max(np.abs(found - u)) < 1e-10 * size
            assert np.max(defect) < 1e-9
            assert np.max(np.abs(mesh["xi"].values[i] - xi[order])) < 1e-8 * np.max(np.abs(xi))
            assert np.allclose(mesh["c"], whole.contact()[2][order], rtol=1e-12)
            scale, warmest = np.abs(force).sum(), np.max(np.abs(whole.theta))
            for name in whole.scene["boundary"]:
                on = whole.edge == name
                mean = (
                    whole.length[on]
                    @ whole.theta[whole.sides[on]].mean(axis=1)
                    / whole.length[on].sum()
                )
                assert root[f"theta_mean_{name}"].values[i, 0] == pytest.approx(
                    mean, abs=1e-10 * warmest
                )
            total = sum(
                root[name].values[i, 0]
                for name in root.data_vars
                if str(name).startswith("reaction")
            )
            assert total == pytest.approx(force.sum(), abs=1e-9 * scale)
