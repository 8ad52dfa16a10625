"""The scene of a study before any work: outline, roles of edges, loads, material, mesh, law, sweep.

It shows the first point of the sweep. All is placed in inches of the sheet, so that letters and
arrows do not cover each other. A body more than SLENDER times as long as high is drawn higher than
it is, and the facts below the heading say by which factor.
"""

from __future__ import annotations

import textwrap
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from tcstudy.data.variables import axis_attributes
from tcstudy.errors import shortened
from tcstudy.laws.laws import Laws
from tcstudy.laws.shapes import knows_pressure
from tcstudy.reports.figures import style
from tcstudy.reports.figures.body import (
    CONTACTS,
    FILLS,
    HATCH,
    ROLES,
    beside_line,
    draw_edge,
    length_of,
    outside,
    points_along,
)
from tcstudy.reports.figures.panels import AROUND, Array, Labels, Panel, Sheet, scale
from tcstudy.reports.figures.point import draw_law, slip_range
from tcstudy.reports.picture import edge_laws, polylines
from tcstudy.reports.symbols import symbol
from tcstudy.reports.text import counted, number, pretty, scaled_labels, with_unit
from tcstudy.scene.keys import law_rows
from tcstudy.scene.parameters import Number, numbers
from tcstudy.scene.points import distinct
from tcstudy.scene.records import BODY, Body, Clamped, Contact, Role, Scalar, Scene
from tcstudy.scene.study import Axis, Study
from tcstudy.shapes.edges import edge_points

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

MAX_WIDTH = 4.55
"""Largest width of the body [inch]."""
MAX_HEIGHT = 3.4
"""Largest height of the body [inch]."""
SLENDER_HEIGHT = 0.45
"""Height of a slender body [inch]."""
SIDE = 1.35
"""Margins beside the body [inch]."""
SLENDER = 12.0
"""Ratio of length to height from which on a body is drawn higher than it is."""
ARROW = 0.34
"""Length of an arrow [inch]."""
ARROW_DISTANCE = 0.55
"""Distance of arrows along an edge [inch]."""
MAX_ARROWS = 9.0
"""Arrows along an edge."""
LETTERS = 8.0
"""Size of the letters [pt]."""
LINE = 0.15
"""Height of a line of text [inch]."""
LABEL_COLUMNS = 21
"""Letters of a line of a label."""
MAX_EXPRESSION_LETTERS = 24
"""Letters of an expression; longer ones are shortened."""
MAX_LAWS = 6
"""Laws drawn; of more a selection is drawn."""
MAX_VALUES = 5
"""Values of a swept parameter that are written; of more the first two and the last are."""
FAULT = {"color": style.VERMILLION, "linewidth": 4.0}
"""Look of an edge with a fault."""
ARC_PIECES = 64
"""Straight pieces that an arc is drawn as."""
MIN_DRAWN_TRIANGLE = 0.04
"""Width and height of triangles below which their sides would only darken the picture [inch]."""


@dataclass(frozen=True)
class SceneShape:
    """The coarsest mesh of a scene.

    segments: (k, 2, 2) of every named edge, the body on their left [m]
    region:   of every triangle, the number of its region in `regions` from 1 on, or 0
    lambda_1: of the mesh [Pa/m], None if it is not known
    sizes:    sizes of the mesh in words
    """

    segments: Mapping[str, Array]
    points: Array
    triangles: NDArray[np.intp]
    region: NDArray[np.intp]
    regions: tuple[str, ...]
    lambda_1: float | None
    sizes: str


EdgeLines = Mapping[str, list[Array]]
"""Lines (n, 2) by the name of their edge."""


@dataclass(frozen=True)
class Placement:
    """The place of a body on the sheet.

    low:    its lower left corner [m];  size: its width and height [m]
    scales: size of x and y on the sheet [inch/m]
    """

    low: Array
    size: Array
    scales: Array

    def inches(self, points: Array) -> Array:
        """Return points (n, 2) on the sheet [inch]."""
        return (points - self.low) * self.scales

    @property
    def words(self) -> str:
        """Note on a body that is drawn higher than it is, empty for others."""
        if self.scales[0] == self.scales[1]:
            return ""
        return f", drawn {number(self.scales[1] / self.scales[0], 2)} times as high as it is"


def _placement(points: Array) -> Placement:
    low, size = points.min(axis=0), np.ptp(points, axis=0)
    scale_x = min(MAX_WIDTH / size[0], MAX_HEIGHT / size[1])
    scale_y = SLENDER_HEIGHT / size[1] if size[0] > SLENDER * size[1] else scale_x
    return Placement(low, size, np.array([scale_x, scale_y]))


def scene_figure(study: Study, shape: SceneShape, look: style.Look) -> Figure:
    """Return the figure of a study."""
    scene, si = study.scenes[0], study.units == "SI"
    edges = {name: polylines(pieces) for name, pieces in shape.segments.items()}
    roles, values = dict(scene.boundary), dict(numbers(scene))
    laws = {section: laws_drawn(study, section) for section in LAW_PANELS}
    law_panels = [section for section, drawn in laws.items() if drawn]
    place = _placement(shape.points)
    labels = {}
    for name in edges:
        labels[name] = [name]
        if name in roles:
            labels[name] += role_words(name, roles[name], values, si)
    unit = "m" if si else "1"
    width, height = (with_unit(length, unit) for length in place.size)
    body = f"Body {width} × {height}{place.words};  {shape.sizes}"
    facts = [body, *scene_facts(study, values, shape.lambda_1)]
    margin = 0.3 + LINE * max(map(len, labels.values()))
    margin += ARROW * any(role.loaded for role in roles.values())
    sheet, axes = _sheet(look, study.title, facts, place, margin, law_panels)
    points = place.inches(shape.points)
    _draw_mesh(axes, points, shape.triangles, shape.region)
    placed = {name: [place.inches(line) for line in lines] for name, lines in edges.items()}
    covered = list[Array]()
    for name, lines in placed.items():
        covered += _draw_role(axes, lines, edges[name], roles.get(name))
    for section in law_panels:
        _draw_laws(sheet, section, laws[section], si, float(place.size[0]))
    sheet.key("scene")
    figure = sheet.finish()
    texts = _name_edges(axes, covered, placed, labels)
    _put_inside(texts, points, words(values, ("loads",), si))
    for index, name in enumerate(shape.regions, 1):
        facts = [name, *words(values, ("materials", name), si)]
        if name in scene.heat.omega:
            facts += words(values, ("heat", "q"), si)
        region_points = points[shape.triangles[shape.region == index]].reshape(-1, 2)
        _put_inside(texts, region_points, facts)
    return figure


def _put_inside(texts: Labels, points: Array, facts: Sequence[str]) -> None:
    """Write facts in the middle of points (n, 2), or around it."""
    if not facts:
        return
    middle = 0.5 * (points.min(axis=0) + points.max(axis=0))
    places = np.tile(middle, (1 + len(AROUND), 1))
    texts.put(_wrapped(facts), places, [(0, 0), *AROUND], (0.0, 18.0, 36.0, 72.0))


def faulty_figure(
    title: str, body: Body, faults: Mapping[str, str], facts: Sequence[str], look: style.Look
) -> Figure:
    """Return the outline of a study that cannot be run, with its faults by the name of the edge."""
    lines_of_edges: dict[str, list[Array]] = {}
    for edge in body.edges:
        pieces = 1 if edge.through is None else ARC_PIECES
        lines_of_edges.setdefault(edge.name, []).append(edge_points(edge, pieces))
    place = _placement(_joined(lines_of_edges))
    placed, labels = {}, {}
    for name, lines in lines_of_edges.items():
        placed[name] = [place.inches(line) for line in lines]
        labels[name] = [name, faults[name]] if name in faults else [name]
    fault_lines = _wrapped(list(faults.values())).split("\n")
    margin = 0.3 + LINE * (1 + len(fault_lines))
    sheet, axes = _sheet(look, title, facts, place, margin)
    for name, lines in placed.items():
        draw_edge(axes, lines, FAULT if name in faults else ROLES["free"], hatched=False)
    figure = sheet.finish()
    covered = [line for lines in placed.values() for line in lines]
    _name_edges(axes, covered, placed, labels, faults)
    return figure


def _joined(edges: EdgeLines) -> Array:
    return np.concatenate([line for lines in edges.values() for line in lines])


def _sheet(
    look: style.Look,
    title: str,
    facts: Sequence[str],
    place: Placement,
    margin: float,
    law_panels: Sequence[str] = (),
) -> tuple[Sheet, Axes]:
    """Return the sheet and the axes of the body, in inches; margin: above and below the body."""
    width, height = place.size * place.scales
    rows, heights = [["scene"]], [height + 2.0 * margin]
    for section in law_panels:
        rows.append([section])
        heights.append(1.5)
    sheet = Sheet(look, title, facts, rows, heights)
    axes = sheet.panels["scene"]
    axes.set(xlim=(-SIDE, width + SIDE), ylim=(-margin, height + margin), aspect="equal")
    axes.axis("off")
    return sheet, axes


def _name_edges(
    axes: Axes,
    covered: Sequence[Array],
    placed: EdgeLines,
    labels: Mapping[str, Sequence[str]],
    faults: Collection[str] = (),
) -> Labels:
    """Write labels beside edges, and return the labels for more texts."""
    texts = Labels(axes, covered, LETTERS)
    for name, lines in placed.items():
        colour = style.VERMILLION if name in faults else style.INK
        beside_line(texts, max(lines, key=length_of), _wrapped(labels[name]), color=colour)
    return texts


def _wrapped(facts: Sequence[str]) -> str:
    lines = []
    for fact in facts:
        lines += textwrap.wrap(fact, LABEL_COLUMNS, break_long_words=False)
    return "\n".join(lines)


def _draw_mesh(
    axes: Axes, points: Array, triangles: NDArray[np.intp], region: NDArray[np.intp]
) -> None:
    from matplotlib.colors import ListedColormap

    count = len(FILLS)
    look: dict[str, Any] = {"cmap": ListedColormap(FILLS), "vmin": -0.5, "vmax": count - 0.5}
    x, y = points.T
    axes.tripcolor(x, y, triangles, facecolors=region % count, **look)
    size = np.median(np.ptp(points[triangles], axis=1), axis=0)
    if float(size.min()) > MIN_DRAWN_TRIANGLE:
        axes.triplot(*points.T, triangles, color=style.INK, linewidth=0.4, alpha=0.25)


def _draw_role(
    axes: Axes, lines: list[Array], true_lines: list[Array], role: Role | None
) -> list[Array]:
    """Draw an edge with arrows of its loads and displacements, and return the places it covers.

    lines, true_lines: of the edge on the sheet [inch], and of the body [m]
    """
    word, line_look = _look_of(role)
    is_fixed = type(role) is Clamped and None not in role.u
    covered = draw_edge(axes, lines, line_look, is_fixed)
    for line in lines:
        covered.append(points_along(line, max(2, int(length_of(line) / 0.04)))[0])
    axes.plot([], [], label=word, **line_look)
    if role is None:
        return covered
    length = sum(map(length_of, lines))
    max_count = min(MAX_ARROWS, length / ARROW_DISTANCE)
    starts, directions, points = list[Array](), list[Array](), list[Array]()
    for line, true_line in zip(lines, true_lines, strict=True):
        count = max(1, round(max_count * length_of(line) / length))
        line_starts, line_directions = points_along(line, count)
        starts.append(line_starts)
        directions.append(line_directions)
        points.append(points_along(true_line, count)[0])
    along = np.concatenate(directions)
    normals = outside(along)
    gap = 0.07 + HATCH * is_fixed
    for push, colour in _pushes(role, np.concatenate(points), normals, along):
        covered += _draw_arrows(axes, push, np.concatenate(starts), normals, gap, colour)
    return covered


def _look_of(role: Role | None) -> tuple[str, dict[str, Any]]:
    """Return the words for a role in the key, and the look of its edges."""
    word = role.word if role is not None else "free"
    if not isinstance(role, Contact):
        return word, ROLES[word]
    words, along_normal = CONTACTS[role.normal]
    return words, ROLES[word] | along_normal


def _draw_arrows(
    axes: Axes, push: Array, starts: Array, normals: Array, gap: float, colour: str
) -> list[Array]:
    """Draw arrows (k, 2), or one for a resultant (2,), and return the places they cover.

    gap: distance of an arrow from its edge [inch]
    """
    arrows = ARROW * push / np.hypot(*push.T).max()
    width = 0.02
    if push.ndim == 1:
        # the arrow of a resultant stands in the middle of its edge
        arrows, starts = 1.5 * arrows[None], np.mean(starts, axis=0)[None]
        normals = normals[[len(normals) // 2]]
        width = 0.03
    length = np.hypot(*arrows.T)
    outward = np.sum(arrows * normals, axis=1) / np.maximum(length, 0.02)
    # arrows towards the body end at it, arrows away from it begin there, others stand beside it
    back = np.select([outward < -0.2, outward > 0.2], [1.0, 0.0], 0.5)
    is_long = length >= 0.02
    tails = (starts + gap * normals - back[:, None] * arrows)[is_long]
    arrows = arrows[is_long]
    look: dict[str, Any] = {"angles": "xy", "scale_units": "xy", "scale": 1.0, "units": "xy"}
    axes.quiver(*tails.T, *arrows.T, **look, width=width, color=colour)
    pairs = zip(tails, arrows, strict=True)
    return [np.linspace(tail, tail + arrow, 8) for tail, arrow in pairs]


def _pushes(role: Role, points: Array, normals: Array, along: Array) -> Iterator[tuple[Array, str]]:
    """Yield loads and displacements of an edge with their colours.

    They are (k, 2) at the points, or a resultant (2,).
    """

    def values_at(value: Scalar | None) -> Array:
        if value is None:
            return np.zeros(len(points))
        if isinstance(value, int | float):
            return np.full(len(points), float(value))
        return np.broadcast_to(value.evaluate(*points.T), len(points)).astype(float)

    load = role.traction(normals, values_at)
    first, second = map(values_at, role.u)
    displacement = np.column_stack([first, second])
    if role.frame == "nt":
        displacement = first[:, None] * normals + second[:, None] * along
    if np.any(load):
        yield load, style.VERMILLION
    if np.any(role.force):
        yield np.array(role.force), style.VERMILLION
    if np.any(displacement):
        yield displacement, style.BLUE


Values = Mapping[tuple[str, ...], Number]
"""Numbers of a scene by their key paths."""
WRITTEN_IF_ZERO = ("nu", "theta", "theta_bar")
"""Numbers that count where they are 0: an edge of prescribed θ = 0 is not an insulated one."""


def words(values: Values, path: tuple[str, ...], si: bool) -> list[str]:
    """Return the numbers with effect under a key path, such as "g_x = 3 MPa".

    β is left out where it follows from α_T.
    """
    facts = []
    for key, entry in values.items():
        if key[: len(path)] != path or entry.idle:
            continue
        if not (entry.value != 0.0 or key[-1] in WRITTEN_IF_ZERO):
            continue
        if key[-1] == "beta" and (*key[:-1], "alpha_T") in values:
            continue
        name = " ".join(map(symbol, key[len(path) :] or key[-1:]))
        facts.append(f"{name} = {_value(entry, si)}")
    return facts


def _value(entry: Number, si: bool) -> str:
    if not isinstance(entry.value, int | float):
        return shortened(str(entry.value), MAX_EXPRESSION_LETTERS)
    return with_unit(entry.value, entry.row.dimension.cf if si else "1")


def role_words(edge: str, role: Role, values: Values, si: bool) -> list[str]:
    """Return the boundary condition of an edge, with its values: "traction", "g_x = 3 MPa"."""
    word, _ = _look_of(role)
    facts = [word, *words(values, ("boundary", edge), si)]
    if type(role) is Clamped and role.word != "symmetry" and any(u != 0.0 for u in role.u):
        names = ("u_N", "u_T") if role.frame == "nt" else ("u_x", "u_y")
        facts += [f"{name} free" for name, u in zip(names, role.u, strict=True) if u is None]
    return facts


def scene_facts(study: Study, values: Values, lambda_1: float | None) -> Iterator[str]:
    """Yield material and heat, the laws' ω beside λ₁, and the parameters that vary."""
    scene, si = study.scenes[0], study.units == "SI"
    region = f" ({BODY})" if scene.material.regions else ""
    material = ", ".join([f"plane {scene.material.plane}", *words(values, ("material",), si)])
    # with heated regions, q stands in them
    heat_values = dict(values)
    if scene.heat.omega:
        heat_values.pop(("heat", "q"), None)
    heat = ", ".join(words(heat_values, ("heat",), si))
    yield ";  ".join(filter(None, [f"Material{region}: {material}", heat]))
    yield _softening(study, lambda_1)
    yield varied(study)


def _softening(study: Study, lambda_1: float | None) -> str:
    """Return the range of ω of the laws, and whether λ₁ of the mesh excludes several solutions."""
    if study.knows_pressure:
        return "Friction follows the pressure: no energy, several solutions may exist"
    unit = "Pa m-1" if study.units == "SI" else "1"
    scenes = distinct(study.scenes, "friction", "adhesion")
    omegas = [law.omega for scene in scenes for law in scene.laws]
    if study.opens:
        omegas = [_largest_omega(scene) for scene in scenes]
    least, most = min(omegas), max(omegas)
    ends = []
    for omega in (least, most):
        has_unit = np.isfinite(omega) and omega
        ends.append(with_unit(omega, unit) if has_unit else number(omega))
    fact = f"Maximum softening slope of the law ω = {' to '.join(dict.fromkeys(ends))}"
    if lambda_1 is None:
        return fact
    fact += f", stiffness λ₁ ≈ {with_unit(lambda_1, unit)} on this mesh: "
    if most < lambda_1:
        return fact + "one solution"
    if least >= lambda_1:
        return fact + "several solutions may exist"
    return fact + "one solution for laws with ω below it, several may exist for others"


def _largest_omega(scene: Scene) -> float:
    """Return the maximum softening slope of all laws of a scene, of slips and of openings."""
    of_openings = (law for _, law, _ in scene.opening_laws.laws)
    return max(law.omega for law in (*scene.laws, *of_openings))


def varied(study: Study) -> str:
    """Return the parameters that the sweep, path, history or fit of a study varies."""
    sweep = ""
    if study.axes:
        parameters = "; ".join(map(_axis_words, study.axes))
        sweep = f"Sweep: {counted(len(study.scenes), 'point')} of {parameters}"
    if study.fit is not None:
        names = [parameter.number.name for parameter in study.fit.parameters]
        return f"Fit: {', '.join(names)}"
    if study.history is not None:
        names = list(map(symbol, study.history.names))
        loads = f"History: {counted(study.history.steps, 'step')} of {', '.join(names)}"
        history = f"{loads}, memory {study.history.memory.words}"
        return ".  ".join(filter(None, [history, sweep]))
    if study.path is not None:
        begin = with_unit(study.path.begin, study.path.units)
        end = with_unit(study.path.end, study.path.units)
        return f"Path along {study.path.name} from {begin} to {end}"
    return sweep or "No sweep: one point"


def _axis_words(axis: Axis) -> str:
    """Return a swept parameter with its values; of many, the first two and the last."""
    name = symbol(axis.name) if len(axis.path) < 3 else ".".join(axis.path[1:])
    if axis.distribution:
        return f"{name} {axis.distribution}"
    texts, unit = scaled_labels(list(axis.labels), axis_attributes(axis))
    if len(texts) > MAX_VALUES:
        texts = [*texts[:2], "…", f"{texts[-1]} ({len(texts)})"]
    return f"{name} = {', '.join(texts)} {pretty(unit)}".rstrip()


LAW_PANELS = {"friction": ("slip s", "b(s)"), "adhesion": ("opening s_N", "b_N(s_N)")}
"""Sections of laws that are drawn, with the names of their axes."""


def laws_drawn(study: Study, section: str) -> list[tuple[str, Laws]]:
    """Return the laws of a section of LAW_PANELS, named by sweep, edge and differing parameters.

    Of more than MAX_LAWS laws a selection is returned; its names say how many there are.
    """
    axis = next((axis for axis in study.axes if axis.path == (section,)), None)
    of_edges = []
    for scene in distinct(study.scenes, section):
        section_laws = getattr(scene, section)
        if section_laws is not None:
            of_edges += [(edge, law) for edge, law, _ in edge_laws(section_laws)]
    has_labels = axis is not None and len(of_edges) == len(axis.labels)
    by_name = dict[str, Laws]()
    for index, (edge, law) in enumerate(of_edges):
        if axis is not None and has_labels:
            name = str(axis.labels[index])
        else:
            alike = []
            for other_edge, other in of_edges:
                if (other_edge, other.name) == (edge, law.name):
                    alike.append(other)
            differences = _differences(law, alike, study.units == "SI")
            name = " ".join(filter(None, [edge, law.name, ", ".join(differences)]))
        by_name.setdefault(name, law)
    laws = [(name, law) for name, law in by_name.items() if not law.vanishes]
    if len(laws) <= MAX_LAWS:
        return laws
    selection = np.unique(np.linspace(0, len(laws) - 1, MAX_LAWS).round().astype(int))
    title = f"{len(selection)} of {len(laws)} laws"
    return [(title, laws[index][1]) for index in selection]


def _differences(law: Laws, alike: Sequence[Laws], si: bool) -> list[str]:
    """Return the parameters of a law that differ among laws of the same name and edge."""
    if not law.made:
        return []
    rows = {row.name: row for row in law_rows(law.made.shape)}
    values_alike = [other.made.values for other in alike if other.made]
    differences = []
    for name, value in law.made.values.items():
        differs = any(values.get(name) != value for values in values_alike)
        if isinstance(value, float) and differs:
            differences.append(f"{symbol(name)} = {_value(Number(rows[name], value), si)}")
    return differences


def _draw_laws(
    sheet: Sheet, section: str, laws: Sequence[tuple[str, Laws]], si: bool, size: float
) -> None:
    slip_name, traction_name = LAW_PANELS[section]
    is_coefficient = section == "friction" and all(knows_pressure(law) for _, law in laws)
    if not is_coefficient:  # a coefficient has no place on an axis of tractions
        laws = [(name, law) for name, law in laws if not knows_pressure(law)]
    reach = max(slip_range(law) for _, law in laws) or 1e-3 * size
    values = [law.b(np.linspace(0.0, reach, 50)) for _, law in laws]
    traction_unit = "Pa" if si else "1"
    if is_coefficient:
        traction_name, traction_unit = "b(s) / pressure", "1"
    slip = scale(slip_name, [reach], "m" if si else "1")
    panel = Panel(slip, scale(traction_name, values, traction_unit))
    labelled = set[str]()
    for index, (name, law) in enumerate(laws):
        label = "" if name in labelled else name
        labelled.add(name)
        colour = style.SERIES[index % len(style.SERIES)]
        draw_law(panel, law, (-0.03 * reach, reach), label, color=colour)
    axes = sheet.panels[section]
    panel.draw(axes)
    axes.set_ylim(bottom=0.0)
    sheet.legend(section)
