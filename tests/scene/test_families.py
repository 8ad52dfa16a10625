"""Families of meshes: which of them follow from solutions."""

from __future__ import annotations

import pytest

from tcstudy.scene.study import MeshPlan


@pytest.mark.parametrize(
    ("plan", "open_ended", "estimates"),
    [
        (MeshPlan((0.5,), 2), False, False),
        (MeshPlan((0.5,), 2, estimate=True), False, True),
        (MeshPlan((0.5,), 2, "graded", tolerance=1e-2), True, True),
        (MeshPlan((0.5,), 2, "adaptive"), True, True),
        (MeshPlan((0.5, 0.2), 2), False, False),
    ],
)
def test_what_follows_from_solutions_needs_estimates(plan: MeshPlan, open_ended: bool, estimates: bool) -> None:
    assert (plan.open_ended, plan.estimates) == (open_ended, estimates)
