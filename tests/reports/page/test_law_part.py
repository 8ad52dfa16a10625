"""The pieces of a law, by which the page solves, and its curves."""

from pathlib import Path

import numpy as np
import pytest

import tcstudy
from tcstudy.laws import composed
from tcstudy.laws.shapes import SHAPES
from tcstudy.read.study import read_study_text
from tcstudy.reports.page.container import Container
from tcstudy.reports.page.law_part import drawn, node_part
from tcstudy.reports.page.stored import read
from tcstudy.reports.picture import read_picture
from tests.reports.figures.draw_cases import example_laws


def test_its_pieces_are_the_law() -> None:
    for law in example_laws():
        found = drawn(law)["pieces"]
        s = np.linspace(-3.0, 3.0, 61) * (law.s_scale or 1.0) + 1e-9 * (law.s_scale or 1.0)
        k = np.searchsorted(found["kinks"], s)
        s_0, b_0, q, a, r = (np.array(found[name])[k] for name in ("s0", "b0", "q", "a", "r"))
        np.testing.assert_allclose(b_0 + q * (s - s_0) + a * np.exp(-r * (s - s_0)), law.b(s), rtol=1e-12)


@pytest.mark.parametrize(("name", "parameters"), [("tresca", {"tau": 4e7}), ("linear", {"k": 5e9})])
def test_a_law_without_a_length_of_its_own_is_still_drawn(name: str, parameters: dict[str, float]) -> None:
    found = drawn(SHAPES[name].build(**parameters))
    assert found["reach"] == 0.0
    assert all(s[-1] > s[0] for s, _ in found["curves"])


EDGES = """
units: none
body: {outline: [{from: [0, 0], edge: film}, {from: [0.5, 0], edge: shoe}, {from: [1, 0], edge: right},
  {from: [1, 1], edge: top}, {from: [0, 1], edge: left}]}
boundary: {film: contact, shoe: contact, top: {role: clamped, u_x: 0.8, u_y: 0}, left: free, right: free}
material: {lambda: 1.5, mu: 1}
friction:
  film: {law: exponential, a: 0.3, b: 0.1, delta: 0.3, strength: 1 + x}
  shoe: {law: exponential, a: 0.3, b: 0.1, delta: 0.5}
mesh: {maxh: 0.25}
sweep: {boundary.top.u_x: [0.2, 0.4], friction.shoe.strength: [0.5, 0.25]}
"""


def test_strengths_by_point_and_a_joint_which_has_none(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    study = read_study_text(EDGES)
    tcstudy.run(study, tmp_path / "out.nc")
    line = read_picture(tmp_path / "out.nc", {"boundary_top_u_x": 0.2, "strength": 0.5}, 0).line
    monkeypatch.setattr(composed, "total", None)  # no mixture is made for what is not drawn
    kept: list[np.ndarray] = []
    monkeypatch.setattr(Container, "array", lambda _, values, kind="": kept.append(np.array(values)))
    monkeypatch.setattr(Container, "rows", lambda _, rows: np.array(rows))
    found = node_part(read(tmp_path / "out.nc"), line, Container())
    (of_law,) = kept
    (joint,) = line.joints.node
    assert of_law.tolist() == [-1 if i == joint else int(x > 0.5) for i, x in enumerate(line.x)]
    assert found["strength_of"] == [0, 0, 0, 0]  # a number is in the law
    wanted = [1.0 if k else 1.0 + x for k, x in zip(of_law, line.x, strict=True)]
    assert found["strengths"][0].tolist() == pytest.approx(wanted)
