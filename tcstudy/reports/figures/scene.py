"""The scene of a study before any work: outline, edges with what they do, loads, materials, mesh, law, sweep.

All is placed in inches of the sheet, so that letters and arrows know what is in their way; a body more than SLENDER
times as long as high is drawn higher than it is, and its facts say how much. Drawn is the first point of the sweep.
"""

from __future__ import annotations

import math
import textwrap
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from tcstudy.errors import shortened
from tcstudy.laws.composed import EdgeLaws
from tcstudy.laws.laws import Laws
from tcstudy.reports.figures import style
from tcstudy.reports.figures.body import FILLS, HATCH, ROLES, chained, directions, draw_edge, evenly
from tcstudy.reports.figures.panels import Array, Panel, Sheet, scale
from tcstudy.reports.figures.point import draw_law, slip_range
from tcstudy.reports.text import counted, number, pretty, scaled_labels, with_unit
from tcstudy.scene.keys import law_rows, symbol
from tcstudy.scene.parameters import Number, numbers
from tcstudy.scene.points import distinct
from tcstudy.scene.records import BODY, Clamped, Role, Scalar
from tcstudy.scene.study import Study

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

WIDTH, HIGHEST, LEAST, SIDE = 4.55, 3.4, 0.45, 1.35
"""Room of the body, its least height, and the margins beside it [inch]."""
SLENDER = 12.0
ARROW, APART = 0.34, 0.55
"""Length of an arrow, and how far apart arrows stand along an edge [inch]."""
LETTERS, LETTER, LINE = 8.0, 0.066, 0.15
"""Size of the letters [pt], width of one and height of a line [inch]."""
WIDEST, LONGEST = 21, 24
"""Letters of a line of a label, and of an expression."""
MOST_LAWS, MOST_VALUES = 6, 5
FINE = 0.04
"""Width and height of triangles below which their sides would only darken the picture [inch]."""


@dataclass(frozen=True)
class SceneShape:
    """The shape of a scene as far as it is known.

    segments: (k, 2, 2) of every named edge, the body on their left [m]
    mesh:     points, triangles and which of `regions` each is in, 0 for none, of the coarsest mesh, if there is one
    lambda_1: of that mesh [Pa/m], None if it is not known;  facts: what there is to say of mesh and sizes
    faults:   what is wrong with an edge, or with the whole
    """

    segments: Mapping[str, Array]
    mesh: tuple[Array, NDArray[np.intp], NDArray[np.intp]] | None = None
    regions: tuple[str, ...] = ()
    lambda_1: float | None = None
    facts: tuple[str, ...] = ()
    faults: Mapping[str, str] = field(default_factory=dict)


def scene_figure(title: str, study: Study | None, shape: SceneShape, look: style.Look) -> Figure:
    """The figure; of a study with faults, which is None, the outline with those that are of its edges."""
    scene, si = study and study.scenes[0], study is None or study.units == "SI"
    segments = {name: chained(pieces) for name, pieces in shape.segments.items()}
    ends = np.concatenate(list(segments.values())).reshape(-1, 2)
    low, size = ends.min(axis=0), np.ptp(ends, axis=0)
    one, slender = min(WIDTH / size[0], HIGHEST / size[1]), size[0] > SLENDER * size[1]
    scales = np.array([one, LEAST / size[1] if slender else one])
    roles, told = (dict(scene.boundary), dict(numbers(scene))) if scene else ({}, {})
    labels = {
        name: [name, *(role_words(name, roles[name], told, si) if name in roles else ())]
        + ([shape.faults[name]] if name in shape.faults else [])
        for name in segments
    }
    # what belongs to an edge that lies rather than stands goes above or below the body
    lying = [name for name, s in segments.items() if np.any(np.abs(s[:, 1] - s[:, 0]) @ [1.0, -1.0] >= 0.0)]
    above = 0.3 + LINE * max((len(labels[name]) for name in lying), default=5)
    pushed = (roles[name] for name in lying if name in roles)
    above += ARROW * any(any((*role.g, role.pressure, *role.force)) for role in pushed)
    unit = "m" if si else "1"
    body = f"Body {with_unit(size[0], unit)} × {with_unit(size[1], unit)}"
    body += f", drawn {number(scales[1] / scales[0], 2)} times as high as it is" if slender else ""
    facts, laws = [";  ".join([body, *shape.facts])], laws_drawn(study) if study is not None else {}
    facts += scene_facts(study, told, shape.lambda_1) if study is not None else []
    width, height = size * scales + [2 * SIDE, 2 * above]
    rows, heights = [["scene"], *([["law"]] if laws else [])], [height, *([1.5] if laws else [])]
    sheet = Sheet(look, title, facts, rows, heights)
    axes = sheet.panels["scene"]
    axes.set(xlim=(-SIDE, width - SIDE), ylim=(-above, height - above), aspect="equal")
    axes.axis("off")
    placed = {name: (pieces - low) * scales for name, pieces in segments.items()}
    taken = [evenly(ends, max(2, int(directions(ends)[0].sum() / 0.04)))[0] for ends in placed.values()]
    drawing = _Drawing(axes, taken)
    if shape.mesh is not None:
        points, triangles, region = (shape.mesh[0] - low) * scales, *shape.mesh[1:]
        drawing.mesh(points, triangles, region)
    for name, pieces in placed.items():
        drawing.edge(pieces, roles.get(name), segments[name], name in shape.faults)
    for name, pieces in placed.items():
        drawing.label(pieces, labels[name], style.VERMILLION if name in shape.faults else style.INK)
    if scene and shape.mesh is not None:
        for k, name in enumerate(shape.regions, 1):
            lines = [name, *words(told, ("materials", name), si)]
            lines += words(told, ("heat", "q"), si) if name in scene.heat.omega else []
            drawing.text(points[triangles[region == k]].reshape(-1, 2), lines)
        if force := words(told, ("loads",), si):
            drawing.text(points, force)
    if laws:
        _draw_laws(sheet, laws, si, float(size[0]))
    sheet.key("scene")
    return sheet.finish()


@dataclass
class _Drawing:
    """The panel of the scene; taken: (k, 2) places that labels must leave free."""

    axes: Axes
    taken: list[Array]

    def mesh(self, points: Array, triangles: NDArray[np.intp], region: NDArray[np.intp]) -> None:
        """Regions in their colours, and sides of triangles that are not too small."""
        from matplotlib.collections import PolyCollection

        for k in np.unique(region):
            colour = FILLS[int(k) % len(FILLS)]
            corners = list(points[triangles[region == k]])
            self.axes.add_collection(PolyCollection(corners, facecolor=colour, edgecolor=colour, linewidth=0.3))
        if float(np.median(np.ptp(points[triangles], axis=1), axis=0).min()) > FINE:
            self.axes.triplot(*points.T, triangles, color=style.INK, linewidth=0.4, alpha=0.25)

    def edge(self, ends: Array, role: Role | None, segments: Array, wrong: bool) -> None:
        """An edge and the arrows of what it carries or prescribes; segments: its pieces [m]."""
        word = role.word if role is not None else "free"
        how: dict[str, Any] = {"color": style.VERMILLION, "linewidth": 4.0} if wrong else ROLES[word]
        fixed = type(role) is Clamped and None not in role.u
        self.taken.append(draw_edge(self.axes, ends, how, fixed))
        self.axes.plot([], [], label="fault" if wrong else word if role is not None else "edge", **how)
        lengths, along, normals = directions(ends)
        starts, of = evenly(ends, max(1, min(9, int(lengths.sum() / APART))))
        for force, colour in _pushes(role, segments.mean(axis=1), normals, along) if role is not None else ():
            size = float(np.max(np.hypot(*force.T)))
            if force.ndim == 1:  # one arrow for a resultant, in the middle of its edge
                middle = ends.reshape(-1, 2).mean(axis=0)
                self._arrow(middle, ARROW * 1.5 * force / size, normals[len(normals) // 2], colour, 2.2)
                continue
            for at, i in zip(starts, of, strict=True):
                self._arrow(at + HATCH * fixed * normals[i], ARROW * force[i] / size, normals[i], colour)

    def _arrow(self, at: Array, way: Array, normal: Array, colour: str, width: float = 1.1) -> None:
        """An arrow outside the body: away from it, towards it, or beside it."""
        if np.hypot(*way) < 0.02:
            return
        across = float(way @ normal) / float(np.hypot(*way))
        start = at + 0.07 * normal - way * (1.0 if across < -0.2 else 0.0 if across > 0.2 else 0.5)
        shape = {"arrowstyle": "-|>", "mutation_scale": 8, "shrinkA": 0, "shrinkB": 0, "color": colour}
        self.axes.annotate("", tuple(start + way), tuple(start), arrowprops=shape | {"linewidth": width}, zorder=5)
        self.taken.append(np.linspace(start, start + way, 8))

    def label(self, ends: Array, lines: Sequence[str], colour: str) -> None:
        """Lines outside their edge where nothing is in the way, or else inside."""
        limits = np.array([self.axes.get_xlim(), self.axes.get_ylim()])
        lengths, _, normals = directions(ends)
        share, places = np.cumsum(lengths) / lengths.sum(), []
        for apart in (0.1, 0.19, 0.28, 0.46, 0.64, -0.1, -0.4):
            for part in (0.5, 0.35, 0.65, 0.2, 0.8):
                i = int(np.searchsorted(share, part))
                at = ends[i].mean(axis=0) if len(ends) > 1 else ends[0, 0] + part * (ends[0, 1] - ends[0, 0])
                places.append((at, math.copysign(1.0, apart) * normals[i], abs(apart)))
        self._write(
            lines,
            lambda half: [
                (np.clip(at + way * (apart + np.abs(way) @ half), limits[:, 0] + half, limits[:, 1] - half), at)
                for at, way, apart in places
            ],
            colour,
        )

    def text(self, points: Array, lines: Sequence[str]) -> None:
        """Lines over the middle of points, moved up or down until they are free."""
        middle = 0.5 * (points.min(axis=0) + points.max(axis=0))
        moved = [
            middle + np.array([dx, dy]) for dy in (0.0, 0.25, -0.25, 0.5, -0.5) for dx in (0.0, 1.0, -1.0, 2.0, -2.0)
        ]
        places = [(centre, points[np.argmin(np.hypot(*(points - centre).T))]) for centre in moved]
        self._write(lines, lambda _: places, style.INK)

    def _write(self, parts: Sequence[str], places: Callable[[Array], list[tuple[Array, Array]]], colour: str) -> None:
        """Wrapped lines at the first centre where the least is in the way, with a line to what is far.

        places: (centre, what it belongs to) for half the width and height of the text
        """
        lines = [line for part in parts for line in textwrap.wrap(part, WIDEST, break_long_words=False)]
        half, taken = 0.5 * np.array([LETTER * max(map(len, lines)), LINE * len(lines)]), np.concatenate(self.taken)
        found = places(half)
        hits = [np.count_nonzero(np.all(np.abs(taken - centre) < half + 0.04, axis=1)) for centre, _ in found]
        centre, at = found[int(np.argmin(hits))]
        if np.any(np.abs(at - centre) > half + 0.2):
            line = np.array([at, np.clip(at, centre - half, centre + half)])
            self.axes.plot(*line.T, color=style.PALE, linewidth=0.6)
        box = {"facecolor": "white", "alpha": 0.75, "edgecolor": "none", "pad": 0.6}
        how: dict[str, Any] = {"ha": "center", "va": "center", "bbox": box, "linespacing": 1.15, "in_layout": False}
        how |= {"parse_math": False, "fontsize": style.pt(LETTERS), "zorder": 6, "color": colour}
        self.axes.text(float(centre[0]), float(centre[1]), "\n".join(lines), **how)
        grid = np.stack(np.meshgrid(*(np.linspace(-1, 1, max(2, int(n / 0.05))) for n in 2 * half)), axis=-1)
        self.taken.append(centre + grid.reshape(-1, 2) * half)


def _pushes(role: Role, points: Array, normals: Array, along: Array) -> Iterator[tuple[Array, str]]:
    """(forces or displacements (k, 2) at the points, or a resultant (2,); colour) of what an edge has or moves by."""

    def at(value: Scalar | None) -> Array:
        if not isinstance(value, int | float | None):
            return np.broadcast_to(value.evaluate(*points.T), len(points)).astype(float)
        return np.full(len(points), 0.0 if value is None else float(value))

    load = np.column_stack([at(one) for one in role.g]) - at(role.pressure)[:, None] * normals
    first, second = map(at, role.u)
    moved = np.column_stack([first, second])
    if role.frame == "nt":
        moved = first[:, None] * normals + second[:, None] * along
    pushes = (load, style.VERMILLION), (np.array(role.force), style.VERMILLION), (moved, style.BLUE)
    yield from (one for one in pushes if np.any(one[0]))


Told = Mapping[tuple[str, ...], Number]
ALSO_ZERO = ("nu", "theta", "theta_bar")
"""Numbers that say something where they are 0: an edge held at θ = 0 is not an insulated one."""


def words(told: Told, path: tuple[str, ...], si: bool) -> list[str]:
    """The numbers under a key path that say something, "g_x = 3 MPa"; β where it does not follow from α_T."""
    return [
        f"{' '.join(map(symbol, key[len(path) :] or key[-1:]))} = {_value(one, si)}"
        for key, one in told.items()
        if key[: len(path)] == path and not one.idle and (one.value != 0.0 or key[-1] in ALSO_ZERO)
        if not (key[-1] == "beta" and (*key[:-1], "alpha_T") in told)
    ]


def _value(one: Number, si: bool) -> str:
    if not isinstance(one.value, int | float):
        return shortened(str(one.value), LONGEST)
    return with_unit(one.value, one.row.dimension.cf if si else "1")


def role_words(edge: str, role: Role, told: Told, si: bool) -> list[str]:
    """What an edge does, with its values: "traction", "g_x = 3 MPa"."""
    names = ("u_N", "u_T") if role.frame == "nt" else ("u_x", "u_y")
    held = type(role) is Clamped and role.word != "symmetry" and any(one != 0.0 for one in role.u)
    free = [f"{name} free" for name, u in zip(names, role.u, strict=True) if held and u is None]
    return [role.word, *words(told, ("boundary", edge), si), *free]


def scene_facts(study: Study, told: Told, lambda_1: float | None) -> Iterator[str]:
    """Material and heat, the laws' ω beside λ₁, and what the study varies."""
    scene, si = study.scenes[0], study.units == "SI"
    rest = f" ({BODY})" if scene.material.regions else ""
    material = ", ".join([f"plane {scene.material.plane}", *words(told, ("material",), si)])
    whole = {key: one for key, one in told.items() if key != ("heat", "q") or not scene.heat.omega}
    yield ";  ".join(filter(None, [f"Material{rest}: {material}", ", ".join(words(whole, ("heat",), si))]))
    unit = "Pa m-1" if si else "1"
    omegas = [law.omega for one in distinct(study.scenes, "friction") for law in one.laws]
    least, most = min(omegas), max(omegas)
    ends = dict.fromkeys(with_unit(x, unit) if np.isfinite(x) and x else number(x) for x in (least, most))
    fall = f"Steepest fall of the law ω = {' to '.join(ends)}"
    if lambda_1 is not None:
        fall += f", stiffness λ₁ ≈ {with_unit(lambda_1, unit)} on this mesh: " + (
            "one solution" if most < lambda_1 else "several solutions may exist" if least >= lambda_1 else
            "one solution for laws with ω below it, several may exist for others")  # fmt: skip
    yield fall
    yield varied(study)


def varied(study: Study) -> str:
    """What the sweep, path, history or fit of a study varies."""
    found = []
    for axis in study.axes:
        own = {"study_unit": axis.written[0], "study_unit_size": axis.written[1]} if axis.written[0] else {}
        texts, unit = scaled_labels(list(axis.labels), {"units": axis.units, **own})
        few = texts if len(texts) <= MOST_VALUES else [*texts[:2], "…", texts[-1]]
        if axis.distribution:
            found.append(f"{symbol(axis.name)} {axis.distribution}")
            continue
        name = symbol(axis.name) if len(axis.path) < 3 else ".".join(axis.path[1:])
        found.append(f"{name} = {', '.join(few)}{f' {pretty(unit)}' if unit != '1' else ''}"
                     f"{f' ({len(texts)})' if len(few) < len(texts) else ''}")  # fmt: skip
    swept = f"Sweep: {counted(len(study.scenes), 'point')} of {'; '.join(found)}" if found else ""
    if study.fit is not None:
        return f"Fit: {', '.join(one.number.name for one in study.fit.parameters)}"
    if study.history is not None:
        loads = f"History: {counted(study.history.steps, 'step')} of {', '.join(map(symbol, study.history.names))}"
        return ".  ".join(filter(None, [f"{loads}, memory {study.history.memory.words}", swept]))
    if study.path is not None:
        ends = (with_unit(x, study.path.units) for x in (study.path.begin, study.path.end))
        return f"Path along {study.path.name} from {' to '.join(ends)}"
    return swept or "No sweep: one point"


def laws_drawn(study: Study) -> dict[str, Laws]:
    """Laws of a study by the name that its sweep or its edges give them, or by what differs; of many some."""
    axis = next((axis for axis in study.axes if axis.path == ("friction",)), None)
    scenes, found = distinct(study.scenes, "friction"), dict[str, Laws]()
    every = [law for scene in scenes for law in scene.laws]
    edges = [edge for edge, _, _ in scenes[0].friction.laws] if isinstance(scenes[0].friction, EdgeLaws) else [""]
    if len(every) > MOST_LAWS:
        some = [every[k] for k in np.unique(np.linspace(0, len(every) - 1, MOST_LAWS).round().astype(int))]
        name = f"{len(some)} of {len(every)} laws"  # the first one has it
        return {f"{name}{' ' * k}": law for k, law in enumerate(some) if not law.vanishes}
    for k, law in enumerate(every):
        same = [one.made.values for one in every if one.name == law.name and one.made]
        rows = {one.name: one for one in law_rows(law.made.shape)} if law.made else {}
        differ = [
            f"{symbol(key)} = {_value(Number(rows[key], value), study.units == 'SI')}"
            for key, value in (law.made.values if law.made else {}).items()
            if isinstance(value, float) and key in rows and any(other.get(key) != value for other in same)
        ]
        name = " ".join(filter(None, [edges[k % len(edges)], law.name, ", ".join(differ)]))
        if axis is not None and len(every) == len(axis.labels):
            name = str(axis.labels[k])
        if not law.vanishes:
            found.setdefault(name, law)
    return found


def _draw_laws(sheet: Sheet, laws: Mapping[str, Laws], si: bool, size: float) -> None:
    reach = max(map(slip_range, laws.values())) or 1e-3 * size
    values = [law.b(np.linspace(0.0, reach, 50)) for law in laws.values()]
    slip, friction = scale("slip $s$", [reach], "m" if si else "1"), scale("$b(s)$", values, "Pa" if si else "1")
    panel = Panel(slip, friction)
    for k, (name, law) in enumerate(laws.items()):
        shown = name if name == name.strip() else ""  # of many laws the first one has the name
        draw_law(panel, law, (-0.03 * reach, reach), shown, color=style.SERIES[k % len(style.SERIES)])
    panel.draw(sheet.panels["law"])
    sheet.panels["law"].set_ylim(bottom=0.0)
    columns = max(1, int(100 / (8 + max(map(len, laws)))))
    where: dict[str, Any] = {"loc": "lower left", "bbox_to_anchor": (0.0, 1.0), "ncols": columns}
    sheet.panels["law"].legend(frameon=False, fontsize=style.pt(LETTERS), borderaxespad=0.0, **where)
