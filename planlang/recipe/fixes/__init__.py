"""Fixes in the text of recipes: safe ones, and uncertain ones that the user has to accept.

General layout: ``proposals`` derives fixes from diagnostics; ``manchester_text`` turns them into edits of Manchester
syntax; ``fixing`` applies them one after the other and keeps those that help, in a file of another syntax as if it were
written in this one.
"""

from __future__ import annotations

from collections.abc import Callable

from planlang.diagnostics import Span
from planlang.recipe.fixes.manchester_text import CannotEdit, Edit, ManchesterText
from planlang.records import dataclass
from planlang.words import Option, Text

SAFE = ("O012", "O013", "O016", "O042", "O043", "R010", "R011", "R013", "R014", "R020", "R024", "R030", "R033", "R038",
        "R046", "R049", "R050", "R051", "R057", "R058")  # fmt: skip
"""Codes of fixes that are applied by default: the recipe keeps its meaning, or has only one plausible meaning."""

ACCEPTABLE = ("O016", "R010", "R011", "R020", "R033", "R034", "R038", "R039", "R040", "R042", "R045", "R046", "R049",
              "R050", "R058")  # fmt: skip
"""Codes of uncertain fixes, which are applied only if accepted."""

WITHOUT = {
    "R001": "the file does not state the task",
    "R002": Text("`", Option("task"), "` chooses one"),
    "R003": "the file does not state their task",
    "R004": "the file does not state the steps",
    "R005": "other tools may depend on the words that the file uses",
    "R012": "any constraint of the cycle may be wrong",
    "R015": "any of the statements may be wrong",
    "R021": "the file does not state how to perform the action",
    "R022": "any step of the circle may be wrong",
    "R023": "any of the nested recipes may be the one to flatten",
    "R031": "the intended property is unknown, and another program may use this one",
    "R032": "the property, its filler and the class of the filler may each be wrong",
    "R035": "the file does not state which thing or number is meant",
    "R036": "the file does not state where the place is",
    "R037": "the intended number or unit is unknown",
    "R041": "the order follows from the base motion; once written, it would remain if the motion is removed",
    "R043": "the file does not state what the recovery should do",
    "R044": "the failure or the strategy may be wrong",
    "R047": "any order may be intended",
    "R048": "renaming a step would break other files that use the name",
    "R052": "the file does not state where the recipe begins or ends",
    "R053": "either transition may be wrong",
    "R054": "a transition may be missing, or the state superfluous",
    "R055": "the file does not state what comes next",
    "R056": "the file does not state what to do after a failure",
    "R059": "the statement may belong to another task, or be superfluous",
    "R060": "the property or its filler may be wrong",
    "R061": "the file does not state the target",
    "R062": "the file does not state the thing or place",
    "R063": "the intended slot is unknown",
    "R065": "the intended constraint is unknown",
    "R067": "any of the orderings may be wrong",
    "R068": "the file does not state the thing or place",
    "R069": "the file does not state which things are meant",
    "R070": "the file does not state the other thing, or which one is superfluous",
    "R071": "it may be meant to stay so",
}
"""Code -> why there is no fix: the file allows several corrections, or determines none."""


class Worse(CannotEdit):
    """A fix would make the recipe worse; ``advice`` is what to write instead."""

    def __init__(self, why: str, advice: str) -> None:
        super().__init__(why)
        self.advice = advice


@dataclass(frozen=True, slots=True)
class Fix:
    """A fix for diagnostics of ``code``: its effect in words, its position, and the edits that make it.

    Without ``edit``, the mistake is gone once the statements are written in another syntax. A fix that is not safe is a
    guess at the intended meaning, which the user has to accept.
    """

    code: str
    message: str
    span: Span | None
    edit: Callable[[ManchesterText], list[Edit]] | None
    is_safe: bool = True
