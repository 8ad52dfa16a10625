"""Damage of openings: what has broken stays broken, and faces that close carry pressure."""

import numpy as np
import pytest

from tcstudy.contact.history.memory import HistoryProblem, MemoryModel
from tcstudy.contact.history.steps import history
from tcstudy.contact.problem import CondensedBody
from tcstudy.laws.laws import Laws
from tcstudy.matrices import law, opening
from tcstudy.scene.histories import HistoryBranch, Memory, UnfitLaw

BOND = law("bilinear", tau=1.0, s0=0.1, sf=0.3)
DAMAGE = Memory("damage")
LIFTED = (0.05, 0.14, 0.02, -0.5, 0.14, 0.18, 0.5, 0.0, 0.2)
"""Displacements of a spring of stiffness 10 Pa/m above one node, c = 1 m."""


def softened(s: float) -> float:
    """The virgin traction b(s)."""
    return 10.0 * s if s <= 0.1 else max(0.0, 5.0 * (0.3 - s))


def expected(bond: Laws, k_c: float) -> list[tuple[float, float, float]]:
    """(opening, traction, dissipated) of 10 (d − s) = b(s; κ) at every displacement, step by step."""
    kappa, states = 0.1, []
    total = 0.0
    for d in LIFTED:
        secant = softened(kappa) / kappa
        s = 10.0 * d / (10.0 + secant)
        if s > kappa:
            s = (10.0 * d - 1.5) / 5.0 if 10.0 * d <= 3.0 else d
        if s < 0.0:
            s = 0.0 if np.isinf(k_c) else 10.0 * d / (10.0 + k_c)
        grown = max(kappa, s)
        for end, sign in ((min(grown, 0.3), 1.0), (min(kappa, 0.3), -1.0)):
            whole = 0.05 + 0.5 * (1.0 + softened(end)) * (end - 0.1)
            total += sign * (whole - 0.5 * softened(end) * end)
        kappa = grown
        states.append((s, 10.0 * (d - s), total))
    return states


@pytest.mark.parametrize("branch", ["continued", "lowest"])
@pytest.mark.parametrize("closing", [np.inf, 40.0])
def test_a_bond_keeps_its_damage_and_closes(branch: HistoryBranch, closing: float) -> None:
    body = CondensedBody.known(np.full((1, 1), 10.0), np.ones(1))
    model = MemoryModel(DAMAGE, opening(BOND, closing), 1)
    loads = [np.array([10.0 * d]) for d in LIFTED]
    steps = list(history(HistoryProblem(body, model, branch), loads))
    total = 0.0
    for step, (s, traction, dissipated) in zip(steps, expected(BOND, closing), strict=True):
        total += step.dissipated
        assert step.v[0] == pytest.approx(s, abs=1e-12)
        assert step.xi[0] == pytest.approx(traction, abs=1e-11)
        assert total == pytest.approx(dissipated, abs=1e-12)
        if branch == "continued":
            assert abs(step.closure) < 1e-12


def test_closed_faces_store_no_energy_on_a_ray_and_that_of_their_layer() -> None:
    body = CondensedBody.known(np.full((1, 1), 10.0), np.ones(1))
    for closing, energy in ((np.inf, 0.0), (40.0, 0.5 * 40.0 * 0.1**2)):
        model = MemoryModel(DAMAGE, opening(BOND, closing), 1)
        (step,) = history(HistoryProblem(body, model), [np.array([-5.0])])
        assert step.stored == pytest.approx(energy)
        assert step.kappa[0] == 0.0


def test_memories_of_slips_are_refused_for_openings() -> None:
    for memory in (Memory("friction"), Memory("elastic-plastic", 100.0)):
        with pytest.raises(UnfitLaw, match="damage"):
            MemoryModel(memory, opening(BOND), 1)
    names = np.array(["friction", "damage"])
    laws = Laws.of([law("tresca", tau=1.0), opening(BOND)], [0, 1])
    mixed = MemoryModel(Memory("friction"), laws, 2, names)
    np.testing.assert_array_equal(mixed.is_opening, [False, True])


def test_friction_and_damage_go_on_side_by_side() -> None:
    """A node that slips beside one that opens, uncoupled: each as if it were alone."""
    names = np.array(["friction", "damage"])
    laws = Laws.of([law("tresca", tau=1.0), opening(BOND)], [0, 1])
    both = MemoryModel(Memory("friction"), laws, 2, names)
    body = CondensedBody.known(np.diag([10.0, 10.0]), np.ones(2))
    loads = [10.0 * np.array([0.3 if n % 2 else -0.3, d]) for n, d in enumerate(LIFTED)]
    steps = list(history(HistoryProblem(body, both), loads))
    assert len(steps) == len(LIFTED)
    for n, (step, (s, _, _)) in enumerate(zip(steps, expected(BOND, np.inf), strict=True)):
        assert step.v[1] == pytest.approx(s, abs=1e-12)
        assert step.v[0] == pytest.approx(0.2 if n % 2 else -0.2, abs=1e-12)
