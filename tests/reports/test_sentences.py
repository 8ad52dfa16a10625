"""Every sentence where it is true and where it nearly is."""

import numpy as np
import pytest

from tcstudy.reports import sentences as said
from tcstudy.reports.text import answered

NAN = float("nan")


@pytest.mark.parametrize(
    ("sentence", "words"),
    [
        (said.order(1.234, 0.05), "1.23 ± 0.05"),
        (said.order(1.234, NAN), "1.23?"),
        (answered(["peak 2 MPa", "", "3 equilibria"], ["residual 1e-15"], []),
         "Peak 2 MPa; 3 equilibria. Residual 1e-15."),
    ],
)  # fmt: skip
def test_words(sentence: str, words: str) -> None:
    assert sentence == words


@pytest.mark.parametrize(
    ("verdicts", "words"),
    [
        ([], ["no order is measured: there is no reference"]),
        (
            [("u", "too_few_levels")] * 3 + [("ξ", "exact")],
            ["no order can be judged: 3 have only two levels, 1 error is rounding"],
        ),
        ([("u", "as_expected"), ("ξ", "faster")], ["2 of 2 orders are as expected or better"]),
        (
            [("u", "slower"), ("u", "faster"), ("ξ", "pre_asymptotic"), ("ξ", "exact"), ("v", "unknown")],
            [
                "1 of 3 orders are as expected or better",
                "1 slower than expected: u",
                "1 pre-asymptotic (rates still vary): ξ",
                "not judged: 1 error is rounding, 1 has corners that are not analysed",
            ],
        ),
    ],
)  # fmt: skip
def test_only_orders_that_can_be_judged_count(
    verdicts: list[tuple[str, str]], words: list[str]
) -> None:
    assert said.orders(verdicts) == words


@pytest.mark.parametrize(
    ("share", "words"),
    [(0.256, "26 %"), (0.1, "10 %"), (0.0999, "10 %"), (0.0123, "1.2 %"), (1e-6, "0.0001 %"),
     (9.9e-7, "9.9e-07"), (1.5, "150 %")],
)  # fmt: skip
def test_a_share_has_two_digits(share: float, words: str) -> None:
    assert said.percent(share) == words


def test_lengths_are_a_range_or_a_limit() -> None:
    spans = {"slip": (2e-3, 0.2), "debonded": (0.0, 0.0153)}
    assert said.slip_lengths(spans, "m") == "slip length 2 to 200 mm, debonded length up to 15.3 mm"
    assert said.slip_lengths({}, "m") == ""


def test_a_number_of_equilibria_is_proved_or_at_least() -> None:
    assert said.equilibria(3) == "3"
    assert said.equilibria(3, complete=0) == "at least 3"
    assert said.equilibria(3, 2) == "3, 2 stable"
    assert said.equilibria(1, 1) == "1"


@pytest.mark.parametrize(
    ("count", "complete", "words"),
    [
        ([], [], ""),
        ([3, 5], [0, 0], "all equilibria proved at 0 of 2"),
        ([3, 5], [1, 0], "all equilibria proved at 1 of 2 (3 each)"),
        ([3, 3], [1, 1], "all equilibria proved at 2 of 2 (3 each)"),
        ([3, 5], [1, 1], "all equilibria proved at 2 of 2 (3 to 5)"),
        (
            [3, 5],
            [2, 1],
            "all equilibria proved at 2 of 2 (3 to 5) of the piecewise-linear approximations of "
            "exponential laws",
        ),
    ],
)  # fmt: skip
def test_how_many_equilibria_are_proved_to_be_all(
    count: list[int], complete: list[int], words: str
) -> None:
    assert said.all_equilibria(np.array(count), np.array(complete)) == words


def test_only_energies_beyond_rounding_leave_the_branch_from_rest() -> None:
    energy = np.array([[-1.0, -1.0 - 1e-10], [-1.0, -1.1]])
    assert not said.from_rest_left(energy, np.array([True, False]))
    assert said.from_rest_left(energy, np.array([True, True]))
    assert not said.from_rest_left(energy[:, ::-1], np.array([True, True]))
    assert not said.from_rest_left(np.array([[-1.0, np.nan]]), np.array([True]))


def test_more_than_one_solution_is_no_rounding_and_a_proof_outweighs_what_a_start_left_over() -> (
    None
):
    energy = np.stack([-np.ones(4), [-1.1, -1.0 - 1e-10, -1.1, NAN]], axis=1)
    assert said.several(energy, np.array([False, False, True, False])).tolist() == [
        True,
        False,
        False,
        False,
    ]


@pytest.mark.parametrize(
    ("ends", "spent", "kind", "words"),
    [
        (
            [1.0, 1.0, 1.0],
            [0.0, 0.0],
            "shakedown",
            "shakedown: the last cycle leaves the slips as they were",
        ),
        (
            [1.0, 1.0, 1.0],
            [1.0, 1.0],
            "closed",
            "plastic shakedown: the last two cycles dissipate the same and leave no",
        ),
        (
            [1.0, 1.2, 1.2],
            [1.0, 1.0],
            "closed",
            "plastic shakedown: the last cycle leaves no net slip",
        ),  # the first did
        (
            [1.0, 1.1, 1.2],
            [1.0, 1.0],
            "walking",
            "walking: the last two cycles each moved the whole contact line by",
        ),
        (
            [1.0, 1.1, 1.3],
            [1.0, 1.0],
            "settling",
            "no steady cycle: the last cycle changed slips by up to 0.2",
        ),
        (
            [1.0, 1.1, 1.1 + 1e-7],
            [1.0, 1.0],
            "settled",
            "steady cycle: the last cycle changed slips by at most 9e-08",
        ),
        ([1.0, 1.1, 1.1 + 3e-6], [1.0, 1.0], "settling", "no steady cycle"),
        (
            [1.0, 1.0 + 1e-7, 1.0 + 2e-7],
            [1.0, 1.0],
            "walking",
            "walking",
        ),  # small, but the same in every cycle
        ([1.0, 1.1], [1.0], "", ""),
    ],
)
def test_what_cycles_change(ends: list[float], spent: list[float], kind: str, words: str) -> None:
    found, sentence = said.cycle_change(
        np.array(ends)[:, None] * np.ones(2), np.array(spent), ("1", "1"), rounding=1e-12
    )
    assert found == kind
    assert sentence.startswith(words)
    assert not kind or kind in said.KINDS


def test_what_is_proved_of_the_body_itself() -> None:
    low, high = np.array([0.41, np.nan]), np.array([0.42, np.nan])
    words = said.of_the_body(low, high, np.array([True, False]), "Pa m-1", "band")
    assert words.startswith(
        "λ₁ of the body itself lies between 410 mPa m⁻¹ and 420 mPa m⁻¹: one solution for ω below 410"
    )
    assert words.endswith("; so at this point")
    several = said.of_the_body(
        np.array([0.4, 0.8]), np.array([0.5, 0.9]), np.array([False, True]), "Pa m-1", "polygon"
    )
    assert several.startswith("λ₁ of the polygon that the mesh has is least between 400")
    assert several.endswith("so at 1 of 2 points")
    assert "so at" not in said.of_the_body(low, high, np.array([False, False]), "Pa m-1", "band")
    assert said.of_the_body(low[1:], high[1:], np.array([False]), "Pa m-1", "band") == ""


def test_the_ends_of_a_proved_range_are_rounded_outwards() -> None:
    low, high = np.array([4.11222e6]), np.array([4.11239e6])
    words = said.of_the_body(low, high, np.array([False]), "Pa m-1", "band")
    assert "between 4.112 MPa m⁻¹ and 4.113 MPa m⁻¹" in words


def test_a_mesh_locks_where_its_lambda_1_is_far_above_that_of_equilibrium_elements() -> None:
    assert said.too_stiff(np.array([1.09]), np.array([1.0])) == ""
    assert said.too_stiff(np.array([np.nan]), np.array([np.nan])) == ""
    text = said.too_stiff(np.array([0.967, 1.0]), np.array([0.493, 1.0]))
    # a coarse mesh is too stiff without locking, whatever ν
    assert text.startswith("the mesh is too stiff (coarse, or locking for ν near ½)")
    assert "up to 1.96 times" in text
