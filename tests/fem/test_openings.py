"""Frames and openings of contact edges that are not held along their normal."""

from dataclasses import replace

import numpy as np
import pytest

from tcstudy.errors import GeometryFailed
from tcstudy.fem.forms import constrain, contact_line
from tcstudy.fem.meshes import Frames, Meshes, PlaneMesh
from tcstudy.fem.openings import OpeningLine, opening_line
from tcstudy.read.study import read_study_text
from tcstudy.scene.records import Contact, Normal, Scene

SHAPE = """
units: none
body: {outline: [{from: [0, 0], edge: film}, {from: [0.6, 0], edge: shoe}, {from: [1.5, 0], edge: right},
  {from: [1.5 + SLANT, 1], edge: top}, {from: [0, 1], edge: left}]}
boundary: {film: contact, shoe: contact, left: LEFT, right: RIGHT, top: TOP}
material: {E: 1, nu: 0.3}
friction: {law: tresca, tau: 1}
mesh: {maxh: 0.3, levels: 1}
"""


def mesh_and_scene(
    normals: dict[str, Normal], left: str = "free", right: str = "free", slant: float = 0.0,
    top: str = "clamped", text: str = SHAPE,
) -> tuple[PlaneMesh, Scene]:  # fmt: skip
    """A mesh, and its scene with contact edges that do this along their normals."""
    text = text.replace("1.5 + SLANT", str(1.5 + slant))
    text = text.replace("LEFT", left).replace("RIGHT", right).replace("TOP", top)
    study = read_study_text(text, "study")
    boundary = []
    for name, role in study.scenes[0].boundary:
        if isinstance(role, Contact):
            role = replace(role, normal=normals.get(name, "held"))
        boundary.append((name, role))
    return Meshes(study).next(0), replace(study.scenes[0], boundary=tuple(boundary))


def frames_and_openings(mesh: PlaneMesh, scene: Scene) -> tuple[Frames, OpeningLine]:
    frames = constrain(mesh, scene.boundary)
    line = contact_line(mesh, frames, scene.edges(Contact))
    return frames, opening_line(mesh, frames, line, scene.opening_edges)


def at(mesh: PlaneMesh, x: float, y: float) -> int:
    """The node at a point."""
    return int(np.argmin(np.hypot(*(mesh.points - [x, y]).T)))


BOTH: dict[str, Normal] = {"film": "unilateral", "shoe": "adhesive"}


def test_nodes_that_nothing_holds_have_slip_and_opening_as_local_rows() -> None:
    mesh, scene = mesh_and_scene(BOTH)
    frames, opening = frames_and_openings(mesh, scene)
    np.testing.assert_array_equal(np.sort(opening.nodes), mesh.nodes_on("film", "shoe"))
    assert not frames.fixed[mesh.n_points + opening.nodes].any()
    np.testing.assert_allclose(
        frames.axes[opening.nodes, :, 0], np.tile([1.0, 0.0], (opening.m, 1))
    )
    np.testing.assert_allclose(
        frames.axes[opening.nodes, :, 1], np.tile([0.0, 1.0], (opening.m, 1))
    )
    assert opening.c.sum() == pytest.approx(1.5)
    np.testing.assert_allclose(opening.arclength, mesh.points[opening.nodes, 0], atol=1e-12)
    (joint,) = opening.joints.node
    assert opening.nodes[joint] == at(mesh, 0.6, 0.0)


def test_a_plane_of_symmetry_leaves_the_opening_and_a_wall_along_the_bond_the_slip() -> None:
    mesh, scene = mesh_and_scene(BOTH, left="symmetry")
    frames, opening = frames_and_openings(mesh, scene)
    corner = at(mesh, 0.0, 0.0)
    assert corner in opening.nodes
    assert frames.fixed[corner]
    mesh, scene = mesh_and_scene({"shoe": "unilateral"})
    frames, opening = frames_and_openings(mesh, scene)
    joint = at(mesh, 0.6, 0.0)
    assert joint not in opening.nodes
    assert not frames.fixed[joint]
    assert frames.fixed[mesh.n_points + joint]
    assert opening.c.sum() == pytest.approx(0.9)


def test_what_is_prescribed_beside_a_bond_stays_as_it_is() -> None:
    left = "{role: clamped, u_x: 0.25, u_y: free}"
    mesh, scene = mesh_and_scene(BOTH, left=left, top="{role: clamped, u_x: 0.25, u_y: 0}")
    frames, _ = frames_and_openings(mesh, scene)
    u_x, u_y = frames.cartesian(frames.values).reshape(2, -1)
    nodes = mesh.nodes_on("left")
    bond = at(mesh, 0.0, 0.0)
    top = at(mesh, 0.0, 1.0)
    inner = nodes[(nodes != top)]
    assert bond in inner
    np.testing.assert_allclose(u_x[inner], 0.25)
    np.testing.assert_allclose(u_y[inner], 0.0)


def test_a_held_corner_gives_its_half_cell_to_the_neighbour() -> None:
    mesh, scene = mesh_and_scene(BOTH, right="clamped")
    _, opening = frames_and_openings(mesh, scene)
    assert at(mesh, 1.5, 0.0) not in opening.nodes
    assert opening.c.sum() == pytest.approx(1.5)
    segment = 1.5 - opening.xy[-1, 0]
    before = opening.xy[-1, 0] - opening.xy[-2, 0]
    assert opening.c[-1] == pytest.approx(0.5 * before + segment)


def test_an_edge_without_normal_traction_has_no_opening_to_find() -> None:
    mesh, scene = mesh_and_scene({"film": "free", "shoe": "unilateral"})
    frames, opening = frames_and_openings(mesh, scene)
    assert scene.opening_edges == ("shoe",)
    film = mesh.nodes_on("film")
    assert not frames.fixed[mesh.n_points + film].any()
    assert opening.c.sum() == pytest.approx(0.9)
    first = opening.xy[1, 0] - 0.6
    assert opening.c[0] == pytest.approx(0.5 * first)


ARC = """
units: none
body: {outline: [{from: [-1, 0], edge: film, through: [0, -1]}, {from: [1, 0], edge: top}]}
boundary: {film: contact, top: TOP}
material: {E: 1, nu: 0.3}
friction: {law: tresca, tau: 1}
mesh: {maxh: 0.2, levels: 1}
"""


def test_an_arc_has_the_normals_of_the_circle() -> None:
    mesh, scene = mesh_and_scene({"film": "unilateral"}, text=ARC)
    frames, opening = frames_and_openings(mesh, scene)
    inward = (
        -mesh.points[opening.nodes] / np.linalg.norm(mesh.points[opening.nodes], axis=1)[:, None]
    )
    np.testing.assert_allclose(frames.axes[opening.nodes, :, 1], inward, atol=1e-6)
    products = np.einsum("nab,nac->nbc", frames.axes, frames.axes)
    np.testing.assert_allclose(products, np.tile(np.eye(2), (mesh.n_points, 1, 1)), atol=1e-14)


CORNER = SHAPE.replace(
    "film: contact, shoe: contact, left: LEFT", "film: contact, shoe: contact, left: contact"
)
OBLIQUE = CORNER.replace("[0, 1]", "[-0.5, 1]")


def test_a_right_angle_has_the_openings_of_both_edges_and_no_slip() -> None:
    mesh, scene = mesh_and_scene({**BOTH, "left": "unilateral"}, text=CORNER)
    frames, opening = frames_and_openings(mesh, scene)
    corner = at(mesh, 0.0, 0.0)
    np.testing.assert_array_equal(frames.corners, [corner])
    rows = opening.rows[opening.nodes == corner]
    np.testing.assert_array_equal(np.sort(rows), [corner, mesh.n_points + corner])
    np.testing.assert_allclose(frames.axes[corner], [[0.0, 1.0], [1.0, 0.0]], atol=1e-12)
    assert opening.c.sum() == pytest.approx(2.5)
    line = contact_line(mesh, frames, scene.edges(Contact))
    assert corner not in line.nodes
    assert line.c.sum() == pytest.approx(2.5)
    np.testing.assert_array_equal(np.sort(opening.nodes), np.sort([*line.nodes, corner, corner]))


def test_an_oblique_corner_needs_one_edge_that_is_free_along_its_normal() -> None:
    for normals in (
        {**BOTH, "left": "free"},
        {"film": "free", "shoe": "free", "left": "unilateral"},
    ):
        mesh, scene = mesh_and_scene(normals, text=OBLIQUE)  # type: ignore[arg-type]
        frames, opening = frames_and_openings(mesh, scene)
        corner = at(mesh, 0.0, 0.0)
        (number,) = np.flatnonzero(opening.nodes == corner)
        column = opening.rows[number] // mesh.n_points
        edge = opening.edge_names[opening.edge[number]]
        inward = [0.0, 1.0] if edge == "film" else np.array([2.0, 1.0]) / np.sqrt(5.0)
        np.testing.assert_allclose(frames.axes[corner, :, column], inward, atol=1e-12)
        np.testing.assert_allclose(
            frames.axes[corner].T @ frames.axes[corner], np.eye(2), atol=1e-14
        )


GUIDE = "{role: clamped, u_N: 0, u_T: free}"


@pytest.mark.parametrize(
    ("normals", "words", "fault", "place"),
    [
        ({**BOTH, "left": "unilateral"}, {"text": OBLIQUE}, "at an oblique angle", "(0, 0)"),
        (BOTH, {"right": GUIDE, "slant": 0.5}, "slanted guide", "(1.5, 0)"),
        (BOTH, {"right": "{role: rigid, force: [1, 0]}"}, "a rigid edge meets", "(1.5, 0)"),
    ],
)
def test_what_cannot_be_told_apart_is_refused_with_its_place(
    normals: dict[str, Normal], words: dict[str, str], fault: str, place: str
) -> None:
    mesh, scene = mesh_and_scene(normals, **words)  # type: ignore[arg-type]
    with pytest.raises(GeometryFailed) as error:
        constrain(mesh, scene.boundary)
    assert fault in str(error.value)
    assert f"at {place}; " in str(error.value)


def test_an_edge_too_short_to_lift_off_is_refused() -> None:
    """Both ends of its only segment are held along the normal."""
    short = SHAPE.replace("[0.6, 0]", "[1.45, 0]")
    mesh, scene = mesh_and_scene({"shoe": "unilateral"}, right="clamped", text=short)
    with pytest.raises(GeometryFailed, match="free to lift off"):
        frames_and_openings(mesh, scene)
