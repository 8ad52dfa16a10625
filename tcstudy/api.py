"""The public functions on studies, as `tcstudy` offers them; the command line does the same work.

Every function takes a Study or the name of its file, and is silent unless asked to show progress.
Faults of the user are raised as a kind of tcstudy.UserFault. A tcstudy.StudyWarning is what one
must know of results before using them. Left out: changing a Study in place (`with_` makes another).
"""

from __future__ import annotations

import html
import io
import json
from collections.abc import Mapping, Sequence
from dataclasses import fields
from functools import partial
from pathlib import Path as FilePath
from typing import TYPE_CHECKING, Any

from tcstudy.errors import UsageError, hint, python_door
from tcstudy.read.study import read_study, read_study_text
from tcstudy.results import Result, cached, picture_html, why_again
from tcstudy.scene import study as records
from tcstudy.scene.keys import rows

if TYPE_CHECKING:
    from tcstudy.data.files import Kind
    from tcstudy.study.plan import Plan

Changes = Sequence[str] | Mapping[str, object]
"""Changes of a study: texts "key=value", or values by key."""


class Study(records.Study):
    """A whole study, read and checked: the sweep and one scene for each of its points.

    `tcstudy.load(file)` or `Study.from_dict(sections)` makes it, `with_` makes another. Its parts
    `scenes`, `axes`, `mesh` and `solver` are in SI units.
    """

    @classmethod
    @python_door
    def from_dict(cls, sections: Mapping[str, object], name: str = "<dict>") -> Study:
        """Return the study of a mapping with the sections and keys of a study file.

        Numbers are in SI units, texts carry their unit.
        name: the name of the study in messages

        Raises StudyError with all faults, whose lines are those of the mapping written as YAML.
        """
        return _public_study(read_study_text(_yaml(sections, flow=False), name))

    @python_door
    def with_(self, changes: Mapping[str, object] | None = None, **named: object) -> Study:
        """Return another study with these values in place of its own, read and checked again.

            study.with_(friction_delta="60 um", alpha=50)  # section_key, a short name, a parameter
            study.with_({"boundary.top.pressure": 1e6})    # any key path
            study.with_(sweep=None)                        # None takes a key away

        Numbers are in SI units, texts carry their unit. Raises StudyError with all faults.
        """
        from tcstudy.read.document import tree_of, whole_key

        root = tree_of(self)
        new_values = dict(changes or {})
        for name, value in named.items():
            new_values[_key_of(name)] = value
        changed_paths = [f"{whole_key(root, key)}." for key in new_values]
        kept_overrides = list[str]()
        for override in dict.fromkeys(self.overrides):
            path = f"{whole_key(root, override.partition('=')[0].strip())}."
            if not path.startswith(tuple(changed_paths)):
                kept_overrides.append(override)
        overrides = (*kept_overrides, *_override_texts(new_values))
        name = str(self.source) if self.source is not None else "<text>"
        return _public_study(read_study_text(self.text, name, overrides, self.source))

    def to_yaml(self) -> str:
        """Return the study as a file would have it, with its changes and without comments."""
        from tcstudy.read.document import tree_of

        return _yaml(tree_of(self).plain(), flow=False)

    @python_door
    def __getitem__(self, key: str) -> object:
        """Return the value at a key path, as it is written: study["friction.delta"].

        Raises UsageError where there is none.
        """
        from tcstudy.read.document import split_path, tree_of

        node = tree_of(self).at(*(split_path(key) or (key,)))
        if node is None:
            remedy = hint(key, self._ipython_key_completions_(), "print it")
            raise UsageError(f"the study has no {key}; {remedy}")
        return node.plain()

    def _ipython_key_completions_(self) -> list[str]:
        from tcstudy.read.document import leaves, tree_of

        return [*leaves(tree_of(self))]

    def __str__(self) -> str:
        return f"{self!r}\n\n{self.to_yaml()}"

    def _repr_html_(self) -> str:
        """Return the scene as it was understood, and the study's text behind a click."""
        head = html.escape(repr(self))
        text = html.escape(self.to_yaml())
        return f"{picture_html(self)}<details><summary>{head}</summary><pre>{text}</pre></details>"


def _public_study(study: records.Study) -> Study:
    return Study(**{field.name: getattr(study, field.name) for field in fields(study)})


def _key_of(name: str) -> str:
    """Return "friction.delta" of friction_delta; a name without a section before "_" stays."""
    section, _, key = name.partition("_")
    return f"{section}.{key}" if key and section in rows("") else name


def _override_texts(changes: Changes) -> tuple[str, ...]:
    """Return changes as texts "key=value". Raises UsageError for a single text."""
    if isinstance(changes, str):
        problem = f"overrides must be a list of texts, not the text {changes!r}"
        raise UsageError(f"{problem}; write [{changes!r}]")
    if not isinstance(changes, Mapping):
        return tuple(changes)
    texts = list[str]()
    for key, value in changes.items():
        text = value if isinstance(value, str) else _yaml(value, flow=True)
        texts.append(f"{key}={text}")
    return tuple(texts)


def _yaml(value: object, flow: bool) -> str:
    """Return a value as YAML text, in one line if `flow`."""
    from ruamel.yaml import YAML

    library: Any = YAML(typ="safe", pure=True)
    library.default_flow_style = flow
    library.width = 10**6
    library.sort_base_mapping_type_on_output = False
    stream = io.StringIO()
    library.dump(json.loads(json.dumps(value, default=_json_value)), stream)
    text = stream.getvalue()
    return text.removesuffix("\n").removesuffix("\n...") if flow else text


def _json_value(value: object) -> object:
    """Return a value of JSON in place of a mapping, an array or a path. Raises UsageError."""
    if isinstance(value, Mapping):
        return dict(value)
    if hasattr(value, "tolist"):
        return value.tolist()
    if isinstance(value, FilePath):
        return str(value)
    problem = f"{value!r} is a {type(value).__name__}, which a study cannot hold"
    raise UsageError(f"{problem}; give numbers, texts or lists")


@python_door
def init(file: str | FilePath = "study.yaml") -> FilePath:
    """Write a commented starter study and the schema that its first line names.

    Raises UsageError if the file is there or cannot be written.
    """
    from tcstudy.study.starter import write_starter

    return write_starter(FilePath(file))


@python_door
def load(path: str | FilePath, overrides: Changes = ()) -> Study:
    """Read and check a study file.

    overrides: "key=value" texts, or values by key, that replace those of the file

    Raises StudyError with all faults of the file, each with its place and remedy.
    """
    return _public_study(read_study(FilePath(path), _override_texts(overrides)))


def _study(study: records.Study | str | FilePath) -> records.Study:
    return load(study) if isinstance(study, str | FilePath) else study


@python_door
def plan(study: Study | str | FilePath) -> Plan:
    """Return what a run would do, without doing it: points, sizes, what is left out and why.

    Raises StudyError, GeometryFailed.
    """
    from tcstudy.study.engine import outside_the_sweep
    from tcstudy.study.plan import plan as forecast

    planned = _study(study)
    if planned.kind == "path":
        planned = outside_the_sweep(planned)
    return forecast(planned)


@python_door
def run(
    study: Study | str | FilePath,
    output: str | FilePath | None = None,
    *,
    progress: bool = False,
    force: bool = False,
    jobs: int | None = None,
    dask: str | None = None,
    append: bool = False,
) -> Result:
    """Do what a study (or a study file) asks, and return its result, a netCDF file and its data.

    A study with a section `fit` is fitted, else one with `history` is followed step by step, else
    one with `path` along its equilibria; of every other one the points of the sweep are solved.
    `study.kind` says which; `with_(path=None)` takes a section away.

    output:   the file; without a name it is kept in the user's cache folder, where the same call
              finds it again
    progress: show a bar on stderr, or in the notebook
    force:    compute the results again, and replace whatever the file holds
    jobs:     worker processes, None for as many as pay (`tcstudy run --dry-run` says how many);
              numbers are the same
    dask:     "tcp://host:port" of a dask scheduler, or "local", whose workers solve the contact
              problems instead
    append:   keep the points that the file has of the study with another sweep, and add those of
              this one

    Points that fail have a status and a reason in the data. Those that broke down are tried again
    by the next run. The data of a path have vertices (`parameter`, `u_T`, `xi`), `stable`, folds
    and the hysteresis loop. Those of a history have the dimension `step` with its loads, `cycle`
    and `step_name`, to which more steps are added. Those of a fit have `estimate`, `interval`,
    `covariance` and `residual` by parameter and datum.

    Raises StudyError, GeometryFailed, PathError, HistoryError, FitError, or StoreError, for example
    where the file holds the results of another study.
    """
    requested = _study(study)
    if append and output is None:
        raise UsageError("append: name the file to append to")
    result = _result(
        requested.kind,
        requested,
        output,
        progress,
        force,
        append=append,
        jobs=jobs,
        dask=dask,
    )
    if requested.kind == "fit":
        from tcstudy.errors import tell
        from tcstudy.reports.terminal.fit import fit_doubts

        tell(sentence for sentence, is_doubt in fit_doubts(result.tree) if is_doubt)
    return result


@python_door
def converge(
    study: Study | str | FilePath,
    output: str | FilePath | None = None,
    *,
    progress: bool = False,
    force: bool = False,
) -> Result:
    """Measure errors, rates and limits over the levels of a study, as `tcstudy converge` does.

    output, progress, force: as of `run`

    Raises StudyError, ConvergenceError (levels that do not suit), GeometryFailed, StoreError.
    """
    return _result("convergence", _study(study), output, progress, force)


@python_door
def cost(
    study: Study | str | FilePath,
    output: str | FilePath | None = None,
    *,
    at: Mapping[str, Any] | None = None,
    progress: bool = False,
    force: bool = False,
) -> Result:
    """Measure accuracy against cost of mesh families and solvers, as `tcstudy cost` does.

    at: the sweep point by its labels, {"alpha": 100}; the first unless named
    output, progress, force: as of `run`

    Raises StudyError, CostError (nothing to compare with), DrawError (no such point),
    GeometryFailed, StoreError.
    """
    return _result("cost", _study(study), output, progress, force, at=at)


def _result(
    kind: Kind,
    study: records.Study,
    output: str | FilePath | None,
    progress: bool,
    force: bool,
    at: Mapping[str, Any] | None = None,
    **work_options: Any,
) -> Result:
    """Return the results, computed unless their file holds them already.

    output: None for a file of the cache, which keeps results without a name
    """
    from tcstudy.data.files import tell_stored
    from tcstudy.reports.select_point import sweep_point
    from tcstudy.reports.terminal.progress import open_progress
    from tcstudy.study.engine import Request, SweepPoint, deciding_attributes, make_file

    point = SweepPoint(*sweep_point(study, at)) if at or kind == "cost" else None
    if output is not None:
        target = FilePath(output)
        note = "computed now"
    else:
        target = cached(kind, study, **deciding_attributes(kind, study, point))
        note = why_again(target, study)
    request = Request(
        kind,
        study,
        target,
        (f"tcstudy.{FUNCTIONS.get(kind, 'run')}",),
        force=force,
        point=point,
        # who comes second finds the results that another process keeps under the same name
        wait=output is None,
        **work_options,
    )
    results = make_file(request, partial(open_progress, first_line=note if progress else None))
    if results.was_complete and kind != "history":  # which warns by itself
        tell_stored(target)
    return Result(target, "" if results.was_complete else note, warned=True)


FUNCTIONS = {"convergence": "converge", "cost": "cost"}
"""The function that makes files of a kind, where it is not `run`."""
