"""Damaged files, read in one process; the benchmark of the same name has more, and unsealed flipped bytes."""

from __future__ import annotations

from typing import Any

import pytest

from tcstudy.data import reading
from tcstudy.data.reading import Unreadable, read_all
from tests.benchmarks import damaged


def read_here(file: object) -> tuple[dict[str, Any], Any]:
    """As the child does: no edit that the library made itself crashes it."""
    try:
        return read_all(str(file))
    except Exception as error:
        raise Unreadable(str(error)) from error


def test_no_damaged_file_is_a_traceback(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(reading, "_probed", read_here)
    assert damaged.measure(120, 7, damaged.WAYS, drawn=0.03) == {}
