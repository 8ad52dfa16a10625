"""A plate with known fields in a result file, and what a figure shows."""

from __future__ import annotations

import struct
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from tcstudy.data.records import LevelRecord, PointStatus
from tcstudy.laws.laws import Laws
from tcstudy.laws.shapes import SHAPES
from tcstudy.reports.figures import style
from tcstudy.reports.figures.point import point_figure
from tcstudy.reports.picture import LineFields, Picture
from tcstudy.scene.study import Axis, MeshPlan, OutputPlan, SolverPlan, Study
from tests.data.by_points import PointRecord, write

if TYPE_CHECKING:
    from matplotlib.figure import Figure

WIDTH, HEIGHT = 0.2, 0.1
ALPHA = Axis("alpha", ("heat", "alpha"), (25, 100), (25.0, 100.0), "W m-2 K-1")
FRICTION = Axis("friction", ("friction",), ({}, {}), ("tresca", "softening"), "1")
TAU = Axis("tau", ("friction", "tau"), (1e6, 2e7), (1e6, 2e7), "Pa")
FAILED = (1, 1)
SIDES: dict[str, Any] = {"left": "free", "right": "free"}
FILM: dict[str, Any] = {
    "units": "none",
    "body": {"rectangle": {"width": 2.0, "height": 1.0}},
    "boundary": {"bottom": "contact", "top": {"role": "clamped", "u_x": 0.3, "u_y": 0}} | SIDES,
    "material": {"E": 1.0, "nu": 0.3},
    "friction": {"law": "tresca", "tau": 0.1},
    "mesh": {"maxh": 0.6, "levels": 2},
    "path": {"parameter": "boundary.top.u_x", "from": 0, "to": 0.5},
}  # fmt: skip
"""A study as a dictionary: a plate whose top is moved along its film."""


def study(mode: Literal["grid", "list"], axes: tuple[Axis, ...], units: Literal["SI", "none"] = "SI") -> Study:
    return Study(
        title="Plate for $5 and $6",
        text="title: plate\n",
        source=None,
        units=units,
        mode=mode,
        axes=axes,
        scenes=(),
        mesh=MeshPlan((0.05,), 2),
        solver=SolverPlan(),
        output=OutputPlan(),
    )


def cells(level: int) -> int:
    """Elements along the contact line."""
    return 4 * 2**level


def level_record(level: int, fields: bool) -> LevelRecord:
    """A plate 0.2 × 0.1; its bottom, held at the left end, is the contact line."""
    n = cells(level)
    x, y = np.meshgrid(np.linspace(0.0, WIDTH, n + 1), np.linspace(0.0, HEIGHT, n // 2 + 1))
    corner = np.arange((n + 1) * (n // 2)).reshape(n // 2, n + 1)[:, :-1].ravel()
    lower = np.stack([corner, corner + 1, corner + n + 2], axis=1)
    upper = np.stack([corner, corner + n + 2, corner + n + 1], axis=1)
    h = WIDTH / n
    s = h * np.arange(1, n + 1)
    c = np.full(n, h)
    c[0], c[-1] = (1.5 * h, 0.5 * h) if n > 1 else (h, h)
    mesh = {"node_x": x.ravel(), "node_y": y.ravel(), "triangle": np.concatenate([lower, upper]).astype(np.int32)}
    edge = np.zeros(n, dtype=np.int8)
    return LevelRecord(level, h, 10 * n, n, s, s, 0.0 * s, c, edge, ("film",), 0.1, 0.1, mesh if fields else {})


def point_record(index: tuple[int, ...], level: LevelRecord, theta: bool = True) -> PointRecord:
    """The first half of the line sticks; the numbers differ from point to point."""
    scale = 1.0 + sum((k + 1) * i for k, i in enumerate(index)) + 10.0 * level.level
    slips = level.x > 0.5 * WIDTH + 1e-9
    u_T = np.where(slips, 1e-5 * scale * (level.x - 0.5 * WIDTH) / WIDTH, 0.0)
    xi = 2e7 * scale * np.cos(level.x / WIDTH)
    numbers = {"slip_length": float(level.c[slips].sum()), "inclusion_residual": 1e-12}
    fields = {}
    if level.fields:
        x, y = level.fields["node_x"].astype(float), level.fields["node_y"].astype(float)
        fields = {"u_x": 1e-4 * scale * x / WIDTH, "u_y": 5e-5 * y / HEIGHT}
        if theta:
            fields["theta"] = 20.0 * scale + 100.0 * x
    return PointRecord(index, level.level, PointStatus.OK, "", numbers, u_T, xi, fields, (~slips).astype(np.int8))


def failed_record(index: tuple[int, ...], level: int) -> PointRecord:
    reason = "the stiffness matrix is singular"
    return PointRecord(index, level, PointStatus.SINGULAR, reason, {}, np.empty(0), np.empty(0))


def result(
    path: Path,
    mode: Literal["grid", "list"] = "grid",
    axes: tuple[Axis, ...] = (ALPHA, FRICTION),
    fields: bool = True,
    theta: bool = True,
    units: Literal["SI", "none"] = "SI",
) -> Path:
    """A result file; its point FAILED has no solution on level 1."""
    plan = study(mode, axes, units)
    levels = [level_record(n, fields) for n in range(2)]
    points = [
        failed_record(index, 1) if index == FAILED and level.level == 1 else point_record(index, level, theta)
        for level in levels
        for index in np.ndindex(plan.shape)
    ]
    write(path, plan, levels, points)
    return path


def figure_of(picture: Picture) -> Figure:
    with style.styled():
        return point_figure(picture, style.Look())


def contact_panels(figure: Figure) -> tuple[Any, Any]:
    """The panels of u_T and of ξ."""
    upper, lower = ([a for a in figure.axes if a.get_ylabel().startswith(name)] for name in ("$u_T$", r"$\xi"))
    return upper[0], lower[0]


def shown_line(axes: Any) -> np.ndarray[Any, Any]:
    """(2, m) data of the curve among the lines of a panel (the others are reference lines of two points)."""
    (curve,) = [line for line in axes.lines if len(line.get_xdata()) > 2]
    return np.array(curve.get_data(), dtype=float)


def shown_steps(axes: Any) -> tuple[np.ndarray[Any, Any], np.ndarray[Any, Any]]:
    """Values of one part, each drawn from edge to edge, and the edges."""
    edges, values = shown_line(axes)
    return values[::2], np.append(edges[::2], edges[-1])


def texts_of(figure: Figure) -> list[tuple[str, Any]]:
    """The texts that one sees and their boxes [pixel]; numbers at ticks outside an axis are not seen."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.text import Text

    renderer, hidden = FigureCanvasAgg(figure).get_renderer(), set()
    figure.draw(renderer)
    for axis in (one for axes in figure.axes for one in (axes.xaxis, axes.yaxis)):
        low, high = sorted(axis.get_view_interval())
        slack = 1e-9 * (high - low)
        ticks = [*axis.get_major_ticks(), *axis.get_minor_ticks()]
        hidden |= {id(t.label1) for t in ticks if not low - slack <= t.get_loc() <= high + slack}
    shown = [text for text in figure.findobj(Text) if isinstance(text, Text) and text.get_visible()]
    seen = [text for text in shown if id(text) not in hidden and text.get_text().strip()]
    return [(text.get_text(), text.get_window_extent(renderer)) for text in seen]


def off_the_page(figure: Figure) -> list[str]:
    """Texts that reach over the edges of the picture."""
    page = figure.bbox.padded(1.0)
    return [
        text for text, box in texts_of(figure) if not (page.contains(box.x0, box.y0) and page.contains(box.x1, box.y1))
    ]


def crowded(figure: Figure) -> list[str]:
    """Texts that overlap another one or leave the picture."""
    found, boxes = off_the_page(figure), texts_of(figure)
    for i, (text, box) in enumerate(boxes):
        found += [f"{text} overlaps {other}" for other, rival in boxes[:i] if box.overlaps(rival)]
    return found


def line(x: list[float], y: list[float], s: list[float], c: list[float], edge: list[int]) -> LineFields:
    m = len(x)
    arrays = [np.array(values) for values in (s, x, y, c)]
    u_T = np.arange(1.0, m + 1)
    return LineFields(*arrays, np.array(edge), ("pad", "rim"), u_T, 10.0 * u_T, u_T > 1.0, "m", "Pa")


def png_size(path: Path) -> tuple[int, int]:
    data = path.read_bytes()
    assert data[:8] == b"\x89PNG\r\n\x1a\n"
    width, height = struct.unpack(">II", data[16:24])
    return width, height


def example_laws() -> tuple[Laws, ...]:
    """One law of every named shape, with parameters near 1."""
    parameters: dict[str, dict[str, object]] = {
        "tresca": {"tau": 1.0},
        "slip-weakening": {"tau_s": 1.0, "tau_k": 0.3, "delta": 1.0},
        "exponential": {"a": 1.0, "b": 0.3, "delta": 0.5},
        "saw-tooth": {"tau": 1.0, "delta": 0.5, "teeth": 3, "drop": 0.6, "decay": 0.8},
        "piecewise-linear": {"points": [(0.0, 0.0), (0.5, 1.0), (1.0, 1.0), (1.0, 0.4)]},
        "linear": {"k": 0.5},
        "elastic-plastic": {"tau": 1.0, "s0": 0.3},
        "bilinear": {"tau": 1.0, "s0": 0.3, "sf": 1.2},
        "trapezoidal": {"tau": 1.0, "s0": 0.3, "s1": 0.6, "sf": 1.2},
        "trilinear": {"tau": 1.0, "s0": 0.3, "sf": 0.9, "tau_r": 0.3},
    }
    return tuple(shape.build(**parameters[name]) for name, shape in SHAPES.items())


LOOKS = [style.Look(), style.Look((3.15, 8.0)), style.Look((6.7, 9.5))]
"""Usual, of one column of a paper, of a page."""


RAIL = """
units: none
title: A bar that warms and cools on friction
body: {rectangle: {width: 8, height: 0.5, edges: {bottom: base, left: middle, right: end, top: head}}}
boundary: {base: contact, middle: {role: clamped, u_x: 0, u_y: free}, head: free, end: free}
material: {E: 100, nu: 0, plane: stress, alpha_T: 0.01}
heat: {theta: 0}
friction: {law: tresca, tau: 0.5}
mesh: {maxh: 0.5}
history:
  memory: friction
  steps: [{theta: 4, in: 2, name: warm}, {theta: -4, in: 4, name: cold}, {theta: 0, in: 2, name: back}]
  repeat: 2
"""
"""A history of a bar that is held in the middle."""
