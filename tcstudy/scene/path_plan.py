"""The equilibrium path of a study: its parameter, its range and how it is followed."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from tcstudy.scene.records import Scene

Start = Literal["zero", "lowest"]
Direction = Literal["both", "forward", "backward"]


@dataclass(frozen=True)
class PathPlan:
    """The path of solutions along one parameter t in which the load is affine, l̃(t) = l̃₀ + t l̃₁
    (section `path`).

    parameter:  key path of t, e.g. ("heat", "theta_bar"), ("boundary", "top", "u_x"), ("loads",
                "f_x"); ("load",) is a factor of all mechanical loads: f, g, pressure, force, moment
    units:      units of t in CF form, "1" without
    begin, end: range of interest; the path starts at begin
    within:     (low, high): how far the path is followed; it may leave the range of interest and
                come back
    at:         values at which all solutions are wanted
    scene:      the scene without a sweep; its own value of the parameter is not used
    start:      which solution of t = begin the path goes through: the one found from zero or the
                lowest one found
    direction:  ways followed from the start; "forward" is towards end
    max_pieces: most pieces on either side of the start
    hysteresis: whether the loop between begin and end is computed
    level:      mesh level, None for the finest
    law_error:  relative error of the piecewise-linear stand-in for a law with exponential pieces
    complete:   whether every branch between begin and end is sought, and proved to be all
                (contact/path/query.py)
    """

    parameter: tuple[str, ...]
    units: str
    begin: float
    end: float
    within: tuple[float, float]
    scene: Scene
    at: tuple[float, ...] = ()
    start: Start = "zero"
    direction: Direction = "both"
    max_pieces: int = 20_000
    hysteresis: bool = True
    level: int | None = None
    law_error: float = 1e-3
    complete: bool = False

    @property
    def name(self) -> str:
        """Dotted name of the parameter."""
        return ".".join(self.parameter)
