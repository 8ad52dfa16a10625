"""Families of meshes: one record says all that is known of one, and nobody asks for its name."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

from tcstudy.scene.families import ADAPTIVE, FAMILIES, GRADED, LISTED, UNIFORM
from tcstudy.scene.study import MeshPlan

PACKAGE = Path(__file__).parents[2] / "tcstudy"


def test_a_plan_knows_its_family() -> None:
    assert [MeshPlan((0.5,), 2, name).strategy for name in FAMILIES] == [UNIFORM, GRADED, ADAPTIVE]
    assert all(family.name == name for name, family in FAMILIES.items())
    assert MeshPlan((0.5, 0.2), 2).strategy is LISTED


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


def test_no_module_compares_a_family_by_its_name() -> None:
    wrong = [
        f"{path.relative_to(PACKAGE)}:{node.lineno}"
        for path in PACKAGE.rglob("*.py")
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(node, ast.Compare)
        and any(isinstance(e, ast.Constant) and e.value in FAMILIES for e in node.comparators)
    ]
    assert not wrong
