"""The table of keys: every key that a study file may hold, as plain data. What else is said of a key is derived.

One row makes a key known: to the reader of its section, which then also suggests it for a misspelt one and reads it in
its dimension and bounds (`read.fields`); to `--set`; to the table in configs/README.md and to the JSON Schema
(`read.schema`). With `swept=True` a sweep may vary it, by its path and by its last word, and data carry its units; with
`affine=True` a path may run along it (`scene.parameters`). What a row cannot say is where the key acts: the record of
its section gets a field, the reader of its section fills it, and something uses it. Parameters of laws stand with them
(`laws.shapes.SHAPES`), the keys of `history` in `scene.histories`.
"""

from __future__ import annotations

from functools import cache
from typing import Any, get_args

from tcstudy.laws.shapes import SHAPES
from tcstudy.scene import units as u
from tcstudy.scene.designs import DESIGNS, DISTRIBUTIONS
from tcstudy.scene.families import FAMILIES
from tcstudy.scene.fits import FITS
from tcstudy.scene.histories import HISTORY
from tcstudy.scene.key import EDGE_ROWS, Key, key, load, swept
from tcstudy.scene.study import ALL, BRANCHES, MOST_REFINE, SOLVERS, Direction, MeshPlan, PathPlan, SolverPlan, Start

_MOST_LEVELS = max(family.max_levels for family in FAMILIES.values())
_MESH, _SOLVER = MeshPlan((), 1), SolverPlan()
_PATH = {name: field.default for name, field in PathPlan.__dataclass_fields__.items()}
_QUANTITIES = ("forces", "reactions", "section_force", "theta_edges", "von_mises")
_SHARE: dict[str, Any] = {"above": 0.0, "below": 1.0, "swept": True}

ROWS: tuple[Key, ...] = (
    key("title", "text", "says what the study is", fixed="a study has one title"),
    key("institution", "text", "who made the data", fixed="a study has one institution"),
    key(
        *("units", "choice", "system of units; `none`: everything is dimensionless"),
        words=("SI", "none"),
        default="SI",
        fixed="a study has one system of units",
    ),
    key("parameters", "named numbers", "numbers by name, for expressions such as `2*height`; a sweep may vary them"),
    key(
        *("body", "section", "the body Ω and the names of its edges: one of `outline`, `rectangle`, `file`"),
        example="{rectangle: {width: 200 mm, height: 100 mm}}",
        required=True,
        fixed="sweep a number that it gives, such as body.rectangle.height, or a name of parameters that it uses",
    ),
    key(
        *("boundary", "named sections", "one role for every edge, as a word or with its keys"),
        example="{bottom: contact, left: clamped, top: free, right: free}",
        required=True,
        short="role",
    ),
    key(
        *("material", "material", "isotropic: `E`, `nu` or `lambda`, `mu`"),
        example="{E: 210 GPa, nu: 0.3}",
        required=True,
        swept=True,
    ),
    key("materials", "named sections", "of regions that have a material of their own", of=("material",)),
    key("loads", "section", "forces in the body"),
    key(
        "heat",
        "section",
        "`alpha` and `theta_bar`, or a known `theta`; without the section the temperature is 0. Temperatures count "
        "from the stress-free state, so 293 K is no room temperature. An edge passes heat by the role `convection` "
        "or by [a `heat` of its own](#heat-by-edge) beside another role; every other edge is insulated",
    ),
    key(
        *("friction", "law", "one of the laws below, or one for each contact edge: `{EDGE: {law: …}, …}`"),
        example="{law: tresca, tau: 20 MPa}",
        required=True,
        swept=True,
    ),
    key(
        *("mesh", "section", "element sizes; [which meshes there are](#meshes-that-follow-the-error)"),
        example="{maxh: 10 mm}",
        required=True,
        fixed="sweep mesh.maxh, mesh.grading or mesh.marking; sizes as levels are h: [20 mm, 10 mm] in the sweep",
    ),
    key(
        *("solver", "section", "a name, a list of names, which the summary compares, or its keys"),
        fixed="write one study for each solver, or use --set",
        short="name",
    ),
    key(
        "sweep",
        "section",
        "parameters of `material`, `materials`, `loads`, `heat`, `friction` or of an edge's role by path or short "
        "name (not of `solver` and `exact`): `alpha: [1, 10]`, `friction.delta: {linspace: [10 um, 50 um, 9]}`, "
        "`E: {geomspace: [1 GPa, 100 GPa, 5]}`, `boundary.top.pressure: [0, 1 MPa]`; whole laws by name under "
        "`friction`, materials under `material` or `materials.REGION`; numbers of `body` and `mesh` by path "
        "(`body.rectangle.height`, `mesh.maxh`), [a mesh for each](#geometries). In a mode that draws points "
        "`alpha: {uniform: [1, 10]}`, `log-uniform`, `normal: {mean, sigma}`, `truncated-normal: {mean, sigma, "
        "from, to}`, `lognormal: {median, sigma}`, `triangular: {from, mode, to}` or `choice: [1, 2]`",
    ),
    key(
        *("exact", "section", "the exact solution, if you know it"),
        fixed="the exact solution belongs to one scene; write one study for each",
    ),
    key("path", "section", "[equilibria on the branch from rest](#equilibria-along-a-parameter)"),
    key(*("output", "section", "a path, or its keys"), fixed="the data of a study go to one place", short="path"),
    key("body.outline", "sections", "a list of its edges in their order around the body", least=2),
    key("body.rectangle", "section", "with the edges bottom, right, top, left", of=("block",)),
    key("body.file", "section", "a plane face of a STEP or BREP file"),
    key("body.holes", "sections", "a list of shapes, each with the name of its edge", of=("hole",)),
    key("body.regions", "named sections", "shapes by name, for heat sources and `materials`", of=("region",)),
    key(
        *(
            "outline.from",
            "point",
            "where the edge begins; it ends where the next one begins",
            u.LENGTH,
            "[0 mm, 0 mm]",
        ),
        required=True,
    ),
    key("outline.edge", "name", "its name; several edges may share one", example="NAME", required=True),
    key("outline.through", "point", "makes it a circular arc", u.LENGTH, "[0 mm, 20 mm]"),
    key("block.width", "number", "in x", u.LENGTH, "50 mm", required=True, above=0.0),
    key("block.height", "number", "in y", u.LENGTH, "20 mm", required=True, above=0.0),
    key("block.corner", "point", "lower left", u.LENGTH, "[0 mm, 0 mm]", default=[0, 0]),
    key("block.edges", "section", "other names of its edges", example="{bottom: NAME}", of=("sides",)),
    *(key(f"sides.{side}", "name", f"name of the {side} edge") for side in ("bottom", "right", "top", "left")),
    key("file.path", "text", "relative to the study, .step, .stp or .brep", example="part.step", required=True),
    key("file.edges", "named points", "a point on every named edge", u.LENGTH, "{NAME: [[0, 0]]}", required=True),
    key("file.face", "integer", "which face of it", default=0, least=0),
    key("file.unit", "text", "its unit of length (default: mm, m for .brep)", example="mm"),
    key("file.other", "name", "name of all other edges", example="NAME"),
    key("hole.circle", "section", ""),
    key("hole.rectangle", "section", ""),
    key("hole.outline", "sections", "", least=2),
    key("region.circle", "section", ""),
    key("region.rectangle", "section", ""),
    key("region.polygon", "points", "its corners", u.LENGTH, "[[0 mm, 0 mm], ...]", least=3),
    key("circle.center", "point", "", u.LENGTH, "[0 mm, 0 mm]", required=True),
    key("circle.radius", "number", "", u.LENGTH, "10 mm", required=True, above=0.0),
    key("circle.edge", "name", "name of a hole's edge", example="NAME"),
    key("rectangle.corner", "point", "lower left", u.LENGTH, "[0 mm, 0 mm]", required=True),
    key("rectangle.width", "number", "in x", u.LENGTH, "50 mm", required=True, above=0.0),
    key("rectangle.height", "number", "in y", u.LENGTH, "20 mm", required=True, above=0.0),
    key("rectangle.edge", "name", "name of a hole's edges", example="NAME"),
    *EDGE_ROWS,
    swept("material.E", "number", "Young's modulus", u.TRACTION, "210 GPa", above=0.0),
    swept("material.nu", "number", "Poisson's ratio", u.NONE, "0.3", above=-1.0, below=0.5),
    swept("material.lambda", "number", "first Lamé modulus", u.TRACTION, "121 GPa"),
    swept("material.mu", "number", "shear modulus", u.TRACTION, "81 GPa", above=0.0),
    swept("material.plane", "choice", "plane assumption", words=("strain", "stress"), default="strain"),
    swept("material.k", "number", "conductivity", u.CONDUCTIVITY, above=0.0),
    swept("material.alpha_T", "number", "thermal expansion", u.EXPANSION, default=0.0),
    swept("material.beta", "number", "stress–temperature modulus β in its place", u.THERMAL_STRESS),
    load("loads.f", "vector", "body force", u.BODY_FORCE, "[0, -77 kN/m^3]", required=True),
    swept("heat.alpha", "number", "heat transfer coefficient", u.HEAT_TRANSFER, least=0.0),
    load("heat.theta_bar", "field", "temperature of the surroundings", u.TEMPERATURE),
    load("heat.q", "field", "source", u.HEAT_SOURCE, default=0.0),
    swept("heat.omega", "names", "where the source is: a region, several, or a shape (default: everywhere)"),
    load("heat.theta", "field", "known temperature of the whole body", u.TEMPERATURE),
    key("friction.law", "choice", "", example="tresca", required=True, words=tuple(SHAPES)),
    swept("friction.strength", "field", "factor of the law, 0 in a gap of the bond", default=1.0, example="1"),
    swept("mesh.maxh", "sizes", "element size, or a list of them", u.LENGTH, "10 mm", required=True, above=0.0),
    key("mesh.levels", "integer", "number of meshes", default=1, least=1, most=_MOST_LEVELS),
    swept("mesh.refine", "integer", "refinements that make the mesh of maxh", default=0, least=0, most=MOST_REFINE),
    key("mesh.family", "choice", "how they are refined", words=tuple(FAMILIES), default=_MESH.family),
    key(
        "mesh.grading", "number", "exponent of graded meshes", example="0.3", default=_MESH.grading, least=0.1, **_SHARE
    ),
    key(
        "mesh.marking",
        "number",
        "share of the error refined",
        example="0.5",
        default=_MESH.marking,
        least=0.05,
        **_SHARE,
    ),
    key("mesh.goal", "goal", "what errors are estimated of", default=_MESH.goal.quantity),
    key("mesh.tolerance", "number", "relative error to reach", example="0.001", above=0.0, below=1.0),
    key("mesh.of", "goal", "what the tolerance is of"),
    key("mesh.max_levels", "integer", "most meshes for a tolerance", default=30, least=1, most=_MOST_LEVELS),
    key("mesh.max_dofs", "integer", "unknowns at which refinement ends", default=_MESH.max_dofs, least=1),
    key("mesh.known", "quantity", "the goal's exact value"),
    key("mesh.estimate", "flag", "estimate errors on uniform and graded meshes too", default=_MESH.estimate),
    key("mesh.guarantee", "flag", "enclose λ₁ of the body itself, and bound errors", default=_MESH.guarantee),
    key("goal.u_T", "point", "slip at a point of a contact edge", u.LENGTH, "[20 mm, 0 mm]", required=True),
    key("solver.name", "one or more", "of the solver", words=SOLVERS, example=SOLVERS[0], default=_SOLVER.names[0]),
    key("solver.tolerance", "number", "largest inclusion residual, strict", example="1e-10", above=0.0, below=1.0),
    key("solver.max_iterations", "integer", "of one solve by bundle-newton", least=1),
    key(
        *("solver.branch", "choice", "which solution is stored; `all`: the lowest, beside all that there are"),
        words=(*BRANCHES, ALL),
        default=_SOLVER.branch,
    ),
    key("solver.max_boxes", "integer", "of one point, where `branch: all` ends", default=_SOLVER.max_boxes, least=1),
    key("solver.max_seconds", "number", "the same in time", default=_SOLVER.max_seconds, above=0.0),
    key(
        *("sweep.mode", "choice", "`zip` reads lists together; the last four draw points"),
        words=("grid", "zip", "list", *DESIGNS),
        default="grid",
    ),
    key(
        *(
            "sweep.points",
            "sweep points",
            "`[{alpha: 1, E: 2 GPa}, …]` of `mode: list`, a table, or how many are drawn",
        ),
        example="[...]",
        least=1,
        of=("point",),
    ),
    key("sweep.seed", "integer", "of the drawn points", example="7", default=0, least=0),
    key("sweep.h", "sizes or tolerance", "element sizes, or `{tolerance, of, max_levels, known}`", u.LENGTH, above=0.0),
    key("values.linspace", "span", "`[a, b, n]`: n values from a to b, equally spaced", example="[a, b, n]"),
    key("values.geomspace", "span", "the same with equal ratios", example="[a, b, n]"),
    *DISTRIBUTIONS,
    *FITS,
    key("exact.u", "vector", "displacement", u.LENGTH, '["0.1*sin(pi*x)", "0"]', required=True),
    key("exact.theta", "field", "temperature", u.TEMPERATURE),
    key("exact.xi", "field", "traction −S_T on Γ_C (default: from u)", u.TRACTION),
    key("exact.exponent", "number", "of its singularity", above=0.0),
    key("exact.loads", "choice", "`derived`: it also makes the loads", words=("given", "derived"), default="given"),
    key("path.parameter", "text", "what varies, or `load`", example="theta_bar", required=True),
    key("path.from", "quantity", "where the path starts", example="0 K", required=True),
    key("path.to", "quantity", "the other end of the range", example="40 K", required=True),
    key("path.at", "quantities", "values at which the solutions on the branch are listed"),
    key("path.within", "span", "how far it may leave the range"),
    key("path.start", "choice", "solution that it starts from", words=get_args(Start), default=_PATH["start"]),
    key("path.direction", "choice", "way from the start", words=get_args(Direction), default=_PATH["direction"]),
    key("path.max_pieces", "integer", "most pieces on either side", least=1, default=_PATH["max_pieces"]),
    key("path.hysteresis", "flag", "compute the loop", default=_PATH["hysteresis"]),
    key("path.complete", "flag", "every branch of the range, loops included, by proof", default=_PATH["complete"]),
    key("path.level", "integer", "mesh level (default: finest)", least=0),
    key("path.law_error", "number", "relative, of a smooth law's polygon", above=0.0, default=_PATH["law_error"]),
    key("output.path", "text", "of the file (default: results/<study>.nc)", example="results/study.nc"),
    key("output.fields", "flag", "keep θ and u of the whole body", default=False),
    key("output.sensitivity", "words", "numbers by which results are differentiated", example="[friction.delta, E]"),
    key("output.probes", "named places", "points whose u, θ and σ are kept", u.LENGTH, "{tip: [200 mm, 60 mm]}"),
    key("output.quantities", "one or more", "further numbers of every point", words=_QUANTITIES, example="reactions"),
    key(
        "output.live", "flag", "keep what a page needs to solve by itself, up to half a megabyte a level", default=False
    ),
    *HISTORY,
)
"""All keys but the parameters of laws, in the order in which they are shown."""


@cache
def _by_section() -> dict[str, dict[str, Key]]:
    found: dict[str, dict[str, Key]] = {}
    for one in (*ROWS, *(own for law in SHAPES for own in law_rows(law))):
        found.setdefault(one.section, {}).setdefault(one.name, one)
    return found


@cache
def law_rows(law: str) -> tuple[Key, ...]:
    """The rows of a law's parameters."""
    of_units = {one.si: one for one in u.DIMENSIONS}
    return tuple(
        Key(
            *(one.name, one.kind, one.meaning, of_units[one.dimension], one.example, "friction"),
            required=one.required,
            default=one.default,
            least=one.least,
            swept=True,
        )
        for one in SHAPES[law].parameters
    )


def rows(section: str) -> dict[str, Key]:
    """The rows of a section by name."""
    return _by_section()[section]


def has_rows(section: str) -> bool:
    """Whether there is a section of this name with keys of its own."""
    return section in _by_section()


def row(section: str, name: str) -> Key:
    """One row; raises KeyError."""
    return _by_section()[section][name]


def short_of(section: str) -> str:
    """The key that a word in place of a section stands for; empty if it must be a mapping."""
    top = rows("").get(section)
    return top.short if top else ""


def of_role(role: str) -> tuple[str, ...]:
    """The keys that a role of an edge takes beside `role`."""
    return tuple(one.name for one in rows("boundary").values() if role in one.roles)
