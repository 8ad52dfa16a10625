"""What a block of points is answered with: arrays over its points, judged by the inclusion (21)."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from tcstudy.online.newton import traction_scale
from tcstudy.online.problems import Rows
from tcstudy.scene.acceptance import Acceptance
from tcstudy.solve.extended import extended_residual

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Certificates:
    """What is proved about P points, (P,) each; the meaning is that of tcstudy.solve.certificates.Certificate.

    omega:       steepest fall of the law [Pa/m]
    convex, unique, strict_minimum, global_minimum: proved; False says "not certified"
    energy_gap:  what rounding leaves open of a global minimum [J/m], NaN where none is certified
    least_slack, resting: of the nodes on up-jumps
    """

    omega: Array
    convex: Flags
    unique: Flags
    strict_minimum: Flags
    global_minimum: Flags
    energy_gap: Array
    least_slack: Array
    resting: NDArray[np.intp]


@dataclass(frozen=True, eq=False)
class BlockAnswers:
    """Judged solutions of P points.

    v, v_low:           (P, m) tangential displacements v + v_low [m]; the low part is 0 where one double is enough
    xi:                 (P, m) nodal friction forces l̃ − Ã(v + v_low) [N/m]
    inclusion_residual: (P,) max_i dist(ξ_i/c_i, b̂(v_i)) / (scale of b)
    rounding:           (P,) what rounding of the problem allows of it, ContactProblem.xi_rounding
    limited:            (P,) accepted only because rounding allows no better (scene/acceptance.py)
    energy:             (P,) L̃(v) [J/m]
    status:             (P,) tcstudy.solve.loop.Status
    reasons:            why a point has no solution, empty for a solution
    start:              (P,) ZERO, FRICTIONLESS, NEIGHBOUR or ESCAPE of tcstudy.solve.contact: what led to v
    start_energies:     (P, 4) L̃ of the solutions found from these starts; NaN where none was sought or found
    steps:              (P,) Newton steps on the body itself of the descent that led to v, or of the single solve
    searched_singly:    (P,) the single solve was asked, too
    certificates:       what is proved
    """

    v: Array
    v_low: Array
    xi: Array
    inclusion_residual: Array
    rounding: Array
    limited: Flags
    energy: Array
    status: NDArray[np.int8]
    reasons: tuple[str, ...]
    start: NDArray[np.int8]
    start_energies: Array
    steps: NDArray[np.intp]
    searched_singly: Flags
    certificates: Certificates

    def take(self, points: NDArray[np.intp]) -> BlockAnswers:
        """The named points, in this order."""
        own = {f.name: getattr(self, f.name) for f in fields(self)}
        proved = Certificates(*(getattr(self.certificates, f.name)[points] for f in fields(Certificates)))
        reasons = tuple(self.reasons[int(p)] for p in points)
        arrays = {name: x[points] for name, x in own.items() if isinstance(x, np.ndarray)}
        return BlockAnswers(**arrays, reasons=reasons, certificates=proved)


def joined(parts: list[BlockAnswers]) -> BlockAnswers:
    """The answers of several blocks, one after the other."""

    def together(records: list[object], names: list[str]) -> dict[str, NDArray]:
        return {name: np.concatenate([getattr(record, name) for record in records]) for name in names}

    proved = Certificates(**together([p.certificates for p in parts], [f.name for f in fields(Certificates)]))
    names = [f.name for f in fields(BlockAnswers) if f.name not in ("reasons", "certificates")]
    reasons = tuple(reason for part in parts for reason in part.reasons)
    return BlockAnswers(**together(list(parts), names), reasons=reasons, certificates=proved)


@dataclass(frozen=True, eq=False)
class Judged:
    """ξ (R, m), inclusion residual, what rounding allows, and whether that is a solution, (R,) each."""

    xi: Array
    residual: Array
    rounding: Array
    accepted: Flags


def judge(rows: Rows, v: Array, acceptance: Acceptance) -> Judged:
    """The inclusion test of rows, as ContactProblem.inclusion_residual and tcstudy/scene/acceptance.py have it.

    Where rounding of ξ leaves that open ξ is formed in extended precision.
    """
    body, laws, xi = rows.body, rows.laws, rows.xi(v)
    scale, at = traction_scale(body, laws, rows.loads), laws.locate(v)
    low, high = laws.interval(v, at)

    def residual_of(force: Array, part: slice | NDArray[np.intp]) -> Array:
        apart = np.maximum(low[part] - force / body.c, force / body.c - high[part])
        return np.maximum(0.0, np.max(apart, axis=1, initial=0.0)) / scale[part]

    size = (np.abs(rows.loads) + np.abs(v) @ np.abs(body.A_tilde)) / body.c
    size += np.where(at.on, 0.0, np.abs(laws.slope(v, at.piece) * v))
    rounding = np.sqrt(body.m) * np.finfo(float).eps * np.max(size, axis=1, initial=0.0) / scale
    residual = residual_of(xi, slice(None))
    lost = np.flatnonzero(~(residual + rounding <= acceptance.aim))
    for i in lost:
        xi[i] = extended_residual(rows.loads[i], body.A_tilde, v[i])
    residual[lost] = residual_of(xi[lost], lost)
    residual[np.isnan(residual)] = np.inf
    limits = np.array([acceptance.limit(float(x)) for x in rounding])
    return Judged(xi, residual, rounding, residual <= limits)
