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
        self._last: dict[str, int] = {}
        """The greatest number given out with a name, so that the next is not searched from the start."""

    def claim(self, wanted: str, *, is_key: bool = False) -> str:
        """``wanted``, or the first of ``wanted_2``, ``wanted_3``, ... that is free and no word of the language.

        With ``is_key`` the name is that of a branch: a keyword argument or a parameter, which may be called like a
        builtin function but not ``name`` or ``limit``, which constructs have themselves.
        """
        name, number = wanted, self._last.get(wanted, 1)
        is_fit = _is_branch_name if is_key else _is_free
        while name in self._taken or not is_fit(name):
            number += 1
            name = f"{wanted}_{number}"
        self._last[wanted] = number
        self._taken.add(name)
        return name

    def reserve(self, name: str) -> None:
        """Keep a name from being given out."""
        self._taken.add(name)


def _is_free(name: str) -> bool:
    return not (keyword.iskeyword(name) or keyword.issoftkeyword(name) or hasattr(builtins, name))


def _is_branch_name(name: str) -> bool:
    return not keyword.iskeyword(name) and name not in ("name", "limit")
