"""Tables of a result file for what is printed: arrays with named dimensions and attributes.

They have the few methods of xarray that the reports use, under its names, so that a report takes
either of them. The import of xarray, with pandas and dask, takes three times as long as all that a
table on the terminal needs. Computations with labels use xarray (`tcstudy.data.reading`).
"""

from __future__ import annotations

from collections.abc import Hashable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from types import EllipsisType
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    import netCDF4

Index = Mapping[Any, Any]
"""An integer or a slice by dimension."""


@dataclass(frozen=True, eq=False)
class LabelledArray:
    """Values with a name for each of their dimensions, and the attributes of their variable."""

    values: NDArray[Any]
    dims: tuple[str, ...]
    attrs: Mapping[str, Any]

    @property
    def sizes(self) -> dict[str, int]:
        """Return the extent of each dimension."""
        return dict(zip(self.dims, self.values.shape, strict=True))

    @property
    def shape(self) -> tuple[int, ...]:
        return self.values.shape

    @property
    def size(self) -> int:
        return self.values.size

    @property
    def dtype(self) -> np.dtype[Any]:
        return self.values.dtype

    def isel(self, index: Index | None = None, **by_name: Any) -> LabelledArray:
        """Return the part at integers or slices of dimensions; an integer drops its dimension."""
        index = {**(index or {}), **by_name}
        key = tuple(index.get(dim, slice(None)) for dim in self.dims)
        dims = tuple(dim for dim in self.dims if isinstance(index.get(dim, slice(None)), slice))
        return replace(self, values=np.asarray(self.values[key]), dims=dims)

    def transpose(self, *dims: str | EllipsisType) -> LabelledArray:
        """Return the array with its dimensions in this order; `...` stands for those not named."""
        unnamed = [dim for dim in self.dims if dim not in dims]
        order = list[str]()
        for dim in dims:
            order += unnamed if isinstance(dim, EllipsisType) else [dim]
        axes = [self.dims.index(dim) for dim in order]
        return replace(self, values=self.values.transpose(axes), dims=tuple(order))

    def max(self, dims: Sequence[str] | None = None) -> LabelledArray:
        """Return the largest values along these dimensions, by default all; NaN do not count."""
        along = self.dims if dims is None else dims
        axes = tuple(self.dims.index(dim) for dim in along)
        dims_left = tuple(dim for dim in self.dims if dim not in along)
        largest = np.fmax.reduce(self.values, axis=axes)
        return replace(self, values=np.asarray(largest), dims=dims_left)

    def item(self) -> Any:
        """Return the only value."""
        return self.values.item()

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> NDArray[Any]:
        return np.array(self.values, dtype=dtype) if copy else np.asarray(self.values, dtype=dtype)

    def __len__(self) -> int:
        return len(self.values)

    def __iter__(self) -> Iterator[Any]:
        return iter(self.values)

    def __float__(self) -> float:
        return float(self.values.item())

    def __int__(self) -> int:
        return int(self.values.item())

    def __bool__(self) -> bool:
        return bool(self.values)


@dataclass(frozen=True, eq=False)
class LabelledTable:
    """The variables of a group of a file, and its attributes.

    names: of the variables that are coordinates in the sense of xarray
    """

    variables: Mapping[str, LabelledArray]
    attrs: Mapping[str, Any]
    sizes: Mapping[str, int]
    names: frozenset[str]

    @classmethod
    def of(cls, group: netCDF4.Dataset, without: tuple[str, ...] = ()) -> LabelledTable:
        """Return the table of a group of an open file, without the variables of these names."""
        names = {name for name in group.variables if name not in without}
        variables = {name: _read(group[name]) for name in group.variables if name in names}
        coordinates = names & {*group.dimensions}
        for array in variables.values():
            coordinates |= names & {*str(array.attrs.get("coordinates", "")).split()}
        attrs = {name: group.getncattr(name) for name in group.ncattrs()}
        sizes = {name: len(dimension) for name, dimension in group.dimensions.items()}
        return cls(variables, attrs, sizes, frozenset(coordinates))

    @property
    def dims(self) -> Mapping[str, int]:
        return self.sizes

    @property
    def coords(self) -> list[str]:
        """Return the names of the coordinates, in the order of the file."""
        return [name for name in self.variables if name in self.names]

    @property
    def data_vars(self) -> list[str]:
        """Return the names of all other variables."""
        return [name for name in self.variables if name not in self.names]

    def isel(self, index: Index | None = None, **by_name: Any) -> LabelledTable:
        """Return the table of these parts of all variables."""
        index = {**(index or {}), **by_name}
        variables = dict[str, LabelledArray]()
        sizes = dict[str, int]()
        for name, array in self.variables.items():
            part = variables[name] = array.isel(index)
            sizes |= part.sizes
        return replace(self, variables=variables, sizes=sizes)

    def assign(self, variables: Mapping[str, LabelledArray]) -> LabelledTable:
        """Return the table with these variables in place of those of the same names."""
        return replace(self, variables={**self.variables, **variables})

    def __getitem__(self, name: str) -> LabelledArray:
        """Return a variable, or the integers of a dimension that has no variable."""
        if name not in self.variables and name in self.sizes:
            return LabelledArray(np.arange(self.sizes[name]), (name,), {})
        return self.variables[name]

    def get(self, name: str, default: Any = None) -> Any:
        """Return a variable, or the default where there is none."""
        return self.variables.get(name, default)

    def __contains__(self, name: Hashable) -> bool:
        return name in self.variables


def _read(variable: netCDF4.Variable) -> LabelledArray:
    """Return a variable without a mask; missing numbers are stored as NaN."""
    attrs = {name: variable.getncattr(name) for name in variable.ncattrs()}
    return LabelledArray(np.asarray(variable[...]), variable.dimensions, attrs)
