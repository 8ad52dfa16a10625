"""The pictures of the gallery in configs/README.md, of the friction laws and of pages, by one
command (about a minute).

    python -m tests.benchmarks.gallery           # writes gallery-NAME.png into a scratch folder and says where
    python -m tests.benchmarks.gallery die laws  # only these
    python -m tests.benchmarks.gallery --keep    # into results/, over the pictures that the guides show

Each is what `tcstudy draw` makes of the study's results. Open circles are a closed form (the head
of the study has it). `pages` are parts of pages in Chromium.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from PIL import Image

import tcstudy
from tcstudy.laws.shapes import SHAPES, knows_pressure
from tcstudy.reports.figures import style
from tcstudy.reports.figures.panels import Panel, Scale, Sheet
from tcstudy.reports.figures.point import draw_law, slip_range
from tcstudy.reports.picture import read_picture
from tcstudy.reports.text import number
from tests.reports.figures.shown import example_laws
from tests.reports.page.browser import Browser
from tests.verification.gallery_forms import Law, PeeledArm, bar

if TYPE_CHECKING:
    from matplotlib.figure import Figure

ROOT = Path(__file__).parents[2]
COLOURS_KEPT = 128
"""Colours of a picture's palette, which makes its file half as large and leaves colour bars
smooth."""
FIELDS = "output.fields=true"
DRAWN: dict[str, tuple[tuple[str, ...], dict[str, Any]]] = {
    "quickstart": ((FIELDS,), {"at": {"alpha": 200, "theta_bar": 10, "friction": "softening"}}),
    "pull_test": ((), {"y": "friction"}),
    "singular": ((FIELDS, "mesh.levels=8"), {}),
    "welded_rail": ((), {"at": {"theta": 60, "friction": "peaked"}}),
    "pipeline_end": ((), {"at": {"theta": 100}}),
    "slab": ((), {"at": {"theta": "30 K", "friction": "bonded"}}),
    "die": ((), {"at": {"theta": 150, "friction": "brittle"}}),
    "ring": ((FIELDS,), {"at": {"u_T": "8 mm", "friction": "softening"}, "of": "tau_xy"}),
    "peel_arm": ((), {}),
    "split_beam": ((), {}),
    "curled_slab": ((FIELDS,), {"at": {"warmer": "-10 K"}}),
    "warped_die": ((FIELDS,), {"at": {"shear": "2000 GPa/m"}}),
    "pressed_plate": ((FIELDS,), {"at": {"friction.mu": 1}}),
    "lap_force": ((), {"y": "max-slip"}),
    "rail_year": ((), {}),
    "pipeline_cycles": ((), {}),
    "cyclic_pull": ((), {}),
    "pull_fit": ((), {}),
    "thickness_map": ((), {"map": ("H", "grading"), "of": "lambda_1"}),
    "isola": ((), {}),
}
"""What is changed of a study, and what is drawn of it."""
FORMS: dict[str, tuple[Law, float, float, float]] = {
    "welded_rail": ([(0, 2 * 224.25033e3), (2e-3, 224.25033e3)], 210e9 * 0.172, 140.0, 1.2e-5 * 60),
    "pipeline_end": ([(0, 2e3), (0.02, 1e3)], 365.7e6 * 9, 4500.0, 1.17e-5 * 100),
    "slab": ([(0, 35400.0), (1e-3, 7080.0)], 6e9, 60.0, 1e-5 * 30),
    "die": ([(0, 0), (4e-6, 8e6), (4e-6, 2e6)], 84.5e6, 5e-3, 14.4e-6 * 150),
}
"""Law [m, Pa], stiffness [N/m], length [m] and strain of a bar whose slip is known."""

CIRCLE: dict[str, Any] = {"mfc": "none", "mec": style.INK, "ms": 5, "clip_on": False, "zorder": 6}
"""How a point of a closed form looks."""


def circles(
    figure: Figure, law: Law, stiffness: float, length: float, strain: float, largest: float
) -> None:
    """The slip of the closed form on the panel of u_T, whose largest value is known."""
    (curve,) = [line for line in figure.axes[0].lines if len(np.asarray(line.get_xdata())) > 2]
    x, y = (np.asarray(values, dtype=float) for values in curve.get_data())
    places = np.linspace(0.0, length, 13)[1:]
    slip = bar(law, stiffness, length, strain, places)
    figure.axes[0].plot(places * x.max() / length, slip * y.max() / largest, "o", **CIRCLE)


def peel_forces(figure: Figure) -> None:
    """Forces [kN/m] of the beam on its bond over the displacement of its end [mm]."""
    arm = PeeledArm(70e9 * 1.5e-3**3 / 12.0, 20e6, 4e-6, 14e-6)
    forces, ends = np.array([arm.state(crack) for crack in np.arange(31e-3, 43e-3, 1e-3)]).T
    figure.axes[0].plot(1e3 * ends, forces / 1e3, "o", **CIRCLE)


def plate_slips(figure: Figure) -> None:
    """Slips [µm] of the benchmark's programs at places x [mm]; the head of the study has them."""
    (panel,) = [axes for axes in figure.axes if axes.get_ylabel().startswith("$u_{T}$")]
    panel.plot([0.0, 1.25, 5.0, 7.5, 11.25], [28.6, 27.2, 22.8, 19.8, 15.4], "o", **CIRCLE)


def laws() -> Figure:
    """A panel for each law, with ω."""
    names = list(SHAPES)
    rows = [[*names[k : k + 3], ".", "."][:3] for k in range(0, len(names), 3)]
    sheet = Sheet(
        style.Look(),
        "Friction laws",
        ["b(s) = −S_T over the slip s = u_T"],
        rows,
        [1.4] * len(rows),
    )
    for law in example_laws():
        reach, title = slip_range(law) or 1.0, f"{law.name}: ω = {number(law.omega, 3)}"
        if knows_pressure(law):
            title = f"{law.name}: b over the pressure"
        panel = Panel(Scale(""), Scale(""), title)
        draw_law(panel, law, (-reach, reach))
        panel.draw(sheet.panels[law.name])
        sheet.panels[law.name].margins(y=0.12)
    sheet.key()
    return sheet.finish()


PAGES: dict[str, tuple[str, str, str, str]] = {
    "sweep": ("quickstart", "#at=2,5,3&x=theta_bar&y=alpha", "header", "#sweep"),
    "point": ("quickstart", "#at=2,5,3", "#point", "#point"),
    "accuracy": ("quickstart", "#at=2,5,3", "#accuracy", "#accuracy"),
    "live": ("quickstart", "#at=2,5,1&mode=live", "header", "#main"),
    "history": ("cyclic_pull", "#step=3", "header", "#accuracy"),
    "fit": ("pull_fit", "#step=56", "header", "#found"),
}
"""Study, place in its page, first and last element of the picture; a part's own heading stands just
before it."""
FINER = (FIELDS, "output.live=true", "sweep.theta_bar={linspace: [0 K, 20 K, 11]}",
         "sweep.alpha={geomspace: [100 W/(m^2*K), 400 W/(m^2*K), 7]}", "mesh.levels=3")  # fmt: skip
ENDS = """const first = document.querySelector(arguments[0]), last = document.querySelector(arguments[1]);
const head = first.tagName === 'HEADER' ? first : first.previousElementSibling;
return [head.getBoundingClientRect().top + scrollY, last.getBoundingClientRect().bottom + scrollY];"""


def pages(scratch: Path, folder: Path) -> Iterator[Path]:
    """Pictures of the parts of pages."""
    browser = Browser(scratch / "profile")
    browser.size(1100, 900)
    try:
        for name, (study, place, first, last) in PAGES.items():
            file, target = scratch / f"{study}-page.nc", folder / f"page-{name}.png"
            if not file.exists():
                finer = FINER if study == "quickstart" else ()
                tcstudy.run(tcstudy.load(ROOT / "configs" / f"{study}.yaml", finer), file)
            browser.open(tcstudy.report(file), place)
            top, bottom = browser.run(ENDS, first, last)
            browser.picture(target, (0, top - 8, 1100, bottom - top + 20))
            yield smaller(target)
    finally:
        browser.close()


def smaller(target: Path) -> Path:
    with Image.open(target) as picture:
        small = picture.convert("RGB").quantize(COLOURS_KEPT)
    small.save(target, optimize=True)
    return target


def make(name: str, scratch: Path, folder: Path) -> Path:
    """Solve one study and put its picture into the folder."""
    target = folder / ("laws.png" if name == "laws" else f"gallery-{name}.png")
    with style.styled():
        if name == "laws":
            style.save(laws(), target)
        else:
            options, wanted = DRAWN[name]
            result = tcstudy.run(
                tcstudy.load(ROOT / "configs" / f"{name}.yaml", list(options)),
                scratch / f"{name}.nc",
            )
            figure = tcstudy.draw(result, **wanted)
            assert not isinstance(figure, Path)
            if name in FORMS:
                circles(
                    figure,
                    *FORMS[name],
                    float(read_picture(result.file, wanted["at"]).line.u_T.max()),
                )
            if name == "peel_arm":
                peel_forces(figure)
            if name == "pressed_plate":
                plate_slips(figure)
            style.save(figure, target)
    return smaller(target)


def main(words: list[str]) -> None:
    names = (*DRAWN, "laws", "pages")
    parser = argparse.ArgumentParser(prog="python -m tests.benchmarks.gallery")
    parser.add_argument(
        "names", nargs="*", metavar="NAME", help=f"pictures to draw (all): {', '.join(names)}"
    )
    parser.add_argument(
        "--keep", action="store_true", help="draw into results/ and not into a scratch folder"
    )
    asked = parser.parse_args(words)
    if unknown := set(asked.names) - set(names):
        parser.error(f"no picture {', '.join(sorted(unknown))}; there are {', '.join(names)}")
    folder = ROOT / "results" if asked.keep else Path(tempfile.mkdtemp(prefix="gallery-"))
    with tempfile.TemporaryDirectory() as scratch:
        for name in asked.names or names:
            for target in (
                pages(Path(scratch), folder)
                if name == "pages"
                else [make(name, Path(scratch), folder)]
            ):
                print(target)


if __name__ == "__main__":
    main(sys.argv[1:])
