"""Certificates against exhaustive search: nothing that is certified may be contradicted."""

from dataclasses import astuple

import numpy as np
import pytest

from tcstudy.contact.certificates import (
    as_row,
    bends_below_tangent,
    certify,
    certify_rows,
    definite,
    energy_reach,
    far,
    largest_push,
    least_slopes,
    positive_definite,
    quotient,
    row_of,
    solution_boxes,
    start_excess,
    strict_minimum,
    value_range,
)
from tcstudy.contact.problem import PROOF_MARGIN, CondensedBody, ContactProblem
from tcstudy.contact.solve import nearest_minimum
from tcstudy.laws.laws import Laws
from tcstudy.laws.shapes import tresca
from tests.contact import contact_cases as cases
from tests.contact import exhaustive
from tests.contact.random_polygons import by_brute_force


def one_node(law: Laws, load: float) -> ContactProblem:
    return ContactProblem(np.eye(1), np.array([load]), np.ones(1), law)


@pytest.mark.parametrize(("m", "max_kinks", "count"), [(1, 9, 60), (2, 5, 30), (3, 3, 12)])
def test_no_certificate_is_contradicted(m: int, max_kinks: int, count: int) -> None:
    """All places of all nodes are tried; unique, global and strict must agree with what exists."""
    found = [x for seed in range(count) for x in exhaustive.compare(seed, m, max_kinks)]
    assert len(found) >= count
    assert sum(x.solutions > 1 for x in found) >= 10
    for x in found:
        assert x.certificate.residual <= 1e-10
        assert not x.certificate.unique or x.solutions == 1
        assert not x.certificate.global_minimum or x.above_least <= 1e-12
        assert not x.certificate.strict_minimum or x.strict
    rates = exhaustive.hit_rates(found)
    assert rates["strict_minimum"] >= 0.9
    assert rates["global_minimum"] >= 0.8
    assert rates["unique"] >= 0.5


@pytest.mark.parametrize("smooth", [False, True])
def test_bend_bounds_every_sampled_quotient(smooth: bool) -> None:
    """Sampled at many slips and at the kinks; the bound is attained (exponential pieces: to a
    tenth). Fewer parts bound it too; lower bounds stay below."""
    reach = np.outer([-1.0, 1.0], np.geomspace(3e-5, 2.0, 2000)).ravel()
    for seed in range(12):
        rng = np.random.default_rng([seed, int(smooth)])
        law = cases.random_law(rng, 1.0, 9, smooth)
        slips = np.array([law.kinks[0], *rng.uniform(-1.0, 1.5, 3)])
        box = law.b(slips), slips - 2.0, slips + 2.0
        bends, lower = bends_below_tangent(law, slips, *box)
        coarse, _ = bends_below_tangent(law, slips, *box, parts=1)
        weaker = law.placed(2.0**-40)
        scaled, _ = bends_below_tangent(weaker, slips, 2.0**-40 * box[0], *box[1:])
        assert scaled == pytest.approx(2.0**-40 * bends, rel=1e-12)
        for v, zeta, bend, least, most in zip(
            slips, law.b(slips), bends, lower, coarse, strict=True
        ):
            kinks = law.kinks[(np.abs(law.kinks - v) > 3e-5) & (np.abs(law.kinks - v) < 2.0)]
            u = np.concatenate([reach, kinks - v])
            gap = zeta * u - law.integral(np.full(len(u), v), v + u)
            sampled = np.max(2.0 * gap / u**2)
            slack = 1e-6 * (1.0 + abs(sampled))
            assert sampled <= min(bend, most) + slack
            assert least <= sampled + (1e-2 * abs(sampled) if smooth else slack)
            assert not 0.1 < bend < np.inf or sampled >= bend * (0.9 if smooth else 0.99)


@pytest.mark.parametrize("m", [1, 2])
def test_exponential_laws_against_a_grid_of_energies(m: int) -> None:
    """No grid point of the whole box lies below a certified global minimum; most minima are
    certified."""
    certified, least = 0, 0
    for seed in range(20):
        rng = np.random.default_rng([seed, m, 8])
        A_tilde, c = cases.half_laplacian(m)
        law = (
            cases.random_law(rng, 3.0, 5, True)
            if seed % 2
            else cases.exponential_decay(1.0, 0.4, 0.1)
        )
        load = c * law.b_scale * rng.uniform(0.4, 1.2) * np.ones(m)
        problem = ContactProblem(A_tilde, load, c, law)
        [low], [high] = solution_boxes(problem.rows)
        axes = [
            np.linspace(min(a, -0.01), max(b, 0.01), 301) for a, b in zip(low, high, strict=True)
        ]
        lowest = float(np.min(problem.energy(np.stack(np.meshgrid(*axes), axis=-1).reshape(-1, m))))
        for x0 in (np.zeros(m), problem.frictionless()):
            v = nearest_minimum(problem, x0, 1e-12)[0]
            here = problem.energy(v)
            certificate = certify(problem, v)
            assert np.all(low - 1e-10 <= v)
            assert np.all(v <= high + 1e-10)
            assert not certificate.global_minimum or here <= lowest + 1e-10
            certified, least = (
                certified + certificate.global_minimum,
                least + (here <= lowest + 1e-10),
            )
    assert certified >= 0.7 * least


def test_box_holds_every_solution() -> None:
    for seed in range(40):
        rng = np.random.default_rng([seed, 2])
        A_tilde, c = cases.half_laplacian(2)
        A_tilde = A_tilde * np.array([[1.0, rng.choice([-1.0, 1.0])], [1.0, 1.0]])
        A_tilde[1, 0] = A_tilde[0, 1]  # inverses with entries of both signs
        law = cases.random_law(rng, 1.0, 5)
        problem = ContactProblem(A_tilde, c * rng.normal(size=2) * law.b_scale, c, law)
        [low], [high] = solution_boxes(problem.rows)
        for v in by_brute_force(problem)[0]:
            assert np.all(low - 1e-10 <= v)
            assert np.all(v <= high + 1e-10)


def test_a_node_at_the_limit_of_sticking_is_no_strict_minimum() -> None:
    """ξ/c = 1 = b(0+) and b falls faster than Ã rises: the inclusion holds, but slipping lowers the
    energy."""
    certificate = certify(one_node(cases.slip_weakening(), 1.0), np.zeros(1))
    assert certificate.residual <= 1e-28
    assert not certificate.strict_minimum
    assert not certificate.global_minimum


def test_shared_tests_of_definiteness_agree_with_eigenvalues() -> None:
    rng = np.random.default_rng(1)
    body = CondensedBody.of(*cases.half_laplacian(15))
    slope = rng.normal(size=(200, 15)) * rng.choice([0.5, 3.0, 10.0], 200)[:, None]
    slope[rng.random(200) < 0.1, 3] = -np.inf
    expected = [
        np.all(np.isfinite(row))
        and np.linalg.eigvalsh(body.A_tilde + np.diag(body.c * row))[0] > 0.0
        for row in slope - body.shift
    ]
    assert 0 < sum(expected) < 200
    assert np.array_equal(definite(body, slope), expected)


def test_a_quotient_whose_vertex_is_too_far_away_for_a_double_is_bounded_by_its_ends() -> None:
    """2 (gap − ½ slope w²)/(1 + w)² with a slope so flat that the vertex at −2 gap/slope overflows:
    monotone in w."""
    gap, none, flat = np.array([1.0, -1.0]), np.zeros(2), np.array([1e-310, -1e-310])
    largest = quotient(gap, none, flat, np.ones(2), np.full(2, 3.0))
    assert largest == pytest.approx([2.0, -2.0 / 16.0], rel=1e-15)


TWO_NODES = np.array([[2.0, -1.0], [-1.0, 2.0]])


def test_a_box_around_the_only_solution_shrinks_to_it() -> None:
    """Ã v = l̃ − ½ c where both nodes slip forward, in closed form; 17 is ‖l̃/c‖², c-weighted."""
    load, c = np.array([3.0, 4.0]), np.array([1.0, 2.0])
    problem = ContactProblem(TWO_NODES, load, c, tresca(0.5))
    expected = np.array([8.0, 8.5]) / 3.0
    for sign in (1.0, -1.0):
        rows = ContactProblem(TWO_NODES, sign * load, c, tresca(0.5)).rows
        [low], [high] = solution_boxes(rows)
        assert low == pytest.approx(sign * expected, rel=1e-9)
        assert high == pytest.approx(sign * expected, rel=1e-9)
        assert np.all(low < high)
    reach = energy_reach(np.sqrt(17.0), 0.5, c, problem.lambda_1)
    lambda_1 = 1.5 - np.sqrt(0.75)
    radius = (np.sqrt(17.0) + 0.5 * np.sqrt(3.0)) / lambda_1
    assert reach == pytest.approx([radius, radius / np.sqrt(2.0)], rel=1e-5)
    assert np.all(reach > [radius, radius / np.sqrt(2.0)])


def test_a_softening_node_on_its_plateau_has_a_certificate_in_closed_form() -> None:
    """v + b(v) = 1.3 on b = ½: ω = 5 exceeds λ₁ = 1, yet the box proves that v = 0.8 is unique."""
    law, error = cases.slip_weakening(), 1e-6
    problem = ContactProblem(np.eye(1), np.array([1.3]), np.ones(1), law, A_error=1e-9)
    proved = certify(problem, np.array([0.8 + error]), tolerance=1e-3)
    assert (proved.omega, proved.lambda_1, proved.margin) == pytest.approx((5.0, 1.0, -4.0))
    assert proved.lambda_1_error == pytest.approx(1e-9, rel=1e-3)
    assert not proved.convex
    assert proved.unique
    assert proved.strict_minimum
    assert proved.global_minimum
    assert proved.residual == pytest.approx(error)
    assert proved.energy_gap == pytest.approx(error**2 / (2.0 * PROOF_MARGIN), rel=1e-6)
    missed = certify(problem, np.array([0.8 + error]), tolerance=1e-9)
    assert missed.unique
    assert not missed.strict_minimum
    assert not missed.global_minimum
    assert np.isnan(missed.energy_gap)
    known = certify(problem, np.array([0.8]), lambda_1=2.0, inverse=np.eye(1), residual=0.0)
    assert (known.lambda_1, known.lambda_1_error, known.residual) == (2.0, 1e-9, 0.0)


@pytest.mark.parametrize("ratio", [1.0 - 1e-3, 1.0 + 1e-3])
def test_definiteness_turns_where_the_body_is_as_stiff_as_the_law_softens(ratio: float) -> None:
    """Ã − t C ≻ 0 if and only if t < λ₁, on all nodes and on one; a sliding node is a strict
    minimum if Ã exceeds 5, and its problem is convex if λ₁ does."""
    c = np.array([1.0, 2.0])
    problem = ContactProblem(TWO_NODES, np.zeros(2), c, tresca(0.5))
    lambda_1 = problem.lambda_1
    slope = np.full(2, -ratio * lambda_1)
    body = CondensedBody.of(TWO_NODES, c)
    assert definite(body, np.stack([slope, 0.5 * slope])).tolist() == [ratio < 1.0, True]
    assert positive_definite(problem, slope, lambda_1) == (ratio < 1.0)
    one = np.array([1])
    assert positive_definite(problem, np.array([-ratio]), lambda_1, one) == (ratio < 1.0)
    stiffness = 5.0 / ratio
    sliding = ContactProblem(
        np.array([[stiffness]]), np.array([0.05 * stiffness + 0.75]), np.ones(1),
        cases.slip_weakening(),
    )  # fmt: skip
    v = np.array([0.05])
    assert strict_minimum(sliding.rows, v[None]).tolist() == [ratio < 1.0]
    assert certify(sliding, v).convex == (ratio < 1.0)


def test_least_slopes_and_pushes_in_closed_form() -> None:
    law = cases.slip_weakening()
    low, high = np.array([0.02, 0.2, -1.0, -0.05]), np.array([0.03, 1.0, 1.0, -0.02])
    at_slips = law.tables.at(np.zeros(4, dtype=int))
    assert least_slopes(at_slips, low, high) == pytest.approx([-5.0, 0.0, -5.0, -5.0])
    least, largest = value_range(at_slips, low, high)
    assert least == pytest.approx([0.85, 0.5, -1.0, -0.9])
    assert largest == pytest.approx([0.9, 0.5, 1.0, -0.75])
    drop = cases.linear_law("drop", [0.0, 1.0], [-1.0, 0.2], [1.0, -3.0], (0.0, 0.0))
    step = drop.tables.at(np.zeros(1, dtype=int))
    assert least_slopes(step, np.array([0.5]), np.array([1.5])) == -np.inf
    assert far(drop) == pytest.approx(2.0)
    assert far(cases.exponential_decay()) == pytest.approx(40.0 * 0.1)
    for pushing in (drop, drop.mirrored):
        assert largest_push(pushing) == pytest.approx(3.0)


def test_a_record_of_rows_is_taken_apart_and_put_together() -> None:
    rows = ContactProblem(np.eye(2), np.array([[0.1, 0.2], [2.0, 3.0]]), np.ones(2), tresca(1.0))
    rows = ContactProblem.on(rows.body, rows.l_tilde, rows.law.tables.at([[0], [0]]))
    certificates = certify_rows(rows, np.array([[0.0, 0.0], [1.0, 2.0]]))
    assert certificates.global_minimum.tolist() == [True, True]
    second = row_of(certificates, 1)
    assert second.margin == certificates.margin[1]
    again = as_row(second)
    assert again.margin.shape == (1,)
    assert astuple(row_of(again, 0)) == astuple(second)
    assert as_row(None) is None
    assert row_of(None, 0) is None


def test_a_quotient_has_its_largest_value_inside_or_at_an_end() -> None:
    """2 (gap + excess w − ½ slope w²)/(distance + w)² against samples; at v itself its limit."""
    rng = np.random.default_rng(4)
    gap, excess, slope = rng.normal(size=(3, 200))
    distance, width = rng.uniform(0.1, 2.0, (2, 200))
    w = np.linspace(0.0, 1.0, 2001)[:, None] * width
    values = 2.0 * (gap + excess * w - 0.5 * slope * w**2) / (distance + w) ** 2
    largest = quotient(gap, excess, slope, distance, width)
    assert np.all(largest >= np.max(values, axis=0) - 1e-12 * np.abs(largest))
    assert largest == pytest.approx(np.max(values, axis=0), rel=1e-4, abs=1e-4)
    zero, excess = np.zeros(2), np.array([0.1, -0.2])
    at_v = quotient(zero, excess, np.array([3.0, 3.0]), zero, np.array([4.0, 4.0]))
    assert at_v.tolist() == [np.inf, pytest.approx(-0.1 - 3.0)]
    zeta = np.array([1.0, 1.0 + 1e-15, 1.0, 0.4])
    excess = start_excess(np.array([1.0, 1.0, 1.0 + 1e-15, 1.0]), zeta)
    assert excess == pytest.approx([0.0, 0.0, 0.0, -0.6], abs=3e-15)
    assert np.max(excess) == 0.0


def test_laws_by_node_leave_the_margin_of_their_own_slopes() -> None:
    """λ_min(C^{−½}ÃC^{−½} − diag ω_i) exceeds λ₁ − ω, and can be positive where that is negative."""
    c = np.array([1.0, 2.0])
    laws = Laws.of([cases.slip_weakening(), tresca(0.5)])
    for stiffness, is_convex in ((5.0, True), (3.0, False)):
        A = stiffness * TWO_NODES
        scaled = A / np.sqrt(np.outer(c, c))
        problem = ContactProblem(A, np.zeros(2), c, laws.at([0, 1]))
        proved = certify(problem, np.zeros(2))
        expected = np.linalg.eigvalsh(scaled - np.diag([5.0, 0.0]))[0]
        assert proved.margin == pytest.approx(expected, rel=1e-12)
        assert problem.lambda_1 < proved.omega
        assert (expected > 0.0) == proved.convex == is_convex


def test_a_body_stiffer_by_less_than_the_margin_is_not_proved_convex() -> None:
    """ω = 5 against λ₁ = 5 (1 + ½ PROOF_MARGIN) and 5 (1 + 2 PROOF_MARGIN)."""
    for share, is_convex in ((0.5, False), (2.0, True)):
        stiffness = np.array([[5.0 * (1.0 + share * PROOF_MARGIN)]])
        problem = ContactProblem(stiffness, np.zeros(1), np.ones(1), cases.slip_weakening())
        assert certify(problem, np.zeros(1)).convex == is_convex


@pytest.mark.parametrize("error", [0.0, 0.1])
def test_proofs_hold_for_a_body_softer_by_its_error_and_the_margin(error: float) -> None:
    """Ã + C (slope − μ)/(1 − error) ≻ 0 to eight digits, μ = PROOF_MARGIN λ₁; a sliding node likewise."""
    c = np.array([1.0, 2.0])
    problem = ContactProblem(TWO_NODES, np.zeros(2), c, tresca(0.5), A_error=error)
    body = CondensedBody.of(TWO_NODES, c, error)
    lambda_1, share = problem.lambda_1, 1.0 - error - PROOF_MARGIN
    for ratio, is_proved in ((1.0 - 1e-8, True), (1.0 + 1e-8, False)):
        slope = np.full(2, -ratio * share * lambda_1)
        assert positive_definite(problem, slope, lambda_1) == is_proved
        assert definite(body, slope[None]).tolist() == [is_proved]
        stiffness = 5.0 / (ratio * share)
        load = np.array([0.05 * stiffness + 0.75])
        sliding = ContactProblem(
            np.array([[stiffness]]), load, np.ones(1), cases.slip_weakening(), A_error=error
        )
        assert strict_minimum(sliding.rows, np.array([[0.05]])).tolist() == [is_proved]


def test_slack_below_rounding_does_not_hold_a_node() -> None:
    """A traction just below 20 MPa, from which b softens faster than Ã rises."""
    film = cases.slip_weakening(2e7, 1e7, 0.1)
    for missing, holds in ((1e-14, False), (1e-10, True)):
        rows = one_node(film, 2e7 * (1.0 - missing)).rows
        assert strict_minimum(rows, np.zeros((1, 1))).tolist() == [holds]
