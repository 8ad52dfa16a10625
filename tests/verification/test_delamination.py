"""All equilibria of the strip that is lifted off a brittle bond, against an assembly and a law that
share no code with the package."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

import tcstudy
from tests.commands import CONFIGS

Array = NDArray[np.float64]
Index = NDArray[np.intp]

E, NU, LENGTH, HEIGHT = 210e9, 0.3, 0.1, 0.01
SAW = [(0.0, 0.0), (20e-6, 6e5), (20e-6, 1.6e5), (40e-6, 4e5), (40e-6, 8e4), (60e-6, 2e5), (60e-6, 0.0)]  # fmt: skip
"""The law's points, opening [m] and stress [Pa]."""


class Bonded(NamedTuple):
    """The strip seen by the openings of its bond: ξ = F·load − A s, each node with the length c."""

    A: Array
    load: Array
    c: Array
    held: float
    """Energy of the force while the bond is closed, by F² [m/N]."""


def condensed(xy: Array, triangles: Index, *, even: bool = False) -> Bonded:
    """Return the strip of linear triangles: clamped at x = 0, a force of 1 N/m upwards at x = L.

    It is a uniform traction, or `even` the same force at each node.
    """
    p = xy[triangles]
    sides = np.roll(p, -1, axis=1) - np.roll(p, -2, axis=1)  # opposite to each corner
    doubled = sides[:, 0, 0] * sides[:, 1, 1] - sides[:, 0, 1] * sides[:, 1, 0]
    grad = np.stack([sides[..., 1], -sides[..., 0]], axis=2) / doubled[:, None, None]
    strain = np.zeros((len(p), 3, 3, 2))
    strain[:, 0, :, 0] = strain[:, 2, :, 1] = grad[..., 0]
    strain[:, 1, :, 1] = strain[:, 2, :, 0] = grad[..., 1]
    strain = strain.reshape(len(p), 3, 6)
    elastic = E / (1 - NU**2) * np.array([[1, NU, 0], [NU, 1, 0], [0, 0, (1 - NU) / 2]])
    local = np.einsum("eai,ab,ebj,e->eij", strain, elastic, strain, np.abs(doubled) / 2)
    rows = (2 * triangles[..., None] + [0, 1]).reshape(len(p), 6)
    K = np.zeros((2 * len(xy), 2 * len(xy)))
    np.add.at(K, (rows[:, :, None], rows[:, None, :]), local)
    end = np.flatnonzero(xy[:, 0] > LENGTH - 1e-9)
    end = end[np.argsort(xy[end, 1])]
    push = np.zeros(len(K))
    push[2 * end + 1] = 1.0 / len(end) if even else shares(xy[end, 1]) / HEIGHT
    bottom = np.flatnonzero(xy[:, 1] < 1e-9)
    bottom = bottom[np.argsort(xy[bottom, 0])]
    c = shares(xy[bottom, 0])[1:]
    c[0] += xy[bottom[1], 0] / 2  # the half cell of the clamped node
    kept = 2 * bottom[1:] + 1
    free = np.setdiff1d(np.flatnonzero(np.repeat(xy[:, 0] > 1e-9, 2)), kept)
    inner = np.linalg.solve(K[np.ix_(free, free)], np.c_[K[np.ix_(free, kept)], push[free]])
    A = K[np.ix_(kept, kept)] - K[np.ix_(kept, free)] @ inner[:, :-1]
    load = push[kept] - K[np.ix_(kept, free)] @ inner[:, -1]
    return Bonded(A, load, c, -0.5 * float(push[free] @ inner[:, -1]))


def shares(places: Array) -> Array:
    """Return the length that belongs to each node of a line."""
    cells = np.diff(places)
    return 0.5 * np.r_[cells[0], cells[1:] + cells[:-1], cells[-1]]


def distance(s: float, stress: float) -> float:
    """Return how far a stress [Pa] is from the law at an opening, a jump holding what is between."""
    if s < 1e-12:
        return max(stress, -s * 1e18, 0.0)  # closed: any pressure, no penetration
    near = [b for at, b in SAW if abs(at - s) < 1e-10]
    if len(near) == 2:
        return max(min(near) - stress, stress - max(near), 0.0)
    places, values = np.array(SAW).T
    i = int(np.searchsorted(places, s, side="right"))
    if i == len(SAW):
        return abs(stress)
    share = (s - places[i - 1]) / (places[i] - places[i - 1])
    return abs(stress - values[i - 1] - share * (values[i] - values[i - 1]))


def energy(strip: Bonded, force: float, s: Array) -> float:
    """Return ½ sᵀA s − F·load·s + Σ c ∫b [J/m]."""
    bond = 0.0
    for c, opening in zip(strip.c, s, strict=True):
        for (left, b), (right, b1) in pairwise(SAW):
            over = np.clip(opening, left, right) - left
            slope = (b1 - b) / (right - left) if right > left else 0.0
            bond += c * (b * over + 0.5 * slope * over**2)
    return float(0.5 * s @ strip.A @ s - force * strip.load @ s + bond)


FORCES = "sweep={F: [9 kN/m, 12 kN/m, 14 kN/m]}"


def test_all_equilibria_of_the_study_are_those_of_another_assembly(tmp_path: Path) -> None:
    study = tcstudy.load(str(CONFIGS / "delaminated_strip.yaml"), ["output.fields=true", FORCES])
    tree = tcstudy.run(study, tmp_path / "strip.nc").tree
    root, level = tree.dataset.isel(level=0), tree["level_0"].dataset
    assert root["complete"].values.tolist() == [1] * 3
    assert root["solutions"].values.tolist() == [1, 23, 19]
    assert root["stable_solutions"].values.tolist() == [1, 11, 9]
    xy = np.column_stack([level["node_x"].values, level["node_y"].values])
    strip = condensed(xy, level["triangle"].values)
    forces = 1e3 * np.array([9, 12, 14])
    found: list[set[bytes]] = [set() for _ in forces]
    least = np.full(len(forces), np.inf)
    for point, s in zip(
        level["solution_point"].values, level["solution_opening"].values, strict=True
    ):
        stress = (forces[point] * strip.load - strip.A @ s) / strip.c
        assert max(map(distance, s, stress)) < 1e-6 * 6e5
        found[point].add(np.round(s, 12).tobytes())
        least[point] = min(least[point], energy(strip, forces[point], s))
    assert [len(one) for one in found] == root["solutions"].values.tolist()
    np.testing.assert_allclose(root["energy"], least + strip.held * forces**2, rtol=1e-9)
    np.testing.assert_allclose(root["debonded_length"], [0.0, 0.0, 41.15e-3], atol=0.01e-3)


def test_a_crossed_mesh_has_29_equilibria_at_12_kN_per_m() -> None:
    """20 × 4 squares of four triangles each; the openings alone are unknowns."""
    grid = np.stack(
        np.meshgrid(np.linspace(0, LENGTH, 21), np.linspace(0, HEIGHT, 5), indexing="ij"), 2
    )
    corner = np.arange(105).reshape(21, 5)
    ring = [corner[:-1, :-1], corner[1:, :-1], corner[1:, 1:], corner[:-1, 1:]]
    squares = np.stack(ring, axis=2).reshape(-1, 4)
    middle = 105 + np.arange(80)
    around = [np.column_stack([squares[:, i], squares[:, (i + 1) % 4], middle]) for i in range(4)]
    points = grid.reshape(-1, 2)
    strip = condensed(
        np.concatenate([points, points[squares].mean(axis=1)]), np.concatenate(around), even=True
    )
    law = tcstudy.opening(tcstudy.law(points=SAW, odd=False))
    problem = tcstudy.ContactProblem(strip.A, 12e3 * strip.load, strip.c, law)
    found = tcstudy.all_solutions(problem)
    assert found.complete
    assert len(found) == 29
    assert found.stable.sum() == 15
    lowest = min(energy(strip, 12e3, s) for s in found.v)
    np.testing.assert_allclose([lowest, found.energy[0]], -0.231841154, rtol=1e-8)
    np.testing.assert_allclose(tcstudy.solve(problem).energy, lowest, rtol=1e-9)
