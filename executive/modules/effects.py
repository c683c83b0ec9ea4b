"""Effects of actions: once a module is done, apply what the action's class declares to the true world and the belief.

Process modules do not create, destroy or transform objects themselves. A simulated world says what motions have poured,
turned over and switched since the action began; declared effects are brought about in it only as far as that has not
happened. The belief follows the declaration.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Iterator, Sequence
from dataclasses import field, replace
from itertools import count, islice

from executive.maps.classes import known
from executive.modules.flowing import within
from executive.modules.platform import Platform
from planlang.changes import Change, Output, Physics, Poured, Simulated, Switched, Transformed, TurnedOver
from planlang.designators import Action, Location, Object, local_name
from planlang.effects import Effects, effects_of, narrowest, number_of_class
from planlang.failures import AmountNotPoured, ObjectUnresolvable
from planlang.geometry import Pose
from planlang.kernel import PlanStructureError, now
from planlang.language.performing import actions_around
from planlang.ontology import expand, shorten
from planlang.records import dataclass
from planlang.state import Queries, WorldState, apply, is_free, warm
from planlang.state.matter import Matter
from planlang.state.questions import due, is_vessel, type_of

ACTED_ON = ("object_acted_on", "inputs", "inputs_destroyed")
"""Properties of an action that name what it destroys, turns over or pours."""
VESSELS = ("to_location", "device_used", *ACTED_ON)
"""Properties of an action that may name the vessel of a product, in order of preference."""


@dataclass(frozen=True, slots=True)
class Begun:
    """An action that has begun: what it is measured by when its effects are applied."""

    simulated: Simulated
    """What the world had simulated before."""
    believed: Simulated
    """What motions are believed to have poured before."""
    by_motions: tuple[type[Change], ...] = ()
    """Kinds of effects that its module leaves to its motions, whatever they have done."""
    done_by_motions: list[Change] = field(default_factory=list)
    """Effects that were not brought about in a simulated world: the robot's motions have had them, or failed to."""
    missed: list[AmountNotPoured] = field(default_factory=list)
    """Failures of effects: less was there, or had room, than the action states."""


class ActionEffects:
    """Applies effects of actions to the belief of one platform, and to the world if it is simulated."""

    def __init__(self, platform: Platform, physics: Physics | None) -> None:
        """``physics``: the simulated world that the platform's interface commands; None if the world is real."""
        self._platform, self._physics = platform, physics
        self.restored()

    def untouched(self) -> bool:
        """Check whether only declared effects have changed the world."""
        return self._physics is None or self._physics.changed == self._changed

    def restored(self) -> None:
        """Accept the world as it is, for later calls of :meth:`untouched`."""
        self._changed = 0 if self._physics is None else self._physics.changed
        """Number of changes of the world that are accounted for."""

    def catch_up(self) -> None:
        """Believe the robot where it is now, and things as flow and heat, which need no action, have made them."""
        self._platform.observe()
        try:
            time = now()
        except PlanStructureError:  # without a running plan, no time passes
            return
        self._platform.flowing.catch_up()
        passed = self._platform.belief.heated_until(time)
        if passed > 0:
            self._platform.belief.happened(warm(self._platform.belief.state, passed, self._queries))

    @property
    def _queries(self) -> Queries:
        return self._platform.scene.mirror.queries

    @property
    def _matter(self) -> Matter:
        return self._platform.belief.state.matter

    def _type_of(self, name: str) -> str:
        return type_of(self._platform.belief.state, name, self._queries)

    def of(self, action: Action) -> Effects:
        """Collect the effects that an action's class declares, and the inputs and outputs that the action states."""
        ontology, *also = self._platform.belief.map.declaring
        ancestors = [expand(cls) for cls in self._platform.ancestors(action.type)]
        effects = effects_of(ontology, expand(action.type), ancestors, also)
        destroyed, created = (
            tuple(known(ontology, what.type) for what in _objects(action, name))
            for name in ("inputs_destroyed", "outputs_created")
        )
        return replace(
            effects,
            destroyed=(*effects.destroyed, *destroyed),
            created=narrowest((ontology, *also), (*effects.created, *created)),
        )

    def may_create(self, what: Object, actions: Iterable[str]) -> bool:
        """Check whether heating or one of some action classes can create the object that a designator describes."""
        effects = (self.of(Action(action)) for action in actions)
        created = [
            *(cls for one in effects for cls in one.created),
            *(one.output for one in self._queries.rules.heating),
        ]
        return any(self._is_a(cls, what.type) for cls in created)

    def due(self, action: Action) -> float | None:
        """Compute how long heating still takes to produce the object of an action [s]; None if nothing is awaited.

        An object to turn over must be done on its heated side: a pancake is turned when its lower side is baked,
        although no step of the recipe waits for that.
        """
        for what in (what for name in ACTED_ON for what in _objects(action, name)):
            try:
                name = self._platform.scene.bodies.bind(what)
            except ObjectUnresolvable:
                state = self._platform.belief.state
                return min(due(state, state.poses, self._queries, what.type), default=None)
            if self.of(action).turned:
                return min(due(self._platform.belief.state, [name], self._queries), default=None)
        return None

    def begins(self, by_motions: Collection[type[Change]]) -> Begun:
        """Take down what the world has simulated before an action, of which ``by_motions`` are left to its motions."""
        simulated = Simulated() if self._physics is None else self._physics.simulated
        return Begun(simulated, self._platform.flowing.simulated, tuple(by_motions))

    def apply(self, action: Action, begun: Begun) -> None:
        """Apply the effects of a performed action and of an enclosing one that it completes; skip missing objects."""
        for cls in self.of(action).completes:
            outer = (one for one in actions_around() if expand(cls) in map(expand, self._platform.ancestors(one.type)))
            for one in islice(outer, 1):
                self.apply(one, begun)
        effects = replace(self.of(action), completes=())
        if not effects:
            return
        before = self._platform.belief.state
        if effects.flow_rate is None:  # pouring creates only the object that lands
            self._transform(action, effects, begun)
        self._turn_over(action, effects, begun)
        self._switch(action, effects, begun)
        self._pour(action, effects, begun)
        self._platform.belief.learn()
        self._name_what_landed(action, effects, before)

    # One kind of effect after the other

    def _transform(self, action: Action, effects: Effects, begun: Begun) -> None:
        """Replace destroyed objects, and contents of vessels, by the objects created."""
        things, used = [], []
        for what, name in self._bound(action, ACTED_ON):
            types = {self._type_of(name), what.type} if self._platform.belief.means(what, name) else set()
            if any(self._is_a(type, cls) for type in types for cls in effects.destroyed):
                things.append(name)
            else:
                content = self._matter.contents.get(name, {})
                # A designator of the vessel itself stands for everything in it, one of a substance for that only.
                whole = what.iri is not None or self._platform.belief.means(what, name)
                meant = [type for type in content if whole or self._is_a(type, what.type)]
                used += [(name, type) for type in meant if any(self._is_a(type, cls) for cls in effects.destroyed)]
        if not (things or used) and (effects.destroyed or not effects.created):
            return
        things, used = list(dict.fromkeys(things)), list(dict.fromkeys(used))
        outputs = dict(self._outputs(action, effects.created))
        vessel = self._vessel(action, effects, things, used)
        amounts = tuple((name, self._usual_amount(self._type_of(name)) or 0.0) for name in things)
        self._do(Transformed(amounts, tuple(used), tuple(outputs), vessel), begun)
        named = {output.name: described for output, described in outputs.items() if described is not None}
        belief = self._platform.belief
        belief.learn({name: described.iri for name, described in named.items() if described.iri is not None})
        for name, described in named.items():
            if name in belief.memory.made:
                belief.bound_to(described, name)

    def _outputs(self, action: Action, created: Sequence[str]) -> Iterator[tuple[Output, Object | None]]:
        """Yield created objects under names that are free in all worlds, each with the action's designator of it."""
        stated, ontology = list(_objects(action, "outputs_created")), self._platform.belief.map.ontology
        taken: set[str] = set()
        for cls in created:
            names = (f"{local_name(cls)}_{number}" for number in count(1))
            name = next(one for one in names if one not in taken and self._is_free(one))
            taken.add(name)
            type = shorten(cls)
            what = next((one for one in stated if shorten(known(ontology, one.type)) == type), None)
            yield Output(name, type, self._usual_amount(type)), what

    def _vessel(
        self, action: Action, effects: Effects, things: Sequence[str], used: Sequence[tuple[str, str]]
    ) -> str | None:
        """Choose the vessel of a product: one that the action names, one of an input, else one of a usual class."""
        state, queries = self._platform.belief.state, self._queries
        named = [name for _, name in self._bound(action, VESSELS)]
        below = [one for one in (queries.under(state, thing) for thing in things) if one is not None]
        usual = [name for cls in effects.vessels for name in self._nearest(cls)]
        every = (*named, *(name for name, _ in used), *below, *usual)
        return next((name for name in every if name not in things and is_vessel(state, name, queries)), None)

    def _nearest(self, cls: str) -> list[str]:
        """List the believed objects of a class, nearest to the robot first."""
        belief, (x, y, _) = self._platform.belief, self._platform.base()
        objects = belief.of_class(Object(shorten(cls)))
        return sorted(objects, key=lambda name: math.dist(belief.pose(name).position[:2], (x, y)))

    def _turn_over(self, action: Action, effects: Effects, begun: Begun) -> None:
        for name in self._turning(action, effects):
            self._do(TurnedOver(name), begun)

    def _turning(self, action: Action, effects: Effects) -> Iterator[str]:
        """Yield the objects that an action turns over, without those that a hand still holds."""
        for what, name in self._bound(action, ACTED_ON) if effects.turned else ():
            types = (what.type, self._type_of(name))
            fits = any(self._is_a(one, cls) for one in types for cls in effects.turned)
            if fits and name not in self._platform.belief.held:
                yield name

    def lying(self, action: Action) -> dict[str, Pose] | None:
        """Map the objects that an action turns over to their believed poses; None if its class turns nothing over."""
        effects = self.of(action)
        if not effects.turned:
            return None
        return {name: self._platform.belief.pose(name) for name in self._turning(action, effects)}

    def _switch(self, action: Action, effects: Effects, begun: Begun) -> None:
        named = self._bound(action, ("object_acted_on", "device_used")) if effects.states else ()
        devices = {one.device for one in self._platform.scene.world.scene.controls}
        for name in sorted((name for _, name in named), key=lambda name: name not in devices)[:1]:
            self._do(Switched(name, shorten(effects.states[0])), begun)

    def _pour(self, action: Action, effects: Effects, begun: Begun) -> None:
        if effects.flow_rate is None:
            return
        acted = self._bound(action, (*ACTED_ON, "device_used", "from_location"))
        goals = [name for _, name in self._bound(action, ("to_location",))]
        what, source = next(((w, name) for w, name in acted if name in self._matter.contents), (None, None))
        target = next((name for name in (*goals, *(name for _, name in acted)) if name != source), None)
        if what is None or source is None or target is None:
            return
        stated, there, had = action.get("amount"), self._matter.total(target), self._matter.total(source)
        if isinstance(stated, int | float):
            amount = float(stated)
        else:  # "pour the mix" empties the vessel, "pour from the bottle" pours the usual amount
            amount = effects.amount or 0.0 if self._platform.belief.means(what, source) else had
        by_motions = self._platform.flowing.simulated.flowed_since(begun.believed, source)
        self._do(Poured(source, target, amount), begun)
        is_filled = is_vessel(self._platform.belief.state, target, self._queries)
        landed = self._matter.total(target) - there if is_filled else had - self._matter.total(source)
        if stated is not None and (poured := by_motions + landed) < amount - within(amount):
            message = f"{amount:.0f} ml were asked for, {poured:.0f} ml were poured: out of {source}"
            begun.missed.append(AmountNotPoured(message, what=source, asked=amount, poured=poured))

    def _name_what_landed(self, action: Action, effects: Effects, before: WorldState) -> None:
        """Bind the outputs that a pouring action states to the object that has landed where it poured."""
        new = [name for name in self._platform.belief.state.made if name not in before.made]
        for what in _objects(action, "outputs_created") if effects.flow_rate is not None else ():
            for name in new[:1]:
                self._platform.belief.bound_to(what, name)

    # Helpers

    def _is_free(self, name: str) -> bool:
        """Check that no thing has a name, nor ever had it, as it is believed and in truth."""
        is_free_here = is_free(self._platform.belief.state, name, self._queries)
        return is_free_here and (self._physics is None or self._physics.is_free(name))

    def _do(self, change: Change, begun: Begun) -> None:
        """Apply a change to the belief and to the true world, each as far as motions have not brought it about."""
        belief = self._platform.belief
        if (left := self._platform.flowing.simulated.left_of(change, begun.believed)) is not None:
            state, flowed = apply(left, belief.state, self._queries)
            belief.happened(state, replace(left, amount=flowed) if isinstance(left, Poured) else left)
        physics = None if isinstance(change, begun.by_motions) else self._physics
        if physics is None or not physics.bring_about(change, begun.simulated):
            begun.done_by_motions.append(change)

    def _bound(self, action: Action, properties: Iterable[str]) -> list[tuple[Object, str]]:
        """Resolve the objects that fill properties of an action to names; leave out missing and destroyed ones."""
        bound = []
        for what in (what for name in properties for what in _objects(action, name)):
            try:
                name = self._platform.scene.bodies.bind(what)
            except ObjectUnresolvable:
                continue
            if self._platform.belief.state.there(name):
                bound.append((what, name))
        return list(dict.fromkeys(bound))

    def _is_a(self, type: str, cls: str) -> bool:
        return self._queries.rules.is_a(shorten(type), shorten(cls))

    def _usual_amount(self, type: str) -> float | None:
        every = self._platform.belief.map.declaring
        amounts = (number_of_class(ontology, [expand(type)], "amount") for ontology in every)
        return next((amount for amount in amounts if amount is not None), None)


def _objects(action: Action, name: str) -> Iterator[Object]:
    """Yield the objects that fill a property, and the reference objects of its locations."""
    value = action.get(name)
    for part in value if isinstance(value, tuple) else (value,):
        if isinstance(part, Location):
            yield from part.objects()
        elif isinstance(part, Object):
            yield part
