"""Experience of runs in common formats: narratives in SOMA's and DUL's terms, and poses over time.

General layout: ``model`` (data classes), ``traces`` (from a trace), ``terms`` and ``narrative`` (to RDF), ``reading``
(from RDF), ``poses``.
"""

from planlang.experience.model import Experience, State, Thing
from planlang.experience.narrative import narrative
from planlang.experience.reading import episode_in, experience_in, read_narrative
from planlang.experience.traces import experience_of

__all__ = [
    "Experience",
    "State",
    "Thing",
    "episode_in",
    "experience_in",
    "experience_of",
    "narrative",
    "read_narrative",
]
