"""Streams that stop no work: whatever becomes of standard output, the work goes on and the exit
code is true."""

import errno
import io

import pytest

from tcstudy.errors import Stream, is_lost


@pytest.mark.parametrize(
    ("encoding", "text", "shown"),
    [
        ("ascii", "λ₁ µ", r"\u03bb\u2081 \xb5"),
        ("cp1252", "λ ² – µ …", r"\u03bb ² – µ …"),
        (
            "utf-8",
            "λ₁ … 漢 a\tb\x1b[31mR\x07\r\x9b\u202e",
            "λ₁ … 漢 a\tb\\x1b[31mR\\x07\\r\\x9b\\u202e",
        ),
    ],
)
def test_what_an_encoding_lacks_and_controls_are_escapes(
    encoding: str, text: str, shown: str
) -> None:
    raw = io.BytesIO()
    out = Stream(io.TextIOWrapper(raw, encoding=encoding))
    print(text, file=out)
    out.flush()
    assert raw.getvalue().decode(encoding) == shown + "\n"
    assert out.lost is None


@pytest.mark.parametrize(("number", "lost"), [(errno.ENOSPC, True), (errno.EPIPE, False)])
def test_a_stream_that_fails_is_remembered(number: int, lost: bool) -> None:
    def fail(_: str) -> int:
        raise OSError(number, "no")

    broken = io.StringIO()
    broken.write = fail  # type: ignore[method-assign, assignment]
    out = Stream(broken)
    print("text", file=out)
    print("more", file=out)
    assert isinstance(out.lost, OSError)
    assert is_lost(out) is lost
