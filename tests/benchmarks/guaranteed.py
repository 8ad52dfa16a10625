"""Is λ₁ of random bodies within its band? `python -m tests.benchmarks.guaranteed [COUNT] [--first SEED]`.

Scenes of tests/verification/test_guaranteed.py: 1 cm to 100 m, ν to 0.4999, springs, rigid edges, two materials. The
reference is NGSolve's order 4 on a mesh refined once, an upper bound that lies near λ₁; with rigid edges P1 on the mesh
refined thrice, whose own band must overlap. Cost: CPU time over that of the P1 factorisation and λ₁ of the same mesh.
"""

from __future__ import annotations

import argparse
import time

import numpy as np

from tcstudy.errors import GeometryFailed
from tcstudy.offline.guaranteed import dual_body, lambda_1_band
from tcstudy.offline.level import Level
from tcstudy.scene.records import Rigid
from tests.verification.scenes import levels_of, study_of
from tests.verification.test_guaranteed import bands, reference, scene_of


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("count", nargs="?", type=int, default=500)
    parser.add_argument("--first", type=int, default=0)
    options = parser.parse_args()
    wrong, widths, ratios, refused = [], [], [], 0
    for seed in range(options.first, options.first + options.count):
        study = study_of(scene_of(seed))
        try:
            scene, mesh = study.scenes[0], levels_of(study)[0].mesh
        except GeometryFailed:  # a rigid edge that turns, and meets one that holds it
            refused += 1
            continue
        clock = time.process_time()
        level = Level(mesh, scene)
        A_tilde = level.condensed(scene).problem.A_tilde
        primal = time.process_time() - clock
        clock = time.process_time()
        band = lambda_1_band(dual_body(mesh, scene, level.line), mesh, level.line, A_tilde)
        ratios.append((time.process_time() - clock) / primal)
        if any(isinstance(role, Rigid) for _, role in scene.boundary):
            finest = bands(scene_of(seed), "mesh.levels=4")[-1][2]
            least, most = finest.low, finest.high
        else:
            least = most = reference(level, scene)
        widths.append((band.high - band.low) / most)
        if not (band.low <= most * (1 + 1e-6) and least <= band.high * (1 + 1e-6)):
            wrong.append(seed)
            print(f"{seed}: {band} does not meet {least:g} … {most:g}", flush=True)
    print(f"{len(wrong)} of {len(ratios)} outside ({refused} drawn that cannot be)")
    print(f"width of the band: median {np.median(widths):.1%} of λ₁")
    print(f"cost over P1: median {np.median(ratios):.1f}, largest {max(ratios):.1f}")


if __name__ == "__main__":
    main()
