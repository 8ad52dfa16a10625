"""Bad studies: each gives one error, at its place, that says what is wrong."""

import os
import re
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from tcstudy.errors import StudyError
from tcstudy.read.study import read_study, read_study_text

FAULTS = Path(__file__).with_name("bad_studies.txt")


def cases() -> Iterator[tuple[str, str, str, str]]:
    """(text, case, place and key, part of the message) of the table."""
    text = ""
    for line in FAULTS.read_text(encoding="utf-8").splitlines():
        if line[0] == "|":
            text += line[2:] + "\n"
        elif line[0] == "@":
            text = ""
        elif line[0] != "#":
            case, _, found = line.partition(" >> ")
            place, part = re.fullmatch(r"((?:-|\d+:\d+:)(?: [^ ]+:)?) (.+)", found).groups()  # type: ignore[union-attr]
            yield text, case.replace("\\n", "\n"), place, part


CASES = list(cases())
BASE = CASES[0][0]


def problems(text: str, *overrides: str) -> list[str]:
    with pytest.raises(StudyError) as info:
        read_study_text(text, "study.yaml", overrides)
    return str(info.value).split("\n")


def changed(old: str, new: str, text: str = "") -> str:
    assert old in (text or BASE)
    return (text or BASE).replace(old, new.replace("(nothing)", ""), 1)


@pytest.mark.parametrize(
    ("text", "case", "place", "part"), CASES, ids=[case[:60] for _, case, *_ in CASES]
)
def test_one_fault_gives_one_error_at_its_place(
    text: str, case: str, place: str, part: str
) -> None:
    options = case[6:].split(" && ") if case.startswith("--set ") else []
    [line] = problems(text if options else changed(*case.split(" => "), text), *options)  # type: ignore[misc]
    assert re.match(
        f"--set .*: {re.escape(place[2:])}"
        if place[0] == "-"
        else f"study.yaml:{re.escape(place)} ",
        line,
    )
    assert part in line


@pytest.mark.parametrize("role", ["", "role: clampd, "])
def test_a_swept_key_of_an_edge_without_a_known_role_is_no_further_fault(role: str) -> None:
    text = changed("left: clamped", f"left: {{{role}u_x: 0}}")
    [line] = problems(text, "sweep={boundary.left.u_x: [0, 1 mm]}")
    assert ": boundary.left.role: " in line
    assert "; " in line  # the remedy


def test_faults_are_reported_at_once_sorted_by_line() -> None:
    text = changed(
        "radius: 0.2",
        "radius: 0.2 kg",
        changed("nu: 0.3", "nu: 0.7", changed("[25, 100]", "[25, 25]")),
    )
    places = [
        line.split(": ")[:2] for line in problems(text.replace("left: clamped", "left: clampd"))
    ]
    assert places == [
        *(
            ["study.yaml:8:46", "body.regions.hot.circle.radius"],
            ["study.yaml:13:9", "boundary.left"],
        ),
        *(["study.yaml:14:28", "material.nu"], ["study.yaml:19:15", "sweep.alpha[1]"]),
    ]


def test_faults_of_the_scene_do_not_hide_those_of_a_fit() -> None:
    text = changed("nu: 0.3", "nu: 0.7", BASE[: BASE.index("sweep:")])
    keys = [line.split(": ")[1] for line in problems(f"{text}fit: {{start: 3, seed: x}}\n")]
    assert keys[0] == "material.nu"
    assert {"fit.start", "fit.seed"} <= {*keys}


def test_faults_of_names_hide_no_others() -> None:
    """What uses a name with a fault is left unread; all else is judged."""
    text = changed("radius: 0.2", "radius: 2*r", changed("nu: 0.3", "nu: 0.7"))
    text = text.replace("delta: [20 um", "size: [20 um").replace("maxh: 0.2", "maxh: size")
    names = "parameters: {r: 0.1 kgg, size: 0.1 mms, s: 2*r, a: b, b: a, c: 5 mm}\n"
    keys = [line.split(": ")[1] for line in problems(f"{text}{names}")]
    assert keys == ["material.nu", *(f"parameters.{name}" for name in ("r", "size", "a"))]


def test_columns_of_one_parameter_are_refused_whatever_their_units(tmp_path: Path) -> None:
    table = tmp_path / "points.csv"
    table.write_text("alpha,friction.delta [um],delta [mm]\n1,2,3\n2,3,4\n")
    [line] = problems(f"{BASE[: BASE.index('sweep:')]}sweep: {{points: {table}}}\n")
    assert "points.csv:1:27: sweeps the same parameter as 'friction.delta'" in line
    table.write_text("friction.delta [um],friction.delta [mm]\n2,3\n3,4\n")
    [line] = problems(f"{BASE[: BASE.index('sweep:')]}sweep: {{points: {table}}}\n")
    assert "sweeps the same parameter as 'friction.delta [um]'" in line


def test_a_text_with_a_unit_is_refused_in_a_dimensionless_study() -> None:
    lines = problems("units: none\n" + BASE)
    assert len(lines) == 11
    assert all("has a unit, but the study says units: none" in line for line in lines)


def test_files_that_cannot_be_read(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "latin.yaml").write_bytes("title: ok\n# Öl".encode("latin-1"))
    with open(tmp_path / "large.yaml", "wb") as file:
        file.truncate(10**9)
    for name, said in (
        ("none.yaml", "there is no such file"),
        (".", "this is a folder"),
        ("latin.yaml", "latin.yaml:2:3: the file is not UTF-8 text"),
        ("/dev/zero", "a device or a pipe"),
        ("pipe", "a device or a pipe"),
        ("large.yaml", "16 MB"),
    ):
        with pytest.raises(StudyError, match=said):
            read_study(tmp_path / name)
    assert "16 MB" in problems(BASE, f"sweep={{mode: list, points: {tmp_path / 'large.yaml'}}}")[0]
    assert problems("- a\n")[0].startswith(
        "study.yaml:1:1: a study is a mapping, but this is a list of 1"
    )


def test_a_geometry_file_must_exist(tmp_path: Path) -> None:
    start, end = BASE.index("  outline:"), BASE.index("  regions:")
    part = "  file: {path: part.step, edges: {bottom: [[0, 0]], left: [[0, 1]]}, other: right}\n"
    text = (BASE[:start] + part + BASE[end:]).replace(
        "  top: {role: traction, g: [0, -1 MPa]}\n", ""
    )
    study = tmp_path / "study.yaml"
    study.write_text(text)
    with pytest.raises(
        StudyError, match=r"study\.yaml:2:16: body\.file\.path: there is no file 'part\.step'"
    ):
        read_study(study)
    (tmp_path / "part.step").touch()
    one = text.replace("bottom: [[0, 0]]", "bottom: [0 m, 0 m]")
    assert "one point, but must be a list of points; write [[0 m, 0 m]]" in problems(one)[1]
    brep = read_study(study).scenes[0].body.brep
    assert (brep.path, brep.face, brep.scale, brep.other) == (
        tmp_path / "part.step",
        0,
        1e-3,
        "right",
    )
    assert brep.edges == (("bottom", ((0.0, 0.0),)), ("left", ((0.0, 1.0),)))


GEOMETRIES = (
    BASE[: BASE.index("sweep:")].replace("maxh: 0.2, levels: 2", "maxh: size")
    + "parameters: {size: 0.2}\n"
)
LAW = "{law: slip-weakening, tau_s: 20 MPa, tau_k: 5 MPa"


def test_the_values_of_a_sweep_are_set_by_path_or_short_name() -> None:
    text = f"{GEOMETRIES}sweep: {{friction.delta: [1 um, 2 um], parameters.size: [0.2, 0.3]}}\n"
    for key in ("delta=[3]", "friction.delta=[3]", "parameters.size=[0.5]", "size=[0.5]"):
        assert read_study_text(text, "study.yaml", [f"sweep.{key}"]).shape == (
            (1, 2) if "delta" in key else (2, 1)
        )
    kept = f"friction={LAW}}}"  # without the swept key, so that nothing of it is lost
    assert read_study_text(text, "study.yaml", [kept, "sweep.size=null"]).shape == (2,)


@pytest.mark.parametrize("form", ["{}", "{} GPa", "{}*x", "{}^{}"])
def test_numbers_of_ten_thousand_digits_are_refused_at_once(form: str) -> None:
    start = time.process_time()
    for number in ("1" * 10_000, "0." + "0" * 10_000, "0x" + "f" * 10_000, "-" + "1" * 10_000):
        [problem] = problems(BASE, "material.E=" + form.replace("{}", number))
        assert "at most 2000" in problem
        assert len(problem) < 400
    assert time.process_time() - start < 1.0
