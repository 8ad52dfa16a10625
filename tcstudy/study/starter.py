"""The commented starter study, and the schema that its first line names to editors."""

from __future__ import annotations

from pathlib import Path

from tcstudy.data.files import Snapshot, replace_file
from tcstudy.errors import StoreError, UsageError
from tcstudy.read.schema import TITLE, schema_text
from tcstudy.scene.study import shell_name

STARTER = Path(__file__).with_name("starter.yaml")
SCHEMA = "study.schema.json"


def write_starter(study: Path) -> Path:
    """Write the starter study and its schema, and return the name of the study.

    A schema file that another program made stays. Raises UsageError if the study is there or
    cannot be written.
    """
    if fault := shell_name(str(study)):
        raise UsageError(f"{study} {'; '.join(fault)}")
    no_file = Snapshot(study, None)
    if not no_file.is_there():
        raise UsageError(f"{study}: is there already, and is kept; name another file")
    if not study.parent.is_dir():
        reason = f"there is no folder {study.parent}"
        raise UsageError(f"{study}: cannot be written ({reason}); name another file")
    text = STARTER.read_text(encoding="utf-8").replace("study.yaml", study.name)
    schema = study.parent / SCHEMA
    try:
        may_replace_schema = _is_absent_or_ours(schema)
        _write_text(study, text, no_file)
    except (OSError, StoreError) as error:
        raise UsageError(f"{study}: cannot be written ({error}); name another file") from error
    if may_replace_schema:
        try:
            _write_text(schema, schema_text())
        except StoreError as error:
            study.unlink()  # without its schema the study would name a file that is not there
            raise UsageError(str(error)) from error
    return study


def _is_absent_or_ours(schema: Path) -> bool:
    if not schema.exists():
        return True
    return TITLE in schema.read_text(encoding="utf-8", errors="replace")


def _write_text(path: Path, text: str, seen: Snapshot | None = None) -> None:
    """Write a text file in one step; `seen` as of `replace_file`. Raises StoreError."""

    def write(aside: Path) -> None:
        aside.write_text(text, encoding="utf-8")

    replace_file(path, write, sealed=False, seen=seen)
