"""Observed orders of convergence, expected orders, and settings that are not dominated.

Order between levels: r_i = log(e_{i−1}/e_i) / log(h_{i−1}/h_i)
Fitted order:         least squares of log e over log h, with its standard error, on the asymptotic
                      levels: the longest run up to the finest over which rates differ by at most
                      SETTLED; on all levels, and marked as not settled, if no two rates agree

Expected, with u ~ r^α in the worst corner of the body, u_T ~ r^γ and ξ ~ r^δ in the worst points of
Γ_C (uniform meshes, P1; on meshes graded like h r^(1−μ) towards a point its exponents, with what is
added to them, over μ):

    |u − u_h|₁ and energy:          min(1, α)                                approximation
    ‖u − u_h‖:                      2 min(1, α)                              duality
    u_T on Γ_C, L² and max:         min(2, 2α, γ + ½), min(2, 2α, γ)
    ξ on Γ_C, L² as steps:          min(1, 2α, δ + ½)
    ξ on Γ_C, L² and max at nodes:  min(2, 2α, δ + ½), min(2, 2α, δ)
    s_N, S_N of edges that open:    as u_T and ξ, with γ and δ of their own

With θ ~ r^γ' in the worst corner of a temperature that is solved for, ‖θ − θ_h‖ falls like 2 min(1,
γ'), |θ − θ_h|₁ like min(1, γ'). Where it loads the body, no error of u and ξ falls faster than ‖θ −
θ_h‖, and u ~ r^{1+γ'} there.

The orders on Γ_C are those of the best approximation, with the pollution 2α from the corner. In the
maximum norm P1 is of order h² |log h| and no better (R. Haverkamp, SIAM J. Numer. Anal. 21 (1984)
489–496). Points of Γ_C:

    sticking corner:  γ = α of the corner, δ = γ − 1
    slipping corner:  γ = 1 at most (u ~ r log r: the friction stress meets an edge with another
                      shear stress), and δ = γ, because ξ = b(u_T)
    stick meets slip: γ = 3/2, δ = 1/2; the r^{1/2} term of the mixed problem would break the bound
                      of the law
    lift-off:         γ = 3/2, δ = 1/2 of S_N, alike: the r^{1/2} term would be tension, or overlap.
                      The other traction is b of a displacement, and as smooth: δ = 3/2
    cohesive front:   S_N = b(s_N) has a kink at most where a law bends, which P1 does not see
    open corner:      as a slipping one, with S_N = b(s_N)
    constrained end:  a node of Γ_C without an unknown gives its half cell to its neighbour (method
                      §2), whose c is then 3/2 h for a load ∫φ = h: γ = δ = 1 where that neighbour
                      slips, and where it sticks ξ is off by a third of itself, δ = 0. This is of
                      the discretisation, whatever the solution
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from tcstudy.accuracy.corners import SMOOTH, Vertex, corner_words

Array = NDArray[np.float64]

SETTLED = 0.2
"""Rates that differ by no more than this belong to one asymptotic range."""
ROUNDING = 1e-11
"""Relative error below which a solution counts as exact: the rest is rounding and has no order."""
CONDITION = 64.0
"""Condition of a stiffness matrix over (size of the body/h)²: rounding grows like it.

On patch tests, whose errors are nothing else, errors come to 0.01 to 12 of it.
"""
NAN = float("nan")


@dataclass(frozen=True)
class Fit:
    """The convergence of one error.

    rate:        (levels,) order from the level before; NaN where there is none
    slope:       fitted order from `first_level` on; NaN with fewer than two levels
    slope_error: its standard error; NaN with fewer than three levels
    first_level: the first asymptotic level, the first level at all if not settled; −1 if there is
                 none
    settled:     at least two rates agree; otherwise the levels are pre-asymptotic or too few
    exact:       the error is rounding on all levels
    """

    rate: Array
    slope: float
    slope_error: float
    first_level: int
    settled: bool
    exact: bool


def rounding_level(h: Array, tolerance: float = 0.0) -> Array:
    """Return (levels,) relative error that may be rounding, `tolerance` at least.

    h: (levels,) relative to the size of the body
    """
    of_matrix = CONDITION * np.finfo(float).eps / h**2
    return np.asarray(np.maximum(max(ROUNDING, tolerance), of_matrix))


def fit(
    h: Array, error: Array, usable: NDArray[np.bool_], rounding: Array | float = ROUNDING
) -> Fit:
    """Return rates and slope of relative errors (levels,) on meshes of size h.

    usable:   (levels,) levels that count
    rounding: error (levels,) at which rates end, for example the tolerance of the solver
    """
    is_good = usable & np.isfinite(error)
    rates = np.full(len(h), NAN)
    if not is_good.any():
        return Fit(rates, NAN, NAN, -1, False, False)
    if np.all((error <= rounding)[is_good]):
        return Fit(rates, NAN, NAN, int(np.flatnonzero(is_good)[0]), True, True)
    is_good &= error > rounding
    levels = np.flatnonzero(is_good)
    for before, level in itertools.pairwise(levels):
        rates[level] = np.log(error[before] / error[level]) / np.log(h[before] / h[level])
    # the finest levels whose rates lie within SETTLED of each other, at least two levels
    start = max(0, len(levels) - 2)
    while start > 0 and np.ptp(rates[levels[start:]]) <= SETTLED:
        start -= 1
    settled = len(levels) - start >= 3
    fitted_levels = levels[start:] if settled else levels
    slope, slope_error = _slope(np.log(h[fitted_levels]), np.log(error[fitted_levels]))
    first_level = int(fitted_levels[0]) if len(fitted_levels) else -1
    return Fit(rates, slope, slope_error, first_level, settled, False)


def log_share(h: Array) -> float:
    """Return by how much the slope of h² (1 + log(1/h)) stays below 2.

    h: (levels,) relative to the size of the body
    """
    if len(h) <= 1:
        return 0.0
    return -_slope(np.log(h), np.log1p(-np.log(h)))[0]


def _slope(x: Array, y: Array) -> tuple[float, float]:
    """Return the slope of the least-squares line and its standard error."""
    if len(x) < 2:
        return NAN, NAN
    if len(x) == 2:
        return float(np.diff(y)[0] / np.diff(x)[0]), NAN
    (slope, _), covariance = np.polyfit(x, y, 1, cov=True)
    return float(slope), float(np.sqrt(covariance[0, 0]))


TIED = 1e-9
"""Relative difference of errors that is rounding, as on one mesh that two families begin with."""


def equal_settings(sizes: Array, error: Array) -> NDArray[np.intp]:
    """Return for each of n settings the first that has the same mesh and the same error.

    sizes: (n, k) what tells meshes apart, such as their unknowns;  error: (n,)
    """
    first = np.arange(len(error))
    for i in range(len(error)):
        same_mesh = np.all(np.abs(sizes[:i] - sizes[i]) <= TIED * np.abs(sizes[i]), axis=1)
        same_error = np.abs(error[:i] - error[i]) <= TIED * np.abs(error[i])
        equal = np.flatnonzero(same_mesh & same_error)
        if len(equal):
            first[i] = first[equal[0]]
    return first


def dominated(cost: Array, error: Array) -> NDArray[np.bool_]:
    """Return (n,) points that are not on the Pareto front; all with NaN.

    Another point costs and errs no more, but for TIED, and less in one of the two.
    """
    is_known = np.isfinite(cost) & np.isfinite(error)
    is_dominated = np.ones(len(cost), dtype=bool)
    for i in np.flatnonzero(is_known):
        is_no_worse = is_known & (cost <= cost[i]) & (error <= error[i] * (1.0 + TIED))
        is_better = (cost < cost[i]) | (error < error[i] * (1.0 - TIED))
        is_dominated[i] = bool((is_no_worse & is_better).any())
    return is_dominated


@dataclass(frozen=True)
class Singularity:
    """The leading exponent at a place, and the place in words.

    An exponent of SMOOTH sets no limit.

    mu: grading of the meshes there, h(r) ~ h r^(1−μ); in r^μ, of which a graded mesh is uniform,
        r^α is of exponent α/μ
    """

    exponent: float
    why: str
    mu: float = 1.0

    def order(self, times: float = 1.0, plus: float = 0.0) -> Singularity:
        """Return what limits an order at times·α + plus on uniform meshes, as a limit in h."""
        limit = SMOOTH
        if self.exponent < SMOOTH:
            limit = (times * self.exponent + plus) / self.mu
        why = self.why
        if self.mu != 1.0:
            why = f"{self.why}, graded with mu = {self.mu:g}"
        return Singularity(limit, why)


Smoothness = dict[str, list[Singularity]]
"""Limits of u in the body, u_T and ξ on Γ_C, and θ: `body`, `u_T`, `xi`, `theta`.

`load` has those of θ as far as it loads the body, `s_N` and `S_N` those of edges that may lift off.
"""


@dataclass(frozen=True)
class Expected:
    """An expected order with its reason.

    log:      up to a factor 1 + |log h|
    analysed: all places that could lower it were looked at
    """

    order: float
    reason: str
    log: bool = False
    analysed: bool = True


NO_LIMIT = Singularity(SMOOTH, "smooth")
NOT_ANALYSED = "corners not analysed"


def smooth_up_to(
    exponent: float | None, slip: bool = False, stick: bool = False, front: bool = False
) -> Smoothness:
    """Return the smoothness of a given solution with u ~ r^exponent, ξ ~ r^(exponent−1).

    exponent:    None if the solution is smooth
    slip, stick: Γ_C has nodes without an unknown whose neighbours slip, or stick, under a notable ξ
    front:       stick meets slip somewhere on Γ_C, where ξ has a kink at least
    """
    body: list[Singularity] = []
    u_T: list[Singularity] = []
    xi: list[Singularity] = []
    if exponent is not None:
        why = f"given: u ~ r^{exponent:g}"
        body.append(Singularity(exponent, why))
        u_T.append(Singularity(exponent, why))
        xi.append(Singularity(exponent - 1, why))
    if front:
        xi.append(Singularity(1.0, "stick meets slip on Γ_C, where ξ has a kink"))
    if slip:
        end = Singularity(1.0, "constrained end of Γ_C next to a slipping node")
        u_T.append(end)
        xi.append(end)
    if stick:
        xi.append(Singularity(0.0, "constrained end of Γ_C next to a sticking node"))
    return {"body": body, "u_T": u_T, "xi": xi}


def smoothness(
    corners: Sequence[Vertex], stick_slip: bool, grading: Sequence[float] = (), loads: bool = False
) -> Smoothness:
    """Return the smoothness of a computed solution.

    stick_slip: stick meets slip somewhere inside Γ_C
    grading:    μ of the meshes at every corner, 1 where they are not graded; by default everywhere
    loads:      temperature loads the body
    """
    limits: Smoothness = {name: [] for name in ("body", "theta", "u_T", "xi")}
    for corner, mu in zip(corners, grading or [1.0] * len(corners), strict=True):
        if math.isnan(corner.exponent):
            continue
        place = corner_words(corner)
        of_corner = [Singularity(corner.exponent, f"{place}: u ~ r^{corner.exponent:.3f}", mu)]
        if corner.heat < 1.0:
            why = f"{place}: θ ~ r^{corner.heat:.3f}"
            limits["theta"].append(Singularity(corner.heat, why, mu))
            if loads:
                of_corner.append(Singularity(1.0 + corner.heat, why, mu))
        worst = _worst(of_corner)
        limits["body"].append(worst)
        if any(words.startswith("sticking") for words in corner.words):
            limits["u_T"].append(worst)
            if worst.exponent == SMOOTH:
                limits["xi"].append(worst)
            else:
                limits["xi"].append(replace(worst, exponent=worst.exponent - 1.0))
        elif corner.steps:
            why = f"{place}: shear stress may jump, u ~ r log r"
            if worst.exponent < 1:
                why = worst.why
            step = Singularity(min(1.0, worst.exponent), why, mu)
            limits["u_T"].append(step)
            limits["xi"].append(step)
    if stick_slip:
        why = "stick meets slip on Γ_C: u ~ r^1.5"
        limits["u_T"].append(Singularity(1.5, why))
        limits["xi"].append(Singularity(0.5, why))
    limits["load"] = limits["theta"] if loads else []
    return limits


def with_openings(
    limits: Smoothness, corners: Sequence[Vertex], stick_slip: bool, lifts_off: bool
) -> Smoothness:
    """Return the smoothness of a computed solution with that of openings, on uniform meshes.

    limits:     those of `smoothness`
    stick_slip: stick meets slip somewhere inside Γ_C
    lifts_off:  closed meets open somewhere inside Γ_C
    """
    s_N: list[Singularity] = []
    S_N: list[Singularity] = []
    u_T = list(limits["u_T"])
    xi = list(limits["xi"])
    for corner in corners:
        if math.isnan(corner.exponent):
            continue
        place = corner_words(corner)
        of_corner = Singularity(corner.exponent, f"{place}: u ~ r^{corner.exponent:.3f}")
        if corner.closed:
            s_N.append(of_corner)
            if corner.steps and not any(words.startswith("sticking") for words in corner.words):
                why = f"{place}: shear stress may jump, S_N ~ log r"
                S_N.append(_worst([Singularity(0.0, why), _less_one(of_corner)]))
            else:
                S_N.append(_less_one(of_corner))
        elif corner.parts:
            step = Singularity(1.0, f"{place}: normal stress may jump, u ~ r log r")
            s_N.append(_worst([step, of_corner]))
            S_N.append(_worst([step, of_corner]))
    if stick_slip:
        why = "stick meets slip on Γ_C: u ~ r^1.5"
        s_N.append(Singularity(1.5, why))
        S_N.append(Singularity(1.5, why))
    if lifts_off:
        why = "Γ_C lifts off: u ~ r^1.5"
        u_T.append(Singularity(1.5, why))
        xi.append(Singularity(1.5, why))
        s_N.append(Singularity(1.5, why))
        S_N.append(Singularity(0.5, why))
    return {**limits, "u_T": u_T, "xi": xi, "s_N": s_N, "S_N": S_N}


def _less_one(singularity: Singularity) -> Singularity:
    """Return the singularity of the derivatives, none of what is smooth."""
    if singularity.exponent == SMOOTH:
        return singularity
    return replace(singularity, exponent=singularity.exponent - 1.0)


def _worst(candidates: Sequence[Singularity]) -> Singularity:
    """Return the singularity that limits orders most."""
    limits = [candidate for candidate in candidates if candidate.exponent < SMOOTH]
    return min(limits, key=lambda limit: limit.exponent / limit.mu, default=NO_LIMIT)


def expected_orders(limits: Smoothness, analysed: bool = True) -> dict[str, Expected]:
    """Return the expected order by error name.

    analysed: all places were looked at; else the orders may be too high
    """
    body = _worst(limits.get("body", ()))
    u_T = _worst(limits.get("u_T", ()))
    xi = _worst(limits.get("xi", ()))
    theta = _worst(limits.get("theta", ()))
    warm = _worst(limits.get("load", ())).order(2.0)
    twice = body.order(2.0)
    polluted = replace(twice, why=f"pollution 2α, {twice.why}")
    orders = {
        "theta_L2": _lowest(2.0, theta.order(2.0)),
        "theta_H1": _lowest(1.0, theta.order()),
        "u_energy": _lowest(1.0, body.order(), warm),
        "u_H1": _lowest(1.0, body.order(), warm),
        "u_L2": _lowest(2.0, twice, warm),
        "u_T_L2": _lowest(2.0, polluted, warm, u_T.order(plus=0.5)),
        "u_T_max": _lowest(2.0, polluted, warm, u_T.order()),
        "xi_L2": _lowest(1.0, polluted, warm, xi.order(plus=0.5)),
        "xi_nodes": _lowest(2.0, polluted, warm, xi.order(plus=0.5)),
        "xi_max": _lowest(2.0, polluted, warm, xi.order()),
    }
    if "s_N" in limits:
        s_N = _worst(limits["s_N"])
        S_N = _worst(limits["S_N"])
        orders |= {
            "opening_L2": _lowest(2.0, polluted, warm, s_N.order(plus=0.5)),
            "opening_max": _lowest(2.0, polluted, warm, s_N.order()),
            "S_N_L2": _lowest(1.0, polluted, warm, S_N.order(plus=0.5)),
            "S_N_nodes": _lowest(2.0, polluted, warm, S_N.order(plus=0.5)),
            "S_N_max": _lowest(2.0, polluted, warm, S_N.order()),
        }
    for name, expected in orders.items():
        if name.endswith("_max") and expected.order == 2.0:
            reason = f"{expected.reason}: h² |log h|"
            expected = replace(expected, reason=reason, log=True)
        if not analysed:  # places not looked at may lower the orders
            reason = f"{expected.reason}; {NOT_ANALYSED}"
            if expected.reason.startswith(NO_LIMIT.why):
                reason = NOT_ANALYSED
            expected = replace(expected, reason=reason, analysed=False)
        orders[name] = expected
    return orders


def _lowest(full: float, *limits: Singularity) -> Expected:
    """Return the full order of P1, or the lowest limit."""
    worst = min(limits, key=lambda limit: limit.exponent)
    if worst.exponent < full - 1e-9:
        return Expected(worst.exponent, worst.why)
    if worst.exponent >= SMOOTH:
        return Expected(full, "smooth")
    reason = "smooth enough for the full order"
    if "graded" in worst.why:  # a singular place that does not limit the order
        reason = f"{reason} ({worst.why})"
    return Expected(full, reason)
