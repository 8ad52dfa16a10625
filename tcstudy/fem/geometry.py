"""Bodies as Netgen/OpenCASCADE shapes in which every boundary curve keeps its identity.

A child process reads STEP and BREP files first, because a bad one makes the kernel hang or crash.
It measures all faces and edges of the file, as the package will. If it ends well within its time,
the same steps are safe in this process.

Every outline, hole or file edge becomes one `Curve` with its own boundary name in the mesh (its
`tag`). So a study name may cover several curves, and normals on Γ_C are those of the exact curve,
not of the mesh.

The kernel's tolerances are lengths (1e-7, whatever the unit): bodies far from size 1 are handed to
it in a unit of their own, a power of two [m], so that a body of micrometres is meshed like one of
metres.
"""

from __future__ import annotations

import math
import os
import signal
import subprocess
import sys
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property, lru_cache, partial
from pathlib import Path
from typing import Any

import numpy as np
from netgen import occ
from numpy.typing import NDArray

from tcstudy.errors import GeometryFailed
from tcstudy.scene.records import BODY, Body, BrepFace, Edge, Loop, Point
from tcstudy.shapes.edges import Junction, Side, body_size, edge_distance, edge_length, edge_normal

MAX_SECONDS = 5.0
"""Processor time that the kernel may take for any file [s]."""
MAX_SECONDS_PER_MEGABYTE = 10.0
"""Processor time that it may take besides [s]; it reads 10 MB in about 5 s."""
MAX_MEMORY = 2_000_000_000
"""Memory that it may take for any file [B]: a few words of a bad file make it ask for all."""
MAX_MEMORY_PER_BYTE = 200
"""Memory that it may take besides, per byte of the file [B]."""
WALL_FACTOR = 20.0
"""Wall time over processor time on a machine that does other work.

Wall time alone is limited on a system without a limit of processor time.
"""
PROGRAM = (
    "import sys; from tcstudy.fem.geometry import examine; examine(sys.argv[1], float(sys.argv[2]))"
)
"""Program of the child."""
CURVE_SAMPLES = 257
"""Points of a curve from which the nearest one is sought."""


def file_fault(path: Path) -> str | None:
    """Return the fault of a STEP or BREP file, None if the kernel can read it.

    A file is judged once until it changes.
    """
    try:
        state = path.stat()
    except OSError as error:
        return f"cannot be read ({error.strerror})"
    return _fault(str(path.resolve()), state.st_size, state.st_mtime_ns)


@lru_cache(maxsize=16)
def _fault(path: str, size: int, _changed: int) -> str | None:
    seconds = MAX_SECONDS + MAX_SECONDS_PER_MEGABYTE * size / 1e6
    package = str(Path(__file__).parents[2])
    python_path = os.pathsep.join([package, *filter(None, [os.environ.get("PYTHONPATH")])])
    try:
        child = subprocess.run(
            [sys.executable, "-P", "-c", PROGRAM, path, str(seconds)],
            env=os.environ | {"PYTHONPATH": python_path},
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            timeout=WALL_FACTOR * seconds,
        )
    except subprocess.TimeoutExpired:
        limit = f"{WALL_FACTOR * seconds:.0f} s"
        return f"the geometry kernel did not finish reading it within {limit}"
    if child.returncode == 0:
        return None
    if child.returncode == -getattr(signal, "SIGXCPU", 0):
        limit = f"{seconds:.0f} s of processor time"
        return f"the geometry kernel did not finish reading it within {limit}"
    last_line = child.stderr.decode(errors="replace").strip().rpartition("\n")[2]
    if child.returncode < 0 or not last_line:
        return "the geometry kernel crashes on it"
    return f"cannot be read as STEP or BREP ({last_line.rpartition(': ')[2]})"


def examine(path: str, seconds: float) -> None:
    """Read a file and measure its faces and edges, within some processor time.

    For a process that may be lost.
    """
    with suppress(ImportError):  # no such limit on Windows
        import resource

        used = resource.getrusage(resource.RUSAGE_SELF)
        limit = int(used.ru_utime + used.ru_stime + seconds) + 1
        memory = MAX_MEMORY + MAX_MEMORY_PER_BYTE * os.path.getsize(path)
        resource.setrlimit(resource.RLIMIT_CPU, (limit, limit + 1))
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        resource.setrlimit(resource.RLIMIT_DATA, (memory, memory))
    for face in occ.OCCGeometry(path, dim=2).shape.faces:
        _ = face.mass, face.center, face.bounding_box
        for edge in face.edges:
            for t in _parameters(edge, CURVE_SAMPLES):
                _ = edge.Value(t), edge.Tangent(t)
            _ = edge.mass, edge.center, edge.Distance(occ.Vertex(occ.Pnt(0, 0, 0)))


Array = NDArray[np.float64]
INTERFACE = "_interface"
"""Mesh boundary name of the edges inside the body (outlines of regions)."""
MAX_OFFSET = 1e-3
"""Largest distance from the nearest edge, relative to the body, of a point of a study that names an
edge of a file."""
CORNER = 1e-7
"""Difference of distances, relative to the body, that leaves open which edge is meant; the kernel's
own tolerance."""
SHORTEST = 1e-3
"""Length of the shortest edge, in the kernel's unit, from which on the body is given to it with a
size of about 1."""
HARMLESS = 0.1, 10.0
"""Units [m] in place of which 1 serves as well: against such a body the tolerances are small,
too."""
PROBE_DISTANCE = 0.02
"""Distance from a corner at which its regions are probed, over the length of the shortest edge."""
MIN_PROBE_DISTANCE = 1e-4
"""The same in the kernel's unit, at least: nearer to an edge the kernel calls nothing inside."""


@dataclass(frozen=True)
class Curve:
    """One boundary curve; number i is named "c<i>" in the mesh.

    name:     the study's name of the edge it belongs to
    length:   exact length [m]
    straight: whether it is a straight line
    normal:   points (n, 2) on the curve → unit normals (n, 2), of either sign
    """

    name: str
    length: float
    straight: bool
    normal: Callable[[Array], Array]


@dataclass(frozen=True)
class Geometry:
    """A body ready for meshing.

    shape:   the OCC shape, with named faces, in units of `unit` [m]
    curves:  its boundary
    area:    exact area [m²]
    size:    diagonal of the box around it [m]
    offsets: of a file, every point that names an edge, with its name and its distance from the edge
             [m]
    """

    shape: Any
    curves: tuple[Curve, ...]
    area: float
    size: float
    unit: float
    offsets: tuple[tuple[str, Point, float], ...] = ()

    def face_areas(self) -> dict[str, float]:
        """Area of every region by name, and of the rest of the body as "body" [m²]."""
        areas: dict[str, float] = {}
        for face in self.shape.faces:
            areas[face.name] = areas.get(face.name, 0.0) + float(face.mass) * self.unit**2
        return areas

    @property
    def curved(self) -> list[str]:
        """The names of edges that are not straight, in order."""
        return sorted({curve.name for curve in self.curves if not curve.straight})

    @cached_property
    def corners(self) -> tuple[Junction, ...]:
        """Return the ends of boundary pieces, in order, and then those of interfaces."""
        names = {f"c{i}": curve.name for i, curve in enumerate(self.curves)}
        points = list[Array]()
        sides = list[Side]()
        edges = list(dict.fromkeys(self.shape.edges))  # an interface is an edge of two faces
        for edge in edges:
            for t, sign in zip(edge.parameter_interval, (1.0, -1.0), strict=True):
                value = edge.Value(t)
                tangent = edge.Tangent(t)
                direction = sign * np.array([tangent.x, tangent.y])
                x, y = direction / math.hypot(tangent.x, tangent.y)
                points.append(np.array([value[0], value[1]]))
                sides.append(Side(names.get(edge.name, ""), (float(x), float(y)), edge.name))
        sides_at: dict[int, list[Side]] = {}
        places = _first_within(np.array(points), 1e-6 * self.size / self.unit)
        for side, place in zip(sides, places, strict=True):
            sides_at.setdefault(place, []).append(side)
        reach = max(PROBE_DISTANCE * min(edge.mass for edge in edges), MIN_PROBE_DISTANCE)
        corners = [self._corner(points[place], around, reach) for place, around in sides_at.items()]

        def rank(corner: Junction) -> tuple[bool, int]:
            first = corner.sides[0]
            return corner.cut, int(first.tag[1:]) if first.name else 0

        return tuple(sorted(corners, key=rank))

    def _corner(self, point: Array, sides: list[Side], reach: float) -> Junction:
        """Return the corner at a point of the shape, a cusp where no region is found.

        reach: distance from it at which regions are looked for
        """
        sides = sorted(sides, key=lambda side: math.atan2(*side.away[::-1]))
        turns = [math.atan2(*side.away[::-1]) for side in sides]
        angles = np.diff([*turns, turns[0] + 2.0 * math.pi]).tolist()
        wedges = list[tuple[float, str]]()
        is_outline_corner = len(sides) == 2 and all(side.name for side in sides)
        for turn, angle in zip(turns, angles, strict=True):
            middle = turn + 0.5 * angle
            x, y = point + reach * np.array([math.cos(middle), math.sin(middle)])
            vertex = occ.Vertex(occ.Pnt(x, y, 0))
            # a corner of the outline has two wedges; once one is inside, the other is outside
            is_outside = is_outline_corner and any(region for _, region in wedges)
            faces = () if is_outside else self.shape.faces
            regions = (face.name for face in faces if face.Distance(vertex) < 1e-3 * reach)
            wedges.append((angle, next(regions, "")))
        count = len(wedges)
        starts = (i for i in range(count) if wedges[i][1] and not wedges[i - 1][1])
        first = next(starts, 0)
        sides = [*sides[first:], *sides[:first]]
        wedges = [*wedges[first:], *wedges[:first]]
        stop = next((i for i in range(count) if not wedges[i][1]), count)
        x, y = self.unit * point
        inside = tuple(wedges[:stop]) or ((0.0, BODY),)
        return Junction((float(x), float(y)), tuple(sides[: stop + 1]), inside)

    def samples(self, count: int = 17) -> list[tuple[str, Array, Array]]:
        """Return the study name, points (count, 2) and normals (count, 2) of boundary pieces."""
        pieces = []
        for edge in self.shape.edges:
            if edge.name == INTERFACE:
                continue
            curve = self.curves[int(edge.name[1:])]
            values = [edge.Value(t) for t in _parameters(edge, count)]
            points = self.unit * np.array([[value[0], value[1]] for value in values])
            pieces.append((curve.name, points, curve.normal(points)))
        return pieces


def _first_within(points: Array, radius: float) -> list[int]:
    """Return for each point the index of the first one that is within a distance of it.

    Candidates are neighbours in the order of x; a tree would cost an import of a tenth of a second.
    """
    order = np.argsort(points[:, 0], kind="stable")
    sorted_x = points[order, 0]
    begin = np.searchsorted(sorted_x, points[:, 0] - radius, side="left")
    end = np.searchsorted(sorted_x, points[:, 0] + radius, side="right")
    first = list[int]()
    for point, i, j in zip(points, begin, end, strict=True):
        candidates = order[i:j]
        distances = np.linalg.norm(points[candidates] - point, axis=1)
        first.append(int(candidates[distances <= radius].min()))
    return first


def build(body: Body) -> Geometry:
    """Make the OCC shape of a body that the reader has accepted.

    Raises GeometryFailed if a file has no such face or an edge of the shape cannot be named.
    """
    offsets: tuple[tuple[str, Point, float], ...] = ()
    if body.brep is not None:
        face, curves, unit, offsets = _read_face(body.brep)
    else:
        assert body.outline is not None
        loops = (*body.loops, *(region.loop for region in body.regions))
        shortest = min(edge_length(edge) for loop in loops for edge in loop.edges)
        unit = _unit(body_size(body), shortest)
        face = _face(body.outline, unit)
        for hole in body.holes:
            face = face - _face(hole, unit)
        curves = tuple(
            Curve(edge.name, edge_length(edge), edge.through is None, partial(edge_normal, edge))
            for edge in body.edges
        )
    size = _size(face)
    finders = [_occ_distance(edge) for edge in face.edges]
    if body.brep is None:
        finders = [_edge_distance(edge, unit) for edge in body.edges]
    face.faces.name = BODY
    regions = []
    remainder = face
    for region in body.regions:  # cut out and glued back, so that the mesh follows their outlines
        region_face = face * _face(region.loop, unit)
        region_face.faces.name = region.name
        remainder = remainder - region_face
        regions.append(region_face)
    remainder.faces.name = BODY
    shape = occ.Glue([remainder, *regions]) if regions else remainder
    _name_edges(shape, finders, 1e-6 * size)
    area = sum(f.mass for f in shape.faces) * unit**2
    return Geometry(shape, curves, area, size * unit, unit, offsets)


def _unit(size: float, shortest: float) -> float:
    """Return the kernel's unit [m] for a body of this size and shortest edge [m].

    It is a power of two, so that scaling is exact.
    """
    unit = min(size, shortest / SHORTEST)
    low, high = HARMLESS
    return 1.0 if low <= unit <= high else 2.0 ** math.floor(math.log2(unit))


def _face(loop: Loop, unit: float) -> Any:
    def vertex(point: Point) -> Any:
        return occ.Pnt(point[0] / unit, point[1] / unit, 0)

    segments = []
    for edge in loop.edges:
        start = vertex(edge.start)
        end = vertex(edge.end)
        if edge.through:
            segments.append(occ.ArcOfCircle(start, vertex(edge.through), end))
        else:
            segments.append(occ.Segment(start, end))
    return occ.Face(occ.Wire(segments))


def _size(face: Any) -> float:
    low, high = face.bounding_box
    return float(np.hypot(high[0] - low[0], high[1] - low[1]))


def _occ_distance(edge: Any) -> Callable[[Array], float]:
    """Return the distance by the kernel from an edge, which is named before regions are cut."""

    def distance(point: Array) -> float:
        vertex = occ.Vertex(occ.Pnt(float(point[0]), float(point[1]), 0))
        return float(edge.Distance(vertex))

    return distance


def _edge_distance(edge: Edge, unit: float) -> Callable[[Array], float]:
    return lambda point: float(edge_distance(edge, unit * point[None])[0]) / unit


def _name_edges(shape: Any, finders: list[Callable[[Array], float]], tolerance: float) -> None:
    """Name every OCC edge by the curve on which its middle lies, others as interfaces of regions.

    Names given before boolean operations do not survive them, hence the search by position.
    """
    names = set()
    for edge in shape.edges:
        low, high = edge.parameter_interval
        middle = edge.Value(0.5 * (low + high))
        distances = [distance(np.array([middle[0], middle[1]])) for distance in finders]
        nearest = int(np.argmin(distances))
        edge.name = f"c{nearest}" if distances[nearest] <= tolerance else INTERFACE
        names.add(edge.name)
    missing = [i for i in range(len(finders)) if f"c{i}" not in names]
    if missing:
        raise GeometryFailed(
            f"boundary curve {missing[0]} vanished when holes and regions were cut; "
            "check that parts do not overlap",
            ("body",),
        )


def _read_face(
    record: BrepFace,
) -> tuple[Any, tuple[Curve, ...], float, tuple[tuple[str, Point, float], ...]]:
    """Return one plane face of a file, its curves, its unit [m], and `Geometry.offsets`.

    The curves have the names of the points that the study gives.
    """
    fault = file_fault(record.path)
    if fault is not None:
        raise GeometryFailed(
            f"{record.path.name}: {fault}; export the face again", ("body", "file")
        )
    faces = list(occ.OCCGeometry(str(record.path), dim=2).shape.faces)
    if record.face >= len(faces):
        raise GeometryFailed(
            f"{record.path.name}: has {len(faces)} faces, face {record.face} does not exist"
        )
    face = faces[record.face]
    unit = _unit(record.scale * _size(face), record.scale * min(edge.mass for edge in face.edges))
    if record.scale != unit:
        face = face.Scale(occ.Pnt(0, 0, 0), record.scale / unit)
    edges = list(face.edges)
    # not by the bounding box, which the kernel widens by an absolute tolerance
    heights = [abs(edge.Value(t)[2]) for edge in edges for t in _parameters(edge, 5)]
    if max(heights) > 1e-9 * _size(face):
        raise GeometryFailed(
            f"{record.path.name}: face {record.face} does not lie in the plane z = 0"
        )
    names: list[str | None] = [record.other] * len(edges)
    offsets = list[tuple[str, Point, float]]()
    for name, points in record.edges:
        for point in points:
            nearest, offset = _edge_near(record, edges, name, point, _size(face), unit)
            names[nearest] = name
            offsets.append((name, point, offset))
    unnamed = [i for i, name in enumerate(names) if name is None]
    if unnamed:
        centre = edges[unnamed[0]].center
        place = record.place_in_words((unit * centre[0], unit * centre[1]))
        raise GeometryFailed(
            f"{record.path.name}: the edge around {place} has no name; "
            "name it by a point under edges, or give `other`"
        )
    curves = [_file_curve(edge, str(name), unit) for edge, name in zip(edges, names, strict=True)]
    return face, tuple(curves), unit, tuple(offsets)


def _edge_near(
    record: BrepFace, edges: list[Any], name: str, point: Point, size: float, unit: float
) -> tuple[int, float]:
    """Return the edge that a point names, and its distance from it [m].

    A point off every edge (a slip, wrong units) or at a corner (either edge) raises GeometryFailed.
    """
    point_in_units = np.asarray(point) / unit
    distances = np.array([_occ_distance(edge)(point_in_units) for edge in edges])
    best, *farther = np.argsort(distances, kind="stable")
    where = f"{record.path.name}: the point {record.place_in_words(point)} of edges.{name}"
    if distances[best] > MAX_OFFSET * size:
        raise GeometryFailed(
            f"{where} is {record.in_words(unit * distances[best])} away from the nearest edge of "
            f"the face, whose size is {record.in_words(unit * size)}; give a point on the edge "
            "that is meant, with its unit"
        )
    if farther and distances[farther[0]] - distances[best] <= CORNER * size:
        raise GeometryFailed(
            f"{where} is as near to two edges; give the middle of the edge that is meant"
        )
    return int(best), float(unit * distances[best])


def _file_curve(edge: Any, name: str, unit: float) -> Curve:
    """Return a curve of a file, whose normals follow from the kernel's tangents."""
    grid = _parameters(edge, CURVE_SAMPLES)
    values = [edge.Value(t) for t in grid]
    points = np.array([[value[0], value[1]] for value in values])
    chord = float(np.linalg.norm(points[-1] - points[0]))
    straight = abs(edge.mass - chord) <= 1e-12 * edge.mass

    def nearest_parameter(point: Array) -> float:
        """Return the parameter of the nearest sample after a few projection steps."""
        i = int(np.argmin(np.sum((points - point) ** 2, axis=1)))
        before = max(i - 1, 0)
        after = min(i + 1, len(grid) - 1)
        distance = float(np.linalg.norm(points[after] - points[before]))
        speed = distance / (grid[after] - grid[before])
        t = grid[i]
        for _ in range(8):
            value = edge.Value(t)
            tangent = edge.Tangent(t)
            length = np.hypot(tangent.x, tangent.y)
            projection = (point[0] - value[0]) * tangent.x + (point[1] - value[1]) * tangent.y
            t = min(max(t + projection / length / speed, grid[0]), grid[-1])
        return float(t)

    def normal(points: Array) -> Array:
        normals = []
        for point in points / unit:
            tangent = edge.Tangent(nearest_parameter(point))
            length = np.hypot(tangent.x, tangent.y)
            normals.append(np.array([-tangent.y, tangent.x]) / length)
        return np.array(normals)

    return Curve(name, float(edge.mass) * unit, straight, normal)


def _parameters(edge: Any, count: int) -> Array:
    """Return equally spaced curve parameters, both ends included."""
    low, high = edge.parameter_interval
    return np.linspace(float(low), float(high), count)
