"""Warn of what a study's author may not have meant, and find what would stop a run before any work.

Every study is looked at: no load, a body softer than its loads, unused names, absolute
temperatures, a curve that is a polygon, and volumetric locking of P1 elements in plane strain. The
loss by locking is measured on a solution that does not depend on ν: unit square, displacement given
on three sides, contact with a linear law below, u = curl(sin(πx)(y + ky²/2μ)), div u = 0, so that
only the discretisation feels λ; largest element edge 0.048 (2,300 unknowns). The remedy within P1
is a finer mesh: errors fall once h² λ/μ ≲ 1.

The face of a body from a STEP or BREP file is built before any work starts. An outline is judged
while the study is read; a face needs the kernel: whether every name has an edge, regions lie in the
face, the supports exclude rigid motions, and maxh gives a sensible number of triangles.
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
from tcstudy.laws.composed import bonded_edges
from tcstudy.laws.laws import Laws
from tcstudy.laws.pieces import DOWN
from tcstudy.offline.level import motions_of_geometry
from tcstudy.read.body import edge_names, loose_faults, mesh_faults, supports_fault
from tcstudy.read.document import Collector, LocatedFault, located, tree_of
from tcstudy.read.fields import names_needed
from tcstudy.scene.guarantee import why_no_bound
from tcstudy.scene.points import combinations, distinct, idle_notes
from tcstudy.scene.records import (
    Body,
    Boundary,
    Clamped,
    Contact,
    Material,
    Scene,
    exchanges,
    is_clamped,
    resisting_edges,
    supports,
)
from tcstudy.scene.study import Study
from tcstudy.scene.units import BODY_FORCE, LENGTH, LINE_FORCE, TEMPERATURE, TRACTION
from tcstudy.shapes.edges import edge_length, edge_normal, loop_area
from tcstudy.shapes.faults import TOLERANCE
from tcstudy.shapes.rigid_motions import BoundaryPiece, boundary_pieces, motions_of_body
from tcstudy.study import opening_notes
from tcstudy.study.given import Load, Measures, loaded_scenes, loads, walked_scenes
from tcstudy.study.workers import expected_bytes

Points = NDArray[np.float64]

AMBIENT = (250.0, 350.0)
"""Temperatures of a workshop counted from absolute zero [K], which a study does not do."""
LENGTH_UNITS = ((1.0, "m"), (1e-3, "mm"), (1e-6, "um"), (1e-9, "nm"))
"""Units of lengths, with their size [m], largest first."""
MAX_STRAIN = 0.1
"""Strain that a load imposes up to which strains count as small."""
MAX_OFFSET = 1e-6
"""Distance of a point from the CAD edge that it names, relative to the body, that is rounding."""
CELLS_IN_ZONE = 5.0
"""Elements in the softening zone from which on the mesh does not decide about the strength."""
ZONE_CELLS, ZONE_ERRORS = (0.7, 1.4, 2.8, 7.0), (52.0, 12.0, 4.0, 2.0)
"""Elements in the softening zone, and the error of the largest force of a bonded strip [%].

The exact force is √(2 G_f E t). A bar of equal cells has errors of 124, 12, 3 and 0.6 %.
"""
PARALLEL = 1e-6
"""Sine of the largest angle at which two edges meet smoothly, for the constraints of a mesh too."""
ACCURACY = 1e-7
"""Accuracy of points and normals of a curve from a file, relative to the body: the kernel's own."""
MAX_AREA_LOSS = 0.1
"""Largest share of a region's area that its inaccurate edges may cost."""


def lint(study: Study) -> list[str]:
    """Return the warnings of a study, a sentence or note each.

    Raises GeometryFailed if a file has no such face.
    """
    return [*_warnings(study), *unused(study)]


def note(fact: str, consequence: str, remedy: str) -> str:
    """Return a warning of three lines: what is so, what comes of it, and what to do."""
    return f"{fact}\n  {consequence}\n  Fix: {remedy}"


def _warnings(study: Study) -> Iterator[str]:
    """Yield the warnings of a study but those of its text."""
    body = study.scenes[0].body
    geometry = None if body.brep is None else build(body)
    if geometry is not None:
        yield from _off_their_edge(body, geometry)
        yield from _going_on_straight(study, geometry)
    yield from _pinned(study, geometry)
    yield from _loose(study, geometry)
    yield from _unloaded(study)
    if study.mesh.bounds_errors:
        reasons = dict.fromkeys(filter(None, map(why_no_bound, study.scenes)))
        if reasons:
            yield f"no error is bounded where {'; or where '.join(reasons)}"
        yield from _jumping(study)
    measures = Measures.of(body, geometry)
    if study.units == "SI":
        all_loads = list(loads(study, AMBIENT))
        yield from _absolute(study, all_loads, measures)
        yield from _strained(study, all_loads, measures)
        yield from _soft(study, all_loads, measures)
    yield from _coarse(study, measures)
    yield from _coarse_arms(study, geometry)
    yield from _moved_regions(body)
    yield from _idle_exchange(study)


def _pinned(study: Study, geometry: Geometry | None) -> Iterator[str]:
    """Yield a warning for corners of the contact line: u_N = 0 on both edges is u = 0 there."""
    body = study.scenes[0].body
    roles = study.scenes[0].boundary
    bilateral = tuple(
        name for name, role in roles if isinstance(role, Contact) and role.normal == "held"
    )
    count = _count_corners(body, bilateral, geometry)
    if not count:
        return
    corners = "corner of the contact line is"
    if count > 1:
        corners = "corners of the contact line are"
    remedy = "draw it as arcs with through: [x, y]"
    if body.brep is not None:
        remedy = "make it arcs or splines in the file"
    yield (
        f"{count} {corners} constrained: u_N = 0 on both sides prevents slip there; "
        f"if short straight edges stand for a curve, {remedy}"
    )


def _loose(study: Study, geometry: Geometry | None) -> Iterator[str]:
    """Yield a warning where contact alone restrains the body; a history has λ₁ = 0 in its file."""
    scene = study.scenes[0]
    if study.history is not None or is_clamped(scene.boundary):
        return
    motions = motions_of_body(scene.body, scene.boundary)
    if geometry is not None:
        motions = motions_of_geometry(geometry, scene.boundary)
    if not motions:
        return
    moves = motions.words
    if scene.opens:
        moves = moves.replace("slide", "move")
    words = f"contact alone restrains the body: it can {moves} once that has failed"
    proofs = "lambda_1 is 0: uniqueness and global minima are proved without softening only"
    remedy = "pull by a displacement where the failure itself is wanted"
    if scene.opens and not any(_pulls(law) for _, law, _ in scene.opening_laws.laws):
        words = f"contact alone restrains the body: unless pressed, it can {moves}"
        remedy = "press the body on that edge"
    if study.knows_pressure:
        proofs = "lambda_1 is 0: no solution is proved unique"
    yield note(
        words,
        f"{proofs}, and a point whose load nothing resists fails with this motion as the reason",
        f"{remedy}, or add supports or springs",
    )


def _pulls(law: Laws) -> bool:
    """Return whether a law of the opening resists it anywhere; a base of springs does not."""
    has_strength = np.any(law.b_right > 0.0) or np.any(law.a[1:] > 0.0)
    return bool(has_strength or np.any(law.q[1:] > 0.0))


def _unloaded(study: Study) -> Iterator[str]:
    """Yield a warning for scenes that nothing loads."""
    if study.history is not None or study.fit is not None:  # their steps and data are the loads
        return
    if study.kind == "path":
        scenes: Sequence[Scene] = tuple(loaded_scenes(study, AMBIENT))
        count = 0 if loaded(scenes).any() else len(scenes)
    else:
        count = int(np.count_nonzero(~loaded(study.scenes)))
    if not count:
        return
    where = "nothing loads this scene"
    if len(study.scenes) > 1:
        where = f"nothing loads {count} of {len(study.scenes)} points"
    remedy = "give f, g, a pressure, a displacement or a temperature"
    yield f"{where}: u = 0 is a solution; {remedy}"


def _moved_regions(body: Body) -> Iterator[str]:
    """Yield a warning for every region whose corners are moved onto the edges they nearly meet."""
    for region in body.regions:
        if region.moved > 0.0:
            yield (
                f"corners of body.regions.{region.name} miss the edges that they nearly meet "
                f"by up to {region.moved:.2g} and are moved onto them; give them more digits"
            )


def _idle_exchange(study: Study) -> Iterator[str]:
    """Yield a warning where heat.alpha belongs to no edge."""
    reasons = set[str]()
    for scene in distinct(study.scenes, "heat", "boundary"):
        roles = [role for _, role in scene.boundary if exchanges(role)]
        has_alpha = [role.heat is not None and role.heat.alpha is not None for role in roles]
        if scene.heat.alpha > 0.0 and all(has_alpha):
            reasons.add(
                "every edge that exchanges heat has its own"
                if roles
                else "no edge has the role convection"
            )
    for reason in sorted(reasons):
        yield f"heat.alpha acts nowhere, as {reason}; remove it"


def loaded(scenes: Sequence[Scene]) -> NDArray[np.bool_]:
    """Return (P,) whether anything moves a body out of u = 0.

    It may be a load, a displacement, a temperature, or a law with a traction where nothing slips.
    """

    def where(is_so: Callable[[Scene], bool], *sections: str) -> NDArray[np.bool_]:
        representatives, number = combinations(scenes, *sections)
        return np.array([is_so(scene) for scene in representatives], dtype=bool)[number]

    is_warm = where(_has_temperature, "boundary", "heat")
    expands = where(_expands, "material")
    is_forced = where(_forced, "boundary", "f")
    return is_forced | (is_warm & expands) | where(_has_active_traction, "friction")


def _expands(scene: Scene) -> bool:
    return bool(scene.material.expands)


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


def _has_temperature(scene: Scene) -> bool:
    """Return whether the temperature of a scene is not 0 everywhere."""
    if scene.heat.theta is not None:
        return scene.heat.theta != 0.0
    ambient = [theta_bar for _, _, theta_bar in scene.exchange]
    prescribed = [theta for _, theta in scene.held_theta]
    temperatures = ambient + prescribed
    if any(theta != 0.0 for theta in temperatures):
        return True
    return bool(temperatures and (scene.heat.q != 0.0 or scene.flux))


def _has_active_traction(scene: Scene) -> bool:
    """Return whether the law has a traction where nothing slips: 0 not in b̂(0)."""
    for law in scene.laws:
        low, high = law.interval(np.zeros(1), 0.0)
        if not low[0] <= 0.0 <= high[0]:
            return True
    return False


def _absolute(study: Study, all_loads: Sequence[Load], measures: Measures) -> Iterator[str]:
    """Yield a warning for every temperature that looks as if it counts from absolute zero."""
    if not any(scene.material.expands for scene in distinct(study.scenes, "material")):
        return
    suspects = dict[str, float]()
    for load in all_loads:
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
    """Yield the numbers of a temperature that are those of a workshop in kelvin.

    They are its value, or the constants and the least value of a field.
    """
    candidates = load.constants
    if isinstance(load.value, Expression):
        field = load.values(points)
        candidates.append(float(np.min(field, initial=math.inf)))
    for kelvin in candidates:
        if AMBIENT[0] <= kelvin <= AMBIENT[1]:
            yield kelvin


def _strained(study: Study, all_loads: Sequence[Load], measures: Measures) -> Iterator[str]:
    """Yield warnings for a temperature and a displacement that would strain the body too much."""
    materials = [
        material for scene in distinct(study.scenes, "material") for material in scene.material.all
    ]
    expansion = max(map(_expansion, materials), default=0.0)
    temperatures = [load for load in all_loads if load.dimension == TEMPERATURE and load.scene]
    warmest = _largest(temperatures, measures.points)
    if warmest is not None and expansion * warmest[0] > MAX_STRAIN:
        kelvin, load = warmest
        yield note(
            f"{load.key} = {kelvin:g} K would strain the body by {expansion * kelvin:.2g}",
            f"alpha_T = {expansion:g} 1/K; the model assumes strains that are small.",
            "check alpha_T, often some 1e-5 1/K, and the temperature",
        )
    displacements = [load for load in all_loads if load.dimension == LENGTH]
    farthest = _largest(displacements, measures.points)
    if farthest is not None and farthest[0] > MAX_STRAIN * measures.size:
        metres, load = farthest
        share = metres / measures.size
        size = _length(study, measures.size)
        yield note(
            f"|{load.key}| = {_length(study, metres)} is {share:.2g} times the size of the body",
            f"The size is {size}; strains and rotations are assumed to be small.",
            "a number without a unit is in m; write mm or um if that was meant",
        )


def _expansion(material: Material) -> float:
    """Return the coefficient of thermal expansion, also where the stress coefficient is given."""
    if material.alpha_T is not None:
        return abs(material.alpha_T)
    factor = 1.0 - material.nu if material.plane == "stress" else 1.0 - 2.0 * material.nu
    return abs(material.beta) * factor / material.E


def _largest(all_loads: Iterable[Load], points: NDArray[np.float64]) -> tuple[float, Load] | None:
    """Return the largest absolute value of the loads, and its load; None without loads."""
    sizes = [(float(np.max(np.abs(load.values(points)), initial=0.0)), load) for load in all_loads]
    return max(sizes, key=lambda pair: pair[0], default=None)


def _soft(study: Study, all_loads: Sequence[Load], measures: Measures) -> Iterator[str]:
    """Yield a warning for a body softer than its loads: such a stress is a strain above 1."""
    per_stress = {TRACTION: 1.0, BODY_FORCE: measures.size, LINE_FORCE: 1.0 / measures.size}
    stress = 0.0
    for dimension, factor in per_stress.items():
        same = [load for load in all_loads if load.dimension == dimension]
        largest = _largest(same, measures.points)
        if largest is not None:
            stress = max(stress, factor * largest[0])
    subject = "a load"
    if stress == 0.0:
        laws = [law for scene in distinct(study.scenes, "friction") for law in scene.laws]
        stress = max((law.b_scale for law in laws), default=0.0)
        subject = "the friction"
    modulus = min(material.E for material in _materials(study.scenes))
    if 0.0 < modulus < stress < math.inf:
        strain = stress / modulus
        yield note(
            f"E = {modulus:g} Pa: {subject} of {stress:.3g} Pa would strain the body by "
            f"{strain:.2g}",
            "The model assumes strains that are small.",
            "a number without a unit is in Pa; write MPa or GPa if that was meant",
        )


def _materials(scenes: Sequence[Scene]) -> list[Material]:
    """Return the materials of all scenes and regions."""
    materials = list[Material]()
    for scene in distinct(scenes, "material"):
        materials += scene.material.all
    return materials


def _jumping(study: Study) -> Iterator[str]:
    """Yield a warning for laws that jump down, where proved bounds do not converge."""
    laws = [law for scene in distinct(study.scenes, "friction") for law in scene.laws]
    jumps = [law.b_left - law.b_right for law in laws if np.any(law.kinds == DOWN)]
    drop = max((float(np.max(jump)) for jump in jumps), default=0.0)
    if not drop > 0.0:
        return
    stress = f"{drop:.3g}" if study.units == "none" else f"{drop:.3g} Pa"
    yield note(
        f"a friction law jumps down by J = {stress}, and error_bound is requested",
        "error_bound stops falling with the mesh where the slip is within J/λ₁ of the jump, λ₁ of "
        "the body. It holds all the same.",
        "give the fall a length, as slip-weakening has, or judge such points by estimates",
    )


def _coarse(study: Study, measures: Measures) -> Iterator[str]:
    """Yield a warning for elements longer than a fifth of the zone in which a law softens."""
    if study.mesh.open_ended:
        return
    zone = _shortest_zone(study, measures)
    element = _element(study)
    cells = zone / element
    if cells >= CELLS_IN_ZONE:
        return
    error = float(np.interp(math.log(cells), np.log(ZONE_CELLS), ZONE_ERRORS))
    bound = "at least " if cells < ZONE_CELLS[0] else ""
    table = zip(ZONE_CELLS, ZONE_ERRORS, strict=True)
    examples = ", ".join(f"{percent:g} % at {count:g}" for count, percent in table)
    zone_words = _length(study, zone)
    remedy = f"take elements of {_length(study, zone / CELLS_IN_ZONE)} or less"
    yield note(
        f"elements of {_length(study, element)} are long for a softening zone of {zone_words}",
        f"{cells:.2g} elements in it: a strip debonds at loads {bound}{error:.2g} % too high "
        f"({examples}).",
        f"{remedy}: a smaller mesh.maxh or more levels",
    )


def _coarse_arms(study: Study, geometry: Geometry | None) -> Iterator[str]:
    """Yield warnings for elements too large for an arm that bends, and for a cohesive zone."""
    roles = (role for _, role in study.scenes[0].boundary if isinstance(role, Contact))
    if study.mesh.open_ended or all(role.normal == "held" for role in roles):
        return
    pieces = boundary_pieces(study.scenes[0].body)
    if geometry is not None:
        pieces = [BoundaryPiece(*sample) for sample in geometry.samples()]
    arm = opening_notes.arm_of(study.scenes[0], pieces)
    if arm is None or not math.isfinite(arm.thickness):
        return
    element = _element(study)
    cells = arm.thickness / element
    if arm.bends and cells < opening_notes.CELLS_OVER_ARM:
        yield note(
            f"elements of {_length(study, element)} are large for an arm of "
            f"{_length(study, arm.thickness)} that bends",
            f"{cells:.2g} elements over its thickness: bending is too stiff by about "
            f"{arm.stiffening(element):.2g} % (2.8 % at 8, 1.2 % at 12, 0.7 % at 16).",
            f"take elements of {_length(study, arm.least_element)} or less: a smaller mesh.maxh or "
            "more levels",
        )
    scenes = walked_scenes(study, AMBIENT, "adhesion", "material")
    zone = min(opening_notes.cohesive_zone(scene, arm) for scene in scenes)
    cells = zone / element
    if cells < opening_notes.CELLS_IN_ZONE:
        bound = "at least " if cells < opening_notes.ZONE_CELLS[0] else "about "
        yield note(
            f"elements of {_length(study, element)} are long for a cohesive zone of "
            f"{_length(study, zone)}",
            f"{cells:.2g} elements in it: the force of a growing crack goes up and down by "
            f"{bound}{opening_notes.wiggle(cells):.2g} % (5 % at 1.8, 2 % at 2.6, 0.5 % at 5).",
            f"take elements of {_length(study, zone / opening_notes.CELLS_IN_ZONE)} or less: a "
            "smaller mesh.maxh or more levels",
        )


def _shortest_zone(study: Study, measures: Measures) -> float:
    """Return the shortest softening zone in all scenes, ∞ where no law softens gradually [m]."""
    zone = math.inf
    for scene in walked_scenes(study, AMBIENT, "friction", "material", "boundary"):
        contact = measures.contact(scene)
        if not contact > 0.0:
            continue
        height = measures.area / contact
        slopes = [law.omega for law in scene.laws if 0.0 < law.omega < math.inf]
        for omega, material in itertools.product(slopes, scene.material.all):
            zone = min(zone, _softening_zone(omega, material, height))
    return zone


def _length(study: Study, length: float) -> str:
    """Return a length in words, in the unit of its size."""
    if study.units == "none":
        return f"{length:.3g}"
    fitting = (pair for pair in LENGTH_UNITS if length >= pair[0])
    metres, unit = next(fitting, LENGTH_UNITS[-1])
    return f"{length / metres:.3g} {unit}"


def _element(study: Study) -> float:
    """Return the size of the elements on the mesh whose results count [m]."""
    mesh = study.mesh
    last = mesh.levels - 1
    plan = study.fit or study.history or study.path
    level = last if plan is None or plan.level is None else plan.level % mesh.levels
    return mesh.maxh[level] if mesh.listed else mesh.maxh[0] / 2**level


def _softening_zone(omega: float, material: Material, height: float) -> float:
    """Return the length in which a law of slope ω softens [m].

    It is a quarter of the wave that the body resists as stiffly as the law softens.

    A free strip resists waves of the number k with E' t k², a thick body with
    2μ (λ + 2μ)/(λ + 3μ) k where u_N = 0.
    """
    lam, mu = material.lam, material.mu
    strip = 4.0 * mu * (lam + mu) / (lam + 2.0 * mu) * height
    thick = 2.0 * mu * (lam + 2.0 * mu) / (lam + 3.0 * mu)
    return 0.5 * math.pi * min(math.sqrt(strip / omega), thick / omega)


def unused(study: Study) -> list[str]:
    """Return a warning for every name under `parameters` that no number uses, with its line."""
    texts = (study.text, *study.overrides)
    if not any("parameters" in text for text in texts):
        return []
    root = tree_of(study, Collector())
    parameters = root.at("parameters")
    sections = root.value
    if parameters is None or not isinstance(sections, Mapping):
        return []
    if not isinstance(parameters.value, Mapping):
        return []
    without_numbers = ("title", "institution", "units", "parameters")
    users = [node for key, node in sections.items() if key not in without_numbers]
    needed = names_needed(parameters, users)
    problem = "this parameter is never used"
    remedy = "write it where it is meant, or remove it"
    faults: list[LocatedFault] = [
        (("parameters", name), problem, remedy) for name in parameters.value if name not in needed
    ]
    return [str(fault) for fault in located(study, faults)]


def _count_corners(body: Body, contact: tuple[str, ...], geometry: Geometry | None) -> int:
    """Return the number of corners between two contact edges of different directions."""
    normals = _outline_normals(body, contact)
    if geometry is not None:
        normals = _face_normals(geometry, contact)
    return sum(abs(a[0] * b[1] - a[1] * b[0]) > PARALLEL for a, b in normals)


def _outline_normals(body: Body, contact: tuple[str, ...]) -> list[tuple[Points, Points]]:
    """Return the normals of both edges at every corner between two contact edges of an outline."""
    normals = list[tuple[Points, Points]]()
    for loop in body.loops:
        for before, after in loop.corners:
            if before.name in contact and after.name in contact:
                normal_before = edge_normal(before, [before.end])[0]
                normal_after = edge_normal(after, [after.start])[0]
                normals.append((normal_before, normal_after))
    return normals


def _face_normals(geometry: Geometry, contact: tuple[str, ...]) -> list[tuple[Points, Points]]:
    """Return the normals of both edges wherever two contact edges of a face meet."""
    ends = list[tuple[Points, Points]]()
    for name, points, normals in geometry.samples():
        if name in contact:
            ends += [(points[0], normals[0]), (points[-1], normals[-1])]
    slack = ACCURACY * geometry.size
    return [
        (normal, other_normal)
        for (point, normal), (other, other_normal) in itertools.combinations(ends, 2)
        if np.linalg.norm(point - other) <= slack
    ]


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
    """Yield a warning for every unnamed CAD edge that goes on from a named one.

    It lies on the same line or circle, has the name of all others, and another role.
    """
    scene = study.scenes[0]
    brep = scene.body.brep
    roles = dict(scene.boundary)
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
"""Poisson's ratio in plane strain from which on locking is warned of."""
MEASURED = {
    0.3: (3.6, 0.14),
    0.45: (5.2, 0.24),
    0.49: (10.0, 1.3),
    0.499: (30.0, 7.3),
    0.4999: (91.0, 15.0),
}
"""Errors of u in the energy norm and of u_T in L² of Γ_C [%] by ν, from `tcstudy converge`."""


def locking_notes(scenes: Sequence[Scene]) -> list[str]:
    """Return the warning of locking for the largest Poisson's ratio in plane strain, if any."""
    in_strain = [material for material in _materials(scenes) if material.plane == "strain"]
    nu = max((material.nu for material in in_strain), default=0.0)
    if nu < NEARLY_INCOMPRESSIBLE:
        return []
    near = max(known for known in MEASURED if known <= nu + 1e-12)
    energy, slip = MEASURED[near]
    usual_energy, usual_slip = MEASURED[0.3]
    return [
        f"nu = {nu:.12g} in plane strain: P1 elements lock. On a test with h = 0.048 of its size, "
        f"at nu = {near:g} u is off by {energy:g} % (energy norm) and u_T by {slip:g} %, against "
        f"{usual_energy:g} % and {usual_slip:g} % at nu = 0.3, and λ₁ of the mesh is far above "
        "that of the body. Trust only levels in the asymptotic range, and refine; "
        "mesh.guarantee: true says what is true of the body."
    ]


def built_faults(study: Study) -> list[LocatedFault]:
    """Return the faults of a study whose body is a file; none for every other body."""
    body = study.scenes[0].body
    if body.brep is None:
        return []
    try:
        geometry = build(body)
    except GeometryFailed as error:
        problem, _, remedy = str(error).partition("; ")
        usual_remedy = "check the file and the number of the face"
        return [(("body", "file"), problem, remedy or usual_remedy)]
    return [
        *_nameless(body, geometry),
        *_of_regions(body, geometry),
        *_of_supports(study, geometry),
        *_of_sizes(study, geometry),
    ]


def _nameless(body: Body, geometry: Geometry) -> Iterator[LocatedFault]:
    """Yield a fault for every name that no edge of the face has.

    The point of another name is then nearest to the same edge.
    """
    assert body.brep is not None
    for name in set(edge_names(body)) - {curve.name for curve in geometry.curves}:
        problem = f"no edge of the face has the name {name!r}"
        if name == body.brep.other:
            keys: tuple[str, ...] = ("body", "file", "other")
            problem += ": all edges are named by points"
            remedy = "leave out other"
        else:
            keys = ("body", "file", "edges", name)
            problem += ": another name has a point at the same edge"
            remedy = "give a point nearer to the edge that is meant"
        yield keys, problem, remedy


def _of_regions(body: Body, geometry: Geometry) -> Iterator[LocatedFault]:
    """Yield a fault for every region that leaves the face; it may end on its edges."""
    areas = geometry.face_areas()
    for region in body.regions:
        area = loop_area(region.loop)
        area_inside = areas.get(region.name, 0.0)
        circumference = sum(edge_length(edge) for edge in region.loop.edges)
        slack = min(TOLERANCE * geometry.size * circumference, MAX_AREA_LOSS * area)
        keys = ("body", "regions", region.name)
        if area_inside <= slack:
            problem = "the region lies outside the face of the file"
            yield keys, problem, "move it inside; coordinates are metres"
        elif area - area_inside > slack:
            share = f"{area_inside / area:.3g} of its area is inside"
            problem = f"the region leaves the face of the file: {share}"
            remedy = "keep it within the face and clear of its holes; it may end on their edges"
            yield keys, problem, remedy


def _of_supports(study: Study, geometry: Geometry) -> Iterator[LocatedFault]:
    """Yield a fault for rigid motions that the supports leave, once for each kind of support."""
    kinds = dict[object, Boundary]()
    for scene in distinct(study.scenes, "boundary"):
        kinds.setdefault(supports(scene.boundary), scene.boundary)
    bonded = frozenset[str]()
    for scene in distinct(study.scenes, "friction"):
        bonded |= bonded_edges(scene.friction)
    for boundary in kinds.values():
        resisting = resisting_edges(boundary, bonded)
        motions = motions_of_geometry(geometry, boundary, resisting)
        fault = supports_fault(motions, boundary, has_friction=bool(resisting))
        if fault is not None:
            yield ("boundary",), *fault
        elif not is_clamped(boundary):
            motions = motions_of_geometry(geometry, boundary)
            yield from loose_faults(motions, study.mesh, study.path, study.output.live)


def _of_sizes(study: Study, geometry: Geometry) -> Iterator[LocatedFault]:
    """Yield a fault for every element size that gives too many or too few triangles."""
    for i, problem, remedy in mesh_faults(study.mesh, geometry.area, geometry.size, study.units):
        keys = ("mesh", "maxh", i) if study.mesh.listed else ("mesh", "maxh")
        yield keys, problem, remedy


def warnings(study: Study, text: bool = True) -> list[Remark]:
    """Return the warnings that result files keep, with the geometry where there are several.

    text: whether with those of the study's text, which all geometries share and which takes long to
          read
    Raises GeometryFailed if a file has no such face.
    """
    if study.variants:
        of_geometries = list[tuple[str, list[str]]]()
        for variant in study.variants:
            if variant.study is not None:
                notes = [str(remark) for remark in warnings(variant.study, text=False)]
                of_geometries.append((variant.words, notes))
        return [*map(Remark, unused(study)), *once(of_geometries)]
    if not text:
        study = replace(study, text="", overrides=())
    notes = [*idle_notes(study), *lint(study), *locking_notes(study.scenes)]
    return [Remark(note) for note in notes]


def once(notes: Sequence[tuple[str, Iterable[str]]]) -> list[Remark]:
    """Return every note once, with the geometries that it is of unless it is of all.

    notes: (words of a geometry, its notes). Those that differ in numbers only are one, with the
           range of each number.
    """
    alike = dict[str, dict[str, str]]()
    for words, geometry_notes in notes:
        for note in geometry_notes:
            alike.setdefault(NUMBER.sub("#", note), {})[words] = note
    remarks = list[Remark]()
    for by_geometry in alike.values():
        where = f"{len(by_geometry)} of {len(notes)} geometries"
        if len(by_geometry) == 1:
            (where,) = by_geometry
        if len(by_geometry) == len(notes):
            where = ""
        remarks.append(Remark(ranged([*by_geometry.values()]), where))
    return remarks


def faults(study: Study, output: Path) -> list[str]:
    """Return what would stop a run of this study into `output`, one line each."""
    name = str(study.source) if study.source is not None else "<text>"
    of_study = [str(problem) for problem in located(study, built_faults(study))]
    of_output = [f"{name}: {text}" for text in check_writable(output, expected_bytes(study))]
    return of_study + of_output


def fault_in(study: Study, fault: UserFault, name: str) -> str:
    """Return the text of a fault with its place in the study, or the study's name."""
    if fault.placed:
        return str(fault)
    if fault.keys is None:
        return f"{name}: {fault}"
    problem, _, remedy = str(fault).partition("; ")
    usual_remedy = "check the body, or try another maxh"
    problems = located(study, [(fault.keys, problem, remedy or usual_remedy)])
    return "\n".join(str(problem) for problem in problems)
