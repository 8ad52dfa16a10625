"""The points of a sweep as their files have them, before there is any file."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from tcstudy.data import schema
from tcstudy.scene.records import Study

if TYPE_CHECKING:
    import xarray


def sweep_points(study: Study) -> xarray.Dataset:
    """A dataset with the study's axes and an empty `status`, to find a point by its labels."""
    import xarray

    data = xarray.Dataset(attrs={"sweep_mode": study.mode})
    for axis in study.axes:
        name = schema.axis_name(axis)
        dim = name if study.mode == "grid" else schema.POINT
        data = data.assign_coords({name: (dim, schema.axis_labels(axis), schema.axis_attributes(axis))})
    data["status"] = (schema.sweep_dims(study), np.zeros(study.shape, dtype=np.int8))
    return data


def ascending(data: xarray.Dataset, study: Study) -> xarray.Dataset:
    """The same data with axes of numbers that go up and down sorted: CF wants monotonic coordinates."""
    if study.mode == "grid":
        for axis in study.axes:
            places = schema.axis_places(axis)
            if np.any(places != np.arange(len(places))):
                data = data.isel({schema.axis_name(axis): np.argsort(places)})
    return data
