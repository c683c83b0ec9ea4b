"""Bounds on what the entities of an XML file expand to, known before any of them is expanded."""

from __future__ import annotations

import re

from planlang.diagnostics import BadInput, Diagnostic, Span, error

LARGEST_EXPANSION = 10_000_000
"""Characters that all references of a file may expand to together, if the file itself is not longer."""

LARGEST_FACTOR = 100
"""The same in multiples of the file's length."""

_REFERENCE = re.compile(r"&([^;&\s#]+);")


class EntityTable:
    """The entities that a file declares. Invariant: ``_lengths`` is the length after full expansion, capped.

    XML wants an entity to be declared before the entities that refer to it are used, not before they are declared, so
    lengths are computed when the document type is complete.
    """

    def __init__(self, text: str, file: str) -> None:
        self._text = text
        self._file = file
        self._values: dict[str, tuple[str, Span]] = {}
        self._lengths: dict[str, int] = {"amp": 1, "lt": 1, "gt": 1, "apos": 1, "quot": 1}

    @property
    def limit(self) -> int:
        """Characters that the references may expand to; a short file may use a few declared prefixes freely."""
        return min(max(LARGEST_EXPANSION, len(self._text)), LARGEST_FACTOR * len(self._text))

    @property
    def names(self) -> frozenset[str]:
        """What may be referred to: declared entities and those of XML itself."""
        return frozenset(self._values) | frozenset(("amp", "lt", "gt", "apos", "quot"))

    def declare(self, name: str, value: str, span: Span) -> None:
        """Note an entity; of two declarations the first counts, as XML has it."""
        self._values.setdefault(name, (value, span))

    def check(self) -> None:
        """Raise BadInput if the references of the file expand to more than the limit, or into themselves."""
        for name in self._values:
            self._measure(name)
        total, limit, lengths = 0, self.limit, self._lengths
        if self._text.count("&") * max(lengths.values()) <= limit:
            return
        for match in _REFERENCE.finditer(self._text):  # those between declarations count too: a little too much
            total += lengths.get(match[1], 0)
            if total > limit:
                before = match.start()
                line = self._text.count("\n", 0, before) + 1
                span = Span(self._file, line, before - self._text.rfind("\n", 0, before))
                raise BadInput([_too_much(match[1], limit, span)])

    def _measure(self, root: str) -> None:
        """Compute the lengths of an entity and of those it refers to, the innermost first, without recursion."""
        if root in self._lengths:
            return
        open_names = {root: iter(self._references(root))}
        while open_names:
            name = next(reversed(open_names))
            other = next((other for other in open_names[name] if other not in self._lengths), None)
            if other is None:
                del open_names[name]
                self._close(name)
            elif other in open_names:
                names = list(open_names)
                circle = " in ".join((*names[names.index(other) :], other))
                raise BadInput([error("O008", f"an entity contains itself: {circle[:200]}", self._values[name][1])])
            else:
                open_names[other] = iter(self._references(other))

    def _references(self, name: str) -> list[str]:
        return _REFERENCE.findall(self._values[name][0]) if name in self._values else []

    def _close(self, name: str) -> None:
        """Note the length of an entity whose references are all known; nothing is the length of an undeclared one."""
        value, span = self._values.get(name, ("", Span(self._file)))
        length = len(value) + sum(self._lengths[other] for other in self._references(name))
        if length > self.limit:
            raise BadInput([_too_much(name, self.limit, span)])
        self._lengths[name] = length


def _too_much(name: str, limit: int, span: Span) -> Diagnostic:
    return error("O008", f"entity &{name}; makes the file expand to more than {limit:,} characters", span)
