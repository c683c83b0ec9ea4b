"""Locations as phrases of controlled English: "in reach of the patient with the right arm and not blocking the door".

General layout: ``words`` is the table of what can be said, ``location.lark`` how it is put together; ``reading`` makes
a location of a phrase and ``writing`` a phrase of a location, inverse to each other; ``lexicon`` knows the nouns.
"""

from planlang.phrases.lexicon import Lexicon
from planlang.phrases.reading import read_location, read_thing
from planlang.phrases.writing import write_location, write_relation, write_thing

__all__ = ["Lexicon", "read_location", "read_thing", "write_location", "write_relation", "write_thing"]
