"""The file of a fit: what was found, how well it is known, what the data say against it; one netCDF-4 file.

Numbers are in SI units, which differ from parameter to parameter: `parameter_units` names them. Residuals, and the
Jacobian by ln p or by p (`logarithmic`), are in units of the noise.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tcstudy.data.files import write_dataset
from tcstudy.data.provenance import CONTENT, Provenance, global_attributes
from tcstudy.data.schema import FileVariable, flags
from tcstudy.data.writer import put_all
from tcstudy.scene.study import Study

P, D, S = ("parameter",), ("row",), ("start",)
_OWN = "in the units of parameter_units"


@dataclass(frozen=True, eq=False)
class FitRecord:
    """A finished fit; shapes, units and meanings are those of VARIABLES."""

    values: Mapping[str, Any]
    attributes: Mapping[str, Any]


def _own(name: str, what: str, dims: tuple[str, ...] = P) -> FileVariable:
    return FileVariable(name, "f8", "1", what, dims, comment=_OWN)


VARIABLES = (
    FileVariable("parameter", "str", "", "number that was found", P, coordinate=True),
    FileVariable("parameter_units", "str", "", "its units", P),
    _own("estimate", "estimate"),
    _own("standard_error", "standard error"),
    _own("interval", "95 % interval", (*P, "end")),
    FileVariable("mesh_shift", "f8", "1", "change on a mesh of half the size over the standard error", P),
    _own("parameter_start", "where the search began"),
    _own("parameter_within", "where it could go", (*P, "end")),
    FileVariable("logarithmic", "i1", "1", "found by its logarithm", P, extra=flags("no", "yes")),
    FileVariable("at_bound", "i1", "1", "on a bound", P, extra=flags("no", "yes")),
    FileVariable("covariance", "f8", "1", "covariance, of ln where logarithmic", (*P, "other_parameter"), comment=_OWN),
    FileVariable("singular_value", "f8", "1", "singular values of the Jacobian by ln p", ("direction",)),
    FileVariable("singular_vector", "f8", "1", "their directions in ln p", ("direction", "parameter")),
    FileVariable("measured_column", "i4", "1", "column of the datum", D),
    FileVariable("datum", "f8", "1", "measured value", D, comment="in SI units of its column"),
    FileVariable("datum_given", "f8", "1", "parameter of the load at it", D),
    FileVariable("predicted", "f8", "1", "value of the study", D),
    FileVariable("predicted_given", "f8", "1", "parameter of the load there", D),
    FileVariable("residual", "f8", "1", "residual over its noise", D),
    FileVariable("jacobian", "f8", "1", "residual by parameter, or by its logarithm", (*D, *P)),
    FileVariable("noise", "f8", "1", "standard deviation of the noise", D),
    FileVariable("cost", "f8", "1", "half the sum of squares by evaluation", ("improvement",)),
    FileVariable("start_cost", "f8", "1", "half the sum of squares, by distinct minimum", S),
    FileVariable("start_count", "i4", "1", "starts that end in this minimum", S),
    FileVariable("start_estimate", "f8", "1", "estimate, by distinct minimum", (*S, *P), comment=_OWN),
    FileVariable("start_evaluations", "i4", "1", "evaluations, by distinct minimum", S),
    FileVariable("curve_given", "f8", "1", "parameter of the load along the curve", ("vertex",)),
    FileVariable("curve_measured", "f8", "1", "value of the study along the curve", ("vertex",)),
    FileVariable("curve_error", "f8", "1", "standard error of the curve across it", ("vertex",)),
    FileVariable("fold_vertex", "i4", "1", "vertex of a fold", ("fold",)),
    FileVariable("law_slip", "f8", "m", "slip", ("law_place",)),
    FileVariable("law_traction", "f8", "Pa", "fitted friction law", ("law_place",)),
    FileVariable("law_error", "f8", "Pa", "its standard error", ("law_place",)),
)
"""Everything that a file of a fit may hold."""


def write_fit(path: Path, study: Study, record: FitRecord, provenance: Provenance) -> None:
    """Write a fit to `path`, replacing an old file in one step; raises StoreError if that is not possible."""
    told = global_attributes(study, provenance) | {CONTENT: "fit", **record.attributes}
    write_dataset(path, told, lambda nc: put_all(nc, VARIABLES, record.values, study))
