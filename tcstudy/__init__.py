"""Parametric studies of static thermoelastic contact with nonmonotone, multivalued friction.

    import tcstudy
    study = tcstudy.load("configs/quickstart.yaml", ["mesh.levels=2"])
    result = tcstudy.run(study.with_(friction_delta="60 um"), progress=True)
    result                                  # a notebook shows answer and picture
    result["slip_length"]                   # a variable, an xarray.DataArray
    result["level_1"]["u_T"]                # by node
    result.summary, result.draw("a.svg"), result.save("results/coarse.nc")

Studies:  init, load, Study (from_dict, with_, to_yaml), plan, run, converge, cost
Results:  Result (summary, to_dataframe, draw, report, save), open_results, open_geometry, draw,
          report, export
Matrices: ContactProblem, law, solve, all_solutions, certify, follow

    problem = tcstudy.ContactProblem(A_tilde, l_tilde, c, tcstudy.law("tresca", tau=1.0))
    answer = tcstudy.solve(problem)
    answer.v, answer.xi, answer.inclusion_residual, answer.status
    tcstudy.certify(problem, answer).unique        # True is proved

Symbols, as in the paper (doi 10.3879/j.issn.1000-0887.2010.01.008) and tcstudy/METHOD.md, with
their units:

    theta      temperature above the stress-free state [K]
    theta_bar  temperature of the air [K];  alpha: heat transfer coefficient [W/(m² K)]
    u_T, u_N   tangential and normal displacement on the contact line Γ_C [m]; u_N = 0
    xi         traction ξ = −S_T [Pa] in result files, nodal friction force ξ_i [N/m] in matrices
    b, b̂       friction law of the slip [Pa], and with its jumps filled in vertically: ξ ∈ b̂(u_T)
    j          primitive of b
    A_tilde    Ã, stiffness condensed onto the contact nodes [Pa]
    l_tilde    l̃, condensed load [N/m]
    c          c_i, length of Γ_C that belongs to a contact node [m]
    lambda_1   λ₁, least eigenvalue of Ã against diag(c) [Pa/m]
    omega      ω, maximum softening slope of b [Pa/m]
    inclusion residual   max_i dist(ξ_i/c_i, b̂(u_i)) over the scale of b: 0 for a solution

Faults of the user are raised as a kind of UserFault, whose text is one line with the remedy. A
StudyWarning is what one must know of results before using them; their file keeps it, too.
Everything is imported when it is first used, so that `import tcstudy` costs nothing.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from tcstudy.api import Study, converge, cost, init, load, plan, run
    from tcstudy.errors import (
        ConvergenceError,
        CostError,
        DrawError,
        FitError,
        GeometryFailed,
        HistoryError,
        PageError,
        PathError,
        ProblemError,
        StoreError,
        StudyError,
        StudyWarning,
        UsageError,
        UserFault,
    )
    from tcstudy.matrices import (
        ContactProblem,
        all_solutions,
        certify,
        follow,
        law,
        opening,
        solve,
    )
    from tcstudy.results import Result, draw, export, open_geometry, open_results, report

    __version__: str

__all__ = [
    "ContactProblem",
    "ConvergenceError",
    "CostError",
    "DrawError",
    "FitError",
    "GeometryFailed",
    "HistoryError",
    "PageError",
    "PathError",
    "ProblemError",
    "Result",
    "StoreError",
    "Study",
    "StudyError",
    "StudyWarning",
    "UsageError",
    "UserFault",
    "__version__",
    "all_solutions",
    "certify",
    "converge",
    "cost",
    "draw",
    "export",
    "follow",
    "init",
    "law",
    "load",
    "open_geometry",
    "open_results",
    "opening",
    "plan",
    "report",
    "run",
    "solve",
]

_MATRICES = ("ContactProblem", "all_solutions", "certify", "follow", "law", "opening", "solve")
_RESULTS = ("Result", "draw", "export", "open_geometry", "open_results", "report")
_ERROR_ENDINGS = ("Error", "Failed", "Fault", "Warning")


def _module_of(name: str) -> str:
    """Return the module that has a public name."""
    if name in _MATRICES:
        return "matrices"
    if name in _RESULTS:
        return "results"
    return "errors" if name.endswith(_ERROR_ENDINGS) else "api"


def __getattr__(name: str) -> Any:
    """Return a public name, imported when it is first used."""
    if name not in __all__:
        raise AttributeError(f"module 'tcstudy' has no attribute {name!r}")
    if name == "__version__":
        from importlib.metadata import version

        return version("tcstudy")
    value = getattr(import_module(f"tcstudy.{_module_of(name)}"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted(__all__)
