"""Static condensation onto the contact unknowns.

Algebra:    Ã = A_kk − A_ki A_ii⁻¹ A_ik,   l̃ = l_k − A_ki A_ii⁻¹ l_i,   u_i = A_ii⁻¹(l_i − A_ik u_k)             (20)
Literature: Šestak & Jovanović, Appl. Math. Mech. 31 (2010), §3, doi 10.3879/j.issn.1000-0887.2010.01.008
            (u_1 = kept, u_2 = eliminated). Ã is the root front of a multifrontal Cholesky factorisation with the
            kept unknowns last, so it costs no more than one sparse factorisation.
Left out:   unsymmetric and indefinite matrices.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import cache

import numpy as np
import scipy.sparse as sp
from numpy.typing import ArrayLike
from scipy.linalg import solve_triangular
from scipy.linalg.lapack import dpotrf
from threadpoolctl import ThreadpoolController

from tcstudy.condense.multifrontal import Front, backward, forward, NotPositiveDefinite
from tcstudy.condense.multifrontal import eliminate as run_elimination
from tcstudy.condense.ordering import Floats, Ints, Mask
from tcstudy.condense.symbolic import EliminationPlan, plan_elimination


PROBES = 4  # random probes of the condition: all of them miss a given vector with probability 1e-4
SINGULAR = 100.0 * float(
    np.finfo(np.float64).eps
)  # reciprocal condition below which a matrix counts as singular


@dataclass(frozen=True)
class ForwardLoad:
    """A load after forward elimination, as `Condensation.expand` takes it.

    l_tilde: (m,) or (m, r) condensed load F_k − A_ki A_ii⁻¹ F_i
    rows:    (N, r) L⁻¹F in elimination order
    """

    l_tilde: Floats
    rows: Floats = field(repr=False)


@dataclass(frozen=True)
class Probes:
    """What the probes g of the condition estimate (see `condense`) have become.

    loads: (m, r) g_k − A_ki A_ii⁻¹ g_i; energy: (r,) g_iᵀ A_ii⁻¹ g_i
    """

    loads: Floats
    energy: Floats


@dataclass(frozen=True)
class Condensation:
    """A = [[A_kk, A_ki], [A_ik, A_ii]] over kept (k) and eliminated (i) unknowns, condensed onto the kept ones.

    A_tilde: (m, m) symmetric, A_kk − A_ki A_ii⁻¹ A_ik in the order of `keep`
    """

    A_tilde: Floats
    _probes: Probes = field(repr=False)
    _plan: EliminationPlan = field(repr=False)
    _fronts: tuple[Front, ...] | None = field(repr=False)

    @property
    def m(self) -> int:
        """Number of kept unknowns."""
        return len(self.A_tilde)

    def condense(self, F: ArrayLike) -> Floats:
        """l̃ = F_k − A_ki A_ii⁻¹ F_i, (m,) or (m, r), eq. (20).

        F: (n,) or (n, r) over all rows of the matrix; rows neither kept nor eliminated are ignored.
        Raises ValueError if the shape is wrong, RuntimeError if the factor was not kept.
        """
        return self.forward(F).l_tilde

    def forward(self, F: ArrayLike) -> ForwardLoad:
        """Forward elimination of F, once for both its condensed load and `expand`; errors as in `condense`."""
        fronts = self._factor()
        F = _columns(F, len(self._plan.position), "load")
        rows = np.take(_two_dimensional(F), self._plan.permutation, axis=0)
        with _one_blas_thread():
            forward(fronts, rows)
        l_tilde = rows[self._kept_rows]
        return ForwardLoad(l_tilde[:, 0] if F.ndim == 1 else l_tilde, rows)

    def expand(self, u_k: ArrayLike, F: ArrayLike | ForwardLoad | None = None) -> Floats:
        """The whole vector (n,) or (n, r): u_k at the kept rows, u_i = A_ii⁻¹(F_i − A_ik u_k), 0 elsewhere, eq. (20).

        u_k: (m,) or (m, r); F: None for F_i = 0 (harmonic extension), the load as in `condense`, or what
        `forward` made of it; (m,) with (n, r) and the reverse are repeated to r columns.
        Raises ValueError if shapes do not fit, RuntimeError if the factor was not kept.
        """
        fronts = self._factor()
        u_k = _columns(u_k, self.m, "vector of kept unknowns")
        load = F if F is None or isinstance(F, ForwardLoad) else self.forward(F)
        kept = _two_dimensional(u_k)
        shapes = [kept.shape[1:]] if load is None else [kept.shape[1:], load.rows.shape[1:]]
        (columns,) = np.broadcast_shapes(*shapes)
        rows = np.zeros((len(self._plan.permutation), columns))
        if load is not None:
            rows[:] = load.rows
        rows[self._kept_rows] = kept
        with _one_blas_thread():
            backward(fronts, rows)
        full = np.zeros((len(self._plan.position), columns))
        full[self._plan.permutation] = rows
        return full[:, 0] if u_k.ndim == 1 and (load is None or load.l_tilde.ndim == 1) else full

    def require_definite(self) -> None:
        """Raise NotPositiveDefinite if Ã is not, to rounding, positive definite: the body slides along the contact.

        A separate question because Ã may be singular on purpose (a Neumann heat matrix on Γ_θ, method §4).
        """
        with _one_blas_thread():
            L, failed = dpotrf(self.A_tilde, lower=1)
            if failed:
                raise NotPositiveDefinite("the condensed matrix has a zero or negative pivot")
            rest = solve_triangular(L, self._probes.loads, lower=True) if self.m else self._probes.loads
        _check_condition(self._probes.energy + np.sum(rest**2, axis=0))

    @property
    def _kept_rows(self) -> Ints:
        return len(self._plan.permutation) - self.m + self._plan.kept

    def _factor(self) -> tuple[Front, ...]:
        if self._fronts is None:
            raise RuntimeError("the factor was not kept: condense the matrix with keep_factor=True")
        return self._fronts


def condense(
    A: sp.csr_matrix | sp.csr_array,
    coordinates: ArrayLike,
    keep: ArrayLike,
    eliminate: ArrayLike,
    components: int,
    *,
    keep_factor: bool = True,
) -> Condensation:
    """Condense A onto the unknowns `keep` by eliminating the unknowns `eliminate`, eq. (20).

    A:           (n, n) sparse, n = components·nv, unknown c·nv + node, symmetric (not checked: entries on and right
                 of the diagonal of the permuted matrix are read), positive definite on `eliminate`
    coordinates: (nv, 2) nodes [any unit]; they only steer the order of elimination
    keep:        (m,) rows in the order wanted for Ã; m = 0 gives a plain sparse solver
    eliminate:   (n,) boolean mask, or rows; may be empty. Rows in neither set are fixed at zero and ignored
    keep_factor: False drops the factor (memory) and with it condense, forward and expand

    Raises NotPositiveDefinite (a ValueError) if the eliminated block is not positive definite to rounding, and
    ValueError on shapes and indices that do not fit or on entries that are not finite.
    """
    A, coordinates = _checked(A, coordinates, components)
    n = A.shape[0]
    keep_rows, eliminated = _checked_rows(keep, eliminate, n)
    with _one_blas_thread():
        plan = plan_elimination(A, coordinates, keep_rows, eliminated)
        result = run_elimination(A, plan, _probes(A, plan), keep_factor)
    _check_condition(result.energy)
    lower = np.tril(result.root)
    A_tilde = (lower + np.tril(lower, -1).T)[np.ix_(plan.kept, plan.kept)]
    fronts = tuple(result.fronts) if keep_factor else None
    return Condensation(A_tilde, Probes(result.loads[plan.kept], result.energy), plan, fronts)


def _probes(A: sp.csr_matrix | sp.csr_array, plan: EliminationPlan) -> Floats:
    """(r, N) loads g = D^{½}s with random signs s, D = diag A, for the condition estimate."""
    diagonal = A.diagonal()[plan.permutation]
    if not (diagonal > 0.0).all():
        raise NotPositiveDefinite("a diagonal entry is zero or negative")
    signs = np.random.default_rng(0).integers(0, 2, (PROBES, len(diagonal)), dtype=np.int8)
    return np.where(signs, 1.0, -1.0) * np.sqrt(diagonal)


def _check_condition(energy: Floats) -> None:
    """Raise if Â = D^{−½}AD^{−½} is singular to working precision.

    For random signs s the mean of gᵀA⁻¹g = sᵀÂ⁻¹s is trace Â⁻¹, at least 1/λ_min(Â) and for a held body hardly more
    than N log N. A zero eigenvalue is computed as a few ε of either sign, whatever the mesh; one pivot would not show
    it (a rotation about a fixed node near the last pivot leaves all pivots large).
    """
    worst = float(np.mean(energy))
    if not worst * SINGULAR <= 1.0:  # "not <=": fails for NaN as well
        raise NotPositiveDefinite(f"it is singular to working precision (condition about {worst:.0e})")


def _checked(
    A: sp.csr_matrix | sp.csr_array, coordinates: ArrayLike, components: int
) -> tuple[sp.csr_matrix | sp.csr_array, Floats]:
    """The matrix in canonical form with finite entries, and coordinates that fit it."""
    coordinates = np.asarray(coordinates, dtype=np.float64)
    if coordinates.ndim != 2 or coordinates.shape[1] != 2:
        raise ValueError(f"the coordinates must have shape (nv, 2), not {coordinates.shape}")
    if components < 1 or len(coordinates) == 0:
        raise ValueError("the mesh has no nodes or the unknown no components")
    n = components * len(coordinates)
    if not sp.issparse(A) or A.format != "csr":
        raise ValueError(f"the matrix must be a scipy.sparse CSR matrix, not {type(A).__name__}")
    if A.shape != (n, n):
        raise ValueError(
            f"{components} components on {len(coordinates)} nodes need a ({n}, {n}) matrix, not {A.shape}"
        )
    if not np.isfinite(coordinates).all():
        raise ValueError("the coordinates of the nodes are not finite")
    if not np.isfinite(A.data).all():
        raise ValueError(
            "the matrix has entries that are not finite: check the material constants and the mesh"
        )
    if not A.has_canonical_format:
        A = A.copy()
        A.sum_duplicates()
    return A, coordinates


def _checked_rows(keep: ArrayLike, eliminate: ArrayLike, n: int) -> tuple[Ints, Mask]:
    """Kept rows as integers, eliminated rows as a mask; disjoint and in range."""
    eliminate = np.asarray(eliminate)
    if eliminate.dtype == bool:
        if eliminate.shape != (n,):
            raise ValueError(f"the mask of eliminated unknowns must have shape ({n},), not {eliminate.shape}")
        mask = eliminate
    else:
        mask = np.zeros(n, dtype=bool)
        mask[_rows(eliminate, n, "eliminate")] = True
    rows = _rows(np.asarray(keep), n, "keep")
    count = np.bincount(rows, minlength=n)
    if len(rows) and count.max() > 1:
        raise ValueError(f"row {int(count.argmax())} is kept twice")
    if mask[rows].any():
        raise ValueError(f"row {int(rows[mask[rows]][0])} is both kept and eliminated")
    return rows, mask


def _rows(index: Ints, n: int, name: str) -> Ints:
    if index.ndim != 1 or (len(index) and not np.issubdtype(index.dtype, np.integer)):
        raise ValueError(f"`{name}` must be a list of row numbers")
    if len(index) and not (0 <= index.min() and index.max() < n):
        raise ValueError(f"`{name}` has row numbers outside 0..{n - 1}")
    return index.astype(np.intp)


def _columns(values: ArrayLike, rows: int, name: str) -> Floats:
    """Values as (rows,) or (rows, r) floats."""
    array = np.asarray(values, dtype=np.float64)
    if array.ndim not in (1, 2) or array.shape[0] != rows:
        raise ValueError(f"the {name} must have shape ({rows},) or ({rows}, r), not {array.shape}")
    return array


def _two_dimensional(array: Floats) -> Floats:
    return array[:, None] if array.ndim == 1 else array


@cache
def _thread_pools() -> ThreadpoolController:
    return ThreadpoolController()  # looks through all loaded libraries: once is enough


@contextmanager
def _one_blas_thread() -> Iterator[None]:
    """More threads than one make the many small dense operations slower."""
    with _thread_pools().limit(limits=1, user_api="blas"):
        yield
