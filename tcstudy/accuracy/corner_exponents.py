"""Exponents of the elastic solution in a corner: u ~ r^α with the smallest positive Re α.

In the sector 0 < φ < ω Airy's stress function r^{α+1} F(φ), F = A cos(α+1)φ + B sin(α+1)φ + C cos(α−1)φ + D sin(α−1)φ,
gives with κ = (λ+3μ)/(λ+μ)

    σ_φφ ∝ (α+1) F,  σ_rφ ∝ −F′,
    2μ u_r = −(α+1) F + (κ+1)(C cos(α−1)φ + D sin(α−1)φ),  2μ u_φ = −F′ + (κ+1)(C sin(α−1)φ − D cos(α−1)φ);

two homogeneous conditions on each side make a determinant whose zeros are the exponents.
Literature: M. L. Williams, J. Appl. Mech. 19 (1952) 526–528.
Left out: exponents at which u is a polynomial (0, 1), and logarithms at double roots.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

Complex = NDArray[np.complex128]
Direction = tuple[float, float]
"""A held direction in the polar frame (e_r, e_φ) of a side."""

FREE: tuple[Direction, ...] = ()
CLAMPED: tuple[Direction, ...] = ((1.0, 0.0), (0.0, 1.0))
SLIDING: tuple[Direction, ...] = ((0.0, 1.0),)
"""u_N = 0 without (or with a bounded, smooth) tangential traction."""

SMOOTH = 2.0
"""Exponent that stands for a corner without any below it: P1 elements cannot tell it from a smooth solution."""


@lru_cache(maxsize=256)
def corner_exponent(angle: float, first: tuple[Direction, ...], second: tuple[Direction, ...], kappa: float) -> float:
    """Smallest Re α in (0, SMOOTH) of a sector of the given opening angle, SMOOTH if there is none.

    first, second: directions held at φ = 0 and φ = angle (none: free; two: clamped)
    """
    roots = _roots(angle, first, second, kappa)
    return float(min((root.real for root in roots), default=SMOOTH))


def _determinant(
    alpha: Complex, angle: float, first: Sequence[Direction], second: Sequence[Direction], kappa: float
) -> Complex:
    rows = [*_conditions(alpha, 0.0, first, kappa), *_conditions(alpha, angle, second, kappa)]
    return np.asarray(np.linalg.det(np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)))


def _conditions(alpha: Complex, phi: float, held: Sequence[Direction], kappa: float) -> list[list[Complex]]:
    """Two rows of coefficients of A, B, C, D that vanish on a side."""
    plus, minus = (alpha + 1) * phi, (alpha - 1) * phi
    cos_m, sin_m = np.cos(minus), np.sin(minus)
    F = [np.cos(plus), np.sin(plus), cos_m, sin_m]
    dF = [-(alpha + 1) * F[1], (alpha + 1) * F[0], -(alpha - 1) * sin_m, (alpha - 1) * cos_m]
    zero = np.zeros_like(alpha)
    moved_r, moved_phi = [zero, zero, cos_m, sin_m], [zero, zero, sin_m, -cos_m]
    u_r = [-(alpha + 1) * f + (kappa + 1) * g for f, g in zip(F, moved_r, strict=True)]
    u_phi = [-f + (kappa + 1) * g for f, g in zip(dF, moved_phi, strict=True)]
    stress_r, stress_phi = [-f for f in dF], [(alpha + 1) * f for f in F]
    if len(held) == 2:
        return [u_r, u_phi]
    if not held:
        return [stress_r, stress_phi]
    ((a, b),) = held
    return [
        [a * x + b * y for x, y in zip(u_r, u_phi, strict=True)],
        [-b * x + a * y for x, y in zip(stress_r, stress_phi, strict=True)],
    ]


def _roots(angle: float, first: Sequence[Direction], second: Sequence[Direction], kappa: float) -> list[complex]:
    """Zeros of the determinant in 0 < Re α < SMOOTH: Newton's method from a grid of starts."""
    real, imaginary = np.meshgrid(np.linspace(0.05, SMOOTH, 40), np.linspace(0.0, 1.6, 9))
    alpha: Complex = (real + 1j * imaginary).ravel().astype(np.complex128)
    step = np.full(alpha.shape, np.inf, dtype=complex)
    eps = 1e-6
    with np.errstate(all="ignore"):
        for _ in range(60):
            value, right, left = (_determinant(alpha + d, angle, first, second, kappa) for d in (0.0, eps, -eps))
            step = value * 2 * eps / (right - left)
            step = np.where(np.isfinite(step), step, 0.0)
            alpha = alpha - step * np.minimum(1.0, 0.3 / np.maximum(np.abs(step), 1e-300))
            alpha = np.where(np.abs(alpha) < 20, alpha, 20.0)
    found: list[complex] = []
    for root in alpha[np.abs(step) < 1e-8]:
        inside = 1e-3 < root.real < SMOOTH - 1e-6 and abs(root.imag) < 3
        if inside and abs(root - 1) > 1e-5 and all(abs(root - other) > 1e-6 for other in found):
            found.append(complex(root))
    return found
