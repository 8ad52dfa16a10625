"""Faults that the user can mend: what is wrong, where, what to do. All are a UserFault, which the
command line catches once: its text is printed without a traceback, the exit code is 2. And the
streams that it is printed to.
"""

from __future__ import annotations

import difflib
import errno
import inspect
import io
import os
import re
import sys
import unicodedata
import warnings
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager, redirect_stderr, redirect_stdout, suppress
from dataclasses import dataclass, replace
from functools import wraps
from pathlib import Path
from types import FrameType
from typing import Any, ParamSpec, TextIO, TypeVar, cast

P = ParamSpec("P")
T = TypeVar("T")

UNSEEN = {"Cc", "Cf", "Cs", "Co", "Cn", "Zl", "Zp"}
"""Unicode categories that print nothing, begin a line or steer a terminal."""
LONGEST_KEY, LONGEST_PART = 100, 400
"""Characters that a message shows of a key path or an option, and of each of its halves."""


def printable(text: str) -> str:
    """The text with escapes such as \\x1b in place of characters that are no sign."""
    if text.isascii() and text.isprintable():
        return text
    return "".join(
        c.encode("unicode_escape").decode() if unicodedata.category(c) in UNSEEN else c
        for c in text
    )


def shortened(text: str, most: int = 60) -> str:
    """The text, cut so that a message stays one readable line."""
    return text if len(text) <= most else text[: most - 3] + "..."


SYNONYMS = {
    "clamped": "fixed fix encastre built_in dirichlet displacement prescribed support supported held",
    "traction": "neumann load loaded stress pressure",
    "convection": "robin film cooled cooling convective heat_exchange",
    "symmetry": "roller mirror sliding",
    "contact": "friction interface bond bonded glued adhesive",
    "free": "none nothing unloaded",
    "tau": "tau_max tau_f tau_u tau_p tau_b tau_peak taumax bond_strength shear_strength",
    "tau_s": "tau_max tau_f tau_u tau_p tau_b tau_peak taumax static",
    "a": "tau_max tau_peak",
    "tau_k": "tau_res tau_residual tau_d tau_r kinetic",
    "tau_r": "tau_res tau_residual tau_d tau_k",
    "sf": "s_max s_f s_u s_ult smax slip_max max_slip ultimate_slip delta_f delta_u final_slip",
    "delta": "s_max s_f s_u smax d_c slip_max max_slip critical_slip slip_distance",
    "s0": "s_0 s_y s_e delta_0 elastic_slip",
    "G_f": "gf g_c gc g_ii fracture_energy",
    "bilinear": "triangular cohesive",
    "elastic-plastic": "elastic-perfectly-plastic elastoplastic elasto-plastic",
    "tresca": "constant rigid-plastic perfectly-plastic",
    "piecewise-linear": "polygon polyline tabulated multilinear",
    "E": "young youngs_modulus young_modulus modulus elastic_modulus e_modulus",
    "nu": "poisson poissons_ratio poisson_ratio v",
    "alpha_T": "cte thermal_expansion expansion alphat alpha_th",
    "k": "conductivity thermal_conductivity",
    "alpha": "htc film_coefficient heat_transfer_coefficient",
    "theta_bar": "ambient t_inf t_air t_ambient t_ext t_env air",
    "theta": "temperature t delta_t",
    "file": "step stp cad brep iges geometry",
    "outline": "polygon vertices corners polyline",
    "rectangle": "box rect square",
    "regions": "subdomains domains parts",
    "boundary": "constraints bcs bc edges boundary_conditions",
    "maxh": "h h_max hmax size mesh_size element_size",
    "levels": "refinements refinement_levels",
    "linspace": "range linear spaced",
    "geomspace": "logspace log geometric",
    "u_T_max": "max_slip slip_max largest_slip maximum_slip u_max",
    "friction_resultant": "force resultant friction friction_force reaction",
    "shear_max": "max_shear shear tau_max xi_max",
    "theta_mean": "temperature mean_temperature",
}
"""Words of a study or a file, with those that people type for them."""


def nearest(word: str, known: Iterable[str]) -> str | None:
    """Return the known word that means the same as the given one, else the one most like it, if any
    is."""
    lowered = {name.lower(): name for name in known}
    for name in lowered.values():
        if word.lower() in SYNONYMS.get(name, "").split():
            return name
    near = difflib.get_close_matches(word.lower(), lowered, n=1, cutoff=0.55)
    longer = (name for name in lowered if name.startswith(f"{word.lower()}_"))
    meant = near[0] if near else next(longer, None)
    return lowered[meant] if meant is not None else None


def hint(word: str, known: Iterable[str], otherwise: str) -> str:
    """Remedy for a word that is not known: the nearest that is, or something else."""
    near = nearest(word, known)
    return f"did you mean {near!r}?" if near else otherwise


NUMBER = re.compile(r"(?<![\w.])-?\d+(?:\.\d+)?(?:[eE][-+]?\d+)?(?![\w.]*\w)")
"""A number that stands by itself: not the 1 of u_1 or "level_1"."""


def ranged(texts: Sequence[str]) -> str:
    """Texts that differ in their numbers only as one, with the range of each number."""
    columns = zip(*map(NUMBER.findall, texts), strict=True)
    ends = [(min(column, key=float), max(column, key=float)) for column in columns]
    shown = [low if float(low) == float(high) else f"{low} to {high}" for low, high in ends]
    return "".join(map("".join, zip(NUMBER.split(texts[0]), [*shown, ""], strict=True)))


@dataclass(frozen=True)
class Problem:
    """One fault in a study.

    file:   the file as the user named it, or the `--set` option at fault
    line, column: both from 1; 0 where there is no line (options, unreadable files)
    key:    path of the key, e.g. "boundary.top.pressure"; empty for the file as a whole
    what:   what is wrong;  remedy: what to do
    """

    file: str
    line: int
    column: int
    key: str
    what: str
    remedy: str

    def __str__(self) -> str:
        """The line the user sees: `file:line:column: key: what; remedy`."""
        file = shortened(self.file, LONGEST_KEY) if self.file.startswith("--set ") else self.file
        place = f"{file}:{self.line}:{self.column}" if self.line else file
        key = f"{shortened(self.key, LONGEST_KEY)}: " if self.key else ""
        what, remedy = shortened(self.what, LONGEST_PART), shortened(self.remedy, LONGEST_PART)
        return printable(f"{place}: {key}{what}; {remedy}")


class StudyWarning(UserWarning):
    """What one must know of a study or its results before using them; the work goes on, and the
    file keeps it."""


def tell(found: Iterable[object]) -> None:
    """Warn of each, at the line outside this package that asked for the work."""
    frame, depth = inspect.currentframe(), 1
    while frame is not None and (frame.f_code.co_filename.startswith(_PACKAGE) or _of_with(frame)):
        frame, depth = frame.f_back, depth + 1
    for one in found:
        warnings.warn(str(one), StudyWarning, stacklevel=depth)


_PACKAGE = f"{Path(__file__).parent}{os.sep}"


def _of_with(frame: FrameType) -> bool:
    return frame.f_globals.get("__name__") == "contextlib"


class UserFault(Exception):
    """What the user can mend; the text is one line (or one line for each fault) that says why and
    what to do.

    placed: whether the text says where already; else the command line puts the name of the study before it
    keys:   key path of the value in the study that decides about it, where there is one
    """

    placed = False
    keys: tuple[str, ...] | None = None

    def reword(self, words: Callable[[str], str]) -> None:
        """Replace the text by what a function makes of it."""
        self.args = tuple(words(part) if isinstance(part, str) else part for part in self.args)

    def _render_traceback_(self) -> list[str]:
        return [f"{type(self).__name__}: {self}"]


class UsageError(UserFault):
    """Options of a command that do not go together, or a study that cannot be used for it."""

    placed = True


class StoreError(UserFault):
    """Results cannot be kept or read."""


class ConvergenceError(UserFault):
    """The convergence of a study cannot be measured."""


class CostError(UserFault):
    """Accuracy against cost cannot be measured."""


class PathError(UserFault):
    """A path cannot be followed."""


class HistoryError(UserFault):
    """A load history cannot be followed."""


class FitError(UserFault):
    """Numbers cannot be found from the measurements."""


class DrawError(UserFault):
    """A picture cannot be made."""


class PageError(UserFault):
    """There can be no page."""


class ProblemError(UserFault, ValueError):
    """Matrices, a friction law or options from which no contact problem can be made."""


class GeometryFailed(UserFault):
    """The geometry kernel or the mesher could not do what the study asks; the text says what and
    what to try.

    keys: key path of the value in the study that decides about it
    """

    def __init__(self, text: str, keys: tuple[str, ...] = ("mesh", "maxh")) -> None:
        super().__init__(text)
        self.keys = keys


class StudyError(UserFault):
    """A study that cannot be run, with all its problems, sorted by line and without duplicates."""

    placed = True
    problems: tuple[Problem, ...]

    def __init__(self, problems: Iterable[Problem]) -> None:
        unique = dict.fromkeys(problems)
        self.problems = tuple(sorted(unique, key=lambda p: (p.line, p.column)))
        super().__init__(self.problems)

    def reword(self, words: Callable[[str], str]) -> None:
        """Replace what is said of every problem; a change of the study is its own place."""
        self.problems = tuple(
            replace(
                problem,
                file=problem.file.removeprefix(_SET_FILE),
                what=words(problem.what),
                remedy=words(problem.remedy),
            )
            for problem in self.problems
        )
        self.args = (self.problems,)

    def __str__(self) -> str:
        """One line for each problem."""
        return "\n".join(str(problem) for problem in self.problems)


# -- faults in the words of Python
# ------------------------------------------------------

_SET_FILE = "--set "
_SET = re.compile(r"""--set (['"]?)([\w.\[\]-]+)=(.+?)\1(?=[\s,;)]|$)""")
_YAML_WORDS = {"null": "None", "true": "True", "false": "False"}
_OPTION = re.compile(r"(?<![\w/-])--([a-z]+)( \d+)?")


def python_words(text: str) -> str:
    """Return a message with arguments of Python in place of options of the command line:
    `study.with_({"path": None})` for --set path=null, force=True for --force."""

    def change(option: re.Match[str]) -> str:
        key, value = option[2], option[3]
        is_number = NUMBER.fullmatch(value) is not None
        python = value if is_number else _YAML_WORDS.get(value, repr(value))
        return f'study.with_({{"{key}": {python}}})'

    def argument(option: re.Match[str]) -> str:
        name, count = option[1], option[2]
        if name == "set":
            return "study.with_(...)" + (count or "")
        if name in ("force", "append"):
            return f"{name}=True" + (count or "")
        return f"{name}={count.strip()}" if count else name

    text = _SET.sub(change, text.replace(" with -o", ""))
    return _OPTION.sub(argument, text)


def python_door(function: Callable[P, T]) -> Callable[P, T]:
    """Return a public function whose faults are in the words of Python; others raise the same with
    options of the command line."""

    @wraps(function)
    def door(*given: P.args, **named: P.kwargs) -> T:
        try:
            return function(*given, **named)
        except UserFault as fault:
            fault.reword(python_words)
            raise

    return door


_KEPT = re.compile(r"([\n\t])")


def visible(text: str) -> str:
    """The text with all but signs, tabs and newlines as escapes: an escape character becomes the
    characters \\x1b."""
    return "".join(part if part in ("\n", "\t") else printable(part) for part in _KEPT.split(text))


class Stream:
    """A text stream, or none, that stops no work: closed, without a reader, on a full disk, or
    without Greek letters.

    What cannot be written is dropped; `lost` is the first error of writing. Characters that the
    encoding lacks and control characters, which may come from a title or a stranger's file, are
    shown as escapes.
    """

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

    @contextmanager
    def alone(self) -> Iterator[None]:
        """Write to a descriptor of its own for the time of a `with`, while descriptor 1 leads
        nowhere.

        The geometry kernel and the mesher print to descriptor 1, past Python. A stream that is not
        on descriptor 1 stays as it is.
        """
        shared = self._stream
        if not isinstance(shared, io.TextIOWrapper) or _descriptor(shared) != 1:
            yield
            return
        self.flush()
        original = os.dup(1)
        try:
            with open(os.devnull, "w") as nowhere, _reopened(shared, original) as self._stream:
                os.dup2(nowhere.fileno(), 1)
                try:
                    yield
                finally:
                    self.flush()
                    _flush_c_streams()  # text that a library holds back would come later
                    os.dup2(original, 1)
        finally:
            self._stream = shared
            os.close(original)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)

    def _do(self, what: str, *given: str) -> None:
        """From the first error on nothing is written; what the stream still holds must not fail
        when Python ends."""
        try:
            if self._stream is not None:
                getattr(self._stream, what)(*given)
        except (OSError, ValueError) as error:  # ValueError: the stream was closed
            self.lost = self.lost or error
            with suppress(OSError, ValueError, AttributeError):
                os.dup2(os.open(os.devnull, os.O_WRONLY), cast(TextIO, self._stream).fileno())


def _descriptor(stream: TextIO) -> int | None:
    """Return the descriptor of a stream, None for a closed one or one in memory."""
    try:
        return stream.fileno()
    except (OSError, ValueError):
        return None


def _reopened(stream: io.TextIOWrapper, descriptor: int) -> io.TextIOWrapper:
    """Return a stream like the given one on a duplicate of another descriptor."""
    return io.TextIOWrapper(
        open(os.dup(descriptor), "wb"),
        encoding=stream.encoding,
        errors=stream.errors,
        line_buffering=stream.line_buffering,
        write_through=stream.write_through,
    )


def _flush_c_streams() -> None:
    """Bring what C and C++ libraries have printed on its way, where the C library can be asked."""
    import ctypes

    with suppress(OSError, AttributeError, TypeError):
        ctypes.CDLL(None).fflush(None)


@contextmanager
def guarded_streams() -> Iterator[Stream]:
    """Standard output and error as such streams for the time of a `with`; gives that of standard
    output."""
    while (lowest_free := os.open(os.devnull, os.O_RDWR)) < 3:
        # of 0, 1, 2 those that are closed lead nowhere: a result file must not become someone's
        # standard error
        pass
    os.close(lowest_free)
    with redirect_stdout(Stream(sys.stdout)) as out, redirect_stderr(Stream(sys.stderr)) as err:
        try:
            yield out
        finally:
            out.flush()
            err.flush()


def is_lost(out: Stream) -> bool:
    """Whether output was lost that someone still wanted: not when its reader had enough, as `head`
    does."""
    return out.lost is not None and getattr(out.lost, "errno", None) not in (
        errno.EPIPE,
        errno.ESHUTDOWN,
    )
