"""Studies whose contact edges may open: what is read, what follows from it, what is refused."""

import json
import re
from typing import Any

import jsonschema
import numpy as np
import pytest
from ruamel.yaml import YAML

from tcstudy.errors import StudyError
from tcstudy.expressions.expression import value_of
from tcstudy.laws.composed import EdgeLaws
from tcstudy.laws.laws import Laws
from tcstudy.laws.shapes import SHAPES, one_sided
from tcstudy.read.scenes import SceneReader
from tcstudy.read.schema import schema
from tcstudy.read.study import read_study_text
from tcstudy.scene.keys import laws_of, parameter_names
from tcstudy.scene.parameters import numbers
from tcstudy.scene.records import Contact, Scene
from tcstudy.scene.study import Study

ARM = """\
body: {rectangle: {width: 2 m, height: 1 m}}
boundary: {bottom: contact, left: clamped, top: free, right: free}
material: {E: 1 GPa, nu: 0.3}
friction: {law: slip-weakening, tau_s: 2 MPa, tau_k: 1 MPa, delta: 1 mm}
adhesion: {law: bilinear, sigma: 20 MPa, s0: 4 um, sf: 14 um}
mesh: {maxh: 0.5 m}
"""
BILINEAR = SHAPES["bilinear"].build(tau=20e6, s0=4e-6, sf=14e-6)
TWO_EDGES = "boundary.right=contact"
CHECK = jsonschema.Draft202012Validator(schema())


def study(*options: str, text: str = ARM) -> Study:
    return read_study_text(text, "study.yaml", options)


def scene(*options: str, text: str = ARM) -> Scene:
    return study(*options, text=text).scenes[0]


def role(of: Scene, edge: str = "bottom") -> Contact:
    contact = dict(of.boundary)[edge]
    assert isinstance(contact, Contact)
    return contact


def test_a_law_makes_an_edge_adhesive_and_one_sided() -> None:
    arm = scene()
    assert (role(arm).normal, role(arm).u, arm.opens) == ("adhesive", (None, None), True)
    assert arm.adhesion == one_sided(BILINEAR)
    soft = scene("adhesion.closing=200 GPa/m")
    assert soft.adhesion == one_sided(BILINEAR, 2e11)
    assert not study().encloses_lambda_1


def test_normal_says_what_an_edge_without_a_law_does() -> None:
    for normal, u_N, opens in (
        ("held", 0.0, False),
        ("free", None, False),
        ("unilateral", None, True),
    ):
        block = scene(f"boundary.bottom={{role: contact, normal: {normal}}}", "adhesion=null")
        assert (role(block).normal, role(block).u) == (normal, (u_N, None))
        assert (block.opens, block.adhesion) == (opens, None)


def test_friction_may_be_left_out_where_all_edges_open() -> None:
    arm = scene("friction=null")
    assert isinstance(arm.friction, Laws)
    assert arm.friction.vanishes
    two = scene(
        TWO_EDGES,
        "adhesion={right: {law: tresca, sigma: 4}}",
        "friction={bottom: {law: tresca, tau: 3}}",
    )
    assert [role(two, edge).normal for edge in ("bottom", "right")] == ["held", "adhesive"]
    assert isinstance(two.friction, EdgeLaws)
    assert {edge: law.vanishes for edge, law, _ in two.friction.laws} == {
        "bottom": False,
        "right": True,
    }
    assert isinstance(two.adhesion, EdgeLaws)
    assert [edge for edge, _, _ in two.adhesion.laws] == ["right"]


def test_a_study_that_asks_for_nothing_has_what_it_had() -> None:
    block = study("adhesion=null")
    assert role(block.scenes[0]) == Contact()
    assert (block.scenes[0].opens, block.scenes[0].adhesion) == (False, None)


@pytest.mark.parametrize("law", laws_of("adhesion"))
def test_every_law_of_the_slip_is_one_of_the_opening(law: str) -> None:
    values = {
        "tau": 5.0, "tau_s": 5.0, "tau_k": 1.0, "tau_r": 1.0, "a": 5.0, "b": 1.0, "delta": 2.0, "k": 3.0,
        "teeth": 2, "drop": 0.5, "s0": 1.0, "s1": 2.0, "sf": 3.0, "points": [[0, 2], [1, 1]],
    }  # fmt: skip
    names = parameter_names(law, "adhesion")
    assert not any("tau" in name for name in names)
    given = {name: values[of_shape] for name, of_shape in names.items() if of_shape in values}
    section = json.dumps({"law": law, **given})
    of_shape = {names[name]: value for name, value in given.items()}
    assert scene(f"adhesion={section}").adhesion == one_sided(SHAPES[law].build(**of_shape))
    assert CHECK.is_valid(_data(ARM) | {"adhesion": json.loads(section)})


def _data(text: str) -> dict[str, Any]:
    data: dict[str, Any] = json.loads(json.dumps(YAML(typ="safe", pure=True).load(text)))
    return data


def test_numbers_of_the_law_are_swept_set_and_known_by_path() -> None:
    swept = study("sweep={sigma: [10 MPa, 20 MPa], adhesion.s0: [2 um, 4 um], tau_k: [1 MPa]}")
    assert [axis.name for axis in swept.axes] == ["sigma", "s0", "tau_k"]
    laws = [one.adhesion for one in swept.scenes]
    assert laws[3] == one_sided(BILINEAR)
    assert len({law._bytes for law in laws if isinstance(law, Laws)}) == 4
    soft = study("sweep={adhesion.closing: [rigid, 200 GPa/m]}")
    closings = [one.adhesion.closing for one in soft.scenes if isinstance(one.adhesion, Laws)]
    assert closings == [np.inf, 2e11]
    whole = study(
        "sweep={adhesion: {weak: {law: tresca, sigma: 1}, strong: {law: tresca, sigma: 2}}}"
    )
    assert whole.axes[0].labels == ("weak", "strong")
    found = {
        ".".join(path): number.value
        for path, number in numbers(soft.scenes[1])
        if path[0] == "adhesion"
    }
    assert found == {
        "adhesion.sigma": 20e6, "adhesion.s0": 4e-6, "adhesion.sf": 14e-6, "adhesion.closing": 2e11,
        "adhesion.strength": 1.0,
    }  # fmt: skip


def test_points_of_the_law_and_its_numbers_are_read_again() -> None:
    text = ARM.replace(
        "bilinear, sigma: 20 MPa, s0: 4 um, sf: 14 um",
        "piecewise-linear, points: [[0, 0], [1 um, 2 MPa], [3 um, 0]]",
    )
    arm = study("sweep={adhesion.points.1: [1 MPa, 2 MPa]}", text=text)
    b = [
        one.adhesion.b(np.array([1e-6]), -1)[0]
        for one in arm.scenes
        if isinstance(one.adhesion, Laws)
    ]
    assert b == [1e6, 2e6]
    reader = SceneReader.of(study())
    other = reader.at(scene(), {("adhesion", "sigma"): 5e6})
    assert other.adhesion == one_sided(SHAPES["bilinear"].build(tau=5e6, s0=4e-6, sf=14e-6))
    assert other.friction is not None


def test_a_random_strength_is_drawn_along_the_bond() -> None:
    scattered = "adhesion={law: tresca, sigma: 2 MPa, scatter: 0.1, scatter_length: 300 mm}"
    arm = scene(scattered)
    assert isinstance(arm.adhesion, EdgeLaws)
    [(edge, law, strength)] = arm.adhesion.laws
    assert (edge, law.closing) == ("", np.inf)
    assert not isinstance(strength, float)
    x = np.linspace(0.0, 2.0, 5)
    drawn = value_of(strength, x, 0.0 * x)
    assert np.all(drawn > 0.0)
    assert np.ptp(drawn) > 0.01


PATH = "path={parameter: boundary.left.u_y, from: 0, to: 1 mm}"
HISTORY = "history={memory: damage, steps: [{boundary.left.u_y: 1 mm}]}"
POINTS = "adhesion={law: piecewise-linear, points"
FAULTS = (
    # what is written wrongly
    ("adhesion.law=bilinar", "adhesion.law: must be one of", "did you mean 'bilinear'?"),
    ("adhesion.tau=5 MPa", "adhesion.tau: unknown key", "did you mean 'sigma'?"),
    ("adhesion.odd=true", "adhesion.odd: unknown key", "use one of the keys strength"),
    ("friction.closing=rigid", "friction.closing: unknown key", "closing belongs in adhesion"),
    ("adhesion.sigma=-3 Pa", "adhesion.sigma: must be at least 0", "use piecewise-linear"),
    ("adhesion.sf=3 um", "adhesion.sf: must be above s0", "full debonding|softens linearly"),
    ("adhesion.closing=soft", "must be rigid or a traction per slip", "write rigid, or for example 200 GPa/m"),
    ("adhesion.closing=0", "adhesion.closing: must be greater than 0", "write for example 200 GPa/m"),
    ("adhesion=5", "adhesion: must be a mapping", "for example {law: bilinear, sigma: 20 MPa"),
    (f"{POINTS}: [[-1, 0], [0, 2]]}}", "a law of the opening is given from s = 0", r"\[0, b\]$"),
    (f"{POINTS}: [[0, 2], [3, -4]]}}", "b must oppose large opening", "sign of the opening"),
    ("adhesion.strength=x - 1", "the strength is negative or not finite at", "bound it"),
    ("adhesion={top: {law: tresca, sigma: 4}}", "'top' is no contact edge", "the contact edges are bottom"),
    ("boundary.bottom={role: contact, normal: loose}", "must be one of held, free, unil", "write for example held"),
    ("boundary.left={role: clamped, normal: free}", "clamped takes no normal", "normal belongs to the role contact"),
    ("boundary.bottom={role: contact, normal: unilateral}", "adhesion has a law for this edge", "leave out normal"),
    ("sweep={adhesion.teeth: [1, 2]}", "the law bilinear has no parameter 'teeth'", "it has sigma, s0, sf, G_f"),
    ("sweep={adhesion.tau: [1 MPa, 2 MPa]}", "no parameter 'adhesion.tau' to sweep", "did you mean 'adhesion.sigma'?"),
    # what excludes edges that open
    ("mesh.guarantee=true", "mesh.guarantee: errors are bounded for bilateral contact", "remove guarantee"),
    ("mesh={maxh: 1 mm, tolerance: 0.1, of: slip_length}", "mesh.of: errors of slip_length", "remove it"),
    ("exact={u: [0, 0]}", "exact: an exact solution is of bilateral contact", "remove exact"),
    ("output.live=true", "output.live: a live page", "remove live: true"),
)  # fmt: skip


@pytest.mark.parametrize(("option", "fault", "remedy"), FAULTS, ids=[row[0] for row in FAULTS])
def test_what_is_wrong_is_one_fault_with_its_remedy(option: str, fault: str, remedy: str) -> None:
    with pytest.raises(StudyError) as refused:
        study(option)
    [problem] = refused.value.problems
    assert problem.file.startswith("--set ") or problem.line
    assert re.search(fault, f"{problem.key}: {problem.what}")
    assert re.search(remedy, problem.remedy)


def test_a_misnamed_edge_of_adhesion_is_no_want_of_friction() -> None:
    with pytest.raises(StudyError) as refused:
        study("adhesion={botom: {law: linear, k: 4 GPa/m}}", "friction=null")
    assert [problem.key for problem in refused.value.problems] == ["adhesion.botom"]


def test_a_fault_has_its_place_in_the_file() -> None:
    with pytest.raises(StudyError, match=r"study\.yaml:5:27: adhesion\.tau: unknown key"):
        study(text=ARM.replace("sigma", "tau"))
    with pytest.raises(StudyError, match=r"friction: is missing; add friction"):
        study("friction=null", "adhesion=null", "boundary.bottom={role: contact, normal: free}")
    for absent in ("adhesion=null", "friction=null"):
        key = {"adhesion=null": "sigma", "friction=null": "tau_s"}[absent]
        with pytest.raises(StudyError, match=f"the study has no section .*, so {key} cannot"):
            study(absent, f"sweep={{{key}: [1, 2]}}")


@pytest.mark.parametrize(
    "option", [PATH, HISTORY.replace("damage", "friction"), "solver.branch=all", "output.live=true"]
)
def test_edges_that_are_free_along_their_normal_take_what_knows_the_slip_alone(option: str) -> None:
    assert study(option, "adhesion=null", "boundary.bottom={role: contact, normal: free}").scenes
    free = "boundary.bottom={role: contact, normal: free}"
    with pytest.raises(StudyError, match="for bilateral contact"):
        study("mesh.guarantee=true", "adhesion=null", free)


@pytest.mark.parametrize(("memory", "fits"), [("damage", True), ("friction", False)])
def test_an_opening_has_the_memory_damage_alone(memory: str, fits: bool) -> None:
    history = HISTORY.replace("damage", memory)
    friction = "friction={law: tresca, tau: 2 MPa}"
    if fits:
        assert study(history, friction).scenes
        return
    with pytest.raises(StudyError, match="bottom opens by a law of one side, which has no memory"):
        study(history, friction)
    unilateral = "boundary.bottom={role: contact, normal: unilateral}"
    assert study(history, "friction=null", "adhesion=null", unilateral).scenes


WEDGE = """\
units: none
body:
  outline:
    - {from: [0, 0], edge: base}
    - {from: [2, 0], edge: side}
    - {from: [CORNER, 1], edge: top}
    - {from: [0, 1], edge: left}
boundary: {base: contact, side: SIDE, top: free, left: clamped}
material: {E: 1, nu: 0.3}
friction: {base: {law: tresca, tau: 1}, side: {law: tresca, tau: 1}}
adhesion: {base: {law: tresca, sigma: 1}}
mesh: {maxh: 0.2}
"""


def wedge(corner: float, side: str) -> str:
    text = WEDGE.replace("CORNER", str(corner)).replace("SIDE", side)
    return text if "contact" in side else text.replace(", side: {law: tresca, tau: 1}", "")


@pytest.mark.parametrize(
    ("corner", "side", "fault"),
    [
        (2.0, "contact", ""),
        (2.0, "{role: contact, normal: unilateral}", ""),
        (2.5, "contact", "side is a slanted guide and meets base, which may move along its normal"),
        (2.5, "{role: contact, normal: unilateral}", "side, which may .* oblique angle"),
        (2.5, "{role: contact, normal: free}", ""),
        (2.0, "symmetry", ""),
        (2.5, "symmetry", r"slanted guide .* at \(2, 0\)"),
        (2.5, "{role: clamped, u_x: 0}", ""),
        (2.5, "{role: clamped, u_T: 0}", "slanted guide"),
        (2.5, "{role: clamped, u: [0, 0]}", ""),
        (2.0, "{role: rigid, u_y: 0}", "the rigid edge side meets base"),
        (2.0, "{role: traction, spring: {normal: 1}}", ""),
    ],
)
def test_corners_have_two_orthogonal_directions(corner: float, side: str, fault: str) -> None:
    if not fault:
        assert scene(text=wedge(corner, side)).opens
        return
    with pytest.raises(StudyError, match=fault) as refused:
        scene(text=wedge(corner, side))
    [problem] = refused.value.problems
    assert problem.remedy
    with_gap = wedge(corner, "free").replace(
        "{from: [2, 0], edge: side}",
        f"{{from: [2, 0], edge: gap}}\n    - {{from: [{2 + 0.1 * (corner - 2)}, 0.1], edge: side}}",
    )
    with_gap = with_gap.replace("side: free", f"gap: free, side: {side}")
    if "contact" in side:
        with_gap = with_gap.replace("tau: 1}}", "tau: 1}, side: {law: tresca, tau: 1}}", 1)
    assert scene(text=with_gap).opens


def test_the_schema_knows_the_keys() -> None:
    arm = _data(ARM)
    assert CHECK.is_valid(arm)
    assert CHECK.is_valid(
        arm | {"adhesion": {"bottom": {"law": "tresca", "sigma": 1, "closing": "rigid"}}}
    )
    assert not CHECK.is_valid(arm | {"adhesion": {"law": "tresca", "tau": 1}})
    assert not CHECK.is_valid(arm | {"adhesion": {"law": "tresca", "sigma": 1, "odd": True}})
    for normal, is_valid in (("free", True), ("loose", False)):
        bottom = {"bottom": {"role": "contact", "normal": normal}}
        assert CHECK.is_valid(arm | {"boundary": bottom}) is is_valid
    assert not CHECK.is_valid(arm | {"boundary": {"bottom": {"role": "free", "normal": "held"}}})
