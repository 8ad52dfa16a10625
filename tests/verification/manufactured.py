"""A thermoelastic contact problem with a closed-form solution that slips smoothly.

Domain:   unit square, contact on y = 0, convection (and traction) on x = 0 and x = 1, displacement given on y = 1
θ:        θ₀ + a x, linear, so that P1 holds it exactly; θ̄ on the convection edges makes it solve the Robin problem
u:        stress-free thermal displacement plus shift plus (y g(x), 0) with μ g = b(u_T):
          u_x = s₀ + e(θ₀ x + a x²/2 − a y²/2) + y g,  u_y = e(θ₀ + a x) y,  e = β / (2(λ+μ)), plane strain
contact:  u_T(x) = s₀ + e(θ₀ x + a x²/2),  ξ = −S_T = μ g(x) = b(u_T), all on one falling branch of b
loads:    f = −div σ and the tractions follow from σ = λ y g′ I + 2μ ε(y g, 0)
"""

import numpy as np
from numpy.typing import NDArray

from tcstudy.read.study import read_study_text
from tcstudy.scene.study import Study

Array = NDArray[np.float64]

LAM, MU, BETA, K, ALPHA = 1.5, 1.0, 0.8, 2.0, 3.0
THETA_0, A, SHIFT = 0.6, 0.9, 0.1
TAU_S, TAU_K, DELTA = 1.0, 0.3, 1.2
EXPANSION = BETA / (2 * (LAM + MU))
FALL = (TAU_S - TAU_K) / DELTA


def slip(x: Array) -> Array:
    return SHIFT + EXPANSION * (THETA_0 * x + A * x**2 / 2)


def friction(x: Array) -> Array:
    """ξ(x) = b(u_T(x)) on the falling branch."""
    return TAU_S - FALL * slip(x)


def _g(x: Array) -> tuple[Array, Array, float]:
    """g, g′, g″."""
    return friction(x) / MU, -FALL / MU * EXPANSION * (THETA_0 + A * x), -FALL / MU * EXPANSION * A


def u_x(x: Array, y: Array) -> Array:
    return slip(x) - EXPANSION * A * y**2 / 2 + y * _g(x)[0]


def u_y(x: Array, y: Array) -> Array:
    return EXPANSION * (THETA_0 + A * x) * y


def grad_u_x(x: Array, y: Array) -> Array:
    g, dg, _ = _g(x)
    return np.array([EXPANSION * (THETA_0 + A * x) + y * dg, -EXPANSION * A * y + g])


def grad_u_y(x: Array, y: Array) -> Array:
    return np.array([EXPANSION * A * y, EXPANSION * (THETA_0 + A * x)])


def manufactured_study(levels: int, maxh: float = 0.25, **more: str) -> Study:
    e, a, t0 = EXPANSION, A, THETA_0
    s = f"({SHIFT} + {e}*({t0}*x + {a}*x^2/2))"
    g = f"(({TAU_S} - {FALL}*{s})/{MU})"
    dg = f"(-{FALL / MU * e}*({t0} + {a}*x))"
    ddg = -FALL / MU * e * a
    sxx, sxy = f"({LAM + 2 * MU}*y*{dg})", f"({MU}*{g})"
    return read_study_text(f"""
units: none
body: {{rectangle: {{width: 1, height: 1}}}}
boundary:
  bottom: contact
  right: {{role: convection, g: ["{sxx}", "{sxy}"]}}
  left: {{role: convection, g: ["-{sxx}", "-{sxy}"]}}
  top: {{role: clamped, u: ["{s} - {e * a / 2}*y^2 + y*{g}", "{e}*({t0} + {a}*x)*y"]}}
material: {{lambda: {LAM}, mu: {MU}, beta: {BETA}, k: {K}}}
loads: {{f: ["-{LAM + 2 * MU}*y*({ddg})", "-({LAM + MU})*{dg}"]}}
heat: {{alpha: {ALPHA}, theta_bar: "{t0} + {a}*x + {K * a / ALPHA}*(2*x - 1)"}}
friction: {{law: slip-weakening, tau_s: {TAU_S}, tau_k: {TAU_K}, delta: {DELTA}}}
mesh: {{maxh: {maxh}, levels: {levels}}}
""")
