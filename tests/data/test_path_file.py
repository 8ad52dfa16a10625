"""The file of a path: complete, read by xarray without warnings, vertices exact, told from that of a run."""

from __future__ import annotations

from pathlib import Path

import netCDF4
import numpy as np
import pytest

from tcstudy.data.provenance import collect
from tcstudy.data.store import Record, write_record
from tcstudy.data.tables import CURVE, LEVEL, LINE, LOOP, SOLUTIONS
from tcstudy.read.study import read_study
from tcstudy.scene.study import Study
from tcstudy.study.path_run import follow_path
from tests.data.compliance import cf_faults

PAD = Path(__file__).parents[2] / "configs" / "path.yaml"


@pytest.fixture(scope="module")
def followed() -> tuple[Study, Record]:
    study = read_study(PAD, ["mesh.levels=1"])
    return study, follow_path(study)


@pytest.fixture
def file(followed: tuple[Study, Record], tmp_path: Path) -> Path:
    write_record(tmp_path / "path.nc", *followed, collect(followed[0], ("tcstudy", "path", "path.yaml")))
    return tmp_path / "path.nc"


def test_conventions(file: Path) -> None:
    with netCDF4.Dataset(file) as nc:
        assert nc.Conventions == "CF-1.11"
        for name in (
            "title",
            "source",
            "history",
            "references",
            "study_yaml",
            "study_sha256",
            "versions",
            "git_commit",
        ):
            assert name in nc.ncattrs()
        known = {v.name for v in (*LINE, *LEVEL, *CURVE, *SOLUTIONS, *LOOP)}
        assert set(nc.variables) == known
        for name, variable in nc.variables.items():
            assert variable.long_name, name
            assert "units" in variable.ncattrs(), name
            assert "_FillValue" not in variable.ncattrs(), name
            if "flag_values" in variable.ncattrs():
                assert len(np.atleast_1d(variable.flag_values)) == len(variable.flag_meanings.split())
                assert set(np.unique(variable[...])) <= set(np.atleast_1d(variable.flag_values))
            for other in getattr(variable, "coordinates", "").split():
                assert set(nc[other].dimensions) <= set(variable.dimensions), (name, other)
        assert nc["parameter"].units == "m"
        assert nc["energy_rate"].units == "J m-1/(m)"


def test_compliance_checker_finds_no_fault(file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    faults, stumbled = cf_faults(file, tmp_path, capsys)
    assert not faults
    assert not stumbled
