"""The laws of all contact unknowns of a scene: those of the slips, then those of the openings.

An opening s_N = −u_N has the law b_N of its edge: that of `adhesion`, or none but s_N ≥ 0. Joints
of two edges have the laws of both by their shares of c, as slips have.
"""

from __future__ import annotations

import numpy as np

from tcstudy.fem.forms import ContactLine
from tcstudy.fem.openings import OpeningLine
from tcstudy.laws.composed import law_along
from tcstudy.laws.laws import Laws
from tcstudy.scene.records import Scene


def laws_of_unknowns(scene: Scene, line: ContactLine, opening: OpeningLine) -> Laws:
    """Return the laws of the slips and then of the openings, by unknown.

    Raises ValueError for a strength below 0.
    """
    names = line.edge_names
    slips = law_along(scene.bond_friction, names, line.edge, line.xy, line.joints)
    openings = law_along(scene.opening_laws, names, opening.edge, opening.xy, opening.joints)
    of_slip = slips.node_index(line.m)
    of_opening = len(slips.laws) + openings.node_index(opening.m)
    return Laws.of([*slips.laws, *openings.laws], np.concatenate([of_slip, of_opening]))
