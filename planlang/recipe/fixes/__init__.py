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
    "R001": "what the task is, is not in the file",
    "R002": "which task is meant is said by `--task`",
    "R003": "which task the parts are of is not in the file",
    "R004": "what the steps are is not in the file",
    "R005": "the words are read as they are meant, and tools of their own may read the file by its own words",
    "R012": "each constraint of the circle could be the wrong one",
    "R015": "each of the statements could be the wrong one",
    "R021": "how the action is performed is not in the file",
    "R022": "which step should not be there is not in the file",
    "R023": "which recipe should be flatter is not in the file",
    "R031": "which property was meant is not in the file, or it is another program's",
    "R032": "the property, its filler and the class of the filler could each be the wrong one",
    "R035": "an expression has no name that could be written in its place",
    "R036": "where the place is, is not in the file",
    "R037": "which number or unit was meant is not in the file",
    "R041": "the order follows from the file: written down it would stay when the base motion goes",
    "R043": "what the recovery should do is not in the file",
    "R044": "whether the failure or the strategy is the wrong one is not in the file",
    "R047": "any order may be meant",
    "R048": "a new name for a step would break the other files that name it",
    "R052": "where a recipe begins and is done is not in the file",
    "R053": "each of the transitions could be the wrong one",
    "R054": "the transition that is missing, or that the state is too many, could each be meant",
    "R055": "what comes next is not in the file",
    "R056": "what should be done after a failure is not in the file",
    "R059": "whether the statement belongs to another task, or should go, is not in the file",
}
"""Code -> why there is no fix: there is more than one right text, or none follows from the file."""
