"""The checks beyond the study's text that run and plan make before any work: the output and a body from a file."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from tcstudy.data.files import StoreError, check_writable
from tcstudy.scene.places import located
from tcstudy.scene.records import Study
from tcstudy.study.plan import expected_bytes

if TYPE_CHECKING:
    from tcstudy.fem.geometry import GeometryFailed


def faults(study: Study, output: Path) -> list[str]:
    """What would stop a run of this study into `output`, one line each, as the user sees it; empty if nothing would."""
    file = str(study.source) if study.source is not None else "<text>"
    return [*_body_faults(study), *(f"{file}: {text}" for text in _output_faults(study, output))]


def geometry_fault(study: Study, error: GeometryFailed) -> str:
    """A body without a mesh, as the user sees it: with the place of what decides about it."""
    what, _, remedy = str(error).partition("; ")
    return "\n".join(map(str, located(study, [(error.keys, what, remedy or "check the body, or try another maxh")])))


def _body_faults(study: Study) -> list[str]:
    if study.scenes[0].body.brep is None:
        return []
    from tcstudy.study.built_body import built_faults  # a file needs the geometry kernel, a polygon does not

    return [str(problem) for problem in located(study, built_faults(study))]


def _output_faults(study: Study, output: Path) -> list[str]:
    try:
        return check_writable(output, expected_bytes(study))
    except StoreError as error:
        return [str(error)]
