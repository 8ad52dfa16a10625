"""`tcstudy converge` on exact solutions: rates and absolute bounds of every norm, locking, derived
loads."""

import re
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from tcstudy.data.records import Record
from tcstudy.data.schema import PointStatus
from tcstudy.exact.solution import exact_xi
from tcstudy.fem.geometry import build
from tcstudy.offline.level import Level
from tcstudy.read.study import read_study_text
from tcstudy.scene.study import Study
from tcstudy.study import convergence
from tcstudy.study.convergence import converge
from tcstudy.study.level_solver import at_contact_nodes
from tcstudy.study.lint import MEASURED, warnings
from tcstudy.study.reference import SolvedLevel, solve_levels
from tests.verification import closed_forms
from tests.verification import manufactured as smooth
from tests.verification.patch import Case, patch_study
from tests.verification.scenes import mesh_family
from tests.verification.series import errors, notes, points, series


def smooth_study(levels: int, exact: bool = True) -> Study:
    """The thermoelastic solution that slips everywhere, with its exact section."""
    e, a, t0 = smooth.EXPANSION, smooth.A, smooth.THETA_0
    s = f"({smooth.SHIFT} + {e}*({t0}*x + {a}*x^2/2))"
    g = f"(({smooth.TAU_S} - {smooth.FALL}*{s})/{smooth.MU})"
    text = smooth.manufactured_study(levels, 0.25).text
    given = f'exact: {{u: ["{s} - {e * a / 2}*y^2 + y*{g}", "{e}*({t0} + {a}*x)*y"], theta: "{t0} + {a}*x"}}'
    return read_study_text(text + (given if exact else ""))


@pytest.fixture(scope="module")
def slipping() -> Record:
    return converge(smooth_study(6))


@pytest.fixture(scope="module")
def mixed() -> Record:
    return converge(closed_forms.stick_slip(6))


def test_smooth_slip(slipping: Record) -> None:
    found = errors(points(slipping)[0])
    for norm, order, bound in (
        *(
            ("u_energy", 1, 1.2e-3),
            ("u_H1", 1, 1e-3),
            ("u_L2", 2, 1e-5),
            ("u_T_L2", 2, 7e-5),
            ("u_T_max", 2, 5e-5),
        ),
        *(("xi_L2", 1, 3e-4), ("xi_nodes", 2, 8e-6), ("xi_max", 2, 8e-6)),
    ):
        assert (found[norm].verdict, found[norm].expected) == ("as_expected", order)
        assert found[norm].rate[-1] == pytest.approx(order, abs=0.05)
        assert found[norm].error[-1] < bound
    for norm in ("theta_L2", "theta_H1"):  # the temperature is linear
        assert found[norm].verdict == "exact"
        assert np.max(found[norm].error) < 1e-12


def test_stick_slip(mixed: Record) -> None:
    """The change at x = 1/3 lies at a third and two thirds of an element in turn: rates over two
    levels count."""
    for norm, order, bound in (
        *(
            ("u_energy", 1, 8e-3),
            ("u_H1", 1, 8e-3),
            ("u_L2", 2, 8e-5),
            ("u_T_L2", 1.5, 1e-3),
            ("u_T_max", 1, 4e-3),
        ),
        *(("xi_L2", 1, 7e-3), ("xi_nodes", 1, 3e-3), ("xi_max", 0.5, 2e-2)),
    ):
        own = errors(points(mixed)[0])[norm]
        assert own.expected == order
        over_two = np.log2(own.error[1:-2] / own.error[3:]) / 2
        assert over_two[-1] == pytest.approx(order, abs=0.15)
        assert own.error[-1] < bound


def test_a_held_end_takes_a_third_of_the_traction(mixed: Record) -> None:
    """S₁ = [x⁰, x^{3/2}] carries the load of one hat function: ξ₁ = 2/3 of the exact one where the
    node sticks."""
    study = closed_forms.stick_slip(6)
    levels = solve_levels(study, lambda text: None)
    xi = levels[-1].solutions[()].xi
    exact = at_contact_nodes(
        exact_xi(study.exact, study.scenes[0]), levels[-1].mesh, levels[-1].line
    )
    assert levels[-1].next_to_held.tolist() == [True] + [False] * (len(xi) - 2) + [True]
    assert (xi[0] / exact[0], xi[1] / exact[1]) == (
        pytest.approx(2 / 3, abs=0.02),
        pytest.approx(1, abs=0.05),
    )


def test_what_p1_contains_is_exact() -> None:
    """The patch test turned by 37°: uniform shear with slip, every norm below 1e-12."""
    case = Case("{law: slip-weakening, tau_s: 1, tau_k: 0.2, delta: 0.4}", 1.2, (1.0,))
    c, s = float(np.cos(np.radians(37.0))), float(np.sin(np.radians(37.0)))
    along = f"(1 + 0.2*({c!r}*y - {s!r}*x))"
    text = patch_study(case, 0.35, 37.0).text.replace("maxh: 0.35", "maxh: 0.35, levels: 2")
    study = read_study_text(text + f'exact: {{u: ["{c!r}*{along}", "{s!r}*{along}"]}}')
    found = errors(points(converge(study))[0])
    assert len(found) == 8
    for one in found.values():
        assert np.max(one.error) < 1e-12
        assert one.verdict == "exact"


def test_a_nested_reference_gives_the_true_errors(slipping: Record) -> None:
    """Against level 5 instead of the exact solution: the same to the reference's own share, 4^-2 of
    the square."""
    found = converge(smooth_study(6, exact=False))
    assert "level 5" in found.attributes["reference"]
    assert found.values["compared"].tolist() == [True] * 4 + [False] * 2
    for name, one in errors(points(found)[0]).items():
        assert not np.isfinite(one.error[4:]).any()
        if name.startswith("u_") and "T" not in name:
            np.testing.assert_allclose(
                one.error[:4], errors(points(slipping)[0])[name].error[:4], rtol=0.08
            )


def test_numbers_are_extrapolated_to_the_exact_ones(slipping: Record, mixed: Record) -> None:
    for found in (slipping, mixed):
        # what a cell may hide of ∫ξ is of first order
        for name, share in (("energy", 1e-3), ("friction_resultant", 1e-3)):
            own = series(points(found)[0], name)
            assert abs(own.limit - own.exact) <= own.uncertainty
            assert own.uncertainty < share * abs(own.exact)
    energy = series(points(slipping)[0], "energy")
    assert energy.limit_order == pytest.approx(2, abs=0.02)
    x = np.linspace(0, 1, 100_001)
    resultant = np.trapezoid(smooth.friction(x), x)
    assert series(points(slipping)[0], "friction_resultant").exact == pytest.approx(
        resultant, rel=1e-9
    )


def changed_finest(levels: list[SolvedLevel], **changes: Any) -> list[SolvedLevel]:
    """Return the levels with another solution on the finest one."""
    finest = levels[-1]
    solutions = {key: replace(one, **changes) for key, one in finest.solutions.items()}
    return [*levels[:-1], replace(finest, solutions=solutions)]


def test_a_finest_level_that_fails_is_no_reference(monkeypatch: pytest.MonkeyPatch) -> None:
    """The finest one that is solved takes its place; without one there is a reason and a remedy."""
    for levels, reference in ((5, "level 3, the finest that is solved"), (4, "none")):
        study = smooth_study(levels, exact=False)
        failed = changed_finest(solve_levels(study), status=PointStatus.SINGULAR, reason="why")
        monkeypatch.setattr(convergence, "solve_levels", lambda *_, failed=failed: failed)
        found = converge(study)
        assert found.attributes["reference"].startswith(reference)
        assert found.values["reason"][0].tolist() == ["", *[""] * (levels - 2), "why"]
        lack = "No errors are measured: 3 of 4 levels are solved, and the reference needs"
        assert (lack in "".join(notes(found))) == (levels == 4)


def test_stick_that_first_shows_on_the_finest_level_asks_for_one_more(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    study = smooth_study(4, exact=False)
    solved = solve_levels(study)
    sticks = np.zeros(solved[-1].line.m, dtype=bool)
    sticks[0] = True
    changed = changed_finest(solved, sticks=sticks)
    for levels, asked in ((solved, False), (changed, True)):
        monkeypatch.setattr(convergence, "solve_levels", lambda *_, levels=levels: levels)
        text = "".join(notes(converge(study)))
        assert ("(+ → 0+): give one more level (mesh.levels=5)" in text) == asked


def test_locking_is_measured_and_warned_about() -> None:
    """On a solution that does not depend on ν the error grows with λ; the figures of the warning
    are these."""
    poissons = tuple(MEASURED)
    study = closed_forms.incompressible(4, poissons)
    assert any("P1 elements lock" in str(note) for note in warnings(study))
    found = converge(study)
    by_nu = {nu: errors(p) for nu, p in zip(poissons, points(found), strict=True)}
    for nu, (energy, slip) in MEASURED.items():
        assert 100 * by_nu[nu]["u_energy"].error[-1] == pytest.approx(energy, rel=0.05)
        assert 100 * by_nu[nu]["u_T_L2"].error[-1] == pytest.approx(slip, rel=0.05)
    assert by_nu[0.3]["u_H1"].rate[-1] > 0.95
    assert by_nu[0.4999]["u_H1"].rate[-1] < 0.5
    assert by_nu[0.4999]["u_T_L2"].verdict in ("pre_asymptotic", "slower")


# -- derived loads
# ------------------------------------------------------------------------------------


def with_derived_loads(study: Study) -> Study:
    text = re.sub(r'\{role: clamped, u: \[".*?"\]\}', "clamped", study.text)
    text = re.sub(r"\{role: convection, g: .*\}", "convection", text)
    text = re.sub(r"loads: \{f:.*\n", "", text)
    text = re.sub(r', theta_bar: ".*?"', "", text)
    text = text.replace("exact: {", "exact: {loads: derived, ")
    assert " u: " in text
    assert "role" not in text
    return read_study_text(text)


HAND = {
    "smooth": smooth_study(2),
    "stick-slip": closed_forms.stick_slip(2),
    "stick-slip turned": closed_forms.stick_slip(2, 45.0),
    "ring": closed_forms.ring(2),
    "incompressible": closed_forms.incompressible(2, (0.3, 0.49)),
}


@pytest.mark.parametrize("name", HAND)
def test_the_loads_given_by_hand_come_out(name: str) -> None:
    """As what the contact problem is made of: condensed load l̃, and l_θ and the prescribed
    displacements."""
    hand, own = HAND[name], with_derived_loads(HAND[name])
    assert len(hand.scenes) == len(own.scenes)
    for given, found in zip(hand.scenes, own.scenes, strict=True):
        assert dict(given.boundary).keys() == dict(found.boundary).keys()
        mesh = list(mesh_family(build(given.body), hand.mesh))[-1]
        one, other = Level(mesh, given), Level(mesh, found)
        a, b = one.condensed(given), other.condensed(found)
        size = np.max(np.abs(a.problem.l_tilde))
        np.testing.assert_allclose(b.problem.l_tilde, a.problem.l_tilde, rtol=0, atol=1e-12 * size)
        assert b.constant == pytest.approx(a.constant, rel=1e-12)
        load = one.load(given)
        np.testing.assert_allclose(
            other.load(found), load, rtol=0, atol=1e-12 * max(1.0, np.max(np.abs(load)))
        )
        np.testing.assert_allclose(other.frames.values, one.frames.values, rtol=0, atol=1e-13)


def test_heated_ring() -> None:
    """On a curved contact line, with a weakening film: b falls by w = 0.6 < λ₁."""
    found = converge(closed_forms.heated_ring(5))
    assert notes(found) == []
    resultant = series(points(found)[0], "friction_resultant")
    assert abs(resultant.limit - resultant.exact) <= max(resultant.uncertainty, 1e-12)
    for norm, order, bound in (
        *(
            ("theta_L2", 2, 8.5e-5),
            ("theta_H1", 1, 2.3e-2),
            ("u_energy", 1, 1.8e-2),
            ("u_H1", 1, 1.9e-2),
        ),
        *(
            ("u_L2", 2, 2.7e-4),
            ("u_T_L2", 1.5, 1.3e-3),
            ("u_T_max", 1, 6e-3),
            ("xi_nodes", 1.5, 4e-4),
        ),
    ):
        own = errors(points(found)[0])[norm]
        assert (own.expected, own.rate[-1]) == (order, pytest.approx(order, abs=0.1))
        assert own.error[-1] < bound
