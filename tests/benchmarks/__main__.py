"""All benchmarks, one after the other: `python -m tests.benchmarks`."""

from __future__ import annotations

from tests.benchmarks import adaptive, online, peers, reliability, speed, stability, tolerances

if __name__ == "__main__":
    speed.main([])  # first: the comparison of solvers limits the memory of its process
    peers.main([])
    stability.main([])
    adaptive.main()
    reliability.main([])
    tolerances.main()
    online.main([])
