"""Locations as phrases of controlled English: "in reach of the patient with the right arm and not blocking the door".

``lexicon`` has the vocabulary, ``location.lark`` the grammar; ``reading`` parses a phrase to a location and explains
errors; ``writing`` formats a location as an equivalent phrase.
"""

from planlang.phrases.lexicon import Lexicon
from planlang.phrases.reading import read_location, read_thing
from planlang.phrases.writing import write_location, write_relation, write_thing

__all__ = ["Lexicon", "read_location", "read_thing", "write_location", "write_relation", "write_thing"]
