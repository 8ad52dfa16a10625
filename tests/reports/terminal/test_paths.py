"""What of a path, of its loop and of a history is said."""

import numpy as np
import xarray as xr

from tcstudy.data.reading import asked, load_root
from tcstudy.reports.terminal.paths import (
    Unit,
    _ends,
    _loop,
    equilibria_by_interval,
    folds_of,
    history_verdict,
    path_verdict,
    sentences_of,
)
from tcstudy.reports.terminal.summary import text_of, verdict_of
from tcstudy.reports.text import with_unit
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
    [peak] = path_verdict(data).answer[:1]
    assert peak == "peak friction 7 kN m⁻¹ (mean 3.5 kPa), at u_x of grip = 1 mm"


def test_equilibria_are_counted_interval_by_interval() -> None:
    """A path that goes on to 3, back to 1, on to 5, back to 4, and on: 3 equilibria in two
    intervals, none of which joins the other."""
    t = np.array([0.0, 3.0, 1.0, 5.0, 4.0, 8.0])
    intervals = equilibria_by_interval(t[:-1], t[1:], 0.0, 6.0)
    assert intervals == [(0.0, 1.0, 1), (1.0, 3.0, 3), (3.0, 4.0, 1), (4.0, 5.0, 3), (5.0, 6.0, 1)]
    data = xr.Dataset(
        {
            "parameter": ("vertex", t, {"units": "1"}),
            "xi": (("vertex", "node"), t[:, None], {"units": "1"}),
            "c": ("node", [1.0]),
            "residual": ("vertex", 0.0 * t),
            "fold_vertex": ("fold", [1, 2, 3, 4]),
        },
        attrs={"parameter": "load", "parameter_range": [0.0, 6.0]},
    )
    assert (
        "up to 3 equilibria on it, for load from 1 to 3 and from 4 to 5"
        in path_verdict(data).answer
    )
    assert "snap-back 3 → 1 and 5 → 4" in path_verdict(data).answer
    # two more branches from 1.5 to 2 that the path does not meet, with every branch proved
    branch = np.concatenate([t, [1.5, 2.0, 1.5]])
    data = data.assign(
        complete=1,
        law_error=0.0,
        branch_of=("branch_vertex", [0, 0, 0, 0, 0, 0, 1, 1, 1]),
        branch_parameter=("branch_vertex", branch),
        branch_loop=("branch", [0, 1]),
        branch_on_path=("branch", [1, 0]),
        at=("at", [1.75]),
        at_complete=("at", [True]),
        solution_count=("at", [5]),
    )
    answer = path_verdict(data).answer
    assert "up to 5 equilibria in all (proved), for load from 1.5 to 2" in answer
    assert "1 isola that the path does not meet" in answer
    assert "equilibria in all, proved: 5 at load = 1.75" in answer


def test_a_path_without_a_segment_has_whole_sentences() -> None:
    data = xr.Dataset(
        {
            "parameter": ("vertex", [0.0], {"units": "1"}),
            "xi": (("vertex", "node"), [[0.0]], {"units": "1"}),
            "c": ("node", [1.0]),
            "residual": ("vertex", [0.0]),
        },
        attrs={
            "parameter": "load",
            "parameter_range": [0.0, 1.0],
            "shortfalls": "the path ends early, at 0: it is stuck; raise the tolerance",
        },
    )
    verdict = path_verdict(data)
    assert verdict.fields == {
        "solved": ("0 segments",),
        "reason": ("the path ends early, at 0: it is stuck",),
        "fix": ("raise the tolerance",),
        "answer": ("no path: it ends where it begins, at load = 0",),
    }


def test_the_largest_jump_of_a_loop_is_named() -> None:
    t = np.linspace(1.0, 2.5, 15)
    jumps = {"jump_parameter": t, "jump_rising": (t < 2.5).astype(int), "jump_drop": t}
    data = xr.Dataset({name: ("jump", values) for name, values in jumps.items()})
    data = data.assign(energy_lost=((), 30.0, {"units": "J m-1"}), loop_complete=1, loop_closed=1)
    told = "hysteresis loop: 30 J m⁻¹ lost in 15 jumps at turns of any size, at most 2.5 J m⁻¹ at 2.5 (falling)"
    assert _loop(data, Unit(1.0, "")) == f"  {told}"
    assert _loop(data.assign(loop_closed=0), Unit(1.0, "")) == f"  {told}; it does not close"


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


def test_a_history_names_its_peak_friction_and_its_step(stored: Stored) -> None:
    data = load_root(stored("history"))
    friction = np.abs(data["friction_resultant"].values)
    peak = friction.max()
    steps = np.argwhere(friction >= (1.0 - 1e-9) * peak)[:, -1]
    names = [str(data["step_name"].values[step]) or str(step) for step in steps]
    [sentence] = [fact for fact in history_verdict(data).answer if "peak friction" in fact]
    assert with_unit(peak, str(data["friction_resultant"].attrs["units"])) in sentence
    assert any(f"at step {name}" in sentence for name in names)
    without = data.assign(friction_resultant=0.0 * data["friction_resultant"])
    assert not any("peak" in fact for fact in history_verdict(without).answer)


def test_both_ends_of_a_path_are_told_with_their_reasons() -> None:
    """Equal reasons once; the start of a path beyond its range is an end like the other."""
    data = xr.Dataset({"parameter": ("vertex", [-1.2, 0.0, 3.0])})
    data.attrs |= {"begin_reason": "range", "end_reason": "range"}
    assert [*_ends(data, Unit(1.0, "mm"))] == [
        "  followed both ways, to -1.2 mm and to 3 mm: range"
    ]
    data.attrs["end_reason"] = "stuck"
    assert [*_ends(data, Unit(1.0, "mm"))] == [
        "  followed backwards to -1.2 mm: range",
        "  followed forwards to 3 mm: stuck",
    ]


# -- contact that may open


def test_a_path_of_a_peel_test_names_its_peak_force_and_opening(stored: Stored) -> None:
    """The column peels at d = 1.1, where s = 0.1 and S_N = 1; beyond the bond s = d."""
    answer = verdict_of(stored("lifted")).answer
    assert answer[0] == "peak peel force 1, at u_y of top = 1.1"
    assert answer[1] == "the crack in the bond grows to 1, at u_y of top = 1.5"
    assert answer[2] == "largest opening 1.5 at u_y of top = 1.5"
    assert answer[3] == "snap-back 1.1 → 0.3"


def test_a_history_of_an_opening_names_it_first_and_its_force(stored: Stored) -> None:
    """At d = 0.7, s = d / 11."""
    answer = verdict_of(stored("raised")).answer
    assert answer[0] == "largest opening 1.5 at step off"
    assert answer[1].startswith("peak peel force 0.6818 at step")
    assert not any("slip" in fact or "friction" in fact for fact in answer)
    text = text_of(stored("raised"))
    [up] = [line.split() for line in text.splitlines() if line.strip().startswith("up ")]
    assert up[:5] == ["up", "1", "0.7", "0.0636364", "0.636364"]
