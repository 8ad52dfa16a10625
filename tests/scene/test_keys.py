"""The table of keys agrees with the records, roles and sweeps that follow from it."""

from dataclasses import fields

from tcstudy.read.loads import OF_PATH
from tcstudy.read.plans import OF_MESH
from tcstudy.scene.keys import ROLES, ROWS, rows, symbol
from tcstudy.scene.records import Role
from tcstudy.scene.study import MeshPlan, PathPlan


def test_parameters_are_written_with_the_symbols_of_the_paper() -> None:
    names = ("alpha", "theta_bar", "friction.tau_s", "material.E", "boundary_end_theta_bar",
             "boundary_grip_u_x", "heat_theta")  # fmt: skip
    assert symbol("friction.film.points.2") == "b_2"
    bar = "θ\N{COMBINING MACRON}"
    written = ["α", bar, "τ_s", "E", f"{bar} of end", "u_x of grip", "θ"]
    assert [symbol(name) for name in names] == written


def test_symbols_keep_the_edge_or_region_that_they_belong_to() -> None:
    bar = "θ\N{COMBINING MACRON}"
    written = {
        "boundary.end.pressure": "pressure of end",
        "boundary.left.theta_bar": f"{bar} of left",
        "boundary.my_right.heat.alpha": "α of my_right",
        "boundary.grip.spring.k_T": "k_T of grip",
        "friction.film.tau_s": "τ_s of film",
        "materials.coat.E": "E of coat",
    }
    assert {path: symbol(path) for path in written} == written


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
