"""Maps of the contact line's state: of the solution of least energy over the parameter, and along the whole path.

What a picture of a path needs, read from its file.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from tcstudy.data.store import load_root
from tcstudy.reports.figures import style
from tcstudy.reports.terminal.path_summary import STATES, seen_folds
from tcstudy.reports.text import axis_unit
from tcstudy.scene.contact_states import ContactState

if TYPE_CHECKING:
    from matplotlib.axes import Axes

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
    branches: (b,) response along every branch, None where they are not sought
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
    branches: Array | None = None

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
    data = load_root(path, "path")
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
        branches=values("branch_u_T", "branch_xi") if "branch_u_T" in data else None,
    )


COLOURS = {
    ContactState.STICK: "#dedede",
    ContactState.SLIP: "#7fb8de",
    ContactState.SOFTEN: "#f2c14e",
    ContactState.DROP: "#d55e00",
    ContactState.WEAKENED: "#b7a3d6",
}


def draw_states(over: Axes, along: Axes, picture: PathPicture, divisor: float, label: str) -> list[Any]:
    """Both maps; returns what their colours mean.

    over:    over the parameter, the solution of least energy on the path
    along:   along the path, whose length is counted in the plane of the response curve
    divisor: of the parameter;  label: of the parameter with its unit
    """
    from matplotlib.patches import Patch

    data = picture.data
    node = np.argsort(data["arclength"].values, kind="stable")
    ends = np.concatenate([[0.0], np.cumsum(data["c"].values[node])])
    metre, unit = axis_unit([ends[-1]], data["arclength"].attrs["units"])
    states = data["state"].values[:, node].astype(float)
    edges, pieces = _least(picture)
    _map(over, edges / divisor, ends / metre, states, pieces)
    over.set_title("State of the contact line: least energy on the path", loc="left")
    position, shown = _positions(picture)
    _map(along, position, ends / metre, states, shown)
    along.set_title("State along the path (dashed: folds; line: parameter)", loc="left")
    _parameter(along, picture, position, shown, divisor, label)
    for axes in (over, along):
        axes.set_ylim(0.0, ends[-1] / metre)
        axes.set_ylabel(style.labelled("arclength", unit))
    present = [state for state in ContactState if np.any(states == state)]
    return [Patch(color=COLOURS[state], label=STATES[state]) for state in present]


def _map(axes: Axes, x: Array, y: Array, states: Array, pieces: NDArray[np.intp]) -> None:
    """Columns of states between the edges x; a piece of −1 leaves a gap."""
    from matplotlib.colors import BoundaryNorm, ListedColormap

    colours = ListedColormap(list(COLOURS.values()))
    values = np.where((pieces >= 0)[:, None], states[pieces], np.nan)
    if len(values):
        norm = BoundaryNorm(np.arange(len(COLOURS) + 1) - 0.5, len(COLOURS))
        axes.pcolormesh(x, y, np.ma.masked_invalid(values.T), cmap=colours, norm=norm, rasterized=True)


def _least(picture: PathPicture) -> tuple[Array, NDArray[np.intp]]:
    """(edges, pieces) of the solution of least energy; −1 where the path has none."""
    data = picture.data
    if not data.sizes.get("interval", 0):
        return np.zeros(1), np.zeros(0, dtype=np.intp)
    edges: list[float] = []
    pieces: list[int] = []
    columns = (data[name].values for name in ("lowest_begin", "lowest_end", "lowest_piece"))
    for begin, end, piece in zip(*columns, strict=True):
        if edges and begin > edges[-1]:
            edges.append(begin)
            pieces.append(-1)
        edges += [end] if edges else [begin, end]
        pieces.append(int(piece))
    return np.array(edges), np.array(pieces, dtype=np.intp)


def _positions(picture: PathPicture) -> tuple[Array, NDArray[np.intp]]:
    """Position of the vertices along the drawn part of the path, and its pieces."""
    shown, t, y = picture.shown()
    wide, tall = float(np.ptp(t)) if len(t) else 1.0, float(np.ptp(y)) if len(y) else 1.0
    step = np.hypot(np.diff(t, axis=1)[:, 0] / (wide or 1.0), np.diff(y, axis=1)[:, 0] / (tall or 1.0))
    return np.concatenate([[0.0], np.cumsum(step)]), shown


def _parameter(
    axes: Axes, picture: PathPicture, position: Array, shown: NDArray[np.intp], divisor: float, label: str
) -> None:
    """The parameter over the length of the path, with an axis of its own, and thin lines at folds that lie apart."""
    axes.set_xlabel("length of the path [%]")
    if not len(shown):
        return
    length = position[-1] or 1.0
    axes.set_xlim(0.0, length)
    axes.set_xticks(np.linspace(0.0, length, 6), [f"{part}" for part in range(0, 101, 20)])
    ends = np.clip(np.stack([picture.t[shown], picture.t[shown + 1]], axis=1), *picture.span) / divisor
    values = axes.twinx()
    values.plot(np.stack([position[:-1], position[1:]], axis=1).ravel(), ends.ravel(), color=style.INK, linewidth=1.1)
    values.set_ylim(*(x / divisor for x in picture.span))
    values.set_ylabel(label)
    values.spines["right"].set_visible(True)
    last = -np.inf
    for vertex in seen_folds(picture.data)[0]:
        at = np.flatnonzero(shown == vertex)
        if len(at) and position[at[0]] - last > 0.01 * length:
            last = position[at[0]]
            axes.axvline(last, color=style.VERMILLION, linewidth=0.8, linestyle=(0, (4, 2)))
