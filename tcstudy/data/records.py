"""What a run hands to the store: one record per solved point and level, plus what a level knows of its contact line."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class PointStatus(IntEnum):
    """Status of a sweep point in the data (CF status_flag). Anything but OK carries a reason."""

    NOT_RUN = 0
    OK = 1
    NOT_CONVERGED = 2
    INCLUSION_VIOLATED = 3
    SINGULAR = 4
    MESH_FAILED = 5
    ERROR = 6


@dataclass(frozen=True)
class LevelRecord:
    """One mesh level.

    h_max:      longest element edge [m];  n_dof: displacement unknowns;  n_contact: contact unknowns m
    arclength, x, y, c: (m,) contact nodes in order along Γ_C, and their segment lengths c_i [m]
    edge:       (m,) index into edge_names of the contact edge that a node lies on
    time_mesh, time_assemble: wall time of this level's mesh and matrices [s]
    fields:     mesh arrays for whole-body fields: "node_x", "node_y" (n,), "triangle" (t, 3); empty unless asked for
    stop:       why refinement ended on this level, in words; empty if it went on or there was nothing to decide
    """

    level: int
    h_max: float
    n_dof: int
    n_contact: int
    arclength: Array
    x: Array
    y: Array
    c: Array
    edge: NDArray[np.int8]
    edge_names: tuple[str, ...]
    time_mesh: float
    time_assemble: float
    fields: dict[str, NDArray[np.generic]] = field(default_factory=dict)
    stop: str = ""


@dataclass(frozen=True)
class PointRecord:
    """One sweep point on one level.

    index:   position of the point in the sweep (along each data dimension)
    status, reason: what came of it; reason is "" for OK
    numbers: results by variable name (see data.schema), tuples where there is one for each start or solver;
             missing ones are NaN in the data
    u_T, xi: (m,) tangential displacement [m] and traction −S_T = ξ_i/c_i [Pa]; empty if the point failed before
    sticks:  (m,) 1 where the node rests on an up-jump of the friction law, else 0; empty if that is not known
    fields:  whole-body nodal fields by name ("theta", "u_x", "u_y"), only if asked for
    """

    index: tuple[int, ...]
    level: int
    status: PointStatus
    reason: str
    numbers: dict[str, float | tuple[float, ...]]
    u_T: Array
    xi: Array
    fields: dict[str, Array] = field(default_factory=dict)
    sticks: NDArray[np.int8] = field(default_factory=lambda: np.empty(0, dtype=np.int8))
