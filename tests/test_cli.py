"""The command line as a user types it: exit codes, one clear line an error, nothing left behind."""

import json
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import tcstudy
from tcstudy.cli import COMMANDS
from tests.commands import Said, tcstudy_command, tcstudy_process

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


@pytest.fixture(scope="module")
def ran(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Said]:
    """The study run in a process of its own, so that streams, exit code, what is left are those of
    a shell."""
    folder = tmp_path_factory.mktemp("ran")
    (folder / "block.yaml").write_text(STUDY)
    done = tcstudy_process("run", "block.yaml", cwd=folder)
    assert done.returncode == 0, done.stderr
    assert list(folder.glob("results/*")) == [folder / "results" / "block.nc"]
    return folder, Said(0, done.stdout, done.stderr)


def test_run_writes_the_file_and_a_table(
    ran: tuple[Path, Said], monkeypatch: pytest.MonkeyPatch
) -> None:
    folder, result = ran
    assert "  Solved    2 of 2 points, 2 levels; residual ≤" in result.stdout
    assert "  data in results/block.nc" in result.stdout
    assert "level 1: h_max =" in result.stderr
    wide = tcstudy_command("show", "results/block.nc", cwd=folder).stdout
    assert wide.strip() in result.stdout
    quiet = tcstudy_command("show", "results/block.nc", "-q", cwd=folder)
    assert (quiet.stderr, quiet.stdout.count("\n")) == ("", 1)
    assert re.match(r"results/block\.nc: Largest slip.*2 of 2 points", quiet.stdout)
    found = json.loads(tcstudy_command("show", "results/block.nc", "--json", cwd=folder).stdout)
    with tcstudy.open_results(folder / "results" / "block.nc") as tree:
        assert found["values"]["u_T_max"] == tree["u_T_max"].values.tolist()
    monkeypatch.setenv("COLUMNS", "80")
    assert max(map(len, wide.splitlines())) > 80
    assert (
        max(map(len, tcstudy_command("show", "results/block.nc", cwd=folder).stdout.splitlines()))
        <= 80
    )
    assert tcstudy_command("show", "results/block.nc", "-v", cwd=folder).stdout == wide


def test_draw(ran: tuple[Path, Said]) -> None:
    words = ("--x", "tau", "--y", "slip_length", "--size", "8x10cm")
    curves = tcstudy_command("draw", "results/block.nc", "c.png", *words, cwd=ran[0], code=0)
    assert curves.stdout == "c.png: slip_length over tau, level 1\n"
    for option, said in (
        ("--at=tua=0.01", "tau"),
        ("--map=tau", "--map: name two"),
        ("--size=tau", "--size: "),
    ):
        assert (
            said
            in tcstudy_command(
                "draw", "results/block.nc", "b.png", option, cwd=ran[0], code=2
            ).stderr
        )
    assert not (ran[0] / "b.png").exists()


def test_a_finished_study_ends_at_once_and_another_one_asks(ran: tuple[Path, Said]) -> None:
    folder, first = ran
    file = shutil.copy(folder / "results" / "block.nc", folder / "again.nc")
    asked, other = ("run", "block.yaml", "-o", "again.nc"), ("--set", "sweep={}")
    again = tcstudy_command(*asked, cwd=folder, code=0)
    assert again.stderr == "again.nc holds these results already; --force computes them again\n"
    assert again.stdout.replace("found before", "found") == first.stdout.replace(
        "results/block", "again"
    )
    refused = tcstudy_command(*asked, *other, cwd=folder, code=2)
    assert refused.stderr.startswith("block.yaml: again.nc holds the results of another study")
    for words, said in (
        ((), "holds these results already; a run ends at once"),
        (other, "a run would stop here"),
    ):
        assert said in tcstudy_command(*asked, "--dry-run", *words, cwd=folder, code=0).stdout
    assert file.read_bytes() == (folder / "results" / "block.nc").read_bytes()
    tcstudy_command(*asked, *other, "--force", cwd=folder, code=0)
    with tcstudy.open_results(file) as tree:
        assert tree["status"].shape == (2,)


def test_plan_touches_nothing(folder: Path) -> None:
    result = tcstudy_command("run", "block.yaml", "--dry-run", cwd=folder, code=0)
    for said in ("2 points × 2 levels = 4 solutions", "  Left out  heat problem: ", "level  maxh ",
                 " s of CPU time, about 0.3 GB\n", "  Output    results/block.nc\n"):  # fmt: skip
        assert said in result.stdout
    [mesh] = [line for line in result.stdout.splitlines() if line.startswith("  Mesh")]
    assert "about" not in mesh  # sizes are counted
    assert all(len(line) <= 80 for line in result.stdout.splitlines())
    assert sorted(p.name for p in folder.iterdir()) == ["block.yaml"]
    found = json.loads(
        tcstudy_command("run", "block.yaml", "--dry-run", "--json", cwd=folder).stdout
    )
    assert (found["points"], len(found["levels"])) == (2, 2)
    assert found["verdict"]["work"] == ["2 points × 2 levels = 4 solutions"]


PATH = "--set=path={parameter: load, from: 0, to: 2} "
REFUSED = [
    *((f"run block.yaml --output={name}", "") for name in ("/dev/null", "x" * 300, "", "d/", "a\x1b[1m")),
    ("converge block.yaml --plot=a\nb", "has characters that no line shows"),
    (f"export block.yaml --csv --output={'x' * 300}", ""),
    ("init a\x1b[1m", ""),
    ("run missing.yaml", "missing.yaml"),
    ("cost block.yaml --output=new/", "new/ is a folder; give the name of a file in it"),
    ("cost block.yaml --output=block.yaml/a.nc", "block.yaml is a file"),
    ("show .", "is a directory; name a file in it"),
    ("show block.yaml", "block.yaml is a study and not its results; name the .nc file"),
    ("run block.nc", "this is a result file; name its study"),
    ("report block.nc --output=page.pdf", "page.pdf: a page's name ends in .html; choose such a name"),
    ("convrge", "tcstudy: argument COMMAND: invalid choice: 'convrge' (choose from 'run', 'converge', 'cost',"),
    ("plan study.yaml", "tcstudy: plan is now: tcstudy run STUDY.yaml --dry-run"),
    ("merge", "tcstudy: merge is now: xarray's work: see 'Combine and compare files' in results/README.md"),
    ("converge block.yaml --set=mesh.levels=1", "one level has no convergence"),
    ("converge block.yaml --plot=a.txt", ".png"),
    ("converge block.yaml --at=tau=0.7", "no point has tau = 0.7"),
    ("cost block.yaml --at=friction.tau=0.7", "block.yaml: no point has tau = 0.7"),
    ("cost block.yaml --at=friction.tau=0.01 --at=tau=0.01", "friction.tau and tau are one parameter; give it once"),
    ("cost block.yaml --at=tau=0.01 --at=tau=0.005", "--at: tau is given twice"),
    (f"run block.yaml {PATH} --append", "--append adds points of a sweep, and block.yaml has a section path;"),
    (f"run block.yaml {PATH} --dask=local", "--dask: a path has no work for others; leave it out"),
    (f"run block.yaml {PATH} --set=mesh={{maxh: 0.3, tolerance: 0.2}}",
     "path: the path is of one mesh, and adaptive meshes follow from the solutions of a run"),
]  # fmt: skip


@pytest.mark.parametrize(("words", "message"), REFUSED)
def test_what_cannot_be_is_refused_in_one_line_and_leaves_nothing(
    words: str, message: str, folder: Path
) -> None:
    (folder / "block.nc").write_bytes(b"\x89HDF")
    command, _, options = words.partition(" --")
    given = [
        *command.split(" "),
        *(f"--{word.strip(' ')}" for word in options.split(" --") if options),
    ]
    refused = tcstudy_command(*given, cwd=folder, code=2)
    assert refused.stdout == ""
    assert message in refused.stderr
    assert "usage:" not in refused.stderr
    assert sorted(p.name for p in folder.iterdir()) == ["block.nc", "block.yaml"]


def test_a_picture_without_matplotlib_is_refused_before_any_work(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    refused = tcstudy_command("cost", "block.yaml", "--plot", "a.png", cwd=folder, code=2)
    assert 'pip install "tcstudy[plot]"' in refused.stderr
    assert sorted(p.name for p in folder.iterdir()) == ["block.yaml"]


def test_version_and_no_word_at_all(folder: Path) -> None:
    assert tcstudy_command("--version", cwd=folder).stdout == f"tcstudy {tcstudy.__version__}\n"
    assert tcstudy_command(cwd=folder).returncode == 2


def test_every_command_has_help(folder: Path) -> None:
    for name in COMMANDS:
        assert f"tcstudy {name} [-h]" in tcstudy_command(name, "--help", cwd=folder, code=0).stdout


def test_help_and_faults_load_nothing_heavy(folder: Path) -> None:
    (folder / "bad.yaml").write_text(STUDY.replace("maxh: 0.3", "maxh: 0"))
    code = (
        "import sys; from tcstudy.cli import main\n"
        "try: main(sys.argv[1:])\n"
        "except SystemExit: pass\n"
        "print(*(name for name in sys.modules if '.' not in name))"
    )
    heavy, light = (
        {"ngsolve", "netgen", "matplotlib", "xarray"},
        {"numpy", "scipy", "shapely", "pint", "ruamel"},
    )
    for words in ("--help", "run --help", "run bad.yaml --dry-run"):
        done = subprocess.run(
            [sys.executable, "-c", code, *words.split()], cwd=folder, text=True, capture_output=True
        )
        loaded = {*done.stdout.splitlines()[-1].split()}
        assert not loaded & (heavy if "bad" in words else heavy | light)
