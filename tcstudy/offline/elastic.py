"""The body with one elastic ratio λ/μ, condensed: basis loads eliminated in batches, products for the energy.

Where materials differ by region the ratio is that of all their moduli to μ of the material of the body.

A(λ, μ) = μ A(λ/μ, 1), so that one factorisation serves all materials of the same ratio: Ã scales with μ, l̃ does not
depend on it, A⁻¹l scales with 1/μ.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np
import scipy.linalg
import scipy.sparse as sp
from numpy.typing import NDArray

from tcstudy.condense import Condensation, ForwardLoad, condense
from tcstudy.condense.multifrontal import Known
from tcstudy.condense.symbolic import EliminationPlan
from tcstudy.contact.problem import least_eigenpair
from tcstudy.fem.boundary import ContactLine
from tcstudy.fem.forms import ElasticForms, Moduli, Springs
from tcstudy.fem.meshes import Frames
from tcstudy.offline.loads import BasisLoad, LoadTerm, Prescribed, Recent
from tcstudy.scene.points import distinct, of_stiffness
from tcstudy.scene.records import Scene, Where

Array = NDArray[np.float64]

ROUNDINGS = 4.0
"""Of A, by which the error of λ₁ is estimated."""


@dataclass(frozen=True)
class _Basis:
    """One basis load: (m,) its condensed form, (N,) L⁻¹F in elimination order, F at the rows that are held."""

    l_tilde: Array
    rows: Array = field(repr=False)
    held: Array = field(repr=False)


@dataclass(frozen=True)
class Span:
    """The basis loads of one scene, ready for any coefficients.

    l_tilde: (m, t);  gram: (t, t) ⟨l_a, A₂₂⁻¹ l_b⟩ for μ = 1;  held: (t, h) loads at the rows that are held
    """

    l_tilde: Array
    gram: Array
    held: Array


def ratio_and_scale(scene: Scene) -> tuple[tuple[Moduli, Springs], float]:
    """(all moduli and springs over μ, μ of the material of the body).

    The ratio has 15 digits, so that E varies without a new factorisation whatever the rounding.
    """
    mu = scene.material.mu
    moduli = tuple((at, _digits(one.lam / mu), _digits(one.mu / mu)) for at, one in scene.pieces)
    return (moduli, tuple((edge, _digits(n / mu), _digits(t / mu)) for edge, n, t in scene.springs)), mu


def _digits(ratio: float) -> float:
    return float(f"{ratio:.14e}")


def swept_parts(scenes: Sequence[Scene]) -> tuple[Where, ...]:
    """The parts of the body in which the stiffness over μ differs between scenes; () where that is nowhere or all over.

    What the other parts have of a factor serves all scenes.
    """
    ratios = [ratio_and_scale(scene)[0] for scene in distinct(scenes, *of_stiffness(scenes))]
    found: dict[Where, set[tuple[float, float]]] = {}
    for moduli, springs in ratios:
        if springs != ratios[0][1]:
            return ()
        for where, lam, mu in moduli:
            found.setdefault(where, set()).add((lam, mu))
    swept = tuple(where for where, values in found.items() if len(values) > 1)
    return swept if len(swept) < len(found) else ()


class Elastic:
    """Everything that depends on the ratio of moduli, for μ = 1."""

    def __init__(
        self,
        forms: ElasticForms,
        frames: Frames,
        line: ContactLine,
        ratio: Moduli,
        memory: float,
        plan: EliminationPlan | None = None,
        changing: NDArray[np.bool_] | None = None,
        known: Known | None = None,
        held: bool = True,
        springs: Springs = (),
        *,
        local: Callable[[BasisLoad], Array],
        together: Callable[[BasisLoad], Sequence[BasisLoad]],
    ) -> None:
        """frames: which rows are held (their values do not matter here);  plan: that of another ratio on the mesh.

        changing, known: rows in which other ratios differ, and what a factor of one of these has of the others
        held: False for a body that may slide along the contact line, which then has no λ₁
        springs: of edges, for μ = 1
        local, together: a basis load in local rows (2n,), of what is prescribed w_D; the loads made together with one
        Raises NotPositiveDefinite if the body is not held.
        """
        self._local, self._together = local, together
        stiffness = forms.stiffness_of(ratio, frames)
        if springs or frames.ties is not None:
            added = forms.springs(springs, frames) if springs else 0.0 * stiffness
            stiffness = frames.tied(sp.csr_array(stiffness + added))
        eliminate = ~frames.fixed
        eliminate[line.nodes] = False
        points = forms.mesh.points
        self.condensation: Condensation = condense(
            stiffness, points, line.nodes, eliminate, components=2, plan=plan, changing=changing, known=known
        )
        if held:
            self.condensation.require_definite()
        self.lambda_1, self.lambda_1_error = self._least(stiffness.diagonal(), line.c) if held else (0.0, 0.0)
        self._held = np.flatnonzero(frames.fixed)
        self._reactions = stiffness[self._held]  # all that is needed of the matrix from here on
        self._basis: Recent[_Basis] = Recent(memory, lambda b: b.rows.nbytes)
        self._spans: Recent[Span] = Recent(memory, lambda s: s.l_tilde.nbytes)
        self._products: dict[tuple[BasisLoad, BasisLoad], float] = {}
        self._scaled: Recent[Array] = Recent(1, lambda _: 1)
        self._inverses: Recent[Array] = Recent(1, lambda _: 1)

    def _least(self, diagonal: Array, c: Array) -> tuple[float, float]:
        """(λ₁, its relative error): the residual of the eigenpair, and what rounding of A does to it.

        Assembly and factorisation know A up to about ε√(A_ii A_jj) in every entry (Cholesky: Demmel, LAPACK Working
        Note 14, 1989), which moves λ₁ = uᵀAu by ε Σ A_ii u_i² with u the mode of the whole body: what is lost where
        that is stiff but only moves as a whole, or along an edge that a spring holds across. An estimate, ROUNDINGS
        of them; of 200 random bodies none lost more than one.
        """
        value, x, error = least_eigenpair(self.condensation.A_tilde, c)
        work = float(diagonal @ self.extension(x) ** 2)
        return value, error + (ROUNDINGS * np.finfo(float).eps * work / value if value > 0.0 else np.inf)

    def A_tilde(self, mu: float) -> Array:
        """Ã for a shear modulus μ [Pa]; the same array for the same μ."""
        return self._scaled.get(mu, lambda: mu * self.condensation.A_tilde)

    def A_inverse(self, mu: float) -> Array:
        """Ã⁻¹ for a shear modulus μ; the same array for the same μ."""
        return self._inverses.get(mu, lambda: np.asarray(scipy.linalg.inv(self.A_tilde(mu))))

    def reaction(self, values: Array) -> Array:
        """A w_D (2n,) for prescribed local displacements w_D (2n,)."""
        return self._reactions.T @ values[self._held]

    def span(self, loads: tuple[BasisLoad, ...]) -> Span:
        """The basis loads of a scene; those that are missing are eliminated together."""

        def made() -> Span:
            bases, t, m = self._bases(loads), len(loads), self.condensation.m
            gram = np.empty((t, t))
            for i in range(t):
                for j in range(i + 1):
                    key = (loads[i], loads[j])
                    if key not in self._products:
                        # the kept unknowns come last in the elimination, the rows before them are L⁻¹l₂
                        inner = len(bases[i].rows) - m
                        product = float(bases[i].rows[:inner] @ bases[j].rows[:inner])
                        self._products[key] = self._products[key[::-1]] = product
                    gram[i, j] = gram[j, i] = self._products[key]
            l_tilde = np.column_stack([b.l_tilde for b in bases]) if t else np.zeros((m, 0))
            return Span(l_tilde, gram, np.array([b.held for b in bases]).reshape(t, len(self._held)))

        return self._spans.get(loads, made)

    def _bases(self, loads: Sequence[BasisLoad]) -> list[_Basis]:
        """Basis loads condensed, from the cache or eliminated at once with their companions.

        A load always goes with the same companions, so that its digits do not depend on what was asked for before.
        """
        found: dict[BasisLoad, _Basis] = {}
        for load in loads:
            known = self._basis.find(load)
            if known is None and load not in found:
                together = self._together(load)
                rows = ((one, self._local(one)) for one in together)
                F = np.column_stack([-self.reaction(x) if isinstance(one, Prescribed) else x for one, x in rows])
                forward = self.condensation.forward(F)
                for i, one in enumerate(together):
                    found[one] = _Basis(forward.l_tilde[:, i].copy(), forward.rows[:, i].copy(), F[self._held, i])
                    self._basis.put(one, found[one])
            elif known is not None:
                found[load] = known
        return [found[load] for load in loads]

    def condensed(self, load: Array) -> Array:
        """(m,) a load in local rows (2n,), condensed."""
        return np.asarray(self.condensation.forward(load[:, None]).l_tilde[:, 0])

    def displacement(self, mu: float, u_T: Array, terms: Sequence[LoadTerm]) -> Array:
        """Local displacements (2n,), eq. (20), without the prescribed ones."""
        bases = self._bases([term.load for term in terms])
        rows = np.zeros((len(self.condensation.plan.permutation), 1))
        for term, basis in zip(terms, bases, strict=True):
            rows[:, 0] += term.coefficient / mu * basis.rows
        return self.condensation.expand(u_T, ForwardLoad(np.zeros(self.condensation.m), rows))

    def extension(self, u_T: Array) -> Array:
        """Local displacements (2n,) of the body without load whose contact nodes are moved by u_T (m,)."""
        return self.condensation.expand(u_T)

    def energy_constant(self, mu: float, span: Span, coefficients: Array, loads: int, values: Array) -> float:
        """L_θ(u) − L̃(u₁) = −½⟨l₂, A₂₂⁻¹l₂⟩ + ½⟨w_D, A w_D⟩ − ⟨l, w_D⟩ with w_D the prescribed part `values` (2n,).

        loads: how many of the terms are loads l; behind them stands the reaction to w_D
        """
        value = -0.5 / mu * float(coefficients @ span.gram @ coefficients)
        w_D = values[self._held]
        if np.any(w_D):
            value += 0.5 * mu * float(values @ self.reaction(values))
            value -= float(coefficients[:loads] @ (span.held[:loads] @ w_D))
        return value
