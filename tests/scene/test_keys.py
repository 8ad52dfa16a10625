"""The table of keys agrees with the records, roles and sweeps that follow from it."""

from dataclasses import fields

from tcstudy.read import loads, plans
from tcstudy.scene.keys import ROLES, ROWS, rows
from tcstudy.scene.mesh_plan import MeshPlan
from tcstudy.scene.path_plan import PathPlan
from tcstudy.scene.records import Role


def test_every_key_is_once_in_its_section_and_every_role_has_its_record() -> None:
    assert len({(one.section, one.name) for one in ROWS}) == len(ROWS) > 90
    assert all(one.swept for one in ROWS if one.affine)
    kinds = [Role]
    for kind in kinds:  # which grows
        kinds += kind.__subclasses__()
    assert {kind.word for kind in kinds if "word" in vars(kind)} == {*ROLES}


def test_no_key_of_the_meshes_or_a_path_is_accepted_and_ignored() -> None:
    for section, plan, dependent_keys in (
        ("mesh", MeshPlan, plans.DEPENDENT_KEYS),
        ("path", PathPlan, loads.DEPENDENT_KEYS),
    ):
        assert {*rows(section)} - {*dependent_keys} <= {field.name for field in fields(plan)}
