"""Where a result comes from, without a trace of the machine."""

import getpass
import platform
import re
import socket
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tcstudy.data.files import collect, git_commit, study_sha256, without_paths
from tcstudy.laws.laws import Laws
from tcstudy.scene.records import Body, BrepFace, Heat, Material, Scene
from tcstudy.scene.study import Study
from tests.data.by_points import write
from tests.data.conftest import failed


def git(directory: Path, *arguments: str) -> None:
    identity = ("-c", "user.name=n", "-c", "user.email=e@example.org", "-c", "commit.gpgsign=false")
    subprocess.run(["git", *identity, *arguments], cwd=directory, check=True, capture_output=True)


@pytest.fixture
def checkout(tmp_path: Path) -> Path:
    """A study file in a git checkout, committed."""
    study = tmp_path / "checkout" / "studies" / "study.yaml"
    study.parent.mkdir(parents=True)
    study.write_text("title: a\n")
    (study.parents[1] / "notes.txt").write_text("a\n")
    for words in (("init", "--quiet"), ("add", "."), ("commit", "--quiet", "-m", "first")):
        git(study.parents[1], *words)
    return study


def test_commit_of_the_checkout_that_holds_the_study(
    checkout: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    commit = git_commit(checkout)
    assert re.fullmatch("[0-9a-f]{40}", commit)
    (checkout.parent / "result.nc").touch()  # untracked files beside the study do not make it dirty
    assert git_commit(checkout) == commit
    (checkout.parents[1] / "notes.txt").write_text("b\n")
    assert git_commit(checkout) == f"{commit}-dirty"
    monkeypatch.setenv("GIT_CEILING_DIRECTORIES", str(tmp_path.parent))
    empty = tmp_path / "empty"
    empty.mkdir()
    git(empty, "init", "--quiet")  # no commit yet
    assert {
        git_commit(None),
        git_commit(tmp_path / "study.yaml"),
        git_commit(empty / "study.yaml"),
    } == {"unknown"}
    monkeypatch.setenv("PATH", str(empty))
    assert git_commit(checkout) == "unknown"


def test_checksum_changes_with_the_geometry_file(study: Study, tmp_path: Path) -> None:
    step = tmp_path / "body.step"
    law = Laws("none", *(np.zeros(n) for n in (0, 1, 1, 1, 1, 1)))
    body = Body(outline=None, brep=BrepFace(step, 0, 1.0, (), None))
    scene = Scene(
        body, (), Material(1.0, 1.0, 0.0, None, 1.0, 0.0, "strain"), (0.0, 0.0), Heat(), law
    )
    found = {study_sha256(replace(study, scenes=(scene, scene)))}
    for content in ("a", "b"):
        step.write_text(content)
        found.add(study_sha256(replace(study, scenes=(scene, scene))))
    assert len(found) == 3


@pytest.mark.parametrize(
    ("sentence", "kept"),
    [
        ("cannot read '/a/b/c.step': gone", "cannot read 'c.step': gone"),
        ("(/srv/x.nc) and file=/x/y/z", "(x.nc) and file=z"),
        (r"C:\Users\me\x.nc is open", "x.nc is open"),
        ("3 N/m, W/(m^2 K), and/or, 1/K, a/b/c", "3 N/m, W/(m^2 K), and/or, 1/K, a/b/c"),
    ],
)
def test_paths_in_sentences_are_cut(sentence: str, kept: str) -> None:
    assert without_paths(sentence) == kept


def test_nothing_of_the_machine_is_in_the_file(
    study: Study, output: Path, checkout: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for module, name in ((socket, "gethostname"), (platform, "node"), (getpass, "getuser")):
        monkeypatch.setattr(module, name, lambda: "trace-of-the-machine")
    monkeypatch.setenv("USER", "trace-of-the-machine")
    here = replace(study, source=checkout, overrides=(f"output.path={output}",))
    found = collect(here, [sys.executable, "run", str(checkout), f"--output={output}"])
    write(output, here, [], [failed(0, 0, f"cannot read {checkout}")], found)
    content = output.read_bytes()
    for trace in (str(output.parent), str(checkout.parent), sys.prefix, "trace-of-the-machine"):
        assert trace.encode() not in content, trace
    assert all(name in content for name in (b"study.nc", b"study.yaml"))
