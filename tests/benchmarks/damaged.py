"""Damaged result files and journals through the commands: each is refused or set aside in one line, or read.

    python -m tests.benchmarks.damaged [--cases 500] [--seed 1]

Files are flipped, cut, emptied in parts, edited (attributes and values changed, variables renamed) or replaced by a
stranger's; journals are flipped, cut, and their rows edited with checksums that fit.
"""

from __future__ import annotations

import argparse
import contextlib
import os
import random
import shutil
import sqlite3
import sys
import tempfile
from collections import Counter
from collections.abc import Callable
from pathlib import Path

import netCDF4
import numpy as np

from tcstudy.data.journal import Journal
from tcstudy.data.reading import Seal, seal_of
from tcstudy.data.records import checksum
from tcstudy.read.study import read_study
from tcstudy.study.run import run
from tests.commands import tcstudy_command

STUDY = """units: none
body: {rectangle: {width: 2, height: 1}}
boundary: {bottom: contact, left: clamped, right: free, top: {role: traction, g: [0.1, 0]}}
material: {E: 1, nu: 0.3}
friction: {law: slip-weakening, tau_s: 0.1, tau_k: 0.05, delta: 0.12}
mesh: {maxh: 1, levels: 2}
sweep: {delta: [1.2, 0.12]}
"""
ODD = ("", "x", "\x1b[31mRED\x1b]0;owned\x07", 5, np.nan, np.array([1, 2, 3]), "{", "a b c", "y" * 10_000, "\u202e")
PATH = "path={parameter: load, from: 0, to: 1, at: [0.5]}"
STEPS = "history={memory: friction, steps: [{load: 3, in: 2}, {load: 0.5}]}"
FIT = (
    "fit={data: {file: pull.csv, columns: {boundary.top.g_x: g, u_T_max: u}}, "
    "parameters: {E: {start: 1, within: [0.1, 9]}}}"
)
FILES = {
    "run.nc": ("run",),
    "path.nc": ("run", PATH),
    "convergence.nc": ("converge",),
    "cost.nc": ("cost", "mesh.levels=1"),
    "history.nc": ("run", STEPS),
    "fit.nc": ("run", FIT, "sweep=null"),
    "geometries.nc": ("run", "sweep={mesh.maxh: [1, 0.8], delta: [1.2, 0.12]}", "output={fields: true}"),
    "drawn.nc": ("run", "sweep={mode: saltelli, points: 4, E: {uniform: [1, 2]}, delta: {uniform: [1, 2]}}"),
}
"""Files, the commands that make them, and how the study is changed for that."""
READERS = (
    *(("show", "FILE", *how) for how in ((), ("-q",), ("--json",), ("-v",))),
    *(("export", "FILE", how, "-o", "out") for how in ("--csv", "--json", "--vtu")),
    ("export", "FILE", "--geometry", "--at", "maxh=1", "-o", "one.nc"),
    ("report", "FILE", "-o", "page.html"),
)
"""Commands that read a damaged FILE."""


def make_bases(folder: Path) -> None:
    """A sound file of each command, the journal of a run that was killed, and their study."""
    study = folder / "study.yaml"
    study.write_text(STUDY)
    (folder / "pull.csv").write_text("g,u\n" + "".join(f"{0.02 * i:g},{0.05 * i**2:g}\n" for i in range(1, 6)))
    for name in FILES:
        code, _, errors = tcstudy_command(*words_of(name, study, folder / name))
        assert code == 0, errors
    with Journal.open(folder / "journal.nc", read_study(study)) as journal:
        for record in run(read_study(study)):
            journal.add(record)


def words_of(name: str, study: Path, output: Path) -> list[str]:
    """The command that makes a file."""
    command, *changes = FILES[name]
    return [command, str(study), "--output", str(output), *(f"--set={change}" for change in changes)]


def flip(file: Path, draw: random.Random) -> None:
    raw = bytearray(file.read_bytes())
    for _ in range(draw.choice((1, 1, 4, 64))):
        raw[draw.randrange(len(raw))] ^= 1 << draw.randrange(8)
    file.write_bytes(raw)


def flip_unsealed(file: Path, draw: random.Random) -> None:
    """As `flip`, of a file of an earlier version, which has no seal: only a child may open it."""
    file.write_bytes(file.read_bytes()[:-200])
    with contextlib.suppress(OSError), netCDF4.Dataset(file):
        pass
    flip(file, draw)


def zero(file: Path, draw: random.Random) -> None:
    raw = bytearray(file.read_bytes())
    start = draw.randrange(len(raw))
    raw[start : start + 512] = bytes(len(raw[start : start + 512]))
    file.write_bytes(raw)


def cut(file: Path, draw: random.Random) -> None:
    raw = file.read_bytes()
    file.write_bytes(raw[: draw.randrange(len(raw))])


def foreign(file: Path, draw: random.Random) -> None:
    file.unlink()
    with netCDF4.Dataset(file, "w") as nc:
        nc.setncatts({"source": draw.choice(("tcstudy 0.1.0", "an instrument")), "finished": np.int32(1)})
        nc.setncattr("content", draw.choice(("path", "cost", "run", 5)))


def edit_attribute(file: Path, draw: random.Random) -> None:
    with netCDF4.Dataset(file, "a") as nc:
        holder = draw.choice([nc, nc, *nc.variables.values()])
        names = [name for name in holder.ncattrs() if name != "_FillValue"]
        if names and draw.random() < 0.3:
            holder.delncattr(draw.choice(names))
        elif names:
            holder.setncattr(draw.choice(names), draw.choice(ODD))


def edit_value(file: Path, draw: random.Random) -> None:
    with netCDF4.Dataset(file, "a") as nc:
        group = draw.choice([nc, *nc.groups.values()])
        found = [v for v in group.variables.values() if v.size]
        variable = draw.choice(found)
        if variable.dtype is str:
            variable[...] = np.full(variable.shape, draw.choice(("", "\x1b[31mR", "a b", "\n\n")), dtype=object)
        else:
            odd = [0, 1, -1, 99, 127] + ([np.nan, np.inf, 1e300] if variable.dtype.kind == "f" else [])
            variable[...] = np.full(variable.shape, draw.choice(odd), dtype=variable.dtype)


def rename(file: Path, draw: random.Random) -> None:
    with netCDF4.Dataset(file, "a") as nc:
        if draw.random() < 0.3:
            name = draw.choice(list(nc.dimensions))
            nc.renameDimension(name, f"zz_{name}")
        else:
            name = draw.choice(list(nc.variables))
            nc.renameVariable(name, f"zz_{name}")


def reshape(file: Path, draw: random.Random) -> None:
    """A variable goes, or comes back with another type, other dimensions or none of its values."""
    with netCDF4.Dataset(file, "a") as nc:
        group = draw.choice([nc, nc, *nc.groups.values()])
        name = draw.choice(list(group.variables))
        group.renameVariable(name, f"zz_{name}")
        kind, dims = draw.choice(("f8", "i4", "S1")), draw.choice(((), *((dim,) for dim in nc.dimensions)))
        if draw.random() < 0.7:
            group.createVariable(name, kind, dims)


def edit_row(file: Path, draw: random.Random) -> None:
    """Another content of one record or of the header, with the checksum that belongs to it."""
    with contextlib.closing(sqlite3.connect(file)) as database:
        if draw.random() < 0.2:
            database.execute("UPDATE header SET value = ?", (draw.choice((b"\xff\xfe", "", 5)),))
        else:
            names = ("kind", "place", "level", "scalars", "layout", "arrays")
            rows = database.execute(f"SELECT rowid, {', '.join(names)} FROM record").fetchall()
            number, *row = draw.choice(rows)
            at = draw.randrange(len(names))
            row[at] = draw.choice(("{}", "[]", "null", b"\xff\xfe", -7, "9,9", '[["u_T", "<f8", [99]]]', 1.5))
            with contextlib.suppress(TypeError):
                row.append(checksum((*row, 0)))  # type: ignore[arg-type]
            values = ", ".join(f"{name} = ?" for name in (*names, "crc")[: len(row)])
            with contextlib.suppress(sqlite3.IntegrityError):
                database.execute(f"UPDATE record SET {values} WHERE rowid = ?", (*row, number))
        database.commit()


def _is_whole(file: Path) -> bool:
    return file.suffix != ".nc" or not file.exists() or seal_of(file) == Seal.WHOLE


Damage = Callable[[Path, random.Random], None]
WAYS: tuple[Damage, ...] = (flip, flip, zero, cut, foreign, edit_attribute, edit_value, edit_value, rename, reshape)
CHILD_WAYS: tuple[Damage, ...] = (*WAYS, flip_unsealed)
JOURNAL_WAYS: tuple[Damage, ...] = (flip, zero, cut, edit_row, edit_row)


def try_one(bases: Path, work: Path, draw: random.Random, ways: tuple[Damage, ...], drawn: float = 0.2) -> list[str]:
    """One damaged file through one command; what was wrong, in words, empty if nothing."""
    study = bases / "study.yaml"
    if draw.random() < 0.25:
        file, way = work / "journal.nc.partial", draw.choice(JOURNAL_WAYS)
        shutil.copy(bases / "journal.nc.partial", file)
        words, allowed = ["run", str(study), "--output", str(work / "journal.nc")], (0, 1)
    else:
        name = draw.choice(sorted(FILES))
        file, way = work / name, draw.choice(ways)
        shutil.copy(bases / name, file)
        kind, allowed = draw.random(), (0, 2)
        if kind < drawn:
            words = ["draw", str(file), str(work / "picture.png")]
        elif kind < 0.8:
            named = {"FILE": str(file)}
            chosen = draw.choice(READERS)
            words = [named.get(w, str(work / w) if chosen[i - 1] == "-o" else w) for i, w in enumerate(chosen)]
        else:
            words = words_of(name, study, file)
    with contextlib.suppress(OSError, RuntimeError, AttributeError):  # the library refuses some edits
        way(file, draw)
    code, out, err = tcstudy_command(*words)
    faults = []
    if code not in allowed:
        faults.append(f"exit code {code}: {err[-1500:]}")
    err = "".join(line for line in err.splitlines(keepends=True) if not line.endswith("--force computes them again\n"))
    changed = "was changed" in err
    err = "".join(line for line in err.splitlines(keepends=True) if not line.startswith("warning: "))
    if code in (0, 1) and not changed and words[0] != "run" and not _is_whole(file) and str(file) in words:
        faults.append("a changed file was read without a word")
    if code == 2 and err.count("\n") != 1:
        faults.append(f"{err.count(chr(10))} lines of error: {err[:500]}")
    if any(c in out + err for c in "\x1b\x07\u202e"):
        faults.append("control characters")
    for left in work.iterdir():
        shutil.rmtree(left) if left.is_dir() else left.unlink()
    said = " ".join(Path(word).name for word in words)
    return [f"{way.__name__}, tcstudy {said}: {fault}" for fault in faults]


def measure(cases: int, seed: int, ways: tuple[Damage, ...], drawn: float = 0.2) -> Counter[str]:
    """Faults by their text after so many damaged files."""
    found: Counter[str] = Counter()
    with tempfile.TemporaryDirectory() as folder:
        bases, work = Path(folder) / "bases", Path(folder) / "work"
        bases.mkdir()
        work.mkdir()
        make_bases(bases)
        for i in range(cases):
            found.update(try_one(bases, work, random.Random(f"{seed}-{i}"), ways, drawn))
    return found


if __name__ == "__main__":
    os.environ.setdefault("MPLBACKEND", "Agg")
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--cases", type=int, default=500)
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    faults = measure(options.cases, options.seed, CHILD_WAYS)
    for text, count in faults.most_common():
        print(f"{count} × {text}\n")
    print(f"{options.cases} damaged files, {sum(faults.values())} faults")
    sys.exit(1 if faults else 0)
