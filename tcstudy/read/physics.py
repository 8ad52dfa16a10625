"""Reads the sections `material` and `loads`.

The plane problem: plane strain keeps lam and mu, beta = (3 lam + 2 mu) alpha_T, eq. (3);
plane stress has lam → 2 lam mu/(lam + 2 mu), beta = E alpha_T/(1 − nu).

Reads the section `heat`: a known temperature, or conduction with a source in ω and exchange on Γ_θ (eqs. 2, 5).
"""

from __future__ import annotations

import math
from collections.abc import Mapping

from tcstudy.read.body import REGION_SHAPES, read_region
from tcstudy.read.fields import Context, Fields, choose, nearest
from tcstudy.read.node import Node
from tcstudy.scene.records import Body, Heat, Material, Scalar


def read_material(ctx: Context, node: Node) -> Material | None:
    """The material of the plane problem; None after a fault."""
    before = len(ctx.errors)
    fields = Fields(ctx, node, "material")
    E, nu, lam, mu = _elastic(ctx, fields)
    plane = fields.choice("plane")
    k = fields.quantity("k") if fields["k"] else None
    if fields["alpha_T"] and fields["beta"]:
        ctx.errors.once(fields.values["beta"], "both alpha_T and beta are given", "give one of the two")
    alpha_T = fields.quantity("alpha_T", 0.0)
    beta = fields.quantity("beta")
    if len(ctx.errors) > before:
        return None
    if not fields["beta"]:
        beta = (3 * lam + 2 * mu) * alpha_T if plane == "strain" else E * alpha_T / (1 - nu)
    if plane == "stress":
        lam = 2 * lam * mu / (lam + 2 * mu)
    return Material(lam, mu, beta, k, E, nu, plane)


def _elastic(ctx: Context, fields: Fields) -> tuple[float, float, float, float]:
    """E, nu and the three-dimensional Lamé moduli, from either pair; NaN after a fault."""
    engineering, lame = (bool(fields[a] or fields[b]) for a, b in (("E", "nu"), ("lambda", "mu")))
    if engineering and lame:
        odd = next(fields.values[key] for key in ("lambda", "mu") if fields[key])
        ctx.errors.once(odd, "the material is given in two ways", "give either E and nu, or lambda and mu")
        return (math.nan,) * 4
    if not fields.is_mapping:
        return (math.nan,) * 4
    first, second = ("lambda", "mu") if lame else ("E", "nu")
    misspelt = {nearest(key, fields.rows) for key in fields.values if key not in fields.rows}
    for key in (first, second):
        if fields[key] is None and key not in misspelt:
            fields.missing(key)
    return _from_lame(ctx, fields) if lame else _from_engineering(ctx, fields)


def _from_engineering(ctx: Context, fields: Fields) -> tuple[float, float, float, float]:
    E, nu = fields.quantity("E"), fields.quantity("nu")
    if nu >= 0.5 or nu <= -1.0:
        remedy = "write for example 0.3; for a nearly incompressible body stay below 0.5, e.g. 0.49"
        ctx.errors.at(fields.values["nu"], f"must lie between -1 and 0.5, but is {nu:g}", remedy)
        nu = math.nan
    return E, nu, E * nu / ((1 + nu) * (1 - 2 * nu)), E / (2 * (1 + nu))


def _from_lame(ctx: Context, fields: Fields) -> tuple[float, float, float, float]:
    lam, mu = fields.quantity("lambda"), fields.quantity("mu")
    if 3 * lam + 2 * mu <= 0.0:
        remedy = f"3 lambda + 2 mu must be positive: lambda greater than {-2 * mu / 3:g}"
        ctx.errors.at(fields.values["lambda"], f"{lam:g} makes the bulk modulus zero or negative", remedy)
        lam = math.nan
    return mu * (3 * lam + 2 * mu) / (lam + mu), lam / (2 * (lam + mu)), lam, mu


def read_loads(ctx: Context, node: Node | None) -> tuple[Scalar, Scalar] | None:
    """The body force f, zero without the section; None after a fault."""
    if node is None:
        return 0.0, 0.0
    before = len(ctx.errors)
    f = Fields(ctx, node, "loads").vector("f")
    return f if len(ctx.errors) == before else None


INLINE = "omega"
"""Name of the region that `omega` describes in place."""


def read_inline_region(ctx: Context, heat: Node | None, body: Body) -> Body:
    """The body with the region that `heat.omega` describes in place, if it does."""
    node = heat.child("omega") if heat else None
    if node is None or not isinstance(node.value, Mapping):
        return body
    if any(region.name == INLINE for region in body.regions):
        remedy = f"write omega: {INLINE}, or give the region under body.regions another name"
        ctx.errors.at(node, f"the body already has a region {INLINE!r}", remedy)
        return body
    return Body(body.outline, body.holes, (*body.regions, read_region(ctx, node, INLINE)), body.brep)


def read_heat(ctx: Context, node: Node | None, regions: tuple[str, ...] | None) -> Heat | None:
    """The heat problem; zero temperature without the section; None after a fault.

    regions: names of the regions of the body; None if they are not known
    """
    if node is None:
        return Heat()
    before = len(ctx.errors)
    if node.child("theta"):
        fields = Fields(ctx, node, "heat", ("theta",))
        others = [key for key in fields.values if key in fields.rows and key != "theta"]
        if others:
            what = f"theta is the known temperature, so {', '.join(others)} would not be used"
            ctx.errors.once(fields.values["theta"], what, "keep theta alone, or remove it to compute the temperature")
        heat = Heat(theta=fields.field("theta"))
    else:
        fields = Fields(ctx, node, "heat", ("alpha", "theta_bar"))
        alpha = fields.quantity("alpha")
        theta_bar, q = fields.field("theta_bar"), fields.field("q")
        heat = Heat(None, alpha, theta_bar, q, _omega(ctx, fields["omega"], regions))
        if alpha == 0.0 and q != 0.0 and len(ctx.errors) == before:
            remedy = "give alpha > 0, or q: 0"
            what = "with alpha = 0 the heat of q cannot leave the body, so there is no steady state"
            ctx.errors.at(fields.values["alpha"], what, remedy)
    return heat if len(ctx.errors) == before else None


def _omega(ctx: Context, node: Node | None, regions: tuple[str, ...] | None) -> tuple[str, ...]:
    """Names of the regions that make up ω; empty for the whole body."""
    if node is None:
        return ()
    if isinstance(node.value, Mapping):
        if ctx.errors.point and node.path.startswith("sweep"):
            remedy = "describe the regions under body.regions and sweep over their names"
            ctx.errors.at(node, "a shape cannot be swept, because the mesh depends on it", remedy)
        return (INLINE,)
    if not isinstance(node.value, str) and (not isinstance(node.value, tuple) or not node.value):
        remedy = f"write NAME or [NAME, ...], or a shape: {', '.join(REGION_SHAPES)}"
        ctx.errors.at(node, f"must name regions of the body, but is {node.kind()}", remedy)
        return ()
    names = []
    for item in node.value if isinstance(node.value, tuple) else (node,):
        name = ctx.text(item, "the name of a region")
        if name and regions is not None and name not in regions:
            shapes = f"one of {', '.join(REGION_SHAPES)}"
            known = choose(name, regions, "one of") if regions else f"add it under body.regions, or write {shapes} here"
            ctx.errors.at(item, f"the body has no region {name!r}", known)
        if name in names:
            ctx.errors.at(item, f"the region {name!r} is given twice", "name each region once")
        names.append(name)
    return tuple(names)
