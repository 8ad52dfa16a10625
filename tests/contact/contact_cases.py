"""Laws, bodies and random problems for the tests of the engine, and a judge that shares no code
with it."""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from tcstudy.contact.problem import CondensedBody, ContactProblem, least_eigenvalue
from tcstudy.contact.solve import Answer, solve_block
from tcstudy.laws import shapes
from tcstudy.laws.laws import Laws

Array = NDArray[np.float64]
Index = NDArray[np.intp]


def linear_law(
    name: str,
    kinks: Sequence[float],
    left: Sequence[float],
    right: Sequence[float],
    ends: tuple[float, float],
) -> Laws:
    """Piecewise-linear law through given one-sided values at its kinks; `ends` are the two outer
    slopes."""
    points = [
        p
        for s, *both in zip(kinks, left, right, strict=True)
        for p in ((s, float(b)) for b in both)
    ]
    return replace(
        shapes.piecewise_linear(points, False, None, [float(q) for q in ends]), name=name
    )


def slip_weakening(mu_s: float = 1.0, mu_k: float = 0.5, d: float = 0.1) -> Laws:
    return shapes.slip_weakening(mu_s, mu_k, d)


def exponential_decay(mu_s: float = 1.0, mu_k: float = 0.5, d: float = 0.1) -> Laws:
    return shapes.exponential(mu_s, mu_k, d)


def spring(stiffness: float = 1.0) -> Laws:
    return shapes.linear(stiffness)


def sawtooth(mu: float = 1.0, d: float = 0.1, slope: float = 5.0, drop: float = 0.5) -> Laws:
    """Stick at 0, then rising teeth that end in down-jumps, odd (delamination in steps)."""
    starts = [mu * drop**i for i in range(4)]
    points = [
        p for i in range(3) for p in ((i * d, starts[i]), ((i + 1) * d, starts[i] + slope * d))
    ]
    return shapes.piecewise_linear([*points, (3 * d, starts[3])], True, None, None)


def half_laplacian(m: int, stiffness: float = 1.0) -> tuple[Array, Array]:
    """(Ã, c) of a clamped half-plane model: eigenvalues proportional to the wave number, λ₁ =
    π·stiffness."""
    k, h = np.arange(1, m + 1), 1.0 / (m + 1)
    modes = np.sqrt(2.0 / (m + 1)) * np.sin(np.pi * np.outer(k, k) / (m + 1))
    A_tilde = (modes * (h * np.pi * stiffness * k)) @ modes.T
    return 0.5 * (A_tilde + A_tilde.T), np.full(m, h)


def ill_conditioned(rng: np.random.Generator, m: int, condition: float) -> Array:
    """Q D Qᵀ with eigenvalues spread evenly in the logarithm over `condition`."""
    Q = np.linalg.qr(rng.normal(size=(m, m)))[0]
    A = (Q * condition ** (rng.uniform(0.0, 1.0, m) - 0.5)) @ Q.T
    return np.asarray(0.5 * (A + A.T))


def random_stiffness(rng: np.random.Generator, m: int) -> tuple[Array, Array]:
    """(Ã, c): a half-Laplacian with uneven cells and a random coupling of up to its own size, or a
    random matrix."""
    A_tilde, c = half_laplacian(m)
    c = c * rng.uniform(0.5, 1.5, m)
    if rng.random() < 0.3:
        factor = rng.normal(size=(m, m)) / np.sqrt(m)
        A_tilde = A_tilde + rng.uniform(0.1, 1.0) * c.mean() * factor @ factor.T
    return A_tilde, c


def random_law(
    rng: np.random.Generator, lambda_1: float, max_kinks: int = 41, smooth: bool = False
) -> Laws:
    """Random law of unit size: up- and down-jumps, pieces that fall by up to 100 λ₁, growth (15),
    (16) kept."""
    count = int(rng.integers(1, max_kinks + 1))
    steepest = lambda_1 * 10.0 ** rng.uniform(-1.0, 2.0)
    spacing = 10.0 ** rng.uniform(-2.0, 0.0) * rng.uniform(0.2, 1.8, count - 1)
    kinks = np.concatenate([[0.0], np.cumsum(spacing)])
    kinks = kinks - kinks[rng.integers(count)] * (rng.random() < 0.8)
    slopes = np.where(rng.random(count - 1) < 0.6, -1.0, 1.0) * steepest * rng.random(count - 1)
    rise = np.clip(slopes * spacing, -1.5, 1.5)
    jump = rng.normal(size=count) * (rng.random(count) < 0.7) * rng.choice([0.2, 1.0])
    jump[rng.integers(count)] += 1.0
    left = -rng.uniform(0.1, 1.0) + np.concatenate([[0.0], np.cumsum(jump[:-1] + rise)])
    right = left + jump
    if right[-1] <= 0.1:
        right[-1] = rng.uniform(0.1, 1.0)
    ends = rng.uniform(0.0, 1.0, 2) * lambda_1 * (rng.random(2) < 0.3)
    law = linear_law("random", kinks.tolist(), left.tolist(), right.tolist(), (ends[0], ends[1]))
    return _bent(rng, law) if smooth else law


def _bent(rng: np.random.Generator, law: Laws) -> Laws:
    """Some pieces turned into exponentials with the same values at their ends (outer pieces: a
    decaying part)."""
    s, b_0, q = law.kinks, law.b_0.copy(), law.q.copy()
    a, r = np.zeros(len(q)), np.zeros(len(q))
    fastest = 20.0 / max(float(np.max(np.abs(s))), 0.1)
    for k in range(1, len(s)):
        if rng.random() < 0.5:
            rate = rng.uniform(0.3, 3.0) / (s[k] - s[k - 1])
            r[k] = rng.choice([-1.0, 1.0]) * min(rate, fastest)
            first, last = law.b_right[k - 1], law.b_left[k]
            part = np.exp(-r[k] * (s[k - 1 : k + 1] - law.s_0[k]))
            a[k] = (first - last) / (part[0] - part[1])
            b_0[k], q[k] = first - a[k] * part[0], 0.0
    for k, sign in ((0, -1.0), (-1, 1.0)):
        if rng.random() < 0.5:
            r[k] = sign * min(10.0 ** rng.uniform(0.0, 1.5), fastest)
            a[k] = sign * rng.uniform(0.0, 1.0)
    return Laws("random smooth", s, law.s_0, b_0, q, a, r)


def random_problem(
    rng: np.random.Generator, m: int, max_kinks: int = 41, smooth: bool = False
) -> ContactProblem:
    """Random stiffness, law and load; the load grows through first slip (0.5 to 3 times the size of
    b)."""
    A_tilde, c = random_stiffness(rng, m)
    law = random_law(rng, least_eigenvalue(A_tilde, c), max_kinks, smooth)
    law.check_growth()
    x = (np.arange(m) + 0.5) / m
    shape = rng.normal() + sum(
        rng.normal() / k * np.sin(np.pi * k * x + rng.uniform(0, 6)) for k in range(1, 6)
    )
    if rng.random() < 0.2:
        shape = shape + 0.3 * rng.normal(size=m)
    size = rng.uniform(0.5, 3.0) * law.b_scale / np.max(np.abs(shape))
    return ContactProblem(A_tilde, c * shape * size, c, law)


def rescaled(
    problem: ContactProblem, s_unit: float, b_unit: float, x_unit: float
) -> ContactProblem:
    """The same problem with slips, tractions and lengths along the contact measured in other
    units."""
    return ContactProblem(
        problem.A_tilde * (s_unit / b_unit / x_unit),
        problem.l_tilde / (b_unit * x_unit),
        problem.c / x_unit,
        problem.law.placed(1.0 / b_unit, 1.0 / s_unit),
    )


def independent_residual(problem: ContactProblem, v: Array, v_low: Array | None = None) -> float:
    """Inclusion residual by plain loops, ξ summed without error; displacements may be sums v +
    v_low of two doubles."""
    law, low = problem.law, np.zeros(problem.m) if v_low is None or not len(v_low) else v_low
    traction = _exact_xi(problem, v, low) / problem.c
    worst, largest = 0.0, 0.0

    def piece_value(k: int, s: float, s_low: float = 0.0) -> float:
        apart = (s - law.s_0[k]) + s_low
        return float(law.b_0[k] + law.q[k] * apart + law.a[k] * np.exp(-law.r[k] * apart))

    for node, s in enumerate(zip(v, low, strict=True)):
        below = sum(1 for kink in law.kinks if (kink, 0.0) < s)
        values = [
            piece_value(k, *s)
            for k in {below, below + sum(1 for kink in law.kinks if (kink, 0.0) == s)}
        ]
        gap = max(min(values) - float(traction[node]), float(traction[node]) - max(values), 0.0)
        worst = gap if not gap <= worst else worst
    for k, kink in enumerate(law.kinks):
        largest = max(largest, abs(piece_value(k, kink)), abs(piece_value(k + 1, kink)))
    for k in (0, len(law.q) - 1):
        largest = max(largest, abs(float(law.b_0[k])) if law.q[k] == 0.0 else 0.0)
    return worst / (largest or float(np.max(np.abs(problem.l_tilde / problem.c))))


def _exact_xi(problem: ContactProblem, v: Array, v_low: Array) -> Array:
    """l̃ − Ã(v + v_low), rounded once: products of halves of doubles are doubles, and fsum adds
    without error."""

    def halves(x: Array) -> tuple[Array, Array]:
        high = 134217729.0 * x
        high = high - (high - x)
        return high, x - high

    A, parts = halves(problem.A_tilde), (*halves(v), v_low)
    rows = np.concatenate(
        [problem.l_tilde[:, None], *(-half * part for half in A for part in parts)], axis=1
    )
    return np.array([math.fsum(row) for row in rows.tolist()])


def some_laws() -> list[Laws]:
    """One law of every kind: softening, smooth, without kinks, with down-jumps, and two random
    ones."""
    rng = np.random.default_rng(7)
    return [
        slip_weakening(1.0, 0.4, 0.15),
        exponential_decay(1.0, 0.5, 0.1),
        spring(2.0),
        sawtooth(),
        random_law(rng, np.pi, 9),
        random_law(rng, np.pi, 9, smooth=True),
    ]


def block(
    m: int, laws: Sequence[Laws], points: int, seed: int = 0
) -> tuple[CondensedBody, Array, Laws, Index]:
    """(body, loads (P, m), tables, law of every point): waves of 0.4 to 2.5 times the size of b."""
    rng = np.random.default_rng([seed, m])
    body = CondensedBody.of(*half_laplacian(m))
    law = rng.integers(0, len(laws), points)
    x, loads = (np.arange(m) + 0.5) / m, np.empty((points, m))
    for p in range(points):
        waves = (rng.normal() / k * np.sin(np.pi * k * x + rng.uniform(0, 6)) for k in range(1, 5))
        shape = rng.normal() + sum(waves)
        size = laws[law[p]].b_scale or 1.0
        loads[p] = body.c * shape * rng.uniform(0.4, 2.5) * size / np.max(np.abs(shape))
    return body, loads, Laws.of(laws), law


def solve_points(
    body: CondensedBody, loads: Array, tables: Laws, law: Index, tolerance: float | None = None
) -> Answer:
    """All points as one block with only the laws in use."""
    used, rows = np.unique(law, return_inverse=True)
    return solve_block(body, loads, tables.at(used[rows].reshape(-1, 1)), tolerance=tolerance)
