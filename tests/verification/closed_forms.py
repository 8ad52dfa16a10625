"""Studies with exact solutions: stick–slip with its singularity, a curved contact line, nearly
incompressible bodies.

Stick–slip:  (0,1)×(0,½), f = 0, displacement given on all sides but the contact y = 0. With r, φ about (a, 0) and
             κ = (λ+3μ)/(λ+μ) the field u = C r^{3/2}/(2μ) · (p cos 3φ/2 + q cos φ/2 cos φ − p sin
             φ/2 sin φ,
             −p sin 3φ/2 + q cos φ/2 sin φ + p sin φ/2 cos φ), p = κ + 3/2, q = κ − 3/2, solves the
             elastic equations
             with u_N = 0 on y = 0, S_T = 0 for x > a and u_T = 0 for x < a (Williams' term of
             exponent 3/2).
             A uniform shear τ y/μ is added: slip u_T = Cκ r^{3/2}/μ > 0 with ξ = τ, stick with
             ξ = τ − 3/2 (κ+1) C r^{1/2} ≥ −τ
Curved:      a ring sector 1/2 < r < 1 that turns in itself, u = (A + B/r²)(−y, x), f = 0, contact on the arc r = 1:
             u_T = A + B, ξ = 2μB
Heated:      that sector, its loads derived: contact on r = 1 (insulated), convection and traction on r = 1/2, the ends
             insulated; with s = 0.3 + 0.1 xy/r², w = (τ_s − τ_k)/δ and μ = 1
             u_φ = s (1 + (1 + w)(r − 1)) − τ_s (r − 1), u_r = 0.2 (r − 1) x, θ = 1 + r²/2 − log r:
             u_r(1) = 0,
             −S_T = −μ(u_φ,r − u_φ) = τ_s − w s = b(u_T) with u_T = s, ∂θ/∂r(1) = 0
Locking:     unit square, u = curl of sin(πx)(y + k y²/2μ), div u = 0 for all λ, ξ = k u_T
"""

import math

from tcstudy.read.study import read_study_text
from tcstudy.scene.study import Study

LAM, MU = 1.5, 1.0
KAPPA = (LAM + 3 * MU) / (LAM + MU)
TAU, CHANGE, C = 0.5, 1 / 3, 0.2


def stick_slip(levels: int, degrees: float = 0.0, maxh: float = 0.25) -> Study:
    c, s = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    X, Y = f"({c!r}*x + {s!r}*y - {CHANGE})", f"({c!r}*y - {s!r}*x)"
    phi, r = (
        f"atan2(abs({Y}), {X})",
        f"({X}^2 + {Y}^2)^0.75",
    )  # abs: Y may round to −0, where φ would jump
    p, q = KAPPA + 1.5, KAPPA - 1.5
    half = f"({phi}/2)"
    u = (
        f"({TAU / MU}*{Y} + {C / (2 * MU)}*{r}*({p}*cos(3*{half}) + {q}*cos({half})*cos({phi})"
        f" - {p}*sin({half})*sin({phi})))"
    )
    v = f"({C / (2 * MU)}*{r}*({q}*cos({half})*sin({phi}) + {p}*sin({half})*cos({phi}) - {p}*sin(3*{half})))"
    exact = f'["{c!r}*{u} - {s!r}*{v}", "{s!r}*{u} + {c!r}*{v}"]'
    corners = [(0.0, 0.0), (1.0, 0.0), (1.0, 0.5), (0.0, 0.5)]
    names = ("base", "right", "top", "left")
    outline = ", ".join(
        f"{{from: [{c * a - s * b!r}, {s * a + c * b!r}], edge: {name}}}"
        for (a, b), name in zip(corners, names, strict=True)
    )
    held = ", ".join(f"{name}: {{role: clamped, u: {exact}}}" for name in names[1:])
    return read_study_text(f"""
units: none
body: {{outline: [{outline}]}}
boundary: {{base: contact, {held}}}
material: {{lambda: {LAM}, mu: {MU}}}
friction: {{law: tresca, tau: {TAU}}}
mesh: {{maxh: {maxh}, levels: {levels}}}
exact: {{u: {exact}, xi: "{TAU} - {1.5 * (KAPPA + 1) * C}*sqrt(max(0, -{X}))", exponent: 1.5}}
""")


def sector() -> str:
    """The outline of the ring sector from 10° to 80°."""
    first, last = math.radians(10), math.radians(80)

    def at(radius: float, angle: float) -> str:
        return f"[{radius * math.cos(angle)!r}, {radius * math.sin(angle)!r}]"

    middle = (first + last) / 2
    return f"""
units: none
body:
  outline:
    - {{from: {at(0.5, first)}, edge: start}}
    - {{from: {at(1, first)}, edge: arc, through: {at(1, middle)}}}
    - {{from: {at(1, last)}, edge: end}}
    - {{from: {at(0.5, last)}, edge: inner, through: {at(0.5, middle)}}}
"""


A, B = 0.1, 0.3


def ring(levels: int, exact: bool = True) -> Study:
    u = f'["-({A} + {B}/(x^2 + y^2))*y", "({A} + {B}/(x^2 + y^2))*x"]'
    return read_study_text(f"""{sector()}
boundary: {{arc: contact, {", ".join(f"{name}: {{role: clamped, u: {u}}}" for name in ("start", "end", "inner"))}}}
material: {{lambda: {LAM}, mu: {MU}}}
friction: {{law: tresca, tau: {2 * MU * B}}}
mesh: {{maxh: 0.25, levels: {levels}}}
{f"exact: {{u: {u}}}" if exact else ""}
""")


TAU_S, TAU_K, DELTA = 1.0, 0.4, 1.0
FALL = (TAU_S - TAU_K) / DELTA


def heated_ring(levels: int) -> Study:
    r = "sqrt(x^2 + y^2)"
    along = f"((0.3 + 0.1*x*y/(x^2 + y^2))*(1 + {1 + FALL}*({r} - 1)) - {TAU_S}*({r} - 1))"
    out = f"(0.2*({r} - 1)*x)"
    return read_study_text(f"""{sector()}
material: {{lambda: {LAM}, mu: {MU}, beta: 0.5, k: 2}}
heat: {{alpha: 3}}
friction: {{law: slip-weakening, tau_s: {TAU_S}, tau_k: {TAU_K}, delta: {DELTA}}}
boundary: {{arc: contact, start: clamped, end: clamped, inner: convection}}
mesh: {{maxh: 0.25, levels: {levels}}}
exact:
  u: ["({out}*x - {along}*y)/{r}", "({out}*y + {along}*x)/{r}"]
  theta: "1 + (x^2 + y^2)/2 - log(x^2 + y^2)/2"
  loads: derived
""")


SPRING = 0.8


def incompressible(levels: int, poissons: tuple[float, ...], maxh: float = 0.25) -> Study:
    """The divergence-free solution for several ν (μ = 1); loads do not depend on ν."""
    y, dy = f"(y + {SPRING / 2}*y^2)", f"(1 + {SPRING}*y)"
    u = f'["sin(pi*x)*{dy}", "-pi*cos(pi*x)*{y}"]'
    f = f'["pi^2*sin(pi*x)*{dy}", "pi*cos(pi*x)*({SPRING} - pi^2*{y})"]'
    lam = ", ".join(repr(2 * nu / (1 - 2 * nu)) for nu in poissons)
    return read_study_text(f"""
units: none
body: {{rectangle: {{width: 1, height: 1}}}}
boundary: {{bottom: contact, {", ".join(f"{name}: {{role: clamped, u: {u}}}" for name in ("left", "right", "top"))}}}
material: {{lambda: 1, mu: 1}}
loads: {{f: {f}}}
friction: {{law: linear, k: {SPRING}}}
mesh: {{maxh: {maxh}, levels: {levels}}}
sweep: {{lambda: [{lam}]}}
exact: {{u: {u}}}
""")
