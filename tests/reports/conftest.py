"""Result files that the tests of reports share, each of one small run, and the browser in which
pages are opened."""

import shutil
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path

import netCDF4
import numpy as np
import pytest

import tcstudy
from tcstudy.data.files import put_seal
from tcstudy.data.schema import PointStatus
from tcstudy.read.study import read_study, read_study_text
from tests.reports.page.browser import Browser

CONFIGS = Path(__file__).parents[2] / "configs"
BLOCK = """
title: A block <on> a film for $5 and $6
body: {outline: [{from: [0, 0], edge: film}, {from: [0.2, 0], edge: end}, {from: [0.2, 0.1], edge: top},
                 {from: [0, 0.1], edge: back}]}
boundary: {film: contact, back: clamped, top: convection, end: {role: traction, g: [3 MPa, 0]}}
material: {E: 210 GPa, nu: 0.3, k: 45, alpha_T: 12e-6}
heat: {alpha: 200, theta_bar: 10 K, q: 5e4}
friction: {law: slip-weakening, tau_s: 90 MPa, tau_k: 60 MPa, delta: 40 um}
mesh: {maxh: 40 mm, levels: 2}
sweep:
  theta_bar: [20 K, 0 K, 10 K]
  friction:
    plain: {law: tresca, tau: 90 MPa}
    weak: {law: slip-weakening, tau_s: 90 MPa, tau_k: 60 MPa, delta: 40 um}
output: {fields: true, live: true}
"""
REASON = "the stiffness matrix is singular"
LISTED = "sweep={mode: zip, heat.alpha: [25, 100, 25], friction.tau_s: [90 MPa, 90 MPa, 95 MPa]}"
FILMS = """
units: none
title: Two films, one of them rougher to the right, with a gap
body: {outline: [{from: [0, 0], edge: film}, {from: [1, 0], edge: shoe}, {from: [2, 0], edge: grip},
                 {from: [2, 0.2], edge: top}, {from: [0, 0.2], edge: tail}]}
boundary: {film: contact, shoe: contact, grip: {role: clamped, u_x: 0.4, u_y: free}, top: free, tail: free}
material: {E: 10, nu: 0, plane: stress}
friction: {film: {law: tresca, tau: 2, strength: "min(1, max(0, 2*x - 0.5))"},
           shoe: {law: slip-weakening, tau_s: 1, tau_k: 0.5, delta: 0.1}}
mesh: {maxh: 0.1}
output: {quantities: [section_force]}
"""
PADS = """
title: Pads of several thicknesses
body: {rectangle: {width: 60 mm, height: 10 mm}}
boundary: {bottom: contact, top: {role: clamped, u_x: 2 mm, u_y: 0}, left: free, right: free}
material: {E: 5 MPa, nu: 0.3}
friction: {law: slip-weakening, tau_s: 80 kPa, tau_k: 20 kPa, delta: 1 mm}
mesh: {maxh: 5 mm, levels: 2}
sweep: {boundary.top.u_x: [1 mm, 2 mm], body.rectangle.height: [20 mm, 5 mm, 10 mm]}
output: {fields: true}
"""
RAIL = """
units: none
title: A bar that warms and cools on friction, held in the middle
body: {rectangle: {width: 8, height: 0.5, edges: {bottom: base, left: middle, right: end, top: head}}}
boundary: {base: contact, middle: {role: clamped, u_x: 0, u_y: free}, head: free, end: free}
material: {E: 100, nu: 0, plane: stress, alpha_T: 0.01}
heat: {theta: 0}
friction: {law: tresca, tau: 0.5}
mesh: {maxh: 0.5}
history:
  memory: friction
  steps: [{theta: 4, in: 2, name: warm}, {theta: -4, in: 4, name: cold}, {theta: 0, in: 2, name: back}]
  repeat: 2
sweep: {friction.tau: [0.5, 0.25, 1], E: [100, 50]}
"""
CURL = """
title: Half of a slab that curls, its top colder or warmer
body: {rectangle: {width: 6 m, height: 200 mm, edges: {bottom: base, left: middle, right: joint, top: surface}}}
boundary: {base: {role: contact, normal: unilateral}, middle: {role: clamped, u_x: 0 m, u_y: free},
           surface: {role: traction, pressure: 4.8 kPa}, joint: free}
material: {E: 30 GPa, nu: 0, plane: stress, alpha_T: 1e-5 1/K}
mesh: {maxh: 100 mm}
sweep: {theta: ["-50*(y - 0.1)", "50*(y - 0.1)"]}
output: {fields: true}
"""
ARM = """
title: Half of a double cantilever beam
body: {outline: [{from: [0 mm, 0 mm], edge: crack}, {from: [30 mm, 0 mm], edge: bond},
                 {from: [60 mm, 0 mm], edge: right}, {from: [60 mm, 1.5 mm], edge: top},
                 {from: [0 mm, 1.5 mm], edge: end}]}
boundary: {bond: contact, right: {role: clamped, u_x: 0 mm, u_y: free}, crack: free, top: free,
           end: {role: clamped, u_x: free, u_y: 1.9 mm}}
material: {E: 70 GPa, nu: 0, plane: stress}
adhesion: {law: bilinear, sigma: 20 MPa, s0: 4 um, sf: 14 um}
mesh: {maxh: 0.5 mm}
output: {fields: true}
"""
PRESSED = """
title: A block that is pressed and sheared, on friction that knows the pressure
body: {rectangle: {width: 40 mm, height: 20 mm}}
boundary: {bottom: {role: contact, normal: unilateral}, top: {role: clamped, u_x: 10 um, u_y: -10 um},
           left: free, right: free}
material: {E: 70 GPa, nu: 0.3}
friction: {law: coulomb, mu: 0.1}
mesh: {maxh: 5 mm}
sweep: {friction.mu: [0.1, 1]}
output: {fields: true}
"""
COLUMN = """
units: none
title: A column that is lifted off its bond
body: {rectangle: {width: 1, height: 1}}
boundary: {bottom: contact, top: {role: clamped, u_x: 0, u_y: 0}, left: free, right: free}
material: {E: 1, nu: 0, plane: stress}
adhesion: {law: bilinear, sigma: 1, s0: 0.1, sf: 0.3}
mesh: {maxh: 1}
"""
LIFTED = "path={parameter: boundary.top.u_y, from: 0, to: 1.5}"
RAISED = (
    "history={memory: damage, steps: [{boundary.top.u_y: 0.7, in: 7, name: up},"
    " {boundary.top.u_y: 0, in: 2, name: down}, {boundary.top.u_y: 1.5, in: 4, name: off}]}"
)
NEAR = (
    "fit.parameters={friction.tau_s: {start: 7.3 MPa, within: [1 MPa, 50 MPa]},"
    " friction.delta: {start: 0.158 mm, within: [0.01 mm, 1 mm]}}"
)
STUDIES: dict[str, tuple[str | Path, list[str]]] = {
    "block": (BLOCK, []),
    "listed": (BLOCK, [LISTED, "mesh.levels=1", "output={}"]),
    "single": (BLOCK, ["sweep=null", "mesh.levels=1", "output={}"]),
    "films": (FILMS, []),
    "pads": (PADS, []),
    "curl": (CURL, []),
    "arm": (ARM, []),
    "pressed": (PRESSED, []),
    "lifted": (COLUMN, [LIFTED]),
    "raised": (COLUMN, [RAISED]),
    "history": (RAIL, []),
    "path": (CONFIGS / "path.yaml", ["mesh.levels=1"]),
    "fit": (CONFIGS / "pull_fit.yaml", ["mesh.maxh=8 mm", "fit.starts=1", NEAR]),
}
Stored = Callable[[str], Path]


@pytest.fixture(scope="session")
def stored(tmp_path_factory: pytest.TempPathFactory) -> Stored:
    """The file of a study by its name, run when it is first asked for; in "failed" the block's last
    point failed."""
    folder = tmp_path_factory.mktemp("stored")

    @cache
    def made(name: str) -> Path:
        path = folder / f"{name}.nc"
        if name == "failed":
            shutil.copy(made("block"), path)
            with netCDF4.Dataset(path, "a") as nc:
                nc["status"][2, 1, 1], nc["reason"][2, 1, 1] = PointStatus.SINGULAR, REASON
                for one in (*nc.variables.values(), nc["level_1"]["u_T"], nc["level_1"]["xi"]):
                    if one.dtype == float and one.dimensions[:2] == nc["status"].dimensions[:2]:
                        one[(2, 1, 1) if "level" in one.dimensions else (2, 1)] = np.nan
            put_seal(path)
            return path
        text, changes = STUDIES[name]
        study = (
            read_study(text, changes)
            if isinstance(text, Path)
            else read_study_text(text, name, changes)
        )
        tcstudy.run(study, path, jobs=1)
        return path

    return made


@pytest.fixture(scope="session")
def browser(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Browser]:
    window = Browser(tmp_path_factory.mktemp("profile"))
    yield window
    window.close()
