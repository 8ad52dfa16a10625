"""Table of keys, JSON Schema and the guide to studies agree; what the schema refuses the reader
refuses."""

import copy
import json
import random
from datetime import date
from pathlib import Path
from typing import Any

import jsonschema
import pytest
from ruamel.yaml import YAML
from ruamel.yaml.error import YAMLError

from tcstudy.errors import Problem, StudyError
from tcstudy.read.fields import LISTS, LISTS_OR_ONE, PAIRS
from tcstudy.read.schema import FRAGMENTS, schema, schema_text
from tcstudy.read.study import read_study_text
from tcstudy.scene.designs import PARAMETERS
from tcstudy.scene.keys import ROWS, rows
from tests.benchmarks.mutated import EVERY_KEY, OPENING, sources, spoil, yaml_of
from tests.read.keys_in_words import markdown

ROOT = Path(__file__).parents[2]
SHIPPED = sorted((ROOT / "configs").glob("*.yaml"))
CHECK = jsonschema.Draft202012Validator(schema())
BROKEN = 60


def data(text: str) -> Any:
    """What an editor sees of a YAML text."""
    return json.loads(json.dumps(YAML(typ="safe", pure=True).load(text), default=date.isoformat))


def test_the_schema_is_one_and_the_file_that_studies_name_is_it() -> None:
    jsonschema.Draft202012Validator.check_schema(schema())
    for text in (EVERY_KEY, OPENING):
        assert [error.message for error in CHECK.iter_errors(data(text))] == []
    text = (ROOT / "configs" / "study.schema.json").read_text(encoding="utf-8")
    assert text == schema_text(), "write it again: tcstudy init in a folder, its study.schema.json"


@pytest.mark.parametrize("config", SHIPPED, ids=lambda path: path.stem)
def test_every_shipped_study_names_the_schema_and_is_accepted(config: Path) -> None:
    text = config.read_text(encoding="utf-8")
    assert text.startswith("# yaml-language-server: $schema=study.schema.json\n")
    assert [error.message for error in CHECK.iter_errors(data(text))] == []


def test_what_the_schema_refuses_the_reader_refuses_and_nothing_makes_it_fail_in_any_other_way() -> (
    None
):
    trees = [YAML(typ="safe", pure=True).load(text) for text in sources()]
    made = refused = seed = 0
    while made < BROKEN:
        rng, seed = random.Random(seed), seed + 1
        spoil(rng, tree := copy.deepcopy(rng.choice(trees)))
        text = yaml_of(tree)
        if (
            "[" * 50 in text
        ):  # the reader refuses it at once, a schema never sees it, and the library takes seconds
            continue
        try:
            errors = list(CHECK.iter_errors(data(text)))
        except (YAMLError, ValueError, TypeError, RecursionError):  # no YAML or names, both refuse
            continue
        made += 1
        refused += bool(errors)
        problems: tuple[Problem, ...] = ()
        try:
            read_study_text(text)
        except StudyError as error:
            problems = error.problems
        assert problems or not errors
        assert all(problem.what and problem.remedy for problem in problems)
    assert refused > BROKEN // 2


def test_an_editor_says_at_once() -> None:
    for old, new in (
        ("tau: 20 MPa", "tua: 20 MPa"),
        ("teeth: 3", "teeth: 0"),
        ("role: traction", "role: clamped"),
        ("branch: continued", "branch: least"),
        ("friction:", "fricton:"),
    ):
        assert old in EVERY_KEY
        assert not CHECK.is_valid(data(EVERY_KEY.replace(old, new)))


def test_schema_and_guide_know_every_key() -> None:
    made, table = schema(), markdown()
    assert table == (ROOT / "configs" / "reference.md").read_text(encoding="utf-8"), (
        "make it again: python -m tests.read.keys_in_words > configs/reference.md"
    )
    hidden = {"values", "distribution", *PARAMETERS}  # what a swept key has
    for section in {one.section for one in ROWS} - {"", "sweep", *hidden}:
        assert list(made["$defs"][section]["properties"]) == list(rows(section))
    assert list(made["properties"]) == list(rows(""))
    assert set(rows("sweep")) < set(made["$defs"]["sweep"]["properties"])
    assert not [
        one.name
        for one in ROWS
        if f"`{one.name}`" not in table and one.section not in ("", "goal", *hidden)
    ]
    assert {one.kind for one in ROWS if one.section not in hidden} <= {
        *FRAGMENTS,
        *PAIRS,
        *LISTS,
        *LISTS_OR_ONE,
    }
