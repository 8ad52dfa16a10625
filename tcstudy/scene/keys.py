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
from typing import get_args

from tcstudy.laws.shapes import SHAPES
from tcstudy.scene import units as u
from tcstudy.scene.designs import DESIGNS, DISTRIBUTIONS
from tcstudy.scene.families import FAMILIES
from tcstudy.scene.fits import FITS
from tcstudy.scene.histories import HISTORY
from tcstudy.scene.key import EDGE_ROWS, Key, in_section
from tcstudy.scene.study import ALL, BRANCHES, MOST_REFINE, SOLVERS, Direction, MeshPlan, PathPlan, SolverPlan, Start


def _shape(name: str) -> Key:
    return Key(name, "sections", "", least=2) if name == "outline" else Key(name, "section", "")


def _share(name: str, meaning: str, least: float, default: float) -> Key:
    said = (name, "number", meaning, u.NONE, f"{default}")
    return Key(*said, default=default, least=least, above=0.0, below=1.0, swept=True)


_MOST_LEVELS = max(family.max_levels for family in FAMILIES.values())
_MESH, _SOLVER = MeshPlan((), 1), SolverPlan()
_PATH = {name: field.default for name, field in PathPlan.__dataclass_fields__.items()}
_STRENGTH = Key("strength", "field", "factor of the law, 0 in a gap of the bond", default=1.0, example="1", swept=True)
_QUANTITIES = ("forces", "reactions", "section_force", "theta_edges", "von_mises")
_HOLE = ("circle", "rectangle", "outline")
_WIDTH = Key("width", "number", "in x", u.LENGTH, "50 mm", required=True, above=0.0)
_HEIGHT = Key("height", "number", "in y", u.LENGTH, "20 mm", required=True, above=0.0)

ROWS: tuple[Key, ...] = (
    *in_section(
        "",
        Key("title", "text", "says what the study is", fixed="a study has one title"),
        Key("institution", "text", "who made the data", fixed="a study has one institution"),
        Key(
            *("units", "choice", "system of units; `none`: everything is dimensionless"),
            words=("SI", "none"),
            default="SI",
            fixed="a study has one system of units",
        ),
        Key(
            "parameters", "named numbers", "numbers by name, for expressions such as `2*height`; a sweep may vary them"
        ),
        Key(
            *("body", "section", "the body Ω and the names of its edges: one of `outline`, `rectangle`, `file`"),
            example="{rectangle: {width: 200 mm, height: 100 mm}}",
            required=True,
            fixed="sweep a number that it gives, such as body.rectangle.height, or a name of parameters that it uses",
        ),
        Key(
            *("boundary", "named sections", "one role for every edge, as a word or with its keys"),
            example="{bottom: contact, left: clamped, top: free, right: free}",
            required=True,
            short="role",
        ),
        Key(
            *("material", "material", "isotropic: `E`, `nu` or `lambda`, `mu`"),
            example="{E: 210 GPa, nu: 0.3}",
            required=True,
            swept=True,
        ),
        Key("materials", "named sections", "of regions that have a material of their own", of=("material",)),
        Key("loads", "section", "forces in the body"),
        Key(
            "heat",
            "section",
            "`alpha` and `theta_bar`, or a known `theta`; without the section the temperature is 0. Temperatures count "
            "from the stress-free state, so 293 K is no room temperature. An edge passes heat by the role `convection` "
            "or by [a `heat` of its own](#heat-by-edge) beside another role; every other edge is insulated",
        ),
        Key(
            *("friction", "law", "one of the laws below, or one for each contact edge: `{EDGE: {law: …}, …}`"),
            example="{law: tresca, tau: 20 MPa}",
            required=True,
            swept=True,
        ),
        Key(
            *("mesh", "section", "element sizes; [which meshes there are](#meshes-that-follow-the-error)"),
            example="{maxh: 10 mm}",
            required=True,
            fixed="sweep mesh.maxh, mesh.grading or mesh.marking; sizes as levels are h: [20 mm, 10 mm] in the sweep",
        ),
        Key(
            *("solver", "section", "a name, a list of names, which the summary compares, or its keys"),
            fixed="write one study for each solver, or use --set",
            short="name",
        ),
        Key(
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
        Key(
            *("exact", "section", "the exact solution, if you know it"),
            fixed="the exact solution belongs to one scene; write one study for each",
        ),
        Key("path", "section", "[equilibria on the branch from rest](#equilibria-along-a-parameter)"),
        Key(*("output", "section", "a path, or its keys"), fixed="the data of a study go to one place", short="path"),
    ),
    *in_section(
        "body",
        Key("outline", "sections", "a list of its edges in their order around the body", least=2),
        Key("rectangle", "section", "with the edges bottom, right, top, left", of=("block",)),
        Key("file", "section", "a plane face of a STEP or BREP file"),
        Key("holes", "sections", "a list of shapes, each with the name of its edge", of=("hole",)),
        Key("regions", "named sections", "shapes by name, for heat sources and `materials`", of=("region",)),
    ),
    *in_section(
        "outline",
        Key(
            *("from", "point", "where the edge begins; it ends where the next one begins", u.LENGTH, "[0 mm, 0 mm]"),
            required=True,
        ),
        Key("edge", "name", "its name; several edges may share one", example="NAME", required=True),
        Key("through", "point", "makes it a circular arc", u.LENGTH, "[0 mm, 20 mm]"),
    ),
    *in_section(
        "block",
        *(_WIDTH, _HEIGHT),
        Key("corner", "point", "lower left", u.LENGTH, "[0 mm, 0 mm]", default=[0, 0]),
        Key("edges", "section", "other names of its edges", example="{bottom: NAME}", of=("sides",)),
    ),
    *in_section(
        "sides", *(Key(side, "name", f"name of the {side} edge") for side in ("bottom", "right", "top", "left"))
    ),
    *in_section(
        "file",
        Key("path", "text", "relative to the study, .step, .stp or .brep", example="part.step", required=True),
        Key("edges", "named points", "a point on every named edge", u.LENGTH, "{NAME: [[0, 0]]}", required=True),
        Key("face", "integer", "which face of it", default=0, least=0),
        Key("unit", "text", "its unit of length (default: mm, m for .brep)", example="mm"),
        Key("other", "name", "name of all other edges", example="NAME"),
    ),
    *in_section("hole", *map(_shape, _HOLE)),
    *in_section("region", *map(_shape, ("circle", "rectangle"))),
    *in_section("region", Key("polygon", "points", "its corners", u.LENGTH, "[[0 mm, 0 mm], ...]", least=3)),
    *in_section(
        "circle",
        Key("center", "point", "", u.LENGTH, "[0 mm, 0 mm]", required=True),
        Key("radius", "number", "", u.LENGTH, "10 mm", required=True, above=0.0),
        Key("edge", "name", "name of a hole's edge", example="NAME"),
    ),
    *in_section(
        "rectangle",
        Key("corner", "point", "lower left", u.LENGTH, "[0 mm, 0 mm]", required=True),
        *(_WIDTH, _HEIGHT),
        Key("edge", "name", "name of a hole's edges", example="NAME"),
    ),
    *EDGE_ROWS,
    *in_section(
        "material",
        Key("E", "number", "Young's modulus", u.TRACTION, "210 GPa", above=0.0, swept=True),
        Key("nu", "number", "Poisson's ratio", u.NONE, "0.3", above=-1.0, below=0.5, swept=True),
        Key("lambda", "number", "first Lamé modulus", u.TRACTION, "121 GPa", swept=True),
        Key("mu", "number", "shear modulus", u.TRACTION, "81 GPa", above=0.0, swept=True),
        Key("plane", "choice", "plane assumption", words=("strain", "stress"), default="strain", swept=True),
        Key("k", "number", "conductivity", u.CONDUCTIVITY, above=0.0, swept=True),
        Key("alpha_T", "number", "thermal expansion", u.EXPANSION, default=0.0, swept=True),
        Key("beta", "number", "stress–temperature modulus β in its place", u.THERMAL_STRESS, swept=True),
    ),
    *in_section(
        "loads",
        Key("f", "vector", "body force", u.BODY_FORCE, "[0, -77 kN/m^3]", required=True, swept=True, affine=True),
    ),
    *in_section(
        "heat",
        Key("alpha", "number", "heat transfer coefficient", u.HEAT_TRANSFER, least=0.0, swept=True),
        Key("theta_bar", "field", "temperature of the surroundings", u.TEMPERATURE, swept=True, affine=True),
        Key("q", "field", "source", u.HEAT_SOURCE, default=0.0, swept=True, affine=True),
        Key("omega", "names", "where the source is: a region, several, or a shape (default: everywhere)", swept=True),
        Key("theta", "field", "known temperature of the whole body", u.TEMPERATURE, swept=True, affine=True),
    ),
    *in_section("friction", Key("law", "choice", "", example="tresca", required=True, words=tuple(SHAPES)), _STRENGTH),
    *in_section(
        "mesh",
        Key(
            "maxh", "sizes", "element size, or a list of them", u.LENGTH, "10 mm", required=True, above=0.0, swept=True
        ),
        Key("levels", "integer", "number of meshes", default=1, least=1, most=_MOST_LEVELS),
        Key(
            "refine",
            "integer",
            "refinements that make the mesh of maxh",
            default=0,
            least=0,
            most=MOST_REFINE,
            swept=True,
        ),
        Key("family", "choice", "how they are refined", words=tuple(FAMILIES), default=_MESH.family),
        _share("grading", "exponent of graded meshes", 0.1, _MESH.grading),
        _share("marking", "share of the error refined", 0.05, _MESH.marking),
        Key("goal", "goal", "what errors are estimated of", default=_MESH.goal.quantity),
        Key("tolerance", "number", "relative error to reach", example="0.001", above=0.0, below=1.0),
        Key("of", "goal", "what the tolerance is of"),
        Key("max_levels", "integer", "most meshes for a tolerance", default=30, least=1, most=_MOST_LEVELS),
        Key("max_dofs", "integer", "unknowns at which refinement ends", default=_MESH.max_dofs, least=1),
        Key("known", "quantity", "the goal's exact value"),
        Key("estimate", "flag", "estimate errors on uniform and graded meshes too", default=_MESH.estimate),
        Key("guarantee", "flag", "enclose λ₁ of the body itself, not of the mesh", default=_MESH.guarantee),
    ),
    *in_section(
        "goal", Key("u_T", "point", "slip at a point of a contact edge", u.LENGTH, "[20 mm, 0 mm]", required=True)
    ),
    *in_section(
        "solver",
        Key("name", "one or more", "of the solver", words=SOLVERS, example=SOLVERS[0], default=_SOLVER.names[0]),
        Key("tolerance", "number", "largest inclusion residual, strict", example="1e-10", above=0.0, below=1.0),
        Key("max_iterations", "integer", "of one solve by bundle-newton", least=1),
        Key(
            *("branch", "choice", "which solution is stored; `all`: the lowest, beside all that there are"),
            words=(*BRANCHES, ALL),
            default=_SOLVER.branch,
        ),
        Key("max_boxes", "integer", "of one point, where `branch: all` ends", default=_SOLVER.max_boxes, least=1),
        Key("max_seconds", "number", "the same in time", default=_SOLVER.max_seconds, above=0.0),
    ),
    *in_section(
        "sweep",
        Key(
            *("mode", "choice", "`zip` reads lists together; the last four draw points"),
            words=("grid", "zip", "list", *DESIGNS),
            default="grid",
        ),
        Key(
            *("points", "sweep points", "`[{alpha: 1, E: 2 GPa}, …]` of `mode: list`, a table, or how many are drawn"),
            example="[...]",
            least=1,
            of=("point",),
        ),
        Key("seed", "integer", "of the drawn points", example="7", default=0, least=0),
        Key("h", "sizes or tolerance", "element sizes, or `{tolerance, of, max_levels, known}`", u.LENGTH, above=0.0),
    ),
    *in_section(
        "values",
        Key("linspace", "span", "`[a, b, n]`: n values from a to b, equally spaced", example="[a, b, n]"),
        Key("geomspace", "span", "the same with equal ratios", example="[a, b, n]"),
    ),
    *DISTRIBUTIONS,
    *FITS,
    *in_section(
        "exact",
        Key("u", "vector", "displacement", u.LENGTH, '["0.1*sin(pi*x)", "0"]', required=True),
        Key("theta", "field", "temperature", u.TEMPERATURE),
        Key("xi", "field", "traction −S_T on Γ_C (default: from u)", u.TRACTION),
        Key("exponent", "number", "of its singularity", above=0.0),
        Key("loads", "choice", "`derived`: it also makes the loads", words=("given", "derived"), default="given"),
    ),
    *in_section(
        "path",
        Key("parameter", "text", "what varies, or `load`", example="theta_bar", required=True),
        Key("from", "quantity", "where the path starts", example="0 K", required=True),
        Key("to", "quantity", "the other end of the range", example="40 K", required=True),
        Key("at", "quantities", "values at which the solutions on the branch are listed"),
        Key("within", "span", "how far it may leave the range"),
        Key("start", "choice", "solution that it starts from", words=get_args(Start), default=_PATH["start"]),
        Key("direction", "choice", "way from the start", words=get_args(Direction), default=_PATH["direction"]),
        Key("max_pieces", "integer", "most pieces on either side", least=1, default=_PATH["max_pieces"]),
        Key("hysteresis", "flag", "compute the loop", default=_PATH["hysteresis"]),
        Key("complete", "flag", "every branch of the range, loops included, by proof", default=_PATH["complete"]),
        Key("level", "integer", "mesh level (default: finest)", least=0),
        Key("law_error", "number", "relative, of a smooth law's polygon", above=0.0, default=_PATH["law_error"]),
    ),
    *in_section(
        "output",
        Key("path", "text", "of the file (default: results/<study>.nc)", example="results/study.nc"),
        Key("fields", "flag", "keep θ and u of the whole body", default=False),
        Key("sensitivity", "words", "numbers by which results are differentiated", example="[friction.delta, E]"),
        Key("probes", "named places", "points whose u, θ and σ are kept", u.LENGTH, "{tip: [200 mm, 60 mm]}"),
        Key("quantities", "one or more", "further numbers of every point", words=_QUANTITIES, example="reactions"),
        Key("live", "flag", "keep what a page needs to solve by itself, up to half a megabyte a level", default=False),
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
