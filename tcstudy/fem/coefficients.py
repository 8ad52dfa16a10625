"""Small helpers between studies and NGSolve: expressions as coefficient functions, matrices and vectors as arrays."""

from __future__ import annotations

from typing import Any

import ngsolve as ngs
import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from tcstudy.scene.expressions import Expression
from tcstudy.scene.records import Scalar

Array = NDArray[np.float64]

BONUS_ORDER = 4
"""Extra quadrature order for data given as expressions; products of numbers and P1 functions are exact without it."""

_FUNCTIONS: dict[str, Any] = {
    name: getattr(ngs, name)
    for name in ("sin", "cos", "tan", "asin", "acos", "atan", "atan2", "exp", "log", "sqrt", "sinh", "cosh")
}
_FUNCTIONS |= {
    "abs": lambda a: ngs.IfPos(a, a, -a),
    "tanh": lambda a: 1 - 2 / (ngs.exp(2 * a) + 1),
    "min": lambda a, b: ngs.IfPos(a - b, b, a),
    "max": lambda a, b: ngs.IfPos(a - b, a, b),
}


def coefficient(scalar: Scalar) -> Any:
    """A number or an expression in x and y as an NGSolve CoefficientFunction."""
    if isinstance(scalar, Expression):
        made = ngs.CF(scalar.fold({"x": ngs.x, "y": ngs.y}, _FUNCTIONS))
        # NGSolve drops products with its own zero, test function and all, and cannot assemble what is left
        # and it evaluates shared parts of a tree as often as they are named, unless the tree is compiled to a list
        return ngs.CF(ngs.Parameter(0.0)) if str(made) == "ZeroCoefficientFunction" else made.Compile()
    return ngs.CF(float(scalar))


def is_zero(scalar: Scalar) -> bool:
    """True for the number 0 (an expression that happens to vanish counts as given)."""
    return not isinstance(scalar, Expression) and float(scalar) == 0.0


def bonus(*scalars: Scalar) -> int:
    """Extra quadrature order that the given data need."""
    return BONUS_ORDER if any(isinstance(s, Expression) for s in scalars) else 0


def csr(form: Any) -> sp.csr_array:
    """Copy the matrix of an assembled form (views into NGSolve dangle when the form dies)."""
    values, columns, starts = form.mat.CSR()
    shape = (form.mat.height, form.mat.width)
    return sp.csr_array(
        (
            np.array(values),
            np.array(columns, dtype=np.int32),
            np.array(np.asarray(starts).view(np.int64), dtype=np.int32),
        ),
        shape=shape,
    )


def vector(form: Any) -> Array:
    """Copy the vector of an assembled linear form."""
    return np.array(form.vec.FV().NumPy())
