"""A strict reading of the LaTeX that the reports write, where no TeX is at hand to compile it.

Knows the commands that LaTeX, booktabs, amsmath and amssymb have and the reports use, and finds: commands it does not
know, environments, braces and math that do not close, special characters outside their place, rows of other lengths
than their tabular, two exponents or indices on one sign, labels given twice, signs beyond inputenc's utf8.
"""

from __future__ import annotations

import re
import unicodedata

MATH = set(
    re.findall(
        r"\w+",
        """alpha beta gamma delta varepsilon zeta eta theta iota kappa lambda mu nu xi pi rho sigma tau upsilon varphi
        chi psi omega Gamma Delta Theta Lambda Xi Pi Sigma Phi Psi Omega int pm ge le lesssim cdot to infty circ tfrac
        sim approx propto times nabla partial surd prime Vert vert""",
    )
)
TEXT = {"section", "subsection", "caption", "label", "centering", "toprule", "midrule", "bottomrule", "begin", "end"}
TEXT |= {"textbackslash", "ldots"}
TOKEN = re.compile(r"\\(?P<word>[A-Za-z]+)\*?|\\(?P<sign>.)|(?P<char>.)", re.DOTALL)
SPECIAL = "%#&_^~"


def faults(text: str) -> list[str]:
    """Everything that TeX would stumble over; empty if nothing is known to be wrong."""
    return [*_characters(text), *_structure(text), *_tables(text), *_labels(text)]


def _characters(text: str) -> list[str]:
    found = []
    for sign in sorted(set(text)):
        accented = sign.isalpha() and ord(sign) < 0x180 and unicodedata.normalize("NFD", sign)[0].isascii()
        if not sign.isascii() and not accented and sign not in "ßæøœłÆØŒŁı":
            found.append(f"{sign!r} is not for inputenc")
    return found


def _structure(text: str) -> list[str]:
    """Commands, braces, environments and math mode."""
    found: list[str] = []
    open_: list[str] = []
    math, depth, in_table = False, 0, 0
    text = re.sub(r"\\label\{[A-Za-z0-9:-]+\}", "", text)
    for match in TOKEN.finditer(text):
        word, sign, char = match["word"], match["sign"], match["char"]
        if word is not None:
            if word not in (MATH if math else TEXT):
                found.append(f"\\{word} has no place {'in math' if math else 'in text'}")
            if word in ("begin", "end"):
                name = text[match.end() :].partition("}")[0].lstrip("{")
                if word == "begin":
                    open_.append(name)
                elif not open_ or open_.pop() != name:
                    found.append(f"end of {name} without its begin")
                in_table += {"begin": 1, "end": -1}[word] * (name == "tabular")
        elif sign is not None:
            if sign == "\\" and (not in_table or math):
                found.append("a line break outside a table, or inside math")
            elif sign not in "\\%_&#${}^":
                found.append(f"\\{sign} is not known")
        elif char == "{":
            open_.append("{")
        elif char == "}":
            if not open_ or open_.pop() != "{":
                found.append("} without {")
        elif char == "$":
            if math and len(open_) != depth:
                found.append("math ends in another brace than it began")
            math, depth = not math, len(open_)
            if math and text[match.end() : match.end() + 1] == "$":
                found.append("$$ in running text")
        elif char in SPECIAL:
            if char == "&" and in_table and not math:
                continue
            if char in "_^" and math:
                continue
            found.append(f"{char} without a backslash: …{text[max(0, match.start() - 20) : match.end() + 5]!r}")
        elif char == "\n" and math:
            found.append("math runs over the end of a line")
    if math:
        found.append("math does not end")
    return found + [f"{name} is not closed" for name in open_] + _doubled(text)


def _doubled(text: str) -> list[str]:
    """Two exponents or two indices of one sign."""
    one = r"(?:\{[^{}]*\}|\\[A-Za-z]+|[A-Za-z0-9])"
    found = []
    for math in re.findall(r"(?<!\\)\$([^$]*)(?<!\\)\$", text):
        for chain in re.findall(rf"(?:[\^_]{one}\s*)+", math):
            marks = re.sub(rf"([\^_]){one}\s*", r"\1", chain)
            if len(set(marks)) != len(marks):
                found.append(f"double exponent or index in ${math}$")
    return found


def _tables(text: str) -> list[str]:
    found = []
    for spec, body in re.findall(r"\\begin\{tabular\}\{([a-z]*)\}\n(.*?)\\end\{tabular\}", text, re.DOTALL):
        lines = [line for line in body.strip().split("\n") if line not in (r"\toprule", r"\midrule", r"\bottomrule")]
        if body.strip().split("\n")[0] != r"\toprule" or body.strip().split("\n")[-1] != r"\bottomrule":
            found.append("a table without its rules")
        for line in lines:
            if not line.endswith(r" \\"):
                found.append(f"a row that does not end: {line!r}")
            count = len(re.findall(r"(?<!\\)&", line.replace(r"\\", ""))) + 1
            if count != len(spec):
                found.append(f"{count} cells in {len(spec)} columns: {line!r}")
            if line.lstrip()[:1] in ("[", "*"):
                found.append(f"the row begins with an option of the line break before: {line!r}")
    if text.count("\\begin{tabular}") != len(re.findall(r"\\begin\{tabular\}\{[lcr]+\}", text)):
        found.append("a tabular without columns")
    return found


def _labels(text: str) -> list[str]:
    labels = re.findall(r"\\label\{(.*?)\}", text)
    return [f"the label {label!r} is given twice" for label in sorted({x for x in labels if labels.count(x) > 1})] + [
        f"the label {label!r} has strange signs" for label in labels if not re.fullmatch(r"[A-Za-z0-9:-]+", label)
    ]
