"""The pictures of the gallery in configs/README.md, all by one command (about two minutes).

    python -m tests.benchmarks.gallery           # writes gallery-NAME.png into a scratch folder and says where
    python -m tests.benchmarks.gallery die ring  # only these
    python -m tests.benchmarks.gallery --keep    # into results/, over the pictures that the guide shows

Where a closed form is known (the head of each study has it), open circles show it beside the computed curve.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import xarray as xr
from PIL import Image

import tcstudy
from tcstudy.reports.figures.style import BLUE, INK, PALE, VERMILLION, WIDTH, save, styled
from tests.benchmarks.panels import inches
from tests.verification.gallery_forms import Law, bar, ring_slip

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

ROOT = Path(__file__).parents[2]
COLOURS = (BLUE, "#009e73", "#e69f00", VERMILLION)
COLOURS_KEPT = 128
"""Colours of a picture's palette, which makes its file half as large and leaves colour bars smooth."""

GAP = 0.7
"""Between panels [inch]."""

MARKS = 12
"""Open circles on a curve."""

Panels = list[tuple[str, Law, str, tuple[float, str]]]
"""Title of a panel (a law of the sweep), law, stored quantity, its unit."""

SYMBOLS = {"u_T": "$u_T$", "xi": r"$\xi = -S_T$"}

RAIL = 224.25033e3
"""Resistance of the ballast in welded_rail.yaml [Pa]."""


def title(figure: Figure, text: str, below: str) -> None:
    """The heading of a picture and a line of explanation."""
    height = figure.get_figheight()
    figure.text(0.09, 1 - 0.25 / height, text, weight="bold", size=13, va="center")
    figure.text(0.09, 1 - 0.52 / height, below, va="center")


def strips(tree: xr.DataTree, heading: str, below: str, panels: Panels, bar_of: tuple[float, float, float]) -> Figure:
    """Slip or friction along a bar at every temperature, a panel for each law or quantity; `bar_of`: D, L, α."""
    from matplotlib.figure import Figure

    data = tree[max(tree.children)].dataset
    stiffness, length, expansion = bar_of
    divisor, unit = (1e-3, "mm") if length < 1 else (1.0, "m") if length < 1e3 else (1e3, "km")
    figure = Figure(figsize=(WIDTH, 3.9))
    title(figure, heading, below)
    wide = (WIDTH - 0.75 - 0.2) / len(panels) - GAP + GAP / len(panels)
    places = np.linspace(0.0, length, MARKS + 1)[1:]
    for column, (name, law, quantity, (scale, units)) in enumerate(panels):
        axes = inches(figure, 0.75 + column * (wide + GAP), 0.5, wide, 2.5)
        of = data.sel(friction=name) if "friction" in data.dims else data
        for colour, theta in zip(COLOURS, data["heat_theta"].values, strict=False):
            axes.plot(
                data["arclength"] / divisor,
                of[quantity].sel(heat_theta=theta) / scale,
                color=colour,
                label=f"{theta:g} K",
            )
            exact = bar(law, stiffness, length, expansion * float(theta), places)
            shown = exact if quantity == "u_T" else np.where(exact > 0, friction(law, exact), np.nan)
            axes.plot(places / divisor, shown / scale, "o", mfc="none", mec=colour, ms=4.5, clip_on=False)
        axes.set(xlim=(0.0, length / divisor), title=name, xlabel=f"distance from the held end [{unit}]")
        axes.set_ylim(0.0, 1.05 * float((data if quantity == "u_T" else of)[quantity].max()) / scale)
        axes.set_ylabel(f"{SYMBOLS[quantity]} [{units}]")
        if not column:
            axes.legend(frameon=False, loc="upper left")
    return figure


def friction(law: Law, slip: np.ndarray) -> np.ndarray:
    """b at slips > 0; beside a jump down the larger slip has the lower value."""
    points = np.array(law)
    after = np.searchsorted(points[:, 0], slip, side="right")
    low, high = points[after - 1], points[np.minimum(after, len(points) - 1)]
    width = np.where(high[:, 0] > low[:, 0], high[:, 0] - low[:, 0], 1.0)
    return low[:, 1] + (high[:, 1] - low[:, 1]) * (slip - low[:, 0]) / width


def rail(tree: xr.DataTree) -> Figure:
    laws: dict[str, Law] = {
        "plastic": [(0, RAIL)],
        "en1991": [(0, 0), (2e-3, RAIL)],
        "peaked": [(0, 2 * RAIL), (2e-3, RAIL)],
    }
    panels: Panels = [(name, law, "u_T", (1e-3, "mm")) for name, law in laws.items()]
    below = "slip of 140 m of rail that is 20, 40, 60 K too warm, three laws of the ballast; circles: closed form"
    return strips(tree, "Welded rail in summer", below, panels, (210e9 * 0.172, 140.0, 1.2e-5))


def pipeline(tree: xr.DataTree) -> Figure:
    law: Law = [(0, 2e3), (0.02, 1e3)]
    panels: Panels = [("slip", law, "u_T", (1.0, "m")), ("friction of the seabed", law, "xi", (1e3, "kPa"))]
    below = "the last 4.5 km before the free end; breakout friction falls to half over 20 mm; circles: closed form"
    return strips(tree, "Start-up of a hot pipeline", below, panels, (365.7e6 * 9, 4500.0, 1.17e-5))


def die(tree: xr.DataTree) -> Figure:
    laws: dict[str, Law] = {"elastic": [(0, 0), (1e-3, 2e9)], "brittle": [(0, 0), (4e-6, 8e6), (4e-6, 2e6)]}
    panels: Panels = [(name, law, "xi", (1e6, "MPa")) for name, law in laws.items()]
    below = "shear in the attach of half a die after cooling; a brittle attach breaks from the edge; circles: shear lag"
    return strips(tree, "Silicon die on a compliant attach", below, panels, (84.5e6, 5e-3, 14.4e-6))


def slab(tree: xr.DataTree) -> Figure:
    """Slip of the half slab, and the stress of its surface beside that of its base."""
    from matplotlib.figure import Figure

    data = tree["level_0"].dataset
    figure = Figure(figsize=(WIDTH, 3.9))
    title(
        figure,
        "Concrete slab on a hot afternoon",
        "left: 10 and 30 K warmer; right: 30 K, surface 12 K warmer than the base; circles: closed form",
    )
    left, right = inches(figure, 0.75, 0.5, 3.2, 2.5), inches(figure, 4.75, 0.5, 3.05, 2.5)
    places = np.linspace(0.0, 60.0, MARKS + 1)[1:]
    laws: dict[str, Law] = {"drag": [(0, 7080.0)], "bonded": [(0, 35400.0), (1e-3, 7080.0)]}
    for number, (name, law) in enumerate(laws.items()):
        for row, theta, colour in ((0, 10.0, BLUE), (1, 30.0, VERMILLION)):
            slip, style = 1e3 * data["u_T"].values[row, number], ("-", "--")[number]
            left.plot(data["arclength"], slip, style, color=colour, label=f"{name}, {theta:g} K")
            left.plot(places, 1e3 * bar(law, 6e9, 60.0, 1e-5 * theta, places), "o", mfc="none", mec=colour, ms=4.5)
    left.set(xlabel="distance from the middle [m]", ylabel="$u_T$ [mm]", title="slip")
    left.legend(frameon=False)
    for side, colour, name in ((0.2, VERMILLION, "surface, 36 K"), (0.0, BLUE, "base, 24 K")):
        nodes = np.flatnonzero(np.abs(data["node_y"].values - side) < 1e-9)
        nodes = nodes[np.argsort(data["node_x"].values[nodes])]
        x, u = data["node_x"].values[nodes], data["u_x"].values[2, 0][nodes]
        theta = 30.0 + 60.0 * (side - 0.1)
        middles = 0.5 * (x[1:] + x[:-1])
        right.plot(middles, 30e3 * (np.diff(u) / np.diff(x) - 1e-5 * theta), color=colour, label=name)
        inside = places[:-1]
        right.plot(inside, -7.08e-3 * (60 - inside) / 0.2 - 0.3 * (theta - 30), "o", mfc="none", mec=colour, ms=4.5)
    right.set(
        xlabel="distance from the middle [m]",
        ylabel="σ$_{xx}$ [MPa]",
        title="stress: curling is held back (drag, 30 K)",
    )
    right.axhline(0.0, color=PALE, linewidth=0.8)
    right.legend(frameon=False)
    return figure


def ring(tree: xr.DataTree) -> Figure:
    """The bush after its largest turn, with lines that were radial, and torque over the turn."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(WIDTH, 4.3))
    title(
        figure,
        "Rubber bush that slips on its shaft",
        "softening film, housing turned by 8 mm: lines were radial and began at the marks on the shaft",
    )
    body, chart = inches(figure, 0.3, 0.25, 3.4, 3.4), inches(figure, 4.75, 0.55, 3.05, 2.9)
    _draw_turned(body, tree["level_2"].dataset)
    turns = np.linspace(0.0, 8e-3, 201)
    numbers = tree.to_dataset().isel(level=-1)
    for colour, name, law in ((BLUE, "held", [(0, 2e5)]), (VERMILLION, "softening", [(0, 2e5), (5e-3, 1e5)])):
        torque = [2 * np.pi * 0.02**2 * ring_slip(law, 1e6, 0.02, 0.04, turn)[1] for turn in turns]
        chart.plot(1e3 * turns, torque, color=colour, label=f"{name}: closed form", linewidth=1.0)
        found = -0.02 * numbers["friction_resultant"].sel(friction=name).values
        chart.plot(1e3 * numbers["boundary_housing_u_T"], found, "o", color=colour, label=f"{name}: tcstudy", ms=5)
    chart.set(xlabel="turn of the housing [mm]", ylabel="torque [N m/m]", ylim=(0.0, 560.0), xlim=(0.0, 8.3))
    chart.legend(frameon=False, loc="lower right")
    return figure


def _draw_turned(axes: Axes, data: xr.Dataset) -> None:
    """The bush with lines that were radial before its last turn, and the places on the shaft where they began."""
    from matplotlib.patches import Circle
    from matplotlib.tri import LinearTriInterpolator, Triangulation

    mesh = Triangulation(data["node_x"], data["node_y"], data["triangle"])
    fields = [LinearTriInterpolator(mesh, data[name].values[-1, 1]) for name in ("u_x", "u_y")]
    radii = np.linspace(0.02005, 0.0399, 30)
    axes.add_patch(Circle((0, 0), 40, facecolor="#dedede", edgecolor=INK))
    axes.add_patch(Circle((0, 0), 20, facecolor="white", edgecolor=INK))
    for angle in 2 * np.pi * np.arange(24) / 24:
        c, s = np.cos(angle), np.sin(angle)
        u_x, u_y = (field(radii * c, radii * s) for field in fields)
        turned = angle + (c * u_y - s * u_x) / radii
        axes.plot(1e3 * radii * np.cos(turned), 1e3 * radii * np.sin(turned), color=BLUE, linewidth=1.4)
        axes.plot([17 * c, 20 * c], [17 * s, 20 * s], color=VERMILLION)
    axes.text(0, 0, "shaft", ha="center", va="center", color=VERMILLION)
    axes.set(xlim=(-41, 41), ylim=(-41, 41), aspect="equal")
    axes.set_axis_off()


FIELDS = "output.fields=true"
FIGURES: dict[str, tuple[Callable[[xr.DataTree], Figure], tuple[str, ...]]] = {
    "welded_rail": (rail, ()),
    "pipeline_end": (pipeline, ()),
    "slab": (slab, (FIELDS,)),
    "die": (die, ()),
    "ring": (ring, (FIELDS,)),
}
"""What is drawn here, with the options of its run."""


def make(name: str, scratch: Path, folder: Path) -> Path:
    """Solve one study and put its picture into the folder."""
    study, data, target = ROOT / "configs" / f"{name}.yaml", scratch / f"{name}.nc", folder / f"gallery-{name}.png"
    if name in (*HISTORIES, "pull_fit", "isola"):
        tcstudy.run(study, data)
        tcstudy.draw(data, target)
    elif name == "thickness_map":
        tcstudy.run(study, data)
        tcstudy.draw(data, target, map=("H", "grading"), of="lambda_1")
    elif name == "pull_test":
        tcstudy.run(study, data)
        tcstudy.draw(data, target, y="friction")
    elif name == "singular":
        tcstudy.run(tcstudy.load(study, [FIELDS, "mesh.levels=8"]), data)
        tcstudy.draw(data, target)
    elif name == "quickstart":
        tcstudy.run(tcstudy.load(study, [FIELDS]), data)
        tcstudy.draw(data, target, at={"alpha": 200, "theta_bar": 10, "friction": "softening"})
    else:
        draw, options = FIGURES[name]
        tree = tcstudy.run(tcstudy.load(study, list(options)), data)
        with styled():
            save(draw(tree), target)
    with Image.open(target) as picture:
        small = picture.convert("RGB").quantize(COLOURS_KEPT)
    small.save(target, optimize=True)
    return target


HISTORIES = ("rail_year", "pipeline_cycles", "cyclic_pull")
NAMES = ("quickstart", "pull_test", "singular", *FIGURES, *HISTORIES, "pull_fit", "thickness_map", "isola")


def main(words: list[str]) -> None:
    parser = argparse.ArgumentParser(prog="python -m tests.benchmarks.gallery")
    parser.add_argument("names", nargs="*", metavar="NAME", help=f"pictures to draw (all): {', '.join(NAMES)}")
    parser.add_argument("--keep", action="store_true", help="draw into results/ and not into a scratch folder")
    asked = parser.parse_args(words)
    if unknown := set(asked.names) - set(NAMES):
        parser.error(f"no picture {', '.join(sorted(unknown))}; there are {', '.join(NAMES)}")
    folder = ROOT / "results" if asked.keep else Path(tempfile.mkdtemp(prefix="gallery-"))
    with tempfile.TemporaryDirectory() as scratch:
        for name in asked.names or NAMES:
            print(make(name, Path(scratch), folder))


if __name__ == "__main__":
    main(sys.argv[1:])
