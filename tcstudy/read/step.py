"""Lengths of a STEP file: the units that its text states (ISO 10303-21, 10303-41).

A representation context of the file assigns its units by reference: an SI_UNIT of METRE with a
prefix, or a CONVERSION_BASED_UNIT whose measure leads to one. The geometry kernel converts lengths
of all contexts to millimetres while it reads; it takes lengths without a unit for millimetres.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from functools import lru_cache
from pathlib import Path

KERNEL_UNIT = 1e-3
"""Length of one unit of a STEP file once the kernel has read it [m]."""
PREFIXES = {
    b"": 1.0,
    b"KILO": 1e3,
    b"HECTO": 1e2,
    b"DECA": 1e1,
    b"DECI": 1e-1,
    b"CENTI": 1e-2,
    b"MILLI": 1e-3,
    b"MICRO": 1e-6,
    b"NANO": 1e-9,
}
NAMES = {
    "km": 1e3,
    "m": 1.0,
    "dm": 1e-1,
    "cm": 1e-2,
    "mm": 1e-3,
    "um": 1e-6,
    "nm": 1e-9,
    "in": 0.0254,
    "ft": 0.3048,
    "yd": 0.9144,
    "mil": 2.54e-5,
}
"""Units as a study writes them [m]."""
SAME_UNIT = 1e-5
"""Relative difference of two units that is the rounding of a header, as 25.4001 mm for an inch."""
MAX_CONVERSIONS = 8
"""Conversions from one unit to the next; a longer chain leads nowhere."""

ASSIGNED = re.compile(rb"GLOBAL_UNIT_ASSIGNED_CONTEXT\(\(([^()]*)\)")
REFERENCE = re.compile(rb"#(\d+)")
ENTITY = re.compile(rb"#(\d+)=")
METRE = re.compile(rb"SI_UNIT\((?:\*,)?(?:\$|\.([A-Z]+)\.),\.METRE\.\)")
CONVERSION = re.compile(rb"CONVERSION_BASED_UNIT\((?:[^,']*,)?'[^']*',#(\d+)\)")
MEASURE = re.compile(rb"LENGTH_MEASURE\(([^()]*)\),#(\d+)\)")


def same_unit(length: float, reference: float) -> bool:
    """Return whether two lengths [m] are one unit."""
    return abs(length - reference) <= SAME_UNIT * reference


def unit_name(metres: float) -> str:
    """Return the unit of this length as a study writes it, or the length in metres."""
    for name, length in NAMES.items():
        if same_unit(metres, length):
            return name
    return f"{metres:g} m"


def stated_units(path: Path) -> tuple[float, ...]:
    """Return the distinct length units that a STEP file states [m]; empty if it states none.

    A file that cannot be read states none: the kernel says what is wrong with it.
    """
    try:
        state = path.stat()
        return _stated_units(str(path), state.st_size, state.st_mtime_ns)
    except OSError:
        return ()


@lru_cache(maxsize=16)
def _stated_units(path: str, _size: int, _changed: int) -> tuple[float, ...]:
    return length_units(Path(path).read_bytes())


def length_units(content: bytes) -> tuple[float, ...]:
    """Return the distinct length units that the text of a STEP file assigns [m]."""
    entities = dict[bytes, bytes]()
    assigned = dict[bytes, None]()
    for statement in content.split(b";"):
        if b"UNIT" not in statement:
            continue
        text = b"".join(statement.split())
        if entity := ENTITY.match(text):
            entities[entity[1]] = text
        for references in ASSIGNED.findall(text):
            assigned |= dict.fromkeys(REFERENCE.findall(references))
    units = list[float]()
    for metres in _lengths(entities, assigned):
        if not any(same_unit(metres, unit) for unit in units):
            units.append(metres)
    return tuple(units)


def _lengths(entities: Mapping[bytes, bytes], assigned: Mapping[bytes, None]) -> Iterator[float]:
    for number in assigned:
        metres = _metres(entities, number)
        if metres is not None:
            yield metres


def _metres(entities: Mapping[bytes, bytes], number: bytes) -> float | None:
    """Return the length of a unit, None of an entity that is no length."""
    factor = 1.0
    for _ in range(MAX_CONVERSIONS):
        text = entities.get(number, b"")
        if metre := METRE.search(text):
            prefix = PREFIXES.get(metre[1] or b"")
            return None if prefix is None else factor * prefix
        conversion = CONVERSION.search(text)
        if conversion is None:
            return None
        measure = MEASURE.search(entities.get(conversion[1], b""))
        if measure is None:
            return None
        try:
            factor *= float(measure[1])
        except ValueError:
            return None
        number = measure[2]
    return None
