"""Values as JSON: what JSON does not have, the words of flags, one line of text."""

from __future__ import annotations

import json
import math
from typing import Any

import numpy as np

Json = Any


def json_value(value: Json) -> Json:
    """Return a value as JSON has it: NaN is None, infinities are texts, arrays are lists."""
    if isinstance(value, dict):
        return {str(key): json_value(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [json_value(item) for item in value]
    if isinstance(value, np.ndarray):
        return json_value(value.tolist())
    if isinstance(value, np.generic):
        return json_value(value.item())
    if not isinstance(value, float) or math.isfinite(value):
        return value
    if math.isnan(value):
        return None
    return "inf" if value > 0 else "-inf"


def json_text(value: Json) -> str:
    """Return one line of JSON; NaN is null."""
    return json.dumps(json_value(value), ensure_ascii=False, allow_nan=False)


def flag_words(variable: Any, values: Any) -> Any:
    """Return values of a variable of a file, those of a flag as its words."""
    if "flag_meanings" not in variable.attrs:
        return values
    flags = np.atleast_1d(variable.attrs["flag_values"]).tolist()
    words = [word.replace("_", " ") for word in variable.attrs["flag_meanings"].split()]
    word_of_flag = dict(zip(flags, words, strict=True))
    return np.vectorize(word_of_flag.get, otypes=[object])(values)
