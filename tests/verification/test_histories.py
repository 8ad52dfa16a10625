"""Load histories against closed forms: those in the heads of the gallery's studies, and bars on
films that remember."""

from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from numpy.typing import NDArray

from tcstudy.read.study import read_study, read_study_text
from tcstudy.reports.terminal.summary import text_of
from tcstudy.study.history_run import execute_history
from tests.commands import CONFIGS

Array = NDArray[np.float64]


def followed(folder: Path, name: str, *overrides: str) -> tuple[xr.Dataset, str]:
    execute_history(read_study(CONFIGS / name, overrides), folder / "a.nc")
    with xr.open_dataset(folder / "a.nc") as opened:
        data = opened.load()
    assert np.all(data["status"].values == 1)
    assert np.all(data["identity"].values <= 1e-14)
    return data, " ".join(text_of(folder / "a.nc").split())


def test_rail_through_a_year(tmp_path: Path) -> None:
    """Half of the summer's way stays, the winter mirrors the summer; the second year dissipates
    what the first did."""
    data, said = followed(tmp_path, "rail_year.yaml", "mesh.maxh=344 mm")
    names, year = data["step_name"].values, data["cycle"].values
    ends = {
        name: 1e3 * data["u_T"].values[(names == name) & (year == 1), -1][0]
        for name in names[year == 1]
        if name
    }
    expected = {"summer": 18.555264, "autumn": 9.277632, "winter": -18.555264, "spring": -9.277632}
    for name, end in expected.items():
        assert ends[name] == pytest.approx(end, rel=2e-4), name
    a_rail = 76.70e-4 / 0.172
    spent = data["dissipated"].values * a_rail
    assert np.all(np.abs(data["closure"].values) <= 1e-10 * data["dissipated"].values.max())
    assert spent[:3].sum() == pytest.approx(4781.914, rel=1e-3)
    assert spent[year == 2].sum() == pytest.approx(2 * 9563.828, rel=1e-2)
    autumn = int(np.flatnonzero(names == "autumn")[0])
    tension = np.abs(np.cumsum((data["xi"].values[autumn] * data["c"].values)[::-1])).max() * a_rail
    assert tension == pytest.approx(386.568e3, rel=0.03)  # half a cell of 38.66 m
    assert (
        "plastic shakedown: the last cycle leaves no net slip; it dissipates 42" in said
    )  # more than the virgin one


def test_pipeline_walks_start_up_by_start_up(tmp_path: Path) -> None:
    """55.64603 mm a cycle at every point of the line."""
    data, said = followed(tmp_path, "pipeline_cycles.yaml", "history.repeat=3")
    cold = data["u_T"].values[data["step_name"].values == "shut-down"]
    walked = np.diff(cold, axis=0)
    assert walked == pytest.approx(55.64603e-3, rel=2e-4)
    assert np.ptp(walked) <= 1e-10
    assert "along its exact path" in said
    assert "walking: the last two cycles each moved the whole contact line by 55.6" in said


def test_strip_pulled_let_go_and_pulled_again(tmp_path: Path) -> None:
    """Force and dissipation at every named step; unloading is straight to the origin, and costs
    nothing."""
    data, _ = followed(tmp_path, "cyclic_pull.yaml", "mesh.maxh=2 mm")
    names = data["step_name"].values
    force = {str(n): 1e-3 * float(data["friction_resultant"][i]) for i, n in enumerate(names) if n}
    expected = {
        "pulled": 220.59121,
        "pushed": -110.29560,
        "pulled again": 220.59121,
        "unloaded": 40.107492,
    }
    for name, value in expected.items():
        assert force[name] == pytest.approx(value, rel=6e-4), name
    spent = data["dissipated"].values
    assert spent[:6].sum() == pytest.approx(47.573517, rel=8e-4)
    assert np.all(spent[6:9] <= 1e-12)
    assert np.all(np.abs(data["closure"].values) <= 1e-8 * spent.sum())


def closed(folder: Path, text: str) -> xr.Dataset:
    """The data of a history, every step solved along its path, nothing missed."""
    execute_history(read_study_text(text), folder / "a.nc")
    with xr.open_dataset(folder / "a.nc") as opened:
        data = opened.load()
    assert data["reason"].item() == ""
    assert np.all(np.abs(data["closure"].values) <= 1e-8 * float(np.abs(data["work"]).sum()))
    return data


def test_a_film_as_steep_as_the_block_is_stiff(tmp_path: Path) -> None:
    """ω = λ₁ in uniform shear: at U = 0.5 m every slip from 0 to 0.4 m is in balance; the block
    goes on from 0.4 m, nothing is released."""
    steps = ", ".join(f"{{boundary.top.u_x: {way} m}}" for way in (0.8, 1.2, 0.8, -0.2))
    text = f"""
body: {{rectangle: {{width: 1.3 m, height: 1 m}}}}
boundary: {{bottom: contact, top: {{role: clamped, u_x: 0, u_y: 0}}, left: {{role: clamped, u_x: free, u_y: 0}},
           right: {{role: clamped, u_x: free, u_y: 0}}}}
material: {{E: 4 Pa, nu: 0}}
friction: {{law: piecewise-linear, points: [[0, 1 Pa], [0.4 m, 0.2 Pa]]}}
mesh: {{maxh: 0.4 m}}
history: {{memory: friction, steps: [{steps}]}}
"""
    data = closed(tmp_path, text)
    assert np.abs(data["u_T"].values[1:, 0]) == pytest.approx([0.7, 1.1, 0.9, 0.1], abs=1e-12)
    assert float(data["released"].sum()) <= 1e-5 * float(data["dissipated"].sum())


STRIP = """
body: {{outline: [{{from: [0 mm, 0 mm], edge: bond}}, {joint} {{from: [{end}, 0 mm], edge: grip}},
                 {{from: [{end}, 1 mm], edge: top}}, {{from: [0 mm, 1 mm], edge: left}}]}}
boundary: {{bond: contact, {edges}, top: free, left: free}}
material: {{E: 42.24 GPa, nu: 0, plane: stress}}
friction: {friction}
mesh: {{maxh: 1 mm}}
history: {{memory: {memory}, steps: [{steps}]}}
"""
"""A strip of D = 42.24 kN/mm on a film, a bar 1 mm high pulled at its right end."""
D, TAU, S_0, S_F = 42.24e6, 7.2e6, 0.02e-3, 0.16e-3
BILINEAR = "{law: bilinear, tau: 7.2 MPa, s0: 0.02 mm, sf: 0.16 mm}"


def energy(s: Array) -> Array:
    """T = ∫ b of the bilinear law, so that a long bond has P² = 2 D T(Δ) as it is first pulled
    [J/m²]."""
    falls = np.clip(s, S_0, S_F) - S_0
    return TAU * (0.5 * np.minimum(s, S_0) ** 2 / S_0 + falls - 0.5 * falls**2 / (S_F - S_0))


def spent(s: Array) -> Array:
    """R = T − ½ s b, what damage up to the slip s has dissipated [J/m²]."""
    return energy(s) - 0.5 * s * TAU * np.minimum(s / S_0, np.maximum(S_F - s, 0.0) / (S_F - S_0))


def test_a_long_bond_of_a_bilinear_law_is_torn_from_its_end(tmp_path: Path) -> None:
    """The front moves by D/P_max a slip of the end; the way back is straight to the origin and
    costs nothing."""
    ways = np.array([0.01, 0.5, 0.2, -0.3])
    steps = ", ".join(f"{{boundary.grip.u_x: {way} mm}}" for way in ways)
    grip = "grip: {role: clamped, u_x: 0 mm, u_y: free}"
    scene = STRIP.format(
        joint="", end="190 mm", edges=grip, friction=BILINEAR, memory="damage", steps=steps
    )
    data, P = closed(tmp_path, scene), np.sqrt(2.0 * D * energy(np.array(S_F)))
    assert data["friction_resultant"].values[2:] == pytest.approx(ways[1:] / ways[1] * P, rel=5e-4)
    s = np.linspace(S_0, S_F, 20_001)
    zone = np.trapezoid(spent(s) / np.sqrt(2.0 * energy(s) / D), s)
    length = (0.5e-3 - S_F) * D / P
    lost = np.cumsum(data["dissipated"].values)[1:]
    assert lost == pytest.approx([0.0, *[zone + energy(np.array(S_F)) * length] * 3], rel=1e-3)
    assert data["debonded_from"].values[1:] == pytest.approx(
        [np.nan, *[0.19 - length] * 3], rel=5e-4, nan_ok=True
    )
    assert data["debonded_to"].values[-1] == pytest.approx(0.19)
    kappa = data["kappa"].values[-1]
    lost = data["dissipation"].values.sum(axis=0)  # of every node
    assert lost == pytest.approx(
        np.where(kappa > S_0, spent(kappa), 0.0), abs=1e-12 * energy(np.array(S_F))
    )
    assert lost @ data["c"].values == pytest.approx(data["dissipated"].values.sum(), rel=1e-13)


def test_a_bond_that_damages_beside_a_joint_that_slides(tmp_path: Path) -> None:
    """Pulled by P, then by P': the joint of length l turns all its friction r, the bond behind it
    goes back straight.

    P_b = P − r l pulls the bond to Δ, P'_b = P' + r l leaves Δ P'_b/P_b; the joint adds ∫ N/D. The
    node between them has the memory of one for the law of both: an error of first order.
    """
    own, r, P = 60e-3, 1e6, np.array([200e3, 40e3])
    on_bond, s = P + np.array([-r * own, r * own]), np.linspace(0.0, S_F, 200_001)
    ends = on_bond / on_bond[0] * np.interp(on_bond[0] ** 2 / (2.0 * D), energy(s), s)
    ways = ends + (0.5 * own / D) * (P + on_bond)
    scene = STRIP.format(
        joint="{from: [190 mm, 0 mm], edge: joint},",
        end="250 mm",
        edges="joint: contact, grip: {role: clamped, u_x: 0 mm, u_y: free}",
        friction=f"{{bond: {BILINEAR}, joint: {{law: tresca, tau: 1 MPa}}}}",
        memory="{bond: damage, joint: friction}",
        steps=", ".join(f"{{boundary.grip.u_x: {way:.15g} m}}" for way in ways),
    )
    data = closed(tmp_path, scene)
    assert data["friction_resultant"].values[1:] == pytest.approx(P, rel=5e-3)
    found = [np.interp(0.19, data["arclength"].values, u) for u in data["u_T"].values[1:]]
    assert (found, data.attrs["memory"]) == (
        pytest.approx(ends, rel=1e-2),
        "bond: damage, joint: friction",
    )
