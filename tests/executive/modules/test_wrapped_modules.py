"""Every wrapper around a process module forwards the whole protocol of modules."""

from __future__ import annotations

import inspect
import sys
from collections.abc import Callable, Iterator
from typing import Any
from unittest.mock import MagicMock, Mock

import pytest

import executive.runs.assembly  # noqa: F401 - imports every wrapper
from executive.modules.around_actions import RobotModule
from executive.modules.effects import ActionEffects
from planlang import VirtualHost, action, run
from planlang.designators import Action
from planlang.failures import GraspMissed
from planlang.language.process_module import ModuleOnce, ProcessModule, RecordedModule, WrappedModule
from planlang.registry import OnDemand, _Demanded


class Unusual:
    """A module that says something else than the default of each member."""

    name = "unusual"
    actions = ("Icing",)
    failures = (GraspMissed,)
    once = True

    def __init__(self, platform: object = None) -> None:
        pass

    def performs(self, action: Action) -> bool:
        return action.get("device_used") == "left"

    def resources(self, action: Action) -> tuple[str, ...]:
        return (f"{action.get('device_used')} hand",)

    async def execute(self, action: Action) -> str:
        return f"iced with the {action.get('device_used')} hand"


class Answers:
    """Answers that are asked for and not kept."""

    def answer(self, question: str, find: Callable[[], Any]) -> Any:
        return find()


def on_demand(module: Unusual) -> WrappedModule:
    sys.modules["unusual"] = sys.modules[__name__]
    stated = OnDemand(
        "unusual:Unusual", module.name, module.actions, module.failures, lambda platform, asked: module.performs(asked)
    )
    return _Demanded(stated, None)


def of_robot(module: Unusual) -> WrappedModule:
    effects, platform = Mock(ActionEffects), MagicMock()
    effects.due.return_value = effects.lying.return_value = None
    effects.begins.return_value.missed = []
    platform.belief.memory.unknown = ()
    return RobotModule(module, platform, effects, frozenset())


MADE: dict[type[WrappedModule], Callable[[Unusual], WrappedModule]] = {
    WrappedModule: WrappedModule,
    ModuleOnce: ModuleOnce,
    RecordedModule: lambda module: RecordedModule(module, Answers()),  # type: ignore[arg-type]
    RobotModule: of_robot,
    _Demanded: on_demand,
}


def wrappers(cls: type[WrappedModule] = WrappedModule) -> Iterator[type[WrappedModule]]:
    yield cls
    for below in cls.__subclasses__():
        yield from wrappers(below)


def said(module: Any, member: str) -> Any:
    """Return what a module says and does, by a member of the protocol."""
    what = getattr(module, member)
    if not callable(what):
        return what
    answers = [what(action("Icing", device_used=hand)) for hand in ("left", "right")]
    return [run(lambda one=one: one, host=VirtualHost()) if inspect.iscoroutine(one) else one for one in answers]


MEMBERS = [name for name in vars(ProcessModule) if not name.startswith("_")]


@pytest.mark.parametrize("wrapper", list(wrappers()), ids=lambda one: one.__name__)
@pytest.mark.parametrize("member", MEMBERS)
def test_every_wrapper_forwards_every_member_of_the_protocol(wrapper: type[WrappedModule], member: str) -> None:
    forwarded, own = said(MADE[wrapper](Unusual()), member), said(Unusual(), member)
    if member == "failures":  # a wrapper may add failures of its own
        forwarded = forwarded[: len(own)]
    assert forwarded == own


def test_wrappers_of_wrappers_forward_what_the_innermost_module_says() -> None:
    wrapped: Any = Unusual()
    for make in reversed(MADE.values()):  # the module on demand is the innermost
        wrapped = make(wrapped)
    assert {name: said(wrapped, name) for name in ("once", "performs", "resources")} == {
        "once": True,
        "performs": [True, False],
        "resources": [("left hand",), ("right hand",)],
    }


def test_what_a_module_leaves_out_is_as_its_protocol_says_behind_every_wrapper() -> None:
    class Plain:
        name, actions, failures = "plain", ("Icing",), ()

    for make in (MADE[WrappedModule], MADE[RecordedModule], MADE[RobotModule]):
        wrapped = make(Plain())  # type: ignore[arg-type]
        assert (wrapped.once, wrapped.performs(action("Icing"))) == (False, True)
