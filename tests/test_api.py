"""The public functions on one small study: each does what its command does."""

from pathlib import Path

import numpy as np
import pytest
from ruamel.yaml import YAML

import tcstudy
from tcstudy.errors import python_words

PUSHED = {"role": "clamped", "u_x": 0.3, "u_y": 0}
SECTIONS = {
    "body": {"rectangle": {"width": 2.0, "height": 1.0}},
    "boundary": {"bottom": "contact", "top": PUSHED, "left": "free", "right": "free"},
    "material": {"E": np.float64(1.0), "nu": 0.3},
    "friction": {"law": "slip-weakening", "tau_s": 0.1, "tau_k": 0.05, "delta": 0.1},
    "mesh": {"maxh": 0.5, "levels": 3},
    "units": "none",
    "path": {"parameter": "boundary.top.u_x", "from": 0, "to": 0.5, "at": [0.3]},
}


@pytest.fixture
def study() -> tcstudy.Study:
    return tcstudy.Study.from_dict(SECTIONS, "small")


def test_run_path_converge_draw_and_report(study: tcstudy.Study, tmp_path: Path) -> None:
    points, file = study.with_(path=None), tmp_path / "run.nc"
    run, along = tcstudy.run(points, file, jobs=1), tcstudy.run(study, tmp_path / "path.nc")
    slips = run[f"level_{study.mesh.levels - 1}"]["u_T"].values.ravel()
    at = along["solution_u_T"].values
    assert any(np.allclose(row, slips, rtol=1e-9, atol=1e-12) for row in at.reshape(-1, len(slips)))
    assert "status" in tcstudy.converge(study.with_({"path": None}), tmp_path / "errors.nc")
    assert tcstudy.draw(file, tmp_path / "law.png", law=True, size="8x10cm").stat().st_size > 1000
    with pytest.raises(tcstudy.UserFault, match="law: the picture of a run file by x does not"):
        tcstudy.draw(file, tmp_path / "law.png", law=True, x="a", y="b")
    assert tcstudy.report(file) == tmp_path / "run.html"
    with pytest.raises(tcstudy.StoreError, match="another study"):
        tcstudy.run(points.with_(friction_delta=0.2), file)


def test_a_notebook_needs_no_file_names(study: tcstudy.Study, tmp_path: Path) -> None:
    """The same call returns at once, another says why it computes; a result shows itself, and is
    saved under a name."""
    points = study.with_(path=None, mesh_levels=1)
    first = tcstudy.run(points, jobs=1)
    again = tcstudy.run(points, jobs=1)
    assert first.note.startswith("computed now")
    assert (again.file, again.note) == (first.file, "")
    other = tcstudy.run(points.with_(friction_delta=0.2), jobs=1)
    assert other.note == "computed now: friction.delta was 0.1, is 0.2"
    assert other.file != first.file
    assert first.to_dataframe()["energy"].tolist() == first["energy"].values.ravel().tolist()
    with pytest.raises(KeyError, match="no 'slip'; did you mean 'slip_length'"):
        first["slip"]
    assert first.summary in first._repr_html_()
    assert all("data:image/png;base64," in one._repr_html_() for one in (first, study))
    assert first.draw()._repr_png_().startswith(b"\x89PNG")
    assert first.save(tmp_path / "mine.nc").summary == first.summary
    with pytest.raises(tcstudy.StoreError, match="is there already"):
        other.save(tmp_path / "mine.nc")


def test_a_result_without_a_home_is_kept_until_python_ends(
    study: tcstudy.Study, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "file").touch()
    points = study.with_(path=None, mesh_levels=1)
    usual = tcstudy.run(points, jobs=1)
    monkeypatch.setenv("TCSTUDY_CACHE", str(tmp_path / "file"))
    with pytest.warns(tcstudy.StudyWarning, match="kept until Python ends only.*TCSTUDY_CACHE"):
        kept = tcstudy.run(points, jobs=1)
    assert kept.file.parent not in (usual.file.parent, tmp_path)
    assert kept["energy"].equals(usual["energy"])


def test_a_file_opened_is_what_run_returns(study: tcstudy.Study, tmp_path: Path) -> None:
    ran = tcstudy.run(study.with_(path=None), tmp_path / "run.nc", jobs=1)
    with tcstudy.open_results(tmp_path / "run.nc") as opened:
        assert (type(opened), opened.summary) == (type(ran), ran.summary)
        assert list(opened) == list(ran)
        assert opened["level_1"]["u_T"].equals(ran["level_1"]["u_T"])


def test_the_picture_is_of_the_point_that_the_answer_names(
    study: tcstudy.Study, tmp_path: Path
) -> None:
    swept = study.with_({"path": None, "sweep": {"boundary.top.u_x": [0.0, 0.4, 0.1]}})
    result = tcstudy.run(swept.with_(mesh_levels=1), tmp_path / "run.nc", jobs=1)
    assert "= 0.4" in result.summary
    for at in (None, {"u_x": 0.4}):
        result.draw(tmp_path / f"{at is None}.svg", at=at)
    assert (tmp_path / "True.svg").read_bytes() == (tmp_path / "False.svg").read_bytes()


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("fix it by --set sweep=null, or", 'fix it by study.with_({"sweep": None}), or'),
        ("--set 'mesh={levels: 3}'", """study.with_({"mesh": '{levels: 3}'})"""),
        ("again with --set output.fields=true to", 'with study.with_({"output.fields": True}) to'),
        ("give another --output, or --force to", "give another output, or force=True to"),
        ("run with --jobs 1", "run with jobs=1"),
        ("write one study for each, or use --set", "or use study.with_(...)"),
        ("data in results/a--b.nc", "data in results/a--b.nc"),
    ],
)
def test_messages_of_python_name_its_arguments(text: str, words: str) -> None:
    assert words in python_words(text)


def test_faults_of_python_do_not_name_options(study: tcstudy.Study, tmp_path: Path) -> None:
    with pytest.raises(tcstudy.StudyError, match=r"^mesh\.maxh=-1: mesh\.maxh: ") as bad_value:
        study.with_(mesh_maxh=-1)
    points = study.with_(path=None)
    tcstudy.run(points, tmp_path / "run.nc", jobs=1)
    with pytest.raises(tcstudy.StoreError, match="force=True") as other_study:
        tcstudy.run(points.with_(E=2.0), tmp_path / "run.nc")
    with pytest.raises(tcstudy.ConvergenceError, match="one level") as one_level:
        tcstudy.converge(points.with_(mesh_levels=1), tmp_path / "errors.nc")
    for fault in (bad_value, other_study, one_level):
        assert "--" not in str(fault.value)


def test_dir_has_the_public_names() -> None:
    assert dir(tcstudy) == sorted(tcstudy.__all__)


def test_pictures_go_into_axes_of_a_figure(study: tcstudy.Study) -> None:
    """One panel each, with its labels and its key; the figure stays the caller's."""
    from matplotlib.figure import Figure

    figure = Figure()
    axes = figure.subplots(1, 3)
    path, point = tcstudy.run(study), tcstudy.run(study.with_(path=None, mesh_levels=1), jobs=1)
    assert tcstudy.draw(path, ax=axes[0]) is figure
    point.draw(ax=axes[1], panel="lower")
    point.draw(ax=axes[2], law=True)
    assert axes[0].get_xlabel() == "$u_{x}$ of top"
    assert axes[0].get_legend_handles_labels()[1]
    assert axes[1].get_ylabel().startswith("ξ")
    assert all(one.lines for one in axes)
    with pytest.raises(tcstudy.DrawError, match="no 'middle'; choose of upper, lower"):
        point.draw(ax=axes[0], panel="middle")
    with pytest.raises(tcstudy.UsageError, match="give ax, too"):
        point.draw(panel="lower")


def test_a_study_shows_itself_and_its_faults_in_one_line(study: tcstudy.Study) -> None:
    changed = study.with_(friction_delta="7 mm", units=None)
    assert changed["friction.delta"] == "7 mm"
    assert "friction.delta" in changed._ipython_key_completions_()
    again = tcstudy.Study.from_dict(YAML(typ="safe").load(changed.to_yaml()))
    assert again.to_yaml() == changed.to_yaml()
    with pytest.raises(
        tcstudy.UsageError, match=r"no friction\.delat; did you mean 'friction\.delta'"
    ) as caught:
        changed["friction.delat"]
    assert caught.value._render_traceback_() == [f"UsageError: {caught.value}"]


def test_faults_are_one_line(study: tcstudy.Study, tmp_path: Path) -> None:
    with pytest.raises(tcstudy.UsageError, match="the study has a section path"):
        tcstudy.run(study, tmp_path / "none.nc", append=True)
    with pytest.raises(tcstudy.ConvergenceError, match="one level"):
        tcstudy.converge(study.with_(path=None, mesh_levels=1), tmp_path / "none.nc")
    with pytest.raises(tcstudy.UsageError, match="cannot hold"):
        study.with_(title=object())
    with pytest.raises(tcstudy.UsageError, match="list of texts"):
        tcstudy.load("configs/quickstart.yaml", "mesh.levels=2")
    with pytest.raises(tcstudy.StudyError, match=r"^small:\d+:\d+: mesh\.maxh: "):
        tcstudy.Study.from_dict({**SECTIONS, "mesh": {"maxh": -1.0}}, "small")
    assert not list(tmp_path.iterdir())
