"""u_T and ξ of an exact solution on Γ_C, as functions of place and normal."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tcstudy.accuracy.line_norms import Function
from tcstudy.scene.gradient import value_and_gradient
from tcstudy.scene.records import Exact, Scene

Array = NDArray[np.float64]


def exact_u_T(exact: Exact) -> Function:
    """u·t with t = (−n₂, n₁) [m]."""

    def slip(x: Array, y: Array, n: Array) -> Array:
        ux, uy = (value_and_gradient(component, x, y)[0] for component in exact.u)
        return np.asarray(uy * n[..., 0] - ux * n[..., 1])

    return slip


def exact_xi(exact: Exact, scene: Scene) -> Function:
    """−S_T [Pa]: as given, or −t·2με(u)n; λ and the temperature only act normally."""
    given, mu = exact.xi, scene.material.mu
    if given is not None:
        return lambda x, y, n: value_and_gradient(given, x, y)[0]

    def traction(x: Array, y: Array, n: Array) -> Array:
        gx, gy = (value_and_gradient(component, x, y)[1] for component in exact.u)
        shear = 0.5 * (gx[1] + gy[0])
        n1, n2 = n[..., 0], n[..., 1]
        tangential: Array = -n2 * (gx[0] * n1 + shear * n2) + n1 * (shear * n1 + gy[1] * n2)
        return -2 * mu * tangential

    return traction
