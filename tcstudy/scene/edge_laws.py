"""Friction that differs along Γ_C: laws by edge, strengths in x and y, and what acts where two edges meet."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tcstudy.expressions.expression import Expression
from tcstudy.scene.friction import FrictionLaw
from tcstudy.scene.mixtures import total
from tcstudy.scene.nodal_laws import Law, nodal, times

Array = NDArray[np.float64]


class Joints(NamedTuple):
    """The nodes whose cells lie on two edges of Γ_C: where one ends and the next begins.

    node: (j,) which of the nodes, whose own edge is the one after it (along t);  edge: (j,) number of the edge before
    share: (j,) part of c_i on that edge
    """

    node: NDArray[np.intp] = np.zeros(0, dtype=np.intp)
    edge: NDArray[np.integer] = np.zeros(0, dtype=np.intp)
    share: Array = np.zeros(0)


NO_JOINTS = Joints()


@dataclass(frozen=True)
class EdgeLaws:
    """Friction that differs along Γ_C: b(s) of an edge's law times its strength in x and y, 0 where the bond has a gap.

    laws: (edge, law, strength); the edge "" is all of Γ_C
    """

    laws: tuple[tuple[str, FrictionLaw, float | Expression], ...]

    def along(self, names: Sequence[str], edge: NDArray[np.integer], xy: Array) -> tuple[NDArray[np.intp], Array]:
        """(m,) which of the laws a point has, and its strength there; of points at xy (m, 2) on edges by number.

        Raises ValueError for a strength below 0 or one that is no number.
        """
        own = [name for name, _, _ in self.laws]
        index = np.array([own.index(name) if name in own else 0 for name in names], dtype=np.intp)[edge]
        strength = np.empty(len(index))
        for k, (_, _, factor) in enumerate(self.laws):
            x, y = xy[index == k].T
            strength[index == k] = factor.evaluate(x, y) if isinstance(factor, Expression) else factor
        if np.any(wrong := ~((strength >= 0.0) & np.isfinite(strength))):
            k = int(np.argmax(wrong))
            x, y = xy[k]
            raise ValueError(f"the strength of friction is {strength[k]:g} at ({x:g}, {y:g}); it must be 0 or more")
        return index, strength

    def factors(self, names: Sequence[str], edge: NDArray[np.integer], xy: Array, joints: Joints) -> Array:
        """(L, m) the factor of every law in that of a node: its strength, at a joint times its part of c_i.

        NaN where a node has nothing of a law. Arguments and Raises as `along`.
        """
        index, strength = self.along(names, edge, xy)
        found = np.full((len(self.laws), len(index)), np.nan)
        found[index, np.arange(len(index))] = strength
        before, weaker = self.along(names, joints.edge, xy[joints.node])
        for node, k, beta, share in zip(joints.node, before, weaker, joints.share, strict=True):
            own = strength[node]
            if k == index[node]:
                found[k, node] = own + share * (beta - own)
            else:
                found[index[node], node], found[k, node] = (1.0 - share) * own, share * beta
        return found

    @property
    def vanishes(self) -> bool:
        """True if b ≡ 0 everywhere."""
        return all(law.vanishes for _, law, _ in self.laws)


def law_along(
    friction: FrictionLaw | EdgeLaws,
    names: Sequence[str],
    edge: NDArray[np.integer],
    xy: Array,
    joints: Joints = NO_JOINTS,
) -> Law:
    """The law of the contact line, or of points xy (m, 2) on it, which lie on the edges `names` by number (m,).

    Raises ValueError for a strength below 0.
    """
    if isinstance(friction, FrictionLaw):
        return friction
    laws, index, strength = laws_along(friction, names, edge, xy, joints)
    return nodal([law for _, law in laws], index, strength)


def laws_along(
    friction: EdgeLaws, names: Sequence[str], edge: NDArray[np.integer], xy: Array, joints: Joints
) -> tuple[list[tuple[str, FrictionLaw]], NDArray[np.intp], Array]:
    """(edge, law) of the edges and after them of joints, (m,) which of them a node has, and its strength.

    A joint has (c' b' + c'' b'')/c_i of the edges that meet there, whose names its law has both.
    Raises ValueError for a strength below 0.
    """
    factors = friction.factors(names, edge, xy, joints)
    has = ~np.isnan(factors)
    laws, index = [(name, law) for name, law, _ in friction.laws], np.argmax(has, axis=0)
    strength = factors[index, np.arange(len(index))]
    for node in np.flatnonzero(has.sum(axis=0) > 1).tolist():
        meet = np.flatnonzero(has[:, node])
        one, two = (times(laws[k][1], float(factors[k, node])) for k in meet)
        index[node], strength[node] = len(laws), 1.0
        laws.append((" and ".join(laws[k][0] for k in meet), total(one, two)))
    return laws, index, strength
