"""The reference of result files has every variable, attribute and request of the tables."""

import re
from pathlib import Path

from tcstudy.data.files import collect
from tcstudy.data.schema import line_variables, requested_variables
from tcstudy.read.study import read_study_text
from tests.data.conftest import make_study
from tests.data.variables_in_words import ATTRIBUTES, REQUESTED, markdown
from tests.verification.scenes import RECTANGLE

PAGE = Path(__file__).parents[2] / "results" / "reference.md"
OUTPUT = """
output:
  probes: {NAME: [1, 0]}
  quantities: [reactions, forces, theta_edges, von_mises, section_force]
"""


def test_the_reference_of_result_files_is_that_of_the_tables() -> None:
    assert PAGE.read_text(encoding="utf-8") == markdown(), (
        "make it again: python -m tests.data.variables_in_words > results/reference.md"
    )


def test_the_reference_has_all_attributes_of_a_run() -> None:
    assert {*collect(make_study(), [])} <= {*ATTRIBUTES}


def test_the_reference_has_all_requested_variables() -> None:
    study = read_study_text(RECTANGLE.replace("units: none", "units: SI") + OUTPUT)
    rows = {name: unit for names, unit, _ in REQUESTED for name in names.split(", ")}
    rows |= {f"probe_NAME_sigma_{axes}": "Pa" for axes in ("yy", "xy")}
    edges = "|".join(name for name, _ in study.scenes[0].boundary)
    found = [*requested_variables(study), *line_variables(study)[1:]]
    assert len(found) > 20
    for variable in found:
        name = re.sub(rf"(?<=_)({edges})(?=_|$)", "EDGE", variable.name)
        assert rows[name] == variable.units
