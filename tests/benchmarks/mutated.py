"""Studies spoilt at random, all of which must be planned or refused: `python -m
tests.benchmarks.mutated [N] [FIRST]`.

N studies (3,000 unless given) are made from the shipped ones and from one that uses every kind of
key: keys renamed, dropped, given twice, values replaced by other types, units, huge numbers, NaN,
texts with control characters, sections moved, lines and characters of the text lost. A dry run is
to exit with 0, or with 2 and one clear line for each fault: without a traceback, a warning or a
control character. What does not is printed with its seed.
"""

import faulthandler
import json
import random
import re
import sys
import tempfile
import time
import unicodedata
from collections import Counter
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from netgen import occ
from ruamel.yaml import YAML

from tests.commands import CRASHED, tcstudy_command

PROBLEMS = 3_000
LONGEST_LINE = 600
HANGS = 120.0
"""Seconds after which the process ends with the place where it hangs."""
CONFIGS = Path(__file__).parents[2] / "configs"

EVERY_KEY = """\
title: Every kind of key
body:
  outline:
    - {from: [0, 0], edge: bottom}
    - {from: [2, 0], edge: right, through: [2.1, 0.5]}
    - {from: [2, 1], edge: top}
    - {from: [0, 1], edge: left}
  holes:
    - {circle: {center: [0.5, 0.5], radius: 0.1, edge: bore}}
    - {rectangle: {corner: [1.5, 0.6], width: 0.1, height: 0.2, edge: slot}}
  regions: {hot: {polygon: [[1, 0.3], [1.3, 0.3], [1.2, 0.6]]}}
boundary:
  bottom: contact
  right: {role: convection, g: [0, "1 MPa"]}
  top: {role: traction, pressure: "1e5*(1 + sin(pi*x))"}
  left: {role: clamped, u_x: 0, u_y: free}
  bore: free
  slot: {role: clamped, u: [0, 0]}
material: {E: 210 GPa, nu: 0.3, k: 45 W/(m*K), alpha_T: 12e-6 1/K, plane: stress}
loads: {f: [0, -77 kN/m^3]}
heat: {alpha: 100 W/(m^2*K), theta_bar: "20*(1 + x)", q: 5e6, omega: hot}
friction: {law: saw-tooth, tau: 20 MPa, delta: 40 um, teeth: 3, drop: 0.5, decay: 0.8}
mesh: {maxh: 0.4, tolerance: 0.05, of: {u_T: [1, 0]}}
solver: {name: [separable-newton, bundle-newton], tolerance: 1e-9, max_iterations: 500, branch: continued}
sweep:
  mode: list
  points: [{alpha: 25, q: 1e6}, {alpha: 100, q: 2e6}]
output: {path: out.nc, fields: true}
"""
FROM_A_FILE = """\
units: none
body:
  file: {path: plate.step, unit: mm, face: 0, edges: {bottom: [[0.01, 0]]}, other: sides}
boundary: {bottom: contact, sides: {role: clamped, u_x: 0.1}}
material: {E: 1, nu: 0.3}
friction: {law: piecewise-linear, points: [[-1, -0.1], [0, 0], [0, 0.1], [1, 0.05]], odd: false, slopes: [0, 0]}
mesh: {maxh: [0.004, 0.002]}
sweep: {mode: zip, boundary.sides.u_x: [0.1, 0.2], E: {geomspace: [1, 2, 2]}}
output: {path: out.nc, live: true}
path: {parameter: boundary.sides.u_x, from: 0, to: 2, at: [1, 1.5], start: lowest, within: [-1, 3], hysteresis: false,
       level: 0, max_pieces: 100, law_error: 1e-3}
"""
"""A body from a file, which stands beside the study."""
DERIVED = """\
units: none
body: {rectangle: {width: 1, height: 1}}
boundary: {bottom: contact, right: convection, top: clamped, left: convection}
material: {lambda: 1.5, mu: 1, beta: 0.5, k: 2}
heat: {alpha: 3}
friction: {law: slip-weakening, tau_s: 1, tau_k: 0.4, delta: 1}
mesh: {maxh: 0.25, levels: 2}
exact:
  u: ["y + (1 - 0.6*y)*(0.3 + 0.2*sin(pi*x))", "0.1*y*cos(pi*x)"]
  theta: "1 + x*(1 + 0.5*cos(pi*y))"
  loads: derived
output: {live: true, fields: true}
"""
"""Exact loads, and what a page computes itself."""
OPENING = """\
body: {rectangle: {width: 60 mm, height: 20 mm}}
boundary:
  bottom: contact
  right: {role: contact, normal: held}
  left: clamped
  top: {role: traction, g: [0, 1 MPa]}
material: {E: 70 GPa, nu: 0.2}
friction: {right: {law: tresca, tau: 2 MPa}}
adhesion:
  bottom: {law: trapezoidal, sigma: 3 MPa, s0: 2 um, s1: 5 um, G_f: 30 J/m^2, closing: 200 GPa/m, strength: "1 + x"}
mesh: {maxh: 5 mm}
sweep: {adhesion.bottom.closing: [rigid, 300 GPa/m], adhesion.bottom.sigma: {linspace: [2 MPa, 3 MPa, 2]}}
"""
"""An edge that opens beside one that is held."""

TEXTS = (
    "", " ", "x", "free", "derived", "contact", "clamped", "null", "~", "5", "5 kg", "5 mm", "-3 GPa", "1,5",
    "1e400", "nan", "sin(x)", "1/0", "x/0", "log(-x)", "x^x^x^x", "((((", "__import__('os')", "x.y", "2*", "exp(1e9*x)",
    "-" * 99, "ü", "θ̄", "\u202eabc", "\x00", "a\x00b", "\x1b[31mred", "\x85", "\u2028", "\ud7ff", "\U0001f600", "[",
    "{", "*a", "&a", "!!python/object:os.system", "../../x", "/", ".", "a" * 5000,
    "x+" * 3000 + "x", "(" * 400 + "x" + ")" * 400,
)  # fmt: skip
NUMBERS = (
    0,
    -1,
    1,
    2,
    3.7,
    1e-320,
    1e-200,
    1e-12,
    1e12,
    1e154,
    1e200,
    1e308,
    -1e308,
    10**400,
    -(10**30),
    0.5,
    -0.0,
)
RAW = (".nan", ".inf", "-.inf", "null", "true", "off", "0x1f", "0b2", "1_000", "1e", "2020-01-01", "[]", "{}", "[[]]",
       "[[[]]]", "{a: {a: {}}}", "[1, [2, [3]]]", "{1: 2}", "? [a]", "!!int x", "!!binary aGk=", "<<", "|", "&a [*a]",
       "[" * 30 + "]" * 30, "[" * 3000 + "]" * 3000, "{linspace: [0, 1, 0]}", "{linspace: [0, 1, 1e9]}",
       "{geomspace: [-1, 1, 3]}", "{linspace: [1e308, -1e308, 3]}", "{law: tresca, tau: 1}",
       "[free, free]")  # fmt: skip
KEYS = (
    "",
    " ",
    "x",
    "E",
    "nu",
    "law",
    "tau",
    "role",
    "u",
    "u_x",
    "g",
    "theta",
    "q",
    "omega",
    "sweep",
    "exact",
    "loads",
    "path",
    "units",
    "edges",
    "file",
    "outline",
    "h",
    "mode",
    "points",
    "of",
    "goal",
    "a.b",
    "[0]",
    "ü",
    "\x1b[1m",
    "\x00",
    "null",
    "true",
    "1",
    "<<",
    "a" * 3000,
    "\u202e",
    "a\nb",
)
ODD = (
    "\t",
    "\x07",
    "\x1b[2J",
    "\ufeff",
    "\u202e",
    ":",
    "- ",
    "#",
    "{",
    "]",
    '"',
    "'",
    "%",
    "---\n",
    "\r",
)
"""What is put into a text."""
RAW_MARK = "\ue000"
"""On both sides of what is written as it is."""


def yaml_of(tree: dict[str, Any]) -> str:
    """YAML text of a tree, in flow style; every section on a line of its own."""
    text = "\n".join(
        f"{json.dumps(key)}: {json.dumps(value, ensure_ascii=False)}" for key, value in tree.items()
    )
    return re.sub(f'"{RAW_MARK}(.*?){RAW_MARK}"', lambda found: found[1], text) + "\n"


def places(tree: Any) -> list[tuple[Any, Any]]:
    """(holder, key or index) of every value in a tree."""
    keys = (
        list(tree) if isinstance(tree, dict) else range(len(tree)) if isinstance(tree, list) else ()
    )
    return [place for key in keys for place in ((tree, key), *places(tree[key]))]


def hostile(rng: random.Random) -> Any:
    raw = RAW_MARK + rng.choice(RAW) + RAW_MARK
    return rng.choice((rng.choice(TEXTS), rng.choice(NUMBERS), raw, rng.choice(NUMBERS)))


def spoil(rng: random.Random, tree: dict[str, Any]) -> None:
    """One mutation of the tree, in place."""
    holder, key = rng.choice(places(tree) or [({"x": 1}, "x")])
    maps = [tree, *(one[at] for one, at in places(tree) if isinstance(one[at], dict) and one[at])]
    some = rng.choice(maps)
    name = rng.choice(list(some) or ["x"])
    match rng.randrange(8):
        case 0 | 1 | 2 | 3:
            holder[key] = hostile(rng)
        case 4:
            some[rng.choice(KEYS) if rng.random() < 0.5 else name[:-1] + rng.choice("aexy_")] = (
                some.pop(name, 1)
            )
        case 5:
            some.pop(name, None)
        case 6:  # moved to another place
            rng.choice(maps)[name] = some.pop(name, 1)
        case 7:
            holder[key] = [holder[key]] if rng.random() < 0.5 else {rng.choice(KEYS): holder[key]}


def garble(rng: random.Random, text: str) -> str:
    """One mutation of the text."""
    lines = text.split("\n")
    i, at = rng.randrange(len(lines)), rng.randrange(max(1, len(text)))
    odd = rng.choice(ODD)
    match rng.randrange(6):
        case 0:
            return text[:at] + odd + text[at:]
        case 1:
            return text[:at] + text[at + rng.randrange(1, 9) :]
        case 2:
            return text[:at]
        case 3:
            return "\n".join([*lines[:i], lines[i], lines[i], *lines[i + 1 :]])
        case 4:
            return "\n".join([*lines[:i], *lines[i + 1 :]])
        case _:
            return "\n".join(
                [*lines[:i], " " * rng.randrange(5) + lines[i].lstrip(), *lines[i + 1 :]]
            )


def mutated(seed: int, texts: Sequence[str]) -> str:
    """A study with one to three faults (a few have none that matters)."""
    rng = random.Random(seed)
    text = rng.choice(texts)
    if rng.random() < 0.25:
        return garble(rng, text)
    tree = YAML(typ="safe", pure=True).load(text)
    for _ in range(rng.choice((1, 1, 1, 2, 3))):
        spoil(rng, tree)
    return yaml_of(tree)


def sources() -> list[str]:
    """The studies that are spoilt; one draws fewer points than it ships with, each of which takes
    its time to read."""
    shipped = [path.read_text(encoding="utf-8") for path in sorted(CONFIGS.glob("*.yaml"))]
    return [
        EVERY_KEY,
        FROM_A_FILE,
        DERIVED,
        OPENING,
        *(text.replace("points: 64 ", "points: 4 ") for text in shipped),
    ]


def complaint(text: str, folder: Path) -> tuple[int, str]:
    """Exit code of a dry run on a text, and what is wrong with how it ended; "" if nothing is."""
    file = folder / "s.yaml"
    file.write_bytes(text.encode("utf-8", "surrogatepass"))
    code, shown, said = tcstudy_command("run", file, "--dry-run", "--output", folder / "out.nc")
    if code not in (0, 2):
        return -1, said if code == CRASHED else f"exit code {code}"
    lines = said.rstrip("\n").split("\n")
    if code == 2 and (
        not said.strip() or not all(line.startswith(str(file)) and "; " in line for line in lines)
    ):
        return 2, f"no clear line: {said!r}"
    if any(len(line) > LONGEST_LINE for line in lines):
        return 2, f"a line of {max(map(len, lines))} characters"
    raw = [
        c
        for c in shown + said
        if c != "\n" and unicodedata.category(c) in ("Cc", "Cf", "Cs", "Zl", "Zp")
    ]
    return code, f"raw control characters {raw}: {said!r}" if raw else ""


def survey(seeds: Sequence[int], say: Callable[[str], None] = print) -> Counter[str]:
    """How the studies of some seeds ended; says what ended badly."""
    counts, texts, slowest = Counter[str](), sources(), (0.0, -1)
    with tempfile.TemporaryDirectory() as folder:
        occ.WorkPlane().Rectangle(20, 10).Face().WriteStep(str(Path(folder) / "plate.step"))
        for seed in seeds:
            start = time.perf_counter()
            faulthandler.dump_traceback_later(HANGS, exit=True)
            code, why = complaint(mutated(seed, texts), Path(folder))
            faulthandler.cancel_dump_traceback_later()
            slowest = max(slowest, (time.perf_counter() - start, seed))
            counts["badly ended" if why else {0: "planned", 2: "refused"}[code]] += 1
            if why:
                say(f"seed {seed}: {why}")
    say(f"slowest: seed {slowest[1]}, {slowest[0]:.1f} s")
    return counts


def main(arguments: Sequence[str]) -> None:
    number, first = (*map(int, arguments), *(PROBLEMS, 0)[len(arguments) :])
    counts = survey(range(first, first + number))
    print(", ".join(f"{count} {how}" for how, count in sorted(counts.items())))
    sys.exit(bool(counts["badly ended"]))


if __name__ == "__main__":
    main(sys.argv[1:])
