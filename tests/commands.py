"""Commands of tcstudy for tests: in this process, or as a process of its own, which takes two
seconds to start."""

import io
import os
import subprocess
import sys
import traceback
from contextlib import chdir, redirect_stderr, redirect_stdout
from pathlib import Path
from typing import NamedTuple
from warnings import catch_warnings

from tcstudy.cli import main

CONFIGS = Path(__file__).parents[1] / "configs"
CRASHED = 99
"""The exit code that stands for an error that is none of ours; its traceback is in what was said on
standard error."""


class Said(NamedTuple):
    returncode: int
    stdout: str
    stderr: str


def tcstudy_command(*words: str | Path, cwd: Path | None = None, code: int | None = None) -> Said:
    """What `tcstudy WORDS` says and returns, run here in a folder, with warnings as errors. It must
    return `code`, if given; 2 comes with one line on standard error."""
    out, err = io.StringIO(), io.StringIO()
    with (
        chdir(cwd or Path.cwd()),
        redirect_stdout(out),
        redirect_stderr(err),
        catch_warnings(action="error"),
    ):
        try:
            found = main([*map(str, words)])
        except SystemExit as stop:
            found = int(stop.code or 0)
        except BaseException:
            found = CRASHED
            err.write(traceback.format_exc())
    assert code in (None, found), err.getvalue()
    assert code != 2 or err.getvalue().count("\n") == 1, err.getvalue()
    return Said(found, out.getvalue(), err.getvalue())


def tcstudy_process(*words: str | Path, cwd: Path) -> subprocess.CompletedProcess[str]:
    """The same as a user's shell starts it."""
    environment = {**os.environ, "OPENBLAS_NUM_THREADS": "1", "PYTHONWARNINGS": "error"}
    return subprocess.run(
        [sys.executable, "-m", "tcstudy", *map(str, words)],
        cwd=cwd,
        env=environment,
        text=True,
        capture_output=True,
    )
