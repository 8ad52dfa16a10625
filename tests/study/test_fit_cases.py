"""Fits of histories, of smooth laws, from many starts, to several tests, under a factor of
loads."""

from collections.abc import Iterable
from pathlib import Path

import numpy as np
import pytest

import tcstudy
from tcstudy.errors import FitError, StudyError
from tcstudy.read.study import read_study_text
from tcstudy.reports.terminal.summary import text_of
from tcstudy.scene.study import Study
from tcstudy.study import fit as fits
from tcstudy.study.fit import fit, model_of
from tests.study.test_fit import HEATED, heated, pulled, study_of

Array = np.ndarray


def fitted(folder: Path, text: str, head: str, *columns: Iterable[float]) -> Study:
    """A study beside its table data.csv."""
    rows = (",".join(f"{x:.17g}" for x in row) for row in zip(*columns, strict=True))
    (folder / "data.csv").write_text("\n".join([head, *rows]) + "\n", encoding="utf-8")
    return read_study_text(text, "fit.yaml", source=folder / "fit.yaml")


W, K, TAU, RISE = 0.1, 50e9, 2e6, 4e9
"""Width of a block as good as rigid, spring k, τ(κ) = TAU + RISE κ."""
RIGID = """
title: block on an elastic-plastic film
body: {rectangle: {width: 0.1 m, height: 0.1 m}}
boundary: {bottom: contact, left: free, top: free, right: {role: clamped, u_x: 0 mm, u_y: free}}
material: {E: 1e6 GPa, nu: 0, plane: stress}
friction: {law: piecewise-linear, points: [[0 mm, 1 MPa], [1 mm, 5 MPa]]}
mesh: {maxh: 50 mm}
history: {memory: elastic-plastic, stiffness: 100 GPa/m, steps: [{boundary.right.u_x: 0.2 mm, in: 4},
            {boundary.right.u_x: -0.15 mm, in: 6}, {boundary.right.u_x: 0.25 mm, in: 5}]}
fit:
  data: {file: data.csv, columns: {step: step, friction_resultant: "P [N/m]"}}
  noise: {friction_resultant: 2 kN/m}
  starts: 1
  parameters:
    friction.points.0: {start: 1 MPa, within: [0.2 MPa, 10 MPa]}
    friction.points.1: {start: 5 MPa, within: [0.2 MPa, 30 MPa]}
    history.stiffness: {start: 100 GPa/m, within: [10 GPa/m, 1000 GPa/m]}
"""
PULLED = np.r_[
    np.linspace(0, 2e-4, 5), np.linspace(2e-4, -1.5e-4, 7)[1:], np.linspace(-1.5e-4, 2.5e-4, 6)[1:]
]
"""(16,) where the steps have pulled it [m]."""
FOUND = (TAU, TAU + 1e-3 * RISE, K)
"""What is sought."""


def returned(U: Array) -> Array:
    """(n,) resultants of the rigid block pulled to U, by the return map written down for one
    point."""
    p, kappa, found = 0.0, 0.0, []
    for u in U:
        trial = K * (u - p)
        flow = max(0.0, (abs(trial) - TAU - RISE * kappa) / (K + RISE))
        p, kappa = p + np.sign(trial) * flow, kappa + flow
        found.append(W * K * (u - p))
    return np.array(found)


def test_strength_rise_and_spring_of_a_cyclic_test(tmp_path: Path) -> None:
    """The closed form of a rigid block as data: found as far as it is rigid."""
    record = fit(fitted(tmp_path, RIGID, "step,P [N/m]", range(16), returned(PULLED)))
    assert record.values["estimate"] == pytest.approx(FOUND, rel=1e-5)
    assert np.all(record.values["standard_error"] < 0.02 * np.array(FOUND))
    assert int(record.attributes["evaluations"]) <= 12


REFUSED_HISTORIES = (
    ({"step: step, ": ""}, "fit.data: a fit of a history needs a column step; add {step:"),
    ({"step: step": "boundary.right.u_x: step"}, "boundary.right.u_x: unknown name; name one of"),
    ({"starts: 1": "compare: orthogonal"}, "distances to a path are of one monotone load, but the study has a history"),
    ({"in: 4": "in: 3"}, "the history has no step 15; steps are 0 for the study as it is written, then 1 to 14"),
    ({"friction.points.1: {start: 5 MPa": "boundary.right.u_x: {start: 5 mm", "[0.2 MPa, 30 MPa]": "[1 mm, 9 mm]"},
     "boundary.right.u_x is what the history changes, so it is known"),
    ({"[10 GPa/m, 1000": "[-1 GPa/m, 1000"}, "history.stiffness = -1e+09: must be greater than 0"),
)  # fmt: skip


@pytest.mark.parametrize(("change", "told"), REFUSED_HISTORIES)
def test_what_a_fit_of_a_history_does_not_take(
    tmp_path: Path, change: dict[str, str], told: str
) -> None:
    text = RIGID
    for old, new in change.items():
        assert old in text
        text = text.replace(old, new)
    with pytest.raises(StudyError) as fault:
        fitted(tmp_path, text, "step,P [N/m]", range(16), np.zeros(16))
    assert [told in str(one) for one in fault.value.problems].count(True) == 1, fault.value.problems


PLACES = np.linspace(0.0, 160.0, 5)
PULL = """
title: pull
body:
  outline: [{from: [0, 0], edge: bond}, {from: [190 mm, 0], edge: grip},
            {from: [190 mm, 1 mm], edge: top}, {from: [0, 1 mm], edge: tail}]
boundary: {bond: contact, grip: {role: clamped, u_x: 0, u_y: free}, top: free, tail: free}
material: {E: 42.24 GPa, nu: 0, plane: stress}
friction: {law: piecewise-linear, points: [POINTS]}
mesh: {maxh: 38 mm}
fit:
  data: {file: data.csv, columns: {boundary.grip.u_x: "Delta [mm]", friction_resultant: "P [N/mm]"}}
  noise: {friction_resultant: 2.2 N/mm}
  starts: 1
  smooth: SMOOTH
  parameters:
"""


def by_points(folder: Path, P: Array, delta: Array, smooth: bool) -> Study:
    start = [f"{6.0 - s / 30.0:g} MPa" for s in PLACES]
    points = ", ".join(f"[{s:g} um, {b}]" for s, b in zip(PLACES, start, strict=True))
    text = PULL.replace("POINTS", points).replace("SMOOTH", str(smooth).lower())
    text += "".join(
        f"    friction.points.{i}: {{start: {b}, within: [0 MPa, 20 MPa]}}\n"
        for i, b in enumerate(start)
    )
    return fitted(folder, text, "Delta [mm],P [N/mm]", delta, P)


@pytest.mark.parametrize(("bent", "factor"), [(False, 0.9), (True, 1.5)])
def test_a_smooth_law_is_nearer_to_the_true_one(tmp_path: Path, bent: bool, factor: float) -> None:
    """A straight fall is found with two or three numbers; one that bends is not flattened by the
    weight."""
    truth = 1e6 * (np.maximum(7.2 - PLACES / 11.0, 1.5) if bent else 7.2 - 7.2 * PLACES / 170.0)
    delta = 1e-3 * np.linspace(5.0, 210.0, 16)
    own = by_points(tmp_path, delta, delta, smooth=False)
    assert own.fit is not None
    P = 1e-3 * model_of(own, own.fit).compare(truth).predicted + 2.2 * np.random.default_rng(
        1
    ).normal(size=16)
    free, smooth = (fit(by_points(tmp_path, P, delta, one)) for one in (False, True))
    apart = [
        np.sqrt(np.mean((record.values["estimate"] - truth) ** 2)) for record in (free, smooth)
    ]
    assert apart[1] < factor * apart[0]
    assert np.all(smooth.values["standard_error"] < 1.05 * free.values["standard_error"])
    assert 2.0 < float(smooth.attributes["numbers_decided"]) < 7.0
    assert (float(smooth.attributes["numbers_decided"]) < 4.0) is not bent
    assert "numbers_decided" not in free.attributes
    assert 5.0 < float(smooth.attributes["chi_square"]) < 30.0


def test_a_law_of_two_points_cannot_be_smooth(tmp_path: Path) -> None:
    study = by_points(tmp_path, np.arange(9.0), np.arange(9.0), smooth=True)
    rest = "\n".join(
        line for line in study.text.splitlines() if "points." not in line or "points.1" in line
    )
    with pytest.raises(StudyError, match="at least three of its points"):
        read_study_text(rest, "a.yaml", source=tmp_path / "a.yaml")


def test_an_assumed_noise_does_not_end_the_search(tmp_path: Path) -> None:
    """A known one does (test_fit)."""
    found = tcstudy.run(
        heated(
            tmp_path, HEATED.replace("  noise: {", "  # {").replace("maxh: 20 mm", "maxh: 50 mm")
        ),
        tmp_path / "b.nc",
    )
    assert found["start_count"].values.tolist() == [5]  # all agree
    words = "u_T_max and friction_resultant are measured equally well, in parts of their ranges"
    assert found.attrs["noise_assumed"] == words
    text = " ".join(text_of(tmp_path / "b.nc").split())
    assert "starts: 5 of 5 tried; 5 of 5 end in this minimum" in text
    assert f"the 95 % intervals assume that {words}" in text


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
    """A bar on a film, whose pull at x = L takes √(k E H) tanh(√(k/(E H)) L) a length: of a long
    one the tanh is 1."""
    for name, L in (("long", 0.15), ("short", 0.01)):
        k, EH = TRUE[0], 2e-3 * TRUE[1]
        stiffness = np.sqrt(k * EH) * np.tanh(np.sqrt(k / EH) * L)
        rows = "".join(f"{D},{1e-6 * stiffness * D:.17g}\n" for D in (0.1, 0.2, 0.3, 0.4))
        (folder / f"{name}.csv").write_text("D [mm],P [N/mm]\n" + rows)
    return read_study_text(text, "fit.yaml", source=folder / "fit.yaml")


def test_tests_decide_together_what_none_decides_alone(tmp_path: Path) -> None:
    """The long bar alone knows k E only. Precisions of independent data add, each taken at the same
    numbers."""
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
        rates = (
            model_of(one, one.fit).compare(found.values["estimate"]).jacobian
            * found.values["estimate"]
        )
        precision += rates.T @ rates
    assert found.values["covariance"] == pytest.approx(np.linalg.inv(precision), rel=1e-6)
    alone = fit(bars(tmp_path, BAR))
    assert "k" in alone.attributes["not_determined"]
    assert np.prod(alone.values["estimate"]) == pytest.approx(np.prod(TRUE), rel=0.06)


def test_what_is_wrong_with_a_test_is_said_at_its_place(tmp_path: Path) -> None:
    for old, new, said in (
        ("short.csv", "none.csv", "fit.yaml:16:7: fit.tests[0]: fit.data.file: none.csv"),
        ("with: {L: 10 mm}", "with: {M: 10 mm}", "fit.tests[0]"),
        (
            "columns: {boundary.right.u_x",
            "columns: {boundary.right.u_z",
            "fit.tests[0]: fit.data.columns",
        ),
    ):
        with pytest.raises(StudyError) as info:
            bars(tmp_path, BAR + SHORT.replace(old, new))
        assert said in str(info.value).replace(f"{tmp_path}/", ""), str(info.value)


HEATED_STRIP = """
body: {rectangle: {width: 300 mm, height: 2 mm}}
boundary: {bottom: contact, right: {role: traction, g: [180 MPa, 0]}, top: convection, left: symmetry}
material: {E: 165 GPa, nu: 0.3, plane: stress, k: 5 W/(m*K), alpha_T: 0.6e-6 1/K}
heat: {alpha: 10 W/(m^2*K), theta_bar: 18 K}
friction: {law: bilinear, tau: 6 MPa, s0: 20 um, sf: 150 um}
mesh: {maxh: 10 mm}
fit: {compare: COMPARE, data: {file: data.csv, columns: {COLUMNS}}, parameters: {PARAMETERS}}
"""
G, TAU_0, LOAD, THETA = (
    "boundary.right.g_x: {start: 180 MPa, within: [10 MPa, 400 MPa]}",
    "friction.tau: {start: 6 MPa, within: [1 MPa, 20 MPa]}",
    "load: {start: 0.7, within: [0.1, 2]}",
    "heat.theta_bar: {start: 18 K, within: [1 K, 40 K]}",
)


def strip_and_numbers(
    folder: Path, given: str, measured: str, t: Array, *numbers: str
) -> tuple[fits.Tests, Array]:
    """Tests of a strip and the numbers to find, against some data at the loads t."""
    (name, unit, compare), y = ("u_T_max", "um", "vertical"), np.linspace(20.0, 40.0, len(t))
    if measured == "P":
        (name, unit, compare), y = ("friction_resultant", "N/mm", "orthogonal"), 8.0 * y
    head = [
        "g" + {"load": "", "boundary.right.g_x": " [MPa]", "heat.theta_bar": " [K]"}[given],
        f"{measured} [{unit}]",
    ]
    text = HEATED_STRIP.replace("PARAMETERS", ", ".join(numbers)).replace("COMPARE", compare)
    text = text.replace("COLUMNS", f'{given}: "{head[0]}", {name}: "{head[1]}"')
    study = fitted(folder, text, ",".join(head), t, y)
    assert study.fit is not None
    return fits.Tests.of(study), np.array([one.start for one in study.fit.parameters])


def test_results_at_factors_are_those_of_the_loads_themselves(tmp_path: Path) -> None:
    """0.2, 0.5 and 1 times g against g of 36, 90 and 180 MPa, each from the solution before."""
    factors, found = np.array([0.2, 0.5, 1.0]), []
    for given, size in (("load", 1.0), ("boundary.right.g_x", 180.0)):
        tests, p = strip_and_numbers(tmp_path, given, "u", size * factors, TAU_0)
        found.append(tests.models[0].compare(p).predicted)
    np.testing.assert_allclose(*found, rtol=1e-12)


@pytest.mark.parametrize(
    ("given", "measured", "t", "numbers"),
    [
        ("load", "u", [0.2, 0.5, 1.0, 1.2], (TAU_0, G, THETA)),
        ("load", "P", [0.2, 0.5, 1.2], (TAU_0, G)),
        ("heat.theta_bar", "u", [5.0, 10.0, 20.0], (G, LOAD)),
    ],
)
def test_derivatives_by_loads_under_a_factor_are_differences(
    tmp_path: Path, given: str, measured: str, t: list[float], numbers: tuple[str, ...]
) -> None:
    tests, p = strip_and_numbers(tmp_path, given, measured, np.array(t), *numbers)
    exact, steps = tests(p)[1], 1e-6 * np.diag(p)
    apart = np.stack([(tests(p + h)[0] - tests(p - h)[0]) / (2.0 * h.sum()) for h in steps], axis=1)
    assert np.all(np.abs(exact - apart) <= 1e-5 * np.abs(apart).max(axis=0))


REFUSED = {
    ("T [K],u", "T,u"): "the heading 'T' has no unit; write T [K]",
    ("u [um]", "u [K]"): "'K' is not a unit of a length",
    ("0.5 um", "-1 um"): "fit.noise.u_T_max: must be above 0",
    ('"R [kN/m]"', '"Q [kN/m]"'): "the table has no column 'Q [kN/m]'",
    (
        'u_T_max: "u',
        'u_Tmax: "u',
    ): "no column can be u_Tmax: unknown name; did you mean 'u_T_max'",
    ("friction.tau:", "body.rectangle.width:"): "it moves the mesh",
    (
        "alpha_T: {start: 8e-6 1/K, within: [1e-6 1/K, 1e-4 1/K]",
        "nu: {start: 0.3, within: [0, 0.6]",
    ): "between -1 and 0.5",
    ("start: 2 MPa", "start: 40 MPa"): "lies outside within",
    ("[0.2 MPa, 20 MPa]", "[-1 MPa, 20 MPa]"): "friction.tau = -1e+06: must be at least 0",
    (
        "mesh: {maxh: 20 mm}",
        "mesh: {maxh: 20 mm}\nsweep: {tau: [1 MPa, 2 MPa]}",
    ): "but the study has a sweep",
    ("  noise", "  compare: orthogonal\n  noise"): "distances to a path need two columns",
    ("file: heated.csv", "file: warmed.csv"): "name a CSV table beside the study",
    ("\n20.000000,", "\n1e999,"): "heated.csv:2:1: 1e999 K is too large for a number",
    ("T [K],u [um],R [kN/m]\n", ""): "heated.csv:1:1: the table has no headings",
    (
        "T [K],u [um],R",
        "T [K];u [um];R",
    ): "heated.csv:1:1: columns are separated by semicolons; write commas",
    (",", ",5,"): "has 5 entries, but the header 3, and 11 other lines likewise",
}


@pytest.mark.parametrize(
    ("change", "said"), REFUSED.items(), ids=[said[:40] for said in REFUSED.values()]
)
def test_what_cannot_be_fitted_is_refused(
    tmp_path: Path, change: tuple[str, str], said: str
) -> None:
    heated(tmp_path)
    old, new = change
    table = tmp_path / "heated.csv"
    data = table.read_text(encoding="utf-8")
    assert old in HEATED or old in data
    head, _, rows = data.partition("\n")
    data = head + "\n" + rows.replace(old, new) if old == "," else data.replace(old, new, 1)
    table.write_text("\N{BYTE ORDER MARK}" + data.replace("\n", "\r\n"), encoding="utf-8")
    text = HEATED if old == "," else HEATED.replace(old, new, 1)
    if old == "T [K],u":
        text = text.replace('theta: "T [K]"', 'theta: "T"')
    with pytest.raises(StudyError) as info:
        read_study_text(text, "heated.yaml", source=tmp_path / "heated.yaml")
    assert said in str(info.value)
    assert len({(problem.line, problem.column) for problem in info.value.problems}) == len(
        info.value.problems
    )


def test_data_of_a_path_in_no_order_and_laws_that_vary_along_the_line_are_refused(
    tmp_path: Path,
) -> None:
    """Feet on a path go forward with the data."""
    data = pulled(45)
    study_of(tmp_path, data[::-1])
    with pytest.raises(StudyError, match="the data are not in the order of the test"):
        study_of(tmp_path, np.random.default_rng(1).permutation(data))
    with pytest.raises(
        StudyError, match=r"fit.compare: a path takes one law, the same all along the contact line"
    ):
        study_of(tmp_path, data, {"delta: 0.3 mm}": 'delta: 0.3 mm, strength: "1 + x"}'})


def test_numbers_that_nothing_depends_on_are_named(tmp_path: Path) -> None:
    text = HEATED.replace(
        'u_T_max: "u [um]", friction_resultant: "R [kN/m]"', 'theta_mean: "T [K]"'
    )
    text = text.replace('theta: "T [K]"', 'boundary.left.u_x: "u [um]"', 1).replace(
        "  noise", "  # noise"
    )
    with pytest.raises(FitError, match=r"do not depend on friction\.tau, alpha_T"):
        fit(heated(tmp_path, text))


COLUMN = """
units: none
body: {rectangle: {width: 1, height: 0.1}}
boundary: {bottom: contact, left: symmetry, top: {role: clamped, u_x: free, u_y: 0.1}, right: free}
material: {E: 1, nu: 0}
adhesion: {law: bilinear, sigma: 1.2, s0: 0.07, sf: 0.35}
mesh: {maxh: 0.1}
fit:
  data: {file: data.csv, columns: {boundary.top.u_y: d, adhesion_resultant: P, opening_max: s}}
  noise: {adhesion_resultant: 0.01, opening_max: 0.001}
  starts: 1
  parameters:
    adhesion.sigma: {start: 1.2, within: [0.2, 5]}
    adhesion.s0: {start: 0.07, within: [0.01, 0.2]}
    adhesion.sf: {start: 0.35, within: [0.25, 2]}
"""
LIFTED = np.array([0.05, 0.1, 0.18, 0.22, 0.25, 0.28])


def test_a_law_of_the_opening_from_a_column_that_is_lifted(tmp_path: Path) -> None:
    """E/H = 10 on σ = 1, s0 = 0.1, sf = 0.3: s = d/2 up to d = 0.2, then s = 2d − 0.3."""
    s = np.where(LIFTED <= 0.2, LIFTED / 2.0, 2.0 * LIFTED - 0.3)
    P = 10.0 * (LIFTED - s)
    record = fit(fitted(tmp_path, COLUMN, "d,P,s", LIFTED, P, s))
    assert record.values["estimate"] == pytest.approx([1.0, 0.1, 0.3], rel=1e-8)
    for old, new, fault in (
        ("starts: 1", "compare: orthogonal", "distances to a path need two columns"),
        ("opening_max: s}", "opening_min: s}", "opening_min: unknown name"),
    ):
        with pytest.raises(StudyError, match=fault):
            fitted(tmp_path, COLUMN.replace(old, new), "d,P,s", LIFTED, P, s)
    bilateral = COLUMN.replace("adhesion: {", "friction: {").replace("sigma: 1.2", "tau: 1.2")
    with pytest.raises(StudyError, match="adhesion_resultant: unknown name"):
        fitted(tmp_path, bilateral, "d,P,s", LIFTED, P, s)
