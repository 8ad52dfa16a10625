"""A worker that does as it is told: `python cruel.py WHAT TAU FILE` and what a worker is given.

WHAT happens (`calls.harm`) whenever a block holds a law of scale TAU. FILE gets the process id each time.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

from tcstudy.contact import block
from tcstudy.executors import worker
from tcstudy.laws.laws import Laws
from tests.executors.calls import treat

WHAT, TAU, FILE = sys.argv[1], float(sys.argv[2]), Path(sys.argv[3])
original = block.solve_block


def cruel(body: object, loads: object, laws: Laws, *more: object) -> object:
    if np.any(laws.scales[laws.index] == TAU):
        treat(WHAT, FILE, once=False)
    return original(body, loads, laws, *more)  # type: ignore[arg-type]


block.solve_block = cruel  # type: ignore[assignment]
del sys.argv[1:4]
worker.main()
