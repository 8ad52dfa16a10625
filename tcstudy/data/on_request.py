"""What a result file has beside the usual numbers, because `output` asks for it: probes, reactions, θ by edge, stress.

Names: `probe_<name>_u_x`, `_u_y`, `_theta`, `_sigma_xx`, `_sigma_yy`, `_sigma_xy` and on a contact edge `_u_T`;
`reaction_<edge>_x`, `_y`; `theta_mean_<edge>`; `von_mises_max` with `von_mises_x` and `von_mises_y`. Derivatives, which
are asked for likewise, have a table of their own (`data.sensitivities`).
"""

from __future__ import annotations

from collections.abc import Iterator

from tcstudy.data.schema import DIFFERENCE, FileVariable
from tcstudy.scene.records import Clamped, Contact
from tcstudy.scene.study import Study

PER_TRIANGLE = "of the triangle that holds the point, which has one stress"


def variables(study: Study) -> tuple[FileVariable, ...]:
    """The variables that this study asks for."""
    output = study.output
    found = [*_probes(study), *_of_edges(study)]
    if "von_mises" in output.quantities:
        where = "of the middle of the triangle with the largest stress"
        found += [
            _one("von_mises_max", "Pa", "largest von Mises stress", "of a triangle; it grows with h at corners"),
            _one("von_mises_x", "m", "x of the largest von Mises stress", where),
            _one("von_mises_y", "m", "y of the largest von Mises stress", where),
        ]
    if output.sensitivity:
        from tcstudy.data.sensitivities import variables as derivatives  # only for a study that asks for them

        found += derivatives(output.sensitivity)
    return tuple(found)


def _one(name: str, units: str, long_name: str, comment: str) -> FileVariable:
    kelvin = DIFFERENCE if units == "K" else ()
    extra = (("comment", comment), ("ancillary_variables", "status"), *kelvin)
    return FileVariable(name, "f8", units, long_name, extra=extra)


def _probes(study: Study) -> Iterator[FileVariable]:
    for probe in study.output.probes:
        x, y = probe.at
        at, start = f"at ({x:g}, {y:g})", f"probe_{probe.name}"
        for axis in "xy":
            yield _one(f"{start}_u_{axis}", "m", f"displacement in {axis} at {probe.name}", at)
        yield _one(f"{start}_theta", "K", f"temperature at {probe.name}", f"{at}, above the stress-free state")
        for c in ("xx", "yy", "xy"):
            yield _one(f"{start}_sigma_{c}", "Pa", f"stress {c} at {probe.name}", f"{at}, {PER_TRIANGLE}")
        if probe.on_contact:
            yield _one(f"{start}_u_T", "m", f"tangential displacement at {probe.name}", f"{at} of the contact line")


def _of_edges(study: Study) -> Iterator[FileVariable]:
    wanted = study.output.quantities
    for name, role in study.scenes[0].boundary:
        if "reactions" in wanted and isinstance(role, Clamped | Contact):
            for axis in "xy":
                what = "of the support on the body, per unit thickness; a corner counts to the first clamped edge"
                yield _one(f"reaction_{name}_{axis}", "N m-1", f"reaction of {name} in {axis}", what)
        if "theta_edges" in wanted:
            what = "above the stress-free state, over the edge"
            yield _one(f"theta_mean_{name}", "K", f"mean temperature of {name}", what)
