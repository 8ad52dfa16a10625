"""Rigid motions from the geometry against zero eigenvalues of the assembled stiffness, and their
words."""

import numpy as np
import pytest

from tcstudy.offline.level import Level
from tcstudy.read.study import read_study_text
from tests.verification.scenes import levels_of

BOX = """
units: none
body:
  outline: [{from: [0, 0], edge: bottom}, {from: [2, 0], edge: right}, {from: [2, 1], edge: top},
            {from: [0, 1], edge: left}]
boundary: {bottom: contact, right: free, top: free, left: free}
material: {E: 1, nu: 0.3}
friction: {law: tresca, tau: 1}
mesh: {maxh: 0.5}
"""
RING = BOX.replace(
    BOX[BOX.index("  outline") : BOX.index("boundary:")],
    "  outline: [{from: [5, 1], edge: rim, through: [3, 3]}, {from: [1, 1], edge: rim, through: [3, -1]}]\n"
    "  holes: [{circle: {center: [3, 1], radius: 1, edge: bore}}]\n",
).replace("bottom: contact, right: free, top: free, left: free", "bore: contact, rim: free")  # fmt: skip
UNILATERAL = "boundary.bottom={role: contact, normal: unilateral}"


@pytest.mark.parametrize(
    ("text", "changes", "words"),
    [
        (BOX, [], "slide along x"),
        (BOX, ["boundary.left=clamped"], ""),
        (BOX, ["boundary.left=symmetry"], ""),
        (BOX, ["boundary.left={role: traction, g: [0, 0], spring: {tangential: 1}}"], "slide along x"),
        (BOX, ["boundary.left={role: traction, g: [0, 0], spring: {normal: 1}}"], ""),
        (BOX, ["boundary.left={role: rigid, force: [1, 0], u_y: 0}"], "slide along x"),
        (BOX, [UNILATERAL], "slide along x or slide along y or turn about (0, 0)"),
        (BOX, [UNILATERAL, "boundary.left=symmetry"], "slide along y"),
        (BOX, [UNILATERAL, "boundary.left={role: clamped, u_x: 0, u_y: 0}"], ""),
        (BOX, [UNILATERAL, "boundary.top={role: rigid, u_x: 0, force: [0, 1]}"], "slide along y"),
        (BOX, [UNILATERAL, "boundary.top={role: traction, g: [0, 0], spring: {tangential: 1}}"],
         "turn about (0, 1) or slide along y"),
        (RING, [], "turn about (3, 1)"),
        (RING, ["boundary.rim={role: traction, g: [0, 0], spring: {tangential: 1}}"], ""),
    ],
)  # fmt: skip
def test_motions_are_the_null_space_of_the_stiffness(
    text: str, changes: list[str], words: str
) -> None:
    study = read_study_text(text, "box.yaml", changes)
    scene = study.scenes[0]
    level = Level(levels_of(study)[0].mesh, scene)
    motions = level.motions(scene)
    assert motions.words == words
    frames = level.frames
    moduli = tuple((where, material.lam, material.mu) for where, material in scene.pieces)
    stiffness = level.elastic.stiffness_of(moduli, frames)
    if scene.springs:
        stiffness = stiffness + level.elastic.springs(scene.springs, frames)
    if frames.ties is not None:
        stiffness = frames.ties.T @ stiffness @ frames.ties
    free = ~frames.fixed
    eigenvalues = np.linalg.eigvalsh(stiffness.toarray()[np.ix_(free, free)])
    assert np.count_nonzero(np.abs(eigenvalues) < 1e-10 * eigenvalues[-1]) == len(motions)
    for u in motions.at(level.mesh.points):
        forces = level.stiffness_times(scene, u.T.ravel())
        assert np.max(np.abs(forces)) < 1e-12 * np.max(np.abs(u)) * np.abs(eigenvalues[-1])
    for motion in level.contact_motions(scene):
        A_tilde = level.condensed(scene).problem.A_tilde
        assert np.max(np.abs(A_tilde @ motion)) < 1e-12 * np.max(np.abs(A_tilde))


def test_springs_on_chords_hold_what_those_of_an_arc_do_not() -> None:
    """Normal springs of a circle resist no turn, but those of its polygon do, as h²."""
    spring = "boundary.rim={role: traction, g: [0, 0], spring: {normal: 1}}"
    study = read_study_text(RING, "ring.yaml", [spring])
    level = Level(levels_of(study)[0].mesh, study.scenes[0])
    assert level.motions(study.scenes[0]).words == "turn about (3, 1)"
    assert level.is_held(study.scenes[0])
    assert 0.0 < level.lambda_1(study.scenes[0]) < 0.1
