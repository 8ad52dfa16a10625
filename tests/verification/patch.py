"""The multivalued patch test: uniform shear of a block on a frictional base, exact in P1 on every
mesh.

Domain:   (0, L) × (0, H), turned by an angle
Boundary: top u = (U, 0), sides rolling (no displacement along them in y, no traction in x), base in contact
Solution: u_x = s + (U − s) y/H, u_y = 0 with G (U − s)/H ∈ b̂(s): one, two or three values of s
Energy:   L [G (U − s)²/(2H) + j(s)]
"""

from dataclasses import dataclass

import numpy as np

from tcstudy.read.study import read_study_text
from tcstudy.scene.study import Study

LENGTH, HEIGHT, SHEAR = 1.3, 1.0, 1.0

SOFTENING = "{law: slip-weakening, tau_s: 1, tau_k: 0.2, delta: 0.4}"
DROPPING = "{law: piecewise-linear, points: [[0, 1], [0.4, 1], [0.4, 0.2]]}"


@dataclass(frozen=True)
class Case:
    """A law, a top displacement U, and all slips s that solve the problem in closed form."""

    law: str
    U: float
    slips: tuple[float, ...]


CASES = (
    Case(SOFTENING, 0.5, (0.0,)),
    Case(SOFTENING, 0.6, (0.0, 0.4)),
    Case(SOFTENING, 0.8, (0.0, 0.2, 0.6)),
    Case(SOFTENING, 1.2, (1.0,)),
    Case(DROPPING, 0.5, (0.0,)),
    Case(DROPPING, 0.6, (0.0, 0.4)),
    Case(DROPPING, 0.8, (0.0, 0.4, 0.6)),
    Case(DROPPING, 1.7, (1.5,)),
)


def patch_study(case: Case, maxh: float, degrees: float = 0.0) -> Study:
    """The patch test as a study; U is a displacement in the turned frame."""
    turn = np.radians(degrees)
    c, s = np.cos(turn), np.sin(turn)
    corners = [(0.0, 0.0), (LENGTH, 0.0), (LENGTH, HEIGHT), (0.0, HEIGHT)]
    edges = ["base", "right", "top", "left"]
    outline = ", ".join(
        f"{{from: [{c * x - s * y!r}, {s * x + c * y!r}], edge: {edge}}}".replace("np.float64", "")
        for (x, y), edge in zip(corners, edges, strict=True)
    )
    return read_study_text(f"""
units: none
body: {{outline: [{outline}]}}
boundary:
  base: contact
  top: {{role: clamped, u: [{float(c * case.U)!r}, {float(s * case.U)!r}]}}
  left: {{role: clamped, u_T: 0}}
  right: {{role: clamped, u_T: 0}}
material: {{lambda: 1.7, mu: {SHEAR}}}
friction: {case.law}
mesh: {{maxh: {maxh}}}
""")


def exact_energy(case: Case, study: Study, slip: float) -> float:
    return LENGTH * (
        SHEAR * (case.U - slip) ** 2 / (2 * HEIGHT)
        + float(study.scenes[0].friction.j(np.array(slip)))
    )
