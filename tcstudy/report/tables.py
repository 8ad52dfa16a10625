"""Tables as plain text, Markdown or LaTeX, from the same cells."""

from __future__ import annotations

import re
import textwrap
from collections.abc import Sequence
from dataclasses import dataclass

FORMATS = ("text", "markdown", "latex")

WIDTH = 110
"""Characters of a line of running text."""


@dataclass(frozen=True)
class Table:
    """A table: caption, header and rows of equal length; `notes` stand below it; `label` is for LaTeX."""

    caption: str
    header: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    notes: tuple[str, ...] = ()
    label: str = ""


@dataclass(frozen=True)
class Heading:
    """A line of text between tables; level 1 is the title."""

    text: str
    level: int = 2


Part = Table | Heading | str


def render(parts: Sequence[Part], form: str) -> str:
    """All parts in one of FORMATS. LaTeX needs the packages booktabs and amsmath."""
    one = {"text": _text, "markdown": _markdown, "latex": _latex}[form]
    return "\n\n".join(one(part) for part in parts) + "\n"


def _text(part: Part) -> str:
    if isinstance(part, Heading):
        return part.text if part.level == 1 else f"{part.text}\n{'─' * len(part.text)}"
    if isinstance(part, str):
        return textwrap.fill(part, WIDTH, subsequent_indent="  ", break_long_words=False)
    columns = list(zip(part.header, *part.rows, strict=True))
    widths = [max(len(cell) for cell in column) for column in columns]
    right = [_numeric(column[1:]) for column in columns]
    lines = [
        "  " + "  ".join(c.rjust(w) if r else c.ljust(w) for c, w, r in zip(row, widths, right, strict=True)).rstrip()
        for row in (part.header, *part.rows)
    ]
    rule = "  " + "─" * (sum(widths) + 2 * (len(widths) - 1))
    notes = [f"  {note}" for note in part.notes]
    return "\n".join([f"  {part.caption}", "", lines[0], rule, *lines[1:], *notes])


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
    columns = "".join("r" if _numeric(c) else "l" for c in zip(*part.rows, strict=True))
    notes = " ".join(part.notes)
    caption = latex(f"{part.caption}. {notes}".strip() if notes else part.caption)
    lines = ["\\begin{table}[ht]", "\\centering", f"\\caption{{{caption}}}"]
    if part.label:
        lines.append(f"\\label{{tab:{part.label}}}")
    lines += [f"\\begin{{tabular}}{{{columns}}}", "\\toprule", _latex_row(part.header), "\\midrule"]
    lines += [_latex_row(row) for row in part.rows]
    return "\n".join([*lines, "\\bottomrule", "\\end{tabular}", "\\end{table}"])


def _latex_row(row: Sequence[str]) -> str:
    return " & ".join(latex(cell) for cell in row) + r" \\"


_SYMBOLS = {
    **{
        "θ": r"\theta",
        "ξ": r"\xi",
        "λ": r"\lambda",
        "α": r"\alpha",
        "γ": r"\gamma",
        "Γ_C": r"\Gamma_C",
        "Γ_θ": r"\Gamma_\theta",
    },
    **{
        "Ω": r"\Omega",
        "∫": r"\int",
        "±": r"\pm",
        "≥": r"\ge",
        "≤": r"\le",
        "·": r"\cdot",
        "→": r"\to",
        "∞": r"\infty",
        "−": "-",
    },
    **{
        "°": r"^{\circ}",
        "²": "^{2}",
        "¹": "^{1}",
        "⁻": "^{-}",
        "½": r"\tfrac12",
        "~": r"\sim",
        "µ": r"\mu ",
        "×": r"\times",
    },
    **{"u_T": "u_T", "|": r"\vert ", "<": "<", ">": ">", "ν": r"\nu", "∇": r"\nabla"},
}
_ESCAPED = {
    "%": r"\%",
    "_": r"\_",
    "&": r"\&",
    "#": r"\#",
    "$": r"\$",
    "{": r"\{",
    "}": r"\}",
    "–": "--",
    "…": r"\ldots{}",
}
_TOKEN = re.compile(
    r"r\^(?P<power>[0-9.]+)|(?P<mantissa>-?[0-9.]+)e(?P<exponent>[+-][0-9]+)|(?P<space>[HL])(?P<index>[¹²])|"
    + "(?P<symbol>" + "|".join(re.escape(s) for s in sorted(_SYMBOLS, key=len, reverse=True)) + ")"
    + r"|(?P<escaped>[%_&#${}–…])|(?P<other>[\\^])"
)  # fmt: skip


def latex(text: str) -> str:
    """Text with the signs of this package's reports written for LaTeX."""

    def one(match: re.Match[str]) -> str:
        if match["power"]:
            return f"$r^{{{match['power']}}}$"
        if match["mantissa"]:
            return f"${match['mantissa']}\\cdot10^{{{int(match['exponent'])}}}$"
        if match["space"]:
            return f"${match['space']}^{{{'1' if match['index'] == '¹' else '2'}}}$"
        if match["symbol"]:
            return f"${_SYMBOLS[match['symbol']]}$"
        if match["escaped"]:
            return _ESCAPED[match["escaped"]]
        return r"\textbackslash{}" if match["other"] == "\\" else r"\^{}"

    return _TOKEN.sub(one, text).replace("$$", " ")
