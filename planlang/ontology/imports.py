"""Find imports: beside the file, in the folders that the user gives, among the bundled ontologies.

Nothing is ever fetched, and nothing is read outside these folders, whatever an import says.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from urllib.parse import unquote

from planlang.diagnostics import Diagnostic, Span, warning
from planlang.ontology.repairs import HOST, OLD_HOST, canonical
from planlang.ontology.terms import OWL, RDF, RDFS, VOCABULARIES
from planlang.resources import bundled

LONGEST_PATH = 24
"""Folders in the path of an import that are looked at."""

VOCABULARY_FILES: dict[str, str | None] = {
    "knowrob": "knowrob.omn",
    "srdl2": "srdl.omn",
    "srdl2-comp": "srdl.omn",
    "srdl2-cap": "srdl.omn",
    "srdl2-action": "srdl.omn",
    "srdl": "srdl.omn",
    "roboearth": "roboearth.omn",
    "primitives": "primitives.omn",
    "recovery": "recovery.omn",
    "computable": None,
    "comp_spatial": None,
    "comp_temporal": None,
    "comp_cop": None,
}
"""Name of a vocabulary -> the bundled file that stands for it; None: it only binds terms to programs."""

_LANGUAGES = tuple(namespace.rstrip("#") for namespace in (OWL, RDF, RDFS))
_HOSTS = (HOST, OLD_HOST, "http://www.roboearth.org/kb/")
_SUFFIXES = ("", ".omn", ".owl", ".owl.in", ".ttl", ".nt", ".rdf")
_URL = re.compile(r"([A-Za-z][A-Za-z0-9+.-]*):(//)?(.*)", re.DOTALL)
_TEMPLATE = re.compile(r"@\w+@|\$\{[^}]*\}")
_HEADING = re.compile(r"^[ \t]*Ontology:\s*<([^<>\s]*)>", re.MULTILINE)


@dataclass(frozen=True, slots=True)
class Resolution:
    """The result of an import: a file, or the problem that there is none. Both None: nothing has to be read."""

    path: Path | None = None
    problem: Diagnostic | None = None


class ImportMap:
    """Finds files for imports. ``folders`` are searched in their order, after the importing file's own."""

    def __init__(self, main: Path, folders: Sequence[Path] = ()) -> None:
        self._folders = tuple(folders)
        self._ours = bundled("ontologies")
        self._roots = tuple(root.resolve() for root in (main.parent, main.resolve().parent, *folders, self._ours))

    def resolve(self, target: str, importing: Path, span: Span) -> Resolution:
        """Return the file that ``target`` means in the file ``importing``."""
        address = canonical(target).rstrip("#")
        if address in _LANGUAGES:
            return Resolution()
        scheme, path = _split(target)
        remote = scheme not in ("", "file", "package")
        if self._is_inside(importing, self._ours):
            bundled_first = self._bundled(address, path, remote)
            if bundled_first is not None:
                return Resolution(bundled_first)
        escaped = False
        for candidate in self._candidates(path, importing.parent):
            found = _file(candidate)
            if found is None:
                continue
            if any(self._is_inside(found, root) for root in self._roots):
                return Resolution(found)
            escaped = True
        vocabulary = _vocabulary(address, path, remote)
        if vocabulary in VOCABULARY_FILES:
            name = VOCABULARY_FILES[vocabulary]
            return Resolution(self._ours / name if name else None)
        ours = self._bundled(address, path, remote)
        if ours is not None:
            return Resolution(ours)
        return Resolution(problem=_unresolved(target, path, span, remote=remote, escaped=escaped or ".." in path))

    def _candidates(self, path: tuple[str, ...], beside: Path) -> Iterator[Path]:
        """Yield the path as it is, then ever shorter ends of it in every folder, with the suffixes of ontologies."""
        if not path:
            return
        names = _names(path[-1])
        parents = path[:-1]
        yield from (beside.joinpath(*parents, name) for name in names)
        yield from (Path("/", *parents, name) for name in names if ".." not in parents)
        plain = len(parents) - next((i for i, part in enumerate(reversed(parents)) if part == ".."), len(parents))
        for folder in (beside, *self._folders):
            for start in range(plain, len(parents) + 1):
                yield from (folder.joinpath(*parents[start:], name) for name in names)

    def _bundled(self, address: str, path: tuple[str, ...], remote: bool) -> Path | None:
        """Return a bundled file of this name; an address must be the one that the file gives itself."""
        if not path:
            return None
        stem = _stem(path[-1])
        for folder in ("", "robots", "environments", "objects"):
            candidate = self._ours / folder / f"{stem}.omn"
            if _file(candidate) is not None and (not remote or _address(candidate) == address):
                return candidate
        return None

    @staticmethod
    def _is_inside(path: Path, root: Path) -> bool:
        return path.resolve().is_relative_to(root.resolve())


def _split(target: str) -> tuple[str, tuple[str, ...]]:
    """Scheme and folders of an import, without host and without what a build should have filled in (``@PREFIX@``)."""
    match = _URL.fullmatch(target)
    scheme, rest = (match[1].lower(), match[3]) if match else ("", target)
    if match and match[2] and scheme not in ("file", "package"):
        rest = rest.partition("/")[2]
    rest = _TEMPLATE.sub("", unquote(rest.partition("#")[0]).replace("\\", "/"))
    return scheme, tuple([part for part in rest.split("/") if part not in ("", ".")][-LONGEST_PATH:])


def _names(name: str) -> tuple[str, ...]:
    return tuple(dict.fromkeys((name, *(_stem(name) + suffix for suffix in _SUFFIXES))))


def _stem(name: str) -> str:
    for suffix in (".owl.in", ".owl", ".omn", ".rdf", ".xml", ".ttl", ".nt"):
        if name.lower().endswith(suffix):
            return name[: -len(suffix)]
    return name


def _file(path: Path) -> Path | None:
    try:
        return path.resolve() if path.is_file() else None
    except (OSError, ValueError, RuntimeError):  # a name too long, a null character, a circle of links
        return None


def _vocabulary(address: str, path: tuple[str, ...], remote: bool) -> str:
    if remote:
        return _vocabulary_addresses().get(address, "")
    return _stem(path[-1]) if path else ""


@cache
def _vocabulary_addresses() -> dict[str, str]:
    """Every address under which a vocabulary was ever published -> its name."""
    known = {f"{host}{name}.owl": name for host in _HOSTS for name in VOCABULARY_FILES}
    return known | {namespace.rstrip("#"): name for name, namespace in VOCABULARIES.items()}


@cache
def _address(path: Path) -> str | None:
    try:
        match = _HEADING.search(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError):
        return None
    return match[1] if match else None


def _unresolved(target: str, path: tuple[str, ...], span: Span, *, remote: bool, escaped: bool) -> Diagnostic:
    if remote:
        advice = (
            "nothing is fetched from the network; save the file beside this one, or give its folder by --ontologies DIR"
        )
        return warning("O031", f"an import of an unknown address is left out: {target}", span, advice)
    name = path[-1] if path else target
    if escaped:
        advice = f"allow it by --ontologies DIR, where DIR is the folder of {name}"
        return warning("O032", f"an import outside the given folders is left out: {target}", span, advice)
    advice = f"put {name} beside this file, or give its folder by --ontologies DIR"
    return warning("O030", f"import not found: {target}", span, advice)
