"""Rounding is no data: reports show 0 for it, and every other number as it was computed."""

from collections.abc import Callable
from functools import cache
from pathlib import Path

import numpy as np
import pytest

import tcstudy
from tcstudy.data.reading import load_root
from tcstudy.read.study import read_study_text
from tcstudy.reports.figures.body import field_of
from tcstudy.reports.figures.point import contact_title
from tcstudy.reports.page.parts import Container
from tcstudy.reports.page.run import line_part, run_part
from tcstudy.reports.page.stored import read
from tcstudy.reports.picture import read_picture
from tcstudy.reports.rounding import floors_of
from tcstudy.reports.terminal.summary import text_of
from tcstudy.reports.text import fitting
from tests.reports.figures.shown import drawn

PULLED = """
title: A strip that is pulled off its bond
body: {rectangle: {width: 60 mm, height: 2 mm}}
boundary: {bottom: contact, left: free, top: free, right: {role: clamped, u_x: 3 mm}}
material: {E: 210 GPa, nu: 0.3, plane: stress}
friction: {law: bilinear, tau: 6 MPa, s0: 40 um, G_f: 0.8 N/mm}
mesh: {maxh: 2 mm}
output: {fields: true, quantities: [reactions, section_force]}
"""
HEATED = """
title: A block between hot and cold air
body: {rectangle: {width: 80 mm, height: 40 mm}}
boundary:
  bottom: contact
  left: {role: convection, theta_bar: 20 K}
  right: {role: convection, theta_bar: -20 K}
  top: {role: clamped, u_x: 0, u_y: free}
material: {E: 200 GPa, nu: 0.3, k: 16, alpha_T: 12e-6}
heat: {alpha: 100}
friction: {law: bilinear, tau: 6 MPa, s0: 40 um, G_f: 0.8 N/mm}
mesh: {maxh: 10 mm}
"""
Run = Callable[..., Path]


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Run:
    folder = tmp_path_factory.mktemp("rounding")

    @cache
    def made(text: str, *changes: str) -> Path:
        path = folder / f"{len(list(folder.iterdir()))}.nc"
        tcstudy.run(read_study_text(text, "study", changes), path, jobs=1)
        return path

    return made


@pytest.mark.parametrize(
    "changes",
    [
        (),
        ("sweep={boundary.right.u_x: [10 um, 3 mm]}",),
        ("body.rectangle.width=200 mm", "material.E=165 GPa", "boundary.right.u_x=0.5 mm"),
        ("friction.tau=5 kPa", "friction.G_f=1 N/m"),
    ],
)
def test_a_debonded_strip_has_neither_friction_nor_forces(run: Run, changes: tuple[str]) -> None:
    path = run(PULLED, *changes)
    data = load_root(path)
    sweep = {str(name): data[name].values[-1] for name in data["status"].dims if name != "level"}
    assert data["shear_max"].values.ravel()[-1] > 0.0  # rounding, which the file keeps
    sizes = floors_of(data)
    for name in ("shear_max", "friction_resultant", "reaction_right_x", "section_force_max"):
        assert sizes.cleared(name, data[name].values.reshape(-1), -1)[-1] == 0.0, name
    ratios = data["omega"].values[..., -1].ravel() / data["lambda_1"].values[..., -1].ravel()
    table = text_of(path).partition("the finest:")[2]
    for ratio in ratios:  # which may be small without being rounding
        table = table.replace(f"{ratio:.3g}", "")
    assert "e-" not in table
    picture = read_picture(path, sweep)
    section = picture.line.section
    field = field_of(picture, "sigma_x")
    assert section is not None
    assert field is not None
    assert not picture.line.xi.any()
    assert not section[0].any()
    assert field.ends == (0.0, 0.0)
    box = Container()
    page = run_part(read(path), box)["numbers"]["shear_max"]
    line = line_part(read(path), 0, box)["xi"]
    blocks = b"".join(box._blocks)
    for part in (page["v"], line["rows"]):
        kinds = {"f8": np.float64, "f4": np.float32, "i2": np.int16}
        values = np.frombuffer(blocks, kinds[part["$"]], int(np.prod(part["s"])), part["o"])
        assert not values.reshape(part["s"])[-1].any()
    if sweep:
        figure, _ = drawn(path, x="u_x", y="shear_max")
        curve = np.asarray(figure.axes[0].lines[0].get_ydata())
        assert curve[-1] == 0.0


def test_a_mean_temperature_that_balances_is_0(run: Run) -> None:
    data = load_root(run(HEATED))
    stored = data["theta_mean"].values.ravel()
    assert 0.0 < abs(stored[0]) < 1e-9
    assert floors_of(data).cleared("theta_mean", stored, -1)[0] == 0.0


@pytest.mark.parametrize("pull", ["1e-10 m", "1e-16 m"])
def test_small_numbers_of_a_small_load_are_data(run: Run, pull: str) -> None:
    path = run(PULLED, f"boundary.right.u_x={pull}")
    data = load_root(path)
    for name in ("shear_max", "friction_resultant", "u_T_max", "energy", "reaction_right_x"):
        stored = data[name].values.ravel()
        np.testing.assert_array_equal(floors_of(data).cleared(name, stored, -1), stored)


def test_requested_numbers_are_one_table_with_a_unit_for_each(run: Run) -> None:
    path = run(PULLED, "sweep={boundary.right.u_x: [10 um, 3 mm]}")
    with fitting(80):
        lines = text_of(path).partition("Requested by output:")[2].splitlines()
    assert max(map(len, lines)) <= 80
    [reaction] = [line.split() for line in lines if "reaction_right_x" in line]
    assert reaction[1:3] == ["kN", "m⁻¹"]
    assert float(reaction[3]) > 1.0
    assert reaction[4] == "0"
    assert sum("───" in line for line in lines) == 1


def test_an_elastic_bond_is_not_said_to_slip(run: Run) -> None:
    assert contact_title(read_picture(run(PULLED))).endswith("elastic bond, which sticks nowhere")
