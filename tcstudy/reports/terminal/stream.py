"""Standard output and error that stop no work: closed, without a reader, on a full disk, or without Greek letters.

What cannot be written is dropped and remembered; characters that the encoding lacks and control characters, which may
come from a title or a stranger's file, are shown as escapes and never reach the terminal raw.
"""

from __future__ import annotations

import errno
import io
import os
import re
import sys
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stderr, redirect_stdout, suppress
from typing import Any, TextIO, cast

from tcstudy.errors import printable

_KEPT = re.compile(r"([\n\t])")


def visible(text: str) -> str:
    """The text with all but signs, tabs and newlines as escapes: an escape character becomes the characters \\x1b."""
    return "".join(part if part in ("\n", "\t") else printable(part) for part in _KEPT.split(text))


class Stream:
    """A text stream, or none, that takes everything and never raises; `lost` is the first error of writing."""

    def __init__(self, stream: TextIO | None, controls: bool = False) -> None:
        self._stream, self._controls = stream, controls
        self.lost: Exception | None = None
        if isinstance(stream, io.TextIOWrapper) and not stream.closed:
            stream.reconfigure(errors="backslashreplace")

    def write(self, text: str) -> int:
        """Write the text, its control characters made visible."""
        self._do("write", text if self._controls else visible(text))
        return len(text)

    def flush(self) -> None:
        """Bring what was written on its way."""
        self._do("flush")

    def isatty(self) -> bool:
        """Whether a person looks at it."""
        return self._stream is not None and not self._stream.closed and self._stream.isatty()

    def raw(self) -> Stream:
        """The same for a progress bar, which moves the cursor: control characters pass."""
        return Stream(self._stream, controls=True)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)

    def _do(self, what: str, *given: str) -> None:
        """From the first error on nothing is written; what the stream still holds must not fail when Python ends."""
        try:
            if self._stream is not None:
                getattr(self._stream, what)(*given)
        except (OSError, ValueError) as error:  # ValueError: the stream was closed
            self.lost = self.lost or error
            with suppress(OSError, ValueError, AttributeError):
                os.dup2(os.open(os.devnull, os.O_WRONLY), cast(TextIO, self._stream).fileno())


@contextmanager
def guarded_streams() -> Iterator[Stream]:
    """Standard output and error as such streams for the time of a `with`; gives that of standard output."""
    while (lowest_free := os.open(os.devnull, os.O_RDWR)) < 3:
        pass  # of 0, 1, 2 those that are closed lead nowhere: a result file must not become someone's standard error
    os.close(lowest_free)
    with redirect_stdout(Stream(sys.stdout)) as out, redirect_stderr(Stream(sys.stderr)) as err:
        try:
            yield out
        finally:
            out.flush()
            err.flush()


def is_lost(out: Stream) -> bool:
    """Whether output was lost that someone still wanted: not when its reader had enough, as `head` does."""
    return out.lost is not None and getattr(out.lost, "errno", None) not in (errno.EPIPE, errno.ESHUTDOWN)
