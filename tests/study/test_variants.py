"""Sweeps of body and mesh: exact scaling, the bits of single runs, refused geometries, what a stopped sweep keeps."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import xarray as xr

import tcstudy
from tcstudy.cli import main
from tcstudy.data.records import BlockRecord, PointStatus
from tcstudy.errors import StudyError
from tcstudy.read.study import read_study_text
from tcstudy.reports.terminal.summary import summary
from tcstudy.study.plan import plan
from tcstudy.study.run import Quiet, execute

SCALED = """
parameters: {s: 1}
body:
  rectangle: {width: "0.02*s", height: "0.01*s"}
  holes: [circle: {center: ["0.01*s", "0.005*s"], radius: "0.002*s", edge: bore}]
boundary: {bottom: contact, left: clamped, right: free, top: {role: traction, g: [5 MPa, -1 MPa]}, bore: free}
material: {E: 70 GPa, nu: 0.3}
friction: {law: tresca, tau: 2 MPa}
mesh: {maxh: "0.005*s"}
sweep: {tau: [3 MPa, 4 MPa], parameters.s: [1, 2]}
"""
BAR = """
body: {rectangle: {width: 200 mm, height: 20 mm}}
boundary: {bottom: contact, left: {role: clamped, u_x: 0}, right: {role: traction, g: [1 MPa, 0]}, top: free}
material: {E: 70 GPa, nu: 0, plane: stress}
friction: {law: linear, k: 0}
mesh: {maxh: 20 mm, levels: 2}
sweep: {body.rectangle.width: [400 mm, 100 mm, 200 mm], E: [70 GPa, 35 GPa]}
"""
HOLED = """
parameters: {height: 20 mm}
body:
  rectangle: {width: 100 mm, height: height}
  holes: [circle: {center: [50 mm, "0.5*height"], radius: 6 mm, edge: bore}]
boundary: {bottom: contact, left: clamped, right: free, top: {role: traction, g: [5 MPa, 0]}, bore: free}
material: {E: 210 GPa, nu: 0.3}
friction: {law: tresca, tau: 2 MPa}
mesh: {maxh: 10 mm}
sweep: {parameters.height: [10 mm, 20 mm, 30 mm]}
"""


def run(text: str, path: Path, *changes: str) -> xr.DataTree:
    return tcstudy.run(read_study_text(text, "study", changes), path)


@pytest.fixture(scope="module")
def bar(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The file of BAR, which no test changes."""
    path = tmp_path_factory.mktemp("bar") / "out.nc"
    run(BAR, path)
    return path


def test_doubling_all_lengths_at_the_same_law_scales(tmp_path: Path) -> None:
    """At one stress u ∝ s, ∫ξ ∝ s, energy ∝ s², λ₁ ∝ 1/s, as the law knows no length."""
    data = run(SCALED, tmp_path / "out.nc").to_dataset().isel(level=0)
    for name, power in (("u_T_max", 1), ("slip_length", 1), ("friction_resultant", 1), ("energy", 2), ("lambda_1", -1)):
        values = data[name].transpose("tau", "s").values
        assert np.allclose(values / values[:, :1], np.array([1.0, 2.0]) ** power, rtol=1e-9), name
    assert 0.0 < float(data["slip_length"][0, 0]) < 0.02


def test_a_bar_of_several_lengths_has_the_closed_form_and_the_bits_of_single_runs(bar: Path, tmp_path: Path) -> None:
    """u_end = g L/E, in P1 exactly; lengths are sorted in the file, profiles are those of a study of one length."""
    with xr.open_datatree(bar) as opened:
        tree = opened.load()
    data = tree.to_dataset()
    assert data["h_max"].dims == ("width", "level")
    assert data["width"].values.tolist() == [0.1, 0.2, 0.4]
    for width in (0.1, 0.2, 0.4):
        for E in (70e9, 35e9):
            at = data.sel(width=width, E=E)
            assert np.allclose(at["u_T_max"], 1e6 * width / E, rtol=1e-10)
    group = tree[f"geometry_{int(data['geometry'].sel(width=0.1)[0])}"]
    one = run(BAR, tmp_path / "one.nc", "body.rectangle.width=0.1", "sweep={E: [70 GPa, 35 GPa]}")
    for path in ("level_0", "level_1"):
        for name in ("arclength", "u_T", "xi"):
            assert np.array_equal(group[path][name].values, one[path][name].values)
    assert float(group["level_1"]["arclength"].max()) == pytest.approx(0.1)


def test_a_geometry_that_cannot_be_is_a_status_with_its_reason(tmp_path: Path) -> None:
    tree = run(HOLED, tmp_path / "out.nc")
    status = tree["status"].isel(level=0).values.tolist()
    assert status == [PointStatus.MESH_FAILED, PointStatus.OK, PointStatus.OK]
    assert str(tree["reason"].values[0, 0]).startswith("body.holes[0]: the hole touches or crosses the outline")
    assert tree["geometry"].values.tolist() == [-1, 1, 2]
    assert "1 solution failed: mesh failed: body.holes[0]" in summary(tmp_path / "out.nc")
    notes = plan(read_study_text(HOLED)).notes
    assert any(note.startswith("refused, parameters.height = 10 mm: body.holes[0]: ") for note in notes)


def test_a_refused_geometry_of_more_points_than_the_first_other() -> None:
    points = ", ".join(f"{{body.rectangle.width: {width}, E: {E}}}" for width, E in ((1e-9, 1), (1e-9, 2), (3, 4)))
    study = read_study_text(BAR[: BAR.index("sweep:")] + f"sweep: {{mode: list, points: [{points}]}}")
    assert [one.reason != "" for one in study.variants] == [True, False]
    assert [scene.material.E for scene in study.scenes] == [4, 4, 4]


def test_lists_and_draws_share_what_has_one_geometry(tmp_path: Path) -> None:
    """Points of a list with equal geometries are one run; the text and options in a group are that study."""
    points = ", ".join(f"{{mesh.maxh: {h} mm, E: {E} GPa}}" for h, E in ((20, 1), (10, 1), (20, 2)))
    study = read_study_text(BAR, "study", [f"sweep={{mode: list, points: [{points}]}}"])
    assert [one.places.tolist() for one in study.variants] == [[0, 2], [1]]
    for one in study.variants:
        assert one.study is not None
        again = read_study_text(study.text, "again", one.study.overrides)
        assert (again.mesh, again.axes) == (one.study.mesh, one.study.axes)
        assert again.scenes == one.study.scenes
    tree = tcstudy.run(study, tmp_path / "out.nc")
    assert np.allclose(tree["u_T_max"].isel(level=1), [2e-4, 2e-4, 1e-4], rtol=1e-9)
    assert tree["geometry"].values.tolist() == [0, 1, 0]
    assert tree["geometry_0/level_0"]["u_T"].dims == ("own_point", "node")
    drawn = read_study_text(
        BAR, "s", ["sweep={mode: sobol, points: 4, body.rectangle.width: {uniform: [100 mm, 200 mm]}}"]
    )
    assert len(drawn.variants) == 4


class Stops(Quiet):
    """Stops at a block."""

    def __init__(self, left: int) -> None:
        self.left = left

    def block(self, record: BlockRecord) -> None:
        self.left -= 1
        if self.left == 0:
            raise KeyboardInterrupt


def test_a_stopped_sweep_goes_on_and_leaves_nothing_beside_its_file(bar: Path, tmp_path: Path) -> None:
    study, path = read_study_text(BAR), tmp_path / "out.nc"
    with pytest.raises(KeyboardInterrupt):
        execute(study, path, Stops(3))
    assert not path.exists()
    assert (tmp_path / "out.nc.geometries" / "0.nc").exists()
    execute(study, path)
    assert sorted(one.name for one in tmp_path.iterdir()) == ["out.nc"]
    with xr.open_datatree(path) as tree, xr.open_datatree(bar) as again:
        for name in ("u_T_max", "energy", "xi"):
            for group in ("/",) if name != "xi" else ("/geometry_0/level_1", "/geometry_2/level_0"):
                assert np.array_equal(tree[group][name].values, again[group][name].values)


@pytest.mark.parametrize(
    ("change", "what"),
    [
        ("mesh={maxh: 20 mm, tolerance: 1e-3}", "with a tolerance or adaptive meshes each would end on another level"),
        ("sweep={mesh.maxh: [1 m, 2 m]}", "no geometry of the sweep can be made"),
        ("sweep={body.rectangle.with: [1 mm]}", "body cannot be swept; sweep a number that it gives"),
        ("sweep={mesh.levels: [1, 2]}", "mesh cannot be swept; sweep mesh.maxh, mesh.grading or mesh.marking"),
        (
            "sweep={body.rectangle.width: [-1 mm, 2 mm]}",
            "body.rectangle.width[0]: must be greater than 0, but is -1 mm",
        ),
        ("sweep={body.rectangle.width: [1 kg]}", "'kg' is not a unit of a length"),
    ],
)
def test_what_is_refused(change: str, what: str) -> None:
    with pytest.raises(StudyError) as fault:
        read_study_text(BAR, "study.yaml", [change])
    assert what in str(fault.value)
    assert len(fault.value.problems) == 1


def test_one_geometry_is_taken_out_as_the_run_that_it_was(
    bar: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    one = tmp_path / "one.nc"
    with pytest.raises(SystemExit):
        main(["export", str(bar), "--geometry", "-o", str(one)])
    assert "3 geometries have these values" in capsys.readouterr().err
    words = ["export", str(bar), "--geometry", "--at", "width=0.2", "-o", str(one)]
    assert main(words) == 0
    assert main(["show", str(one)]) == 0
    assert main(["draw", str(bar), str(tmp_path / "map.png"), "--map", "width,E", "--of", "u_T_max"]) == 0
