"""Declarations of options, their values, and options made from the values of Python or JSON."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import MISSING, Field, fields
from enum import Enum
from functools import cache
from pathlib import Path
from types import NoneType
from typing import Annotated, Any, TypeVar, get_args, get_origin, get_type_hints

from planlang.designators import GRASPS
from planlang.diagnostics import BadInput, Diagnostic, Span, WrongOption, error
from planlang.files import decode, read_file
from planlang.outputs import Named, check_outputs
from planlang.records import dataclass
from planlang.spelling import similar
from planlang.words import Option, Text

T = TypeVar("T")


@dataclass(frozen=True, slots=True)
class InHeader:
    """Key of an option in the header of a trace; a run that resumes the trace must have the same value."""

    key: str
    taken: bool = True
    """True if a resumed run takes the value from the header by default."""


@dataclass(frozen=True, slots=True)
class Declared:
    """What faces need to know of an option, beside name, type and default of its field."""

    help: str
    metavar: str | None = None
    """Stands for the value in help."""
    words: tuple[str, ...] = ()
    """Words of the command line; empty: the name of the field with dashes."""
    least: float | None = None
    most: float | None = None
    parse: Callable[[Any], Any] | None = None
    """Makes the value of what a face has: a text, a list of texts if it is repeatable, or a value of Python. Raises
    BadInput."""
    is_repeatable: bool = False
    """True if ``parse`` gets a list."""
    is_positional: bool = False
    is_shown: bool = False
    """True if it shows or writes what happens, and changes nothing of it."""
    envvar: str | None = None
    shows_default: bool = True
    writes: tuple[str, ...] | None = None
    """Suffixes of the file that is written, empty for any; None if it names no such file."""
    in_header: InHeader | None = None


def option(*words: str, metavar: str | None = None, help: str, **more: Any) -> Declared:
    """Declare an option; ``more`` are further fields of :class:`Declared`."""
    return Declared(help, metavar, words, **more)


def written(help: str, formats: tuple[str, ...] = (), *words: str) -> Declared:
    """Declare the option for a file that shows what happens; ``formats`` are its suffixes, empty for any."""
    return Declared(help, "FILE", words, is_shown=True, writes=formats)


def output(help: str, *words: str, metavar: str = "FILE") -> Declared:
    """Declare the option for the file of a command's result; ``words`` are further ones."""
    return Declared(help, metavar, ("-o", "--output", *words), writes=())


def output_folder(help: str) -> Declared:
    """Declare the option for the folder of a command's results."""
    return Declared(help, "FOLDER", ("-o", "--output"))


def argument(*, metavar: str | None = None, help: str = "", **more: Any) -> Declared:
    """Declare a positional argument."""
    return Declared(help, metavar, is_positional=True, **more)


@dataclass(frozen=True, slots=True)
class Stated:
    """A declared field: its type and its declaration."""

    field: Field[Any]
    annotation: Any
    declared: Declared

    @property
    def name(self) -> str:
        """Name of the field, and of the keyword argument."""
        return self.field.name

    @property
    def is_required(self) -> bool:
        """True if the field has no default."""
        return self.field.default is MISSING

    @property
    def kind(self) -> tuple[Any, bool]:
        """The type of a value, or of each of several, and whether there may be several."""
        members = [one for one in get_args(self.annotation) if one is not NoneType]
        kind = members[0] if NoneType in get_args(self.annotation) else self.annotation
        return (get_args(kind)[0], True) if get_origin(kind) is list else (kind, False)

    @property
    def worded(self) -> tuple[Any, bool]:
        """As ``kind``, of the words of a command line: what is parsed afterwards is text."""
        return self.kind if self.declared.parse is None else (str, self.declared.is_repeatable)

    def value(self, given: Any) -> Any:
        """Make the value of what a face has. Raises ValueError that names valid values, or BadInput."""
        if self.declared.parse is not None:
            return self.declared.parse(given)
        item, is_list = self.kind
        if is_list:
            is_one = isinstance(given, str | os.PathLike) or not isinstance(given, Iterable)
            return [self._single(item, one) for one in ([given] if is_one else given)]
        return self._single(item, given)

    def read(self, texts: Sequence[str]) -> Any:
        """Make the value of words, of a flag of true or false. Raises ValueError or BadInput as ``value`` does."""
        kind, is_list = self.worded
        if is_list:
            return self.value(list(texts))
        if len(texts) > 1:
            raise ValueError("it is stated twice")
        (text,) = texts
        if kind is bool:
            if text not in ("true", "false"):
                raise ValueError("write true or false")
            return text == "true"
        if kind in (int, float):
            try:
                number = kind(text)
            except ValueError:
                number = text  # not a number, which is refused
            return self.value(number)
        return self.value(text)

    def _single(self, kind: Any, given: Any) -> Any:
        if kind is Path and isinstance(given, str | os.PathLike) and given != "":
            return Path(given)
        if kind is str and isinstance(given, str | os.PathLike):
            return os.fspath(given)
        if isinstance(kind, type) and issubclass(kind, Enum):
            return kind(getattr(given, "value", given))
        if kind in (int, float) and isinstance(given, int | kind) and not isinstance(given, bool):
            least, most = self.declared.least, self.declared.most
            if given != given or (least is not None and given < least) or (most is not None and given > most):  # NaN
                raise ValueError(f"write a number from {least}" + (f" to {most}" if most is not None else " on"))
            return kind(given)
        if kind is bool and isinstance(given, bool):
            return given
        words = {Path: "a path", str: "a string", int: "an integer", float: "a number", bool: "True or False"}
        raise ValueError(f"write {words.get(kind, kind)}")


def declared(kind: Any) -> Mapping[str, Stated]:
    """The declared fields of a class of options, by name, in their order; other fields are not for faces."""
    return _declared(kind)


@cache
def _declared(kind: Any) -> Mapping[str, Stated]:
    hints = get_type_hints(kind, include_extras=True)
    found = {}
    for field in fields(kind):
        hint = hints[field.name]
        type_, *marks = get_args(hint) if get_origin(hint) is Annotated else (hint,)
        if (one := next((mark for mark in marks if isinstance(mark, Declared)), None)) is not None:
            found[field.name] = Stated(field, type_, one)
    return found


def values_of(options: object, kind: type) -> dict[str, Any]:
    """Values of the options that a class declares, by name."""
    return {name: getattr(options, name) for name in declared(kind)}


def stated(options: object, kind: type) -> Iterator[tuple[str, Any]]:
    """Yield the options of a class with another value than their default, and it, except of those that only show."""
    for name, one in declared(kind).items():
        value = getattr(options, name)
        told = not (one.declared.is_shown or one.declared.is_positional)
        if told and (value or value == 0) and value != one.field.default:
            yield name, value


def made(kind: type[T], values: Mapping[str, Any], own: Mapping[str, Any] | None = None) -> T:
    """Make options from values of Python or JSON, and from those ``own`` to a function; None means the default.

    A path may be a string, a repeatable option a single value. Raises BadInput (C040) for invalid values, TypeError for
    an unknown option.
    """
    known = declared(kind)
    converted, problems = dict[str, Any](), []
    further = [name for name in known if name not in (own or {})]
    for name in values:
        if name not in further:
            alike = similar(name, known)
            guess = f"; did you mean {alike[0]}?" if alike else f"; options: {', '.join(further)}"
            raise TypeError(f"there is no option {name!r}{guess}")
    for name, given in {**(own or {}), **values}.items():
        if given is None:
            continue
        try:
            converted[name] = known[name].value(given)
        except ValueError as problem:
            problems.append(error("C040", f"{name}={given!r}: {problem}"))
    if problems:
        raise BadInput(problems)
    return kind(**converted)


def as_json(options: object, kind: type) -> dict[str, Any]:
    """The stated options of a class as JSON, from which :func:`made` makes them again."""
    return {name: _plain(value) for name, value in values_of(options, kind).items() if value not in (None, ())}


def _plain(value: Any) -> Any:
    if isinstance(value, Enum):
        return value.value
    if isinstance(value, os.PathLike):
        return os.fspath(value)
    if isinstance(value, Mapping):
        return {key: _plain(one) for key, one in value.items()}
    return [_plain(one) for one in value] if isinstance(value, list | tuple) else value


def check_written(options: Any, kind: type, inputs: Mapping[Named, Path | None]) -> list[Diagnostic]:
    """Find problems with the files that the options of a class name for writing, before the work starts."""
    written = {Option(name): one.declared.writes for name, one in declared(kind).items()}
    formats = {option: suffixes for option, suffixes in written.items() if suffixes is not None}
    paths = {option: getattr(options, option.name) for option in formats}
    return check_outputs(paths, inputs, formats=formats, force=options.force)


# Values of options, from text or from values of Python

BasePose = tuple[float, float, float]
"""Pose of a base (x, y, yaw) [m, m, rad]."""
Name = str | os.PathLike[str]
"""Name of something bundled, or path of a file."""
FARTHEST = 1000.0
"""Largest coordinate of a viewpoint, and depth of a picture in parallel projection [m]."""
MOST_SETTINGS = 1_000_000
"""Maximum size of a file of bindings [bytes]."""


def name(given: Any) -> Name:
    """Check a name or a path."""
    if not isinstance(given, str | os.PathLike):
        raise ValueError("write a name or a path")
    return given


def names(given: Any) -> list[Name]:
    """Check one or more names or paths."""
    return [name(one) for one in ([given] if isinstance(given, str | os.PathLike) else given)]


def planar(given: Any) -> BasePose:
    """Pose of a base of a text "x,y,yaw" or three numbers [m, m, rad]. Raises WrongOption."""
    try:
        x, y, yaw = map(float, given.split(",") if isinstance(given, str) else given)
    except (ValueError, TypeError):
        example = Option("start", (1.5, -0.2, 3.14))
        raise WrongOption(f"{given!r} is not x,y,yaw; write for example ", example) from None
    if not all(map(math.isfinite, (x, y, yaw))):
        raise WrongOption(f"{given!r}: numbers must be finite")
    return x, y, yaw


def view(given: Any) -> str:
    """Check a view: overview, top, an eye, or an eye and a target. Raises WrongOption."""
    if isinstance(given, str) and (given in ("overview", "top") or points_of_view(given) is not None):
        return given
    raise WrongOption(Option("view", given), ": write X,Y,Z or X,Y,Z:X,Y,Z in metres, overview, or top")


def points_of_view(text: str) -> list[tuple[float, float, float]] | None:
    """Parse one or two points, ``X,Y,Z`` or ``X,Y,Z:X,Y,Z``; None for any other text, and for equal points."""
    points: list[tuple[float, float, float]] = []
    for part in text.split(":"):
        try:
            x, y, z = map(float, part.split(","))
        except ValueError:
            return None
        if not all(abs(one) <= FARTHEST for one in (x, y, z)):  # not a number is refused, too
            return None
        points.append((x, y, z))
    return points if len(points) == 1 or (len(points) == 2 and points[0] != points[1]) else None


def bindings(given: Any) -> dict[str, str]:
    """Parameters -> values, of a mapping or of texts NAME=THING; ``@FILE`` stands for its lines. Raises BadInput."""
    if isinstance(given, Mapping):
        return {str(parameter): str(value) for parameter, value in given.items()}
    found: dict[str, str] = {}
    for text, span in _settings([given] if isinstance(given, str) else given):
        parameter, equals, value = (part.strip() for part in text.partition("="))
        problem = Text(f"{parameter!r} is set twice") if parameter in found else None
        if not (parameter and equals and value):
            problem = Text(f"{text!r} is not NAME=THING; write for example ", Option("set", {"bottle": "bottle2"}))
        if problem is not None and span is None:
            raise WrongOption(problem)
        if problem is not None:
            raise BadInput([error("C018", problem, span, "each line is NAME=THING, or begins with #")])
        found[parameter] = value
    return found


def _settings(texts: Sequence[str]) -> Iterator[tuple[str, Span | None]]:
    """Yield bindings one by one, those of files with their line."""
    for text in texts:
        if not text.startswith("@"):
            yield text, None
            continue
        lines = decode(read_file(Path(text[1:]), largest=MOST_SETTINGS), text[1:]).splitlines()
        for number, line in enumerate(lines, 1):
            if line.strip() and not line.lstrip().startswith("#"):
                yield line, Span(text[1:], number)


def goals(given: Any) -> list[Any]:
    """Check goals: phrases or, in a program, also functions of the true world. Raises WrongOption."""
    each = [given] if isinstance(given, str) or callable(given) else list(given)
    if not all(isinstance(one, str) or callable(one) for one in each):
        raise WrongOption(Option("goal"), ": write a phrase such as 'cabinet1 closed', or a function of the true world")
    return each


def grasp(given: Any) -> str:
    """Check a class of grasps. Raises WrongOption."""
    if given not in GRASPS:
        raise WrongOption(Option("grasp", given), f": write {' or '.join(GRASPS)}")
    found: str = given
    return found


def shard(given: Any) -> tuple[int, int]:
    """Number of a part and of all parts, of a text "k/n" or of both. Raises WrongOption."""
    try:
        part, parts = map(int, given.split("/") if isinstance(given, str) else given)
    except (ValueError, TypeError):
        part, parts = 0, 0
    if not 1 <= part <= parts:
        raise WrongOption(
            Option("shard", given), " is not K/N with K from 1 to N; write for example ", Option("shard", "3/16")
        )
    return part, parts


def faults(given: Any) -> list[str]:
    """Check texts of faults, of which each may have several; return one text for each fault. Raises WrongOption."""
    from planlang.faults.named import WrongFault, read_faults  # few runs have any

    try:
        return [str(one) for one in read_faults([given] if isinstance(given, str) else map(str, given))]
    except WrongFault as problem:
        raise WrongOption(Option("fault"), f": {problem}") from None
