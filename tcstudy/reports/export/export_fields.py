"""The fields of a run for ParaView: every sweep point's body (VTU) and contact line (VTP), and one PVD for the sweep.

The body has the displacement u and the temperature theta at its nodes, as stored, and in its triangles, where the
strain ε of P1 elements is constant,

    σ = cε − βθI (eq. (3) of the paper, θ the mean of the corners),   w = ½ σ : c⁻¹ σ,   von Mises' stress √(3/2 s : s)

with σ_zz = λ tr ε − βθ in plane strain and 0 in plane stress; c, β are those of the point. The contact line has u_T,
xi = −S_T, c and what every node does. Time in the PVD is the number of the point in the sweep, in the order of the
file; parameters stand in the names and, in full, in the field data of every file.

Left out: jumps of the stress between elements (no averaging); the ends of a line without unknown.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tcstudy.data.provenance import kind_of
from tcstudy.data.reading import by_point, each_point, reading, refuse_geometries
from tcstudy.data.records import PointStatus
from tcstudy.data.schema import STICKS
from tcstudy.data.store import open_results
from tcstudy.errors import UsageError
from tcstudy.laws.composed import each
from tcstudy.reports.export.vtk_files import SYMMETRIC, Grid, Values, write_collection, write_lines, write_mesh
from tcstudy.reports.picture import BodyFields, body_fields, contact_line
from tcstudy.reports.select_point import Value, labels, level_number, matching
from tcstudy.reports.stored_study import file_order, law_of_nodes, stored_study
from tcstudy.scene.contact_states import ContactState, node_states
from tcstudy.scene.records import Material
from tcstudy.scene.study import Study

Array = NDArray[np.float64]

HOW = "run its study again with --set output.fields=true to keep them"
BODY, LINE = 0, 1
LONGEST = 120
"""Characters of a file's name: more parameters than that are in the file alone."""


@dataclass(frozen=True)
class Exported:
    """What was written: the PVD, how many points it has, and what is missing, a sentence each."""

    path: Path
    points: int
    lacks: tuple[str, ...]


def write_fields(path: Path, folder: Path, point: Mapping[str, Value] | None = None, level: int = -1) -> Exported:
    """Write the fields of a run's points on one level into a folder; the PVD comes last.

    point: labels of swept parameters, only the points that have them;  level: −1 is the finest

    Raises StoreError if `path` is no result file or a file cannot be written, DrawError for a point or level that
    there is not, UsageError for a file of another kind.
    """
    if (kind := kind_of(path)) != "run":
        raise UsageError(f"--vtu: {path} is a file of tcstudy {kind} and has no fields; name that of a run")
    with reading(path), open_results(path) as tree:
        root = tree.to_dataset()
        refuse_geometries(root.attrs, "--vtu")
        n = level_number(root, level)
        if f"level_{n}" not in tree.children:
            raise UsageError(f"--vtu: {path} has no mesh of level {n}; see the reasons with: tcstudy show")
        group, study = tree[f"level_{n}"].to_dataset(), stored_study(root)
        points, wanted = each_point(root), matching(root, point or {})
        solved = by_point(root["status"], root)[:, n] == PointStatus.OK
        scenes = None if study is None else (study, file_order(study))
        files: list[tuple[int, int, str, str]] = []
        for i in np.flatnonzero(wanted & solved):
            at = group.isel(points[i])
            files += _write_point(path.stem, folder, int(i), labels(root, points[i]), at, scenes)
        pvd = folder / f"{path.stem}.pvd"
        write_collection(pvd, files)
    lacks = []
    if "u_x" not in group:
        lacks.append(f"the file has no fields of the body, so only contact lines were written; {HOW}")
    elif study is None:
        lacks.append("the study in the file cannot be read here (its geometry is elsewhere), so stresses are left out")
    if missing := int(np.count_nonzero(wanted & ~solved)):
        lacks.append(f"{missing} of {np.count_nonzero(wanted)} points have no solution on level {n}")
    return Exported(pvd, int(np.count_nonzero(wanted & solved)), tuple(lacks))


Scenes = tuple[Study, list[int]]
Label = tuple[str, float | str, str]


def _write_point(
    stem: str, folder: Path, i: int, point: list[Label], group: Any, scenes: Scenes | None
) -> Iterator[tuple[int, int, str, str]]:
    """Write a point's body, if there is one, and its contact line."""
    name = _file_name(f"{stem}_{i:04d}", point)
    about = tuple(
        Values(key, label if isinstance(label, str) else np.array([label]), unit) for key, label, unit in point
    )
    scene = None if scenes is None else scenes[0].scenes[scenes[1][i]]
    if (body := body_fields(group)) is not None:
        units = {name: str(group[name].attrs.get("units", "1")) for name in ("u_x", "theta", "xi") if name in group}
        region = group["region"].values if "region" in group else None
        write_mesh(folder / f"{name}.vtu", _body(body, None if scene is None else scene.material, units, about, region))
        yield i, BODY, "body", f"{name}.vtu"
    sticks = group["sticks"].values == STICKS
    law = None if scene is None else law_of_nodes(scene.friction, group)
    states = sticks.astype(np.int8) if law is None else each(law, node_states, group["u_T"].values, sticks)
    words = ("slip", "stick") if law is None else tuple(state.name.lower() for state in ContactState)
    write_lines(folder / f"{name}.vtp", _line(group, states, words, about))
    yield i, LINE, "contact line", f"{name}.vtp"


def _file_name(start: str, point: list[Label]) -> str:
    """The start, and parameters as long as there is room: "plate_0003_alpha-25_friction-tresca"."""
    for key, label, _ in point:
        text = label if isinstance(label, str) else f"{label:.6g}"
        part = "_" + re.sub(r"[^\w.+-]", "_", f"{key}-{text}", flags=re.ASCII)
        if len(start) + len(part) > LONGEST:
            break
        start += part
    return start


def _body(
    body: BodyFields,
    material: Material | None,
    units: dict[str, str],
    about: tuple[Values, ...],
    region: NDArray[np.int8] | None,
) -> Grid:
    u = np.column_stack([body.u_x, body.u_y, np.zeros(len(body.x))])
    fields = [Values("u", u, units["u_x"], ("x", "y", "z"))]
    if body.theta is not None:
        fields.append(Values("theta", body.theta, units["theta"]))
    cells: tuple[Values, ...] = ()
    if material is not None:
        sigma, energy = stresses(body, material, region)
        pressure, density = units["xi"], "1" if units["xi"] == "1" else "J m-3"
        cells = (
            Values("stress", sigma, pressure, SYMMETRIC),
            Values("von_mises", von_mises(sigma), pressure),
            Values("energy_density", energy, density),
            *(() if region is None else (Values("region", region),)),
        )
    return Grid(np.column_stack([body.x, body.y]), body.triangles, tuple(fields), cells, about)


def stresses(body: BodyFields, material: Material, region: NDArray[np.int8] | None = None) -> tuple[Array, Array]:
    """Stress (t, 6) in the order of SYMMETRIC and elastic density ½ σ : c⁻¹ σ (t,) of triangles [Pa, J/m³].

    region: (t,) where materials differ, 0 for that of the body, i for that of the i-th region
    """
    of = np.zeros(len(body.triangles), dtype=np.intp) if region is None else region
    lam, mu, beta, nu, E = np.array([(m.lam, m.mu, m.beta, m.nu, m.E) for m in material.all])[of].T
    x, y = body.x[body.triangles], body.y[body.triangles]
    b, d = np.roll(y, -1, axis=1) - np.roll(y, 1, axis=1), np.roll(x, 1, axis=1) - np.roll(x, -1, axis=1)
    twice = np.sum(x * b, axis=1)  # 2 × area; its sign goes with the order of the corners, as that of b and d
    u, v = body.u_x[body.triangles], body.u_y[body.triangles]
    e_xx, e_yy = np.sum(u * b, axis=1) / twice, np.sum(v * d, axis=1) / twice
    e_xy = 0.5 * (np.sum(u * d, axis=1) + np.sum(v * b, axis=1)) / twice
    theta = np.zeros(len(x)) if body.theta is None else np.mean(body.theta[body.triangles], axis=1)
    lateral = lam * (e_xx + e_yy) - beta * theta
    sigma = np.zeros((len(x), 6))
    sigma[:, 0], sigma[:, 1] = lateral + 2.0 * mu * e_xx, lateral + 2.0 * mu * e_yy
    sigma[:, 2] = lateral if material.plane == "strain" else 0.0
    sigma[:, 3] = 2.0 * mu * e_xy
    square = np.sum(sigma[:, :3] ** 2, axis=1) + 2.0 * np.sum(sigma[:, 3:] ** 2, axis=1)
    trace = np.sum(sigma[:, :3], axis=1)
    return sigma, 0.5 * ((1.0 + nu) * square - nu * trace**2) / E


def von_mises(sigma: Array) -> Array:
    """√(3/2 s : s) of the deviators s of stresses (t, 6)."""
    deviator = sigma[:, :3] - np.mean(sigma[:, :3], axis=1, keepdims=True)
    square = np.sum(deviator**2, axis=1) + 2.0 * np.sum(sigma[:, 3:] ** 2, axis=1)
    return np.asarray(np.sqrt(1.5 * square))


def _line(group: Any, states: NDArray[np.int8], words: tuple[str, ...], about: tuple[Values, ...]) -> Grid:
    """The contact line, a chain of nodes for each of its parts."""
    line = contact_line(group)
    chains = [
        np.append(np.arange(part.start, part.stop), [part.start] if line.closed(part) else []).astype(np.intp)
        for part in line.parts
    ]
    units = {name: str(group[name].attrs.get("units", "1")) for name in ("u_T", "xi", "arclength", "c")}
    fields = [Values(name, group[name].values, unit) for name, unit in units.items()]
    meaning = ", ".join(f"{code} {word}" for code, word in enumerate(words))
    return Grid(
        np.column_stack([line.x, line.y]),
        chains,
        (*fields, Values("state", states)),
        (),
        (*about, Values("state_meanings", meaning)),
    )
