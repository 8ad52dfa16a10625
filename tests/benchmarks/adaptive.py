"""Error against unknowns on uniform, graded and adaptive meshes: data and chart by one command.

    python -m tests.benchmarks.adaptive          # writes results/adaptive.nc and results/adaptive.png
    python -m tests.benchmarks.adaptive --goals  # prints estimated over true errors of goals, scene by scene

Scene:     configs/singular.yaml
Error:     √(‖u_ref − u_h‖² + η_ref²) relative to ‖u_ref‖, the distance by quadrature; the reference is the adaptive
           family at REFERENCE unknowns, η_ref its own estimated error, added in squares as Galerkin orthogonality
           asks. Solutions with less than FACTOR times η_ref are not shown: it is at most a tenth of their square
Estimate:  what the program itself says, without the reference
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import xarray as xr

import tcstudy
from tcstudy.reports.figures.style import BLUE, INK, PALE, SHADE, VERMILLION, WIDTH, save, styled
from tcstudy.scene.study import FamilyName, Goal, MeshPlan, Study
from tests.benchmarks.panels import inches
from tests.verification import manufactured
from tests.verification.goal_scenes import (
    BRACKET,
    FILM,
    HEATED,
    OBTUSE,
    RESULTANT,
    SLIP_LENGTH,
    at_crossing,
    fine_value,
    front_resultant,
    front_slip,
    front_study,
    ring_scene,
    scene_of,
    spring_scene,
    table,
    value_at_corner,
)
from tests.verification.reference import distance, solved_levels

if TYPE_CHECKING:
    from matplotlib.axes import Axes

MOST, REFERENCE, SHOWN = 90_000, 500_000, 1300
"""Unknowns of the finest mesh whose error is measured, of the reference, and of the mesh that is drawn."""
FACTOR = 3.3

FAMILIES = ("uniform", "graded", "adaptive")
COLOURS = {"uniform": "#444444", "graded": VERMILLION, "adaptive": BLUE}
MARKS = {"uniform": "s", "graded": "D", "adaptive": "o"}


def measure(study: Study) -> xr.Dataset:
    """Unknowns, estimated and true errors of all families; one adaptive mesh for the picture."""
    maxh = study.mesh.maxh
    adaptive = list(solved_levels(study, MeshPlan(maxh, 60, "adaptive"), REFERENCE))
    families = {
        "uniform": list(solved_levels(study, MeshPlan(maxh, 15), MOST)),
        "graded": list(solved_levels(study, MeshPlan(maxh, 15, "graded"), MOST)),
        "adaptive": adaptive,
    }
    least = FACTOR * adaptive[-1].estimate
    rows = {name: [s for s in solved if s.n_dof <= MOST and s.estimate >= least] for name, solved in families.items()}
    most = max(len(solved) for solved in rows.values())
    shape = (len(FAMILIES), most)
    n_dof, estimate, error = (np.full(shape, np.nan) for _ in range(3))
    for i, name in enumerate(FAMILIES):
        for k, solved in enumerate(rows[name]):
            n_dof[i, k], estimate[i, k] = solved.n_dof, solved.estimate
            error[i, k] = np.hypot(distance(solved, adaptive[-1], study), adaptive[-1].estimate)
    shown = min(rows["adaptive"], key=lambda s: abs(s.n_dof - SHOWN)).triangles
    dims = ("family", "level")
    return xr.Dataset(
        {
            "n_dof": (dims, n_dof, {"long_name": "displacement unknowns"}),
            "estimate": (dims, estimate, {"long_name": "estimated relative error in the energy norm"}),
            "error": (dims, error, {"long_name": "relative error in the energy norm, against the reference"}),
            "x": ("node", shown.points[:, 0]),
            "y": ("node", shown.points[:, 1]),
            "triangle": (("face", "corner"), shown.triangles.astype(np.int32)),
        },
        coords={"family": list(FAMILIES)},
        attrs={"title": study.title, "reference_dofs": adaptive[-1].n_dof, "reference_error": adaptive[-1].estimate},
    )


def rate(data: xr.Dataset, family: str, last: int = 3) -> float:
    """Slope of log error over log unknowns on the last meshes of a family."""
    n, e = (data[name].sel(family=family).dropna("level").values for name in ("n_dof", "error"))
    return float(np.polyfit(np.log(n[-last:]), np.log(e[-last:]), 1)[0])


def draw(data: xr.Dataset, target: Path) -> None:
    """Errors on the left, an adaptive mesh on the right."""
    from matplotlib.figure import Figure
    from PIL import Image

    height = 4.1
    with styled():
        figure = Figure(figsize=(WIDTH, height))
        _errors(inches(figure, 0.72, 0.62, 3.75, height - 1.1), data)
        _mesh(inches(figure, 4.75, 0.62, 3.1, height - 1.1), data)
        title = "Singular corners: uniform meshes lose the rate N⁻½, graded and adaptive ones keep it"
        figure.text(0.72 / WIDTH, 1 - 0.14 / height, title, va="top", fontsize=10.5, color=INK)
        save(figure, target)
    with Image.open(target) as picture:  # few colours: a palette takes a third of the bytes
        picture.convert("RGB").quantize(64, dither=Image.Dither.NONE).save(target, optimize=True)


def _errors(axes: Axes, data: xr.Dataset) -> None:
    for name in FAMILIES:
        own = data.sel(family=name).dropna("level")
        n, error = own["n_dof"].values, own["error"].values
        axes.plot(n, own["estimate"].values, color=COLOURS[name], linewidth=1.1)
        axes.plot(
            n, error, MARKS[name], color=COLOURS[name], markersize=5, markeredgecolor="white", markeredgewidth=0.5
        )
        text = f"{name}\n$N^{{{rate(data, name):.2f}}}$"
        left = name == "adaptive"
        axes.annotate(text, (n[-1], error[-1]), (-14, -5) if left else (7, 0), textcoords="offset points", va="center",
                      ha="right" if left else "left", color=COLOURS[name])  # fmt: skip
    axes.set(xscale="log", yscale="log", xlabel="displacement unknowns N", ylabel="relative error in the energy norm")
    axes.set_xlim(15, 6e5)
    axes.grid(color=SHADE, linewidth=0.5)
    axes.set_axisbelow(True)
    start, end = np.array([60.0, 6e3]), 0.12
    axes.plot(start, end * (start / start[0]) ** -0.5, color=PALE, linewidth=0.9, linestyle=(0, (4, 3)))
    axes.annotate(
        r"$N^{-1/2}$", (start[0], end), (-3, -2), textcoords="offset points", color=PALE, ha="right", va="top"
    )
    axes.annotate(
        "marks: true error\nlines: estimated", (0.03, 0.03), xycoords="axes fraction", color=INK, fontsize=8.5
    )


def _mesh(axes: Axes, data: xr.Dataset) -> None:
    axes.triplot(data["x"], data["y"], data["triangle"], color=COLOURS["adaptive"], linewidth=0.3)
    axes.set_aspect("equal")
    axes.axis("off")
    for text, at, where, side in (
        ("clamped", (0.0, 1.5), (-5, 0), "right"),
        ("contact, Tresca friction", (1.0, 0.0), (0, -10), "center"),
    ):
        turned = 90 if side == "right" else 0
        axes.annotate(text, at, where, textcoords="offset points", ha="center" if not turned else "right",
                      va="center", rotation=turned, fontsize=8.5, color=INK)  # fmt: skip
    axes.annotate("pulled", (2.0, 0.5), (4, 0), textcoords="offset points", rotation=-90, va="center", fontsize=8.5)
    axes.annotate("pulled", (0.5, 2.0), (0, 3), textcoords="offset points", ha="center", va="bottom", fontsize=8.5)


def manufactured_resultant() -> float:
    """∫₀¹ ξ of the manufactured solution, a quadratic: exact by Simpson's rule."""
    return float(np.array([1.0, 4.0, 1.0]) @ manufactured.friction(np.array([0.0, 0.5, 1.0])) / 6.0)


def goal_cases() -> Iterator[tuple[str, Study, Goal, float]]:
    """Scene, study, goal and its true value: scenes of tests/verification/."""
    smooth = manufactured.manufactured_study(1, 0.25)
    yield "thermoelastic, smooth", smooth, RESULTANT, manufactured_resultant()
    yield "thermoelastic, smooth", smooth, Goal("u_T", (0.4, 0.0)), float(manufactured.slip(np.array(0.4)))
    for change in (1 / 3, 0.447, 0.683):
        study = front_study(change)
        name = f"front at {change:.3f}"
        yield name, study, RESULTANT, front_resultant(change)
        yield name, study, Goal("u_T", (0.85, 0.0)), front_slip(change, 0.85)
        yield name, study, SLIP_LENGTH, 1.0 - change
    ring, resultant, slip = ring_scene()
    yield "ring", ring, RESULTANT, resultant
    yield "ring", ring, Goal("u_T", (math.cos(0.7), math.sin(0.7))), slip
    springs, resultant = spring_scene()
    yield "springs", springs, RESULTANT, resultant
    yield "springs", springs, Goal("u_T", (0.3, 0.0)), math.sin(0.3 * math.pi)
    for name, text in (("film", FILM), ("heated", HEATED)):
        for goal in (Goal("u_T", (1.4, 0.0)), SLIP_LENGTH, *([RESULTANT] if name == "film" else [])):
            yield name, scene_of(text), goal, fine_value(text, goal, 3000)
    bracket = scene_of(BRACKET)
    yield "bracket", bracket, RESULTANT, value_at_corner(bracket, RESULTANT, OBTUSE)


def print_goals() -> None:
    """A row for each scene, goal and family: median, and true relative error and effectivity by level."""
    print("| scene | goal | meshes | median | unknowns: relative error (estimate/error, * at a crossing) |")
    print("|---|---|---|---|---|")
    families: tuple[tuple[FamilyName, int], ...] = (("uniform", 4), ("adaptive", 20))
    for name, study, goal, known in goal_cases():
        for family, levels in families:
            rows = table(study, goal, known, family, levels, 3000)
            crossing = [at_crossing(rows, i) for i in range(len(rows))]
            usual = [row.effectivity for row, at in zip(rows[2:], crossing[2:], strict=True) if not at]
            cells = [
                f"{row.n_dof}: {abs(row.signed):.0e} ({row.effectivity:.2f}{'*' if at else ''})"
                for row, at in zip(rows, crossing, strict=True)
            ]
            median = f"{np.median(usual):.2f}" if usual else "–"
            print(f"| {name} | {goal.quantity} | {family} | {median} | {', '.join(cells)} |", flush=True)


def main() -> None:
    """Measure, store, draw, and print the rates."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--study", type=Path, default=Path("configs/singular.yaml"))
    parser.add_argument("--output", type=Path, default=Path("results/adaptive"), help="without suffix")
    parser.add_argument("--redraw", action="store_true", help="draw the stored data again")
    parser.add_argument("--goals", action="store_true", help="print the effectivity of goals, nothing else")
    options = parser.parse_args()
    if options.goals:
        print_goals()
        return
    stored, picture = options.output.with_suffix(".nc"), options.output.with_suffix(".png")
    if not options.redraw:
        measure(tcstudy.load(options.study)).to_netcdf(stored)
    with xr.open_dataset(stored) as data:
        data.load()
    draw(data, picture)
    for name in FAMILIES:
        own = data.sel(family=name).dropna("level")
        ratio = (own["estimate"] / own["error"]).values
        print(f"{name:9} N^{rate(data, name):.3f}   estimate/error {ratio.min():.2f} … {ratio.max():.2f}")


if __name__ == "__main__":
    main()
