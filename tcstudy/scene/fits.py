"""What a fit is: measured columns, the numbers of the study that are to be found, and how both are compared.

Numbers to find are those by which results can be differentiated (`scene.parameters.with_number` puts values in).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from tcstudy.scene import units as u
from tcstudy.scene.histories import HistoryPlan
from tcstudy.scene.key import Key, key, needed
from tcstudy.scene.records import Scene

COMPARE = ("vertical", "orthogonal")
LOSSES = ("linear", "soft_l1")
SCALES = ("log", "linear")
RESULTS = {"friction_resultant": u.LINE_FORCE, "u_T_max": u.LENGTH, "theta_mean": u.TEMPERATURE, "u_T": u.LENGTH}
"""Results that may be measured, with their dimensions; u_T is that at the x of the datum."""
PLACE = ("x",)
"""Key path of the column that says where on the contact line u_T was measured."""
STEP = ("step",)
"""Key path of the column that says at which step of a history a line was measured."""

_FITTED = "{friction.tau_s: {start: 4 MPa, within: [1 MPa, 50 MPa]}}"
_NAMED = '{friction_resultant: "P [N/mm]"}'
_TESTS = f"[{{data: {{file: short.csv, columns: {_NAMED}}}, with: {{parameters.L: 50 mm}}}}]"

FITS: tuple[Key, ...] = (
    key("fit", "section", "[numbers of the study from measurements](#numbers-from-measurements)"),
    needed("fit.data", "section", "a table of measurements", of=("fit_data",)),
    key("fit.noise", "named quantities", "its standard deviation, by column; left out it is estimated"),
    key("fit.compare", "choice", "results at each datum, or distances to the path", words=COMPARE, default=COMPARE[0]),
    needed("fit.parameters", "fitted numbers", "the numbers to find", of=("fit_parameter",), example=_FITTED),
    key("fit.starts", "integer", "places to begin from", least=1, default=5),
    key("fit.seed", "integer", "of the other starts", least=0, default=0),
    key("fit.loss", "choice", "`soft_l1`: outliers count less", words=LOSSES, default=LOSSES[0]),
    key("fit.level", "integer", "mesh level (default: finest)", least=0),
    key("fit.tests", "sections", "further tests that the same numbers explain", example=_TESTS, of=("fit_test",)),
    key("fit.smooth", "flag", "a law by points without turns that the data do not ask for", default=False),
    needed("fit_data.file", "text", "a CSV table beside the study", example="pull.csv"),
    needed("fit_data.columns", "named texts", "what the study calls a column, and its heading", u.NONE, _NAMED),
    needed("fit_test.data", "section", "its table of measurements", of=("fit_data",)),
    key("fit_test.noise", "named quantities", "its noise (default: that of the fit)"),
    key("fit_test.with", "named quantities", "values that the study has in this test, by key path"),
    needed("fit_parameter.start", "quantity", "where the search begins", example="4 MPa"),
    needed("fit_parameter.within", "span", "where it may go", example="[1 MPa, 50 MPa]"),
    key("fit_parameter.scale", "choice", "`log` by default where `within` is positive", words=SCALES),
)
"""Rows of the table of keys."""


@dataclass(frozen=True)
class Sensitivity:
    """A number of the study by which results are differentiated.

    name:  as the study writes it;  path: key path, ("load",) for a factor of all mechanical loads
    units: of the number in CF form
    """

    name: str
    path: tuple[str, ...]
    units: str


@dataclass(frozen=True)
class FitParameter:
    """A number to find: where it stands, where the search begins and may go [SI], by its logarithm or not."""

    number: Sensitivity
    start: float
    low: float
    high: float
    log: bool


@dataclass(frozen=True)
class FitColumn:
    """A measured column.

    name:  a parameter in which the load is affine, x, or a result;  path: of what is given, empty for a result
    units: in CF form;  values: (n,) in SI;  noise: its standard deviation, None if that is estimated
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
    parameters:      the numbers to find
    scene:           that of the study, with its own values
    file, sha256:    the table and its checksum; of several tests the first one's name, and that of all checksums
    level:           mesh level, None for the finest
    smooth:          whether laws by points are to be as straight as the data let them
    history:         the load history at whose steps was measured, None for static points
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
        """Data."""
        return sum(len(one.values) for one in self.measured)

    @property
    def loads(self) -> tuple[FitColumn, ...]:
        """The given columns that are parameters of the load."""
        return tuple(column for column in self.given if column.path not in (PLACE, STEP))

    @property
    def at_steps(self) -> list[int]:
        """The step of every line of the table; empty for static points."""
        return [int(value) for column in self.given if column.path == STEP for value in column.values]

    @property
    def place(self) -> FitColumn | None:
        """Where on the contact line u_T was measured."""
        return next((column for column in self.given if column.path == PLACE), None)

    @property
    def known_noise(self) -> bool:
        """Whether the noise of all that is compared is known."""
        columns = (*self.measured, *(self.given if self.compare == "orthogonal" else ()))
        return all(column.noise is not None for column in columns)

    @property
    def assumed_noise(self) -> str:
        """What intervals assume of several columns whose noise is not all known; empty if nothing."""
        columns = (*(self.given if self.compare == "orthogonal" else ()), *self.measured)
        known, unknown = ([one.name for one in columns if (one.noise is None) is no] for no in (False, True))
        if len(columns) < 2 or not unknown:
            return ""
        if known:
            beside = f"1 % of its range where that of {' and '.join(known)} is as given"
            return f"the noise of {' and '.join(unknown)} is {beside}"
        return f"{' and '.join(unknown)} are measured equally well, in parts of their ranges"
