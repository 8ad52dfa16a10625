"""Bundle-Newton on condensed contact problems of every law kind: solved to the inclusion, and at what count.

`reliability_table` is the study, too long for every run of the tests; a subset of it is tested.
"""

from __future__ import annotations

import time
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
import pytest
from numpy.typing import NDArray

from tcstudy.contact.bundle.contact import contact_method, contact_oracle, solve_with_bundle
from tcstudy.contact.contact import solve_contact
from tcstudy.contact.loop import Status, iterate
from tcstudy.contact.problem import ContactProblem
from tcstudy.laws.laws import Laws
from tcstudy.laws.pieces import UP
from tests.contact import contact_cases as cases

Array = NDArray[np.float64]

KINDS = ("tresca", "slip-weakening", "exponential", "saw-tooth", "jumps", "linear")
RATIOS = (0.5, 2.0, 8.0)
LOADS = (0.9, 1.2, 2.0, 4.0)
"""Largest load per peak of b: 0.9 keeps every node sticking, 1.2 is just past first slip."""

TOLERANCE = 1e-10


@dataclass(frozen=True)
class Row:
    """One solve from zero.

    sticking:        nodes that rest on an up-jump of b in the answer
    iterations:      of solve_contact, which ends on the identified pieces
    plain:           of bundle-Newton alone, to a predicted decrease of 1e-10 |f|; −1 if not asked for or not converged
    excess:          energy above separable-newton's from the same start, relative
    """

    kind: str
    m: int
    ratio: float
    load: float
    status: Status
    reason: str
    residual: float
    sticking: int
    iterations: int
    plain: int
    seconds: float
    excess: float


def law_of(kind: str, ratio: float, lambda_1: float) -> Laws:
    """A law with peak 1 that falls by 0.6 (saw-tooth: 0.2 in a down-jump after each tooth) at the slope ratio·λ₁.

    tresca does not depend on the ratio; linear rises with that slope; saw-tooth and jumps fall in down-jumps, so the
    ratio sets their slip scale only.
    """
    omega = ratio * lambda_1
    d = 0.6 / omega
    if kind == "tresca":
        return cases.linear_law(kind, [0.0], [-1.0], [1.0], (0.0, 0.0))
    if kind == "slip-weakening":
        return cases.slip_weakening(1.0, 0.4, d)
    if kind == "exponential":
        return cases.exponential_decay(1.0, 0.4, d)
    if kind == "saw-tooth":
        return cases.sawtooth(1.0, 0.5 / omega, 0.4 * omega, 0.5)
    if kind == "jumps":
        left, right = [-0.3, -0.5, -1.0, 0.7, 0.6], [-0.6, -0.7, 1.0, 0.5, 0.3]
        return cases.linear_law(kind, [-2 * d, -d, 0.0, d, 2 * d], left, right, (0.0, 0.0))
    return cases.spring(omega)


def problem_of(kind: str, m: int, ratio: float, load: float) -> ContactProblem:
    """A half-plane body under an uneven load of both signs whose largest value is `load` times the peak of b."""
    A_tilde, c = cases.half_laplacian(m)
    x = (np.arange(m) + 0.5) / m
    shape = np.sin(2 * np.pi * x) + 0.6 + 0.3 * np.sin(5 * np.pi * x + 1)
    return ContactProblem(A_tilde, c * load * shape / np.max(np.abs(shape)), c, law_of(kind, ratio, np.pi))


def sticking_nodes(problem: ContactProblem, v: Array) -> int:
    """Nodes that lie bitwise on an up-jump of b."""
    return int(np.sum(np.isin(v, problem.law.kinks[problem.law.kinds == UP])))


def reliability_table(
    sizes: Iterable[int] = (20, 50, 100, 200),
    ratios: Sequence[float] = RATIOS,
    loads: Sequence[float] = LOADS,
    kinds: Sequence[str] = KINDS,
    plain: bool = False,
) -> list[Row]:
    """Every combination solved by bundle-newton from zero; all 288 take one to two minutes on one core.

    plain: also count the iterations without the identification of active pieces (several times longer)
    """
    rows = []
    for m in sizes:
        for kind in kinds:
            for ratio in ratios:
                rows += [solved(kind, m, ratio, load, plain) for load in loads]
    return rows


def solved(kind: str, m: int, ratio: float, load: float, plain: bool) -> Row:
    """One row of the table."""
    problem, zero = problem_of(kind, m, ratio, load), np.zeros(m)
    begin = time.perf_counter()
    answer = solve_contact(problem, "bundle-newton", TOLERANCE, branch="from-zero")
    seconds = time.perf_counter() - begin
    other = solve_contact(problem, "separable-newton", TOLERANCE, branch="from-zero")
    size = abs(other.energy) or problem.law.b_scale * problem.law.s_scale * float(problem.c.sum()) or 1.0
    alone = iterate(contact_method(problem, 1e-10), contact_oracle(problem), zero) if plain else None
    return Row(
        kind,
        m,
        ratio,
        load,
        answer.status,
        answer.reason,
        answer.inclusion_residual,
        sticking_nodes(problem, answer.v),
        answer.iterations,
        alone.iterations if alone is not None and alone.converged else -1,
        seconds,
        (answer.energy - other.energy) / size,
    )


def fit(sticking: Sequence[int], iterations: Sequence[int]) -> tuple[float, float]:
    """(slope, intercept) of iterations ≈ slope·n_s + intercept by least squares."""
    slope, intercept = np.polyfit(np.array(sticking, dtype=float), np.array(iterations, dtype=float), 1)
    return float(slope), float(intercept)


def report(rows: Sequence[Row]) -> str:
    """Successes, iterations, seconds and energies by kind and size, and the fits against the sticking nodes."""
    heads = (("law", -14), ("m", 4), ("solved", 7), ("residual", 8), ("iterations", 11), ("seconds", 11))
    lines = [" ".join(f"{name:<{-w}s}" if w < 0 else f"{name:>{w}s}" for name, w in heads) + "  lower/higher energy"]
    for kind, m in dict.fromkeys((r.kind, r.m) for r in rows):
        part = [r for r in rows if (r.kind, r.m) == (kind, m)]
        good = sum(r.status == Status.CONVERGED for r in part)
        count, seconds = [r.iterations for r in part], [r.seconds for r in part]
        higher, lower = max(0.0, *(r.excess for r in part)), min(0.0, *(r.excess for r in part))
        lines.append(
            f"{kind:14s} {m:4d} {good:3d}/{len(part):<3d} {max(r.residual for r in part):8.1e} "
            f"{np.median(count):5.0f}/{max(count):<5d} {np.median(seconds):5.2f}/{max(seconds):<5.2f} "
            f"{lower:+9.1e}/{higher:+9.1e}"
        )
    for name in ("iterations", "plain"):
        kept = [r for r in rows if r.kind != "linear" and getattr(r, name) >= 0]
        for part_name, part in (
            ("all stick", [r for r in kept if r.sticking == r.m]),
            ("some slip", [r for r in kept if r.sticking < r.m]),
        ):
            if len({r.sticking for r in part}) > 1:
                slope, intercept = fit([r.sticking for r in part], [getattr(r, name) for r in part])
                lines.append(f"{name}, {part_name}: {slope:.2f} n_s {intercept:+.0f}  ({len(part)} solves)")
    return "\n".join(lines)


@pytest.mark.parametrize("ratio", RATIOS)
@pytest.mark.parametrize("kind", KINDS)
def test_every_law_is_solved_from_zero(kind: str, ratio: float) -> None:
    for m, load in ((20, 1.2), (20, 2.0), (30, 4.0), (50, 0.9)):
        problem = problem_of(kind, m, ratio, load)
        answer = solve_contact(problem, "bundle-newton", TOLERANCE, branch="from-zero")
        assert answer.status == Status.CONVERGED, answer.reason
        assert cases.independent_residual(problem, answer.v) <= TOLERANCE


@pytest.mark.parametrize("kind", ["slip-weakening", "exponential"])
@pytest.mark.parametrize("ratio", RATIOS)
def test_ratio_is_the_softening_over_the_threshold(kind: str, ratio: float) -> None:
    problem = problem_of(kind, 20, ratio, 1.0)
    assert problem.law.omega == pytest.approx(ratio * problem.lambda_1, rel=1e-9)


def test_two_hundred_nodes() -> None:
    problem = problem_of("slip-weakening", 200, 2.0, 2.0)
    answer = solve_contact(problem, "bundle-newton", TOLERANCE, branch="from-zero")
    assert answer.status == Status.CONVERGED, answer.reason
    assert cases.independent_residual(problem, answer.v) <= TOLERANCE


def test_iterations_of_the_plain_method_grow_with_the_sticking_nodes() -> None:
    """n_s + 1 subgradients are the least that can prove stationarity; measured 2 to 3 n_s."""
    rows = reliability_table((20, 30), (0.5,), (1.2, 2.0, 4.0), ("tresca", "slip-weakening"), plain=True)
    assert all(r.plain >= r.sticking for r in rows)
    slope, _ = fit([r.sticking for r in rows], [r.plain for r in rows])
    assert 1.0 <= slope <= 4.0
    assert "n_s" in report(rows)


@pytest.mark.parametrize("kind", ["tresca", "linear"])
def test_convex_problems_have_the_energy_of_separable_newton(kind: str) -> None:
    rows = reliability_table((20, 50), (2.0,), (0.9, 2.0), (kind,))
    assert all(abs(r.excess) <= 1e-11 for r in rows)


def test_identification_only_adds_digits() -> None:
    """It ends the run earlier than the plain method, on the same solution."""
    problem = problem_of("slip-weakening", 50, 0.5, 2.0)
    plain = iterate(contact_method(problem), contact_oracle(problem), np.zeros(50))
    ended = solve_with_bundle(problem, np.zeros(50))
    assert plain.converged
    assert ended.converged
    assert "active pieces" in ended.reason
    assert ended.iterations < plain.iterations
    assert np.allclose(ended.x, plain.x, rtol=0, atol=1e-6 * np.max(np.abs(plain.x)))
    assert ended.f == pytest.approx(plain.f, rel=1e-10)


def test_iteration_limit_is_a_status_with_a_reason() -> None:
    problem = problem_of("slip-weakening", 50, 8.0, 1.2)
    outcome = solve_with_bundle(problem, np.zeros(50), max_iterations=5)
    assert outcome.status == Status.ITERATION_LIMIT
    assert "max_iterations" in outcome.reason
