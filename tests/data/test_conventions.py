"""Files of all kinds keep the conventions that other programs read them by."""

from __future__ import annotations

from pathlib import Path

import netCDF4
import pytest

from tcstudy.cli import main
from tests.data.compliance import cf_faults

CONFIGS = Path(__file__).parents[2] / "configs"
CASES = {
    "fit": ("pull_fit", ["mesh.maxh=10 mm", "fit.starts=1"]),
    "path": ("path", ["mesh.levels=1"]),
    "history": ("pipeline_cycles", ["mesh.maxh=20 m"]),
    "run": ("thickness_map", ["mesh.levels=1", "sweep={parameters.H: [8 mm, 16 mm]}"]),
}


@pytest.mark.filterwarnings("ignore::DeprecationWarning")
@pytest.mark.parametrize("kind", CASES)
def test_compliance_checker_finds_no_fault(kind: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    study, changes = CASES[kind]
    file = tmp_path / f"{study}.nc"
    given = [word for change in changes for word in ("--set", change)]
    assert main(["run", str(CONFIGS / f"{study}.yaml"), *given, "--output", str(file), "-q"]) == 0
    capsys.readouterr()
    faults, stumbled = cf_faults(file, tmp_path, capsys)
    assert not faults
    # the checker itself stumbles over text coordinates and over groups; these are no findings about the file
    assert stumbled <= {
        "check_coordinate_variables_strict_monotonicity", "check_invalid_same_named_dimension_across_groups"
    }  # fmt: skip


def test_the_checker_would_find_a_fault(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Otherwise the tests of conventions say nothing."""
    broken = tmp_path / "broken.nc"
    with netCDF4.Dataset(broken, "w") as nc:
        nc.setncattr("Conventions", "CF-1.11")
        nc.createDimension("level", 3)
        nc.createVariable("error", "f8", ("level",)).setncatts({"units": "m", "standard_name": "no_such_name"})
    assert "§3.3 Standard Name" in cf_faults(broken, tmp_path, capsys)[0]
