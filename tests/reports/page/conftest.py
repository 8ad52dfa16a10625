"""A browser, and small studies of which pages are made, run once for all tests of the page."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from tcstudy.read.study import read_study_text
from tcstudy.study.history_run import execute_history
from tcstudy.study.run import execute
from tests.reports.figures.draw_cases import RAIL
from tests.reports.page.browser import Browser

STUDY = """
title: A block <on> a film
body: {outline: [{from: [0, 0], edge: film}, {from: [0.2, 0], edge: end}, {from: [0.2, 0.1], edge: top},
                 {from: [0, 0.1], edge: back}]}
boundary: {film: contact, back: clamped, top: convection, end: {role: traction, g: [3 MPa, 0]}}
material: {E: 210 GPa, nu: 0.3, k: 45, alpha_T: 12e-6}
heat: {alpha: 200, theta_bar: 10 K, q: 5e5}
friction: {law: slip-weakening, tau_s: 40 MPa, tau_k: 10 MPa, delta: 40 um}
mesh: {maxh: 40 mm, levels: 2}
sweep:
  theta_bar: [20 K, 0 K, 10 K]
  friction:
    plain: {law: tresca, tau: 40 MPa}
    weak: {law: slip-weakening, tau_s: 40 MPa, tau_k: 10 MPa, delta: 40 um}
output: {fields: true}
"""


@pytest.fixture(scope="session")
def result(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("page") / "block.nc"
    execute(read_study_text(STUDY), path)
    return path


@pytest.fixture(scope="session")
def history(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("history") / "rail.nc"
    execute_history(read_study_text(RAIL + "sweep: {friction.tau: [0.5, 0.25, 1], E: [100, 50]}\n"), path)
    return path


@pytest.fixture(scope="module")
def browser(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Browser]:
    window = Browser(tmp_path_factory.mktemp("profile"))
    yield window
    window.close()
