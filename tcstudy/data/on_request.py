"""What a result file has beside the usual numbers, because `output` asks for it: probes, reactions, θ by edge, stress.

Names: `probe_<name>_u_x`, `_u_y`, `_theta`, `_sigma_xx`, `_sigma_yy`, `_sigma_xy` and on a contact edge `_u_T`;
`reaction_<edge>_x`, `_y`; `force_<edge>_x`, `_y`, `work_<edge>`; `section_force_max`, `section_force_at` and along the
contact line `section_force`, `layer_force_<region>`; `theta_mean_<edge>`; `von_mises_max` with `von_mises_x` and `_y`.
Derivatives, which are asked for likewise, are `sensitivity_<quantity>_<number>`: ∂quantity/∂number at the solution of
the point and level, the number's dots written as `_`, as in `sensitivity_friction_resultant_friction_delta`. They
belong to the solution found while its nodes keep their pieces of b: at an event, where derivatives of two sides
differ, they are missing, and `sensitivity_status` says so. Those of steps of a history are differences of whole
histories. (Sobol indices, as `tcstudy show` has them, are something else.)
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from itertools import product

from tcstudy.data.schema import LAYER, POINT_LEVEL, SECTION, SWEEP, FileVariable, count, flags, result
from tcstudy.scene.records import Clamped, Contact, Free
from tcstudy.scene.study import Sensitivity, Study

SENSITIVITY = "sensitivity_"
"""How the names of derivatives begin."""


def variables(study: Study) -> tuple[FileVariable, ...]:
    """The variables that this study asks for."""
    output = study.output
    found = [*_probes(study), *_of_edges(study)]
    if "von_mises" in output.quantities:
        where = "of the middle of the triangle with the largest stress"
        found += [
            result("von_mises_max", "Pa", "largest von Mises stress", "of a triangle; it grows with h at corners"),
            result("von_mises_x", "m", "x of the largest von Mises stress", where),
            result("von_mises_y", "m", "y of the largest von Mises stress", where),
        ]
    if "section_force" in output.quantities:
        found += [
            result("section_force_max", "N m-1", "largest force of a section", "with its sign, positive in tension"),
            result("section_force_at", "m", "arc length of the largest force of a section"),
        ]
    if output.sensitivity:
        found += derivatives(output.sensitivity)
    return tuple(found)


def line_variables(study: Study) -> tuple[FileVariable, ...]:
    """Those along the contact line."""
    if "section_force" not in study.output.quantities:
        return ()
    told = "of the layer across the line at the node, positive in tension; in balance with all others, of P1 stresses"
    layers = [name for name, _ in study.scenes[0].material.regions]
    own = [
        replace(SECTION, name=LAYER + name, long_name=f"force of the section of {name}", comment=told)
        for name in layers
    ]
    return (SECTION, *own)


def step_variables(study: Study) -> tuple[FileVariable, ...]:
    """What a history has on request of every step."""
    given = replace(study, output=replace(study.output, sensitivity=()))
    dims = {POINT_LEVEL: (SWEEP, "step"), SECTION.dims: (SWEEP, "step", "node")}
    own = [replace(v, dims=dims[v.dims]) for v in (*variables(given), *line_variables(study))]
    numbers = study.output.sensitivity
    return (*own, *derivatives(numbers, STEP_QUANTITIES, (SWEEP, "step"))) if numbers else tuple(own)


def _probes(study: Study) -> Iterator[FileVariable]:
    for probe in study.output.probes:
        x, y = probe.at
        in_triangle = f"at ({x:g}, {y:g}), of the triangle that holds the point, which has one stress"
        at, start = f"at ({x:g}, {y:g})", f"probe_{probe.name}"
        for axis in "xy":
            yield result(f"{start}_u_{axis}", "m", f"displacement in {axis} at {probe.name}", at)
        yield result(f"{start}_theta", "K", f"temperature at {probe.name}", f"{at}, above the stress-free state")
        for c in ("xx", "yy", "xy"):
            yield result(
                f"{start}_sigma_{c}",
                "Pa",
                f"stress {c} at {probe.name}",
                in_triangle,
            )
        if probe.on_contact:
            yield result(f"{start}_u_T", "m", f"tangential displacement at {probe.name}", f"{at} of the contact line")


_PER = "per unit thickness"


def _of_edges(study: Study) -> Iterator[FileVariable]:
    wanted = study.output.quantities
    for name, role in study.scenes[0].boundary:
        if "reactions" in wanted and isinstance(role, Clamped | Contact):
            for axis in "xy":
                what = "of the support on the body, per unit thickness; a corner counts to the first clamped edge"
                yield result(f"reaction_{name}_{axis}", "N m-1", f"reaction of {name} in {axis}", what)
        if "forces" in wanted and not isinstance(role, Free):
            for axis in "xy":
                yield result(f"force_{name}_{axis}", "N m-1", f"force of {name} in {axis}", f"on the body, {_PER}")
            yield result(f"work_{name}", "J m-1", f"work of {name}", f"its force times its displacement, {_PER}")
        if "theta_edges" in wanted:
            what = "above the stress-free state, over the edge"
            yield result(f"theta_mean_{name}", "K", f"mean temperature of {name}", what)


_VERDICTS = ("not_judged", "differentiable", "at_event", "at_fold")
NOT_JUDGED, DIFFERENTIABLE, AT_EVENT, AT_FOLD = range(4)
STATUS, EVENTS = f"{SENSITIVITY}status", f"{SENSITIVITY}events"

QUANTITIES = {
    "u_T_max": ("m", "largest |u_T|"),
    "friction_resultant": ("N m-1", "friction resultant"),
    "theta_mean": ("K", "mean temperature"),
    "lambda_1": ("Pa m-1", "tangential stiffness lambda_1"),
    "omega": ("Pa m-1", "steepest fall omega of b"),
    "energy": ("J m-1", "energy"),
}
"""Differentiated quantities, their units and names. `slip_length` is not among them: on one mesh it is a step function
of every number, and its derivative 0 would say nothing."""
STEP_QUANTITIES = ("u_T_max", "friction_resultant", "theta_mean")
"""Those of the steps of a history."""


def name_of(quantity: str, number: str) -> str:
    """The variable of a quantity differentiated by a number of the study."""
    return f"{SENSITIVITY}{quantity}_{number.replace('.', '_')}"


def derivatives(
    numbers: Sequence[Sensitivity], of: Iterable[str] = QUANTITIES, dims: tuple[str, ...] = POINT_LEVEL
) -> Iterator[FileVariable]:
    """The variables of a study that asks for these, of points, or of the steps of a history."""
    steps = "step" in dims
    told = "difference of whole histories; missing where both sides differ" if steps else _AT_SOLUTION
    yield FileVariable(STATUS, "i1", "1", "verdict on derivatives", dims, extra=flags(*_VERDICTS))
    if not steps:
        yield replace(count(EVENTS, "contact nodes at an event", extra=()), comment=_EVENT)
    for number, quantity in product(numbers, of):
        (units, what), extra = QUANTITIES[quantity], (("ancillary_variables", STATUS),)
        name, over = name_of(quantity, number.name), quotient(units, number.units)
        yield FileVariable(name, "f8", over, f"{what} by {number.name}", dims, extra=extra, comment=told)


_AT_SOLUTION = "at the solution, while its nodes keep their pieces of b"
_EVENT = "where a node begins to slide, comes to rest or passes a kink, to 1e-9"


def quotient(units: str, by: str) -> str:
    """Units of a derivative in CF form: "m" by "Pa m-1" is "m Pa-1 m"."""
    parts = [units] if units != "1" else []
    for word in by.split() if by != "1" else ():
        letters = word.rstrip("-0123456789")
        power = -int(word[len(letters) :] or 1)
        parts.append(letters if power == 1 else f"{letters}{power}")
    return " ".join(parts) or "1"
