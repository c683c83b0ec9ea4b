"""Strategies of recovery: what is done between a failure and the next attempt, registered by name.

A plan author passes a strategy as ``do`` of a :class:`Recovery`. The compiler does so where a recovery of an ontology
names the strategy (``ontologies/recovery.omn``), which is why each is registered with its name there. A strategy is
added in this file, or without a fork: in an installed package with an entry point of the group ``planlang.recoveries``,
which names the function, or the Python module that it is in. Trying the next base pose is no strategy: ``at_location``
does that by itself.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from contextlib import suppress
from functools import cache, partial, wraps
from importlib.metadata import entry_points
from typing import Any, TypeVar, cast

from planlang.designators import Condition, Object, a_location, action
from planlang.failures import (
    BehindClosedDoor,
    ContainerStuck,
    HandleNotReachable,
    HandsFull,
    LocationUnresolvable,
    LookingFailure,
    LowLevelFailure,
    ObjectNotFound,
    ObjectNowhereToBeFound,
    ObjectUndeliverable,
    ObjectUnfetchable,
    ObjectUnreachable,
    ObjectUnresolvable,
    PlanFailure,
)
from planlang.kernel.primitives import called
from planlang.language.branches import Branch
from planlang.language.executive import executive_for
from planlang.language.location import AGAIN, at_location, make_room
from planlang.language.performing import perform
from planlang.language.recovery import PROPAGATE, RETRY, Do, Recovery, RecoveryResult, Return, retry
from planlang.misuse import Usage, written
from planlang.records import dataclass

GROUP = "planlang.recoveries"
"""Entry-point group of installed strategies."""

F = TypeVar("F", bound=Callable[..., Any])
_STRATEGY = Usage(
    "@recovery_strategy",
    {"name": '"LookAgain"'},
    {
        "about_object": "True",
        "moves_base": "True",
        "goes_back": "True",
        "otherwise": "ObjectNowhereToBeFound",
        "function": "look",
    },
)


@dataclass(frozen=True, slots=True)
class Strategy:
    """A registered strategy.

    ``name`` is what ontologies call it. ``function`` is what plans write as ``do`` of a Recovery; with
    ``about_object`` they write a call of it with the object that the step handles. ``moves_base`` says that it leaves
    the base pose of a location scope, so that it has to surround the scope. Without a function the failure escalates
    at once. ``goes_back`` says that the failure may arise later on and undoes what the step has achieved, so that it
    is written around the steps that follow, too, until what it is about is let go; there the function also gets a
    branch that runs the step again. ``otherwise`` is raised when the attempts are used up, unless a Recovery says
    else.
    """

    name: str
    function: Callable[..., Any] | None
    about_object: bool = False
    moves_base: bool = False
    goes_back: bool = False
    otherwise: type[PlanFailure] | None = None

    @property
    def origin(self) -> tuple[str, str] | None:
        """The module that plans import the function from, and its name there; None if they need none.

        A Recovery repeats by itself, and with no attempts it escalates.
        """
        if self.function is None or self.function is retry:
            return None
        return self.function.__module__, self.function.__name__


_registered: dict[str, Strategy] = {
    "Escalate": Strategy("Escalate", None),
    "Repeat": Strategy("Repeat", retry),
}


def recovery_strategy(
    name: str,
    *,
    about_object: bool = False,
    moves_base: bool = False,
    goes_back: bool = False,
    otherwise: type[PlanFailure] | None = None,
) -> Callable[[F], F]:
    """Register a function as the strategy that ontologies call ``name``.

    Without ``about_object`` it is a ``do`` of :class:`Recovery` itself: an async function of the failure. With it, a
    function of an object that returns one. ``moves_base`` says that it drives, ``goes_back`` that it repeats what the
    step has achieved, whenever that is undone; such strategies are about an object. ``otherwise`` is the failure that a
    Recovery raises when its attempts are used up, if it says nothing else: for a strategy whose end means the same
    whatever it recovers from.
    Raises ValueError if another function has the name, or if plans cannot import the function.
    """
    _STRATEGY.text("name", name)
    if otherwise is not None and not (isinstance(otherwise, type) and issubclass(otherwise, PlanFailure)):
        raise _STRATEGY.wrong("otherwise", otherwise, "None or a failure class")
    for key, does in {"moves_base": "moves the base", "goes_back": "goes back"}.items():
        if {"moves_base": moves_base, "goes_back": goes_back}[key] and not about_object:
            raise _STRATEGY.refused(key, f"{name} {does}, so it has to be about an object", True)

    def register(function: F) -> F:
        name_in_module = getattr(function, "__qualname__", "")
        if not name_in_module.isidentifier():  # a lambda, a method, a function inside another, or no function
            message = f"plans cannot import {written(function)}; write it at the top of a module"
            raise _STRATEGY.refused("function", message, function)
        strategy = Strategy(name, function, about_object, moves_base, goes_back, otherwise)
        other = _registered.setdefault(name, strategy)
        if other.origin != strategy.origin:
            taken = ".".join(other.origin or ("planlang",))
            raise _STRATEGY.refused("name", f"{taken} is registered as {name} already", name)
        return function if otherwise is None else _ending(function, otherwise, about_object=about_object)

    return register


def _ending(function: F, otherwise: type[PlanFailure], *, about_object: bool) -> F:
    """Return a strategy that tells a Recovery what it raises in the end."""
    if not about_object:
        setattr(function, "otherwise", otherwise)  # noqa: B010 - of a function that is called with the failure itself
        return function

    @wraps(function)
    def strategy(*arguments: Any, **keywords: Any) -> Any:
        do = partial(function(*arguments, **keywords))
        vars(do)["otherwise"] = otherwise
        return do

    return cast(F, strategy)


def find_strategy(name: str) -> Strategy | None:
    """Return the strategy that ontologies call ``name``, None if there is none; packages are asked if need be.

    Raises what a package raises when it is imported, with a note that names its entry point.
    """
    if name not in _registered:
        _load_installed()
    return _registered.get(name)


def registered_strategies() -> tuple[Strategy, ...]:
    """Return the strategies that are registered so far, in the order of registration."""
    return tuple(_registered.values())


@cache
def _load_installed() -> None:
    for point in entry_points(group=GROUP):
        try:
            point.load()  # importing a module registers what it marks
        except Exception as error:
            error.add_note(f"while loading {point.value}, an entry point of the group {GROUP}")
            raise


@recovery_strategy("LookFromAnotherPlace", about_object=True, moves_base=True, otherwise=ObjectNowhereToBeFound)
def look_from_another_place(what: Object) -> Do:
    """Look for the object once more from here, else from where it should be visible, then run the body again.

    The base does not move if it is seen from here. Not finding it elsewhere either is no failure yet: the body will
    tell. If it is not known where it is, it is looked for wherever it is likely. Raises ObjectNowhereToBeFound when
    there is no other place to look from; so does a Recovery when it is used up, if it says nothing else.
    """

    Usage("look_from_another_place", {"what": "bottle"}).instance("what", what, Object, "an object")

    async def look(failure: PlanFailure) -> RecoveryResult:
        try:
            if any(isinstance(link, ObjectUnresolvable) for link in failure.chain()):
                await _look_for(what)
            elif not await _sees(what):
                with suppress(ObjectNotFound):
                    await at_location(a_location(visible_from=what), partial(_look_for, what))
        except (ObjectUnreachable, ObjectUndeliverable) as nowhere:
            raise ObjectNowhereToBeFound(what=str(what)) from nowhere
        return RETRY

    return look


@recovery_strategy("LookAndRepeat", about_object=True)
def look_and_repeat(what: Object) -> Do:
    """Look for the object from here, which may correct where it is believed to be, then run the body again."""

    Usage("look_and_repeat", {"what": "bottle"}).instance("what", what, Object, "an object")

    async def look(failure: PlanFailure) -> RecoveryResult:
        if not await _sees(what):
            await _look_for(what)
        return RETRY

    return look


@recovery_strategy("OpenWhatIsInTheWay", about_object=True, moves_base=True)
def open_what_is_in_the_way(what: Object) -> Do:
    """Open the closed door behind which the object is, or the drawer in which it is, then run the body again.

    A failure that has another reason goes outward.
    """

    Usage("open_what_is_in_the_way", {"what": "bottle"}).instance("what", what, Object, "an object")

    async def open_it(failure: PlanFailure) -> RecoveryResult:
        closed = next((link for link in failure.chain() if isinstance(link, BehindClosedDoor)), None)
        if closed is None or closed.door is None:
            return PROPAGATE
        opening = action("OpeningAContainerArtifact", object_acted_on=closed.door)
        again = Recovery((ContainerStuck, HandleNotReachable), step_back_and_repeat(closed.door), attempts=AGAIN)
        await perform(opening, recoveries=[again])
        return RETRY

    return open_it


@recovery_strategy("StepBackAndRepeat", about_object=True, moves_base=True)
def step_back_and_repeat(what: Object) -> Do:
    """Drive a step back with the arms in their posture for driving, look at the object, then run the body again.

    What was felt and seen meanwhile changes what is planned: how far a door has come, what is in its way. A failure of
    a search that finds the same once more goes outward: nothing has changed.
    """

    Usage("step_back_and_repeat", {"what": "cabinet"}).instance("what", what, Object, "an object")
    searched: set[str] = set()

    async def step_back(failure: PlanFailure) -> RecoveryResult:
        for link in failure.chain():
            if isinstance(link, LocationUnresolvable):
                found = f"{link.designator}: {link.figures or link.describe()}"
                if found in searched:
                    return PROPAGATE
                searched.add(found)
        with suppress(LowLevelFailure):  # the body will tell whether there is room enough
            await perform(action("SteppingBack"))
        await _sees(what)
        return RETRY

    return step_back


@recovery_strategy("FetchAgain", about_object=True, moves_base=True, goes_back=True, otherwise=ObjectUnfetchable)
def fetch_again(what: Object, again: Branch | None = None) -> Do:
    """Look for an object that has left the hand, grasp it by the branch ``again``, then run the body again.

    Without ``again`` the body itself grasps. The object is looked for from here first, as it may lie beside the hand,
    and from another place with the arms in their posture for driving. A failure about something else goes outward: then
    the object is still held. A Recovery that is used up raises ObjectUnfetchable, if it says nothing else.
    """

    fetching = Usage("fetch_again", {"what": "bottle"}, {"again": "fetch_bottle"})
    fetching.instance("what", what, Object, "an object")
    if again is not None:
        fetching.branch("again", again)

    async def fetch(failure: PlanFailure) -> RecoveryResult:
        executive = executive_for("fetch_again")
        if executive.holds(Condition("holding", (what,))):
            return PROPAGATE
        is_seen = await _sees(what)
        await make_room(executive)
        if not is_seen:
            await look_from_another_place(what)(failure)
        if again is not None:
            await called(again)
        return RETRY

    return fetch


@recovery_strategy("PutDownAndRegrasp", about_object=True, moves_base=True, goes_back=True)
def put_down_and_regrasp(what: Object, again: Branch | None = None) -> Do:
    """Put a held object down on whatever is near, grasp it by another grip by the branch ``again``, run the body again.

    Without ``again`` the body itself grasps. If it cannot be put down, or not be grasped otherwise, the failure goes
    outward: in the latter case the object stands where it was put. If it is not held as no hand is free for it, what
    one of them holds is put down instead; it is grasped again by the step that needs it next.
    """

    regrasping = Usage("put_down_and_regrasp", {"what": "bottle"}, {"again": "fetch_bottle"})
    regrasping.instance("what", what, Object, "an object")
    if again is not None:
        regrasping.branch("again", again)

    async def regrasp(failure: PlanFailure) -> RecoveryResult:
        full = next((link for link in failure.chain() if isinstance(link, HandsFull)), None)
        is_held = executive_for("put_down_and_regrasp").holds(Condition("holding", (what,)))
        if is_held == (full is not None):  # about something else, or no failure of a hand
            return PROPAGATE
        if full is not None:
            return await _one_put_down(full.held.values())
        try:
            await perform(action("SettingAsideAnObject", object_acted_on=what, by_another_grip=True))
            if again is not None:
                await called(again)
        except PlanFailure:
            return PROPAGATE
        return RETRY

    return regrasp


async def _one_put_down(held: Iterable[Object]) -> RecoveryResult:
    """Put one of these down, the first that can be: then a hand is free."""
    for one in held:
        with suppress(PlanFailure):
            await perform(action("SettingAsideAnObject", object_acted_on=one))
            return RETRY
    return PROPAGATE


@recovery_strategy("Ignore")
async def ignore(failure: PlanFailure) -> RecoveryResult:
    """Go on as if the body had succeeded, with None."""
    return Return(None)


async def _sees(what: Object) -> bool:
    with suppress(ObjectNotFound, LookingFailure):
        await _look_for(what)
        return True
    return False


async def _look_for(what: Object) -> None:
    await perform(action("LookingForSomething", object_acted_on=what))
