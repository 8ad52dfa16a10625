"""Commands of tcstudy for tests: in this process, or as a process of its own, which takes two seconds to start."""

from __future__ import annotations

import contextlib
import io
import os
import subprocess
import sys
import traceback
import warnings
from pathlib import Path
from typing import NamedTuple

from tcstudy.cli import main

CONFIGS = Path(__file__).parents[1] / "configs"
CRASHED = 99
"""The exit code that stands for an error that is none of ours; its traceback is in what was said on standard error."""


class Said(NamedTuple):
    """How a command ended."""

    returncode: int
    stdout: str
    stderr: str


def tcstudy_command(*words: str | Path, cwd: Path | None = None) -> Said:
    """What `tcstudy WORDS` says and returns, run here in a folder, with warnings as errors."""
    out, err = io.StringIO(), io.StringIO()
    with contextlib.ExitStack() as stack:
        stack.enter_context(contextlib.chdir(cwd or Path.cwd()))
        stack.enter_context(contextlib.redirect_stdout(out))
        stack.enter_context(contextlib.redirect_stderr(err))
        stack.enter_context(warnings.catch_warnings())
        warnings.simplefilter("error")
        try:
            code = main([*map(str, words)])
        except SystemExit as stop:
            code = int(stop.code or 0)
        except BaseException:
            code = CRASHED
            err.write(traceback.format_exc())
    return Said(code, out.getvalue(), err.getvalue())


def tcstudy_process(*words: str | Path, cwd: Path) -> subprocess.CompletedProcess[str]:
    """The same as a user's shell starts it."""
    environment = {**os.environ, "OPENBLAS_NUM_THREADS": "1", "PYTHONWARNINGS": "error"}
    return subprocess.run(
        [sys.executable, "-m", "tcstudy", *map(str, words)], cwd=cwd, env=environment, text=True, capture_output=True
    )
