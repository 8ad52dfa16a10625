"""Many scenes condensed at once: the numbers of each alone, to the bit, whatever else is in the block."""

from __future__ import annotations

from itertools import groupby
from pathlib import Path

import numpy as np
import pytest

import tcstudy
from tcstudy.fem.geometry import build
from tcstudy.fem.meshes import mesh_at
from tcstudy.offline.level import Level
from tcstudy.scene.study import Study

QUICKSTART = Path(__file__).parents[2] / "configs" / "quickstart.yaml"
SWEEPS = {
    "heat": "sweep={alpha: [25, 50, 100, 400], theta_bar: [0, 10], q: [0, 5e6]}",
    "stiffness": "sweep={E: [1 GPa, 3 GPa], nu: [0.2, 0.3], theta_bar: [5, 10]}",
    "cold": "sweep={alpha_T: [0, 12e-6], friction.delta: [10 um, 50 um]}",
}


def level_of(study: Study) -> Level:
    scene = study.scenes[0]
    return Level(mesh_at(build(scene.body), study.mesh, 0, None), scene, study.scenes)


@pytest.mark.parametrize("sweep", SWEEPS)
def test_a_block_has_the_numbers_of_its_scenes(sweep: str) -> None:
    study = tcstudy.load(QUICKSTART, [SWEEPS[sweep]])
    level = level_of(study)
    for _, group in groupby(sorted(study.scenes, key=Level.ratio), Level.ratio):
        scenes = list(group)
        block = level.block(scenes)
        for i, scene in enumerate(scenes):
            one = level.condensed(scene)
            np.testing.assert_array_equal(block.l_tilde[i], one.problem.l_tilde)
            np.testing.assert_allclose(block.mu[i] * block.A_tilde, one.problem.A_tilde, rtol=1e-15)
            assert block.constant[i] == one.constant
            assert block.mu[i] * block.lambda_1 == pytest.approx(level.lambda_1(scene), rel=1e-14)
            if scene.material.beta:
                assert block.theta_mean[i] == level.temperature(scene).mean
            else:
                assert np.isnan(block.theta_mean[i])


def test_a_scene_has_the_same_bits_in_any_block() -> None:
    study = tcstudy.load(QUICKSTART, [SWEEPS["heat"]])
    level = level_of(study)
    whole, part = level.block(study.scenes), level.block(study.scenes[5:8][::-1])
    np.testing.assert_array_equal(part.l_tilde[::-1], whole.l_tilde[5:8])
    np.testing.assert_array_equal(part.heat_balance[::-1], whole.heat_balance[5:8])


def test_scenes_of_two_ratios_are_no_block() -> None:
    study = tcstudy.load(QUICKSTART, ["sweep={nu: [0.2, 0.3]}"])
    with pytest.raises(ValueError, match="differ in"):
        level_of(study).block(study.scenes)
