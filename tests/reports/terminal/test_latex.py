"""LaTeX as the reports write it is read strictly. It was not compiled: no TeX engine was at hand (see latex_check)."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tcstudy.read.study import read_study_text
from tcstudy.reports.terminal.convergence import convergence_report
from tcstudy.reports.terminal.tables import Heading, Table, latex, render
from tcstudy.study.convergence_run import converge_to_file
from tests.reports.terminal.latex_check import faults

SWEPT = """\
title: "50 % of_the $ load: {ω/λ₁} & #1 ~ Körper β² ✓ [m⁻¹]"
units: none
body: {rectangle: {width: 2, height: 1}}
boundary: {bottom: contact, left: clamped, top: {role: traction, g: [0.02, 0]}, right: free}
material: {E: 1, nu: 0.499}
friction: {law: tresca, tau: 0.01}
mesh: {maxh: 0.6, levels: 4}
sweep: {friction: {a_1: {law: tresca, tau: 0.005}, b_2: {law: tresca, tau: 0.02}}, E: [1, 2]}
"""


@pytest.fixture(scope="module")
def report(tmp_path_factory: pytest.TempPathFactory) -> str:
    """Of a sweep with awkward names, singular corners, errors that are exact and notes."""
    path = tmp_path_factory.mktemp("latex") / "a.nc"
    converge_to_file(read_study_text(SWEPT), path, lambda text: None)
    return convergence_report(path, "latex")


def test_a_report_of_a_sweep(report: str) -> None:
    assert faults(report) == []
    assert report.count("\\begin{table}") == report.count("\\label{") > 12
    assert (
        r"50 \% of\_the \$ load: \{$\omega /\lambda _{1}$\} \& \#1 $\sim$ Körper $\beta ^{2}$ U+2713"
        in report.replace(r"$\omega$/$\lambda _{1}$", r"$\omega /\lambda _{1}$")
    )
    assert "a\\_1" in report


def test_a_report_without_a_sweep(tmp_path: Path) -> None:
    text = SWEPT[: SWEPT.index("sweep")] + "exact: {u: [0, 0], theta: 0}\n"
    converge_to_file(read_study_text(text), tmp_path / "a.nc", lambda text: None)
    found = convergence_report(tmp_path / "a.nc", "latex")
    assert faults(found) == []
    assert "\\label{tab:numbers}" in found


def test_rows_that_begin_like_an_option_and_tables_without_rows() -> None:
    table = Table("[a] u_T²", ("[m]", "b"), (("[1, 2]", "*"), ("*", "x_1^2")), ("note & more",), "u_T")
    found = render([Heading("r^2_b", 1), table, Table("empty", ("a", "b"), ())], "latex")
    assert faults(found) == []
    assert r"{}[1, 2] & * \\" in found


@pytest.mark.parametrize(
    ("plain", "tex"),
    [
        ("-1.5", "$-1.5$"),
        ("-1.5 ± 0.1", r"$-1.5$ $\pm$ 0.1"),
        ("(-2)", "($-2$)"),
        ("kJ m-1", "kJ m-1"),
        ("m⁻¹²", "m$^{-12}$"),
        ("u_T²", "$u_T^{2}$"),
        ("u_T₁", "$u_T{}_{1}$"),
        ("λ₁", r"$\lambda _{1}$"),
        ("$5·θ", r"\$5$\cdot \theta$"),
        ("θ$", r"$\theta$\$"),
        ("größer als ½", r"größer als $\tfrac12$"),
        ("a ✓ 𝛼", "a U+2713 U+1D6FC"),
        ("value 3e-05x", r"value $3\cdot10^{-5}$x"),
        ("line\nbreak", "line break"),
    ],
)
def test_signs(plain: str, tex: str) -> None:
    assert latex(plain) == tex
    assert faults(tex) == []


SIGNS = st.text(st.sampled_from("aé1 .-+e^_\\${}%#&~[]*()|<>θξΓ_C²¹⁻₁½°′∫·→√αu_Tr^HL²✓−–…\n"), max_size=25)


@settings(max_examples=400, deadline=None, derandomize=True)
@given(SIGNS, SIGNS, SIGNS)
def test_whatever_is_written(caption: str, cell: str, heading: str) -> None:
    table = Table(caption, (heading, "b"), ((cell, "1"), ("x", cell)), (heading,), "t")
    found = render([Heading(heading), table, cell], "latex")
    assert faults(found) == []


@pytest.mark.parametrize(
    "broken",
    [
        *(
            "a & b",
            "50 % off",
            "a_b",
            "x^2",
            "{",
            "}",
            "$a",
            r"\foo",
            r"\alpha",
            r"$\section$",
            "$a^{1}^{2}$",
            "$u_T_{1}$",
        ),
        *(
            "β",
            "✓",
            "a ~ b",
            r"\begin{table}",
            r"\end{table}",
            r"\label{a_b}",
            r"\label{a}\label{a}",
            "$${a}$$",
            r"a \\ b",
        ),
        *("{$a}$", "$a\nb$", r"\q"),
        "\\begin{tabular}{rr}\n\\toprule\na & b & c \\\\\n\\bottomrule\n\\end{tabular}",
        "\\begin{tabular}{rr}\n\\toprule\na & b\n\\bottomrule\n\\end{tabular}",
        "\\begin{tabular}{r}\n\\toprule\na \\\\\n[b] \\\\\n\\bottomrule\n\\end{tabular}",
        "\\begin{tabular}{}\n\\toprule\n\\bottomrule\n\\end{tabular}",
    ],
)
def test_the_reading_finds_what_is_broken(broken: str) -> None:
    assert faults(broken)
