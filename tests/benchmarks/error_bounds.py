"""Is the error of random scenes within its bound? `python -m tests.benchmarks.error_bounds [COUNT]
[--first SEED] [--kind KIND] [--halvings 2] [--finer 2]`.

Scenes of tests/verification/test_error_bound.py: bodies of 1 cm to 100 m as in test_guaranteed.py,
all kinds of loads, laws with ω/λ₁ up to 0.9. The error is that against the mesh refined thrice,
or as often as --finer says; --halvings 2 refines the scene's own mesh before.
KIND: "heat" for computed temperatures, or one of that file's kinds of data that the elements do not
have.
Cost: CPU time of a bound over that of the P1 factorisation of the same mesh.
"""

import time

import numpy as np

from tcstudy.errors import GeometryFailed
from tests.benchmarks.cases import options
from tests.verification.test_error_bound import bounded, loaded_scene_of, varied_scene_of
from tests.verification.test_heat_bound import heated_scene_of


def main() -> None:
    asked = options(__doc__, "count=500", first=0, kind="", halvings=0, finer=3)
    below, ratios, steep, refused = [], [], [], 0
    for seed in range(asked.first, asked.first + asked.count):
        clock = time.process_time()
        try:
            text, share = loaded_scene_of(seed)
            if asked.kind == "heat":
                text, share = heated_scene_of(seed)
            elif asked.kind:
                text = varied_scene_of(seed, asked.kind)
        except GeometryFailed:
            refused += 1
            continue
        error, bound, relative = bounded(text, asked.halvings, asked.finer)
        ratios.append(bound / error)
        steep.append(share)
        below += [seed] * (bound < error * (1.0 - 1e-9))
        seconds = time.process_time() - clock
        print(f"{seed}: ω/λ₁ {share:.2f} error {error:.3g} bound/error {ratios[-1]:.3f} "
              f"relative {relative:.2%} {seconds:.1f} s", flush=True)  # fmt: skip
    found, gentle = np.array(ratios), np.array(steep) <= 0.3
    print(f"{len(below)} of {len(found)} below the error {below} ({refused} drawn that cannot be)")
    spread = f"median {np.median(found):.2f}, 90 % below {np.quantile(found, 0.9):.2f}, most {found.max():.2f}"
    print(
        f"bound/error: {spread}\n"
        f"             median {np.median(found[gentle]):.2f} of the {gentle.sum()} with ω/λ₁ ≤ 0.3"
    )


if __name__ == "__main__":
    main()
