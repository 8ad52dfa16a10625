"""history_run: histories that go on from their file, sweeps by workers, derivatives of steps, early
ends."""

from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr

from tcstudy.contact.history.memory import HistoryStep
from tcstudy.data.schema import DIFFERENTIABLE, PointStatus, name_of
from tcstudy.errors import StoreError
from tcstudy.executors.processes import ProcessExecutor
from tcstudy.read.study import read_study_text
from tcstudy.study import history_run, workers
from tcstudy.study.history_run import execute_history

BLOCK = """
body: {rectangle: {width: 0.4 m, height: 0.1 m}}
boundary: {bottom: contact, left: clamped, top: {role: traction, g: [0, 0]}, right: free}
material: {E: 210 GPa, nu: 0.3, alpha_T: 1.2e-5 1/K}
heat: {theta: 0 K}
friction: {law: tresca, tau: 20 MPa}
mesh: {maxh: 40 mm}
"""
SOFT = BLOCK.replace(
    "law: tresca, tau: 20 MPa", "law: slip-weakening, tau_s: 20 MPa, tau_k: 15 MPa, delta: 1 mm"
)


def loaded(file: Path) -> xr.Dataset:
    with xr.open_dataset(file) as opened:
        return opened.load().drop_attrs()


def followed(
    folder: Path, study: str, history: str, *overrides: str, name: str = "a.nc"
) -> xr.Dataset:
    """The data of a history; every energy identity holds to rounding, every step is a solution."""
    asked = read_study_text(f"{study}history: {history}\n", "study.yaml", overrides)
    execute_history(asked, folder / name)
    data = loaded(folder / name)
    done = data["status"].values == 1
    assert np.all(data["identity"].values[done] <= 1e-14)
    assert np.all(data["inclusion_residual"].values[done] <= 1e-10)
    assert np.all(data["dissipated"].values[done] >= 0.0)
    return data


def test_a_killed_history_keeps_its_steps_in_its_journal(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The next run does the others alone, and all numbers are those of a whole run."""
    text = f"{SOFT}history: {{memory: damage, steps: [{{theta: 60 K, in: 4}}, {{theta: -60 K, in: 2}}]}}\n"
    study, told = read_study_text(text, "study.yaml"), list[int]()

    def kill(*given: object) -> None:
        if given[0] == tmp_path / "a.nc" or given[2] == 4:
            raise KeyboardInterrupt

    with monkeypatch.context() as patched:
        patched.setattr(history_run, "write_record", kill)
        with pytest.raises(KeyboardInterrupt):
            execute_history(study, tmp_path / "a.nc", kill)
    assert (tmp_path / "a.nc.partial").exists()
    assert not (tmp_path / "a.nc").exists()
    summary = execute_history(
        study, tmp_path / "a.nc", lambda point, points, step, steps: told.append(step)
    )
    assert (told, summary.resumed) == ([5, 6], 5)
    assert not list(tmp_path.glob("*.partial*"))
    execute_history(study, tmp_path / "b.nc")
    assert loaded(tmp_path / "a.nc").equals(loaded(tmp_path / "b.nc"))


SWEPT = (
    f"{SOFT}history: {{memory: friction, steps: [{{theta: 60 K, in: 2}}, {{theta: 0 K}}]}}\n"
    "sweep: {tau_s: [25 MPa, 20 MPa], alpha_T: [1e-5, 1.2e-5]}\n"
)
CRUEL = """
import os
from tcstudy.executors import worker
from tcstudy.study import history_run
follow = history_run.follow_point
def cruel(study, *given):
    first, own = study.scenes
    if own.material.beta / first.material.beta > 1.1 and own.friction == first.friction:
        os.kill(os.getpid(), 9)
    return follow(study, *given)
history_run.follow_point = cruel
worker.main()
"""


def test_workers_find_the_same_histories_and_one_that_breaks_ends_no_sweep(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """To the bit; the steps before stay; what was broken, or killed its worker, is followed again
    by the next run."""
    study, told, begun = (
        read_study_text(f"{SWEPT}output: {{sensitivity: [friction.delta]}}\n", "study.yaml"),
        [],
        [],
    )
    execute_history(study, tmp_path / "a.nc", jobs=1)
    whole = loaded(tmp_path / "a.nc")
    assert whole["u_T"].dims == ("tau_s", "alpha_T", "step", "node")
    own = followed(
        tmp_path, SOFT, SWEPT.partition("history: ")[2].partition("\n")[0], name="one.nc"
    )
    assert np.array_equal(whole["u_T"].sel(tau_s=20e6, alpha_T=1.2e-5).values, own["u_T"].values)
    with monkeypatch.context() as patched:
        patched.setattr(workers, "ProcessExecutor", partial(ProcessExecutor, command=("-c", CRUEL)))
        summary = execute_history(study, tmp_path / "b.nc", lambda *at: told.append(at), jobs=2)
    assert (summary.points, summary.failed) == (4, 1)
    assert sorted({point for point, *_ in told}) == [0, 1, 2, 3]
    steps = history_run.fast_history

    def broken(*given: Any) -> Iterator[HistoryStep]:
        begun.extend(given[2:])  # not histories of derivatives, which have no start
        for n, step in enumerate(steps(*given)):
            if len(given) == 3 and len(begun) == 2 and n == 2:
                raise RuntimeError("no such state")
            yield step

    with monkeypatch.context() as patched:
        patched.setattr(history_run, "fast_history", broken)
        assert execute_history(study, tmp_path / "c.nc", jobs=1).failed == 1
    for name, reason, status in (
        ("b.nc", "signal SIGKILL", [2, 0, 0, 0]),
        ("c.nc", "no such state", [1, 1, 2, 0]),
    ):
        data = loaded(tmp_path / name)
        found = data["status"].transpose("tau_s", "alpha_T", "step").values.reshape(4, 4)
        names = [PointStatus.NOT_RUN, PointStatus.OK, PointStatus.ERROR]
        assert found[1].tolist() == [names[k] for k in status]
        assert np.count_nonzero(found == PointStatus.OK) == 12 + status.count(1)
        assert reason in str(data["reason"].transpose("tau_s", "alpha_T").values.ravel()[1])
        summary = execute_history(study, tmp_path / name, jobs=1)
        assert (summary.failed, summary.resumed) == (0, 12 + status.count(1))
        assert loaded(tmp_path / name).equals(whole)
    with pytest.raises(
        StoreError,
        match=r"another study \(sweep.tau_s was \[25 MPa, 20 MPa\], is \[24 MPa, 20 MPa\]",
    ):
        execute_history(read_study_text(SWEPT.replace("25 MPa", "24 MPa")), tmp_path / "b.nc")


def test_a_step_without_solution_ends_the_history(tmp_path: Path) -> None:
    """A loose strip pulled harder than friction holds: the steps before stay, the reason is
    told."""
    loose = BLOCK.replace("left: clamped", "left: free").replace(
        "law: tresca, tau: 20 MPa", "law: tresca, tau: 1 MPa"
    )
    study = loose.replace("right: free", "right: {role: traction, g: [0, 0]}")
    steps = "[{boundary.right.g_x: 3 MPa, in: 3}, {boundary.right.g_x: 6 MPa, in: 3}, {boundary.right.g_x: 0 MPa}]"
    data = followed(tmp_path, study, f"{{memory: friction, steps: {steps}}}")
    status = data["status"].values.tolist()
    assert status[:4] == [1, 1, 1, 1]
    assert status[4] > 1
    assert status[5:] == [0, 0, 0]
    assert data["reason"].item()
    assert np.all(np.isnan(data["u_T_max"].values[5:]))


NUMBERS = {"friction.tau_s": 20e6, "E": 210e9, "history.stiffness": 500e9}
PLASTIC = (
    "{memory: elastic-plastic, stiffness: 500 GPa/m, steps: [{theta: 60 K, in: 2}, {theta: -30 K}]}"
)
QUANTITIES = ("u_T_max", "friction_resultant")


def quantities(data: xr.Dataset, number: str = "") -> np.ndarray:
    """(2, steps) of a history, or their derivatives by a number."""
    return np.array([data[name_of(q, number) if number else q].values for q in QUANTITIES])


def test_derivatives_of_steps_against_histories_and_gone_on_from_a_file(tmp_path: Path) -> None:
    """More steps behind the same ones: what is there stays to the bit, and what follows is as
    computed at once."""
    asked, longer = (
        f"output.sensitivity=[{', '.join(NUMBERS)}]",
        PLASTIC.replace("]}", ", {theta: 50 K}]}"),
    )
    data = followed(tmp_path, SOFT, PLASTIC, asked)
    assert data["sensitivity_status"].values.tolist() == [DIFFERENTIABLE] * 4
    for name, value in NUMBERS.items():
        values = [(f"{name}={value * (1.0 + h)!r}", f"{name}{h}.nc") for h in (1e-4, -1e-4)]
        up, down = (
            quantities(followed(tmp_path, SOFT, PLASTIC, *each[:1], name=each[1]))
            for each in values
        )
        exact, apart = quantities(data, name), (up - down) / (2e-4 * value)
        assert exact == pytest.approx(
            apart, abs=2e-6 * np.max(np.abs(apart)) + 1e-9 * np.max(np.abs(exact))
        )
        assert np.all(exact[:, 0] == 0.0)
    grown = followed(tmp_path, SOFT, longer, asked)
    whole = followed(tmp_path, SOFT, longer, asked, name="whole.nc")
    assert grown.sizes["step"] == 5
    assert np.isfinite(quantities(grown, "history.stiffness")).all()
    for name in grown:
        if name in ("u_T", "kappa", "plastic", "status") or str(name).startswith("sensitivity"):
            assert np.array_equal(grown[name].values, whole[name].values), name
    assert grown["dissipated"].values == pytest.approx(whole["dissipated"].values, rel=1e-12)
    with pytest.raises(StoreError, match="another study"):
        followed(tmp_path, SOFT.replace("20 MPa", "21 MPa"), longer)
    with pytest.raises(StoreError, match="other steps"):
        followed(tmp_path, SOFT, longer.replace("60 K", "61 K"), asked)


def test_a_number_at_the_end_of_what_it_may_be_has_the_derivative_of_its_side(
    tmp_path: Path,
) -> None:
    """A film that falls to nothing: τ_k can only grow; one of no size at all has a scale as
    well."""
    study = SOFT.replace("tau_k: 15 MPa", "tau_k: 0 MPa").replace("delta: 1 mm", "delta: 4 mm")
    history = "{memory: friction, steps: [{theta: 60 K}, {theta: -30 K}]}"
    data = followed(tmp_path, study, history, "output.sensitivity=[friction.tau_k, loads.f_x]")
    for name, change, key in (
        ("friction.tau_k", 2e3, "friction.tau_k={}"),
        ("loads.f_x", 1e3, "loads.f=[{}, 0]"),
    ):
        runs = [
            followed(tmp_path, study, history, key.format(k * change), name=f"{name}{k}.nc")
            for k in (0, 1, 2)
        ]
        ends = [run["friction_resultant"].values for run in runs]
        exact = (4.0 * ends[1] - ends[2] - 3.0 * ends[0]) / (2.0 * change)
        assert data[name_of("friction_resultant", name)].values == pytest.approx(
            exact, rel=1e-5, abs=1e-9
        )


def test_a_path_that_passes_its_step_by_rounding_ends_it(tmp_path: Path) -> None:
    long = """
body: {rectangle: {width: 6 m, height: 200 mm}}
boundary: {bottom: contact, left: symmetry, top: free, right: {role: traction, g: [0 MPa, 0]}}
material: {E: 30 GPa, nu: 0.1, plane: stress, alpha_T: 12e-6 1/K}
heat: {theta: 0 K}
friction: {law: slip-weakening, tau_s: 0.4 MPa, tau_k: 0.2 MPa, delta: 1 mm}
mesh: {maxh: 80 mm}
"""
    loads = "{theta: 40 K, in: 4}, {theta: -10 K, in: 4}, {boundary.right.g_x: 0.6 MPa}, {boundary.right.g_x: 0 MPa}"
    assert np.all(
        followed(tmp_path, long, f"{{memory: friction, steps: [{loads}]}}")["status"] == 1
    )
