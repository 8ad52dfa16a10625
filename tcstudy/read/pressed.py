"""What a study whose friction knows the pressure must not ask for, with reasons and remedies.

Coulomb's friction, and every friction of a unilateral edge, acts where the edge is pressed and only
there. It needs an edge that opens, whose pressure is known, and has no energy: nothing is lowest,
and no path along its minima can be followed.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from tcstudy.laws.shapes import knows_pressure
from tcstudy.read.document import Node
from tcstudy.read.fields import Context
from tcstudy.scene.histories import HistoryPlan
from tcstudy.scene.records import Contact, Scene
from tcstudy.scene.solver_plan import SEPARABLE, SolverPlan

Fault = tuple[tuple[str, ...], str, str]
"""A key path, the fault there, and the remedy."""

WITHOUT_ENERGY: Mapping[str, str] = {
    "path": "a path follows the energy",
    "fit": "a fit follows the energy",
    "output.sensitivity": "results are differentiated along the energy",
}
"""Keys that need an energy, with the reason."""


def check_pressed(
    ctx: Context,
    root: Node,
    scenes: Sequence[Scene],
    solver: SolverPlan | None,
    history: HistoryPlan | None,
) -> None:
    """Record what a study with friction that knows the pressure asks for and cannot have.

    scenes: of all its points;  solver, history: None where a section has faults, or is not there
    """
    for edge in _held_edges(scenes):
        fault = f"Coulomb's friction needs the pressure, and {edge} cannot open"
        remedy = f"write {edge}: {{role: contact, normal: unilateral}}, or another law"
        ctx.at(root.nearest("friction", edge), fault, remedy)
    if not any(scene.knows_pressure for scene in scenes):
        return
    faults = [*_without_energy(root), *_of_solver(solver)]
    if history is not None:
        faults += _of_history(scenes, history)
    for keys, fault, remedy in faults:
        ctx.at(root.nearest(*keys), fault, remedy)


def _held_edges(scenes: Sequence[Scene]) -> list[str]:
    """Return the edges with Coulomb's friction that do not open at some point, each once."""
    edges = dict[str, None]()
    for scene in scenes:
        roles = dict(scene.boundary)
        for edge, law, _ in scene.friction_by_edge:
            role = roles[edge]
            if knows_pressure(law) and isinstance(role, Contact) and not role.opens:
                edges[edge] = None
    return list(edges)


def _without_energy(root: Node) -> Iterator[Fault]:
    """Yield the sections that need an energy."""
    for key, reason in WITHOUT_ENERGY.items():
        keys = tuple(key.split("."))
        if root.at(*keys) is not None:
            yield keys, f"{reason}, and friction of a pressed edge has none", f"remove {key}"


def _of_solver(solver: SolverPlan | None) -> Iterator[Fault]:
    """Yield what is asked of the solver."""
    if solver is None:
        return
    if solver.every:
        fault = "all solutions are known by their energy, and friction of a pressed edge has none"
        yield ("solver", "branch"), fault, "write branch: lowest"
    if solver.names != (SEPARABLE,):
        fault = "friction of a pressed edge is solved by one method"
        yield ("solver", "name"), fault, f"write name: {SEPARABLE}, or leave it out"


def _of_history(scenes: Sequence[Scene], history: HistoryPlan) -> Iterator[Fault]:
    """Yield what is asked of a history."""
    laws = [law for scene in scenes for _, law, _ in scene.friction_by_edge]
    if any(knows_pressure(law) and law.omega > 0.0 for law in laws):
        fault = "a coefficient that falls with the slip would begin again in every step"
        yield ("history",), fault, "give one coefficient mu, or remove history"
    if history.branch == "lowest":
        fault = "friction of a pressed edge has no energy, and no state is the lowest"
        yield ("history", "branch"), fault, "leave it out"
