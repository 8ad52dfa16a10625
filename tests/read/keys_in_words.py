"""The table of keys in words, which configs/README.md has: `python -m tests.read.keys_in_words`
prints it."""

from collections.abc import Iterator

from tcstudy.scene.keys import OF_ALL_LAWS, Key, row, rows
from tcstudy.scene.units import NONE

HEAD = "| section | what it says |\n|---|---|\n"
PLACE = {"sections": "[]", "named sections": ".NAME"}
"""What stands in a path for one of several."""
MODEST = {"name", "names", "section", "sections", "named sections", "flag"}
"""Kinds whose defaults go without saying."""


def markdown() -> str:
    """The table, a line for each section and each kind of mapping in it."""
    plain = "; ".join(_said(one) for one in rows("").values() if not one.of)
    return HEAD + f"| (beside these) | {plain} |\n" + "".join(_lines("", set()))


def _lines(path: str, seen: set[str], section: str = "") -> Iterator[str]:
    """Lines of the sections under one, each section once."""
    for one in rows(section).values():
        here = f"{path}.{one.name}" if path else one.name
        for name in one.of:
            if name in seen or name == "point":
                continue
            seen.add(name)
            held = "; ".join(_said(child) for child in rows(name).values())
            if one.kind == "law":
                held = "; ".join(["`law`", *(_said(row(name, key)) for key in OF_ALL_LAWS)])
            said = one.meaning if not section else ""
            place = "boundary.EDGE" if name == "boundary" else here + PLACE.get(one.kind, "")
            yield f"| `{place}` | {'. '.join(part for part in (said, held) if part)} |\n"
            yield from _lines(place, seen, name)


def _said(one: Key) -> str:
    """A key, what it means, its unit, words and default."""
    unit = f"[{one.dimension.si}]" if one.dimension != NONE and one.kind != "point" else ""
    words = " or ".join(f"`{word}`" for word in one.words)
    number = f"{one.default:g}" if isinstance(one.default, float) else one.default
    default = f"default {number}" if one.default is not None and one.kind not in MODEST else ""
    more = f"({', '.join(part for part in (words, default) if part)})" if words or default else ""
    return " ".join(part for part in (f"`{one.name}`", one.meaning, unit, more) if part)


if __name__ == "__main__":
    print(markdown(), end="")
