"""The factor `load` among measured loads: what is compared, and derivatives, where it is not one."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import tcstudy
from tcstudy.study import fit

STRIP = """
body: {rectangle: {width: 300 mm, height: 2 mm}}
boundary: {bottom: contact, right: {role: traction, g: [180 MPa, 0]}, top: convection, left: symmetry}
material: {E: 165 GPa, nu: 0.3, plane: stress, k: 5 W/(m*K), alpha_T: 0.6e-6 1/K}
heat: {alpha: 10 W/(m^2*K), theta_bar: 18 K}
friction: {law: bilinear, tau: 6 MPa, s0: 20 um, sf: 150 um}
mesh: {maxh: 10 mm}
"""
WITHIN = {
    "friction.tau": "{start: 6 MPa, within: [1 MPa, 20 MPa]}",
    "boundary.right.g_x": "{start: 180 MPa, within: [10 MPa, 400 MPa]}",
    "load": "{start: 0.7, within: [0.1, 2]}",
    "heat.theta_bar": "{start: 18 K, within: [1 K, 40 K]}",
}


def compared_of(
    folder: Path, data: str, columns: str, names: tuple[str, ...], more: str = ""
) -> tuple[fit.Tests, np.ndarray]:
    (folder / "test.csv").write_text(data, encoding="utf-8")
    numbers = ", ".join(f"{name}: {WITHIN[name]}" for name in names)
    (folder / "fit.yaml").write_text(
        f"{STRIP}fit:\n  parameters: {{{numbers}}}\n  data: {{file: test.csv, columns: {{{columns}}}}}\n{more}",
        encoding="utf-8",
    )
    study = tcstudy.load(folder / "fit.yaml")
    assert study.fit is not None
    return fit.Tests.of(study), np.array([one.start for one in study.fit.parameters])


def test_results_at_factors_are_those_of_the_loads_themselves(tmp_path: Path) -> None:
    """0.2, 0.5 and 1 times g against g of 36, 90 and 180 MPa, each from the solution before."""
    by_factor, p = compared_of(
        tmp_path, "load,u [um]\n0.2,7\n0.5,17\n1,40\n", 'load: load, u_T_max: "u [um]"', ("friction.tau",)
    )
    found = by_factor.models[0].compared(p).predicted
    by_load, p = compared_of(
        tmp_path,
        "g [MPa],u [um]\n36,7\n90,17\n180,40\n",
        'boundary.right.g_x: "g [MPa]", u_T_max: "u [um]"',
        ("friction.tau",),
    )
    np.testing.assert_allclose(found, by_load.models[0].compared(p).predicted, rtol=1e-12)


@pytest.mark.parametrize(
    ("data", "columns", "names", "more"),
    [
        (
            "load,u [um]\n0.2,7\n0.5,17\n1,37\n1.2,45\n",
            'load: load, u_T_max: "u [um]"',
            ("friction.tau", "boundary.right.g_x", "heat.theta_bar"),
            "",
        ),
        (
            "load,P [N/mm]\n0.2,60\n0.5,140\n1.2,320\n",
            'load: load, friction_resultant: "P [N/mm]"',
            ("friction.tau", "boundary.right.g_x"),
            "  compare: orthogonal\n",
        ),
        (
            "load,P [N/mm]\n0,-30\n0.5,140\n1.2,320\n",  # the foot of the first is where the path begins
            'load: load, friction_resultant: "P [N/mm]"',
            ("heat.theta_bar", "friction.tau"),
            "  compare: orthogonal\n",
        ),
        (
            "T [K],u [um]\n5,30\n10,31\n20,32\n",
            'heat.theta_bar: "T [K]", u_T_max: "u [um]"',
            ("boundary.right.g_x", "load"),
            "",
        ),
    ],
    ids=["vertical", "orthogonal", "at the end", "fitted"],
)
def test_derivatives_by_loads_under_a_factor_are_differences(
    tmp_path: Path, data: str, columns: str, names: tuple[str, ...], more: str
) -> None:
    tests, p = compared_of(tmp_path, data, columns, names, more)
    exact, steps = tests(p)[1], 1e-6 * np.diag(p)
    apart = np.stack([(tests(p + h)[0] - tests(p - h)[0]) / (2.0 * h.sum()) for h in steps], axis=1)
    assert np.all(np.abs(exact - apart) <= 1e-5 * np.abs(apart).max(axis=0))
