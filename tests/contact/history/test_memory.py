"""memory: the law of every step is the derivative of stored + dissipated energy, by node and the
row's own."""

import numpy as np
import pytest

from tcstudy.contact.history.memory import MemoryModel, NodeState
from tcstudy.laws.composed import nodal
from tcstudy.laws.laws import Laws
from tcstudy.matrices import law
from tcstudy.scene.histories import Memory, UnfitLaw

SOFTENING = law("slip-weakening", tau_s=3.0, tau_k=1.0, delta=2.0)
DECAYING = law("exponential", a=3.0, b=1.0, delta=2.0)
BENT = law(points=[(0.0, 3.0), (0.5, 2.0), (1.0, 1.9), (2.5, 0.0)])
HARDENING = law(points=[(0.0, 0.0), (1.0, 2.0), (2.0, 2.0)])
KAPPA = np.array([0.0, 0.3, 1.0, 2.0, 2.0 * (1.0 - 1e-15), 2.0 + 1e-15, 7.0])
CASES: list[tuple[Memory, Laws]] = [
    (Memory("friction"), SOFTENING),
    (Memory("friction"), DECAYING),
    (Memory("friction"), HARDENING),
    (Memory("elastic-plastic", 5.0), SOFTENING),
    (Memory("elastic-plastic", 5.0), BENT),
    (Memory("elastic-plastic", 5.0), HARDENING),
    (Memory("damage"), SOFTENING),
    (Memory("damage"), DECAYING),
    (
        Memory("damage"),
        nodal([SOFTENING, BENT], [0, 1, 0, 1, 0, 1, 0], strength=[1, 1, 2, 2, 1, 1, 1]),
    ),
]


@pytest.mark.parametrize(("memory", "law"), CASES, ids=lambda x: getattr(x, "name", None))
def test_the_law_of_a_step_is_the_derivative_of_its_energy(memory: Memory, law: Laws) -> None:
    """j = stored + dissipated, whatever is remembered; j and b of a row are those of the row as a
    law of its own."""
    m, rng = len(KAPPA), np.random.default_rng(3)
    model = MemoryModel(memory, law, m)
    state = NodeState(np.zeros(m), KAPPA, np.zeros(m))
    rows = model.next_law(state)
    for size in (0.1, 1.0, 5.0):
        w = rng.normal(size=m) * size
        after, stored, dissipated = model.after(state, w)
        assert rows.j(w) == pytest.approx(stored + dissipated, rel=1e-13, abs=1e-14)
        assert rows.j(-w) == pytest.approx(rows.j(w), rel=1e-14, abs=1e-15)
        assert np.all(dissipated >= 0.0)
        assert np.all(after.kappa >= state.kappa)
        for i, own in enumerate(rows.single(k) for k in range(m)):
            assert own.b(w[i]) == rows.b(w)[i]
            assert own.j(w[i]) == pytest.approx(rows.j(w)[i], rel=1e-14)
            assert np.array_equal(own.kinds, rows.kinds[i][: len(own.kinds)])
            own.check_growth()
    assert all(rows.single(k).omega <= rows.falls[rows.index][k] * (1.0 + 1e-12) for k in range(m))


@pytest.mark.parametrize(
    ("memory", "values"),
    [
        (Memory("friction"), {0.0: 2.0, 0.5: 1.5, -3.0: -1.0}),
        (Memory("damage"), {0.5: 1.0, 1.5: 1.5}),
        (Memory("elastic-plastic", 5.0), {0.2: 1.0, 0.8: 1.5}),  # Δp = 0.5, τ = 1.5, 5 (0.8 − 0.5)
    ],
)
def test_what_has_slipped_so_far_moves_along_the_law(
    memory: Memory, values: dict[float, float]
) -> None:
    """τ = 3 − w to w = 2, then 1: values by hand after κ = 1."""
    state, model = (
        NodeState(np.zeros(1), np.ones(1), np.zeros(1)),
        MemoryModel(memory, SOFTENING, 1),
    )
    assert {w: model.next_law(state).b([w])[0] for w in values} == values
    if memory.name == "elastic-plastic":
        flowed, _, _ = model.after(state, np.array([-0.8]))
        assert (flowed.plastic[0], flowed.kappa[0]) == pytest.approx((-0.5, 1.5), rel=1e-15)


@pytest.mark.parametrize(
    ("memory", "law", "said"),
    [
        (Memory("friction"), law(points=[(-1, -1), (1, 2)], odd=False), "needs an odd law"),
        (Memory("friction"), law(points=[(0, 1), (1, -1), (2, 1)]), "opposes slip"),
        (Memory("damage"), law(points=[(0, 0), (1, 1), (2, 3)]), "secant b"),
        (
            Memory("damage"),
            law("saw-tooth", tau=1, delta=1, teeth=2, drop=1.0),
            "does not increase",
        ),
        (Memory("damage"), law(points=[(0, 1), (1, 1), (1, 2)]), "jumps up at s = 1"),
        (
            Memory("elastic-plastic", 1.0),
            SOFTENING,
            "k = 1 Pa/m must be above the maximum softening slope h = 1 Pa/m",
        ),
        (
            Memory("elastic-plastic", 9.0),
            law("saw-tooth", tau=1, delta=1, teeth=2, drop=0.5),
            "h = inf",
        ),
        (Memory("elastic-plastic", 9.0), DECAYING, "straight pieces"),
        (Memory("elastic-plastic"), SOFTENING, "needs a stiffness"),
        (Memory("elastic-plastic", 9.0), law(points=[(0, 1), (1, 1), (1, 2)]), "without up-jumps"),
    ],
)
def test_laws_that_cannot_be_remembered_are_refused(memory: Memory, law: Laws, said: str) -> None:
    with pytest.raises(UnfitLaw, match=said):
        MemoryModel(memory, law, 3)
