"""The condensed contact problem on plain arrays, one or rows of them on one body, and the test of
its solutions.

Problem:    0 ∈ ∂L̃(v),  L̃(v) = ½vᵀÃv − l̃ᵀv + Ψ(v),  Ψ(v) = Σ c_i j(v_i)
Acceptance: ξ = l̃ − Ãv with ξ_i ∈ c_i b̂(v_i), i = 1..m, eq. (21)
Literature: Šestak & Jovanović, Appl. Math. Mech. 31 (2010), §3

The body knows no load and no law: its record is made once (offline), pickles, and serves any number
of problems. A body whose E varies is one body, too: divide the problem by E.

Large bodies have coarser copies of themselves, which give starts (nested iteration): the Galerkin
restriction to every second contact node with linear interpolation P, Ã_c = PᵀÃP, l̃_c = Pᵀl̃, c_c =
Pᵀc and those nodes' laws, is a contact problem again and costs an eighth. The nodes are taken in
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
    """Why a run ended. Only CONVERGED is a solution; everything else carries a reason."""

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

    x:              the last iterate, (n,)
    f:              objective there
    status:         why the run ended
    reason:         one sentence for the user: what happened and, on failure, what to try
    iterations:     steps taken
    evaluations:    evaluations of the objective (a line-search trial counts as one)
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


COARSEST = 40
"""Contact nodes up to which a body has no coarser copy."""
MARGIN = 1e-6
"""μ/λ₁: by how much a matrix must be positive definite in a proof."""


@dataclass(frozen=True, eq=False)
class CondensedBody:
    """What all contact problems on one body share.

    A_tilde:  (m, m) symmetric positive definite, condensed stiffness [Pa]
    c:        (m,) segment lengths meas(S_i) > 0 [m]
    A_error:  as in ContactProblem
    shared:   many problems on it are to be solved, so that Ã⁻¹ pays
    """

    A_tilde: Array
    c: Array
    A_error: float = 0.0
    shared: bool = True

    @classmethod
    def of(cls, A_tilde: Array, c: Array, A_error: float = 0.0) -> CondensedBody:
        """The record of Ã (m, m) and c (m,) with all that is made of them; two factorisations and
        an eigenvalue.

        Raises ValueError if Ã is not positive definite: then the body can move freely.
        """
        body = cls(np.array(A_tilde, dtype=float, order="C"), np.array(c, dtype=float), A_error)
        if body.loose:
            raise ValueError(
                "the condensed stiffness is not positive definite: the body can move freely (clamp it)"
            )
        copy: CondensedBody | None = body
        while copy is not None:
            _, _, copy = copy.inverse, copy.lambda_1, copy.coarse
        return body

    @classmethod
    def known(cls, A_tilde: Array, c: Array, A_error: float = 0.0, **facts: Any) -> CondensedBody:
        """The record for one problem, with those of its `lambda_1` and `inverse` that are known and
        not None."""
        body = cls(A_tilde, c, A_error, shared=False)
        vars(body).update({name: fact for name, fact in facts.items() if fact is not None})
        return body

    @property
    def m(self) -> int:
        """Number of contact nodes."""
        return len(self.c)

    @cached_property
    def loose(self) -> bool:
        """Whether only friction holds it: Ã is singular, there is no inverse, and λ₁ is 0."""
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
    def coarse(self) -> CondensedBody | None:
        """Its Galerkin copy on every second node, None for a small body."""
        if self.m <= COARSEST or self.loose:
            return None
        coarse = self.P.T @ (self.P.T @ self.A_tilde).T
        return CondensedBody(
            np.ascontiguousarray(0.5 * (coarse + coarse.T)), self.P.T @ self.c, shared=self.shared
        )

    @cached_property
    def shift(self) -> float:
        """μ, by how much a matrix must be positive definite in a proof [Pa/m]."""
        return pivot_shift(self.A_tilde, self.c, self.lambda_1)

    @cached_property
    def P(self) -> scipy.sparse.csr_matrix:
        """(m, ⌈m/2⌉) linear interpolation from the nodes 0, 2, 4, … of the coarse copy."""
        count, node = (self.m + 1) // 2, np.arange(self.m)
        columns = np.concatenate([node // 2, np.minimum((node + 1) // 2, count - 1)])
        shape = self.m, count
        return scipy.sparse.csr_matrix(
            (np.full(2 * self.m, 0.5), (np.tile(node, 2), columns)), shape=shape
        )

    @cached_property
    def rounding(self) -> float:
        """Relative error of products with Ã⁻¹: rounding, and what Ã itself has lost."""
        condition = float(np.linalg.norm(self.A_tilde, 1) * np.linalg.norm(self.inverse, 1))
        return 8.0 * self.m * float(np.finfo(float).eps) * condition + (1.0 - kept(self.A_error))


@dataclass(frozen=True)
class ContactProblem:
    """0 ∈ Ãv − l̃ + ∂Ψ(v) for the tangential displacements v of the m contact nodes; or R of these,
    a row each.

    A_tilde: (m, m) symmetric positive definite, condensed stiffness [Pa]
    l_tilde: (m,) condensed load, or (R, m) [N/m]
    c:       (m,) segment lengths meas(S_i) > 0 [m]
    law:     friction law b [Pa] of the slip [m], or those of nodes, of rows, of both (tcstudy/laws)
    A_error: relative error of Ã in its softest direction, and so of λ₁: proofs hold for (1 − A_error) Ã, too

    What is said of one v (m,) below is said of rows (R, m) as well; numbers then are (R,).
    """

    A_tilde: Array
    l_tilde: Array
    c: Array
    law: Laws
    A_error: float = 0.0

    @classmethod
    def on(cls, body: CondensedBody, l_tilde: Array, law: Laws) -> ContactProblem:
        """The problem, or rows of them, on a body whose record is known."""
        problem = ContactProblem(body.A_tilde, l_tilde, body.c, law, body.A_error)
        vars(problem)["body"] = body
        return problem

    @property
    def m(self) -> int:
        """Number of contact unknowns."""
        return len(self.c)

    @cached_property
    def body(self) -> CondensedBody:
        """What is made of Ã and c alone."""
        return CondensedBody.known(
            np.ascontiguousarray(self.A_tilde, dtype=float), self.c, self.A_error
        )

    @cached_property
    def rows(self) -> ContactProblem:
        """One problem as a block of one row."""
        return ContactProblem.on(
            self.body, self.l_tilde[None], self.law.tables.at(np.atleast_2d(self.law.index))
        )

    def take(self, rows: Index) -> ContactProblem:
        """The named rows."""
        return ContactProblem.on(self.body, self.l_tilde[rows], self.law.of_nodes(rows))

    def single(self, row: int) -> ContactProblem:
        """One row as a problem of its own."""
        return ContactProblem.on(self.body, self.l_tilde[row], self.law.of_row(row))

    def coarse(self) -> ContactProblem | None:
        """The same rows on the body's coarse copy, if it has one."""
        if self.body.coarse is None:
            return None
        laws = self.law.of_nodes((slice(None), slice(None, None, 2)))
        return ContactProblem.on(self.body.coarse, self.l_tilde @ self.body.P, laws)

    def energy(self, v: Array) -> Any:
        """L̃(v) [J/m]."""
        friction = self.law.integral(np.zeros(v.shape), v)
        return friction @ self.c - 0.5 * np.einsum("...i,...i->...", v, self.l_tilde + self.xi(v))

    def energy_change(
        self, v: Array, target: Array, xi: Array | None = None, at: Place | None = None
    ) -> Any:
        """L̃(target) − L̃(v), summed from small terms, and the work of ξ that it is small against
        [J/m].

        Near a solution the difference is far below the rounding of L̃ itself. xi, at: ξ and place
        of v, if known
        """
        move = target - v
        work = (self.xi(v) if xi is None else xi) * move
        friction = self.c * self.law.integral(v, target, at)
        change = np.sum(friction - work + 0.5 * move * (move @ self.A_tilde), axis=-1)
        return change, np.abs(work).sum(axis=-1)

    def xi(self, v: Array) -> Array:
        """Nodal friction forces ξ = l̃ − Ãv, eq. (21) [N/m]; ξ_i/c_i is the traction −S_T."""
        return np.asarray(self.l_tilde - v @ self.A_tilde)

    @cached_property
    def traction_scale(self) -> float:
        """What is known of `scale` before v is: the law's own, else the largest load per length or
        b(0) [Pa]."""
        own = self.law.b_scale
        if own > 0.0:
            return own
        return float(
            np.max(np.abs([*self.l_tilde / self.c, *np.ravel(self.law.b(0.0))]), initial=0.0)
        )

    def xi_rounding(self, v: Array) -> Any:
        """What rounding v to doubles does to the inclusion residual, about: the bound of
        scene/study.py.

        √m ε max_i ((|l̃| + |Ã||v|)_i/c_i + |b′(v_i) v_i|) / (scale of b), the slope of b only off
        its jumps.
        """
        return self.rounding(v) / self.scale(self.xi(v))

    def rounding(self, v: Array, load: Array | None = None) -> Any:
        """The same before it is divided by the scale of b [Pa].

        load: (m,) sizes of what l̃ is summed from, |l̃| without [N/m]
        """
        at, law = self.law.locate(v), self.law
        slope = np.maximum(*(np.abs(law.slope(v, piece)) for piece in (at.piece, at.piece + at.on)))
        size = self._size(v, load) + np.where(law.kind(at) == BEND, slope * np.abs(v), 0.0)
        return np.sqrt(self.m) * np.finfo(float).eps * np.max(size, axis=-1, initial=0.0)

    def _size(self, v: Array, load: Array | None = None) -> Array:
        """What tractions are made of, (|l̃| + |Ã||v|)/c [Pa]."""
        load = np.abs(self.l_tilde) if load is None else load
        return np.asarray((load + np.abs(v) @ np.abs(self.A_tilde)) / self.c)

    def distance(self, v: Array, tolerance: float = 0.0, xi: Array | None = None) -> Array:
        """(m,) dist(ξ_i/c_i, b̂(v_i)) [Pa]; nodes within `tolerance` of a kink are tested on the
        filled interval."""
        traction = (self.xi(v) if xi is None else xi) / self.c
        low, high = self.law.interval(v, tolerance)
        return np.maximum(0.0, np.maximum(low - traction, traction - high))

    def inclusion_residual(self, v: Array, tolerance: float = 0.0, xi: Array | None = None) -> Any:
        """max_i dist(ξ_i/c_i, b̂(v_i)) / (scale of b), the acceptance test of every solution
        (method §3).

        xi: ξ if it is known better than double precision gives it
        """
        return self.relative(self.distance(v, tolerance, xi), self.xi(v) if xi is None else xi)

    def residual_bound(self, v: Array) -> Any:
        """The same, no smaller than it is in exact arithmetic: with what rounding may hide in it.

        Sums of m products are taken to be off by up to √m ε of their magnitudes: the probabilistic
        bound of Higham & Mary, SIAM J. Sci. Comput. 41 (2019) A2815–A2835, with λ = 2, for sums one
        by one; BLAS sums in blocks, which is better.
        """
        law, xi, at = self.law, self.xi(v), self.law.locate(v)
        terms = np.maximum(*(law.terms(v, piece) for piece in (at.piece, at.piece + at.on)))
        error = np.finfo(float).eps * ((np.sqrt(self.m) + 1.0) * self._size(v) + 2.0 * terms)
        low, high = law.interval(v, place=at)
        return self.relative(
            np.maximum(np.maximum(low - xi / self.c, xi / self.c - high) + error, 0.0), xi
        )

    def scale(self, xi: Array) -> Any:
        """The law's own scale of b; without one the largest of loads and of ξ per length, or b(0);
        or 1 [Pa]."""
        own = self._own_scale
        if np.all(own > 0.0):
            return own
        forces = np.max(np.maximum(np.abs(self.l_tilde), np.abs(xi)) / self.c, axis=-1, initial=0.0)
        at_0 = np.maximum(*(np.abs(b) for b in self.law.interval(np.zeros(self.l_tilde.shape))))
        at_0 = np.max(at_0, axis=-1, initial=0.0)
        return np.where(
            own > 0.0, own, np.where(forces > 0.0, forces, np.where(at_0 > 0.0, at_0, 1.0))
        )[()]

    @cached_property
    def _own_scale(self) -> Any:
        law = self.law
        return law.b_scale if self.l_tilde.ndim == 1 else np.max(law.scales[law.index], axis=-1)

    def relative(self, traction: Array, xi: Array) -> Any:
        """max |traction_i| / (scale of b); infinite where that is no number."""
        worst = np.max(np.abs(traction), axis=-1, initial=0.0) / self.scale(xi)
        return np.where(np.isfinite(worst), worst, np.inf)[()]

    @cached_property
    def lambda_1(self) -> float:
        """λ₁ = λ_min(C^{−½}ÃC^{−½}), the body's uniqueness threshold (method §5) [Pa/m]."""
        return self._least[0]

    @property
    def lambda_1_error(self) -> float:
        """Relative error of `lambda_1`: that of Ã and the residual of the eigenpair."""
        return self.A_error + self._least[2]

    @cached_property
    def _least(self) -> tuple[float, Array, float]:
        return least_eigenpair(self.A_tilde, self.c)

    def frictionless(self) -> Array:
        """Ã⁻¹ l̃, the solution without friction (m,)."""
        return scipy.linalg.cho_solve(
            scipy.linalg.cho_factor(self.A_tilde, lower=True), self.l_tilde
        )


def kept(error: float) -> float:
    """1 − error, the share of Ã and λ₁ that proofs lean on; 1 where the error is within the margin
    that they have."""
    return 1.0 if error <= MARGIN else max(1.0 - error, float(np.finfo(float).tiny))


def pivot_shift(A_tilde: Array, c: Array, lambda_1: float) -> float:
    """μ = MARGIN·λ₁, but no less than the rounding of a Cholesky factorisation [Pa/m]."""
    largest = float(np.max(np.diagonal(A_tilde) / c))
    return max(MARGIN * lambda_1, 8.0 * len(c) * float(np.finfo(float).eps) * largest)


def least_eigenvalue(A_tilde: Array, c: Array) -> float:
    """Smallest eigenvalue of Ãw = λCw with C = diag(c); inf for an empty matrix."""
    if len(c) == 0:
        return float("inf")
    root = 1.0 / np.sqrt(c)
    scaled = A_tilde * root[:, None] * root[None, :]
    return float(scipy.linalg.eigh(scaled, eigvals_only=True, subset_by_index=[0, 0])[0])


def least_eigenpair(A_tilde: Array, c: Array) -> tuple[float, Array, float]:
    """(λ, x, error) of the smallest λ with Ãx = λCx and xᵀCx = 1: no eigenvalue is nearer than λ(1
    ± error).

    error: ‖C^{−½}(Ãx − λCx)‖/λ with a residual of twice the precision; inf for λ ≤ 0
    """
    if len(c) == 0:
        return float("inf"), c, 0.0
    root = 1.0 / np.sqrt(c)
    values, vectors = scipy.linalg.eigh(
        A_tilde * root[:, None] * root[None, :], subset_by_index=[0, 0]
    )
    value, x = float(values[0]), root * vectors[:, 0]
    residual, _ = extended_residual(value * c * x, A_tilde, x)
    return value, x, float(np.linalg.norm(root * residual)) / value if value > 0.0 else float("inf")


def least_lowered(A_tilde: Array, c: Array, omega: Array) -> float:
    """λ_min(C^{−½}ÃC^{−½} − diag ω_i) [Pa/m]: above 0 every load has one solution; −∞ with a
    down-jump."""
    if not np.all(np.isfinite(omega)):
        return -float("inf")
    return least_eigenvalue(A_tilde - np.diag(c * omega), c)
