"""Which command wrote a result file."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

from tcstudy.data.files import refuse_unfinished

Kind = Literal["run", "path", "convergence", "cost"]
CONTENT = "content"
"""Global attribute that tells the files of other commands from that of a run."""


def kind_of(path: Path) -> Kind:
    """The command whose file this is. Raises StoreError if there is no file or it is not complete."""
    refuse_unfinished(path)
    import netCDF4

    with netCDF4.Dataset(path) as nc:
        names = nc.ncattrs()
        content = nc.getncattr(CONTENT) if CONTENT in names else ""
    if content in ("path", "cost"):
        return "path" if content == "path" else "cost"
    return "convergence" if "reference" in names else "run"
