"""XML of robots and meshes as a tree whose elements know their lines.

The files are untrusted: entities and external references are refused, size and depth are limited.
"""

from __future__ import annotations

import re
import xml.etree.ElementTree as ElementTree
from copy import deepcopy
from pathlib import Path
from xml.parsers import expat

from planlang.files import open_regular, read_at_most

LARGEST = 16_000_000
"""Limit in bytes; robot descriptions have up to 0.3 MB."""
DEEPEST = 100
"""Maximum nesting of elements."""
MOST = 200_000
"""Maximum number of elements."""
_OPTIONAL = re.compile(r"\$\(optenv +\w+ ?([^()]*)\)")
"""An expression that xacro leaves to the environment; its default is read, so that equal files are equal robots."""


class BadXml(Exception):
    """A file was refused; with the problem and the line."""

    def __init__(self, problem: str, line: int = 1) -> None:
        self.problem, self.line = problem, line
        super().__init__(f"line {line}: {problem}")


class Element(ElementTree.Element):
    """An element with its line in the file; namespace prefixes are part of its tag."""

    line = 1

    def __deepcopy__(self, memo: object) -> Element:
        """Copy the element with its line."""
        copied = Element(self.tag, dict(self.attrib))
        copied.line, copied.text = self.line, self.text
        copied.extend(deepcopy(child) for child in self)
        return copied


def read_tree(path: Path) -> Element:
    """Parse a file and return its root element; raises :class:`BadXml`."""
    return tree_of(read_content(path))


def tree_of(content: bytes) -> Element:
    """Parse XML and return its root element, with the text between the tags; raises :class:`BadXml`."""
    return _Reader().read(content)


def read_content(path: Path) -> bytes:
    """Read a regular file. Raises BadXml."""
    try:
        with open_regular(path) as file:
            content = read_at_most(file, LARGEST + 1)
    except FileNotFoundError:
        raise BadXml("there is no such file") from None
    except OSError as problem:
        raise BadXml(f"it cannot be read: {problem.strerror}") from None
    if len(content) > LARGEST:
        raise BadXml(f"it is larger than {LARGEST // 1_000_000} MB")
    return content


class _Reader:
    def __init__(self) -> None:
        self._root: Element | None = None
        self._open: list[Element] = []
        self._count = 0
        self._parser = expat.ParserCreate()
        self._parser.StartElementHandler = self._start
        self._parser.EndElementHandler = self._end
        self._texts: list[str] = []
        self._has_defaults = False
        self._parser.EntityDeclHandler = self._entity
        self._parser.buffer_text = True
        self._parser.CharacterDataHandler = self._texts.append

    def read(self, content: bytes) -> Element:
        self._has_defaults = b"$(optenv" in content
        try:
            self._parser.Parse(content, True)
        except expat.ExpatError as problem:
            reason = expat.ErrorString(problem.code) or "not well-formed"
            raise BadXml(f"it is not XML: {reason}", problem.lineno) from None
        except (LookupError, ValueError) as problem:
            raise BadXml(f"it is not XML: {problem}") from None
        if self._root is None:
            raise BadXml("it is empty")
        return self._root

    def _end(self, name: str) -> None:
        element = self._open.pop()
        if self._texts and not len(element):  # text between children has no meaning in these formats
            element.text = "".join(self._texts)
        self._texts.clear()

    def _start(self, name: str, attributes: dict[str, str]) -> None:
        self._count += 1
        self._texts.clear()
        if len(self._open) >= DEEPEST or self._count > MOST:
            raise BadXml("its elements are too many, or too deeply nested", self._parser.CurrentLineNumber)
        if self._has_defaults:
            attributes = {key: _OPTIONAL.sub(r"\1", value) for key, value in attributes.items()}
        element = Element(name, attributes)
        element.line = self._parser.CurrentLineNumber
        if self._open:
            self._open[-1].append(element)
        else:
            self._root = element
        self._open.append(element)

    def _entity(self, name: str, *_: object) -> None:
        raise BadXml(f"it declares an entity ({name}), which is refused", self._parser.CurrentLineNumber)
