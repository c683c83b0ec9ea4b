"""What steps are about, in terms of plan functions: parameters, arguments of calls, devices, places."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from keyword import kwlist

from planlang.compiler.naming import snake_case
from planlang.compiler.tree import ActionTerm, PlaceUse, Value
from planlang.designators import local_name
from planlang.ontology import Ontology
from planlang.recipe.actions import Actions
from planlang.recipe.graph import recipe_graph, sorted_nodes
from planlang.recipe.model import Filler, Kind, Place, Recipe, RecipeSet, Step, Thing

Renaming = dict[Thing, Thing]
"""Parameter of a called function -> thing of its caller."""

HandUse = tuple[PlaceUse | Thing, Thing | None]
"""Where a hand goes, and the device it goes with, if that is known."""

FIRST = ("objectActedOn", "toLocation", "fromLocation", "recipient")
LAST = ("deviceUsed",)


class Terms:
    """Answers for one set of recipes; all answers are in the order in which the plan performs the steps."""

    def __init__(self, ontology: Ontology, recipes: RecipeSet, actions: Actions) -> None:
        self._ontology = ontology
        self._recipes = recipes
        self._actions = actions
        self._parameters: dict[str, tuple[Thing, ...]] = {}
        self._devices = self._effective_devices()

    def steps(self, recipe: Recipe) -> list[Step]:
        """The steps of a recipe in the order in which the plan names them."""
        ordered: list[str] = sorted_nodes(recipe_graph(recipe))
        return [recipe.step(iri) for iri in ordered]

    def parameters(self, recipe: Recipe) -> tuple[Thing, ...]:
        """The objects and persons that a recipe uses, itself or in what it calls, by first use."""
        if recipe.iri not in self._parameters:
            found: dict[Thing, None] = {}
            for step in self.steps(recipe):
                if not step.recipes or self.is_performed(step):
                    for parameter in _ordered(step):
                        found.update(dict.fromkeys(_things(parameter[1])))
                for callee in step.recipes:
                    renaming = self.renaming(recipe, step, callee)
                    found.update(dict.fromkeys(renaming.values()))
            self._parameters[recipe.iri] = tuple(thing for thing in found if thing.kind is not Kind.DEVICE)
        return self._parameters[recipe.iri]

    def is_performed(self, step: Step) -> bool:
        """False for a step with a recipe that no module may take over: one nearer than its primitive ancestor."""
        return not step.recipes or not self._actions.has_primitive_ancestor(step.iri)

    def renaming(self, caller: Recipe, step: Step, callee: str) -> Renaming:
        """What a call passes for each parameter of the called function.

        An individual stands for itself. Any of a class takes the caller's filler of the same property if there is
        just one and its class is below; else it stands for itself, too.
        """
        recipe = self._recipes.recipes[callee]
        return {thing: self._argument(caller, step, recipe, thing) for thing in self.parameters(recipe)}

    def action(self, recipe: Recipe, step: Step) -> ActionTerm:
        """The action designator of a step; a step of the hand takes the recipe's device if it names none."""
        properties: dict[str, tuple[Value, ...]] = {}
        for name, fillers in _ordered(step):
            key = _unclashed(snake_case(local_name(name)), properties)
            properties[key] = tuple(self.use(filler) if isinstance(filler, Place) else filler for filler in fillers)
        device = self.device(recipe, step)
        if device is not None and "device_used" not in properties:
            properties["device_used"] = (device,)
        return ActionTerm(step.action, tuple(properties.items()))

    def use(self, place: Place, renaming: Renaming | None = None) -> PlaceUse:
        """A place with the things that it depends on, renamed."""
        things = dict.fromkeys(thing for thing in place.things() if thing.kind is not Kind.DEVICE)
        return PlaceUse(place, tuple((renaming or {}).get(thing, thing) for thing in things))

    def device(self, recipe: Recipe, step: Step) -> Thing | None:
        """The device of a step of the hand: its own, else its recipe's."""
        own = _device(step.fillers("deviceUsed"))
        if own is not None or not self._actions.uses_hand(step):
            return own
        return self._devices.get(recipe.iri)

    def hand_uses(self, recipe: Recipe, steps: Iterable[Step], renaming: Renaming | None = None) -> Iterator[HandUse]:
        """Where the hand goes in some steps and in the recipes that they call."""
        renaming = renaming or {}
        for step in steps:
            for goal in self._actions.hand_goals(step):
                where = renaming.get(goal, goal) if isinstance(goal, Thing) else self.use(goal, renaming)
                yield where, self.device(recipe, step)
            for callee in step.recipes:
                below = self._recipes.recipes[callee]
                inner = {old: renaming.get(new, new) for old, new in self.renaming(recipe, step, callee).items()}
                yield from self.hand_uses(below, self.steps(below), inner)

    def devices_of_places(self, scopes: Iterable[tuple[PlaceUse, list[HandUse]]]) -> tuple[tuple[str, Thing], ...]:
        """The places that are always reached with one and the same device: of hands, and of bases in their scopes."""
        users: dict[str, set[Thing | None]] = {}
        for recipe in self._recipes.recipes.values():
            for step in self.steps(recipe):
                for goal in self._actions.hand_goals(step):
                    if isinstance(goal, Place):
                        users.setdefault(goal.iri, set()).add(self.device(recipe, step))
        for base, uses in scopes:
            users.setdefault(base.place.iri, set()).update([device for _, device in uses] or [None])
        return tuple(
            (iri, device) for iri, devices in users.items() if len(devices) == 1 for device in devices if device
        )

    def _argument(self, caller: Recipe, step: Step, recipe: Recipe, thing: Thing) -> Thing:
        if thing.iri is not None:
            return thing
        properties = {
            parameter.property
            for parameters in (recipe.parameters, *(step.parameters for step in recipe.steps))
            for parameter in parameters
            if parameter.filler == thing
        }
        for source in (step, caller):
            offered = dict.fromkeys(
                filler
                for name in sorted(properties)
                for filler in source.fillers(name)
                if isinstance(filler, Thing)
                and filler.kind is thing.kind
                and self._ontology.is_a(filler.stated, thing.stated)
            )
            if len(offered) == 1:
                return next(iter(offered))
        return thing

    def _effective_devices(self) -> dict[str, Thing]:
        """The device of each recipe: its own, else the one that all its callers give it."""
        devices: dict[str, Thing] = {}
        given: dict[str, set[Thing | None]] = {}
        for recipe in self._callers_first():
            own = _device(recipe.fillers("deviceUsed"))
            offers = given.get(recipe.iri, set())
            if own is not None:
                devices[recipe.iri] = own
            elif len(offers) == 1 and (only := next(iter(offers))) is not None:
                devices[recipe.iri] = only
            for step in recipe.steps:
                for callee in step.recipes:
                    offer = _device(step.fillers("deviceUsed")) or devices.get(recipe.iri)
                    given.setdefault(callee, set()).add(offer)
        return devices

    def _callers_first(self) -> list[Recipe]:
        done: dict[str, None] = {}

        def visit(iri: str) -> None:
            for step in self._recipes.recipes[iri].steps:
                for callee in step.recipes:
                    if callee not in done:
                        visit(callee)
            done.setdefault(iri)

        visit(self._recipes.task)
        return [self._recipes.recipes[iri] for iri in reversed(done)]


def _ordered(step: Step) -> list[tuple[str, tuple[Filler, ...]]]:
    """Properties and their fillers: what is acted on first, where next, the device last, the rest by name."""
    names = dict.fromkeys(parameter.property for parameter in step.parameters)
    middle = sorted(name for name in names if name not in FIRST + LAST)
    ordered = [name for name in FIRST if name in names] + middle + [name for name in LAST if name in names]
    return [(name, tuple(dict.fromkeys(step.fillers(name)))) for name in ordered]


def _things(fillers: Iterable[Filler]) -> Iterator[Thing]:
    for filler in fillers:
        if isinstance(filler, Thing):
            yield filler
        elif isinstance(filler, Place):
            yield from filler.things()


def _device(fillers: Iterable[Filler]) -> Thing | None:
    return next((filler for filler in fillers if isinstance(filler, Thing) and filler.kind is Kind.DEVICE), None)


def _unclashed(key: str, taken: Iterable[str]) -> str:
    """A keyword argument of ``action`` for a property: no word of the language, nor one that ``action`` has itself."""
    used = {*taken, "type", "name", *kwlist}
    number, name = 1, key
    while name in used:
        number += 1
        name = f"{key}_{number}"
    return name
