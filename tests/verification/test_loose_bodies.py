"""Bodies that contact alone restrains: a lap strip under a force in closed form, in every kind of
study; what no equilibrium resists fails with its motion."""

from pathlib import Path

import numpy as np
import pytest
import xarray as xr

import tcstudy
from tcstudy.data.schema import PointStatus
from tcstudy.errors import StudyError
from tcstudy.read.study import read_study_text
from tcstudy.study.lint import lint
from tests.commands import CONFIGS
from tests.verification.gallery_forms import LapStrip

pytestmark = pytest.mark.filterwarnings("ignore:contact alone restrains the body")

LAP = LapStrip(stiffness=140e6, length=0.4, tau=2e6, s0=50e-6, sf=150e-6)
TEXT = (CONFIGS / "lap_force.yaml").read_text(encoding="utf-8")
RUN = TEXT.partition("path:")[0]
FORCE = "boundary.right.force_x"
REMEDY = "pull by a displacement"


def results(target: Path, *changes: str, text: str = RUN) -> xr.DataTree:
    study = read_study_text(text, "lap.yaml", changes)
    return tcstudy.run(study, target / "lap.nc", force=True).tree


def finest(tree: xr.DataTree) -> xr.Dataset:
    """The points of the last level."""
    return tree.to_dataset().isel(level=-1)


def reasons(tree: xr.DataTree) -> list[str]:
    return [str(reason) for reason in np.ravel(finest(tree)["reason"].values)]


def test_the_numbers_of_the_study_are_those_of_the_closed_form() -> None:
    assert LAP.softens_from == pytest.approx(118.3212e3, rel=1e-6)
    assert LAP.long_peak == pytest.approx(204.9390e3, rel=1e-6)
    assert "118.3212 kN/m" in TEXT
    assert "204.9390 kN/m" in TEXT
    assert LAP.slip(204.93e3, np.array(0.4)) == pytest.approx(LAP.sf, rel=3e-2)


def test_a_run_has_the_slips_of_the_bar_and_fails_with_the_motion_beyond_its_peak(
    tmp_path: Path,
) -> None:
    forces = [50e3, 118e3, 150e3, 200e3, 210e3, 896e3]
    tree = results(tmp_path, f"sweep={{{FORCE}: {forces}}}")
    data, line = finest(tree), tree["level_0"].to_dataset()
    assert data["status"].values.tolist() == [*[PointStatus.OK] * 4, *[PointStatus.SINGULAR] * 2]
    u_T = line["u_T"].values
    for slips, force, error in zip(u_T[:4], forces[:4], [1e-3, 1e-3, 1e-3, 2e-3], strict=True):
        expected = LAP.slip(force, line["x"].values)
        assert slips == pytest.approx(expected, rel=error, abs=error * expected.max())
    assert data["friction_resultant"].values[:4] == pytest.approx(forces[:4], rel=1e-9)
    assert np.all(data["lambda_1"].values == 0.0)
    assert data["strict_minimum"].values[:4].tolist() == [1, 1, 1, 1]
    assert not np.any(data["unique"].values == 1)
    after_peak, too_much = reasons(tree)[4:]
    assert after_peak.startswith("it can slide along x once the bond has failed, and no ")
    assert too_much.startswith("it can slide along x: the load along that is 1.12 times what ")
    assert REMEDY in after_peak
    assert REMEDY in too_much


@pytest.mark.parametrize("maxh", [8, 4, 2])
def test_a_path_has_the_first_softening_and_the_peak(tmp_path: Path, maxh: int) -> None:
    tree = results(tmp_path, f"mesh.maxh={maxh} mm", text=TEXT)
    data = tree.to_dataset()
    t, slip = data["parameter"].values, np.max(data["u_T"].values, axis=1)
    assert 1e5 * t.max() == pytest.approx(LAP.long_peak, rel=1e-4 * maxh)
    first = int(np.argmax(slip >= LAP.s0 * (1.0 - 1e-9)))
    assert 1e5 * t[first] == pytest.approx(LAP.softens_from, rel=4e-4 * maxh)
    assert t[-1] == pytest.approx(0.0, abs=1e-9)
    assert data.attrs["end_reason"] == "the body can slide along x once the bond has failed"
    assert data.attrs["shortfalls"] == ""
    assert np.all(data["stable"].values[: int(np.argmax(t > 2.0))])
    assert not data["stable"].values[-1]


def test_a_history_unloads_along_the_secant_and_ends_at_the_peak(tmp_path: Path) -> None:
    """Damage remembers the largest slip: half the load has half the slips, and pulling again goes
    back to where it was unloaded."""
    steps = "[{F: 0.15 MN/m, in: 3}, {F: 75 kN/m}, {F: 0.15 MN/m}, {F: 240 kN/m, in: 3}]"
    history = f"history={{memory: damage, steps: {steps.replace('F:', FORCE + ':')}}}"
    data = results(tmp_path, history, f"{FORCE[:-2]}=[0, 0]").to_dataset()
    u_T = data["u_T"].values
    pulled = LAP.slip(150e3, data["x"].values)
    assert u_T[3] == pytest.approx(pulled, rel=1e-3, abs=1e-3 * pulled.max())
    assert u_T[4] == pytest.approx(0.5 * u_T[3], rel=1e-9)
    assert u_T[5] == pytest.approx(u_T[3], rel=1e-9)
    assert data["dissipated"].values[4:6] == pytest.approx([0.0, 0.0], abs=1e-12)
    status = data["status"].values.tolist()
    assert status[:7] == [PointStatus.OK] * 7
    assert status[7] > PointStatus.OK
    reason = str(data["reason"].item())
    assert reason.startswith("it can slide along x, and no equilibrium was found in this step")
    assert REMEDY in reason


def test_a_fit_finds_the_bond_from_slips_of_the_loaded_end(tmp_path: Path) -> None:
    forces = np.linspace(40e3, 195e3, 12)
    ends = [float(LAP.slip(force, np.array([LAP.length]))[0]) for force in forces]
    rows = [f"{force:.9g},{slip:.9g}" for force, slip in zip(forces, ends, strict=True)]
    (tmp_path / "lap.csv").write_text("\n".join(["F [N/m],u [m]", *rows]), encoding="utf-8")
    fit = f"""
fit:
  data: {{file: lap.csv, columns: {{{FORCE}: "F [N/m]", u_T_max: "u [m]"}}}}
  noise: {{u_T_max: 0.2 um}}
  starts: 1
  parameters:
    friction.tau: {{start: 3 MPa, within: [1 MPa, 10 MPa]}}
    friction.sf: {{start: 0.2 mm, within: [0.1 mm, 1 mm]}}
"""
    study = read_study_text(RUN + fit, "lap.yaml", source=tmp_path / "lap.yaml")
    tree = tcstudy.run(study, tmp_path / "fit.nc").tree
    estimate = tree["estimate"].values
    assert estimate == pytest.approx([LAP.tau, LAP.sf], rel=4e-3)


@pytest.mark.parametrize(
    ("law", "is_unique"),
    [
        ("{law: elastic-plastic, tau: 2 MPa, s0: 50 um}", True),
        ("{law: tresca, tau: 2 MPa}", True),
        ("{law: bilinear, tau: 2 MPa, s0: 50 um, sf: 150 um}", False),
        ("{law: exponential, a: 2 MPa, b: 0.5 MPa, delta: 100 um}", False),
    ],
)
def test_a_weak_spring_changes_nothing(tmp_path: Path, law: str, is_unique: bool) -> None:
    """The supported body, which has λ₁ > 0, has the slips of the loose one in the limit."""
    branch = "solver.branch=from-zero"  # the body on its spring has a lower one far away
    loose = results(tmp_path, f"friction={law}", branch)
    spring = "boundary.left={role: traction, g: [0, 0], spring: {normal: 1 MPa/m}}"
    held = results(tmp_path, f"friction={law}", spring, branch)
    for tree in (loose, held):
        assert finest(tree)["status"].item() == PointStatus.OK
    assert finest(held)["lambda_1"].item() > 0.0
    assert bool(finest(loose)["unique"].item() == 1) == is_unique
    u_T, supported = (tree["level_0"]["u_T"].values.ravel() for tree in (loose, held))
    assert u_T == pytest.approx(supported, rel=1e-5, abs=1e-6 * supported.max())


@pytest.mark.parametrize("solver", ["separable-newton", "bundle-newton"])
def test_turned_strips_have_the_same_slips(tmp_path: Path, solver: str) -> None:
    """Pulled to the left, or along y."""
    left = RUN.replace("  right: {role: traction, force: [100 kN/m, 0 N/m]}", "  right: free")
    left = left.replace("  left: free", "  left: {role: traction, force: [-100 kN/m, 0]}")
    turned = RUN.replace("width: 400 mm, height: 2 mm", "width: 2 mm, height: 400 mm")
    for old, new in (("bottom: contact", "right: contact"), ("  right: {", "  top: {"),
                     ("top: free", "bottom: free"), ("[100 kN/m, 0 N/m]", "[0, 100 kN/m]")):  # fmt: skip
        turned = turned.replace(old, new)
    for text, sense in ((RUN, 1.0), (left, -1.0), (turned, 1.0)):
        tree = results(tmp_path, f"solver.name={solver}", text=text)
        line = tree["level_0"].to_dataset()
        along = line["y"].values if text is turned else line["x"].values
        along = LAP.length - along if text is left else along
        expected = sense * LAP.slip(100e3, along)
        error = 1e-3 * np.max(np.abs(expected))
        assert line["u_T"].values.ravel() == pytest.approx(expected, abs=error)


RING = """
units: none
body:
  outline: [{from: [2, 0], edge: rim, through: [0, 2]}, {from: [-2, 0], edge: rim, through: [0, -2]}]
  holes: [{circle: {center: [0, 0], radius: 1, edge: bore}}]
parameters: {q: 1}
boundary: {bore: contact, rim: {role: traction, g: ["-q*y/2", "q*x/2"]}}
material: {E: 1000, nu: 0.3}
friction: {law: tresca, tau: 5}
mesh: {maxh: 0.2}
sweep: {q: [-2, -1.2, 1, 1.3]}
"""


def test_a_ring_on_its_shaft_turns_when_the_torque_exceeds_that_of_friction(
    tmp_path: Path,
) -> None:
    """The torque 2π R² q against 2π r² τ at most: 4 q/τ."""
    tree = results(tmp_path, text=RING)
    good, bad = PointStatus.OK, PointStatus.SINGULAR
    assert finest(tree)["status"].values.tolist() == [bad, good, good, bad]
    line = tree["level_0"].to_dataset()
    torque = line["xi"].values[1:3] @ line["c"].values / (2.0 * np.pi)
    assert np.abs(torque) == pytest.approx([4.8, 4.0], rel=1e-2)
    assert torque[0] * torque[1] < 0.0
    for reason, ratio in zip(reasons(tree)[::3], (1.6, 1.04), strict=True):
        assert reason.startswith("it can turn about (0, 0): the load along that is ")
        assert float(reason.split(" times")[0].split()[-1]) == pytest.approx(ratio, rel=1e-2)


@pytest.mark.parametrize(
    ("change", "key"),
    [
        ("mesh.guarantee=true", "mesh.guarantee"),
        ("mesh.guarantee=polygon", "mesh.guarantee"),
        ("mesh={maxh: 4 mm, tolerance: 0.1, of: error_bound}", "mesh.of"),
        ("path={parameter: load, from: 0, to: 1, complete: true}", "path.complete"),
        ("output={live: true}", "output.live"),
    ],
)
def test_proofs_that_need_supports_are_refused_with_the_motion(change: str, key: str) -> None:
    with pytest.raises(StudyError) as error:
        read_study_text(RUN, "lap.yaml", [change])
    (problem,) = error.value.problems
    assert problem.key == key
    assert "which can slide along x, so that lambda_1 is 0" in problem.what
    assert "add supports or springs" in problem.remedy or "by supports" in problem.remedy


def test_a_motion_that_nothing_can_resist_is_refused() -> None:
    with pytest.raises(
        StudyError, match=r"can still slide along x; .* give the contact a friction"
    ):
        read_study_text(RUN, "lap.yaml", ["friction={law: tresca, tau: 0}"])


SWEPT = "sweep={friction: {none: {law: tresca, tau: 0}, some: {law: tresca, tau: 1 MPa}}}"


def test_a_point_without_friction_fails_alone(tmp_path: Path) -> None:
    tree = results(tmp_path, SWEPT)
    assert finest(tree)["status"].values.tolist() == [PointStatus.SINGULAR, PointStatus.OK]
    assert reasons(tree)[0].startswith("it can slide along x, and nothing resists that; ")


SOLE_REMEDY = "pull by a displacement (a rigid edge with u_x or u_y), or lower the load"
SLAB = """
body: {rectangle: {width: 6 m, height: 0.2 m}}
boundary: {bottom: contact, left: free, right: free, top: free}
material: {E: 30 GPa, nu: 0, plane: stress}
friction: {law: tresca, tau: 1 kPa}
adhesion: {bottom: {law: linear, k: 0, closing: 200 GPa/m}}
loads: {f: [0, -24 kN/m^3]}
mesh: {maxh: 0.1}
"""
RIGID = SLAB.replace("bottom: contact", "bottom: {role: contact, normal: unilateral}").replace(
    "adhesion: {bottom: {law: linear, k: 0, closing: 200 GPa/m}}\n", ""
)


@pytest.mark.parametrize("text", [SLAB, RIGID], ids=["soft", "rigid"])
@pytest.mark.parametrize(
    ("f", "top", "motion", "ratio"),
    [
        ("[4 kN/m^3, -24 kN/m^3]", "0", "", 0.0),
        ("[-6 kN/m^3, -24 kN/m^3]", "0", "slide along x", 1.2),
        ("[0, 1 kN/m^3]", "0", "separate along y", np.inf),
        ("[0, -24 kN/m^3]", "1500*x", "turn about (0, 0)", np.inf),
    ],
)
@pytest.mark.filterwarnings("ignore:elements of 100 mm are large")
def test_a_slab_that_only_lies_there_slides_separates_or_tips(
    tmp_path: Path, text: str, f: str, top: str, motion: str, ratio: float
) -> None:
    """Weight of 28.8 kN/m, friction of 6 kN/m. A lift of 1.5 kPa/m x is 27 kN/m, less than the
    weight, but its moment about the left end is 108 kN, and that of the weight 86.4 kN."""
    load = f'boundary.top={{role: traction, g: [0, "{top}"]}}'
    tree = results(tmp_path, f"loads.f={f}", load, text=text)
    (reason,) = reasons(tree)
    if not motion:
        assert finest(tree)["status"].item() == PointStatus.OK
        assert finest(tree)["friction_resultant"].item() == pytest.approx(4e3 * 6 * 0.2, rel=1e-8)
        assert finest(tree)["adhesion_resultant"].item() == pytest.approx(-28.8e3, rel=1e-8)
        return
    assert reason.startswith(f"it can {motion}")
    if np.isfinite(ratio) and text is RIGID:  # there friction knows the pressure
        assert reason.endswith(f"the friction of the pressed edge balances the load; {SOLE_REMEDY}")
    elif np.isfinite(ratio):
        assert float(reason.split(" times")[0].split()[-1]) == pytest.approx(ratio, rel=1e-2)
    else:
        remedy = "press the body on" if "separate" in motion else REMEDY
        assert reason.startswith(f"it can {motion}, and nothing resists that; {remedy}")


@pytest.mark.parametrize("f_x", [7.1, 7.3, -7.1, -7.3])
@pytest.mark.filterwarnings("ignore:elements of 100 mm are large")
def test_a_heavy_slab_slides_beyond_mu_times_its_weight(tmp_path: Path, f_x: float) -> None:
    """μ = 0.3 of 24 kN/m³: 7.2 kN/m³, however the pressure is distributed."""
    tree = results(
        tmp_path,
        "friction={law: coulomb, mu: 0.3}",
        f"loads.f=[{f_x} kN/m^3, -24 kN/m^3]",
        text=RIGID,
    )
    if abs(f_x) < 7.2:
        assert finest(tree)["status"].item() == PointStatus.OK
        resultant = finest(tree)["friction_resultant"].item()
        assert resultant == pytest.approx(1.2e3 * f_x, rel=1e-8)
    else:
        assert finest(tree)["status"].item() == PointStatus.SINGULAR
        found = "it can slide along x: no state was found in which the friction of the pressed edge"
        assert reasons(tree)[0].startswith(found)


@pytest.mark.filterwarnings("ignore:elements of 100 mm are large")
def test_a_heavy_slab_whose_states_take_turns_is_not_said_to_separate(tmp_path: Path) -> None:
    """μ = 40 on a slab that curls: its weight presses it on all the same."""
    warm = ("material.alpha_T=1e-5", "heat={theta: '8*(y/0.2 - 1)'}")
    tree = results(tmp_path, "friction={law: coulomb, mu: 40}", *warm, text=RIGID)
    assert finest(tree)["status"].item() == PointStatus.NOT_CONVERGED
    assert "the pressures did not settle in" in reasons(tree)[0]


@pytest.mark.parametrize("text", [RIGID, SLAB], ids=["rigid", "soft"])
def test_a_base_that_cannot_pull_is_no_bond_that_fails(text: str) -> None:
    study = read_study_text(text, "slab.yaml")
    notes = [note for note in lint(study) if note.startswith("contact alone")]
    assert len(notes) == 1
    assert "unless pressed, it can slide" not in notes[0]
    assert "unless pressed, it can move along x" in notes[0]
    pulled = read_study_text(SLAB, "slab.yaml", ["adhesion.bottom.k=1 GPa/m"])
    assert any("once that has failed" in note for note in lint(pulled))


GLUED = """
body:
  outline:
    - {from: [0, 0], edge: notch}
    - {from: [30 mm, 0], edge: glue}
    - {from: [90 mm, 0], edge: back}
    - {from: [90 mm, 6 mm], edge: top}
    - {from: [0, 6 mm], edge: tip}
boundary:
  notch: {role: contact, normal: unilateral}
  glue: contact
  back: free
  top: free
  tip: {role: traction, force: [0, 20 kN/m]}
material: {E: 70 GPa, nu: 0.3}
adhesion: {glue: {law: bilinear, sigma: 5 MPa, s0: 5 um, sf: 60 um}}
friction: {glue: {law: bilinear, tau: 8 MPa, s0: 8 um, sf: 60 um}, notch: {law: coulomb, mu: 0.2}}
mesh: {maxh: 2 mm}
"""


@pytest.mark.filterwarnings("ignore:elements of 2 mm are large")
@pytest.mark.filterwarnings("ignore:the softening zone")
def test_a_glued_beam_is_torn_off_by_its_load_not_for_want_of_one(tmp_path: Path) -> None:
    """The bond carries 300 kN/m if it shares the load, but its end fails first and then the rest."""
    (torn,) = reasons(results(tmp_path, text=GLUED))
    assert torn.startswith("it can separate along y once the bond has failed, and no equilibrium")
    assert torn.endswith("press the body onto its foundation, or support it")
