"""The guides say what is: files that exist, sections that stand, arrows that are tested."""

from __future__ import annotations

import re
from pathlib import Path

from tests.test_house import ARROWS, PACKAGE

ROOT = PACKAGE.parent
GUIDE = (PACKAGE / "README.md").read_text(encoding="utf-8")


def test_every_cited_section_of_the_method_exists() -> None:
    sections = set(re.findall(r"^## (\d+)\.", (PACKAGE / "METHOD.md").read_text(encoding="utf-8"), re.MULTILINE))
    cited = {
        (number, path.name)
        for path in PACKAGE.rglob("*.py")
        for number in re.findall(r"(?:method|METHOD\.md) §(\d+)", path.read_text(encoding="utf-8"))
    }
    assert len({name for _, name in cited}) > 8
    assert not {one for one in cited if one[0] not in sections}


def test_files_that_the_guide_names_exist() -> None:
    named = set(re.findall(r"[\w./]+\.(?:py|md|txt)\b", GUIDE.split("## The flow")[1]))
    roots = (PACKAGE, ROOT, PACKAGE / "data")
    assert len(named) > 20
    assert not {name for name in named if not any((root / name).exists() for root in roots)}


def test_the_guide_tells_the_tested_arrows() -> None:
    told = dict(re.findall(r"^    (\w+) +→ (.*)$", GUIDE, re.MULTILINE))
    assert told == {room: ", ".join(sorted(to)) or "(none)" for room, to in ARROWS.items()}


def test_every_study_is_in_the_index() -> None:
    index = (ROOT / "configs" / "README.md").read_text(encoding="utf-8")
    assert set(re.findall(r"^\*\*(\w+\.yaml)\*\*", index, re.MULTILINE)) == {
        path.name for path in (ROOT / "configs").glob("*.yaml")
    }


def test_a_wheel_has_the_guides() -> None:
    text = (Path(ROOT) / "pyproject.toml").read_text(encoding="utf-8")
    assert '"tcstudy" = ["py.typed", "*.md"]' in text
    assert (PACKAGE / "py.typed").exists()
