"""Does a run take what `tcstudy run --dry-run` says? `python -m tests.benchmarks.forecasts [CONFIG …]`

Forecast and CPU seconds of one process, start and file included, for shipped studies, and their ratio.
"""

from __future__ import annotations

import argparse
import json
import resource
import subprocess
import sys
import tempfile
from pathlib import Path

CONFIGS = Path(__file__).parents[2] / "configs"
USUAL = ("quickstart", "thickness_map", "convergence", "stability", "ring", "random_adhesive", "welded_rail")


def main() -> None:
    """Plan and run each study in processes of their own."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("configs", nargs="*", default=USUAL)
    with tempfile.TemporaryDirectory() as folder:
        for name in parser.parse_args().configs:
            study, words = CONFIGS / f"{name}.yaml", [sys.executable, "-m", "tcstudy"]
            planned = subprocess.run(
                [*words, "run", study, "--dry-run", "--json"], capture_output=True, text=True, check=True
            )
            said = json.loads(planned.stdout)
            before = resource.getrusage(resource.RUSAGE_CHILDREN)
            options = ["-q", "--jobs", "1", "--output", Path(folder, f"{name}.nc")]
            subprocess.run([*words, "run", study, *options], check=True)
            after = resource.getrusage(resource.RUSAGE_CHILDREN)
            took = after.ru_utime - before.ru_utime + after.ru_stime - before.ru_stime
            told = said["unknown"] or f"{said['seconds']:.1f} s said, ratio {said['seconds'] / took:.2f}"
            print(f"{name}: {took:.1f} s of CPU time, {told}", flush=True)


if __name__ == "__main__":
    main()
