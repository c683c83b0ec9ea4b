"""What of the remaining task a change of the map leaves without a way: things that are to be brought somewhere."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from itertools import islice

from executive.belief.planning_scene import PlanningScene
from executive.locations.demands import goals_of, use_at
from planlang.designators import Action, Location, Object, a_location
from planlang.relations.demands import Reach, ReachKind

MOST_ASKED = 4
"""Number of places and things of later steps of which is asked."""
HasWay = Callable[[Location, PlanningScene], bool | None]
"""Check whether a location of the base has a way in a scene that is supposed; None if that is not known."""


def lacking_later(
    steps: Sequence[Action], body: str, held: PlanningScene, scene: PlanningScene, has_way: HasWay
) -> str:
    """Say what of the steps has no way after a change, as a part of a sentence about ``body``; "" if all has.

    ``held`` is the scene in which a hand holds the body, where the base then is, ``scene`` the one before. Only what is
    sure to have no way is said, and nothing of what closed furniture hides: it will have been opened.
    """
    for words, location, then in islice(_asked_about(steps, body, held, scene), MOST_ASKED):
        if has_way(location, then) is False:
            return words
    return ""


def _asked_about(
    steps: Sequence[Action], body: str, held: PlanningScene, scene: PlanningScene
) -> Iterator[tuple[str, Location, PlanningScene]]:
    """Yield what is said if there is no way, where the base has to stand, and the scene in which it is asked."""
    for goal in goals_of(body, steps, held):
        use = use_at(goal, body, held, held.base()[:2])
        if use is not None and not use.inside:
            yield f"then not {_brought(use)}", a_location(in_reach_of=goal), held
    gone = scene.supposing(scene.belief.state.placed({body: None}))  # it may stand before the others until it is taken
    for what in dict.fromkeys(one for step in steps if isinstance(one := step.get("object_acted_on"), Object)):
        name = scene.bodies.known(what)
        if name is None or name == body or not scene.bodies.is_graspable(name) or scene.bodies.is_held(name):
            continue
        if goals_of(name, steps, scene) and scene.bodies.closed_before(name) is None:
            yield f"then {name}, which is to be brought, could not", a_location(in_reach_of=what), gone


def _brought(use: Reach) -> str:
    return f"handed to {use.body}" if use.kind is ReachKind.OFFER else f"put on {use.body}"
