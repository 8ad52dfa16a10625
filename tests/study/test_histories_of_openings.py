"""Histories of bonds that open: a double cantilever that is opened, closed and opened further."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import xarray as xr

import tcstudy
from tcstudy.contact.history.steps import history
from tcstudy.contact.history.without_law import LawfulHistory, fast_history
from tcstudy.errors import StudyError
from tcstudy.read.study import read_study_text
from tcstudy.study.history_run import problem_of
from tcstudy.study.run import level_of
from tests.study.test_openings import COLUMN, DCB

ARM = DCB.replace("62 mm", "60 mm").replace(", closing: 5e12 Pa/m", "")
CYCLE = (
    "history={memory: damage, steps: [{boundary.left.u_y: 1.4 mm, in: 14}, "
    "{boundary.left.u_y: 0 mm, in: 7}, {boundary.left.u_y: 1.4 mm, in: 7}, "
    "{boundary.left.u_y: 2 mm, in: 6}]}"
)


def history_of(text: str, path: Path, *options: str) -> xr.Dataset:
    tcstudy.run(read_study_text(text, "study", list(options)), path)
    with xr.open_dataset(path) as data:
        data.load()
    assert np.all(data["status"] == 1), data["reason"].values
    return data


def test_a_double_cantilever_keeps_its_damage_and_closes(tmp_path: Path) -> None:
    """P(1.4 mm) is the same on the way out and back out, near 2.238196 N/mm; P(0) = 0."""
    path = tmp_path / "cycle.nc"
    data = history_of(ARM, path, CYCLE, "mesh.maxh=0.25 mm")
    force = data["force_left_y"].values
    out, closed, again, further = 14, 21, 28, 34
    assert force[out] == pytest.approx(2238.196, rel=0.03)
    assert force[again] == pytest.approx(force[out], rel=1e-9)
    assert force[closed] == pytest.approx(0.0, abs=1e-8 * force[out])
    work = np.cumsum(data["work"].values)
    dissipated = np.cumsum(data["dissipated"].values)
    released = np.cumsum(data["released"].values)
    lost = dissipated + released
    for step in (closed, again, further):
        bound = data["energy"].values[step] + data["stored"].values[step]
        assert work[step] == pytest.approx(bound + lost[step], rel=1e-9)
    assert work[closed] == pytest.approx(lost[closed], rel=1e-9)
    # the force times the way of the end gives the same, by the trapezoid of its steps
    end = data["u_y"].values
    assert np.trapezoid(force[: closed + 1], end[: closed + 1]) == pytest.approx(
        lost[closed], rel=0.02
    )
    # nothing breaks on the way back and out again; the crack front stays, then runs on
    assert dissipated[again] == pytest.approx(dissipated[out], rel=1e-9)
    front = data["debonded_to"].values
    np.testing.assert_allclose(front[out : again + 1], front[out], rtol=1e-9)
    assert front[further] > 2.0 * front[out] > 0.0
    np.testing.assert_allclose(data["debonded_length"][1:], np.nan_to_num(front[1:]), rtol=1e-12)
    assert data["opening_max"][closed] == pytest.approx(0.0, abs=1e-15)
    assert np.all(data["opening"] >= 0.0)
    assert np.all(np.diff(data["kappa_N"], axis=0) >= 0.0)
    kappa = data["kappa_N"].values[out]
    torn = kappa > 4e-6
    virgin = np.interp(kappa[torn], [0.0, 4e-6, 14e-6], [0.0, 20e6, 0.0])
    secant = data["S_N"].values[again][torn] / data["opening"].values[again][torn]
    np.testing.assert_allclose(secant, virgin / kappa[torn], rtol=1e-6, atol=1e3)


def test_a_history_goes_on_where_its_file_ends(tmp_path: Path) -> None:
    """The file of a shorter history gives the same steps, to the bit, as one that never stopped."""
    text = COLUMN.replace("MAXH", "0.3").replace("D", "0")
    options = ("material={E: 20, nu: 0.3}", "boundary.top.u_x=0.01")
    first = "{boundary.top.u_y: 0.2, in: 4}, {boundary.top.u_y: -0.1, in: 2}"
    short = f"history={{memory: damage, steps: [{first}]}}"
    long = short.replace("]}", ", {boundary.top.u_y: 0.25, in: 3}]}")
    whole = history_of(text, tmp_path / "whole.nc", long, *options)
    path = tmp_path / "resumed.nc"
    history_of(text, path, short, *options)
    resumed = history_of(text, path, long, *options)
    for name in ("u_T", "opening", "S_N", "kappa_N", "dissipation_N", "energy", "dissipated"):
        np.testing.assert_array_equal(resumed[name], whole[name], err_msg=name)


def test_slips_without_a_law_may_be_eliminated_before() -> None:
    """States, energies and works are those with all unknowns, also where a history goes on."""
    text = COLUMN.replace("MAXH", "0.3").replace("D", "0")
    steps = (
        "{boundary.top.u_y: 0.2, in: 4}, {boundary.top.u_y: -0.1, in: 2}, {boundary.top.u_y: 0.25}"
    )
    section = f"history={{memory: damage, steps: [{steps}]}}"
    study = read_study_text(
        text, "s", [section, "material={E: 20, nu: 0.3}", "boundary.top.u_x=0.01"]
    )
    assert study.history
    level = level_of(study, study.scenes[0], None)
    problem, loads = problem_of(study.history, level, study.scenes[0], None)
    expected = list(history(problem, loads))
    found = list(fast_history(problem, loads))
    resumed = list(fast_history(problem, loads[4:], found[3]))
    assert LawfulHistory.of(problem) is not None
    assert len(expected) == len(found) == len(loads)
    names = ("v", "xi", "kappa", "dissipation", "energy", "work", "stored", "dissipated", "load")
    for step, own in zip(expected[-4:] + expected, resumed + found, strict=True):
        assert own.solved
        for name in names:
            value = getattr(step, name)
            np.testing.assert_allclose(
                getattr(own, name), value, rtol=1e-9, atol=1e-11, err_msg=name
            )


def test_a_column_is_pulled_pressed_and_pulled_to_its_end(tmp_path: Path) -> None:
    """Uniform states E/H (d − s) = b(s; κ) with E/H = 20, soft enough to follow without a jump."""
    steps = ["0.14", "0.05", "-0.1", "0.14", "0.2", "0.5", "-0.2"]
    parts = ", ".join(f"{{boundary.top.u_y: {d}, in: 3}}" for d in steps)
    section = f"history={{memory: damage, steps: [{parts}]}}"
    text = COLUMN.replace("MAXH", "0.5").replace("D", "0")
    with pytest.raises(StudyError, match="write memory: damage"):
        read_study_text(text, "study", [section.replace("damage", "friction")])
    data = history_of(text, tmp_path / "column.nc", section, "material.E=20")
    kappa = 0.1
    for i, d in enumerate(map(float, steps), 1):
        softened = max(0.0, 5.0 * (0.3 - kappa))
        s = 20.0 * d / (20.0 + softened / kappa)
        if s > kappa:
            s = min((20.0 * d - 1.5) / 15.0, d) if 20.0 * d <= 6.0 else d
        s = max(s, 0.0)
        kappa = max(kappa, s)
        np.testing.assert_allclose(data["opening"][3 * i], s, atol=1e-12)
        np.testing.assert_allclose(data["S_N"][3 * i], 20.0 * (d - s), atol=1e-9)
    assert float(data["dissipated"].sum()) == pytest.approx(0.15, rel=1e-9)
    assert float(data["pressure_max"][-1]) == pytest.approx(4.0)
    assert float(data["debonded_length"][-1]) == pytest.approx(1.0)


def test_derivatives_of_steps_are_those_of_other_histories(tmp_path: Path) -> None:
    section = "history={memory: damage, steps: [{boundary.top.u_y: 0.2, in: 2}, {boundary.top.u_y: 0.1, in: 1}]}"
    options = ("material.E=20", "output.sensitivity=[adhesion.sigma]")
    text = COLUMN.replace("MAXH", "1").replace("D", "0")
    middle = history_of(text, tmp_path / "middle.nc", section, *options)
    other = [
        history_of(
            text, tmp_path / f"{sigma}.nc", section, "material.E=20", f"adhesion.sigma={sigma}"
        )
        for sigma in (1.001, 0.999)
    ]
    for quantity in ("opening_max", "peel_stress_max", "adhesion_resultant"):
        slope = (other[0][quantity] - other[1][quantity]) / 0.002
        own = middle[f"sensitivity_{quantity}_adhesion_sigma"]
        np.testing.assert_allclose(own[1:], slope[1:], rtol=1e-4, err_msg=quantity)
