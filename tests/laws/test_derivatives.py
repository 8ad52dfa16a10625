"""Derivatives of laws by their parameters against differences."""

import numpy as np
import pytest

from tcstudy.laws.composed import law_slopes
from tcstudy.laws.laws import Laws
from tcstudy.laws.shapes import SHAPES

LAWS = {
    "tresca": {"tau": 3.0},
    "slip-weakening": {"tau_s": 3.0, "tau_k": 1.0, "delta": 0.2},
    "exponential": {"a": 3.0, "b": 1.0, "delta": 0.2},
    "saw-tooth": {"tau": 3.0, "delta": 0.2, "teeth": 3, "drop": 0.5, "decay": 0.7},
    "linear": {"k": 2.0},
    "piecewise-linear": {"points": [(0.0, 1.0), (0.5, 0.25)], "slope": 0.1},
}
PAIRS = [
    (law, name)
    for law, values in LAWS.items()
    for name, value in values.items()
    if isinstance(value, float)
]


@pytest.mark.parametrize(("shape", "name"), PAIRS)
def test_laws_are_differentiated_exactly(shape: str, name: str) -> None:
    """b on a piece, kinks, j with the kinks that move on the way, and ω, against Richardson's
    differences."""
    values, slips = LAWS[shape], np.linspace(-1.0, 1.0, 37) * 0.9 + 0.013
    law = SHAPES[shape].build(**values)
    piece = law.piece(slips)

    def numbers(one: Laws) -> tuple[np.ndarray, ...]:
        return (
            one.value(slips, piece),
            one.kinks,
            one.j(slips),
            np.array(one.omega if np.isfinite(one.omega) else 0.0),
        )

    def differences(h: float) -> list[np.ndarray]:
        two = [
            SHAPES[shape].build(**{**values, name: values[name] + sign * h}) for sign in (1.0, -1.0)
        ]  # type: ignore[operator]
        return [(a - b) / (2.0 * h) for a, b in zip(*map(numbers, two), strict=True)]

    slopes = law_slopes(law, name)
    found = (
        slopes.value(slips, piece),
        slopes.kinks,
        slopes.potential(slips),
        np.array(slopes.omega()),
    )
    if not np.isfinite(law.omega):
        assert np.isnan(found[3])
    for one, coarse, fine in zip(found, differences(2e-3), differences(1e-3), strict=True):
        exact = (4.0 * fine - coarse) / 3.0
        scale = np.max(np.abs(exact), initial=1e-300)
        np.testing.assert_allclose(
            np.nan_to_num(one), exact, rtol=0.0, atol=2e-8 * scale + 1e-12 * (one.ndim == 0)
        )


@pytest.mark.parametrize("moves", ["b", "b of a law that is not odd", "s"])
def test_points_that_move(moves: str) -> None:
    """Also one that lies straight between its neighbours, where the law has no kink, and at a
    jump."""
    odd, slips = "not odd" not in moves, np.linspace(-2.5, 2.5, 41) + 0.0123
    h, atol = (1e-5, 1e-8) if moves == "s" else (1e-3, 1e-11)
    points = [(0.0, 1.0), (0.5, 0.75), (1.0, 0.5), (1.0, 0.2), (2.0, 0.3)]
    points = points if moves != "s" else [*points[:2], *points[3:]]

    def law(i: int = 0, h: float = 0.0) -> Laws:
        moved = np.array(points)
        moved[i, 0 if moves == "s" else 1] += h
        return SHAPES["piecewise-linear"].build(
            points=[(-3.0, -1.0)][odd:] + moved.tolist(), odd=odd
        )

    piece = law().piece(slips)
    for i in range(moves == "s", len(points)):
        found = law_slopes(law(), f"points.{i + (not odd)}{'.s' * (moves == 's')}")
        up, down = law(i, h), law(i, -h)
        for own, a, b in (
            (found.value(slips, piece), up.b(slips), down.b(slips)),
            (found.potential(slips), up.j(slips), down.j(slips)),
        ):
            np.testing.assert_allclose(own, (a - b) / (2 * h), rtol=0.0, atol=atol, err_msg=str(i))
        if moves == "s":
            np.testing.assert_allclose(found.kinks, (up.kinks - down.kinks) / (2 * h), atol=1e-9)
    for name in ("points.9", "points.", "points.-1"):
        with pytest.raises(KeyError):
            law_slopes(law(), name)


def test_the_steepest_fall_between_points() -> None:
    """b falls from 1 to 0.5 over 0.5: ω = (b_0 − b_1)/0.5; a point on a straight fall has no one
    derivative."""
    law = SHAPES["piecewise-linear"].build(points=[(0.0, 1.0), (0.5, 0.5), (2.0, 0.3)])
    assert [law_slopes(law, f"points.{i}").omega() for i in range(3)] == pytest.approx(
        [2.0, -2.0, 0.0]
    )
    law = SHAPES["piecewise-linear"].build(points=[(0.0, 1.0), (0.5, 0.5), (1.0, 0.0)])
    assert np.isnan(law_slopes(law, "points.1").omega())


def test_strength_is_a_factor_and_others_are_refused() -> None:
    law = SHAPES["slip-weakening"].build(**LAWS["slip-weakening"]).times(0.5)
    piece = law.piece(0.1)
    assert law_slopes(law, "strength").value(0.1, piece) == pytest.approx(
        law.value(0.1, piece) / 0.5
    )
    assert law_slopes(law, "tau_s").value(0.1, piece) == pytest.approx(0.5 * (1.0 - 0.1 / 0.2))
    for name in ("tau", "teeth"):
        with pytest.raises(KeyError, match=name):
            law_slopes(law, name)
