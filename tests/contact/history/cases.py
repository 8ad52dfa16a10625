"""Bodies for load histories: a thin strip as in one-dimensional theory, and a coupled line as of a
plane body."""

import numpy as np
import pytest
from numpy.typing import NDArray

from tcstudy.contact.history.memory import HistoryProblem, HistoryStep, MemoryModel
from tcstudy.contact.history.steps import history
from tcstudy.contact.problem import CondensedBody
from tcstudy.laws.laws import Laws
from tcstudy.matrices import law
from tcstudy.scene.histories import HistoryBranch, Memory
from tests.contact import contact_cases as cases

Array = NDArray[np.float64]


def strip(
    cells: int, length: float, stiffness: float, held: bool = True
) -> tuple[Array, Array, Array]:
    """(Ã, c, l̃ for ε = 1) of a bar D u″ = b on `cells` cells, N = D (u′ − ε), its left end held or
    free.

    stiffness: D = E·H [N/m]
    """
    h = length / cells
    A = np.zeros((cells + 1, cells + 1))
    for i in range(cells):
        A[i : i + 2, i : i + 2] += stiffness / h * np.array([[1.0, -1.0], [-1.0, 1.0]])
    c = np.full(cells + 1, h)
    c[[0, -1]] = 0.5 * h
    heat = np.zeros(cells + 1)
    heat[0], heat[-1] = -stiffness, stiffness
    if not held:
        return A, c, heat
    c[1] += c[0]
    return A[1:, 1:], c[1:], heat[1:]


def remembering(
    A: Array,
    c: Array,
    film: Laws,
    memory: Memory,
    branch: HistoryBranch = "continued",
    loose: bool = False,
) -> HistoryProblem:
    """A body under a film that remembers."""
    return HistoryProblem(
        CondensedBody.known(A, c, loose=loose), MemoryModel(memory, film, len(c)), branch
    )


def coupled_line(m: int) -> tuple[Array, Array, Array]:
    """(Ã, c, a load) in SI units of a plane steel body: every node pushes every other, λ₁ of some
    GPa/m."""
    A, c = cases.half_laplacian(m, 1e9)
    return A, c, c * np.linspace(0.2, 1.0, m) * 5e7


def softening() -> Laws:
    """A film that falls by 3.75 GPa/m, less steeply than λ₁ of the coupled line (π GPa/m · …)
    rises."""
    return law("slip-weakening", tau_s=2e7, tau_k=1.4e7, delta=4e-3)


def followed(body: HistoryProblem, loads: list[Array], missed: float = 1e-8) -> list[HistoryStep]:
    """All steps solved, energies in order; along paths closure is rounding, and no jump without
    energy."""
    steps, before = list(history(body, loads)), HistoryStep.virgin(body.body.m)
    assert [step.reason for step in steps] == [""] * len(loads)
    for step in steps:
        check_energies(body, before, step)
        if body.branch == "continued":
            size = step.dissipated + step.stored + abs(step.energy) + abs(before.energy)
            assert abs(step.closure) <= missed * size
            assert (step.released > 0.0) == (step.jumps > 0)
        before = step
    return steps


def check_energies(body: HistoryProblem, before: HistoryStep, step: HistoryStep) -> None:
    """ΔE + ΔB + D + closure + released = work, the identity to rounding, nothing negative, κ only
    grows; and the two-sided estimate where each state is the lowest."""
    assert step.identity <= 1e-14
    assert np.all(step.kappa >= before.kappa)
    assert step.dissipated >= 0.0
    change = step.load - before.load
    gained = step.energy - before.energy + step.stored - before.stored + step.dissipated
    size = (
        abs(step.energy)
        + abs(before.energy)
        + step.stored
        + before.stored
        + abs(step.work)
        + step.dissipated
    )
    assert gained + step.closure + step.released == pytest.approx(step.work, abs=1e-12 * size)
    if body.branch == "lowest":
        assert gained <= -change @ before.v + 1e-12 * size
        if step.unique:
            assert gained >= -change @ step.v - 1e-12 * size
