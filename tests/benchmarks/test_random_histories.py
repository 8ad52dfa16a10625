"""The comparison on two histories that had jumped to more energy where a node passes its peak as another turns back."""

from __future__ import annotations

import pytest

from tests.benchmarks.random_histories import judged


@pytest.mark.parametrize("seed", [73, 191])
def test_no_jump_leads_uphill_and_steps_do_not_matter(seed: int) -> None:
    assert judged(seed, parts=4)[0] == []
