"""The gallery's studies against the numbers that stand in them: closed forms, balances (sources in
the studies)."""

import re
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

import tcstudy
from tests.commands import CONFIGS
from tests.verification.gallery_forms import (
    Array,
    Law,
    PeeledArm,
    SplitBeam,
    bar,
    curled,
    ring_slip,
    warped_die,
)

FIELDS = "output.fields=true"
LAWS = {
    "held": [(0.0, 2e5)],
    "softening": [(0.0, 2e5), (5e-3, 1e5)],
    "brittle": [(0.0, 0.0), (4e-6, 8e6), (4e-6, 2e6)],
    "drag": [(0.0, 7080.0)],
    "bonded": [(0.0, 35400.0), (1e-3, 7080.0)],
}


def run(name: str, target: Path, *changes: str) -> xr.DataTree:
    tree = tcstudy.run(
        tcstudy.load(str(CONFIGS / f"{name}.yaml"), list(changes)), target / f"{name}.nc"
    )
    assert np.all(tree["status"] == 1)
    return tree


def told(name: str, line: str) -> list[float]:
    """Numbers with three or more decimals in the line of a study's comment that has the text."""
    text = (CONFIGS / f"{name}.yaml").read_text(encoding="utf-8")
    found = next(one for one in text.splitlines() if one.startswith("#") and line in one)
    return [
        float(number)
        for number in re.findall(r"(?<![\d.])\d+\.\d{3,}(?![\d.])", found.replace(line, ""))
    ]


@pytest.mark.parametrize(
    ("name", "line", "law", "bar_of", "strains", "scale"),
    [
        (
            "welded_rail",
            "plastic      u =",
            [(0, 224250.33)],
            (210e9 * 0.172, 140),
            (2.4e-4, 4.8e-4, 7.2e-4),
            1e3,
        ),
        (
            *("welded_rail", "peaked       plastic", [(0, 448500.66), (2e-3, 224250.33)]),
            *((210e9 * 0.172, 140), (2.4e-4, 4.8e-4, 7.2e-4), 1e3),
        ),
        (
            "die",
            "    u_end = alpha ΔT",
            [(0, 0), (1e-3, 2e9)],
            (84.5e6, 5e-3),
            (3.6e-4, 7.2e-4, 1.44e-3, 2.16e-3),
            1e6,
        ),
        (
            "die",
            "a = 3.07981, 1.97388 mm,",
            LAWS["brittle"],
            (84.5e6, 5e-3),
            (1.44e-3, 2.16e-3),
            1e6,
        ),
        ("slab", "drag    u_end", LAWS["drag"], (6e9, 60), (1e-4, 3e-4), 1e3),
        ("slab", "bonded  35.4", LAWS["bonded"], (6e9, 60), (1e-4, 3e-4), 1e3),
    ],
)
def test_the_bar_has_the_numbers_that_the_studies_tell(
    name: str,
    line: str,
    law: Law,
    bar_of: tuple[float, float],
    strains: tuple[float, ...],
    scale: float,
) -> None:
    found = [
        scale * float(bar(law, *bar_of, strain, np.array([bar_of[1]]))[0]) for strain in strains
    ]
    assert found == pytest.approx(told(name, line), rel=1e-6)


def test_heat_of_the_bracket(tmp_path: Path) -> None:
    """What the heater gives, 500 W/m, leaves through the 272.111 mm of cooled edge at every point
    of the sweep."""
    tree = run(
        "quickstart",
        tmp_path,
        "mesh.levels=2",
        "sweep.friction={tresca: {law: tresca, tau: 40 MPa}}",
        FIELDS,
    )
    data = tree["level_1"].dataset.isel(friction=0)
    triangles = data["triangle"].values
    sides = np.sort(
        np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]]), axis=1
    )
    edges, count = np.unique(sides, axis=0, return_counts=True)
    x, y = (data[name].values[edges[count == 1]] for name in ("node_x", "node_y"))
    sides_of_air = (x - 0.2, y - 0.1, y - 0.1 + (x - 0.14) / 1.5)
    cooled = np.any([(np.abs(side) < 1e-9).all(axis=1) for side in sides_of_air], axis=0)
    lengths = np.hypot(*(np.diff(one[cooled], axis=1)[:, 0] for one in (x, y)))
    assert lengths.sum() == pytest.approx(0.14 + 0.06 + np.hypot(0.06, 0.04))
    theta = (
        data["theta"].values[..., edges[count == 1][cooled]].mean(axis=-1) @ lengths / lengths.sum()
    )
    alpha, theta_bar = data["alpha"].values[:, None], data["theta_bar"].values[None]
    assert theta == pytest.approx(theta_bar + 500.0 / (alpha * lengths.sum()), rel=1e-10)
    assert theta[1, 1] == pytest.approx(told("quickstart", "mean temperature")[-1], rel=1e-6)


def test_breathing_end_of_a_welded_rail(tmp_path: Path) -> None:
    """u_end = EA(αΔT)²/2r, ± u0/2 for ballast that is elastic first or has a peak; nothing is
    refused for rounding."""
    data = run("welded_rail", tmp_path).to_dataset().isel(level=0)
    assert np.all(data["inclusion_residual"] <= 1e-10)
    assert np.all(data["inclusion_status"] == 1)
    expected = {
        "plastic": [4.638816e-3, 18.555264e-3, 41.749344e-3],
        "en1991": [5.63882e-3, 19.5547e-3, 42.7127e-3],
        "peaked": [3.638816e-3, 17.555264e-3, 40.749344e-3],
    }
    for law, ends in expected.items():
        assert data["u_T_max"].sel(friction=law).values == pytest.approx(ends, rel=3e-5), law
    slides = 210e9 * 76.70e-4 * 1.2e-5 * np.array([20.0, 40.0, 60.0]) / 10e3
    assert data["slip_length"].sel(friction="plastic").values == pytest.approx(slides, abs=0.35)
    # the breathing length ends between two nodes 0.172 m apart
    lengths = {
        name: data[f"{name}_length"]
        for name in ("breathing", "yielded", "elastic", "softening", "debonded")
    }
    assert lengths["breathing"].sel(friction="plastic").values == pytest.approx(slides, abs=0.172)
    assert lengths["yielded"].sel(friction="plastic").values == pytest.approx(slides, abs=0.172)
    whole = lengths["yielded"] + lengths["elastic"]
    assert whole.sel(friction="en1991").values == pytest.approx(140.0, rel=1e-12)
    fallen = lengths["softening"] + lengths["debonded"]
    assert fallen.sel(friction="peaked").values == pytest.approx(
        lengths["breathing"].sel(friction="peaked").values
    )
    assert np.isnan(data["slip_length"].sel(friction="en1991")).all()


def test_end_of_a_hot_pipeline(tmp_path: Path) -> None:
    """Breakout and residual friction: slip length and end displacement, the first after a few cells
    of slip only."""
    data = run("pipeline_end", tmp_path).to_dataset().isel(level=0)
    error = np.abs(data["u_T_max"].values / [0.0029227, 0.0801092, 0.8009829, 2.2427303] - 1.0)
    assert np.all(error <= [6e-3, 1e-4, 2e-5, 1e-5])
    assert data["slip_length"].values == pytest.approx(
        [98.686, 594.454, 2134.783, 3675.111], abs=9.0
    )


def test_coated_block(tmp_path: Path) -> None:
    ends = 1e3 * run("coated_block", tmp_path, "mesh.levels=1")["u_T_max"].isel(level=0).values
    assert ends == pytest.approx(
        [*told("coated_block", "zirconia"), *told("coated_block", "polymer")], rel=3e-3
    )


@pytest.mark.parametrize("name", ["coated_block", "die", "friction_pad", "spring_rail"])
def test_the_proved_bound_is_the_one_that_the_study_tells(name: str, tmp_path: Path) -> None:
    text = (CONFIGS / f"{name}.yaml").read_text(encoding="utf-8")
    head = " ".join(line.lstrip("# ") for line in text.splitlines())
    percent = re.search(r"at most ([\d.]+) % in the energy norm", head)
    assert percent is not None
    bound = run(name, tmp_path)["error_bound_relative"].isel(level=-1).values.max()
    assert 0.98 * float(percent[1]) <= 100.0 * bound <= 1.01 * float(percent[1])


def test_slab(tmp_path: Path) -> None:
    """Ends with one temperature over the height; with a warmer surface, the stress of the curling
    that is held back."""
    tree = run("slab", tmp_path, FIELDS)
    data = tree.to_dataset().isel(level=0)
    ends = [told("slab", "drag    u_end"), told("slab", "bonded  35.4")]
    slips = 1e3 * data["u_T_max"].values
    for law, told_ends in enumerate(ends):
        assert slips[:2, law] == pytest.approx(told_ends, rel=2e-5)
        assert slips[2, law] == pytest.approx(told_ends[1], rel=4e-4)
    coarse = (
        1e3 * run("slab", tmp_path / "coarse", "mesh.maxh=200 mm")["u_T_max"].isel(level=0).values
    )
    for law, told_ends in enumerate(ends):  # what is left is the theory of bars, not the mesh
        assert coarse[:2, law] == pytest.approx(told_ends, rel=3e-5)
    level = tree["level_0"].dataset
    top = np.flatnonzero(level["node_y"].values > 0.2 - 1e-9)
    top = top[np.argsort(level["node_x"].values[top])]
    x, u = level["node_x"].values[top], level["u_x"].values[2, 0][top]
    stress = 30e9 * (np.diff(u) / np.diff(x) - 1e-5 * 36.0)
    assert np.interp(20.0, 0.5 * (x[1:] + x[:-1]), stress) == pytest.approx(-3.216e6, rel=1e-3)


def test_die(tmp_path: Path) -> None:
    """Suhir's compliance is nearer than the plain shear lag; where the attach breaks, the front's
    bar."""
    data = run("die", tmp_path)["u_T_max"]
    plain, better = told("die", "    u_end = alpha ΔT"), told("die", "k'/k")
    for level in (0, 1):
        found = 1e6 * data.isel(level=level).values
        assert found[:, 0] == pytest.approx(better, rel=2e-3)
        assert found[:, 0] == pytest.approx(plain, rel=6e-3)
        assert np.all(np.abs(found[:, 0] - plain) > np.abs(found[:, 0] - better))
        assert found[2:, 1] == pytest.approx(told("die", "a = 3.07981, 1.97388 mm,"), rel=1e-3)


def test_ring(tmp_path: Path) -> None:
    """Torque against turn of the housing: errors of the polygons fall like h²."""
    data = run("ring", tmp_path)
    torque = -0.02 * data["friction_resultant"].values  # the hole's edge runs clockwise
    for law, name in enumerate(("held", "softening")):
        line = told("ring", "held  " if law == 0 else "softening   to")
        exact = [
            2 * np.pi * 0.02**2 * ring_slip(LAWS[name], 1e6, 0.02, 0.04, u)[1]
            for u in (1e-3, 2e-3, 4e-3, 8e-3)
        ]
        assert exact == pytest.approx(line, rel=1e-6)
        errors = np.abs(torque[:, law] / np.array(exact)[:, None] - 1.0)
        assert np.all(errors <= [8e-3, 2.2e-3, 6e-4])
        assert np.all(errors[:, :-1] >= 2.8 * errors[:, 1:])


def path(name: str, target: Path, *changes: str) -> dict[str, Array]:
    """The variables of a path's file."""
    study = tcstudy.load(str(CONFIGS / f"{name}.yaml"), list(changes))
    tree = tcstudy.run(study, target / f"{name}.nc").tree
    return {str(key): variable.values for key, variable in tree.dataset.variables.items()}


def test_peeled_arm(tmp_path: Path) -> None:
    """Force at three ends, and the crack there, on 6 triangles over the arm."""
    arm = PeeledArm(70e9 * 1.5e-3**3 / 12.0, 20e6, 4e-6, 14e-6)
    cracks = np.array([32e-3, 36e-3, 42e-3])
    forces, ends = np.array([arm.state(crack) for crack in cracks]).T
    assert forces / 1e3 == pytest.approx(told("peel_arm", "    force"), rel=1e-6)
    assert ends * 1e3 == pytest.approx(told("peel_arm", "    end"), rel=1e-6)
    found = path("peel_arm", tmp_path, "mesh.maxh=0.25 mm")
    lowest = found["solution_lowest"] == 1
    assert found["solution_parameter"][lowest] == pytest.approx(ends, rel=1e-6)
    assert found["solution_force_left_y"][lowest] == pytest.approx(forces, rel=0.02)
    assert 30e-3 + found["solution_debonded_length"][lowest] == pytest.approx(cracks, rel=0.02)


def test_split_beam(tmp_path: Path) -> None:
    """Force and displacement of the end at four cracks, and both turns of the end; errors fall with h²."""
    beam = SplitBeam(70e9, 1.5e-3, 0.1, 20e6, 8e-6, 30e-6)
    cracks = np.array([34e-3, 42e-3, 50e-3, 60e-3])
    forces = np.array([beam.force(crack) for crack in cracks])
    assert forces / 1e3 == pytest.approx(told("split_beam", "    force"), rel=1e-6)
    starts = max(beam.end(30e-3, tip) for tip in np.linspace(25e-6, 30e-6, 2001))
    back, crack = min((beam.end(a), a) for a in np.linspace(45e-3, 52e-3, 701))
    assert told("split_beam", "The end turns at") == pytest.approx(
        [1e3 * starts, 1e3 * back], rel=1e-6
    )
    assert crack == pytest.approx(48.6e-3, abs=0.05e-3)
    errors = []
    for maxh in ("0.375 mm", "0.1875 mm"):
        found = path("split_beam", tmp_path / maxh, f"mesh.maxh={maxh}")
        end, force = found["parameter"], 2.0 * found["force_left_y"]
        failed = np.where(np.abs(found["u_T"]) >= 30e-6, found["arclength"], 0.0).max(axis=1)
        first = int(np.argmax(failed > 0.0))
        turns = end[: first + 1].max() / starts, end[first:].min() / back
        found_forces = np.interp(cracks, 30e-3 + failed[first:], force[first:])
        errors.append([*turns, *(found_forces / forces)])
    coarse, fine = np.abs(np.array(errors) - 1.0)
    assert np.all(fine < [8e-3, 2e-3, *4 * [0.02]])
    assert np.all(coarse > 3.0 * fine)


def test_curled_slab(tmp_path: Path) -> None:
    """Heights of the end, with errors that fall with h², and of the hump, which keeps 3 %."""
    beams = curled(30e9, 0.2, 24e3, 1e-5 * 10.0)
    data = run("curled_slab", tmp_path, "mesh.maxh=50 mm")
    for i, (name, (length, height)) in enumerate(beams.items()):
        assert told("curled_slab", f"    {name}") == pytest.approx([1e3 * height, length], rel=1e-6)
        coarse, fine = 1.0 - data["opening_max"].values[i] / height
        assert 0.0 < fine < 0.07
        assert coarse > (3.3 if name == "colder" else 2.0) * fine
        assert data["opened_length"].values[i, 1] == pytest.approx(length, rel=0.05)


def test_warped_die(tmp_path: Path) -> None:
    """Shear and peel at the end; a stiff attach feels the die's own compliance in its thickness."""
    tree = run("warped_die", tmp_path, "mesh.levels=1")
    level = tree["level_0"].dataset
    bounds = {50e9: (1e-3, 6e-3), 2000e9: (0.02, 0.06)}
    for i, (k, bound) in enumerate(bounds.items()):
        form = warped_die(130e9, 0.5e-3, 5e-3, 1e-3, k, 4.0 * k)
        assert told("warped_die", f"k_T {k / 1e9:4.0f}") == pytest.approx(
            [abs(1e-6 * stress) for stress in form], rel=2e-5
        )
        found = [float(level[name].values[i, -1]) for name in ("xi", "S_N")]
        assert np.all(np.abs(np.array(found) / form - 1.0) < bound)
