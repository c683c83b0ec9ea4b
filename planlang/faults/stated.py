"""The faults that are stated for a run: by texts, by a file with the expected outcome, and by a rate."""

from __future__ import annotations

import tomllib
from collections.abc import Collection, Iterable
from pathlib import Path
from typing import Any

from planlang.faults.named import NamedFault, WrongFault, read_faults
from planlang.files import decode, read_file
from planlang.records import dataclass
from planlang.spelling import similar

DONE = "done"
"""The expected outcome of a run that reaches its end."""
_KEYS = ("faults", "rate", "expect")


@dataclass(frozen=True, slots=True)
class StatedFaults:
    """Faults of a run, and how it is expected to end."""

    named: tuple[NamedFault, ...]
    rate: float
    """Share of the opportunities at which something goes wrong by chance."""
    expect: str | None
    """``done``, or the class of a failure in the chain of the one that ends the run; None: nothing is expected."""

    @staticmethod
    def of_file(path: Path) -> StatedFaults:
        """Read a file in TOML: ``faults``, a text or a list of them, ``rate`` and ``expect``. Raises WrongFault.

        Raises BadInput for a file that cannot be read.
        """
        try:
            content: dict[str, Any] = tomllib.loads(decode(read_file(path), str(path)))
        except tomllib.TOMLDecodeError as problem:
            raise WrongFault(f"this is no TOML: {problem}") from None
        for key in content:
            if key not in _KEYS:
                guess = similar(key, _KEYS)
                raise WrongFault(f"there is no key {key!r}{f': did you mean {guess[0]}?' if guess else ''}")
        return StatedFaults(_named(content.get("faults", ())), _rate(content.get("rate", 0.0)), _expected(content))

    def also(self, texts: Iterable[str], rate: float) -> StatedFaults:
        """Add faults; a ``rate`` above 0 replaces the present one."""
        return StatedFaults((*self.named, *read_faults(texts)), rate or self.rate, self.expect)


def _named(given: Any) -> tuple[NamedFault, ...]:
    texts = [given] if isinstance(given, str) else given
    if not isinstance(texts, Collection) or isinstance(texts, dict) or not all(isinstance(one, str) for one in texts):
        raise WrongFault("faults is a text, or a list of texts")
    return read_faults(texts)


def _rate(given: Any) -> float:
    if isinstance(given, bool) or not isinstance(given, int | float) or not 0 <= given <= 1:
        raise WrongFault(f"rate={given!r} is no share from 0 to 1")
    return float(given)


def _expected(content: dict[str, Any]) -> str | None:
    given = content.get("expect")
    if given is not None and not (isinstance(given, str) and given.isidentifier()):
        raise WrongFault(f"expect={given!r}: write {DONE}, or the class of a failure")
    return given
