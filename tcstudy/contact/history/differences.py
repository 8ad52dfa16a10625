"""Derivatives of histories by one number p: differences of whole histories, which are exact to rounding.

A history is smooth in p but for events, where one-sided derivatives differ. With D± = ±(f(p ± h) − f(p))/h at two steps
h the part of D⁺ − D⁻ that stays as h → 0 is such a difference; what falls like h is curvature. Of the estimates that
either step and both together give that is taken which errs least. Where a number can only grow, or only fall, D is
looked at on one side, at three steps: for a smooth f they lie on a line. What errs by more than AGREES is NaN.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

STEPS = (1e-4, 1e-5)
"""Of a number, relative to its scale."""
HALFWAY = 0.5 * (STEPS[0] + STEPS[1])
"""The third step where there is but one side."""
AGREES, SMALL = 2e-6, 1e-2
"""Of a derivative, or of this part of f per scale if that is more, by which it may err."""


def two_sided(middle: Array, up: Array, down: Array, scale: float) -> Array:
    """(n,) df/dp from f (n,) at p, and f (2, n) at p ± STEPS times the scale of p; NaN where there is none."""
    h = np.array(STEPS)[:, None] * scale
    plus, minus = (up - middle) / h, (middle - down) / h
    central, apart = 0.5 * (plus + minus), plus - minus
    limit = (STEPS[0] * apart[1] - STEPS[1] * apart[0]) / (STEPS[0] - STEPS[1])
    return _best(np.array([*central, central[1]]), np.array([*apart, limit]), middle / scale)


def one_sided(middle: Array, beside: Array, scale: float) -> Array:
    """The same from f (3, n) at p + STEPS and HALFWAY times the scale; scale < 0 where p can only fall."""
    h = np.array([*STEPS, HALFWAY])[:, None] * scale
    far, near, between = (beside - middle) / h
    limit = (STEPS[0] * near - STEPS[1] * far) / (STEPS[0] - STEPS[1])
    return _best(limit[None], (between - 0.5 * (far + near))[None], middle / scale)


def _best(values: Array, errors: Array, size: Array) -> Array:
    """The value that errs least, of each column; NaN where that errs by too much."""
    errors = np.where(np.isfinite(errors), np.abs(errors), np.inf)
    at = np.argmin(errors, axis=0), np.arange(errors.shape[1])
    value, error = values[at], errors[at]
    return np.where(error <= AGREES * np.maximum(np.abs(value), SMALL * np.abs(size)), value, np.nan)
