"""One fit to several tests: each is the study with other data and values; what one leaves open the other decides."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tcstudy.errors import StudyError
from tcstudy.read.study import read_study, read_study_text
from tcstudy.scene.study import Study
from tcstudy.study.fit import fit, model_of

BAR = """
parameters: {L: 150 mm}
body: {rectangle: {width: L, height: 2 mm, edges: {bottom: film}}}
boundary: {film: contact, right: {role: clamped, u_x: 0 mm, u_y: free}, top: free, left: free}
material: {E: 2 GPa, nu: 0, plane: stress}
friction: {law: linear, k: 20 GPa/m}
mesh: {maxh: 4 mm}
fit:
  data: {file: long.csv, columns: {boundary.right.u_x: "D [mm]", friction_resultant: "P [N/mm]"}}
  noise: {friction_resultant: 0.5 N/mm}
  starts: 1
  parameters:
    friction.k: {start: 20 GPa/m, within: [1 GPa/m, 100 GPa/m]}
    material.E: {start: 2 GPa, within: [1 GPa, 10 GPa]}
"""
SHORT = """  tests:
    - data: {file: short.csv, columns: {boundary.right.u_x: "D [mm]", friction_resultant: "P [N/mm]"}}
      with: {L: 10 mm}
"""
TRUE = np.array([10e9, 3e9])


def bars(folder: Path, text: str = BAR + SHORT) -> Study:
    """A bar on a film, whose pull at x = L takes √(k E H) tanh(√(k/(E H)) L) a length: of a long one the tanh is 1."""
    for name, L in (("long", 0.15), ("short", 0.01)):
        k, EH = TRUE[0], 2e-3 * TRUE[1]
        stiffness = np.sqrt(k * EH) * np.tanh(np.sqrt(k / EH) * L)
        rows = "".join(f"{D},{1e-6 * stiffness * D:.17g}\n" for D in (0.1, 0.2, 0.3, 0.4))
        (folder / f"{name}.csv").write_text("D [mm],P [N/mm]\n" + rows)
    return read_study_text(text, "fit.yaml", source=folder / "fit.yaml")


def test_tests_decide_together_what_none_decides_alone(tmp_path: Path) -> None:
    """The long bar alone knows k E only. Precisions of independent data add, each taken at the same numbers."""
    together = bars(tmp_path)
    found = fit(together)
    assert found.values["estimate"] == pytest.approx(TRUE, rel=0.03)  # the mesh's error
    assert found.attributes["not_determined"] == ""
    assert found.values["measured_column"].tolist() == [0] * 4 + [1] * 4
    assert found.attributes["measured"].endswith("friction_resultant in short.csv [N m-1]")
    assert found.attributes["data_file"] == "long.csv, short.csv"
    precision = np.zeros((2, 2))
    for one in (together, *together.tests):
        assert one.fit is not None
        rates = model_of(one, one.fit).compared(found.values["estimate"]).jacobian * found.values["estimate"]
        precision += rates.T @ rates
    assert found.values["covariance"] == pytest.approx(np.linalg.inv(precision), rel=1e-6)
    alone = fit(bars(tmp_path, BAR))
    assert "k" in alone.attributes["not_determined"]
    assert np.prod(alone.values["estimate"]) == pytest.approx(np.prod(TRUE), rel=0.06)


def test_what_is_wrong_with_a_test_is_said_at_its_place(tmp_path: Path) -> None:
    for old, new, said in (
        ("short.csv", "none.csv", "fit.yaml:16:7: fit.tests[0]: fit.data.file: none.csv"),
        ("with: {L: 10 mm}", "with: {M: 10 mm}", "fit.tests[0]"),
        ("columns: {boundary.right.u_x", "columns: {boundary.right.u_z", "fit.tests[0]: fit.data.columns"),
    ):
        with pytest.raises(StudyError) as info:
            bars(tmp_path, BAR + SHORT.replace(old, new))
        assert said in str(info.value).replace(f"{tmp_path}/", ""), str(info.value)


def test_the_same_test_twice_halves_the_covariance_also_along_a_path() -> None:
    """Distances to the curve through a snap-back; curves of two tests lie apart in the file."""
    config = Path(__file__).parents[2] / "configs" / "pull_fit.yaml"
    columns = '{boundary.grip.u_x: "Delta [mm]", friction_resultant: "P [N/mm]"}'
    again = f"fit.tests=[{{data: {{file: pull_fit.csv, columns: {columns}}}}}]"
    once, twice = (fit(read_study(config, ["mesh.maxh=10 mm", "fit.starts=1", *more])) for more in ([], [again]))
    assert twice.values["estimate"] == pytest.approx(once.values["estimate"], rel=1e-3)
    assert 2.0 * twice.values["covariance"] == pytest.approx(once.values["covariance"], rel=0.01)
    curve, folds = twice.values["curve_given"], twice.values["fold_vertex"]
    [gap] = np.isnan(curve).nonzero()[0].tolist()
    assert np.array_equal(curve[:gap], curve[gap + 1 :])
    assert np.array_equal(folds[: len(folds) // 2] + gap + 1, folds[len(folds) // 2 :])
