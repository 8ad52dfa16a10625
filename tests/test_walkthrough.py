"""The walk-through runs, each step with its number, and the guide quotes it as it is."""

import runpy
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import tcstudy
from tests.commands import CONFIGS

HERE = Path(__file__).parent


def test_the_walk_through_runs_and_the_guide_quotes_it(capsys: pytest.CaptureFixture[str]) -> None:
    runpy.run_path(str(HERE / "walkthrough.py"))
    assert "largest inclusion residual" in capsys.readouterr().out
    guide = (HERE.parent / "tcstudy" / "README.md").read_text(encoding="utf-8")
    quoted = guide.split("```python\n")[1].split("```")[0]
    assert quoted in (HERE / "walkthrough.py").read_text(encoding="utf-8")
    assert quoted.count("tcstudy.") >= 4


def test_the_import_is_cheap_and_the_door_is_whole() -> None:
    code = (
        "import sys, tcstudy\n"
        "heavy = {'numpy', 'scipy', 'ngsolve', 'xarray', 'argparse', 'ruamel'} & set(sys.modules)\n"
        "assert not heavy, heavy\n"
        "for name in tcstudy.__all__: assert callable(getattr(tcstudy, name)) or name == '__version__', name\n"
        "import tcstudy.contact.solve, tcstudy.reports.text\n"
        "assert callable(tcstudy.solve) and tcstudy.contact.solve.solve_contact\n"
        "assert callable(tcstudy.report) and tcstudy.reports.text\n"
    )
    subprocess.run([sys.executable, "-c", code], check=True, cwd=HERE.parent)


TABLES = {"xarray", "pandas", "dask"}
SOLVING = {"ngsolve", "netgen", "scipy"}
UNUSED = TABLES | {"pint", "scipy.spatial", "scipy.stats", "scipy.optimize", "matplotlib"}
"""Modules that a small run does not need, whose imports would take longer than it."""


def loaded_by(*words: object) -> set[str]:
    """Return the modules that a process has loaded after a command of tcstudy."""
    code = (
        "import sys\n"
        "from tcstudy.cli import main\n"
        "assert main(sys.argv[1:]) == 0\n"
        "print('\\n' + ' '.join(sys.modules))\n"
    )
    command = [sys.executable, "-c", code, *map(str, words)]
    output = subprocess.run(command, check=True, capture_output=True, text=True).stdout
    return {*output.splitlines()[-1].split()}


def test_a_command_loads_what_it_needs(tmp_path: Path) -> None:
    """A run loads none of the libraries of tables; a finished one, and what is shown of it, neither
    mesher nor solver."""
    file = tmp_path / "run.nc"
    one_point = (CONFIGS / "quickstart.yaml", "--set=sweep={}", "--set=mesh.levels=1")
    run = ("run", *one_point, f"--output={file}")
    first = loaded_by(*run)
    assert {"ngsolve", "scipy.linalg", "netCDF4"} <= first
    assert not first & UNUSED
    assert not loaded_by(*run) & (UNUSED | SOLVING)
    assert not loaded_by("show", file) & (UNUSED | SOLVING)
    assert not loaded_by(*run, "--dry-run") & UNUSED


A = [[2.0, -1.0], [-1.0, 2.0]]
LAW = tcstudy.law("tresca", tau=1.0)


def problem(
    A_tilde: object = A, l_tilde: object = (0, 0), c: object = (1, 1), law: object = LAW
) -> Any:
    return tcstudy.ContactProblem(A_tilde, l_tilde, c, law)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("call", "said"),
    [
        (
            lambda: problem([[2, 1], [0, 2]]),
            r"^A_tilde is not symmetric: \[0, 1\] = 1, \[1, 0\] = 0",
        ),
        (
            lambda: problem([[1, 2], [2, 1]]),
            r"^A_tilde is not positive definite \(smallest eigenvalue -1",
        ),
        (lambda: problem([[1, np.nan], [np.nan, 1]]), r"^A_tilde\[0, 1\] is not a finite number"),
        (lambda: problem(l_tilde=[0, np.inf]), r"^l_tilde\[1\] is not a finite number"),
        (lambda: problem(c=[1, 0]), r"^c\[1\] = 0 is no length"),
        (lambda: problem(l_tilde=[0, 0, 0]), r"^l_tilde has the shape \(3,\); it must be \(2,\)"),
        (lambda: problem(l_tilde="ab"), r"^l_tilde must be an array"),
        (lambda: problem(law="tresca"), "law is a str"),
        (lambda: problem(law=[LAW] * 3), "law has 3 laws, but c has 2 nodes"),
        (lambda: tcstudy.law("tresco", tau=1.0), "there is no law 'tresco'"),
        (lambda: tcstudy.law("tresca", mu=1.0), "no such parameter"),
        (lambda: tcstudy.law(points=[(0, -1.0)]), "law piecewise-linear"),
        (lambda: tcstudy.solve(problem(), "newton"), "there is no solver"),
        (lambda: tcstudy.solve(problem(), max_iterations=5), "is of bundle-newton"),
        (lambda: tcstudy.certify(problem(), [1.0]), "v has the shape"),
        (lambda: tcstudy.follow(problem(), [1, 0], [5, 5]), "no path"),
    ],
)
def test_bad_matrices_and_options_are_refused_in_one_line(
    call: Callable[[], object], said: str
) -> None:
    with pytest.raises(tcstudy.ProblemError, match=said) as fault:
        call()
    assert "\n" not in str(fault.value)


def test_a_law_for_every_node_is_solved_certified_and_followed() -> None:
    """Two springs that do not touch, on a film that softens and on one that slips: each is what it
    is alone."""
    soft, slipping = (
        tcstudy.law("slip-weakening", tau_s=1.0, tau_k=0.0, delta=4.0),
        tcstudy.law("tresca", tau=0.5),
    )
    both = tcstudy.ContactProblem(np.eye(2), [1.2, 1.2], [1.0, 1.0], [soft, slipping])
    answer = tcstudy.solve(both)
    assert answer.v == pytest.approx([4 / 15, 0.7], rel=1e-12)
    assert tcstudy.certify(both, answer).unique
    path = tcstudy.follow(both, [1.0, 1.0], answer, t_min=-1.2, t_max=4.0)
    for t, u in zip(1.2 + path.t, path.u, strict=True):
        assert u[1] == pytest.approx(max(0.0, t - 0.5), abs=1e-14)
        assert u[0] == pytest.approx(
            max(0.0, min((t - 1.0) / 0.75, 4.0), t if t > 4.0 else 0.0), abs=1e-14
        )
    assert tcstudy.ContactProblem(np.eye(2), [1.2, 1.2], [1.0, 1.0], [soft, soft]).law is soft


def test_units_decide_nothing() -> None:
    for force, length in ((1e9, 1e-6), (1e-7, 1e5)):
        law = tcstudy.law("slip-weakening", tau_s=force, tau_k=0.0, delta=4 * length)
        matrix = np.array([[1.0, 1e-13], [0.0, 1.0]]) * force / length
        problem = tcstudy.ContactProblem(matrix, np.array([1.2, 0.5]) * force, [1.0, 1.0], law)
        assert tcstudy.solve(problem).v / length == pytest.approx([4 / 15, 0.0], rel=1e-12)


def test_a_study_changes_by_keys() -> None:
    study = tcstudy.load(CONFIGS / "quickstart.yaml")
    assert "\n" not in repr(study)
    assert len(repr(study)) < 200
    once = study.with_(mesh_levels=2)
    assert (study.mesh.levels, once.mesh.levels) == (4, 2)
    assert once.with_(mesh_levels=3).mesh.levels == 3
    alone = once.with_(sweep=None, heat_alpha=50.0)
    assert (len(alone.scenes), alone.mesh.levels, alone.scenes[0].heat.alpha) == (1, 2, 50.0)
    named = tcstudy.load(
        CONFIGS / "quickstart.yaml", {"parameters": {"size": 0.02}, "mesh.maxh": "size"}
    )
    assert named.with_(size=0.03).with_({"parameters.size": 0.04}).with_(size=0.01).mesh.maxh == (
        0.01,
    )
    with pytest.raises(tcstudy.StudyError, match=r"mesh\.level"):
        study.with_(mesh_level=2)
