"""The files of imports: by path, by the IRI that a file states, by catalog, or bundled."""

from __future__ import annotations

import glob
import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import cache
from pathlib import Path
from urllib.parse import unquote

from planlang.diagnostics import BadInput, Diagnostic, Span, warning
from planlang.files import ONTOLOGIES, bundled, read_file
from planlang.ontology.catalog import FOLDER, Catalogs
from planlang.ontology.moved_names import HOST, OLD_HOST, canonical
from planlang.ontology.terms import OWL, RDF, RDFS, VOCABULARIES
from planlang.package_paths import file_places
from planlang.records import dataclass
from planlang.spelling import similar
from planlang.words import Text

LARGEST_BESIDE = 64_000_000
"""Size of all files together that are searched for the IRI of an import [bytes]."""
MOST_NEAR = 20
"""Of them, those that are read for advice about an import that was not found."""

LONGEST_PATH = 24
"""Last folders of an import's path that are used; they bound the search in a hostile file."""

MODULES = ("ACT", "AGENT", "ALL", "Allen", "All", "ELAN", "HOME", "IO", "NEEM", "OBJ", "PROC", "SAY", "STATE", "WF")
"""Modules of SOMA, and of EASE before it."""
VOCABULARY_FILES: dict[str, str | None] = {
    "knowrob": "knowrob.omn",
    "srdl2": "srdl.omn",
    "srdl2-comp": "srdl.omn",
    "srdl2-cap": "srdl.omn",
    "srdl2-action": "srdl.omn",
    "srdl": "srdl.omn",
    "roboearth": "roboearth.omn",
    "motion-constraints": "motion_constraints.omn",
    "object-change": "object_change.omn",
    "primitives": "primitives.omn",
    "recovery": "recovery.omn",
    "searching": "searching.omn",
    "moving": "moving.omn",
    "computable": None,
    "comp_spatial": None,
    "comp_temporal": None,
    "comp_cop": None,
    **dict.fromkeys(("SOMA", "EASE"), "soma.omn"),
    **{f"{name}-{module}": "soma.omn" for name in ("SOMA", "EASE") for module in MODULES},
    "DUL": "dul.omn",
    "IOLite": "dul.omn",
    "urdf": None,
    "URDF": None,
}
"""Vocabulary -> the bundled file that replaces it; None: nothing is needed, as it only binds terms to programs."""

_LANGUAGES = tuple(namespace.rstrip("#") for namespace in (OWL, RDF, RDFS))
_HOSTS = (HOST, OLD_HOST, "http://www.roboearth.org/kb/")
_PUBLISHED = re.compile(
    r"https?://(www\.)?(ease-crc\.org|ease-crc\.github\.io|(raw\.githubusercontent|github)\.com/ease-crc|w3id\.org/ease"
    r"|ontologydesignpatterns\.org|loa-cnr\.it)/"
)
"""Addresses under which versions of SOMA and DUL are published, all with the name of the file at the end."""
_SUFFIXES = ("", *ONTOLOGIES, ".xml")
_URL = re.compile(r"([A-Za-z][A-Za-z0-9+.-]*):(//)?(.*)", re.DOTALL)
_TEMPLATE = re.compile(r"@\w+@|\$\{[^}]*\}")
_HEADING = re.compile(r"^[ \t]*Ontology:\s*<([^<>\s]*)>", re.MULTILINE)


@dataclass(frozen=True, slots=True)
class Resolution:
    """Resolved import: a file, and what is wrong with it or why there is none. Both None: nothing has to be read."""

    path: Path | None = None
    problem: Diagnostic | None = None


class ImportMap:
    """Finds the files of imports, beside the importing file, then in ``folders`` in their order.

    An import by address is the file that a catalog names (``catalog-v001.xml``), else the file with its name if that
    states this address, else another file that states it as its IRI or version IRI, else the file with its name.
    ``stated`` finds the IRIs that a file states. Without ``is_file`` the main document is untrusted text: its folder is
    not searched, and diagnostics do not reveal which other files exist. ``problems`` are those of catalogs.
    """

    def __init__(
        self,
        main: Path,
        folders: Sequence[Path],
        stated: Callable[[Path], tuple[str, ...]],
        *,
        is_file: bool = True,
    ) -> None:
        self._folders = tuple(folders)
        self._bundled = bundled("ontologies")
        self._is_file = is_file
        self._stated = stated
        own = (main.parent, main.resolve().parent) if is_file else ()
        self._roots = tuple(root.resolve() for root in (*own, *folders, self._bundled))
        self._catalogs = Catalogs(lambda path: any(self._is_inside(path, root) for root in self._roots))
        self._texts: dict[Path, bytes] = {}
        """Files beside those that were read, with their contents, in which IRIs are searched."""
        self._left = LARGEST_BESIDE

    @property
    def problems(self) -> list[Diagnostic]:
        """Problems of the catalogs that were read."""
        return self._catalogs.problems

    def resolve(self, target: str, importing: Path, span: Span) -> Resolution:
        """Find the file that ``target`` refers to in the file ``importing``."""
        address = canonical(target).rstrip("#")
        if address in _LANGUAGES:
            return Resolution()
        scheme, path = _split(target)
        remote = scheme not in ("", "file", "package")
        is_bundled = self._is_inside(importing, self._bundled)
        if is_bundled:
            bundled_first = self._bundled_file(address, path, remote)
            if bundled_first is not None:
                return Resolution(bundled_first)
        beside = (*((importing.parent,) if self._is_file or is_bundled else ()), *self._folders)
        escaped = False
        for folder in beside if not is_bundled else ():
            found = self._catalogs.find(folder, target)
            if isinstance(found, Path):
                return Resolution(found)
            if found is not None:  # another address, under which the ontology is published
                address = canonical(found).rstrip("#")
                scheme, path = _split(found)
        named = None
        for candidate in self._candidates(path, importing.parent):
            file = _file(candidate)
            if file is None:
                continue
            if any(self._is_inside(file, root) for root in self._roots):
                named = file
                break
            escaped = self._is_file
        if named is None and remote and (substitute := self._bundled_file(address, path, remote)) is not None:
            return Resolution(substitute)
        if remote and not is_bundled and address not in _vocabulary_addresses():
            stating = self._stating(address, beside, named)
            if stating:
                return Resolution(stating[0], _several(target, stating, span))
        if named is not None:
            return Resolution(named)
        vocabulary = _vocabulary(address, path, remote)
        if vocabulary in VOCABULARY_FILES:
            name = VOCABULARY_FILES[vocabulary]
            return Resolution(self._bundled / name if name else None)
        substitute = self._bundled_file(address, path, remote) or self._versioned_file(path, importing.parent)
        if substitute is not None:
            return Resolution(substitute)
        if scheme == "package" and (packaged := self._in_packages(target, importing)) is not None:
            return Resolution(packaged)
        escaped = escaped or ".." in path
        near = self._near(address, beside) if remote and self._is_file else ""
        return Resolution(problem=_unresolved(target, path, span, remote=remote, escaped=escaped, near=near))

    def _states(self, file: Path, address: str) -> bool:
        """Check whether a file states an address, whether with http or https."""
        return _plain(address) in map(_plain, self._stated(file))

    def _in_packages(self, target: str, importing: Path) -> Path | None:
        """Find ``package://p/rest`` in a package of ROS: one above the importing file, or that the environment knows.

        Such a folder has a package.xml, so that an import from elsewhere leads to no other file.
        """
        for place in file_places(importing, target) if self._is_file and ".." not in target else ():
            file = _file(place)
            package = next((one for one in file.parents if (one / "package.xml").is_file()), None) if file else None
            if package is not None:
                self._roots += (package,)
                return file
        return None

    def _stating(self, address: str, folders: Sequence[Path], named: Path | None) -> list[Path]:
        """Find the files that state an address, in the first folder that has any; equal ones once.

        ``named`` has the name that the address ends with, and comes first. Parsing a file takes long, so it is done
        only if the last word of the address is where the file states its IRI, or, if no file has it there, anywhere.
        """
        word = next((word for word in reversed(re.split(r"[/#:]", address)) if word), address).encode()
        for in_header in (True, False):
            for folder in folders:
                files = _ontologies(folder)
                if named is not None and named.parent == folder.resolve():
                    files.sort(key=lambda file: file != named)
                found: dict[bytes, Path] = {}
                for file in files:
                    content = self._content(file)
                    if _mentions(content, word, in_header=in_header) and self._states(file, address):
                        found.setdefault(content, file)
                if found:
                    return list(found.values())
            if named is not None and self._states(named, address):
                return [named]
        return []

    def _content(self, file: Path) -> bytes:
        content = self._texts.get(file)
        if content is None:
            try:
                content = read_file(file, "O034", largest=max(self._left, 0))
            except BadInput:
                content = b""
            self._left -= len(content)
            self._texts[file] = content
        return content

    def _near(self, address: str, folders: Iterable[Path]) -> str:
        """Name a file beside that states nearly this address, such as another version of the ontology."""
        stating = {
            iri: file for folder in folders for file in _ontologies(folder)[:MOST_NEAR] for iri in self._stated(file)
        }
        alike = [iri for iri in stating if iri.startswith(address) or address.startswith(iri)] or similar(
            address, stating, least=0.9
        )
        return f"{stating[alike[0]].name} states {alike[0]}; import that, or " if alike else ""

    def _candidates(self, path: tuple[str, ...], beside: Path) -> Iterator[Path]:
        """Yield the path itself, then ever shorter ends of it in every folder, each with all suffixes of ontologies.

        Published files import by paths of their authors' machines, of which only the last parts exist elsewhere.
        """
        if not path:
            return
        names = dict.fromkeys((path[-1], *(_stem(path[-1]) + suffix for suffix in _SUFFIXES)))
        parents = path[:-1]
        yield from (beside.joinpath(*parents, name) for name in names)
        yield from (Path("/", *parents, name) for name in names if ".." not in parents)
        plain = len(parents) - next((i for i, part in enumerate(reversed(parents)) if part == ".."), len(parents))
        for folder in (beside, *self._folders):
            for start in range(plain, len(parents) + 1):
                yield from (folder.joinpath(*parents[start:], name) for name in names)

    def _versioned_file(self, path: tuple[str, ...], beside: Path) -> Path | None:
        """Find a file with the name of an import plus ``@`` and a version, as ``serve_drink@hydro.owl``."""
        if not path:
            return None
        stem = glob.escape(_stem(path[-1]))
        files = (file for folder in (beside, *self._folders) for file in sorted(folder.glob(f"{stem}@*")))
        usable = (file for file in files if file.name.endswith(_SUFFIXES[1:]) and _file(file) is not None)
        return next((file for file in usable if any(self._is_inside(file, root) for root in self._roots)), None)

    def _bundled_file(self, address: str, path: tuple[str, ...], remote: bool) -> Path | None:
        """Find a bundled file by name; the ontology IRI has to match too if the import is by address."""
        if not path:
            return None
        stem = _stem(path[-1])
        for folder in ("", "robots", "environments", "objects"):
            candidate = self._bundled / folder / f"{stem}.omn"
            if _file(candidate) is not None and (not remote or _address(candidate) == address):
                return candidate
        return None

    @staticmethod
    def _is_inside(path: Path, root: Path) -> bool:
        return path.resolve().is_relative_to(root.resolve())


def _plain(address: str) -> str:
    return re.sub("^https:", "http:", address).rstrip("#/")


def _split(target: str) -> tuple[str, tuple[str, ...]]:
    """Split an import into scheme and path, without host and unexpanded build variables (``@PREFIX@``)."""
    match = _URL.fullmatch(target)
    scheme, rest = (match[1].lower(), match[3]) if match else ("", target)
    if match and match[2] and scheme not in ("file", "package"):
        rest = rest.partition("/")[2]
    rest = _TEMPLATE.sub("", unquote(rest.partition("#")[0]).replace("\\", "/"))
    return scheme, tuple([part for part in rest.split("/") if part not in ("", ".")][-LONGEST_PATH:])


def _stem(name: str) -> str:
    for suffix in sorted(_SUFFIXES[1:], key=len, reverse=True):
        if name.lower().endswith(suffix):
            return name[: -len(suffix)]
    return name


def _file(path: Path) -> Path | None:
    try:
        return path.resolve() if path.is_file() else None
    except (OSError, ValueError, RuntimeError):  # name too long, null character, cyclic links
        return None


def _vocabulary(address: str, path: tuple[str, ...], remote: bool) -> str:
    if remote and not _PUBLISHED.match(address):
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


def _unresolved(
    target: str, path: tuple[str, ...], span: Span, *, remote: bool, escaped: bool, near: str
) -> Diagnostic:
    if remote:
        advice = Text(
            f"{near}put a file that states this IRI beside this one, name its folder with ",
            FOLDER,
            ", or map the IRI to a file in catalog-v001.xml; nothing is fetched from the network",
        )
        return warning("O031", f"an import of an unknown address is ignored: {target}", span, advice)
    name = path[-1] if path else target
    if escaped:
        advice = Text("allow it with ", FOLDER, f", where DIR is the folder of {name}")
        return warning("O032", f"an import from outside the allowed folders is ignored: {target}", span, advice)
    advice = Text(f"put {name} beside this file, or add its folder with ", FOLDER)
    if target.startswith("package:"):
        advice += "; packages are found above this file, and in ROS_PACKAGE_PATH and AMENT_PREFIX_PATH"
    return warning("O030", f"import not found: {target}", span, advice)


def _several(target: str, files: Sequence[Path], span: Span) -> Diagnostic | None:
    if len(files) == 1:
        return None
    names = [file.name for file in files]
    message = f"{' and '.join(names[:5])} state {target}; {names[0]} is read"
    advice = f"remove the others, or import by file: <file:{names[0]}>"
    return warning("O035", message, span, advice)


def _mentions(content: bytes, word: bytes, *, in_header: bool) -> bool:
    """Check whether a file has a word, or has it where an ontology states its IRI, and not what it imports."""
    if not in_header:
        return word in content
    at = content.find(word)
    while at >= 0:
        near = content[max(at - 200, 0) : at + len(word) + 60]
        if b"ntology" in near and b"mport" not in content[max(at - 60, 0) : at]:
            return True
        at = content.find(word, at + len(word))
    return False


def _ontologies(folder: Path) -> list[Path]:
    """Files in a folder that may be ontologies, sorted by name."""
    try:
        names = sorted(file.name for file in folder.iterdir() if file.name.lower().endswith(_SUFFIXES[1:]))
    except OSError:
        return []
    return [file for name in names if not name.startswith(".") and (file := _file(folder / name)) is not None]
