"""Experience of runs in common formats: narratives in SOMA's and DUL's terms, and poses over time.

General layout: ``model`` (data classes), ``traces`` (from a trace), ``terms`` and ``narrative`` (to RDF), ``reading``
(from RDF), ``poses``.
"""

from planlang.experience.model import Experience as Experience
from planlang.experience.model import State as State
from planlang.experience.model import Thing as Thing
from planlang.experience.narrative import narrative as narrative
from planlang.experience.reading import episode_in as episode_in
from planlang.experience.reading import experience_in as experience_in
from planlang.experience.reading import read_narrative as read_narrative
from planlang.experience.traces import experience_of as experience_of
