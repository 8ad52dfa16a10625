"""The checks beyond the study's text that run and plan make before any work: the output and a body from a file."""

from __future__ import annotations

from pathlib import Path

from tcstudy.data.store import StoreError, check_writable
from tcstudy.scene.records import Study
from tcstudy.study.plan import expected_bytes


def faults(study: Study, output: Path) -> list[str]:
    """What would stop a run of this study into `output`, in words; empty if nothing would."""
    return [*_body_faults(study), *_output_faults(study, output)]


def _body_faults(study: Study) -> list[str]:
    if study.scenes[0].body.brep is None:
        return []
    from tcstudy.fem.geometry import GeometryFailed, build  # a file needs the geometry kernel, a polygon does not

    try:
        build(study.scenes[0].body)
    except GeometryFailed as error:
        return [str(error)]
    return []


def _output_faults(study: Study, output: Path) -> list[str]:
    try:
        return check_writable(output, expected_bytes(study))
    except StoreError as error:
        return [str(error)]
