"""Reads the sections `material` and `loads`.

The plane problem: plane strain keeps lam and mu, beta = (3 lam + 2 mu) alpha_T, eq. (3);
plane stress has lam → 2 lam mu/(lam + 2 mu), beta = E alpha_T/(1 − nu).
"""

from __future__ import annotations

import math
from typing import Literal

from tcstudy.scene import walker
from tcstudy.scene.fields import Fields
from tcstudy.scene.node import Node
from tcstudy.scene.records import Material, Scalar
from tcstudy.scene.units import BODY_FORCE, CONDUCTIVITY, EXPANSION, NONE, THERMAL_STRESS, TRACTION
from tcstudy.scene.walker import Context

KEYS = ("E", "nu", "lambda", "mu", "plane", "k", "alpha_T", "beta")
PLANES: tuple[Literal["strain", "stress"], ...] = ("strain", "stress")


def read_material(ctx: Context, node: Node) -> Material | None:
    """The material of the plane problem; None after a fault."""
    before = len(ctx.errors)
    fields = Fields(ctx, node, (), KEYS)
    E, nu, lam, mu = _elastic(ctx, fields)
    plane: Literal["strain", "stress"] = "strain"
    if value := fields["plane"]:
        plane = walker.choice(ctx, value, PLANES)
    k = fields.quantity("k", CONDUCTIVITY, "positive") if fields["k"] else None
    if fields["alpha_T"] and fields["beta"]:
        ctx.errors.once(fields.values["beta"], "both alpha_T and beta are given", "give one of the two")
    alpha_T = fields.quantity("alpha_T", EXPANSION, default=0.0)
    beta = fields.quantity("beta", THERMAL_STRESS, default=math.nan)
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
    misspelt = {walker.nearest(key, KEYS) for key in fields.values if key not in KEYS}
    for key in (first, second):
        if fields[key] is None and key not in misspelt:
            fields.missing(key)
    return _from_lame(ctx, fields) if lame else _from_engineering(ctx, fields)


def _from_engineering(ctx: Context, fields: Fields) -> tuple[float, float, float, float]:
    E, nu = fields.quantity("E", TRACTION, "positive"), fields.quantity("nu", NONE)
    if nu >= 0.5 or nu <= -1.0:
        remedy = "write for example 0.3; for a nearly incompressible body stay below 0.5, e.g. 0.49"
        ctx.errors.at(fields.values["nu"], f"must lie between -1 and 0.5, but is {nu:g}", remedy)
        nu = math.nan
    return E, nu, E * nu / ((1 + nu) * (1 - 2 * nu)), E / (2 * (1 + nu))


def _from_lame(ctx: Context, fields: Fields) -> tuple[float, float, float, float]:
    lam, mu = fields.quantity("lambda", TRACTION), fields.quantity("mu", TRACTION, "positive")
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
    f = Fields(ctx, node, ("f",)).vector("f", BODY_FORCE)
    return f if len(ctx.errors) == before else None
