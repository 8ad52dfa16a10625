"""Where two contact edges meet: the node's cell has its parts of both laws, so that quadrature is of second order."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import scipy.optimize
import xarray as xr
from numpy.typing import NDArray

import tcstudy
from tcstudy.contact.solve import solve_contact
from tcstudy.data.schema import name_of
from tcstudy.fem.meshes import Meshes
from tcstudy.laws.laws import Laws
from tcstudy.offline.level import Level
from tcstudy.read.study import read_study_text
from tcstudy.scene.records import Scene
from tcstudy.study.point import derivatives_of

Array = NDArray[np.float64]
LINEAR, TRESCA = "{law: linear, k: 1}", "{law: tresca, tau: 0.2}"
FALLING = "{law: slip-weakening, tau_s: 0.3, tau_k: 0.1, delta: 1}"
QUICK, SLOW = "{law: exponential, a: 0.3, b: 0.1, delta: 0.3}", "{law: exponential, a: 0.2, b: 0.1, delta: 0.5}"
PAIRS = ((LINEAR, TRESCA), (FALLING, SLOW), (QUICK, SLOW))


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
    """A block between rollers, sheared from above, so that all of Γ_C slips; two films meet under it."""
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
        np.testing.assert_allclose(tree.dataset["friction_resultant"], 0.3 * 0.2 + 0.7 * 0.05, rtol=1e-12)
        for level in range(3):
            line = tree[f"level_{level}"].dataset
            node, share = int(line["joint_node"][0]), float(line["joint_share"][0])
            assert line["joint_edge"].attrs["flag_meanings"].split()[int(line["joint_edge"][0])] == "film"
            assert float(line["xi"][node]) == pytest.approx(share * 0.2 + (1 - share) * 0.05, rel=1e-12)
            before = float(line["x"][node] - line["x"][node - 1])
            assert share * float(line["c"][node]) == pytest.approx(0.5 * before, rel=1e-9)


@pytest.mark.parametrize(("film", "shoe"), PAIRS)
def test_the_least_energy_is_that_of_a_sum_over_the_halves_of_segments(film: str, shoe: str) -> None:
    """Minimised by SciPy, friction summed segment by segment with the law of its edge."""
    level, scene = level_of(block(film, shoe, 0.3))
    problem, line = level.condensed(scene).problem, level.line
    laws = dict(zip(("film", "shoe"), scene.laws, strict=True))
    middles = line.ends.mean(axis=1)

    def energy(v: Array) -> float:
        friction = 0.0
        for nodes, ends, middle in zip(line.unknowns, line.ends, middles, strict=True):
            law = laws["film" if middle[0] < 0.5 else "shoe"]
            friction += 0.5 * float(np.linalg.norm(ends[1] - ends[0])) * float(np.sum(law.j(v[nodes])))
        return float(0.5 * v @ problem.A_tilde @ v - problem.l_tilde @ v) + friction

    assert np.all(line.unknowns >= 0)
    answer = solve_contact(problem)
    found = scipy.optimize.minimize(energy, np.full(line.m, 0.5), method="BFGS", options={"gtol": 1e-9})
    np.testing.assert_allclose(answer.v, found.x, atol=1e-5)
    assert energy(answer.v) == pytest.approx(answer.energy, abs=1e-7)
    assert energy(answer.v) <= found.fun + 1e-7


def test_a_ring_of_two_edges_has_two_joints() -> None:
    """A hole whose halves are two films; materials differ on both sides, which weighs nothing."""
    text = (
        block(FALLING, TRESCA)
        .replace("film: contact, shoe: contact, top", "film: free, shoe: free, upper: contact, lower: contact, top")
        .replace("friction: {film", "friction: {upper")
        .replace("shoe: {law: tr", "lower: {law: tr")
    )
    hole = (
        "holes: [{outline: [{from: [0.3, 0.5], through: [0.5, 0.3], edge: lower}, {from: [0.7, 0.5], through: "
        "[0.5, 0.7], edge: upper}]}], regions: {stiff: {rectangle: {corner: [0.75, 0], width: 0.25, height: 1}}}}"
    )
    text = text.replace("edge: left}]}", f"edge: left}}], {hole}") + "materials: {stiff: {lambda: 6, mu: 4}}\n"
    level, scene = level_of(text)
    joints, line = level.line.joints, level.line
    assert sorted(line.xy[joints.node, 0].tolist()) == pytest.approx([0.3, 0.7])
    assert np.all(np.abs(joints.share - 0.5) < 0.1)
    law = level.law(scene)
    assert isinstance(law, Laws)
    for node, edge, share in zip(*joints, strict=True):
        own, before = (scene.laws[("upper", "lower").index(line.edge_names[k])] for k in (line.edge[node], edge))
        assert law.single(int(node)).b(0.3) == pytest.approx(share * before.b(0.3) + (1 - share) * own.b(0.3))


def test_derivatives_by_the_law_of_an_edge_are_those_of_differences() -> None:
    path, value, h = "friction.film.delta", 1.0, 1e-4
    study = read_study_text(block(FALLING, SLOW) + f"output: {{sensitivity: [{path}]}}\n")
    level = Level(Meshes(study).next(0), study.scenes[0])
    scenes = [level_of(block(FALLING, SLOW), f"{path}={value * (1 + sign * h)!r}")[1] for sign in (1, -1)]
    v = solve_contact(level.condensed(study.scenes[0]).problem).v
    found = derivatives_of(level, study.scenes[0], v, study.output.sensitivity)
    problems = [level.condensed(scene).problem for scene in scenes]
    solved = [(problem, solve_contact(problem, branch="continued", neighbour=v)) for problem in problems]
    for quantity, ends in (
        ("energy", [answer.energy for _, answer in solved]),
        ("friction_resultant", [float(problem.xi(answer.v).sum()) for problem, answer in solved]),
    ):
        difference = (ends[0] - ends[1]) / (2 * h * value)
        assert found[name_of(quantity, path)] == pytest.approx(difference, rel=1e-6), quantity
