"""Goals: what has to hold in the true world after a plan, read from phrases, declared by recipes, decided at the end.

``reading`` reads phrases with the names of a map, ``checking`` says what its world can decide, ``true_bodies`` answers
what relations ask about bodies from the true world, ``deciding`` decides goals in it once it has come to rest.
``sim.tolerances`` has the tolerances. The robot, its modules and its belief know nothing of all this.
"""

from executive.goals.checking import decidable
from executive.goals.deciding import Judge, Predicate, Verdict

__all__ = ["Judge", "Predicate", "Verdict", "decidable"]
