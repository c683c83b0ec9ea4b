"""Where the files are that URDFs and ontologies name: relative names, packages of ROS, models of Gazebo.

One resolver for meshes of robots and worlds, and for imports. What tools and systems write differently is read:
``$(find p)``, backslashes, percent-encoded characters, another case. The environment variables of ROS and Gazebo are
asked last, so that equal folders give equal robots wherever they lie.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterable, Iterator, Sequence
from functools import lru_cache
from pathlib import Path
from urllib.parse import unquote

PACKAGES = ("ROS_PACKAGE_PATH", "AMENT_PREFIX_PATH", "CMAKE_PREFIX_PATH")
"""Variables that say where packages are: folders with packages, or prefixes with them in ``share``."""
MODELS = ("GAZEBO_MODEL_PATH", "GZ_SIM_RESOURCE_PATH", "IGN_GAZEBO_RESOURCE_PATH", "SDF_PATH")
"""Variables that say where ``model://`` names are looked for."""
DEEPEST = 3
"""Levels of folders that are searched for a package: workspaces have it in a repository."""
MOST_ENTRIES = 10_000
"""Most entries of a folder that are compared without regard to case."""
_SCHEME = re.compile(r"(package|model|file):/{0,2}(?=.)", re.IGNORECASE)
_FIND = re.compile(r"\$\(\s*find(?:-pkg-share)?\s+([^()\s]+)\s*\)[\\/]?")
_DRIVE = re.compile(r"/?[A-Za-z]:[\\/]")


def file_places(naming: Path, name: str) -> list[Path]:
    """List the paths at which what the file ``naming`` names may be, whether they exist or not; the best first.

    ``package://p/rest`` may be p/rest in that file's folder or one above it, rest in one of these folders if its name
    is p, rest in that folder or the one above it (copies of packages are often renamed), or else in a package p that
    the environment knows (:data:`PACKAGES`). ``model://p/rest`` is that, or p/rest in a folder of :data:`MODELS`. Other
    names are relative to the file, and if they name no file there, to a folder above it. Behind all these are the files
    whose names differ in case only, if there are any.
    """
    folder = naming.resolve().parent
    for places in (_near, _known):
        found = list(dict.fromkeys(place for spelling in _spellings(name) for place in places(folder, spelling)))
        if any(map(_exists, found)):
            return found
    near = list(dict.fromkeys(place for spelling in _spellings(name) for place in _near(folder, spelling)))
    return [*near, *found, *_other_cases([*near, *found])]


def case_differs(name: str, place: Path) -> bool:
    """Check whether a file was found under another case than its name in a URDF has."""
    stated = [part for part in unquote(name.replace("\\", "/")).split("/") if part not in ("", ".", "..")]
    there = place.parts[-len(stated) :]
    return any(
        one != other and one.casefold() == other.casefold()
        for one, other in zip(reversed(stated), reversed(there), strict=False)
    )


def _spellings(name: str) -> Iterator[str]:
    """Yield a name as it is written, with slashes, and with percent-encoded characters decoded."""
    name = name.strip()
    slashed = name.replace("\\", "/")
    yield from dict.fromkeys([name, slashed, unquote(slashed, errors="replace")])


def _parsed(name: str) -> tuple[str, str]:
    """Split a name into its kind (package, model, file, an absolute file, or none) and the path."""
    scheme = _SCHEME.match(name)
    kind, rest = (scheme[1].lower(), name[scheme.end() :]) if scheme else ("", name)
    if find := _FIND.match(rest):  # as in file://$(find p)/rest
        return "package", f"{find[1]}/{rest[find.end() :]}"
    if kind in ("package", "model"):
        return kind, rest.lstrip("/")
    if rest.startswith("localhost/") and kind == "file":
        return "absolute", rest.removeprefix("localhost")
    return kind, rest


def _near(folder: Path, name: str) -> Iterator[Path]:
    """Yield places in the URDF's folder and those above it."""
    kind, rest = _parsed(name)
    above = (folder, *folder.parents)
    package, _, inner = rest.partition("/")
    if kind in ("package", "model"):
        yield from _in_package(above, package, inner)
        yield folder / inner
        yield folder.parent / inner
    elif kind == "absolute":
        yield Path(rest)
    else:
        yield folder / rest
        if inner and package not in ("", ".", "..") and not _DRIVE.match(rest):
            yield from _in_package(above[1:], package, inner)


def _known(folder: Path, name: str) -> Iterator[Path]:
    """Yield places that the environment knows."""
    kind, rest = _parsed(name)
    package, _, inner = rest.partition("/")
    if kind in ("package", "model"):
        yield from (root / inner for root in _packages(package, _folders(PACKAGES)))
    if kind == "model":
        yield from (root / rest for root in _folders(MODELS))


def _in_package(above: Iterable[Path], package: str, inner: str) -> Iterator[Path]:
    for folder in above:
        yield folder / package / inner
        if folder.name == package:
            yield folder / inner


def _folders(variables: Sequence[str]) -> tuple[Path, ...]:
    entries = [entry for variable in variables for entry in os.environ.get(variable, "").split(os.pathsep)]
    return tuple(Path(entry) for entry in entries if entry)


@lru_cache(maxsize=64)
def _packages(package: str, roots: Sequence[Path]) -> tuple[Path, ...]:
    """List the folders of a package in or below these; cached, since a robot has a hundred meshes in one package."""
    found: list[Path] = []
    for root in roots if package not in ("", ".", "..") else ():
        found += [root] if root.name == package else []
        found += [root / "share" / package]
        for depth in range(DEEPEST):
            found += [folder / package for folder in _below(root, depth) if _exists(folder / package)]
    return tuple(found)


def _below(root: Path, depth: int) -> Iterator[Path]:
    """Yield the folders at a depth below one, in order of their names."""
    if depth == 0:
        yield root
        return
    for name in sorted(_names(root)):
        if not name.startswith(".") and (root / name).is_dir():
            yield from _below(root / name, depth - 1)


def _exists(path: Path) -> bool:
    try:
        return path.exists()
    except (OSError, ValueError):  # a name that is too long, or has a null character
        return False


def _names(folder: Path) -> list[str]:
    """List the names in a folder; none if it cannot be read, or has too many."""
    names: list[str] = []
    try:
        with os.scandir(folder) as entries:
            for entry in entries:
                names.append(entry.name)
                if len(names) > MOST_ENTRIES:
                    return []
    except (OSError, ValueError):
        return []
    return names


def _other_cases(places: Iterable[Path]) -> Iterator[Path]:
    """Yield the files whose paths differ from these in case only; none where several do."""
    listed: dict[Path, list[str]] = {}
    for place in places:
        here = Path(place.anchor)
        for part in place.parts[1:]:
            if part == ".." or _exists(here / part):
                here = here / part
                continue
            if here not in listed:
                listed[here] = _names(here)
            alike = [name for name in listed[here] if name.casefold() == part.casefold()]
            if len(alike) != 1:
                break
            here = here / alike[0]
        else:
            yield here
