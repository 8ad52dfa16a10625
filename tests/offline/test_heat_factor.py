"""Heat on thin triangles: the refined temperature against a dense solve in extended precision."""

from __future__ import annotations

import numpy as np
import pytest

from tcstudy.data.schema import HEAT_BOUND
from tcstudy.fem.geometry import build
from tcstudy.offline import conduction as heat_factor
from tcstudy.offline.level import Level
from tcstudy.scene.records import Scene
from tests.benchmarks.stability_chain import layered
from tests.verification.scenes import study_of

SLIVERS = """
units: none
body: {rectangle: {width: WIDTH, height: 1}}
boundary: {bottom: contact, left: clamped, right: convection, top: free}
material: {E: 1, nu: 0.3, k: 1, alpha_T: 0.05}
heat: {alpha: 1, theta_bar: 0.3, q: "1 + x/WIDTH"}
friction: {law: tresca, tau: 1}
mesh: {maxh: 0.15, levels: 1}
"""
Extended = np.longdouble
needs_extended = pytest.mark.skipif(
    bool(np.finfo(Extended).eps >= np.finfo(float).eps), reason="no extended precision on this machine"
)


def sliver_level(width: float, thinner: float, *overrides: str) -> tuple[Scene, Level]:
    """A block of this width; its lowest layer of obtuse triangles is `thinner` times as thin as the others."""
    scene = study_of(SLIVERS.replace("WIDTH", repr(width)), *overrides).scenes[0]
    return scene, Level(layered(build(scene.body), width, thinner), scene)


def conduction(level: Level) -> np.ndarray:
    """∫∇φ_i·∇φ_j from the coordinates, dense and in extended precision; rows sum to zero."""
    points = level.mesh.points.astype(Extended)
    K = np.zeros((len(points), len(points)), dtype=Extended)
    for t in level.mesh.triangles:
        p = points[t]
        side = np.roll(p, -2, axis=0) - np.roll(p, -1, axis=0)  # opposite to each corner
        twice = side[0, 0] * side[1, 1] - side[0, 1] * side[1, 0]
        K[np.ix_(t, t)] += side @ side.T / (2 * twice)
    np.fill_diagonal(K, 0)
    np.fill_diagonal(K, -K.sum(axis=1))
    return K


def solved(A: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Cholesky in the precision of A (LAPACK knows no extended one)."""
    L, x = A.copy(), b.copy()
    for k in range(len(L)):
        L[k, k] = np.sqrt(L[k, k])
        L[k + 1 :, k] /= L[k, k]
        L[k + 1 :, k + 1 :] -= np.outer(L[k + 1 :, k], L[k + 1 :, k])
    for k in range(len(L)):
        x[k] = (x[k] - L[k, :k] @ x[:k]) / L[k, k]
    for k in reversed(range(len(L))):
        x[k] = (x[k] - L[k + 1 :, k] @ x[k + 1 :]) / L[k, k]
    return x


def reference(scene: Scene, level: Level) -> np.ndarray:
    """θ from the whole system kK + αM in extended precision, refined with a residual that conserves heat."""
    K, forms, robin = conduction(level), level.heat, level.heat.kept_nodes
    M = forms.robin_mass.astype(Extended)
    b = forms.source(scene.heat.q, scene.heat.omega).astype(Extended)
    b[robin] += Extended(scene.heat.alpha) * forms.surroundings(scene.heat.theta_bar)
    A = K.copy()
    A[np.ix_(robin, robin)] += Extended(scene.heat.alpha) * M
    theta = solved(A, b)
    for _ in range(2):
        rest = b - (K * (theta[None, :] - theta[:, None])).sum(axis=1)
        rest[robin] -= Extended(scene.heat.alpha) * (M @ theta[robin])
        theta = theta + solved(A, rest)
    return theta


def error(scene: Scene, level: Level) -> float:
    exact = reference(scene, level)
    return float(np.max(np.abs(level.temperature(scene).theta - exact)) / np.max(np.abs(exact)))


@needs_extended
@pytest.mark.parametrize(
    ("width", "thinner", "reached"), [(30.0, 1e4, 1e-12), (30.0, 1e6, 1e-10), (1000.0, 1e6, 1e-10)]
)
def test_refinement_gives_slivers_their_digits_back(
    monkeypatch: pytest.MonkeyPatch, width: float, thinner: float, reached: float
) -> None:
    """The error drops by two orders at least and heat balances to rounding; unrefined, both are rounding × condition.

    What remains depends on the order in which a BLAS kernel adds up. On Haswell, Zen, Sandybridge, Nehalem and
    Prescott the errors were up to 1.2e-13, 3.2e-11 and 3.2e-11, the balances up to 1e-14.
    """
    scene, level = sliver_level(width, thinner)
    balance, off = level.temperature(scene).heat_balance, error(scene, level)
    assert off < reached
    assert balance < 1e-13
    monkeypatch.setattr(heat_factor, "UNSOUND", np.inf)
    scene, plain = sliver_level(width, thinner)
    assert plain.temperature(scene).heat_balance > 1e2 * max(balance, 1e-14)
    assert error(scene, plain) > 1e2 * off
    assert plain.temperature(scene).heat_balance > HEAT_BOUND > balance


@pytest.mark.parametrize("scale", [1e-9, 1.0, 1e9])
def test_the_balance_is_relative_to_the_heat_that_moves(scale: float) -> None:
    """Sources and sinks that cancel, and little heat beside what uneven surroundings drive through the body."""
    cancelling = sliver_level(2.0, 1.0, f'heat.q="{scale}*(x - 1)"')
    assert cancelling[1].temperature(cancelling[0]).heat_balance < 1e-13
    little = sliver_level(2.0, 1.0, f"heat.q={1e-12 * scale}", f'heat.theta_bar="{scale}*y"', "heat.alpha=1e6")
    assert little[1].temperature(little[0]).heat_balance < 1e-13
