"""What a plan and a run say of studies their authors may not have meant, and of bodies from a file
before any work."""

import math
import re
from itertools import pairwise
from pathlib import Path

import pytest
from netgen import occ

import tcstudy
from tcstudy.read.study import read_study, read_study_text
from tcstudy.scene.records import Edge
from tcstudy.shapes.rigid_motions import boundary_pieces
from tcstudy.study.lint import faults, lint, loaded, warnings
from tcstudy.study.opening_notes import arm_of, cohesive_zone
from tcstudy.study.plan import plan
from tests.verification.scenes import HEATED_BRACKET, RECTANGLE, study_of

PLAIN = """
units: none
body: {BODY}
boundary: {a: contact, c: {role: clamped, u_x: 0.1, u_y: 0}, b: free, d: free, h: free}
material: {E: 1, nu: 0.3}
friction: {law: tresca, tau: 0.001}
mesh: {maxh: 0.15}
"""
SI = """\
body: {rectangle: {width: 2, height: 1}}
boundary: {bottom: contact, right: convection, top: free, left: clamped}
material: {E: 1 GPa, nu: 0.25, k: 10, alpha_T: 1e-5}
heat: {alpha: 10, theta_bar: 293 K}
friction: {law: tresca, tau: 1 MPa}
mesh: {maxh: 0.5}
"""


def plain(body: str, holes: bool = False) -> list[str]:
    """What is said of a body with the edges a, b, c, d, and h of a hole."""
    return lint(read_study_text(PLAIN.replace("BODY", body).replace(", h: free" * (not holes), "")))


def test_corners_of_chords_are_pinned_and_smooth_junctions_of_arcs_are_not() -> None:
    """A quarter of a circle as contact line."""
    at = [
        f"[{1.5 * math.sin(t):.9f}, {1.5 - 1.5 * math.cos(t):.9f}]"
        for t in (i * math.pi / 16 for i in range(8))
    ]
    rest = "{from: [1.5, 1.5], edge: b}, {from: [0.5, 1.5], edge: c}, {from: [0, 1.5], edge: d}]"
    chords = "".join(f"{{from: {point}, edge: a}}, " for point in at)
    [note] = plain(f"outline: [{chords}{rest}")
    assert note.startswith("7 corners of the contact line are constrained")
    assert "through: [x, y]" in note
    arcs = "".join(f"{{from: {at[i]}, edge: a, through: {at[i + 2]}}}, " for i in (0, 4))
    assert plain(f"outline: [{arcs}{rest}") == []


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ("boundary.top=free", "nothing loads this scene"),
        ("boundary.top={role: traction, g: [0, 0]}", "nothing loads this scene"),
        ("boundary.left={role: clamped, u_x: 0.1, u_y: 0}", ""),
        ("boundary.right={role: rigid, moment: 0.1}", ""),
        ("loads.f=[0, -1]", ""),
        (
            "friction={law: piecewise-linear, points: [[-1, -1], [1, 2]], odd: false, slopes: [1, 1]}",
            "",
        ),
    ],
)
def test_a_scene_that_nothing_loads(change: str, words: str) -> None:
    found = [
        note for note in map(str, warnings(study_of(RECTANGLE, change))) if "nothing loads" in note
    ]
    assert [note.split(":")[0] for note in found] == ([words] if words else [])


def test_a_path_loads_its_scene() -> None:
    held = "boundary.left={role: clamped, u_x: 0, u_y: 0}"
    study = study_of(RECTANGLE, held, "path={parameter: boundary.left.u_x, from: 0, to: 1}")
    notes = [*map(str, warnings(study)), *plan(study).notes]
    assert not [note for note in notes if "nothing loads" in note]


def test_temperature_loads_a_body_only_with_beta() -> None:
    assert loaded(study_of(HEATED_BRACKET).scenes).all()
    assert not loaded(read_study_text(SI.replace(", alpha_T: 1e-5", "")).scenes).any()
    swept = read_study_text(SI + "sweep: {theta_bar: [0, 20], E: [1 GPa, 2 GPa]}\n")
    assert loaded(swept.scenes).tolist() == [False, False, True, True]
    assert any(note.startswith("nothing loads 2 of 4 points") for note in lint(swept))


FREE = "boundary.right=free"
ABSOLUTE = "temperatures count from the stress-free state"


@pytest.mark.parametrize(
    ("overrides", "key"),
    [
        (["boundary.right={role: convection, theta_bar: 293.15 K}"], "boundary.right.theta_bar"),
        (["boundary.top={role: free, heat: {theta: 280 K}}"], "boundary.top.heat.theta"),
        (["sweep={theta_bar: [0 K, 20 K, 273.15 K]}"], "theta_bar"),
        ([FREE, "heat={theta: '293 + 20*x'}"], "theta"),
        ([FREE, "heat={theta: '200*(1.5 - 0.1*x)'}"], "theta"),
        (["parameters={room: 295 K}", FREE, "heat={theta: 'room - 10*y'}"], "theta"),
        (["path={parameter: theta_bar, from: 290 K, to: 350 K}"], "theta_bar"),
        (["path={parameter: theta_bar, from: 0 K, to: 400 K, at: [300 K]}"], "theta_bar"),
        (["history={memory: friction, steps: [{theta_bar: 30}, {theta_bar: 303 K}]}"], "theta_bar"),
        (["sweep={theta_bar: [0, 20, 30]}"], ""),
        ([FREE, "heat={theta: '40*x'}"], ""),
        (["path={parameter: theta_bar, from: 0 K, to: 60 K}"], ""),
        (["material.alpha_T=0", "boundary.right={role: convection, theta_bar: 293.15 K}"], ""),
    ],
)  # fmt: skip
def test_an_absolute_temperature_is_told_wherever_it_enters(overrides: list[str], key: str) -> None:
    text = SI.replace("293 K", "20 K")
    notes = [note for note in lint(read_study_text(text, "a.yaml", overrides)) if ABSOLUTE in note]
    assert [note.split(" = ")[0] for note in notes] == [key] * bool(key)
    assert all(note.count("\n") == 2 and "\n  Fix: " in note for note in notes)


def test_an_absolute_temperature_of_a_table_or_from_python_is_told(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text("warm [K],slip [um]\n290,1\n300,2\n310,3\n")
    (tmp_path / "a.yaml").write_text(SI.replace("293 K", "20 K"))
    data = "{file: a.csv, columns: {theta_bar: 'warm [K]', u_T_max: 'slip [um]'}}"
    fit = f"fit={{data: {data}, parameters: {{friction.tau: {{start: 1 MPa, within: [0.1 MPa, 9 MPa]}}}}}}"
    [note] = [note for note in lint(read_study(tmp_path / "a.yaml", [fit])) if ABSOLUTE in note]
    assert note.startswith("theta_bar = 290 K: ")
    changed = tcstudy.load(tmp_path / "a.yaml").with_({"boundary.right.theta_bar": 288.0})
    assert any(note.startswith("boundary.right.theta_bar = 288 K: ") for note in lint(changed))


@pytest.mark.parametrize(
    ("overrides", "start"),
    [
        (["material.alpha_T=12e-3", FREE, "heat={theta: 50 K}"], "theta = 50 K would strain the body by 0.6"),
        (["material.alpha_T=1e-3", "path={parameter: theta_bar, from: 0 K, to: 200 K}"],
         "theta_bar = 200 K would strain the body by 0.2"),
        (["boundary.left={role: clamped, u_x: 1}"],
         "|boundary.left.u_x| = 1 m is 0.45 times the size of the body"),
        (["path={parameter: boundary.left.u_x, from: 0, to: -2}", "boundary.left={role: clamped, u_x: 0}"],
         "|boundary.left.u_x| = 2 m is 0.89 times the size of the body"),
        (["boundary.left={role: clamped, u_x: '0.5*y'}"],
         "|boundary.left.u_x| = 500 mm is 0.22 times the size of the body"),
        (["history={memory: friction, steps: [{boundary.left.u_x: 3}]}", "boundary.left={role: clamped, u_x: 0}"],
         "|boundary.left.u_x| = 3 m is 1.3 times the size of the body"),
        (["boundary.left={role: clamped, u_x: 0.1}"], ""),
        (["material.alpha_T=1e-3", FREE, "heat={theta: 50 K}"], ""),
    ],
)  # fmt: skip
def test_a_strain_that_the_load_imposes_is_told(overrides: list[str], start: str) -> None:
    """Of a body with a diagonal of √5 m."""
    notes = lint(read_study_text(SI.replace("293 K", "20 K"), "a.yaml", overrides))
    strained = [note for note in notes if "would strain" in note or "times the size" in note]
    assert [note.split("\n")[0] for note in strained] == [start] * bool(start)


BOND = """
body: {rectangle: {width: 200 mm, height: 1 mm}}
boundary: {bottom: contact, left: free, top: free, right: {role: clamped, u_x: 0.1 mm}}
material: {E: 200 GPa, nu: 0, plane: stress}
friction: {law: slip-weakening, tau_s: 10 MPa, tau_k: 0 MPa, delta: 4 um}
mesh: {maxh: 20 mm}
"""


@pytest.mark.parametrize(
    ("overrides", "words"),
    [
        ([], ("elements of 20 mm", "zone of 14 mm", "0.7 elements", "52 % too high", "2.81 mm")),
        (["mesh.maxh=10 mm"], ("zone of 14 mm", "1.4 elements", "12 % too high")),
        (["mesh={maxh: 20 mm, levels: 3}"], ("elements of 5 mm", "2.8 elements", "4 % too high")),
        (["mesh={maxh: [20 mm, 4 mm]}"], ("elements of 4 mm", "3.5 elements")),
        (["friction.delta=16 um"], ("zone of 28.1 mm", "1.4 elements")),
        (["friction.tau_k=7.5 MPa"], ("zone of 28.1 mm",)),
        (["body.rectangle.height=100 m", "material.E=2 GPa"], ("zone of 838 um", "at least 52 %")),
        (["mesh.maxh=2.8 mm"], ()),
        (["friction={law: tresca, tau: 1 MPa}"], ()),
    ],
)  # fmt: skip
def test_elements_too_long_for_the_softening_zone(overrides: list[str], words: tuple[str]) -> None:
    """(π/2) √(E t/ω) of a strip, (π/2) 4μ/3ω of a thick body with ν = 0 (λ = 0, E = 2μ)."""
    notes = lint(read_study_text(BOND, "a.yaml", overrides))
    coarse = [note for note in notes if "softening zone" in note]
    assert len(coarse) == bool(words)
    assert all(word in note for note in coarse for word in words), coarse


PULL = "boundary.top={role: traction, g: [0, 100 Pa]}"


@pytest.mark.parametrize(
    ("overrides", "said"),
    [
        ([], "theta_bar = 293 K: temperatures count from the stress-free state"),
        (["heat.theta_bar=20"], ""),
        (
            ["heat.theta_bar=20", "material.E=210"],
            "E = 210 Pa: the friction of 1e+06 Pa would strain the body by 4.8e",
        ),
        (
            ["heat.theta_bar=20", PULL, "sweep={E: [210, 50]}"],
            "E = 50 Pa: a load of 100 Pa would strain the body by 2",
        ),
        (["heat.theta_bar=20", PULL, "material.E=210"], ""),
    ],
)
def test_absolute_temperatures_and_moduli_without_their_unit(
    overrides: list[str], said: str
) -> None:
    notes = lint(read_study_text(SI, "a.yaml", overrides))
    assert [note.startswith(said) for note in notes] == [True] * bool(said), notes
    plain = SI.replace(" GPa", "e9").replace(" MPa", "e6").replace(" K", "")
    assert lint(read_study_text("units: none\n" + plain, "a.yaml", ["material.E=1e9"])) == []


def test_names_that_nothing_uses_are_said_with_their_line(tmp_path: Path) -> None:
    file = tmp_path / "a.yaml"
    idle = 'parameters: {w: 2 m, height: 1 m,\n  lost: 3, more: "2*lost"}\n'
    file.write_text(
        SI.replace("293 K", "20 K").replace("width: 2", 'width: "0.5*w + height"') + idle
    )
    said = "this parameter is never used; write it where it is meant, or remove it"
    assert lint(read_study(file)) == [
        f"{file}:8:{c}: parameters.{n}: {said}" for c, n in ((9, "lost"), (18, "more"))
    ]


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
"""The strip ends on three edges of the face, the heater lies inside."""
HELD = (
    "study.yaml:10:3: boundary: no edge is clamped and contact does not restrain rigid-body "
    "motion: it can still"
)
ROLES = "bottom: contact\n  sides: free\n  bore: clamped"


def found(tmp_path: Path, text: str, *overrides: str) -> list[str]:
    """Faults of a study of a plate in millimetres, 20 × 10 with a bore of radius 1 around (10,
    5)."""
    plate = (
        occ.WorkPlane().Rectangle(20, 10).Face() - occ.WorkPlane().MoveTo(10, 5).Circle(1).Face()
    )
    plate.WriteStep(str(tmp_path / "plate.step"))
    (tmp_path / "study.yaml").write_text(text)
    study = read_study(tmp_path / "study.yaml", overrides)
    return [
        line.replace(str(tmp_path / "study.yaml"), "study.yaml")
        for line in faults(study, tmp_path / "out.nc")
    ]


@pytest.mark.parametrize(
    ("old", "new", "line"),
    [
        ("[0.014, 0.002]", "[0.114, 0.002]", "study.yaml:7:13: body.regions.heater: the region lies outside the face"),
        ("[0.014, 0.002]", "[0.018, 0.002]",
         "study.yaml:7:13: body.regions.heater: the region leaves the face of the file: 0.5 of its area is inside"),
        ("bore: clamped", "bore: free", f"{HELD} slide along x"),
        (ROLES, "bottom: free\n  sides: free\n  bore: contact", f"{HELD} turn about (0.01, 0.005)"),
        ("maxh: 2 mm", "maxh: 1 m", "study.yaml:15:14: mesh.maxh: an element of 1 m is larger than the body (0.022"),
        ("bore: [[0.01, 0.006]]", "bore: [[0.01, 0.006]], top: [[0.011, 0.005]]",
         "study.yaml:4:40: body.file.edges.bore: no edge of the face has the name 'bore': another name has a point"),
        ("[[0.01, 0]]", "[[10, 0]]",
         "study.yaml:3:5: body.file: plate.step: the point (10, 0) m of edges.bottom is 9.98 m away from the"),
        ("[[0.01, 0]]", "[[0, 0]]",
         "study.yaml:3:5: body.file: plate.step: the point (0, 0) m of edges.bottom is as near to two edges; give the"),
        ("    path: plate.step", "    face: 3\n    path: plate.step",
         "study.yaml:3:5: body.file: plate.step: has 1 faces"),
        ("{maxh: 2 mm, levels: 2}", "{maxh: [2 mm, 1 um]}", "study.yaml:15:21: mesh.maxh[1]: about 10^8.7 triangles"),
    ],
)  # fmt: skip
def test_a_fault_has_its_line_and_remedy(tmp_path: Path, old: str, new: str, line: str) -> None:
    text = STUDY.replace(old, new)
    if "top:" in new:
        text = text.replace("  sides: free\n", "  sides: free\n  top: clamped\n")
    if line.startswith(HELD):
        text = text.replace("tau: 1 MPa", "tau: 0 MPa")
    (problem,) = found(tmp_path, text)
    assert problem.startswith(line), problem
    assert "; " in problem


@pytest.mark.parametrize(
    ("side", "named", "words"),
    [
        ("[0.012, 0]", "bottom", ""),
        ("[0.007, 0.00000004]", "bottom", "is 4e-08 m off its edge"),
    ],
)
def test_a_point_off_its_edge_is_told(tmp_path: Path, side: str, named: str, words: str) -> None:
    assert found(tmp_path, STUDY.replace("[[0.01, 0]]", f"[{side}]")) == []
    notes = [note for note in lint(read_study(tmp_path / "study.yaml")) if f"edges.{named}" in note]
    assert [words in note for note in notes] == [True] * bool(words), notes


SPLIT = """body: {file: {path: split.step, edges: EDGES, other: rest}}
boundary: {bottom: contact, left: clamped, rest: free}
material: {E: 210 GPa, nu: 0.3}
friction: {law: tresca, tau: 1 MPa}
mesh: {maxh: 20 mm}
"""


def test_a_cad_edge_that_goes_on_under_another_name_is_told(tmp_path: Path) -> None:
    """A slanted line in three pieces, of which one is named; then its two neighbours, too; then the
    half of a circle."""
    corners = [(0, 0), (80, 8), (120, 12), (200, 20), (200, 80), (0, 80)]
    points = [occ.Pnt(x, y, 0) for x, y in corners]
    outline = [occ.Segment(a, b) for a, b in pairwise([*points, points[0]])]
    above, below = ((100, 60 + y) for y in (10, -10))
    ends = occ.Pnt(90, 60, 0), occ.Pnt(110, 60, 0)
    hole = [
        occ.ArcOfCircle(ends[0], occ.Pnt(*above, 0), ends[1]),
        occ.ArcOfCircle(ends[1], occ.Pnt(*below, 0), ends[0]),
    ]
    plate = occ.Face(occ.Wire(outline)) - occ.Face(occ.Wire(hole))
    plate.WriteStep(str(tmp_path / "split.step"))

    def said(edges: str) -> list[str]:
        (tmp_path / "split.yaml").write_text(SPLIT.replace("EDGES", edges))
        notes = lint(read_study(tmp_path / "split.yaml"))
        return [note for note in notes if "goes on as rest" in note]

    left = "left: [[0 mm, 40 mm]]"
    notes = said(f"{{bottom: [[100 mm, 10 mm]], {left}}}")
    remedies = [note.rpartition("Fix: add ")[2].split(" to ")[0] for note in notes]
    assert remedies == ["[40 mm, 4 mm]", "[160 mm, 16 mm]"]
    assert said(f"{{bottom: [[100 mm, 10 mm], {', '.join(remedies)}], {left}}}") == []
    [note] = said("{bottom: [[100 mm, 70 mm]], left: [[0 mm, 40 mm]]}")
    assert "[100 mm, 50 mm]" in note


def test_a_sound_study_has_no_fault_and_an_option_is_named_as_such(tmp_path: Path) -> None:
    assert found(tmp_path, STUDY) == []
    assert found(tmp_path, STUDY, "mesh.maxh=3")[0].startswith(
        "--set mesh.maxh=3: mesh.maxh: an element of 3"
    )


BOAT = """body:
  file: {path: boat.step, edges: {hull: [HULL], deck: [[0.01, 0.02]]}, other: sides}
  regions: {strip: {rectangle: {corner: [0.018, 0.012], width: 0.002, height: 0.002}}}
boundary: {hull: contact, deck: clamped, sides: free}
material: {E: 210 GPa, nu: 0.3}
friction: {law: tresca, tau: 1 MPa}
mesh: {maxh: 2 mm}
"""


def test_pinned_corners_of_a_file_are_counted(tmp_path: Path) -> None:
    """A block above a half circle of six chords; its right side, which a region divides, touches
    too."""
    angles = [math.pi * (1 + i / 6) for i in range(7)]
    below = [(10 + 10 * math.cos(a), 10 + 10 * math.sin(a)) for a in angles]
    corners = [occ.Pnt(x, y, 0) for x, y in [*below, (20, 20), (0, 20)]]
    edges = [occ.Segment(a, b) for a, b in pairwise([*corners, corners[0]])]
    occ.Face(occ.Wire(edges)).WriteStep(str(tmp_path / "boat.step"))
    named = [[(a[0] + b[0]) / 2e3, (a[1] + b[1]) / 2e3] for a, b in pairwise(below)] + [
        [0.02, 0.015]
    ]
    (tmp_path / "boat.yaml").write_text(BOAT.replace("HULL", ", ".join(map(str, named))))
    notes = plan(read_study(tmp_path / "boat.yaml")).notes
    [note] = [note for note in notes if "contact line are constrained" in note]
    assert note.startswith("6 corners")
    assert "make it arcs or splines in the file" in note


@pytest.mark.parametrize(
    ("overrides", "why"),
    [
        ([], ""),
        (["boundary.right=free"], "no edge has the role convection"),
        (
            ["boundary.right={role: convection, alpha: 5, theta_bar: 3 K}"],
            "every edge that exchanges heat has its own",
        ),
    ],
)
def test_an_alpha_that_acts_nowhere_is_told(overrides: list[str], why: str) -> None:
    notes = lint(
        read_study_text(SI.replace("293", "20"), "a.yaml", [*overrides, PULL, "friction.tau=1"])
    )
    assert notes == [f"heat.alpha acts nowhere, as {why}; remove it"] * bool(why)


def test_clockwise_loops_are_turned() -> None:
    body = """
  outline: [{from: [0, 0], edge: d}, {from: [0, 2], edge: c, through: [2, 3]}, {from: [4, 2], edge: b},
    {from: [4, 0], edge: a}]
  holes: [outline: [{from: [1, 1], edge: h}, {from: [1.5, 1.5], edge: h}, {from: [1.5, 1], edge: h}]]
  regions: {r: {polygon: [[2, 0.5], [3, 1], [3, 0.5]]}}"""
    text = PLAIN.replace("{BODY}", body)
    outline = read_study_text(text).scenes[0].body.outline
    assert outline is not None
    assert {*outline.edges} >= {
        Edge((0.0, 0.0), (4.0, 0.0), "a"),
        Edge((4.0, 2.0), (0.0, 2.0), "c", (2.0, 3.0)),
    }


def test_regions_are_moved_onto_the_edges_that_they_nearly_meet() -> None:
    """Six digits on slanted edges and on one another."""
    outline = """
  outline: [{from: [0, 0], edge: a}, {from: [2, 0], edge: b}, {from: [3, 1], edge: c}, {from: [0, 1], edge: d}]"""
    regions = """
  regions:
    hot: {polygon: [[1, 0.000005], [2.000005, 0], [2.333333, 0.333334], [1, 0.5]]}
    cold: {polygon: [[1, 0], [1.00001, 0.50001], [0.3, 0.2]]}
    rest: {polygon: [[0, 0], [0.3, 0.2], [1, 0.5], [2.333333, 0.333333], [3, 1], [0, 1]]}"""
    text = PLAIN.replace(", h: free", "")
    notes = lint(read_study_text(text.replace("{BODY}", outline + regions)))
    assert [note.split()[2] for note in notes if "are moved onto them" in note] == [
        "body.regions.hot",
        "body.regions.cold",
        "body.regions.rest",
    ]
    assert lint(read_study_text(text.replace("{BODY}", outline))) == []


def test_a_jump_of_a_law_is_noted_where_errors_are_bounded() -> None:
    """Down from 3 to 1; a law that sticks, rises or falls over a length has no such jump."""
    jump = "{law: piecewise-linear, points: [[0, 3], [1, 3], [1, 1]]}"
    slope = "{law: piecewise-linear, points: [[0, 1], [1, 3], [2, 1]]}"

    def told(law: str, guarantee: str) -> list[str]:
        changes = f"friction={law}", f"mesh.guarantee={guarantee}"
        study = study_of(RECTANGLE, *changes)
        return [note for note in lint(study) if "jumps down" in note]

    (note,) = told(jump, "true")
    assert "J = 2," in note
    assert told(jump, "polygon") == [note]
    assert told(jump, "false") == []
    assert told(slope, "true") == []


PEEL = """\
body:
  outline:
    - {from: [0 mm, 0 mm], edge: crack}
    - {from: [30 mm, 0 mm], edge: bond}
    - {from: [60 mm, 0 mm], edge: end}
    - {from: [60 mm, 1.5 mm], edge: top}
    - {from: [0 mm, 1.5 mm], edge: grip}
boundary:
  crack: free
  bond: contact
  end: clamped
  top: free
  grip: {role: traction, force: [0, 1 N/mm]}
material: {E: 70 GPa, nu: 0, plane: stress}
adhesion: {law: bilinear, sigma: 20 MPa, s0: 4 um, sf: 14 um}
mesh: {maxh: 0.125 mm}
"""


FREE = ["boundary.bond={role: contact, normal: free}", "adhesion=null"]
SHEAR = "friction={law: linear, k: 1}"
THREE, FIVE = "3 elements over its thickness", "5 elements over its thickness"
STIFF = "8 elements over its thickness: bending is too stiff by about 2.8 %"
WIGGLE = "2.6 elements in it: the force of a growing crack goes up and down by about 2 %"
BRITTLE = "adhesion={bond: {law: bilinear, sigma: 160 MPa, s0: 0.5 um, sf: 1.75 um}}"


@pytest.mark.parametrize(
    ("overrides", "said"),
    [
        # 12 elements over 1.5 mm, 10.5 in a zone of 0.74 (E h³/12ω)^(1/4) = 1.31 mm
        ([], []),
        (["mesh.maxh=0.1875 mm"], [STIFF]),
        (["mesh.levels=2", "mesh.maxh=0.25 mm"], []),
        (["mesh.maxh=0.504 mm"], [THREE, WIGGLE]),
        ([BRITTLE], ["zone of 273 um"]),
        (["adhesion={law: tresca, sigma: 1 MPa}", "mesh.maxh=0.5 mm"], [THREE]),
        ([*FREE, SHEAR, "mesh.maxh=0.3 mm"], [FIVE]),
        (["boundary.top={role: rigid, u_x: 0, force: [0, 1 N/mm]}", "mesh.maxh=0.3 mm"], []),
        (["adhesion=null", SHEAR, "mesh.maxh=0.3 mm"], []),
    ],
)
def test_elements_for_arms_and_cohesive_zones(overrides: list[str], said: list[str]) -> None:
    """Zones of a beam on a bilinear foundation: 1.316, 0.924 mm at 20, 40 MPa with s ~ 1/σ."""
    notes = lint(read_study_text(PEEL, "a.yaml", overrides))
    found = [note for note in notes if "elements of" in note]
    assert len(found) == len(said), found
    for words in said:
        assert any(re.search(words, note) for note in found), found


def test_the_cohesive_zone_of_an_arm_is_that_of_a_beam() -> None:
    """Kanninen's beam on a bilinear foundation, a = 42 mm (softening part of its closed form)."""
    for sigma, zone in ((5, 2.689514), (10, 1.878359), (20, 1.316047), (40, 0.924345)):
        s0, sf = 80 / sigma, 280 / sigma
        law = f"adhesion={{law: bilinear, sigma: {sigma} MPa, s0: {s0} um, sf: {sf} um}}"
        study = read_study_text(PEEL, "a.yaml", [law])
        scene = study.scenes[0]
        arm = arm_of(scene, boundary_pieces(scene.body))
        assert arm is not None
        assert (arm.thickness, arm.length) == pytest.approx((1.5e-3, 60e-3))
        assert cohesive_zone(scene, arm) == pytest.approx(1e-3 * zone, rel=0.03)
    block = ["body={rectangle: {width: 2 mm, height: 1.5 mm, edges: {bottom: bond, left: end}}}",
             "boundary={bond: contact, end: clamped, right: free, top: free}"]  # fmt: skip
    scene = read_study_text(PEEL, "a.yaml", block).scenes[0]
    arm = arm_of(scene, boundary_pieces(scene.body))
    assert arm is not None
    assert not arm.bends
    assert cohesive_zone(scene, arm) == pytest.approx(0.5 * 70e9 / (20e6 / 10e-6))
