"""The comparison on problems of 20 nodes: answers are judged rightly, nothing is dropped, chart and table are made."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from tests.benchmarks import peers
from tests.benchmarks.measure import NOT_RUN, RETURNED, Limits, measure
from tests.benchmarks.methods import PEERS, TOLERANCE
from tests.benchmarks.problems import cases
from tests.benchmarks.semismooth import SemismoothNewton
from tests.benchmarks.summary import solved, wrong_claims
from tests.contact.contact_cases import independent_residual

SMALL = Limits(solve=30.0, budget=30.0, repeats=2)


@pytest.fixture(scope="module")
def data() -> xr.Dataset:
    """All methods on one load a family."""
    return measure(cases((20,), 1, body_levels=0), limits=SMALL)


def test_ours_solve_everything_and_every_method_was_run(data: xr.Dataset) -> None:
    assert np.all(data["end"].values != NOT_RUN)
    for method in ("separable-newton", "bundle-newton"):
        assert solved(data, method) == (data.sizes["case"], data.sizes["case"])
    assert float(data["energy_gap"].min()) >= 0.0
    assert np.all(np.diff(data["residual"].values, axis=-1) <= 0.0)


def test_a_plain_claim_is_refuted(data: xr.Dataset) -> None:
    """Powell stops with success=True on every one of these; none is a solution."""
    wrong, claims = wrong_claims(data, "Powell")
    assert wrong == claims == int(np.sum(data["end"].sel(solver="Powell") == RETURNED)) > 0


def test_semismooth_newton_ends_exactly_or_says_that_it_cycles() -> None:
    """Judged by a residual that shares no code with the package; some of these cycle, most do not."""
    converged = 0
    for family in cases((20,), 5, body_levels=0):
        for case in family:
            outcome = SemismoothNewton().run(case.problem, np.zeros(20))
            good = independent_residual(case.problem, outcome.x) <= TOLERANCE
            assert good == outcome.converged, outcome.reason
            converged += good
    assert 10 <= converged < 20


def test_chart_and_table_come_from_the_stored_file(data: xr.Dataset, tmp_path: Path) -> None:
    data.assign_attrs(peers.provenance()).to_netcdf(tmp_path / "peers.nc")
    peers.main(["--draw", "--output", str(tmp_path)])
    assert (tmp_path / "peers-small.png").stat().st_size > 10_000
    text = (tmp_path / "peers.md").read_text(encoding="utf-8")
    assert all(peer.name in text for peer in PEERS)
    assert str(tmp_path) not in text
