"""One condensed body, contact problems on it as rows of arrays, and what a block of them is answered with.

Nothing here knows a load, a law or a mesh: the record is made once (offline), pickles, and serves any number of
problems 0 ∈ Ãv − l̃ + ∂Ψ(v) on this body. A body whose E varies is one body, too: divide the problem by E.

Large bodies have coarser copies of themselves, which give starts (nested iteration): the Galerkin restriction to every
second contact node with linear interpolation P, Ã_c = PᵀÃP, l̃_c = Pᵀl̃, c_c = Pᵀc and those nodes' laws, is a contact
problem again and costs an eighth. The nodes are taken in the order of their numbers, along Γ_C; another order costs
quality of the start, never correctness.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.linalg
import scipy.sparse
from numpy.typing import NDArray

from tcstudy.contact.problem import ContactProblem, distance_bound, inverse_rounding, least_eigenvalue, pivot_shift
from tcstudy.contact.separable.finish import extended
from tcstudy.laws.laws import Laws
from tcstudy.laws.pieces import BEND, Place
from tcstudy.scene.study import Acceptance

Array = NDArray[np.float64]
Index = NDArray[np.intp]
Flags = NDArray[np.bool_]

COARSEST = 40
"""Contact nodes up to which a body has no coarser copy."""


@dataclass(frozen=True, eq=False)
class CondensedBody:
    """What all contact problems on one body share.

    A_tilde:  (m, m) symmetric positive definite, condensed stiffness [Pa]
    c:        (m,) segment lengths meas(S_i) > 0 [m]
    A_error:  as in ContactProblem
    loose:    only friction holds it: Ã is singular, there is no inverse, and λ₁ is 0
    shared:   many problems on it are to be solved, so that Ã⁻¹ pays
    """

    A_tilde: Array
    c: Array
    A_error: float = 0.0
    loose: bool = False
    shared: bool = True

    @classmethod
    def of(cls, A_tilde: Array, c: Array, A_error: float = 0.0) -> CondensedBody:
        """The record of Ã (m, m) and c (m,) with all that is made of them; two factorisations and an eigenvalue.

        Raises ValueError if Ã is not positive definite: then the body can move freely.
        """
        body = cls(np.array(A_tilde, dtype=float, order="C"), np.array(c, dtype=float), A_error)
        copy: CondensedBody | None = body
        while copy is not None:
            _, _, copy = copy.inverse, copy.lambda_1, copy.coarse
        return body

    @cached_property
    def inverse(self) -> Array:
        """Ã⁻¹ (m, m) [1/Pa]."""
        factor, info = scipy.linalg.lapack.dpotrf(self.A_tilde, lower=1)
        if info != 0:
            raise ValueError("the condensed stiffness is not positive definite: the body can move freely (clamp it)")
        half = scipy.linalg.lapack.dpotri(factor, lower=1)[0] if self.m else self.A_tilde
        return np.ascontiguousarray(np.tril(half) + np.tril(half, -1).T)

    @cached_property
    def lambda_1(self) -> float:
        """λ_min(C^{−½}ÃC^{−½}) [Pa/m]."""
        return 0.0 if self.loose else least_eigenvalue(self.A_tilde, self.c)

    @cached_property
    def coarse(self) -> CondensedBody | None:
        """Its Galerkin copy on every second node, None for a small body."""
        if self.loose or self.m <= COARSEST:
            return None
        return CondensedBody(*galerkin(self.A_tilde, self.c, self.P), shared=self.shared)

    @property
    def m(self) -> int:
        """Number of contact nodes."""
        return len(self.c)

    @cached_property
    def shift(self) -> float:
        """μ, by how much a matrix must be positive definite in a proof [Pa/m]."""
        return pivot_shift(self.A_tilde, self.c, self.lambda_1)

    @cached_property
    def P(self) -> scipy.sparse.csr_matrix:
        """(m, ⌈m/2⌉) interpolation from the nodes of the coarse copy."""
        return interpolation(self.m)

    @cached_property
    def rounding(self) -> float:
        """Relative rounding of products with Ã⁻¹."""
        return inverse_rounding(self.A_tilde, self.inverse, self.A_error)


@dataclass(frozen=True, eq=False)
class Rows:
    """R contact problems on one body: loads l̃ (R, m) [N/m] and laws."""

    body: CondensedBody
    laws: Laws
    loads: Array

    def take(self, rows: Index) -> Rows:
        """The named rows."""
        return Rows(self.body, self.laws.of_nodes(rows), self.loads[rows])

    @cached_property
    def _own_scale(self) -> tuple[Array, Index]:
        """(R,) the laws' own scale of b [Pa], and the rows in which they have none."""
        scale = np.max(self.laws.scales[self.laws.index], axis=1)
        return scale, np.flatnonzero(scale == 0.0)

    def scale(self, xi: Array) -> Array:
        """(R,) scale of b as ContactProblem.scale has it, 1 where that is 0 [Pa]."""
        scale, bare = self._own_scale
        if not len(bare):
            return scale
        forces = np.max(np.maximum(np.abs(self.loads[bare]), np.abs(xi[bare])) / self.body.c, axis=1, initial=0.0)
        zero, own = np.zeros((len(bare), self.body.m)), self.laws.of_nodes(bare)
        at_0 = np.maximum(*(np.max(np.abs(b), axis=1, initial=0.0) for b in own.interval(zero)))
        scale = scale.copy()
        scale[bare] = np.where(forces > 0.0, forces, np.where(at_0 > 0.0, at_0, 1.0))
        return scale

    def coarse(self) -> Rows | None:
        """The same problems on the body's coarse copy, if it has one."""
        copy = self.body.coarse
        return (
            None
            if copy is None
            else Rows(copy, self.laws.of_nodes((slice(None), slice(None, None, 2))), self.loads @ self.body.P)
        )

    def single(self, row: int) -> ContactProblem:
        """One row as the single solve takes it."""
        return ContactProblem(self.body.A_tilde, self.loads[row], self.body.c, self.laws.of_row(row), self.body.A_error)

    def xi(self, v: Array) -> Array:
        """ξ = l̃ − Ãv (R, m) [N/m]."""
        return np.asarray(self.loads - v @ self.body.A_tilde)

    def energy(self, v: Array) -> Array:
        """(R,) L̃(v) [J/m]."""
        zero = np.zeros(v.shape)
        friction = self.laws.integral(zero, v)
        return np.asarray(friction @ self.body.c - 0.5 * np.einsum("ri,ri->r", v, self.loads + self.xi(v)))

    def energy_change(self, x: Array, xi: Array, target: Array, at: Place) -> tuple[Array, Array]:
        """(R,) each: L̃(target) − L̃(x), summed from small terms, and the work of ξ that it is small against [J/m].

        xi, at: ξ and place of x
        """
        move = target - x
        work = xi * move
        friction = self.body.c * self.laws.integral(x, target, at)
        change = np.sum(friction - work + 0.5 * move * (move @ self.body.A_tilde), axis=1)
        return change, np.abs(work).sum(axis=1)


@dataclass(frozen=True, eq=False)
class Certificates:
    """What is proved about P points, (P,) each; the meaning is that of tcstudy.contact.certificates.Certificate.

    margin: NaN with one law a row, where it is λ₁ − ω [Pa/m]
    """

    omega: Array
    convex: Flags
    unique: Flags
    strict_minimum: Flags
    global_minimum: Flags
    margin: Array


@dataclass(frozen=True, eq=False)
class BlockAnswers:
    """Judged solutions of P points: fields (P,), (P, m) or (P, 5) with the meaning of tcstudy.contact.contact.Answer.

    steps: Newton steps on the body itself of the descent that led to v, or of the single solve
    certificates: what is proved
    """

    v: Array
    v_low: Array
    xi: Array
    inclusion_residual: Array
    rounding: Array
    limited: Flags
    energy: Array
    status: NDArray[np.int8]
    reasons: tuple[str, ...]
    start: NDArray[np.int8]
    start_energies: Array
    steps: NDArray[np.intp]
    certificates: Certificates


@dataclass(frozen=True, eq=False)
class Judged:
    """ξ (R, m), inclusion residual, what rounding allows, and whether that is a solution, (R,) each."""

    xi: Array
    residual: Array
    rounding: Array
    accepted: Flags


def judge(rows: Rows, v: Array, acceptance: Acceptance) -> Judged:
    """The inclusion test of rows, as ContactProblem.residual_bound and tcstudy/scene/study.py have it.

    Where rounding leaves that open it is formed in extended precision.
    """
    body, laws, xi = rows.body, rows.laws, rows.xi(v)
    scale, at = rows.scale(xi), laws.locate(v)
    size = (np.abs(rows.loads) + np.abs(v) @ np.abs(body.A_tilde)) / body.c
    terms, slope = laws.terms(v, at.piece), np.abs(laws.slope(v, at.piece) * v)
    if len(on := at.on.nonzero()[0]):
        node = at.on.nonzero()[1]
        s, right = v[on, node], at.piece[on, node] + 1
        terms[on, node] = np.maximum(terms[on, node], laws.terms(s, right))
        bends = laws.kind_above.take(right - 1) == BEND
        slope[on, node] = np.where(bends, np.maximum(slope[on, node], np.abs(laws.slope(s, right) * s)), 0.0)
    residual = distance_bound(xi / body.c, *laws.interval(v, at=at), size, terms) / scale
    rounding = np.sqrt(body.m) * np.finfo(float).eps * np.max(size + slope, axis=1, initial=0.0) / scale
    for i in np.flatnonzero(~(residual <= acceptance.aim)):
        known = extended(rows.single(int(i)), v[i])
        xi[i], residual[i] = known.xi, known.residual
    residual[np.isnan(residual)] = np.inf
    limits = np.array([acceptance.limit(float(x)) for x in rounding])
    return Judged(xi, residual, rounding, residual <= limits)


def as_row(problem: ContactProblem) -> Rows:
    """One problem as a block of one row; only friction may hold its body."""
    A = np.ascontiguousarray(problem.A_tilde, dtype=float)
    loose = scipy.linalg.lapack.dpotrf(A, lower=1)[1] != 0
    body = CondensedBody(A, problem.c, problem.A_error, loose, shared=False)
    return Rows(body, problem.law.tables.at(np.atleast_2d(problem.law.index)), problem.l_tilde[None])


def interpolation(m: int) -> scipy.sparse.csr_matrix:
    """(m, ⌈m/2⌉) linear interpolation from the nodes 0, 2, 4, …"""
    coarse = (m + 1) // 2
    node = np.arange(m)
    columns = np.concatenate([node // 2, np.minimum((node + 1) // 2, coarse - 1)])
    rows = np.concatenate([node, node])
    return scipy.sparse.csr_matrix((np.full(2 * m, 0.5), (rows, columns)), shape=(m, coarse))


def galerkin(A_tilde: Array, c: Array, P: scipy.sparse.csr_matrix) -> tuple[Array, Array]:
    """(PᵀÃP, Pᵀc), the Galerkin restriction of a body to the columns of P."""
    coarse = P.T @ (P.T @ A_tilde).T
    return np.ascontiguousarray(0.5 * (coarse + coarse.T)), P.T @ c
