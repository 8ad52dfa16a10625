"""Jumps of histories: where they are, what they release, in any unit; rounding is no jump."""

import numpy as np
import pytest
from numpy.typing import NDArray

from tcstudy.contact.history.memory import HistoryStep
from tcstudy.contact.history.steps import history
from tcstudy.laws.laws import Laws
from tcstudy.matrices import law
from tcstudy.scene.histories import Memory
from tests.contact.contact_cases import half_laplacian
from tests.contact.history.cases import followed, remembering, strip

Array = NDArray[np.float64]
FRICTION, DAMAGE = Memory("friction"), Memory("damage")


def test_a_jump_ends_in_the_next_well_downhill() -> None:
    """Stick and slip over teeth of a film, one at a time: a block on a spring of 0.06, by hand.

    It lets go of the crest (0.1, 1) with l = 1.006 and is caught by the rise to (1, 2) where 0.06 s
    + b(s) = 1.006; of that it lets go with 2.06, and ends where 0.06 s + 0.1 = 2.06. Released is ∫
    (l − 0.06 s − b) ds.
    """
    film = law(points=[(0.0, 0.5), (0.1, 1.0), (0.6, 0.1), (1.0, 2.0), (1.8, 0.1)])
    dip = 1.006 - 0.036 - 0.1
    caught = 0.6 + dip / (0.06 + 1.9 / 0.4)
    loads = [np.array([load]) for load in (1.5, 3.0)]
    one, two = followed(remembering(np.array([[0.06]]), np.ones(1), film, FRICTION), loads)
    assert one.released == pytest.approx(0.5 * dip * (caught - 0.1), rel=1e-12)
    assert one.v == pytest.approx(0.6 + (1.5 - 0.136) / (0.06 + 1.9 / 0.4), rel=1e-12)
    end = (2.06 - 0.1) / 0.06
    out = (2.06 - 0.06 * 1.8 - 0.1) * 0.5 * (0.8 + end - 1.8)
    assert two.released == pytest.approx(out, rel=1e-12)
    assert (one.jumps, two.jumps) == (1, 1)


def concave(d: float) -> Laws:
    """τ(s) = 3 − exp(s/d) to s = d, then 3 − e: it falls more and more steeply, by 1/d at first and
    e/d in the end."""
    end, none = 3.0 - np.e, np.zeros(4)
    kinks, s_0 = np.array([-d, 0.0, d]), np.array([-d, 0.0, 0.0, d])
    a, r = np.array([0.0, 1.0, -1.0, 0.0]), np.array([0.0, 1.0, -1.0, 0.0]) / d
    return Laws("concave", kinks, s_0, np.array([-end, -3.0, 3.0, end]), none, a, r)


LET_GO = [
    (FRICTION, 1.1, (0.9,)),
    (DAMAGE, 1.3, (0.9,)),
    (FRICTION, 1.6, (0.5, 0.99)),
    (DAMAGE, 2.0, ()),
    (FRICTION, 2.0, (1.0 - 1e-5,)),
    (DAMAGE, 1.1, (1.0 - 1e-5,)),
    (FRICTION, 1.3, (1.0 - 1e-9,)),
    (DAMAGE, 1.6, (1.0 - 1e-9,)),
]


@pytest.mark.parametrize(("memory", "k", "before"), LET_GO)
def test_a_block_on_a_spring_lets_go_where_the_film_falls_as_the_spring_rises(
    memory: Memory, k: float, before: tuple[float, ...]
) -> None:
    """τ′(s) = −k at s = ln k; the load stays while the block slides to k s + 3 − e: released is ∫
    (l − k s − τ) ds."""
    fold, way = np.log(k), (-1.0) ** len(before)
    load = k * fold + 3.0 - k
    landing = (load - (3.0 - np.e)) / k
    lost = (
        3.0 - np.e + (3.0 - np.e) * (landing - 1.0) - (3.0 * fold - k + 1.0) + 1.0
    )  # ∫ τ from the fold on
    released = load * (landing - fold) - 0.5 * k * (landing**2 - fold**2) - lost
    body = remembering(np.array([[k]]), np.ones(1), concave(1.0), memory)
    steps = followed(body, [np.array([way * share * load]) for share in (*before, 1.2)])
    assert [step.jumps for step in steps] == [*(0 for _ in before), 1]
    assert steps[-1].released == pytest.approx(released, rel=1e-11)
    assert steps[-1].v[0] == pytest.approx(way * (1.2 * load - 3.0 + np.e) / k, rel=1e-14)
    assert max(step.identity for step in steps) <= 3e-16
    assert max(abs(step.closure) for step in steps) <= 1e-15 * load


def settled(A: Array, c: Array, film: Laws, load: Array, v: Array) -> Array:
    """v ≥ 0 downhill from v: Newton's steps where the energy is convex, else those of its majorant
    linear in τ."""
    for _ in range(10_000):
        force = load - A @ v - c * film.b(v, 1)
        free = np.flatnonzero((v > 0.0) | (force > 0.0))
        own, fall = A[np.ix_(free, free)], c[free] * film.slope(v[free], film.piece(v[free], 1))
        H = own + np.diag(fall)
        H = H if np.all(np.linalg.eigvalsh(H) > 0.0) else own
        new = v.copy()
        new[free] = np.maximum(0.0, v[free] + np.linalg.solve(H, force[free]))
        if np.max(np.abs(new - v)) <= 1e-11 * np.max(new):
            return new
        v = new
    raise AssertionError("it creeps")


def first_jump(A: Array, c: Array, film: Laws, load: Array, begin: float) -> tuple[float, float]:
    """(factor of the load, energy released) at the first jump by more than 0.02, by small steps,
    the last halved."""

    def energy(v: Array) -> float:
        return float(0.5 * v @ A @ v - at * load @ v + c @ film.j(v))

    at, step, v = begin, 2e-3, settled(A, c, film, begin * load, np.zeros(len(c)))
    while step > 4e-9:
        new = settled(A, c, film, (at + step) * load, v)
        beyond = np.max(np.abs(new - v)) > 0.02
        at, v = (at, v) if beyond else (at + step, new)
        step *= 0.5 if beyond or step < 1e-3 else 1.0
    return at, energy(v) - energy(settled(A, c, film, (at + 8e-9) * load, v))


FILMS = [(concave(0.3), 2.4), (law("exponential", a=3.0, b=0.3, delta=0.1), 2.9)]


@pytest.mark.parametrize(("film", "begin"), FILMS, ids=["softest way", "next node"])
def test_a_line_lets_go_as_by_small_steps(film: Laws, begin: float) -> None:
    """Where sliding nodes lose their hold together, and where the next one begins to slide."""
    A, c = half_laplacian(20)
    load = c * np.linspace(0.2, 1.0, 20)
    at, released = first_jump(A, c, film, load, begin)
    for memory in (FRICTION, DAMAGE):
        body = remembering(A, c, film, memory)
        steps = followed(body, [share * load for share in (begin, at - 1e-7, at + 1e-7)])
        assert [step.jumps for step in steps] == [0, 0, 1]
        assert steps[-1].released == pytest.approx(released, rel=1e-7)
        assert max(step.identity for step in steps) <= 3e-16


def check_no_jump(steps: list[HistoryStep]) -> None:
    assert [(step.reason, step.jumps, step.released) for step in steps] == [("", 0, 0.0)] * len(
        steps
    )
    assert not any(np.any(step.jumped) for step in steps)
    assert all(abs(step.closure) <= 1e-8 * abs(step.energy) for step in steps)


@pytest.mark.parametrize(("stiffness", "metre"), [(1e-9, 1e3), (1.0, 1e-3), (1e15, 1e3)])
@pytest.mark.parametrize("ratio", [1.0, 1e8, 1e11])
def test_a_stiff_block_on_a_spring_never_jumps(
    stiffness: float, ratio: float, metre: float
) -> None:
    """Jenkins' element, spring K and Tresca resistance F: u = (P − F)/K, back to −u, and each loop
    the same.

    ratio: of the block's stiffness to the spring's, from which rounding of slips follows
    """
    K, F = stiffness, 0.04 * stiffness * metre
    A = ratio * K * strip(4, 1.0, 1.0, held=False)[0]
    A[-1, -1] += K
    c = metre * np.array([0.025, 0.05, 0.05, 0.05, 0.025])
    body = remembering(A, c, law("tresca", tau=F / c.sum()), FRICTION)
    share = np.array([0.05, 0.1, 0.2, 0.2, 0.45]) if ratio > 1e3 else c / c.sum()
    steps = list(history(body, [P * F * share for P in (2.5, 1.5, -2.5, 2.5, 2.5, 1.5, -2.5, 2.5)]))
    check_no_jump(steps)
    if ratio > 1e3:
        u, exact = [step.v.mean() for step in steps], 1.5 * F / K
        error = max(2.0 / ratio, 8.0 * np.finfo(float).eps * ratio)
        assert u == pytest.approx([exact, exact, -exact, exact] * 2, abs=10.0 * error * exact)


def test_a_body_with_a_soft_way_never_jumps_under_a_constant_film() -> None:
    """Stiffnesses over ten decades: what residuals move along the soft way gains energy, yet no
    node can let go."""
    rng, m = np.random.default_rng(203), 5
    modes = np.linalg.qr(rng.standard_normal((m, m)))[0]
    A = (modes * 10.0 ** rng.uniform(-8.0, 2.0, m)) @ modes.T
    body = remembering(0.5 * (A + A.T), np.full(m, 1e-3), law("tresca", tau=1.0), FRICTION)
    way = rng.standard_normal(m) * 10.0
    assert body.monotone
    check_no_jump(list(history(body, [share * way for share in (1.0, -1.0, 0.5)])))
