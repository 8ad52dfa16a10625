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
from scipy.linalg import expm
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


@dataclass(frozen=True)
class PeeledArm:
    """One arm of a double cantilever, a beam on a bilinear bond that pulls and pushes and is long.

    EI s⁗ + b(s) = 0: s = e^(−βx) (s₀ cos βx + B sin βx) for x > 0, softening for −c < x < 0 where
    y = s_f − s has y⁗ = κ⁴ y, and free from there to the load at x = −c − a.
    """

    bending: float
    sigma: float
    s0: float
    sf: float

    def state(self, crack: float) -> tuple[float, float]:
        """Return force [N/m] and displacement of the end [m] at a crack of length a [m]."""
        root = (self.sigma / (self.sf - self.s0) / self.bending) ** 0.25
        zone = brentq(lambda c: crack / self._at_zone(c)[0] - 1.0, 0.5 / root, 1.0 / root)
        return self._at_zone(zone)[1:]

    def _at_zone(self, c: float) -> tuple[float, float, float]:
        """Return the crack a, the force and the displacement of a softening zone of length c."""
        beta = (self.sigma / self.s0 / self.bending / 4.0) ** 0.25
        kappa = (self.sigma / (self.sf - self.s0) / self.bending) ** 0.25
        ch, sh, co, si = (
            np.cosh(-kappa * c),
            np.sinh(-kappa * c),
            np.cos(kappa * c),
            np.sin(-kappa * c),
        )
        rows = np.array(
            [[ch, sh, co, si], [sh, ch, -si, co], [ch, sh, -co, -si], [sh, ch, si, -co]]
        )
        start = np.linalg.inv([[1, 0, 1, 0], [0, 1, 0, 1], [1, 0, -1, 0], [0, 1, 0, -1]])
        scale = kappa ** np.arange(4)
        # y and its derivatives at x = 0, by the part that B leaves and the part that it has
        fixed = np.array([self.sf - self.s0, beta * self.s0, 0.0, -2.0 * beta**3 * self.s0])
        of_B = np.array([0.0, -beta, 2.0 * beta**2, -2.0 * beta**3])
        left, by_B = ((rows @ start @ (one / scale)) * scale for one in (fixed, of_B))
        _, slope, curvature, shear = left - left[0] / by_B[0] * by_B
        crack, force = curvature / shear, -self.bending * shear
        end = self.sf + slope * crack + force * crack**3 / 3.0 / self.bending
        return crack, force, end


@dataclass(frozen=True)
class SplitBeam:
    """One half of a beam that is loaded at its split end (mode II), on a bilinear bond in shear.

    u″ − 4b(u)/(Eh) = −3P/(Eh²) with u′ = −3Px/(Eh²) in the crack 0 < x < a, and u(L) = 0 far from
    it; P is the force of both halves. The end moves by δ = (P L³/24 + E h²/8 ∫u)/(E h³/12).
    """

    E: float
    h: float
    length: float
    tau: float
    s0: float
    sf: float

    def force(self, crack: float, tip: float | None = None) -> float:
        """Return P [N/m] of a crack whose tip slips by s₀ ≤ u ≤ s_f, by the first integral."""
        slip = self.sf if tip is None else tip
        worn = self.tau * (self.sf - slip) ** 2 / (self.sf - self.s0) / 2.0

        def defect(P: float) -> float:
            far = self._far(P)
            work = self.tau * (self.sf - far**2 / self.s0) / 2.0 - worn
            push = 3.0 * P / (self.E * self.h**2)
            return (push * crack) ** 2 / 2.0 - 4.0 / (self.E * self.h) * work + push * (slip - far)

        return float(brentq(defect, 1.0, 1e9, rtol=1e-14))

    def end(self, crack: float, tip: float | None = None) -> float:
        """Return δ [m]."""
        slip = self.sf if tip is None else tip
        P = self.force(crack, tip)
        push, far = 3.0 * P / (self.E * self.h**2), self._far(P)
        soft = (4.0 * self.tau / (self.sf - self.s0) / self.E / self.h) ** 0.5
        rate = (4.0 * self.tau / self.s0 / self.E / self.h) ** 0.5
        # where it softens u = s_f − p + (u_tip − s_f + p) cos qz − (u′/q) sin qz, p = push/q²
        p, slope = push / soft**2, push * crack / soft
        lift = slip - self.sf + p

        def u(z: float) -> float:
            return float(self.sf - p + lift * np.cos(soft * z) - slope * np.sin(soft * z))

        least = np.arctan2(slope, -lift) / soft
        zone = brentq(lambda z: u(z) - self.s0, 0.0, least)
        turned = soft * zone
        softening = (self.sf - p) * zone + (
            lift * np.sin(turned) - slope * (1.0 - np.cos(turned))
        ) / soft
        elastic = far * (self.length - crack - zone) + (self.s0 - 2.0 * far) / rate
        whole = slip * crack + push * crack**3 / 3.0 + softening + elastic
        bent = P * self.length**3 / 24.0 + self.E * self.h**2 / 8.0 * whole
        return float(12.0 * bent / self.E / self.h**3)

    def _far(self, P: float) -> float:
        """Return u where the bond shares P evenly."""
        return 3.0 * P / (4.0 * self.h) * self.s0 / self.tau


def curled(E: float, h: float, weight: float, strain: float) -> dict[str, tuple[float, float]]:
    """Return length that a heavy slab lifts off by, and its height, where the top is colder or warmer.

    A beam with the curvature κ = strain/h on a rigid base, q = weight · h: ends lifted over
    √(2EIκ/q) by κℓ²/4, a hump of 27κℓ²/1536 over √(4EIκ/q).
    """
    bending, curvature, q = E * h**3 / 12.0, strain / h, weight * h
    colder, warmer = ((n * bending * curvature / q) ** 0.5 for n in (2.0, 4.0))
    return {
        "colder": (colder, curvature * colder**2 / 4.0),
        "warmer": (warmer, 27.0 * curvature * warmer**2 / 1536.0),
    }


def warped_die(
    E: float, h: float, length: float, strain: float, k_T: float, k_N: float
) -> tuple[float, float]:
    """Return shear and peel stress at the end of half a beam on springs in both directions.

    E h u″ = t and EI w⁗ + k_N w = (h/2) t′ with t = k_T (u + h w′/2), u(0) = w′(0) = 0, and at the
    end u′ = −strain, w″ = 0; shear forces EI w‴ − h t/2 vanish at both ends.
    """
    stretch, bending = E * h, E * h**3 / 12.0
    slip = np.array([1.0, 0.0, 0.0, h / 2.0, 0.0, 0.0])  # of u, u′, w, w′, w″, w‴
    change = np.array([0.0, 1.0, 0.0, 0.0, h / 2.0, 0.0])
    rates = np.diag([1.0, 0.0, 1.0, 1.0, 1.0], 1)
    rates[1] = k_T * slip / stretch
    rates[5] = k_T * h / 2.0 * change / bending
    rates[5, 2] -= k_N / bending
    shear = bending * np.eye(6)[5] - k_T * h / 2.0 * slip
    over = expm(rates * length)
    start, last = np.array([np.eye(6)[0], np.eye(6)[3], shear]), np.eye(6)[[1, 4]]
    ends = np.concatenate([start, last @ over, shear[None] @ over])
    end = over @ np.linalg.solve(ends, [0.0, 0.0, 0.0, -strain, 0.0, 0.0])
    return float(k_T * slip @ end), float(k_N * end[2])
