"""A random field along a line, as an expression in x and y: the same at every point of every mesh."""

from __future__ import annotations

import math
from functools import reduce

import numpy as np
from numpy.typing import NDArray

from tcstudy.expressions.expression import Expression, Scalar, of_tree, parse
from tcstudy.expressions.tree import TreeNode

KEPT = 1e-8
"""Eigenvalue, of the largest, down to which modes are kept; what is left out has a variance of that order."""
SPACING = 0.5
"""Distance of the points that a field is made of, over its correlation length: covariances then are right to 1e-3."""


def random_field(points: NDArray[np.float64], scatter: float, length: float, seed: int) -> Expression:
    """A lognormal field exp(ζ g − ζ²/2) of mean 1 and coefficient of variation `scatter`, ζ² = ln(1 + scatter²).

    g is Gaussian with mean 0, variance 1 and covariance C(p, q) = exp(−|p − q|²/length²), by its Karhunen–Loève
    expansion on the points (n, 2) [m]: g(p) = Σ_k √λ_k φ_k(p) ζ_k with λ_k, φ_k the eigenpairs of C there and between
    them φ_k(p) = Σ_j C(p, p_j) φ_k(p_j)/λ_k (Nyström). ζ_k = φ_kᵀ w with one w for the seed, so that the field does not
    depend on how eigenvectors are chosen. Literature: Ghanem & Spanos, Stochastic Finite Elements (1991), ch. 2.
    """
    square = ((points[:, None] - points[None]) ** 2).sum(axis=-1)
    values, vectors = np.linalg.eigh(np.exp(-square / length**2))
    kept = values > KEPT * values[-1]
    drawn = vectors[:, kept].T @ np.random.default_rng(seed).standard_normal(len(points))
    weights = vectors[:, kept] @ (drawn / np.sqrt(values[kept]))
    zeta = math.sqrt(math.log1p(scatter**2))
    terms = [TreeNode("Number", value=-0.5 * zeta**2)]
    for (x, y), weight in zip(points.tolist(), (zeta * weights).tolist(), strict=True):
        terms.append(parse(f"{weight!r}*exp(-((x - {x!r})^2 + (y - {y!r})^2)/{length**2!r})".replace("- -", "+ ")).root)
    return of_tree(TreeNode("Call", "exp", (reduce(lambda a, b: TreeNode("Binary", "+", (a, b)), terms),)))


def product(one: Scalar, field: Expression) -> Expression:
    """A number or an expression times a field."""
    factor = one.root if isinstance(one, Expression) else TreeNode("Number", value=one)
    return of_tree(TreeNode("Binary", "*", (factor, field.root)))
