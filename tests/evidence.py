"""Write results/evidence.md from results/evidence.json, and find what guides quote of it.

`python -m tests.evidence` prints the page. Benchmarks put their results into both. A guide quotes a result as
`<!--v:NAME-->104 of 105<!--/v-->`: a part of the result of the claim with that name.
"""

import json
import re
import subprocess
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

FILE = Path(__file__).parents[1] / "results" / "evidence.json"
PAGE = FILE.with_suffix(".md")
HEAD = """# Evidence

`python -m tests.evidence` makes this page from [`evidence.json`](evidence.json). Guides quote its figures by name.
Tests compare both.

- **recorded**: by which commit. Figures of tests are checked at every commit.
- **conditions** do not depend on the machine. N counts displacement, m contact degrees of freedom.
- `benchmarks.NAME` stands for `python -m tests.benchmarks.NAME`. `python -m tests.benchmarks` writes all raw files in
  half an hour.
"""
QUOTE = re.compile(r"<!--v:([\w.]+)-->(.*?)<!--/v-->", re.DOTALL)
"""A quotation in a guide: the name of the claim and the quoted part of its result."""


def evidence() -> dict[str, Any]:
    """Return the content of results/evidence.json."""
    content: dict[str, Any] = json.loads(FILE.read_text(encoding="utf-8"))
    return content


def claims() -> dict[str, dict[str, str]]:
    """Return the claims by name. Raises ValueError for a name that is given twice."""
    found: dict[str, dict[str, str]] = {}
    for chapter in evidence()["chapters"]:
        for claim in chapter["claims"]:
            if claim["name"] in found:
                raise ValueError(f"{FILE.name}: the name {claim['name']} is repeated")
            found[claim["name"]] = claim
    return found


def record(name: str, result: str) -> None:
    """Put the result of a claim, measured at the commit of the work tree, into file and page."""
    content = evidence()
    (claim,) = (
        c for chapter in content["chapters"] for c in chapter["claims"] if c["name"] == name
    )
    command = ("git", "-C", str(Path(__file__).parent), "rev-parse", "--short=8", "HEAD")
    commit = subprocess.run(command, capture_output=True, text=True, check=True).stdout.strip()
    claim |= {"result": result, "commit": commit}
    text = json.dumps(content, ensure_ascii=False, indent=1)
    FILE.write_text(f"{text}\n", encoding="utf-8")
    PAGE.write_text(markdown(), encoding="utf-8")


def false_quotations(page: str, results: dict[str, dict[str, str]]) -> list[str]:
    """Return the quotations of a page that are no part of the result of their claim."""
    wrong = []
    for name, quoted in QUOTE.findall(page):
        words = rf"(?<![\w.,]){re.escape(' '.join(quoted.split()))}(?![\w]|[.,]\w)"
        if name not in results or not re.search(words, results[name]["result"]):
            wrong.append(f"{name}: {quoted}")
    return wrong


def markdown() -> str:
    """Return the whole page."""
    return HEAD + "".join(_chapters())


def _chapters() -> Iterator[str]:
    """Yield the lines of all chapters."""
    content = evidence()
    for chapter in content["chapters"]:
        yield f"\n## {chapter['title']}\n\n{chapter['sentence']}\n\n"
        yield from _table(
            ("claim", "result", "cases: conditions", "command", "recorded"),
            (_row(claim) for claim in chapter["claims"]),
        )
    limits = content["limits"]
    yield f"\n## {limits['title']}\n\n{limits['sentence']}\n\n"
    yield from _table(limits["columns"], limits["rows"])
    yield f"\n{limits['after']}\n"


def _row(claim: dict[str, str]) -> list[str]:
    """Return the cells of a claim; its raw file stands with the commit."""
    recorded = claim["commit"]
    if claim["raw"] and recorded != "every":  # the command names the test
        recorded += f", [{Path(claim['raw']).name}]({claim['raw']})"
    command = claim["command"].removeprefix("python -m tests.")
    return [
        f"{claim['claim']}",
        claim["result"],
        ": ".join(filter(None, (claim["cases"], claim["conditions"]))),
        command if command == "the same" else f"`{command}`",
        recorded,
    ]


def _table(titles: Iterable[str], rows: Iterable[Iterable[str]]) -> Iterator[str]:
    """Yield the lines of a table."""
    titles = list(titles)
    yield f"| {' | '.join(titles)} |\n"
    yield "|---" * len(titles) + "|\n"
    for row in rows:
        yield f"| {' | '.join(cell.replace('|', chr(92) + '|') for cell in row)} |\n"


if __name__ == "__main__":
    print(markdown(), end="")
