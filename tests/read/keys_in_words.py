"""Write the reference of the study file, configs/reference.md, from the table of keys.

`python -m tests.read.keys_in_words` prints it.
"""

import re
from collections.abc import Iterable, Iterator

from tcstudy.scene.keys import Key, of_all_laws, row, rows
from tcstudy.scene.units import NONE

HEAD = """# Reference of the study file

One row per key, one table per section. `tests/read/keys_in_words.py` makes this page from
[`tcstudy/scene/keys.py`](../tcstudy/scene/keys.py).

- **value**: the kind of value with its SI unit. Any other unit of the same dimension may be written.
  An expression in x and y stands in quotes.
- **varies**: `sweep` if a sweep may vary the key, `path` if a path may run along it as well.
- **edges**: the boundary condition types that take the key. Without an entry all take it.
- `NAME` and `EDGE` are names of your choice. `[]` is an entry of a list.

[The guide](README.md#the-study-file) shows the sections at work. [Friction laws](howto/laws.md) have a page with their
parameters.
"""
BESIDE = "\n## Beside the sections\n\n"
PLACE = {"sections": "[]", "named sections": ".NAME"}
"""Endings of the paths of keys that hold several sections."""
VALUES = {
    "choice": "",
    "one or more": "",
    "number or word": "number or",
    "choice by edge": "",
    "named numbers": "number by name",
    "named sections": "section by name",
    "fitted numbers": "section by name",
    "sections": "list of sections",
    "material": "section",
    "law": "section",
    "point": "point [x, y]",
    "points": "list of points",
    "named points": "point by name",
    "named places": "point by name",
    "integer": "whole number",
    "displacement": "two numbers, expressions or `free`",
    "component": "number, expression or `free`",
    "vector": "two numbers or expressions",
    "field": "number or expression",
    "names": "name of a region, or a list",
    "sizes": "number, or a list",
    "goal": "name of a result, or `u_T` with a point",
    "quantity": "number",
    "quantities": "list of numbers",
    "named quantities": "number by name",
    "span": "two numbers",
    "flag": "true or false",
    "flag or word": "",
    "sweep points": "list, table or number",
    "named texts": "text by name",
    "words": "list of names",
}
"""Words for the kinds of value; a kind that is not named here is its own word."""


def markdown() -> str:
    """Return the whole page."""
    plain = [key for key in rows("").values() if not key.of]
    return HEAD + BESIDE + "".join([*_table(plain), *_sections("", set())])


def _sections(path: str, written: set[str], section: str = "") -> Iterator[str]:
    """Yield the lines of the sections below a path, each section once."""
    for key in rows(section).values():
        here = f"{path}.{key.name}" if path else key.name
        for name in key.of:
            if name in written or name == "point":
                continue
            written.add(name)
            place = "boundary.EDGE" if name == "boundary" else here + PLACE.get(key.kind, "")
            yield f"\n## `{place}`\n\n"
            if not section and key.meaning:
                yield f"{_sentence(_meaning(key))}\n\n"
            yield from _table(_held(key, name))
            yield from _sections(place, written, name)


def _held(key: Key, name: str) -> list[Key]:
    """Return the keys of a section; of a section of laws those that all laws have."""
    if key.kind != "law":
        return list(rows(name).values())
    return [row(name, "law"), *(row(name, shared) for shared in of_all_laws(name))]


def _table(keys: Iterable[Key]) -> Iterator[str]:
    """Yield the lines of a table with one row per key; columns without an entry are left out."""
    cells = [_cells(key) for key in keys]
    titles = [
        title
        for title in ("key", "meaning", "value", "default", "varies", "edges")
        if any(row_cells[title] for row_cells in cells)
    ]
    yield _line(titles)
    yield "|---" * len(titles) + "|\n"
    for row_cells in cells:
        yield _line([row_cells[title] for title in titles])


def _line(cells: list[str]) -> str:
    """Return one line of a table."""
    return f"| {' | '.join(cells)} |\n"


def _cells(key: Key) -> dict[str, str]:
    """Return the cells of a key by their titles."""
    default = f"{key.default:g}" if isinstance(key.default, float) else str(key.default)
    varies = ("sweep",) * key.swept + ("path",) * key.affine
    return {
        "key": f"`{key.name}`",
        "meaning": _meaning(key),
        "value": _value(key),
        "default": "" if key.default is None or key.kind == "flag" else f"`{default}`",
        "varies": ", ".join(varies),
        "edges": ", ".join(key.roles),
    }


def _meaning(key: Key) -> str:
    """Return the meaning of a key, with links that lead from this page to the guide."""
    return key.meaning.replace("](#", "](README.md#")


def _sentence(meaning: str) -> str:
    """Return a meaning with a capital letter and a full stop."""
    return re.sub(r"^\[?[a-z]", lambda first: first[0].upper(), meaning) + "."


def _value(key: Key) -> str:
    """Return the words of a choice, or the kind of value with its unit."""
    flags = ("true", "false") if key.kind == "flag or word" else ()
    words = ", ".join(f"`{word}`" for word in (*flags, *key.words))
    kind = VALUES.get(key.kind, key.kind)
    unit = f"[{key.dimension.si}]" if key.dimension != NONE and key.kind != "point" else ""
    if words and key.kind != "number or word":
        kind = ""
    return " ".join(part for part in (kind, words, unit) if part)


if __name__ == "__main__":
    print(markdown(), end="")
