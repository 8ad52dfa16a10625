"""The command line as a user types it: exit codes, one clear line an error, nothing left behind."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

import tcstudy
from tests.commands import tcstudy_command, tcstudy_process

STUDY = """units: none
body: {rectangle: {width: 2, height: 1}}
boundary: {bottom: contact, left: clamped, top: {role: traction, g: [0.02, 0]}, right: free}
material: {E: 1, nu: 0.3}
friction: {law: tresca, tau: 0.01}
mesh: {maxh: 0.3, levels: 2}
sweep: {tau: [0.005, 0.01]}
"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "block.yaml").write_text(STUDY)
    return tmp_path


def test_run_writes_the_file_and_a_table(folder: Path) -> None:
    """In a process of its own, as the others are not: streams, exit code, what is left are those of a shell."""
    result = tcstudy_process("run", "block.yaml", cwd=folder)
    assert result.returncode == 0, result.stderr
    assert (folder / "results" / "block.nc").exists()
    assert "4 of 4 solutions found; data in results/block.nc" in result.stdout
    assert "level 1: h_max =" in result.stderr
    assert list(folder.glob("results/*")) == [folder / "results" / "block.nc"]
    shown = tcstudy_command("show", "results/block.nc", cwd=folder)
    assert shown.returncode == 0
    assert shown.stdout.strip() in result.stdout
    (folder / "block.yaml").write_text(STUDY.replace("maxh: 0.3", "maxh: 0"))
    refused = tcstudy_process("run", "block.yaml", cwd=folder)
    assert (refused.returncode, refused.stdout, refused.stderr.count("\n")) == (2, "", 1)


def test_one_line_one_object_and_narrow_tables(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    quiet = tcstudy_command("run", "block.yaml", "-q", cwd=folder)
    assert (quiet.returncode, quiet.stderr) == (0, "")
    assert quiet.stdout.startswith("results/block.nc: Largest slip")
    assert "2 of 2 solved" in quiet.stdout
    assert quiet.stdout.count("\n") == 1
    found = json.loads(tcstudy_command("show", "results/block.nc", "--json", cwd=folder).stdout)
    with tcstudy.open_results(folder / "results" / "block.nc") as tree:
        assert [point["u_T_max"] for point in found["points"]] == tree["u_T_max"].values.tolist()
    wide = tcstudy_command("show", "results/block.nc", cwd=folder).stdout
    monkeypatch.setenv("COLUMNS", "80")
    assert max(map(len, wide.splitlines())) > 80
    assert max(map(len, tcstudy_command("show", "results/block.nc", cwd=folder).stdout.splitlines())) <= 80
    assert tcstudy_command("show", "results/block.nc", "-v", cwd=folder).stdout == wide


def test_draw(folder: Path) -> None:
    assert tcstudy_command("run", "block.yaml", cwd=folder).returncode == 0
    words = ("--x", "tau", "--y", "slip_length", "--size", "8x10cm")
    curves = tcstudy_command("draw", "results/block.nc", "c.png", *words, cwd=folder)
    assert (curves.returncode, curves.stdout) == (0, "c.png: slip_length over tau, level 1\n"), curves.stderr
    for words, said in (
        (("--at", "tua=0.01"), "tau"),
        (("--map", "tau"), "--map: name two"),
        (("--size", "tau"), "--size: "),
    ):
        wrong = tcstudy_command("draw", "results/block.nc", "b.png", *words, cwd=folder)
        assert (wrong.returncode, wrong.stderr.count("\n")) == (2, 1)
        assert said in wrong.stderr
    assert not (folder / "b.png").exists()


def test_plan_touches_nothing(folder: Path) -> None:
    result = tcstudy_command("run", "block.yaml", "--dry-run", cwd=folder)
    assert result.returncode == 0, result.stderr
    assert "2 points × 2 levels = 4 solutions" in result.stdout
    assert "left out: heat problem: " in result.stdout
    assert "level  maxh " in result.stdout
    assert "about" not in result.stdout.split("left out")[0]  # sizes are counted
    assert "1 stiffness factorisation, no temperature field" in result.stdout
    assert " s of CPU time, about 0.3 GB\n" in result.stdout
    assert sorted(p.name for p in folder.iterdir()) == ["block.yaml"]
    found = json.loads(tcstudy_command("run", "block.yaml", "--dry-run", "--json", cwd=folder).stdout)
    assert (found["points"], len(found["levels"]), found["factorisations"]) == (2, 2, 1)


@pytest.mark.parametrize(
    ("words", "name"),
    [
        *(("run block.yaml --output=", name) for name in ("/dev/null", "x" * 300, "", "d/", "a\x1b[1m")),
        ("converge block.yaml --plot=", "a\nb"),
        ("export block.nc --csv --output=", "x" * 300),
        ("init ", "a\x1b[1m"),
    ],
)
def test_what_cannot_name_an_output_is_refused_in_one_line(words: str, name: str, folder: Path) -> None:
    *before, last = words.split(" ")
    refused = tcstudy_command(*before, last + name, cwd=folder)
    assert refused.returncode == 2
    assert refused.stderr.count("\n") == 1
    assert "usage:" not in refused.stderr


def test_usage_errors(folder: Path) -> None:
    assert tcstudy_command(cwd=folder).returncode == 2
    assert tcstudy_command("fly", cwd=folder).returncode == 2
    missing = tcstudy_command("run", "missing.yaml", cwd=folder)
    assert missing.returncode == 2
    assert missing.stderr.count("\n") == 1
    for command in ("run", "cost"):
        slashed = tcstudy_command(command, "block.yaml", "--output", "new/", cwd=folder)
        assert slashed.returncode == 2
        assert "new/ is a folder; give the name of a file in it" in slashed.stderr
    assert "is a directory; name a file in it" in tcstudy_command("show", ".", cwd=folder).stderr
    not_results = tcstudy_command("show", "block.yaml", cwd=folder)
    assert not_results.returncode == 2
    assert "block.yaml is a study and not its results; name the .nc file" in not_results.stderr
    (folder / "block.nc").write_bytes(b"\x89HDF")
    assert "this is a result file; name its study" in tcstudy_command("run", "block.nc", cwd=folder).stderr
    page = tcstudy_command("report", "block.nc", "-o", "page.pdf", cwd=folder)
    assert (page.returncode, page.stderr.strip()) == (2, "page.pdf: a page's name ends in .html; choose such a name")


def test_a_command_loads_no_other(folder: Path) -> None:
    code = (
        "import sys; from tcstudy.cli import main\n"
        "try: main(['run', 'missing.yaml'])\n"
        "except SystemExit: pass\n"
        "print(sorted(name.split('.')[-1] for name in sys.modules if name.startswith('tcstudy.commands.')))"
    )
    result = subprocess.run([sys.executable, "-c", code], cwd=folder, text=True, capture_output=True)
    assert result.stdout == "['run', 'shared']\n"


def test_help_and_faults_load_nothing_heavy(folder: Path) -> None:
    (folder / "bad.yaml").write_text(STUDY.replace("maxh: 0.3", "maxh: 0"))
    code = (
        "import sys; from tcstudy.cli import main\n"
        "try: main(sys.argv[1:])\n"
        "except SystemExit: pass\n"
        "heavy = {'ngsolve', 'netgen', 'matplotlib', 'xarray'} & set(sys.modules)\n"
        "light = {'numpy', 'scipy', 'shapely', 'pint', 'ruamel'} & set(sys.modules)\n"
        "print('HEAVY', sorted(heavy), 'LIGHT', sorted(light))"
    )
    for words, light in ((["--help"], "[]"), (["run", "--help"], "[]"), (["run", "bad.yaml", "--dry-run"], None)):
        result = subprocess.run([sys.executable, "-c", code, *words], cwd=folder, text=True, capture_output=True)
        assert "HEAVY []" in result.stdout, result.stdout + result.stderr
        if light is not None:
            assert f"LIGHT {light}" in result.stdout


def test_a_finished_study_ends_at_once_and_another_one_asks(folder: Path) -> None:
    first = tcstudy_command("run", "block.yaml", cwd=folder)
    file = folder / "results" / "block.nc"
    before = file.read_bytes()
    again = tcstudy_command("run", "block.yaml", cwd=folder)
    assert (first.returncode, again.returncode) == (0, 0)
    assert again.stderr == "results/block.nc holds these results already; --force computes them again\n"
    assert again.stdout.replace("found before", "found") == first.stdout
    other = tcstudy_command("run", "block.yaml", "--set", "sweep={}", cwd=folder)
    assert other.returncode == 2
    assert other.stderr.startswith("block.yaml: results/block.nc holds the results of another study")
    assert other.stderr.count("\n") == 1
    assert file.read_bytes() == before
    cases = (([], "holds these results already; a run ends at once"), (["--set", "sweep={}"], "a run would stop here"))
    for words, said in cases:
        planned = tcstudy_command("run", "block.yaml", "--dry-run", *words, cwd=folder)
        assert planned.returncode == 0
        assert said in planned.stdout
    forced = tcstudy_command("run", "block.yaml", "--set", "sweep={}", "--force", cwd=folder)
    assert forced.returncode == 0, forced.stderr
    with tcstudy.open_results(file) as tree:
        assert tree["status"].shape == (2,)
