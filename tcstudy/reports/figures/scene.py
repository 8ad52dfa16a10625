"""The scene of a study before any work: outline, edges with what they do, loads, materials, mesh,
law, sweep.

All is placed in inches of the sheet, so that letters and arrows know what is in their way; a body
more than SLENDER times as long as high is drawn higher than it is, and its facts say how much.
Drawn is the first point of the sweep.
"""

from __future__ import annotations

import textwrap
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from tcstudy.data.variables import axis_attributes
from tcstudy.errors import shortened
from tcstudy.laws.laws import Laws
from tcstudy.reports.figures import style
from tcstudy.reports.figures.body import (
    FILLS,
    HATCH,
    ROLES,
    beside_line,
    draw_edge,
    evenly,
    length_of,
    outside,
)
from tcstudy.reports.figures.panels import ROUND, Array, Labels, Panel, Sheet, scale
from tcstudy.reports.figures.point import draw_law, slip_range
from tcstudy.reports.picture import edge_laws, polylines
from tcstudy.reports.symbols import symbol
from tcstudy.reports.text import counted, number, pretty, scaled_labels, with_unit
from tcstudy.scene.keys import law_rows
from tcstudy.scene.parameters import Number, numbers
from tcstudy.scene.points import distinct
from tcstudy.scene.records import BODY, Body, Clamped, Role, Scalar
from tcstudy.scene.study import Axis, Study
from tcstudy.shapes.edges import edge_points

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

WIDTH, HIGHEST, LEAST, SIDE = 4.55, 3.4, 0.45, 1.35
"""Room of the body, its least height, and the margins beside it [inch]."""
SLENDER = 12.0
ARROW, APART = 0.34, 0.55
"""Length of an arrow, and how far apart arrows stand along an edge [inch]."""
LETTERS, LINE = 8.0, 0.15
"""Size of the letters [pt] and height of a line [inch]."""
WIDEST, LONGEST = 21, 24
"""Letters of a line of a label, and of an expression."""
MOST_LAWS, MOST_VALUES = 6, 5
FAULT, ARC_PIECES = {"color": style.VERMILLION, "linewidth": 4.0}, 64
FINE = 0.04
"""Width and height of triangles below which their sides would only darken the picture [inch]."""


@dataclass(frozen=True)
class SceneShape:
    """The coarsest mesh of a scene.

    segments: (k, 2, 2) of every named edge, the body on their left [m]
    points, triangles, region: the mesh, and which of `regions` each triangle is in, 0 for none
    lambda_1: of that mesh [Pa/m], None if it is not known;  sizes: in words
    """

    segments: Mapping[str, Array]
    points: Array
    triangles: NDArray[np.intp]
    region: NDArray[np.intp]
    regions: tuple[str, ...]
    lambda_1: float | None
    sizes: str


def scene_figure(study: Study, shape: SceneShape, look: style.Look) -> Figure:
    """The figure of a study."""
    scene, si, unit = study.scenes[0], study.units == "SI", "m" if study.units == "SI" else "1"
    edges = {name: polylines(pieces) for name, pieces in shape.segments.items()}
    low, size, scales = _scales(shape.points)
    roles, told, laws = dict(scene.boundary), dict(numbers(scene)), laws_drawn(study)
    labels = {
        name: [name, *(role_words(name, roles[name], told, si) if name in roles else ())]
        for name in edges
    }
    above = 0.3 + LINE * max(map(len, labels.values()))
    above += ARROW * any(role.loaded for role in roles.values())
    body = f"Body {with_unit(size[0], unit)} × {with_unit(size[1], unit)}"
    body += (
        f", drawn {number(scales[1] / scales[0], 2)} times as high as it is"
        if scales[0] != scales[1]
        else ""
    )
    facts = [f"{body};  {shape.sizes}", *scene_facts(study, told, shape.lambda_1)]
    sheet, axes = _sheet(look, study.title, facts, size * scales, above, bool(laws))
    points, triangles = (shape.points - low) * scales, shape.triangles
    _draw_mesh(axes, points, triangles, shape.region)
    placed, taken = (
        {name: [(line - low) * scales for line in lines] for name, lines in edges.items()},
        list[Array](),
    )
    for name, lines in placed.items():
        taken += _draw_role(axes, lines, edges[name], roles.get(name))
    if laws:
        _draw_laws(sheet, laws, si, float(size[0]))
    sheet.key("scene")
    figure, texts = sheet.finish(), _name_edges(axes, taken, placed, labels)
    inside = [(points, words(told, ("loads",), si))]
    for k, name in enumerate(shape.regions, 1):
        heat = words(told, ("heat", "q"), si) if name in scene.heat.omega else []
        own = points[triangles[shape.region == k]].reshape(-1, 2)
        inside.append((own, [name, *words(told, ("materials", name), si), *heat]))
    for own, said in (one for one in inside if one[1]):
        at = np.tile(0.5 * (own.min(axis=0) + own.max(axis=0)), (1 + len(ROUND), 1))
        texts.put(_wrapped(said), at, [(0, 0), *ROUND], (0.0, 18.0, 36.0, 72.0))
    return figure


def faulty_figure(
    title: str, body: Body, faults: Mapping[str, str], told: Sequence[str], look: style.Look
) -> Figure:
    """The outline of a study that cannot be run, with what is wrong; faults: by the name of the
    edge."""
    edges = [
        (edge.name, edge_points(edge, 1 if edge.through is None else ARC_PIECES))
        for edge in body.edges
    ]
    low, size, scales = _scales(np.concatenate([line for _, line in edges]))
    placed = {
        name: [(line - low) * scales for other, line in edges if other == name] for name, _ in edges
    }
    above = 0.3 + LINE * (1 + len(_wrapped([*faults.values()]).split("\n")))
    sheet, axes = _sheet(look, title, told, size * scales, above)
    for name, lines in placed.items():
        draw_edge(axes, lines, FAULT if name in faults else ROLES["free"], False)
    labels = {name: [name, *([faults[name]] if name in faults else [])] for name in placed}
    figure = sheet.finish()
    _name_edges(axes, [line for lines in placed.values() for line in lines], placed, labels, faults)
    return figure


def _scales(points: Array) -> tuple[Array, Array, Array]:
    """The lower left corner of the body and its size [m], and how large its x and y are drawn
    [inch/m]."""
    low, size = points.min(axis=0), np.ptp(points, axis=0)
    one = min(WIDTH / size[0], HIGHEST / size[1])
    return low, size, np.array([one, LEAST / size[1] if size[0] > SLENDER * size[1] else one])


def _sheet(
    look: style.Look, title: str, facts: Sequence[str], size: Array, above: float, law: bool = False
) -> tuple[Sheet, Axes]:
    rows, heights = [["scene"], ["law"]], [size[1] + 2.0 * above, 1.5]
    sheet = Sheet(look, title, facts, rows[: 1 + law], heights[: 1 + law])
    axes = sheet.panels["scene"]
    axes.set(xlim=(-SIDE, size[0] + SIDE), ylim=(-above, size[1] + above), aspect="equal")
    axes.axis("off")
    return sheet, axes


Of = Mapping[str, Any]
"""By the name of an edge."""


def _name_edges(
    axes: Axes, taken: Sequence[Array], placed: Of, labels: Of, faults: Of | None = None
) -> Labels:
    """Write labels beside edges; returns what places more."""
    texts = Labels(axes, taken, LETTERS)
    for name, lines in placed.items():
        colour = style.VERMILLION if name in (faults or {}) else style.INK
        beside_line(texts, max(lines, key=length_of), _wrapped(labels[name]), color=colour)
    return texts


def _wrapped(parts: Sequence[str]) -> str:
    return "\n".join(
        line for part in parts for line in textwrap.wrap(part, WIDEST, break_long_words=False)
    )


def _draw_mesh(
    axes: Axes, points: Array, triangles: NDArray[np.intp], region: NDArray[np.intp]
) -> None:
    from matplotlib.colors import ListedColormap

    how: dict[str, Any] = {"cmap": ListedColormap(FILLS), "vmin": -0.5, "vmax": len(FILLS) - 0.5}
    axes.tripcolor(points[:, 0], points[:, 1], triangles, facecolors=region % len(FILLS), **how)
    if float(np.median(np.ptp(points[triangles], axis=1), axis=0).min()) > FINE:
        axes.triplot(*points.T, triangles, color=style.INK, linewidth=0.4, alpha=0.25)


def _draw_role(axes: Axes, lines: list[Array], true: list[Array], role: Role | None) -> list[Array]:
    """An edge, as it is drawn and as it is [m], with arrows of what it carries or prescribes;
    returns places of all."""
    word, fixed = (
        role.word if role is not None else "free",
        type(role) is Clamped and None not in role.u,
    )
    taken = draw_edge(axes, lines, ROLES[word], fixed)
    taken += [evenly(one, max(2, int(length_of(one) / 0.04)))[0] for one in lines]
    axes.plot([], [], label=word, **ROLES[word])
    whole = sum(map(length_of, lines))
    counts = [max(1, round(min(9.0, whole / APART) * length_of(line) / whole)) for line in lines]
    starts, along = (np.concatenate(one) for one in zip(*map(evenly, lines, counts), strict=True))
    points, normals = (
        np.concatenate([evenly(*one)[0] for one in zip(true, counts, strict=True)]),
        outside(along),
    )
    for force, colour in _pushes(role, points, normals, along) if role is not None else ():
        ways, at, out, width = ARROW * force / np.hypot(*force.T).max(), starts, normals, 0.02
        if force.ndim == 1:  # one arrow for a resultant, in the middle of its edge
            ways, at, out, width = (
                1.5 * ways[None],
                np.mean(starts, axis=0)[None],
                normals[[len(normals) // 2]],
                0.03,
            )
        long = np.hypot(*ways.T)
        across = np.sum(ways * out, axis=1) / np.maximum(long, 0.02)
        back = np.select(
            [across < -0.2, across > 0.2], [1.0, 0.0], 0.5
        )  # outside: towards the body, away, beside it
        tails = (at + (0.07 + HATCH * fixed) * out - back[:, None] * ways)[long >= 0.02]
        ways = ways[long >= 0.02]
        axes.quiver(
            *tails.T,
            *ways.T,
            angles="xy",
            scale_units="xy",
            scale=1.0,
            units="xy",
            width=width,
            color=colour,
        )
        taken += [np.linspace(tail, tail + way, 8) for tail, way in zip(tails, ways, strict=True)]
    return taken


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


Told = Mapping[tuple[str, ...], Number]
"""Numbers of a scene by their key paths."""
ALSO_ZERO = ("nu", "theta", "theta_bar")
"""Numbers that count where they are 0: an edge held at θ = 0 is not an insulated one."""


def words(told: Told, path: tuple[str, ...], si: bool) -> list[str]:
    """Return the numbers with effect under a key path, such as "g_x = 3 MPa".

    β is left out where it follows from α_T.
    """
    facts = []
    for key, entry in told.items():
        if key[: len(path)] != path or entry.idle:
            continue
        if not (entry.value != 0.0 or key[-1] in ALSO_ZERO):
            continue
        if key[-1] == "beta" and (*key[:-1], "alpha_T") in told:
            continue
        name = " ".join(map(symbol, key[len(path) :] or key[-1:]))
        facts.append(f"{name} = {_value(entry, si)}")
    return facts


def _value(entry: Number, si: bool) -> str:
    if not isinstance(entry.value, int | float):
        return shortened(str(entry.value), LONGEST)
    return with_unit(entry.value, entry.row.dimension.cf if si else "1")


def role_words(edge: str, role: Role, told: Told, si: bool) -> list[str]:
    """Return the boundary condition of an edge, with its values: "traction", "g_x = 3 MPa"."""
    free = []
    if type(role) is Clamped and role.word != "symmetry" and any(u != 0.0 for u in role.u):
        names = ("u_N", "u_T") if role.frame == "nt" else ("u_x", "u_y")
        free = [f"{name} free" for name, u in zip(names, role.u, strict=True) if u is None]
    return [role.word, *words(told, ("boundary", edge), si), *free]


def scene_facts(study: Study, told: Told, lambda_1: float | None) -> Iterator[str]:
    """Yield material and heat, the laws' ω beside λ₁, and the parameters that vary."""
    scene, si = study.scenes[0], study.units == "SI"
    region = f" ({BODY})" if scene.material.regions else ""
    material = ", ".join([f"plane {scene.material.plane}", *words(told, ("material",), si)])
    # with heated regions, q stands in them
    heat_numbers = dict(told)
    if scene.heat.omega:
        heat_numbers.pop(("heat", "q"), None)
    heat = ", ".join(words(heat_numbers, ("heat",), si))
    yield ";  ".join(filter(None, [f"Material{region}: {material}", heat]))
    yield _softening(study, lambda_1)
    yield varied(study)


def _softening(study: Study, lambda_1: float | None) -> str:
    """Return the range of ω of the laws, and whether λ₁ of the mesh excludes several solutions."""
    unit = "Pa m-1" if study.units == "SI" else "1"
    scenes = distinct(study.scenes, "friction")
    omegas = [law.omega for scene in scenes for law in scene.laws]
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
    if len(texts) > MOST_VALUES:
        texts = [*texts[:2], "…", f"{texts[-1]} ({len(texts)})"]
    return f"{name} = {', '.join(texts)} {pretty(unit)}".rstrip()


def laws_drawn(study: Study) -> list[tuple[str, Laws]]:
    """Return the laws of a study, named by sweep, edge and parameters that differ.

    Of more than MOST_LAWS laws a selection is returned; its names say how many there are.
    """
    axis = next((axis for axis in study.axes if axis.path == ("friction",)), None)
    of_edges = []
    for scene in distinct(study.scenes, "friction"):
        of_edges += [(edge, law) for edge, law, _ in edge_laws(scene.friction)]
    has_labels = axis is not None and len(of_edges) == len(axis.labels)
    by_name = dict[str, Laws]()
    for index, (edge, law) in enumerate(of_edges):
        if axis is not None and has_labels:
            name = str(axis.labels[index])
        else:
            alike = [other for at, other in of_edges if (at, other.name) == (edge, law.name)]
            differences = _differences(law, alike, study.units == "SI")
            name = " ".join(filter(None, [edge, law.name, ", ".join(differences)]))
        by_name.setdefault(name, law)
    laws = [(name, law) for name, law in by_name.items() if not law.vanishes]
    if len(laws) <= MOST_LAWS:
        return laws
    selection = np.unique(np.linspace(0, len(laws) - 1, MOST_LAWS).round().astype(int))
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


def _draw_laws(sheet: Sheet, laws: Sequence[tuple[str, Laws]], si: bool, size: float) -> None:
    reach = max(slip_range(law) for _, law in laws) or 1e-3 * size
    values = [law.b(np.linspace(0.0, reach, 50)) for _, law in laws]
    slip = scale("slip s", [reach], "m" if si else "1")
    panel = Panel(slip, scale("b(s)", values, "Pa" if si else "1"))
    labelled = set[str]()
    for index, (name, law) in enumerate(laws):
        label = "" if name in labelled else name
        labelled.add(name)
        colour = style.SERIES[index % len(style.SERIES)]
        draw_law(panel, law, (-0.03 * reach, reach), label, color=colour)
    panel.draw(sheet.panels["law"])
    sheet.panels["law"].set_ylim(bottom=0.0)
    sheet.legend("law")
