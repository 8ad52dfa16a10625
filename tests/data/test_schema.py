"""The rules of CF-1.11 that a reader relies on, by own code, and by the compliance checker where it is installed."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import netCDF4
import numpy as np
import pytest

from tcstudy.data import schema
from tcstudy.scene.study import Axis, Study
from tests.data.by_points import write
from tests.data.compliance import cf_faults
from tests.data.conftest import make_level, make_point


@pytest.fixture(params=["grid", "list", "dimensionless"])
def written(request: pytest.FixtureRequest, output: Path, study: Study, list_study: Study) -> Path:
    """Files of all kinds of sweep, with whole-body fields."""
    kinds = {
        "grid": study,
        "list": list_study,
        "dimensionless": replace(study, units="none", axes=(Axis("alpha", ("heat", "alpha"), (1,), (1.0,), "1"),)),
    }
    chosen = kinds[request.param]
    levels = [make_level(n, fields=True) for n in range(2)]
    points = [make_point(index, n, fields=True) for n in range(2) for index in np.ndindex(chosen.shape)]
    write(output, chosen, levels, points)
    return output


def variables(nc: netCDF4.Dataset) -> Iterator[netCDF4.Variable]:
    """All variables of the root and of the groups, raw."""
    nc.set_auto_maskandscale(False)
    yield from nc.variables.values()
    for group in nc.groups.values():
        yield from group.variables.values()


"""Characters of a long_name: where xarray breaks the label of a plot."""


def test_missing_values_cannot_be_mistaken(written: Path) -> None:
    with netCDF4.Dataset(written) as nc:
        for v in variables(nc):
            if v.dtype == np.float64 and "_FillValue" in v.ncattrs():
                assert np.isnan(v._FillValue)
            elif v.dtype in (np.int8, np.int32):  # a _FillValue would make xarray turn them into floats
                assert "_FillValue" not in v.ncattrs()
            if "valid_min" in v.ncattrs():
                assert v.valid_min == 0
                assert v.valid_min.dtype == v.dtype
        for v in schema.ROOT:
            assert ("_FillValue" in nc[v.name].ncattrs()) == (v.dtype == "f8")
            assert ("valid_min" in nc[v.name].ncattrs()) == (v.dtype == "i4")


def test_compliance_checker_finds_no_fault(written: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    text, stumbled = cf_faults(written, tmp_path, capsys)
    assert not text
    # the checker itself stumbles over text coordinates and over groups; these are no findings about the file
    known = {"check_coordinate_variables_strict_monotonicity", "check_invalid_same_named_dimension_across_groups"}
    assert stumbled <= known
