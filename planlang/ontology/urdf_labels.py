"""Labels of a world in URDF, which knows shapes only: classes of links, boxes of meshes, hollow bodies with open sides.

They are read from the TOML file of the same name beside the URDF, else from a bundled one for URDFs of that name; what
neither names is taken from the words in the names of links.
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import field
from fnmatch import fnmatchcase
from functools import cache
from math import isfinite
from pathlib import Path
from typing import Any

from planlang.diagnostics import BadInput, Diagnostic, Span, error
from planlang.files import bundled, read_file
from planlang.ontology.terms import is_vocabulary
from planlang.records import dataclass

LARGEST = 1_000_000
"""Bytes of a file of labels."""
MOST = 2000
"""Links and meshes that one file labels."""
FARTHEST = 1000.0
"""Greatest length in a file of labels [m]."""
SIDES = ("+x", "-x", "+y", "-y", "+z", "-z")
_KEYS = {"": ("robot", "meshes", "links"), "meshes": ("size", "centre")}
_KEYS["links"] = ("class", *_KEYS["meshes"], "open", "walls")

Triplet = tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class Label:
    """The label that a file gives to a link, or to a mesh: then ``size`` and ``centre`` only."""

    span: Span
    cls: str | None = None
    """Class of the thing: a bare name of the vocabulary, or an IRI."""
    size: Triplet | None = None
    """Extents of its box [m]."""
    centre: Triplet = (0.0, 0.0, 0.0)
    """Middle of the box in the frame of the link, or of the mesh [m]."""
    open: tuple[str, ...] = ()
    """Sides of the box, such as "+x", at which it is open; if there are any, it is hollow."""
    walls: float | None = None
    """Thickness of its walls [m]."""


@dataclass(slots=True)
class Labels:
    """The labels of one file; names are patterns as those of a shell, and the first that fits counts."""

    content: bytes
    """Content of the file."""
    robot: str | None = None
    """The name of the URDFs for which it is made."""
    meshes: dict[str, Label] = field(default_factory=dict)
    """By the name of a mesh's file, without folder and suffix."""
    links: dict[str, Label] = field(default_factory=dict)

    def link(self, name: str) -> Label | None:
        """Return the label of a link, None without one."""
        return self.links.get(name) or _first(name, self.links)

    def mesh(self, file: str) -> Label | None:
        """Return the box that stands for a mesh, None without one."""
        return _first(_stem(file), self.meshes)


def _first(name: str, patterns: Mapping[str, Label]) -> Label | None:
    return next((label for pattern, label in patterns.items() if fnmatchcase(name, pattern)), None)


def _stem(file: str) -> str:
    return re.split(r"[/\\]", file)[-1].rpartition(".")[0]


def labels_for(urdf: Path, robot: str) -> tuple[Labels, ...]:
    """Return the labels of a URDF's world, those that count first in front; raises BadInput for a user's bad file."""
    beside = urdf.with_suffix(".toml")
    own = (read_labels(beside),) if beside.is_file() else ()
    return (*own, *(one for one in _bundled() if one.robot in (robot, None)))


@cache
def _bundled() -> tuple[Labels, ...]:
    """Return the bundled labels; those for any URDF come last."""
    folder = bundled("ontologies") / "environments" / "labels"
    return tuple(sorted(map(read_labels, sorted(folder.glob("*.toml"))), key=lambda one: one.robot is None))


def read_labels(path: Path) -> Labels:
    """Read a file of labels; raises BadInput with all that is wrong in it (M020)."""
    content = read_file(path, "M020", largest=LARGEST)
    try:
        text = content.decode("utf-8")
        table = tomllib.loads(text)
    except (ValueError, RecursionError) as problem:
        line = re.search(r"line (\d+)", str(problem))
        raise BadInput([error("M020", f"not TOML: {problem}", Span(str(path), int(line[1]) if line else 1))]) from None
    reader = _Reader(path, text.splitlines())
    labels = Labels(content)
    reader.read(table, labels)
    if reader.found:
        raise BadInput(reader.found)
    return labels


class _Reader:
    def __init__(self, path: Path, lines: Sequence[str]) -> None:
        self.path, self.lines = path, lines
        self.found: list[Diagnostic] = []

    def read(self, table: Mapping[str, Any], labels: Labels) -> None:
        """Read the labels of a table; what is wrong is in ``found``."""
        self._check_keys("", table, self._span(""))
        robot = table.get("robot")
        if robot is not None and not isinstance(robot, str):
            self._bad("robot is the name that a URDF gives itself, a text", self._span("robot"))
        labels.robot = robot if isinstance(robot, str) else None
        labels.meshes.update(self._entries("meshes", table))
        labels.links.update(self._entries("links", table))
        for label in labels.meshes.values():
            if label.size is None:
                self._bad("a mesh is labelled with the size of its box", label.span)

    def _entries(self, kind: str, table: Mapping[str, Any]) -> Iterator[tuple[str, Label]]:
        entries = table.get(kind, {})
        if not isinstance(entries, dict) or len(entries) > MOST:
            self._bad(f"{kind} is a table of up to {MOST} names", self._span(kind))
            return
        for name, entry in entries.items():
            span = self._span(name)
            if not isinstance(entry, dict):
                self._bad(f"{name} is a table with {', '.join(_KEYS[kind])}", span)
                continue
            self._check_keys(kind, entry, span)
            yield name, self._label(entry, span)

    def _label(self, entry: Mapping[str, Any], span: Span) -> Label:
        size, centre = (self._lengths(entry, name, span) for name in ("size", "centre"))
        if size is not None and min(size) <= 0:
            self._bad("the three lengths of size are greater than 0", span)
            size = None
        cls = self._of_kind(entry, "class", str, "the name of a class", span)
        if cls is not None and not is_vocabulary(cls) and ":" not in cls:
            self._bad(f"the vocabulary has no class {cls[:60]!r}", span)
        walls = self._of_kind(entry, "walls", (int, float), "a length in metres", span)
        if walls is not None and not 0 < walls <= FARTHEST:
            self._bad("walls is a length in metres, greater than 0", span)
            walls = None
        sides = entry.get("open", ())
        sides = [sides] if isinstance(sides, str) else sides
        if not isinstance(sides, (list, tuple)) or not all(side in SIDES for side in sides):
            self._bad(f"open is one or more of {', '.join(SIDES)}", span)
            sides = ()
        return Label(span, cls, size, centre or (0.0, 0.0, 0.0), tuple(sides), walls)

    def _of_kind(self, entry: Mapping[str, Any], name: str, kind: Any, what: str, span: Span) -> Any:
        value = entry.get(name)
        if value is not None and (not isinstance(value, kind) or isinstance(value, bool) or value == ""):
            self._bad(f"{name} is {what}", span)
            return None
        return value

    def _lengths(self, entry: Mapping[str, Any], name: str, span: Span) -> Triplet | None:
        values = entry.get(name)
        if values is None:
            return None
        if isinstance(values, list) and len(values) == 3 and all(map(_is_length, values)):
            x, y, z = map(float, values)
            return (x, y, z)
        self._bad(f"{name} is three lengths in metres, along x, y and z", span)
        return None

    def _check_keys(self, kind: str, table: Mapping[str, Any], span: Span) -> None:
        for key in table:
            if key not in _KEYS[kind]:
                self._bad(f"unknown key {key[:60]!r}; there are {', '.join(_KEYS[kind])}", self._span(key, span))

    def _span(self, key: str, otherwise: Span | None = None) -> Span:
        """Return where a key is written first."""
        quoted = re.compile(rf"""\s*(\[?links\.|\[?meshes\.|\[)?["']?{re.escape(key)}["']?\s*[=\].]""")
        line = next((n for n, line in enumerate(self.lines, 1) if key and quoted.match(line)), None)
        return Span(str(self.path), line) if line else otherwise or Span(str(self.path))

    def _bad(self, message: str, span: Span) -> None:
        self.found.append(error("M020", message, span))


def _is_length(value: object) -> bool:
    number = isinstance(value, (int, float)) and not isinstance(value, bool)
    return number and isfinite(float(value)) and abs(float(value)) <= FARTHEST  # type: ignore[arg-type]
