"""The contact problem along a parameter t in which the load is affine: l̃(t) = l̃₀ + t l̃₁."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from tcstudy.scene.friction import FrictionLaw
from tcstudy.solve.problem import ContactProblem

Array = NDArray[np.float64]


@dataclass(frozen=True)
class ParametricProblem:
    """Ãv + ξ = l̃₀ + t l̃₁ with ξ_i/c_i ∈ b̂(v_i), for all t at once.

    A_tilde: (m, m) symmetric positive definite, condensed stiffness [Pa]
    l_0:     (m,) load at t = 0 [N/m]
    l_1:     (m,) load per unit of t [N/m per unit of t], not zero
    c:       (m,) segment lengths > 0 [m]
    law:     friction law b [Pa] of the slip [m]

    t is anything the load is affine in: a load factor, θ̄, the strength of a source.
    """

    A_tilde: Array
    l_0: Array
    l_1: Array
    c: Array
    law: FrictionLaw

    @property
    def m(self) -> int:
        """Number of contact unknowns."""
        return len(self.c)

    def load(self, t: float) -> Array:
        """l̃(t) (m,)."""
        return self.l_0 + t * self.l_1

    def at(self, t: float) -> ContactProblem:
        """The problem of one t."""
        return ContactProblem(self.A_tilde, self.load(t), self.c, self.law)

    def with_law(self, law: FrictionLaw) -> ParametricProblem:
        """The same body and loads under another law."""
        return replace(self, law=law)
