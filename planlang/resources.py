"""Files that come with planlang: beside the packages in a checkout, inside planlang in a wheel."""

from __future__ import annotations

from difflib import get_close_matches
from enum import Enum
from pathlib import Path

from planlang.diagnostics import BadInput, error

SUFFIXES = (".omn", ".owl", ".ttl", ".owl.in", ".toml")
"""Suffixes that a bundled file may have; a user's own file may have any."""


def bundled(folder: str) -> Path:
    """Return the folder "ontologies" or "recipes" that came with this installation."""
    here = Path(__file__).resolve().parent
    installed = here / "data" / folder
    return installed if installed.is_dir() else here.parent / folder


class Bundled(Enum):
    """A kind of file that comes with planlang; the value is the word for it in messages."""

    RECIPE = "recipe"
    ROBOT = "robot"
    ENVIRONMENT = "environment"

    @property
    def folder(self) -> Path:
        """The folder that holds the files of this kind."""
        return bundled("recipes") if self is Bundled.RECIPE else bundled("ontologies") / f"{self.value}s"

    def names(self) -> tuple[str, ...]:
        """Return the names of the bundled files, without suffixes, sorted."""
        found = {path.name.removesuffix(suffix) for suffix in SUFFIXES for path in self.folder.glob(f"*{suffix}")}
        return tuple(sorted(found))

    def find(self, name: str) -> Path:
        """Return the file called ``name``: an existing path, or a bundled file of that name.

        Raises BadInput when there is none, listing the bundled ones.
        """
        if not name.strip():
            raise BadInput([error("C001", f"the name of the {self.value} is empty", help=self._advice())])
        path = Path(name)
        try:
            if path.is_file():
                return path
            is_folder = path.is_dir()
            is_stream = name == "-" or (path.exists() and not is_folder)
        except (OSError, ValueError) as problem:  # a name too long, or with a null character
            raise BadInput([error("C001", f"no {self.value} can be read at {name[:80]!r}: {problem}")]) from None
        if path.name == name:
            for suffix in SUFFIXES:
                candidate = self.folder / f"{name}{suffix}"
                if candidate.is_file():
                    return candidate
        if is_folder:
            raise BadInput([error("C001", f"{name} is a folder", help=f"name the {self.value}'s file in it")])
        if is_stream:
            why = f"{name} is a pipe or device; the {self.value} is read more than once"
            raise BadInput([error("C001", why, help=f"write it to a file first: ... > {self.value}.owl")])
        similar = get_close_matches(name, self.names(), n=1)
        guess = f"did you mean {similar[0]}? " if similar else ""
        raise BadInput([error("C001", f"no such {self.value}: {name}", help=guess + self._advice())])

    def _advice(self) -> str:
        known = ", ".join(self.names()) or "none"
        return f"give the path of a file, or the name of a bundled {self.value}: {known}"
