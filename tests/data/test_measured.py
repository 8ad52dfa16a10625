"""The convergence file keeps to CF-1.11, every variable of it: by the compliance checker where it is installed."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tcstudy.data.measured import Measured, convergence_record, convergence_table
from tcstudy.data.provenance import collect, measured_path
from tcstudy.data.store import write_record
from tcstudy.read.study import read_study_text
from tests.data.compliance import cf_faults

STUDY = """\
institution: nobody
body: {rectangle: {width: 2, height: 1}}
boundary: {bottom: contact, right: convection, top: free, left: clamped}
material: {E: 1 GPa, nu: 0.25, k: 10, alpha_T: 1e-5}
heat: {alpha: 10, theta_bar: 20 K}
friction: {law: tresca, tau: 1 MPa}
mesh: {maxh: 0.5, levels: 3}
sweep: {theta_bar: [10 K, 20 K], friction: {weak: {law: tresca, tau: 1 MPa}, strong: {law: tresca, tau: 2 MPa}}}
"""


FEW = {"theta_L2", "u_energy", "u_T_max", "xi_L2", "energy", "heat_balance"}
"""A measure of every kind of units: the checker's time grows with the square of the number of variables."""


def made_up(folder: Path, names: set[str]) -> Path:
    """The file of some measures, with made-up values over a temperature and a named law."""
    study = read_study_text(STUDY)
    h = 0.5 ** np.arange(3)
    table = [
        v for v in convergence_table(study) if "*" in v.dims and (v.name == "status" or v.name.endswith(tuple(names)))
    ]
    point = {v.name: h if "level" in v.dims else "smooth" if v.dtype == "str" else 1 for v in table}
    meshes = {"h_max": h, "n_dof": np.arange(3), "n_contact": np.arange(3), "compared": np.ones(3, dtype=bool)}
    measured = Measured([point] * len(study.scenes), meshes, "the exact solution", ["Mind it."])
    path = measured_path(folder / "a.nc", "convergence")
    write_record(path, study, convergence_record(study, measured), collect(study, ("tcstudy", "converge")))
    return path


def test_compliance_checker_finds_no_fault(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    faults, stumbled = cf_faults(made_up(tmp_path, FEW), tmp_path, capsys)
    assert not faults
    assert stumbled <= {"check_coordinate_variables_strict_monotonicity"}  # it stumbles over text coordinates
