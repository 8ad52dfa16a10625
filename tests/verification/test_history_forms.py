"""Load histories against closed forms that no study of the gallery has: bars on films that remember."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from tcstudy.read.study import read_study_text
from tcstudy.study.history_run import execute_history


def followed(folder: Path, text: str) -> xr.Dataset:
    """The data of a history, every step solved along its path, nothing missed."""
    execute_history(read_study_text(text), folder / "a.nc")
    with xr.open_dataset(folder / "a.nc") as opened:
        data = opened.load()
    assert data["reason"].item() == ""
    assert np.all(np.abs(data["closure"].values) <= 1e-8 * float(data["dissipated"].sum()))
    return data


def test_a_pipeline_walks_down_a_slope(tmp_path: Path) -> None:
    """Weight w a length along the slope against friction r: anchors at L (1 ∓ w/r)/2, a walk between them a cycle.

    Hot N = −(r − w)(L − x) and cold N = (r − w) x between the anchors, so that it is (ε − (r − w) L/D) L w/r. Where
    nodes neither load nor unload (the middle of a cooling line), rounding must not move the path.
    """
    D, length, r, w, epsilon = 3.2913e9, 2000.0, 1e3, 300.0, 1.17e-5 * 80.0
    data = followed(
        tmp_path,
        """
body: {rectangle: {width: 2000 m, height: 9 m}}
boundary: {bottom: contact, left: free, right: free, top: free}
material: {E: 365.7 MPa, nu: 0, plane: stress, alpha_T: 1.17e-5 1/K}
heat: {theta: 0 K}
loads: {f: [33.3333333333333 N/m^3, 0]}
friction: {law: tresca, tau: 1 kPa}
mesh: {maxh: 10 m}
history: {memory: friction, steps: [{theta: 80 K}, {theta: 0 K}], repeat: 2}
""",
    )
    walk = data["u_T"].values[4] - data["u_T"].values[2]
    assert walk == pytest.approx(
        (epsilon - (r - w) * length / D) * length * w / r, rel=4e-4
    )  # a plane strip, not a bar
    assert np.ptp(walk) <= 1e-10
