"""Rehearsals: the plan of a recipe, performed by the scripted robot, judged by what its actions need.

A recipe's plan is run in virtual time. Every action without an effect that is scripted succeeds, so what goes wrong
does so by the order of the steps: an action that needs what is brought about only later
(:mod:`planlang.recipe.preconditions`), or a plan that fails or does not end.
"""

from __future__ import annotations

import typing
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from inspect import Parameter, signature
from pathlib import Path
from types import ModuleType
from typing import Any

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
from planlang.language.plans import Plan
from planlang.ontology import expand, load
from planlang.recipe.fixes import Rehearsal
from planlang.recipe.preconditions import Unmet
from planlang.testing.running import attempt
from planlang.testing.script import Base, Script
from planlang.testing.scripted import ScriptedExecutive
from planlang.testing.vocabulary import ActionVocabulary

LONGEST = 3600.0
"""Plan time after which a rehearsed plan counts as one that does not end [s]."""


def rehearse(path: Path, task: str | None = None, folders: Sequence[Path] = ()) -> Rehearsal | None:
    """Return what goes wrong when the plan of a recipe is run; None if the recipe does not compile."""
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
    """Return a script by which the robot performs all steps that no recipe performs."""
    steps = [step for recipe in compiled.recipes.recipes.values() for step in recipe.steps if not step.recipes]
    performed = dict.fromkeys(name for step in steps for name in (step.action_class, local_name(step.action_class)))
    return Script().performs(*performed)


def _plan(compiled: CompiledPlan) -> Callable[[], Any]:
    """Return the plan as a function of nothing: parameters without default get a made-up filler of their kind."""
    module = ModuleType(compiled.functions[-1])
    exec(compile(compiled.source, f"<plan of {compiled.task}>", "exec"), module.__dict__)
    plan = getattr(module, compiled.functions[-1])
    assert isinstance(plan, Plan)
    missing = [one for one in signature(plan.function).parameters.values() if one.default is Parameter.empty]
    return partial(plan, **{one.name: _made_up(one) for one in missing})


def _made_up(parameter: Parameter) -> object:
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
    """A scripted robot that notes which actions it begins too early."""

    def __init__(self, script: Script, vocabulary: ActionVocabulary) -> None:
        super().__init__(script, vocabulary)
        self._declared = vocabulary.declared
        self._holding: list[Condition] = []
        self._open: list[tuple[str, Condition]] = []
        self._unmet: list[Unmet] = []
        self._ended: list[tuple[str, Condition]] = []
        self._places: dict[Base, Location] = {}

    def unmet(self) -> Iterator[Unmet]:
        """Yield what actions needed and others brought about later, or had ended before."""
        return iter(self._unmet)

    def begin(self, action: Action) -> None:
        """Note what the action needs and does not find, unless nothing ever brings it about."""
        super().begin(action)
        needed = self._declared.needed(self._classes(action), self._named(action))
        missing = [one for one in needed if not any(one.matches(held) for held in self._holding)]
        name = action.name or local_name(action.type)
        self._open += [(name, one) for one in missing]
        over = ((one, by) for one in missing for by, ended in reversed(self._ended) if one.matches(ended))
        self._unmet += [Unmet(name, one, by, is_over=True) for one, by in dict(over).items()]

    def done(self, action: Action) -> None:
        """Bring about what the action does."""
        super().done(action)
        classes, fillers = self._classes(action), self._named(action)
        brought = [
            effect.condition
            for effect in self._declared.brought(classes, fillers)
            if all(any(given.matches(held) for held in self._holding) for given in effect.given)
        ]
        ended = self._declared.ended(classes, fillers)
        name = action.name or local_name(action.type)
        over = [held for held in self._holding if any(one.matches(held) for one in ended)]
        self._ended += [(name, held) for held in over]
        self._holding = [held for held in self._holding if held not in over] + brought
        late = [one for one in self._open if any(one[1].matches(condition) for condition in brought)]
        self._unmet += [Unmet(step, condition, name) for step, condition in late]
        self._open = [one for one in self._open if one not in late]

    def solutions(self, location: Location) -> Iterator[Any]:
        """Yield the places of a location, and remember which location they belong to."""
        for solution in super().solutions(location):
            self._places[solution.base] = location
            yield solution

    def _classes(self, action: Action) -> list[str]:
        return [expand(cls) for cls in self.ancestors(action.type)]

    def _named(self, action: Action) -> Named:
        base = tuple(action.get(key) for key in ("x", "y", "yaw"))
        place = next((where for pose, where in self._places.items() if pose == base), None)

        def names(name: str) -> list[str]:
            filler = action.get(snake_case(name))
            return list(_names(place if filler is None and name == "toLocation" else filler))

        return names


def _names(filler: object) -> Iterator[str]:
    """Yield the names of a thing, or of a place and all that it relates to."""
    if isinstance(filler, tuple):
        for one in filler:
            yield from _names(one)
    elif isinstance(filler, Location):
        yield from (filler.name,) if filler.name is not None else ()
        for relation in filler.relations:
            yield from _names(relation.reference)
    elif (name := getattr(filler, "name", None)) is not None:
        yield name
