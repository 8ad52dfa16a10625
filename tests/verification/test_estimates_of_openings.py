"""Estimated against true errors where edges lift off: a slab, a block, an arm on its bond."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from tcstudy.data.records import BlockRecord, LevelRecord
from tcstudy.errors import StudyError
from tcstudy.read.study import read_study, read_study_text
from tcstudy.scene.study import Study
from tcstudy.study.reference import FineReference, solve_levels
from tcstudy.study.run import run
from tests.commands import CONFIGS
from tests.study.test_convergence_of_openings import SLAB as CURLED

Array = NDArray[np.float64]

SLAB = CURLED.replace("levels: 4", "levels: 3")
BLOCK = """
units: none
body: {rectangle: {width: 1, height: 0.5}}
boundary:
  bottom: {role: contact, normal: unilateral}
  left: symmetry
  top: {role: traction, pressure: "max(0, 1 - 4*x)^2"}
  right: free
material: {E: 100, nu: 0.3, plane: strain}
mesh: {maxh: 0.15, levels: 3}
"""
ARM = """
body:
  outline: [{from: [0 mm, 0 mm], edge: crack}, {from: [30 mm, 0 mm], edge: bond},
    {from: [62 mm, 0 mm], edge: right}, {from: [62 mm, 1.5 mm], edge: top},
    {from: [0 mm, 1.5 mm], edge: left}]
boundary: {bond: contact, crack: free, top: free, right: clamped,
  left: {role: clamped, u_x: free, u_y: 1.884875 mm}}
material: {E: 70 GPa, nu: 0, plane: stress}
adhesion: {law: bilinear, sigma: 20 MPa, s0: 4 um, sf: 14 um, closing: 5e12 Pa/m}
mesh: {maxh: 0.375 mm, levels: 2}
"""
SPLIT = ARM.replace(
    "adhesion: {law: bilinear, sigma: 20 MPa, s0: 4 um, sf: 14 um, closing: 5e12 Pa/m}",
    "friction: {law: bilinear, tau: 20 MPa, s0: 8 um, sf: 30 um}",
).replace("bond: contact", "bond: {role: contact, normal: free}")


def estimates(study: Study) -> list[float]:
    """The estimated relative error of every level."""
    study = replace(study, mesh=replace(study.mesh, estimate=True))
    blocks = [record for record in run(study) if isinstance(record, BlockRecord)]
    return [float(block.numbers["error_estimate"][0]) for block in blocks]


@pytest.mark.parametrize(
    ("text", "finer"),
    [(SLAB, 2), (BLOCK, 2), (ARM, 2), (SPLIT, 2)],
    ids=["slab", "block", "arm", "split"],
)
def test_estimates_are_close_to_errors_against_a_finer_solution(text: str, finer: int) -> None:
    """Between 0.85 and 1.3 of ‖u_ref − u_h‖_a/‖u_ref‖_a, u_ref of at least 16 times the unknowns."""
    study = read_study_text(text)
    count = study.mesh.levels
    levels = solve_levels(replace(study, mesh=replace(study.mesh, levels=count + finer)))
    reference = FineReference(levels[-1], nested=True)
    for level, estimate in zip(levels, estimates(study), strict=False):
        error, norm = reference.errors(level, (), study.scenes[0])["u_energy"]
        assert 0.85 < estimate / (error / norm) < 1.3


def test_adaptive_meshes_end_at_their_tolerance_with_a_crack_of_the_right_length() -> None:
    """A beam on its bond has a crack of 36 mm; few cells far from it are as small as beside it."""
    study = read_study_text(ARM, "arm", ["mesh={maxh: 0.75 mm, max_levels: 12, tolerance: 0.15}"])
    records = list(run(study))
    last = [record for record in records if isinstance(record, LevelRecord)][-1]
    block = [record for record in records if isinstance(record, BlockRecord)][-1]
    assert last.stop.startswith("tolerance 0.15 met")
    assert float(block.numbers["error_estimate"][0]) <= 0.15
    assert float(block.numbers["debonded_length"][0]) == pytest.approx(6e-3, abs=0.1e-3)
    cells = last.fields["c_N"]
    x = last.fields["opening_x"]
    assert np.median(cells[x < 40e-3]) < np.median(cells[x > 50e-3])


def test_a_column_has_no_error_to_estimate() -> None:
    text = """
units: none
body: {rectangle: {width: 1, height: 1}}
boundary: {bottom: contact, top: {role: clamped, u_x: 0, u_y: 0.5}, left: free, right: free}
material: {E: 1, nu: 0, plane: stress}
adhesion: {law: bilinear, sigma: 1, s0: 0.1, sf: 0.3}
mesh: {maxh: 0.8, levels: 2}
"""
    assert max(estimates(read_study_text(text))) < 1e-12
    pressed = text.replace("u_y: 0.5", "u_y: -0.5")
    assert max(estimates(read_study_text(pressed))) < 1e-12


def test_friction_that_follows_the_pressure_has_no_estimate() -> None:
    with pytest.raises(StudyError, match="estimated in energy, and friction that follows"):
        read_study(CONFIGS / "pressed_plate.yaml", ["mesh.estimate=true"])
