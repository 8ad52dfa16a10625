"""Scenes condensed at once have the numbers of each alone, also for a page that solves them;
lengths of regions."""

from itertools import groupby

import numpy as np
import pytest

import tcstudy
from tcstudy.laws.composed import EdgeLaws, row_laws
from tcstudy.laws.pieces import REGIONS
from tcstudy.offline import level as offline
from tcstudy.offline.level import Level
from tcstudy.offline.requested_outputs import region_lengths
from tests.verification.scenes import QUICKSTART, levels_of, study_of

SWEEPS = {
    "heat": "sweep={alpha: [25, 50, 100, 400], theta_bar: [0, 10], q: [0, 5e6]}",
    "stiffness": "sweep={E: [1 GPa, 3 GPa], nu: [0.2, 0.3], theta_bar: [5, 10]}",
    "cold": "sweep={alpha_T: [0, 12e-6], friction.delta: [10 um, 50 um]}",
}


@pytest.mark.parametrize("sweep", SWEEPS)
def test_a_block_has_the_numbers_of_its_scenes_to_the_bit_in_any_block(sweep: str) -> None:
    study = tcstudy.load(QUICKSTART, [SWEEPS[sweep], "mesh.levels=1"])
    level = Level(levels_of(study)[0].mesh, study.scenes[0], study.scenes)
    for _, group in groupby(sorted(study.scenes, key=Level.ratio), Level.ratio):
        scenes = list(group)
        block = level.block(scenes)
        for i, scene in enumerate(scenes):
            one = level.condensed(scene)
            np.testing.assert_array_equal(block.l_tilde[i], one.problem.l_tilde)
            np.testing.assert_allclose(block.mu[i] * block.A_tilde, one.problem.A_tilde, rtol=1e-15)
            assert block.constant[i] == one.constant
            assert block.mu[i] * block.lambda_1 == pytest.approx(level.lambda_1(scene), rel=1e-14)
            mean = level.temperature(scene).mean if scene.material.beta else np.nan
            np.testing.assert_array_equal(block.theta_mean[i], mean)
        part = level.block(scenes[1:4][::-1])
        np.testing.assert_array_equal(part.l_tilde[::-1], block.l_tilde[1:4])
        np.testing.assert_array_equal(part.heat_balance[::-1], block.heat_balance[1:4])
    if sweep == "stiffness":
        with pytest.raises(ValueError, match="differ in"):
            level.block(study.scenes)


LIVE = """
body: {outline: [{from: [0, 0], edge: film}, {from: [0.2, 0], edge: end}, {from: [0.2, 0.1], edge: top},
                 {from: [0, 0.1], edge: back}]}
boundary: {film: contact, back: {role: clamped, u_x: 10 um, u_y: 0 m}, top: convection,
           end: {role: traction, g: [3 MPa, 0]}}
material: {E: 210 GPa, nu: 0.3, k: 45, alpha_T: 12e-6}
heat: {alpha: 200, theta_bar: "10 + 50*x", q: 5e5}
friction: {law: tresca, tau: 40 MPa}
mesh: {maxh: 40 mm, levels: 1}
sweep: {nu: [0.3, 0.2], alpha: [400, 100, 200]}
output: {live: true}
"""


def test_a_page_gets_the_problems_of_the_points_that_share_the_elastic_ratio(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    study = study_of(LIVE)
    level = Level(levels_of(study)[0].mesh, study.scenes[0], study.scenes)
    live = offline.live_arrays(level, study.scenes, study.shape)
    valid = live["valid"].ravel()
    assert [
        scene.material.nu for scene, one in zip(study.scenes, valid, strict=True) if one
    ] == 3 * [0.3]
    for i in np.flatnonzero(valid):
        problem = level.condensed(study.scenes[i]).problem
        load = live["load"].reshape(len(valid), -1)[i]
        np.testing.assert_array_equal(
            live["stiffness"].ravel()[i] * live["A_tilde"], problem.A_tilde
        )
        np.testing.assert_array_equal(load, problem.l_tilde)
        assert (
            0.0 < abs(live["mechanical_load"].reshape(len(valid), -1)[i].sum() / load.sum()) < 1.0
        )
    monkeypatch.setattr(offline, "MAX_LIVE_NODES", level.line.m - 1)
    assert offline.live_arrays(level, study.scenes, study.shape) == {}


STRIP = """
body: {outline: [{from: [0, 0], edge: left_half}, {from: [1, 0], edge: right_half}, {from: [2, 0], edge: end},
                 {from: [2, 1], edge: top}, {from: [0, 1], edge: back}]}
boundary:
  {left_half: contact, right_half: contact, end: {role: clamped, u_x: 1.5, u_y: free}, top: free, back: free}
material: {E: 1, nu: 0.3, plane: strain}
friction: {left_half: FIRST, right_half: SECOND}
mesh: {maxh: 0.2, levels: 1}
units: none
"""
BILINEAR = "{law: bilinear, tau: 1, s0: 0.3, sf: 0.9}"
WEAKENING = "{law: slip-weakening, tau_s: 1, tau_k: 0.2, delta: 0.5}"
PLASTIC = "{law: elastic-plastic, tau: 1, s0: 0.4}"


@pytest.mark.parametrize(("first", "second"), [(BILINEAR, BILINEAR), (WEAKENING, PLASTIC)])
def test_lengths_of_regions_are_those_of_slips_between_the_nodes(first: str, second: str) -> None:
    """10,000 slips a segment, each in the region of the piece of its edge's law that holds it."""
    scene = study_of(text := STRIP.replace("FIRST", first).replace("SECOND", second)).scenes[0]
    level = levels_of(study_of(text))[0]
    line, random = level.line, np.random.default_rng(4)
    v = np.cumsum(random.uniform(-0.5, 0.5, (3, line.m)), axis=1)
    v[0, : line.m // 2] = 0.0
    laws, held = (
        row_laws([level.law(scene)] * 3, np.ones(3)),
        np.tile(level.held_slips(scene), (3, 1)),
    )
    found = region_lengths(level, laws, v, held)
    assert isinstance(scene.friction, EdgeLaws)
    known = {name: law for name, law, _ in scene.friction.laws}
    at = (np.arange(10_000) + 0.5) / 10_000
    for row, slips in enumerate(v):
        lengths, moving = dict.fromkeys(REGIONS, 0.0), 0.0
        for (i, j), ends, width in zip(line.unknowns, line.ends, line.lengths, strict=True):
            start, end = (slips[k] if k >= 0 else 1.5 for k in (i, j))
            law = known["left_half" if ends[:, 0].mean() < 1 else "right_half"]
            if start == end == 0.0 and law.sticking(np.zeros(1)):
                continue
            moving += width
            which, count = np.unique(
                law.regions[law.piece(start + at * (end - start))], return_counts=True
            )
            for k, n in zip(which, count, strict=True):
                lengths[REGIONS[k]] += width * n / 10_000
        for name, length in lengths.items():
            if length:
                assert found[f"{name}_length"][row] == pytest.approx(length, abs=2e-3), name
        whole = np.nansum(
            [length[row] for name, length in found.items() if name != "breathing_length"]
        )
        assert whole == pytest.approx(moving, rel=1e-12)
