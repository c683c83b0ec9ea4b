"""Effects of classes of actions, and of heat, as ontologies declare it (see object_change.omn)."""

from __future__ import annotations

import math
from collections.abc import Iterable

from planlang.diagnostics import BadInput, Span, error
from planlang.ontology import Literal, Ontology, Term, expand
from planlang.records import dataclass
from planlang.units import IncompatibleUnits, stated_number, unit_of_property

Classes = tuple[str, ...]
"""IRIs of classes."""


@dataclass(frozen=True, slots=True)
class Effects:
    """Changes that an action makes; classes and states are IRIs, a rate is in ml/s, an amount in ml."""

    destroyed: Classes = ()
    """Classes of objects that are destroyed when the action acts on them."""
    created: Classes = ()
    """One thing of each comes into being."""
    turned: Classes = ()
    """Classes of objects that are turned over when the action acts on them."""
    states: Classes = ()
    """The states that the device is put in, the nearest first."""
    flow_rate: float | None = None
    amount: float | None = None
    vessels: Classes = ()
    """Classes of vessels in which that comes into being, unless the action or its inputs are in another."""

    completes: Classes = ()
    """Classes of actions that are done with it: the changes of the nearest one around it are made, too."""

    def __bool__(self) -> bool:
        """Return True if the action changes anything."""
        return self != Effects()

    @property
    def lasts(self) -> bool:
        """True if doing it a second time changes something a second time; a device is merely on again."""
        return bool(self.destroyed or self.created or self.turned or self.flow_rate)


@dataclass(frozen=True, slots=True)
class HeatEffect:
    """A thing of ``inputs`` is of ``output``, once a side of it was for ``duration`` [s] over a device that is on."""

    inputs: Classes
    output: str
    devices: Classes
    duration: float


_NOTHING = Effects()


def effects_of(ontology: Ontology, action_class: str, ancestors: Iterable[str] | None = None) -> Effects:
    """Return what actions of a class change: what is declared for it, and for the classes above it.

    ``ancestors`` are these, the class itself and the nearest first, where the ontology does not know them all. Of what
    is created the narrowest classes count. A rate, an amount or a state that is nearer replaces a farther one. Raises
    BadInput for a number that is none.
    """
    table, levels = _declared(ontology), ontology.ancestors(action_class) if ancestors is None else ancestors
    found = [effects for cls in levels if cls in table for effects in table[cls]]
    if not found:
        return _NOTHING
    return Effects(
        destroyed=_each(one.destroyed for one in found),
        created=narrowest(ontology, _each(one.created for one in found)),
        turned=_each(one.turned for one in found),
        states=_each(one.states for one in found),
        flow_rate=next((one.flow_rate for one in found if one.flow_rate is not None), None),
        amount=next((one.amount for one in found if one.amount is not None), None),
        vessels=_each(one.vessels for one in found),
        completes=_each(one.completes for one in found),
    )


def heat_effects(ontology: Ontology) -> tuple[HeatEffect, ...]:
    """Return what heat changes, in the order of the files; raises BadInput for a number that is none."""
    found = []
    for individual in ontology.individuals(expand("HeatChange")):
        inputs, devices = (ontology.iris(individual, name) for name in ("inputsDestroyed", "deviceUsed"))
        duration = number_of_individual(ontology, individual, "duration")
        outputs = ontology.iris(individual, "outputsCreated")
        if duration is not None:
            found += [HeatEffect(inputs, output, devices, duration) for output in outputs]
    return tuple(found)


def narrowest(ontology: Ontology, classes: Iterable[str]) -> Classes:
    """Return those of some classes that have no other one below them."""
    every = tuple(dict.fromkeys(classes))
    return tuple(cls for cls in every if not any(cls != one and ontology.is_a(one, cls) for one in every))


def number_of_class(ontology: Ontology, classes: Iterable[str], name: str) -> float | None:
    """Return the number that the first of some classes, or the nearest above it, states for a property.

    Raises BadInput for what is no number from 0 on.
    """
    for cls in classes:
        for restriction in ontology.inherited_restrictions(cls, expand(name)):
            return _checked(restriction.filler, name, restriction.span)
    return None


def number_of_individual(ontology: Ontology, individual: str, name: str) -> float | None:
    """Return the number that is stated last of an individual, as :func:`number_of_class` does of a class."""
    found = tuple(ontology.triples(individual, expand(name)))
    return _checked(found[-1].object, name, found[-1].span) if found else None


def _declared(ontology: Ontology) -> dict[str, list[Effects]]:
    """Return what is declared for each class of actions; it is read once."""
    key = "planlang.effects"
    if key not in ontology.kept:
        table: dict[str, list[Effects]] = {}
        for individual in ontology.individuals(expand("ObjectChange")):
            effects = Effects(
                ontology.iris(individual, "inputsDestroyed"),
                ontology.iris(individual, "outputsCreated"),
                ontology.iris(individual, "turnedOver"),
                ontology.iris(individual, "toState"),
                number_of_individual(ontology, individual, "flowRate"),
                number_of_individual(ontology, individual, "amount"),
                ontology.iris(individual, "deviceUsed"),
                ontology.iris(individual, "completes"),
            )
            for action in ontology.iris(individual, "byAction"):
                table.setdefault(action, []).append(effects)
        ontology.kept[key] = table
    declared: dict[str, list[Effects]] = ontology.kept[key]
    return declared


def _each(several: Iterable[Classes]) -> Classes:
    return tuple(dict.fromkeys(cls for classes in several for cls in classes))


def _checked(term: Term, name: str, span: Span | None) -> float:
    try:
        number = float(stated_number(term, unit_of_property(name))) if isinstance(term, Literal) else -1.0
    except IncompatibleUnits as wrong:
        raise BadInput([error("M030", f"{name}: {wrong}", span)]) from None
    except ValueError:
        number = -1.0
    if not (math.isfinite(number) and number >= 0):
        text = term.value if isinstance(term, Literal) else str(term)
        raise BadInput([error("M002", f"{name} is {text!r}, not a finite number from 0 on", span)])
    return number
