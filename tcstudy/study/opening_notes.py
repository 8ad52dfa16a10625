"""What a mesh needs where bonds open: elements over an arm in bending, and in its cohesive zone.

The errors are measured: of the end of a clamped arm of P1 triangles, and of the force at a growing
crack in a double cantilever beam, whose cohesive zone has a closed form.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tcstudy.laws.composed import EdgeLaws
from tcstudy.laws.laws import Laws
from tcstudy.scene.records import Clamped, Contact, Material, Scene
from tcstudy.shapes.rigid_motions import BoundaryPiece
from tcstudy.shapes.thickness import reach, thickness

Array = NDArray[np.float64]

CELLS_IN_ZONE = 5.0
"""Elements in the cohesive zone from which on the force at a growing crack is smooth to 0.5 %."""
ZONE_CELLS, WIGGLES = (1.8, 2.6, 5.0), (5.0, 2.0, 0.5)
"""Elements in the cohesive zone, and how far the force of a growing crack goes up and down [%]."""
CELLS_OVER_ARM = 12.0
"""Elements over the thickness of an arm from which on it is too stiff by little more than 1 %."""
STIFFENING = 180.0
"""Excess of the bending stiffness of n elements over the thickness, times n² [%].

It is 2.8 % at 8, 1.2 % at 12 and 0.7 % at 16, of Netgen's triangles.
"""
SLENDER = 4.0
"""Length over thickness from which on a body above a bond that opens is an arm in bending."""
PLACES = 8
"""Places on every segment of an edge at which the thickness is measured."""
ZONE_OF_ARM = 0.74
"""Length of the zone in which a bond under an arm softens, over (E′H³/12ω)^(1/4)."""


@dataclass(frozen=True)
class Arm:
    """The body above the edges that may move along their normals.

    thickness: median distance from the edge straight through the body [m]
    length:    extent of the body along the edge [m]
    is_backed: whether a clamped or rigid edge lies opposite
    """

    thickness: float
    length: float
    is_backed: bool = False

    @property
    def bends(self) -> bool:
        """Whether it is slender enough to bend, and nothing opposite prevents that."""
        return self.length >= SLENDER * self.thickness and not self.is_backed

    @property
    def least_element(self) -> float:
        """The size of elements of which enough lie over the thickness [m]."""
        return self.thickness / CELLS_OVER_ARM

    def stiffening(self, element: float) -> float:
        """Return by how much elements of a size make bending too stiff [%]."""
        return STIFFENING * (element / self.thickness) ** 2


def arm_of(scene: Scene, pieces: Sequence[BoundaryPiece]) -> Arm | None:
    """Return the thinnest part of the body above an edge that may leave the foundation.

    None if contact is bilateral.
    """
    boundary = [piece.points for piece in pieces]
    clamped = [piece.points for piece in pieces if piece.name in scene.edges(Clamped)]
    corners = np.concatenate(boundary)
    contact = [(name, role) for name, role in scene.boundary if isinstance(role, Contact)]
    moving = {name for name, role in contact if role.normal != "held"}
    arms = list[Arm]()
    for piece in pieces:
        if piece.name not in moving:
            continue
        points = _within(piece.points)
        normals = _within(piece.normals)
        normals = normals / np.linalg.norm(normals, axis=1, keepdims=True)
        distances = thickness(points, normals, boundary)
        n_x, n_y = normals[len(normals) // 2]
        length = float(np.ptp(corners @ np.array([-n_y, n_x])))
        to_clamped = reach(points, normals, clamped) if clamped else np.full(len(points), np.inf)
        is_backed = bool(np.mean(to_clamped < 1.001 * distances) > 0.5)
        arms.append(Arm(float(np.median(distances)), length, is_backed))
    return min(arms, key=lambda arm: arm.thickness, default=None)


def _within(ends: Array) -> Array:
    """Return values at places within every segment, linear between those at its ends (k, 2)."""
    shares = (np.arange(PLACES) + 0.5) / PLACES
    steps = np.diff(ends, axis=0)[:, None, :]
    return (ends[:-1, None, :] + shares[:, None] * steps).reshape(-1, 2)


def cohesive_zone(scene: Scene, arm: Arm) -> float:
    """Return the length in which the laws of an opening soften, ∞ where none does gradually [m].

    Under an arm that bends it is 0.74 (E′H³/12ω)^(1/4), the zone of the beam on a bilinear
    foundation of a softening slope ω to within 3 %; else E′/2ω, which is E′G/σ² of a law that
    softens at once.
    """
    adhesion = scene.adhesion
    laws: list[Laws] = []
    if isinstance(adhesion, EdgeLaws):
        laws = [law for _, law, _ in adhesion.laws]
    elif adhesion is not None:
        laws = [adhesion]
    zone = math.inf
    for law in laws:
        if not 0.0 < law.omega < math.inf:
            continue
        for material in scene.material.all:
            E = plane_modulus(material)
            zone = min(zone, 0.5 * E / law.omega)
            if arm.bends:
                bending = E * arm.thickness**3 / 12.0
                zone = min(zone, ZONE_OF_ARM * (bending / law.omega) ** 0.25)
    return zone


def plane_modulus(material: Material) -> float:
    """Return E′ of the plane problem, 4μ(λ + μ)/(λ + 2μ) [Pa]."""
    lam, mu = material.lam, material.mu
    return 4.0 * mu * (lam + mu) / (lam + 2.0 * mu)


def wiggle(cells: float) -> float:
    """Return how far the force of a growing crack goes up and down, of elements in the zone [%]."""
    return float(np.interp(math.log(cells), np.log(ZONE_CELLS), WIGGLES))
