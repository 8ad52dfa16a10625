"""What a study is: the axes and scenes of its sweep, its plans, and what it stores."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from tcstudy.scene.designs import Design
from tcstudy.scene.fit_plan import FitPlan, Sensitivity
from tcstudy.scene.histories import HistoryPlan
from tcstudy.scene.mesh_plan import MeshPlan
from tcstudy.scene.path_plan import PathPlan
from tcstudy.scene.records import Point, Scalar, Scene
from tcstudy.scene.solver_plan import SolverPlan


@dataclass(frozen=True)
class Axis:
    """One swept parameter.

    name:         dimension and coordinate name in the data, "alpha"
    path:         key path in the study, ("heat", "alpha")
    values:       what is put at the path, point by point (plain YAML values)
    labels:       numbers (SI) or texts that stand in the data's coordinate
    units:        units of the labels, "1" for texts
    distribution: that they were drawn from, in words; empty if not drawn
    written:      unit that the study writes the numbers in, and its size in SI; ("", 1) if that is
                  SI, or not one
    """

    name: str
    path: tuple[str, ...]
    values: tuple[object, ...]
    labels: tuple[float | str, ...]
    units: str
    distribution: str = ""
    written: tuple[str, float] = ("", 1.0)

    @property
    def is_whole(self) -> bool:
        """Whether its values are laws or materials, by name."""
        return all(isinstance(value, Mapping) for value in self.values)

    def labelled(self) -> list[tuple[float | str, object]]:
        """Every label with its value."""
        return list(zip(self.labels, self.values, strict=True))


@dataclass(frozen=True)
class Probe:
    """A point at which u, θ and σ are stored, and u_T where it lies on a contact edge."""

    name: str
    at: Point
    on_contact: bool = False


_SHELL_VARIABLE = re.compile(r"\$(\w+|\{\w+\})")


def shell_name(text: str) -> tuple[str, str] | None:
    """Return what is wrong with the name of an output that only a shell understands, and the
    remedy."""
    if text == "-":
        return "names no file, and results cannot be a stream", "write a name such as results/a.nc"
    if text.startswith("~"):
        return "begins with ~, which only a shell knows as a home directory", "write the path out"
    if variable := _SHELL_VARIABLE.search(text):
        return f"has {variable[0]}, which only a shell replaces by its value", "write the path out"
    return None


SLIP_BOUNDS = "slip_bounds"
"""Word of `output.quantities` for proved bounds of slips and of the friction resultant."""


@dataclass(frozen=True)
class OutputPlan:
    """Where the data go and what beside the mandatory variables is kept.

    fields: θ and u of the whole body at every point
    live:             what a page needs to solve the contact problem by itself (`live_arrays` in
                      offline.level); off unless asked for, because it takes up to half a megabyte a
                      level and two loads a point
    sensitivity:      numbers by which the results of every point are differentiated
    probes, quantities: points and words for further numbers of every point (data.schema)
    """

    path: Path | None = None
    fields: bool = False
    live: bool = False
    sensitivity: tuple[Sensitivity, ...] = ()
    probes: tuple[Probe, ...] = ()
    quantities: tuple[str, ...] = ()

    @property
    def asks(self) -> bool:
        """True if there are numbers on request."""
        return bool(self.sensitivity or self.probes or self.quantities)


@dataclass(frozen=True)
class Exact:
    """The exact solution of every sweep point, against which `tcstudy converge` measures errors.

    u:        displacement [m]
    theta:    temperature, None if it is not compared [K]
    xi:       tangential traction −S_T on Γ_C [Pa], None to derive it from u
    exponent: u ~ r^exponent where it is least smooth, None where it is smooth
    derived:  whether loads, prescribed displacements and temperatures of the scenes were derived
              from it
    """

    u: tuple[Scalar, Scalar]
    theta: Scalar | None = None
    xi: Scalar | None = None
    exponent: float | None = None
    derived: bool = False


@dataclass(frozen=True, repr=False)
class Study:
    """A whole study: the sweep and one validated Scene for each of its points.

    mode:      "grid": points are the product of the axes; "list": axes are read together (zip and
               list)
    scenes:    one per point, in C order of the axes; each is complete (scene.points.Scenes for a
               sweep)
    text:      the exact YAML text
    source:    its file, if any
    units:     "SI" or "none" (dimensionless)
    design:    how the points were drawn, None if the study lists them
    variants:  one study for each geometry where the sweep varies the body or its meshes; `mesh` is
               that of the first
    geometric: the axes that make the geometries, by number
    tests:     one study for each further test of a fit, with its own data and values
    """

    title: str
    text: str
    source: Path | None
    units: Literal["SI", "none"]
    mode: Literal["grid", "list"]
    axes: tuple[Axis, ...]
    scenes: Sequence[Scene]
    mesh: MeshPlan
    solver: SolverPlan
    output: OutputPlan
    institution: str = ""
    overrides: tuple[str, ...] = field(default=())
    exact: Exact | None = None
    path: PathPlan | None = None
    history: HistoryPlan | None = None
    fit: FitPlan | None = None
    design: Design | None = None
    variants: tuple[Variant, ...] = ()
    geometric: tuple[int, ...] = ()
    tests: tuple[Study, ...] = ()

    def __repr__(self) -> str:
        """One line: a whole study would fill pages."""
        axes = ", ".join(f"{axis.name} ({len(axis.values)})" for axis in self.axes) or "none"
        size = f"points: {len(self.scenes)}, levels: {self.mesh.levels}"
        return f"Study({self.title!r}, sweep: {axes}, {size})"

    @property
    def kind(self) -> Literal["run", "path", "history", "fit"]:
        """What `run` does: the first of the sections fit, history, path that there is, else the
        sweep's points."""
        return "fit" if self.fit else "history" if self.history else "path" if self.path else "run"

    @property
    def opens(self) -> bool:
        """Whether a contact edge may lift off; roles are the same at all points."""
        return bool(self.scenes) and self.scenes[0].opens

    @cached_property
    def knows_pressure(self) -> bool:
        """Whether friction acts only where an edge is pressed, at some point."""
        return self.opens and any(scene.knows_pressure for scene in self.scenes)

    @property
    def in_blocks(self) -> bool:
        """Whether points are solved together: each its own where friction knows the pressure."""
        return self.solver.in_blocks and not self.knows_pressure

    @property
    def encloses_lambda_1(self) -> bool:
        """Whether λ₁ of the body is enclosed: where asked, and in sweeps of bodies without arcs."""
        if self.mesh.bounds_errors:
            return True
        if self.mesh.guarantee != "band" or self.kind != "run" or not self.scenes:
            return False
        if not self.scenes[0].holds_normal:
            return False
        body, material = self.scenes[0].body, self.scenes[0].material
        if set(body.curved_regions) & set(dict(material.regions)):
            return False
        return body.brep is None and all(edge.through is None for edge in body.edges)

    @property
    def shape(self) -> tuple[int, ...]:
        """Extent of the sweep along each data dimension (without the level)."""
        if self.mode == "grid":
            return tuple(len(axis.values) for axis in self.axes)
        return (len(self.axes[0].values),) if self.axes else ()

    @property
    def bodies(self) -> tuple[Variant, ...]:
        """The geometries of the sweep; without any the study itself as one."""
        return self.variants or (Variant("", np.arange(len(self.scenes)), self),)


@dataclass(frozen=True, eq=False)
class Variant:
    """One geometry of a sweep over numbers of the body or its meshes: its points share its mesh and
    factor.

    words:  its swept numbers, for messages
    places: (P,) its points in the sweep of the whole study, counted in C order
    study:  its study; None where the geometry is refused
    reason: why it is refused, in words
    """

    words: str
    places: NDArray[np.intp]
    study: Study | None
    reason: str = ""
