"""What a result file has of derivatives by numbers of the study: one variable for each quantity and number.

`sensitivity_<quantity>_<number>` is ∂quantity/∂number at the solution of the point and level, the number's dots written
as `_`: `sensitivity_friction_resultant_friction_delta`. They belong to the solution found while its nodes keep their
pieces of b: at an event, where derivatives of two sides differ, they are missing, and `sensitivity_status` says so.
(The command `tcstudy sensitivity` is something else: Sobol indices of a design, over all of its points.)
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from tcstudy.data.records import SENSITIVITY
from tcstudy.data.schema import POINT_LEVEL, FileVariable, flags
from tcstudy.scene.fits import Sensitivity

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


def name_of(quantity: str, number: str) -> str:
    """The variable of a quantity differentiated by a number of the study."""
    return f"{SENSITIVITY}{quantity}_{number.replace('.', '_')}"


def variables(numbers: Sequence[Sensitivity]) -> tuple[FileVariable, ...]:
    """The variables of a study that asks for these."""
    judged = (("ancillary_variables", STATUS),)
    status = flags("not_judged", "differentiable", "at_event", "at_fold")
    found = [
        FileVariable(STATUS, "i1", "1", "verdict on derivatives", extra=status),
        FileVariable(EVENTS, "i4", "1", "contact nodes at an event", extra=_EVENTS),
    ]
    for number in numbers:
        for quantity, (units, what) in QUANTITIES.items():
            name, over = name_of(quantity, number.name), quotient(units, number.units)
            extra = (("comment", "at the solution, while its nodes keep their pieces of b"), *judged)
            found.append(FileVariable(name, "f8", over, f"{what} by {number.name}", POINT_LEVEL, extra=extra))
    return tuple(found)


_EVENTS = (
    ("valid_min", np.int32(0)),
    ("comment", "where a node begins to slide, comes to rest or passes a kink, to 1e-9"),
)


def quotient(units: str, by: str) -> str:
    """Units of a derivative in CF form: "m" by "Pa m-1" is "m Pa-1 m"."""
    parts = [units] if units != "1" else []
    for word in by.split() if by != "1" else ():
        letters = word.rstrip("-0123456789")
        power = -int(word[len(letters) :] or 1)
        parts.append(letters if power == 1 else f"{letters}{power}")
    return " ".join(parts) or "1"
