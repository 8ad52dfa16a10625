"""What many points on one body cost: `python -m tests.benchmarks.online [--whole]`.

Body:    the quickstart's at five mesh sizes, m = 11 to 352 contact nodes; loads of 10 α × 25 θ̄
Sweeps:  softening with 10 δ, the quickstart's four laws, and 1,000 random laws of all shapes; 1,000 points each
Now:     tcstudy.contact.block.solve_block in blocks as a study has them, tables of the laws included; CPU time, least
         of two
Whole:   1,000 points from the condensed body to the finished file: loads, solve, certificates, journal, netCDF
`--whole` measures that alone and keeps the other figures.

Writes results/online.md, results/online.nc and results/online.png.
"""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import islice
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TypeVar

import numpy as np
import scipy.linalg
import xarray as xr
from numpy.typing import NDArray

from tcstudy.contact.block import Answer
from tcstudy.contact.problem import CondensedBody
from tcstudy.data.journal import Journal
from tcstudy.data.provenance import collect
from tcstudy.data.store import write
from tcstudy.executors.pool import keep_freed_memory
from tcstudy.laws import shapes
from tcstudy.laws.laws import Laws
from tcstudy.reports.figures.style import INK, WIDTH, save, styled
from tcstudy.scene.study import Study
from tcstudy.study.run import Stage, stages
from tests.benchmarks.panels import inches
from tests.contact.rows import solve_points

T = TypeVar("T")
Array = NDArray[np.float64]
Index = NDArray[np.intp]

SWEEPS = ("softening", "four laws", "1,000 laws")
LEVELS = (0, 1, 2, 4, 5)
RUNS = 2
WHOLE = (0, 2, 4, 5)
DRAWN = {
    "alpha": "[100, 400]",
    "theta_bar": "[0, 20]",
    "friction.tau_s": "[30 MPa, 50 MPa]",
    "friction.tau_k": "[5 MPa, 20 MPa]",
    "friction.delta": "[20 um, 60 um]",
}
"""Ends of what is drawn at random."""
RESULTS = Path(__file__).parents[2] / "results"


@dataclass(frozen=True)
class Sweep:
    """P points on one body: loads (P, m) [N/m], laws, and the law of every point."""

    body: CondensedBody
    loads: Array
    laws: list[Laws]
    law: Index

    def now(self) -> Answer:
        """All points at once."""
        return solve_points(self.body, self.loads, Laws.of(self.laws), self.law)


def bodies(levels: Sequence[int] = LEVELS) -> Iterator[tuple[CondensedBody, Array]]:
    """(body, loads (250, m)) of the quickstart on its meshes."""
    import tcstudy
    from tcstudy.offline.level import Level
    from tcstudy.refine.family import Family

    config = Path(__file__).parents[2] / "configs" / "quickstart.yaml"
    axes = "sweep={alpha: {linspace: [100, 400, 10]}, theta_bar: {linspace: [0, 20, 25]}}"
    study = tcstudy.load(config, ["mesh.maxh=18.5 mm", f"mesh.levels={max(levels) + 1}", axes])
    family = Family(study)
    for i in range(max(levels) + 1):
        mesh = family.next(i)
        if i in levels:
            level = Level(mesh, study.scenes[0], study.scenes)
            problems = [level.condensed(scene).problem for scene in study.scenes]
            yield CondensedBody.of(problems[0].A_tilde, problems[0].c), np.array([p.l_tilde for p in problems])


def laws_of(name: str) -> list[Laws]:
    """The laws of a sweep; tractions and slips about those of the quickstart."""
    if name == "softening":
        return [shapes.slip_weakening(40e6, 10e6, delta) for delta in np.linspace(20e-6, 60e-6, 10)]
    if name == "four laws":
        return [_law(shape, 40e6, 10e6, 40e-6) for shape in range(4)]
    rng = np.random.default_rng(0)
    return [_law(n % 4, rng.uniform(30e6, 50e6), rng.uniform(5e6, 20e6), rng.uniform(2e-5, 6e-5)) for n in range(1000)]


def _law(shape: int, peak: float, rest: float, slip: float) -> Laws:
    if shape == 0:
        return shapes.tresca(peak)
    if shape == 1:
        return shapes.slip_weakening(peak, rest, slip)
    if shape == 2:
        return shapes.exponential(peak, rest, 0.375 * slip)
    return shapes.piecewise_linear(
        [(0.0, peak), (0.25 * slip, peak), (0.25 * slip, rest)], odd=True, slope=None, slopes=None
    )


def sweep(body: CondensedBody, loads: Array, name: str, points: int = 1000) -> Sweep:
    """The points of a sweep: loads and laws in all combinations, as many as asked for."""
    laws, number = laws_of(name), np.arange(points)
    law = number * len(laws) // points
    own = number - np.searchsorted(law, law)
    load = own * len(loads) // np.bincount(law)[law] if points > len(laws) else number % len(loads)
    return Sweep(body, loads[load], laws, law)


def cpu(work: Callable[[], T]) -> tuple[T, float]:
    """What a piece of work returns, and its CPU seconds."""
    since = time.process_time()
    result = work()
    return result, time.process_time() - since


def measure(progress: Callable[[str], None]) -> xr.Dataset:
    """(sweep, m) CPU ms a point, and of one potrf."""
    keep_freed_memory()  # as whoever solves the blocks of a study does
    now, factor = np.full((len(SWEEPS), len(LEVELS)), np.inf), np.full(len(LEVELS), np.inf)
    sizes = np.zeros(len(LEVELS), dtype=np.int64)
    for j, (body, loads) in enumerate(bodies()):
        sizes[j] = body.m
        for i, name in enumerate(SWEEPS):
            points = sweep(body, loads, name)
            for _ in range(RUNS):
                now[i, j] = min(now[i, j], 1e3 * cpu(points.now)[1] / len(points.law))
                factor[j] = min(factor[j], 1e3 * cpu(partial(scipy.linalg.cholesky, body.A_tilde, lower=True))[1])
            progress(f"m = {body.m:3d}  {name:10s}  {now[i, j]:6.3f} ms a point")
    return xr.Dataset(
        {
            "now": (("sweep", "m"), now, {"long_name": "solve and certificates", "units": "ms"}),
            "potrf": (("m",), factor, {"long_name": "one Cholesky factorisation of A_tilde", "units": "ms"}),
        },
        {"sweep": list(SWEEPS), "m": sizes},
        {"load": f"{os.getloadavg()[0]:.0f} on {os.cpu_count()} processors"},
    )


def studies() -> Iterator[Study]:
    """The sweeps as studies of the quickstart's body, 10 α × 10 θ̄ × 10 δ, × its four laws, and 1,000 laws at random."""
    import tcstudy

    config = Path(__file__).parents[2] / "configs" / "quickstart.yaml"
    mesh = ["mesh.maxh=18.5 mm", f"mesh.levels={max(WHOLE) + 1}"]
    softening = "friction={law: slip-weakening, tau_s: 40 MPa, tau_k: 10 MPa}"
    grid = "alpha: {linspace: [100, 400, 10]}, theta_bar: {linspace: [0, 20, %d]}"
    deltas = "friction.delta: {linspace: [20 um, 60 um, 10]}"
    yield tcstudy.load(config, [*mesh, softening, f"sweep={{{grid % 10}, {deltas}}}"])
    yield tcstudy.load(
        config, [*mesh, "sweep.alpha={linspace: [100, 400, 10]}", "sweep.theta_bar={linspace: [0, 20, 25]}"]
    )
    drawn = ", ".join(f"{name}: {{uniform: {ends}}}" for name, ends in DRAWN.items())
    yield tcstudy.load(
        config, [*mesh, "friction={law: slip-weakening}", f"sweep={{mode: random, points: 1000, seed: 7, {drawn}}}"]
    )


def whole(progress: Callable[[str], None]) -> xr.Dataset:
    """(sweep, size) CPU ms a point of a run, once a level is assembled and its body condensed."""
    spent = np.full((len(SWEEPS), len(WHOLE)), np.inf)
    for i, study in enumerate(studies()):
        for j, level in enumerate(WHOLE):
            for _ in range(RUNS):
                stage = next(islice(stages(study), level, None))
                assert stage.level is not None
                stage.level.condensed(study.scenes[0])
                spent[i, j] = min(spent[i, j], 1e3 * cpu(partial(_to_file, study, stage))[1] / len(study.scenes))
            progress(f"{SWEEPS[i]}, m = {stage.level.line.m:3d}  {spent[i, j]:6.3f} ms a point to the file")
    about = {"long_name": "from the condensed body to the finished file", "units": "ms"}
    return xr.Dataset({"whole": (("sweep", "level"), spent, about)}, {"sweep": list(SWEEPS), "level": list(WHOLE)})


def _to_file(study: Study, stage: Stage) -> None:
    """Solve the points of a level and write them as a run does."""
    with TemporaryDirectory() as folder, Journal.open(Path(folder) / "whole.nc", study) as journal:
        assert stage.record is not None
        for record in (stage.record, *stage.blocks):
            journal.add(record)
        journal.flush()
        target, words = Path(folder) / "whole.nc", collect(study, ("tcstudy",))
        write(target, study, journal.levels(), journal.blocks(), words)
        journal.discard()


def lines(data: xr.Dataset) -> Iterator[str]:
    """The report."""
    yield "Made by `python -m tests.benchmarks.online`, with `online.png` and `online.nc`."
    load = data.attrs["load"]
    yield f"CPU ms a point (solve and certificates) of one thread, least of two runs in turns; load {load}."
    yield "1,000 points at once. potrf: one Cholesky factorisation of Ã."
    yield ""
    yield "| sweep | " + " | ".join(f"m = {m}" for m in data["m"].values) + " |"
    yield "|---" * (data.sizes["m"] + 1) + "|"
    for name in data["sweep"].values:
        yield f"| {name} | " + " | ".join(f"{float(x):.2f}" for x in data["now"].sel(sweep=name)) + " |"
    yield "| potrf | " + " | ".join(f"{float(x):.3f}" for x in data["potrf"]) + " |"
    yield ""
    yield "Everything from the condensed body to the finished file (loads, solve, certificates, journal, netCDF);"
    yield "the 1,000 laws of these runs are softening ones whose peak, rest and slip are drawn at random:"
    yield ""
    sizes = data["m"].values[[LEVELS.index(level) for level in data["level"].values]]
    yield "| sweep | " + " | ".join(f"m = {m}" for m in sizes) + " |"
    yield "|---" * (len(sizes) + 1) + "|"
    for name in data["sweep"].values:
        yield f"| {name} | " + " | ".join(f"{float(x):.2f}" for x in data["whole"].sel(sweep=name)) + " |"


def draw(data: xr.Dataset, target: Path) -> None:
    """ms a point over m, and one factorisation."""
    with styled():
        from matplotlib.figure import Figure

        figure = Figure(figsize=(WIDTH, 3.9))
        axes = inches(figure, 0.62, 0.52, WIDTH - 2.45, 3.1)
        m = data["m"].values
        for name, colour, mark in zip(data["sweep"].values, ("#0072b2", "#d55e00", "#009e73"), "osD", strict=True):
            axes.plot(m, data["now"].sel(sweep=name), color=colour, marker=mark, markersize=4, linewidth=1.2)
        axes.plot(m, data["potrf"], color=INK, linewidth=1.0, linestyle=":")
        axes.set(xscale="log", yscale="log", xlabel="contact nodes m", ylabel="CPU time a point [ms]")
        axes.set_xticks(m, [str(x) for x in m])
        axes.minorticks_off()
        axes.set_title("Solve and certificates of 1,000 points at once")
        _names(axes, data)
        save(figure, target)


def _names(axes: object, data: xr.Dataset) -> None:
    """The lines' names at their right ends, moved apart."""
    ends = [(float(data["potrf"][-1]), "one potrf", INK)]
    for name, colour in zip(data["sweep"].values, ("#0072b2", "#d55e00", "#009e73"), strict=True):
        ends.append((float(data["now"].sel(sweep=name)[-1]), str(name), colour))
    places: list[float] = []
    for value, _, _ in sorted(ends):
        places.append(max(value, places[-1] * 1.45) if places else value)
    for place, (value, text, colour) in zip(places, sorted(ends), strict=True):
        right = float(data["m"][-1])
        axes.annotate(  # type: ignore[attr-defined]
            text, (right, value), (right * 1.25, place), fontsize=8, color=colour, va="center", annotation_clip=False
        )


def main(arguments: Sequence[str] | None = None) -> None:
    """Measure and write."""
    words = list(sys.argv[1:] if arguments is None else arguments)

    def progress(line: str) -> None:
        print(line, flush=True)

    known = xr.load_dataset(RESULTS / "online.nc").drop_vars(["whole", "size", "level", "before"], errors="ignore")
    data = (known if "--whole" in words else measure(progress)).merge(whole(progress), combine_attrs="override")
    data.to_netcdf(RESULTS / "online.nc")
    text = "\n".join(lines(data)) + "\n"
    (RESULTS / "online.md").write_text(text, encoding="utf-8")
    draw(data, RESULTS / "online.png")
    print(text, end="")


if __name__ == "__main__":
    main()
