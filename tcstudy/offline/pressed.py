"""The friction of a scene that acts only where its edge is pressed, by node.

A node shared by two edges has the friction of both, each by its share of c; its pressure is that of
the edge that opens.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from tcstudy.contact.pressure_friction import PressureFriction
from tcstudy.laws.composed import nodal
from tcstudy.laws.shapes import knows_pressure
from tcstudy.scene.records import Scene

if TYPE_CHECKING:
    from tcstudy.fem.forms import ContactLine
    from tcstudy.fem.openings import OpeningLine


def pressure_friction(
    scene: Scene, line: ContactLine, opening: OpeningLine
) -> PressureFriction | None:
    """Return the friction that the pressure decides, with its rows; None without any.

    Raises ValueError for a strength below 0.
    """
    pressed = scene.pressed_friction
    if pressed is None:
        return None
    factors = pressed.factors(line.edge_names, line.edge, line.xy, line.joints)
    _, slips, openings = np.intersect1d(line.nodes, opening.nodes, return_indices=True)
    factors = factors[:, slips]
    laws = [law for _, law, _ in pressed.laws]
    acts = np.array([not law.vanishes for law in laws])
    is_coulomb = np.array([knows_pressure(law) for law in laws])
    number, node = np.nonzero(acts[:, None] & (factors > 0.0))
    node_laws = nodal(laws, number, factors[number, node])
    slip_rows = slips[node]
    opening_rows = line.m + openings[node]
    origin = np.zeros(len(node))
    return PressureFriction(slip_rows, opening_rows, node_laws, is_coulomb[number], origin)
