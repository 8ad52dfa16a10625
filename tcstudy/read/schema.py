"""The JSON Schema of a study file, made from the table of keys: editors complete and check studies
with it.

What the schema refuses the reader refuses as well; the reader finds much more (units, expressions,
geometry, what contradicts what, keys that a sweep or derived loads could supply, names of what is
swept).
"""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from typing import Any, get_args

from tcstudy.laws.shapes import SHAPES
from tcstudy.read.fields import LISTS, LISTS_OR_ONE, PAIRS
from tcstudy.scene.keys import OF_ALL_LAWS, Key, law_rows, of_role, row, rows
from tcstudy.scene.mesh_plan import PROVED, Quantity
from tcstudy.scene.parameters import NUMBERS, SHORT, path_of, swept_row
from tcstudy.scene.units import NONE

Schema = dict[str, Any]

DRAFT = "https://json-schema.org/draft/2020-12/schema"
TITLE = "A study of tcstudy"
NAME = "^[A-Za-z0-9_]+$"
ONE_OF = ("hole", "region")
"""Sections that hold one of their keys."""
LISTS_OR_ONE_TEXT: Schema = {"type": "string", "pattern": r"\S"}
VALUE: Schema = {"type": ["number", "string"]}
"""A number, or a text with its unit or an expression, which the reader judges."""


def schema_text() -> str:
    """The schema as a file."""
    return json.dumps(schema(), indent=1, ensure_ascii=False) + "\n"


def schema() -> Schema:
    """The whole schema (draft 2020-12)."""
    known = list(rows("").values())
    for one in known:  # which grows by the rows of the sections that it names
        known += [
            row
            for name in one.of
            if name != "point"
            for row in rows(name).values()
            if row not in known
        ]
    sections = dict.fromkeys(name for one in known for name in one.of)
    made = {section: _section(section) for section in (*sections, "goal") if section != "point"}
    made["boundary"] |= {
        "allOf": [_takes("role", role, of_role(role)) for role in row("boundary", "role").words]
    }
    laws = {law: tuple(one.name for one in law_rows(law)) for law in SHAPES}
    made["friction"] |= {
        "allOf": [_takes("law", law, (*OF_ALL_LAWS, *names)) for law, names in laws.items()]
    }
    made["body"] |= {"oneOf": [{"required": [name]} for name in ("outline", "rectangle", "file")]}
    words = dict.fromkeys(
        (*SHORT.values(), *(f"friction.{key}" for key in rows("friction")), "material", *SHORT)
    )
    swept = {
        word: {"description": found.meaning}
        for word in words
        if (found := swept_row(path_of(word)))
    }
    made["point"] = {"type": "object", "properties": swept, "minProperties": 1}
    made["sweep"]["properties"] |= swept
    made["sweep"]["additionalProperties"] = {"type": ["array", "object", "number", "string"]}
    made["step"] |= {"additionalProperties": VALUE, "minProperties": 1}
    supplied = {
        "anyOf": [{"required": ["sweep"]}, {"required": ["exact"]}]
    }  # which may have the other sections
    needed = {"required": [one.name for one in rows("").values() if one.required]}
    whole = _section("", ("body", "boundary")) | {"if": supplied, "else": needed}
    return {"$schema": DRAFT, "title": TITLE, **whole, "$defs": made}


def _section(section: str, required: tuple[str, ...] | None = None) -> Schema:
    known = rows(section).values()
    if required is None:
        required = tuple(one.name for one in known if one.required and not one.swept)
    made: Schema = {"type": "object", "properties": {one.name: _described(one) for one in known}}
    made |= {"required": list(required)} if required else {}
    made |= {"additionalProperties": False}
    return made | ({"minProperties": 1, "maxProperties": 1} if section in ONE_OF else {})


def _takes(key: str, word: str, names: tuple[str, ...]) -> Schema:
    given = {"properties": {key: {"const": word}}, "required": [key]}
    return {"if": given, "then": {"propertyNames": {"enum": [key, *names]}}}


def _described(one: Key) -> Schema:
    unit = f" [{one.dimension.si}]" if one.dimension != NONE else ""
    example = f", for example {one.suggestion}" if one.suggestion != "..." else ""
    said = {"description": f"{one.meaning}{unit}{example}".lstrip(", ")}
    return said | ({} if one.default is None else {"default": one.default}) | _fragment(one)


def _ref(section: str) -> Schema:
    return {"$ref": f"#/$defs/{section}"}


def _list(items: Schema, least: int = 0, most: int | None = None) -> Schema:
    return {
        "type": "array",
        "items": items,
        "minItems": least,
        **({} if most is None else {"maxItems": most}),
    }


def _named(items: Schema, **more: object) -> Schema:
    return {
        "type": "object",
        "propertyNames": {"pattern": NAME},
        "additionalProperties": items,
        **more,
    }


def _by_path(items: Schema) -> Schema:
    return {"type": "object", "minProperties": 1, "additionalProperties": items}


def _number(one: Key) -> Schema:
    bounds = {
        "minimum": one.least,
        "exclusiveMinimum": one.above,
        "maximum": one.most,
        "exclusiveMaximum": one.below,
    }
    number, kind = (int, {"type": "integer"}) if one.kind == "integer" else (float, VALUE)
    return kind | {name: number(bound) for name, bound in bounds.items() if bound is not None}


def _sub_section(one: Key) -> Schema:
    inner = _ref(one.of[0])
    return {"anyOf": [_fragment(row(one.of[0], one.short)), inner]} if one.short else inner


def _fragment(one: Key) -> Schema:
    kind = one.kind
    if kind in PAIRS:
        pair = _list(_fragment(replace(one, kind=PAIRS[kind][0])), 2, 2)
        return (
            {"anyOf": [{"const": "derived"}, pair]} if kind in ("vector", "displacement") else pair
        )
    if kind in LISTS:
        return _list(_fragment(replace(one, kind=LISTS[kind][0])), int(one.least or LISTS[kind][2]))
    if kind in LISTS_OR_ONE:
        item = _fragment(replace(one, kind=LISTS_OR_ONE[kind][0]))
        return {"anyOf": [item, _list(item, LISTS_OR_ONE[kind][2])]}
    return FRAGMENTS[kind](one)


LAW_BY_EDGE = _by_path(_ref("friction")) | {"not": {"required": ["law"]}}
FRAGMENTS: dict[str, Callable[[Key], Schema]] = {
    **dict.fromkeys(NUMBERS, _number),
    "flag": lambda one: {"type": "boolean"},
    "text": lambda one: LISTS_OR_ONE_TEXT,
    "name": lambda one: {"type": "string", "pattern": NAME},
    "choice": lambda one: {"enum": list(one.words)},
    "choice by edge": lambda one: {
        "anyOf": [{"enum": list(one.words)}, _named({"enum": list(one.words)})]
    },
    "quantity": lambda one: VALUE,
    "named places": lambda one: _named(_list(VALUE, 2, 2), minProperties=1),
    "named points": lambda one: _named(_list(_list(VALUE, 2, 2), 1)),
    "section": _sub_section,
    "sections": lambda one: _list(_sub_section(one), int(one.least or 0)),
    "named sections": lambda one: _named(_sub_section(one)),
    "names": lambda one: {"anyOf": [LISTS_OR_ONE_TEXT, _list(LISTS_OR_ONE_TEXT, 1)]},
    "goal": lambda one: {
        "anyOf": [
            {"enum": [*(word for word in get_args(Quantity) if word != "u_T"), PROVED]},
            _ref("goal"),
        ]
    },
    "law": lambda one: {"anyOf": [_ref("friction"), LAW_BY_EDGE]},
    "material": lambda one: _ref("material"),
    "sweep points": lambda one: {
        "anyOf": [_list(_sub_section(one), 1), {"type": "integer", "minimum": 1}, LISTS_OR_ONE_TEXT]
    },
    "named numbers": lambda one: _named(VALUE, minProperties=1),
    "named quantities": lambda one: {"anyOf": [_by_path(VALUE), {"const": "estimate"}]},
    "named texts": lambda one: _by_path(LISTS_OR_ONE_TEXT),
    "fitted numbers": lambda one: _by_path(_sub_section(one)),
}
"""What each kind of key may hold that is no pair or list of others."""
