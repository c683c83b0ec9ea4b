"""Fixes of recipes that are safe to make in their text, and some that a person has to accept.

General layout: ``proposals`` makes fixes of the diagnostics and their suggestions; ``manchester_text`` and ``xml_text``
make text edits (``edits``) of those; ``fixing`` tries them one after the other and keeps those that help.
"""

from planlang.recipe.fixes.edits import Fix
from planlang.recipe.fixes.fixing import Fixed, fix_recipe

__all__ = ["ACCEPTABLE", "SAFE", "WITHOUT", "Fix", "Fixed", "fix_recipe"]

SAFE = ("O012", "O013", "O042", "O043", "R010", "R011", "R013", "R014", "R020", "R024", "R030", "R033", "R038", "R042",
        "R046", "R049", "R050", "R051", "R057", "R058")  # fmt: skip
"""Codes of fixes that are made unasked: the recipe means the same after them, or nothing else can be meant."""

ACCEPTABLE = ("R010", "R011", "R020", "R033", "R034", "R038", "R039", "R040", "R045", "R046", "R049", "R050", "R058")
"""Codes of fixes that may be guesses, which are made only if they are accepted."""

WITHOUT = {
    "R001": "the file does not say what the task is",
    "R002": "`--task` chooses one",
    "R003": "the file does not say which task they belong to",
    "R004": "the file does not say what the steps are",
    "R005": "other tools may read the file by its own words",
    "R012": "any constraint of the cycle may be wrong",
    "R015": "any of the statements may be wrong",
    "R021": "the file does not say how the action is performed",
    "R022": "the file does not say which step is wrong",
    "R023": "the file does not say which recipe should be flatter",
    "R031": "the file does not say which property was meant, and it may be another program's",
    "R032": "the property, its filler and the class of the filler may each be wrong",
    "R035": "an expression has no name to write instead",
    "R036": "the file does not say where the place is",
    "R037": "the file does not say which number or unit was meant",
    "R041": "the order follows from the file; written down, it would stay when the base motion goes",
    "R043": "the file does not say what the recovery should do",
    "R044": "the failure or the strategy may be wrong",
    "R047": "any order may be intended",
    "R048": "renaming a step would break other files that use the name",
    "R052": "the file does not say where the recipe begins or ends",
    "R053": "either transition may be wrong",
    "R054": "a transition may be missing, or the state superfluous",
    "R055": "the file does not say what comes next",
    "R056": "the file does not say what should follow a failure",
    "R059": "the statement may belong to another task, or be superfluous",
}
"""Code -> why there is no fix: there is more than one right text, or none follows from the file."""
