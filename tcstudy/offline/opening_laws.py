"""The laws of all contact unknowns of a scene: those of the slips, then those of the openings.

An opening s_N = −u_N has the law b_N of its edge: that of `adhesion`, or none but s_N ≥ 0. Joints
of two edges have the laws of both by their shares of c, as slips have.
"""

from __future__ import annotations

import numpy as np

from tcstudy.expressions.expression import Scalar
from tcstudy.fem.forms import ContactLine
from tcstudy.fem.openings import OpeningLine
from tcstudy.laws.composed import EdgeLaws, law_along
from tcstudy.laws.laws import Laws
from tcstudy.laws.shapes import unilateral
from tcstudy.scene.records import Scene

EdgeLaw = tuple[str, Laws, Scalar]
"""An edge, a law, and its strength."""


def laws_of_openings(scene: Scene) -> EdgeLaws:
    """Return the law of the opening of every edge that may lift off, with its strength."""
    adhesion = scene.adhesion
    edge_laws: tuple[EdgeLaw, ...] = ()
    if isinstance(adhesion, EdgeLaws):
        edge_laws = adhesion.laws
    elif adhesion is not None:
        edge_laws = (("", adhesion, 1.0),)
    of_edge = {name: (law, strength) for name, law, strength in edge_laws}
    laws = list[EdgeLaw]()
    for name in scene.opening_edges:
        law: Laws = unilateral()
        strength: Scalar = 1.0
        if name in scene.adhesive_edges:
            law, strength = of_edge.get(name) or of_edge[""]
        laws.append((name, law, strength))
    return EdgeLaws(tuple(laws))


def laws_of_unknowns(scene: Scene, line: ContactLine, opening: OpeningLine) -> Laws:
    """Return the laws of the slips and then of the openings, by unknown.

    Raises ValueError for a strength below 0.
    """
    names = line.edge_names
    slips = law_along(scene.bond_friction, names, line.edge, line.xy, line.joints)
    adhesion = laws_of_openings(scene)
    openings = law_along(adhesion, names, opening.edge, opening.xy, opening.joints)
    of_slip = slips.node_index(line.m)
    of_opening = len(slips.laws) + openings.node_index(opening.m)
    return Laws.of([*slips.laws, *openings.laws], np.concatenate([of_slip, of_opening]))
