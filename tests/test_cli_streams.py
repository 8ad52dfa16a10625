"""The command line with streams that are closed, full or without a reader, and with little
memory."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from tcstudy import cli
from tests.commands import tcstudy_command
from tests.test_cli import STUDY as BLOCK

pytestmark = pytest.mark.skipif(os.name == "nt", reason="shell redirections of POSIX")

COARSE = BLOCK.replace("maxh: 0.3, levels: 2", "maxh: 0.5, levels: 1")
STUDY = (
    r'title: "\e[31mred\e]0;own\a"'
    + "\n"
    + COARSE.replace("[0.005, 0.01]", "{linspace: [0.005, 0.01, 40]}")
)


def shell(command: str, folder: Path) -> subprocess.CompletedProcess[bytes]:
    """The exit code of the first command of a pipe; TC stands for tcstudy."""
    (folder / "block.yaml").write_text(STUDY)
    script = f"TC() {{ '{sys.executable}' -m tcstudy \"$@\"; }}; {command}; exit ${{PIPESTATUS[0]}}"
    env = {**os.environ, "OPENBLAS_NUM_THREADS": "1", "PYTHONWARNINGS": "error"}
    return subprocess.run(["bash", "-c", script], cwd=folder, env=env, capture_output=True)


@pytest.mark.parametrize("redirection", ["2>&1 | head -1", ">&- 2>&-"])
def test_a_run_finishes_whoever_reads(tmp_path: Path, redirection: str) -> None:
    result = shell(f"TC run block.yaml --output a.nc {redirection}", tmp_path)
    assert result.returncode == 0, result.stderr
    assert (tmp_path / "a.nc").exists()
    assert b"Traceback" not in result.stderr
    shown = tcstudy_command("show", tmp_path / "a.nc", code=0).stdout
    assert "\x1b" not in shown
    assert "\\x1b[31mred" in shown


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="a device of Linux")
def test_what_could_not_be_printed_is_no_success(tmp_path: Path) -> None:
    result = shell("TC --help >/dev/full", tmp_path)
    assert result.returncode == cli.NO_ROOM
    assert result.stderr.count(b"\n") == 1
    assert b"No space left on device; what was to be printed is lost" in result.stderr


@pytest.mark.parametrize("error", [MemoryError, ZeroDivisionError])
def test_missing_memory_is_one_line_and_other_errors_are_not_called_that(
    error: type[Exception], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def work(options: object) -> int:
        raise error

    monkeypatch.setitem(cli.COMMANDS, "run", cli.COMMANDS["run"]._replace(run=work))
    if error is ZeroDivisionError:
        with pytest.raises(ZeroDivisionError):
            cli.main(["run", "block.yaml"])
        return
    assert cli.main(["run", "block.yaml"]) == cli.NO_ROOM
    said = capsys.readouterr().err
    assert said.startswith("there is not enough memory; nothing was written")
    assert said.count("\n") == 1


NOISY = """body:
  outline: [{from: [0 mm, 0 mm], edge: bottom}, {from: [200 mm, 0 mm], edge: right},
            {from: [200 mm, 50 mm], edge: top}, {from: [0 mm, 50 mm], edge: left}]
  holes: [{circle: {center: [80 mm, 25 mm], radius: 10 mm, edge: h1}},
          {circle: {center: [100.001 mm, 25 mm], radius: 10 mm, edge: h2}}]
boundary: {bottom: contact, left: clamped, top: free, h1: free, h2: free,
           right: {role: traction, g: [2 MPa, 0]}}
material: {E: 210 GPa, nu: 0.3}
friction: {law: tresca, tau: 1 MPa}
mesh: {maxh: 20 mm}
"""


def test_json_is_one_object_whatever_the_mesher_prints(tmp_path: Path) -> None:
    """Holes 1 µm apart are meshed at the second attempt; the mesher says so on descriptor 1."""
    (tmp_path / "noisy.yaml").write_text(NOISY)
    for words in ("run noisy.yaml --dry-run --json", "run noisy.yaml --json"):
        result = shell(f"TC {words}", tmp_path)
        assert (result.returncode, json.loads(result.stdout)["title"]) == (0, "noisy")


def test_results_do_not_go_into_a_stream(tmp_path: Path) -> None:
    """Whatever file the descriptor has: results are renamed into their place."""
    (tmp_path / "link.nc").symlink_to("/dev/stdout")
    for name in ("/dev/stdout", "/proc/self/fd/1", "link.nc", "-", "${HOME}/a.nc"):
        result = shell(f"TC run block.yaml -q --output '{name}' > out.txt", tmp_path)
        assert (result.returncode, result.stderr.count(b"\n")) == (2, 1), result.stderr
    assert sorted(path.name for path in tmp_path.iterdir()) == ["block.yaml", "link.nc", "out.txt"]
    assert not (tmp_path / "out.txt").stat().st_size


@pytest.mark.parametrize("backend", ["module://matplotlib_inline.backend_inline", "nonsense"])
def test_no_backend_of_the_environment_matters(tmp_path: Path, backend: str) -> None:
    pytest.importorskip("matplotlib")
    (tmp_path / "coarse.yaml").write_text(COARSE)
    result = shell(f"MPLBACKEND={backend} TC draw coarse.yaml a.png", tmp_path)
    assert (result.returncode, result.stderr) == (0, b"")
