"""The words of phrases: those of relations from their table, and those of grasps, bounds and joints."""

from __future__ import annotations

import re

from planlang.designators import GRASPS
from planlang.relations import RELATIONS

GRASP_FORMS: dict[str, tuple[str, ...]] = {
    "side": ("from the side", "with a side grasp"),
    "tilted": ("at a tilt", "with a tilted grasp"),
    "top": ("from the top", "from above", "with a top grasp"),
}
"""Grasp -> its forms; all of :data:`planlang.designators.GRASPS`."""

ENDS = ("and", "but", "with", "from", "at", "called")
"""Words that no noun contains: after a noun something else begins with them."""

ARTICLES = ("the", "a", "an", "any")
"""Words that stand before a noun and in none."""

LIMITS = {"at most": "within", "up to": "within", "at least": "beyond", "more than": "beyond", "less than": "within"}
"""How a length is said to be the greatest or the least -> the bound of the relation."""

LONGEST, DEEPEST = 20_000, 20
"""Characters of a phrase, and places within each other, that are read at most."""

assert GRASP_FORMS.keys() == set(GRASPS)


def forms() -> dict[str, str]:
    """Return how relations are said: each form with the name of its relation."""
    return {form: name for name, relation in RELATIONS.items() for form in relation.forms}


def opposites() -> dict[str, str]:
    """Return what says the opposite of a relation, "blocking" of what is not clear of something, with its name."""
    return {
        form.removeprefix("not "): name
        for name, relation in RELATIONS.items()
        for form in relation.forms
        if form.startswith("not ")
    }


def pattern(forms: tuple[str, ...]) -> str:
    """Return a regular expression for any of the forms, the longest first, with any space between the words."""
    ordered = sorted(forms, key=lambda form: (-len(form), form))
    return "|".join(r"\s+".join(map(re.escape, form.split())) for form in ordered)


def plain(text: str) -> str:
    """Return lower case, one space between words."""
    return " ".join(text.lower().split())
