"""configs/pull_test.yaml: a strip on a linearly softening film, its branch in closed form (source in the study).

The closed form is that of a bar: as the strip gets thinner at the same stiffness D = E H the errors fall fourfold.
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from tests.commands import CONFIGS
from tests.verification.test_path_patch import path_of

TEXT = (CONFIGS / "pull_test.yaml").read_text()
THIN = TEXT.replace(", 1 mm]", ", 0.5 mm]").replace("42.24 GPa", "84.48 GPa").replace("maxh: 1 mm", "maxh: 0.5 mm")
MM = 1e-3


def rising(data: xr.Dataset) -> tuple[np.ndarray, np.ndarray]:
    """(u_x [mm], P [N/mm]) at the folds with u_x > 0, the lower one last."""
    folds = data["fold_vertex"].values
    t = data["parameter"].values[folds] / MM
    force = data["xi"].values[folds] @ data["c"].values * MM
    order = np.argsort(-t[t > 0])
    return t[t > 0][order], force[t > 0][order]


@pytest.fixture(scope="module", params=[(TEXT, 190, 4e-4), (THIN, 380, 1e-4)], ids=["190 nodes", "380 nodes"])
def pulled(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> tuple[xr.Dataset, float]:
    text, nodes, accuracy = request.param
    data = path_of(text, tmp_path_factory.mktemp("pull"))
    assert int(data["n_contact"]) == nodes
    return data, accuracy


def test_no_residual_stress_is_left(pulled: tuple[xr.Dataset, float]) -> None:
    """Both folds, the greatest force, three equilibria at 0.3, 0.5 and 0.7 mm with their energies and forces."""
    data, accuracy = pulled
    (upper, lower), (force, none) = rising(data)
    assert upper == pytest.approx(0.9009152, rel=accuracy)
    assert force == pytest.approx(220.5912, rel=1.5 * accuracy)
    assert lower == pytest.approx(0.16, rel=1e-9)
    assert none == pytest.approx(0.0, abs=1e-6)
    assert data["solution_count"].values.tolist() == [3, 3, 3]
    at = data["solution_at"].values == 1
    assert data["solution_energy"].values[at] == pytest.approx([102.7213, 126.6487, 109.4400], rel=accuracy)
    forces = data["solution_xi"].values[at] @ data["c"].values * MM
    d, s_c = 42.24e3, 48.12554
    assert forces == pytest.approx([220.5912, d * (0.5 - 0.16) / (190 - s_c), 0.0], rel=2e-3, abs=1e-5)
    assert data["solution_stable"].values[at].tolist() == [1, 0, 1]


def test_least_energy_changes_at_the_maxwell_point(pulled: tuple[xr.Dataset, float]) -> None:
    data, _ = pulled
    lowest, at = data["solution_lowest"].values, data["solution_at"].values
    assert [int(np.argmax(lowest[at == i])) for i in (0, 1, 2)] == [0, 0, 2]
    jump = np.flatnonzero(np.abs(np.diff(data["lowest_piece"].values)) > 10)
    ends = data["lowest_end"].values[jump] / MM
    assert np.min(np.abs(ends - 0.5304576)) <= 5e-4


def test_the_loop_closes(pulled: tuple[xr.Dataset, float]) -> None:
    data, _ = pulled
    assert (int(data["loop_complete"]), int(data["loop_closed"])) == (1, 1)
    assert float(data["energy_lost"]) == pytest.approx(float(data["loop_area"]), rel=1e-6)
    assert float(data["energy_lost"]) > 0.0


def test_kinks_reached_together_are_one_event(pulled: tuple[xr.Dataset, float]) -> None:
    """At u_x = 0.16 mm the whole softening zone lets go at once, and all of the strip is free of stress."""
    data, _ = pulled
    t, vertex = data["parameter"].values, data["event_vertex"].values
    fold = np.flatnonzero(np.abs(t - 0.16 * MM) <= 1e-9 * MM)
    assert len(fold) == 1
    softening = 48.12554 / 190 * int(data["n_contact"])
    assert np.count_nonzero(vertex == fold[0]) >= 0.95 * softening
    assert len(data["fold_vertex"]) == 4


def test_residual_stress(tmp_path: Path) -> None:
    """tau_k = 1.2 MPa: two folds with their forces."""
    text = TEXT.replace("tau_k: 0 MPa", "tau_k: 1.2 MPa").replace("to: 1.2 mm", "to: 1.8 mm")
    t, force = rising(path_of(text, tmp_path))
    assert t == pytest.approx([1.2561370, 0.6726111], rel=4e-4)
    assert force == pytest.approx([409.7469, 228.0799], rel=6e-4)


COARSE = TEXT.replace("maxh: 1 mm", "maxh: 4 mm")


def in_lengths_of(factor: float) -> str:
    """The coarse strip with every length so many times as large."""
    return re.sub(r"([\d.]+) mm", lambda length: f"{factor * float(length[1])!r} mm", COARSE)


@pytest.mark.parametrize(
    ("small", "large", "ratio", "accuracy"),
    [
        (in_lengths_of(2.0**-7), in_lengths_of(2.0**13), 2.0**20, 1e-13),
        # Netgen's own tolerance is a length: 1e-7 of this strip of 0.19 m, and less of that of kilometres.
        (COARSE, COARSE.replace(" mm", " km"), 1e6, 1e-6),
    ],
    ids=["powers of two", "kilometres"],
)
def test_any_size(tmp_path: Path, small: str, large: str, ratio: float, accuracy: float) -> None:
    """The same pieces and solutions, a million times as large: to rounding where the mesher gets the same numbers."""
    data, scaled = path_of(small, tmp_path), path_of(large, tmp_path)
    assert scaled.sizes["piece"] == data.sizes["piece"]
    for name, power in (("parameter", 1), ("u_T", 1), ("xi", 0), ("energy", 2), ("solution_energy", 2)):
        values = ratio**power * data[name].values
        bound = (accuracy if name != "xi" else 10.0 * accuracy) * np.max(np.abs(values))
        assert np.max(np.abs(scaled[name].values - values)) <= bound, name
    for name in ("stable", "state", "fold_vertex", "lowest_piece", "lowest_certified", "solution_stable"):
        assert np.array_equal(scaled[name].values, data[name].values), name


BONDED = """
body: {rectangle: {width: 300 mm, height: 2 mm}}
material: {E: 165 GPa, nu: 0.3}
boundary: {bottom: {role: contact}, right: {role: clamped, u_x: 0 mm, u_y: 0}, top: free, left: free}
friction: {LAW}
mesh: {maxh: 2 mm, levels: 1}
path: {parameter: boundary.right.u_x, from: 0, to: 1 mm}
"""


@pytest.mark.parametrize(
    "law",
    [
        "law: bilinear, tau: 7 MPa, s0: 40 um, G_f: 900 J/m^2",
        "law: trapezoidal, tau: 7 MPa, s0: 40 um, s1: 80 um, G_f: 0.9 N/mm",
    ],
)
def test_a_long_bond_bears_what_its_fracture_energy_says(law: str, tmp_path: Path) -> None:
    """max ∫ξ = √(2 G_f E′ t) whatever the shape of the law (Täljsten, Int. J. Adhes. Adhes. 16, 1996; Yuan et al.)."""
    data = path_of(BONDED.replace("LAW", law), tmp_path)
    force = np.abs(data["xi"].values @ data["c"].values)
    assert force.max() == pytest.approx(np.sqrt(2 * 900 * 165e9 / (1 - 0.3**2) * 2e-3), rel=2e-4)
