"""The condensed heat matrix of one mesh, its modes, and what must be undone where thin triangles spoil it.

A uniform temperature makes no heat flow: K·1 = 0. Entries of K grow with the flatness of the triangles, and their
rounding is heat that comes from nowhere: the factor's harmonic extension of 1 is not 1. Where it is off by more than
UNSOUND, loads and fields are refined iteratively with the residual in the form Σ_j k_ij(θ_j − θ_i), which conserves
heat whatever is rounded. What remains is the rounding of the entries k_ij themselves.
Literature: N. J. Higham, Accuracy and Stability of Numerical Algorithms, 2002, ch. 12.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.linalg
import scipy.sparse as sp
from numpy.typing import NDArray

from tcstudy.condense import Condensation, ForwardLoad, condense
from tcstudy.fem.forms import HeatForms

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
        self._kept = forms.robin_nodes
        self._inner = np.ones(n, dtype=bool)
        self._inner[self._kept] = False
        self._K = forms.conduction
        self._factor: Condensation = condense(self._K, forms.mesh.points, self._kept, self._inner, components=1)

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
        theta = self._factor.expand(np.zeros(len(self._kept)), forward)[:, None]
        rest = self._rest(source[:, None], theta, self._correction(theta, source[:, None]))
        return HeatLoad(source, rest[self._kept, 0], forward)

    def expand(self, on_line: Array, load: HeatLoad | None, carries: Array) -> Array:
        """Fields (n, s) with the values on_line (r, s) on Γ_θ; carries: (s,) how much of the load is in each."""
        forward, sources = None, np.zeros((len(self._inner), on_line.shape[1]))
        if load is not None:
            forward = ForwardLoad(load.l_tilde[:, None] * carries, load.forward.rows * carries)
        fields = self._factor.expand(on_line, forward)
        if self.sound:
            return fields
        if load is not None:
            sources = load.nodal[:, None] * carries
        return fields + self._correction(fields, sources)

    # -- refinement --------------------------------------------------------------------------------

    @cached_property
    def _pattern(self) -> tuple[NDArray[np.intp], NDArray[np.intp], NDArray[np.longdouble]]:
        """(starts, neighbours, g) of every node: heat flows to node `neighbours` with conductance g = −k_ij."""
        upper = sp.triu(self._K, 1)
        # mirrored, so that what leaves i for j is to the bit what j gets
        both = sp.csr_array(upper + upper.T)
        return both.indptr[:-1], both.indices, -both.data.astype(np.longdouble)

    def _rest(self, sources: Array, theta: Array, correction: Array) -> Array:
        """sources − K(θ + δ), (n, s), in extended precision where the machine has it; its sum is that of sources."""
        starts, neighbours, g = self._pattern
        rows = np.repeat(np.arange(len(starts)), np.diff(starts, append=len(g)))
        rest = np.empty_like(theta)
        for s in range(theta.shape[1]):
            exact = theta[:, s].astype(np.longdouble) + correction[:, s]
            rest[:, s] = sources[:, s] - np.add.reduceat(g * (exact[rows] - exact[neighbours]), starts)
        return rest

    def _correction(self, theta: Array, sources: Array) -> Array:
        """What θ (n, s) lacks, zero on Γ_θ; kept apart because θ + δ, rounded, would make flows of its own."""
        total, before = np.zeros_like(theta), np.full(theta.shape[1], np.inf)
        line = np.zeros((len(self._kept), theta.shape[1]))
        for _ in range(MOST_STEPS):
            step = self._factor.expand(line, self._rest(sources, theta, total))
            size = np.max(np.abs(step), axis=0, initial=0.0)
            better = size < 0.5 * before
            if not better.any():
                break
            total += np.where(better, step, 0.0)
            before = np.where(better, size, 0.0)
        return total


# -- modes -----------------------------------------------------------------------------------------


def modes(A_tilde: Array, M: Array) -> tuple[Array, Array]:
    """(μ, W): eigenpairs Ã w_k = μ_k M w_k with WᵀMW = I; the first made exactly 0 and constant."""
    mu, W = scipy.linalg.eigh(A_tilde, M)
    constant = np.full(len(M), 1.0 / np.sqrt(M.sum()))
    W[:, 1:] -= np.outer(constant, constant @ M @ W[:, 1:])
    W[:, 0] = constant
    mu[0] = 0.0
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
