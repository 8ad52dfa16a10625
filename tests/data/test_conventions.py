"""Files of all kinds keep the conventions that other programs read them by (CF-1.11): by the
compliance checker."""

import re
from collections.abc import Callable
from copy import copy
from functools import cache
from inspect import signature
from pathlib import Path
from typing import Any

import netCDF4
import numpy as np
import pytest

from tcstudy.data.files import collect
from tcstudy.data.store import write_record
from tcstudy.data.tables import convergence_record, convergence_table, is_taken
from tcstudy.read.study import read_study_text
from tests.commands import CONFIGS, tcstudy_command
from tests.data.by_points import write
from tests.data.conftest import ALPHA, FRICTION, make_block, make_level, make_study
from tests.verification.scenes import RECTANGLE

STUMBLES = {
    "check_coordinate_variables_strict_monotonicity",
    "check_invalid_same_named_dimension_across_groups",
}
"""Where the checker itself stumbles, over text coordinates and groups; these are no findings about
the file."""
FEW = ("theta_L2", "u_energy", "u_T_max", "xi_L2", "energy", "status")
"""A measure of every kind of units: the checker's time grows with the square of the number of
variables."""


@pytest.fixture
def faults(monkeypatch: pytest.MonkeyPatch) -> Callable[[Path], str]:
    """The checker, which asks for the kinds of all variables once a variable: here once a file."""
    util: Any = pytest.importorskip("compliance_checker.cf.util")
    for name, kind in [*vars(util).items()]:
        if name.startswith("get_") and len(signature(kind).parameters) == 1:
            once = cache(kind)
            monkeypatch.setattr(util, name, lambda nc, once=once: copy(once(nc)))
    return checked


def checked(file: Path) -> str:
    """What the checker of cf:1.11 says, if it found anything."""
    runner: Any = pytest.importorskip("compliance_checker.runner")
    runner.CheckSuite.load_all_available_checkers()
    report = file.with_name("report.txt")
    options = {
        "checker_names": ["cf:1.11"],
        "verbose": 0,
        "criteria": "strict",
        "output_format": "text",
    }
    passed, _ = runner.ComplianceChecker.run_checker(
        ds_loc=str(file), output_filename=str(report), **options
    )
    text = report.read_text()
    stumbled = set(re.findall(r"cf:1\.11\.(\w+)", text)) - STUMBLES
    return "" if passed and "All tests passed!" in text and not stumbled else text


def ran(config: str, *changes: str) -> Callable[[Path], object]:
    """Make the file of a study that is shipped."""
    given = [word for change in changes for word in ("--set", change)]
    return lambda file: tcstudy_command(
        "run", CONFIGS / f"{config}.yaml", *given, "-o", file, "-q", code=0
    )


def swept(**kind: Any) -> Callable[[Path], None]:
    """Make a file with whole-body fields of made-up points."""

    def make(file: Path) -> None:
        study = make_study(**kind)
        blocks = [make_block(n, shape=study.shape, fields=True) for n in range(2)]
        write(file, study, [make_level(n, fields=True) for n in range(2)], blocks)

    return make


def convergence(file: Path) -> None:
    """Make the file of some measures, with made-up values over a temperature and a named law."""
    laws = "{weak: {law: tresca, tau: 1}, strong: {law: tresca, tau: 2}}"
    text = RECTANGLE.replace("units: none", "institution: nobody").replace("free", "convection")
    heat = "material.k=10", "material.alpha_T=1e-5", "heat={alpha: 10}"
    study = read_study_text(
        text, "s", [*heat, f"sweep={{theta_bar: [10 K, 20 K], friction: {laws}}}"]
    )
    h, ones = 0.5 ** np.arange(3), np.ones(3, dtype=np.int32)
    table = [v for v in convergence_table(study) if "*" in v.dims and v.name.endswith(FEW)]
    point = {v.name: h if "level" in v.dims else "smooth" if v.dtype == "str" else 1 for v in table}
    meshes = {"h_max": h, "n_dof": ones, "n_contact": ones, "compared": ones}
    record = convergence_record(
        study, [meshes | point] * len(study.scenes), "the exact solution", ["Mind it."]
    )
    write_record(file, study, record, collect(study, ("tcstudy", "converge")))


def unknown_names(file: Path) -> set[str]:
    """Return the names of a file of a swept study that a swept parameter could take, besides its
    own."""
    with netCDF4.Dataset(file) as nc:
        groups = [nc, *nc.groups.values()]
        groups += [inner for group in nc.groups.values() for inner in group.groups.values()]
        names = {name for group in groups for name in (*group.variables, *group.dimensions)}
        names |= {group.name for group in groups[1:]}
        swept = [
            name
            for name in nc.variables
            if "." in getattr(nc[name], "long_name", "") or name == "friction"
        ]
    return {name for name in names - {*swept} if not is_taken(name)}


def flattened(file: Path) -> list[Path]:
    """Write each group of a file, with the dimensions and coordinates above it, as a file of its
    own: the checker looks at the root alone."""
    found = list[Path]()
    with netCDF4.Dataset(file) as nc:
        nc.set_auto_mask(False)
        groups = [*nc.groups.values()]
        for group in (*groups, *(inner for one in groups for inner in one.groups.values())):
            found.append(file.with_name(f"{group.path.strip('/').replace('/', '-')}.nc"))
            above = [nc, group] if group.parent is nc else [nc, group.parent, group]
            with netCDF4.Dataset(found[-1], "w") as flat:
                flat.setncatts({name: nc.getncattr(name) for name in nc.ncattrs()})
                used = {dim for variable in group.variables.values() for dim in variable.dimensions}
                for name, dim in ((n, d) for one in above for n, d in one.dimensions.items()):
                    if name in used:
                        flat.createDimension(name, dim.size)
                coordinates = [
                    nc[name] for name in (*used, *swept_in(group)) if name in nc.variables
                ]
                for variable in (*dict.fromkeys(coordinates), *group.variables.values()):
                    copied(variable, flat)
    return found


def swept_in(group: netCDF4.Group) -> set[str]:
    """Return names of coordinates to which the variables of a group refer."""
    texts = (getattr(variable, "coordinates", "") for variable in group.variables.values())
    return {name for text in texts for name in text.split()}


def copied(variable: netCDF4.Variable, flat: netCDF4.Dataset) -> None:
    """Copy a variable into another file. What judges it stays behind, in the root, and so do the
    roles of UGRID, which CF-1.11 takes in and the checker does not know."""
    about = {name: variable.getncattr(name) for name in variable.ncattrs()}
    about.pop("ancillary_variables", None)
    if about.get("cf_role") in ("mesh_topology", "face_node_connectivity"):
        del about["cf_role"]
    fill = about.pop("_FillValue", False)
    new = flat.createVariable(variable.name, variable.dtype, variable.dimensions, fill_value=fill)
    new.setncatts(about)
    new[...] = variable[...]


CASES = {
    "fit": ran("pull_fit", "mesh.maxh=10 mm", "fit.starts=1"),
    "path": ran("path", "mesh.levels=1"),
    "history": ran("pipeline_cycles", "mesh.maxh=40 m"),
    "geometries": ran(
        "thickness_map",
        "mesh.levels=1",
        "sweep={parameters.H: [8 mm, 16 mm]}",
        "output.fields=true",
    ),
    "list of geometries": ran(
        "thickness_map",
        "mesh.levels=1",
        "sweep={mode: list, points: [{parameters.H: 8 mm}, {parameters.H: 16 mm}]}",
    ),
    "grid": swept(),
    "list": swept(mode="list", axes=(ALPHA, FRICTION)),
    "dimensionless": swept(units="none", axes=(ALPHA,)),
    "convergence": convergence,
}


@pytest.mark.filterwarnings("ignore::DeprecationWarning")
@pytest.mark.parametrize("kind", CASES)
def test_compliance_checker_finds_no_fault(
    kind: str, faults: Callable[[Path], str], tmp_path: Path
) -> None:
    CASES[kind](tmp_path / "out.nc")
    assert not faults(tmp_path / "out.nc")
    for group in flattened(tmp_path / "out.nc"):
        assert not faults(group), group.name
    assert kind in ("path", "fit") or not unknown_names(tmp_path / "out.nc")


def test_the_checker_would_find_a_fault(faults: Callable[[Path], str], tmp_path: Path) -> None:
    """Otherwise the tests of conventions say nothing."""
    broken = tmp_path / "broken.nc"
    with netCDF4.Dataset(broken, "w") as nc:
        nc.setncattr("Conventions", "CF-1.11")
        nc.createDimension("level", 3)
        nc.createVariable("error", "f8", ("level",)).setncatts(
            {"units": "m", "standard_name": "no_such_name"}
        )
    assert "§3.3 Standard Name" in faults(broken)
