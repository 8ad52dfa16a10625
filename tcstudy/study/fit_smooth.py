"""Smoothness of a law by points: among laws that explain the data as well, the straighter one.

Added to Σr² is w Σ_i D_i², D_i the jump of slope at point i over the root of its share of the line, so that Σ D_i² is
∫ b″² (in units of the law's length and size); jumps of b stay free. The weight w is that of least generalised
cross-validation n Σr²/(n − tr A)², A = J(JᵀJ + wDᵀD)⁻¹Jᵀ, over decades: it needs no knowledge of the noise. tr A is how
many numbers the data decide. Where outliers count less, ρ(r²) stands for r², and w Σ D_i² is added as it is.

Literature: Craven & Wahba, Numer. Math. 31 (1978) 377–403; Golub, Heath & Wahba, Technometrics 21 (1979) 215–223.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from tcstudy.accuracy.fitted import Box, Minimum, minimise, misfit
from tcstudy.laws.composed import POINTS, EdgeLaws
from tcstudy.scene.study import FitPlan

Array = NDArray[np.float64]
Model = Callable[[Array], tuple[Array, Array]]

DECADES = np.logspace(3.0, -4.0, 8)
"""Weights that are tried, times tr JᵀJ/tr DᵀD."""


@dataclass(frozen=True, eq=False)
class Smoothed:
    """A smooth law: its minimum, residuals being those of the data, (d, k) √w ∂D/∂q there, w, and tr A."""

    minimum: Minimum
    prior: Array
    weight: float
    numbers: float


def roughness(plan: FitPlan) -> tuple[Array, Array]:
    """(d, k) and (d,): D = rows p + constant, of all laws of which points are fitted."""
    friction, rows, constant = plan.scene.friction, [], []
    laws = friction.laws if isinstance(friction, EdgeLaws) else (("", friction, 1.0),)
    for edge, law, _ in laws:
        place = ("friction", edge, POINTS) if edge else ("friction", POINTS)
        own = {int(one.number.path[-1]): j for j, one in enumerate(plan.parameters) if one.number.path[:-1] == place}
        points = law.made.values[POINTS] if law.made and own else ()
        s, b = (np.array([point[i] for point in points], dtype=float) for i in (0, 1))
        for i in range(1, len(s) - 1):
            h, g = s[i] - s[i - 1], s[i + 1] - s[i]
            if h <= 0.0 or g <= 0.0:
                continue
            share = np.ptp(s) ** 1.5 / (np.max(np.abs(b)) or 1.0) / np.sqrt(0.5 * (h + g))
            row, rest = np.zeros(len(plan.parameters)), 0.0
            for j, factor in ((i - 1, 1.0 / h), (i, -1.0 / h - 1.0 / g), (i + 1, 1.0 / g)):
                if j in own:
                    row[own[j]] = share * factor
                else:
                    rest += share * factor * b[j]
            rows.append(row)
            constant.append(rest)
    return np.array(rows).reshape(len(rows), len(plan.parameters)), np.array(constant)


def smoothed(model: Model, start: Array, box: Box, plan: FitPlan) -> Smoothed:
    """The minimum from a start, with the weight of least cross-validation, from straight laws to free ones."""
    rows, constant = roughness(plan)
    first, J = model(start)
    size = float(np.sum((J * box.rate(start)) ** 2) / np.sum((rows * box.rate(start)) ** 2))
    found: list[tuple[float, Smoothed]] = []
    p = start
    for weight in size * DECADES:
        root = np.sqrt(weight)

        def penalised(p: Array, root: float = root) -> tuple[Array, Array]:
            r, J = model(p)
            return np.concatenate([r, root * (rows @ p + constant)]), np.concatenate([J, root * rows])

        best = minimise(penalised, p, box, plan.loss, len(rows))
        n, p = len(first), best.p
        own = replace(best, residual=best.residual[:n], jacobian=best.jacobian[:n])
        prior, by_q = root * rows * box.rate(p), own.jacobian * box.rate(p)
        numbers = float(np.trace(by_q @ np.linalg.lstsq(by_q.T @ by_q + prior.T @ prior, by_q.T)[0]))
        square = misfit(own.residual, plan.loss)
        found.append((n * square / max(n - numbers, 1e-300) ** 2, Smoothed(own, prior, weight, numbers)))
    chosen = min(found, key=lambda item: item[0])[1]
    evaluations = sum(one.minimum.evaluations for _, one in found)
    return replace(chosen, minimum=replace(chosen.minimum, evaluations=evaluations))
