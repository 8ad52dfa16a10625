"""The condensed contact problem on plain arrays, one or rows of a body; the test of its solutions.

Problem:    0 ∈ ∂L̃(v),  L̃(v) = ½vᵀÃv − l̃ᵀv + Ψ(v),  Ψ(v) = Σ c_i j(v_i)
Acceptance: ξ = l̃ − Ãv with ξ_i ∈ c_i b̂(v_i), i = 1..m, eq. (21)
Literature: Šestak & Jovanović, Appl. Math. Mech. 31 (2010), §3

The body knows no load and no law: its record is made once (offline), pickles, and serves any number
of problems. A body whose E varies is one body, too: divide the problem by E.

Large bodies have coarser copies of themselves, which give starts (nested iteration). The Galerkin
restriction to every second contact node with linear interpolation P is a contact problem again and
costs an eighth: Ã_c = PᵀÃP, l̃_c = Pᵀl̃, c_c = Pᵀc and those nodes' laws. The nodes are taken in
the order of their numbers, along Γ_C; another order costs quality of the start, never correctness.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from functools import cached_property
from typing import Any

import numpy as np
import scipy.linalg
import scipy.sparse
from numpy.typing import NDArray

from tcstudy.contact.extended import extended_residual
from tcstudy.laws.laws import Laws
from tcstudy.laws.pieces import BEND, Place

Array = NDArray[np.float64]
Index = NDArray[np.intp]


class Status(IntEnum):
    """Why a run ended; only CONVERGED is a solution, every other status carries a reason."""

    CONVERGED = 0
    ITERATION_LIMIT = 1
    STALLED = 2
    NOT_FINITE = 3
    UNBOUNDED = 4
    NOT_POSITIVE_DEFINITE = 5
    INCLUSION_VIOLATED = 6


@dataclass(frozen=True)
class Outcome:
    """Result of one run.

    x:           the last iterate, (n,)
    f:           objective there
    status:      why the run ended
    reason:      one sentence for the user: what happened and, on failure, what to try
    iterations:  steps taken
    evaluations: evaluations of the objective (a line-search trial counts as one)
    """

    x: NDArray[np.float64]
    f: float
    status: Status
    reason: str
    iterations: int
    evaluations: int

    @property
    def converged(self) -> bool:
        """True if the method's own stopping test was met."""
        return self.status == Status.CONVERGED


MAX_COARSEST_NODES = 40
"""Contact nodes up to which a body has no coarser copy."""
SINGULAR = 64.0 * float(np.finfo(float).eps)
"""Reciprocal condition, its diagonal scaled to 1, up to which a matrix is singular."""
SOFT = 1e-10
"""Part of the largest eigenvalue up to which one counts as 0."""
PROOF_MARGIN = 1e-6
"""μ/λ₁: by how much a matrix must be positive definite in a proof."""


@dataclass(frozen=True, eq=False)
class CondensedBody:
    """The part that all contact problems on one body share.

    A_tilde: (m, m) symmetric positive definite, condensed stiffness [Pa]
    c:       (m,) segment lengths meas(S_i) > 0 [m]
    A_error: as in ContactProblem
    shared:  many problems on it are to be solved, so that Ã⁻¹ pays
    blocks:  as in ContactProblem
    """

    A_tilde: Array
    c: Array
    A_error: float = 0.0
    shared: bool = True
    blocks: tuple[int, ...] = ()

    @classmethod
    def of(
        cls, A_tilde: Array, c: Array, A_error: float = 0.0, blocks: tuple[int, ...] = ()
    ) -> CondensedBody:
        """Return the record of Ã (m, m) and c (m,) with all derived quantities computed.

        They take two factorisations and an eigenvalue. Raises ValueError if Ã is not positive
        definite: then the body can move freely.
        """
        A_tilde = np.array(A_tilde, dtype=float, order="C")
        body = cls(A_tilde, np.array(c, dtype=float), A_error, blocks=blocks)
        if body.loose:
            raise ValueError(
                "the condensed stiffness is not positive definite: "
                "the body can move freely (clamp it)"
            )
        copy: CondensedBody | None = body
        while copy is not None:
            # cached properties compute on their first access
            _ = copy.inverse
            _ = copy.lambda_1
            copy = copy.coarse
        return body

    @classmethod
    def known(
        cls,
        A_tilde: Array,
        c: Array,
        A_error: float = 0.0,
        blocks: tuple[int, ...] = (),
        **facts: Any,
    ) -> CondensedBody:
        """Return the record for one problem, with its cached properties that are already known.

        facts: such as `lambda_1` and `inverse`; None for an unknown one
        """
        body = cls(A_tilde, c, A_error, shared=False, blocks=blocks)
        vars(body).update({name: fact for name, fact in facts.items() if fact is not None})
        return body

    @property
    def m(self) -> int:
        """Number of contact nodes."""
        return len(self.c)

    @cached_property
    def loose(self) -> bool:
        """True if the body has a rigid-body mode: Ã is singular, has no inverse, and λ₁ is 0."""
        return bool(scipy.linalg.lapack.dpotrf(self.A_tilde, lower=1)[1] != 0)

    @cached_property
    def inverse(self) -> Array:
        """Ã⁻¹ (m, m) [1/Pa]."""
        factor, _ = scipy.linalg.lapack.dpotrf(self.A_tilde, lower=1)
        half = scipy.linalg.lapack.dpotri(factor, lower=1)[0] if self.m else self.A_tilde
        return np.ascontiguousarray(np.tril(half) + np.tril(half, -1).T)

    @cached_property
    def lambda_1(self) -> float:
        """λ_min(C^{−½}ÃC^{−½}) [Pa/m]."""
        return 0.0 if self.loose else least_eigenvalue(self.A_tilde, self.c)

    @cached_property
    def eigenpairs(self) -> tuple[Array, Array]:
        """Eigenvalues λ (m,) of Ãx = λCx, growing, and their x (m, m) with xᵀCx = 1."""
        root = 1.0 / np.sqrt(self.c)
        eigenvalues, vectors = scipy.linalg.eigh(self.A_tilde * root[:, None] * root)
        return eigenvalues, root[:, None] * vectors

    @cached_property
    def motions(self) -> Array:
        """(m, k) rigid motions, which Ã does not resist; none of a body that is not loose."""
        if not self.loose:
            return np.zeros((self.m, 0))
        eigenvalues, vectors = self.eigenpairs
        return vectors[:, eigenvalues <= SOFT * eigenvalues[-1]]

    @property
    def softest(self) -> float:
        """Least eigenvalue of C^{−½}ÃC^{−½} that is not 0 [Pa/m]."""
        if not self.loose:
            return self.lambda_1
        eigenvalues = self.eigenpairs[0]
        return float(eigenvalues[np.argmax(eigenvalues > SOFT * eigenvalues[-1])])

    @cached_property
    def coarse(self) -> CondensedBody | None:
        """Its Galerkin copy on every second node, None for a small body."""
        if self.m <= MAX_COARSEST_NODES or self.loose:
            return None
        product = self.P.T @ (self.P.T @ self.A_tilde).T
        A_tilde = np.ascontiguousarray(0.5 * (product + product.T))
        blocks = tuple((size + 1) // 2 for size in self.blocks)
        return CondensedBody(A_tilde, self.P.T @ self.c, shared=self.shared, blocks=blocks)

    @cached_property
    def coarse_nodes(self) -> Index | slice:
        """The nodes of the coarse copy: every second one of each block."""
        if not self.blocks:
            return slice(None, None, 2)
        stops = np.cumsum(self.blocks).tolist()
        blocks = zip(self.blocks, stops, strict=True)
        return np.concatenate([np.arange(stop - size, stop, 2) for size, stop in blocks])

    @cached_property
    def shift(self) -> float:
        """Margin μ by which a matrix must be positive definite in a proof [Pa/m]."""
        return pivot_shift(self.A_tilde, self.c, self.lambda_1)

    @cached_property
    def P(self) -> scipy.sparse.csr_matrix:
        """(m, ⌈m/2⌉) linear interpolation from the nodes 0, 2, 4, … of each block."""
        if self.blocks:
            return scipy.sparse.block_diag([interpolation(m) for m in self.blocks], "csr")
        return interpolation(self.m)

    @cached_property
    def rounding(self) -> float:
        """Relative error of products with Ã⁻¹: rounding, and the error of Ã itself."""
        condition = float(np.linalg.norm(self.A_tilde, 1) * np.linalg.norm(self.inverse, 1))
        rounding = 8.0 * self.m * float(np.finfo(float).eps) * condition
        return rounding + (1.0 - trusted_share(self.A_error))


def interpolation(m: int) -> scipy.sparse.csr_matrix:
    """Return (m, ⌈m/2⌉) linear interpolation to m nodes from the nodes 0, 2, 4, … of them."""
    n_coarse = (m + 1) // 2
    node = np.arange(m)
    row = np.tile(node, 2)
    column = np.concatenate([node // 2, np.minimum((node + 1) // 2, n_coarse - 1)])
    weight = np.full(2 * m, 0.5)
    return scipy.sparse.csr_matrix((weight, (row, column)), shape=(m, n_coarse))


@dataclass(frozen=True)
class ContactProblem:
    """0 ∈ Ãv − l̃ + ∂Ψ(v) for tangential displacements v of m contact nodes, or R rows of these.

    A_tilde: (m, m) symmetric positive definite, or semidefinite where contact alone holds the
             body, condensed stiffness [Pa]
    l_tilde: (m,) condensed load, or (R, m) [N/m]
    c:       (m,) segment lengths meas(S_i) > 0 [m]
    law:     friction law b [Pa] of the slip [m], or those of nodes, of rows, of both (tcstudy/laws)
    A_error: relative error of Ã in its softest direction, and so of λ₁: proofs hold for
             (1 − A_error) Ã, too
    blocks:  sizes of the blocks of nodes that lie along Γ_C by themselves, such as slips and then
             openings; () for one block

    All methods that take one v (m,) take rows (R, m) as well; numbers then are (R,).
    """

    A_tilde: Array
    l_tilde: Array
    c: Array
    law: Laws
    A_error: float = 0.0
    blocks: tuple[int, ...] = ()

    @classmethod
    def on(cls, body: CondensedBody, l_tilde: Array, law: Laws) -> ContactProblem:
        """Return the problem, or rows of them, on a body whose record is known."""
        problem = ContactProblem(body.A_tilde, l_tilde, body.c, law, body.A_error, body.blocks)
        vars(problem)["body"] = body
        return problem

    @property
    def m(self) -> int:
        """Number of contact DOFs."""
        return len(self.c)

    @cached_property
    def body(self) -> CondensedBody:
        """The body's record, made of Ã and c alone.

        With rays Ã may be singular to rounding, as that of a body which contact alone holds.
        """
        A_tilde = np.ascontiguousarray(self.A_tilde, dtype=float)
        loose = True if self.law.has_rays and is_singular(A_tilde) else None
        return CondensedBody.known(A_tilde, self.c, self.A_error, self.blocks, loose=loose)

    @cached_property
    def rows(self) -> ContactProblem:
        """One problem as a block of one row."""
        laws = self.law.tables.at(np.atleast_2d(self.law.index))
        return ContactProblem.on(self.body, self.l_tilde[None], laws)

    def take(self, rows: Index) -> ContactProblem:
        """Return the numbered rows."""
        return ContactProblem.on(self.body, self.l_tilde[rows], self.law.of_nodes(rows))

    def single(self, row: int) -> ContactProblem:
        """Return one row as a problem."""
        return ContactProblem.on(self.body, self.l_tilde[row], self.law.of_row(row))

    def coarse(self) -> ContactProblem | None:
        """Return the same rows on the body's coarse copy, if it has one."""
        if self.body.coarse is None:
            return None
        laws = self.law.of_nodes((slice(None), self.body.coarse_nodes))
        return ContactProblem.on(self.body.coarse, self.l_tilde @ self.body.P, laws)

    def energy(self, v: Array) -> Any:
        """Return L̃(v) [J/m]."""
        friction = self.law.integral(np.zeros(v.shape), v)
        load_work = np.einsum("...i,...i->...", v, self.l_tilde + self.xi(v))
        return friction @ self.c - 0.5 * load_work

    def energy_change(
        self, v: Array, target: Array, xi: Array | None = None, at: Place | None = None
    ) -> Any:
        """Return L̃(target) − L̃(v), summed from small terms, and the work of ξ [J/m].

        The work gives the scale of the terms. Near a solution the difference is far below the
        rounding of L̃ itself.

        xi, at: ξ and place of v, if known
        """
        if xi is None:
            xi = self.xi(v)
        move = target - v
        work = xi * move
        friction = self.c * self.law.integral(v, target, at)
        change = np.sum(friction - work + 0.5 * move * (move @ self.A_tilde), axis=-1)
        return change, np.abs(work).sum(axis=-1)

    def xi(self, v: Array) -> Array:
        """Return friction forces ξ = l̃ − Ãv, eq. (21) [N/m]; ξ_i/c_i is the traction −S_T."""
        return np.asarray(self.l_tilde - v @ self.A_tilde)

    @cached_property
    def traction_scale(self) -> float:
        """Scale of tractions before v is known [Pa].

        That of the law, else the largest load per length or b(0).
        """
        if self.law.b_scale > 0.0:
            return self.law.b_scale
        tractions = [*self.l_tilde / self.c, *np.ravel(self.law.b(0.0))]
        return float(np.max(np.abs(tractions), initial=0.0))

    def xi_rounding(self, v: Array) -> Any:
        """Return about how much rounding v to doubles changes the inclusion residual.

        This is the bound of scene/study.py: √m ε max_i ((|l̃| + |Ã||v|)_i/c_i + |b′(v_i) v_i|) over
        the scale of b, with the slope of b only off its jumps.
        """
        return self.rounding(v) / self.scale(self.xi(v))

    def rounding(self, v: Array, load: Array | None = None) -> Any:
        """Return the same before it is divided by the scale of b [Pa].

        load: (m,) sizes of the terms of l̃, by default |l̃| [N/m]
        """
        law = self.law
        at = law.locate(v)
        slope_left = np.abs(law.slope(v, at.piece))
        slope_right = np.abs(law.slope(v, at.piece + at.on))
        change = np.maximum(slope_left, slope_right) * np.abs(v)
        size = self._size(v, load) + np.where(law.kind(at) == BEND, change, 0.0)
        largest = np.max(size, axis=-1, initial=0.0)
        return np.sqrt(self.m) * np.finfo(float).eps * largest

    def _size(self, v: Array, load: Array | None = None) -> Array:
        """Return the size of the terms of tractions, (|l̃| + |Ã||v|)/c [Pa]."""
        if load is None:
            load = np.abs(self.l_tilde)
        return np.asarray((load + np.abs(v) @ np.abs(self.A_tilde)) / self.c)

    def distance(self, v: Array, tolerance: float = 0.0, xi: Array | None = None) -> Array:
        """Return (m,) dist(ξ_i/c_i, b̂(v_i)) [Pa].

        Nodes within `tolerance` of a kink are tested on the filled interval.
        """
        if xi is None:
            xi = self.xi(v)
        traction = xi / self.c
        low, high = self.law.interval(v, tolerance)
        return np.maximum(0.0, np.maximum(low - traction, traction - high))

    def inclusion_residual(self, v: Array, tolerance: float = 0.0, xi: Array | None = None) -> Any:
        """Return max_i dist(ξ_i/c_i, b̂(v_i)) / (scale of b).

        This is the acceptance test of every solution (method §3).

        xi: ξ if it is known better than double precision gives it
        """
        if xi is None:
            xi = self.xi(v)
        return self.relative(self.distance(v, tolerance, xi), xi)

    def residual_bound(self, v: Array) -> Any:
        """Return a residual that is no smaller than the inclusion residual in exact arithmetic.

        It adds the rounding error that the computed residual may hide. Sums of m products are taken
        to be off by up to √m ε of their magnitudes: the probabilistic bound of Higham & Mary, SIAM
        J. Sci. Comput. 41 (2019) A2815–A2835, with λ = 2, for sums one by one; BLAS sums in blocks,
        which is better.
        """
        law = self.law
        xi = self.xi(v)
        at = law.locate(v)
        terms_left = law.terms(v, at.piece)
        terms_right = law.terms(v, at.piece + at.on)
        terms = (np.sqrt(self.m) + 1.0) * self._size(v) + 2.0 * np.maximum(terms_left, terms_right)
        error = np.finfo(float).eps * terms
        traction = xi / self.c
        low, high = law.interval(v, place=at)
        distance = np.maximum(low - traction, traction - high)
        return self.relative(np.maximum(distance + error, 0.0), xi)

    def scale(self, xi: Array) -> Any:
        """Return the scale of b, its rays left out [Pa].

        That of the law; without one the largest of loads and of ξ per length, or b(0), or 1.
        """
        of_law = self._law_scale
        if np.all(of_law > 0.0):
            return of_law
        tractions = np.maximum(np.abs(self.l_tilde), np.abs(xi)) / self.c
        largest = np.max(tractions, axis=-1, initial=0.0)
        low, high = self.law.without_rays.interval(np.zeros(self.l_tilde.shape))
        sizes = np.maximum(np.abs(low), np.abs(high))
        b_0 = np.max(sizes, axis=-1, initial=0.0)
        otherwise = np.where(largest > 0.0, largest, np.where(b_0 > 0.0, b_0, 1.0))
        return np.where(of_law > 0.0, of_law, otherwise)[()]

    @cached_property
    def _law_scale(self) -> Any:
        if self.l_tilde.ndim == 1:
            return self.law.b_scale
        return np.max(self.law.scales[self.law.index], axis=-1)

    def relative(self, traction: Array, xi: Array) -> Any:
        """Return max |traction_i| / (scale of b); infinite where that is no number."""
        largest = np.max(np.abs(traction), axis=-1, initial=0.0) / self.scale(xi)
        return np.where(np.isfinite(largest), largest, np.inf)[()]

    @cached_property
    def lambda_1(self) -> float:
        """λ₁ = λ_min(C^{−½}ÃC^{−½}), the body's uniqueness threshold (method §5) [Pa/m].

        It is 0 for a body with a rigid-body mode.
        """
        return 0.0 if self.body.loose else self._eigenpair[0]

    @property
    def lambda_1_error(self) -> float:
        """Relative error of `lambda_1`: that of Ã and the residual of the eigenpair."""
        return self.A_error if self.body.loose else self.A_error + self._eigenpair[2]

    @cached_property
    def _eigenpair(self) -> tuple[float, Array, float]:
        return least_eigenpair(self.A_tilde, self.c)

    def frictionless(self) -> Array:
        """Return Ã⁻¹ l̃, the solution without friction (m,); the least one of a loose body."""
        if self.body.loose:
            return np.asarray(np.linalg.lstsq(self.A_tilde, self.l_tilde)[0])
        factor = scipy.linalg.cho_factor(self.A_tilde, lower=True)
        return scipy.linalg.cho_solve(factor, self.l_tilde)


def is_singular(matrix: Array) -> bool:
    """Return whether a symmetric matrix that has a Cholesky factor is singular to rounding."""
    if not len(matrix):
        return False
    root = 1.0 / np.sqrt(np.diagonal(matrix))
    scaled = matrix * root[:, None] * root
    norm = float(np.max(np.abs(scaled).sum(axis=0)))
    factor, info = scipy.linalg.lapack.dpotrf(scaled, lower=1, clean=0)
    if info != 0:
        return True
    reciprocal_condition, _ = scipy.linalg.lapack.dpocon(factor, norm, uplo="L")
    return bool(reciprocal_condition <= SINGULAR)


def trusted_share(error: float) -> float:
    """Return 1 − error, the share of Ã and λ₁ that proofs lean on.

    It is 1 where the error is within the margin that they have.
    """
    return 1.0 if error <= PROOF_MARGIN else max(1.0 - error, float(np.finfo(float).tiny))


def pivot_shift(A_tilde: Array, c: Array, lambda_1: float) -> float:
    """Return μ = PROOF_MARGIN·λ₁, but no less than the rounding of a Cholesky factor [Pa/m]."""
    largest = float(np.max(np.diagonal(A_tilde) / c))
    return max(PROOF_MARGIN * lambda_1, 8.0 * len(c) * float(np.finfo(float).eps) * largest)


def least_eigenvalue(A_tilde: Array, c: Array) -> float:
    """Return the smallest eigenvalue of Ãw = λCw with C = diag(c); inf for an empty matrix."""
    if len(c) == 0:
        return float("inf")
    root = 1.0 / np.sqrt(c)
    scaled = A_tilde * root[:, None] * root[None, :]
    return float(scipy.linalg.eigh(scaled, eigvals_only=True, subset_by_index=[0, 0])[0])


def least_eigenpair(A_tilde: Array, c: Array) -> tuple[float, Array, float]:
    """Return (λ, x, error) of the smallest λ with Ãx = λCx and xᵀCx = 1.

    An eigenvalue lies within λ(1 ± error).

    error: ‖C^{−½}(Ãx − λCx)‖/λ with a residual of twice the precision; inf for λ ≤ 0
    """
    if len(c) == 0:
        return float("inf"), c, 0.0
    root = 1.0 / np.sqrt(c)
    scaled = A_tilde * root[:, None] * root[None, :]
    eigenvalues, vectors = scipy.linalg.eigh(scaled, subset_by_index=[0, 0])
    eigenvalue = float(eigenvalues[0])
    x = root * vectors[:, 0]
    if not eigenvalue > 0.0:
        return eigenvalue, x, float("inf")
    residual, _ = extended_residual(eigenvalue * c * x, A_tilde, x)
    return eigenvalue, x, float(np.linalg.norm(root * residual)) / eigenvalue


def least_lowered(A_tilde: Array, c: Array, omega: Array) -> float:
    """Return λ_min(C^{−½}ÃC^{−½} − diag ω_i) [Pa/m].

    Above 0 every load has one solution. It is −∞ with a down-jump.
    """
    if not np.all(np.isfinite(omega)):
        return -float("inf")
    return least_eigenvalue(A_tilde - np.diag(c * omega), c)
