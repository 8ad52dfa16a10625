"""Lengths of a law's regions along the contact line against slips sampled densely, for one law and for laws by edge."""

from __future__ import annotations

import numpy as np
import pytest

from tcstudy.laws.composed import EdgeLaws, row_laws
from tcstudy.laws.pieces import REGIONS, UP
from tcstudy.offline.level import Level
from tcstudy.offline.line_numbers import region_lengths
from tests.verification.scenes import levels_of, study_of

STRIP = """
body: {outline: [{from: [0, 0], edge: left_half}, {from: [1, 0], edge: right_half}, {from: [2, 0], edge: end},
                 {from: [2, 1], edge: top}, {from: [0, 1], edge: back}]}
boundary:
  {left_half: contact, right_half: contact, end: {role: clamped, u_x: 1.5, u_y: free}, top: free, back: free}
material: {E: 1, nu: 0.3, plane: strain}
friction: FRICTION
mesh: {maxh: 0.2}
units: none
"""
LAWS = {
    "bilinear": ("{law: bilinear, tau: 1, s0: 0.3, sf: 0.9}", "{law: bilinear, tau: 1, s0: 0.3, sf: 0.9}"),
    "two edges": ("{law: slip-weakening, tau_s: 1, tau_k: 0.2, delta: 0.5}", "{law: elastic-plastic, tau: 1, s0: 0.4}"),
}


@pytest.mark.parametrize("friction", LAWS.values(), ids=LAWS.keys())
def test_lengths_are_those_of_slips_between_the_nodes(friction: tuple[str, str]) -> None:
    """10,000 slips a segment, each in the region of the piece of its edge's law that holds it."""
    text = f"{{left_half: {friction[0]}, right_half: {friction[1]}}}"
    study = study_of(STRIP.replace("FRICTION", text))
    scene = study.scenes[0]
    level: Level = levels_of(study)[-1]
    line, random = level.line, np.random.default_rng(4)
    v = np.cumsum(random.uniform(-0.5, 0.5, (3, line.m)), axis=1)
    v[0, : line.m // 2] = 0.0
    found = region_lengths(
        level, row_laws([level.law(scene)] * 3, np.ones(3)), v, np.tile(level.held_slips(scene), (3, 1))
    )
    assert isinstance(scene.friction, EdgeLaws)
    known = {name: law for name, law, _ in scene.friction.laws}
    at = (np.arange(10_000) + 0.5) / 10_000
    for row, slips in enumerate(v):
        lengths = dict.fromkeys(REGIONS, 0.0)
        moving = 0.0
        for (i, j), ends, width in zip(line.unknowns, line.ends, line.lengths, strict=True):
            first, second = (slips[k] if k >= 0 else 1.5 for k in (i, j))
            law = known["left_half" if ends[:, 0].mean() < 1 else "right_half"]
            if first == second == 0.0 and law.kind_at(np.zeros(1)) == UP:
                continue
            moving += width
            s = first + at * (second - first)
            which, count = np.unique(law.regions[law.piece(s)], return_counts=True)
            for k, n in zip(which, count, strict=True):
                lengths[REGIONS[k]] += width * n / 10_000
        for name, length in lengths.items():
            if length:
                assert found[f"{name}_length"][row] == pytest.approx(length, abs=2e-3), name
        whole = np.nansum([length[row] for name, length in found.items() if name != "breathing_length"])
        assert whole == pytest.approx(moving, rel=1e-12)
