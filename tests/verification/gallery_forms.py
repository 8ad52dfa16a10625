"""Closed forms of the gallery's studies: a thin bar on any law of straight pieces, and a ring that
turns on its shaft.

Bar:   D s″ = b(s) on (0, L), s(0) = 0, s′(L) = α ΔT, the free end; s is the slip, D = E H. On a piece of b with slope k
       s is a polynomial (k = 0), hyperbolic (k > 0) or trigonometric (k < 0), and with κ = k/D and the slopes p₀, p₁ at
       its ends the piece is as long as  x = (2/√κ) artanh(√κ (s₁ − s₀)/(p₀ + p₁)). One unknown is left: how far the
       bar sticks, or the slope at s = 0. As H → 0 the strip of a study becomes this bar.
Lap:   the bar of a bilinear bond in closed form (Volkersen, Luftfahrtforschung 15 (1938) 41; Yuan et al., Eng. Struct.
       26 (2004) 553)
Ring:  a < r < R, no volume change: u_φ = A r + B/r (Timoshenko & Goodier, Theory of Elasticity, §27), so that the shaft
       feels  ξ = K (U a/R − s),  K = 2μ/(a (1 − a²/R²)), where U is the displacement of the outer edge
"""

import cmath
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

Array = NDArray[np.float64]
Law = Sequence[tuple[float, float]]
"""(s, b) at the ends of straight pieces, from s = 0; beyond the last one b is constant."""


def bar(law: Law, stiffness: float, length: float, strain: float, at: Array) -> Array:
    """Slip [m] at the places `at` of a bar of stiffness D [N/m] that heat would strain by
    `strain`."""
    last = (law[-1][0] + 1e3 * strain * length, law[-1][1])
    pieces = list(zip(law, [*law[1:], last], strict=True))

    def along(free: float) -> list[tuple[float, float, float, float, float]]:
        """(x, s, s′, s″, κ) where pieces begin; free < 0 is a stuck length, else the slope at 0."""
        x, p, stations = max(0.0, -free), max(0.0, free), []
        for (s, b), (s1, b1) in pieces:
            if s1 > s and x < length:
                kappa = (b1 - b) / (s1 - s) / stiffness
                stations.append((x, s, p, b / stiffness, kappa))
                p1 = max(0.0, p**2 + (b + b1) / stiffness * (s1 - s)) ** 0.5
                root = cmath.sqrt(kappa)
                reach = (s1 - s) / (p + p1) if p + p1 else np.inf
                x, p = x + (2 * (cmath.atanh(root * reach) / root).real if kappa else 2 * reach), p1
        return stations

    def slip_and_slope(
        stations: list[tuple[float, float, float, float, float]], x: float
    ) -> tuple[float, float]:
        below = [station for station in stations if station[0] <= x]
        if not below:
            return 0.0, 0.0
        x0, s, p, c, kappa = below[-1]
        d, root = x - x0, cmath.sqrt(kappa)
        if not kappa:
            return s + p * d + c * d * d / 2, p + c * d
        sinh, cosh = (cmath.sinh(root * d) / root).real, cmath.cosh(root * d).real
        return s + p * sinh + c * (cosh - 1) / kappa, p * cosh + c * sinh

    least = (
        -length if law[0][1] else 1e-9 * strain
    )  # a law from b(0) = 0 lets the bar slip everywhere
    end = brentq(
        lambda free: slip_and_slope(along(free), length)[1] - strain,
        least,
        strain,
        xtol=1e-300,
        rtol=1e-14,
    )
    return np.array([slip_and_slope(along(end), float(x))[0] for x in at])


def ring_slip(
    law: Law, shear: float, inner: float, outer: float, turned: float
) -> tuple[float, float]:
    """(slip [m], ξ [Pa]) on the shaft when the outer edge moves by `turned` [m]."""
    stiffness = 2 * shear / (inner * (1 - (inner / outer) ** 2))
    push = stiffness * turned * inner / outer
    if push <= law[0][1]:
        return 0.0, push
    for (s, b), (s1, b1) in zip(law, [*law[1:], (np.inf, law[-1][1])], strict=True):
        slope = (b1 - b) / (s1 - s)
        slip = s + (push - stiffness * s - b) / (stiffness + slope)
        if slip <= s1:
            return float(slip), float(push - stiffness * slip)
    raise AssertionError("no piece holds it")


@dataclass(frozen=True)
class LapStrip:
    """A bar on a bilinear bond that nothing else restrains, pulled by a force at x = L [N/m].

    D u″ = b(u), u′(0) = 0, D u′(L) = F: elastic up to x = a, softening beyond, in one piece each.
    """

    stiffness: float
    length: float
    tau: float
    s0: float
    sf: float

    @property
    def rate(self) -> float:
        """λ of the elastic branch [1/m]."""
        return (self.tau / self.s0 / self.stiffness) ** 0.5

    @property
    def softens_from(self) -> float:
        return self.tau / self.rate * np.tanh(self.rate * self.length)

    @property
    def long_peak(self) -> float:
        """√(2 G_f D), the peak of a bond that is long."""
        return (self.tau * self.sf * self.stiffness) ** 0.5

    def slip(self, force: float, at: Array) -> Array:
        """Return u at places `at` on the branch from rest, below the peak [m]."""
        if force <= self.softens_from:
            root = self.rate
            scale = force / (self.stiffness * root * np.sinh(root * self.length))
            return scale * np.cosh(root * at)
        least = self.length - np.pi / 2.0 / self._soft_rate
        places = np.linspace(max(0.0, least), self.length, 2_001)
        forces = np.array([self._tip(a)[0] for a in places])
        after_peak = int(np.argmax(forces))
        a = brentq(lambda a: self._tip(a)[0] - force, places[after_peak], self.length, xtol=1e-15)
        root = self.rate
        elastic = self.s0 * np.cosh(root * at) / np.cosh(root * a)
        return np.where(at <= a, elastic, self._softening(a, at)[0])

    def _tip(self, a: float) -> tuple[float, float]:
        slip, slope = self._softening(a, np.array(self.length))
        return self.stiffness * float(slope), float(slip)

    @property
    def _soft_rate(self) -> float:
        return float((self.tau / (self.sf - self.s0) / self.stiffness) ** 0.5)

    def _softening(self, a: float, at: Array) -> tuple[Array, Array]:
        """Return u and u′ where the bond softens, behind x = a."""
        mu = self._soft_rate
        rest, slope = self.sf - self.s0, self.rate * self.s0 * np.tanh(self.rate * a)
        phase = mu * (at - a)
        slip = self.sf - rest * np.cos(phase) + slope / mu * np.sin(phase)
        return slip, mu * rest * np.sin(phase) + slope * np.cos(phase)
