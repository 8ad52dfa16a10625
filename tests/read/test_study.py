"""Sound studies: the quickstart in SI, the forms of every section, heat by edge, named numbers,
sweeps, options."""

from pathlib import Path

import pytest

from tcstudy.errors import StudyError
from tcstudy.expressions.expression import parse
from tcstudy.read.study import read_study, read_study_text
from tcstudy.scene.mesh_plan import MeshPlan
from tcstudy.scene.points import needs_heat_solve
from tcstudy.scene.records import (
    Clamped,
    Contact,
    Convection,
    EdgeHeat,
    Free,
    Heat,
    Rigid,
    Role,
    Symmetry,
    Traction,
)
from tcstudy.scene.solver_plan import SolverPlan
from tcstudy.scene.study import Exact, OutputPlan, Study

QUICKSTART = Path(__file__).parents[2] / "configs" / "quickstart.yaml"

PLAIN = """\
body: {rectangle: {width: 2, height: 1}}
boundary: {bottom: contact, right: convection, top: free, left: clamped}
material: {E: 100, nu: 0.25, k: 2, alpha_T: 0.01}
heat: {alpha: 3, theta_bar: 4}
friction: {law: slip-weakening, tau_s: 5, tau_k: 1, delta: 0.1}
mesh: {maxh: 0.5}
"""


def plain(*changes: tuple[str, str], more: str = "", overrides: tuple[str, ...] = ()) -> Study:
    text = PLAIN
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    return read_study_text(text + more, overrides=overrides)


def test_quickstart_scenes_in_si_and_in_c_order_of_the_axes() -> None:
    study = read_study(QUICKSTART)
    scene = study.scenes[4 + 1]  # alpha 100, theta_bar 10, softening
    assert scene.heat == Heat(None, 100.0, 10.0, 5e5, ("heater",))
    roles = (
        ("film", Contact()),
        ("bolted", Clamped()),
        ("top", Convection()),
        ("end", Convection((2e6, 0.0), 0.0)),
    )
    assert scene.boundary == (*roles, ("bore", Free()))
    m = scene.material
    assert (m.E, m.nu, m.k, m.plane) == (210e9, 0.3, 45.0, "strain")
    assert m.beta == pytest.approx(
        6.3e6, rel=1e-14
    )  # (3 lam + 2 mu) alpha_T = E alpha_T/(1 − 2 nu)
    outline = scene.body.outline
    assert [edge.name for edge in outline.edges] == ["film", "end", "top", "top", "bolted"]
    assert scene.body.holes[0].edges[0].start == (0.075, 0.07)
    assert scene.friction.kinks.tolist() == [-40e-6, 0.0, 40e-6]
    order = [(s.heat.alpha, s.heat.theta_bar, s.friction.name) for s in study.scenes]
    laws = ("tresca", "slip-weakening", "exponential", "piecewise-linear")
    assert order == [
        (a, t, law) for a in (100.0, 200.0, 400.0) for t in (0.0, 10.0, 20.0) for law in laws
    ]
    assert [
        len({id(getattr(s, part)) for s in study.scenes}) for part in ("body", "friction", "heat")
    ] == [1, 4, 9]


def test_plane_stress_and_lame_moduli() -> None:
    m = plain(("nu: 0.25", "nu: 0.25, plane: stress")).scenes[0].material
    assert m.lam == pytest.approx(100 * 0.25 / (1 - 0.25**2))  # lam of plane stress: E nu/(1 − nu²)
    assert m.beta == pytest.approx(100 * 0.01 / 0.75)
    m = plain(("E: 100, nu: 0.25", "lambda: 40, mu: 40")).scenes[0].material
    assert (m.E, m.nu, m.lam, m.mu) == pytest.approx((100.0, 0.25, 40.0, 40.0))


def test_a_given_beta_is_that_of_the_body_as_lambda_is() -> None:
    """(3 lam + 2 mu) alpha_T gives the same plane problem as alpha_T, in strain and in stress."""
    for plane in ("strain", "stress"):
        by_alpha = plain(("nu: 0.25", f"nu: 0.25, plane: {plane}")).scenes[0].material
        bulk = 100 * 0.01 / (1 - 2 * 0.25)
        given = plain(("alpha_T: 0.01", f"plane: {plane}, beta: {bulk}")).scenes[0].material
        assert given.beta == pytest.approx(by_alpha.beta, rel=1e-14)
        assert given.with_number(2 * bulk, "beta").beta == pytest.approx(2 * given.beta, rel=1e-14)
        assert given.with_number(50.0, "E").bulk_beta == bulk


@pytest.mark.parametrize(
    ("edge", "text", "role"),
    [
        ("left", "{role: clamped, u: [1 mm, free]}", Clamped((1e-3, None))),
        ("left", "{role: clamped, u_y: '1e-3*y', u_x: 2}", Clamped((2.0, parse("1e-3*y")))),
        ("left", "{role: clamped, u_N: 1 um}", Clamped((1e-6, None), "nt")),
        ("right", "{role: convection, pressure: 2 MPa}", Convection((0.0, 0.0), 2e6)),
        # a constant expression is a number
        ("top", "{role: traction, g: [0, '2*3']}", Traction((0.0, 6.0), 0.0)),
        ("top", "{role: traction, force: [3 kN/m, 0], spring: {normal: 2}}",
         Traction(force=(3e3, 0.0), spring=(2.0, 0.0))),
        ("top", "symmetry", Symmetry()),
        ("top", "{role: rigid, u_y: 0, force: [5 N/m, 0]}", Rigid((None, 0.0), force=(5.0, 0.0))),
    ],
)  # fmt: skip
def test_roles(edge: str, text: str, role: Role) -> None:
    [old] = [
        line
        for line in (f"{edge}: {word}" for word in ("clamped", "convection", "free"))
        if line in PLAIN
    ]
    assert dict(plain((old, f"{edge}: {text}")).scenes[0].boundary)[edge] == role


def test_heat_loads_exact_solutions_and_plans() -> None:
    free = (
        ("heat: {alpha: 3, theta_bar: 4}", "heat: {theta: '20*x'}"),
        ("right: convection", "right: free"),
    )
    study = plain(*free, more="loads: {f: [0, -77 kN/m^3]}\nsolver: bundle-newton\noutput: out.nc\ntitle: T\n"
                  'exact: {u: ["0.1*x", 0], theta: 3, xi: "2*x", exponent: 1.5}\n')  # fmt: skip
    assert (str(study.scenes[0].heat.theta), study.scenes[0].f, study.title) == (
        "20*x",
        (0.0, -77e3),
        "T",
    )
    assert (study.solver, study.output) == (
        SolverPlan(("bundle-newton",)),
        OutputPlan(Path("out.nc")),
    )
    assert study.exact == Exact((parse("0.1*x"), 0.0), 3.0, parse("2*x"), 1.5)
    study = plain(
        more="solver: {name: bundle-newton, tolerance: 1e-8, max_iterations: 7}\noutput: {fields: true}\n"
    )
    assert study.solver == SolverPlan(("bundle-newton",), tolerance=1e-8, max_iterations=7)
    assert study.output == OutputPlan(None, True)


def test_spaced_values() -> None:
    for values, labels in (
        ("{linspace: [1 kW/(m^2*K), 2000, 3]}", (1000.0, 1500.0, 2000.0)),
        (
            "[1e-3, '2e-3', 3, 4.5 W/(m^2*K), '2*3', 0.1 kW/(m^2*K)]",
            (1e-3, 2e-3, 3.0, 4.5, 6.0, 100.0),
        ),
        ("{geomspace: [1, 10000, 5]}", (1.0, 10.0, 100.0, 1000.0, 10000.0)),
        ("{linspace: [0.1, 0.3, 3]}", (0.1, 0.2, 0.3)),
    ):
        study = plain(more=f"sweep: {{alpha: {values}}}\n")
        assert study.axes[0].labels == tuple(scene.heat.alpha for scene in study.scenes) == labels


def test_zip_and_list() -> None:
    zipped = plain(more="sweep: {mode: zip, alpha: [1, 2, 2], delta: [1, 1, 3 mm]}\n")
    assert (zipped.mode, zipped.shape) == ("list", (3,))
    assert [(s.heat.alpha, s.friction.kinks[-1]) for s in zipped.scenes] == [
        (1.0, 1.0),
        (2.0, 1.0),
        (2.0, 3e-3),
    ]
    points = "[{q: 1, alpha: 1}, {alpha: 2, q: 1}, {q: 2, alpha: 2}]"
    listed = plain(more=f"sweep: {{mode: list, points: {points}}}\n")
    assert [(s.heat.q, s.heat.alpha) for s in listed.scenes] == [(1.0, 1.0), (1.0, 2.0), (2.0, 2.0)]
    laws = "[{friction: {law: linear, k: 1}}, {friction: {soft: {law: tresca, tau: 1}}}]"
    study = plain(more=f"sweep: {{mode: list, points: {laws}}}\n")
    assert study.axes[0].labels == ("linear", "soft")
    assert [s.friction.name for s in study.scenes] == ["linear", "tresca"]


def test_axes_of_texts_edges_components_points_and_equal_names() -> None:
    study = plain(
        ("right: convection", "right: {role: convection, pressure: 1}"),
        more="sweep: {theta_bar: [1, '20*x'], boundary.right.pressure: [1 MPa, 2], boundary.left.u_x: [0, 1 mm],"
        " loads.f: [[0, 1], [0, 2 kN/m^3]], boundary.right.g_y: [0, 3]}\n",
    )
    axes = {axis.name: axis for axis in study.axes}
    assert list(axes) == ["theta_bar", "pressure", "u_x", "f", "g_y"]
    assert (axes["theta_bar"].labels, axes["theta_bar"].units) == (("1", "20*x"), "1")
    assert (axes["pressure"].labels, axes["pressure"].units) == ((1e6, 2.0), "Pa")
    assert axes["f"].values == ([0, 1], [0, "2 kN/m^3"])
    last = study.scenes[-1]
    assert (last.f, dict(last.boundary)["right"]) == ((0.0, 2e3), Convection((0.0, 3.0), 2.0))
    assert dict(last.boundary)["left"] == Clamped((1e-3, 0.0))  # u_y stays prescribed
    study = plain(
        ("top: free", "top: {role: traction, pressure: 1}"),
        (
            "law: slip-weakening, tau_s: 5, tau_k: 1, delta: 0.1",
            "law: piecewise-linear, points: [[0, 5], [0.1, 1]]",
        ),
        more="sweep: {boundary.right.pressure: [1, 2], boundary.top.pressure: [1, 2], friction.points.1.s: [0.2, 0.3]}",
    )
    assert [axis.name for axis in study.axes] == [
        "boundary_right_pressure",
        "boundary_top_pressure",
        "points_1_s",
    ]
    assert [float(scene.friction.kinks[-1]) for scene in study.scenes[:2]] == [0.2, 0.3]


def test_swept_keys_need_not_be_given_twice() -> None:
    study = plain(
        *(
            ("friction: {law: slip-weakening, tau_s: 5, tau_k: 1, delta: 0.1}\n", ""),
            ("E: 100, ", ""),
        ),
        more="sweep: {friction: {a: {law: tresca, tau: 1}, b: {law: linear, k: 1}}, E: [1, 2]}\n",
    )
    found = [(s.friction.name, s.material.E) for s in study.scenes]
    assert found == [("tresca", 1.0), ("tresca", 2.0), ("linear", 1.0), ("linear", 2.0)]


def test_a_list_of_sizes_is_no_axis_but_the_meshes() -> None:
    study = plain(("maxh: 0.5", "maxh: [0.5, 0.2, 100 mm]"))
    assert (study.axes, study.mesh, study.mesh.nested) == ((), MeshPlan((0.5, 0.2, 0.1), 3), False)


def test_overrides() -> None:
    said = (
        "alpha=7",
        "boundary.right.pressure=2 MPa",
        "mesh={maxh: 0.25, levels: 2}",
        "boundary.right.g_x=3",
    )
    study = plain(overrides=said)
    assert (study.scenes[0].heat.alpha, study.mesh, study.overrides) == (
        7.0,
        MeshPlan((0.25,), 2),
        said,
    )
    assert dict(study.scenes[0].boundary)["right"] == Convection((3.0, 0.0), 2e6)
    given = ["sweep=null", "friction.delta=10 um", "body.holes[0].circle.radius=10 mm"]
    assert len(read_study(QUICKSTART, given).scenes) == 1
    assert read_study(QUICKSTART, ["sweep.alpha=[1, 2]"]).shape == (2, 3, 4)
    with pytest.raises(StudyError, match=r"; k is material\.k here, not friction\.k$"):
        plain(overrides=("units=SI", "friction={law: linear, k: 1 GPa/m}", "sweep={k: [1 GPa/m]}"))


BY_EDGE = """
parameters: {mu: 0.3, p: 2 MPa, v: 0.5 m/s, h: 50 W/(m^2*K)}
body: {rectangle: {width: 1, height: 0.4}}
boundary:
  bottom: {role: contact, heat: {flux: "mu*p*v"}}
  left: {role: clamped, heat: {theta: 80 K}}
  right: {role: convection, alpha: "2*h", theta_bar: 20 K}
  top: free
material: {E: 210 GPa, nu: 0.3, k: 45 W/(m*K), alpha_T: 12e-6 1/K}
friction: {law: tresca, tau: 20 MPa}
mesh: {maxh: 0.2}
"""


def test_role_and_heat_of_an_edge_are_two_things() -> None:
    scene = read_study_text(BY_EDGE).scenes[0]
    assert (scene.flux, scene.held_theta) == ((("bottom", pytest.approx(3e5)),), (("left", 80.0),))
    assert (scene.exchange, dict(scene.boundary)["top"].heat) == ((("right", 100.0, 20.0),), None)
    assert needs_heat_solve(scene)
    mixed = BY_EDGE.replace("theta_bar: 20 K}", "flux: 7 W/m^2}") + "heat: {theta_bar: 5 K}\n"
    scene = read_study_text(mixed).scenes[0]
    assert scene.exchange == (("right", 100.0, 5.0),)
    assert dict(scene.boundary)["right"].heat == EdgeHeat(None, 7.0, 100.0)
    alike = BY_EDGE.replace("{theta: 80 K}", "{theta: 20 K}").replace('"mu*p*v"', "0")
    assert not needs_heat_solve(read_study_text(alike).scenes[0])  # one temperature everywhere
    study = read_study_text(
        BY_EDGE
        + "sweep: {boundary.left.heat.theta: [60 K, 80 K], boundary.right.alpha: [1, 2], mu: [1, 2]}"
    )
    assert [axis.name for axis in study.axes] == ["theta", "alpha", "mu"]
    last = study.scenes[7]
    assert (last.held_theta[0][1], last.exchange[0][1], last.flux[0][1]) == (
        80.0,
        2.0,
        pytest.approx(2e6),
    )


NAMED = """
parameters: {height: 1 m, width: "2*height", load: 1 MPa, share: 0.5}
body: {rectangle: {width: width, height: "sqrt(height*width/2)"}}
boundary: {bottom: contact, left: clamped, right: free,
  top: {role: traction, g: ["load*sin(pi*x/width)", "-share*load"]}}
material: {E: "1000*load", nu: 0.3}
friction: {law: tresca, tau: "min(load, 2*load)"}
mesh: {maxh: "height/2"}
"""


def named(*overrides: str, text: str = NAMED) -> Study:
    return read_study_text(text, "test", overrides)


def test_expressions_take_names_and_carry_their_units() -> None:
    (scene,) = named().scenes
    text = (
        NAMED.replace(NAMED.splitlines()[1], "")
        .replace('"sqrt(height*width/2)"', "1")
        .replace("height/2", "1/2")
    )
    text = (
        text.replace("width: width", "width: 2")
        .replace("pi*x/width", "pi*x/2")
        .replace("share", "0.5")
    )
    (other,) = named(text=text.replace("load", "1e6")).scenes
    assert (scene.body, scene.material, scene.friction) == (
        other.body,
        other.material,
        other.friction,
    )
    (g, _), (h, _) = (dict(one.boundary)["top"].g for one in (scene, other))
    assert g.evaluate(0.3, 0.0) == h.evaluate(0.3, 0.0)  # type: ignore[union-attr]


def test_a_swept_name_acts_in_every_section_that_uses_it_and_in_names_that_follow_from_it() -> None:
    study = named("sweep={load: [1 MPa, 3 MPa], nu: [0.2, 0.3]}", "share=0.5")  # by the bare names
    assert [(axis.name, axis.units) for axis in study.axes] == [("load", "Pa"), ("nu", "1")]
    values = [
        (s.material.nu, dict(s.boundary)["top"].g[1], float(s.friction.b(1.0)))
        for s in study.scenes
    ]
    assert values == [(nu, -0.5 * load, load) for load in (1e6, 3e6) for nu in (0.2, 0.3)]
    drawn = "sweep={parameters.load: {uniform: [1 MPa, 2 MPa]}, mode: random, points: 3}"
    study = named("parameters.other=load/4", "friction.tau=other", drawn)
    assert [4.0 * float(s.friction.b(1.0)) for s in study.scenes] == list(study.axes[0].labels)


def test_a_name_of_the_study_goes_before_a_short_name_of_the_program() -> None:
    text = NAMED.replace(
        "share: 0.5", "share: 0.5, s1: 0.2 m"
    )  # called as a parameter of another law
    points = "friction={law: piecewise-linear, points: [[0 m, 0 Pa], [s1, 5 Pa]]}"
    studies = [named(points, more, text=text) for more in ("s1=0.3 m", "sweep={s1: [1 m, 2 m]}")]
    kinks = [[float(scene.one_law.kinks[-1]) for scene in study.scenes] for study in studies]
    assert kinks == [[0.3], [1.0, 2.0]]
    pulled = [
        named(more, text=NAMED.replace("load", "f_x"))
        for more in ("f_x=3 MPa", "sweep={f_x: [1 MPa, 2 MPa]}")
    ]
    assert [[scene.material.E for scene in study.scenes] for study in pulled] == [
        [3e9],
        [1e9, 2e9],
    ]  # no component


def test_places_of_faults_are_in_the_unit_of_the_study() -> None:
    hole = "holes: [{circle: {center: [100 U, 100 U], radius: 15 U, edge: bore}}]"
    for unit, words in (("mm", "at (115, 100) mm;"), ("in", "at (115, 100) in;"), ("", ") m;")):
        text = f"body: {{rectangle: {{width: 200 U, height: 100 U}}, {hole}}}\n"
        with pytest.raises(StudyError, match="crosses the outline") as fault:
            read_study_text(text.replace("U", unit))
        assert words in str(fault.value)
