"""What small commands cost: `python -m tests.benchmarks.startup [PYTHON]` writes its part of
results/speed.md in two minutes.

Study:   the quickstart, whole and as one point on its coarsest mesh
Figures: CPU time of whole commands, as processes of their own with one thread: imports and all
PYTHON:  the interpreter of another checkout, whose commands are run in turn with those of this one
"""

import sys
from collections.abc import Iterator
from pathlib import Path
from statistics import median, quantiles
from tempfile import TemporaryDirectory

from tests.benchmarks.cases import publish_chapter
from tests.benchmarks.geometries import CONFIG, cost_of
from tests.benchmarks.peers import machine

RUNS = 3
COMMANDS = {
    "quickstart, 144 solutions, with its table": ("run", "STUDY", "-o", "FILE", "--force"),
    "its dry run": ("run", "STUDY", "-o", "FILE.other", "--dry-run"),
    "the finished study again": ("run", "STUDY", "-o", "FILE"),
    "`show`": ("show", "FILE"),
    "`show -q`": ("show", "FILE", "-q"),
    "one point": (
        *("run", "STUDY", "-o", "FILE.one", "--force"),
        *("--set", "sweep={}", "--set", "mesh.levels=1"),
    ),
}
"""Commands by their names in the table; each but the first finds the file of the first."""


def seconds_of(python: str, folder: Path) -> dict[str, float]:
    """Return the CPU time [s] of each command, once, in a folder of this interpreter."""
    names = {"STUDY": str(CONFIG)}
    seconds = dict[str, float]()
    for title, words in COMMANDS.items():
        filled = [names.get(word, word.replace("FILE", str(folder / "run.nc"))) for word in words]
        seconds[title] = cost_of(filled, python).seconds
    return seconds


def words_of(seconds: list[float]) -> str:
    """Return the median of times with their quartiles."""
    lower, _, upper = quantiles(seconds, n=4)
    return f"{median(seconds):.2f} [{lower:.2f}, {upper:.2f}]"


def lines(pythons: list[str]) -> Iterator[str]:
    """Yield the table of this interpreter, and of another one beside it."""
    times = [{title: list[float]() for title in COMMANDS} for _ in pythons]
    with TemporaryDirectory() as folder:
        for run in range(RUNS + 1):
            for i, python in enumerate(pythons):
                own = Path(folder) / str(i)
                own.mkdir(exist_ok=True)
                for title, seconds in seconds_of(python, own).items():
                    if run:  # the first one compiles modules
                        times[i][title].append(seconds)
    yield "CPU times [s] of whole processes with one thread, median [quartiles]."
    yield f"Measured with {machine()}."
    yield ""
    yield "| command | CPU time |" + " before | ratio |" * (len(pythons) > 1)
    yield "|---|--:|" + "--:|--:|" * (len(pythons) > 1)
    for title, seconds in times[0].items():
        row = f"| {title} | {words_of(seconds)} |"
        for earlier in times[1:]:
            ratio = median(seconds) / median(earlier[title])
            row += f" {words_of(earlier[title])} | {ratio:.2f} |"
        yield row
    whole, dry = (median(times[0][title]) for title in (*COMMANDS,)[:2])
    yield ""
    yield f"The dry run takes {dry / whole:.2f} × the run."


def main(pythons: list[str]) -> None:
    """Write the chapter."""
    words = " PYTHON" * (len(pythons) > 0)
    table = lines([sys.executable, *pythons])
    publish_chapter("speed", "The first second", f"startup{words}", table)


if __name__ == "__main__":
    main(sys.argv[1:])
