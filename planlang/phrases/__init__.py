"""Locations as phrases of controlled English: "in reach of the patient with the right arm and not blocking the door".

``lexicon`` has the vocabulary, ``location.lark`` the grammar; ``reading`` parses a phrase to a location and explains
errors; ``writing`` formats a location as an equivalent phrase. ``goals`` reads what has to hold after a plan, in the
same words, with the grammar of ``goal.lark`` added.
"""

from planlang.phrases.goals import read_goal
from planlang.phrases.lexicon import Lexicon
from planlang.phrases.reading import read_location, read_thing
from planlang.phrases.writing import write_location, write_relation, write_thing

__all__ = ["Lexicon", "read_goal", "read_location", "read_thing", "write_location", "write_relation", "write_thing"]
