"""Laws of their own on two edges: a node where they meet has its parts of both; closed forms, a
chosen solution."""

from pathlib import Path

import numpy as np
import pytest
import scipy.optimize
import xarray as xr
from numpy.typing import NDArray

import tcstudy
from tcstudy.contact.solve import solve_contact
from tcstudy.errors import StudyError
from tcstudy.fem.meshes import Meshes
from tcstudy.laws.laws import Laws
from tcstudy.offline.level import Level
from tcstudy.read.study import read_study_text
from tcstudy.scene.records import Scene
from tests.commands import CONFIGS

Array = NDArray[np.float64]
LINEAR, TRESCA = "{law: linear, k: 1}", "{law: tresca, tau: 0.2}"
FALLING = "{law: slip-weakening, tau_s: 0.3, tau_k: 0.1, delta: 1}"
QUICK, SLOW = (
    "{law: exponential, a: 0.3, b: 0.1, delta: 0.3}",
    "{law: exponential, a: 0.2, b: 0.1, delta: 0.5}",
)

BLOCK = """
units: none
body: {outline: [{from: [0, 0], edge: film}, {from: [CUT, 0], edge: shoe}, {from: [1, 0], edge: right},
  {from: [1, 1], edge: top}, {from: [0, 1], edge: left}]}
boundary: {film: contact, shoe: contact, top: {role: clamped, u_x: 0.8, u_y: 0}, left: {role: clamped, u_y: 0},
  right: {role: clamped, u_y: 0}}
material: {lambda: 1.5, mu: 1}
friction: {film: FILM, shoe: SHOE}
mesh: {maxh: MAXH, levels: LEVELS}
"""


def block(film: str, shoe: str, maxh: float = 0.25, levels: int = 1, cut: float = 0.5) -> str:
    """A block between rollers, sheared from above, so that all of Γ_C slips; two films meet under
    it."""
    text = BLOCK.replace("CUT", str(cut)).replace("MAXH", str(maxh)).replace("LEVELS", str(levels))
    return text.replace("FILM", film).replace("SHOE", shoe)


def level_of(text: str, *overrides: str) -> tuple[Level, Scene]:
    """The first level of a study, and its first scene."""
    study = read_study_text(text, "study", list(overrides))
    return Level(Meshes(study).next(0), study.scenes[0]), study.scenes[0]


def test_the_resultant_of_two_bonds_that_slip_is_exact_on_every_mesh(tmp_path: Path) -> None:
    text = block(TRESCA, "{law: tresca, tau: 0.05}", 0.3, levels=3, cut=0.3)
    tcstudy.run(read_study_text(text), tmp_path / "out.nc")
    with xr.open_datatree(tmp_path / "out.nc") as tree:
        np.testing.assert_allclose(
            tree.dataset["friction_resultant"], 0.3 * 0.2 + 0.7 * 0.05, rtol=1e-12
        )
        for level in range(3):
            line = tree[f"level_{level}"].dataset
            node, share = int(line["joint_node"][0]), float(line["joint_share"][0])
            assert (
                line["joint_edge"].attrs["flag_meanings"].split()[int(line["joint_edge"][0])]
                == "film"
            )
            assert float(line["xi"][node]) == pytest.approx(
                share * 0.2 + (1 - share) * 0.05, rel=1e-12
            )
            before = float(line["x"][node] - line["x"][node - 1])
            assert share * float(line["c"][node]) == pytest.approx(0.5 * before, rel=1e-9)


@pytest.mark.parametrize(("film", "shoe"), [(LINEAR, TRESCA), (FALLING, SLOW), (QUICK, SLOW)])
def test_the_least_energy_is_that_of_a_sum_over_the_halves_of_segments(
    film: str, shoe: str
) -> None:
    """Minimised by SciPy, friction summed segment by segment with the law of its edge."""
    level, scene = level_of(block(film, shoe, 0.3))
    problem, line = level.condensed(scene).problem, level.line
    laws = dict(zip(("film", "shoe"), scene.laws, strict=True))
    middles = line.ends.mean(axis=1)

    def energy(v: Array) -> float:
        friction = 0.0
        for nodes, ends, middle in zip(line.unknowns, line.ends, middles, strict=True):
            law = laws["film" if middle[0] < 0.5 else "shoe"]
            friction += (
                0.5 * float(np.linalg.norm(ends[1] - ends[0])) * float(np.sum(law.j(v[nodes])))
            )
        return float(0.5 * v @ problem.A_tilde @ v - problem.l_tilde @ v) + friction

    assert np.all(line.unknowns >= 0)
    answer = solve_contact(problem)
    found = scipy.optimize.minimize(
        energy, np.full(line.m, 0.5), method="BFGS", options={"gtol": 1e-9}
    )
    np.testing.assert_allclose(answer.v, found.x, atol=1e-5)
    assert energy(answer.v) == pytest.approx(answer.energy, abs=1e-7)
    assert energy(answer.v) <= found.fun + 1e-7


def test_a_ring_of_two_edges_has_two_joints() -> None:
    """A hole whose halves are two films; materials differ on both sides, which weighs nothing."""
    roles = "film: free, shoe: free, upper: contact, lower: contact, top"
    text = block(FALLING, TRESCA).replace("film: contact, shoe: contact, top", roles)
    text = text.replace("friction: {film", "friction: {upper").replace(
        "shoe: {law: tr", "lower: {law: tr"
    )
    hole = (
        "holes: [{outline: [{from: [0.3, 0.5], through: [0.5, 0.3], edge: lower}, {from: [0.7, 0.5], through: "
        "[0.5, 0.7], edge: upper}]}], regions: {stiff: {rectangle: {corner: [0.75, 0], width: 0.25, height: 1}}}}"
    )
    text = (
        text.replace("edge: left}]}", f"edge: left}}], {hole}")
        + "materials: {stiff: {lambda: 6, mu: 4}}\n"
    )
    level, scene = level_of(text)
    joints, line = level.line.joints, level.line
    assert sorted(line.xy[joints.node, 0].tolist()) == pytest.approx([0.3, 0.7])
    assert np.all(np.abs(joints.share - 0.5) < 0.1)
    law = level.law(scene)
    assert isinstance(law, Laws)
    for node, edge, share in zip(*joints, strict=True):
        own, before = (
            scene.laws[("upper", "lower").index(line.edge_names[k])]
            for k in (line.edge[node], edge)
        )
        assert law.single(int(node)).b(0.3) == pytest.approx(
            share * before.b(0.3) + (1 - share) * own.b(0.3)
        )


D, SHOE = 80e6, 0.05
"""Stiffness of the strip [N] per metre of width and length of the shoe [m]."""


def test_two_films_and_a_gap_have_the_closed_form(tmp_path: Path) -> None:
    tree = tcstudy.run(tcstudy.load(CONFIGS / "two_films.yaml", ["path=null"]), tmp_path / "a.nc")
    data = tree.dataset.isel(level=-1)
    assert np.all(data["status"] == 1)
    for tau_f in (1.5e6, 2e6, 4e6):
        for strength in (0.0, 0.5, 1.0):
            point = data.sel(tau=tau_f, strength=strength)
            tau_s = strength * 1e6
            half = D * 1e-4 - 0.5 * tau_s * SHOE**2  # = tau_f (l²/2 + 50 mm l)
            length = -SHOE + np.sqrt(SHOE**2 + 2.0 * half / tau_f)
            assert float(point["slip_length"]) == pytest.approx(SHOE + length, abs=2.5e-3)
            assert float(point["friction_resultant"]) == pytest.approx(
                tau_f * length + tau_s * SHOE, rel=0.01
            )
    line = tree["level_1"].dataset
    assert {"film", "shoe"} <= set(str(line["edge"].attrs["flag_meanings"]).split())


HEAD = BLOCK.partition("boundary:")[0].replace("CUT", "0.5")
CHOSEN = (
    HEAD
    + """\
boundary: {film: contact, shoe: contact, top: clamped, left: {role: traction}, right: {role: traction}}
material: {lambda: 1.5, mu: 1}
friction:
  film: {law: slip-weakening, tau_s: 1, tau_k: 0.4, delta: 1}
  shoe: {law: tresca, tau: 2, strength: "0.41 - 0.06*sin(pi*x)"}
mesh: {maxh: 0.25, levels: 5}
exact: {u: ["y + (1 - 0.6*y)*(0.3 + 0.2*sin(pi*x))", "0.1*y*cos(pi*x)"], loads: derived}
"""
)


def test_a_chosen_solution_of_two_laws_is_met_at_the_orders_of_theory(tmp_path: Path) -> None:
    """ξ = 1 − 0.6 u_T on all of Γ_C: a falling law on the film, a strength that varies along the
    shoe."""
    data = tcstudy.converge(read_study_text(CHOSEN), tmp_path / "out.nc").to_dataset()
    assert np.all(data["status"] == 1)
    for name, order in (("u_energy", 1.0), ("u_L2", 2.0), ("u_T_L2", 2.0), ("xi_L2", 1.0)):
        assert float(data[f"slope_{name}"]) == pytest.approx(order, abs=0.15), name
    mean = 0.3 + 0.2 * 2.0 / np.pi
    assert float(data["exact_friction_resultant"]) == pytest.approx(1.0 - 0.6 * mean, rel=1e-9)
    assert float(data["exact_slip_length"]) == pytest.approx(1.0)
    assert float(data["limit_friction_resultant"]) == pytest.approx(1.0 - 0.6 * mean, rel=1e-4)
    before, last = abs(data["value_energy"].values - float(data["exact_energy"]))[-2:]
    assert (
        3.8 < before / last < 4.2
    )  # the nodes' quadrature, of second order also where the films meet
    with pytest.raises(
        StudyError, match=r"the friction law does not hold on shoe: .* but b\(u_T\) is 1;"
    ):
        read_study_text(CHOSEN.replace("0.41 - 0.06*sin(pi*x)", "0.5"))
