"""Pictures of a page's parts for the README: python -m tests.reports.page.pictures (needs Chromium; half a minute)."""

from __future__ import annotations

import tempfile
from pathlib import Path

from PIL import Image

from tcstudy.cli import main as tcstudy
from tcstudy.read.study import read_study
from tcstudy.reports.page.write import write_page
from tcstudy.study.run import execute
from tests.reports.page.browser import Browser

ROOT = Path(__file__).parents[3]
OPTIONS = ("output.fields=true", "output.live=true", "sweep.theta_bar={linspace: [0 K, 20 K, 11]}",
           "sweep.alpha={geomspace: [100 W/(m^2*K), 400 W/(m^2*K), 7]}", "mesh.levels=3")  # fmt: skip
WIDTH = 1100
PARTS = {"sweep": ("header", "#sweep"), "point": ("#point", "#point"), "accuracy": ("#accuracy", "#accuracy")}
"""First and last element of every picture; a part's own heading stands just before it."""
OTHERS = (("history", "cyclic_pull", "#step=3", "#accuracy"), ("fit", "pull_fit", "#step=56", "#found"))
"""Pages of other files, from the header to the element that is named last."""

BOX = """
const box = (name) => document.querySelector(name).getBoundingClientRect();
const first = document.querySelector(arguments[0]);
const head = first.tagName === 'HEADER' ? first : first.previousElementSibling;
return [head.getBoundingClientRect().top + scrollY, box(arguments[1]).bottom + scrollY];
"""


def main() -> None:
    """Run the quickstart with a finer sweep and write results/page-*.png."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "quickstart.nc"
        execute(read_study(ROOT / "configs" / "quickstart.yaml", OPTIONS), file)
        page = write_page(file, file.with_suffix(".html")).path
        browser = Browser(Path(folder) / "profile")
        try:
            browser.size(WIDTH, 900)
            for name, (first, last) in PARTS.items():
                browser.open(page, "#at=2,5,3&x=theta_bar&y=alpha")
                top, bottom = browser.run(BOX, first, last)
                browser.picture(ROOT / "results" / f"page-{name}.png", (0, top - 8, WIDTH, bottom - top + 20))
            browser.open(page, "#at=2,5,1&mode=live")
            height = browser.run("return document.documentElement.scrollHeight")
            browser.picture(ROOT / "results" / "page-live.png", (0, 0, WIDTH, height - 40))
            for command, study, place, last in OTHERS:
                file = Path(folder) / f"{study}.nc"
                tcstudy(["run", str(ROOT / "configs" / f"{study}.yaml"), "--output", str(file), "-q"])
                browser.open(write_page(file, file.with_suffix(".html")).path, place)
                bottom = browser.run(BOX, "header", last)[1]
                browser.picture(ROOT / "results" / f"page-{command}.png", (0, 0, WIDTH, bottom + 20))
        finally:
            browser.close()
    for picture in (ROOT / "results").glob("page-*.png"):  # a palette makes a third of the size
        with Image.open(picture) as full:
            full.convert("RGB").quantize(255).save(picture, optimize=True)


if __name__ == "__main__":
    main()
