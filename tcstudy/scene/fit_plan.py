"""Fits of a study: measured columns, the numbers to find, and numbers to differentiate by."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from tcstudy.scene import units as u
from tcstudy.scene.histories import HistoryPlan
from tcstudy.scene.records import Scene

COMPARE = ("vertical", "orthogonal")
LOSSES = ("linear", "soft_l1")
SCALES = ("log", "linear")
RESULTS = {
    "friction_resultant": u.LINE_FORCE,
    "u_T_max": u.LENGTH,
    "theta_mean": u.TEMPERATURE,
    "u_T": u.LENGTH,
}
"""Results that may be measured, with their dimensions; u_T is that at the x of the datum."""
RESULTS_OF_OPENINGS = {
    "opening_max": u.LENGTH,
    "peel_stress_max": u.TRACTION,
    "adhesion_resultant": u.LINE_FORCE,
}
"""Results that may be measured where an edge may open."""
PLACE = ("x",)
"""Key path of the column that says where on the contact line u_T was measured."""
STEP = ("step",)
"""Key path of the column that says at which step of a history a line was measured."""


@dataclass(frozen=True)
class Sensitivity:
    """A number of the study by which results are differentiated.

    name:  as the study writes it
    path:  key path, ("load",) for a factor of all mechanical loads
    units: of the number in CF form
    """

    name: str
    path: tuple[str, ...]
    units: str


@dataclass(frozen=True)
class FitParameter:
    """A number to find.

    start:     where the search begins [SI]
    low, high: bounds of the search [SI]
    log:       whether its logarithm is sought
    """

    number: Sensitivity
    start: float
    low: float
    high: float
    log: bool


@dataclass(frozen=True)
class FitColumn:
    """A measured column.

    name:   a parameter in which the load is affine, x, or a result
    path:   of what is given, empty for a result
    units:  in CF form
    values: (n,) in SI
    noise:  its standard deviation, None if that is estimated
    """

    name: str
    path: tuple[str, ...]
    units: str
    values: tuple[float, ...]
    noise: float | None
    dimension: u.Dimension


@dataclass(frozen=True)
class FitPlan:
    """A fit (section `fit`).

    given, measured: columns that the scene gets, and that are compared with its results
    parameters:   the numbers to find
    scene:        that of the study, with its own values
    file, sha256: the table and its checksum; of several tests the first one's name, and that of all
                  checksums
    level:        mesh level, None for the finest
    smooth:       whether laws by points are to be as straight as the data let them
    history:      the load history at whose steps was measured, None for static points
    """

    given: tuple[FitColumn, ...]
    measured: tuple[FitColumn, ...]
    parameters: tuple[FitParameter, ...]
    scene: Scene
    file: str
    sha256: str
    compare: Literal["vertical", "orthogonal"] = "vertical"
    starts: int = 5
    seed: int = 0
    loss: Literal["linear", "soft_l1"] = "linear"
    level: int | None = None
    smooth: bool = False
    history: HistoryPlan | None = None

    @property
    def count(self) -> int:
        """The number of data."""
        return sum(len(column.values) for column in self.measured)

    @property
    def loads(self) -> tuple[FitColumn, ...]:
        """The given columns that are parameters of the load."""
        return tuple(column for column in self.given if column.path not in (PLACE, STEP))

    @property
    def at_steps(self) -> list[int]:
        """The step of every line of the table; empty for static points."""
        columns = [column for column in self.given if column.path == STEP]
        return [int(value) for column in columns for value in column.values]

    @property
    def place(self) -> FitColumn | None:
        """Where on the contact line u_T was measured."""
        return next((column for column in self.given if column.path == PLACE), None)

    @property
    def known_noise(self) -> bool:
        """Whether the noise of all that is compared is known."""
        columns = self.measured
        if self.compare == "orthogonal":
            columns = (*self.measured, *self.given)
        return all(column.noise is not None for column in columns)

    @property
    def assumed_noise(self) -> str:
        """The assumption of intervals if the noise of not all columns is known; else empty."""
        columns = self.measured
        if self.compare == "orthogonal":
            columns = (*self.given, *self.measured)
        with_noise = " and ".join(column.name for column in columns if column.noise is not None)
        without_noise = " and ".join(column.name for column in columns if column.noise is None)
        if len(columns) < 2 or not without_noise:
            return ""
        if with_noise:
            share = f"1 % of its range where that of {with_noise} is as given"
            return f"the noise of {without_noise} is {share}"
        return f"{without_noise} are measured equally well, in parts of their ranges"
