"""A ring whose loads are derived from a chosen solution that slips on a weakening film, heated.

Sector 1/2 < r < 1, contact on the arc r = 1 (insulated), convection and traction on r = 1/2, the straight ends
clamped and insulated. With s = 0.3 + 0.1 xy/r², w = (τ_s − τ_k)/δ and μ = 1
    u_φ = s (1 + (1 + w)(r − 1)) − τ_s (r − 1),   u_r = 0.2 (r − 1) x,   θ = 1 + r²/2 − log r:
u_r(1) = 0, −S_T = −μ(u_φ,r − u_φ) = τ_s − w s = b(u_T) with u_T = s, ∂θ/∂r(1) = 0
"""

from __future__ import annotations

import math

from tcstudy.read.study import read_study_text
from tcstudy.scene.study import Study

TAU_S, TAU_K, DELTA = 1.0, 0.4, 1.0
FALL = (TAU_S - TAU_K) / DELTA
REST = f"""
units: none
material: {{lambda: 1.5, mu: 1, beta: 0.5, k: 2}}
heat: {{alpha: 3}}
friction: {{law: slip-weakening, tau_s: {TAU_S}, tau_k: {TAU_K}, delta: {DELTA}}}
"""


def ring(levels: int, maxh: float = 0.25) -> Study:
    """The ring sector from 10° to 80°."""
    first, last = math.radians(10), math.radians(80)

    def at(radius: float, angle: float) -> str:
        return f"[{radius * math.cos(angle)!r}, {radius * math.sin(angle)!r}]"

    middle = (first + last) / 2
    r = "sqrt(x^2 + y^2)"
    along = f"((0.3 + 0.1*x*y/(x^2 + y^2))*(1 + {1 + FALL}*({r} - 1)) - {TAU_S}*({r} - 1))"
    out = f"(0.2*({r} - 1)*x)"
    return read_study_text(f"""{REST}
body:
  outline:
    - {{from: {at(0.5, first)}, edge: start}}
    - {{from: {at(1, first)}, edge: arc, through: {at(1, middle)}}}
    - {{from: {at(1, last)}, edge: end}}
    - {{from: {at(0.5, last)}, edge: inner, through: {at(0.5, middle)}}}
boundary: {{arc: contact, start: clamped, end: clamped, inner: convection}}
mesh: {{maxh: {maxh}, levels: {levels}}}
exact:
  u: ["({out}*x - {along}*y)/{r}", "({out}*y + {along}*x)/{r}"]
  theta: "1 + (x^2 + y^2)/2 - log(x^2 + y^2)/2"
  loads: derived
""")
