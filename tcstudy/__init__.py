"""Parametric studies of static thermoelastic contact with nonmonotone, multivalued friction.

    import tcstudy
    study = tcstudy.load("configs/quickstart.yaml", ["mesh.levels=2"])
    tree = tcstudy.run(study, "coarse.nc")  # xarray.DataTree; also written to the file
    tree["level_1"]["u_T"]                 # tangential displacements on the second mesh

The functions import what they need when they are called, so that `import tcstudy` costs nothing.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import xarray

    from tcstudy.scene.study import Study

__all__ = ["load", "open_results", "run"]


def load(path: str | Path, overrides: Sequence[str] = ()) -> Study:
    """Read and check a study file; `overrides` are "key=value" texts as with --set.

    Raises tcstudy.errors.StudyError with all faults of the file, each with its place and remedy.
    """
    from tcstudy.read.study import read_study

    return read_study(Path(path), overrides)


def run(
    study: Study | str | Path, output: str | Path | None = None, *, progress: bool = False, force: bool = False
) -> xarray.DataTree:
    """Run a study (or a study file), write its netCDF file and return its data, loaded into memory.

    progress: show progress on stderr;  force: compute again what the file holds already, replace what else it holds
    Points that fail have a status and a reason in the data. Raises StudyError, tcstudy.fem.geometry.GeometryFailed,
    or tcstudy.data.files.StoreError, for example where the file holds the results of another study.
    """
    from tcstudy.data.identity import holds, identity
    from tcstudy.report.progress import progress as terminal
    from tcstudy.study.execute import execute
    from tcstudy.study.plan import output_of

    study = load(study) if isinstance(study, str | Path) else study
    path = Path(output) if output is not None else output_of(study)
    if force or not holds(path, identity("run", study)):
        watcher = terminal() if progress else None
        try:
            execute(study, path, watcher, ("tcstudy.run",))
        finally:
            if watcher is not None:
                watcher.close()
    with open_results(path) as tree:
        return tree.load()


def open_results(path: str | Path) -> xarray.DataTree:
    """Open a result file as an xarray.DataTree: results at the root, one group per mesh level.

    Raises tcstudy.data.files.StoreError if there is none or its run has not finished.
    """
    from tcstudy.data.store import open_results as open_tree

    return open_tree(Path(path))
