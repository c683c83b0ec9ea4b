"""What changes, flow and heat make of a state of the world: another state. Nothing here has a side effect.

One interpreter serves the true world, what a robot believes, hypotheses, and scripted worlds without geometry. They
differ in who answers the :class:`Queries`: what things are like, and what is below them.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

from planlang.changes import Change, Poured, Switched, Transformed, TurnedOver
from planlang.geometry import Pose
from planlang.geometry.matrices import upright
from planlang.geometry.shapes import Size, half_extents
from planlang.iris import local_name
from planlang.state.matter import PUDDLE, ROUNDING, Portion, merged
from planlang.state.questions import Point, Queries, is_free, is_vessel, thing_of, type_of
from planlang.state.world import Made, WorldState

STANDS = 0.5
"""Cosine of the largest tilt at which a vessel can be filled."""
BESIDE = 0.02
"""Distance from a vessel at which its overflow lands [m]."""
ONE_PUDDLE = 0.2
"""Distance up to which a poured substance joins a puddle of the same [m]."""


def apply(change: Change, state: WorldState, queries: Queries) -> tuple[WorldState, float]:
    """Make the state after a change by an action; return it with the volume that flowed [ml].

    Things that do not exist are skipped: the state stays the same one if there is nothing to change.
    """
    flowed = 0.0
    match change:
        case Poured(source, target, amount):
            after, flowed = _poured(state, source, target, amount, queries)
        case Transformed():
            after = _transformed(state, change, queries)
        case TurnedOver(name):
            after = _turned_over(state, name, queries)
        case Switched(name, value):
            is_so = state.matter.states.get(name) == value
            after = state if is_so else replace(state, matter=state.matter.switched(name, value))
    return (after if after is state else replace(after, changes=state.changes + 1)), flowed


def flow(
    state: WorldState, name: str, amount: float, point: Point, queries: Queries
) -> tuple[WorldState, float, str | None]:
    """Let an amount [ml] flow out of a thing from a point.

    Return the state, what flowed [ml], and what it landed on or in: None if nothing did, or it fell out of the world.
    """
    matter, portions = state.matter.take(name, amount)
    if not portions:
        return state, 0.0, None
    state = replace(state, matter=matter)
    below, height = queries.below(state, point, name)
    if below is not None:
        state = _give(state, portions, below, (point[0], point[1], height), queries)
    return state, sum(one.amount for one in portions), below


def warm(state: WorldState, seconds: float, queries: Queries) -> WorldState:
    """Heat things above devices that are on (lower side) or inside them (both sides); they may change class."""
    if not any(map(state.matter.is_on, state.matter.states)):
        return state
    can_heat = queries.rules.can_heat
    for name in state.poses:
        types = (type_of(state, name, queries), *state.matter.contents.get(name, ()))
        if any(map(can_heat, types)) and state.there(name) and (heat := queries.heated_by(state, name)) is not None:
            state = _warmed(state, name, *heat, seconds, queries)
    return state


# Changes by actions


def _transformed(state: WorldState, what: Transformed, queries: Queries) -> WorldState:
    """Destroy inputs and create outputs; no effect if no input exists."""
    inputs = {name: amount for name, amount in what.things if state.there(name)}
    places = [queries.pose(state, name) for name in (*inputs, *(name for name, _ in what.used)) if state.there(name)]
    sizes = [thing_of(state, name, queries).size for name in inputs]
    origins = merged(inputs, *map(state.matter.went_into, inputs))
    volume = sum(state.matter.total(name) or amount for name, amount in inputs.items())
    taken = list[Portion]()
    for name, type in what.used:
        state, portions = _consumed(state, name, type, queries)
        taken += portions
    if (what.things or what.used) and not inputs and not taken:
        return state
    for name in inputs:
        state = _destroyed(state, name)
    origins = merged(origins, *(portion.origins for portion in taken))
    volume += sum(portion.amount for portion in taken)
    vessel = what.vessel if what.vessel is not None and state.there(what.vessel) else None
    place = places[0] if places else (queries.pose(state, vessel) if vessel is not None else None)
    shift = 0.0
    for output in what.outputs:
        amount = volume if output.amount is not None and len(what.outputs) == 1 and volume else output.amount
        if vessel is not None and amount is not None:
            point = queries.pose(state, vessel).position
            state = _give(state, [Portion(output.type, amount, origins)], vessel, point, queries)
        elif place is not None:
            size = queries.rules.size(output.type) or (sizes[0] if sizes else PUDDLE)
            at = Pose((place.position[0] + shift, *place.position[1:]))
            state = _created(state, output.name, Made(output.type, size, at), origins, amount, queries)
            shift += size[0]
    return state


def _created(
    state: WorldState, name: str, made: Made, origins: Sequence[str], amount: float | None, queries: Queries
) -> WorldState:
    """Create a thing, at rest on what is below where it appears; ``amount`` [ml] of its class, if given."""
    matter = state.matter.created(name, origins)
    if amount is not None:
        matter = matter.put(name, Portion(made.type, amount, tuple(origins)))
    poses = {**state.poses, name: made.at}
    state = replace(state, poses=poses, made={**state.made, name: made}, matter=matter)
    rest = queries.rest(state, name)
    return state if rest is None else state.placed({name: rest})


def _destroyed(state: WorldState, name: str) -> WorldState:
    """Destroy a thing and its contents."""
    held = {one: grip for one, grip in state.held.items() if one != name}
    return replace(state.placed({name: None}), held=held, matter=state.matter.destroyed(name))


def _turned_over(state: WorldState, name: str, queries: Queries) -> WorldState:
    """Turn a thing over in place; no effect on a held one."""
    if not state.there(name) or name in state.carried():
        return state
    return state.placed({name: upright(queries.pose(state, name) @ Pose((0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0)))})


def _consumed(state: WorldState, name: str, type: str, queries: Queries) -> tuple[WorldState, list[Portion]]:
    """Take everything of a class out of a thing."""
    content = state.matter.contents.get(name, {})
    taken = {key: portion for key, portion in content.items() if queries.rules.is_a(key, type)}
    if not taken:
        return state, []
    left = {key: one for key, one in content.items() if key not in taken}
    return replace(state, matter=state.matter.holding(name, left)), list(taken.values())


def _poured(state: WorldState, source: str, target: str, amount: float, queries: Queries) -> tuple[WorldState, float]:
    """Move an amount [ml] of a thing's contents onto or into another thing; return the amount moved as well."""
    matter, portions = state.matter.take(source, amount)
    if not portions or not state.there(target):
        return state, 0.0
    state = replace(state, matter=matter)
    if not is_vessel(state, source, queries) and source not in matter.contents and state.there(source):
        state = _destroyed(state, source)
    pose = queries.pose(state, target)
    x, y, z = pose.position
    top = z + float(half_extents(pose, thing_of(state, target, queries).size)[2])
    state = _give(state, portions, target, (x, y, top), queries)
    return state, sum(portion.amount for portion in portions)


# Contents


def _give(state: WorldState, portions: Sequence[Portion], target: str, point: Point, queries: Queries) -> WorldState:
    """Put portions into an upright vessel, up to its capacity, or on another thing, at a point."""
    if is_vessel(state, target, queries) and queries.pose(state, target).rotation[2, 2] > STANDS:
        return _filled(state, portions, target, queries)
    for one in portions:
        if target in state.matter.origins and target in state.matter.contents:
            state = replace(state, matter=state.matter.put(target, one))
        else:
            state = _spread(state, one, target, point, queries)
    return state


def _filled(state: WorldState, portions: Sequence[Portion], vessel: str, queries: Queries) -> WorldState:
    """Put portions into a vessel; the overflow lands beside it."""
    body, matter = thing_of(state, vessel, queries), state.matter
    volume, room = sum(one.amount for one in portions), max(0.0, body.capacity - matter.total(vessel))
    share = 1.0 if volume <= room else room / volume
    matter = matter.cooled(vessel)
    for one in portions:
        matter = matter.put(vessel, Portion(one.type, one.amount * share, one.origins))
    state = replace(state, matter=matter)
    below = queries.under(state, vessel) if share < 1 else None
    if below is not None:
        pose = queries.pose(state, vessel)
        half_x, _, half_z = half_extents(pose, body.size).tolist()
        x, y, z = pose.position
        for one in portions:
            beside = (x + half_x + _size(one.type, queries)[0] / 2 + BESIDE, y, z - half_z)
            rest = Portion(one.type, one.amount * (1 - share), one.origins)
            state = _spread(state, rest, below, beside, queries)
    return state


def _spread(state: WorldState, portion: Portion, target: str, point: Point, queries: Queries) -> WorldState:
    """Put a portion on a thing: it joins a puddle of the same class, or becomes a new thing."""
    for name in filter(state.there, state.matter.origins):
        x, y, z = queries.pose(state, name).position
        is_near = math.dist((x, y), point[:2]) <= ONE_PUDDLE and z <= point[2] + ONE_PUDDLE / 2
        if is_near and portion.type == type_of(state, name, queries):
            return replace(state, matter=state.matter.put(name, portion))
    size = _size(portion.type, queries)
    name = _new_name(state, f"{local_name(portion.type)}_on_{target}", queries)
    made = Made(portion.type, size, Pose((point[0], point[1], point[2] + size[2] / 2)))
    return _created(state, name, made, portion.origins, portion.amount, queries)


def _size(type: str, queries: Queries) -> Size:
    return queries.rules.size(type) or PUDDLE


def _new_name(state: WorldState, wish: str, queries: Queries) -> str:
    """Find a name that nothing has or had."""
    number, name = 1, wish
    while not is_free(state, name, queries):
        number += 1
        name = f"{wish}_{number}"
    return name


# Heat


def _warmed(state: WorldState, name: str, device: str, within: bool, seconds: float, queries: Queries) -> WorldState:
    rules, matter = queries.rules, state.matter
    low, high = matter.heated.get(name, (0.0, 0.0))
    lies_on_lower = bool(queries.pose(state, name).rotation[2, 2] >= 0)
    low, high = low + seconds * (within or lies_on_lower), high + seconds * (within or not lies_on_lower)
    matter = matter.warmed(name, low, high)
    source, type_now = type_of(state, device, queries), type_of(state, name, queries)
    result = rules.result(type_now, source)
    if result is not None and max(low, high) >= result.seconds - ROUNDING:
        matter = matter.became(name, result.output, type_now)
    for type in matter.contents.get(name, {}):
        result = rules.result(type, source)
        if result is not None and max(low, high) >= result.seconds - ROUNDING:
            matter = matter.turned_into(name, type, result.output)
    return replace(state, matter=matter)
