"""The sentence on a run, and where the slip jumps."""

from itertools import count
from typing import Any

import netCDF4
import numpy as np
import pytest

from tcstudy.reports.sentences import (
    HOW,
    RunSeen,
    abrupt,
    contraction_words,
    mesh_error,
    no_loading_curve,
    open_ranges,
    proof_classes,
    run_verdict,
)
from tcstudy.reports.terminal.summary import verdict_of
from tcstudy.reports.text import Verdict
from tests.reports.conftest import REASON, Stored


def test_a_file_says_what_slips_and_last_how_many_points_are_solved(stored: Stored) -> None:
    verdict = verdict_of(stored("failed"))
    assert list(verdict.fields) == ["solved", "reason", "fix", "answer", "trust", "accuracy"]
    assert verdict.answer[0].startswith("largest slip")
    assert verdict.solved[0].startswith("5 of 6 points, 2 levels; 1 failed; residual")
    assert verdict.reason[0].startswith(f"singular: {REASON}")
    assert not verdict.complete
    assert "reason" not in verdict_of(stored("block")).fields


def test_classes_of_proof_are_exclusive_and_add_up() -> None:
    """Whatever is proved unique is a global and a local minimum, too."""
    flags = {
        "unique": np.array([True, False, False, False, False]),
        "global_minimum": np.array([True, True, False, False, True]),
        "strict_minimum": np.array([True, True, True, False, True]),
    }
    solved = np.array([True, True, True, True, False])
    assert proof_classes(flags, solved) == (
        "1 unique, 1 global minimum, 1 local minimum, 1 without certificate"
    )


NUMBER = count()


def seen(dims: dict[str, list[Any]], levels: int = 1, xi: float = 0.0, **values: Any) -> RunSeen:
    """A file in memory with values (*dims, level) of a grid that is solved everywhere, and ∫|ξ| of
    its one point."""
    nc = netCDF4.Dataset(f"run {next(NUMBER)}.nc", "w", diskless=True)  # one of a name may be open
    nc.sweep_mode = "grid"
    nc.createDimension("level", levels)
    for name, labels in dims.items():
        nc.createDimension(name, len(labels))
        text = isinstance(labels[0], str)
        one = nc.createVariable(name, str if text else "f8", (name,))
        one[:], one.units = np.array(labels, dtype=object if text else float), "1" if text else "K"
    for name, value in {"status": np.ones([*map(len, dims.values()), levels]), **values}.items():
        one = nc.createVariable(name, "f8", (*dims, "level"))
        one[:], one.units = value, "1"
    line = nc.createGroup(f"level_{levels - 1}")
    line.createDimension("node", 1)
    for name, value in (("xi", xi), ("c", 1.0)):
        line.createVariable(name, "f8", ("node",))[:] = value
    return RunSeen(nc)


def _run(slip: Any) -> RunSeen:
    """A grid of slips over θ̄, and over a text before it."""
    values = np.asarray(slip, dtype=float)
    laws = {"friction": [f"law {i}" for i in range(len(values))]} if values.ndim > 1 else {}
    return seen(laws | {"theta_bar": list(range(values.shape[-1]))}, u_T_max=values[..., None])


@pytest.mark.parametrize(
    ("slip", "said"),
    [
        ([0.0, 1.0, 2.0, 9.0, 10.0, 11.0], ["between θ̄ = 2 and 3 K"]),
        ([0.0, 1.0, 2.0, 3.0, 4.0, 5.0], []),
        ([10.0, 10.1, 10.1, 10.9, 10.9, 11.0], []),
        (
            [[0.0, 1.0, 2.0, 9.0, 10.0], [0.0, 1.0, 20.0, 21.0, 22.0]],
            ["between θ̄ = 1 and 2 K (friction: law 1)"],
        ),
        (
            [[0.0, 1.0, 2.0, 9.0, 10.0], [0.0, 1.0, np.nan, 21.0, 22.0]],
            ["between θ̄ = 2 and 3 K (friction: law 0)"],
        ),
    ],
)
def test_an_abrupt_change_is_told_from_a_slope(slip: Any, said: list[str]) -> None:
    places = [
        one.partition("between")[2]
        for one in abrupt(_run(slip), np.zeros(np.shape(slip), dtype=bool))
    ]
    assert places == [one.removeprefix("between") for one in said]


def test_a_jump_is_said_where_two_solutions_were_seen() -> None:
    """At one end of the step; at the next point it does not count."""
    run = _run([0.0, 1.0, 2.0, 9.0, 10.0, 11.0])
    for several, said in ((3, "slip jumps between"), (4, "slip changes by 7 between")):
        assert abrupt(run, np.arange(6) == several)[0].startswith(said)


@pytest.mark.parametrize(
    ("numbers", "friction", "error", "how"),
    [
        ({"friction_resultant": [90.0, 100.0]}, 100.0, "last refinement changed ∫ξ by 10 %", "change"),
        # by symmetry: nothing of nothing
        ({"friction_resultant": [-3e-12, 1e-12]}, 50.0, "last refinement changed ∫ξ by 8.0e-14", "change"),
        ({"friction_resultant": [0.0, 0.0]}, 0.0, "", "no change"),
        # equilibrium fixes ∫ξ, the slip tells
        ({"friction_resultant": [50.0, 50.0], "energy": [-9.9, -10.0], "u_T_max": [9.8, 10.0]}, 50.0,
         "last refinement changed max |u_T| by 2 %", "change"),
        ({"friction_resultant": [50.0, 50.0], "energy": [-9.5, -10.0], "u_T_max": [9.8, 10.0]}, 50.0,
         "last refinement changed energy by 5 %", "change"),
        ({"energy": [-9.5, -10.0], "u_T_max": [1.0, 10.0]}, 0.0, "last refinement changed max |u_T| by 90 %",
         "change"),
        ({"u_T_max": [0.0, 10.0]}, 0.0, "mesh too coarse for the order of magnitude of max |u_T|", "change"),
        # slips that so small a stress causes are rounding
        ({"energy": [-9.9, -10.0], "u_T_max": [3e-10, 1e-10], "shear_max": [1.0, 1.0], "lambda_1": [2.0, 2.0]}, 0.0,
         "last refinement changed energy by 1 %", "change"),
        ({"error_estimate": [0.3, 0.26]}, 0.0, "mesh error about 26 %", "energy"),
        ({"error_estimate": [0.3, 1.2]}, 0.0, "mesh too coarse for the order of magnitude", "energy"),
        ({"error_estimate": [0.3, 0.26], "goal": [9.0, 10.0], "goal_estimate": [0.9, 0.5]}, 0.0, "mesh error about 5 %",
         "goal"),
        ({"goal": [9.0, 1e-9], "goal_estimate": [0.9, 0.1]}, 0.0, "the goal no larger than its mesh error at 1",
         "goal"),
    ],
)  # fmt: skip
def test_a_mesh_error_is_relative_to_what_there_is(
    numbers: dict[str, list[float]], friction: float, error: str, how: str
) -> None:
    """Two levels of one point."""
    assert mesh_error(seen({}, 2, friction, **numbers)) == (error, HOW[how])


def test_a_point_where_next_to_nothing_happens_is_no_mesh_error() -> None:
    """All debonded, ∫ξ is rounding; a slip that begins is compared with the others."""
    run = seen({"theta_bar": [0, 1]}, 2, friction_resultant=[[90.0, 100.0], [1e-13, 3e-13]])
    run.friction = lambda place: [100.0, 4e-13][place[0]]  # type: ignore[method-assign]
    assert mesh_error(run)[0] == "last refinement changed ∫ξ by at most 10 % (at θ̄ = 0 K)"
    run = seen({"theta_bar": [0, 1]}, 2, u_T_max=[[9.5, 10.0], [0.0, 2e-3]])
    assert mesh_error(run)[0] == "last refinement changed max |u_T| by at most 20 % (at θ̄ = 1 K)"


@pytest.mark.parametrize(
    ("from_zero", "lowest", "branch", "words"),
    [
        ([1.0, 2.0, 3.0], [1.0, 2.0, 2.5], "lowest", "not the loading curve over θ̄"),
        (
            [1.0, 2.0, 3.0],
            [1.0, 2.5, 3.5],
            "lowest",
            "the lowest energy found need not be the loading",
        ),
        ([1.0, 2.0, 3.0], [1.0, 2.0, 3.0], "lowest", ""),
        ([1.0, 2.0, 3.0], [1.0, 2.0, 2.5], "continued", ""),
    ],
)
def test_least_energy_is_not_called_the_loading_curve(
    from_zero: list[float], lowest: list[float], branch: str, words: str
) -> None:
    """Energies to which the starts lead; the second start may find less than that from zero."""
    run = _run([1.0, 2.0, 3.0])
    energy = np.stack([from_zero, lowest], axis=-1)
    run.take = lambda name, level=-1: energy if name == "start_energy" else None  # type: ignore
    run.nc.solver_branch, run.nc.swept_loads = branch, "theta_bar"
    ambiguous = energy[:, 0] != energy[:, 1]
    sentences = no_loading_curve(run, ambiguous)
    assert [sentence.startswith(words) for sentence in sentences] == ([True] if words else [])
    assert all("branch: continued or path:" in sentence for sentence in sentences)
    run.nc.swept_loads = ""
    assert no_loading_curve(run, ambiguous) == []


def verdict_on(dims: dict[str, list[Any]], levels: int = 1, **values: Any) -> Verdict:
    """The verdict of a file in memory; flags of proofs are 0 unless given."""
    proofs = dict.fromkeys(("unique", "global_minimum", "strict_minimum"), 0)
    return run_verdict(seen(dims, levels, **{**proofs, **values}).nc)


def test_a_sweep_names_its_largest_slip_and_the_fewest_lengths() -> None:
    values = {
        "u_T_max": [[1.0], [3.0], [2.0]],
        "slip_length": [[0.0], [4.0], [5.0]],
        "debonded_length": [[1.0], [2.0], [np.nan]],
        "softening_length": [[1.0], [1.0], [1.0]],
        "yielded_length": [[1.0], [1.0], [1.0]],
        "unique": [[1], [0], [0]],
        "strict_minimum": [[1], [1], [0]],
        "inclusion_residual": [[1e-12], [2e-12], [np.nan]],
    }
    verdict = verdict_on({"theta_bar": [0, 10, 20]}, **values)
    largest, lengths = verdict.answer
    assert largest == "largest slip 3 at θ̄ = 10 K"
    assert lengths == "slip length up to 5, debonded length 1 to 2"
    assert verdict.trust == ("1 unique, 1 local minimum, 1 without certificate (this mesh)",)
    assert verdict.accuracy == ("not estimated: one mesh",)
    assert verdict.solved == ("3 of 3 points; residual ≤ 2e-12",)
    assert verdict.complete
    only_yielded = {
        name: values[name] for name in ("u_T_max", "softening_length", "yielded_length")
    }
    [_, lengths] = verdict_on({"theta_bar": [0, 10, 20]}, **only_yielded).answer
    assert lengths == "yielded length 1"


def test_one_point_names_all_lengths_and_its_largest_shear() -> None:
    verdict = verdict_on(
        {},
        2,
        u_T_max=[2.0, 3.0],
        slip_length=[1.0, 4.0],
        softening_length=[1.0, 2.0],
        shear_max=[1.0, 5.0],
        shear_max_at=[1.0, 0.5],
        proved_unique=[0, 1],
        unique=[1, 1],
        error_bound_relative=[0.9, 0.04],
    )
    assert verdict.answer == (
        "largest slip 3",
        "slip length 4, softening length 2",
        "largest shear 5 at s = 0.5",
    )
    assert verdict.trust == ("1 unique (this mesh)", "1 of 1 unique for the body itself")
    assert verdict.accuracy[-1] == "error of u proved to be at most 4 %"
    assert verdict.solved == ("1 of 1 point, 2 levels",)
    assert verdict_on({}, u_T_max=[0.0]).answer == ("nothing slips",)


def test_points_that_are_not_run_or_fail_on_coarse_levels_are_counted() -> None:
    reasons = {"status": [[2, 1], [1, 1], [0, 0], [1, 2]]}
    run = seen({"theta_bar": [0, 10, 20, 30]}, 2, **reasons)
    stored = run.nc.createVariable("reason", str, ("theta_bar", "level"))
    stored[:] = np.full((4, 2), "it failed; mend it", dtype=object)
    for name in ("unique", "global_minimum", "strict_minimum"):
        run.nc.createVariable(name, "f8", ("theta_bar", "level"))[:] = 1
    verdict = run_verdict(run.nc)
    assert verdict.solved == (
        "2 of 4 points, 2 levels; 2 failed, 1 on coarser levels only; 1 not run",
    )
    assert verdict.reason[0].endswith("it failed (for example θ̄ = 0 K)")
    assert verdict.fix == ("mend it",)
    assert not verdict.complete


def test_several_solutions_are_named_where_more_than_one_was_found() -> None:
    dims: dict[str, list[Any]] = {"theta_bar": [0, 10]}
    counted = verdict_on(dims, u_T_max=[[1.0], [2.0]], solutions=[[1], [3]], complete=[[1], [0]])
    assert "several solutions found at 1 point" in counted.trust
    assert any(fact.startswith("all equilibria proved at 1 of 2") for fact in counted.trust)
    alone = verdict_on(dims, u_T_max=[[1.0], [2.0]], solutions=[[1], [1]], complete=[[1], [1]])
    assert not any("several" in fact for fact in alone.trust)


# -- edges that open


def test_a_run_says_first_where_and_how_far_a_body_lifts_off(stored: Stored) -> None:
    answer = verdict_of(stored("curl")).answer
    with netCDF4.Dataset(stored("curl")) as nc:
        length, opening = nc["opened_length"][:, 0], nc["opening_max"][:, 0]
        pressure = nc["pressure_max"][:, 0].max()
    assert answer[0].startswith(
        f"lifts off over {length[0]:.4g} to {length[1]:.4g} m (longest at θ"
    )
    assert answer[1] == f"largest opening {1e6 * opening[0]:.4g} µm at θ: -50*(y - 0.1)"
    assert answer[2] == f"pressed with at most {1e-3 * pressure:.4g} kPa"
    assert not any("shear" in fact for fact in answer)


def test_what_has_debonded_of_a_bond_that_opens_is_its_crack(stored: Stored) -> None:
    answer = verdict_of(stored("arm")).answer
    with netCDF4.Dataset(stored("arm")) as nc:
        crack, peel = nc["debonded_length"][0], nc["peel_stress_max"][0]
    assert answer[0] == f"the crack in the bond is {1e3 * crack:.4g} mm long"
    assert answer[2].startswith(f"largest peel stress {1e-6 * peel:.4g} MPa, pressed with at most")
    assert not any("debonded" in fact for fact in answer)


def test_friction_of_the_pressure_is_unique_where_it_contracts_and_has_no_energy(
    stored: Stored,
) -> None:
    verdict = verdict_of(stored("pressed"))
    with netCDF4.Dataset(stored("pressed")) as nc:
        low, high = nc["contraction"][:, 0]
    assert low < 1.0 < high
    assert verdict.trust == (
        "1 unique, 1 without certificate (this mesh)",
        "friction follows the pressure: there is no energy to be least",
        f"bound of the contraction {low:.2g} to {high:.2g}: unique below 1",
    )
    assert verdict.answer[0] == "nothing lifts off"


@pytest.mark.parametrize(
    ("opening", "words"),
    [
        ([0, 0, 1, 1], "at one end"),
        ([1, 0, 0, 1], "at both ends"),
        ([0, 1, 1, 0], "between its ends"),
        ([0, 1, 0, 1], "at 2 places"),
        ([1, 1, 1, 1], "everywhere"),
    ],
)
def test_places_of_openings_are_told(opening: list[int], words: str) -> None:
    is_open = np.array(opening, dtype=bool)
    edge = np.zeros(4, dtype=int)
    assert open_ranges(is_open, edge, ["base"]) == words
    with_another = np.append(is_open, False), np.append(edge, 1)
    assert open_ranges(*with_another, ["base", "side"]) == f"{words} (base)"


def test_contractions_without_a_bound_prove_nothing() -> None:
    assert contraction_words(np.array([np.nan])).startswith("no bound of the contraction")
    assert contraction_words(np.array([0.5, np.nan])).endswith("0.5: unique below 1, none at 1")
