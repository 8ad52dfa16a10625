"""The search for less energy: against enumeration, the same every time, and only where it has
business; envelopes."""

import numpy as np
import pytest

from tcstudy.contact import search
from tcstudy.contact.problem import ContactProblem, Status
from tcstudy.contact.search import moreau_envelopes
from tcstudy.contact.solve import solve_contact
from tcstudy.laws.laws import Laws
from tcstudy.laws.pieces import DOWN
from tcstudy.scene.solver_plan import ESCAPE, Branch
from tests.benchmarks.cases import down_jumps
from tests.contact import contact_cases as cases
from tests.contact import exhaustive


@pytest.mark.parametrize(("m", "count"), [(2, 60), (4, 50)])
def test_the_least_energy_of_all_is_found(m: int, count: int) -> None:
    """Against every choice of pieces; nothing is passed over as global that is not."""
    before = after = ran = 0
    for seed in range(count):
        problem = exhaustive.small_problem(seed, m)
        least = exhaustive.least_energy(problem)
        answer = solve_contact(problem)
        slack = 1e-10 * (abs(least) + float(problem.c @ problem.law.j(answer.v)))
        assert answer.energy >= least - slack
        before += np.nanmin(answer.energies[:ESCAPE]) <= least + slack  # without the search
        after += answer.energy <= least + slack
        ran += np.isfinite(answer.energies[ESCAPE])
    assert after == count
    assert before < count
    assert ran < 0.3 * count


def test_laws_that_push_hide_no_well() -> None:
    """Any law, odd or not, opposing the slip or pushing it on: the share of
    `tests.benchmarks.reliability` for CI."""
    results = [exhaustive.search(seed, 1 + seed % 8) for seed in range(72)]
    assert all(r.solved and r.found and not r.contradicted for r in results)
    assert sum(r.plain for r in results) < len(results)


def test_one_node_leaves_a_well_along_an_exponential() -> None:
    """b = 0.5 + 0.5 e^(−10 s) falls fastest where the node sticks; b + s = 0.95 again at 0.4441."""
    law = cases.exponential_decay(1.0, 0.5, 0.1)
    for sign in (1.0, -1.0):
        rows = ContactProblem(np.eye(1), np.array([sign * 0.95]), np.ones(1), law).rows
        [[s]] = search.move_starts(rows, np.zeros((1, 1)))[0]
        assert 0.4 < sign * s < 0.5
        assert 0.5 + 0.5 * np.exp(-10.0 * abs(s)) + abs(s) == pytest.approx(0.95, abs=1e-14)


def test_pieces_out_of_reach_are_not_asked() -> None:
    """b = 1 up to 3, 1 + exp(−1e4 (s − 3)) behind it, which at 0 is no double: no move, no
    overflow."""
    a, none = np.array([-1.0, 0.0, 0.0, 1.0]), np.zeros(4)
    law = Laws(
        "far",
        np.array([-3.0, 0.0, 3.0]),
        3.0 * a,
        np.array([-1.0, -1.0, 1.0, 1.0]),
        none,
        a,
        1e4 * a,
    )
    rows = ContactProblem(np.eye(1), np.array([0.5]), np.ones(1), law).rows
    assert len(search.move_starts(rows, np.zeros((1, 1)))[0]) == 0


@pytest.mark.parametrize("smooth", [False, True])
def test_the_same_every_time_and_in_other_units(smooth: bool) -> None:
    gains = 0
    for seed in range(6):
        problem = cases.random_problem(
            np.random.default_rng([seed, 61]), (20, 40)[seed % 2], smooth=smooth
        )
        answer, again = solve_contact(problem), solve_contact(problem)
        assert answer.status == Status.CONVERGED
        assert cases.independent_residual(problem, answer.v) <= 1e-10
        assert np.array_equal(answer.v, again.v)
        assert np.array_equal(answer.energies, again.energies, equal_nan=True)
        assert answer.start != ESCAPE or answer.energies[ESCAPE] == answer.energy
        gains += answer.start == ESCAPE
        if seed % 2 == 0:
            units = ((1e9, 1, 1), (1, 1e-9, 1), (1e-9, 1e9, 1e9))[seed // 2 % 3]
            other = solve_contact(cases.rescaled(problem, *units))
            assert np.max(np.abs(other.v * units[0] - answer.v)) <= 1e-9 * np.max(np.abs(answer.v))
    assert gains >= 1


def test_no_business() -> None:
    """Without a fall of b, with ω < λ₁, on another branch, with bundle-newton: no search."""
    A_tilde, c = cases.half_laplacian(20)
    load = c * np.linspace(0.4, 1.8, 20)
    for law in (
        cases.spring(),
        cases.slip_weakening(1.0, 1.0, 0.1),
        cases.slip_weakening(1.0, 0.5, 0.2),
    ):
        answer = solve_contact(ContactProblem(A_tilde, load, c, law))
        assert answer.status == Status.CONVERGED
        assert np.isnan(answer.energies[ESCAPE])
    many_wells = ContactProblem(A_tilde, load, c, down_jumps(0.6, 10))
    assert solve_contact(many_wells).start == ESCAPE
    branches: tuple[Branch, ...] = ("from-zero", "continued")
    assert all(
        np.isnan(solve_contact(many_wells, branch=branch).energies[ESCAPE]) for branch in branches
    )
    assert np.isnan(solve_contact(many_wells, "bundle-newton").energies[ESCAPE])


def envelope(law: Laws, kappa: float) -> tuple[Laws, np.ndarray]:
    """The envelope of a law and its common tangents (n, 2)."""
    found = moreau_envelopes(law, kappa).laws[0]
    tangents = np.flatnonzero((found.q == -kappa) & ~found.bent)
    return found, np.column_stack([found.lower[tangents], found.upper[tangents]])


def test_slip_weakening_in_closed_form() -> None:
    """b falls from 1 to 0.5 over 0.1. Equal areas: the tangent from 0 ends at √((1 − 0.5)·0.1/κ), b
    there 0.5."""
    law, kappa = cases.slip_weakening(1.0, 0.5, 0.1), 0.8
    hull, tangents = envelope(law, kappa)
    end = np.sqrt(0.05 / kappa)
    assert tangents == pytest.approx(np.array([[-end, 0.0], [0.0, end]]), rel=1e-13)
    s = np.linspace(1e-3, 0.999 * end, 7)
    assert hull.b(s) == pytest.approx(0.5 + kappa * (end - s), rel=1e-13)
    assert hull.b(-s) == pytest.approx(-hull.b(s), rel=1e-13)
    assert hull.j(np.array([2.0])) == pytest.approx(law.j(np.array([2.0])), rel=1e-14)
    assert hull.omega == pytest.approx(kappa, rel=1e-14)
    same, none = envelope(law, 5.1)  # it falls by 5 a length
    assert (same.kinks.tolist(), len(none)) == (law.kinks.tolist(), 0)


def sampled_hull(law: Laws, kappa: float, s: np.ndarray, j: np.ndarray) -> np.ndarray:
    """conv(j + ½κ s²) − ½κ s² at the samples, as the largest of all their supporting lines (brute
    force)."""
    height = j + 0.5 * kappa * s**2
    slopes = np.unique(np.diff(height) / np.diff(s))
    supports = np.array([np.min(height - slope * s) for slope in slopes])
    return np.max(slopes[:, None] * s + supports[:, None], axis=0) - 0.5 * kappa * s**2


@pytest.mark.parametrize("smooth", [False, True])
def test_random_laws(smooth: bool) -> None:
    """j_κ ≤ j and equal off the tangents; b_κ falls by κ at most; against a brute-force hull of
    dense samples."""
    bridged = 0
    for seed in range(15):
        rng = np.random.default_rng([seed, int(smooth), 21])
        law = cases.random_law(rng, 3.0, 15, smooth)
        kappa = 3.0 * 4.0 ** rng.integers(0, 3)
        hull, tangents = envelope(law, kappa)
        bridged += len(tangents)
        reach = 2.0 * np.max(np.abs(law.kinks)) + 2.0 * law.b_scale / kappa
        s = np.unique(
            np.concatenate([np.linspace(-reach, reach, 1001), law.kinks, tangents.ravel()])
        )
        j, below = law.j(s), hull.j(s)
        below = below + (j - below)[0]  # both are primitives; far out they are the same
        scale = np.max(np.abs(j))
        assert np.all(below <= j + 1e-10 * scale)
        if len(tangents):
            inside = np.any((tangents[:, :1] < s) & (s < tangents[:, 1:]), axis=0)
            assert below[~inside] == pytest.approx(j[~inside], abs=1e-10 * scale)
        assert np.min(hull.end_slopes) >= -kappa * (1.0 + 1e-9) or len(tangents) == 0
        fall = (hull.b_left - hull.b_right)[hull.kinds == DOWN]
        assert np.max(fall, initial=0.0) <= 1e-9 * law.b_scale
        brute = sampled_hull(law, kappa, s, j)
        assert np.max(np.abs(below - brute)) <= 3e-3 * law.b_scale * reach
    assert bridged >= 25
