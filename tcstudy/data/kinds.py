"""Which command wrote a result file."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal

from tcstudy.data.reading import attributes

Kind = Literal["run", "path", "convergence", "cost"]
CONTENT = "content"
"""Global attribute that tells the files of other commands from that of a run."""


def kind_of(path: Path) -> Kind:
    """The command whose file this is. Raises StoreError if there is no file or it is not complete."""
    return kind_from(attributes(path))


def kind_from(found: Mapping[str, Any]) -> Kind:
    """The command by the global attributes of its file."""
    content = found.get(CONTENT)
    if content in ("path", "cost"):
        return "path" if content == "path" else "cost"
    return "convergence" if "reference" in found else "run"
