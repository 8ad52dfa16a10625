"""What the tool advises: the command that fits a run, the command and the key that were meant."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.commands import tcstudy_command
from tests.test_cli import STUDY

SOFTENING = ("friction={law: slip-weakening, tau_s: 0.02, tau_k: 0, delta: 0.001}", "sweep={g_x: [0.01, 0.02]}")
HEATED = ("material.beta=1", "heat={}", "sweep={theta: [0.001, 0.03]}", SOFTENING[0])


@pytest.mark.parametrize(
    ("options", "told"),
    [
        (("mesh.levels=4",), "how exact these are: tcstudy converge block.yaml --set=mesh.levels=4\n"),
        (HEATED, "'--set=path={parameter: heat.theta, from: 0.001, to: 0.03}'\n"),
        ((*HEATED, "solver={branch: all}"), "how exact these are: tcstudy converge"),
        (
            (
                "solver={name: separable-newton, tolerance: 1e-19}",
                "friction={law: exponential, b: 0.004, delta: 0.05}",
                "sweep={a: [0.006, 0.007]}",
            ),
            "what failed, and why: tcstudy show results/block.nc -v\n",
        ),
    ],
    ids=["levels", "swept load", "all known", "failed"],
)
def test_a_run_ends_with_the_command_that_fits_it(tmp_path: Path, options: tuple[str, ...], told: str) -> None:
    (tmp_path / "block.yaml").write_text(STUDY)
    result = tcstudy_command("run", "block.yaml", *(f"--set={text}" for text in options), cwd=tmp_path)
    assert told in result.stdout
    assert ("whether a path" in result.stdout) == ("path={" in told)


@pytest.mark.parametrize(
    ("word", "remedy"),
    [
        ("convrge", "did you mean 'converge'?"),
        ("study.yaml", "did you mean tcstudy run study.yaml?"),
        ("zzz", "use one of run, converge, cost, show, draw, report, export, init"),
    ],
)
def test_the_nearest_command_is_named(tmp_path: Path, word: str, remedy: str) -> None:
    result = tcstudy_command(word, cwd=tmp_path)
    assert result.returncode == 2
    assert result.stderr.startswith(f"tcstudy: there is no command {word!r}; {remedy}")
    assert result.stderr.count("\n") == 1


@pytest.mark.parametrize(
    ("words", "now"),
    [
        (("plan", "study.yaml", "--set", "E=1"), "plan is now: tcstudy run study.yaml --set E=1 --dry-run"),
        (("path", "a b.yaml"), "path is now: tcstudy run 'a b.yaml', which does what the study asks"),
        (("merge",), "merge is now: xarray's work: see 'Files that grow' in results/README.md"),
    ],
)
def test_a_former_command_says_what_to_type_now(words: tuple[str, ...], now: str) -> None:
    result = tcstudy_command(*words)
    assert result.returncode == 2
    assert result.stderr.startswith(f"tcstudy: {now}")
    assert result.stderr.count("\n") == 1
