"""The order of elimination: separators that are minimum vertex covers (König)."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import pytest

from tcstudy.condense.symbolic import _separators


def covers(chosen: set[int], edges: list[tuple[int, int]]) -> bool:
    return all(a in chosen or b in chosen for a, b in edges)


@pytest.mark.parametrize("seed", range(30))
def test_a_separator_has_the_fewest_nodes_that_cut_all_edges(seed):
    rng = np.random.default_rng(seed)
    n = 9
    left = np.zeros(n, dtype=bool)
    left[rng.permutation(n)[: n // 2]] = True
    pairs = [(a, b) for a in range(n) for b in range(n) if a != b and rng.random() < 0.2]
    pairs = sorted({*pairs, *((b, a) for a, b in pairs)}) or [(0, 1), (1, 0)]
    i, j = (np.array(side, dtype=np.int32) for side in zip(*pairs, strict=True))
    between = [(a, b) for a, b in pairs if left[a] != left[b]]
    found = set(np.flatnonzero(_separators(left, i, j)).tolist())
    least = next(k for k in range(n + 1) if any(covers(set(c), between) for c in combinations(range(n), k)))
    assert covers(found, between)
    assert len(found) == least
