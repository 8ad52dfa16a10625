"""Which results a file holds, so that two studies do not overwrite each other and none is computed twice.

Which command wrote a result file.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from tcstudy.data.provenance import program, study_sha256
from tcstudy.data.reading import attributes, is_foreign
from tcstudy.errors import StoreError
from tcstudy.scene.study import Study

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


@dataclass(frozen=True)
class Identity:
    """All that decides what stands in a file.

    kind: the command;  study_sha256: the study with its overrides and geometry;  program: versions of the code and of
    the libraries that compute;  asked: global attributes that options of the command decide
    """

    kind: Kind
    study_sha256: str
    program: str
    asked: tuple[tuple[str, Any], ...] = ()


def identity(kind: Kind, study: Study, **asked: Any) -> Identity:
    """The identity of the results that a command would compute now."""
    return Identity(kind, study_sha256(study), program(), tuple(asked.items()))


def holds(path: Path, wanted: Identity) -> bool:
    """Whether the file holds the wanted results, complete. Raises StoreError if it holds others, or is damaged."""
    if not path.is_file() or not path.stat().st_size or is_foreign(path):  # a foreign one is told of elsewhere
        return False
    remedy = "give another --output, or --force to replace it"
    try:
        found = attributes(path)
    except StoreError as error:
        raise StoreError(f"{error}: {remedy}") from error
    if what := _difference(found, wanted):
        raise StoreError(f"{path} {what}; {remedy}")
    return True


def already_there(path: Path, study: Study) -> list[str]:
    """Notes on results that a run of the study would find in its output."""
    try:
        there = holds(path, identity("run", study))
    except StoreError as error:
        return [f"a run would stop here: {error}"]
    return [f"{path} holds these results already; a run ends at once, --force computes them again"] if there else []


def _difference(found: dict[str, Any], wanted: Identity) -> str:
    """What the file holds instead; empty if it holds what is wanted."""
    if (kind := kind_from(found)) != wanted.kind:
        return f"holds results of another command ({kind})"
    if found.get("study_sha256") != wanted.study_sha256:
        return "holds the results of another study, or of this one with other values"
    if any(found.get(name) != value for name, value in wanted.asked):
        return "holds the results of another --at or --runs"
    if found.get("program") != wanted.program:
        return "holds this study as another version of the program or its libraries computed it"
    return ""
