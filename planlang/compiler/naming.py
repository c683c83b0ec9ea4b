"""Python names for OWL names: snake case, no keyword, no clash."""

from __future__ import annotations

import builtins
import keyword
import re
import unicodedata
from collections.abc import Iterable

_WORD = re.compile(r"[A-Z]+(?=[A-Z][a-z])|[A-Z]?[a-z]+|[A-Z]+|[0-9]+|[^\W\d_]+")


def snake_case(name: str) -> str:
    """``MoveBaseToGraspPose`` -> ``move_base_to_grasp_pose``; characters Python does not allow become ``_``.

    Digits stay with the word before them (``bottle1``); a leading digit gets an underscore before it.
    """
    text = unicodedata.normalize("NFKC", name)
    words: list[str] = []
    end = 0
    for match in _WORD.finditer(text):
        word = match.group().lower()
        if word.isdigit() and words and match.start() == end:
            words[-1] += word
        else:
            words.append(word)
        end = match.end()
    result = "_".join(words) or "_"
    return f"_{result}" if result[0].isdigit() else result


def without_digits(name: str) -> str:
    """Drop trailing digits and what joins them: ``bottle1`` -> ``bottle``; a name of digits only stays."""
    return re.sub(r"[_\-]*\d+$", "", name) or name


class Names:
    """A scope of names, each given out once: the second ``bottle`` is ``bottle_2``."""

    def __init__(self, taken: Iterable[str] = ()) -> None:
        self._taken = set(taken)

    def claim(self, wanted: str) -> str:
        """``wanted``, or the first of ``wanted_2``, ``wanted_3``, ... that is free and no word of the language."""
        name, number = wanted, 1
        while name in self._taken or keyword.iskeyword(name) or keyword.issoftkeyword(name) or hasattr(builtins, name):
            number += 1
            name = f"{wanted}_{number}"
        self._taken.add(name)
        return name

    def reserve(self, name: str) -> None:
        """Keep a name from being given out."""
        self._taken.add(name)
