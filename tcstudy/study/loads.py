"""A scene's load as a sum of basis loads, so that a sweep condenses each basis load once (method §4).

l_θ is affine in f, g, p, q, θ̄ and β: every number of the scene becomes a coefficient, and only what changes the
shape of a load (an expression, α, k, a region) becomes a new basis load.
"""

from __future__ import annotations

from collections.abc import Hashable, Iterator
from dataclasses import dataclass, replace

from tcstudy.fem.elasticity import loads_something
from tcstudy.scene.expressions import Expression
from tcstudy.scene.records import Convection, Role, Scalar, Traction


@dataclass(frozen=True)
class Term:
    """coefficient × the basis load named by key."""

    key: Hashable
    coefficient: float


def split(scalar: Scalar) -> tuple[Scalar, float]:
    """A scalar as (shape, factor): numbers become factors of the unit shape 1."""
    if isinstance(scalar, Expression):
        return scalar, 1.0
    return 1.0, float(scalar)


def mechanical_terms(f: tuple[Scalar, Scalar], boundary: tuple[tuple[str, Role], ...]) -> Iterator[Term]:
    """Terms of ∫f·v and of the tractions and pressures on all edges."""
    for axis, component in enumerate(f):
        shape, factor = split(component)
        if factor != 0.0:
            yield Term(("f", axis, shape), factor)
    for name, role in boundary:
        if not loads_something(role):
            continue
        assert isinstance(role, Traction | Convection)
        for part, scalar in (("gx", role.g[0]), ("gy", role.g[1]), ("p", role.pressure)):
            shape, factor = split(scalar)
            if factor != 0.0:
                yield Term((part, name, shape), factor)


def traction_of(part: str, shape: Scalar) -> Traction:
    """The traction record of one basis load of an edge."""
    unit = Traction()
    if part == "p":
        return replace(unit, pressure=shape)
    return replace(unit, g=(shape, 0.0) if part == "gx" else (0.0, shape))
