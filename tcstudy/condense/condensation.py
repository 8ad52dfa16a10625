"""Static condensation onto the contact unknowns.

Algebra:    Ã = A_kk − A_ki A_ii⁻¹ A_ik,   l̃ = l_k − A_ki A_ii⁻¹ l_i,   u_i = A_ii⁻¹(l_i − A_ik u_k)             (20)
Literature: Šestak & Jovanović, Appl. Math. Mech. 31 (2010), §3, doi 10.3879/j.issn.1000-0887.2010.01.008
            (u_1 = kept, u_2 = eliminated). Ã is the root front of a multifrontal Cholesky factorisation with the
            kept unknowns last, so it costs no more than one sparse factorisation.
Left out:   unsymmetric and indefinite matrices.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import scipy.sparse as sp
from numpy.typing import ArrayLike
from scipy.linalg import solve_triangular
from scipy.linalg.lapack import dpotrf

from tcstudy.condense.blas import one_blas_thread
from tcstudy.condense.checks import checked_columns, checked_matrix, checked_rows
from tcstudy.condense.conditioning import check_condition, random_probes
from tcstudy.condense.multifrontal import Front, backward, forward, not_held
from tcstudy.condense.multifrontal import eliminate as run_elimination
from tcstudy.condense.ordering import Floats, Ints
from tcstudy.condense.symbolic import EliminationPlan, plan_elimination


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

    @property
    def plan(self) -> EliminationPlan:
        """The order of elimination, for another matrix of the same pattern."""
        return self._plan

    def condense(self, F: ArrayLike) -> Floats:
        """l̃ = F_k − A_ki A_ii⁻¹ F_i, (m,) or (m, r), eq. (20).

        F: (n,) or (n, r) over all rows of the matrix; rows neither kept nor eliminated are ignored.
        Raises ValueError if the shape is wrong, RuntimeError if the factor was not kept.
        """
        return self.forward(F).l_tilde

    def forward(self, F: ArrayLike) -> ForwardLoad:
        """Forward elimination of F, once for both its condensed load and `expand`; errors as in `condense`."""
        fronts = self._factor()
        F = checked_columns(F, len(self._plan.position), "load")
        rows = np.take(_two_dimensional(F), self._plan.permutation, axis=0)
        with one_blas_thread():
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
        u_k = checked_columns(u_k, self.m, "vector of kept unknowns")
        load = F if F is None or isinstance(F, ForwardLoad) else self.forward(F)
        kept = _two_dimensional(u_k)
        shapes = [kept.shape[1:]] if load is None else [kept.shape[1:], load.rows.shape[1:]]
        (columns,) = np.broadcast_shapes(*shapes)
        rows = np.zeros((len(self._plan.permutation), columns))
        if load is not None:
            rows[:] = load.rows
        rows[self._kept_rows] = kept
        with one_blas_thread():
            backward(fronts, rows)
        full = np.zeros((len(self._plan.position), columns))
        full[self._plan.permutation] = rows
        return full[:, 0] if u_k.ndim == 1 and (load is None or load.l_tilde.ndim == 1) else full

    def require_definite(self) -> None:
        """Raise NotPositiveDefinite if Ã is not, to rounding, positive definite: the body slides along the contact.

        A separate question because Ã may be singular on purpose (a Neumann heat matrix on Γ_θ, method §4).
        """
        with one_blas_thread():
            L, failed = dpotrf(self.A_tilde, lower=1)
            if failed:
                raise not_held("the condensed matrix has a zero or negative pivot")
            rest = solve_triangular(L, self._probes.loads, lower=True) if self.m else self._probes.loads
        check_condition(self._probes.energy + np.sum(rest**2, axis=0))

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
    plan: EliminationPlan | None = None,
) -> Condensation:
    """Condense A onto the unknowns `keep` by eliminating the unknowns `eliminate`, eq. (20).

    A:           (n, n) sparse, n = components·nv, unknown c·nv + node, symmetric (not checked: entries on and right
                 of the diagonal of the permuted matrix are read), positive definite on `eliminate`
    coordinates: (nv, 2) nodes [any unit]; they only steer the order of elimination
    keep:        (m,) rows in the order wanted for Ã; m = 0 gives a plain sparse solver
    eliminate:   (n,) boolean mask, or rows; may be empty. Rows in neither set are fixed at zero and ignored
    keep_factor: False drops the factor (memory) and with it condense, forward and expand
    plan:        `Condensation.plan` of a matrix of the same pattern and with the same `keep` and `eliminate`, which
                 saves finding an order again; the result is the same, bit for bit

    Raises NotPositiveDefinite (a ValueError) if the eliminated block is not positive definite to working precision
    (see conditioning.py; Ã is not judged, see `Condensation.require_definite`), and ValueError on shapes and indices
    that do not fit or on entries that are not finite.
    """
    A, coordinates = checked_matrix(A, coordinates, components)
    n = A.shape[0]
    keep_rows, eliminated = checked_rows(keep, eliminate, n)
    with one_blas_thread():
        if plan is None:
            plan = plan_elimination(A, coordinates, keep_rows, eliminated)
        elif not plan.is_for(keep_rows, eliminated):
            raise ValueError("the elimination plan is that of other kept or eliminated unknowns")
        result = run_elimination(A, plan, random_probes(A, plan), keep_factor)
    check_condition(result.energy)
    lower = np.tril(result.root)
    A_tilde = (lower + np.tril(lower, -1).T)[np.ix_(plan.kept, plan.kept)]
    fronts = tuple(result.fronts) if keep_factor else None
    return Condensation(A_tilde, Probes(result.loads[plan.kept], result.energy), plan, fronts)


def _two_dimensional(array: Floats) -> Floats:
    return array[:, None] if array.ndim == 1 else array
