"""What may have been meant by a name that nothing defines."""

from __future__ import annotations

from collections.abc import Iterable
from difflib import SequenceMatcher, get_close_matches

from planlang.designators import local_name
from planlang.diagnostics import Rename

SURE = 0.85
"""How alike two names have to be, as difflib measures it, to take the one for the other if no third is as like."""


def guess(written: str, names: Iterable[str], *, least: float = 0.6) -> Rename | None:
    """The name (IRI) whose local part is most like that of what is written (IRI); None if none is ``least`` like it.

    It is sure if it is the only one that is nearly the same.
    """
    known: dict[str, str] = {}
    for name in names:
        if name != written:
            known.setdefault(local_name(name), name)
    short = local_name(written)
    similar = get_close_matches(short, known, n=2, cutoff=least)
    if not similar:
        return None
    near = [name for name in similar if SequenceMatcher(None, name, short).ratio() >= SURE]
    return Rename(written, known[similar[0]], is_sure=len(near) == 1)
