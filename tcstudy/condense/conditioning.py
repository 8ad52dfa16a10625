"""Is the matrix singular to working precision? A condition estimate that rides along with the factorisation.

Small pivots do not answer that: of a body that can still turn about one fixed node all pivots may be large (the last
unknown may hardly move in that rotation). The trace of the inverse does.
Literature: M. F. Hutchinson, Comm. Statist. Simulation Comput. 18 (1989) 1059-1076 (trace from random signs).
"""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from tcstudy.condense.multifrontal import not_held
from tcstudy.condense.ordering import Floats
from tcstudy.condense.symbolic import EliminationPlan

PROBES = 4  # their mean overlap (s·z)² with a given unit vector z is below 0.01 with probability 2e-4
SINGULAR = 100.0 * float(np.finfo(np.float64).eps)  # reciprocal condition below which a matrix counts as singular


def random_probes(A: sp.csr_matrix | sp.csr_array, plan: EliminationPlan) -> Floats:
    """(r, N) loads g = D^{½}s with random signs s, D = diag A, for the condition estimate."""
    diagonal = A.diagonal()[plan.permutation]
    if not (diagonal > 0.0).all():
        raise not_held("a diagonal entry is zero or negative")
    signs = np.random.default_rng(0).integers(0, 2, (PROBES, len(diagonal)), dtype=np.int8)
    return np.where(signs, 1.0, -1.0) * np.sqrt(diagonal)


def check_condition(energy: Floats) -> None:
    """Raise if Â = D^{−½}AD^{−½} is singular to working precision.

    For random signs s the mean of gᵀA⁻¹g = sᵀÂ⁻¹s is trace Â⁻¹, at least 1/λ_min(Â) and for a held body hardly more
    than N log N. A zero eigenvalue is computed as a few ε of either sign, whatever the mesh; one pivot would not show
    it (a rotation about a fixed node near the last pivot leaves all pivots large).
    """
    worst = float(np.mean(energy))
    if not worst * SINGULAR <= 1.0:  # "not <=": fails for NaN as well
        raise not_held(f"it is singular to working precision (condition about {worst:.0e})")
