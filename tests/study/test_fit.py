"""Numbers from measurements: distances through folds, closed forms as data, what is written."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import tcstudy
from tcstudy.errors import StudyError
from tcstudy.read.study import read_study_text
from tcstudy.reports.terminal.summary import text_of
from tcstudy.scene.study import Study
from tcstudy.study.fit import fit, model_of
from tcstudy.study.fit_models import FitModel
from tests.commands import CONFIGS

Array = np.ndarray

CONFIG = CONFIGS / "pull_fit.yaml"
D, LENGTH, TAU, DELTA = 42.24e6, 0.19, 7.2e6, 0.16e-3
"""Stiffness [N/m] and length of the strip of configs/pull_test.yaml, and its law."""


def pulled(n: int) -> Array:
    """(n, 2) Δ [m] and P [N/m] of its closed form: rise, plateau, snap-back."""
    root = np.sqrt(TAU / (DELTA * D))
    P, zone, third = TAU / root, 0.5 * np.pi / root, n // 3
    s, d, c = (
        np.linspace(0.1, 1.0, third),
        np.linspace(0.05, 0.95, third),
        np.linspace(0.95, 0.05, n - 2 * third),
    )
    rise = [DELTA * (1.0 - np.cos(root * zone * s)), P * np.sin(root * zone * s)]
    plateau = [DELTA + P * d * (LENGTH - zone) / D, np.full(third, P)]
    back = [DELTA + c * P * (LENGTH - zone) / D, c * P]
    return np.concatenate([np.transpose(x) for x in (rise, plateau, back)])


def study_of(
    folder: Path, data: Array, change: dict[str, str] | None = None, text: str | None = None
) -> Study:
    """The study of the gallery on a coarse mesh with other data; change: texts in it to replace."""
    rows = "".join(f"{1e3 * delta:.9g},{1e-3 * P:.9g}\n" for delta, P in data)
    (folder / "pull_fit.csv").write_text("Delta [mm],P [N/mm]\n" + rows, encoding="utf-8")
    text = text or CONFIG.read_text(encoding="utf-8")
    for old, new in {
        "maxh: 2 mm": "maxh: 5 mm",
        "starts: 2": "starts: 1",
        **(change or {}),
    }.items():
        assert old in text
        text = text.replace(old, new)
    return read_study_text(text, "fit.yaml", source=folder / "fit.yaml")


def model(study: Study) -> FitModel:
    assert study.fit is not None
    return model_of(study, study.fit)


def assert_richardson(
    follow: FitModel, p: Array, exact: Array, numbers: Sequence[int], atol: float = 1e-8
) -> None:
    """The Jacobian by these numbers is that of differences."""
    for j in numbers:
        ends = [[follow.compare(p * (1.0 + sign * h * np.eye(len(p))[j])).residual for sign in (1.0, -1.0)]
                for h in (1e-4, 2e-4)]  # fmt: skip
        fine, coarse = (
            (up - down) / (2.0 * h * p[j]) for (up, down), h in zip(ends, (1e-4, 2e-4), strict=True)
        )
        apart = (4.0 * fine - coarse) / 3.0
        np.testing.assert_allclose(exact[:, j], apart, rtol=0.0, atol=atol * np.max(np.abs(apart)))


YOUNG = {
    "    friction.delta": "    E: {start: 42 GPa, within: [30 GPa, 60 GPa]}\n    friction.delta"
}


def test_distances_through_folds_change_as_differences_say(tmp_path: Path) -> None:
    """By tau_s, delta and E, at data on the rise, the plateau and the snap-back."""
    data = pulled(12) * (1.0 + 0.01 * np.random.default_rng(5).normal(size=(12, 2)))
    follow = model(study_of(tmp_path, data, {"maxh: 5 mm": "maxh: 12 mm", **YOUNG}))
    p = np.array([6.5e6, 42.24e9, 0.18e-3])
    assert_richardson(follow, p, follow.compare(p).jacobian, range(3))


@pytest.mark.parametrize("compare", ["orthogonal", "vertical"])
def test_a_name_of_the_study_is_fitted_through_all_that_is_made_of_it(
    tmp_path: Path, compare: str
) -> None:
    """Derivatives by the chain rule; nothing to fit is said where it stands."""
    named = {
        "title:": "parameters: {peak: 4 MPa, spare: 1 MPa}\ntitle:",
        "tau_s: 4 MPa, tau_k: 0 MPa": 'tau_s: peak, tau_k: "0.1*peak"',
        "friction.tau_s: {": "peak: {",
        "compare: orthogonal": f"compare: {compare}",
        "maxh: 5 mm": "maxh: 10 mm",
    }
    follow, p = model(study_of(tmp_path, pulled(12)[:6], named)), np.array([5e6, 0.2e-3])
    assert_richardson(follow, p, follow.compare(p).jacobian, [0], 1e-7)
    with pytest.raises(StudyError, match="no section uses spare"):
        study_of(tmp_path, pulled(12)[:6], named | {"friction.tau_s: {": "spare: {"})


def test_the_law_of_the_gallery_is_found_through_its_snap_back(tmp_path: Path) -> None:
    """Data from the closed form with noise, the model in two dimensions."""
    table = np.loadtxt(CONFIG.with_suffix(".csv"), delimiter=",", comments=("#", "D"))
    record = fit(
        study_of(
            tmp_path,
            table * [1e-3, 1e3],
            {"start: 4 MPa": "start: 6 MPa", "start: 0.3": "start: 0.2"},
        )
    )
    found, error = record.values["estimate"], record.values["standard_error"]
    assert found == pytest.approx([7.32e6, 158e-6], rel=0.02)
    assert np.all(np.abs(found - [TAU, DELTA]) < 2.0 * error)
    assert error == pytest.approx([0.12e6, 2.8e-6], rel=0.15)
    assert int(record.attributes["evaluations"]) <= 16
    assert float(record.attributes["fit_probability"]) > 0.01
    assert record.attributes["not_determined"] == ""
    residual, above = record.values["residual"], record.values["datum"] > record.values["predicted"]
    assert np.array_equal(residual > 0.0, above)  # observed − fitted


def test_what_the_mesh_does_to_the_numbers_is_said(tmp_path: Path) -> None:
    """Data of the closed form without noise: half the size takes about half of a bias."""
    found = tcstudy.run(
        study_of(tmp_path, pulled(45), {"maxh: 5 mm": "maxh: 8 mm"}), tmp_path / "a.nc"
    )
    shift, estimate, error = (
        found[name].values for name in ("mesh_shift", "estimate", "standard_error")
    )
    bias = (estimate - [TAU, DELTA]) / error
    assert np.all(np.abs(bias) > 1.0)
    assert -shift / bias == pytest.approx([0.5, 0.5], abs=0.1)
    assert "half its size would move" in text_of(tmp_path / "a.nc")


HEATED = """
title: Strip on a film, heated
body: {rectangle: {width: 1 m, height: 5 mm}}
boundary: {bottom: contact, left: {role: clamped, u_x: 0, u_y: free}, right: free, top: free}
material: {E: 200 GPa, nu: 0, plane: stress, alpha_T: 10e-6 1/K}
heat: {theta: 0 K}
friction: {law: tresca, tau: 2 MPa}
mesh: {maxh: 20 mm}
fit:
  data: {file: heated.csv, columns: {theta: "T [K]", u_T_max: "u [um]", friction_resultant: "R [kN/m]"}}
  noise: {u_T_max: 0.5 um, friction_resultant: 4 kN/m}
  parameters:
    friction.tau: {start: 2 MPa, within: [0.2 MPa, 20 MPa]}
    alpha_T: {start: 8e-6 1/K, within: [1e-6 1/K, 1e-4 1/K]}
"""


def heated(folder: Path, text: str = HEATED) -> Study:
    """A bar in closed form: R = EH α T, u = EH (αT)²/2τ, with α = 12e-6/K and τ = 3 MPa."""
    rng, T, EH = np.random.default_rng(4), np.linspace(20.0, 60.0, 12), 200e9 * 5e-3
    R, u = EH * 12e-6 * T, EH * (12e-6 * T) ** 2 / (2.0 * 3e6)
    R, u = R + 4e3 * rng.normal(size=12), u + 0.5e-6 * rng.normal(size=12)
    rows = "".join(
        f"{a:.6f},{b * 1e6:.6f},{c * 1e-3:.6f}\n" for a, b, c in zip(T, u, R, strict=True)
    )
    (folder / "heated.csv").write_text("T [K],u [um],R [kN/m]\n" + rows, encoding="utf-8")
    return read_study_text(text, "heated.yaml", source=folder / "heated.yaml")


def test_two_columns_of_a_heated_strip_find_its_expansion_and_its_film(tmp_path: Path) -> None:
    record = fit(heated(tmp_path))
    found, error = record.values["estimate"], record.values["standard_error"]
    assert np.all(np.abs(found - [3e6, 12e-6]) < 3.0 * error + 0.01 * found)
    evaluations = int(record.attributes["evaluations"])
    assert evaluations <= 12
    assert int(record.attributes["solves"]) <= 1.5 * 12 * (evaluations + 2)
    assert record.attributes["starts_tried"] == 1  # which the noise explains


def test_two_numbers_of_which_only_the_product_acts_are_named(tmp_path: Path) -> None:
    """R = EH αT of a held strip: Eα is found, neither number has an interval, and that is said."""
    text = HEATED.replace('u_T_max: "u [um]", ', "").replace("u_T_max: 0.5 um, ", "")
    old, new = (
        "friction.tau: {start: 2 MPa, within: [0.2 MPa, 20 MPa]}",
        "E: {start: 20 GPa, within: [10 GPa, 1000 GPa]}",
    )
    found = fit(heated(tmp_path, text.replace(old, new).replace("maxh: 20 mm", "maxh: 50 mm")))
    assert np.prod(found.values["estimate"]) == pytest.approx(200e9 * 12e-6, rel=0.01)
    assert found.attributes["determined"] == "E·alpha_T"
    assert found.attributes["not_determined"] in ("E^-1·alpha_T", "E·alpha_T^-1")
    assert np.isnan(found.values["standard_error"][0])


def test_a_slip_profile_finds_the_film(tmp_path: Path) -> None:
    """u(x) = (τ/2EH)(x − x₀)² behind the front x₀ = L − EHαT/τ, at 40 K: where it slips and how
    much."""
    x, EH, tau = np.linspace(0.5, 0.98, 25), 200e9 * 5e-3, 3e6
    front = 1.0 - EH * 10e-6 * 40.0 / tau
    u = tau / (2.0 * EH) * np.maximum(0.0, x - front) ** 2 + 0.3e-6 * np.random.default_rng(
        3
    ).normal(size=25)
    columns = 'columns: {x: "x [mm]", u_T: "u [um]"}}\n  noise: {u_T: 0.3 um}'
    head = HEATED[: HEATED.index("columns:")].replace("theta: 0 K", "theta: 40 K")
    text = f"{head}{columns}\n  parameters:\n    friction.tau: {{start: 1 MPa, within: [0.2 MPa, 20 MPa]}}\n"
    rows = "".join(f"{1e3 * a:.4f},{1e6 * b:.5f}\n" for a, b in zip(x, u, strict=True))
    (tmp_path / "heated.csv").write_text("x [mm],u [um]\n" + rows, encoding="utf-8")
    record = fit(read_study_text(text, "heated.yaml", source=tmp_path / "heated.yaml"))
    assert record.values["estimate"] == pytest.approx([tau], rel=0.01)
    observed_minus_fitted = record.values["datum"] - record.values["predicted"]
    assert record.values["residual"] == pytest.approx(observed_minus_fitted / 0.3e-6, abs=1e-9)
    assert int(record.attributes["solves"]) <= int(record.attributes["evaluations"]) + 2
    with pytest.raises(StudyError, match=r"a profile of u_T needs the columns x and u_T"):
        read_study_text(
            text.replace('x: "x [mm]", ', ""), "heated.yaml", source=tmp_path / "heated.yaml"
        )


A = 7.2e6
FILM = {
    "slip-weakening, tau_s: 4 MPa, tau_k: 0 MPa": "exponential, a: 4 MPa, b: 0",
    "friction.tau_s": "friction.a",
}


def curved(n: int) -> Array:
    """(n, 2) Δ [m] and P [N/m] of τ = a exp(−s/δ) on a thin strip, its grip pulled: half before the
    fold, half beyond.

    ½ D s′² = aδ (E − e^(−s/δ)), E = 1 until the front reaches the far end, then e^(−s₀/δ) of its
    slip s₀; so P² = 2 D aδ (E − y) with y = e^(−Δ/δ), and the bond is as long as the slip zone: y =
    E/cosh²(L √(E aδ/2D)/δ).
    """
    rate = LENGTH * np.sqrt(A * DELTA / (2.0 * D)) / DELTA
    y = 1.0 / np.cosh(rate * np.linspace(0.05, 0.98, n // 2)) ** 2
    E = np.append(np.ones(n // 2), np.geomspace(0.9, 2e-2, n - n // 2))
    y = np.append(y, E[n // 2 :] / np.cosh(rate * np.sqrt(E[n // 2 :])) ** 2)
    return np.stack([-DELTA * np.log(y), np.sqrt(2.0 * D * A * DELTA * (E - y))], axis=1)


def test_distances_to_the_curve_of_an_exponential_film(tmp_path: Path) -> None:
    """By a, delta and E as differences say, whatever straight pieces the path was followed on."""
    data = curved(12) * (1.0 + 0.01 * np.random.default_rng(5).normal(size=(12, 2)))
    follow = model(study_of(tmp_path, data, FILM | YOUNG | {"maxh: 5 mm": "maxh: 10 mm"}))
    p = np.array([9e6, 42.24e9, 0.12e-3])
    here, finer = follow.compare(p), replace(follow, law_error=1e-4).compare(p)
    assert_richardson(follow, p, here.jacobian, range(3))
    assert finer.residual == pytest.approx(here.residual, rel=1e-9, abs=1e-9)
    size = np.max(np.abs(here.jacobian), axis=0)
    assert finer.jacobian / size == pytest.approx(here.jacobian / size, rel=1e-9, abs=1e-9)


def test_an_exponential_film_is_found_through_its_snap_back(tmp_path: Path) -> None:
    """Data of the closed form, the model in two dimensions: what is left is the mesh, 5 mm of a
    strip of 190."""
    record = fit(study_of(tmp_path, curved(16), FILM))
    assert record.values["estimate"] == pytest.approx([A, DELTA], rel=0.02)
    assert int(record.attributes["evaluations"]) <= 16
    assert len(record.values["fold_vertex"]) >= 1
