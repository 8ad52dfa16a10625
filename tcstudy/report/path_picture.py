"""What a path's pictures and tables need, read from its file."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tcstudy.data.path_store import open_path

Array = NDArray[np.float64]

RESPONSES: dict[str, tuple[str, str, Callable[[Array, Array, Array], Array]]] = {
    "mean-slip": ("mean $u_T$", "u_T", lambda u, xi, c: np.asarray(u @ c / c.sum())),
    "max-slip": ("max $|u_T|$", "u_T", lambda u, xi, c: np.max(np.abs(u), axis=1, initial=0.0)),
    "friction": (r"$\int\xi\,$ds", "energy", lambda u, xi, c: np.asarray(xi @ c)),
}
"""What may stand over the parameter: label, variable whose units it has (but see `response_units`), and formula."""


@dataclass(frozen=True)
class PathPicture:
    """A path as it is drawn; `data` is the whole file, loaded.

    name:     dotted name of the parameter, units: its units
    t:        (k,) parameter;  response: (k,) what is drawn over it, with its label and units
    loop:     (v,) response along the hysteresis loop, None without one
    asked:    (s,) response of the requested solutions
    """

    data: Any
    name: str
    units: str
    span: tuple[float, float]
    t: Array
    response: Array
    label: str
    response_units: str
    loop: Array | None
    asked: Array

    def shown(self) -> tuple[NDArray[np.intp], Array, Array]:
        """The pieces inside the span, and parameter and response at both ends of what is inside (p, 2)."""
        low, high = self.span
        t = np.stack([self.t[:-1], self.t[1:]], axis=1)
        y = np.stack([self.response[:-1], self.response[1:]], axis=1)
        pieces = np.flatnonzero((t.min(axis=1) < high) & (t.max(axis=1) > low))
        t, y = t[pieces], y[pieces]
        inside = np.clip(t, low, high)
        length = np.diff(t, axis=1)
        share = (inside - t[:, :1]) / np.where(length == 0.0, 1.0, length)
        share = np.where(length == 0.0, [0.0, 1.0], share)
        return pieces, inside, y[:, :1] + share * np.diff(y, axis=1)


def read_path_picture(path: Path, response: str = "mean-slip") -> PathPicture:
    """The picture of a path's file; raises StoreError if it is none, KeyError for an unknown response."""
    label, like, formula = RESPONSES[response]
    with open_path(path) as opened:
        data = opened.load()
    c = data["c"].values
    units = data[like].attrs["units"]

    def values(u_T: str, xi: str) -> Array:
        return formula(data[u_T].values, data[xi].values, c)

    low, high = sorted(float(x) for x in data.attrs["parameter_range"])
    return PathPicture(
        data=data,
        name=data.attrs["parameter"],
        units=data["parameter"].attrs["units"],
        span=(low, high),
        t=data["parameter"].values,
        response=values("u_T", "xi"),
        label=label,
        response_units="N m-1" if like == "energy" and units != "1" else units,
        loop=values("loop_u_T", "loop_xi") if "loop_u_T" in data else None,
        asked=values("solution_u_T", "solution_xi"),
    )
