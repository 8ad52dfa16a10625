"""The named shapes against their formulas, written down again here point by point; close points;
what is refused."""

import math
import pickle
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from tcstudy.laws.laws import Laws
from tcstudy.laws.pieces import BEND, DOWN, UP, GrowthError
from tcstudy.laws.shapes import MAX_TEETH, SHAPES, LawError


def build(name: str, **values: Any) -> Laws:
    return SHAPES[name].build(**values)


def saw(s: float, tau: float, delta: float, teeth: int, drop: float, decay: float) -> float:
    i = math.floor(s / delta)
    if i >= teeth:
        return (1 - drop) * tau * decay**teeth
    return tau * decay**i * (1 - drop + drop * (s / delta - i))


SAW: dict[str, Any] = {"tau": 3.0, "delta": 0.2, "teeth": 4, "drop": 0.7, "decay": 0.9}
CASES: list[tuple[str, dict[str, Any], Callable[[float], float]]] = [
    ("tresca", {"tau": 2.5}, lambda s: 2.5),
    (
        "slip-weakening",
        {"tau_s": 2e7, "tau_k": 5e6, "delta": 4e-5},
        lambda s: max(2e7 - 1.5e7 * s / 4e-5, 5e6),
    ),
    ("slip-weakening", {"tau_s": 1.0, "tau_k": 3.0, "delta": 0.5}, lambda s: min(1 + 4 * s, 3.0)),
    ("exponential", {"a": 4.0, "b": 1.5, "delta": 0.3}, lambda s: 2.5 * math.exp(-s / 0.3) + 1.5),
    ("saw-tooth", SAW, lambda s: saw(s, **SAW)),
    ("linear", {"k": 7.0}, lambda s: 7.0 * s),
    ("elastic-plastic", {"tau": 3.0, "s0": 0.2}, lambda s: min(15.0 * s, 3.0)),
    (
        "bilinear",
        {"tau": 7e6, "s0": 4e-5, "G_f": 700.0},
        lambda s: np.interp(s, [0, 4e-5, 2e-4], [0, 7e6, 0]),
    ),
    (
        "trapezoidal",
        {"tau": 2.0, "s0": 1.0, "s1": 3.0, "G_f": 6.0},
        lambda s: np.interp(s, [0, 1, 3, 4], [0, 2, 2, 0]),
    ),
    (
        "trilinear",
        {"tau": 2.0, "s0": 1.0, "sf": 3.0, "tau_r": 0.5},
        lambda s: np.interp(s, [0, 1, 3], [0, 2, 0.5]),
    ),
    (
        "piecewise-linear",
        {"points": [[0, 2], [0.5, 1], [0.5, 1.5], [1.0, 0.25]], "slope": 0.5},
        lambda s: (
            2 - 2 * s if s < 0.5 else 1.5 - 2.5 * (s - 0.5) if s < 1 else 0.25 + 0.5 * (s - 1)
        ),
    ),
]


@pytest.mark.parametrize(("name", "values", "formula"), CASES, ids=[name for name, _, _ in CASES])
def test_shapes_follow_their_formulas_and_are_odd_to_the_bit(
    name: str, values: dict[str, Any], formula: Callable[[float], float]
) -> None:
    law = build(name, **values)
    reach = 3 * float(law.kinks.max(initial=0.0)) or 1.0
    slips = np.random.default_rng(1).uniform(0, reach, 500)
    expected = np.array([formula(float(s)) for s in slips])
    np.testing.assert_allclose(
        law.b(slips), expected, rtol=1e-13, atol=1e-13 * np.abs(expected).max()
    )
    slips = np.concatenate([slips, law.kinks[law.kinks >= 0]])
    for side in (1, -1):
        assert np.array_equal(law.b(slips, side), -law.b(-slips, -side))
    assert np.array_equal(law.j(slips), law.j(-slips))
    assert np.array_equal(law.interval(slips)[0], -law.interval(-slips)[1])


def test_kinds_of_kinks() -> None:
    assert build("slip-weakening", tau_s=2, tau_k=1, delta=0.5).kinds.tolist() == [BEND, UP, BEND]
    assert (
        build("saw-tooth", tau=1, delta=0.1, teeth=3, drop=0.5).kinds.tolist()
        == [DOWN] * 3 + [UP] + [DOWN] * 3
    )
    law = build("piecewise-linear", points=[[0, 1], [1, 2], [1, 3], [2, 1]])
    assert law.kinds.tolist() == [BEND, UP, UP, UP, BEND]
    steep = build(
        "piecewise-linear", points=[(0, 1), (1, 1), (1 + 1e-12, 0.2)]
    )  # the foot of a steep piece is no jump
    assert steep.kinds.tolist() == [BEND, BEND, UP, BEND, BEND]


@pytest.mark.parametrize(
    ("name", "values", "kinks"),
    [
        ("tresca", {"tau": 0}, []),
        (
            "piecewise-linear",
            {"points": [[0, 0.3], [0.1, 0.2], [0.2, 0.1], [0.3, 0.0]]},
            [-0.3, 0, 0.3],
        ),
        ("piecewise-linear", {"points": [[0, 0], [1, 3], [2, 6]], "slope": 3.0}, []),
        ("saw-tooth", {"tau": 1, "delta": 1, "teeth": 1, "drop": 1}, [-1, 1]),
        ("piecewise-linear", {"points": [[0, 0], [1, 1]], "odd": False, "slopes": [1.0, 1.0]}, []),
    ],
)
def test_corners_without_a_bend_are_left_out(
    name: str, values: dict[str, Any], kinks: list[float]
) -> None:
    assert build(name, **values).kinks.tolist() == kinks


REFUSED: list[tuple[str, dict[str, Any], str, str]] = [
    ("tresca", {}, "tau", "missing"),
    ("tresca", {"tau": -1}, "tau", "at least 0"),
    ("tresca", {"tau": "2"}, "tau", "number"),
    ("tresca", {"tau": 10**400}, "tau", "finite"),
    ("tresca", {"tau": 1, "tua": 1}, "tua", "did you mean 'tau'"),
    ("slip-weakening", {"tau_s": 1, "tau_k": 1, "delta": 0}, "delta", "above 0"),
    ("saw-tooth", {**SAW, "teeth": 2.5}, "teeth", "whole"),
    ("saw-tooth", {**SAW, "teeth": MAX_TEETH + 1}, "teeth", "from 1"),
    ("saw-tooth", {**SAW, "drop": 0}, "drop", "at most 1"),
    ("bilinear", {"tau": 1, "s0": 1}, "sf", "fracture energy"),
    ("bilinear", {"tau": 1, "s0": 1, "sf": 2, "G_f": 1}, "G_f", "one of the two"),
    ("bilinear", {"tau": 1, "s0": 1, "sf": 1}, "sf", "above s0 = 1"),
    ("bilinear", {"tau": 2, "s0": 1, "G_f": 1}, "G_f", "above 1 J/m^2"),
    ("trapezoidal", {"tau": 1, "s0": 2, "s1": 1, "sf": 3}, "s1", "above s0 = 2"),
    ("piecewise-linear", {"points": []}, "points", "at least one pair"),
    ("piecewise-linear", {"points": [0, 1]}, "points", "list"),
    ("piecewise-linear", {"points": [[0, 1], [2, 1], [1, 1]]}, "points", "point 3"),
    ("piecewise-linear", {"points": [[0, 1], [1, 1], [1, 2], [1, 3]]}, "points", "three points"),
    ("piecewise-linear", {"points": [[0.5, 1]]}, "points", "start with [0, b]"),
    ("piecewise-linear", {"points": [[0, 1], [0, 2]]}, "points", "give one point"),
    ("piecewise-linear", {"points": [[0, 1]], "slopes": [0, 0]}, "slopes", "one slope"),
    ("piecewise-linear", {"points": [[0, 1]], "odd": False, "slope": 1}, "slope", "[left, right]"),
    (
        "piecewise-linear",
        {"points": [[0, 1]], "odd": False, "slopes": [1]},
        "slopes",
        "two numbers",
    ),
    ("piecewise-linear", {"points": [[0, 1]], "odd": 1}, "odd", "true or false"),
]


@pytest.mark.parametrize(("name", "values", "parameter", "words"), REFUSED)
def test_meaningless_parameters_are_refused(
    name: str, values: dict[str, Any], parameter: str, words: str
) -> None:
    with pytest.raises(LawError) as caught:
        build(name, **values)
    assert caught.value.parameter == parameter
    assert words in str(caught.value)
    assert str(pickle.loads(pickle.dumps(caught.value))) == str(caught.value)


def test_laws_against_the_growth_conditions_are_refused() -> None:
    with pytest.raises(GrowthError, match=r"eq\. \(15\)"):
        build("piecewise-linear", points=[[0, 1], [1, -0.5]])
    with pytest.raises(GrowthError, match=r"eq\. \(16\)"):
        build("piecewise-linear", points=[[0, 0], [5e-324, 1e300]])


def close_points(rng: np.random.Generator, odd: bool) -> list[tuple[float, float]]:
    """Clusters of two to four points, some with a jump, that lie 1 ulp to 1e-12 (relative)
    apart."""
    points = [(0.0, float(rng.uniform(0.1, 1.0)))] if odd else []
    for centre in np.cumsum(rng.uniform(0.05, 2.0, rng.integers(1, 5))) - (0.0 if odd else 1.5):
        s = float(centre)
        for _ in range(rng.integers(2, 5)):
            b = float(rng.uniform(-1.0, 1.0) * rng.choice([1.0, 1e-3, 1e3]))
            points.append((s, b))
            if rng.random() < 0.2:
                points.append((s, float(rng.uniform(-1.0, 1.0))))
            s = max(float(np.nextafter(s, np.inf)), s + abs(s) * 10.0 ** rng.uniform(-16.0, -12.0))
    if not odd:
        points[0] = (points[0][0], -abs(points[0][1]))
    points[-1] = (points[-1][0], abs(points[-1][1]))
    return points


@pytest.mark.parametrize("odd", [True, False])
def test_close_points_keep_their_values(odd: bool) -> None:
    """The law solved is the law given: polygons through points one rounding to 1e-12 apart pass
    through all of them."""
    for seed in range(50):
        points = close_points(np.random.default_rng([seed, odd]), odd)
        law = build("piecewise-linear", points=points, odd=odd)
        rounding = 4 * float(np.spacing(max(abs(b) for _, b in points)))
        first, last = dict(reversed(points)), dict(points)
        if odd:
            del first[0.0]  # the left limit there is that of the mirror image
        for side, values in ((-1, first), (+1, last)):
            assert all(abs(float(law.b(s, side)) - b) <= rounding for s, b in values.items())
        s = np.array(
            [*last, *(0.5 * (x + y) for x, y in zip(list(last)[:-1], list(last)[1:], strict=True))]
        )
        if odd:
            assert np.array_equal(law.b(s, +1), -law.b(-s, -1))
            assert np.array_equal(law.j(s), law.j(-s))
        # divided by a unit, points one rounding apart may coincide: then the piece is a jump
        # between the same values
        other, size = law.placed(1.0 / 7.0e6, 1.0 / 3.0e-5), float(np.max(np.abs(law.b_left)))
        assert np.all(np.diff(other.kinks) > 0)
        low, high = other.interval(law.kinks * (1.0 / 3.0e-5))
        assert np.all(low * 7.0e6 <= np.minimum(law.b_left, law.b_right) + 1e-15 * size)
        assert np.all(high * 7.0e6 >= np.maximum(law.b_left, law.b_right) - 1e-15 * size)
