"""Studies whose loads are derived from a chosen solution that slips on a weakening film, heated.

Ring:    sector 1/2 < r < 1, contact on the arc r = 1 (insulated), convection and traction on r = 1/2, the straight ends
         clamped and insulated. With s = 0.3 + 0.1 xy/r², w = (τ_s − τ_k)/δ and μ = 1
             u_φ = s (1 + (1 + w)(r − 1)) − τ_s (r − 1),   u_r = 0.2 (r − 1) x,   θ = 1 + r²/2 − log r:
         u_r(1) = 0, −S_T = −μ(u_φ,r − u_φ) = τ_s − w s = b(u_T) with u_T = s, ∂θ/∂r(1) = 0
Block:   unit square, turned by an angle, contact on its base: with X, Y along and across the base
             u_X = s + (τ_s − w s) Y/μ,  s = 0.3 + 0.2 sin πX,   u_Y = Y cos(πX)/10,   θ = 1 + X (1 + cos(πY)/2)
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


def block(levels: int, degrees: float = 0.0, maxh: float = 0.25) -> Study:
    """The turned block."""
    c, s = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    X, Y = f"({c!r}*x + {s!r}*y)", f"({c!r}*y - {s!r}*x)"
    slip = f"(0.3 + 0.2*sin(pi*{X}))"
    u, v = f"({slip} + ({TAU_S} - {FALL}*{slip})*{Y})", f"(0.1*{Y}*cos(pi*{X}))"
    corners = [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)]
    outline = ", ".join(
        f"{{from: [{c * a - s * b!r}, {s * a + c * b!r}], edge: {name}}}"
        for (a, b), name in zip(corners, ("base", "right", "top", "left"), strict=True)
    )
    return read_study_text(f"""{REST}
body: {{outline: [{outline}]}}
boundary: {{base: contact, right: convection, top: clamped, left: convection}}
mesh: {{maxh: {maxh}, levels: {levels}}}
exact:
  u: ["{c!r}*{u} - {s!r}*{v}", "{s!r}*{u} + {c!r}*{v}"]
  theta: "1 + {X}*(1 + 0.5*cos(pi*{Y}))"
  loads: derived
""")
