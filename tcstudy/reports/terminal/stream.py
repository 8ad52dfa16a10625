"""Standard output and error that stop no work: closed, without a reader, on a full disk, or without Greek letters.

What cannot be written is dropped and remembered; a character that the encoding lacks is spelled in ASCII; control
characters, which could come from a title or a stranger's file, are shown as escapes and never reach the terminal raw.
"""

from __future__ import annotations

import codecs
import errno
import os
import re
import sys
import unicodedata
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import Any, TextIO, cast

from tcstudy.errors import printable

_KEPT = re.compile(r"([\n\t])")

_SPELLED = {
    "α": "alpha", "β": "beta", "θ": "theta", "λ": "lambda", "μ": "u", "ν": "nu", "ξ": "xi", "σ": "sigma", "ω": "omega",
    "Γ": "Gamma", "Δ": "D", "∂": "d", "∫": "int ", "∞": "inf", "−": "-", "–": "-", "─": "-", "×": "x", "·": "*",
    "≤": "<=", "≥": ">=", "→": "->", "√": "sqrt", "ρ": "rho", "“": '"', "”": '"', "’": "'", "̄": "_bar", "⁻": "-",
}  # fmt: skip
"""What the reports contain beyond ASCII and Unicode cannot decompose into it."""


def visible(text: str) -> str:
    """The text with all but signs, tabs and newlines as escapes: an escape character becomes the characters \\x1b."""
    return "".join(part if part in ("\n", "\t") else printable(part) for part in _KEPT.split(text))


def _spelled(error: UnicodeError) -> tuple[str, int]:
    """What stands for characters that an encoding lacks: their names in ASCII, or a question mark for each."""
    assert isinstance(error, UnicodeEncodeError)
    lacking = unicodedata.normalize("NFKD", error.object[error.start])
    plain = "".join(_SPELLED.get(c, c) for c in lacking).encode("ascii", "ignore").decode("ascii")
    return plain or "?", error.start + 1


codecs.register_error("spelled", _spelled)


class Stream:
    """A text stream, or none, that takes everything and never raises; `lost` is the first error of writing."""

    def __init__(self, stream: TextIO | None, controls: bool = False) -> None:
        self._stream, self._controls = stream, controls
        self.lost: Exception | None = None

    def write(self, text: str) -> int:
        """Write the text, its control characters made visible."""
        shown = text if self._controls else visible(text)
        if self._stream is not None:
            try:
                try:
                    self._stream.write(shown)
                except UnicodeEncodeError:
                    encoding = self._stream.encoding
                    self._stream.write(shown.encode(encoding, "spelled").decode(encoding))
            except (OSError, ValueError) as error:  # ValueError: the stream was closed
                self._lose(error)
        return len(text)

    def flush(self) -> None:
        """Bring what was written on its way."""
        if self._stream is not None:
            try:
                self._stream.flush()
            except (OSError, ValueError) as error:
                self._lose(error)

    def isatty(self) -> bool:
        """Whether a person looks at it."""
        return self._stream is not None and not self._stream.closed and self._stream.isatty()

    @property
    def encoding(self) -> str:
        """The encoding of the stream."""
        return getattr(self._stream, "encoding", None) or "utf-8"

    def raw(self) -> Stream:
        """The same for a progress bar, which moves the cursor: control characters pass."""
        return Stream(self._stream, controls=True)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)

    def _lose(self, error: Exception) -> None:
        """From here on nothing is written; what the stream still holds must not fail again when Python ends."""
        self.lost = self.lost or error
        with suppress(OSError, ValueError, AttributeError):
            descriptor = cast(TextIO, self._stream).fileno()
            nowhere = os.open(os.devnull, os.O_WRONLY)
            os.dup2(nowhere, descriptor)
            os.close(nowhere)


@contextmanager
def guarded_streams() -> Iterator[Stream]:
    """Standard output and error as such streams for the time of a `with`; gives that of standard output."""
    _occupy_descriptors()
    before = sys.stdout, sys.stderr
    out, err = Stream(before[0]), Stream(before[1])
    sys.stdout, sys.stderr = cast(TextIO, out), cast(TextIO, err)
    try:
        yield out
    finally:
        out.flush()
        err.flush()
        sys.stdout, sys.stderr = before


def raw_terminal(stream: TextIO) -> TextIO:
    """A stream for a progress bar, which writes control characters of its own."""
    return cast(TextIO, stream.raw()) if isinstance(stream, Stream) else stream


def is_lost(out: Stream) -> bool:
    """Whether output was lost that someone still wanted: not when its reader had enough, as `head` does."""
    return out.lost is not None and getattr(out.lost, "errno", None) not in (errno.EPIPE, errno.ESHUTDOWN)


def _occupy_descriptors() -> None:
    """Open the closed ones of 0, 1, 2 to nowhere: a result file must not become someone's standard error."""
    for descriptor in range(3):
        try:
            os.fstat(descriptor)
        except OSError:
            with suppress(OSError):
                os.open(os.devnull, os.O_RDWR)  # gets the lowest free number, which is this one
