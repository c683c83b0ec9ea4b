"""What actions bring about, done to the things of one world."""

from __future__ import annotations

from planlang.changes import Change, Poured, Switched, Transformed, TurnedOver
from planlang.geometry import Pose
from sim.changes import Changes, origins_of
from sim.matter import PUDDLE, Portion, merged


def do(changes: Changes, change: Change) -> float:
    """Make a change; return how much has flowed [ml]."""
    match change:
        case Poured(source, target, amount):
            return changes.pour(source, target, amount)
        case Transformed():
            _transform(changes, change)
        case TurnedOver(name):
            changes.turn_over(name)
        case Switched(name, state):
            changes.switch(name, state)
    return 0.0


def _transform(changes: Changes, what: Transformed) -> None:
    """Destroy and create; nothing happens where nothing is of what is to be destroyed or used up."""
    matter, bodies = changes.matter, changes.bodies
    usual = {name: amount for name, amount in what.things if name in bodies.bodies and name not in bodies.removed}
    places = [bodies.poses[name] for name in (*usual, *(name for name, _ in what.used))]
    sizes = [bodies.bodies[name].size for name in usual]
    origins = merged(usual, *(origins_of(changes, name) for name in usual))
    whole = sum(matter.total(name) or amount for name, amount in usual.items())
    taken = [portion for name, type in what.used for portion in changes.consume(name, type)]
    if (what.things or what.used) and not usual and not taken:
        return
    for name in usual:
        changes.destroy(name)
    origins = merged(origins, *(portion.origins for portion in taken))
    whole += sum(portion.amount for portion in taken)
    place = places[0] if places else (bodies.poses[what.vessel] if what.vessel is not None else None)
    shift = 0.0
    for output in what.outputs:
        amount = whole if output.amount is not None and len(what.outputs) == 1 and whole else output.amount
        if what.vessel is not None and amount is not None:
            changes.fill(what.vessel, Portion(output.type, amount, origins))
        elif place is not None:
            size = changes.rules.size(output.type) or (sizes[0] if sizes else PUDDLE)
            at = Pose((place.position[0] + shift, *place.position[1:]))
            changes.create(output.name, output.type, size, at, origins, amount)
            shift += size[0]
