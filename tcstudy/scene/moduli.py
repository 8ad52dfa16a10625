"""A material with another value of one of its numbers, and how fast its moduli change with it.

Of E and ν: μ = E/2(1 + ν); plane strain λ = Eν/((1 + ν)(1 − 2ν)), plane stress λ = Eν/(1 − ν²); β = α_T E/(1 − cν) with
c = 2 and 1 (`Material.bulk`), which changes with E and ν where α_T is given and not β.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

from tcstudy.scene.records import Material


class ModuliSlope(NamedTuple):
    """Derivatives of λ, μ, β and k of a material by one of its numbers."""

    lam: float = 0.0
    mu: float = 0.0
    beta: float = 0.0
    k: float = 0.0


def with_modulus(material: Material, name: str, value: float, heat_grows: bool) -> Material:
    """The material with another E, nu, alpha_T, beta or k; materials of regions stay.

    heat_grows: whether alpha_T is given, so that β follows E and ν
    """
    if name in ("alpha_T", "beta"):
        return replace(material, beta=value * (material.bulk if name == "alpha_T" else 1.0))
    if name == "k":
        return replace(material, k=value)
    if name == "E":
        t = value / material.E
        beta = t * material.beta if heat_grows else material.beta
        return replace(material, E=value, lam=t * material.lam, mu=t * material.mu, beta=beta)
    if name != "nu":
        raise KeyError(name)
    lam = material.E * value / ((1.0 + value) * _second(material, value))
    new = replace(material, nu=value, lam=lam, mu=0.5 * material.E / (1.0 + value))
    return replace(new, beta=material.beta * new.bulk / material.bulk) if heat_grows else new


def moduli_slope(material: Material, name: str, heat_grows: bool) -> ModuliSlope:
    """Derivatives by E, nu, alpha_T, beta or k."""
    E, nu = material.E, material.nu
    if name in ("alpha_T", "beta"):
        return ModuliSlope(beta=material.bulk if name == "alpha_T" else 1.0)
    if name == "k":
        return ModuliSlope(k=1.0)
    if name == "E":
        return ModuliSlope(material.lam / E, material.mu / E, material.beta / E if heat_grows else 0.0)
    if name != "nu":
        raise KeyError(name)
    c = 2.0 if material.plane == "strain" else 1.0
    lam = E * (1.0 + c * nu**2) / ((1.0 + nu) * _second(material, nu)) ** 2
    beta = c * material.beta / (1.0 - c * nu) if heat_grows else 0.0
    return ModuliSlope(lam, -0.5 * E / (1.0 + nu) ** 2, beta)


def _second(material: Material, nu: float) -> float:
    """1 − 2ν in plane strain, 1 − ν in plane stress."""
    return 1.0 - (2.0 if material.plane == "strain" else 1.0) * nu
