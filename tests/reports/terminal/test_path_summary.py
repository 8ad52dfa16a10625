"""What a person counts as a fold of a path."""

from __future__ import annotations

import numpy as np
import xarray as xr

from tcstudy.reports.terminal.path_summary import seen_folds


def path(*sizes: float) -> xr.Dataset:
    """Folds of these sizes on a path from 0 to −2."""
    folds = {"fold_vertex": ("fold", np.arange(len(sizes))), "fold_size": ("fold", np.array(sizes))}
    return xr.Dataset(folds, attrs={"parameter_range": [0.0, -2.0]})


def test_small_turns_are_counted_apart() -> None:
    data = path(0.3, 1e-3, 1e-3, 0.3)
    vertices, small = seen_folds(data)
    assert (vertices.tolist(), small) == ([0, 3], 2)
    assert seen_folds(path(0.02))[0].tolist() == [0]
    assert seen_folds(xr.Dataset())[1] == 0
