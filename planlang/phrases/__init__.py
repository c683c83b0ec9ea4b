"""Locations as phrases of controlled English: "in reach of the patient with the right arm and not blocking the door".

General layout: ``lexicon`` has the words and the nouns, ``location.lark`` how they are put together; ``reading`` turns
a phrase into a location, and explains errors; ``writing`` turns a location into a phrase that means the same.
"""

from planlang.phrases.lexicon import Lexicon
from planlang.phrases.reading import read_location, read_thing
from planlang.phrases.writing import write_location, write_relation, write_thing

__all__ = ["Lexicon", "read_location", "read_thing", "write_location", "write_relation", "write_thing"]
