"""What a step hands on to the steps that use it."""

from __future__ import annotations

from planlang.designators import an_object
from planlang.language.ordering import given


def test_of_several_results_a_step_gets_the_one_of_the_name_that_it_asks_for() -> None:
    yolk, shell = an_object("EggYolk", "yolk1"), an_object("EggShell", "shell1")
    made = {"EggYolk": yolk, "shell": shell}
    assert given(made, "EggYolk") == yolk
    assert given(made, an_object("EggShell", "shell")) == shell
    assert given({}, "EggYolk") == "EggYolk"
