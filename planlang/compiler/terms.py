"""Arguments of actions in terms of plan functions, and the roles (resources) that steps hold.

A role is one of base, torso, arm, gripper, head. A step with a recipe holds the roles of all its primitives from the
first to the last one if it is unordered with a step that shares a role; so does that step, because it waits. So does an
abstract step, which may need every role. Unordered primitives need not hold anything: process modules take turns.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from keyword import kwlist

from planlang.closure import grouped
from planlang.compiler.tree import ActionTerm, Described, LatestProduct, PlaceUse, Resting, StepResult, Value
from planlang.designators import local_name, snake_case, unused_name
from planlang.ontology import Ontology, shorten
from planlang.recipe.actions import SIDED, Actions
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
from planlang.recipe.slots import fitting_parameters

_T = Thing | PlaceUse | Part | Constraint | Name | str | int | float | bool

Argument = Thing | PlaceUse
"""Argument for a parameter: a thing, or a place if the parameter stands for a place."""

Substitution = dict[Thing, Argument]
"""Parameter of a called function -> argument of its caller."""

HandUse = tuple[PlaceUse | Thing | Resting, Thing | None]
"""Goal of a hand, and the device to reach it with, if known."""

SEEN = "detectedObject"
"""Property of a condition for the thing that has to be seen."""

ACTED_ON, CHECKED = "object_acted_on", "condition_evaluated"

FIRST = ("objectActedOn", "toLocation", "fromLocation", "recipient")
LAST = ("deviceUsed",)


class Terms:
    """Translates fillers of recipes to arguments of plan functions; results are in the order of the plan's steps."""

    def __init__(self, ontology: Ontology, recipes: RecipeSet, actions: Actions) -> None:
        self._ontology = ontology
        self._recipes = recipes
        self._actions = actions
        self._parameters: dict[str, tuple[Thing, ...]] = {}
        self._steps: dict[str, tuple[Step, ...]] = {}
        self._flows: dict[str, dict[tuple[str, str], list[Flow]]] = {}
        self._uses: dict[str, tuple[HandUse, ...]] = {}
        self._devices = self._effective_devices()
        for recipe in callees_first(recipes):  # parameters of callers depend on those of their callees
            self.parameters(recipe)
        for recipe in callees_first(recipes):
            self._uses[recipe.iri] = tuple(dict.fromkeys(self.hand_uses(recipe, self.steps(recipe))))

    def steps(self, recipe: Recipe) -> Sequence[Step]:
        """Steps of a recipe in the order of the plan."""
        if recipe.iri not in self._steps:
            self._steps[recipe.iri] = tuple(map(recipe.step, recipe_order(recipe).extension))
        return self._steps[recipe.iri]

    def parameters(self, recipe: Recipe) -> tuple[Thing, ...]:
        """Objects and persons that a recipe uses, directly or in recipes that it calls, by first use."""
        if recipe.iri not in self._parameters:
            used: dict[Thing, None] = {}
            for step in self.steps(recipe):
                for parameter in _ordered(step):
                    used.update(dict.fromkeys(_things(parameter[1])))
                checked = step.condition.parameters if step.condition is not None else ()
                used.update(dict.fromkeys(_things(parameter.filler for parameter in checked)))
                for callee in step.recipes:
                    for passed in self.substitution(recipe, step, callee).values():
                        used.update(dict.fromkeys(passed.arguments if isinstance(passed, PlaceUse) else (passed,)))
            self._parameters[recipe.iri] = tuple(thing for thing in used if thing.kind is not Kind.DEVICE)
        return self._parameters[recipe.iri]

    def substitution(self, caller: Recipe, step: Step, callee: str) -> Substitution:
        """Map the parameters of a called function to the arguments of a call.

        An individual is passed as itself. A class takes the caller's filler of the same property, if there is exactly
        one and its class is a subclass; a parameter that the called recipe leaves open takes that of the step;
        otherwise the parameter is passed on as it is.
        """
        recipe = self._recipes.recipes[callee]
        if recipe.within is not None:  # an alternative is part of the function with the step itself
            return {thing: thing for thing in self.parameters(recipe)}
        return {thing: self._argument(caller, step, recipe, thing) for thing in self.parameters(recipe)}

    def action(self, recipe: Recipe, step: Step) -> ActionTerm:
        """Action designator of a step; a step of the hand uses the recipe's device if it names none."""
        properties: dict[str, tuple[Value, ...]] = {}
        for name, fillers in _ordered(step):
            key = _unclashed(snake_case(local_name(name)), properties)
            own = (self.use(filler) if isinstance(filler, Place) else filler for filler in fillers)
            properties[key] = tuple(
                self._from_others(recipe, step, name, filler, value) or value
                for filler, value in zip(fillers, own, strict=True)
            )
        device = self.device(recipe, step)
        if device is not None and "device_used" not in properties:
            properties["device_used"] = (device,)
        if step.condition is not None:
            properties |= self._checked(step.condition, properties)
        return ActionTerm(shorten(self.performed_class(step)), tuple(properties.items()))

    @staticmethod
    def performed_class(step: Step) -> str:
        """Class (IRI) of the action; an individual with a recipe of its own counts as its own class."""
        return step.iri if step.iri in step.recipes else step.action_class

    def producer_of(self, recipe: Recipe, step: Step, property_name: str, filler: Filler) -> str | None:
        """Step (IRI) whose result fills a property, if any; of several ordered producers the last one."""
        if recipe.iri not in self._flows:
            self._flows[recipe.iri] = grouped(((flow.consumer, flow.consumes or ""), flow) for flow in recipe.flows)
        flows_in = self._flows[recipe.iri].get((step.iri, property_name), ())
        order = recipe_order(recipe)
        producers = [
            flow.producer
            for flow in flows_in
            if flow.resource in _names(filler) and order.before(flow.producer, step.iri)
        ]
        last = [
            maker for maker in producers if all(maker == other or order.before(other, maker) for other in producers)
        ]
        return last[0] if last else None

    def products(self, recipe: Recipe, step: Step) -> tuple[str, ...]:
        """Names under which other states of a machine find the result of a state."""
        if recipe.machine is None:
            return ()
        used = [flow for flow in recipe.flows if flow.producer == step.iri and flow.consumer != step.iri]
        return tuple(dict.fromkeys(_key(flow) for flow in used if self._takes(recipe, flow)))

    def resolved_argument(self, recipe: Recipe, step: Step, given: Argument) -> Argument | StepResult | LatestProduct:
        """Argument that a step passes to its recipe, or the result of an earlier step for it."""
        filler = given.place if isinstance(given, PlaceUse) else given
        for name in dict.fromkeys(parameter.property for parameter in step.parameters if parameter.filler == filler):
            result = self._from_others(recipe, step, name, filler, given)
            if result is not None:
                return result
        return given

    def place(self, recipe: Recipe, step: Step, place: Place) -> PlaceUse | StepResult:
        """Goal of a base motion, or the result of an earlier step for it."""
        producer = self.producer_of(recipe, step, "toLocation", place)
        return StepResult(producer, self.use(place)) if producer is not None else self.use(place)

    def _checked(
        self, condition: Description, properties: Mapping[str, tuple[Value, ...]]
    ) -> dict[str, tuple[Value, ...]]:
        """Properties of a check: perception acts on an object, any other check has a situation."""
        seen = [one.filler for one in condition.parameters if local_name(one.property) == SEEN]
        if len(seen) == len(condition.parameters) == 1 and isinstance(seen[0], Thing):
            return {} if ACTED_ON in properties else {ACTED_ON: (seen[0],)}
        return {CHECKED: (self._described(condition) if condition.parameters else Name(condition.type),)}

    def _described(self, description: Description) -> Described:
        """Situation in the form that plans use."""
        properties: dict[str, tuple[Value, ...]] = {}
        for parameter in description.parameters:
            filler = parameter.filler
            key = _unclashed(snake_case(local_name(parameter.property)), ())
            value = self.use(filler) if isinstance(filler, Place) else filler
            properties[key] = (*properties.get(key, ()), value)
        return Described(shorten(description.type), tuple(sorted(properties.items())))

    def _from_others(
        self, recipe: Recipe, step: Step, property_name: str, filler: Filler, own: _T
    ) -> StepResult | LatestProduct | None:
        """Result of other steps for a filler, with ``own`` as the fallback; None if no step provides one."""
        if recipe.machine is not None:
            for flow in recipe.flows:
                if (flow.consumer, flow.consumes) == (step.iri, property_name) and flow.resource in _names(filler):
                    return LatestProduct(_key(flow), own)
            return None
        producer = self.producer_of(recipe, step, property_name, filler)
        return StepResult(producer, own) if producer is not None else None

    def _takes(self, recipe: Recipe, flow: Flow) -> bool:
        consumers = (step for step in recipe.steps if step.iri == flow.consumer)
        return any(flow.resource in _names(filler) for one in consumers for filler in one.fillers(flow.consumes or ""))

    def use(self, place: Place) -> PlaceUse:
        """Place together with the things that it depends on."""
        return PlaceUse(place, place.changeable())

    def device(self, recipe: Recipe, step: Step) -> Thing | None:
        """Device of a step of the hand: its own, else its recipe's."""
        own = _device(step.fillers("deviceUsed"))
        if own is not None or not self._actions.uses_hand(step):
            return own
        return self._devices.get(recipe.iri)

    def hand_uses(self, recipe: Recipe, steps: Iterable[Step]) -> Iterator[HandUse]:
        """Yield the goals of the hand in steps and in the recipes that they call, each once per step.

        Of alternatives only the first counts: a base pose need not suit those that are tried after it has failed.
        """
        for step in steps:
            for goal in self._actions.hand_goals(step):
                yield self._goal(step, goal), self.device(recipe, step)
            for callee in step.recipes[:1]:
                substitution = self.substitution(recipe, step, callee)
                yield from ((substituted(where, substitution), device) for where, device in self._uses[callee])

    def _goal(self, step: Step, goal: Place | Thing) -> PlaceUse | Thing | Resting:
        """Goal of the hand in a step; a thing to lower something onto stands for the place on it."""
        if isinstance(goal, Place):
            return self.use(goal)
        return Resting(goal) if self._actions.is_a(step, "LoweringAnObject") else goal

    def devices_of_places(self, scopes: Iterable[tuple[PlaceUse, list[HandUse]]]) -> tuple[tuple[str, Thing], ...]:
        """Places that are always reached with the same device: goals of hands, and base poses by the goals in their
        scopes.
        """
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

    def _argument(self, caller: Recipe, step: Step, recipe: Recipe, thing: Thing) -> Argument:
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
            candidates = dict.fromkeys(
                filler
                for name in sorted(properties)
                for filler in source.fillers(name)
                if isinstance(filler, Thing) and filler.kind is thing.kind and self._may_be(filler, thing.stated)
            )
            if len(candidates) == 1:
                return next(iter(candidates))
        return thing

    def _may_be(self, filler: Thing, cls: str) -> bool:
        """True if a filler is, or may be, an instance of a class: parameters and things of unknown class may."""
        has_any_class = filler.slot is not None or is_of_unknown_kind(self._ontology, filler.stated)
        return has_any_class or self._ontology.is_a(filler.stated, cls)

    def _filled(self, step: Step, recipe: Recipe, thing: Thing, slot: Slot) -> Argument:
        """Argument for a parameter that the called recipe leaves open; the parameter itself if it is ambiguous."""
        if thing.owner == recipe.name:
            match [one.filler for one in fitting_parameters(self._ontology, step, slot)]:
                case [Place() as place]:
                    return self.use(place)
                case [Thing() as filler]:
                    return filler
        return thing

    def _effective_devices(self) -> dict[str, Thing]:
        """Device of each recipe: its own, else the one that all its callers use."""
        devices: dict[str, Thing] = {}
        offers_to: dict[str, set[Thing | None]] = {}
        for recipe in reversed(callees_first(self._recipes)):
            own = _device(recipe.fillers("deviceUsed"))
            offers = offers_to.get(recipe.iri, set())
            if own is not None:
                devices[recipe.iri] = own
            elif len(offers) == 1 and (only := next(iter(offers))) is not None:
                devices[recipe.iri] = only
            for step in recipe.steps:
                for callee in step.recipes:
                    offer = _device(step.fillers("deviceUsed")) or devices.get(recipe.iri)
                    offers_to.setdefault(callee, set()).add(offer)
        return devices


def substituted(where: PlaceUse | Thing | Resting, substitution: Substitution) -> PlaceUse | Thing | Resting:
    """Translate a place or thing of a called function to the terms of its caller."""
    if isinstance(where, Thing):
        return substitution.get(where, where)
    if isinstance(where, Resting):
        given = substitution.get(where.support, where.support)
        return Resting(given) if isinstance(given, Thing) else given
    return PlaceUse(where.place, tuple(substituted_thing(thing, substitution) for thing in where.arguments))


def substituted_thing(thing: Thing, substitution: Substitution) -> Thing:
    """Translate a thing of a called function to the terms of its caller; unchanged if the caller passes a place."""
    given = substitution.get(thing, thing)
    return given if isinstance(given, Thing) else thing


def _key(flow: Flow) -> str:
    """Name of the resource of a flow between states."""
    return local_name(flow.resource or flow.producer)


def _names(filler: Filler) -> tuple[str | None, ...]:
    """Names of a filler in data flows, including None, because a flow may leave out the name."""
    match filler:
        case Thing():
            return (None, filler.iri) if filler.iri is not None else (None, filler.stated)
        case Name() | Place():
            return None, filler.iri
        case _:
            return (None,)


def _ordered(step: Step) -> list[tuple[str, tuple[Filler, ...]]]:
    """Properties and their fillers: the object first, then places, the rest by name, the device last."""
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
        elif isinstance(filler, Part) and filler.held_by is None:  # a held thing is identified by the hand
            yield filler.of


def _device(fillers: Iterable[Filler]) -> Thing | None:
    return next((filler for filler in fillers if isinstance(filler, Thing) and filler.kind is Kind.DEVICE), None)


def _unclashed(key: str, taken: Iterable[str]) -> str:
    """Keyword argument of ``action`` for a property, distinct from Python's keywords and its own parameters."""
    return unused_name(key, {*taken, "type", "name", "below", *kwlist})


ROLES = ("base", "torso", "arm", "gripper", "head")
"""Roles in the order in which a plan names them; others follow by name."""

SIDES = ("left", "right")

Role = tuple[str, str | None]
"""A role and its side; None for any side."""


class Roles:
    """The roles of one set of recipes. Sides count only if a step uses a device of one side."""

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
        """Names of all roles that a step holds, ``left_arm`` and ``right_arm`` if sides count."""
        names = {name for role in self._roles(recipe, step) for name in self._names(*role)}
        return tuple(sorted(names, key=_rank))

    def held(self, recipe: Recipe, order: Precedence[str]) -> frozenset[str]:
        """Steps (IRIs) that hold their roles; ``order`` has all orders of the recipe's steps.

        A step that is unordered with a holder has to hold its roles, too. Otherwise its request would wait in a
        module's queue for the role, and block the holder's own requests to that module: a deadlock.
        """
        users: dict[str, int] = {}
        for step in recipe.steps:
            for name in self.of(recipe, step):
                users[name] = users.get(name, 0) | order.bit(step.iri)
        holders = 0
        waiting = [step for step in recipe.steps if step.recipes or step.is_abstract]
        while waiting:
            step = waiting.pop()
            sharing = 0
            for name in self.of(recipe, step):
                sharing |= users[name]
            own = order.bit(step.iri)
            sharing &= ~(order.later(step.iri) | order.earlier(step.iri) | own)
            new = (sharing | own if sharing else 0) & ~holders
            holders |= new
            waiting += [recipe.step(iri) for iri in order.members(new & ~own)]
        return frozenset(order.members(holders))

    def _roles(self, recipe: Recipe, step: Step) -> frozenset[Role]:
        key = recipe.iri, step.iri
        if key not in self._known:
            self._known[key] = frozenset(self._found(recipe, step))
        return self._known[key]

    def _found(self, recipe: Recipe, step: Step) -> set[Role]:
        roles: set[Role] = {(role, None) for role in ROLES} if step.is_abstract else set()
        for callee in step.recipes:
            below = self._recipes.recipes[callee]
            roles |= {role for inner in below.steps for role in self._roles(below, inner)}
        primitive = self._actions.primitive(step)
        if primitive is not None:
            side = _side(self._terms.device(recipe, step))
            roles |= {(role, side if role in SIDED else None) for role in primitive.resources}
            implied = (self._actions.primitives.get(action) for action in primitive.implies)
            roles |= {(role, None) for other in implied if other is not None for role in other.resources}
        return roles

    def _names(self, role: str, side: str | None) -> tuple[str, ...]:
        if role not in SIDED or not self._has_sides:
            return (role,)
        return tuple(f"{one}_{role}" for one in SIDES if side in (one, None))


def _side(device: Thing | None) -> str | None:
    """Side in a device's name or class; None if it mentions neither, or both."""
    if device is None:
        return None
    words = {word for name in (device.iri, device.type) if name for word in snake_case(local_name(name)).split("_")}
    named = [side for side in SIDES if side in words]
    return named[0] if len(named) == 1 else None


def _rank(name: str) -> tuple[int, str]:
    role = name.rsplit("_", 1)[-1]
    return (ROLES.index(role) if role in ROLES else len(ROLES)), name
