"""A row of the table of keys is all that makes a key known."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import fields

from tcstudy.read.plans import OF_MESH, OF_PATH
from tcstudy.scene.key import ROLES, symbol
from tcstudy.scene.keys import ROWS, of_role, row, rows
from tcstudy.scene.parameters import FIXED, SHORT, sweepable
from tcstudy.scene.records import Role
from tcstudy.scene.study import MeshPlan, PathPlan

ADDED = """
from tcstudy.scene import keys
from tcstudy.scene.key import Key
from tcstudy.scene.units import BODY_FORCE, Dimension

DENSITY = Dimension("a density", "kg/m^3", "kg m-3", "7850 kg/m^3")
keys.ROWS += (Key("rho", "number", "density", DENSITY, section="material", above=0.0, swept=True),)

from tcstudy.errors import StudyError
from tcstudy.read.document import compose
from tcstudy.read.fields import Fields
from tests.read.keys_in_words import markdown
from tcstudy.read.node import Collector
from tcstudy.read.schema import schema
from tcstudy.read.fields import Context
from tcstudy.read.study import read_study_text

STUDY = '''
body: {rectangle: {width: 2, height: 1}}
boundary: {bottom: contact, left: clamped, top: free, right: free}
material: {E: 1 GPa, nu: 0.3, rho: 7850 kg/m^3}
friction: {law: tresca, tau: 1}
mesh: {maxh: 1}
'''
print(read_study_text(STUDY, "s", ["rho=1 g/cm^3"]).overrides)
axis = read_study_text(STUDY + "sweep: {rho: [1 g/cm^3, 2 g/cm^3]}").axes[0]
print(axis.path, axis.labels, axis.units)
try:
    read_study_text(STUDY.replace("rho:", "roh:"), "s")
except StudyError as error:
    print(error)
for text in ("{rho: 2 g/cm^3}", "{rho: -1}", "{rho: 5 mm}"):
    ctx = Context(Collector())
    print(Fields(ctx, compose(text, "s", ctx.errors), "material").value("rho"), *ctx.errors.problems)
print("`rho` density [kg/m^3]" in markdown())
print(schema()["$defs"]["material"]["properties"]["rho"]["anyOf"][0])
print("material.rho" in schema()["$defs"]["sweep"]["properties"])
"""


def test_a_new_row_is_read_set_swept_suggested_documented_and_in_the_schema() -> None:
    run = subprocess.run([sys.executable, "-c", ADDED], capture_output=True, text=True, check=False)
    assert run.stderr == ""
    assert run.stdout.splitlines() == [
        "('rho=1 g/cm^3',)",
        "('material', 'rho') (1000.0, 2000.0) kg m-3",
        "s:4:31: material.roh: unknown key; did you mean 'rho'?",
        "2000.0",
        "nan s:1:7: rho: must be greater than 0, but is -1; write for example 7850 kg/m^3",
        "nan s:1:7: rho: 'mm' is not a unit of a density (kg/m^3); write for example 7850 kg/m^3",
        "True",
        "{'type': 'number', 'exclusiveMinimum': 0.0}",
        "True",
    ]


def test_parameters_are_written_with_the_symbols_of_the_paper() -> None:
    names = ("alpha", "theta_bar", "friction.tau_s", "material.E", "boundary.end.pressure")
    assert symbol("friction.film.points.2") == "b_2"
    assert [symbol(name) for name in names] == ["α", "θ\N{COMBINING MACRON}", "τ_s", "E", "pressure"]


def test_every_key_is_once_in_its_section_and_every_role_has_its_record() -> None:
    assert len({(one.section, one.name) for one in ROWS}) == len(ROWS) > 90
    assert all(one.swept for one in ROWS if one.affine)
    kinds = [Role]
    for kind in kinds:  # which grows
        kinds += kind.__subclasses__()
    assert {kind.word for kind in kinds if "word" in vars(kind)} == {*ROLES}


def test_no_key_of_the_meshes_or_a_path_is_accepted_and_ignored() -> None:
    for section, plan, judged in (("mesh", MeshPlan, OF_MESH), ("path", PathPlan, OF_PATH)):
        assert {*rows(section)} - {*judged} <= {field.name for field in fields(plan)}


def test_what_sweeps_take_follows_from_the_table() -> None:
    found = sweepable({"top": of_role("traction")}, "linear")
    assert found["heat", "theta_bar"].row == row("heat", "theta_bar")
    assert [name for name in rows("boundary") if not found.get(("boundary", "top", name), found["friction",]).idle]
    assert (SHORT["k"], SHORT["delta"]) == ("material.k", "friction.delta")
    assert set(FIXED) >= {"body", "mesh", "solver", "output", "units", "exact"}
