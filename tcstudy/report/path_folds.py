"""Which folds of a path a person sees: turns of the parameter that are not small against the range."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

VISIBLE = 0.005
"""Part of the range below which a step back of the parameter cannot be told from a point of the picture."""


def seen_folds(data: Any) -> tuple[NDArray[np.intp], int]:
    """(vertices of the folds that show, number of smaller turns): these come from nodes that let go one by one."""
    if not data.sizes.get("fold", 0):
        return np.zeros(0, dtype=np.intp), 0
    vertices = data["fold_vertex"].values.astype(np.intp)
    if "fold_size" not in data:
        return vertices, 0
    low, high = data.attrs["parameter_range"]
    large = data["fold_size"].values >= VISIBLE * abs(float(high) - float(low))
    return vertices[large], int(np.count_nonzero(~large))


def folds_in_words(data: Any) -> str:
    """How many folds there are, and how many smaller turns beside them."""
    vertices, small = seen_folds(data)
    text = f"{len(vertices)} {'fold' if len(vertices) == 1 else 'folds'}"
    return (
        f"{text} and {small} {'turn' if small == 1 else 'turns'} below {100 * VISIBLE:g} % of the range"
        if small
        else text
    )
