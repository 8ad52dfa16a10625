"""Bad studies: each gives one error, at its place, that says what is wrong."""

from pathlib import Path

import pytest

from tcstudy.errors import StudyError
from tcstudy.scene.reader import read_study, read_study_text

BASE = """\
body:
  outline:
    - {from: [0, 0], edge: bottom}
    - {from: [2, 0], edge: right}
    - {from: [2, 1], edge: top}
    - {from: [0, 1], edge: left}
  regions:
    hot: {circle: {center: [1, 0.5], radius: 0.2}}
boundary:
  bottom: contact
  right: convection
  top: {role: traction, g: [0, -1 MPa]}
  left: clamped
material: {E: 210 GPa, nu: 0.3, k: 45 W/(m*K), alpha_T: 12e-6 1/K}
heat: {alpha: 100 W/(m^2*K), theta_bar: 20 K, q: 5e6, omega: hot}
friction: {law: slip-weakening, tau_s: 20 MPa, tau_k: 5 MPa, delta: 40 um}
mesh: {maxh: 0.2, levels: 2}
sweep:
  alpha: [25, 100]
  delta: [20 um, 40 um]
"""
# old text, new text, line:column, key, part of the message
FAULTS = [
    ("material:", "materal:", "14:1", "materal", "did you mean 'material'?"),
    ("{E: 210 GPa, nu", "{E: 210 GPa, nuu", "14:24", "material.nuu", "did you mean 'nu'?"),
    ("E: 210 GPa", "E: [1, 2]", "14:15", "material.E", "must be a stress, but is a list of 2"),
    ("E: 210 GPa", "E: true", "14:15", "material.E", "must be a stress, but is the truth value true"),
    ("E: 210 GPa", "E: .nan", "14:15", "material.E", "nan is not a finite number"),
    ("E: 210 GPa", "E: -3", "14:15", "material.E", "must be greater than 0, but is -3"),
    ("E: 210 GPa", "E: 210 kg", "14:15", "material.E", "'kg' is not a unit of a stress (Pa)"),
    ("E: 210 GPa", "E: 210 Gpa", "14:15", "material.E", "did you mean 'GPa'? Units are case-sensitive"),
    ("E: 210 GPa", "E: 210 2000*x", "14:15", "material.E", "'2000*x' is not a unit"),
    ("E: 210 GPa", "E: 1e9*x", "14:15", "material.E", "may not vary with x and y"),
    ("E: 210 GPa,", "", "14:11", "material.E", "is missing"),
    ("E: 210 GPa", "E: 210 GPa, E: 200 GPa", "14:24", "material.E", "the key is given twice (first in line 14)"),
    ("E: 210 GPa", "lambda: 5 GPa", "14:20", "material.lambda", "the material is given in two ways"),
    ("nu: 0.3", "nu: 0.5", "14:28", "material.nu", "must lie between -1 and 0.5, but is 0.5"),
    ("nu: 0.3", "nu: -1", "14:28", "material.nu", "must lie between -1 and 0.5, but is -1"),
    ("nu: 0.3", 'nu: "a third"', "14:28", "material.nu", "'a third' is not a plain number"),
    ("nu: 0.3", "nu:", "14:24", "material.nu:", "did you mean 'nu'?"),
    ("nu: 0.3", "nu: 1e999", "14:28", "material.nu", "inf is not a finite number"),
    (
        "nu: 0.3,",
        "nu: 0.3, plane: flat,",
        "14:40",
        "material.plane",
        "must be one of strain, stress, but is the text 'flat'",
    ),
    ("k: 45 W/(m*K),", "", "14:11", "material.k", "is missing, but heat needs it"),
    ("k: 45 W/(m*K)", "k: 0", "14:36", "material.k", "must be greater than 0, but is 0"),
    ("alpha_T: 12e-6 1/K", "alpha_T: 12e-6 1/K, beta: 5", "14:74", "material.beta", "both alpha_T and beta are given"),
    (
        "top: {role: traction, g: [0, -1 MPa]}",
        "tpo: {role: traction, g: [0, -1 MPa]}",
        "12:3",
        "boundary.tpo",
        "did you mean 'top'?",
    ),
    ("  left: clamped\n", "", "10:3", "boundary.left", "the edge has no role"),
    ("left: clamped", "left: clampd", "13:9", "boundary.left", "did you mean 'clamped'?"),
    (
        "left: clamped",
        "left: {role: clamped, u_x: 0, u_N: 0}",
        "13:9",
        "boundary.left",
        "the displacement is given in two ways",
    ),
    (
        "left: clamped",
        "left: {role: clamped, u: [free, free]}",
        "13:9",
        "boundary.left",
        "both components are free, so nothing is clamped",
    ),
    ("left: clamped", "left: free", "10:3", "boundary", "no edge is clamped and contact does not hold "),
    ("left: clamped", "left: {u: [0, 0]}", "13:9", "boundary.left.role", "is missing"),
    (
        "left: clamped",
        "left: {role: clamped, u: [0]}",
        "13:28",
        "boundary.left.u",
        "must be a pair of displacements, but is a list of 1",
    ),
    ("left: clamped", "left: {role: clamped, g: [0, 0]}", "13:25", "boundary.left.g", "unknown key"),
    (
        "left: clamped",
        "left: clamped\n  bottom: free",
        "14:3",
        "boundary.bottom",
        "the key is given twice (first in line 10)",
    ),
    ("left: clamped", "left: clamped\n  bottm: free", "14:3", "boundary.bottm", "did you mean 'bottom'?"),
    (
        "bottom: contact",
        "bottom: clamped",
        "10:3",
        "boundary",
        "no edge is in contact, so there is no friction to study",
    ),
    (
        "g: [0, -1 MPa]",
        "g: [0, -1 MPa, 0]",
        "12:28",
        "boundary.top.g",
        "must be a pair of components, but is a list of 3",
    ),
    ("g: [0, -1 MPa]", 'g: ["sin(z)", 0]', "12:29", "boundary.top.g[0]", "unknown name 'z'"),
    ("g: [0, -1 MPa]", 'g: [0, "1 MPa*x"]', "12:32", "boundary.top.g[1]", "'MPa*x' is not a known unit"),
    (", g: [0, -1 MPa]", "", "12:8", "boundary.top", "a traction edge needs g or pressure"),
    (
        "right: convection",
        "right: free",
        "15:15",
        "heat.alpha",
        "no edge has the role convection, so alpha acts nowhere",
    ),
    ("edge: right", "edge: a b", "4:28", "body.outline[1].edge", "must be an edge name of letters, digits and _"),
    ("edge: right", "edg: right", "4:22", "body.outline[1].edg", "did you mean 'edge'?"),
    ("{from: [2, 0], edge: right}", "{edge: right}", "4:7", "body.outline[1].from", "is missing"),
    ("[2, 1]", "[2, x]", "5:18", "body.outline[2].from[1]", "may not vary with x and y"),
    ("radius: 0.2", "radius: -0.2", "8:46", "body.regions.hot.circle.radius", "must be greater than 0, but is -0.2"),
    ("{circle: {center: [1, 0.5], radius: 0.2}}", "{}", "8:10", "body.regions.hot", "needs one shape, not 0"),
    (
        "{circle: {center: [1, 0.5], radius: 0.2}}",
        "{cirle: {center: [1, 0.5], radius: 0.2}}",
        "8:11",
        "body.regions.hot.cirle",
        "did you mean 'circle'?",
    ),
    ("alpha: 100 W/(m^2*K)", "alpha: -1", "15:15", "heat.alpha", "must be 0 or more, but is -1"),
    ("alpha: 100 W/(m^2*K)", "alpha: 0", "15:15", "heat.alpha", "with alpha = 0 the heat of q cannot leave the"),
    ("theta_bar: 20 K", "theta_bar: 20 degC", "15:41", "heat.theta_bar", "'degC' has its own zero"),
    ("theta_bar: 20 K", "theta_bar: 20 + 3*", "15:41", "heat.theta_bar", "the expression ends with *"),
    (
        "theta_bar: 20 K",
        "theta_bar: 20 K, theta: 5",
        "15:54",
        "heat.theta",
        "theta is the known temperature, so alpha, the",
    ),
    ("omega: hot", "omega: htt", "15:62", "heat.omega", "did you mean 'hot'?"),
    ("omega: hot", "omega: []", "15:62", "heat.omega", "must name regions of the body, but is an empty list"),
    ("law: slip-weakening", "law: slip weakening", "16:17", "friction.law", "did you mean 'slip-weakening'?"),
    ("law: slip-weakening,", "", "16:11", "friction.law", "is missing"),
    ("delta: 40 um}", "delta: 0}", "16:69", "friction.delta", "must be above 0, not 0"),
    ("delta: 40 um}", "delta: 40 MPa}", "16:69", "friction.delta", "'MPa' is not a unit of a length (m)"),
    ("tau_k: 5 MPa", "tau_d: 5 MPa", "16:48", "friction.tau_d", "did you mean 'tau_k'?"),
    (
        "friction: {law: slip-weakening, tau_s: 20 MPa, tau_k: 5 MPa, delta: 40 um}",
        "friction: tresca",
        "16:11",
        "friction",
        "must be a mapping, but is the text 'tresca'",
    ),
    ("maxh: 0.2", "maxh: 0", "17:14", "mesh.maxh", "must be greater than 0, but is 0"),
    ("maxh: 0.2", "maxh: 1 um", "17:14", "mesh.maxh", "about 10^13.3 triangles are more than a study can use"),
    ("maxh: 0.2", "maxh: 5", "17:14", "mesh.maxh", "an element of 5 is larger than the body (2.23607)"),
    ("maxh: 0.2", "maxh: [0.2, 0.3]", "17:20", "mesh.maxh[1]", "0.3 does not decrease after 0.2"),
    ("maxh: 0.2", "maxh: [0.2, 0.1]", "17:26", "mesh.levels", "levels go with a single maxh"),
    ("maxh: 0.2", "maxh: []", "17:14", "mesh.maxh", "must be a list of sizes, but is an empty list"),
    ("levels: 2", "levels: 0", "17:27", "mesh.levels", "must be from 1 to 15, but is 0"),
    ("levels: 2", "levels: 2.5", "17:27", "mesh.levels", "must be a whole number, but is the number 2.5"),
    ("levels: 2", "levels: 14", "17:14", "mesh.maxh", "about 10^9.9 triangles are more than a study can use"),
    ("mesh: {maxh: 0.2, levels: 2}", "mesh: {}", "17:7", "mesh.maxh", "is missing"),
    ("mesh: {maxh: 0.2, levels: 2}\n", "", "1:1", "mesh", "is missing"),
    ("[25, 100]", "[]", "19:10", "sweep.alpha", "has no values"),
    ("[25, 100]", "[25, 25]", "19:15", "sweep.alpha[1]", "the value 25 is repeated"),
    ("[25, 100]", "[25, 0.025 kW/(m^2*K)]", "19:15", "sweep.alpha[1]", "the value 0.025 kW/(m^2*K) is repeated"),
    ("[25, 100]", "[25, -1]", "19:15", "sweep.alpha[1]", "must be 0 or more, but is -1"),
    ("[25, 100]", "[25, 0]", "19:15", "sweep.alpha[1]", "with alpha = 0 the heat of q cannot leave the"),
    ("[25, 100]", "[25, 100 K]", "19:15", "sweep.alpha[1]", "'K' is not a unit of a heat transfer coeffici"),
    ("[25, 100]", "[25, abc]", "19:15", "sweep.alpha[1]", "'abc' is not a heat transfer coefficient"),
    ("[25, 100]", "25", "19:10", "sweep.alpha", "must be a list of values, but is the number 25"),
    ("[25, 100]", "{linspace: [1, 2]}", "19:21", "sweep.alpha.linspace", "must be [a, b, n], but is a list of 2"),
    (
        "[25, 100]",
        "{linspace: [1, 1, 3]}",
        "19:21",
        "sweep.alpha.linspace",
        "both ends are equal, so the values are repeated",
    ),
    (
        "[25, 100]",
        "{geomspace: [0, 1, 3]}",
        "19:22",
        "sweep.alpha.geomspace",
        "geomspace needs two ends of one sign, not 0 and 1",
    ),
    (
        "[25, 100]",
        "{linspace: [0, 1, 3], geomspace: [1,2,3]}",
        "19:10",
        "sweep.alpha",
        "needs one of linspace and geomspace",
    ),
    (
        "[25, 100]",
        "{linspace: [10, 20, 2000000]}",
        "19:30",
        "sweep.alpha.linspace[2]",
        "must be from 2 to 1000000, but is 2000000",
    ),
    ("  alpha: [25", "  alhpa: [25", "19:3", "sweep.alhpa", "did you mean 'alpha'?"),
    ("  alpha: [25", "  heat.k: [25", "19:3", "sweep.heat.k", "did you mean 'material.k'?"),
    ("  alpha: [25", "  body.width: [25", "19:3", "sweep.body.width", "body cannot be swept"),
    ("  alpha: [25", "  mesh.maxh: [25", "19:3", "sweep.mesh.maxh", "mesh cannot be swept"),
    (
        "  alpha: [25",
        "  mode: zip\n  theta_bar: [1, 2, 3]\n  alpha: [25",
        "21:10",
        "sweep.alpha",
        "has 2 values, but theta_bar has 3",
    ),
    (
        "  alpha: [25",
        "  mode: list\n  alpha: [25",
        "20:3",
        "sweep.alpha",
        "with mode: list the parameter 'alpha' belongs into points",
    ),
    ("  alpha: [25", "  mode: lists\n  alpha: [25", "19:9", "sweep.mode", "did you mean 'list'?"),
    (
        "  alpha: [25",
        "  heat.alpha: [1, 2]\n  alpha: [25",
        "20:3",
        "sweep.alpha",
        "sweeps the same parameter as 'heat.alpha'",
    ),
    (
        "  delta: [20 um",
        "  friction: [20 um",
        "20:13",
        "sweep.friction",
        "must be a mapping of names to laws, but is a list of 2",
    ),
    (
        "  delta: [20 um, 40 um]",
        "  friction: {a: {law: tresca, tau: 5}, b: {law: tresca, tau: 5}}",
        "20:43",
        "sweep.friction.b",
        "the value {law: tresca, tau: 5} is repeated",
    ),
    (
        "  delta: [20 um, 40 um]",
        "  friction: {a: {law: tresca, tau: 5}, b: {law: tresca, tua: 5}}",
        "20:57",
        "sweep.friction.b.tua",
        "did you mean 'tau'?",
    ),
    (
        "  delta: [20 um, 40 um]",
        "  friction: {a: {law: tresca, tau: 5}}\n  delta: [1, 2]",
        "21:3",
        "sweep.delta",
        "the law tresca has no parameter 'delta'",
    ),
    ("  delta: [20 um, 40 um]", "  tau: [1, 2]", "20:3", "sweep.tau", "the law slip-weakening has no parameter 'tau'"),
    (
        "  delta: [20 um, 40 um]",
        "  boundary.top.presure: [1, 2]",
        "20:3",
        "sweep.boundary.top.presure",
        "did you mean 'boundary.top.pressure'?",
    ),
    (
        "  delta: [20 um, 40 um]",
        "  boundary.top.pressure: [1, 2 m]",
        "20:30",
        "sweep.boundary.top.pressure[1]",
        "'m' is not a unit of a stress (Pa)",
    ),
    (
        "  delta: [20 um, 40 um]",
        "  q: [0, 1 W]",
        "20:10",
        "sweep.q[1]",
        "'W' is not a unit of a heat source density (W/m^3)",
    ),
    ("  delta: [20 um, 40 um]", "  h: [0.1, 0.2]", "20:12", "sweep.h[1]", "0.2 does not decrease after 0.1"),
    ("  delta: [20 um, 40 um]", "  h: [0.2, 0.1]", "17:19", "mesh.levels", "levels go with a single maxh"),
    ("  delta: [20 um, 40 um]", "  h: 0.1", "20:6", "sweep.h", "must be a list of sizes, but is the number 0.1"),
    ("mesh:", "solver: newton\nmesh:", "17:9", "solver", "did you mean 'bundle-newton'?"),
    (
        "mesh:",
        "solver: {name: bundle-newton, tolerance: 2}\nmesh:",
        "17:42",
        "solver.tolerance",
        "must be less than 1, but is 2",
    ),
    ("mesh:", "output: {path: 5}\nmesh:", "17:16", "output.path", "must be a path, but is the number 5"),
    ("mesh:", "output: {fields: yes}\nmesh:", "17:18", "output.fields", "must be true or false, but is the text 'yes'"),
    ("mesh:", "title: 2024\nmesh:", "17:8", "title", "must be a text, but is the number 2024"),
    ("mesh:", "units: cgs\nmesh:", "17:8", "units", "must be one of SI, none, but is the text 'cgs'"),
    ("mesh:", "loads: {f: 5}\nmesh:", "17:12", "loads.f", "must be a pair of components, but is the number 5"),
    ("boundary:", "boundary: [", "11:8", "", "YAML syntax: while parsing a flow sequence, e"),
    ("mesh:", "mesh: !foo", "17:7", "mesh", "the YAML tag !foo is not supported"),
    ("mesh:", "<<: {a: 1}\nmesh:", "17:1", "<<", "merge keys are not supported"),
    ("mesh:", "a: &a [*a]\nmesh:", "17:4", "a[0]", "an alias contains itself"),
    ("mesh:", '"mesh:', "21:1", "", "YAML syntax: while scanning a quoted scalar, "),
    ("[2, 1]", "[0.2, -1]", "3:7", "body.outline[0]", "edge 1 (bottom) and edge 3 (top) cross or touch at (0.1, 0)"),
    (
        "    - {from: [0, 0], edge: bottom}\n    - {from: [2, 0], edge: right}\n    - {from: [2, 1], edge: top}\n    - {from: [0, 1], edge: left}",
        "    - {from: [0, 1], edge: left}\n    - {from: [2, 1], edge: top}\n    - {from: [2, 0], edge: right}\n    - {from: [0, 0], edge: bottom}",
        "3:5",
        "body.outline",
        "the points run clockwise",
    ),
    ("[2, 1]", "[2, 0]", "4:7", "body.outline[1]", "edge 2 (right) has no length: it ends where i"),
    (
        "center: [1, 0.5]",
        "center: [2, 0.5]",
        "8:10",
        "body.regions.hot",
        "the region leaves the body near (2.1, 0.499703)",
    ),
    ("center: [1, 0.5]", "center: [5, 0.5]", "8:10", "body.regions.hot", "the region lies outside the body"),
    ("radius: 0.2", "radius: 200", "8:10", "body.regions.hot", "it is 200 times as large as the body"),
    (
        "regions:",
        "holes: [{circle: {center: [1, 0.5], radius: 0.2}}]\n  regions:",
        "7:20",
        "body.holes[0].circle.edge",
        "is missing",
    ),
    ("regions:", "rectangle: {width: 1, height: 1}\n  regions:", "2:3", "body", "is given by outline and rectangle"),
    (
        "omega: hot",
        "omega: {circle: {center: [9, 9], radius: 1}}",
        "15:62",
        "heat.omega",
        "the region lies outside the body",
    ),
    ("  outline:", "  outlin:", "2:3", "body.outlin", "did you mean 'outline'?"),
    (
        "heat: {alpha: 100 W/(m^2*K), theta_bar: 20 K, q: 5e6, omega: hot}",
        'heat: {theta: "20*x"}',
        "15:15",
        "heat.theta",
        "theta is the known temperature, so alpha would not be used",
    ),
    ("sweep:\n  alpha: [25, 100]\n  delta: [20 um, 40 um]\n", "swep: {}\n", "18:1", "swep", "did you mean 'sweep'?"),
    (
        "sweep:\n  alpha: [25, 100]\n  delta: [20 um, 40 um]\n",
        "sweep:\n",
        "18:1",
        "sweep",
        "must be a mapping of parameters to values, but is empty",
    ),
    ("maxh: 0.2", "maxh: .inf", "17:14", "mesh.maxh", "inf is not a finite number"),
    (
        "left: clamped",
        "left: {role: clamped, u_x: 1 K}",
        "13:30",
        "boundary.left.u_x",
        "'K' is not a unit of a length (m)",
    ),
    ("g: [0, -1 MPa]", "pressure: no", "12:35", "boundary.top.pressure", "unknown name 'no'"),
    (
        "E: 210 GPa, nu: 0.3",
        "lambda: -1 GPa, mu: 1 GPa",
        "14:20",
        "material.lambda",
        "-1e+09 makes the bulk modulus zero or negative",
    ),
    (
        "tau_k: 5 MPa",
        "tau_k: -5 MPa",
        "16:55",
        "friction.tau_k",
        "must be at least 0, not -5e+06: friction opposes the slip",
    ),
    ("tau_s: 20 MPa,", "", "16:11", "friction.tau_s", "is missing in the law slip-weakening"),
    (
        "  delta: [20 um, 40 um]",
        "  heat.omega: [hot, cold]",
        "20:21",
        "sweep.heat.omega[1]",
        "the body has no region 'cold'",
    ),
    ("    hot:", "    h t:", "8:5", "body.regions.h t", "'h t' is not a name"),
    ("left: clamped", "left: 5", "13:9", "boundary.left", "must be one of clamped, traction, contact, co"),
    ("body:", "tile: x\nbody:", "1:1", "tile", "did you mean 'title'?"),
]


def problems(text: str, *overrides: str) -> list[str]:
    """The lines a user sees."""
    with pytest.raises(StudyError) as info:
        read_study_text(text, "study.yaml", overrides)
    return str(info.value).split("\n")


def changed(old: str, new: str) -> str:
    assert old in BASE
    return BASE.replace(old, new, 1)


def test_the_base_of_these_tests_is_sound() -> None:
    assert read_study_text(BASE).shape == (2, 2)


@pytest.mark.parametrize(("old", "new", "place", "key", "part"), FAULTS)
def test_one_fault_gives_one_error_at_its_place(old: str, new: str, place: str, key: str, part: str) -> None:
    lines = problems(changed(old, new))
    assert len(lines) == 1
    assert lines[0].startswith(f"study.yaml:{place}: {key}: " if key else f"study.yaml:{place}: ")
    assert part in lines[0]
    assert "; " in lines[0]  # the remedy


def test_five_faults_are_reported_at_once_sorted_by_line() -> None:
    text = BASE
    for old, new in (
        ("radius: 0.2", "radius: 0.2 kg"),
        ("left: clamped", "left: clampd"),
        ("nu: 0.3", "nu: 0.7"),
        ("tau_k: 5 MPa, ", ""),
        ("[25, 100]", "[25, 25]"),
    ):
        text = text.replace(old, new)
    lines = problems(text)
    assert [line.split(": ")[:2] for line in lines] == [
        ["study.yaml:8:46", "body.regions.hot.circle.radius"],
        ["study.yaml:13:9", "boundary.left"],
        ["study.yaml:14:28", "material.nu"],
        ["study.yaml:16:11", "friction.tau_k"],
        ["study.yaml:19:15", "sweep.alpha[1]"],
    ]


def test_a_fault_between_sections_is_reported_once_for_a_whole_sweep() -> None:
    assert len(problems(changed("right: convection", "right: free"))) == 1
    text = changed("tau_s: 20 MPa, tau_k: 5 MPa", "tau_s: -1, tau_k: 5 MPa")
    assert len(problems(text)) == 1


def test_a_fault_of_some_sweep_points_names_the_first_of_them() -> None:
    text = changed("q: 5e6, ", "").replace("  alpha: [25, 100]", "  q: [0, 5]\n  heat.alpha: [100, 0]")
    [line] = problems(text)
    assert line.startswith("study.yaml:20:21: sweep.heat.alpha[1]: with alpha = 0")
    text = changed("delta: [20 um, 40 um]", "nu: [0.3, 0.5]")
    [line] = problems(text)
    assert line.startswith("study.yaml:20:13: sweep.nu[1]: must lie between -1 and 0.5")


def test_a_swept_value_that_spoils_another_key_names_the_point() -> None:
    text = changed("E: 210 GPa, nu: 0.3", "lambda: -0.5 GPa, mu: 1 GPa")
    assert len(read_study_text(text.replace("delta: [20 um, 40 um]", "mu: [1 GPa, 2 GPa]")).scenes) == 4
    [line] = problems(text.replace("delta: [20 um, 40 um]", "mu: [1 GPa, 0.5 GPa]"))
    assert line.startswith("study.yaml:14:20: material.lambda: ")
    assert "(at the sweep point mu = 0.5 GPa); 3 lambda + 2 mu must be positive" in line


def test_a_swept_key_may_not_contradict_a_given_one() -> None:
    [line] = problems(changed("delta: [20 um, 40 um]", "beta: [1, 2]"))
    assert line.startswith("study.yaml:20:10: sweep.beta[0]: both alpha_T and beta are given")


def test_a_text_with_a_unit_is_refused_in_a_dimensionless_study() -> None:
    lines = problems("units: none\n" + BASE)
    assert len(lines) == 11
    assert all("has a unit, but the study says units: none" in line for line in lines)


def test_convection_without_heat() -> None:
    text = BASE[: BASE.index("heat:")] + BASE[BASE.index("friction:") : BASE.index("  alpha")] + "  tau_s: [1, 2]\n"
    [line] = problems(text)
    assert line.startswith("study.yaml:11:10: boundary.right: a convection edge has no meaning")


@pytest.mark.parametrize(
    ("roles", "motion"),
    [
        ("bottom: contact\n  right: free\n  top: free\n  left: free", "slide along x"),
        ("bottom: contact\n  right: contact\n  top: free\n  left: free", None),
        ("bottom: contact\n  right: free\n  top: {role: clamped, u_y: 0}\n  left: free", "slide along x"),
        ("bottom: contact\n  right: {role: clamped, u_N: 0}\n  top: free\n  left: free", None),
        ("bottom: contact\n  right: {role: clamped, u_T: 0}\n  top: free\n  left: free", "slide along x"),
    ],
)
def test_rollers_must_hold_the_body(roles: str, motion: str | None) -> None:
    start, end = BASE.index("  bottom: contact"), BASE.index("material:")
    text = BASE[:start] + "  " + roles + "\n" + BASE[end:]
    text = text.replace("heat: {alpha: 100 W/(m^2*K), theta_bar: 20 K, q: 5e6, omega: hot}\n", "")
    text = text.replace("  alpha: [25, 100]\n", "")
    if motion is None:
        assert len(read_study_text(text).scenes) == 2
    else:
        [line] = problems(text)
        assert f"it can still {motion}" in line


def test_contact_on_a_full_circle_leaves_the_rotation_free() -> None:
    text = """\
body:
  outline:
    - {from: [0 mm, 0 mm], edge: rim, through: [1, -1]}
    - {from: [2, 0], edge: rim, through: [1, 1]}
boundary: {rim: contact}
material: {E: 1, nu: 0}
friction: {law: tresca, tau: 1}
mesh: {maxh: 0.1}
"""
    [line] = problems(text)
    assert line.startswith("study.yaml:5:11: boundary: no edge is clamped")
    assert "turn about (1, " in line


def test_files_that_cannot_be_read(tmp_path: Path) -> None:
    with pytest.raises(StudyError, match="there is no such file; check the path"):
        read_study(tmp_path / "none.yaml")
    with pytest.raises(StudyError, match="this is a folder"):
        read_study(tmp_path)
    latin = tmp_path / "latin.yaml"
    latin.write_bytes("title: ok\n# Öl".encode("latin-1"))
    with pytest.raises(StudyError, match=r"latin\.yaml:2:3: the file is not UTF-8 text"):
        read_study(latin)
    with pytest.raises(StudyError, match="the file is empty"):
        read_study_text("# nothing\n")
    with pytest.raises(StudyError, match=r"<text>:1:1: a study is a mapping, but this is a list of 1"):
        read_study_text("- a\n")


def test_a_geometry_file_must_exist(tmp_path: Path) -> None:
    start, end = BASE.index("  outline:"), BASE.index("  regions:")
    part = "  file: {path: part.step, edges: {bottom: [[0, 0]], left: [[0, 1]]}, other: right}\n"
    text = (BASE[:start] + part + BASE[end:]).replace("  top: {role: traction, g: [0, -1 MPa]}\n", "")
    study = tmp_path / "study.yaml"
    study.write_text(text)
    with pytest.raises(StudyError, match=r"study\.yaml:2:16: body\.file\.path: there is no file 'part\.step'"):
        read_study(study)
    (tmp_path / "part.step").touch()
    brep = read_study(study).scenes[0].body.brep
    assert brep is not None
    assert (brep.path, brep.face, brep.scale, brep.other) == (tmp_path / "part.step", 0, 1e-3, "right")
    assert brep.edges == (("bottom", ((0.0, 0.0),)), ("left", ((0.0, 1.0),)))


@pytest.mark.parametrize(
    ("option", "line"),
    [
        ("material.nu=0.7", "--set material.nu=0.7: material.nu: must lie between -1 and 0.5, but is 0.7"),
        ("nu=0.7", "--set nu=0.7: material.nu: must lie"),
        ("material.mu2=0.7", "--set material.mu2=0.7: material.mu2: unknown key; did you mean 'mu'?"),
        ("matrial.nu=0.3", "--set matrial.nu=0.3: matrial: unknown key"),
        ("alpha=5", "--set alpha=5: heat.alpha: alpha is swept, so this value would not be used"),
        ("nonsense", "--set nonsense: this option is not key=value"),
        ("nu=", "--set nu=: this option is not key=value"),
        ("nu=[1", "--set nu=[1: YAML syntax"),
        ("mesh.maxh.x=1", "--set mesh.maxh.x=1: mesh.maxh.x: mesh.maxh is the number 0.2, not a mapping"),
        ("body.outline[9].edge=a", "--set body.outline[9].edge=a: body.outline[9].edge: body.outline has no entry [9]"),
        ("sweep.alpha=[1, 1]", "--set sweep.alpha=[1, 1]: sweep.alpha[1]: the value 1 is repeated"),
    ],
)
def test_faults_of_options_are_reported_at_the_option(option: str, line: str) -> None:
    [problem] = problems(BASE, option)
    assert problem.startswith(line)
