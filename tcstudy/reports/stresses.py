"""Stresses and elastic energy of stored displacements: constant in triangles, as P1 elements have them; recovered."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from tcstudy.reports.picture import BodyFields
from tcstudy.scene.records import Material

Array = NDArray[np.float64]


def stresses(body: BodyFields, material: Material) -> tuple[Array, Array]:
    """Stress (t, 6) in the order of SYMMETRIC and elastic density ½ σ : c⁻¹ σ (t,) of triangles [Pa, J/m³]."""
    lam, mu, beta, nu, E = np.array([(m.lam, m.mu, m.beta, m.nu, m.E) for m in material.all])[body.region].T
    x, y = np.moveaxis(body.xy[body.triangles], -1, 0)
    b, d = np.roll(y, -1, axis=1) - np.roll(y, 1, axis=1), np.roll(x, 1, axis=1) - np.roll(x, -1, axis=1)
    twice = np.sum(x * b, axis=1)  # 2 × area; its sign goes with the order of the corners, as that of b and d
    u, v = np.moveaxis(body.u[body.triangles], -1, 0)
    e_xx, e_yy = np.sum(u * b, axis=1) / twice, np.sum(v * d, axis=1) / twice
    e_xy = 0.5 * (np.sum(u * d, axis=1) + np.sum(v * b, axis=1)) / twice
    theta = np.zeros(len(x)) if body.theta is None else np.mean(body.theta[body.triangles], axis=1)
    lateral = lam * (e_xx + e_yy) - beta * theta
    sigma = np.zeros((len(x), 6))
    sigma[:, 0], sigma[:, 1] = lateral + 2.0 * mu * e_xx, lateral + 2.0 * mu * e_yy
    sigma[:, 2] = lateral if material.plane == "strain" else 0.0
    sigma[:, 3] = 2.0 * mu * e_xy
    square = np.sum(sigma[:, :3] ** 2, axis=1) + 2.0 * np.sum(sigma[:, 3:] ** 2, axis=1)
    trace = np.sum(sigma[:, :3], axis=1)
    return sigma, 0.5 * ((1.0 + nu) * square - nu * trace**2) / E


def von_mises(sigma: Array) -> Array:
    """√(3/2 s : s) of the deviators s of stresses (…, 6)."""
    deviator = sigma[..., :3] - np.mean(sigma[..., :3], axis=-1, keepdims=True)
    square = np.sum(deviator**2, axis=-1) + 2.0 * np.sum(sigma[..., 3:] ** 2, axis=-1)
    return np.asarray(np.sqrt(1.5 * square))


def principal(sigma: Array, sign: float) -> Array:
    """The larger (sign 1) or smaller (−1) principal stress in the plane of stresses (…, 6)."""
    x, y = sigma[..., 0], sigma[..., 1]
    return np.asarray(0.5 * (x + y) + sign * np.hypot(0.5 * (x - y), sigma[..., 3]))


COMPONENTS: dict[str, tuple[str, Callable[[Array], Array]]] = {
    "sigma_x": ("σ_x", lambda sigma: sigma[..., 0]),
    "sigma_y": ("σ_y", lambda sigma: sigma[..., 1]),
    "tau_xy": ("τ_xy", lambda sigma: sigma[..., 3]),
    "von_mises": ("von Mises' stress", von_mises),
    "sigma_1": ("larger principal stress σ_1", lambda sigma: principal(sigma, 1.0)),
    "sigma_2": ("smaller principal stress σ_2", lambda sigma: principal(sigma, -1.0)),
}
"""What a picture may show of stresses (…, 6): label and formula."""


def recovered(body: BodyFields, material: Material) -> tuple[Array, float]:
    """Stress (r, n, 6) at the nodes of each of the r regions, 0 elsewhere, and its estimated relative error in L².

    The stress of P1 elements jumps from triangle to triangle; σ* is the mean of those around a node, by their areas,
    within one material, across which stresses may jump. The error is ‖σ* − σ_h‖ / ‖σ*‖ (Zienkiewicz and Zhu 1987).
    """
    sigma, corners, of = stresses(body, material)[0], body.triangles, body.region.astype(np.intp)
    a, b, c = body.xy[corners.T]
    area = 0.5 * np.abs(np.linalg.det(np.stack([b - a, c - a], axis=-1)))
    mean, weight = np.zeros((of.max() + 1, len(body.xy), 6)), np.zeros((of.max() + 1, len(body.xy), 1))
    for corner in corners.T:
        np.add.at(mean, (of, corner), area[:, None] * sigma)
        np.add.at(weight, (of, corner), area[:, None])
    mean /= np.where(weight > 0.0, weight, 1.0)

    def square(linear: Array) -> float:
        """∫ |d|² of stresses (t, 3, 6) given at corners."""
        whole = np.sum(linear**2, axis=1) + np.sum(linear, axis=1) ** 2
        return float(np.sum(area[:, None] / 12.0 * whole * [1.0, 1.0, 1.0, 2.0, 2.0, 2.0]))

    own = mean[of[:, None], corners]
    size = square(own)
    return mean, float(np.sqrt(square(own - sigma[:, None]) / size)) if size > 0.0 else 0.0
