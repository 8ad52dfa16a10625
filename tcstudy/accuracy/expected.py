"""The order of convergence to expect of each error, from how smooth the solution is.

With u ~ r^α in the worst corner of the body, u_T ~ r^γ and ξ ~ r^δ in the worst points of Γ_C (uniform meshes, P1;
on meshes graded like h r^(1−μ) towards a point its exponents, with what is added to them, are divided by μ):

    |u − u_h|₁ and energy:          min(1, α)                                approximation
    ‖u − u_h‖:                      2 min(1, α)                              duality
    u_T on Γ_C, L² and max:         min(2, 2α, γ + ½), min(2, 2α, γ)
    ξ on Γ_C, L² as steps:          min(1, 2α, δ + ½)
    ξ on Γ_C, L² and max at nodes:  min(2, 2α, δ + ½), min(2, 2α, δ)

With θ ~ r^γ' in the worst corner of a temperature that is solved for, ‖θ − θ_h‖ falls like 2 min(1, γ'), |θ − θ_h|₁
like min(1, γ'). Where it loads the body, no error of u and ξ falls faster than ‖θ − θ_h‖, and u ~ r^{1+γ'} there.

The orders on Γ_C are those of the best approximation, with the pollution 2α from the corner. In the maximum norm P1 is
of order h² |log h| and no better (R. Haverkamp, SIAM J. Numer. Anal. 21 (1984) 489–496). Points of Γ_C:

    sticking corner:  γ = α of the corner, δ = γ − 1
    slipping corner:  γ = 1 at most (u ~ r log r: the friction stress meets an edge with another shear stress), and
                      δ = γ, because ξ = b(u_T)
    stick meets slip: γ = 3/2, δ = 1/2; the r^{1/2} term of the mixed problem would break the bound of the law
    held end:         a node of Γ_C without an unknown gives its half cell to its neighbour (method §2), whose c is then
                      3/2 h for a load ∫φ = h: γ = δ = 1 where that neighbour slips, and where it sticks ξ is off by a
                      third of itself, δ = 0. This is of the discretisation, whatever the solution
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from tcstudy.accuracy.corners import SMOOTH, Vertex, corner_words


@dataclass(frozen=True)
class Singularity:
    """The leading exponent at a place, and the place in words. An exponent of SMOOTH sets no limit.

    mu: grading of the meshes there, h(r) ~ h r^(1−μ); in r^μ, of which a graded mesh is uniform, r^α is of exponent α/μ
    """

    exponent: float
    why: str
    mu: float = 1.0

    def order(self, times: float = 1.0, plus: float = 0.0) -> Singularity:
        """What limits an order at times·α + plus on uniform meshes, as a limit of the order in h itself."""
        reached = (times * self.exponent + plus) / self.mu if self.exponent < SMOOTH else SMOOTH
        return Singularity(reached, self.why if self.mu == 1.0 else f"{self.why}, graded with mu = {self.mu:g}")


@dataclass(frozen=True)
class Smoothness:
    """The worst place for u in the body, for u_T and for ξ on Γ_C, and for θ; `load` as far as it loads the body.

    analysed: all places were looked at; else the orders that follow may be too high
    """

    body: Singularity
    u_T: Singularity
    xi: Singularity
    theta: Singularity
    load: Singularity
    analysed: bool = True


@dataclass(frozen=True)
class Expected:
    """An expected order with its reason; log: up to a factor 1 + |log h|, as that of P1 in the maximum norm.

    analysed: all that could lower the order was looked at
    """

    order: float
    reason: str
    log: bool = False
    analysed: bool = True


NO_LIMIT = Singularity(SMOOTH, "smooth")
NOT_ANALYSED = "corners not analysed"


@dataclass(frozen=True)
class HeldEnds:
    """Whether Γ_C has nodes without an unknown whose neighbours slip, or stick, under a notable ξ."""

    slip: bool = False
    stick: bool = False


def smooth_up_to(exponent: float | None, ends: HeldEnds, front: bool = False) -> Smoothness:
    """Smoothness of a given solution with u ~ r^exponent, ξ ~ r^(exponent−1); None if it is smooth.

    front: stick meets slip somewhere on Γ_C, where ξ has a kink at least
    """
    why = "smooth" if exponent is None else f"given: u ~ r^{exponent:g}"
    given = NO_LIMIT if exponent is None else Singularity(exponent, why)
    xi = [NO_LIMIT if exponent is None else Singularity(exponent - 1, why)]
    u_T = [given]
    if front:
        xi.append(Singularity(1.0, "stick meets slip on Γ_C, where ξ has a kink"))
    if ends.slip:
        u_T.append(Singularity(1.0, "held end of Γ_C, whose half cell goes to a slipping node"))
        xi.append(u_T[-1])
    if ends.stick:
        xi.append(Singularity(0.0, "held end of Γ_C, whose half cell goes to a sticking node"))
    return Smoothness(given, _worst(u_T), _worst(xi), NO_LIMIT, NO_LIMIT)


def smoothness(
    corners: Sequence[Vertex] | None, stick_slip: bool, grading: Sequence[float] = (), loads: bool = False
) -> Smoothness:
    """Smoothness of a computed solution.

    corners:    None where they are not analysed;  stick_slip: stick meets slip somewhere inside Γ_C
    grading:    μ of the meshes at every corner, 1 where they are not graded; by default everywhere
    loads:      temperature loads the body
    """
    body, theta, u_T, xi = [], [], [], []
    for v, mu in zip(corners or (), grading or [1.0] * len(corners or ()), strict=True):
        where = corner_words(v)
        own = [Singularity(v.exponent, f"{where}: u ~ r^{v.exponent:.3f}", mu)]
        if v.heat < 1.0:
            theta.append(Singularity(v.heat, f"{where}: θ ~ r^{v.heat:.3f}", mu))
            own += [Singularity(1.0 + v.heat, theta[-1].why, mu)] if loads else []
        worst = _worst(own)
        body.append(worst)
        if "sticking contact" in v.words:
            u_T.append(worst)
            xi.append(worst if worst.exponent == SMOOTH else replace(worst, exponent=worst.exponent - 1.0))
        elif v.steps:
            why = worst.why if worst.exponent < 1 else f"{where}: shear stress may jump, u ~ r log r"
            u_T.append(Singularity(min(1.0, worst.exponent), why, mu))
            xi.append(u_T[-1])
    if stick_slip:
        why = "stick meets slip on Γ_C: u ~ r^1.5"
        u_T.append(Singularity(1.5, why))
        xi.append(Singularity(0.5, why))
    warm = _worst(theta)
    return Smoothness(_worst(body), _worst(u_T), _worst(xi), warm, warm if loads else NO_LIMIT, corners is not None)


def _worst(candidates: Sequence[Singularity]) -> Singularity:
    limits = (c for c in candidates if c.exponent < SMOOTH)
    return min(limits, key=lambda c: c.exponent / c.mu, default=NO_LIMIT)


def expected_orders(of: Smoothness) -> dict[str, Expected]:
    """Expected order by error name."""
    body, twice, warm = of.body.order(), of.body.order(2.0), of.load.order(2.0)
    polluted = Singularity(twice.exponent, f"pollution 2α, {twice.why}")
    orders = {
        "theta_L2": _least(2.0, of.theta.order(2.0)),
        "theta_H1": _least(1.0, of.theta.order()),
        "u_energy": _least(1.0, body, warm),
        "u_H1": _least(1.0, body, warm),
        "u_L2": _least(2.0, twice, warm),
        "u_T_L2": _least(2.0, polluted, warm, of.u_T.order(plus=0.5)),
        "u_T_max": _least(2.0, polluted, warm, of.u_T.order()),
        "xi_L2": _least(1.0, polluted, warm, of.xi.order(plus=0.5)),
        "xi_nodes": _least(2.0, polluted, warm, of.xi.order(plus=0.5)),
        "xi_max": _least(2.0, polluted, warm, of.xi.order()),
    }
    for name in ("u_T_max", "xi_max"):
        if orders[name].order == 2.0:
            orders[name] = replace(orders[name], reason=f"{orders[name].reason}: h² |log h|", log=True)
    if not of.analysed:  # places not looked at may lower the orders
        for name, found in orders.items():
            smooth = found.reason.startswith(NO_LIMIT.why)
            reason = NOT_ANALYSED if smooth else f"{found.reason}; {NOT_ANALYSED}"
            orders[name] = replace(found, reason=reason, analysed=False)
    return orders


def _least(full: float, *limits: Singularity) -> Expected:
    """The full order of P1, or what limits it."""
    worst = min(limits, key=lambda s: s.exponent)
    if worst.exponent < full - 1e-9:
        return Expected(worst.exponent, worst.why)
    after = f" ({worst.why})" if "graded" in worst.why else ""  # a singular place that does not limit the order
    return Expected(full, "smooth" if worst.exponent >= SMOOTH else f"smooth enough for the full order{after}")
