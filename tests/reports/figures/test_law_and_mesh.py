"""The law of a point with its nodes on it; the mesh with the roles of its edges."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

pytest.importorskip("matplotlib")

from tcstudy.errors import DrawError
from tcstudy.laws.composed import each
from tcstudy.laws.shapes import SHAPES
from tcstudy.read.study import read_study_text
from tcstudy.reports.figures import style
from tcstudy.reports.figures.boundary_roles import runs, words
from tcstudy.reports.figures.law_figure import LawPicture, curves, law_figure, read_law, slip_window
from tcstudy.reports.picture import read_picture
from tcstudy.reports.stored_study import NamedEdge, law_of_nodes
from tcstudy.scene.contact_states import ContactState, node_states
from tcstudy.study.execute import execute
from tests.reports.figures.draw_cases import HEIGHT, WIDTH, crowded, example_laws
from tests.reports.figures.laws_picture import laws_figure

BRITTLE = SHAPES["piecewise-linear"].build(points=[(0.0, 2e7), (1e-5, 2e7), (1e-5, 5e6)])
SMALL = style.Look(style.size_in_inches("8x7cm"))


def law_picture(grid: Path) -> LawPicture:
    picture = read_picture(grid)
    m = len(picture.line.u_T)
    picture = replace(picture, lambda_1=8e11, omega=float("inf"), stiffness_units="Pa m-1")
    return LawPicture(picture, (("", BRITTLE),), np.zeros(m, dtype=np.intp), np.ones(m))


FILMS = """
units: none
title: Two films, one of them rougher to the right, with a gap
body: {outline: [{from: [0, 0], edge: film}, {from: [1, 0], edge: shoe}, {from: [2, 0], edge: grip},
                 {from: [2, 0.2], edge: top}, {from: [0, 0.2], edge: tail}]}
boundary: {film: contact, shoe: contact, grip: {role: clamped, u_x: 0.4, u_y: free}, top: free, tail: free}
material: {E: 10, nu: 0, plane: stress}
friction: {film: {law: tresca, tau: 2, strength: "min(1, max(0, 2*x - 0.5))"},
           shoe: {law: slip-weakening, tau_s: 1, tau_k: 0.5, delta: 0.1}}
mesh: {maxh: 0.1}
"""


@pytest.fixture(scope="module")
def films(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("films") / "films.nc"
    execute(read_study_text(FILMS), path)
    return path


def test_where_friction_differs_every_node_stands_on_the_law_of_its_edge(films: Path) -> None:
    shown = read_law(films, None, -1)
    line, bonded = shown.point.line, shown.strength > 0
    assert [edge for edge, _ in shown.laws] == ["film", "shoe", "film and shoe"]
    assert list(np.flatnonzero(shown.index == 2)) == list(np.flatnonzero(np.isclose(line.x, 1.0)))
    assert shown.strength == pytest.approx(np.where(line.x < 1, np.clip(2 * line.x - 0.5, 0, 1), 1.0))
    for k, (_, law) in enumerate(shown.laws):
        here = bonded & (shown.index == k)
        low, high = law.interval(line.u_T[here])
        xi = line.xi[here] / shown.strength[here]
        assert np.all((low - 1e-6 <= xi) & (xi <= high + 1e-6))
    with style.styled():
        figure = law_figure(shown, style.Look())
    marked = [line for line in figure.axes[0].lines if line.get_linestyle() == "None"]
    assert sum(len(np.asarray(line.get_xdata())) for line in marked) == np.count_nonzero(bonded) < len(bonded)
    named = [text.get_text() for text in figure.legends[0].get_texts()]
    assert named[:2] == ["film: tresca", "shoe: slip-weakening"]
    assert "strength" in figure.axes[0].get_ylabel()


def test_states_of_a_contact_line_with_two_laws_go_out(films: Path, tmp_path: Path) -> None:
    """By the law of each node: softening only on the shoe, between nothing and 0.1 of slip."""
    with xr.open_datatree(films) as tree:
        group = tree["level_0"].to_dataset().load()
    u_T, x, sticks = (group[name].values[-1 if name in ("u_T", "sticks") and group[name].ndim > 1 else ...]
                      for name in ("u_T", "x", "sticks"))  # fmt: skip
    states = each(law_of_nodes(read_study_text(FILMS).scenes[0].friction, group), node_states, u_T, sticks == 1)
    softens = states == ContactState.SOFTEN
    assert softens.any()
    assert np.array_equal(softens, (x >= 1) & (u_T > 0) & (u_T < 0.1) & (sticks != 1))
    assert np.all(states[(x >= 1) & (u_T > 0.1)] == ContactState.WEAKENED)


def test_every_node_stands_at_its_slip_and_traction(grid: Path) -> None:
    shown = law_picture(grid)
    with style.styled():
        figure = law_figure(shown, style.Look())
    marked = [line for line in figure.axes[0].lines if line.get_linestyle() == "None"]
    s = np.concatenate([np.asarray(line.get_xdata(), dtype=float) for line in marked])
    xi = np.concatenate([np.asarray(line.get_ydata(), dtype=float) for line in marked])
    line = shown.point.line
    np.testing.assert_allclose(np.sort(s), np.sort(line.u_T) * 1e6)
    np.testing.assert_allclose(np.sort(xi), np.sort(line.xi) / 1e6)
    named = [text.get_text() for text in figure.legends[0].get_texts()]
    assert named[-2:] == ["sticks (4 nodes)", "slips (4 nodes)"]
    assert "down-jump: sudden loss" in named
    assert (figure.axes[0].get_xlabel(), figure.axes[0].get_ylabel()) == (
        "slip $u_T$ [µm]",
        r"friction $\xi = -S_T$ [MPa]",
    )


@pytest.mark.parametrize("look", [style.Look(), SMALL])
def test_no_text_overlaps_another(grid: Path, look: style.Look) -> None:
    with style.styled(look):
        assert crowded(law_figure(law_picture(grid), look)) == []


def test_the_window_shows_the_nodes_and_the_law_near_them() -> None:
    low, high = slip_window(BRITTLE, np.array([0.0, 2e-5]))
    assert high > 2e-5
    assert -high < low < 0.0
    assert slip_window(BRITTLE, np.zeros(3)) == (-1.4e-5, 1.4e-5)
    assert slip_window(BRITTLE, np.array([-1e-9]))[0] > -1e-8  # a law that is far away does not hide the nodes


def test_a_curve_is_the_law() -> None:
    law = SHAPES["exponential"].build(a=1.0, b=0.25, delta=0.5)
    for s, b in curves(law, 3.0):
        np.testing.assert_allclose(np.abs(b), 0.25 + 0.75 * np.exp(-np.abs(s) / 0.5), rtol=1e-12)
    with style.styled():
        assert crowded(laws_figure(example_laws())) == []


def test_a_file_whose_study_cannot_be_read(grid: Path) -> None:
    with pytest.raises(DrawError, match="cannot be read any more"):
        read_law(grid, None, -1)


def edges() -> list[NamedEdge]:
    corners = [(0.0, 0.0), (WIDTH, 0.0), (WIDTH, HEIGHT), (0.0, HEIGHT)]
    roles = ("contact", "convection", "free", "clamped")
    return [
        NamedEdge(f"e{i}", role, 0, np.array([corners[i], corners[(i + 1) % 4]]), role == "convection")
        for i, role in enumerate(roles)
    ]


def test_the_boundary_is_cut_where_roles_change(grid: Path) -> None:
    body = read_picture(grid).body
    assert body
    found = runs(body, edges())
    by_name = {run.edge.name: run for run in found}
    assert sorted(by_name) == ["e0", "e1", "e2", "e3"]
    assert len(found) == 4
    assert np.all(body.y[by_name["e0"].nodes] == 0.0)
    assert len(by_name["e0"].nodes) == 9
    assert words(by_name["e1"]) == "e1: convection, traction"
