"""Tables as plain text, Markdown or LaTeX, from the same cells."""

from __future__ import annotations

import itertools
import re
import textwrap
import unicodedata
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass

FORMATS = ("text", "markdown", "latex")

WIDTH = 110
"""Characters of a line of running text."""


@dataclass(frozen=True)
class Table:
    """A table: caption, header and rows of equal length; `notes` stand below it; `label` is for LaTeX.

    ranks: as of `plain_table`
    """

    caption: str
    header: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    notes: tuple[str, ...] = ()
    label: str = ""
    ranks: tuple[int, ...] = ()


@dataclass(frozen=True)
class Heading:
    """A line of text between tables; level 1 is the title."""

    text: str
    level: int = 2


Part = Table | Heading | str

_WORDS = re.compile(r" *[^ ─]+(?: [^ ]+)+$")
"""A line of words; columns of a table are two spaces or more apart."""


_width: ContextVar[int | None] = ContextVar("width", default=None)


@contextmanager
def fitting(width: int | None) -> Iterator[None]:
    """For the time of a `with`, plain text fits lines of so many characters; None: tables are as wide as they are."""
    token = _width.set(width)
    try:
        yield
    finally:
        _width.reset(token)


def render(parts: Sequence[Part], form: str) -> str:
    """All parts in one of FORMATS. LaTeX needs the packages booktabs, amsmath and amssymb."""
    one = {"text": _text, "markdown": _markdown, "latex": _latex}[form]
    return "\n\n".join(one(part) for part in parts) + "\n"


def _text(part: Part) -> str:
    if isinstance(part, Heading):
        return part.text if part.level == 1 else f"{part.text}\n{'─' * len(part.text)}"
    if isinstance(part, str):
        return _filled(part, min(WIDTH, _width.get() or WIDTH), "  ")
    table = plain_table(part.header, part.rows, part.ranks)
    return "\n".join([wrapped(f"  {part.caption}"), "", table, *(wrapped(f"  {note}") for note in part.notes)])


def _filled(text: str, width: int, indent: str) -> str:
    return textwrap.fill(text, width, subsequent_indent=indent, break_long_words=False, break_on_hyphens=False)


def wrapped(text: str) -> str:
    """The text with its lines of words filled to the width; lines of tables stay."""
    width = _width.get()
    if width is None:
        return text
    return "\n".join(_filled(line, width, "    ") if _WORDS.match(line) else line for line in text.split("\n"))


def plain_table(header: Sequence[str], rows: Sequence[Sequence[str]], ranks: Sequence[int] = ()) -> str:
    """Plain text: columns aligned right where every cell looks like a number, left otherwise.

    ranks: importance of each column: where the width is too small for all, the highest numbers go first, those of 0
           never, and a line says which went (without ranks, columns go from the right, and the first one stays)
    """
    cells = list(zip(header, *rows, strict=True))
    kept = _fitting(cells, ranks or range(len(cells)))
    gone = [name for i, name in enumerate(header) if i not in kept]
    text = _aligned([cells[i] for i in kept])
    return "\n".join([text, wrapped(f"  no room for {', '.join(gone)} (-v has all)")] if gone else [text])


def fits(header: Sequence[str], rows: Sequence[Sequence[str]]) -> bool:
    """Whether a table of all these columns has room."""
    return len(_fitting(list(zip(header, *rows, strict=True)), range(len(header)))) == len(header)


def split_table(header: Sequence[str], rows: Sequence[Sequence[str]], labels: int) -> str:
    """All columns in as many tables as the width asks for, each with the first `labels` columns."""
    parts = list[list[int]]([[]])
    for i in range(labels, len(header)):
        chosen = [*range(labels), *parts[-1], i]
        if parts[-1] and not fits([header[k] for k in chosen], [[row[k] for k in chosen] for row in rows]):
            parts.append([])
        parts[-1].append(i)
    cells = list(zip(header, *rows, strict=True))
    return "\n\n".join(_aligned([cells[k] for k in (*range(labels), *part)]) for part in parts)


def _fitting(cells: Sequence[Sequence[str]], ranks: Sequence[int]) -> list[int]:
    """The columns that stay."""
    width = _width.get()
    widths = [max(len(cell) for cell in column) for column in cells]
    kept = list(range(len(cells)))
    while width is not None and sum(widths[i] + 2 for i in kept) > width:
        last = max(kept, key=lambda i: (ranks[i], i))
        if ranks[last] == 0:
            break
        kept.remove(last)
    return kept


def _aligned(cells: Sequence[Sequence[str]]) -> str:
    header, *rows = zip(*cells, strict=True)
    widths = [max(len(cell) for cell in column) for column in cells]
    right = [_numeric(column[1:]) for column in cells]
    lines = [
        "  " + "  ".join(c.rjust(w) if r else c.ljust(w) for c, w, r in zip(row, widths, right, strict=True)).rstrip()
        for row in (header, *rows)
    ]
    return "\n".join([lines[0], "  " + "─" * (sum(widths) + 2 * (len(widths) - 1)), *lines[1:]])


def _numeric(column: Sequence[str]) -> bool:
    """Whether every cell looks like a number, alone, in parentheses or missing; such columns are aligned right."""
    return all(not cell or cell[0].isdigit() or cell[0] in "-+–∞−(" for cell in column)


def _markdown(part: Part) -> str:
    if isinstance(part, Heading):
        return f"{'#' * part.level} {part.text}"
    if isinstance(part, str):
        return part
    right = [_numeric(column) for column in zip(*part.rows, strict=True)]
    lines = [f"**{part.caption}**", "", _cells(part.header)]
    lines += ["|" + "|".join("--:" if aligned else ":--" for aligned in right) + "|"]
    lines += [_cells(row) for row in part.rows]
    return "\n".join([*lines, *(f"\n{note}" for note in part.notes)])


def _cells(row: Sequence[str]) -> str:
    return "| " + " | ".join(cell.replace("|", "\\|") for cell in row) + " |"


def _latex(part: Part) -> str:
    if isinstance(part, Heading):
        return f"\\{'section' if part.level == 1 else 'subsection'}*{{{latex(part.text)}}}"
    if isinstance(part, str):
        return latex(part)
    cells = list(zip(*part.rows, strict=True)) or [()] * len(part.header)
    spec = "".join("r" if _numeric(column) else "l" for column in cells)
    notes = " ".join(part.notes)
    caption = latex(f"{part.caption}. {notes}".strip() if notes else part.caption)
    lines = ["\\begin{table}[ht]", "\\centering", f"\\caption{{{caption}}}"]
    if part.label:
        lines.append(f"\\label{{tab:{_LABEL.sub('-', part.label)}}}")
    lines += [f"\\begin{{tabular}}{{{spec}}}", "\\toprule", _latex_row(part.header), "\\midrule"]
    lines += [_latex_row(row) for row in part.rows]
    return "\n".join([*lines, "\\bottomrule", "\\end{tabular}", "\\end{table}"])


def _latex_row(row: Sequence[str]) -> str:
    """A row; its first cell is kept from being read as an option of the \\\\ before."""
    cells = " & ".join(latex(cell) for cell in row)
    return ("{}" if cells[:1] in ("[", "*") else "") + cells + r" \\"


_LABEL = re.compile(r"[^A-Za-z0-9-]+")
_SYMBOLS = {
    **{"α": r"\alpha ", "β": r"\beta ", "γ": r"\gamma ", "δ": r"\delta ", "ε": r"\varepsilon ", "ζ": r"\zeta "},
    **{"η": r"\eta ", "θ": r"\theta ", "ι": r"\iota ", "κ": r"\kappa ", "λ": r"\lambda ", "μ": r"\mu ", "ν": r"\nu "},
    **{"ξ": r"\xi ", "π": r"\pi ", "ρ": r"\rho ", "σ": r"\sigma ", "τ": r"\tau ", "υ": r"\upsilon ", "φ": r"\varphi "},
    **{"χ": r"\chi ", "ψ": r"\psi ", "ω": r"\omega ", "Γ": r"\Gamma ", "Δ": r"\Delta ", "Θ": r"\Theta "},
    **{"Λ": r"\Lambda ", "Ξ": r"\Xi ", "Π": r"\Pi ", "Σ": r"\Sigma ", "Φ": r"\Phi ", "Ψ": r"\Psi ", "Ω": r"\Omega "},
    **{"Γ_C": r"\Gamma_C", "Γ_θ": r"\Gamma_\theta", "u_T": "u_T", "u_N": "u_N"},
    **{"∫": r"\int ", "±": r"\pm ", "≥": r"\ge ", "≤": r"\le ", "≲": r"\lesssim ", "·": r"\cdot ", "→": r"\to "},
    **{"∞": r"\infty ", "−": "-", "°": r"^{\circ}", "⁻": "^{-}", "½": r"\tfrac12 ", "~": r"\sim ", "≈": r"\approx "},
    **{"∝": r"\propto ", "µ": r"\mu ", "×": r"\times ", "∇": r"\nabla ", "∂": r"\partial ", "√": r"\surd "},
    **{"′": r"^{\prime}", "‖": r"\Vert ", "|": r"\vert ", "<": "<", ">": ">", "Δ∫ξ": r"\Delta\int\xi "},
    **{sign: f"^{{{digit}}}" for digit, sign in enumerate("⁰¹²³⁴⁵⁶⁷⁸⁹")},
    **{sign: f"_{{{digit}}}" for digit, sign in enumerate("₀₁₂₃₄₅₆₇₈₉")},
}  # fmt: skip
"""Signs in math mode."""
_ESCAPED = {
    **{sign: f"\\{sign}" for sign in "%_&#${}"},
    **{"–": "--", "—": "---", "…": r"\ldots{}", "\\": r"\textbackslash{}", "^": r"\^{}", "─": "--"},
}
"""Signs in text."""
_LATIN = "ßæøœłÆØŒŁı"
"""Letters beside the accented ones that LaTeX has in every encoding."""
_TOKEN = re.compile(
    r"r\^(?P<power>[0-9.]+)|(?<![\w.])(?P<mantissa>[-−]?[0-9]+(?:\.[0-9]*)?)e(?P<exponent>[+-][0-9]+)|"
    r"(?<![\w.)^$-])(?P<negative>-[0-9]+(?:\.[0-9]+)?)(?![\w])|(?<!\w)(?P<space>[HL])(?P<index>[¹²])|"
    + "(?P<symbol>" + "|".join(re.escape(s) for s in sorted(_SYMBOLS, key=len, reverse=True)) + ")"
    + "|(?P<escaped>" + "|".join(re.escape(s) for s in _ESCAPED) + r")|(?P<foreign>[^\x00-\x7F])"
)  # fmt: skip


def latex(text: str) -> str:
    """Text with the signs of this package's reports written for LaTeX (inputenc utf8, amsmath and amssymb).

    Letters with accents stay; other signs that LaTeX does not know by itself become their code, such as U+2713.
    """
    parts: list[tuple[bool, str]] = []
    end = 0
    for match in _TOKEN.finditer(" ".join(text.split())):
        parts.append((False, match.string[end : match.start()]))
        parts.append(_written(match))
        end = match.end()
    parts.append((False, " ".join(text.split())[end:]))
    joined = ""
    for math, group in itertools.groupby((part for part in parts if part[1]), key=lambda part: part[0]):
        tokens = [part[1] for part in group]
        joined += f"${_scripts(tokens)}$" if math else "".join(tokens)
    return joined


def _written(match: re.Match[str]) -> tuple[bool, str]:
    """(whether in math mode, LaTeX) of one token."""
    if match["power"]:
        return True, f"r^{{{match['power']}}}"
    if match["mantissa"]:
        return True, f"{match['mantissa'].replace('−', '-')}\\cdot10^{{{int(match['exponent'])}}}"
    if match["negative"]:
        return True, match["negative"]
    if match["space"]:
        return True, f"{match['space']}^{{{'1' if match['index'] == '¹' else '2'}}}"
    if match["symbol"]:
        return True, _SYMBOLS[match["symbol"]]
    if match["escaped"]:
        return False, _ESCAPED[match["escaped"]]
    sign = match["foreign"]
    accented = sign.isalpha() and ord(sign) < 0x180 and unicodedata.normalize("NFD", sign)[0].isascii()
    return False, sign if accented or sign in _LATIN else f"U+{ord(sign):04X}"


def _scripts(tokens: Sequence[str]) -> str:
    """Tokens in math mode; of exponents or indices that follow each other TeX takes only one for each sign."""
    done: list[str] = []
    taken: set[str] = set()
    for token in tokens:
        mark = token[0] if token[0] in "^_" else ""
        if not mark:
            taken = {sign for sign in "^_" if sign in token}
        elif mark in taken and done[-1].startswith(mark):
            done[-1] = f"{done[-1][:-1]}{token[2:]}"
            continue
        elif mark in taken:
            done.append("{}")
            taken = {mark}
        else:
            taken.add(mark)
        done.append(token)
    return "".join(done).strip()
