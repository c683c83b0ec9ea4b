"""Reads small XML files from strangers: no entities, nothing external, bounded in size and depth; knows the lines."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from copy import deepcopy
from pathlib import Path
from xml.parsers import expat

from planlang.files import open_regular

LARGEST = 16_000_000
"""Bytes; robot descriptions have up to 0.3 MB."""
DEEPEST = 100
"""Elements inside each other."""
MOST = 200_000
"""Elements."""


class BadXml(Exception):
    """A file that is not read: what is wrong, and the line."""

    def __init__(self, problem: str, line: int = 1) -> None:
        self.problem, self.line = problem, line
        super().__init__(f"line {line}: {problem}")


class Element(ElementTree.Element):
    """An element that knows in which line of its file it begins; prefixes are a part of its name."""

    line = 1

    def __deepcopy__(self, memo: object) -> Element:
        """Return a copy that knows its line, too."""
        copied = Element(self.tag, dict(self.attrib))
        copied.line, copied.text = self.line, self.text
        copied.extend(deepcopy(child) for child in self)
        return copied


def read_tree(path: Path) -> Element:
    """Return the root element of a file; raises :class:`BadXml`."""
    return tree_of(read_content(path))


def tree_of(content: bytes, *, texts: bool = False) -> Element:
    """Return the root element of what stands in a file, with what stands between its tags if ``texts`` is asked for.

    Raises :class:`BadXml`.
    """
    return _Reader(texts).read(content)


def read_content(path: Path) -> bytes:
    """Return the content of a regular file. Raises BadXml."""
    try:
        with open_regular(path) as file:
            content = file.read(LARGEST + 1)
    except FileNotFoundError:
        raise BadXml("there is no such file") from None
    except OSError as problem:
        raise BadXml(f"it cannot be read: {problem.strerror}") from None
    if len(content) > LARGEST:
        raise BadXml(f"it is larger than {LARGEST // 1_000_000} MB")
    return content


class _Reader:
    def __init__(self, texts: bool) -> None:
        self._root: Element | None = None
        self._open: list[Element] = []
        self._count = 0
        self._parser = expat.ParserCreate()
        self._parser.StartElementHandler = self._start
        self._parser.EndElementHandler = self._end
        self._texts: list[str] = []
        if texts:
            self._parser.buffer_text = True
            self._parser.CharacterDataHandler = self._texts.append
        self._parser.EntityDeclHandler = self._entity

    def read(self, content: bytes) -> Element:
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
        if self._texts and not len(element):  # what stands between children means nothing in the formats read here
            element.text = "".join(self._texts)
        self._texts.clear()

    def _start(self, name: str, attributes: dict[str, str]) -> None:
        self._count += 1
        self._texts.clear()
        if len(self._open) >= DEEPEST or self._count > MOST:
            raise BadXml("its elements are too many, or too deeply nested", self._parser.CurrentLineNumber)
        element = Element(name, attributes)
        element.line = self._parser.CurrentLineNumber
        if self._open:
            self._open[-1].append(element)
        else:
            self._root = element
        self._open.append(element)

    def _entity(self, name: str, *_: object) -> None:
        raise BadXml(f"it declares an entity ({name}), which is refused", self._parser.CurrentLineNumber)
