"""Finished files that grow: what they have stays to the bit, only the rest is solved; what does not
fit is refused."""

from pathlib import Path

import numpy as np
import pytest
import xarray as xr

import tcstudy
from tcstudy.cli import main
from tcstudy.data.reading import places_in
from tcstudy.data.schema import PointStatus
from tcstudy.errors import StudyError
from tcstudy.laws.laws import Laws
from tcstudy.read.study import read_study_text
from tcstudy.study import level_solver
from tcstudy.study.append import differences, merge_studies
from tests.commands import CONFIGS
from tests.verification.scenes import RECTANGLE, study_of

TEXT = RECTANGLE.replace("maxh: 0.1, levels: 3", "maxh: 0.5, levels: 2").replace(
    "left: clamped, top: free", 'left: clamped, top: {role: traction, g: ["0.03*x", -0.01]}'
)
GRID = "sweep={E: [2, 1], tau: [0.01, 0.02]}"


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "study.yaml"
    path.write_text(TEXT)
    return path


def study(file: Path, sweep: str = GRID, *more: str) -> tcstudy.Study:
    return tcstudy.load(file, [sweep, *more])


def same(part: xr.DataTree, whole: xr.DataTree) -> None:
    """Every value of every point of a file stands in the other, to the bit."""
    for path in ("/", "/level_0", "/level_1"):
        one, two = part[path].to_dataset(), whole[path].to_dataset()
        if path != "/":
            one, two = (d.assign_coords(root.coords) for d, root in ((one, part), (two, whole)))
        for name, values in one.data_vars.items():
            other = two[name].sel({axis: one[axis] for axis in ("E", "tau") if axis in values.dims})
            xr.testing.assert_equal(
                values.drop_vars(list(values.coords)), other.drop_vars(list(other.coords))
            )


class Counted:
    """How many points are solved; a run is stopped after so many."""

    def __init__(
        self, monkeypatch: pytest.MonkeyPatch, fail_at: float = np.nan, most: float = np.inf
    ) -> None:
        self.points, self.most = 0, most
        original = level_solver.solve_block

        def solve(body: object, loads: np.ndarray, laws: Laws, *options: object) -> object:
            self.points += len(loads)
            if self.points > self.most:
                raise KeyboardInterrupt
            if np.any(laws.scales[laws.index] == fail_at):
                raise ArithmeticError("made to fail")
            return original(body, loads, laws, *options)  # type: ignore[arg-type]

        monkeypatch.setattr(level_solver, "solve_block", solve)


@pytest.mark.parametrize("more", ["output.fields=true", "solver.branch=continued"])
def test_append_solves_only_new_points(
    file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, more: str
) -> None:
    output, new = (
        tmp_path / "out.nc",
        study(file, "sweep={E: [2, 1, 1.5], tau: [0.01, 0.02]}", more),
    )
    old = tcstudy.run(study(file, GRID, more), output).tree  # the file grows
    counted = Counted(monkeypatch)
    tree = tcstudy.run(new, output, append=True)
    assert counted.points == 2 * 2
    same(old, tree)
    assert np.all(tree["status"] == int(PointStatus.OK))
    whole = tcstudy.run(new, tmp_path / "whole.nc")
    for name in ("energy", "u_T_max", "friction_resultant", "lambda_1"):
        np.testing.assert_allclose(tree[name].values, whole[name].values, rtol=1e-10)
    assert tree.attrs["history"].count("\n") == 1
    counted.points = 0
    assert tcstudy.run(new, output)["status"].identical(
        tree["status"]
    )  # it holds the study's results
    assert counted.points == 0
    assert not output.with_name("out.nc.partial").exists()


def test_append_of_other_values_makes_the_grid_of_all(
    file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    output = tmp_path / "out.nc"
    old = tcstudy.run(study(file), output).tree  # the file grows
    counted = Counted(monkeypatch)
    tree = tcstudy.run(study(file, "sweep={E: [4], tau: [0.03]}"), output, append=True)
    same(old, tree)
    assert tree["status"].shape == (3, 3, 2)
    assert np.all(tree["status"] == int(PointStatus.OK))
    again = tcstudy.load(
        file, tree.attrs["overrides"].split("\n")
    )  # the file says which study it holds
    assert tcstudy.run(again, output)["status"].identical(tree["status"])
    assert counted.points == 5 * 2


RANGE = "{linspace: [0.1 um, 0.7 um, 7]}"
LISTED = [f"0.{n} um" for n in range(1, 8)]


@pytest.mark.parametrize(
    "equal", ["{linspace: [100 nm, 7e-4 mm, 7]}", f"[{', '.join(LISTED)}]", f"[{LISTED[2]}]"]
)
def test_equal_values_append_nothing_however_they_are_written(equal: str) -> None:
    """A range has the values of NumPy, which differ from those of a list by rounding."""
    text = TEXT.replace("units: none", "").replace("0.01}", "1 MPa}", 1)
    law = "friction={law: slip-weakening, tau_s: 2 MPa, tau_k: 1 MPa, delta: 1 um}"
    old, new = (
        read_study_text(text, "s", [law.replace(", delta: 1 um", ""), f"sweep={{delta: {values}}}"])
        for values in (RANGE, equal)
    )
    assert old.axes[0].labels == tuple(np.linspace(1e-7, 7e-7, 7))
    assert merge_studies(old, new).axes[0].labels == old.axes[0].labels


def test_a_run_solves_again_what_broke_down(
    file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Stopped in the middle it leaves the old file and goes on from there."""
    output = tmp_path / "out.nc"
    with monkeypatch.context() as patch:
        Counted(patch, fail_at=0.02)
        old = tcstudy.run(study(file), output).tree  # the file grows
    assert old["status"].values[:, :, 0].tolist() == [[1, int(PointStatus.ERROR)]] * 2
    assert set(old["reason"].sel(tau=0.02).values.ravel()) == {"ArithmeticError: made to fail"}
    assert np.isnan(old["energy"].sel(tau=0.02)).all()
    before = output.read_bytes()
    monkeypatch.setattr(level_solver, "MAX_POINTS", 1)
    with monkeypatch.context() as patch:
        Counted(patch, most=2)
        with pytest.raises(KeyboardInterrupt):
            tcstudy.run(study(file), output, jobs=1)
    assert output.read_bytes() == before
    counted = Counted(monkeypatch)
    tree = tcstudy.run(study(file), output)
    assert counted.points == 2  # two of four were finished
    assert np.all(tree["status"] == int(PointStatus.OK))
    assert set(tree["reason"].values.ravel()) == {""}
    xr.testing.assert_equal(*(path.to_dataset().isel(tau=[0]) for path in (old, tree)))
    assert np.array_equal(old["level_1"]["u_T"].values[:, 0], tree["level_1"]["u_T"].values[:, 0])
    before = output.read_bytes()
    tcstudy.run(study(file), output)
    assert (counted.points, output.read_bytes()) == (2, before)
    assert {path.name for path in tmp_path.iterdir()} == {"study.yaml", "out.nc"}


def test_what_does_not_fit_is_refused_in_one_line(
    file: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    output, words = file.with_name("out.nc"), ["run", str(file), "--set", "sweep.E=[2, 1]"]
    file.write_text(TEXT + "sweep: {E: [1], tau: [0.01, 0.02]}\n")
    assert main([*words, "--output", str(output)]) == 0
    before = output.read_bytes()
    capsys.readouterr()
    for more, said in (
        (["--set", "material.nu=0.2"], "material.nu was 0.3, is 0.2"),
        (["--set", "mesh={maxh: 0.5, tolerance: 0.1}"], "mesh.tolerance was absent, is 0.1"),
        (["--force"], "give one of these"),
        (["--output", str(file.with_name("none.nc"))], "there is no file"),
    ):
        with pytest.raises(SystemExit) as stop:
            main([*words, "--output", str(output), "--append", *more])
        assert stop.value.code == 2
        (line,) = capsys.readouterr().err.strip().splitlines()
        assert said in line
        assert output.read_bytes() == before
        assert {path.name for path in file.parent.iterdir()} == {"study.yaml", "out.nc"}


SI = RECTANGLE.replace("units: none", "units: SI").replace("tau: 0.01", "tau: 50 kPa")
SI_1 = "sweep={E: [1 GPa, 2 GPa]}"
HALF = SI.replace("50 kPa", "half") + "parameters: {half: 50 kPa}\n"
HARD = "sweep={friction: {soft: {law: tresca, tau: 0.01}, hard: {law: tresca, tau: 0.02}}}"


@pytest.mark.parametrize(
    ("text", "first", "second", "lines"),
    [
        (SI, [SI_1], ["sweep={E: [3 GPa]}", "title=Another", "output=elsewhere.nc"], []),
        (SI, [SI_1], [SI_1, "friction.tau=60 kPa", "mesh.levels=2"],
         ["friction.tau was 50 kPa, is 60 kPa", "mesh.levels was 3, is 2"]),
        (HALF, ["sweep={half: [1 Pa, 2 Pa]}"], ["sweep={half: [3 Pa]}"], []),
        (SI, [SI_1], ["sweep={nu: [0.1]}"], ["swept parameters were material.E, are material.nu"]),
        (SI, [SI_1], [SI_1, "solver.tolerance=1e-9"], ["solver.tolerance was absent, is 1e-09"]),
        (RECTANGLE, [HARD], [HARD.replace("0.02", "0.03")],
         ['friction.hard was {"law": "tresca", "tau": 0.02}, is {"law": "tresca", "tau": 0.03}']),
    ],
)  # fmt: skip
def test_what_differs_is_said_by_key_in_the_words_of_both(
    text: str, first: list[str], second: list[str], lines: list[str]
) -> None:
    """A law of one name must be one law, too."""
    assert differences(study_of(text, *first), study_of(text, *second)) == lines


def test_the_union_of_grids_is_the_grid_of_all_values() -> None:
    old = study_of(RECTANGLE, "sweep={E: [1, 2], tau: [0.01, 0.02]}")
    new = study_of(RECTANGLE, "sweep={tau: [0.03], E: [2, 1.5]}")
    both = merge_studies(old, new)
    assert [(axis.name, axis.labels) for axis in both.axes] == [
        ("E", (1.0, 1.5, 2.0)),
        ("tau", (0.01, 0.02, 0.03)),
    ]
    assert [places_in(both, one).tolist() for one in (old, new)] == [[0, 1, 6, 7], [8, 5]]
    for study in (old, new):
        for place, scene in zip(places_in(both, study), study.scenes, strict=True):
            assert both.scenes[int(place)] == scene
    assert places_in(old, new).tolist() == [-1, -1]


@pytest.mark.parametrize(
    ("old", "new"),
    [("[20 kPa, 70 kPa]", "{geomspace: [0.03 MPa, 0.1 MPa, 3]}"), ("[20 psi, 0]", "[30000]")],
)
@pytest.mark.parametrize("mode", ["", "mode: zip, "])
def test_the_union_has_the_numbers_of_both_in_their_units(old: str, new: str, mode: str) -> None:
    """The same to the bit, also when the union grows."""
    one, two = (study_of(SI, f"sweep={{{mode}tau: {values}}}") for values in (old, new))
    both = merge_studies(one, two)
    (axis,) = both.axes
    assert sorted(axis.labels) == sorted((*one.axes[0].labels, *two.axes[0].labels))
    again = merge_studies(
        read_study_text(both.text, "file", both.overrides),
        study_of(SI, f"sweep={{{mode}tau: [5]}}"),
    )
    assert sorted(again.axes[0].labels) == sorted((*axis.labels, 5.0))


@pytest.mark.parametrize("grid", [True, False])
def test_the_union_with_a_list_is_a_list(grid: bool) -> None:
    first = "{E: [1, 2], tau: [0.02]}" if grid else "{mode: zip, E: [1, 2], tau: [0.02, 0.02]}"
    old = study_of(RECTANGLE, f"sweep={first}")
    new = study_of(RECTANGLE, "sweep={mode: list, points: [{tau: 0.02, E: 2}, {tau: 0.03, E: 4}]}")
    both = merge_studies(old, new)
    assert both.mode == "list"
    assert [axis.labels for axis in both.axes] == [(1.0, 2.0, 4.0), (0.02, 0.02, 0.03)]
    assert [places_in(both, one).tolist() for one in (old, new)] == [[0, 1], [1, 2]]


def test_a_grid_that_would_be_too_large_is_refused() -> None:
    grids = (
        "E: {linspace: [1, 2, 1000]}, tau: [0.01]",
        "E: [3], tau: {linspace: [0.02, 0.03, 1000]}",
    )
    with pytest.raises(StudyError, match="1002001 points"):
        merge_studies(*(study_of(RECTANGLE, f"sweep={{{grid}}}") for grid in grids))


def test_materials_and_laws_by_name_keep_their_names() -> None:
    """Also those of a region and of one edge; lists as well as grids."""
    text = (CONFIGS / "coated_block.yaml").read_text().split("sweep:")[0]
    text = text.replace("{law: tresca, tau: 5 MPa}", "{bottom: {law: tresca, tau: 5 MPa}}")
    coating = "materials.coating: {NAME: {E: NAME GPa, nu: 0.3}}, friction.bottom: {low: {law: tresca, tau: 1 MPa}}"
    old, new = (
        study_of(text, f"sweep={{{coating.replace('NAME', name)}}}") for name in ("200", "3")
    )
    both = merge_studies(old, new)
    assert [axis.labels for axis in both.axes] == [("200", "3"), ("low",)]
    assert [both.scenes[int(places_in(both, one)[0])] == one.scenes[0] for one in (old, new)] == [
        True,
        True,
    ]
    listed = study_of(text, "sweep={mode: zip, " + coating.replace("NAME", "70") + "}")
    assert [axis.labels for axis in merge_studies(both, listed).axes] == [
        ("200", "3", "70"),
        ("low",) * 3,
    ]
