"""Files of many geometries: every record comes back to the bit, whatever the order of axes and
passes; files of version 0.8 are read, and grow into the new layout."""

import shutil
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import netCDF4
import numpy as np
import pytest
import xarray as xr

import tcstudy
from tcstudy.cli import main
from tcstudy.data import store
from tcstudy.data.bodies import StoredBody
from tcstudy.data.files import collect, program, put_seal
from tcstudy.data.reading import opened, read_blocks, read_level
from tcstudy.data.records import BlockRecord, LevelRecord
from tcstudy.data.schema import SOLUTION, PointStatus
from tcstudy.data.store import Results, numbers
from tcstudy.errors import DrawError, UsageError
from tcstudy.read.study import read_study_text
from tcstudy.scene.study import Study

OLD = Path(__file__).parent / "files_0_8"
"""Files of three geometries that version 0.8 wrote: a grid with a refused height, two levels and
fields; a list in which two points share a geometry."""
BARS = """
body: {rectangle: {width: 200 mm, height: 20 mm}}
boundary: {bottom: contact, left: clamped, right: free, top: {role: traction, g: [1 MPa, 0]}}
material: {E: 70 GPa, nu: 0.3, alpha_T: 1e-5}
heat: {theta: 20}
friction: {law: tresca, tau: 1 MPa}
mesh: {maxh: 20 mm, levels: 2}
output: {fields: true}
"""
SWEEPS = {
    "geometry axes apart": "{E: [1, 2, 3], "
    "body.rectangle.width: [1, 2, 3, 4], nu: [0.1, 0.2], mesh.maxh: [20 mm, 10 mm]}",
    "geometry axis first": "{body.rectangle.width: [1, 2, 3, 4, 5], E: [1, 2, 3]}",
    "one point a geometry": "{body.rectangle.width: [1, 2, 3, 4, 5]}",
    "scattered list": "{mode: list, points: ["
    + ", ".join(
        f"{{body.rectangle.width: {width}, E: {E}}}"
        for width, E in ((3, 1), (1, 1), (3, 2), (2, 1), (1, 2), (3, 3))
    )
    + "]}",
}


AT = {"grid": ["--at", "height=0.02"], "list": []}
"""Of files of version 0.8, labels of a point that is solved."""


class MadeUp:
    """Records of a study with random numbers: the last geometry is refused, the first has one level
    only, held ends and joints come and go."""

    def __init__(self, sweep: str) -> None:
        self.study = read_study_text(BARS, "s", [f"sweep={sweep}"])
        self.random = np.random.default_rng(7)
        count = len(self.study.variants)
        self.levels = {i: [*self.made_levels(i)] for i in range(count - 1)}
        self.blocks = {i: [*self.made_blocks(i)] for i in range(count - 1)}
        self.passes = 0

    def own(self, number: int) -> Study:
        """The study of a geometry."""
        own = self.study.variants[number].study
        assert own is not None
        return own

    def made_levels(self, number: int) -> Iterator[LevelRecord]:
        for level in range(1 if number == 0 else 2):
            m, n = (int(self.random.integers(2, 9)) << level for _ in range(2))
            line = {name: self.random.random(m) for name in ("arclength", "x", "y", "c")}
            fields: dict[str, Any] = {
                "node_x": self.random.random(n),
                "node_y": self.random.random(n),
                "triangle": self.random.integers(0, n, (n + 1, 3)).astype(np.int32),
            }
            if number % 2:
                for name in ("held_arclength", "held_x", "held_y"):
                    fields[name] = self.random.random(number % 3 + 1)
            if number % 3:
                fields |= {
                    "joint_node": np.arange(number % 3, dtype=np.int32),
                    "joint_edge": np.zeros(number % 3, dtype=np.int8),
                    "joint_share": self.random.random(number % 3),
                }
            yield LevelRecord(
                *(level, self.random.random(), 4 * n, m),
                **line,
                edge=(np.arange(m) % 2).astype(np.int8),
                edge_names=("film", "pad"),
                time_mesh=0.25,
                time_assemble=0.5,
                fields=fields,
            )

    def made_blocks(self, number: int) -> Iterator[BlockRecord]:
        own = self.own(number)
        points = len(own.scenes)
        for level in self.levels[number]:
            m, n = len(level.x), len(level.fields["node_x"])
            for places in np.array_split(self.random.permutation(points), min(2, points)):
                rows = len(places)
                along = {name: self.random.random((rows, m)) for name in ("u_T", "xi")}
                flags = self.random.integers(0, 2, (rows, m)).astype(np.int8)
                bodies = {name: self.random.random((rows, n)) for name in ("theta", "u_x", "u_y")}
                measured = {
                    v.name: self.random.random(rows)
                    for v in numbers(own)
                    if v.dtype == "f8" and len(v.dims) == 2
                }
                if "held_x" in level.fields:
                    ends = len(level.fields["held_x"])
                    measured["held_u_T"] = self.random.random((rows, ends))
                solutions = self.made_solutions(np.sort(places), m)
                status = np.full(rows, PointStatus.OK, dtype=np.int8)
                yield BlockRecord(
                    *(level.level, own.shape, places, status, {}, measured),
                    **along,
                    sticks=flags,
                    fields=bodies,
                    solutions=solutions,
                )

    def made_solutions(self, points: np.ndarray, m: int) -> dict[str, Any]:
        shapes = {False: (len(points),), True: (len(points), m)}
        every = {
            v.name: self.random.integers(0, 2, shapes["node" in v.dims]).astype(v.dtype)
            for v in SOLUTION
        }
        return every | {"solution_point": points.astype(np.int32)}

    def results(self, number: int) -> Results:
        def blocks() -> Iterator[BlockRecord]:
            self.passes += number == 0
            yield from self.blocks[number]

        return Results(self.own(number), lambda: self.levels[number], blocks)

    def write(self, path: Path) -> tuple[int, int]:
        refused = self.study.variants[-1].places
        status = np.full(len(refused), PointStatus.MESH_FAILED, dtype=np.int8)
        words = dict.fromkeys(range(len(refused)), "made to fail")
        failed = [
            BlockRecord(level, self.study.shape, refused, status, words, {}) for level in (0, 1)
        ]
        every = replace(self.study, solver=replace(self.study.solver, every=True))
        about = collect(self.study, ["tcstudy"])
        whole = Results(every, tuple, lambda: failed, about)
        return store.write(path, whole, {i: self.results(i) for i in self.levels})


def equal(one: Any, two: Any) -> bool:
    """Whether two records, or what they have, are equal to the bit."""
    if isinstance(one, dict):
        return one.keys() == two.keys() and all(equal(one[name], two[name]) for name in one)
    if isinstance(one, np.ndarray) and one.dtype.kind == "f":
        return one.dtype == two.dtype and np.array_equal(one, two, equal_nan=True)
    return bool(np.array_equal(one, two))


def by_place(blocks: list[BlockRecord]) -> dict[tuple[int, int], dict[str, Any]]:
    """What every point of blocks has, by level and place."""
    points: dict[tuple[int, int], dict[str, Any]] = {}
    for block in blocks:
        along = {"u_T": block.u_T, "xi": block.xi, "sticks": block.sticks}
        for row, place in enumerate(block.points.tolist()):
            own = {**along, **block.numbers, **block.fields}
            own = {name: rows[row] for name, rows in own.items() if rows is not None}
            mine = block.solutions.get("solution_point", np.empty(0)) == place
            own |= {name: array[mine] for name, array in block.solutions.items()}
            points[block.level, place] = own
    return points


@pytest.mark.parametrize("small", [False, True])
@pytest.mark.parametrize("sweep", SWEEPS.values(), ids=SWEEPS)
def test_all_records_come_back_to_the_bit(
    sweep: str, small: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Also in many chunks, and with little memory, in which a grid takes one pass all the same."""
    if small:
        monkeypatch.setattr(store, "CHUNK", 256)
        monkeypatch.setattr("tcstudy.data.variables.CHUNK", 256)
        monkeypatch.setattr("tcstudy.data.variables.MAX_CONTIGUOUS", 16)
        monkeypatch.setattr(store, "MAX_MEMORY", 2**14)
    made = MadeUp(sweep)
    every = made.study.mesh.levels * len(made.study.scenes)
    refused = 2 * len(made.study.variants[-1].places)
    sought, failed = made.write(tmp_path / "out.nc")
    assert (sought, failed) == (every - len(made.study.variants[0].places), refused)
    assert made.passes == 2  # one for the solutions, which are kept
    with opened(tmp_path / "out.nc") as nc:
        last = made.study.variants[-1].places
        assert (nc["status"][...].reshape(-1, 2)[last] == PointStatus.MESH_FAILED).all()
        assert (nc["geometry"][...].ravel()[last] == -1).all()
        for number, levels in made.levels.items():
            body, own = StoredBody.of(nc, number), made.own(number)
            stored = [read_level(body, level) for level in body.levels]
            assert [one.level for one in stored] == [one.level for one in levels]
            assert all(equal(vars(a), vars(b)) for a, b in zip(levels, stored, strict=True))
            wanted = np.ones((len(own.scenes), 2), dtype=bool)
            there = by_place([*read_blocks(body, own, np.arange(len(own.scenes)), wanted)])
            kept = by_place(made.blocks[number])
            assert there.keys() == kept.keys()
            for place, values in kept.items():
                assert all(equal(array, there[place][name]) for name, array in values.items())


def test_live_arrays_of_a_geometry_are_those_of_its_own_run(tmp_path: Path) -> None:
    """On both levels; those of the shorter contact line are padded."""
    widths = ("100 mm", "200 mm")
    options = ["output={live: true}", "sweep={nu: [0.3, 0.2]}"]
    for width in widths:
        study = read_study_text(BARS, "s", [*options, f"body.rectangle.width={width}"])
        tcstudy.run(study, tmp_path / f"{width}.nc")
    sweep = f"sweep={{body.rectangle.width: [{', '.join(widths)}], nu: [0.3, 0.2]}}"
    tcstudy.run(read_study_text(BARS, "s", [options[0], sweep]), tmp_path / "all.nc")
    for number, width in enumerate(widths):
        with opened(tmp_path / "all.nc") as nc, opened(tmp_path / f"{width}.nc") as alone:
            for group in ("level_0/live", "level_1/live"):
                for name, variable in alone[group].variables.items():
                    own = tuple(slice(n) for n in variable.shape)
                    values = nc[group][name][number][own]
                    np.testing.assert_array_equal(values, variable[...], name)


def as_new(file: Path, target: Path) -> Path:
    """Copy a file of version 0.8 as if this program had written it, so that it may grow."""
    shutil.copy(file, target)
    with netCDF4.Dataset(target, "a") as nc:
        nc.program = program()
    put_seal(target)
    return target


def of_points(file: Path, **labels: Any) -> list[xr.Dataset]:
    return [tcstudy.open_geometry(file, level, **labels) for level in levels_of(file)]


def levels_of(file: Path) -> range:
    with tcstudy.open_results(file) as tree:
        return range(tree.sizes["level"])


@pytest.mark.parametrize(
    ("name", "axis", "more"),
    [
        ("grid", "height", "sweep={E: [210 GPa, 70 GPa], parameters.height: [10 mm, 20 mm, 25 mm, 30 mm]}"),
        ("list", "width", "sweep={mode: list, points: [{body.rectangle.width: 300 mm, E: 70 GPa}]}"),
    ],
)  # fmt: skip
def test_files_of_version_0_8_grow_into_the_new_layout(
    name: str, axis: str, more: str, tmp_path: Path
) -> None:
    """What an old file has of its geometries stays to the bit."""
    old = OLD / f"{name}.nc"
    with tcstudy.open_results(old) as tree:
        text, numbers = tree.attrs["study_yaml"], tree["geometry"].load()
    file = as_new(old, tmp_path / "out.nc")
    grown = tcstudy.run(read_study_text(text, "s", [more]), file, append=True)
    assert grown.attrs["layout"] == 2
    assert not [group for group in grown.children if group.startswith("geometry_")]
    labels = {float(x) for x in numbers.where(numbers >= 0, drop=True)[axis].values}
    for label in labels:
        pairs = zip(of_points(old, **{axis: label}), of_points(file, **{axis: label}), strict=True)
        for before, after in pairs:
            xr.testing.assert_equal(before, after)
            assert before["edge"].attrs["flag_meanings"] == after["edge"].attrs["flag_meanings"]


def test_geometries_are_named_by_labels(tmp_path: Path) -> None:
    """One at a time, for Python and for --vtu, from old files as well; the others are refused in
    one line."""
    file = OLD / "grid.nc"
    body = tcstudy.open_geometry(file, height="20 mm")
    assert body["u_T"].dims == ("E", "node")
    assert body["triangle"].values.max() == body.sizes["mesh_node"] - 1
    assert float(body["height"]) == 0.02
    assert 'height="20 mm"' in body.attrs["overrides"]
    with pytest.raises(UsageError, match=r"are of 3 geometries.*for example height=0.02"):
        tcstudy.open_geometry(file, E=70e9)
    with pytest.raises(DrawError, match="has no mesh of level 1 of this geometry"):
        tcstudy.open_geometry(file, height="10 mm")
    with pytest.raises(UsageError, match=r"vtu: .*for example at height=0.02"):
        tcstudy.export(file, "vtu", tmp_path / "all")
    assert not (tmp_path / "all").exists()
    tcstudy.export(file, "vtu", tmp_path / "one", at={"height": 0.02})
    assert len([*(tmp_path / "one").glob("*.vtu")]) == 2


@pytest.mark.parametrize(
    "show",
    [
        lambda file, to: main(["show", str(file)]),
        lambda file, to: main(["report", str(file), "-o", str(to / "a.html")]),
        lambda file, to: main(
            ["draw", str(file), str(to / "a.png"), "--at", "E=70e9", *AT[file.stem]]
        ),
        lambda file, to: main(["export", str(file), "--csv", "-o", str(to / "a.csv")]),
    ],
)
@pytest.mark.parametrize("name", ["grid", "list"])
def test_files_of_version_0_8_are_shown_as_new_ones(
    name: str,
    show: Callable[[Path, Path], int],
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """A file and the same in the new layout have one summary, page, picture and table."""
    new = tmp_path / f"{name}.nc"
    file = as_new(OLD / f"{name}.nc", new)
    rewritten = shutil.copy(file, tmp_path / "rewritten")
    rewrite(rewritten)
    label_as(file, rewritten)
    said = []
    for _ in ("old", "new"):
        show(file, tmp_path)
        texts = [one.read_bytes() for one in sorted(tmp_path.glob("a.*"))]
        said.append((capsys.readouterr().out, texts))
        shutil.copy(rewritten, file)
    assert said[0] == said[1]


def label_as(old: Path, new: Path) -> None:
    """Give the variables of a file the labels that those of the same name have in a newer one."""
    labels = dict[str, dict[str, str]]()
    with netCDF4.Dataset(new) as nc:
        for group in _groups(nc):
            for name, variable in group.variables.items():
                texts = {key: variable.__dict__.get(key) for key in ("long_name", "comment")}
                labels.setdefault(name, {key: text for key, text in texts.items() if text})
    with netCDF4.Dataset(old, "a") as nc:
        for group in _groups(nc):
            for name, variable in group.variables.items():
                if "long_name" in variable.__dict__:
                    variable.setncatts(labels.get(name, {}))
    put_seal(old)


def _groups(nc: netCDF4.Dataset) -> Iterator[netCDF4.Dataset]:
    """Yield a group and all below it."""
    yield nc
    for group in nc.groups.values():
        yield from _groups(group)


def without_bounds(study: Study) -> Study:
    """Return a study of version 0.8, which did not bound λ₁ of the body."""
    variants = tuple(
        replace(variant, study=variant.study and without_bounds(variant.study))
        for variant in study.variants
    )
    return replace(study, mesh=replace(study.mesh, guarantee="none"), variants=variants)


def rewrite(file: Path) -> None:
    """Write the records of a file again."""
    from tcstudy.study.append import stored_study
    from tcstudy.study.stored import Kept

    study = without_bounds(stored_study(file))
    kept = Kept.of(file, study, study)
    with netCDF4.Dataset(file) as nc:
        about = {name: nc.getncattr(name) for name in nc.ncattrs() if name != "finished"}
        numbers = sorted({int(i) for i in nc["geometry"][...].ravel()} - {-1})
        reason = str(nc["reason"][...].ravel()[0])
    geometries = {
        i: Results(
            study.variants[i].study or study,
            lambda i=i: kept.levels(i),
            lambda i=i: kept.blocks(i),
        )
        for i in numbers
    }
    failed = []
    for i, variant in enumerate(study.variants):
        for level in range(study.mesh.levels) if i not in numbers else ():
            status = np.full(len(variant.places), PointStatus.MESH_FAILED, dtype=np.int8)
            words = dict.fromkeys(range(len(variant.places)), reason)
            failed.append(BlockRecord(level, study.shape, variant.places, status, words, {}))
    store.write(file, Results(study, tuple, lambda: failed, about), geometries, kept.close)
