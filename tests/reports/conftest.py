"""Result files that the tests of pictures share."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from tests.reports.draw_cases import (
    ALPHA,
    TAU,
    result,
)


@pytest.fixture(scope="module")
def grid(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return result(tmp_path_factory.mktemp("grid") / "plate.nc")


@pytest.fixture(scope="module")
def listed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    alpha = replace(ALPHA, values=(25, 100, 25), labels=(25.0, 100.0, 25.0))
    tau = replace(TAU, values=(1, 2, 3), labels=(1e6, 1e6, 2e7))
    return result(tmp_path_factory.mktemp("list") / "plate.nc", "list", (alpha, tau))
