"""Studies that differ only in their sweep: what else differs is said; the union has every point once."""

from __future__ import annotations

import numpy as np
import pytest

from tcstudy.errors import StoreError
from tcstudy.read.study import read_study_text
from tcstudy.study.append import differences, merge_studies, places_in
from tests.commands import CONFIGS
from tests.verification.scenes import RECTANGLE, study_of

SI = RECTANGLE.replace("units: none", "units: SI").replace("tau: 0.01", "tau: 50 kPa")
LAWS = "sweep={friction: {soft: {law: tresca, tau: 0.01}, hard: {law: tresca, tau: 0.02}}}"


def test_what_differs_is_said_by_key_in_the_words_of_both() -> None:
    one = study_of(SI, "sweep={E: [1 GPa, 2 GPa]}")
    assert differences(one, study_of(SI, "sweep={E: [3 GPa]}", "title=Another", "output=elsewhere.nc")) == []
    assert differences(one, study_of(SI, "sweep={E: [3 GPa]}", "friction.tau=60 kPa", "mesh.levels=2")) == [
        "friction.tau: 50 kPa | 60 kPa",
        "mesh.levels: 3 | 2",
    ]
    assert differences(one, study_of(SI, "sweep={nu: [0.1]}")) == ["swept parameters: material.E | material.nu"]
    assert differences(one, study_of(SI, "sweep={E: [3 GPa]}", "solver.tolerance=1e-9")) == [
        "solver.tolerance: not given | 1e-09"
    ]


def test_a_law_of_one_name_must_be_one_law() -> None:
    other = LAWS.replace("tau: 0.02", "tau: 0.03")
    assert differences(study_of(RECTANGLE, LAWS), study_of(RECTANGLE, LAWS)) == []
    (line,) = differences(study_of(RECTANGLE, LAWS), study_of(RECTANGLE, other))
    assert line.startswith("friction.hard: ")
    assert "0.02" in line
    assert "0.03" in line


def test_the_sizes_in_a_sweep_are_compared() -> None:
    text = RECTANGLE.replace("mesh: {maxh: 0.1, levels: 3}\n", "")
    one, two = (study_of(text, f"sweep={{E: [1], h: [0.5, {h}]}}") for h in (0.25, 0.2))
    assert differences(one, two) == ["sweep.h[1]: 0.25 | 0.2"]
    both = merge_studies(one, study_of(text, "sweep={E: [2], h: [0.5, 0.25]}"))
    assert both.mesh.maxh == (0.5, 0.25)


def test_the_union_of_grids_is_the_grid_of_all_values() -> None:
    old = study_of(RECTANGLE, "sweep={E: [1, 2], tau: [0.01, 0.02]}")
    new = study_of(RECTANGLE, "sweep={tau: [0.03], E: [2, 1.5]}")
    both = merge_studies(old, new)
    assert [(axis.name, axis.labels) for axis in both.axes] == [
        ("E", (1.0, 1.5, 2.0)),
        ("tau", (0.01, 0.02, 0.03)),
    ]
    assert places_in(both, old).tolist() == [0, 1, 6, 7]
    assert places_in(both, new).tolist() == [8, 5]
    for study in (old, new):
        for place, scene in zip(places_in(both, study), study.scenes, strict=True):
            assert both.scenes[int(place)] == scene
    assert places_in(old, new).tolist() == [-1, -1]


@pytest.mark.parametrize(
    ("old", "new", "unit", "size"),
    [
        ("{linspace: [20 kPa, 70 kPa, 4]}", "[80 kPa]", "kPa", 1e3),
        ("[20 kPa, 70 kPa]", "{geomspace: [0.03 MPa, 0.1 MPa, 3]}", "MPa", 1e6),
        ("[20 psi, 0]", "[30000]", "psi", 6894.75729316836),
    ],
)
@pytest.mark.parametrize("mode", ["", "mode: zip, "])
def test_the_union_keeps_the_unit_of_the_newer_study(old: str, new: str, unit: str, size: float, mode: str) -> None:
    """The numbers are the same to the bit, and the study that a file holds has the unit as well."""
    one, two = (study_of(SI, f"sweep={{{mode}tau: {values}}}") for values in (old, new))
    both = merge_studies(one, two)
    (axis,) = both.axes
    assert axis.written == (unit, size)
    assert sorted(axis.labels) == sorted((*one.axes[0].labels, *two.axes[0].labels))
    again = merge_studies(read_study_text(both.text, "file", both.overrides), study_of(SI, f"sweep={{{mode}tau: [5]}}"))
    assert again.axes[0].written == (unit, size)
    assert sorted(again.axes[0].labels) == sorted((*axis.labels, 5.0))


@pytest.mark.parametrize("grid", [True, False])
def test_the_union_with_a_list_is_a_list(grid: bool) -> None:
    first = "{E: [1, 2], tau: [0.02]}" if grid else "{mode: zip, E: [1, 2], tau: [0.02, 0.02]}"
    old = study_of(RECTANGLE, f"sweep={first}")
    new = study_of(RECTANGLE, "sweep={mode: list, points: [{tau: 0.02, E: 2}, {tau: 0.03, E: 4}]}")
    both = merge_studies(old, new)
    assert both.mode == "list"
    assert [axis.labels for axis in both.axes] == [(1.0, 2.0, 4.0), (0.02, 0.02, 0.03)]
    assert places_in(both, new).tolist() == [1, 2]
    assert np.array_equal(places_in(both, old), [0, 1])


def test_a_grid_that_would_be_too_large_is_refused() -> None:
    wide = "sweep={E: {linspace: [1, 2, 1000]}, tau: [0.01]}"
    high = "sweep={E: [3], tau: {linspace: [0.02, 0.03, 1000]}}"
    with pytest.raises(StoreError, match="1002001 points"):
        merge_studies(study_of(RECTANGLE, wide), study_of(RECTANGLE, high))


def test_materials_and_laws_by_name_keep_their_names() -> None:
    """Also those of a region and of one edge; lists as well as grids."""
    text = (CONFIGS / "coated_block.yaml").read_text().split("sweep:")[0]
    text = text.replace("{law: tresca, tau: 5 MPa}", "{bottom: {law: tresca, tau: 5 MPa}}")
    coating = "materials.coating: {NAME: {E: NAME GPa, nu: 0.3}}, friction.bottom: {low: {law: tresca, tau: 1 MPa}}"
    old, new = (study_of(text, f"sweep={{{coating.replace('NAME', name)}}}") for name in ("200", "3"))
    both = merge_studies(old, new)
    assert [axis.labels for axis in both.axes] == [("200", "3"), ("low",)]
    assert [both.scenes[int(places_in(both, one)[0])] == one.scenes[0] for one in (old, new)] == [True, True]
    listed = study_of(text, "sweep={mode: zip, " + coating.replace("NAME", "70") + "}")
    assert [axis.labels for axis in merge_studies(both, listed).axes] == [("200", "3", "70"), ("low",) * 3]
