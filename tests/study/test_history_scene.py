"""Derivatives stored with the steps of a history: against whole histories of other numbers, and gone on from a file."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tcstudy.data.on_request import DIFFERENTIABLE, name_of
from tcstudy.errors import StudyError
from tcstudy.read.study import read_study_text
from tests.study.test_history_run import SOFT, followed

NUMBERS = {"friction.tau_s": 20e6, "friction.delta": 1e-3, "E": 210e9, "history.stiffness": 500e9}
ASKED = f"output.sensitivity=[{', '.join(NUMBERS)}]"
HISTORY = "{memory: elastic-plastic, stiffness: 500 GPa/m, steps: [{theta: 60 K, in: 2}, {theta: -30 K, in: 2}]}"


def test_derivatives_of_steps_against_histories_and_gone_on_from_a_file(tmp_path: Path) -> None:
    data = followed(tmp_path, SOFT, HISTORY, ASKED)
    assert data["sensitivity_status"].values.tolist() == [DIFFERENTIABLE] * 5
    quantities = ("u_T_max", "friction_resultant")
    for name, value in NUMBERS.items():
        ends = []
        for h in (1e-4, -1e-4):
            other = followed(tmp_path, SOFT, HISTORY, f"{name}={value * (1.0 + h)!r}", name=f"{name}{h}.nc")
            ends.append(np.array([other[q].values for q in quantities]))
        exact = np.array([data[name_of(q, name)].values for q in quantities])
        apart = (ends[0] - ends[1]) / (2e-4 * value)
        assert exact == pytest.approx(apart, abs=2e-6 * np.max(np.abs(apart)) + 1e-9 * np.max(np.abs(exact)))
        assert np.all(exact[:, 0] == 0.0)
    grown = followed(tmp_path, SOFT, HISTORY.replace("]}", ", {theta: 50 K}]}"), ASKED)
    whole = followed(tmp_path, SOFT, HISTORY.replace("]}", ", {theta: 50 K}]}"), ASKED, name="whole.nc")
    assert grown.sizes["step"] == 6
    assert np.isfinite(grown["sensitivity_u_T_max_history_stiffness"].values).all()
    for name in data:
        if name.startswith("sensitivity"):
            assert np.array_equal(grown[name].values, whole[name].values), name


def test_a_load_of_the_history_is_no_number_of_it() -> None:
    with pytest.raises(StudyError, match=r"theta is what the history changes, so it is known; remove it"):
        read_study_text(f"{SOFT}history: {HISTORY}\n", overrides=["output.sensitivity=[theta]"])
