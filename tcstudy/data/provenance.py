"""Where a result comes from: study text, command, versions, commit; the global attributes of a result file.

Nothing of a machine is recorded: absolute paths are cut to the file name; host and user names are never read. By its
attributes a file also tells which command wrote it and which results it holds, so that two studies do not overwrite
each other and none is computed twice.

What one must know of a result before using it is told when it is found, kept in the file, and told again by its
readers: as a StudyWarning, which the command line prints on standard error.
"""

from __future__ import annotations

import hashlib
import json
import os
import platform
import re
import shlex
import subprocess
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from functools import cache
from importlib import metadata
from pathlib import Path, PurePosixPath, PureWindowsPath
from typing import Any, Literal, get_args

from tcstudy.data.files import attributes, is_foreign, refuse_changed
from tcstudy.errors import StoreError, tell
from tcstudy.scene.study import Acceptance, Study

CONVENTIONS = "CF-1.11"
REFERENCES = "Sestak & Jovanovic, Appl. Math. Mech. 31 (2010), doi:10.3879/j.issn.1000-0887.2010.01.008"
PACKAGES = ("numpy", "scipy", "ngsolve", "xarray", "netCDF4", "tcstudy")
NUMERICS = ("numpy", "scipy", "ngsolve", "netgen-mesher", "tcstudy")
"""Packages whose version can change a result (meshes are equal across runs, not across versions)."""
GIT_TIMEOUT = 5.0
"""Seconds that git may take, for example on a slow network disk."""
WARNINGS, SHORTFALLS = "warnings", "shortfalls"
"""Global attributes: the warnings as a JSON list of objects, without one if there are none; what of a path is not as it
was asked for, one sentence a line."""


@dataclass(frozen=True)
class Remark:
    """A warning as data: what it says, and of which geometry, point or level in words; of all if that is empty."""

    text: str
    where: str = ""

    def __str__(self) -> str:
        return f"{self.where}: {self.text}" if self.where else self.text


def remarks_of(attributes: Mapping[str, Any]) -> list[Remark]:
    """The warnings in the global attributes of a file; files from before there were any have none."""
    stored = [Remark(str(one["text"]), str(one["where"])) for one in json.loads(attributes.get(WARNINGS, "[]"))]
    return stored + [Remark(line) for line in str(attributes.get(SHORTFALLS, "")).splitlines()]


def tell_stored(path: Path) -> None:
    """Warn of what a file keeps. Raises StoreError if it is none, or damaged."""
    tell(remarks_of(attributes(path)))


def collect(
    study: Study, command: Sequence[str], now: datetime | None = None, remarks: Sequence[Remark] = ()
) -> dict[str, Any]:
    """Global attributes of a result file: those of CF, and all that is needed to repeat the run.

    command: the words of the command line, run at `now`;  remarks: warnings that the file keeps
    """
    date = (now or datetime.now(UTC)).isoformat(timespec="seconds")
    versions = {"python": platform.python_version(), **package_versions(PACKAGES)}
    words = re.sub(r"^__main__\.py\b", "tcstudy", shlex.join(without_directories(command)))  # of python -m
    told = [{"text": without_paths(one.text), "where": one.where} for one in remarks]
    return {
        "Conventions": CONVENTIONS,
        "title": study.title or "untitled study",
        "institution": study.institution or "unspecified",
        "source": f"tcstudy {versions['tcstudy']}",
        "history": f"{date} {words}",
        "references": REFERENCES,
        "solver": " ".join(study.solver.names),
        "solver_tolerance": Acceptance(study.solver.tolerance).aim,
        "unit_system": study.units,
        "sweep_mode": study.mode,
        **({f"design_{name}": value for name, value in asdict(study.design).items()} if study.design else {}),
        "study_yaml": study.text,
        "study_sha256": study_sha256(study),
        "overrides": "\n".join(without_directories(study.overrides)),
        "versions": json.dumps(versions),
        "program": program(),
        "git_commit": git_commit(study.source),
        **({WARNINGS: json.dumps(told)} if told else {}),
    }


def study_sha256(study: Study) -> str:
    """SHA-256 of all that decides the results: YAML text, overrides, and the bytes of its geometry files.

    Without overrides and geometry files it is the checksum of the YAML file.
    """
    digest = hashlib.sha256(study.text.encode())
    for override in study.overrides:
        digest.update(b"\0" + override.encode())
    bodies = (scene.body.brep for scene in study.scenes[:1])
    for path in sorted({brep.path for brep in bodies if brep is not None}):
        digest.update(b"\0" + path.name.encode() + b"\0")
        if path.is_file():
            digest.update(path.read_bytes())
    return digest.hexdigest()


def program() -> str:
    """All of the program that can change a result, as JSON: versions of its packages and the content of its own."""
    return json.dumps({**package_versions(NUMERICS), "content": content_sha256()})


@cache
def content_sha256() -> str:
    """SHA-256 of this package's modules, names and texts: a version number does not change with every edit."""
    package, digest = Path(__file__).parents[1], hashlib.sha256()
    for file in sorted(package.rglob("*.py")):
        digest.update(b"\0" + file.relative_to(package).as_posix().encode() + b"\0" + file.read_bytes())
    return digest.hexdigest()


def package_versions(names: Iterable[str]) -> dict[str, str]:
    """Installed versions by package name, without importing the packages; "unknown" if there is none."""
    return {name: _version(name) for name in names}


@cache
def _version(name: str) -> str:
    try:
        return metadata.version(name)
    except metadata.PackageNotFoundError:
        return "unknown"


def git_commit(source: Path | None) -> str:
    """Commit of the checkout that holds the study file, "-dirty" if it does not hold the study as run."""
    if source is None:
        return "unknown"
    directory = source.resolve().parent
    commit = _git(directory, "describe", "--always", "--exclude=*", "--abbrev=40", "--dirty")
    if commit is None or commit.endswith("-dirty"):
        return commit or "unknown"
    return (
        commit if _git(directory, "ls-files", "--error-unmatch", "--", source.name) is not None else f"{commit}-dirty"
    )


def _git(directory: Path, *arguments: str) -> str | None:
    """Output of a git command, None if git is missing, too slow or says no."""
    # GIT_OPTIONAL_LOCKS: asking for the status must not take a lock in the user's checkout
    environment = {**os.environ, "GIT_OPTIONAL_LOCKS": "0", "LC_ALL": "C"}
    try:
        done = subprocess.run(
            ["git", "-C", str(directory), *arguments],
            capture_output=True,
            text=True,
            timeout=GIT_TIMEOUT,
            env=environment,
            stdin=subprocess.DEVNULL,
            check=True,
        )
    except (OSError, subprocess.SubprocessError, UnicodeDecodeError):
        return None
    return done.stdout.strip()


def without_directories(words: Iterable[str]) -> tuple[str, ...]:
    """Words of a command or override; an absolute path, alone or after "=", is cut to its last part."""
    return tuple("=".join(_file_name(part) for part in word.split("=")) for word in words)


def _file_name(text: str) -> str:
    stripped = text.strip().strip("'\"")
    paths = (PurePosixPath(stripped), PureWindowsPath(stripped))
    return next((path.name for path in paths if path.is_absolute()), text)


_PATH = re.compile(r"(?<![^\s'\"(=:])(?:[A-Za-z]:)?[/\\](?:[^\s'\"/\\]+[/\\])+")


def without_paths(sentence: str) -> str:
    """A sentence with every absolute path cut to its last part (a slash within a unit stays)."""
    return _PATH.sub("", sentence)


OTHER_OUTPUT = "give another --output, or --force to replace it"
Kind = Literal["run", "path", "history", "convergence", "cost", "fit"]
CONTENT = "content"
"""Global attribute that tells the files of other commands from those of a run and of converge."""


def kind_of(path: Path) -> Kind:
    """The command whose file this is. Raises StoreError if there is no file or it is not complete."""
    return kind_from(attributes(path))


def kind_from(found: Mapping[str, Any]) -> Kind:
    """The command by the global attributes of its file."""
    content = found.get(CONTENT, "convergence" if "reference" in found else "run")
    return next((kind for kind in get_args(Kind) if kind == content), "run")


def measured_path(output: Path, kind: Kind) -> Path:
    """The file of convergence or cost beside a result file."""
    return output.with_name(f"{output.stem}.{kind}.nc")


def holds(path: Path, kind: Kind, study: Study | None, **asked: Any) -> bool:
    """Whether the file holds what a command would compute now, complete.

    kind: the command;  study: of which, None for any;  asked: global attributes that its options decide
    Raises StoreError if the file holds something else, or is damaged.
    """
    if not path.is_file() or not path.stat().st_size or is_foreign(path):  # a foreign one is told of elsewhere
        return False
    try:
        found = attributes(path)
        refuse_changed(path)
    except StoreError as error:
        raise StoreError(f"{error}, or give another --output") from error
    what = ""
    if (other := kind_from(found)) != kind:
        what = f"holds results of another command ({other})"
    elif study is not None and found.get("study_sha256") != study_sha256(study):
        what = "holds the results of another study, or of this one with other values"
    elif differing := [name for name, value in asked.items() if found.get(name) != value]:
        what = f"holds the results of another {'table of data' if 'data_sha256' in differing else '--at'}"
    elif found.get("program") != program():
        what = "holds this study as another version of the program or its libraries computed it"
    if what:
        raise StoreError(f"{path} {what}; {OTHER_OUTPUT}")
    return True


def already_there(path: Path, study: Study) -> list[str]:
    """Notes on results that a run of the study would find in its output; a history goes on with what it finds."""
    if study.kind == "history":
        return []
    try:
        there = holds(path, study.kind, study, **({"data_sha256": study.fit.sha256} if study.fit else {}))
    except StoreError as error:
        return [f"a run would stop here: {error}"]
    return [f"{path} holds these results already; a run ends at once, --force computes them again"] if there else []
