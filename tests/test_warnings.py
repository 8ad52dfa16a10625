"""What one must know of results before using them: told once, kept in every kind of file, told
again by its readers."""

import json
import sys
import warnings
from collections.abc import Callable
from pathlib import Path

import netCDF4
import pytest

import tcstudy
from tcstudy.cli import main
from tcstudy.data.files import remarks_of
from tcstudy.read.study import read_study_text
from tests.commands import tcstudy_command

STUDY = """title: pulled
body: {rectangle: {width: 2 m, height: 1 m}}
boundary: {bottom: contact, left: {role: clamped, u_x: 0, u_y: 0}, top: {role: traction, g: [0.1 MPa, 0]}, right: free}
material: {E: 1 GPa, nu: 0.49}
friction: {law: tresca, tau: 1 kPa}
mesh: {maxh: 0.5 m, levels: 3}
"""
LAWS = """sweep:
  friction:
    soft: {law: slip-weakening, tau_s: 50 kPa, tau_k: 0, delta: 1 mm}
    none: {law: tresca, tau: 0}
    spring: {law: linear, k: 1 MPa/m}
    fading: {law: exponential, a: 50 kPa, b: 0, delta: 1 mm}
    rising: {law: exponential, a: 10 kPa, b: 50 kPa, delta: 1 nm}
    teeth: {law: saw-tooth, tau: 50 kPa, delta: 1 mm, teeth: 4, drop: 1}
    steep: {law: piecewise-linear, points: [[0, 5e4], [0.03, 5e4], [0.030000000000000002, 5e4], [0.1, 1e5]]}
    pushing: {law: piecewise-linear, points: [[0.01, -2e4], [0.02, 3e4]], odd: false, slopes: [0, 1]}
"""
SECTIONS = {
    "run": "sweep: {E: [1 GPa, 2 GPa]}\n",
    "converge": "",
    "path": "path: {parameter: boundary.left.u_x, from: 0 mm, to: 0.1 mm}\n",
    "history": "history: {memory: friction, steps: [{boundary.left.u_x: 0.1 mm, in: 1}]}\n",
}
LOCKING = "nu = 0.49 in plane strain: P1 elements lock"


def told(work: Callable[[], object]) -> list[str]:
    """The warnings of a study that some work ends in, at the line that asked for it."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        work()
    assert all(one.filename == __file__ for one in caught if one.category is tcstudy.StudyWarning)
    return [str(one.message) for one in caught if one.category is tcstudy.StudyWarning]


@pytest.mark.parametrize("kind", SECTIONS)
def test_every_kind_of_file_keeps_its_warnings_and_python_has_them(
    kind: str, tmp_path: Path
) -> None:
    study, path = read_study_text(STUDY + SECTIONS[kind], "s.yaml"), tmp_path / "out.nc"
    work = getattr(tcstudy, kind, tcstudy.run)
    first, again = told(lambda: work(study, path)), told(lambda: work(study, path))
    assert [text for text in first if text.startswith(LOCKING)] == first[:1]
    assert again == first
    assert [str(one) for one in remarks_of(tcstudy.open_results(path).attrs)] == first


def test_a_result_that_run_returned_warns_no_more(tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    study = read_study_text(STUDY.replace("levels: 3", "levels: 1"), "s.yaml")
    with pytest.warns(tcstudy.StudyWarning, match="P1 elements lock"):
        result = tcstudy.run(study, tmp_path / "out.nc")
    opened = tcstudy.open_results(tmp_path / "out.nc")
    for of, count in ((result, 0), (opened, 1), (opened, 0), (tmp_path / "out.nc", 1)):
        assert len(told(lambda of=of: tcstudy.draw(of))) == count
        assert len(told(result._repr_html_)) == 0


def test_a_terminal_shows_them_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Both streams of a terminal are read together; of a pipe each is read alone."""
    monkeypatch.chdir(tmp_path)
    Path("s.yaml").write_text(STUDY)
    for terminal, count in ((True, 1), (False, 2)):
        for stream in (sys.stdout, sys.stderr):
            monkeypatch.setattr(stream, "isatty", lambda terminal=terminal: terminal)
        assert main(["run", "s.yaml", "--set", "mesh.levels=1", "--force"]) == 0
        shown = capsys.readouterr()
        assert f"{shown.out}{shown.err}".replace("\n    ", " ").count(LOCKING) == count
        assert ("1 warning, see above" in shown.out) == terminal


def test_readers_repeat_them(tmp_path: Path) -> None:
    (tmp_path / "s.yaml").write_text(STUDY)
    ran = tcstudy_command("run", "s.yaml", "-q", "--output", "out.nc", cwd=tmp_path)
    assert ran.stderr.startswith(f"warning: {LOCKING}")
    assert ran.stderr.count(LOCKING) == 1
    assert ran.stdout.count("\n") == 1
    assert f"  warning: {LOCKING}" in tcstudy_command("show", "out.nc", cwd=tmp_path).stdout
    [kept] = json.loads(tcstudy_command("show", "out.nc", "--json", cwd=tmp_path).stdout)[
        "warnings"
    ]
    assert kept["text"].startswith(LOCKING)
    for words in (("show", "-q"), ("draw", "out.svg"), ("report",), ("export", "--json")):
        command, *more = words
        said = tcstudy_command(command, "out.nc", *more, cwd=tmp_path)
        assert said.stderr.count(LOCKING) == 1, command
    assert f'<p class="warning">Warning: {LOCKING}' in (tmp_path / "out.html").read_text(
        encoding="utf-8"
    )
    assert json.loads((tmp_path / "out.json").read_text(encoding="utf-8"))["warnings"] == [kept]
    assert "Warning: nu = 0.49" in (tmp_path / "out.svg").read_text(encoding="utf-8")


def test_a_file_that_was_changed_is_called_that_once(tmp_path: Path) -> None:
    study = read_study_text(STUDY.replace("nu: 0.49", "nu: 0.3"), "s.yaml")
    tcstudy.run(study, tmp_path / "a.nc")
    with netCDF4.Dataset(tmp_path / "a.nc", "a") as nc:
        nc.setncattr("title", "another")
    changed = told(lambda: tcstudy.report(tmp_path / "a.nc"))
    assert [text.endswith("was changed since tcstudy wrote it") for text in changed] == [True]


def test_a_grown_file_has_each_warning_once(tmp_path: Path) -> None:
    with pytest.warns(tcstudy.StudyWarning, match="P1 elements lock"):
        tcstudy.run(read_study_text(STUDY + "sweep: {nu: [0.49, 0.3]}\n"), tmp_path / "a.nc")
    grown = read_study_text(STUDY + "sweep: {nu: [0.495]}\n")
    [said] = told(lambda: tcstudy.run(grown, tmp_path / "a.nc", append=True))
    assert said.startswith("nu = 0.495")
    assert [str(one) for one in remarks_of(tcstudy.open_results(tmp_path / "a.nc").attrs)] == [said]


def test_a_warning_of_one_geometry_says_which(tmp_path: Path) -> None:
    """A corner between two contact edges is pinned unless they are parallel."""
    text = STUDY.replace("nu: 0.49", "nu: 0.3").replace(
        "rectangle: {width: 2 m, height: 1 m}",
        "outline: [{from: [0, 0], edge: bottom}, {from: [1, dip], edge: bottom}, {from: [2, 0], edge: right},"
        " {from: [2, 1], edge: top}, {from: [0, 1], edge: left}]",
    )
    study = read_study_text(
        text + "parameters: {dip: 0 m}\nsweep: {parameters.dip: [0 m, 0.1 m]}\n", "s.yaml"
    )
    [said] = told(lambda: tcstudy.run(study, tmp_path / "out.nc"))
    assert said.startswith("parameters.dip = 0.1 m: 1 corner of the contact line is constrained")
    tree = tcstudy.open_results(tmp_path / "out.nc")
    assert [(kept.where, str(kept)) for kept in remarks_of(tree.attrs)] == [
        ("parameters.dip = 0.1 m", said)
    ]


def test_no_warning_of_numpy_reaches_a_user(tmp_path: Path) -> None:
    """Every kind of law, heated, with warnings as errors."""
    heat = "heat: {alpha: 1, theta_bar: 5 K}\n"
    text = STUDY.replace("right: free", "right: convection").replace(
        "0.49", "0.3, k: 1, alpha_T: 1e-5"
    )
    (tmp_path / "scene.yaml").write_text(text + heat + LAWS)
    result = tcstudy_command("run", "scene.yaml", cwd=tmp_path, code=0)
    assert "Warning" not in result.stderr + result.stdout
