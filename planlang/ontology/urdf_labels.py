"""Labels of a world in URDF: what a URDF cannot state (classes, boxes of missing meshes, open sides), in TOML files."""

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
from planlang.files import bundled, decode, read_file
from planlang.ontology.terms import is_vocabulary
from planlang.records import dataclass

FARTHEST = 1000.0
"""Greatest distance from the origin, and greatest length of a box or a label [m]."""
LARGEST = 1_000_000
"""Greatest size of a file of labels [bytes]."""
MOST_LABELS = 2000
"""Greatest number of labelled links, and of meshes, in a file."""
SIDES = ("+x", "-x", "+y", "-y", "+z", "-z")
_KEYS = {"": ("robot", "meshes", "links"), "meshes": ("size", "centre")}
_KEYS["links"] = ("class", *_KEYS["meshes"], "open", "walls")

Triplet = tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class Label:
    """Label of a link, or of a mesh: then with ``size`` and ``centre`` only."""

    span: Span
    cls: str | None = None
    """Class of the object: a bare name of the vocabulary, or an IRI."""
    size: Triplet | None = None
    """Extents of its box [m]."""
    centre: Triplet = (0.0, 0.0, 0.0)
    """Centre of the box in the frame of the link, or of the mesh [m]."""
    open: tuple[str, ...] = ()
    """Open sides of the box, such as "+x"; a box with open sides is hollow."""
    walls: float | None = None
    """Thickness of its walls [m]."""


@dataclass(slots=True)
class Labels:
    """Labels of one file; names are shell patterns (fnmatch), of which the first match counts."""

    content: bytes
    """Bytes of the file."""
    robot: str | None = None
    """Name of the robot element of URDFs that it applies to; None: any."""
    meshes: dict[str, Label] = field(default_factory=dict)
    """File name of a mesh, without folder and suffix -> label."""
    links: dict[str, Label] = field(default_factory=dict)

    def link(self, name: str) -> Label | None:
        """Label of a link, if any."""
        return self.links.get(name) or _first(name, self.links)

    def mesh(self, file: str) -> Label | None:
        """Label with the box of a mesh, if any."""
        return _first(re.split(r"[/\\]", file)[-1].rpartition(".")[0], self.meshes)


def _first(name: str, patterns: Mapping[str, Label]) -> Label | None:
    return next((label for pattern, label in patterns.items() if fnmatchcase(name, pattern)), None)


def labels_for(urdf: Path, robot: str) -> tuple[Labels, ...]:
    """Find the labels for a URDF, in order of precedence. Raises BadInput if the file beside it is invalid."""
    beside = urdf.with_suffix(".toml")
    own = (read_labels(beside),) if beside.is_file() else ()
    return (*own, *(one for one in _bundled() if one.robot in (robot, None)))


@cache
def _bundled() -> tuple[Labels, ...]:
    """Read the bundled labels; those for any URDF come last."""
    folder = bundled("ontologies") / "environments" / "labels"
    return tuple(sorted(map(read_labels, sorted(folder.glob("*.toml"))), key=lambda one: one.robot is None))


def read_labels(path: Path) -> Labels:
    """Read a file of labels. Raises BadInput with all its errors (M020)."""
    content = read_file(path, "M020", largest=LARGEST)
    text = decode(content, str(path)) if content.strip() else ""
    try:
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
        """Read the labels of a table; errors are appended to ``found``."""
        self._check_keys("", table, self._span(""))
        robot = table.get("robot")
        if robot is not None and not isinstance(robot, str):
            self._bad("robot must be a string: the name of the URDF's robot element", self._span("robot"))
        labels.robot = robot if isinstance(robot, str) else None
        labels.meshes.update(self._entries("meshes", table))
        labels.links.update(self._entries("links", table))
        for label in labels.meshes.values():
            if label.size is None:
                self._bad("the label of a mesh needs a size = [x, y, z]", label.span)

    def _entries(self, kind: str, table: Mapping[str, Any]) -> Iterator[tuple[str, Label]]:
        entries = table.get(kind, {})
        if not isinstance(entries, dict) or len(entries) > MOST_LABELS:
            self._bad(f"{kind} must be a table of at most {MOST_LABELS} names", self._span(kind))
            return
        for name, entry in entries.items():
            span = self._span(name)
            if not isinstance(entry, dict):
                self._bad(f"{name} must be a table; its keys are {', '.join(_KEYS[kind])}", span)
                continue
            self._check_keys(kind, entry, span)
            yield name, self._label(entry, span)

    def _label(self, entry: Mapping[str, Any], span: Span) -> Label:
        size, centre = (self._lengths(entry, name, span) for name in ("size", "centre"))
        if size is not None and min(size) <= 0:
            self._bad("the three lengths of size must be greater than 0", span)
            size = None
        cls = self._of_kind(entry, "class", str, "the name of a class", span)
        if cls is not None and not is_vocabulary(cls) and ":" not in cls:
            self._bad(f"the vocabulary has no class {cls[:60]!r}", span)
        walls = self._of_kind(entry, "walls", (int, float), "a length in metres", span)
        if walls is not None and not 0 < walls <= FARTHEST:
            self._bad(f"walls must be a length in metres, greater than 0 and at most {FARTHEST:g}", span)
            walls = None
        sides = entry.get("open", ())
        sides = [sides] if isinstance(sides, str) else sides
        if not isinstance(sides, (list, tuple)) or not all(side in SIDES for side in sides):
            self._bad(f"open must be one or more of {', '.join(SIDES)}", span)
            sides = ()
        return Label(span, cls, size, centre or (0.0, 0.0, 0.0), tuple(sides), walls)

    def _of_kind(self, entry: Mapping[str, Any], name: str, kind: Any, what: str, span: Span) -> Any:
        value = entry.get(name)
        if value is not None and (not isinstance(value, kind) or isinstance(value, bool) or value == ""):
            self._bad(f"{name} must be {what}", span)
            return None
        return value

    def _lengths(self, entry: Mapping[str, Any], name: str, span: Span) -> Triplet | None:
        values = entry.get(name)
        if values is None:
            return None
        if isinstance(values, list) and len(values) == 3 and all(map(_is_length, values)):
            x, y, z = map(float, values)
            return (x, y, z)
        self._bad(f"{name} must be three lengths in metres, along x, y and z", span)
        return None

    def _check_keys(self, kind: str, table: Mapping[str, Any], span: Span) -> None:
        for key in table:
            if key not in _KEYS[kind]:
                self._bad(f"unknown key {key[:60]!r}; valid keys are {', '.join(_KEYS[kind])}", self._span(key, span))

    def _span(self, key: str, otherwise: Span | None = None) -> Span:
        """Position of the first line that defines a key."""
        quoted = re.compile(rf"""\s*(\[?links\.|\[?meshes\.|\[)?["']?{re.escape(key)}["']?\s*[=\].]""")
        line = next((n for n, line in enumerate(self.lines, 1) if key and quoted.match(line)), None)
        return Span(str(self.path), line) if line else otherwise or Span(str(self.path))

    def _bad(self, message: str, span: Span) -> None:
        self.found.append(error("M020", message, span))


def _is_length(value: object) -> bool:
    number = isinstance(value, (int, float)) and not isinstance(value, bool)
    return number and isfinite(float(value)) and abs(float(value)) <= FARTHEST  # type: ignore[arg-type]
