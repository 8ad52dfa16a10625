"""Stored derivatives of a study against differences, by every kind of number; what is refused."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import tcstudy
from tcstudy.contact.solve import solve_contact
from tcstudy.data.schema import AT_EVENT, DIFFERENTIABLE, name_of, quotient
from tcstudy.errors import StudyError
from tcstudy.fem.meshes import Meshes
from tcstudy.offline.level import Level
from tcstudy.read.scenes import SceneReader
from tcstudy.read.study import read_study_text
from tcstudy.reports.terminal.summary import text_of
from tcstudy.scene.records import Scene
from tcstudy.scene.study import Study
from tcstudy.study.sensitivities import derivatives_of
from tests.study.test_joints import FALLING, SLOW, block

QUANTITIES = ("u_T_max", "friction_resultant", "theta_mean", "energy", "lambda_1", "omega")
OF_OPENINGS = ("opening_max", "peel_stress_max", "adhesion_resultant")
BRACKET = """
units: none
body: {rectangle: {width: 2, height: 1}}
boundary:
  bottom: contact
  left: {role: clamped, u_x: 0.002, u_y: free}
  top: {role: convection, pressure: 0.03}
  right: {role: convection, g: [0.02, 0.01]}
material: {E: 2, nu: 0.25, plane: stress, k: 0.7, alpha_T: 0.05}
loads: {f: [0.01, -0.02]}
heat: {alpha: 0.8, theta_bar: 0.2, q: 0.6}
friction: {law: slip-weakening, tau_s: 0.06, tau_k: 0.02, delta: 0.03}
mesh: {maxh: 0.25}
"""
OF_HEAT = {"k": 0.7, "alpha": 0.8, "E": 2.0, "nu": 0.25}
OF_BRACKET = OF_HEAT | {
    **{
        "friction.tau_s": 0.06,
        "friction.delta": 0.03,
        "friction.strength": 1.0,
        "alpha_T": 0.05,
        "theta_bar": 0.2,
    },
    **{
        "loads.f_x": 0.01,
        "boundary.top.pressure": 0.03,
        "boundary.right.g_y": 0.01,
        "boundary.left.u_x": 0.002,
    },
    **{"q": 0.6},
}
LAYERED = """
units: none
body: {rectangle: {width: 2, height: 1}, regions: {coat: {rectangle: {corner: [0, 0.75], width: 2, height: 0.25}}}}
boundary:
  bottom: {role: contact, heat: {theta_bar: "0.1 + 0.2*x"}}
  left: {role: clamped, u_x: 0.002, u_y: free, heat: {theta: 0.3}}
  top: {role: convection, pressure: 0.03, alpha: 1.3, theta_bar: 0.4}
  right: {role: traction, g: [0.02, 0.01], spring: {normal: 0.3, tangential: 0.1}, heat: {flux: 0.1}}
material: {E: 2, nu: 0.25, plane: PLANE, k: 0.7, alpha_T: 0.05}
materials: {coat: {E: 3, nu: 0.1, k: 1.4, beta: 0.2}}
heat: {alpha: 0.8, q: 0.6}
friction: {law: exponential, a: 0.06, b: 0.02, delta: 0.03}
mesh: {maxh: 0.3}
"""
OF_LAYERS = {
    **{
        "material.E": 2.0,
        "material.nu": 0.25,
        "material.alpha_T": 0.05,
        "material.k": 0.7,
        "heat.q": 0.6,
        "load": 1.0,
    },
    **{
        "materials.coat.E": 3.0,
        "materials.coat.nu": 0.1,
        "materials.coat.k": 1.4,
        "materials.coat.beta": 0.2,
    },
    **{
        "boundary.right.spring.normal": 0.3,
        "boundary.right.spring.tangential": 0.1,
        "boundary.top.theta_bar": 0.4,
    },
    **{"heat.alpha": 0.8, "boundary.top.alpha": 1.3, "boundary.right.heat.flux": 0.1},
    **{"boundary.left.heat.theta": 0.3, "boundary.left.u_x": 0.002, "friction.delta": 0.03},
}
RIGID = """
units: none
body:
  outline: [{from: [0, 0], edge: bottom}, {from: [2, 0], edge: gap}, {from: [2, 0.4], edge: plate},
            {from: [2, 1], edge: top}, {from: [0, 1], edge: left}]
boundary: {bottom: contact, left: clamped, top: free, gap: free,
           plate: {role: rigid, force: [0.2, -0.05], moment: 0.02}}
material: {E: 2, nu: 0.25, plane: stress, alpha_T: 0.05}
heat: {theta: 0.2}
friction: {law: slip-weakening, tau_s: 0.06, tau_k: 0.02, delta: 0.03}
mesh: {maxh: 0.3}
"""
OF_RIGID = {
    **{
        f"boundary.plate.{name}": value
        for name, value in (("force_x", 0.2), ("force_y", -0.05), ("moment", 0.02))
    },
    **{"E": 2.0, "nu": 0.25, "theta": 0.2, "load": 1.0, "friction.delta": 0.03},
}


PEELED = """
units: none
body: {rectangle: {width: 4, height: 0.5}}
boundary:
  bottom: contact
  left: {role: traction, g: [0.004, 0.022]}
  right: clamped
  top: free
material: {E: 2, nu: 0.25, plane: stress}
friction: {law: elastic-plastic, tau: 0.02, s0: 0.05}
adhesion: {law: bilinear, sigma: 0.05, s0: 0.004, sf: 0.4, closing: 40}
mesh: {maxh: 0.25}
"""
GLUED = PEELED.replace("adhesion: {", "adhesion: {bottom: {").replace(
    "40}", '40, strength: "1 + 0.1*x"}}'
)
OF_LAW = {"sigma": 0.05, "s0": 0.004, "sf": 0.4, "closing": 40.0}
OF_PEELED = {f"adhesion.{name}": value for name, value in OF_LAW.items()} | {
    **{"adhesion.strength": 1.0, "friction.tau": 0.02, "E": 2.0, "boundary.left.g_y": 0.022},
}
ON_ROCK = PEELED.replace(", closing: 40", "")
RESTING = (
    ON_ROCK.replace("bottom: contact", "bottom: {role: contact, normal: unilateral}")
    .replace("friction: {law: elastic-plastic, tau: 0.02, s0: 0.05}\n", "")
    .replace(
        "adhesion: {law: bilinear, sigma: 0.05, s0: 0.004, sf: 0.4}\n", "loads: {f: [0, -0.01]}\n"
    )
    .replace("0.022", "0.006")
)
OF_GLUED = {f"adhesion.bottom.{name}": value for name, value in OF_LAW.items()}


def asking(text: str, *names: str) -> tuple[Study, Level]:
    """A study that asks for derivatives by these numbers, and its mesh."""
    study = read_study_text(text, overrides=[f"output.sensitivity=[{', '.join(names)}]"])
    return study, Level(Meshes(study).next(0), study.scenes[0])


def results(level: Level, scene: Scene) -> tuple[np.ndarray, np.ndarray]:
    """The numbers of QUANTITIES and u_T."""
    problem = level.condensed(scene).problem
    answer = solve_contact(problem)
    energy = problem.energy(answer.v) + level.condensed(scene).constant
    u_T, xi = level.split(answer.v)[0], level.split(answer.xi)[0]
    values = [
        np.max(np.abs(u_T)),
        xi.sum(),
        level.temperature(scene).mean,
        energy,
        level.lambda_1(scene),
    ]
    values.append(problem.law.omega)
    if level.opening is not None:
        (_, s_N), (_, force) = level.split(answer.v), level.split(answer.xi)
        values += [s_N.max(), max(0.0, (force / level.opening.c).max()), force.sum()]
    return np.array(values), answer.v


@pytest.mark.parametrize(
    ("text", "values"),
    [
        (BRACKET, OF_BRACKET),
        (BRACKET.replace("theta_bar: 0.2", 'theta_bar: "0.2 + 0.1*x"'), OF_HEAT),
        (BRACKET.replace("theta_bar: 0.2", "theta_bar: 0"), OF_HEAT),
        (LAYERED.replace("PLANE", "strain"), OF_LAYERS),
        (
            LAYERED.replace("PLANE", "stress"),
            {name: OF_LAYERS[name] for name in OF_LAYERS if name.startswith("mat")},
        ),
        (RIGID, OF_RIGID),
        (block(FALLING, SLOW), {"friction.film.delta": 1.0}),
        (PEELED, OF_PEELED),
        (GLUED, OF_GLUED),
        (ON_ROCK, {name: OF_PEELED[name] for name in OF_PEELED if "closing" not in name}),
        (
            RESTING,
            {"boundary.left.g_y": 0.006, "loads.f_y": -0.01, "nu": 0.25},
        ),
    ],
    ids=[
        "bracket",
        "field of theta_bar",
        "theta_bar of 0",
        "layers in strain",
        "in stress",
        "plate",
        "edge",
        "adhesion",
        "adhesion of an edge",
        "on a rigid foundation",
        "unilateral",
    ],
)
def test_every_kind_of_number_against_differences(text: str, values: dict[str, float]) -> None:
    """Of points solved on the same mesh, whose nodes keep their pieces, by Richardson."""
    study, level = asking(text, *values)
    scene, scenery = study.scenes[0], SceneReader.of(study)
    v = results(level, scene)[1]
    found = derivatives_of(level, scene, v, study.output.sensitivity)
    assert found["sensitivity_status"] == DIFFERENTIABLE
    for number in study.output.sensitivity:
        value, steps = values[number.name], np.array([2e-4, 1e-4])
        ends = [[results(level, scenery.at(scene, {number.path: value * (1.0 + way * h)}))[0] for way in (1.0, -1.0)]
                for h in steps]  # fmt: skip
        coarse, fine = (
            (up - down) / (2.0 * h * value) for (up, down), h in zip(ends, steps, strict=True)
        )
        known = QUANTITIES[
            : 5 if "film" in number.name else 6
        ]  # ω of several laws has no derivative
        if level.opening is not None:
            known += OF_OPENINGS
        exact, apart = (
            [found[name_of(quantity, number.name)] for quantity in known],
            (4.0 * fine - coarse) / 3.0,
        )
        np.testing.assert_allclose(
            exact, apart[: len(known)], rtol=1e-7, atol=3e-9, err_msg=number.name
        )


def test_a_sweep_keeps_them_with_units_and_show_prints_them(tmp_path: Path) -> None:
    text = BRACKET.replace("units: none\n", "") + "sweep: {delta: [0.03, 0.06]}\n"
    data = (
        tcstudy.run(asking(text, "friction.delta", "E")[0], tmp_path / "a.nc")
        .to_dataset()
        .isel(level=0)
    )
    stored = data["sensitivity_friction_resultant_friction_delta"]
    assert stored.attrs["units"] == "N m-1 m-1"
    assert np.all((data["sensitivity_status"] == DIFFERENTIABLE) & np.isfinite(stored))
    assert np.sign(data["friction_resultant"][1] - data["friction_resultant"][0]) == np.sign(
        stored[0]
    )
    assert "derivatives known at 2 of 2" in text_of(tmp_path / "a.nc")


def test_no_derivative_at_an_event() -> None:
    """A kink where a node is: NaN, and how many nodes."""
    study, level = asking(BRACKET, "load", "q")
    scene = study.scenes[0]
    v = results(level, scene)[1]
    law = replace(scene.one_law, kinks=scene.one_law.kinks + v[0] - scene.one_law.kinks[-1])
    found = derivatives_of(level, replace(scene, friction=law), v, study.output.sensitivity)
    assert found["sensitivity_status"] == AT_EVENT
    assert found["sensitivity_events"] >= 1
    assert not [name for name in found if name.startswith("sensitivity_u_T_max")]


@pytest.mark.parametrize(
    ("names", "said"),
    [
        ("body.rectangle.width", "it moves the mesh"),
        ("frction.delta", "did you mean 'friction.delta'"),
        ("E, material.E", "is given twice"),
        ("boundary.top.g_x, theta", "there is no derivative by theta: of this study it is"),
        ("friction.tau", "there is no derivative by friction.tau: of this study"),
    ],
)
def test_what_cannot_be_differentiated_is_refused(names: str, said: str) -> None:
    with pytest.raises(StudyError, match=r"output\.sensitivity") as info:
        asking(BRACKET, names)
    assert said in str(info.value)


def test_units_of_quotients() -> None:
    units = [quotient(*pair) for pair in (("N m-1", "W m-2 K-1"), ("m", "1"), ("1", "1"))]
    assert units == ["N m-1 W-1 m2 K", "m", "1"]
