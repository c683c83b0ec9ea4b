"""The things that steps are about, in terms of plan functions, and the roles (resources) that steps hold.

A role is one of base, torso, arm, gripper, head. A step with a recipe holds the roles of all its primitives from its
first to its last one where it is unordered with a step that shares a role with it; that one waits, and so holds its
own. So does a step that nothing performs yet, which may need every role. Unordered primitives need no such order:
process modules take turns by themselves.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from keyword import kwlist

from planlang.compiler.tree import ActionTerm, Described, Kept, Passed, PlaceUse, Resting, Value
from planlang.designators import local_name, snake_case, unused_name
from planlang.ontology import Ontology, shorten
from planlang.recipe.actions import Actions
from planlang.recipe.fillers import is_of_unknown_kind
from planlang.recipe.model import (
    Constraint,
    Description,
    Filler,
    Flow,
    Kind,
    Name,
    Part,
    Place,
    Recipe,
    RecipeSet,
    Slot,
    Step,
    Thing,
)
from planlang.recipe.order import Precedence, callees_first, recipe_order
from planlang.recipe.slots import offered

_T = Thing | PlaceUse | Part | Constraint | Name | str | int | float | bool

Given = Thing | PlaceUse
"""The argument of a caller for a parameter: a thing, or a place for one that stands for a place."""

Renaming = dict[Thing, Given]
"""Parameter of a called function -> what its caller passes."""

HandUse = tuple[PlaceUse | Thing | Resting, Thing | None]
"""A goal of a hand, and the device that it reaches with, if that is known."""

SEEN = "detectedObject"
"""The property of a condition that names what has to be seen."""

ACTED_ON, CHECKED = "object_acted_on", "condition_evaluated"

FIRST = ("objectActedOn", "toLocation", "fromLocation", "recipient")
LAST = ("deviceUsed",)


class Terms:
    """Answers for one set of recipes; all answers are in the order in which the plan performs the steps."""

    def __init__(self, ontology: Ontology, recipes: RecipeSet, actions: Actions) -> None:
        self._ontology = ontology
        self._recipes = recipes
        self._actions = actions
        self._parameters: dict[str, tuple[Thing, ...]] = {}
        self._steps: dict[str, tuple[Step, ...]] = {}
        self._passed: dict[str, dict[tuple[str, str], list[Flow]]] = {}
        self._uses: dict[str, tuple[HandUse, ...]] = {}
        self._devices = self._effective_devices()
        for recipe in callees_first(recipes):  # whatever asks below a recipe finds the answer there
            self.parameters(recipe)
        for recipe in callees_first(recipes):
            self._uses[recipe.iri] = tuple(dict.fromkeys(self.hand_uses(recipe, self.steps(recipe))))

    def steps(self, recipe: Recipe) -> Sequence[Step]:
        """Return the steps of a recipe in the order in which the plan names them."""
        if recipe.iri not in self._steps:
            self._steps[recipe.iri] = tuple(map(recipe.step, recipe_order(recipe).extension))
        return self._steps[recipe.iri]

    def parameters(self, recipe: Recipe) -> tuple[Thing, ...]:
        """Return the objects and persons that a recipe uses, itself or in what it calls, by first use."""
        if recipe.iri not in self._parameters:
            found: dict[Thing, None] = {}
            for step in self.steps(recipe):
                for parameter in _ordered(step):
                    found.update(dict.fromkeys(_things(parameter[1])))
                checked = step.condition.parameters if step.condition is not None else ()
                found.update(dict.fromkeys(_things(parameter.filler for parameter in checked)))
                for callee in step.recipes:
                    for given in self.renaming(recipe, step, callee).values():
                        found.update(dict.fromkeys(given.arguments if isinstance(given, PlaceUse) else (given,)))
            self._parameters[recipe.iri] = tuple(thing for thing in found if thing.kind is not Kind.DEVICE)
        return self._parameters[recipe.iri]

    def renaming(self, caller: Recipe, step: Step, callee: str) -> Renaming:
        """Return what a call passes for each parameter of the called function.

        An individual stands for itself. A class takes the caller's filler of the same property if there is just one
        and its class is below, what the called recipe does not state takes that of the step; else it stands for itself,
        too.
        """
        recipe = self._recipes.recipes[callee]
        if recipe.within is not None:  # an alternative stands in the function of the step itself
            return {thing: thing for thing in self.parameters(recipe)}
        return {thing: self._argument(caller, step, recipe, thing) for thing in self.parameters(recipe)}

    def action(self, recipe: Recipe, step: Step) -> ActionTerm:
        """Return the action designator of a step; a step of the hand takes the recipe's device if it names none."""
        properties: dict[str, tuple[Value, ...]] = {}
        for name, fillers in _ordered(step):
            key = _unclashed(snake_case(local_name(name)), properties)
            properties[key] = tuple(self._value(recipe, step, name, filler) for filler in fillers)
        device = self.device(recipe, step)
        if device is not None and "device_used" not in properties:
            properties["device_used"] = (device,)
        if step.condition is not None:
            properties |= self._checked(step.condition, properties)
        return ActionTerm(shorten(self.performed_class(step)), tuple(properties.items()))

    @staticmethod
    def performed_class(step: Step) -> str:
        """Return the class (IRI) of the action; an individual with a recipe of its own is one, the nearest there is."""
        return step.iri if step.iri in step.recipes else step.action_class

    def passed(self, recipe: Recipe, step: Step, property_name: str, filler: Filler) -> str | None:
        """Return the step (IRI) whose result a step takes for a filler; None if none provides it.

        Of several that make the same the last one, if they are in order.
        """
        if recipe.iri not in self._passed:
            flows: dict[tuple[str, str], list[Flow]] = {}
            for flow in recipe.flows:
                flows.setdefault((flow.consumer, flow.consumes or ""), []).append(flow)
            self._passed[recipe.iri] = flows
        found = self._passed[recipe.iri].get((step.iri, property_name), ())
        order = recipe_order(recipe)
        makers = [
            flow.producer for flow in found if flow.resource in _names(filler) and order.before(flow.producer, step.iri)
        ]
        last = [maker for maker in makers if all(maker == other or order.before(other, maker) for other in makers)]
        return last[0] if last else None

    def kept(self, recipe: Recipe, step: Step) -> tuple[str, ...]:
        """Return the names under which other states of a machine find what a state makes."""
        if recipe.machine is None:
            return ()
        used = [flow for flow in recipe.flows if flow.producer == step.iri and flow.consumer != step.iri]
        return tuple(dict.fromkeys(_key(flow) for flow in used if self._takes(recipe, flow)))

    def handed(self, recipe: Recipe, step: Step, given: Given) -> Given | Passed | Kept:
        """Return what a step passes to its recipe, or the result of an earlier step for it."""
        filler = given.place if isinstance(given, PlaceUse) else given
        for name in dict.fromkeys(parameter.property for parameter in step.parameters if parameter.filler == filler):
            found = self._from_others(recipe, step, name, filler, given)
            if found is not None:
                return found
        return given

    def place(self, recipe: Recipe, step: Step, place: Place) -> PlaceUse | Passed:
        """Return the goal of a base motion, or the result of an earlier step that stands for it."""
        producer = self.passed(recipe, step, "toLocation", place)
        return Passed(producer, self.use(place)) if producer is not None else self.use(place)

    def _checked(
        self, condition: Description, properties: Mapping[str, tuple[Value, ...]]
    ) -> dict[str, tuple[Value, ...]]:
        """Return the properties of a check: perception is an action on an object, anything else a situation."""
        seen = [one.filler for one in condition.parameters if local_name(one.property) == SEEN]
        if len(seen) == len(condition.parameters) == 1 and isinstance(seen[0], Thing):
            return {} if ACTED_ON in properties else {ACTED_ON: (seen[0],)}
        return {CHECKED: (self._described(condition) if condition.parameters else Name(condition.type),)}

    def _described(self, description: Description) -> Described:
        """Return a situation in the form that plans use."""
        properties: dict[str, tuple[Value, ...]] = {}
        for parameter in description.parameters:
            filler = parameter.filler
            key = _unclashed(snake_case(local_name(parameter.property)), ())
            value = self.use(filler) if isinstance(filler, Place) else filler
            properties[key] = (*properties.get(key, ()), value)
        return Described(shorten(description.type), tuple(sorted(properties.items())))

    def _value(self, recipe: Recipe, step: Step, property_name: str, filler: Filler) -> Value:
        own = self.use(filler) if isinstance(filler, Place) else filler
        return self._from_others(recipe, step, property_name, filler, own) or own

    def _from_others(
        self, recipe: Recipe, step: Step, property_name: str, filler: Filler, own: _T
    ) -> Passed | Kept | None:
        """Return what other steps provide for a filler, which is ``own`` in the plan; None if they provide nothing."""
        if recipe.machine is not None:
            for flow in recipe.flows:
                if (flow.consumer, flow.consumes) == (step.iri, property_name) and flow.resource in _names(filler):
                    return Kept(_key(flow), own)
            return None
        producer = self.passed(recipe, step, property_name, filler)
        return Passed(producer, own) if producer is not None else None

    def _takes(self, recipe: Recipe, flow: Flow) -> bool:
        consumers = (step for step in recipe.steps if step.iri == flow.consumer)
        return any(flow.resource in _names(filler) for one in consumers for filler in one.fillers(flow.consumes or ""))

    def use(self, place: Place) -> PlaceUse:
        """Return a place with the things that it depends on."""
        return PlaceUse(place, place.changeable())

    def device(self, recipe: Recipe, step: Step) -> Thing | None:
        """Return the device of a step of the hand: its own, else its recipe's."""
        own = _device(step.fillers("deviceUsed"))
        if own is not None or not self._actions.uses_hand(step):
            return own
        return self._devices.get(recipe.iri)

    def hand_uses(self, recipe: Recipe, steps: Iterable[Step]) -> Iterator[HandUse]:
        """Yield the goals of the hand in some steps and in the recipes that they call, each once for a step.

        Of alternatives the first one counts: a base pose need not suit what is only tried when that has failed.
        """
        for step in steps:
            for goal in self._actions.hand_goals(step):
                yield self._goal(step, goal), self.device(recipe, step)
            for callee in step.recipes[:1]:
                renaming = self.renaming(recipe, step, callee)
                yield from ((renamed(where, renaming), device) for where, device in self._uses[callee])

    def _goal(self, step: Step, goal: Place | Thing) -> PlaceUse | Thing | Resting:
        """Return where a step takes the hand; a thing that something is lowered onto stands for the place on it."""
        if isinstance(goal, Place):
            return self.use(goal)
        return Resting(goal) if self._actions.is_a(step, "LoweringAnObject") else goal

    def devices_of_places(self, scopes: Iterable[tuple[PlaceUse, list[HandUse]]]) -> tuple[tuple[str, Thing], ...]:
        """Return the places that are always reached with the same device: of hands, and of bases in their scopes."""
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

    def _argument(self, caller: Recipe, step: Step, recipe: Recipe, thing: Thing) -> Given:
        if thing.iri is not None:
            return thing
        if thing.slot is not None:
            return self._filled(step, recipe, thing, thing.slot)
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
                if isinstance(filler, Thing) and filler.kind is thing.kind and self._may_be(filler, thing.stated)
            )
            if len(offered) == 1:
                return next(iter(offered))
        return thing

    def _may_be(self, filler: Thing, cls: str) -> bool:
        """Return True for what is of a class, and for what may be: a caller's thing, and one of an unknown class."""
        is_anything = filler.slot is not None or is_of_unknown_kind(self._ontology, filler.stated)
        return is_anything or self._ontology.is_a(filler.stated, cls)

    def _filled(self, step: Step, recipe: Recipe, thing: Thing, slot: Slot) -> Given:
        """Return what a step passes for what its recipe does not state; the parameter itself unless it is clear."""
        if thing.owner == recipe.name:
            match [one.filler for one in offered(self._ontology, step, slot)]:
                case [Place() as place]:
                    return self.use(place)
                case [Thing() as filler]:
                    return filler
        return thing

    def _effective_devices(self) -> dict[str, Thing]:
        """Return the device of each recipe: its own, else the one that all its callers give it."""
        devices: dict[str, Thing] = {}
        given: dict[str, set[Thing | None]] = {}
        for recipe in reversed(callees_first(self._recipes)):
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


def renamed(where: PlaceUse | Thing | Resting, renaming: Renaming) -> PlaceUse | Thing | Resting:
    """Return a place or thing of a called function in terms of its caller."""
    if isinstance(where, Thing):
        return renaming.get(where, where)
    if isinstance(where, Resting):
        given = renaming.get(where.support, where.support)
        return Resting(given) if isinstance(given, Thing) else given
    return PlaceUse(where.place, tuple(renamed_thing(thing, renaming) for thing in where.arguments))


def renamed_thing(thing: Thing, renaming: Renaming) -> Thing:
    """Return a thing of a called function in terms of its caller; itself if the caller passes a place."""
    given = renaming.get(thing, thing)
    return given if isinstance(given, Thing) else thing


def _key(flow: Flow) -> str:
    """Return the name of what a flow passes between states."""
    return local_name(flow.resource or flow.producer)


def _names(filler: Filler) -> tuple[str | None, ...]:
    """Return the names of a filler in data flows; among them None, as a flow may leave out the name."""
    match filler:
        case Thing():
            return (None, filler.iri) if filler.iri is not None else (None, filler.stated)
        case Name() | Place():
            return None, filler.iri
        case _:
            return (None,)


def _ordered(step: Step) -> list[tuple[str, tuple[Filler, ...]]]:
    """Return properties and their fillers: the object first, then the place, the rest by name, the device last."""
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
        elif isinstance(filler, Constraint):
            yield from _things((filler.tool, filler.world))
        elif isinstance(filler, Part) and filler.held_by is None:  # what a hand holds is found by the hand
            yield filler.of


def _device(fillers: Iterable[Filler]) -> Thing | None:
    return next((filler for filler in fillers if isinstance(filler, Thing) and filler.kind is Kind.DEVICE), None)


def _unclashed(key: str, taken: Iterable[str]) -> str:
    """Return a keyword argument of ``action`` for a property: no keyword of Python, nor a parameter of ``action``."""
    return unused_name(key, {*taken, "type", "name", "below", *kwlist})


ROLES = ("base", "torso", "arm", "gripper", "head")
"""The order in which a plan names roles; others follow by name."""

SIDED = frozenset({"arm", "gripper"})
"""Roles of which a robot has one on each side."""

SIDES = ("left", "right")

Role = tuple[str, str | None]
"""A role and its side; None where any side may be meant."""


class Roles:
    """The roles of one set of recipes. Sides only count if a device of one side is used."""

    def __init__(self, recipes: RecipeSet, actions: Actions, terms: Terms) -> None:
        self._recipes = recipes
        self._actions = actions
        self._terms = terms
        self._known: dict[tuple[str, str], frozenset[Role]] = {}
        for recipe in callees_first(recipes):
            for step in recipe.steps:
                self._roles(recipe, step)
        used = {role for step in recipes.main.steps for role in self._roles(recipes.main, step)}
        self._has_sides = any(side for _, side in used)

    def of(self, recipe: Recipe, step: Step) -> tuple[str, ...]:
        """Return the names of all roles that a step holds, ``left_arm`` and ``right_arm`` where sides count."""
        names = {name for role in self._roles(recipe, step) for name in self._names(*role)}
        return tuple(sorted(names, key=_rank))

    def held(self, recipe: Recipe, order: Precedence[str]) -> frozenset[str]:
        """Return the steps (IRIs) that hold their roles; ``order`` has all orders of the recipe's steps.

        What is unordered with one that holds a role holds it, too: a request that waits in a module's queue for a role
        would be in the way of the one that has the role and asks the module.
        """
        users: dict[str, int] = {}
        for step in recipe.steps:
            for name in self.of(recipe, step):
                users[name] = users.get(name, 0) | order.bit(step.iri)
        found = 0
        waiting = [step for step in recipe.steps if step.recipes or step.is_abstract]
        while waiting:
            step = waiting.pop()
            sharing = 0
            for name in self.of(recipe, step):
                sharing |= users[name]
            own = order.bit(step.iri)
            sharing &= ~(order.later(step.iri) | order.earlier(step.iri) | own)
            new = (sharing | own if sharing else 0) & ~found
            found |= new
            waiting += [recipe.step(iri) for iri in order.members(new & ~own)]
        return frozenset(order.members(found))

    def _roles(self, recipe: Recipe, step: Step) -> frozenset[Role]:
        key = recipe.iri, step.iri
        if key not in self._known:
            self._known[key] = frozenset(self._found(recipe, step))
        return self._known[key]

    def _found(self, recipe: Recipe, step: Step) -> set[Role]:
        found: set[Role] = {(role, None) for role in ROLES} if step.is_abstract else set()
        for callee in step.recipes:
            below = self._recipes.recipes[callee]
            found |= {role for inner in below.steps for role in self._roles(below, inner)}
        primitive = self._actions.primitive(step)
        if primitive is not None:
            side = _side(self._terms.device(recipe, step))
            found |= {(role, side if role in SIDED else None) for role in primitive.resources}
            implied = (self._actions.primitives.get(action) for action in primitive.implies)
            found |= {(role, None) for other in implied if other is not None for role in other.resources}
        return found

    def _names(self, role: str, side: str | None) -> tuple[str, ...]:
        if role not in SIDED or not self._has_sides:
            return (role,)
        return tuple(f"{one}_{role}" for one in SIDES if side in (one, None))


def _side(device: Thing | None) -> str | None:
    """Return the side in a device's name or its class in the vocabulary; None if neither, or both, are named."""
    if device is None:
        return None
    words = {word for name in (device.iri, device.type) if name for word in snake_case(local_name(name)).split("_")}
    named = [side for side in SIDES if side in words]
    return named[0] if len(named) == 1 else None


def _rank(name: str) -> tuple[int, str]:
    role = name.rsplit("_", 1)[-1]
    return (ROLES.index(role) if role in ROLES else len(ROLES)), name
