"""What a law was made of is told in the page, and every law is drawn."""

from pathlib import Path

import numpy as np
import pytest

import tcstudy
from tcstudy.laws import composed
from tcstudy.laws.shapes import SHAPES
from tcstudy.read.study import read_study_text
from tcstudy.reports.page import law_part
from tcstudy.reports.page.container import Container
from tcstudy.reports.page.law_part import drawn, node_part, spec
from tcstudy.reports.picture import read_picture

LAWS = [
    {"law": "tresca", "tau": 4e7},
    {"law": "slip-weakening", "tau_s": 4e7, "tau_k": 1e7, "delta": 4e-5},
    {"law": "exponential", "a": 4e7, "b": 1e7, "delta": 1.5e-5},
    {"law": "saw-tooth", "tau": 3.0, "delta": 0.1, "teeth": 4, "drop": 0.6, "decay": 0.8},
    {"law": "saw-tooth", "tau": 3.0, "delta": 0.1, "teeth": 1, "drop": 0.6, "decay": 1.0},
    {"law": "linear", "k": 5e9},
]


@pytest.mark.parametrize("wanted", LAWS, ids=lambda one: one["law"])
def test_parameters_of_a_law_are_told(wanted: dict[str, object]) -> None:
    law = SHAPES[str(wanted["law"])].build(**{k: v for k, v in wanted.items() if k != "law"})
    found = spec(law)
    assert found is not None
    assert found["law"] == wanted["law"]
    assert {k: pytest.approx(v, rel=1e-12) for k, v in wanted.items() if k != "law"} == {
        k: v for k, v in found.items() if k != "law"
    }


def test_points_with_a_jump_are_told() -> None:
    points = [[0.0, 4.0], [1.0, 4.0], [1.0, 1.0], [2.0, 3.0]]
    found = spec(SHAPES["piecewise-linear"].build(points=points, slope=0.5))
    assert found == {"law": "piecewise-linear", "points": points, "slope": 0.5}


def test_laws_of_interfaces_are_told_by_their_points() -> None:
    """Those that `lawOf` does not know by name, as every shape is known by it or told so."""
    found = spec(SHAPES["bilinear"].build(tau=7e6, s0=4e-5, G_f=700.0).times(2.0))
    assert found is not None
    assert found["law"] == "piecewise-linear"
    assert found["slope"] == 0.0
    np.testing.assert_allclose(found["points"], [[0.0, 0.0], [4e-5, 1.4e7], [2e-4, 0.0]], rtol=1e-14)
    script = (Path(law_part.__file__).parent / "assets" / "laws.js").read_text(encoding="utf-8")
    known = script[script.index("const shapes = {") :]
    assert [name for name in SHAPES if f'{name}"(' not in known and f"    {name}(" not in known] == [
        *law_part.INTERFACES
    ]


def test_a_strength_scales_tractions_alone() -> None:
    law = SHAPES["slip-weakening"].build(tau_s=4e7, tau_k=1e7, delta=4e-5).times(0.5)
    assert spec(law) == {"law": "slip-weakening", "tau_s": 2e7, "tau_k": 5e6, "delta": 4e-5}


def test_a_law_that_is_not_odd_has_no_parameters_but_is_drawn() -> None:
    law = SHAPES["piecewise-linear"].build(points=[[-1.0, -2.0], [1.0, 5.0]], odd=False)
    assert spec(law) is None
    assert len(drawn(law)["curves"]) == len(law.kinks) + 1


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
    found = node_part(study, line, Container())
    (of_law,) = kept
    (joint,) = line.joints.node
    assert of_law.tolist() == [-1 if i == joint else int(x > 0.5) for i, x in enumerate(line.x)]
    assert found["strength_of"] == [0, 0, 0, 0]  # a number is in the law
    wanted = [1.0 if k else 1.0 + x for k, x in zip(of_law, line.x, strict=True)]
    assert found["strengths"][0].tolist() == pytest.approx(wanted)
