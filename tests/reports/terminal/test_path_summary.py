"""path_folds: what a person counts as a fold."""

from __future__ import annotations

import numpy as np
import xarray as xr

from tcstudy.reports.terminal.path_summary import folds_in_words, seen_folds


def path(*sizes: float) -> xr.Dataset:
    """Folds of these sizes on a path from 0 to −2."""
    folds = {"fold_vertex": ("fold", np.arange(len(sizes))), "fold_size": ("fold", np.array(sizes))}
    return xr.Dataset(folds, attrs={"parameter_range": [0.0, -2.0]})


def test_small_turns_are_counted_apart() -> None:
    data = path(0.3, 1e-3, 1e-3, 0.3)
    vertices, small = seen_folds(data)
    assert (vertices.tolist(), small) == ([0, 3], 2)
    assert folds_in_words(data) == "2 folds and 2 turns below 0.5 % of the range"
    assert folds_in_words(path(0.02)) == "1 fold"
    assert folds_in_words(xr.Dataset()) == "0 folds"
    assert seen_folds(data.drop_vars("fold_size"))[0].tolist() == [0, 1, 2, 3]
