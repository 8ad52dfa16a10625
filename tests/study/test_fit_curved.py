"""Distances to the curve of an exponential film, beside whose path straight pieces stand in for the law."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tcstudy.study.fit import fit
from tests.study.test_fit import LENGTH, Array, D, model, study_of

A, DELTA = 7.2e6, 0.16e-3
FILM = {
    "slip-weakening, tau_s: 4 MPa, tau_k: 0 MPa": "exponential, a: 4 MPa, b: 0",
    "friction.tau_s": "friction.a",
}


def pulled(n: int) -> Array:
    """(n, 2) Δ [m] and P [N/m] of τ = a exp(−s/δ) on a thin strip, its grip pulled: half before the fold, half beyond.

    ½ D s′² = aδ (E − e^(−s/δ)), E = 1 until the front reaches the far end, then e^(−s₀/δ) of its slip s₀; so
    P² = 2 D aδ (E − y) with y = e^(−Δ/δ), and the bond is as long as the slip zone: y = E/cosh²(L √(E aδ/2D)/δ).
    """
    rate = LENGTH * np.sqrt(A * DELTA / (2.0 * D)) / DELTA
    y = 1.0 / np.cosh(rate * np.linspace(0.05, 0.98, n // 2)) ** 2
    E = np.append(np.ones(n // 2), np.geomspace(0.9, 2e-2, n - n // 2))
    y = np.append(y, E[n // 2 :] / np.cosh(rate * np.sqrt(E[n // 2 :])) ** 2)
    return np.stack([-DELTA * np.log(y), np.sqrt(2.0 * D * A * DELTA * (E - y))], axis=1)


def test_distances_to_a_curve_change_as_differences_say(tmp_path: Path) -> None:
    """By a, delta and E, whatever straight pieces the path was followed on."""
    data = pulled(16) * (1.0 + 0.01 * np.random.default_rng(5).normal(size=(16, 2)))
    more = {"    friction.delta": "    E: {start: 42 GPa, within: [30 GPa, 60 GPa]}\n    friction.delta"}
    follow = model(study_of(tmp_path, data, FILM | more | {"maxh: 5 mm": "maxh: 8 mm"}))
    p = np.array([9e6, 42.24e9, 0.12e-3])
    here = follow.compared(p)

    def difference(j: int, h: float) -> Array:
        ends = [follow.compared(p * (1.0 + sign * h * np.eye(3)[j])).residual for sign in (1.0, -1.0)]
        return np.asarray((ends[0] - ends[1]) / (2.0 * h * p[j]))

    for j in range(3):
        apart = (4.0 * difference(j, 1e-4) - difference(j, 2e-4)) / 3.0
        np.testing.assert_allclose(here.jacobian[:, j], apart, rtol=0.0, atol=1e-8 * np.max(np.abs(apart)))
    finer = replace(follow, law_error=1e-4).compared(p)
    assert finer.residual == pytest.approx(here.residual, rel=1e-9, abs=1e-9)
    size = np.max(np.abs(here.jacobian), axis=0)
    assert finer.jacobian / size == pytest.approx(here.jacobian / size, rel=1e-9, abs=1e-9)


def test_an_exponential_film_is_found_through_its_snap_back(tmp_path: Path) -> None:
    """Data of the closed form, the model in two dimensions: what is left is the mesh, 5 mm of a strip of 190."""
    record = fit(study_of(tmp_path, pulled(24), FILM))
    assert record.values["estimate"] == pytest.approx([A, DELTA], rel=0.02)
    assert int(record.attributes["evaluations"]) <= 16
    assert record.attributes["not_determined"] == ""
    assert len(record.values["fold_vertex"]) >= 1
