"""What stands in pages of histories, fits and sweeps over geometries, how large they are, and that states are data."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from tcstudy.data.reading import by_point
from tcstudy.reports.page import write
from tcstudy.reports.page.parts import words
from tcstudy.reports.page.stored import read
from tcstudy.reports.page.write import write_page
from tcstudy.reports.terminal.path_summary import STATES
from tcstudy.scene.contact_states import ContactState
from tests.reports.page.unpacked import data_of


def test_a_history_has_its_steps_and_a_sweep_of_totals(history: Path) -> None:
    found, data = data_of(write_page(history, history.with_suffix(".html")).path), read(history).data
    u = by_point(data["u_T"], data)
    total = data["dissipated"].sum("step").values.ravel()
    np.testing.assert_allclose(found["run"]["numbers"]["dissipated"]["v"], total, rtol=1e-12)
    assert [axis["name"] for axis in found["run"]["axes"]] == ["tau", "E"]
    for p, own in enumerate(found["steps"]):
        (sheet,) = own["table"]
        spent = next(one["v"] for one in sheet["columns"] if one["name"] == "dissipated")
        np.testing.assert_array_equal(spent, by_point(data["dissipated"], data)[p])
        line = own["point"][-1]["parts"][0]
        shown = line["line"]["u_T"]["rows"] * line["line"]["u_T"]["scale"][:, None]
        assert np.max(np.abs(shown - u[p])) <= 1e-4 * np.max(np.abs(u[p]))
        moved, largest = np.diff(u[p], axis=0), np.abs(u[p]).max()
        assert np.all(line["state"][1:][moved > 1e-8 * largest] == 1)
        assert np.all(line["state"][1:][moved < -1e-8 * largest] == 2)
        assert np.all(line["state"][1:][np.abs(moved) < 1e-10 * largest] == 0)
    assert found["verdict"]["text"].endswith("6 of 6 histories of 16 steps in 2 cycles followed to their end.")


def test_a_stopped_history_says_how_far_it_came(history: Path) -> None:
    stored = read(history)
    data = stored.data.copy(deep=True)
    data["status"].values[1, 0, 5:] = 0
    data["reason"].values[1, 0] = "the energy falls for ever"
    text = write.page(replace(stored, data=data))
    assert "5 of 6 histories" in text


def test_a_thousand_steps_fit_in_two_megabytes(history: Path) -> None:
    """200 nodes whose slips are noise, which no compression makes smaller."""
    stored = read(history)
    one = stored.data.isel(tau=0, E=0).isel(step=np.arange(1000) % 17, node=np.arange(200) % 16)
    noise = np.random.default_rng(3).normal(size=(1000, 200))
    data = one.assign({name: (one[name].dims, noise, one[name].attrs) for name in ("u_T", "xi", "kappa")})
    text = write._fitting(replace(stored, data=data.drop_vars(["tau", "E"])), without := [])
    assert len(text) <= 2_000_000
    assert set(without) <= {"memory"}


def test_every_geometry_has_its_own_line_and_body(pads: Path) -> None:
    found = data_of(write_page(pads, pads.with_suffix(".html")).path)
    data = read(pads).data
    order = [str(dim) for dim in data["status"].dims[:-1]]
    heights = {axis["name"]: axis["values"] for axis in found["run"]["axes"]}["height"]
    at = order.index("height")
    for p, home in enumerate(found["run"]["home"]):
        height = heights[np.unravel_index(p, found["run"]["shape"])[at]]
        own = found["homes"][home]
        assert max(y for edge in own["outline"] for _, y in edge["line"]) == pytest.approx(height)
        assert own["body"]["y"].max() == pytest.approx(height, rel=1e-6)
        largest = np.abs(own["lines"]["1"]["u_T"]["rows"] * own["lines"]["1"]["u_T"]["scale"][:, None]).max(axis=1)
        place = [q for q, other in enumerate(found["run"]["home"]) if other == home].index(p)
        assert largest[place] == pytest.approx(found["run"]["numbers"]["u_T_max"]["v"][p, 1], rel=1e-4)
    assert found["verdict"]["text"].startswith("3 geometries: Largest slip")


def test_states_of_nodes_stand_in_the_data(result: Path) -> None:
    """The page draws what the law says of every node; it has no rule of its own."""
    found = data_of(write_page(result, result.with_suffix(".html")).path)
    assert found["states"] == list(STATES)
    line, tree = found["lines"]["1"], xr.open_datatree(result)
    u = tree["level_1"]["u_T"].values.reshape(6, -1)
    sticks = tree["level_1"]["sticks"].values.reshape(6, -1) == 1
    plain, weak = line["state"][0::2], line["state"][1::2]
    assert set(np.unique(plain)) <= {ContactState.STICK, ContactState.SLIP}
    expected = np.where(np.abs(u[1::2]) < 40e-6, ContactState.SOFTEN, ContactState.WEAKENED)
    np.testing.assert_array_equal(weak, np.where(sticks[1::2], ContactState.STICK, expected))
    assert np.any(weak != ContactState.STICK)
    tree.close()


def test_labels_of_pictures_are_plain_text() -> None:
    assert words(r"max $|u_T|$ of $\\bar\\theta$ [K]".replace("\\\\", "\\")) == "max |u_T| of θ̄ [K]"
    assert words(r"$\int\xi\,$ds for \$5, $N^{-0.35}$") == "∫ξds for $5, N^-0.35"
