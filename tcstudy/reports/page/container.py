"""Numbers of a page in a compact form: one JSON header and the bytes of all arrays behind it, compressed together.

Layout before compression: 4 bytes length of the header (little-endian), the header in UTF-8, padding to 8 bytes, the
arrays, each at a multiple of 8 bytes. An array stands in the header as {"$": type, "s": shape, "o": offset}.
"""

from __future__ import annotations

import base64
import gzip
import json
import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

TYPES = {"f8": "<f8", "f4": "<f4", "i4": "<i4", "i2": "<i2", "i1": "i1", "u2": "<u2"}
LARGEST = 32767
"""Quantised numbers go from −LARGEST to LARGEST."""

Json = Any


@dataclass
class Container:
    """Collects arrays; `packed` gives the text that stands in the page."""

    _blocks: list[bytes] = field(default_factory=list)
    _size: int = 0

    def array(self, values: Any, kind: str = "f8") -> Json:
        """Values as they are, in one of TYPES."""
        array = np.ascontiguousarray(values, dtype=TYPES[kind])
        place = {"$": kind, "s": list(array.shape), "o": self._size}
        block = array.tobytes()
        block += b"\0" * (-len(block) % 8)
        self._blocks.append(block)
        self._size += len(block)
        return place

    def rows(self, values: NDArray[np.float64]) -> Json:
        """(P, n) values for drawing: 16 bits each, relative to the largest of their row (3e-5 of it at most)."""
        largest = np.max(np.abs(np.where(np.isfinite(values), values, 0.0)), axis=1, initial=0.0)
        scale = np.where(largest > 0.0, largest / LARGEST, 1.0)
        whole = np.where(np.isfinite(values), np.rint(np.nan_to_num(values) / scale[:, None]), -LARGEST - 1)
        return {"rows": self.array(whole, "i2"), "scale": self.array(scale, "f8")}

    def fields(self, values: NDArray[np.float64], tolerance: float = 1e-3) -> Json:
        """(P, n) fields on a body for drawing, as few modes: Σ_j factor_pj mode_jn, within tolerance × their range.

        Many points of a sweep have few independent fields, so that a thousand need hardly more room than ten.
        """
        u, s, vt = np.linalg.svd(values, full_matrices=False)
        span = float(np.ptp(values)) or 1.0
        # a dropped mode changes no value by more than s_j max|u_j| max|v_j|
        worst = s * np.max(np.abs(u), axis=0) * np.max(np.abs(vt), axis=1)
        left_out = np.concatenate([np.cumsum(worst[::-1])[::-1], [0.0]])
        rank = int(np.argmax(left_out <= tolerance * span))
        return {"factor": self.array(u[:, :rank] * s[:rank], "f4"), "mode": self.rows(vt[:rank])}

    def packed(self, header: Json) -> str:
        """Header and arrays, compressed, as base64 text."""
        text = json.dumps(plain(header), ensure_ascii=False, separators=(",", ":"), allow_nan=False).encode()
        head = len(text).to_bytes(4, "little") + text
        head += b"\0" * (-len(head) % 8)
        return base64.b64encode(gzip.compress(head + b"".join(self._blocks), 9, mtime=0)).decode()


def plain(value: Json) -> Json:
    """A JSON value without what JSON has not: NaN and infinities become None and texts."""
    if isinstance(value, dict):
        return {str(key): plain(one) for key, one in value.items()}
    if isinstance(value, list | tuple):
        return [plain(one) for one in value]
    if isinstance(value, np.ndarray):
        return plain(value.tolist())
    if isinstance(value, np.generic):
        return plain(value.item())
    if isinstance(value, float) and not math.isfinite(value):
        return None if math.isnan(value) else ("inf" if value > 0 else "-inf")
    return value
