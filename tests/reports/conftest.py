"""Result files that the tests of pictures share."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

import tcstudy
from tcstudy.cli import main
from tcstudy.read.study import read_study_text
from tcstudy.study.run import execute
from tests.reports.figures.draw_cases import (
    ALPHA,
    TAU,
    result,
)


@pytest.fixture(scope="module")
def grid(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return result(tmp_path_factory.mktemp("grid") / "plate.nc")


@pytest.fixture(scope="module")
def listed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    alpha = replace(ALPHA, values=(25, 100, 25), labels=(25.0, 100.0, 25.0))
    tau = replace(TAU, values=(1, 2, 3), labels=(1e6, 1e6, 2e7))
    return result(tmp_path_factory.mktemp("list") / "plate.nc", "list", (alpha, tau))


BLOCK = {
    "body": {"rectangle": {"width": "200 mm", "height": "100 mm"}},
    "boundary": {
        "bottom": "contact",
        "left": "clamped",
        "top": {"role": "convection", "g": ["8 MPa", 0]},
        "right": "free",
    },
    "material": {"E": "210 GPa", "nu": 0.3, "k": 45, "alpha_T": 12e-6},
    "heat": {"alpha": 100, "theta_bar": "20 K"},
    "friction": {"law": "slip-weakening", "tau_s": "4 MPa", "tau_k": "1 MPa", "delta": "5 um"},
    "mesh": {"maxh": "50 mm", "levels": 2},
    "sweep": {"E": ["100 GPa", "210 GPa", "50 GPa"], "theta_bar": ["0 K", "40 K"]},
    "output": {"fields": True},
}


@pytest.fixture(scope="session")
def block(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("block") / "block.nc"
    tcstudy.run(tcstudy.Study.from_dict(BLOCK), path, jobs=1)
    return path


@pytest.fixture(scope="session")
def fitted(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The fit of the gallery on a coarse mesh."""
    path, config = tmp_path_factory.mktemp("fit") / "pull.nc", Path(__file__).parents[2] / "configs" / "pull_fit.yaml"
    assert main(["run", str(config), "--set", "mesh.maxh=8 mm", "--set", "fit.starts=1", "--output", str(path)]) == 0
    return path


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


@pytest.fixture(scope="session")
def pads(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("pads") / "pads.nc"
    execute(read_study_text(PADS), path)
    return path
