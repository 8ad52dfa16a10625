"""The table of keys: every key that a study file may hold, as plain data.

All else about a key is derived from its row. One row makes a key known: to the reader of its
section, which then also suggests it for a misspelt one and reads it in its dimension and bounds
(`read.fields`); to `--set`; to configs/reference.md and to the JSON Schema (`read.schema`). With
`swept=True` a sweep may vary it, by its path and by its last word, and data carry its units; with
`affine=True` a path may run along it (`scene.parameters`). What a row cannot say is where the key
acts: the record of its section gets a field, the reader of its section fills it, and something uses
it. Parameters of laws stand with them (`laws.shapes.SHAPES`).

An edge has a role, which holds or carries something, and may do something to heat: `convection`
takes its heat transfer coefficient by itself, every other role a section `heat`.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cache, partial
from typing import Any, get_args

from tcstudy.laws.shapes import SHAPES
from tcstudy.scene import units as u
from tcstudy.scene.designs import DESIGNS, ENDS, PARAMETERS
from tcstudy.scene.fit_plan import COMPARE, LOSSES, SCALES
from tcstudy.scene.histories import HISTORY_BRANCHES, MEMORIES, MOST_STEPS
from tcstudy.scene.mesh_plan import FAMILIES, MOST_REFINE, MeshPlan
from tcstudy.scene.path_plan import Direction, PathPlan, Start
from tcstudy.scene.solver_plan import ALL, BRANCHES, SOLVERS, SolverPlan
from tcstudy.scene.units import NONE, Dimension

Kind = str
"""What a value may be; `read.schema.FRAGMENTS` has all kinds.

number: one for the whole body; quantity, quantities, span: one, some, two of a dimension that
another key decides;
field: a number or an expression in x and y; component: that or `free`; vector: two fields;
displacement: two
components; named places: a point a name;
section: a mapping of its own; sections, points: a list of them, or by name; names: of regions, or a
shape;
flag or word: true, false or one of the words;
one or more: of the words; words: a list of any; choice by edge: a word, or one for each contact
edge;
number or word: one of the words in place of a number;
sweep points: a list of them, or their number;
sizes: one or more numbers; law: a friction law; material: the keys of one, whole ones by name in a
sweep."""


@dataclass(frozen=True)
class Key:
    """One key of a section.

    section:   the mapping that it belongs to, "" for the study; "boundary" is that of one edge
    dimension: of its numbers
    meaning:   in a line, without the dimension
    example:   a value as it is suggested; by default that of the dimension
    required:  the section cannot be without it; where it depends, the reader decides
    default:   what stands for it if it is not given
    words:     what a choice is between
    least, above, most, below: bounds of a number, with and without themselves
    swept:     whether a sweep may vary it
    affine:    whether the load is affine in it, so that a path may run along it
    roles:     roles of an edge that take it
    of:        the section, or sections, that its value is; of a section by default that of its name
    short:     of a section: the key that a word in its place stands for
    """

    name: str
    kind: Kind
    meaning: str
    dimension: Dimension = NONE
    example: str = ""
    section: str = ""
    required: bool = False
    default: object = None
    words: tuple[str, ...] = ()
    least: float | None = None
    above: float | None = None
    most: float | None = None
    below: float | None = None
    swept: bool = False
    affine: bool = False
    roles: tuple[str, ...] = ()
    of: tuple[str, ...] = ()
    short: str = ""

    def __post_init__(self) -> None:
        if not self.of and self.kind in (
            "section",
            "sections",
            "named sections",
            "law",
            "material",
        ):
            object.__setattr__(self, "of", (self.name,))

    @property
    def numbers(self) -> tuple[str, ...]:
        """Names of its single numbers, along which a path may run: f_x and f_y of f."""
        return (f"{self.name}_x", f"{self.name}_y") if self.kind == "vector" else (self.name,)

    @property
    def suggestion(self) -> str:
        """A value that it might have."""
        return self.example or (self.dimension.example if self.dimension != NONE else "...")


def key(path: str, kind: Kind, meaning: str, *values: Any, **options: Any) -> Key:
    """Return the row of a key by its section and name, "mesh.maxh"; the rest as `Key` has it."""
    section, _, name = path.rpartition(".")
    return replace(Key(name, kind, meaning, *values, **options), section=section)


swept = partial(key, swept=True)
"""The row of a key that a sweep may vary."""
load = partial(swept, affine=True)
"""The row of a key in which the load is affine."""
needed = partial(key, required=True)
"""The row of a key that its section cannot be without."""


ROLES = ("clamped", "symmetry", "rigid", "traction", "contact", "convection", "free")
LOADED = ("traction", "convection")
"""Roles that take a traction, a pressure and springs."""
MOVED = ("clamped", "rigid")
"""Roles that take displacements in x and y."""
NORMALS = ("held", "free", "unilateral")
"""What a contact edge without adhesion may do along its normal."""


_CONVECTIVE = ("convection",)
_WITH_RESULTANT = (*LOADED, "rigid")
_WITH_HEAT_SECTION = tuple(role for role in ROLES if role != "convection")
_STIFFNESS = {"dimension": u.STIFFNESS, "default": 0.0, "least": 0.0}


_MOST_LEVELS = max(family.max_levels for family in FAMILIES.values())
_MESH, _SOLVER = MeshPlan((), 1), SolverPlan()
_PATH = {name: field.default for name, field in PathPlan.__dataclass_fields__.items()}
_BODY, _MATERIAL = "{rectangle: {width: 200 mm, height: 100 mm}}", "{E: 210 GPa, nu: 0.3}"
_EDGES = "{bottom: contact, left: clamped, top: free, right: free}"
_HEAT = "{alpha: 100 W/(m^2*K), theta_bar: 20 K}"
_LAW, _SIZE = "{law: tresca, tau: 20 MPa}", "{maxh: 10 mm}"
_ADHESION = "{law: bilinear, sigma: 20 MPa, s0: 4 um, sf: 14 um}"
MODES = ("grid", "zip", "list", *DESIGNS)
_QUANTITIES = ("forces", "reactions", "section_force", "slip_bounds", "theta_edges", "von_mises")


def _share(least: float) -> dict[str, Any]:
    return {"above": 0.0, "below": 1.0, "least": least}


def laws_of(section: str) -> tuple[str, ...]:
    """Return the names of the laws of a section: all, but of an opening none of the pressure."""
    of_pressure = ("coulomb",) if section == "adhesion" else ()
    return tuple(name for name in SHAPES if name not in of_pressure)


def _law_section(section: str, example: str) -> Iterator[Key]:
    """Yield the rows of a section of laws that go with every law."""
    yield needed(
        f"{section}.law",
        "choice",
        "name of the law, whose parameters stand beside it",
        example=example,
        words=laws_of(section),
    )
    gap = "factor of the law, 0 in a gap of the bond"
    yield swept(f"{section}.strength", "field", gap, default=1.0, example="1")
    scatter = "coefficient of variation of a random strength"
    yield swept(f"{section}.scatter", "number", scatter, example="0.1", least=0.0)
    length = "correlation length of the random strength"
    yield swept(f"{section}.scatter_length", "number", length, u.LENGTH, "20 mm", above=0.0)
    seed = "seed of the random strength"
    yield swept(f"{section}.scatter_seed", "integer", seed, default=0, least=0)


_LINES = "[{load: 0.5}, {load: 1}]"
_FITTED = "{friction.tau_s: {start: 4 MPa, within: [1 MPa, 50 MPa]}}"
_NAMED = '{friction_resultant: "P [N/mm]"}'
_TESTS = f"[{{data: {{file: short.csv, columns: {_NAMED}}}, with: {{parameters.L: 50 mm}}}}]"
ROWS: tuple[Key, ...] = (
    key("title", "text", "title of the study"),
    key("institution", "text", "who made the data"),
    key(
        "units",
        "choice",
        "system of units; `none`: everything is dimensionless",
        words=("SI", "none"),
        default="SI",
    ),
    key(
        "parameters",
        "named numbers",
        "numbers by name, for expressions such as `2*height` and for sweeps",
    ),
    needed(
        "body",
        "section",
        "the body Ω and its edges: one of `outline`, `rectangle`, `file`",
        example=_BODY,
    ),
    needed(
        "boundary",
        "named sections",
        "a role for every edge, as a word or with keys",
        example=_EDGES,
        short="role",
    ),
    needed(
        "material",
        "material",
        "isotropic: `E`, `nu` or `lambda`, `mu`",
        example=_MATERIAL,
        swept=True,
    ),
    key(
        "materials",
        "named sections",
        "of regions that have a material of their own",
        of=("material",),
    ),
    key("loads", "section", "forces in the body"),
    key(
        "heat",
        "section",
        "`alpha` and `theta_bar`, or `theta` itself; "
        "[reference temperature](howto/edges.md#heat-an-edge)",
        example=_HEAT,
    ),
    swept(
        "friction",
        "law",
        "a law, or one for each contact edge: `{EDGE: {law: …}, …}`; an edge that opens needs none",
        example=_LAW,
    ),
    swept(
        "adhesion",
        "law",
        "[law of the opening](howto/opening.md), one for every contact edge, or by edge: "
        "`{EDGE: {law: …}, …}`",
        example=_ADHESION,
    ),
    needed(
        "mesh",
        "section",
        "element sizes; [which meshes there are](howto/meshes.md)",
        example=_SIZE,
    ),
    key(
        "solver",
        "section",
        "a name, a list of names, which the summary compares, or its keys",
        short="name",
    ),
    key(
        "sweep",
        "section",
        "[what varies](howto/sweeps.md): `alpha: [1, 10]`, `E: {linspace: [1 GPa, 2 GPa, 9]}`",
    ),
    key("exact", "section", "the exact solution, if you know it"),
    key("path", "section", "[equilibria on the primary branch](howto/paths.md)"),
    key("output", "section", "a path, or its keys", short="path"),
    key("body.outline", "sections", "edges in their order around the body", least=2),
    key("body.rectangle", "section", "body with the edges bottom, right, top, left", of=("block",)),
    key("body.file", "section", "plane face of a STEP or BREP file"),
    key("body.holes", "sections", "shapes, each with the name of its edge", of=("hole",)),
    key(
        "body.regions",
        "named sections",
        "shapes by name, for heat sources and `materials`",
        of=("region",),
    ),
    needed(
        "outline.from",
        "point",
        "start of the edge, which ends where the next one starts",
        u.LENGTH,
        "[0 mm, 0 mm]",
    ),
    needed("outline.edge", "name", "name of the edge; several may share one", example="NAME"),
    key("outline.through", "point", "third point of a circular arc", u.LENGTH, "[0 mm, 20 mm]"),
    needed("block.width", "number", "size in x", u.LENGTH, "50 mm", above=0.0),
    needed("block.height", "number", "size in y", u.LENGTH, "20 mm", above=0.0),
    key("block.corner", "point", "lower left corner", u.LENGTH, "[0 mm, 0 mm]", default=[0, 0]),
    key(
        "block.edges",
        "section",
        "other names of the edges",
        example="{bottom: NAME}",
        of=("sides",),
    ),
    *(
        key(f"sides.{side}", "name", f"name of the {side} edge")
        for side in ("bottom", "right", "top", "left")
    ),
    needed(
        "file.path", "text", "path relative to the study: .step, .stp or .brep", example="part.step"
    ),
    needed(
        "file.edges", "named points", "a point on every named edge", u.LENGTH, "{NAME: [[0, 0]]}"
    ),
    key("file.face", "integer", "number of the face in the file", default=0, least=0),
    key(
        "file.unit",
        "text",
        "unit of length, if the header states none (default: mm, m for .brep)",
        example="mm",
    ),
    key("file.other", "name", "name of all other edges", example="NAME"),
    key("hole.circle", "section", "round hole"),
    key("hole.rectangle", "section", "rectangular hole"),
    key("hole.outline", "sections", "hole by its edges", least=2),
    key("region.circle", "section", "round region"),
    key("region.rectangle", "section", "rectangular region"),
    key(
        "region.polygon",
        "points",
        "corners of the region",
        u.LENGTH,
        "[[0 mm, 0 mm], ...]",
        least=3,
    ),
    needed("circle.center", "point", "middle of the circle", u.LENGTH, "[0 mm, 0 mm]"),
    needed("circle.radius", "number", "radius of the circle", u.LENGTH, "10 mm", above=0.0),
    key("circle.edge", "name", "name of the edge of the hole", example="NAME"),
    needed("rectangle.corner", "point", "lower left corner", u.LENGTH, "[0 mm, 0 mm]"),
    needed("rectangle.width", "number", "size in x", u.LENGTH, "50 mm", above=0.0),
    needed("rectangle.height", "number", "size in y", u.LENGTH, "20 mm", above=0.0),
    key("rectangle.edge", "name", "name of the edges of the hole", example="NAME"),
    needed("boundary.role", "choice", "boundary condition type", example="clamped", words=ROLES),
    swept(
        "boundary.u",
        "displacement",
        "both components (default: 0; `free` frees one)",
        u.LENGTH,
        roles=MOVED,
    ),
    load(
        "boundary.u_x",
        "component",
        "displacement in x; a component left out is free",
        u.LENGTH,
        roles=MOVED,
    ),
    load("boundary.u_y", "component", "displacement in y", u.LENGTH, roles=MOVED),
    load(
        "boundary.u_N",
        "component",
        "displacement along the outward normal",
        u.LENGTH,
        roles=("clamped",),
    ),
    load(
        "boundary.u_T",
        "component",
        "displacement along the edge, positive with the body on the left",
        u.LENGTH,
        roles=("clamped",),
    ),
    load("boundary.g", "vector", "traction", u.TRACTION, roles=LOADED),
    load(
        "boundary.pressure",
        "field",
        "pressure on the edge, positive in compression",
        u.TRACTION,
        roles=LOADED,
    ),
    load(
        "boundary.force",
        "vector",
        "resultant, uniformly distributed; on a rigid edge it moves the edge",
        u.LINE_FORCE,
        roles=_WITH_RESULTANT,
    ),
    load(
        "boundary.moment",
        "number",
        "moment about the middle of a rigid edge, which turns",
        u.MOMENT,
        roles=("rigid",),
    ),
    key(
        "boundary.normal",
        "choice",
        "`held`: u_N = 0; `free`: S_N = 0; `unilateral`: it may open, u_N ≤ 0",
        words=NORMALS,
        default=NORMALS[0],
        roles=("contact",),
    ),
    key("boundary.spring", "section", "stiffness of a support (Winkler)", roles=LOADED),
    swept(
        "boundary.alpha",
        "number",
        "heat transfer coefficient of this edge",
        u.HEAT_TRANSFER,
        above=0.0,
        roles=_CONVECTIVE,
    ),
    load(
        "boundary.theta_bar",
        "field",
        "ambient temperature of this edge",
        u.TEMPERATURE,
        roles=_CONVECTIVE,
    ),
    load("boundary.flux", "field", "heat into the body", u.HEAT_FLUX, roles=_CONVECTIVE),
    key(
        "boundary.heat",
        "section",
        "thermal condition of the edge (default: insulated)",
        roles=_WITH_HEAT_SECTION,
        of=("edge_heat",),
    ),
    load("edge_heat.theta", "field", "prescribed temperature", u.TEMPERATURE),
    swept(
        "edge_heat.alpha",
        "number",
        "heat transfer coefficient of this edge",
        u.HEAT_TRANSFER,
        above=0.0,
    ),
    load("edge_heat.theta_bar", "field", "ambient temperature of this edge", u.TEMPERATURE),
    load("edge_heat.flux", "field", "heat into the body", u.HEAT_FLUX),
    swept("spring.normal", "number", "stiffness along the normal", **_STIFFNESS),
    swept("spring.tangential", "number", "stiffness along the edge", **_STIFFNESS),
    swept("material.E", "number", "Young's modulus", u.TRACTION, "210 GPa", above=0.0),
    swept("material.nu", "number", "Poisson's ratio", u.NONE, "0.3", above=-1.0, below=0.5),
    swept("material.lambda", "number", "first Lamé modulus", u.TRACTION, "121 GPa"),
    swept("material.mu", "number", "shear modulus", u.TRACTION, "81 GPa", above=0.0),
    swept(
        "material.plane", "choice", "plane assumption", words=("strain", "stress"), default="strain"
    ),
    swept("material.k", "number", "thermal conductivity", u.CONDUCTIVITY, above=0.0),
    swept("material.alpha_T", "number", "thermal expansion coefficient", u.EXPANSION, default=0.0),
    swept(
        "material.beta",
        "number",
        "β = (3λ + 2μ) α_T of the body in its place; plane stress converts it",
        u.THERMAL_STRESS,
    ),
    load("loads.f", "vector", "body force", u.BODY_FORCE, "[0, -77 kN/m^3]", required=True),
    swept("heat.alpha", "number", "heat transfer coefficient", u.HEAT_TRANSFER, least=0.0),
    load("heat.theta_bar", "field", "ambient temperature", u.TEMPERATURE),
    load("heat.q", "field", "heat source", u.HEAT_SOURCE, default=0.0),
    swept("heat.omega", "names", "where the source is: a region, or several (default: everywhere)"),
    load("heat.theta", "field", "known temperature of the whole body", u.TEMPERATURE),
    *_law_section("friction", "tresca"),
    *_law_section("adhesion", "bilinear"),
    swept(
        "adhesion.closing",
        "number or word",
        "stiffness of the foundation where the bond is pressed",
        u.STIFFNESS,
        "200 GPa/m",
        words=("rigid",),
        default="rigid",
        above=0.0,
    ),
    swept(
        "mesh.maxh",
        "sizes",
        "element size, or a list of them",
        u.LENGTH,
        "10 mm",
        required=True,
        above=0.0,
    ),
    key("mesh.levels", "integer", "number of meshes", default=1, least=1, most=_MOST_LEVELS),
    swept(
        "mesh.refine",
        "integer",
        "refinements that make the mesh of maxh",
        default=0,
        least=0,
        most=MOST_REFINE,
    ),
    key("mesh.family", "choice", "kind of refinement", words=tuple(FAMILIES), default=_MESH.family),
    swept(
        "mesh.grading",
        "number",
        "exponent of graded meshes",
        u.NONE,
        "0.3",
        default=_MESH.grading,
        **_share(0.1),
    ),
    swept(
        "mesh.marking",
        "number",
        "bulk (Dörfler) marking parameter, as a share of the squared error",
        u.NONE,
        "0.5",
        default=_MESH.marking,
        **_share(0.05),
    ),
    key(
        "mesh.goal",
        "goal",
        "quantity of interest whose error is estimated",
        default=_MESH.goal.quantity,
    ),
    key(
        "mesh.tolerance", "number", "relative error to reach", example="0.001", above=0.0, below=1.0
    ),
    key("mesh.of", "goal", "quantity of interest of the tolerance"),
    key(
        "mesh.max_levels",
        "integer",
        "largest number of meshes for a tolerance",
        default=30,
        least=1,
        most=_MOST_LEVELS,
    ),
    key(
        "mesh.max_dofs",
        "integer",
        "degrees of freedom at which refinement ends",
        default=_MESH.max_dofs,
        least=1,
    ),
    key("mesh.known", "quantity", "exact value of the quantity of interest"),
    key(
        "mesh.estimate",
        "flag",
        "estimate errors on uniform and graded meshes too",
        default=_MESH.estimate,
    ),
    key(
        "mesh.guarantee",
        "flag or word",
        "prove bounds of λ₁ and errors of the body, by default of λ₁ alone and without arcs",
        words=("polygon",),
    ),
    needed("goal.u_T", "point", "slip at a point of a contact edge", u.LENGTH, "[20 mm, 0 mm]"),
    key(
        "solver.name",
        "one or more",
        "method",
        words=SOLVERS,
        example=SOLVERS[0],
        default=_SOLVER.names[0],
    ),
    key(
        "solver.tolerance",
        "number",
        "largest inclusion residual, strict",
        example="1e-10",
        above=0.0,
        below=1.0,
    ),
    key(
        "solver.max_iterations",
        "integer",
        "largest number of iterations of one solve by bundle-newton",
        least=1,
    ),
    key(
        "solver.branch",
        "choice",
        "which solution is stored",
        words=(*BRANCHES, ALL),
        default=BRANCHES[0],
    ),
    key(
        "solver.max_boxes",
        "integer",
        "largest number of boxes searched per point with `branch: all`",
        default=_SOLVER.max_boxes,
        least=1,
    ),
    key(
        "solver.max_seconds",
        "number",
        "longest search per point with `branch: all`, in seconds",
        default=_SOLVER.max_seconds,
        above=0.0,
    ),
    key(
        "sweep.mode",
        "choice",
        "`zip` reads lists together; the last four draw points",
        words=MODES,
        default=MODES[0],
    ),
    key(
        "sweep.points",
        "sweep points",
        "list or table of points, or the number of sampled points",
        example="[...]",
        of=("point",),
    ),
    key("sweep.seed", "integer", "seed of the sampled points", example="7", default=0, least=0),
    key(
        "sweep.correlation",
        "named quantities",
        "correlation of sampled parameters, by pairs",
        example='{"E, tau_s": 0.6}',
    ),
    key(
        "values.linspace",
        "span",
        "`[a, b, n]`: n values from a to b, equally spaced",
        example="[a, b, n]",
    ),
    key("values.geomspace", "span", "the same with equal ratios", example="[a, b, n]"),
    *(
        key(f"distribution.{kind}", "span", "", example="[a, b]")
        if names == ENDS
        else key(
            f"distribution.{kind}",
            "section",
            "",
            example="{" + ": 1, ".join(names) + ": 1}",
            of=(kind,),
        )
        for kind, names in PARAMETERS.items()
    ),
    key("distribution.choice", "any values", "equally likely", example="[a, b]", least=1),
    *(
        key(f"{kind}.{name}", "quantity", "", required=True)
        for kind, names in PARAMETERS.items()
        if names != ENDS
        for name in names
    ),
    key("fit", "section", "[parameters from measurements](howto/fits.md)"),
    needed("fit.data", "section", "a table of measurements", of=("fit_data",)),
    key(
        "fit.noise",
        "named quantities",
        "measurement standard uncertainty by column; estimated if left out",
    ),
    key(
        "fit.compare",
        "choice",
        "results at each datum, or distances to the path",
        words=COMPARE,
        default=COMPARE[0],
    ),
    needed(
        "fit.parameters",
        "fitted numbers",
        "fitted parameters by name",
        of=("fit_parameter",),
        example=_FITTED,
    ),
    key("fit.starts", "integer", "largest number of starting points", least=1, default=5),
    key("fit.seed", "integer", "seed of the other starting points", least=0, default=0),
    key("fit.loss", "choice", "`soft_l1`: outliers count less", words=LOSSES, default=LOSSES[0]),
    key("fit.level", "integer", "mesh level (default: finest)", least=0),
    key(
        "fit.tests",
        "sections",
        "further tests with the same parameters",
        example=_TESTS,
        of=("fit_test",),
    ),
    key(
        "fit.smooth",
        "flag",
        "penalise turns of a law by points that the data do not need",
        default=False,
    ),
    needed("fit_data.file", "text", "a CSV table beside the study", example="pull.csv"),
    needed(
        "fit_data.columns",
        "named texts",
        "heading of the column for each key or result",
        u.NONE,
        _NAMED,
    ),
    needed("fit_test.data", "section", "table of measurements of this test", of=("fit_data",)),
    key(
        "fit_test.noise", "named quantities", "uncertainty of this table (default: that of the fit)"
    ),
    key("fit_test.with", "named quantities", "values of the study in this test, by key path"),
    needed("fit_parameter.start", "quantity", "starting value", example="4 MPa"),
    needed("fit_parameter.within", "span", "bounds of the value", example="[1 MPa, 50 MPa]"),
    key(
        "fit_parameter.scale", "choice", "`log` by default where `within` is positive", words=SCALES
    ),
    needed("exact.u", "vector", "displacement", u.LENGTH, '["0.1*sin(pi*x)", "0"]'),
    key("exact.theta", "field", "temperature", u.TEMPERATURE),
    key("exact.xi", "field", "traction −S_T on Γ_C (default: from u)", u.TRACTION),
    key("exact.exponent", "number", "singular exponent of the solution", above=0.0),
    key(
        "exact.loads",
        "choice",
        "`derived`: it also makes the loads",
        words=("given", "derived"),
        default="given",
    ),
    needed("path.parameter", "text", "parameter that varies, or `load`", example="theta_bar"),
    needed("path.from", "quantity", "start of the range", example="0"),
    needed("path.to", "quantity", "end of the range", example="1"),
    key("path.at", "quantities", "values at which the solutions on the branch are listed"),
    key("path.within", "span", "extended range that the path may use"),
    key(
        "path.start",
        "choice",
        "solution at the start",
        words=get_args(Start),
        default=_PATH["start"],
    ),
    key(
        "path.direction",
        "choice",
        "direction from the start",
        words=get_args(Direction),
        default=_PATH["direction"],
    ),
    key(
        "path.max_pieces",
        "integer",
        "largest number of segments on either side",
        least=1,
        default=_PATH["max_pieces"],
    ),
    key("path.hysteresis", "flag", "compute the hysteresis loop", default=_PATH["hysteresis"]),
    key(
        "path.complete",
        "flag",
        "every branch of the range, loops included, by proof",
        default=_PATH["complete"],
    ),
    key("path.level", "integer", "mesh level (default: finest)", least=0),
    key(
        "path.law_error",
        "number",
        "relative error of the piecewise-linear approximation of a smooth law",
        above=0.0,
        default=_PATH["law_error"],
    ),
    key(
        "output.path",
        "text",
        "result file (default: `results/STUDY.nc`)",
        example="results/study.nc",
    ),
    key("output.fields", "flag", "keep θ and u of the whole body", default=False),
    key(
        "output.sensitivity",
        "words",
        "sensitivities of results with respect to these parameters",
        example="[friction.delta, E]",
    ),
    key(
        "output.probes",
        "named places",
        "points whose u, θ and σ are kept",
        u.LENGTH,
        "{tip: [200 mm, 60 mm]}",
    ),
    key(
        "output.quantities",
        "one or more",
        "further results of every point",
        words=_QUANTITIES,
        example="reactions",
    ),
    key(
        "output.live",
        "flag",
        "keep data that a page needs to solve by itself (half a megabyte per level)",
        default=False,
    ),
    key(
        "history",
        "section",
        "[load history of a bond with memory](howto/histories.md)",
    ),
    needed(
        "history.memory",
        "choice by edge",
        "internal variables of the contact nodes",
        example="friction",
        words=MEMORIES,
    ),
    needed(
        "history.steps",
        "sections",
        "lines with loads and their new values",
        example=_LINES,
        least=1,
        of=("step",),
    ),
    key(
        "history.repeat",
        "integer",
        "number of cycles of all lines",
        default=1,
        least=1,
        most=MOST_STEPS,
    ),
    key(
        "history.branch",
        "choice",
        "which solution of a step",
        words=HISTORY_BRANCHES,
        default="continued",
    ),
    key(
        "history.stiffness",
        "number",
        "stiffness of elastic-plastic bonds",
        u.STIFFNESS,
        "100 GPa/m",
        above=0.0,
    ),
    key("history.level", "integer", "mesh level (default: finest)", least=0),
    key("step.in", "integer", "load increments of the line", default=1, least=1, most=MOST_STEPS),
    key("step.name", "text", "name of the last step of the line", example="hot"),
)
"""All keys but the parameters of laws, in the order in which they are shown."""


LAWS = ("friction", "adhesion")
"""Sections that hold laws, each one for all contact edges or one for each of several."""
OPENING_WORDS = (
    ("an odd law is given", "a law of the opening is given"),
    (", or write odd: false and give b for all s", ""),
    ("an odd law jumps at s = 0 between -b and b", "a law of the opening has one value at s = 0"),
    ("friction opposes the slip", "an adhesive resists opening"),
    ("of sticking", "of a closed bond"),
    ("tau", "sigma"),
    ("slip", "opening"),
)
"""Words of laws of the slip, each with the one for a law of the opening."""
TWO_SIDED = ("odd", "slopes")
"""Parameters of laws on both sides of s = 0, which laws of the opening are not."""


@cache
def _by_section() -> dict[str, dict[str, Key]]:
    of_laws = [
        row for section in LAWS for law in laws_of(section) for row in law_rows(law, section)
    ]
    sections: dict[str, dict[str, Key]] = {}
    for row in (*ROWS, *of_laws):
        sections.setdefault(row.section, {}).setdefault(row.name, row)
    return sections


OF_ALL_LAWS = ("strength", "scatter", "scatter_length", "scatter_seed")
"""Keys of the section `friction` that go with every law."""


def of_all_laws(section: str) -> tuple[str, ...]:
    """Return the keys of a section of laws that go with every law, beside the law itself."""
    return (*OF_ALL_LAWS, "closing") if section == "adhesion" else OF_ALL_LAWS


def of_opening(text: str) -> str:
    """Return a text about a law of the slip, or the name of its parameter, for an opening."""
    for slip_word, opening_word in OPENING_WORDS:
        text = text.replace(slip_word, opening_word)
    return text


@cache
def parameter_names(law: str, section: str = "friction") -> dict[str, str]:
    """Return the names of a law's parameters in a section, with those that its shape has.

    Those of `adhesion` have sigma for tau and none of the side s < 0.
    """
    names = [parameter.name for parameter in SHAPES[law].parameters]
    if section == "adhesion":
        return {of_opening(name): name for name in names if name not in TWO_SIDED}
    return {name: name for name in names}


@cache
def law_rows(law: str, section: str = "friction") -> tuple[Key, ...]:
    """Return the rows of a law's parameters in a section."""
    dimensions = {dimension.si: dimension for dimension in u.DIMENSIONS}
    parameters = {parameter.name: parameter for parameter in SHAPES[law].parameters}
    parameter_rows = []
    for name, name_of_shape in parameter_names(law, section).items():
        parameter = parameters[name_of_shape]
        meaning = parameter.meaning
        parameter_row = Key(
            name,
            parameter.kind,
            of_opening(meaning) if section == "adhesion" else meaning,
            dimension=dimensions[parameter.dimension],
            example=parameter.example,
            section=section,
            required=parameter.required,
            default=parameter.default,
            least=parameter.least,
            swept=True,
        )
        parameter_rows.append(parameter_row)
    return tuple(parameter_rows)


def rows(section: str) -> dict[str, Key]:
    """Return the rows of a section by name; none for any other text."""
    return _by_section().get(section, {})


def row(section: str, name: str) -> Key:
    """Return a row; raise KeyError if there is none."""
    return _by_section()[section][name]


def short_of(section: str) -> str:
    """Return the key that a word in place of a section stands for; empty if it has none."""
    top = rows("").get(section)
    return top.short if top else ""


def of_role(role: str) -> tuple[str, ...]:
    """Return the keys that a role of an edge takes beside `role`."""
    return tuple(row.name for row in rows("boundary").values() if role in row.roles)
