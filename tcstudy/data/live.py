"""The group `live` of a level: what a browser needs to solve the contact problems of that level (output.live).

Asked for by `output: {live: true}` and kept for levels with at most 250 contact nodes; `tcstudy.offline.live` says what
the arrays mean and how a point's problem is put together from them. A record hands them over as fields whose names
begin with PREFIX.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from numpy.typing import NDArray

from tcstudy.data.variable import SWEEP, FileVariable
from tcstudy.data.writer import in_file_order, put_all
from tcstudy.scene.study import Study

if TYPE_CHECKING:
    import netCDF4

GROUP, PREFIX = "live", "live_"

_POINT = (SWEEP,)


def _kept(name: str, units: str, long_name: str, dims: tuple[str, ...] = _POINT) -> FileVariable:
    return FileVariable(name, "f8", units, long_name, dims)


LIVE: tuple[FileVariable, ...] = (
    _kept("A_tilde", "Pa", "condensed stiffness of the first point", ("node", "node_column")),
    _kept("mechanical_load", "N m-1", "condensed loads f, g and pressure", ("mechanical_number", "node")),
    _kept("held_load", "N m-1", "condensed loads of given displacements", ("held_number", "node")),
    _kept("source_node", "m-1", "alpha/k of the nodes of the source's function", ("source_node_number",)),
    _kept("source_weight", "1", "barycentric weights of the source's function", ("source_node_number",)),
    _kept("source_load", "m2", "alpha times the load of a unit source for beta = 1", ("source_node_number", "node")),
    _kept("surroundings_node", "m-1", "alpha/k of the nodes of the surroundings' function", ("surroundings_number",)),
    _kept("surroundings_weight", "1", "barycentric weights of the surroundings' function", ("surroundings_number",)),
    _kept("surroundings_load", "m", "load of unit surroundings for beta = 1", ("surroundings_number", "node")),
    _kept("stiffness", "1", "mu over that of the first point"),
    _kept("mechanical", "1", "number of the mechanical load; -1 for none"),
    _kept("held", "1", "number of the load of given displacements; -1 for none"),
    _kept("beta", "Pa K-1", "stress-temperature modulus"),
    _kept("alpha", "W m-2 K-1", "heat transfer coefficient; missing where the temperature is given"),
    _kept("k", "W m-1 K-1", "conductivity"),
    _kept("q", "W m-3", "factor of the source"),
    _kept("theta_bar", "K", "factor of the temperature of the surroundings, or of the given temperature"),
    _kept("valid", "1", "1 where these arrays give the point's problem, to 1e-11"),
)
"""Variables of the group, by field name without PREFIX."""


def put_live(level_group: netCDF4.Group, study: Study, fields: Mapping[str, NDArray[Any]]) -> None:
    """Make the group if the record has live arrays."""
    arrays = {name.removeprefix(PREFIX): values for name, values in fields.items() if name.startswith(PREFIX)}
    if not arrays:
        return
    by_point = {v.name for v in LIVE if v.dims == _POINT}
    values = {name: in_file_order(study, array) if name in by_point else array for name, array in arrays.items()}
    put_all(level_group.createGroup(GROUP), LIVE, values, study)
