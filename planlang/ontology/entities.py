"""Bounds on what the entities of an XML file expand to, known before any of them is expanded."""

from __future__ import annotations

import re

from planlang.diagnostics import BadInput, Diagnostic, Span, error

LARGEST_EXPANSION = 10_000_000
"""Characters that all references of a file may expand to together."""

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
        return min(LARGEST_EXPANSION, LARGEST_FACTOR * len(self._text))

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
        total = 0
        for match in _REFERENCE.finditer(self._text):  # those between declarations count too: a little too much
            total += self._lengths.get(match[1], 0)
            if total > self.limit:
                before = match.start()
                line = self._text.count("\n", 0, before) + 1
                span = Span(self._file, line, before - self._text.rfind("\n", 0, before))
                raise BadInput([_too_much(match[1], self.limit, span)])

    def _measure(self, root: str) -> None:
        """Compute the lengths of an entity and of those it refers to, without recursion."""
        open_names: dict[str, None] = {}
        stack = [root]
        while stack:
            name = stack[-1]
            if name in self._lengths or name not in self._values:
                self._lengths.setdefault(name, 0)
                open_names.pop(stack.pop(), None)
                continue
            value, span = self._values[name]
            references = _REFERENCE.findall(value)
            missing = next((other for other in references if other not in self._lengths), None)
            if missing is None:
                length = len(value) + sum(self._lengths[other] for other in references)
                if length > self.limit:
                    raise BadInput([_too_much(name, self.limit, span)])
                self._lengths[name] = length
                continue
            open_names[name] = None
            if missing in open_names:
                circle = [*list(open_names)[list(open_names).index(missing) :], missing]
                raise BadInput([error("O008", f"an entity contains itself: {' in '.join(circle)}", span)])
            stack.append(missing)


def _too_much(name: str, limit: int, span: Span) -> Diagnostic:
    return error("O008", f"entity &{name}; makes the file expand to more than {limit:,} characters", span)
