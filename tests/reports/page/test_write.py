"""What stands in a page, how large it is, and what is refused; numbers come out of it as they went
in."""

import base64
import hashlib
import html
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr

import tcstudy
from tcstudy.cli import main
from tcstudy.data.reading import by_point
from tcstudy.errors import PageError
from tcstudy.laws.shapes import SHAPES
from tcstudy.read.study import read_study_text
from tcstudy.reports.figures.body import ROLES
from tcstudy.reports.page import write
from tcstudy.reports.page.parts import Container
from tcstudy.reports.page.run import drawn_law
from tcstudy.reports.page.stored import read
from tcstudy.reports.page.write import write_page
from tcstudy.reports.terminal.paths import STATES
from tcstudy.scene.contact_states import ContactState
from tests.reports.conftest import FILMS, Stored
from tests.reports.figures.shown import example_laws
from tests.reports.page.browser import data_of, unpacked


def values_of(rows: Any) -> Any:
    return rows["rows"] * rows["scale"][:, None]


def check_slip(line: Any, slip: Any) -> None:
    assert np.max(np.abs(values_of(line["u_T"]) - slip)) <= 1e-4 * np.max(np.abs(slip))


def test_a_page_needs_nothing_from_outside_and_has_the_numbers_of_every_point_and_level(
    stored: Stored, capsys: pytest.CaptureFixture[str]
) -> None:
    page = stored("block").with_suffix(".html")
    assert main(["report", str(stored("block"))]) == 0
    assert capsys.readouterr().out.startswith(f"{page}: ")
    text = page.read_text(encoding="utf-8")
    for word in ("src=", "href=", "@import", "http://", "https://"):
        assert word not in text.replace("http://www.w3.org/2000/svg", ""), word
    assert all(
        words in text
        for words in ("A block &lt;on&gt; a film", "<dt>Solved</dt><dd>6 of 6 points, 2 levels")
    )
    assert text.rstrip().endswith("</html>")
    found = data_of(page)
    with xr.open_datatree(stored("block")) as tree:
        energy, level = tree["energy"].values, tree["level_1"].to_dataset().load()
    np.testing.assert_array_equal(found["run"]["numbers"]["energy"]["v"], energy.reshape(6, 2))
    assert found["run"]["shape"] == [3, 2]
    assert [axis["name"] for axis in found["run"]["axes"]] == ["theta_bar", "friction"]
    line, u, sticks = (
        found["lines"]["1"],
        level["u_T"].values.reshape(6, -1),
        level["sticks"].values.reshape(6, -1),
    )
    check_slip(line, u)
    # the page draws what the law says of every node; it has no rule of its own
    assert found["states"] == list(STATES)
    plain, weak = line["state"][0::2], line["state"][1::2]
    assert set(np.unique(plain)) == {ContactState.STICK, ContactState.SLIP}
    expected = np.where(np.abs(u[1::2]) < 40e-6, ContactState.SOFTEN, ContactState.WEAKENED)
    np.testing.assert_array_equal(weak, np.where(sticks[1::2] == 1, ContactState.STICK, expected))
    assert set(np.unique(weak)) == {ContactState.STICK, ContactState.SOFTEN, ContactState.WEAKENED}
    assert [part["held"] for part in line["parts"]] == [[True, False]]
    roles = {edge["name"]: edge["role"] for edge in found["outline"]}
    assert roles == {"film": "contact", "back": "clamped", "top": "convection", "end": "traction"}
    mesh = found["body"]
    at_end = [found["outline"][i]["name"] == "end" for i in mesh["edge"]]
    np.testing.assert_array_equal(at_end, mesh["x"][mesh["boundary"]].mean(axis=1) > 0.2 - 1e-6)


SMALL = """
units: none
body: {rectangle: {width: 2, height: 1}}
boundary: {bottom: contact, left: clamped, top: {role: traction, g: [0.02, 0]}, right: free}
material: {E: 1, nu: 0.3}
friction: {law: tresca, tau: 0.01}
mesh: {maxh: 1}
"""


def test_a_text_that_is_a_mark_stays_a_text_and_the_script_alone_is_allowed(tmp_path: Path) -> None:
    marks = "/*scripts*/ <!--data--> /*style*/ /*hash*/"
    study = read_study_text(f"title: '{marks}'\n{SMALL}")
    tcstudy.run(study, tmp_path / "run.nc", jobs=1)
    page = write_page(tmp_path / "run.nc", tmp_path / "run.html").path.read_text(encoding="utf-8")
    assert f"<h1>{html.escape(marks)}</h1>" in page
    [script] = re.findall("<script>(.*?)</script>", page, re.DOTALL)
    digest = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()
    policy = re.search('Content-Security-Policy" content="([^"]*)"', page)[1]
    assert f"script-src 'sha256-{digest}';" in policy
    assert policy.endswith("base-uri 'none'; form-action 'none'")


def test_axes_follow_the_sweep_and_counts_that_are_missing_are_not_shown(tmp_path: Path) -> None:
    sweep = "sweep: {friction.tau: {geomspace: [0.001, 0.1, 3]}, E: {linspace: [1, 2, 3]}}"
    tcstudy.run(read_study_text(SMALL + sweep), tmp_path / "run.nc", jobs=1)
    run = data_of(write_page(tmp_path / "run.nc", tmp_path / "run.html").path)["run"]
    assert [axis["log"] for axis in run["axes"]] == [True, False]
    with xr.open_dataset(tmp_path / "run.nc", mask_and_scale=False) as data:
        assert (data["evaluations"] == -1).all()
    assert "evaluations" not in run["numbers"]


def test_of_too_many_points_some_are_kept_and_it_is_said(
    stored: Stored, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(
        "tcstudy.reports.page.stored.MAX_SOLUTIONS", 9
    )  # of six points on two levels
    found = data_of(write_page(stored("block"), tmp_path / "few.html").path)
    assert found["run"]["shape"] == [2, 2]
    with xr.open_datatree(stored("block")) as tree:
        np.testing.assert_array_equal(
            found["run"]["numbers"]["energy"]["v"], tree["energy"].values[::2].reshape(4, 2)
        )
        check_slip(found["lines"]["1"], tree["level_1"]["u_T"].values[::2].reshape(4, -1))
    assert [found["laws"]["laws"][i]["name"] for (i,) in found["laws"]["index"]] == [
        "tresca",
        "slip-weakening",
    ] * 2
    assert "shown are 4 of the 6 points" in found["verdict"]["how"]
    monkeypatch.setattr("tcstudy.reports.page.stored.MAX_SCENES", 5)
    bare = data_of(write_page(stored("block"), tmp_path / "bare.html").path)
    assert bare["laws"] is None
    assert [edge["role"] for edge in bare["outline"]] == [edge["role"] for edge in found["outline"]]


def test_what_is_too_large_is_left_out_in_order_and_said_and_then_refused(
    stored: Stored,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    full = write_page(stored("block"), tmp_path / "page.html")
    monkeypatch.setattr(write, "AIM", full.size - 1)
    less = write_page(stored("block"), tmp_path / "page.html")
    assert less.left_out == ("levels",)
    assert less.size < full.size
    assert list(data_of(less.path)["lines"]) == ["1"]
    monkeypatch.setattr(write, "AIM", 1)
    monkeypatch.setattr(write, "MOST", 10)
    with pytest.raises(PageError, match="split the sweep"):
        write_page(stored("block"), tmp_path / "none.html")
    assert not (tmp_path / "none.html").exists()
    (tmp_path / "study.yaml").touch()
    with pytest.raises(PageError, match="would be lost"):
        write_page(stored("block"), tmp_path / "study.yaml")
    with pytest.raises(SystemExit):
        main(["report", str(stored("block")), "-o", str(tmp_path)])
    assert "a page's name ends in .html" in capsys.readouterr().err


def test_no_line_of_scripts_and_style_has_more_than_100_characters() -> None:
    assets = sorted((Path(write.__file__).parent / "assets").iterdir())
    assert len(assets) > len(write.SCRIPTS)
    for path in assets:
        lines = path.read_text(encoding="utf-8").splitlines()
        long = [number for number, line in enumerate(lines, 1) if len(line) > 100]
        assert not long, f"{path.name}: lines {long}; format it: see tcstudy/README.md, Guides"


def test_a_page_knows_every_role() -> None:
    """An edge of a role that its script does not know would end it."""
    script = (Path(write.__file__).parent / "assets" / "point.js").read_text(encoding="utf-8")
    table = script.partition("TC.ROLES = {")[2].partition("};")[0]
    assert {*re.findall(r"(\w+): \{\s*words", table)} == {*ROLES}


def test_a_history_has_its_steps_and_a_sweep_of_totals(stored: Stored) -> None:
    own = read(stored("history"))
    found, data = data_of(write_page(own.path, own.path.with_suffix(".html")).path), own.data
    u = by_point(data["u_T"], data)
    total = data["dissipated"].sum("step").values.ravel()
    np.testing.assert_allclose(
        found["run"]["numbers"]["dissipated"]["v"], total[:, None], rtol=1e-12
    )
    for p, steps in enumerate(found["steps"]):
        (sheet,) = steps["table"]
        spent = next(one["v"] for one in sheet["columns"] if one["name"] == "dissipated")
        np.testing.assert_array_equal(spent, by_point(data["dissipated"], data)[p])
        line = steps["point"][-1]["parts"][0]
        check_slip(line["line"], u[p])
        moved, largest = np.diff(u[p], axis=0), np.abs(u[p]).max()
        assert np.all(line["state"][1:][moved > 1e-8 * largest] == 1)
        assert np.all(line["state"][1:][moved < -1e-8 * largest] == 2)
        assert np.all(line["state"][1:][np.abs(moved) < 1e-10 * largest] == 0)
    facts = [fact for label, fact in found["verdict"]["lines"] if label == "Solved"]
    assert facts[0].startswith("6 of 6 histories of 16 steps in 2 cycles followed to their end")
    # of a thousand steps 200 nodes whose slips are noise, which no compression makes smaller, fit
    # in two megabytes
    one = data.isel(tau=0, E=0).isel(step=np.arange(1000) % 17, node=np.arange(200) % 16)
    noise = np.random.default_rng(3).normal(size=(1000, 200))
    long = one.assign(
        {name: (one[name].dims, noise, one[name].attrs) for name in ("u_T", "xi", "kappa")}
    )
    text = write._fitting(replace(own, data=long.drop_vars(["tau", "E"])), without := [])
    assert len(text) <= 2_000_000
    assert set(without) <= {"memory"}


def test_every_geometry_has_its_own_line_and_body(stored: Stored) -> None:
    found = data_of(write_page(stored("pads"), stored("pads").with_suffix(".html")).path)
    data = read(stored("pads")).data
    at = [str(dim) for dim in data["status"].dims[:-1]].index("height")
    heights = {axis["name"]: axis["values"] for axis in found["run"]["axes"]}["height"]
    for p, home in enumerate(found["run"]["home"]):
        height = heights[np.unravel_index(p, found["run"]["shape"])[at]]
        own = found["homes"][home]
        assert max(y for edge in own["outline"] for _, y in edge["line"]) == pytest.approx(height)
        assert own["body"]["y"].max() == pytest.approx(height, rel=1e-6)
        largest = np.abs(values_of(own["lines"]["1"]["u_T"])).max(axis=1)
        place = [q for q, other in enumerate(found["run"]["home"]) if other == home].index(p)
        assert largest[place] == pytest.approx(
            found["run"]["numbers"]["u_T_max"]["v"][p, 1], rel=1e-4
        )


def test_one_law_for_all_edges_may_stand_beside_a_law_of_each(tmp_path: Path) -> None:
    """Each point has a law of every edge, in one order, and its own strengths along the line."""
    split = (
        "{shoe: {law: tresca, tau: 1}, film: {law: tresca, tau: 2, strength: 'min(1, 0.5 + x)'}}"
    )
    text = FILMS + f"sweep: {{friction: {{whole: {{law: tresca, tau: 2}}, split: {split}}}}}\n"
    tcstudy.run(read_study_text(text), tmp_path / "films.nc", jobs=1)
    found = data_of(write_page(tmp_path / "films.nc", tmp_path / "films.html").path)
    laws, edges = found["laws"]["laws"], found["laws"]["edges"]
    largest = [
        {edge: max(laws[k]["pieces"]["b0"]) for edge, k in zip(edges, of, strict=True)}
        for of in found["laws"]["index"]
    ]
    assert largest == [{"film": 2.0, "shoe": 2.0}, {"film": 2.0, "shoe": 1.0}]
    line = found["lines"]["0"]
    strengths = values_of(line["strengths"])[line["strength_of"]]
    film = line["of_law"] == edges.index("film")
    assert np.allclose(strengths[0], 1.0, atol=1e-4)
    assert np.allclose(strengths[1][film], np.minimum(1.0, 0.5 + line["x"][film]), atol=1e-4)


def test_numbers_come_back() -> None:
    """Arrays as they are, rows to four digits of their largest value, fields of many points by few
    modes."""
    random, box = np.random.default_rng(1), Container()
    values = random.normal(size=(5, 40)) * 10.0 ** np.arange(-8, 12, 4)[:, None]
    values[2, 3], values[4] = np.nan, 0.0
    fields = random.normal(size=(60, 3)) @ random.normal(size=(3, 500))
    header = {"a": box.array([[1.0, np.nan], [3.0, np.inf]]), "b": box.array([1, 2, 3], "i1")}
    header |= {"c": [np.nan, np.inf, 1.5], "rows": box.rows(values), "fields": box.fields(fields)}
    back = unpacked(box.packed(header))
    np.testing.assert_array_equal(back["a"], [[1.0, np.nan], [3.0, np.inf]])
    np.testing.assert_array_equal(back["b"], [1, 2, 3])
    assert back["c"] == [None, "inf", 1.5]
    found = np.where(back["rows"]["rows"] == -32768, np.nan, values_of(back["rows"]))
    largest = np.nanmax(np.abs(values), axis=1, keepdims=True)
    assert np.nanmax(np.abs(found - values) / np.where(largest > 0.0, largest, 1.0)) <= 0.51 / 32767
    np.testing.assert_array_equal(np.isnan(found), np.isnan(values))
    assert back["fields"]["factor"].shape == (60, 3)
    modes = values_of(back["fields"]["mode"])
    assert np.max(np.abs(back["fields"]["factor"] @ modes - fields)) <= 1.1e-3 * np.ptp(fields)


def test_its_pieces_are_the_law() -> None:
    for law in example_laws():
        found = drawn_law(law)["pieces"]
        s = np.linspace(-3.0, 3.0, 61) * (law.s_scale or 1.0) + 1e-9 * (law.s_scale or 1.0)
        k = np.searchsorted(found["kinks"], s)
        s_0, b_0, q, a, r = (np.array(found[name])[k] for name in ("s0", "b0", "q", "a", "r"))
        np.testing.assert_allclose(
            b_0 + q * (s - s_0) + a * np.exp(-r * (s - s_0)), law.b(s), rtol=1e-12
        )
    for name, parameters in (
        ("tresca", {"tau": 4e7}),
        ("linear", {"k": 5e9}),
    ):  # without a length of their own
        assert drawn_law(SHAPES[name].build(**parameters))["reach"] == 0.0


# -- contact that may open


def test_openings_are_data_of_the_page_and_their_script_is_on_their_pages_alone(
    stored: Stored,
) -> None:
    pages = {}
    for name in ("arm", "single"):
        path = stored(name)
        pages[name] = write_page(path, path.with_suffix(".html")).path
    assert "TC.openings" in pages["arm"].read_text(encoding="utf-8")
    assert "TC.openings" not in pages["single"].read_text(encoding="utf-8")
    page = data_of(pages["arm"])
    openings = page["lines"]["0"]["openings"]
    with xr.open_datatree(stored("arm")) as tree:
        level = tree["level_0"].dataset.load()
    largest = float(np.abs(level["S_N"]).max())
    np.testing.assert_allclose(
        values_of(openings["u_T"])[0], level["opening"], atol=1e-4 * float(level["opening"].max())
    )
    np.testing.assert_allclose(values_of(openings["xi"])[0], level["S_N"], atol=1e-4 * largest)
    law = page["laws"]["openings"]
    assert (law["edges"], law["index"], law["laws"][0]["closed"]) == (["bond"], [[0]], True)
    assert "openings" not in data_of(pages["single"])["lines"]["0"]
