"""Do the 95 % intervals of first-order indices hold the truth?
`python -m tests.benchmarks.indices [COUNT] [--design random] [--points 200] [--first 0]`.

One line per response of tests/accuracy/responses.py: for each input the index, the share of COUNT
repeats whose interval holds it, the share below and above it, the mean width, and the share of
repeats without an interval, which is not counted. The last lines are the mean and the least of all
shares. About 10 s of CPU time per 1,000 points and 200 repeats of one response.
"""

import numpy as np

from tcstudy.accuracy.indices.first_order import first_order
from tests.accuracy.responses import CASES, Case
from tests.benchmarks.cases import options


def coverage(case: Case, design: str, points: int, seeds: range) -> np.ndarray:
    """Return value and ends (repeats, 3, d) of all repeats."""
    repeats = []
    for seed in seeds:
        x, y = case.sample(design, points, [points, seed])
        indices = first_order(x, y, case.named, balanced=design == "sobol")
        repeats.append([(index.value, index.low, index.high) for index in indices])
    return np.array(repeats).transpose(0, 2, 1)


def main() -> None:
    chosen = options(__doc__, "count=200", design="random", points=200, first=0)
    seeds = range(chosen.first, chosen.first + chosen.count)
    shares = []
    for name, case in CASES.items():
        _, lows, highs = np.moveaxis(coverage(case, chosen.design, chosen.points, seeds), 1, 0)
        cells = []
        for index, low, high in zip(case.indices, lows.T, highs.T, strict=True):
            has_interval = np.isfinite(low)
            low, high = low[has_interval], high[has_interval]
            if not len(low):
                cells.append(f"{index:.3f}: no interval")
                continue
            below, above = np.mean(high < index - 1e-9), np.mean(low > index + 1e-9)
            shares.append(1.0 - below - above)
            none = 1.0 - has_interval.mean()
            width = np.mean(high - low)
            cells.append(
                f"{index:.3f}: {shares[-1]:.1%} (below {below:.1%}, above {above:.1%}), "
                f"width {width:.3f}" + f", none {none:.0%}" * bool(none)
            )
        print(f"{name:20s} {'; '.join(cells)}", flush=True)
    print(f"{len(shares)} shares: mean {np.mean(shares):.1%}, least {np.min(shares):.1%}")


if __name__ == "__main__":
    main()
