"""The words of phrases: for every relation how it is said, the first form being the one that is written."""

from __future__ import annotations

import re

from planlang.designators import GRASPS, RELATIONS

FORMS: dict[str, tuple[str, ...]] = {
    "in_reach_of": ("in reach of", "within reach of"),
    "visible_from": ("visible from", "in view of", "in sight of", "seeing"),
    "above": ("above", "over"),
    "on": ("on", "on top of"),
    "in_": ("in", "inside", "inside of"),
    "in_center_of": ("in the center of", "in the centre of", "in the middle of"),
    "in_front_of": ("in front of", "before"),
    "behind": ("behind",),
    "left_of": ("left of", "to the left of"),
    "right_of": ("right of", "to the right of"),
    "next_to": ("next to", "beside"),
    "near": ("near", "close to"),
    "far_from": ("far from", "away from"),
    "facing": ("facing",),
    "clear_of": ("clear of", "not blocking", "not touching"),
}
"""Relation -> its forms; all keys of :data:`planlang.designators.RELATIONS`."""

BLOCKING = ("blocking", "touching")
"""Said of what is not clear of something."""

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

assert FORMS.keys() == RELATIONS.keys()
assert GRASP_FORMS.keys() == set(GRASPS)

RELATION_OF: dict[str, str] = {form: name for name, forms in FORMS.items() for form in forms}
"""Form -> relation."""


def pattern(forms: tuple[str, ...]) -> str:
    """A regular expression for any of the forms, the longest first, with any space between the words."""
    ordered = sorted(forms, key=lambda form: (-len(form), form))
    return "|".join(r"\s+".join(map(re.escape, form.split())) for form in ordered)


def plain(text: str) -> str:
    """Lower case, one space between words."""
    return " ".join(text.lower().split())
