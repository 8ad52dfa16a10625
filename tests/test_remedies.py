"""Remedies work: what a message says to write is read, what it says to run runs."""

import os
import re
from collections.abc import Callable, Iterator
from pathlib import Path

import netCDF4
import pytest
from ruamel.yaml import YAML
from ruamel.yaml.nodes import MappingNode, Node, ScalarNode, SequenceNode

from tcstudy.data.files import attributes
from tcstudy.errors import Problem, StoreError, StudyError
from tcstudy.read.study import read_study_text
from tests.commands import CONFIGS, tcstudy_command
from tests.read.test_bad_input import BASE, CASES, changed

EXAMPLE = re.compile(
    r"^write (?:for example |a decimal point: )?(?P<value>[-+0-9\[{(][^;]*?)(?: or [^;]*)?$"
)
MEANT = re.compile(r"^did you mean '(?P<word>[^']+)'\?")
PLACEHOLDERS = re.compile(r"NAME|PARAMETER|\.\.\.|\[a, b|in its place")


def problems(text: str, *options: str) -> tuple[Problem, ...]:
    """Return the faults of a study; none of a sound one."""
    try:
        read_study_text(text, "study.yaml", options)
    except StudyError as error:
        return error.problems
    return ()


def nodes(node: Node) -> Iterator[Node]:
    """Yield a node of the YAML library and all below it, outer ones first."""
    yield node
    pairs = node.value if isinstance(node, MappingNode) else ()
    items = node.value if isinstance(node, SequenceNode) else ()
    for inner in (*items, *(one for pair in pairs for one in pair)):
        yield from nodes(inner)


def replaced(text: str, fault: Problem, new: str, meant: bool) -> str:
    """Return the text with another value, or another word, in the place of a fault."""
    at = [
        node
        for node in nodes(YAML(typ="safe", pure=True).compose(text))
        if (node.start_mark.line + 1, node.start_mark.column + 1) == (fault.line, fault.column)
        and (isinstance(node, ScalarNode) or not meant)
    ]
    start, end = at[0].start_mark.index, at[0].end_mark.index
    old, quoted = text[start:end], re.search(r"'([^']+)'", fault.what)
    if meant and quoted and quoted[1] in old:
        new = old.replace(quoted[1], new)
    return f"{text[:start]}{new}{text[end:]}"


REMEDIES = [
    (changed(*case.split(" => "), text), case) for text, case, *_ in CASES if case[:5] != "--set"
]


@pytest.mark.parametrize(("text", "case"), REMEDIES, ids=[case[:60] for _, case in REMEDIES])
def test_what_a_message_says_to_write_is_read(text: str, case: str) -> None:
    [fault] = problems(text)
    meant, example = MEANT.match(fault.remedy), EXAMPLE.match(fault.remedy)
    if (not meant and not example) or PLACEHOLDERS.search(fault.remedy):
        return
    new = meant["word"] if meant else example["value"]  # type: ignore[index]
    mended = problems(replaced(text, fault, new, bool(meant)))
    assert fault.key not in [one.key for one in mended], f"{fault}\n{mended}"


COMMAS = {
    "210,000 MPa": ("210000 MPa", "210.000 MPa"),
    "1,234,567 kPa": ("1234567 kPa",),
    "1.234.567,5 kPa": ("1234567.5 kPa",),
    "1,234.5 MPa": ("1234.5 MPa",),
    "210 000 MPa": ("210000 MPa",),
    "0,210 TPa": ("0.210 TPa",),
    "210,5 GPa": ("210.5 GPa",),
    "+210·10^9": ("+210*10^9",),
    "0.21×10³": ("0.21*10^3",),
}


@pytest.mark.parametrize("written", COMMAS)
def test_every_reading_of_a_number_is_named_and_read(written: str) -> None:
    [fault] = problems(BASE, f'material.E="{written}"')
    assert repr(written) in fault.what
    meant = fault.remedy.removeprefix("write ").removeprefix("a decimal point: ").split(" or ")
    assert tuple(meant) == COMMAS[written]
    for text in meant:
        assert not problems(BASE, f'material.E="{text}"')


SYNONYMS = {
    "boundary.left": {
        "fixed": "clamped",
        "dirichlet": "clamped",
        "neumann": "traction",
        "robin": "convection",
    },
    "friction.tau_max": {"1 MPa": "tau_s"},
    "friction.s_max": {"1 mm": "delta"},
    "body.step": {"part.step": "file"},
    "sweep": {"{friction.tau_max: [1 MPa]}": "friction.tau_s"},
}


@pytest.mark.parametrize("key", SYNONYMS)
def test_words_of_other_programs_are_known(key: str) -> None:
    for word, meant in SYNONYMS[key].items():
        faults = [one for one in problems(BASE, f"{key}={word}") if one.key.startswith(key)]
        assert f"did you mean {meant!r}?" in faults[0].remedy


def test_a_range_with_its_parts_by_name_is_written_out() -> None:
    [fault] = problems(BASE, "sweep.alpha={from: 25, to: 100 W/(m^2*K), n: 4}")
    assert fault.remedy == "write {linspace: [25, 100 W/(m^2*K), 4]}"
    assert not problems(BASE, f"sweep.alpha={fault.remedy.removeprefix('write ')}")


def cut(file: Path) -> None:
    """Keep the beginning of a file, as a full disk does."""
    file.write_bytes(file.read_bytes()[:30_000])


def flip(file: Path) -> None:
    """Change a byte of a file."""
    content = bytearray(file.read_bytes())
    content[600] ^= 0x40
    file.write_bytes(content)


def edit(file: Path) -> None:
    """Change a file as other programs do, so that nothing goes on from it."""
    with netCDF4.Dataset(file, "a") as nc:
        nc.setncattr("title", "edited")


@pytest.mark.parametrize("damage", [cut, flip, edit])
def test_a_damaged_file_is_made_again_as_the_message_says(
    damage: Callable[[Path], None], tmp_path: Path
) -> None:
    file, study = tmp_path / "a.nc", CONFIGS / "quickstart.yaml"
    run = ["run", study, "--set=sweep={}", "--set=mesh.levels=1", "-q", "-o", file]
    tcstudy_command(*run, code=0)
    damage(file)
    said = tcstudy_command(*run, code=2).stderr
    shown = tcstudy_command("show", file).stderr
    if damage is cut:
        assert "remove it" in said
        assert "Remove it" in shown
        tcstudy_command(*run, "--force", code=2)
        file.unlink()
    else:
        assert "--force" in said
        assert damage is edit or "--force" in shown
        run.append("--force")
    tcstudy_command(*run, code=0)
    tcstudy_command("show", file, code=0)


@pytest.mark.skipif(os.name == "nt", reason="locks of POSIX")
def test_a_file_that_another_program_has_open_is_no_damaged_one(tmp_path: Path) -> None:
    file = tmp_path / "a.nc"
    tcstudy_command("run", CONFIGS / "quickstart.yaml", "--set=sweep={}", "-q", "-o", file, code=0)
    with (
        netCDF4.Dataset(file, "a"),
        pytest.raises(StoreError, match=r"open in another program.*Close it"),
    ):
        attributes(file)
    assert attributes(file)["title"]
