"""Signs of distances at corners of a polygon that turns back."""

from __future__ import annotations

import numpy as np

from tcstudy.accuracy.curve_distance import feet


def test_rounding_does_not_choose_the_sign_at_a_corner() -> None:
    """A snap-back of 170°, whose sides see a point beyond their corner on different hands."""
    corners = np.array([[0.0, 0.0], [1.0, 0.0], [1.0 - np.cos(np.pi / 18), np.sin(np.pi / 18)]])
    for point, sign in (([1.5, 0.01], -1.0), ([1.5, 0.2], -1.0), ([0.5, 0.01], 1.0), ([1.0, -0.3], -1.0)):
        for off in np.linspace(-3e-16, 3e-16, 7):
            found = feet(np.array([point]), corners + off * np.array([[0.0, 0.0], [1.0, 1.0], [0.0, 0.0]]))
            assert np.sign(found.distance[0]) == sign
            np.testing.assert_allclose(found.point[0] + found.distance[0] * found.normal[0], point, rtol=1e-14)
