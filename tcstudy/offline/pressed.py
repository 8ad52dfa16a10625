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
    acts = np.array([not law.vanishes for _, law, _ in pressed.laws])
    has_law = acts[:, None] & (factors[:, slips] > 0.0)
    law_number, node = np.nonzero(has_law)
    laws = [law for _, law, _ in pressed.laws]
    is_coulomb = np.array([knows_pressure(law) for law in laws])
    return PressureFriction(
        slip=slips[node],
        opening=line.m + openings[node],
        laws=nodal(laws, law_number, factors[law_number, slips[node]]),
        coulomb=is_coulomb[law_number],
        origin=np.zeros(len(node)),
    )
