"""Stresses and elastic energy of stored displacements: constant in each triangle, as P1 elements have them."""

from __future__ import annotations

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
    """√(3/2 s : s) of the deviators s of stresses (t, 6)."""
    deviator = sigma[:, :3] - np.mean(sigma[:, :3], axis=1, keepdims=True)
    square = np.sum(deviator**2, axis=1) + 2.0 * np.sum(sigma[:, 3:] ** 2, axis=1)
    return np.asarray(np.sqrt(1.5 * square))
