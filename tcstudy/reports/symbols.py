"""Symbols of parameters, by their names in files and their key paths."""

from __future__ import annotations

import re

GREEK = dict(
    zip(
        ["alpha", "beta", "delta", "lambda", "mu", "nu", "omega", "sigma", "tau", "theta"],
        "αβδλμνωστθ",
        strict=True,
    )
)
"""Letters that names spell out."""
EDGE_COLUMN = re.compile(r"boundary_(\w+?)_((?:u|g|f|force)_[xyNT]|theta_bar|[a-z]+)")
"""A column of what an edge has: the edge and its key."""
PART_PATH = re.compile(
    r"(?:boundary|friction|adhesion|materials)\.([^.]+)\.(?:heat\.|spring\.)?([^.]+)"
)
"""Key paths of what an edge, a law of an edge or a region has: its name and the key."""
LAW_POINT = re.compile(r"\bpoints[._](\d+)([._]s)?$")
"""Ends of names of a law's point: its number, and a mark where its slip is meant."""
SECTION_COLUMN = re.compile(r"^(?:heat|friction|adhesion|material|parameters)_(?=\w)")
"""Sections that columns begin with and symbols leave out."""


def symbol(name: str) -> str:
    """Return the symbol of a parameter.

    `friction.tau_s` is τ_s, `theta_bar` θ̄, `u_x` itself, `friction.points.0` b_0, that of its slip
    s_0. A column `boundary_grip_u_x` is u_x of grip, as is `boundary.grip.u_x`; `heat_theta` is θ.
    The rest is written in words.
    """
    part = PART_PATH.fullmatch(name)
    if part and part[1] != "points":
        return f"{symbol(part[2])} of {part[1]}"
    column = EDGE_COLUMN.fullmatch(name)
    if column:
        return f"{symbol(column[2])} of {column[1].replace('_', ' ')}"
    name = SECTION_COLUMN.sub("", name)
    point = LAW_POINT.search(name)
    if point:
        return f"{'s' if point[2] else 'b'}_{point[1]}"
    word = name.rpartition(".")[2]
    letter, _, index = word.partition("_")
    if len(letter) == 1:
        return word
    if letter not in GREEK:
        return f"{letter} {index}".replace("_", " ").strip()
    if index == "bar":
        return f"{GREEK[letter]}\N{COMBINING MACRON}"
    return f"{GREEK[letter]}_{index}" if index else GREEK[letter]
