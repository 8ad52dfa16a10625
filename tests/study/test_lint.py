"""What a plan and a run say of studies their authors may not have meant, and of bodies from a file before any work."""

from __future__ import annotations

import math
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from netgen import occ

from tcstudy.fem.geometry import build
from tcstudy.fem.meshes import mesh_at
from tcstudy.read.study import read_study, read_study_text
from tcstudy.scene.records import Edge
from tcstudy.shapes.triangles import doubled_areas
from tcstudy.study.lint import faults, lint, loaded, warnings
from tcstudy.study.plan import plan
from tests.verification.scenes import HEATED_BRACKET, RECTANGLE, study_of

ARC = """\
units: none
material: {E: 1, nu: 0.3}
body:
  outline:
    - {from: [0, 0], edge: bot}
EDGES
    - {from: [1.5, 1.5], edge: top}
    - {from: [0, 1.5], edge: left}
boundary: {bot: contact, top: {role: traction, g: [0, 0.1]}, left: clamped}
friction: {law: tresca, tau: 0.001}
mesh: {maxh: 0.1}
"""
CHORDS = [(1.5 * math.sin(i * math.pi / 16), 1.5 - 1.5 * math.cos(i * math.pi / 16)) for i in range(1, 8)]
SI = """\
body: {rectangle: {width: 2, height: 1}}
boundary: {bottom: contact, right: convection, top: free, left: clamped}
material: {E: 1 GPa, nu: 0.25, k: 10, alpha_T: 1e-5}
heat: {alpha: 10, theta_bar: 293 K}
friction: {law: tresca, tau: 1 MPa}
mesh: {maxh: 0.5}
"""


def test_every_corner_of_a_chain_of_chords_is_counted_and_arcs_are_named() -> None:
    edges = "\n".join(f"    - {{from: [{x:.9f}, {y:.9f}], edge: bot}}" for x, y in CHORDS)
    study = read_study_text(ARC.replace("EDGES", edges))
    [note] = [note for note in plan(study).notes if "pinned" in note]
    assert note.startswith("7 corners of the contact line are pinned")
    assert "through: [x, y]" in note
    assert note in map(str, warnings(study))


def test_a_smooth_junction_of_arcs_is_no_corner() -> None:
    arcs = "    - {from: [%.9f, %.9f], edge: bot, through: [%.9f, %.9f]}" % (*CHORDS[3], *CHORDS[5])  # noqa: UP031
    text = ARC.replace("EDGES", arcs).replace(
        "{from: [0, 0], edge: bot}",
        "{from: [0, 0], edge: bot, through: [%.9f, %.9f]}" % CHORDS[1],  # noqa: UP031
    )
    assert not any("pinned" in note for note in lint(read_study_text(text)))


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ("boundary.top=free", "nothing loads this scene"),
        ("boundary.top={role: traction, g: [0, 0]}", "nothing loads this scene"),
        ("boundary.left={role: clamped, u_x: 0.1, u_y: 0}", ""),
        ("loads.f=[0, -1]", ""),
        ("friction={law: piecewise-linear, points: [[-1, -1], [1, 2]], odd: false, slopes: [1, 1]}", ""),
    ],
)
def test_a_scene_that_nothing_loads(change: str, words: str) -> None:
    study = study_of(RECTANGLE, change)
    found = [note for note in map(str, warnings(study)) if "nothing loads" in note]
    assert [note.split(":")[0] for note in found] == ([words] if words else [])


def test_temperature_loads_a_body_only_with_beta() -> None:
    assert loaded(study_of(HEATED_BRACKET).scenes).all()
    text = SI.replace(", alpha_T: 1e-5", "")
    assert not loaded(read_study_text(text).scenes).any()
    swept = read_study_text(SI + "sweep: {theta_bar: [0, 20], E: [1 GPa, 2 GPa]}\n")
    assert loaded(swept.scenes).tolist() == [False, False, True, True]
    assert any(note.startswith("nothing loads 2 of 4 points") for note in lint(swept))


def test_room_temperature_is_taken_for_an_absolute_one() -> None:
    [note] = lint(read_study_text(SI))
    assert note.startswith("theta_bar = 293 K: temperatures count from the stress-free state")
    assert lint(read_study_text(SI, "a.yaml", ["heat.theta_bar=20"])) == []
    plain = SI.replace(" GPa", "e9").replace(" MPa", "e6").replace(" K", "")
    assert lint(read_study_text("units: none\n" + plain)) == []


def test_a_body_softer_than_its_loads_is_doubted() -> None:
    """E without its unit: a strain above 1 is none of small strains; of no load the law counts."""
    cold = SI.replace("293 K", "20 K")
    assert lint(read_study_text(cold, "a.yaml", ["material.E=210"]))[0].startswith(
        "E = 210 Pa: the friction of 1e+06 Pa would strain the body by 4.8e+03, and strains are meant to be small"
    )
    pull = "boundary.top={role: traction, g: [0, 100 Pa]}"
    [note] = lint(read_study_text(cold, "a.yaml", [pull, "sweep={E: [210, 50]}"]))
    assert note.startswith("E = 50 Pa: a load of 100 Pa would strain the body by 2")
    assert lint(read_study_text(cold, "a.yaml", [pull])) == []


def test_names_that_nothing_uses_are_said_with_their_line(tmp_path: Path) -> None:
    file = tmp_path / "a.yaml"
    idle = 'parameters: {w: 2 m, height: 1 m,\n  lost: 3, more: "2*lost"}\n'
    file.write_text(SI.replace("293 K", "20 K").replace("width: 2", 'width: "0.5*w + height"') + idle)
    notes = lint(read_study(file))
    said = "no number of the study uses this name; write it where it is meant, or remove it"
    assert notes == [f"{file}:8:9: parameters.lost: {said}", f"{file}:8:18: parameters.more: {said}"]


STUDY = """body:
  file:
    path: plate.step
    edges: {bottom: [[0.01, 0]], bore: [[0.01, 0.006]]}
    other: sides
  regions:
    heater: {rectangle: {corner: [0.014, 0.002], width: 0.004, height: 0.004}}
    strip: {rectangle: {corner: [0, 0.008], width: 0.02, height: 0.002}}
boundary:
  bottom: contact
  sides: free
  bore: clamped
material: {E: 210 GPa, nu: 0.3}
friction: {law: tresca, tau: 1 MPa}
mesh: {maxh: 2 mm, levels: 2}
"""

ROLES = "bottom: contact\n  sides: free\n  bore: clamped"


def plate(path: Path) -> None:
    """20 × 10 with a bore of radius 1 around (10, 5), in millimetres."""
    body = occ.WorkPlane().Rectangle(20, 10).Face() - occ.WorkPlane().MoveTo(10, 5).Circle(1).Face()
    body.WriteStep(str(path))


def found(tmp_path: Path, text: str, *overrides: str) -> list[str]:
    plate(tmp_path / "plate.step")
    (tmp_path / "study.yaml").write_text(text)
    study = read_study(tmp_path / "study.yaml", overrides)
    return [line.replace(str(tmp_path / "study.yaml"), "study.yaml") for line in faults(study, tmp_path / "out.nc")]


def test_a_sound_study_has_no_fault(tmp_path: Path) -> None:
    """The strip ends on three edges of the face, the heater lies inside."""
    assert found(tmp_path, STUDY) == []


@pytest.mark.parametrize(
    ("old", "new", "line"),
    [
        ("[0.014, 0.002]", "[0.114, 0.002]", "study.yaml:7:13: body.regions.heater: the region lies outside the face"),
        ("[0.014, 0.002]", "[0.018, 0.002]", "study.yaml:7:13: body.regions.heater: the region leaves the face of the "
                                             "file: 0.5 of its area is inside; keep it within"),
        ("bore: clamped", "bore: free", "study.yaml:10:3: boundary: no edge is clamped and contact does not hold the "
                                        "body: it can still slide along x"),
        (ROLES, "bottom: free\n  sides: free\n  bore: contact", "study.yaml:10:3: boundary: no edge is clamped and "
                                                               "contact does not hold the body: it can still turn "
                                                               "about (0.01, 0.005)"),
        ("maxh: 2 mm", "maxh: 1 m", "study.yaml:15:14: mesh.maxh: an element of 1 m is larger than the body (0.022"),
        ("bore: [[0.01, 0.006]]", "bore: [[0.01, 0.006]], top: [[0.01, 0.0061]]",
         "study.yaml:4:40: body.file.edges.bore: no edge of the face has the name 'bore': another name has a point"),
        ("[[0.01, 0]]", "[[10, 0]]",
         "study.yaml:3:5: body.file: plate.step: the point (10, 0) of edges.bottom is 9.98 away from the nearest edge"),
        ("[[0.01, 0]]", "[[0, 0]]",
         "study.yaml:3:5: body.file: plate.step: the point (0, 0) of edges.bottom is as near to two edges; give the"),
        ("    path: plate.step", "    face: 3\n    path: plate.step",
         "study.yaml:3:5: body.file: plate.step: has 1 faces"),
    ],
)  # fmt: skip
def test_a_fault_has_its_line_and_remedy(tmp_path: Path, old: str, new: str, line: str) -> None:
    text = STUDY.replace(old, new)
    if "top:" in new:
        text = text.replace("  sides: free\n", "  sides: free\n  top: clamped\n")
    (problem, *more) = found(tmp_path, text)
    assert problem.startswith(line), problem
    assert "; " in problem
    assert not more


def test_a_size_of_the_sweep_and_an_option_are_named_as_such(tmp_path: Path) -> None:
    text = STUDY.replace("mesh: {maxh: 2 mm, levels: 2}\n", "sweep: {h: [2 mm, 1 um]}\n")
    assert found(tmp_path, text)[0].startswith("study.yaml:15:19: sweep.h[1]: about 10^8.7 triangles")
    assert found(tmp_path, STUDY, "mesh.maxh=3")[0].startswith("--set mesh.maxh=3: mesh.maxh: an element of 3")


BOAT = """body:
  file: {path: boat.step, edges: {hull: [HULL], deck: [[0.01, 0.02]]}, other: sides}
  regions: {strip: {rectangle: {corner: [0.018, 0.012], width: 0.002, height: 0.002}}}
boundary: {hull: contact, deck: clamped, sides: free}
material: {E: 210 GPa, nu: 0.3}
friction: {law: tresca, tau: 1 MPa}
mesh: {maxh: 2 mm}
"""


@pytest.mark.parametrize(("chords", "side", "count"), [(6, True, 6), (1, True, 1), (0, False, 0)])
def test_pinned_corners_of_a_file_are_counted(tmp_path: Path, chords: int, side: bool, count: int) -> None:
    """A block above a half circle of chords, 0 for an arc; side: its right one, which a region divides, touches too."""
    angles = [math.pi * (1 + i / max(chords, 1)) for i in range(chords + 1)]
    below = [(10 + 10 * math.cos(a), 10 + 10 * math.sin(a)) for a in angles] if chords else [(0, 10), (20, 10)]
    corners = [occ.Pnt(x, y, 0) for x, y in [*below, (20, 20), (0, 20)]]
    edges = [occ.Segment(a, b) for a, b in pairwise([*corners, corners[0]])]
    if not chords:
        edges[0] = occ.ArcOfCircle(corners[0], occ.Pnt(10, 0, 0), corners[1])
    occ.Face(occ.Wire(edges)).WriteStep(str(tmp_path / "boat.step"))
    named = [[(a[0] + b[0]) / 2e3, (a[1] + b[1]) / 2e3] for a, b in pairwise(below)] if chords else [[0.01, 0.0]]
    named += [[0.02, 0.015]] if side else []
    (tmp_path / "boat.yaml").write_text(BOAT.replace("HULL", ", ".join(map(str, named))))
    study = read_study(tmp_path / "boat.yaml")
    notes = [note for note in map(str, warnings(study)) if "pinned" in note]
    assert [int(note.split()[0]) for note in notes] == ([count] if count else [])
    assert all("make it arcs or splines in the file" in note for note in notes)
    assert [note for note in plan(study).notes if "pinned" in note] == notes


def test_an_alpha_that_acts_nowhere_is_told() -> None:
    text = """
body: {rectangle: {width: 200 mm, height: 40 mm}}
boundary: {bottom: contact, left: free, right: clamped, top: {role: traction, g: [5 MPa, -1 MPa]}}
material: {E: 210 GPa, nu: 0.3, alpha_T: 12e-6 1/K}
friction: {law: linear, k: 1e11 Pa/m}
mesh: {maxh: 20 mm}
"""
    for heat in ("", "heat: {alpha: 100, theta_bar: 20 K}\n"):
        assert [note for note in lint(read_study_text(text + heat)) if "heat.alpha" in note] == (
            ["heat.alpha acts nowhere, as no edge has the role convection; remove it"] if heat else []
        )
    own = text.replace("left: free", "left: {role: convection, alpha: 5, theta_bar: 3 K}").replace("nu:", "k: 45, nu:")
    (note,) = (note for note in lint(read_study_text(own + "heat: {alpha: 3, theta_bar: 1}\n")) if "alpha" in note)
    assert note == "heat.alpha acts nowhere, as every edge that exchanges heat has its own; remove it"


def test_clockwise_loops_are_turned_and_said() -> None:
    text = """
units: none
body:
  outline: [{from: [0, 0], edge: d}, {from: [0, 2], edge: c, through: [2, 3]}, {from: [4, 2], edge: b},
    {from: [4, 0], edge: a}]
  holes: [outline: [{from: [1, 1], edge: j}, {from: [1.5, 1.5], edge: i}, {from: [1.5, 1], edge: h}]]
  regions: {r: {polygon: [[2, 0.5], [3, 1], [3, 0.5]]}}
boundary: {a: contact, d: clamped, b: free, c: free, h: free, i: free, j: free}
material: {E: 1, nu: 0.3}
friction: {law: tresca, tau: 1}
mesh: {maxh: 0.5}
"""
    study = read_study_text(text)
    body = study.scenes[0].body
    assert body.outline is not None
    c = Edge((4.0, 2.0), (0.0, 2.0), "c", (2.0, 3.0))
    assert {*body.outline.edges} >= {Edge((0.0, 0.0), (4.0, 0.0), "a"), c}
    assert {*body.holes[0].edges} >= {Edge((1.0, 1.0), (1.5, 1.0), "h")}
    notes = [note for note in lint(study) if "clockwise" in note]
    assert [note.split()[0] for note in notes] == ["body.holes[0]", "body.regions.r", "body.outline"]


def test_regions_are_moved_onto_the_edges_that_they_nearly_meet(tmp_path: Path) -> None:
    """Six digits on slanted edges and on one another: the mesh is conforming, its areas are those meant."""
    text = """
units: none
body:
  outline: [{from: [0, 0], edge: bottom}, {from: [2, 0], edge: right}, {from: [3, 1], edge: top},
    {from: [0, 1], edge: left}]
  regions:
    hot: {polygon: [[1, 0.000005], [2.000005, 0], [2.333333, 0.333334], [1, 0.5]]}
    cold: {polygon: [[1, 0], [1.00001, 0.50001], [0.3, 0.2]]}
    rest: {polygon: [[0, 0], [0.3, 0.2], [1, 0.5], [2.333333, 0.333333], [3, 1], [0, 1]]}
boundary: {bottom: contact, top: {role: clamped, u_x: 0.1}, left: free, right: free}
material: {E: 1, nu: 0.3}
friction: {law: tresca, tau: 0.01}
mesh: {maxh: 0.3}
"""
    study = read_study_text(text)
    said = [note for note in lint(study) if "are moved onto them" in note]
    assert [note.split()[2] for note in said] == ["body.regions.hot", "body.regions.cold", "body.regions.rest"]
    mesh = mesh_at(build(study.scenes[0].body), study.mesh, 0, None)
    meant = {"hot": 0.5, "cold": 0.175, "rest": 1.725}
    areas = {name: 0.5 * doubled_areas(mesh.points[mesh.triangles[mesh.inside((name,))]]).sum() for name in meant}
    assert areas == pytest.approx(meant, abs=3e-5)
    sides = np.sort(np.concatenate([mesh.triangles[:, [i, (i + 1) % 3]] for i in range(3)]), axis=1)
    outer = np.unique(sides, axis=0, return_counts=True)[1] == 1
    assert np.count_nonzero(outer) == len(mesh.segments)
    exact = read_study_text(text[: text.index("  regions:")] + text[text.index("boundary:") :])
    assert not [note for note in lint(exact) if "are moved onto them" in note]
