"""Messages, labels, help and guides use the terms of the field.

The left side of TERMS are words that the project once had of its own; the right side says what to
write. Names of files, keys and flags are not texts and stay.
"""

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.test_house import FILES, PACKAGE, nodes

ROOT = PACKAGE.parent
TERMS = {
    # contact
    r"\b(law|b|it) (that )?(nowhere )?falls|\bsteepest fall|\bhas fallen\b|\blast fall\b": (
        "softens; maximum softening slope"
    ),
    r"\bgives? way\b|\blets? go\b": "debonds",
    r"neither rises nor falls": "plateau",
    r"\b(from|at|to|of) rest\b|\brests? on (an|the) up-jump|\brests? on springs": (
        "sticks; unloaded state"
    ),
    r"\bslides? back\b": "slips backward",
    r"\bheld (end|edge|node)s?\b|\b(is|are|be) held\b|\bholds? the body\b|\bheld down\b": (
        "constrained, prescribed; restrains rigid-body motion"
    ),
    r"\blies? loose\b": "has a rigid-body mode",
    r"\bpinned\b": "constrained",
    r"\bsofter than its loads\b|\bthe body softer\b": (
        "the load exceeds Young's modulus; lower stiffness"
    ),
    r"\bhalf (a )?cell\b": "half the tributary length of a node",
    r"\bspread evenly\b": "uniformly distributed",
    r"\bforce of the section\b": "section force",
    r"\bsurroundings\b": "ambient temperature",
    r"\btakes? a flux\b|\bpass(es)? heat\b|\bheat put in\b": "heat flux; heat input",
    r"\bfrom which zero\b": "reference temperature",
    # paths and stability
    r"\bturns? back\b": "folds; reverses its slip",
    r"\bfalls to another branch\b|\bto and fro\b": "jumps; loading and unloading",
    r"\bclosed loops?\b": "isola, closed branch; closed hysteresis loop",
    r"\bhow far below\b": "energy released",
    r"\bleast energy\b|\bleast of all\b|\bsmall moves\b": "lowest energy found; global minimum",
    r"\bproved of (it|the body)\b|\b(nothing|none) (is )?proved\b": "no certificate; continuous problem",
    r"\blaw's polygon\b|\bby (its |their )?polygons?\b|\bpolygons? of (exponential|the) laws?\b": (
        "piecewise-linear approximation"
    ),
    r"\b(start|starts|one) led to\b|\bplaces to begin\b": "starting point, initial guess",
    # histories
    r"\bremember(s|ed)?\b|\bvirgin\b|\bway back\b": "internal variables; unloaded state; unloading",
    r"\bslip behind\b|\bnot (yet )?settled\b|\bsettled (to|rates)\b": (
        "no net slip; steady cycle; asymptotic range"
    ),
    # meshes and errors
    r"\bunknowns\b": "degrees of freedom (DOFs)",
    r"\blongest (element )?edges?\b|\bmesher aims\b": "largest element edge; target element size",
    r"\bcut into four\b": "uniform refinement",
    r"\bshare of the error\b": "marking parameter",
    r"\btrue error\b|\best\./true\b": "error; effectivity",
    r"\ba guess\b": "two levels: not judged",
    r"\bbeaten\b": "dominated",
    # statistics and fits
    r"\b(numbers|parameters) to find\b": "fitted parameters",
    r"\bnot determined\b|\bvalley\b": "not identifiable",
    r"\blets? expect\b": "consistent with the stated noise",
    r"\b(points|parameters|scenes) drawn\b|\bdrawn (points?|parameters?|at random)\b": "sampled",
    r"\bleaves a gap\b": "is bimodal",
    r"\bwhole rows\b": "complete base samples",
    r"\bat (an event|events)\b": "at a change of contact state",
    # data
    r"\basked for\b": "requested",
    r"\banew\b": "again",
    r"\bbad stud(y|ies)\b": "invalid study",
    r"\bno room\b(?! temp)": "too little space; hidden columns",
    r"\bone after the other\b": "in turn",
    r"\bgoes on where\b": "resumes",
    r"\b(row|line|option|megabyte|rail)s? an? (mesh|point|line|level|rail|cycle)\b": "per",
}
WRITTEN = [(re.compile(pattern), term) for pattern, term in TERMS.items()]
GUIDES = (
    "README.md",
    "tcstudy/METHOD.md",
    "tcstudy/README.md",
    "tcstudy/cluster.md",
    "tcstudy/trust.md",
    *(f"results/{path.name}" for path in sorted((ROOT / "results").glob("*.md"))),
    *(str(path.relative_to(ROOT)) for path in sorted((ROOT / "configs").rglob("*.md"))),
)
SCRIPTS = sorted((PACKAGE / "reports/page/assets").glob("*.js"))


def literals(path: Path) -> Iterator[tuple[str, int]]:
    """Yield the texts of a file of Python that have several words, without docstrings."""
    texts = {id(node.value) for node in nodes(path) if isinstance(node, ast.Expr)}
    for node in nodes(path):
        is_text = isinstance(node, ast.Constant) and isinstance(node.value, str)
        if is_text and id(node) not in texts and " " in node.value.strip():
            yield node.value, node.lineno


def private(text: str) -> list[str]:
    """Return the private words of a text, each with what to write."""
    return [
        f"{found[0]!r}: write {term}" for words, term in WRITTEN if (found := words.search(text))
    ]


def test_private_words_are_seen() -> None:
    assert private("the steepest fall of b") == [
        "'steepest fall': write softens; maximum softening slope"
    ]
    assert len(private("a law that falls has the least energy; nothing is proved of it")) == 3
    assert not private("a softening law")


def test_messages_and_labels_use_the_terms_of_the_field() -> None:
    wrong = [
        f"{path.relative_to(ROOT)}:{line}: {word}"
        for path in FILES
        for text, line in literals(path)
        for word in private(text)
    ]
    assert not wrong, "\n".join(wrong)


@pytest.mark.parametrize("path", SCRIPTS, ids=lambda path: path.name)
def test_page_scripts_use_the_terms_of_the_field(path: Path) -> None:
    lines = path.read_text(encoding="utf-8").splitlines()
    texts = [line for line in lines if not line.lstrip().startswith(("//", "*", "/*"))]
    assert not [word for text in texts for word in private(text)]


@pytest.mark.parametrize("name", GUIDES)
def test_guides_use_the_terms_of_the_field(name: str) -> None:
    text = (ROOT / name).read_text(encoding="utf-8")
    page = re.sub(r"`[^`\n]*`|\]\([^)]*\)", "", text)
    wrong = [
        f"{line}: {word}" for line, row in enumerate(page.splitlines(), 1) for word in private(row)
    ]
    assert not wrong, "\n".join(wrong)
