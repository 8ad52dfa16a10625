"""Laws against quadrature, brute-force limits and sampled falls."""

import itertools
import pickle

import numpy as np
import pytest
from scipy.integrate import quad

from tcstudy.laws.laws import Laws
from tcstudy.laws.pieces import DOWN, REGIONS, GrowthError
from tcstudy.laws.shapes import SHAPES


def law_of(name: str, kinks: list[float], pieces: list[tuple[float, float, float, float]]) -> Laws:
    """Pieces p + q s + a exp(−r s)."""
    p, q, a, r = (np.array(column) for column in zip(*pieces, strict=True))
    return Laws(name, np.array(kinks), np.zeros(len(p)), p, q, a, r)


LAWS = {
    "tresca": SHAPES["tresca"].build(tau=2.0),
    "slip-weakening": SHAPES["slip-weakening"].build(tau_s=20e6, tau_k=5e6, delta=4e-5),
    "exponential": SHAPES["exponential"].build(a=4.0, b=1.0, delta=0.3),
    "saw-tooth": SHAPES["saw-tooth"].build(tau=3.0, delta=0.2, teeth=5, drop=0.6, decay=0.8),
    "all teeth": SHAPES["saw-tooth"].build(tau=3.0, delta=0.2, teeth=5, drop=1.0),
    "linear": SHAPES["linear"].build(k=3.0),
    "one-sided": SHAPES["piecewise-linear"].build(
        points=[[-1, -2], [-0.5, -2], [-0.5, 1], [0.3, 0], [1, 2], [1, 0.5]],
        odd=False,
        slopes=[1, 2],
    ),
    "mixed": law_of(
        "mixed",
        [-0.7, -0.2, 0.0, 0.4, 1.5],
        [
            (-1, 0.5, 0, 0),
            (0.3, 0, -2, -4),
            (0, -1, -0.5, 2),
            (2, 0, 1, 5),
            (1, 1, 0, 0),
            (3, 0, -2, 1),
        ],
    ),
}
everywhere = pytest.mark.parametrize("law", LAWS.values(), ids=LAWS.keys())


def reach(law: Laws) -> float:
    return float(np.abs(law.kinks).max(initial=0.0)) or law.s_scale or 1.0


def slips(law: Laws, count: int = 60) -> np.ndarray:
    """Random slips, the kinks themselves, and slips a hair to either side of them."""
    random = reach(law) * np.random.default_rng(3).uniform(-3, 3, count)
    return np.concatenate(
        [random, law.kinks, law.kinks * (1 + 1e-9), law.kinks * (1 - 1e-9), [0.0]]
    )


@everywhere
def test_primitive_is_the_integral(law: Laws) -> None:
    """One quad for each stretch without a kink, within a bound of ∫|b|."""
    for s in slips(law, 20):
        low, high = min(0.0, s), max(0.0, s)
        integral = size = 0.0
        for left, right in itertools.pairwise(
            [low, *law.kinks[(low < law.kinks) & (law.kinks < high)], high]
        ):
            k = law.piece(0.5 * (left + right))
            bound = (right - left) * float(np.abs(law.value([left, right], k)).max())
            noise = 1e-14 * (bound + (right - left) * float(abs(law.value(0.0, k))))
            integral += quad(
                lambda t, k=k: float(law.value(t, k)), left, right, epsabs=noise, epsrel=1e-13
            )[0]
            size += bound
        assert abs(float(law.j(s)) - np.copysign(1.0, s) * integral) <= 1e-12 * size
    assert law.j(0.0) == 0.0


@everywhere
def test_interval_is_filled_between_the_limits(law: Laws) -> None:
    step = law.s_scale or reach(law)
    size = max(float(np.abs(law.b(slips(law))).max()), np.finfo(float).tiny)
    for s in np.concatenate([law.kinks, slips(law, 20)]):
        offsets = step * np.geomspace(1e-9, 1e-8, 5)
        around = np.concatenate([law.b(s - offsets), law.b(s + offsets)])
        gap = np.abs(law.kinks - s)
        if not np.any((gap > 0) & (gap < 2e-8 * step)):
            assert np.ravel(law.interval(s)) == pytest.approx(
                [around.min(), around.max()], abs=1e-6 * size
            )


@everywhere
def test_omega_is_the_steepest_fall(law: Laws) -> None:
    """The largest −(b(s₁)−b(s₂))/(s₁−s₂) over all pairs of a grid that puts points close to the
    kinks."""
    hairs = np.concatenate([law.kinks + side * 1e-7 * reach(law) for side in (-2, -1, 1, 2)])
    s = np.unique(np.concatenate([np.linspace(-3, 3, 1500) * reach(law), hairs]))
    b = law.b(s)
    with np.errstate(invalid="ignore", divide="ignore"):
        sampled = max(0.0, -np.nanmin((b[:, None] - b) / (s[:, None] - s)))
    if np.any(law.kinds == DOWN):
        assert law.omega == np.inf
        drop = float((law.b_left - law.b_right).max())
        assert sampled >= 0.9 * drop / (4e-7 * reach(law))
    else:
        assert sampled <= law.omega * (1 + 1e-6) + 1e-9
        assert sampled >= 0.99 * law.omega


@pytest.mark.parametrize(
    ("kinks", "pieces", "words"),
    [
        ([], [(0, -1, 0, 0)], "wrong sign as s → +∞"),
        ([0], [(1, 0, 0, 0), (1, 0, 0, 0)], "wrong sign as s → −∞"),
        ([0], [(-1, 0, 0, 0), (1, 0, 1, -2)], "exponentially as s → +∞"),
        ([0], [(-1, 0, -1, 2), (1, 0, 0, 0)], "exponentially as s → −∞"),
        ([0], [(-1, 0, 0, 0), (0, 0, -1, 2)], "wrong sign as s → +∞"),
        ([1, 0], [(-1, 0, 0, 0), (0, 0, 0, 0), (1, 0, 0, 0)], "increasing order"),
        ([0], [(-1, 0, 0, 0), (np.inf, 0, 0, 0)], "not finite"),
    ],
)
def test_growth_is_refused(
    kinks: list[float], pieces: list[tuple[float, float, float, float]], words: str
) -> None:
    with pytest.raises(GrowthError, match=words.replace("+", "\\+")):
        law_of("", kinks, pieces).check_growth()


def test_laws_compare_by_their_numbers() -> None:
    build = SHAPES["slip-weakening"].build
    law, twin, other = (build(tau_s=2.0, tau_k=1.0, delta=d) for d in (0.5, 0.5, 0.25))
    assert law == twin != other
    assert (len({law, twin, other}), pickle.loads(pickle.dumps(law))) == (2, law)
    assert law_of("", [0], [(-0.0, 1, 0, 0), (0.0, 1, 0, 0)]) == law_of(
        "", [0.0], [(0.0, 1, 0, 0), (-0.0, 1, 0, 0)]
    )


@pytest.mark.parametrize(
    ("law", "outwards"),
    [
        (SHAPES["bilinear"].build(tau=10.0, s0=1.0, sf=3.0, G_f=None), "elastic softening debonded"),
        (SHAPES["trapezoidal"].build(tau=10.0, s0=1.0, s1=2.0, sf=3.0, G_f=None), "elastic yielded softening debonded"),
        (SHAPES["elastic-plastic"].build(tau=10.0, s0=1.0), "elastic yielded"),
        (SHAPES["linear"].build(k=1.0), "elastic"),
        (LAWS["tresca"], "yielded"),
        (LAWS["slip-weakening"], "softening debonded"),
        (LAWS["exponential"], "softening"),
        (SHAPES["piecewise-linear"].build(points=[[0, 0], [1, 0], [2, 5], [2, 1]], odd=True, slope=None, slopes=None),
         "bare yielded debonded"),
        (SHAPES["saw-tooth"].build(tau=3.0, delta=0.2, teeth=2, drop=0.6), "yielded yielded debonded"),
    ],
)  # fmt: skip
def test_regions_are_told_outwards(law: Laws, outwards: str) -> None:
    own = [REGIONS[k] for k in law.regions[int(law.piece(0.0)) :]]
    assert (own, [REGIONS[k] for k in law.regions[::-1][: len(own)]]) == (
        outwards.split(),
        own[::-1],
    )
    table = Laws.of([LAWS["all teeth"], law])
    assert table.regions[1, : len(law.regions)].tolist() == law.regions.tolist()
