"""Distances straight through a body against those of its drawing."""

import numpy as np
import pytest

from tcstudy.shapes.thickness import reach, thickness

U = np.array([[0, 0], [5, 0], [5, 3], [4, 3], [4, 1], [1, 1], [1, 3], [0, 3], [0, 0]], dtype=float)
HOLE = np.array([[2, 0.25], [2, 0.75], [3, 0.75], [3, 0.25], [2, 0.25]])
POINTS = np.array([[0.5, 0.0], [2.5, 0.0], [4.5, 0.0], [5.0, 2.0], [1.0, 2.0], [3.5, 1.0]])
NORMALS = np.array([[0, -1], [0, -1], [0, -1], [1, 0], [1, 0], [0, 1]], dtype=float)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_thickness_of_a_body_with_arms_and_a_hole(sign: float) -> None:
    """A U of three arms; the gap between its upper arms is not inside."""
    pieces = [U[i : i + 2] for i in range(len(U) - 1)]
    inside = [3.0, 1.0, 3.0, 1.0, 1.0, 1.0]
    assert thickness(POINTS, sign * NORMALS, pieces) == pytest.approx(inside)
    inside[1] = 0.25
    assert thickness(POINTS, sign * NORMALS, [*pieces, HOLE]) == pytest.approx(inside)
    assert reach(POINTS, sign * NORMALS, [U[4:6]]) == pytest.approx([np.inf, 1, *[np.inf] * 4])
