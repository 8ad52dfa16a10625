"""What the page needs to solve contact problems by itself: the live data of one level, every point's numbers."""

from __future__ import annotations

from typing import Any

import numpy as np

from tcstudy.reports.page.container import Container, Json
from tcstudy.reports.page.stored import Stored

FUNCTIONS = ("mechanical_load", "held_load", *(f"{name}_{part}" for name in ("source", "surroundings")
             for part in ("node", "weight", "load")))  # fmt: skip
POINTWISE = ("stiffness", "mechanical", "held", "beta", "alpha", "k", "q", "theta_bar", "valid")


def live_part(stored: Stored, box: Container) -> Json | None:
    """The finest level that has live data; None where no point is valid or the run kept none.

    A_tilde is symmetric: its lower triangle by rows.
    """
    usable = [n for n, data in stored.live.items() if np.any(data["valid"].values == 1.0)]
    if not usable or stored.study is None:
        return None
    level = max(usable)
    data = stored.live[level]
    group = stored.groups[level]
    dims = [str(d) for d in stored.data["status"].dims if d != "level"]
    A_tilde: Any = data["A_tilde"].values
    functions = {name: box.array(data[name].values) for name in FUNCTIONS if name in data and data[name].size}
    points = {name: box.array(data[name].transpose(*dims).values.ravel()) for name in POINTWISE}
    return {
        "level": level,
        "A": box.array(A_tilde[np.tril_indices(len(A_tilde))]),
        "c": box.array(group["c"].values),
        **functions,
        **points,
    }
