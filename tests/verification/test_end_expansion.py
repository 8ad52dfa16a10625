"""Published closed forms of long bars that heat pushes out of their friction: a welded rail and a pipeline."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import tcstudy
from tcstudy.data.schema import PointStatus
from tests.commands import CONFIGS


def test_breathing_end_of_a_welded_rail(tmp_path: Path) -> None:
    """u_end = EA(αΔT)²/2r, ± u0/2 for ballast that is elastic first or has a peak; nothing is refused for rounding."""
    tree = tcstudy.run(tcstudy.load(str(CONFIGS / "welded_rail.yaml")), tmp_path / "rail.nc")
    data = tree.to_dataset().isel(level=0)
    assert np.all(data["status"] == PointStatus.OK)
    assert np.all(data["inclusion_residual"] <= 1e-10)
    assert np.all(data["inclusion_status"] == 1)
    expected = {
        "plastic": [4.638816e-3, 18.555264e-3, 41.749344e-3],
        "en1991": [5.63882e-3, 19.5547e-3, 42.7127e-3],
        "peaked": [3.638816e-3, 17.555264e-3, 40.749344e-3],
    }
    for law, ends in expected.items():
        found = data["u_T_max"].sel(friction=law)
        assert found.values == pytest.approx(ends, rel=3e-5), law
    slides = 210e9 * 76.70e-4 * 1.2e-5 * np.array([20.0, 40.0, 60.0]) / 10e3
    assert data["slip_length"].sel(friction="plastic").values == pytest.approx(slides, abs=0.35)
    # the breathing length ends between two nodes 0.172 m apart
    lengths = {name: data[f"{name}_length"] for name in ("breathing", "yielded", "elastic", "softening", "debonded")}
    assert lengths["breathing"].sel(friction="plastic").values == pytest.approx(slides, abs=0.172)
    assert lengths["yielded"].sel(friction="plastic").values == pytest.approx(slides, abs=0.172)
    whole = lengths["yielded"] + lengths["elastic"]
    assert whole.sel(friction="en1991").values == pytest.approx(140.0, rel=1e-12)
    fallen = lengths["softening"] + lengths["debonded"]
    assert fallen.sel(friction="peaked").values == pytest.approx(lengths["breathing"].sel(friction="peaked").values)
    assert np.isnan(data["slip_length"].sel(friction="en1991")).all()


def test_end_of_a_hot_pipeline(tmp_path: Path) -> None:
    """Breakout and residual friction: slip length and end displacement, the first after a few cells of slip only."""
    tree = tcstudy.run(tcstudy.load(str(CONFIGS / "pipeline_end.yaml")), tmp_path / "pipe.nc")
    data = tree.to_dataset().isel(level=0)
    assert np.all(data["status"] == PointStatus.OK)
    error = np.abs(data["u_T_max"].values / [0.0029227, 0.0801092, 0.8009829, 2.2427303] - 1.0)
    assert np.all(error <= [6e-3, 1e-4, 2e-5, 1e-5])
    assert data["slip_length"].values == pytest.approx([98.686, 594.454, 2134.783, 3675.111], abs=9.0)
