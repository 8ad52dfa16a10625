"""The scene of a study before any work: outline, edges with what they do, loads, materials, mesh, law, sweep.

All is placed in inches of the sheet, so that letters and arrows know what is in their way; a body more than SLENDER
times as long as high is drawn higher than it is, and its facts say how much. Drawn is the first point of the sweep.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from tcstudy.errors import shortened
from tcstudy.laws.composed import EdgeLaws
from tcstudy.laws.laws import Laws
from tcstudy.laws.shapes import SHAPES
from tcstudy.reports.figures import style
from tcstudy.reports.figures.edges import FILLS, HATCH, ROLES, chained, directions, draw_edge, evenly
from tcstudy.reports.figures.law import draw_law, slip_range
from tcstudy.reports.figures.panels import Array, Panel, scale
from tcstudy.reports.figures.sheet import Sheet
from tcstudy.reports.text import counted, number, pretty, scaled_labels, with_unit
from tcstudy.scene.keys import symbol
from tcstudy.scene.points import distinct
from tcstudy.scene.records import BODY, Clamped, EdgeHeat, Material, Role, Scalar, Scene
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
    points, triangles: of the coarsest mesh, None where there is none;  region: (t,) which of `regions`, 0 for none
    lambda_1: of that mesh [Pa/m], None if it is not known;  facts: what there is to say of mesh and sizes
    faults:   what is wrong with an edge, or with the whole
    """

    segments: Mapping[str, Array]
    points: Array | None = None
    triangles: NDArray[np.intp] | None = None
    region: NDArray[np.intp] | None = None
    regions: tuple[str, ...] = ()
    lambda_1: float | None = None
    facts: tuple[str, ...] = ()
    faults: Mapping[str, str] = field(default_factory=dict)


def scene_figure(title: str, study: Study | None, shape: SceneShape, look: style.Look) -> Figure:
    """The figure; of a study with faults, which is None, the outline with those that are of its edges."""
    shape = replace(shape, segments={name: chained(segments) for name, segments in shape.segments.items()})
    ends = np.concatenate(list(shape.segments.values())).reshape(-1, 2)
    low, size = ends.min(axis=0), np.ptp(ends, axis=0)
    one = WIDTH / size[0] if size[0] >= size[1] * WIDTH / HIGHEST else HIGHEST / size[1]
    slender = size[0] > SLENDER * size[1]
    scales = np.array([one, LEAST / size[1] if slender else one])
    roles = study.scenes[0].boundary if study is not None else ()
    roles = tuple((name, role) for name, role in roles if _lies(shape.segments.get(name)))
    above = 0.3 + LINE * max((1 + len([*role_words(role, True)]) for _, role in roles), default=4)
    above += ARROW * any(any((*role.g, role.pressure, *role.force)) for _, role in roles)
    place = lambda points: (np.asarray(points) - low) * scales  # noqa: E731
    units = "1" if study is not None and study.units == "none" else "m"
    facts = [f"Body {with_unit(size[0], units)} × {with_unit(size[1], units)}"]
    facts[0] += f", drawn {number(scales[1] / scales[0], 2)} times as high as it is" if slender else ""
    facts[0] = ";  ".join([facts[0], *shape.facts])
    laws = laws_drawn(study) if study is not None else {}
    facts += [*scene_facts(study, shape.lambda_1)] if study is not None else []
    width, height = size * scales + [2 * SIDE, 2 * above]
    rows, heights = [["scene"], *([["law"]] if laws else [])], [height, *([1.5] if laws else [])]
    sheet = Sheet(look, title, facts, rows, heights)
    axes = sheet.panels["scene"]
    axes.set(xlim=(-SIDE, width - SIDE), ylim=(-above, height - above), aspect="equal")
    axes.axis("off")
    scene = study.scenes[0] if study is not None else None
    _Drawing(axes, place, shape, scene, units == "m").draw()
    if laws:
        _draw_laws(sheet, laws, units == "m", float(size[0]))
    sheet.key("scene")
    return sheet.finish()


@dataclass
class _Drawing:
    """The panel of the scene. place: coordinates [m] → [inch];  taken: (k, 2) places that labels must leave free"""

    axes: Axes
    place: Any
    shape: SceneShape
    scene: Scene | None
    si: bool
    taken: list[Array] = field(default_factory=list)

    def draw(self) -> None:
        """Everything, labels last."""
        from matplotlib.collections import PolyCollection

        axes, shape = self.axes, self.shape
        if shape.points is not None and shape.triangles is not None and shape.region is not None:
            x, y = self.place(shape.points).T
            for k in np.unique(shape.region):
                corners = np.column_stack([x, y])[shape.triangles[shape.region == k]]
                colour = FILLS[int(k) % len(FILLS)]
                axes.add_collection(PolyCollection(list(corners), facecolor=colour, edgecolor=colour, linewidth=0.3))
            sides = np.ptp(self.place(shape.points[shape.triangles]), axis=1)
            if float(np.median(sides, axis=0).min()) > FINE:
                axes.triplot(x, y, shape.triangles, color=style.INK, linewidth=0.4, alpha=0.25)
        edges = {name: self.place(segments) for name, segments in shape.segments.items()}
        self.taken += [evenly(ends, max(2, int(directions(ends)[0].sum() / 0.04)))[0] for ends in edges.values()]
        roles = dict(self.scene.boundary) if self.scene is not None else {}
        for name, ends in edges.items():
            self._edge(name, ends, roles.get(name))
        for name, ends in edges.items():
            text = [name, *role_words(roles[name], self.si)] if name in roles else [name]
            wrong = shape.faults.get(name, "")
            self._label(ends, "\n".join(_lines([*text, *([wrong] if wrong else [])])), wrong != "")
        self._inside()

    def _edge(self, name: str, ends: Array, role: Role | None) -> None:
        """The edge and the arrows of what it carries or prescribes."""
        wrong, word = name in self.shape.faults, role.word if role is not None else "free"
        how: dict[str, Any] = {"color": style.VERMILLION, "linewidth": 4.0} if wrong else ROLES[word]
        fixed = type(role) is Clamped and None not in role.u
        self.taken.append(draw_edge(self.axes, ends, how, fixed))
        self.axes.plot([], [], label="fault" if wrong else word if role is not None else "edge", **how)
        if role is None:
            return
        lengths, along, normals = directions(ends)
        starts, of = evenly(ends, max(1, min(9, int(lengths.sum() / APART))))
        for force, colour in _pushes(role, self.shape.segments[name].mean(axis=1), normals, along):
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
        start = at + 0.07 * normal
        start = start - way if across < -0.2 else start if across > 0.2 else start - 0.5 * way
        end = start + way
        shape = {"arrowstyle": "-|>", "mutation_scale": 8, "shrinkA": 0, "shrinkB": 0, "color": colour}
        self.axes.annotate("", tuple(end), tuple(start), arrowprops=shape | {"linewidth": width}, zorder=5)
        self.taken.append(np.linspace(start, end, 8))

    def _label(self, ends: Array, text: str, wrong: bool) -> None:
        """A text outside its edge where nothing is in the way, or else inside."""
        half, limits = _half(text), np.array([self.axes.get_xlim(), self.axes.get_ylim()])
        lengths, _, normals = directions(ends)
        share, places = np.cumsum(lengths) / lengths.sum(), []
        for apart in (0.1, 0.19, 0.28, 0.46, 0.64, -0.1, -0.4):
            for part in (0.5, 0.35, 0.65, 0.2, 0.8):
                i = int(np.searchsorted(share, part))
                at = ends[i].mean(axis=0) if len(ends) > 1 else ends[0, 0] + part * (ends[0, 1] - ends[0, 0])
                way = math.copysign(1.0, apart) * normals[i]
                centre = at + way * (abs(apart) + float(np.abs(way) @ half))
                places.append((np.clip(centre, limits[:, 0] + half, limits[:, 1] - half), at))
        self._write(text, places, half, style.VERMILLION if wrong else style.INK)

    def _free(self, points: Array, text: str) -> None:
        """A text over the middle of points, moved up or down until it is free."""
        half, middle = _half(text), 0.5 * (points.min(axis=0) + points.max(axis=0))
        moves = [np.array([dx, dy]) for dy in (0.0, 0.25, -0.25, 0.5, -0.5) for dx in (0.0, 1.0, -1.0, 2.0, -2.0)]
        places = [(middle + move, points[np.argmin(np.hypot(*(points - middle - move).T))]) for move in moves]
        self._write(text, places, half, style.INK)

    def _write(self, text: str, places: Sequence[tuple[Array, Array]], half: Array, colour: str) -> None:
        """A text at the first centre where the least is in the way, with a line to what it belongs to if that is far.

        places: (centre, what it belongs to);  half: half its width and height
        """
        taken = np.concatenate(self.taken)
        hits = [np.count_nonzero(np.all(np.abs(taken - centre) < half + 0.04, axis=1)) for centre, _ in places]
        centre, at = places[int(np.argmin(hits))]
        if np.any(np.abs(at - centre) > half + 0.2):
            line = np.array([at, np.clip(at, centre - half, centre + half)])
            self.axes.plot(*line.T, color=style.PALE, linewidth=0.6)
        box = {"facecolor": "white", "alpha": 0.75, "edgecolor": "none", "pad": 0.6}
        how: dict[str, Any] = {"ha": "center", "va": "center", "bbox": box, "linespacing": 1.15, "in_layout": False}
        how |= {"parse_math": False, "fontsize": style.pt(LETTERS), "zorder": 6}
        self.axes.text(float(centre[0]), float(centre[1]), text, color=colour, **how)
        grid = np.stack(np.meshgrid(*(np.linspace(-1, 1, max(2, int(n / 0.05))) for n in 2 * half)), axis=-1)
        self.taken.append(centre + grid.reshape(-1, 2) * half)

    def _inside(self) -> None:
        """Body force, materials and heat sources of the regions, written on them."""
        shape, scene = self.shape, self.scene
        if scene is None or shape.points is None or shape.triangles is None or shape.region is None:
            return
        told = dict(scene.material.regions)
        for k, name in enumerate(shape.regions, 1):
            corners = shape.points[shape.triangles[shape.region == k]].reshape(-1, 2)
            lines = [name, *([material_words(told[name], self.si)] if name in told else [])]
            if name in scene.heat.omega and scene.heat.q:
                lines.append(f"q = {_value(scene.heat.q, 'W m-3', self.si)}")
            self._free(self.place(corners), "\n".join(_lines(lines)))
        if any(component != 0.0 for component in scene.f):
            values = ", ".join(_value(component, "N m-3", self.si) for component in scene.f)
            self._free(self.place(shape.points), "\n".join(_lines([f"f = ({values})"])))


def _half(text: str) -> Array:
    """Half the width and height of a text."""
    return 0.5 * np.array([LETTER * max(map(len, text.split("\n"))), LINE * (text.count("\n") + 1)])


def _lies(segments: Array | None) -> bool:
    """Whether a part of an edge lies rather than stands, so that what belongs to it goes above or below the body."""
    return segments is not None and bool(np.any(np.abs(segments[:, 1] - segments[:, 0]) @ [1.0, -1.0] >= 0.0))


def _lines(parts: Sequence[str]) -> Iterator[str]:
    """The parts, each wrapped."""
    import textwrap

    for part in parts:
        yield from textwrap.wrap(part, WIDEST, break_long_words=False)


def _pushes(role: Role, points: Array, normals: Array, along: Array) -> Iterator[tuple[Array, str]]:
    """(forces or displacements (k, 2) at the points, or a resultant (2,); colour) of what an edge has or moves by."""

    def at(value: Scalar | None) -> Array:
        if not isinstance(value, int | float | None):
            return np.broadcast_to(value.evaluate(*points.T), len(points)).astype(float)
        return np.full(len(points), 0.0 if value is None else float(value))

    load = np.column_stack([at(one) for one in role.g]) - at(role.pressure)[:, None] * normals
    if np.any(load):
        yield load, style.VERMILLION
    if any(role.force):
        yield np.array(role.force), style.VERMILLION
    first, second = map(at, role.u)
    moved = np.column_stack([first, second])
    if role.frame == "nt":
        moved = first[:, None] * normals + second[:, None] * along
    if np.any(moved):
        yield moved, style.BLUE


def _value(value: Scalar | None, units: str, si: bool) -> str:
    if value is None or value == 0.0:
        return "free" if value is None else "0"
    if not isinstance(value, int | float):
        return shortened(str(value), LONGEST)
    return with_unit(value, units if si else "1")


def role_words(role: Role, si: bool) -> Iterator[str]:
    """What an edge does, with its values: "traction", "g = (3 MPa, 0)"."""
    yield role.word
    names = ("u_N", "u_T") if role.frame == "nt" else ("u_x", "u_y")
    if isinstance(role, Clamped) and role.word != "symmetry" and any(one != 0.0 for one in role.u):
        yield from (
            f"{name} {'free' if u is None else '= ' + _value(u, 'm', si)}"
            for name, u in zip(names, role.u, strict=True)
        )
    heat, (k_N, k_T) = role.heat or EdgeHeat(), role.spring
    loads = (("g", role.g, "Pa"), ("pressure", [role.pressure], "Pa"), ("force", role.force, "N m-1"),
             ("moment", [role.moment or 0.0], "N"), ("k_N", [k_N], "Pa m-1"), ("k_T", [k_T], "Pa m-1"),
             ("flux", [heat.flux], "W m-2"))  # fmt: skip
    told = [one for one in loads if any(value != 0.0 for value in one[1])]
    films = (("θ", [heat.theta], "K"), ("α", [heat.alpha], "W m-2 K-1"), ("θ̄", [heat.theta_bar], "K"))
    for name, values, units in (*told, *(one for one in films if one[1] != [None])):
        texts = ", ".join(_value(value, units, si) for value in values)
        yield f"{name} = ({texts})" if len(values) > 1 else f"{name} = {texts}"


def material_words(material: Material, si: bool) -> str:
    """The numbers of a material."""
    found = [f"E = {_value(material.E, 'Pa', si)}", f"ν = {number(material.nu)}"]
    if material.alpha_T:
        found.append(f"α_T = {_value(material.alpha_T, 'K-1', si)}")
    elif material.beta:
        found.append(f"β = {_value(material.beta, 'Pa K-1', si)}")
    return ", ".join([*found, *([f"k = {_value(material.k, 'W m-1 K-1', si)}"] if material.k else [])])


def scene_facts(study: Study, lambda_1: float | None) -> Iterator[str]:
    """Material and heat, the laws' ω beside λ₁, and what the study varies."""
    scene, si = study.scenes[0], study.units == "SI"
    heat, rest = scene.heat, f" ({BODY})" if scene.material.regions else ""
    parts = [f"Material{rest}: plane {scene.material.plane}, {material_words(scene.material, si)}"]
    if heat.theta is not None:
        parts.append(f"θ = {_value(heat.theta, 'K', si)}")
    elif scene.material.expands and scene.conducts:
        parts.append(f"α = {_value(heat.alpha, 'W m-2 K-1', si)}, θ̄ = {_value(heat.theta_bar, 'K', si)}")
        parts += [f"q = {_value(heat.q, 'W m-3', si)}"] if heat.q and not heat.omega else []
    yield ";  ".join(parts)
    omegas, unit = (
        [law.omega for one in distinct(study.scenes, "friction") for law in one.laws],
        "Pa m-1" if si else "1",
    )
    least, most = min(omegas), max(omegas)
    ends = dict.fromkeys(with_unit(x, unit) if np.isfinite(x) and x else number(x) for x in (least, most))
    told = f"Steepest fall of the law ω = {' to '.join(ends)}"
    if lambda_1 is not None:
        told += f", stiffness λ₁ ≈ {with_unit(lambda_1, unit)} on this mesh: " + (
            "one solution" if most < lambda_1 else "several solutions may exist" if least >= lambda_1 else
            "one solution for laws with ω below it, several may exist for others")  # fmt: skip
    yield told
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
        name = f"{len(some)} of {len(every)} laws"
        return {f"{name}{' ' * k}": law for k, law in enumerate(some) if not law.vanishes}
    for k, law in enumerate(every):
        same = [one.made.values for one in every if one.name == law.name and one.made]
        told = [f"{symbol(key)} = {_in_units(law, key, value, study.units == 'SI')}"
                for key, value in (law.made.values if law.made else {}).items()
                if isinstance(value, float) and any(other.get(key) != value for other in same)]  # fmt: skip
        name = " ".join(filter(None, [edges[k % len(edges)], law.name, ", ".join(told)]))
        if axis is not None and len(every) == len(axis.labels):
            name = str(axis.labels[k])
        if not law.vanishes:
            found.setdefault(name, law)
    return found


def _in_units(law: Laws, key: str, value: float, si: bool) -> str:
    units = {one.name: one.dimension for one in SHAPES[law.made.shape].parameters}.get(key, "") if law.made else ""
    return with_unit(value, units.replace("/m", " m-1") if units and si else "1")


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
