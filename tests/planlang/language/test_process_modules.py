"""Classes that are marked as process modules, and modules that say what they are asked for."""

from __future__ import annotations

from typing import Any

import pytest

from planlang import Action, PlanFailure, VirtualHost, action, process_module, run
from planlang.language.process_module import ModuleOnce, is_marked, stated_as_before


class Stirring:
    """Stirs."""

    name, actions, failures, once = "stirring", ("Stirring",), (PlanFailure,), True

    def resources(self, what: Action) -> tuple[str, ...]:
        """It needs nothing."""
        return ()

    async def execute(self, what: Action) -> str:
        """Stir at once."""
        return "stirred"


def test_a_marked_class_is_a_module_and_one_that_derives_from_it_is_none_by_itself() -> None:
    marked = process_module(type("Marked", (Stirring,), {}))
    assert is_marked(marked)
    assert not is_marked(type("Below", (marked,), {}))
    assert not is_marked("Stirring")


@pytest.mark.parametrize(
    ("stated", "message"),
    [
        ({"actions": "Stirring"}, "actions of Odd has to be a tuple"),
        ({"actions": ()}, "actions of Odd has to be a tuple"),
        ({"failures": (3,)}, "failures of Odd has to be a tuple"),
    ],
)
def test_what_cannot_be_a_module_is_refused_with_what_is_wrong(stated: dict[str, Any], message: str) -> None:
    with pytest.raises(TypeError, match=message):
        process_module(type("Odd", (Stirring,), stated))


def test_what_a_module_lacks_is_named() -> None:
    with pytest.raises(TypeError, match="process module Nothing lacks name, actions, failures, resources, execute"):
        process_module(type("Nothing", (), {}))


@pytest.mark.parametrize("once", [True, False])
def test_a_module_that_works_once_works_as_others_do_where_nothing_is_recorded(once: bool) -> None:
    module = ModuleOnce(type("Stirring", (Stirring,), {"once": once})())
    assert run(lambda: module.execute(action("Stirring")), host=VirtualHost()) == "stirred"


def test_a_module_that_states_attributes_of_earlier_versions_is_known_by_them() -> None:
    pouring = process_module(type("Pouring", (Stirring,), {"physical": True, "by_hand": False}))
    assert stated_as_before(pouring()) == ("physical",)
    assert stated_as_before(Stirring()) == ()
