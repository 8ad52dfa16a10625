"""Faults that the user can mend: what is wrong, where, what to do; and the streams they go to.

All are a UserFault, which the command line catches once. It prints the text without a traceback
and returns the exit code 2.
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
MAX_VALUE_SHOWN = 60
"""Characters that a message shows of a value."""
MAX_KEY_SHOWN = 100
"""Characters that a message shows of a key path or an option."""
MAX_HALF_SHOWN = 400
"""Characters that a message shows of the problem, and of the remedy."""


def printable(text: str) -> str:
    """Return the text with escapes such as \\x1b in place of characters that print nothing."""
    if text.isascii() and text.isprintable():
        return text
    return "".join(map(_visible_character, text))


def _visible_character(character: str) -> str:
    if unicodedata.category(character) in UNSEEN:
        return character.encode("unicode_escape").decode()
    return character


def shortened(text: str, most: int = MAX_VALUE_SHOWN) -> str:
    """Return the text, cut so that a message stays one readable line."""
    return text if len(text) <= most else text[: most - 3] + "..."


SYNONYMS = {
    "clamped": "fixed fix encastre built_in dirichlet displacement prescribed support supported "
    "held",
    "traction": "neumann load loaded stress pressure",
    "convection": "robin film cooled cooling convective heat_exchange",
    "symmetry": "roller mirror sliding",
    "contact": "friction interface bond bonded glued adhesive",
    "free": "none nothing unloaded",
    "tau": "tau_max tau_f tau_u tau_p tau_b tau_peak taumax bond_strength shear_strength",
    "tau_s": "tau_max tau_f tau_u tau_p tau_b tau_peak taumax static",
    "a": "tau_max tau_peak",
    "sigma": "sigma_max sigma_u sigma_p sigma_b peel_strength tensile_strength tau",
    "sigma_s": "sigma_max sigma_u sigma_peak tau_s",
    "sigma_k": "sigma_res sigma_residual tau_k",
    "sigma_r": "sigma_res sigma_residual tau_r",
    "adhesion": "cohesive cohesion delamination peel debonding",
    "unilateral": "signorini liftoff lift_off separation gap opening",
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


def nearest(word: str, names: Iterable[str]) -> str | None:
    """Return the known word that a given one may mean: a synonym, else the most similar."""
    known_by_lower = {name.lower(): name for name in names}
    typed = word.lower()
    for name in known_by_lower.values():
        if typed in SYNONYMS.get(name, "").split():
            return name
    similar = difflib.get_close_matches(typed, known_by_lower, n=1, cutoff=0.55)
    longer = [name for name in known_by_lower if name.startswith(f"{typed}_")]
    for name in (*similar, *longer):
        return known_by_lower[name]
    return None


def hint(word: str, names: Iterable[str], otherwise: str) -> str:
    """Return the remedy for an unknown word: the nearest known one, or something else."""
    near = nearest(word, names)
    return f"did you mean {near!r}?" if near else otherwise


NUMBER = re.compile(r"(?<![\w.])-?\d+(?:\.\d+)?(?:[eE][-+]?\d+)?(?![\w.]*\w)")
"""A number that stands by itself: not the 1 of u_1 or "level_1"."""


def ranged(texts: Sequence[str]) -> str:
    """Return one text for texts that differ in numbers only, with the range of each number."""
    ranges = list[str]()
    for numbers in zip(*map(NUMBER.findall, texts), strict=True):
        low = min(numbers, key=float)
        high = max(numbers, key=float)
        ranges.append(low if float(low) == float(high) else f"{low} to {high}")
    words_between = NUMBER.split(texts[0])
    return "".join(map("".join, zip(words_between, [*ranges, ""], strict=True)))


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
        """Return the line the user sees: `file:line:column: key: what; remedy`."""
        file = self.file
        if file.startswith(_SET_FILE):
            file = shortened(file, MAX_KEY_SHOWN)
        place = f"{file}:{self.line}:{self.column}" if self.line else file
        key = f"{shortened(self.key, MAX_KEY_SHOWN)}: " if self.key else ""
        fault = shortened(self.what, MAX_HALF_SHOWN)
        remedy = shortened(self.remedy, MAX_HALF_SHOWN)
        return printable(f"{place}: {key}{fault}; {remedy}")


class StudyWarning(UserWarning):
    """What one must know of a study or its results before using them.

    The work goes on, and the result file keeps the warning.
    """


def tell(remarks: Iterable[object]) -> None:
    """Warn of each remark, at the line outside this package that asked for the work."""
    frame = inspect.currentframe()
    depth = 1
    while frame is not None and _is_inside(frame):
        frame = frame.f_back
        depth += 1
    for remark in remarks:
        warnings.warn(str(remark), StudyWarning, stacklevel=depth)


_PACKAGE = f"{Path(__file__).parent}{os.sep}"


def _is_inside(frame: FrameType) -> bool:
    """Return whether a frame is of this package, or of a `with` in it."""
    is_with = frame.f_globals.get("__name__") == "contextlib"
    return is_with or frame.f_code.co_filename.startswith(_PACKAGE)


class UserFault(Exception):
    """A fault that the user can mend.

    Its text is one line, or one line for each fault, with the reason and the remedy.
    placed: whether the text has its place; else the command line puts the name of the study first
    keys:   key path of the value in the study that decides about it, where there is one
    """

    placed = False
    keys: tuple[str, ...] | None = None

    def reword(self, change: Callable[[str], str]) -> None:
        """Replace the text by what a function makes of it."""
        self.args = tuple(change(part) if isinstance(part, str) else part for part in self.args)

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
    """Parameters cannot be fitted to the measurements."""


class DrawError(UserFault):
    """A picture cannot be made."""


class PageError(UserFault):
    """A page cannot be made."""


class ProblemError(UserFault, ValueError):
    """Matrices, a friction law or options from which no contact problem can be made."""


class GeometryFailed(UserFault):
    """The geometry kernel or the mesher cannot do what the study asks.

    keys: key path of the value in the study that decides about it
    """

    def __init__(self, text: str, keys: tuple[str, ...] = ("mesh", "maxh")) -> None:
        super().__init__(text)
        self.keys = keys


class StudyError(UserFault):
    """A study that cannot be run, with all its problems by line, without duplicates."""

    placed = True
    problems: tuple[Problem, ...]

    def __init__(self, problems: Iterable[Problem]) -> None:
        unique = dict.fromkeys(problems)
        by_place = sorted(unique, key=lambda problem: (problem.line, problem.column))
        self.problems = tuple(by_place)
        super().__init__(self.problems)

    def reword(self, change: Callable[[str], str]) -> None:
        """Replace the text of every problem; a changed value is named without its option."""
        self.problems = tuple(
            replace(
                problem,
                file=problem.file.removeprefix(_SET_FILE),
                what=change(problem.what),
                remedy=change(problem.remedy),
            )
            for problem in self.problems
        )
        self.args = (self.problems,)

    def __str__(self) -> str:
        """One line for each problem."""
        return "\n".join(str(problem) for problem in self.problems)


# -- faults in the words of Python

_SET_FILE = "--set "
_SET = re.compile(r"""--set (['"]?)([\w.\[\]-]+)=(.+?)\1(?=[\s,;)]|$)""")
_YAML_WORDS = {"null": "None", "true": "True", "false": "False"}
_OPTION = re.compile(r"(?<![\w/-])--([a-z]+)( \d+)?")


def python_words(text: str) -> str:
    """Return a message with arguments of Python in place of options of the command line.

    Thus `study.with_({"path": None})` for --set path=null, force=True for --force.
    """

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
    """Return the public function of a function: its faults are in the words of Python.

    Without it they name options of the command line.
    """

    @wraps(function)
    def door(*args: P.args, **kwargs: P.kwargs) -> T:
        try:
            return function(*args, **kwargs)
        except UserFault as fault:
            fault.reword(python_words)
            raise

    return door


_LAYOUT = re.compile(r"([\n\t])")


def visible(text: str) -> str:
    """Return the text with escapes for all that prints nothing but tabs and newlines.

    An escape character becomes the characters \\x1b.
    """
    parts = _LAYOUT.split(text)
    return "".join(part if part in ("\n", "\t") else printable(part) for part in parts)


class Stream:
    """A text stream, or none, that stops no work.

    It may be closed, without a reader, on a full disk, or without Greek letters. Text that cannot
    be written is dropped; `lost` is the first error of writing. Characters that the encoding lacks
    and control characters, which may come from a title or a stranger's file, are shown as escapes.
    """

    def __init__(self, stream: TextIO | None, controls: bool = False) -> None:
        self._stream = stream
        self._controls = controls
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
        """Return the stream for a progress bar, whose control characters move the cursor."""
        return Stream(self._stream, controls=True)

    @contextmanager
    def alone(self) -> Iterator[None]:
        """Write to a descriptor of its own in a `with`, while descriptor 1 leads nowhere.

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

    def _do(self, method: str, *args: str) -> None:
        """Call a method of the stream; from the first error on nothing is written.

        Text that the stream still holds must not fail when Python ends.
        """
        try:
            if self._stream is not None:
                getattr(self._stream, method)(*args)
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
    """Guard standard output and error for the time of a `with`; give the guarded output."""
    _fill_standard_descriptors()
    with redirect_stdout(Stream(sys.stdout)) as out, redirect_stderr(Stream(sys.stderr)) as err:
        try:
            yield out
        finally:
            out.flush()
            err.flush()


def _fill_standard_descriptors() -> None:
    """Let those of descriptors 0, 1, 2 that are closed lead nowhere.

    Else a result file could become the standard error of a library.
    """
    lowest_free = os.open(os.devnull, os.O_RDWR)
    while lowest_free < 3:
        lowest_free = os.open(os.devnull, os.O_RDWR)
    os.close(lowest_free)


def is_lost(out: Stream) -> bool:
    """Return whether output was lost that a reader still wanted.

    A reader such as `head` ends when it has enough.
    """
    code = getattr(out.lost, "errno", None)
    return out.lost is not None and code not in (errno.EPIPE, errno.ESHUTDOWN)
