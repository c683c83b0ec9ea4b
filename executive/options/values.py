"""Values of options, from text or from values of Python."""

from __future__ import annotations

import math
import os
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from planlang.diagnostics import BadInput, Span, WrongOption, error
from planlang.files import decode, read_file
from planlang.words import Option, Text

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


def is_view(text: str) -> bool:
    """Check the syntax of a view: overview, top, an eye, or an eye and a target."""
    return text in ("overview", "top") or points_of_view(text) is not None


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
