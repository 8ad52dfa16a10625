"""The JSON Schema of a study file, with which editors complete and check studies.

It is made from the table of keys. The reader refuses all that the schema refuses, and much more:
units, expressions, geometry, contradictions, keys that a sweep or derived loads could supply, names
of swept parameters.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from typing import Any, get_args

from tcstudy.read.fields import LISTS, LISTS_OR_ONE, PAIRS
from tcstudy.scene.keys import LAWS, Key, laws_of, of_all_laws, of_role, parameter_names, row, rows
from tcstudy.scene.mesh_plan import PROVED, Quantity
from tcstudy.scene.parameters import NUMBERS, SHORT, path_of, swept_row
from tcstudy.scene.units import NONE

Schema = dict[str, Any]

DRAFT = "https://json-schema.org/draft/2020-12/schema"
TITLE = "A study of tcstudy"
NAME = "^[A-Za-z0-9_]+$"
SINGLE_KEY_SECTIONS = ("hole", "region")
"""Sections that hold one of their keys."""
TEXTS: Schema = {"type": "string", "pattern": r"\S"}
VALUE: Schema = {"type": ["number", "string"]}
"""A number, or a text with its unit or an expression, which the reader checks."""


def schema_text() -> str:
    """Return the schema as the text of a file."""
    return json.dumps(schema(), indent=1, ensure_ascii=False) + "\n"


def schema() -> Schema:
    """Return the whole schema (draft 2020-12)."""
    definitions = {section: _section(section) for section in _sections()}
    roles = row("boundary", "role").words
    definitions["boundary"]["allOf"] = [_takes("role", role, of_role(role)) for role in roles]
    for section in LAWS:
        definitions[section]["allOf"] = [
            _takes("law", law, (*of_all_laws(section), *parameter_names(law, section)))
            for law in laws_of(section)
        ]
    shapes = ("outline", "rectangle", "file")
    definitions["body"]["oneOf"] = [{"required": [name]} for name in shapes]
    swept = _swept_properties()
    definitions["point"] = {"type": "object", "properties": swept, "minProperties": 1}
    definitions["sweep"]["properties"] |= swept
    values = {"type": ["array", "object", "number", "string"]}
    definitions["sweep"]["additionalProperties"] = values
    definitions["step"] |= {"additionalProperties": VALUE, "minProperties": 1}
    # a sweep or derived loads may supply the other sections
    supplied = {"anyOf": [{"required": ["sweep"]}, {"required": ["exact"]}]}
    required = {"required": [key.name for key in rows("").values() if key.required]}
    study = _section("", ("body", "boundary")) | {"if": supplied, "else": required}
    return {"$schema": DRAFT, "title": TITLE, **study, "$defs": definitions}


def _sections() -> list[str]:
    """Return the names of the sections that keys of the study refer to, but "point"."""
    keys = list(rows("").values())
    for key in keys:  # which grows by the keys of the sections that it refers to
        for name in key.of:
            if name != "point":
                keys += [inner for inner in rows(name).values() if inner not in keys]
    names = dict.fromkeys(name for key in keys for name in key.of)
    return [name for name in (*names, "goal") if name != "point"]


def _swept_properties() -> dict[str, Schema]:
    """Return the names of parameters that a sweep may vary, with their meaning."""
    laws = [f"{section}.{key}" for section in LAWS for key in rows(section)]
    words = dict.fromkeys((*SHORT.values(), *laws, "material", *SHORT))
    swept = dict[str, Schema]()
    for word in words:
        key = swept_row(path_of(word))
        if key:
            swept[word] = {"description": key.meaning}
    return swept


def _section(section: str, required: tuple[str, ...] | None = None) -> Schema:
    keys = rows(section).values()
    if required is None:
        required = tuple(key.name for key in keys if key.required and not key.swept)
    properties = {key.name: _described(key) for key in keys}
    definition: Schema = {"type": "object", "properties": properties}
    if required:
        definition["required"] = list(required)
    definition["additionalProperties"] = False
    if section in SINGLE_KEY_SECTIONS:
        definition |= {"minProperties": 1, "maxProperties": 1}
    return definition


def _takes(key: str, word: str, names: tuple[str, ...]) -> Schema:
    """Return that a section with this word takes these names beside the key of the word."""
    condition = {"properties": {key: {"const": word}}, "required": [key]}
    return {"if": condition, "then": {"propertyNames": {"enum": [key, *names]}}}


def _described(key: Key) -> Schema:
    unit = f" [{key.dimension.si}]" if key.dimension != NONE else ""
    example = f", for example {key.suggestion}" if key.suggestion != "..." else ""
    description: Schema = {"description": f"{key.meaning}{unit}{example}".lstrip(", ")}
    if key.default is not None:
        description["default"] = key.default
    return description | _fragment(key)


def _ref(section: str) -> Schema:
    return {"$ref": f"#/$defs/{section}"}


def _list(items: Schema, least: int = 0, most: int | None = None) -> Schema:
    definition: Schema = {"type": "array", "items": items, "minItems": least}
    if most is not None:
        definition["maxItems"] = most
    return definition


def _named(items: Schema, **options: object) -> Schema:
    names = {"pattern": NAME}
    return {"type": "object", "propertyNames": names, "additionalProperties": items, **options}


def _by_path(items: Schema) -> Schema:
    return {"type": "object", "minProperties": 1, "additionalProperties": items}


def _number(key: Key) -> Schema:
    bounds = {
        "minimum": key.least,
        "exclusiveMinimum": key.above,
        "maximum": key.most,
        "exclusiveMaximum": key.below,
    }
    is_integer = key.kind == "integer"
    definition: Schema = {"type": "integer"} if is_integer else dict(VALUE)
    for name, bound in bounds.items():
        if bound is not None:
            definition[name] = int(bound) if is_integer else float(bound)
    return definition


def _sub_section(key: Key) -> Schema:
    section = _ref(key.of[0])
    return {"anyOf": [_fragment(row(key.of[0], key.short)), section]} if key.short else section


def _fragment(key: Key) -> Schema:
    kind = key.kind
    if kind in PAIRS:
        pair = _list(_fragment(replace(key, kind=PAIRS[kind][0])), 2, 2)
        is_derivable = kind in ("vector", "displacement")
        return {"anyOf": [{"const": "derived"}, pair]} if is_derivable else pair
    if kind in LISTS:
        inner, _, least = LISTS[kind]
        return _list(_fragment(replace(key, kind=inner)), int(key.least or least))
    if kind in LISTS_OR_ONE:
        inner, _, least = LISTS_OR_ONE[kind]
        item = _fragment(replace(key, kind=inner))
        return {"anyOf": [item, _list(item, least)]}
    return FRAGMENTS[kind](key)


def _choice(key: Key) -> Schema:
    return {"enum": list(key.words)}


def _goal() -> Schema:
    words = [word for word in get_args(Quantity) if word != "u_T"]
    return {"anyOf": [{"enum": [*words, PROVED]}, _ref("goal")]}


def _sweep_points(key: Key) -> Schema:
    count = {"type": "integer", "minimum": 1}
    return {"anyOf": [_list(_sub_section(key), 1), count, TEXTS]}


def _laws(key: Key) -> Schema:
    law = _ref(key.of[0])
    by_edge = _by_path(law) | {"not": {"required": ["law"]}}
    return {"anyOf": [law, by_edge]}


FRAGMENTS: dict[str, Callable[[Key], Schema]] = {
    **dict.fromkeys(NUMBERS, _number),
    "flag": lambda key: {"type": "boolean"},
    "flag or word": lambda key: {"anyOf": [{"type": "boolean"}, {"enum": list(key.words)}]},
    "text": lambda key: TEXTS,
    "name": lambda key: {"type": "string", "pattern": NAME},
    "choice": _choice,
    "choice by edge": lambda key: {"anyOf": [_choice(key), _named(_choice(key))]},
    "quantity": lambda key: VALUE,
    "named places": lambda key: _named(_list(VALUE, 2, 2), minProperties=1),
    "named points": lambda key: _named(_list(_list(VALUE, 2, 2), 1)),
    "section": _sub_section,
    "sections": lambda key: _list(_sub_section(key), int(key.least or 0)),
    "named sections": lambda key: _named(_sub_section(key)),
    "names": lambda key: {"anyOf": [TEXTS, _list(TEXTS, 1)]},
    "goal": lambda key: _goal(),
    "law": _laws,
    "material": lambda key: _ref("material"),
    "sweep points": _sweep_points,
    "named numbers": lambda key: _named(VALUE, minProperties=1),
    "named quantities": lambda key: {"anyOf": [_by_path(VALUE), {"const": "estimate"}]},
    "named texts": lambda key: _by_path(TEXTS),
    "fitted numbers": lambda key: _by_path(_sub_section(key)),
}
"""Contents of a key by its kind, except for pairs and lists."""
