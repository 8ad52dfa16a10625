"""Bodies from CAD files from their header to their pictures: lengths, refusals, and result files
that need the CAD file no longer."""

import re
import shutil
from pathlib import Path

import netCDF4
import numpy as np
import pytest
from netgen import occ

import tcstudy
from tcstudy.errors import DrawError, StudyError, UserFault
from tcstudy.read.step import length_units
from tcstudy.read.study import read_study
from tcstudy.reports.export import write_fields
from tcstudy.reports.picture import read_picture

MILLIMETRE = "( LENGTH_UNIT() NAMED_UNIT(*) SI_UNIT(.MILLI.,.METRE.) )"
STUDY = """
body: {file: {path: part.step, edges: {bottom: [[FACTOR * 10 mm, 0 mm]], left: [[0 mm, FACTOR * 5 mm]]}, other: rest}}
boundary: {bottom: contact, left: clamped, rest: {role: traction, pressure: 1 MPa}}
material: {E: 210 GPa, nu: 0.3}
friction: {law: tresca, tau: 1 MPa}
mesh: {maxh: 0.01}
output: {fields: true}
"""


def converted(number: str, name: str, measure: str, base: str) -> str:
    """Entity `number` of a STEP file as a unit that is a multiple of another."""
    return (
        f"#{number}=(CONVERSION_BASED_UNIT('{name}',#901)\n LENGTH_UNIT() NAMED_UNIT(#903));\n"
        f"#901=LENGTH_MEASURE_WITH_UNIT(LENGTH_MEASURE({measure}),#902);\n#902={base};\n"
        "#903=DIMENSIONAL_EXPONENTS(1.,0.,0.,0.,0.,0.,0.)"
    )


def write_part(folder: Path, unit: str) -> None:
    """A plate of 20 × 10 in the unit of a header; one without a unit for ''."""
    file = folder / "part.step"
    occ.Rectangle(20, 10).Face().WriteStep(str(file))
    text = file.read_text()
    (number,) = re.findall(rf"#(\d+) = {re.escape(MILLIMETRE)}", text)
    si = {"m": "$", "um": ".MICRO.", "cm": ".CENTI.", "mm": ".MILLI."}
    new = f"#{number} = ( LENGTH_UNIT() NAMED_UNIT(*) SI_UNIT({si.get(unit, '$')},.METRE.) )"
    if unit == "in":
        new = converted(number, "INCH", "25.4", MILLIMETRE)
    elif unit == "ft":
        new = converted(number, "FOOT", "3.048E-1", MILLIMETRE.replace(".MILLI.", "$"))
    text = text.replace(f"#{number} = {MILLIMETRE}", new)
    if not unit:
        text = re.sub(
            rf"GLOBAL_UNIT_ASSIGNED_CONTEXT\s*\(\s*\(\s*#{number}\s*,",
            "GLOBAL_UNIT_ASSIGNED_CONTEXT((",
            text,
        )
    file.write_text(text)


def write_study(folder: Path, factor: float) -> Path:
    """A study of that plate, one of its units being `factor` metres."""
    text = STUDY
    for number in ("10", "5"):
        text = text.replace(f"FACTOR * {number} mm", f"{factor * float(number):.12g} m")
    text = text.replace("maxh: 0.01", f"maxh: {10 * factor} m")
    file = folder / "part.yaml"
    file.write_text(text)
    return file


def contact_length(file: Path, overrides: tuple[str, ...], folder: Path) -> float:
    """The length of the contact line in the results [m]."""
    result = tcstudy.run(read_study(file, overrides), folder / "a.nc", force=True)
    with netCDF4.Dataset(result.file) as nc:
        return float(nc["level_0/c"][:].sum())


@pytest.mark.parametrize(
    ("unit", "metres"),
    [("mm", 1e-3), ("m", 1.0), ("um", 1e-6), ("cm", 1e-2), ("in", 0.0254), ("ft", 0.3048)],
)
def test_the_header_of_a_step_file_says_how_long_the_body_is(
    tmp_path: Path, unit: str, metres: float
) -> None:
    """With or without the same unit in the study; every other one is refused with both."""
    write_part(tmp_path, unit)
    assert length_units((tmp_path / "part.step").read_bytes()) == pytest.approx((metres,))
    file = write_study(tmp_path, metres)
    for same in ((), (f"body.file.unit={unit}",)):
        assert contact_length(file, same, tmp_path) == pytest.approx(20 * metres, rel=1e-9)
    other = "m" if unit != "m" else "in"
    with pytest.raises(StudyError, match=rf"is {other}, but the header of part\.step says {unit};"):
        read_study(file, [f"body.file.unit={other}"])


def test_a_file_without_a_unit_has_that_of_the_study(tmp_path: Path) -> None:
    write_part(tmp_path, "")
    assert length_units((tmp_path / "part.step").read_bytes()) == ()
    for overrides, metres in (((), 1e-3), (("body.file.unit=in",), 0.0254)):
        file = write_study(tmp_path, metres)
        assert contact_length(file, overrides, tmp_path) == pytest.approx(20 * metres, rel=1e-9)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ("boundary={bottom: contact, left: free, rest: free} friction.tau=0", "can still slide along x"),
        ("body.file.edges.bottom=[[10 mm, 3 mm]]",
         r"the point \(10, 3\) mm of edges.bottom is 3 mm away .* size is 22.4 mm"),
        ("mesh.maxh=1", "larger than the body"),
    ],
)  # fmt: skip
def test_draw_refuses_what_run_refuses(tmp_path: Path, change: str, message: str) -> None:
    write_part(tmp_path, "mm")
    study = read_study(write_study(tmp_path, 1e-3), re.split(r" (?=friction)", change))
    with pytest.raises(StudyError, match=message):
        tcstudy.draw(study, tmp_path / "a.png")
    with pytest.raises(UserFault, match=message):
        tcstudy.run(study, tmp_path / "a.nc")
    assert not (tmp_path / "a.png").exists()


def test_draw_refuses_a_path_on_adaptive_meshes_as_run_does(tmp_path: Path) -> None:
    write_part(tmp_path, "mm")
    changes = [
        "path={parameter: load, from: 0, to: 1}",
        "mesh={maxh: 5 mm, family: adaptive, levels: 2}",
    ]
    study = read_study(write_study(tmp_path, 1e-3), changes)
    with pytest.raises(DrawError, match="adaptive meshes follow from the solutions"):
        tcstudy.draw(study, tmp_path / "a.png")


def test_results_need_the_cad_file_no_longer(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Stresses, profiles and named edges from another folder, after the file has gone."""
    home, away = tmp_path / "home", tmp_path / "away"
    home.mkdir()
    away.mkdir()
    write_part(home, "mm")
    tcstudy.run(read_study(write_study(home, 1e-3)), home / "a.nc")
    before = read_picture(home / "a.nc")
    shutil.move(home / "a.nc", away / "a.nc")
    shutil.rmtree(home)
    monkeypatch.chdir(away)
    shown = read_picture(Path("a.nc"))
    assert [(edge.name, edge.role) for edge in shown.edges] == [
        ("bottom", "contact"),
        ("left", "clamped"),
        ("rest", "traction"),
    ]
    ends = {edge.name: edge.line[[0, -1]].round(12).tolist() for edge in shown.edges}
    assert ends["left"] == [[0.0, 0.01], [0.0, 0.0]]
    assert all(
        np.array_equal(one.line, other.line)
        for one, other in zip(shown.edges, before.edges, strict=True)
    )
    for asked in ({"of": "von_mises"}, {"of": "sigma_x", "along": "1 mm,5 mm: 19 mm,5 mm"}):
        assert tcstudy.draw("a.nc", "a.png", **asked).stat().st_size > 1000
    written = write_fields(Path("a.nc"), Path("vtu"))
    assert written.lacks == ()
    assert all("von_mises" in file.read_text() for file in Path("vtu").glob("*.vtu"))
