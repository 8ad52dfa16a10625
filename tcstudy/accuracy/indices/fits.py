"""Least-squares fits of the mean of Y at a given X, and the choice among them.

Bases are compared by the squared errors at points left out, e²/(1 − h)². A jump costs more than its
height, because its place is searched: twice the log-likelihood gains up to 3 by the place, and a
prediction loses as much (Ninomiya, Ann. Inst. Stat. Math. 67 (2015) 943). The place of a high jump
is known and costs nothing. A jump is taken only if it pays for the search among N places. Chosen is
the smallest basis that is not clearly worse than the best.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tcstudy.accuracy.indices.bases import (
    MAX_CLASSES,
    Array,
    Ordering,
    class_basis,
    constant_basis,
    line_basis,
    line_pieces,
    scales,
    spline_basis,
    spline_pieces,
    with_best_step,
)

MAX_LEVERAGE = 1.0 - 1e-6
"""Larger leverages are cut, so that no residual is divided by zero."""
PLACE_COST = 3.0
"""Noise variances by which the place of a jump lowers the sum of squares."""
JUMPED_SPLINE_PIECES = (1, 2, 4)
"""Pieces of the splines on values to which jumps are added."""
MAX_JUMPS = 5
"""Jumps that are added to a spline."""
MAX_STAIR_JUMPS = 15
"""Jumps that are added to a constant or to broken lines."""
STANDARD_ERRORS = 1.5
"""A larger basis is better only by so many standard errors of the paired differences."""


@dataclass(frozen=True, eq=False)
class BasisFit:
    """Least squares of Y in a basis.

    basis:    (N, p) orthonormal columns
    residual: (N,) Y less the fitted mean
    leverage: (N,) diagonal of the projection on the basis
    least_variance: of Y at a given X, if the places of the jumps were known
    variance: of Y at a given X, free of all that the fit has of the noise
    losses:   (N,) squared errors at points left out; their mean judges a basis
    jumps:    number of jumps in the basis whose place was searched
    """

    basis: Array
    residual: Array
    leverage: Array
    least_variance: float
    variance: float
    losses: Array
    jumps: int

    @classmethod
    def of(cls, basis: Array, y: Array, jumps: int = 0) -> BasisFit:
        """Fit y in a basis of which `jumps` columns were searched."""
        count = len(y)
        residual = y - basis @ (basis.T @ y)
        leverage = np.minimum(np.einsum("ij,ij->i", basis, basis), MAX_LEVERAGE)
        least_variance = float(np.mean(residual**2 / (1.0 - leverage)))
        variance = least_variance * (1.0 + PLACE_COST * jumps / count)
        place_loss = 2.0 * PLACE_COST * jumps / count * variance
        losses = (residual / (1.0 - leverage)) ** 2 + place_loss
        return cls(basis, residual, leverage, least_variance, variance, losses, jumps)

    @property
    def score(self) -> float:
        """Mean squared error at points left out."""
        return float(np.mean(self.losses))

    @property
    def size(self) -> int:
        """Number of parameters, searched places included."""
        return self.basis.shape[1] + int(PLACE_COST) * self.jumps


@dataclass(frozen=True, eq=False)
class Choice:
    """The fit that gives the index, and the one with the least error at points left out."""

    chosen: BasisFit
    best: BasisFit


def choose_fit(x: Array, y: Array, named: bool) -> Choice:
    """Choose the fit of y (N,) by one input x (N,); y has the mean 0.

    named: x numbers the values of a choice, which have no order
    """
    if is_classed(x, named):
        fit = BasisFit.of(class_basis(x), y)
        return Choice(fit, fit)
    fits = _candidates(x, y)
    best = min(fits, key=lambda fit: fit.score)
    for fit in sorted(fits, key=lambda fit: (fit.size, fit.score)):
        excess = fit.losses - best.losses
        if excess.mean() <= STANDARD_ERRORS * excess.std() / len(y) ** 0.5:
            return Choice(fit, best)
    return Choice(best, best)


def is_classed(x: Array, named: bool) -> bool:
    """Return whether an input gets a class for each of its values."""
    return named or len(np.unique(x)) <= MAX_CLASSES


def _candidates(x: Array, y: Array) -> list[BasisFit]:
    ordering = Ordering.of(x)
    constant = BasisFit.of(constant_basis(len(y)), y)
    # the constant alone is no candidate: it has no noise, and an index of 0 would have no width
    fits = _with_jumps(constant, y, ordering, MAX_STAIR_JUMPS)
    values, ranks = scales(x)
    for pieces in spline_pieces(x):
        fit = BasisFit.of(spline_basis(values, pieces), y)
        fits += [fit, BasisFit.of(spline_basis(ranks, pieces), y)]
        if pieces in JUMPED_SPLINE_PIECES:
            fits += _with_jumps(fit, y, ordering, MAX_JUMPS)
    for pieces in line_pieces(x):
        fit = BasisFit.of(line_basis(values, pieces), y)
        fits += [fit, *_with_jumps(fit, y, ordering, MAX_STAIR_JUMPS)]
    return fits


def _with_jumps(fit: BasisFit, y: Array, ordering: Ordering, most: int) -> list[BasisFit]:
    """Return fits with 1, 2, … jumps more, as long as each pays for the search of its place."""
    count, fits = len(y), []
    search_cost = max(0.0, 2.0 * (np.log(count) - PLACE_COST) / count)
    for _ in range(most):
        basis = with_best_step(fit.basis, fit.residual, ordering)
        if basis is None:
            break
        larger = BasisFit.of(basis, y, fit.jumps + 1)
        if larger.score + search_cost * larger.variance >= fit.score:
            break
        fits.append(larger)
        fit = larger
    return fits
