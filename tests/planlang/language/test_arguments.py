"""Every parameter of every public name refuses what makes no sense, with the wrong and the right code."""

from __future__ import annotations

import gc
import inspect
import math
import warnings
from collections.abc import Callable
from enum import Enum
from functools import partial
from typing import Any, get_origin

import pytest

import planlang
from planlang import *
from planlang.failures import GraspMissed

CUP = an_object("Cup")
NEAR = a_location(near=CUP)
RIM = a_feature("LINE", of=CUP, position=(0.0, 0.0, 0.1), direction=(0.0, 0.0, 1.0))


async def works() -> str:
    return "done"


async def fails() -> None:
    raise GraspMissed


class Something:
    """A class where an instance is meant."""


def coroutine() -> Any:
    return works()


def hashed(key: object) -> object:
    return tuple(key) if isinstance(key, list) else key


def written_to(path: Any) -> None:
    with Trace.at(path):
        pass


WRONG: dict[str, Callable[[], Any]] = {
    "None": lambda: None,
    "text": lambda: "x",
    "empty text": lambda: "",
    "number": lambda: 7,
    "negative": lambda: -1,
    "fraction": lambda: 1.5,
    "bool": lambda: True,
    "nan": lambda: math.nan,
    "inf": lambda: math.inf,
    "lambda": lambda: lambda: 3,
    "coroutine": coroutine,
    "async function": lambda: works,
    "class": lambda: Something,
    "instance": Something,
    "list": list,
}
NUMBERS = {"number", "fraction"}
COUNT = {"number"}
OPTIONAL = {"None"}
TEXT = {"text"}
BRANCH = {"async function"}
ITERABLE = {"list"}
WORDS = {"text", "empty text"}
FILLERS = {"text", "empty text", "number", "negative", "fraction", "bool", "nan", "inf"}

# name, what is called with the wrong argument, which of the wrong ones make sense there after all
Case = tuple[str, Callable[[Any], Any], set[str]]
INSIDE: list[Case] = [
    ("sleep", sleep, NUMBERS),
    ("wait_for", wait_for, set()),
    ("wait_for timeout", lambda x: wait_for(Fluent(True), x), NUMBERS | OPTIONAL),
    ("in_thread", in_thread, {"lambda", "class", "async function"}),
    ("in_thread takes", lambda x: in_thread(int, takes=x), NUMBERS),
    ("shield", lambda x: entered(shield(x)), NUMBERS),
    ("timeout seconds", lambda x: timeout(x, works), NUMBERS),
    *((f"{c.__name__}", c, BRANCH) for c in (par, pursue, race, seq, try_all, try_in_order)),
    *((f"{c.__name__} named", lambda x, c=c: c(reach=x), BRANCH) for c in (par, seq, try_all)),
    *((f"{c.__name__} name", lambda x, c=c: c(works, name=x), OPTIONAL | TEXT) for c in (par, seq, pursue)),
    ("timeout body", lambda x: timeout(1, x), BRANCH),
    ("par_each values", lambda x: par_each(x, works), ITERABLE),
    ("par_each body", lambda x: par_each([], x), BRANCH | {"lambda"}),
    ("par_each limit", lambda x: par_each([], works, x), OPTIONAL | COUNT),
    ("try_each_in_order values", lambda x: try_each_in_order(x, works), {"list"}),
    ("try_each_in_order body", lambda x: try_each_in_order([1], x), set()),
    ("unwind_protect body", lambda x: unwind_protect(x, works), BRANCH),
    ("unwind_protect cleanup", lambda x: unwind_protect(works, x), BRANCH),
    ("unwind_protect within", lambda x: unwind_protect(works, works, within=x), NUMBERS),
    ("budget body", budget, BRANCH),
    ("budget seconds", lambda x: budget(works, x), NUMBERS | OPTIONAL),
    ("budget attempts", lambda x: budget(works, attempts=x), COUNT | OPTIONAL),
    ("achieve goal", lambda x: achieve(x, works), {"lambda", "class"}),
    ("achieve body", lambda x: achieve(Fluent(read=iter([False, True]).__next__), x), BRANCH),
    ("achieve within", lambda x: achieve(Fluent(True), works, within=x), NUMBERS),
    ("achieve recovery", lambda x: achieve(Fluent(True), works, x), set()),
    ("state_machine states", lambda x: state_machine(x, {}, "a", "a"), set()),
    ("state_machine state", lambda x: state_machine({"a": x}, {}, "a", "a"), BRANCH),
    ("state_machine transitions", lambda x: state_machine({"a": works}, x, "a", "a"), set()),
    ("state_machine transition", lambda x: state_machine({"a": works, "b": works}, {hashed(x): "b"}, "a", "b"), set()),
    ("state_machine case", lambda x: state_machine({"a": works, "b": works}, {("a", hashed(x)): "b"}, "a", "b"), WORDS),
    ("state_machine target", lambda x: state_machine({"a": works, "b": works}, {("a", "c"): x}, "a", "b"), set()),
    ("state_machine start", lambda x: state_machine({"a": works}, {}, x, "a"), set()),
    ("state_machine end", lambda x: state_machine({"a": works}, {}, "a", x), set()),
    ("state_machine max_visits", lambda x: state_machine({"a": works}, {}, "a", "a", x), COUNT | OPTIONAL),
    ("state_machine name", lambda x: state_machine({"a": works}, {}, "a", "a", name=x), TEXT | OPTIONAL),
    ("partial_order steps", lambda x: partial_order(x, []), set()),
    ("partial_order step", lambda x: partial_order({"a": x}, []), BRANCH),
    ("partial_order orderings", lambda x: partial_order({}, x), ITERABLE),
    ("partial_order ordering", lambda x: partial_order({"a": works}, [x]), set()),
    ("partial_order before", lambda x: partial_order({"a": works}, [("a", x)]), set()),
    ("partial_order limit", lambda x: partial_order({}, [], x), COUNT | OPTIONAL),
    ("partial_order name", lambda x: partial_order({}, [], name=x), TEXT | OPTIONAL),
    ("perform", perform, set()),
    ("perform name", lambda x: perform(action("Reaching"), x, otherwise=works), TEXT | OPTIONAL),
    ("perform otherwise", lambda x: perform(action("Reaching"), otherwise=x), BRANCH | OPTIONAL),
    ("perform until", lambda x: perform(action("Reaching"), otherwise=works, until=x), OPTIONAL | {"lambda", "class"}),
    ("perform recoveries", lambda x: perform(action("Reaching"), otherwise=works, recoveries=x), ITERABLE),
    ("perform recovery", lambda x: perform(action("Reaching"), otherwise=works, recoveries=[x]), set()),
    ("perform_async", lambda x: with_requests(partial(perform_async, x)), set()),
    ("monitor", monitor, set()),
    ("with_requests", with_requests, BRANCH),
    ("with_policies policies", lambda x: with_policies(x, works), ITERABLE),
    ("with_policies policy", lambda x: with_policies([x], works), set()),
    ("with_policies body", lambda x: with_policies([], x), BRANCH),
    *((f"policy {p}", lambda x, p=p: with_policies([Policy("a", **{p: x})], works), BRANCH | OPTIONAL)
      for p in ("init", "clean_up")),
    ("policy recover", lambda x: with_policies([Policy("a", recover=x)], works), BRANCH | OPTIONAL | {"lambda"}),
    ("policy check", lambda x: with_policies([Policy("a", x)], works), OPTIONAL),
    ("with_failure_handling body", with_failure_handling, BRANCH),
    ("with_failure_handling recovery", lambda x: with_failure_handling(works, x), set()),
    ("recovery do", lambda x: with_failure_handling(fails, Recovery(PlanFailure, x)), set()),
    ("recovery otherwise", lambda x: with_failure_handling(fails, Recovery(PlanFailure, retries=0, otherwise=x)),
     {"None"}),
    ("recovery alternatives", lambda x: with_failure_handling(works, Recovery(PlanFailure, alternatives=x)), OPTIONAL),
    ("recovery alternative", lambda x: with_failure_handling(works, Recovery(PlanFailure, alternatives={"g": x})),
     set()),
    ("at_location location", lambda x: at_location(x, works), set()),
    ("at_location attempts", lambda x: at_location(NEAR, works, attempts=x), COUNT),
    ("at_location reaching", lambda x: at_location(NEAR, works, reaching=x), ITERABLE),
    ("at_location reaching one", lambda x: at_location(NEAR, works, reaching=[x]), set()),
    ("at_location device", lambda x: at_location(NEAR, works, device=x), OPTIONAL),
    ("at_location by", lambda x: at_location(NEAR, works, by=x), TEXT | OPTIONAL),
    ("at_location recovery", lambda x: at_location(NEAR, works, x), set()),
    ("holds", lambda x: at_once(holds, x), set()),
    ("holds of", lambda x: at_once(partial(holds, NEAR), x), OPTIONAL),
    ("using", lambda x: entered(using(x)), TEXT),
    ("retry_after_suspension", retry_after_suspension, BRANCH),
    ("tag name", lambda x: tag(x, works), TEXT),
    ("tag body", lambda x: tag("a", x), BRANCH),
    ("task", lambda x: at_once(task, x), TEXT),
    ("join", join, set()),
    *((f"{f.__name__}", lambda x, f=f: at_once(f, x), set()) for f in (suspend, wake_up, evaporate)),
    ("task_suspended", lambda x: entered(task_suspended(x)), set()),
    ("on_suspension", lambda x: entered(on_suspension(x)), {"lambda", "class"}),
    ("whenever signal", lambda x: whenever(x, works), set()),
    ("whenever body", lambda x: timeout(1, partial(whenever, Fluent(True), x)), {"async function"}),
]  # fmt: skip

OUTSIDE: list[Case] = [
    ("run plan", lambda x: run(x, host=VirtualHost()), BRANCH),
    ("run host", lambda x: run(works, host=x), set()),
    ("run executive", lambda x: run(works, host=VirtualHost(), executive=x), OPTIONAL),
    ("run seed", lambda x: run(works, host=VirtualHost(), seed=x), COUNT | {"negative"}),
    ("run schedule", lambda x: run(works, host=VirtualHost(), schedule=x), COUNT | OPTIONAL | {"list"}),
    ("run choice", lambda x: run(works, host=VirtualHost(), schedule=[x]), COUNT),
    ("run trace", lambda x: run(works, host=VirtualHost(), trace=x), OPTIONAL),
    ("run max_steps", lambda x: run(works, host=VirtualHost(), max_steps=x), COUNT | OPTIONAL),
    ("run on_start", lambda x: run(works, host=VirtualHost(), on_start=x), OPTIONAL),
    ("run resume", lambda x: run(works, host=VirtualHost(), resume=x), OPTIONAL),
    ("run resumable", lambda x: run(works, host=VirtualHost(), resumable=x), {"bool"}),
    ("plan", plan, {"async function", "None", "text"}),
    ("Plan iri", lambda x: planlang.Plan(works, x), TEXT | OPTIONAL),
    ("Policy name", lambda x: Policy(x, None), TEXT),
    ("Recovery on", lambda x: Recovery(x), set()),
    ("Recovery on one", lambda x: Recovery((x,)), set()),
    ("Recovery attempts", lambda x: Recovery(PlanFailure, retries=x), COUNT),
    ("Recovery within", lambda x: Recovery(PlanFailure, within=x), NUMBERS | OPTIONAL),
    ("VirtualHost rate", VirtualHost, COUNT),
    ("VirtualHost watchdog", lambda x: VirtualHost(watchdog=x), NUMBERS | OPTIONAL),
    ("RealTimeHost rate", RealTimeHost, COUNT),
    ("RealTimeHost clock", lambda x: RealTimeHost(clock=x), {"lambda", "class"}),
    ("RealTimeHost sleep", lambda x: RealTimeHost(sleep=x), {"lambda", "class", "None"}),
    ("RealTimeHost watchdog", lambda x: RealTimeHost(watchdog=x), NUMBERS | OPTIONAL),
    ("SimulationHost", SimulationHost, set()),
    ("Fluent name", lambda x: Fluent(1, x), TEXT | OPTIONAL | {"empty text"}),
    ("Fluent read", lambda x: Fluent(read=x), {"lambda", "class", "None"}),
    ("pulsed", lambda x: Fluent(1).pulsed(x), set()),
    ("Trace out", Trace, OPTIONAL | {"list"}),
    ("Trace header", lambda x: Trace(None, x), OPTIONAL),
    ("Trace.at path", written_to, {"text"}),
    ("TaskTree.of", TaskTree.of, {"list"}),
    ("TaskTree.read", TaskTree.read, TEXT),
    ("Handle", Handle, TEXT),
    ("Request", lambda x: Request(x, None), set()),
    ("explain", explain, set()),
    ("recovery_strategy", recovery_strategy, TEXT),
    ("look_and_repeat", look_and_repeat, set()),
    ("look_from_another_place", look_from_another_place, set()),
    ("open_what_is_in_the_way", open_what_is_in_the_way, set()),
    ("fetch_again", fetch_again, set()),
    ("look_by_moving_the_base", look_by_moving_the_base, set()),
    ("step_back_and_repeat", step_back_and_repeat, set()),
    ("put_down_and_regrasp", put_down_and_regrasp, set()),
    ("put_down_first", put_down_first, set()),
    ("put_down_and_regrasp again", lambda x: put_down_and_regrasp(CUP, x), BRANCH | OPTIONAL | {"lambda"}),
    ("fetch_again again", lambda x: fetch_again(CUP, x), BRANCH | OPTIONAL | {"lambda"}),
    *((f"{f.__name__}", f, TEXT) for f in (an_object, a_person, a_device, Object, Person, Device)),
    *((f"{f.__name__} iri", lambda x, f=f: f("Cup", x), TEXT | OPTIONAL) for f in (an_object, a_person, a_device)),
    ("Relation name", lambda x: Relation(x, (CUP,)), set()),
    ("Relation references", lambda x: Relation("near", x), set()),
    ("Relation within", lambda x: Relation("near", (CUP,), within=x), NUMBERS | OPTIONAL),
    ("Location relations", Location, set()),
    ("Location name", lambda x: Location((), x), TEXT | OPTIONAL),
    ("Location device", lambda x: Location((), "a", x), OPTIONAL),
    ("Location grasp", lambda x: Location((), "a", None, x), OPTIONAL),
    ("Location and", lambda x: NEAR & x, set()),
    ("Posture", lambda x: Posture((), x), TEXT | OPTIONAL),
    ("a_posture", a_posture, TEXT),
    ("a_location relation", lambda x: a_location(near=x), set()),
    ("a_location relations", lambda x: a_location(near=[x]), set()),
    ("a_location name", lambda x: a_location(x, near=CUP), TEXT | OPTIONAL),
    ("a_location using", lambda x: a_location(in_reach_of=CUP, using=x), OPTIONAL),
    ("a_location grasp", lambda x: a_location(in_reach_of=CUP, grasp=x), OPTIONAL),
    ("a_location within", lambda x: a_location(near=CUP, within=x), NUMBERS | OPTIONAL),
    ("a_location not_", lambda x: a_location(near=CUP, not_=x), {"list"}),
    ("a_location not_ one", lambda x: a_location(near=CUP, not_=[x]), set()),
    ("action", action, TEXT),
    ("action_class", lambda x: action_class(x, below="Reaching"), TEXT),
    ("action_class below", lambda x: action_class("Sweeping", below=x), TEXT),
    ("action below", lambda x: action("Sweeping", below=x), TEXT | OPTIONAL),
    ("action name", lambda x: action("Reaching", name=x), TEXT | OPTIONAL),
    ("action filler", lambda x: action("Reaching", of=x), FILLERS),
    ("Action properties", lambda x: Action("Reaching", x), set()),
    ("a_situation", a_situation, TEXT),
    ("Situation properties", lambda x: Situation("Open", x), set()),
    ("Condition predicate", lambda x: Condition(x, ()), TEXT),
    ("Condition arguments", lambda x: Condition("holding", x), set()),
    ("a_feature kind", lambda x: a_feature(x, of=CUP), OPTIONAL),
    ("a_feature of", lambda x: a_feature(of=x), set()),
    ("a_feature position", lambda x: a_feature("POINT", of=CUP, position=x), set()),
    ("a_feature direction", lambda x: a_feature("LINE", of=CUP, position=(0, 0, 0), direction=x), set()),
    ("a_feature path", lambda x: a_feature(of=CUP, path=x), {"list"}),
    ("a_feature held_by", lambda x: a_feature(of=CUP, held_by=x), OPTIONAL),
    ("a_feature name", lambda x: a_feature(of=CUP, name=x), TEXT | OPTIONAL),
    ("a_constraint kind", lambda x: a_constraint(x, RIM, RIM), set()),
    ("a_constraint tool", lambda x: a_constraint("HEIGHT", x, RIM), set()),
    ("a_constraint world", lambda x: a_constraint("HEIGHT", RIM, x), set()),
    ("a_constraint lower", lambda x: a_constraint("HEIGHT", RIM, RIM, lower=x), NUMBERS | OPTIONAL | {"negative"}),
    ("a_constraint upper", lambda x: a_constraint("HEIGHT", RIM, RIM, upper=x), NUMBERS | OPTIONAL | {"negative"}),
    ("a_constraint weight", lambda x: a_constraint("HEIGHT", RIM, RIM, weight=x), NUMBERS),
    ("a_constraint speed", lambda x: a_constraint("HEIGHT", RIM, RIM, speed=x), OPTIONAL),
    ("a_constraint frame", lambda x: a_constraint("HEIGHT", RIM, RIM, frame=x), TEXT | OPTIONAL),
    ("a_constraint name", lambda x: a_constraint("HEIGHT", RIM, RIM, name=x), TEXT | OPTIONAL),
    ("holding", holding, set()),
    ("contains", lambda x: contains(x, CUP), set()),
    ("contains substance", lambda x: contains(CUP, x), set()),
    ("contains at_least", lambda x: contains(CUP, CUP, x), NUMBERS | OPTIONAL),
    ("baked", baked, set()),
    ("baked seconds", lambda x: baked(CUP, x), NUMBERS | OPTIONAL),
    *((f"{f.__name__}", f, set()) for f in (switched_on, destroyed, created)),
    ("transformed_into", lambda x: transformed_into(x, CUP), set()),
    ("transformed_into result", lambda x: transformed_into(CUP, x), set()),
    ("located", located, set()),
    ("located what", lambda x: located(NEAR, x), OPTIONAL),
]  # fmt: skip


ANYTHING = {
    "Return",
    "given",
    "retry",
    "ignore",
    "pour_the_rest",
    "PlanFailure",
    "TaskNode",
    "Signal",
    "Feature",
    "MotionConstraint",
    "process_module",
    "sweep",
}
"""What takes whatever there is, is called or made by the language only, or judges itself what it is given."""


def test_the_table_has_all_public_names_that_take_arguments() -> None:
    def takes_arguments(name: str) -> bool:
        thing = getattr(planlang, name)
        if isinstance(thing, type) and (
            issubclass(thing, BaseException | Enum) or getattr(thing, "_is_protocol", False)
        ):
            return False
        return callable(thing) and get_origin(thing) is None and bool(inspect.signature(thing).parameters)

    listed = {name.split(" ")[0].split(".")[0] for name, _, _ in (*INSIDE, *OUTSIDE)}
    listed = {name.capitalize() if name in ("policy", "recovery") else name for name in listed}
    assert {name for name in planlang.__all__ if takes_arguments(name)} - listed - ANYTHING == set()
    assert listed - {*planlang.__all__, "pulsed"} == set()


async def entered(manager: Any) -> None:
    if hasattr(manager, "__aenter__"):
        async with manager:
            pass
    else:
        with manager:
            pass


async def at_once(function: Callable[[Any], object], argument: Any) -> None:
    function(argument)


def complaint(use: Callable[[Any], Any], make: Callable[[], Any], inside: bool, executive: Any) -> BaseException | None:
    """Return what is raised when something is used wrongly, None if nothing is."""
    try:
        if inside:
            argument = make()
            run(lambda: use(argument), host=VirtualHost(), executive=executive)
        else:
            use(make())
    except BaseException as error:
        return error
    return None


@pytest.mark.parametrize(
    ("use", "sensible", "inside"),
    [
        pytest.param(use, sensible, group is INSIDE, id=name)
        for group in (INSIDE, OUTSIDE)
        for name, use, sensible in group
    ],
)
def test_every_parameter_refuses_what_makes_no_sense_with_wrong_and_right_code(
    use: Callable[[Any], Any], sensible: set[str], inside: bool, executive: Any, tmp_path: Any, monkeypatch: Any
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "x").write_text('{"step": 0, "event": "header", "schema": 5, "rate": 240}\n')
    problems: list[str] = []
    with warnings.catch_warnings(record=True) as warned:
        warnings.simplefilter("always")
        for name, make in WRONG.items():
            error = complaint(use, make, inside, executive)
            if name in sensible:
                if error is not None and not isinstance(error, PlanFailure):
                    problems.append(f"{name} makes sense, but: {error!r}")
            elif not isinstance(error, PlanStructureError):
                problems.append(f"{name}: {error!r}")
            elif "\n  wrong: " not in str(error) or "\n  right: " not in str(error):
                problems.append(f"{name} without code: {error}")
            del error
        gc.collect(1)  # errors and their frames refer to each other
    problems += [str(one.message) for one in warned]
    assert not problems, "\n".join(problems)


async def wants(cup: str) -> str:
    return cup


@plan
async def serves(cup: str) -> str:
    return cup


async def answers() -> bool:
    return True


@pytest.mark.parametrize(
    ("use", "wrong"),
    [
        (lambda: partial_order({"a": works, "b": works}, ["ab"]), "['ab']"),
        (lambda: partial_order({"a": works}, [("a", "b")]), "[('a', 'b')]"),
        (lambda: at_once(Recovery, ()), "Recovery((), look_again)"),
        (lambda: with_failure_handling(works, Recovery(GraspMissed, alternatives={1: list})), "{1: list}"),
        (lambda: with_failure_handling(fails, Recovery(GraspMissed, otherwise=lambda failure: 5)), "lambda failure"),
        (lambda: with_failure_handling(fails, Recovery(GraspMissed, lambda failure: 5)), "GraspMissed, lambda"),
        (lambda: with_failure_handling(works, Recovery(GraspMissed, alternatives={"g": ["top"]})), "{'g': ['top']}"),
        (lambda: with_failure_handling(works, Recovery(GraspMissed, alternatives={"grasp": lambda: 5})), "lambda: ..."),
        (lambda: achieve(lambda: answers(), works), "lambda: ..."),
        (lambda: with_policies([Policy("a", lambda: answers())], works), "lambda: ..."),
        (lambda: par(wants), "wants"),
        (lambda: seq(wants), "wants"),
        (lambda: par(serves), "serves"),
    ],
)  # fmt: skip
def test_what_shows_only_when_it_is_called_or_looked_into_is_refused_too(use: Callable[[], Any], wrong: str) -> None:
    with pytest.raises(PlanStructureError) as caught:
        run(use, host=VirtualHost())
    assert wrong.replace("'", '"') in str(caught.value).replace("'", '"')
    assert "\n  right: " in str(caught.value)


def test_a_function_that_is_not_async_is_no_plan() -> None:
    def serve() -> None:
        pass

    with pytest.raises(
        PlanStructureError, match=r"wrong: @plan def serve\(\): (.|\n)*right: @plan async def serve\(\)"
    ):
        plan(serve)


def test_a_type_error_that_a_branch_raises_itself_stays_as_it_is() -> None:
    def breaks() -> Any:
        return len(7)

    for construct in (par, seq):
        with pytest.raises(TypeError, match="has no len") as caught:
            run(partial(construct, breaks), host=VirtualHost())
        assert not isinstance(caught.value, PlanStructureError)
