"""Split a page of a guide into paragraphs, sentences and cells of tables, to measure them."""

import re

APART = re.compile(r"^(?=[-*] |\d+\. |#|\||>$)", re.MULTILINE)
"""Starts of lines that begin a paragraph of their own."""


def paragraphs(page: str) -> list[str]:
    """Return the paragraphs and entries of lists, without tables, code, headings and pictures."""
    blocks = [
        block
        for part in re.split(r"\n\s*\n", _without_code(page))
        for block in APART.split(part)
        if not block.startswith(("#", "|", "    ", "<"))
    ]
    plain = [" ".join(_plain(block).split()) for block in blocks]
    return [text for text in plain if text]


def sentences(text: str) -> list[str]:
    """Return the sentences of a paragraph; a colon before a capital letter ends one."""
    return re.split(r"(?<=[.!?:])\s+(?=[A-Z])", text)


def cells(page: str) -> list[str]:
    """Return the cells of all tables that are not empty."""
    rows = re.findall(r"^\|(.*)\|$", _without_code(page), re.MULTILINE)
    texts = [_plain(cell).strip() for row in rows for cell in re.split(r"(?<!\\)\|", row)]
    return [text for text in texts if text.strip("-: ")]


def _without_code(page: str) -> str:
    """Return a page without its blocks of code."""
    return re.sub(r"^```.*?^```$", "", page, flags=re.DOTALL | re.MULTILINE)


def _plain(text: str) -> str:
    """Return a text without marks; a piece of code is one word, a link its text."""
    text = re.sub(r"`[^`]*`", "CODE", text)
    text = re.sub(r"!?\[([^\]]*)\]\([^)]*\)", r"\1", text)
    return re.sub(r"^(?:[-*>] ?|\d+\. )|\*\*", "", text, flags=re.MULTILINE)
