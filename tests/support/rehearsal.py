"""Rehearsals: the plan of a recipe is run by a scripted robot to check the preconditions of its actions.

The plan runs in virtual time, and every action succeeds. So any problem is caused by the order of the steps: an action
whose precondition is achieved only by a later step (:mod:`planlang.recipe.preconditions`), or a plan that fails or does
not end.
"""

from __future__ import annotations

import typing
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from inspect import Parameter, signature
from pathlib import Path
from typing import Any, NamedTuple

from planlang.action_conditions import Condition, Named
from planlang.compiler import CompiledPlan, compile_ontology
from planlang.designators import (
    Action,
    Device,
    Location,
    Object,
    Person,
    a_device,
    a_location,
    a_person,
    an_object,
    local_name,
    snake_case,
)
from planlang.diagnostics import BadInput
from planlang.language.loading import load_plan
from planlang.language.plans import Plan
from planlang.language.source import PlanSource
from planlang.ontology import expand, load
from planlang.recipe.preconditions import Unmet
from planlang.testing.running import attempt
from planlang.testing.script import Base, Script
from planlang.testing.scripted import ScriptedExecutive
from planlang.testing.vocabulary import ActionVocabulary


class Rehearsal(NamedTuple):
    """Problems when a scripted robot runs the plan of a recipe.

    ``unmet`` are actions that came before their preconditions held, ``failure`` is the failure that ended the run.
    """

    unmet: tuple[Unmet, ...]
    failure: str = ""


LONGEST = 3600.0
"""Plan time after which a rehearsed plan counts as endless [s]."""


def rehearse(path: Path, task: str | None = None, folders: Sequence[Path] = ()) -> Rehearsal | None:
    """Run the plan of a recipe and collect its problems; None if the recipe does not compile."""
    try:
        ontology = load(path, folders=folders)
        compiled = compile_ontology(ontology, task=task)
    except BadInput:
        return None
    robot = _Robot(_script(compiled), ActionVocabulary(ontology))
    run = attempt(_plan(compiled), executive=robot, within=LONGEST)
    ended = run.failure or run.error
    failure = "" if ended is None else f"{type(ended).__name__}: {str(ended).partition(chr(10))[0]}"
    return Rehearsal(tuple(dict.fromkeys(robot.unmet())), failure)


def _script(compiled: CompiledPlan) -> Script:
    """Make a script with a module for every step that is not performed by a recipe."""
    steps = [step for recipe in compiled.recipes.recipes.values() for step in recipe.steps if not step.recipes]
    performed = dict.fromkeys(name for step in steps for name in (step.action_class, local_name(step.action_class)))
    return Script().performs(*performed)


def _plan(compiled: CompiledPlan) -> Callable[[], Any]:
    """Make a plan function without parameters: those without default get a placeholder of their type."""
    module = load_plan(PlanSource(compiled.source, f"<plan of {compiled.task}>"), compiled.functions[-1])
    plan = getattr(module, compiled.functions[-1])
    assert isinstance(plan, Plan)
    parameters = signature(plan.function).parameters.values()
    return partial(plan, **{each.name: _placeholder(each) for each in parameters if each.default is Parameter.empty})


def _placeholder(parameter: Parameter) -> object:
    name = f"rehearsal#{parameter.name}"
    kinds = typing.get_args(parameter.annotation)
    kinds = typing.get_args(kinds[0]) or kinds[:1] if kinds else (parameter.annotation,)
    makers: dict[object, Callable[[], object]] = {
        Object: lambda: an_object("SpatialThing-Localized", name),
        Person: lambda: a_person("Person", name),
        Device: lambda: a_device("PhysicalDevice", name),
        Location: lambda: a_location(parameter.name, near=an_object("SpatialThing-Localized", name)),
    }
    return next((makers[kind]() for kind in kinds if kind in makers), 1.0)


class _Robot(ScriptedExecutive):
    """Scripted robot that records unmet preconditions of actions."""

    def __init__(self, script: Script, vocabulary: ActionVocabulary) -> None:
        super().__init__(script, vocabulary)
        self._declared = vocabulary.declared
        self._holding: list[Condition] = []
        """Conditions that hold now."""
        self._missing: list[tuple[str, Condition]] = []
        """Preconditions that did not hold, with the step, until a later step achieves them."""
        self._unmet: list[Unmet] = []
        self._ended: list[tuple[str, Condition]] = []
        """Conditions that were ended, with the step that ended them."""
        self._locations: dict[Base, Location] = {}

    def unmet(self) -> Iterator[Unmet]:
        """Yield the unmet preconditions that another step achieved later, or had ended before."""
        return iter(self._unmet)

    def begin(self, action: Action) -> None:
        """Check the preconditions of an action."""
        super().begin(action)
        needed = self._declared.needed(self._classes(action), self._names(action))
        missing = [need for need in needed if not any(need.matches(held) for held in self._holding)]
        name = action.name or local_name(action.type)
        self._missing += [(name, need) for need in missing]
        over = ((need, by) for need in missing for by, ended in reversed(self._ended) if need.matches(ended))
        self._unmet += [Unmet(name, need, by) for need, by in dict(over).items()]

    def done(self, action: Action) -> None:
        """Apply the effects of an action to the conditions that hold."""
        super().done(action)
        classes, fillers = self._classes(action), self._names(action)
        achieved = [
            effect.condition
            for effect in self._declared.brought(classes, fillers)
            if all(any(given.matches(held) for held in self._holding) for given in effect.given)
        ]
        ended = self._declared.ended(classes, fillers)
        name = action.name or local_name(action.type)
        over = [held for held in self._holding if any(pattern.matches(held) for pattern in ended)]
        self._ended += [(name, held) for held in over]
        self._holding = [held for held in self._holding if held not in over] + achieved
        late = [entry for entry in self._missing if any(entry[1].matches(condition) for condition in achieved)]
        self._unmet += [Unmet(step, condition, name) for step, condition in late]
        self._missing = [entry for entry in self._missing if entry not in late]

    def solutions(self, location: Location) -> Iterator[Any]:
        """Yield the base poses of a location, and remember the location of each."""
        for solution in super().solutions(location):
            self._locations[solution.base] = location
            yield solution

    def _classes(self, action: Action) -> list[str]:
        return [expand(cls) for cls in self.ancestors(action.type)]

    def _names(self, action: Action) -> Named:
        """Function from a property to the names of its fillers; a drive has the location of its pose as toLocation."""
        base = tuple(action.get(key) for key in ("x", "y", "yaw"))
        location = next((location for pose, location in self._locations.items() if pose == base), None)

        def names(name: str) -> list[str]:
            filler = action.get(snake_case(name))
            return list(_names_in(location if filler is None and name == "toLocation" else filler))

        return names


def _names_in(filler: object) -> Iterator[str]:
    """Yield the name of an object, or the names of a location and of all its references."""
    if isinstance(filler, tuple):
        for item in filler:
            yield from _names_in(item)
    elif isinstance(filler, Location):
        yield from (filler.name,) if filler.name is not None else ()
        for reference in filler.references():
            yield from _names_in(reference)
    elif (name := getattr(filler, "name", None)) is not None:
        yield name
