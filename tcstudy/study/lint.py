"""What a study says and its author may not have meant, and what would stop a run before any work.

Said of every study: no load, a body softer than its loads, names that nothing uses, absolute
temperatures, a curve that is a polygon, and volumetric locking of P1 elements in plane strain. What
locking costs is measured on a solution that does not depend on ν: unit square, displacement given
on three sides, contact with a linear law below, u = curl(sin(πx)(y + ky²/2μ)), div u = 0, so that
only the discretisation feels λ; longest element edge 0.048 (2,300 unknowns). The remedy within P1
is a finer mesh: errors fall once h² λ/μ ≲ 1.

The face of a body from a STEP or BREP file is built before any work starts. What an outline is
judged by while the study is read needs the kernel here: whether every name has an edge, regions lie
in the face, the supports exclude rigid motions, and maxh gives a sensible number of triangles.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tcstudy.data.files import Remark, check_writable
from tcstudy.errors import NUMBER, GeometryFailed, UserFault, ranged
from tcstudy.expressions.expression import Expression
from tcstudy.fem.geometry import Geometry, build
from tcstudy.read.body import BoundaryPiece, edge_names, mesh_faults, support_fault, supports
from tcstudy.read.document import Collector, LocatedFault, located, tree_of
from tcstudy.read.fields import names_needed
from tcstudy.scene.guarantee import why_no_bound
from tcstudy.scene.points import combinations, distinct, idle_notes
from tcstudy.scene.records import (
    Body,
    Clamped,
    Contact,
    Material,
    Scene,
    exchanges,
)
from tcstudy.scene.study import Study
from tcstudy.scene.units import BODY_FORCE, LENGTH, LINE_FORCE, TEMPERATURE, TRACTION
from tcstudy.shapes.edges import edge_length, edge_normal, loop_area
from tcstudy.shapes.faults import TOLERANCE
from tcstudy.study.given import Load, Measures, loaded_scenes, loads, walked_scenes
from tcstudy.study.workers import expected_bytes

Points = NDArray[np.float64]

AMBIENT = (250.0, 350.0)
"""Temperatures [K] of a workshop when they are counted from absolute zero, which the study does not
do."""
LENGTH_UNITS = ((1.0, "m"), (1e-3, "mm"), (1e-6, "um"), (1e-9, "nm"))
"""Units of lengths, with their size [m], largest first."""
MAX_STRAIN = 0.1
"""Strain that a load imposes up to which strains count as small."""
MAX_OFFSET = 1e-6
"""Distance of a point from the CAD edge that it names, relative to the body, that is rounding."""
CELLS_IN_ZONE = 5.0
"""Elements in the softening zone from which on the mesh does not decide about the strength."""
ZONE_CELLS, ZONE_ERRORS = (0.7, 1.4, 2.8, 7.0), (52.0, 12.0, 4.0, 2.0)
"""Elements in the softening zone, and by how much the largest force of a bonded strip exceeds
√(2 G_f E t) [%]; a bar of equal cells has 124, 12, 3 and 0.6."""
PARALLEL = 1e-6
"""Sine of the angle up to which two edges meet smoothly; the constraints of a mesh go by the same
bound."""


def lint(study: Study) -> list[str]:
    """One sentence for each of them. Raises GeometryFailed if a file has no such face."""
    return [*_sentences(study), *unused(study)]


def note(fact: str, consequence: str, remedy: str) -> str:
    """Return a warning of three lines: what is so, what comes of it, and what to do."""
    return f"{fact}\n  {consequence}\n  Fix: {remedy}"


def _sentences(study: Study) -> Iterator[str]:
    scenes, body = study.scenes, study.scenes[0].body
    geometry = None if body.brep is None else build(body)
    if geometry is not None:
        yield from _off_their_edge(body, geometry)
        yield from _going_on_straight(study, geometry)
    if count := _pinned(body, scenes[0].edges(Contact), geometry):
        # which both their edges hold: u_N = 0 twice is u = 0
        corners = (
            "corner of the contact line is" if count == 1 else "corners of the contact line are"
        )
        remedy = (
            "draw it as arcs with through: [x, y]"
            if body.brep is None
            else "make it arcs or splines in the file"
        )
        yield (
            f"{count} {corners} pinned: u_N = 0 on both sides leaves no slip there; if short straight edges stand for "
            f"a curve, {remedy}"
        )
    if study.kind == "path":
        visited: Sequence[Scene] = tuple(loaded_scenes(study, AMBIENT))
        unloaded = len(visited) if not loaded(visited).any() else 0
    else:
        visited = scenes
        unloaded = int(np.count_nonzero(~loaded(scenes)))
    if (
        unloaded and study.history is None and study.fit is None
    ):  # whose steps and data are its loads
        where = (
            "nothing loads this scene"
            if len(scenes) == 1
            else f"nothing loads {unloaded} of {len(scenes)} points"
        )
        yield f"{where}: u = 0 is a solution; give f, g, a pressure, a displacement or a temperature"
    if study.mesh.guarantee and (why := dict.fromkeys(filter(None, map(why_no_bound, scenes)))):
        yield f"no error is bounded where {'; or where '.join(why)}"
    measures = Measures.of(body, geometry)
    if study.units == "SI":
        given = list(loads(study, AMBIENT))
        yield from _absolute(study, given, measures)
        yield from _strained(study, given, measures)
        yield from _soft(study, given, measures)
    yield from _coarse(study, measures)
    for region in body.regions:
        if region.moved > 0.0:
            yield (
                f"corners of body.regions.{region.name} miss the edges that they nearly meet by up to "
                f"{region.moved:.2g} and are moved onto them; give them more digits"
            )
    acts_nowhere = set()
    for scene in distinct(scenes, "heat", "boundary"):
        of_edges = [
            None if role.heat is None else role.heat.alpha
            for _, role in scene.boundary
            if exchanges(role)
        ]
        if scene.heat.alpha > 0.0 and None not in of_edges:
            why_idle = (
                "every edge that exchanges heat has its own"
                if of_edges
                else "no edge has the role convection"
            )
            acts_nowhere.add(f"heat.alpha acts nowhere, as {why_idle}; remove it")
    yield from sorted(acts_nowhere)


def loaded(scenes: Sequence[Scene]) -> NDArray[np.bool_]:
    """(P,) whether anything moves a body out of u = 0: a load, a displacement, a temperature, or a
    law that pushes."""

    def where(is_so: Callable[[Scene], bool], *sections: str) -> NDArray[np.bool_]:
        some, of = combinations(scenes, *sections)
        return np.array([is_so(scene) for scene in some], dtype=bool)[of]

    warm = where(_warm, "boundary", "heat") & where(
        lambda scene: scene.material.expands, "material"
    )
    return where(_forced, "boundary", "f") | warm | where(_pushes, "friction")


def _forced(scene: Scene) -> bool:
    """Return whether a mechanical load or a displacement is given."""
    if any(component != 0.0 for component in scene.f):
        return True
    for _, role in scene.boundary:
        if role.loaded:
            return True
        if isinstance(role, Clamped) and any(u is not None and u != 0.0 for u in role.u):
            return True
    return False


def _warm(scene: Scene) -> bool:
    """Whether there is a temperature."""
    if scene.heat.theta is not None:
        return scene.heat.theta != 0.0
    given = (*(bar for _, _, bar in scene.exchange), *(theta for _, theta in scene.held_theta))
    return any(theta != 0.0 for theta in given) or bool(
        given and (scene.heat.q != 0.0 or scene.flux)
    )


def _pushes(scene: Scene) -> bool:
    """Whether the law has a traction where nothing slips: 0 not in b̂(0)."""
    at_0 = (law.interval(np.zeros(1), 0.0) for law in scene.laws)
    return not all(low[0] <= 0.0 <= high[0] for low, high in at_0)


def _absolute(study: Study, given: Sequence[Load], measures: Measures) -> Iterator[str]:
    """Yield a warning for every temperature that looks as if it counts from absolute zero."""
    if not any(scene.material.expands for scene in distinct(study.scenes, "material")):
        return
    suspects = dict[str, float]()
    for load in given:
        if load.dimension == TEMPERATURE:
            for kelvin in _ambient(load, measures.points):
                suspects[load.key] = min(kelvin, suspects.get(load.key, math.inf))
    for key, kelvin in suspects.items():
        yield note(
            f"{key} = {kelvin:g} K: temperatures count from the stress-free state",
            f"The body is heated by as much as {kelvin:g} K, not to {kelvin:g} K.",
            "if it is an absolute temperature, write the difference",
        )


def _ambient(load: Load, points: NDArray[np.float64]) -> Iterator[float]:
    """Yield the numbers of a temperature that are those of a workshop in kelvin: its value, what a
    field adds to what varies in it, or the least value of a field that is never near 0."""
    candidates = load.constants
    if isinstance(load.value, Expression):
        field = load.values(points)
        candidates.append(float(np.min(field, initial=math.inf)))
    for kelvin in candidates:
        if AMBIENT[0] <= kelvin <= AMBIENT[1]:
            yield kelvin


def _strained(study: Study, given: Sequence[Load], measures: Measures) -> Iterator[str]:
    """Yield a warning for the largest temperature and the largest displacement that would strain
    the body more than small strains are."""
    materials = [
        material for scene in distinct(study.scenes, "material") for material in scene.material.all
    ]
    expansion = max(map(_expansion, materials), default=0.0)
    temperatures = [load for load in given if load.dimension == TEMPERATURE and load.scene]
    warmest = _largest(temperatures, measures.points)
    if warmest is not None and expansion * warmest[0] > MAX_STRAIN:
        kelvin, load = warmest
        yield note(
            f"{load.key} = {kelvin:g} K would strain the body by {expansion * kelvin:.2g}",
            f"alpha_T = {expansion:g} 1/K; the model assumes strains that are small.",
            "check alpha_T, often some 1e-5 1/K, and the temperature",
        )
    displacements = [load for load in given if load.dimension == LENGTH]
    farthest = _largest(displacements, measures.points)
    if farthest is not None and farthest[0] > MAX_STRAIN * measures.size:
        metres, load = farthest
        yield note(
            f"{load.key} = {_length(study, metres)} would strain the body by {metres / measures.size:.2g}",
            f"The body has a size of {_length(study, measures.size)}; strains are assumed to be small.",
            "a number without a unit is in m; write mm or um if that was meant",
        )


def _expansion(material: Material) -> float:
    """Return the coefficient of thermal expansion, that behind a given beta where there is one."""
    if material.alpha_T is not None:
        return abs(material.alpha_T)
    factor = 1.0 - material.nu if material.plane == "stress" else 1.0 - 2.0 * material.nu
    return abs(material.beta) * factor / material.E


def _largest(given: Iterable[Load], points: NDArray[np.float64]) -> tuple[float, Load] | None:
    """Return the load with the largest absolute value, behind that value."""
    sizes = [(float(np.max(np.abs(load.values(points)), initial=0.0)), load) for load in given]
    return max(sizes, key=lambda pair: pair[0], default=None)


def _soft(study: Study, given: Sequence[Load], measures: Measures) -> Iterator[str]:
    """Yield a warning for a body softer than its loads: E below a stress on it is a strain above 1,
    where small ones are meant."""
    per_stress = {TRACTION: 1.0, BODY_FORCE: measures.size, LINE_FORCE: 1.0 / measures.size}
    acting = 0.0
    for dimension, factor in per_stress.items():
        same = [load for load in given if load.dimension == dimension]
        acting = max(acting, factor * (_largest(same, measures.points) or (0.0,))[0])
    held = [law.b_scale for scene in distinct(study.scenes, "friction") for law in scene.laws]
    stress, what = acting, "a load"
    if acting == 0.0:
        stress, what = max(held, default=0.0), "the friction"
    least = min(own.E for scene in distinct(study.scenes, "material") for own in scene.material.all)
    if 0.0 < least < stress < math.inf:
        yield note(
            f"E = {least:g} Pa: {what} of {stress:.3g} Pa would strain the body by {stress / least:.2g}",
            "The model assumes strains that are small.",
            "a number without a unit is in Pa; write MPa or GPa if that was meant",
        )


def _coarse(study: Study, measures: Measures) -> Iterator[str]:
    """Yield a warning for elements longer than a fifth of the zone in which a softening law falls."""
    if study.mesh.open_ended:
        return
    zone = min(
        (
            _softening_zone(law.omega, material, measures.area / measures.contact(scene))
            for scene in walked_scenes(study, AMBIENT, "friction", "material", "boundary")
            for law in scene.laws
            for material in scene.material.all
            if 0.0 < law.omega < math.inf and measures.contact(scene) > 0.0
        ),
        default=math.inf,
    )
    element = _element(study)
    cells = zone / element
    if cells >= CELLS_IN_ZONE:
        return
    error = float(np.interp(math.log(cells), np.log(ZONE_CELLS), ZONE_ERRORS))
    bound = "at least " if cells < ZONE_CELLS[0] else ""
    long, whole, fine = (_length(study, one) for one in (element, zone, zone / CELLS_IN_ZONE))
    yield note(
        f"elements of {long} are long for a softening zone of {whole}",
        f"{cells:.2g} cells in it: a strip debonds at loads {bound}{error:.2g} % too high "
        f"({', '.join(f'{e:g} % at {c:g}' for c, e in zip(ZONE_CELLS, ZONE_ERRORS, strict=True))}).",
        f"take elements of {fine} or less: a smaller mesh.maxh or more levels",
    )


def _length(study: Study, length: float) -> str:
    """Return a length in words, in the unit of its size."""
    if study.units == "none":
        return f"{length:.3g}"
    metres, unit = next((one for one in LENGTH_UNITS if length >= one[0]), LENGTH_UNITS[-1])
    return f"{length / metres:.3g} {unit}"


def _element(study: Study) -> float:
    """Return the size of the elements on the mesh whose results count [m]."""
    mesh = study.mesh
    last = mesh.levels - 1
    plan = study.fit or study.history or study.path
    level = last if plan is None or plan.level is None else plan.level % mesh.levels
    return mesh.maxh[level] if mesh.listed else mesh.maxh[0] / 2**level


def _softening_zone(omega: float, material: Material, height: float) -> float:
    """Return the length in which a law of this slope softens, a quarter of the wave that the body
    resists as stiffly as the law falls [m].

    A free strip resists waves of the number k with E' t k², a thick body with
    2μ (λ + 2μ)/(λ + 3μ) k where u_N = 0.
    """
    lam, mu = material.lam, material.mu
    strip = 4.0 * mu * (lam + mu) / (lam + 2.0 * mu) * height
    thick = 2.0 * mu * (lam + 2.0 * mu) / (lam + 3.0 * mu)
    return 0.5 * math.pi * min(math.sqrt(strip / omega), thick / omega)


def unused(study: Study) -> list[str]:
    """Names under `parameters` that no number of the study uses, each with its line."""
    if "parameters" not in study.text and not any("parameters" in text for text in study.overrides):
        return []
    root = tree_of(study, Collector())
    names, sections = root.at("parameters"), root.value
    if names is None or not (isinstance(names.value, Mapping) and isinstance(sections, Mapping)):
        return []
    others = [
        node
        for key, node in sections.items()
        if key not in ("title", "institution", "units", "parameters")
    ]
    needed = names_needed(names, others)
    idle = [name for name in names.value if name not in needed]
    what, remedy = (
        "no number of the study uses this name",
        "write it where it is meant, or remove it",
    )
    return [
        str(problem)
        for problem in located(study, [(("parameters", name), what, remedy) for name in idle])
    ]


def _pinned(body: Body, contact: tuple[str, ...], geometry: Geometry | None) -> int:
    """Corners between two contact edges of different directions."""
    if geometry is None:
        corners = [
            pair
            for loop in body.loops
            for pair in loop.corners
            if all(one.name in contact for one in pair)
        ]
        normals = [
            (edge_normal(one, [one.end])[0], edge_normal(two, [two.start])[0])
            for one, two in corners
        ]
    else:
        ends = [
            (p[i], n[i]) for name, p, n in geometry.samples() if name in contact for i in (0, -1)
        ]
        pairs = itertools.combinations(ends, 2)
        normals = [
            (a, b) for (p, a), (q, b) in pairs if np.linalg.norm(p - q) <= ACCURACY * geometry.size
        ]
    return sum(abs(a[0] * b[1] - a[1] * b[0]) > PARALLEL for a, b in normals)


def _off_their_edge(body: Body, geometry: Geometry) -> Iterator[str]:
    """Yield a warning for every point of a study that lies off the CAD edge that it names."""
    assert body.brep is not None
    for name, point, offset in geometry.offsets:
        if offset > MAX_OFFSET * geometry.size:
            place, distance = body.brep.place_in_words(point), body.brep.in_words(offset)
            yield note(
                f"the point {place} of edges.{name} is {distance} off its edge",
                "The nearest edge gets the name; another one may be meant.",
                "give a point on the edge",
            )


def _going_on_straight(study: Study, geometry: Geometry) -> Iterator[str]:
    """Yield a warning for every CAD edge that goes on from a named one along the same line or
    circle, under the name of all others and with another role."""
    scene = study.scenes[0]
    brep, roles = scene.body.brep, dict(scene.boundary)
    assert brep is not None
    if brep.other in dict(brep.edges):
        return
    slack = ACCURACY * geometry.size
    pieces = geometry.samples()
    others = [piece for name, piece, _ in pieces if name == brep.other]
    for name, piece, _ in pieces:
        if name == brep.other or roles.get(name) == roles.get(str(brep.other)):
            continue
        for other in others:
            if touches(piece, other, slack) and is_on_curve(piece, other, slack):
                x, y = other[len(other) // 2].tolist()
                place = brep.place_in_words((x, y))
                yield note(
                    f"the edge {name} goes on as {brep.other} along the same line",
                    f"The CAD file has cut it in two: the piece around {place} is {brep.other}.",
                    f"add {brep.entry((x, y))} to edges.{name}, or give the piece a name",
                )


def touches(piece: Points, other: Points, slack: float) -> bool:
    """Return whether two curves (n, 2) share an end."""
    apart = piece[[0, -1]][:, None] - other[[0, -1]][None]
    return bool(np.hypot(apart[..., 0], apart[..., 1]).min() <= slack)


def is_on_curve(piece: Points, other: Points, slack: float) -> bool:
    """Return whether the points of one curve lie on the line or the circle of another."""
    first, middle, last = piece[0], piece[len(piece) // 2], piece[-1]
    chord = last - first
    length = float(np.hypot(*chord))
    if length <= slack:
        return False
    across = np.array([-chord[1], chord[0]]) / length
    sagitta = float(across @ (middle - first))
    offsets = (other - first) @ across
    if abs(sagitta) <= slack:
        reach = max(1.0, float(np.max(np.hypot(*(other - first).T))) / length)
        return bool(np.max(np.abs(offsets)) <= slack * reach)
    radius = 0.5 * (0.25 * length**2 / sagitta + sagitta)
    centre = 0.5 * (first + last) + (sagitta - radius) * across
    off_circle = np.concatenate([piece, other]) - centre
    return bool(np.max(np.abs(np.hypot(*off_circle.T) - abs(radius))) <= slack)


NEARLY_INCOMPRESSIBLE = 0.45
MEASURED = {
    0.3: (3.6, 0.14),
    0.45: (5.2, 0.24),
    0.49: (10.0, 1.3),
    0.499: (30.0, 7.3),
    0.4999: (91.0, 15.0),
}
"""Error of u in the energy norm and of u_T in L² of Γ_C [%] by ν, as `tcstudy converge` measures
it."""


def locking_notes(scenes: Sequence[Scene]) -> list[str]:
    """The warning for the largest Poisson's ratio in plane strain, with the measured loss, if it
    deserves one."""
    materials = [own for scene in distinct(scenes, "material") for own in scene.material.all]
    nu = max((own.nu for own in materials if own.plane == "strain"), default=0.0)
    if nu < NEARLY_INCOMPRESSIBLE:
        return []
    near = max(known for known in MEASURED if known <= nu + 1e-12)
    (energy, slip), (usual_energy, usual_slip) = MEASURED[near], MEASURED[0.3]
    return [
        f"nu = {nu:.12g} in plane strain: P1 elements lock. On a test with h = 0.048 of its size, at nu = {near:g} "
        f"u is off by {energy:g} % (energy norm) and u_T by {slip:g} %, against {usual_energy:g} % and "
        f"{usual_slip:g} % at nu = 0.3, and λ₁ of the mesh is far above that of the body. Trust only levels with "
        "settled rates, and refine; mesh.guarantee: true says what is true of the body."
    ]


ACCURACY = 1e-7
"""Of points and normals of a curve from a file, relative to the body; the kernel's own
tolerance."""


def built_faults(study: Study) -> list[LocatedFault]:
    """The faults of a study whose body is a file; empty for every other body."""
    body = study.scenes[0].body
    if body.brep is None:
        return []
    try:
        geometry = build(body)
    except GeometryFailed as error:
        what, _, remedy = str(error).partition("; ")
        return [(("body", "file"), what, remedy or "check the file and the number of the face")]
    sizes = mesh_faults(study.mesh, geometry.area, geometry.size, study.units)
    of_sizes = [
        (("mesh", "maxh", *([i] if study.mesh.listed else ())), what, remedy)
        for i, what, remedy in sizes
    ]
    return [
        *_nameless(body, geometry),
        *_of_regions(body, geometry),
        *_of_supports(study, geometry),
        *of_sizes,
    ]


def _nameless(body: Body, geometry: Geometry) -> Iterator[LocatedFault]:
    """Names that no edge of the face has, since another name's point is nearest to the same
    edge."""
    assert body.brep is not None
    for name in set(edge_names(body)) - {curve.name for curve in geometry.curves}:
        what = f"no edge of the face has the name {name!r}: "
        if name == body.brep.other:
            yield (
                ("body", "file", "other"),
                f"{what}all edges are named by points",
                "leave out other",
            )
        else:
            what += "another name has a point at the same edge"
            yield (
                ("body", "file", "edges", name),
                what,
                "give a point nearer to the edge that is meant",
            )


def _of_regions(body: Body, geometry: Geometry) -> Iterator[LocatedFault]:
    """Regions that leave the face; they may end on its edges."""
    areas = geometry.face_areas()
    for region in body.regions:
        whole, inside = loop_area(region.loop), areas.get(region.name, 0.0)
        slack = min(
            TOLERANCE * geometry.size * sum(edge_length(edge) for edge in region.loop.edges),
            0.1 * whole,
        )
        keys = ("body", "regions", region.name)
        if inside <= slack:
            yield (
                keys,
                "the region lies outside the face of the file",
                "move it inside; coordinates are metres",
            )
        elif whole - inside > slack:
            what = f"the region leaves the face of the file: {inside / whole:.3g} of its area is inside"
            yield (
                keys,
                what,
                "keep it within the face and clear of its holes; it may end on their edges",
            )


def _of_supports(study: Study, geometry: Geometry) -> Iterator[LocatedFault]:
    """Rigid motions that the supports leave, once for each kind of support in the sweep."""
    pieces = [BoundaryPiece(*sample) for sample in geometry.samples()]
    centre = (float(pieces[0].points[0, 0]), float(pieces[0].points[0, 1]))
    kinds = {
        supports(scene.boundary): scene.boundary
        for scene in reversed(distinct(study.scenes, "boundary"))
    }
    for boundary in reversed(kinds.values()):
        if (fault := support_fault(pieces, boundary, centre, geometry.size, ACCURACY)) is not None:
            yield ("boundary",), *fault


def warnings(study: Study, text: bool = True) -> list[Remark]:
    """Notes that results have as well, since their numbers would mislead without them; with the
    geometry where there are several. Raises GeometryFailed if a file has no such face.

    text: whether with those of the study's text, which all geometries share and which takes long to
    read
    """
    if study.variants:
        own = [
            (one.words, map(str, warnings(one.study, False)))
            for one in study.variants
            if one.study is not None
        ]
        return [*map(Remark, unused(study)), *once(own)]
    seen = study if text else replace(study, text="", overrides=())
    return [Remark(note) for note in (*idle_notes(seen), *lint(seen), *locking_notes(seen.scenes))]


def once(notes: Sequence[tuple[str, Iterable[str]]]) -> list[Remark]:
    """Every note once, with the geometries that it is of unless it is of all.

    notes: (words of a geometry, its notes). Those that differ in numbers only are one, with the
    range of each number.
    """
    alike: dict[str, dict[str, str]] = {}
    for words, own in notes:
        for note in own:
            alike.setdefault(NUMBER.sub("#", note), {})[words] = note
    found = []
    for same in alike.values():
        few = "; ".join(same) if len(same) == 1 else f"{len(same)} of {len(notes)} geometries"
        found.append(Remark(ranged([*same.values()]), "" if len(same) == len(notes) else few))
    return found


def faults(study: Study, output: Path) -> list[str]:
    """What would stop a run of this study into `output`, one line each, as the user sees it; empty
    if nothing would."""
    file = str(study.source) if study.source is not None else "<text>"
    found = (f"{file}: {text}" for text in check_writable(output, expected_bytes(study)))
    return [*map(str, located(study, built_faults(study))), *found]


def fault_in(study: Study, fault: UserFault, name: str) -> str:
    """What stopped a command, as the user sees it: with its place in the study, or the study's
    name."""
    if fault.placed:
        return str(fault)
    if fault.keys is None:
        return f"{name}: {fault}"
    what, _, remedy = str(fault).partition("; ")
    return "\n".join(
        map(
            str,
            located(study, [(fault.keys, what, remedy or "check the body, or try another maxh")]),
        )
    )
