"""Rates of convergence with their uncertainty, the settings that no other beats in cost and error
together, and the order to expect of each error from how smooth the solution is.

Rate between levels:  r_i = log(e_{i−1}/e_i) / log(h_{i−1}/h_i)
Slope:                least squares of log e over log h, with its standard error, on the asymptotic levels: the longest
                      run up to the finest over which rates differ by at most SETTLED; on all, and
                      marked as not
                      settled, if no two rates agree

Expected, with u ~ r^α in the worst corner of the body, u_T ~ r^γ and ξ ~ r^δ in the worst points of
Γ_C (uniform meshes, P1; on meshes graded like h r^(1−μ) towards a point its exponents, with what is
added to them, over μ):

    |u − u_h|₁ and energy:          min(1, α)                                approximation
    ‖u − u_h‖:                      2 min(1, α)                              duality
    u_T on Γ_C, L² and max:         min(2, 2α, γ + ½), min(2, 2α, γ)
    ξ on Γ_C, L² as steps:          min(1, 2α, δ + ½)
    ξ on Γ_C, L² and max at nodes:  min(2, 2α, δ + ½), min(2, 2α, δ)

With θ ~ r^γ' in the worst corner of a temperature that is solved for, ‖θ − θ_h‖ falls like 2 min(1,
γ'), |θ − θ_h|₁ like min(1, γ'). Where it loads the body, no error of u and ξ falls faster than ‖θ −
θ_h‖, and u ~ r^{1+γ'} there.

The orders on Γ_C are those of the best approximation, with the pollution 2α from the corner. In the
maximum norm P1 is of order h² |log h| and no better (R. Haverkamp, SIAM J. Numer. Anal. 21 (1984)
489–496). Points of Γ_C:

    sticking corner:  γ = α of the corner, δ = γ − 1
    slipping corner:  γ = 1 at most (u ~ r log r: the friction stress meets an edge with another shear stress), and
                      δ = γ, because ξ = b(u_T)
    stick meets slip: γ = 3/2, δ = 1/2; the r^{1/2} term of the mixed problem would break the bound of the law
    held end:         a node of Γ_C without an unknown gives its half cell to its neighbour (method §2), whose c is then
                      3/2 h for a load ∫φ = h: γ = δ = 1 where that neighbour slips, and where it
                      sticks ξ is off by a
                      third of itself, δ = 0. This is of the discretisation, whatever the solution
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
"""Relative error below which a solution is called exact: what is left is rounding and has no
rate."""
CONDITION = 64.0
"""Condition of a stiffness matrix over (size of the body/h)²: rounding grows like it. On patch
tests, whose errors are nothing else, errors come to 0.01 to 12 of it."""
NAN = float("nan")


@dataclass(frozen=True)
class Fit:
    """The convergence of one error.

    rate:        (levels,) from the level before; NaN where there is none
    slope:       least-squares order from `first_level` on; NaN with fewer than two levels
    slope_error: its standard error; NaN with fewer than three levels
    first_level: the first asymptotic level, the first level at all if not settled; −1 if there is none
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
    """(levels,) relative error that may be rounding, h being over the size of the body; `tolerance`
    at least."""
    return np.asarray(np.maximum(max(ROUNDING, tolerance), CONDITION * np.finfo(float).eps / h**2))


def fit(
    h: Array, error: Array, usable: NDArray[np.bool_], rounding: Array | float = ROUNDING
) -> Fit:
    """Rates and slope of relative errors (levels,) on meshes of size h, from the usable levels
    alone.

    rounding: error (levels,) at which rates end, for example the tolerance of the solver
    """
    good = usable & np.isfinite(error)
    rates = np.full(len(h), NAN)
    if not good.any():
        return Fit(rates, NAN, NAN, -1, False, False)
    if np.all((error <= rounding)[good]):
        return Fit(rates, NAN, NAN, int(np.flatnonzero(good)[0]), True, True)
    good &= error > rounding
    levels = np.flatnonzero(good)
    for before, level in itertools.pairwise(levels):
        rates[level] = np.log(error[before] / error[level]) / np.log(h[before] / h[level])
    start = max(
        0, len(levels) - 2
    )  # the finest levels whose rates lie within SETTLED of each other, two at least
    while start > 0 and np.ptp(rates[levels[start:]]) <= SETTLED:
        start -= 1
    settled = len(levels) - start >= 3
    run = levels[start:] if settled else levels
    slope, standard_error = _slope(np.log(h[run]), np.log(error[run]))
    return Fit(rates, slope, standard_error, int(run[0]) if len(run) else -1, settled, False)


def log_share(h: Array) -> float:
    """By how much the slope of h² (1 + log(1/h)) stays below 2; h: (levels,) over the size of the
    body."""
    return -_slope(np.log(h), np.log1p(-np.log(h)))[0] if len(h) > 1 else 0.0


def _slope(x: Array, y: Array) -> tuple[float, float]:
    """Slope of the least-squares line and its standard error."""
    if len(x) < 3:
        return (float(np.diff(y)[0] / np.diff(x)[0]) if len(x) == 2 else NAN), NAN
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
    """(n,) points for which another costs and errs no more, but for TIED, and less in one of the
    two; all with NaN."""
    known = np.isfinite(cost) & np.isfinite(error)
    out = np.ones(len(cost), dtype=bool)
    for i in np.flatnonzero(known):
        no_worse = known & (cost <= cost[i]) & (error <= error[i] * (1.0 + TIED))
        out[i] = bool((no_worse & ((cost < cost[i]) | (error < error[i] * (1.0 - TIED)))).any())
    return out


@dataclass(frozen=True)
class Singularity:
    """The leading exponent at a place, and the place in words. An exponent of SMOOTH sets no limit.

    mu: grading of the meshes there, h(r) ~ h r^(1−μ); in r^μ, of which a graded mesh is uniform,
    r^α is of exponent α/μ
    """

    exponent: float
    why: str
    mu: float = 1.0

    def order(self, times: float = 1.0, plus: float = 0.0) -> Singularity:
        """What limits an order at times·α + plus on uniform meshes, as a limit of the order in h
        itself."""
        reached = (times * self.exponent + plus) / self.mu if self.exponent < SMOOTH else SMOOTH
        return Singularity(
            reached, self.why if self.mu == 1.0 else f"{self.why}, graded with mu = {self.mu:g}"
        )


Smoothness = dict[str, list[Singularity]]
"""What limits u in the body, u_T and ξ on Γ_C, and θ: `body`, `u_T`, `xi`, `theta`; `load`: θ as
far as it loads the body."""


@dataclass(frozen=True)
class Expected:
    """An order with its reason; log: up to a factor 1 + |log h|;  analysed: all that could lower it was looked at."""

    order: float
    reason: str
    log: bool = False
    analysed: bool = True


NO_LIMIT = Singularity(SMOOTH, "smooth")
NOT_ANALYSED = "corners not analysed"


def smooth_up_to(
    exponent: float | None, slip: bool = False, stick: bool = False, front: bool = False
) -> Smoothness:
    """Smoothness of a given solution with u ~ r^exponent, ξ ~ r^(exponent−1); None if it is smooth.

    slip, stick: Γ_C has nodes without an unknown whose neighbours slip, or stick, under a notable ξ
    front:       stick meets slip somewhere on Γ_C, where ξ has a kink at least
    """
    u_T, xi, body = list[Singularity](), list[Singularity](), list[Singularity]()
    if exponent is not None:
        why = f"given: u ~ r^{exponent:g}"
        body, xi = [Singularity(exponent, why)], [Singularity(exponent - 1, why)]
        u_T += body
    if front:
        xi.append(Singularity(1.0, "stick meets slip on Γ_C, where ξ has a kink"))
    if slip:
        u_T.append(Singularity(1.0, "held end of Γ_C, whose half cell goes to a slipping node"))
        xi.append(u_T[-1])
    if stick:
        xi.append(Singularity(0.0, "held end of Γ_C, whose half cell goes to a sticking node"))
    return {"body": body, "u_T": u_T, "xi": xi}


def smoothness(
    corners: Sequence[Vertex], stick_slip: bool, grading: Sequence[float] = (), loads: bool = False
) -> Smoothness:
    """Smoothness of a computed solution.

    stick_slip: stick meets slip somewhere inside Γ_C
    grading:    μ of the meshes at every corner, 1 where they are not graded; by default everywhere
    loads:      temperature loads the body
    """
    found: Smoothness = {name: [] for name in ("body", "theta", "u_T", "xi")}
    for v, mu in zip(corners, grading or [1.0] * len(corners), strict=True):
        if math.isnan(v.exponent):
            continue
        where = corner_words(v)
        own = [Singularity(v.exponent, f"{where}: u ~ r^{v.exponent:.3f}", mu)]
        if v.heat < 1.0:
            found["theta"].append(Singularity(v.heat, f"{where}: θ ~ r^{v.heat:.3f}", mu))
            own += [Singularity(1.0 + v.heat, found["theta"][-1].why, mu)] if loads else []
        worst = _worst(own)
        found["body"].append(worst)
        if "sticking contact" in v.words:
            found["u_T"].append(worst)
            found["xi"].append(
                worst if worst.exponent == SMOOTH else replace(worst, exponent=worst.exponent - 1.0)
            )
        elif v.steps:
            why = (
                worst.why if worst.exponent < 1 else f"{where}: shear stress may jump, u ~ r log r"
            )
            found["u_T"].append(Singularity(min(1.0, worst.exponent), why, mu))
            found["xi"].append(found["u_T"][-1])
    if stick_slip:
        why = "stick meets slip on Γ_C: u ~ r^1.5"
        found["u_T"].append(Singularity(1.5, why))
        found["xi"].append(Singularity(0.5, why))
    return found | {"load": found["theta"] if loads else []}


def _worst(candidates: Sequence[Singularity]) -> Singularity:
    limits = (c for c in candidates if c.exponent < SMOOTH)
    return min(limits, key=lambda c: c.exponent / c.mu, default=NO_LIMIT)


def expected_orders(of: Smoothness, analysed: bool = True) -> dict[str, Expected]:
    """Expected order by error name. analysed: all places were looked at; else the orders may be too
    high"""
    body, u_T, xi, theta, load = (
        _worst(of.get(name, ())) for name in ("body", "u_T", "xi", "theta", "load")
    )
    twice, warm = body.order(2.0), load.order(2.0)
    polluted = replace(twice, why=f"pollution 2α, {twice.why}")
    orders = {
        "theta_L2": _least(2.0, theta.order(2.0)),
        "theta_H1": _least(1.0, theta.order()),
        "u_energy": _least(1.0, body.order(), warm),
        "u_H1": _least(1.0, body.order(), warm),
        "u_L2": _least(2.0, twice, warm),
        "u_T_L2": _least(2.0, polluted, warm, u_T.order(plus=0.5)),
        "u_T_max": _least(2.0, polluted, warm, u_T.order()),
        "xi_L2": _least(1.0, polluted, warm, xi.order(plus=0.5)),
        "xi_nodes": _least(2.0, polluted, warm, xi.order(plus=0.5)),
        "xi_max": _least(2.0, polluted, warm, xi.order()),
    }
    for name, found in orders.items():
        if name.endswith("_max") and found.order == 2.0:
            orders[name] = found = replace(found, reason=f"{found.reason}: h² |log h|", log=True)
        if not analysed:  # places not looked at may lower the orders
            smooth = found.reason.startswith(NO_LIMIT.why)
            reason = NOT_ANALYSED if smooth else f"{found.reason}; {NOT_ANALYSED}"
            orders[name] = replace(found, reason=reason, analysed=False)
    return orders


def _least(full: float, *limits: Singularity) -> Expected:
    """The full order of P1, or what limits it."""
    worst = min(limits, key=lambda s: s.exponent)
    if worst.exponent < full - 1e-9:
        return Expected(worst.exponent, worst.why)
    after = (
        f" ({worst.why})" if "graded" in worst.why else ""
    )  # a singular place that does not limit the order
    return Expected(
        full, "smooth" if worst.exponent >= SMOOTH else f"smooth enough for the full order{after}"
    )
