"""Reading takes work that grows with the length of the text, and what is too long is refused before
any."""

import sys
from collections.abc import Callable
from functools import partial
from itertools import pairwise
from pathlib import Path
from types import FrameType

import pytest

from tcstudy.errors import StudyError
from tcstudy.read.study import read_study_text
from tcstudy.study.lint import unused
from tests.read.test_bad_input import BASE

STUDY = BASE[: BASE.index("sweep:")]
LAW = "{law: slip-weakening, tau_s: 20 MPa, tau_k: 5 MPa, delta: 40 um}"


def calls(work: Callable[[], object]) -> int:
    """Return how many functions are called, those of C included; the study may be refused."""
    count = 0

    def counted(frame: FrameType, event: str, _: object) -> None:
        nonlocal count
        count += event in ("call", "c_call")

    sys.setprofile(counted)
    try:
        work()
    except StudyError:
        pass
    finally:
        sys.setprofile(None)
    return count


def chain(n: int) -> str:
    """Return parameters each of which is made of the next one."""
    lines = [f'  p{k}: "p{k - 1}*1"\n' for k in range(n, 0, -1)]
    return f"{STUDY}parameters:\n{''.join(lines)}  p0: 1\n"


def independent(n: int) -> str:
    """Return parameters of their own, which nothing uses."""
    return f"{STUDY}parameters:\n" + "".join(f"  p{k}: {k + 1} mm\n" for k in range(n))


def unknown(n: int) -> str:
    """Return parameters each of which has a fault."""
    return f"{STUDY}parameters:\n" + "".join(f'  p{k}: "q{k}*1"\n' for k in range(n))


def law(n: int) -> str:
    """Return a law by points."""
    points = ", ".join(f"[{k} um, {1 + k % 2} MPa]" for k in range(n))
    return STUDY.replace(LAW, f"{{law: piecewise-linear, points: [{points}]}}")


def values(n: int) -> str:
    """Return a sweep over listed values."""
    return f"{STUDY}sweep: {{alpha: [{', '.join(map(str, range(1, n + 1)))}]}}\n"


def read(text: str) -> object:
    """Read a study, and what is said of its names."""
    return unused(read_study_text(text, "study.yaml"))


@pytest.mark.parametrize("written", [chain, independent, unknown, law, values])
def test_work_grows_with_the_length_of_the_text(written: Callable[[int], str]) -> None:
    """Twice as much text makes twice as much more work; that of the square would be four times."""
    n, first = 40, written(10)
    calls(lambda: read(first))  # what is made once
    counts = [calls(partial(read, written(size))) for size in (n, 2 * n, 4 * n, 8 * n)]
    growth = [after - before for before, after in pairwise(counts)]
    assert growth[1] < 2.6 * growth[0]
    assert growth[2] < 2.6 * growth[1]


def test_a_table_is_read_in_a_time_that_grows_with_its_lines(tmp_path: Path) -> None:
    """Blanks, digits and quotes that lead nowhere are read once: else this would take hours."""
    table = tmp_path / "table.csv"
    for cell in (" " * 300_000 + '"', "1" * 300_000 + "x", '"' + ' ""' * 100_000):
        table.write_text(f"alpha,friction.delta [um]\n{cell},2\n")
        with pytest.raises(StudyError, match=r"table\.csv:2:1"):
            read_study_text(f"{STUDY}sweep: {{points: {table}}}\n")


@pytest.mark.parametrize("text", ["[{}]", "\n - {}"])
def test_a_text_of_too_many_values_is_refused_before_it_is_read(text: str) -> None:
    separator = "\n - " if "\n" in text else ", "
    large = f"{STUDY}sweep:\n alpha: {text.format(separator.join(['1'] * 2_000_000))}\n"
    assert calls(lambda: read_study_text(large)) < 200
    with pytest.raises(StudyError, match="of which at most 500000 are read"):
        read_study_text(large)


def test_a_table_of_too_many_cells_is_refused_before_it_is_read(tmp_path: Path) -> None:
    table = tmp_path / "table.csv"
    table.write_text("alpha,friction.delta [um]\n" + "1,2\n" * 1_000_000)
    small, large = (f"{STUDY}sweep: {{points: {name}}}\n" for name in (tmp_path / "no.csv", table))
    assert calls(lambda: read_study_text(large)) < calls(lambda: read_study_text(small)) + 200
    with pytest.raises(StudyError, match="at most 450000 are read"):
        read_study_text(large)
