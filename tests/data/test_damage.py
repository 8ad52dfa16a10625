"""Damage that is mended or told: the cache, and sealed files whose contents do not fit."""

import os
from pathlib import Path

import netCDF4
import numpy as np
import pytest

import tcstudy
from tcstudy.data.files import attributes, put_seal
from tests.commands import tcstudy_command

STUDY = """\
body: {rectangle: {width: 60 mm, height: 20 mm}}
boundary:
  bottom: contact
  top: {role: clamped, u_x: 0.2 mm, u_y: 0}
  left: {role: convection}
  right: free
material: {E: 5 MPa, nu: 0.3, alpha_T: 1.0e-4, k: 0.2}
heat: {alpha: 20, theta_bar: 10 K}
friction: {law: tresca, tau: 8 kPa}
mesh: {maxh: 20 mm, levels: 1}
"""
SWEEPS = {"old": "[5 K]", "a": "[5 K, 20 K]", "b": "[5 K, 30 K]", "c": "[40 K]"}


@pytest.fixture(scope="module")
def studies(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Studies of one body, and `old.nc`, the results of one."""
    folder = tmp_path_factory.mktemp("studies")
    for name, sweep in SWEEPS.items():
        stiffer = STUDY.replace("5 MPa", "50 MPa") if name == "c" else STUDY
        (folder / f"{name}.yaml").write_text(f"{stiffer}sweep: {{theta_bar: {sweep}}}\n")
    tcstudy_command("run", "old.yaml", "-q", "-o", "old.nc", cwd=folder, code=0)
    return folder


def test_the_cache_touches_its_own_files_and_makes_damaged_ones_again(
    studies: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("TCSTUDY_CACHE", str(tmp_path))
    first = tcstudy.run(studies / "a.yaml", jobs=1)
    whole, expected = first.file.read_bytes(), first["u_T_max"].values.copy()
    rotten = whole[:-3000] + bytes(2000) + whole[-1000:]
    for damaged in (rotten, whole[: len(whole) // 2], b"", b"hello"):
        first.file.write_bytes(damaged)
        again = tcstudy.run(studies / "a.yaml", jobs=1)
        np.testing.assert_array_equal(again["u_T_max"].values, expected)
    first.file.write_bytes(rotten)
    (tmp_path / "thesis-data.nc").write_bytes(b"mine")
    (tmp_path / "x-y.nc").mkdir()
    os.utime(tmp_path / "thesis-data.nc", (1, 1))
    monkeypatch.setattr("tcstudy.results.MOST_CACHED", 1)
    for name in ("b", "c"):  # beside a damaged neighbour
        tcstudy.run(studies / f"{name}.yaml", jobs=1)
    assert (tmp_path / "thesis-data.nc").read_bytes() == b"mine"
    assert (tmp_path / "x-y.nc").is_dir()
    assert not first.file.exists()


def test_a_sealed_file_whose_contents_do_not_fit_is_refused_in_one_line(
    studies: Path, tmp_path: Path
) -> None:
    file = tmp_path / "odd.nc"
    file.write_bytes((studies / "old.nc").read_bytes())
    with netCDF4.Dataset(file, "a") as nc:
        nc.renameVariable("status", "state")
    put_seal(file)
    assert attributes(file)
    for words in (["show"], ["export", "--csv"]):
        said = tcstudy_command(words[0], file, *words[1:], code=2)
        assert "do not fit together" in said.stderr
