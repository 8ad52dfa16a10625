"""Volumetric locking of P1 elements in plane strain: what it costs, measured on a solution that does not depend on ν.

Case: unit square, displacement given on three sides, contact with a linear law below, u = curl(sin(πx)(y + ky²/2μ)),
      div u = 0, so that only the discretisation feels λ; longest element edge 0.048 (2,300 unknowns)
Left out: elements that do not lock. The remedy within P1 is a finer mesh: the errors fall once h² λ/μ ≲ 1.
"""

from __future__ import annotations

NEARLY_INCOMPRESSIBLE = 0.45
MEASURED = {0.3: (3.6, 0.14), 0.45: (5.2, 0.24), 0.49: (10.0, 1.3), 0.499: (30.0, 7.3), 0.4999: (91.0, 15.0)}
"""Error of u in the energy norm and of u_T in L² of Γ_C [%] by ν, as `tcstudy converge` measures it."""


def locking_note(nu: float) -> str | None:
    """A warning for a Poisson's ratio in plane strain, with the measured loss; None below NEARLY_INCOMPRESSIBLE."""
    if nu < NEARLY_INCOMPRESSIBLE:
        return None
    near = max(known for known in MEASURED if known <= nu + 1e-12)
    energy, slip = MEASURED[near]
    usual_energy, usual_slip = MEASURED[0.3]
    return (
        f"nu = {nu:.12g} in plane strain: P1 elements lock. On a test with h = 0.048 of its size, at nu = {near:g} "
        f"u is off by {energy:g} % (energy norm) and u_T by {slip:g} %, against {usual_energy:g} % and "
        f"{usual_slip:g} % at nu = 0.3. Trust only levels with settled rates, and refine."
    )
