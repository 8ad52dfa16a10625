"""What of a path, of its loop and of a history is said."""

import numpy as np
import xarray as xr

from tcstudy.data.reading import asked, load_root
from tcstudy.reports.terminal.paths import _loop, folds_of, path_verdict, sentences_of
from tests.reports.conftest import Stored


def test_small_turns_of_an_old_file_are_no_folds() -> None:
    sizes = [0.3, 1e-3, 1e-3, 0.3]
    folds = {"fold_vertex": ("fold", np.arange(4)), "fold_size": ("fold", np.array(sizes))}
    data = xr.Dataset(folds, attrs={"parameter_range": [0.0, -2.0]})
    assert folds_of(data).tolist() == [0, 3]
    assert folds_of(data.drop_vars("fold_size")).tolist() == [0, 1, 2, 3]


def test_the_peak_is_said_as_a_force_and_in_the_mean() -> None:
    """2 and 4 kPa on cells of 0.5 and 1.5 m: 7 kN a metre, 3.5 kPa in the mean; outside the range
    nothing counts."""
    data = xr.Dataset(
        {
            "parameter": ("vertex", [0.0, 1e-3, 2e-3], {"units": "m"}),
            "xi": (("vertex", "node"), [[0.0, 0.0], [2e3, 4e3], [9e3, 9e3]], {"units": "Pa"}),
            "c": ("node", [0.5, 1.5]),
            "residual": ("vertex", [0.0, 1e-12, 1e-12]),
        },
        attrs={"parameter": "boundary.grip.u_x", "parameter_range": [0.0, 1e-3]},
    )
    assert path_verdict(data)[0].startswith("Peak ∫ξ 7 kN m⁻¹, 3.5 kPa in the mean, at u_x = 1 mm")


def test_the_largest_fall_of_a_loop_is_named() -> None:
    t = np.linspace(1.0, 2.5, 15)
    jumps = {"jump_parameter": t, "jump_rising": (t < 2.5).astype(int), "jump_drop": t}
    data = xr.Dataset({name: ("jump", values) for name, values in jumps.items()})
    data = data.assign(energy_lost=((), 30.0, {"units": "J m-1"}), loop_complete=1, loop_closed=1)
    told = "hysteresis loop: 30 J m⁻¹ lost in 15 falls, at most 2.5 J m⁻¹ at 2.5 (falling)"
    assert _loop(data, str) == f"  {told}"
    assert _loop(data.assign(loop_closed=0), str) == f"  {told}; it does not close"


def test_energy_that_finite_steps_miss_is_said_where_it_counts(stored: Stored) -> None:
    part = load_root(stored("history")).isel(tau=0, E=0).copy(deep=True)
    assert not any("finite steps" in one for one in sentences_of(part))
    part["closure"].values[3] = -0.25 * part["dissipated"].values.sum()
    assert "finite steps miss 25 % of the energy dissipated; take more steps" in sentences_of(part)


def test_a_load_of_a_history_is_no_number_that_was_asked_for() -> None:
    names = ("force_x", "force_end_x")
    assert asked(xr.Dataset(dict.fromkeys(names, 0.0), attrs={"loads": "force_x theta"})) == [
        "force_end_x"
    ]
