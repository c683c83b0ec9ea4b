"""Python names for OWL names: snake case, no keyword, no clash."""

from __future__ import annotations

import builtins
import keyword
import re
import unicodedata
from collections.abc import Iterable


def snake_case(name: str) -> str:
    """``MoveBaseToGraspPose`` -> ``move_base_to_grasp_pose``; characters Python does not allow become ``_``.

    Digits stay with the word before them (``bottle1``); a leading digit gets an underscore before it.
    """
    text = unicodedata.normalize("NFKC", name)
    parts: list[str] = []
    for index, character in enumerate(text):
        if not f"a{character}".isidentifier():
            parts.append("_")
            continue
        before, after = text[index - 1 : index] if index else "", text[index + 1 : index + 2]
        if character.isupper() and (before.islower() or before.isdigit() or (before.isupper() and after.islower())):
            parts.append("_")
        parts.append(character.lower())
    result = re.sub("_+", "_", unicodedata.normalize("NFKC", "".join(parts))).strip("_")
    return result if result.isidentifier() else f"_{result}"


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
