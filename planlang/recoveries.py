"""Recovery strategies: actions between a failure and the next attempt, registered by name.

Plans pass a strategy as ``do`` of a :class:`Recovery`. So does the compiler when a recovery of an ontology names the
strategy (``ontologies/recovery.omn``), which is why strategies are registered under the names used there. Add a
strategy to this file or, without a fork, in an installed package with an entry point of the group
``planlang.recoveries`` that names the function or its module. Trying the next base pose is not a strategy:
``at_location`` does that itself.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from contextlib import suppress
from functools import cache, partial, wraps
from importlib.metadata import entry_points
from typing import Any, TypeVar, cast

from planlang.designators import Action, Condition, Object, a_location, action
from planlang.failure_wording import NO_WAY
from planlang.failures import (
    AmbiguousPerception,
    AmountNotPoured,
    BehindClosedDoor,
    ContainerStuck,
    GraspSlipped,
    GripperGoalNotReached,
    HandleNotReachable,
    HandsFull,
    LocationUnresolvable,
    LookingFailure,
    LowLevelFailure,
    ManipulationGoalNotReached,
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
from planlang.language.performing import actions_around, perform
from planlang.language.recovery import PROPAGATE, RETRY, Do, Recovery, RecoveryResult, Return, retry
from planlang.language.remaining import remaining_actions
from planlang.language.resources import goes_first, hand_freed, lacks_hands
from planlang.language.set_aside import lost_from_hand, note_set_aside, times_set_aside
from planlang.language.tidying import passed
from planlang.misuse import Usage, written
from planlang.records import dataclass

GROUP = "planlang.recoveries"
"""Entry-point group of installed strategies."""
NOT_OPERATED = (ContainerStuck, HandleNotReachable, GraspSlipped, GripperGoalNotReached, ManipulationGoalNotReached)
"""Failures to open or close a door after which it may go from another place, once it was looked at."""
ASIDE = "SettingAsideAnObject"
"""Class of actions that put a held object down on whatever is near."""

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

    ``name``: its name in ontologies. ``function``: the ``do`` of a Recovery; with ``about_object`` plans call it with
    the object that the step handles; without a function the failure escalates at once. ``moves_base``: it drives away
    from the base pose of a location scope, so the Recovery has to surround the scope. ``goes_back``: the failure may
    arise later and undo the step's result, so the Recovery also surrounds the following steps, until the object is
    released; there the function also gets a branch that runs the step again. ``otherwise``: the failure raised after
    the last attempt, unless the Recovery names one.
    """

    name: str
    function: Callable[..., Any] | None
    about_object: bool = False
    moves_base: bool = False
    goes_back: bool = False
    otherwise: type[PlanFailure] | None = None

    @property
    def origin(self) -> tuple[str, str] | None:
        """Module and name from which plans import the function; None if a Recovery needs no function.

        A Recovery repeats the body without one, and escalates with zero attempts.
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

    The function is a ``do`` of :class:`Recovery`: an async function of the failure. With ``about_object`` it takes an
    object and returns such a function. ``moves_base``: it drives. ``goes_back``: it restores the result of the step
    whenever that is undone. Both need ``about_object``. ``otherwise`` is the failure that a Recovery raises after the
    last attempt if it names none: for strategies whose exhaustion means the same for every failure.
    Raises ValueError if the name is taken, or if plans cannot import the function.
    """
    _STRATEGY.text("name", name)
    if otherwise is not None and not (isinstance(otherwise, type) and issubclass(otherwise, PlanFailure)):
        raise _STRATEGY.wrong("otherwise", otherwise, "None or a failure class")
    for key, does in {"moves_base": "moves the base", "goes_back": "goes back"}.items():
        if {"moves_base": moves_base, "goes_back": goes_back}[key] and not about_object:
            raise _STRATEGY.refused(key, f"{name} {does}, so it has to be about an object", True)

    def register(function: F) -> F:
        name_in_module = getattr(function, "__qualname__", "")
        if not name_in_module.isidentifier():  # a lambda, a method, a nested function, or not a function
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
    """Attach the failure that a Recovery raises after the last attempt."""
    if not about_object:
        setattr(function, "otherwise", otherwise)  # noqa: B010 - mypy knows no attributes of functions
        return function

    @wraps(function)
    def strategy(*arguments: Any, **keywords: Any) -> Any:
        do = partial(function(*arguments, **keywords))
        vars(do)["otherwise"] = otherwise
        return do

    return cast(F, strategy)


def find_strategy(name: str) -> Strategy | None:
    """Look up a strategy by its name in ontologies, if necessary in installed packages; None if there is none.

    An exception from importing a package is passed on, with a note that names the entry point.
    """
    if name not in _registered:
        _load_installed()
    return _registered.get(name)


def registered_strategies() -> tuple[Strategy, ...]:
    """Return the strategies registered so far, in order of registration."""
    return tuple(_registered.values())


@cache
def _load_installed() -> None:
    for point in entry_points(group=GROUP):
        try:
            point.load()  # importing a module registers its strategies
        except Exception as error:
            error.add_note(f"while loading {point.value}, an entry point of the group {GROUP}")
            raise


@recovery_strategy("LookFromAnotherPlace", about_object=True, moves_base=True, otherwise=ObjectNowhereToBeFound)
def look_from_another_place(what: Object) -> Do:
    """Look for the object from here, then from a place where it should be visible; run the body again.

    If the object is seen from here, the base does not move. If it is not seen from the other place either, the body
    runs all the same and may fail. An object of unknown place is searched for wherever it is likely to be. Raises
    ObjectNowhereToBeFound if there is no other place to look from; a Recovery raises the same after its last attempt
    unless it names another failure.
    """

    Usage("look_from_another_place", {"what": "bottle"}).instance("what", what, Object, "an object")

    async def look(failure: PlanFailure) -> RecoveryResult:
        try:
            if any(isinstance(link, ObjectUnresolvable) for link in failure.chain()):
                await _look_for(what)
            elif not await _sees(what):
                with suppress(ObjectNotFound, AmbiguousPerception):
                    await at_location(a_location(visible_from=what), partial(_look_for, what))
        except (ObjectUnreachable, ObjectUndeliverable) as nowhere:
            raise ObjectNowhereToBeFound(what=str(what)) from nowhere
        return RETRY

    return look


@recovery_strategy("LookByMovingTheBase", about_object=True, moves_base=True)
def look_by_moving_the_base(what: Object) -> Do:
    """Look for the object once more; if the neck does not move, from where the camera sees it as it is pointed now.

    Likewise where its mark could not be read from here, by which it is told from others that look alike.
    Then the body runs again. The failure propagates if there is no such place, or if the object is not seen there.
    """

    Usage("look_by_moving_the_base", {"what": "bottle"}).instance("what", what, Object, "an object")

    async def look(failure: PlanFailure) -> RecoveryResult:
        if await _sees(what):
            return RETRY
        with suppress(ObjectUnreachable, ObjectUndeliverable, ObjectNotFound, AmbiguousPerception, LookingFailure):
            await at_location(a_location(visible_from=what), partial(_look_for, what))
            return RETRY
        return PROPAGATE

    return look


@recovery_strategy("PourTheRest")
async def pour_the_rest(failure: PlanFailure) -> RecoveryResult:
    """Run the body again if some, and too little, has been poured; otherwise the failure propagates."""
    short = next((link for link in failure.chain() if isinstance(link, AmountNotPoured)), None)
    if short is None or short.asked is None or not 0 < (short.poured or 0) < short.asked:
        return PROPAGATE
    return RETRY


@recovery_strategy("LookAndRepeat", about_object=True)
def look_and_repeat(what: Object) -> Do:
    """Look at the object from here, which may correct its believed pose, then run the body again."""

    Usage("look_and_repeat", {"what": "bottle"}).instance("what", what, Object, "an object")

    async def look(failure: PlanFailure) -> RecoveryResult:
        if not await _sees(what):
            await _look_for(what)
        return RETRY

    return look


@recovery_strategy("OpenWhatIsInTheWay", about_object=True, moves_base=True)
def open_what_is_in_the_way(what: Object) -> Do:
    """Open the closed door or drawer that hides the object, or the doors on the way to it, then run the body again.

    If the search for places has found that there is one once something else was done, such as closing a drawer that is
    open before it, or opening a door further, that is done first. If no hand is free to open it, one puts down what it
    holds, as :func:`put_down_first` does; if that is the object itself, on its way to where it is delivered, ObjectLost
    is raised, so that it is taken up again. A door between rooms that was shut is closed again: from its other side,
    before the body runs again, if no later step leads back through it, else when the plan has succeeded; the run says
    which stay open. Those of furniture stay open. A failure with another reason propagates.
    """

    Usage("open_what_is_in_the_way", {"what": "bottle"}).instance("what", what, Object, "an object")
    opening = _opening(())

    async def open_it(failure: PlanFailure) -> RecoveryResult:
        before = times_set_aside()
        result = await opening(failure)
        if result is RETRY and isinstance(failure, ObjectUndeliverable) and times_set_aside() > before:
            lost = lost_from_hand(what, executive_for("open_what_is_in_the_way"))
            if lost is not None:
                raise lost
        return result

    return open_it


def _opening(begun: tuple[Object, ...]) -> Do:
    """Make the strategy that opens what is in the way, while the doors that were ``begun`` wait to be opened."""

    async def open_it(failure: PlanFailure) -> RecoveryResult:
        closed = next((link for link in failure.chain() if isinstance(link, BehindClosedDoor)), None)
        if closed is None or closed.door is None:
            return await _made_way(failure)
        doors = (closed.door, *closed.further)
        if any(door in begun for door in doors):  # each is behind the other
            return PROPAGATE
        for door in doors:
            freed = Recovery(HandsFull, put_down_first(door), retries=AGAIN)
            again = Recovery(NOT_OPERATED, step_back_and_repeat(door), retries=AGAIN)
            # furniture may stand behind doors between rooms, which the search for its handle names
            before = Recovery(BehindClosedDoor, _opening((*begun, door)))
            opening = action("OpeningAContainerArtifact", object_acted_on=door)
            await perform(opening, recoveries=[freed, again, before])
            if (beyond := dict(closed.beyond).get(door)) is not None:
                await passed(door, beyond)
        return RETRY

    return open_it


@recovery_strategy("PutDownFirst", about_object=True, moves_base=True)
def put_down_first(what: Object) -> Do:
    """Put down what a hand holds where no hand is free to work on the object, then run the body again.

    Of several things it is the one that this step and the remaining ones need last, or else the one that has been held
    for longest. It is put where it is in no way of the object, and of the doors and drawers that later steps move; the
    step that needs it next takes it up again: by itself, or, if it delivers it from the hand, by the recovery from
    ObjectLost, with which it fails. Another failure propagates.
    """

    Usage("put_down_first", {"what": "door"}).instance("what", what, Object, "an object")

    async def put_down(failure: PlanFailure) -> RecoveryResult:
        full = next((link for link in failure.chain() if isinstance(link, HandsFull)), None)
        if full is None:
            return PROPAGATE
        order, needed = tuple(executive_for("put_down_first").held()), _need()
        never = len(needed)

        def rank(one: Object) -> tuple[int, int]:
            held = order.index(one.name) if one.name in order else len(order)
            return -needed.get(one.name, never), held

        first = sorted(dict.fromkeys(full.held.values()), key=rank)
        return await _one_set_aside(action(ASIDE, object_acted_on=one, out_of_the_way_of=what) for one in first)

    return put_down


def _need() -> dict[str, int]:
    """Number the things that the steps in progress and the remaining ones handle by when they do so first."""
    handled = (one.get("object_acted_on") for one in (*actions_around(), *remaining_actions()))
    names = dict.fromkeys(one.name for one in handled if isinstance(one, Object))
    return {name: number for number, name in enumerate(names)}


async def _made_way(failure: PlanFailure) -> RecoveryResult:
    """Do what makes a place for the location that had none, as the search for it has found, if it has."""
    unresolved = (link for link in failure.chain() if isinstance(link, LocationUnresolvable))
    first = next((link.first for link in unresolved if link.first is not None), None)
    if first is None:
        return PROPAGATE
    with suppress(PlanFailure):
        await perform(first)
        return RETRY
    return PROPAGATE


@recovery_strategy("StepBackAndRepeat", about_object=True, moves_base=True)
def step_back_and_repeat(what: Object) -> Do:
    """Drive one step back with the arms in their driving posture, look at the object, then run the body again.

    Where the search has found that something else makes a way, such as closing a drawer beside, that is done instead.
    Touches and sightings on the way change the next plan: how far a door has opened, what blocks it. If a search fails
    twice with the same result, nothing has changed, and the failure propagates.
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
        if await _made_way(failure) == RETRY:
            return RETRY
        with suppress(LowLevelFailure):  # without room to step back the body may still succeed
            await perform(action("SteppingBack"))
        await _sees(what)
        return RETRY

    return step_back


@recovery_strategy("FetchAgain", about_object=True, moves_base=True, goes_back=True, otherwise=ObjectUnfetchable)
def fetch_again(what: Object, again: Branch | None = None) -> Do:
    """Find an object that has left the hand, grasp it with the branch ``again``, then run the body again.

    It was lost, or set aside on the way. Without ``again`` the body itself grasps. The robot looks from here first,
    since the object may lie beside the hand, then from another place with the arms in their driving posture. If the
    object is still held, the failure is about something else and propagates. After the last attempt a Recovery raises
    ObjectUnfetchable unless it names another failure.
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
    """Put the held object down nearby, grasp it differently with the branch ``again``, then run the body again.

    Without ``again`` the body itself grasps. If the object cannot be put down, or not grasped differently, the failure
    propagates; in the latter case the object stays where it was put. A concurrent step that waits with an object in its
    hand goes on before it is grasped again: with one hand empty there may be a way. If the failure is that no hand is
    free, that step goes on, or else the robot puts down what a hand holds; the step that needs that object next grasps
    it again. If something stands in the only way of the base, no other grip helps, and the failure propagates.
    """

    regrasping = Usage("put_down_and_regrasp", {"what": "bottle"}, {"again": "fetch_bottle"})
    regrasping.instance("what", what, Object, "an object")
    if again is not None:
        regrasping.branch("again", again)

    async def regrasp(failure: PlanFailure) -> RecoveryResult:
        other_waits = goes_first()  # with an object in the hand that this step may have needed
        if other_waits and lacks_hands(failure):
            return PROPAGATE  # to the step that is repeated once the other has gone on
        full = next((link for link in failure.chain() if isinstance(link, HandsFull)), None)
        is_held = executive_for("put_down_and_regrasp").holds(Condition("holding", (what,)))
        if is_held == (full is not None):  # the failure is about something else
            return PROPAGATE
        if not other_waits and any(map(_is_shut_off, failure.chain())):
            return PROPAGATE
        if full is not None:
            return await _one_set_aside(action(ASIDE, object_acted_on=one) for one in dict.fromkeys(full.held.values()))
        putting = action(ASIDE, object_acted_on=what)
        try:
            await perform(putting if other_waits else action(ASIDE, object_acted_on=what, for_another_grip=True))
            if other_waits:
                await hand_freed(failure, anyway=True)
            if again is not None:
                await called(again)
        except PlanFailure:
            return PROPAGATE
        return RETRY

    return regrasp


def _is_shut_off(link: BaseException) -> bool:
    """Check whether a search found floor for the base, but no way there because of a body that is named."""
    return isinstance(link, LocationUnresolvable) and {*link.counts} == {NO_WAY} and bool(link.changes)


async def _one_set_aside(actions: Iterable[Action]) -> RecoveryResult:
    """Perform the first that succeeds of some actions that set things aside."""
    for one in actions:
        with suppress(PlanFailure):
            await perform(one)
            note_set_aside()
            return RETRY
    return PROPAGATE


@recovery_strategy("Ignore")
async def ignore(failure: PlanFailure) -> RecoveryResult:
    """Continue as if the body had returned None."""
    return Return(None)


async def _sees(what: Object) -> bool:
    with suppress(ObjectNotFound, AmbiguousPerception, LookingFailure):
        await _look_for(what)
        return True
    return False


async def _look_for(what: Object) -> None:
    await perform(action("LookingForSomething", object_acted_on=what))
