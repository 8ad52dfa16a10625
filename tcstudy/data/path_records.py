"""What `tcstudy path` hands to the store: arrays whose names are those of the file's variables."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from tcstudy.data.records import LevelRecord

Array = NDArray[np.float64]
Index = NDArray[np.int32]
Flag = NDArray[np.int8]


class ContactState(IntEnum):
    """What a contact node does on a piece of the path."""

    STICK = 0
    """at rest on an up-jump of b"""
    SLIP = 1
    """on a part of b that does not fall and has not fallen since s = 0"""
    SOFTEN = 2
    """on a falling part of b"""
    DROP = 3
    """at rest on a down-jump of b"""
    WEAKENED = 4
    """on a part of b that does not fall, beyond one that does"""


@dataclass(frozen=True)
class CurveRecord:
    """A polygon of solutions with k vertices and k − 1 pieces; every quantity is linear in between.

    parameter: (k,) t;  u_T: (k, m) [m];  xi: (k, m) −S_T [Pa]
    energy:    (k,) total potential energy [J/m];  energy_rate: (k,) its derivative by t along the path
    residual:  (k,) distance from balance relative to the scale of b
    stable:    (k−1,) strict local minimum of the energy inside the piece
    state:     (k−1, m) ContactState
    slip_length: (k−1,) length of the contact line that does not stick [m]
    fold_vertex, fold_size, fold_maximum, fold_stable_before, fold_stable_after: (f,) turning points of t; size: how far
        t steps back there
    event_vertex, event_node, event_before, event_after: (e,) changes of a node's state: the fronts of slip and stick
    lowest_begin, lowest_end, lowest_piece, lowest_certified: (n,) which piece has the least energy on the path for t
        from begin to end; certified: proved at the middle to have the least energy of all states
    """

    parameter: Array
    u_T: Array
    xi: Array
    energy: Array
    energy_rate: Array
    residual: Array
    stable: Flag
    state: Flag
    slip_length: Array
    fold_vertex: Index
    fold_size: Array
    fold_maximum: Flag
    fold_stable_before: Flag
    fold_stable_after: Flag
    event_vertex: Index
    event_node: Index
    event_before: Flag
    event_after: Flag
    lowest_begin: Array
    lowest_end: Array
    lowest_piece: Index
    lowest_certified: Flag


@dataclass(frozen=True)
class SolutionsRecord:
    """All solutions on the path at the requested values.

    at, solution_count: (a,) requested values, and how many solutions each has
    solution_*: (s,) one entry a solution, in the order of `at` and along the path; at: index of its value; piece: where
                it lies; energy [J/m]; residual: inclusion residual, and what rounding of the problem
                allows of it (rounding); stable: on the path; lowest: least energy among
                those of its value; unique, strict_minimum, global_minimum: certificates; u_T, xi: (s, m)
    """

    at: Array
    solution_count: Index
    solution_at: Index
    solution_piece: Index
    solution_energy: Array
    solution_residual: Array
    solution_rounding: Array
    solution_stable: Flag
    solution_lowest: Flag
    solution_unique: Flag
    solution_strict_minimum: Flag
    solution_global_minimum: Flag
    solution_u_T: Array
    solution_xi: Array


@dataclass(frozen=True)
class LoopRecord:
    """The quasi-static hysteresis loop: stable branches one after the other, and the falls between them.

    loop_parameter, loop_branch, loop_energy: (v,);  loop_u_T, loop_xi: (v, m)
    jump_parameter, jump_vertex, jump_rising, jump_drop: (j,) falls: t, last vertex before it, whether t was growing,
        energy lost [J/m]
    energy_lost: sum of the drops;  loop_area: −∮W dt of the branches, the same if the loop is closed [J/m]
    loop_closed, loop_complete: flags;  loop_reason: why it ended
    """

    loop_parameter: Array
    loop_branch: Index
    loop_energy: Array
    loop_u_T: Array
    loop_xi: Array
    jump_parameter: Array
    jump_vertex: Index
    jump_rising: Flag
    jump_drop: Array
    energy_lost: float
    loop_area: float
    loop_closed: int
    loop_complete: int
    loop_reason: str


@dataclass(frozen=True)
class PathRecord:
    """A study's path: the mesh level, the curve, its ends, the requested solutions and the loop.

    start:         vertex from which the path was followed
    begin, end:    why it ends at the first and at the last vertex: (name of the status, sentence)
    lambda_1, omega: uniqueness threshold of the body and steepest fall of the law [Pa/m]
    law_error:     |b − b_h| of the piecewise-linear stand-in of a smooth law, relative to the scale of b; 0 without
    affine_defect: how far the load is from affine in t, relative
    """

    line: LevelRecord
    curve: CurveRecord
    start: int
    begin: tuple[str, str]
    end: tuple[str, str]
    solutions: SolutionsRecord
    loop: LoopRecord | None
    lambda_1: float
    omega: float
    law_error: float
    affine_defect: float
