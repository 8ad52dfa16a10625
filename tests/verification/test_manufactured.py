"""Rates and absolute errors on the thermoelastic solution in closed form."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest

from tcstudy.contact.contact import solve_contact
from tcstudy.fem.geometry import build
from tcstudy.offline.level import Level
from tests.verification import manufactured as exact
from tests.verification.norms import l2_and_h1_errors
from tests.verification.scenes import mesh_family


@dataclass(frozen=True)
class Errors:
    h: float
    theta: float
    l2: float
    h1: float
    u_T: float
    xi: float
    u_scale: float


@pytest.fixture(scope="module")
def errors() -> list[Errors]:
    study = exact.manufactured_study(levels=4, maxh=0.12)
    scene = study.scenes[0]
    rows = []
    for mesh in mesh_family(build(scene.body), study.mesh):
        level = Level(mesh, scene)
        condensed = level.condensed(scene)
        answer = solve_contact(condensed.problem)
        assert answer.status == 0, answer.reason
        u = level.displacement(scene, answer.v)
        n = mesh.n_points
        x_l2, x_h1 = l2_and_h1_errors(mesh, u[:n], exact.u_x, exact.grad_u_x)
        y_l2, y_h1 = l2_and_h1_errors(mesh, u[n:], exact.u_y, exact.grad_u_y)
        s, c = level.line.xy[:, 0], level.line.c
        xi = condensed.problem.xi(answer.v) / c
        theta = level.temperature(scene).theta - (exact.THETA_0 + exact.A * mesh.points[:, 0])
        rows.append(
            Errors(
                mesh.h_max,
                float(np.max(np.abs(theta))),
                float(np.hypot(x_l2, y_l2)),
                float(np.hypot(x_h1, y_h1)),
                float(np.sqrt(c @ (answer.v - exact.slip(s)) ** 2)),
                float(np.sqrt(c @ (xi - exact.friction(s)) ** 2)),
                float(np.max(np.abs(u))),
            )
        )
    return rows


def rate(rows: list[Errors], name: str) -> float:
    """Least-squares slope over all levels but the coarsest."""
    h = np.log([r.h for r in rows[1:]])
    return float(np.polyfit(h, np.log([getattr(r, name) for r in rows[1:]]), 1)[0])


def test_temperature_is_exact(errors: list[Errors]) -> None:
    assert max(r.theta for r in errors) < 1e-12


@pytest.mark.parametrize(
    ("norm", "least_rate", "bound"),
    [("l2", 1.9, 5e-6), ("h1", 0.95, 2e-3), ("u_T", 1.8, 6e-6), ("xi", 1.8, 4e-6)],
)
def test_rates_and_bounds(errors: list[Errors], norm: str, least_rate: float, bound: float) -> None:
    assert rate(errors, norm) >= least_rate
    assert getattr(errors[-1], norm) <= bound


def test_the_slip_stays_on_the_falling_branch() -> None:
    """Otherwise the closed form would not solve the problem."""
    x = np.linspace(0, 1, 101)
    assert np.all(exact.slip(x) > 0)
    assert np.all(exact.slip(x) < exact.DELTA)
