"""The guides say what is: files that exist, sections that stand, arrows that are tested, studies
that can be run."""

import re
import shutil
import tomllib
from fnmatch import fnmatch
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from ruamel.yaml import YAML

from tcstudy.read.study import read_study
from tests.commands import CONFIGS, tcstudy_command
from tests.console import WIDTH, printed, without_machine
from tests.evidence import QUOTE, claims, evidence, false_quotations, record
from tests.evidence import markdown as evidence_page
from tests.prose import cells, paragraphs, sentences
from tests.test_house import ARROWS, PACKAGE

ROOT = PACKAGE.parent
GUIDE = (PACKAGE / "README.md").read_text(encoding="utf-8")
INDEX = (CONFIGS / "README.md").read_text(encoding="utf-8")


def test_every_cited_section_of_the_method_exists() -> None:
    sections = set(
        re.findall(
            r"^## (\d+)\.", (PACKAGE / "METHOD.md").read_text(encoding="utf-8"), re.MULTILINE
        )
    )
    cited = {
        (number, path.name)
        for path in PACKAGE.rglob("*.py")
        for number in re.findall(r"(?:method|METHOD\.md) §(\d+)", path.read_text(encoding="utf-8"))
    }
    assert len({name for _, name in cited}) > 8
    assert not {one for one in cited if one[0] not in sections}


def test_files_that_the_guide_names_exist() -> None:
    named = set(re.findall(r"[\w./]+\.(?:py|md|txt)\b", GUIDE.split("## Data flow")[1]))
    roots = (PACKAGE, ROOT, PACKAGE / "data", PACKAGE / "contact")
    assert len(named) > 20
    assert not {name for name in named if not any((root / name).exists() for root in roots)}


def test_the_guide_tells_the_tested_arrows() -> None:
    told = dict(re.findall(r"^    (\w+) +→ (.*)$", GUIDE, re.MULTILINE))
    assert told == {room: ", ".join(sorted(to)) or "(none)" for room, to in ARROWS.items()}


def test_every_study_is_in_the_index() -> None:
    told = re.findall(r"^\*\*(\w+\.yaml)\*\*", INDEX, re.MULTILINE)
    assert {*told} == {path.name for path in CONFIGS.glob("*.yaml")}


HOWTO = tuple(f"configs/howto/{path.name}" for path in sorted((CONFIGS / "howto").glob("*.md")))
RESULTS = tuple(
    f"results/{name}.md" for name in ("README", "accuracy", "commands", "evidence", "pictures")
)
PAGES = (
    "README.md",
    "configs/README.md",
    "configs/tutorial.md",
    "tcstudy/README.md",
    "tcstudy/METHOD.md",
    "tcstudy/cluster.md",
    "tcstudy/trust.md",
    *RESULTS,
    *HOWTO,
)
"""Pages in plain sentences."""
GUIDES = (
    *PAGES,
    "configs/reference.md",
    "results/reference.md",
)


def anchors(text: str) -> set[str]:
    """Names under which a page's headings are linked to: small letters, no punctuation, hyphens."""
    heads = re.findall(r"^#+ (.*)$", text, re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", head.lower()).replace(" ", "-") for head in heads}


def test_links_of_the_guides_lead_somewhere() -> None:
    wrong = []
    for name in GUIDES:
        text = (ROOT / name).read_text(encoding="utf-8")
        for link in re.findall(
            r"\]\((?!https?:)([^)]+)\)", re.sub(r"```.*?```", "", text, flags=re.DOTALL)
        ):
            path, _, anchor = link.partition("#")
            target = (ROOT / name).parent / path if path else ROOT / name
            if not target.exists() or (
                anchor and anchor not in anchors(target.read_text(encoding="utf-8"))
            ):
                wrong.append(f"{name}: {link}")
    assert not wrong


def test_the_gallery_has_short_studies_and_small_pictures() -> None:
    index = INDEX.split("# More studies")[0]
    names = re.findall(r"^\*\*(\w+)\.yaml\*\*", index, re.MULTILINE)
    assert len(names) == 12
    for name in names:
        lines = (ROOT / "configs" / f"{name}.yaml").read_text(encoding="utf-8").splitlines()
        assert sum(bool(line.strip()) and not line.startswith("#") for line in lines) < 40, name
        assert f"../results/gallery-{name}.png" in index
        assert (ROOT / "results" / f"gallery-{name}.png").stat().st_size < 150_000


def test_the_first_page_is_short_and_runs_in_python(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "results").mkdir()
    (tmp_path / "configs").symlink_to(ROOT / "configs")
    monkeypatch.chdir(tmp_path)
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    assert len(text.splitlines()) < 200
    names: dict[str, object] = {}
    exec("".join(re.findall(r"```python\n(.*?)```", text, re.DOTALL)), names)
    assert names["result"]["status"].size == 72  # type: ignore[index]


def test_the_guide_of_result_files_runs_in_python(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    few = "sweep={parameters.H: [16 mm, 32 mm], mesh.grading: [0.3, 0.8]}"
    for name, *options in (("quickstart",), ("thickness_map", "--set", few)):
        tcstudy_command("run", CONFIGS / f"{name}.yaml", "-q", *options, cwd=tmp_path, code=0)
    for copy in ("a.nc", "b.nc"):
        shutil.copy(tmp_path / "results" / "quickstart.nc", tmp_path / copy)
    monkeypatch.chdir(tmp_path)
    text = (ROOT / "results" / "README.md").read_text(encoding="utf-8")
    blocks = re.findall(r"```python\n(.*?)```", text, re.DOTALL)
    names: dict[str, Any] = {}
    for block in blocks:
        if "xugrid" not in block:
            exec(block, names)
    assert len(blocks) == 4
    assert np.isfinite(names["slip"]).all()
    assert names["gap"] == 0.0
    assert names["body"]["u_T"].size == names["body"]["arclength"].size > 0


@pytest.mark.parametrize(
    "name",
    [name for name in PAGES if "```console" in (ROOT / name).read_text(encoding="utf-8")],
)
def test_guides_show_what_the_commands_print(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", str(WIDTH))
    page = (ROOT / name).read_text(encoding="utf-8")
    assert without_machine(printed(page, tmp_path)) == without_machine(page), (
        f"if this is as it should be: python -m tests.console {name}"
    )


@pytest.mark.parametrize("name", GUIDES)
def test_quotations_are_those_of_the_evidence(name: str) -> None:
    page = (ROOT / name).read_text(encoding="utf-8")
    assert not false_quotations(page, claims())


def test_false_quotations_are_seen() -> None:
    results = {"a.b": {"result": "104 of 105 met, median 1.46"}}
    page = "<!--v:a.b-->{}<!--/v-->"
    assert not false_quotations(page.format("104 of 105"), results)
    for text in ("04 of 105", "104 of 10", "104 of 106", "median 1.4", "median 1"):
        assert false_quotations(page.format(text), results)
    assert false_quotations("<!--v:a.c-->104 of 105<!--/v-->", results)


def test_the_first_page_quotes_every_figure_of_its_table() -> None:
    text = (ROOT / "README.md").read_text(encoding="utf-8").split("## How far to trust it")[1]
    rows = re.findall(r"^\|.*\]\(results/evidence.*$", text.split("## ")[0], re.MULTILINE)
    assert len(rows) == 4
    assert all(QUOTE.search(row) for row in rows)


def test_the_evidence_is_that_of_its_file() -> None:
    text = (ROOT / "results" / "evidence.md").read_text(encoding="utf-8")
    assert text == evidence_page(), "make it again: python -m tests.evidence > results/evidence.md"
    for claim in claims().values():
        module = re.fullmatch(r"(?:python -m|pytest) (tests[\w./]*).*", claim["command"])
        if module and "/" not in module[1]:
            assert (ROOT / (module[1].replace(".", "/") + ".py")).exists(), claim["command"]
        elif module:
            assert (ROOT / module[1]).exists(), claim["command"]
        assert re.fullmatch(r"every|[0-9a-f]{8}", claim["commit"]), claim["commit"]


@pytest.mark.skipif(not (ROOT / ".git").exists(), reason="the commit is that of a git work tree")
def test_a_benchmark_puts_its_result_into_file_and_page(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("evidence.json", "evidence.md"):
        shutil.copy(ROOT / "results" / name, tmp_path)
    monkeypatch.setattr("tests.evidence.FILE", tmp_path / "evidence.json")
    monkeypatch.setattr("tests.evidence.PAGE", tmp_path / "evidence.md")
    record("solver.random", "9,999 of 10,000 solved")
    claim = claims()["solver.random"]
    assert claim["result"] == "9,999 of 10,000 solved"
    row = f"9,999 of 10,000 solved | {claim['cases']}"
    assert row in (tmp_path / "evidence.md").read_text(encoding="utf-8")
    assert len(claim["commit"]) == 8
    assert false_quotations((ROOT / "README.md").read_text(encoding="utf-8"), claims())


def test_limits_of_the_evidence_agree_with_their_summary() -> None:
    held = [float(row[4].removesuffix(" %")) for row in evidence()["limits"]["rows"]]
    windows = sum(int(row[2]) for row in evidence()["limits"]["rows"])
    claim = claims()["limits.held"]
    assert claim["result"] == f"{min(held):g} to {max(held):g} % hold"
    assert f"{windows:,} windows" in claim["cases"]


MOST_WORDS = {
    "README.md": 950,
    "configs/README.md": 2800,
    "results/evidence.md": 2600,  # a row a claim, also of bonds that open
    "tcstudy/METHOD.md": 2700,  # 1,800 of friction on closed contact; the rest of contact that opens
}
LONGEST_SECTION = 250
"""Words of a section of the method, with its formulas."""
LONGEST_PAGE = 1800
LONGEST_SENTENCE, LONGEST_PARAGRAPH, LONGEST_CELL = 25, 90, 30


def test_measures_of_text_see_long_ones() -> None:
    page = "# Head\n\nOne two. Three `a b` four:\n- [Five six](x.md)\n\n| a | b; c d |\n|---|---|\n"
    assert paragraphs(page) == ["One two. Three CODE four:", "Five six"]
    assert sentences("One two. Three CODE four: Five") == ["One two.", "Three CODE four:", "Five"]
    assert cells(page) == ["a", "b; c d"]


@pytest.mark.parametrize("name", PAGES)
def test_pages_have_short_sentences_paragraphs_and_cells(name: str) -> None:
    page = (ROOT / name).read_text(encoding="utf-8")
    assert len(page.split()) <= MOST_WORDS.get(name, LONGEST_PAGE)
    texts = paragraphs(page)
    long = [
        sentence
        for text in texts
        for sentence in sentences(text)
        if len(sentence.split()) > LONGEST_SENTENCE or ";" in sentence
    ]
    assert not long
    assert not [text for text in texts if len(text.split()) > LONGEST_PARAGRAPH]
    assert not [cell for cell in cells(page) if len(cell.split()) > LONGEST_CELL]


def test_sections_of_the_method_are_short() -> None:
    page = (PACKAGE / "METHOD.md").read_text(encoding="utf-8")
    sections = re.split(r"^#+ ", page, flags=re.MULTILINE)
    long = [
        section.split("\n")[0] for section in sections if len(section.split()) > LONGEST_SECTION
    ]
    assert len(sections) > 12
    assert not long


def test_the_first_command_stands_on_top() -> None:
    lines = (ROOT / "README.md").read_text(encoding="utf-8").splitlines()
    assert lines.index("```sh") < 20


@pytest.mark.parametrize("config", sorted(CONFIGS.glob("*.yaml")), ids=lambda path: path.stem)
def test_every_study_is_planned(config: Path, tmp_path: Path) -> None:
    study = read_study(config)
    fine = study.mesh.listed or study.mesh.levels == 1  # of one with levels, sizes are predicted
    own = {"quickstart": ("--set", "mesh.levels=3"), "welded_rail": ("--set", "mesh.maxh=344 mm")}
    coarse = own.get(config.stem, () if fine else ("--set", "mesh.levels=1"))
    said = tcstudy_command("run", config, "--dry-run", *coarse, cwd=tmp_path, code=0)
    does = {"path": "  path along ", "fit": "  fit of "}.get(
        study.kind, f"{len(study.scenes)} point"
    )
    assert does in said.stdout
    assert " GB\n" in said.stdout
    assert not list(tmp_path.iterdir())


def test_changes_and_citation_are_shipped_and_of_this_version() -> None:
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    version = settings["project"]["version"]
    changes = (PACKAGE / "CHANGELOG.md").read_text(encoding="utf-8")
    assert re.findall(r"^## (.*)$", changes, re.MULTILINE)[0] == version
    citation = YAML(typ="safe").load(PACKAGE / "CITATION.cff")
    assert citation["version"] == version
    address = settings["project"]["urls"]["Paper of the method"]
    assert address == f"https://doi.org/{citation['preferred-citation']['doi']}"
    shipped = settings["tool"]["setuptools"]["package-data"]["tcstudy"]
    for name in ("CHANGELOG.md", "CITATION.cff", "METHOD.md"):
        assert any(fnmatch(name, pattern) for pattern in shipped)
