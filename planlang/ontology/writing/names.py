"""IRIs as prefixed names, by the prefixes that a file declares and those that everybody knows."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping

from planlang.ontology.terms import PREFIXES

_LETTER = (
    "A-Za-z\u00c0-\u00d6\u00d8-\u00f6\u00f8-\u02ff\u0370-\u037d\u037f-\u1fff\u2c00-\u2fef\u3001-\ud7ff\uf900-\ufdcf"
)
_LOCAL = re.compile(rf"[{_LETTER}_0-9](?:[{_LETTER}_0-9.\-\u00b7]*[{_LETTER}_0-9\-\u00b7])?")
_PREFIX = re.compile(rf"(?:[{_LETTER}](?:[{_LETTER}_0-9.\-]*[{_LETTER}_0-9\-])?)?")
_NAMESPACE = re.compile(r"[^\s<>\"{}|^`\\]+[#/:_-]")


class Names:
    """Shortens IRIs, and remembers which prefixes were needed.

    ``prefixes`` are those of the file, ``own`` the name of its ontology: what is in it needs no prefix.
    """

    def __init__(self, prefixes: Mapping[str, str], own: str | None = None) -> None:
        spaces: dict[str, str] = {}
        for name, space in sorted(prefixes.items()):
            if name and _PREFIX.fullmatch(name) and _fits(space):
                spaces.setdefault(space, name)
        default = own.rstrip("#/") + "#" if own else prefixes.get("", "")
        if _fits(default):
            spaces.setdefault(default, "")
        for name, space in PREFIXES.items():
            if name not in spaces.values():
                spaces.setdefault(space, name)
        self._spaces = dict(sorted(spaces.items(), reverse=True))
        self._used: set[str] = set()
        self._found: dict[str, tuple[str, str] | None] = {}

    def split(self, iri: str) -> tuple[str, str] | None:
        """Prefix and local name of an IRI; None if it has to be written in full."""
        if iri not in self._found:
            self._found[iri] = next(self._splits(iri), None)
        found = self._found[iri]
        if found is not None:
            self._used.add(found[0])
        return found

    def _splits(self, iri: str) -> Iterator[tuple[str, str]]:
        for space, name in self._spaces.items():
            if iri.startswith(space) and _LOCAL.fullmatch(local := iri.removeprefix(space)):
                yield name, local

    def known(self) -> list[tuple[str, str]]:
        """All prefixes with their namespaces, sorted."""
        return sorted((name, space) for space, name in self._spaces.items())

    def used(self) -> list[tuple[str, str]]:
        """Return the used prefixes, with their namespaces, sorted."""
        return sorted((name, space) for space, name in self._spaces.items() if name in self._used)


def _fits(space: str) -> bool:
    return _NAMESPACE.fullmatch(space) is not None
