"""Named numbers: values, units carried or refused, circles, swept names."""

from __future__ import annotations

from tcstudy.read.study import read_study_text
from tcstudy.scene.study import Study

TEXT = """
parameters: {height: 1 m, width: "2*height", load: 1 MPa, share: 0.5}
body: {rectangle: {width: width, height: "sqrt(height*width/2)"}}
boundary: {bottom: contact, left: clamped, right: free,
  top: {role: traction, g: ["load*sin(pi*x/width)", "-share*load"]}}
material: {E: "1000*load", nu: 0.3}
friction: {law: tresca, tau: "min(load, 2*load)"}
mesh: {maxh: "height/2"}
"""


def of(*overrides: str) -> Study:
    return read_study_text(TEXT, "test", overrides)


def test_expressions_take_names_and_carry_their_units() -> None:
    (scene,) = of().scenes
    plain = TEXT.replace(TEXT.splitlines()[1], "").replace('"sqrt(height*width/2)"', "1").replace("height/2", "1/2")
    plain = plain.replace("width: width", "width: 2").replace("pi*x/width", "pi*x/2").replace("share", "0.5")
    (other,) = read_study_text(plain.replace("load", "1e6"), "test").scenes
    assert scene.body == other.body
    assert (scene.material, scene.friction) == (other.material, other.friction)
    (g, _), (h, _) = (dict(one.boundary)["top"].g for one in (scene, other))  # type: ignore[union-attr]
    assert g.evaluate(0.3, 0.0) == h.evaluate(0.3, 0.0)


def test_a_swept_name_acts_in_every_section_that_uses_it() -> None:
    study = of("sweep={load: [1 MPa, 3 MPa], nu: [0.2, 0.3]}", "share=0.5")  # by the bare names
    assert [(axis.name, axis.units) for axis in study.axes] == [("load", "Pa"), ("nu", "1")]
    values = [(s.material.nu, dict(s.boundary)["top"].g[1], float(s.friction.b(1.0))) for s in study.scenes]  # type: ignore[union-attr]
    expected = [(nu, -0.5 * load, load) for load in (1e6, 3e6) for nu in (0.2, 0.3)]
    assert values == expected


def test_a_name_of_the_study_goes_before_a_short_name_of_the_program() -> None:
    """An abscissa of a law's points, called as a parameter of another law."""
    text = TEXT.replace("share: 0.5", "share: 0.5, s1: 0.2 m")
    points = "friction={law: piecewise-linear, points: [[0 m, 0 Pa], [s1, 5 Pa]]}"
    studies = [read_study_text(text, "test", (points, more)) for more in ("s1=0.3 m", "sweep={s1: [1 m, 2 m]}")]
    kinks = [[float(scene.one_law.kinks[-1]) for scene in study.scenes] for study in studies]
    assert kinks == [[0.3], [1.0, 2.0]]


def test_a_name_that_follows_from_a_swept_one_follows_it() -> None:
    study = of(
        "parameters.other=load/4",
        "friction.tau=other",
        "sweep={parameters.load: {uniform: [1 MPa, 2 MPa]}, mode: random, points: 3}",
    )
    assert [float(s.friction.b(1.0)) for s in study.scenes] == [load / 4 for load in study.axes[0].labels]  # type: ignore[operator]
