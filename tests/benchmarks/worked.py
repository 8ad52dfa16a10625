"""Rich studies changed at random and worked through: `python -m tests.benchmarks.worked [N] [FIRST]`; 300 studies.

Small studies with materials by region, heat by edge, springs, laws by edge, a sweep over geometries, drawn points,
histories and paths get one or two changes: numbers scaled by powers of ten, words replaced by others of their kind,
sections of another of the studies, and what `mutated` does. What plan accepts is solved, read by two other commands
and asked for again. Nothing may end in a traceback, a warning, or an exit code other than 0, 1 and 2.
"""

from __future__ import annotations

import copy
import random
import shutil
import sys
import tempfile
from collections import Counter
from collections.abc import Callable, Sequence
from pathlib import Path

from ruamel.yaml import YAML

from tests.benchmarks.mutated import Map, places, spoil, tree_of, yaml_of
from tests.commands import CRASHED, tcstudy_command

STUDIES = {
    "run": """
units: none
parameters: {H: 1, G: 1}
body: {rectangle: {width: 2, height: H}, regions: {coat: {rectangle: {corner: [0, 0.5], width: 2, height: 0.5}}}}
boundary:
  bottom: {role: contact, heat: {flux: 0.1}}
  left: {role: symmetry, heat: {theta: 0.5}}
  right: {role: convection, alpha: "2*G", theta_bar: 0.3, force: [0.1, 0], spring: {normal: 0.5}}
  top: {role: traction, pressure: 0.05, heat: {alpha: "3*G", theta_bar: 0.2}}
material: {E: G, nu: 0.3, k: 1, alpha_T: 0.1}
materials: {coat: {E: 3, nu: 0.2, k: 2, alpha_T: 0.05}}
heat: {q: 0.2, omega: coat}
friction: {law: slip-weakening, tau_s: 0.1, tau_k: 0.05, delta: 0.12}
mesh: {maxh: 0.7}
sweep: {mode: zip, parameters.H: [1, 1.2], boundary.left.heat.theta: [0.5, 1]}
output: {fields: true, probes: {tip: [2, 0.7]}, quantities: [reactions, theta_edges, von_mises]}
""",
    "path": """
units: none
body: {outline: [{from: [0, 0], edge: film}, {from: [1, 0], edge: shoe}, {from: [2, 0], edge: right},
                 {from: [2, 1], edge: top}, {from: [0, 1], edge: left}]}
boundary: {film: contact, shoe: contact, right: {role: clamped, u_x: 0.2, u_y: free}, top: free, left: free}
material: {E: 1, nu: 0.3, plane: stress}
friction: {film: {law: saw-tooth, tau: 0.1, delta: 0.05, teeth: 2, drop: 0.5, decay: 0.8},
           shoe: {law: exponential, a: 0.1, b: 0.02, delta: 0.1, strength: "max(0, min(1, 2 - x))"}}
mesh: {maxh: 0.7, family: graded}
path: {parameter: boundary.right.u_x, from: 0, to: 0.5, at: [0.2], hysteresis: true}
""",
    "history": """
units: none
body: {rectangle: {width: 2, height: 0.5}}
boundary: {bottom: contact, right: {role: clamped, u_x: 0, u_y: free}, top: {role: traction, pressure: 0}, left: free}
material: {E: 1, nu: 0.3, alpha_T: 0.1, k: 1}
heat: {theta: 0}
friction: {law: slip-weakening, tau_s: 0.1, tau_k: 0.02, delta: 0.2}
mesh: {maxh: 0.7}
history: {memory: elastic-plastic, stiffness: 10, repeat: 2, branch: continued,
          steps: [{boundary.right.u_x: 0.3, in: 2}, {theta: 0.3, name: hot}]}
sweep: {mode: sobol, points: 2, friction.delta: {uniform: [0.2, 0.4]}}
""",
}
SCALES = (0.0, -1.0, 0.5, 2.0, *(10.0**k for k in (-12, -6, -3, 3, 6, 12)))
WORDS = (
    ("contact", "clamped", "symmetry", "rigid", "traction", "convection", "free"),
    ("tresca", "slip-weakening", "exponential", "saw-tooth", "linear"),
    ("friction", "damage", "elastic-plastic"),
    ("continued", "lowest", "from-zero"),
    ("uniform", "graded", "adaptive", "normal", "log-uniform"),
    ("random", "sobol", "latin-hypercube", "saltelli", "zip", "grid"),
)
READERS = (("show",), ("show", "--json"), ("report", "-o", "p.html"), ("export", "--csv", "-o", "t.csv"))


def changed(rng: random.Random, command: str) -> str:
    """One of the studies with one or two changes."""
    trees = {name: tree_of(YAML(typ="safe", pure=True).load(text)) for name, text in STUDIES.items()}
    tree = trees[command]
    assert isinstance(tree, Map)
    for _ in range(rng.choice((1, 1, 1, 2))):
        numbers = [p for p in places(tree) if isinstance(p[0][p[1]], int | float) and p[0][p[1]] is not True]
        words = [(p, kin) for p in places(tree) for kin in WORDS if p[0][p[1]] in kin]
        match rng.randrange(6):
            case 0 | 1 | 2 if numbers:
                holder, index = rng.choice(numbers)
                holder[index] = float(holder[index]) * rng.choice(SCALES)
            case 3 if words:
                (holder, index), kin = rng.choice(words)
                holder[index] = rng.choice(kin)
            case 4:
                key, section = copy.deepcopy(rng.choice(trees[rng.choice(sorted(trees))]))
                tree[:] = [pair for pair in tree if pair[0] != key] + [[key, section]]
            case _:
                spoil(rng, tree)
    return yaml_of(tree)


def worked(seed: int, folder: Path) -> tuple[str, list[str]]:
    """How a study ended, and what was wrong with how commands ended."""
    rng = random.Random(f"worked {seed}")
    kind = rng.choice(sorted(STUDIES))
    command = kind if kind in ("converge", "cost") else "run"
    study, out = folder / "s.yaml", folder / "out.nc"
    study.write_bytes(changed(rng, kind).encode("utf-8", "surrogatepass"))
    planned = tcstudy_command("run", study, "--dry-run", cwd=folder)
    small = " levels =" not in planned.stdout and "about 0." in planned.stdout  # megabytes: what is quickly solved
    if planned.returncode or not small:
        return ("left out" if not planned.returncode else "refused"), _wrong("dry run", planned)
    first = tcstudy_command(command, study, "--output", out, cwd=folder)
    found = _wrong(command, first)
    if out.exists():
        for name, *how in rng.sample(READERS, 2):
            found += _wrong(name, tcstudy_command(name, out, *how, cwd=folder))
        again = tcstudy_command(command, study, "--output", out, cwd=folder)
        found += _wrong(f"{command} again", again)
        found += [f"exit code {first.returncode}, then {again.returncode}"] * (first.returncode != again.returncode)
    return f"{kind} {first.returncode}", found


def _wrong(name: str, said: tuple[int, str, str]) -> list[str]:
    code, _, err = said
    if code == CRASHED:
        return [f"{name}: {err[-1500:]}"]
    clear = code != 2 or any("; " in line for line in err.splitlines())
    return [] if code in (0, 1, 2) and clear else [f"{name}: exit code {code}: {err[-500:]}"]


def survey(seeds: Sequence[int], say: Callable[[str], None] = print) -> Counter[str]:
    """How the studies of some seeds ended; says what ended badly."""
    counts: Counter[str] = Counter()
    for seed in seeds:
        folder = Path(tempfile.mkdtemp())
        ended, found = worked(seed, folder)
        shutil.rmtree(folder)
        counts.update([ended, *["faults"] * len(found)])
        for fault in found:
            say(f"seed {seed}: {fault}")
    return counts


if __name__ == "__main__":
    number, first = (*map(int, sys.argv[1:]), *(300, 0)[len(sys.argv) - 1 :])
    counted = survey(range(first, first + number))
    print(", ".join(f"{count} {how}" for how, count in sorted(counted.items())))
    sys.exit(bool(counted["faults"]))
