"""The condensed heat matrix of one mesh, its modes, and what must be undone where thin triangles spoil it.

A uniform temperature makes no heat flow: K·1 = 0. Entries of K grow with the flatness of the triangles, and their
rounding is heat that comes from nowhere: the factor's harmonic extension of 1 is not 1. Where it is off by more than
UNSOUND, loads and fields are refined iteratively. The residual comes from the coordinates of the corners, triangle by
triangle, in the form ∫∇θ·∇φ_i of three flows that sum to zero: no entry k_ij, rounded, is in it, and heat is conserved
whatever is rounded.
Literature: N. J. Higham, Accuracy and Stability of Numerical Algorithms, 2002, ch. 12.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from tcstudy.condense import Condensation, ForwardLoad, condense
from tcstudy.fem.heat_forms import HeatForms

Array = NDArray[np.float64]

UNSOUND = 1e-11
"""Error of the harmonic extension of 1 from which fields are refined; 1e6 good triangles stay below it."""
MOST_STEPS = 5
"""Steps of refinement; one gains as many digits as the factor has right."""


@dataclass(frozen=True)
class HeatLoad:
    """A source on the nodes: as given (n,), condensed onto Γ_θ, and after forward elimination."""

    nodal: Array
    l_tilde: Array
    forward: ForwardLoad


class HeatFactor:
    """K for k = 1 factorised with the nodes of Γ_θ kept; solves that keep their digits on slivers."""

    def __init__(self, forms: HeatForms) -> None:
        n = forms.mesh.n_points
        self._mesh, self._kept, self._k = forms.mesh, forms.kept_nodes, forms.k
        inner = np.ones(n, dtype=bool)
        inner[self._kept] = False
        self._factor: Condensation = condense(forms.conduction, forms.mesh.points, self._kept, inner, components=1)

    @property
    def A_tilde(self) -> Array:
        """(r, r) the heat matrix condensed onto Γ_θ."""
        return self._factor.A_tilde

    @cached_property
    def error(self) -> float:
        """Largest error of the harmonic extension of θ = 1: 0 but for rounding × condition of the mesh."""
        return float(np.max(np.abs(self._factor.expand(np.ones(len(self._kept))) - 1.0)))

    @property
    def sound(self) -> bool:
        """Whether the factor alone is accurate enough."""
        return self.error <= UNSOUND

    def load(self, source: Array) -> HeatLoad:
        """The source condensed onto Γ_θ, (r,) [W/m]; Σ l̃ is the whole heat of the source."""
        forward = self._factor.forward(source)
        if self.sound:
            return HeatLoad(source, forward.l_tilde, forward)
        theta = self._factor.expand(np.zeros(len(self._kept)), forward)
        rest = self._rest(source, theta, self._correction(theta, source))
        return HeatLoad(source, self._factor.condense(rest), forward)

    def expand(self, on_line: Array, load: HeatLoad | None, carries: Array) -> Array:
        """Fields (n, s) with the values on_line (r, s) on Γ_θ; carries: (s,) how much of the load is in each."""
        forward = None
        if load is not None:
            forward = ForwardLoad(load.l_tilde[:, None] * carries, load.forward.rows * carries)
        fields = self._factor.expand(on_line, forward)
        if self.sound:
            return fields
        nodal = np.zeros(len(fields)) if load is None else load.nodal
        return np.column_stack(
            [theta + self._correction(theta, share * nodal) for theta, share in zip(fields.T, carries, strict=True)]
        )

    # -- refinement --------------------------------------------------------------------------------

    @cached_property
    def _sides(self) -> tuple[Array, Array, Array]:
        """(e, f, 2d) of every triangle: its sides from corner 0 to 1 and 2 (t, 2), and 2 e × f (t,)."""
        corners = self._mesh.points[self._mesh.triangles]
        e, f = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
        return e, f, 2 * (e[:, 0] * f[:, 1] - e[:, 1] * f[:, 0])

    def _rest(self, source: Array, theta: Array, correction: Array) -> Array:
        """source − K(θ + δ), all (n,): its sum is that of the source but for rounding of the heat itself."""
        e, f, twice = self._sides
        triangles, rest = self._mesh.triangles, source.copy()
        at, more = theta[triangles], correction[triangles]
        to_1, to_2 = ((at[:, i] - at[:, 0]) + (more[:, i] - more[:, 0]) for i in (1, 2))
        # ∇θ d, turned: large numbers cancel here, once, and what comes of it is the same heat for all three corners
        turned = (to_1[:, None] * f - to_2[:, None] * e) / twice[:, None]
        for where, k in self._k:
            turned[self._mesh.inside(where)] *= k
        for i, side in enumerate((e - f, f, -e)):
            np.subtract.at(rest, triangles[:, i], np.einsum("td,td->t", side, turned))
        return rest

    def _correction(self, theta: Array, source: Array) -> Array:
        """What θ (n,) lacks, zero on Γ_θ; kept apart because θ + δ, rounded, would make flows of its own."""
        total, before = np.zeros(len(theta)), np.inf
        for _ in range(MOST_STEPS):
            step = self._factor.expand(np.zeros(len(self._kept)), self._rest(source, theta, total))
            size = float(np.max(np.abs(step), initial=0.0))
            if not size < 0.5 * before:
                break
            total += step
            before = size
        return total


# -- modes -----------------------------------------------------------------------------------------


def modes(A_tilde: Array, M: Array, held: bool = False) -> tuple[Array, Array]:
    """(μ, W): eigenpairs Ã w_k = μ_k M w_k with WᵀMW = I; the first made exactly 0 and constant, or none so if other
    nodes of the line are held."""
    if not len(M):
        return np.zeros(0), np.zeros((0, 0))
    mu, W = scipy.linalg.eigh(A_tilde, M)
    if not held:
        constant = np.full(len(M), 1.0 / np.sqrt(M.sum()))
        W[:, 1:] -= np.outer(constant, constant @ M @ W[:, 1:])
        W[:, 0], mu[0] = constant, 0.0
    return np.maximum(mu, 0.0), W


ROUNDING = 1e-14
"""Part of a variation that the columns of its family may miss, relative to the variation (norm of L²(Γ_θ))."""


def basis_of(rows: Array) -> Array:
    """(r, s) orthonormal columns from which every row (t, r) can be combined up to ROUNDING of its norm.

    The row that is worst represented comes next; as many columns as rows say that nothing was saved.
    """
    norms = np.linalg.norm(rows, axis=1)
    if not np.any(norms > 0.0):
        return np.zeros((rows.shape[1], 0))
    rest = (rows[norms > 0.0] / norms[norms > 0.0, None]).T
    Q, R, _ = scipy.linalg.qr(rest, mode="economic", pivoting=True)
    return np.asarray(Q[:, np.abs(R.diagonal()) > ROUNDING])
