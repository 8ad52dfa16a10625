"""Sweeps of body and mesh: closed forms, the bits of single runs, refused geometries, what is
added, measured."""

import shutil
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

import tcstudy
from tcstudy.cli import main
from tcstudy.data.schema import PointStatus
from tcstudy.errors import GeometryFailed, StudyError
from tcstudy.read.study import read_study_text
from tcstudy.reports.terminal.summary import text_of
from tcstudy.study import stored
from tcstudy.study.plan import plan
from tcstudy.study.run import execute
from tcstudy.study.stored import what_is_left
from tests.study.test_append import Counted

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
    path = tmp_path_factory.mktemp("bar") / "out.nc"
    run(BAR, path)
    return path


def test_a_bar_of_several_lengths_has_the_closed_form_and_the_bits_of_single_runs(
    bar: Path, tmp_path: Path
) -> None:
    """u_end = g L/E, in P1 exactly; lengths are sorted in the file, profiles are those of a study
    of one length."""
    tree = xr.load_datatree(bar)
    data = tree.to_dataset()
    assert data["h_max"].dims == ("width", "E", "level")
    assert data["width"].values.tolist() == [0.1, 0.2, 0.4]
    assert right(tree)
    one = run(BAR, tmp_path / "one.nc", "body.rectangle.width=0.1", "sweep={E: [70 GPa, 35 GPa]}")
    for level in (0, 1):
        body = tcstudy.open_geometry(bar, level, width=0.1)
        for name in ("arclength", "u_T", "xi"):
            assert np.array_equal(body[name].values, one[f"level_{level}"][name].values)
    fine = tree["level_1"].dataset
    assert fine["u_T"].dims == ("width", "E", "node")
    for label, u_T in zip(data["width"].values, fine["u_T"].max("node").values, strict=True):
        line = fine["arclength"].sel(width=label).dropna("node")
        assert float(line.max()) == pytest.approx(label)
        assert np.array_equal(u_T, data["u_T_max"].sel(width=label).isel(level=1))


def test_a_geometry_that_cannot_be_is_a_status_with_its_reason(tmp_path: Path) -> None:
    tree = run(HOLED, tmp_path / "out.nc")
    assert tree["status"].isel(level=0).values.tolist() == [
        PointStatus.MESH_FAILED,
        PointStatus.OK,
        PointStatus.OK,
    ]
    assert str(tree["reason"].values[0, 0]).startswith(
        "body.holes[0]: the hole touches or crosses the outline"
    )
    assert tree["geometry"].values.tolist() == [-1, 1, 2]
    assert "1 point failed: mesh failed: body.holes[0]" in text_of(tmp_path / "out.nc")
    notes = plan(read_study_text(HOLED)).notes
    assert any(
        note.startswith("refused, parameters.height = 10 mm: body.holes[0]: ") for note in notes
    )


def test_a_refused_geometry_of_more_points_than_the_first_other() -> None:
    points = ", ".join(
        f"{{body.rectangle.width: {width}, E: {E}}}" for width, E in ((1e-9, 1), (1e-9, 2), (3, 4))
    )
    study = read_study_text(
        BAR[: BAR.index("sweep:")] + f"sweep: {{mode: list, points: [{points}]}}"
    )
    assert [one.reason != "" for one in study.variants] == [True, False]
    assert [scene.material.E for scene in study.scenes] == [4, 4, 4]


def test_lists_and_draws_share_what_has_one_geometry(tmp_path: Path) -> None:
    """Points of a list with equal geometries are one run, whose options make that study of the
    text."""
    points = ", ".join(f"{{mesh.maxh: {h} mm, E: {E} GPa}}" for h, E in ((20, 1), (10, 1), (20, 2)))
    study = read_study_text(BAR, "study", [f"sweep={{mode: list, points: [{points}]}}"])
    assert [one.places.tolist() for one in study.variants] == [[0, 2], [1]]
    for one in study.variants:
        assert one.study is not None
        again = read_study_text(study.text, "again", one.study.overrides)
        assert (again.mesh, again.axes) == (one.study.mesh, one.study.axes)
        assert [*again.scenes] == [*one.study.scenes]
    tree = tcstudy.run(study, tmp_path / "out.nc")
    assert np.allclose(tree["u_T_max"].isel(level=1), [2e-4, 2e-4, 1e-4], rtol=1e-9)
    assert tree["geometry"].values.tolist() == [0, 1, 0]
    assert tree["level_0"]["u_T"].dims == ("point", "node")
    body = tcstudy.open_geometry(tmp_path / "out.nc", maxh="20 mm")
    assert body["u_T"].dims == ("own_point", "node")
    assert body["E"].values.tolist() == [1e9, 2e9]
    assert "3 of 3 points" in text_of(tmp_path / "out.nc")
    drawn = "sweep={mode: sobol, points: 4, body.rectangle.width: {uniform: [100 mm, 200 mm]}}"
    assert len(read_study_text(BAR, "s", [drawn]).variants) == 4


@pytest.mark.parametrize(
    ("change", "what"),
    [
        (
            "mesh={maxh: 20 mm, tolerance: 1e-3}",
            "with a tolerance or adaptive meshes each would end on another level",
        ),
        ("sweep={mesh.maxh: [1 m, 2 m]}", "no geometry of the sweep can be made"),
        (
            "sweep={body.rectangle.with: [1 mm]}",
            "body cannot be swept; sweep a number that it gives",
        ),
        (
            "sweep={mesh.levels: [1, 2]}",
            "mesh cannot be swept; sweep mesh.maxh, mesh.grading or mesh.marking",
        ),
        (
            "sweep={body.rectangle.width: [-1 mm, 2 mm]}",
            "rectangle.width[0]: must be greater than 0, but is -1 mm",
        ),
        ("sweep={body.rectangle.width: [1 kg]}", "'kg' is not a unit of a length"),
    ],
)
def test_what_is_refused(change: str, what: str) -> None:
    with pytest.raises(StudyError) as fault:
        read_study_text(BAR, "study.yaml", [change])
    assert what in str(fault.value)
    assert len(fault.value.problems) == 1


def test_a_map_shows_all_geometries(bar: Path, tmp_path: Path) -> None:
    assert (
        main(["draw", str(bar), str(tmp_path / "map.png"), "--map", "width,E", "--of", "u_T_max"])
        == 0
    )


ONE = BAR.replace(", levels: 2", "")


def same(one: Path, two: Path, at: dict[str, list[float]]) -> None:
    """The points of one file are those of the other, to the bit: numbers, and profiles of their
    geometries."""
    with xr.open_datatree(one) as a, xr.open_datatree(two) as b:
        for name in ("status", "energy", "u_T_max", "h_max"):
            pair = [
                t[name].sel({k: v for k, v in at.items() if k in t[name].dims}).values
                for t in (a, b)
            ]
            assert np.array_equal(*pair), name
    inner = {name: at[name] for name in ("E",) if name in at}
    for width in at["width"]:
        pair = [tcstudy.open_geometry(file, 0, width=width).sel(inner) for file in (one, two)]
        for name in ("arclength", "u_T", "xi"):
            assert np.array_equal(*(lines[name].values for lines in pair)), name


def right(tree: xr.DataTree) -> bool:
    """Whether the ends of all bars move by g L/E."""
    at = tree.to_dataset()
    return bool((abs(at["u_T_max"] / (1e6 * at["width"] / at["E"]) - 1.0) < 1e-10).all())


def test_files_of_geometries_grow_and_are_mended(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """New lengths, and new moduli at old ones, are added, also after a stop; what was there stays
    to the bit."""
    path, before, counted = tmp_path / "out.nc", tmp_path / "before.nc", Counted(monkeypatch)
    execute(
        read_study_text(ONE, "s", ["sweep={body.rectangle.width: [400 mm, 100 mm], E: [70 GPa]}"]),
        path,
    )
    shutil.copy(path, before)
    more = read_study_text(
        ONE, "s", ["sweep={body.rectangle.width: [0.1, 0.2], E: [70 GPa, 35 GPa]}"]
    )
    study, kept = what_is_left(more, path, force=False, append=True)
    counted.most = 2 + 1
    with pytest.raises(KeyboardInterrupt):
        execute(study, path, kept=kept)
    counted.most, counted.points = np.inf, 0
    tree = tcstudy.run(more, path, append=True)
    assert counted.points == 4 - 1  # of the four that are new, one was solved before the stop
    assert np.all(tree["status"] == int(PointStatus.OK))
    same(before, path, {"width": [0.4, 0.1], "E": [70e9]})
    assert right(tcstudy.run(read_study_text(ONE), path, append=True))
    assert counted.points == 4 - 1
    same(before, path, {"width": [0.4, 0.1], "E": [70e9]})
    assert sorted(one.name for one in tmp_path.iterdir()) == ["before.nc", "out.nc"]


def test_what_is_refused_stays_so_where_a_file_grows(tmp_path: Path) -> None:
    path = tmp_path / "a.nc"
    execute(read_study_text(HOLED, "s", ["sweep={parameters.height: [8 mm, 30 mm]}"]), path)
    tree = tcstudy.run(
        read_study_text(HOLED, "s", ["sweep={parameters.height: [10 mm, 20 mm]}"]),
        path,
        append=True,
    )
    refused = int(PointStatus.MESH_FAILED)
    assert tree["height"].values.tolist() == [0.008, 0.01, 0.02, 0.03]
    assert tree["status"].values[:, 0].tolist() == [refused, refused, 1, 1]
    assert str(tree["reason"].values[0, 0]).startswith("body.holes[0]: the hole")


CHOSEN = """
units: none
parameters: {H: 1}
body: {rectangle: {width: 1, height: H}}
boundary: {bottom: contact, top: clamped, left: {role: traction}, right: {role: traction}}
material: {lambda: 1.5, mu: 1}
friction: {law: slip-weakening, tau_s: 1, tau_k: 0.4, delta: 1}
mesh: {maxh: 0.5, levels: 3}
sweep: {lambda: [1.5, 3], parameters.H: [1, 0.5]}
exact: {u: ["y + (1 - 0.6*y)*(0.3 + 0.2*sin(pi*x))", "0.1*y*cos(pi*x)"], loads: derived}
"""


def test_convergence_of_every_geometry_is_that_of_its_own_study(tmp_path: Path) -> None:
    """Against the chosen solution, also where a geometry has none; the tables tell them apart."""
    tree = tcstudy.converge(read_study_text(CHOSEN), tmp_path / "all.nc")
    data = tree.to_dataset()
    assert data["h_max"].dims == ("lambda", "H", "level")
    assert np.all((data["slope_u_energy"] > 0.9) & (data["slope_u_energy"] < 1.1))
    for height in (1.0, 0.5):
        changes = [f"parameters.H={height}", "sweep={lambda: [1.5, 3]}"]
        one = tcstudy.converge(
            read_study_text(CHOSEN, "s", changes), tmp_path / f"{height}.nc"
        ).to_dataset()
        for name in ("h_max", "n_dof", "error_u_energy", "rate_xi_L2", "limit_energy"):
            found = data[name].sel(H=height)
            assert np.array_equal(found, one[name].broadcast_like(found), equal_nan=True), (
                name,
                height,
            )
    listed = "sweep={mode: list, points: [{parameters.height: 10 mm}, {parameters.height: 20 mm}]}"
    lost = tcstudy.converge(
        read_study_text(HOLED, "s", ["mesh.levels=2", listed]), tmp_path / "lost.nc"
    ).to_dataset()
    assert lost["status"].values.tolist() == [[PointStatus.MESH_FAILED] * 2, [PointStatus.OK] * 2]
    assert np.isnan(lost["h_max"].values).tolist() == [[True, True], [False, False]]
    assert lost.attrs["notes"].startswith("refused, parameters.height = 10 mm: body.holes[0]: ")


def test_cost_and_path_are_of_one_geometry(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Cost of that of its point, or refused with the reason; a path of the body outside the
    sweep."""
    monkeypatch.setattr(stored, "RUNS", 1)
    study = read_study_text(CHOSEN)
    data = tcstudy.cost(study, tmp_path / "cost.nc", at={"H": 0.5}).to_dataset()
    own = data.sel(family="uniform").isel(level=slice(3))
    alone = tcstudy.converge(
        read_study_text(CHOSEN, "s", ["parameters.H=0.5", "sweep=null"]), tmp_path / "one.nc"
    )
    assert np.array_equal(own["n_dof"], alone["n_dof"])
    assert "H = 0.5" in data.attrs["point"]
    with pytest.raises(GeometryFailed, match=r"the hole touches .*; name another geometry by at"):
        tcstudy.cost(read_study_text(HOLED), tmp_path / "no.nc")
    along = BAR + "path: {parameter: boundary.right.g_x, from: 0 Pa, to: 1 MPa}\n"
    along = along.replace("law: linear, k: 0", "law: tresca, tau: 10 kPa")
    found = tcstudy.run(read_study_text(along), tmp_path / "path.nc").to_dataset()
    alone = tcstudy.run(
        read_study_text(along, "s", ["sweep=null"]), tmp_path / "alone.nc"
    ).to_dataset()
    assert float(found["x"].max()) == 0.2
    assert np.array_equal(found["u_T"], alone["u_T"])
    file = tmp_path / "along.yaml"
    file.write_text(along)
    assert main(["run", str(file), "--output", str(tmp_path / "path.nc")]) == 0
    said = "".join(capsys.readouterr())
    assert "the values of width, E are not used" in said
    assert "holds these results already" in said
