"""Certificates against exhaustive search: nothing that is certified may be contradicted."""

import numpy as np
import pytest

from tcstudy.contact.certificates import (
    bends_below_tangent,
    certify,
    definite,
    quotient,
    solution_boxes,
)
from tcstudy.contact.problem import CondensedBody, ContactProblem
from tcstudy.contact.solve import nearest_minimum
from tcstudy.laws.laws import Laws
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
    tenth)."""
    reach = np.outer([-1.0, 1.0], np.geomspace(3e-5, 2.0, 2000)).ravel()
    for seed in range(12):
        rng = np.random.default_rng([seed, int(smooth)])
        law = cases.random_law(rng, 1.0, 9, smooth)
        slips = np.array([law.kinks[0], *rng.uniform(-1.0, 1.5, 3)])
        bends, _ = bends_below_tangent(law, slips, law.b(slips), slips - 2.0, slips + 2.0)
        for v, zeta, bend in zip(slips, law.b(slips), bends, strict=True):
            kinks = law.kinks[(np.abs(law.kinks - v) > 3e-5) & (np.abs(law.kinks - v) < 2.0)]
            u = np.concatenate([reach, kinks - v])
            gap = zeta * u - law.integral(np.full(len(u), v), v + u)
            sampled = np.max(2.0 * gap / u**2)
            assert sampled <= bend + 1e-6 * (1.0 + abs(sampled))
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
