"""Table of keys, JSON Schema and the guide to studies agree; what the schema refuses the reader refuses."""

from __future__ import annotations

import random
from datetime import date
from pathlib import Path
from typing import Any

import jsonschema
import pytest
from ruamel.yaml import YAML
from ruamel.yaml.error import YAMLError

from tcstudy.errors import Problem, StudyError
from tcstudy.read.fields import LISTS, PAIRS, SOME
from tcstudy.read.schema import FRAGMENTS, schema, schema_text
from tcstudy.read.study import read_study_text
from tcstudy.scene.designs import PARAMETERS
from tcstudy.scene.keys import ROWS, rows
from tests.benchmarks.mutated import EVERY_KEY, sources, spoil, yaml_of
from tests.read.keys_in_words import markdown

ROOT = Path(__file__).parents[2]
SHIPPED = sorted((ROOT / "configs").glob("*.yaml"))
CHECK = jsonschema.Draft202012Validator(schema())
BROKEN = 200


def data(text: str) -> Any:
    """What an editor sees of a YAML text."""
    return _with_words(YAML(typ="safe", pure=True).load(text))


def _with_words(value: Any) -> Any:
    """The value with texts as keys, as the reader takes them."""
    if isinstance(value, dict):
        return {str(key): _with_words(item) for key, item in value.items()}
    if isinstance(value, date):  # YAML 1.2 and the reader know no dates
        return value.isoformat()
    return [_with_words(item) for item in value] if isinstance(value, list) else value


def test_the_schema_is_one_and_the_file_that_studies_name_is_it() -> None:
    jsonschema.Draft202012Validator.check_schema(schema())
    text = (ROOT / "configs" / "study.schema.json").read_text(encoding="utf-8")
    assert text == schema_text(), "write it again: tcstudy init in a folder, its study.schema.json"


@pytest.mark.parametrize("config", SHIPPED, ids=lambda path: path.stem)
def test_every_shipped_study_names_the_schema_and_is_accepted(config: Path) -> None:
    text = config.read_text(encoding="utf-8")
    assert text.startswith("# yaml-language-server: $schema=study.schema.json\n")
    assert [error.message for error in CHECK.iter_errors(data(text))] == []


def test_a_study_with_every_kind_of_key_is_accepted() -> None:
    assert [error.message for error in CHECK.iter_errors(data(EVERY_KEY))] == []


def test_what_the_schema_refuses_the_reader_refuses_and_nothing_makes_it_fail_in_any_other_way() -> None:
    texts = sources()
    made = refused = seed = 0
    while made < BROKEN:
        rng, seed = random.Random(seed), seed + 1
        tree = YAML(typ="safe", pure=True).load(rng.choice(texts))
        for _ in range(rng.choice((1, 1, 2))):
            spoil(rng, tree)
        text = yaml_of(tree)
        if "[" * 50 in text:  # the reader refuses it at once, a schema never sees it, and the library takes seconds
            continue
        try:
            errors = list(CHECK.iter_errors(data(text)))
        except (YAMLError, ValueError, RecursionError):  # no YAML, which both refuse
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


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("tau: 20 MPa", "tua: 20 MPa"),
        ("teeth: 3", "teeth: 0"),
        ("role: traction", "role: clamped"),
        ("E: 210 GPa", "E: -1"),
        ("E: 210 GPa", "E: steel"),
        ("alpha: 25, q", "alhpa: 25, q"),
        ("branch: continued", "branch: least"),
        ("friction:", "fricton:"),
        ("radius: 0.1, edge: bore", "radius: 0.1"),
    ],
)
def test_an_editor_says_at_once(old: str, new: str) -> None:
    assert old in EVERY_KEY
    assert not CHECK.is_valid(data(EVERY_KEY.replace(old, new)))


def test_the_guide_has_the_table_of_keys() -> None:
    text = (ROOT / "configs" / "README.md").read_text(encoding="utf-8")
    assert markdown() in text, "put in again what python -m tests.read.keys_in_words prints"


def test_schema_and_guide_know_every_key() -> None:
    made, table = schema(), markdown()
    for section in {one.section for one in ROWS} - {"", "sweep"}:
        assert list(made["$defs"][section]["properties"]) == list(rows(section))
    assert list(made["properties"]) == list(rows(""))
    assert set(rows("sweep")) < set(made["$defs"]["sweep"]["properties"])
    hidden = {"values", "goal", "distribution", *PARAMETERS}
    assert not [one.name for one in ROWS if f"`{one.name}`" not in table and one.section not in ("", *hidden)]
    assert {one.kind for one in ROWS} <= {*FRAGMENTS, *PAIRS, *LISTS, *SOME}
