"""Files of worlds, by content: found by the client, sent to workers that lack them, laid out there as on the client.

A worker has them below a folder of its own, under their absolute paths: names relative to each other, to the current
folder, or to packages of ROS mean the same there, also through symbolic links.
"""

from __future__ import annotations

import hashlib
import os
import shutil
import sys
import sysconfig
from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import cache
from importlib import import_module
from itertools import chain
from pathlib import Path
from pkgutil import resolve_name
from typing import Any

from executive.processes.workers import Ending, Limits, Worker
from executive.sweeps.records import COPIED, World
from executive.sweeps.supervised import source_of
from planlang.cache import cache_folder
from planlang.diagnostics import BadInput, error
from planlang.files import bundled
from planlang.package_paths import MODELS, PACKAGES
from planlang.records import dataclass
from planlang.temporary import temporary_folder

LARGEST = 2_000_000_000
"""Largest size of all files of a sweep [bytes]."""
NOT_FILES = (*COPIED, "report")
"""Entries of worlds that name no file to read."""
SYSTEM = ("/proc", "/dev", "/sys", "/etc")
"""Folders of the system, of which each machine has its own."""


@dataclass(frozen=True, kw_only=True)
class Shipment:
    """Files of a sweep."""

    home: str
    """Current folder of the client."""
    files: Mapping[str, str]
    """Absolute path -> SHA-256 of the content."""
    links: Mapping[str, str]
    """Absolute path of a symbolic link -> absolute path of its target."""
    variables: Mapping[str, str]
    """Environment variables of the client that say where packages are."""


# on the client


def shipment(worlds: Sequence[World], reads: str | None, limits: Limits, path: Sequence[str]) -> Shipment:
    """Find the files of worlds: those that they name, and those that ``reads`` opens for them. Raises BadInput.

    Worlds that name the same files read the same files; ``reads`` is called once for each of these groups, in a process
    of its own.
    """
    groups = {named: world for world in reversed(worlds) if (named := frozenset(_named(world)))}
    found = dict.fromkeys(os.path.abspath(one) for named in groups for one in sorted(named) if os.path.isfile(one))
    if reads is not None and groups:
        found.update(dict.fromkeys(_opened(list(groups.values()), reads, limits, path)))
    links: dict[str, str] = {}
    files = {one: _digest(one) for one in dict.fromkeys(_resolved(one, links) for one in found)}
    if sum(map(os.path.getsize, files)) > LARGEST:
        raise BadInput([error("C036", f"the files of the sweep have more than {LARGEST // 1_000_000} MB together")])
    variables = {name: os.environ[name] for name in (*PACKAGES, *MODELS) if os.environ.get(name)}
    return Shipment(home=os.getcwd(), files=files, links=links, variables=variables)


def _named(value: Any) -> Iterator[str]:
    """Yield the files and folders that a world names anywhere."""
    if isinstance(value, str):
        if _exists(value):
            yield value
    elif isinstance(value, Mapping):
        yield from chain.from_iterable(_named(one) for key, one in value.items() if key not in NOT_FILES)
    elif isinstance(value, Iterable):
        yield from chain.from_iterable(map(_named, value))


@cache
def _exists(name: str) -> bool:
    return len(name) < 1000 and "\n" not in name and "\0" not in name and os.path.exists(name)


def _opened(worlds: Sequence[World], reads: str, limits: Limits, path: Sequence[str]) -> Iterator[str]:
    """Yield what ``reads`` opens for worlds, except what each machine with planlang has. Raises BadInput."""
    with temporary_folder() as folder:
        source = source_of(reads, folder, path)
        process = Worker(source, limits)
        own = (str(folder), *_own_folders())
        try:
            for world in worlds:
                reply = process.call(opened, reads, dict(world))
                if reply.ending is Ending.REFUSED:  # the job would refuse it, too
                    raise BadInput(reply.answer)
                if reply.ending is not Ending.DONE:
                    why = reply.answer if reply.ending is Ending.FAILED else reply.beyond(limits)
                    raise BadInput([error("C036", f"the files of world {world['world']} cannot be found: {why}")])
                yield from (one for one in reply.answer if os.path.isfile(one) and not _is_below(one, own))
        finally:
            process.close()
            source.close()


def _own_folders() -> tuple[str, ...]:
    kept = cache_folder("any")
    return (*SYSTEM, *sysconfig.get_paths().values(), *_planlang(), *([str(kept.parent)] if kept else ()))


def _planlang() -> tuple[str, ...]:
    """Folders of the program and its data."""
    packages = (os.path.dirname(str(import_module(name).__file__)) for name in ("planlang", "executive", "sim"))
    return (*packages, str(bundled("ontologies")), str(bundled("recipes")))


def _is_below(path: str, folders: Sequence[str]) -> bool:
    real = os.path.realpath(path)
    return any(real.startswith(f"{os.path.realpath(folder)}/") for folder in folders)


def _resolved(path: str, links: dict[str, str]) -> str:
    """Return the path of a file without symbolic links, and note these."""
    folder, name = os.path.split(path)
    if not name:
        return path
    here = os.path.join(_resolved(folder, links), name)
    if not os.path.islink(here):
        return here
    links[here] = os.path.normpath(os.path.join(os.path.dirname(here), os.readlink(here)))
    return _resolved(links[here], links)


def _digest(path: str) -> str:
    with open(path, "rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def opened(reads: str, world: dict[str, Any]) -> list[str]:
    """Call a function with a world and return the files that it opens for reading; runs in a process of its own."""
    found: dict[str, None] = {}

    def note(event: str, arguments: tuple[Any, ...]) -> None:
        if event == "open" and isinstance(arguments[0], str | bytes):
            name, _, flags = arguments
            if flags & os.O_ACCMODE == os.O_RDONLY:
                found[os.path.abspath(os.fsdecode(name))] = None

    sys.addaudithook(note)
    resolve_name(reads)(world)
    return list(found)


# on a worker


class Layout:
    """The files of a shipment below a folder of a worker."""

    def __init__(self, shipped: Shipment, store: Path, root: Path) -> None:
        """Lay them out; their contents are in ``store``, by digest."""
        self._root = str(root)
        self._known = {str(one) for path in (*shipped.files, *shipped.links) for one in (path, *Path(path).parents)}
        for path, digest in shipped.files.items():
            _link_or_copy(store / digest, self._made(path))
        for path, target in shipped.links.items():
            self._made(path).symlink_to(self._root + target)
        home = Path(self._root + shipped.home)
        home.mkdir(parents=True, exist_ok=True)
        variables = {
            name: os.pathsep.join(map(self.placed, value.split(os.pathsep)))
            for name, value in shipped.variables.items()
        }
        self.environment = {"PWD": str(home), **variables}
        """Environment variables of processes that use them."""

    def _made(self, path: str) -> Path:
        """Return where a path is here, in a folder that exists."""
        place = Path(self._root + path)
        place.parent.mkdir(parents=True, exist_ok=True)
        return place

    def placed(self, value: Any) -> Any:
        """Replace paths of the client in a world by paths here."""
        if isinstance(value, str):
            return self._root + value if value in self._known else value
        if isinstance(value, Mapping):
            return {key: self.placed(one) for key, one in value.items()}
        return [*map(self.placed, value)] if isinstance(value, list | tuple) else value

    def returned(self, text: str) -> str:
        """Replace paths here in a text by paths of the client."""
        return text.replace(self._root, "")


def missing(shipped: Shipment, store: Path) -> list[str]:
    """List the digests of contents that are not stored yet."""
    return sorted(digest for digest in set(shipped.files.values()) if not (store / digest).exists())


def keep(contents: Mapping[str, bytes], store: Path) -> None:
    """Store contents by digest. Raises ValueError if one was altered on its way."""
    for digest, content in contents.items():
        if hashlib.sha256(content).hexdigest() != digest:
            raise ValueError(f"the content of {digest} was altered")
        unfinished = store / f"{digest}.part"
        unfinished.write_bytes(content)
        unfinished.chmod(0o444)
        unfinished.replace(store / digest)


def _link_or_copy(source: Path, target: Path) -> None:
    try:
        os.link(source, target)
    except OSError:  # a file system without hard links
        shutil.copyfile(source, target)


@cache
def program() -> str:
    """Digest of what is installed of planlang: two checkouts may have the same version."""
    digest = hashlib.sha256()
    for folder in map(Path, _planlang()):
        for file in sorted(one for one in folder.rglob("*") if one.is_file() and one.suffix != ".pyc"):
            digest.update(f"{folder.name}/{file.relative_to(folder)}\n".encode())
            digest.update(file.read_bytes())
    return digest.hexdigest()
