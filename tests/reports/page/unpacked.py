"""A page's data as the browser unpacks them, for tests."""

from __future__ import annotations

import base64
import gzip
import json
import re
from pathlib import Path
from typing import Any

import numpy as np

from tcstudy.reports.page.container import TYPES


def data_of(page: Path) -> Any:
    """The header of a page with its arrays in place."""
    found = re.search(r'id="data">([^<]*)<', page.read_text(encoding="utf-8"))
    assert found
    return unpacked(found.group(1))


def unpacked(text: str) -> Any:
    raw = gzip.decompress(base64.b64decode(text))
    length = int.from_bytes(raw[:4], "little")
    start = -(-(4 + length) // 8) * 8

    def fill(node: Any) -> Any:
        if isinstance(node, list):
            return [fill(one) for one in node]
        if not isinstance(node, dict):
            return node
        if "$" in node:
            count = int(np.prod(node["s"], dtype=int))
            return np.frombuffer(raw, TYPES[node["$"]], count, start + node["o"]).reshape(node["s"])
        return {key: fill(one) for key, one in node.items()}

    return fill(json.loads(raw[4 : 4 + length]))
