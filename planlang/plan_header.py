"""The first docstring of a compiled plan: what it was compiled from and how, and a digest that tells edits.

::

    Compiled by planlang 0.1.0 from serve_a_drink.omn
    (sha256 7b3a...), task ServeADrink.
    Compiled with --no-scopes.
    What follows has sha256 91c0... unless somebody has edited it.

The digest is that of everything after the docstring, lines ended by a line feed, whatever ends them in the file.
"""

from __future__ import annotations

import hashlib
import re
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from planlang.files import from_printable
from planlang.resources import bundled

LONGEST = 10_000
"""Characters at the start of a plan among which its header is looked for."""

NO_SCOPES, NO_DATA_FLOW = "--no-scopes", "--no-dataflow"

_HEADER = re.compile(
    r"Compiled by planlang (?P<version>\S+) from (?P<recipe>.+?) \(sha256 (?P<sha256>[0-9a-f]{8,64})[.…]*\),"
    r" task (?P<task>\S+?)\.?(\s|$)(Compiled with (?P<options>[-a-z ]+)\. )?"
    r"(What follows has sha256 (?P<digest>[0-9a-f]{64}) unless)?"
)


@dataclass(frozen=True, slots=True)
class PlanHeader:
    """The origin of a plan."""

    version: str
    recipe: str
    """File name of the recipe, without its folder."""
    sha256: str
    """Digest of the recipe's bytes, maybe only its first digits."""
    task: str
    options: tuple[str, ...] = ()
    """Options of the compiler that shape the plan, other than the task."""
    digest: str | None = None
    """Digest of what follows the docstring as it was compiled; None if the header does not tell it."""

    def matches(self, content: bytes) -> bool:
        """Return True if these are the bytes of the recipe from which the plan was compiled."""
        return hashlib.sha256(content).hexdigest().startswith(self.sha256)

    def is_edited(self, source: str) -> bool:
        """True if the plan's source is not as it was compiled, or that cannot be told."""
        return self.digest != digest(source)

    def find_recipe(self, plan: Path, folders: Iterable[Path] = ()) -> Path | None:
        """Return the recipe: the first file of its name beside the plan, in ``folders``, among the bundled ones."""
        names = dict.fromkeys((self.recipe, from_printable(self.recipe)))
        for path in (folder / name for folder in (plan.parent, *folders, bundled("recipes")) for name in names):
            try:
                if path.is_file():
                    return path
            except (OSError, ValueError):  # a name too long, or with a null character
                return None
        return None

    def paragraphs(self) -> list[str]:
        """Return the header as lines of the docstring."""
        lines = [
            f"Compiled by planlang {self.version} from {self.recipe}",
            f"(sha256 {self.sha256}), task {self.task}.",
        ]
        lines += [f"Compiled with {' '.join(self.options)}."] if self.options else []
        lines += [f"What follows has sha256 {self.digest} unless", "somebody has edited it."] if self.digest else []
        return lines


def digest(source: str) -> str:
    """Return the sha256 of what follows the first docstring of a plan's source; of everything if there is none."""
    parts = source.split('"""', 2)
    text = "\n".join(parts[-1].splitlines())
    return hashlib.sha256(text.encode("utf-8", errors="surrogatepass")).hexdigest()


def header(source: str) -> PlanHeader | None:
    """Return the origin that a plan's source states at its start, or None. The source need not be valid."""
    found = _HEADER.search(" ".join(source[:LONGEST].split()))
    if found is None:
        return None
    options = tuple((found["options"] or "").split())
    return PlanHeader(found["version"], found["recipe"], found["sha256"], found["task"], options, found["digest"])
